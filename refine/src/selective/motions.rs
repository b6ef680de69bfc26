//! Vertices on their way: geomorphs by time (Hoppe 1997), wherever the mesh is kept.
//!
//! A mesh is drawn that holds at least the splits that are asked for (*led*; a closed set), and others that *linger*: they were led and go when their vertices have come to where they
//! cannot be seen to go.

use super::Lens;
use super::cut::Cut;
use crate::aif::NONE;
use glam::DVec3;
use std::collections::BTreeMap;

/// The mesh that is drawn, as a [`Cut`], and what it is asked for.
pub(crate) trait Stage: Cut {
    /// Why a split cannot be done.
    type Error;
    /// Split `i` is asked for.
    fn is_led(&self, i: u32) -> bool;
    /// The splits that have begun or ceased to be led since the last step, each behind what it needs.
    fn changed(&self) -> Vec<u32>;
    /// The splits that linger, each behind what it needs.
    fn lingering(&self) -> Vec<u32>;
    /// Nothing drawn depends on split `i`, which is drawn, and nothing of it is on the way but vertices.
    fn is_free(&self, i: u32) -> bool;
    /// Applies split `i`, what it depends on being drawn.
    fn draw(&mut self, i: u32) -> Result<(), Self::Error>;
    /// Undoes split `i`, which is drawn and free.
    fn undraw(&mut self, i: u32) -> Result<(), Self::Error>;
    /// What else moves is sent to where it belongs, now that these splits have begun or ceased to be led.
    fn send_more(&mut self, _changed: &[u32], _lenses: &[Lens]) {}
    /// What else moves goes a step further.
    fn step_more(&mut self) {}
}

/// What a step did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Followed {
    /// Splits applied to what is drawn.
    pub splits: usize,
    /// Splits undone.
    pub collapses: usize,
    /// Vertices that are not where they will be.
    pub morphing: usize,
}

/// One step after the other: vertices on the way are those after the last.
impl std::ops::Add for Followed {
    type Output = Followed;

    fn add(self, last: Followed) -> Followed {
        Followed {
            splits: self.splits + last.splits,
            collapses: self.collapses + last.collapses,
            morphing: last.morphing,
        }
    }
}

/// On the way, or there when `step` is the number of frames.
#[derive(Clone, Copy, Debug)]
struct Motion {
    from: DVec3,
    to: DVec3,
    step: u32,
}

/// Vertices that are not in their own place in what is drawn, or may not be.
#[derive(Clone, Debug)]
pub(crate) struct Motions {
    frames: u32,
    of: BTreeMap<u32, Motion>,
}

impl Motion {
    /// At rest in a place.
    fn rest(at: DVec3, frames: u32) -> Motion {
        Motion { from: at, to: at, step: frames }
    }

    fn at(&self, frames: u32) -> DVec3 {
        match self.step {
            0 => self.from,
            k if k >= frames => self.to,
            k => self.from.lerp(self.to, f64::from(k) / f64::from(frames)),
        }
    }
}

impl Motions {
    /// None, and none will be.
    pub(crate) const NOTHING: Motions = Motions { frames: 1, of: BTreeMap::new() };

    /// Changes take `frames` frames, at least 1.
    pub(crate) fn new(frames: u32) -> Motions {
        Motions { frames: frames.max(1), of: BTreeMap::new() }
    }

    pub(crate) fn frames(&self) -> u32 {
        self.frames
    }

    /// All are in their own places.
    pub(crate) fn clear(&mut self) {
        self.of.clear();
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.of.len()
    }

    /// Where vertex `v` is drawn, if it may not be in its own place.
    pub(crate) fn place(&self, v: u32) -> Option<DVec3> {
        self.of.get(&v).map(|m| m.at(self.frames))
    }

