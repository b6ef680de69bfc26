//! Directions by number, and unit vectors by two of their coordinates.

/// Bits of a direction's number.
pub(super) const BITS: u32 = 2 * HALF;
const HALF: u32 = 10;
/// Steps from the middle of the square to a side, on which the octahedron is folded out (Cigolle et al. 2014). A vector is at most 0.24 degrees from the nearest, 0.1 on average.
const STEPS: i32 = (1 << (HALF - 1)) - 1;

/// The direction with a number.
#[inline]
pub(super) fn direction(number: u32) -> [f32; 3] {
    let at = |k: u32| (k & ((1 << HALF) - 1)) as i32 - STEPS;
    let (u, v) = (at(number), at(number >> HALF));
    // In whole steps, so that folding is exact.
    let w = STEPS - u.abs() - v.abs();
    let sign = |x: i32| if x < 0 { -1 } else { 1 };
    let (x, y) = if w < 0 { ((STEPS - v.abs()) * sign(u), (STEPS - u.abs()) * sign(v)) } else { (u, v) };
    let length = f64::from(x * x + y * y + w * w).sqrt();
    [x, y, w].map(|k| (f64::from(k) / length) as f32)
}

/// Where a vector leads to on the square, in steps from its middle; `None` where it leads nowhere.
#[inline]
fn place(n: [f32; 3]) -> Option<[f64; 2]> {
    let [x, y, z] = n.map(f64::from);
    let sum = x.abs() + y.abs() + z.abs();
    if !(sum > 0.0 && sum.is_finite()) {
        return None;
    }
    let (x, y) = (x / sum, y / sum);
    let fold = |a: f64, b: f64| (1.0 - b.abs()) * if a < 0.0 { -1.0 } else { 1.0 };
    let (u, v) = if z < 0.0 { (fold(x, y), fold(y, x)) } else { (x, y) };
    Some([u * f64::from(STEPS), v * f64::from(STEPS)])
}

/// The whole step that is nearest.
#[inline]
fn whole(steps: f64) -> i32 {
    ((steps + 0.5f64.copysign(steps)) as i32).clamp(-STEPS, STEPS)
}

/// The number of the direction that a vector has about; `None` where it has none.
fn nearest(n: [f32; 3]) -> Option<u32> {
    place(n).map(|p| numbered(p.map(whole)))
}

#[inline]
fn numbered(steps: [i32; 2]) -> u32 {
    let [u, v] = steps.map(|k| (k + STEPS) as u32);
    u | v << HALF
}

/// The number of a direction that is [`direction`] of it bit for bit.
#[inline]
pub(super) fn number(n: [f32; 3]) -> Option<u32> {
    // Rounding to f32 moves a direction by less than a ten-thousandth of a step, so that most others are known by the first coordinate.
    const NEAR: f64 = 1e-3;
    let p = place(n)?;
    let steps = p.map(whole);
    if p.iter().zip(steps).any(|(p, k)| (p - f64::from(k)).abs() > NEAR) {
        return None;
    }
    Some(numbered(steps)).filter(|&k| direction(k).map(f32::to_bits) == n.map(f32::to_bits))
}

/// How far from 1 the length may be of what counts as a direction.
const UNIT: f64 = 1e-3;

/// The nearest direction that has a number, of a vector of about unit length; other vectors as they are.
pub(super) fn snapped(n: [f32; 3]) -> [f32; 3] {
    let length = n.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
    if (length - 1.0).abs() < UNIT { nearest(n).map_or(n, direction) } else { n }
}

/// A vector of nearly unit length: the two smaller coordinates, with the axis of the third in bits that are 0 in both; the sign of the third, and by how many steps of
/// floating-point numbers it is off from what unit length gives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unit {
    pub(super) two: [u32; 2],
    pub(super) third: u32,
}

/// The bit that is 0 in numbers below 2.
const SPARE: u32 = 30;

impl Unit {
    /// What stands where there is none.
    pub(super) const ESCAPE: Unit = Unit { two: [0; 2], third: 0 };

    /// The third coordinate's size if the length is 1.
    #[inline]
    fn expected(two: [f32; 2]) -> u32 {
        let [a, b] = two.map(f64::from);
        ((1.0 - a * a - b * b).max(0.0).sqrt() as f32).to_bits()
    }

    /// With so many bytes for the third; `None` if it does not fit.
    pub(super) fn new(n: [f32; 3], bytes: usize) -> Option<Unit> {
        let [x, y, z] = n.map(f32::abs);
        let (axis, two) = match () {
            _ if z >= x && z >= y => (2, [n[0], n[1]]),
            _ if y >= x => (1, [n[2], n[0]]),
            _ => (0, [n[1], n[2]]),
        };
        if !two.iter().all(|x| x.abs() < 2.0) {
            return None;
        }
        let middle = 1i64 << (8 * bytes - 2);
        let off = i64::from(n[axis].abs().to_bits()) - i64::from(Self::expected(two)) + middle;
        let off = u32::try_from(off).ok().filter(|&k| i64::from(k) < 2 * middle)?;
        let [a, b] = two.map(f32::to_bits);
        let marked = [a | (axis as u32 & 1) << SPARE, b | (axis as u32 >> 1) << SPARE];
        Some(Unit { two: marked, third: off << 1 | u32::from(n[axis].is_sign_negative()) })
    }

    /// The vector.
    #[inline]
    pub(super) fn normal(self, bytes: usize) -> [f32; 3] {
        let axis = (self.two[0] >> SPARE & 1 | (self.two[1] >> SPARE & 1) << 1) as usize;
        let two = self.two.map(|b| f32::from_bits(b & !(1 << SPARE)));
        let middle = 1i64 << (8 * bytes - 2);
        let size = i64::from(Self::expected(two)) + i64::from(self.third >> 1) - middle;
        let sign = (self.third & 1) << 31;
        let mut n = [f32::from_bits(size as u32 | sign); 3];
        (n[(axis + 1) % 3], n[(axis + 2) % 3]) = (two[0], two[1]);
        n
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_lie_close_everywhere_and_have_their_numbers() {
        let (mut worst, mut unnumbered) = (0.0f64, 0);
        for k in 0..200_000u32 {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 200_000.0;
            let (r, a) = ((1.0 - z * z).sqrt(), f64::from(k) * 2.399963);
            let n = [r * a.cos(), r * a.sin(), z].map(|x| x as f32);
            let near = snapped(n);
            let apart = (0..3).map(|i| f64::from(near[i] - n[i]).powi(2)).sum::<f64>().sqrt().to_degrees();
            worst = worst.max(apart);
            unnumbered += usize::from(number(near).is_none());
            assert!(place(near).unwrap().iter().all(|p| (p - p.round()).abs() < 1e-4));
            assert_eq!(Unit::new(n, 1).map(|u| u.normal(1).map(f32::to_bits)), Some(n.map(f32::to_bits)));
        }
        assert!(worst < 0.24 && unnumbered == 0, "{worst} {unnumbered}");
        for n in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0f32]] {
            assert_eq!(snapped(n), n);
        }
        assert_eq!(
            (snapped([0.0; 3]), snapped([3.0, 4.0, 0.0]), number([0.0; 3])),
            ([0.0; 3], [3.0, 4.0, 0.0], None)
        );
    }
}
