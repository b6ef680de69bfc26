//! What is learned about the references of a chunk, and what is remembered of those before.

use super::super::coder::{Bit, Coder, Number};

/// Ranks beyond are written as numbers.
pub(super) const RANKS: usize = 24;
pub(super) const RINGS: usize = 12;
/// Remembered references to older faces.
const RECENT: usize = 16;

pub(super) struct Models {
    pub(super) split: [Bit; 24],
    pub(super) done: [Bit; 8],
    pub(super) roots: Number,
    pub(super) root: Number,
    pub(super) rest_same: Bit,
    pub(super) rest: Number,
    pub(super) moves: [Bit; 3],
    pub(super) starts: [Bit; 6],
    pub(super) inner: [Bit; 8],
    pub(super) known: [Bit; 2 * RINGS],
    pub(super) rank: Vec<Bit>,
    pub(super) far: Number,
    pub(super) young: [Bit; 2],
    pub(super) young_split: Near,
    pub(super) young_second: Bit,
    pub(super) edge: [Bit; 4],
    pub(super) base: Bit,
    pub(super) base_face: Number,
    pub(super) own: Bit,
    pub(super) second: [Bit; 3],
    pub(super) old_edge: [Bit; 24],
    pub(super) old_starts: [Bit; 24],
    pub(super) distance: Near,
    pub(super) gap: Vec<Bit>,
}

impl Default for Models {
    fn default() -> Self {
        Models {
            split: Default::default(),
            done: Default::default(),
            roots: Number::default(),
            root: Number::default(),
            rest_same: Bit::default(),
            rest: Number::default(),
            moves: Default::default(),
            starts: Default::default(),
            inner: Default::default(),
            known: Default::default(),
            rank: vec![Bit::default(); 2 * RINGS * RANKS],
            far: Number::default(),
            young: Default::default(),
            young_split: Near::default(),
            young_second: Bit::default(),
            edge: Default::default(),
            base: Bit::default(),
            base_face: Number::default(),
            own: Bit::default(),
            second: Default::default(),
            old_edge: Default::default(),
            old_starts: Default::default(),
            distance: Near::default(),
            gap: vec![Bit::default(); RINGS * RANKS],
        }
    }
}

/// References named last, the latest first.
#[derive(Clone, Debug, Default)]
pub(super) struct Recent(pub(super) [i64; RECENT]);

/// What is known of distances from references named before.
#[derive(Clone, Debug, Default)]
pub(super) struct Near {
    which: [Bit; RECENT + 1],
    /// From the own one, from the last, from others.
    distance: [Number; 3],
}

impl Recent {
    /// A number by its distance from `own` or from one of the last.
    pub(super) fn code<C: Coder>(&mut self, c: &mut C, m: &mut Near, own: i64, value: i64) -> i64 {
        let candidate = |k: usize| if k == 0 { own } else { self.0[k - 1] };
        let best = if C::READS {
            0
        } else {
            (0..=RECENT).min_by_key(|&k| ((value - candidate(k)).unsigned_abs(), k)).unwrap_or(0)
        };
        let mut which = 0;
        while which < RECENT && !c.bit(&mut m.which[which], which == best) {
            which += 1;
        }
        let guess = candidate(which);
        let found = guess.wrapping_add(c.signed(&mut m.distance[which.min(2)], value.wrapping_sub(guess)));
        self.0.copy_within(0..which.saturating_sub(1), 1);
        if which == 0 {
            self.0.copy_within(0..RECENT - 1, 1);
        }
        self.0[0] = found;
        found
    }
}

/// A rank below `choices`: one decision after the other.
pub(super) fn code_rank<C: Coder>(
    c: &mut C,
    models: &mut [Bit],
    far: &mut Number,
    choices: usize,
    value: usize,
) -> Option<usize> {
    let decisions = choices.saturating_sub(1);
    let near = decisions.min(RANKS - 1);
    for (i, model) in models.iter_mut().enumerate().take(near) {
        if c.bit(model, value == i) {
            return Some(i);
        }
    }
    if decisions > near {
        let rest = c.number(far, (value - near.min(value)) as u64);
        return usize::try_from(rest).ok()?.checked_add(near).filter(|&r| r < choices);
    }
    Some(choices.saturating_sub(1))
}
