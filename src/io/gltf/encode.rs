//! From a scene to a file: the document patched or made, the data of the meshes, the container.

use super::geometry::{self, Shape};
use super::json::array_mut;
use super::source::Surface;
use super::writer::{Placed, Writer};
use super::{document, images};
use crate::io::{EncodeError, EncodeOptions, Encoded, Format};
use crate::scene::{Scene, SceneMesh};
use glam::DVec3;
use serde_json::{Map, Value, json};

/// Encodes a scene as `.glb` ([`Format::Glb`]) or as `.gltf` with a `<stem>.bin` beside it.
///
/// With a [`super::Source`] the document stays as it was but for the surfaces of its meshes, which come from `scene.meshes`
/// (meshes beyond the document's are left out, with a warning). Written plain: no quantization, no compression, each
/// vertex once per primitive, indices of 16 bits when they fit. A primitive that has no faces left is left out; of a mesh that has none
/// left a triangle without area stays, so that what refers to the mesh stays valid.
///
/// Positions are f32 in the format: a scene's f64 positions are rounded, and said so; without a `Source`, meshes far from the
/// origin are moved to it and their nodes back.
///
/// Errors: a position that is not finite in f32; more than 4 GiB.
pub fn encode(scene: &Scene, format: Format, options: &EncodeOptions) -> Result<Encoded, EncodeError> {
    let mut writer = Writer::new(format);
    writer.link_images = options.link_images;
    let (document, _) = begin(scene, &mut writer)?;
    writer.finish(document, options)
}

/// What is said of a scene, as extras of the first.
fn add_facts(document: &mut Value, scene: &Scene) {
    if let Some(Value::Object(first)) = document.pointer_mut("/scenes/0").filter(|_| !scene.facts.is_empty())
    {
        let extras = first.entry("extras").or_insert_with(|| json!({}));
        if let Value::Object(extras) = extras {
            extras.extend(scene.facts.clone());
        }
    }
}

/// The document of a scene, and where its meshes are in it; what else belongs to the file is in `writer`.
pub(super) fn begin(scene: &Scene, writer: &mut Writer) -> Result<(Value, Vec<Option<Placed>>), EncodeError> {
    let Some(source) = &scene.gltf else {
        let (mut document, placed) = document::build(scene, writer)?;
        add_facts(&mut document, scene);
        return Ok((document, placed));
    };
    let mut document = patch(scene, source, writer)?;
    let mut placed = Vec::new();
    if let Value::Object(document) = &mut document {
        images::place(document, scene, writer);
        let there = document.get("meshes").and_then(Value::as_array).map_or(0, Vec::len);
        let place = |index| (index < there).then_some(Placed { index, offset: DVec3::ZERO });
        placed = (0..scene.meshes.len()).map(place).collect();
    }
    add_facts(&mut document, scene);
    Ok((document, placed))
}

/// The JSON of mesh `m` of `scene` at another level of detail, `mesh`; `None` if nothing is left of it. `document` is what [`begin`] made of
/// `scene`.
pub(super) fn add_level(
    document: &Map<String, Value>,
    scene: &Scene,
    m: usize,
    mesh: &SceneMesh,
    place: &Placed,
    writer: &mut Writer,
) -> Result<Option<Map<String, Value>>, EncodeError> {
    let Some(source) = &scene.gltf else {
        return document::level(mesh, place.offset, scene.materials.len(), writer);
    };
    let materials = document.get("materials").and_then(Value::as_array).map_or(0, Vec::len);
    let original = source.document.get("meshes").and_then(|v| v.get(m)).and_then(Value::as_object);
    let Some(mut json) = original.cloned() else { return Ok(None) };
    let surfaces = source.surfaces.get(m).map_or(&[][..], Vec::as_slice);
    let old = std::mem::take(array_mut(&mut json, "primitives"));
    // Points and lines are no surface, and stay at every level.
    let done = replace_surfaces(old, surfaces, Some(mesh), materials, writer)?;
    let nothing = done.hollow || done.primitives.is_empty();
    *array_mut(&mut json, "primitives") = done.primitives;
    Ok((!nothing).then_some(json))
}

