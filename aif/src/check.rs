//! Verifying the invariants of a mesh.

use crate::bits::Bits;
use crate::ids::{EdgeId, FaceId, NONE, VertexId};
use crate::mesh::Mesh;
use crate::topology::{COMPLEX, Topology};

/// The first broken invariant that [`Mesh::check`] found, with its element.
///
/// A mesh that was built and edited through this crate never has one; a mesh whose public parts (positions, wedges) were changed
/// by hand can.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CheckError {
    /// The set of removed elements counts wrongly or names elements that do not exist.
    #[error(
        "the set of removed {0} is inconsistent: its count is wrong or it names a slot that does not exist"
    )]
    DeadSet(&'static str),
    /// Triangular layout, but the corner slots are no multiple of three.
    #[error("{corners} corner slots in the triangular layout: no multiple of three")]
    TriangularLayout {
        /// Number of corner slots.
        corners: usize,
    },
    /// A live vertex's star is longer than its capacity or runs past the end of the pool.
    #[error("vertex {0}: its star does not fit its capacity or the pool")]
    StarSpan(VertexId),
    /// The stars of two live vertices share slots of the pool.
    #[error("vertex {0}: its star overlaps the star of another vertex")]
    StarOverlap(VertexId),
    /// A live face's corners run past the end of the corner slots.
    #[error("face {0}: its corners run past the end of the corner slots")]
    FaceSpan(FaceId),
    /// Two live faces share corner slots.
    #[error("face {0}: its corners overlap those of another face")]
    FaceOverlap(FaceId),
    /// A live edge names a vertex that does not exist.
    #[error("edge {edge}: vertex {vertex} is out of range")]
    EdgeVertexRange {
        /// The edge.
        edge: EdgeId,
        /// The vertex.
        vertex: VertexId,
    },
    /// A live edge names a removed vertex.
    #[error("edge {edge}: vertex {vertex} was removed")]
    EdgeVertexDead {
        /// The edge.
        edge: EdgeId,
        /// The vertex.
        vertex: VertexId,
    },
    /// Both ends of a live edge are one vertex.
    #[error("edge {0}: both ends are one vertex")]
    Loop(EdgeId),
    /// A live vertex's star names an edge that does not exist.
    #[error("vertex {vertex}: edge {edge} of its star is out of range")]
    StarRange {
        /// The vertex.
        vertex: VertexId,
        /// The edge.
        edge: EdgeId,
    },
    /// A live vertex's star names a removed edge.
    #[error("vertex {vertex}: edge {edge} of its star was removed")]
    StarDead {
        /// The vertex.
        vertex: VertexId,
        /// The edge.
        edge: EdgeId,
    },
    /// A live vertex's star names an edge that does not end there.
    #[error("vertex {vertex}: edge {edge} of its star does not end there")]
    StarForeign {
        /// The vertex.
        vertex: VertexId,
        /// The edge.
        edge: EdgeId,
    },
    /// A live vertex's star names an edge twice.
    #[error("vertex {vertex}: edge {edge} is in its star twice")]
    StarTwice {
        /// The vertex.
        vertex: VertexId,
        /// The edge.
        edge: EdgeId,
    },
    /// A live edge is missing from the star of one of its ends.
    #[error("edge {edge} is missing from the star of vertex {vertex}")]
    StarMissing {
        /// The edge.
        edge: EdgeId,
        /// The vertex.
        vertex: VertexId,
    },
    /// Two live edges join the same two vertices.
    #[error("edges {0} and {1} join the same two vertices")]
    ParallelEdges(EdgeId, EdgeId),
    /// A live face has fewer than three corners.
    #[error("face {face} has {corners} corners; it takes three")]
    FaceSize {
        /// The face.
        face: FaceId,
        /// Its number of corners.
        corners: usize,
    },
    /// A live face uses an edge that does not exist.
    #[error("face {face}: edge {edge} is out of range")]
    FaceEdgeRange {
        /// The face.
        face: FaceId,
        /// The edge.
        edge: EdgeId,
    },
    /// A live face uses a removed edge.
    #[error("face {face}: edge {edge} was removed")]
    FaceEdgeDead {
        /// The face.
        face: FaceId,
        /// The edge.
        edge: EdgeId,
    },
    /// Two consecutive edges of a live face do not meet, in the directions it uses them.
    #[error("face {face}: the edge of corner {corner} does not end where the next begins")]
    FaceOpen {
        /// The face.
        face: FaceId,
        /// The corner within the face, from 0.
        corner: usize,
    },
    /// A live face visits a vertex twice.
    #[error("face {face} visits vertex {vertex} twice")]
    FaceRepeats {
        /// The face.
        face: FaceId,
        /// The vertex.
        vertex: VertexId,
    },
    /// A live edge's list in the overflow pool does not exist or runs past its end.
    #[error("edge {0}: its list of faces is outside the overflow pool")]
    ComplexSpan(EdgeId),
    /// The lists of two live edges share slots of the overflow pool.
    #[error("edge {0}: its list of faces overlaps that of another edge")]
    ComplexOverlap(EdgeId),
    /// A live edge names a face that does not exist.
    #[error("edge {edge}: face {face} is out of range")]
    EdgeFaceRange {
        /// The edge.
        edge: EdgeId,
        /// The face.
        face: FaceId,
    },
    /// A live edge names a removed face.
    #[error("edge {edge}: face {face} was removed")]
    EdgeFaceDead {
        /// The edge.
        edge: EdgeId,
        /// The face.
        face: FaceId,
    },
    /// A live edge names a face twice.
    #[error("edge {edge} has face {face} twice")]
    EdgeFaceTwice {
        /// The edge.
        edge: EdgeId,
        /// The face.
        face: FaceId,
    },
    /// A live edge names a face that does not use it.
    #[error("edge {edge} has face {face}, which does not use it")]
    EdgeFaceForeign {
        /// The edge.
        edge: EdgeId,
        /// The face.
        face: FaceId,
    },
    /// A live face uses an edge that does not name it.
    #[error("edge {edge} lacks face {face}, which uses it")]
    EdgeFaceMissing {
        /// The edge.
        edge: EdgeId,
        /// The face.
        face: FaceId,
    },
    /// An array that runs parallel to the elements has another length.
    #[error("{array} has {len} entries, {want} are needed")]
    Length {
        /// Which array.
        array: &'static str,
        /// Its length.
        len: usize,
        /// The length needed.
        want: usize,
    },
    /// A live vertex's position is NaN or infinite.
    #[error("vertex {0}: its position is not finite")]
    NotFinite(VertexId),
    /// A corner slot names a wedge that does not exist.
    #[error("corner slot {corner}: wedge {wedge} is out of range")]
    WedgeRange {
        /// The corner slot.
        corner: usize,
        /// The wedge.
        wedge: u32,
    },
}

