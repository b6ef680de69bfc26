//! Heights of vertices, moved within what the samples around allow.

use super::patch::{Patch, Ring};
use super::scan::{Plane, crossings, rows};

impl Patch<'_> {
    /// Moves a vertex up or down to where the energy around it is least, within the tolerance. True if it moved.
    pub(super) fn relax(&mut self, v: u32, ring: &mut Ring, samples: &mut Samples) -> bool {
        if self.vertices[v as usize].locked || !self.rules.free_heights {
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
            let inv = 1.0 / plane.area as f64;
            // Weight of v: 1 at v, 0 on the side across.
            let (wx, wy) = (i64::from(b.y - d.y), i64::from(d.x - b.x));
            rows((at.x, at.y), (b.x, b.y), (d.x, d.y), |y, x0, x1| {
                let (dx, dy) = (i64::from(x0 - at.x), i64::from(y - at.y));
                let mut s = plane.at + plane.dx * dx + plane.dy * dy;
                let mut w = plane.area + wx * dx + wy * dy;
                let first = y as usize * columns + x0 as usize;
                let row = &self.field.h[first..=first + (x1 - x0) as usize];
                samples.error.extend(row.iter().map(|&h| {
                    let e = (s - plane.area * i64::from(h)) as f64 * inv;
                    s += plane.dx;
                    e as f32
                }));
                samples.weight.extend(row.iter().map(|_| {
                    let f = w as f64 * inv;
                    w += wx;
                    f as f32
                }));
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
        self.vertices[v as usize].at.z += d;
        d != 0
    }
}

/// Errors of the samples around a vertex, and by how much of its step each changes.
#[derive(Clone, Debug, Default)]
pub(super) struct Samples {
    error: Vec<f32>,
    weight: Vec<f32>,
}

/// Samples worked on at a time.
const LANES: usize = 8;

impl Samples {
    fn clear(&mut self) {
        self.error.clear();
        self.weight.clear();
    }

    #[inline(always)]
    fn push(&mut self, error: f32, weight: f32) {
        self.error.push(error);
        self.weight.push(weight);
    }

    #[inline(always)]
    fn each(&self, mut f: impl FnMut(&[f32; LANES], &[f32; LANES])) {
        let (e, w) = (self.error.as_chunks::<LANES>().0, self.weight.as_chunks::<LANES>().0);
        for (e, w) in e.iter().zip(w) {
            f(e, w);
        }
    }

    /// The step, in whole quanta, of least energy (the sum of fourth powers) that takes no error beyond the tolerance; 0 if none does.
    fn best_step(&mut self, tolerance: f32) -> i32 {
        while !self.error.len().is_multiple_of(LANES) {
            self.push(0.0, 0.0);
        }
        // f32 has 24 bits: errors, weights and their products are off by less than this.
        let sure = tolerance * (1.0 - 1e-6) - 0.01;
        let mut d = 0.0f32;
        for _ in 0..3 {
            let (mut slope, mut bend) = ([0.0f32; LANES], [0.0f32; LANES]);
            self.each(|e, w| {
                for i in 0..LANES {
                    let r = e[i] + w[i] * d;
                    let q = w[i] * r * r;
                    slope[i] += q * r;
                    bend[i] += q * w[i];
                }
            });
            let bend: f32 = bend.iter().sum();
            if bend <= 0.0 {
                break;
            }
            d -= slope.iter().sum::<f32>() / (3.0 * bend);
        }
        let (mut low, mut high) = ([f32::NEG_INFINITY; LANES], [f32::INFINITY; LANES]);
        self.each(|e, w| {
            for i in 0..LANES {
                // Samples on the sides across do not change.
                let moves = w[i] > 0.0;
                let r = 1.0 / w[i];
                let l = if moves { (-sure - e[i]) * r } else { f32::NEG_INFINITY };
                let h = if moves { (sure - e[i]) * r } else { f32::INFINITY };
                low[i] = if l > low[i] { l } else { low[i] };
                high[i] = if h < high[i] { h } else { high[i] };
            }
        });
        let low = low.into_iter().fold(f32::NEG_INFINITY, f32::max).ceil();
        let high = high.into_iter().fold(f32::INFINITY, f32::min).floor();
        // Not for NaN either.
        if low <= high && d.is_finite() { d.round().clamp(low, high) as i32 } else { 0 }
    }
}
