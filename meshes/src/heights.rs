//! A fractal landscape as a grid of heights, of any size.

use crate::noise::{SplitMix64, mix};

/// The side of the landscape, in metres.
pub const LANDSCAPE_SIDE: f64 = 30_720.0;

/// Waves along the side in the first octave.
const FIRST: f64 = 3.0;
/// Metres that the first octave rises and falls, about.
const RELIEF: f64 = 1060.0;
/// The height of an octave relative to that of the one before. With it, 2,049 x 2,049 samples take Delatin 0.4 (greedy insertion) 173,048 to
/// 196,485 triangles for an error of 1/150 of their range, over seeds 0 to 11.
const GAIN: f64 = 0.57;
/// Octaves whose sum is the broad shape, which says how rough a place is.
const BROAD: usize = 3;
/// Metres from the bottom to the top of the broad shape, of every landscape: so that roughness relative to the range, and with it
/// the number of triangles a landscape needs, depends little on the seed.
const BROAD_RANGE: f64 = 2000.0;
/// How rough the lowest places are, relative to the highest.
const LEAST_ROUGH: f64 = 0.15;
/// Metres from sea level to the lowest of the broad shape.
const FLOOR: f64 = 300.0;
/// Samples along the side that the range of the broad shape is measured on: 8 a wave.
const MEASURED_ON: usize = 97;

/// Heights of a square landscape in metres, row after row: sums of gradient noise (Perlin 1985), rougher where it is high.
///
/// Octave `k` has 3 * 2^k waves along the side whatever the size, and a height of its own: a larger grid shows the same landscape, with the
/// octaves added that a smaller cannot hold (those of fewer than two samples a wave). The same size and seed give the same bits on every
/// platform.
#[derive(Clone, Debug)]
pub struct Landscape {
    size: usize,
    octaves: Vec<Octave>,
    /// The least of the broad shape, and what makes its range [`BROAD_RANGE`].
    bottom: f64,
    stretch: f64,
    /// What makes the mean roughness 1.
    smoothing: f64,
}

#[derive(Clone, Debug)]
struct Octave {
    seed: u64,
    frequency: f64,
    height: f64,
    /// Keeps the lattices of octaves from lining up.
    shift: [f64; 2],
    /// The lattice row of `slopes[0]`; of `slopes[1]` it is the next.
    row: i64,
    /// Slopes at the points of two lattice rows.
    slopes: [Vec<[f64; 2]>; 2],
    /// Value and slope along x, at each lattice point, for one row of samples.
    line: Vec<[f64; 2]>,
}

