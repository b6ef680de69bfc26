//! View-dependent refinement (Hoppe 1997, 1998): of a progressive mesh only the splits that a view needs.
//!
//! A [`View`] holds one mesh, a cut through the vertex hierarchy of a shared [`Hierarchy`]. A [`Lens`] says what is needed: a split whose region may be seen, and whose
//! error may look larger than the tolerance. [`View::adapt`] applies splits and undoes them until just those needed are applied, and what they depend on ([`crate::hierarchy::Rule`]).
//!
//! Guaranteed: without hysteresis and limits, what is applied depends on the lens alone, whatever came before: the *least closed set* with all needed splits. At a
//! tolerance of 0 without culling that is the finest mesh, at infinity the base. After every single step the mesh is one that the progressive mesh's splits make
//! in another order, so it has no cracks, and its links are sound. Faces keep their slots in the index buffer for as long as they are there. What is
//! shown where the lens looks deviates by no more pixels than the tolerance, as far as [`crate::hierarchy`] says what its errors bound.
//!
//! With feature `parallel` long lists of splits are decided about by the threads of the pool that [`View::adapt`] is called in; what it does, to the order of slots, is the same for every
//! number of them.
//!
//! Not guaranteed: which slot of the index buffer a face has; that depends on what came before. That the triangles are the fewest.

mod adapt;
mod changes;
mod front;
mod lens;
mod list;
mod morph;
mod output;
mod regulator;
mod timed;

pub(crate) use adapt::{BETWEEN, LOOKS};
pub use adapt::{Done, Limits};
pub use changes::Changes;
pub(crate) use front::Front;
pub use lens::{Cull, Lens, LensError};
pub(crate) use list::Entry;
pub use regulator::Regulator;
pub use timed::{Followed, TimedMorph};

use crate::aif::NONE;
use crate::hierarchy::Hierarchy;
use list::List;
use std::sync::Arc;

/// A mesh between base and full detail, finer where a view needs it.
///
/// Memory: about 100 B for every vertex shown, and 18 B (30 B with attributes) for every vertex of the finest mesh; [`View::bytes`] counts.
#[derive(Clone, Debug)]
pub struct View {
    hierarchy: Arc<Hierarchy>,
    front: Front,
    /// Splits that could be applied next: not applied, their vertex is in the mesh.
    open: List,
    /// Splits that could be undone next: applied, and nothing depends on them.
    last: List,
    /// Where each split is in the one list or the other.
    place: Vec<u32>,
    /// Applied splits that depend on each.
    dependents: Vec<u16>,
    /// Bits for walks over what a split depends on; none is set between walks.
    marked: Vec<u64>,
    /// Where the scans of the two lists go on after a limit cut them short.
    resume: [usize; 2],
    /// A split that was needed when a limit cut short what it depends on.
    unfinished: Option<u32>,
    faces_before: usize,
}

impl View {
    /// A view that shows the base.
    pub fn new(hierarchy: Arc<Hierarchy>) -> View {
        let front = Front::new(hierarchy.mesh(), &hierarchy.forest);
        let n = hierarchy.forest.len();
        let mut view = View {
            front,
            open: List::default(),
            last: List::default(),
            place: vec![NONE; n],
            dependents: vec![0; n],
            marked: vec![0; n.div_ceil(64)],
            resume: [0; 2],
            unfinished: None,
            faces_before: 0,
            hierarchy,
        };
        for v in 0..view.hierarchy.forest.base_vertices {
            view.offer(v);
        }
        view.faces_before = view.front.corners().len();
        view
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
        (0..self.hierarchy.splits()).filter(|&i| self.front.is_applied(i as u32))
    }

    /// Applies split `i` and all it depends on; returns how many splits that were. O(those, times valence). Panics if there is no such split.
    pub fn split(&mut self, i: usize) -> usize {
        assert!(i < self.hierarchy.splits(), "split {i} of {}", self.hierarchy.splits());
        let mut all = Vec::new();
        self.closure(i as u32, &mut all);
        all.iter().for_each(|&j| self.apply(j));
        all.len()
    }

