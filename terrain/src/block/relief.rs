//! Heights that triangles are measured against.

use super::Vertex;
use super::shapes::Shapes;
use crate::tin::scan::{rows, rows_between_corners};
use crate::{Raster, RasterError, Window};

/// The heights of a window of a grid, or of a wide one the least and greatest of every square of samples.
#[derive(Clone, Debug)]
pub struct Relief {
    column: i32,
    row: i32,
    /// Samples along the side of a cell, 1 for the samples themselves.
    cell: i32,
    /// Cells in a row.
    across: usize,
    /// The heights, or the least ones; NaN where all are void.
    low: Vec<f32>,
    /// The greatest; empty for cells of one sample.
    high: Vec<f32>,
    /// For each sample how many from there on in its row have the same height, up to 255; empty where few have, and for larger cells.
    level: Vec<u8>,
    /// What rounding to f32 changed at most.
    rounding: f64,
    /// Greatest height without its sign.
    greatest: f64,
}

/// Level rows are looked for where one sample of so many has the height of the next.
const LEVEL: usize = 2;

/// Rows of cells read at once.
const BAND: usize = 64;

impl Relief {
    /// Reads a window. Cells are of one sample if at most `most` of them lie in it, or else of as few samples as that takes. O(samples), in memory for the cells.
    ///
    /// # Errors
    /// As [`Raster::read`].
    pub fn read(raster: &dyn Raster, window: Window, most: usize) -> Result<Self, RasterError> {
        let mut cell = 1usize;
        while window.columns.div_ceil(cell).saturating_mul(window.rows.div_ceil(cell)) > most.max(1) {
            cell += 1;
        }
        let across = window.columns.div_ceil(cell);
        let mut relief = Relief {
            column: window.column as i32,
            row: window.row as i32,
            cell: cell as i32,
            across,
            low: vec![],
            high: vec![],
            level: vec![],
            rounding: 0.0,
            greatest: 0.0,
        };
        let band = if cell == 1 { BAND } else { cell };
        let mut heights = vec![];
        for first in (0..window.rows).step_by(band) {
            let rows = band.min(window.rows - first);
            heights.resize(window.columns * rows, f64::NAN);
            raster
                .read(Window::new(window.column, window.row + first, window.columns, rows), &mut heights)?;
            relief.append(&heights, window.columns);
        }
        relief.find_level();
        Ok(relief)
    }

    /// Over a sea every triangle is as good as its samples are many: a row of equal heights is measured at its ends.
    fn find_level(&mut self) {
        if self.cell > 1 {
            return;
        }
        let equal = self.low.windows(2).filter(|h| h[0] == h[1]).count();
        if equal * LEVEL < self.low.len() {
            return;
        }
        self.level = vec![1; self.low.len()];
        for (heights, level) in
            self.low.chunks_exact(self.across).zip(self.level.chunks_exact_mut(self.across))
        {
            for k in (0..self.across.saturating_sub(1)).rev() {
                if heights[k] == heights[k + 1] {
                    level[k] = level[k + 1].saturating_add(1);
                }
            }
        }
    }

    fn append(&mut self, heights: &[f64], columns: usize) {
        let start = self.low.len();
        if self.cell == 1 {
            self.low.extend(heights.iter().map(|&h| h as f32));
        } else {
            self.low.resize(start + self.across, f32::NAN);
            self.high.resize(start + self.across, f32::NAN);
        }
        for (i, &h) in heights.iter().enumerate().filter(|(_, h)| !h.is_nan()) {
            let f = h as f32;
            self.rounding = self.rounding.max((h - f64::from(f)).abs());
            self.greatest = self.greatest.max(h.abs());
            if self.cell > 1 {
                let at = start + i % columns / self.cell as usize;
                // NaN gives way.
                self.low[at] = self.low[at].min(f);
                self.high[at] = self.high[at].max(f);
            }
        }
    }

