//! Arrays that take as few bits as their numbers need.

use std::ops::Range;

/// Numbers of a fixed number of bits each.
#[derive(Clone, Debug, Default)]
pub(crate) struct Packed {
    /// 0 to 64.
    width: u32,
    /// As many bits.
    mask: u64,
    len: usize,
    /// [`SPARE`] more than are needed, so that a word can always be read.
    bytes: Vec<u8>,
}

/// A word and a byte.
const SPARE: usize = 9;
/// The widest numbers that a word holds wherever in its first byte they begin.
const NARROW: u32 = 57;

impl Packed {
    /// `width` bits for each number; what they have above that is lost.
    pub(crate) fn with_width(width: u32, numbers: impl Iterator<Item = u64>) -> Packed {
        debug_assert!(width <= 64);
        let mask = mask(width);
        let mut p = Packed { width, mask, len: 0, bytes: Vec::new() };
        // What is not in bytes yet, and how many bits that are: less than a word.
        let (mut rest, mut bits) = (0u64, 0);
        for x in numbers {
            let x = x & mask;
            rest |= x << bits;
            bits += width;
            if bits >= u64::BITS {
                p.bytes.extend_from_slice(&rest.to_le_bytes());
                bits -= u64::BITS;
                // What of it is left; nothing if it was a whole word.
                rest = x.checked_shr(width - bits).unwrap_or(0);
            }
            p.len += 1;
        }
        p.bytes.extend_from_slice(&rest.to_le_bytes()[..bits.div_ceil(8) as usize]);
        p.bytes.extend([0; SPARE]);
        p.bytes.shrink_to_fit();
        p
    }

    /// As many bits as the largest needs.
    pub(crate) fn of(numbers: &[u32]) -> Packed {
        let most = numbers.iter().copied().max().unwrap_or(0);
        Packed::with_width(32 - most.leading_zeros(), numbers.iter().map(|&x| x.into()))
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Bits of each.
    #[inline]
    pub(crate) fn width(&self) -> u32 {
        self.width
    }

    /// Number `i`; that after the last is 0. Panics, or tells 0, if there is none.
    #[inline(always)]
    pub(crate) fn get(&self, i: usize) -> u64 {
        let bit = i * self.width as usize;
        let (at, shift) = (bit / 8, (bit % 8) as u32);
        let Some(word) = self.bytes[at..].first_chunk() else { return 0 };
        let low = u64::from_le_bytes(*word) >> shift;
        if self.width <= NARROW {
            return low & self.mask;
        }
        (low | u64::from(self.bytes[at + 8]) << 1 << (63 - shift)) & self.mask
    }

    /// Numbers `range`, as one run. Panics later if they are not there.
    #[inline]
    pub(crate) fn run(&self, range: Range<usize>) -> Run<'_> {
        Run { of: self, start: range.start, len: range.len() }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.bytes.capacity()
    }
}

#[inline]
fn mask(width: u32) -> u64 {
    u64::MAX.checked_shr(64 - width).unwrap_or(0)
}

/// Some numbers in a row, below 2^32.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run<'a> {
    of: &'a Packed,
    start: usize,
    len: usize,
}

impl<'a> Run<'a> {
    #[inline]
    pub(crate) fn len(self) -> usize {
        self.len
    }

    /// The `k`-th. Panics, or tells another number, if there are not so many.
    #[inline]
    pub(crate) fn at(self, k: usize) -> u32 {
        debug_assert!(k < self.len);
        self.of.get(self.start + k) as u32
    }

    /// The `k`-th, if there is one.
    #[inline]
    pub(crate) fn get(self, k: usize) -> Option<u32> {
        (k < self.len).then(|| self.at(k))
    }

    #[inline]
    pub(crate) fn first(self) -> Option<u32> {
        self.get(0)
    }

    /// Reads where they begin.
    #[inline(always)]
    pub(crate) fn fetch(self) -> u8 {
        self.of.bytes.get(self.start * self.of.width as usize / 8).copied().unwrap_or(0)
    }

    /// The first `k` of them, or all.
    #[inline]
    pub(crate) fn prefix(self, k: usize) -> Run<'a> {
        Run { len: self.len.min(k), ..self }
    }

    #[inline]
    pub(crate) fn iter(self) -> impl DoubleEndedIterator<Item = u32> + ExactSizeIterator + Clone + use<'a> {
        (0..self.len).map(move |k| self.at(k))
    }

    /// How many of them come before the first of which `before` is false.
    #[inline]
    pub(crate) fn partition_point(self, before: impl Fn(u32) -> bool) -> usize {
        let (mut low, mut high) = (0, self.len);
        while low < high {
            let middle = low + (high - low) / 2;
            if before(self.at(middle)) { low = middle + 1 } else { high = middle }
        }
        low
    }
}

