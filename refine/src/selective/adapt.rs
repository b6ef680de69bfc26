//! From the mesh of the last frame to that of this one.

use super::clock::{Clock, Judges, Verdict};
use super::entry::Entry;
use super::queue::Queue;
use super::{Lens, View};
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
    fn room(&self, faces: usize) -> usize {
        self.limits.faces.saturating_sub(faces)
    }

    /// There is no more room for faces, or enough was tried that it is too little for.
    pub(crate) fn is_full(&self, faces: usize) -> bool {
        self.room(faces) == 0 || self.done.refused >= REFUSALS
    }
}

/// A record that is due.
#[derive(Clone, Copy)]
struct Due {
    record: u32,
    /// The split that it is of: it may be used again.
    made: u32,
    /// The slack of the decision to keep that split, if that was found.
    kept: Option<f64>,
}

/// What was found out about a record ahead: whether to keep its split, if that could be undone, and whether the next is needed.
#[derive(Clone, Copy)]
struct Look {
    keep: Option<Verdict>,
    next: Option<(u32, Verdict)>,
}

/// How far [`View::apply_with_all`] came.
enum Applied {
    Wholly,
    /// There is no room for the faces.
    Refused,
    /// Another limit cut it short.
    Partly,
}

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
            self.apply_with_all(i, &mut meter, &mut Vec::new());
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
                        due.push(Due { record: k, made: r.made, kept: None });
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

    /// Each step for all before the next: they wait for memory, and then wait together.
    fn look_at(&self, due: &[Due], judges: &Judges<'_>) -> Vec<Look> {
        let h = &*self.hierarchy;
        let mut keep: Vec<Option<Entry>> = Vec::with_capacity(due.len());
        let mut next: Vec<Option<Entry>> = Vec::with_capacity(due.len());
        // Vertices, and how many of their splits are applied.
        let turns = due.iter().map(|d| {
            let there = self.front.records[d.record as usize].made == d.made;
            let v = self.front.vertex_of_record(d.record);
            there.then(|| (v, self.front.turns(&h.forest, v)))
        });
        let turns: Vec<Option<(u32, usize)>> = turns.collect();
        keep.extend(due.iter().map(|d| self.is_last(d).then(|| Entry::of(h, d.made))));
        next.extend(turns.iter().map(|t| {
            let (v, k) = (*t)?;
            h.forest.chain(v).get(k).map(|&i| Entry::after(h, i, v, k))
        }));
        let look = |(keep, next): (Option<Entry>, Option<Entry>)| Look {
            keep: keep.map(|e| judges.of_last(&e, &self.clock)),
            next: next.map(|e| (e.split, judges.of_next(&e, &self.clock))),
        };
        keep.into_iter().zip(next).map(look).collect()
    }

    /// The record is still what it was, and nothing depends on its split: that could be undone.
    #[inline]
    fn is_last(&self, d: &Due) -> bool {
        let r = &self.front.records[d.record as usize];
        d.made != NONE && r.made == d.made && r.dependents == 0
    }

    /// Undoes splits that are not needed, until none is left that could be.
    fn coarsen(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, due: &mut [Due], ahead: &[Look]) {
        let mut stack = Vec::new();
        for (k, d) in due.iter_mut().enumerate() {
            if !meter.goes_on() {
                self.resume = d.record;
                return;
            }
            if !self.is_last(d) {
                continue;
            }
            meter.looks += 1;
            let known = ahead.get(k).and_then(|a| a.keep);
            let look = || judges.of_last(&Entry::of(&self.hierarchy, d.made), &self.clock);
            let verdict = known.unwrap_or_else(look);
            if verdict.wanted {
                d.kept = Some(verdict.slack);
                continue;
            }
            stack.push((d.made, true));
            while let Some((i, sure)) = stack.pop() {
                // It may have come in twice.
                if !self.front.is_applied(i) || !self.is_free(i) {
                    continue;
                }
                if !sure {
                    meter.looks += 1;
                    if judges.keep(&Entry::of(&self.hierarchy, i)) {
                        continue;
                    }
                }
                // What is left on the stack is due, as it has become free.
                if !meter.goes_on() {
                    self.resume = d.record;
                    return;
                }
                self.undo(i);
                meter.done.collapses += 1;
                meter.since += 1;
                let needs = self.hierarchy.forest.needs.of(i).iter();
                stack.extend(needs.filter(|&&n| self.is_free(n)).map(|&n| (n, false)));
            }
        }
    }

    /// Applies split `i` and all it depends on.
    fn apply_with_all(&mut self, i: u32, meter: &mut Meter<'_>, closure: &mut Vec<u32>) -> Applied {
        closure.clear();
        // A split makes a face at least.
        let room = meter.room(self.face_count());
        let fits = self.closure(i, room, closure);
        if meter.limits.faces < usize::MAX {
            let forest = &self.hierarchy.forest;
            let faces: usize = closure.iter().map(|&j| 1 + forest.two_faces(j) as usize).sum();
            if !fits || faces > room {
                meter.done.refused += 1;
                return Applied::Refused;
            }
        }
        for &j in &*closure {
            if !meter.goes_on() {
                self.unfinished = Some(i);
                return Applied::Partly;
            }
            self.apply(j);
            meter.done.splits += 1;
            meter.since += 1;
            meter.done.forced += usize::from(j != i);
        }
        Applied::Wholly
    }

    /// The splits that replace the vertices that split `i` makes, to be decided about.
    #[inline]
    fn below(&self, i: u32) -> [Option<Entry>; 2] {
        let h = &*self.hierarchy;
        let old = h.mesh().splits.vertex[i as usize];
        let chain = h.forest.chain(old);
        // Mostly the last but few.
        let turn = chain.iter().rposition(|&k| k <= i).map_or(0, |k| k + 1);
        let (at, moved) = h.forest.places_after(h.mesh(), i);
        let next = chain
            .get(turn)
            .map(|&below| Entry::at(h, below, moved.unwrap_or_else(|| h.forest.place(h.mesh(), old, turn))));
        let new = h.forest.chain(h.forest.base_vertices + i).first();
        [next, new.map(|&below| Entry::at(h, below, at))]
    }

    /// Applies splits that are needed, until none is left.
    fn refine(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, due: &[Due], ahead: &[Look]) {
        // What comes first matters only if not all will be done.
        let sorted = meter.limits.faces < usize::MAX
            || meter.limits.operations < usize::MAX
            || meter.limits.expired.is_some();
        let mut queue = Queue::new(sorted, self.hierarchy.splits());
        for (k, d) in due.iter().enumerate() {
            if !meter.goes_on() {
                self.resume = d.record;
                return;
            }
            let record = self.front.records[d.record as usize];
            if record.made != d.made {
                continue;
            }
            // What has become free since it was looked at stays due.
            let kept = match d.kept {
                _ if d.made == NONE || record.dependents > 0 => f64::INFINITY,
                Some(slack) => slack,
                None => 0.0,
            };
            let Some((i, v, turn)) = self.next(d.record) else {
                self.front.records[d.record as usize].due = self.clock.due(kept, d.record);
                continue;
            };
            meter.looks += 1;
            let known = ahead.get(k).and_then(|a| a.next).filter(|n| n.0 == i);
            let entry = || Entry::after(&self.hierarchy, i, v, turn);
            let verdict = known.map_or_else(|| judges.of_next(&entry(), &self.clock), |n| n.1);
            if verdict.wanted {
                queue.push(i, || judges.rank(&entry()));
            } else {
                self.front.records[d.record as usize].due = self.clock.due(kept.min(verdict.slack), d.record);
            }
        }
        let mut closure = Vec::new();
        while let Some(i) = queue.pop() {
            // Others may have needed it before.
            if !self.front.is_applied(i) {
                if meter.is_full(self.face_count()) {
                    meter.done.refused += 1 + queue.len();
                    return;
                }
                match self.apply_with_all(i, meter, &mut closure) {
                    Applied::Wholly => {}
                    Applied::Refused => continue,
                    Applied::Partly => return,
                }
            }
            // Below what only others need nothing is needed, as bounds nest.
            for e in self.below(i).into_iter().flatten().filter(|e| judges.want(e)) {
                queue.push(e.split, || judges.rank(&e));
            }
        }
    }
}
