//! Queries that walk over the mesh: fans and rings, links, border loops, components, Euler characteristic, genus.
//!
//! Nothing here recurses, and what looks at the whole mesh takes linear time in its relations (but for the
//! inverse-Ackermann-like factor of disjoint sets).

use crate::bits::Bits;
use crate::ids::{EdgeId, FaceId, NONE, VertexId};
use crate::sets::Sets;
use crate::topology::Topology;

/// Faces around a vertex, each sharing an edge of two faces with the next.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fan {
    /// The faces, in order around the vertex.
    pub faces: Vec<FaceId>,
    /// The edges at the vertex, in order: `edges[i]` lies before `faces[i]`. One more than faces if the fan is open.
    pub edges: Vec<EdgeId>,
    /// The other ends of `edges`.
    pub neighbours: Vec<VertexId>,
    /// True if the last face is followed by the first.
    pub closed: bool,
}

/// The link of a vertex: what bounds its star.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Link {
    /// All vertices of the faces and edges at the vertex, without itself; ascending.
    pub vertices: Vec<VertexId>,
    /// The edges of the faces at the vertex that do not end there; ascending.
    pub edges: Vec<EdgeId>,
}

/// A walk along edges of one face.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BorderLoop {
    /// The vertices in order; the first is not repeated at the end of a closed loop.
    pub vertices: Vec<VertexId>,
    /// The edges in order: `edges[i]` leaves `vertices[i]`.
    pub edges: Vec<EdgeId>,
    /// False if the walk ends at complex edges, where the border is no curve.
    pub closed: bool,
}

/// Connected components.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Components {
    /// The component of every slot, or [`NONE`] for a removed element. Numbered in the order of their first element.
    pub of: Vec<u32>,
    /// How many there are.
    pub count: usize,
}

impl Topology {
    /// The faces around `v`, as fans: longest runs in which each face shares an edge of exactly two faces at `v` with the next.
    ///
    /// A regular vertex has one fan that holds its whole star. Complex edges end fans and belong to several; dangling edges belong
    /// to none. A fan runs counter-clockwise seen from the side to which its first face's normal points. Open fans come first.
    /// O(k log k) for k corners of the faces around `v`.
    pub fn fans(&self, v: VertexId) -> Vec<Fan> {
        // The corners at v: face, and the edges that leave and enter v.
        let mut corners: Vec<(FaceId, [EdgeId; 2])> = Vec::with_capacity(self.star(v).len());
        for &e in self.star(v) {
            for &f in self.edge_faces(e) {
                let uses = self.face_edges(f);
                if let Some(i) = uses.iter().position(|&u| u.edge() == e && self.origin(u) == v) {
                    let before = if i == 0 { uses.len() - 1 } else { i - 1 };
                    corners.push((f, [e, uses[before].edge()]));
                }
            }
        }
        // Side 2c is the leaving edge of corner c, 2c + 1 the entering one; two sides on an edge of two faces are partners.
        let edge_of = |side: usize| corners[side / 2].1[side % 2];
        let mut sides: Vec<usize> = (0..2 * corners.len()).collect();
        sides.sort_unstable_by_key(|&s| (edge_of(s), s));
        let mut partner = vec![usize::MAX; sides.len()];
        for pair in sides.chunk_by(|&a, &b| edge_of(a) == edge_of(b)) {
            if let [a, b] = *pair {
                (partner[a], partner[b]) = (b, a);
            }
        }
        let mut seen = vec![false; corners.len()];
        let mut fans = Vec::new();
        // From open ends that leave v, then from those that enter (faces that turn both ways), then round closed fans.
        let open = |leaving: usize| (0..corners.len()).map(move |c| 2 * c + leaving);
        let starts = open(0).chain(open(1)).filter(|&s| partner[s] == usize::MAX).chain(open(0));
        for start in starts {
            if seen[start / 2] {
                continue;
            }
            let mut fan = Fan::default();
            let mut side = start;
            loop {
                seen[side / 2] = true;
                fan.edges.push(edge_of(side));
                fan.faces.push(corners[side / 2].0);
                let out = side ^ 1;
                side = partner[out];
                if side == usize::MAX {
                    fan.edges.push(edge_of(out));
                    break;
                }
                if seen[side / 2] {
                    fan.closed = true;
                    break;
                }
            }
            fan.neighbours = fan.edges.iter().map(|&e| self.other(e, v)).collect();
            fans.push(fan);
        }
        fans
    }

