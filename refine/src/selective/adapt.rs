//! From the mesh of the last frame to that of this one.

use super::list::Entry;
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
    /// Splits that were needed and would have led beyond the limit of faces.
    pub refused: usize,
}

/// Operations between two questions for the time.
pub(crate) const BETWEEN: usize = 64;
/// Looks at splits that count as many operations: a look takes about a tenth of an operation's time.
pub(crate) const LOOKS: usize = 512;
/// Needed splits lie in buckets by how much their errors exceed the tolerance: eight for each factor of two.
const BUCKETS: usize = 256;

/// What is left of the limits.
struct Meter<'a> {
    limits: Limits<'a>,
    done: Done,
    since: usize,
    looks: usize,
    over: bool,
    /// Both lists were looked through from their ends, not from where the last frame was cut short.
    whole: bool,
}

/// Entries from which on a list is decided about by several threads: below, handing out the work takes as long.
#[cfg(feature = "parallel")]
const MANY: usize = 4096;

/// What `f` says of each entry of a long list, found by several threads, with the split that it is of; nothing of a short one.
///
/// The loops that go through a list ask it for what they would have found out themselves, so its being there changes nothing but the time.
fn ahead<R: Send>(entries: &[Entry], f: impl Fn(&Entry) -> R + Sync + Send) -> Vec<(u32, R)> {
    #[cfg(feature = "parallel")]
    if entries.len() >= MANY && rayon::current_num_threads() > 1 {
        use rayon::prelude::*;
        return entries.par_iter().with_min_len(MANY / 4).map(|e| (e.split, f(e))).collect();
    }
    let _ = (entries, f);
    Vec::new()
}

/// What is known ahead of the entry in a place, unless another has come there since.
fn known<R: Copy>(ahead: &[(u32, R)], at: usize, e: &Entry) -> Option<R> {
    ahead.get(at).filter(|a| a.0 == e.split).map(|a| a.1)
}

/// Where to begin looking through a list of `len`, downwards, and whether that is its end.
fn start(resume: usize, len: usize) -> (usize, bool) {
    if resume == 0 || resume >= len { (len, true) } else { (resume, false) }
}

impl Meter<'_> {
    fn used(&self) -> usize {
        self.done.splits + self.done.collapses
    }

    /// False when it is time to end.
    #[inline]
    fn goes_on(&mut self) -> bool {
        if self.used() >= self.limits.operations {
            self.over = true;
        }
        if self.since >= BETWEEN || self.looks >= LOOKS {
            (self.since, self.looks) = (0, 0);
            self.over |= self.limits.expired.is_some_and(|f| f());
        }
        !self.over
    }
}

impl View {
    /// Adapts the mesh to a lens, as far as the limits allow: first undoes what is not needed, then applies what is, the worst first.
    ///
    /// O(vertices shown) looks, and O(valence) for every split applied or undone. A frame that a limit cut short is taken up by the next.
    pub fn adapt(&mut self, lens: &Lens, limits: &Limits<'_>) -> Done {
        self.adapt_to_all(std::slice::from_ref(lens), limits)
    }

    /// As [`View::adapt`], to several lenses: what any of them needs is needed. For a mesh that stands in several places. Without lenses nothing is needed.
    pub fn adapt_to_all(&mut self, lenses: &[Lens], limits: &Limits<'_>) -> Done {
        let mut meter = Meter {
            limits: *limits,
            done: Done::default(),
            since: BETWEEN,
            looks: 0,
            over: false,
            whole: true,
        };
        // First what a limit cut short: else coarsening would undo what is only there for the rest of it, frame after frame.
        if let Some(i) = self.unfinished.take()
            && self.still_wanted(lenses, i)
        {
            self.apply_with_all(i, &mut meter, &mut Vec::new(), |_, _| {});
        }
        if !meter.over {
            self.coarsen(lenses, &mut meter);
        }
        if !meter.over {
            self.refine(lenses, &mut meter);
        }
        meter.done.complete = !meter.over && meter.whole && meter.done.refused == 0;
        meter.done
    }

