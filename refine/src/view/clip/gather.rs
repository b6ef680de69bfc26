//! Wedges at a cut, and putting together what is left of a mesh.

use super::mesh::{Faces, MeshClipError};
use crate::aif::{MeshInput, NONE, Positions, Semantic, TooManyChannels, Wedges};
use glam::DVec3;

/// What is between two wedges, `t` of the way.
pub(super) fn mix_wedges(wedges: &mut Wedges, from: u32, to: u32, t: f64) -> u32 {
    if from == to {
        return from;
    }
    let mut row: Vec<f32> = Vec::with_capacity(wedges.stride());
    for (k, channel) in wedges.channels().iter().enumerate() {
        let at = wedges.offset(k)..wedges.offset(k) + channel.width;
        let (a, b) = (&wedges.row(from)[at.clone()], &wedges.row(to)[at]);
        let begin = row.len();
        // Joints and their weights belong together.
        if matches!(channel.semantic, Semantic::Joints(_) | Semantic::Weights(_)) {
            row.extend_from_slice(if t <= 0.5 { a } else { b });
            continue;
        }
        row.extend(a.iter().zip(b).map(|(&a, &b)| (a as f64 + (b as f64 - a as f64) * t) as f32));
        if matches!(channel.semantic, Semantic::Normal | Semantic::Tangent) {
            let length = row[begin..].iter().take(3).map(|&x| x as f64 * x as f64).sum::<f64>().sqrt();
            if length > 0.0 {
                row[begin..].iter_mut().take(3).for_each(|x| *x = (*x as f64 / length) as f32);
            } else {
                row[begin..].copy_from_slice(a);
            }
            if channel.width > 3 {
                // Handedness is a sign.
                row[begin + 3] = if t <= 0.5 { a[3] } else { b[3] };
            }
        }
    }
    let present = wedges.present(from) & wedges.present(to);
    wedges.push(&row, present)
}

/// A wedge's values with the normal of a cap, and without a tangent.
pub(super) fn cap_wedge(wedges: &mut Wedges, w: u32, normal: [f32; 3]) -> u32 {
    let (mut row, mut present) = (wedges.row(w).to_vec(), wedges.present(w));
    for (k, channel) in wedges.channels().iter().enumerate() {
        let at = wedges.offset(k);
        match channel.semantic {
            Semantic::Normal if channel.width == 3 => row[at..at + 3].copy_from_slice(&normal),
            Semantic::Tangent => present &= !(1 << k),
            _ => {}
        }
    }
    wedges.push(&row, present)
}

/// What is left of a mesh, before it is put together.
pub(super) struct Gathered<'a> {
    pub(super) points: &'a [DVec3],
    pub(super) single: bool,
    pub(super) wedges: Option<&'a Wedges>,
    pub(super) faces: &'a Faces,
    pub(super) wires: &'a [[u32; 2]],
    pub(super) lonely: &'a [u32],
}

impl Gathered<'_> {
    pub(super) fn mesh(&self, input: &MeshInput) -> Result<MeshInput, MeshClipError> {
        let mut map = vec![NONE; self.points.len()];
        for &v in self.faces.corners.iter().chain(self.wires.as_flattened()).chain(self.lonely) {
            map[v as usize] = 0;
        }
        let mut places = Vec::new();
        for (v, to) in map.iter_mut().enumerate().filter(|(_, to)| **to != NONE) {
            *to = places.len() as u32;
            places.push(self.points[v]);
        }
        let positions = if self.single {
            Positions::F32(places.iter().map(|p| p.as_vec3().to_array()).collect())
        } else {
            Positions::F64(places.iter().map(|p| p.to_array()).collect())
        };
        let per_face = |old: &[u32]| match old {
            [] => vec![],
            old => self.faces.origin.iter().map(|&f| old[f as usize]).collect(),
        };
        Ok(MeshInput {
            positions,
            face_sizes: input.face_sizes.is_some().then(|| self.faces.sizes.clone()),
            corners: self.faces.corners.iter().map(|&v| map[v as usize]).collect(),
            wires: self.wires.iter().map(|w| w.map(|v| map[v as usize])).collect(),
            wedges: self.wedges.map(|w| used_wedges(w, &self.faces.wedges)).transpose()?,
            face_material: per_face(&input.face_material),
            face_group: per_face(&input.face_group),
            face_row: match &input.face_row[..] {
                [] => vec![],
                // Caps are faces of their own.
                rows => {
                    let of = |(&f, &cap): (&u32, &bool)| if cap { NONE } else { rows[f as usize] };
                    self.faces.origin.iter().zip(&self.faces.is_cap).map(of).collect()
                }
            },
        })
    }
}

/// The wedges that corners use, in their order.
fn used_wedges(wedges: &Wedges, corner: &[u32]) -> Result<Wedges, TooManyChannels> {
    let mut map = vec![NONE; wedges.len()];
    corner.iter().filter(|&&w| w != NONE).for_each(|&w| map[w as usize] = 0);
    let mut out = Wedges::new(wedges.channels().to_vec())?;
    for (w, to) in map.iter_mut().enumerate().filter(|(_, to)| **to != NONE) {
        *to = out.push(wedges.row(w as u32), wedges.present(w as u32));
    }
    out.corner = corner.iter().map(|&w| if w == NONE { NONE } else { map[w as usize] }).collect();
    Ok(out)
}
