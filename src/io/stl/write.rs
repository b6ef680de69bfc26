//! Writing STL.

use super::{FACET, HEADER};
use crate::aif::triangulate_polygon;
use crate::aif::{MeshInput, NONE, Positions, Semantic};
use crate::io::flatten::{Flat, flatten, has_named_groups};
use crate::io::text::{f64_mark, write_f32, write_f64, write_f64_long, write_place};
use crate::io::{EncodeError, EncodeOptions, Encoded, Format};
use crate::scene::Scene;
use glam::DVec3;

/// A facet: its vertices, and the face it was cut from.
struct Facet {
    vertices: [u32; 3],
    face: usize,
}

/// Writes STL: binary, or text with `options.text`. Nodes are applied, polygons cut into triangles, normals computed from the
/// points (zero for a facet without area). Text keeps f64 and writes a solid for each group; binary is f32.
///
/// Errors: a coordinate that is not finite or that f32 cannot hold, a face that names a missing vertex, 2^32 facets and more.
pub fn encode(scene: &Scene, options: &EncodeOptions) -> Result<Encoded, EncodeError> {
    let flat = flatten(scene, "STL");
    let mut warnings = flat.warnings.clone();
    let facets = facets(&flat.geometry, &mut warnings)?;
    left_out(scene, &flat.geometry, &mut warnings);
    let bytes = match options.text {
        true => text(&flat, &facets, options.all_digits),
        false => binary(&flat, &facets, &mut warnings)?,
    };
    Ok(Encoded { bytes, side: Vec::new(), warnings })
}

fn cannot_hold(what: String) -> EncodeError {
    EncodeError::CannotHold { format: Format::Stl, what }
}

/// All faces as triangles.
fn facets(geometry: &MeshInput, warnings: &mut Vec<String>) -> Result<Vec<Facet>, EncodeError> {
    let positions = &geometry.positions;
    let mut facets = Vec::with_capacity(geometry.corners.len() / 3);
    let (mut cut, mut small, mut start) = (0, 0, 0);
    let (mut points, mut local) = (Vec::new(), Vec::new());
    for face in 0..geometry.face_count() {
        let n = geometry.face_sizes.as_ref().map_or(3, |s| s[face] as usize);
        let corners = geometry
            .corners
            .get(start..start + n)
            .ok_or_else(|| cannot_hold(format!("face {face}, whose corners are missing")))?;
        start += n;
        for &v in corners {
            if v as usize >= positions.len() {
                return Err(cannot_hold(format!("face {face}: vertex {v} of {}", positions.len())));
            }
            if !positions.get(v as usize).is_finite() {
                return Err(cannot_hold(format!(
                    "face {face}: vertex {v} has a coordinate that is not finite"
                )));
            }
        }
        match *corners {
            [a, b, c] => facets.push(Facet { vertices: [a, b, c], face }),
            _ if n < 3 => small += 1,
            _ => {
                cut += 1;
                points.clear();
                points.extend(corners.iter().map(|&v| positions.get(v as usize)));
                local.clear();
                triangulate_polygon(&points, &mut local);
                let vertices = |t: &[u32; 3]| t.map(|i| corners[i as usize]);
                facets.extend(local.iter().map(|t| Facet { vertices: vertices(t), face }));
            }
        }
    }
    if cut > 0 {
        warnings.push(format!("STL has triangles only: {cut} polygons are cut into triangles"));
    }
    if small > 0 {
        warnings.push(format!("{small} faces of fewer than three corners are left out"));
    }
    match u32::try_from(facets.len()) {
        Ok(_) => Ok(facets),
        Err(_) => Err(cannot_hold(format!("{} facets", facets.len()))),
    }
}

/// Says what STL has no place for.
fn left_out(scene: &Scene, geometry: &MeshInput, warnings: &mut Vec<String>) {
    let mut lost: Vec<&str> = Vec::new();
    for channel in geometry.wedges.iter().flat_map(|w| w.channels()) {
        lost.push(match channel.semantic {
            Semantic::Normal => "vertex normals",
            Semantic::TexCoord(_) => "texture coordinates",
            Semantic::Color(_) => "colours",
            _ => "other attributes",
        });
    }
    if !scene.materials.is_empty() && geometry.face_material.iter().any(|&m| m != NONE) {
        lost.push("materials");
    }
    if !geometry.wires.is_empty() {
        lost.push("line segments");
    }
    lost.dedup();
    if !lost.is_empty() {
        warnings.push(format!("STL holds triangles alone: {} are left out", lost.join(", ")));
    }
    let mut used = vec![false; geometry.positions.len()];
    for &v in &geometry.corners {
        if let Some(u) = used.get_mut(v as usize) {
            *u = true;
        }
    }
    let isolated = used.iter().filter(|&&u| !u).count();
    if isolated > 0 {
        warnings.push(format!("{isolated} vertices of no face are left out"));
    }
}

