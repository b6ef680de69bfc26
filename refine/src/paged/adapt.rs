//! From the mesh of the last frame to that of this one, fetching what it needs.

use super::page::LED;
use super::shelf::Fetch;
use super::timed::CHANGE;
use super::{PagedError, PagedView};
use crate::aif::NONE;
use crate::format::{ByteRanges, CONTRADICTS, FormatError};
use crate::progressive::Damage;
use crate::selective::{Done, Due, Judges, Lens, Limits, Meter};
use std::cmp::Reverse;

/// How far a frame may go.
#[derive(Clone, Copy)]
pub struct PagedLimits<'a> {
    /// As in memory.
    pub limits: Limits<'a>,
    /// Chunks fetched in the frame at most; where that is too few, the mesh is coarser until later frames.
    pub fetches: usize,
}

impl Default for PagedLimits<'_> {
    /// None.
    fn default() -> Self {
        PagedLimits { limits: Limits::default(), fetches: usize::MAX }
    }
}

/// What [`PagedView::adapt`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PagedDone {
    /// As in memory; not complete either where something was left out for want of room or fetches.
    pub done: Done,
    /// Needed splits that were left out because there was no room for them, or for what they depend on.
    pub no_room: usize,
    /// Needed splits that were left out because their chunks would have been one fetch too many.
    pub postponed: usize,
    /// Chunks fetched.
    pub fetched: usize,
}

impl PagedDone {
    /// Nothing to do: what sums begin with.
    pub const NOTHING: PagedDone = PagedDone { done: Done::NOTHING, no_room: 0, postponed: 0, fetched: 0 };

    /// What was done, without what was left out: of an attempt that is made again.
    pub fn so_far(self) -> PagedDone {
        let done = Done { refused: 0, complete: true, ..self.done };
        PagedDone { done, no_room: 0, postponed: 0, ..self }
    }
}

/// Of several meshes: complete if all are.
impl std::ops::AddAssign for PagedDone {
    fn add_assign(&mut self, other: PagedDone) {
        self.done += other.done;
        self.no_room += other.no_room;
        self.postponed += other.postponed;
        self.fetched += other.fetched;
    }
}

/// What a frame did, and what is left of its limits.
struct Frame<'a> {
    meter: Meter<'a>,
    fetches: usize,
    all: PagedDone,
    /// Both lists were looked through from their ends, not from where the last frame was cut short.
    whole: bool,
}

/// Where to begin looking through a list of `len`, downwards, and whether that is its end.
fn start(resume: usize, len: usize) -> (usize, bool) {
    if resume == 0 || resume >= len { (len, true) } else { (resume, false) }
}

/// How gathering a closure ended.
enum Gathered {
    Whole,
    NoRoom,
    Postponed,
}

impl<S: ByteRanges> PagedView<S> {
    /// Adapts the mesh to what any of the lenses needs, as far as the limits, the memory and the fetches allow: first undoes what is not needed, then applies what is, the
    /// worst first. Looks at what may have changed since it was looked at last; O(valence) for every split applied or undone.
    ///
    /// Errors: damage, the source's. The mesh is sound then, and closed, somewhere on the way.
    pub fn adapt(&mut self, lenses: &[Lens], limits: &PagedLimits<'_>) -> Result<PagedDone, PagedError> {
        let meter = Meter::new(&limits.limits);
        let mut frame = Frame { meter, fetches: limits.fetches, all: PagedDone::default(), whole: true };
        self.shelf.clock += 1;
        let judges = Judges::new(lenses, limits.limits.hysteresis);
        let stands = self.clock.go_on(&judges);
        // What was not looked at may have become due long ago: times would come round. Errors end frames as well.
        let cut = std::mem::replace(&mut self.cut, true);
        let all = cut || !stands;
        self.coarsen(&judges, all, &mut frame)?;
        // Once more without what lingers, if it takes the room.
        for attempt in 0..2 {
            if frame.meter.over || (attempt > 0 && (frame.all.no_room == 0 || !self.make_way()?)) {
                break;
            }
            frame.all.no_room = 0;
            let result = self.refine(&judges, all, &mut frame);
            self.queue.clear();
            result?;
        }
        self.cut = frame.meter.over || !frame.whole;
        let all = &mut frame.all;
        all.done = frame.meter.done;
        let nothing_left = all.done.refused + all.no_room + all.postponed == 0;
        all.done.complete = !frame.meter.over && frame.whole && nothing_left;
        Ok(*all)
    }

