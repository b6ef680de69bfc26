//! Heights of vertices, moved within what the samples around allow.

use super::patch::{NONE, Patch, Ring};
use super::scan::{Plane, crossings, rows};

impl Patch<'_> {
    /// Moves a vertex up or down to where the energy around it is least, within the tolerance. True if it moved; then `ring` is what lies around it.
    pub(super) fn relax(&mut self, v: u32, ring: &mut Ring, samples: &mut Samples) -> bool {
        let vertex = &self.vertices[v as usize];
        if vertex.locked || vertex.triangle == NONE || !self.rules.free_heights {
            return false;
        }
        self.ring(v, ring);
        samples.clear();
        let columns = self.field.columns as usize;
        let at = self.corner(v);
        for &t in &ring.triangles {
            let i = self.index_of(t, v);
            let c = self.triangles[t as usize];
            let (b, d) = (self.corner(c[(i + 1) % 3]), self.corner(c[(i + 2) % 3]));
            let plane = Plane::new(at, b, d);
            let inverse = 1.0 / plane.area as f64;
            // What a step to the next column changes: the height, and the weight of v, which is 1 at v and 0 on the side across.
            let (wx, wy) = (i64::from(b.y - d.y), i64::from(d.x - b.x));
            let (slope, fall) = (plane.dx as f64 * inverse, wx as f64 * inverse);
            rows((at.x, at.y), (b.x, b.y), (d.x, d.y), |y, x0, x1| {
                let (dx, dy) = (i64::from(x0 - at.x), i64::from(y - at.y));
                let height = (plane.at + plane.dx * dx + plane.dy * dy) as f64 * inverse;
                let weight = (plane.area + wx * dx + wy * dy) as f64 * inverse;
                let first = y as usize * columns + x0 as usize;
                let row = Row { heights: &self.field.h[first..], len: (x1 - x0) as usize + 1 };
                samples.push_row(row, [height, slope], [weight, fall]);
            });
        }
        if self.rules.surface {
            for &u in &ring.vertices {
                crossings(self.field, at, self.corner(u), |c| {
                    let parts = c.parts as f64;
                    samples.push((c.miss as f64 / parts) as f32, ((c.parts - c.part) as f64 / parts) as f32);
                });
            }
        }
        let d = samples.best_step(self.rules.tolerance.quanta() as f32);
        if d == 0 {
            return false;
        }
        self.vertices[v as usize].at.z += d;
        for &t in &ring.triangles {
            self.energies[t as usize] = f64::NAN;
        }
        true
    }
}

/// Errors of the samples around a vertex, and by how much of its step each changes.
#[derive(Clone, Debug, Default)]
pub(super) struct Samples {
    error: Vec<f32>,
    weight: Vec<f32>,
    len: usize,
}

/// A row of samples, up to the end of the grid, and how many of them count.
struct Row<'a> {
    heights: &'a [i32],
    len: usize,
}

/// Fewer than four heights, and nothing.
#[cold]
fn last(heights: &[i32]) -> [i32; FOUR] {
    let mut h = [0; FOUR];
    for (to, &from) in h.iter_mut().zip(heights) {
        *to = from;
    }
    h
}

/// Samples put in at a time, and worked on.
const FOUR: usize = 4;
const LANES: usize = 8;

/// Weights below this are nought, rounded: others are at least one over the doubled area, which takes 33 bits.
const NO_WEIGHT: f32 = 1e-10;

/// Newton's steps towards the least energy.
const STEPS: usize = 3;

impl Samples {
    fn clear(&mut self) {
        self.len = 0;
    }

    /// Room for more samples, and for [`FOUR`] beyond, whose contents do not matter.
    #[inline(always)]
    fn room(&mut self, more: usize) -> usize {
        let first = self.len;
        self.len += more;
        if self.len + FOUR > self.error.len() {
            self.grow();
        }
        first
    }

