//! Geomorphs (Hoppe 1996): a mesh that turns smoothly from one state of a progressive mesh into a finer one.
//!
//! Every vertex and every wedge of the finer mesh comes, split by split, from one of the coarser. A [`Geomorph`] has the faces of the
//! finer mesh, and moves each vertex from where its ancestor is to where it belongs itself; so it does with attributes.

use crate::aif::{Channel, MeshInput, NONE, Positions, Semantic, Wedges};
use crate::progressive::{Cursor, Damage, ProgressiveMesh};
use rustc_hash::FxHashMap;
use std::ops::Deref;

/// Why there is no geomorph.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GeomorphError {
    /// The splits are damaged.
    #[error(transparent)]
    Damage(#[from] Damage),
    /// The cursors stand in different progressive meshes.
    #[error("the two states are not of one progressive mesh")]
    TwoMeshes,
}

/// A way between two states of a progressive mesh, from the coarser at `a = 0` to the finer at `a = 1`.
///
/// Guaranteed: at 1 it is the finer mesh bit for bit; where that is full detail and [`ProgressiveMesh::order`] is there, with the attributes of the input, down to the sign of a zero. At 0 the faces that the coarser mesh has too are its faces, in its order and with its
/// positions and attributes bit for bit, and all others have two corners in one vertex of it, so that leaving those out leaves the
/// coarser mesh. A vertex that does not differ stays bit for bit at every `a`. Between, positions, colours, texture coordinates and
/// other numbers run linearly; normals and tangents are brought to unit length; joint indices, a tangent's handedness, and what only one end
/// has change over at one half, and so do the weights of joints that are not the same at both ends. Not guaranteed: that the surface between
/// does not intersect itself.
///
/// Holds both ends of every vertex and wedge. Numbering is that of the splits, as in [`Cursor::to_input`].
#[derive(Clone, Debug)]
pub struct Geomorph {
    /// The finer mesh, numbered by splits; its corners hold vertices, and its wedges every slot.
    fine: MeshInput,
    /// Corners of the finer mesh, as wedges.
    faces: Vec<[u32; 3]>,
    /// Where every vertex begins.
    start: Positions,
    vertex_ancestors: Vec<u32>,
    wedge_ancestors: Vec<u32>,
    attributes: Option<Ends>,
    coarse_faces: usize,
}

/// Attributes at both ends, a row a wedge.
#[derive(Clone, Debug)]
struct Ends {
    mix: Mix,
    start: Vec<f32>,
    end: Vec<f32>,
    start_present: Vec<u64>,
    end_present: Vec<u64>,
}

/// How rows of attributes turn into others: see [`Geomorph`].
#[derive(Clone, Debug)]
pub(crate) struct Mix {
    channels: Vec<Channel>,
    offsets: Vec<usize>,
    stride: usize,
    /// For every channel, the channel of joint indices that must be equal at both ends for it to run linearly.
    joints_of: Vec<Option<usize>>,
}

impl Mix {
    pub(crate) fn new(channels: &[Channel]) -> Mix {
        let mut stride = 0;
        let mut offsets = Vec::with_capacity(channels.len());
        for c in channels {
            offsets.push(stride);
            stride += c.width;
        }
        let joints_of = channels
            .iter()
            .map(|c| match c.semantic {
                Semantic::Weights(k) => channels.iter().position(|j| j.semantic == Semantic::Joints(k)),
                _ => None,
            })
            .collect();
        Mix { channels: channels.to_vec(), offsets, stride, joints_of }
    }

    /// The row at `a`, 0 to 1, between two rows and the channels they have, into `out`; returns the channels it has.
    pub(crate) fn row(
        &self,
        (p, has): (&[f32], u64),
        (q, will): (&[f32], u64),
        a: f64,
        out: &mut [f32],
    ) -> u64 {
        let near_end = a >= 0.5;
        for (k, c) in self.channels.iter().enumerate() {
            let at = self.offsets[k]..self.offsets[k] + c.width;
            let (p_k, q_k) = (&p[at.clone()], &q[at.clone()]);
            let joints = self.joints_of[k].is_none_or(|j| {
                let at = self.offsets[j]..self.offsets[j] + self.channels[j].width;
                p[at.clone()] == q[at]
            });
            let both = has & will & (1 << k) != 0;
            if both && c.interpolates() && joints {
                mix_channel(&c.semantic, p_k, q_k, a, &mut out[at]);
            } else {
                out[at].copy_from_slice(if near_end { q_k } else { p_k });
            }
        }
        if near_end { will } else { has }
    }
}

