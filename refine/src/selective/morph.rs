//! Geomorphs of a view, without memory of earlier frames.

use super::cut::{Ascent, ascent, morphed};
use super::timed_rows::rows_of;
use super::{Lens, View};
use crate::aif::{MeshInput, NONE};
use crate::geomorph::Mix;
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

    /// The attributes of wedge `w` as its vertex is drawn, and the channels it has: between the same levels as [`View::morphed_by_all`] has the vertex between, by the rules of [`crate::Geomorph`]. `None` if the
    /// wedge is not shown, or without attributes. Panics if there is no such wedge.
    ///
    /// A split that has moved wholly gives its own rows bit for bit, one that has not begun those that its wedges had before, or of the wedges they were parted from. O(levels within the band, times what finding
    /// a row takes); the first call for a hierarchy goes through all of its splits once, and keeps 4 B a row.
    pub fn morphed_row(&self, lenses: &[Lens], w: u32, band: f64) -> Option<(Vec<f32>, u64)> {
        let streams = self.hierarchy.mesh().wedges.as_ref()?;
        self.morphed_row_by(&Mix::new(&streams.channels), lenses, w, band)
    }

    fn morphed_row_by(&self, mix: &Mix, lenses: &[Lens], w: u32, band: f64) -> Option<(Vec<f32>, u64)> {
        let h = &*self.hierarchy;
        let streams = h.mesh().wedges.as_ref()?;
        let values = |r: u32| (streams.rows.row(r as usize, streams.stride), streams.present[r as usize]);
        let mut row = Some(self.front.wedge_row(w)).filter(|&r| r != NONE)?;
        let Ascent { steps, .. } = ascent(self, lenses, self.front.wedge_vertex(w), band)?;
        // The row before each split that made one, and how far that has shown itself.
        let mut way = Vec::new();
        for (_, _, i, part) in steps {
            if rows_of(h, i).contains(&row) {
                way.push((row, part));
                row = h.row_parents().get(row as usize).copied().unwrap_or(row);
            }
        }
        let (start, mut has) = values(row);
        let (mut now, mut next) = (start.to_vec(), start.into_owned());
        for (row, part) in way.into_iter().rev() {
            let (to, will) = values(row);
            has = mix.row((&now, has), (&to, will), part, &mut next);
            std::mem::swap(&mut now, &mut next);
        }
        Some((now, has))
    }

    /// [`View::to_input`] as it is drawn: vertices where [`View::morphed_by_all`] has them (rounded to the stored precision), attributes as of [`View::morphed_row`]. O(n).
    pub fn to_input_morphed(&self, lenses: &[Lens], band: f64) -> MeshInput {
        let vertices = 0..self.hierarchy.mesh().vertices() as u32;
        let places: Vec<(u32, DVec3)> = vertices
            .filter_map(|v| {
                let (own, at) = (self.position(v)?, self.morphed_by_all(lenses, v, band)?);
                (own != at).then_some((v, at))
            })
            .collect();
        let mix = self.hierarchy.mesh().wedges.as_ref().map(|s| Mix::new(&s.channels));
        let morphed = |w: u32| self.morphed_row_by(mix.as_ref()?, lenses, w, band);
        let mut out =
            self.input(false, |w| morphed(w).map_or_else(|| self.own_row(w), |(row, has)| (row.into(), has)));
        self.put(&mut out, &places);
        out
    }
}
