//! From the mesh of the last frame to that of this one, fetching what it needs.

use super::list::{MANY, Mark};
use super::pool::{APPLIED, Hot, LED};
use super::ready::LOT;
use super::shelf::{AtHand, Fetch};
use super::timed::CHANGE;
use super::{PagedError, PagedView, both};
use crate::aif::NONE;
use crate::format::{ByteRanges, CONTRADICTS, FormatError};
use crate::progressive::Damage;
use crate::selective::{Clocks, Done, Due, Entry, Judges, Lens, Limits, Looked, Many, Meter};

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
    /// There was no room for what pages were fetched for: others are not, or they would go and come in turn.
    full: bool,
    /// Both lists were looked through from their ends, not from where the last frame was cut short.
    whole: bool,
    /// No limit makes it matter what comes first.
    unlimited: bool,
    /// See [`PagedView::adapt_in_waves`].
    waves: bool,
}

/// Needed splits whose pages other threads make while one is decoded.
const IN_SIGHT: usize = 64;

/// Lots that are looked at, at most, before what is found to be undone is undone: half of what is looked at between two questions for the time.
const LOTS: usize = 8;

/// Of the two lists.
#[derive(Clone, Copy)]
enum Which {
    Last,
    Open,
}

/// A lot of splits that are looked at: where they are in a list, and what is found out.
struct Desk<'a> {
    judges: Judges<'a>,
    next: Many<'a>,
    last: Many<'a>,
    places: Vec<u32>,
    entries: Vec<Entry>,
    looked: Looked,
}

impl<'a> Desk<'a> {
    fn new(judges: &Judges<'a>, clock: &Clocks) -> Self {
        Desk {
            judges: *judges,
            next: clock.next(judges),
            last: clock.last(judges),
            places: Vec::with_capacity(LOT),
            entries: Vec::with_capacity(LOT),
            looked: Looked::default(),
        }
    }

    fn clear(&mut self) {
        self.places.clear();
        self.entries.clear();
    }

    fn put(&mut self, place: u32, entry: &Entry) {
        self.places.push(place);
        self.entries.push(*entry);
    }
}

/// Where to begin looking through a list of `len`, downwards, and whether that is its end.
fn start(resume: usize, len: usize) -> (usize, bool) {
    if resume == 0 || resume >= len { (len, true) } else { (resume, false) }
}

/// In the first frame what this part of the tolerance asks for is made ahead: over generated terrain of 4,097 x 4,097 it then takes a quarter to a third less on two threads. Other parts were not tried.
const FINER: f64 = 0.8;

/// How gathering a closure ended.
enum Gathered {
    Whole,
    NoRoom,
    Postponed,
}

impl<S: ByteRanges> PagedView<S> {
    /// Adapts the mesh to what any of the lenses needs, as far as the limits, the memory and the fetches allow: first undoes what is not needed, then applies what is, the
    /// worst first where limits make that matter (of a frame that runs out of room unexpectedly, in the next). Looks at what may have changed since it was looked at last; O(valence) for every split applied or undone.
    ///
    /// Errors: damage, the source's. The mesh is sound then, and closed, somewhere on the way.
    pub fn adapt(&mut self, lenses: &[Lens], limits: &PagedLimits<'_>) -> Result<PagedDone, PagedError> {
        let meter = Meter::new(&limits.limits);
        let all = &limits.limits;
        let unlimited = all.faces == usize::MAX
            && all.operations == usize::MAX
            && all.expired.is_none()
            && limits.fetches == usize::MAX;
        let mut frame = Frame {
            meter,
            fetches: limits.fetches,
            all: PagedDone::default(),
            full: false,
            whole: true,
            unlimited,
            waves: false,
        };
        let first = !self.begun;
        let result = self.adapt_in(lenses, limits, &mut frame);
        let drawn = self.finish_drawing();
        result?;
        drawn?;
        if first {
            self.grow_ahead();
        }
        // In waves nothing was noted of what there was no room for.
        self.short = frame.all.no_room > 0;
        let lost = frame.waves && self.short;
        self.cut = frame.meter.over || !frame.whole || lost;
        let all = &mut frame.all;
        all.done = frame.meter.done;
        let nothing_left = all.done.refused + all.no_room + all.postponed == 0;
        all.done.complete = !frame.meter.over && frame.whole && nothing_left;
        Ok(*all)
    }

