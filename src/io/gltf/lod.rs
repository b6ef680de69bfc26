//! Levels of detail in one glTF file, by `MSFT_lod`.
//!
//! The node that shows a mesh keeps it; the extension on it names further nodes, each with a coarser mesh, that may stand in its place. They
//! belong to no scene, so that a viewer without the extension shows the finest level and nothing else. `MSFT_screencoverage` in the node's
//! extras says down to which part of the screen each level is for; a last 0 lets the coarsest stay however small it becomes.

use super::encode::{add_level, begin};
use super::json::array_mut;
use super::writer::Writer;
use crate::io::{EncodeError, EncodeOptions, Encoded, Format};
use crate::scene::Scene;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

/// The extension.
const LOD: &str = "MSFT_lod";
/// The name of the thresholds among a node's extras.
const COVERAGE: &str = "MSFT_screencoverage";

/// Encodes a scene at several levels of detail, finest first, as one file. All have the same nodes and meshes; only geometry differs.
///
/// `coverage[k]` is the part of the screen, 0 to 1, from which upwards level `k` is meant. A node that has children or is moved by an
/// animation gets a child to hold its mesh, so that choosing a level changes nothing else. A mesh that has nothing left at a level has no such
/// level.
///
/// Errors: as [`super::encode`].
pub fn encode_levels(
    levels: &[Scene],
    coverage: &[f64],
    format: Format,
    options: &EncodeOptions,
) -> Result<Encoded, EncodeError> {
    let mut writer = Writer::new(format);
    let Some((finest, coarser)) = levels.split_first() else {
        return Err(writer.cannot_hold("no level at all"));
    };
    let (mut document, placed) = begin(finest, &mut writer)?;
    let Some(object) = document.as_object_mut() else {
        return Err(writer.cannot_hold("a document that is no JSON object"));
    };
    // Document's mesh -> document's meshes of the levels below, `None` where nothing is left.
    let mut below: Vec<Vec<Option<usize>>> = vec![Vec::new(); array_mut(object, "meshes").len()];
    for (k, scene) in (1..).zip(coarser) {
        for (m, place) in placed.iter().enumerate() {
            let (Some(place), Some(mesh)) = (place, scene.meshes.get(m)) else { continue };
            let json = match mesh.triangles() {
                0 => None,
                _ => add_level(object, finest, m, mesh, place, &mut writer)?,
            };
            let index = json.map(|mut json| {
                if let Some(Value::String(name)) = json.get_mut("name") {
                    *name += &format!(" LOD{k}");
                }
                let meshes = array_mut(object, "meshes");
                meshes.push(Value::Object(json));
                meshes.len() - 1
            });
            below[place.index].push(index);
        }
    }
    link_nodes(object, &below, coverage);
    writer.finish(document, options)
}

/// Gives every node that shows a mesh the nodes of its lower levels.
fn link_nodes(document: &mut Map<String, Value>, below: &[Vec<Option<usize>>], coverage: &[f64]) {
    let animated = animated_nodes(document);
    let mut retargeted = Vec::new();
    let nodes = array_mut(document, "nodes");
    let mut used = false;
    for n in 0..nodes.len() {
        let Some(node) = nodes[n].as_object() else { continue };
        let mesh = node.get("mesh").and_then(Value::as_u64).and_then(|m| below.get(m as usize));
        // What names levels already keeps them.
        let has_levels = node.get("extensions").is_some_and(|e| e.get(LOD).is_some());
        let Some(levels) = mesh.filter(|l| l.iter().any(Option::is_some) && !has_levels) else { continue };
        let alone = !node.contains_key("children") && !animated.contains(&n);
        let holder = if alone { n } else { nodes.len() };
        if !alone {
            retargeted.push((n, holder));
            let child = split_off(&mut nodes[n], holder);
            nodes.push(child);
        }
        let template = stand_in(&nodes[holder]);
        let (mut ids, mut parts) = (Vec::new(), Vec::new());
        for (k, mesh) in levels.iter().enumerate() {
            let Some(mesh) = mesh else { continue };
            let mut node = template.clone();
            node.insert("mesh".into(), json!(mesh));
            ids.push(nodes.len());
            parts.push(coverage.get(k).copied().unwrap_or(0.0));
            nodes.push(Value::Object(node));
        }
        parts.push(coverage.get(levels.len()).copied().unwrap_or(0.0));
        if let Some(holder) = nodes[holder].as_object_mut() {
            object_in(holder, "extensions").insert(LOD.into(), json!({"ids": ids}));
            object_in(holder, "extras").insert(COVERAGE.into(), json!(parts));
            used = true;
        }
    }
    retarget_weights(document, &retargeted);
    let list = array_mut(document, "extensionsUsed");
    if used && !list.iter().any(|e| e == LOD) {
        list.push(json!(LOD));
    }
    if list.is_empty() {
        document.shift_remove("extensionsUsed");
    }
}

