//! Edge collapse, and vertex split as its exact inverse.
//!
//! ```text
//!        c                 c            e = ab collapses onto a. The triangle abc vanishes, its edge bc
//!      / | \              / \           merges into ac; the other faces of b keep their ids and edges,
//!     /f |  \            /   \          only the end b of those edges becomes a. A larger polygon on e
//!    /   |   \          /     \         loses e and stays.
//!   a---(e)---b   ->   a       .
//!    \   |   /          \     /
//!      \ | /              \ /
//!        d                 d
//! ```
//!
//! What dies keeps its old relations in place, so that a record of fixed size is enough to undo the collapse
//! exactly: ids, the order of every list, positions. Records are undone last in, first out.

use crate::ids::{EdgeId, FaceId, VertexId};
use crate::mesh::Mesh;
use crate::topology::{COMPLEX, EdgeUse, NO_FACE, Topology};
use glam::DVec3;

/// Scratch marks on vertices, reused from call to call.
#[derive(Clone, Debug, Default)]
pub struct Marks {
    stamp: Vec<u32>,
    epoch: u32,
}

impl Marks {
    /// Forgets all marks, and makes room for `n` vertices. O(1) but for growth.
    #[inline]
    pub fn clear(&mut self, n: usize) {
        if self.stamp.len() < n {
            self.stamp.resize(n, 0);
        }
        if self.epoch == u32::MAX {
            self.stamp.fill(0);
            self.epoch = 0;
        }
        self.epoch += 1;
    }

    /// Marks `v`.
    #[inline]
    pub fn set(&mut self, v: VertexId) {
        self.stamp[v.index()] = self.epoch;
    }

    /// True if `v` is marked.
    #[inline]
    pub fn has(&self, v: VertexId) -> bool {
        self.stamp[v.index()] == self.epoch
    }
}

/// Why an edge may not be collapsed: topology would change, or the result be no mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LinkViolation {
    /// The edge has three or more faces.
    #[error("the edge has three or more faces")]
    ComplexEdge,
    /// The vertex to remove is not regular: its faces form no single fan, or it has dangling edges.
    #[error("the vertex to remove is not regular")]
    SingularVertex,
    /// Both vertices lie on a border, the edge does not: the border would be pinched.
    #[error("the edge joins two borders")]
    Border,
    /// The vertices have a common neighbour that is not the tip of a triangle on the edge.
    #[error("the vertices have a common neighbour beside the triangles on the edge")]
    CommonNeighbour,
    /// A face has both vertices, but not the edge.
    #[error("a face has both vertices, but not the edge")]
    CommonFace,
    /// Two faces would fall together, as in a tetrahedron.
    #[error("two faces would fall together")]
    Fold,
    /// The last face of the component would vanish.
    #[error("the component would vanish")]
    LastFace,
}

/// One face on a collapsed edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wing {
    /// The face: removed if it was a triangle, else shortened.
    pub face: FaceId,
    /// Where the collapsed edge stood in the face.
    pub slot: u32,
    /// The triangle's edge that stays; unused (the collapsed edge) for a larger polygon.
    pub kept_edge: EdgeId,
    /// The triangle's edge that merged into it; the collapsed edge for a larger polygon.
    pub removed_edge: EdgeId,
    /// Where `removed_edge` stood in the star of the tip.
    star_index: u32,
    /// The faces of `kept_edge` before.
    faces: [FaceId; 2],
}

/// What an edge collapse did: enough for [`Topology::split`] to undo it exactly. 68 bytes, flat.
///
/// Valid until the mesh is compacted, and only after the collapses that came later have been undone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CollapseRecord {
    /// The collapsed edge.
    pub edge: EdgeId,
    /// The vertex that stays.
    pub kept: VertexId,
    /// The vertex that is gone.
    pub removed: VertexId,
    star_index: u32,
    wings: [Option<Wing>; 2],
}

