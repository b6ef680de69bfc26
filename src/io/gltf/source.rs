//! What a document holds beside its surfaces, kept so that writing glTF again changes nothing else.

use super::accessor::{Bytes, Store};
use super::json::{array_of, uint};
use super::{MESHOPT, is_surface};
use crate::io::DecodeError;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// The document that a scene was read from, without the data of its surfaces.
///
/// Kept as written: all JSON (materials, textures, images, cameras, skins, animations, nodes, scenes, names, extras, extensions) and
/// the buffer data that something else than a surface uses. Not kept: the division into buffers (one is written), compression and
/// quantization, extensions of a primitive that describe its old triangles (Draco, outlines, n-gon coding).
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// The document. Surface primitives are without attributes, indices, targets and mode; all buffer views lie in `binary`.
    pub(super) document: Value,
    /// The bytes of all buffer views.
    pub(super) binary: Vec<u8>,
    /// For every mesh and primitive: what it held, if it is a surface.
    pub(super) surfaces: Vec<Vec<Option<Surface>>>,
}

/// The attributes a surface primitive had.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Surface {
    /// Names of its attributes, as written.
    pub(super) attributes: Vec<String>,
    /// Number of its morph targets.
    pub(super) targets: usize,
}

/// For every mesh and primitive what it held, if it was a surface: attribute names, number of morph targets.
pub(crate) type SurfaceTable = Vec<Vec<Option<(Vec<String>, usize)>>>;

/// Extensions of a primitive that describe its old triangles.
const OF_OLD_TRIANGLES: [&str; 4] = [
    "KHR_draco_mesh_compression",
    "CESIUM_primitive_outline",
    "FB_ngon_encoding",
    "EXT_mesh_primitive_edge_visibility",
];

/// Extensions that refer to accessors and buffer views only where this module looks.
fn refers_as_known(extension: &str) -> bool {
    [
        "KHR_materials_",
        "KHR_texture_",
        "KHR_lights_",
        "KHR_node_",
        "EXT_texture_",
        "KHR_mesh_quantization",
        "MSFT_",
    ]
    .iter()
    .any(|p| extension.starts_with(p))
        || MESHOPT.contains(&extension)
        || OF_OLD_TRIANGLES.contains(&extension)
        || ["EXT_mesh_gpu_instancing", "KHR_animation_pointer", "KHR_xmp_json_ld"].contains(&extension)
}

impl Source {
    /// The document, without what `encode` writes anew.
    pub fn document(&self) -> &Value {
        &self.document
    }

    /// The bytes of all its buffer views.
    pub(crate) fn binary(&self) -> &[u8] {
        &self.binary
    }

    /// What its surfaces held.
    pub(crate) fn surface_table(&self) -> SurfaceTable {
        let of = |s: &Option<Surface>| s.as_ref().map(|s| (s.attributes.clone(), s.targets));
        self.surfaces.iter().map(|m| m.iter().map(of).collect()).collect()
    }

    /// What [`Source::document`], [`Source::binary`] and [`Source::surface_table`] told of; `None` if the document is no object.
    pub(crate) fn from_table(document: Value, binary: Vec<u8>, surfaces: SurfaceTable) -> Option<Self> {
        let of =
            |s: Option<(Vec<String>, usize)>| s.map(|(attributes, targets)| Surface { attributes, targets });
        let surfaces = surfaces.into_iter().map(|m| m.into_iter().map(of).collect()).collect();
        document.is_object().then_some(Source { document, binary, surfaces })
    }

