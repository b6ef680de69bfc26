//! Classification of vertices and edges by the vocabulary of AIF.

use crate::ids::{EdgeId, VertexId};
use crate::sets::Sets;
use crate::topology::Topology;

/// What kind of edge: by the number of its faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EdgeKind {
    /// No face, and no other edge at either end: a stick by itself.
    Isolated,
    /// No face, but another edge at one end at least.
    Dangling,
    /// One face.
    Border,
    /// Two faces.
    Regular,
    /// Three or more faces.
    Complex,
}

/// What kind of vertex: by what its edges and faces look like close to it.
///
/// Faces around a vertex that share an edge there, of whatever kind, are one *piece*; a dangling or isolated edge is a piece by
/// itself. The kinds exclude each other; the first that fits, in this order, applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VertexKind {
    /// No edge.
    Isolated,
    /// Two or more pieces: taking the vertex away would cut the mesh there. Also an inner vertex of a polyline.
    Cut,
    /// One piece, an edge without a face: the end of a polyline.
    Dangling,
    /// One piece of faces, with a complex edge among its edges.
    Complex,
    /// Regular, on the border: its faces form one open fan, a half-disk.
    Border,
    /// Regular, inside: its faces form one closed fan, a disk.
    Interior,
}

impl VertexKind {
    /// True for the regular vertices: those around which the mesh is a surface, with or without border.
    pub fn is_regular(self) -> bool {
        matches!(self, VertexKind::Border | VertexKind::Interior)
    }
}

/// How many live vertices and edges there are of every kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct KindCounts {
    /// Vertices without an edge.
    pub isolated_vertices: usize,
    /// Cut vertices.
    pub cut_vertices: usize,
    /// Ends of polylines.
    pub dangling_vertices: usize,
    /// Vertices of complex edges, not cut.
    pub complex_vertices: usize,
    /// Regular vertices on the border.
    pub border_vertices: usize,
    /// Regular vertices inside.
    pub interior_vertices: usize,
    /// Edges by themselves.
    pub isolated_edges: usize,
    /// Other edges without a face.
    pub dangling_edges: usize,
    /// Edges with one face.
    pub border_edges: usize,
    /// Edges with two faces.
    pub regular_edges: usize,
    /// Edges with three and more faces.
    pub complex_edges: usize,
}

impl KindCounts {
    /// True if every vertex is regular and every edge is a border or regular edge: the mesh is a 2-manifold, perhaps with
    /// border. True for a mesh without vertices.
    pub fn is_manifold(&self) -> bool {
        self.isolated_vertices + self.cut_vertices + self.dangling_vertices + self.complex_vertices == 0
            && self.isolated_edges + self.dangling_edges + self.complex_edges == 0
    }

    /// True if [`KindCounts::is_manifold`] and there is no border.
    pub fn is_closed(&self) -> bool {
        self.is_manifold() && self.border_edges == 0
    }
}

impl Topology {
    /// The kind of live edge `e`. O(1).
    pub fn edge_kind(&self, e: EdgeId) -> EdgeKind {
        match self.edge_faces(e).len() {
            0 if self.edge_vertices(e).iter().all(|&v| self.star(v).len() == 1) => EdgeKind::Isolated,
            0 => EdgeKind::Dangling,
            1 => EdgeKind::Border,
            2 => EdgeKind::Regular,
            _ => EdgeKind::Complex,
        }
    }

    /// The kind of every vertex slot; removed ones read as isolated. O(n log n), in effect linear.
    pub fn classify_vertices(&self) -> Vec<VertexKind> {
        let mut pieces = self.pieces();
        let mut kinds = vec![VertexKind::Isolated; self.vertex_slots()];
        for v in self.vertices() {
            let star = self.star(v);
            let (mut loose, mut border, mut complex) = (0, 0, 0);
            for &e in star {
                match self.edge_faces(e).len() {
                    0 => loose += 1,
                    1 => border += 1,
                    2 => {}
                    _ => complex += 1,
                }
            }
            pieces[v.index()] += loose;
            kinds[v.index()] = match pieces[v.index()] {
                0 => VertexKind::Isolated,
                2.. => VertexKind::Cut,
                _ if loose == 1 => VertexKind::Dangling,
                _ if complex > 0 => VertexKind::Complex,
                _ if border > 0 => VertexKind::Border,
                _ => VertexKind::Interior,
            };
        }
        kinds
    }

    /// Counts the live vertices and edges of every kind. In effect linear.
    pub fn count_kinds(&self) -> KindCounts {
        let mut n = KindCounts::default();
        let kinds = self.classify_vertices();
        for v in self.vertices() {
            *match kinds[v.index()] {
                VertexKind::Isolated => &mut n.isolated_vertices,
                VertexKind::Cut => &mut n.cut_vertices,
                VertexKind::Dangling => &mut n.dangling_vertices,
                VertexKind::Complex => &mut n.complex_vertices,
                VertexKind::Border => &mut n.border_vertices,
                VertexKind::Interior => &mut n.interior_vertices,
            } += 1;
        }
        for e in self.edges() {
            *match self.edge_kind(e) {
                EdgeKind::Isolated => &mut n.isolated_edges,
                EdgeKind::Dangling => &mut n.dangling_edges,
                EdgeKind::Border => &mut n.border_edges,
                EdgeKind::Regular => &mut n.regular_edges,
                EdgeKind::Complex => &mut n.complex_edges,
            } += 1;
        }
        n
    }