/// A smooth step with no slope and no curvature at 0 and 1.
fn ease(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

impl Octave {
    /// The slopes at a row of the lattice.
    fn fill(&mut self, which: usize, row: i64) {
        let points = (self.frequency + self.shift[0]) as i64 + 2;
        let row_seed = mix(self.seed ^ mix(row as u64));
        self.slopes[which].clear();
        self.slopes[which].extend((0..points).map(|column| {
            let bits = mix(row_seed.wrapping_add(column as u64));
            // Uniform in [-1, 1): the upper and the lower half.
            [bits >> 32, bits & 0xffff_ffff].map(|half| half as f64 / (1u64 << 31) as f64 - 1.0)
        }));
    }

    /// Prepares the row at `v`, 0 to 1 along the side.
    fn prepare(&mut self, v: f64) {
        let y = v * self.frequency + self.shift[1];
        let row = y.floor();
        let (above, below) = (y - row, y - row - 1.0);
        let row = row as i64;
        if self.slopes[0].is_empty() || row != self.row {
            if !self.slopes[1].is_empty() && row == self.row + 1 {
                self.slopes.swap(0, 1);
            } else {
                self.fill(0, row);
            }
            self.fill(1, row + 1);
            self.row = row;
        }
        let part = ease(above);
        let [upper, lower] = &self.slopes;
        self.line.clear();
        self.line.extend(upper.iter().zip(lower).map(|(a, b)| {
            let (p, q) = (a[1] * above, b[1] * below);
            [p + part * (q - p), a[0] + part * (b[0] - a[0])]
        }));
    }

    /// The noise at `u` in the row prepared.
    fn at(&self, u: f64) -> f64 {
        let x = u * self.frequency + self.shift[0];
        // Not negative, so that cutting off rounds down.
        let column = x as usize;
        let t = x - column as f64;
        let [a, b] = [self.line[column], self.line[column + 1]];
        let (left, right) = (a[0] + a[1] * t, b[0] + b[1] * (t - 1.0));
        self.height * (left + ease(t) * (right - left))
    }
}

impl Landscape {
    /// A landscape of `size` x `size` samples (at least 2) over [`LANDSCAPE_SIDE`] metres.
    #[must_use]
    pub fn new(size: usize, seed: u64) -> Self {
        let size = size.max(2);
        let mut random = SplitMix64::new(mix(seed ^ 0x7e44_a170));
        let octave = |k: i32| {
            let (seed, shift) = (random.next_u64(), [random.unit(), random.unit()]);
            let scale = (0..k).fold((FIRST, RELIEF), |(f, h), _| (2.0 * f, GAIN * h));
            Octave {
                seed,
                frequency: scale.0,
                height: scale.1,
                shift,
                row: 0,
                slopes: Default::default(),
                line: vec![],
            }
        };
        let most = (size - 1) as f64 / 2.0;
        // The broad shape is there at any size.
        let held = |(k, o): &(usize, Octave)| *k < BROAD || o.frequency <= most;
        let octaves = (0..).map(octave).enumerate().take_while(held).map(|(_, o)| o).collect();
        let mut landscape = Landscape { size, octaves, bottom: 0.0, stretch: 1.0, smoothing: 1.0 };
        landscape.measure();
        landscape
    }

    /// The range of the broad shape.
    fn measure(&mut self) {
        let (mut least, mut greatest, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        let last = (MEASURED_ON - 1) as f64;
        for row in 0..MEASURED_ON {
            let broad = &mut self.octaves[..BROAD];
            broad.iter_mut().for_each(|o| o.prepare(row as f64 / last));
            for column in 0..MEASURED_ON {
                let low: f64 = broad.iter().map(|o| o.at(column as f64 / last)).sum();
                (least, greatest, sum) = (least.min(low), greatest.max(low), sum + low);
            }
        }
        let mean = (sum / (MEASURED_ON * MEASURED_ON) as f64 - least) / (greatest - least);
        (self.bottom, self.stretch) = (least, BROAD_RANGE / (greatest - least));
        self.smoothing = 1.0 / (LEAST_ROUGH + (1.0 - LEAST_ROUGH) * mean);
    }

    /// Samples along a side.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// Writes the heights of a row, from the left. O(samples) for each octave; quickest row after row.
    ///
    /// Columns beyond the side are left as they are; a row beyond it is that of a landscape that goes on.
    pub fn row(&mut self, row: usize, out: &mut [f64]) {
        let last = (self.size - 1) as f64;
        for octave in &mut self.octaves {
            octave.prepare(row as f64 / last);
        }
        let (broad, fine) = self.octaves.split_at(BROAD);
        for (column, out) in out.iter_mut().take(self.size).enumerate() {
            let u = column as f64 / last;
            let low: f64 = broad.iter().map(|o| o.at(u)).sum();
            let low = (low - self.bottom) * self.stretch;
            let rough: f64 = fine.iter().map(|o| o.at(u)).sum();
            // Plains at the bottom, ridges at the top.
            let part = LEAST_ROUGH + (1.0 - LEAST_ROUGH) * low / BROAD_RANGE;
            *out = FLOOR + low + self.smoothing * part * rough;
        }
    }

    /// All heights, row after row.
    #[must_use]
    pub fn heights(mut self) -> Vec<f64> {
        let size = self.size;
        let mut heights = vec![0.0; size * size];
        for (row, line) in heights.chunks_exact_mut(size).enumerate() {
            self.row(row, line);
        }
        heights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_size_shows_the_same_landscape() {
        let (small, large) = (Landscape::new(33, 5).heights(), Landscape::new(129, 5).heights());
        let range = |h: &[f64]| {
            let (least, greatest) = h.iter().fold((f64::MAX, f64::MIN), |(l, g), &v| (l.min(v), g.max(v)));
            greatest - least
        };
        let far = (0..33 * 33).map(|i| (small[i] - large[i % 33 * 4 + i / 33 * 4 * 129]).abs());
        let (most, range) = (far.fold(0.0, f64::max), range(&large));
        // Two octaves more: 24 and 48 waves.
        assert!(most > 0.005 * range && most < 0.1 * range, "{most} of {range}");
        assert!((1500.0..3500.0).contains(&range), "{range}");
    }

    #[test]
    fn an_octave_adds_what_the_law_says_at_any_size() {
        // The mean square of second differences at the finest spacing: octaves of half the wave and GAIN the height.
        let roughness = |size: usize| {
            let h = Landscape::new(size, 1).heights();
            let bend = |i: usize| h[i - 1] + h[i + 1] - 2.0 * h[i];
            let row = |r: usize| (1..size - 1).map(move |c| r * size + c);
            let sum: f64 = (0..size).flat_map(row).map(|i| bend(i).powi(2)).sum();
            (sum / (size * (size - 2)) as f64).sqrt()
        };
        // Sizes that hold exactly one octave more each: 3 * 2^k waves at two samples a wave.
        let steps = [97, 193, 385].map(roughness);
        for pair in steps.windows(2) {
            let ratio = pair[1] / pair[0];
            assert!((ratio / GAIN - 1.0).abs() < 0.1, "{steps:?}");
        }
    }

    #[test]
    fn rows_come_in_any_order_and_bits_are_fixed() {
        let all = Landscape::new(65, 3).heights();
        let mut landscape = Landscape::new(65, 3);
        let mut line = vec![0.0; 65];
        for row in [64, 0, 13, 12, 14, 13] {
            landscape.row(row, &mut line);
            assert_eq!(line, all[row * 65..(row + 1) * 65], "{row}");
        }
        // FNV-1a over the bits: another number means another landscape, on this platform or in this version.
        let bits = all.iter().flat_map(|h| h.to_le_bytes());
        let hash =
            bits.fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
        assert_eq!(hash, 3532607322379653341);
        assert_ne!(all, Landscape::new(65, 4).heights());
        assert!(Landscape::new(0, 1).heights().iter().all(|h| h.is_finite()));
    }
}
