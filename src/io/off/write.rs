//! Writing OFF: text, with `C` and `N` where every vertex has one colour or normal.

use crate::aif::{Encoding, MeshInput, NONE, Positions, Semantic};
use crate::io::flatten::{Flat, flatten, has_named_groups};
use crate::io::text::{f64_mark, write_f32, write_f64, write_f64_long, write_place};
use crate::io::{EncodeError, EncodeOptions, Encoded, Format};
use crate::scene::Scene;
use std::io::Write;

/// Writes text OFF. Nodes are applied; polygons, f64 and line segments are kept. An attribute that differs between the corners of a
/// vertex cannot be held and is left out, but for a colour that is one for each face, which becomes the face's.
///
/// Errors: a face that names a missing vertex, a coordinate that is not finite.
pub fn encode(scene: &Scene, options: &EncodeOptions) -> Result<Encoded, EncodeError> {
    let flat = flatten(scene, "OFF");
    let mut warnings = flat.warnings.clone();
    let g = &*flat.geometry;
    let vertices = g.positions.len();
    let corners: usize = (0..g.face_count()).map(|f| face_size(g, f)).sum();
    let out_of_range = g.corners.iter().chain(g.wires.as_flattened()).find(|&&v| v as usize >= vertices);
    if let Some(v) = out_of_range {
        return Err(cannot_hold(format!("vertex {v} of {vertices}, which a face names")));
    }
    if corners != g.corners.len() || g.wedges.as_ref().is_some_and(|w| w.corner.len() != corners) {
        return Err(cannot_hold("faces whose sizes do not add up to the corners".into()));
    }
    if let Some(v) = g.positions.iter().position(|p| !p.is_finite()) {
        return Err(cannot_hold(format!("vertex {v}, which has a coordinate that is not finite")));
    }
    let normals = channel(g, &Semantic::Normal).and_then(|k| per_vertex(g, k));
    let uvs = channel(g, &Semantic::TexCoord(0)).and_then(|k| per_vertex(g, k));
    let color = channel(g, &Semantic::Color(0));
    let vertex_colors = color.and_then(|k| per_vertex(g, k));
    let face_colors = if vertex_colors.is_some() { None } else { color.and_then(|k| per_face(g, k)) };
    say_lost(
        scene,
        &flat,
        [normals.is_some(), uvs.is_some(), vertex_colors.is_some() || face_colors.is_some()],
        &mut warnings,
    );

    let mut out = Vec::with_capacity(40 * vertices + 8 * g.corners.len() + 64);
    for (mark, has) in [("ST", uvs.is_some()), ("C", vertex_colors.is_some()), ("N", normals.is_some())] {
        out.extend_from_slice(if has { mark.as_bytes() } else { b"" });
    }
    // Writing to a Vec cannot fail.
    let _ = write!(out, "OFF\n{vertices} {} 0\n", g.face_count() + g.wires.len());
    let bytes = color.is_some_and(|k| whole_colors(g, k));
    let row = |w: u32, k: usize| g.wedges.as_ref().and_then(|x| x.get(w, k)).unwrap_or(&[]);
    let mark = match &g.positions {
        Positions::F32(_) => None,
        Positions::F64(p) => f64_mark(p.as_flattened().iter().copied()),
    };
    for v in 0..vertices {
        for k in 0..3 {
            out.extend_from_slice(if k > 0 { b" " } else { b"" });
            match &g.positions {
                Positions::F32(p) => write_place(&mut out, p[v][k], options.all_digits),
                Positions::F64(p) if mark == Some(3 * v + k) => write_f64_long(&mut out, p[v][k]),
                Positions::F64(p) => write_f64(&mut out, p[v][k]),
            }
        }
        if let Some((k, of)) = &normals {
            padded(&mut out, row(of[v], *k), 3, false);
        }
        if let Some((k, of)) = &vertex_colors {
            padded(&mut out, row(of[v], *k), width(g, *k), bytes);
        }
        if let Some((k, of)) = &uvs {
            padded(&mut out, row(of[v], *k), 2, false);
        }
        out.push(b'\n');
    }
    let mut at = 0;
    for f in 0..g.face_count() {
        let n = face_size(g, f);
        let _ = write!(out, "{n}");
        for v in &g.corners[at..at + n] {
            let _ = write!(out, " {v}");
        }
        at += n;
        if let Some((k, of)) = &face_colors
            && !row(of[f], *k).is_empty()
        {
            padded(&mut out, row(of[f], *k), width(g, *k), bytes);
        }
        out.push(b'\n');
    }
    for [a, b] in &g.wires {
        let _ = writeln!(out, "2 {a} {b}");
    }
    Ok(Encoded { bytes: out, side: Vec::new(), warnings })
}

fn cannot_hold(what: String) -> EncodeError {
    EncodeError::CannotHold { format: Format::Off, what }
}

