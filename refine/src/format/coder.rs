//! The entropy coder: adaptive decisions, of two and of sixteen, and plain bits beside them.
//!
//! One description of every stream serves both directions: code that is generic over [`Coder`] writes with an [`Encoder`], which returns what
//! it is given, and reads with a [`Decoder`], which ignores what it is given. So the two cannot drift apart.
//!
//! Own code, where zstd is at hand: chunks are small (some 10 KB a stream), and most of their symbols are worth a
//! fraction of a bit in their context (whether a vertex waits, which way a face runs), which a coder of bytes cannot know.

pub(super) use super::models::{Bit, Choice, Nibble, Number};
use super::models::{PRECISION, TOTAL};

/// Writes or reads one stream.
pub(super) trait Coder {
    /// True for a reader.
    const READS: bool;

    /// One decision.
    fn bit(&mut self, p: &mut Bit, bit: bool) -> bool;

    /// One of 16 symbols.
    fn nibble(&mut self, m: &mut Nibble, value: u32) -> u32;

    /// The low `bits` (at most 32) of `value`, as they are.
    fn plain(&mut self, bits: u32, value: u32) -> u32;

    /// True once more was read than is there: what was read last is void.
    fn spent(&self) -> bool;

    /// A symbol of `bits` bits, the high bit first, in a tree of `1 << bits` decisions.
    #[inline]
    fn symbol(&mut self, tree: &mut [Bit], bits: u32, value: u32) -> u32 {
        let mut node = 1;
        for k in (0..bits).rev() {
            let bit = self.bit(&mut tree[node], value >> k & 1 == 1);
            node = node << 1 | bit as usize;
        }
        node as u32 - (1 << bits)
    }

    /// Up to 64 plain bits.
    #[inline(always)]
    fn plain64(&mut self, bits: u32, value: u64) -> u64 {
        if bits <= 32 {
            return self.plain(bits, value as u32) as u64;
        }
        let low = self.plain(32, value as u32) as u64;
        low | (self.plain(bits - 32, (value >> 32) as u32) as u64) << 32
    }

    /// A number of up to 64 bits: how many it has, then (the highest is 1) the next as a decision, the others plain.
    #[inline]
    fn number(&mut self, m: &mut Number, value: u64) -> u64 {
        let bits = self.length(&mut m.bits, 64 - value.leading_zeros()).min(64);
        if bits <= 1 {
            return bits as u64;
        }
        let second = self.bit(&mut m.second[bits as usize], value >> (bits - 2) & 1 == 1) as u64;
        let rest = bits - 2;
        let low = self.plain64(rest, value & low_mask(rest));
        (2 | second) << rest | low
    }

    /// A number below 76: as long as it is not below 15, 15 is taken off it.
    #[inline(always)]
    fn length(&mut self, models: &mut [Nibble; 5], value: u32) -> u32 {
        let [first, others @ ..] = models;
        let part = self.nibble(first, value.min(15));
        if part < 15 { part } else { 15 + self.rest_of_length(others, value.saturating_sub(15)) }
    }

    #[cold]
    fn rest_of_length(&mut self, models: &mut [Nibble; 4], value: u32) -> u32 {
        let mut done = 0;
        for m in models {
            let part = self.nibble(m, value.saturating_sub(done).min(15));
            done += part;
            if part < 15 {
                break;
            }
        }
        done
    }

    /// A number below `n`, if there are two; a reader gets no other.
    #[inline]
    fn choice(&mut self, m: &mut Choice, n: usize, value: usize) -> Option<usize> {
        if n <= 1 {
            return (n == 1).then_some(0);
        }
        let value = match self.nibble(&mut m.near[Choice::of(n)], value.min(15) as u32) {
            15 => usize::try_from(self.number(&mut m.far, (value as u64).saturating_sub(15)))
                .ok()?
                .checked_add(15)?,
            near => near as usize,
        };
        (value < n).then_some(value)
    }

    /// A number with a sign: zigzag, then as [`Coder::number`].
    #[inline]
    fn signed(&mut self, m: &mut Number, value: i64) -> i64 {
        unzigzag(self.number(m, zigzag(value)))
    }
}

