//! A mesh between base and full detail.

use super::attributes::{Explicit, WedgeState};
use super::fans::{Fans, Opening};
use super::fetch;
use super::links::{Half, link_faces};
use super::{ProgressiveMesh, SplitKind, seam_wedges};
use crate::aif::{MeshInput, NONE, Positions, Wedges};
use std::ops::Deref;

/// A progressive mesh whose arrays contradict each other: it was damaged, or not made by [`super::build`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Damage {
    /// An array has another length than the others ask for.
    #[error("{what} has {len} entries, {want} are needed")]
    Length {
        /// Which array.
        what: &'static str,
        /// Its length.
        len: usize,
        /// The length needed.
        want: usize,
    },
    /// A reference to what does not exist.
    #[error("{what} {at} refers to {to}, which does not exist there")]
    Reference {
        /// What refers.
        what: &'static str,
        /// Which one.
        at: usize,
        /// To what.
        to: u32,
    },
    /// The faces around a split's vertex do not lead from its left cut to its right one.
    #[error("the cuts of split {0} do not belong to one fan of its vertex")]
    Fan(usize),
    /// The attributes of a split are not all there, or name wedges that cannot be.
    #[error("the attributes of split {0} are incomplete or contradict themselves")]
    Wedges(usize),
    /// The bounds of a split are not below those of the split above it.
    #[error("the bounds of split {0} do not lie within those above it")]
    Bounds(usize),
}

/// What a move of a [`Cursor`] changed in its buffers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Patch {
    /// Faces before; those from here on are new (or gone).
    pub faces_before: usize,
    /// Faces now.
    pub faces_now: usize,
    /// Wedges before.
    pub wedges_before: usize,
    /// Wedges now.
    pub wedges_now: usize,
    /// Entries of the index buffer (`3 * face + corner`) that hold another wedge than before, among the faces that stayed; ascending, each once.
    pub indices: Vec<u32>,
    /// Wedges that were there before and have another position or other attributes now; ascending, each once.
    pub wedges: Vec<u32>,
}

/// A mesh of the progressive mesh `P`, between `M^0` and `M^n`.
///
/// Holds 24 B a face and a copy of the positions and attributes of its vertices. [`Cursor::indices`] and [`Cursor::positions`] are
/// ready to be drawn. Moving by a split takes time in proportion to the valence, in both directions, and is exact: at every split count the mesh
/// is the same bit for bit however the cursor came there.
#[derive(Clone, Debug)]
pub struct Cursor<P: Deref<Target = ProgressiveMesh>> {
    source: P,
    /// Splits that are applied.
    position: usize,
    fans: Fans,
    positions: Positions,
    /// Where moved vertices were, latest last.
    undo_positions: Positions,
    wedges: Option<WedgeState>,
    touched: Option<Touched>,
    /// The wedge of every wedge at the split count where this began.
    descent: Option<Vec<u32>>,
    lineage: Option<Lineage>,
}

/// Which row of attributes each came of, while splits are applied from the base on.
#[derive(Clone, Debug, Default)]
struct Lineage {
    /// The row of every wedge.
    row: Vec<u32>,
    /// For every row the one that its wedge, or the wedge that was parted from, had before the split; rows of the base are their own.
    parents: Vec<u32>,
}

impl Lineage {
    /// A split parts new wedges from others, and changes some.
    fn pass(&mut self, from: impl Iterator<Item = u32>, changed: &[u32]) {
        let Lineage { row, parents } = self;
        let first = parents.len();
        parents.extend(from.map(|w| row[w as usize]));
        let new = parents.len();
        parents.extend(changed.iter().map(|&w| row[w as usize]));
        row.extend(first as u32..new as u32);
        for (k, &w) in (new as u32..).zip(changed) {
            row[w as usize] = k;
        }
    }
}

/// Faces that a split hands to its new vertex, as far as they are noted on the way to its right cut.
const RUN: usize = 8;

/// What a [`Patch`] needs, while one is made.
#[derive(Clone, Debug, Default)]
struct Touched {
    indices: Option<Vec<u32>>,
    wedges: Vec<u32>,
}

