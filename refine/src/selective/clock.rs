//! When to look at what is shown again: what was decided stands until the lens has moved farther than it was from being decided otherwise.
//!
//! Every decision about a split is a comparison of functions of the lens: a depth with the one from which on an error is fine enough, distances from planes, the turn of a
//! cone. How fast these change as a lens moves is bounded. So with a decision comes its *slack*: a distance such that it stands for as long as the lens has moved less. A
//! [`Clock`] adds up how far lenses move from frame to frame, which is never less than how far apart they are; records say at what time they are due. What is not due is not looked at, and a view
//! adapts as if all were.
//!
//! **Distances.** Depth and distances from planes are linear functions f(p) of a place, of unit gradient. From one lens to the next such a function changes at a place p by at most
//! `|f'(o) - f(o)| + |grad f' - grad f| |p - o|`. Seen from outside of the mesh, o is its middle: then circling about it at a large distance is a small motion. From inside, o is the eye: then
//! turning is a small motion for what is near. The clock takes the sum at `|p - o| = reach`; farther places divide their slack by how much farther they are. Distances from the eye and turned cones change by
//! no more than the eye moves.

mod near;

pub(super) use near::Now;
pub(crate) use near::{Clocks, Due, Looked, Paces, Sums};

use super::Lens;
use super::entry::Entry;
use super::lens::turned;
use super::sieve::Sieve;
use crate::hierarchy::CHANGE;

/// Whether a split is needed, and how far lenses may move before that can change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Verdict {
    pub(crate) wanted: bool,
    pub(crate) slack: f64,
}

/// The same, smaller: where there are many.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    pub(super) wanted: bool,
    pub(super) slack: f32,
}

impl From<Verdict> for Found {
    fn from(v: Verdict) -> Found {
        // Rounding is far less than what is [`SAFE`].
        Found { wanted: v.wanted, slack: v.slack as f32 }
    }
}

/// What places are measured from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum About {
    Middle,
    Eye,
    /// The eye, however far: how far places are is looked after apart.
    Each,
}

/// How slack is measured: it must not change while decisions stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pace {
    about: About,
    /// Length of the diagonal of the finest mesh's box.
    pub(super) diagonal: f64,
    /// How much of the clock's distance a change of the tolerance by a factor of e is, if it may change; infinite if not: then any change begins anew.
    pub(super) per_tau: f64,
    /// The part of the eye's way that motions are at least: [`EYE`], or all of it.
    pub(super) eye: f64,
}

/// Adds up how far lenses move.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    lenses: Vec<Lens>,
    /// The part of the tolerance at which splits are undone.
    keep: f64,
    pace: Pace,
    now: u16,
}

/// The most steps ahead that a time can be: half of all, less some.
const AHEAD: u16 = 32_000;
/// The most slack that counts from outside, of a diagonal: then changes of the tolerance are bounded.
const LONGEST: f64 = 0.25;
/// From inside turning is taken at this part of a diagonal: on flights above the ground it then counts about as much as moving does. Of 1/4, 1/8 and 1/16 none is best everywhere: over generated terrain of 4,097 x 4,097 median
/// frames are within a tenth of those with 1/8, over Grand Canyon they take up to an eighth less with 1/4 and up to a fifth more with 1/16.
const NEARBY: f64 = 0.125;
/// The eye's way counts by this: turned cones depend on it, what is seen circling about the mesh hardly. At a distance of a diagonal, both then take up the same.
pub(super) const EYE: f64 = 0.5;
/// Of the slack that is found by the formulas: they are exact, numbers are not.
const SAFE: f64 = 0.999;
/// Cones and spheres are decided about to such a part of the distance.
const ROUNDING: f64 = 1e-7;

/// The most steps ahead that are set for what has this `salt`.
#[inline]
fn most_ahead(salt: u32) -> u16 {
    AHEAD - (salt.wrapping_mul(0x9e37_79b1) >> 18) as u16
}

impl Pace {
    pub(super) fn of(lens: &Lens, diagonal: f64, per_tau: f64) -> Pace {
        let outside = !lens.perspective || lens.eye.length() > 0.5 * diagonal;
        Pace { about: if outside { About::Middle } else { About::Eye }, diagonal, per_tau, eye: EYE }
    }

