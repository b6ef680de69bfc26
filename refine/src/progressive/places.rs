//! Places that splits bring, those on a grid in a few bytes.

use crate::aif::Positions;
use crate::packed::{Packed, Ranks};
use glam::{DVec3, Vec3};

/// Points of one precision. [`Places::pack`] lets those that are multiples of a power of two, as methods put them on a grid ([`crate::simplify::Options::grid`]), take as many
/// bits as their numbers on it need; whatever the points are, each comes back bit for bit.
#[derive(Clone, Debug)]
pub struct Places(Kept);

#[derive(Clone, Debug)]
enum Kept {
    Plain(Positions),
    Packed(Box<OnGrid>),
}

/// Some points on a grid, the others as they are.
#[derive(Clone, Debug)]
struct OnGrid {
    /// Which are on the grid.
    on: Ranks,
    len: usize,
    /// Power of two.
    cell: f64,
    /// The least number on each axis, times the cell.
    least: DVec3,
    /// Where the second and the third axis begin in a number, and as many bits as each axis has, 31 at most.
    shifts: [u32; 2],
    masks: [u32; 3],
    numbers: Packed,
    /// One more than there are.
    others: Positions,
}

/// Points looked at to find whether there is a grid. With 2,000, which take longer, the files of a scene of an engine, of bunny with texture coordinates, of horse and of fandisk are the same.
const SAMPLES: usize = 500;

impl Default for Places {
    fn default() -> Self {
        Positions::default().into()
    }
}

impl From<Positions> for Places {
    fn from(p: Positions) -> Self {
        Places(Kept::Plain(p))
    }
}

/// Point by point, NaN not equal to itself.
impl PartialEq for Places {
    fn eq(&self, other: &Places) -> bool {
        match (&self.0, &other.0) {
            (Kept::Plain(a), Kept::Plain(b)) => a == b,
            _ => (self.len(), self.is_f64()) == (other.len(), other.is_f64()) && self.iter().eq(other.iter()),
        }
    }
}

impl Places {
    /// How many.
    #[inline]
    pub fn len(&self) -> usize {
        match &self.0 {
            Kept::Plain(p) => p.len(),
            Kept::Packed(p) => p.len,
        }
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// True if they are of double precision.
    pub fn is_f64(&self) -> bool {
        match &self.0 {
            Kept::Plain(p) => p.is_f64(),
            Kept::Packed(p) => p.others.is_f64(),
        }
    }

    /// Point `i`. Panics if there is none.
    #[inline]
    pub fn get(&self, i: usize) -> DVec3 {
        match &self.0 {
            Kept::Plain(p) => p.get(i),
            Kept::Packed(p) => p.get(i),
        }
    }

    /// Tells points `which`, each with how many of these come before it. What kind of points there are is asked once.
    #[inline(always)]
    pub(crate) fn each(&self, which: &[u32], mut tell: impl FnMut(usize, DVec3)) {
        let which = which.iter().map(|&i| i as usize).enumerate();
        match &self.0 {
            Kept::Plain(Positions::F32(p)) => which.for_each(|(k, i)| tell(k, Vec3::from(p[i]).as_dvec3())),
            Kept::Plain(Positions::F64(p)) => which.for_each(|(k, i)| tell(k, p[i].into())),
            Kept::Packed(p) => which.for_each(|(k, i)| tell(k, p.at(i))),
        }
    }

    /// All of them.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = DVec3> + '_ {
        (0..self.len()).map(|i| self.get(i))
    }

    /// Points `order`, in that order. Panics if there is no such point.
    pub fn gather(&self, order: &[u32]) -> Places {
        match &self.0 {
            Kept::Plain(p) => p.gather(order).into(),
            Kept::Packed(_) => self.to_positions(order.iter().map(|&i| i as usize)).into(),
        }
    }

    /// As they are without a grid, to be changed.
    pub fn plain(&mut self) -> &mut Positions {
        if let Kept::Packed(_) = &self.0 {
            self.0 = Kept::Plain(self.to_positions(0..self.len()));
        }
        match &mut self.0 {
            Kept::Plain(p) => p,
            Kept::Packed(p) => &mut p.others,
        }
    }

    fn to_positions(&self, which: impl Iterator<Item = usize>) -> Positions {
        if self.is_f64() {
            Positions::F64(which.map(|i| self.get(i).to_array()).collect())
        } else {
            // They were f32.
            Positions::F32(which.map(|i| self.get(i).as_vec3().to_array()).collect())
        }
    }

