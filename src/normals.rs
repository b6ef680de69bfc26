//! Vertex normals of a mesh's arrays: computed anew, or removed.
//!
//! A normal is the mean of the normals of the faces around, weighted by the angle each has at the vertex (Thuermer & Wuethrich
//! 1998), which does not depend on how a flat region is cut into triangles. Faces that meet at more than the crease angle, at a
//! border, at an edge of three and more faces, or with opposite orientations do not share a normal.

use crate::aif::attributes::{Channel, Semantic, TooManyChannels, Wedges};
use crate::aif::{MeshInput, NONE};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// The crease angle unless another is asked for, degrees.
pub const DEFAULT_CREASE: f64 = 60.0;

/// What becomes of the normals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Normals {
    /// They stay, interpolated and of unit length, if the input has any.
    #[default]
    Keep,
    /// They are computed from the faces.
    Recompute {
        /// Edges whose faces' normals differ by more than this, in degrees, are creases: 180 makes none, 0 makes all.
        crease: f64,
    },
    /// They are removed, and tangents with them.
    Remove,
}

/// Does to the normals of `input` what `normals` says.
///
/// `input` must be as [`crate::aif::Mesh::build`] accepts it. Errors when the channel of normals would be one too many. O(n log n).
pub fn apply(input: &mut MeshInput, normals: Normals) -> Result<(), TooManyChannels> {
    match normals {
        Normals::Keep => Ok(()),
        Normals::Remove => {
            remove(input);
            Ok(())
        }
        Normals::Recompute { crease } => recompute(input, crease),
    }
}

/// Removes normals, tangents, and their morph targets.
fn remove(input: &mut MeshInput) {
    let Some(w) = &mut input.wedges else { return };
    let goes = |s: &Semantic| {
        matches!(
            s,
            Semantic::Normal | Semantic::Tangent | Semantic::MorphNormal(_) | Semantic::MorphTangent(_)
        )
    };
    while let Some(k) = w.channels().iter().position(|c| goes(&c.semantic)) {
        w.remove_channel(k);
    }
    if w.channels().is_empty() {
        input.wedges = None;
    }
}

/// Computes normals, splitting wedges at creases. Tangents stay, turned square to the new normals.
fn recompute(input: &mut MeshInput, crease: f64) -> Result<(), TooManyChannels> {
    let normals = corner_normals(input, crease);
    let old = input.wedges.take().unwrap_or_default();
    // The channel of normals keeps its place, or comes first.
    let at = old.channel(&Semantic::Normal);
    let mut channels = old.channels().to_vec();
    let k = at.unwrap_or_else(|| {
        channels.insert(0, Channel::new(Semantic::Normal, 3));
        0
    });
    channels[k] = Channel::new(Semantic::Normal, 3);
    let tangent = channels.iter().position(|c| c.semantic == Semantic::Tangent && c.width >= 3);
    let mut new = Wedges::new(channels)?;
    let offset = new.offset(k);
    let mut row = vec![0.0; new.stride()];
    let mut known: HashMap<(u32, u32, [u32; 3]), u32> = HashMap::new();
    let mut corner = Vec::with_capacity(input.corners.len());
    for (c, &v) in input.corners.iter().enumerate() {
        let was = old.corner.get(c).copied().unwrap_or(NONE);
        let n = normals[c];
        let key = (v, was, n.to_array().map(f32::to_bits));
        let id = *known.entry(key).or_insert_with(|| {
            row.fill(0.0);
            let mut present = 1u64 << k;
            if was != NONE {
                let values = old.row(was);
                let bits = old.present(was);
                match at {
                    Some(_) => {
                        row.copy_from_slice(values);
                        present |= bits;
                    }
                    None => {
                        row[3..].copy_from_slice(values);
                        present |= bits << 1;
                    }
                }
            }
            row[offset..offset + 3].copy_from_slice(&n.to_array());
            if let Some(t) = tangent.filter(|&t| present >> t & 1 == 1) {
                let o = new.offset(t);
                let old = Vec3::from_slice(&row[o..o + 3]);
                let square = old - n * n.dot(old);
                // A tangent along the new normal leaves but rounding: any direction is as good.
                let along = square.length_squared() <= 1e-8 * old.length_squared();
                let square = if along { n.any_orthonormal_vector() } else { square.normalize_or(Vec3::X) };
                row[o..o + 3].copy_from_slice(&square.to_array());
            }
            new.push(&row, present)
        });
        corner.push(id);
    }
    new.corner = corner;
    input.wedges = Some(new);
    Ok(())
}