    /// Heights are measured cell by cell, not sample by sample.
    #[must_use]
    pub fn is_coarse(&self) -> bool {
        self.cell > 1
    }

    /// The error of triangles that have no sample but their corners.
    pub(super) fn at_corners(&self) -> f64 {
        self.rounding
    }

    /// What is to be added to a greatest distance measured in f32 heights: what rounding them changed, and the arithmetic.
    fn allowance(&self) -> f64 {
        self.rounding + self.greatest * 1e-12
    }

    /// The greatest height less the least in the box of these vertices: no triangle of them is farther from a sample in it. O(samples in the box).
    pub(super) fn span(&self, vertices: impl Iterator<Item = Vertex>) -> f64 {
        let none = (i32::MAX, i32::MIN, i32::MAX, i32::MIN);
        let (x0, x1, y0, y1) =
            vertices.fold(none, |b, v| (b.0.min(v.x), b.1.max(v.x), b.2.min(v.y), b.3.max(v.y)));
        let cells =
            |a: i32, b: i32, from: i32| ((a - from) / self.cell) as usize..=((b - from) / self.cell) as usize;
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        let greatest = if self.cell == 1 { &self.low } else { &self.high };
        for line in cells(y0, y1, self.row) {
            for k in cells(x0, x1, self.column) {
                let at = line * self.across + k;
                // Void ones give way.
                (low, high) = (low.min(self.low[at]), high.max(greatest[at]));
            }
        }
        (f64::from(high) - f64::from(low)).max(0.0) + self.allowance()
    }

    fn fine(&self, [a, b, c]: [Vertex; 3], Plane { z, dx, dy }: Plane, enough: f64) -> f64 {
        let mut most = 0.0f64;
        // Corners are samples themselves.
        rows_between_corners((a.x, a.y), (b.x, b.y), (c.x, c.y), |y, x0, x1| {
            if most > enough {
                return;
            }
            let from = (y - self.row) as usize * self.across + (x0 - self.column) as usize;
            let heights = &self.low[from..=from + (x1 - x0) as usize];
            let mut at = z + dx * f64::from(x0 - a.x) + dy * f64::from(y - a.y);
            // Void samples compare as nothing.
            if heights.len() < 2 * LANES {
                for &h in heights {
                    let e = (at - f64::from(h)).abs();
                    most = if e > most { e } else { most };
                    at += dx;
                }
            } else if let Some(level) = self.level.get(from..=from + (x1 - x0) as usize) {
                most = most.max(level_row(heights, level, at, dx));
            } else {
                most = most.max(long_row(heights, at, dx));
            }
        });
        most
    }

    /// Over every cell that the triangle's rows touch, what the plane does over the part of it within the triangle's box.
    fn coarse(&self, [a, b, c]: [Vertex; 3], Plane { z, dx, dy }: Plane) -> f64 {
        let mut most = 0.0f64;
        let (mut line, mut left, mut right) = (i32::MIN, 0, 0);
        let mut flush = |line: i32, x0: i32, x1: i32, y0: i32, y1: i32| {
            let (lo, hi) = ((x0 - self.column) / self.cell, (x1 - self.column) / self.cell);
            for k in lo..=hi {
                let at = line as usize * self.across + k as usize;
                let first = self.column + k * self.cell;
                let (p, q) = (x0.max(first), x1.min(first + self.cell - 1));
                let at_corner = |x: i32, y: i32| z + dx * f64::from(x - a.x) + dy * f64::from(y - a.y);
                let corners = [at_corner(p, y0), at_corner(q, y0), at_corner(p, y1), at_corner(q, y1)];
                let (low, high) = (f64::from(self.low[at]), f64::from(self.high[at]));
                for t in corners {
                    let e = (t - low).max(high - t);
                    most = if e > most { e } else { most };
                }
            }
        };
        let (mut y0, mut y1) = (0, 0);
        rows((a.x, a.y), (b.x, b.y), (c.x, c.y), |y, x0, x1| {
            let own = (y - self.row) / self.cell;
            if own == line {
                (left, right, y1) = (left.min(x0), right.max(x1), y);
            } else {
                if line != i32::MIN {
                    flush(line, left, right, y0, y1);
                }
                (line, left, right, y0, y1) = (own, x0, x1, y, y);
            }
        });
        if line != i32::MIN {
            flush(line, left, right, y0, y1);
        }
        most
    }
}

