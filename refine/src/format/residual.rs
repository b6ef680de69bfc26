//! Positions whose surroundings are known: residuals in the frame of the surface there.
//!
//! As [`super::places`], but the size of a residual is not learned for a whole chunk. Across the surface it is coded against how far the ring reaches; the coordinate along which the
//! surface rises most steeply comes last and is expected on the plane of the ring through the others, so that what is left of it is the distance from that plane: which the error of the
//! split has told already, roughly.

use super::coder::{Bit, Coder, Nibble, Number, low_mask, unzigzag, zigzag};
use super::places::{Lattice, order32, order64, unorder32, unorder64};

/// What a place is expected to be.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Guess {
    pub(super) at: [f64; 3],
    /// How far its surroundings reach along each axis.
    pub(super) reach: [f32; 3],
    /// Their plane, through any place p: the sum of slope (x - p) over the axes is 0; 1 for the last of `axes`, and no more for the others.
    pub(super) slope: [f32; 3],
    /// How far they reach from the plane through `at`, along the last axis.
    pub(super) rise: f32,
    /// The order in which coordinates are coded.
    pub(super) axes: [usize; 3],
}

/// Orders of axes, by the last.
const ORDERS: [[usize; 3]; 3] = [[1, 2, 0], [0, 2, 1], [0, 1, 2]];

impl Guess {
    /// Sets the plane by its normal.
    #[inline(always)]
    pub(super) fn lay(&mut self, normal: [f32; 3]) {
        let [x, y, z] = [normal[0].abs(), normal[1].abs(), normal[2].abs()];
        // No branch: it is any of them.
        let last = (!((x > y) & (x > z)) as usize) * (2 - (y > z) as usize);
        self.axes = ORDERS[last];
        let n = 1.0 / normal[last];
        self.slope = [normal[0] * n, normal[1] * n, normal[2] * n];
        self.slope[last] = 1.0;
        let flat = self.slope.iter().all(|s| s.abs() <= 1.0);
        if !flat {
            // No plane: all in one place, or too far away.
            self.axes = ORDERS[2];
            self.slope = [0.0, 0.0, 1.0];
        }
    }

    /// How far off the plane something that is `d` from a place on it lies, along the last axis.
    #[inline(always)]
    pub(super) fn off(&self, d: [f32; 3]) -> f32 {
        self.slope[0] * d[0] + self.slope[1] * d[1] + self.slope[2] * d[2]
    }

    /// The last coordinate on the plane through `at`, given the others.
    #[inline(always)]
    pub(super) fn on_plane(&self, x: f64, y: f64) -> f64 {
        let [a, b, last] = self.axes;
        self.at[last] - self.slope[a] as f64 * (x - self.at[a]) - self.slope[b] as f64 * (y - self.at[b])
    }
}

/// The length that a residual is expected to have is in the middle of the symbols.
const MIDDLE: i32 = 9;
/// Lengths beyond are written as numbers.
const FAR: u32 = 15;
/// Classes of how much flatter than long the surroundings are; of how steep they are against the error.
const FLAT: usize = 3;
const STEEP: usize = 8;
/// All contexts of lengths.
const CONTEXTS: usize = 2 * FLAT + STEEP;

/// Codes positions of one chunk; `KINDS` kinds of them.
#[derive(Clone, Debug)]
pub(super) struct Residuals<const KINDS: usize> {
    double: bool,
    /// With half octaves of what a step makes, and steps in a unit.
    lattices: Vec<(Lattice, i32, f64)>,
    on_lattice: [Bit; KINDS],
    second: [Bit; KINDS],
    /// By kind, lattice or none, context, half of the octave.
    length: Vec<[[Nibble; 2]; CONTEXTS]>,
    far: Number,
}

/// Half octaves of a positive number, rounded down.
#[inline(always)]
pub(super) fn halves(x: f32) -> i32 {
    (x.to_bits() >> 22) as i32 - (127 << 1)
}

/// The same of a number that may be too large or too small for the other.
fn halves_of_step(x: f64) -> i32 {
    (x.to_bits() >> 51) as i32 - (1023 << 1)
}

