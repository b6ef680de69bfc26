//! Edge collapse and vertex split on random meshes: always a mesh, and undone exactly.

mod common;

use common::{either, faces_of};
use glam::DVec3;
use progmesh_aif::{BuildOptions, EdgeId, Marks, Mesh, MeshInput};
use proptest::prelude::*;

/// All that the mesh holds, orders included.
fn everything(m: &Mesh) -> String {
    let t = m.topology();
    let stars: Vec<_> = t.vertices().map(|v| (v, t.star(v), m.positions().bits(v.index()))).collect();
    let edges: Vec<_> = t.edges().map(|e| (e, t.edge_vertices(e), t.edge_faces(e))).collect();
    let faces: Vec<_> = t.faces().map(|f| (f, t.face_edges(f), m.face_groups().get(f.index()))).collect();
    let corners: Vec<_> =
        m.wedges().iter().flat_map(|w| t.faces().map(|f| &w.corner[t.corner_range(f)])).collect();
    format!("{stars:?} {edges:?} {faces:?} {corners:?}")
}

fn with_wedges(mut input: MeshInput) -> MeshInput {
    use progmesh_aif::{Channel, Semantic, Wedges};
    let mut w = Wedges::new(vec![Channel::new(Semantic::Custom("corner".into()), 1)]).unwrap();
    for i in 0..input.corners.len() {
        w.push(&[i as f32], 1);
    }
    w.corner = (0..input.corners.len() as u32).collect();
    input.wedges = Some(w);
    input
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn collapses_keep_a_mesh_and_splits_restore_it(
        soup in either(),
        picks in prop::collection::vec((any::<prop::sample::Index>(), any::<bool>()), 1..40),
    ) {
        let mut mesh = Mesh::build(with_wedges(soup.input()), &BuildOptions::default()).unwrap().0;
        let mut marks = Marks::default();
        let mut undo = Vec::new();
        for (pick, end) in picks {
            let live: Vec<EdgeId> = mesh.topology().edges().collect();
            if live.is_empty() {
                break;
            }
            let e = live[pick.index(live.len())];
            let kept = mesh.topology().edge_vertices(e)[end as usize];
            let (before, euler) = (everything(&mesh), mesh.topology().euler_characteristic());
            let components = mesh.topology().vertex_components().count;
            match mesh.collapse_edge(e, kept, DVec3::splat(0.25), &mut marks) {
                Ok(record) => {
                    prop_assert_eq!(mesh.check(), Ok(()));
                    prop_assert_eq!(mesh.topology().euler_characteristic(), euler);
                    prop_assert_eq!(mesh.topology().vertex_components().count, components);
                    undo.push((record, before));
                }
                Err(_) => prop_assert_eq!(everything(&mesh), before),
            }
        }
        // What is left compacts to the same mesh under new ids.
        let (small, maps) = mesh.clone().compact(Default::default());
        prop_assert_eq!(small.check(), Ok(()));
        let renamed: Vec<Vec<u32>> =
            faces_of(&mesh).iter().map(|f| f.iter().map(|&v| maps.vertex[v as usize]).collect()).collect();
        prop_assert_eq!(faces_of(&small), renamed);
        prop_assert_eq!(small.to_input().corners, mesh.to_input().corners);
        let cut = mesh.clone().triangulate().unwrap().mesh;
        prop_assert_eq!(cut.check(), Ok(()));
        prop_assert_eq!(cut.vertex_count(), mesh.vertex_count());

        while let Some((record, before)) = undo.pop() {
            mesh.split_vertex(&record);
            prop_assert_eq!(mesh.check(), Ok(()));
            prop_assert_eq!(everything(&mesh), before);
        }
    }
}
