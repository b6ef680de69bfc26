//! The mesh between two splits, as far as coding the next one needs it: faces with their links, and where vertices are.
//!
//! An edge of a face seen from a vertex at one of its ends is a *half*, packed as `face << 3 | edge << 1 | starts`, where `starts` says that the face
//! begins the edge there; [`NONE`] for none. A link is the half across, seen from the vertex where the face ends the edge.

use super::places;
use super::plan;
use crate::aif::NONE;
use crate::progressive::links::link_faces;
use crate::progressive::{ProgressiveMesh, SplitCode};

/// A face: corners (vertices), then links.
type Face = [u32; 6];

/// By the low bits of a half: those of the face's other edge at the vertex, the corner at the vertex, that at the edge's other end.
const TURN: [u32; 8] = [3, 4, 5, 0, 1, 2, 6, 7];
const NEAR: [u8; 8] = [1, 0, 2, 1, 0, 2, 0, 0];
const FAR: [u8; 8] = [0, 1, 1, 2, 2, 0, 0, 0];
/// Where in the face the link of the half stands.
const LINK: [u8; 8] = [3, 3, 4, 4, 5, 5, 5, 5];
/// By the low bits of a half, 8 bits each: in the low four where in the face the vertex at the other end stands, above where the link of the face's other edge at the vertex does. A ring waits for one
/// such step after the other, and this takes less time than tables.
const STEPS: u64 = 0x4032_3251_5140;

/// The face's other edge at the vertex; [`NONE`] of [`NONE`].
#[inline(always)]
pub(super) fn turn(h: u32) -> u32 {
    h & !7 | TURN[(h & 7) as usize]
}

/// A half without its vertex, as references name it: `face << 2 | edge`.
#[inline]
pub(super) fn cut(h: u32) -> u32 {
    h >> 3 << 2 | h >> 1 & 3
}

/// Of [`Vertex::visit`]: the vertex was a tip since.
pub(super) const TOUCHED: u8 = 8;

/// No error yet.
pub(super) const NO_LEVEL: u16 = u16::MAX;

/// What is known of a vertex: what is looked at when it lies on a ring, and changes when it is a tip; a quarter of a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(16))]
pub(super) struct Vertex {
    /// Where it is; in double precision seen from the origin.
    place: [f32; 3],
    /// The level of the last error of a split of it, or of that which made it.
    pub(super) level: u16,
    /// Faces around it, up to 255.
    pub(super) valence: u8,
    /// What the sweep over the chunk's vertices did with it last.
    pub(super) visit: u8,
}

/// The mesh.
#[derive(Clone, Debug)]
pub(super) struct Walk {
    faces: Vec<Face>,
    pub(super) vertices: Vec<Vertex>,
    /// The half with which the ring of each vertex begins, [`NONE`] for one without faces; and the next in the order of descent, [`NONE`] behind the last.
    starts: Vec<[u32; 2]>,
    /// Places in double precision, if the mesh has that.
    exact: Option<Vec<[f64; 3]>>,
    /// The first vertex in the order of descent.
    pub(super) head: u32,
    /// What places are seen from: the first vertex of the base in double precision, else 0.
    origin: [f64; 3],
    /// Faces and vertices of the base.
    base: (usize, usize),
    /// Those that are no longer as in the base, perhaps several times.
    changed: (Vec<u32>, Vec<u32>),
}

/// An edge of a ring, and what lies at its other end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    /// Where the other end is, seen from the vertex; and 0, as four are added up as fast as three.
    pub(super) to: [f32; 4],
    /// The half by which the face behind the edge is entered; of an open ring the last has none.
    half: u32,
    /// The vertex at the other end.
    far: u32,
}

impl Edge {
    const NOWHERE: Edge = Edge { to: [0.0; 4], half: NONE, far: NONE };
}

/// The edges around a vertex, in turn.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    /// The edges; behind them the first again, or, if the ring is open, one that leads nowhere. There may be more room.
    room: Vec<Edge>,
    edges: usize,
    pub(super) closed: bool,
    /// The most edges that it is to have.
    pub(super) most: usize,
}

impl Default for Ring {
    fn default() -> Self {
        Ring { room: vec![Edge::NOWHERE; ROOM], edges: 0, closed: false, most: usize::MAX }
    }
}

/// Edges that there is room for at first.
const ROOM: usize = 32;

/// An edge of a ring as a cut: as a half of the face that goes to the new vertex and of that which stays, as far as they are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cut {
    pub(super) inner: u32,
    pub(super) outer: u32,
}