impl Mesh {
    /// Verifies every invariant of the mesh: those of [`Topology::check`]; one position for each vertex slot, finite on live
    /// vertices; one existing wedge (or none) for each corner slot; materials and groups for all face slots or for none.
    ///
    /// The error names the first invariant found broken and its element. O(n) for n relations, O(n log n) at complex edges.
    pub fn check(&self) -> Result<(), CheckError> {
        let t = &self.topology;
        t.check()?;
        let lengths = [
            ("positions", self.positions.len(), t.vertex_slots(), false),
            (
                "wedges.corner",
                self.wedges.as_ref().map_or(0, |w| w.corner.len()),
                t.corner_slots(),
                self.wedges.is_none(),
            ),
            ("face materials", self.face_material.len(), t.face_slots(), self.face_material.is_empty()),
            ("face groups", self.face_group.len(), t.face_slots(), self.face_group.is_empty()),
            ("face rows", self.face_row.len(), t.face_slots(), self.face_row.is_empty()),
        ];
        for (array, len, want, absent) in lengths {
            if len != want && !absent {
                return Err(CheckError::Length { array, len, want });
            }
        }
        if let Some(v) = t.vertices().find(|&v| !self.position(v).is_finite()) {
            return Err(CheckError::NotFinite(v));
        }
        if let Some(w) = &self.wedges
            && let Some(corner) = w.corner.iter().position(|&x| x != NONE && x as usize >= w.len())
        {
            return Err(CheckError::WedgeRange { corner, wedge: w.corner[corner] });
        }
        Ok(())
    }
}