/// Unit normal of a facet; zero if it has no area.
fn normal(positions: &Positions, t: [u32; 3]) -> [f32; 3] {
    let [a, b, c] = t.map(|v| positions.get(v as usize));
    // Scaled to about 1 first: neither tiny nor huge meshes may lose their normals to under- or overflow.
    let unit = |v: DVec3| {
        let size = v.abs().max_element();
        if size > 0.0 && size.is_finite() { v / size } else { DVec3::ZERO }
    };
    unit(b - a).cross(unit(c - a)).normalize_or_zero().to_array().map(|x| x as f32)
}

fn binary(flat: &Flat<'_>, facets: &[Facet], warnings: &mut Vec<String>) -> Result<Vec<u8>, EncodeError> {
    let positions = &flat.geometry.positions;
    let mut out = Vec::with_capacity(HEADER + FACET * facets.len());
    // Must not begin with "solid".
    out.extend_from_slice(b"binary STL by progmesh");
    out.resize(80, b' ');
    out.extend_from_slice(&(facets.len() as u32).to_le_bytes());
    let mut narrowed = false;
    for facet in facets {
        let mut put = |x: [f32; 3]| x.iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes()));
        put(normal(positions, facet.vertices));
        for &v in &facet.vertices {
            let p = positions.get(v as usize).to_array();
            let q = p.map(|x| x as f32);
            if q.iter().any(|x| !x.is_finite()) {
                return Err(cannot_hold(format!("vertex {v}: a coordinate beyond f32; write text")));
            }
            narrowed |= q.map(f64::from) != p;
            put(q);
        }
        out.extend_from_slice(&[0, 0]);
    }
    if narrowed {
        warnings.push("binary STL is single precision: coordinates are rounded from f64 to f32".into());
    }
    if has_named_groups(&flat.geometry, &flat.groups, flat.name) {
        warnings.push("binary STL has no groups: they are left out (text STL has solids)".into());
    }
    Ok(out)
}

fn text(flat: &Flat<'_>, facets: &[Facet], all_digits: bool) -> Vec<u8> {
    let positions = &flat.geometry.positions;
    let group = |f: &Facet| flat.geometry.face_group.get(f.face).copied().unwrap_or(NONE);
    let mut order: Vec<&Facet> = facets.iter().collect();
    order.sort_by_key(|f| group(f));
    // One number may have to be written long, lest the file look like single precision.
    let mark = match positions {
        Positions::F32(_) => None,
        Positions::F64(p) => {
            let all = order.iter().flat_map(|f| f.vertices).flat_map(|v| p[v as usize]);
            f64_mark(all).map(|i| (order[i / 9].vertices[i / 3 % 3], i % 3))
        }
    };
    let mut out = Vec::with_capacity(200 * facets.len() + 64);
    let solid = |g: u32| {
        let label = flat.groups.get(g as usize).map(|g| g.label()).or(flat.name.map(String::from));
        // A name must stay on its line.
        let label = label.unwrap_or_default();
        label.split(char::is_control).collect::<Vec<_>>().join(" ").trim().to_string()
    };
    let mut at = 0;
    loop {
        let g = order.get(at).map_or(NONE, |f| group(f));
        let name = solid(g);
        line(&mut out, "solid", &name);
        while let Some(&f) = order.get(at).filter(|f| group(f) == g) {
            out.extend_from_slice(b"  facet normal");
            for x in normal(positions, f.vertices) {
                out.push(b' ');
                write_f32(&mut out, x);
            }
            out.extend_from_slice(b"\n    outer loop\n");
            for v in f.vertices {
                out.extend_from_slice(b"      vertex");
                for k in 0..3 {
                    out.push(b' ');
                    match positions {
                        Positions::F32(p) => write_place(&mut out, p[v as usize][k], all_digits),
                        Positions::F64(p) if mark == Some((v, k)) => {
                            write_f64_long(&mut out, p[v as usize][k])
                        }
                        Positions::F64(p) => write_f64(&mut out, p[v as usize][k]),
                    }
                }
                out.push(b'\n');
            }
            out.extend_from_slice(b"    endloop\n  endfacet\n");
            at += 1;
        }
        line(&mut out, "endsolid", &name);
        if at >= order.len() {
            return out;
        }
    }
}

fn line(out: &mut Vec<u8>, word: &str, name: &str) {
    out.extend_from_slice(word.as_bytes());
    // The blank stands even without a name: some readers know a text file by "solid " with it.
    out.push(b' ');
    out.extend_from_slice(name.as_bytes());
    out.push(b'\n');
}