    /// For every vertex slot, into how many pieces its faces fall when those that share an edge there are one.
    pub(crate) fn pieces(&self) -> Vec<u32> {
        // Corners of a vertex are joined across each edge; the last use of an edge is kept as its corners at both ends.
        let mut corners = Sets::new(self.corner_slots());
        let mut last = vec![[u32::MAX; 2]; self.edge_slots()];
        for f in self.faces() {
            let range = self.corner_range(f);
            for c in range.clone() {
                let next = if c + 1 == range.end { range.start } else { c + 1 };
                let u = self.corners[c];
                let at = if u.side() == 0 { [c, next] } else { [next, c] };
                let last = &mut last[u.edge().index()];
                if last[0] != u32::MAX {
                    corners.union(last[0] as usize, at[0]);
                    corners.union(last[1] as usize, at[1]);
                }
                *last = at.map(|x| x as u32);
            }
        }
        let mut pieces = vec![0; self.vertex_slots()];
        for f in self.faces() {
            for c in self.corner_range(f).filter(|&c| corners.find(c) == c) {
                let v: VertexId = self.origin(self.corners[c]);
                pieces[v.index()] += 1;
            }
        }
        pieces
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mesh, MeshInput};

    fn mesh(vertices: usize, triangles: &[[u32; 3]], wires: &[[u32; 2]]) -> Mesh {
        let p: Vec<[f32; 3]> = (0..vertices).map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
        let mut input = MeshInput::triangles(p, triangles);
        input.wires = wires.to_vec();
        Mesh::build(input, &Default::default()).unwrap().0
    }

    #[test]
    fn every_kind_of_vertex() {
        use VertexKind::*;
        // Four triangles round 0: closed. A bow tie at 6. A polyline 10-11-12. A stick 13-14. 15 alone.
        //
        //   2---1      5   8
        //   |\ /|      |\ /|
        //   | 0 |      | 6 |      10---11---12     13---14     15
        //   |/ \|      |/ \|
        //   3---4      7   9
        let m = mesh(
            16,
            &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [6, 5, 7], [6, 9, 8]],
            &[[10, 11], [11, 12], [13, 14]],
        );
        let kinds = m.topology().classify_vertices();
        let want = [
            Interior, Border, Border, Border, Border, Border, Cut, Border, Border, Border, Dangling, Cut,
            Dangling, Dangling, Dangling, Isolated,
        ];
        assert_eq!(kinds, want);
        let n = m.topology().count_kinds();
        assert_eq!((n.interior_vertices, n.border_vertices, n.cut_vertices), (1, 8, 2));
        assert_eq!((n.dangling_vertices, n.isolated_vertices, n.complex_vertices), (4, 1, 0));
        assert_eq!((n.isolated_edges, n.dangling_edges, n.complex_edges), (1, 2, 0));
        assert_eq!((n.border_edges, n.regular_edges), (10, 4));
        assert!(!n.is_manifold());
    }

    #[test]
    fn pages_of_a_book_are_one_piece_at_the_spine() {
        // Three triangles on 0-1.
        let m = mesh(5, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]], &[]);
        let kinds = m.topology().classify_vertices();
        assert_eq!(kinds[..2], [VertexKind::Complex; 2]);
        assert_eq!(kinds[2..], [VertexKind::Border; 3]);
        let spine = m.topology().find_edge(VertexId(0), VertexId(1)).unwrap();
        assert_eq!(m.topology().edge_kind(spine), EdgeKind::Complex);
        // A flag on the end of the spine makes it a cut vertex.
        let m = mesh(7, &[[0, 1, 2], [0, 1, 3], [0, 1, 4], [1, 5, 6]], &[]);
        assert_eq!(m.topology().classify_vertices()[1], VertexKind::Cut);
        // So does a dangling edge.
        let m = mesh(6, &[[0, 1, 2]], &[[2, 5]]);
        assert_eq!(m.topology().classify_vertices()[2], VertexKind::Cut);
    }

    #[test]
    fn a_tetrahedron_is_closed_and_two_on_a_vertex_are_cut() {
        let tetra = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let n = mesh(4, &tetra, &[]).topology().count_kinds();
        assert!(n.is_closed());
        assert_eq!((n.interior_vertices, n.regular_edges), (4, 6));
        let second = tetra.map(|t| t.map(|v| v + 3));
        let m = mesh(7, &[tetra, second].concat(), &[]);
        assert_eq!(m.topology().classify_vertices()[3], VertexKind::Cut);
    }
}
