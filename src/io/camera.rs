//! Cameras from files: `CAM.json` (docs/camera.md) and the cameras of a glTF scene.

use crate::refine::view::{Camera, CameraError, CameraParameters, Projection};
use crate::scene::Scene;
use glam::{DMat4, DVec3};
use serde_json::{Map, Value};

/// Why no camera could be had. Names the field, or the element of the document.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraFileError {
    /// The file is no JSON.
    #[error("{at}line {line}, column {column}: {what}")]
    Syntax {
        /// The field that was being read, with `: `, where one can be told.
        at: String,
        /// From 1.
        line: usize,
        /// From 1.
        column: usize,
        /// What the parser says.
        what: String,
    },
    /// A field is missing, unknown, or of the wrong kind.
    #[error("{field}: {what}")]
    Field {
        /// The field.
        field: String,
        /// What is wrong, and what would be right.
        what: String,
    },
    /// The numbers are no camera's.
    #[error("{at}{error}")]
    Camera {
        /// The element of the document, with `: `; empty for `CAM.json`, whose fields the error names.
        at: String,
        /// What is wrong.
        error: CameraError,
    },
    /// The scene has no such camera.
    #[error("{0}")]
    NotThere(String),
}

/// The fields of `CAM.json` in the order of its documentation; of `fov_y_deg` and `ortho_height` there is one.
pub const FIELDS: [&str; 9] =
    ["eye", "target", "up", "fov_y_deg", "ortho_height", "width", "height", "near", "far"];

/// The sides of a picture where a file does not say them, pixels: the height, and the width without an aspect ratio.
const SIDES: (u32, u32) = (1920, 1080);

/// Reads a `CAM.json`: `{eye, target, up, fov_y_deg | ortho_height, width, height, near, far}`, all required, nothing else allowed.
///
/// Lengths are in units of the scene, the angle in degrees, `width` and `height` in pixels; see docs/camera.md.
pub fn from_json(bytes: &[u8]) -> Result<Camera, CameraFileError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let value: Value = serde_json::from_slice(bytes).map_err(|e| syntax(bytes, &e))?;
    let Value::Object(map) = value else {
        let what = "a camera is an object, { \"eye\": [0, 0, 5], ... }".into();
        return Err(CameraFileError::Field { field: "document".into(), what });
    };
    if let Some(stray) = map.keys().find(|k| !FIELDS.contains(&k.as_str())) {
        return Err(bad(stray, format!("no such field: a camera has {}", FIELDS.join(", "))));
    }
    let projection = match (map.contains_key("fov_y_deg"), map.contains_key("ortho_height")) {
        (true, false) => Projection::Perspective { fov_y_deg: number(&map, "fov_y_deg")? },
        (false, true) => Projection::Orthographic { ortho_height: number(&map, "ortho_height")? },
        (true, true) => return Err(bad("ortho_height", "a camera has fov_y_deg or ortho_height, not both")),
        (false, false) => {
            return Err(bad("fov_y_deg", "is missing: give it, or ortho_height for an orthographic camera"));
        }
    };
    let parameters = CameraParameters {
        eye: vector(&map, "eye")?,
        target: vector(&map, "target")?,
        up: vector(&map, "up")?,
        projection,
        width: pixels(&map, "width")?,
        height: pixels(&map, "height")?,
        near: number(&map, "near")?,
        far: number(&map, "far")?,
    };
    Camera::new(&parameters).map_err(|error| CameraFileError::Camera { at: String::new(), error })
}

fn bad(field: &str, what: impl Into<String>) -> CameraFileError {
    CameraFileError::Field { field: field.into(), what: what.into() }
}

fn need<'a>(map: &'a Map<String, Value>, field: &str) -> Result<&'a Value, CameraFileError> {
    map.get(field).ok_or_else(|| bad(field, "is missing"))
}

fn number(map: &Map<String, Value>, field: &str) -> Result<f64, CameraFileError> {
    let value = need(map, field)?;
    value.as_f64().filter(|x| x.is_finite()).ok_or_else(|| bad(field, "must be a number"))
}

fn vector(map: &Map<String, Value>, field: &str) -> Result<DVec3, CameraFileError> {
    let wrong = || bad(field, "must be three numbers, [x, y, z]");
    let list = need(map, field)?.as_array().filter(|a| a.len() == 3).ok_or_else(wrong)?;
    let mut out = [0.0; 3];
    for (o, v) in out.iter_mut().zip(list) {
        *o = v.as_f64().filter(|x| x.is_finite()).ok_or_else(wrong)?;
    }
    Ok(DVec3::from_array(out))
}

fn pixels(map: &Map<String, Value>, field: &str) -> Result<u32, CameraFileError> {
    let x = number(map, field)?;
    // Zero passes here: the camera says what is wrong with it.
    let whole = x.fract() == 0.0 && (0.0..=u32::MAX as f64).contains(&x);
    if whole {
        Ok(x as u32)
    } else {
        Err(bad(field, format!("{x}: must be a whole number of pixels, 1 or more")))
    }
}

