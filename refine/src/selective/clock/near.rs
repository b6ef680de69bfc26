//! Clocks for what is near the eye.
//!
//! How far a lens moves is measured at the farthest place that a decision may be about: there turning counts most. Of what is near turning moves little, and a flight close to the ground turns and is near all of the
//! time. So besides the clock for all there are some that measure at shorter distances, each a quarter of the one before: places that are within three quarters of one's reach have their time by it, and as no time
//! is farther ahead than a quarter of the reach, the eye comes no farther away from them than the reach, while they wait. What slack is, and why it is enough, is what it is for all (see [`super`]).

use super::{AHEAD, About, Clock, Judges, Pace, STEPS};
use crate::selective::entry::Entry;

/// Short reaches.
const SHORT: usize = 5;
/// How much shorter each is than the one before; the first is the diagonal.
const STEP: f64 = 0.25;

/// What the eye's way counts by here: these clocks take all of it, as depths and planes are measured from the eye.
const EYE: f64 = 1.0;

/// A clock for all, and some for what is near; for decisions that are looked at one by one.
#[derive(Clone, Debug)]
pub(crate) struct Clocks {
    all: Clock,
    near: [Near; SHORT],
    /// What is near has its time by clocks of its own: of one lens, in perspective.
    apart: bool,
}

#[derive(Clone, Copy, Debug)]
struct Near {
    pace: Pace,
    now: u16,
    /// Since the last frame the lens has moved farther than any time reaches: all is due.
    stale: bool,
}

/// When to look at something again, by which clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Due {
    at: u16,
    /// 0 for that for all.
    by: u8,
}

impl Clocks {
    /// Before the first lens.
    pub(crate) fn new(diagonal: f64) -> Clocks {
        let all = Clock::new(diagonal);
        let near = std::array::from_fn(|k| {
            let pace =
                Pace { about: About::Eye, diagonal: diagonal * STEP.powi(k as i32), eye: EYE, ..all.pace };
            Near { pace, now: 0, stale: true }
        });
        Clocks { all, near, apart: false }
    }

    /// As [`Clock::go_on`].
    pub(crate) fn go_on(&mut self, judges: &Judges<'_>) -> bool {
        let one = |l: &[super::Lens]| matches!(l, [l] if l.perspective);
        self.apart = one(&self.all.lenses) && one(judges.lenses);
        for n in &mut self.near {
            n.pace.per_tau = self.all.pace.per_tau;
            n.stale = true;
            if let ([a], [b]) = (&self.all.lenses[..], judges.lenses) {
                let kept = ((a, self.all.keep * a.tau), (b, judges.keep * b.tau));
                let motion = n.pace.motion((a, a.tau), (b, b.tau));
                let most = motion.zip(n.pace.motion(kept.0, kept.1)).map_or(f64::INFINITY, |(a, b)| a.max(b));
                let steps = (most / n.pace.diagonal * STEPS).ceil();
                // Not the comparison turned round: NaN is no time.
                if steps < AHEAD as f64 {
                    (n.now, n.stale) = (n.now.wrapping_add(steps as u16), false);
                }
            }
        }
        let stands = self.all.go_on(judges);
        self.apart |= !stands && one(judges.lenses);
        self.near.iter_mut().for_each(|n| n.pace.per_tau = self.all.pace.per_tau);
        stands
    }

    /// Now.
    #[inline]
    pub(crate) fn now(&self) -> Due {
        Due { at: self.all.now, by: 0 }
    }

    /// It is time for what is due then.
    #[inline]
    pub(crate) fn has_come(&self, due: Due) -> bool {
        match self.near.get((due.by as usize).wrapping_sub(1)) {
            None => Clock::has_come(self.all.now, due.at),
            Some(n) => n.stale || Clock::has_come(n.now, due.at),
        }
    }

    /// Whether a split is needed, and when that is to be looked at again.
    #[inline]
    pub(crate) fn of_next(&self, judges: &Judges<'_>, e: &Entry) -> (bool, Due) {
        self.of(judges, e, 1.0)
    }

    /// Whether a split is to be kept, and when that is to be looked at again.
    #[inline]
    pub(crate) fn of_last(&self, judges: &Judges<'_>, e: &Entry) -> (bool, Due) {
        self.of(judges, e, judges.keep)
    }

    fn of(&self, judges: &Judges<'_>, e: &Entry, part: f64) -> (bool, Due) {
        let by = match judges.lenses {
            [lens] if self.apart => {
                let away = (e.centre.as_dvec3() - lens.eye).length();
                self.near.iter().rposition(|n| away <= 0.75 * n.pace.diagonal)
            }
            _ => None,
        };
        let Some(mut k) = by else {
            let v = judges.of(e, part, &self.all.pace);
            return (v.wanted, Due { at: self.all.due(v.slack, e.split), by: 0 });
        };
        let v = judges.of(e, part, &self.near[k].pace);
        // By a slower one if its time is far ahead: the slack is as good for it, as it is near for that, too.
        let reach = AHEAD as f64 / STEPS;
        while k > 0 && v.slack > reach * self.near[k].pace.diagonal {
            k -= 1;
        }
        let n = &self.near[k];
        let clock = super::time(n.now, &n.pace, v.slack, e.split);
        (v.wanted, Due { at: clock, by: k as u8 + 1 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hierarchy::{Cone, Packed, pack_up};
    use crate::selective::{Cull, Lens};
    use crate::view::{Camera, CameraParameters, NormalCone, Projection};
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
                let camera = Camera::new(&CameraParameters {
                    eye,
                    target: eye + look,
                    up: DVec3::Z,
                    projection: Projection::Perspective { fov_y_deg: 50.0 },
                    width: 800,
                    height: 600,
                    near: 1e-3,
                    far: 20.0,
                });
                let tau = if frame == 20 { 1.1 } else { 1.0 };
                let cull = [Cull::Frustum, Cull::All, Cull::None][round % 3];
                let lens = [Lens::about(DVec3::ZERO, &camera.unwrap(), &DMat4::IDENTITY, tau, cull).unwrap()];
                let judges = Judges::new(&lens, [1.0, 0.8][round / 12]);
                let (stands, one_stands) = (clocks.go_on(&judges), one.go_on(&judges));
                assert_eq!(stands, one_stands);
                let begun = frame > 0;
                for (i, e) in entries.iter().enumerate() {
                    if begun && stands && !clocks.has_come(dues[i].1) {
                        assert_eq!(dues[i].0, judges.keep(e), "round {round}, frame {frame}, {e:?}");
                        stood += 1;
                    } else {
                        let found = clocks.of_last(&judges, e);
                        assert_eq!(found.0, judges.keep(e));
                        if begun {
                            dues[i] = found
                        } else {
                            dues.push(found)
                        }
                        looks += 1;
                    }
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