    /// The ordered ring of faces, edges and neighbours around a regular vertex; `None` if `v` is not regular.
    ///
    /// Counter-clockwise as [`Topology::fans`] has it. In faces of four and more corners, vertices across the face are no neighbours.
    pub fn one_ring(&self, v: VertexId) -> Option<Fan> {
        if !self.is_regular(v) {
            return None;
        }
        self.fans(v).pop()
    }

    /// The link of `v`. O(k log k) for k corners of the faces around `v`.
    pub fn link(&self, v: VertexId) -> Link {
        let mut link = Link::default();
        link.vertices.extend(self.star(v).iter().map(|&e| self.other(e, v)));
        for f in self.vertex_faces(v) {
            for &u in self.face_edges(f) {
                let ends = self.edge_vertices(u.edge());
                if !ends.contains(&v) {
                    link.edges.push(u.edge());
                    link.vertices.extend(ends);
                }
            }
        }
        link.vertices.sort_unstable();
        link.vertices.dedup();
        link.edges.sort_unstable();
        link.edges.dedup();
        link
    }

    /// The border, as walks along the edges of exactly one face: every such edge is in exactly one walk.
    ///
    /// A walk goes the way the face of its least edge runs, that is with the surface on its left, and leaves every vertex at the
    /// other end of the fan it came by: where borders touch at a cut vertex they do not cross. Walks are closed but where the other end
    /// of the fan is a complex edge. In the order of their least edge. Linear in the relations of the mesh.
    pub fn border_loops(&self) -> Vec<BorderLoop> {
        let uses = EdgeSlots::new(self);
        let mut seen = Bits::new(self.edge_slots());
        let mut loops = Vec::new();
        for start in self.edges().filter(|&e| self.edge_faces(e).len() == 1) {
            if seen.get(start.index()) {
                continue;
            }
            seen.set(start.index());
            let slot = uses.of[start.index()][0];
            let first = self.corners[slot as usize];
            let ahead = self.walk_border(&uses, slot, self.target(first), &mut seen);
            let closed = ahead.last().is_some_and(|&(e, _)| e == start);
            let mut border = BorderLoop { closed, ..Default::default() };
            if !closed {
                let behind = self.walk_border(&uses, slot, self.origin(first), &mut seen);
                for &(e, v) in behind.iter().rev() {
                    border.edges.push(e);
                    border.vertices.push(v);
                }
            }
            border.vertices.push(self.origin(first));
            border.edges.push(start);
            let mut from = self.target(first);
            for (e, to) in ahead.into_iter().filter(|a| a.0 != start) {
                border.vertices.push(from);
                border.edges.push(e);
                from = to;
            }
            if !closed {
                border.vertices.push(from);
            }
            loops.push(border);
        }
        loops
    }

    /// Follows the border from the edge at `slot` over its end `v`: the edges met and where they lead, up to and with the edge that
    /// was seen before, or to the end.
    fn walk_border(
        &self,
        uses: &EdgeSlots,
        slot: u32,
        v: VertexId,
        seen: &mut Bits,
    ) -> Vec<(EdgeId, VertexId)> {
        let (mut slot, mut v, mut met) = (slot, v, Vec::new());
        loop {
            // Round v, to the other end of the fan.
            slot = uses.beside(self, slot, v);
            let e = loop {
                let e = self.corners[slot as usize].edge();
                match uses.across(e, slot) {
                    Some(other) => slot = uses.beside(self, other, v),
                    None => break e,
                }
            };
            if self.edge_faces(e).len() != 1 {
                return met;
            }
            v = self.other(e, v);
            met.push((e, v));
            if seen.get(e.index()) {
                return met;
            }
            seen.set(e.index());
        }
    }

    /// Components of the faces: faces that share an edge (of any kind) are connected; sharing a vertex is not enough.
    pub fn face_components(&self) -> Components {
        let mut sets = Sets::new(self.face_slots());
        for e in self.edges() {
            for pair in self.edge_faces(e).windows(2) {
                sets.union(pair[0].index(), pair[1].index());
            }
        }
        let (of, count) = sets.number(|f| self.has_face(FaceId(f as u32)));
        Components { of, count }
    }

    /// Components of the vertices: those joined by an edge, of any kind, are connected. An isolated vertex is a component.
    pub fn vertex_components(&self) -> Components {
        let mut sets = Sets::new(self.vertex_slots());
        for e in self.edges() {
            let [a, b] = self.edge_vertices(e);
            sets.union(a.index(), b.index());
        }
        let (of, count) = sets.number(|v| self.has_vertex(VertexId(v as u32)));
        Components { of, count }
    }

