//! Where the vertices of a split are expected.

use super::super::residual::Guess;
use super::Codec;
use super::cuts::Cuts;

impl Codec<'_> {
    /// Where the new vertex of a split is expected.
    #[inline]
    pub(super) fn guess(&self, v: u32, cuts: &Cuts, moves: bool) -> Guess {
        let (ring, vertices) = (&self.ring, &self.walk.vertices[..]);
        let t = vertices[v as usize].place;
        let (mut sum, mut reach, mut normal) = ([0.0; 3], [0.0f64; 3], [0.0; 3]);
        let mut last = [0.0; 3];
        for k in 0..=cuts.count {
            let p = vertices[ring.far(cuts.first + k) as usize].place;
            let d = [p[0] - t[0], p[1] - t[1], p[2] - t[2]];
            for a in 0..3 {
                sum[a] += p[a];
                reach[a] = reach[a].max(d[a].abs());
            }
            normal[0] += last[1] * d[2] - last[2] * d[1];
            normal[1] += last[2] * d[0] - last[0] * d[2];
            normal[2] += last[0] * d[1] - last[1] * d[0];
            last = d;
        }
        let n = (cuts.count + 1) as f64;
        // Where both are placed anew the old place is between them: fitted to bunny, horse and igea.
        let mut at = [0.0; 3];
        for a in 0..3 {
            at[a] = if moves { 0.375 * (sum[a] / n) + 0.625 * t[a] } else { (sum[a] + t[a]) / (n + 1.0) };
        }
        let mut guess = Guess { at, reach, ..Guess::default() };
        guess.lay(normal);
        let level = guess.off([t[0] - at[0], t[1] - at[1], t[2] - at[2]]);
        guess.rise = level.abs();
        for k in 0..=cuts.count {
            let p = vertices[ring.far(cuts.first + k) as usize].place;
            guess.rise = guess.rise.max(guess.off([p[0] - at[0], p[1] - at[1], p[2] - at[2]]).abs());
        }
        guess
    }

    /// Where the old vertex of a split is expected to go: it stays near, drawn to the neighbours that it keeps.
    pub(super) fn guess_moved(&self, v: u32, cuts: &Cuts, guess: &Guess) -> Guess {
        let (ring, vertices) = (&self.ring, &self.walk.vertices[..]);
        let t = vertices[v as usize].place;
        let [l, r] = [cuts.first, cuts.first + cuts.count].map(|k| vertices[ring.far(k) as usize].place);
        let edges = ring.edges();
        let kept = if ring.closed { edges.saturating_sub(cuts.count + 1) } else { 0 };
        let mut sum = [0.0; 3];
        for k in 1..=kept {
            let mut at = cuts.first + cuts.count + k;
            if at >= 2 * edges {
                at -= edges;
            }
            let p = vertices[ring.far(at) as usize].place;
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