/// Coordinates as integers, such that those that can occur are near each other.
trait Scale {
    /// The integer of an expected coordinate, and half octaves of what a step makes there.
    fn number(&self, axis: usize, x: f64) -> (i64, i32);
    /// The integer of a coordinate.
    fn exactly(&self, axis: usize, x: f64) -> i64;
    /// The coordinate.
    fn at(&self, axis: usize, k: i64) -> f64;
    /// A difference.
    fn wrap(&self, x: i64) -> i64;
}

struct Grid {
    lattice: Lattice,
    unit: i32,
    steps: f64,
    double: bool,
}

impl Scale for Grid {
    #[inline(always)]
    fn exactly(&self, axis: usize, x: f64) -> i64 {
        self.lattice.nearest(axis, x)
    }

    #[inline(always)]
    fn number(&self, axis: usize, x: f64) -> (i64, i32) {
        (whole((x - self.lattice.origin[axis]) * self.steps), self.unit)
    }

    #[inline(always)]
    fn at(&self, axis: usize, k: i64) -> f64 {
        let x = self.lattice.at(axis, k);
        if self.double { x } else { x as f32 as f64 }
    }

    #[inline(always)]
    fn wrap(&self, x: i64) -> i64 {
        x
    }
}

struct Single;

impl Scale for Single {
    #[inline(always)]
    fn exactly(&self, _: usize, x: f64) -> i64 {
        order32((x as f32).to_bits()) as i64
    }

    #[inline(always)]
    fn number(&self, _: usize, x: f64) -> (i64, i32) {
        let bits = (finite(x) as f32).to_bits();
        (order32(bits) as i64, 2 * ((bits >> 23) as i32 & 0xFF) - 300)
    }

    #[inline(always)]
    fn at(&self, _: usize, k: i64) -> f64 {
        f32::from_bits(unorder32(k as u32)) as f64
    }

    #[inline(always)]
    fn wrap(&self, x: i64) -> i64 {
        x as i32 as i64
    }
}

struct Double;

impl Scale for Double {
    #[inline(always)]
    fn exactly(&self, _: usize, x: f64) -> i64 {
        order64(x.to_bits()) as i64
    }

    #[inline(always)]
    fn number(&self, _: usize, x: f64) -> (i64, i32) {
        let bits = finite(x).to_bits();
        (order64(bits) as i64, 2 * ((bits >> 52) as i32 & 0x7FF) - 2150)
    }

    #[inline(always)]
    fn at(&self, _: usize, k: i64) -> f64 {
        f64::from_bits(unorder64(k as u64))
    }

    #[inline(always)]
    fn wrap(&self, x: i64) -> i64 {
        x
    }
}

impl<const KINDS: usize> Residuals<KINDS> {
    pub(super) fn new(double: bool, lattices: &[Lattice]) -> Self {
        let nibbles = [[Nibble::default(); 2]; CONTEXTS];
        Residuals {
            double,
            lattices: lattices
                .iter()
                .map(|l| (*l, halves_of_step(l.step / l.parts) & !1, l.parts / l.step))
                .collect(),
            on_lattice: [Bit::default(); KINDS],
            second: [Bit::default(); KINDS],
            length: vec![nibbles; KINDS * (1 + lattices.len())],
            far: Number::default(),
        }
    }

    /// Codes `value`, a place of kind `kind` of a split with an error of level `level`, given where it is expected.
    #[inline]
    pub(super) fn code<C: Coder>(
        &mut self,
        c: &mut C,
        kind: usize,
        (guess, level): (&Guess, u16),
        value: [f64; 3],
    ) -> [f64; 3] {
        let set = kind * (1 + self.lattices.len());
        if !self.lattices.is_empty() {
            let (double, lattices) = (self.double, &self.lattices);
            let found = if C::READS {
                None
            } else {
                lattices.iter().position(|(l, ..)| l.indices(double, value).is_some())
            };
            if c.bit(&mut self.on_lattice[kind], found.is_some()) {
                let mut which = found.unwrap_or_default();
                if self.lattices.len() > 1 {
                    which = c.bit(&mut self.second[kind], which == 1) as usize;
                }
                let (lattice, unit, steps) = self.lattices[which];
                let grid = Grid { lattice, unit, steps, double: self.double };
                return self.three(c, &grid, set + 1 + which, (guess, level), value);
            }
        }
        if self.double {
            self.three(c, &Double, set, (guess, level), value)
        } else {
            self.three(c, &Single, set, (guess, level), value)
        }
    }