    /// Vertices - edges + faces, of all live elements; isolated vertices and dangling edges count. O(1).
    pub fn euler_characteristic(&self) -> i64 {
        self.vertex_count() as i64 - self.edge_count() as i64 + self.face_count() as i64
    }

    /// The genus (number of handles), summed over the face components; `None` if there is a complex edge or the surface is not
    /// orientable.
    ///
    /// Borders count as holes that are closed, cut vertices as one vertex for each of their fans; isolated vertices and
    /// edges without a face do not matter. Linear.
    pub fn genus(&self) -> Option<usize> {
        if self.edges().any(|e| self.edge_faces(e).len() > 2) || !self.is_orientable() {
            return None;
        }
        let vertices: i64 = self.pieces().iter().map(|&n| n as i64).sum();
        let edges = self.edges().filter(|&e| !self.edge_faces(e).is_empty()).count() as i64;
        let holes = self.border_loops().len() as i64;
        let chi = vertices - edges + self.face_count() as i64 + holes;
        usize::try_from((2 * self.face_components().count as i64 - chi) / 2).ok()
    }

    /// How many edges of two faces there are along which both faces run the same way: none if all faces are oriented
    /// consistently. Linear.
    pub fn misoriented_edges(&self) -> usize {
        let uses = EdgeSlots::new(self);
        self.edges().filter(|&e| uses.pair(e).is_some_and(|p| self.same_way(p))).count()
    }

    /// True if the faces could be turned so that no edge of two faces is misoriented. Complex edges are not looked at. In effect linear.
    pub fn is_orientable(&self) -> bool {
        // Every face twice, as it is and turned; faces with an edge in common agree in one of the two ways.
        let uses = EdgeSlots::new(self);
        let mut sets = Sets::new(2 * self.face_slots());
        for e in self.edges() {
            let (Some(pair), &[f, g]) = (uses.pair(e), self.edge_faces(e)) else { continue };
            let turn = self.same_way(pair) as usize;
            sets.union(2 * f.index(), 2 * g.index() + turn);
            sets.union(2 * f.index() + 1, 2 * g.index() + (turn ^ 1));
        }
        self.faces().all(|f| sets.find(2 * f.index()) != sets.find(2 * f.index() + 1))
    }

    fn same_way(&self, [a, b]: [u32; 2]) -> bool {
        self.corners[a as usize].side() == self.corners[b as usize].side()
    }
}

/// Where edges are used: the relation edge -> corner slots, made for walks over the whole mesh.
struct EdgeSlots {
    /// The slots of an edge of one or two faces; [`NONE`] beyond, and at a complex edge.
    of: Vec<[u32; 2]>,
    /// The face of every corner slot, where they are not all triangles.
    face: Vec<u32>,
}

impl EdgeSlots {
    fn new(t: &Topology) -> Self {
        let mut of = vec![[NONE; 2]; t.edge_slots()];
        let mut face = vec![NONE; if t.is_triangular() { 0 } else { t.corner_slots() }];
        for f in t.faces() {
            for c in t.corner_range(f) {
                let e = t.corners[c].edge();
                let slots = &mut of[e.index()];
                match t.edge_faces(e).len() {
                    1 | 2 => slots[(slots[0] != NONE) as usize] = c as u32,
                    _ => {}
                }
                if let Some(to) = face.get_mut(c) {
                    *to = f.0;
                }
            }
        }
        EdgeSlots { of, face }
    }

    /// Both slots of an edge of two faces.
    #[inline]
    fn pair(&self, e: EdgeId) -> Option<[u32; 2]> {
        Some(self.of[e.index()]).filter(|s| s[1] != NONE)
    }

    /// The other slot of an edge of two faces.
    #[inline]
    fn across(&self, e: EdgeId, slot: u32) -> Option<u32> {
        self.pair(e).map(|[a, b]| if a == slot { b } else { a })
    }

    /// The slot of the other edge at `v` in the face of `slot`.
    #[inline]
    fn beside(&self, t: &Topology, slot: u32, v: VertexId) -> u32 {
        let face = FaceId(if self.face.is_empty() { slot / 3 } else { self.face[slot as usize] });
        let range = t.corner_range(face);
        let c = slot as usize;
        let beside = if t.origin(t.corners[c]) == v {
            if c == range.start { range.end - 1 } else { c - 1 }
        } else if c + 1 == range.end {
            range.start
        } else {
            c + 1
        };
        beside as u32
    }
}

#[cfg(test)]
mod tests;
