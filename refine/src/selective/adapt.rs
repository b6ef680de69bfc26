//! From the mesh of the last frame to that of this one.

use super::clock::{Clock, Found, Judges};
use super::entry::Entry;
use super::{Lens, Split, View};
use crate::aif::NONE;

/// How far a frame may go.
#[derive(Clone, Copy)]
pub struct Limits<'a> {
    /// The mesh gets no more faces than this by splits (what a split depends on counted in), unless it had more before.
    pub faces: usize,
    /// Splits and undone splits, together, at most.
    pub operations: usize,
    /// Asked before the first and then after every 64 operations or 512 looks at a split; true ends the frame.
    pub expired: Option<&'a dyn Fn() -> bool>,
    /// A split that is not needed stays until it is not needed at this times the tolerance either; 1 for none, 0.7 to 0.9 lets a view that
    /// moves to and fro keep what it has. Above 0, at most 1.
    pub hysteresis: f64,
}

impl Default for Limits<'_> {
    /// None.
    fn default() -> Self {
        Limits { faces: usize::MAX, operations: usize::MAX, expired: None, hysteresis: 1.0 }
    }
}

/// What [`View::adapt`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Done {
    /// Splits applied.
    pub splits: usize,
    /// Splits undone.
    pub collapses: usize,
    /// Of the splits, those that were not needed themselves.
    pub forced: usize,
    /// Nothing was left to do: the mesh is the one the lens asks for.
    pub complete: bool,
    /// Splits that were needed and would have led beyond the limit of faces, or were left when there was no more room.
    pub refused: usize,
}

impl Done {
    /// Nothing to do: what sums begin with.
    pub const NOTHING: Done = Done { splits: 0, collapses: 0, forced: 0, complete: true, refused: 0 };
}

/// Of several meshes: complete if all are.
impl std::ops::AddAssign for Done {
    fn add_assign(&mut self, other: Done) {
        self.splits += other.splits;
        self.collapses += other.collapses;
        self.forced += other.forced;
        self.complete &= other.complete;
        self.refused += other.refused;
    }
}

/// Operations between two questions for the time.
const BETWEEN: usize = 64;
/// Looks at splits that count as many operations: a look takes about a tenth of an operation's time.
const LOOKS: usize = 512;
/// Needed splits that are found too large for the faces left, before a frame gives up: each takes a walk over what it depends on. With 64 the limit of 20,000 faces is used but for 5 at most on dragon.
const REFUSALS: usize = 64;

/// What is left of the limits.
pub(crate) struct Meter<'a> {
    pub(crate) limits: Limits<'a>,
    pub(crate) done: Done,
    pub(crate) since: usize,
    pub(crate) looks: usize,
    pub(crate) over: bool,
}

impl<'a> Meter<'a> {
    pub(crate) fn new(limits: &Limits<'a>) -> Self {
        Meter { limits: *limits, done: Done::default(), since: BETWEEN, looks: 0, over: false }
    }

    /// False when it is time to end.
    #[inline]
    pub(crate) fn goes_on(&mut self) -> bool {
        if self.done.splits + self.done.collapses >= self.limits.operations {
            self.over = true;
        }
        if self.since >= BETWEEN || self.looks >= LOOKS {
            (self.since, self.looks) = (0, 0);
            self.over |= self.limits.expired.is_some_and(|f| f());
        }
        !self.over
    }

    /// Room for faces.
    pub(super) fn room(&self, faces: usize) -> usize {
        self.limits.faces.saturating_sub(faces)
    }

    /// There is no more room for faces, or enough was tried that it is too little for.
    pub(crate) fn is_full(&self, faces: usize) -> bool {
        self.room(faces) == 0 || self.done.refused >= REFUSALS
    }
}

/// A record that is due.
#[derive(Clone, Copy)]
pub(super) struct Due {
    pub(super) record: u32,
    /// The split that it is of: it may be used again.
    pub(super) made: u32,
    /// The slack of the decision to keep that split; 0 if that was not found.
    pub(super) kept: f32,
}

/// What was found out about a record ahead: whether to keep its split, if that could be undone, and whether the next is needed.
#[derive(Clone, Copy)]
pub(super) struct Look {
    keep: Option<Found>,
    pub(super) next: Option<Found>,
}

