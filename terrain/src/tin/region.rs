//! The valid region: the union of the grid triangles whose three corners are valid. The diagonal of a cell runs from `(x, y)` to
//! `(x + 1, y + 1)`.

use super::delaunay::{HULL, Triangulation};
use super::field::{Field, VOID};
use super::outline::Outline;

/// The triangle of a cell that has its corner `(x + 1, y)`.
const FIRST: u8 = 1;
/// The one with `(x, y + 1)`.
const SECOND: u8 = 2;

#[derive(Clone, Debug)]
pub(super) struct Region {
    columns: i32,
    rows: i32,
    /// The valid triangles of every cell, row after row; empty when all are.
    cells: Vec<u8>,
    /// Valid samples at no valid triangle.
    pub isolated: usize,
    /// Valid samples.
    pub valid: usize,
    /// Valid triangles.
    pub triangles: usize,
    /// The outline to keep instead of the exact one.
    pub simplified: Option<Outline>,
}

/// A straight run of the outline, or a part of one, between two of its corners.
type Run = [(i32, i32); 2];

impl Region {
    /// O(samples).
    pub(super) fn new(field: &Field) -> Self {
        let (columns, rows) = (field.columns, field.rows);
        let count = (i64::from(columns - 1).max(0) * i64::from(rows - 1).max(0)) as usize;
        let valid = field.h.iter().filter(|&&h| h != VOID).count();
        let mut region = Region {
            columns,
            rows,
            cells: vec![],
            isolated: 0,
            valid,
            triangles: 2 * count,
            simplified: None,
        };
        if valid == field.h.len() && count > 0 {
            return region;
        }
        region.cells.reserve_exact(count);
        region.triangles = 0;
        let mut used = vec![false; field.h.len()];
        for y in 0..rows - 1 {
            for x in 0..columns - 1 {
                let i = field.index(x, y);
                let (right, up, both) = (i + 1, i + columns as usize, i + 1 + columns as usize);
                let is = |i: usize| field.h[i] != VOID;
                let mut cell = 0;
                if is(i) && is(both) {
                    for (corner, bit) in [(right, FIRST), (up, SECOND)] {
                        if is(corner) {
                            cell |= bit;
                            region.triangles += 1;
                            (used[i], used[both], used[corner]) = (true, true, true);
                        }
                    }
                }
                region.cells.push(cell);
            }
        }
        region.isolated = valid - used.iter().filter(|&&u| u).count();
        region
    }

    /// Whether it is the whole rectangle.
    pub(super) fn is_full(&self) -> bool {
        self.cells.is_empty() && self.triangles > 0
    }

    fn has(&self, x: i32, y: i32, bit: u8) -> bool {
        let inside = x >= 0 && y >= 0 && x < self.columns - 1 && y < self.rows - 1;
        inside
            && (self.is_full()
                || self.cells[y as usize * (self.columns as usize - 1) + x as usize] & bit != 0)
    }

    /// Whether the triangles on both sides of the edge from `(x, y)` to `(x, y + 1)` are valid: the one of lower columns first.
    pub(super) fn beside_column(&self, x: i32, y: i32) -> [bool; 2] {
        [self.has(x - 1, y, FIRST), self.has(x, y, SECOND)]
    }

    /// The same of the edge from `(x, y)` to `(x + 1, y)`: the one of lower rows first.
    pub(super) fn beside_row(&self, x: i32, y: i32) -> [bool; 2] {
        [self.has(x, y - 1, SECOND), self.has(x, y, FIRST)]
    }

    /// All valid triangles of the grid, as indices of their samples, row by row.
    pub(super) fn grid_triangles(&self) -> Vec<[u32; 3]> {
        let mut triangles = Vec::with_capacity(self.triangles);
        let columns = self.columns as u32;
        for y in 0..self.rows - 1 {
            for x in 0..self.columns - 1 {
                let i = y as u32 * columns + x as u32;
                let (right, up, both) = (i + 1, i + columns, i + columns + 1);
                if self.has(x, y, FIRST) {
                    triangles.push([i, right, both]);
                }
                if self.has(x, y, SECOND) {
                    triangles.push([i, both, up]);
                }
            }
        }
        triangles
    }

    /// Whether the interior of a triangle that no outline crosses lies within.
    pub(super) fn holds(&self, a: (i32, i32), b: (i32, i32), c: (i32, i32)) -> bool {
        // The centroid times three lies in the interior, so whatever grid triangle touches it decides.
        let (x, y) = (a.0 + b.0 + c.0, a.1 + b.1 + c.1);
        let (cell_x, cell_y) = (x / 3, y / 3);
        let (fx, fy) = (x - 3 * cell_x, y - 3 * cell_y);
        self.has(cell_x, cell_y, if fx >= fy { FIRST } else { SECOND })
    }

    /// Whether a sample is a corner of a valid triangle.
    pub(super) fn uses(&self, x: i32, y: i32) -> bool {
        let around = [(0, 0, FIRST | SECOND), (-1, 0, FIRST), (0, -1, SECOND), (-1, -1, FIRST | SECOND)];
        around.into_iter().any(|(dx, dy, bits)| self.has(x + dx, y + dy, bits))
    }

    /// Keeps an outline within this many samples of the exact one.
    pub(super) fn simplify_outline(&mut self, field: &Field, tolerance: f64) {
        if !self.is_full() {
            self.simplified = Some(Outline::simplified(field, self, tolerance));
        }
    }

