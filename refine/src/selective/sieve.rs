//! Decisions about many splits at a time: in single precision with a margin, and as one by one where that does not tell.
//!
//! Every decision compares numbers that change by at most so much with a place as that moves: depths, distances from planes, how far a cone is turned. Computed in single precision they are off
//! by some 1e-7 of the coordinates they are made of. So a comparison that comes out by more than [`MARGIN`] of those comes out so in double precision too; else the split is
//! decided about by [`Lens`] itself. So what is decided is the same, to the last split. Slacks are lower by the margins, so some splits are looked at a little earlier.

use super::Lens;
use super::clock::{Due, Found, Now, Pace};
use super::entry::Entry;
use glam::{BVec4A, Mat4, Vec3, Vec4};

/// Splits that go through at a time, in one instruction.
const LANES: usize = 4;
/// Of the coordinates that take part: sixteen times what they are rounded by.
const MARGIN: f32 = 2e-6;
/// Depths beyond which splits are fine enough are products of three numbers.
const PRODUCT: f32 = 1e-6;
/// Diagonals within which squares neither vanish nor grow beyond what single precision holds.
const SIZES: std::ops::Range<f64> = 1e-12..1e12;

/// A lens at a tolerance, in single precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sieve {
    eye: Vec3,
    gradient: Vec3,
    steep: f32,
    slant: f32,
    near: f32,
    floor: f32,
    /// Depth beyond which an error of 1 is fine enough.
    fine: f32,
    /// How fast that grows by the clock.
    grows: f32,
    planes: [Vec4; 6],
    back: bool,
    /// [`Pace::eye`].
    eye_part: f32,
    /// What coordinates are added to for the margin.
    base: f32,
    /// Slack counts less far away: by the part of the distance from the middle, from the eye, and so much more.
    far: [f32; 3],
}

/// Splits side by side: as many as go through at a time.
struct Four {
    centre: Vectors,
    radius: Vec4,
    error: Vec4,
    cone: [u32; LANES],
}

impl Four {
    /// Of at most [`LANES`]; where there are fewer the first stands for those that are not there.
    #[inline(always)]
    fn of(part: &[Entry]) -> Option<Four> {
        let first = part.first()?;
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| part.get(k).unwrap_or(first));
        let [p, q, r, s] = [a, b, c, d].map(|e| e.centre.extend(e.radius));
        let of = Mat4::from_cols(p, q, r, s).transpose();
        Some(Four {
            centre: Vectors { x: of.x_axis, y: of.y_axis, z: of.z_axis },
            radius: of.w_axis,
            error: Vec4::new(a.error, b.error, c.error, d.error),
            cone: [a, b, c, d].map(|e| e.cone.0),
        })
    }

    /// What coordinates may be off by.
    #[inline(always)]
    fn margin(&self, base: f32) -> Vec4 {
        let p = self.centre;
        MARGIN * (p.x.abs() + p.y.abs() + p.z.abs() + self.radius + all(base))
    }
}

/// What became of splits: needed or not, as far as that is sure, a bit each.
struct Sieved {
    wanted: u32,
    unwanted: u32,
    slack: Vec4,
    /// How far from the eye, and by how much these numbers may be off.
    away: Vec4,
    margin: Vec4,
}

impl Sieved {
    const NOTHING: Sieved =
        Sieved { wanted: 0, unwanted: 0, slack: Vec4::ZERO, away: Vec4::ZERO, margin: Vec4::ZERO };

    /// Whether the one in a lane is needed, if that is sure.
    #[inline(always)]
    fn sure(&self, k: usize) -> Option<bool> {
        ((self.wanted | self.unwanted) >> k & 1 != 0).then_some(self.wanted >> k & 1 != 0)
    }
}

/// Vectors side by side.
#[derive(Clone, Copy)]
struct Vectors {
    x: Vec4,
    y: Vec4,
    z: Vec4,
}