impl Cut {
    /// The half in the later-made of its faces, and whether that goes to the new vertex.
    #[inline]
    pub(super) fn name(self) -> (u32, bool) {
        let Cut { inner, outer } = self;
        let is_inner = (inner != NONE) & ((outer == NONE) | (outer >> 3 <= inner >> 3));
        // No branch: it is the one as often as the other.
        (outer ^ (inner ^ outer) & (is_inner as u32).wrapping_neg(), is_inner)
    }
}

impl Ring {
    /// Edges.
    #[inline]
    pub(super) fn edges(&self) -> usize {
        self.edges
    }

    /// All of them.
    #[inline(always)]
    pub(super) fn all(&self) -> &[Edge] {
        self.room.get(..self.edges).unwrap_or_default()
    }

    /// Edge `first` and the `count` behind it; those that are counted more than once around only after [`Ring::unroll`].
    #[inline(always)]
    pub(super) fn run(&self, first: usize, count: usize) -> &[Edge] {
        self.room.get(first..=first + count).unwrap_or_default()
    }

    /// Lets edges of a closed ring up to `last` be counted once around.
    #[inline(always)]
    pub(super) fn unroll(&mut self, last: usize) {
        if self.room.len() <= last {
            self.room.resize(last + 1, Edge::NOWHERE);
        }
        // The first stands behind the last already.
        for k in self.edges + 1..last + 1 {
            self.room[k] = self.room[k - self.edges];
        }
    }

    /// Faces.
    #[inline]
    pub(super) fn faces(&self) -> usize {
        self.edges - !self.closed as usize
    }

    /// Edge `k` as a left cut: the face behind it goes to the new vertex.
    #[inline(always)]
    pub(super) fn left(&self, k: usize) -> Cut {
        // Before the first of an open ring stands the last, which has no half.
        let before = if k == 0 { self.edges } else { k } - 1;
        Cut { inner: self.room[k].half, outer: turn(self.room[before].half) }
    }

    /// The edge `count` faces behind edge `k`, as a right cut.
    #[inline(always)]
    pub(super) fn right(&self, k: usize, count: usize) -> Cut {
        let c = self.left(self.around(k + count));
        Cut { inner: c.outer, outer: c.inner }
    }

    /// The vertex at the other end of edge `k`, which may be counted once around.
    #[inline(always)]
    pub(super) fn far(&self, k: usize) -> u32 {
        self.room[self.around(k)].far
    }

    /// The edge whose cut is named by half `h`, of a face that is entered by the edge (`entered`) or left by it.
    #[inline]
    pub(super) fn position(&self, h: u32, entered: bool) -> Option<usize> {
        let entry = if entered { h } else { turn(h) };
        let k = self.all().iter().position(|e| e.half == entry)? + !entered as usize;
        Some(if k == self.edges { 0 } else { k })
    }

    /// The half by which the ring enters a face.
    #[inline]
    pub(super) fn entry(&self, face: u32) -> Option<u32> {
        self.all().iter().map(|e| e.half).find(|&h| h >> 3 == face && h != NONE)
    }

    /// Edge `k` counted once around.
    #[inline(always)]
    pub(super) fn around(&self, k: usize) -> usize {
        if k >= self.edges { k - self.edges } else { k }
    }
}

/// A place seen from another.
#[inline(always)]
fn seen_from(origin: &[f64; 3], p: [f64; 3]) -> [f32; 3] {
    [(p[0] - origin[0]) as f32, (p[1] - origin[1]) as f32, (p[2] - origin[2]) as f32]
}

/// Adds to a list of those of `most` that have changed; what is in it again goes before it doubles that.
#[cold]
fn note(changed: &mut Vec<u32>, which: u32, most: usize) {
    if changed.len() >= 2 * most + 64 {
        changed.sort_unstable();
        changed.dedup();
    }
    changed.push(which);
}

impl Walk {
    /// Bytes of a walk that has so many vertices and faces, and of lists of those of the base that have changed.
    pub(super) fn bytes(vertices: u128, faces: u128, double: bool) -> u128 {
        let exact = if double { size_of::<[f64; 3]>() } else { 0 };
        (size_of::<Vertex>() + size_of::<[u32; 2]>() + exact) as u128 * vertices
            + size_of::<Face>() as u128 * faces
    }