    /// The three coordinates.
    #[inline(always)]
    fn three<C: Coder, S: Scale>(
        &mut self,
        c: &mut C,
        scale: &S,
        set: usize,
        (guess, level): (&Guess, u16),
        value: [f64; 3],
    ) -> [f64; 3] {
        let [a, b, last] = guess.axes;
        let longest = halves(guess.reach[0].max(guess.reach[1]).max(guess.reach[2]));
        // Half octaves of reach, and flatness.
        let near = |axis: usize| {
            let h = halves(guess.reach[axis]).max(longest - 7);
            (h, (((longest - h) >> 1) as usize).min(FLAT - 1))
        };
        let (h, flat) = near(a);
        let x = self.one(c, scale, (set, flat), (a, guess.at[a], h), value[a]);
        let (h, flat) = near(b);
        let y = self.one(c, scale, (set, FLAT + flat), (b, guess.at[b], h), value[b]);
        // On the plane through both.
        let expected = guess.on_plane(x, y);
        let rise = halves(guess.rise).clamp(longest - 24, longest + 2);
        let steep = guess.slope[a] * guess.slope[a] + guess.slope[b] * guess.slope[b] >= 1.0;
        let error = if level > 0 { level as i32 - 254 + steep as i32 } else { rise - 4 };
        let error = error.clamp(longest - 24, longest + 2);
        let context = 2 * FLAT + (((rise - error).clamp(-4, 11) + 4) >> 1) as usize;
        let z = self.one(c, scale, (set, context), (last, expected, error), value[last]);
        let mut place = [z; 3];
        (place[a], place[b]) = (x, y);
        place
    }

    /// One coordinate.
    #[inline(always)]
    fn one<C: Coder, S: Scale>(
        &mut self,
        c: &mut C,
        scale: &S,
        context: (usize, usize),
        (axis, expected, reach): (usize, f64, i32),
        value: f64,
    ) -> f64 {
        let (guess, unit) = scale.number(axis, expected);
        let want = if C::READS { 0 } else { scale.exactly(axis, value) };
        let residual = scale.wrap(want.wrapping_sub(guess));
        let residual = self.residual(c, context, reach - unit, residual);
        scale.at(axis, guess.wrapping_add(residual))
    }

    /// A residual that is expected to be about 2^(reach / 2) long.
    #[inline(always)]
    fn residual<C: Coder>(&mut self, c: &mut C, (set, context): (usize, usize), reach: i32, x: i64) -> i64 {
        let reach = reach.clamp(-3, 128);
        let x = zigzag(x);
        let length = 64 - x.leading_zeros();
        let shift = (reach >> 1) - MIDDLE;
        let model = &mut self.length[set][context][(reach & 1) as usize];
        let near = length as i32 - shift;
        let symbol = c.nibble(model, if (0..FAR as i32).contains(&near) { near as u32 } else { FAR });
        if symbol == FAR {
            return c.signed(&mut self.far, unzigzag(x));
        }
        let length = symbol as i32 + shift;
        if length <= 1 {
            return unzigzag((length == 1) as u64);
        }
        let rest = (length as u32).min(64) - 1;
        unzigzag(1 << rest | c.plain64(rest, x & low_mask(rest)))
    }
}

/// 0 for what is not.
#[inline(always)]
fn finite(x: f64) -> f64 {
    if x.abs() < f64::INFINITY { x } else { 0.0 }
}

