//! A split and its undoing on the faces shown, with what stands in pages.

use super::page::{APPLIED, LED, Record, RowRef};
use super::shelf::Shelf;
use super::{PagedError, PagedView};
use crate::aif::NONE;
use crate::format::ByteRanges;
use crate::progressive::{Damage, Explicit, Fans, Half, SplitKind};
use crate::selective::{Known, Sheet, split, unsplit};

impl<S: ByteRanges> PagedView<S> {
    /// What is to be known of split `i`, and its entry of the explicit stream.
    fn known(&self, i: u32) -> Result<(Known, Explicit), Damage> {
        let Some((p, k)) = self.shelf.page(i) else { return Err(Damage::Fan(i as usize)) };
        let new_vertex = self.shelf.head.base_vertices + i;
        let rows = p.split_rows.get(k);
        let known = Known {
            split: i,
            vertex: p.of[k].vertex,
            new_vertex,
            code: p.of[k].code,
            wedge: rows.map_or(new_vertex, |r| r.wedge),
            row: rows.map_or(0, |r| r.row),
        };
        let explicit = match known.code.kind() {
            SplitKind::Explicit => {
                let at = rows.map_or(0, |r| r.explicit as usize);
                Explicit::read(&p.explicit, at, known.code.two_faces(), known.wedge)
                    .ok_or(Damage::Wedges(i as usize))?
            }
            _ => Explicit::default(),
        };
        Ok((known, explicit))
    }

    /// The slot of a face that a cut of a record names, as `slot * 4 + edge`.
    fn cut(&self, i: u32, cut: u32) -> Result<u32, Damage> {
        match self.shelf.slot_of_cut(cut) {
            NONE => Err(Damage::Reference { what: "split", at: i as usize, to: cut }),
            slot => Ok(slot << 2 | cut & 3),
        }
    }

    /// Applies split `i`, whose page is there and whose dependencies are applied. O(valence).
    ///
    /// Errors: damage; nothing has changed then.
    pub(super) fn split_faces(&mut self, i: u32) -> Result<(), PagedError> {
        let at = i as usize;
        let (s, explicit) = self.known(i)?;
        let Some(r) = self.shelf.record(i) else { return Err(Damage::Fan(at).into()) };
        let (left, right, parent) = (r.left, r.right, r.parent);
        // The vertex is at the node that the split replaces.
        if self.shelf.node(s.vertex) != parent {
            return Err(Damage::Fan(at).into());
        }
        let mut needs = [NONE; 3];
        if self.motions.is_some() {
            needs = self.can_count(i, |r| r.holders)?;
        }
        let right = if s.code.two_faces() { self.cut(i, right)? } else { NONE };
        let cuts = (self.cut(i, left)?, right);
        split(self, &s, cuts, &explicit)?;
        let old = self.shelf.head.base_vertices + 2 * i;
        self.shelf.set_node(s.vertex, old);
        self.shelf.set_node(s.new_vertex, old + 1);
        self.vertices += 1;
        self.applied += 1;
        if let Some((p, k)) = self.shelf.page_mut(i) {
            p.set(k, APPLIED, true);
        }
        if self.motions.is_some() {
            self.pending -= usize::from(self.shelf.is_led(i));
            self.count(i, needs, |r| &mut r.holders, 1);
        }
        Ok(())
    }

    /// What split `i` depends on can have one more that depends on it. Honest meshes have few: what a hostile file says of more is damage.
    pub(super) fn can_count(&self, i: u32, of: impl Fn(&Record) -> u16) -> Result<[u32; 3], Damage> {
        let needs = self.shelf.needs(i).ok_or(Damage::Fan(i as usize))?;
        let further = self.shelf.further(i);
        // It may be listed so often.
        let times = needs.len() + further.len();
        let full = |d: u32| self.shelf.record(d).is_none_or(|r| of(r) as usize + times > u16::MAX.into());
        match needs.iter().any(|&d| d != NONE && full(d)) || further.iter().any(|&d| full(d)) {
            true => Err(Damage::Fan(i as usize)),
            false => Ok(needs),
        }
    }

    /// Adds `by` to what is counted of what split `i` depends on: `needs` of its vertex and cuts.
    fn count(&mut self, i: u32, needs: [u32; 3], of: impl Fn(&mut Record) -> &mut u16, by: i16) {
        let add = |shelf: &mut Shelf<S>, d: u32| {
            if let Some(r) = shelf.record_mut(d) {
                let n = of(r);
                *n = n.wrapping_add_signed(by);
            }
        };
        needs.into_iter().filter(|&d| d != NONE).for_each(|d| add(&mut self.shelf, d));
        for k in 0..self.shelf.further(i).len() {
            let d = self.shelf.further(i)[k];
            add(&mut self.shelf, d);
        }
    }

