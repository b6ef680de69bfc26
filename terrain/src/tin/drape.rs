//! Breaklines laid on the ground.
//!
//! A straight side between two samples that are far apart has no sample to keep it near the ground in between, whatever error its triangles keep at the samples beside it: it would cut through
//! hills, as a wall no wider than a cell. So a long line becomes shorter ones, over the samples nearest to it, where that is needed.

use crate::Grid;

type Line = [[u32; 2]; 2];

/// Pieces are cut no nearer to their ends than this part of their length, so that there are never many cuts of little use.
const END: f64 = 0.125;

/// The same lines in pieces from sample to sample, each with its straight side within `error` of the grid's own surface (diagonals from `(x, y)` to `(x + 1, y + 1)`), or no longer than one step. What lies over voids is not
/// looked at. Cuts are samples of the columns (of a steep line, rows) that it passes, the nearest there: it is led beside itself by at most half a step. Lines beyond the grid stay whole. O(l log l) for a line of l steps.
#[must_use]
pub fn drape(grid: &Grid, lines: &[Line], error: f64) -> Vec<Line> {
    let mut out = Vec::with_capacity(lines.len());
    let mut pieces = vec![];
    let inside = |p: &[u32; 2]| (p[0] as usize) < grid.columns() && (p[1] as usize) < grid.rows();
    for &[a, b] in lines {
        if ![a, b].iter().all(inside) {
            out.push([a, b]);
            continue;
        }
        // The longer way goes along columns or along rows.
        let k = usize::from(a[0].abs_diff(b[0]) < a[1].abs_diff(b[1]));
        let [p, q, r, s] = [a[k], b[k], a[1 - k], b[1 - k]].map(f64::from);
        let nearest = |along: u32| {
            let beside = (r + (f64::from(along) - p) / (q - p) * (s - r)).round() as u32;
            if k == 0 { [along, beside] } else { [beside, along] }
        };
        pieces.push([a, b]);
        while let Some([a, b]) = pieces.pop() {
            match cut(grid, [a, b], error) {
                Some(t) => {
                    let (from, to) = (i64::from(a[k]), i64::from(b[k]));
                    let least = (from.min(to) + 1).max(0);
                    let along = from + (t * (to - from) as f64).round() as i64;
                    let p = nearest(along.clamp(least, (from.max(to) - 1).max(least)) as u32);
                    pieces.extend([[p, b], [a, p]]);
                }
                None => out.push([a, b]),
            }
        }
    }
    out
}

/// How far along a line to cut it; `None` if it may stay, which a line of one step always may.
fn cut(grid: &Grid, [a, b]: Line, error: f64) -> Option<f64> {
    let [from, to] = [a, b].map(|p| p.map(i128::from));
    let way = [to[0] - from[0], to[1] - from[1]];
    let end = |p: [u32; 2]| grid.height(p[0] as usize, p[1] as usize);
    let ends = end(a).zip(end(b));
    if way[0].abs().max(way[1].abs()) < 2 {
        return None;
    }
    let mut worst = (error, None);
    let mut look = |part: i128, all: i128| {
        let Some(ground) = ground(grid, [0, 1].map(|k| from[k] * all + part * way[k]), all) else { return };
        // What begins over a void comes nearer to the ground by halves.
        let Some((low, high)) = ends else { return worst.1 = Some(0.5) };
        let t = part as f64 / all as f64;
        let off = (low + t * (high - low) - ground).abs();
        if off > worst.0 {
            worst = (off, Some(t));
        }
    };
    // Columns, rows and diagonals: between them the surface is flat along the line.
    for (first, last) in [(from[0], to[0]), (from[1], to[1]), (from[0] - from[1], to[0] - to[1])] {
        let all = (last - first).abs();
        (first.min(last) + 1..first.max(last)).for_each(|k| look((k - first).abs(), all));
    }
    worst.1.map(|t| t.clamp(END, 1.0 - END))
}

