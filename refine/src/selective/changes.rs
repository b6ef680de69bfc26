//! What changed in the buffers of a view.

use super::View;
use std::ops::Range;

/// What [`View::take_changes`] says: which parts of an index buffer and a vertex buffer to upload.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Runs of faces in [`View::indices`] whose corners changed, ascending; a few unchanged faces between two may be in.
    pub faces: Vec<Range<usize>>,
    /// Wedges that are new or have another position or other values, ascending, each once; some may be gone again.
    pub wedges: Vec<u32>,
    /// Slots of the index buffer, before and now.
    pub slots: [usize; 2],
}

impl Changes {
    /// Bytes of the index buffer to upload: 12 a face.
    pub fn index_bytes(&self) -> usize {
        self.faces.iter().map(|r| 12 * r.len()).sum()
    }
}

/// Unchanged faces that may lie within a run: an upload costs more than so many faces.
const GAP: usize = 4;

impl View {
    /// What changed since this was last called, or since the view was made. O(slots / 64 + changes).
    pub fn take_changes(&mut self) -> Changes {
        let mut faces: Vec<Range<usize>> = Vec::new();
        for (k, word) in self.front.touched.iter_mut().enumerate().filter(|(_, w)| **w != 0) {
            let mut bits = std::mem::take(word);
            while bits != 0 {
                let slot = 64 * k + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                match faces.last_mut() {
                    Some(last) if slot <= last.end + GAP => last.end = slot + 1,
                    _ => faces.push(slot..slot + 1),
                }
            }
        }
        let mut wedges = std::mem::take(&mut self.front.touched_wedges);
        wedges.sort_unstable();
        wedges.dedup();
        let now = self.front.corners().len();
        Changes { faces, wedges, slots: [std::mem::replace(&mut self.faces_before, now), now] }
    }
}
