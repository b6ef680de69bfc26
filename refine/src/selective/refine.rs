//! The second half of a frame: what is needed is applied.
//!
//! Without limits it is found out first what is needed, then what that depends on, and then all of it is applied as it is numbered: so nothing waits for what comes before it, memory is asked for ahead, and mostly lies close
//! together. With a limit of faces it is found out first, the most urgent splits before the others, what there is room for. With another limit the most urgent splits are applied first, with what each depends on, a lot at a time.

use super::adapt::Meter;
use super::clock::{Judges, Many};
use super::entry::Entry;
use super::queue::Queue;
use super::survey::LOT;
use super::{Split, View};
use crate::hierarchy::Hierarchy;
use glam::Vec3;

/// A split that may come next at a vertex, how many of its splits come before, and where it stands then, about the origin of the bounds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Open {
    pub(super) split: u32,
    pub(super) vertex: u32,
    pub(super) turn: u32,
    pub(super) at: Vec3,
}

/// How far [`View::apply_with_all`] came.
pub(super) enum Applied {
    Wholly,
    /// There is no room for the faces.
    Refused,
    /// Another limit cut it short.
    Partly,
}

/// Needed splits from which on threads look at what is below them.
#[cfg(feature = "parallel")]
const MANY: usize = 2048;

impl Open {
    #[inline]
    fn entry(&self, h: &Hierarchy) -> Entry {
        Entry::placed(h, self.split, self.at)
    }
}

/// The splits that replace the vertices that these make.
fn below(h: &Hierarchy, lot: &[Open], out: &mut Vec<Open>) {
    // Each step for all, so that memory is waited for together; written whether there is one or not, so that nothing hangs on that.
    let mut found = [Open::default(); 2 * LOT];
    let mut n = 0;
    for o in lot.iter().take(LOT) {
        let (new, moved) = h.forest.places_after(h.mesh(), o.split);
        let at = moved.map_or(o.at, |p| h.bounds.local(p));
        let turn = o.turn + 1;
        let next = h.forest.chain(o.vertex).get(turn as usize);
        found[n] = Open { split: next.unwrap_or(0), vertex: o.vertex, turn, at };
        n += usize::from(next.is_some());
        let vertex = h.forest.base_vertices + o.split;
        let first = h.forest.chain(vertex).first();
        let split = first.unwrap_or(0);
        let at = h.bounds.local(new);
        // Of a lot there are two each at most.
        if let Some(slot) = found.get_mut(n) {
            *slot = Open { split, vertex, turn: 0, at };
        }
        n += usize::from(first.is_some());
    }
    out.extend_from_slice(&found[..n]);
}

/// Tells those below `wave` that are needed.
fn each_needed_below(h: &Hierarchy, many: &Many<'_>, wave: &[Open], mut tell: impl FnMut(&Open, &Entry)) {
    let (mut open, mut entries, mut wanted) = (Vec::new(), Vec::new(), Vec::new());
    for lot in wave.chunks(LOT) {
        open.clear();
        entries.clear();
        wanted.clear();
        below(h, lot, &mut open);
        entries.extend(open.iter().map(|o| o.entry(h)));
        many.wanted(&entries, &mut wanted);
        let needed = open.iter().zip(&entries).zip(&wanted).filter(|o| *o.1);
        needed.for_each(|((o, e), _)| tell(o, e));
    }
}

/// Those below `wave` that are needed.
fn needed_below(h: &Hierarchy, many: &Many<'_>, wave: &[Open]) -> Vec<Open> {
    let mut out = Vec::with_capacity(wave.len());
    each_needed_below(h, many, wave, |o, _| out.push(*o));
    out
}

impl View {
    /// Applies splits that are needed, these and those below them, until none is left.
    pub(super) fn refine(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, needed: Vec<Open>) {
        let limits = &meter.limits;
        if limits.operations < usize::MAX || limits.expired.is_some() {
            self.refine_urgently(judges, meter, &needed);
        } else if limits.faces < usize::MAX {
            self.refine_within(judges, meter, &needed);
        } else {
            self.refine_wholly(judges, meter, needed);
        }
    }

