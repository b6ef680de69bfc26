//! Hoppe's `.pm` files (version 2 of his Mesh-processing library's format), read into progressive meshes of ours.
//!
//! His records add deltas to positions, normals, colours and texture coordinates; they are evaluated once, from the base upward in f32, and what came of it is kept outright,
//! so that refining and coarsening are exact here. Faces, vertices and wedges keep his numbers at every split count.
//!
//! Not guaranteed: that the splits can be put into another order, as our own files do. His records may make wedges at vertices beside the split one,
//! which our dependencies do not know of ([`ProgressiveMesh::is_reorderable`]). `progmesh encode`, and for views `extract` and `fly`, make new splits of the mesh at full detail.

mod apply;
mod read;

use super::DecodedProgressive;
use super::chunk::wrong;
use crate::aif::{Channel, NONE, Semantic};
use crate::io::DecodeError;
use crate::progressive::ProgressiveScene;
use crate::refine::ProgressiveMesh;
use crate::scene::{Material, Scene, SceneMesh};
use apply::Builder;
use read::{Head, Reader, Record};

/// True if the bytes begin as Hoppe's files do: comment lines, then `PM`.
pub fn looks_like(bytes: &[u8]) -> bool {
    let mut rest = bytes;
    while rest.first() == Some(&b'#') {
        match rest.iter().position(|&b| b == b'\n') {
            Some(end) => rest = &rest[end + 1..],
            None => return false,
        }
    }
    rest.starts_with(b"PM\n") || rest.starts_with(b"PM\r\n")
}

/// Reads a file. A split's error is the residual that the file gives, else how far it moves a vertex; errors are raised where a split depends on
/// one with a smaller one.
///
/// Errors: damage, by the split where it shows; another version. Never panics, whatever the bytes.
pub fn decode(bytes: &[u8]) -> Result<DecodedProgressive, DecodeError> {
    let mut reader = Reader::new(bytes);
    let head = reader.head()?;
    let mut builder = Builder::base(&mut reader, &head)?;
    let mut splits = 0;
    while splits < head.splits && !reader.at_end() {
        let record = Record::read(&mut reader, &head)?;
        builder.split(&record).map_err(|what| wrong(&format!("split {splits}"), what))?;
        splits += 1;
    }
    let mut warnings = Vec::new();
    let counts = builder.counts();
    if splits < head.splits {
        warnings.push(format!("the file ends after {splits} of {} splits", head.splits));
    } else if counts != head.full {
        let [v, w, f] = counts;
        let what = format!("full detail has {v} vertices, {w} wedges, {f} faces; others are announced");
        return Err(wrong("head", what));
    }
    let mut mesh = builder.finish(channels(&head));
    nest_errors(&mut mesh);
    let mut cursor = mesh.cursor().map_err(|e| wrong("base mesh", e.to_string()))?;
    cursor.seek(usize::MAX).map_err(|e| wrong("splits", e.to_string()))?;
    let mut shell = Scene::from_mesh(SceneMesh::default());
    shell.materials = head.materials.iter().map(|m| material(m)).collect();
    let scene = ProgressiveScene { turns: vec![0; splits], meshes: vec![mesh], shell, leftovers: vec![] };
    Ok(DecodedProgressive { scene, report: None, warnings })
}

fn channels(head: &Head) -> Vec<Channel> {
    let mut channels = vec![Channel::new(Semantic::Normal, 3)];
    if head.has_rgb {
        channels.push(Channel::new(Semantic::Color(0), 3));
    }
    if head.has_uv {
        channels.push(Channel::new(Semantic::TexCoord(0), 2));
    }
    channels
}

/// Raises errors so that no split's passes that of one it depends on.
fn nest_errors(mesh: &mut ProgressiveMesh) {
    let on = mesh.dependencies();
    let error = &mut mesh.splits.error;
    for i in (0..on.len()).rev() {
        for d in on[i].into_iter().filter(|&d| d != NONE) {
            error[d as usize] = error[d as usize].max(error[i]);
        }
    }
}

/// A material from its string: `mat="name" ... rgb=(r g b) ...`.
fn material(text: &str) -> Material {
    let name = text.split_once("mat=\"").and_then(|(_, rest)| Some(rest.split_once('"')?.0));
    let rgb = text.split_once("rgb=(").and_then(|(_, rest)| Some(rest.split_once(')')?.0));
    let mut out = Material { name: name.unwrap_or(text).to_string(), ..Default::default() };
    let values: Vec<f32> =
        rgb.into_iter().flat_map(str::split_whitespace).filter_map(|x| x.parse().ok()).collect();
    if let [r, g, b] = values[..]
        && values.iter().all(|x| x.is_finite())
    {
        out.base_color = [r, g, b, 1.0];
    }
    out
}
