//! Cutting polygons into triangles by ear clipping, with exact predicates.
//!
//! A polygon is projected along the dominant axis of its normal, which drops one coordinate and so keeps the other two
//! exact; every decision is then the sign of an exact determinant. Ears are cut in rounds, no two neighbours in one round, so that a
//! large convex polygon is cut evenly rather than into a fan of slivers. A corner found not to be an ear waits at the
//! vertex that blocks it, and is looked at again only when that one goes; blocking vertices are found through a grid. So
//! usual polygons take near-linear time; the worst case is quadratic.

use crate::build::{MeshInput, assemble};
use crate::error::BuildError;
use crate::ids::NONE;
use crate::mesh::Mesh;
use glam::DVec3;
use robust::{Coord, orient2d};

/// Cuts a polygon into `n - 2` triangles, appended to `out` as indices into `points`; nothing for fewer than three points.
///
/// The triangles run the way the polygon runs. For a polygon that projects to a simple one along the dominant axis of
/// its normal they tile it without overlap (with zero-area triangles only where consecutive points lie on a line and no better cut
/// exists). Quadrilaterals are cut along the diagonal that turns no triangle over and, of two such, gives the better shapes. A
/// polygon that crosses itself, has no area or points that are not finite still gets `n - 2` triangles that use every point
/// and leave every polygon edge on exactly one triangle, but they may overlap. Deterministic.
/// O(n) for convex polygons, O(n^2) at worst.
pub fn triangulate_polygon(points: &[DVec3], out: &mut Vec<[u32; 3]>) {
    Clipper::default().triangulate(points, out);
}

/// A mesh after [`Mesh::triangulate`].
#[derive(Clone, Debug)]
pub struct Triangulated {
    /// The mesh; every face is a triangle.
    pub mesh: Mesh,
    /// Face of the mesh -> face it was cut from; `None` when they are the same.
    pub face_map: Option<Vec<u32>>,
    /// How many polygons of four and more corners were cut.
    pub cut: usize,
}

impl Mesh {
    /// Cuts every polygon into triangles, as [`triangulate_polygon`] does.
    ///
    /// A mesh built of triangles alone comes back as it is. Otherwise it is built anew: vertices keep their ids (removed ones
    /// stay removed), faces their order, with the triangles of a polygon one after the other; wedges, materials, groups
    /// and edges without a face are kept; edges are numbered as by [`Mesh::build`]. A diagonal that is already an edge of another face
    /// joins that edge, which may make it complex.
    ///
    /// Errors: more than 2^31 edges after the cut.
    pub fn triangulate(self) -> Result<Triangulated, BuildError> {
        let t = &self.topology;
        if t.is_triangular() {
            return Ok(Triangulated { mesh: self, face_map: None, cut: 0 });
        }
        let triangles = self.triangle_count();
        if triangles >= NONE as usize / 6 {
            return Err(BuildError::TooLarge { vertices: t.vertex_slots(), corners: 3 * triangles });
        }
        let mut corners: Vec<u32> = Vec::with_capacity(3 * triangles);
        let mut wedge = self.wedges.as_ref().map(|_| Vec::with_capacity(3 * triangles));
        let mut map: Vec<u32> = Vec::with_capacity(triangles);
        let (mut clipper, mut local, mut points, mut cut) = (Clipper::default(), Vec::new(), Vec::new(), 0);
        for f in t.faces() {
            let slots = t.corner_range(f);
            local.clear();
            if slots.len() == 3 {
                local.push([0, 1, 2]);
            } else {
                points.clear();
                points.extend(t.face_vertices(f).map(|v| self.position(v)));
                clipper.triangulate(&points, &mut local);
                cut += 1;
            }
            for slot in local.as_flattened().iter().map(|&i| slots.start + i as usize) {
                corners.push(t.origin(t.corners[slot]).0);
                if let (Some(to), Some(from)) = (&mut wedge, &self.wedges) {
                    to.push(from.corner[slot]);
                }
            }
            map.extend(std::iter::repeat_n(f.0, local.len()));
        }
        let per_face = |old: &[u32]| match old {
            [] => Vec::new(),
            _ => map.iter().map(|&f| old[f as usize]).collect(),
        };
        let wires = t.edges().filter(|&e| t.edge_faces(e).is_empty());
        let input = MeshInput {
            corners,
            wires: wires.map(|e| t.edge_vertices(e).map(|v| v.0)).collect(),
            face_material: per_face(&self.face_material),
            face_group: per_face(&self.face_group),
            face_row: per_face(&self.face_row),
            positions: self.positions,
            wedges: self.wedges.map(|mut w| {
                w.corner = wedge.unwrap_or_default();
                w
            }),
            face_sizes: None,
        };
        let same = cut == 0 && map.iter().enumerate().all(|(i, &f)| i as u32 == f);
        let dead = self.topology.dead_vertices;
        let mut mesh = assemble(input)?;
        mesh.topology.dead_vertices = dead;
        Ok(Triangulated { mesh, face_map: (!same).then_some(map), cut })
    }
}

