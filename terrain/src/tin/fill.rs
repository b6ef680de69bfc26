//! How well triangles lie on the samples, and the triangulation of a hole that lies best.

use super::patch::{MOST_CORNERS, Patch};
use super::scan::{Corner, LANES, Misses, Plane, crossings, greatest, rows};

/// Every how many rows an energy that is too great already is noticed.
const LOOK: i32 = 4;

/// In a fixed order.
#[inline(always)]
fn total(sums: [f64; LANES]) -> f64 {
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}

impl Patch<'_> {
    /// Energy of a triangle: the sum over its samples of a power of error over tolerance; `None` where one is beyond the tolerance
    /// or the triangle does not turn to the left.
    #[inline]
    pub(super) fn energy(&self, a: Corner, b: Corner, c: Corner, bound: f64) -> Option<f64> {
        let plane = Plane::new(a, b, c);
        if plane.area <= 0 {
            return None;
        }
        let most = self.rules.tolerance.over(plane.area);
        let scale = self.scale / plane.area as f64;
        let (columns, h) = (self.field.columns as usize, &self.field.h);
        let misses = Misses::new(&plane);
        // Every fourth sample of a row has sums of its own.
        let (mut sums, mut far, mut good) = ([0.0; LANES], [0.0f64; LANES], true);
        let limit = most as f64;
        rows((a.x, a.y), (b.x, b.y), (c.x, c.y), |y, x0, x1| {
            if !good {
                return;
            }
            let mut s = plane.at + plane.dx * i64::from(x0 - a.x) + plane.dy * i64::from(y - a.y);
            let mut at = y as usize * columns + x0 as usize;
            let end = at + (x1 - x0) as usize + 1;
            if let Some(misses) = misses {
                while at < end {
                    let Some(heights) = h[at..].first_chunk::<LANES>() else { break };
                    let e = misses.of(s as f64, heights, end - at);
                    for ((sum, far), e) in sums.iter_mut().zip(&mut far).zip(e) {
                        let r = e * scale;
                        let q = r * r;
                        *sum += q * q;
                        *far = if e > *far { e } else { *far };
                    }
                    s += plane.dx * LANES as i64;
                    at += LANES;
                }
            }
            for (i, &h) in h[at.min(end)..end].iter().enumerate() {
                let e = (s - plane.area * i64::from(h)).abs();
                good &= e <= most;
                let r = e as f64 * scale;
                sums[i % LANES] += (r * r) * (r * r);
                s += plane.dx;
            }
            // Now and then: most triangles have few rows.
            if y % LOOK == 0 {
                good &= greatest(far) <= limit && total(sums) < bound;
            }
        });
        let mut sum = total(sums);
        good &= greatest(far) <= limit && sum < bound;
        if good && self.rules.surface {
            for (p, q) in [(a, b), (b, c), (c, a)] {
                crossings(self.field, p, q, |c| {
                    good &= c.miss.abs() <= self.rules.tolerance.over(c.parts);
                    let r = c.miss as f64 / c.parts as f64 * self.scale;
                    sum += (r * r) * (r * r);
                });
            }
        }
        good.then_some(sum)
    }

    /// The energy of a triangle that is there; remembered until a corner moves.
    pub(super) fn energy_of(&mut self, t: u32) -> f64 {
        let known = self.energies[t as usize];
        if !known.is_nan() {
            return known;
        }
        let [a, b, c] = self.triangles[t as usize];
        let (a, b, c) = (self.corner(a), self.corner(b), self.corner(c));
        let energy = self.energy(a, b, c, f64::INFINITY).unwrap_or(0.0);
        self.energies[t as usize] = energy;
        energy
    }

    /// The triangulation of a hole of least energy, into `out` as indices of the hole's corners; its energy.
    pub(super) fn fill(&self, hole: &[Corner], out: &mut Vec<[u8; 3]>) -> Option<f64> {
        let n = hole.len();
        if !(3..=MOST_CORNERS).contains(&n) {
            return None;
        }
        out.clear();
        let mut best = [[f64::INFINITY; MOST_CORNERS]; MOST_CORNERS];
        let mut apex = [[0u8; MOST_CORNERS]; MOST_CORNERS];
        for i in 0..n - 1 {
            best[i][i + 1] = 0.0;
        }
        for length in 2..n {
            for i in 0..n - length {
                let k = i + length;
                for j in i + 1..k {
                    let below = best[i][j] + best[j][k];
                    if below >= best[i][k] {
                        continue;
                    }
                    if let Some(e) = self.energy(hole[i], hole[j], hole[k], best[i][k] - below)
                        && below + e < best[i][k]
                    {
                        best[i][k] = below + e;
                        apex[i][k] = j as u8;
                    }
                }
            }
        }
        let total = best[0][n - 1];
        if total == f64::INFINITY {
            return None;
        }
        // Half of a cut is looked at before the other: as many wait as there are corners at most.
        let mut waiting = [(0u8, 0u8); MOST_CORNERS];
        waiting[0] = (0, n as u8 - 1);
        let mut left = 1;
        while left > 0 {
            left -= 1;
            let (i, k) = waiting[left];
            if k - i >= 2 {
                let j = apex[i as usize][k as usize];
                out.push([i, j, k]);
                (waiting[left], waiting[left + 1]) = ((i, j), (j, k));
                left += 2;
            }
        }
        Some(total)
    }
}
