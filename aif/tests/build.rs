//! Building against a model that is slow and plain.

mod common;

use common::{Soup, either, faces_of};
use progmesh_aif::{BuildError, BuildOptions, Mesh, MeshInput, VertexId, Weld};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

fn is_simple(face: &[u32]) -> bool {
    face.len() >= 3 && face.iter().collect::<BTreeSet<_>>().len() == face.len()
}

/// The edges of a closed walk that are walked an odd number of times, in either direction.
fn odd_edges(faces: &[&[u32]]) -> BTreeSet<(u32, u32)> {
    let mut odd = BTreeSet::new();
    for face in faces {
        for i in 0..face.len() {
            let (a, b) = (face[i], face[(i + 1) % face.len()]);
            if a != b && !odd.insert((a.min(b), a.max(b))) {
                odd.remove(&(a.min(b), a.max(b)));
            }
        }
    }
    odd
}

/// Edge -> faces, from the faces and the wires alone.
fn model(faces: &[Vec<u32>], wires: &[[u32; 2]]) -> BTreeMap<(u32, u32), Vec<u32>> {
    let mut edges: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
    for (f, face) in faces.iter().enumerate() {
        for i in 0..face.len() {
            let (a, b) = (face[i], face[(i + 1) % face.len()]);
            edges.entry((a.min(b), a.max(b))).or_default().push(f as u32);
        }
    }
    for w in wires.iter().filter(|w| w[0] != w[1]) {
        edges.entry((w[0].min(w[1]), w[0].max(w[1]))).or_default();
    }
    edges
}

