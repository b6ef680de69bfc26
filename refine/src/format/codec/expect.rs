//! Where the vertices of a split are expected.

use super::super::residual::Guess;
use super::Codec;
use super::cuts::Cuts;

impl Codec<'_> {
    /// Where the new vertex of a split is expected.
    pub(super) fn guess(&self, v: u32, cuts: &Cuts, moves: bool) -> Guess {
        let (ring, vertices) = (&self.ring, &self.walk.vertices);
        let t = vertices[v as usize].place;
        let mut reach = [0.0f64; 3];
        let mut sum = [0.0; 3];
        for k in 0..=cuts.count {
            let p = vertices[ring.far(cuts.first + k) as usize].place;
            for a in 0..3 {
                sum[a] += p[a];
                reach[a] = reach[a].max((p[a] - t[a]).abs());
            }
        }
        let n = (cuts.count + 1) as f64;
        // Where both are placed anew the old place is between them: fitted to bunny, horse and igea.
        let at = if moves {
            std::array::from_fn(|a| 0.375 * (sum[a] / n) + 0.625 * t[a])
        } else {
            std::array::from_fn(|a| (sum[a] + t[a]) / (n + 1.0))
        };
        Guess { at, reach }
    }

    /// Where the old vertex of a split is expected to go: it stays near, drawn to the neighbours that it keeps.
    pub(super) fn guess_moved(&self, v: u32, cuts: &Cuts, guess: &Guess) -> Guess {
        let (ring, vertices) = (&self.ring, &self.walk.vertices);
        let t = vertices[v as usize].place;
        let [l, r] = [cuts.first, cuts.first + cuts.count].map(|k| vertices[ring.far(k) as usize].place);
        let tips: [f64; 3] = std::array::from_fn(|a| 0.5 * (l[a] + r[a]));
        let edges = ring.edges();
        let kept = if ring.closed { edges.saturating_sub(cuts.count + 1) } else { 0 };
        let mut sum = [0.0; 3];
        for k in 1..=kept {
            let mut at = cuts.first + cuts.count + k;
            if at >= 2 * edges {
                at -= edges;
            }
            let p = vertices[ring.far(at) as usize].place;
            (0..3).for_each(|a| sum[a] += p[a]);
        }
        let outer = if kept > 0 { sum.map(|x| x / kept as f64) } else { tips };
        let at = std::array::from_fn(|a| 0.625 * t[a] + 0.25 * outer[a] + 0.125 * tips[a]);
        Guess { at, reach: guess.reach }
    }
}
