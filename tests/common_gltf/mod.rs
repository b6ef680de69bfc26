//! Builds glTF documents for tests, number by number.
#![allow(dead_code, unreachable_pub)]

use progmesh::io::{self, Decoded, EncodeOptions, Encoded, Format, NoSide, Side};
use progmesh::scene::Scene;
use serde_json::{Value, json};
use std::collections::HashMap;

/// A document in the making and its binary chunk.
pub struct Build {
    pub doc: Value,
    pub bin: Vec<u8>,
}

pub fn f32s(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

pub fn u16s(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

impl Default for Build {
    fn default() -> Self {
        let doc = json!({"asset": {"version": "2.0"}, "accessors": [], "bufferViews": [], "buffers": [{}]});
        Build { doc, bin: Vec::new() }
    }
}

impl Build {
    fn append(&mut self, key: &str, value: Value) -> usize {
        let list = self.doc[key].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// A view of new bytes, with further properties.
    pub fn view(&mut self, bytes: &[u8], more: Value) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        view.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        self.bin.extend_from_slice(bytes);
        self.append("bufferViews", view)
    }

    /// An accessor of new bytes, with further properties.
    pub fn accessor(&mut self, bytes: &[u8], code: u32, count: usize, kind: &str, more: Value) -> usize {
        let view = self.view(bytes, json!({}));
        self.accessor_of(json!({"bufferView": view}), code, count, kind, more)
    }

    pub fn accessor_of(&mut self, base: Value, code: u32, count: usize, kind: &str, more: Value) -> usize {
        let mut accessor = base;
        let map = accessor.as_object_mut().unwrap();
        map.extend(json!({"componentType": code, "count": count, "type": kind}).as_object().unwrap().clone());
        map.extend(more.as_object().unwrap().clone());
        self.append("accessors", accessor)
    }

    /// Positions with their bounds.
    pub fn positions(&mut self, points: &[[f32; 3]]) -> usize {
        let bound = |pick: fn(f32, f32) -> f32| {
            (0..3).map(|k| points.iter().map(|p| p[k]).reduce(pick).unwrap() as f64).collect::<Vec<_>>()
        };
        let more = json!({"min": bound(f32::min), "max": bound(f32::max)});
        self.accessor(&f32s(points.as_flattened()), 5126, points.len(), "VEC3", more)
    }

    pub fn indices(&mut self, indices: &[u16]) -> usize {
        self.accessor(&u16s(indices), 5123, indices.len(), "SCALAR", json!({}))
    }

    pub fn floats(&mut self, values: &[f32], kind: &str, width: usize) -> usize {
        self.accessor(&f32s(values), 5126, values.len() / width, kind, json!({}))
    }

    fn finish(&self) -> (Value, Vec<u8>) {
        let (mut doc, mut bin) = (self.doc.clone(), self.bin.clone());
        bin.resize(bin.len().next_multiple_of(4), 0);
        doc["buffers"][0]["byteLength"] = json!(bin.len());
        (doc, bin)
    }

    pub fn glb(&self) -> Vec<u8> {
        let (doc, bin) = self.finish();
        glb(&doc, &bin)
    }

    /// A `.gltf` whose buffer is at `uri`, and the buffer.
    pub fn gltf(&self, uri: &str) -> (Vec<u8>, Vec<u8>) {
        let (mut doc, bin) = self.finish();
        doc["buffers"][0]["uri"] = json!(uri);
        (serde_json::to_vec(&doc).unwrap(), bin)
    }

    pub fn decode(&self) -> Decoded {
        decode(&self.glb())
    }

    pub fn error(&self) -> String {
        io::decode(Format::Glb, &self.glb(), &NoSide).unwrap_err().to_string()
    }
}

pub fn glb(doc: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = serde_json::to_vec(doc).unwrap();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((20 + json.len() as u32 + 8 + bin.len() as u32).to_le_bytes());
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(json);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}

pub fn decode(bytes: &[u8]) -> Decoded {
    io::decode(Format::Glb, bytes, &NoSide).unwrap()
}

pub fn encode(format: Format, scene: &Scene) -> Encoded {
    let mut options = EncodeOptions::default();
    options.stem = "out".into();
    io::encode(format, scene, &options).unwrap()
}

/// The JSON and the binary chunk of a GLB.
pub fn open(bytes: &[u8]) -> (Value, Vec<u8>) {
    let json = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let doc = serde_json::from_slice(&bytes[20..20 + json]).unwrap();
    (doc, bytes.get(28 + json..).unwrap_or_default().to_vec())
}

/// The bytes of an accessor's elements in a written GLB, tightly packed.
pub fn elements(doc: &Value, bin: &[u8], accessor: usize) -> Vec<u8> {
    let a = &doc["accessors"][accessor];
    let width = match a["type"].as_str().unwrap() {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        _ => 16,
    };
    let size = width
        * match a["componentType"].as_u64().unwrap() {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            _ => 4,
        };
    let count = a["count"].as_u64().unwrap() as usize;
    let Some(view) = a["bufferView"].as_u64() else { return vec![0; size * count] };
    let view = &doc["bufferViews"][view as usize];
    let at = |v: &Value| v.as_u64().unwrap_or(0) as usize;
    let start = at(&view["byteOffset"]) + at(&a["byteOffset"]);
    let stride = view["byteStride"].as_u64().map_or(size, |s| s as usize);
    (0..count).flat_map(|i| bin[start + i * stride..start + i * stride + size].to_vec()).collect()
}

pub fn read_f32(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

/// Passes the `gltf` crate's validation, and all data can be read through it.
pub fn assert_valid(bytes: &[u8]) {
    let file = gltf::Gltf::from_slice(bytes).unwrap();
    let blob = file.blob.as_deref().unwrap_or_default();
    for mesh in file.meshes() {
        assert!(mesh.primitives().len() > 0);
        for p in mesh.primitives() {
            let reader = p.reader(|_| Some(blob));
            let n = reader.read_positions().unwrap().count() as u32;
            if let Some(indices) = reader.read_indices() {
                assert!(indices.into_u32().all(|i| i < n));
            }
            for normal in reader.read_normals().into_iter().flatten() {
                let length: f32 = normal.iter().map(|x| x * x).sum();
                assert!((length - 1.0).abs() < 1e-3);
            }
        }
    }
}

/// Side files in memory.
#[derive(Default)]
pub struct Files(pub HashMap<String, Vec<u8>>);

impl Side for Files {
    fn load(&self, name: &str) -> std::io::Result<Vec<u8>> {
        self.0.get(name).cloned().ok_or_else(|| std::io::ErrorKind::NotFound.into())
    }
}

/// Four points of a square and its two triangles.
pub const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

/// A square of two triangles in one mesh, one node.
pub fn square() -> Build {
    let mut b = Build::default();
    let (p, i) = (b.positions(&SQUARE), b.indices(&[0, 1, 2, 0, 2, 3]));
    b.doc["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": p}, "indices": i}]}]);
    b.doc["nodes"] = json!([{"mesh": 0}]);
    b.doc["scenes"] = json!([{"nodes": [0]}]);
    b.doc["scene"] = json!(0);
    b
}

/// Corners of a mesh as positions, face by face.
pub fn soup(scene: &Scene, mesh: usize) -> Vec<[f64; 3]> {
    let g = &scene.meshes[mesh].geometry;
    g.corners.iter().map(|&v| g.positions.get(v as usize).to_array()).collect()
}