/// Measures triangles against a relief.
#[derive(Clone, Debug)]
pub(super) struct Gauge<'a> {
    relief: &'a Relief,
    shapes: Shapes,
    /// Large triangles measured of late.
    seen: Vec<Seen>,
    /// [`Relief::allowance`].
    allowance: f64,
}

/// A triangle and its error, or less than that: whether it is all of it.
#[derive(Clone, Copy, Debug)]
struct Seen {
    corners: [i32; 6],
    error: f64,
    exact: bool,
}

/// Large triangles kept: a power of two. A vertex is looked at again whenever something around it changes, and most of its triangles are what they were.
const SEEN: usize = 1 << 12;

impl<'a> Gauge<'a> {
    pub(super) fn new(relief: &'a Relief) -> Self {
        let none = Seen { corners: [i32::MIN; 6], error: 0.0, exact: false };
        Gauge {
            relief,
            shapes: Shapes::new(relief.across),
            seen: vec![none; SEEN],
            allowance: relief.allowance(),
        }
    }

    /// The greatest vertical distance of a triangle from the samples in it, or a bound of that; more than `enough` need not be exact. O(samples in it).
    ///
    /// Orientation does not matter; a triangle that is flat in the plan has none.
    #[inline]
    pub(super) fn error(&mut self, [a, b, c]: [Vertex; 3], enough: f64) -> f64 {
        let (u, v) = ([b.x - a.x, b.y - a.y], [c.x - a.x, c.y - a.y]);
        let area = i64::from(u[0]) * i64::from(v[1]) - i64::from(u[1]) * i64::from(v[0]);
        let fine = self.relief.cell == 1;
        // A triangle of area 1 has no sample but its corners.
        if area.abs() <= 1 && fine || area == 0 {
            return if area == 0 { 0.0 } else { self.relief.rounding };
        }
        let (z, part) = (f64::from(a.z), 1.0 / area as f64);
        let (uz, vz) = (f64::from(b.z) - z, f64::from(c.z) - z);
        let plane = Plane {
            z,
            dx: (uz * f64::from(v[1]) - vz * f64::from(u[1])) * part,
            dy: (f64::from(u[0]) * vz - f64::from(v[0]) * uz) * part,
        };
        if fine && let Some(inside) = self.shapes.of(u, v) {
            let first = (a.y - self.relief.row) as isize * self.relief.across as isize
                + (a.x - self.relief.column) as isize;
            let mut most = 0.0f64;
            for p in inside {
                let height = self.relief.low.get((first + p.offset as isize) as usize);
                let at = plane.z + plane.dx * f64::from(p.x) + plane.dy * f64::from(p.y);
                let e = (at - f64::from(height.copied().unwrap_or(f32::NAN))).abs();
                // Void samples compare as nothing.
                most = if e > most { e } else { most };
            }
            return most + self.allowance;
        }
        self.large([a, b, c], area < 0, plane, enough)
    }

