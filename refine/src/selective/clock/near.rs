//! Times for decisions that are looked at one by one: by how far the lens has moved and how far it has turned, apart.
//!
//! A [`Clock`] takes both together at the farthest place that a decision may be about: there turning counts most. Of what is near turning moves little, and a flight close to the ground turns all of the time
//! and is near to most that it shows. So here a decision about a sphere whose middle is `away` from the eye keeps its distance, too.
//!
//! **Why it stands.** Let M be the sum of how far the eye has moved from frame to frame, and T that of how far the axes of the view have turned (the length of the largest difference of unit normals of the
//! picture's planes). From one frame to the next a depth, or a distance from a plane, of a place p changes by at most dM + dT |p - eye|; a distance from the eye, or what tells how far a cone is turned, by at most dM. With slack
//! s and a = away + s: as long as the sum M + a T has grown by less than s, the eye has moved by less than s, so it is nearer to p than a, and no function has changed by s. A change of the tolerance adds to M what it adds to the
//! distance of a clock. Sums are kept in f64, times in f32 with a margin for its rounding, and all begins anew when the sums become large.

use super::{About, Clock, Judges, LONGEST, Many, Pace, SAFE, Verdict};
use crate::selective::Lens;
use crate::selective::entry::Entry;
use glam::Vec4;

/// Sums of what lenses have moved and turned.
#[derive(Clone, Debug)]
pub(crate) struct Clocks {
    /// For other lenses than one in perspective, and for what changes at once.
    all: Clock,
    moved: f64,
    turned: f64,
    /// There is one lens, in perspective.
    apart: bool,
    /// What the last frame has added to both.
    step: [f64; 2],
    /// The lens some frames on, if it goes on so: as many as are looked at ahead, and fewer, for what is passed by in the meantime.
    coming: Option<[Lens; 2]>,
}

/// When to look at something again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Due {
    /// How much turning counts.
    away: f32,
    until: f32,
}

/// Of sums of f32: a few roundings, of 6e-8 each.
const ROUNDED: f64 = 1e-6;
/// Frames that what will be needed is looked at ahead.
const AHEAD_OF: f64 = 8.0;
/// Fewer: what is near is passed by sooner.
const PASSING: f64 = 3.0;
/// The largest sums: radians, and diagonals.
const MOST: f64 = 4.0;

impl Due {
    /// Always.
    pub(crate) const NOW: Due = Due { away: 0.0, until: f32::NEG_INFINITY };
    /// Of what is not there.
    pub(crate) const NEVER: Due = Due { away: 0.0, until: f32::INFINITY };

    /// At a time: of what turning counts so much for. What is no time is now.
    #[inline(always)]
    pub(crate) fn new(away: f32, until: f32) -> Due {
        if until < f32::INFINITY && away < f32::INFINITY { Due { away, until } } else { Due::NOW }
    }
}

impl Clocks {
    /// Before the first lens.
    pub(crate) fn new(diagonal: f64) -> Clocks {
        Clocks {
            all: Clock::new(diagonal),
            moved: 0.0,
            turned: 0.0,
            apart: false,
            step: [0.0; 2],
            coming: None,
        }
    }

    /// As [`Clock::go_on`].
    pub(crate) fn go_on(&mut self, judges: &Judges<'_>) -> bool {
        let apart = matches!(judges.lenses, [l] if l.perspective);
        let motion = self.motion(judges, apart);
        self.coming = match (&self.all.lenses[..], judges.lenses) {
            ([before], [lens]) if motion.is_some() => {
                Some([AHEAD_OF, PASSING].map(|frames| lens.going_on(before, frames)))
            }
            _ => None,
        };
        let stands = self.all.go_on(judges);
        if let Some([moved, turned]) = motion.filter(|_| stands && self.apart == apart) {
            self.moved += moved;
            self.turned += turned;
            self.step = [moved, turned];
            if self.moved < MOST * self.all.pace.diagonal && self.turned < MOST {
                return true;
            }
        }
        (self.moved, self.turned, self.apart) = (0.0, 0.0, apart);
        false
    }