impl CollapseRecord {
    /// The faces that were on the edge, at most two.
    pub fn wings(&self) -> impl Iterator<Item = &Wing> {
        self.wings.iter().flatten()
    }
}

/// A collapse of a mesh: its topology and the position it overwrote.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collapse {
    /// What happened to the topology.
    pub record: CollapseRecord,
    /// Where the kept vertex was.
    pub old_position: DVec3,
}

impl Topology {
    /// True if the faces of `v` form one fan (closed, or open at a border) and no edge of it dangles.
    /// An isolated vertex is not regular. O(valence).
    pub fn is_regular(&self, v: VertexId) -> bool {
        let star = self.star(v);
        let Some(&start) = star.iter().find(|&&e| self.edge_faces(e).len() == 1).or(star.first()) else {
            return false;
        };
        if star.iter().any(|&e| !(1..=2).contains(&self.edge_faces(e).len())) {
            return false;
        }
        // Walk from the border, or from any edge of a closed fan, and see whether all edges are met.
        let (mut e, mut from, mut met) = (start, NO_FACE, 0);
        loop {
            met += 1;
            let Some(&f) = self.edge_faces(e).iter().find(|&&f| f != from) else { break };
            let Some(next) = self.next_around(v, f, e) else { return false };
            (e, from) = (next, f);
            if e == start || met > star.len() {
                break;
            }
        }
        met == star.len()
    }

    /// The other edge of `f` at `v` than `e`.
    #[inline]
    fn next_around(&self, v: VertexId, f: FaceId, e: EdgeId) -> Option<EdgeId> {
        self.face_edges(f).iter().map(|u| u.edge()).find(|&x| {
            let [a, b] = self.edges[x.index()].vertices;
            x != e && (a == v || b == v)
        })
    }

    /// Whether `e` may be collapsed onto `kept`: the result is a mesh of the same topology (Dey et al. 1999, with a
    /// virtual vertex joined to every border). `kept` may be singular, the other vertex must be regular, or `e` a free
    /// dangling edge. O(valence).
    pub fn link_condition(&self, e: EdgeId, kept: VertexId, marks: &mut Marks) -> Result<(), LinkViolation> {
        let removed = self.other(e, kept);
        if self.edge_faces(e).is_empty() {
            // A polyline: any vertex of at most two dangling edges may go.
            if self.star(removed).len() > 2
                || self.star(removed).iter().any(|&x| !self.edge_faces(x).is_empty())
            {
                return Err(LinkViolation::SingularVertex);
            }
        } else if !self.is_regular(removed) {
            return Err(LinkViolation::SingularVertex);
        }
        self.link_condition_of_regular(e, kept, marks)
    }

    /// [`Topology::link_condition`] for a vertex to remove that is known to be regular. O(valence).
    pub fn link_condition_of_regular(
        &self,
        e: EdgeId,
        kept: VertexId,
        marks: &mut Marks,
    ) -> Result<(), LinkViolation> {
        let removed = self.other(e, kept);
        let faces = self.edge_faces(e);
        if faces.len() > 2 {
            return Err(LinkViolation::ComplexEdge);
        }
        marks.clear(self.stars.len());
        let mut kept_on_border = false;
        for &x in self.star(kept) {
            marks.set(self.other(x, kept));
            kept_on_border |= self.edge_faces(x).len() != 2;
        }
        let (mut common, mut removed_on_border) = (0, false);
        for &x in self.star(removed) {
            common += marks.has(self.other(x, removed)) as usize;
            removed_on_border |= self.edge_faces(x).len() != 2;
        }
        if faces.len() == 2 && kept_on_border && removed_on_border {
            return Err(LinkViolation::Border);
        }
        let triangles = faces.iter().filter(|&&f| self.corner_range(f).len() == 3).count();
        if common != triangles {
            return Err(LinkViolation::CommonNeighbour);
        }
        if !self.is_triangular() {
            let both = |f: FaceId| {
                self.corner_range(f).len() > 3
                    && !faces.contains(&f)
                    && self.face_vertices(f).any(|v| v == kept)
            };
            if self.vertex_faces(removed).any(both) {
                return Err(LinkViolation::CommonFace);
            }
        }
        // Across the sides of the triangles on the edge.
        let mut across = [[NO_FACE; 2]; 2];
        for (i, &f) in faces.iter().enumerate().filter(|&(_, &f)| self.corner_range(f).len() == 3) {
            let (ka, kb) = self.sides(f, e, kept);
            let other = |x: EdgeId| self.edge_faces(x).iter().copied().find(|&g| g != f).unwrap_or(NO_FACE);
            across[i] = [other(ka), other(kb)];
            if across[i] == [NO_FACE; 2] {
                return Err(LinkViolation::LastFace);
            }
            if self.edge_faces(ka).len() > 2 && across[i][1] == NO_FACE {
                return Err(LinkViolation::SingularVertex);
            }
        }
        let same = |k: usize| across[0][k] != NO_FACE && across[0][k] == across[1][k];
        // Both vertices have but one face beside the two on the edge, and those two would fall together.
        if same(1) && (same(0) || self.meet(across[0][0], across[1][0], faces, e, kept)) {
            return Err(LinkViolation::Fold);
        }
        Ok(())
    }

