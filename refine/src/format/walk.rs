//! The mesh between two splits, as far as coding the next one needs it: faces with their links, and where vertices are.

use super::places;
use crate::aif::NONE;
use crate::progressive::links::{Half, across, link, link_faces, previous};
use crate::progressive::{ProgressiveMesh, SplitCode};

/// A face: corners (vertices) in 0..3, links in 4..7; half a cache line.
type Face = [u32; 8];

/// No error yet.
pub(super) const NO_LEVEL: u16 = u16::MAX;

/// What is known of a vertex, beside where it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// A half-edge with which its ring begins, `face << 3 | edge << 1 | starts`; [`NONE`] for a vertex without faces.
    at: u32,
    /// Faces around it.
    pub(super) valence: u16,
    /// The level of the last error of a split of it, or of that which made it.
    pub(super) level: u16,
    /// What the sweep over the chunk's vertices did with it last.
    pub(super) visit: u8,
}

/// The mesh.
#[derive(Clone, Debug, Default)]
pub(super) struct Walk {
    faces: Vec<Face>,
    pub(super) vertices: Vec<Vertex>,
    pub(super) places: Vec<[f64; 3]>,
}

/// The edges around a vertex, in turn.
#[derive(Clone, Debug, Default)]
pub(super) struct Ring {
    /// The faces around the vertex, each by the edge by which it is entered.
    pub(super) entries: Vec<Half>,
    /// The vertices at the other ends of the edges; one more than faces if the ring is open.
    pub(super) far: Vec<u32>,
    pub(super) closed: bool,
}

/// An edge of a ring as a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    pub(super) inner: Option<Half>,
    pub(super) outer: Option<Half>,
}

impl Edge {
    /// The later-made of its faces, and whether that is the one that goes to the new vertex.
    #[inline]
    pub(super) fn name(self) -> Option<(Half, bool)> {
        match (self.inner, self.outer) {
            (Some(i), Some(o)) if o.face > i.face => Some((o, false)),
            (Some(i), _) => Some((i, true)),
            (None, o) => o.map(|o| (o, false)),
        }
    }
}

impl Ring {
    /// Edge `k` as a left cut: the face behind it goes to the new vertex.
    #[inline]
    pub(super) fn left(&self, k: usize) -> Edge {
        let before = if k > 0 {
            Some(self.entries[k - 1].turn())
        } else {
            self.entries.last().filter(|_| self.closed).map(|h| h.turn())
        };
        Edge { inner: self.entries.get(k).copied(), outer: before }
    }

    /// The edge `count` faces behind edge `k`, as a right cut.
    #[inline]
    pub(super) fn right(&self, k: usize, count: usize) -> Edge {
        let at = |i: usize| if i >= self.entries.len() && self.closed { i - self.entries.len() } else { i };
        let edge = self.left(at(k + count));
        Edge { inner: edge.outer, outer: edge.inner }
    }

    /// The vertex at the other end of edge `k`, which may be counted once around.
    #[inline]
    pub(super) fn far(&self, k: usize) -> u32 {
        let n = self.far.len();
        self.far[if k >= n { k - n } else { k }]
    }
}

impl Walk {
    /// At the base.
    pub(super) fn new(pm: &ProgressiveMesh) -> Self {
        let n0 = pm.base_vertices();
        let vertex = |w: u32| pm.wedges.as_ref().map_or(w, |s| s.base_vertex[w as usize]);
        let corners: Vec<[u32; 3]> = pm.base_faces.iter().map(|f| f.map(vertex)).collect();
        let links = link_faces(&corners, n0);
        let empty = Vertex { at: NONE, valence: 0, level: NO_LEVEL, visit: 0 };
        let mut vertices = vec![empty; n0];
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
        Walk {
            faces: faces.map(|(c, l)| [c[0], c[1], c[2], 0, l[0], l[1], l[2], 0]).collect(),
            vertices,
            places: (0..n0).map(|i| places::point(&pm.base_positions, i)).collect(),
        }
    }

    pub(super) fn face_count(&self) -> usize {
        self.faces.len()
    }

    #[inline]
    fn link_at(&self, h: Half) -> u32 {
        self.faces[h.face as usize][4 + (h.edge & 3) as usize]
    }

    #[inline]
    pub(super) fn across(&self, h: Half) -> Option<Half> {
        across(h, self.link_at(h))
    }

    /// The vertex at the other end.
    #[inline]
    pub(super) fn far(&self, h: Half) -> u32 {
        self.faces[h.face as usize][h.far_corner() & 3]
    }

    /// The vertex that `h` is seen from.
    #[inline]
    pub(super) fn near(&self, h: Half) -> u32 {
        self.faces[h.face as usize][h.corner() & 3]
    }

