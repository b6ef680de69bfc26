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

/// Unchanged faces that may lie within a run: an upload costs more than so many faces.
const GAP: usize = 4;

/// Bytes of the index buffer in runs of slots: 12 a face.
pub(crate) fn bytes_of(runs: &[Range<usize>]) -> usize {
    runs.iter().map(|r| 12 * r.len()).sum()
}

/// The runs of slots whose bits are set, ascending; clears them. O(slots / 64 + those set).
pub(crate) fn take_runs(touched: &mut [u64]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (k, word) in touched.iter_mut().enumerate().filter(|(_, w)| **w != 0) {
        let mut bits = std::mem::take(word);
        while bits != 0 {
            let slot = 64 * k + bits.trailing_zeros() as usize;
            bits &= bits - 1;
            match runs.last_mut() {
                Some(last) if slot <= last.end + GAP => last.end = slot + 1,
                _ => runs.push(slot..slot + 1),
            }
        }
    }
    runs
}

impl Changes {
    /// Bytes of the index buffer to upload: 12 a face.
    pub fn index_bytes(&self) -> usize {
        bytes_of(&self.faces)
    }

    /// Takes slots noted as touched, a bit each, and wedges, maybe repeated, of a buffer that had so many slots before and has so many now.
    pub(crate) fn take(
        touched: &mut [u64],
        wedges: &mut Vec<u32>,
        before: &mut usize,
        now: usize,
    ) -> Changes {
        let mut wedges = std::mem::take(wedges);
        wedges.sort_unstable();
        wedges.dedup();
        Changes { faces: take_runs(touched), wedges, slots: [std::mem::replace(before, now), now] }
    }
}

impl View {
    /// What changed since this was last called, or since the view was made. O(slots / 64 + changes).
    pub fn take_changes(&mut self) -> Changes {
        let now = self.front.corners().len();
        Changes::take(&mut self.front.touched, &mut self.front.touched_wedges, &mut self.faces_before, now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_hold_what_was_touched_and_little_else() {
        let mut touched = vec![0b1001 | 1 << 63, 1, 0, 1 << 20];
        let runs = take_runs(&mut touched);
        assert_eq!(runs, [0..4, 63..65, 212..213]);
        assert_eq!(bytes_of(&runs), 12 * 7);
        assert!(touched.iter().all(|&w| w == 0) && take_runs(&mut touched).is_empty());
    }
}
