//! What is to be found out about the vertices of a front: which splits are not needed any more, and which are now.

use super::View;
use super::clock::{Found, Judges, Many};
use super::entry::Entry;
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
    turn: usize,
    /// Which record of the lot it is asked for.
    of: u32,
}

/// What is asked of a lot, and what was decided.
struct Asked<'a> {
    asks: [Ask<'a>; RECORDS],
    count: usize,
    places: [Vec3; RECORDS],
    entries: Vec<Entry>,
    found: Vec<Found>,
}

impl<'a> Asked<'a> {
    fn new(none: Ask<'a>) -> Self {
        Asked {
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

    /// Finds places and bounds, each for all before the next.
    #[inline(always)]
    fn gather(&mut self, h: &Hierarchy) {
        let asks = &self.asks[..self.count];
        for (place, a) in self.places.iter_mut().zip(asks) {
            *place = h.bounds.local(h.forest.place_after(h.mesh(), a.vertex, a.chain.prefix(a.turn)));
        }
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
}

impl Survey {
    #[cfg(feature = "parallel")]
    fn append(&mut self, mut next: Survey) {
        self.unneeded.append(&mut next.unneeded);
        self.needed.append(&mut next.needed);
        self.slack.append(&mut next.slack);
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

    /// Each step for a lot before the next: they wait for memory, and then wait together.
    fn survey_of(&self, records: &[u32], judges: &Judges<'_>) -> Survey {
        let (h, forest) = (&*self.hierarchy, &self.hierarchy.forest);
        let pm = h.mesh();
        let (for_last, for_next) = (judges.last(&self.clock), judges.next(&self.clock));
        let mut survey = Survey { slack: Vec::with_capacity(records.len()), ..Survey::default() };
        let none = Ask { split: NONE, vertex: NONE, chain: forest.no_chain(), turn: 0, of: 0 };
        let (mut last, mut next) = (Asked::new(none), Asked::new(none));
        for lot in records.chunks(RECORDS) {
            let mut own = [none; RECORDS];
            let own = &mut own[..lot.len()];
            (last.count, next.count) = (0, 0);
            for (k, (own, &r)) in own.iter_mut().zip(lot).enumerate() {
                let record = &self.front.records[r as usize];
                own.vertex = self.front.vertex_of_record(r);
                own.of = k as u32;
                let ask = Ask { split: record.made, ..*own };
                last.push(ask, record.made != NONE && record.dependents == 0);
            }
            let lasts = &mut last.asks[..last.count];
            lasts.iter_mut().for_each(|a| a.vertex = pm.splits.vertex[a.split as usize]);
            own.iter_mut().chain(&mut *lasts).for_each(|a| a.chain = forest.chain(a.vertex));
            let firsts = own.iter().chain(&*lasts).map(|a| a.chain.first().unwrap_or(0));
            std::hint::black_box(firsts.fold(0, |sum, i| sum ^ i));
            for a in lasts {
                a.turn = a.chain.iter().position(|i| i >= a.split).unwrap_or(0);
            }
            for own in &*own {
                let (turn, split) = self.front.next_of(own.chain);
                next.push(Ask { split, turn, ..*own }, split != NONE);
            }
            last.gather(h);
            next.gather(h);
            last.decide(&for_last);
            next.decide(&for_next);
            let mut slack = [f32::INFINITY; RECORDS];
            for (a, _, found) in last.all() {
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
                    survey.needed.push(Open { split: a.split, vertex: a.vertex, turn: a.turn as u32, at });
                }
            }
            survey.looks += last.count + next.count;
            survey.slack.extend_from_slice(&slack[..lot.len()]);
        }
        survey
    }
}
