//! PLY: round trips, every feature of the reader, errors, damaged files.

mod arbitrary;

use arbitrary::{Kinds, assert_same, mesh};
use progmesh::aif::{Channel, Encoding, MeshInput, NONE, Positions, Semantic, Wedges};
use progmesh::io::{Decoded, EncodeOptions, Encoded, Format, NoSide, decode, encode};
use progmesh::scene::{Image, Material, Scene, SceneMesh};
use proptest::prelude::*;

const TEXT: &[u8] = include_bytes!("corpus/ply/text.ply");
const LITTLE: &[u8] = include_bytes!("corpus/ply/little.ply");
const BIG: &[u8] = include_bytes!("corpus/ply/big.ply");

fn read(bytes: &[u8]) -> Decoded {
    decode(Format::Ply, bytes, &NoSide).unwrap()
}

fn fails(bytes: &[u8]) -> String {
    decode(Format::Ply, bytes, &NoSide).unwrap_err().to_string()
}

fn write(scene: &Scene, text: bool) -> Encoded {
    let mut options = EncodeOptions::default();
    options.text = text;
    options.stem = "out".into();
    encode(Format::Ply, scene, &options).unwrap()
}

fn scene(geometry: MeshInput) -> Scene {
    Scene::from_mesh(SceneMesh { geometry, ..Default::default() })
}

/// A text file: the header's element lines, and the data.
fn text(elements: &str, data: &str) -> Vec<u8> {
    format!("ply\nformat ascii 1.0\n{elements}\nend_header\n{data}").into_bytes()
}

const XYZ: &str = "element vertex 3\nproperty float x\nproperty float y\nproperty float z";
const POINTS: &str = "0 0 0\n1 0 0\n0 1 0\n";

const EVERY_ENCODING: &[Encoding] = &[
    Encoding::F32,
    Encoding::F64,
    Encoding::U8,
    Encoding::I8,
    Encoding::U16,
    Encoding::I16,
    Encoding::U32,
    Encoding::I32,
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn what_is_written_reads_back(input in mesh(Kinds { per_corner: false, custom: EVERY_ENCODING }), as_text: bool) {
        let out = write(&scene(input.clone()), as_text);
        prop_assert!(out.warnings.is_empty(), "{:?}", out.warnings);
        let again = read(&out.bytes);
        let got = &again.scene.meshes[0].geometry;
        assert_same(&input, got);
        if let (Some(a), Some(b)) = (&input.wedges, &got.wedges) {
            let stored = |w: &Wedges| -> Vec<Encoding> {
                let not_color = |c: &&Channel| !matches!(c.semantic, Semantic::Color(_));
                w.channels().iter().filter(not_color).map(|c| c.encoding).collect()
            };
            prop_assert_eq!(stored(a), stored(b));
        }
    }

    #[test]
    fn texture_coordinates_of_corners_read_back(input in mesh(Kinds { per_corner: true, custom: &[] })) {
        let out = write(&scene(input.clone()), false);
        let got = read(&out.bytes).scene.meshes.remove(0).geometry;
        for c in 0..input.corners.len() {
            if let Some(uv) = arbitrary::value(&input, c, &Semantic::TexCoord(0)) {
                prop_assert_eq!(Some(uv), arbitrary::value(&got, c, &Semantic::TexCoord(0)));
            }
        }
    }
}

#[test]
fn a_text_file_with_everything() {
    let d = read(TEXT);
    let g = &d.scene.meshes[0].geometry;
    assert_eq!(
        (g.positions.len(), g.face_sizes.clone(), g.wires.clone()),
        (5, Some(vec![3, 4]), vec![[3, 4]])
    );
    assert_eq!(g.face_material, [0, NONE]);
    let w = g.wedges.as_ref().unwrap();
    let k = w.channel(&Semantic::Color(0)).unwrap();
    assert_eq!(w.channels()[k].encoding, Encoding::U8Norm);
    assert_eq!(w.get(w.corner[1], k), Some(&[0.0, 1.0, 0.0][..]));
    let uv = w.channel(&Semantic::TexCoord(0)).unwrap();
    assert_eq!(
        (w.get(w.corner[2], uv), w.get(w.corner[5], uv)),
        (Some(&[1.0, 1.0][..]), Some(&[1.0, 1.0][..]))
    );
    let quality = w.channel(&Semantic::Custom("quality".into())).unwrap();
    assert_eq!((w.get(w.corner[0], quality), w.get(w.corner[2], quality)), (Some(&[0.5][..]), None));
    let extras = &d.scene.meshes[0].extras;
    assert_eq!((extras.of_faces[0].name.as_str(), g.face_row.len()), ("flags", 2));
    assert!(
        !extras.loose.vertices.is_empty() && extras.loose.vertices.iter().all(|v| !g.corners.contains(v))
    );
    for part in ["element camera", "fewer than three", "none.png", "not finite"] {
        assert!(d.warnings.iter().any(|x| x.contains(part)), "{part}: {:?}", d.warnings);
    }
}

