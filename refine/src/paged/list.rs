//! Splits that could be made or undone next, and when to look at them: the times apart, as most frames look at few of many.
//!
//! Entries keep their places, and places are used again: so what is taken out moves no other, whose page would have to be told. Few frames ask all times. From time to time all are, for those that
//! may come before a *horizon*, some frames like the last from now; until lenses have passed that, frames ask these alone.

use crate::aif::NONE;
use crate::selective::{Clocks, Due, Entry, Sums};

/// A split that may come next, or may be undone next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Open {
    pub(super) entry: Entry,
    /// The node it replaces; [`NONE`] of a free place, whose split is the next one that is free.
    pub(super) node: u32,
}

/// Frames to the horizon, at most.
const FRAMES: f64 = 16.0;

/// A list without order.
#[derive(Debug)]
pub(super) struct List {
    of: Vec<Open>,
    /// Free places are never due.
    due: Vec<Due>,
    /// The first free place.
    free: u32,
    /// Places that are due before the horizon, and when. What has been told otherwise since is still there, and left out when it comes.
    soon: Vec<(u32, Due)>,
    horizon: Option<Sums>,
    /// Places that are due in this frame; some may have been taken out since.
    ready: Vec<u32>,
}

impl Default for List {
    fn default() -> Self {
        List {
            of: Vec::new(),
            due: Vec::new(),
            free: NONE,
            soon: Vec::new(),
            horizon: None,
            ready: Vec::new(),
        }
    }
}

impl List {
    /// Bytes of an entry.
    pub(super) const ENTRY: usize =
        size_of::<Open>() + size_of::<Due>() + size_of::<(u32, Due)>() + size_of::<u32>();

    /// Of all arrays the least.
    pub(super) fn capacity(&self) -> usize {
        let lists = self.soon.capacity().min(self.ready.capacity());
        self.of.capacity().min(self.due.capacity()).min(lists)
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<Open>() * self.of.capacity()
            + size_of::<Due>() * self.due.capacity()
            + size_of::<(u32, Due)>() * self.soon.capacity()
            + size_of::<u32>() * self.ready.capacity()
    }

    /// Room for so many in all.
    pub(super) fn reserve_to(&mut self, to: usize) {
        fn grow<T>(v: &mut Vec<T>, to: usize) {
            v.reserve_exact(to.saturating_sub(v.len()));
        }
        grow(&mut self.of, to);
        grow(&mut self.due, to);
        grow(&mut self.soon, to);
        grow(&mut self.ready, to);
    }

    /// What is in a place.
    #[inline]
    pub(super) fn get(&self, at: u32) -> Option<&Open> {
        self.of.get(at as usize).filter(|o| o.node != NONE)
    }

    /// Adds an entry that is to be looked at at once; returns its place.
    #[inline]
    pub(super) fn push(&mut self, open: Open) -> u32 {
        let at = self.free;
        match self.of.get_mut(at as usize) {
            Some(place) => {
                self.free = place.entry.split;
                *place = open;
                self.set_due(at, Due::NOW);
                at
            }
            None => {
                let at = self.of.len() as u32;
                self.of.push(open);
                self.due.push(Due::NEVER);
                self.set_due(at, Due::NOW);
                at
            }
        }
    }

    /// Takes out what is in a place.
    #[inline]
    pub(super) fn take_out(&mut self, at: u32) {
        if let Some(o) = self.of.get_mut(at as usize).filter(|o| o.node != NONE) {
            (o.node, o.entry.split) = (NONE, self.free);
            self.due[at as usize] = Due::NEVER;
            self.free = at;
        }
    }

    #[inline]
    pub(super) fn set_due(&mut self, at: u32, due: Due) {
        let Some(d) = self.due.get_mut(at as usize) else { return };
        *d = due;
        if self.horizon.is_some_and(|h| h.have_reached(due)) {
            // More than there is room for: then all are asked again.
            if self.soon.len() >= self.soon.capacity().min(self.ready.capacity()) {
                self.forget();
            } else {
                self.soon.push((at, due));
            }
        }
    }

    /// Begins a frame: finds the places that are due; `all`: those of all entries. Returns how many there are.
    pub(super) fn begin(&mut self, all: bool, clock: &Clocks) -> usize {
        let now = clock.sums();
        if all {
            self.forget();
            self.ready.clear();
            let there = (0..).zip(&self.due).filter(|(_, d)| **d != Due::NEVER).map(|(at, _)| at);
            self.ready.extend(there);
            return self.ready.len();
        }
        match self.horizon.filter(|h| h.include(now)) {
            Some(_) => self.ask_soon(now),
            None => {
                // So many that asking all, shared by the frames to the horizon, takes as long as asking those that come before it.
                let frames = self.of.len() as f64 / self.ready.len().max(1) as f64;
                self.forget();
                let horizon = clock.horizon(frames.sqrt().clamp(1.0, FRAMES));
                self.ask_all(now, horizon);
                self.horizon = Some(horizon);
            }
        }
        self.ready.len()
    }

    fn forget(&mut self) {
        self.horizon = None;
        self.soon.clear();
    }

    /// Most do not come before the horizon: asked without a branch for each.
    fn ask_all(&mut self, now: Sums, horizon: Sums) {
        self.ready.clear();
        let mut first = 0;
        for block in self.due.chunks(16) {
            if block.iter().fold(false, |any, &d| any | horizon.have_reached(d)) {
                for (at, &d) in (first..).zip(block) {
                    if now.have_reached(d) {
                        self.ready.push(at);
                    } else if horizon.have_reached(d) {
                        self.soon.push((at, d));
                    }
                }
            }
            first += 16;
        }
    }

    fn ask_soon(&mut self, now: Sums) {
        self.ready.clear();
        let (due, ready) = (&self.due, &mut self.ready);
        self.soon.retain(|&(at, told)| {
            let is_due = now.have_reached(told);
            // It may have been told otherwise, or be of another entry, since.
            if is_due && due.get(at as usize) == Some(&told) {
                ready.push(at);
            }
            !is_due
        });
    }

    /// Place `k` of those that are due, and what is there; `None` if it was taken out.
    #[inline]
    pub(super) fn ready(&self, k: usize) -> Option<(u32, &Entry)> {
        let at = *self.ready.get(k)?;
        self.get(at).map(|o| (at, &o.entry))
    }
}