    /// The vertices, ascending, and where they are drawn.
    pub(crate) fn all(&self) -> impl ExactSizeIterator<Item = (u32, DVec3)> + '_ {
        self.of.iter().map(|(&v, m)| (v, m.at(self.frames)))
    }

    /// Takes a step. New vertices begin where their ancestors are drawn; those below what ceases to be led move to where their ancestor stands among what is; what no lens sees jumps.
    pub(crate) fn follow<S: Stage>(&mut self, stage: &mut S, lenses: &[Lens]) -> Result<Followed, S::Error> {
        let mut done = Followed::default();
        let (changed, frames) = (stage.changed(), self.frames);
        // Closed sets: all that a split needs comes before it.
        for &i in &changed {
            if !stage.is_led(i) || stage.is_applied(i) {
                continue;
            }
            let [vs, vu] = ends(stage, i);
            let at = self.position(stage, vs).unwrap_or_default();
            stage.draw(i)?;
            self.of.extend([vs, vu].map(|v| (v, Motion::rest(at, frames))));
            done.splits += 1;
        }
        for (v, seen) in regions(stage, &changed, lenses) {
            self.send(v, seen, stage);
        }
        stage.send_more(&changed, lenses);
        stage.step_more();
        for m in self.of.values_mut().filter(|m| m.step < frames) {
            m.step += 1;
        }
        for &i in stage.lingering().iter().rev() {
            let ends = ends(stage, i);
            let there = |v: &u32| self.of.get(v).is_none_or(|m| m.step == frames);
            if stage.is_free(i) && ends.iter().all(there) {
                stage.undraw(i)?;
                self.of.remove(&ends[1]);
                done.collapses += 1;
            }
        }
        // At rest, and no more of it to be undone: in its own place.
        self.of.retain(|&v, m| m.step < frames || !is_own(stage, stage.node(v)));
        done.morphing = self.of.values().filter(|m| m.step < frames).count();
        Ok(done)
    }

    fn position<S: Stage>(&self, stage: &S, v: u32) -> Option<DVec3> {
        let own = || Some(stage.node(v)).filter(|&k| k != NONE).map(|k| stage.place(k, v));
        self.place(v).or_else(own)
    }

    /// Sends vertex `v` to where its ancestor stands among what is led; at once if that is not seen.
    fn send<S: Stage>(&mut self, v: u32, seen: bool, stage: &S) {
        let Some(at) = self.position(stage, v) else { return };
        let (mut node, mut vertex) = (stage.node(v), v);
        while !is_own(stage, node) {
            (node, vertex) = stage.parent(stage.maker(node));
        }
        let to = stage.place(node, vertex);
        let rest = Motion::rest(at, self.frames);
        let m = self.of.entry(v).or_insert(rest);
        if !seen || at == to {
            *m = Motion::rest(to, self.frames);
        } else if m.to != to {
            *m = Motion { from: at, to, step: 0 };
        }
    }
}

/// A node is of the base, or made by a split that is led: then it is where its vertex is among what is led, or has been.
fn is_own<S: Stage>(stage: &S, node: u32) -> bool {
    let i = if node == NONE { NONE } else { stage.maker(node) };
    i == NONE || stage.is_led(i)
}

/// The old vertex of split `i`, and the new one.
fn ends<S: Stage>(stage: &S, i: u32) -> [u32; 2] {
    [stage.parent(i).1, stage.new_vertex(i)]
}

/// The vertices drawn in the regions of these splits, ascending, and whether a lens sees one that is about them.
fn regions<S: Stage>(stage: &S, splits: &[u32], lenses: &[Lens]) -> BTreeMap<u32, bool> {
    let mut out = BTreeMap::new();
    let mut stack = Vec::new();
    for &i in splits {
        let e = stage.entry(i);
        let seen = lenses.iter().any(|l| l.sees_entry(&e));
        let [old, _] = ends(stage, i);
        // Vertices, and the splits that may come next at them.
        stack.push((old, i));
        while let Some((v, next)) = stack.pop() {
            if next != NONE && stage.is_applied(next) {
                let [old, new] = stage.below(next);
                stack.extend([(v, old), (stage.new_vertex(next), new)]);
            } else {
                *out.entry(v).or_insert(false) |= seen;
            }
        }
    }
    out
}
