//! Where each applied split is, in memory that grows with those applied: linear probing, keys beside the values they lead to.

use crate::aif::NONE;

/// From splits to records. Which split a record is of, the records say themselves: `of` in the calls below. 5 to 7 B a split.
#[derive(Clone, Debug, Default)]
pub(super) struct Index {
    /// Records; [`NONE`] for free places.
    places: Vec<u32>,
    len: usize,
}

/// Five places for four splits at most: a search then looks at three on average.
const FULL: [usize; 2] = [4, 5];
/// Grown to so many for two.
const ROOMY: [usize; 2] = [5, 2];
/// When a frame is over, more than so many for three are too many, and four for three are left.
const SPARE: [usize; 2] = [5, 3];
const LEFT: [usize; 2] = [4, 3];

impl Index {
    #[inline]
    fn home(&self, split: u32) -> usize {
        // Fibonacci hashing: runs of splits are spread evenly.
        let mixed = split.wrapping_mul(0x9e37_79b1) as u64;
        ((mixed * self.places.len() as u64) >> 32) as usize
    }

    #[inline]
    fn next(&self, at: usize) -> usize {
        if at + 1 == self.places.len() { 0 } else { at + 1 }
    }

    /// The place of a split, or the free one that ends the search for it. There is one.
    #[inline]
    fn search(&self, split: u32, of: impl Fn(u32) -> u32) -> usize {
        let mut at = self.home(split);
        while self.places[at] != NONE && of(self.places[at]) != split {
            at = self.next(at);
        }
        at
    }

    /// The record of a split; [`NONE`] if it has none.
    #[inline]
    pub(super) fn find(&self, split: u32, of: impl Fn(u32) -> u32) -> u32 {
        if self.len == 0 { NONE } else { self.places[self.search(split, of)] }
    }

    /// Adds a split that is not there.
    #[inline]
    pub(super) fn insert(&mut self, split: u32, record: u32, of: impl Fn(u32) -> u32) {
        if (self.len + 1) * FULL[1] > self.places.len() * FULL[0] {
            self.grow(&of);
        }
        let at = self.search(split, of);
        self.places[at] = record;
        self.len += 1;
    }

    #[cold]
    fn grow(&mut self, of: &impl Fn(u32) -> u32) {
        self.resize((self.len + 1) * ROOMY[0] / ROOMY[1] + 16, of);
    }

    /// Gives back what it has grown too large.
    pub(super) fn settle(&mut self, of: impl Fn(u32) -> u32) {
        if self.places.len() > self.len * SPARE[0] / SPARE[1] + 64 {
            self.resize(self.len * LEFT[0] / LEFT[1] + 16, &of);
        }
    }

    fn resize(&mut self, size: usize, of: &impl Fn(u32) -> u32) {
        let before = std::mem::replace(&mut self.places, vec![NONE; size]);
        for record in before.into_iter().filter(|&r| r != NONE) {
            let at = self.search(of(record), of);
            self.places[at] = record;
        }
    }

    /// Takes a split out, if it is there.
    #[inline]
    pub(super) fn remove(&mut self, split: u32, of: impl Fn(u32) -> u32) {
        if self.len == 0 {
            return;
        }
        let mut hole = self.search(split, &of);
        if self.places[hole] == NONE {
            return;
        }
        self.len -= 1;
        // What comes after it in the run moves up, unless that is before its home.
        let size = self.places.len();
        // Around the end as well, without dividing.
        let distance = |to: usize, from: usize| if to >= from { to - from } else { to + size - from };
        let mut at = self.next(hole);
        while self.places[at] != NONE {
            let home = self.home(of(self.places[at]));
            if distance(at, home) >= distance(at, hole) {
                self.places[hole] = self.places[at];
                hole = at;
            }
            at = self.next(at);
        }
        self.places[hole] = NONE;
    }

    pub(super) fn bytes(&self) -> usize {
        4 * self.places.capacity()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn it_finds_what_a_map_does() {
        let mut index = Index::default();
        let mut map: HashMap<u32, u32> = HashMap::new();
        let mut made: Vec<u32> = Vec::new();
        let mut state = 7u32;
        for step in 0..40_000u32 {
            state = state.wrapping_mul(1664525).wrapping_add(1013904223);
            // Up, down, and up again; few numbers, so that most are met again.
            let (split, up) = ((state >> 8) % 3000, (step / 10_000) % 2 == 0);
            let of = |r: u32| made[r as usize];
            assert_eq!(index.find(split, of), map.get(&split).copied().unwrap_or(NONE));
            if map.contains_key(&split) && (!up || state.is_multiple_of(3)) {
                index.remove(split, of);
                map.remove(&split);
            } else if !map.contains_key(&split) && (up || state.is_multiple_of(3)) {
                let record = made.len() as u32;
                made.push(split);
                index.insert(split, record, |r| made[r as usize]);
                map.insert(split, record);
            }
        }
        assert!(map.len() > 100 && index.len == map.len());
        for (&split, &record) in &map {
            assert_eq!(index.find(split, |r| made[r as usize]), record);
        }
    }

    #[test]
    fn it_takes_five_to_seven_bytes_a_split() {
        let mut index = Index::default();
        for i in 0..100_000u32 {
            index.insert(i * 3, i, |r| r * 3);
            if i % 777 == 0 {
                index.settle(|r| r * 3);
                assert!((0..=i).step_by(100).all(|k| index.find(k * 3, |r| r * 3) == k));
            }
            if i > 1000 && i % 777 == 0 {
                assert!(
                    (19 * i as usize / 4..7 * i as usize + 256).contains(&index.bytes()),
                    "{i} {}",
                    index.bytes()
                );
            }
        }
    }
}
