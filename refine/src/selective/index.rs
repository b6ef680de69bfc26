//! Which splits are applied, and where each has its record.

use crate::aif::NONE;

/// A set of splits, and a record of each: 64 splits make a block, and the records of those in the set are a run in one pool, in the order of the splits. So a record is found by
/// counting bits, in two reads. 16 B for 64 splits there are, and 4 to 5 B for one in the set.
#[derive(Clone, Debug)]
pub(super) struct Index {
    blocks: Vec<Block>,
    pool: Vec<u32>,
    /// The first free run of each room; it begins with where the next is, or [`NONE`].
    free: [u32; ROOMS.len()],
    /// What the pool takes if no run is longer than it must be.
    least: usize,
}

#[derive(Clone, Copy, Debug, Default)]
struct Block {
    /// In the set.
    bits: u64,
    /// Where its run begins.
    start: u32,
    /// The length of its run, by its place in [`ROOMS`].
    room: u8,
}

/// Lengths of runs. A third too long at most, a twelfth on average.
const ROOMS: [u8; 17] = [0, 1, 2, 3, 4, 6, 8, 12, 16, 20, 24, 28, 32, 40, 48, 56, 64];
/// The least room for each number of records.
const FIT: [u8; 65] = {
    let (mut fit, mut count, mut room) = ([0; 65], 0, 0);
    while count <= 64 {
        if ROOMS[room as usize] < count as u8 {
            room += 1;
        }
        fit[count] = room;
        count += 1;
    }
    fit
};
/// When a frame is over, the pool may be longer than it must be by a part in 16 and so many.
const SPARE: usize = 64;

impl Block {
    #[inline]
    fn len(self) -> usize {
        self.bits.count_ones() as usize
    }

    /// Where in its run the record of split `i` is, or would be.
    #[inline]
    fn rank(self, i: u32) -> usize {
        (self.bits & ((1 << (i % 64)) - 1)).count_ones() as usize
    }
}

impl Index {
    /// For `n` splits, none of them in the set.
    pub(super) fn new(n: usize) -> Index {
        Index {
            blocks: vec![Block::default(); n.div_ceil(64)],
            pool: Vec::new(),
            free: [NONE; ROOMS.len()],
            least: 0,
        }
    }

    /// Split `i` is in the set.
    #[inline]
    pub(super) fn has(&self, i: u32) -> bool {
        self.blocks[i as usize / 64].bits >> (i % 64) & 1 != 0
    }