impl Vectors {
    #[inline(always)]
    fn dot(self, v: Vec3) -> Vec4 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    #[inline(always)]
    fn dots(self, o: Vectors) -> Vec4 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    #[inline(always)]
    fn length(self) -> Vec4 {
        sqrt(self.dots(self))
    }

    #[inline(always)]
    fn cross(self, o: Vectors) -> Vectors {
        Vectors {
            x: self.y * o.z - self.z * o.y,
            y: self.z * o.x - self.x * o.z,
            z: self.x * o.y - self.y * o.x,
        }
    }
}

#[inline(always)]
fn sqrt(v: Vec4) -> Vec4 {
    Vec4::new(v.x.sqrt(), v.y.sqrt(), v.z.sqrt(), v.w.sqrt())
}

#[inline(always)]
fn all(x: f32) -> Vec4 {
    Vec4::splat(x)
}

/// As [`crate::hierarchy::Cone::cos_sin`].
#[inline(always)]
fn cos_sin(x: Vec4) -> (Vec4, Vec4) {
    let y = x * x;
    let cos = y * (-1.0 / 3_628_800.0) + all(1.0 / 40_320.0);
    let cos = y * (y * (y * cos + all(-1.0 / 720.0)) + all(1.0 / 24.0)) + all(-1.0 / 2.0);
    let sin = y * (1.0 / 362_880.0) + all(-1.0 / 5_040.0);
    let sin = y * (y * (y * sin + all(1.0 / 120.0)) + all(-1.0 / 6.0)) + all(1.0);
    (y * cos + all(1.0), x * sin)
}

impl Sieve {
    /// `None` where it would seldom tell, or takes other formulas.
    pub(super) fn new(lens: &Lens, tau: f64, pace: &Pace) -> Option<Sieve> {
        let simple = lens.perspective && !lens.directional && tau > 0.0 && tau < f64::INFINITY;
        if !simple || !SIZES.contains(&pace.diagonal) {
            return None;
        }
        let fine = lens.scale(tau) / tau;
        let origin = lens.frustum.map_or(glam::DVec3::ZERO, |f| f.origin());
        let mut base = lens.eye.abs().element_sum() + 1e-6 * pace.diagonal;
        let planes = match &lens.frustum {
            // Nothing is outside.
            None => [Vec4::new(0.0, 0.0, 0.0, f32::MAX); 6],
            Some(f) => f.planes().each_ref().map(|p| {
                let offset = p.offset - p.normal.dot(origin);
                base = base.max(offset.abs() + lens.eye.abs().element_sum());
                p.normal.as_vec3().extend(offset as f32)
            }),
        };
        base += origin.abs().element_sum();
        let grows = if pace.per_tau.is_finite() { 1.3 * fine / pace.per_tau } else { 0.0 };
        let far = pace.far_parts().map(|x| (x * (1.0 + 1e-6)) as f32);
        let sieve = Sieve {
            eye: lens.eye.as_vec3(),
            gradient: lens.gradient.as_vec3(),
            steep: lens.steep as f32,
            slant: lens.slant as f32,
            near: lens.near as f32,
            floor: lens.floor as f32,
            fine: fine as f32,
            grows: grows as f32,
            planes,
            back: lens.back,
            eye_part: pace.eye as f32,
            base: base as f32,
            far,
        };
        let small = |x: f64| x < 1e15;
        (small(base) && small(lens.steep) && lens.steep > 1e-15 && small(fine)).then_some(sieve)
    }

    /// Whether each split is needed, and how far the lens may move before that can change.
    pub(super) fn look(
        &self,
        (lens, tau, pace): (&Lens, f64, &Pace),
        entries: &[Entry],
        out: &mut Vec<Found>,
    ) {
        for part in entries.chunks(LANES) {
            let s = self.sift::<true>(part);
            for (k, (e, slack)) in part.iter().zip(s.slack.to_array()).enumerate() {
                out.push(match s.sure(k) {
                    Some(wanted) => Found { wanted, slack },
                    None => lens.verdict(e, tau, pace).into(),
                });
            }
        }
    }