    /// The distance that motions are taken at.
    fn reach(&self) -> f64 {
        match self.about {
            About::Middle => 0.5 * self.diagonal,
            About::Eye => NEARBY * self.diagonal,
            About::Each => f64::INFINITY,
        }
    }

    /// The most slack that counts.
    fn longest(&self) -> f64 {
        match self.about {
            About::Eye => 0.5 * self.reach(),
            About::Middle | About::Each => LONGEST * self.diagonal,
        }
    }

    /// Steps of the clock to a length.
    fn steps(&self) -> f64 {
        f64::from(AHEAD) / self.longest()
    }

    /// How much less slack counts far away, never more than it does: the larger of 1 and the sum of the first times the distance from the middle, the second times that from the eye, and the third.
    pub(super) fn far_parts(&self) -> [f64; 3] {
        match self.about {
            About::Middle => [1.0 / self.reach(), 0.0, 0.0],
            // The eye comes no farther away than slack counts.
            About::Eye => [0.0, 1.0 / self.reach(), self.longest() / self.reach()],
            About::Each => [0.0; 3],
        }
    }

    /// This pace still fits the lens; changing it takes looking at everything.
    fn fits(&self, lens: &Lens) -> bool {
        let eye = lens.eye.length();
        match self.about {
            About::Middle => !lens.perspective || eye > 0.4 * self.diagonal,
            About::Eye => lens.perspective && eye < 0.6 * self.diagonal,
            About::Each => lens.perspective,
        }
    }

    /// A distance that is at least how much any decision's functions change from `a` to `b`, each at the tolerances given; `None` if there is none.
    pub(super) fn motion(&self, (a, at): (&Lens, f64), (b, bt): (&Lens, f64)) -> Option<f64> {
        let same = a.frustum.is_some() == b.frustum.is_some()
            && (a.back, a.perspective, a.near, a.slant) == (b.back, b.perspective, b.near, b.slant)
            && a.directional == b.directional
            && (a.steep - b.steep).abs() <= 1e-12 * a.steep;
        if !same {
            return None;
        }
        let (a_scale, b_scale) = (a.scale(at), b.scale(bt));
        let finer = (b_scale / bt) / (a_scale / at);
        let by_tau = if (a_scale, at) == (b_scale, bt) { 0.0 } else { finer.ln().abs() * self.per_tau };
        // Of f(p) = n . (p - o) + d.
        let linear = |(n, o, d): (glam::DVec3, glam::DVec3, f64),
                      (n2, o2, d2): (glam::DVec3, glam::DVec3, f64)| {
            let turn = (n2 - n).length() * self.reach();
            let off = if d == d2 { 0.0 } else { d2 - d };
            turn + match self.about {
                About::Middle => (n.dot(o) - n2.dot(o2) + off).abs(),
                About::Eye | About::Each => (o2 - o).length() + off.abs(),
            }
        };
        let mut most = by_tau.max(self.eye * (b.eye - a.eye).length());
        if a.perspective {
            let depth = |l: &Lens| (l.gradient / l.steep, l.eye, 0.0);
            most = most.max(linear(depth(a), depth(b)));
        } else {
            most = most.max((b.look - a.look).length() * self.reach());
        }
        if let (Some(f), Some(g)) = (&a.frustum, &b.frustum) {
            for (p, q) in f.planes().iter().zip(g.planes()) {
                most = most.max(linear((p.normal, f.origin(), p.offset), (q.normal, g.origin(), q.offset)));
            }
        }
        // Not the comparison turned round: NaN is no distance.
        if most < f64::INFINITY { Some(most) } else { None }
    }
}

impl Clock {
    /// Before the first lens.
    pub(crate) fn new(diagonal: f64) -> Clock {
        let pace = Pace { about: About::Middle, diagonal, per_tau: f64::INFINITY, eye: EYE };
        Clock { lenses: Vec::new(), keep: 1.0, pace, now: 0 }
    }

    /// Goes on to the lenses of a frame; false if nothing that was decided stands, and all is due.
    pub(crate) fn go_on(&mut self, judges: &Judges<'_>) -> bool {
        let Judges { lenses, keep } = *judges;
        let steps = self.steps_to(lenses, keep);
        self.keep = keep;
        self.lenses.clear();
        self.lenses.extend_from_slice(lenses);
        if let Some(steps) = steps {
            self.now = self.now.wrapping_add(steps);
            return true;
        }
        if let Some(lens) = lenses.first() {
            self.pace = Pace::of(lens, self.pace.diagonal, self.pace.per_tau);
        }
        false
    }

