//! glTF files that are wrong: an error that names the element, never a panic, a hang or a large allocation.

mod common_gltf;

use common_gltf::*;
use progmesh::io::{self, DecodeError, EncodeOptions, Format, NoSide};
use proptest::prelude::*;
use serde_json::{Value, json};

/// Applies `change` to the square's document and returns the error.
fn broken(change: impl FnOnce(&mut Value)) -> String {
    let mut b = square();
    change(&mut b.doc);
    b.error()
}

type Change = Box<dyn FnOnce(&mut Value)>;

#[test]
fn errors_name_the_json_path() {
    let cases: Vec<(Change, &str)> = vec![
        (Box::new(|d| d["asset"] = json!({})), "asset: has no version"),
        (
            Box::new(|d| d["asset"]["version"] = json!("1.0")),
            "needs glTF version 1.0, which is not supported",
        ),
        (Box::new(|d| d["asset"]["version"] = json!("two")), "asset.version: \"two\": must be \"2.0\""),
        (
            Box::new(|d| d["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(9)),
            "meshes[0].primitives[0].attributes.POSITION: index 9: there are 2 accessors",
        ),
        (
            Box::new(|d| d["accessors"][1]["componentType"] = json!(5126)),
            "accessors[1]: 6 elements of 4 bytes, 4 apart, from byte 0 on do not fit into the 12 bytes of bufferViews[1]",
        ),
        (
            Box::new(|d| d["accessors"][0]["count"] = json!(9_007_199_254_740_991u64)),
            "accessors[0]: count 9007199254740991: must be 1 to 2^32 - 2",
        ),
        (
            Box::new(|d| d["accessors"][0]["byteOffset"] = json!(u64::MAX)),
            "accessors[0]: 4 elements of 12 bytes, 12 apart, from byte 18446744073709551615 on do not fit into the 48 bytes of bufferViews[0]",
        ),
        (
            Box::new(|d| d["accessors"][0]["type"] = json!("VEC9")),
            "accessors[0].type: must be SCALAR, VEC2, ... MAT4",
        ),
        (
            Box::new(|d| d["accessors"][0]["type"] = json!("SCALAR")),
            "meshes[0].primitives[0].attributes.POSITION: must be of type VEC3",
        ),
        (
            Box::new(|d| d["bufferViews"][0]["byteStride"] = json!(4)),
            "bufferViews[0]: byteStride 4 is less than the 12 bytes of accessors[0]",
        ),
        (
            Box::new(|d| d["bufferViews"][1]["byteLength"] = json!(-3)),
            "bufferViews[1].byteLength: -3: must be a whole number, not negative",
        ),
        (
            Box::new(|d| d["bufferViews"][1]["byteOffset"] = json!(u64::MAX)),
            "bufferViews[1]: byteOffset 18446744073709551615 + byteLength 12 is beyond the 60 bytes of buffers[0]",
        ),
        (Box::new(|d| d["meshes"][0]["primitives"] = json!([])), "meshes[0]: has no primitives"),
        (
            Box::new(|d| d["meshes"][0]["primitives"][0]["material"] = json!(0)),
            "meshes[0].primitives[0].material: index 0: there are 0 materials",
        ),
        (
            Box::new(|d| d["nodes"][0]["mesh"] = json!("zero")),
            "nodes[0].mesh: \"zero\": must be a whole number, not negative",
        ),
        (
            Box::new(|d| d["nodes"] = json!([{"children": [1]}, {"children": [0]}])),
            "nodes[0]: is its own ancestor",
        ),
        (Box::new(|d| d["nodes"] = json!([{"children": [0]}])), "nodes[0]: is its own ancestor"),
        (
            Box::new(|d| d["nodes"] = json!([{"children": [1, 1]}, {}])),
            "nodes[0].children[1]: node 1 has a parent already",
        ),
        (
            Box::new(|d| d["nodes"] = json!([{"children": [5]}])),
            "nodes[0].children[0]: index 5: there are 1 nodes",
        ),
        (
            Box::new(|d| d["nodes"][0]["matrix"] = json!([1, 2])),
            "nodes[0].matrix: has 2 numbers: must have 16",
        ),
        (Box::new(|d| d["meshes"] = json!(3)), "meshes: must be an array"),
    ];
    for (change, want) in cases {
        assert_eq!(broken(change), want);
    }
}

#[test]
fn required_extensions_are_refused_by_name() {
    for name in ["KHR_draco_mesh_compression", "KHR_texture_basisu", "ACME_teapot"] {
        let mut b = square();
        b.doc["extensionsRequired"] = json!([name]);
        let e = io::decode(Format::Glb, &b.glb(), &NoSide).unwrap_err();
        assert_eq!(e, DecodeError::Unsupported { what: format!("the glTF extension {name}") });
    }
    let mut b = square();
    b.doc["extensionsRequired"] = json!(["KHR_materials_unlit", "EXT_mesh_gpu_instancing"]);
    assert_eq!(b.decode().scene.meshes.len(), 1);
}

#[test]
fn a_position_that_is_no_number_names_accessor_and_element() {
    for (value, text) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf")] {
        let mut b = square();
        b.bin[3 * 12 + 4..3 * 12 + 8].copy_from_slice(&value.to_le_bytes());
        let want =
            format!("meshes[0].primitives[0].attributes.POSITION: element 3 has y = {text}: must be finite");
        assert_eq!(b.error(), want);
    }
}

#[test]
fn an_index_out_of_range_names_its_place() {
    let mut b = square();
    b.bin[48 + 8] = 77;
    assert_eq!(b.error(), "meshes[0].primitives[0].indices: element 4 is 77: POSITION has 4 elements");
}

#[test]
fn other_values_that_are_no_numbers_are_left_out_and_said() {
    let mut b = square();
    let n = b.floats(&[f32::NAN, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "VEC3", 3);
    b.doc["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(n);
    let d = b.decode();
    assert_eq!(d.warnings, ["1 attribute values that are not finite numbers were taken as missing"]);
    assert_valid(&encode(Format::Glb, &d.scene).bytes);
}

#[test]
fn announced_elements_without_bytes_are_refused() {
    // Accessors without a view hold zeros: a few bytes of JSON may announce billions.
    let mut b = square();
    let p = b.accessor_of(json!({}), 5126, 3_000_000_000, "VEC3", json!({}));
    b.doc["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": p}}]);
    assert_eq!(b.error(), "meshes[0].primitives[0]: announces far more data than the file has bytes");

    // The same indices over and over.
    let mut b = square();
    let i = b.accessor(&[0; 30_000], 5121, 30_000, "SCALAR", json!({}));
    let p = json!({"attributes": {"POSITION": 0}, "indices": i});
    b.doc["meshes"][0]["primitives"] = Value::Array(vec![p; 3000]);
    assert!(b.error().ends_with("announces far more data than the file has bytes"));

    // The same compressed view over and over.
    let mut b = square();
    let zeros = vec![[0u32; 64]; 20_000];
    let stream = meshopt::encoding::encode_vertex_buffer_level(&zeros, 2, Some(1)).unwrap();
    assert!(stream.len() < 100_000);
    let v = b.view(&stream, json!({}));
    let mut packed = b.doc["bufferViews"][v].clone();
    packed["byteStride"] = json!(256);
    packed["count"] = json!(20_000);
    packed["mode"] = json!("ATTRIBUTES");
    let view =
        json!({"buffer": 0, "byteLength": 256 * 20_000, "extensions": {"KHR_meshopt_compression": packed}});
    b.doc["bufferViews"].as_array_mut().unwrap().extend(vec![view; 500]);
    assert!(b.error().ends_with("announces far more data than the file has bytes"));
}

