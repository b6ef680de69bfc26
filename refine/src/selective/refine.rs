//! The second half of a frame: what is needed is applied.
//!
//! Without limits it is found out first what is needed, then what that depends on, and then all of it is applied as it is numbered: so nothing waits for what comes before it, memory is asked for ahead, and mostly lies close
//! together. With a limit the most urgent splits come first, with what each depends on, a lot at a time.

use super::adapt::{Due, LOT, Look, Meter};
use super::clock::{Judges, Many};
use super::entry::Entry;
use super::queue::Queue;
use super::{Split, View};
use crate::aif::NONE;
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
        found[n] = Open { split: next.copied().unwrap_or(0), vertex: o.vertex, turn, at };
        n += usize::from(next.is_some());
        let vertex = h.forest.base_vertices + o.split;
        let first = h.forest.chain(vertex).first();
        let split = first.copied().unwrap_or(0);
        let at = h.bounds.local(new);
        // Of a lot there are two each at most.
        if let Some(slot) = found.get_mut(n) {
            *slot = Open { split, vertex, turn: 0, at };
        }
        n += usize::from(first.is_some());
    }
    out.extend_from_slice(&found[..n]);
}

/// Those below `wave` that are needed.
fn needed_below(h: &Hierarchy, many: &Many<'_>, wave: &[Open]) -> Vec<Open> {
    let mut out = Vec::with_capacity(wave.len());
    let (mut open, mut entries, mut wanted) = (Vec::new(), Vec::new(), Vec::new());
    for lot in wave.chunks(LOT) {
        open.clear();
        entries.clear();
        wanted.clear();
        below(h, lot, &mut open);
        entries.extend(open.iter().map(|o| o.entry(h)));
        many.wanted(&entries, &mut wanted);
        out.extend(open.iter().zip(&wanted).filter(|o| *o.1).map(|o| *o.0));
    }
    out
}

impl View {
    /// Applies splits that are needed, until none is left.
    pub(super) fn refine(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, due: &[Due], ahead: &[Look]) {
        let Some(wave) = self.needed_of(judges, meter, due, ahead) else { return };
        let limits = &meter.limits;
        if limits.faces == usize::MAX && limits.operations == usize::MAX && limits.expired.is_none() {
            self.refine_wholly(judges, meter, wave);
        } else {
            self.refine_urgently(judges, meter, &wave);
        }
    }

    /// Those that are needed of the splits that come next; nothing if a limit was met before.
    fn needed_of(
        &mut self,
        judges: &Judges<'_>,
        meter: &mut Meter<'_>,
        due: &[Due],
        ahead: &[Look],
    ) -> Option<Vec<Open>> {
        let mut wave = Vec::new();
        for (k, d) in due.iter().enumerate() {
            if !meter.goes_on() {
                self.resume = d.record;
                return None;
            }
            let record = self.front.records[d.record as usize];
            if record.made != d.made {
                continue;
            }
            // What has become free since it was looked at stays due.
            let stays = d.made == NONE || record.dependents > 0;
            let kept = if stays { f32::INFINITY } else { d.kept };
            meter.looks += 1;
            // Unless its next split has just been undone.
            let known = ahead.get(k).filter(|_| record.due == self.clock.now());
            let entry = |o: Open| o.entry(&self.hierarchy);
            let found = match known {
                Some(look) => look.next,
                None => self.open_at(d.record).map(|o| judges.of_next(&entry(o), &self.clock).into()),
            };
            match found {
                Some(f) if f.wanted => wave.extend(self.open_at(d.record)),
                f => {
                    let slack = f64::from(f.map_or(kept, |f| kept.min(f.slack)));
                    self.front.records[d.record as usize].due = self.clock.due(slack, d.record);
                }
            }
        }
        Some(wave)
    }

    /// The split that comes next at the vertex of a record that is there; nothing for a leaf.
    fn open_at(&self, record: u32) -> Option<Open> {
        let (split, vertex, turn) = self.next(record)?;
        let h = &*self.hierarchy;
        let at = h.bounds.local(h.forest.place(h.mesh(), vertex, turn));
        Some(Open { split, vertex, turn: turn as u32, at })
    }

    /// Applies all that is needed.
    fn refine_wholly(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, mut wave: Vec<Open>) {
        let many = judges.next(&self.clock);
        let (mut needed, mut low, mut high) = (0, usize::MAX, 0);
        while !wave.is_empty() {
            needed += wave.len();
            for o in &wave {
                let word = o.split as usize / 64;
                self.marked[word] |= 1 << (o.split % 64);
                (low, high) = (low.min(word), high.max(word + 1));
            }
            wave = self.next_wave(&many, &wave);
        }
        // What they depend on, the last first: what that depends on is yet to come.
        let mut word = high;
        while word > low {
            word -= 1;
            let mut left = u64::MAX;
            while self.marked[word] & left != 0 {
                let bit = 63 - (self.marked[word] & left).leading_zeros();
                left = (1 << bit) - 1;
                for &d in self.hierarchy.forest.needs.of(64 * word as u32 + bit) {
                    let at = d as usize / 64;
                    self.marked[at] |= u64::from(!self.front.is_applied(d)) << (d % 64);
                    low = low.min(at);
                }
            }
        }
        let mut lot = Vec::with_capacity(LOT);
        let mut all = 0;
        for word in low..high {
            let mut bits = std::mem::take(&mut self.marked[word]);
            while bits != 0 {
                lot.push(64 * word as u32 + bits.trailing_zeros());
                bits &= bits - 1;
                if lot.len() == LOT {
                    all += self.apply_lot(&lot);
                    lot.clear();
                }
            }
        }
        all += self.apply_lot(&lot);
        meter.done.splits += all;
        meter.done.forced += all - needed;
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

    /// Applies the most urgent splits first, as long as the limits allow.
    fn refine_urgently(&mut self, judges: &Judges<'_>, meter: &mut Meter<'_>, first: &[Open]) {
        let many = judges.next(&self.clock);
        let mut queue = Queue::default();
        first.iter().for_each(|o| queue.push(*o, judges.rank(&o.entry(&self.hierarchy))));
        let (mut closure, mut lot, mut done) = (Vec::new(), Vec::new(), Vec::new());
        let (mut open, mut entries, mut wanted) = (Vec::new(), Vec::new(), Vec::new());
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
            open.clear();
            entries.clear();
            wanted.clear();
            below(&self.hierarchy, &done, &mut open);
            entries.extend(open.iter().map(|o| o.entry(&self.hierarchy)));
            many.wanted(&entries, &mut wanted);
            meter.looks += open.len();
            // Below what only others need nothing is needed, as bounds nest.
            for ((o, e), _) in open.iter().zip(&entries).zip(&wanted).filter(|o| *o.1) {
                queue.push(*o, judges.rank(e));
            }
        }
    }

    /// Applies a split and all it depends on.
    pub(super) fn apply_with_all(
        &mut self,
        split: &Split,
        meter: &mut Meter<'_>,
        closure: &mut Vec<u32>,
    ) -> Applied {
        closure.clear();
        // A split makes a face at least.
        let room = meter.room(self.face_count());
        let fits = self.closure(split.id, room, closure);
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
