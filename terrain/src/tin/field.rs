//! The samples as integers, so that every question about errors has an exact answer.

use crate::Grid;

/// The height of a void sample.
pub(super) const VOID: i32 = i32::MIN;

/// Heights never exceed this many quanta, which f32 holds exactly.
const MOST: f64 = 16_777_214.0;

/// f64s about this have no fractions.
const TO_WHOLE: f64 = 6_755_399_441_055_744.0;

/// Fractions of a quantum in which the tolerance is counted.
const FRACTION_BITS: u32 = 8;

/// A grid's heights in quanta: multiples of a power of two so small that the greatest height and the error allowed take 24 bits.
///
/// A triangle's height at a sample is `S / A`: `S` is the sum of its corners' heights times the areas opposite them, `A` its own area, all
/// integers. Sides are at most 65,535 long, so `A` takes 33 bits and `S` 58.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub columns: i32,
    pub rows: i32,
    /// Heights in quanta, row after row; [`VOID`] where there is none.
    pub h: Vec<i32>,
    /// The height of one quantum.
    pub quantum: f64,
    /// The farthest that a sample lies from its multiple of the quantum.
    pub rounding: f64,
}

impl Field {
    /// Heights that leave room for `error` above and below.
    pub(super) fn new(grid: &Grid, error: f64) -> Self {
        let greatest = grid.range().map_or(0.0, |(l, g)| l.abs().max(g.abs())) + error;
        let mut quantum = 1.0f64;
        // Powers of two, within the normal numbers of both f32 and f64.
        while greatest / quantum > MOST && quantum < 1e300 {
            quantum *= 2.0;
        }
        while greatest / (quantum / 2.0) <= MOST && quantum > 1e-30 {
            quantum /= 2.0;
        }
        // A quantum is a power of two, so that this is exact.
        let (inverse, mut rounding) = (1.0 / quantum, 0.0f64);
        let quanta = |&z: &f64| {
            let scaled = z * inverse;
            // To the nearest whole number, as long as there are fewer than 2^51 quanta; NaN stays NaN.
            let whole = (scaled + TO_WHOLE) - TO_WHOLE;
            let off = (scaled - whole).abs();
            rounding = if off > rounding { off } else { rounding };
            if whole.is_nan() { VOID } else { whole as i32 }
        };
        let h = grid.heights().iter().map(quanta).collect();
        Field {
            columns: grid.columns() as i32,
            rows: grid.rows() as i32,
            h,
            quantum,
            rounding: rounding * quantum,
        }
    }

    /// A part of it, with the same quantum: what several parts share has the same height in all.
    pub(super) fn part(&self, [x0, y0]: [i32; 2], [x1, y1]: [i32; 2]) -> Self {
        let row = |y: i32| &self.h[self.index(x0, y)..=self.index(x1, y)];
        let h = (y0..=y1).flat_map(row).copied().collect();
        Field { columns: x1 - x0 + 1, rows: y1 - y0 + 1, h, quantum: self.quantum, rounding: self.rounding }
    }

    /// The error in quanta that keeps the true heights within `error`; `None` if rounding alone breaks that.
    pub(super) fn tolerance(&self, error: f64) -> Option<Tolerance> {
        if error < self.rounding {
            return None;
        }
        let left = error - self.rounding;
        // The subtraction may have rounded up.
        let left = if self.rounding > 0.0 { left.next_down().max(0.0) } else { left };
        let scaled = left / self.quantum * f64::from(1u32 << FRACTION_BITS);
        Some(Tolerance(scaled.min(2f64.powi(40)).floor() as i64))
    }

    /// The greatest height less the least, in the grid's units.
    pub(super) fn span(&self) -> f64 {
        let valid = || self.h.iter().filter(|&&h| h != VOID);
        let (Some(&least), Some(&greatest)) = (valid().min(), valid().max()) else { return 0.0 };
        (i64::from(greatest) - i64::from(least)) as f64 * self.quantum
    }

    #[inline]
    pub(super) fn index(&self, x: i32, y: i32) -> usize {
        y as usize * self.columns as usize + x as usize
    }

    /// The height at a sample, in quanta.
    #[inline]
    pub(super) fn at(&self, x: i32, y: i32) -> i32 {
        self.h[self.index(x, y)]
    }
}

/// The error allowed, in fractions of a quantum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tolerance(i64);

impl Tolerance {
    /// The greatest `|S - A h|` allowed in a triangle of doubled area `area`.
    #[inline]
    pub(super) fn over(self, area: i64) -> i64 {
        ((i128::from(self.0) * i128::from(area)) >> FRACTION_BITS) as i64
    }

    /// In fractions of a quantum, and how many of these a quantum has.
    pub(super) fn fractions(self) -> (i64, i64) {
        (self.0, 1 << FRACTION_BITS)
    }

    /// In quanta.
    pub(super) fn quanta(self) -> f64 {
        self.0 as f64 / f64::from(1u32 << FRACTION_BITS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_heights_are_exact() {
        let grid = Grid::new(2, 2, vec![0.0, 8848.0, -10_994.0, 1.5]).unwrap();
        let field = Field::new(&grid, 100.0);
        assert_eq!(field.rounding, 0.0);
        assert_eq!(f64::from(field.at(1, 0)) * field.quantum, 8848.0);
        assert!(field.h.iter().all(|&h| h.abs() <= 1 << 24));
        assert_eq!(field.tolerance(100.0).unwrap().over(2), (200.0 / field.quantum) as i64);
    }

    #[test]
    fn an_error_below_the_rounding_is_refused() {
        let grid = Grid::new(2, 2, vec![1e30, 0.1, f64::NAN, -3.0]).unwrap();
        let field = Field::new(&grid, 1.0);
        assert!(field.rounding > 1.0);
        assert_eq!(field.tolerance(1.0), None);
        assert_eq!(field.at(0, 1), VOID);
        let tolerance = field.tolerance(4e30).unwrap();
        assert!(tolerance.quanta() * field.quantum <= 4e30);
    }

    #[test]
    fn a_grid_of_zeros_has_a_quantum() {
        let field = Field::new(&Grid::new(2, 1, vec![0.0; 2]).unwrap(), 0.0);
        assert!(field.quantum > 0.0);
        assert_eq!(field.tolerance(0.0), Some(Tolerance(0)));
    }
}