    /// The exact outline in steps from sample to sample, what is valid to their left: where each starts, and its direction: 0 along the axis of
    /// columns, 1 along the diagonal, 2 along the axis of rows, and 3, 4, 5 back. O(samples).
    pub(super) fn outline_steps(&self) -> Vec<((i32, i32), u8)> {
        let mut steps = vec![];
        let mut step =
            |left: bool, right: bool, from: (i32, i32), to: (i32, i32), direction: u8| match (left, right) {
                (true, false) => steps.push((from, direction)),
                (false, true) => steps.push((to, direction + 3)),
                _ => {}
            };
        for y in 0..self.rows {
            for x in 0..self.columns {
                let [below, above] = self.beside_row(x, y);
                step(above, below, (x, y), (x + 1, y), 0);
                step(self.has(x, y, SECOND), self.has(x, y, FIRST), (x, y), (x + 1, y + 1), 1);
                let [left, right] = self.beside_column(x, y);
                step(left, right, (x, y), (x, y + 1), 2);
            }
        }
        steps
    }

    /// The outline in straight runs that meet others at most at their ends. O(samples).
    pub(super) fn outline(&self) -> Vec<Run> {
        let mut runs = vec![];
        let (w, h) = (self.columns, self.rows);
        let mut along = |start: (i32, i32), step: (i32, i32), steps: i32, is: &dyn Fn(i32, i32) -> bool| {
            let at = |k: i32| (start.0 + k * step.0, start.1 + k * step.1);
            let mut first = None;
            for k in 0..=steps {
                let on = k < steps && is(at(k).0, at(k).1);
                match (on, first) {
                    (true, None) => first = Some(k),
                    (false, Some(f)) => {
                        runs.push([at(f), at(k)]);
                        first = None;
                    }
                    _ => {}
                }
            }
        };
        for y in 0..h {
            along((0, y), (1, 0), w - 1, &|x, y| self.has(x, y, FIRST) != self.has(x, y - 1, SECOND));
        }
        for x in 0..w {
            along((x, 0), (0, 1), h - 1, &|x, y| self.has(x, y, SECOND) != self.has(x - 1, y, FIRST));
        }
        let diagonals = (0..h - 1).rev().map(|y| (0, y)).chain((1..w - 1).map(|x| (x, 0)));
        for (x, y) in diagonals {
            let steps = (w - 1 - x).min(h - 1 - y);
            along((x, y), (1, 1), steps, &|x, y| self.has(x, y, FIRST) != self.has(x, y, SECOND));
        }
        self.cut(runs)
    }

    /// Cuts runs where others end.
    fn cut(&self, runs: Vec<Run>) -> Vec<Run> {
        let index = |p: (i32, i32)| p.1 as usize * self.columns as usize + p.0 as usize;
        let mut ends = vec![false; self.columns as usize * self.rows as usize];
        for p in runs.iter().flatten() {
            ends[index(*p)] = true;
        }
        let mut parts = Vec::with_capacity(runs.len());
        for [a, b] in runs {
            let (dx, dy) = ((b.0 - a.0).signum(), (b.1 - a.1).signum());
            let (mut from, mut p) = (a, a);
            while p != b {
                p = (p.0 + dx, p.1 + dy);
                if ends[index(p)] {
                    parts.push([from, p]);
                    from = p;
                }
            }
        }
        parts
    }

    /// Makes the outline part of a triangulation and marks what lies outside.
    pub(super) fn constrain(&self, mesh: &mut Triangulation) {
        if self.is_full() {
            return;
        }
        if let Some(outline) = &self.simplified {
            return outline.constrain(mesh);
        }
        let mut runs = self.outline();
        let mut points: Vec<(i32, i32)> = runs.iter().flatten().copied().collect();
        // Neighbours in space one after the other, for short walks: rows of 32, there and back.
        let order = |p: &(i32, i32)| (p.1 >> 5, if p.1 >> 5 & 1 == 0 { p.0 } else { -p.0 }, p.1);
        points.sort_unstable_by_key(order);
        points.dedup();
        for p in points {
            mesh.insert(p);
        }
        runs.sort_unstable_by_key(|r| order(&r[0]));
        let (right, last) = (self.columns - 1, self.rows - 1);
        // Whatever vertices the border of the rectangle has, there are sides between them.
        let on_border = |[a, b]: &Run| {
            a.0 == b.0 && (a.0 == 0 || a.0 == right) || a.1 == b.1 && (a.1 == 0 || a.1 == last)
        };
        for run in runs.into_iter().filter(|run| !on_border(run)) {
            // Unit sides are always there: no other sample lies in the circle over one. Longer ones may need vertices between.
            let mut parts = vec![run];
            while let Some([a, b]) = parts.pop() {
                let long = (b.0 - a.0).abs().max((b.1 - a.1).abs());
                if long == 1 && a.0 != b.0 && a.1 != b.1 && mesh.side_between(a, b).is_none() {
                    mesh.turn_diagonal(a, b);
                }
                if let Some(side) = mesh.side_between(a, b) {
                    mesh.fix(side);
                } else if long > 1 {
                    let (dx, dy) = ((b.0 - a.0).signum(), (b.1 - a.1).signum());
                    let m = (a.0 + dx * (long / 2), a.1 + dy * (long / 2));
                    mesh.insert(m);
                    parts.extend([[m, b], [a, m]]);
                }
            }
        }
        mesh.outside = (0..mesh.triangles() as u32)
            .map(|t| {
                let [a, b, c] = mesh.corners(t).map(|v| mesh.points[v as usize]);
                !self.holds(a, b, c)
            })
            .collect();
        debug_assert!((0..3 * mesh.triangles() as u32).all(|s| {
            let other = mesh.across(s);
            other == HULL || mesh.is_fixed(s) || mesh.is_outside(s / 3) == mesh.is_outside(other / 3)
        }));
        mesh.changed = (0..mesh.triangles() as u32).collect();
    }
}
