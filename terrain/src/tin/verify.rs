//! Checks a network against a grid. Slow and plain on purpose: it shares no code with what makes networks, so that both would have to be
//! wrong in the same way.

use super::astray::{grid_triangle, near_outline, sides_astray};
use super::{Contract, Tin};
use crate::Grid;
use std::collections::BTreeMap;

/// What a network does to a grid's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Verdict {
    /// The greatest vertical distance of a valid sample from a triangle over or under it.
    pub max_error: f64,
    /// Valid samples farther than the error given; decided without rounding where `exact`.
    pub beyond: usize,
    /// With [`Contract::Surface`]: the greatest distance anywhere from the grid's own triangles; else 0.
    pub surface_error: f64,
    /// Pieces of edges of the grid within a triangle with an end farther than the error given.
    pub pieces_beyond: usize,
    /// Valid samples that no triangle has, but for isolated ones.
    pub uncovered: usize,
    /// Valid samples of no grid triangle with three valid corners.
    pub isolated: usize,
    /// Void samples strictly within a triangle.
    pub over_void: usize,
    /// Triangles that turn the wrong way.
    pub turned: usize,
    /// Triangles without an area in the plan, or with a corner outside of the grid or of no vertex.
    pub flat: usize,
    /// Twice the area of all triangles, less that of the valid region: 0 when they cover it once. 0 also where the outline was not to be exact.
    pub excess_area: i64,
    /// Valid samples of the grid's valid triangles that nothing covers, near enough to the exact outline for a simplified one; else 0.
    pub dropped: usize,
    /// With a simplified outline, where areas cannot be compared: samples strictly within two triangles, and sides that two triangles have the same way
    /// round; else 0.
    pub overlapping: usize,
    /// Sides of one triangle only that are farther from the exact outline than allowed; 0 if it was to be exact.
    pub astray: usize,
    /// Whether heights, samples and error fit 128-bit integers together; otherwise f64 decided.
    pub exact: bool,
}

impl Verdict {
    /// Whether nothing is wrong.
    #[must_use]
    pub fn is_good(&self) -> bool {
        let covers = [self.uncovered, self.over_void, self.overlapping, self.astray];
        let wrong = [self.beyond, self.pieces_beyond, self.turned, self.flat];
        covers == [0; 4] && wrong == [0; 4] && self.excess_area == 0
    }
}

/// Whole multiples of a power of two.
struct Fixed {
    exponent: i32,
}

impl Fixed {
    /// The greatest power of two that all values are multiples of; `None` if they take more than 72 bits.
    fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (mut least, mut greatest) = (i32::MAX, i32::MIN);
        for v in values.filter(|&v| v != 0.0 && !v.is_nan()) {
            let (mantissa, exponent) = parts(v);
            least = least.min(exponent + mantissa.trailing_zeros() as i32);
            greatest = greatest.max(exponent + 64 - mantissa.leading_zeros() as i32);
        }
        if least == i32::MAX {
            return Some(Fixed { exponent: 0 });
        }
        // Areas take 34 bits beside, and the parts of a side 18.
        (greatest - least <= 72).then_some(Fixed { exponent: least })
    }

    fn integer(&self, v: f64) -> i128 {
        let (mantissa, exponent) = parts(v);
        let shift = exponent - self.exponent;
        let magnitude = i128::from(mantissa);
        let magnitude = if mantissa == 0 {
            0
        } else if shift >= 0 {
            magnitude << shift
        } else {
            magnitude >> -shift
        };
        if v < 0.0 { -magnitude } else { magnitude }
    }
}

/// Mantissa and exponent of a finite number, without its sign.
fn parts(v: f64) -> (u64, i32) {
    let bits = v.to_bits();
    let (exponent, fraction) = ((bits >> 52 & 0x7ff) as i32, bits & ((1 << 52) - 1));
    if exponent == 0 { (fraction, -1074) } else { (fraction | 1 << 52, exponent - 1075) }
}

/// Looks at every sample within the bounds of every triangle. `error` in the grid's units; infinity only measures.
///
/// O(samples within the bounds of triangles), one thread.
#[must_use]
pub fn verify(grid: &Grid, tin: &Tin, error: f64, contract: Contract) -> Verdict {
    check(grid, tin, error, contract, None)
}

/// The same for a network whose outline may lie up to `tolerance` samples from the exact one.
///
/// O(samples within the bounds of triangles + samples near the outline x tolerance^2), one thread.
#[must_use]
pub fn verify_outline(grid: &Grid, tin: &Tin, error: f64, tolerance: f64) -> Verdict {
    check(grid, tin, error, Contract::Samples, Some(tolerance))
}