impl<P: Deref<Target = ProgressiveMesh>> Cursor<P> {
    /// A cursor at the base.
    ///
    /// Errors: arrays that do not fit together. A reference inside the splits that leads nowhere is found when it is come to.
    pub fn new(source: P) -> Result<Self, Damage> {
        let pm = &*source;
        let n0 = pm.base_positions.len();
        check_lengths(pm)?;
        let wedges = pm.wedges.as_ref().map(WedgeState::new);
        let count = wedges.as_ref().map_or(n0, |w| w.vertex.len());
        if let Some(w) = &wedges
            && let Some((at, &to)) = w.vertex.iter().enumerate().find(|(_, v)| **v as usize >= n0)
        {
            return Err(Damage::Reference { what: "base wedge", at, to });
        }
        let bad = |f: &[u32; 3]| f.iter().copied().find(|&w| w as usize >= count);
        if let Some((at, to)) = pm.base_faces.iter().enumerate().find_map(|(i, f)| bad(f).map(|w| (i, w))) {
            return Err(Damage::Reference { what: "base face", at, to });
        }
        if let Some((at, w)) = pm.wires.iter().enumerate().find(|(_, w)| w.iter().any(|&v| v as usize >= n0))
        {
            return Err(Damage::Reference { what: "wire", at, to: w[0].max(w[1]) });
        }
        let links = match &wedges {
            None => link_faces(&pm.base_faces, n0),
            Some(w) => {
                let faces: Vec<_> = pm.base_faces.iter().map(|f| f.map(|x| w.vertex[x as usize])).collect();
                link_faces(&faces, n0)
            }
        };
        let empty =
            if pm.base_positions.is_f64() { Positions::F64(Vec::new()) } else { Positions::default() };
        Ok(Cursor {
            fans: Fans { corners: pm.base_faces.clone(), links },
            positions: pm.base_positions.clone(),
            undo_positions: empty,
            wedges,
            position: 0,
            touched: None,
            descent: None,
            lineage: None,
            source,
        })
    }

    /// The progressive mesh.
    pub fn source(&self) -> &ProgressiveMesh {
        &self.source
    }

    /// Splits that are applied.
    pub fn position(&self) -> usize {
        self.position
    }

    /// Faces now.
    pub fn face_count(&self) -> usize {
        self.fans.corners.len()
    }

    /// Vertices now.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// Wedges (slots of the vertex buffer) now.
    pub fn wedge_count(&self) -> usize {
        self.wedges.as_ref().map_or(self.positions.len(), |w| w.vertex.len())
    }

