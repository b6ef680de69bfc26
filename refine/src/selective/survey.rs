//! What is to be found out about the vertices of a front: which splits are not needed any more, and which are now.

use super::View;
use super::clock::{Found, Judges, Many};
use super::entry::Entry;
use super::front::Record;
use super::refine::Open;
use crate::aif::NONE;
use crate::hierarchy::Hierarchy;
use crate::packed::Run;
use glam::Vec3;

/// What became of records that were looked at.
#[derive(Debug, Default)]
pub(super) struct Survey {
    /// Splits that are not to be kept and can be undone, in the order of their records.
    pub(super) unneeded: Vec<u32>,
    /// Splits that come next and are needed, likewise.
    pub(super) needed: Vec<Open>,
    /// Of each record how far lenses may move before anything else can be decided about it; negative if something is to be done about it.
    pub(super) slack: Vec<f32>,
    /// Of each record, whether nothing about it changes as long as lenses keep their distance: see [`super::standoff`].
    pub(super) too_fine: Vec<bool>,
    /// Splits that were looked at.
    pub(super) looks: usize,
}

/// Splits that are got ready, applied or undone at a time: enough that memory is waited for together, and few enough to be in the nearest cache.
pub(super) const LOT: usize = 32;

/// Records that are looked at at a time.
const RECORDS: usize = 64;

/// Records from which on threads share the work: below, handing it out takes as long.
#[cfg(feature = "parallel")]
const MANY: usize = 4096;

/// A split of a vertex that is to be decided about.
#[derive(Clone, Copy, Debug)]
struct Ask<'a> {
    split: u32,
    vertex: u32,
    /// Its splits, and how many of them come before.
    chain: Run<'a>,
    turn: u32,
    /// The last of these; [`NONE`] if there is none.
    before: u32,
    /// Which of the lot it is asked for.
    of: u32,
}

/// Splits of a lot that are asked about, and what was decided: each step for all of them before the next, as they wait for memory, and then wait together.
pub(super) struct Asked<'a> {
    h: &'a Hierarchy,
    asks: [Ask<'a>; RECORDS],
    count: usize,
    places: [Vec3; RECORDS],
    entries: Vec<Entry>,
    found: Vec<Found>,
}

/// Reads what the next step asks for: in a loop as short as that, the processor waits for all of it together.
#[inline(always)]
fn fetch<T>(of: &[T], read: impl Fn(&T) -> u32) {
    std::hint::black_box(of.iter().fold(0, |sum, x| sum ^ read(x)));
}

impl<'a> Asked<'a> {
    pub(super) fn new(h: &'a Hierarchy) -> Self {
        let none =
            Ask { split: NONE, vertex: NONE, chain: h.forest.no_chain(), turn: 0, before: NONE, of: 0 };
        Asked {
            h,
            asks: [none; RECORDS],
            count: 0,
            places: [Vec3::ZERO; RECORDS],
            entries: Vec::with_capacity(RECORDS),
            found: Vec::with_capacity(RECORDS),
        }
    }

    /// Adds a split, if it is one.
    #[inline(always)]
    fn push(&mut self, ask: Ask<'a>, is: bool) {
        self.asks[self.count] = ask;
        self.count += usize::from(is);
    }

    /// Finds the chains that the splits are of, and where in them they are.
    #[inline(always)]
    fn trace(&mut self) {
        let pm = self.h.mesh();
        let asks = &mut self.asks[..self.count];
        asks.iter_mut().for_each(|a| a.vertex = pm.splits.vertex[a.split as usize]);
        fetch(asks, |a| self.h.forest.fetch_chain(a.vertex));
        asks.iter_mut().for_each(|a| a.chain = self.h.forest.chain(a.vertex));
        fetch(asks, |a| a.chain.fetch().into());
        for a in asks {
            (a.turn, a.before) = (0, NONE);
            while let Some(i) = a.chain.get(a.turn as usize).filter(|&i| i < a.split) {
                a.before = i;
                a.turn += 1;
            }
        }
    }

    /// Finds places and bounds.
    #[inline(always)]
    fn gather(&mut self) {
        let (h, forest, pm) = (self.h, &self.h.forest, self.h.mesh());
        let asks = &self.asks[..self.count];
        // Those of which the last split before moved the vertex, and the others. Written whether they are or not, as what a branch would wait for cannot be foreseen.
        let (mut moved, mut rows, mut others) = ([0u8; RECORDS], [0; RECORDS], [0u8; RECORDS]);
        let (mut m, mut n) = (0, 0);
        for (k, a) in asks.iter().enumerate() {
            let none = a.before == NONE;
            let (is, row) = forest.moved(if none { 0 } else { a.before });
            let is = is & !none;
            (moved[m], rows[m], others[n]) = (k as u8, row, k as u8);
            (m, n) = (m + usize::from(is), n + usize::from(!is));
        }
        let places = &mut self.places;
        pm.moved_positions.each(&rows[..m], |k, p| places[usize::from(moved[k])] = h.bounds.local(p));
        // Of these most stand where they were made.
        let (mut made, mut of, mut m) = ([0u8; RECORDS], [0; RECORDS], 0);
        for &k in &others[..n] {
            let a = &asks[usize::from(k)];
            let maker = a.vertex.wrapping_sub(forest.base_vertices);
            if a.vertex < forest.base_vertices || a.turn > 0 {
                let applied = a.chain.prefix(a.turn as usize);
                places[usize::from(k)] = h.bounds.local(forest.place_after(pm, a.vertex, applied));
                continue;
            }
            (made[m], of[m]) = (k, maker);
            m += 1;
        }
        pm.new_positions.each(&of[..m], |k, p| places[usize::from(made[k])] = h.bounds.local(p));
        fetch(asks, |a| h.bounds.of[a.split as usize].radius.into());
        self.entries.clear();
        self.entries.extend(asks.iter().zip(&self.places).map(|(a, &at)| Entry::placed(h, a.split, at)));
    }