    /// Strips `document`, which has been decoded without error.
    pub(super) fn new(
        original: &Value,
        store: &Store<'_>,
        warnings: &mut Vec<String>,
    ) -> Result<Self, DecodeError> {
        let Value::Object(mut document) = original.clone() else {
            return Err(super::json::bad("document", "must be an object"));
        };
        let mut freed = Freed::default();
        let surfaces = strip_meshes(&mut document, &mut freed, warnings);

        let mut kept_accessors = BTreeSet::new();
        visit_accessors(&mut document, &mut |v| {
            kept_accessors.extend(uint(v));
        });
        freed.accessors.retain(|i| *i < store.accessors.len() && !kept_accessors.contains(i));
        let mut kept_views = BTreeSet::new();
        for (i, accessor) in array_of(&mut document, "accessors").iter_mut().enumerate() {
            let views = if freed.accessors.contains(&i) { &mut freed.views } else { &mut kept_views };
            visit_views(accessor, &mut |v| views.extend(uint(v)));
        }
        for (key, value) in &mut document {
            if key != "accessors" {
                visit_views(value, &mut |v| kept_views.extend(uint(v)));
            }
        }
        freed.views.retain(|i| *i < store.views.len() && !kept_views.contains(i));

        let binary = pack(&mut document, store, &freed.views)?;
        let used = document.get("extensionsUsed").and_then(Value::as_array);
        let compact = used.is_none_or(|u| u.iter().all(|e| e.as_str().is_some_and(refers_as_known)));
        remove_accessors(&mut document, &freed.accessors, compact);
        remove_views(&mut document, &freed.views, compact);
        remove_extensions(&mut document);
        Ok(Source { document: Value::Object(document), binary, surfaces })
    }
}

/// Accessors and views that only surfaces used.
#[derive(Default)]
struct Freed {
    accessors: BTreeSet<usize>,
    views: BTreeSet<usize>,
}

/// Takes the geometry out of all surface primitives and notes what it referred to.
fn strip_meshes(
    document: &mut Map<String, Value>,
    freed: &mut Freed,
    warnings: &mut Vec<String>,
) -> Vec<Vec<Option<Surface>>> {
    let mut dropped = BTreeSet::new();
    let mut all = Vec::new();
    for mesh in array_of(document, "meshes") {
        let mut surfaces = Vec::new();
        for primitive in mesh.as_object_mut().map_or(&mut [][..], |m| array_of(m, "primitives")) {
            if !is_surface(primitive) {
                surfaces.push(None);
                continue;
            }
            let Some(p) = primitive.as_object_mut() else { continue };
            let mut surface = Surface::default();
            for map in p
                .get("attributes")
                .into_iter()
                .chain(p.get("targets").and_then(Value::as_array).into_iter().flatten())
            {
                freed.accessors.extend(map.as_object().into_iter().flatten().filter_map(|(_, v)| uint(v)));
            }
            freed.accessors.extend(p.get("indices").and_then(uint));
            if let Some(Value::Object(attributes)) = p.get("attributes") {
                surface.attributes = attributes.keys().cloned().collect();
            }
            surface.targets = p.get("targets").and_then(Value::as_array).map_or(0, Vec::len);
            for key in ["attributes", "indices", "targets", "mode"] {
                p.shift_remove(key);
            }
            if let Some(Value::Object(extensions)) = p.get_mut("extensions") {
                for name in OF_OLD_TRIANGLES {
                    if let Some(mut old) = extensions.shift_remove(name) {
                        visit_views(&mut old, &mut |v| freed.views.extend(uint(v)));
                        dropped.insert(name);
                    }
                }
                if extensions.is_empty() {
                    p.shift_remove("extensions");
                }
            }
            surfaces.push(Some(surface));
        }
        all.push(surfaces);
    }
    for name in dropped {
        warnings.push(format!("{name} describes the triangles of the file and is not carried through"));
    }
    all
}

