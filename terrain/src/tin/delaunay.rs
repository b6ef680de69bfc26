//! An incremental constrained Delaunay triangulation of samples, with exact predicates (Guibas & Stolfi 1985; Lawson's flips).
//!
//! Side `3 t + i` of triangle `t` goes from its corner `i` to the next. Triangles turn to the left throughout; they cover the whole
//! rectangle, also where the grid is void: those that lie outside of the valid region are marked.

use super::scan::area;

/// No side across: the border of the rectangle.
pub(super) const HULL: u32 = u32::MAX >> 1;
/// Set in [`Triangulation::across`] for sides that stay whatever lies around.
const FIXED: u32 = 1 << 31;

/// A triangulation of a rectangle of samples.
#[derive(Clone, Debug)]
pub(super) struct Triangulation {
    /// Column and row of every vertex.
    pub points: Vec<(i32, i32)>,
    /// Corners of all triangles.
    pub corner: Vec<u32>,
    pub(super) across: Vec<u32>,
    /// Triangles outside of the valid region; empty when there are none.
    pub outside: Vec<bool>,
    /// Triangles changed since the list was last emptied; some twice.
    pub changed: Vec<u32>,
    pub(super) stack: Vec<u32>,
    /// Triangles around a new vertex that may not be Delaunay.
    fan: Vec<u32>,
    /// Whether lines that are led over a sample must not make new vertices on the border of the rectangle: another triangulation has it too.
    pub(super) border_stays: bool,
    /// Where the last walk ended.
    pub(super) last: u32,
    wide: bool,
}

/// Where a point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Within this triangle.
    In(u32),
    /// On this side.
    On(u32),
    /// At this vertex.
    At(u32),
}

#[inline]
pub(super) fn next(side: u32) -> u32 {
    if side % 3 == 2 { side - 2 } else { side + 1 }
}

#[inline]
pub(super) fn previous(side: u32) -> u32 {
    if side.is_multiple_of(3) { side + 2 } else { side - 1 }
}

impl Triangulation {
    /// The rectangle of this many samples, at least 2 x 2, as two triangles.
    pub(super) fn new(columns: i32, rows: i32) -> Self {
        let (x, y) = (columns - 1, rows - 1);
        Triangulation {
            points: vec![(0, 0), (x, 0), (x, y), (0, y)],
            corner: vec![0, 1, 2, 2, 3, 0],
            across: vec![HULL, HULL, 5, HULL, HULL, 2],
            outside: vec![],
            changed: vec![0, 1],
            stack: vec![],
            fan: vec![],
            border_stays: false,
            last: 0,
            // Within this, an in-circle determinant fits 64 bits: differences of 14 bits, squares of 29, products of 58.
            wide: columns.max(rows) > 1 << 14,
        }
    }

    #[inline]
    pub(super) fn triangles(&self) -> usize {
        self.corner.len() / 3
    }

    #[inline]
    pub(super) fn corners(&self, t: u32) -> [u32; 3] {
        let c = &self.corner[3 * t as usize..3 * t as usize + 3];
        [c[0], c[1], c[2]]
    }

    #[inline]
    pub(super) fn point(&self, side: u32) -> (i32, i32) {
        self.points[self.corner[side as usize] as usize]
    }

    /// The side across, or [`HULL`].
    #[inline]
    pub(super) fn across(&self, side: u32) -> u32 {
        self.across[side as usize] & !FIXED
    }

    /// Whether a side is constrained.
    #[inline]
    pub(super) fn is_fixed(&self, side: u32) -> bool {
        self.across[side as usize] & FIXED != 0
    }

    #[inline]
    pub(super) fn is_outside(&self, t: u32) -> bool {
        !self.outside.is_empty() && self.outside[t as usize]
    }

    #[inline]
    pub(super) fn link(&mut self, a: u32, b: u32, fixed: bool) {
        let fixed = if fixed { FIXED } else { 0 };
        self.across[a as usize] = b | fixed;
        if b != HULL {
            self.across[b as usize] = a | fixed;
        }
    }

    /// Keeps a side from being flipped.
    pub(super) fn fix(&mut self, side: u32) {
        let across = self.across(side);
        self.link(side, across, true);
    }

    /// Adds a triangle, not yet linked.
    #[inline]
    fn add(&mut self, corners: [u32; 3], outside: bool) -> u32 {
        let t = self.triangles() as u32;
        self.corner.extend_from_slice(&corners);
        self.across.extend_from_slice(&[HULL; 3]);
        if !self.outside.is_empty() {
            self.outside.push(outside);
        }
        t
    }

