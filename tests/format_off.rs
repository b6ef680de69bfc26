//! OFF: tiny files by hand, round trips, and files that are broken.

use progmesh::aif::{Encoding, MeshInput, Positions, Semantic};
use progmesh::io::{DecodeError, EncodeOptions, off};
use progmesh::scene::{Scene, SceneMesh};
use proptest::prelude::*;

const SQUARE: &str = "OFF # a square
# and a comment
4 2 0

0 0 0
1 0 0 # here too
1 1 0
0 1 0
4 0 1 2 3
3 2 1 0
";

fn read(text: &str) -> (MeshInput, Vec<String>) {
    let mut d = off::decode(text.as_bytes()).unwrap();
    (d.scene.meshes.remove(0).geometry, d.warnings)
}

fn error(text: &str) -> String {
    off::decode(text.as_bytes()).unwrap_err().to_string()
}

fn write(geometry: MeshInput) -> progmesh::io::Encoded {
    let s = Scene::from_mesh(SceneMesh { geometry, ..Default::default() });
    off::encode(&s, &EncodeOptions::default()).unwrap()
}

/// The values of a channel at every corner.
fn values(g: &MeshInput, semantic: Semantic) -> Vec<Option<Vec<f32>>> {
    let w = g.wedges.as_ref().unwrap();
    let k = w.channel(&semantic).unwrap();
    w.corner.iter().map(|&c| w.get(c, k).map(|v| v.to_vec())).collect()
}

#[test]
fn polygons_and_comments_are_read() {
    let (g, warnings) = read(SQUARE);
    assert_eq!(
        (g.face_sizes.as_deref(), g.corners.as_slice()),
        (Some(&[4, 3][..]), &[0, 1, 2, 3, 2, 1, 0][..])
    );
    assert!(g.wedges.is_none() && !g.positions.is_f64() && warnings.is_empty());
}

#[test]
fn the_header_may_share_its_line_or_be_missing() {
    let counts = SQUARE.split_once("4 2 0").unwrap().1;
    for head in ["OFF 4 2 5", "4 2 5", "OFF\r\n4 2", "\u{feff}OFF\n4 2 0"] {
        assert_eq!(read(&format!("{head}{counts}")).0.corners.len(), 7, "{head}");
    }
}

#[test]
fn vertex_colours_in_bytes_and_floats() {
    let file = |a: &str, b: &str, c: &str| format!("COFF\n3 1 0\n0 0 0 {a}\n1 0 0 {b}\n0 1 0 {c}\n3 0 1 2\n");
    let (g, _) = read(&file("255 0 0 255", "0 255 0 255", "0 0 51 0"));
    let third = Some(vec![0.0, 0.0, 0.2, 0.0]);
    assert_eq!(
        values(&g, Semantic::Color(0)),
        [Some(vec![1.0, 0.0, 0.0, 1.0]), Some(vec![0.0, 1.0, 0.0, 1.0]), third]
    );
    assert_eq!(g.wedges.as_ref().unwrap().channels()[0].encoding, Encoding::U8Norm);
    let (g, _) = read(&file("1 0 0", "0 0.5 0", "0 0 1"));
    assert_eq!(values(&g, Semantic::Color(0))[1], Some(vec![0.0, 0.5, 0.0]));
    let (g, _) = read(&file("1 0 0", "0 1 0", "0 0 1"));
    assert_eq!(values(&g, Semantic::Color(0))[0], Some(vec![1.0, 0.0, 0.0]));
    let (_, warnings) = read(&file("1 0 0", "0 1 0", "0 0 1").replace("COFF", "OFF"));
    assert_eq!(warnings, ["line 3 and 2 more: colours that the header does not announce (COFF) are read"]);
}

#[test]
fn normals_and_uvs_go_round() {
    let text = "STCNOFF\n3 1 0\n0 0 0 0 0 1 10 20 30 0.25 0.5\n1 0 0 0 1 0 1 2 3 1 0\n0 1 0 1 0 0 4 5 6 0 1\n3 0 1 2\n";
    let (g, warnings) = read(text);
    assert_eq!(values(&g, Semantic::Normal)[1], Some(vec![0.0, 1.0, 0.0]));
    assert_eq!(values(&g, Semantic::TexCoord(0))[0], Some(vec![0.25, 0.5]));
    assert_eq!(values(&g, Semantic::Color(0))[2], Some([4.0, 5.0, 6.0].map(|x| x / 255.0).to_vec()));
    assert!(warnings.is_empty());
    let e = write(g.clone());
    let (again, _) = read(std::str::from_utf8(&e.bytes).unwrap());
    assert_eq!((again.wedges, again.positions, e.warnings), (g.wedges, g.positions, vec![]));
}

#[test]
fn face_colours_become_those_of_the_corners_and_back() {
    let text = SQUARE.replace("4 0 1 2 3", "4 0 1 2 3 255 0 0").replace("3 2 1 0\n", "3 2 1 0 0 0 255\n");
    let (g, _) = read(&text);
    let (red, blue) = (Some(vec![1.0, 0.0, 0.0]), Some(vec![0.0, 0.0, 1.0]));
    let mut want = vec![red; 4];
    want.extend(vec![blue; 3]);
    assert_eq!(values(&g, Semantic::Color(0)), want);
    let e = write(g);
    assert!(String::from_utf8(e.bytes.clone()).unwrap().contains("4 0 1 2 3 255 0 0\n3 2 1 0 0 0 255\n"));
    assert!(e.warnings.is_empty());
    // One face without: its corners have none.
    let (g, _) = read(&SQUARE.replace("4 0 1 2 3", "4 0 1 2 3 255 0 0"));
    assert_eq!(values(&g, Semantic::Color(0))[4], None);
}