    /// Split `i`, which depends on `needs` by its vertex and cuts, is asked for now, or no longer. What it depends on can have one more that does.
    pub(super) fn lead(&mut self, i: u32, needs: [u32; 3], on: bool) {
        let (clock, timed) = (self.shelf.clock, self.motions.is_some());
        let mut drawn = true;
        let mut faces = 0;
        if let Some((p, k)) = self.shelf.page_mut(i) {
            p.set(k, LED, on);
            p.turned |= timed;
            drawn = p.of[k].flags & APPLIED != 0;
            faces = 1 + p.of[k].code.two_faces() as usize;
            if !on {
                p.stamp = clock;
            }
        }
        self.count(i, needs, |r| &mut r.dependents, if on { 1 } else { -1 });
        let pending = usize::from(timed && !drawn);
        if on {
            self.led += 1;
            self.led_faces += faces;
            self.pending += pending;
        } else {
            self.led -= 1;
            self.led_faces -= faces;
            self.pending -= pending;
        }
        self.ahead += usize::from(timed && !self.at_once);
    }

    /// Undoes split `i`, which is applied and on which nothing applied depends. O(valence).
    pub(super) fn unsplit_faces(&mut self, i: u32) -> Result<(), PagedError> {
        let (s, explicit) = self.known(i)?;
        let r = self.shelf.record(i).ok_or(Damage::Fan(i as usize))?;
        let (parent, [fl, fr]) = (r.parent, r.slots);
        let fr = if s.code.two_faces() { fr } else { fl };
        if fl == NONE || fr == NONE {
            return Err(Damage::Fan(i as usize).into());
        }
        unsplit(self, &s, [fl, fr], &explicit);
        let clock = self.shelf.clock;
        self.shelf.set_node(s.vertex, parent);
        self.shelf.set_node(s.new_vertex, NONE);
        self.vertices -= 1;
        self.applied -= 1;
        if let Some((p, k)) = self.shelf.page_mut(i) {
            p.set(k, APPLIED, false);
            p.stamp = clock;
        }
        if self.motions.is_some() {
            let needs = self.shelf.needs(i).unwrap_or([NONE; 3]);
            self.count(i, needs, |r| &mut r.holders, -1);
        }
        Ok(())
    }

    /// A slot for face `f`. There is room for it.
    fn take_slot(&mut self, f: u32) -> u32 {
        let slot = self.free.pop().unwrap_or_else(|| {
            self.fans.corners.push([NONE; 3]);
            self.fans.links.push([NONE; 3]);
            self.face_in.push(NONE);
            self.touched.resize(self.fans.corners.len().div_ceil(64), 0);
            (self.fans.corners.len() - 1) as u32
        });
        self.face_in[slot as usize] = f;
        self.faces += 1;
        slot
    }

    fn leave_slot(&mut self, slot: u32) {
        self.face_in[slot as usize] = NONE;
        self.free.push(slot);
        self.faces -= 1;
    }
}

impl<S: ByteRanges> Sheet for PagedView<S> {
    fn fans(&self) -> &Fans {
        &self.fans
    }

    fn fans_mut(&mut self) -> &mut Fans {
        &mut self.fans
    }

    fn has_rows(&self) -> bool {
        self.shelf.head.channels.is_some()
    }

    fn wedge_vertex(&self, w: u32) -> u32 {
        self.shelf.wedge_vertex(w)
    }

    fn set_wedge_vertex(&mut self, w: u32, vertex: u32) {
        self.shelf.set_wedge_vertex(w, vertex);
    }

    fn give_row(&mut self, of: &Known, w: u32, row: u32) {
        let page = self.shelf.page_number(of.split);
        self.shelf.set_wedge_row(w, RowRef { page, row });
    }

    fn change_row(&mut self, of: &Known, w: u32, row: u32) {
        let before = self.shelf.wedge_row(w);
        if let Some((p, _)) = self.shelf.page_mut(of.split)
            && let Some(at) = p.row_before.get_mut(row as usize)
        {
            *at = before;
        }
        self.give_row(of, w, row);
    }

    fn restore_row(&mut self, of: &Known, w: u32, row: u32) {
        let before = self.shelf.page(of.split).and_then(|(p, _)| p.row_before.get(row as usize).copied());
        self.shelf.set_wedge_row(w, before.unwrap_or(RowRef::NOTHING));
    }

    fn drop_row(&mut self, w: u32) {
        self.shelf.set_wedge_row(w, RowRef::NOTHING);
    }

    fn take_slots(&mut self, of: &Known) -> [u32; 2] {
        let face = self.shelf.head.first_face(of.split);
        let left = self.take_slot(face);
        let right = if of.code.two_faces() { self.take_slot(face + 1) } else { NONE };
        if let Some(r) = self.shelf.record_mut(of.split) {
            r.slots = [left, right];
        }
        [left, if right == NONE { left } else { right }]
    }

    fn leave_slots(&mut self, of: &Known, [left, right]: [u32; 2]) {
        self.leave_slot(left);
        if of.code.two_faces() {
            self.leave_slot(right);
        }
        if let Some(r) = self.shelf.record_mut(of.split) {
            r.slots = [NONE; 2];
        }
    }

    fn touch(&mut self, slot: u32) {
        self.touched[slot as usize / 64] |= 1 << (slot % 64);
    }

    fn touch_wedge(&mut self, _: u32) {
        self.touched_wedges += 1;
    }

    fn touch_vertex(&mut self, _: u32, _: Half) {
        self.touched_wedges += 1;
    }
}