fn check(grid: &Grid, tin: &Tin, error: f64, contract: Contract, outline: Option<f64>) -> Verdict {
    let bound = if error.is_finite() { error } else { 0.0 };
    let all = grid.heights().iter().chain(&tin.heights).copied().chain([bound]);
    let fixed = Fixed::of(all);
    let mut verdict = Verdict { exact: fixed.is_some(), ..Verdict::default() };
    let (columns, rows) = (grid.columns() as i64, grid.rows() as i64);
    // 1: covered, 2: beyond the error, 4: a void within a triangle, 8: strictly within one, 16: within two.
    let mut marks = vec![0u8; grid.heights().len()];
    let mut total = 0i64;
    for t in &tin.triangles {
        let corner = |v: u32| {
            let [x, y] = tin.points.get(v as usize)?.map(i64::from);
            let z = *tin.heights.get(v as usize)?;
            (x < columns && y < rows && z.is_finite()).then_some((x, y, z))
        };
        let (Some(a), Some(b), Some(c)) = (corner(t[0]), corner(t[1]), corner(t[2])) else {
            verdict.flat += 1;
            continue;
        };
        let cross = |a: (i64, i64, f64), b: (i64, i64, f64), x: i64, y: i64| {
            (b.0 - a.0) * (y - a.1) - (b.1 - a.1) * (x - a.0)
        };
        let area = cross(a, b, c.0, c.1);
        total += area;
        if area <= 0 {
            if area < 0 {
                verdict.turned += 1
            } else {
                verdict.flat += 1
            }
            continue;
        }
        for y in a.1.min(b.1).min(c.1)..=a.1.max(b.1).max(c.1) {
            for x in a.0.min(b.0).min(c.0)..=a.0.max(b.0).max(c.0) {
                let (u, v, w) = (cross(b, c, x, y), cross(c, a, x, y), cross(a, b, x, y));
                if u < 0 || v < 0 || w < 0 {
                    continue;
                }
                let i = (y * columns + x) as usize;
                let h = grid.heights()[i];
                let strictly = u > 0 && v > 0 && w > 0;
                if strictly {
                    marks[i] |= if marks[i] & 8 != 0 { 16 } else { 8 };
                }
                if h.is_nan() {
                    if strictly {
                        marks[i] |= 4;
                    }
                    continue;
                }
                marks[i] |= 1;
                let (miss, far) = match &fixed {
                    Some(f) => {
                        let weighted = |w: i64, z: f64| i128::from(w) * f.integer(z);
                        let sum = weighted(u, a.2) + weighted(v, b.2) + weighted(w, c.2);
                        let miss = (sum - weighted(area, h)).abs();
                        let value = miss as f64 / area as f64 * 2f64.powi(f.exponent);
                        (value, miss > weighted(area, bound))
                    }
                    None => {
                        let z = (u as f64 * a.2 + v as f64 * b.2 + w as f64 * c.2) / area as f64;
                        ((z - h).abs(), (z - h).abs() > bound)
                    }
                };
                verdict.max_error = verdict.max_error.max(miss);
                if far && error.is_finite() {
                    marks[i] |= 2;
                }
            }
        }
    }
    if contract == Contract::Surface {
        for t in &tin.triangles {
            pieces(grid, tin, *t, fixed.as_ref(), error, &mut verdict);
        }
    }
    let (mut expected, mut used) = (0, vec![false; marks.len()]);
    for y in 0..rows - 1 {
        for x in 0..columns - 1 {
            for lower in [true, false] {
                if let Some(triangle) = grid_triangle(grid, x, y, lower) {
                    expected += 1;
                    triangle.iter().for_each(|&[x, y]| used[(y * columns + x) as usize] = true);
                }
            }
        }
    }
    if let Some(tolerance) = outline {
        verdict.astray = sides_astray(grid, tin, tolerance, &mut verdict.overlapping);
        verdict.overlapping += marks.iter().filter(|&m| m & 16 != 0).count();
    } else {
        verdict.excess_area = total - expected;
    }
    for (i, &mark) in marks.iter().enumerate() {
        let valid = !grid.heights()[i].is_nan();
        verdict.isolated += usize::from(valid && !used[i]);
        if used[i] && mark & 1 == 0 {
            let at = [(i as i64 % columns) as f64, (i as i64 / columns) as f64];
            match outline {
                Some(tolerance) if near_outline(grid, at, tolerance) => verdict.dropped += 1,
                _ => verdict.uncovered += 1,
            }
        }
        verdict.beyond += usize::from(mark & 2 != 0);
        verdict.over_void += usize::from(mark & 4 != 0);
    }
    verdict
}