    /// Undoes splits that are not needed, until none is left that could be.
    fn coarsen(&mut self, lenses: &[Lens], meter: &mut Meter<'_>) {
        let keep = meter.limits.hysteresis.clamp(1e-6, 1.0);
        let wants = |e: &Entry| lenses.iter().any(|l| l.wants(e, keep * l.tau()));
        // Downwards: what comes in is put at the end, and looked at as it does.
        let (mut at, whole) = start(self.resume[0], self.last.entries.len());
        let mut stack = Vec::new();
        let before = ahead(&self.last.entries, wants);
        while at > 0 && meter.goes_on() {
            at = (at - 1).min(self.last.entries.len().saturating_sub(1));
            meter.looks += 1;
            let Some(e) = self.last.entries.get(at) else { break };
            if known(&before, at, e).unwrap_or_else(|| wants(e)) {
                continue;
            }
            stack.push(e.split);
            while let Some(i) = stack.pop() {
                let place = self.place[i as usize] as usize;
                // It may have come in twice.
                let Some(e) = self.last.entries.get(place).filter(|e| e.split == i) else { continue };
                meter.looks += 1;
                if wants(e) {
                    continue;
                }
                if !meter.goes_on() {
                    break;
                }
                self.undo(i);
                meter.done.collapses += 1;
                meter.since += 1;
                let needs = self.hierarchy.forest.needs.of(i).iter().copied();
                stack.extend(needs.filter(|&d| self.is_free(d)));
            }
        }
        self.resume[0] = at;
        meter.whole &= whole;
    }

    /// Split `i` is not applied, and is needed.
    fn still_wanted(&self, lenses: &[Lens], i: u32) -> bool {
        !self.front.is_applied(i) && lenses.iter().any(|l| l.wants(&Entry::of(&self.hierarchy, i), l.tau()))
    }

    /// Applies split `i` and all it depends on, and tells what could come next; false if a limit other than that of faces cut it short.
    fn apply_with_all(
        &mut self,
        i: u32,
        meter: &mut Meter<'_>,
        closure: &mut Vec<u32>,
        mut next: impl FnMut(&View, u32),
    ) -> bool {
        closure.clear();
        self.closure(i, closure);
        let code = &self.hierarchy.mesh().splits.code;
        let more: usize = closure.iter().map(|&j| 1 + code[j as usize].two_faces() as usize).sum();
        if self.face_count() + more > meter.limits.faces {
            meter.done.refused += 1;
            return true;
        }
        for &j in &*closure {
            if !meter.goes_on() {
                self.unfinished = Some(i);
                return false;
            }
            self.apply(j);
            meter.done.splits += 1;
            meter.since += 1;
            meter.done.forced += usize::from(j != i);
            for k in self.hierarchy.forest.nodes(j) {
                let below = self.hierarchy.forest.split_of[k as usize];
                if below != NONE {
                    next(self, below);
                }
            }
        }
        true
    }

    /// Applies splits that are needed, until none is left.
    fn refine(&mut self, lenses: &[Lens], meter: &mut Meter<'_>) {
        let wants = |e: &Entry| lenses.iter().any(|l| l.wants(e, l.tau()));
        let urgency = |e: &Entry| lenses.iter().map(|l| l.urgency(e)).fold(0.0, f64::max);
        let bucket = |u: f64| ((u.max(1.0).log2() * 8.0) as usize).min(BUCKETS - 1);
        let mut buckets: Vec<Vec<u32>> = vec![Vec::new(); BUCKETS];
        let mut highest = 0;
        let (mut at, whole) = start(self.resume[1], self.open.entries.len());
        // Buckets matter only if not all will be done.
        let sorted = meter.limits.faces < usize::MAX
            || meter.limits.operations < usize::MAX
            || meter.limits.expired.is_some();
        let rank = |e: &Entry| if sorted { bucket(urgency(e)) } else { 0 };
        let needed = |e: &Entry| wants(e).then(|| rank(e));
        let before = ahead(&self.open.entries, needed);
        while at > 0 && meter.goes_on() {
            at -= 1;
            meter.looks += 1;
            let Some(e) = self.open.entries.get(at) else { break };
            if let Some(b) = known(&before, at, e).unwrap_or_else(|| needed(e)) {
                highest = highest.max(b);
                buckets[b].push(e.split);
            }
        }
        self.resume[1] = at;
        meter.whole &= whole;
        let mut closure = Vec::new();
        loop {
            let Some(i) = buckets[highest].pop() else {
                if highest == 0 {
                    return;
                }
                highest -= 1;
                continue;
            };
            if self.front.is_applied(i) {
                continue;
            }
            let goes_on = self.apply_with_all(i, meter, &mut closure, |view, next| {
                let Some(e) = view.open.entries.get(view.place[next as usize] as usize) else { return };
                if e.split == next && wants(e) {
                    let b = rank(e);
                    highest = highest.max(b);
                    buckets[b].push(next);
                }
            });
            if !goes_on {
                return;
            }
        }
    }
}
