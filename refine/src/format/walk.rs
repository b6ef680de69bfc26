//! The mesh between two splits, as far as coding the next one needs it: faces with their links, and where vertices are.
//!
//! An edge of a face seen from a vertex at one of its ends is a *half*, packed as `face << 3 | edge << 1 | starts`, where `starts` says that the face
//! begins the edge there; [`NONE`] for none. A link is the half across, seen from the vertex where the face ends the edge.

use super::places;
use super::plan::{self, Label};
use crate::aif::NONE;
use crate::progressive::links::link_faces;
use crate::progressive::{ProgressiveMesh, SplitCode};

/// A face: corners (vertices) in 0..3, links in 4..7; half a cache line.
type Face = [u32; 8];

/// By the low bits of a half: those of the face's other edge at the vertex, the corner at the vertex, that at the edge's other end.
const TURN: [u32; 8] = [3, 4, 5, 0, 1, 2, 0, 0];
const NEAR: [u8; 8] = [1, 0, 2, 1, 0, 2, 0, 0];
const FAR: [u8; 8] = [0, 1, 1, 2, 2, 0, 0, 0];

/// The face's other edge at the vertex.
#[inline]
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

/// What is known of a vertex: half a cache line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// Where it is.
    pub(super) place: [f64; 3],
    /// The half with which its ring begins; [`NONE`] for a vertex without faces.
    at: u32,
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
    /// The place of each vertex in the order of descent.
    labels: Vec<Label>,
    /// Faces and vertices of the base.
    base: (usize, usize),
    /// Those that are no longer as in the base, perhaps several times.
    changed: (Vec<u32>, Vec<u32>),
}

/// The edges around a vertex, in turn.
#[derive(Clone, Debug, Default)]
pub(super) struct Ring {
    /// Each as the half by which the face behind it is entered, and the vertex at its other end. Of an open ring the last has no face behind it. There may be more room than edges.
    room: Vec<(u32, u32)>,
    edges: usize,
    pub(super) closed: bool,
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
        let inner = self.inner != NONE && (self.outer == NONE || self.outer >> 3 <= self.inner >> 3);
        (if inner { self.inner } else { self.outer }, inner)
    }
}

impl Ring {
    /// Edges.
    #[inline]
    pub(super) fn edges(&self) -> usize {
        self.edges
    }

    #[inline]
    fn all(&self) -> &[(u32, u32)] {
        self.room.get(..self.edges).unwrap_or_default()
    }

    /// Faces.
    #[inline]
    pub(super) fn faces(&self) -> usize {
        self.edges - !self.closed as usize
    }

    /// Edge `k` as a left cut: the face behind it goes to the new vertex.
    #[inline]
    pub(super) fn left(&self, k: usize) -> Cut {
        let all = self.all();
        let before = match k {
            0 if self.closed => all.last().map_or(NONE, |e| turn(e.0)),
            0 => NONE,
            _ => turn(all[k - 1].0),
        };
        Cut { inner: all[k].0, outer: before }
    }

    /// The edge `count` faces behind edge `k`, as a right cut.
    #[inline]
    pub(super) fn right(&self, k: usize, count: usize) -> Cut {
        let c = self.left(self.around(k + count));
        Cut { inner: c.outer, outer: c.inner }
    }

    /// The vertex at the other end of edge `k`, which may be counted once around.
    #[inline]
    pub(super) fn far(&self, k: usize) -> u32 {
        self.all()[self.around(k)].1
    }

    /// The vertices at the other ends of all edges.
    #[inline]
    pub(super) fn fars(&self) -> impl ExactSizeIterator<Item = u32> + '_ {
        self.all().iter().map(|e| e.1)
    }

    /// The edge whose cut is named by half `h`, of a face that is entered by the edge (`entered`) or left by it.
    #[inline]
    pub(super) fn position(&self, h: u32, entered: bool) -> Option<usize> {
        let entry = if entered { h } else { turn(h) };
        let k = self.all().iter().position(|e| e.0 == entry)? + !entered as usize;
        Some(if k == self.edges { 0 } else { k })
    }

    /// The half by which the ring enters a face.
    #[inline]
    pub(super) fn entry(&self, face: u32) -> Option<u32> {
        self.all().iter().map(|e| e.0).find(|&h| h >> 3 == face && h != NONE)
    }

    /// Edge `k` counted once around.
    #[inline]
    pub(super) fn around(&self, k: usize) -> usize {
        if k >= self.edges { k - self.edges } else { k }
    }
}