/// Cuts every edge of the grid near a triangle to the part within it, and looks at both ends: between them both surfaces are straight.
fn pieces(grid: &Grid, tin: &Tin, t: [u32; 3], fixed: Option<&Fixed>, error: f64, verdict: &mut Verdict) {
    let known = t.iter().all(|&v| (v as usize) < tin.points.len().min(tin.heights.len()));
    if !known {
        return;
    }
    let p = t.map(|v| tin.points[v as usize].map(i64::from));
    let z = t.map(|v| tin.heights[v as usize]);
    let side = |i: usize, q: [i64; 2]| {
        let (a, b) = (p[i], p[(i + 1) % 3]);
        (b[0] - a[0]) * (q[1] - a[1]) - (b[1] - a[1]) * (q[0] - a[0])
    };
    let area = side(0, p[2]);
    if area <= 0 {
        return;
    }
    let ends = |axis: usize| {
        let of = p.map(|p| p[axis]);
        (of[0].min(of[1]).min(of[2]), of[0].max(of[1]).max(of[2]))
    };
    let ((x0, x1), (y0, y1)) = (ends(0), ends(1));
    for y in y0..=y1 {
        for x in x0..=x1 {
            for step in [[1, 0], [0, 1], [1, 1]] {
                let (from, to) = ([x, y], [x + step[0], y + step[1]]);
                let height = |q: [i64; 2]| grid.height(q[0] as usize, q[1] as usize);
                let (Some(low), Some(high)) = (height(from), height(to)) else { continue };
                // The part of the edge from n0 / d0 to n1 / d1 lies on the inner side of all three sides.
                let ((mut n0, mut d0), (mut n1, mut d1)) = ((0i64, 1i64), (1i64, 1i64));
                let mut nothing = false;
                for i in 0..3 {
                    let (f, g) = (side(i, from), side(i, to));
                    match (f >= 0, g >= 0) {
                        (true, true) => {}
                        (false, false) => nothing = true,
                        (false, true) if -f * d0 <= n0 * (g - f) => {}
                        (false, true) => (n0, d0) = (-f, g - f),
                        (true, false) if f * d1 >= n1 * (f - g) => {}
                        (true, false) => (n1, d1) = (f, f - g),
                    }
                }
                if nothing || n0 * d1 >= n1 * d0 {
                    continue;
                }
                let mut beyond = false;
                for (n, d) in [(n0, d0), (n1, d1)] {
                    let weights = |q: [i64; 2]| [side(1, q), side(2, q), side(0, q)];
                    let (u, v) = (weights(from), weights(to));
                    // The triangle's plane, and the grid's edge, both at n / d.
                    let value = match fixed {
                        Some(fixed) => {
                            let miss = |w: [i64; 3], h: f64| {
                                let sum: i128 = (0..3).map(|i| i128::from(w[i]) * fixed.integer(z[i])).sum();
                                sum - i128::from(area) * fixed.integer(h)
                            };
                            let all = miss(u, low) * i128::from(d - n) + miss(v, high) * i128::from(n);
                            let most = i128::from(area) * i128::from(d);
                            beyond |= error.is_finite() && all.abs() > most * fixed.integer(error);
                            all as f64 / most as f64 * 2f64.powi(fixed.exponent)
                        }
                        None => {
                            let miss = |w: [i64; 3], h: f64| {
                                (0..3).map(|i| w[i] as f64 * z[i]).sum::<f64>() / area as f64 - h
                            };
                            let part = n as f64 / d as f64;
                            let value = miss(u, low) * (1.0 - part) + miss(v, high) * part;
                            beyond |= value.abs() > error;
                            value
                        }
                    };
                    verdict.surface_error = verdict.surface_error.max(value.abs());
                }
                verdict.pieces_beyond += usize::from(beyond);
            }
        }
    }
}

