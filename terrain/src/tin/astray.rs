//! Checks an outline against the exact one. Plain code, for [`verify`](super::verify()) alone: nothing that makes networks uses it.

use super::Tin;
use crate::Grid;
use std::collections::BTreeMap;

/// The corners of the lower or the upper triangle of a cell, if all are valid.
pub(super) fn grid_triangle(grid: &Grid, x: i64, y: i64, lower: bool) -> Option<[[i64; 2]; 3]> {
    let corners = [[x, y], if lower { [x + 1, y] } else { [x, y + 1] }, [x + 1, y + 1]];
    let valid = |[x, y]: [i64; 2]| x >= 0 && y >= 0 && grid.height(x as usize, y as usize).is_some();
    corners.into_iter().all(valid).then_some(corners)
}

/// Distances are compared with this much to spare.
const ROUNDING: f64 = 1e-9;

/// Whether an edge of the grid with one valid triangle is within a distance of a point.
pub(super) fn near_outline(grid: &Grid, [px, py]: [f64; 2], tolerance: f64) -> bool {
    let reach = tolerance.min(65_536.0).ceil() as i64 + 1;
    let (cx, cy) = (px.floor() as i64, py.floor() as i64);
    let is = |x, y, lower| grid_triangle(grid, x, y, lower).is_some();
    for y in (cy - reach).max(0)..=(cy + reach).min(grid.rows() as i64 - 1) {
        for x in (cx - reach).max(0)..=(cx + reach).min(grid.columns() as i64 - 1) {
            let edges = [
                ([1, 0], is(x, y, true), is(x, y - 1, false)),
                ([0, 1], is(x - 1, y, true), is(x, y, false)),
                ([1, 1], is(x, y, true), is(x, y, false)),
            ];
            for ([dx, dy], one, other) in edges {
                if one == other {
                    continue;
                }
                let (ux, uy) = (px - x as f64, py - y as f64);
                let (dx, dy) = (dx as f64, dy as f64);
                let t = ((ux * dx + uy * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
                if (ux - t * dx).hypot(uy - t * dy) <= tolerance + ROUNDING {
                    return true;
                }
            }
        }
    }
    false
}

/// Sides of one triangle only that leave the neighbourhood of the exact outline, by their ends and points a quarter of a sample apart; sides that
/// two triangles have the same way round are counted in `doubled`.
pub(super) fn sides_astray(grid: &Grid, tin: &Tin, tolerance: f64, doubled: &mut usize) -> usize {
    let mut sides: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for t in &tin.triangles {
        for i in 0..3 {
            *sides.entry([t[i], t[(i + 1) % 3]]).or_default() += 1;
        }
    }
    *doubled += sides.values().filter(|&&count| count > 1).count();
    let astray = |[a, b]: &[u32; 2]| {
        let (Some(p), Some(q)) = (tin.points.get(*a as usize), tin.points.get(*b as usize)) else {
            return false;
        };
        let [p, q] = [p, q].map(|p| p.map(f64::from));
        let steps = 4.0 * (q[0] - p[0]).abs().max((q[1] - p[1]).abs());
        (0..=steps as usize).any(|k| {
            let part = k as f64 / steps.max(1.0);
            !near_outline(grid, [0, 1].map(|i| p[i] + (q[i] - p[i]) * part), tolerance)
        })
    };
    sides.keys().filter(|&&[a, b]| !sides.contains_key(&[b, a])).filter(|side| astray(side)).count()
}