    fn large(&mut self, [a, b, c]: [Vertex; 3], turned: bool, plane: Plane, enough: f64) -> f64 {
        let corners = [a.x, a.y, b.x, b.y, c.x, c.y];
        // Fibonacci hashing.
        let mix = corners.iter().fold(0u64, |h, &x| {
            (h.rotate_left(11) ^ u64::from(x as u32)).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        });
        let at = (mix >> 52) as usize % SEEN;
        let seen = self.seen[at];
        if seen.corners == corners && (seen.exact || seen.error > enough) {
            return seen.error;
        }
        let (b, c) = if turned { (c, b) } else { (b, c) };
        let most = if self.relief.cell == 1 {
            self.relief.fine([a, b, c], plane, enough)
        } else {
            self.relief.coarse([a, b, c], plane)
        };
        let error = most + self.allowance;
        self.seen[at] = Seen { corners, error, exact: most <= enough };
        error
    }

    /// All samples are looked at, not cells of them.
    pub(super) fn is_fine(&self) -> bool {
        self.relief.cell == 1
    }

    /// What is added to every error that is not found to be 0.
    pub(super) fn allowance(&self) -> f64 {
        self.allowance
    }

    /// As [`Relief::span`].
    pub(super) fn span(&self, vertices: impl Iterator<Item = Vertex>) -> f64 {
        self.relief.span(vertices)
    }
}

/// The plane of a triangle: its height at the first corner, and what it rises by from column to column and from row to row.
#[derive(Clone, Copy, Debug)]
struct Plane {
    z: f64,
    dx: f64,
    dy: f64,
}

/// Samples of a row looked at together.
const LANES: usize = 4;

/// The greatest distance of samples in a row from a line that is at `start` over the first, and rises by `step` from one to the next.
#[inline(never)]
fn long_row(heights: &[f32], start: f64, step: f64) -> f64 {
    let mut lanes = [0.0f64; LANES];
    let (chunks, rest) = heights.as_chunks::<LANES>();
    let mut at = 0.0;
    for chunk in chunks {
        for (k, lane) in lanes.iter_mut().enumerate() {
            let e = (start + step * (at + k as f64) - f64::from(chunk[k])).abs();
            *lane = if e > *lane { e } else { *lane };
        }
        at += LANES as f64;
    }
    let mut most = lanes.into_iter().fold(0.0, f64::max);
    for &h in rest {
        let e = (start + step * at - f64::from(h)).abs();
        most = if e > most { e } else { most };
        at += 1.0;
    }
    most
}

