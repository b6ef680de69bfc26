//! Where runs of one long list begin, in three quarters of a byte a run.

use std::ops::Range;

/// Ascending numbers, most of them close to those before: in blocks of [`EACH`] runs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Offsets {
    blocks: Vec<Block>,
    /// The beginnings of runs in blocks that have long ones, [`EACH`] and the end of the last.
    long: Vec<[u32; EACH + 1]>,
}

/// Where the first run begins, and the lengths of all, four bits each; or [`LONG`], and which of the long ones it is.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    start: u32,
    /// The lower half first.
    lengths: [u32; 2],
}

const EACH: usize = 16;
/// No list is as long.
const LONG: u32 = u32::MAX;
/// Every second four bits.
const EVEN: u64 = 0x0F0F_0F0F_0F0F_0F0F;

impl Offsets {
    /// The beginning of each run, and the end of the last.
    pub(crate) fn new(starts: &[u32]) -> Offsets {
        let mut o = Offsets::default();
        let runs = starts.len().saturating_sub(1);
        o.blocks.reserve_exact(runs.div_ceil(EACH));
        for from in (0..runs).step_by(EACH) {
            let ends: [u32; EACH + 1] = std::array::from_fn(|k| starts[(from + k).min(runs)]);
            let (mut lengths, mut most) = (0u64, 0);
            for (k, w) in ends.windows(2).enumerate() {
                let length = w[1].wrapping_sub(w[0]);
                most = most.max(length);
                lengths |= u64::from(length & 15) << (4 * k);
            }
            let halves = [lengths as u32, (lengths >> 32) as u32];
            o.blocks.push(match most {
                0..16 => Block { start: ends[0], lengths: halves },
                _ => Block { start: LONG, lengths: [o.long.len() as u32, 0] },
            });
            if most >= 16 {
                o.long.push(ends);
            }
        }
        o.long.shrink_to_fit();
        o
    }

    /// Run `i`.
    #[inline(always)]
    pub(crate) fn run(&self, i: u32) -> Range<usize> {
        let (block, k) = (self.blocks[i as usize / EACH], i as usize % EACH);
        if block.start == LONG {
            let ends = &self.long[block.lengths[0] as usize];
            return ends[k] as usize..ends[k + 1] as usize;
        }
        let lengths = u64::from(block.lengths[1]) << 32 | u64::from(block.lengths[0]);
        // Those before, summed by pairs, and the pairs by a multiplication.
        let before = lengths & ((1 << (4 * k)) - 1);
        let pairs = (before & EVEN) + (before >> 4 & EVEN);
        let start = block.start as usize + (pairs.wrapping_mul(0x0101_0101_0101_0101) >> 56) as usize;
        start..start + (lengths >> (4 * k) & 15) as usize
    }

    /// Reads what tells run `i`.
    #[inline(always)]
    pub(crate) fn fetch(&self, i: u32) -> u32 {
        self.blocks.get(i as usize / EACH).map_or(0, |b| b.start)
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        size_of::<Block>() * self.blocks.capacity() + 4 * (EACH + 1) * self.long.capacity()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_come_back_however_long_the_runs_are() {
        // One run in a hundred is long.
        for (long, bytes) in [(3u32, 0.76), (15, 0.76), (16, 2.0), (90_000, 2.0)] {
            for n in [1000, 1001, 1015, 1, 0] {
                let mut starts = vec![0u32];
                for i in 0..n {
                    starts.push(starts[i as usize] + if i % 100 == 7 { long } else { i % 4 });
                }
                let o = Offsets::new(&starts);
                for (i, w) in (0u32..).zip(starts.windows(2)) {
                    assert_eq!(o.run(i), w[0] as usize..w[1] as usize);
                }
                assert!((o.bytes() as f64) < bytes * starts.len() as f64 + 12.0, "{long}: {}", o.bytes());
            }
        }
        // All as long as can be.
        let o = Offsets::new(&(0..=64).map(|k| 15 * k).collect::<Vec<_>>());
        assert!(
            (0..64).all(|i: u32| o.run(i) == (15 * i as usize..15 * i as usize + 15)) && o.long.is_empty()
        );
        assert_eq!(Offsets::new(&[0]).bytes() + Offsets::new(&[]).bytes(), 0);
    }
}