/// Calls `f` with every reference to an accessor that is left.
fn visit_accessors(document: &mut Map<String, Value>, f: &mut dyn FnMut(&mut Value)) {
    let mut each = |map: Option<&mut Value>| {
        for (_, v) in map.and_then(Value::as_object_mut).into_iter().flatten() {
            f(v);
        }
    };
    for mesh in array_of(document, "meshes") {
        for p in mesh.as_object_mut().map_or(&mut [][..], |m| array_of(m, "primitives")) {
            each(p.get_mut("attributes"));
            for target in p.get_mut("targets").and_then(Value::as_array_mut).into_iter().flatten() {
                each(Some(target));
            }
        }
    }
    for node in array_of(document, "nodes") {
        each(node.pointer_mut("/extensions/EXT_mesh_gpu_instancing/attributes"));
    }
    let mut single = |v: Option<&mut Value>| v.map(&mut *f);
    for mesh in array_of(document, "meshes") {
        for p in mesh.as_object_mut().map_or(&mut [][..], |m| array_of(m, "primitives")) {
            single(p.get_mut("indices"));
        }
    }
    for animation in array_of(document, "animations") {
        for sampler in animation.as_object_mut().map_or(&mut [][..], |a| array_of(a, "samplers")) {
            single(sampler.get_mut("input"));
            single(sampler.get_mut("output"));
        }
    }
    for skin in array_of(document, "skins") {
        single(skin.get_mut("inverseBindMatrices"));
    }
}