    /// Inserts a vertex in a triangle that holds it, not at a corner; returns it. O(1) and the flips.
    pub(super) fn insert_in(&mut self, t: u32, p: (i32, i32)) -> u32 {
        let [a, b, c] = self.corners(t);
        let (pa, pb, pc) = (self.points[a as usize], self.points[b as usize], self.points[c as usize]);
        for (i, from, to) in [(0, pa, pb), (1, pb, pc), (2, pc, pa)] {
            if area(from, to, p) == 0 {
                return self.insert_on(3 * t + i, p);
            }
        }
        let v = self.points.len() as u32;
        self.points.push(p);
        let s = 3 * t;
        let outside = self.is_outside(t);
        let (bc, ca) = (self.across[s as usize + 1], self.across[s as usize + 2]);
        // t keeps its first side; the new vertex is the last corner of all three.
        let t1 = self.add([b, c, v], outside);
        let t2 = self.add([c, a, v], outside);
        self.corner[s as usize + 2] = v;
        self.link_as(3 * t1, bc);
        self.link_as(3 * t2, ca);
        self.link(s + 1, 3 * t1 + 2, false);
        self.link(3 * t1 + 1, 3 * t2 + 2, false);
        self.link(3 * t2 + 1, s + 2, false);
        self.changed.extend_from_slice(&[t, t1, t2]);
        self.fan.extend_from_slice(&[t, t1, t2]);
        self.legalize();
        v
    }

    /// Inserts a vertex on a side, between its ends. Constrained sides become two.
    pub(super) fn insert_on(&mut self, side: u32, p: (i32, i32)) -> u32 {
        let v = self.points.len() as u32;
        self.points.push(p);
        let fixed = self.is_fixed(side);
        let other = self.across(side);
        // a -> v and v -> b on the left, b -> v and v -> a on the right.
        let (av, vb) = self.halve(side, v);
        if other != HULL {
            let (bv, va) = self.halve(other, v);
            self.link(av, va, fixed);
            self.link(vb, bv, fixed);
        } else {
            self.link(av, HULL, fixed);
            self.link(vb, HULL, fixed);
        }
        self.legalize();
        v
    }

    /// Cuts the triangle of a side `a -> b` at a new vertex on it, the last corner of both triangles. Returns the sides `a -> v` and `v -> b`, not yet
    /// linked.
    fn halve(&mut self, side: u32, v: u32) -> (u32, u32) {
        let t = side / 3;
        let (bc, ca) = (next(side), previous(side));
        let [a, b, c] = [side, bc, ca].map(|s| self.corner[s as usize]);
        let [beyond_bc, beyond_ca] = [bc, ca].map(|s| self.across[s as usize]);
        let outside = self.is_outside(t);
        let n = self.add([b, c, v], outside);
        let s = 3 * t;
        self.corner[s as usize..s as usize + 3].copy_from_slice(&[c, a, v]);
        self.link_as(s, beyond_ca);
        self.link_as(3 * n, beyond_bc);
        self.link(s + 2, 3 * n + 1, false);
        self.changed.extend_from_slice(&[t, n]);
        self.fan.extend_from_slice(&[t, n]);
        (s + 1, 3 * n + 2)
    }

    /// Links a side to what another had across, [`FIXED`] or not.
    #[inline]
    fn link_as(&mut self, side: u32, across: u32) {
        self.across[side as usize] = across;
        let other = across & !FIXED;
        if other != HULL {
            self.across[other as usize] = side | across & FIXED;
        }
    }

    /// Flips until the triangles around a new vertex, their last corner, are Delaunay: those of `fan`, and those that flips give it.
    fn legalize(&mut self) {
        while let Some(t) = self.fan.pop() {
            let s = 3 * t as usize;
            let across = self.across[s];
            // Fixed, or the border of the rectangle.
            if across >= HULL {
                continue;
            }
            let o = across / 3;
            let (o0, at) = (3 * o as usize, across - 3 * o);
            // across leads from b to a; then a to q, q to b.
            let (aq, qb) = match at {
                0 => (o0 + 1, o0 + 2),
                1 => (o0 + 2, o0),
                _ => (o0, o0 + 1),
            };
            let (a, b, v, q) = (self.corner[s], self.corner[s + 1], self.corner[s + 2], self.corner[qb]);
            let point = |v: u32| self.points[v as usize];
            if !self.in_circle(point(v), point(a), point(b), point(q)) {
                continue;
            }
            let (beyond_aq, beyond_qb, beyond_bv) = (self.across[aq], self.across[qb], self.across[s + 1]);
            // (a, q, v), which keeps v -> a, and (q, b, v).
            self.corner[s + 1] = q;
            self.corner[o0..o0 + 3].copy_from_slice(&[q, b, v]);
            self.link_as(3 * t, beyond_aq);
            self.link_as(3 * o, beyond_qb);
            self.link_as(3 * o + 1, beyond_bv);
            self.link(3 * t + 1, 3 * o + 2, false);
            // The other is listed already.
            self.changed.push(o);
            self.fan.push(t);
            self.fan.push(o);
        }
    }

