//! Storage of the AIF relations, and nothing else: which edges meet at a vertex, which vertices and faces an edge has,
//! which edges bound a face, in cyclic order.
//!
//! | relation | storage | bytes a face, closed triangles |
//! |---|---|---|
//! | edge -> 2 vertices, up to 2 faces | 16 B an edge | 24 |
//! | face -> edges | 4 B a corner (edge and direction) | 12 |
//! | vertex -> edges | 4 B an entry in one pool, 12 B span | 12 + 6 |
//! | which elements are live | 1 bit each | 0.4 |
//!
//! Edges of three and more faces keep their faces in an overflow pool; faces that are not triangles need 8 B more for
//! their span. Removed elements stay in place with their old relations until [`crate::Mesh::compact`], which
//! is what makes a vertex split exact and cheap.

use crate::bits::Bits;
use crate::ids::{EdgeId, FaceId, NONE, VertexId};

/// An edge as a face uses it: which edge, and in which direction.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct EdgeUse(pub u32);

impl EdgeUse {
    /// Edge `e`, from its first vertex to its second, or the other way when `reversed`.
    #[inline]
    pub fn new(e: EdgeId, reversed: bool) -> Self {
        EdgeUse(e.0 << 1 | reversed as u32)
    }

    /// The edge.
    #[inline]
    pub fn edge(self) -> EdgeId {
        EdgeId(self.0 >> 1)
    }

    /// 0 if the face runs from the edge's first vertex to its second, 1 if the other way.
    #[inline]
    pub fn side(self) -> usize {
        (self.0 & 1) as usize
    }
}

impl std::fmt::Debug for EdgeUse {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}e{}", if self.side() == 1 { "-" } else { "+" }, self.0 >> 1)
    }
}

/// A run of a pool.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) start: u32,
    pub(crate) len: u32,
}

impl Span {
    #[inline]
    pub(crate) fn range(self) -> std::ops::Range<usize> {
        self.start as usize..(self.start + self.len) as usize
    }
}

/// Marks in `faces[1]` that an edge's faces are in the overflow pool, at list `faces[0]`.
pub(crate) const COMPLEX: FaceId = FaceId(u32::MAX - 1);
/// "No face".
pub(crate) const NO_FACE: FaceId = FaceId(NONE);

/// An edge: its two vertices and its first two faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EdgeRecord {
    pub(crate) vertices: [VertexId; 2],
    pub(crate) faces: [FaceId; 2],
}

/// A vertex's run in the pool of stars, and how far it may grow in place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Star {
    pub(crate) span: Span,
    pub(crate) capacity: u32,
}

/// The AIF relations of a mesh.
///
/// Vertices, edges and faces have dense ids `0..n`; those removed by an edge collapse keep theirs and are
/// skipped by the iterators.
#[derive(Clone, Debug, Default)]
pub struct Topology {
    pub(crate) stars: Vec<Star>,
    pub(crate) star_pool: Vec<EdgeId>,
    pub(crate) edges: Vec<EdgeRecord>,
    pub(crate) corners: Vec<EdgeUse>,
    /// Empty when every face was built as a triangle: face `f` is then corner slots `3f..3f+3`.
    pub(crate) face_spans: Vec<Span>,
    pub(crate) complex: Vec<Span>,
    pub(crate) complex_pool: Vec<FaceId>,
    pub(crate) dead_vertices: Bits,
    pub(crate) dead_edges: Bits,
    pub(crate) dead_faces: Bits,
}

impl Topology {
    /// Vertex ids run below this, removed ones included.
    #[inline]
    pub fn vertex_slots(&self) -> usize {
        self.stars.len()
    }

    /// Edge ids run below this, removed ones included.
    #[inline]
    pub fn edge_slots(&self) -> usize {
        self.edges.len()
    }

    /// Face ids run below this, removed ones included.
    #[inline]
    pub fn face_slots(&self) -> usize {
        if self.face_spans.is_empty() { self.corners.len() / 3 } else { self.face_spans.len() }
    }

    /// Corner slots run below this; see [`Topology::corner_range`].
    #[inline]
    pub fn corner_slots(&self) -> usize {
        self.corners.len()
    }

    /// Number of live vertices, isolated ones included.
    pub fn vertex_count(&self) -> usize {
        self.vertex_slots() - self.dead_vertices.count()
    }

    /// Number of live edges.
    pub fn edge_count(&self) -> usize {
        self.edge_slots() - self.dead_edges.count()
    }

    /// Number of live faces.
    pub fn face_count(&self) -> usize {
        self.face_slots() - self.dead_faces.count()
    }

    /// True if every face was built as a triangle.
    #[inline]
    pub fn is_triangular(&self) -> bool {
        self.face_spans.is_empty()
    }

    /// True if `v` has not been removed.
    #[inline]
    pub fn has_vertex(&self, v: VertexId) -> bool {
        v.index() < self.stars.len() && !self.dead_vertices.get(v.index())
    }

    /// True if `e` has not been removed.
    #[inline]
    pub fn has_edge(&self, e: EdgeId) -> bool {
        e.index() < self.edges.len() && !self.dead_edges.get(e.index())
    }

