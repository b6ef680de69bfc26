//! Points spread evenly over a surface: one in each of `n` pieces of equal area, at random in it.
//!
//! The surface is laid out as a line, triangle after triangle in the order of the hierarchy, each along a Sierpinski curve, which fills it by
//! halving. Equal parts of the line are compact pieces of the surface, so the sample is stratified in both directions, and samples that
//! follow each other are neighbours. Seeded: sample `k` is a function of the surface, `n`, the seed and `k`.

use super::surface::{Surface, double_area};
use crate::parallel;

/// A point of a triangle of the hierarchy: weights of its second and third corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) triangle: u32,
    pub(super) v: f64,
    pub(super) w: f64,
}

/// The line.
pub(super) struct Sampler<'a> {
    surface: &'a Surface,
    /// Where each triangle ends on it.
    ends: Vec<f64>,
    samples: usize,
    seed: u64,
}

impl<'a> Sampler<'a> {
    /// `samples` points of `surface`. If it has no area, every triangle counts alike. O(n).
    pub(super) fn new(surface: &'a Surface, samples: usize, seed: u64) -> Self {
        let mut ends = vec![0.0; surface.triangle_count()];
        parallel::for_chunks(&mut ends, 1 << 13, |first, chunk| {
            chunk.iter_mut().enumerate().for_each(|(i, x)| *x = double_area(surface.corners(first + i)));
        });
        let mut total = 0.0;
        for x in &mut ends {
            total += *x;
            *x = total;
        }
        if total <= 0.0 {
            ends.iter_mut().enumerate().for_each(|(i, x)| *x = (i + 1) as f64);
        }
        Sampler { surface, ends, samples, seed }
    }

    pub(super) fn len(&self) -> usize {
        self.samples
    }

    /// Samples `range`, in order.
    pub(super) fn range(&self, range: std::ops::Range<usize>) -> impl Iterator<Item = Sample> + '_ {
        let last = self.ends.len() - 1;
        let total = self.ends[last];
        let per = total / self.samples as f64;
        let mut t = None;
        let mut face = Face::default();
        range.map(move |k| {
            let bits = mix(self.seed ^ mix(k as u64));
            let more = mix(bits);
            let x = (k as f64 + unit(bits >> 11, 53)) * per;
            let mut at = t.unwrap_or_else(|| self.ends.partition_point(|&e| e <= x).min(last));
            while at < last && self.ends[at] <= x {
                at += 1;
            }
            if t != Some(at) {
                t = Some(at);
                face = self.face(at, per);
            }
            let along = ((x - face.begin) * face.per).clamp(0.0, 1.0 - f64::EPSILON);
            let [v, w] = face.point(along, unit(more >> 32, 32), unit(more & 0xffff_ffff, 32));
            Sample { triangle: at as u32, v, w }
        })
    }

    fn face(&self, t: usize, per: f64) -> Face {
        let begin = if t == 0 { 0.0 } else { self.ends[t - 1] };
        let size = self.ends[t] - begin;
        let [a, b, c] = self.surface.corners(t);
        let (ab, bc, ca) = (a.distance_squared(b), b.distance_squared(c), c.distance_squared(a));
        // The curve runs along the longest side, so that halving it makes compact pieces.
        let [a, b, c] = CORNERS;
        let corners = if bc >= ab && bc >= ca {
            [b, a, c]
        } else if ca >= ab {
            [a, b, c]
        } else {
            [a, c, b]
        };
        // Down to pieces of a quarter of a sample's share.
        let pieces = 4.0 * size / per;
        let halvings = if pieces > 4.0 { pieces.log2().ceil().min(40.0) as u32 } else { 0 };
        Face { begin, per: 1.0 / size, corners, halvings }
    }
}

/// The corners of a triangle as weights.
const CORNERS: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

/// The part of the line that lies in one triangle.
#[derive(Clone, Copy, Default)]
struct Face {
    begin: f64,
    per: f64,
    /// Where the curve begins, its apex, where it ends.
    corners: [[f64; 2]; 3],
    halvings: u32,
}

impl Face {
    /// The point at `t` of the curve, 0..1, then anywhere in its piece by `r` and `s`.
    fn point(&self, mut t: f64, mut r: f64, mut s: f64) -> [f64; 2] {
        let [mut from, mut apex, mut to] = self.corners;
        for _ in 0..self.halvings {
            let middle = [0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])];
            t *= 2.0;
            if t < 1.0 {
                (apex, to) = (middle, apex);
            } else {
                t -= 1.0;
                (from, apex) = (apex, middle);
            }
        }
        if r + s > 1.0 {
            (r, s) = (1.0 - r, 1.0 - s);
        }
        [0, 1].map(|k| from[k] + (apex[k] - from[k]) * r + (to[k] - from[k]) * s)
    }
}

/// SplitMix64.
#[inline]
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// `bits` bits as a number in 0..1.
#[inline]
fn unit(x: u64, bits: i32) -> f64 {
    x as f64 * 2f64.powi(-bits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_of_equal_area_has_one_sample() {
        // Two triangles, areas 1 : 3; of the larger one, the halves by its longest side.
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-3.0, 0.0, 0.0f64]];
        let s = Surface::new(&points[..], &[[0, 1, 2], [0, 2, 3]]).unwrap();
        let n = 4096;
        let all: Vec<Sample> = Sampler::new(&s, n, 7).range(0..n).collect();
        let large = (0..2).find(|&t| s.ids[t] == 1).unwrap() as u32;
        assert_eq!(all.iter().filter(|x| x.triangle == large).count(), n / 4 * 3);
        // The longest side joins corners 1 and 2, so the halves are v > w and v < w.
        let (mut v, mut w) = (0i32, 0i32);
        for x in all.iter().filter(|x| x.triangle == large) {
            assert!(x.v >= 0.0 && x.w >= 0.0 && x.v + x.w <= 1.0 + 1e-12, "{x:?}");
            if x.v > x.w { v += 1 } else { w += 1 }
        }
        assert!((v - w).abs() <= 1, "{v} {w}");
    }

    #[test]
    fn a_sample_is_the_same_wherever_its_chunk_begins() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 1.0, 3.0f64]];
        let s = Surface::new(&points[..], &[[0, 1, 2], [1, 2, 3], [0, 0, 3]]).unwrap();
        let line = Sampler::new(&s, 100, 3);
        let bits = |x: Sample| (x.triangle, x.v.to_bits(), x.w.to_bits());
        let whole: Vec<_> = line.range(0..100).map(bits).collect();
        let parts: Vec<_> = (0..10).flat_map(|c| line.range(10 * c..10 * c + 10)).map(bits).collect();
        assert_eq!(whole, parts);
    }

    #[test]
    fn neighbours_on_the_line_are_neighbours_on_the_surface() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0f64]];
        let s = Surface::new(&points[..], &[[0, 1, 2]]).unwrap();
        let n = 1024;
        let all: Vec<Sample> = Sampler::new(&s, n, 1).range(0..n).collect();
        // A piece has the diameter of sqrt(2 / n) at most; steps go to the next.
        let far = all.windows(2).map(|p| (p[1].v - p[0].v).hypot(p[1].w - p[0].w)).fold(0.0, f64::max);
        assert!(far <= 2.0 * (2.0 / n as f64).sqrt(), "{far}");
    }
}