    /// Applies all that is needed.
    fn refine_wholly(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, mut wave: Vec<Open>) {
        let many = judges.next(&self.clock);
        let mut needed = 0;
        while !wave.is_empty() {
            needed += wave.len();
            wave.iter().for_each(|o| self.marked.add_if(o.split, true));
            wave = self.next_wave(&many, &wave);
        }
        // What they depend on, the last first: what that depends on is yet to come.
        let View { front, hierarchy, marked, .. } = self;
        marked.each_from_last(|i, marked| {
            hierarchy.forest.needs.of(i).iter().for_each(|d| marked.add_if(d, !front.is_applied(d)));
        });
        let all = self.apply_marked();
        meter.done.splits += all;
        meter.done.forced += all - needed;
    }

    /// Applies the splits that are marked, and takes the marks away; what they depend on is applied, or among them. Returns how many they were.
    fn apply_marked(&mut self) -> usize {
        let mut lot = Vec::with_capacity(LOT);
        let (mut all, mut from) = (0, 0);
        self.front.reserve(self.marked.count());
        while let Some((word, mut bits)) = self.marked.take_word(from) {
            from = word;
            while bits != 0 {
                lot.push(64 * word as u32 + bits.trailing_zeros());
                bits &= bits - 1;
                if lot.len() == LOT {
                    all += self.apply_lot(&lot);
                    lot.clear();
                }
            }
        }
        all + self.apply_lot(&lot)
    }

    #[cfg(feature = "parallel")]
    fn next_wave(&self, many: &Many<'_>, wave: &[Open]) -> Vec<Open> {
        let h = &*self.hierarchy;
        if wave.len() < MANY || rayon::current_num_threads() < 2 {
            return needed_below(h, many, wave);
        }
        use rayon::prelude::*;
        let parts: Vec<Vec<Open>> =
            wave.par_chunks(MANY / 4).map(|part| needed_below(h, many, part)).collect();
        parts.concat()
    }

    #[cfg(not(feature = "parallel"))]
    fn next_wave(&self, many: &Many<'_>, wave: &[Open]) -> Vec<Open> {
        needed_below(&self.hierarchy, many, wave)
    }

    /// Applies splits, [`LOT`] at most, each of which depends on what is applied and on those before it.
    fn apply_lot(&mut self, lot: &[u32]) -> usize {
        let mut ready = [Split::default(); LOT];
        let ready = self.make_ready(lot, &mut ready);
        ready.iter().for_each(|s| self.apply(s));
        ready.len()
    }

    /// Finds the most urgent splits that there is room for, and applies them.
    fn refine_within(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, first: &[Open]) {
        let many = judges.next(&self.clock);
        let h = self.hierarchy.clone();
        let mut queue = Queue::default();
        first.iter().for_each(|o| queue.push(*o, judges.rank(&o.entry(&h))));
        let (mut plan, mut lot, mut done) = (Vec::new(), Vec::new(), Vec::new());
        let (mut faces, mut needed) = (self.face_count(), 0);
        // All that is equally urgent at once, until there is too little room for that.
        let mut together = true;
        while queue.len() > 0 && !meter.is_full(faces) {
            lot.clear();
            queue.pop(if together { usize::MAX } else { LOT }, &mut lot);
            lot.sort_unstable_by_key(|o: &Open| o.split);
            done.clear();
            if together {
                together = self.plan(lot.iter().map(|o| o.split), &mut faces, meter, &mut plan);
                if !together {
                    queue.put_back(&mut lot);
                    continue;
                }
                std::mem::swap(&mut lot, &mut done);
            }
            for (k, o) in lot.iter().enumerate() {
                // Others may have needed it before.
                if !self.marked.has(o.split) {
                    if meter.is_full(faces) {
                        meter.done.refused += lot.len() - k;
                        break;
                    }
                    if !self.plan(std::iter::once(o.split), &mut faces, meter, &mut plan) {
                        meter.done.refused += 1;
                        continue;
                    }
                }
                done.push(*o);
            }
            needed += done.len();
            // Below what only others need nothing is needed, as bounds nest.
            each_needed_below(&h, &many, &done, |o, e| queue.push(*o, judges.rank(e)));
        }
        meter.done.refused += queue.len();
        meter.done.splits += self.apply_marked();
        meter.done.forced += plan.len() - needed;
    }

