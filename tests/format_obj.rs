//! OBJ and MTL: round trips, an independent reader as oracle, side files, damaged files.

mod arbitrary;

use arbitrary::{Kinds, assert_same, mesh};
use progmesh::aif::{MeshInput, NONE, Positions, Semantic};
use progmesh::io::{Decoded, EncodeOptions, Encoded, Format, NoSide, Side, decode, encode};
use progmesh::scene::{Group, Image, Material, Node, Scene, SceneMesh};
use proptest::prelude::*;
use std::collections::BTreeMap;

const EVERYTHING: &str = include_str!("corpus/obj/everything.obj");

/// Files held in memory.
#[derive(Default)]
struct Files(BTreeMap<String, Vec<u8>>);

impl Side for Files {
    fn load(&self, name: &str) -> std::io::Result<Vec<u8>> {
        self.0.get(name).cloned().ok_or_else(|| std::io::Error::from(std::io::ErrorKind::NotFound))
    }
}

fn files(list: &[(&str, &str)]) -> Files {
    Files(list.iter().map(|(n, b)| (n.to_string(), b.as_bytes().to_vec())).collect())
}

fn write(scene: &Scene) -> Encoded {
    let mut options = EncodeOptions::default();
    options.stem = "out".into();
    encode(Format::Obj, scene, &options).unwrap()
}

fn read(bytes: &[u8], side: &dyn Side) -> Decoded {
    decode(Format::Obj, bytes, side).unwrap()
}

/// Writes a scene and reads it, its side files included.
fn round_trip(scene: &Scene) -> Decoded {
    let out = write(scene);
    read(&out.bytes, &Files(out.side.into_iter().collect()))
}