/// How the polygon turns at a vertex, or that the vertex was cut off.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Turn {
    Convex,
    Flat,
    Reflex,
    Gone,
}

/// Scratch memory for cutting polygons one after the other.
#[derive(Default)]
pub(crate) struct Clipper {
    xy: Vec<[f64; 2]>,
    prev: Vec<u32>,
    next: Vec<u32>,
    turn: Vec<Turn>,
    /// The round in which a neighbour of the vertex was cut off.
    touched: Vec<u32>,
    queued: Vec<bool>,
    round: Vec<u32>,
    following: Vec<u32>,
    /// Convex corners waiting for vertex `w` to go: a linked list from `waiting[w]` through `waiters`.
    waiting: Vec<u32>,
    waiters: Vec<(u32, u32)>,
    /// Corners to fall back to when no ear is left; entries may be stale.
    flat: Vec<u32>,
    convex: Vec<u32>,
    grid: Grid,
}

impl Clipper {
    pub(crate) fn triangulate(&mut self, points: &[DVec3], out: &mut Vec<[u32; 3]>) {
        match points.len() {
            0..3 => {}
            3 => out.push([0, 1, 2]),
            n if n >= NONE as usize => {}
            n => {
                self.project(points);
                if n == 4 {
                    self.quadrilateral(points, out);
                } else {
                    self.clip(out);
                }
            }
        }
    }

    /// Projects so that the polygon runs counter-clockwise.
    fn project(&mut self, points: &[DVec3]) {
        let (lo, hi) = points
            .iter()
            .filter(|p| p.is_finite())
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
        let extent = hi - lo;
        // Local origin and unit size: the products neither cancel, overflow nor vanish.
        let scale = extent.max_element();
        let unit = |p: DVec3| (p - lo) / scale;
        let mut normal = DVec3::ZERO;
        let origin = unit(points[0]);
        let mut last = DVec3::ZERO;
        for p in &points[1..] {
            let d = unit(*p) - origin;
            normal += last.cross(d);
            last = d;
        }
        let size = normal.abs();
        let axis = if size.max_element() > 0.0 {
            (0..3).find(|&k| size[k] == size.max_element())
        } else {
            // No area: keep the two longest sides.
            (0..3).find(|&k| extent[k] == extent.min_element())
        }
        .unwrap_or(2);
        let (mut x, mut y) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        self.xy.clear();
        self.xy.extend(points.iter().map(|p| [p[x], p[y]]));
    }

    /// Sign of the turn a, b, c.
    #[inline]
    fn orient(&self, a: u32, b: u32, c: u32) -> f64 {
        let at = |i: u32| {
            let [x, y] = self.xy[i as usize];
            Coord { x, y }
        };
        orient2d(at(a), at(b), at(c))
    }

    fn quadrilateral(&self, points: &[DVec3], out: &mut Vec<[u32; 3]>) {
        let cuts = [[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]];
        // Triangles not turned over first, then those with area, then the worse shape of the two.
        let score = |cut: &[[u32; 3]; 2]| {
            let turns = cut.map(|[a, b, c]| self.orient(a, b, c));
            let upright =
                turns.iter().filter(|&&o| o >= 0.0).count() + turns.iter().filter(|&&o| o > 0.0).count();
            let shape = |t: &[u32; 3]| shape(t.map(|i| points[i as usize]));
            (upright, shape(&cut[0]).min(shape(&cut[1])))
        };
        let (a, b) = (score(&cuts[0]), score(&cuts[1]));
        // A shade of preference for the first, so that a rectangle's rounding does not decide.
        let second = b.0 > a.0 || b.0 == a.0 && b.1 > a.1 * (1.0 + 1e-9);
        out.extend(cuts[second as usize]);
    }

    fn clip(&mut self, out: &mut Vec<[u32; 3]>) {
        let n = self.xy.len();
        let mut left = n;
        self.start();
        let mut number = 0;
        while left > 3 {
            number += 1;
            let round = std::mem::take(&mut self.round);
            for &v in &round {
                if left == 3 {
                    break;
                }
                self.queued[v as usize] = false;
                if self.turn[v as usize] != Turn::Convex {
                    continue;
                }
                if self.touched[v as usize] == number {
                    self.enqueue(v);
                } else if let Some(w) = self.blocker(v) {
                    self.waiters.push((v, self.waiting[w as usize]));
                    self.waiting[w as usize] = self.waiters.len() as u32 - 1;
                    self.convex.push(v);
                } else {
                    self.cut(v, number, out);
                    left -= 1;
                }
            }
            self.round = std::mem::replace(&mut self.following, round);
            self.following.clear();
            if self.round.is_empty() && left > 3 {
                let v = self.fallback();
                self.cut(v, number, out);
                left -= 1;
                std::mem::swap(&mut self.round, &mut self.following);
            }
        }
        if let Some(a) = (0..n).find(|&i| self.turn[i] != Turn::Gone) {
            let b = self.next[a] as usize;
            out.push([a as u32, b as u32, self.next[b]]);
        }
    }