#[test]
fn both_byte_orders_hold_the_same() {
    let (a, b) = (read(LITTLE), read(BIG));
    let (a, b) = (&a.scene.meshes[0].geometry, &b.scene.meshes[0].geometry);
    assert_eq!(
        (&a.positions, &a.corners, &a.face_sizes, &a.wedges),
        (&b.positions, &b.corners, &b.face_sizes, &b.wedges)
    );
    // The strip 0 1 2 3, restarted with 1 2 3; then the element face.
    assert_eq!(a.corners, [0, 1, 2, 2, 1, 3, 1, 2, 3, 0, 1, 2, 0, 1, 3, 2]);
    assert!(a.positions.is_f64(), "0.1 is a double");
    let w = a.wedges.as_ref().unwrap();
    assert_eq!(
        w.channels()[0],
        Channel { semantic: Semantic::Color(0), width: 4, encoding: Encoding::U16Norm }
    );
    assert_eq!(w.get(w.corner[3], 1), Some(&[0.0][..]), "level of vertex 2");
}

#[test]
fn strips_alternate_and_skip_what_is_degenerate() {
    let elements = format!("{XYZ}\nelement tristrips 1\nproperty list int int vertex_indices");
    let corners = |list: &str| {
        read(&text(&elements, &format!("{POINTS}{list}"))).scene.meshes[0].geometry.corners.clone()
    };
    assert_eq!(corners("4 0 1 2 0"), [0, 1, 2, 2, 1, 0]);
    // A vertex twice turns the strip.
    assert_eq!(corners("5 0 1 1 2 0"), [1, 2, 0]);
    assert_eq!(corners("7 -1 0 1 -1 0 1 2"), [0, 1, 2]);
}

#[test]
fn colours_of_faces_become_colours_of_corners_and_go_back() {
    let elements = format!(
        "{XYZ}\nelement face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha"
    );
    let d = read(&text(&elements, &format!("{POINTS}3 0 1 2 255 0 0 255\n3 0 2 1 0 51 0 0\n")));
    let g = &d.scene.meshes[0].geometry;
    let w = g.wedges.as_ref().unwrap();
    assert_eq!((w.len(), w.get(w.corner[5], 0)), (6, Some(&[0.0, 0.2, 0.0, 0.0][..])));
    let out = write(&d.scene, true);
    assert!(
        String::from_utf8_lossy(&out.bytes).contains("\n3 0 2 1 0 51 0 0\n"),
        "{}",
        String::from_utf8_lossy(&out.bytes)
    );
    assert_same(g, &read(&out.bytes).scene.meshes[0].geometry);
}

#[test]
fn normals_that_differ_between_corners_are_said_to_be_lost() {
    let mut g =
        MeshInput::triangles(vec![[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 1]]);
    let mut w = Wedges::new(vec![Channel::new(Semantic::Normal, 3)]).unwrap();
    w.push(&[0.0, 0.0, 1.0], 1);
    w.push(&[0.0, 0.0, -1.0], 1);
    w.corner = vec![0, 0, 0, 1, 1, 1];
    g.wedges = Some(w);
    let out = write(&scene(g), true);
    assert_eq!(
        out.warnings,
        ["nx, ny, nz differ between corners of a vertex: the first corner's are written"]
    );
    assert_eq!(read(&out.bytes).scene.meshes[0].geometry.positions.len(), 3);
}

