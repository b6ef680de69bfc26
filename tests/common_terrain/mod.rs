//! What the end-to-end tests of terrain share: reading what was written, by the crate `gltf`, and a picture to lay over it.
#![allow(dead_code, unreachable_pub)] // every test file uses its own part

use crate::common::Place;

/// Vertices of a GLB of one mesh, and its triangles.
pub struct Glb {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub uvs: Option<Vec<[f32; 2]>>,
    pub triangles: Vec<[usize; 3]>,
    /// Where its picture is; "embedded" if within.
    pub image: Option<String>,
    pub document: gltf::Document,
    pub blob: Vec<u8>,
}

pub fn glb(p: &Place, name: &str) -> Glb {
    let gltf::Gltf { document, blob } = gltf::Gltf::open(p.path(name)).unwrap();
    let blob = blob.unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|_| Some(&blob));
    let indices: Vec<usize> = reader.read_indices().unwrap().into_u32().map(|i| i as usize).collect();
    let image = document.images().next().map(|i| match i.source() {
        gltf::image::Source::Uri { uri, .. } => uri.to_string(),
        gltf::image::Source::View { .. } => "embedded".into(),
    });
    Glb {
        positions: reader.read_positions().unwrap().collect(),
        normals: reader.read_normals().unwrap().collect(),
        uvs: reader.read_tex_coords(0).map(|t| t.into_f32().collect()),
        triangles: indices.as_chunks::<3>().0.to_vec(),
        image,
        document,
        blob,
    }
}

/// A white PNG of a pixel.
pub fn pixel() -> Vec<u8> {
    let mut bytes = vec![];
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[255]).unwrap();
    bytes
}
