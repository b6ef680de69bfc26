//! From a document to a scene.

use super::accessor::{Budget, Store};
use super::json::At;
use super::source::Source;
use super::{MESHOPT, container, images, vertices};
use crate::io::{DecodeError, Decoded, Side};
use crate::scene::{Node, Scene};
use glam::{DMat4, DQuat, DVec3};
use serde_json::Value;

/// Required extensions that change nothing of what is read, and are written again as they were.
const CARRIED: [&str; 12] = [
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "EXT_texture_avif",
    "EXT_lights_image_based",
    "EXT_lights_ies",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MSFT_lod",
];

/// True if a file that requires this extension can be read.
fn is_supported(extension: &str) -> bool {
    CARRIED.contains(&extension) || MESHOPT.contains(&extension) || extension.starts_with("KHR_materials_")
}

/// Decodes a `.gltf` or `.glb` file; which one is seen from its bytes. Buffers and images in other files come through `side`.
///
/// Errors name the element by its JSON path. Never panics, whatever the bytes; takes memory in proportion to them. A missing
/// buffer is an error, a missing image a warning.
pub fn decode(bytes: &[u8], side: &dyn Side) -> Result<Decoded, DecodeError> {
    let container = container::open(bytes)?;
    let mut warnings = container.warnings;
    let document = container.document;
    let root = At::root(&document);
    check_header(&root)?;
    let buffers = container::buffers(&root, container.binary, side)?;
    let data: usize = buffers.iter().flatten().map(|b| b.len()).sum();
    let budget = Budget::for_input(bytes.len().saturating_add(data));
    let store = Store::new(&root, &buffers, budget)?;

    let mut scene = Scene::default();
    let materials = root.list("materials")?;
    let image_count = root.list("images")?.len();
    for material in &materials {
        scene.materials.push(images::material(&root, material, image_count)?);
    }
    scene.images = images::images(&root, &store, side, &mut warnings)?;
    images::check_textures(&mut scene.materials, &scene.images);
    let meshes = root.list("meshes")?;
    let mut notes = vertices::Notes::default();
    for mesh in &meshes {
        scene.meshes.push(vertices::mesh(mesh, &store, materials.len(), &mut notes)?);
    }
    warnings.extend(notes.sentences());
    (scene.nodes, scene.roots) = nodes(&root, meshes.len())?;
    scene.gltf = Some(Box::new(Source::new(&document, &store, &mut warnings)?));
    Ok(Decoded { scene, warnings })
}

fn check_header(root: &At<'_>) -> Result<(), DecodeError> {
    root.object()?;
    let asset = root.need("asset")?;
    let version = asset.get("minVersion").map_or_else(|| asset.need("version"), Ok)?;
    let text = version.string()?;
    match text.split_once('.') {
        Some(("2", "0")) => {}
        Some(("2", _)) if asset.get("minVersion").is_none() => {}
        Some((major, minor)) if major.parse::<u32>().is_ok() && minor.parse::<u32>().is_ok() => {
            return Err(DecodeError::Unsupported { what: format!("glTF version {text}") });
        }
        _ => return Err(version.bad(format!("\"{text}\": must be \"2.0\""))),
    }
    for extension in root.list("extensionsRequired")? {
        let name = extension.string()?;
        if !is_supported(name) {
            return Err(DecodeError::Unsupported { what: format!("the glTF extension {name}") });
        }
    }
    Ok(())
}

/// The nodes and those of them without a parent. Errors when they are no forest.
fn nodes(root: &At<'_>, meshes: usize) -> Result<(Vec<Node>, Vec<usize>), DecodeError> {
    let list = root.list("nodes")?;
    let mut out = Vec::with_capacity(list.len());
    let mut has_parent = vec![false; list.len()];
    for node in &list {
        let mut children = Vec::new();
        for child in node.list("children")? {
            let c = child.as_index(list.len(), "nodes")?;
            if std::mem::replace(&mut has_parent[c], true) {
                return Err(child.bad(format!("node {c} has a parent already")));
            }
            children.push(c);
        }
        let mesh = node.index("mesh", meshes, "meshes")?;
        out.push(Node { name: node.name(), transform: transform(node)?, mesh, children });
    }
    let tops: Vec<usize> = (0..list.len()).filter(|&i| !has_parent[i]).collect();
    // Nodes that stand for others at lower detail are not shown beside them.
    let mut stands_in = vec![false; list.len()];
    for node in &list {
        let ids = node.value.pointer("/extensions/MSFT_lod/ids").and_then(Value::as_array);
        for id in ids.into_iter().flatten() {
            if let Some(other) = id.as_u64().and_then(|i| stands_in.get_mut(i as usize)) {
                *other = true;
            }
        }
    }
    for (i, node) in out.iter_mut().enumerate() {
        if stands_in[i] && !has_parent[i] {
            node.mesh = None;
        }
    }
    let roots = tops.iter().copied().filter(|&i| !stands_in[i]).collect();
    let mut reached = vec![false; list.len()];
    let mut stack = tops;
    while let Some(n) = stack.pop() {
        reached[n] = true;
        stack.extend(&out[n].children);
    }
    match reached.iter().position(|&r| !r) {
        Some(n) => Err(list[n].bad("is its own ancestor")),
        None => Ok((out, roots)),
    }
}

fn transform(node: &At<'_>) -> Result<DMat4, DecodeError> {
    if let Some(m) = node.numbers::<16>("matrix")? {
        return Ok(DMat4::from_cols_array(&m));
    }
    let translation = node.numbers("translation")?.map_or(DVec3::ZERO, DVec3::from_array);
    let scale = node.numbers("scale")?.map_or(DVec3::ONE, DVec3::from_array);
    let rotation = node.numbers("rotation")?.map_or(DQuat::IDENTITY, DQuat::from_array);
    // Files round their quaternions, and a zero one is no rotation at all.
    let rotation = if rotation.length_squared() > 1e-20 { rotation.normalize() } else { DQuat::IDENTITY };
    Ok(DMat4::from_scale_rotation_translation(scale, rotation, translation))
}
