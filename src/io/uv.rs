//! Which way texture coordinates run.
//!
//! In glTF v runs down from the top of the image, in OBJ and PLY up from the bottom. A scene keeps what its file has: down if it came
//! from glTF ([`Scene::gltf`]), up otherwise. It is turned over only on the way to a format of the other kind, since 1 - v
//! rounds: a file written in its own format keeps its coordinates to the bit. The way to glTF is in its encoder, the way from glTF here.

use super::Format;
use crate::aif::attributes::Semantic;
use crate::scene::Scene;
use std::borrow::Cow;

/// `scene` with texture coordinates running up, if it came from glTF and `format` is another.
pub(super) fn for_format(scene: &Scene, format: Format) -> Cow<'_, Scene> {
    let down = matches!(format, Format::Gltf | Format::Glb);
    let has_uvs = |m: &crate::scene::SceneMesh| {
        let channels = m.geometry.wedges.as_ref().map_or(&[][..], |w| w.channels());
        channels.iter().any(|c| matches!(c.semantic, Semantic::TexCoord(_)))
    };
    if scene.gltf.is_none() || down || !scene.meshes.iter().any(has_uvs) {
        return Cow::Borrowed(scene);
    }
    let mut scene = scene.clone();
    for w in scene.meshes.iter_mut().filter_map(|m| m.geometry.wedges.as_mut()) {
        for k in 0..w.channels().len() {
            let o = w.offset(k);
            let (semantic, width) = (w.channels()[k].semantic.clone(), w.channels()[k].width);
            for i in 0..w.len() as u32 {
                let has = w.present(i) >> k & 1 == 1;
                match semantic {
                    Semantic::TexCoord(_) if has && width >= 2 => {
                        let v = &mut w.row_mut(i)[o + 1];
                        *v = 1.0 - *v;
                    }
                    // The bitangent follows v, and with it the handedness.
                    Semantic::Tangent if has && width == 4 => w.row_mut(i)[o + 3] *= -1.0,
                    _ => {}
                }
            }
        }
    }
    Cow::Owned(scene)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{NoSide, decode, encode};
    use crate::meshes::{GenerateOptions, generate};

    /// Position of a corner and its texture coordinates, for all corners, sorted.
    fn corners(scene: &Scene) -> Vec<[i64; 5]> {
        let m = &scene.meshes[0].geometry;
        let w = m.wedges.as_ref().unwrap();
        let k = w.channel(&Semantic::TexCoord(0)).unwrap();
        let round = |x: f64| (x * 98_765.0).round() as i64;
        let mut all: Vec<[i64; 5]> = m
            .corners
            .iter()
            .zip(&w.corner)
            .map(|(&v, &wedge)| {
                let (p, uv) = (m.positions.get(v as usize), w.get(wedge, k).unwrap());
                [p.x, p.y, p.z, uv[0] as f64, uv[1] as f64].map(round)
            })
            .collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    #[test]
    fn v_is_turned_over_once_on_the_way_to_gltf_and_once_back() {
        let sample = generate("quad-sphere", &GenerateOptions::default().with_faces(24)).unwrap();
        let scene = crate::samples::scene(sample, "s");
        let through = |format, scene: &Scene| {
            let bytes = encode(format, scene, &Default::default()).unwrap().bytes;
            decode(format, &bytes, &NoSide).unwrap().scene
        };
        let mut expected = corners(&scene);
        let glb = through(Format::Glb, &scene);
        assert_eq!(corners(&through(Format::Glb, &glb)), corners(&glb));
        assert_eq!(corners(&through(Format::Obj, &glb)), expected);
        for c in &mut expected {
            c[4] = 98_765 - c[4];
        }
        expected.sort_unstable();
        assert_eq!(corners(&glb), expected);
    }
}