impl Geomorph {
    /// Between two cursors of one progressive mesh, which may stand in any order. O(n).
    ///
    /// Errors: cursors of different progressive meshes; damage.
    pub fn between<P, Q>(one: &Cursor<P>, other: &Cursor<Q>) -> Result<Self, GeomorphError>
    where
        P: Deref<Target = ProgressiveMesh>,
        Q: Deref<Target = ProgressiveMesh>,
    {
        let (pm, also) = (one.source(), other.source());
        if !std::ptr::eq(pm, also) && pm != also {
            return Err(GeomorphError::TwoMeshes);
        }
        Geomorph::new(pm, one.position(), other.position())
    }

    /// Between the states of `pm` after so many splits, in any order. O(n).
    ///
    /// Errors: damage.
    pub fn new(pm: &ProgressiveMesh, one: usize, other: usize) -> Result<Self, GeomorphError> {
        let mut cursor = pm.cursor()?;
        cursor.seek(one.min(other))?;
        let coarse = cursor.clone();
        let mut wedge_ancestors = cursor.seek_with_descent(one.max(other))?;
        let first = coarse.vertex_count() as u32;
        let mut vertex_ancestors: Vec<u32> = (0..first).collect();
        for &v in &pm.splits.vertex[coarse.position()..cursor.position()] {
            // A split refers to a vertex that is there, or the cursor had refused it.
            let from = vertex_ancestors.get(v as usize).copied().unwrap_or(0);
            vertex_ancestors.push(from);
        }
        let start = coarse.positions().gather(&vertex_ancestors);
        let mut attributes =
            pm.wedges.as_ref().map(|w| Ends::new(w.channels.clone(), &coarse, &cursor, &wedge_ancestors));
        let mut faces = cursor.indices().to_vec();
        if let Some(ends) = &mut attributes {
            let mut made = FxHashMap::default();
            // A split that brings one wedge may give it to corners that had several: where a seam ends.
            for (face, before) in faces.iter_mut().zip(coarse.indices()) {
                for (w, &from) in face.iter_mut().zip(before) {
                    if wedge_ancestors[*w as usize] != from {
                        *w = *made.entry((*w, from)).or_insert_with(|| {
                            wedge_ancestors.push(from);
                            ends.part(*w, coarse.row(from), coarse.present(from))
                        });
                    }
                }
            }
            let apart = coarse.position() != cursor.position();
            made.clear();
            for (input, corners) in cursor.corrections().iter() {
                for &(f, k, w) in corners {
                    let slot = faces[f][k];
                    faces[f][k] = *made.entry((slot, w)).or_insert_with(|| {
                        wedge_ancestors.push(wedge_ancestors[slot as usize]);
                        ends.correct(slot, input, w, apart)
                    });
                }
            }
        }
        Ok(Geomorph {
            fine: cursor.to_input(),
            faces,
            start,
            vertex_ancestors,
            wedge_ancestors,
            attributes,
            coarse_faces: coarse.face_count(),
        })
    }

    /// The index buffer, the same all the way: three wedges a face.
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// The first so many faces are there at both ends; the others have no area at 0.
    pub fn coarse_faces(&self) -> usize {
        self.coarse_faces
    }

    /// For every vertex of the finer mesh the one it comes from in the coarser.
    pub fn vertex_ancestors(&self) -> &[u32] {
        &self.vertex_ancestors
    }

    /// For every wedge of the finer mesh the one it comes from in the coarser; there may be a few more than splits make: where seams end, and where full detail differs from what splits make in the sign of a zero or in a polygon.
    pub fn wedge_ancestors(&self) -> &[u32] {
        &self.wedge_ancestors
    }

