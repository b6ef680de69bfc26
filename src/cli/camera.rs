//! Cameras as flags name them: `CAM.json`, `scene.glb`, `scene.glb#NAME`.

use super::Failure;
use super::common::{self, Warnings};
use progmesh::io::{Format, camera, files};
use progmesh::refine::view::Camera;
use std::path::Path;

/// Reads the camera that a flag names. Errors name the file, and the field or element in it.
pub(crate) fn read(source: &str, warnings: &mut Warnings) -> Result<Camera, Failure> {
    let of_gltf = |name: &str| matches!(Format::from_name(name), Some(Format::Gltf | Format::Glb));
    let (path, which) = match source.rsplit_once('#') {
        Some((path, which)) if of_gltf(path) => (path, Some(which)),
        _ => (source, None),
    };
    let failed = |e: String| Failure::Input(format!("{path}: {e}"));
    if of_gltf(path) {
        let loaded = common::read(Path::new(path), None, warnings)?;
        return camera::from_scene(&loaded.decoded.scene, which).map_err(|e| failed(e.to_string()));
    }
    if Format::from_name(path).is_some() {
        return Err(failed("a camera is a .json file (docs/camera.md), or of a .gltf or .glb file".into()));
    }
    let bytes = files::read_all(Path::new(path)).map_err(|e| failed(e.to_string()))?;
    camera::from_json(&bytes).map_err(|e| failed(e.to_string()))
}
