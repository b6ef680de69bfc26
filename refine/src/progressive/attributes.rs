//! Attributes of a mesh between base and full detail.

use super::WedgeStreams;

/// The wedges there are, and what changed ones were before.
#[derive(Clone, Debug)]
pub(super) struct WedgeState {
    pub(super) vertex: Vec<u32>,
    pub(super) rows: Vec<f32>,
    pub(super) present: Vec<u64>,
    undo_rows: Vec<f32>,
    undo_present: Vec<u64>,
    /// Rows of the streams that are in use.
    pub(super) next_row: usize,
    /// Numbers of the explicit stream that are in use.
    pub(super) next_explicit: usize,
    /// Where explicit splits that are applied begin in their stream.
    pub(super) explicit_starts: Vec<u32>,
}

impl WedgeState {
    /// The base's.
    pub(super) fn new(streams: &WedgeStreams) -> Self {
        let base = streams.base_vertex.len();
        WedgeState {
            vertex: streams.base_vertex.clone(),
            rows: (0..base).flat_map(|r| streams.rows.row(r, streams.stride).into_owned()).collect(),
            present: streams.present.iter().take(base).collect(),
            undo_rows: Vec::new(),
            undo_present: Vec::new(),
            next_row: base,
            next_explicit: 0,
            explicit_starts: Vec::new(),
        }
    }

    /// Adds wedges of vertex `v`, and gives `changed` their next values.
    pub(super) fn apply(&mut self, streams: &WedgeStreams, v: u32, new: usize, changed: &[u32]) {
        let stride = streams.stride;
        for _ in 0..new {
            self.vertex.push(v);
            let end = self.rows.len();
            self.rows.resize(end + stride, 0.0);
            streams.rows.read(self.next_row, &mut self.rows[end..]);
            self.present.push(streams.present[self.next_row]);
            self.next_row += 1;
        }
        for &w in changed {
            let range = w as usize * stride..(w as usize + 1) * stride;
            self.undo_rows.extend_from_slice(&self.rows[range.clone()]);
            self.undo_present.push(self.present[w as usize]);
            streams.rows.read(self.next_row, &mut self.rows[range]);
            self.present[w as usize] = streams.present[self.next_row];
            self.next_row += 1;
        }
    }

    /// Undoes [`WedgeState::apply`].
    pub(super) fn undo(&mut self, stride: usize, new: usize, changed: &[u32]) {
        for &w in changed.iter().rev() {
            let at = self.undo_rows.len() - stride;
            let row = &mut self.rows[w as usize * stride..(w as usize + 1) * stride];
            row.copy_from_slice(&self.undo_rows[at..]);
            self.undo_rows.truncate(at);
            self.present[w as usize] = self.undo_present.pop().unwrap_or(0);
        }
        let keep = self.vertex.len() - new;
        self.vertex.truncate(keep);
        self.rows.truncate(keep * stride);
        self.present.truncate(keep);
        self.next_row -= new + changed.len();
    }
}

/// An entry of [`WedgeStreams::explicit`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Explicit {
    /// (wedge before, wedge after) of the faces that go to the new vertex.
    pub(crate) pairs: Vec<(u32, u32)>,
    pub(crate) changed: Vec<u32>,
    /// Wedges of the new faces at the old vertex, the new one, the tip.
    pub(crate) corners: Vec<[u32; 3]>,
    /// New wedges among the pairs.
    pub(crate) new: usize,
    /// Where the next entry begins.
    pub(crate) end: usize,
}

/// The entry of splits that have none.
pub(crate) static NO_ENTRY: Explicit =
    Explicit { pairs: Vec::new(), changed: Vec::new(), corners: Vec::new(), new: 0, end: 0 };

impl Explicit {
    /// The entry at `at`, when there are `wedges` wedges; `None` if the stream ends in it or it names wedges that cannot be. New wedges must
    /// come in order.
    pub(crate) fn read(stream: &[u32], at: usize, two_faces: bool, wedges: u32) -> Option<Explicit> {
        let &[pairs, changed] = stream.get(at..at + 2)? else { return None };
        let (pairs, changed) = (pairs as usize, changed as usize);
        let sizes = [pairs.checked_mul(2)?, changed, 3 * (1 + two_faces as usize)];
        let end = sizes.iter().try_fold(at + 2, |sum: usize, &n| sum.checked_add(n))?;
        let rest = stream.get(at + 2..end)?;
        let (p, rest) = rest.split_at(sizes[0]);
        let (c, k) = rest.split_at(changed);
        let pairs: Vec<(u32, u32)> = p.chunks_exact(2).map(|x| (x[0], x[1])).collect();
        let mut new = 0;
        for &(before, after) in &pairs {
            let fresh = after == wedges + new;
            new += fresh as u32;
            if before >= wedges || !(fresh || after == before) {
                return None;
            }
        }
        let corners: Vec<[u32; 3]> = k.chunks_exact(3).map(|x| [x[0], x[1], x[2]]).collect();
        let there = |w: u32| w < wedges + new;
        let fits = c.iter().all(|&w| w < wedges)
            && corners
                .iter()
                .all(|k| there(k[0]) && there(k[1]) && (there(k[2]) || k[2] == crate::aif::NONE));
        fits.then(|| Explicit { pairs, changed: c.to_vec(), corners, new: new as usize, end })
    }
}