    /// Exchanges the diagonal of the quadrilateral on a side.
    pub(super) fn flip(&mut self, side: u32) {
        let across = self.across(side);
        let (p, q) = (self.corner[previous(side) as usize], self.corner[previous(across) as usize]);
        // side: a -> b with p opposite; across: b -> a with q opposite. Then a -> q -> p and q -> b -> p.
        let beyond_aq = self.across[next(across) as usize];
        let beyond_bp = self.across[next(side) as usize];
        let (t_side, o_side) = (side, across);
        // Triangle of side: (a, q, p): its corner after `side` becomes q.
        self.corner[next(t_side) as usize] = q;
        // Triangle of across: (b, p, q).
        self.corner[next(o_side) as usize] = p;
        self.link(t_side, beyond_aq & !FIXED, beyond_aq & FIXED != 0);
        self.link(o_side, beyond_bp & !FIXED, beyond_bp & FIXED != 0);
        self.link(next(t_side), next(o_side), false);
        self.changed.extend([t_side / 3, o_side / 3]);
    }

    /// Whether `q` lies within the circle through `a`, `b`, `c`, which turn to the left.
    #[inline]
    pub(super) fn in_circle(&self, a: (i32, i32), b: (i32, i32), c: (i32, i32), q: (i32, i32)) -> bool {
        let d = |p: (i32, i32)| (i64::from(p.0 - q.0), i64::from(p.1 - q.1));
        let ((ax, ay), (bx, by), (cx, cy)) = (d(a), d(b), d(c));
        let (ap, bp, cp) = (ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy);
        let (bc, ca, ab) = (bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx);
        if self.wide {
            let term = |p: i64, m: i64| i128::from(p) * i128::from(m);
            term(ap, bc) + term(bp, ca) + term(cp, ab) > 0
        } else {
            ap * bc + bp * ca + cp * ab > 0
        }
    }

    /// Finds a point of the rectangle, walking from where the last walk ended.
    pub(super) fn locate(&mut self, p: (i32, i32)) -> Place {
        let mut t = self.last;
        // Visibility walks end on Delaunay triangulations; constraints can make them turn in circles, a varying first side not.
        let mut turn = 0u32;
        'walk: loop {
            turn = turn.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            for k in 0..3 {
                let s = 3 * t + (k + (turn >> 16)) % 3;
                if area(self.point(s), self.point(next(s)), p) < 0 {
                    // Points lie within the rectangle, so there is a side across.
                    t = self.across(s) / 3;
                    continue 'walk;
                }
            }
            break;
        }
        self.last = t;
        for s in 3 * t..3 * t + 3 {
            if self.point(s) == p {
                return Place::At(self.corner[s as usize]);
            }
        }
        for s in 3 * t..3 * t + 3 {
            if area(self.point(s), self.point(next(s)), p) == 0 {
                return Place::On(s);
            }
        }
        Place::In(t)
    }

    /// Inserts a point wherever it lies; the vertex there, if there is one.
    pub(super) fn insert(&mut self, p: (i32, i32)) -> u32 {
        match self.locate(p) {
            Place::At(v) => v,
            Place::On(s) => self.insert_on(s, p),
            Place::In(t) => self.insert_in(t, p),
        }
    }

    /// The side from one vertex to another, either way round, if there is one. Walks to `a` first.
    pub(super) fn side_between(&mut self, a: (i32, i32), b: (i32, i32)) -> Option<u32> {
        let Place::At(v) = self.locate(a) else { return None };
        let first = (3 * self.last..3 * self.last + 3).find(|&s| self.corner[s as usize] == v)?;
        // Once around to the left, and from a border once to the right.
        let mut s = first;
        loop {
            if self.point(next(s)) == b {
                return Some(s);
            }
            let into = previous(s);
            if self.point(into) == b {
                return Some(into);
            }
            match self.across(into) {
                HULL => break,
                o if o == first => return None,
                o => s = o,
            }
        }
        s = first;
        loop {
            match self.across(s) {
                HULL => return None,
                o => s = next(o),
            }
            if self.point(next(s)) == b {
                return Some(s);
            }
        }
    }

    /// Makes the diagonal of a unit cell an edge, where all four corners are vertices and the other diagonal is one.
    pub(super) fn turn_diagonal(&mut self, a: (i32, i32), b: (i32, i32)) {
        if let Some(s) = self.side_between((a.0, b.1), (b.0, a.1))
            && !self.is_fixed(s)
            && self.across(s) != HULL
        {
            self.flip(s);
        }
    }
}
