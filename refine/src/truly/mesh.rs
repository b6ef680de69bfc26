//! The mesh of a set of splits: what a split does to faces that it was not recorded beside, and its undoing.

use super::pieces::{Pieces, base_corners};
use crate::aif::NONE;
use crate::hierarchy::Hierarchy;
use crate::progressive::{Fans, Half, Opening, link_faces};
use glam::DVec3;

/// Faces live in slots of one index buffer, by vertices; a slot that holds none has three equal corners and is used again.
#[derive(Clone, Debug)]
pub(super) struct Mesh {
    fans: Fans,
    /// The face in every slot; [`NONE`] for none.
    face_in: Vec<u32>,
    /// The slot of every face; [`NONE`] where it is not in the mesh.
    slot_of: Vec<u32>,
    free: Vec<u32>,
    applied: Vec<u64>,
    /// The node that every vertex is at, among those in the mesh.
    node: Vec<u32>,
    /// Where the piece of every vertex in the mesh ends, in the order of the finest mesh's vertices.
    end: Vec<u32>,
    vertices: usize,
    faces: usize,
    /// Slots whose corners changed, a bit each.
    pub(super) touched: Vec<u64>,
    /// Vertices that are new or moved, maybe repeated.
    pub(super) moved: Vec<u32>,
}

/// Where a split opens its vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Gap {
    /// The faces around the vertex one after the other, by the edge at which each is entered.
    pub(super) ring: Vec<Half>,
    /// Those that go to the new vertex begin here, and are so many; in a ring that closes they may go past its end.
    start: usize,
    count: usize,
    left: Opening,
    right: Opening,
    /// The other vertices of the edges that open: the left one's and, of a split that makes two faces, the right one's.
    pub(super) tips: [u32; 2],
}

impl Gap {
    /// The `k`-th face of the ring goes to the new vertex.
    #[inline]
    pub(super) fn is_inner(&self, k: usize) -> bool {
        let m = self.ring.len();
        (k + m - self.start % m.max(1)) % m.max(1) < self.count && self.count > 0
    }
}

impl Mesh {
    /// The base.
    pub(super) fn new(h: &Hierarchy, pieces: &Pieces) -> Mesh {
        let pm = h.mesh();
        let (n0, n, m0) = (pm.base_vertices(), h.splits(), pm.base_faces.len());
        let corners = base_corners(pm);
        let up_to = |k: usize, len: usize| {
            let mut all: Vec<u32> = (0..k as u32).collect();
            all.resize(len, NONE);
            all
        };
        let mut end = pieces.ends().to_vec();
        end.resize(n0 + n, 0);
        Mesh {
            fans: Fans { links: link_faces(&corners, n0), corners },
            face_in: (0..m0 as u32).collect(),
            slot_of: up_to(m0, pm.faces()),
            free: Vec::new(),
            applied: vec![0; n.div_ceil(64)],
            node: up_to(n0, n0 + n),
            end,
            vertices: n0,
            faces: m0,
            touched: vec![0; m0.div_ceil(64)],
            moved: Vec::new(),
        }
    }

    pub(super) fn face_count(&self) -> usize {
        self.faces
    }

    pub(super) fn vertex_count(&self) -> usize {
        self.vertices
    }

    /// Vertices of the corners, free slots included.
    pub(super) fn corners(&self) -> &[[u32; 3]] {
        &self.fans.corners
    }

    /// The vertices of face `f`, which is in the mesh.
    pub(super) fn corners_of(&self, f: u32) -> [u32; 3] {
        self.fans.corners[self.slot_of[f as usize] as usize]
    }

    pub(super) fn face_in(&self) -> &[u32] {
        &self.face_in
    }

    #[inline]
    pub(super) fn is_applied(&self, i: u32) -> bool {
        self.applied[i as usize / 64] >> (i % 64) & 1 != 0
    }

    /// The node that vertex `v` is at; [`NONE`] if it is not in the mesh.
    #[inline]
    pub(super) fn node(&self, v: u32) -> u32 {
        self.node[v as usize]
    }

    /// Where vertex `v` stands, which is in the mesh.
    #[inline]
    pub(super) fn position(&self, h: &Hierarchy, v: u32) -> DVec3 {
        h.forest.position(h.mesh(), self.node[v as usize], v)
    }

    /// The vertex at the other end of an edge.
    #[inline]
    pub(super) fn far(&self, h: Half) -> u32 {
        self.fans.corners[h.face() as usize][h.far_corner()]
    }

