//! Values of attributes, normals in a few bytes.

use super::directions::{self, Unit};
use crate::aif::{Channel, Semantic};
use crate::packed::{Packed, Ranks};
use std::borrow::Cow;

/// Rows of attributes, one after the other. [`Values::pack`] lets normals take less: those that are recorded of a method (see [`super::build`]) 20 bits, others of unit
/// length 9 or 10 bytes instead of 12. Whatever the values are, each comes back bit for bit.
#[derive(Clone, Debug)]
pub struct Values(Kept);

#[derive(Clone, Debug)]
enum Kept {
    Plain(Vec<f32>),
    Packed(Box<Rows>),
}

/// Rows with their normals apart.
#[derive(Clone, Debug)]
struct Rows {
    rows: usize,
    /// Numbers in a row, and where among them the normal is.
    stride: usize,
    at: usize,
    /// What is no normal, row after row.
    others: Vec<f32>,
    /// Rows whose normal is one of the directions that have a number.
    on: Ranks,
    numbers: Packed,
    exact: Exact,
}

/// Normals that have no number.
#[derive(Clone, Debug)]
enum Exact {
    Plain(Vec<[f32; 3]>),
    /// Of nearly unit length: two coordinates, and by how much the third is off; the others by ascending place.
    Unit {
        two: Vec<[u32; 2]>,
        third: Packed,
        escapes: Vec<(u32, [f32; 3])>,
    },
}

/// Normals looked at to find whether packing spares anything.
const SAMPLES: usize = 500;

impl Default for Values {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl From<Vec<f32>> for Values {
    fn from(values: Vec<f32>) -> Self {
        Values(Kept::Plain(values))
    }
}

/// Number by number, NaN not equal to itself.
impl PartialEq for Values {
    fn eq(&self, other: &Values) -> bool {
        self.len() == other.len() && self.numbers() == other.numbers()
    }
}

impl Values {
    /// How many numbers, of all rows.
    pub fn len(&self) -> usize {
        match &self.0 {
            Kept::Plain(v) => v.len(),
            Kept::Packed(p) => p.rows * p.stride,
        }
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Row `r` of `stride` numbers each. Panics if there is none.
    #[inline]
    pub fn row(&self, r: usize, stride: usize) -> Cow<'_, [f32]> {
        match &self.0 {
            Kept::Plain(v) => Cow::Borrowed(&v[r * stride..(r + 1) * stride]),
            Kept::Packed(p) => {
                let mut row = vec![0.0; p.stride];
                p.read(r, &mut row);
                Cow::Owned(row)
            }
        }
    }

    /// Writes row `r`, of as many numbers as `out` has, there. Panics if there is none.
    #[inline]
    pub fn read(&self, r: usize, out: &mut [f32]) {
        match &self.0 {
            Kept::Plain(v) => out.copy_from_slice(&v[r * out.len()..(r + 1) * out.len()]),
            Kept::Packed(p) => p.read(r, out),
        }
    }

    /// All numbers.
    pub fn numbers(&self) -> Cow<'_, [f32]> {
        match &self.0 {
            Kept::Plain(v) => Cow::Borrowed(v),
            Kept::Packed(p) => Cow::Owned(p.plain()),
        }
    }

    /// As they are unpacked, to be changed.
    pub fn plain(&mut self) -> &mut Vec<f32> {
        if let Kept::Packed(p) = &self.0 {
            self.0 = Kept::Plain(p.plain());
        }
        match &mut self.0 {
            Kept::Plain(v) => v,
            Kept::Packed(p) => &mut p.others,
        }
    }