    /// The index buffer: three wedges a face.
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.fans.corners
    }

    /// Positions of the vertices.
    pub fn positions(&self) -> &Positions {
        &self.positions
    }

    /// The vertex of wedge `w`. Panics if there is no such wedge.
    #[inline]
    pub fn wedge_vertex(&self, w: u32) -> u32 {
        self.wedges.as_ref().map_or(w, |s| s.vertex[w as usize])
    }

    /// The attribute values of wedge `w`, channel after channel; empty without attributes. Panics if there is no such wedge.
    pub fn row(&self, w: u32) -> &[f32] {
        match (&self.wedges, &self.source.wedges) {
            (Some(s), Some(streams)) => {
                &s.rows[w as usize * streams.stride..(w as usize + 1) * streams.stride]
            }
            _ => &[],
        }
    }

    /// The channels wedge `w` has, bit k for channel k. Panics if there is no such wedge.
    pub fn present(&self, w: u32) -> u64 {
        self.wedges.as_ref().map_or(0, |s| s.present[w as usize])
    }

    /// Estimated error of the mesh as it is, model units: that of the next split; 0 at full detail.
    pub fn error(&self) -> f64 {
        self.source.splits.error.get(self.position).copied().unwrap_or(0.0) as f64
    }

    /// Applies or undoes splits until `position` are applied (or all, if there are fewer).
    ///
    /// Errors: damage; the cursor then stands before the damaged split and can be used further.
    pub fn seek(&mut self, position: usize) -> Result<(), Damage> {
        let position = position.min(self.source.splits.len());
        while self.position < position {
            let end = position.min(self.position + fetch::BATCH);
            fetch::splits(&self.source.splits, self.position..end, &self.fans, &self.positions);
            while self.position < end {
                self.refine()?;
            }
        }
        while self.position > position {
            let end = position.max(self.position.saturating_sub(fetch::BATCH));
            fetch::collapses(&self.source.splits, end..self.position, &self.fans, &self.positions);
            while self.position > end {
                self.coarsen();
            }
        }
        Ok(())
    }

    /// To the finest mesh of at most this many faces, or the base.
    ///
    /// Errors: as [`Cursor::seek`].
    pub fn seek_faces(&mut self, faces: usize) -> Result<(), Damage> {
        let (code, mut position, mut now) = (&self.source.splits.code, self.position, self.face_count());
        let made_by = |i: usize| 1 + code[i].two_faces() as usize;
        while position > 0 && now > faces {
            position -= 1;
            now -= made_by(position);
        }
        while position < code.len() && now + made_by(position) <= faces {
            now += made_by(position);
            position += 1;
        }
        self.seek(position)
    }

    /// To the finest mesh of at most this many vertices, or the base.
    ///
    /// Errors: as [`Cursor::seek`].
    pub fn seek_vertices(&mut self, vertices: usize) -> Result<(), Damage> {
        self.seek(vertices.saturating_sub(self.source.base_vertices()))
    }

    /// To the coarsest mesh from which on no split has a larger error than `error` (an estimate, model units).
    ///
    /// Errors: as [`Cursor::seek`].
    pub fn seek_error(&mut self, error: f64) -> Result<(), Damage> {
        let last = self.source.splits.error.iter().rposition(|&e| e as f64 > error);
        self.seek(last.map_or(0, |i| i + 1))
    }

    /// To level `k` of [`ProgressiveMesh::levels`], 0 the coarsest; the finest stands for all beyond it.
    ///
    /// Errors: as [`Cursor::seek`].
    pub fn seek_level(&mut self, k: usize) -> Result<(), Damage> {
        let levels = &self.source.levels;
        let to = levels.get(k).or(levels.last()).map_or(self.source.splits.len(), |&l| l as usize);
        self.seek(to)
    }

    /// As [`Cursor::seek`], and says what changed in the buffers. O(k log k) for k changes.
    pub fn seek_with_patch(&mut self, position: usize, patch: &mut Patch) -> Result<(), Damage> {
        patch.faces_before = self.face_count();
        patch.wedges_before = self.wedge_count();
        self.touched = Some(Touched { indices: Some(Vec::new()), wedges: Vec::new() });
        let result = self.seek(position);
        let touched = self.touched.take().unwrap_or_default();
        patch.faces_now = self.face_count();
        patch.wedges_now = self.wedge_count();
        let settle = |mut all: Vec<u32>, end: usize| {
            all.sort_unstable();
            all.dedup();
            all.truncate(all.partition_point(|&x| (x as usize) < end));
            all
        };
        patch.indices =
            settle(touched.indices.unwrap_or_default(), 3 * patch.faces_before.min(patch.faces_now));
        patch.wedges = settle(touched.wedges, patch.wedges_before.min(patch.wedges_now));
        result
    }

    /// As [`Cursor::seek`] to a finer state; returns for every wedge there the wedge it comes from here.
    ///
    /// Errors: as [`Cursor::seek`].
    pub(crate) fn seek_with_descent(&mut self, position: usize) -> Result<Vec<u32>, Damage> {
        self.descent = Some((0..self.wedge_count() as u32).collect());
        let result = self.seek(position.max(self.position));
        let descent = self.descent.take().unwrap_or_default();
        result.map(|()| descent)
    }

    /// As [`Cursor::seek`] from the base to full detail; returns for every row of attributes the one it comes of.
    ///
    /// Errors: as [`Cursor::seek`].
    pub(crate) fn seek_with_lineage(&mut self) -> Result<Vec<u32>, Damage> {
        self.seek(0)?;
        let rows: Vec<u32> = (0..self.wedges.as_ref().map_or(0, |w| w.vertex.len()) as u32).collect();
        self.lineage = Some(Lineage { row: rows.clone(), parents: rows });
        let result = self.seek(usize::MAX);
        let lineage = self.lineage.take().unwrap_or_default();
        result.map(|()| lineage.parents)
    }

    /// Applies the next split; false at full detail. O(valence).
    ///
    /// Errors: damage; nothing has changed then.
    pub fn refine(&mut self) -> Result<bool, Damage> {
        let i = self.position;
        let pm = &*self.source;
        let Some(&vs) = pm.splits.vertex.get(i) else { return Ok(false) };
        if vs as usize >= self.positions.len() {
            return Err(Damage::Reference { what: "split", at: i, to: vs });
        }
        let code = pm.splits.code[i];
        // Walked once, as far as they are few; nearly always.
        let mut run = [Half::new(0, 0, false); RUN];
        let mut known = 0;
        let cuts = (pm.splits.left[i], pm.splits.right[i]);
        let gap = self.fans.find_gap_and_tell(i, cuts, code, |h| {
            if let Some(to) = run.get_mut(known) {
                *to = h;
                known += 1;
            }
        })?;
        let Some(seen_from) = gap.left.inner.or(gap.left.outer) else { return Err(Damage::Fan(i)) };
        let wedge = |h: Half| self.fans.wedge(h);
        let first = wedge(seen_from);
        if self.wedge_vertex(first) != vs {
            return Err(Damage::Fan(i));
        }
        let (vu, w) = (self.positions.len() as u32, self.wedge_count() as u32);
        let tips = [
            self.fans.tip(gap.left, code.left_tip_inner()),
            self.fans.tip(gap.right, code.right_tip_inner()),
        ];
        // What becomes of the wedges: how many are new, which change, those of the new faces.
        let mut explicit = Explicit::default();
        let (x, new, changed, mut corners): ([u32; 2], usize, &[u32], [[u32; 3]; 2]) = match code.kind() {
            SplitKind::Plain => ([first; 2], 1, &[first], [[first, w, NONE]; 2]),
            SplitKind::Seam => {
                let last = gap.right.inner.map_or(first, wedge);
                let outer = |o: Opening| o.outer.map(wedge);
                let (l, r) = seam_wedges(first, last, outer(gap.left), outer(gap.right));
                ([l, r], 2, &[l, r], [[l, w, NONE], [r, w + 1, NONE]])
            }
            SplitKind::Explicit => {
                let (Some(s), Some(state)) = (&pm.wedges, &self.wedges) else { return Err(Damage::Fan(i)) };
                let stream = &s.explicit;
                explicit = Explicit::read(stream, state.next_explicit, code.two_faces(), w)
                    .ok_or(Damage::Wedges(i))?;
                let of = |k: usize| explicit.corners.get(k).copied().unwrap_or_default();
                ([first; 2], explicit.new, &explicit.changed, [of(0), of(1)])
            }
        };
        let changed = if code.changes_rows() { changed } else { &[] };
        if let (Some(streams), Some(state)) = (&pm.wedges, &mut self.wedges) {
            if state.next_row + new + changed.len() > streams.present.len() {
                return Err(Damage::Wedges(i));
            }
            // Nothing has changed so far; from here on all is known to be good.
            if code.kind() == SplitKind::Explicit {
                state.explicit_starts.push(state.next_explicit as u32);
                state.next_explicit = explicit.end;
                let moved = explicit.pairs.iter().filter(|p| p.0 == p.1);
                moved.for_each(|p| state.vertex[p.1 as usize] = vu);
            }
            state.apply(streams, vu, new, changed);
            // Of an explicit split's new wedges some may belong to the old vertex, or to a tip.
            for (c, tip) in explicit.corners.iter().zip(tips) {
                if c[0] >= w {
                    state.vertex[c[0] as usize] = vs;
                }
                if c[2] >= w && c[2] != NONE && tip != NONE {
                    state.vertex[c[2] as usize] = state.vertex[tip as usize];
                }
            }
        }
        if self.descent.is_some() || self.lineage.is_some() {
            let own = [(x[0], w), (x[1], w + 1)];
            let pairs = if code.kind() == SplitKind::Explicit { &explicit.pairs[..] } else { &own[..new] };
            let fresh = pairs.iter().filter(|p| p.1 >= w).map(|p| p.0);
            if let Some(from) = &mut self.descent {
                fresh.clone().for_each(|p| from.push(from[p as usize]));
            }
            if let Some(lineage) = &mut self.lineage {
                lineage.pass(fresh, changed);
            }
        }
        if let Some(t) = &mut self.touched {
            t.wedges.extend_from_slice(changed);
            if code.moves() && self.wedges.is_some() {
                t.wedges.extend(self.fans.wedges_around(seen_from));
            } else if code.moves() {
                t.wedges.push(vs);
            }
        }
        if code.moves() {
            append(&self.positions, vs as usize, &mut self.undo_positions);
            // Rounding to the precision that it is of changes nothing.
            self.positions.set(vs as usize, pm.moved_positions.get(self.undo_positions.len() - 1));
        }
        let place = pm.new_positions.get(i);
        match &mut self.positions {
            Positions::F32(p) => p.push(place.as_vec3().to_array()),
            Positions::F64(p) => p.push(place.to_array()),
        }
        let mut unseen = None;
        let seen = self.touched.as_mut().map_or(&mut unseen, |t| &mut t.indices);
        match code.kind() {
            SplitKind::Plain if gap.faces == known => self.fans.hand_over_run(&run[..known], |_| w, seen),
            SplitKind::Plain => self.fans.hand_over(gap.left.inner, gap.faces, |_| w, seen),
            SplitKind::Seam => {
                let map = |c: u32| if c == x[0] { w } else { w + 1 };
                self.fans.hand_over(gap.left.inner, gap.faces, map, seen);
            }
            SplitKind::Explicit => {
                let map = |c: u32| explicit.pairs.iter().find(|p| p.0 == c).map_or(c, |p| p.1);
                self.fans.hand_over(gap.left.inner, gap.faces, map, seen);
            }
        }
        for (c, tip) in corners.iter_mut().zip(tips).filter(|(c, _)| c[2] == NONE) {
            c[2] = tip;
        }
        let edge = self.fans.insert(code.left(), corners[0], gap.left);
        if code.two_faces() {
            let other = self.fans.insert(code.right(), corners[1], gap.right);
            self.fans.connect(edge, other);
        }
        self.position += 1;
        Ok(true)
    }

    /// Undoes the last split; false at the base. O(valence).
    pub fn coarsen(&mut self) -> bool {
        let Some(i) = self.position.checked_sub(1) else { return false };
        let pm = &*self.source;
        let (vs, code) = (pm.splits.vertex[i], pm.splits.code[i]);
        let two = code.two_faces();
        let fl = (self.fans.corners.len() - 1 - two as usize) as u32;
        let left = self.fans.opening_of(fl, code.left());
        let right = if two { self.fans.opening_of(fl + 1, code.right()) } else { Opening::default() };
        let (x_l, y_l) = self.fans.ends_of(fl, code.left());
        let x_r = if two { self.fans.ends_of(fl + 1, code.right()).0 } else { x_l };
        let mut explicit = Explicit::default();
        if let (SplitKind::Explicit, Some(streams), Some(state)) = (code.kind(), &pm.wedges, &mut self.wedges)
        {
            state.next_explicit = state.explicit_starts.pop().unwrap_or(0) as usize;
            // The largest number of new wedges that reads is right: with more, some pair would name a wedge that was not there yet.
            let pairs = streams.explicit.get(state.next_explicit).copied().unwrap_or(0) as usize;
            let new = pairs.min(state.vertex.len());
            let before = |n: usize| (state.vertex.len() - n) as u32;
            let read = |n| {
                Explicit::read(&streams.explicit, state.next_explicit, two, before(n)).filter(|e| e.new == n)
            };
            explicit = (0..=new).rev().find_map(read).unwrap_or_default();
        }
        let mut unseen = None;
        let seen = self.touched.as_mut().map_or(&mut unseen, |t| &mut t.indices);
        let chosen = [x_l, x_r];
        let (new, changed): (usize, &[u32]) = match code.kind() {
            SplitKind::Plain => {
                self.fans.hand_over_before(left.inner, fl, |_| x_l, seen);
                (1, &chosen[..1])
            }
            SplitKind::Seam => {
                self.fans.hand_over_before(left.inner, fl, |c| if c == y_l { x_l } else { x_r }, seen);
                (2, &chosen)
            }
            SplitKind::Explicit => {
                let map = |c: u32| explicit.pairs.iter().find(|p| p.1 == c).map_or(c, |p| p.0);
                self.fans.hand_over_before(left.inner, fl, map, seen);
                (explicit.new, &explicit.changed)
            }
        };
        self.fans.close(left);
        self.fans.close(right);
        self.fans.corners.truncate(fl as usize);
        self.fans.links.truncate(fl as usize);
        let changed = if code.changes_rows() { changed } else { &[] };
        if let (Some(streams), Some(state)) = (&pm.wedges, &mut self.wedges) {
            let moved = explicit.pairs.iter().filter(|p| p.0 == p.1);
            moved.for_each(|p| state.vertex[p.1 as usize] = vs);
            state.undo(streams.stride, new, changed);
        }
        shorten(&mut self.positions);
        if code.moves() {
            overwrite(&self.undo_positions, self.undo_positions.len() - 1, &mut self.positions, vs as usize);
            shorten(&mut self.undo_positions);
        }
        if let Some(t) = &mut self.touched {
            t.wedges.extend_from_slice(changed);
            match left.inner.or(left.outer).filter(|_| self.wedges.is_some()) {
                Some(h) if code.moves() => t.wedges.extend(self.fans.wedges_around(h)),
                None if code.moves() => t.wedges.push(vs),
                _ => {}
            }
        }
        self.position = i;
        true
    }

    /// The mesh as flat arrays, in the numbering of the splits. O(n).
    pub fn to_input(&self) -> MeshInput {
        let pm = &*self.source;
        let faces = self.fans.corners.len();
        let mut input = MeshInput {
            positions: self.positions.clone(),
            wires: pm.wires.clone(),
            face_material: pm.face_material.get(..faces).unwrap_or_default().to_vec(),
            face_group: pm.face_group.get(..faces).unwrap_or_default().to_vec(),
            ..Default::default()
        };
        let corners = self.fans.corners.as_flattened();
        input.corners = corners.iter().map(|&w| self.wedge_vertex(w)).collect();
        if let (Some(streams), Some(state)) = (&pm.wedges, &self.wedges)
            && let Ok(mut wedges) = Wedges::new(streams.channels.clone())
        {
            for (row, &present) in state.rows.chunks_exact(streams.stride.max(1)).zip(&state.present) {
                wedges.push(&row[..streams.stride], present);
            }
            wedges.corner =
                corners.iter().map(|&w| if state.present[w as usize] == 0 { NONE } else { w }).collect();
            input.wedges = Some(wedges);
        }
        input
    }
}