/// The nearest whole number, the even one of two; 0 where it is not below 2^51.
#[inline(always)]
fn whole(x: f64) -> i64 {
    // From 2^52 on numbers have no fraction: the sum rounds it off, and its low bits are what was added.
    const ROUND: f64 = 1.5 * (1u64 << 52) as f64;
    if x.abs() < (1u64 << 51) as f64 { (x + ROUND).to_bits() as i64 - ROUND.to_bits() as i64 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::super::coder::{Decoder, Encoder};
    use super::*;
    use proptest::prelude::*;

    /// Coordinates of all sizes, and what is no number.
    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![
            8 => -2.0..2.0f64,
            1 => any::<f32>().prop_map(f64::from),
            1 => (-40..40i32).prop_map(|e| (e as f64).exp2()),
            1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY)],
        ]
    }

    fn point() -> impl Strategy<Value = [f64; 3]> {
        [coordinate(), coordinate(), coordinate()]
    }

    fn guess() -> impl Strategy<Value = Guess> {
        (point(), point(), point(), coordinate()).prop_map(|(at, reach, normal, rise)| {
            let reach = reach.map(|x| x.abs() as f32);
            let mut g = Guess { at, reach, rise: rise.abs() as f32, ..Guess::default() };
            g.lay(normal.map(|x| x as f32));
            g
        })
    }

    fn run<C: Coder>(
        c: &mut C,
        r: &mut Residuals<3>,
        items: &[(usize, Guess, u16, [f64; 3])],
    ) -> Vec<[u64; 3]> {
        items.iter().map(|(kind, g, level, p)| r.code(c, *kind, (g, *level), *p).map(f64::to_bits)).collect()
    }

    proptest! {
        #[test]
        fn places_return_whatever_was_expected(
            items in prop::collection::vec((0..3usize, guess(), 0..0x200u16, point()), 0..40),
            double in any::<bool>(),
            lattices in 0..3usize,
            on in prop::collection::vec(any::<bool>(), 40),
        ) {
            let all = [
                Lattice { origin: [0.1, -3.0, 0.0], step: 0.001, parts: 1.0 },
                Lattice { origin: [0.0; 3], step: 1.0, parts: 1000.0 },
            ];
            let items: Vec<_> = items
                .into_iter()
                .zip(&on)
                .map(|((kind, g, level, p), on)| {
                    let l = &all[kind % 2];
                    let p = if *on { std::array::from_fn(|a| l.at(a, l.nearest(a, p[a]))) } else { p };
                    (kind, g, level, if double { p } else { p.map(|x| x as f32 as f64) })
                })
                .collect();
            let new = || Residuals::<3>::new(double, &all[..lattices]);
            let mut e = Encoder::default();
            let written = run(&mut e, &mut new(), &items);
            let want: Vec<_> = items.iter().map(|i| i.3.map(f64::to_bits)).collect();
            prop_assert_eq!(&written, &want);
            let mut bytes = Vec::new();
            e.finish(&mut bytes);
            let mut d = Decoder::new(&bytes).unwrap();
            let blank: Vec<_> = items.iter().map(|i| (i.0, i.1, i.2, [0.0; 3])).collect();
            prop_assert_eq!(run(&mut d, &mut new(), &blank), want);
            prop_assert!(!d.spent());
        }

        #[test]
        fn a_plane_rises_no_steeper_than_its_last_axis(normal in point()) {
            let mut g = Guess::default();
            let normal = normal.map(|x| x as f32);
            g.lay(normal);
            let [a, b, last] = g.axes;
            prop_assert!(g.slope[a].abs() <= 1.0 && g.slope[b].abs() <= 1.0 && g.slope[last] == 1.0);
            prop_assert_eq!([a, b, last].iter().sum::<usize>(), 3);
            // Along the plane nothing is off it.
            let d = [normal[1] - normal[2], normal[2] - normal[0], normal[0] - normal[1]];
            let size = d.iter().chain(&normal).fold(0.0f32, |m, x| m.max(x.abs()));
            prop_assert!(!size.is_finite() || g.slope == [0.0, 0.0, 1.0] || g.off(d).abs() <= 1e-5 * size);
        }
    }

    #[test]
    fn on_a_plane_the_last_coordinate_costs_little() {
        // Places on x + 2 y + 3 z = 6, which the guesses know, and beside it.
        let bits = |known: bool| {
            let (mut e, mut r) = (Encoder::default(), Residuals::<3>::new(false, &[]));
            for k in 0..400u32 {
                let (x, y) = ((k * 37 % 101) as f64 / 101.0, (k * 53 % 103) as f64 / 103.0);
                let p = [x, y, (6.0 - x - 2.0 * y) / 3.0].map(|x| x as f32 as f64);
                let mut g = Guess { at: [0.5, 0.5, 1.5], reach: [0.5; 3], rise: 0.5, ..Guess::default() };
                g.lay(if known { [1.0, 2.0, 3.0] } else { [0.0; 3] });
                g.rise = if known { 1e-7 } else { g.rise };
                r.code(&mut e, 0, (&g, 0), p);
            }
            let mut bytes = Vec::new();
            e.finish(&mut bytes);
            8 * bytes.len() / 400
        };
        assert!(bits(true) + 15 < bits(false), "{} and {}", bits(true), bits(false));
    }
}