    fn adapt_in(
        &mut self,
        lenses: &[Lens],
        limits: &PagedLimits<'_>,
        frame: &mut Frame<'_>,
    ) -> Result<(), PagedError> {
        self.set_aside();
        self.shelf.next_frame();
        let judges = Judges::new(lenses, limits.limits.hysteresis);
        let stands = self.clock.go_on(&judges);
        // What was not looked at may have become due long ago: times would come round. Errors end frames as well.
        let cut = std::mem::replace(&mut self.cut, true);
        let all = cut || !stands;
        self.made.clear();
        if self.shelf.looks_ahead {
            let clock = &self.clock;
            self.shelf.foresee(|e| clock.will_want(e));
        }
        let mut desk = Desk::new(&judges, &self.clock);
        // In the first frame it shows how much is needed.
        if frame.unlimited && !all && !self.short && self.motions.is_none() && self.is_roomy() {
            frame.waves = true;
            return self.adapt_in_waves(&mut desk, frame);
        }
        self.coarsen(&mut desk, all, frame)?;
        // Once more without what lingers, if it takes the room.
        for attempt in 0..2 {
            if frame.meter.over || (attempt > 0 && (frame.all.no_room == 0 || !self.make_way()?)) {
                break;
            }
            frame.all.no_room = 0;
            frame.full = false;
            let result = self.refine(&mut desk, all, frame);
            self.queue.begin(false);
            result?;
        }
        Ok(())
    }

    /// Without limits, and with room for what comes, it does not matter what comes first: then both lists are looked through at once, by two threads, before anything is undone, and what is needed is applied in waves.
    fn adapt_in_waves(&mut self, desk: &mut Desk<'_>, frame: &mut Frame<'_>) -> Result<(), PagedError> {
        self.look_at_both(desk);
        let (mut lot, mut freed) = (Vec::with_capacity(2 * LOT), Vec::new());
        let mut k = 0;
        while self.last.marked(k).is_some() {
            lot.clear();
            while lot.len() < LOT
                && let Some((place, _)) = self.last.marked(k)
            {
                lot.push(place);
                k += 1;
            }
            self.undo_lot(&lot, &mut freed, frame)?;
        }
        while !freed.is_empty() {
            self.undo_freed(desk, &mut freed, &mut lot, frame)?;
        }
        self.queue.begin(true);
        let mut k = 0;
        while let Some((place, mark)) = self.open.marked(k) {
            k += 1;
            // What it would replace may have been undone.
            let Some(e) = self.open.get(place) else { continue };
            match mark {
                Mark::Now => self.enqueue(0, e.split, frame),
                Mark::Later => {
                    let due = self.ahead_of(&e, self.open.due(place));
                    self.open.set_due(place, due);
                }
            }
        }
        self.resume = [0; 2];
        let applied = self.apply_queue(desk, frame);
        self.queue.begin(false);
        applied
    }

    /// Looks at what is due in both lists, at once if there are threads. What is not needed is marked in the one; in the other what is, and whose pages are not there for later.
    fn look_at_both(&mut self, desk: &Desk<'_>) {
        let (clock, is_missing) = (&self.clock, self.shelf.missing());
        let (last, open) = (&mut self.last, &mut self.open);
        let many = last.were_due() + open.were_due() >= MANY;
        let (to_keep, to_apply) = (&desk.last, &desk.next);
        let looks_ahead = self.shelf.looks_ahead;
        let of_last = || {
            last.begin(false, clock);
            last.look((clock, to_keep), |_, wanted, due| match wanted {
                true => (None, due),
                false => (Some(Mark::Now), Due::NOW),
            });
        };
        let of_open = || {
            open.begin(false, clock);
            open.look((clock, to_apply), |e, wanted, due| match wanted {
                true => (Some(Mark::Now), Due::NOW),
                false if looks_ahead && is_missing(e.split) => (Some(Mark::Later), due),
                false => (None, due),
            });
        };
        both(many, of_last, of_open);
    }

