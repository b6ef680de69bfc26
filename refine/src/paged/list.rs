//! Splits that could be made or undone next, and when to look at them: the times apart, as most frames look at few of many.
//!
//! Entries have places that are told by what they are of, and stay there while they are not to be asked: so nothing is moved, or looked for. Few frames ask all times: a [`Calendar`] has those that come within some frames.

use super::both;
use super::calendar::Calendar;
use super::ready::LOT;
use crate::aif::NONE;
use crate::hierarchy::{Cone, Packed};
use crate::selective::{Clocks, Due, Entry, Looked, Many, Sums};
use glam::Vec3;

/// An entry, packed, and when to look at it, half a line of memory: whoever asks for the one soon asks for the other.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
struct Place {
    centre: Vec3,
    bounds: Packed,
    split: u32,
    /// What is not there is never due.
    due: Due,
}

impl Place {
    const EMPTY: Place = Place {
        centre: Vec3::ZERO,
        bounds: Packed { error: 0, radius: 0, cone: Cone(0) },
        split: NONE,
        due: Due::NEVER,
    };

    #[inline]
    fn entry(&self) -> Entry {
        Entry::new(self.split, self.centre, self.bounds)
    }
}

/// Bytes of a place, and of an entry that is there, at most.
pub(super) const PLACE: usize = size_of::<Place>() + 1;
pub(super) const THERE: usize = Calendar::EACH + size_of::<u32>();

/// More bytes that an array of such a capacity takes with room for so many, and those of the old one while it is filled.
pub(super) fn grown<T>(capacity: usize, to: usize) -> [usize; 2] {
    match to.checked_sub(capacity) {
        None | Some(0) => [0; 2],
        Some(more) => [more * size_of::<T>(), capacity * size_of::<T>()],
    }
}

/// What is to be done about something that was looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    /// In this frame.
    Now,
    /// When its page is there.
    Later,
}

/// The bit of [`Mark::Later`]: places are as many as nodes, which are fewer.
const LATER: u32 = 1 << 31;

/// Places that are looked at before what came of it is noted.
const BLOCK: usize = 4096;
/// So many are looked at by two threads: to wake one takes as long as some hundred looks.
pub(super) const MANY: usize = 1024;

/// A list without order, by places.
#[derive(Debug, Default)]
pub(super) struct List {
    of: Vec<Place>,
    /// Places that are due within some frames.
    calendar: Calendar,
    /// Places that are due in this frame, ascending; some may have been taken out since.
    ready: Vec<u32>,
    /// So many were due when that was found out last.
    were_due: usize,
    /// A bit for every place, all 0: to sort with.
    sorting: Vec<u64>,
}

impl List {
    /// Places, and entries that can be there at once.
    pub(super) fn capacity(&self) -> [usize; 2] {
        [self.of.capacity(), self.calendar.capacity().min(self.ready.capacity())]
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<Place>() * self.of.capacity()
            + self.calendar.bytes()
            + size_of::<u32>() * self.ready.capacity()
            + size_of::<u64>() * self.sorting.capacity()
    }

    /// Room for so many places, and for so many that are there.
    pub(super) fn reserve_to(&mut self, [places, there]: [usize; 2]) {
        fn grow<T>(v: &mut Vec<T>, to: usize) {
            v.reserve_exact(to.saturating_sub(v.len()));
        }
        grow(&mut self.of, places);
        grow(&mut self.sorting, places.div_ceil(64));
        self.calendar.reserve_to(there);
        grow(&mut self.ready, there);
    }

    /// Gives room for more than so many back, unless it is in use; the calendar's is given back nevertheless: then all are asked.
    pub(super) fn shrink_to(&mut self, [places, there]: [usize; 2]) {
        self.of.shrink_to(places);
        self.sorting.shrink_to(places.div_ceil(64));
        self.calendar.shrink_to(there);
        self.ready.shrink_to(there);
    }