    fn start(&mut self) {
        let n = self.xy.len() as u32;
        self.prev.clear();
        self.next.clear();
        self.prev.extend((0..n).map(|i| if i == 0 { n - 1 } else { i - 1 }));
        self.next.extend((0..n).map(|i| if i == n - 1 { 0 } else { i + 1 }));
        for list in [&mut self.touched, &mut self.waiting] {
            list.clear();
        }
        self.touched.resize(n as usize, 0);
        self.waiting.resize(n as usize, NONE);
        self.queued.clear();
        self.queued.resize(n as usize, false);
        for list in [&mut self.round, &mut self.following, &mut self.flat, &mut self.convex] {
            list.clear();
        }
        self.waiters.clear();
        self.turn.clear();
        for v in 0..n {
            let turn = self.turn_at(v);
            self.turn.push(turn);
            match turn {
                Turn::Convex => {
                    self.queued[v as usize] = true;
                    self.round.push(v);
                }
                Turn::Flat => self.flat.push(v),
                _ => {}
            }
        }
        let blocking = (0..n).filter(|&v| self.turn[v as usize] != Turn::Convex);
        self.grid.fill(&self.xy, blocking);
    }

    fn turn_at(&self, v: u32) -> Turn {
        let o = self.orient(self.prev[v as usize], v, self.next[v as usize]);
        if o > 0.0 {
            Turn::Convex
        } else if o < 0.0 {
            Turn::Reflex
        } else {
            // Zero; or NaN from points that are not finite, which may go at any time as well.
            Turn::Flat
        }
    }

    fn enqueue(&mut self, v: u32) {
        if !std::mem::replace(&mut self.queued[v as usize], true) {
            self.following.push(v);
        }
    }

    /// A vertex in the triangle at convex corner `v`: the corner is no ear while it is there. Convex vertices need no test: if one
    /// is inside, so is one that is not convex.
    fn blocker(&mut self, v: u32) -> Option<u32> {
        let (a, b) = (self.prev[v as usize], self.next[v as usize]);
        let mut grid = std::mem::take(&mut self.grid);
        let corners = [a, v, b].map(|i| self.xy[i as usize]);
        let found = grid.find(&corners, |w| {
            if matches!(self.turn[w as usize], Turn::Gone | Turn::Convex) {
                return Visit::Forget;
            }
            let at = self.xy[w as usize];
            // A vertex on a corner of the triangle is the other side of a slit, and blocks nothing.
            if corners.contains(&at) {
                return Visit::Pass;
            }
            let inside =
                self.orient(a, v, w) >= 0.0 && self.orient(v, b, w) >= 0.0 && self.orient(b, a, w) >= 0.0;
            if inside { Visit::Found } else { Visit::Pass }
        });
        self.grid = grid;
        found
    }

    /// Cuts off corner `v`, and looks at its neighbours and at those that waited for it again.
    fn cut(&mut self, v: u32, number: u32, out: &mut Vec<[u32; 3]>) {
        let (a, b) = (self.prev[v as usize], self.next[v as usize]);
        let mut t = [a, v, b];
        let first = (0..3).min_by_key(|&i| t[i]).unwrap_or(0);
        t.rotate_left(first);
        out.push(t);
        self.next[a as usize] = b;
        self.prev[b as usize] = a;
        self.turn[v as usize] = Turn::Gone;
        self.wake(v);
        for w in [a, b] {
            let turn = self.turn_at(w);
            self.turn[w as usize] = turn;
            self.touched[w as usize] = number;
            match turn {
                Turn::Convex => {
                    self.enqueue(w);
                    self.wake(w);
                }
                Turn::Flat => self.flat.push(w),
                _ => {}
            }
        }
    }

    /// Queues the corners that waited for `w` to go.
    fn wake(&mut self, w: u32) {
        let mut at = std::mem::replace(&mut self.waiting[w as usize], NONE);
        while at != NONE {
            let (v, then) = self.waiters[at as usize];
            if self.turn[v as usize] == Turn::Convex {
                self.enqueue(v);
            }
            at = then;
        }
    }

