//! Truly selective refinement (after Kim & Lee 2001): splits and collapses that wait for nothing but what the topology needs.
//!
//! Hoppe's rules let a split be made where the faces are that it was recorded beside, so splits around it that nobody asked for come along. Here its place is found
//! in whatever mesh there is: every vertex of the hierarchy stands for a *piece* of the surface, the same in all meshes, and a split cuts its piece in two.
//!
//! **Pieces.** Let every vertex of the finest mesh have its cell of the dual mesh, and a node of the hierarchy ([`crate::hierarchy`]) the cells of all vertices that come of it.
//! In the recorded sequence every mesh is the dual of its nodes' pieces, so pieces are discs (half discs at borders), and split `i` cuts its vertex's piece
//! along an arc that leads from one place, where three pieces meet, to another: the faces of the finest mesh that `i` made. Their third corners there are the *fundamental cut vertices*
//! `l` and `r`. At a border the arc ends there, and there is one cut vertex.
//!
//! A set of applied splits makes this mesh: the faces of the base and of the applied splits, each corner at the *active ancestor* of the vertex that it has in the finest mesh. It depends on
//! the set alone.
//!
//! **What a split needs**: the split that made its vertex; and, if it makes two faces, the one that parts its cut vertices, the last that they have in common in the hierarchy, if any.
//! Kim & Lee ask in the mesh at hand whether the active ancestors of `l` and `r` differ: that is whether this split is applied.
//!
//! **Proof** that the mesh of every set closed under this is a mesh: no two pieces share more than one arc. Of the base that is so, as its edges are unique. Make the splits of the set in
//! their order: `i` cuts the piece of its vertex along an arc from the border with `l`'s active ancestor to that with `r`'s. These are two neighbours, as the split that parts `l` and `r` is
//! there. Every other neighbour lies with all of its border on one side of the arc or the other; those two have a part on each side, one arc each. So edges stay unique by their ends, have the faces
//! they had, and the mesh is the one before with a vertex pulled apart between two different neighbours (or a neighbour and the border), which changes neither its components, nor its Euler number, nor its
//! borders. A split that nothing applied needs can be undone: what is left is closed.
//!
//! **Guaranteed**: after every step the mesh has no cracks, no edge of three faces, no face or edge twice; the components, borders and Euler number of the base; all splits
//! make the finest mesh, none the base. Without the flip guard and limits [`TrulyView::adapt`] ends in the least closed set with all splits that the lens needs, whatever
//! came before. Bases with an edge of three or more faces are refused; vertices with several fans of faces are not.
//!
//! **Not guaranteed**: the tolerance. Errors of a hierarchy are found on rings as they were recorded, and here they are others. What is shown has fewer faces than by the other rules, and a larger error:
//! `docs/selective.md` has both, measured. And as faces stand among others than they were made for, they can fold over.
//!
//! **The flip guard** ([`TrulyView::set_guard`], on at first) looks at every step. No face may turn away from where it looks at full detail (the normals of the vertices that its corners are there), unless
//! it did before, or become a sliver that was none; nor may a split make one that looks away. A collapse that would is *deferred*: left undone until what is around it
//! changes. A split that would is made *through its dependencies*: first all that it needs by the hierarchy's own rule, then it; and if even that turns a face, its corners are split until it has turned back: at full detail no face looks away. The last resort is that it stays so
//! and is counted ([`Guarded::turned`]): after 32 attempts, or for a limit of faces. So under the guard no collapse turns a face away, and splits do where they are counted. It looks at the mesh as it is, so with it the result depends on the frames before,
//! and deferred collapses leave more faces. With infinite tolerance, or nothing to see, it rests, so the base comes back.

mod adapt;
mod guard;
mod mesh;
mod output;
mod pieces;

pub use adapt::Guarded;

use crate::aif::NONE;
use crate::hierarchy::Hierarchy;
use crate::progressive::Damage;
use crate::selective::Entry;
use mesh::{Gap, Mesh};
use pieces::Pieces;
use std::sync::Arc;

/// A mesh that cannot be refined by this rule.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TrulyError {
    /// The progressive mesh is damaged.
    #[error(transparent)]
    Damage(#[from] Damage),
    /// The base has an edge that pieces cannot share.
    #[error(
        "the edge between vertices {0} and {1} of the base has {2} faces: truly selective refinement needs edges of one or two"
    )]
    Edge(u32, u32, usize),
    /// A recorded split does not pull its vertex apart between two neighbours.
    #[error(
        "split {0} does not part two neighbours of its vertex: truly selective refinement cannot follow it"
    )]
    Unfit(usize),
}

