//! What splits depend on, and the same progressive mesh with its splits in another order.
//!
//! A split needs its vertex as it is then, and both faces on each of its cuts. Of two adjacent faces the later was made beside the earlier, so
//! the later of each pair stands for both: three splits at most. Every order in which no split comes before one it depends on leads to
//! the same mesh (the l/r rule; `tests/progressive.rs` holds it to random orders).
//!
//! That is the rule of faces and vertices. Where splits list wedges of other vertices than their own (`WedgeStreams::explicit`: a tip whose wedge is
//! named outright) they depend on more: on what made those wedges, and on every split of that vertex, which may hand them on. Splits recorded here hardly ever
//! do; those of Hoppe's files make wedges at their tips where material or crease changes (94 of 5,074 in one, 53 of 11,672 in another), so these
//! come in the order of the file: orders by the l/r rule alone end in [`super::Damage`]. (Counted as splits of their tips' vertices too, all random
//! orders of these files led to the same mesh.)

use super::{Places, ProgressiveMesh, SplitKind, WedgeStreams};
use crate::aif::NONE;
use std::sync::Arc;

/// The order asked for is none of all splits, or puts a split before one it depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("split {0} cannot come where the order puts it")]
pub struct NotInOrder(pub u32);

impl ProgressiveMesh {
    /// For every split those it depends on directly, [`NONE`] for the base: the last before at its vertex (or that made it), the makers of
    /// its left and right cuts' faces. O(n).
    pub fn dependencies(&self) -> Vec<[u32; 3]> {
        let s = &self.splits;
        let mut maker = vec![NONE; self.base_faces.len()];
        let mut last = vec![NONE; self.base_vertices()];
        let mut all = Vec::with_capacity(s.len());
        for (i, ((&v, &code), (&l, &r))) in
            (0u32..).zip(s.vertex.iter().zip(&s.code).zip(s.left.iter().zip(&s.right)))
        {
            let of = |cut: u32| maker.get((cut >> 2) as usize).copied().unwrap_or(NONE);
            let right = if r == NONE { NONE } else { of(r) };
            let before = last.get_mut(v as usize).map_or(NONE, |l| std::mem::replace(l, i));
            all.push([before, of(l), right]);
            last.push(i);
            maker.push(i);
            if code.two_faces() {
                maker.push(i);
            }
        }
        all
    }

    /// The same with split `order[k]` as the `k`-th; vertices, faces and wedges that splits make are renumbered. Levels are left out, as they stand
    /// for no states any more. O(n).
    ///
    /// Errors: `order` is no permutation of the splits, or puts one before one it depends on.
    pub fn reordered(&self, order: &[u32]) -> Result<ProgressiveMesh, NotInOrder> {
        self.reordered_given(order, &self.dependencies())
    }