    /// Marks splits and all they depend on, and counts their faces, if there is room for these; says whether there was.
    fn plan(
        &mut self,
        splits: impl Iterator<Item = u32>,
        faces: &mut usize,
        meter: &Meter<'_>,
        plan: &mut Vec<u32>,
    ) -> bool {
        let (from, room) = (plan.len(), meter.room(*faces));
        // A split makes a face at least.
        let fits = self.mark(splits, room, plan);
        let more = self.faces_of(&plan[from..]);
        if !fits || more > room {
            self.unmark(&plan[from..]);
            plan.truncate(from);
            return false;
        }
        *faces += more;
        true
    }

    /// Applies the most urgent splits first, as long as the limits allow.
    fn refine_urgently(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, first: &[Open]) {
        let many = judges.next(&self.clock);
        let h = self.hierarchy.clone();
        let mut queue = Queue::default();
        first.iter().for_each(|o| queue.push(*o, judges.rank(&o.entry(&h))));
        let (mut closure, mut lot, mut done) = (Vec::new(), Vec::new(), Vec::new());
        loop {
            lot.clear();
            queue.pop(LOT, &mut lot);
            if lot.is_empty() {
                return;
            }
            // Ascending, what one depends on has mostly come before it.
            lot.sort_unstable_by_key(|o: &Open| o.split);
            let mut ids = [0; LOT];
            ids.iter_mut().zip(&lot).for_each(|(i, o)| *i = o.split);
            let mut ready = [Split::default(); LOT];
            let ready = self.make_ready(&ids[..lot.len()], &mut ready);
            done.clear();
            for (k, (o, split)) in lot.iter().zip(ready).enumerate() {
                // Others may have needed it before.
                if !self.front.is_applied(o.split) {
                    if meter.is_full(self.face_count()) {
                        meter.done.refused += lot.len() - k + queue.len();
                        return;
                    }
                    match self.apply_with_all(split, meter, &mut closure) {
                        Applied::Wholly => {}
                        Applied::Refused => continue,
                        Applied::Partly => return,
                    }
                }
                done.push(*o);
            }
            meter.looks += 2 * done.len();
            // Below what only others need nothing is needed, as bounds nest.
            each_needed_below(&h, &many, &done, |o, e| queue.push(*o, judges.rank(e)));
        }
    }

    /// Faces that splits make.
    fn faces_of(&self, splits: &[u32]) -> usize {
        splits.iter().map(|&i| 1 + usize::from(self.hierarchy.forest.two_faces(i))).sum()
    }

    /// Applies a split and all it depends on.
    pub(super) fn apply_with_all(
        &mut self,
        split: &Split,
        meter: &mut Meter<'_>,
        closure: &mut Vec<u32>,
    ) -> Applied {
        // A split makes a face at least.
        let room = meter.room(self.face_count());
        let fits = self.closure(split.id, room, closure);
        if meter.limits.faces < usize::MAX && (!fits || self.faces_of(closure) > room) {
            meter.done.refused += 1;
            return Applied::Refused;
        }
        for &j in &*closure {
            if !meter.goes_on() {
                self.unfinished = Some(split.id);
                return Applied::Partly;
            }
            self.apply(&if j == split.id { *split } else { Split::new(j) });
            meter.done.splits += 1;
            meter.since += 1;
            meter.done.forced += usize::from(j != split.id);
        }
        Applied::Wholly
    }
}