/// A unit normal for every corner.
fn corner_normals(input: &MeshInput, crease: f64) -> Vec<Vec3> {
    let corners = &input.corners;
    let faces = face_ranges(input);
    // Around the mesh's own centre and scale, so that neither far-off nor tiny meshes lose their normals.
    let (low, high) = input.positions.bounds().unwrap_or_default();
    let (centre, extent) = ((low + high) / 2.0, (high - low).max_element());
    let scale = if extent > 0.0 { (1.0 / extent).min(f64::MAX) } else { 1.0 };
    let point = |c: usize| (input.positions.get(corners[c] as usize) - centre) * scale;

    let mut face_normal = Vec::with_capacity(faces.len());
    let mut face_of = vec![0u32; corners.len()];
    let mut angle = vec![0.0f64; corners.len()];
    // (vertex, neighbour, corner): the corner's face has the edge between them.
    let mut sides: Vec<(u32, u32, u32)> = Vec::with_capacity(2 * corners.len());
    for (f, range) in faces.iter().enumerate() {
        let first = range.first.min(corners.len());
        let n = range.len;
        let at = |i: usize| first + i % n;
        let origin = if n > 0 { point(first) } else { DVec3::ZERO };
        let newell: DVec3 =
            (1..n.saturating_sub(1)).map(|i| (point(at(i)) - origin).cross(point(at(i + 1)) - origin)).sum();
        face_normal.push(newell.try_normalize().unwrap_or(DVec3::ZERO));
        for i in 0..n {
            let (before, here, after) = (at(i + n - 1), at(i), at(i + 1));
            face_of[here] = f as u32;
            let (a, b) = (point(before) - point(here), point(after) - point(here));
            angle[here] = a.cross(b).length().atan2(a.dot(b));
            sides.push((corners[here], corners[before], here as u32));
            sides.push((corners[here], corners[after], here as u32));
        }
    }
    sides.sort_unstable();

    // Corners that share a normal, as sets.
    let mut set: Vec<u32> = (0..corners.len() as u32).collect();
    let least = crease.to_radians().cos();
    for edge in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let &[(_, _, a), (_, _, b)] = edge else { continue };
        let [m, n] = [a, b].map(|c| face_normal[face_of[c as usize] as usize]);
        // A face without area has no say: it joins its neighbours.
        if crease >= 180.0 || m == DVec3::ZERO || n == DVec3::ZERO || m.dot(n) >= least - 1e-12 {
            let (a, b) = (root(&mut set, a), root(&mut set, b));
            set[a.max(b) as usize] = a.min(b);
        }
    }
    let mut sum = vec![DVec3::ZERO; corners.len()];
    for c in 0..corners.len() {
        let r = root(&mut set, c as u32) as usize;
        sum[r] += face_normal[face_of[c] as usize] * angle[c];
    }
    (0..corners.len())
        .map(|c| {
            let r = root(&mut set, c as u32) as usize;
            let own = face_normal[face_of[c] as usize];
            // Faces that cancel out leave each its own; a normal must be of unit length even where nothing has area.
            let n = sum[r].try_normalize().or_else(|| own.try_normalize()).unwrap_or(DVec3::Z);
            n.as_vec3().normalize_or(Vec3::Z)
        })
        .collect()
}

/// The set's representative, its least corner; paths are halved on the way.
fn root(set: &mut [u32], mut c: u32) -> u32 {
    while set[c as usize] != c {
        set[c as usize] = set[set[c as usize] as usize];
        c = set[c as usize];
    }
    c
}

struct FaceRange {
    first: usize,
    len: usize,
}

