//! Positions: predicted, and coded without loss.
//!
//! A position lies on one of the mesh's lattices (places that a method rounded, decimal input, quantised meshes), and then its
//! residual is one of lattice indices; or it does not, and then the residual is one of the floats' bits as ordered integers.

use super::coder::{Bit, Coder, Number};
use crate::aif::Positions;

/// The points `origin + k * step / parts`, for integers k, rounded to the precision of the positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The point of index 0.
    pub origin: [f64; 3],
    /// How far apart points are, times `parts`.
    pub step: f64,
    /// See `step`: a power of ten for decimal input, else 1.
    pub parts: f64,
}

/// Indices are exact in an f64.
const FARTHEST: f64 = (1u64 << 52) as f64;

impl Lattice {
    #[inline]
    pub(super) fn at(&self, axis: usize, k: i64) -> f64 {
        self.origin[axis] + k as f64 * self.step / self.parts
    }

    /// The index nearest to `x`, 0 where there is none.
    #[inline]
    pub(super) fn nearest(&self, axis: usize, x: f64) -> i64 {
        let k = round_even((x - self.origin[axis]) * self.parts / self.step);
        if k.abs() < FARTHEST { k as i64 } else { 0 }
    }

    /// The indices of a point, if it is one of the lattice, bit for bit.
    #[inline]
    pub(super) fn indices(&self, double: bool, p: [f64; 3]) -> Option<[i64; 3]> {
        let mut k = [0; 3];
        for axis in 0..3 {
            k[axis] = self.nearest(axis, p[axis]);
            if self_round(double, self.at(axis, k[axis])).to_bits() != p[axis].to_bits() {
                return None;
            }
        }
        Some(k)
    }

    /// Usable at all.
    pub(super) fn is_sound(&self) -> bool {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        positive(self.step) && positive(self.parts) && self.origin.iter().all(|x| x.is_finite())
    }
}

/// [`f64::round_ties_even`], which is a call where the instruction is not sure to be there.
#[inline(always)]
pub(super) fn round_even(x: f64) -> f64 {
    // Numbers from 2^52 on have no fraction: the sum rounds it off.
    const ROUND: f64 = 1.5 * (1u64 << 52) as f64;
    if x.abs() < (1u64 << 51) as f64 { (x + ROUND) - ROUND } else { x.round_ties_even() }
}

/// The most lattices a mesh may have.
pub(super) const MAX_LATTICES: usize = 2;

/// Codes positions of one chunk.
pub(super) struct Places<'a> {
    double: bool,
    lattices: &'a [Lattice],
    on_lattice: [Bit; 4],
    second: [Bit; 4],
    /// By lattice, context and axis.
    index: Vec<Number>,
    /// By context, axis and the low bits of the prediction's exponent.
    float: Vec<Number>,
}

const CONTEXTS: usize = 4;
const EXPONENTS: usize = 8;

impl<'a> Places<'a> {
    pub(super) fn new(double: bool, lattices: &'a [Lattice]) -> Self {
        Places {
            double,
            lattices,
            on_lattice: Default::default(),
            second: Default::default(),
            index: vec![Number::default(); lattices.len() * CONTEXTS * 3],
            float: vec![Number::default(); CONTEXTS * 3 * EXPONENTS],
        }
    }

