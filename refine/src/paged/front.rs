//! A split and its undoing on the faces shown: [`crate::selective`] does the same on arrays of the whole mesh.

use super::page::{APPLIED, RowRef};
use super::{PagedError, PagedView};
use crate::aif::NONE;
use crate::format::ByteRanges;
use crate::progressive::{Damage, Explicit, Half, Opening, SplitCode, SplitKind, seam_wedges};

/// What is to be known of a split to do it or undo it.
#[derive(Clone, Copy, Debug)]
struct Known {
    vertex: u32,
    new_vertex: u32,
    left: u32,
    right: u32,
    code: SplitCode,
    parent: u32,
    face: u32,
    wedge: u32,
    row: u32,
    explicit: usize,
}

impl<S: ByteRanges> PagedView<S> {
    fn known(&self, i: u32) -> Result<Known, Damage> {
        let Some((p, k)) = self.shelf.page(i) else { return Err(Damage::Fan(i as usize)) };
        let new_vertex = self.shelf.head.base_vertices + i;
        let rows = p.split_rows.get(k);
        Ok(Known {
            vertex: p.vertex[k],
            new_vertex,
            left: p.left[k],
            right: p.right[k],
            code: p.code[k],
            parent: p.links.parent[k],
            face: self.shelf.head.first_face(i),
            wedge: rows.map_or(new_vertex, |r| r.wedge),
            row: rows.map_or(0, |r| r.row),
            explicit: rows.map_or(0, |r| r.explicit as usize),
        })
    }

    fn explicit(&self, i: u32, s: &Known) -> Result<Explicit, Damage> {
        let Some((p, _)) = self.shelf.page(i) else { return Err(Damage::Fan(i as usize)) };
        Explicit::read(&p.explicit, s.explicit, s.code.two_faces(), s.wedge).ok_or(Damage::Wedges(i as usize))
    }