    /// Undoes what is not needed, until nothing is left that could be. A lot at a time is looked at, and undone.
    fn coarsen(&mut self, desk: &mut Desk<'_>, all: bool, frame: &mut Frame<'_>) -> Result<(), PagedError> {
        let (mut at, whole) = start(self.resume[0], self.last.begin(all, &self.clock));
        let mut freed = Vec::new();
        let mut lot = Vec::with_capacity(2 * LOT);
        let (mut from, mut looked) = (at, 0);
        while at > 0 && !frame.meter.over {
            at = self.take_due(Which::Last, at, desk, frame);
            self.sift(desk, &mut lot);
            looked += 1;
            // Few of those looked at are undone: when they are a lot, memory is waited for together. But before the time is asked for: what a frame has not undone when it ends is looked at again.
            if lot.len() < LOT && looked < LOTS && at > 0 {
                continue;
            }
            looked = 0;
            self.undo_lot(&lot, &mut freed, frame)?;
            // The rest at the end.
            while freed.len() >= LOT && !frame.meter.over {
                self.undo_freed(desk, &mut freed, &mut lot, frame)?;
            }
            if !frame.meter.over {
                from = at;
            }
            lot.clear();
        }
        if frame.meter.over {
            at = from;
        }
        while !freed.is_empty() && !frame.meter.over {
            self.undo_freed(desk, &mut freed, &mut lot, frame)?;
        }
        self.resume[0] = at;
        frame.whole &= whole;
        Ok(())
    }

    /// Undoes splits, by their records, that could be and are not needed; appends what could be then.
    fn undo_lot(
        &mut self,
        lot: &[u32],
        freed: &mut Vec<u32>,
        frame: &mut Frame<'_>,
    ) -> Result<(), PagedError> {
        for (k, &h) in lot.iter().enumerate() {
            if k % LOT == 0 {
                self.ready_to_undo(&lot[k..lot.len().min(k + LOT)]);
            }
            if !frame.meter.goes_on() {
                return Ok(());
            }
            if !self.last.has(h) {
                continue;
            }
            self.undo(h, freed)?;
            frame.meter.done.collapses += 1;
            frame.meter.since += 1;
        }
        Ok(())
    }

    /// Looks at some of what has become free, and undoes what is not needed.
    fn undo_freed(
        &mut self,
        desk: &mut Desk<'_>,
        freed: &mut Vec<u32>,
        lot: &mut Vec<u32>,
        frame: &mut Frame<'_>,
    ) -> Result<(), PagedError> {
        let part = freed.len() - freed.len().min(LOT);
        desk.clear();
        for &h in &freed[part..] {
            if let Some(e) = self.last.get(h) {
                desk.put(h, &e);
            }
        }
        freed.truncate(part);
        frame.meter.looks += desk.places.len();
        lot.clear();
        self.sift(desk, lot);
        self.undo_lot(lot, freed, frame)
    }

    /// Looks at those on the desk, which could be undone: what is not needed is appended to `lot`, of the others is noted when they are due.
    fn sift(&mut self, desk: &mut Desk<'_>, lot: &mut Vec<u32>) {
        self.clock.look(&desk.last, &desk.entries, &mut desk.looked);
        for (&place, (wanted, due)) in desk.places.iter().zip(desk.looked.each()) {
            if wanted { self.last.set_due(place, due) } else { lot.push(place) }
        }
    }

    /// Puts what is due of a list on the desk, downwards from `at`, a lot at most; returns where to go on.
    fn take_due(&self, which: Which, at: usize, desk: &mut Desk<'_>, frame: &mut Frame<'_>) -> usize {
        let list = match which {
            Which::Last => &self.last,
            Which::Open => &self.open,
        };
        desk.clear();
        // Asked for the time once a lot.
        if !frame.meter.goes_on() {
            return at;
        }
        let from = at.saturating_sub(LOT);
        for k in (from..at).rev() {
            if let Some((place, entry)) = list.ready(k) {
                desk.put(place, &entry);
            }
        }
        frame.meter.looks += desk.places.len();
        from
    }

    fn refine(&mut self, desk: &mut Desk<'_>, all: bool, frame: &mut Frame<'_>) -> Result<(), PagedError> {
        self.queue.begin(false);
        let (mut at, whole) = start(self.resume[1], self.open.begin(all, &self.clock));
        while at > 0 && !frame.meter.over {
            at = self.take_due(Which::Open, at, desk, frame);
            self.look_at_open(desk, frame);
        }
        self.resume[1] = at;
        frame.whole &= whole;
        self.apply_queue(desk, frame)
    }