#[inline]
pub(super) fn low_mask(bits: u32) -> u64 {
    if bits >= 64 { u64::MAX } else { (1 << bits) - 1 }
}

#[inline]
pub(super) fn zigzag(x: i64) -> u64 {
    (x << 1 ^ x >> 63) as u64
}

#[inline]
pub(super) fn unzigzag(x: u64) -> i64 {
    (x >> 1) as i64 ^ -((x & 1) as i64)
}

/// Writes by range asymmetric numeral systems (Duda 2013): decisions are kept as they come, and coded backwards at the end.
#[derive(Clone, Debug, Default)]
pub(super) struct Encoder {
    /// Start and size of the share of every decision.
    shares: Vec<(u16, u16)>,
    window: u64,
    filled: u32,
    plain: Vec<u8>,
    /// Words of decisions, while the stream is put together.
    words: Vec<u16>,
}

/// What to multiply by instead of dividing by `size`: this division does not wait for the state, as the next one does for it.
#[inline(always)]
fn inverse(size: u32) -> u64 {
    // Too much by some 2^-40 of it, which no quotient of 32 bits notices.
    const MORE: f64 = (1u64 << 62) as f64 * (1.0 + 1.0 / (1u64 << 40) as f64);
    (MORE / size as f64) as i64 as u64
}

/// `x` divided by what `inverse` is that of, for what is below 2^15.
#[inline(always)]
fn quotient(x: u32, inverse: u64) -> u32 {
    ((((x as u64) << 2) as u128 * inverse as u128) >> 64) as u32
}

/// The least state between decisions; words of 16 bits keep it below 2^32.
const LEAST: u32 = 1 << 16;

impl Encoder {
    /// Appends the stream to `out`: the length of the decisions as a varint, decisions, plain bits. Then another one can be written, in the same memory.
    pub(super) fn finish(&mut self, out: &mut Vec<u8>) {
        // A word is put down after each decision, and overwritten if it was not needed: a branch would mostly be foretold wrongly.
        let words = &mut self.words;
        words.resize(words.len().max(self.shares.len() + 3), 0);
        let (mut state, mut n) = (LEAST, 0);
        for &(start, size) in self.shares.iter().rev() {
            let size = (size as u32).max(1);
            let inverse = inverse(size);
            if let Some(word) = words.get_mut(n) {
                *word = state as u16;
            }
            let full = state >> (32 - PRECISION) >= size;
            n += full as usize;
            let small = if full { state >> 16 } else { state };
            let times = quotient(small, inverse);
            // The quotient's part and the rest.
            state = small + start as u32 + times * (TOTAL - size);
        }
        if !self.shares.is_empty() {
            // There is room for three more.
            for half in [state as u16, (state >> 16) as u16] {
                if let Some(word) = words.get_mut(n) {
                    *word = half;
                }
                n += 1;
            }
        }
        let words = words.get(..n).unwrap_or_default();
        put_varint(out, 2 * words.len() as u64);
        words.iter().rev().for_each(|w| out.extend_from_slice(&w.to_le_bytes()));
        while self.filled > 0 {
            self.plain.push(self.window as u8);
            self.window >>= 8;
            self.filled = self.filled.saturating_sub(8);
        }
        out.extend_from_slice(&self.plain);
        self.shares.clear();
        self.plain.clear();
        (self.window, self.filled) = (0, 0);
    }
}

impl Coder for Encoder {
    const READS: bool = false;

    #[inline]
    fn bit(&mut self, p: &mut Bit, bit: bool) -> bool {
        let zero = p.zero();
        self.shares.push(if bit { (zero as u16, (TOTAL - zero) as u16) } else { (0, zero as u16) });
        p.learn(bit);
        bit
    }

    #[inline]
    fn nibble(&mut self, m: &mut Nibble, value: u32) -> u32 {
        let (start, size) = m.share(value as usize);
        self.shares.push((start as u16, size as u16));
        m.learn(value as usize);
        value
    }

    #[inline]
    fn plain(&mut self, bits: u32, value: u32) -> u32 {
        self.window |= (value as u64 & low_mask(bits)) << self.filled;
        self.filled += bits;
        if self.filled >= 32 {
            self.plain.extend_from_slice(&(self.window as u32).to_le_bytes());
            self.window >>= 32;
            self.filled -= 32;
        }
        value
    }