    /// Applies split `i`, whose page is there and whose dependencies are applied. O(valence).
    ///
    /// Errors: damage; nothing has changed then.
    pub(super) fn split_faces(&mut self, i: u32) -> Result<(), PagedError> {
        let s = self.known(i)?;
        let (code, two, at) = (s.code, s.code.two_faces(), i as usize);
        let here = |cut: u32| match self.shelf.slot_of(cut >> 2) {
            NONE => Err(Damage::Reference { what: "split", at, to: cut }),
            slot => Ok(slot << 2 | cut & 3),
        };
        let right = if two { here(s.right)? } else { NONE };
        let gap = self.fans.find_gap(at, (here(s.left)?, right), code)?;
        let Some(seen_from) = gap.left.inner.or(gap.left.outer) else { return Err(Damage::Fan(at).into()) };
        let first = self.fans.wedge(seen_from);
        // The vertex is at the node that the split replaces.
        if self.shelf.wedge_vertex(first) != s.vertex || self.shelf.node(s.vertex) != s.parent {
            return Err(Damage::Fan(at).into());
        }
        let needs = self.shelf.needs(i).ok_or(Damage::Fan(at))?;
        let full = |d: u32| self.shelf.page(d).is_none_or(|(p, k)| p.dependents[k] > u8::MAX - 3);
        if needs.into_iter().any(|d| d != NONE && full(d)) {
            return Err(Damage::Fan(at).into());
        }
        let w = s.wedge;
        let tips = [
            self.fans.tip(gap.left, code.left_tip_inner()),
            self.fans.tip(gap.right, code.right_tip_inner()),
        ];
        let mut explicit = Explicit::default();
        let (x, new, changed, mut corners): ([u32; 2], u32, &[u32], [[u32; 3]; 2]) = match code.kind() {
            SplitKind::Plain => ([first; 2], 1, &[first], [[first, w, NONE]; 2]),
            SplitKind::Seam => {
                let last = gap.right.inner.map_or(first, |h| self.fans.wedge(h));
                let outer = |o: Opening| o.outer.map(|h| self.fans.wedge(h));
                let (l, r) = seam_wedges(first, last, outer(gap.left), outer(gap.right));
                ([l, r], 2, &[l, r], [[l, w, NONE], [r, w + 1, NONE]])
            }
            SplitKind::Explicit => {
                explicit = self.explicit(i, &s)?;
                let of = |k: usize| explicit.corners.get(k).copied().unwrap_or_default();
                ([first; 2], explicit.new as u32, &explicit.changed, [of(0), of(1)])
            }
        };
        let changed = if code.changes_rows() { changed } else { &[] };
        if self.shelf.head.channels.is_some() {
            let page = self.shelf.page_number(i);
            for j in 0..new {
                self.shelf.set_wedge_vertex(w + j, s.new_vertex);
                self.shelf.set_wedge_row(w + j, RowRef { page, row: s.row + j });
            }
            for (row, &c) in (s.row + new..).zip(changed) {
                let before = self.shelf.wedge_row(c);
                if let Some((p, _)) = self.shelf.page_mut(i)
                    && let Some(at) = p.row_before.get_mut(row as usize)
                {
                    *at = before;
                }
                self.shelf.set_wedge_row(c, RowRef { page, row });
            }
            if code.kind() == SplitKind::Explicit {
                for p in explicit.pairs.iter().filter(|p| p.0 == p.1) {
                    self.shelf.set_wedge_vertex(p.1, s.new_vertex);
                }
                for (c, tip) in explicit.corners.iter().zip(tips) {
                    if c[0] >= w {
                        self.shelf.set_wedge_vertex(c[0], s.vertex);
                    }
                    if c[2] >= w && c[2] != NONE && tip != NONE {
                        let of = self.shelf.wedge_vertex(tip);
                        self.shelf.set_wedge_vertex(c[2], of);
                    }
                }
            }
        }
        self.touched_wedges += new as usize + changed.len() + code.moves() as usize;
        match code.kind() {
            SplitKind::Plain => self.hand_over(gap.left.inner, gap.faces, |_| w),
            SplitKind::Seam => {
                self.hand_over(gap.left.inner, gap.faces, |c| if c == x[0] { w } else { w + 1 });
            }
            SplitKind::Explicit => {
                let map = |c: u32| explicit.pairs.iter().find(|p| p.0 == c).map_or(c, |p| p.1);
                self.hand_over(gap.left.inner, gap.faces, map);
            }
        }
        for (c, tip) in corners.iter_mut().zip(tips).filter(|(c, _)| c[2] == NONE) {
            c[2] = tip;
        }
        let fl = self.take_slot(s.face);
        let edge = self.fans.insert_at(fl, code.left(), corners[0], gap.left);
        if two {
            let fr = self.take_slot(s.face + 1);
            let other = self.fans.insert_at(fr, code.right(), corners[1], gap.right);
            self.fans.connect(edge, other);
        }
        let old = self.shelf.head.base_vertices + 2 * i;
        self.shelf.set_node(s.vertex, old);
        self.shelf.set_node(s.new_vertex, old + 1);
        self.vertices += 1;
        self.applied += 1;
        if let Some((p, k)) = self.shelf.page_mut(i) {
            p.flags[k] |= APPLIED;
            p.applied += 1;
        }
        for d in needs.into_iter().filter(|&d| d != NONE) {
            if let Some((p, k)) = self.shelf.page_mut(d) {
                p.dependents[k] += 1;
            }
        }
        Ok(())
    }