    /// The same, given [`ProgressiveMesh::dependencies`].
    pub(crate) fn reordered_given(
        &self,
        order: &[u32],
        on: &[[u32; 3]],
    ) -> Result<ProgressiveMesh, NotInOrder> {
        let (s, n) = (&self.splits, self.splits.len());
        let mut rank = vec![NONE; n];
        for (k, &i) in order.iter().enumerate() {
            match rank.get_mut(i as usize) {
                Some(r) if *r == NONE => *r = k as u32,
                _ => return Err(NotInOrder(i)),
            }
        }
        if let Some(missing) = rank.iter().position(|&r| r == NONE) {
            return Err(NotInOrder(missing as u32));
        }
        for (i, on) in on.iter().enumerate() {
            if on.iter().any(|&d| d != NONE && rank[d as usize] >= rank[i]) {
                return Err(NotInOrder(i as u32));
            }
        }
        // First face and first row of every split, before and after.
        let (m0, n0) = (self.base_faces.len() as u32, self.base_vertices() as u32);
        let faces_of = |i: usize| 1 + s.code[i].two_faces() as u32;
        let rows = if self.wedges.is_some() { self.rows_of_splits() } else { Vec::new() };
        // Without attributes nothing is listed.
        let wedges_of = |i: usize| match (rows.get(i), s.code[i].kind()) {
            (Some(r), _) => r.new,
            (None, SplitKind::Plain) => 1,
            (None, SplitKind::Seam) => 2,
            (None, SplitKind::Explicit) => 0,
        };
        let base_wedges = self.wedges.as_ref().map_or(n0, |w| w.base_vertex.len() as u32);
        let mut face = vec![0; n];
        let mut wedge = vec![0; n];
        let (mut f, mut w) = (m0, base_wedges);
        for &i in order {
            (face[i as usize], wedge[i as usize]) = (f, w);
            f += faces_of(i as usize);
            w += wedges_of(i as usize);
        }
        let mut new_face: Vec<u32> = Vec::with_capacity(f as usize);
        let mut new_wedge: Vec<u32> = Vec::with_capacity(w as usize);
        new_face.extend(0..m0);
        new_wedge.extend(0..base_wedges);
        for i in 0..n {
            new_face.push(face[i]);
            if s.code[i].two_faces() {
                new_face.push(face[i] + 1);
            }
            new_wedge.extend((0..wedges_of(i)).map(|k| wedge[i] + k));
        }
        let cut = |c: u32| match new_face.get((c >> 2) as usize) {
            Some(&f) if c != NONE => f << 2 | c & 3,
            _ => c,
        };
        let vertex = |v: u32| if v < n0 { v } else { n0 + rank[(v - n0) as usize] };
        let by_face = |old: &[u32]| {
            let mut new = vec![NONE; old.len()];
            old.iter().zip(&new_face).for_each(|(&x, &f)| new[f as usize] = x);
            new
        };
        let mut out = ProgressiveMesh {
            base_faces: self.base_faces.clone(),
            base_positions: self.base_positions.clone(),
            new_positions: self.new_positions.gather(order),
            moved_positions: self.moved_in_order(order),
            face_material: by_face(&self.face_material),
            face_group: by_face(&self.face_group),
            wires: self.wires.clone(),
            levels: vec![0, n as u32],
            bounds: self.bounds.as_ref().and_then(|b| b.reordered(order)).map(Arc::new),
            ..Default::default()
        };
        out.levels.dedup();
        // Splits come from anywhere: what there is of one is put side by side first, and so fetched at once. There may be no errors.
        let each = s.vertex.iter().zip(&s.left).zip(&s.right).zip(&s.code);
        let packed: Vec<_> = each.map(|(((&v, &l), &r), &c)| (vertex(v), cut(l), cut(r), c)).collect();
        out.splits.reserve(n);
        for &i in order {
            let (v, l, r, c) = packed[i as usize];
            out.splits.vertex.push(v);
            out.splits.left.push(l);
            out.splits.right.push(r);
            out.splits.code.push(c);
        }
        out.splits.error.extend(order.iter().filter_map(|&i| s.error.get(i as usize)));
        if let Some(streams) = &self.wedges {
            let base = base_wedges as usize;
            let mut values = Vec::with_capacity(streams.rows.len());
            let mut new = WedgeStreams {
                channels: streams.channels.clone(),
                stride: streams.stride,
                base_vertex: streams.base_vertex.clone(),
                ..Default::default()
            };
            let add = |values: &mut Vec<f32>, r: usize| {
                let end = values.len();
                values.resize(end + streams.stride, 0.0);
                streams.rows.read(r, &mut values[end..]);
            };
            new.present.extend((0..base).map(|r| streams.present[r]));
            (0..base).for_each(|r| add(&mut values, r));
            for &i in order {
                let r = &rows[i as usize];
                let range = r.first_row..r.first_row + (r.new + r.changed) as usize;
                new.present.extend(range.clone().map(|r| streams.present[r]));
                range.for_each(|r| add(&mut values, r));
                let entry = &streams.explicit[r.explicit.clone()];
                if let Some((counts, ids)) = entry.split_at_checked(2) {
                    new.explicit.extend_from_slice(counts);
                    new.explicit.extend(ids.iter().map(|&w| new_wedge.get(w as usize).copied().unwrap_or(w)));
                }
            }
            new.rows = values.into();
            out.wedges = Some(new);
        }
        if let Some(order) = &self.order {
            let mut o = order.clone();
            let by = |old: &[u32], new_slot: &dyn Fn(usize) -> usize| {
                let mut new = vec![NONE; old.len()];
                old.iter().enumerate().for_each(|(k, &x)| new[new_slot(k)] = x);
                new
            };
            o.vertex = by(&order.vertex, &|v| vertex(v as u32) as usize);
            o.face = by(&order.face, &|f| new_face[f] as usize);
            o.wedge = by(&order.wedge, &|w| new_wedge[w] as usize);
            out.order = Some(o);
        }
        Ok(out)
    }

