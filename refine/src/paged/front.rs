//! A split and its undoing on the faces shown, with what stands in pages.

use super::canvas::Stroke;
use super::page::RowRef;
use super::pool::{APPLIED, Hot, LED};
use super::{PagedError, PagedView};
use crate::aif::NONE;
use crate::format::ByteRanges;
use crate::progressive::{Damage, Explicit, Fans, Half, SplitKind};
use crate::selective::{Known, Sheet, split, unsplit};

impl<S: ByteRanges> PagedView<S> {
    /// What is to be known of the split of a record, and its entry of the explicit stream.
    fn known(&self, r: &Hot) -> Result<(Known, Explicit), Damage> {
        let (i, new_vertex) = (r.split, self.shelf.head.base_vertices + r.split);
        let mut known =
            Known { split: i, vertex: r.vertex, new_vertex, code: r.code, wedge: new_vertex, row: 0 };
        if self.shelf.head.channels.is_none() && r.code.kind() != SplitKind::Explicit {
            return Ok((known, Explicit::default()));
        }
        let Some((p, k)) = self.shelf.page(i) else { return Err(Damage::Fan(i as usize)) };
        let rows = p.split_rows.get(k);
        if let Some(r) = rows {
            (known.wedge, known.row) = (r.wedge, r.row);
        }
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

    /// The slot of a face that a cut names, as `slot * 4 + edge`, the record of the split that makes it being known ([`NONE`] of the base).
    fn cut(&self, i: u32, cut: u32, maker: u32) -> Result<u32, Damage> {
        let lost = Err(Damage::Reference { what: "split", at: i as usize, to: cut });
        let (split, side) = self.shelf.half_of_cut(cut);
        let slot = match self.shelf.pool.get(maker) {
            None if split == NONE && cut >> 2 < self.shelf.head.base_faces => cut >> 2,
            Some(r) if r.split == split && r.flags & APPLIED != 0 && (side == 0 || r.code.two_faces()) => {
                self.shelf.first_slot(maker) + side as u32
            }
            _ => return lost,
        };
        Ok(slot << 2 | cut & 3)
    }

    /// Splits are drawn by strokes: nothing but faces takes part.
    #[inline]
    pub(super) fn draws_by_strokes(&self) -> bool {
        self.motions.is_none() && self.shelf.head.channels.is_none()
    }

    /// Applies the split of a record, whose dependencies are applied. O(valence).
    ///
    /// Errors: damage; nothing has changed then. Of one that is drawn by a stroke it may come later: see [`PagedView::finish_drawing`].
    pub(super) fn split_faces(&mut self, h: u32) -> Result<(), PagedError> {
        let hot = *self.shelf.pool.get(h).ok_or(Damage::Fan(h as usize))?;
        let (i, at) = (hot.split, hot.split as usize);
        let (s, explicit) = self.known(&hot)?;
        let Some(r) = self.shelf.record(i) else { return Err(Damage::Fan(at).into()) };
        let (left, right) = (r.left, r.right);
        // The vertex is at the node that the split replaces.
        if self.shelf.node_of(s.vertex, hot.maker) != hot.parent {
            return Err(Damage::Fan(at).into());
        }
        let right = if s.code.two_faces() { self.cut(i, right, hot.needs[2])? } else { NONE };
        let cuts = (self.cut(i, left, hot.needs[1])?, right);
        let first = self.shelf.first_slot(h);
        if self.draws_by_strokes() && s.code.kind() != SplitKind::Explicit {
            self.drawing.put(h, stroke(&s, first, [cuts.0, cuts.1], true));
        } else {
            self.finish_drawing()?;
            self.drawing.canvas.extend_to(first as usize + 2);
            self.drawing.canvas.slots = first;
            if self.motions.is_some() {
                let mut needs = std::mem::take(&mut self.needed);
                self.shelf.needs_of_hot(h, &mut needs)?;
                self.can_count(i, &needs, APPLIED, |r| r.holders)?;
                split(self, &s, cuts, &explicit)?;
                for &d in &needs {
                    self.shelf.pool.get_mut(d).into_iter().for_each(|d| d.holders += 1);
                }
                self.needed = needs;
                self.pending -= usize::from(hot.flags & LED != 0);
            } else {
                split(self, &s, cuts, &explicit)?;
            }
        }
        let old = self.shelf.head.base_vertices + 2 * i;
        self.shelf.set_node_of(s.vertex, hot.maker, old);
        if let Some(r) = self.shelf.pool.get_mut(h) {
            r.node = old + 1;
            r.flags |= APPLIED;
        }
        if let Some((p, k)) = self.shelf.page_mut(i) {
            p.set_there(k, true);
        }
        self.vertices += 1;
        self.faces += 1 + s.code.two_faces() as usize;
        self.applied += 1;
        Ok(())
    }

    /// From time to time finishes drawing, so that what is remembered of it does not grow.
    #[inline]
    pub(super) fn see_drawing(&mut self) -> Result<(), PagedError> {
        if self.drawing.is_full() { self.finish_drawing() } else { Ok(()) }
    }

    /// Draws what is not drawn yet. What turns out to contradict the faces, and all that was asked for after it, is taken back.
    ///
    /// Errors: damage. The mesh is sound then, and closed: that of the splits before.
    pub(super) fn finish_drawing(&mut self) -> Result<(), PagedError> {
        if self.drawing.is_done() {
            return Ok(());
        }
        let Err((damage, lost)) = self.drawing.finish() else { return Ok(()) };
        for h in lost {
            self.take_back(h)?;
        }
        Err(damage.into())
    }

    /// What split `i` depends on, by these records, has these flags and can have one more that depends on it. Honest meshes have few: what a hostile file says of more is damage.
    pub(super) fn can_count(
        &self,
        i: u32,
        needs: &[u32],
        flags: u8,
        of: impl Fn(&Hot) -> u16,
    ) -> Result<(), Damage> {
        // It may be listed so often.
        let times = needs.len();
        let can = |r: &Hot| r.flags & flags != 0 && of(r) as usize + times <= u16::MAX.into();
        match needs.iter().all(|&d| d == NONE || self.shelf.pool.get(d).is_some_and(can)) {
            true => Ok(()),
            false => Err(Damage::Fan(i as usize)),
        }
    }

    /// The split of a record, which depends on `needs`, is asked for now, or no longer. What it depends on can have one more that does; what could be undone when it no longer is, is told.
    pub(super) fn lead(&mut self, h: u32, needs: &[u32], on: bool, mut freed: impl FnMut(u32)) {
        let timed = self.motions.is_some();
        let (mut drawn, mut faces) = (true, 0);
        let mut split = NONE;
        if let Some(r) = self.shelf.pool.get_mut(h) {
            r.flags = if on { r.flags | LED } else { r.flags & !LED };
            drawn = r.flags & APPLIED != 0;
            faces = 1 + r.code.two_faces() as usize;
            split = r.split;
        }
        if timed && let Some((p, _)) = self.shelf.page_mut(split) {
            p.turned = true;
        }
        for &d in needs.iter().filter(|&&d| d != NONE) {
            let Some(r) = self.shelf.pool.get_mut(d) else { continue };
            if on {
                if r.dependents == 0 {
                    self.last.take_out(d);
                }
                r.dependents += 1;
            } else {
                r.dependents -= 1;
                if r.dependents == 0 && r.flags & LED != 0 {
                    self.last.hold(d);
                    freed(d);
                }
            }
        }
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

    /// Undoes the split of a record, which is applied and on which nothing applied depends. O(valence).
    pub(super) fn unsplit_faces(&mut self, h: u32) -> Result<(), PagedError> {
        let hot = *self.shelf.pool.get(h).ok_or(Damage::Fan(h as usize))?;
        let (s, explicit) = self.known(&hot)?;
        let first = self.shelf.first_slot(h);
        if hot.flags & APPLIED == 0 {
            return Err(Damage::Fan(hot.split as usize).into());
        }
        if self.draws_by_strokes() && s.code.kind() != SplitKind::Explicit {
            let right = if s.code.two_faces() { first + 1 << 2 } else { NONE };
            self.drawing.put(h, stroke(&s, first, [first << 2, right], false));
        } else {
            self.finish_drawing()?;
            if self.motions.is_some() {
                let mut needs = std::mem::take(&mut self.needed);
                self.shelf.needs_of_hot(h, &mut needs)?;
                for &d in &needs {
                    self.shelf.pool.get_mut(d).into_iter().for_each(|d| d.holders -= 1);
                }
                self.needed = needs;
            }
            unsplit(self, &s, [first, first + s.code.two_faces() as u32], &explicit);
        }
        self.leave(h, &hot);
        Ok(())
    }

    /// Of a split that is not drawn any more: its vertex is at the node before, its new one is not there.
    pub(super) fn leave(&mut self, h: u32, hot: &Hot) {
        self.shelf.set_node_of(hot.vertex, hot.maker, hot.parent);
        if let Some(r) = self.shelf.pool.get_mut(h) {
            r.node = NONE;
            r.flags &= !APPLIED;
        }
        let clock = self.shelf.clock;
        if let Some((p, k)) = self.shelf.page_mut(hot.split) {
            p.set_there(k, false);
            p.stamp = clock;
        }
        self.vertices -= 1;
        self.faces -= 1 + hot.code.two_faces() as usize;
        self.applied -= 1;
    }

}

/// The stroke of a split with its first slot.
fn stroke(of: &Known, first: u32, cuts: [u32; 2], on: bool) -> Stroke {
    let &Known { split, vertex, new_vertex, code, .. } = of;
    Stroke { split, vertex, new_vertex, first, cuts, code, on }
}

impl<S: ByteRanges> Sheet for PagedView<S> {
    fn fans(&self) -> &Fans {
        &self.drawing.canvas.fans
    }

    fn fans_mut(&mut self) -> &mut Fans {
        &mut self.drawing.canvas.fans
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
        self.drawing.canvas.take_slots(of)
    }

    fn leave_slots(&mut self, _: &Known, _: [u32; 2]) {}

    fn touch(&mut self, slot: u32) {
        self.drawing.canvas.touch_slot(slot);
    }

    fn touch_wedge(&mut self, _: u32) {
        self.drawing.canvas.touched_wedges += 1;
    }

    fn touch_vertex(&mut self, _: u32, _: Half) {
        self.drawing.canvas.touched_wedges += 1;
    }
}
