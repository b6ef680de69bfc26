//! Which vertex is split next: sweeps over the chunk's vertices, in which each is asked whether its turn has come.

use super::super::coder::Coder;
use super::super::walk::TOUCHED;
use super::{Codec, valence_class};

/// What a vertex did when the sweep last came by.
const ROOT: u8 = 0;
pub(super) const NEW: u8 = 1;
const SPLIT: u8 = 2;
/// It waits for others; so often it was asked again.
const WAITED: u8 = 3;
const MOST: u8 = 6;
const DONE: u8 = 7;

impl Codec<'_> {
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
        // In the order of descent, the first on top.
        roots.sort_unstable_by(|a, b| b.cmp(a));
        self.pass.extend(roots.iter().map(|r| r.1));
        Some(())
    }

    /// The vertex of the next split, by the sweep, and what it did last.
    pub(super) fn sweep<C: Coder>(&mut self, c: &mut C, wanted: u32) -> Option<(u32, u8)> {
        loop {
            let Some(v) = self.pass.pop() else {
                if self.list.is_empty() || !self.moved {
                    return None;
                }
                self.moved = false;
                std::mem::swap(&mut self.pass, &mut self.list);
                self.pass.reverse();
                continue;
            };
            let vertex = &mut self.walk.vertices[v as usize];
            let (state, touched) = (vertex.visit & 7, vertex.visit & TOUCHED != 0);
            if state >= WAITED && !touched {
                // What it waits for would have touched it.
                self.list.push(v);
                continue;
            }
            let level = vertex.level.min(self.levels[1]).saturating_sub(self.levels[0]);
            // Of the splits that only prepare no level is known.
            let level = if self.preparing { 6 } else { (level as usize).min(5) };
            let class = valence_class(vertex.valence as usize);
            if c.bit(&mut self.m.split[state.min(4) as usize][class][level], v == wanted) {
                vertex.visit = SPLIT;
                self.moved = true;
                if !C::READS {
                    let left = self.to_come.get_mut(v as usize)?;
                    *left = left.checked_sub(1)?;
                }
                return Some((v, state));
            }
            let last = !C::READS && self.to_come.get(v as usize) == Some(&0);
            if state >= WAITED || !c.bit(&mut self.m.done[state as usize][level], last) {
                vertex.visit = if state < WAITED { WAITED } else { (state + 1).min(MOST) };
                self.list.push(v);
            } else {
                vertex.visit = DONE;
            }
            if c.spent() {
                return None;
            }
        }
    }
}