    /// For a singular kept vertex, whose sides may have several faces across: whether a face lies across both sides.
    fn meet(&self, first: FaceId, second: FaceId, faces: &[FaceId], e: EdgeId, kept: VertexId) -> bool {
        if first == NO_FACE || second == NO_FACE || faces.len() != 2 {
            return false;
        }
        let (s, t) = (self.sides(faces[0], e, kept).0, self.sides(faces[1], e, kept).0);
        self.edge_faces(s).iter().any(|f| self.edge_faces(t).contains(f))
    }

    /// The sides of triangle `f` on `e`: the edge at `kept`, and the edge at the other vertex.
    #[inline]
    fn sides(&self, f: FaceId, e: EdgeId, kept: VertexId) -> (EdgeId, EdgeId) {
        let u = self.face_edges(f);
        let i = if u[0].edge() == e {
            0
        } else if u[1].edge() == e {
            1
        } else {
            2
        };
        let (next, last) = (u[(i + 1) % 3].edge(), u[(i + 2) % 3].edge());
        if self.target(u[i]) == kept { (next, last) } else { (last, next) }
    }

    /// Collapses `e` onto its vertex `kept`. The caller has checked [`Topology::link_condition`]. O(valence).
    pub fn collapse(&mut self, e: EdgeId, kept: VertexId) -> CollapseRecord {
        debug_assert!(self.has_edge(e));
        let removed = self.other(e, kept);
        let mut record = CollapseRecord { edge: e, kept, removed, star_index: 0, wings: [None; 2] };
        let on_edge = self.edges[e.index()].faces;
        for (wing, f) in record.wings.iter_mut().zip(on_edge) {
            if f != NO_FACE {
                *wing = Some(self.fold_wing(f, e, kept));
            }
        }

        // The star of `removed` joins that of `kept`, without the edges that are gone.
        let old = self.stars[removed.index()].span;
        let star = self.stars[kept.index()];
        let range = star.span.range();
        let at = self.star_pool[range.clone()].iter().position(|&x| x == e).unwrap_or(0);
        record.star_index = at as u32;
        let upper = star.span.len + old.len - 2;
        let mut start = star.span.start as usize;
        if upper > star.capacity {
            let capacity = (upper + upper / 4).next_multiple_of(4);
            start = self.star_pool.len();
            self.star_pool.resize(start + capacity as usize, EdgeId(0));
            self.star_pool.copy_within(range.start..range.start + at, start);
            self.star_pool.copy_within(range.start + at + 1..range.end, start + at);
            self.stars[kept.index()].capacity = capacity;
            self.stars[kept.index()].span.start = start as u32;
        } else {
            self.star_pool.copy_within(range.start + at + 1..range.end, range.start + at);
        }
        let mut end = start + star.span.len as usize - 1;
        for i in old.range() {
            let x = self.star_pool[i];
            if x == e || self.dead_edges.get(x.index()) {
                continue;
            }
            self.star_pool[end] = x;
            end += 1;
            let vertices = &mut self.edges[x.index()].vertices;
            vertices[(vertices[1] == removed) as usize] = kept;
        }
        self.stars[kept.index()].span.len = (end - start) as u32;
        self.dead_edges.set(e.index());
        self.dead_vertices.set(removed.index());
        record
    }

