//! The mesh of a view, as buffers and as a mesh.

use super::TrulyView;
use crate::aif::{MeshInput, NONE, Positions, Wedges};
use crate::selective::Changes;
use glam::DVec3;
use std::collections::HashMap;

impl TrulyView {
    /// The index buffer: three vertices a slot, by their numbers at full detail. A slot without a face has three equal corners.
    pub fn indices(&self) -> &[[u32; 3]] {
        self.mesh.corners()
    }

    /// The face of the progressive mesh in a slot of the index buffer; none in one that is free, or is not there.
    pub fn face_in(&self, slot: usize) -> Option<u32> {
        self.mesh.face_in().get(slot).copied().filter(|&f| f != NONE)
    }

    /// Where vertex `v` stands, model units; `None` if it is not shown. Panics if there is no such vertex.
    pub fn position(&self, v: u32) -> Option<DVec3> {
        (self.mesh.node(v) != NONE).then(|| self.mesh.position(&self.hierarchy, v))
    }

    /// What changed in the index buffer since this was last called, or since the view was made, and which vertices are new or moved (in place of wedges). O(slots / 64 + changes).
    pub fn take_changes(&mut self) -> Changes {
        let now = self.mesh.corners().len();
        Changes::take(&mut self.mesh.touched, &mut self.mesh.moved, &mut self.slots_before, now)
    }

    /// The mesh as flat arrays: vertices and faces that are shown, numbered in the order of the progressive mesh; wedges in the order of the faces. If every split is applied, this is
    /// [`crate::Cursor::to_ordered_input`] at full detail: the input, bit for bit. O(n).
    ///
    /// A corner has the wedge that it has at full detail, or what that came of where the split that made it is not applied.
    pub fn to_input(&self) -> MeshInput {
        let pm = self.hierarchy.mesh();
        if pm.order.is_some()
            && self.vertex_count() == pm.vertices()
            && let Ok(mut cursor) = pm.cursor()
            && cursor.seek(usize::MAX).is_ok()
        {
            return cursor.to_ordered_input();
        }
        let empty = match &pm.base_positions {
            Positions::F32(_) => Positions::F32(Vec::new()),
            Positions::F64(_) => Positions::F64(Vec::new()),
        };
        let mut out = MeshInput { positions: empty, ..Default::default() };
        let mut vertex = vec![NONE; pm.vertices()];
        let mut count = 0;
        for (v, new) in vertex.iter_mut().enumerate() {
            if let Some(p) = self.position(v as u32) {
                // Back to what it is stored as.
                match &mut out.positions {
                    Positions::F32(all) => all.push(p.as_vec3().to_array()),
                    Positions::F64(all) => all.push(p.to_array()),
                }
                *new = count;
                count += 1;
            }
        }
        let all = (0u32..).zip(self.mesh.face_in()).filter(|(_, f)| **f != NONE);
        let mut slots: Vec<(u32, u32)> = all.map(|(slot, &f)| (f, slot)).collect();
        slots.sort_unstable();
        let corners = slots.iter().flat_map(|&(_, s)| self.mesh.corners()[s as usize]);
        out.corners = corners.map(|v| vertex[v as usize]).collect();
        let per_face = |values: &[u32]| {
            if values.is_empty() { Vec::new() } else { slots.iter().map(|s| values[s.0 as usize]).collect() }
        };
        (out.face_material, out.face_group) = (per_face(&pm.face_material), per_face(&pm.face_group));
        out.wires = pm.wires.iter().map(|w| w.map(|v| vertex[v as usize])).collect();
        if let (Some(streams), Some(pieces)) = (&pm.wedges, &self.pieces.wedges)
            && let Ok(mut wedges) = Wedges::new(streams.channels.clone())
        {
            let applied = |i: u32| self.mesh.is_applied(i);
            let mut number: HashMap<u32, u32> = HashMap::new();
            for (f, k) in slots.iter().flat_map(|s| (0..3).map(move |k| (s.0, k))) {
                let w = pieces.wedge(f, k, applied);
                let row = pieces.row(w, applied) as usize;
                let present = streams.present[row];
                let values = streams.rows.row(row, streams.stride);
                let new = *number.entry(w).or_insert_with(|| wedges.push(&values, present));
                wedges.corner.push(if present == 0 { NONE } else { new });
            }
            out.wedges = Some(wedges);
        }
        out
    }
}