    fn decide(&mut self, many: &Many<'_>) {
        self.found.clear();
        many.look(&self.entries, &mut self.found);
    }

    /// What was asked, where it is, and what was decided.
    fn all(&self) -> impl Iterator<Item = (&Ask<'a>, Vec3, Found)> {
        self.asks.iter().zip(&self.places).zip(&self.found).map(|((a, &at), &f)| (a, at, f))
    }

    /// Splits that are not needed, of some that can be undone, appended to `out`.
    pub(super) fn unneeded(&mut self, splits: &[u32], many: &Many<'_>, out: &mut Vec<u32>) {
        let mut wanted = Vec::with_capacity(RECORDS);
        for lot in splits.chunks(RECORDS) {
            self.count = lot.len();
            self.asks.iter_mut().zip(lot).for_each(|(a, &i)| a.split = i);
            self.trace();
            self.gather();
            wanted.clear();
            many.wanted(&self.entries, &mut wanted);
            out.extend(lot.iter().zip(&wanted).filter(|k| !k.1).map(|k| *k.0));
        }
    }
}

impl Survey {
    #[cfg(feature = "parallel")]
    fn append(&mut self, mut next: Survey) {
        self.unneeded.append(&mut next.unneeded);
        self.needed.append(&mut next.needed);
        self.slack.append(&mut next.slack);
        self.too_fine.append(&mut next.too_fine);
        self.looks += next.looks;
    }
}

impl View {
    /// Looks at what made the vertices of these records, none of them free, as far as that could be undone, and at what comes next at each.
    pub(super) fn survey(&self, records: &[u32], judges: &Judges<'_>) -> Survey {
        #[cfg(feature = "parallel")]
        if records.len() >= MANY && rayon::current_num_threads() > 1 {
            use rayon::prelude::*;
            let parts: Vec<Survey> =
                records.par_chunks(MANY / 4).map(|part| self.survey_of(part, judges)).collect();
            let mut all = Survey::default();
            parts.into_iter().for_each(|part| all.append(part));
            return all;
        }
        self.survey_of(records, judges)
    }

    fn survey_of(&self, records: &[u32], judges: &Judges<'_>) -> Survey {
        let h = &*self.hierarchy;
        let (for_last, for_next) = (judges.last(&self.clock), judges.next(&self.clock));
        let (slack, too_fine) = (Vec::with_capacity(records.len()), Vec::with_capacity(records.len()));
        let mut survey = Survey { slack, too_fine, ..Survey::default() };
        let (mut last, mut next) = (Asked::new(h), Asked::new(h));
        let mut own = [(last.asks[0].chain, Record::default()); RECORDS];
        for lot in records.chunks(RECORDS) {
            (last.count, next.count) = (0, 0);
            fetch(lot, |&r| h.forest.fetch_chain(self.front.vertex_of_record(r)));
            for (k, (own, &r)) in own.iter_mut().zip(lot).enumerate() {
                let record = self.front.records[r as usize];
                let ask = Ask { split: record.made(), of: k as u32, ..last.asks[0] };
                last.push(ask, r >= self.front.base_vertices && record.dependents == 0);
                *own = (h.forest.chain(self.front.vertex_of_record(r)), record);
            }
            fetch(&own[..lot.len()], |own| own.0.fetch().into());
            for (k, (&(chain, record), &r)) in own.iter().zip(lot).enumerate() {
                let (turn, split) = self.front.next_of_record(record, chain);
                debug_assert_eq!((turn, split), self.front.next_of(chain));
                let before = turn.checked_sub(1).map_or(NONE, |k| chain.at(k));
                let vertex = self.front.vertex_of_record(r);
                let ask = Ask { split, vertex, chain, turn: turn as u32, before, of: k as u32 };
                next.push(ask, split != NONE);
            }
            last.trace();
            last.gather();
            next.gather();
            last.decide(&for_last);
            next.decide(&for_next);
            let (mut slack, mut too_fine) = ([f32::INFINITY; RECORDS], [true; RECORDS]);
            for (a, _, found) in last.all() {
                too_fine[a.of as usize] = false;
                let slack = &mut slack[a.of as usize];
                *slack = found.slack;
                if !found.wanted {
                    *slack = -1.0;
                    survey.unneeded.push(a.split);
                }
            }
            for (a, at, found) in next.all() {
                let slack = &mut slack[a.of as usize];
                *slack = slack.min(found.slack);
                if found.wanted {
                    *slack = -1.0;
                    survey.needed.push(Open { split: a.split, vertex: a.vertex, turn: a.turn, at });
                }
            }
            for (a, e) in next.asks.iter().zip(&next.entries) {
                too_fine[a.of as usize] &= self.standoff.holds_for(e);
            }
            survey.looks += last.count + next.count;
            survey.slack.extend_from_slice(&slack[..lot.len()]);
            survey.too_fine.extend_from_slice(&too_fine[..lot.len()]);
        }
        survey
    }
}
