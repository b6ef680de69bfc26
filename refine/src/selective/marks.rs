//! A set of splits, small beside all there are, that is gone through in their order.

/// A bit for each split, and one for each 64 of these that are not all 0: what holds none is passed by, 4,096 at a time.
#[derive(Clone, Debug)]
pub(super) struct Marks {
    bits: Vec<u64>,
    words: Vec<u64>,
}

/// The word of a bit, and the bit.
#[inline(always)]
fn bit(i: usize) -> (usize, u64) {
    (i / 64, 1 << (i % 64))
}

impl Marks {
    /// For `n` splits, none of them in the set.
    pub(super) fn new(n: usize) -> Marks {
        let words = n.div_ceil(64);
        Marks { bits: vec![0; words], words: vec![0; words.div_ceil(64)] }
    }

    #[inline]
    pub(super) fn has(&self, i: u32) -> bool {
        let (word, bit) = bit(i as usize);
        self.bits[word] & bit != 0
    }

    /// Adds a split if `is`: without a branch for it.
    #[inline]
    pub(super) fn add_if(&mut self, i: u32, is: bool) {
        let (word, bit) = bit(i as usize);
        self.bits[word] |= bit * u64::from(is);
        self.words[word / 64] |= u64::from(is) << (word % 64);
    }

    #[inline]
    pub(super) fn remove(&mut self, i: u32) {
        let (word, bit) = bit(i as usize);
        self.bits[word] &= !bit;
        if self.bits[word] == 0 {
            self.words[word / 64] &= !(1 << (word % 64));
        }
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        let of = |(first, &words): (usize, &u64)| {
            ones(words).map(|k| self.bits[first + k as usize].count_ones() as usize).sum::<usize>()
        };
        (0..).step_by(64).zip(&self.words).map(of).sum()
    }

    /// Tells each, the last first; what `tell` adds to the set is to come before what it is told.
    pub(super) fn each_from_last(&mut self, mut tell: impl FnMut(u32, &mut Marks)) {
        for group in (0..self.words.len()).rev() {
            let mut rest = u64::MAX;
            while self.words[group] & rest != 0 {
                let k = 63 - (self.words[group] & rest).leading_zeros();
                rest = (1 << k) - 1;
                let word = 64 * group + k as usize;
                let mut left = u64::MAX;
                while self.bits[word] & left != 0 {
                    let k = 63 - (self.bits[word] & left).leading_zeros();
                    left = (1 << k) - 1;
                    tell(64 * word as u32 + k, self);
                }
            }
        }
    }

    /// Takes 64 splits out of the set, from the first after `from` words on, that holds any: the word, and its bits.
    #[inline]
    pub(super) fn take_word(&mut self, from: usize) -> Option<(usize, u64)> {
        let mut group = from / 64;
        let mut rest = u64::MAX << (from % 64);
        loop {
            let words = self.words.get_mut(group)?;
            if *words & rest != 0 {
                let k = (*words & rest).trailing_zeros() as usize;
                *words &= !(1 << k);
                let word = 64 * group + k;
                return Some((word, std::mem::take(&mut self.bits[word])));
            }
            (group, rest) = (group + 1, u64::MAX);
        }
    }

    pub(super) fn bytes(&self) -> usize {
        8 * (self.bits.capacity() + self.words.capacity())
    }
}

/// The bits of a word.
fn ones(mut word: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        (word != 0).then(|| {
            let k = word.trailing_zeros();
            word &= word - 1;
            k
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn it_holds_what_a_set_holds(
            n in 1u32..30_000,
            steps in prop::collection::vec((any::<prop::sample::Index>(), 0u8..4), 0..300),
        ) {
            let (mut marks, mut set) = (Marks::new(n as usize), BTreeSet::new());
            for (at, what) in &steps {
                let i = at.index(n as usize) as u32;
                match what {
                    0 => {
                        marks.remove(i);
                        set.remove(&i);
                    }
                    1 => marks.add_if(i, false),
                    _ => {
                        marks.add_if(i, true);
                        set.insert(i);
                    }
                }
                prop_assert_eq!(marks.has(i), set.contains(&i));
            }
            prop_assert_eq!(marks.count(), set.len());
            // Those told bring a half of themselves.
            let mut told = Vec::new();
            marks.each_from_last(|i, marks| {
                told.push(i);
                marks.add_if(i / 2, i % 3 == 0 && i > 0);
            });
            let mut all = Vec::new();
            while let Some(i) = set.pop_last() {
                all.push(i);
                if i % 3 == 0 && i > 0 {
                    set.insert(i / 2);
                }
            }
            prop_assert_eq!(&told, &all);
            let (mut taken, mut from) = (Vec::new(), 0);
            while let Some((word, bits)) = marks.take_word(from) {
                taken.extend(ones(bits).map(|k| 64 * word as u32 + k));
                from = word;
            }
            all.reverse();
            prop_assert_eq!(taken, all);
            prop_assert!(marks.bits.iter().chain(&marks.words).all(|&w| w == 0));
        }
    }
}