    /// Positions at both ends, a vertex of the finer mesh each.
    pub fn positions(&self) -> (&Positions, &Positions) {
        (&self.start, &self.fine.positions)
    }

    /// Positions at `a`, clamped to 0..=1 (NaN is 0). O(vertices).
    pub fn positions_at(&self, a: f64) -> Positions {
        let a = clamped(a);
        match (&self.start, &self.fine.positions) {
            (Positions::F32(x), Positions::F32(y)) => {
                let mix = |p: f32, q: f32| mix32(p, q, a);
                Positions::F32(
                    x.iter().zip(y).map(|(p, q)| std::array::from_fn(|k| mix(p[k], q[k]))).collect(),
                )
            }
            (Positions::F64(x), Positions::F64(y)) => Positions::F64(
                x.iter().zip(y).map(|(p, q)| std::array::from_fn(|k| mix64(p[k], q[k], a))).collect(),
            ),
            (_, end) => end.clone(),
        }
    }

    /// The mesh at `a`, clamped to 0..=1 (NaN is 0), with the faces, materials and groups of the finer mesh. O(n).
    pub fn at(&self, a: f64) -> MeshInput {
        let a = clamped(a);
        let mut out = self.fine.clone();
        out.positions = self.positions_at(a);
        if let Some(ends) = &self.attributes {
            out.wedges = ends.at(a, &self.faces);
        }
        out
    }
}

impl Ends {
    fn new<P: Deref<Target = ProgressiveMesh>>(
        channels: Vec<Channel>,
        coarse: &Cursor<P>,
        fine: &Cursor<P>,
        ancestors: &[u32],
    ) -> Self {
        let (mut start, mut end) = (Vec::new(), Vec::new());
        let (mut start_present, mut end_present) = (Vec::new(), Vec::new());
        for (w, &from) in (0u32..).zip(ancestors) {
            end.extend_from_slice(fine.row(w));
            end_present.push(fine.present(w));
            start.extend_from_slice(coarse.row(from));
            start_present.push(coarse.present(from));
        }
        Ends { mix: Mix::new(&channels), start, end, start_present, end_present }
    }

    /// Adds a wedge that begins as this row, and ends as wedge `slot`. Returns its number.
    fn part(&mut self, slot: u32, row: &[f32], present: u64) -> u32 {
        let (stride, new) = (self.mix.stride, self.end_present.len() as u32);
        let s = slot as usize;
        self.start.extend_from_slice(row);
        self.start_present.push(present);
        self.end.extend_from_within(s * stride..(s + 1) * stride);
        self.end_present.push(self.end_present[s]);
        new
    }

    /// Adds a wedge that ends as wedge `w` of the input ([`NONE`]: without attributes), and begins as wedge `slot`, or does not change. Returns its number.
    fn correct(&mut self, slot: u32, input: &Wedges, w: u32, apart: bool) -> u32 {
        let (stride, new) = (self.mix.stride, self.end_present.len() as u32);
        let (row, present) =
            if w == NONE { (vec![0.0; stride], 0) } else { (input.row(w).to_vec(), input.present(w)) };
        let s = slot as usize;
        let (first, has) = match apart {
            true => (self.start[s * stride..(s + 1) * stride].to_vec(), self.start_present[s]),
            false => (row.clone(), present),
        };
        self.start.extend(first);
        self.start_present.push(has);
        self.end.extend(row);
        self.end_present.push(present);
        new
    }

    /// The wedges at `a`; `None` if the channels are no channels.
    fn at(&self, a: f64, faces: &[[u32; 3]]) -> Option<Wedges> {
        let mut wedges = Wedges::new(self.mix.channels.clone()).ok()?;
        let stride = self.mix.stride;
        let mut row = vec![0.0; stride];
        for w in 0..self.start_present.len() {
            let range = w * stride..(w + 1) * stride;
            let (p, q) = (&self.start[range.clone()], &self.end[range]);
            let present = self.mix.row((p, self.start_present[w]), (q, self.end_present[w]), a, &mut row);
            wedges.push(&row, present);
        }
        let present = |w: u32| wedges.present(w) != 0;
        let corner = faces.as_flattened().iter().map(|&w| if present(w) { w } else { NONE }).collect();
        wedges.corner = corner;
        Some(wedges)
    }
}