    fn spent(&self) -> bool {
        false
    }
}

/// Reads what an [`Encoder`] wrote. Behind the end it reads zeros, and tells.
#[derive(Clone, Debug)]
pub(super) struct Decoder<'a> {
    state: u32,
    bytes: &'a [u8],
    at: usize,
    plain: &'a [u8],
    /// The next plain bit.
    bit: u64,
    /// Decisions were missing.
    short: bool,
}

impl<'a> Decoder<'a> {
    /// `stream` as [`Encoder::finish`] wrote it; `None` if it ends too early.
    pub(super) fn new(mut stream: &'a [u8]) -> Option<Self> {
        let length = take_varint(&mut stream)?;
        let (bytes, plain) = stream.split_at_checked(usize::try_from(length).ok()?)?;
        let mut d = Decoder { state: LEAST, bytes, at: 0, plain, bit: 0, short: false };
        if !bytes.is_empty() {
            let high = d.word();
            d.state = (high << 16 | d.word()).max(LEAST);
        }
        Some(d)
    }

    #[inline(always)]
    fn word(&mut self) -> u32 {
        let word = match self.bytes.get(self.at..self.at + 2) {
            Some(b) => u16::from_le_bytes([b[0], b[1]]) as u32,
            None => {
                self.short = true;
                0
            }
        };
        self.at += 2;
        word
    }

    /// Brings the state back above [`LEAST`], without a branch, which would mostly be foretold wrongly.
    #[inline(always)]
    fn fill(&mut self, state: u32) {
        let low = state < LEAST;
        let word = match self.bytes.get(self.at..self.at + 2) {
            Some(b) => u16::from_le_bytes([b[0], b[1]]) as u32,
            None => {
                self.short |= low;
                0
            }
        };
        self.at += 2 * low as usize;
        let filled = state << 16 | word;
        self.state = std::hint::select_unpredictable(low, filled, state);
    }

    /// The 8 bytes with the next plain bit, or what is left of them, and zeros.
    #[cold]
    fn tail(&self) -> u64 {
        let at = usize::try_from(self.bit >> 3).unwrap_or(usize::MAX);
        let rest = self.plain.get(at..).unwrap_or_default();
        rest.iter().take(8).rev().fold(0, |x, &b| x << 8 | b as u64)
    }

    /// Takes a decision's share out of the state.
    #[inline(always)]
    fn take(&mut self, (start, size): (u32, u32)) {
        self.fill(size * (self.state >> PRECISION) + (self.state & (TOTAL - 1)) - start);
    }
}

impl Coder for Decoder<'_> {
    const READS: bool = true;

    #[inline(always)]
    fn bit(&mut self, p: &mut Bit, _: bool) -> bool {
        let zero = p.zero();
        let slot = self.state & (TOTAL - 1);
        let bit = slot >= zero;
        // As `take` does, with one product for both.
        let below = (self.state >> PRECISION) * zero;
        self.fill(if bit { self.state - below - zero } else { below + slot });
        p.learn(bit);
        bit
    }

    #[inline(always)]
    fn nibble(&mut self, m: &mut Nibble, _: u32) -> u32 {
        let symbol = m.find(self.state & (TOTAL - 1));
        self.take(m.share(symbol));
        m.learn(symbol);
        symbol as u32
    }

    #[inline(always)]
    fn plain(&mut self, bits: u32, _: u32) -> u32 {
        let at = (self.bit >> 3) as usize;
        let next = match self.plain.get(at..at.saturating_add(8)) {
            Some(b) => u64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]),
            None => self.tail(),
        };
        let value = next >> (self.bit & 7) & low_mask(bits);
        self.bit += bits as u64;
        value as u32
    }

    #[inline]
    fn spent(&self) -> bool {
        self.short || self.bit > 8 * self.plain.len() as u64
    }
}