    /// The corner to cut off when there is no ear: a flat one, else a convex one, else any.
    fn fallback(&mut self) -> u32 {
        while let Some(v) = self.flat.pop() {
            if self.turn[v as usize] == Turn::Flat {
                return v;
            }
        }
        while let Some(v) = self.convex.pop() {
            if self.turn[v as usize] == Turn::Convex {
                return v;
            }
        }
        (0..self.xy.len()).find(|&v| self.turn[v] != Turn::Gone).unwrap_or(0) as u32
    }
}

/// 1 for an equilateral triangle, 0 for one without area; independent of size.
fn shape([a, b, c]: [DVec3; 3]) -> f64 {
    let (u, v, w) = (b - a, c - a, c - b);
    let sides = u.length_squared() + v.length_squared() + w.length_squared();
    if sides > 0.0 { u.cross(v).length() * (12f64.sqrt() / sides) } else { 0.0 }
}

enum Visit {
    Found,
    Pass,
    Forget,
}

/// The vertices that can block an ear, by place.
#[derive(Default)]
struct Grid {
    lo: [f64; 2],
    per_unit: [f64; 2],
    cells: [usize; 2],
    /// Where each cell's entries begin; they end at `end`.
    begin: Vec<u32>,
    end: Vec<u32>,
    entries: Vec<u32>,
}

impl Grid {
    fn fill(&mut self, xy: &[[f64; 2]], blocking: impl Iterator<Item = u32> + Clone) {
        let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut n = 0usize;
        for v in blocking.clone() {
            n += 1;
            for k in 0..2 {
                lo[k] = lo[k].min(xy[v as usize][k]);
                hi[k] = hi[k].max(xy[v as usize][k]);
            }
        }
        // About one entry a cell, in square cells; few entries are as soon looked through.
        let extent = [0, 1].map(|k| (hi[k] - lo[k]).max(0.0));
        let cells = if n < 16 { 1.0 } else { n as f64 };
        let side = (extent[0] * extent[1] / cells).sqrt().max(extent[0].max(extent[1]) / cells);
        self.lo = lo;
        self.cells = extent.map(|x| {
            let count = (x / side).ceil();
            if count.is_finite() { (count as usize).clamp(1, n.max(1)) } else { 1 }
        });
        let per_unit = |k: usize| if extent[k] > 0.0 { self.cells[k] as f64 / extent[k] } else { 0.0 };
        self.per_unit = [per_unit(0), per_unit(1)];
        // Rounding up both counts of a long grid must not square its size.
        if self.cells[0].saturating_mul(self.cells[1]) > 4 * n + 16 {
            (self.cells, self.per_unit) = ([1; 2], [0.0; 2]);
        }
        self.begin.clear();
        self.begin.resize(self.cells[0] * self.cells[1] + 1, 0);
        for v in blocking.clone() {
            let c = self.cell(xy[v as usize]);
            self.begin[c + 1] += 1;
        }
        for c in 1..self.begin.len() {
            self.begin[c] += self.begin[c - 1];
        }
        self.end.clear();
        self.end.extend_from_slice(&self.begin[..self.begin.len() - 1]);
        self.entries.clear();
        self.entries.resize(n, 0);
        for v in blocking {
            let c = self.cell(xy[v as usize]);
            self.entries[self.end[c] as usize] = v;
            self.end[c] += 1;
        }
    }

    /// Column or row, clamped into the grid; it never falls as `x` grows.
    #[inline]
    fn place(&self, k: usize, x: f64) -> usize {
        // `as` saturates, and takes NaN for 0.
        (((x - self.lo[k]) * self.per_unit[k]) as usize).min(self.cells[k] - 1)
    }

    fn cell(&self, p: [f64; 2]) -> usize {
        self.place(1, p[1]) * self.cells[0] + self.place(0, p[0])
    }

    /// The first entry that `visit` wants among those in cells under the triangle.
    fn find(&mut self, t: &[[f64; 2]; 3], mut visit: impl FnMut(u32) -> Visit) -> Option<u32> {
        if self.entries.is_empty() {
            return None;
        }
        let (mut lo, mut hi) = (t[0], t[0]);
        for p in &t[1..] {
            for k in 0..2 {
                lo[k] = lo[k].min(p[k]);
                hi[k] = hi[k].max(p[k]);
            }
        }
        for y in self.place(1, lo[1])..=self.place(1, hi[1]) {
            for x in self.place(0, lo[0])..=self.place(0, hi[0]) {
                let c = y * self.cells[0] + x;
                let mut i = self.begin[c];
                while i < self.end[c] {
                    let w = self.entries[i as usize];
                    match visit(w) {
                        Visit::Found => return Some(w),
                        Visit::Pass => i += 1,
                        Visit::Forget => {
                            self.end[c] -= 1;
                            self.entries.swap(i as usize, self.end[c] as usize);
                        }
                    }
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests;