    /// What [`List::reserve_to`] takes beside what is held: more bytes in all, and those of the largest array that is there until its new one is filled.
    pub(super) fn growth(&self, [places, there]: [usize; 2]) -> [usize; 2] {
        let sorting = self.sorting.capacity();
        let [told, sheets] = self.calendar.room(there);
        let all = [
            grown::<Place>(self.of.capacity(), places),
            grown::<u64>(sorting, places.div_ceil(64)),
            grown::<(u32, Due)>(told[0], told[1]),
            grown::<u32>(sheets[0], sheets[1]),
            grown::<u32>(self.ready.capacity(), there),
        ];
        all.iter().fold([0; 2], |sum, g| [sum[0] + g[0], sum[1].max(g[1])])
    }

    /// There are so many places at least; in new ones is nothing.
    #[inline]
    pub(super) fn extend_to(&mut self, places: usize) {
        if self.of.len() < places {
            self.of.resize(places, Place::EMPTY);
            self.sorting.resize(places.div_ceil(64), 0);
        }
    }

    /// When what is in a place is due.
    pub(super) fn due(&self, at: u32) -> Due {
        self.of.get(at as usize).map_or(Due::NEVER, |p| p.due)
    }

    /// Something is in a place.
    #[inline]
    pub(super) fn has(&self, at: u32) -> bool {
        self.of.get(at as usize).is_some_and(|p| p.due != Due::NEVER)
    }

    /// What is in a place.
    #[inline]
    pub(super) fn get(&self, at: u32) -> Option<Entry> {
        self.of.get(at as usize).filter(|p| p.due != Due::NEVER).map(Place::entry)
    }

    /// What is in a place, or was there last.
    #[inline]
    pub(super) fn last_at(&self, at: u32) -> Option<Entry> {
        self.of.get(at as usize).map(Place::entry)
    }

    /// Where the split of that stands in memory.
    #[inline]
    pub(super) fn split_at(&self, at: u32) -> Option<&u32> {
        self.of.get(at as usize).map(|p| &p.split)
    }

    /// Puts an entry into a place. It is looked at in this frame: [`List::set_due`] is called for it, or [`List::begin`] told to ask all.
    #[inline]
    pub(super) fn put(&mut self, at: u32, entry: &Entry) {
        if let Some(p) = self.of.get_mut(at as usize) {
            *p = Place { centre: entry.centre(), bounds: entry.bounds(), split: entry.split, due: Due::NOW };
        }
    }

    /// What is in a place, or was taken out of it, is there and dealt with in this frame, as what is put there is.
    #[inline]
    pub(super) fn hold(&mut self, at: u32) {
        self.note(at, Due::NOW);
    }

    /// What was taken out of a place is there again, and to be looked at at once.
    #[inline]
    pub(super) fn put_back(&mut self, at: u32) {
        self.set_due(at, Due::NOW);
    }

    /// Takes out what is in a place.
    #[inline]
    pub(super) fn take_out(&mut self, at: u32) {
        self.note(at, Due::NEVER);
    }

    #[inline]
    fn note(&mut self, at: u32, due: Due) {
        if let Some(p) = self.of.get_mut(at as usize) {
            p.due = due;
        }
    }

    #[inline]
    pub(super) fn set_due(&mut self, at: u32, due: Due) {
        let Some(p) = self.of.get_mut(at as usize) else { return };
        p.due = due;
        self.calendar.tell(at, due);
    }

    /// Begins a frame: finds the places that are due; `all`: those of all entries. Returns how many there are.
    pub(super) fn begin(&mut self, all: bool, clock: &Clocks) -> usize {
        let now = clock.sums();
        self.ready.clear();
        if all {
            self.calendar.forget();
            let there = (0..).zip(&self.of).filter(|(_, p)| p.due != Due::NEVER).map(|(at, _)| at);
            self.ready.extend(there);
        } else if self.calendar.includes(now) {
            self.ask_calendar(now);
        } else {
            self.ask_all(now, clock);
        }
        self.were_due = self.ready.len();
        self.were_due
    }

    /// Begins a calendar. What does not stand in it is asked without a branch for each.
    fn ask_all(&mut self, now: Sums, clock: &Clocks) {
        let end = self.calendar.begin(clock);
        let mut first = 0;
        for block in self.of.chunks(16) {
            if block.iter().fold(false, |any, p| any | end.have_reached(p.due)) {
                for (at, d) in (first..).zip(block.iter().map(|p| p.due)) {
                    if now.have_reached(d) {
                        self.ready.push(at);
                    } else if end.have_reached(d) {
                        self.calendar.tell(at, d);
                    }
                }
            }
            first += 16;
        }
    }