#[test]
fn deep_json_is_an_error() {
    let deep = format!("{{\"asset\":{}{}}}", "[".repeat(100_000), "]".repeat(100_000));
    let e = io::decode(Format::Gltf, deep.as_bytes(), &NoSide).unwrap_err();
    assert!(matches!(e, DecodeError::Line { line: 1, .. }), "{e}");
}

#[test]
fn two_hundred_thousand_nodes_in_one_chain_are_read() {
    let n = 200_000;
    let mut b = square();
    b.doc["nodes"] =
        (0..n).map(|i| if i + 1 < n { json!({"children": [i + 1]}) } else { json!({}) }).collect();
    let d = b.decode();
    assert_eq!((d.scene.nodes.len(), d.scene.roots.len()), (n, 1));
}

#[test]
fn too_many_attributes_lose_morph_normals_first_then_are_refused() {
    let mut b = square();
    let n = b.floats(&[0.0; 12], "VEC3", 3);
    let target = json!({"POSITION": n, "NORMAL": n, "TANGENT": n});
    b.doc["meshes"][0]["primitives"][0]["targets"] = Value::Array(vec![target.clone(); 30]);
    let d = b.decode();
    assert_eq!(d.warnings, ["tangents of morph targets were left out: a mesh holds 64 attributes"]);
    b.doc["meshes"][0]["primitives"][0]["targets"] = Value::Array(vec![target; 65]);
    assert_eq!(b.error(), "needs a mesh with 65 attributes (meshes[0]; at most 64), which is not supported");
}