    fn coarsen(&mut self, judges: &Judges<'_>, all: bool, frame: &mut Frame<'_>) -> Result<(), PagedError> {
        let (mut at, whole) = start(self.resume[0], self.last.len());
        let mut stack = Vec::new();
        loop {
            // Undoing takes out of the list.
            at = self.last.next_due(at, all, &self.clock);
            if at == 0 || !frame.meter.goes_on() {
                break;
            }
            at -= 1;
            let Some(o) = self.last.get(at) else { break };
            frame.meter.looks += 1;
            let (wanted, due) = self.clock.of_last(judges, &o.entry);
            if wanted {
                self.last.set_due(at, due);
                continue;
            }
            stack.push(o.entry.split);
            while let Some(i) = stack.pop() {
                let place = self.shelf.last_place(i) as usize;
                let Some(o) = self.last.get(place).filter(|o| o.entry.split == i) else { continue };
                frame.meter.looks += 1;
                if judges.keep(&o.entry) {
                    continue;
                }
                if !frame.meter.goes_on() {
                    break;
                }
                let needs = self.undo(i)?;
                frame.meter.done.collapses += 1;
                frame.meter.since += 1;
                stack.extend(needs.into_iter().filter(|&d| d != NONE && self.is_free(d)));
            }
        }
        self.resume[0] = at;
        frame.whole &= whole;
        Ok(())
    }

    fn refine(&mut self, judges: &Judges<'_>, all: bool, frame: &mut Frame<'_>) -> Result<(), PagedError> {
        let (mut at, whole) = start(self.resume[1], self.open.len());
        loop {
            at = self.open.next_due(at, all, &self.clock);
            if at == 0 || !frame.meter.goes_on() {
                break;
            }
            at -= 1;
            let Some(&o) = self.open.get(at) else { break };
            frame.meter.looks += 1;
            let (wanted, due) = self.clock.of_next(judges, &o.entry);
            if !wanted {
                self.open.set_due(at, due);
                continue;
            }
            // Until it is applied.
            self.open.set_due(at, Due::NOW);
            let (split, rank) = (o.entry.split, judges.rank(&o.entry));
            self.enqueue(rank, split, frame);
        }
        self.resume[1] = at;
        frame.whole &= whole;
        while let Some((_, Reverse(i))) = self.queue.pop() {
            if self.shelf.is_led(i) {
                continue;
            }
            if !frame.meter.goes_on() {
                return Ok(());
            }
            // Nor is anything fetched for it then.
            if frame.meter.is_full(self.led_faces) {
                frame.meter.done.refused += 1 + self.queue.len();
                return Ok(());
            }
            let mut closure = std::mem::take(&mut self.closure);
            closure.clear();
            let gathered = self.gather(i, &mut closure, frame);
            closure.iter().for_each(|&j| self.shelf.mark(j, false));
            // What a split depends on was made before it.
            closure.sort_unstable();
            closure.dedup();
            let applied = gathered.and_then(|g| match g {
                Gathered::Whole => self.apply_all(&closure, i, frame, judges),
                Gathered::NoRoom => {
                    frame.all.no_room += 1;
                    Ok(())
                }
                Gathered::Postponed => {
                    frame.all.postponed += 1;
                    Ok(())
                }
            });
            self.closure = closure;
            applied?;
        }
        Ok(())
    }

    fn apply_all(
        &mut self,
        closure: &[u32],
        i: u32,
        frame: &mut Frame<'_>,
        judges: &Judges<'_>,
    ) -> Result<(), PagedError> {
        let two = |j: u32| self.shelf.page(j).is_some_and(|(p, k)| p.code[k].two_faces());
        let more: usize = closure.iter().map(|&j| 1 + two(j) as usize).sum();
        if self.led_faces + more > frame.meter.limits.faces {
            frame.meter.done.refused += 1;
            return Ok(());
        }
        if !self.reserve(closure.len()) {
            frame.all.no_room += 1;
            return Ok(());
        }
        for &j in closure {
            if !frame.meter.goes_on() {
                return Ok(());
            }
            self.apply(j)?;
            let done = &mut frame.meter.done;
            done.splits += 1;
            done.forced += usize::from(j != i);
            frame.meter.since += 1;
            let old = self.shelf.head.base_vertices + 2 * j;
            for k in [old, old + 1] {
                let place = self.shelf.open_place(k) as usize;
                if let Some(o) = self.open.get(place).filter(|o| o.node == k && judges.want(&o.entry)) {
                    let (next, rank) = (o.entry.split, judges.rank(&o.entry));
                    self.enqueue(rank, next, frame);
                }
            }
        }
        Ok(())
    }