    /// At the base. `None` if its faces refer to what does not exist.
    pub(super) fn new(pm: &ProgressiveMesh) -> Option<Self> {
        let n0 = pm.base_vertices();
        let of_wedge = pm.wedges.as_ref().map(|s| &s.base_vertex);
        let mut corners = pm.base_faces.clone();
        for w in corners.as_flattened_mut() {
            if let Some(of) = of_wedge {
                *w = *of.get(*w as usize)?;
            }
            if *w as usize >= n0 {
                return None;
            }
        }
        let links = link_faces(&corners, n0);
        let order = plan::base_order(pm);
        let double = pm.base_positions.is_f64();
        let origin = if double && n0 > 0 { places::point(&pm.base_positions, 0) } else { [0.0; 3] };
        let exact = double.then(|| (0..n0).map(|i| places::point(&pm.base_positions, i)).collect());
        let place = |i| seen_from(&origin, places::point(&pm.base_positions, i));
        let lone = |i| Vertex { place: place(i), level: NO_LEVEL, valence: 0, visit: 0 };
        let mut vertices: Vec<Vertex> = (0..n0).map(lone).collect();
        let mut starts = vec![[NONE; 2]; n0];
        order.windows(2).for_each(|w| starts[w[0] as usize][1] = w[1]);
        for (f, corners) in (0u32..).zip(&corners) {
            for (k, &v) in (0u32..).zip(corners) {
                let (v, start) = (&mut vertices[v as usize], &mut starts[v as usize][0]);
                if *start == NONE {
                    *start = f << 3 | k << 1 | 1;
                }
                v.valence = v.valence.saturating_add(1);
            }
        }
        let faces = corners.iter().zip(&links);
        // Cursors keep links as `face << 3 | same << 2 | edge`.
        let pack = |l: u32| if l == NONE { NONE } else { l & !7 | (l & 3) << 1 | !l >> 2 & 1 };
        Some(Walk {
            faces: faces.map(|(c, l)| [c[0], c[1], c[2], pack(l[0]), pack(l[1]), pack(l[2])]).collect(),
            base: (corners.len(), vertices.len()),
            changed: Default::default(),
            vertices,
            starts,
            exact,
            head: order.first().copied().unwrap_or(NONE),
            origin,
        })
    }

    /// Goes back to the base, which `base` is at. Takes time for what was done since, not for all of the base.
    pub(super) fn reset(&mut self, base: &Walk) {
        self.faces.truncate(self.base.0);
        self.vertices.truncate(self.base.1);
        self.starts.truncate(self.base.1);
        if let Some(exact) = &mut self.exact {
            exact.truncate(self.base.1);
        }
        let (faces, vertices) = &mut self.changed;
        for f in faces.drain(..) {
            self.faces[f as usize] = base.faces[f as usize];
        }
        for v in vertices.drain(..) {
            self.vertices[v as usize] = base.vertices[v as usize];
            self.starts[v as usize] = base.starts[v as usize];
            if let (Some(exact), Some(base)) = (&mut self.exact, &base.exact) {
                exact[v as usize] = base[v as usize];
            }
        }
    }

    /// The vertex behind `v` in the order of descent; [`NONE`] behind the last.
    #[inline(always)]
    pub(super) fn next(&self, v: u32) -> u32 {
        self.starts[v as usize][1]
    }

    /// Where vertex `v` is.
    #[inline(always)]
    pub(super) fn place(&self, v: u32) -> [f64; 3] {
        match &self.exact {
            Some(exact) => exact[v as usize],
            None => self.vertices[v as usize].place.map(f64::from),
        }
    }

    /// Moves vertex `v`.
    pub(super) fn move_to(&mut self, v: u32, place: [f64; 3]) {
        self.vertices[v as usize].place = seen_from(&self.origin, place);
        if let Some(exact) = &mut self.exact {
            exact[v as usize] = place;
        }
    }

    /// Room for so many more splits.
    pub(super) fn reserve(&mut self, splits: usize) {
        self.vertices.reserve_exact(splits);
        self.starts.reserve_exact(splits);
        self.faces.reserve_exact(2 * splits);
        if let Some(exact) = &mut self.exact {
            exact.reserve_exact(splits);
        }
    }

    /// Notes that vertex `v` is about to change.
    #[inline(always)]
    pub(super) fn changes(&mut self, v: u32) {
        if (v as usize) < self.base.1 {
            note(&mut self.changed.1, v, self.base.1);
        }
    }

    #[inline(always)]
    fn face_mut(&mut self, f: u32) -> &mut Face {
        if (f as usize) < self.base.0 {
            note(&mut self.changed.0, f, self.base.0);
        }
        &mut self.faces[f as usize]
    }

    /// The same edge in the face across.
    #[inline]
    pub(super) fn across(&self, h: u32) -> u32 {
        let link = self.faces[(h >> 3) as usize][LINK[h as usize & 7] as usize];
        if link == NONE { NONE } else { link ^ h & 1 }
    }