    fn steps_to(&mut self, lenses: &[Lens], keep: f64) -> Option<u16> {
        if lenses.len() != self.lenses.len() || !self.pace.fits(lenses.first()?) {
            return None;
        }
        let mut most = 0.0f64;
        for (a, b) in self.lenses.iter().zip(lenses) {
            let coarse = (self.keep, keep);
            let (a, b) = ((a, a.tau), (b, b.tau));
            if (a.1, a.0.scale(a.1), coarse.0) != (b.1, b.0.scale(b.1), coarse.1)
                && self.pace.per_tau.is_infinite()
            {
                // From now on such changes are expected.
                self.pace.per_tau = self.pace.diagonal;
                return None;
            }
            let kept = ((a.0, coarse.0 * a.1), (b.0, coarse.1 * b.1));
            most = most.max(self.pace.motion(a, b)?).max(self.pace.motion(kept.0, kept.1)?);
        }
        let steps = (most * self.pace.steps()).ceil();
        (steps < AHEAD as f64).then_some(steps as u16)
    }

    /// What is due now.
    pub(crate) fn now(&self) -> u16 {
        self.now
    }

    /// When a decision that has this slack now is due; what is so late that time does not reach so far comes at times that differ by `salt`, or all would come at once.
    #[inline]
    pub(crate) fn due(&self, slack: f64, salt: u32) -> u16 {
        let most = most_ahead(salt);
        let steps = SAFE * slack * self.pace.steps();
        // NaN is 0.
        self.now.wrapping_add(if steps >= most as f64 { most } else { steps as u16 })
    }

    /// The same of a decision that stands however far lenses move.
    #[inline]
    pub(crate) fn at_last(&self, salt: u32) -> u16 {
        self.now.wrapping_add(most_ahead(salt))
    }

    /// What never is, unless it is made so: it still must be looked at now and then, before the time comes round.
    pub(crate) fn late(&self) -> u16 {
        self.now.wrapping_add(AHEAD)
    }

    /// True if something due at that time is due now.
    #[inline]
    pub(crate) fn has_come(now: u16, due: u16) -> bool {
        due.wrapping_sub(now) as i16 <= 0
    }
}

impl Lens {
    /// [`Lens::wants`], and how far the lens may move before that can change.
    pub(super) fn verdict(&self, e: &Entry, tau: f64, pace: &Pace) -> Verdict {
        let (centre, radius) = (e.centre.as_dvec3(), e.radius as f64);
        let line = centre - self.eye;
        let away = line.length();
        let [middle, eye, more] = pace.far_parts();
        let far = (middle * centre.length() + eye * away + more).max(1.0);
        let mut slack = f64::INFINITY;
        if tau > 0.0 {
            if tau == f64::INFINITY {
                return Verdict { wanted: false, slack };
            }
            let all = self.scale(tau) * e.error as f64 / tau;
            let fine = all * self.counts(e, line, radius);
            // By e^x - 1 <= 1.3 x for what slack counts, 0.25.
            let grows = if pace.per_tau.is_finite() { 1.3 * all / pace.per_tau } else { 0.0 };
            let (grows, until) = match self.directional {
                true => {
                    let (turns, until) = self.turns(line, radius, pace);
                    (grows + all * CHANGE * turns, until)
                }
                false => (grows, f64::INFINITY),
            };
            if self.perspective {
                let along = self.gradient.dot(line) - self.steep * radius;
                let about = self.slant * (away - radius);
                let moves = self.slant / pace.eye + grows;
                let speeds = [self.steep * far + grows, moves, grows, moves];
                let depths = [along, about, self.near, self.floor];
                let above = |k: usize| {
                    let d = depths[k] - fine;
                    if speeds[k] > 0.0 { d / speeds[k] } else { d * f64::INFINITY }
                };
                if depths.iter().any(|&d| d > fine) {
                    let slack = (0..4).filter(|&k| depths[k] > fine).map(above).fold(0.0, f64::max);
                    return Verdict { wanted: false, slack: slack.min(until) };
                }
                let below = (0..4).map(|k| -above(k)).filter(|s| !s.is_nan());
                slack = below.fold(slack, f64::min).min(until);
            } else {
                let by = if grows > 0.0 { (1.0 - fine).abs() / grows } else { f64::INFINITY };
                if 1.0 > fine {
                    return Verdict { wanted: false, slack: by };
                }
                slack = by;
            }
        }
        let (mut unseen, mut slack_unseen) = (false, 0.0f64);
        if self.frustum.is_some() {
            let (mut least, mut beyond) = (f64::INFINITY, 0.0f64);
            for inside in self.sides.distances(centre) {
                if inside < -radius {
                    beyond = beyond.max(-(inside + radius));
                } else {
                    least = least.min(inside + radius);
                }
            }
            if beyond > 0.0 {
                unseen = true;
                slack_unseen = beyond / far;
            }
            slack = slack.min(least / far);
        }
        if self.back {
            let (line, reach, speed) =
                if self.perspective { (line, radius, pace.eye) } else { (self.look, 0.0, pace.reach()) };
            // What looks the other way, or all ways, is as if turned by nothing.
            let above = turned(e, line, reach);
            let sure = |above: f64| (above.abs() - ROUNDING * (line.length() + reach)).max(0.0) * speed;
            match above {
                Some(above) if above >= 0.0 => {
                    unseen = true;
                    slack_unseen = slack_unseen.max(sure(above));
                }
                Some(above) => slack = slack.min(sure(above)),
                None => slack = slack.min(self.slack_of_front(e, line, reach) * speed),
            }
        }
        if unseen { Verdict { wanted: false, slack: slack_unseen } } else { Verdict { wanted: true, slack } }
    }