/// Appends point `i` of `from`.
#[inline]
fn append(from: &Positions, i: usize, to: &mut Positions) {
    match (from, to) {
        (Positions::F32(a), Positions::F32(b)) => b.push(a[i]),
        (Positions::F64(a), Positions::F64(b)) => b.push(a[i]),
        _ => {}
    }
}

/// Point `k` of `to` becomes point `i` of `from`.
#[inline]
fn overwrite(from: &Positions, i: usize, to: &mut Positions, k: usize) {
    match (from, to) {
        (Positions::F32(a), Positions::F32(b)) => b[k] = a[i],
        (Positions::F64(a), Positions::F64(b)) => b[k] = a[i],
        _ => {}
    }
}

/// Drops the last point.
#[inline]
fn shorten(p: &mut Positions) {
    match p {
        Positions::F32(a) => drop(a.pop()),
        Positions::F64(a) => drop(a.pop()),
    }
}

/// Refuses arrays of the wrong length, so that indices need no further care.
fn check_lengths(pm: &ProgressiveMesh) -> Result<(), Damage> {
    let n = pm.splits.len();
    let faces = pm.faces();
    let moved = pm.splits.code.iter().filter(|c| c.moves()).count();
    let same = |what, len, want| if len == want { Ok(()) } else { Err(Damage::Length { what, len, want }) };
    same("left cuts", pm.splits.left.len(), n)?;
    same("right cuts", pm.splits.right.len(), n)?;
    same("split codes", pm.splits.code.len(), n)?;
    if !pm.splits.error.is_empty() {
        same("errors", pm.splits.error.len(), n)?;
    }
    same("new positions", pm.new_positions.len(), n)?;
    same("moved positions", pm.moved_positions.len(), moved)?;
    let precise = pm.base_positions.is_f64();
    if [&pm.new_positions, &pm.moved_positions].iter().any(|p| !p.is_empty() && p.is_f64() != precise) {
        return Err(Damage::Length { what: "positions of the base's precision", len: 0, want: n });
    }
    for (what, per_face) in [("materials", &pm.face_material), ("groups", &pm.face_group)] {
        if !per_face.is_empty() {
            same(what, per_face.len(), faces)?;
        }
    }
    // Faces and wedges must fit their fields.
    if faces >= 1 << 29 || pm.vertices() >= NONE as usize {
        return Err(Damage::Length { what: "faces", len: faces, want: (1 << 29) - 1 });
    }
    match &pm.wedges {
        Some(w) => {
            let width: usize = w.channels.iter().map(|c| c.width).sum();
            same("channels", width, w.stride)?;
            same("attribute values", w.rows.len(), w.present.len().saturating_mul(w.stride))?;
            if w.present.len() < w.base_vertex.len() {
                same("attribute rows", w.present.len(), w.base_vertex.len())?;
            }
            Ok(())
        }
        None => match pm.splits.code.iter().position(|c| c.kind() != SplitKind::Plain || c.changes_rows()) {
            Some(at) => Err(Damage::Fan(at)),
            None => Ok(()),
        },
    }
}
