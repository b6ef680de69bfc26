//! View-dependent refinement (Hoppe 1997, 1998): of a progressive mesh only the splits that a view needs.
//!
//! A [`View`] holds one mesh, a cut through the vertex hierarchy of a shared [`Hierarchy`]. A [`Lens`] says what is needed: a split whose region may be seen, and whose
//! error may look larger than the tolerance. [`View::adapt`] applies splits and undoes them until just those needed are applied, and what they depend on ([`crate::hierarchy::Rule`]).
//!
//! Guaranteed: without hysteresis and limits, what is applied depends on the lens alone, whatever came before: the *least closed set* with all needed splits. At a
//! tolerance of 0 without culling that is the finest mesh, at infinity the base. After every single step the mesh is one that the progressive mesh's splits make
//! in another order, so it has no cracks, and its links are sound. Faces keep their slots in the index buffer, unless many slots have come free: then the last faces move into these, which is among the changes. What is
//! shown where the lens looks deviates by no more pixels than the tolerance, as far as [`crate::hierarchy`] says what its errors bound.
//!
//! With feature `parallel` long lists of splits are decided about by the threads of the pool that [`View::adapt`] is called in; what it does, to the order of slots, is the same for every
//! number of them.
//!
//! Not guaranteed: which slot of the index buffer a face has; that depends on what came before. That the triangles are the fewest.

mod adapt;
mod changes;
mod clock;
mod cut;
mod entry;
mod front;
mod index;
mod lens;
mod marks;
mod morph;
mod motions;
mod output;
mod pack;
mod patch;
mod queue;
mod refine;
mod regulator;
mod sieve;
mod standoff;
mod survey;
mod timed;
mod timed_rows;

pub(crate) use adapt::Meter;
pub use adapt::{Done, Limits};
pub use changes::Changes;
pub(crate) use changes::take_runs;
pub(crate) use clock::{Clock, Clocks, Due, Judges, Looked, Many, Paces, Sums};
pub(crate) use cut::{Cut, morphed};
pub(crate) use entry::Entry;
pub(crate) use front::Front;
pub use lens::{Cull, Lens, LensError};
pub use motions::Followed;
pub(crate) use motions::{Motions, Stage};
pub(crate) use patch::{Known, Sheet, split, unsplit};
pub use regulator::Regulator;
pub use timed::TimedMorph;

use crate::aif::NONE;
use crate::hierarchy::Hierarchy;
use marks::Marks;
use standoff::Standoff;
use std::sync::Arc;

/// A split that is to be applied, and where its cuts lie, as far as that is known.
#[derive(Clone, Copy, Debug, Default)]
struct Split {
    id: u32,
    cuts: [u32; 2],
}

impl Split {
    fn new(id: u32) -> Split {
        Split { id, cuts: [NONE; 2] }
    }
}

/// A mesh between base and full detail, finer where a view needs it.
///
/// Memory: 62 B for every vertex shown, index buffer and links between faces included (and a part in 32 to grow into, and one in 64 that may be free), and 3 bits (8 B with attributes) for every vertex of the finest mesh;
/// [`View::bytes`] counts.
#[derive(Clone, Debug)]
pub struct View {
    hierarchy: Arc<Hierarchy>,
    front: Front,
    /// Bits for walks over what splits depend on; none is set between frames.
    marked: Marks,
    clock: Clock,
    standoff: Standoff,
    /// The record at which a limit cut short the last frame's looks.
    resume: u32,
    /// A split that was needed when a limit cut short what it depends on.
    unfinished: Option<u32>,
    faces_before: usize,
}

impl View {
    /// A view that shows the base. O(base, and splits / 64).
    pub fn new(hierarchy: Arc<Hierarchy>) -> View {
        let front = Front::new(hierarchy.mesh(), &hierarchy.forest);
        View {
            marked: Marks::new(hierarchy.forest.len()),
            clock: Clock::new(hierarchy.bounds.diagonal),
            standoff: Standoff::NONE,
            resume: 0,
            unfinished: None,
            faces_before: front.corners().len(),
            front,
            hierarchy,
        }
    }

    /// What it is a view of.
    pub fn hierarchy(&self) -> &Arc<Hierarchy> {
        &self.hierarchy
    }

    /// Faces shown.
    pub fn face_count(&self) -> usize {
        self.front.face_count()
    }

    /// Vertices shown.
    pub fn vertex_count(&self) -> usize {
        self.front.vertex_count()
    }

    /// True if split `i` is applied. Panics if there is no such split.
    pub fn is_applied(&self, i: usize) -> bool {
        assert!(i < self.hierarchy.splits(), "split {i} of {}", self.hierarchy.splits());
        self.front.is_applied(i as u32)
    }