    /// The faces around the vertex that `start` is seen from, from a border on if there is one; true if they go all around.
    fn fan(&self, start: Half, ring: &mut Vec<Half>) -> bool {
        ring.clear();
        let most = self.fans.corners.len();
        let mut at = start;
        loop {
            ring.push(at);
            match self.fans.across(at.turn()) {
                Some(h) if h.face() == start.face() => return true,
                Some(h) if ring.len() < most => at = h,
                _ => break,
            }
        }
        // The other way, to where it begins.
        let there = ring.len();
        at = start;
        while let Some(h) = self.fans.across(at).filter(|_| ring.len() < most) {
            at = h.turn();
            ring.push(at);
        }
        ring[there..].reverse();
        ring.rotate_left(there);
        false
    }

    /// Finds where split `i` opens its vertex, which is in the mesh; `from` is a face there. The edges that open lead to the pieces that hold the cut vertices, and the faces whose corners are the new vertex's
    /// at full detail lie between them. False if it is not so. O(valence).
    pub(super) fn locate(&self, h: &Hierarchy, pieces: &Pieces, i: u32, from: u32, gap: &mut Gap) -> bool {
        let pm = h.mesh();
        let (vs, code) = (pm.splits.vertex[i as usize], pm.splits.code[i as usize]);
        let slot = self.slot_of.get(from as usize).copied().unwrap_or(NONE);
        let corners = self.fans.corners.get(slot as usize);
        let Some(corner) = corners.and_then(|c| c.iter().position(|&v| v == vs)) else { return false };
        let own = Half::new(slot, corner as u32, true);
        let closed = self.fan(own, &mut gap.ring);
        let (ring, two) = (&gap.ring, code.two_faces());
        let m = ring.len();
        let across = |k: usize| self.far(if k < m { ring[k] } else { ring[m - 1].turn() });
        let first = h.forest.first_face(i);
        let opens_to = |leaf: u32| {
            let holds = |&v: &u32| pieces.order(v) <= leaf && leaf < self.end[v as usize];
            (0..m + usize::from(!closed)).map(|k| (k, across(k))).find(|(_, v)| holds(v))
        };
        let Some((x, vl)) = opens_to(pieces.leaf(first, code.left().0)) else { return false };
        let vu = pieces.order(h.forest.base_vertices + i);
        let goes = |k: usize| pieces.leaf(self.face_in[ring[k].face() as usize], ring[k].corner()) >= vu;
        gap.tips = [vl, NONE];
        let (start, end, forward) = if two {
            let Some((y, vr)) = opens_to(pieces.leaf(first + 1, code.right().0)) else { return false };
            gap.tips[1] = vr;
            // Of a ring that ends at a border, what goes does not touch that.
            let forward = if closed { goes(x % m) } else { x < y };
            if x == y {
                return false;
            }
            if forward { (x, y, true) } else { (y, x, false) }
        } else if closed {
            return false;
        } else if x < m && goes(x) {
            (x, m, true)
        } else if x > 0 && goes(x - 1) {
            (0, x, false)
        } else {
            (x, x, x > 0)
        };
        gap.start = start;
        gap.count = if closed { (end + m - start) % m } else { end - start };
        let some = gap.count > 0;
        let before = if start > 0 || closed { Some(ring[(start + m - 1) % m].turn()) } else { None };
        let behind = if end < m || closed { Some(ring[end % m]) } else { None };
        let a = Opening { inner: some.then(|| ring[start % m]), outer: before };
        let b = Opening { inner: some.then(|| ring[(end + m - 1) % m].turn()), outer: behind };
        (gap.left, gap.right) = if forward { (a, b) } else { (b, a) };
        (0..m).all(|k| goes(k) == gap.is_inner(k))
    }

    /// Applies split `i`, which was located. O(valence).
    pub(super) fn split(&mut self, h: &Hierarchy, pieces: &Pieces, i: u32, gap: &Gap) {
        let pm = h.mesh();
        let (vs, code) = (pm.splits.vertex[i as usize], pm.splits.code[i as usize]);
        let vu = h.forest.base_vertices + i;
        let m = gap.ring.len();
        for k in 0..gap.count {
            self.hand_over(gap.ring[(gap.start + k) % m], vu);
        }
        let face = h.forest.first_face(i);
        let fl = self.take_slot(face);
        let edge = self.fans.insert_at(fl, code.left(), [vs, vu, gap.tips[0]], gap.left);
        if code.two_faces() {
            let fr = self.take_slot(face + 1);
            let other = self.fans.insert_at(fr, code.right(), [vs, vu, gap.tips[1]], gap.right);
            self.fans.connect(edge, other);
        }
        let [old, new] = h.forest.nodes(i);
        (self.node[vs as usize], self.node[vu as usize]) = (old, new);
        self.end[vu as usize] = self.end[vs as usize];
        self.end[vs as usize] = pieces.order(vu);
        self.moved.push(vu);
        if code.moves() {
            self.moved.push(vs);
        }
        self.vertices += 1;
        self.applied[i as usize / 64] |= 1 << (i % 64);
    }