fn face_size(g: &MeshInput, f: usize) -> usize {
    g.face_sizes.as_ref().map_or(3, |s| s[f] as usize)
}

fn channel(g: &MeshInput, semantic: &Semantic) -> Option<usize> {
    g.wedges.as_ref()?.channel(semantic)
}

fn width(g: &MeshInput, k: usize) -> usize {
    g.wedges.as_ref().map_or(0, |w| w.channels()[k].width)
}

/// True if the channel was stored in bytes: then it is written in whole numbers to 255. Unless none would be above 1, when a
/// reader would take them for floats.
fn whole_colors(g: &MeshInput, k: usize) -> bool {
    let Some(w) = &g.wedges else { return false };
    w.channels()[k].encoding == Encoding::U8Norm
        && (0..w.len() as u32).filter_map(|i| w.get(i, k)).any(|c| c.iter().take(3).any(|x| x * 255.0 > 1.5))
}

/// The numbers, or zeros where there are none (an isolated vertex).
fn padded(out: &mut Vec<u8>, values: &[f32], width: usize, bytes: bool) {
    for k in 0..width {
        let x = values.get(k).copied().unwrap_or(0.0);
        out.push(b' ');
        if bytes {
            let _ = write!(out, "{}", (x * 255.0).round().clamp(0.0, 255.0));
            continue;
        }
        let start = out.len();
        write_f32(out, x);
        // A float must look like one.
        if !out[start..].iter().any(|b| matches!(b, b'.' | b'e')) {
            out.extend_from_slice(b".0");
        }
    }
}

/// A wedge for every vertex that stands for all its corners in channel `k`; `None` if there is no such.
fn per_vertex(g: &MeshInput, k: usize) -> Option<(usize, Vec<u32>)> {
    let mut of = vec![None; g.positions.len()];
    shared(g, k, &mut of, g.corners.iter().map(|&v| v as usize))?;
    Some((k, of.into_iter().map(|w| w.unwrap_or(NONE)).collect()))
}

/// The same for every face.
fn per_face(g: &MeshInput, k: usize) -> Option<(usize, Vec<u32>)> {
    let mut of = vec![None; g.face_count()];
    let face_of = (0..g.face_count()).flat_map(|f| std::iter::repeat_n(f, face_size(g, f)));
    shared_or_absent(g, k, &mut of, face_of, true)?;
    Some((k, of.into_iter().map(|w| w.unwrap_or(NONE)).collect()))
}

fn shared(g: &MeshInput, k: usize, of: &mut [Option<u32>], to: impl Iterator<Item = usize>) -> Option<()> {
    shared_or_absent(g, k, of, to, false)
}

/// Finds one wedge for all corners that go to the same place; `None` if two differ, or (unless `absent` is allowed) one has no value.
fn shared_or_absent(
    g: &MeshInput,
    k: usize,
    of: &mut [Option<u32>],
    to: impl Iterator<Item = usize>,
    absent: bool,
) -> Option<()> {
    let wedges = g.wedges.as_ref()?;
    for (&w, place) in wedges.corner.iter().zip(to) {
        let value = wedges.get(w, k);
        if value.is_none() && !absent {
            return None;
        }
        match of[place] {
            None => of[place] = Some(w),
            Some(other) if other == w => {}
            Some(other) => {
                let bits =
                    |v: Option<&[f32]>| v.map(|v| v.iter().map(|x| (x + 0.0).to_bits()).collect::<Vec<_>>());
                if bits(wedges.get(other, k)) != bits(value) {
                    return None;
                }
            }
        }
    }
    Some(())
}

/// Says what is not in the file.
fn say_lost(scene: &Scene, flat: &Flat<'_>, [normals, uvs, colors]: [bool; 3], warnings: &mut Vec<String>) {
    let g = &*flat.geometry;
    let mut lost: Vec<&str> = Vec::new();
    for c in g.wedges.iter().flat_map(|w| w.channels()) {
        match c.semantic {
            Semantic::Normal if !normals => lost.push("normals that differ at a vertex"),
            Semantic::TexCoord(0) if !uvs => lost.push("texture coordinates that differ at a vertex"),
            Semantic::Color(0) if !colors => lost.push("colours that differ at a vertex"),
            Semantic::Normal | Semantic::TexCoord(0) | Semantic::Color(0) => {}
            _ => lost.push("other attributes"),
        }
    }
    if !scene.materials.is_empty() && g.face_material.iter().any(|&m| m != NONE) {
        lost.push("materials");
    }
    if has_named_groups(g, &flat.groups, flat.name) {
        lost.push("groups");
    }
    lost.dedup();
    if !lost.is_empty() {
        warnings.push(format!("OFF cannot hold {}: left out", lost.join(", ")));
    }
}