    fn ask_calendar(&mut self, now: Sums) {
        // Each once, though it was put there, or told, more than once since.
        let (of, sorting) = (&self.of, &mut self.sorting);
        let is = |at: u32| of.get(at as usize).map_or(Due::NEVER, |p| p.due);
        self.calendar.ask(now, is, |at| sorting[at as usize / 64] |= 1 << (at % 64));
        let ready = &mut self.ready;
        for (word, first) in self.sorting.iter_mut().zip((0u32..).step_by(64)).filter(|(w, _)| **w != 0) {
            let mut left = std::mem::take(word);
            while left != 0 {
                ready.push(first + left.trailing_zeros());
                left &= left - 1;
            }
        }
    }

    /// Looks at all that is due. `sort` is told of each whether it is needed, or to be kept, and when that is to be looked at again; what it answers with a mark stays among what is due, the others leave.
    pub(super) fn look(
        &mut self,
        ask: (&Clocks, &Many<'_>),
        sort: impl Fn(&Entry, bool, Due) -> (Option<Mark>, Due),
    ) {
        let mut told = vec![(false, Due::NEVER); self.ready.len().min(BLOCK)];
        let (mut from, mut kept) = (0, 0);
        while from < self.ready.len() {
            let to = (from + BLOCK).min(self.ready.len());
            let (places, told) = (&self.ready[from..to], &mut told[..to - from]);
            let half = places.len() / 2 / LOT * LOT;
            let (first, second) = told.split_at_mut(half);
            both(
                places.len() >= MANY,
                || self.look_at(ask, &places[..half], first),
                || self.look_at(ask, &places[half..], second),
            );
            for (k, &(wanted, due)) in (from..to).zip(&*told) {
                let at = self.ready[k];
                let Some(e) = self.get(at) else { continue };
                let (mark, due) = sort(&e, wanted, due);
                match mark {
                    Some(Mark::Now) => self.hold(at),
                    // It is told when its page has been wished for.
                    Some(Mark::Later) => self.note(at, due),
                    None => self.set_due(at, due),
                }
                if let Some(mark) = mark {
                    self.ready[kept] = at | if mark == Mark::Later { LATER } else { 0 };
                    kept += 1;
                }
            }
            from = to;
        }
        self.ready.truncate(kept);
    }

    /// Looks at what is in places, a lot at a time.
    fn look_at(&self, (clock, many): (&Clocks, &Many<'_>), places: &[u32], told: &mut [(bool, Due)]) {
        let (mut looked, mut entries) = (Looked::default(), Vec::with_capacity(LOT));
        for (places, told) in places.chunks(LOT).zip(told.chunks_mut(LOT)) {
            entries.clear();
            entries.extend(places.iter().map(|&at| self.of[at as usize].entry()));
            clock.look(many, &entries, &mut looked);
            told.iter_mut().zip(looked.each()).for_each(|(t, l)| *t = l);
        }
    }

    /// How many were due when that was found out last.
    pub(super) fn were_due(&self) -> usize {
        self.were_due
    }

    /// What has stayed after [`List::look`].
    pub(super) fn marked(&self, k: usize) -> Option<(u32, Mark)> {
        let at = *self.ready.get(k)?;
        Some((at & !LATER, if at & LATER != 0 { Mark::Later } else { Mark::Now }))
    }

    /// Place `k` of those that are due, and what is there; `None` if it was taken out.
    #[inline]
    pub(super) fn ready(&self, k: usize) -> Option<(u32, Entry)> {
        let at = *self.ready.get(k)?;
        self.get(at).map(|e| (at, e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hierarchy::pack_up;
    use crate::selective::{Cull, Judges, Lens};
    use crate::view::Camera;
    use glam::{DMat4, DVec3};
    use std::collections::{BTreeMap, BTreeSet};

    fn entry(split: u32, at: DVec3) -> Entry {
        let packed = Packed { error: pack_up(0.002), radius: pack_up(0.01), ..Packed::default() };
        Entry::new(split, at.as_vec3(), packed)
    }

    fn lens(eye: DVec3, look: DVec3) -> [Lens; 1] {
        [Lens::about(DVec3::ZERO, &Camera::looking(eye, look), &DMat4::IDENTITY, 1.0, Cull::Frustum).unwrap()]
    }

    /// Growing takes what was said, and afterwards nothing takes more, though all is due at once and was told more than once, or more often than there is room for.
    #[test]
    fn no_more_is_taken_than_was_said() {
        for (places, times) in [(1, 2), (7, 2), (500, 2), (1000, 2), (3000, 2), (3000, 9)] {
            let (mut clock, mut list) = (Clocks::new(1.4), List::default());
            for there in [places / 2, places] {
                let (before, [more, most]) = (list.bytes(), list.growth([places, there]));
                list.reserve_to([places, there]);
                assert!(list.bytes() <= before + more && most <= before, "{places} {there}");
                assert!(list.capacity()[0] >= places && list.capacity()[1] >= there);
            }
            list.extend_to(places);
            let step = |clock: &mut Clocks, k: f64| {
                let lens = lens(DVec3::new(1e-3 * k - 0.5, 0.0, 0.1), DVec3::X);
                clock.go_on(&Judges::new(&lens, 1.0))
            };
            step(&mut clock, 0.0);
            (0..places as u32).for_each(|at| list.put(at, &entry(at, DVec3::ZERO)));
            assert_eq!(list.begin(true, &clock), places);
            assert!(step(&mut clock, 1.0));
            (0..places as u32).for_each(|at| list.take_out(at));
            assert_eq!(list.begin(false, &clock), 0);
            let bytes = list.bytes();
            let due = |frames: f32| Due::new(0.0, 1e-3 * (1.0 + frames));
            for k in 0..times {
                // Of ninths the last is true.
                let frames = if times > 2 { (times - k) as f32 } else { 1.0 };
                (0..places as u32).for_each(|at| list.set_due(at, due(frames - 0.5)));
            }
            assert_eq!(list.calendar.includes(clock.sums()), times * places <= 2000);
            assert!(step(&mut clock, 2.0));
            assert_eq!(list.begin(false, &clock), places);
            assert!((0..places).all(|k| list.ready(k).is_some_and(|r| r.0 == k as u32)));
            assert_eq!(list.bytes(), bytes);
        }
    }

    /// On a flight that goes faster, stands and turns, while entries come and go, what is found to be due is what is when all are asked.
    #[test]
    fn what_is_due_is_found() {
        for room in [2100, 10] {
            what_is_due_is_found_with(room);
        }
    }

    /// With so much room in the calendar.
    fn what_is_due_is_found_with(room: usize) {
        let mut state = 7u64;
        let mut unit = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        let mut vector = move || DVec3::new(unit(), unit(), 0.1 * unit()) - DVec3::new(0.5, 0.5, 0.0);
        let (mut clock, mut list) = (Clocks::new(1.4), List::default());
        list.reserve_to([2100; 2]);
        list.extend_to(2000);
        list.calendar = Calendar::default();
        list.calendar.reserve_to(room);
        // When each place was told to be due.
        let mut told: BTreeMap<u32, Due> = BTreeMap::new();
        let (mut eye, mut angle, mut splits) = (DVec3::new(-0.4, 0.0, 0.05), 0.0f64, 0);
        let (mut found_soon, mut all_found, mut known, mut full) = (0, 0, 0, 0);
        for frame in 0..300 {
            let speed = [0.0, 1e-4, 1e-3, 4e-3][frame / 10 % 4];
            angle += [0.0, 0.0, 2e-3][frame / 7 % 3];
            let look = DVec3::new(angle.cos(), angle.sin(), -0.1);
            eye += speed * look;
            let lens = lens(eye, look);
            let judges = Judges::new(&lens, 1.0);
            let stands = clock.go_on(&judges);
            let soon = list.calendar.includes(clock.sums());
            known += usize::from(soon);
            if frame % 50 == 49 {
                // What is there stays, and when it is due.
                list.shrink_to([0; 2]);
                list.reserve_to([2100, room]);
            }
            let count = list.begin(!stands, &clock);
            let found: Vec<u32> = (0..count).filter_map(|k| list.ready(k)).map(|r| r.0).collect();
            let times = found.len();
            let found: BTreeSet<u32> = found.into_iter().collect();
            assert_eq!(found.len(), times, "each once, frame {frame}");
            let due = |d: &Due| !stands || clock.sums().have_reached(*d);
            let expected: BTreeSet<u32> = told.iter().filter(|t| due(t.1)).map(|t| *t.0).collect();
            assert_eq!(found, expected, "frame {frame}");
            if soon && stands {
                found_soon += found.len();
            }
            all_found += found.len();
            let was_known = list.calendar.includes(clock.sums());
            let asked: Vec<Entry> = found.iter().map(|&p| list.get(p).unwrap()).collect();
            let mut looked = Looked::default();
            clock.look(&clock.next(&judges), &asked, &mut looked);
            for (&place, (_, due)) in found.iter().zip(looked.each()) {
                list.set_due(place, due);
                told.insert(place, due);
            }
            full += usize::from(was_known && !list.calendar.includes(clock.sums()));
            let gone: Vec<u32> =
                told.keys().copied().filter(|p| (p + frame as u32).is_multiple_of(97)).collect();
            for p in gone {
                list.take_out(p);
                told.remove(&p);
            }
            for place in 0..2000 {
                if told.contains_key(&place) {
                    continue;
                }
                assert!(!list.has(place) && list.get(place).is_none());
                // The same again, or another.
                if splits % 3 == 1 {
                    list.put_back(place);
                } else {
                    list.put(place, &entry(splits, vector()));
                    list.set_due(place, Due::NOW);
                    assert_eq!(list.get(place).map(|e| e.split), Some(splits));
                }
                assert!(list.has(place) && told.insert(place, Due::NOW).is_none());
                splits += 1;
            }
        }
        assert!(found_soon > 1000 && all_found < 300 * 1000, "{found_soon} of {all_found}");
        assert!(known > 100 && (full > 4) == (room < 100), "{known} {full}");
    }

    /// Few and many, by one thread and by several: what is marked is what is needed, and of the others is noted when they are due, as if each was looked at alone.
    #[test]
    fn what_is_looked_at_is_marked_or_told_when() {
        let lens = lens(DVec3::new(-0.5, 0.0, 0.1), DVec3::new(0.5, 0.0, -0.1));
        let judges = Judges::new(&lens, 1.0);
        for count in [0, 1, 33, 700, 3000, 9001] {
            for threads in [1, 2, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let (mut clock, mut list) = (Clocks::new(1.4), List::default());
                clock.go_on(&judges);
                list.reserve_to([count; 2]);
                list.extend_to(count);
                for at in 0..count as u32 {
                    let k = f64::from(at);
                    list.put(at, &entry(at, DVec3::new((k * 0.618).fract(), (k * 0.414).fract(), 0.0) - 0.5));
                }
                (0..count as u32).step_by(5).for_each(|at| list.take_out(at));
                let many = clock.next(&judges);
                let due = list.begin(true, &clock);
                assert_eq!(due, count - count.div_ceil(5));
                // Gone since.
                (0..count as u32).skip(1).step_by(35).for_each(|at| list.take_out(at));
                pool.install(|| {
                    list.look((&clock, &many), |e, wanted, due| match wanted {
                        true => (Some(if e.split % 2 == 0 { Mark::Now } else { Mark::Later }), due),
                        false => (None, due),
                    });
                });
                let mut marked = (0..).map_while(|k| list.marked(k));
                for at in (0..count as u32).filter(|at| at % 5 != 0 && at % 35 != 1) {
                    let mut looked = Looked::default();
                    clock.look(&many, &[list.of[at as usize].entry()], &mut looked);
                    let (wanted, due) = looked.each().next().unwrap();
                    let even = at % 2 == 0;
                    assert_eq!(list.due(at), if wanted && even { Due::NOW } else { due });
                    if wanted {
                        assert_eq!(marked.next(), Some((at, if even { Mark::Now } else { Mark::Later })));
                    }
                }
                assert_eq!(marked.next(), None);
            }
        }
    }
}
