//! Coordinates along an axis as whole numbers.

use super::super::places::{order32, order64, round_even, unorder32, unorder64};

/// What coordinates along an axis are: of a terrain its columns and rows, and heights in steps of the file they came from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct Axis {
    kind: Kind,
    step: f64,
    /// Coordinates are rounded to f64, or else to f32.
    double: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Multiples of the step.
    Steps,
    /// Multiples by what fits into an f32.
    Floats,
    /// Any.
    Doubles,
}

/// Bytes in a chunk.
const BYTES: usize = 9;

impl Axis {
    /// One of which all of these are.
    pub(super) fn of(all: impl Iterator<Item = f64> + Clone, step: f64, double: bool) -> Axis {
        let one = |kind, step| Axis { kind, step, double };
        let tried = [one(Kind::Steps, step), one(Kind::Floats, step), one(Kind::Floats, 1.0)];
        let fits = |a: &Axis| a.is_sound() && all.clone().all(|x| a.number(x).is_some());
        tried.into_iter().find(fits).unwrap_or(one(Kind::Doubles, 1.0))
    }

    fn is_sound(&self) -> bool {
        self.step.is_finite() && self.step > 0.0
    }

    /// Of three as [`Axis::write`] wrote them; coordinates are not rounded.
    pub(super) fn three(bytes: &mut &[u8]) -> Option<[Axis; 3]> {
        let mut three = [Axis { kind: Kind::Doubles, step: 1.0, double: true }; 3];
        for axis in &mut three {
            let (own, rest) = bytes.split_first_chunk::<BYTES>()?;
            *bytes = rest;
            let [kind, step @ ..] = own;
            axis.kind = match kind {
                0 => Kind::Steps,
                1 => Kind::Floats,
                2 => Kind::Doubles,
                _ => return None,
            };
            axis.step = f64::from_le_bytes(*step);
            if !axis.is_sound() {
                return None;
            }
        }
        Some(three)
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        out.push(self.kind as u8);
        out.extend_from_slice(&self.step.to_le_bytes());
    }

    /// With coordinates in the precision of a mesh.
    pub(super) fn rounded(self, double: bool) -> Axis {
        Axis { double, ..self }
    }

    /// The coordinate of a number.
    #[inline(always)]
    pub(super) fn at(&self, k: i64) -> f64 {
        let x = match self.kind {
            Kind::Steps => k as f64 * self.step,
            Kind::Floats => f64::from(f32::from_bits(unorder32(k as u32))) * self.step,
            Kind::Doubles => f64::from_bits(unorder64(k as u64)),
        };
        if self.double { x } else { f64::from(x as f32) }
    }

    /// The number of a coordinate, if it has one.
    pub(super) fn number(&self, x: f64) -> Option<i64> {
        let is = |k: &i64| self.at(*k).to_bits() == x.to_bits();
        match self.kind {
            Kind::Steps => {
                let k = round_even(x / self.step);
                Some(k as i64).filter(|k| k.unsigned_abs() < 1 << 31 && is(k))
            }
            Kind::Floats => {
                let near = (x / self.step) as f32;
                let number = |f: f32| i64::from(order32(f.to_bits()));
                [near, near.next_down(), near.next_up()].map(number).into_iter().find(is)
            }
            Kind::Doubles => Some(order64(x.to_bits()) as i64).filter(is),
        }
    }

    /// A number, or a difference of two, within the range of numbers.
    #[inline(always)]
    pub(super) fn wrap(&self, k: i64) -> i64 {
        match self.kind {
            Kind::Doubles => k,
            Kind::Steps | Kind::Floats => i64::from(k as i32),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_return_whatever_they_are() {
        let hard = [
            0.0,
            -0.0,
            1.5,
            -1e19,
            -9_223_372_036_854_775_808.0,
            9e18,
            f64::from(f32::MIN),
            f64::MIN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            1e-320,
            f64::from(i32::MIN),
            f64::from(i32::MAX),
            0.1,
        ];
        for double in [false, true] {
            let round = |x: f64| if double { x } else { f64::from(x as f32) };
            for step in [1.0, 0.1, 1e-320, 1e300] {
                for &x in &hard {
                    let axis = Axis::of([round(x)].into_iter(), step, double);
                    let k = axis.number(round(x)).unwrap();
                    assert_eq!(axis.at(axis.wrap(k)).to_bits(), round(x).to_bits(), "{x} {axis:?}");
                }
            }
        }
    }
}