    /// Undoes split `i` if it is applied and nothing applied depends on it; says whether it did. O(valence). Panics if there is no such split.
    pub fn collapse(&mut self, i: usize) -> bool {
        assert!(i < self.hierarchy.splits(), "split {i} of {}", self.hierarchy.splits());
        let legal = self.front.is_applied(i as u32) && self.is_free(i as u32);
        if legal {
            self.undo(i as u32);
        }
        legal
    }

    /// True if all that split `i` depends on is applied, and it is not. Panics if there is no such split.
    pub fn may_split(&self, i: usize) -> bool {
        !self.is_applied(i)
            && self.hierarchy.forest.needs.of(i as u32).iter().all(|&d| self.front.is_applied(d))
    }

    /// True if split `i` is applied and nothing applied depends on it. Panics if there is no such split.
    pub fn may_collapse(&self, i: usize) -> bool {
        self.is_applied(i) && self.is_free(i as u32)
    }

    /// Bytes held: those that grow with the mesh shown, and tables over the finest mesh.
    pub fn bytes(&self) -> (usize, usize) {
        let (shown, tables) = self.front.bytes();
        (
            shown + self.open.bytes() + self.last.bytes(),
            tables + 4 * self.place.len() + 2 * self.dependents.len() + 8 * self.marked.len(),
        )
    }

    /// Appends split `i` and all it depends on that is not applied, in an order in which they can be.
    fn closure(&mut self, i: u32, out: &mut Vec<u32>) {
        let from = out.len();
        if !self.front.is_applied(i) {
            self.marked[i as usize / 64] |= 1 << (i % 64);
            out.push(i);
        }
        let mut k = from;
        while let Some(&j) = out.get(k) {
            for &d in self.hierarchy.forest.needs.of(j) {
                let (word, bit) = (d as usize / 64, 1u64 << (d % 64));
                if self.marked[word] & bit == 0 && !self.front.is_applied(d) {
                    self.marked[word] |= bit;
                    out.push(d);
                }
            }
            k += 1;
        }
        out[from..].iter().for_each(|&j| self.marked[j as usize / 64] &= !(1 << (j % 64)));
        // What a split depends on was made before it.
        out[from..].sort_unstable();
    }

    /// Applies split `i`, whose dependencies are applied.
    fn apply(&mut self, i: u32) {
        let h = &*self.hierarchy;
        let done = self.front.split(h.mesh(), &h.forest, i, None);
        // The hierarchy has gone through all splits; the four faces of a split are the same in every order.
        debug_assert!(done.is_ok(), "{done:?}");
        if done.is_err() {
            return;
        }
        let e = self.open.remove(i, &mut self.place).unwrap_or_else(|| Entry::of(h, i));
        self.last.put(e, &mut self.place);
        for &d in h.forest.needs.of(i) {
            self.dependents[d as usize] += 1;
            self.last.remove(d, &mut self.place);
        }
        h.forest.nodes(i).into_iter().for_each(|k| self.offer(k));
    }

    /// Undoes split `i`, which is applied and free.
    fn undo(&mut self, i: u32) {
        let h = self.hierarchy.clone();
        for k in h.forest.nodes(i) {
            let below = h.forest.split_of[k as usize];
            if below != NONE {
                self.open.remove(below, &mut self.place);
            }
        }
        self.front.unsplit(h.mesh(), &h.forest, i);
        let e = self.last.remove(i, &mut self.place).unwrap_or_else(|| Entry::of(&h, i));
        self.open.put(e, &mut self.place);
        for &d in h.forest.needs.of(i) {
            self.dependents[d as usize] -= 1;
            if self.is_free(d) && self.place[d as usize] == NONE {
                self.last.push(&h, d, &mut self.place);
            }
        }
    }

    /// Nothing applied depends on split `i`, in the hierarchy or beside it.
    #[inline]
    fn is_free(&self, i: u32) -> bool {
        self.dependents[i as usize] == 0
    }

    /// Node `k` is in the mesh now: what replaces it can be applied.
    fn offer(&mut self, k: u32) {
        let i = self.hierarchy.forest.split_of[k as usize];
        if i != NONE {
            self.open.push(&self.hierarchy, i, &mut self.place);
        }
    }
}