    /// Lets normals take less, where there are such as do. O(n), and about nothing where there are none.
    pub fn pack(&mut self, channels: &[Channel]) {
        let Kept::Plain(v) = &mut self.0 else { return };
        v.shrink_to_fit();
        let before = |k: usize| channels[..k].iter().map(|c| c.width).sum::<usize>();
        let normal = |c: &Channel| c.semantic == Semantic::Normal && c.width == 3;
        if let Some(at) = channels.iter().position(normal).map(before)
            && let Some(packed) = Rows::new(v, before(channels.len()), at)
        {
            self.0 = Kept::Packed(Box::new(packed));
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        match &self.0 {
            Kept::Plain(v) => 4 * v.capacity(),
            Kept::Packed(p) => {
                let exact = match &p.exact {
                    Exact::Plain(v) => 12 * v.capacity(),
                    Exact::Unit { two, third, escapes } => {
                        8 * two.capacity() + third.bytes() + 16 * escapes.capacity()
                    }
                };
                size_of::<Rows>() + 4 * p.others.capacity() + p.on.bytes() + p.numbers.bytes() + exact
            }
        }
    }
}

impl Rows {
    /// `None` where it would spare next to nothing.
    fn new(values: &[f32], stride: usize, at: usize) -> Option<Rows> {
        let rows = values.len() / stride;
        if rows * stride != values.len() {
            return None;
        }
        let normal = |r: usize| -> [f32; 3] { std::array::from_fn(|k| values[r * stride + at + k]) };
        // Odd, as rows of split and new vertices take turns.
        let step = rows.div_ceil(SAMPLES) | 1;
        let (mut seen, mut numbered, mut units) = (0, 0, [0; 2]);
        for n in (0..rows).step_by(step).map(normal) {
            seen += 1;
            if directions::number(n).is_some() {
                numbered += 1;
            } else {
                [1, 2]
                    .iter()
                    .zip(&mut units)
                    .for_each(|(&b, u)| *u += usize::from(Unit::new(n, b).is_some()));
            }
        }
        let others = seen - numbered;
        // The third coordinate in one byte or two, if that does for nine of ten.
        let bytes = units.iter().position(|&u| 10 * u > 9 * others).map(|k| k + 1);
        if 16 * numbered < seen && bytes.is_none() {
            return None;
        }
        let (mut numbers, mut rest) = (Vec::with_capacity(rows), Vec::with_capacity(rows));
        let on = Ranks::new(values.chunks_exact(stride).map(|row| {
            let n = row[at..].first_chunk().copied().unwrap_or_default();
            let number = directions::number(n);
            match number {
                Some(k) => numbers.push(k),
                None => rest.push(n),
            }
            number.is_some()
        }));
        let numbers = Packed::with_width(directions::BITS, numbers.into_iter().map(u64::from));
        let exact = match bytes {
            None => Exact::Plain(shrunk(rest)),
            Some(bytes) => {
                let (mut two, mut third) = (Vec::with_capacity(rest.len()), Vec::with_capacity(rest.len()));
                let mut escapes = Vec::new();
                for (k, n) in (0u32..).zip(rest) {
                    let unit = Unit::new(n, bytes).unwrap_or_else(|| {
                        escapes.push((k, n));
                        Unit::ESCAPE
                    });
                    two.push(unit.two);
                    third.push(u64::from(unit.third));
                }
                let third = Packed::with_width(8 * bytes as u32, third.into_iter());
                Exact::Unit { two, third, escapes: shrunk(escapes) }
            }
        };
        let others = match stride {
            3 => Vec::new(),
            _ => values
                .chunks_exact(stride)
                .flat_map(|r| r[..at].iter().chain(&r[at + 3..]))
                .copied()
                .collect(),
        };
        Some(Rows { rows, stride, at, others: shrunk(others), on, numbers, exact })
    }

    #[inline]
    fn read(&self, r: usize, out: &mut [f32]) {
        assert!(r < self.rows, "row {r} of {}", self.rows);
        let normal = self.normal(r as u32);
        if self.stride == 3 {
            out.copy_from_slice(&normal);
            return;
        }
        let rest = &self.others[r * (self.stride - 3)..(r + 1) * (self.stride - 3)];
        let (before, behind) = rest.split_at(self.at);
        out[..self.at].copy_from_slice(before);
        out[self.at..self.at + 3].copy_from_slice(&normal);
        out[self.at + 3..].copy_from_slice(behind);
    }

    #[inline]
    fn normal(&self, r: u32) -> [f32; 3] {
        let before = self.on.before(r);
        if self.on.get(r) {
            return directions::direction(self.numbers.get(before as usize) as u32);
        }
        let k = r - before;
        match &self.exact {
            Exact::Plain(v) => v[k as usize],
            Exact::Unit { two, third, escapes } => {
                let unit = Unit { two: two[k as usize], third: third.get(k as usize) as u32 };
                match escapes.binary_search_by_key(&k, |e| e.0) {
                    Ok(at) => escapes[at].1,
                    Err(_) => unit.normal(if third.width() == 8 { 1 } else { 2 }),
                }
            }
        }
    }