    /// The bits of the set, 64 splits a word.
    pub(super) fn words(&self) -> impl Iterator<Item = u64> + '_ {
        self.blocks.iter().map(|b| b.bits)
    }

    /// The record of a split; [`NONE`] if it is not in the set.
    #[inline]
    pub(super) fn find(&self, i: u32) -> u32 {
        let block = self.blocks[i as usize / 64];
        if block.bits >> (i % 64) & 1 == 0 {
            return NONE;
        }
        self.pool[block.start as usize + block.rank(i)]
    }

    /// Adds a split that is not in the set.
    #[inline]
    pub(super) fn insert(&mut self, i: u32, record: u32) {
        let at = i as usize / 64;
        let count = self.blocks[at].len();
        if count == ROOMS[self.blocks[at].room as usize] as usize {
            self.grow(at);
        }
        let block = &mut self.blocks[at];
        let (start, rank) = (block.start as usize, block.rank(i));
        block.bits |= 1 << (i % 64);
        // Mostly the last.
        if rank < count {
            self.pool.copy_within(start + rank..start + count, start + rank + 1);
        }
        self.pool[start + rank] = record;
        self.least += (ROOMS[FIT[count + 1] as usize] - ROOMS[FIT[count] as usize]) as usize;
    }

    /// Takes a split out that is in the set.
    #[inline]
    pub(super) fn remove(&mut self, i: u32) {
        let at = i as usize / 64;
        let block = &mut self.blocks[at];
        let (start, rank, count) = (block.start as usize, block.rank(i), block.len());
        block.bits &= !(1 << (i % 64));
        if rank + 1 < count {
            self.pool.copy_within(start + rank + 1..start + count, start + rank);
        }
        self.least -= (ROOMS[FIT[count] as usize] - ROOMS[FIT[count - 1] as usize]) as usize;
        if count == 1 {
            self.leave(at);
        }
    }

    /// Gives a split that is in the set another record.
    pub(super) fn replace(&mut self, i: u32, record: u32) {
        let block = self.blocks[i as usize / 64];
        self.pool[block.start as usize + block.rank(i)] = record;
    }

    /// Gives the run of a block back.
    fn leave(&mut self, at: usize) {
        let Block { start, room, .. } = self.blocks[at];
        if room > 0 {
            self.pool[start as usize] = std::mem::replace(&mut self.free[room as usize], start);
            self.blocks[at].room = 0;
        }
    }

    /// Moves a block to the next longer run.
    #[cold]
    fn grow(&mut self, at: usize) {
        let Block { start: from, room, .. } = self.blocks[at];
        let (from, count, more) = (from as usize, ROOMS[room as usize] as usize, room as usize + 1);
        let to = match self.free[more] {
            NONE => {
                let end = self.pool.len();
                self.pool.resize(end + ROOMS[more] as usize, NONE);
                end as u32
            }
            run => {
                self.free[more] = self.pool[run as usize];
                run
            }
        };
        self.pool.copy_within(from..from + count, to as usize);
        self.leave(at);
        (self.blocks[at].start, self.blocks[at].room) = (to, more as u8);
    }

    /// Packs the pool anew if it has grown too long.
    pub(super) fn settle(&mut self) {
        if self.pool.len() > self.least + self.least / 16 + SPARE {
            let mut pool = Vec::with_capacity(self.least);
            for block in &mut self.blocks {
                let (from, count) = (block.start as usize, block.len());
                if count == 0 {
                    *block = Block::default();
                    continue;
                }
                (block.start, block.room) = (pool.len() as u32, FIT[count]);
                let end = pool.len() + ROOMS[FIT[count] as usize] as usize;
                pool.extend_from_slice(&self.pool[from..from + count]);
                pool.resize(end, NONE);
            }
            (self.pool, self.free) = (pool, [NONE; ROOMS.len()]);
        } else if self.pool.capacity() > self.pool.len() + self.pool.len() / 32 + SPARE {
            self.pool.shrink_to(self.pool.len() + self.pool.len() / 32 + SPARE);
        }
    }

    /// Bytes that grow with the set, and bytes of what there is of every split.
    pub(super) fn bytes(&self) -> (usize, usize) {
        (4 * self.pool.capacity(), size_of::<Block>() * self.blocks.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn it_finds_what_a_map_does_and_stays_small() {
        let mut index = Index::new(3000);
        let mut map: HashMap<u32, u32> = HashMap::new();
        let mut state = 7u32;
        for step in 0..60_000u32 {
            state = state.wrapping_mul(1664525).wrapping_add(1013904223);
            // Up, down, and up again; few numbers, so that most are met again.
            let (i, up) = ((state >> 8) % 3000, (step / 12_000) % 2 == 0);
            assert_eq!(index.find(i), map.get(&i).copied().unwrap_or(NONE));
            assert_eq!(index.has(i), map.contains_key(&i));
            if map.contains_key(&i) && (!up || state.is_multiple_of(3)) {
                index.remove(i);
                map.remove(&i);
            } else if !map.contains_key(&i) && (up || state.is_multiple_of(3)) {
                index.insert(i, step);
                map.insert(i, step);
            } else if map.contains_key(&i) {
                index.replace(i, !step);
                map.insert(i, !step);
            }
            if step % 777 == 0 {
                index.settle();
                let (own, all) = index.bytes();
                assert!(
                    own <= 4 * (map.len() + map.len() / 3 + map.len() / 16 + 3 * SPARE),
                    "{own} {}",
                    map.len()
                );
                assert_eq!(all, 16 * 47);
            }
        }
        assert!(map.len() > 100);
        assert!((0..3000).all(|i| index.find(i) == map.get(&i).copied().unwrap_or(NONE)));
        let words: u32 = index.words().map(u64::count_ones).sum();
        assert_eq!(words as usize, map.len());
        for i in 0..3000 {
            if map.contains_key(&i) {
                index.remove(i);
            }
        }
        index.settle();
        assert_eq!((index.least, index.pool.len()), (0, 0));
    }

    #[test]
    fn rooms_fit() {
        for (count, &room) in FIT.iter().enumerate() {
            assert!(ROOMS[room as usize] as usize >= count);
            assert!(room == 0 || (ROOMS[room as usize - 1] as usize) < count);
        }
    }

    #[test]
    fn filled_in_order_it_takes_four_to_five_bytes_a_split() {
        for each in [1, 2, 3, 9] {
            let mut index = Index::new(100_000);
            for i in (0..100_000).step_by(each) {
                index.insert(i, i);
            }
            index.settle();
            let splits = 100_000 / each;
            let (own, _) = index.bytes();
            assert!((4 * splits..5 * splits + 4 * SPARE + 512).contains(&own), "{each}: {own} {splits}");
            assert!((0..100_000).step_by(each).all(|i| index.find(i) == i));
        }
    }
}