impl Topology {
    /// Verifies every invariant of the relations.
    ///
    /// * Storage: runs lie inside their pools and those of live elements do not overlap; the sets of removed elements count right.
    /// * A live edge has two distinct live vertices; it is in the star of each exactly once, and no star holds anything else; no two
    ///   live edges join the same vertices.
    /// * A live face is a closed cycle of three or more live edges whose directions chain, and visits no vertex twice.
    /// * A live edge names exactly the live faces that use it, each once.
    ///
    /// The error names the first invariant found broken and its element. O(n) for n relations, O(n log n) at complex edges.
    pub fn check(&self) -> Result<(), CheckError> {
        self.check_storage()?;
        self.check_edges_and_stars()?;
        self.check_faces()?;
        self.check_faces_of_edges()
    }

    fn check_storage(&self) -> Result<(), CheckError> {
        if self.face_spans.is_empty() && !self.corners.len().is_multiple_of(3) {
            return Err(CheckError::TriangularLayout { corners: self.corners.len() });
        }
        let sets = [
            ("vertices", &self.dead_vertices, self.vertex_slots()),
            ("edges", &self.dead_edges, self.edge_slots()),
            ("faces", &self.dead_faces, self.face_slots()),
        ];
        for (name, set, slots) in sets {
            if !set.is_consistent(slots) {
                return Err(CheckError::DeadSet(name));
            }
        }
        let mut taken = Bits::new(self.star_pool.len());
        for v in self.vertices() {
            let s = self.stars[v.index()];
            if s.span.len > s.capacity || s.span.start as usize + s.capacity as usize > self.star_pool.len() {
                return Err(CheckError::StarSpan(v));
            }
            let start = s.span.start as usize;
            if !take(&mut taken, start..start + s.capacity as usize) {
                return Err(CheckError::StarOverlap(v));
            }
        }
        if !self.face_spans.is_empty() {
            let mut taken = Bits::new(self.corners.len());
            for f in self.faces() {
                let s = self.face_spans[f.index()];
                if s.start as usize + s.len as usize > self.corners.len() {
                    return Err(CheckError::FaceSpan(f));
                }
                if !take(&mut taken, s.range()) {
                    return Err(CheckError::FaceOverlap(f));
                }
            }
        }
        let mut taken = Bits::new(self.complex_pool.len());
        for e in self.edges() {
            let faces = self.edges[e.index()].faces;
            if faces[1] != COMPLEX {
                continue;
            }
            let span = self.complex.get(faces[0].index()).copied();
            let fits =
                |s: &crate::topology::Span| s.start as usize + s.len as usize <= self.complex_pool.len();
            let Some(span) = span.filter(fits) else { return Err(CheckError::ComplexSpan(e)) };
            if !take(&mut taken, span.range()) {
                return Err(CheckError::ComplexOverlap(e));
            }
        }
        Ok(())
    }

    fn check_edges_and_stars(&self) -> Result<(), CheckError> {
        for edge in self.edges() {
            let [a, b] = self.edge_vertices(edge);
            for vertex in [a, b] {
                if vertex.index() >= self.vertex_slots() {
                    return Err(CheckError::EdgeVertexRange { edge, vertex });
                }
                if !self.has_vertex(vertex) {
                    return Err(CheckError::EdgeVertexDead { edge, vertex });
                }
            }
            if a == b {
                return Err(CheckError::Loop(edge));
            }
        }
        // seen[2e + i]: edge e was found in the star of its vertex i. joined[u] = (v, e): e joins u to v, the last vertex looked at.
        let mut seen = Bits::new(2 * self.edge_slots());
        let mut joined = vec![(VertexId(NONE), EdgeId(0)); self.vertex_slots()];
        for vertex in self.vertices() {
            for &edge in self.star(vertex) {
                if edge.index() >= self.edge_slots() {
                    return Err(CheckError::StarRange { vertex, edge });
                }
                if !self.has_edge(edge) {
                    return Err(CheckError::StarDead { vertex, edge });
                }
                let ends = self.edge_vertices(edge);
                let Some(end) = ends.iter().position(|&v| v == vertex) else {
                    return Err(CheckError::StarForeign { vertex, edge });
                };
                if seen.get(2 * edge.index() + end) {
                    return Err(CheckError::StarTwice { vertex, edge });
                }
                seen.set(2 * edge.index() + end);
                let (by, first) = joined[ends[end ^ 1].index()];
                if by == vertex {
                    return Err(CheckError::ParallelEdges(first, edge));
                }
                joined[ends[end ^ 1].index()] = (vertex, edge);
            }
        }
        for edge in self.edges() {
            for (end, vertex) in self.edge_vertices(edge).into_iter().enumerate() {
                if !seen.get(2 * edge.index() + end) {
                    return Err(CheckError::StarMissing { edge, vertex });
                }
            }
        }
        Ok(())
    }

