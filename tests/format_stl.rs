//! STL: tiny files by hand, round trips, stl_io as oracle, and files that are broken.

use glam::{DMat4, DVec3};
use progmesh::aif::{MeshInput, Positions};
use progmesh::io::{DecodeError, EncodeOptions, stl};
use progmesh::scene::{Node, Scene, SceneMesh};
use proptest::prelude::*;

const TEXT: &str = "solid a b
facet normal 0 0 1
 outer loop
  vertex 0 0 0
  VERTEX 1 0 0
  vertex 0 1e0 0
 endloop
endfacet
endsolid a b
";

fn scene(positions: Vec<[f32; 3]>, triangles: &[[u32; 3]]) -> Scene {
    let geometry = MeshInput::triangles(positions, triangles);
    Scene::from_mesh(SceneMesh { geometry, ..Default::default() })
}

fn tetrahedron() -> Scene {
    let p = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    scene(p, &[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
}

fn encode(scene: &Scene, text: bool) -> progmesh::io::Encoded {
    let mut options = EncodeOptions::default();
    options.text = text;
    stl::encode(scene, &options).unwrap()
}

fn geometry(bytes: &[u8]) -> MeshInput {
    stl::decode(bytes).unwrap().scene.meshes.remove(0).geometry
}

fn places(g: &MeshInput) -> Vec<[f64; 3]> {
    g.corners.iter().map(|&v| g.positions.get(v as usize).to_array()).collect()
}

#[test]
fn text_is_read_with_its_name() {
    let d = stl::decode(TEXT.as_bytes()).unwrap();
    let m = &d.scene.meshes[0];
    assert_eq!((m.name.as_deref(), m.geometry.corners.as_slice()), (Some("a b"), &[0, 1, 2][..]));
    assert_eq!(m.geometry.positions, Positions::F32(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]));
    assert!(d.warnings.is_empty() && m.groups.is_empty());
}

#[test]
fn welding_is_said_once_with_its_counts() {
    for text in [false, true] {
        let d = stl::decode(&encode(&tetrahedron(), text).bytes).unwrap();
        assert_eq!(d.warnings, ["STL has no shared vertices: welded bit-equal positions, 12 -> 4"]);
        assert_eq!(places(&d.scene.meshes[0].geometry), places(&tetrahedron().meshes[0].geometry));
    }
}

#[test]
fn minus_zero_welds_with_zero() {
    let s =
        scene(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, -0.0]], &[[0, 1, 2], [3, 2, 1]]);
    assert_eq!(geometry(&encode(&s, false).bytes).positions.len(), 3);
}

#[test]
fn a_binary_file_may_begin_with_solid() {
    let mut bytes = encode(&tetrahedron(), false).bytes;
    bytes[..9].copy_from_slice(b"solid abc");
    assert_eq!(geometry(&bytes).corners.len(), 12);
}

#[test]
fn several_solids_are_groups_and_stay_connected() {
    let two = format!("{TEXT}{}", TEXT.replace("a b", "c").replace("vertex 0 0 0", "vertex 1 1 0"));
    let d = stl::decode(two.as_bytes()).unwrap();
    let m = &d.scene.meshes[0];
    assert_eq!(m.groups.iter().map(|g| g.label()).collect::<Vec<_>>(), ["a b", "c"]);
    assert_eq!((m.geometry.face_group.as_slice(), m.geometry.positions.len()), (&[0, 1][..], 4));
    let again = stl::decode(&encode(&d.scene, true).bytes).unwrap().scene;
    assert_eq!(again.meshes[0].groups, m.groups);
    assert!(encode(&d.scene, false).warnings.iter().any(|w| w.contains("groups")));
}

#[test]
fn attribute_bytes_and_trailing_bytes_are_said_to_be_left_out() {
    let mut bytes = encode(&tetrahedron(), false).bytes;
    bytes[84 + 48] = 7;
    assert!(
        stl::decode(&bytes).unwrap().warnings.iter().any(|w| w.contains("attribute bytes (colours) of 1 "))
    );
    bytes.extend_from_slice(b"xyz");
    assert!(stl::decode(&bytes).unwrap().warnings.iter().any(|w| w.starts_with("3 bytes after the 4 ")));
}

#[test]
fn lying_counts_name_the_facet_where_the_file_ends() {
    let mut bytes = encode(&tetrahedron(), false).bytes;
    bytes[80..84].copy_from_slice(&1_000_000_000u32.to_le_bytes());
    let e = stl::decode(&bytes).unwrap_err();
    let what = "1000000000 facets announced, but the file ends in facet 4 (from 0)".to_string();
    assert_eq!(e, DecodeError::Byte { offset: 284, what });
}