fn clamped(a: f64) -> f64 {
    if a > 0.0 { a.min(1.0) } else { 0.0 }
}

/// From `p` to `q`, exact at the ends and where they are equal.
fn mix64(p: f64, q: f64, a: f64) -> f64 {
    match a {
        _ if p.to_bits() == q.to_bits() => p,
        0.0 => p,
        1.0 => q,
        // Two products, for a difference may be too large to hold.
        _ => ((1.0 - a) * p + a * q).max(p.min(q)).min(p.max(q)),
    }
}

fn mix32(p: f32, q: f32, a: f64) -> f32 {
    match a {
        _ if p.to_bits() == q.to_bits() => p,
        0.0 => p,
        1.0 => q,
        _ => mix64(p as f64, q as f64, a) as f32,
    }
}

fn mix_channel(semantic: &Semantic, p: &[f32], q: &[f32], a: f64, out: &mut [f32]) {
    out.iter_mut().zip(p.iter().zip(q)).for_each(|(o, (&p, &q))| *o = mix32(p, q, a));
    let unit = match semantic {
        Semantic::Normal => 3,
        Semantic::Tangent => 3,
        _ => return,
    };
    let same = p.iter().zip(q).all(|(p, q)| p.to_bits() == q.to_bits());
    if a == 0.0 || a == 1.0 || same || out.len() < unit {
        return;
    }
    let nearer = if a >= 0.5 { q } else { p };
    let length = out[..unit].iter().map(|&x| x as f64 * x as f64).sum::<f64>().sqrt();
    if length > 1e-6 && length.is_finite() {
        out[..unit].iter_mut().for_each(|x| *x = (*x as f64 / length) as f32);
    } else {
        // Opposite directions: no one between them is the right one.
        out[..unit].copy_from_slice(&nearer[..unit]);
    }
    // Handedness is 1 or -1.
    out[unit..].copy_from_slice(&nearer[unit..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_run_linearly_and_end_exactly() {
        assert_eq!([0.0, 0.25, 1.0].map(|a| mix32(1.0, 3.0, a)), [1.0, 1.5, 3.0]);
        assert_eq!(mix64(-f64::MAX, f64::MAX, 0.5), 0.0);
        assert_eq!(mix32(-0.0, -0.0, 0.3).to_bits(), (-0.0f32).to_bits());
        assert!(mix32(f32::NAN, f32::NAN, 0.5).is_nan() && mix64(f64::NAN, -f64::NAN, 0.5).is_nan());
        assert!(mix32(f32::NAN, 1.0, 0.0).is_nan() && mix32(f32::NAN, 1.0, 1.0) == 1.0);
        assert_eq!([f64::NAN, -1.0, 2.0, 0.5].map(clamped), [0.0, 0.0, 1.0, 0.5]);
    }

    #[test]
    fn directions_keep_unit_length_and_handedness_changes_over() {
        let mut out = [0.0; 4];
        mix_channel(&Semantic::Tangent, &[1.0, 0.0, 0.0, 1.0], &[0.0, 1.0, 0.0, -1.0], 0.5, &mut out);
        let h = 0.5f32.sqrt();
        assert!((out[0] - h).abs() < 1e-6 && (out[1] - h).abs() < 1e-6 && out[3] == -1.0, "{out:?}");
        let mut out = [0.0; 3];
        mix_channel(&Semantic::Normal, &[0.0, 0.0, 1.0], &[0.0, 0.0, -1.0], 0.5, &mut out);
        assert_eq!(out, [0.0, 0.0, -1.0]);
        mix_channel(&Semantic::Normal, &[0.0, 0.0, 2.0], &[0.0, 3.0, 0.0], 0.0, &mut out);
        assert_eq!(out, [0.0, 0.0, 2.0]);
    }
}
