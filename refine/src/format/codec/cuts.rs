//! Where a split opens the ring of its vertex.

use super::super::coder::Coder;
use super::super::walk::{Cut, cut, turn};
use super::Codec;
use crate::aif::NONE;
use crate::progressive::SplitCode;

/// Bits of a code that the mesh and the cuts tell.
const TOLD: u16 =
    SplitCode::TWO_FACES | SplitCode::MOVES | SplitCode::L_INNER | SplitCode::L_STARTS | SplitCode::R_INNER;
/// Those that say how corners lie.
const ARRANGEMENT: u16 = 0x3F;
/// Beside the code: the ring runs the other way. Of an open ring, which begins at the border whichever way it is entered, that is a decision of its own.
const TURNED: u32 = 1 << 16;
/// Beside the code: the cuts are named, not counted.
const NAMED: u32 = 1 << 17;

/// The split that a writer wants, in the numbers of its mesh.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Wanted {
    pub(in super::super) vertex: u32,
    pub(in super::super) left: u32,
    pub(in super::super) right: u32,
    pub(in super::super) code: SplitCode,
}

/// A split's cuts, as places in the ring.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cuts {
    pub(super) left: Cut,
    pub(super) right: Cut,
    pub(super) first: usize,
    pub(super) count: usize,
}

