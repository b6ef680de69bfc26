//! Which vertex is split next: sweeps over the chunk's vertices, in which each is asked whether its turn has come.

use super::super::coder::{Bit, Coder};
use super::super::walk::TOUCHED;
use super::{Codec, VALENCES, valence_class};

/// What a vertex did when the sweep last came by.
const ROOT: u8 = 0;
pub(super) const NEW: u8 = 1;
const SPLIT: u8 = 2;
/// It waits for others; so often it was asked again.
const WAITED: u8 = 3;
const MOST: u8 = 6;
const DONE: u8 = 7;

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
    pub(super) fn begin<C: Coder>(&mut self, c: &mut C, of: &[u32], count: usize) -> Option<()> {
        let first = self.walk.vertices.len() as u32;
        let mut older: Vec<u32> = of.iter().copied().filter(|&v| v < first).collect();
        if !C::READS {
            self.to_come.resize(self.to_come.len().max(first as usize + of.len()), 0);
            for &v in of {
                *self.to_come.get_mut(v as usize)? += 1;
            }
        }
        older.sort_unstable();
        older.dedup();
        let mut roots: Vec<(u64, u32)> = Vec::with_capacity(older.len());
        let number = c.number(&mut self.m.roots, older.len() as u64);
        if number > count as u64 {
            return None;
        }
        self.pass.clear();
        self.at = 0;
        self.list.clear();
        self.moved = true;
        let mut next = 0u64;
        for k in 0..number as usize {
            let gap = c.number(&mut self.m.root, older.get(k).map_or(0, |&r| r as u64 - next));
            let v = u32::try_from(next.checked_add(gap)?).ok().filter(|&v| v < first)?;
            next = v as u64 + 1;
            self.walk.changes(v);
            self.walk.vertices[v as usize].visit = ROOT;
            roots.push((self.walk.label(v).key(), v));
            if c.spent() {
                return None;
            }
        }
        // In the order of descent.
        roots.sort_unstable();
        self.pass.extend(roots.iter().map(|r| r.1));
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
            let vertex = &mut self.walk.vertices[v as usize];
            let visit = vertex.visit;
            if visit.wrapping_sub(WAITED) < TOUCHED - WAITED {
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
                vertex.visit = if state < WAITED { WAITED } else { (state + 1).min(MOST) };
                self.list.push(v);
            } else {
                vertex.visit = DONE;
            }
        }
    }
}
