//! What a front gives back when a frame is over: memory for as many vertices as are there, and little more.

use super::Front;
use crate::aif::NONE;
use std::ops::Range;

/// What vectors may hold beyond what they need when a frame is over: a part in 32, and so many.
const SPARE: usize = 64;
/// Records that may be free when a frame is over: a part in 64 of all, and so many. With more, those at the end move into them: moving one takes a fraction of a split's time.
const FREE: (usize, usize) = (64, 32);

fn settle<T>(v: &mut Vec<T>) {
    let most = v.len() + v.len() / 32 + SPARE;
    if v.capacity() > most {
        v.shrink_to(most);
    }
}

fn reserve<T>(v: &mut Vec<T>, more: usize) {
    if v.capacity() - v.len() < more {
        v.reserve_exact(more + (v.len() + more) / 32 + SPARE / 2);
    }
}

impl Front {
    /// Gives back what is not needed: so a front takes as much as what is there, whatever was there before.
    pub(super) fn settle(&mut self) {
        let base = self.base_vertices as usize;
        let there = self.vertices - base;
        let free = self.records.len() - base - there;
        if free > there / FREE.0 + FREE.1 {
            self.pack(base + there);
        }
        settle(&mut self.records);
        settle(&mut self.fans.corners);
        settle(&mut self.fans.links);
        self.index.settle();
    }

    /// Makes room for so many vertices more, all at once, and no more than may be left when they are there.
    pub(super) fn reserve(&mut self, vertices: usize) {
        let free =
            self.records.len() - self.base_vertices as usize - (self.vertices - self.base_vertices as usize);
        let more = vertices.saturating_sub(free);
        reserve(&mut self.records, more);
        reserve(&mut self.fans.corners, 2 * more);
        reserve(&mut self.fans.links, 2 * more);
    }

    /// Moves the records from `end` on, as many as there are free ones before it, into these.
    fn pack(&mut self, end: usize) {
        let (before, after) = self.records.split_at(end);
        let first = self.base_vertices as usize;
        let holes = (first..).zip(&before[first..]).filter(|r| r.1.is_free()).map(|r| r.0 as u32);
        let moved = (end..).zip(after).filter(|r| !r.1.is_free()).map(|r| r.0 as u32);
        let pairs: Vec<(u32, u32)> = moved.zip(holes).collect();
        for (from, to) in pairs {
            self.relocate(from, to);
        }
        self.records.truncate(end);
        self.too_fine.truncate(end.div_ceil(64));
        self.free = super::front::LAST;
        let slots = self.first_slot(end as u32) as usize;
        self.fans.corners.truncate(slots);
        self.fans.links.truncate(slots);
        self.touched.truncate(slots.div_ceil(64));
        if let (Some(last), 1..) = (self.touched.last_mut(), slots % 64) {
            *last &= (1 << (slots % 64)) - 1;
        }
    }

    /// Moves a record, and its faces with it, to one that is free.
    fn relocate(&mut self, from: u32, to: u32) {
        let record = self.records[from as usize];
        self.records[to as usize] = record;
        self.set_too_fine(to, self.too_fine[from as usize / 64] >> (from % 64) & 1 != 0);
        self.index.replace(record.made(), to);
        let (old, new) = (self.first_slot(from), self.first_slot(to));
        let own: Range<u32> = old..old + 2;
        for k in 0..2 {
            let (old, new) = (old + k, new + k);
            self.fans.corners[new as usize] = self.fans.corners[old as usize];
            self.fans.links[new as usize] = self.fans.links[old as usize];
            self.touch(new);
        }
        // What leads here leads there now; the two faces may lie at each other.
        for slot in new..new + 2 {
            for edge in 0..3 {
                let link = self.fans.links[slot as usize][edge];
                if link == NONE {
                    continue;
                }
                let across = link >> 3;
                if own.contains(&across) {
                    self.fans.links[slot as usize][edge] = (across - old + new) << 3 | link & 7;
                } else {
                    let back = &mut self.fans.links[across as usize][(link & 3) as usize];
                    *back = slot << 3 | *back & 7;
                }
            }
        }
    }
}