/// The height of the grid's surface at a place, in so many parts of a step; `None` over voids. In whole numbers: rounded, a place on an edge would be a little inside of the triangle beside it, and over a void if that has a corner there.
fn ground(grid: &Grid, place: [i128; 2], parts: i128) -> Option<f64> {
    let [c, r] = place.map(|x| x.div_euclid(parts) as usize);
    let [fx, fy] = place.map(|x| x.rem_euclid(parts));
    let (small, large) = (fx.min(fy), fx.max(fy));
    let middle = if fx >= fy { (1, 0) } else { (0, 1) };
    let mut sum = 0.0;
    // Corners without a weight may be void, or beyond the grid.
    for (weight, (dx, dy)) in [(parts - large, (0, 0)), (large - small, middle), (small, (1, 1))] {
        if weight > 0 {
            sum += weight as f64 / parts as f64 * grid.height(c + dx, r + dy)?;
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grid(seed: u64) -> Grid {
        let height = |i: u64| {
            let (x, y) = ((i % 40) as f64, (i / 40) as f64);
            let noise = ((i * 2_654_435_761 + seed * 97) % 1000) as f64 / 1000.0;
            60.0 * (x * 0.2 + seed as f64).sin() * (y * 0.15).cos() + 3.0 * noise
        };
        let heights = (0..40 * 30).map(|i| if seed % 3 == 1 && i % 97 == 0 { f64::NAN } else { height(i) });
        Grid::new(40, 30, heights.collect()).unwrap()
    }

    /// The surface by its triangles, rounded; `None` over voids.
    fn surface(grid: &Grid, x: f64, y: f64) -> Option<f64> {
        let (c, r) = (x.floor(), y.floor());
        let (fx, fy) = (x - c, y - r);
        let middle = if fx >= fy { (1, 0) } else { (0, 1) };
        let weights = [1.0 - fx.max(fy), (fx - fy).abs(), fx.min(fy)];
        let corners = weights.into_iter().zip([(0, 0), middle, (1, 1)]).filter(|&(weight, _)| weight > 0.0);
        corners.map(|(w, (dx, dy))| Some(w * grid.height(c as usize + dx, r as usize + dy)?)).sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn pieces_lie_on_the_ground_near_their_line(
            seed in 0u64..50, ends in [(0u32..40, 0u32..30), (0u32..40, 0u32..30)], error in 0.5f64..20.0,
        ) {
            lies_on_the_ground(seed, ends.map(|(x, y)| [x, y]), error)?;
        }
    }

    #[test]
    fn places_beside_a_void_are_looked_at() {
        // It crosses sides of triangles that have a void at their other corner: rounded, it would be over that there.
        lies_on_the_ground(34, [[31, 7], [2, 18]], 0.5).unwrap();
    }

    #[test]
    fn edges_of_triangles_with_a_void_are_ground() {
        let heights = (0..16).map(|i| if i == 6 { f64::NAN } else { f64::from(i * i) });
        let grid = Grid::new(4, 4, heights.collect()).unwrap();
        // By twelfths: over a void only in the triangles around it, but for their far sides.
        for i in 0..=36 {
            for j in 0..=36 {
                let have = ground(&grid, [i, j], 12);
                let want = surface(&grid, i as f64 / 12.0, j as f64 / 12.0);
                // From the void, (2, 1).
                let (x, y) = (i - 24, j - 12);
                let near = x.abs().max(y.abs()).max((x - y).abs()) < 12;
                assert_eq!(have.is_none(), near, "{i} {j}");
                // The judge may err at sides.
                assert!(have.zip(want).is_none_or(|(a, b)| (a - b).abs() < 1e-9), "{i} {j}");
            }
        }
    }

    /// Brute force: by many places of every piece.
    fn lies_on_the_ground(seed: u64, line: Line, error: f64) -> Result<(), TestCaseError> {
        let grid = grid(seed);
        let pieces = drape(&grid, &[line], error);
        prop_assert_eq!((pieces[0][0], pieces[pieces.len() - 1][1]), (line[0], line[1]));
        prop_assert!(pieces.windows(2).all(|w| w[0][1] == w[1][0]));
        let [a, b] = line.map(|p| p.map(f64::from));
        for piece in &pieces {
            let [p, q] = piece.map(|p| p.map(f64::from));
            let steps = (b[0] - a[0]).abs().max((b[1] - a[1]).abs()).max(1.0);
            for [x, y] in [p, q] {
                let beside = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])).abs() / steps;
                prop_assert!(beside <= 0.5 + 1e-9, "{beside}");
            }
            let height = |p: [u32; 2]| grid.height(p[0] as usize, p[1] as usize);
            let (Some(low), Some(high)) = (height(piece[0]), height(piece[1])) else { continue };
            if (p[0] - q[0]).abs().max((p[1] - q[1]).abs()) < 2.0 {
                continue;
            }
            for k in 0..=400 {
                let t = f64::from(k) / 400.0;
                let here = surface(&grid, p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]));
                prop_assert!(here.is_none_or(|z| (z - low - t * (high - low)).abs() <= error + 1e-9));
            }
        }
        Ok(())
    }

    #[test]
    fn what_lies_on_the_ground_stays_whole() {
        let plane = Grid::new(20, 20, (0..400).map(|i| f64::from(i % 20) * 3.0).collect()).unwrap();
        let lines = [[[0, 3], [19, 16]], [[5, 5], [5, 5]], [[2, 0], [2, 19]]];
        assert_eq!(drape(&plane, &lines, 0.1), lines);
        // A ridge that the line crosses, with a sample on it.
        let ridge =
            Grid::new(9, 9, (0..81).map(|i| 100.0 - 10.0 * f64::from((i % 9 - 4i32).abs())).collect());
        assert_eq!(drape(&ridge.unwrap(), &[[[0, 1], [8, 1]]], 1.0), [[[0, 1], [4, 1]], [[4, 1], [8, 1]]]);
        // From a void over the ridge.
        let heights =
            (0..81).map(|i| if i % 9 == 0 { f64::NAN } else { 10.0 * f64::from((i % 9 - 4i32).abs()) });
        let shore = Grid::new(9, 9, heights.collect()).unwrap();
        let pieces = drape(&shore, &[[[0, 1], [8, 1]]], 1.0);
        assert!(pieces.contains(&[[4, 1], [8, 1]]), "{pieces:?}");
        assert_eq!(
            drape(&plane, &[[[0, 0], [u32::MAX, 99]]], 0.0),
            [[[0, 0], [u32::MAX, 99]]],
            "beyond the grid"
        );
    }
}
