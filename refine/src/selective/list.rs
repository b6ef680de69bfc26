//! Splits that may come next, with what is needed to decide about each in one run of memory.

use crate::aif::NONE;
use crate::hierarchy::{Hierarchy, Packed, unpack};
use glam::Vec3;

/// A split and its bounds, ready to be decided about, 44 B.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(super) centre: Vec3,
    pub(super) radius: f32,
    pub(super) error: f32,
    pub(crate) split: u32,
    /// The normal cone's axis, and cosine and sine of its half angle. Stored cones are wider by 3e-4 rad, so that rounding to f32 does not show.
    pub(super) axis: Vec3,
    pub(super) cos: f32,
    pub(super) sin: f32,
}

impl Entry {
    pub(super) fn of(h: &Hierarchy, i: u32) -> Entry {
        Entry::new(i, h.local_centre(i), h.bounds.of[i as usize])
    }

    /// Of a split at `centre`, about the origin of the bounds.
    #[inline]
    pub(crate) fn new(split: u32, centre: Vec3, b: Packed) -> Entry {
        let (axis, cos, sin) = b.cone.unpack_parts();
        Entry { centre, radius: unpack(b.radius), error: unpack(b.error), split, axis, cos, sin }
    }
}

/// Splits in no order.
#[derive(Clone, Debug, Default)]
pub(super) struct List {
    pub(super) entries: Vec<Entry>,
}

impl List {
    /// Adds split `i`, which is in neither list.
    #[inline]
    pub(super) fn push(&mut self, h: &Hierarchy, i: u32, place: &mut [u32]) {
        debug_assert_eq!(place[i as usize], NONE);
        self.put(Entry::of(h, i), place);
    }

    /// Adds an entry of the other list.
    #[inline]
    pub(super) fn put(&mut self, e: Entry, place: &mut [u32]) {
        place[e.split as usize] = self.entries.len() as u32;
        self.entries.push(e);
    }

    /// Takes split `i` out, if it is in this list.
    #[inline]
    pub(super) fn remove(&mut self, i: u32, place: &mut [u32]) -> Option<Entry> {
        let at = place[i as usize] as usize;
        if self.entries.get(at).is_none_or(|e| e.split != i) {
            return None;
        }
        place[i as usize] = NONE;
        let e = self.entries.swap_remove(at);
        if let Some(moved) = self.entries.get(at) {
            place[moved.split as usize] = at as u32;
        }
        Some(e)
    }

    pub(super) fn bytes(&self) -> usize {
        self.entries.len() * size_of::<Entry>()
    }
}