    /// How far the lenses move, and how far they turn, from those of the last frame; `None` if nothing stands.
    fn motion(&self, judges: &Judges<'_>, apart: bool) -> Option<[f64; 2]> {
        if self.all.lenses.len() != judges.lenses.len() {
            return None;
        }
        let (mut moved, mut turned) = (0.0f64, 0.0f64);
        for (a, b) in self.all.lenses.iter().zip(judges.lenses) {
            let kept = ((a, self.all.keep * a.tau), (b, judges.keep * b.tau));
            if apart {
                let [step, turn] = steps(a, b)?;
                let by_tau = |(a, at): (&Lens, f64), (b, bt): (&Lens, f64)| {
                    let (was, is) = (a.scale(at) / at, b.scale(bt) / bt);
                    if was == is { 0.0 } else { (is / was).ln().abs() * self.all.pace.per_tau }
                };
                let by_tau = by_tau((a, a.tau), (b, b.tau)).max(by_tau(kept.0, kept.1));
                // What is too large, or none, is noticed by the clock for all.
                (moved, turned) = (moved.max(step + by_tau), turned.max(turn));
            } else {
                let pace = &self.all.pace;
                moved = moved.max(pace.motion((a, a.tau), (b, b.tau))?).max(pace.motion(kept.0, kept.1)?);
            }
        }
        Some([moved, turned])
    }

    /// The sums now.
    #[inline]
    pub(crate) fn sums(&self) -> Sums {
        Sums { moved: self.moved as f32, turned: self.turned as f32 }
    }

    /// The sums after so many frames like the last.
    pub(crate) fn horizon(&self, frames: f64) -> Sums {
        let on = |sum: f64, step: f64| (sum + frames * step) as f32;
        Sums { moved: on(self.moved, self.step[0]), turned: on(self.turned, self.step[1]) }
    }

    /// What a frame like the last adds to the sums.
    pub(crate) fn paces(&self) -> Paces {
        Paces { from: self.sums(), step: self.step.map(|s| s as f32) }
    }

    /// How slack is measured.
    fn pace(&self) -> Pace {
        let pace = self.all.pace;
        if self.apart { Pace { about: About::Each, eye: 1.0, ..pace } } else { pace }
    }

    /// To ask about many, whether they are needed.
    pub(crate) fn next<'a>(&self, judges: &Judges<'a>) -> Many<'a> {
        judges.many(1.0, &self.pace())
    }

    /// To ask about many, whether they are to be kept.
    pub(crate) fn last<'a>(&self, judges: &Judges<'a>) -> Many<'a> {
        judges.many(judges.keep, &self.pace())
    }

    /// Whether each is needed, or to be kept, and when that is to be looked at again.
    pub(crate) fn look(&self, many: &Many<'_>, entries: &[Entry], out: &mut Looked) {
        out.0.clear();
        let now = self.apart.then(|| Now {
            moved: self.moved as f32,
            turned: self.turned as f32,
            most: self.most() as f32,
        });
        let one = |e: &Entry, v: Verdict| (v.wanted, self.due(&many.judges, e, v.slack));
        many.look_until(now, entries, one, &mut out.0);
    }

    /// The most slack that counts: as far as changes of the tolerance are looked after.
    fn most(&self) -> f64 {
        LONGEST * self.all.pace.diagonal
    }

    /// [`AHEAD_OF`] frames like the last before a time, and whether that has come; then a part of them from now.
    pub(crate) fn ahead_of(&self, due: Due) -> (Due, bool) {
        let away = f64::from(due.away);
        let by = AHEAD_OF * (self.step[0] + away * self.step[1]);
        let now = self.moved + away * self.turned;
        let until = f64::from(due.until);
        let soon = until - by <= now;
        let early = if soon { until.min(now + 0.25 * by) } else { until - by };
        (Due { until: early as f32, ..due }, soon)
    }

    /// A split would be needed [`AHEAD_OF`] or [`PASSING`] frames on, if the lens went on so.
    pub(crate) fn will_want(&self, e: &Entry) -> bool {
        self.coming.as_ref().is_some_and(|coming| coming.iter().any(|l| l.wants(e, l.tau)))
    }

    /// A split is needed at a part of the tolerance.
    pub(crate) fn wants_at(&self, e: &Entry, part: f64) -> bool {
        self.all.lenses.iter().any(|l| l.wants(e, part * l.tau))
    }

    /// When something that has this slack is to be looked at again.
    #[inline]
    fn due(&self, judges: &Judges<'_>, e: &Entry, slack: f64) -> Due {
        if slack.is_nan() {
            return Due::NOW;
        }
        let most = self.most();
        let (away, slack) = match judges.lenses {
            [lens] if self.apart => {
                let away = (e.centre.as_dvec3() - lens.eye).length();
                let slack = slack.min(most);
                (away + slack, slack)
            }
            _ => (0.0, slack.min(most)),
        };
        let until = self.moved + away * self.turned + slack * SAFE;
        let until = (until - ROUNDED * until) as f32;
        // NaN is now.
        if until.is_nan() { Due::NOW } else { Due { away: away as f32, until: until.min(f32::MAX) } }
    }
}