fn face_ranges(input: &MeshInput) -> Vec<FaceRange> {
    match &input.face_sizes {
        None => (0..input.corners.len() / 3).map(|f| FaceRange { first: 3 * f, len: 3 }).collect(),
        Some(sizes) => sizes
            .iter()
            .scan(0, |first, &n| {
                let range = FaceRange { first: *first, len: n as usize };
                *first += n as usize;
                Some(range)
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> MeshInput {
        let p = (0..8).map(|i| [(i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32]).collect::<Vec<_>>();
        let q = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5];
        MeshInput::polygons(p, &[4; 6], &q)
    }

    fn normal(m: &MeshInput, c: usize) -> Vec3 {
        let w = m.wedges.as_ref().unwrap();
        Vec3::from_slice(w.get(w.corner[c], w.channel(&Semantic::Normal).unwrap()).unwrap())
    }

    #[test]
    fn a_cube_is_creased_below_ninety_degrees_and_smooth_above() {
        let mut m = cube();
        apply(&mut m, Normals::Recompute { crease: 60.0 }).unwrap();
        assert_eq!(m.wedges.as_ref().unwrap().len(), 24);
        assert_eq!(normal(&m, 0), Vec3::NEG_Z);
        let mut m = cube();
        apply(&mut m, Normals::Recompute { crease: 91.0 }).unwrap();
        assert_eq!(m.wedges.as_ref().unwrap().len(), 8);
        assert!(normal(&m, 0).distance(Vec3::NEG_ONE.normalize()) < 1e-6);
    }

    #[test]
    fn the_cut_into_triangles_does_not_matter() {
        let mut m = cube();
        let t: Vec<[u32; 3]> =
            m.corners.as_chunks::<4>().0.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        m = MeshInput::triangles(m.positions, &t);
        apply(&mut m, Normals::Recompute { crease: 180.0 }).unwrap();
        for c in 0..36 {
            let p = m.positions.get(m.corners[c] as usize).as_vec3() - Vec3::splat(0.5);
            assert!(normal(&m, c).distance(p.normalize()) < 1e-6);
        }
    }

    #[test]
    fn far_away_and_tiny_meshes_keep_their_normals() {
        for (scale, offset) in [(1e-25, 0.0), (1e25, 0.0), (1.0, 1e6)] {
            let mut m = cube();
            m.positions = crate::aif::Positions::F64(
                m.positions.iter().map(|p| (p * scale + DVec3::splat(offset)).to_array()).collect(),
            );
            apply(&mut m, Normals::Recompute { crease: 60.0 }).unwrap();
            assert_eq!(normal(&m, 0), Vec3::NEG_Z);
        }
    }

    #[test]
    fn seams_stay_and_tangents_are_turned_square() {
        let mut m = cube();
        let mut w =
            Wedges::new(vec![Channel::new(Semantic::TexCoord(0), 2), Channel::new(Semantic::Tangent, 4)])
                .unwrap();
        for i in 0..24 {
            w.push(&[i as f32, 0.0, 1.0, 1.0, 1.0, -1.0], 0b11);
        }
        w.corner = (0..24).collect();
        m.wedges = Some(w);
        apply(&mut m, Normals::Recompute { crease: 180.0 }).unwrap();
        let w = m.wedges.as_ref().unwrap();
        assert_eq!((w.len(), w.channels().len()), (24, 3));
        for c in 0..24 {
            let uv = w.get(w.corner[c], w.channel(&Semantic::TexCoord(0)).unwrap()).unwrap();
            assert_eq!(uv[0], c as f32);
            let t = w.get(w.corner[c], w.channel(&Semantic::Tangent).unwrap()).unwrap();
            assert!(Vec3::from_slice(t).dot(normal(&m, c)).abs() < 1e-6 && t[3] == -1.0);
        }
        apply(&mut m, Normals::Remove).unwrap();
        let left: Vec<_> = m.wedges.unwrap().channels().iter().map(|c| c.semantic.clone()).collect();
        assert_eq!(left, [Semantic::TexCoord(0)]);
    }

    #[test]
    fn degenerate_faces_get_a_unit_normal() {
        let mut m = MeshInput::triangles(vec![[1.0f32; 3]; 3], &[[0, 1, 2]]);
        apply(&mut m, Normals::Recompute { crease: 60.0 }).unwrap();
        assert_eq!(normal(&m, 0), Vec3::Z);
    }
}