    /// Whether each split is needed, and when that is to be looked at again; what is not sure is left to `other`.
    pub(super) fn look_until(
        &self,
        now: &Now,
        entries: &[Entry],
        other: impl Fn(&Entry) -> (bool, Due),
        out: &mut Vec<(bool, Due)>,
    ) {
        for part in entries.chunks(LANES) {
            let s = self.sift::<true>(part);
            let (away, until) = now.due(s.away, s.slack, s.margin);
            let times = away.to_array().into_iter().zip(until.to_array());
            for (k, (e, (away, until))) in part.iter().zip(times).enumerate() {
                out.push(match s.sure(k) {
                    Some(wanted) => (wanted, Due::new(away, until)),
                    None => other(e),
                });
            }
        }
    }

    /// Whether each split is needed.
    pub(super) fn wanted(&self, lens: &Lens, tau: f64, entries: &[Entry], out: &mut Vec<bool>) {
        for part in entries.chunks(LANES) {
            let s = self.sift::<false>(part);
            out.extend(part.iter().enumerate().map(|(k, e)| s.sure(k).unwrap_or_else(|| lens.wants(e, tau))));
        }
    }

    #[inline(always)]
    fn sift<const SLACK: bool>(&self, part: &[Entry]) -> Sieved {
        match Four::of(part) {
            None => Sieved::NOTHING,
            Some(of) if self.back => self.decide::<SLACK, true>(&of),
            Some(of) => self.decide::<SLACK, false>(&of),
        }
    }

