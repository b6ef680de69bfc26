//! What splits need by the ring rule beside what their cuts do.
//!
//! Most of it is in the same chunk, a turn or a few earlier, and near: so a need is told by how many turns earlier it is, and which it is of the splits of that turn, counted from where the split itself would
//! stand among them in the order of descent. On bunny that takes 9 bits, where the distance by number takes 12.

use super::super::coder::{Bit, Coder, Number};
use crate::aif::NONE;

/// A list for each split of a chunk.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Lists {
    /// Where each begins, and the end of the last; empty if there are no lists.
    pub(crate) starts: Vec<u32>,
    pub(crate) on: Vec<u32>,
    /// The turn of each split: what it needs has earlier ones, or is in earlier chunks.
    pub(crate) turns: Vec<u32>,
}

impl Lists {
    /// Lists, empty ones counted.
    pub(crate) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// That of split `k` of the chunk.
    #[inline]
    pub(crate) fn of(&self, k: usize) -> &[u32] {
        match self.starts.get(k..k + 2) {
            Some(&[from, to]) => self.on.get(from as usize..to as usize).unwrap_or_default(),
            _ => &[],
        }
    }
}

/// Bytes that reading them takes a split, on the way.
pub(super) const SCRATCH: u64 = 32;

/// Needs of a split whose turns have models of their own.
const FIRST: usize = 3;

#[derive(Default)]
struct Codec {
    count: Number,
    inside: [Bit; FIRST],
    turns: [Number; FIRST],
    rank: [Number; FIRST],
    far: Number,
}

/// The splits of a chunk in the order of descent: those of a vertex and of what comes of it side by side.
fn descent((n0, first): (u32, u32), parents: &[u32]) -> Vec<u32> {
    let maker = |p: u32| p.checked_sub(n0).and_then(|k| (k / 2).checked_sub(first)).map(|k| k as usize);
    // The first below each, and the next of the same above; the last entry is what has none above.
    let mut below = vec![NONE; parents.len() + 1];
    let mut next = vec![NONE; parents.len()];
    for (k, &p) in parents.iter().enumerate().rev() {
        let of = &mut below[maker(p).unwrap_or(parents.len()).min(parents.len())];
        next[k] = std::mem::replace(of, k as u32);
    }
    let (mut place, mut count) = (vec![0; parents.len()], 0);
    let mut stack = vec![below[parents.len()]];
    while let Some(k) = stack.pop() {
        let Some(at) = place.get_mut(k as usize) else { continue };
        *at = count;
        count += 1;
        stack.push(next[k as usize]);
        stack.push(below[k as usize]);
    }
    place
}

/// Splits by turns, those of one in the order of descent.
struct Turns<'a> {
    of: &'a [u32],
    place: Vec<u32>,
    sorted: Vec<u32>,
}

impl<'a> Turns<'a> {
    fn new(of: &'a [u32], place: Vec<u32>) -> Self {
        let mut sorted: Vec<u32> = (0..of.len() as u32).collect();
        sorted.sort_unstable_by_key(|&k| (of[k as usize], place[k as usize]));
        Turns { of, place, sorted }
    }

    /// Where split `k` would stand among those of a turn.
    fn stand(&self, k: usize, turn: u32) -> i64 {
        let key = (turn, self.place[k]);
        self.sorted.partition_point(|&o| (self.of[o as usize], self.place[o as usize]) < key) as i64
    }

    /// The split at a place, if it is one of that turn.
    fn at(&self, place: i64, turn: u32) -> Option<u32> {
        let k = *self.sorted.get(usize::try_from(place).ok()?)?;
        (self.of[k as usize] == turn).then_some(k)
    }
}