    /// Finds a grid on which many of them are, and gives back what is not needed then. O(n), and about nothing where there is no such grid.
    pub fn pack(&mut self) {
        let Kept::Plain(p) = &mut self.0 else { return };
        if let Some(packed) = find_cell(p).and_then(|cell| OnGrid::new(p, cell)) {
            self.0 = Kept::Packed(Box::new(packed));
            return;
        }
        match p {
            Positions::F32(p) => p.shrink_to_fit(),
            Positions::F64(p) => p.shrink_to_fit(),
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        match &self.0 {
            Kept::Plain(p) => bytes(p),
            Kept::Packed(p) => size_of::<OnGrid>() + p.on.bytes() + p.numbers.bytes() + bytes(&p.others),
        }
    }
}

/// Bytes held by positions.
pub(crate) fn bytes(p: &Positions) -> usize {
    match p {
        Positions::F32(p) => 12 * p.capacity(),
        Positions::F64(p) => 24 * p.capacity(),
    }
}

/// The exponent of the lowest bit that is set in one of the coordinates; `None` where all are 0, or one is no number.
fn lowest(p: DVec3) -> Option<i32> {
    let of = |x: f64| {
        let bits = x.to_bits();
        let exponent = (bits >> 52 & 0x7FF) as i32 - 1075;
        exponent + (bits & ((1 << 52) - 1) | 1 << 52).trailing_zeros() as i32
    };
    let numbers = p.to_array().into_iter().filter(|x| *x != 0.0);
    numbers.map(of).min().filter(|_| p.is_finite())
}

/// The power of two of which so many points are multiples that packing them spares most; `None` if it spares next to nothing.
fn find_cell(p: &Positions) -> Option<f64> {
    let step = p.len().div_ceil(SAMPLES) | 1;
    let mut low: Vec<i32> = (0..p.len()).step_by(step).filter_map(|i| lowest(p.get(i))).collect();
    low.sort_unstable();
    let (lo, hi) = p.bounds()?;
    let side = (hi - lo).max_element();
    if !side.is_finite() {
        return None;
    }
    let raw = if p.is_f64() { 192 } else { 96 };
    // Bits of a point whose cell is 2^e, roughly.
    let bits = |e: i32| 3 * ((side.log2().ceil() as i32).saturating_sub(e) + 1).clamp(1, 64) as i64;
    // No more than a word each; an axis may need one bit less than thought.
    let fits = |e: i32| (-1000..1000).contains(&e) && bits(e) <= 66;
    let spared = |&(k, &e): &(usize, &i32)| (low.len() - k) as i64 * (raw - bits(e)) - 2 * low.len() as i64;
    let best = low.iter().enumerate().filter(|l| fits(*l.1)).max_by_key(spared)?;
    (spared(&best) > 4 * low.len() as i64).then(|| (*best.1 as f64).exp2())
}

impl OnGrid {
    fn new(p: &Positions, cell: f64) -> Option<OnGrid> {
        const FARTHEST: f64 = (1u64 << 52) as f64;
        let number = |x: f64| {
            let k = x / cell;
            let k = (k.abs() < FARTHEST && k.fract() == 0.0).then_some(k as i64)?;
            // What comes back is the same bit for bit: a negative zero does not, nor what vanishes beside the cell.
            ((k as f64 * cell).to_bits() == x.to_bits()).then_some(k)
        };
        let numbers = |i: usize| -> Option<[i64; 3]> {
            let [x, y, z] = p.get(i).to_array();
            Some([number(x)?, number(y)?, number(z)?])
        };
        let (mut least, mut most) = ([i64::MAX; 3], [i64::MIN; 3]);
        for k in (0..p.len()).filter_map(numbers) {
            for axis in 0..3 {
                least[axis] = least[axis].min(k[axis]);
                most[axis] = most[axis].max(k[axis]);
            }
        }
        if least[0] > most[0] {
            return None;
        }
        let bits: [u32; 3] = std::array::from_fn(|a| 64 - ((most[a] - least[a]) as u64).leading_zeros());
        let width: u32 = bits.iter().sum();
        if width > 64 || bits.iter().any(|&b| b > 31) {
            return None;
        }
        let on = Ranks::new((0..p.len()).map(|i| numbers(i).is_some()));
        let shifts = [bits[0], bits[0] + bits[1]];
        let code = |k: [i64; 3]| {
            let [x, y, z] = std::array::from_fn(|a| (k[a] - least[a]) as u64);
            x | y << shifts[0] | z << shifts[1]
        };
        let packed = Packed::with_width(width, (0..p.len()).filter_map(numbers).map(code));
        let others: Vec<u32> = (0..p.len() as u32).filter(|&i| !on.get(i)).chain([0]).collect();
        let others = p.gather(&others);
        let masks = bits.map(|b| (1 << b) - 1);
        let least = DVec3::from_array(least.map(|k| k as f64)) * cell;
        Some(OnGrid { on, len: p.len(), cell, least, shifts, masks, numbers: packed, others })
    }

    #[inline]
    fn get(&self, i: usize) -> DVec3 {
        self.at(i)
    }