/// Splits that are looked at, or got ready, at a time: enough that memory is waited for together, and few enough to be in the nearest cache.
pub(super) const LOT: usize = 32;

/// Records from which on threads look ahead: below, handing out the work takes as long.
#[cfg(feature = "parallel")]
const MANY: usize = 4096;

impl View {
    /// Adapts the mesh to a lens, as far as the limits allow: first undoes what is not needed, then applies what is, the worst first.
    ///
    /// O(valence) for every split applied or undone, looks at those vertices shown of which something may have changed since they were looked at last, and 1 ns or less for each of the
    /// others. A frame that a limit cut short is taken up by the next.
    pub fn adapt(&mut self, lens: &Lens, limits: &Limits<'_>) -> Done {
        self.adapt_to_all(std::slice::from_ref(lens), limits)
    }

    /// As [`View::adapt`], to several lenses: what any of them needs is needed. For a mesh that stands in several places. Without lenses nothing is needed.
    pub fn adapt_to_all(&mut self, lenses: &[Lens], limits: &Limits<'_>) -> Done {
        let mut meter = Meter::new(limits);
        let judges = Judges::new(lenses, limits.hysteresis);
        let stands = self.clock.go_on(&judges);
        let mut due = self.take_due(!stands);
        // First what a limit cut short: else coarsening would undo what is only there for the rest of it, frame after frame.
        if let Some(i) = self.unfinished.take()
            && !self.front.is_applied(i)
            && judges.want(&Entry::of(&self.hierarchy, i))
        {
            self.apply_with_all(&Split::new(i), &mut meter, &mut Vec::new());
        }
        let ahead = self.look_ahead(&due, &judges, limits);
        self.resume = 0;
        if !meter.over {
            self.coarsen(&judges, &mut meter, &mut due, &ahead);
        }
        if !meter.over {
            self.refine(&judges, &mut meter, &due, &ahead);
        }
        self.front.settle();
        meter.done.complete = !meter.over && meter.done.refused == 0;
        meter.done
    }

    /// The records that are due, from where the last frame was cut short; all of them if nothing stands. Until they have been looked at they stay due.
    fn take_due(&mut self, all: bool) -> Vec<Due> {
        let (now, late) = (self.clock.now(), self.clock.late());
        let mut due = Vec::new();
        let mut first = 0;
        for block in self.front.records.chunks_mut(16) {
            // Most are not: asked without a branch for each.
            if all || block.iter().fold(false, |any, r| any | Clock::has_come(now, r.due)) {
                for (k, r) in (first..).zip(block.iter_mut()) {
                    if r.is_free() {
                        r.due = late;
                    } else if all || Clock::has_come(now, r.due) {
                        r.due = now;
                        due.push(Due { record: k, made: r.made, kept: 0.0 });
                    }
                }
            }
            first += 16;
        }
        let from = due.partition_point(|d| d.record < self.resume);
        due.rotate_left(from);
        due
    }

    /// What is to be known of all that is due. Who goes through it asks for what would be found out otherwise, so its being there changes nothing but the time: it is found out in one go for all, or by
    /// several threads. Not where a deadline may come first.
    fn look_ahead(&self, due: &[Due], judges: &Judges<'_>, limits: &Limits<'_>) -> Vec<Look> {
        if limits.expired.is_some() && due.len() > LOOKS {
            return Vec::new();
        }
        #[cfg(feature = "parallel")]
        if due.len() >= MANY && rayon::current_num_threads() > 1 {
            use rayon::prelude::*;
            let parts: Vec<Vec<Look>> = due.par_chunks(MANY / 4).map(|d| self.look_at(d, judges)).collect();
            return parts.concat();
        }
        self.look_at(due, judges)
    }