#[test]
fn textures_go_through_with_their_files() {
    let mut g =
        MeshInput::triangles(vec![[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 1]]);
    let mut w = Wedges::new(vec![Channel::new(Semantic::TexCoord(0), 2)]).unwrap();
    (0..3).for_each(|i| {
        w.push(&[i as f32, 0.5], 1);
    });
    w.corner = vec![0, 1, 2, 0, 2, 1];
    g.wedges = Some(w);
    g.face_material = vec![0, 1];
    let mut s = scene(g);
    for name in ["a.png", "b.png"] {
        s.materials.push(Material {
            name: name.into(),
            base_color_image: Some(s.images.len()),
            ..Default::default()
        });
        s.images.push(Image { uri: Some(name.into()), data: Some(name.into()), ..Default::default() });
    }
    let out = write(&s, false);
    assert_eq!((out.side.len(), out.warnings.len()), (2, 0));
    let d = read(&out.bytes);
    assert_eq!(d.scene.meshes[0].geometry.face_material, [0, 1]);
    assert_eq!(d.scene.images[1].uri.as_deref(), Some("b.png"));
    assert_same(&s.meshes[0].geometry, &d.scene.meshes[0].geometry);
}

#[test]
fn precision_is_that_of_the_declaration_and_the_digits() {
    let of = |ty: &str, x: &str| {
        let elements = format!("element vertex 1\nproperty {ty} x\nproperty {ty} y\nproperty {ty} z");
        read(&text(&elements, &format!("{x} 0 0\n"))).scene.meshes[0].geometry.positions.clone()
    };
    assert_eq!(of("float", "0.08156099999999999"), Positions::F32(vec![[0.081561, 0.0, 0.0]]));
    assert_eq!(
        of("double", "0.08156099999999999"),
        Positions::F64(vec![["0.08156099999999999".parse().unwrap(), 0.0, 0.0]])
    );
    assert_eq!(of("double", "0.1"), Positions::F32(vec![[0.1, 0.0, 0.0]]));
    assert_eq!(of("int", "16777217"), Positions::F64(vec![[16777217.0, 0.0, 0.0]]));
}

#[test]
fn errors_name_the_element_and_the_line() {
    let face = format!("{XYZ}\nelement face 1\nproperty list char int vertex_indices");
    for (bytes, want) in [
        (text(XYZ, "0 0 0\n1 0 nan\n0 0 0"), "line 9: vertex 1: z is NaN; coordinates must be finite"),
        (text(XYZ, "0 0 0\n1 0 0\n0 0 inf"), "line 10: vertex 2: z is inf; coordinates must be finite"),
        (text(XYZ, "0 0 0\n1 x 0\n0 0 0"), "line 9: float: \"x\" is no number"),
        (text(XYZ, "0.0000 0.0000 0.0000\n1 0\n"), "line 10: vertex 1: the data end early (3 are announced)"),
        (
            text(&face, &format!("{POINTS}3 0 1 3")),
            "line 13: face 0: vertex index 3 of 3; indices run from 0 to one less",
        ),
        (text(&face, &format!("{POINTS}3 0 -1 2")), "line 13: face 0: vertex index -1 of 3"),
        (text(&face, &format!("{POINTS}-3 0 1 2")), "line 13: face 0: a list of -3 items"),
        (text("element face 0\nproperty list uchar int vertex_indices", ""), "header: no element vertex"),
        (
            text("element vertex 0\nproperty float x\nproperty float y", ""),
            "header: element vertex has no property z",
        ),
        (
            text("element vertex 5000000000\nproperty float x", ""),
            "header: 5000000000 vertices; ids can name 4294967294",
        ),
    ] {
        let got = fails(&bytes);
        assert!(got.starts_with(want), "{got}\nwanted: {want}");
    }
    let cut = &LITTLE[..LITTLE.len() - 3];
    assert_eq!(fails(cut), "face 1: the data end early (2 are announced)");
    let mut nan = LITTLE.to_vec();
    let x = nan.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    nan[x..x + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    assert_eq!(fails(&nan), "vertex 0: x is NaN; coordinates must be finite");
}

#[test]
fn announced_elements_that_are_not_there_are_refused_at_once() {
    let got = fails(include_bytes!("corpus/ply/billion.ply"));
    assert!(got.starts_with("element vertex: 1000000000 are announced, but the data end early"), "{got}");
    let got = fails(include_bytes!("corpus/ply/endless.ply"));
    assert!(got.contains("face 0: the data end early"), "{got}");
    let many = format!("{XYZ}\nelement face 4000000000\nproperty list uchar int vertex_indices");
    assert!(fails(&text(&many, POINTS)).starts_with("element face: 4000000000 are announced"));
}

#[test]
fn damaged_files_never_panic() {
    for file in [TEXT, LITTLE, BIG] {
        arbitrary::mangle(Format::Ply, file);
    }
}