fn scene(geometry: MeshInput) -> Scene {
    Scene::from_mesh(SceneMesh { geometry, ..Default::default() })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn what_is_written_reads_back(input in mesh(Kinds { per_corner: true, custom: &[] })) {
        let out = write(&scene(input.clone()));
        prop_assert!(out.warnings.is_empty(), "{:?}", out.warnings);
        let again = read(&out.bytes, &NoSide);
        assert_same(&input, &again.scene.meshes[0].geometry);
    }

    #[test]
    fn groups_and_materials_read_back(
        picks in prop::collection::vec((0u32..4, 0u32..4), 1..12),
        names in prop::collection::vec("[a-z][a-z0-9_.]{0,6}", 9),
    ) {
        let group = |k: usize| Group {
            object: (k > 0).then(|| names[k].clone()),
            names: names[3 * k..3 * k + k].to_vec(),
            smoothing: Some(k.to_string()),
            primitive: None,
        };
        let groups: Vec<Group> = (0..3).map(group).collect();
        let mut input = MeshInput::triangles(vec![[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &vec![[0, 1, 2]; picks.len()]);
        let or_none = |k: u32| if k == 3 { NONE } else { k };
        input.face_group = picks.iter().map(|p| or_none(p.0)).collect();
        input.face_material = picks.iter().map(|p| or_none(p.1)).collect();
        let mut s = Scene::from_mesh(SceneMesh { name: None, geometry: input, groups, ..Default::default() });
        s.materials = (0..3).map(|k| Material { name: format!("{}{k}", names[k]), ..Default::default() }).collect();
        let d = round_trip(&s);
        let (a, b) = (&s.meshes[0], &d.scene.meshes[0]);
        let material = |s: &Scene, m: &SceneMesh, f: usize| {
            m.geometry.face_material.get(f).and_then(|&i| s.materials.get(i as usize)).map(|m| m.name.clone())
        };
        for f in 0..picks.len() {
            let of = |m: &SceneMesh| m.geometry.face_group.get(f).and_then(|&g| m.groups.get(g as usize)).cloned();
            let (wrote, got) = (of(a).unwrap_or_default(), of(b).unwrap_or_default());
            prop_assert_eq!((&wrote.object, &wrote.names), (&got.object, &got.names));
            if wrote.smoothing.is_some() {
                prop_assert_eq!(wrote.smoothing, got.smoothing);
            }
            prop_assert_eq!(material(&s, a, f), material(&d.scene, b, f));
        }
    }

    /// tobj is right on files without unused vertices, in one group and in single precision.
    #[test]
    fn an_independent_reader_agrees(mut input in mesh(Kinds { per_corner: true, custom: &[] })) {
        prop_assume!(!input.corners.is_empty());
        let single = input.positions.iter().map(|p| p.to_array().map(|x| (x as f32).clamp(-f32::MAX, f32::MAX))).collect();
        input.positions = Positions::F32(single);
        input.wires.clear();
        if let Some(w) = &mut input.wedges
            && let Some(k) = w.channel(&Semantic::Color(0))
        {
            // Colours of some vertices only are beyond it.
            w.remove_channel(k);
        }
        let text = write(&scene(input)).bytes;
        let ours = read(&text, &NoSide).scene.meshes.remove(0).geometry;
        let options = tobj::LoadOptions::default();
        let Ok((models, _)) = tobj::load_obj_buf(&mut &text[..], &options, |_| Err(tobj::LoadError::ReadError)) else {
            return Err(TestCaseError::reject("it cannot read corners of unequal kinds"));
        };
        prop_assert_eq!(models.len(), 1);
        let theirs = &models[0].mesh;
        prop_assert_eq!(theirs.indices.len(), ours.corners.len());
        let sizes = if theirs.face_arities.is_empty() { vec![3; ours.corners.len() / 3] } else { theirs.face_arities.clone() };
        prop_assert_eq!(&sizes, &ours.face_sizes.clone().unwrap_or(vec![3; ours.corners.len() / 3]));
        for c in 0..ours.corners.len() {
            let v = 3 * theirs.indices[c] as usize;
            let p = ours.positions.get(ours.corners[c] as usize).to_array().map(|x| x as f32);
            prop_assert_eq!(&theirs.positions[v..v + 3], &p[..]);
            for (list, indices, width, semantic) in [
                (&theirs.texcoords, &theirs.texcoord_indices, 2, Semantic::TexCoord(0)),
                (&theirs.normals, &theirs.normal_indices, 3, Semantic::Normal),
            ] {
                // It has a list for all corners or one that does not run parallel to them.
                if indices.len() == ours.corners.len() {
                    let i = width * indices[c] as usize;
                    let want: Vec<u32> = list[i..i + width].iter().map(|x| x.to_bits()).collect();
                    if let Some(got) = arbitrary::value(&ours, c, &semantic) {
                        prop_assert_eq!(got, want);
                    }
                }
            }
        }
    }
}

#[test]
fn every_statement_is_read_and_written_again() {
    let d = read(EVERYTHING.as_bytes(), &NoSide);
    let m = &d.scene.meshes[0];
    assert_eq!((m.geometry.positions.len(), m.geometry.face_count(), m.geometry.wires.len()), (7, 5, 2));
    let again = round_trip(&d.scene);
    assert_same(&m.geometry, &again.scene.meshes[0].geometry);
    assert_eq!(m.groups, again.scene.meshes[0].groups);
    // And what was written is stable.
    let text = write(&d.scene).bytes;
    assert_eq!(String::from_utf8_lossy(&text), String::from_utf8_lossy(&write(&again.scene).bytes));
}

#[test]
fn a_material_library_with_its_texture_goes_through() {
    let mtl = "# c\nnewmtl a b\n\tKd 0.5 0.25 1\n d 0.5\nPr 0.75\nmap_Kd -s 2 2 2 sub\\tex one.png\nnorm n.png\nnewmtl bad\nKd x\nKe 1 2 3\n";
    let side = files(&[("lib/m.mtl", mtl), ("lib/sub/tex one.png", "\u{89}PNG"), ("n.png", "n")]);
    let obj = b"mtllib lib/m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a b\nf 1 2 3\nusemtl bad\nf 1 2 3\n";
    let d = read(obj, &side);
    let m = &d.scene.materials[0];
    assert_eq!((m.name.as_str(), m.base_color, m.roughness), ("a b", [0.5, 0.25, 1.0, 0.5], 0.75));
    assert_eq!((m.base_color_image, m.normal_image, d.scene.images.len()), (Some(0), Some(1), 2));
    assert_eq!(d.scene.materials[1].emissive, [1.0, 2.0, 3.0]);
    assert_eq!(d.warnings, ["lib/m.mtl: material \"bad\" has statements that are wrong; they are left out"]);

    let out = write(&d.scene);
    let names: Vec<&str> = out.side.iter().map(|s| s.0.as_str()).collect();
    assert_eq!(names, ["out.mtl", "sub/tex one.png", "n.png"]);
    let text = String::from_utf8(out.side[0].1.clone()).unwrap();
    assert!(
        text.contains("Kd 0.5 0.25 1\nd 0.5\n") && text.contains("map_Kd -s 2 2 2 sub/tex one.png\n"),
        "{text}"
    );
    let again = round_trip(&d.scene);
    assert_eq!(again.scene.images[0].data, d.scene.images[0].data);
    assert_eq!(again.scene.meshes[0].geometry.face_material, [0, 1]);
}

#[test]
fn materials_of_other_formats_are_written_from_their_fields() {
    let mut s =
        scene(MeshInput::triangles(vec![[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]));
    s.meshes[0].geometry.face_material = vec![0];
    s.images.push(Image { mime: Some("image/jpeg".into()), data: Some(vec![1, 2]), ..Default::default() });
    s.materials.push(Material {
        name: "m\nx\\".into(),
        base_color: [0.1, 0.2, 0.3, 0.4],
        base_color_image: Some(0),
        metallic: 0.5,
        roughness: 0.3,
        emissive: [0.0, 1.0, 0.0],
        ..Default::default()
    });
    let d = round_trip(&s);
    let (a, b) = (&s.materials[0], &d.scene.materials[0]);
    assert_eq!(
        (a.base_color, a.metallic, a.roughness, a.emissive),
        (b.base_color, b.metallic, b.roughness, b.emissive)
    );
    assert_eq!((b.name.as_str(), d.scene.images[0].uri.as_deref()), ("m_x_", Some("out_0.jpg")));
    assert_eq!(d.scene.images[0].data, s.images[0].data);
}

#[test]
fn what_is_missing_is_said_and_hurts_nothing() {
    let d = read(b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n", &NoSide);
    assert_eq!(d.warnings.len(), 2, "{:?}", d.warnings);
    assert!(d.warnings[0].starts_with("a.mtl could not be read"));
    let d = read(b"mtllib a.mtl\n", &files(&[("a.mtl", "newmtl m\nmap_Kd gone.png\n")]));
    assert!(d.warnings[0].starts_with("texture gone.png could not be read"), "{:?}", d.warnings);
    assert_eq!((d.scene.images[0].data.is_none(), d.scene.materials.len()), (true, 1));
    assert_eq!(read(b"", &NoSide).scene.meshes[0].geometry.positions.len(), 0);
}

#[test]
fn several_nodes_become_objects_in_world_space() {
    let mut s =
        scene(MeshInput::triangles(vec![[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]));
    let transform = glam::DMat4::from_translation(glam::DVec3::new(0.5, 0.0, 0.0));
    s.nodes.push(Node { name: Some("moved".into()), transform, mesh: Some(0), children: vec![] });
    s.roots.push(1);
    let out = write(&s);
    let text = String::from_utf8(out.bytes).unwrap();
    assert_eq!(
        text,
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0.5 0 0\nv 1.5 0 0\nv 0.5 1 0\no mesh0\nf 1 2 3\no moved\nf 4 5 6\n"
    );
    assert_eq!(out.warnings.len(), 2, "{:?}", out.warnings);
}

#[test]
fn damaged_files_never_panic() {
    arbitrary::mangle(Format::Obj, EVERYTHING.as_bytes());
    // MTL too.
    let mtl = b"newmtl a\nKd 1 1 1\nmap_Kd -o 1 2 -s 1 t.png\nbump -bm 1 b.png\nTr 0.5\nPm 1\n";
    for n in 0..mtl.len() {
        for flip in 0..8 {
            let mut bad = mtl.to_vec();
            bad[n] ^= 1 << flip;
            let side = Files([("m".to_string(), bad)].into());
            read(b"mtllib m\n", &side);
        }
    }
}

#[test]
fn what_obj_cannot_hold_is_said_once() {
    use progmesh::aif::{Channel, Wedges};
    let mut g = MeshInput::triangles(vec![[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]);
    let channels = [
        (Semantic::Tangent, 4),
        (Semantic::TexCoord(1), 2),
        (Semantic::TexCoord(2), 2),
        (Semantic::Color(0), 4),
        (Semantic::Joints(0), 4),
        (Semantic::Weights(0), 4),
        (Semantic::MorphPosition(0), 3),
        (Semantic::MorphPosition(1), 3),
        (Semantic::Custom("heat".into()), 1),
    ];
    let mut w = Wedges::new(channels.map(|(s, n)| Channel::new(s, n)).to_vec()).unwrap();
    w.push(&vec![0.5; w.stride()], u64::MAX >> (64 - 9));
    w.corner = vec![0; 3];
    g.wedges = Some(w);
    let out = write(&scene(g));
    let want = [
        "OBJ cannot hold tangents",
        "OBJ cannot hold a second set of texture coordinates",
        "OBJ cannot hold joints and weights",
        "OBJ cannot hold morph targets",
        "OBJ cannot hold the attribute heat",
        "OBJ cannot hold the alpha of vertex colours",
    ];
    assert_eq!(out.warnings, want);
    assert!(String::from_utf8_lossy(&out.bytes).starts_with("v 0 0 0 0.5 0.5 0.5\n"));
}

#[test]
fn doubles_whose_digits_look_single_stay_double() {
    let p = Positions::F64(vec![[0.1, 0.2, 0.5], [1.0, 0.0, 0.0], [0.0, 1.0, 0.3]]);
    let out = write(&scene(MeshInput::triangles(p.clone(), &[[0, 1, 2]])));
    assert_eq!(read(&out.bytes, &NoSide).scene.meshes[0].geometry.positions, p);
}