    /// Applies what is needed, and what that brings.
    fn apply_queue(&mut self, desk: &mut Desk<'_>, frame: &mut Frame<'_>) -> Result<(), PagedError> {
        let mut lot = Vec::with_capacity(LOT);
        while self.queue.len() > 0 {
            // A lot; of one rank, where a limit of the frame makes it matter which come first. (Of memory: by lots.)
            lot.clear();
            let rank = self.queue.rank().filter(|_| !frame.unlimited);
            while lot.len() < LOT
                && let Some(i) = self.queue.pop(rank)
            {
                if !self.shelf.is_led(i) {
                    lot.push(i);
                }
            }
            if self.shelf.looks_ahead {
                // Those on top of the queue come next.
                let next = self.queue.next(IN_SIGHT);
                lot.iter().copied().chain(next).for_each(|i| _ = self.shelf.wish(i, true));
            }
            let at_hand = self.ready_to_apply(&lot);
            for (k, (&i, at)) in lot.iter().zip(&at_hand).enumerate() {
                if self.shelf.is_led(i) {
                    continue;
                }
                if !frame.meter.goes_on() {
                    return Ok(());
                }
                // Nor is anything fetched for it then.
                if frame.meter.is_full(self.led_faces) {
                    frame.meter.done.refused += lot.len() - k + self.queue.len();
                    self.look_at_made(desk, frame);
                    return Ok(());
                }
                let alone = match at {
                    Some(at) => self.apply_alone(i, at, frame)?,
                    None => false,
                };
                if !alone {
                    self.apply_with_all(i, frame)?;
                }
                if self.made.len() >= LOT {
                    self.look_at_made(desk, frame);
                }
            }
            self.look_at_made(desk, frame);
        }
        Ok(())
    }

    /// Decides about what is on the desk of the list of what could come next.
    fn look_at_open(&mut self, desk: &mut Desk<'_>, frame: &mut Frame<'_>) {
        self.clock.look(&desk.next, &desk.entries, &mut desk.looked);
        for ((&place, e), (wanted, due)) in desk.places.iter().zip(&desk.entries).zip(desk.looked.each()) {
            // Until it is applied.
            if !wanted {
                let due = self.ahead_of(e, due);
                self.open.set_due(place, due);
            } else if self.queue.in_waves() {
                self.open.hold(place);
                self.enqueue(0, e.split, frame);
            } else {
                self.open.set_due(place, Due::NOW);
                self.enqueue(desk.judges.rank(e), e.split, frame);
            }
        }
    }

    /// When to look again at a split that is not needed now: if its page is not there, some frames before it can be needed. If it is then as if it would be, its page is made by another thread. In the first frame how lenses move is not known: then what a finer tolerance asks for is made, much of which this frame needs anyway.
    fn ahead_of(&mut self, e: &Entry, due: Due) -> Due {
        if !self.shelf.looks_ahead || !self.shelf.is_missing(e.split) {
            return due;
        }
        if self.shelf.is_first_frame() && self.clock.wants_at(e, FINER) {
            self.shelf.wish(e.split, false);
        }
        let (early, soon) = self.clock.ahead_of(due);
        if soon && self.clock.will_want(e) && self.shelf.wish(e.split, false) { due } else { early }
    }

    /// Looks at what the splits that were applied last have brought: what could come next, and what could be undone. So the next frame knows.
    fn look_at_made(&mut self, desk: &mut Desk<'_>, frame: &mut Frame<'_>) {
        let made = std::mem::take(&mut self.made);
        for part in made.chunks(LOT / 2) {
            desk.clear();
            for &h in part {
                let first = self.shelf.first_open(h);
                for place in [first, first + 1] {
                    if let Some(e) = self.open.get(place) {
                        desk.put(place, &e);
                    }
                }
            }
            self.look_at_open(desk, frame);
            desk.clear();
            for &h in part {
                if let Some(e) = self.last.get(h) {
                    desk.put(h, &e);
                }
            }
            self.clock.look(&desk.last, &desk.entries, &mut desk.looked);
            for (&place, (wanted, due)) in desk.places.iter().zip(desk.looked.each()) {
                self.last.set_due(place, if wanted { due } else { Due::NOW });
            }
        }
        self.made = made;
        self.made.clear();
    }

