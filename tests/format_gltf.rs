//! glTF in and out: what is read, and what a document keeps.

mod common_gltf;

use common_gltf::*;
use progmesh::aif::{Channel, Encoding, MeshInput, NONE, Positions, Semantic, Wedges};
use progmesh::io::{self, Format, NoSide};
use progmesh::scene::{Image, Material, Node, Scene, SceneMesh};
use serde_json::{Value, json};

/// Keeps the faces for which `keep` says so.
fn filter_faces(scene: &mut Scene, mesh: usize, keep: impl Fn(usize) -> bool) {
    let g = &mut scene.meshes[mesh].geometry;
    let faces: Vec<usize> = (0..g.face_count()).filter(|&f| keep(f)).collect();
    let triples =
        |list: &[u32]| faces.iter().flat_map(|&f| list[3 * f..3 * f + 3].to_vec()).collect::<Vec<_>>();
    g.corners = triples(&g.corners);
    if let Some(w) = &mut g.wedges {
        w.corner = triples(&w.corner);
    }
    for list in [&mut g.face_group, &mut g.face_material] {
        if !list.is_empty() {
            *list = faces.iter().map(|&f| list[f]).collect();
        }
    }
}

#[test]
fn lists_strips_and_fans_make_the_same_surface() {
    for (mode, indices) in [(4, vec![0u16, 1, 2, 0, 2, 3]), (5, vec![1, 2, 0, 3]), (6, vec![0, 1, 2, 3])] {
        let mut b = square();
        let i = b.indices(&indices);
        b.doc["meshes"][0]["primitives"][0]["indices"] = json!(i);
        b.doc["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        let d = b.decode();
        let mut area = 0.0;
        for t in soup(&d.scene, 0).as_chunks::<3>().0 {
            let [a, b, c] = t.map(glam::DVec3::from_array);
            area += (b - a).cross(c - a).z / 2.0;
        }
        assert_eq!((d.scene.meshes[0].geometry.face_count(), area), (2, 1.0), "mode {mode}");
    }
}

#[test]
fn a_strip_that_turns_round_has_no_faces_there() {
    let mut b = square();
    let i = b.indices(&[0, 1, 2, 2, 3, 3, 0]);
    b.doc["meshes"][0]["primitives"][0]["indices"] = json!(i);
    b.doc["meshes"][0]["primitives"][0]["mode"] = json!(5);
    assert_eq!(b.decode().scene.meshes[0].geometry.face_count(), 1);
}

#[test]
fn indices_of_every_width_and_none_are_read() {
    let want = soup(&square().decode().scene, 0);
    let list = [0u32, 1, 2, 0, 2, 3];
    for (code, bytes) in [
        (5121, list.iter().map(|&i| i as u8).collect::<Vec<u8>>()),
        (5125, list.iter().flat_map(|i| i.to_le_bytes()).collect()),
    ] {
        let mut b = square();
        let i = b.accessor(&bytes, code, 6, "SCALAR", json!({}));
        b.doc["meshes"][0]["primitives"][0]["indices"] = json!(i);
        assert_eq!(soup(&b.decode().scene, 0), want);
    }
    let mut b = square();
    let p = b.positions(&list.map(|i| SQUARE[i as usize]));
    b.doc["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": p}});
    let d = b.decode();
    assert_eq!(soup(&d.scene, 0), want);
    assert_eq!(d.scene.meshes[0].geometry.positions.len(), 4, "bit-equal positions are one vertex");
}

