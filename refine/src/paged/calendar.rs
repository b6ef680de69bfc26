//! When places are due: sorted roughly, so that a frame is told those that are due in it without asking the others.
//!
//! A calendar has *days*, each of a frame like the one in which it was begun: by how far the eye moves or by how far the view turns, whichever comes first. What is told to be due stands under the last day that begins before that can be; a frame asks what stands under the days that have begun by then, and leaves there
//! what is not due yet. How lenses really move may differ: then days are long or short, and what is found to be due is the same. After the last day all is to be asked anew.

use crate::aif::NONE;
use crate::selective::{Clocks, Due, Paces, Sums};

/// Days of a calendar, behind the first: once in so many frames all are asked. Of 32, 64 and 128, over generated terrain of 4,097 x 4,097: means of fast laps (lemniscate, circle) are 1601, 1576, 1605 and 680, 628, 613
/// microseconds, of slow ones 240, 241, 255 and 178, 152, 131.
const DAYS: usize = 64;
/// Entries of a sheet; a day has as many sheets as it needs, the last of them half full on the mean.
const SHEET: usize = 32;

/// The sheets of a day: the last, and how many entries are on it. Those before it are full.
#[derive(Clone, Copy, Debug)]
struct Day {
    sheet: u32,
    entries: usize,
}

impl Day {
    const EMPTY: Day = Day { sheet: NONE, entries: SHEET };
}

/// See the [module](self).
#[derive(Debug)]
pub(super) struct Calendar {
    /// Sheets: places, and when they are due. What has been told otherwise since is still there.
    told: Vec<(u32, Due)>,
    /// The sheet of the same day before each; of free ones the next.
    before: Vec<u32>,
    free: u32,
    days: [Day; DAYS + 1],
    /// When each day begins, but for the first, which has begun; and when the last ends. Nothing if there is none.
    paces: Option<(Paces, [Sums; DAYS + 1])>,
    /// The last day that has begun.
    today: usize,
}

impl Default for Calendar {
    fn default() -> Self {
        let days = [Day::EMPTY; DAYS + 1];
        Calendar { told: vec![], before: vec![], free: NONE, days, paces: None, today: 0 }
    }
}

impl Calendar {
    /// Entries that it takes room for so that so many can be true: a quarter more, for those that are not any more, and sheets that are not full.
    pub(super) fn entries(there: usize) -> usize {
        there + there.div_ceil(4) + SHEET * (DAYS + 2)
    }

    /// Bytes that it takes for each that can be there, at most, but for some that do not depend on these.
    pub(super) const EACH: usize = size_of::<(u32, Due)>() * 5 / 4 + 1;

    /// So many can be there.
    pub(super) fn capacity(&self) -> usize {
        self.told.capacity().min(SHEET * self.before.capacity()).saturating_sub(SHEET * (DAYS + 2)) * 4 / 5
    }

    /// Capacities of both its arrays, and what they are with room for so many.
    pub(super) fn room(&self, there: usize) -> [[usize; 2]; 2] {
        let entries = Self::entries(there);
        [[self.told.capacity(), entries], [self.before.capacity(), entries.div_ceil(SHEET)]]
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<(u32, Due)>() * self.told.capacity() + size_of::<u32>() * self.before.capacity()
    }

    /// Room for so many.
    pub(super) fn reserve_to(&mut self, there: usize) {
        let [[_, entries], [_, sheets]] = self.room(there);
        self.told.reserve_exact(entries.saturating_sub(self.told.len()));
        self.before.reserve_exact(sheets.saturating_sub(self.before.len()));
    }

    /// Gives room for more than so many back; if it is in use, what is there is forgotten.
    pub(super) fn shrink_to(&mut self, there: usize) {
        let [[_, entries], [_, sheets]] = self.room(there);
        if self.told.len() > entries {
            self.forget();
        }
        self.told.shrink_to(entries);
        self.before.shrink_to(sheets);
    }

    /// Nothing is known any more.
    pub(super) fn forget(&mut self) {
        self.told.clear();
        self.before.clear();
        (self.free, self.days, self.paces, self.today) = (NONE, [Day::EMPTY; DAYS + 1], None, 0);
    }

    /// Begins anew: all that is due by the end that is returned is to be told.
    pub(super) fn begin(&mut self, clock: &Clocks) -> Sums {
        self.forget();
        let starts = std::array::from_fn(|k| clock.horizon(k as f64));
        self.paces = Some((clock.paces(), starts));
        starts[DAYS]
    }

    /// It knows of all that can be due.
    pub(super) fn includes(&self, now: Sums) -> bool {
        self.paces.as_ref().is_some_and(|(_, starts)| starts[DAYS].include(now))
    }

    /// A place is due then. Where there is no room for that all is forgotten.
    #[inline]
    pub(super) fn tell(&mut self, at: u32, due: Due) {
        let Some((paces, starts)) = &self.paces else { return };
        // No later than it can be: sums are rounded.
        let mut day = paces.frames_to(due, DAYS + 1);
        while day > 0 && starts[day - 1].have_reached(due) {
            day -= 1;
        }
        if day <= DAYS && !self.put(day.max(self.today), (at, due)) {
            self.forget();
        }
    }

    /// False if there is no room.
    #[inline]
    fn put(&mut self, day: usize, entry: (u32, Due)) -> bool {
        let Day { sheet, entries } = self.days[day];
        if entries == SHEET {
            return self.put_on_new(day, sheet, entry);
        }
        self.told[sheet as usize * SHEET + entries] = entry;
        self.days[day].entries = entries + 1;
        true
    }

    #[cold]
    fn put_on_new(&mut self, day: usize, before: u32, entry: (u32, Due)) -> bool {
        let sheet = self.free;
        if let Some(next) = self.before.get_mut(sheet as usize) {
            self.free = std::mem::replace(next, before);
            self.told[sheet as usize * SHEET] = entry;
            self.days[day] = Day { sheet, entries: 1 };
            return true;
        }
        let len = self.told.len() + SHEET;
        if len > self.told.capacity() || self.before.len() == self.before.capacity() {
            return false;
        }
        self.days[day] = Day { sheet: self.before.len() as u32, entries: 1 };
        self.told.resize(len, entry);
        self.before.push(before);
        true
    }

    /// Finds the places that are due, of which `is` says when they are; some twice, if they were told so twice. Time goes on.
    pub(super) fn ask(&mut self, now: Sums, is: impl Fn(u32) -> Due, mut found: impl FnMut(u32)) {
        let Some((_, starts)) = &self.paces else { return };
        let today = starts.iter().position(|s| s.include(now)).unwrap_or(DAYS);
        let (from, mut whole) = (self.today, true);
        self.today = today.max(from);
        for day in from..=self.today {
            let Day { mut sheet, mut entries } = std::mem::replace(&mut self.days[day], Day::EMPTY);
            while sheet != NONE {
                let first = sheet as usize * SHEET;
                for k in first..first + entries {
                    let (at, due) = self.told[k];
                    if !now.have_reached(due) {
                        whole &= self.put(self.today, (at, due));
                    } else if is(at) == due {
                        found(at);
                    }
                }
                let before = std::mem::replace(&mut self.before[sheet as usize], self.free);
                self.free = sheet;
                (sheet, entries) = (before, SHEET);
            }
        }
        if !whole {
            self.forget();
        }
    }
}
