//! The samples within a triangle, row by row, in integers.

use super::field::{Field, Tolerance};

/// A corner: column, row, height in quanta.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub x: i32,
    pub y: i32,
    pub z: i32,
}

/// Twice the area of a triangle in the plan; positive when it turns from the x axis (columns) to the y axis (rows).
#[inline]
pub(crate) fn area(a: (i32, i32), b: (i32, i32), c: (i32, i32)) -> i64 {
    let (ux, uy) = (i64::from(b.0 - a.0), i64::from(b.1 - a.1));
    let (vx, vy) = (i64::from(c.0 - a.0), i64::from(c.1 - a.1));
    ux * vy - uy * vx
}

/// Calls `f(y, x0, x1)` for every row of samples in the triangle, borders included. No division but one for each side.
#[inline(always)]
pub(crate) fn rows(a: (i32, i32), b: (i32, i32), c: (i32, i32), f: impl FnMut(i32, i32, i32)) {
    rows_with(true, a, b, c, f);
}

/// The same without the rows in which there is but a corner.
#[inline(always)]
pub(crate) fn rows_between(a: (i32, i32), b: (i32, i32), c: (i32, i32), f: impl FnMut(i32, i32, i32)) {
    rows_with(false, a, b, c, f);
}

#[inline(always)]
fn rows_with(corners: bool, a: (i32, i32), b: (i32, i32), c: (i32, i32), mut f: impl FnMut(i32, i32, i32)) {
    let mut v = [a, b, c];
    if v[0].1 > v[1].1 {
        v.swap(0, 1);
    }
    if v[1].1 > v[2].1 {
        v.swap(1, 2);
    }
    if v[0].1 > v[1].1 {
        v.swap(0, 1);
    }
    let [low, mid, high] = v;
    if low.1 == high.1 {
        return f(low.1, low.0.min(mid.0).min(high.0), low.0.max(mid.0).max(high.0));
    }
    let long_is_left = area(low, high, mid) <= 0;
    let mut long = Side::new(low, high);
    if low.1 < mid.1 {
        let mut short = Side::new(low, mid);
        let mut first = low.1;
        if !corners {
            first += 1;
            long.step();
            short.step();
        }
        for y in first..mid.1 {
            let (l, r) = if long_is_left { (&long, &short) } else { (&short, &long) };
            if l.ceil() <= r.floor() {
                f(y, l.ceil(), r.floor());
            }
            long.step();
            short.step();
        }
    }
    if mid.1 == high.1 {
        let (l, r) = (mid.0.min(high.0), mid.0.max(high.0));
        return f(mid.1, l, r);
    }
    let mut short = Side::new(mid, high);
    for y in mid.1..high.1 + i32::from(corners) {
        let (l, r) = if long_is_left { (&long, &short) } else { (&short, &long) };
        if l.ceil() <= r.floor() {
            f(y, l.ceil(), r.floor());
        }
        long.step();
        short.step();
    }
}

/// Where a side crosses one row after the other: `whole + rest / rows`.
struct Side {
    whole: i32,
    rest: i32,
    rows: i32,
    step_whole: i32,
    step_rest: i32,
}

impl Side {
    #[inline(always)]
    fn new(from: (i32, i32), to: (i32, i32)) -> Self {
        let (dx, rows) = (to.0 - from.0, to.1 - from.1);
        // Most sides cross one row or a few: no division where none is needed.
        let (step_whole, step_rest) = match rows {
            1 => (dx, 0),
            _ => (dx.div_euclid(rows), dx.rem_euclid(rows)),
        };
        Side { whole: from.0, rest: 0, rows, step_whole, step_rest }
    }

    #[inline(always)]
    fn step(&mut self) {
        self.whole += self.step_whole;
        self.rest += self.step_rest;
        if self.rest >= self.rows {
            self.whole += 1;
            self.rest -= self.rows;
        }
    }

    #[inline(always)]
    fn floor(&self) -> i32 {
        self.whole
    }

    #[inline(always)]
    fn ceil(&self) -> i32 {
        self.whole + i32::from(self.rest > 0)
    }
}

/// The plane of a triangle times its doubled area: `S(x, y) = at + dx (x - x0) + dy (y - y0)`, from its first corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub area: i64,
    pub at: i64,
    pub dx: i64,
    pub dy: i64,
}

