//! What is too fine from wherever it is seen, as long as it is not seen from nearer.
//!
//! Times ([`super::Clock`]) tell nothing after a jump: to the other side of the mesh, say, from where each depth is another. But where the middle of the mesh is at depth z, no place of it at a distance d from
//! the middle is at less than z - d, whichever way the lens looks. So a split whose error is fine enough there is not needed by any lens that has the middle as deep, or deeper, and lets errors count as much, or less. Most
//! vertices have no other split that is to be decided about: they need not be looked at after jumps that keep their distance.

use super::Lens;
use super::entry::Entry;
use std::ops::Range;

/// How near lenses are that what is called too fine is so for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Standoff {
    /// The middle of the mesh is as deep, by lengths of the mesh, or deeper.
    depth: f64,
    /// Depth, by lengths of the mesh, from which on an error of 1 is fine enough; or less.
    scale: f64,
    /// The same, rounded so that the other side of what is rounded in [`Standoff::holds_for`] is made up for.
    rounded: [f32; 2],
}

/// Room for lenses to come nearer, or ask for more, before what is too fine is to be found out anew.
const ROOM: f64 = 0.03;
/// With so much more room it is found out anew as well, as far as it is looked at: more of it is too fine then.
const MUCH: f64 = 1.25;
/// Of the depth: what single precision takes away, 4e-7, and more.
const MARGIN: f64 = 1e-5;
/// Depths beside which the squares of lengths neither vanish nor grow beyond what single precision holds.
const SIZES: Range<f64> = 1e-12..1e12;

impl Standoff {
    /// Nothing is too fine.
    pub(super) const NONE: Standoff = Standoff { depth: f64::INFINITY, scale: 0.0, rounded: [0.0; 2] };

    /// As near as these lenses are; [`Standoff::NONE`] if there is none, or that tells nothing.
    fn of(lenses: &[Lens]) -> Standoff {
        let (mut depth, mut scale) = (f64::INFINITY, 0.0f64);
        for lens in lenses {
            let own = -lens.gradient.dot(lens.eye) / lens.steep;
            // From aside depth is rounded by more than itself.
            if !(lens.perspective && SIZES.contains(&own) && own > 1e-6 * lens.eye.length()) {
                return Standoff::NONE;
            }
            // Of a tolerance of 0 infinite.
            let counts = lens.scale(lens.tau) / lens.tau / lens.steep;
            (depth, scale) = (depth.min(own), if counts < 1e30 { scale.max(counts) } else { f64::INFINITY });
        }
        let all = Standoff { depth, scale, ..Standoff::NONE }.wide(1.0);
        if depth < f64::INFINITY && scale < f64::INFINITY { all } else { Standoff::NONE }
    }

    /// What is too fine for this is so for the other, which is not [`Standoff::NONE`].
    fn covers(&self, other: &Standoff) -> bool {
        self.depth <= other.depth && self.scale >= other.scale && other.depth < f64::INFINITY
    }

    /// The same with room.
    fn wide(self, room: f64) -> Standoff {
        let (depth, scale) = (self.depth / room, self.scale * room);
        let rounded = [(depth * (1.0 - MARGIN)) as f32, (scale * (1.0 + MARGIN)) as f32];
        Standoff { depth, scale, rounded }
    }

    /// Goes on to the lenses of a frame; true if what was too fine before need not be for these.
    pub(super) fn follow(&mut self, lenses: &[Lens]) -> bool {
        let now = Standoff::of(lenses);
        let next = if now == Standoff::NONE { now } else { now.wide(1.0 + ROOM) };
        let covers = self.covers(&now);
        // What is too fine stays so if there is more room all round.
        let much = next.depth >= MUCH * self.depth || next.scale * MUCH <= self.scale;
        if !covers || (much && self.covers(&next)) {
            *self = next;
        }
        !covers
    }

    /// A split is not needed by any lens that is as far away.
    #[inline(always)]
    pub(super) fn holds_for(&self, e: &Entry) -> bool {
        let [depth, scale] = self.rounded;
        // Not the comparison turned round: what is no number is not too fine.
        e.error * scale + (e.centre.length() + e.radius) < depth
    }
}