    fn plain(&self) -> Vec<f32> {
        let mut all = vec![0.0; self.rows * self.stride];
        all.chunks_exact_mut(self.stride).enumerate().for_each(|(r, row)| self.read(r, row));
        all
    }
}

fn shrunk<T>(mut v: Vec<T>) -> Vec<T> {
    v.shrink_to_fit();
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bits(v: &[f32]) -> Vec<u32> {
        v.iter().map(|x| x.to_bits()).collect()
    }

    fn unit(k: u32) -> [f32; 3] {
        let (a, b) = (k as f32 * 0.618, (k as f32 * 0.37).sin());
        let r = (1.0 - b * b).sqrt();
        [r * a.cos(), r * a.sin(), b]
    }

    /// So many rows of a number, a normal, two numbers.
    fn rows(n: u32, normal: impl Fn(u32) -> [f32; 3]) -> (Vec<f32>, Vec<Channel>) {
        let row = |k: u32| {
            let [x, y, z] = normal(k);
            [k as f32 * 0.1, x, y, z, -0.0, f32::NAN]
        };
        let channels = [(Semantic::Custom("a".into()), 1), (Semantic::Normal, 3), (Semantic::TexCoord(0), 2)];
        let channels = channels
            .into_iter()
            .map(|(semantic, width)| Channel { semantic, width, encoding: Default::default() })
            .collect();
        ((0..n).flat_map(row).collect(), channels)
    }

    #[test]
    fn normals_take_less_and_come_back() {
        let snapped = |k: u32| directions::snapped(unit(k));
        let odd = |k: u32| if k % 50 == 7 { [0.0, -0.0, f32::INFINITY] } else { unit(k) };
        let both = |k: u32| if k & 1 == 0 { snapped(k) } else { odd(k) };
        let long = |k: u32| unit(k).map(|x| x * (1.5 + k as f32));
        let rough = |k: u32| unit(k).map(|x| (x * 1e4).round() / 1e4);
        // Bytes of a normal.
        type Made<'a> = &'a dyn Fn(u32) -> [f32; 3];
        let cases: [(Made<'_>, f64); 5] =
            [(&snapped, 2.8), (&odd, 9.6), (&both, 6.4), (&long, 12.0), (&rough, 10.3)];
        for (k, (normal, bytes)) in cases.into_iter().enumerate() {
            let (plain, channels) = rows(4000, normal);
            let mut v = Values::from(plain.clone());
            v.pack(&channels);
            assert_eq!(bits(&v.numbers()), bits(&plain), "{k}");
            let mut row = [0.0; 6];
            v.read(77, &mut row);
            assert_eq!((bits(&row), bits(&v.row(3999, 6))), (bits(&plain[462..468]), bits(&plain[23994..])));
            let each = v.bytes() as f64 / 4000.0 - 12.0;
            assert!(each <= bytes + 0.1 && v.len() == 24000, "{k}: {each}");
            assert_eq!(bits(v.plain()), bits(&plain));
        }
        let mut none = Values::default();
        none.pack(&rows(0, unit).1);
        assert!(none.is_empty() && none.bytes() < 300);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn whatever_they_are_they_come_back(
            of in prop::collection::vec((any::<[u32; 3]>(), 0u8..4), 0..80),
        ) {
            let normal = |k: u32| {
                let (bits, kind) = of[k as usize];
                let n = bits.map(f32::from_bits);
                let unit = glam::Vec3::from_array(bits.map(|b| b as i32 as f32)).normalize_or_zero().to_array();
                match kind { 0 => n, 1 => unit, 2 => directions::snapped(unit), _ => unit.map(|x| x * 1.00001) }
            };
            let (plain, channels) = rows(of.len() as u32, normal);
            let mut v = Values::from(plain.clone());
            v.pack(&channels);
            prop_assert_eq!(bits(&v.numbers()), bits(&plain));
        }
    }
}
