//! Where runs of one long list begin, in one to two bytes a run.

use std::ops::Range;

/// Ascending numbers; most are close to those before.
#[derive(Clone, Debug)]
pub(crate) enum Offsets {
    /// Those of every [`NEAR`]th, and what the others are above it.
    Near(Vec<u32>, Vec<u8>),
    /// The same of every [`MIDDLE`]th.
    Middle(Vec<u32>, Vec<u16>),
    /// As they are: where a few runs are very long.
    Far(Vec<u32>),
}

const NEAR: usize = 32;
const MIDDLE: usize = 64;

impl Default for Offsets {
    fn default() -> Self {
        Offsets::Far(vec![0])
    }
}

/// In blocks, if what lies between fits.
fn blocks<T: TryFrom<u32>>(starts: &[u32], each: usize) -> Option<(Vec<u32>, Vec<T>)> {
    let bases = starts.iter().step_by(each).copied().collect();
    let above =
        starts.chunks(each).flat_map(|b| b.iter().map(move |&s| T::try_from(s.wrapping_sub(b[0])).ok()));
    let mut above = above.collect::<Option<Vec<T>>>()?;
    above.shrink_to_fit();
    Some((bases, above))
}

impl Offsets {
    /// The beginning of each run, and the end of the last.
    pub(crate) fn new(starts: Vec<u32>) -> Offsets {
        if let Some((bases, above)) = blocks(&starts, NEAR) {
            Offsets::Near(bases, above)
        } else if let Some((bases, above)) = blocks(&starts, MIDDLE) {
            Offsets::Middle(bases, above)
        } else {
            Offsets::Far(starts)
        }
    }

    /// Run `i`.
    #[inline(always)]
    pub(crate) fn run(&self, i: u32) -> Range<usize> {
        let (i, j) = (i as usize, i as usize + 1);
        match self {
            Offsets::Near(bases, above) => {
                let at = |i: usize| bases[i / NEAR] as usize + above[i] as usize;
                at(i)..at(j)
            }
            Offsets::Middle(bases, above) => {
                let at = |i: usize| bases[i / MIDDLE] as usize + above[i] as usize;
                at(i)..at(j)
            }
            Offsets::Far(starts) => starts[i] as usize..starts[j] as usize,
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Offsets::Near(bases, above) => 4 * bases.len() + above.len(),
            Offsets::Middle(bases, above) => 4 * bases.len() + 2 * above.len(),
            Offsets::Far(starts) => 4 * starts.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_come_back_however_long_the_runs_are() {
        for (long, bytes) in [(3u32, 1.2), (900, 2.2), (90_000, 4.1)] {
            // One run in a hundred is long.
            let mut starts = vec![0u32];
            for i in 0..1000u32 {
                starts.push(starts[i as usize] + if i % 100 == 7 { long } else { i % 4 });
            }
            let o = Offsets::new(starts.clone());
            for (i, w) in (0u32..).zip(starts.windows(2)) {
                assert_eq!(o.run(i), w[0] as usize..w[1] as usize);
            }
            assert!((o.bytes() as f64) < bytes * starts.len() as f64, "{long}: {}", o.bytes());
        }
        assert_eq!(Offsets::new(vec![0]).bytes(), 5);
    }
}