/// A syntax error with the field it is in: the last `"name":` before it. Some programs write NaN, which JSON does not have.
fn syntax(bytes: &[u8], e: &serde_json::Error) -> CameraFileError {
    let text = String::from_utf8_lossy(bytes);
    let before: String = text.split_inclusive('\n').take(e.line()).collect();
    let last = before.split_inclusive('\n').next_back().map_or(0, str::len);
    let upto = before.get(..before.len() - last + e.column().min(last)).unwrap_or(&before);
    let field = upto.rsplit_once(':').and_then(|(head, _)| {
        let name = head.trim_end().strip_suffix('"')?;
        name.rsplit_once('"').map(|(_, name)| name)
    });
    let what = e.to_string();
    let what = what.split(" at line").next().unwrap_or_default();
    let nan = field.is_some() && ["expected value", "expected ident"].contains(&what);
    CameraFileError::Syntax {
        at: field.map_or(String::new(), |f| format!("{f}: ")),
        line: e.line(),
        column: e.column(),
        what: if nan { "must be a finite number (JSON has no NaN)".into() } else { what.into() },
    }
}

/// A camera of a scene that was read from glTF, placed by its node.
///
/// `which` is the name of the camera or of its node, or the camera's number; `None` will do where the scene has one only. A camera that several
/// nodes hold is taken at the first. glTF knows no pixels: the picture is 1080 pixels high and as wide as the aspect ratio says,
/// or 1920 without one.
pub fn from_scene(scene: &Scene, which: Option<&str>) -> Result<Camera, CameraFileError> {
    let not_there = |what: &str| CameraFileError::NotThere(what.into());
    let document = scene.gltf.as_deref().ok_or_else(|| not_there("only glTF files hold cameras"))?.document();
    let list = |key: &str| document.get(key).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let (cameras, nodes) = (list("cameras"), list("nodes"));
    // (camera, node), in the order of the nodes.
    let held: Vec<(usize, usize)> = nodes
        .iter()
        .enumerate()
        .filter_map(|(n, node)| Some((usize::try_from(node.get("camera")?.as_u64()?).ok()?, n)))
        .filter(|&(c, n)| c < cameras.len() && n < scene.nodes.len())
        .collect();
    let name = |v: &Value| v.get("name").and_then(Value::as_str).map(String::from);
    let is = |v: &Value, wanted: &str| v.get("name").and_then(Value::as_str) == Some(wanted);
    let found = match which {
        None if held.len() <= 1 => held.first(),
        None => None,
        Some(w) => held
            .iter()
            .find(|&&(c, _)| is(&cameras[c], w))
            .or_else(|| held.iter().find(|&&(_, n)| is(&nodes[n], w)))
            .or_else(|| held.iter().find(|&&(c, _)| w.parse() == Ok(c))),
    };
    let Some(&(c, n)) = found else {
        if held.is_empty() {
            return Err(not_there("no node of the scene has a camera"));
        }
        let label = |&(c, n): &(usize, usize)| {
            let name = name(&cameras[c]).or_else(|| name(&nodes[n]));
            name.map_or(c.to_string(), |name| format!("{c} ({name})"))
        };
        let all = held.iter().map(label).collect::<Vec<_>>().join(", ");
        return Err(CameraFileError::NotThere(match which {
            Some(w) => format!("no camera \"{w}\": there are {all}"),
            None => format!("several cameras; name one, or give its number: {all}"),
        }));
    };
    let element = format!("cameras[{c}]");
    let parameters = gltf_parameters(&cameras[c], &element)?;
    let world = scene.world_transforms();
    let to_world = world.get(n).copied().unwrap_or(DMat4::IDENTITY);
    Camera::placed(&to_world, &parameters).map_err(|error| CameraFileError::Camera {
        at: if error == CameraError::Transform { format!("nodes[{n}]: ") } else { format!("{element}: ") },
        error,
    })
}

fn gltf_parameters(camera: &Value, element: &str) -> Result<CameraParameters, CameraFileError> {
    let kind = camera.get("type").and_then(Value::as_str).unwrap_or_default();
    let of = |key: &str| camera.get(kind).and_then(|v| v.get(key));
    let need = |key: &str| {
        let field = format!("{element}.{kind}.{key}");
        of(key).and_then(Value::as_f64).ok_or_else(|| bad(&field, "must be a number"))
    };
    let height = SIDES.1;
    let width = |aspect: f64| {
        let pixels = (aspect * height as f64).round();
        if pixels.is_nan() { 0 } else { pixels.clamp(0.0, 65_536.0) as u32 }
    };
    let (projection, width, far) = match kind {
        "perspective" => {
            let fov_y_deg = need("yfov")?.to_degrees();
            let width = if of("aspectRatio").is_some() { width(need("aspectRatio")?) } else { SIDES.0 };
            let far = if of("zfar").is_some() { need("zfar")? } else { f64::INFINITY };
            (Projection::Perspective { fov_y_deg }, width, far)
        }
        "orthographic" => {
            let (x, y) = (need("xmag")?.abs(), need("ymag")?.abs());
            (Projection::Orthographic { ortho_height: 2.0 * y }, width(x / y), need("zfar")?)
        }
        _ => return Err(bad(&format!("{element}.type"), "must be perspective or orthographic")),
    };
    Ok(CameraParameters {
        eye: DVec3::ZERO,
        target: DVec3::NEG_Z,
        up: DVec3::Y,
        projection,
        width,
        height,
        near: need("znear")?,
        far,
    })
}
