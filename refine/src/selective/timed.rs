//! Geomorphs by time: a view that follows another, its vertices moving for a number of frames (Hoppe 1997).

use super::entry::Entry;
use super::{Lens, View};
use crate::aif::NONE;
use glam::DVec3;
use std::collections::BTreeMap;

/// What is drawn while a view (the *leader*) changes: every vertex moves to its new place in equal steps over a number of frames.
///
/// New vertices begin where their ancestors are drawn. What the leader has undone stays until its vertices have moved to where their ancestor stands in the
/// leader, and is undone then, when it cannot be seen. Changes that no lens sees are made at once. So with 1 frame, or [`TimedMorph::frames`] frames after
/// the leader came to rest, what is drawn is the leader's mesh, with its vertices in its places bit for bit. Positions move, attributes do not.
///
/// Guaranteed: what is drawn is a mesh without cracks in every frame, with at least the leader's faces. Not guaranteed: a tolerance while vertices
/// move. Memory: a second view, and 90 B for every vertex that moves.
#[derive(Clone, Debug)]
pub struct TimedMorph {
    drawn: View,
    frames: u32,
    /// Vertices that are not in their own place in `drawn`, or may not be.
    motions: BTreeMap<u32, Motion>,
    /// The leader's splits when it was followed last.
    led: Vec<u64>,
}

/// On the way, or there when `step` is the number of frames.
#[derive(Clone, Copy, Debug)]
struct Motion {
    from: DVec3,
    to: DVec3,
    at: DVec3,
    step: u32,
}

/// What [`TimedMorph::follow`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Followed {
    /// Splits applied to what is drawn.
    pub splits: usize,
    /// Splits undone.
    pub collapses: usize,
    /// Vertices that are not where they will be.
    pub morphing: usize,
}

/// The set bits, ascending.
fn bits(words: impl Iterator<Item = u64>) -> Vec<u32> {
    let mut all = Vec::new();
    for (k, mut word) in (0u32..).zip(words) {
        while word != 0 {
            all.push(64 * k + word.trailing_zeros());
            word &= word - 1;
        }
    }
    all
}

impl TimedMorph {
    /// Draws `leader` as it is. Later changes take `frames` frames, at least 1.
    pub fn new(leader: &View, frames: u32) -> TimedMorph {
        TimedMorph {
            drawn: leader.clone(),
            frames: frames.max(1),
            motions: BTreeMap::new(),
            led: leader.front.applied_bits().collect(),
        }
    }

    /// Frames that a change takes.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// The mesh that is drawn: its faces and, but for vertices that are elsewhere, its places.
    pub fn view(&self) -> &View {
        &self.drawn
    }

    /// What changed in its buffers, as [`View::take_changes`]; vertices that only move are not in.
    pub fn take_changes(&mut self) -> super::Changes {
        self.drawn.take_changes()
    }

    /// Where vertex `v` is drawn; `None` if it is not. Panics if there is no such vertex.
    pub fn position(&self, v: u32) -> Option<DVec3> {
        self.motions.get(&v).map(|m| m.at).or_else(|| self.drawn.position(v))
    }

    /// The vertices that are drawn elsewhere than the mesh has them, ascending, and where.
    pub fn displaced(&self) -> impl Iterator<Item = (u32, DVec3)> + '_ {
        self.motions.iter().map(|(&v, m)| (v, m.at))
    }

    /// Takes a step towards `leader`, which must be a view of the same hierarchy and has been adapted to `lenses`. O(splits / 64 + changes + vertices that move).
    pub fn follow(&mut self, leader: &View, lenses: &[Lens]) -> Followed {
        let mut done = Followed::default();
        let now: Vec<u64> = leader.front.applied_bits().collect();
        // Closed sets: ascending, all that a split needs comes before it.
        for i in bits(now.iter().zip(self.drawn.front.applied_bits()).map(|(a, b)| a & !b)) {
            let [vs, vu] = self.ends(i);
            let at = self.position(vs).unwrap_or_default();
            self.drawn.apply(i);
            let rest = Motion { from: at, to: at, at, step: self.frames };
            self.motions.extend([(vs, rest), (vu, rest)]);
            done.splits += 1;
        }
        let changed = bits(now.iter().zip(&self.led).map(|(a, b)| a ^ b));
        self.led.copy_from_slice(&now);
        for (v, seen) in self.below(&changed, lenses) {
            self.send(v, seen, leader);
        }
        let frames = self.frames;
        for m in self.motions.values_mut().filter(|m| m.step < frames) {
            m.step += 1;
            m.at = if m.step == frames {
                m.to
            } else {
                m.from.lerp(m.to, f64::from(m.step) / f64::from(frames))
            };
        }
        let leaving = bits(now.iter().zip(self.drawn.front.applied_bits()).map(|(a, b)| b & !a));
        for &i in leaving.iter().rev() {
            let ends = self.ends(i);
            let there = |v: &u32| self.motions.get(v).is_none_or(|m| m.step == frames);
            if self.drawn.is_free(i) && ends.iter().all(there) {
                self.drawn.undo(i);
                self.motions.remove(&ends[1]);
                done.collapses += 1;
            }
        }
        // At rest, and no more of it to be undone: in its own place.
        let forest = &leader.hierarchy.forest;
        let own = |v: u32| self.drawn.front.node(forest, v) == leader.front.node(forest, v);
        self.motions.retain(|&v, m| m.step < frames || !own(v));
        done.morphing = self.motions.values().filter(|m| m.step < frames).count();
        done
    }

    /// The old vertex of split `i`, and the new one.
    fn ends(&self, i: u32) -> [u32; 2] {
        let h = &self.drawn.hierarchy;
        [h.mesh().splits.vertex[i as usize], h.forest.base_vertices + i]
    }

    /// The vertices drawn in the regions of these splits, and whether a lens sees one that is about them.
    fn below(&self, splits: &[u32], lenses: &[Lens]) -> BTreeMap<u32, bool> {
        let h = &self.drawn.hierarchy;
        let mut out = BTreeMap::new();
        let mut stack = Vec::new();
        for &i in splits {
            let e = Entry::of(h, i);
            let seen = lenses.iter().any(|l| l.sees(&e, e.centre.as_dvec3(), e.radius as f64));
            // Vertices, and the splits that may come next at them.
            stack.push((self.ends(i)[0], i));
            while let Some((v, next)) = stack.pop() {
                if next != NONE && self.drawn.front.is_applied(next) {
                    let [old, new] = h.forest.below(h.mesh(), next);
                    stack.extend([(v, old), (self.ends(next)[1], new)]);
                } else {
                    *out.entry(v).or_insert(false) |= seen;
                }
            }
        }
        out
    }

    /// Sends vertex `v` to where its ancestor stands in `leader`; at once if that is not seen.
    fn send(&mut self, v: u32, seen: bool, leader: &View) {
        let h = self.drawn.hierarchy.clone();
        let Some(at) = self.position(v) else { return };
        let (mut node, mut vertex) = (self.drawn.front.node(&h.forest, v), v);
        while leader.front.node(&h.forest, vertex) != node {
            let i = h.forest.maker(node);
            if i == NONE {
                break;
            }
            (node, vertex) = (h.forest.parent(h.mesh(), i), h.mesh().splits.vertex[i as usize]);
        }
        let to = h.forest.position(h.mesh(), node, vertex);
        let m = self.motions.entry(v).or_insert(Motion { from: at, to: at, at, step: self.frames });
        if !seen || at == to {
            *m = Motion { from: to, to, at: to, step: self.frames };
        } else if m.to != to {
            *m = Motion { from: at, to, at, step: 0 };
        }
    }
}