    /// How fast, by the clock, the angle between an axis and the farthest line of sight to a sphere changes, at most, and for how much of the clock that holds.
    fn turns(&self, line: glam::DVec3, radius: f64, pace: &Pace) -> (f64, f64) {
        if !self.perspective {
            // An angle is at most pi / 2 of its chord.
            return (std::f64::consts::FRAC_PI_2 / pace.reach(), f64::INFINITY);
        }
        // At a distance l the middle's line turns by 1 / l of the eye's way, and the half angle of the sphere, asin(r / l), changes by r / (l sqrt(l^2 - r^2)) of it, across the other: together by 1 / sqrt(l^2 - r^2). While
        // the eye comes no nearer than half way to the sphere, l^2 - r^2 is a quarter of (l - r) (l + 3 r) at least.
        let (l, r) = (line.length(), radius);
        if l > r {
            let turns = 2.0 / ((l - r) * (l + 3.0 * r)).sqrt();
            return (turns / pace.eye, 0.5 * (l - r) * pace.eye);
        }
        // In the sphere all counts.
        (0.0, (r - l) * pace.eye)
    }

    /// How far the line of sight may move before a cone turns its back that looks the other way now, or all ways.
    fn slack_of_front(&self, e: &Entry, line: glam::DVec3, reach: f64) -> f64 {
        // It takes a line along the axis, and one longer than `reach`.
        e.cone.axis().map_or(f64::INFINITY, |axis| reach - line.dot(axis) / axis.length())
    }
}

/// The lenses of a frame, and how they are asked: what one of them needs is needed.
#[derive(Clone, Copy)]
pub(crate) struct Judges<'a> {
    lenses: &'a [Lens],
    /// The part of the tolerance that a split must not exceed to be undone.
    keep: f64,
}

impl<'a> Judges<'a> {
    /// With the hysteresis of [`super::Limits`].
    pub(crate) fn new(lenses: &'a [Lens], hysteresis: f64) -> Self {
        Judges { lenses, keep: hysteresis.clamp(1e-6, 1.0) }
    }

    /// A split is needed.
    #[inline]
    pub(crate) fn want(&self, e: &Entry) -> bool {
        self.lenses.iter().any(|l| l.wants(e, l.tau))
    }

    /// A split that is applied is to be kept.
    #[cfg(test)]
    fn keep(&self, e: &Entry) -> bool {
        self.lenses.iter().any(|l| l.wants(e, self.keep * l.tau))
    }

