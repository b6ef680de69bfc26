//! Bounds of the splits of a chunk, each expected to be like that of the split before.

use super::coder::{Coder, Decoder, Encoder, Number};
use crate::hierarchy::{Bounds, Cone, Direction, Guarantee, Packed};
use glam::DVec3;
use std::ops::Range;

/// Bytes in memory of the bounds of so many splits.
pub(super) fn raw_bytes(guarantee: Guarantee, directed: bool, splits: usize) -> u64 {
    32 + (8 + 4 * (guarantee == Guarantee::Settled) as u64 + 2 * directed as u64) * splits as u64
}

/// With this in the first byte it is known which way deviations lie.
const DIRECTED: u8 = 0x10;

/// The parts of a split's bounds: error, radius, axis, angle.
pub(super) type Parts = [u32; 5];

pub(super) fn parts(b: Packed) -> Parts {
    let c = b.cone.0;
    [b.error as u32, b.radius as u32, c & 0x3ff, c >> 10 & 0x3ff, c >> 20]
}

pub(super) fn packed([error, radius, x, y, angle]: Parts) -> Packed {
    Packed { error: error as u16, radius: radius as u16, cone: Cone(x | y << 10 | angle << 20) }
}

/// Bits of each part.
const BITS: [u32; 5] = [16, 16, 10, 10, 12];

pub(super) fn code<C: Coder>(c: &mut C, models: &mut [Number; 5], last: &mut Parts, value: Parts) {
    for k in 0..5 {
        // Differences wrap around, so that whatever is read is in range.
        let shift = 32 - BITS[k];
        let difference = (value[k].wrapping_sub(last[k]) << shift) as i32 >> shift;
        let difference = c.signed(&mut models[k], difference as i64);
        last[k] = last[k].wrapping_add(difference as u32) & ((1 << BITS[k]) - 1);
    }
}

#[derive(Default)]
struct Turn {
    model: Number,
    last: u32,
}

impl Turn {
    fn code<C: Coder>(&mut self, c: &mut C, value: u32) -> u32 {
        let difference = c.signed(&mut self.model, value as i64 - self.last as i64);
        self.last = (self.last as i64).wrapping_add(difference) as u32;
        self.last
    }
}

/// Axes and sines, each expected to be those before.
#[derive(Default)]
struct Directions {
    models: [Number; 3],
    last: u16,
}

impl Directions {
    fn code<C: Coder>(&mut self, c: &mut C, value: Direction) -> Direction {
        let mut next = 0;
        for (model, (at, bits)) in self.models.iter_mut().zip([(0, 5), (5, 5), (10, 6)]) {
            let part = |of: u16| u32::from(of >> at) & ((1 << bits) - 1);
            let shift = 32 - bits;
            let difference = (part(value.0).wrapping_sub(part(self.last)) << shift) as i32 >> shift;
            let difference = c.signed(model, difference as i64);
            next |= (part(self.last).wrapping_add(difference as u32) & ((1 << bits) - 1)) << at;
        }
        self.last = next as u16;
        Direction(self.last)
    }
}

/// The bytes of a chunk.
pub(super) fn write(bounds: &Bounds, range: Range<usize>) -> Option<Vec<u8>> {
    let (origin, diagonal) = bounds.extent();
    let directed = bounds.is_directed();
    let mut out = vec![bounds.guarantee().code() | if directed { DIRECTED } else { 0 }];
    for x in origin.to_array().into_iter().chain([diagonal]) {
        out.extend_from_slice(&x.to_le_bytes());
    }
    let mut e = Encoder::default();
    let (mut models, mut last) = Default::default();
    let (mut turn, mut directions) = (Turn::default(), Directions::default());
    for (&b, i) in bounds.of.get(range.clone())?.iter().zip(range) {
        code(&mut e, &mut models, &mut last, parts(b));
        if bounds.guarantee() == Guarantee::Settled {
            turn.code(&mut e, *bounds.turns.get(i)?);
        }
        if directed {
            directions.code(&mut e, *bounds.directions.get(i)?);
        }
    }
    e.finish(&mut out);
    Some(out)
}

/// The bounds of `count` splits; `None` for damage.
pub(super) fn read(bytes: &[u8], count: usize, raw: u64) -> Option<Bounds> {
    let (&[guarantee], rest) = bytes.split_first_chunk::<1>()?;
    let (head, stream) = rest.split_first_chunk::<32>()?;
    let [x, y, z, diagonal] = [0, 1, 2, 3].map(|k| {
        let mut eight = [0; 8];
        eight.copy_from_slice(&head[8 * k..8 * k + 8]);
        f64::from_le_bytes(eight)
    });
    let origin = DVec3::new(x, y, z);
    let directed = guarantee & DIRECTED != 0;
    let guarantee = Guarantee::from_code(guarantee & !DIRECTED)?;
    if raw != raw_bytes(guarantee, directed, count)
        || !origin.is_finite()
        || !(diagonal.is_finite() && diagonal >= 0.0)
    {
        return None;
    }
    let mut d = Decoder::new(stream)?;
    let (mut models, mut last) = Default::default();
    // The directory promises no more than 64 times the bytes that are there.
    let mut of = Vec::with_capacity(count);
    let (mut turns, mut turn) = (Vec::new(), Turn::default());
    let (mut directions, mut direction) = (Vec::new(), Directions::default());
    for _ in 0..count {
        code(&mut d, &mut models, &mut last, Parts::default());
        of.push(packed(last));
        if guarantee == Guarantee::Settled {
            turns.push(turn.code(&mut d, 0));
        }
        if directed {
            directions.push(direction.code(&mut d, Direction::ANY));
        }
        if d.spent() {
            return None;
        }
    }
    Some(Bounds { origin, diagonal, guarantee, of, turns, directions })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_was_written_is_read_and_less_is_damage(
            of in prop::collection::vec((any::<u16>(), any::<u16>(), any::<u32>()), 1..60),
            (code, directed) in (0u8..4, any::<bool>()),
            origin in prop::array::uniform3(-1e9..1e9f64),
            from in 0usize..60,
        ) {
            let packed = |&(error, radius, cone): &(u16, u16, u32)| Packed { error, radius, cone: Cone(cone) };
            let bounds = Bounds {
                directions: of.iter().filter(|_| directed).map(|b| Direction(b.0)).collect(),
                origin: DVec3::from_array(origin),
                diagonal: 7.5,
                guarantee: Guarantee::from_code(code).unwrap(),
                of: of.iter().map(packed).collect(),
                turns: of.iter().filter(|_| code == 3).map(|b| b.2).collect(),
            };
            let range = from.min(of.len() - 1)..of.len();
            let bytes = write(&bounds, range.clone()).unwrap();
            let raw = raw_bytes(bounds.guarantee, directed, range.len());
            prop_assert_eq!(read(&bytes, range.len(), raw), Some(bounds.slice(range.clone())));
            let more = raw_bytes(bounds.guarantee, directed, range.len() + 200);
            prop_assert_eq!(read(&bytes, range.len() + 200, more), None);
            prop_assert_eq!(read(&bytes, range.len(), raw_bytes(bounds.guarantee, !directed, range.len())), None);
            prop_assert_eq!(read(&bytes, range.len(), raw + 1), None);
            for end in 0..33 {
                prop_assert_eq!(read(&bytes[..end], range.len(), raw), None);
            }
            prop_assert_eq!(write(&bounds, 0..of.len() + 1), None);
        }
    }
}