    /// The vertex at the other end.
    #[inline]
    pub(super) fn far(&self, h: u32) -> u32 {
        self.faces[(h >> 3) as usize][FAR[(h & 7) as usize] as usize & 3]
    }

    /// The half that `cut` names, seen from `v`.
    pub(super) fn named(&self, cut: u32, starts: bool, v: u32) -> Option<u32> {
        let face = self.faces.get((cut >> 2) as usize)?;
        let h = (cut >> 2) << 3 | (cut & 3) << 1 | starts as u32;
        (cut & 3 < 3 && face[NEAR[(h & 7) as usize] as usize] == v).then_some(h)
    }

    /// Something of the face with which the ring of `v` begins, so that it is at hand when that is asked for.
    #[inline(always)]
    pub(super) fn ask(&self, v: u32) -> u32 {
        let start = self.starts.get(v as usize).map_or(NONE, |s| s[0]);
        self.faces.get((start >> 3) as usize).map_or(0, |f| f[0])
    }

    /// Where the ring of `v` begins; [`NONE`] if it has no faces.
    #[inline]
    pub(super) fn start(&self, v: u32) -> u32 {
        self.starts[v as usize][0]
    }

    /// The half, and the other end seen from `t`.
    #[inline(always)]
    fn edge(&self, half: u32, far: u32, t: &[f32; 3]) -> Edge {
        let p = &self.vertices[far as usize].place;
        let [x, y, z] = [p[0] - t[0], p[1] - t[1], p[2] - t[2]];
        Edge { to: [x, y, z, 0.0], half, far }
    }

    /// The ring of `v` from `start` on; from the border on if there is one. `None` for links that lead astray, as only damage makes them.
    #[inline]
    pub(super) fn ring(&self, v: u32, start: u32, ring: &mut Ring) -> Option<()> {
        let t = self.vertices[v as usize].place;
        let faces = &self.faces[..];
        loop {
            let mut entry = start;
            for (n, room) in ring.room.iter_mut().enumerate() {
                let face = &faces[(entry >> 3) as usize];
                let step = (STEPS >> (8 * (entry & 7))) as usize;
                *room = self.edge(entry, face[step & 3], &t);
                let link = face[step >> 4 & 7];
                if link == NONE {
                    return self.open(start, (turn(entry), n + 1), &t, ring);
                }
                // The other edge is seen the other way.
                entry = link ^ !entry & 1;
                if entry == start {
                    let first = ring.room[0];
                    match ring.room.get_mut(n + 1) {
                        Some(room) => *room = first,
                        None => ring.room.push(first),
                    }
                    (ring.closed, ring.edges) = (true, n + 1);
                    return Some(());
                }
            }
            // Once more, with room for twice as many.
            let room = ring.room.len();
            if room > faces.len().min(ring.most) {
                return None;
            }
            ring.room.resize(2 * room.max(ROOM), Edge::NOWHERE);
        }
    }

    /// The ring goes no further than `exit`, behind `n` edges: the last edge, and those before the first.
    #[cold]
    fn open(&self, start: u32, (exit, n): (u32, usize), t: &[f32; 3], ring: &mut Ring) -> Option<()> {
        let room = &mut ring.room;
        room.truncate(n);
        room.push(self.edge(NONE, self.far(exit), t));
        let (n, mut before) = (room.len(), start);
        loop {
            let exit = self.across(before);
            if exit == NONE {
                break;
            }
            if room.len() > (2 * self.faces.len() + 1).min(ring.most) {
                return None;
            }
            before = turn(exit);
            room.push(self.edge(before, self.far(before), t));
        }
        let back = room.len() - n;
        room[n..].reverse();
        room.rotate_right(back);
        (ring.closed, ring.edges) = (false, room.len());
        // With the room that others have found there.
        room.resize((room.len() + 1).max(ROOM), Edge::NOWHERE);
        Some(())
    }

