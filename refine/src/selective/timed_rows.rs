//! Attributes on their way: what wedges show while the vertices of a [`super::TimedMorph`] move.
//!
//! A row belongs to one wedge, and says what the wedge has from one split of its vertex to the next; the row it comes of is known ([`Hierarchy::row_parents`]). So of every row that a split has made it is known what stands for it in a mesh
//! without that split: the row that is reached upwards, past all that is not asked for. Thither it runs while the split lingers, and back if the split is asked for again; rows of new splits begin with what the rows they come of show.

use super::Lens;
use super::motions::Stage;
use crate::aif::NONE;
use crate::geomorph::Mix;
use crate::hierarchy::Hierarchy;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

/// Rows that do not show their own values, or may not.
#[derive(Clone, Debug)]
pub(super) struct RowMotions {
    frames: u32,
    mix: Mix,
    of: BTreeMap<u32, RowMotion>,
}

/// On the way, or there when `step` is the number of frames.
#[derive(Clone, Debug)]
struct RowMotion {
    from: Vec<f32>,
    has: u64,
    /// The row whose values it runs to.
    to: u32,
    step: u32,
}

/// The rows that split `i` makes; none without attributes.
pub(super) fn rows_of(h: &Hierarchy, i: u32) -> Range<u32> {
    let (Some(streams), Some(rows)) = (&h.mesh().wedges, &h.forest.rows) else { return 0..0 };
    let first = |i: u32| match (i as usize) < h.splits() {
        true => rows.of(h.mesh(), i).row,
        false => streams.present.len() as u32,
    };
    first(i)..first(i + 1)
}

/// The split that makes a row; [`NONE`] for the base's. O(log n).
fn maker(h: &Hierarchy, row: u32) -> u32 {
    let (mut low, mut high) = (0, h.splits() as u32);
    // How many splits begin with it or before.
    while low < high {
        let middle = low + (high - low) / 2;
        if rows_of(h, middle).start <= row { low = middle + 1 } else { high = middle }
    }
    // Those that make no row begin where the next does.
    low.checked_sub(1).filter(|&i| rows_of(h, i).contains(&row)).unwrap_or(NONE)
}

/// The values of a row as it is stored, and the channels it has.
fn stored(h: &Hierarchy, row: u32) -> (Cow<'_, [f32]>, u64) {
    match &h.mesh().wedges {
        Some(s) if (row as usize) < s.present.len() => {
            (s.rows.row(row as usize, s.stride), s.present[row as usize])
        }
        _ => (Cow::Borrowed(&[]), 0),
    }
}

/// The row that a row comes of.
fn parent(h: &Hierarchy, row: u32) -> u32 {
    h.row_parents().get(row as usize).copied().unwrap_or(row)
}

/// What stands for a row in a mesh of which `is_led` says which splits it has.
fn standing(h: &Hierarchy, mut row: u32, is_led: impl Fn(u32) -> bool) -> u32 {
    loop {
        let i = maker(h, row);
        let up = parent(h, row);
        if i == NONE || is_led(i) || up == row {
            return row;
        }
        row = up;
    }
}

impl RowMotions {
    /// None are on the way; `None` for a mesh without attributes.
    pub(super) fn new(h: &Hierarchy, frames: u32) -> Option<RowMotions> {
        let streams = h.mesh().wedges.as_ref()?;
        Some(RowMotions { frames, mix: Mix::new(&streams.channels), of: BTreeMap::new() })
    }

    /// All rows show their own values.
    pub(super) fn is_empty(&self) -> bool {
        self.of.is_empty()
    }

    /// What a row shows if that may not be its own values.
    pub(super) fn value(&self, h: &Hierarchy, row: u32) -> Option<(Vec<f32>, u64)> {
        let m = self.of.get(&row)?;
        let mut out = m.from.clone();
        let part = f64::from(m.step) / f64::from(self.frames);
        let (to, will) = stored(h, m.to);
        let has = self.mix.row((&m.from, m.has), (&to, will), part, &mut out);
        Some((out, has))
    }

    fn shown(&self, h: &Hierarchy, row: u32) -> (Vec<f32>, u64) {
        self.value(h, row).unwrap_or_else(|| {
            let (values, has) = stored(h, row);
            (values.into_owned(), has)
        })
    }

    /// Split `i` is drawn from now on: its rows show what those show that they come of.
    pub(super) fn begin(&mut self, h: &Hierarchy, i: u32) {
        for row in rows_of(h, i) {
            let to = parent(h, row);
            let (from, has) = self.shown(h, to);
            self.of.insert(row, RowMotion { from, has, to, step: 0 });
        }
    }

    /// Sends the rows of these splits to where they belong now; at once what no lens sees.
    pub(super) fn send<S: Stage>(&mut self, h: &Hierarchy, splits: &[u32], stage: &S, lenses: &[Lens]) {
        for &i in splits {
            let entry = stage.entry(i);
            let seen = lenses.iter().any(|l| l.sees_entry(&entry));
            for row in rows_of(h, i) {
                let to = standing(h, row, |i| stage.is_led(i));
                if self.of.get(&row).map_or(row, |m| m.to) == to {
                    continue;
                }
                let (from, has) = self.shown(h, row);
                let end = stored(h, to);
                let same = has == end.1 && from.iter().zip(&*end.0).all(|(a, b)| a.to_bits() == b.to_bits());
                let step = if seen && !same { 0 } else { self.frames };
                self.of.insert(row, RowMotion { from, has, to, step });
            }
        }
    }

    /// A frame further.
    pub(super) fn step(&mut self) {
        self.of.values_mut().filter(|m| m.step < self.frames).for_each(|m| m.step += 1);
    }

    /// Forgets those that show their own values.
    pub(super) fn settle(&mut self) {
        self.of.retain(|&row, m| m.step < self.frames || m.to != row);
    }

    /// The rows of split `i` are where they belong.
    pub(super) fn is_at_rest(&self, h: &Hierarchy, i: u32) -> bool {
        self.of.range(rows_of(h, i)).all(|(_, m)| m.step == self.frames)
    }

    /// Split `i` is not drawn any more.
    pub(super) fn end(&mut self, h: &Hierarchy, i: u32) {
        rows_of(h, i).for_each(|row| drop(self.of.remove(&row)));
    }
}
