//! From the mesh of the last frame to that of this one.

use super::{TrulyView, entry, guard};
use crate::aif::NONE;
use crate::selective::{Done, Entry, Lens, Limits, Meter};
use std::collections::BinaryHeap;

/// What the flip guard did in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Guarded {
    /// Splits that are not needed and would turn a face away or flatten one if they were undone: they stay.
    pub deferred: usize,
    /// Splits made with others that would have turned a face away or flattened one: those that the others need by the hierarchy's own rule, before them, and those that turn faces back, behind them.
    pub through: usize,
    /// Splits that turned a face away even so, or flattened one, and it could not be turned back.
    pub turned: usize,
}

/// Of several meshes.
impl std::ops::AddAssign for Guarded {
    fn add_assign(&mut self, other: Guarded) {
        self.deferred += other.deferred;
        self.through += other.through;
        self.turned += other.turned;
    }
}

/// Attempts to turn back what a split turned.
const TURNS: usize = 32;

impl TrulyView {
    /// Adapts the mesh to a lens, as far as the limits allow: first undoes what is not needed, then applies what is, the worst first.
    ///
    /// O(vertices shown) looks, and O(valence) for every split applied or undone. A frame that a limit cut short begins anew in the next.
    pub fn adapt(&mut self, lens: &Lens, limits: &Limits<'_>) -> Done {
        self.adapt_to_all(std::slice::from_ref(lens), limits)
    }

    /// As [`TrulyView::adapt`], to several lenses: what any of them needs is needed. Without lenses nothing is.
    pub fn adapt_to_all(&mut self, lenses: &[Lens], limits: &Limits<'_>) -> Done {
        self.guarded = Guarded::default();
        let guard = self.guard && lenses.iter().any(|l| l.tau().is_finite());
        let mut meter = Meter::new(limits);
        // First what a limit cut short, so that coarsening does not undo what is only there for the rest of it.
        if let Some(i) = self.unfinished.take()
            && !self.mesh.is_applied(i)
            && wants(lenses, &entry(&self.hierarchy, i), 1.0)
        {
            self.apply_with_all(i, guard, &mut meter, &mut Vec::new());
        }
        if !meter.over {
            self.coarsen(lenses, guard, &mut meter);
        }
        if !meter.over {
            self.refine(lenses, guard, &mut meter);
        }
        meter.done.complete = !meter.over && meter.done.refused == 0;
        meter.done
    }

    /// Undoes splits that are not needed, until none is left that could be. Looks once at all that could be undone, and as they come at those that can be then; after that only at those that the guard held
    /// back, for as long as one of them goes: each collapse may be what another has waited for.
    fn coarsen(&mut self, lenses: &[Lens], guard: bool, meter: &mut Meter<'_>) {
        let (mut stack, mut waiting) = (Vec::new(), Vec::new());
        let mut at = self.last.0.len();
        while at > 0 && meter.goes_on() {
            // Downwards: what comes in is put at the end, and looked at as it does.
            at = (at - 1).min(self.last.0.len().saturating_sub(1));
            let Some(e) = self.last.0.get(at) else { break };
            stack.push(e.split);
            self.undo_from(&mut stack, &mut waiting, lenses, guard, meter);
        }
        while !waiting.is_empty() && !meter.over {
            let before = meter.done.collapses;
            waiting.sort_unstable();
            waiting.dedup();
            for i in std::mem::take(&mut waiting).into_iter().rev() {
                stack.push(i);
                self.undo_from(&mut stack, &mut waiting, lenses, guard, meter);
            }
            if meter.done.collapses == before {
                break;
            }
        }
        waiting.sort_unstable();
        waiting.dedup();
        self.guarded.deferred = waiting.iter().filter(|&&i| self.last.get(i, &self.place).is_some()).count();
    }

    /// Undoes the splits on the stack that are not needed, and what can be undone then; those that the guard holds back wait.
    fn undo_from(
        &mut self,
        stack: &mut Vec<u32>,
        waiting: &mut Vec<u32>,
        lenses: &[Lens],
        guard: bool,
        meter: &mut Meter<'_>,
    ) {
        let keep = meter.limits.hysteresis.clamp(1e-6, 1.0);
        while let Some(i) = stack.pop() {
            // It may have come in twice.
            let Some(e) = self.last.get(i, &self.place) else { continue };
            meter.looks += 1;
            if wants(lenses, e, keep) {
                continue;
            }
            if !meter.goes_on() {
                stack.clear();
                return;
            }
            if guard && !guard::collapse_is_good(&self.mesh, &self.hierarchy, &self.pieces, i) {
                waiting.push(i);
                continue;
            }
            self.undo(i);
            meter.done.collapses += 1;
            meter.since += 1;
            stack.extend(self.needs(i));
        }
    }

    /// Applies splits that are needed, until none is left.
    fn refine(&mut self, lenses: &[Lens], guard: bool, meter: &mut Meter<'_>) {
        let limits = &meter.limits;
        // What comes first matters only if not all will be done.
        let sorted = limits.faces < usize::MAX || limits.operations < usize::MAX || limits.expired.is_some();
        // Of numbers that are not negative the bits are in their order.
        let urgency = |e: &Entry| lenses.iter().map(|l| l.urgency(e)).fold(0.0, f64::max) as f32;
        let rank = |e: &Entry| if sorted { urgency(e).to_bits() } else { 0 };
        let mut todo = BinaryHeap::new();
        for e in &self.open.0 {
            meter.looks += 1;
            if !meter.goes_on() {
                return;
            }
            if wants(lenses, e, 1.0) {
                todo.push((rank(e), e.split));
            }
        }
        let mut made = Vec::new();
        while let Some((_, i)) = todo.pop() {
            if self.mesh.is_applied(i) {
                continue;
            }
            if !self.apply_with_all(i, guard, meter, &mut made) {
                return;
            }
            for k in made.drain(..).flat_map(|j| self.hierarchy.forest.nodes(j)) {
                let next = self.pieces.split_of(k);
                if next != NONE
                    && let Some(e) = self.open.get(next, &self.place).filter(|e| wants(lenses, e, 1.0))
                {
                    todo.push((rank(e), next));
                }
            }
        }
    }