    fn check_faces(&self) -> Result<(), CheckError> {
        let mut visited_by = vec![NONE; self.vertex_slots()];
        for face in self.faces() {
            let uses = self.face_edges(face);
            if uses.len() < 3 {
                return Err(CheckError::FaceSize { face, corners: uses.len() });
            }
            for u in uses {
                let edge = u.edge();
                if edge.index() >= self.edge_slots() {
                    return Err(CheckError::FaceEdgeRange { face, edge });
                }
                if !self.has_edge(edge) {
                    return Err(CheckError::FaceEdgeDead { face, edge });
                }
            }
            for (corner, &u) in uses.iter().enumerate() {
                if self.target(u) != self.origin(uses[(corner + 1) % uses.len()]) {
                    return Err(CheckError::FaceOpen { face, corner });
                }
                let vertex = self.origin(u);
                if std::mem::replace(&mut visited_by[vertex.index()], face.0) == face.0 {
                    return Err(CheckError::FaceRepeats { face, vertex });
                }
            }
        }
        Ok(())
    }

    fn check_faces_of_edges(&self) -> Result<(), CheckError> {
        // The faces that use each edge, ascending, to compare with what the edges say.
        let mut end = vec![0u32; self.edge_slots() + 1];
        for f in self.faces() {
            for u in self.face_edges(f) {
                end[u.edge().index() + 1] += 1;
            }
        }
        for e in 0..self.edge_slots() {
            end[e + 1] += end[e];
        }
        let mut users = vec![FaceId(NONE); end[self.edge_slots()] as usize];
        for f in self.faces() {
            for u in self.face_edges(f) {
                let at = &mut end[u.edge().index()];
                users[*at as usize] = f;
                *at += 1;
            }
        }
        let mut sorted = Vec::new();
        let mut begin = 0;
        for (e, &end) in end[..self.edge_slots()].iter().enumerate() {
            let edge = EdgeId(e as u32);
            let want = &users[begin..end as usize];
            begin = end as usize;
            if !self.has_edge(edge) {
                continue;
            }
            sorted.clear();
            sorted.extend_from_slice(self.edge_faces(edge));
            sorted.sort_unstable();
            if sorted == want {
                continue;
            }
            for (i, &face) in sorted.iter().enumerate() {
                if face.index() >= self.face_slots() {
                    return Err(CheckError::EdgeFaceRange { edge, face });
                }
                if !self.has_face(face) {
                    return Err(CheckError::EdgeFaceDead { edge, face });
                }
                if i > 0 && sorted[i - 1] == face {
                    return Err(CheckError::EdgeFaceTwice { edge, face });
                }
                if want.binary_search(&face).is_err() {
                    return Err(CheckError::EdgeFaceForeign { edge, face });
                }
            }
            if let Some(&face) = want.iter().find(|f| sorted.binary_search(f).is_err()) {
                return Err(CheckError::EdgeFaceMissing { edge, face });
            }
        }
        Ok(())
    }
}

/// Sets the bits of `range`; false if one was set already.
fn take(taken: &mut Bits, range: std::ops::Range<usize>) -> bool {
    for i in range {
        if taken.get(i) {
            return false;
        }
        taken.set(i);
    }
    true
}

#[cfg(test)]
mod tests;
