//! Removing whole faces.

use crate::edit::Marks;
use crate::ids::FaceId;
use crate::topology::{COMPLEX, NO_FACE, Topology};

impl Topology {
    /// Removes `faces` and the edges that no other face uses; vertices stay, isolated ones too. Records of collapses made before can
    /// no longer be undone. Faces that are gone already are passed over. O(size of the faces and of the stars of their vertices).
    pub fn remove_faces(&mut self, faces: impl IntoIterator<Item = FaceId>) {
        let mut thinned = Vec::new();
        for f in faces {
            if !self.has_face(f) {
                continue;
            }
            self.dead_faces.set(f.index());
            for i in self.corner_range(f) {
                let e = self.corners[i].edge();
                self.drop_face(e, f);
                if self.edge_faces(e).is_empty() {
                    self.dead_edges.set(e.index());
                    thinned.extend(self.edge_vertices(e));
                }
            }
        }
        // Each star once, however many of its edges are gone.
        let mut done = Marks::default();
        done.clear(self.vertex_slots());
        for v in thinned {
            if done.has(v) {
                continue;
            }
            done.set(v);
            let mut span = self.stars[v.index()].span;
            let mut end = span.start as usize;
            for i in span.range() {
                let e = self.star_pool[i];
                if !self.dead_edges.get(e.index()) {
                    self.star_pool[end] = e;
                    end += 1;
                }
            }
            span.len = end as u32 - span.start;
            self.stars[v.index()].span = span;
        }
    }

    /// Takes `f` off the list of `e`.
    fn drop_face(&mut self, e: crate::ids::EdgeId, f: FaceId) {
        let faces = &mut self.edges[e.index()].faces;
        if faces[1] == COMPLEX {
            let span = &mut self.complex[faces[0].index()];
            let list = &mut self.complex_pool[span.range()];
            if let Some(i) = list.iter().position(|&g| g == f) {
                list.copy_within(i + 1.., i);
                span.len -= 1;
            }
        } else if faces[0] == f {
            *faces = [faces[1], NO_FACE];
        } else if faces[1] == f {
            faces[1] = NO_FACE;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{EdgeKind, FaceId, Mesh};

    /// ```text
    /// 3---2        5---6
    /// | \ |  and   |  /
    /// 0---1        4
    /// ```
    fn two_parts() -> Mesh {
        let p = (0..7).map(|i| [(i * i) as f32, i as f32, 0.0]).collect::<Vec<_>>();
        Mesh::from_triangles(p, &[[0, 1, 3], [1, 2, 3], [4, 6, 5]]).unwrap()
    }

    #[test]
    fn a_component_goes_with_its_edges() {
        let mut m = two_parts();
        m.topology_mut().remove_faces([FaceId(2)]);
        m.check().unwrap();
        assert_eq!((m.face_count(), m.topology().edge_count(), m.vertex_count()), (2, 5, 7));
        assert!(m.topology().star(crate::VertexId(5)).is_empty());
    }

    #[test]
    fn a_shared_edge_becomes_a_border() {
        let mut m = two_parts();
        m.topology_mut().remove_faces([FaceId(0), FaceId(0)]);
        m.check().unwrap();
        let t = m.topology();
        let shared = t.find_edge(crate::VertexId(1), crate::VertexId(3)).unwrap();
        assert_eq!(t.edge_kind(shared), EdgeKind::Border);
    }

    #[test]
    fn a_face_at_a_complex_edge_leaves_the_others() {
        let p = (0..5).map(|i| [i as f32, (i * i) as f32, 1.0]).collect::<Vec<_>>();
        let mut m = Mesh::from_triangles(p, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]]).unwrap();
        for f in 0..3 {
            m.topology_mut().remove_faces([FaceId(f)]);
            m.check().unwrap();
        }
        assert_eq!((m.face_count(), m.topology().edge_count()), (0, 0));
    }
}