    /// Notes that a split is needed.
    fn enqueue(&mut self, rank: u16, split: u32, frame: &mut Frame<'_>) {
        if self.queue.len() == self.queue.capacity() {
            let more = self.queue.capacity() / 2 + 256;
            if !self.make_room(8 * (self.queue.capacity() + more)) {
                frame.all.no_room += 1;
                return;
            }
            self.queue.reserve_exact(more);
        }
        self.queue.push((rank, Reverse(split)));
    }

    /// Gathers split `i` and all it depends on that is not applied, and fetches their pages.
    fn gather(&mut self, i: u32, out: &mut Vec<u32>, frame: &mut Frame<'_>) -> Result<Gathered, PagedError> {
        self.shelf.clock += 1;
        out.push(i);
        let mut k = 0;
        while let Some(&j) = out.get(k) {
            if let Fetch::Missing(most) = self.shelf.ask(j) {
                if frame.all.fetched >= frame.fetches {
                    return Ok(Gathered::Postponed);
                }
                if !self.make_room(most) {
                    return Ok(Gathered::NoRoom);
                }
                // Few chunks take more on the way than is set aside; and damage may look so.
                let told = |e: &PagedError| matches!(e, PagedError::Format(FormatError::Chunk { what, .. }) if *what == CONTRADICTS);
                if let Err(e) = self.shelf.fetch(j, false) {
                    if !told(&e) {
                        return Err(e);
                    }
                    let beyond = self.shelf.most_beyond(j)?;
                    if !self.make_room(most.saturating_add(beyond)) {
                        return Ok(Gathered::NoRoom);
                    }
                    self.shelf.fetch(j, true)?;
                }
                frame.all.fetched += 1;
            }
            self.shelf.mark(j, true);
            let needs = self.shelf.needs(j).ok_or(Damage::Fan(j as usize))?;
            for d in needs.into_iter().filter(|&d| d != NONE) {
                if self.shelf.is_led(d) || self.shelf.is_marked(d) {
                    continue;
                }
                // Marked as soon as its page is there; until then it may be listed again.
                match self.shelf.ask(d) {
                    Fetch::There => self.shelf.mark(d, true),
                    Fetch::Missing(_) if out.contains(&d) => continue,
                    Fetch::Missing(_) => {}
                }
                out.push(d);
            }
            k += 1;
        }
        Ok(Gathered::Whole)
    }

    fn is_free(&self, i: u32) -> bool {
        self.shelf.page(i).is_some_and(|(p, k)| p.flags[k] & LED != 0 && p.dependents[k] == 0)
    }

    /// Asks for split `i`, whose page is there, whose dependencies are asked for, and for which there is room; with geomorphs by time it is applied later.
    fn apply(&mut self, i: u32) -> Result<(), PagedError> {
        let needs = self.can_count(i, |p| &p.dependents)?;
        let (node, _) = self.shelf.parent(i).ok_or(Damage::Fan(i as usize))?;
        if self.motions.is_none() {
            self.split_faces(i)?;
        }
        self.lead(i, needs, true);
        self.withdraw(node);
        for d in needs.into_iter().filter(|&d| d != NONE) {
            self.hold_split(d);
        }
        self.free_split(i)?;
        let old = self.shelf.head.base_vertices + 2 * i;
        self.offer(old)?;
        self.offer(old + 1)
    }

    /// No longer asks for split `i`, on which nothing that is depends; returns what it depended on.
    fn undo(&mut self, i: u32) -> Result<[u32; 3], PagedError> {
        let needs = self.shelf.needs(i).ok_or(Damage::Fan(i as usize))?;
        let (node, _) = self.shelf.parent(i).ok_or(Damage::Fan(i as usize))?;
        let old = self.shelf.head.base_vertices + 2 * i;
        self.withdraw(old);
        self.withdraw(old + 1);
        self.hold_split(i);
        if self.motions.is_none() {
            self.unsplit_faces(i)?;
        } else if !self.at_once && !self.make_room(CHANGE) {
            self.jump();
        }
        self.lead(i, needs, false);
        self.offer(node)?;
        for d in needs {
            if d != NONE && self.is_free(d) {
                self.free_split(d)?;
            }
        }
        Ok(needs)
    }
}