/// Codes what the splits from `first` on, whose parents and turns are given, need, `most` in all; `needs` says it when they are written. `None`: damage.
pub(super) fn code<'s, C: Coder>(
    c: &mut C,
    (n0, first): (u32, u32),
    parents: &[u32],
    turns: &[u32],
    most: u64,
    needs: impl Fn(u32) -> &'s [u32],
) -> Option<Lists> {
    let by_turn = Turns::new(turns, descent((n0, first), parents));
    let mut codec = Codec::default();
    let mut out =
        Lists { starts: Vec::with_capacity(turns.len() + 1), turns: turns.to_vec(), ..Lists::default() };
    out.starts.push(0);
    let mut far = first;
    // Those of the chunk, the latest turn first; then the others, the latest first.
    let mut of: Vec<(u32, u32)> = Vec::new();
    for (k, &turn) in turns.iter().enumerate() {
        of.clear();
        for &d in needs(first + k as u32) {
            let here = d.checked_sub(first).map(|j| turns.get(j as usize).and_then(|&t| turn.checked_sub(t)));
            match here {
                Some(earlier) => of.push((earlier.filter(|&e| e > 0)?, d)),
                None => of.push((NONE, d)),
            }
        }
        of.sort_unstable_by_key(|&(earlier, d)| (earlier, !d));
        let count = c.number(&mut codec.count, of.len() as u64);
        // A need may take next to nothing of the stream.
        if count > most.saturating_sub(out.on.len() as u64) {
            return None;
        }
        let (mut inside, mut before) = (true, 0u32);
        for j in 0..count {
            let model = (j as usize).min(FIRST - 1);
            let (earlier, d) = of.get(j as usize).copied().unwrap_or_default();
            inside = inside && c.bit(&mut codec.inside[model], earlier != NONE);
            let d = if inside {
                let more = c.number(&mut codec.turns[model], earlier.wrapping_sub(before).into());
                before = before.checked_add(u32::try_from(more).ok()?)?;
                let then = turn.checked_sub(before).filter(|_| before > 0)?;
                let stand = by_turn.stand(k, then);
                let rank = match C::READS {
                    true => 0,
                    false => by_turn.stand((d - first) as usize, then) - stand,
                };
                let rank = c.signed(&mut codec.rank[model], rank);
                first + by_turn.at(stand.checked_add(rank)?, then)?
            } else {
                let step = c.signed(&mut codec.far, d as i64 - far as i64);
                far = u32::try_from((far as i64).checked_add(step)?).ok().filter(|&d| d < first)?;
                far
            };
            out.on.push(d);
            if c.spent() {
                return None;
            }
        }
        out.starts.push(u32::try_from(out.on.len()).ok()?);
        if c.spent() {
            return None;
        }
    }
    out.on.shrink_to_fit();
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::super::super::coder::{Decoder, Encoder};
    use super::*;
    use proptest::prelude::*;

    const N0: u32 = 3;

    fn read(bytes: &[u8], first: u32, parents: &[u32], turns: &[u32]) -> Option<Lists> {
        code(&mut Decoder::new(bytes)?, (N0, first), parents, turns, u32::MAX.into(), |_| &[])
    }

    proptest! {
        #[test]
        fn lists_come_back_whatever_needs_what(
            first in 0u32..50,
            splits in prop::collection::vec((any::<prop::sample::Index>(), any::<bool>(), 1u32..9), 1..80),
            picks in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>()), 0..160),
        ) {
            // Parents are nodes made before in the chunk, or any before it.
            let parent = |(k, s): (usize, &(prop::sample::Index, bool, u32))| match s.0.index(k + 1) {
                j if j < k => N0 + 2 * (first + j as u32) + u32::from(s.1),
                _ => s.0.index(N0 as usize + 2 * first as usize) as u32,
            };
            let parents: Vec<u32> = splits.iter().enumerate().map(parent).collect();
            let turns: Vec<u32> = splits.iter().map(|s| s.2).collect();
            let mut needs = vec![Vec::new(); splits.len()];
            for (k, d) in &picks {
                let k = k.index(splits.len());
                let d = d.index(first as usize + splits.len()) as u32;
                let may = d < first || turns[(d - first) as usize] < turns[k];
                if may && !needs[k].contains(&d) {
                    needs[k].push(d);
                }
            }
            let mut e = Encoder::default();
            let of = |i: u32| &needs[(i - first) as usize][..];
            let wrote = code(&mut e, (N0, first), &parents, &turns, u32::MAX.into(), of).unwrap();
            let mut bytes = Vec::new();
            e.finish(&mut bytes);
            let lists = read(&bytes, first, &parents, &turns).unwrap();
            prop_assert_eq!(&lists, &wrote);
            prop_assert_eq!((lists.len(), &lists.turns), (splits.len(), &turns));
            for (k, needs) in needs.iter_mut().enumerate() {
                let mut own = lists.of(k).to_vec();
                own.sort_unstable();
                needs.sort_unstable();
                prop_assert_eq!(&own, needs);
            }
            // Every place once.
            let mut place = descent((N0, first), &parents);
            place.sort_unstable();
            prop_assert!(place.iter().copied().eq(0..splits.len() as u32));
        }

        #[test]
        fn any_bytes_give_needs_of_earlier_turns_or_chunks_or_nothing(
            bytes in prop::collection::vec(any::<u8>(), 0..300),
            first in 0u32..50,
            turns in prop::collection::vec(prop_oneof![0u32..5, any::<u32>()], 1..40),
        ) {
            let parents = vec![0; turns.len()];
            // A stream: the length of its decisions first.
            let long = [vec![(bytes.len() / 2).min(127) as u8], bytes].concat();
            if let Some(lists) = read(&long, first, &parents, &turns) {
                for (k, &turn) in turns.iter().enumerate() {
                    let fine = |d: u32| d < first || turns[(d - first) as usize] < turn;
                    prop_assert!(lists.of(k).iter().all(|&d| fine(d)));
                }
            }
        }
    }

    /// What a hostile writer says of the first of three splits, of turns 2, 1 and 2, that are split 10 and those behind it.
    fn said(say: impl Fn(&mut Encoder, &mut Codec)) -> Option<Lists> {
        let (mut e, mut codec) = (Encoder::default(), Codec::default());
        e.number(&mut codec.count, 1);
        say(&mut e, &mut codec);
        (0..2).for_each(|_| _ = e.number(&mut codec.count, 0));
        let mut bytes = Vec::new();
        e.finish(&mut bytes);
        read(&bytes, 10, &[0; 3], &[2, 1, 2])
    }

    #[test]
    fn what_cannot_be_needed_is_refused() {
        let inside = |earlier: u64, rank: i64| {
            said(|e, c| {
                e.bit(&mut c.inside[0], true);
                e.number(&mut c.turns[0], earlier);
                e.signed(&mut c.rank[0], rank);
            })
        };
        assert_eq!(inside(1, 0).unwrap().of(0), [11]);
        // Itself, another of its turn, other turns, none.
        for (earlier, rank) in [(0, 0), (0, 1), (1, 1), (1, -1), (2, 0), (3, 0), (1 << 40, 0), (1, i64::MAX)]
        {
            assert_eq!(inside(earlier, rank), None, "{earlier} {rank}");
        }
        let far = |step: i64| {
            said(|e, c| {
                e.bit(&mut c.inside[0], false);
                e.signed(&mut c.far, step);
            })
        };
        assert_eq!(far(-3).unwrap().of(0), [7]);
        // Itself, later ones, none.
        for step in [0, 1, 1 << 33, -11, i64::MIN, i64::MAX] {
            assert_eq!(far(step), None, "{step}");
        }
        // Nor is it written.
        for d in [10, 12, 13] {
            let mut e = Encoder::default();
            let list = [d];
            let needs = |i: u32| if i == 10 { &list[..] } else { &[] };
            assert_eq!(code(&mut e, (N0, 10), &[0; 3], &[2, 1, 2], u32::MAX.into(), needs), None);
        }
    }

    /// What is needed again and again takes next to nothing of a stream: the directory says how much it may be.
    #[test]
    fn no_more_is_read_than_is_announced() {
        let n = 1 << 18;
        let (mut e, mut codec) = (Encoder::default(), Codec::default());
        e.number(&mut codec.count, n);
        e.bit(&mut codec.inside[0], false);
        e.signed(&mut codec.far, -1);
        (1..n).for_each(|_| _ = e.signed(&mut codec.far, 0));
        let mut bytes = Vec::new();
        e.finish(&mut bytes);
        let read = |most| code(&mut Decoder::new(&bytes).unwrap(), (N0, 10), &[0], &[2], most, |_| &[]);
        assert!(bytes.len() < 1000 && read(n).unwrap().of(0).len() == 1 << 18);
        assert_eq!(read(n - 1), None);
    }
}
