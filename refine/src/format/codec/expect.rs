//! Where the vertices of a split are expected.

use super::super::residual::Guess;
use super::Codec;
use super::cuts::Cuts;

impl Codec<'_> {
    /// Where the new vertex of a split is expected.
    #[inline]
    pub(super) fn guess(&self, v: u32, cuts: &Cuts, moves: bool) -> Guess {
        let t = self.walk.place(v);
        let run = self.ring.run(cuts.first, cuts.count);
        let (mut sum, mut reach, mut normal) = ([0.0f32; 4], [0.0f32; 4], [0.0f32; 3]);
        let mut last = [0.0f32; 4];
        for e in run {
            let d = e.to;
            for a in 0..4 {
                sum[a] += d[a];
                reach[a] = greater(d[a].abs(), reach[a]);
            }
            normal[0] += last[1] * d[2] - last[2] * d[1];
            normal[1] += last[2] * d[0] - last[0] * d[2];
            normal[2] += last[0] * d[1] - last[1] * d[0];
            last = d;
        }
        let n = (cuts.count + 1) as f32;
        // Where both are placed anew the old place is between them: fitted to bunny, horse and igea.
        let share = if moves { 0.375 / n } else { 1.0 / (n + 1.0) };
        let go = [sum[0] * share, sum[1] * share, sum[2] * share];
        let at = std::array::from_fn(|a| t[a] + go[a] as f64);
        let mut guess = Guess { at, reach: [reach[0], reach[1], reach[2]], ..Guess::default() };
        guess.lay(normal);
        let level = guess.off(go);
        // Both ends and one between.
        let mut rise = level.abs();
        for e in [run.first(), run.get(cuts.count / 2)].into_iter().flatten() {
            let [x, y, z, _] = e.to;
            rise = greater((guess.off([x, y, z]) - level).abs(), rise);
        }
        rise = greater((guess.off([last[0], last[1], last[2]]) - level).abs(), rise);
        guess.rise = rise;
        guess
    }

    /// Where the old vertex of a split is expected to go: it stays near, drawn to the neighbours that it keeps.
    pub(super) fn guess_moved(&self, v: u32, cuts: &Cuts, guess: &Guess) -> Guess {
        let ring = &self.ring;
        let t = self.walk.place(v);
        let [l, r] = [cuts.first, cuts.first + cuts.count].map(|k| self.walk.place(ring.far(k)));
        let edges = ring.edges();
        let kept = if ring.closed { edges.saturating_sub(cuts.count + 1) } else { 0 };
        let mut sum = [0.0; 3];
        for k in 1..=kept {
            let mut at = cuts.first + cuts.count + k;
            if at >= 2 * edges {
                at -= edges;
            }
            let p = self.walk.place(ring.far(at));
            for a in 0..3 {
                sum[a] += p[a];
            }
        }
        let mut at = [0.0; 3];
        for a in 0..3 {
            let tips = 0.5 * (l[a] + r[a]);
            let outer = if kept > 0 { sum[a] / kept as f64 } else { tips };
            at[a] = 0.625 * t[a] + 0.25 * outer + 0.125 * tips;
        }
        Guess { at, ..*guess }
    }
}

/// The greater of both; `y` where `x` is no number.
#[inline(always)]
fn greater(x: f32, y: f32) -> f32 {
    if x > y { x } else { y }
}
