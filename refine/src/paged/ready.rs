//! Memory asked for ahead: what the next splits touch is read for all of them, step by step, so that it is waited for together and not dozens of times for each. It changes nothing but the time.

use super::PagedView;
use super::page::{LED, Record};
use crate::aif::NONE;
use crate::format::ByteRanges;

/// Splits that are looked at, applied or undone at a time: enough that memory is waited for together, and few enough to stay in the nearest cache.
pub(super) const LOT: usize = 32;

/// Places in memory to be read one right after the other: then the processor asks for the next ones while it waits.
struct Reads<'a> {
    of: [&'a u32; 2 * LOT],
    n: usize,
}

impl<'a> Reads<'a> {
    fn new() -> Self {
        Reads { of: [&NONE; 2 * LOT], n: 0 }
    }

    #[inline]
    fn ask(&mut self, at: &'a u32) {
        self.of[self.n] = at;
        self.n += 1;
        if self.n == self.of.len() {
            self.wait();
        }
    }

    /// A record reaches over two lines.
    #[inline]
    fn ask_for(&mut self, r: &'a Record) {
        self.ask(&r.vertex);
        self.ask(&r.last_place);
    }

    #[inline]
    fn wait(&mut self) {
        std::hint::black_box(self.of[..self.n].iter().fold(0, |sum, x| sum ^ **x));
        self.n = 0;
    }
}

impl<S: ByteRanges> PagedView<S> {
    /// Before splits, [`LOT`] at most, are applied; those whose pages are not there are left out.
    pub(super) fn ready_to_apply(&self, lot: &[u32]) {
        let mut needed = [0; 2 * LOT];
        let mut n = 0;
        self.read_around(lot, |d| {
            if n < needed.len() {
                needed[n] = d;
                n += 1;
            }
        });
        // What they depend on comes with them.
        for part in needed[..n].chunks(LOT) {
            self.read_around(part, |_| ());
        }
    }

    /// The records of these, [`LOT`] at most, read.
    fn records_of<'a>(&'a self, lot: &[u32], reads: &mut Reads<'a>) -> [Option<&'a Record>; LOT] {
        let mut of = [None; LOT];
        for (of, &i) in of.iter_mut().zip(lot) {
            *of = self.shelf.record(i);
            of.iter().for_each(|r| reads.ask_for(r));
        }
        reads.wait();
        of
    }

    /// What applying these takes; `tell` is told what they depend on and is not asked for.
    fn read_around(&self, lot: &[u32], mut tell: impl FnMut(u32)) {
        let shelf = &self.shelf;
        let mut reads = Reads::new();
        let mut of = self.records_of(lot, &mut reads);
        // The splits that they depend on, of which two make the faces of their cuts; the vertex's, and those that come next.
        let mut needs = [[None; 3]; LOT];
        let mut sides = [[0; 2]; LOT];
        for (((of, needs), sides), &i) in of.iter_mut().zip(&mut needs).zip(&mut sides).zip(lot) {
            let Some(r) = *of else { continue };
            if r.flags & LED != 0 {
                *of = None;
                continue;
            }
            let found = [(shelf.maker(r.parent), 0), shelf.half_of_cut(r.left), shelf.half_of_cut(r.right)];
            *sides = [found[1].1, found[2].1];
            for (need, (d, _)) in needs.iter_mut().zip(found) {
                *need = if d == NONE { None } else { shelf.record(d).map(|r| (d, r)) };
                need.iter().for_each(|(_, r)| reads.ask_for(r));
            }
            // The vertex is mostly one that is made by another split than its node.
            let maker = r.vertex.wrapping_sub(shelf.head.base_vertices);
            for j in [maker, r.next[0], r.next[1]] {
                if j < shelf.head.splits && j != i {
                    shelf.record(j).iter().for_each(|r| reads.ask_for(r));
                }
            }
        }
        reads.wait();
        let mut slots = [[NONE; 2]; LOT];
        for (((of, needs), sides), slots) in of.iter().zip(&needs).zip(&sides).zip(&mut slots) {
            let Some(r) = of else { continue };
            for (d, need) in needs.iter().flatten() {
                if need.flags & LED == 0 {
                    tell(*d);
                } else if let Some(o) = self.last.get(need.last_place) {
                    reads.ask(&o.node);
                }
            }
            let open = shelf.open_place(r.parent);
            self.open.get(open).iter().for_each(|o| reads.ask(&o.node));
            for ((slot, need), side) in slots.iter_mut().zip(&needs[1..]).zip(sides) {
                *slot = need.map_or(NONE, |(_, r)| r.slots[*side]);
            }
            self.ask_for_faces(slots.iter().copied(), &mut reads);
        }
        reads.wait();
        for slots in &slots[..lot.len().min(LOT)] {
            slots.iter().for_each(|&s| self.ask_for_faces(self.across(s), &mut reads));
        }
        reads.wait();
    }

    /// Before splits, [`LOT`] at most, are undone.
    pub(super) fn ready_to_undo(&self, lot: &[u32]) {
        let shelf = &self.shelf;
        let mut reads = Reads::new();
        let of = self.records_of(lot, &mut reads);
        for r in of.iter().flatten() {
            for d in shelf.needs_of(r).into_iter().filter(|&d| d != NONE) {
                shelf.record(d).iter().for_each(|r| reads.ask_for(r));
            }
            let maker = r.vertex.wrapping_sub(shelf.head.base_vertices);
            if maker < shelf.head.splits {
                shelf.record(maker).iter().for_each(|r| reads.ask_for(r));
            }
            for place in r.open_place {
                self.open.get(place).iter().for_each(|o| reads.ask(&o.node));
            }
            self.ask_for_faces(r.slots.into_iter(), &mut reads);
        }
        reads.wait();
        for r in of.iter().flatten() {
            r.slots.iter().for_each(|&s| self.ask_for_faces(self.across(s), &mut reads));
        }
        reads.wait();
    }

    /// The slots of the faces across the edges of the one in a slot.
    #[inline]
    fn across(&self, slot: u32) -> impl Iterator<Item = u32> {
        let links = self.fans.links.get(slot as usize).copied().unwrap_or([NONE; 3]);
        links.into_iter().map(|l| l >> 3)
    }

    #[inline]
    fn ask_for_faces<'a>(&'a self, slots: impl Iterator<Item = u32>, reads: &mut Reads<'a>) {
        for slot in slots {
            if let Some(c) = self.fans.corners.get(slot as usize) {
                reads.ask(&c[0]);
                reads.ask(&self.fans.links[slot as usize][0]);
            }
        }
    }
}
