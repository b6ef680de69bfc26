//! Needed splits that wait to be applied.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Needed splits. In *waves* all that were found are taken in the order of the file before those that they bring: splits that follow each other there are near each other, so what they touch lies close together. Where it matters which come
/// first, the worst is.
#[derive(Debug, Default)]
pub(super) struct Queue {
    by_rank: BinaryHeap<(u16, Reverse<u32>)>,
    /// Of those that are taken, the next last.
    wave: Vec<u32>,
    found: Vec<u32>,
    waves: bool,
}

impl Queue {
    /// Empty; in waves or not.
    pub(super) fn begin(&mut self, waves: bool) {
        self.by_rank.clear();
        self.wave.clear();
        self.found.clear();
        self.waves = waves;
    }

    pub(super) fn in_waves(&self) -> bool {
        self.waves
    }

    pub(super) fn len(&self) -> usize {
        self.by_rank.len() + self.wave.len() + self.found.len()
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        8 * self.by_rank.capacity() + 4 * (self.wave.capacity() + self.found.capacity())
    }

    /// More bytes, and those of what is there until it is copied, that one more split takes; 0 if there is room.
    pub(super) fn growth(&self) -> usize {
        let more = |len: usize, capacity: usize, each: usize| match len < capacity {
            true => 0,
            false => each * (capacity + grown(capacity)),
        };
        match self.waves {
            true => more(self.found.len(), self.found.capacity(), 4),
            false => more(self.by_rank.len(), self.by_rank.capacity(), 8),
        }
    }

    /// For what [`Queue::growth`] says there is room.
    pub(super) fn push(&mut self, rank: u16, split: u32) {
        if self.waves {
            if self.found.len() == self.found.capacity() {
                self.found.reserve_exact(grown(self.found.capacity()));
            }
            return self.found.push(split);
        }
        if self.by_rank.len() == self.by_rank.capacity() {
            self.by_rank.reserve_exact(grown(self.by_rank.capacity()));
        }
        self.by_rank.push((rank, Reverse(split)));
    }

    /// Takes the next; of `rank` only, if that is given, where it is not in waves.
    pub(super) fn pop(&mut self, rank: Option<u16>) -> Option<u32> {
        if !self.waves {
            let &(r, Reverse(split)) = self.by_rank.peek()?;
            if rank.is_some_and(|rank| r != rank) {
                return None;
            }
            self.by_rank.pop();
            return Some(split);
        }
        if self.wave.is_empty() {
            std::mem::swap(&mut self.wave, &mut self.found);
            self.wave.sort_unstable_by_key(|&i| Reverse(i));
        }
        self.wave.pop()
    }

    /// The rank of the next; none in waves.
    pub(super) fn rank(&self) -> Option<u16> {
        self.by_rank.peek().map(|q| q.0)
    }

    /// Some of those that come next.
    pub(super) fn next(&self, count: usize) -> impl Iterator<Item = u32> + '_ {
        let waves = self.wave.iter().rev().chain(&self.found).copied();
        self.by_rank.iter().map(|q| q.1.0).chain(waves).take(count)
    }
}

/// How many more an array of such a capacity is given room for.
fn grown(capacity: usize) -> usize {
    capacity / 2 + 256
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// By rank the worst comes first, of those the first; in waves each in the order of the file. Nothing is lost, and no more is held than was said.
        #[test]
        fn all_come_in_their_order(
            waves: bool,
            found in prop::collection::vec((0u16..5, 0u32..1000, 0usize..3), 0..900),
        ) {
            let mut queue = Queue::default();
            queue.begin(waves);
            let (mut there, mut wave): (Vec<(u16, u32)>, Vec<u32>) = (Vec::new(), Vec::new());
            let mut pops = |queue: &mut Queue, there: &mut Vec<(u16, u32)>| {
                if !waves {
                    let next = there.iter().copied().max_by_key(|&(r, i)| (r, Reverse(i)));
                    assert_eq!(queue.rank(), next.map(|n| n.0));
                    // None of another rank.
                    assert_eq!(queue.pop(Some(9)), None);
                    let own = next.map(|n| n.0);
                    assert_eq!(queue.pop(own), next.map(|n| n.1));
                    next.iter().for_each(|n| _ = there.swap_remove(there.iter().position(|t| t == n).unwrap()));
                } else {
                    if wave.is_empty() {
                        wave.extend(there.drain(..).map(|t| t.1));
                        wave.sort_unstable_by_key(|&i| Reverse(i));
                    }
                    assert_eq!((queue.rank(), queue.pop(None)), (None, wave.pop()));
                }
                assert_eq!(queue.len(), there.len() + wave.len());
            };
            for &(rank, split, taken) in &found {
                let (before, growth) = (queue.bytes(), queue.growth());
                queue.push(rank, split);
                there.push((rank, split));
                assert!(queue.bytes() <= before + growth);
                (0..taken).for_each(|_| pops(&mut queue, &mut there));
            }
            (0..=found.len()).for_each(|_| pops(&mut queue, &mut there));
            assert_eq!((queue.len(), queue.next(9).count()), (0, 0));
        }
    }
}