#[test]
fn two_corners_are_a_line_segment() {
    let (g, _) = read("OFF\n2 1 0\n0 0 0\n1 0 0\n2 0 1\n");
    assert_eq!((g.wires.as_slice(), g.face_count()), (&[[0, 1]][..], 0));
    assert_eq!(read(std::str::from_utf8(&write(g).bytes).unwrap()).0.wires, [[0, 1]]);
}

#[test]
fn what_is_left_out_is_said() {
    let (_, w) = read(&SQUARE.replace("4 0 1 2 3", "4 0 1 2 3 7").replace("3 2 1 0", "1 2\njunk"));
    assert_eq!(
        w,
        [
            "line 9: indices into a colour map are left out",
            "line 10: faces of fewer than two corners are left out",
            "line 11: what stands after the announced faces is left out"
        ]
    );
}

#[test]
fn errors_name_line_and_element() {
    assert_eq!(error(""), "line 1: the file is empty; an OFF file begins with OFF");
    assert_eq!(error("PLY\n"), "line 1: \"PLY\" where OFF should be");
    assert_eq!(
        error(&SQUARE.replace("4 0 1 2 3", "4 0 1 2 4")),
        "line 9: face 0, corner 3: vertex 4 of 4; indices run from 0"
    );
    assert_eq!(error(&SQUARE.replace("1 1 0", "1 nan 0")), "line 7: y is NaN; coordinates must be finite");
    assert_eq!(
        error(&SQUARE.replace("4 0 1 2 3", "4 0 1 -2 3")),
        "line 9: face 0: -2 is no whole number from 0"
    );
    assert!(error(&SQUARE.replace("4 2 0", "4 1000000000 0")).contains("the file ends in face 2"));
    assert!(error("OFF\n1000000000 0 0\n0 0 0\n").contains("the file ends in vertex 1"));
    let what = "4OFF (points of other than three dimensions)".to_string();
    assert_eq!(off::decode(b"4OFF\n").unwrap_err(), DecodeError::Unsupported { what });
}

fn binary() -> Vec<u8> {
    let mut b = b"COFF BINARY\n".to_vec();
    [3, 1, 0i32].iter().for_each(|x| b.extend(x.to_be_bytes()));
    for p in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0f32]] {
        p.iter().chain(&[0.5, 0.25, 1.0, 1.0]).for_each(|x| b.extend(x.to_be_bytes()));
    }
    [3, 0, 1, 2, 0i32].iter().for_each(|x| b.extend(x.to_be_bytes()));
    b
}

#[test]
fn binary_is_read_and_its_truncations_are_errors() {
    let mut d = off::decode(&binary()).unwrap();
    let g = d.scene.meshes.remove(0).geometry;
    assert_eq!((g.positions.len(), g.corners.as_slice()), (3, &[0, 1, 2][..]));
    assert_eq!(values(&g, Semantic::Color(0))[1], Some(vec![0.5, 0.25, 1.0, 1.0]));
    let b = binary();
    assert!((0..b.len()).all(|n| off::decode(&b[..n]).is_err()));
    let mut lying = b.clone();
    lying[12..16].copy_from_slice(&i32::MAX.to_be_bytes());
    assert!(off::decode(&lying).unwrap_err().to_string().contains("the file ends in vertex"));
}

#[test]
fn truncated_text_is_an_error_or_a_shorter_number() {
    let whole = SQUARE.rfind("0\n").unwrap();
    assert!((0..whole).all(|n| off::decode(&SQUARE.as_bytes()[..n]).is_err()));
}

#[test]
fn doubles_survive() {
    let positions = Positions::F64(vec![[0.1, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0 / 3.0, 0.0]]);
    let g = MeshInput { positions, corners: vec![0, 1, 2], ..Default::default() };
    let (again, _) = read(std::str::from_utf8(&write(g.clone()).bytes).unwrap());
    assert_eq!(again.positions, g.positions);
}

proptest! {
    #[test]
    fn polygons_go_round(
        points in prop::collection::vec(prop::array::uniform3(any::<f32>().prop_filter("finite", |x| x.is_finite())), 1..20),
        faces in prop::collection::vec(prop::collection::vec(any::<prop::sample::Index>(), 3..7), 0..20),
    ) {
        let sizes: Vec<u32> = faces.iter().map(|f| f.len() as u32).collect();
        let corners: Vec<u32> = faces.iter().flatten().map(|i| i.index(points.len()) as u32).collect();
        let g = MeshInput::polygons(points, &sizes, &corners);
        let (again, warnings) = read(std::str::from_utf8(&write(g.clone()).bytes).unwrap());
        prop_assert_eq!(&again.positions, &g.positions);
        prop_assert_eq!(&again.corners, &corners);
        prop_assert_eq!(again.face_sizes.unwrap_or(vec![3; again.corners.len() / 3]), sizes);
        prop_assert!(warnings.is_empty());
    }

    #[test]
    fn flipped_bytes_never_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        as_binary: bool,
    ) {
        let mut bytes = if as_binary { binary() } else { SQUARE.as_bytes().to_vec() };
        for (at, to) in flips {
            let i = at.index(bytes.len());
            bytes[i] = to;
        }
        if let Ok(d) = off::decode(&bytes) {
            let g = &d.scene.meshes[0].geometry;
            prop_assert!(g.corners.iter().all(|&v| (v as usize) < g.positions.len()));
            prop_assert!(g.wedges.as_ref().is_none_or(|w| w.corner.len() == g.corners.len()));
        }
    }
}