#[test]
fn coordinates_that_are_not_finite_name_the_facet() {
    let mut bytes = encode(&tetrahedron(), false).bytes;
    bytes[84 + 50 + 12 + 4..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let e = stl::decode(&bytes).unwrap_err().to_string();
    assert_eq!(e, "facet 1: y of corner 0 is NaN; coordinates must be finite");
    let e = stl::decode(TEXT.replace("1e0", "inf").as_bytes()).unwrap_err().to_string();
    assert_eq!(e, "line 6: facet 0: y of corner 2 is inf; coordinates must be finite");
}

#[test]
fn broken_text_names_line_and_facet() {
    let say = |s: &str| stl::decode(s.as_bytes()).unwrap_err().to_string();
    assert_eq!(say(&TEXT.replace("1e0", "q")), "line 6: facet 0: coordinate \"q\" is no number");
    assert_eq!(
        say(&TEXT.replace(" endloop", " vertex 1 1 1")),
        "line 7: facet 0: \"vertex\" where endloop should be"
    );
    assert!(
        say(&TEXT.replace("endsolid a b\n", "")).contains("the file ends where facet or endsolid should be")
    );
    assert!(say("ply").contains("neither"));
}

#[test]
fn doubles_survive_text_and_are_said_to_be_rounded_in_binary() {
    let geometry = MeshInput {
        positions: Positions::F64(vec![[0.1, 0.0, 0.0], [1e6 + 0.1, 0.0, 0.0], [0.0, 1.0 / 3.0, 0.0]]),
        corners: vec![0, 1, 2],
        ..Default::default()
    };
    let s = Scene::from_mesh(SceneMesh { geometry, ..Default::default() });
    let d = stl::decode(&encode(&s, true).bytes).unwrap();
    assert_eq!(d.scene.meshes[0].geometry.positions, s.meshes[0].geometry.positions);
    assert!(encode(&s, false).warnings.iter().any(|w| w.contains("rounded from f64")));
}

#[test]
fn polygons_are_cut_and_normals_computed() {
    let positions = vec![[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [1.0, 1.0, 0.0f32]];
    let s = Scene::from_mesh(SceneMesh {
        geometry: MeshInput::polygons(positions, &[4], &[0, 1, 2, 3]),
        ..Default::default()
    });
    let e = encode(&s, false);
    assert_eq!(e.warnings, ["STL has triangles only: 1 polygons are cut into triangles"]);
    let oracle = stl_io::read_stl(&mut std::io::Cursor::new(&e.bytes)).unwrap();
    assert_eq!(oracle.faces.len(), 2);
    assert!(oracle.faces.iter().all(|f| f.normal.0 == [0.0, 0.0, 1.0]));
}

#[test]
fn normals_survive_tiny_and_huge_scales() {
    for by in [1e-30f32, 1e30] {
        let s = scene(vec![[0.0; 3], [by, 0.0, 0.0], [0.0, by, 0.0]], &[[0, 1, 2]]);
        let bytes = encode(&s, false).bytes;
        assert_eq!(bytes[84 + 8..84 + 12], 1.0f32.to_le_bytes());
    }
}

#[test]
fn a_mirrored_instance_keeps_its_outside() {
    let mut s = tetrahedron();
    let place = |t| Node { name: None, transform: t, mesh: Some(0), children: vec![] };
    s.nodes = vec![
        place(DMat4::from_translation(DVec3::X * 4.0)),
        place(DMat4::from_scale(DVec3::new(-2.0, 1.0, 1.0))),
    ];
    s.roots = vec![0, 1];
    let e = encode(&s, false);
    let p = places(&geometry(&e.bytes));
    let volume = |p: &[[f64; 3]]| -> f64 {
        p.chunks(3)
            .map(|t| {
                let [a, b, c] = [t[0], t[1], t[2]].map(DVec3::from_array);
                a.cross(b).dot(c) / 6.0
            })
            .sum()
    };
    assert!((volume(&p[..12]) - 1.0 / 6.0).abs() < 1e-9 && (volume(&p[12..]) - 2.0 / 6.0).abs() < 1e-9);
    assert!(e.warnings.iter().any(|w| w.contains("transforms")));
}

#[test]
fn scenes_that_are_wrong_are_refused() {
    let options = EncodeOptions::default();
    let e = stl::encode(&scene(vec![[0.0; 3]], &[[0, 0, 9]]), &options).unwrap_err();
    assert!(e.to_string().contains("vertex 9 of 1"));
    let e = stl::encode(&scene(vec![[f32::NAN; 3]], &[[0, 0, 0]]), &options).unwrap_err();
    assert!(e.to_string().contains("not finite"));
}

#[test]
fn truncated_anywhere_is_an_error() {
    let bytes = encode(&tetrahedron(), false).bytes;
    assert!((0..bytes.len()).all(|n| stl::decode(&bytes[..n]).is_err()));
    // Complete once "endsolid" is there. An empty file and a piece of its first word are no STL.
    let complete = TEXT.find("endsolid").unwrap() + 8;
    assert!((0..complete).all(|n| stl::decode(&TEXT.as_bytes()[..n]).is_err()));
}

proptest! {
    #[test]
    fn round_trips_and_agrees_with_stl_io(
        points in prop::collection::vec(prop::array::uniform3(-1e3f32..1e3), 3..20),
        faces in prop::collection::vec(prop::array::uniform3(any::<prop::sample::Index>()), 0..30),
        text: bool,
    ) {
        let faces: Vec<[u32; 3]> = faces.iter().map(|f| f.map(|i| i.index(points.len()) as u32)).collect();
        let s = scene(points, &faces);
        let bytes = encode(&s, text).bytes;
        let g = geometry(&bytes);
        prop_assert_eq!(places(&g), places(&s.meshes[0].geometry));
        prop_assert!(!g.positions.is_f64());
        let oracle = stl_io::read_stl(&mut std::io::Cursor::new(&bytes)).unwrap();
        let theirs: Vec<[f64; 3]> =
            oracle.faces.iter().flat_map(|f| f.vertices).map(|v| oracle.vertices[v].0.map(f64::from)).collect();
        prop_assert_eq!(places(&g), theirs);
    }

    #[test]
    fn flipped_bytes_never_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8), text: bool) {
        let mut bytes = encode(&tetrahedron(), text).bytes;
        for (at, to) in flips {
            let i = at.index(bytes.len());
            bytes[i] = to;
        }
        if let Ok(d) = stl::decode(&bytes) {
            let g = &d.scene.meshes[0].geometry;
            prop_assert!(g.corners.iter().all(|&v| (v as usize) < g.positions.len()));
            prop_assert!(g.positions.iter().all(|p| p.is_finite()));
        }
    }
}
