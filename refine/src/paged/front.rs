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
            let right = if s.code.two_faces() { (first + 1) << 2 } else { NONE };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::{BuildOptions, Mesh, MeshInput};
    use crate::format::{EncodeOptions, RangeReader, encode};
    use crate::hierarchy::{self, Bounds};
    use crate::paged::PagedLimits;
    use crate::progressive::build;
    use crate::selective::{Cull, Lens};
    use crate::simplify::{Options, Quiet};
    use crate::view::{Camera, CameraParameters, Projection};
    use glam::{DMat4, DVec3};
    use std::sync::Arc;

    /// Hills, with pages.
    fn file(n: u32) -> Vec<u8> {
        let at = |x: u32, y: u32| y * (n + 1) + x;
        let height = |x: u32, y: u32| ((x as f32 * 0.7).sin() + (y as f32 * 0.9).cos()) * 2.0;
        let places = (0..=n).flat_map(|y| (0..=n).map(move |x| [x as f32, y as f32, height(x, y)]));
        let cells = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
        let faces = cells.flat_map(|(x, y)| {
            let (a, b, c, d) = (at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1));
            [[a, b, c], [a, c, d]]
        });
        let input =
            MeshInput::triangles(places.collect::<Vec<[f32; 3]>>(), &faces.collect::<Vec<[u32; 3]>>());
        let mesh = Mesh::build(input, &BuildOptions::default()).unwrap().0;
        let mut pm = build(mesh, &Options::default(), &Quiet).unwrap().mesh;
        pm.bounds = Some(Arc::new(Bounds::measure(&pm, &hierarchy::Options::RINGS).unwrap()));
        let o = EncodeOptions::default().with_any_order(true).with_pages(true).with_chunk(Some(300));
        encode(&[pm], &[], &[], &o).unwrap()
    }

    fn lens(view: &PagedView<&[u8]>, tau: f64) -> [Lens; 1] {
        let (centre, diagonal) = view.extent();
        let camera = Camera::new(&CameraParameters {
            eye: centre + DVec3::new(0.6, 0.2, 0.5) * diagonal,
            target: centre,
            up: DVec3::Z,
            projection: Projection::Perspective { fov_y_deg: 50.0 },
            width: 800,
            height: 600,
            near: 1e-3 * diagonal,
            far: 4.0 * diagonal,
        });
        [view.lens(&camera.unwrap(), &DMat4::IDENTITY, tau, Cull::None).unwrap()]
    }

    /// Faces, each from its least corner, ascending.
    fn faces(view: &PagedView<&[u8]>) -> Vec<[u32; 3]> {
        let slots = (0..view.indices().len()).filter(|&s| view.face_in(s).is_some());
        let turned = |f: [u32; 3]| [f, [f[1], f[2], f[0]], [f[2], f[0], f[1]]].into_iter().min().unwrap();
        let mut all: Vec<_> = slots.map(|s| turned(view.indices()[s])).collect();
        all.sort_unstable();
        all
    }

    fn assert_sound(view: &PagedView<&[u8]>) {
        assert_eq!((faces(view).len(), view.vertices().count()), (view.face_count(), view.vertex_count()));
        assert_eq!((view.led, view.led_faces), (view.applied, view.faces));
        let applied: Vec<u32> = view.applied_splits().collect();
        assert_eq!(applied.len(), view.applied());
        let mut dependents = vec![0u16; view.shelf.pool.of.len()];
        for i in applied {
            let mut needs = Vec::new();
            view.shelf.needs_into(i, &mut needs).unwrap();
            let own = view.shelf.needs(i).unwrap();
            for &h in needs.iter().filter(|&&h| h != NONE) {
                assert_eq!(view.shelf.pool.get(h).unwrap().flags & (APPLIED | LED), APPLIED | LED);
                dependents[h as usize] += 1;
            }
            // All that it names is there.
            let named = own.iter().chain(view.shelf.further(i)).filter(|&&d| d != NONE).count();
            assert_eq!(needs.iter().filter(|&&h| h != NONE).count(), named);
        }
        for (h, r) in view.shelf.pool.of.iter().enumerate().filter(|(_, r)| r.flags != 0) {
            assert_eq!((r.dependents, view.last.has(h as u32)), (dependents[h], dependents[h] == 0));
        }
        for slot in 0..view.indices().len() {
            for (edge, other) in view.neighbours(slot).into_iter().enumerate() {
                let back = other.map(|o| view.neighbours(o).contains(&Some(slot)));
                assert!(back.unwrap_or(true), "slot {slot} edge {edge}");
            }
        }
    }

    /// A cut that is none of the split's vertex is found out when the split is drawn, maybe by another thread: that split and all that were asked for after it are taken back. When the cut is right again so is the mesh.
    #[test]
    fn what_cannot_be_drawn_is_taken_back() {
        let bytes = file(60);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let reader = Arc::new(RangeReader::new(&bytes[..]).unwrap());
                let mut view = PagedView::new(reader, 0, 1 << 28).unwrap();
                let (fine, coarse) = (lens(&view, 0.5), lens(&view, f64::INFINITY));
                let go = |view: &mut PagedView<&[u8]>, to: &[Lens]| view.adapt(to, &PagedLimits::default());
                go(&mut view, &fine).unwrap();
                assert_sound(&view);
                let (shown, applied) = (faces(&view), view.applied_splits().collect::<Vec<_>>());
                assert!(applied.len() > 1000);
                let (mut some, mut none) = (0, 0);
                for &i in applied.iter().step_by(97) {
                    go(&mut view, &coarse).unwrap();
                    assert_eq!(view.applied(), 0);
                    let turn = |view: &mut PagedView<&[u8]>, by: u32| {
                        let (p, k) = view.shelf.page_mut(i).unwrap();
                        let left = &mut p.of[k].left;
                        *left = (*left & !3) | (((*left & 3) + by) % 3);
                    };
                    turn(&mut view, 1);
                    let result = go(&mut view, &fine);
                    assert!(matches!(result, Err(PagedError::Damage(_))), "split {i}: {result:?}");
                    assert_sound(&view);
                    assert!(!view.is_applied(i));
                    some += usize::from(view.applied() > 64);
                    none += usize::from(view.applied() < 64);
                    turn(&mut view, 2);
                    go(&mut view, &fine).unwrap();
                    assert_sound(&view);
                    assert!(faces(&view) == shown, "split {i}");
                }
                assert!(some > 0 && none > 0, "{some} {none}");
            });
        }
    }
}
