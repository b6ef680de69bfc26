//! Where the vertices of a split are expected.

use super::super::residual::Guess;
use super::Codec;
use super::cuts::Cuts;

impl Codec<'_> {
    /// Where the new vertex of a split is expected.
    #[inline]
    pub(super) fn guess(&self, v: u32, cuts: &Cuts, moves: bool) -> Guess {
        let t = self.walk.vertices[v as usize].place;
        let (mut sum, mut reach, mut normal) = ([0.0; 3], [0.0f64; 3], [0.0; 3]);
        let mut last = [0.0; 3];
        let between = self.between(cuts);
        for part in between {
            for &[x, y, z, _] in part {
                let d = [x, y, z];
                for a in 0..3 {
                    sum[a] += d[a];
                    reach[a] = greater(d[a].abs(), reach[a]);
                }
                normal[0] += last[1] * z - last[2] * y;
                normal[1] += last[2] * x - last[0] * z;
                normal[2] += last[0] * y - last[1] * x;
                last = d;
            }
        }
        let n = (cuts.count + 1) as f64;
        // Where both are placed anew the old place is between them: fitted to bunny, horse and igea.
        let share = if moves { 0.375 / n } else { 1.0 / (n + 1.0) };
        let go = [sum[0] * share, sum[1] * share, sum[2] * share];
        let mut guess = Guess { at: [t[0] + go[0], t[1] + go[1], t[2] + go[2]], reach, ..Guess::default() };
        guess.lay(normal);
        let level = guess.off(go);
        let mut rise = level.abs();
        for part in between {
            for &[x, y, z, _] in part {
                rise = greater((guess.off([x, y, z]) - level).abs(), rise);
            }
        }
        guess.rise = rise;
        guess
    }

    /// What lies around the old vertex, from cut to cut: in two parts, as it may go on behind the ring's last edge.
    #[inline]
    fn between(&self, cuts: &Cuts) -> [&[[f64; 4]]; 2] {
        let all = &self.around[..];
        let end = cuts.first + cuts.count + 1;
        let over = end.saturating_sub(all.len());
        [all.get(cuts.first..end - over).unwrap_or_default(), all.get(..over).unwrap_or_default()]
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

/// The greater of both; `y` where `x` is no number.
#[inline(always)]
fn greater(x: f64, y: f64) -> f64 {
    if x > y { x } else { y }
}