/// The sums, and the most slack that counts, in single precision.
#[derive(Clone, Copy, Debug)]
pub(in crate::selective) struct Now {
    moved: f32,
    turned: f32,
    most: f32,
}

impl Now {
    /// As [`Clocks::due`], of what is so far away and has so much slack, the former by as much as `margin` off: how much turning counts, and until when.
    #[inline(always)]
    pub(in crate::selective) fn due(&self, away: Vec4, slack: Vec4, margin: Vec4) -> (Vec4, Vec4) {
        let slack = slack.min(Vec4::splat(self.most)).max(Vec4::ZERO);
        let away = away + margin + slack;
        let until = Vec4::splat(self.moved) + away * self.turned + slack * SAFE as f32;
        (away, until - until * ROUNDED as f32)
    }
}

/// What was found out about many.
#[derive(Debug, Default)]
pub(crate) struct Looked(Vec<(bool, Due)>);

impl Looked {
    /// Whether each is needed, or to be kept, and when to look again.
    pub(crate) fn each(&self) -> impl Iterator<Item = (bool, Due)> + '_ {
        self.0.iter().copied()
    }
}

/// The sums at a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sums {
    moved: f32,
    turned: f32,
}

impl Sums {
    #[inline(always)]
    pub(crate) fn have_reached(self, due: Due) -> bool {
        self.moved + due.away * self.turned >= due.until
    }

    /// Others are no farther on in either way: then what has not come by these has not come by those, as rounding keeps the order.
    pub(crate) fn include(self, others: Sums) -> bool {
        others.moved <= self.moved && others.turned <= self.turned
    }
}

/// Sums, and what a frame adds to them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Paces {
    from: Sums,
    step: [f32; 2],
}

impl Paces {
    /// The first of so many frames like that at which something is due, `most` if none is; by rounding another at times. Of what is due by now the first.
    #[inline(always)]
    pub(crate) fn frames_to(&self, due: Due, most: usize) -> usize {
        let Sums { moved, turned } = self.from;
        let left = due.until - (moved + due.away * turned);
        // Without a step none is; what is no number is due.
        let frames = left / (self.step[0] + due.away * self.step[1]) + 1.0;
        if left > 0.0 { frames.min(most as f32) as usize } else { 0 }
    }
}

