//! The mesh of a paged view, as buffers and as a mesh.

use super::PagedView;
use super::pool::APPLIED;
use crate::Strips;
use crate::aif::{MeshInput, NONE, Positions, Wedges};
use crate::format::ByteRanges;
use crate::selective::take_runs;
use glam::DVec3;
use rustc_hash::FxHashMap;
use std::ops::Range;

impl<S: ByteRanges> PagedView<S> {
    /// The index buffer: three wedges a slot. A slot without a face has three equal corners. Wedges are numbered as those of the progressive mesh at full detail.
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.drawing.canvas.fans.corners
    }

    /// The face of the progressive mesh in a slot of the index buffer; none in one that is free, or is not there.
    pub fn face_in(&self, slot: usize) -> Option<u32> {
        let slot =
            u32::try_from(slot).ok().filter(|&s| (s as usize) < self.drawing.canvas.fans.corners.len())?;
        let Some(k) = slot.checked_sub(self.shelf.head.base_faces) else { return Some(slot) };
        let h = self.shelf.pool.get(k / 2).filter(|h| h.flags & APPLIED != 0)?;
        (k % 2 == 0 || h.code.two_faces()).then(|| self.shelf.head.first_face(h.split) + k % 2)
    }

    /// The slots of the faces across the three edges of the face in a slot; `None` at borders, at edges of three and more faces, and where there is no face.
    pub fn neighbours(&self, slot: usize) -> [Option<usize>; 3] {
        let links = self.drawing.canvas.fans.links.get(slot).copied().unwrap_or([NONE; 3]);
        links.map(|l| Some((l >> 3) as usize).filter(|_| l != NONE))
    }

    /// The vertex of a wedge that is shown.
    pub fn wedge_vertex(&self, w: u32) -> u32 {
        self.shelf.wedge_vertex(w)
    }

    /// Where vertex `v` stands, model units; `None` if it is not shown.
    pub fn position(&self, v: u32) -> Option<DVec3> {
        if v as usize >= self.full_vertices() {
            return None;
        }
        let node = Some(self.shelf.node(v)).filter(|&k| k != NONE)?;
        self.shelf.position(node).ok()
    }

    /// The vertices shown, ascending. O(vertices shown, and splits of resident pages / 64).
    pub fn vertices(&self) -> impl Iterator<Item = u32> + '_ {
        let n0 = self.shelf.head.base_vertices;
        let made = self.shelf.all().flat_map(move |p| p.vertices().map(move |i| n0 + i));
        (0..n0).chain(made)
    }

    /// The splits that are applied, ascending.
    pub fn applied_splits(&self) -> impl Iterator<Item = u32> + '_ {
        let n0 = self.shelf.head.base_vertices;
        self.vertices().filter_map(move |v| v.checked_sub(n0))
    }

    /// Runs of slots of the index buffer that changed since this was last called, ascending (a few unchanged ones between two may be in), and how many wedges are new or
    /// have other values, at most.
    pub fn take_changes(&mut self) -> (Vec<Range<usize>>, usize) {
        let canvas = &mut self.drawing.canvas;
        (take_runs(&mut canvas.touched), std::mem::take(&mut canvas.touched_wedges))
    }

    /// The faces shown as triangle strips over the wedges of [`PagedView::indices`]. Takes memory of its own beside the limit. O(faces shown).
    pub fn strips(&self) -> Strips {
        Strips::new(self.indices())
    }

    /// The mesh as flat arrays: vertices, faces and wedges that are shown, numbered in the order of the file. Takes memory of its own beside the limit. O(shown, and resident
    /// pages).
    pub fn to_input(&self) -> MeshInput {
        self.to_input_with(&[])
    }

    /// [`PagedView::to_input`] with some vertices elsewhere: `places` by vertex, ascending, rounded to the stored precision.
    pub fn to_input_with(&self, places: &[(u32, DVec3)]) -> MeshInput {
        let base = &self.shelf.base.mesh;
        let mut out = MeshInput {
            positions: match &base.base_positions {
                Positions::F32(_) => Positions::F32(Vec::new()),
                Positions::F64(_) => Positions::F64(Vec::new()),
            },
            ..Default::default()
        };
        let mut number: FxHashMap<u32, u32> = FxHashMap::default();
        let mut next = places.iter().peekable();
        for v in self.vertices() {
            while next.next_if(|p| p.0 < v).is_some() {}
            let elsewhere = next.next_if(|p| p.0 == v).map(|p| p.1);
            let at = elsewhere.or_else(|| self.position(v)).unwrap_or_default();
            match &mut out.positions {
                // They are stored so: but for those elsewhere nothing is rounded.
                Positions::F32(p) => p.push(at.as_vec3().to_array()),
                Positions::F64(p) => p.push(at.to_array()),
            }
            number.insert(v, number.len() as u32);
        }
        let mut slots: Vec<(u32, u32)> = (0..self.drawing.canvas.fans.corners.len())
            .filter_map(|s| Some((self.face_in(s)?, s as u32)))
            .collect();
        slots.sort_unstable();
        let corners = || slots.iter().flat_map(|&(_, s)| self.drawing.canvas.fans.corners[s as usize]);
        let of = |v: u32| number.get(&v).copied().unwrap_or(0);
        out.corners = corners().map(|w| of(self.shelf.wedge_vertex(w))).collect();
        if self.shelf.head.materials {
            out.face_material = slots.iter().map(|s| self.per_face(s.0, false)).collect();
        }
        if self.shelf.head.groups {
            out.face_group = slots.iter().map(|s| self.per_face(s.0, true)).collect();
        }
        out.wires = base.wires.iter().map(|w| w.map(of)).collect();
        if let Some(channels) = &self.shelf.head.channels
            && let Ok(mut wedges) = Wedges::new(channels.clone())
        {
            let mut used: Vec<u32> = corners().collect();
            used.sort_unstable();
            used.dedup();
            let mut numbers: FxHashMap<u32, u32> = FxHashMap::default();
            let width: usize = channels.iter().map(|c| c.width).sum();
            for w in used {
                let (row, present) = self.shelf.row(self.shelf.wedge_row(w));
                let zeros = vec![0.0; width];
                let new = wedges.push(if row.len() == width { &row } else { &zeros }, present);
                numbers.insert(w, if present == 0 { NONE } else { new });
            }
            wedges.corner = corners().map(|w| numbers.get(&w).copied().unwrap_or(NONE)).collect();
            out.wedges = Some(wedges);
        }
        out
    }

    /// The material or the group of a face.
    fn per_face(&self, f: u32, group: bool) -> u32 {
        let base = &self.shelf.base.mesh;
        let (values, at) = match self.shelf.head.maker(f).and_then(|(i, _)| self.shelf.page(i)) {
            Some((p, _)) => (if group { &p.group } else { &p.material }, f.wrapping_sub(p.first_face)),
            None => (if group { &base.face_group } else { &base.face_material }, f),
        };
        values.get(at as usize).copied().unwrap_or(NONE)
    }
}
