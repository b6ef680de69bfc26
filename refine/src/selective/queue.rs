//! Splits that are needed, while a frame applies them.

/// In which order they are applied.
pub(super) enum Queue {
    /// The most urgent first: where a limit may leave some out.
    Urgent {
        /// By how urgent they are.
        buckets: Vec<Vec<u32>>,
        /// None above it holds any.
        highest: usize,
    },
    /// As they are numbered: where all will be applied. What comes one after the other then lies close together in memory, and mostly what a split depends on has come before it.
    Ascending {
        /// A bit for each; empty before the first.
        bits: Vec<u64>,
        /// The words that can have any.
        words: std::ops::Range<usize>,
        splits: usize,
    },
}

const BUCKETS: usize = 256;

impl Queue {
    /// For a mesh of so many splits.
    pub(super) fn new(by_urgency: bool, splits: usize) -> Queue {
        if by_urgency {
            Queue::Urgent { buckets: vec![Vec::new(); BUCKETS], highest: 0 }
        } else {
            Queue::Ascending { bits: Vec::new(), words: splits..0, splits }
        }
    }

    /// Adds split `i`, whose rank is asked for if it matters. Ascending ones must come after the one that was taken out last.
    #[inline]
    pub(super) fn push(&mut self, i: u32, rank: impl FnOnce() -> u16) {
        match self {
            Queue::Urgent { buckets, highest } => {
                let bucket = usize::from(rank()).min(BUCKETS - 1);
                *highest = bucket.max(*highest);
                buckets[bucket].push(i);
            }
            Queue::Ascending { bits, words, splits } => {
                if bits.is_empty() {
                    *bits = vec![0; splits.div_ceil(64)];
                }
                let word = i as usize / 64;
                bits[word] |= 1 << (i % 64);
                *words = words.start.min(word)..words.end.max(word + 1);
            }
        }
    }

    /// Takes out the next.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<u32> {
        match self {
            Queue::Urgent { buckets, highest } => loop {
                match buckets[*highest].pop() {
                    None if *highest == 0 => return None,
                    None => *highest -= 1,
                    found => return found,
                }
            },
            Queue::Ascending { bits, words, .. } => {
                while words.start < words.end {
                    let word = &mut bits[words.start];
                    if *word != 0 {
                        let i = 64 * words.start as u32 + word.trailing_zeros();
                        *word &= *word - 1;
                        return Some(i);
                    }
                    words.start += 1;
                }
                None
            }
        }
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        match self {
            Queue::Urgent { buckets, .. } => buckets.iter().map(Vec::len).sum(),
            Queue::Ascending { bits, .. } => bits.iter().map(|w| w.count_ones() as usize).sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ascending_ones_come_as_they_are_numbered() {
        let mut q = Queue::new(false, 1000);
        assert_eq!((q.pop(), q.len()), (None, 0));
        [700, 3, 64, 3].into_iter().for_each(|i| q.push(i, || 0));
        assert_eq!(q.len(), 3);
        assert_eq!(q.pop(), Some(3));
        q.push(5, || 0);
        q.push(999, || 0);
        assert_eq!(std::iter::from_fn(|| q.pop()).collect::<Vec<_>>(), [5, 64, 700, 999]);
    }

    #[test]
    fn urgent_ones_come_first() {
        let mut q = Queue::new(true, 1000);
        [(7, 3), (8, 900), (9, 0)].into_iter().for_each(|(i, rank)| q.push(i, || rank));
        assert_eq!((q.pop(), q.len()), (Some(8), 2));
        q.push(1, || 12);
        assert_eq!(std::iter::from_fn(|| q.pop()).collect::<Vec<_>>(), [1, 7, 9]);
    }
}
