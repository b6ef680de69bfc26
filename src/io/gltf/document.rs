//! A document for a scene that came from another format.

use super::geometry::{self, Shape};
use super::writer::{Placed, Writer};
use super::{images, semantic};
use crate::aif::Positions;
use crate::io::EncodeError;
use crate::io::flatten::{has_named_groups, turn_v_over};
use crate::scene::{Material, Node, Scene, SceneMesh};
use glam::{DMat4, DVec3};
use serde_json::{Map, Value, json};

/// Makes the document of a scene without a source.
pub(super) fn build(scene: &Scene, writer: &mut Writer) -> Result<(Value, Vec<Option<Placed>>), EncodeError> {
    let mut document = Map::new();
    let generator = concat!("progmesh ", env!("CARGO_PKG_VERSION"));
    document.insert("asset".into(), json!({"version": "2.0", "generator": generator}));

    // Meshes; an index of `scene.meshes` -> where it is in the document.
    let mut meshes: Vec<Value> = Vec::new();
    let mut placed: Vec<Option<Placed>> = Vec::new();
    for mesh in &scene.meshes {
        if has_named_groups(&mesh.geometry, &mesh.groups, mesh.name.as_deref()) {
            writer.warn("glTF has no groups inside a mesh: their names were left out".into());
        }
        let offset = offset_of(&mesh.geometry.positions);
        let Some(json) = level(mesh, offset, scene.materials.len(), writer)? else {
            writer.warn(
                "glTF cannot hold a mesh without faces, edges and vertices: its node stays without one"
                    .into(),
            );
            placed.push(None);
            continue;
        };
        placed.push(Some(Placed { index: meshes.len(), offset }));
        meshes.push(Value::Object(json));
    }
    let mut nodes = nodes(scene, &placed);
    let roots: Vec<usize> = scene.roots.iter().copied().filter(|&r| r < scene.nodes.len()).collect();
    document.insert("scene".into(), json!(0));
    let scene_json = if roots.is_empty() { json!({}) } else { json!({"nodes": roots}) };
    document.insert("scenes".into(), json!([scene_json]));
    nodes.iter_mut().for_each(drop_empty);

    let textures = images::embed(scene, writer);
    let mut strong = false;
    let materials: Vec<Value> = scene.materials.iter().map(|m| material(m, &textures, &mut strong)).collect();
    if strong {
        document.insert("extensionsUsed".into(), json!([EMISSIVE]));
    }
    for (key, list) in [
        ("nodes", nodes),
        ("meshes", meshes),
        ("materials", materials),
        ("textures", textures.textures),
        (
            "samplers",
            if textures.images.is_empty() { vec![] } else { vec![json!({"wrapS": 10497, "wrapT": 10497})] },
        ),
        ("images", textures.images),
    ] {
        if !list.is_empty() {
            document.insert(key.into(), Value::Array(list));
        }
    }
    Ok((Value::Object(document), placed))
}

/// The JSON of a mesh whose vertices are moved by `-offset`; `None` if there is nothing of it.
pub(super) fn level(
    mesh: &SceneMesh,
    offset: DVec3,
    materials: usize,
    writer: &mut Writer,
) -> Result<Option<Map<String, Value>>, EncodeError> {
    let mesh = prepare(mesh, offset, writer);
    let written = geometry::primitives(&mesh, 0, true, writer)?;
    if written.is_empty() {
        return Ok(None);
    }
    let primitives: Vec<Value> = written
        .into_iter()
        .map(|w| {
            debug_assert!(w.group.is_none() || w.shape == Shape::Triangles);
            w.into_json(Map::new(), materials)
        })
        .collect();
    let mut json = named(mesh.name.as_deref());
    json.insert("primitives".into(), Value::Array(primitives));
    Ok(Some(json))
}

const EMISSIVE: &str = "KHR_materials_emissive_strength";

fn named(name: Option<&str>) -> Map<String, Value> {
    let mut map = Map::new();
    if let Some(n) = name.filter(|n| !n.is_empty()) {
        map.insert("name".into(), json!(n));
    }
    map
}

fn drop_empty(node: &mut Value) {
    if let Some(n) = node.as_object_mut() {
        n.retain(|_, v| v != &json!([]));
    }
}

/// By how much to move f64 positions: where the mesh is farther away than it is large, moving gains bits.
fn offset_of(positions: &Positions) -> DVec3 {
    match (positions, positions.bounds()) {
        (Positions::F64(_), Some((lo, hi))) => {
            let center = (lo + hi) / 2.0;
            let far = center.abs().max_element() > (hi - lo).max_element();
            if far { center } else { DVec3::ZERO }
        }
        _ => DVec3::ZERO,
    }
}