#[test]
fn primitives_of_a_mesh_share_vertices_and_keep_materials_and_groups() {
    let mut b = square();
    let (p, q) = (b.positions(&SQUARE[..3]), b.positions(&[SQUARE[0], SQUARE[2], SQUARE[3]]));
    b.doc["materials"] = json!([{"name": "red"}, {"name": "blue"}]);
    b.doc["meshes"][0]["primitives"] = json!([
        {"attributes": {"POSITION": p}, "material": 1},
        {"attributes": {"POSITION": q}, "material": 0, "extras": {"kept": true}},
    ]);
    let d = b.decode();
    let g = &d.scene.meshes[0].geometry;
    assert_eq!((g.positions.len(), &g.face_material[..], &g.face_group[..]), (4, &[1, 0][..], &[0, 1][..]));
    assert_eq!(d.scene.meshes[0].groups[1].primitive, Some(1));
    let out = encode(Format::Glb, &d.scene);
    let (doc, _) = open(&out.bytes);
    let primitives = doc["meshes"][0]["primitives"].as_array().unwrap();
    assert_eq!(primitives.iter().map(|p| p["material"].as_u64()).collect::<Vec<_>>(), [Some(1), Some(0)]);
    assert_eq!(primitives[1]["extras"], json!({"kept": true}));
    assert_valid(&out.bytes);
}

