//! A mesh between base and full detail.

use super::links::{Half, across, link, link_faces, next, previous};
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
    corners: Vec<[u32; 3]>,
    links: Vec<[u32; 3]>,
    positions: Positions,
    /// Where moved vertices were, latest last.
    undo_positions: Positions,
    wedges: Option<WedgeState>,
    /// What a [`Patch`] needs, while one is made.
    touched: Option<Touched>,
}

#[derive(Clone, Debug)]
struct WedgeState {
    vertex: Vec<u32>,
    rows: Vec<f32>,
    present: Vec<u64>,
    undo_rows: Vec<f32>,
    undo_present: Vec<u64>,
    /// Rows of the source that are in use.
    next_row: usize,
    /// Numbers of the explicit stream that are in use.
    next_explicit: usize,
    /// Where explicit splits that are applied begin in their stream.
    explicit_starts: Vec<u32>,
}

#[derive(Clone, Debug, Default)]
struct Touched {
    indices: Vec<u32>,
    wedges: Vec<u32>,
}

/// The wedges of a split: up to this many pairs without the heap.
type Pairs = [(u32, u32); 2];

impl<P: Deref<Target = ProgressiveMesh>> Cursor<P> {
    /// A cursor at the base.
    ///
    /// Errors: arrays that do not fit together. A reference inside the splits that leads nowhere is found when it is come to.
    pub fn new(source: P) -> Result<Self, Damage> {
        let pm = &*source;
        let n0 = pm.base_positions.len();
        check_lengths(pm)?;
        let wedges = pm.wedges.as_ref().map(|w| {
            let base = w.base_vertex.len();
            WedgeState {
                vertex: w.base_vertex.clone(),
                rows: w.rows[..base * w.stride].to_vec(),
                present: w.present[..base].to_vec(),
                undo_rows: Vec::new(),
                undo_present: Vec::new(),
                next_row: base,
                next_explicit: 0,
                explicit_starts: Vec::new(),
            }
        });
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
            corners: pm.base_faces.clone(),
            links,
            positions: pm.base_positions.clone(),
            undo_positions: empty,
            wedges,
            position: 0,
            touched: None,
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
        self.corners.len()
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
        &self.corners
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
            self.refine()?;
        }
        while self.position > position {
            self.coarsen();
        }
        Ok(())
    }

    /// To the finest mesh of at most this many faces, or the base.
    ///
    /// Errors: as [`Cursor::seek`].
    pub fn seek_faces(&mut self, faces: usize) -> Result<(), Damage> {
        while self.position > 0 && self.face_count() > faces {
            self.coarsen();
        }
        while let Some(code) = self.source.splits.code.get(self.position) {
            if self.face_count() + 1 + code.two_faces() as usize > faces {
                break;
            }
            self.refine()?;
        }
        Ok(())
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
        self.touched = Some(Touched::default());
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
        patch.indices = settle(touched.indices, 3 * patch.faces_before.min(patch.faces_now));
        patch.wedges = settle(touched.wedges, patch.wedges_before.min(patch.wedges_now));
        result
    }

    /// Applies the next split; false at full detail. O(valence).
    ///
    /// Errors: damage; nothing has changed then.
    pub fn refine(&mut self) -> Result<bool, Damage> {
        let i = self.position;
        let pm = &*self.source;
        let Some(&vs) = pm.splits.vertex.get(i) else { return Ok(false) };
        let (code, cut) = (pm.splits.code[i], pm.splits.left[i]);
        let faces = self.corners.len() as u32;
        if vs as usize >= self.positions.len() {
            return Err(Damage::Reference { what: "split", at: i, to: vs });
        }
        for r in [cut].into_iter().chain(code.two_faces().then_some(pm.splits.right[i])) {
            if r >> 2 >= faces || r & 3 == 3 {
                return Err(Damage::Reference { what: "split", at: i, to: r });
            }
        }
        // The left cut, from both sides.
        let named = Half { face: cut >> 2, edge: cut & 3, starts: code.left_starts() };
        let beyond = across(named, self.links[named.face as usize][named.edge as usize]);
        let (inner_l, outer_l) =
            if code.left_inner() { (Some(named), beyond) } else { (beyond, Some(named)) };
        // Wedges: of the old vertex left and right, and what becomes of them at the new one.
        let kind = code.kind();
        let at_vertex = |h: Half| self.corners[h.face as usize][h.corner()];
        let (first_new, mut x_l) = match inner_l.or(outer_l) {
            Some(h) => (self.wedge_count() as u32, at_vertex(h)),
            None => return Err(Damage::Fan(i)),
        };
        if self.wedge_vertex(x_l) != vs {
            return Err(Damage::Fan(i));
        }
        // Once round to find the right cut: nothing changes before the split is known to be good.
        let (mut last, mut beyond_last, mut count) = (None, None, 0u32);
        let mut h = inner_l;
        while let Some(entry) = h {
            let exit = entry.turn();
            let opposite = across(exit, self.links[exit.face as usize][exit.edge as usize]);
            (last, beyond_last) = (Some(exit), opposite);
            count += 1;
            if code.two_faces() {
                let cut = pm.splits.right[i];
                let met = if code.right_inner() {
                    exit.code() == cut
                } else {
                    opposite.is_some_and(|o| o.code() == cut)
                };
                if met {
                    break;
                }
                if opposite.is_none() || count > faces {
                    return Err(Damage::Fan(i));
                }
            }
            if count > faces {
                return Err(Damage::Fan(i));
            }
            h = opposite;
        }
        if code.two_faces() && last.is_none() {
            return Err(Damage::Fan(i));
        }
        let mut x_r = last.map_or(x_l, at_vertex);
        if kind == SplitKind::Seam {
            (x_l, x_r) = seam_wedges(x_l, x_r, outer_l.map(at_vertex), beyond_last.map(at_vertex));
        }
        let (mut pairs, mut many): (Pairs, Vec<(u32, u32)>) =
            ([(x_l, first_new), (x_r, first_new + 1)], Vec::new());
        let mut new_wedges = 1;
        let mut corners_of = [[NONE; 3]; 2];
        let mut changed: [u32; 2] = [x_l, x_r];
        let mut changed_many = Vec::new();
        let mut explicit_end = 0;
        match kind {
            SplitKind::Plain => pairs[1] = pairs[0],
            SplitKind::Seam => new_wedges = 2,
            SplitKind::Explicit => {
                let (Some(w), Some(state)) = (&pm.wedges, &self.wedges) else { return Err(Damage::Fan(i)) };
                let e = Explicit::read(&w.explicit, state.next_explicit, code.two_faces()).ok_or(
                    Damage::Length {
                        what: "explicit wedges",
                        len: w.explicit.len(),
                        want: w.explicit.len() + 1,
                    },
                )?;
                explicit_end = e.end;
                new_wedges = e.pairs.iter().filter(|p| p.1 >= first_new).count() as u32;
                let end = first_new + new_wedges;
                let known = |w: &u32| *w < end;
                let all = e.pairs.iter().flat_map(|p| [p.0, p.1]).chain(e.changed.iter().copied());
                if let Some(to) =
                    all.chain(e.corners.iter().flatten().copied().filter(|&w| w != NONE)).find(|w| !known(w))
                {
                    return Err(Damage::Reference { what: "explicit split", at: i, to });
                }
                corners_of = [e.corners[0], e.corners.get(1).copied().unwrap_or([NONE; 3])];
                (many, changed_many) = (e.pairs, e.changed);
            }
        }
        // Everything is known to be good: now change.
        let vu = self.positions.len() as u32;
        let changed: &[u32] = match kind {
            SplitKind::Explicit => &changed_many,
            SplitKind::Plain => {
                changed[1] = changed[0];
                &changed[..1]
            }
            SplitKind::Seam => &changed,
        };
        let changed = if code.changes_rows() { changed } else { &[] };
        if let (Some(streams), Some(state)) = (&pm.wedges, &mut self.wedges) {
            let stride = streams.stride;
            let need = state.next_row + new_wedges as usize + changed.len();
            if need > streams.present.len() {
                return Err(Damage::Length {
                    what: "attribute rows",
                    len: streams.present.len(),
                    want: need,
                });
            }
            if kind == SplitKind::Explicit {
                state.explicit_starts.push(state.next_explicit as u32);
                state.next_explicit = explicit_end;
                many.iter().filter(|p| p.1 < first_new).for_each(|p| state.vertex[p.1 as usize] = vu);
            }
            let row = |r: usize| &streams.rows[r * stride..(r + 1) * stride];
            for _ in 0..new_wedges {
                state.vertex.push(vu);
                state.rows.extend_from_slice(row(state.next_row));
                state.present.push(streams.present[state.next_row]);
                state.next_row += 1;
            }
            for &w in changed {
                let range = w as usize * stride..(w as usize + 1) * stride;
                state.undo_rows.extend_from_slice(&state.rows[range.clone()]);
                state.undo_present.push(state.present[w as usize]);
                state.rows[range].copy_from_slice(row(state.next_row));
                state.present[w as usize] = streams.present[state.next_row];
                state.next_row += 1;
            }
        }
        if let Some(t) = &mut self.touched {
            t.wedges.extend_from_slice(changed);
        }
        if code.moves() {
            copy(&self.positions, vs as usize, &mut self.undo_positions);
            let k = self.undo_positions.len() - 1;
            if !copy_to(&pm.moved_positions, k, &mut self.positions, vs as usize) {
                return Err(Damage::Length {
                    what: "moved positions",
                    len: pm.moved_positions.len(),
                    want: k + 1,
                });
            }
            if let Some(t) = &mut self.touched {
                t.wedges.extend(vertex_wedges(
                    &self.corners,
                    &self.links,
                    self.wedges.is_some(),
                    vs,
                    inner_l.or(outer_l),
                ));
            }
        }
        copy(&pm.new_positions, i, &mut self.positions);
        // The faces from cut to cut go to the new vertex.
        let fl = faces;
        let fr = faces + 1;
        let mut h = inner_l;
        for _ in 0..count {
            let Some(entry) = h else { break };
            let c = entry.corner();
            let wedge = &mut self.corners[entry.face as usize][c];
            let to = if kind == SplitKind::Explicit {
                many.iter().find(|p| p.0 == *wedge).map_or(*wedge, |p| p.1)
            } else if *wedge == pairs[0].0 {
                pairs[0].1
            } else {
                pairs[1].1
            };
            *wedge = to;
            if let Some(t) = &mut self.touched {
                t.indices.push(3 * entry.face + c as u32);
            }
            let exit = entry.turn();
            h = across(exit, self.links[exit.face as usize][exit.edge as usize]);
        }
        let tip = |corners: &[[u32; 3]], outer: Option<Half>, inner: Option<Half>, from_inner: bool| {
            let (a, b) = if from_inner { (inner, outer) } else { (outer, inner) };
            a.or(b).map_or(NONE, |h| corners[h.face as usize][h.far_corner()])
        };
        let vl = tip(&self.corners, outer_l, inner_l, code.left_tip_inner());
        let vr = tip(&self.corners, beyond_last, last, code.right_tip_inner());
        if kind != SplitKind::Explicit {
            corners_of = [[x_l, pairs[0].1, vl], [pairs[1].0, pairs[1].1, vr]];
        }
        for (corners, tip) in corners_of.iter_mut().zip([vl, vr]) {
            if corners[2] == NONE {
                corners[2] = tip;
            }
        }
        let left_mid = self.insert(fl, code.left(), corners_of[0], outer_l, inner_l);
        if code.two_faces() {
            let right_mid = self.insert(fr, code.right(), corners_of[1], beyond_last, last);
            connect(&mut self.links, left_mid, right_mid);
        }
        self.position += 1;
        Ok(true)
    }

    /// Appends face `f` between two others; returns its edge between the old vertex and the new one, seen from the old.
    fn insert(
        &mut self,
        f: u32,
        (a, vu_next): (usize, bool),
        [vt, vu, tip]: [u32; 3],
        outer: Option<Half>,
        inner: Option<Half>,
    ) -> Half {
        let (b, c) = (next(a), previous(a));
        let mut corners = [0; 3];
        corners[a] = tip;
        (corners[b], corners[c]) = if vu_next { (vu, vt) } else { (vt, vu) };
        self.corners.push(corners);
        self.links.push([NONE; 3]);
        // Edge a runs from the tip to corner b, edge c from corner c to the tip.
        let (old, new) = sides(f, a, vu_next);
        if let Some(o) = outer {
            connect(&mut self.links, old, o);
        }
        if let Some(i) = inner {
            connect(&mut self.links, new, i);
        }
        Half { face: f, edge: b as u32, starts: !vu_next }
    }

    /// Undoes the last split; false at the base. O(valence).
    pub fn coarsen(&mut self) -> bool {
        let Some(i) = self.position.checked_sub(1) else { return false };
        let pm = &*self.source;
        let (vs, code) = (pm.splits.vertex[i], pm.splits.code[i]);
        let two = code.two_faces();
        let fl = (self.corners.len() - 1 - two as usize) as u32;
        let kind = code.kind();
        let (a, vu_next) = code.left();
        let (old, new) = sides(fl, a, vu_next);
        let read = |h: Half| self.links[h.face as usize][h.edge as usize];
        let (outer_l, inner_l) = (across(old, read(old)), across(new, read(new)));
        let right = two.then(|| {
            let (a, vu_next) = code.right();
            let (old, new) = sides(fl + 1, a, vu_next);
            (across(old, read(old)), across(new, read(new)))
        });
        let corner_at = |f: u32, (a, vu_next): (usize, bool)| {
            let c = &self.corners[f as usize];
            let (b, d) = (c[next(a)], c[previous(a)]);
            if vu_next { (d, b) } else { (b, d) }
        };
        let (x_l, y_l) = corner_at(fl, code.left());
        let x_r = if two { corner_at(fl + 1, code.right()).0 } else { x_l };
        let mut many = Vec::new();
        let mut changed_many = Vec::new();
        if kind == SplitKind::Explicit
            && let (Some(w), Some(state)) = (&pm.wedges, &mut self.wedges)
        {
            state.next_explicit = state.explicit_starts.pop().unwrap_or(0) as usize;
            if let Some(e) = Explicit::read(&w.explicit, state.next_explicit, two) {
                (many, changed_many) = (e.pairs, e.changed);
            }
        }
        // The faces of the new vertex go back.
        let mut h = inner_l;
        while let Some(entry) = h.filter(|h| h.face < fl) {
            let c = entry.corner();
            let wedge = &mut self.corners[entry.face as usize][c];
            *wedge = if kind == SplitKind::Explicit {
                many.iter().find(|p| p.1 == *wedge).map_or(*wedge, |p| p.0)
            } else if *wedge == y_l {
                x_l
            } else {
                x_r
            };
            if let Some(t) = &mut self.touched {
                t.indices.push(3 * entry.face + c as u32);
            }
            let exit = entry.turn();
            h = across(exit, self.links[exit.face as usize][exit.edge as usize]);
        }
        rejoin(&mut self.links, outer_l, inner_l);
        if let Some((outer, inner)) = right {
            rejoin(&mut self.links, outer, inner);
        }
        self.corners.truncate(fl as usize);
        self.links.truncate(fl as usize);
        // Attributes and positions.
        if let (Some(streams), Some(state)) = (&pm.wedges, &mut self.wedges) {
            let stride = streams.stride;
            let two_wedges = [x_l, x_r];
            let changed = match kind {
                _ if !code.changes_rows() => &[][..],
                SplitKind::Explicit => &changed_many,
                SplitKind::Plain => &two_wedges[..1],
                SplitKind::Seam => &two_wedges,
            };
            for &w in changed.iter().rev() {
                let at = state.undo_rows.len() - stride;
                state.rows[w as usize * stride..(w as usize + 1) * stride]
                    .copy_from_slice(&state.undo_rows[at..]);
                state.undo_rows.truncate(at);
                state.present[w as usize] = state.undo_present.pop().unwrap_or(0);
                state.next_row -= 1;
            }
            if let Some(t) = &mut self.touched {
                t.wedges.extend_from_slice(changed);
            }
            let gone = match kind {
                SplitKind::Plain => 1,
                SplitKind::Seam => 2,
                SplitKind::Explicit => {
                    let vu = self.positions.len() as u32 - 1;
                    let moved = many.iter().filter(|p| p.0 == p.1);
                    moved.for_each(|p| state.vertex[p.1 as usize] = vs);
                    state.vertex.iter().rev().take_while(|&&v| v == vu).count()
                }
            };
            let keep = state.vertex.len() - gone;
            state.vertex.truncate(keep);
            state.rows.truncate(keep * stride);
            state.present.truncate(keep);
            state.next_row -= gone;
        }
        pop(&mut self.positions);
        if code.moves() {
            let k = self.undo_positions.len() - 1;
            copy_to(&self.undo_positions, k, &mut self.positions, vs as usize);
            pop(&mut self.undo_positions);
            if let Some(t) = &mut self.touched {
                t.wedges.extend(vertex_wedges(
                    &self.corners,
                    &self.links,
                    self.wedges.is_some(),
                    vs,
                    inner_l.or(outer_l),
                ));
            }
        }
        self.position = i;
        true
    }

    /// The mesh as flat arrays, in the numbering of the splits. O(n).
    pub fn to_input(&self) -> MeshInput {
        let pm = &*self.source;
        let faces = self.corners.len();
        let mut input = MeshInput {
            positions: self.positions.clone(),
            wires: pm.wires.clone(),
            face_material: pm.face_material.get(..faces).unwrap_or_default().to_vec(),
            face_group: pm.face_group.get(..faces).unwrap_or_default().to_vec(),
            ..Default::default()
        };
        let corners = self.corners.as_flattened();
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

/// Links two half-edges, both seen from the same vertex.
#[inline]
fn connect(links: &mut [[u32; 3]], x: Half, y: Half) {
    links[x.face as usize][x.edge as usize] = link(x, y);
    links[y.face as usize][y.edge as usize] = link(y, x);
}

/// Closes the gap that a removed face left between its neighbours.
#[inline]
fn rejoin(links: &mut [[u32; 3]], outer: Option<Half>, inner: Option<Half>) {
    match (outer, inner) {
        (Some(o), Some(i)) => connect(links, o, i),
        (Some(h), None) | (None, Some(h)) => links[h.face as usize][h.edge as usize] = NONE,
        (None, None) => {}
    }
}

/// The edges of face `f` between its tip and the old vertex, seen from that, and between its tip and the new one, seen from that.
#[inline]
fn sides(f: u32, a: usize, vu_next: bool) -> (Half, Half) {
    let after = Half { face: f, edge: a as u32, starts: false };
    let before = Half { face: f, edge: previous(a) as u32, starts: true };
    if vu_next { (before, after) } else { (after, before) }
}

/// The wedges of vertex `vs` in the fan of `h`; without attributes, `vs`.
fn vertex_wedges(
    corners: &[[u32; 3]],
    links: &[[u32; 3]],
    attributed: bool,
    vs: u32,
    h: Option<Half>,
) -> Vec<u32> {
    let (Some(start), true) = (h.filter(|h| (h.face as usize) < corners.len()), attributed) else {
        return vec![vs];
    };
    let mut found = Vec::new();
    // Both ways round, so that a border does not hide a side.
    for mut half in [start, start.turn()] {
        for _ in 0..=corners.len() {
            let w = corners[half.face as usize][half.corner()];
            if !found.contains(&w) {
                found.push(w);
            }
            let exit = half.turn();
            match across(exit, links[exit.face as usize][exit.edge as usize]) {
                Some(n) if n.face != start.face && (n.face as usize) < corners.len() => half = n,
                _ => break,
            }
        }
    }
    found
}

/// An entry of [`super::WedgeStreams::explicit`].
struct Explicit {
    pairs: Vec<(u32, u32)>,
    changed: Vec<u32>,
    corners: Vec<[u32; 3]>,
    end: usize,
}

impl Explicit {
    fn read(stream: &[u32], at: usize, two_faces: bool) -> Option<Explicit> {
        let &[pairs, changed] = stream.get(at..at + 2)? else { return None };
        let (pairs, changed) = (pairs as usize, changed as usize);
        let sizes = [2 * pairs, changed, 3 * (1 + two_faces as usize)];
        let end = sizes.iter().try_fold(at + 2, |sum: usize, &n| sum.checked_add(n))?;
        let rest = stream.get(at + 2..end)?;
        let (p, rest) = rest.split_at(sizes[0]);
        let (c, k) = rest.split_at(changed);
        Some(Explicit {
            pairs: p.chunks_exact(2).map(|x| (x[0], x[1])).collect(),
            changed: c.to_vec(),
            corners: k.chunks_exact(3).map(|x| [x[0], x[1], x[2]]).collect(),
            end,
        })
    }
}

/// Appends point `i` of `from`.
#[inline]
fn copy(from: &Positions, i: usize, to: &mut Positions) {
    match (from, to) {
        (Positions::F32(a), Positions::F32(b)) => b.push(a[i]),
        (Positions::F64(a), Positions::F64(b)) => b.push(a[i]),
        _ => {}
    }
}

/// Point `k` of `to` becomes point `i` of `from`; false if there is none.
#[inline]
fn copy_to(from: &Positions, i: usize, to: &mut Positions, k: usize) -> bool {
    match (from, to) {
        (Positions::F32(a), Positions::F32(b)) if i < a.len() => b[k] = a[i],
        (Positions::F64(a), Positions::F64(b)) if i < a.len() => b[k] = a[i],
        _ => return false,
    }
    true
}

#[inline]
fn pop(p: &mut Positions) {
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
    same("errors", pm.splits.error.len(), n)?;
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
