//! Generated sample meshes as scenes.

use crate::aif::attributes::{Channel, Semantic, Wedges};
use crate::aif::{MeshInput, NONE, Positions};
use crate::meshes::{Sample, Texture};
use crate::scene::{Image, Material, Scene, SceneMesh};
use std::collections::HashMap;

/// A scene of one mesh of this name. Textures become PNG images.
pub fn scene(sample: Sample, name: &str) -> Scene {
    let wedges = wedges(&sample);
    let geometry = MeshInput {
        positions: Positions::from_f64(sample.positions),
        face_sizes: sample.face_sizes,
        corners: sample.corners,
        wires: sample.wires,
        wedges,
        face_material: sample.face_material,
        ..Default::default()
    };
    let mut scene =
        Scene::from_mesh(SceneMesh { name: Some(name.to_string()), geometry, ..Default::default() });
    scene.materials = sample
        .materials
        .into_iter()
        .map(|m| Material {
            name: m.name,
            base_color: [m.base_color[0], m.base_color[1], m.base_color[2], 1.0],
            base_color_image: m.texture,
            ..Default::default()
        })
        .collect();
    scene.images = sample.textures.iter().map(image).collect();
    scene
}

/// Normals and texture coordinates; corners of a vertex that agree in both share a wedge.
fn wedges(sample: &Sample) -> Option<Wedges> {
    let (normals, uvs) = (&sample.normals, &sample.uvs);
    let mut channels = Vec::new();
    channels.extend(normals.as_ref().map(|_| Channel::new(Semantic::Normal, 3)));
    channels.extend(uvs.as_ref().map(|_| Channel::new(Semantic::TexCoord(0), 2)));
    if channels.is_empty() {
        return None;
    }
    let present = (1u64 << channels.len()) - 1;
    // Two channels are never too many.
    let mut wedges = Wedges::new(channels).ok()?;
    let mut known = HashMap::new();
    let mut row = Vec::with_capacity(wedges.stride());
    for (c, &v) in sample.corners.iter().enumerate() {
        let normal = normals.as_ref().map_or(NONE, |n| n.corner[c]);
        let uv = uvs.as_ref().map_or(NONE, |t| t.corner[c]);
        let id = *known.entry((v, normal, uv)).or_insert_with(|| {
            row.clear();
            row.extend(normals.iter().flat_map(|n| n.values[normal as usize]));
            row.extend(uvs.iter().flat_map(|t| t.values[uv as usize]));
            wedges.push(&row, present)
        });
        wedges.corner.push(id);
    }
    Some(wedges)
}

fn image(texture: &Texture) -> Image {
    Image {
        name: Some(texture.name.clone()),
        uri: Some(format!("{}.png", texture.name)),
        mime: Some("image/png".into()),
        data: png_bytes(texture),
    }
}

/// The texture as a PNG file; `None` if it is empty, which PNG cannot hold.
fn png_bytes(texture: &Texture) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, texture.width, texture.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(&texture.rgb).ok()?;
    writer.finish().ok()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::{BuildOptions, Mesh};
    use crate::meshes::{GenerateOptions, generate, names};

    #[test]
    fn every_well_formed_sample_becomes_a_valid_mesh() {
        for e in names().iter().filter(|e| !e.hostile) {
            let sample = generate(e.name, &GenerateOptions::default().with_faces(300)).unwrap();
            let faces = sample.face_count();
            let scene = scene(sample, e.name);
            let (mesh, report) =
                Mesh::build(scene.meshes[0].geometry.clone(), &BuildOptions::default()).unwrap();
            mesh.check().unwrap();
            assert_eq!((mesh.face_count(), report.dropped_faces.len()), (faces, 0), "{}", e.name);
        }
    }

    #[test]
    fn a_texture_becomes_a_png_of_its_pixels() {
        let sample = generate("quad-sphere", &GenerateOptions::default().with_faces(24)).unwrap();
        let texture = sample.textures[0].clone();
        let scene = scene(sample, "s");
        let bytes = scene.images[0].data.clone().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, texture.rgb);
        assert_eq!(scene.materials[0].base_color_image, Some(0));
    }
}
