//! Geomorphs of a view, without memory of earlier frames.

use super::entry::Entry;
use super::{Lens, View};
use crate::aif::NONE;
use glam::DVec3;

impl View {
    /// Where vertex `v` is drawn if splits are to show themselves smoothly: a split whose error is at the tolerance has not moved its vertices yet, one at `band`
    /// tolerances (more than 1) has wholly. `None` if the vertex is not shown.
    ///
    /// It depends on the lens and on what is applied, not on earlier frames. Splits that only others need, and those out of view, have not moved:
    /// so neither they nor their undoing can be seen. Morphed vertices are between two levels of detail, and what the lens guarantees of the
    /// tolerance does not hold for them: with a band of 2, count on twice the tolerance. O(levels within the band).
    pub fn morphed(&self, lens: &Lens, v: u32, band: f64) -> Option<DVec3> {
        self.morphed_by_all(std::slice::from_ref(lens), v, band)
    }

    /// As [`View::morphed`], for a mesh that stands in several places: a split has moved as far as the lens that needs it most asks for.
    pub fn morphed_by_all(&self, lenses: &[Lens], v: u32, band: f64) -> Option<DVec3> {
        let h = &*self.hierarchy;
        let node = Some(self.front.node(&h.forest, v)).filter(|&k| k != NONE)?;
        // From the node upwards to one that has moved wholly; then back down.
        let mut weights = Vec::new();
        let (mut at, mut vertex) = (node, v);
        loop {
            let i = h.forest.maker(at);
            if i == NONE {
                break;
            }
            let e = Entry::of(h, i);
            let of = |lens: &Lens| {
                let part = (lens.urgency(&e) - 1.0) / (band.max(1.0 + 1e-9) - 1.0);
                // At a tolerance of 0 all are wholly there, errors of 0 too.
                if lens.tau() > 0.0 { part.clamp(0.0, 1.0) } else { 1.0 }
            };
            let part = lenses.iter().map(of).fold(0.0, f64::max);
            if part >= 1.0 {
                break;
            }
            weights.push((h.forest.position(h.mesh(), at, vertex), part));
            at = h.forest.parent(h.mesh(), i);
            vertex = h.mesh().splits.vertex[i as usize];
        }
        let start = h.forest.position(h.mesh(), at, vertex);
        Some(weights.iter().rev().fold(start, |p, &(own, part)| p.lerp(own, part)))
    }
}