    /// Whether a split is to be kept, and for how long that stands.
    #[cfg(test)]
    pub(crate) fn of_last(&self, e: &Entry, clock: &Clock) -> Verdict {
        self.of(e, self.keep, &clock.pace)
    }

    fn of(&self, e: &Entry, part: f64, pace: &Pace) -> Verdict {
        let mut all = Verdict { wanted: false, slack: f64::INFINITY };
        for lens in self.lenses {
            let v = lens.verdict(e, part * lens.tau, pace);
            all = match (all.wanted, v.wanted) {
                (false, false) => Verdict { wanted: false, slack: all.slack.min(v.slack) },
                (true, true) => Verdict { wanted: true, slack: all.slack.max(v.slack) },
                (true, false) => all,
                (false, true) => v,
            };
        }
        all
    }

    /// To ask whether each of many splits is needed.
    pub(super) fn next(&self, clock: &Clock) -> Many<'a> {
        self.many(1.0, &clock.pace)
    }

    /// To ask whether each of many splits is to be kept.
    pub(super) fn last(&self, clock: &Clock) -> Many<'a> {
        self.many(self.keep, &clock.pace)
    }

    fn many(&self, part: f64, pace: &Pace) -> Many<'a> {
        let sieve = match self.lenses {
            [lens] => Sieve::new(lens, part * lens.tau, pace),
            _ => None,
        };
        Many { judges: *self, part, pace: *pace, sieve }
    }

    /// How urgent a split is that is needed: eight steps for each factor of two by which its error exceeds the tolerance.
    pub(crate) fn rank(&self, e: &Entry) -> u16 {
        let urgency = match self.lenses {
            // It needs it, so it sees it.
            [lens] => lens.urgency_seen(e),
            lenses => lenses.iter().map(|l| l.urgency(e)).fold(0.0, f64::max),
        };
        // The exponent and three bits of a single: steps within a factor of two are equally long.
        ((urgency.clamp(1.0, 1e30) as f32).to_bits() >> 20) as u16 - (127 << 3)
    }
}

/// Asks about many splits with one tolerance; the answers are those of [`Judges`].
pub(crate) struct Many<'a> {
    judges: Judges<'a>,
    part: f64,
    pace: Pace,
    sieve: Option<Sieve>,
}