fn assert_is_model(soup: &Soup, mesh: &Mesh) -> Result<(), TestCaseError> {
    let t = mesh.topology();
    let faces = faces_of(mesh);
    let edges = model(&faces, &soup.wires);
    prop_assert_eq!(t.edge_count(), edges.len());
    let mut degree = vec![0; t.vertex_slots()];
    for (&(a, b), of) in &edges {
        let e = t.find_edge(VertexId(a), VertexId(b));
        prop_assert!(e.is_some(), "{a}-{b}");
        let got: Vec<u32> = e.map_or(Vec::new(), |e| t.edge_faces(e).iter().map(|f| f.0).collect());
        prop_assert_eq!(&got, of);
        degree[a as usize] += 1;
        degree[b as usize] += 1;
    }
    for v in t.vertices() {
        prop_assert_eq!(t.star(v).len(), degree[v.index()]);
        prop_assert!(t.star(v).is_sorted());
        let mut around: Vec<u32> = t.vertex_faces(v).map(|f| f.0).collect();
        around.sort_unstable();
        let want: Vec<u32> = (0..faces.len() as u32).filter(|&f| faces[f as usize].contains(&v.0)).collect();
        prop_assert_eq!(around, want);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn any_soup_builds_a_mesh_that_is_its_model(soup in either()) {
        let (mesh, report) = Mesh::build(soup.input(), &BuildOptions::default()).unwrap();
        prop_assert_eq!(mesh.check(), Ok(()));
        assert_is_model(&soup, &mesh)?;

        // Faces: the simple ones as they were, the others reported, and nothing else.
        let faces = faces_of(&mesh);
        let same: Vec<u32> = (0..soup.faces.len() as u32).collect();
        let map = report.face_map.as_deref().unwrap_or(&same);
        prop_assert_eq!(map.len(), faces.len());
        prop_assert!(map.is_sorted());
        prop_assert_eq!(map, mesh.face_groups());
        for (f, face) in soup.faces.iter().enumerate() {
            let f = f as u32;
            let parts: Vec<&[u32]> = (0..faces.len()).filter(|&i| map[i] == f).map(|i| &faces[i][..]).collect();
            let lists = [&report.dropped_faces, &report.shortened_faces, &report.split_faces];
            let listed = lists.map(|l| l.contains(&f));
            if is_simple(face) {
                prop_assert_eq!(&parts, &[&face[..]]);
                prop_assert_eq!(listed, [false; 3]);
            } else {
                prop_assert_eq!(listed.iter().filter(|&&x| x).count(), 1);
                prop_assert_eq!(parts.is_empty(), listed[0]);
                // What was left out is walked there and back.
                prop_assert_eq!(odd_edges(&parts), odd_edges(&[face]));
            }
        }
    }

    #[test]
    fn welding_bit_equal_points_is_building_from_welded_indices(soup in either()) {
        let (mesh, report) = Mesh::build(soup.input(), &BuildOptions::with_weld(Weld::BitEqual)).unwrap();
        prop_assert_eq!(mesh.check(), Ok(()));
        let mut first: BTreeMap<[i32; 3], u32> = BTreeMap::new();
        let mut points = Vec::new();
        let map: Vec<u32> = soup.points.iter().map(|&p| *first.entry(p.map(|x| x as i32)).or_insert_with(|| {
            points.push(p);
            points.len() as u32 - 1
        })).collect();
        prop_assert_eq!(report.welded_vertices, soup.points.len() - points.len());
        if let Some(got) = &report.vertex_map {
            prop_assert_eq!(got, &map);
        }
        let welded = Soup {
            points,
            faces: soup.faces.iter().map(|f| f.iter().map(|&v| map[v as usize]).collect()).collect(),
            wires: soup.wires.iter().map(|w| w.map(|v| map[v as usize])).collect(),
        };
        assert_is_model(&welded, &mesh)?;
        let direct = Mesh::build(welded.input(), &BuildOptions::default()).unwrap().0;
        prop_assert_eq!(faces_of(&mesh), faces_of(&direct));
        prop_assert_eq!(mesh.positions(), direct.positions());
    }

    #[test]
    fn export_and_compaction_lose_nothing(soup in either()) {
        let mesh = Mesh::build(soup.input(), &BuildOptions::default()).unwrap().0;
        let again = Mesh::build(mesh.to_input(), &BuildOptions::default()).unwrap().0;
        let (compacted, maps) = mesh.clone().compact(Default::default());
        prop_assert_eq!(maps.vertex, (0..soup.points.len() as u32).collect::<Vec<_>>());
        prop_assert_eq!(maps.edge, (0..mesh.topology().edge_slots() as u32).collect::<Vec<_>>());
        for other in [&again, &compacted] {
            prop_assert_eq!(other.check(), Ok(()));
            prop_assert_eq!(faces_of(&mesh), faces_of(other));
            prop_assert_eq!(mesh.positions(), other.positions());
            prop_assert_eq!(mesh.face_groups(), other.face_groups());
            let (s, t) = (mesh.topology(), other.topology());
            prop_assert_eq!(s.edge_count(), t.edge_count());
            for e in s.edges() {
                prop_assert_eq!(s.edge_vertices(e), t.edge_vertices(e));
                prop_assert_eq!(s.edge_faces(e), t.edge_faces(e));
            }
        }
    }
}

#[test]
fn a_hub_of_a_hundred_thousand_triangles() {
    // The hub is the lowest vertex of all its edges in one, the highest in the other; and one edge with every face.
    let n = 100_000u32;
    let points = vec![[0.0f32; 3]; n as usize + 2];
    let low: Vec<[u32; 3]> = (1..=n).map(|i| [0, i, i % n + 1]).collect();
    let high: Vec<[u32; 3]> = (0..n).map(|i| [n, i, (i + 1) % n]).collect();
    let spine: Vec<[u32; 3]> = (2..n).map(|i| [0, 1, i]).collect();
    for (triangles, edges) in [(low, 2 * n), (high, 2 * n), (spine, 2 * (n - 2) + 1)] {
        let mesh = Mesh::from_triangles(points.clone(), &triangles).unwrap();
        assert_eq!(mesh.check(), Ok(()));
        assert_eq!(mesh.topology().edge_count(), edges as usize);
        let t = mesh.topology();
        let hub = t.vertices().max_by_key(|&v| t.star(v).len()).unwrap();
        assert!(t.star(hub).len() >= n as usize - 1);
        t.fans(hub);
        t.classify_vertices();
        t.border_loops();
    }
    // One polygon with as many corners.
    let mesh = Mesh::from_polygons(points, &[n], &(0..n).collect::<Vec<_>>()).unwrap();
    assert_eq!(mesh.check(), Ok(()));
    assert_eq!(mesh.topology().border_loops()[0].vertices.len(), n as usize);
}

#[test]
fn hostile_input_is_refused_by_name() {
    let p = vec![[0.0f32; 3]; 4];
    let polygons =
        |sizes: &[u32], corners: &[u32]| Mesh::from_polygons(p.clone(), sizes, corners).unwrap_err();
    assert_eq!(polygons(&[3, 5], &[0, 1, 2]), BuildError::Sizes { sum: 8, corners: 3 });
    assert!(matches!(polygons(&[u32::MAX; 9], &[0]), BuildError::Sizes { .. }));
    assert_eq!(
        polygons(&[4, 3], &[0, 1, 2, 3, 0, 1, 4]),
        BuildError::IndexOutOfRange { face: 1, corner: 2, index: 4, vertices: 4 }
    );
    let build = |input: MeshInput| Mesh::build(input, &BuildOptions::default()).unwrap_err();
    let mut input = MeshInput::triangles(p.clone(), &[[0, 1, 2]]);
    input.corners.push(1);
    assert_eq!(build(input), BuildError::NotTriangles { corners: 4 });
    let mut input = MeshInput::triangles(p.clone(), &[[0, 1, 2]]);
    input.wires = vec![[0, 1], [9, 0]];
    assert_eq!(build(input), BuildError::WireOutOfRange { wire: 1, index: 9, vertices: 4 });
    let mut input = MeshInput::triangles(p.clone(), &[[0, 1, 2]]);
    input.face_material = vec![0, 0];
    assert_eq!(build(input), BuildError::Length { name: "face_material", len: 2, want: 1 });
    let mut q = p;
    q[2][1] = f32::NEG_INFINITY;
    let error = Mesh::from_triangles(q, &[]).unwrap_err();
    assert_eq!(error, BuildError::NotFinite { vertex: 2, axis: 'y', value: f64::NEG_INFINITY });
    assert_eq!(Mesh::from_triangles(Vec::<[f32; 3]>::new(), &[]).unwrap().check(), Ok(()));
}
