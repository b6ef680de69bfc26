//! What the entropy coder learns: adaptive models of decisions, of symbols of sixteen, and of numbers.

/// Bits of precision of a probability.
pub(super) const PRECISION: u32 = 15;
/// All shares together.
pub(super) const TOTAL: u32 = 1 << PRECISION;

/// How probable it is that the next bit is 0, of [`TOTAL`]; learned fast at first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bit {
    zero: u16,
    seen: u16,
}

impl Default for Bit {
    fn default() -> Self {
        Bit { zero: 1 << (PRECISION - 1), seen: 0 }
    }
}

/// Where estimates end, by what came.
const ENDS: [i32; 2] = [TOTAL as i32 - 32, 32];

/// So many are counted.
const SEEN: u16 = 126;

/// How slowly a [`Bit`] learns, by how many it has seen: as if it took the mean of them, later of the last 64 or so.
const SLOWNESS: [u8; 128] = {
    let mut rates = [0; 128];
    let mut n = 0;
    while n < rates.len() {
        rates[n] = (n as u32 + 2).ilog2() as u8;
        n += 1;
    }
    rates
};

impl Bit {
    /// Never 0 nor 1, as estimates stay between the [`ENDS`].
    #[inline(always)]
    pub(super) fn zero(self) -> u32 {
        self.zero as u32
    }

    #[inline(always)]
    pub(super) fn learn(&mut self, bit: bool) {
        let rate = SLOWNESS[self.seen as usize & 127];
        self.seen += (self.seen < SEEN) as u16;
        let zero = self.zero as i32;
        self.zero = (zero + ((ENDS[bit as usize] - zero) >> rate)) as u16;
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

/// An adaptive symbol of 16: where the share of each begins, of [`TOTAL`], and where the last ends, which as a number of 16 bits with a sign is below zero.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nibble {
    start: [i16; 17],
    seen: u8,
}

impl Default for Nibble {
    fn default() -> Self {
        Nibble::of(16)
    }
}

impl Nibble {
    /// Mostly one of the first `n` symbols, each as likely as the others; no other can be less likely.
    pub(super) fn of(n: u32) -> Self {
        let n = n.clamp(1, 16);
        let each = (TOTAL - 16) / n;
        let start = |k: u32| if k <= n { k * each + k } else { TOTAL - 16 + k };
        Nibble { start: std::array::from_fn(|k| start(k as u32) as u16 as i16), seen: 0 }
    }

    /// Start and size of the share of `symbol`.
    #[inline(always)]
    pub(super) fn share(&self, symbol: usize) -> (u32, u32) {
        let symbol = symbol & 15;
        let (start, end) = (self.start[symbol] as u32, self.start[symbol + 1] as u16 as u32);
        (start, end - start)
    }

    /// The symbol in whose share `slot` lies.
    #[inline(always)]
    pub(super) fn find(&self, slot: u32) -> usize {
        let slot = slot as i16;
        // The first is 0, so one has begun. Compared at once, and counted: when halving, each step waits for the one before, and bounds take a tenth more time.
        let mut begun = [0; 16];
        for (begun, start) in begun.iter_mut().zip(&self.start) {
            *begun = u8::from(*start <= slot);
        }
        let begun = begun.iter().fold(0u8, |sum, &b| sum.wrapping_add(b));
        usize::from(begun).wrapping_sub(1) & 15
    }

    /// Every start moves towards where it were if only `symbol` came and all others kept a share of 1; fast at first.
    #[inline(always)]
    pub(super) fn learn(&mut self, symbol: usize) {
        let rate = RATES[(self.seen >> 2) as usize & 31];
        self.seen += (self.seen < 4 * RATES.len() as u8 - 1) as u8;
        let goals = &GOALS[symbol & 15];
        for (k, goal) in goals.iter().enumerate() {
            self.start[k] += (goal - self.start[k]) >> rate;
        }
    }
}

/// So many choices are told apart; the last are more.
const CHOICES: usize = 17;

/// One of some, by how many there are: an adaptive symbol for each number.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub(super) near: [Nibble; CHOICES],
    pub(super) far: Number,
}

impl Choice {
    /// Of so many.
    #[inline(always)]
    pub(super) fn of(n: usize) -> usize {
        n.min(CHOICES - 1)
    }
}

impl Default for Choice {
    fn default() -> Self {
        Choice { near: std::array::from_fn(|n| Nibble::of(n as u32)), far: Number::default() }
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

/// How slowly a [`Nibble`] learns, by how many fours of symbols it has seen.
const RATES: [u8; 32] = {
    let mut rates = [0; 32];
    let mut n = 0;
    while n < 32 {
        rates[n] = (n as u32 + 1).ilog2() as u8 + 2;
        n += 1;
    }
    rates
};