/// As [`long_row`], to the last bit, where `level` says how many samples from each on have its height: the line runs away from these to one side, so
/// the first or the last of them is the farthest, and rounding keeps that order.
#[inline(never)]
fn level_row(heights: &[f32], level: &[u8], start: f64, step: f64) -> f64 {
    let (mut most, mut k) = (0.0f64, 0);
    let mut look = |k: usize| {
        let e = (start + step * k as f64 - f64::from(heights[k])).abs();
        most = if e > most { e } else { most };
    };
    while k < heights.len() {
        look(k);
        let last = (k + usize::from(level[k])).min(heights.len()) - 1;
        if last > k {
            look(last);
        }
        k = last + 1;
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;
    use proptest::prelude::*;

    fn brute(grid: &Grid, t: [Vertex; 3]) -> f64 {
        let side = |p: Vertex, q: Vertex, x: i32, y: i32| {
            f64::from(q.x - p.x) * f64::from(y - p.y) - f64::from(q.y - p.y) * f64::from(x - p.x)
        };
        let area = side(t[0], t[1], t[2].x, t[2].y);
        let mut most = 0.0f64;
        for y in 0..grid.rows() as i32 {
            for x in 0..grid.columns() as i32 {
                let w = [side(t[1], t[2], x, y), side(t[2], t[0], x, y), side(t[0], t[1], x, y)];
                if area == 0.0 || w.iter().any(|&w| w * area < 0.0) {
                    continue;
                }
                let z: f64 = (0..3).map(|k| w[k] / area * f64::from(t[k].z)).sum();
                most = most.max((z - grid.height(x as usize, y as usize).unwrap()).abs());
            }
        }
        most
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn errors_are_those_of_all_samples_and_cells_bound_them(
            heights in proptest::collection::vec(-50i32..50, 14 * 11),
            p in proptest::array::uniform3((0i32..14, 0i32..11)),
        ) {
            let grid = Grid::new(14, 11, heights.iter().map(|&h| f64::from(h)).collect()).unwrap();
            let t = p.map(|(x, y)| Vertex { x, y, z: grid.height(x as usize, y as usize).unwrap() as f32 });
            let want = brute(&grid, t);
            let all = Window::new(0, 0, 14, 11);
            let fine = Relief::read(&grid, all, 1000).unwrap();
            prop_assert!((Gauge::new(&fine).error(t, f64::INFINITY) - want).abs() < 1e-9);
            for most in [60, 20, 1] {
                let coarse = Relief::read(&grid, all, most).unwrap();
                prop_assert!(coarse.is_coarse());
                prop_assert!(Gauge::new(&coarse).error(t, f64::INFINITY) >= want);
            }
        }
    }

    proptest! {
        #[test]
        fn rows_with_level_parts_are_measured_as_others(
            parts in proptest::collection::vec((-3i32..3, 1usize..300), 1..8),
            (start, step) in (-9.0f64..9.0, -0.7f64..0.7),
        ) {
            let row: Vec<f64> =
                parts.iter().flat_map(|&(h, n)| std::iter::repeat_n(if h == -3 { f64::NAN } else { 0.1 * f64::from(h) }, n)).collect();
            let n = row.len();
            let grid = Grid::new(n, 2, [&row[..], &row[..]].concat()).unwrap();
            let mut relief = Relief::read(&grid, Window::new(0, 0, n, 2), 2 * n).unwrap();
            relief.level.clear();
            relief.find_level();
            if let Some(level) = relief.level.get(n..) {
                let heights = &relief.low[n..];
                let all = level_row(heights, level, start, step);
                prop_assert_eq!(all.to_bits(), long_row(heights, start, step).to_bits());
                for (k, &l) in level.iter().enumerate() {
                    let l = usize::from(l);
                    prop_assert!(l >= 1 && k + l <= n);
                    prop_assert!(l == 1 || heights[k..k + l].iter().all(|&h| h == heights[k]));
                }
            } else {
                prop_assert!(relief.low.windows(2).filter(|h| h[0] == h[1]).count() * LEVEL < 2 * n);
            }
        }
    }

    #[test]
    fn triangles_of_a_cell_have_a_sample_halfway() {
        let grid = Grid::new(9, 9, (0..81).map(|i| f64::from(i * 7919 % 101)).collect()).unwrap();
        let relief = Relief::read(&grid, Window::new(0, 0, 9, 9), 100).unwrap();
        let v = |(x, y): (i32, i32)| Vertex { x, y, z: grid.height(x as usize, y as usize).unwrap() as f32 };
        for t in [
            [(0, 0), (2, 0), (1, 1)],
            [(4, 4), (5, 6), (6, 6)],
            [(2, 7), (6, 1), (4, 3)],
            [(3, 1), (3, 3), (2, 0)],
        ] {
            for k in 0..3 {
                let t = [t[k], t[(k + 1) % 3], t[(k + 2) % 3]].map(v);
                assert!((Gauge::new(&relief).error(t, f64::INFINITY) - brute(&grid, t)).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn what_rounding_changes_is_added() {
        let heights: Vec<f64> = (0..9).map(|i| 1e8 + 0.3 * f64::from(i)).collect();
        let grid = Grid::new(3, 3, heights).unwrap();
        let relief = Relief::read(&grid, Window::new(0, 0, 3, 3), 9).unwrap();
        let v = |x: i32, y: i32| Vertex { x, y, z: grid.height(x as usize, y as usize).unwrap() as f32 };
        let t = [v(0, 0), v(2, 0), v(2, 2)];
        assert!(Gauge::new(&relief).error(t, f64::INFINITY) >= brute(&grid, t));
    }
}