    /// Applies a split that is needed, and what it depends on, as far as there is room and its pages are there or may be fetched.
    fn apply_with_all(&mut self, i: u32, frame: &mut Frame<'_>) -> Result<(), PagedError> {
        let mut closure = std::mem::take(&mut self.closure);
        closure.clear();
        let gathered = self.gather(i, &mut closure, frame);
        closure.iter().for_each(|&j| self.shelf.mark(j, false));
        // What a split depends on comes before it.
        match self.shelf.by_rings() {
            true => closure.sort_unstable_by_key(|&j| self.shelf.order_key(j)),
            false => closure.sort_unstable(),
        }
        closure.dedup();
        let applied = gathered.and_then(|g| match g {
            Gathered::Whole => self.apply_all(&closure, i, frame),
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
        applied
    }

    fn apply_all(&mut self, closure: &[u32], i: u32, frame: &mut Frame<'_>) -> Result<(), PagedError> {
        let two = |j: u32| self.shelf.record(j).is_some_and(|r| r.code.two_faces());
        let more: usize = closure.iter().map(|&j| 1 + two(j) as usize).sum();
        if self.led_faces + more > frame.meter.limits.faces {
            frame.meter.done.refused += 1;
            return Ok(());
        }
        if !self.reserve(closure.len()) {
            frame.full = true;
            frame.all.no_room += 1;
            return Ok(());
        }
        for &j in closure {
            if !frame.meter.goes_on() {
                return Ok(());
            }
            self.see_drawing()?;
            self.apply(j)?;
            let done = &mut frame.meter.done;
            done.splits += 1;
            done.forced += usize::from(j != i);
            frame.meter.since += 1;
        }
        Ok(())
    }

    /// Notes that a split is needed.
    fn enqueue(&mut self, rank: u16, split: u32, frame: &mut Frame<'_>) {
        let more = self.queue.growth();
        if more > 0 && !self.make_room(more) {
            frame.all.no_room += 1;
            return;
        }
        self.queue.push(rank, split);
        if self.queue.in_waves() && self.shelf.looks_ahead && self.shelf.is_missing(split) {
            self.shelf.wish(split, true);
        }
    }

    /// Gathers split `i` and all it depends on that is not applied, and fetches their pages.
    fn gather(&mut self, i: u32, out: &mut Vec<u32>, frame: &mut Frame<'_>) -> Result<Gathered, PagedError> {
        self.shelf.clock += 1;
        out.push(i);
        let (mut k, before) = (0, frame.all.fetched);
        while let Some(&j) = out.get(k) {
            if let Fetch::Missing(most) = self.shelf.ask(j) {
                if frame.all.fetched >= frame.fetches {
                    return Ok(Gathered::Postponed);
                }
                if frame.full || !self.make_room(most) {
                    // What was fetched for it would go for the next, and come again.
                    frame.full |= frame.all.fetched > before;
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
            for n in 0..needs.len() + self.shelf.further(j).len() {
                let d = match needs.get(n) {
                    Some(&d) => d,
                    None => self.shelf.further(j)[n - needs.len()],
                };
                if d == NONE {
                    continue;
                }
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

    /// Asks for split `i`, whose page is there, whose dependencies are asked for, and for which there is room; with geomorphs by time it is applied later.
    fn apply(&mut self, i: u32) -> Result<(), PagedError> {
        let lost = Damage::Fan(i as usize);
        let at = self.shelf.at_hand(i).ok_or(lost)?;
        if at.whole {
            return self.apply_at(i, &at, &at.needs);
        }
        let mut needs = std::mem::take(&mut self.needed);
        self.shelf.needs_into(i, &mut needs)?;
        self.apply_at(i, &at, &needs)?;
        self.needed = needs;
        Ok(())
    }

    /// The same of a split that is at hand, the records of what it depends on being known.
    fn apply_at(&mut self, i: u32, at: &AtHand, needs: &[u32]) -> Result<(), PagedError> {
        let lost = || Damage::Fan(i as usize);
        let page = self.shelf.use_page(at).ok_or_else(lost)?;
        let (r, new) = (*page.of.get(at.k as usize).ok_or_else(lost)?, page.place(at.k as usize));
        self.can_count(i, needs, LED, |r| r.dependents)?;
        // It says itself what it replaces, and what it replaces says by what.
        let place = self.shelf.open_place_of(needs[0], r.parent);
        let entry = self.open.get(place).filter(|e| e.split == i).ok_or_else(lost)?;
        let (h, more) = self.shelf.come(i, at, needs).ok_or_else(lost)?;
        if more {
            self.extend();
        }
        if self.motions.is_none()
            && let Err(e) = self.split_faces(h)
        {
            self.shelf.go(h);
            return Err(e);
        }
        self.lead(h, needs, true, |_| ());
        self.open.take_out(place);
        self.last.put(h, &entry);
        let old = self.shelf.head.base_vertices + 2 * i;
        let centre = if self.shelf.moves { self.shelf.local_centre(old)? } else { entry.centre() };
        let first = self.shelf.first_open(h);
        self.offer(first, (r.next[0], r.bounds[0]), centre);
        let new = (new - self.shelf.base.links.origin).as_vec3();
        self.offer(first + 1, (r.next[1], r.bounds[1]), new);
        self.made.push(h);
        Ok(())
    }

    /// Applies a split that is needed, whose dependencies are asked for, unless limits are in the way; false if that, or where it is, is to be found out otherwise.
    fn apply_alone(&mut self, i: u32, at: &AtHand, frame: &mut Frame<'_>) -> Result<bool, PagedError> {
        self.shelf.clock += 1;
        let led = |h: &u32| *h == NONE || self.shelf.pool.get(*h).is_some_and(|r| r.flags & LED != 0);
        if !at.whole || !at.needs.iter().all(led) {
            return Ok(false);
        }
        let Some(page) = self.shelf.use_page(at) else { return Ok(false) };
        let more = 1 + page.of.get(at.k as usize).is_some_and(|r| r.code.two_faces()) as usize;
        self.see_drawing()?;
        if self.led_faces + more > frame.meter.limits.faces || !self.reserve(1) {
            return Ok(false);
        }
        self.apply_at(i, at, &at.needs)?;
        frame.meter.done.splits += 1;
        frame.meter.since += 1;
        Ok(true)
    }

    /// No longer asks for the split of a record, on which nothing that is depends; appends to `freed` what can be undone then.
    fn undo(&mut self, h: u32, freed: &mut Vec<u32>) -> Result<(), PagedError> {
        let hot = *self.shelf.pool.get(h).ok_or(Damage::Fan(h as usize))?;
        if self.motions.is_none() {
            self.unsplit_faces(h)?;
        } else if !self.at_once && !self.make_room(CHANGE) {
            self.jump();
        }
        self.withdraw(h, &hot, freed)
    }

    /// What is asked for no longer can be asked for again, what comes after it cannot.
    fn withdraw(&mut self, h: u32, hot: &Hot, freed: &mut Vec<u32>) -> Result<(), PagedError> {
        let mut needs = std::mem::take(&mut self.needed);
        self.shelf.needs_of_hot(h, &mut needs)?;
        let place = self.shelf.open_place_of(hot.needs[0], hot.parent);
        let first = self.shelf.first_open(h);
        self.open.take_out(first);
        self.open.take_out(first + 1);
        self.last.take_out(h);
        self.lead(h, &needs, false, |d| freed.push(d));
        self.needed = needs;
        self.open.put_back(place);
        if self.shelf.pool.get(h).is_none_or(|r| r.flags & (APPLIED | LED) == 0) {
            self.shelf.go(h);
        }
        Ok(())
    }

    /// Takes back that the split of a record was asked for, which was not drawn; the last of all that were.
    pub(super) fn take_back(&mut self, h: u32) -> Result<(), PagedError> {
        let hot = *self.shelf.pool.get(h).ok_or(Damage::Fan(h as usize))?;
        self.leave(h, &hot);
        let mut freed = Vec::new();
        self.withdraw(h, &hot, &mut freed)
    }
}