    fn push(&mut self, error: f32, weight: f32) {
        let at = self.room(1);
        (self.error[at], self.weight[at]) = (error, weight);
    }

    /// The samples of a row; the plane's height and the weight at the first, and what a step changes of each. Four at a time: rows are short, and how
    /// short cannot be foretold.
    #[inline(always)]
    fn push_row(&mut self, row: Row<'_>, [height, slope]: [f64; 2], [weight, fall]: [f64; 2]) {
        let first = self.room(row.len);
        let mut k = 0;
        while k < row.len {
            let (errors, weights) = (&mut self.error[first + k..], &mut self.weight[first + k..]);
            let (Some(e), Some(w)) = (errors.first_chunk_mut::<FOUR>(), weights.first_chunk_mut::<FOUR>())
            else {
                break;
            };
            let h = match row.heights[k..].first_chunk::<FOUR>() {
                Some(h) => *h,
                None => last(&row.heights[k..]),
            };
            let x = k as f64;
            let error = |i: usize| (height + (x + i as f64) * slope - f64::from(h[i])) as f32;
            let share = |i: usize| (weight + (x + i as f64) * fall) as f32;
            *e = [error(0), error(1), error(2), error(3)];
            *w = [share(0), share(1), share(2), share(3)];
            k += FOUR;
        }
    }

    #[cold]
    fn grow(&mut self) {
        let size = 2 * (self.len + LANES);
        self.error.resize(size, 0.0);
        self.weight.resize(size, 0.0);
    }

    /// The step, in whole quanta, of least energy (the sum of fourth powers) that takes no error beyond the tolerance; 0 if none does.
    fn best_step(&mut self, tolerance: f32) -> i32 {
        let (len, whole) = (self.len, self.len.next_multiple_of(LANES));
        self.room(whole - len);
        self.error[len..whole].fill(0.0);
        self.weight[len..whole].fill(0.0);
        let chunks = || {
            let (e, w) =
                (self.error[..whole].as_chunks::<LANES>().0, self.weight[..whole].as_chunks::<LANES>().0);
            e.iter().zip(w)
        };
        // f32 has 24 bits: errors, weights and their products are off by less than this.
        let sure = tolerance * (1.0 - 1e-6) - 0.01;
        let (mut low, mut high) = ([f32::NEG_INFINITY; LANES], [f32::INFINITY; LANES]);
        for (e, w) in chunks() {
            for i in 0..LANES {
                // Samples on the sides across do not change.
                let moves = w[i] > NO_WEIGHT;
                let r = 1.0 / w[i];
                let l = if moves { (-sure - e[i]) * r } else { f32::NEG_INFINITY };
                let h = if moves { (sure - e[i]) * r } else { f32::INFINITY };
                low[i] = if l > low[i] { l } else { low[i] };
                high[i] = if h < high[i] { h } else { high[i] };
            }
        }
        let low = low.into_iter().fold(f32::NEG_INFINITY, f32::max).ceil();
        let high = high.into_iter().fold(f32::INFINITY, f32::min).floor();
        if low > high {
            return 0;
        }
        let mut d = 0.0f32;
        for _ in 0..STEPS {
            let (mut slope, mut bend) = ([0.0f32; LANES], [0.0f32; LANES]);
            for (e, w) in chunks() {
                for i in 0..LANES {
                    let r = e[i] + w[i] * d;
                    let q = w[i] * r * r;
                    slope[i] += q * r;
                    bend[i] += q * w[i];
                }
            }
            let bend = sum(bend);
            if bend <= 0.0 {
                break;
            }
            d -= sum(slope) / (3.0 * bend);
        }
        if d.is_finite() { d.round().clamp(low, high) as i32 } else { 0 }
    }
}

/// In a fixed order.
#[inline(always)]
fn sum(v: [f32; LANES]) -> f32 {
    ((v[0] + v[4]) + (v[1] + v[5])) + ((v[2] + v[6]) + (v[3] + v[7]))
}