    /// Undoes split `i`, which is applied and on which nothing applied depends. O(valence).
    pub(super) fn unsplit_faces(&mut self, i: u32) -> Result<(), PagedError> {
        let s = self.known(i)?;
        let (code, two) = (s.code, s.code.two_faces());
        let fl = self.shelf.slot_of(s.face);
        let fr = if two { self.shelf.slot_of(s.face + 1) } else { fl };
        if fl == NONE || fr == NONE {
            return Err(Damage::Fan(i as usize).into());
        }
        let left = self.fans.opening_of(fl, code.left());
        let right = if two { self.fans.opening_of(fr, code.right()) } else { Opening::default() };
        let (x_l, y_l) = self.fans.ends_of(fl, code.left());
        let x_r = if two { self.fans.ends_of(fr, code.right()).0 } else { x_l };
        let explicit = match code.kind() {
            SplitKind::Explicit => self.explicit(i, &s)?,
            _ => Explicit::default(),
        };
        // The faces of the new vertex lie between the two that go.
        let (mut run, mut entry) = (0, left.inner);
        while let Some(h) = entry.filter(|h| h.face != fl && h.face != fr) {
            run += 1;
            entry = self.fans.across(h.turn());
        }
        let chosen = [x_l, x_r];
        let (new, changed): (u32, &[u32]) = match code.kind() {
            SplitKind::Plain => {
                self.hand_over(left.inner, run, |_| x_l);
                (1, &chosen[..1])
            }
            SplitKind::Seam => {
                self.hand_over(left.inner, run, |c| if c == y_l { x_l } else { x_r });
                (2, &chosen)
            }
            SplitKind::Explicit => {
                let map = |c: u32| explicit.pairs.iter().find(|p| p.1 == c).map_or(c, |p| p.0);
                self.hand_over(left.inner, run, map);
                (explicit.new as u32, &explicit.changed)
            }
        };
        self.fans.close(left);
        self.fans.close(right);
        self.leave_slot(s.face, fl);
        if two {
            self.leave_slot(s.face + 1, fr);
        }
        let changed = if code.changes_rows() { changed } else { &[] };
        if self.shelf.head.channels.is_some() {
            for p in explicit.pairs.iter().filter(|p| p.0 == p.1) {
                self.shelf.set_wedge_vertex(p.1, s.vertex);
            }
            for (row, &c) in (s.row + new..).zip(changed) {
                let before = self.shelf.page(i).and_then(|(p, _)| p.row_before.get(row as usize).copied());
                self.shelf.set_wedge_row(c, before.unwrap_or(RowRef::NOTHING));
            }
            for j in 0..new {
                self.shelf.set_wedge_row(s.wedge + j, RowRef::NOTHING);
            }
        }
        self.touched_wedges += changed.len() + code.moves() as usize;
        let needs = self.shelf.needs(i).unwrap_or([NONE; 3]);
        let clock = self.shelf.clock;
        self.shelf.set_node(s.vertex, s.parent);
        self.shelf.set_node(s.new_vertex, NONE);
        self.vertices -= 1;
        self.applied -= 1;
        if let Some((p, k)) = self.shelf.page_mut(i) {
            p.flags[k] &= !APPLIED;
            p.applied -= 1;
            p.stamp = clock;
        }
        for d in needs.into_iter().filter(|&d| d != NONE) {
            if let Some((p, k)) = self.shelf.page_mut(d) {
                p.dependents[k] -= 1;
            }
        }
        Ok(())
    }

    #[inline]
    fn touch(&mut self, slot: u32) {
        self.touched[slot as usize / 64] |= 1 << (slot % 64);
    }

    #[inline]
    fn hand_over(&mut self, first: Option<Half>, count: usize, map: impl Fn(u32) -> u32) {
        let mut entry = first;
        for _ in 0..count {
            let Some(h) = entry else { return };
            let wedge = &mut self.fans.corners[h.face as usize][h.corner()];
            *wedge = map(*wedge);
            self.touch(h.face);
            entry = self.fans.across(h.turn());
        }
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
        self.shelf.set_slot(f, slot);
        self.faces += 1;
        self.touch(slot);
        slot
    }

    fn leave_slot(&mut self, f: u32, slot: u32) {
        self.fans.corners[slot as usize] = [0; 3];
        self.fans.links[slot as usize] = [NONE; 3];
        self.face_in[slot as usize] = NONE;
        self.shelf.set_slot(f, NONE);
        self.free.push(slot);
        self.faces -= 1;
        self.touch(slot);
    }
}