    /// The applied splits, ascending. O(n / 64 + those applied).
    pub fn applied(&self) -> impl Iterator<Item = usize> + '_ {
        let words = self.front.applied_bits().zip((0..).step_by(64)).filter(|(word, _)| *word != 0);
        words.flat_map(|(word, first)| {
            let mut left = word;
            std::iter::from_fn(move || {
                let bit = (left != 0).then(|| left.trailing_zeros() as usize)?;
                left &= left - 1;
                Some(first + bit)
            })
        })
    }

    /// The vertices shown, ascending. O(n / 64 + those shown).
    pub fn vertices(&self) -> impl Iterator<Item = u32> + '_ {
        let n0 = self.hierarchy.mesh().base_vertices() as u32;
        (0..n0).chain(self.applied().map(move |i| n0 + i as u32))
    }

    /// Applies split `i` and all it depends on; returns how many splits that were. O(those, times valence). Panics if there is no such split.
    pub fn split(&mut self, i: usize) -> usize {
        assert!(i < self.hierarchy.splits(), "split {i} of {}", self.hierarchy.splits());
        let mut all = Vec::new();
        self.closure(i as u32, usize::MAX, &mut all);
        all.iter().for_each(|&j| self.apply(&Split::new(j)));
        all.len()
    }

    /// Undoes split `i` if it is applied and nothing applied depends on it; says whether it did. O(valence). Panics if there is no such split.
    pub fn collapse(&mut self, i: usize) -> bool {
        assert!(i < self.hierarchy.splits(), "split {i} of {}", self.hierarchy.splits());
        let legal = self.front.is_applied(i as u32) && self.is_free(i as u32);
        if legal {
            self.undo(i as u32, &mut Vec::new());
        }
        legal
    }

    /// True if all that split `i` depends on is applied, and it is not. Panics if there is no such split.
    pub fn may_split(&self, i: usize) -> bool {
        !self.is_applied(i)
            && self.hierarchy.forest.needs.of(i as u32).iter().all(|d| self.front.is_applied(d))
    }

    /// True if split `i` is applied and nothing applied depends on it. Panics if there is no such split.
    pub fn may_collapse(&self, i: usize) -> bool {
        self.is_applied(i) && self.is_free(i as u32)
    }

    /// Bytes held: those that grow with the mesh shown, and tables over the finest mesh.
    pub fn bytes(&self) -> (usize, usize) {
        let (shown, tables) = self.front.bytes();
        (shown, tables + self.marked.bytes())
    }

    /// Replaces `out` by split `i` and all it depends on that is not applied, in an order in which they can be; false (and nothing of use) if that are more than `most`.
    fn closure(&mut self, i: u32, most: usize, out: &mut Vec<u32>) -> bool {
        out.clear();
        let fits = self.mark(std::iter::once(i), most, out);
        self.unmark(out);
        // What a split depends on was made before it.
        out.sort_unstable();
        fits
    }

    /// Marks splits and all they depend on, as far as it is neither applied nor marked, and appends what it has marked to `out`; false if it has stopped on the way, as that are more than `most`.
    fn mark(&mut self, splits: impl Iterator<Item = u32>, most: usize, out: &mut Vec<u32>) -> bool {
        let (front, needs, marked) = (&self.front, &self.hierarchy.forest.needs, &mut self.marked);
        let mut add = |i: u32, out: &mut Vec<u32>| {
            if !marked.has(i) && !front.is_applied(i) {
                marked.add_if(i, true);
                out.push(i);
            }
        };
        let from = out.len();
        splits.for_each(|i| add(i, out));
        let mut k = from;
        while let Some(&j) = out.get(k).filter(|_| out.len() - from <= most) {
            needs.of(j).iter().for_each(|d| add(d, out));
            k += 1;
        }
        out.len() - from <= most
    }

    /// Takes marks away.
    fn unmark(&mut self, splits: &[u32]) {
        splits.iter().for_each(|&j| self.marked.remove(j));
    }

    /// Finds where the cuts of splits lie, as far as their faces are there, and reads what applying them begins with: the processor then waits for all of that together.
    fn make_ready<'a>(&self, splits: &[u32], out: &'a mut [Split]) -> &'a [Split] {
        let h = &*self.hierarchy;
        let n = splits.len().min(out.len());
        for (s, &i) in out.iter_mut().zip(splits) {
            *s = Split { cuts: self.front.cuts(h.mesh(), &h.forest, i), ..Split::new(i) };
        }
        let sum = out[..n].iter().fold(0, |sum, s| sum ^ self.front.fetch(s.cuts));
        std::hint::black_box(sum);
        &out[..n]
    }

    /// Applies a split whose dependencies are applied. Both its vertices are due.
    fn apply(&mut self, split: &Split) {
        let h = &*self.hierarchy;
        let i = split.id;
        let done = self.front.split_at(h.mesh(), &h.forest, (i, split.cuts), None);
        // The hierarchy has gone through all splits; the four faces of a split are the same in every order.
        debug_assert!(done.is_ok(), "{done:?}");
        let Ok(record) = done else { return };
        let old = self.front.record_of_vertex(h.mesh().splits.vertex[i as usize]);
        self.front.records[old as usize].count();
        for r in [record, old] {
            self.front.records[r as usize].due = self.clock.now();
        }
        for d in h.forest.needs.of(i).iter() {
            let r = self.front.record(d) as usize;
            self.front.records[r].dependents += 1;
        }
    }

    /// Undoes split `i`, which is applied and free; what has become free by that is appended to `freed`. All these are due, and the vertex.
    fn undo(&mut self, i: u32, freed: &mut Vec<u32>) {
        let h = &*self.hierarchy;
        self.front.unsplit(h.mesh(), &h.forest, i);
        let v = h.mesh().splits.vertex[i as usize];
        let old = self.front.record_of_vertex(v);
        let now = self.clock.now();
        self.front.records[old as usize].due = now;
        self.front.count_back(&h.forest, (v, i), old);
        for d in h.forest.needs.of(i).iter() {
            let r = self.front.record(d) as usize;
            let record = &mut self.front.records[r];
            record.dependents -= 1;
            if record.dependents == 0 {
                record.due = now;
                freed.push(d);
            }
        }
    }

    /// Reads what undoing splits, which are applied, begins with.
    fn fetch_made(&self, splits: &[u32]) {
        let sum = splits.iter().fold(0, |sum, &i| sum ^ self.front.fetch_made(i));
        std::hint::black_box(sum);
    }

    /// Split `i`, which is applied, has nothing applied that depends on it, in the hierarchy or beside it.
    #[inline]
    fn is_free(&self, i: u32) -> bool {
        self.front.records[self.front.record(i) as usize].dependents == 0
    }
}