/// The mesh as glTF wants it: v turned over, far-off f64 positions moved by `-offset`.
fn prepare(mesh: &SceneMesh, offset: DVec3, writer: &mut Writer) -> SceneMesh {
    let mut mesh = mesh.clone();
    if let Some(w) = &mut mesh.geometry.wedges {
        turn_v_over(w);
        for c in w.channels() {
            let allowed = semantic::widths(&c.semantic);
            if allowed.is_some_and(|a| !a.contains(&c.width)) {
                let name = semantic::name(&c.semantic).0;
                writer.warn(format!("glTF cannot hold {name} of {} numbers: left out", c.width));
            }
        }
    }
    let Positions::F64(points) = &mesh.geometry.positions else { return mesh };
    let moved: Vec<[f64; 3]> = points.iter().map(|&p| (DVec3::from_array(p) - offset).to_array()).collect();
    let worst = moved.iter().flatten().map(|&x| (x - x as f32 as f64).abs()).fold(0.0, f64::max);
    if worst > 0.0 {
        writer.warn(format!("glTF positions are f32: coordinates were rounded, by {worst:.1e} at most"));
    }
    mesh.geometry.positions = Positions::F64(moved);
    mesh
}

/// The nodes. One whose mesh was moved gets a child that moves it back; its own children stay where they are.
fn nodes(scene: &Scene, placed: &[Option<Placed>]) -> Vec<Value> {
    let mut out: Vec<Value> = Vec::new();
    let mut extra: Vec<Value> = Vec::new();
    for node in &scene.nodes {
        let mut json = named(node.name.as_deref());
        let mut children: Vec<usize> =
            node.children.iter().copied().filter(|&c| c < scene.nodes.len()).collect();
        let mut transform = node.transform;
        if let Some(Placed { index: mesh, offset }) = node.mesh.and_then(|m| placed.get(m).copied().flatten())
        {
            if offset == DVec3::ZERO || children.is_empty() {
                transform *= DMat4::from_translation(offset);
                json.insert("mesh".into(), json!(mesh));
            } else {
                children.push(scene.nodes.len() + extra.len());
                extra.push(json!({"mesh": mesh, "translation": offset.to_array()}));
            }
        }
        put_transform(&mut json, &Node { transform, ..node.clone() });
        json.insert("children".into(), json!(children));
        out.push(Value::Object(json));
    }
    out.append(&mut extra);
    out
}

fn put_transform(json: &mut Map<String, Value>, node: &Node) {
    let m = node.transform;
    let translation = m.w_axis.truncate();
    if m == DMat4::IDENTITY || !m.is_finite() {
        return;
    }
    if m == DMat4::from_translation(translation) {
        json.insert("translation".into(), json!(translation.to_array()));
    } else {
        json.insert("matrix".into(), json!(m.to_cols_array()));
    }
}

fn material(m: &Material, textures: &images::Textures, strong: &mut bool) -> Value {
    let mut json = named(Some(&m.name));
    let unit = |x: f32| x.clamp(0.0, 1.0) as f64;
    let mut base = Map::new();
    base.insert("baseColorFactor".into(), json!(m.base_color.map(unit)));
    base.insert("metallicFactor".into(), json!(unit(m.metallic)));
    base.insert("roughnessFactor".into(), json!(unit(m.roughness)));
    if let Some(t) = m.base_color_image.and_then(|i| textures.of_image(i)) {
        base.insert("baseColorTexture".into(), json!({"index": t}));
    }
    json.insert("pbrMetallicRoughness".into(), Value::Object(base));
    if let Some(t) = m.normal_image.and_then(|i| textures.of_image(i)) {
        json.insert("normalTexture".into(), json!({"index": t}));
    }
    let strength = m.emissive.iter().copied().filter(|e| e.is_finite()).fold(1.0f32, f32::max);
    if m.emissive != [0.0; 3] {
        json.insert("emissiveFactor".into(), json!(m.emissive.map(|e| unit(e / strength))));
    }
    if strength > 1.0 {
        *strong = true;
        json.insert("extensions".into(), json!({EMISSIVE: {"emissiveStrength": strength as f64}}));
    }
    if m.base_color[3] < 1.0 {
        json.insert("alphaMode".into(), json!("BLEND"));
    }
    if m.double_sided {
        json.insert("doubleSided".into(), json!(true));
    }
    if let Some(mtl) = m.mtl.as_deref().filter(|t| !t.is_empty()) {
        json.insert("extras".into(), json!({images::MTL: mtl}));
    }
    Value::Object(json)
}