/// Calls `f` with every `bufferView` reference in `value`. Depth is bounded by the parser's limit.
fn visit_views(value: &mut Value, f: &mut dyn FnMut(&mut Value)) {
    match value {
        Value::Object(map) => {
            for (key, v) in map {
                if key == "bufferView" && v.is_number() {
                    f(v);
                } else if key != "extras" {
                    visit_views(v, f);
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|v| visit_views(v, f)),
        _ => {}
    }
}

/// Copies the bytes of all views but the freed ones to one buffer, and points the views there. Views that overlap still do,
/// and offsets keep their remainder by 4, since accessors may make up for it.
fn pack(
    document: &mut Map<String, Value>,
    store: &Store<'_>,
    freed: &BTreeSet<usize>,
) -> Result<Vec<u8>, DecodeError> {
    let mut kept: BTreeMap<usize, Bytes> = BTreeMap::new();
    for i in (0..store.views.len()).filter(|i| !freed.contains(i)) {
        kept.insert(i, store.view(i)?);
    }
    let mut binary = Vec::new();
    let mut offsets: BTreeMap<usize, usize> = BTreeMap::new();
    let mut by_place: Vec<(Option<usize>, usize, usize)> =
        kept.iter().map(|(&i, b)| (b.buffer, b.range.start, i)).collect();
    by_place.sort_unstable();
    // The run of overlapping views being copied: its buffer, the bytes of it up to here, and where it went.
    let mut run: Option<(usize, usize, usize)> = None;
    for (buffer, start, i) in by_place {
        let bytes = &kept[&i];
        let shift = match (run, buffer) {
            (Some((b, end, shift)), Some(of)) if b == of && start < end => shift,
            _ => {
                while binary.len() % 4 != start % 4 {
                    binary.push(0);
                }
                binary.len().wrapping_sub(start)
            }
        };
        // Of a view that overlaps the run, only what the run does not have yet.
        let have = start.wrapping_add(shift);
        let done = binary.len().wrapping_sub(have).min(bytes.range.len());
        binary.extend_from_slice(&bytes.slice()[done..]);
        offsets.insert(i, have);
        run = buffer.map(|b| {
            let end = bytes.range.end.max(run.filter(|r| r.0 == b && r.2 == shift).map_or(0, |r| r.1));
            (b, end, shift)
        });
    }
    for (i, view) in array_of(document, "bufferViews").iter_mut().enumerate() {
        let Some(v) = view.as_object_mut() else { continue };
        v.insert("buffer".into(), json!(0));
        if let Some(&offset) = offsets.get(&i) {
            v.insert("byteOffset".into(), json!(offset));
        }
        let mut empty = false;
        if let Some(Value::Object(extensions)) = v.get_mut("extensions") {
            extensions.retain(|name, _| !MESHOPT.contains(&name.as_str()));
            empty = extensions.is_empty();
        }
        if empty {
            v.shift_remove("extensions");
        }
    }
    let old = document.shift_remove("buffers");
    // The name and extras of the first buffer go to the one that is written.
    let mut buffer = Map::new();
    for key in ["name", "extras"] {
        if let Some(v) = old.as_ref().and_then(|b| b.get(0)?.get(key)) {
            buffer.insert(key.into(), v.clone());
        }
    }
    document.insert("buffers".into(), json!([buffer]));
    Ok(binary)
}

/// New index of each element when those in `freed` go.
fn renumber(len: usize, freed: &BTreeSet<usize>) -> Vec<usize> {
    let mut next = 0;
    (0..len)
        .map(|i| {
            let here = next;
            next += !freed.contains(&i) as usize;
            here
        })
        .collect()
}

fn remap(v: &mut Value, map: &[usize]) {
    if let Some(&to) = uint(v).and_then(|i| map.get(i)) {
        *v = json!(to);
    }
}

/// Takes the freed accessors out; or, where an extension may refer to accessors in a way not known here, leaves one of a byte in
/// place of each.
fn remove_accessors(document: &mut Map<String, Value>, freed: &BTreeSet<usize>, compact: bool) {
    let list = array_of(document, "accessors");
    if !compact {
        for &i in freed {
            let view = list[i].get("bufferView").cloned();
            list[i] = json!({"componentType": 5121, "count": 1, "type": "SCALAR"});
            if let Some(view) = view {
                list[i]["bufferView"] = view;
            }
        }
        return;
    }
    let map = renumber(list.len(), freed);
    retain(document, "accessors", freed);
    visit_accessors(document, &mut |v| remap(v, &map));
}

/// As [`remove_accessors`]: the stand-in is a view of the first byte.
fn remove_views(document: &mut Map<String, Value>, freed: &BTreeSet<usize>, compact: bool) {
    let list = array_of(document, "bufferViews");
    if !compact {
        for &i in freed {
            list[i] = json!({"buffer": 0, "byteLength": 1});
        }
        return;
    }
    let map = renumber(list.len(), freed);
    retain(document, "bufferViews", freed);
    for (_, value) in document {
        visit_views(value, &mut |v| remap(v, &map));
    }
}

fn retain(document: &mut Map<String, Value>, key: &str, freed: &BTreeSet<usize>) {
    if let Some(Value::Array(list)) = document.get_mut(key) {
        let mut i = 0;
        list.retain(|_| {
            i += 1;
            !freed.contains(&(i - 1))
        });
    }
}

/// Takes the extensions that are undone off the document's lists.
fn remove_extensions(document: &mut Map<String, Value>) {
    let quantized = quantized_rest(document);
    for list in ["extensionsUsed", "extensionsRequired"] {
        if let Some(Value::Array(names)) = document.get_mut(list) {
            names.retain(|n| match n.as_str() {
                Some("KHR_mesh_quantization") => quantized,
                Some(n) => !MESHOPT.contains(&n) && !OF_OLD_TRIANGLES.contains(&n),
                None => true,
            });
            if names.is_empty() {
                document.shift_remove(list);
            }
        }
    }
}

/// True if a primitive that is carried through (points, lines) has attributes that are legal only with `KHR_mesh_quantization`.
fn quantized_rest(document: &mut Map<String, Value>) -> bool {
    let accessors: Vec<Option<usize>> =
        array_of(document, "accessors").iter().map(|a| a.get("componentType").and_then(uint)).collect();
    let mut found = false;
    for mesh in array_of(document, "meshes") {
        for p in mesh.as_object_mut().map_or(&mut [][..], |m| array_of(m, "primitives")) {
            let targets = p.get("targets").and_then(Value::as_array).into_iter().flatten();
            for (name, v) in
                p.get("attributes").into_iter().chain(targets).filter_map(Value::as_object).flatten()
            {
                let float = uint(v).and_then(|i| *accessors.get(i)?) == Some(5126);
                let geometric = matches!(name.as_str(), "POSITION" | "NORMAL" | "TANGENT")
                    || name.starts_with("TEXCOORD_");
                found |= geometric && !float;
            }
        }
    }
    found
}