/// Appends a number in groups of 7 bits, the low ones first.
pub(super) fn put_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Takes a number in groups of 7 bits off the front.
pub(super) fn take_varint(from: &mut &[u8]) -> Option<u64> {
    let mut value = 0u64;
    for k in 0..10 {
        let (&byte, rest) = from.split_first()?;
        *from = rest;
        if k == 9 && byte > 1 {
            return None;
        }
        value |= (byte as u64 & 0x7F) << (7 * k);
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Clone, Debug)]
    enum Item {
        Bit(usize, bool),
        Nibble(usize, u32),
        Plain(u32, u32),
        Number(u64),
        Signed(i64),
        Choice(usize, usize),
    }

    fn run<C: Coder>(c: &mut C, items: &[Item]) -> Vec<u64> {
        let mut bits = [Bit::default(); 3];
        let mut nibbles = [Nibble::default(); 2];
        let (mut number, mut signed) = (Number::default(), Number::default());
        let mut choice = Choice::default();
        items
            .iter()
            .map(|i| match *i {
                Item::Bit(k, b) => c.bit(&mut bits[k], b) as u64,
                Item::Nibble(k, v) => c.nibble(&mut nibbles[k], v) as u64,
                Item::Plain(n, v) => c.plain(n, v) as u64,
                Item::Number(v) => c.number(&mut number, v),
                Item::Signed(v) => c.signed(&mut signed, v) as u64,
                Item::Choice(n, v) => c.choice(&mut choice, n, v).unwrap() as u64,
            })
            .collect()
    }

    fn item() -> impl Strategy<Value = Item> {
        prop_oneof![
            (0..3usize, prop::bool::weighted(0.02)).prop_map(|(k, b)| Item::Bit(k, b)),
            (0..2usize, prop_oneof![3 => Just(7u32), 1 => 0..16u32]).prop_map(|(k, v)| Item::Nibble(k, v)),
            (0..=32u32, any::<u32>()).prop_map(|(n, v)| Item::Plain(n, (v as u64 & low_mask(n)) as u32)),
            (0..=64u32, any::<u64>()).prop_map(|(n, v)| Item::Number(v & low_mask(n))),
            any::<i64>().prop_map(Item::Signed),
            (1..40usize, 0..40usize).prop_map(|(n, v)| Item::Choice(n, v % n)),
        ]
    }

    proptest! {
        #[test]
        fn what_was_written_is_read(items in prop::collection::vec(item(), 0..400)) {
            let mut e = Encoder::default();
            let want = run(&mut e, &items);
            let mut bytes = Vec::new();
            e.finish(&mut bytes);
            let mut d = Decoder::new(&bytes).unwrap();
            prop_assert_eq!(run(&mut d, &items), want);
            prop_assert!(!d.spent());
        }

        #[test]
        fn varints_return(value in any::<u64>(), shift in 0..64u32) {
            let mut out = Vec::new();
            put_varint(&mut out, value >> shift);
            let mut rest = &out[..];
            prop_assert_eq!(take_varint(&mut rest), Some(value >> shift));
            prop_assert!(rest.is_empty());
        }
    }

    #[test]
    fn multiplying_by_inverses_divides() {
        for size in 1..TOTAL {
            let most = u32::MAX / size;
            for times in [0, 1, 2, most / 3, most - 1, most] {
                for x in [times * size, times * size + (size - 1).min(u32::MAX - times * size)] {
                    assert_eq!(quotient(x, inverse(size)), x / size, "{x} / {size}");
                }
            }
            assert_eq!(quotient(u32::MAX, inverse(size)), u32::MAX / size);
        }
    }

    #[test]
    fn long_runs_of_the_probable_cost_little_and_an_end_is_noticed() {
        let mut e = Encoder::default();
        let mut p = Bit::default();
        (0..20_000).for_each(|_| {
            e.bit(&mut p, false);
        });
        let mut bytes = Vec::new();
        e.finish(&mut bytes);
        assert!(bytes.len() < 60, "{}", bytes.len());
        let mut d = Decoder::new(&bytes).unwrap();
        let mut p = Bit::default();
        assert!((0..20_000).all(|_| !d.bit(&mut p, true)));
        assert!(!d.spent());
        for _ in 0..40_000_000 {
            d.bit(&mut p, false);
            if d.spent() {
                return;
            }
        }
        panic!("never spent");
    }
}