    #[inline(always)]
    fn at(&self, i: usize) -> DVec3 {
        assert!(i < self.len, "point {i} of {}", self.len);
        let (on_grid, before) = self.on.find(i as u32);
        let before = before as usize;
        let code = self.numbers.get(before);
        let axis = |shift: u32, mask: u32| ((code >> shift) as u32 & mask) as i32;
        let [x, y, z] = [
            axis(0, self.masks[0]),
            axis(self.shifts[0], self.masks[1]),
            axis(self.shifts[1], self.masks[2]),
        ];
        // Numbers are below 2^53, and a cell is a power of two: exact.
        let on = glam::IVec3::new(x, y, z).as_dvec3() * self.cell + self.least;
        // Both are read, as which it is can not be foretold: there is one more of each.
        let other = self.others.get(i - before);
        DVec3::select(glam::BVec3::splat(on_grid), on, other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn same(p: &Places, q: &Positions) -> bool {
        p.len() == q.len()
            && p.is_f64() == q.is_f64()
            && (0..q.len())
                .all(|i| p.get(i).to_array().map(f64::to_bits) == q.get(i).to_array().map(f64::to_bits))
            && {
                let which: Vec<u32> = (0..q.len() as u32).rev().step_by(3).collect();
                let mut told = 0;
                let mut alike = true;
                p.each(&which, |k, at| {
                    let as_got = p.get(which[k] as usize);
                    alike &=
                        k == told && at.to_array().map(f64::to_bits) == as_got.to_array().map(f64::to_bits);
                    told += 1;
                });
                alike && told == which.len()
            }
    }

    #[test]
    fn points_on_a_grid_take_few_bits_and_others_stay() {
        let at = |i: usize| {
            let k = |m: usize| (i * m % 4001) as f32 * 2f32.powi(-12);
            // Every tenth is anywhere; one is a negative zero.
            if i % 10 == 3 {
                [k(7) / 3.0, 0.1, 1e-20]
            } else {
                [k(7) - 0.5, if i == 4 { -0.0 } else { k(13) }, -k(17)]
            }
        };
        let plain = Positions::F32((0..5000).map(at).collect());
        let mut p = Places::from(plain.clone());
        p.pack();
        assert!(same(&p, &plain) && p == Places::from(plain.clone()));
        // 36 bits, or 96 for every tenth, and which it is.
        assert!(p.bytes() < 5000 * (45 * 9 + 121) / 100 + 5000 * 2 / 10 + 300, "{}", p.bytes());
        let order: Vec<u32> = (0..5000).rev().step_by(7).collect();
        assert!(same(&p.gather(&order), &plain.gather(&order)));
        assert_eq!(p.plain(), &plain);
        // In double precision too.
        let plain = Positions::F64((0..5000).map(|i| at(i).map(f64::from)).collect());
        let mut p = Places::from(plain.clone());
        p.pack();
        assert!(same(&p, &plain) && p.bytes() < 5000 * 8);
    }

    #[test]
    fn points_on_no_grid_are_left_alone() {
        let plain = Positions::F32((0..300).map(|i| [0.1 * i as f32, (i as f32).sqrt(), f32::NAN]).collect());
        let mut p = Places::from(plain.clone());
        p.pack();
        assert!(same(&p, &plain) && p.bytes() == 3600);
        let mut p = Places::default();
        p.pack();
        assert!(p.is_empty() && p.bytes() == 0);
        // All in one point.
        let mut p = Places::from(Positions::F32(vec![[0.5, -1.0, 0.0]; 100]));
        p.pack();
        assert!(p.iter().all(|p| p == DVec3::new(0.5, -1.0, 0.0)) && p.bytes() < 300);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn whatever_they_are_they_come_back(
            of in prop::collection::vec(prop::array::uniform3(prop_oneof![
                Just(0.0f32), Just(-0.0), Just(f32::INFINITY), any::<f32>().prop_filter("a number", |x| !x.is_nan()),
                (-40i32..40).prop_map(|k| k as f32 * 0.25), (-9i32..9).prop_map(|k| k as f32 * 2f32.powi(-149)),
            ]), 0..80),
            small in 0usize..80,
            double: bool,
        ) {
            let plain = if double {
                let mut of: Vec<[f64; 3]> = of.iter().map(|p| p.map(f64::from)).collect();
                // Nothing beside whatever cell the others have; and an extent that no number holds.
                if let Some(p) = of.get_mut(small) {
                    *p = [5e-324, -5e-324, if small % 2 == 0 { 1e308 } else { 0.25 }];
                }
                Positions::F64(of)
            } else {
                Positions::F32(of)
            };
            let mut p = Places::from(plain.clone());
            p.pack();
            prop_assert!(same(&p, &plain));
        }
    }
}