    /// True if `f` has not been removed.
    #[inline]
    pub fn has_face(&self, f: FaceId) -> bool {
        f.index() < self.face_slots() && !self.dead_faces.get(f.index())
    }

    /// The live vertices, ascending.
    pub fn vertices(&self) -> impl Iterator<Item = VertexId> + '_ {
        (0..self.vertex_slots() as u32).map(VertexId).filter(|v| !self.dead_vertices.get(v.index()))
    }

    /// The live edges, ascending.
    pub fn edges(&self) -> impl Iterator<Item = EdgeId> + '_ {
        (0..self.edge_slots() as u32).map(EdgeId).filter(|e| !self.dead_edges.get(e.index()))
    }

    /// The live faces, ascending.
    pub fn faces(&self) -> impl Iterator<Item = FaceId> + '_ {
        (0..self.face_slots() as u32).map(FaceId).filter(|f| !self.dead_faces.get(f.index()))
    }

    /// Vertex -> incident edges, in storage order (no rotational order; see [`Topology::fans`]).
    #[inline]
    pub fn star(&self, v: VertexId) -> &[EdgeId] {
        &self.star_pool[self.stars[v.index()].span.range()]
    }

    /// Edge -> its two vertices.
    #[inline]
    pub fn edge_vertices(&self, e: EdgeId) -> [VertexId; 2] {
        self.edges[e.index()].vertices
    }

    /// The other vertex of `e` than `v`.
    #[inline]
    pub fn other(&self, e: EdgeId, v: VertexId) -> VertexId {
        let [a, b] = self.edges[e.index()].vertices;
        if a == v { b } else { a }
    }

    /// Edge -> incident faces, in storage order: none for a dangling edge, 1 on a border, 2 regular, 3 or more complex.
    #[inline]
    pub fn edge_faces(&self, e: EdgeId) -> &[FaceId] {
        let faces = &self.edges[e.index()].faces;
        if faces[1] == COMPLEX {
            return &self.complex_pool[self.complex[faces[0].index()].range()];
        }
        let n = (faces[0] != NO_FACE) as usize + (faces[1] != NO_FACE) as usize;
        &faces[..n]
    }

    /// The run of corner slots of `f`: corner `i` is where the face's edge `i` begins.
    #[inline]
    pub fn corner_range(&self, f: FaceId) -> std::ops::Range<usize> {
        if self.face_spans.is_empty() {
            3 * f.index()..3 * f.index() + 3
        } else {
            self.face_spans[f.index()].range()
        }
    }

    /// Face -> its edges in cyclic order, with the direction the face runs along each.
    #[inline]
    pub fn face_edges(&self, f: FaceId) -> &[EdgeUse] {
        &self.corners[self.corner_range(f)]
    }

    /// The vertex where the face's use of an edge begins.
    #[inline]
    pub fn origin(&self, u: EdgeUse) -> VertexId {
        self.edges[u.edge().index()].vertices[u.side()]
    }

    /// The vertex where the face's use of an edge ends.
    #[inline]
    pub fn target(&self, u: EdgeUse) -> VertexId {
        self.edges[u.edge().index()].vertices[u.side() ^ 1]
    }

    /// The vertices of `f` in cyclic order.
    #[inline]
    pub fn face_vertices(&self, f: FaceId) -> impl ExactSizeIterator<Item = VertexId> + '_ {
        self.face_edges(f).iter().map(|&u| self.origin(u))
    }

    /// The vertices of triangle `f`. Debug-panics if it is not one.
    #[inline]
    pub fn triangle(&self, f: FaceId) -> [VertexId; 3] {
        let u = self.face_edges(f);
        debug_assert_eq!(u.len(), 3);
        [self.origin(u[0]), self.target(u[0]), self.origin(u[2])]
    }

    /// The edge between `a` and `b`, if there is one. O(valence).
    pub fn find_edge(&self, a: VertexId, b: VertexId) -> Option<EdgeId> {
        let (a, b) = if self.star(a).len() <= self.star(b).len() { (a, b) } else { (b, a) };
        self.star(a).iter().copied().find(|&e| self.other(e, a) == b)
    }

    /// The faces around `v`, each once, in the order of the star. O(valence).
    pub fn vertex_faces(&self, v: VertexId) -> impl Iterator<Item = FaceId> + '_ {
        // A face meets v at one corner, whose outgoing edge is one of the star.
        self.star(v).iter().flat_map(move |&e| {
            self.edge_faces(e)
                .iter()
                .copied()
                .filter(move |&f| self.face_edges(f).iter().any(|&u| u.edge() == e && self.origin(u) == v))
        })
    }

    /// Bytes the AIF relations take now, spare capacity of the vectors left out.
    pub fn relation_bytes(&self) -> usize {
        size_of::<Star>() * self.stars.len()
            + 4 * self.star_pool.len()
            + size_of::<EdgeRecord>() * self.edges.len()
            + 4 * self.corners.len()
            + size_of::<Span>() * (self.face_spans.len() + self.complex.len())
            + 4 * self.complex_pool.len()
            + self.dead_vertices.bytes()
            + self.dead_edges.bytes()
            + self.dead_faces.bytes()
    }
}