#[test]
fn strides_interleave_and_quantized_values_become_floats() {
    let mut b = Build::default();
    // Per vertex: position 3 x u16 normalized + 2 bytes, normal 3 x i8 normalized + 1, uv 2 x u16 as they are.
    let mut bytes = Vec::new();
    for (p, uv) in [([0u16, 0, 0], [0u16, 4095]), ([65535, 0, 0], [7, 1]), ([0, 65535, 0], [3, 2])] {
        bytes.extend(u16s(&p));
        bytes.extend([0, 0, 0, 0, 127, 99]);
        bytes.extend(u16s(&uv));
    }
    let v = b.view(&bytes, json!({"byteStride": 16}));
    let at = |o: usize| json!({"bufferView": v, "byteOffset": o});
    let p = b.accessor_of(
        at(0),
        5123,
        3,
        "VEC3",
        json!({"normalized": true, "min": [0, 0, 0], "max": [1, 1, 0]}),
    );
    let n = b.accessor_of(at(8), 5120, 3, "VEC3", json!({"normalized": true}));
    let t = b.accessor_of(at(12), 5123, 3, "VEC2", json!({}));
    b.doc["meshes"] =
        json!([{"primitives": [{"attributes": {"POSITION": p, "NORMAL": n, "TEXCOORD_0": t}}]}]);
    b.doc["extensionsUsed"] = json!(["KHR_mesh_quantization", "KHR_texture_transform"]);
    b.doc["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let d = b.decode();
    assert_eq!(soup(&d.scene, 0), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let w = d.scene.meshes[0].geometry.wedges.as_ref().unwrap();
    assert_eq!(w.get(0, w.channel(&Semantic::Normal).unwrap()), Some(&[0.0, 0.0, 1.0][..]));
    assert_eq!(w.get(0, w.channel(&Semantic::TexCoord(0)).unwrap()), Some(&[0.0, 4095.0][..]));
    let out = encode(Format::Glb, &d.scene);
    let (doc, _) = open(&out.bytes);
    assert_eq!(
        (&doc["extensionsUsed"], &doc["extensionsRequired"]),
        (&json!(["KHR_texture_transform"]), &Value::Null)
    );
    assert_valid(&out.bytes);
    assert_eq!(soup(&decode(&out.bytes).scene, 0), soup(&d.scene, 0));
}

#[test]
fn sparse_accessors_replace_elements_of_a_base_or_of_zeros() {
    let mut b = square();
    let (i, v) =
        (b.view(&u16s(&[1, 3]), json!({})), b.view(&f32s(&[5.0, 0.0, 0.0, 0.0, 7.0, 0.0]), json!({})));
    let sparse =
        json!({"count": 2, "indices": {"bufferView": i, "componentType": 5123}, "values": {"bufferView": v}});
    b.doc["accessors"][0]["sparse"] = sparse.clone();
    assert_eq!(soup(&b.decode().scene, 0)[1], [5.0, 0.0, 0.0]);
    assert_eq!(soup(&b.decode().scene, 0)[5], [0.0, 7.0, 0.0]);
    b.doc["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(soup(&b.decode().scene, 0)[2], [0.0; 3]);
    b.doc["accessors"][0]["sparse"]["count"] = json!(5);
    assert_eq!(b.error(), "accessors[0].sparse: count 5: must be 1 to 4, the accessor's count");
}

#[test]
fn compressed_views_are_decoded_and_written_plain() {
    for extension in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let mut b = square();
        let positions: Vec<[f32; 4]> = SQUARE.iter().map(|p| [p[0], p[1], p[2], 0.0]).collect();
        let (p, i) = (
            meshopt::encoding::encode_vertex_buffer_level(&positions, 2, Some(0)).unwrap(),
            meshopt::encoding::encode_index_buffer(&[0, 1, 2, 0, 2, 3], 4).unwrap(),
        );
        let mut compress = |view: usize, stream: &[u8], stride: usize, count: usize, mode: &str| {
            let of = b.view(stream, json!({}));
            let mut packed = b.doc["bufferViews"][of].clone();
            packed.as_object_mut().unwrap().extend(
                json!({"byteStride": stride, "count": count, "mode": mode}).as_object().unwrap().clone(),
            );
            b.doc["bufferViews"][view] =
                json!({"buffer": 1, "byteLength": stride * count, "extensions": {extension: packed}});
        };
        compress(0, &p, 16, 4, "ATTRIBUTES");
        compress(1, &i, 2, 6, "TRIANGLES");
        b.doc["bufferViews"][0]["byteStride"] = json!(16);
        let fallback = json!({"byteLength": 100, "extensions": {extension: {"fallback": true}}});
        b.doc["buffers"].as_array_mut().unwrap().push(fallback);
        b.doc["extensionsUsed"] = json!([extension]);
        b.doc["extensionsRequired"] = json!([extension]);
        let d = b.decode();
        assert_eq!(soup(&d.scene, 0), soup(&square().decode().scene, 0));
        let out = encode(Format::Glb, &d.scene);
        assert_valid(&out.bytes);
        assert!(!String::from_utf8_lossy(&out.bytes).contains("meshopt"));
        assert_eq!(soup(&decode(&out.bytes).scene, 0), soup(&d.scene, 0));
    }
}

#[test]
fn buffers_come_from_files_and_data_uris() {
    use base64::Engine;
    let want = soup(&square().decode().scene, 0);
    let (json, bin) = square().gltf("my%20mesh.bin");
    let files = Files([("my mesh.bin".to_string(), bin.clone())].into());
    assert_eq!(soup(&io::decode(Format::Gltf, &json, &files).unwrap().scene, 0), want);
    let e = io::decode(Format::Gltf, &json, &NoSide).unwrap_err().to_string();
    assert!(e.starts_with("my%20mesh.bin: "), "{e}");
    let uri =
        format!("data:application/octet-stream;base64,{}", base64::prelude::BASE64_STANDARD.encode(&bin));
    assert_eq!(soup(&io::decode(Format::Gltf, &square().gltf(&uri).0, &NoSide).unwrap().scene, 0), want);

    // And out again: the buffer goes beside the file.
    let d = square().decode();
    let out = encode(Format::Gltf, &d.scene);
    assert_eq!(out.side[0].0, "out.bin");
    let files = Files(out.side.into_iter().collect());
    assert_eq!(soup(&io::decode(Format::Gltf, &out.bytes, &files).unwrap().scene, 0), want);
}

/// A document with everything that is no surface.
fn furnished() -> Build {
    let mut b = square();
    let skin = b.floats(&glam::Mat4::IDENTITY.to_cols_array(), "MAT4", 16);
    let times = b.accessor(&f32s(&[0.0, 1.0]), 5126, 2, "SCALAR", json!({"min": [0.0], "max": [1.0]}));
    let moves = b.floats(&[0.0, 0.0, 0.0, 1.0, 2.0, 3.0], "VEC3", 3);
    let offsets = b.floats(&[4.0, 5.0, 6.0, 7.0, 8.0, 9.0], "VEC3", 3);
    let lines = b.positions(&[[9.0, 9.0, 9.0], [8.0, 8.0, 8.0]]);
    let image = b.view(b"\x89PNG\r\n\x1a\nnot really", json!({"name": "pixels"}));
    b.doc["buffers"][0]["extras"] = json!({"of": "the buffer"});
    b.doc["images"] = json!([{"bufferView": image, "mimeType": "image/png", "name": "bark"}]);
    b.doc["samplers"] = json!([{"wrapS": 33071}]);
    b.doc["textures"] = json!([{"source": 0, "sampler": 0}]);
    b.doc["materials"] = json!([{
        "name": "wood",
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2.0, 0.30000000000000004]}}}},
        "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.1}},
        "extras": {"n": [1, 2.50, "x"]},
    }]);
    b.doc["extensionsUsed"] = json!([
        "KHR_materials_clearcoat",
        "KHR_texture_transform",
        "EXT_mesh_gpu_instancing",
        "KHR_lights_punctual"
    ]);
    b.doc["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "name": "lamp"}]}});
    b.doc["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.01}}]);
    b.doc["meshes"][0]["name"] = json!("panel");
    b.doc["meshes"][0]["extras"] = json!({"targetNames": ["smile"]});
    b.doc["meshes"][0]["primitives"][0]["material"] = json!(0);
    b.doc["meshes"][0]["primitives"]
        .as_array_mut()
        .unwrap()
        .push(json!({"attributes": {"POSITION": lines}, "mode": 1}));
    b.doc["skins"] = json!([{"joints": [1], "inverseBindMatrices": skin}]);
    b.doc["nodes"] = json!([
        {"name": "a", "mesh": 0, "translation": [1, 2, 3], "extras": {"id": 7}},
        {"name": "bone", "rotation": [0, 0, 0, 1], "camera": 0, "children": [2]},
        {"mesh": 0, "matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1]},
        {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": offsets}}}},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}},
    ]);
    b.doc["scenes"] = json!([{"name": "main", "nodes": [0, 1, 3, 4]}, {"nodes": [1]}]);
    b.doc["animations"] = json!([{
        "samplers": [{"input": times, "output": moves}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
    }]);
    b
}

#[test]
fn everything_but_the_surfaces_is_carried_through() {
    let b = furnished();
    let d = b.decode();
    assert_eq!(d.warnings, Vec::<String>::new());
    let out = encode(Format::Glb, &d.scene);
    assert_eq!(out.warnings, Vec::<String>::new());
    assert_valid(&out.bytes);
    let (doc, bin) = open(&out.bytes);
    let (old, old_bin) = open(&b.glb());
    let same = [
        "asset",
        "samplers",
        "textures",
        "materials",
        "extensionsUsed",
        "extensions",
        "cameras",
        "scenes",
        "scene",
    ];
    for key in same {
        assert_eq!(doc[key], old[key], "{key}");
    }
    assert_eq!(doc["materials"].to_string(), old["materials"].to_string(), "numbers as written");
    assert_eq!(doc["buffers"][0]["extras"], json!({"of": "the buffer"}));
    for key in ["name", "extras"] {
        assert_eq!(doc["meshes"][0][key], old["meshes"][0][key]);
    }
    for n in [0, 1, 2, 4] {
        assert_eq!(doc["nodes"][n], old["nodes"][n]);
    }
    // What refers to accessors refers to the same data.
    for path in [
        "/animations/0/samplers/0/input",
        "/animations/0/samplers/0/output",
        "/skins/0/inverseBindMatrices",
        "/nodes/3/extensions/EXT_mesh_gpu_instancing/attributes/TRANSLATION",
        "/meshes/0/primitives/1/attributes/POSITION",
    ] {
        let at = |doc: &Value| doc.pointer(path).unwrap().as_u64().unwrap() as usize;
        assert_eq!(elements(&doc, &bin, at(&doc)), elements(&old, &old_bin, at(&old)), "{path}");
    }
    assert_eq!(doc["meshes"][0]["primitives"][1]["mode"], 1);
    let view = &doc["bufferViews"][doc["images"][0]["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    assert_eq!(view["name"], "pixels");
    assert_eq!(
        &bin[start..start + view["byteLength"].as_u64().unwrap() as usize],
        b"\x89PNG\r\n\x1a\nnot really"
    );
    // No data of the old surface is left: one position and one index accessor are written anew.
    assert_eq!(doc["accessors"].as_array().unwrap().len(), old["accessors"].as_array().unwrap().len());
    assert_eq!(
        (d.scene.nodes.len(), d.scene.roots.clone()),
        (5, vec![0, 1, 3, 4]),
        "instances stay instances"
    );
    assert_eq!(d.scene.nodes.iter().filter(|n| n.mesh == Some(0)).count(), 3);
}

#[test]
fn writing_twice_changes_nothing_more() {
    let once = encode(Format::Glb, &furnished().decode().scene).bytes;
    let (a, _) = open(&once);
    let (b, _) = open(&encode(Format::Glb, &decode(&once).scene).bytes);
    for (key, value) in a.as_object().unwrap() {
        if !["bufferViews", "accessors", "buffers"].contains(&key.as_str()) {
            assert_eq!(&b[key], value, "{key}");
        }
    }
}

#[test]
fn an_unknown_extension_keeps_the_numbers_of_accessors() {
    let mut b = furnished();
    b.doc["extensionsUsed"].as_array_mut().unwrap().push(json!("ACME_secret"));
    b.doc["extensions"]["ACME_secret"] = json!({"accessor": 5});
    let out = encode(Format::Glb, &b.decode().scene);
    let ((doc, bin), (old, old_bin)) = (open(&out.bytes), open(&b.glb()));
    assert_eq!(doc["extensions"]["ACME_secret"]["accessor"], 5);
    assert_eq!(elements(&doc, &bin, 5), elements(&old, &old_bin, 5));
    assert_valid(&out.bytes);
}

#[test]
fn a_primitive_without_faces_goes_and_a_mesh_without_any_keeps_its_place() {
    let mut b = furnished();
    let second = b.positions(&SQUARE[..3]);
    b.doc["meshes"][0]["primitives"] = json!([
        {"attributes": {"POSITION": 0}, "indices": 1, "material": 0},
        {"attributes": {"POSITION": second}},
    ]);
    let mut d = b.decode();
    filter_faces(&mut d.scene, 0, |f| f == 2);
    let out = encode(Format::Glb, &d.scene);
    assert_eq!(out.warnings, ["1 primitives have no faces left and were left out; their materials stay"]);
    let (doc, _) = open(&out.bytes);
    assert_eq!(doc["meshes"][0]["primitives"].as_array().unwrap().len(), 1);
    assert_eq!(doc["materials"].as_array().unwrap().len(), 1);

    filter_faces(&mut d.scene, 0, |_| false);
    let out = encode(Format::Glb, &d.scene);
    assert!(
        out.warnings.iter().any(|w| w.contains("a triangle without area stands for each")),
        "{:?}",
        out.warnings
    );
    assert_valid(&out.bytes);
    assert_eq!(open(&out.bytes).0["nodes"][0]["mesh"], 0);
}

#[test]
fn joints_weights_and_morph_targets_come_back() {
    let mut b = square();
    let j = b.accessor(&[0, 1, 0, 0, 1, 1, 0, 0, 0, 0, 0, 9, 2, 1, 0, 0], 5121, 4, "VEC4", json!({}));
    let w = b.floats(
        &[0.5, 0.5, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25, 0.75, 0.0, 0.0],
        "VEC4",
        4,
    );
    let t0 = b.positions(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, -2.0]]);
    let t1 = b.floats(&[0.0; 12], "VEC3", 3);
    let n = b.floats(&[0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], "VEC3", 3);
    let p = &mut b.doc["meshes"][0]["primitives"][0];
    p["attributes"] = json!({"POSITION": 0, "NORMAL": n, "JOINTS_0": j, "WEIGHTS_0": w});
    p["targets"] = json!([{"POSITION": t0}, {"NORMAL": t1}]);
    b.doc["meshes"][0]["weights"] = json!([0.5, 0.0]);
    let d = b.decode();
    let out = encode(Format::Glb, &d.scene);
    assert_valid(&out.bytes);
    let (doc, bin) = open(&out.bytes);
    assert_eq!(doc["meshes"][0]["weights"], json!([0.5, 0.0]));
    let p = &doc["meshes"][0]["primitives"][0];
    let of = |v: &Value| elements(&doc, &bin, v.as_u64().unwrap() as usize);
    assert_eq!(
        of(&p["attributes"]["JOINTS_0"]),
        [0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 2, 1, 0, 0],
        "a joint once, unused ones 0"
    );
    assert_eq!(
        read_f32(&of(&p["attributes"]["WEIGHTS_0"])),
        [0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.25, 0.75, 0.0, 0.0]
    );
    assert_eq!(read_f32(&of(&p["targets"][0]["POSITION"]))[3..6], [1.0, 0.0, 0.0]);
    assert_eq!(read_f32(&of(&p["targets"][0]["POSITION"]))[9..], [0.0, 0.0, -2.0]);
    assert_eq!(read_f32(&of(&p["targets"][1]["NORMAL"])), [0.0; 12]);
    let a = &doc["accessors"][p["targets"][0]["POSITION"].as_u64().unwrap() as usize];
    assert_eq!((&a["min"], &a["max"]), (&json!([0.0, 0.0, -2.0]), &json!([1.0, 0.0, 0.0])));
    // The zero normal became the face's.
    assert_eq!(read_f32(&of(&p["attributes"]["NORMAL"]))[6..9], [0.0, 0.0, 1.0]);
}

#[test]
fn normals_tangents_and_weights_that_are_right_but_for_rounding_stay_bit_for_bit() {
    let mut b = square();
    let normals =
        [0.978603, 0.124694, 0.163672, -0.497455, -0.86749, 0.0, 0.0, 1.0, 0.0, 0.577, 0.577, 0.577f32];
    let tangents = [0.996229, 0.0, 0.086769, 1.0].repeat(4);
    let weights = [0.3, 0.7, 0.0, 0.0, 0.1, 0.2, 0.7, 0.0, 1.0, 0.0, 0.0, 0.0, 0.6, 0.3, 0.05, 0.05];
    let n = b.floats(&normals, "VEC3", 3);
    let t = b.floats(&tangents, "VEC4", 4);
    let w = b.floats(&weights, "VEC4", 4);
    let j = b.accessor(&[0, 1, 0, 0, 0, 1, 2, 0, 3, 0, 0, 0, 0, 1, 2, 3], 5121, 4, "VEC4", json!({}));
    b.doc["meshes"][0]["primitives"][0]["attributes"] =
        json!({"POSITION": 0, "NORMAL": n, "TANGENT": t, "JOINTS_0": j, "WEIGHTS_0": w});
    let (doc, bin) = open(&encode(Format::Glb, &b.decode().scene).bytes);
    let p = &doc["meshes"][0]["primitives"][0]["attributes"];
    for (name, want) in [("NORMAL", &normals[..]), ("TANGENT", &tangents), ("WEIGHTS_0", &weights)] {
        let have = elements(&doc, &bin, p[name].as_u64().unwrap() as usize);
        assert_eq!(have, f32s(want), "{name}");
    }
}

#[test]
fn colors_and_own_attributes_keep_their_encoding() {
    let mut b = square();
    let c = b.accessor(
        &[255, 0, 51, 0, 0, 255, 0, 0, 9, 9, 9, 0, 1, 2, 3, 0],
        5121,
        4,
        "VEC3",
        json!({"normalized": true}),
    );
    b.doc["accessors"][c]["bufferView"] = json!(2);
    b.doc["bufferViews"][2]["byteStride"] = json!(4);
    let own = b.accessor(&u16s(&[1, 0, 500, 0, 3, 0, 4, 0]), 5123, 4, "SCALAR", json!({}));
    b.doc["bufferViews"][3]["byteStride"] = json!(4);
    b.doc["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0, "COLOR_0": c, "_HEAT": own});
    let d = b.decode();
    let w = d.scene.meshes[0].geometry.wedges.as_ref().unwrap();
    assert_eq!(
        w.channels()[0],
        Channel { semantic: Semantic::Color(0), width: 3, encoding: Encoding::U8Norm }
    );
    assert_eq!(w.get(0, 0), Some(&[1.0, 0.0, 0.2][..]));
    let (doc, bin) = open(&encode(Format::Glb, &d.scene).bytes);
    let p = &doc["meshes"][0]["primitives"][0]["attributes"];
    let of = |name: &str| elements(&doc, &bin, p[name].as_u64().unwrap() as usize);
    assert_eq!(of("COLOR_0"), [255, 0, 51, 0, 255, 0, 9, 9, 9, 1, 2, 3]);
    assert_eq!(of("_HEAT"), u16s(&[1, 500, 3, 4]));
}

fn png() -> Image {
    let data = b"\x89PNG\r\n\x1a\n and so on".to_vec();
    Image { uri: Some("tex/wood.png".into()), data: Some(data), ..Default::default() }
}

/// A quadrilateral and a triangle with uv, as from an OBJ.
fn textured() -> Scene {
    let mut w = Wedges::new(vec![Channel::new(Semantic::TexCoord(0), 2)]).unwrap();
    for uv in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.25]] {
        w.push(&uv, 1);
    }
    w.corner = vec![0, 1, 2, 3, 1, 4, NONE];
    let points = vec![[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.5]];
    let geometry = MeshInput {
        wedges: Some(w),
        face_material: vec![0, 1],
        ..MeshInput::polygons(points, &[4, 3], &[0, 1, 2, 3, 1, 4, 2])
    };
    let wood = Material { name: "wood".into(), base_color_image: Some(0), ..Default::default() };
    let lamp = Material {
        name: "lamp".into(),
        emissive: [4.0, 2.0, 0.0],
        base_color: [1.0, 1.0, 1.0, 0.5],
        ..Default::default()
    };
    Scene {
        materials: vec![wood, lamp],
        images: vec![png()],
        ..Scene::from_mesh(SceneMesh { name: Some("panel".into()), geometry, ..Default::default() })
    }
}

#[test]
fn a_scene_of_another_format_becomes_a_document() {
    let scene = textured();
    let out = encode(Format::Glb, &scene);
    assert_eq!(out.warnings, Vec::<String>::new());
    assert_valid(&out.bytes);
    let back = decode(&out.bytes).scene;
    assert_eq!(
        (back.materials.len(), back.unique_triangles(), back.nodes[0].name.as_deref()),
        (2, 3, Some("panel"))
    );
    assert_eq!(back.materials, scene.materials);
    assert_eq!(back.images[0].data, scene.images[0].data);
    let g = &back.meshes[0].geometry;
    assert_eq!((g.positions.len(), &g.face_material[..]), (5, &[0, 0, 1][..]));
    let uv = |v: u32| {
        let c = g.corners.iter().position(|&x| x == v).unwrap();
        let w = g.wedges.as_ref().unwrap();
        w.get(w.corner[c], 0).unwrap().to_vec()
    };
    let origin = (0..5).find(|&v| g.positions.get(v) == glam::DVec3::ZERO).unwrap() as u32;
    assert_eq!(uv(origin), [0.0, 1.0], "v runs down in glTF");

    let obj = String::from_utf8(encode(Format::Obj, &back).bytes).unwrap();
    let vt = |b: &[u8]| {
        io::decode(Format::Obj, b, &NoSide).unwrap().scene.meshes[0].geometry.wedges.clone().unwrap()
    };
    let first = vt(obj.as_bytes());
    assert_eq!(first.get(first.corner[0], 0), Some(&[0.0, 0.0][..]), "and up again in OBJ: {obj}");

    let out = encode(Format::Gltf, &scene);
    let names: Vec<&str> = out.side.iter().map(|s| s.0.as_str()).collect();
    assert_eq!(names, ["out.bin", "tex/wood.png"]);
    let files = Files(out.side.into_iter().collect());
    let back = io::decode(Format::Gltf, &out.bytes, &files).unwrap();
    assert_eq!(back.warnings, Vec::<String>::new());
    assert_eq!(back.scene.images[0].data, scene.images[0].data);
}

#[test]
fn far_off_f64_positions_keep_their_precision_through_the_node() {
    let far = [5e6 + 0.125, 1e6 + 0.0625, 300.03];
    let points: Vec<[f64; 3]> = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0]]
        .map(|p| [0, 1, 2].map(|k| p[k] + far[k]))
        .to_vec();
    let mut scene = Scene::from_mesh(SceneMesh {
        geometry: MeshInput::triangles(Positions::F64(points.clone()), &[[0, 1, 2]]),
        ..Default::default()
    });
    // A child, which must stay where it is.
    let child = Node { name: None, transform: glam::DMat4::IDENTITY, mesh: None, children: vec![] };
    scene.nodes.push(child);
    for children in [vec![], vec![1]] {
        scene.nodes[0].children = children.clone();
        scene.roots = if children.is_empty() { vec![0, 1] } else { vec![0] };
        let out = encode(Format::Glb, &scene);
        assert!(out.warnings[0].starts_with("glTF positions are f32"), "{:?}", out.warnings);
        let back = decode(&out.bytes).scene;
        let world = back.world_transforms();
        let node = back.nodes.iter().position(|n| n.mesh.is_some()).unwrap();
        for (i, p) in soup(&back, 0).into_iter().enumerate() {
            let at = world[node].transform_point3(p.into());
            assert!(at.distance(points[i].into()) < 1e-8, "{at} {:?}", points[i]);
        }
        assert_eq!(world[1], glam::DMat4::IDENTITY);
    }
}

#[test]
fn wires_become_lines_points_become_points_and_nothing_becomes_no_mesh() {
    let points = SQUARE.to_vec();
    let wires =
        MeshInput { positions: points.clone().into(), wires: vec![[0, 1], [1, 3]], ..Default::default() };
    let cloud = MeshInput { positions: points.into(), ..Default::default() };
    for (geometry, mode, warnings) in
        [(wires, json!(1), 1), (cloud, json!(0), 0), (MeshInput::default(), Value::Null, 1)]
    {
        let scene = Scene::from_mesh(SceneMesh { geometry, ..Default::default() });
        let out = encode(Format::Glb, &scene);
        assert_eq!(out.warnings.len(), warnings, "{:?}", out.warnings);
        assert_valid(&out.bytes);
        assert_eq!(open(&out.bytes).0["meshes"][0]["primitives"][0]["mode"], mode);
    }
}

#[test]
fn indices_are_short_while_they_fit() {
    for (n, code) in [(65535u32, 5123), (65536, 5125)] {
        let points: Vec<[f32; 3]> = (0..n).map(|i| [i as f32, (i % 7) as f32, 0.0]).collect();
        let triangles: Vec<[u32; 3]> = (0..n - 2).map(|i| [i, i + 1, i + 2]).collect();
        let scene = Scene::from_mesh(SceneMesh {
            geometry: MeshInput::triangles(points, &triangles),
            ..Default::default()
        });
        let (doc, _) = open(&encode(Format::Glb, &scene).bytes);
        let i = doc["meshes"][0]["primitives"][0]["indices"].as_u64().unwrap() as usize;
        assert_eq!(doc["accessors"][i]["componentType"], code);
    }
}

#[test]
fn positions_that_f32_cannot_hold_are_an_error() {
    let points = Positions::F64(vec![[0.0; 3], [1e300, 0.0, 0.0], [-1e300, 1.0, 0.0]]);
    let scene = Scene::from_mesh(SceneMesh {
        geometry: MeshInput::triangles(points, &[[0, 1, 2]]),
        ..Default::default()
    });
    let e = io::encode(Format::Glb, &scene, &Default::default()).unwrap_err().to_string();
    assert!(e.starts_with("Glb cannot hold vertex 1 at "), "{e}");
}