impl Plane {
    #[inline(always)]
    pub(super) fn new(a: Corner, b: Corner, c: Corner) -> Self {
        let (ux, uy, uz) = (i64::from(b.x - a.x), i64::from(b.y - a.y), i64::from(b.z) - i64::from(a.z));
        let (vx, vy, vz) = (i64::from(c.x - a.x), i64::from(c.y - a.y), i64::from(c.z) - i64::from(a.z));
        let area = ux * vy - uy * vx;
        Plane { area, at: area * i64::from(a.z), dx: uz * vy - vz * uy, dy: ux * vz - vx * uz }
    }
}

/// The sample of a triangle that lies farthest from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Farthest {
    /// `|S - A h|`; 0 when every sample lies on the triangle.
    pub miss: i64,
    /// Index of the sample: the first of them.
    pub sample: u32,
    pub area: i64,
}

impl Farthest {
    pub(super) fn within(&self, tolerance: Tolerance) -> bool {
        self.miss <= tolerance.over(self.area)
    }
}

/// Samples of a row looked at together.
const LANES: usize = 8;

/// Below this doubled area heights of 24 bits give sums and products of 52, which f64 holds exactly.
const EXACT_IN_F64: i64 = 1 << 28;

/// Looks at every sample of a triangle that turns to the left and has no void sample.
#[inline]
pub(super) fn farthest(field: &Field, a: Corner, b: Corner, c: Corner) -> Farthest {
    let plane = Plane::new(a, b, c);
    let (mut miss, mut sample) = (0, 0u32);
    let columns = field.columns as usize;
    let vectors = plane.area < EXACT_IN_F64;
    let area = plane.area as f64;
    let steps: [f64; LANES] = std::array::from_fn(|i| (i as i64 * plane.dx) as f64);
    rows((a.x, a.y), (b.x, b.y), (c.x, c.y), |y, x0, x1| {
        let mut s = plane.at + plane.dx * i64::from(x0 - a.x) + plane.dy * i64::from(y - a.y);
        let mut first = y as usize * columns + x0 as usize;
        let row = &field.h[first..=first + (x1 - x0) as usize];
        let mut one_by_one = |s: i64, first: usize, part: &[i32]| {
            let mut s = s;
            for (i, &h) in part.iter().enumerate() {
                let e = (s - plane.area * i64::from(h)).abs();
                if e > miss {
                    miss = e;
                    sample = (first + i) as u32;
                }
                s += plane.dx;
            }
            miss
        };
        if !vectors || row.len() < LANES {
            one_by_one(s, first, row);
            return;
        }
        // In f64, without rounding; which of the eight it is only where one is farther than all before.
        let (chunks, rest) = row.as_chunks::<LANES>();
        let mut known = one_by_one(s, first, &[]) as f64;
        for chunk in chunks {
            let start = s as f64;
            let e: [f64; LANES] =
                std::array::from_fn(|i| (start + steps[i] - area * f64::from(chunk[i])).abs());
            let larger = |a: f64, b: f64| if a > b { a } else { b };
            let four: [f64; 4] = std::array::from_fn(|i| larger(e[i], e[i + 4]));
            if larger(larger(four[0], four[2]), larger(four[1], four[3])) > known {
                known = one_by_one(s, first, chunk) as f64;
            }
            s += plane.dx * LANES as i64;
            first += LANES;
        }
        one_by_one(s, first, rest);
    });
    Farthest { miss, sample, area: plane.area }
}

/// Where a side crosses an edge of the grid between its ends: `part / parts` of the way along the side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    pub part: i64,
    pub parts: i64,
    /// Height of the side less that of the grid there, in quanta, times `parts`.
    pub miss: i64,
    /// The samples at the ends of the grid's edge.
    pub ends: [u32; 2],
}