    /// Does a split of `v`: the `count` faces behind edge `first` of its ring, which is unrolled up to there, go to the new vertex, which is at `place`; both cuts as the ring has them.
    #[inline]
    pub(super) fn split(
        &mut self,
        v: u32,
        ring: &Ring,
        (first, count): (usize, usize),
        [left, right]: [Cut; 2],
        code: SplitCode,
        (place, level, visit): ([f64; 3], u16, u8),
    ) {
        let u = self.vertices.len() as u32;
        let two = code.two_faces();
        let run = ring.run(first, count);
        let end = |e: Option<&Edge>| e.map_or(NONE, |e| e.far);
        let tips = [end(run.first()), if two { end(run.last()) } else { NONE }];
        for e in run.iter().take(count) {
            if e.half == NONE {
                break;
            }
            self.face_mut(e.half >> 3)[NEAR[(e.half & 7) as usize] as usize & 3] = u;
        }
        // Both faces are across the edge between old and new vertex.
        let ends = [after_tip(code.0), after_tip(code.0 >> 3)];
        let f = self.faces.len() as u32;
        let [l, r] = [f << 3 | 1 << 1 | !ends[0] as u32, (f + 1) << 3 | 1 << 1 | !ends[1] as u32];
        let between = if two { r ^ l & 1 } else { NONE };
        let (face, [old, mut at_u]) = between_cut(f, ends[0], [v, u, tips[0]], left, between);
        self.faces.push(face);
        self.link(left.outer, old);
        self.link(left.inner, at_u);
        if two {
            let (face, [old, new]) = between_cut(f + 1, ends[1], [v, u, tips[1]], right, l ^ r & 1);
            self.faces.push(face);
            self.link(right.outer, old);
            self.link(right.inner, new);
            at_u = new;
        } else {
            // At the border, by the edge between both.
            at_u = turn(at_u);
        }
        let valence = (count + 1 + two as usize).min(255) as u8;
        self.changes(v);
        let vertex = &mut self.vertices[v as usize];
        vertex.level = level;
        let kept = vertex.valence.saturating_add(1 + two as u8);
        vertex.valence = kept.saturating_sub(count.min(255) as u8);
        let [start, next] = &mut self.starts[v as usize];
        *start = old;
        let next = std::mem::replace(next, u);
        self.starts.push([at_u, next]);
        if let Some(exact) = &mut self.exact {
            exact.push(place);
        }
        let place = seen_from(&self.origin, place);
        self.vertices.push(Vertex { place, level, valence, visit });
        for tip in tips {
            self.changes(tip);
            if let Some(t) = self.vertices.get_mut(tip as usize) {
                t.valence = t.valence.saturating_add(1);
                t.visit |= TOUCHED;
            }
        }
    }

    /// Links half `x`, if there is one, to `y`, both seen from the same vertex.
    #[inline(always)]
    fn link(&mut self, x: u32, y: u32) {
        if x != NONE {
            self.face_mut(x >> 3)[LINK[x as usize & 7] as usize] = y ^ x & 1;
        }
    }
}

/// Of the three low bits of a code: the new vertex follows the tip.
#[inline(always)]
fn after_tip(code: u16) -> bool {
    0b0011_1000 >> (code & 7) & 1 == 1
}

/// Face `face` (tip first) in an opening, with the link of its edge between old and new vertex; and the half between the tip and the old one, seen from the old, and that between the tip and
/// the new one, seen from that.
#[inline(always)]
fn between_cut(face: u32, new_next: bool, [v, u, tip]: [u32; 3], at: Cut, between: u32) -> (Face, [u32; 2]) {
    // Edge 0 ends at corner 1, edge 2 begins at corner 2.
    let (after, before) = (face << 3, face << 3 | 2 << 1 | 1);
    // Seen from where the face ends the edge.
    let link = |to: u32, from: u32| if to == NONE { NONE } else { to ^ from & 1 };
    if new_next {
        ([tip, u, v, link(at.inner, after), between, link(at.outer, before)], [before, after])
    } else {
        ([tip, v, u, link(at.outer, after), between, link(at.inner, before)], [after, before])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progressive::links::{Half, across, link};

    #[test]
    fn packed_halves_are_those_of_cursors() {
        for (edge, starts) in (0..3).flat_map(|e| [(e, false), (e, true)]) {
            let pack = |h: Half| h.face() << 3 | h.edge() << 1 | h.starts() as u32;
            let h = Half::new(5, edge, starts);
            let low = (pack(h) & 7) as usize;
            assert_eq!(turn(pack(h)), pack(h.turn()));
            assert_eq!(NEAR[low] as usize, h.corner());
            assert_eq!((STEPS >> (8 * low) >> 4 & 7) as usize, LINK[(turn(pack(h)) & 7) as usize] as usize);
            assert_eq!((STEPS >> (8 * low) & 3) as usize, h.far_corner());
            assert_eq!(FAR[low] as usize, h.far_corner());
            assert_eq!(cut(pack(h)), h.code());
            for starts in [false, true] {
                let to = Half::new(9, 1, starts);
                let l = pack(to) ^ pack(h) & 1;
                assert_eq!(across(h, link(h, to)), Some(to));
                assert_eq!(l ^ pack(h) & 1, pack(to));
                // As `Walk::new` makes it of a cursor's link.
                let packed = link(h, to);
                assert_eq!(packed & !7 | (packed & 3) << 1 | !packed >> 2 & 1, l);
            }
        }
    }
}
