//! Geomorphs of a view, without memory of earlier frames.

use super::cut::morphed;
use super::{Lens, View};
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
        morphed(self, lenses, v, band)
    }
}