/// Calls `f` where a side crosses a row, a column or a diagonal of the grid between two samples. The side must lie in the valid region.
pub(super) fn crossings(field: &Field, a: Corner, b: Corner, mut f: impl FnMut(Crossing)) {
    let (dx, dy) = (i64::from(b.x - a.x), i64::from(b.y - a.y));
    let columns = field.columns as usize;
    // Lines of samples: their number between the ends, and the step from one end of a grid edge to the other.
    for (parts, step) in [(dx.abs(), columns), (dy.abs(), 1), ((dx - dy).abs(), columns + 1)] {
        let rise = i64::from(b.z) - i64::from(a.z);
        // A line along the lines themselves meets samples only.
        let (mut whole, mut rest) = ((a.x, a.y), (0i64, 0i64));
        if parts < 2 {
            continue;
        }
        let (qx, rx) = (dx.div_euclid(parts), dx.rem_euclid(parts));
        let (qy, ry) = (dy.div_euclid(parts), dy.rem_euclid(parts));
        for part in 1..parts {
            whole = (whole.0 + qx as i32, whole.1 + qy as i32);
            rest = (rest.0 + rx, rest.1 + ry);
            if rest.0 >= parts {
                (whole.0, rest.0) = (whole.0 + 1, rest.0 - parts);
            }
            if rest.1 >= parts {
                (whole.1, rest.1) = (whole.1 + 1, rest.1 - parts);
            }
            // On a column only the row is between samples, on a row only the column, on a diagonal both by as much.
            let along = rest.0.max(rest.1);
            if along == 0 {
                continue;
            }
            let first = whole.1 as usize * columns + whole.0 as usize;
            let (low, high) = (i64::from(field.h[first]), i64::from(field.h[first + step]));
            let grid = low * (parts - along) + high * along;
            let miss = i64::from(a.z) * parts + rise * part - grid;
            f(Crossing { part, parts, miss, ends: [first as u32, (first + step) as u32] });
        }
    }
}

/// Whether a side keeps the tolerance where it crosses edges of the grid.
pub(super) fn side_within(field: &Field, tolerance: Tolerance, a: Corner, b: Corner) -> bool {
    let mut within = true;
    crossings(field, a, b, |c| within &= c.miss.abs() <= tolerance.over(c.parts));
    within
}

/// Whether a triangle keeps the tolerance at its samples, and with `surface` all over, against the grid's triangles.
pub(super) fn keeps(field: &Field, tolerance: Tolerance, surface: bool, t: [Corner; 3]) -> bool {
    let [a, b, c] = t;
    let sides = [(a, b), (b, c), (c, a)];
    farthest(field, a, b, c).within(tolerance)
        && (!surface || sides.into_iter().all(|(p, q)| side_within(field, tolerance, p, q)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]
        /// Eight at a time or one, the farthest sample is the same.
        #[test]
        fn the_farthest_is_the_farthest(
            heights in proptest::collection::vec(-(1 << 24)..1i32 << 24, 40 * 6),
            z in proptest::array::uniform3(-(1 << 24)..1i32 << 24),
        ) {
            let grid = crate::Grid::new(40, 6, heights.iter().map(|&h| f64::from(h)).collect()).unwrap();
            let field = Field { h: heights.clone(), ..Field::new(&grid, 0.0) };
            let [a, b, c] = [(0, 0), (39, 1), (3, 5)];
            let corner = |(x, y), z| Corner { x, y, z };
            let far = farthest(&field, corner(a, z[0]), corner(b, z[1]), corner(c, z[2]));
            let mut most = (0, 0);
            for (i, &h) in heights.iter().enumerate() {
                let p = ((i % 40) as i32, (i / 40) as i32);
                let w = [area(b, c, p), area(c, a, p), area(a, b, p)];
                if w.iter().all(|&w| w >= 0) {
                    let s: i64 = (0..3).map(|k| w[k] * i64::from(z[k])).sum();
                    let miss = (s - far.area * i64::from(h)).abs();
                    if miss > most.0 {
                        most = (miss, i as u32);
                    }
                }
            }
            prop_assert_eq!((far.miss, far.sample), most);
        }

        /// Rows are the lattice points that three half planes hold.
        #[test]
        fn rows_hold_every_sample(p in proptest::array::uniform6(0..13i32)) {
            let (a, b, c) = ((p[0], p[1]), (p[2], p[3]), (p[4], p[5]));
            let (b, c) = if area(a, b, c) < 0 { (c, b) } else { (b, c) };
            prop_assume!(area(a, b, c) != 0);
            let mut seen = vec![];
            rows(a, b, c, |y, x0, x1| seen.extend((x0..=x1).map(|x| (x, y))));
            let inside = |p| area(a, b, p) >= 0 && area(b, c, p) >= 0 && area(c, a, p) >= 0;
            let all: Vec<_> = (0..13).flat_map(|y| (0..13).map(move |x| (x, y))).filter(|&p| inside(p)).collect();
            prop_assert_eq!(&seen, &all);
            // All but corners, too.
            let mut between = vec![];
            rows_between(a, b, c, |y, x0, x1| between.extend((x0..=x1).map(|x| (x, y))));
            prop_assert!(between.iter().all(|p| all.contains(p)));
            let corner = |p: &(i32, i32)| [a, b, c].contains(p);
            prop_assert!(all.iter().all(|p| corner(p) || between.contains(p)));
        }
    }
}