impl Walk {
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
        let labels = plan::labels(&plan::base_order(pm));
        let lone = |i: usize| Vertex {
            place: places::point(&pm.base_positions, i),
            at: NONE,
            level: NO_LEVEL,
            valence: 0,
            visit: 0,
        };
        let mut vertices: Vec<Vertex> = (0..n0).map(lone).collect();
        for (f, corners) in (0u32..).zip(&corners) {
            for (k, &v) in (0u32..).zip(corners) {
                let v = &mut vertices[v as usize];
                if v.at == NONE {
                    v.at = f << 3 | k << 1 | 1;
                }
                v.valence = v.valence.saturating_add(1);
            }
        }
        let faces = corners.iter().zip(&links);
        // Cursors keep links as `face << 3 | same << 2 | edge`.
        let pack = |l: u32| if l == NONE { NONE } else { l & !7 | (l & 3) << 1 | !l >> 2 & 1 };
        Some(Walk {
            faces: faces.map(|(c, l)| [c[0], c[1], c[2], 0, pack(l[0]), pack(l[1]), pack(l[2]), 0]).collect(),
            base: (corners.len(), vertices.len()),
            changed: Default::default(),
            vertices,
            labels,
        })
    }

    /// Goes back to the base, which `base` is at. Takes time for what was done since, not for all of the base.
    pub(super) fn reset(&mut self, base: &Walk) {
        self.faces.truncate(self.base.0);
        self.vertices.truncate(self.base.1);
        self.labels.truncate(self.base.1);
        let (faces, vertices) = &mut self.changed;
        for f in faces.drain(..) {
            self.faces[f as usize] = base.faces[f as usize];
        }
        for v in vertices.drain(..) {
            self.vertices[v as usize] = base.vertices[v as usize];
            self.labels[v as usize] = base.labels[v as usize];
        }
    }

    /// Where vertex `v` is in the order of descent.
    #[inline]
    pub(super) fn label(&self, v: u32) -> Label {
        self.labels[v as usize]
    }

    /// Notes that vertex `v` is about to change.
    #[inline]
    pub(super) fn changes(&mut self, v: u32) {
        if (v as usize) < self.base.1 {
            self.changed.1.push(v);
        }
    }

    #[inline]
    fn face_mut(&mut self, f: u32) -> &mut Face {
        if (f as usize) < self.base.0 {
            self.changed.0.push(f);
        }
        &mut self.faces[f as usize]
    }

    /// The same edge in the face across.
    #[inline]
    pub(super) fn across(&self, h: u32) -> u32 {
        let link = self.faces[(h >> 3) as usize][4 + (h >> 1 & 3) as usize];
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

    /// Where the ring of `v` begins; [`NONE`] if it has no faces.
    #[inline]
    pub(super) fn start(&self, v: u32) -> u32 {
        self.vertices[v as usize].at
    }

    /// The ring from `start` on; from the border on if there is one. `None` for links that lead astray, as only damage makes them.
    #[inline]
    pub(super) fn ring(&self, start: u32, ring: &mut Ring) -> Option<()> {
        let most = self.faces.len();
        let (faces, mut entry, mut n) = (&self.faces[..], start, 0);
        let exit = loop {
            let face = &faces[(entry >> 3) as usize];
            let low = (entry & 7) as usize;
            let edge = (entry, face[FAR[low] as usize & 3]);
            match ring.room.get_mut(n) {
                Some(room) => *room = edge,
                None if n > most => return None,
                None => ring.room.resize(2 * n.max(ROOM), edge),
            }
            n += 1;
            let exit = TURN[low];
            let link = face[4 + (exit >> 1 & 3) as usize];
            if link == NONE {
                break turn(entry);
            }
            entry = link ^ exit & 1;
            if entry == start {
                (ring.closed, ring.edges) = (true, n);
                return Some(());
            }
        };
        ring.closed = false;
        ring.room.truncate(n);
        ring.room.push((NONE, self.far(exit)));
        let (n, mut before) = (ring.room.len(), start);
        loop {
            let exit = self.across(before);
            if exit == NONE {
                break;
            }
            if ring.room.len() > 2 * most + 1 {
                return None;
            }
            before = turn(exit);
            ring.room.push((before, self.far(before)));
        }
        let back = ring.room.len() - n;
        ring.room[n..].reverse();
        ring.room.rotate_right(back);
        ring.edges = ring.room.len();
        Some(())
    }

    /// Does a split of `v`: the `count` faces behind edge `first` of its ring go to the new vertex, which is at `place`. Returns the tips.
    #[inline]
    pub(super) fn split(
        &mut self,
        v: u32,
        ring: &Ring,
        (first, count): (usize, usize),
        code: SplitCode,
        (place, level): ([f64; 3], u16),
    ) -> [u32; 2] {
        let u = self.vertices.len() as u32;
        let two = code.two_faces();
        let (left, right) = (ring.left(first), ring.right(first, count));
        let tips = [ring.far(first), if two { ring.far(first + count) } else { NONE }];
        for k in first..first + count {
            let entry = ring.all()[ring.around(k)].0;
            if entry == NONE {
                break;
            }
            self.face_mut(entry >> 3)[NEAR[(entry & 7) as usize] as usize & 3] = u;
        }
        let (l, old, mut at_u) = self.insert(code.left().1, [v, u, tips[0]], left);
        if two {
            let (r, _, new) = self.insert(code.right().1, [v, u, tips[1]], right);
            self.link(l, r);
            self.link(r, l);
            at_u = new;
        } else {
            // At the border, by the edge between both.
            at_u = turn(at_u);
        }
        let valence = (count + 1 + two as usize).min(255) as u8;
        self.changes(v);
        let vertex = &mut self.vertices[v as usize];
        (vertex.at, vertex.level) = (old, level);
        let kept = vertex.valence.saturating_add(1 + two as u8);
        vertex.valence = kept.saturating_sub(count.min(255) as u8);
        self.vertices.push(Vertex { place, at: at_u, level, valence, visit: 0 });
        let label = self.labels[v as usize].split();
        self.labels.push(label);
        for tip in tips {
            self.changes(tip);
            if let Some(t) = self.vertices.get_mut(tip as usize) {
                t.valence = t.valence.saturating_add(1);
                t.visit |= TOUCHED;
            }
        }
        tips
    }

    /// Appends a face (tip first) into an opening; returns its edge between old and new vertex, that between the tip and the old one, both seen from
    /// the old, and that between the tip and the new one, seen from that.
    #[inline]
    fn insert(&mut self, new_next: bool, [v, u, tip]: [u32; 3], at: Cut) -> (u32, u32, u32) {
        let face = self.faces.len() as u32;
        let (b, c) = if new_next { (u, v) } else { (v, u) };
        // Edge 0 ends at corner 1, edge 2 begins at corner 2.
        let (after, before) = (face << 3, face << 3 | 2 << 1 | 1);
        let (old, new) = if new_next { (before, after) } else { (after, before) };
        let (to_after, to_before) = if new_next { (at.inner, at.outer) } else { (at.outer, at.inner) };
        // Seen from where the face ends the edge.
        let link = |to: u32, from: u32| if to == NONE { NONE } else { to ^ from & 1 };
        self.faces.push([tip, b, c, 0, link(to_after, after), NONE, link(to_before, before), 0]);
        if at.outer != NONE {
            self.link(at.outer, old);
        }
        if at.inner != NONE {
            self.link(at.inner, new);
        }
        (face << 3 | 1 << 1 | !new_next as u32, old, new)
    }

    /// Links half `x` to `y`, both seen from the same vertex.
    #[inline]
    fn link(&mut self, x: u32, y: u32) {
        self.face_mut(x >> 3)[4 + (x >> 1 & 3) as usize] = y ^ x & 1;
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