#[cfg(test)]
mod tests {
    use super::super::clock::tests::{DIAGONAL, Pose, Random, entry};
    use super::*;
    use crate::selective::Cull;
    use glam::{DQuat, DVec3};

    #[test]
    fn what_is_too_fine_is_needed_by_no_lens_as_far_away() {
        let mut r = Random(3);
        let (mut fine, mut seen, mut near, mut tight) = (0, 0, 0, 0);
        for round in 0..300 {
            let cull = [Cull::All, Cull::None, Cull::Frustum, Cull::Cone][round % 4];
            let eye = DIAGONAL * (0.6 + r.unit()) * r.vector().normalize();
            let look = 0.3 * r.vector() - eye;
            let directional = round % 5 == 0;
            let pose = Pose { eye, look, up: r.vector(), tau: 0.2 + 2.0 * r.unit(), directional };
            let mut standoff = Standoff::NONE;
            assert!(standoff.follow(&[pose.lens(true, cull)]));
            let entries: Vec<Entry> = (0..100).map(|_| entry(&mut r)).collect();
            for _ in 0..20 {
                // To any other side; a little nearer at times, or at another tolerance.
                let turn = DQuat::from_scaled_axis(3.0 * r.vector());
                let tau = pose.tau * (0.1 * (r.unit() - 0.4)).exp();
                let eye = turn * pose.eye * (0.1 * (r.unit() - 0.4)).exp();
                let moved = Pose { eye, look: turn * pose.look, up: turn * pose.up, tau, directional };
                let lens = moved.lens(true, cull);
                if !standoff.covers(&Standoff::of(&[lens])) {
                    near += 1;
                    continue;
                }
                for e in &entries {
                    let wants = lens.wants(e, lens.tau);
                    assert!(!(wants && standoff.holds_for(e)), "round {round}: {e:?}");
                    fine += u32::from(standoff.holds_for(e));
                    seen += u32::from(!standoff.holds_for(e) && !wants);
                    // Nothing else would do: the nearest it can be.
                    let least = standoff.depth - f64::from(e.centre.length() + e.radius);
                    tight += u32::from(!standoff.holds_for(e) && f64::from(e.error) * standoff.scale < least);
                }
            }
        }
        assert!(fine > 20_000 && seen > 1000 && near > 500 && tight < 30, "{fine} {seen} {near} {tight}");
    }

    #[test]
    fn it_is_found_anew_nearer_and_much_farther_away() {
        let at = |z: f64, tau: f64| {
            let pose = Pose { eye: DVec3::Z * z, look: -DVec3::Z, up: DVec3::Y, tau, directional: false };
            [pose.lens(true, Cull::All)]
        };
        let mut s = Standoff::NONE;
        assert!(s.follow(&at(3.0, 1.0)) && !s.follow(&at(3.0, 1.0)) && !s.follow(&at(2.95, 1.0)));
        let first = s;
        assert!(!s.follow(&at(3.1, 1.2)) && s == first);
        // With more room as it is asked for, without being left.
        assert!(!s.follow(&at(6.0, 1.0)) && s != first && first.covers(&s));
        assert!(s.follow(&at(3.0, 1.0)) && s == first);
        assert!(s.follow(&at(3.0, 0.9)) && s.follow(&at(2.0, 0.9)));
        // Nothing by the middle behind the eye, at a tolerance of 0, of a parallel projection, without lenses.
        let back = Pose { eye: DVec3::Z, look: DVec3::Z, up: DVec3::Y, tau: 1.0, directional: false };
        for lenses in [&[back.lens(true, Cull::All)], &at(3.0, 0.0), &[back.lens(false, Cull::All)], &[][..]]
        {
            assert!(s.follow(lenses) && s == Standoff::NONE && s.follow(lenses));
        }
        assert!(!s.holds_for(&entry(&mut Random(1))));
        // Of several the nearest counts.
        assert!(s.follow(&[at(4.0, 1.0)[0], at(3.0, 1.0)[0]]) && s == first);
    }
}