/// The source's document with the scene's meshes.
fn patch(scene: &Scene, source: &super::Source, writer: &mut Writer) -> Result<Value, EncodeError> {
    let mut document = source.document.clone();
    let Some(object) = document.as_object_mut() else {
        return Err(writer.cannot_hold("a document that is no JSON object"));
    };
    writer.binary = source.binary.clone();
    writer.base_view = object.get("bufferViews").and_then(Value::as_array).map_or(0, Vec::len);
    writer.base_accessor = object.get("accessors").and_then(Value::as_array).map_or(0, Vec::len);
    let materials = object.get("materials").and_then(Value::as_array).map_or(0, Vec::len);
    let meshes = array_mut(object, "meshes");
    if scene.meshes.len() > meshes.len() {
        let n = scene.meshes.len() - meshes.len();
        writer.warn(format!("{n} meshes that the document does not have were left out"));
    }
    let (mut lost, mut hollow) = (0, 0);
    for (m, json) in meshes.iter_mut().enumerate() {
        let Some(mesh) = json.as_object_mut() else { continue };
        let surfaces = source.surfaces.get(m).map_or(&[][..], Vec::as_slice);
        let old = std::mem::take(array_mut(mesh, "primitives"));
        let done = replace_surfaces(old, surfaces, scene.meshes.get(m), materials, writer)?;
        lost += done.lost;
        hollow += done.hollow as usize;
        *array_mut(mesh, "primitives") = done.primitives;
    }
    if lost > 0 {
        writer.warn(format!("{lost} primitives have no faces left and were left out; their materials stay"));
    }
    if hollow > 0 {
        writer.warn(format!("{hollow} meshes have no faces left; a triangle without area stands for each"));
    }
    if meshes.is_empty() {
        object.shift_remove("meshes");
    }
    Ok(document)
}

/// The primitives of a mesh with new surfaces.
struct Replaced {
    primitives: Vec<Value>,
    /// Primitives that have no faces left.
    lost: usize,
    /// Nothing was left: a triangle without area stands for all.
    hollow: bool,
}

/// Puts the surfaces of `mesh` in the place of those of a document's primitives.
fn replace_surfaces(
    old: Vec<Value>,
    surfaces: &[Option<Surface>],
    mesh: Option<&SceneMesh>,
    materials: usize,
    writer: &mut Writer,
) -> Result<Replaced, EncodeError> {
    let targets = surfaces.iter().flatten().map(|s| s.targets).max().unwrap_or(0);
    let mut written = match mesh {
        Some(mesh) => geometry::primitives(mesh, targets, false, writer)?,
        None => Vec::new(),
    };
    let mut out = Replaced { primitives: Vec::new(), lost: 0, hollow: false };
    let mut template = None;
    for (p, primitive) in old.into_iter().enumerate() {
        let Some(surface) = surfaces.get(p).and_then(Option::as_ref) else {
            out.primitives.push(primitive);
            continue;
        };
        let mut found = false;
        for part in written.extract_if(.., |w| w.group == Some(p as u32) && w.shape == Shape::Triangles) {
            out.primitives
                .push(part.into_json(primitive.as_object().cloned().unwrap_or_default(), materials));
            found = true;
        }
        out.lost += !found as usize;
        template.get_or_insert((primitive, surface));
    }
    // Faces of no primitive of the document, and wires.
    out.primitives.extend(written.into_iter().map(|w| w.into_json(Map::new(), materials)));
    if out.primitives.is_empty()
        && let Some((primitive, surface)) = template
    {
        out.hollow = true;
        let body = primitive.as_object().cloned().unwrap_or_default();
        out.primitives
            .push(geometry::hollow(&surface.attributes, surface.targets, writer).into_json(body, materials));
    }
    Ok(out)
}