    /// Takes `e` out of face `f`: a triangle vanishes, a larger polygon gets one corner less.
    fn fold_wing(&mut self, f: FaceId, e: EdgeId, kept: VertexId) -> Wing {
        let range = self.corner_range(f);
        let slot = self.corners[range.clone()].iter().position(|u| u.edge() == e).unwrap_or(0);
        if range.len() > 3 {
            self.corners[range.start + slot..range.end].rotate_left(1);
            self.face_spans[f.index()].len -= 1;
            return Wing {
                face: f,
                slot: slot as u32,
                kept_edge: e,
                removed_edge: e,
                star_index: 0,
                faces: [NO_FACE; 2],
            };
        }
        let (ac, bc) = self.sides(f, e, kept);
        let tip = self.other(ac, kept);
        let wing_faces = self.edges[ac.index()].faces;
        let other = self.edge_faces(bc).iter().copied().find(|&g| g != f);
        self.replace_face(ac, f, other);
        if let Some(g) = other {
            self.replace_edge(g, bc, ac, tip);
        }
        let span = self.stars[tip.index()].span;
        let star = &mut self.star_pool[span.range()];
        let star_index = star.iter().position(|&x| x == bc).unwrap_or(0);
        star.copy_within(star_index + 1.., star_index);
        self.stars[tip.index()].span.len -= 1;
        self.dead_edges.set(bc.index());
        self.dead_faces.set(f.index());
        Wing {
            face: f,
            slot: slot as u32,
            kept_edge: ac,
            removed_edge: bc,
            star_index: star_index as u32,
            faces: wing_faces,
        }
    }

    /// Puts `to` in the place of `from` among the faces of `e`, or closes the gap.
    fn replace_face(&mut self, e: EdgeId, from: FaceId, to: Option<FaceId>) {
        let faces = &mut self.edges[e.index()].faces;
        if faces[1] == COMPLEX {
            let list = self.complex[faces[0].index()].range();
            if let Some(slot) = self.complex_pool[list].iter_mut().find(|f| **f == from) {
                *slot = to.unwrap_or(NO_FACE);
            }
            return;
        }
        let slot = (faces[1] == from) as usize;
        match to {
            Some(g) => faces[slot] = g,
            None => *faces = [faces[slot ^ 1], NO_FACE],
        }
    }

    /// Puts edge `to` in the place of `from` in face `g`; both end at `tip`.
    fn replace_edge(&mut self, g: FaceId, from: EdgeId, to: EdgeId, tip: VertexId) {
        let range = self.corner_range(g);
        if let Some(i) = range.clone().find(|&i| self.corners[i].edge() == from) {
            let begins_at_tip = self.origin(self.corners[i]) == tip;
            let reversed = (self.edges[to.index()].vertices[1] == tip) == begins_at_tip;
            self.corners[i] = EdgeUse::new(to, reversed);
        }
    }

