//! How well triangles lie on the samples, and the triangulation of a hole that lies best.

use super::patch::{MOST_CORNERS, Patch};
use super::scan::{Corner, Plane, crossings, rows};

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
        let columns = self.field.columns as usize;
        let (mut sum, mut good) = (0.0, true);
        rows((a.x, a.y), (b.x, b.y), (c.x, c.y), |y, x0, x1| {
            if !good {
                return;
            }
            let mut s = plane.at + plane.dx * i64::from(x0 - a.x) + plane.dy * i64::from(y - a.y);
            let first = y as usize * columns + x0 as usize;
            let mut greatest = 0;
            for &h in &self.field.h[first..=first + (x1 - x0) as usize] {
                let e = s - plane.area * i64::from(h);
                greatest = greatest.max(e.abs());
                let r = e as f64 * scale;
                sum += (r * r) * (r * r);
                s += plane.dx;
            }
            good = greatest <= most && sum < bound;
        });
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

    /// The triangulation of a hole of least energy, into `out` as indices of the hole's corners; its energy.
    pub(super) fn fill(&self, hole: &[Corner], out: &mut Vec<[u8; 3]>) -> Option<f64> {
        let n = hole.len();
        if n > MOST_CORNERS {
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
        let mut stack = vec![(0u8, n as u8 - 1)];
        while let Some((i, k)) = stack.pop() {
            if k - i >= 2 {
                let j = apex[i as usize][k as usize];
                out.push([i, j, k]);
                stack.extend([(i, j), (j, k)]);
            }
        }
        Some(total)
    }
}
