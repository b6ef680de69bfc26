//! Heat maps for the report: where our default method and its fastest rival are off, in the same colours.

use crate::one;
use crate::page::Heat;
use crate::raw::Raw;
use crate::results::{Results, name};
use crate::run::Out;
use anyhow::Result;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use progmesh::aif::MeshInput;
use progmesh::compare::{CompareOptions, Flattened, Pair, compare, heat_picture};
use progmesh::report::{Scale, Surface};
use progmesh::scene::{Scene, SceneMesh};
use progmesh::simplify::Quiet;

/// The ratio that is shown.
const RATIO: f64 = 0.1;
/// Meshes that are shown, at most: each picture takes a second or so, and some hundred kilobytes.
const MESHES: usize = 6;
/// Tools of this process that are shown, ours first: its scale is used for all.
const SHOWN: [&str; 2] = ["quadric", "meshopt-update"];

/// Pictures of the meshes that have rows. Those whose mesh is gone from the results' folder are left out.
pub(crate) fn heats(all: &Results, out: &Out) -> Result<Vec<Heat>> {
    let mut heats = Vec::new();
    for mesh in all.measured().take(MESHES) {
        let Ok(original) = Raw::read(&out.mesh(&mesh.mesh)) else { continue };
        heats.extend(of_mesh(&mesh.mesh, &original)?);
    }
    Ok(heats)
}

fn of_mesh(mesh: &str, original: &Raw) -> Result<Vec<Heat>> {
    let target = ((original.triangles.len() as f64 * RATIO).round() as usize).max(1);
    let before = scene(original);
    let a = Flattened::of(&before)?;
    let drawn = Surface::of(&before)?;
    let mut common: Option<Scale> = None;
    let mut heats = Vec::new();
    for tool in SHOWN {
        let result = one::run(tool, original, target, None)?.0.used();
        if result.triangles.is_empty() {
            continue;
        }
        let after = scene(&result);
        let b = Flattened::of(&after)?;
        let comparison = compare(&a, &b, &CompareOptions::default(), &Quiet)?;
        let own = comparison.heat_scale();
        let scale = match &common {
            Some(first) => Scale { top: first.top, ..own },
            None => own,
        };
        let pair = Pair {
            drawn: [&drawn, &Surface::of(&after)?],
            b: &b.surface,
            names: [mesh, name(tool)],
            scale: &scale,
        };
        if let Some(png) = heat_picture(&pair).png() {
            let caption = format!(
                "{mesh} and {} at {} triangles; right: the original by its distance from that",
                name(tool),
                result.triangles.len()
            );
            heats.push(Heat { mesh: mesh.to_string(), caption, png: STANDARD.encode(png) });
        }
        common.get_or_insert(scale);
    }
    Ok(heats)
}

fn scene(mesh: &Raw) -> Scene {
    let positions = progmesh::aif::Positions::from_f64(mesh.points.clone());
    let geometry = MeshInput::triangles(positions, &mesh.triangles);
    Scene::from_mesh(SceneMesh { geometry, ..Default::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use progmesh::meshes::{GenerateOptions, generate};

    #[test]
    fn every_shown_tool_gets_a_picture() {
        let sample = generate("torus", &GenerateOptions::default().with_faces(800)).unwrap();
        let mesh = Raw { points: sample.positions, triangles: sample.corners.as_chunks().0.to_vec() };
        let heats = of_mesh("torus", &mesh).unwrap();
        assert_eq!(heats.len(), SHOWN.len());
        for (heat, tool) in heats.iter().zip(SHOWN) {
            assert!(heat.caption.contains(name(tool)) && heat.caption.contains(" triangles"));
            assert_eq!(STANDARD.decode(&heat.png).unwrap()[..4], *b"\x89PNG");
        }
    }
}
