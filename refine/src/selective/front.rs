//! The mesh of a view: faces, links and what is applied; a split and its undoing, in any order that dependencies allow.

use crate::aif::NONE;
use crate::hierarchy::Forest;
use crate::progressive::{
    Damage, Explicit, Fans, Half, Opening, ProgressiveMesh, SplitKind, link_faces, seam_wedges,
};

/// A set of applied splits that is closed under dependencies, and the mesh it makes.
///
/// Faces live in slots of one index buffer; a slot that holds none has three equal corners and is used again.
#[derive(Clone, Debug)]
pub(crate) struct Front {
    fans: Fans,
    /// The face in every slot; [`NONE`] for none.
    face_in: Vec<u32>,
    /// The slot of every face; [`NONE`] where it is not in the mesh.
    slot_of: Vec<u32>,
    free: Vec<u32>,
    applied: Vec<u64>,
    /// The node that every vertex is at, among those in the mesh.
    node: Vec<u32>,
    wedge_vertex: Vec<u32>,
    /// The row of every wedge, among those in the mesh.
    wedge_row: Vec<u32>,
    vertices: usize,
    faces: usize,
    /// Slots whose corners changed, a bit each.
    pub(super) touched: Vec<u64>,
    /// Wedges that are new, moved, or have other values, maybe repeated.
    pub(super) touched_wedges: Vec<u32>,
}

impl Front {
    /// The base. The arrays of `pm` have been checked by a cursor.
    pub(crate) fn new(pm: &ProgressiveMesh, forest: &Forest) -> Front {
        let (n0, n) = (pm.base_vertices(), pm.splits.len());
        let (wedge_vertex, wedge_row) = match &pm.wedges {
            None => (Vec::new(), Vec::new()),
            Some(w) => {
                let mut vertex = w.base_vertex.clone();
                vertex.resize(pm.wedge_slots(), NONE);
                let rows = (0..w.base_vertex.len() as u32).collect::<Vec<_>>();
                let mut row = rows;
                row.resize(vertex.len(), NONE);
                (vertex, row)
            }
        };
        let links = if pm.wedges.is_some() {
            let faces: Vec<_> = pm.base_faces.iter().map(|f| f.map(|w| wedge_vertex[w as usize])).collect();
            link_faces(&faces, n0)
        } else {
            link_faces(&pm.base_faces, n0)
        };
        let m0 = pm.base_faces.len();
        let mut slot_of: Vec<u32> = (0..m0 as u32).collect();
        slot_of.resize(pm.faces(), NONE);
        let mut node: Vec<u32> = (0..n0 as u32).collect();
        node.resize(n0 + n, NONE);
        debug_assert_eq!(forest.len(), n);
        Front {
            fans: Fans { corners: pm.base_faces.clone(), links },
            face_in: (0..m0 as u32).collect(),
            slot_of,
            free: Vec::new(),
            applied: vec![0; n.div_ceil(64)],
            node,
            wedge_vertex,
            wedge_row,
            vertices: n0,
            faces: m0,
            touched: vec![0; m0.div_ceil(64)],
            touched_wedges: Vec::new(),
        }
    }

    /// Faces now.
    pub(crate) fn face_count(&self) -> usize {
        self.faces
    }

    /// Vertices now.
    pub(crate) fn vertex_count(&self) -> usize {
        self.vertices
    }

    /// The index buffer, free slots included.
    pub(crate) fn corners(&self) -> &[[u32; 3]] {
        &self.fans.corners
    }

    /// The face in every slot; [`NONE`] for none.
    pub(crate) fn face_in(&self) -> &[u32] {
        &self.face_in
    }

    /// The slot of face `f`.
    #[inline]
    pub(crate) fn slot_of(&self, f: u32) -> u32 {
        self.slot_of[f as usize]
    }

    /// The face across edge `k` of the face in a slot.
    pub(crate) fn across(&self, slot: u32, k: usize) -> Option<u32> {
        Some(self.fans.links[slot as usize][k]).filter(|&l| l != NONE).map(|l| l >> 3)
    }

    /// Split `i` is applied.
    #[inline]
    pub(crate) fn is_applied(&self, i: u32) -> bool {
        self.applied[i as usize / 64] >> (i % 64) & 1 != 0
    }

    /// A bit for every split: it is applied.
    pub(crate) fn applied_bits(&self) -> &[u64] {
        &self.applied
    }

    /// The node that vertex `v` is at; [`NONE`] if it is not in the mesh.
    #[inline]
    pub(crate) fn node(&self, v: u32) -> u32 {
        self.node[v as usize]
    }

    /// The vertex of wedge `w`, which is in the mesh.
    #[inline]
    pub(crate) fn wedge_vertex(&self, w: u32) -> u32 {
        if self.wedge_vertex.is_empty() { w } else { self.wedge_vertex[w as usize] }
    }

    /// The row of wedge `w`; [`NONE`] if it is not in the mesh, or without attributes.
    #[inline]
    pub(crate) fn wedge_row(&self, w: u32) -> u32 {
        self.wedge_row.get(w as usize).copied().unwrap_or(NONE)
    }