    /// Undoes a collapse exactly. It must be the last one that has not been undone yet. O(valence).
    pub fn split(&mut self, record: &CollapseRecord) {
        let CollapseRecord { edge: e, kept, removed, star_index, wings } = *record;
        debug_assert!(!self.has_vertex(removed) && self.has_vertex(kept));
        // Give the edges back to `removed`: all of its old star but `e` and those that had merged.
        let mut given = 0;
        for i in self.stars[removed.index()].span.range() {
            let x = self.star_pool[i];
            if x != e && !self.dead_edges.get(x.index()) {
                let vertices = &mut self.edges[x.index()].vertices;
                vertices[(vertices[1] == kept) as usize] = removed;
                given += 1;
            }
        }
        let span = &mut self.stars[kept.index()].span;
        span.len = span.len - given + 1;
        let range = span.range();
        let star = &mut self.star_pool[range];
        let at = star_index as usize;
        star.copy_within(at..star.len() - 1, at + 1);
        star[at] = e;
        self.dead_edges.clear(e.index());
        self.dead_vertices.clear(removed.index());
        for wing in wings.iter().rev().flatten() {
            self.unfold_wing(wing, e, kept);
        }
    }

    fn unfold_wing(&mut self, wing: &Wing, e: EdgeId, kept: VertexId) {
        let f = wing.face;
        if wing.removed_edge == e {
            let span = &mut self.face_spans[f.index()];
            span.len += 1;
            let range = span.range();
            self.corners[range.start + wing.slot as usize..range.end].rotate_right(1);
            return;
        }
        let (ac, bc) = (wing.kept_edge, wing.removed_edge);
        let tip = self.other(ac, kept);
        let other = self.edge_faces(bc).iter().copied().find(|&g| g != f);
        if wing.faces[1] == COMPLEX {
            if let Some(g) = other {
                self.replace_face(ac, g, Some(f));
            }
        } else {
            self.edges[ac.index()].faces = wing.faces;
        }
        if let Some(g) = other {
            self.replace_edge(g, ac, bc, tip);
        }
        let span = &mut self.stars[tip.index()].span;
        span.len += 1;
        let range = span.range();
        let star = &mut self.star_pool[range];
        let at = wing.star_index as usize;
        star.copy_within(at..star.len() - 1, at + 1);
        star[at] = bc;
        self.dead_edges.clear(bc.index());
        self.dead_faces.clear(f.index());
    }
}

impl Mesh {
    /// Collapses edge `e` onto its vertex `kept`, which moves to `to` (rounded to the stored precision).
    ///
    /// Refuses what the link condition forbids and leaves the mesh untouched then. Corners of surviving faces keep their wedges.
    /// O(valence).
    pub fn collapse_edge(
        &mut self,
        e: EdgeId,
        kept: VertexId,
        to: DVec3,
        marks: &mut Marks,
    ) -> Result<Collapse, LinkViolation> {
        self.topology.link_condition(e, kept, marks)?;
        let old_position = self.position(kept);
        let record = self.collapse_unchecked(e, kept);
        self.positions.set(kept.index(), to);
        Ok(Collapse { record, old_position })
    }

    /// Collapses edge `e` onto its vertex `kept`, which stays where it is. The caller has checked [`Topology::link_condition`].
    /// Corners of surviving faces keep their wedges. O(valence).
    pub fn collapse_unchecked(&mut self, e: EdgeId, kept: VertexId) -> CollapseRecord {
        let record = self.topology.collapse(e, kept);
        if let Some(w) = &mut self.wedges {
            for wing in record.wings().filter(|w| w.removed_edge == e) {
                // The corner that left the polygon waits behind its last one, as its edge does.
                let range = self.topology.corner_range(wing.face);
                w.corner[range.start + wing.slot as usize..=range.end].rotate_left(1);
            }
        }
        record
    }

    /// Undoes a collapse exactly: ids, the order of every list, positions, corners. It must be the last that has not been undone.
    /// O(valence).
    pub fn split_vertex(&mut self, collapse: &Collapse) {
        let record = &collapse.record;
        self.topology.split(record);
        if let Some(w) = &mut self.wedges {
            for wing in record.wings().filter(|w| w.removed_edge == record.edge) {
                let range = self.topology.corner_range(wing.face);
                w.corner[range.start + wing.slot as usize..range.end].rotate_right(1);
            }
        }
        self.positions.set(record.kept.index(), collapse.old_position);
    }
}
