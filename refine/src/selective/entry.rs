//! A split with what is needed to decide about it.

use crate::aif::NONE;
use crate::hierarchy::{Cone, Direction, Hierarchy, Packed, repack, unpack};
use glam::Vec3;

/// A split and its bounds, ready to be decided about, 32 B.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(super) centre: Vec3,
    pub(super) radius: f32,
    pub(super) error: f32,
    pub(crate) split: u32,
    pub(super) cone: Cone,
    pub(super) direction: Direction,
}

impl Entry {
    /// Of no split.
    pub(crate) const NOTHING: Entry = Entry {
        centre: Vec3::ZERO,
        radius: 0.0,
        error: 0.0,
        split: NONE,
        cone: Cone(0),
        direction: Direction::ANY,
    };

    pub(crate) fn of(h: &Hierarchy, i: u32) -> Entry {
        Entry::placed(h, i, h.local_centre(i))
    }

    /// Of split `i`, at a place about the origin of the bounds.
    #[inline]
    pub(super) fn placed(h: &Hierarchy, i: u32, at: Vec3) -> Entry {
        Entry::new(i, at, h.bounds.of[i as usize]).with_direction(h)
    }

    /// Of a split at `centre`, about the origin of the bounds.
    #[inline]
    pub(crate) fn new(split: u32, centre: Vec3, b: Packed) -> Entry {
        let direction = Direction::ANY;
        Entry { centre, radius: unpack(b.radius), error: unpack(b.error), split, cone: b.cone, direction }
    }

    /// Its bounds, as they were given.
    #[inline]
    pub(crate) fn bounds(&self) -> Packed {
        Packed { error: repack(self.error), radius: repack(self.radius), cone: self.cone }
    }

    /// Where it stands, about the origin of the bounds.
    #[inline]
    pub(crate) fn centre(&self) -> Vec3 {
        self.centre
    }

    /// How far it reaches, and its error.
    #[inline]
    pub(crate) fn size(&self) -> (f64, f64) {
        (f64::from(self.radius), f64::from(self.error))
    }

    /// At another place, and with a radius that is more by `wider`.
    #[inline]
    pub(crate) fn moved(self, centre: Vec3, wider: f32) -> Entry {
        Entry { centre, radius: self.radius + wider, ..self }
    }

    #[inline]
    fn with_direction(mut self, h: &Hierarchy) -> Entry {
        self.direction = h.direction(self.split);
        self
    }
}