    /// See [`Lens::verdict`] for what each number is. Of at most [`LANES`]; where there are fewer, what is said of the others means nothing.
    #[inline(always)]
    fn decide<const SLACK: bool, const BACK: bool>(&self, of: &Four) -> Sieved {
        let &Four { centre: p, radius, error, cone: code } = of;
        let margin = of.margin(self.base);
        // Fine enough from here?
        let d = Vectors { x: p.x - all(self.eye.x), y: p.y - all(self.eye.y), z: p.z - all(self.eye.z) };
        let away = d.length();
        let along = d.dot(self.gradient) - self.steep * radius;
        let about = self.slant * (away - radius);
        let fine = error * self.fine;
        let unsure = self.steep * margin + PRODUCT * fine;
        let (low, high) = (fine - unsure, fine + unsure);
        let depth = along.max(about).max(all(self.near.max(self.floor)));
        let (is_fine, is_coarse) = (depth.cmpgt(high), depth.cmplt(low));
        // In the frustum?
        let inside = |n: &Vec4| p.dot(n.truncate()) + all(n.w);
        let [left, right, bottom, top, near, far] = &self.planes;
        let sides = inside(left).min(inside(right)).min(inside(bottom).min(inside(top)));
        let inside = sides.min(inside(near).min(inside(far))) + radius;
        let (is_in, is_out) = (inside.cmpgt(margin), inside.cmplt(-margin));
        // Turned away?
        let wide = 4.0 * margin;
        let none = BVec4A::splat(false);
        let (facing, above, known, is_away, is_front) = if BACK {
            let part = |shift: u32, mask: u32| {
                let of = |c: u32| (c >> shift & mask) as i32 as f32;
                Vec4::new(of(code[0]), of(code[1]), of(code[2]), of(code[3]))
            };
            let (u, v) = (part(0, 0x3ff), part(10, 0x3ff));
            let (u, v) = (u * (2.0 / 1023.0) - Vec4::ONE, v * (2.0 / 1023.0) - Vec4::ONE);
            let w = Vec4::ONE - u.abs() - v.abs();
            let fold = (-w).max(Vec4::ZERO);
            let axis = Vectors { x: u - fold.copysign(u), y: v - fold.copysign(v), z: w };
            let length = axis.length();
            let (facing, across) = (d.dots(axis) / length, d.cross(axis).length() / length);
            let steps = part(20, 0xfff);
            let (cos, sin) = cos_sin(steps * (std::f32::consts::FRAC_PI_2 / 4094.0));
            let above = facing * cos - across * sin - radius;
            // What looks all ways never is.
            let known = steps.cmplt(all(4094.5));
            (facing, above, known, known & above.cmpgt(wide), !known | above.cmplt(-wide))
        } else {
            (Vec4::ZERO, Vec4::ZERO, none, none, !none)
        };
        let unwanted = is_fine | is_out | is_away;
        let wanted = is_coarse & is_in & is_front;
        let mut slack = Vec4::ZERO;
        if SLACK {
            let far = match self.far {
                [0.0, 0.0, more] => all(more).max(Vec4::ONE),
                [middle, eye, more] => (middle * p.length() + eye * away + all(more)).max(Vec4::ONE),
            };
            let grows = error * self.grows;
            let eye = self.eye_part;
            // How far depths are beyond, each by how fast it changes.
            let first = (self.steep * far + grows).recip();
            let second = (all(self.slant / eye) + grows).recip();
            let third = grows.max(all(1e-30)).recip();
            let until_coarse = ((along - high) * first)
                .max((about.max(all(self.floor)) - high) * second)
                .max((all(self.near) - high) * third);
            let until_fine = ((low - along) * first)
                .min((low - about.max(all(self.floor))) * second)
                .min((low - all(self.near)) * third);
            let until_in = (-inside - margin) / far;
            let until_out = (inside - margin) / far;
            let mut of_unwanted = Vec4::select(is_fine, until_coarse, Vec4::ZERO).max(Vec4::select(
                is_out,
                until_in,
                Vec4::ZERO,
            ));
            let mut of_wanted = until_fine.min(until_out);
            if BACK {
                let until_front = (above - wide) * eye;
                let front = Vec4::select(facing.cmple(Vec4::ZERO), radius - facing, -above);
                let until_away = Vec4::select(known, (front - wide) * eye, all(f32::MAX));
                of_unwanted = of_unwanted.max(Vec4::select(is_away, until_front, Vec4::ZERO));
                of_wanted = of_wanted.min(until_away);
            }
            slack = Vec4::select(wanted, of_wanted, of_unwanted).max(Vec4::ZERO);
        }
        Sieved { wanted: wanted.bitmask(), unwanted: unwanted.bitmask(), slack, away, margin }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selective::Cull;
    use crate::selective::clock::tests::{DIAGONAL, Pose, Random, entry};

    #[test]
    fn it_decides_as_the_lens_does_and_is_seldom_unsure() {
        let mut r = Random(9);
        let (mut unsure, mut stood, mut counts) = (0, 0, [0; 2]);
        for round in 0..240 {
            let cull = [Cull::All, Cull::None, Cull::Frustum, Cull::Cone][round % 4];
            let eye = r.vector() * [0.4, 1.0, 3.0][round % 3];
            let look = if r.unit() < 0.7 { 0.3 * r.vector() - eye } else { r.vector() };
            let start = Pose { eye, look, up: r.vector(), tau: 0.2 + 2.0 * r.unit(), directional: false };
            let lens = start.lens(true, cull);
            let diagonal = DIAGONAL / 1.7;
            let pace = Pace::of(&lens, diagonal, if round % 2 == 0 { diagonal } else { f64::INFINITY });
            let sieve = Sieve::new(&lens, lens.tau, &pace).unwrap();
            // Not a multiple of what goes through at a time.
            let mut entries: Vec<Entry> = (0..201).map(|_| entry(&mut r)).collect();
            // Hard ones: at the depth where they are just fine enough, at a plane, in the eye.
            for e in entries.iter_mut().step_by(5) {
                let depth = lens.gradient.dot(e.centre.as_dvec3() - lens.eye) - lens.steep * e.radius as f64;
                e.error = (depth * lens.tau / lens.scale(lens.tau)).max(0.0) as f32;
            }
            for e in entries.iter_mut().skip(1).step_by(5) {
                e.radius = -lens.sides.distances(e.centre.as_dvec3()).into_iter().fold(0.0, f64::min) as f32;
            }
            for e in entries.iter_mut().skip(2).step_by(50) {
                (e.centre, e.radius) = (lens.eye.as_vec3(), 0.0);
            }
            let (mut found, mut wanted) = (Vec::new(), Vec::new());
            sieve.look((&lens, lens.tau, &pace), &entries, &mut found);
            sieve.wanted(&lens, lens.tau, &entries, &mut wanted);
            assert_eq!((found.len(), wanted.len()), (entries.len(), entries.len()));
            for ((e, f), &w) in entries.iter().zip(&found).zip(&wanted) {
                assert_eq!((f.wanted, w), (lens.wants(e, lens.tau), f.wanted), "{e:?}");
                assert!(f.slack >= 0.0, "{f:?}");
                counts[w as usize] += 1;
            }
            for part in entries.iter().skip(3).step_by(5).copied().collect::<Vec<_>>().chunks(LANES) {
                let s = sieve.sift::<false>(part);
                assert_eq!(s.wanted & s.unwanted, 0);
                unsure +=
                    part.len() - ((s.wanted | s.unwanted) & ((1 << part.len()) - 1)).count_ones() as usize;
            }
            // What was decided stands for as long as is said.
            let (mut pose, mut last, mut way) = (start, lens, 0.0);
            for _ in 0..4 {
                pose = pose.moved(&mut r, [0.003, 0.03, 0.1][round % 3]);
                pose.tau = if pace.per_tau.is_finite() { pose.tau } else { lens.tau };
                let now = pose.lens(true, cull);
                way += pace.motion((&last, last.tau), (&now, now.tau)).unwrap();
                for (e, f) in entries.iter().zip(&found).filter(|(_, f)| way < 0.999 * f64::from(f.slack)) {
                    assert_eq!(now.wants(e, now.tau), f.wanted, "round {round}: {f:?} after {way}, {e:?}");
                    stood += 1;
                }
                last = now;
            }
        }
        assert!(
            unsure < 30 && stood > 20_000 && counts.iter().all(|&c| c > 3000),
            "{unsure} {stood} {counts:?}"
        );
    }

    #[test]
    fn what_it_cannot_tell_it_leaves_to_the_lens() {
        let mut r = Random(2);
        let mut pose = Pose {
            eye: glam::DVec3::Z * 3.0,
            look: -glam::DVec3::Z,
            up: glam::DVec3::Y,
            tau: 1.0,
            directional: false,
        };
        let lens = pose.lens(true, Cull::All);
        let pace = Pace::of(&lens, DIAGONAL, DIAGONAL);
        assert!(Sieve::new(&lens, 0.0, &pace).is_none() && Sieve::new(&lens, f64::INFINITY, &pace).is_none());
        assert!(Sieve::new(&lens, 1.0, &Pace::of(&lens, 1e-13, 1e-13)).is_none());
        assert!(Sieve::new(&pose.lens(false, Cull::All), 1.0, &pace).is_none());
        pose.directional = true;
        assert!(Sieve::new(&pose.lens(true, Cull::All), 1.0, &pace).is_none());
        // Numbers beyond all.
        let sieve = Sieve::new(&lens, 1.0, &pace).unwrap();
        for (centre, radius, error) in
            [(f32::NAN, 0.1, 0.1), (0.0, f32::NAN, 0.1), (0.0, 0.1, 1.7e38), (3e38, 3e38, 1e38)]
        {
            let mut e = entry(&mut r);
            (e.centre.x, e.radius, e.error) = (centre, radius, error);
            let mut wanted = Vec::new();
            sieve.wanted(&lens, 1.0, &[e], &mut wanted);
            assert_eq!(wanted, [lens.wants(&e, 1.0)]);
        }
    }
}
