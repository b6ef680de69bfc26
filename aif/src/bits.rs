//! A flat set of indices.

/// One bit per index.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bits {
    words: Vec<u64>,
    ones: usize,
}

impl Bits {
    /// `n` zero bits.
    pub fn new(n: usize) -> Self {
        Bits { words: vec![0; n.div_ceil(64)], ones: 0 }
    }

    /// Bit `i`; false beyond the end.
    #[inline]
    pub fn get(&self, i: usize) -> bool {
        self.words.get(i >> 6).is_some_and(|w| w >> (i & 63) & 1 == 1)
    }

    /// Sets bit `i`, growing if need be.
    #[inline]
    pub fn set(&mut self, i: usize) {
        if self.words.len() <= i >> 6 {
            self.words.resize((i >> 6) + 1, 0);
        }
        let (w, b) = (&mut self.words[i >> 6], 1u64 << (i & 63));
        self.ones += (*w & b == 0) as usize;
        *w |= b;
    }

    /// Clears bit `i`.
    #[inline]
    pub fn clear(&mut self, i: usize) {
        if let Some(w) = self.words.get_mut(i >> 6) {
            let b = 1u64 << (i & 63);
            self.ones -= (*w & b != 0) as usize;
            *w &= !b;
        }
    }

    /// Clears all bits. O(n / 64), and O(1) when none is set.
    pub fn clear_all(&mut self) {
        if self.ones > 0 {
            self.words.fill(0);
            self.ones = 0;
        }
    }

    /// Number of set bits. O(1).
    pub fn count(&self) -> usize {
        self.ones
    }

    /// The set bits, ascending. O(n / 64) and the bits.
    pub fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.words
            .iter()
            .enumerate()
            .filter(|w| *w.1 != 0)
            .flat_map(|(i, &w)| (0..64).filter(move |b| w >> b & 1 == 1).map(move |b| 64 * i + b))
    }

    /// True if the count is that of the bits, and none is set at `n` or beyond.
    pub(crate) fn is_consistent(&self, n: usize) -> bool {
        let ones: usize = self.words.iter().map(|w| w.count_ones() as usize).sum();
        let top = self.words.iter().rposition(|&w| w != 0);
        let end = top.map_or(0, |i| 64 * i + 64 - self.words[i].leading_zeros() as usize);
        ones == self.ones && end <= n
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        8 * self.words.len()
    }
}

#[cfg(test)]
mod tests {
    use super::Bits;

    #[test]
    fn setting_twice_counts_once() {
        let mut b = Bits::new(10);
        b.set(3);
        b.set(3);
        b.set(200);
        assert_eq!((b.count(), b.get(3), b.get(4), b.get(200), b.get(10_000)), (2, true, false, true, false));
        assert!(b.iter().eq([3, 200]));
        b.clear(3);
        b.clear(3);
        assert_eq!((b.count(), b.get(3)), (1, false));
    }
    #[test]
    fn consistency_is_of_count_and_range() {
        let mut b = Bits::new(100);
        assert!(b.is_consistent(0));
        b.set(64);
        assert!(b.is_consistent(65));
        assert!(!b.is_consistent(64));
        b.ones = 2;
        assert!(!b.is_consistent(65));
    }
}