    /// Applies split `i` and all it needs, and appends what was applied; false if a limit other than that of faces cut it short.
    fn apply_with_all(&mut self, i: u32, guard: bool, meter: &mut Meter<'_>, made: &mut Vec<u32>) -> bool {
        let mut all = Vec::new();
        self.closure(i, &mut all);
        if self.face_count() + self.faces_of(&all) > meter.limits.faces {
            meter.done.refused += 1;
            return true;
        }
        for j in all {
            if !meter.goes_on() {
                self.unfinished = Some(i);
                return false;
            }
            let before = made.len();
            self.apply_guarded(j, guard, meter, made);
            let count = made.len() - before;
            meter.done.splits += count;
            meter.since += count;
            meter.done.forced += count - usize::from(j == i).min(count);
        }
        true
    }

    /// Applies split `j`, whose needs are applied; if it would turn a face, first what it needs by the hierarchy's own rule, then what turns it back.
    fn apply_guarded(&mut self, j: u32, guard: bool, meter: &Meter<'_>, made: &mut Vec<u32>) {
        // Another split of the closure may have been made through it.
        if !self.find(j) {
            return;
        }
        let before = made.len();
        let good = |v: &Self| guard::split_is_good(&v.mesh, &v.hierarchy, &v.pieces, j, &v.gap);
        if !guard || good(self) {
            if self.apply(j) {
                made.push(j);
            }
            return;
        }
        let recorded = self.recorded(j);
        if self.face_count() + self.faces_of(&recorded) + 2 <= meter.limits.faces {
            for d in recorded {
                if self.find(d) && self.apply(d) {
                    made.push(d);
                }
            }
        }
        self.guarded.through += made.len() - before;
        if !self.find(j) {
            return;
        }
        let good = made.len() > before && good(self);
        let mut faces = Vec::new();
        self.apply_noting(j, &mut faces);
        made.push(j);
        if !good {
            self.guarded.turned += usize::from(!self.turn_back(&mut faces, meter, made));
        }
    }

    /// Applies split `i`, which has just been found, and notes the faces around it.
    fn apply_noting(&mut self, i: u32, faces: &mut Vec<u32>) {
        faces.extend(self.gap.ring.iter().map(|e| self.mesh.face_in()[e.face() as usize]));
        let first = self.hierarchy.forest.first_face(i);
        let two = self.hierarchy.mesh().splits.code[i as usize].two_faces();
        faces.extend(first..=first + u32::from(two));
        self.apply(i);
    }

    /// Splits corners of those of the faces that look away, the coarsest first, until none does; false if one is left.
    fn turn_back(&mut self, faces: &mut Vec<u32>, meter: &Meter<'_>, made: &mut Vec<u32>) -> bool {
        let mut all = Vec::new();
        for _ in 0..TURNS {
            let away = faces
                .iter()
                .copied()
                .filter(|&f| guard::looks_away(&self.mesh, &self.hierarchy, &self.pieces, f));
            let next =
                away.map(|f| self.coarsest_corner(f)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            let Some((_, next)) = next else { return true };
            if next == NONE {
                return false;
            }
            self.closure(next, &mut all);
            if self.face_count() + self.faces_of(&all) > meter.limits.faces {
                return false;
            }
            for &d in &all {
                if self.find(d) {
                    self.apply_noting(d, faces);
                    made.push(d);
                    self.guarded.through += 1;
                }
            }
            faces.sort_unstable();
            faces.dedup();
        }
        false
    }

    /// Of the splits of a face's corners the one with the largest error, and that; [`NONE`] if all are as at full detail.
    fn coarsest_corner(&self, f: u32) -> (f64, u32) {
        let splits = self.mesh.corners_of(f).map(|v| self.pieces.split_of(self.mesh.node(v)));
        let error = |s: u32| if s == NONE { -1.0 } else { self.hierarchy.all_bounds().error(s as usize) };
        splits.map(|s| (error(s), s)).into_iter().fold((-2.0, NONE), |a, b| if b.0 > a.0 { b } else { a })
    }

    /// All that split `j` needs by the hierarchy's own rule and is not applied, ascending; not itself.
    fn recorded(&mut self, j: u32) -> Vec<u32> {
        let mut out = vec![j];
        let mut k = 0;
        while let Some(&i) = out.get(k) {
            for d in self.hierarchy.dependencies(i as usize) {
                let (word, bit) = (d / 64, 1u64 << (d % 64));
                if self.marked[word] & bit == 0 && !self.mesh.is_applied(d as u32) {
                    self.marked[word] |= bit;
                    out.push(d as u32);
                }
            }
            k += 1;
        }
        out.swap_remove(0);
        out.iter().for_each(|&d| self.marked[d as usize / 64] &= !(1 << (d % 64)));
        out.sort_unstable();
        out
    }

    /// How many faces splits make.
    fn faces_of(&self, splits: &[u32]) -> usize {
        let code = &self.hierarchy.mesh().splits.code;
        splits.iter().map(|&j| 1 + usize::from(code[j as usize].two_faces())).sum()
    }
}

/// Some lens needs the split at so many times its tolerance.
fn wants(lenses: &[Lens], e: &Entry, keep: f64) -> bool {
    lenses.iter().any(|l| l.wants(e, keep * l.tau()))
}