    /// The splits by error, the largest first, level after level ([`ProgressiveMesh::levels`]); an order for [`ProgressiveMesh::reordered`]. Of splits of the
    /// same error, of which files have many, those come early that are far from each other in the present order: so meshes between two errors are as
    /// fine everywhere. O(n log n).
    pub fn by_error(&self) -> Vec<u32> {
        let n = self.splits.len();
        // By level, error (floats of one sign compare as their bits), place among equals. A split that depends on one of a later key gets that.
        let mut keys: Vec<(u32, u32, u32)> = Vec::with_capacity(n);
        let mut levels = self.levels.iter().copied().peekable();
        let mut level = 0;
        for (i, (k, on)) in (0u32..).zip(self.dependencies().iter().enumerate()) {
            while levels.next_if(|&l| l <= i).is_some() {
                level += 1;
            }
            let error = self.splits.error.get(k).copied().unwrap_or(0.0);
            let falling = if error > 0.0 { !error.to_bits() } else { u32::MAX };
            let own = (level, falling, i.reverse_bits());
            let before = on.iter().filter_map(|&d| keys.get(d as usize).copied());
            let key = before.fold(own, |key, d| key.max(d));
            keys.push(key);
        }
        let mut order: Vec<u32> = (0..n as u32).collect();
        order.sort_unstable_by_key(|&i| (keys[i as usize], i));
        order
    }

    /// The same mesh with its splits [`ProgressiveMesh::by_error`] and its levels kept: [`super::Cursor::seek_faces`] and
    /// [`super::Cursor::seek_error`] find the best there is. For meshes that were read from files, where splits come in chunks. `None` where
    /// splits name wedges at their tips outright, which only the order that is there does justice to, and of damaged meshes. O(n log n).
    pub fn sorted_by_error(&self) -> Option<ProgressiveMesh> {
        if !self.is_reorderable() || self.order.as_ref().is_some_and(|o| !o.fits(self)) {
            return None;
        }
        // Whatever the arrays say, it leads to full detail.
        self.cursor().ok()?.seek(usize::MAX).ok()?;
        let mut sorted = self.reordered(&self.by_error()).ok()?;
        sorted.levels.clone_from(&self.levels);
        Some(sorted)
    }

    /// No split names the wedge at a tip outright: so [`ProgressiveMesh::dependencies`] are all there are, as files of ours and view-dependent refinement take it.
    /// O(n).
    pub fn is_reorderable(&self) -> bool {
        let Some(streams) = &self.wedges else { return true };
        !self.rows_of_splits().into_iter().zip(&self.splits.code).any(|(r, code)| {
            let entry = streams.explicit.get(r.explicit).unwrap_or_default();
            let corners = entry.len().saturating_sub(3 * (1 + code.two_faces() as usize));
            entry[corners..].chunks_exact(3).any(|c| c[2] != NONE)
        })
    }

    fn moved_in_order(&self, order: &[u32]) -> Places {
        let mut next = 0;
        let slots: Vec<u32> = self
            .splits
            .code
            .iter()
            .map(|c| {
                next += c.moves() as u32;
                next.wrapping_sub(1)
            })
            .collect();
        let moving = order.iter().filter(|&&i| self.splits.code[i as usize].moves());
        let moved: Vec<u32> = moving.map(|&i| slots[i as usize]).collect();
        self.moved_positions.gather(&moved)
    }

    /// Where every split's attributes are. O(n).
    pub(crate) fn rows_of_splits(&self) -> Vec<RowsOf> {
        let base = self.wedges.as_ref().map_or(0, |w| w.base_vertex.len());
        let (mut row, mut at, mut wedge) = (base, 0, base as u32);
        let s = &self.splits;
        let each = s.code.iter().map(|&code| {
            let mut of = RowsOf { first_row: row, new: 1, changed: 0, explicit: at..at };
            match (code.kind(), &self.wedges) {
                (SplitKind::Plain, _) => of.changed = code.changes_rows() as u32,
                (SplitKind::Seam, _) => (of.new, of.changed) = (2, 2 * code.changes_rows() as u32),
                (SplitKind::Explicit, w) => {
                    let stream = w.as_ref().map_or(&[][..], |w| &w.explicit[at..]);
                    let [pairs, changed] = [0, 1].map(|k| stream.get(k).copied().unwrap_or(0) as usize);
                    let size = 2 + 2 * pairs + changed + 3 + 3 * code.two_faces() as usize;
                    let fine = stream.get(2..2 + 2 * pairs).unwrap_or_default().chunks_exact(2).map(|p| p[1]);
                    of.new = fine.filter(|&w| w >= wedge).count() as u32;
                    of.changed = changed as u32;
                    of.explicit = at..(at + size).min(at + stream.len());
                }
            }
            if self.wedges.is_some() {
                row += (of.new + of.changed) as usize;
            }
            (at, wedge) = (of.explicit.end, wedge + of.new);
            of
        });
        each.collect()
    }
}

/// Where a split's attributes are.
#[derive(Clone, Debug)]
pub(crate) struct RowsOf {
    pub(crate) first_row: usize,
    /// New wedges.
    pub(crate) new: u32,
    /// Wedges whose values change.
    pub(crate) changed: u32,
    /// Its entry of the explicit stream.
    pub(crate) explicit: std::ops::Range<usize>,
}
