//! The mesh of a view, as buffers and as a mesh.

use super::View;
use crate::Strips;
use crate::aif::{MeshInput, NONE, Positions, Wedges};
use glam::DVec3;
use std::borrow::Cow;

impl View {
    /// The index buffer: three wedges a slot. A slot without a face has three equal corners. Wedges are numbered as those of the progressive mesh at full
    /// detail, whatever is shown: they are stable slots of a vertex buffer.
    pub fn indices(&self) -> &[[u32; 3]] {
        self.front.corners()
    }

    /// The face of the progressive mesh in a slot of the index buffer; none in one that is free, or is not there.
    pub fn face_in(&self, slot: usize) -> Option<u32> {
        let there = u32::try_from(slot).ok().filter(|_| slot < self.front.corners().len())?;
        Some(self.front.face_in(&self.hierarchy.forest, there)).filter(|&f| f != NONE)
    }

    /// The slot of the index buffer that holds face `f` of the progressive mesh; `None` if it is not shown. Panics if there is no such face.
    pub fn slot_of(&self, f: u32) -> Option<usize> {
        assert!(
            (f as usize) < self.hierarchy.forest.faces(),
            "face {f} of {}",
            self.hierarchy.forest.faces()
        );
        Some(self.front.slot_of(&self.hierarchy.forest, f)).filter(|&s| s != NONE).map(|s| s as usize)
    }

    /// The slots of the faces across the three edges of the face in a slot, edge `k` from corner `k` to corner `k + 1`; `None` at borders and at edges of three and more
    /// faces. Panics if there is no such slot.
    pub fn neighbours(&self, slot: usize) -> [Option<usize>; 3] {
        [0, 1, 2].map(|k| self.front.across(slot as u32, k).map(|s| s as usize))
    }

    /// The vertex of a wedge that is shown. Panics if there is no such wedge.
    pub fn wedge_vertex(&self, w: u32) -> u32 {
        self.front.wedge_vertex(w)
    }

    /// Where vertex `v` stands, model units; `None` if it is not shown. Panics if there is no such vertex.
    pub fn position(&self, v: u32) -> Option<DVec3> {
        let h = &*self.hierarchy;
        // Which of its splits are applied is asked only where some move their vertices.
        let turns = || if h.forest.any_moves() { self.front.turns(&h.forest, v) } else { 0 };
        self.front.has(v).then(|| h.forest.place(h.mesh(), v, turns()))
    }

    /// The attribute values of a wedge, and the channels it has; empty if it is not shown, or without attributes.
    pub fn row(&self, w: u32) -> (Cow<'_, [f32]>, u64) {
        let row = self.front.wedge_row(w) as usize;
        match &self.hierarchy.mesh().wedges {
            Some(s) if row < s.present.len() => (s.rows.row(row, s.stride), s.present[row]),
            _ => (Cow::Borrowed(&[]), 0),
        }
    }

    /// [`View::to_input`] with some vertices elsewhere: `places` by vertex, ascending, rounded to the stored precision. Of a mesh at full detail the order is that of the splits
    /// then, unless `places` is empty. O(n).
    pub fn to_input_with(&self, places: &[(u32, DVec3)]) -> MeshInput {
        let mut out = self.input(places.is_empty(), |w| self.own_row(w));
        self.put(&mut out, places);
        out
    }

    pub(super) fn own_row(&self, w: u32) -> (Cow<'_, [f32]>, u64) {
        self.row(w)
    }

    /// Puts vertices elsewhere, ascending.
    pub(super) fn put(&self, out: &mut MeshInput, places: &[(u32, DVec3)]) {
        let shown = (0..self.hierarchy.mesh().vertices() as u32).filter(|&v| self.front.has(v));
        let mut next = places.iter().peekable();
        for (k, v) in shown.enumerate() {
            while next.next_if(|p| p.0 < v).is_some() {}
            let Some((_, p)) = next.next_if(|p| p.0 == v) else { continue };
            match &mut out.positions {
                Positions::F32(all) => all[k] = p.as_vec3().to_array(),
                Positions::F64(all) => all[k] = p.to_array(),
            }
        }
    }

    /// The faces shown as triangle strips over the wedges of [`View::indices`]. O(faces shown).
    pub fn strips(&self) -> Strips {
        Strips::new(self.indices())
    }

    /// The mesh as flat arrays: vertices, faces and wedges that are shown, numbered in the order of the progressive mesh. If every split is applied, this is
    /// [`crate::Cursor::to_ordered_input`] at full detail: the input, bit for bit. O(n).
    pub fn to_input(&self) -> MeshInput {
        self.input(true, |w| self.own_row(w))
    }

    /// [`View::to_input`] with such rows; `ordered`: full detail is in the input's order, with its own.
    pub(super) fn input<'a>(
        &self,
        ordered: bool,
        row_of: impl Fn(u32) -> (Cow<'a, [f32]>, u64),
    ) -> MeshInput {
        let pm = self.hierarchy.mesh();
        let forest = &self.hierarchy.forest;
        if ordered
            && pm.order.is_some()
            && self.vertex_count() == pm.vertices()
            && let Ok(mut cursor) = pm.cursor()
            && cursor.seek(usize::MAX).is_ok()
        {
            return cursor.to_ordered_input();
        }
        let positions = |p: &Positions| match p {
            Positions::F32(_) => Positions::F32(Vec::new()),
            Positions::F64(_) => Positions::F64(Vec::new()),
        };
        let mut out = MeshInput { positions: positions(&pm.base_positions), ..Default::default() };
        let mut vertex = vec![NONE; pm.vertices()];
        let mut count = 0;
        for (v, new) in vertex.iter_mut().enumerate() {
            let v = v as u32;
            if self.front.has(v) {
                forest.append_place(pm, v, self.front.turns(forest, v), &mut out.positions);
                *new = count;
                count += 1;
            }
        }
        let slots = 0..self.front.corners().len() as u32;
        let mut slots: Vec<(u32, u32)> =
            slots.map(|slot| (self.front.face_in(forest, slot), slot)).filter(|s| s.0 != NONE).collect();
        slots.sort_unstable();
        let corners = || slots.iter().flat_map(|&(_, s)| self.front.corners()[s as usize]);
        out.corners = corners().map(|w| vertex[self.front.wedge_vertex(w) as usize]).collect();
        let per_face = |values: &[u32]| {
            if values.is_empty() { Vec::new() } else { slots.iter().map(|s| values[s.0 as usize]).collect() }
        };
        (out.face_material, out.face_group) = (per_face(&pm.face_material), per_face(&pm.face_group));
        out.wires = pm.wires.iter().map(|w| w.map(|v| vertex[v as usize])).collect();
        if let Some(streams) = &pm.wedges
            && let Ok(mut wedges) = Wedges::new(streams.channels.clone())
        {
            let mut number = vec![NONE; pm.wedge_slots()];
            let mut used: Vec<u32> = corners().collect();
            used.sort_unstable();
            used.dedup();
            for &w in &used {
                let (row, present) = row_of(w);
                let new = wedges.push(&row, present);
                number[w as usize] = if present == 0 { NONE } else { new };
            }
            wedges.corner = corners().map(|w| number[w as usize]).collect();
            out.wedges = Some(wedges);
        }
        out
    }
}