    /// Each step for a lot before the next: they wait for memory, and then wait together.
    fn look_at(&self, due: &[Due], judges: &Judges<'_>) -> Vec<Look> {
        let (h, forest) = (&*self.hierarchy, &self.hierarchy.forest);
        let (last, next) = (judges.last(&self.clock), judges.next(&self.clock));
        let mut looks = vec![Look { keep: None, next: None }; due.len()];
        let (mut entries, mut found) = (Vec::with_capacity(LOT), Vec::with_capacity(LOT));
        for (part, looks) in due.chunks(LOT).zip(looks.chunks_mut(LOT)) {
            // The splits of each vertex, and how many of them are applied; of the vertex that was split to make it as well.
            let mut chains = [[&[][..]; 2]; LOT];
            let mut turns = [0; LOT];
            let mut lasts = [false; LOT];
            for ((chains, is), d) in chains.iter_mut().zip(&mut lasts).zip(part) {
                chains[0] = forest.chain(self.front.vertex_of_record(d.record));
                *is = self.is_last(d);
                chains[1] = if *is { forest.chain(h.mesh().splits.vertex[d.made as usize]) } else { &[] };
            }
            for (t, chains) in turns.iter_mut().zip(&chains) {
                *t = self.front.turns_of(chains[0]);
            }
            entries.clear();
            found.clear();
            for ((d, chains), _) in part.iter().zip(&chains).zip(lasts).filter(|l| l.1) {
                let turn = chains[1].iter().position(|&i| i >= d.made).unwrap_or(0);
                let v = h.mesh().splits.vertex[d.made as usize];
                entries.push(Entry::after(h, d.made, v, &chains[1][..turn]));
            }
            last.look(&entries, &mut found);
            let kept = looks.iter_mut().zip(lasts).filter(|l| l.1);
            kept.zip(&found).for_each(|((look, _), &f)| look.keep = Some(f));
            entries.clear();
            found.clear();
            let mut open = [false; LOT];
            for (((d, chains), &turn), open) in part.iter().zip(&chains).zip(&turns).zip(&mut open) {
                if self.front.records[d.record as usize].made == d.made
                    && let Some(&i) = chains[0].get(turn)
                {
                    *open = true;
                    let v = self.front.vertex_of_record(d.record);
                    entries.push(Entry::after(h, i, v, &chains[0][..turn]));
                }
            }
            next.look(&entries, &mut found);
            let open = looks.iter_mut().zip(open).filter(|l| l.1);
            open.zip(&found).for_each(|((look, _), &f)| look.next = Some(f));
        }
        looks
    }

    /// The record is still what it was, and nothing depends on its split: that could be undone.
    #[inline]
    fn is_last(&self, d: &Due) -> bool {
        let r = &self.front.records[d.record as usize];
        d.made != NONE && r.made == d.made && r.dependents == 0
    }

    /// Undoes splits that are not needed, until none is left that could be.
    fn coarsen(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, due: &mut [Due], ahead: &[Look]) {
        let mut freed = Vec::new();
        for (k, d) in due.iter_mut().enumerate() {
            if !meter.goes_on() {
                self.resume = d.record;
                return;
            }
            // What has become free in the meantime is in the other list.
            if !self.is_last(d) || (!ahead.is_empty() && ahead[k].keep.is_none()) {
                continue;
            }
            meter.looks += 1;
            let known = ahead.get(k).and_then(|a| a.keep);
            let look = || judges.of_last(&Entry::of(&self.hierarchy, d.made), &self.clock).into();
            let found = known.unwrap_or_else(look);
            if found.wanted {
                d.kept = found.slack;
                continue;
            }
            self.undo_and_list(d.made, &mut freed);
            meter.done.collapses += 1;
            meter.since += 1;
        }
        let last = judges.last(&self.clock);
        let (mut entries, mut kept) = (Vec::new(), Vec::new());
        while !freed.is_empty() {
            let lot = freed.split_off(freed.len().saturating_sub(LOT));
            entries.clear();
            kept.clear();
            entries.extend(lot.iter().map(|&i| Entry::of(&self.hierarchy, i)));
            last.wanted(&entries, &mut kept);
            meter.looks += lot.len();
            for (&i, _) in lot.iter().zip(&kept).filter(|k| !k.1) {
                // What is left of the list is due, as it has become free.
                if !meter.goes_on() {
                    self.resume = due.first().map_or(0, |d| d.record);
                    return;
                }
                // It may have come in twice.
                if self.front.is_applied(i) && self.is_free(i) {
                    self.undo_and_list(i, &mut freed);
                    meter.done.collapses += 1;
                    meter.since += 1;
                }
            }
        }
    }

    /// Undoes split `i`; appends what has become free by that.
    #[inline]
    fn undo_and_list(&mut self, i: u32, freed: &mut Vec<u32>) {
        self.undo(i);
        let needs = self.hierarchy.forest.needs.of(i);
        freed.extend(needs.iter().copied().filter(|&n| self.is_free(n)));
    }
}