/// How far the eye moves from one lens in perspective to another, and how far the axes turn; `None` if they are not of one kind.
fn steps(a: &Lens, b: &Lens) -> Option<[f64; 2]> {
    let same = a.frustum.is_some() == b.frustum.is_some()
        && (a.back, a.perspective, a.near, a.slant) == (b.back, b.perspective, b.near, b.slant)
        && a.directional == b.directional
        && (a.steep - b.steep).abs() <= 1e-12 * a.steep;
    if !same || !a.perspective {
        return None;
    }
    let mut moved = (b.eye - a.eye).length();
    // Depth is measured along a gradient of the length `steep`, and its slack divided by that.
    let mut turned = (b.gradient / b.steep - a.gradient / a.steep).length();
    if let (Some(f), Some(g)) = (&a.frustum, &b.frustum) {
        let origin = (g.origin() - f.origin()).length();
        for (p, q) in f.planes().iter().zip(g.planes()) {
            let off = if p.offset == q.offset { 0.0 } else { (q.offset - p.offset).abs() };
            moved = moved.max(origin + off);
            turned = turned.max((q.normal - p.normal).length());
        }
    }
    Some([moved, turned])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hierarchy::{Cone, Packed, pack_up};
    use crate::selective::{Cull, Lens};
    use crate::view::{Camera, NormalCone};
    use glam::{DMat4, DVec3};

    /// On flights of all speeds, near the ground and through it, what is not due is what it was decided to be; and near things are looked at far less often than by one clock.
    #[test]
    fn what_is_not_due_is_as_it_was() {
        let mut state = 9u64;
        let mut unit = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        let (mut stood, mut looks, mut looks_by_one) = (0, 0, 0);
        for round in 0..24 {
            let mut vector = || DVec3::new(unit(), unit(), unit()) * 2.0 - 1.0;
            let mut eye = vector() * DVec3::new(0.3, 0.3, 0.0) + DVec3::Z * 0.01;
            // The denser the nearer, as what is shown is.
            let entries: Vec<Entry> = (0..400)
                .map(|i| {
                    let (way, to) = (vector() * DVec3::new(1.0, 1.0, 0.02), vector());
                    let at = eye + way * 0.5 * (2.5 * (to.z - 1.0)).exp();
                    let radius = 0.1 * at.distance(eye) * (0.5 + 0.5 * to.x).powi(4);
                    let cone = Cone::around(&NormalCone::new(vector(), 0.4));
                    let packed =
                        Packed { error: pack_up(0.1 * radius * to.y.abs()), radius: pack_up(radius), cone };
                    Entry::new(i, at.as_vec3(), packed)
                })
                .collect();
            let (mut angle, speed, turn) =
                (round as f64, [1e-4, 2e-3, 0.05][round % 3], [1e-4, 0.01][round % 2]);
            let (mut clocks, mut one) = (Clocks::new(1.4), Clock::new(1.4));
            let mut dues: Vec<(bool, Due)> = Vec::new();
            let mut by_one: Vec<u16> = Vec::new();
            for frame in 0..40 {
                let look = DVec3::new(angle.cos(), angle.sin(), -0.1);
                eye += speed * look;
                angle += turn;
                let camera = Camera::looking(eye, look);
                let tau = if frame == 20 { 1.1 } else { 1.0 };
                let cull = [Cull::Frustum, Cull::All, Cull::None][round % 3];
                let lens = [Lens::about(DVec3::ZERO, &camera, &DMat4::IDENTITY, tau, cull).unwrap()];
                let judges = Judges::new(&lens, [1.0, 0.8][round / 12]);
                let (stands, one_stands) = (clocks.go_on(&judges), one.go_on(&judges));
                assert_eq!(stands, one_stands);
                let begun = frame > 0;
                let (mut due, mut looked) = (Vec::new(), Looked::default());
                for (i, e) in entries.iter().enumerate() {
                    if begun && stands && !clocks.sums().have_reached(dues[i].1) {
                        assert_eq!(dues[i].0, judges.keep(e), "round {round}, frame {frame}, {e:?}");
                        stood += 1;
                    } else {
                        due.push(i);
                    }
                }
                // All that are due together, decided as the lens does.
                let asked: Vec<Entry> = due.iter().map(|&i| entries[i]).collect();
                clocks.look(&clocks.last(&judges), &asked, &mut looked);
                dues.resize(entries.len(), (false, Due::NOW));
                assert_eq!(looked.each().count(), due.len());
                for (&i, found) in due.iter().zip(looked.each()) {
                    assert_eq!(found.0, judges.keep(&entries[i]));
                    dues[i] = found;
                }
                looks += due.len();
                for (i, e) in entries.iter().enumerate() {
                    if !begun || !stands || Clock::has_come(one.now(), by_one[i]) {
                        let due = one.due(judges.of_last(e, &one).slack, e.split);
                        if begun {
                            by_one[i] = due
                        } else {
                            by_one.push(due)
                        }
                        looks_by_one += 1;
                    }
                }
            }
        }
        assert!(stood > 100_000 && looks * 5 < looks_by_one * 4, "{stood} {looks} {looks_by_one}");
    }
}