/// How many of these straight lines between samples are not followed by sides of triangles from end to end. Looks at the triangles alone.
/// O(triangles log triangles + sides along the lines).
#[must_use]
pub fn lines_missing(tin: &Tin, lines: &[[[u32; 2]; 2]]) -> usize {
    let mut neighbours: BTreeMap<[u32; 2], Vec<[u32; 2]>> = BTreeMap::new();
    for t in &tin.triangles {
        for i in 0..3 {
            let ends = (tin.points.get(t[i] as usize), tin.points.get(t[(i + 1) % 3] as usize));
            if let (Some(&a), Some(&b)) = ends {
                neighbours.entry(a).or_default().push(b);
                neighbours.entry(b).or_default().push(a);
            }
        }
    }
    let follows = |&[a, b]: &[[u32; 2]; 2]| {
        let [dx, dy] = [0, 1].map(|k| i64::from(b[k]) - i64::from(a[k]));
        let mut at = a;
        while at != b {
            let ahead = |p: &&[u32; 2]| {
                let [x, y] = [0, 1].map(|k| i64::from(p[k]) - i64::from(at[k]));
                x * dy == y * dx && x * dx + y * dy > 0
            };
            match neighbours.get(&at).and_then(|n| n.iter().find(ahead)) {
                Some(&next) => at = next,
                None => return false,
            }
            // Past the end.
            let [x, y] = [0, 1].map(|k| i64::from(b[k]) - i64::from(at[k]));
            if x * dx + y * dy < 0 {
                return false;
            }
        }
        true
    };
    lines.iter().filter(|line| !follows(line)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat_square() -> (Grid, Tin) {
        let grid = Grid::new(3, 3, vec![0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let tin = Tin {
            points: vec![[0, 0], [2, 0], [2, 2], [0, 2]],
            heights: vec![0.0; 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        (grid, tin)
    }

    #[test]
    fn the_greatest_error_is_found_and_the_bound_is_exact() {
        let (grid, tin) = flat_square();
        let verdict = verify(&grid, &tin, 0.3, Contract::Samples);
        assert!(verdict.is_good() && verdict.exact, "{verdict:?}");
        assert_eq!(verdict.max_error, 0.3);
        assert_eq!(verify(&grid, &tin, 0.3f64.next_down(), Contract::Samples).beyond, 1);
    }

    #[test]
    fn between_samples_the_diagonals_decide() {
        // A cell whose diagonal runs the other way in the network: the middle is 1 too high.
        let grid = Grid::new(2, 2, vec![0.0, 2.0, 2.0, 0.0]).unwrap();
        let tin = Tin {
            points: vec![[0, 0], [1, 0], [1, 1], [0, 1]],
            heights: vec![0.0, 2.0, 0.0, 2.0],
            triangles: vec![[0, 1, 3], [1, 2, 3]],
        };
        assert!(verify(&grid, &tin, 0.0, Contract::Samples).is_good());
        let verdict = verify(&grid, &tin, 1.9, Contract::Surface);
        assert_eq!((verdict.surface_error, verdict.pieces_beyond), (2.0, 2));
        assert!(verify(&grid, &tin, 2.0, Contract::Surface).is_good());
    }

    #[test]
    fn lines_without_sides_are_counted() {
        let (_, tin) = flat_square();
        let lines =
            [[[0, 0], [2, 2]], [[2, 2], [0, 0]], [[0, 2], [2, 0]], [[0, 0], [1, 1]], [[0, 0], [2, 0]]];
        assert_eq!(lines_missing(&tin, &lines), 2);
    }

    #[test]
    fn what_is_wrong_is_counted() {
        let (grid, mut tin) = flat_square();
        tin.triangles[1] = [0, 3, 2];
        let verdict = verify(&grid, &tin, 1.0, Contract::Samples);
        assert_eq!((verdict.turned, verdict.uncovered, verdict.excess_area), (1, 3, -8));
        tin.triangles[1] = [0, 2, 2];
        assert_eq!(verify(&grid, &tin, 1.0, Contract::Samples).flat, 1);
        tin.triangles[1] = [0, 2, 9];
        assert_eq!(verify(&grid, &tin, 1.0, Contract::Samples).flat, 1);
    }

    #[test]
    fn voids_and_what_they_isolate() {
        let (_, tin) = flat_square();
        let mut heights = vec![0.0; 9];
        (heights[1], heights[3]) = (f64::NAN, f64::NAN);
        let grid = Grid::new(3, 3, heights).unwrap();
        let verdict = verify(&grid, &tin, 1.0, Contract::Samples);
        assert_eq!((verdict.isolated, verdict.over_void), (3, 0));
        assert!(!verdict.is_good());
        let mut heights = vec![0.0; 25];
        heights[6 + 2] = f64::NAN;
        let grid = Grid::new(5, 5, heights).unwrap();
        let points = vec![[0, 0], [4, 0], [4, 4], [0, 4]];
        let tin = Tin { points, heights: vec![0.0; 4], ..flat_square().1 };
        assert_eq!(verify(&grid, &tin, 1.0, Contract::Samples).over_void, 1);
    }
}