/// A mesh between base and full detail, finer where a view needs it, by the rule of the [module](self).
///
/// Memory: about 100 B for every vertex shown, 24 B for every vertex of the finest mesh; and 47 B for each of those (with attributes about 50 B more), shared by all views ([`TrulyView::beside`]), on top
/// of the hierarchy. [`TrulyView::bytes`] counts.
#[derive(Clone, Debug)]
pub struct TrulyView {
    hierarchy: Arc<Hierarchy>,
    pieces: Arc<Pieces>,
    mesh: Mesh,
    /// Splits that could be applied next: not applied, their vertex is in the mesh.
    open: List,
    /// Splits that could be undone next: applied, and no other applied one needs them.
    last: List,
    /// Where each split is in the one list or the other.
    place: Vec<u32>,
    /// Applied splits that need each.
    dependents: Vec<u32>,
    /// Bits for walks over what a split needs; none is set between walks.
    marked: Vec<u64>,
    /// Where the last split found its place.
    gap: Gap,
    guard: bool,
    guarded: Guarded,
    /// A split that was needed when a limit cut short what it needs.
    unfinished: Option<u32>,
    slots_before: usize,
}

impl TrulyView {
    /// A view that shows the base. Finds the pieces and makes every split once: about a microsecond a vertex.
    ///
    /// Errors: a base with an edge of three or more faces, splits that are not vertex splits between two neighbours, a damaged progressive mesh.
    pub fn new(hierarchy: Arc<Hierarchy>) -> Result<TrulyView, TrulyError> {
        let pieces = Arc::new(Pieces::new(&hierarchy)?);
        Ok(TrulyView::of(hierarchy, pieces))
    }

    /// Another view that shows the base and shares what is static with this one. O(n).
    pub fn beside(&self) -> TrulyView {
        let mut view = TrulyView::of(self.hierarchy.clone(), self.pieces.clone());
        view.guard = self.guard;
        view
    }

    fn of(hierarchy: Arc<Hierarchy>, pieces: Arc<Pieces>) -> TrulyView {
        let n = hierarchy.splits();
        let mesh = Mesh::new(&hierarchy, &pieces);
        let mut view = TrulyView {
            slots_before: mesh.corners().len(),
            mesh,
            open: List::default(),
            last: List::default(),
            place: vec![NONE; n],
            dependents: vec![0; n],
            marked: vec![0; n.div_ceil(64)],
            gap: Gap::default(),
            guard: true,
            guarded: Guarded::default(),
            unfinished: None,
            hierarchy,
            pieces,
        };
        for v in 0..view.hierarchy.mesh().base_vertices() as u32 {
            view.offer(v);
        }
        view
    }

    /// What it is a view of.
    pub fn hierarchy(&self) -> &Arc<Hierarchy> {
        &self.hierarchy
    }

    /// Whether [`TrulyView::adapt`] holds faces from folding over; see the [module](self). At first it does.
    pub fn set_guard(&mut self, guard: bool) {
        self.guard = guard;
    }

    /// Faces shown.
    pub fn face_count(&self) -> usize {
        self.mesh.face_count()
    }

    /// Vertices shown.
    pub fn vertex_count(&self) -> usize {
        self.mesh.vertex_count()
    }

    /// True if split `i` is applied. Panics if there is no such split.
    pub fn is_applied(&self, i: usize) -> bool {
        assert!(i < self.hierarchy.splits(), "split {i} of {}", self.hierarchy.splits());
        self.mesh.is_applied(i as u32)
    }

