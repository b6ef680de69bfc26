//! Memory asked for ahead: what the next splits touch is read for all of them, step by step, so that it is waited for together and not dozens of times for each. It changes nothing but the time.

use super::PagedView;
use super::shelf::AtHand;
use crate::aif::NONE;
use crate::format::ByteRanges;

/// Splits that are looked at, applied or undone at a time: enough that memory is waited for together, and few enough to stay in the nearest cache.
pub(super) const LOT: usize = 32;

/// Places in memory to be read one right after the other: then the processor asks for the next ones while it waits.
pub(super) struct Reads<'a> {
    of: [&'a u32; 2 * LOT],
    n: usize,
}

impl<'a> Reads<'a> {
    pub(super) fn new() -> Self {
        Reads { of: [&NONE; 2 * LOT], n: 0 }
    }

    #[inline]
    pub(super) fn ask(&mut self, at: &'a u32) {
        self.of[self.n] = at;
        self.n += 1;
        if self.n == self.of.len() {
            self.wait();
        }
    }

    #[inline]
    pub(super) fn wait(&mut self) {
        std::hint::black_box(self.of[..self.n].iter().fold(0, |sum, x| sum ^ **x));
        self.n = 0;
    }
}

impl<S: ByteRanges> PagedView<S> {
    /// Before splits, [`LOT`] at most, are applied; those whose pages are not there are left out. Says where they are.
    pub(super) fn ready_to_apply(&self, lot: &[u32]) -> [Option<AtHand>; LOT] {
        let mut needed = [0; LOT];
        let mut n = 0;
        let at_hand = self.read_around(lot, |d| {
            if n < needed.len() {
                needed[n] = d;
                n += 1;
            }
        });
        // What they depend on comes with them.
        if n > 0 {
            self.read_around(&needed[..n], |_| ());
        }
        at_hand
    }

    /// What applying these takes; `tell` is told what they depend on and is not asked for.
    fn read_around(&self, lot: &[u32], mut tell: impl FnMut(u32)) -> [Option<AtHand>; LOT] {
        let (shelf, canvas) = (&self.shelf, &self.drawing.canvas);
        // Faces are read when strokes are drawn.
        let by_strokes = self.draws_by_strokes();
        let mut reads = Reads::new();
        let mut of = [None; LOT];
        for (of, &i) in of.iter_mut().zip(lot) {
            if let Some((p, k)) = shelf.page(i) {
                *of = Some((p, k));
                reads.ask(&p.of[k].vertex);
                reads.ask(&p.hot[k]);
            }
        }
        reads.wait();
        // The splits that they depend on, of which two make the faces of their cuts, and the vertex's: mostly another than its node's.
        for (p, k) in of.iter().flatten().filter(|(p, k)| p.hot[*k] == NONE) {
            let r = &p.of[*k];
            let maker = r.vertex.checked_sub(shelf.head.base_vertices).unwrap_or(NONE);
            for d in shelf.needs_of(r).into_iter().chain([maker]).chain(p.further.of(*k).iter().copied()) {
                if let Some(h) = p.hot.get(d.wrapping_sub(p.first) as usize) {
                    reads.ask(h);
                } else if let Some((p, k)) = shelf.page(d) {
                    reads.ask(&p.hot[k]);
                }
            }
        }
        reads.wait();
        let mut at_hand = [None; LOT];
        let mut slots = [[NONE; 2]; LOT];
        for (((of, at_hand), slots), &i) in of.iter().zip(&mut at_hand).zip(&mut slots).zip(lot) {
            let Some((p, k)) = of else { continue };
            let Some(at) = shelf.at_hand(i) else { continue };
            let r = &p.of[*k];
            for &h in at.needs.iter().chain([&at.maker]) {
                shelf.pool.of.get(h as usize).iter().for_each(|r| reads.ask(&r.split));
            }
            if !at.whole {
                let needs = shelf.needs_of(r).into_iter().chain(p.further.of(*k).iter().copied());
                needs.filter(|&d| d != NONE && shelf.hot(d) == NONE).for_each(&mut tell);
            }
            let place = shelf.open_place_of(at.needs[0], r.parent);
            self.open.split_at(place).into_iter().for_each(|s| reads.ask(s));
            *at_hand = Some(at);
            if by_strokes {
                continue;
            }
            for ((slot, &h), cut) in slots.iter_mut().zip(&at.needs[1..]).zip([r.left, r.right]) {
                let (maker, side) = shelf.half_of_cut(cut);
                *slot = match (maker, h) {
                    (NONE, _) => cut >> 2,
                    (_, NONE) => NONE,
                    _ => shelf.first_slot(h) + side as u32,
                };
            }
            canvas.ask_for_faces(slots.iter().copied(), &mut reads);
        }
        reads.wait();
        if by_strokes {
            return at_hand;
        }
        for slots in &slots[..lot.len().min(LOT)] {
            slots.iter().for_each(|&s| canvas.ask_for_faces(canvas.across(s), &mut reads));
        }
        reads.wait();
        at_hand
    }

    /// Before splits, [`LOT`] records at most, are undone.
    pub(super) fn ready_to_undo(&self, lot: &[u32]) {
        let (shelf, canvas) = (&self.shelf, &self.drawing.canvas);
        let by_strokes = self.draws_by_strokes();
        let mut reads = Reads::new();
        for &h in lot {
            shelf.pool.of.get(h as usize).iter().for_each(|r| reads.ask(&r.split));
            if !by_strokes {
                let first = shelf.first_slot(h);
                canvas.ask_for_faces([first, first + 1].into_iter(), &mut reads);
            }
        }
        reads.wait();
        for &h in lot {
            let Some(r) = shelf.pool.get(h) else { continue };
            for &d in r.needs.iter().chain([&r.maker]) {
                shelf.pool.of.get(d as usize).iter().for_each(|r| reads.ask(&r.split));
            }
            if !by_strokes {
                let first = shelf.first_slot(h);
                canvas.ask_for_faces(canvas.across(first).chain(canvas.across(first + 1)), &mut reads);
            }
        }
        reads.wait();
    }
}
