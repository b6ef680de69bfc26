//! What the entropy coder learns: adaptive models of decisions, of symbols of sixteen, and of numbers.

/// Bits of precision of a probability.
pub(super) const PRECISION: u32 = 15;
/// All shares together.
pub(super) const TOTAL: u32 = 1 << PRECISION;

/// How probable it is that the next bit is 0, as two estimates, one that learns fast and one that learns slowly; their mean counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bit {
    fast: u16,
    slow: u16,
}

impl Default for Bit {
    fn default() -> Self {
        Bit { fast: 1 << (PRECISION - 1), slow: 1 << (PRECISION - 1) }
    }
}

impl Bit {
    /// Never 0 nor 1: the estimates stay below 1 by what a shift rounds off.
    #[inline]
    pub(super) fn zero(self) -> u32 {
        ((self.fast as u32 + self.slow as u32) >> 1).clamp(32, (1 << PRECISION) - 32)
    }

    #[inline]
    pub(super) fn learn(&mut self, bit: bool) {
        if bit {
            self.fast -= self.fast >> 4;
            self.slow -= self.slow >> 7;
        } else {
            self.fast += ((1 << PRECISION) - self.fast) >> 4;
            self.slow += ((1 << PRECISION) - self.slow) >> 7;
        }
    }
}

/// What is known about numbers of a kind.
#[derive(Clone, Debug)]
pub(super) struct Number {
    pub(super) bits: [Nibble; 5],
    pub(super) second: [Bit; 65],
}

impl Default for Number {
    fn default() -> Self {
        Number { bits: Default::default(), second: [Bit::default(); 65] }
    }
}

/// An adaptive symbol of 16: where the share of each begins, of [`TOTAL`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Nibble {
    start: [i16; 16],
    seen: u8,
}

impl Default for Nibble {
    fn default() -> Self {
        Nibble { start: std::array::from_fn(|i| (i as i16) << (PRECISION - 4)), seen: 0 }
    }
}

impl Nibble {
    /// Start and size of the share of `symbol`.
    #[inline]
    pub(super) fn share(&self, symbol: usize) -> (u32, u32) {
        let start = self.start[symbol & 15] as u32;
        let end = if symbol >= 15 { TOTAL } else { self.start[symbol + 1] as u32 };
        (start, end - start)
    }

    /// The symbol in whose share `slot` lies.
    #[inline(always)]
    pub(super) fn find(&self, slot: u32) -> usize {
        let slot = slot as i16;
        // All at once, as vectors do it.
        let mut below = 0i16;
        for s in &self.start {
            below += (*s <= slot) as i16;
        }
        (below as usize).wrapping_sub(1) & 15
    }

    /// Every start moves towards where it were if only `symbol` came and all others kept a share of 1; fast at first.
    #[inline(always)]
    pub(super) fn learn(&mut self, symbol: usize) {
        let rate = RATES[(self.seen >> 3) as usize & 15];
        self.seen += (self.seen < 8 * RATES.len() as u8 - 1) as u8;
        let goals = &GOALS[symbol & 15];
        for (s, goal) in self.start.iter_mut().zip(goals) {
            *s += (goal - *s) >> rate;
        }
    }
}

/// Where starts move to, by symbol; the first stays 0.
const GOALS: [[i16; 16]; 16] = {
    let mut goals = [[0; 16]; 16];
    let mut k = 0;
    while k < 256 {
        let (symbol, i) = (k / 16, k % 16);
        goals[symbol][i] = if i > symbol { (TOTAL - 16) as i16 + i as i16 } else { i as i16 };
        k += 1;
    }
    goals
};

/// How slowly a [`Nibble`] learns, by how many eights of symbols it has seen.
const RATES: [u8; 16] = [3, 4, 4, 5, 5, 5, 5, 6, 6, 6, 6, 6, 6, 6, 6, 7];