/// Nodes that an animation moves, or that are joints.
fn animated_nodes(document: &Map<String, Value>) -> BTreeSet<usize> {
    let list = |v: &Value, key: &str| v.get(key).and_then(Value::as_array).cloned().unwrap_or_default();
    let index = |v: Option<&Value>| v.and_then(Value::as_u64).map(|n| n as usize);
    let mut found = BTreeSet::new();
    for animation in document.get("animations").and_then(Value::as_array).into_iter().flatten() {
        found.extend(list(animation, "channels").iter().filter_map(|c| index(c.get("target")?.get("node"))));
    }
    for skin in document.get("skins").and_then(Value::as_array).into_iter().flatten() {
        found.extend(list(skin, "joints").iter().filter_map(|j| index(Some(j))));
    }
    found
}

/// Moves what shows the mesh from a node into a new child, whose index is given.
fn split_off(node: &mut Value, child: usize) -> Value {
    let mut json = Map::new();
    if let Some(node) = node.as_object_mut() {
        for key in ["mesh", "skin", "weights"] {
            if let Some(v) = node.shift_remove(key) {
                json.insert(key.into(), v);
            }
        }
        array_mut(node, "children").push(json!(child));
    }
    Value::Object(json)
}

/// A node as one that shows a mesh: where it stands, how it is deformed, without mesh.
fn stand_in(node: &Value) -> Map<String, Value> {
    let keep = ["matrix", "translation", "rotation", "scale", "skin", "weights"];
    let all = node.as_object().into_iter().flatten();
    all.filter(|(k, _)| keep.contains(&k.as_str())).map(|(k, v)| (k.clone(), v.clone())).collect()
}

/// Animations of a mesh's morph weights follow it into the new node.
fn retarget_weights(document: &mut Map<String, Value>, moved: &[(usize, usize)]) {
    for animation in array_in(document, "animations") {
        let Some(animation) = animation.as_object_mut() else { continue };
        for channel in array_in(animation, "channels") {
            let Some(target) = channel.get_mut("target") else { continue };
            let node = target.get("node").and_then(Value::as_u64).map(|n| n as usize);
            let to = moved.iter().find(|m| Some(m.0) == node);
            if let (Some(to), Some("weights")) = (to, target.get("path").and_then(Value::as_str)) {
                target["node"] = json!(to.1);
            }
        }
    }
}

fn array_in<'a>(object: &'a mut Map<String, Value>, key: &str) -> impl Iterator<Item = &'a mut Value> {
    object.get_mut(key).and_then(Value::as_array_mut).into_iter().flatten()
}

/// The object at `key`, made if it is none.
fn object_in<'a>(object: &'a mut Map<String, Value>, key: &str) -> &'a mut Map<String, Value> {
    let slot = object.entry(key).or_insert_with(|| json!({}));
    if !slot.is_object() {
        *slot = json!({});
    }
    match slot {
        Value::Object(o) => o,
        _ => unreachable!("made an object above"),
    }
}