/// Bits, and how many are set before each of them; takes nothing if all are alike.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ranks {
    bits: Vec<u64>,
    /// Of every 64.
    before: Vec<u32>,
    set: u32,
    len: u32,
}

impl Ranks {
    pub(crate) fn new(all: impl Iterator<Item = bool>) -> Ranks {
        let mut r = Ranks::default();
        let (mut word, mut at) = (0u64, 0);
        for bit in all {
            word |= u64::from(bit) << at;
            at += 1;
            if at == u64::BITS {
                r.push(word, at);
                (word, at) = (0, 0);
            }
        }
        if at > 0 {
            r.push(word, at);
        }
        if r.set == 0 || r.set == r.len {
            return Ranks { set: r.set, len: r.len, ..Ranks::default() };
        }
        r.bits.shrink_to_fit();
        r.before.shrink_to_fit();
        r
    }

    fn push(&mut self, word: u64, bits: u32) {
        self.bits.push(word);
        self.before.push(self.set);
        self.set += word.count_ones();
        self.len += bits;
    }

    /// None is set.
    #[inline]
    pub(crate) fn none(&self) -> bool {
        self.set == 0
    }

    /// All are set.
    #[inline]
    pub(crate) fn all(&self) -> bool {
        self.set == self.len
    }

    #[inline]
    pub(crate) fn before(&self, i: u32) -> u32 {
        self.find(i).1
    }

    /// Both [`Ranks::get`] and [`Ranks::before`].
    #[inline(always)]
    pub(crate) fn find(&self, i: u32) -> (bool, u32) {
        let (word, bit) = (i as usize / 64, i % 64);
        match self.bits.get(word) {
            Some(&bits) => (bits >> bit & 1 != 0, self.before[word] + (bits & ((1 << bit) - 1)).count_ones()),
            None => (i < self.set, i.min(self.set)),
        }
    }

    #[inline]
    pub(crate) fn get(&self, i: u32) -> bool {
        self.bits.get(i as usize / 64).map_or(i < self.set, |bits| bits >> (i % 64) & 1 != 0)
    }

    pub(crate) fn bytes(&self) -> usize {
        8 * self.bits.capacity() + 4 * self.before.capacity()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_all_widths_come_back() {
        for width in 0..=64 {
            let n = |i: u64| i.wrapping_mul(0x9E37_79B9_7F4A_7C15) & mask(width);
            let p = Packed::with_width(width, (0..200).map(n));
            assert_eq!(p.len(), 200);
            assert!((0..200).all(|i| p.get(i) == n(i as u64)), "{width}");
            assert!(p.bytes() <= 25 * width as usize + 10 && p.get(200) == 0);
        }
        assert_eq!(mask(0), 0);
    }

    #[test]
    fn runs_are_like_slices() {
        let numbers: Vec<u32> = (0..100).map(|i| 3 * i).collect();
        let p = Packed::of(&numbers);
        assert!(p.bytes() <= 100 * 9 / 8 + 24);
        let (run, slice) = (p.run(20..50), &numbers[20..50]);
        assert!(run.iter().eq(slice.iter().copied()) && run.iter().rev().eq(slice.iter().rev().copied()));
        assert_eq!((run.len(), run.first(), run.get(29), run.get(30)), (30, Some(60), Some(147), None));
        for x in [0, 60, 61, 100, 147, 400] {
            assert_eq!(run.partition_point(|y| y < x), slice.partition_point(|&y| y < x));
        }
        assert_eq!((run.prefix(4).len(), run.prefix(40).len(), p.run(7..7).first()), (4, 30, None));
    }

    #[test]
    fn ranks_count_what_is_set_before() {
        let bits: Vec<bool> = (0..300).map(|i| i % 3 == 0 || i % 7 == 2).collect();
        let r = Ranks::new(bits.iter().copied());
        for i in 0..300 {
            assert_eq!(r.before(i as u32) as usize, bits[..i].iter().filter(|b| **b).count());
            assert_eq!(r.get(i as u32), bits[i]);
            assert_eq!(r.find(i as u32), (bits[i], r.before(i as u32)));
        }
        assert!(!r.none() && !r.all());
        for bit in [false, true] {
            let r = Ranks::new([bit; 70].into_iter());
            assert!((r.none(), r.all(), r.bytes()) == (!bit, bit, 0));
            assert!((0..70).all(|i| r.get(i) == bit && r.before(i) == if bit { i } else { 0 }));
        }
    }
}