    /// The half-edge `cut` (`face << 2 | edge`) names, seen from `v`.
    pub(super) fn named(&self, cut: u32, starts: bool, v: u32) -> Option<Half> {
        let h = Half { face: cut >> 2, edge: cut & 3, starts };
        (h.edge < 3 && (h.face as usize) < self.faces.len() && self.near(h) == v).then_some(h)
    }

    /// Where the ring of `v` begins.
    #[inline]
    pub(super) fn start(&self, v: u32) -> Option<Half> {
        let at = self.vertices[v as usize].at;
        (at != NONE).then_some(Half { face: at >> 3, edge: at >> 1 & 3, starts: at & 1 == 1 })
    }

    /// The ring from `start` on; from the border on if there is one.
    #[inline]
    pub(super) fn ring(&self, start: Half, ring: &mut Ring) {
        ring.entries.clear();
        ring.far.clear();
        ring.closed = true;
        let mut entry = start;
        loop {
            ring.entries.push(entry);
            ring.far.push(self.far(entry));
            let exit = entry.turn();
            match self.across(exit) {
                Some(next) if next == start => return,
                Some(next) => entry = next,
                None => {
                    ring.far.push(self.far(exit));
                    break;
                }
            }
        }
        ring.closed = false;
        let (mut before, mut back) = (start, 0);
        while let Some(exit) = self.across(before) {
            before = exit.turn();
            ring.entries.push(before);
            ring.far.push(self.far(before));
            back += 1;
        }
        let (n, m) = (ring.entries.len(), ring.far.len());
        ring.entries[n - back..].reverse();
        ring.far[m - back..].reverse();
        ring.entries.rotate_right(back);
        ring.far.rotate_right(back);
    }

    /// Does a split of `v`: the `count` faces from `left.inner` on go to the new vertex, which is at `place`.
    #[inline]
    pub(super) fn split(
        &mut self,
        v: u32,
        (left, right): (Edge, Edge),
        count: usize,
        code: SplitCode,
        (place, level): ([f64; 3], u16),
    ) {
        let u = self.vertices.len() as u32;
        let two = code.two_faces();
        let tip = |e: Edge| e.inner.or(e.outer).map_or(NONE, |h| self.far(h));
        let tips = [tip(left), tip(right)];
        let mut entry = left.inner;
        for _ in 0..count {
            let Some(h) = entry else { break };
            self.faces[h.face as usize][h.corner() & 3] = u;
            entry = self.across(h.turn());
        }
        let (l, old, new) = self.insert(code.left().1, [v, u, tips[0]], left);
        let mut at_u = Half { edge: 1, starts: code.left().1, ..new };
        if two {
            let (r, _, new) = self.insert(code.right().1, [v, u, tips[1]], right);
            self.connect(l, r);
            at_u = new;
        }
        let pack = |h: Half| h.face << 3 | h.edge << 1 | h.starts as u32;
        let valence = (count + 1 + two as usize).min(u16::MAX as usize) as u16;
        self.vertices.push(Vertex { at: pack(at_u), valence, level, visit: 0 });
        let old_vertex = &mut self.vertices[v as usize];
        old_vertex.at = pack(old);
        old_vertex.level = level;
        old_vertex.valence = old_vertex.valence.saturating_add(1 + two as u16).saturating_sub(count as u16);
        for t in &tips[..1 + two as usize] {
            if let Some(t) = self.vertices.get_mut(*t as usize) {
                t.valence = t.valence.saturating_add(1);
            }
        }
        self.places.push(place);
    }

    /// Appends a face (tip first) into an opening; returns its edge between old and new vertex, that between the tip and the old one, both seen from
    /// the old, and that between the tip and the new one, seen from that.
    #[inline]
    fn insert(&mut self, new_next: bool, [v, u, tip]: [u32; 3], at: Edge) -> (Half, Half, Half) {
        let face = self.faces.len() as u32;
        let (b, c) = if new_next { (u, v) } else { (v, u) };
        self.faces.push([tip, b, c, 0, NONE, NONE, NONE, 0]);
        let after = Half { face, edge: 0, starts: false };
        let before = Half { face, edge: previous(0) as u32, starts: true };
        let (old, new) = if new_next { (before, after) } else { (after, before) };
        if let Some(outer) = at.outer {
            self.connect(old, outer);
        }
        if let Some(inner) = at.inner {
            self.connect(new, inner);
        }
        (Half { face, edge: 1, starts: !new_next }, old, new)
    }

    #[inline]
    fn connect(&mut self, x: Half, y: Half) {
        self.faces[x.face as usize][4 + (x.edge & 3) as usize] = link(x, y);
        self.faces[y.face as usize][4 + (y.edge & 3) as usize] = link(y, x);
    }
}