    /// What the faces of split `i` (applied) lie between: left and, of two faces, right.
    fn openings(&self, h: &Hierarchy, i: u32) -> [Opening; 2] {
        let code = h.mesh().splits.code[i as usize];
        let face = h.forest.first_face(i) as usize;
        let left = self.fans.opening_of(self.slot_of[face], code.left());
        let right = code.two_faces().then(|| self.fans.opening_of(self.slot_of[face + 1], code.right()));
        [left, right.unwrap_or_default()]
    }

    /// Calls `f` with the edges at which the faces are entered that stay when split `i` (applied) is undone; true for those of the new vertex. O(valence).
    pub(super) fn around(&self, h: &Hierarchy, i: u32, mut f: impl FnMut(Half, bool)) {
        let [left, right] = self.openings(h, i);
        let face = h.forest.first_face(i) as usize;
        let two = h.mesh().splits.code[i as usize].two_faces();
        let own = [self.slot_of[face], if two { self.slot_of[face + 1] } else { self.slot_of[face] }];
        // From an edge on to one of its own faces (true), or to a border.
        let mut run = |from: Option<Half>, inner: bool| {
            let mut at = from;
            for _ in 0..self.fans.corners.len() {
                let Some(e) = at else { return false };
                if own.contains(&e.face()) {
                    return true;
                }
                f(e, inner);
                at = self.fans.across(e.turn());
            }
            false
        };
        run(left.inner, true);
        if !run(left.outer, false) {
            run(right.outer, false);
        }
    }

    /// Undoes split `i`, which is applied, and which no applied one needs. O(valence).
    pub(super) fn unsplit(&mut self, h: &Hierarchy, pieces: &Pieces, i: u32) {
        let pm = h.mesh();
        let (vs, code) = (pm.splits.vertex[i as usize], pm.splits.code[i as usize]);
        let vu = h.forest.base_vertices + i;
        let [left, right] = self.openings(h, i);
        let face = h.forest.first_face(i);
        let fl = self.slot_of[face as usize];
        let fr = if code.two_faces() { self.slot_of[face as usize + 1] } else { fl };
        let mut entry = left.inner;
        for _ in 0..self.fans.corners.len() {
            let Some(e) = entry.filter(|e| e.face() != fl && e.face() != fr) else { break };
            entry = self.fans.across(e.turn());
            self.hand_over(e, vs);
        }
        self.fans.close(left);
        self.leave_slot(face, fl);
        if code.two_faces() {
            self.fans.close(right);
            self.leave_slot(face + 1, fr);
        }
        self.node[vs as usize] = pieces.parent(h, i);
        self.node[vu as usize] = NONE;
        self.end[vs as usize] = self.end[vu as usize];
        if code.moves() {
            self.moved.push(vs);
        }
        self.vertices -= 1;
        self.applied[i as usize / 64] &= !(1 << (i % 64));
    }

    #[inline]
    fn hand_over(&mut self, e: Half, v: u32) {
        self.fans.corners[e.face() as usize][e.corner()] = v;
        self.touch(e.face());
    }

    #[inline]
    fn touch(&mut self, slot: u32) {
        self.touched[slot as usize / 64] |= 1 << (slot % 64);
    }

    /// A slot for face `f`.
    fn take_slot(&mut self, f: u32) -> u32 {
        let slot = self.free.pop().unwrap_or_else(|| {
            self.fans.corners.push([NONE; 3]);
            self.fans.links.push([NONE; 3]);
            self.face_in.push(NONE);
            self.touched.resize(self.fans.corners.len().div_ceil(64), 0);
            (self.fans.corners.len() - 1) as u32
        });
        self.face_in[slot as usize] = f;
        self.slot_of[f as usize] = slot;
        self.faces += 1;
        self.touch(slot);
        slot
    }

    fn leave_slot(&mut self, f: u32, slot: u32) {
        self.fans.corners[slot as usize] = [0; 3];
        self.fans.links[slot as usize] = [NONE; 3];
        self.face_in[slot as usize] = NONE;
        self.slot_of[f as usize] = NONE;
        self.free.push(slot);
        self.faces -= 1;
        self.touch(slot);
    }

    /// Bytes that grow with the mesh shown, and bytes of tables over the finest mesh.
    pub(super) fn bytes(&self) -> (usize, usize) {
        let shown = 28 * self.fans.corners.len() + 4 * self.free.len() + 8 * self.touched.len();
        let tables = self.slot_of.len() + self.node.len() + self.end.len();
        (shown, 4 * tables + 8 * self.applied.len())
    }
}