    /// The applied splits, ascending. O(n).
    pub fn applied(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.hierarchy.splits()).filter(|&i| self.mesh.is_applied(i as u32))
    }

    /// The splits that split `i` needs: the one that made its vertex, and the one that parts its cut vertices. Panics if there is no such split.
    pub fn dependencies(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        self.needs(i as u32).map(|d| d as usize)
    }

    /// True if split `i` is not applied, and all that it needs is. Panics if there is no such split.
    pub fn may_split(&self, i: usize) -> bool {
        !self.is_applied(i) && self.needs(i as u32).all(|d| self.mesh.is_applied(d))
    }

    /// True if split `i` is applied, and no applied one needs it. Panics if there is no such split.
    pub fn may_collapse(&self, i: usize) -> bool {
        self.is_applied(i) && self.dependents[i] == 0
    }

    /// Applies split `i` and all it needs, without the guard; returns how many splits that were. O(those, times valence). Panics if there is no such split.
    pub fn split(&mut self, i: usize) -> usize {
        assert!(i < self.hierarchy.splits(), "split {i} of {}", self.hierarchy.splits());
        let mut all = Vec::new();
        self.closure(i as u32, &mut all);
        all.iter().filter(|&&j| self.find(j) && self.apply(j)).count()
    }

    /// Undoes split `i` if it is applied and no applied one needs it, without the guard; says whether it did. O(valence). Panics if there is no such split.
    pub fn collapse(&mut self, i: usize) -> bool {
        let may = self.may_collapse(i);
        if may {
            self.undo(i as u32);
        }
        may
    }

    /// What the guard did in the last [`TrulyView::adapt`].
    pub fn guarded(&self) -> Guarded {
        self.guarded
    }

    /// Bytes of what views share besides the hierarchy; of what grows with the mesh shown; of tables over the finest mesh.
    pub fn bytes(&self) -> [usize; 3] {
        let (shown, tables) = self.mesh.bytes();
        let lists = (self.open.0.len() + self.last.0.len()) * size_of::<Entry>();
        let own = 4 * (self.place.len() + self.dependents.len()) + 8 * self.marked.len();
        [self.pieces.bytes(), shown + lists, tables + own]
    }

    /// What split `i` needs, each once but that both may be the same.
    fn needs(&self, i: u32) -> impl Iterator<Item = u32> + use<> {
        let both = [self.pieces.up(i), self.pieces.apart(i)];
        both.into_iter().filter(|&d| d != NONE)
    }

    /// Appends split `i` and all it needs that is not applied, in an order in which they can be.
    fn closure(&mut self, i: u32, out: &mut Vec<u32>) {
        out.clear();
        if self.mesh.is_applied(i) {
            return;
        }
        self.marked[i as usize / 64] |= 1 << (i % 64);
        out.push(i);
        let mut k = 0;
        while let Some(&j) = out.get(k) {
            for d in self.needs(j) {
                let (word, bit) = (d as usize / 64, 1u64 << (d % 64));
                if self.marked[word] & bit == 0 && !self.mesh.is_applied(d) {
                    self.marked[word] |= bit;
                    out.push(d);
                }
            }
            k += 1;
        }
        out.iter().for_each(|&j| self.marked[j as usize / 64] &= !(1 << (j % 64)));
        out.sort_unstable();
    }

    /// Finds where split `i` opens its vertex; false if what it needs is not applied.
    fn find(&mut self, i: u32) -> bool {
        if !self.may_split(i as usize) {
            return false;
        }
        let from = self.pieces.face_at(&self.hierarchy, i);
        let found = self.mesh.locate(&self.hierarchy, &self.pieces, i, from, &mut self.gap);
        // By the proof above; the recorded sequence was gone through.
        debug_assert!(found, "split {i} finds no place");
        found
    }

    /// Applies split `i`, which has just been found.
    fn apply(&mut self, i: u32) -> bool {
        self.mesh.split(&self.hierarchy, &self.pieces, i, &self.gap);
        let e = self.open.remove(i, &mut self.place).unwrap_or_else(|| entry(&self.hierarchy, i));
        self.last.put(e, &mut self.place);
        for d in self.needs(i) {
            self.dependents[d as usize] += 1;
            self.last.remove(d, &mut self.place);
        }
        for k in self.hierarchy.forest.nodes(i) {
            self.offer(k);
        }
        true
    }

    /// Undoes split `i`, which is applied, and which no applied one needs.
    fn undo(&mut self, i: u32) {
        for k in self.hierarchy.forest.nodes(i) {
            let below = self.pieces.split_of(k);
            if below != NONE {
                self.open.remove(below, &mut self.place);
            }
        }
        self.mesh.unsplit(&self.hierarchy, &self.pieces, i);
        let e = self.last.remove(i, &mut self.place).unwrap_or_else(|| entry(&self.hierarchy, i));
        self.open.put(e, &mut self.place);
        for d in self.needs(i) {
            self.dependents[d as usize] -= 1;
            if self.dependents[d as usize] == 0 && self.place[d as usize] == NONE {
                self.last.put(entry(&self.hierarchy, d), &mut self.place);
            }
        }
    }

    /// Node `k` is in the mesh now: what replaces it can be applied.
    fn offer(&mut self, k: u32) {
        let i = self.pieces.split_of(k);
        if i != NONE && self.place[i as usize] == NONE {
            self.open.put(entry(&self.hierarchy, i), &mut self.place);
        }
    }
}

/// All that decides about split `i`.
#[inline]
fn entry(h: &Hierarchy, i: u32) -> Entry {
    Entry::new(i, h.local_centre(i), h.bounds.of[i as usize])
}

/// Splits in no order.
#[derive(Clone, Debug, Default)]
struct List(Vec<Entry>);

impl List {
    fn put(&mut self, e: Entry, place: &mut [u32]) {
        place[e.split as usize] = self.0.len() as u32;
        self.0.push(e);
    }

    /// Split `i`, if it is in this list.
    fn get(&self, i: u32, place: &[u32]) -> Option<&Entry> {
        self.0.get(place[i as usize] as usize).filter(|e| e.split == i)
    }

    /// Takes split `i` out, if it is in this list.
    fn remove(&mut self, i: u32, place: &mut [u32]) -> Option<Entry> {
        self.get(i, place)?;
        let at = std::mem::replace(&mut place[i as usize], NONE) as usize;
        let e = self.0.swap_remove(at);
        if let Some(moved) = self.0.get(at) {
            place[moved.split as usize] = at as u32;
        }
        Some(e)
    }
}