    /// Codes `value`, given what it is expected to be; `context` (below 4) tells kinds of places apart.
    #[inline]
    pub(super) fn code<C: Coder>(
        &mut self,
        c: &mut C,
        context: usize,
        expected: [f64; 3],
        value: [f64; 3],
    ) -> [f64; 3] {
        let lattices = self.lattices;
        if !lattices.is_empty() {
            let found = if C::READS {
                None
            } else {
                lattices.iter().enumerate().find_map(|(i, l)| l.indices(self.double, value).map(|k| (i, k)))
            };
            if c.bit(&mut self.on_lattice[context], found.is_some()) {
                let (mut which, k) = found.unwrap_or_default();
                if lattices.len() > 1 {
                    which = c.bit(&mut self.second[context], which == 1) as usize;
                }
                let l = &lattices[which];
                return std::array::from_fn(|axis| {
                    let guess = l.nearest(axis, expected[axis]);
                    let m = &mut self.index[(which * CONTEXTS + context) * 3 + axis];
                    let k = guess.wrapping_add(c.signed(m, k[axis].wrapping_sub(guess)));
                    self_round(self.double, l.at(axis, k))
                });
            }
        }
        std::array::from_fn(|axis| {
            let (guess, exponent) = self.ordered(expected[axis]);
            let m = &mut self.float[(context * 3 + axis) * EXPONENTS + exponent % EXPONENTS];
            if self.double {
                let residual = order64(value[axis].to_bits()).wrapping_sub(guess) as i64;
                let x = guess.wrapping_add(c.signed(m, residual) as u64);
                f64::from_bits(unorder64(x))
            } else {
                let residual = order32((value[axis] as f32).to_bits()).wrapping_sub(guess as u32) as i32;
                let x = (guess as u32).wrapping_add(c.signed(m, residual as i64) as u32);
                f32::from_bits(unorder32(x)) as f64
            }
        })
    }

    /// As an ordered integer, and its exponent.
    #[inline]
    fn ordered(&self, x: f64) -> (u64, usize) {
        if self.double {
            (order64(x.to_bits()), (x.to_bits() >> 52) as usize & 0x7FF)
        } else {
            let bits = (x as f32).to_bits();
            (order32(bits) as u64, (bits >> 23) as usize & 0xFF)
        }
    }
}

#[inline]
fn self_round(double: bool, x: f64) -> f64 {
    if double { x } else { x as f32 as f64 }
}

/// Floats' bits as integers in the order of the floats.
#[inline]
pub(super) fn order32(bits: u32) -> u32 {
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

#[inline]
pub(super) fn unorder32(x: u32) -> u32 {
    if x >> 31 == 1 { x & !(1 << 31) } else { !x }
}

#[inline]
pub(super) fn order64(bits: u64) -> u64 {
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

#[inline]
pub(super) fn unorder64(x: u64) -> u64 {
    if x >> 63 == 1 { x & !(1 << 63) } else { !x }
}

/// Point `i`, exactly.
#[inline]
pub(super) fn point(p: &Positions, i: usize) -> [f64; 3] {
    match p {
        Positions::F32(a) => a[i].map(f64::from),
        Positions::F64(a) => a[i],
    }
}

/// Appends a point that has the precision of `p`.
#[inline]
pub(super) fn push(p: &mut Positions, x: [f64; 3]) {
    match p {
        Positions::F32(a) => a.push(x.map(|x| x as f32)),
        Positions::F64(a) => a.push(x),
    }
}

/// Room for so many more points.
pub(super) fn reserve(p: &mut Positions, points: usize) {
    match p {
        Positions::F32(p) => p.reserve_exact(points),
        Positions::F64(p) => p.reserve_exact(points),
    }
}

/// No points, of the given precision.
pub(super) fn empty(double: bool) -> Positions {
    if double { Positions::F64(Vec::new()) } else { Positions::F32(Vec::new()) }
}

/// Bytes the points take.
pub(super) fn bytes(p: &Positions) -> u64 {
    p.len() as u64 * if p.is_f64() { 24 } else { 12 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rounding_is_to_even(x in -4e15..4e15f64, k in -3_000_000_000i64..3_000_000_000) {
            for x in [x, x * 1e-9, x * 1e300, k as f64 + 0.5, k as f64, k as f64 + 0.25] {
                prop_assert_eq!(round_even(x), x.round_ties_even());
            }
        }
    }

    #[test]
    fn what_is_no_number_rounds_to_none() {
        assert!(round_even(f64::NAN).is_nan());
        assert_eq!(round_even(f64::NEG_INFINITY), f64::NEG_INFINITY);
    }
}
