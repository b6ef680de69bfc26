//! What splits depend on: by their cuts (the l/r rule), or by all faces around their vertex (the ring rule).
//!
//! **The ring rule.** A split *touches* the faces around its vertex, those it makes included; a collapse the same faces. Split `i` needs, of every face around its vertex in `M^i`, the last
//! split before that touched it. Let S be a set of splits closed under that. Then
//!
//! 1. all splits before `i` that touched a face around its vertex are in S with `i`: each of them had that face around its own vertex, so it needs the one before. And no other
//!    split of S has touched the face when those of S are made in their order. So the face is, with corners, places and links, what it is in `M^i`: the ring of a split, before and
//!    after, is the same in every mesh of the hierarchy;
//! 2. two splits that share a face are comparable, so those that are not can be exchanged, and whatever the order, what a collapse replaces and what it leaves is the same two patches;
//! 3. a point that is carried along, from a place on a patch to a place on what the collapse leaves of it, takes the same way in every mesh of the hierarchy: how far it goes depends on S,
//!    where it comes past does not. Its place in the mesh of S is the one it has after the last collapse that is not in S and moved it.
//!
//! So what one walk finds holds for all views. The rule needs more than that of the cuts: where the splits come in the order of their errors, a third to a half
//! more splits than are needed themselves.

use super::Forest;
use super::offsets::Offsets;
use crate::aif::NONE;
use crate::packed::{Packed, Run};
use crate::progressive::{Damage, ProgressiveMesh};
use crate::selective::Front;

/// For every split those it needs directly, and of which nothing else that it needs tells as much.
#[derive(Clone, Debug, Default)]
pub(crate) struct Needs {
    starts: Offsets,
    on: Packed,
}

impl Needs {
    /// By the cuts.
    pub(super) fn of_cuts(pm: &ProgressiveMesh) -> Needs {
        let (mut starts, mut all) = (vec![0], Vec::new());
        for on in pm.dependencies() {
            let mut on = on;
            on.sort_unstable();
            let from = all.len();
            for d in on.into_iter().filter(|&d| d != NONE) {
                if all.len() == from || all.last() != Some(&d) {
                    all.push(d);
                }
            }
            starts.push(all.len() as u32);
        }
        Needs { starts: Offsets::new(&starts), on: Packed::of(&all) }
    }

    /// What split `i` needs, each once.
    #[inline]
    pub(crate) fn of(&self, i: u32) -> Run<'_> {
        self.on.run(self.starts.run(i))
    }

    pub(crate) fn bytes(&self) -> usize {
        self.starts.bytes() + self.on.bytes()
    }
}

/// Collects what splits need by the ring rule, while they are made in their order.
pub(super) struct Rings {
    /// As of [`Needs`].
    starts: Vec<u32>,
    all: Vec<u32>,
    /// The last split that touched each face.
    last: Vec<u32>,
    /// Faces at each vertex, of all its fans.
    valence: Vec<u32>,
    star: Vec<u32>,
    on: Vec<u32>,
    /// The longest chain of splits up to each, itself included.
    turns: Vec<u32>,
    /// No split moved a vertex with faces that are not around its cuts.
    whole: bool,
}

impl Rings {
    pub(super) fn new(pm: &ProgressiveMesh, front: &Front) -> Rings {
        let mut valence = vec![0; pm.vertices()];
        // The base: every slot has a face.
        for w in front.corners().iter().flatten() {
            valence[front.wedge_vertex(*w) as usize] += 1;
        }
        Rings {
            starts: vec![0],
            all: Vec::new(),
            last: vec![NONE; pm.faces()],
            valence,
            star: Vec::new(),
            on: Vec::new(),
            turns: Vec::with_capacity(pm.splits.len()),
            whole: true,
        }
    }

    /// Before split `i` is made.
    pub(super) fn before(
        &mut self,
        pm: &ProgressiveMesh,
        forest: &Forest,
        front: &Front,
        i: u32,
    ) -> Result<(), Damage> {
        self.star.clear();
        front.ring(pm, forest, i, &mut self.star)?;
        let face = |slot: u32| front.face_in(forest, slot);
        self.on.clear();
        self.on.push(forest.maker(forest.parent(pm, i)));
        self.on.extend(self.star.iter().map(|&s| self.last[face(s) as usize]));
        self.on.retain(|&d| d != NONE);
        // The latest first: what it needs is needed through it.
        self.on.sort_unstable_by(|a, b| b.cmp(a));
        self.on.dedup();
        let from = self.all.len();
        let of = |i: u32, starts: &[u32]| starts[i as usize] as usize..starts[i as usize + 1] as usize;
        self.turns.push(self.on.iter().map(|&d| self.turns[d as usize]).max().unwrap_or(0) + 1);
        for &d in &self.on {
            let through = |&e: &u32| {
                let needs = |k: u32| &self.all[of(k, &self.starts)];
                needs(e).contains(&d) || needs(e).iter().any(|&k| k > d && needs(k).contains(&d))
            };
            if !self.all[from..].iter().any(through) {
                self.all.push(d);
            }
        }
        self.starts.push(self.all.len() as u32);
        let vs = pm.splits.vertex[i as usize] as usize;
        self.whole &= !pm.splits.code[i as usize].moves() || self.valence[vs] as usize == self.star.len();
        for &s in &self.star {
            self.last[face(s) as usize] = i;
        }
        Ok(())
    }

    /// After it.
    pub(super) fn after(&mut self, pm: &ProgressiveMesh, forest: &Forest, front: &Front, i: u32) {
        let made = 1 + pm.splits.code[i as usize].two_faces() as u32;
        let first = forest.first_face(i);
        let (vs, vu) = (pm.splits.vertex[i as usize], forest.base_vertices + i);
        for f in first..first + made {
            self.last[f as usize] = i;
            for w in front.corners()[front.slot_of(forest, f) as usize] {
                self.valence[front.wedge_vertex(w) as usize] += 1;
            }
        }
        let [_, new] = front.middle(pm, i);
        self.star.clear();
        front.star(new, &mut self.star);
        let went = self.star.len() as u32 - made.min(self.star.len() as u32);
        self.valence[vu as usize] = self.star.len() as u32;
        self.valence[vs as usize] -= went.min(self.valence[vs as usize]);
    }

    /// What splits need, and the longest chains to each; `None` if the rule does not hold for this mesh.
    pub(super) fn finish(self) -> Option<(Needs, Vec<u32>)> {
        let mut dependents = vec![0u32; self.turns.len()];
        self.all.iter().for_each(|&d| dependents[d as usize] += 1);
        // Views count them in 16 bits.
        let few = dependents.iter().all(|&n| n <= u16::MAX.into());
        let needs = Needs { starts: Offsets::new(&self.starts), on: Packed::of(&self.all) };
        (self.whole && few).then_some((needs, self.turns))
    }
}
