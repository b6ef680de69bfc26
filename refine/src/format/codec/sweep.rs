//! Which vertex is split next: sweeps over the chunk's vertices, in which each is asked whether its turn has come.

use super::super::coder::{Bit, Coder};
use super::super::walk::TOUCHED;
use super::{Codec, VALENCES, valence_class};
use crate::aif::NONE;

/// What a vertex did when the sweep last came by.
const ROOT: u8 = 0;
pub(super) const NEW: u8 = 1;
const SPLIT: u8 = 2;
/// It waits for others; so often it was asked again.
const WAITED: u8 = 3;
const MOST: u8 = 6;
const DONE: u8 = 7;
/// Beside what it did: in the chunk that the context is of, splits of others came before the last one of the vertex, and so probably do again.
pub(super) const MARKED: u8 = 16;

/// So far ahead of the sweep vertices are looked at.
const AHEAD: usize = 4;

/// Levels above the least of the chunk that are told apart, and one more for splits that only prepare.
const LEVELS: usize = 7;
/// Contexts of the decision whether a vertex is split, and more, so that there is a power of two.
const SPLITS: usize = 512;

/// Whether a vertex is split, by its state, valence and level.
#[derive(Clone, Debug)]
pub(super) struct Split([Bit; SPLITS]);

impl Default for Split {
    fn default() -> Self {
        Split([Bit::default(); SPLITS])
    }
}

impl Codec<'_> {
    /// What follows only prepares, or is the chunk's own.
    pub(super) fn prepares(&mut self, on: bool) {
        self.preparing = on;
        self.levels = if on { [0, u16::MAX] } else { [0; 2] };
        self.classes = if on { LEVELS - 1 } else { LEVELS - 2 };
    }

    /// Codes the least and the largest level of the chunk.
    pub(super) fn levels<C: Coder>(&mut self, c: &mut C, levels: [u16; 2]) {
        self.levels = levels.map(|l| c.plain(16, l as u32) as u16);
    }

    /// Codes the roots of `count` splits that follow; a writer gives their vertices.
    ///
    /// Roots come in the order of descent, each by how many vertices it leaves out: neighbours mostly are roots together.
    pub(super) fn begin<C: Coder>(&mut self, c: &mut C, of: &[u32], count: usize) -> Option<()> {
        let first = self.walk.vertices.len() as u32;
        let mut roots = 0;
        if !C::READS {
            self.to_come.resize(self.to_come.len().max(first as usize + of.len()), 0);
            for &v in of {
                let times = self.to_come.get_mut(v as usize)?;
                roots += (*times == 0 && v < first) as u64;
                *times += 1;
            }
        }
        let roots = c.number(&mut self.m.roots, roots);
        if roots > count as u64 {
            return None;
        }
        self.pass.clear();
        self.at = 0;
        self.list.clear();
        self.moved = true;
        self.marks = 0;
        let mut v = self.walk.head;
        for k in 0..roots {
            let mut gap = 0;
            if !C::READS {
                while *self.to_come.get(v as usize)? == 0 {
                    v = self.walk.next(v);
                    gap += 1;
                }
            }
            if k == 0 {
                // Far from the first of all.
                v = u32::try_from(c.number(&mut self.m.first, v as u64)).ok().filter(|&v| v < first)?;
            } else {
                gap = c.number(&mut self.m.gap[self.preparing as usize], gap);
                for _ in 0..if C::READS { gap } else { 0 } {
                    v = Some(v).filter(|&v| v != NONE).map(|v| self.walk.next(v))?;
                }
            }
            if v == NONE || c.spent() {
                return None;
            }
            self.walk.changes(v);
            let marked = self.preparing && (k == 0 || gap > 0);
            self.walk.vertices[v as usize].visit = if marked { ROOT | MARKED } else { ROOT };
            self.pass.push(v);
            v = self.walk.next(v);
        }
        Some(())
    }

    /// The vertex of the next split, by the sweep, and what it did last.
    #[inline]
    pub(super) fn sweep<C: Coder>(&mut self, c: &mut C, wanted: u32) -> Option<(u32, u8)> {
        loop {
            let Some(&v) = self.pass.get(self.at) else {
                if self.list.is_empty() || !self.moved || c.spent() {
                    return None;
                }
                self.moved = false;
                self.at = 0;
                std::mem::swap(&mut self.pass, &mut self.list);
                self.list.clear();
                continue;
            };
            self.at += 1;
            // What comes soon is asked for now, so that it is at hand then.
            if let Some(&soon) = self.pass.get(self.at + AHEAD) {
                self.ahead ^= self.walk.vertices[soon as usize].valence as u32 ^ self.walk.ask(soon);
            }
            let vertex = &mut self.walk.vertices[v as usize];
            let visit = vertex.visit;
            self.marks |= visit;
            if (visit & !MARKED).wrapping_sub(WAITED) < TOUCHED - WAITED {
                // What it waits for would have touched it.
                self.list.push(v);
                continue;
            }
            let state = visit & 7;
            // Of the splits that only prepare no level is known.
            let [least, most] = self.levels;
            let level = (vertex.level.min(most).saturating_sub(least) as usize).min(self.classes);
            let class = valence_class(vertex.valence as usize);
            let model = (state.min(4) as usize * VALENCES + class) * LEVELS + level;
            if c.bit(&mut self.m.split.0[model & (SPLITS - 1)], v == wanted) {
                vertex.visit = SPLIT;
                self.moved = true;
                if !C::READS {
                    let left = self.to_come.get_mut(v as usize)?;
                    *left = left.checked_sub(1)?;
                }
                return Some((v, state));
            }
            let last = !C::READS && self.to_come.get(v as usize) == Some(&0);
            if state >= WAITED || !c.bit(&mut self.m.done[state as usize][level & 7], last) {
                vertex.visit = visit & MARKED | if state < WAITED { WAITED } else { (state + 1).min(MOST) };
                self.list.push(v);
            } else {
                vertex.visit = DONE;
            }
        }
    }
}