/// A small file with an attribute, a sparse accessor, an image and a compressed view.
fn small() -> Vec<u8> {
    let mut b = square();
    let n = b.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "VEC3", 3);
    let (i, v) = (b.view(&u16s(&[1]), json!({})), b.view(&f32s(&[5.0, 0.0, 0.0]), json!({})));
    b.doc["accessors"][0]["sparse"] =
        json!({"count": 1, "indices": {"bufferView": i, "componentType": 5123}, "values": {"bufferView": v}});
    b.doc["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(n);
    let stream = meshopt::encoding::encode_index_buffer(&[0, 1, 2, 0, 2, 3], 4).unwrap();
    let of = b.view(&stream, json!({}));
    let mut packed = b.doc["bufferViews"][of].clone();
    packed["byteStride"] = json!(2);
    packed["count"] = json!(6);
    packed["mode"] = json!("TRIANGLES");
    b.doc["bufferViews"][1] =
        json!({"buffer": 0, "byteLength": 12, "extensions": {"EXT_meshopt_compression": packed}});
    b.doc["extensionsUsed"] = json!(["EXT_meshopt_compression"]);
    b.doc["images"] = json!([{"uri": "data:image/png;base64,iVBORw0KGgo="}]);
    b.glb()
}

/// Decodes; what is read must be writable, and readable again.
fn survive(bytes: &[u8]) -> bool {
    let Ok(d) = io::decode(Format::Glb, bytes, &NoSide) else { return false };
    if let Ok(out) = io::encode(Format::Glb, &d.scene, &EncodeOptions::default()) {
        let again = io::decode(Format::Glb, &out.bytes, &NoSide).expect("our own output is read");
        // A mesh without faces is written with a triangle without area.
        if !out.warnings.iter().any(|w| w.contains("without area")) {
            assert_eq!(again.scene.unique_triangles(), d.scene.unique_triangles());
        }
    }
    true
}

#[test]
fn every_cut_of_a_small_file_is_an_error() {
    let bytes = small();
    assert!(survive(&bytes));
    for n in 0..bytes.len() {
        assert!(io::decode(Format::Glb, &bytes[..n], &NoSide).is_err(), "cut to {n}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn flipped_bytes_never_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let mut bytes = small();
        for (at, value) in flips {
            let i = at.index(bytes.len());
            bytes[i] = value;
        }
        survive(&bytes);
    }

    #[test]
    fn changed_numbers_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), 0usize..14), 1..4)) {
        // Numbers of the document, replaced: the parser lets all of these through.
        let bytes = small();
        let (mut doc, bin) = open(&bytes);
        let mut paths = Vec::new();
        numbers(&doc, &mut String::new(), &mut paths);
        for (at, which) in changes {
            let value = [0u64, 1, 2, 3, 4, 5, 7, 255, 256, 5123, 5126, u32::MAX as u64, 1 << 40, u64::MAX][which];
            *doc.pointer_mut(&paths[at.index(paths.len())]).unwrap() = json!(value);
        }
        survive(&glb(&doc, &bin));
    }
}

fn numbers(value: &Value, path: &mut String, out: &mut Vec<String>) {
    let mut below = |key: &str, v: &Value| {
        let n = path.len();
        path.push('/');
        path.push_str(key);
        numbers(v, path, out);
        path.truncate(n);
    };
    match value {
        Value::Object(map) => map.iter().for_each(|(k, v)| below(k, v)),
        Value::Array(items) => items.iter().enumerate().for_each(|(i, v)| below(&i.to_string(), v)),
        Value::Number(_) => out.push(path.clone()),
        _ => {}
    }
}