impl Many<'_> {
    /// Whether each is needed, or to be kept, and for how long that stands, appended to `out`.
    pub(super) fn look(&self, entries: &[Entry], out: &mut Vec<Found>) {
        match (&self.sieve, self.judges.lenses) {
            (Some(sieve), [lens]) => sieve.look((lens, self.part * lens.tau, &self.pace), entries, out),
            _ => out.extend(entries.iter().map(|e| Found::from(self.judges.of(e, self.part, &self.pace)))),
        }
    }

    /// The same, and when to look again; `other` says it of what is found out one by one.
    fn look_until(
        &self,
        now: Option<Now>,
        entries: &[Entry],
        other: impl Fn(&Entry, Verdict) -> (bool, Due),
        out: &mut Vec<(bool, Due)>,
    ) {
        let one = |e: &Entry| other(e, self.judges.of(e, self.part, &self.pace));
        match (&self.sieve, now) {
            (Some(sieve), Some(now)) => sieve.look_until(&now, entries, one, out),
            _ => out.extend(entries.iter().map(one)),
        }
    }

    /// Whether each is needed, or to be kept, appended to `out`.
    pub(super) fn wanted(&self, entries: &[Entry], out: &mut Vec<bool>) {
        match (&self.sieve, self.judges.lenses) {
            (Some(sieve), [lens]) => sieve.wanted(lens, self.part * lens.tau, entries, out),
            (_, lenses) => {
                out.extend(entries.iter().map(|e| lenses.iter().any(|l| l.wants(e, self.part * l.tau))));
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::hierarchy::{Cone, Direction, Packed};
    use crate::selective::Cull;
    use crate::view::{Camera, CameraParameters, NormalCone, Projection};
    use glam::{DMat4, DVec3};

    pub(in crate::selective) struct Random(pub(in crate::selective) u64);

    impl Random {
        pub(in crate::selective) fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 33) as f64 / (1u64 << 31) as f64
        }

        pub(in crate::selective) fn vector(&mut self) -> DVec3 {
            DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
        }
    }

    pub(in crate::selective) const DIAGONAL: f64 = 2.0;

    /// A camera and a tolerance near another: the moves are about `step`.
    pub(in crate::selective) struct Pose {
        pub(in crate::selective) eye: DVec3,
        pub(in crate::selective) look: DVec3,
        pub(in crate::selective) up: DVec3,
        pub(in crate::selective) tau: f64,
        pub(in crate::selective) directional: bool,
    }

    impl Pose {
        pub(in crate::selective) fn lens(&self, perspective: bool, cull: Cull) -> Lens {
            let projection = if perspective {
                Projection::Perspective { fov_y_deg: 50.0 }
            } else {
                Projection::Orthographic { ortho_height: 1.5 }
            };
            let c = Camera::new(&CameraParameters {
                eye: self.eye,
                target: self.eye + self.look,
                up: self.up,
                projection,
                width: 800,
                height: 600,
                near: 1e-3,
                far: 20.0,
            });
            let placed = DMat4::from_scale(DVec3::splat(1.7));
            let c = c.unwrap();
            let lens = Lens::about(DVec3::ZERO, &c, &placed, self.tau, cull).unwrap();
            // Some know how large the whole mesh is.
            let within = matches!(cull, Cull::All | Cull::Frustum);
            let lens = if within { lens.within(DIAGONAL / 1.7) } else { lens };
            // Some by where they lie to the line of sight, some of these along a line of the world too.
            match (self.directional, cull) {
                (true, Cull::Cone) => lens.directional().upright(&c, DVec3::new(0.6, 0.8, 0.0)),
                (true, _) => lens.directional(),
                _ => lens,
            }
        }

        pub(in crate::selective) fn moved(&self, r: &mut Random, step: f64) -> Pose {
            // At times only a turn, only a step, or around the middle.
            let turn = glam::DQuat::from_scaled_axis(step * r.vector());
            let (eye, look, up) = match (r.unit() * 4.0) as u32 {
                0 => (self.eye, turn * self.look, turn * self.up),
                1 => (self.eye + step * r.vector(), self.look, self.up),
                2 => (turn * self.eye, turn * self.look, turn * self.up),
                _ => (self.eye + step * r.vector(), turn * self.look, turn * self.up),
            };
            let tau = if r.unit() < 0.5 { self.tau } else { self.tau * (step * (r.unit() - 0.5)).exp() };
            Pose { eye, look, up, tau, directional: self.directional }
        }
    }

    pub(in crate::selective) fn entry(r: &mut Random) -> Entry {
        let cone = if r.unit() < 0.2 { NormalCone::ALL } else { NormalCone::new(r.vector(), 1.2 * r.unit()) };
        let radius = DIAGONAL * 0.3 * r.unit().powi(4);
        let error = radius * 0.2 * r.unit().powi(3);
        let pack = crate::hierarchy::pack_up;
        // Some lie a little outside of the box of the finest mesh.
        let packed = Packed { error: pack(error), radius: pack(radius), cone: Cone::around(&cone) };
        let direction = Direction((r.unit() * 65536.0) as u16);
        Entry { direction, ..Entry::new(0, (0.6 * DIAGONAL * r.vector()).as_vec3(), packed) }
    }

    #[test]
    fn what_was_decided_stands_for_as_long_as_the_slack_says() {
        let mut r = Random(5);
        let (mut stood, mut fell, mut wanted) = (0, 0, 0);
        for round in 0..600 {
            let (perspective, directional) = (round % 5 != 0, round >= 300);
            let cull = [Cull::All, Cull::None, Cull::Frustum, Cull::Cone][round % 4];
            let eye = r.vector() * [0.4, 1.0, 3.0][round % 3];
            let look = if r.unit() < 0.7 { 0.3 * r.vector() - eye } else { r.vector() };
            let start = Pose { eye, look, up: r.vector(), tau: 0.2 + 2.0 * r.unit(), directional };
            let first = start.lens(perspective, cull);
            let pace = Pace::of(&first, DIAGONAL / 1.7, DIAGONAL / 1.7);
            let entries: Vec<Entry> = (0..60).map(|_| entry(&mut r)).collect();
            let then: Vec<Verdict> = entries.iter().map(|e| first.verdict(e, first.tau, &pace)).collect();
            for (e, v) in entries.iter().zip(&then) {
                assert_eq!(v.wanted, first.wants(e, first.tau));
                assert!(v.slack >= 0.0, "{v:?}");
                wanted += v.wanted as u32;
            }
            let (mut pose, mut last, mut way) = (start, first, 0.0);
            for _ in 0..6 {
                pose = pose.moved(&mut r, [0.003, 0.03, 0.1][round % 3]);
                let lens = pose.lens(perspective, cull);
                way += pace.motion((&last, last.tau), (&lens, lens.tau)).unwrap();
                if way > pace.longest() {
                    break;
                }
                for (e, v) in entries.iter().zip(&then) {
                    let now = lens.wants(e, lens.tau);
                    if way < v.slack * SAFE {
                        assert_eq!(now, v.wanted, "round {round}: {v:?} after {way}, {e:?}");
                        stood += 1;
                    } else {
                        fell += (now != v.wanted) as u32;
                    }
                }
                last = lens;
            }
        }
        assert!(stood > 40_000 && fell > 400 && wanted > 4000, "{stood} {fell} {wanted}");
    }

    #[test]
    fn times_come_round_without_being_missed() {
        let mut clock = Clock::new(1.0);
        let mut now = 60_000u16;
        clock.now = now;
        let due = clock.due(0.01, 7);
        let steps = (0.01 * SAFE * clock.pace.steps()) as u16;
        assert!(!Clock::has_come(now, due));
        now = now.wrapping_add(steps - 1);
        assert!(!Clock::has_come(now, due));
        now = now.wrapping_add(1);
        assert!(Clock::has_come(now, due) && Clock::has_come(now.wrapping_add(30_000), due));
        clock.now = now;
        assert_eq!((clock.due(f64::INFINITY, 0), clock.due(f64::NAN, 5)), (clock.late(), now));
        assert!((0..100).all(|k| clock.at_last(k) == clock.due(f64::INFINITY, k)));
        let spread: Vec<u16> = (0..100).map(|k| clock.late().wrapping_sub(clock.due(1e9, k))).collect();
        assert!(spread.iter().all(|&s| s < 1 << 14) && spread.iter().any(|&s| s > 1 << 13));
    }

    #[test]
    fn small_moves_take_few_steps_and_other_cameras_begin_anew() {
        let mut clock = Clock::new(DIAGONAL);
        let mut pose =
            Pose { eye: DVec3::Z * 3.0, look: -DVec3::Z, up: DVec3::Y, tau: 1.0, directional: false };
        let all = Cull::All;
        assert!(!clock.go_on(&Judges::new(&[pose.lens(true, all)], 1.0)));
        assert!(clock.go_on(&Judges::new(&[pose.lens(true, all)], 1.0)) && clock.now() == 0);
        pose.eye = glam::DQuat::from_rotation_y(1e-3) * pose.eye;
        pose.look = glam::DQuat::from_rotation_y(1e-3) * pose.look;
        assert!(clock.go_on(&Judges::new(&[pose.lens(true, all)], 1.0)));
        assert!((1..400).contains(&clock.now()), "{}", clock.now());
        // The first change of the tolerance is not foreseen, later ones are.
        pose.tau = 1.01;
        assert!(!clock.go_on(&Judges::new(&[pose.lens(true, all)], 1.0)));
        pose.tau = 1.02;
        assert!(clock.go_on(&Judges::new(&[pose.lens(true, all)], 1.0)));
        assert!(clock.go_on(&Judges::new(&[pose.lens(true, all)], 0.99)));
        // Jumps, other projections, other ways to cull, more lenses, none.
        assert!(!clock.go_on(&Judges::new(&[pose.lens(true, all)], 0.5)));
        assert!(!clock.go_on(&Judges::new(&[pose.lens(false, all)], 0.5)));
        assert!(!clock.go_on(&Judges::new(&[pose.lens(false, Cull::None)], 0.5)));
        let two = [pose.lens(false, all), pose.lens(false, all)];
        assert!(!clock.go_on(&Judges::new(&two, 0.5)) && clock.go_on(&Judges::new(&two, 0.5)));
        assert!(!clock.go_on(&Judges::new(&[], 0.5)));
    }
}