impl Codec<'_> {
    /// The code of the split and its cuts.
    pub(super) fn cuts<C: Coder>(
        &mut self,
        c: &mut C,
        (v, state): (u32, u8),
        two: bool,
        wanted: Option<Wanted>,
    ) -> Option<(SplitCode, Cuts)> {
        let start = Some(self.walk.start(v)).filter(|&h| h != NONE)?;
        self.walk.ring(v, start, &mut self.ring)?;
        // At borders codes are others, and each is mostly like the last of its kind.
        let open = !self.ring.closed;
        let kind = two as usize | (open as usize) << 1;
        let mut want = None;
        let (mut rest, mut moves) = (0, false);
        let told = if self.preparing { !ARRANGEMENT } else { TOLD };
        if let Some(w) = wanted {
            (rest, moves) = ((w.code.0 & !told) as u32, !self.preparing && w.code.moves());
            want = self.find(two, w);
            if want.is_none() {
                self.walk.ring(v, turn(start), &mut self.ring)?;
                want = self.find(two, w);
                rest |= if want.is_some() { TURNED } else { NAMED };
            }
        }
        let turned = rest & TURNED != 0;
        if open {
            rest &= !TURNED;
        }
        let (last, moved) = self.last_code[kind];
        if c.bit(&mut self.m.code_same[kind], (rest, moves) == (last, moved)) {
            (rest, moves) = (last, moved);
        } else {
            if !self.preparing {
                moves = c.bit(&mut self.m.moves, moves);
            }
            // What moves otherwise is mostly like it in all else.
            if moves != moved && c.bit(&mut self.m.rest_same, rest == last) {
                rest = last;
            } else {
                rest = u32::try_from(c.number(&mut self.m.rest, rest as u64)).ok()?;
                if open && rest & TURNED != 0 {
                    return None;
                }
            }
            self.last_code[kind] = (rest, moves);
        }
        if open && rest & NAMED == 0 && c.bit(&mut self.m.turned[two as usize], turned) {
            rest |= TURNED;
        }
        let mut code = rest as u16 & !told | if two { SplitCode::TWO_FACES } else { 0 };
        if moves {
            code |= SplitCode::MOVES;
        }
        let cuts = if rest & NAMED != 0 {
            self.named(c, v, two, wanted)?
        } else {
            if C::READS && rest & TURNED != 0 {
                self.walk.ring(v, turn(start), &mut self.ring)?;
            }
            self.counted(c, state, two, want)?
        };
        let (left, inner) = cuts.left.name();
        if left == NONE {
            return None;
        }
        let flag = |on: bool, flag: u16| flag & (on as u16).wrapping_neg();
        code |= flag(inner, SplitCode::L_INNER) | flag(left & 1 == 1, SplitCode::L_STARTS);
        code |= flag(two & cuts.right.name().1, SplitCode::R_INNER);
        self.ring.unroll(cuts.first + cuts.count);
        Some((SplitCode(code), cuts))
    }

    /// Where in the ring the writer's cuts are.
    fn find(&self, two: bool, wanted: Wanted) -> Option<(usize, usize)> {
        let Wanted { left, right, code, .. } = wanted;
        let ring = &self.ring;
        let (faces, edges) = (ring.faces(), ring.edges());
        let left = (left >> 2) << 3 | (left & 3) << 1 | code.left_starts() as u32;
        let first = ring.position(left, code.left_inner())?;
        if ring.left(first).name() != (left, code.left_inner()) {
            return None;
        }
        if !two {
            return (!ring.closed).then_some((first, faces - first));
        }
        let most = if ring.closed { faces - 1 } else { faces - first };
        // The face on the right is left by the cut, or entered by it.
        let entry = ring.entry(right >> 2)?;
        let inner = code.right_inner();
        let at = ring.position(if inner { turn(entry) } else { entry }, !inner)?;
        let count = if at < first { at + edges - first } else { at - first };
        let named = |k: usize| {
            let (h, of) = ring.right(first, k).name();
            cut(h) == right && of == inner
        };
        ((1..=most).contains(&count) && named(count)).then_some((first, count))
    }

    /// Cuts by their places in the ring.
    #[inline]
    fn counted<C: Coder>(
        &mut self,
        c: &mut C,
        state: u8,
        two: bool,
        want: Option<(usize, usize)>,
    ) -> Option<Cuts> {
        let (ring, m) = (&self.ring, &mut *self.m);
        let (faces, n) = (ring.faces(), ring.edges());
        let (left, right) = want.unwrap_or_default();
        // With one face the whole fan may stay.
        let first = c.choice(&mut m.left[state.min(2) as usize], if two { faces } else { n }, left)?;
        let mut count = faces - first;
        if two {
            let most = if ring.closed { faces.checked_sub(1)? } else { count };
            count = 1 + c.choice(&mut m.right, most, right.saturating_sub(1))?;
        } else if ring.closed {
            return None;
        }
        Some(Cuts { left: ring.left(first), right: ring.right(first, count), first, count })
    }

    /// Cuts by the numbers of faces: where the vertex has several fans, or the cuts are not named by the later face.
    fn named<C: Coder>(&mut self, c: &mut C, v: u32, two: bool, wanted: Option<Wanted>) -> Option<Cuts> {
        let (left, mut right, mut code) = wanted.map_or_else(Default::default, |w| (w.left, w.right, w.code));
        let left = u32::try_from(c.number(&mut self.m.named[0], left as u64)).ok()?;
        let inner = c.bit(&mut self.m.inner[0], code.left_inner());
        let starts = c.bit(&mut self.m.inner[1], code.left_starts());
        let half = self.walk.named(left, starts, v)?;
        let begin = if inner {
            half
        } else {
            Some(self.walk.across(half)).filter(|&h| h != NONE).unwrap_or(turn(half))
        };
        self.walk.ring(v, begin, &mut self.ring)?;
        if two {
            right = u32::try_from(c.number(&mut self.m.named[1], right as u64)).ok()?;
            if c.bit(&mut self.m.inner[2], code.right_inner()) {
                code.0 |= SplitCode::R_INNER;
            } else {
                code.0 &= !SplitCode::R_INNER;
            }
        }
        let flags = |on: bool, flag: u16| if on { flag } else { 0 };
        let code = SplitCode(
            code.0 & SplitCode::R_INNER
                | flags(inner, SplitCode::L_INNER)
                | flags(starts, SplitCode::L_STARTS),
        );
        let (first, count) = self.find(two, Wanted { vertex: v, left, right, code })?;
        Some(Cuts { left: self.ring.left(first), right: self.ring.right(first, count), first, count })
    }
}
