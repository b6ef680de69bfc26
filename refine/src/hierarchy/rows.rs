//! Where splits have their attributes.

use super::Forest;
use crate::aif::NONE;
use crate::progressive::{ProgressiveMesh, SplitCode, SplitKind};

/// Where a split has its attributes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SplitRows {
    /// Its first new wedge.
    pub(crate) wedge: u32,
    /// Its first row.
    pub(crate) row: u32,
    /// Its entry of the explicit stream, if it has one.
    pub(crate) explicit: u32,
}

/// The same of all splits, in less than a byte each.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    /// Of every [`EACH`]th split; the codes tell the way from there.
    marks: Vec<SplitRows>,
    /// Rows of changed wedges, ascending, where the wedge's row before is not the one that [`Rows::guess`] says, and which it is.
    others: Vec<[u32; 2]>,
}

const EACH: usize = 16;

impl Rows {
    /// Nothing of a mesh without attributes.
    pub(super) fn new(pm: &ProgressiveMesh) -> Option<Rows> {
        let streams = pm.wedges.as_ref()?;
        let base_wedges = streams.base_vertex.len() as u32;
        let mut at = SplitRows { wedge: base_wedges, row: base_wedges, explicit: 0 };
        let mut marks = Vec::with_capacity(pm.splits.len().div_ceil(EACH));
        for (k, &code) in pm.splits.code.iter().enumerate() {
            if k % EACH == 0 {
                marks.push(at);
            }
            at.pass(code, &streams.explicit);
        }
        Some(Rows { marks, others: Vec::new() })
    }

    /// Of split `i`.
    #[inline]
    pub(crate) fn of(&self, pm: &ProgressiveMesh, i: u32) -> SplitRows {
        let k = i as usize;
        let (first, count) = (k - k % EACH, (k % EACH) as u16);
        let mut at = self.marks[k / EACH];
        // Mostly none has an entry of its own: then it is sums, of all sixteen at once.
        let (mut wedges, mut rows, mut plain) = (0u16, 0u16, false);
        if let Some(codes) = pm.splits.code[first..].first_chunk::<EACH>() {
            let mut kinds = 0;
            for (j, code) in (0..EACH as u16).zip(codes) {
                let before = if j < count { u16::MAX } else { 0 };
                let kind = code.kind_code() as u16 & before;
                let new = (kind + 1) & before;
                wedges += new;
                rows += if code.changes_rows() { 2 * new } else { new };
                kinds |= kind;
            }
            plain = kinds <= 1;
        }
        if plain {
            (at.wedge, at.row) = (at.wedge + u32::from(wedges), at.row + u32::from(rows));
        } else {
            let explicit = pm.wedges.as_ref().map_or(&[][..], |w| &w.explicit);
            pm.splits.code[first..k].iter().for_each(|&code| at.pass(code, explicit));
        }
        at
    }

    /// The row that wedge `c` had before split `i` gave it another, if only plain splits were at its vertex: then that is known from these.
    pub(crate) fn guess(&self, pm: &ProgressiveMesh, forest: &Forest, i: u32, c: u32) -> u32 {
        let code = &pm.splits.code;
        let vertex = pm.splits.vertex[i as usize];
        let chain = forest.chain(vertex);
        let before = chain.prefix(chain.partition_point(|j| j < i));
        if let Some(j) = before.iter().rev().find(|&j| code[j as usize].changes_rows()) {
            return match code[j as usize].kind() {
                SplitKind::Plain => self.of(pm, j).row + 1,
                _ => NONE,
            };
        }
        match vertex.checked_sub(forest.base_vertices) {
            None => c,
            Some(k) => {
                let made = self.of(pm, k);
                made.row.wrapping_add(c.wrapping_sub(made.wedge))
            }
        }
    }

    /// The row that wedge `c` had before split `i` gave it `row`.
    #[inline]
    pub(crate) fn before(&self, pm: &ProgressiveMesh, forest: &Forest, (i, row): (u32, u32), c: u32) -> u32 {
        match self.others.binary_search_by_key(&row, |o| o[0]) {
            Ok(at) => self.others[at][1],
            Err(_) => self.guess(pm, forest, i, c),
        }
    }

    /// Takes note of rows before that are not those guessed, by ascending rows.
    pub(super) fn set_others(&mut self, others: Vec<[u32; 2]>) {
        self.others = others;
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<SplitRows>() * self.marks.len() + 8 * self.others.len()
    }
}

impl SplitRows {
    /// Goes on behind a split.
    #[inline]
    fn pass(&mut self, code: SplitCode, explicit: &[u32]) {
        let twice = code.changes_rows() as u32;
        let (new, changed) = match code.kind() {
            SplitKind::Plain => (1, twice),
            SplitKind::Seam => (2, 2 * twice),
            SplitKind::Explicit => {
                let at = self.explicit as usize;
                let number = |k: usize| explicit.get(at + k).copied().unwrap_or(0);
                let (pairs, changed) = (number(0), number(1));
                let fresh = (0..pairs as usize).filter(|k| number(3 + 2 * k) >= self.wedge).count() as u32;
                self.explicit += 2 + 2 * pairs + changed + 3 + 3 * code.two_faces() as u32;
                (fresh, changed)
            }
        };
        self.wedge += new;
        self.row += new + changed;
    }
}
