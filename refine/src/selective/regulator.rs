//! A tolerance that follows a budget of faces (Hoppe 1997).

use super::Done;

/// Finds, from frame to frame, the tolerance at which a view has about as many faces as wanted.
///
/// `tau *= (faces / goal) ^ gain` after each frame, but not while the count is within a dead band about the goal, and never beyond its bounds: where the scene has no
/// more to show the tolerance stays at the lower one, so that it need not come back from far (anti-windup).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regulator {
    goal: f64,
    tau: f64,
    bounds: [f64; 2],
}

/// Faces grow about as 1 / tau; less than 1, as a frame shows what the last tolerance brought about only when it has come to rest. From 0.3 to 0.9 all
/// come to rest on a circle about a scan, the lower ones later.
const GAIN: f64 = 0.7;
/// Part of the goal within which nothing is changed.
const DEAD_BAND: f64 = 0.03;
/// The most the tolerance changes from one frame to the next, a factor.
const STEP: f64 = 1.5;

impl Regulator {
    /// For `faces` faces, beginning at `tau` pixels, which is also the least tolerance.
    pub fn new(faces: usize, tau: f64) -> Regulator {
        let least = if tau.is_finite() { tau.max(1e-3) } else { 1.0 };
        // Below its limit, so that there is room for what is needed before the tolerance has followed.
        Regulator { goal: (0.95 * faces as f64).max(1.0), tau: least, bounds: [least, 1e6 * least] }
    }

    /// The tolerance for the next frame, pixels.
    pub fn tau(&self) -> f64 {
        self.tau
    }

    /// Takes note of a frame: how many faces it had, and what it did. One that was cut short would have had more.
    pub fn note(&mut self, faces: usize, done: &Done) {
        // Splits that were needed make two faces each, at least: what they depend on, and what comes after them, is not known.
        let ratio = (faces + 2 * done.refused) as f64 / self.goal;
        if (ratio - 1.0).abs() <= DEAD_BAND && done.complete {
            return;
        }
        let factor = ratio.max(1.0 / 16.0).powf(GAIN).clamp(1.0 / STEP, STEP);
        let factor = if done.complete { factor } else { factor.max(1.02) };
        self.tau = (self.tau * factor).clamp(self.bounds[0], self.bounds[1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a frame does that is to show so many faces, of 20,000 at most; of splits that are refused it meets every tenth.
    fn note(r: &mut Regulator, wanted: f64) {
        let refused = (wanted as usize).saturating_sub(20_000) / 20;
        let done = Done { complete: wanted <= 20_000.0, refused, ..Done::default() };
        r.note((wanted as usize).min(20_000), &done);
    }

    /// A scene that shows `many / tau` faces.
    fn settle(many: f64, frames: usize) -> Regulator {
        let mut r = Regulator::new(20_000, 1.0);
        for _ in 0..frames {
            let wanted = many / r.tau();
            note(&mut r, wanted);
        }
        r
    }

    #[test]
    fn far_above_the_budget_it_hurries() {
        // Told only that frames are not complete it would take over a hundred.
        let faces = 4e5 / settle(4e5, 40).tau();
        assert!(faces <= 20_000.0, "{faces}");
    }

    #[test]
    fn it_settles_below_the_budget_and_near_it() {
        for many in [25_000.0, 1e5, 4e6] {
            let faces = many / settle(many, 400).tau();
            assert!((17_500.0..=20_000.0).contains(&faces), "{many}: {faces}");
            // At rest.
            assert_eq!(settle(many, 400), settle(many, 401));
        }
    }

    #[test]
    fn a_poor_scene_does_not_wind_it_up() {
        let mut r = Regulator::new(20_000, 1.0);
        (0..500).for_each(|_| note(&mut r, 100.0));
        assert_eq!(r.tau(), 1.0);
        (0..60).for_each(|_| {
            let wanted = 60_000.0 / r.tau();
            note(&mut r, wanted);
        });
        assert!(60_000.0 / r.tau() <= 20_000.0);
    }
}