    /// Applies split `i`, whose dependencies are applied. `note` is told the row before of every row that changes a wedge. O(valence).
    ///
    /// Errors: damage; nothing has changed then. Of a hierarchy that was made whole there is none.
    pub(crate) fn split(
        &mut self,
        pm: &ProgressiveMesh,
        forest: &Forest,
        i: u32,
        mut note: Option<&mut Vec<u32>>,
    ) -> Result<(), Damage> {
        let k = i as usize;
        let (vs, code) = (pm.splits.vertex[k], pm.splits.code[k]);
        let vu = forest.base_vertices + i;
        let lost = |to| Damage::Reference { what: "split", at: k, to };
        let here = |cut: u32| match self.slot_of.get((cut >> 2) as usize) {
            Some(&s) if s != NONE => Ok(s << 2 | cut & 3),
            _ => Err(lost(cut)),
        };
        let right = if code.two_faces() { here(pm.splits.right[k])? } else { NONE };
        let gap = self.fans.find_gap(k, (here(pm.splits.left[k])?, right), code)?;
        let Some(seen_from) = gap.left.inner.or(gap.left.outer) else { return Err(Damage::Fan(k)) };
        let first = self.fans.wedge(seen_from);
        if self.wedge_vertex(first) != vs {
            return Err(Damage::Fan(k));
        }
        let rows = forest.rows.get(k).copied().unwrap_or_default();
        let w = if forest.rows.is_empty() { vu } else { rows.wedge };
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
                let Some(s) = &pm.wedges else { return Err(Damage::Fan(k)) };
                explicit = Explicit::read(&s.explicit, rows.explicit as usize, code.two_faces(), w)
                    .ok_or(Damage::Wedges(k))?;
                let of = |k: usize| explicit.corners.get(k).copied().unwrap_or_default();
                ([first; 2], explicit.new as u32, &explicit.changed, [of(0), of(1)])
            }
        };
        let changed = if code.changes_rows() { changed } else { &[] };
        if !self.wedge_row.is_empty() {
            for j in 0..new {
                self.wedge_vertex[(w + j) as usize] = vu;
                self.wedge_row[(w + j) as usize] = rows.row + j;
            }
            for (row, &c) in (rows.row + new..).zip(changed) {
                if let Some(note) = note.as_mut() {
                    note[row as usize] = self.wedge_row[c as usize];
                }
                self.wedge_row[c as usize] = row;
            }
            if code.kind() == SplitKind::Explicit {
                let moved = explicit.pairs.iter().filter(|p| p.0 == p.1);
                moved.for_each(|p| self.wedge_vertex[p.1 as usize] = vu);
                for (c, tip) in explicit.corners.iter().zip(tips) {
                    if c[0] >= w {
                        self.wedge_vertex[c[0] as usize] = vs;
                    }
                    if c[2] >= w && c[2] != NONE && tip != NONE {
                        self.wedge_vertex[c[2] as usize] = self.wedge_vertex[tip as usize];
                    }
                }
            }
        }
        self.touched_wedges.extend(w..w + new);
        self.touched_wedges.extend_from_slice(changed);
        if code.moves() {
            self.touch_vertex(vs, seen_from);
        }
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
        let face = forest.first_face(i);
        let fl = self.take_slot(face);
        let edge = self.fans.insert_at(fl, code.left(), corners[0], gap.left);
        if code.two_faces() {
            let fr = self.take_slot(face + 1);
            let other = self.fans.insert_at(fr, code.right(), corners[1], gap.right);
            self.fans.connect(edge, other);
        }
        let [old, fresh] = forest.nodes(i);
        (self.node[vs as usize], self.node[vu as usize]) = (old, fresh);
        self.vertices += 1;
        self.applied[k / 64] |= 1 << (k % 64);
        Ok(())
    }

    /// Undoes split `i`, which is applied, and on which nothing applied depends. O(valence).
    pub(crate) fn unsplit(&mut self, pm: &ProgressiveMesh, forest: &Forest, i: u32) {
        debug_assert!(self.is_applied(i));
        let k = i as usize;
        let (vs, code) = (pm.splits.vertex[k], pm.splits.code[k]);
        let vu = forest.base_vertices + i;
        let two = code.two_faces();
        let face = forest.first_face(i);
        let fl = self.slot_of[face as usize];
        let fr = if two { self.slot_of[face as usize + 1] } else { fl };
        let left = self.fans.opening_of(fl, code.left());
        let right = if two { self.fans.opening_of(fr, code.right()) } else { Opening::default() };
        let (x_l, y_l) = self.fans.ends_of(fl, code.left());
        let x_r = if two { self.fans.ends_of(fr, code.right()).0 } else { x_l };
        let rows = forest.rows.get(k).copied().unwrap_or_default();
        let explicit = match (code.kind(), &pm.wedges) {
            (SplitKind::Explicit, Some(s)) => {
                Explicit::read(&s.explicit, rows.explicit as usize, two, rows.wedge).unwrap_or_default()
            }
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
        self.leave_slot(face, fl);
        if two {
            self.leave_slot(face + 1, fr);
        }
        let changed = if code.changes_rows() { changed } else { &[] };
        if !self.wedge_row.is_empty() {
            let moved = explicit.pairs.iter().filter(|p| p.0 == p.1);
            moved.for_each(|p| self.wedge_vertex[p.1 as usize] = vs);
            for (row, &c) in (rows.row + new..).zip(changed) {
                self.wedge_row[c as usize] = forest.row_before[row as usize];
            }
            self.wedge_row[rows.wedge as usize..(rows.wedge + new) as usize].fill(NONE);
        }
        self.touched_wedges.extend_from_slice(changed);
        self.node[vs as usize] = forest.parent[k];
        self.node[vu as usize] = NONE;
        if code.moves()
            && let Some(h) = left.inner.or(left.outer)
        {
            self.touch_vertex(vs, h);
        }
        self.vertices -= 1;
        self.applied[k / 64] &= !(1 << (k % 64));
    }

    /// The slots of the faces around the vertex that `start` is seen from, each once.
    pub(crate) fn star(&self, start: Half, out: &mut Vec<u32>) {
        out.push(start.face);
        let mut at = start.turn();
        // The fan is a cycle, or ends at a border: then the other side as well.
        for _ in 0..self.fans.corners.len() {
            let Some(h) = self.fans.across(at) else { break };
            if h.face == start.face {
                return;
            }
            out.push(h.face);
            at = h.turn();
        }
        at = start;
        for _ in 0..self.fans.corners.len() {
            let Some(h) = self.fans.across(at).filter(|h| h.face != start.face) else { break };
            out.push(h.face);
            at = h.turn();
        }
    }

    /// The slots of the faces around the vertex of split `i`, whose dependencies are applied: those of the fan that it opens. O(valence).
    ///
    /// Errors: its left cut is not there.
    pub(crate) fn ring(&self, pm: &ProgressiveMesh, i: u32, out: &mut Vec<u32>) -> Result<(), Damage> {
        let cut = pm.splits.left[i as usize];
        let slot = self.slot_of.get((cut >> 2) as usize).copied().unwrap_or(NONE);
        if slot == NONE || cut & 3 == 3 {
            return Err(Damage::Reference { what: "split", at: i as usize, to: cut });
        }
        let starts = pm.splits.code[i as usize].left_starts();
        self.star(Half { face: slot, edge: cut & 3, starts }, out);
        Ok(())
    }

    /// The edge, seen from the old vertex and from the new one, between the faces that split `i` (applied) has made.
    pub(crate) fn middle(&self, pm: &ProgressiveMesh, forest: &Forest, i: u32) -> [Half; 2] {
        let fl = self.slot_of[forest.first_face(i) as usize];
        let (a, vu_next) = pm.splits.code[i as usize].left();
        let edge = (a as u32 + 1) % 3;
        [Half { face: fl, edge, starts: !vu_next }, Half { face: fl, edge, starts: vu_next }]
    }

    /// An edge at the old vertex of split `i` (applied) beside its left face, in a face that stays.
    pub(crate) fn beside(&self, pm: &ProgressiveMesh, forest: &Forest, i: u32) -> Option<Half> {
        let fl = self.slot_of[forest.first_face(i) as usize];
        let at = self.fans.opening_of(fl, pm.splits.code[i as usize].left());
        at.inner.or(at.outer)
    }

    fn touch_vertex(&mut self, v: u32, h: Half) {
        if self.wedge_row.is_empty() {
            self.touched_wedges.push(v);
        } else {
            self.touched_wedges.extend(self.fans.wedges_around(h));
        }
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

    /// A slot for face `f`.
    #[inline]
    fn take_slot(&mut self, f: u32) -> u32 {
        let slot = self.free.pop().unwrap_or_else(|| {
            self.fans.corners.push([NONE; 3]);
            self.fans.links.push([NONE; 3]);
            self.face_in.push(NONE);
            self.touched.resize(self.fans.corners.len().div_ceil(64), 0);
            (self.fans.corners.len() - 1) as u32
        });
        self.face_in[slot as usize] = f;
        self.slot_of[f as usize] = slot;
        self.faces += 1;
        self.touch(slot);
        slot
    }

    #[inline]
    fn leave_slot(&mut self, f: u32, slot: u32) {
        self.fans.corners[slot as usize] = [0; 3];
        self.fans.links[slot as usize] = [NONE; 3];
        self.face_in[slot as usize] = NONE;
        self.slot_of[f as usize] = NONE;
        self.free.push(slot);
        self.faces -= 1;
        self.touch(slot);
    }

    /// Bytes that grow with the mesh shown, and bytes that each view takes for the whole mesh.
    pub(crate) fn bytes(&self) -> (usize, usize) {
        let shown = 28 * self.fans.corners.len() + 4 * self.free.len() + 8 * self.touched.len();
        let tables = self.slot_of.len() + self.node.len() + self.wedge_vertex.len() + self.wedge_row.len();
        (shown, 4 * tables + 8 * self.applied.len())
    }
}
