//! Random numbers and smooth noise, the same on every platform.

use glam::DVec3;

/// The generator SplitMix64 (Steele, Lea, Flood 2014): small, fast, and fully specified. Not for secrets.
#[derive(Clone, Debug)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// The stream of this seed.
    pub fn new(seed: u64) -> Self {
        SplitMix64(seed)
    }

    /// The next 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [-1, 1).
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// Uniform in `0..n`, with a bias below n / 2^64; 0 when `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.next_u64() as u128 * n as u128) >> 64) as usize
    }

    /// A unit vector, uniform over the sphere.
    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let p = DVec3::new(self.signed(), self.signed(), self.signed());
            let n = p.length_squared();
            if (0.01..=1.0).contains(&n) {
                return p / n.sqrt();
            }
        }
    }

    /// `count` different numbers of `0..n`, ascending (all when there are fewer).
    pub(crate) fn choose(&mut self, n: usize, count: usize) -> Vec<usize> {
        // Selection sampling (Knuth's algorithm S).
        let mut chosen = Vec::with_capacity(count.min(n));
        for i in 0..n {
            let needed = count.saturating_sub(chosen.len());
            if self.below(n - i) < needed {
                chosen.push(i);
            }
        }
        chosen
    }
}

pub(crate) fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Value noise on the integer lattice, in [-1, 1], smooth to the second derivative.
pub(crate) fn noise(seed: u64, p: DVec3) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let ease = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let corner = |dx: i64, dy: i64, dz: i64| {
        let mut h = mix(seed ^ 0x51_7cc1_b727_2202);
        for x in [cell.x as i64 + dx, cell.y as i64 + dy, cell.z as i64 + dz] {
            h = mix(h ^ x as u64).wrapping_add(0x9e37_79b9_7f4a_7c15);
        }
        (h >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let plane = |dz| {
        let near = lerp(corner(0, 0, dz), corner(1, 0, dz), ease.x);
        let far = lerp(corner(0, 1, dz), corner(1, 1, dz), ease.x);
        lerp(near, far, ease.y)
    };
    lerp(plane(0), plane(1), ease.z)
}

/// Octaves of [`noise`], each of twice the frequency and `gain` times the height; within the sum of the heights.
pub(crate) fn fractal(seed: u64, p: DVec3, octaves: u32, gain: f64) -> f64 {
    let (mut sum, mut height, mut at) = (0.0, 1.0, p);
    for k in 0..octaves {
        sum += height * noise(seed.wrapping_add(k as u64), at);
        height *= gain;
        // The shift keeps the octaves' lattices from lining up at the origin.
        at = at * 2.0 + DVec3::new(17.3, -4.7, 9.1);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stream_is_the_published_one() {
        let mut r = SplitMix64::new(1234567);
        assert_eq!(
            [r.next_u64(), r.next_u64(), r.next_u64()],
            [6457827717110365317, 3203168211198807973, 9817491932198370423]
        );
    }

    #[test]
    fn choosing_gives_different_numbers_in_order() {
        let c = SplitMix64::new(3).choose(1000, 100);
        assert_eq!(c.len(), 100);
        assert!(c.windows(2).all(|w| w[0] < w[1]) && c[99] < 1000);
        assert_eq!(SplitMix64::new(3).choose(5, 9), [0, 1, 2, 3, 4]);
    }

    #[test]
    fn noise_is_bounded_and_continuous() {
        let mut r = SplitMix64::new(1);
        for _ in 0..2000 {
            let p = r.direction() * 9.0;
            let (a, b) = (noise(5, p), noise(5, p + DVec3::splat(1e-7)));
            assert!(a.abs() <= 1.0 && (a - b).abs() < 1e-5);
        }
    }
}
