//! Positions whose surroundings are known: residuals coded by how far the surroundings reach.
//!
//! As [`super::places`], but the size of a residual is not learned for a whole chunk: it is coded against the extent of the ring along its axis, in
//! units of the last place.

use super::coder::{Bit, Coder, Nibble, Number, low_mask, unzigzag, zigzag};
use super::places::{Lattice, order32, order64, unorder32, unorder64};

/// What a place is expected to be.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Guess {
    pub(super) at: [f64; 3],
    /// How far its surroundings reach along each axis.
    pub(super) reach: [f64; 3],
}

/// The length that a residual is expected to have is in the middle of the symbols.
const MIDDLE: i32 = 9;
/// Lengths beyond are written as numbers.
const FAR: u32 = 15;
/// How much flatter than long: classes.
const FLAT: usize = 4;

/// Codes positions of one chunk; `KINDS` kinds of them.
#[derive(Clone, Debug)]
pub(super) struct Residuals<const KINDS: usize> {
    double: bool,
    lattices: Vec<Lattice>,
    on_lattice: [Bit; KINDS],
    second: [Bit; KINDS],
    /// By kind, lattice or none, half of the octave, flatness.
    length: Vec<[[Nibble; FLAT]; 2]>,
    top: [Bit; 16],
    far: Number,
}

/// Half octaves of a positive number, rounded down.
#[inline]
fn halves(x: f64) -> i32 {
    (x.to_bits() >> 51) as i32 - (1023 << 1)
}

impl<const KINDS: usize> Residuals<KINDS> {
    pub(super) fn new(double: bool, lattices: &[Lattice]) -> Self {
        Residuals {
            double,
            lattices: lattices.to_vec(),
            on_lattice: [Bit::default(); KINDS],
            second: [Bit::default(); KINDS],
            length: vec![Default::default(); KINDS * (1 + lattices.len())],
            top: Default::default(),
            far: Number::default(),
        }
    }

    /// Codes `value`, a place of kind `kind`, given where it is expected.
    #[inline]
    pub(super) fn code<C: Coder>(
        &mut self,
        c: &mut C,
        kind: usize,
        guess: &Guess,
        value: [f64; 3],
    ) -> [f64; 3] {
        let longest = guess.reach[0].max(guess.reach[1]).max(guess.reach[2]);
        let longest = halves(longest);
        // Half octaves of reach, and flatness.
        let near = guess.reach.map(|r| {
            let h = halves(r).max(longest - 2 * FLAT as i32 + 1);
            (h, ((longest - h) >> 1) as usize)
        });
        if !self.lattices.is_empty() {
            let lattices = &self.lattices;
            let found = if C::READS {
                None
            } else {
                lattices.iter().enumerate().find_map(|(i, l)| l.indices(self.double, value).map(|k| (i, k)))
            };
            if c.bit(&mut self.on_lattice[kind], found.is_some()) {
                let (mut which, k) = found.unwrap_or_default();
                if lattices.len() > 1 {
                    which = c.bit(&mut self.second[kind], which == 1) as usize;
                }
                let l = self.lattices[which];
                let sets = 1 + self.lattices.len();
                let unit = halves(l.step / l.parts) & !1;
                let mut out = [0.0; 3];
                for axis in 0..3 {
                    let expected = l.nearest(axis, guess.at[axis]);
                    let residual = k[axis].wrapping_sub(expected);
                    let (h, flat) = near[axis];
                    let k = self.residual(c, kind * sets + 1 + which, h - unit, flat, residual);
                    let x = l.at(axis, expected.wrapping_add(k));
                    out[axis] = if self.double { x } else { x as f32 as f64 };
                }
                return out;
            }
        }
        let set = kind * (1 + self.lattices.len());
        let mut out = [0.0; 3];
        for axis in 0..3 {
            let (h, flat) = near[axis];
            out[axis] = if self.double {
                let bits = guess.at[axis].to_bits();
                let unit = 2 * (((bits >> 52) as i32 & 0x7FF) - 1075);
                let guess = order64(bits);
                let residual = order64(value[axis].to_bits()).wrapping_sub(guess) as i64;
                let r = self.residual(c, set, h - unit, flat, residual);
                f64::from_bits(unorder64(guess.wrapping_add(r as u64)))
            } else {
                let bits = (guess.at[axis] as f32).to_bits();
                let unit = 2 * (((bits >> 23) as i32 & 0xFF) - 150);
                let guess = order32(bits);
                let residual = order32((value[axis] as f32).to_bits()).wrapping_sub(guess) as i32;
                let r = self.residual(c, set, h - unit, flat, residual as i64);
                f32::from_bits(unorder32(guess.wrapping_add(r as u32))) as f64
            };
        }
        out
    }

    /// A residual that is expected to be about 2^(reach / 2) long.
    #[inline]
    fn residual<C: Coder>(&mut self, c: &mut C, set: usize, reach: i32, flat: usize, x: i64) -> i64 {
        let x = zigzag(x);
        let length = 64 - x.leading_zeros();
        let shift = (reach >> 1).clamp(MIDDLE - 14, 64) - MIDDLE;
        let model = &mut self.length[set][(reach & 1) as usize][flat & 3];
        let near = length as i32 - shift;
        let symbol = if (0..FAR as i32).contains(&near) { near as u32 } else { FAR };
        let symbol = c.nibble(model, symbol);
        if symbol == FAR {
            return c.signed(&mut self.far, unzigzag(x));
        }
        let length = symbol as i32 + shift;
        if length <= 1 {
            return unzigzag((length == 1) as u64);
        }
        let rest = (length as u32).min(64) - 2;
        let top = c.bit(&mut self.top[symbol as usize], x >> rest & 1 == 1) as u64;
        let low = c.plain64(rest, x & low_mask(rest));
        unzigzag((2 | top) << rest | low)
    }
}
