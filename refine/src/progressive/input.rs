//! How the input numbered its elements, so that full detail is the input bit for bit.

use super::{Cursor, ProgressiveMesh};
use crate::aif::{MeshInput, NONE, Positions, Wedges};
use rustc_hash::FxHashMap;
use std::borrow::Cow;
use std::ops::Deref;

/// The input's numbering, and what triangles do not tell of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InputOrder {
    /// Vertex slot -> vertex of the input.
    pub vertex: Vec<u32>,
    /// Face slot -> face of the input, after cutting polygons into triangles.
    pub face: Vec<u32>,
    /// The polygons, if the input had any with more than three corners.
    pub polygons: Option<Polygons>,
    /// Wedge slot at full detail -> wedge of the input ([`NONE`]: no attributes).
    pub wedge: Vec<u32>,
    /// Corners of the input whose wedge is not what `wedge` says, and what it is.
    pub corner_wedges: Vec<(u32, u32)>,
    /// Wedges of the input that differ in bits from what the splits bring (the sign of a zero).
    pub rows: Vec<(u32, u64)>,
    /// The values of `rows`, row after row.
    pub values: Vec<f32>,
}

/// Polygons made of triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygons {
    /// Corners of every polygon.
    pub sizes: Vec<u32>,
    /// Every polygon corner as a corner of the triangles (`3 * face + corner`).
    pub corners: Vec<u32>,
}

/// A corner at full detail, as (face slot, corner), and the wedge of the input that it has there.
pub(crate) type Correction = (usize, usize, u32);

impl InputOrder {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let polygons = self.polygons.as_ref().map_or(0, |p| p.sizes.len() + p.corners.len());
        4 * (self.vertex.len() + self.face.len() + self.wedge.len() + self.values.len() + polygons)
            + 8 * self.corner_wedges.len()
            + 16 * self.rows.len()
    }

    /// The arrays are as long as those of `pm` ask for.
    pub(super) fn fits(&self, pm: &ProgressiveMesh) -> bool {
        self.vertex.len() == pm.vertices()
            && self.face.len() == pm.faces()
            && self.wedge.len() == if self.wedge.is_empty() { 0 } else { pm.wedge_slots() }
    }

    /// Finds every polygon corner among the corners of the polygon's triangles.
    pub(super) fn note_polygons(&mut self, input: &MeshInput, triangles: &MeshInput, face_map: &[u32]) {
        let Some(sizes) = &input.face_sizes else { return };
        let wedge = |m: &MeshInput, c: usize| m.wedges.as_ref().map_or(NONE, |w| w.corner[c]);
        let (mut corners, mut at, mut t) = (Vec::with_capacity(input.corners.len()), 0, 0);
        for (f, &size) in sizes.iter().enumerate() {
            let first = t;
            while t < face_map.len() && face_map[t] as usize == f {
                t += 1;
            }
            let mut from = 3 * first;
            for c in at..at + size as usize {
                let range = 3 * first..3 * t;
                let same = |&k: &usize| {
                    triangles.corners[k] == input.corners[c]
                        && same_wedge(triangles, wedge(triangles, k), input, wedge(input, c))
                };
                // Mostly the next corner is near the last.
                let found = (from..range.end).find(same).or_else(|| range.clone().find(same));
                let found = found.unwrap_or(range.start);
                corners.push(found as u32);
                from = found;
            }
            at += size as usize;
        }
        self.polygons = Some(Polygons { sizes: sizes.clone(), corners });
    }

    /// The slot of every face of the input.
    fn face_slots(&self) -> Vec<u32> {
        let mut slot = vec![0; self.face.len()];
        self.face.iter().enumerate().for_each(|(s, &f)| slot[f as usize] = s as u32);
        slot
    }

    /// Where the triangles' corners that make the input's corners are in the index buffer at full detail, one after the other.
    fn corner_slots(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let slot = self.face_slots();
        let n = self.polygons.as_ref().map_or(3 * slot.len(), |p| p.corners.len());
        (0..n).map(move |c| {
            let c = self.polygons.as_ref().map_or(c, |p| p.corners[c] as usize);
            (slot[c / 3] as usize, c % 3)
        })
    }

    /// Compares the wedges of `full`, the triangles at full detail, with the input's; `slot` is the slot of every wedge of `full`.
    pub(super) fn note_wedges(&mut self, full: &Wedges, slot: &[u32], input: &Wedges) {
        const UNSEEN: u32 = NONE - 1;
        let slots = slot.iter().filter(|s| **s != NONE).count();
        if self.polygons.is_none()
            && is_part_of(input, full)
            && slot[..input.len()].iter().all(|s| *s != NONE)
        {
            // Nothing differs, but that the input has no wedges that were made to tell others apart: and then no corner has them.
            self.wedge = vec![NONE; slots];
            (0u32..).zip(&slot[..input.len()]).for_each(|(w, &s)| self.wedge[s as usize] = w);
            return;
        }
        let mut of_slot = vec![UNSEEN; slots];
        let mut source = vec![NONE; input.len()];
        let mut others = Vec::new();
        let mut note = |c: usize, w: u32, m: u32| {
            let of = &mut of_slot[slot[m as usize] as usize];
            if *of != w {
                if *of == UNSEEN {
                    *of = w;
                } else {
                    others.push((c as u32, w));
                }
            }
            if let Some(source) = source.get_mut(w as usize) {
                *source = m;
            }
        };
        let corners = input.corner.iter().enumerate();
        match &self.polygons {
            None => corners.zip(&full.corner).for_each(|((c, &w), &m)| note(c, w, m)),
            Some(p) => corners.zip(&p.corners).for_each(|((c, &w), &k)| note(c, w, full.corner[k as usize])),
        }
        self.corner_wedges.append(&mut others);
        self.wedge = of_slot.into_iter().map(|w| if w == UNSEEN { NONE } else { w }).collect();
        for (w, &m) in source.iter().enumerate() {
            let row = input.row(w as u32);
            let same = m != NONE
                && full.present(m) == input.present(w as u32)
                && full.row(m).iter().zip(row).all(|(a, b)| a.to_bits() == b.to_bits());
            if !same {
                self.rows.push((w as u32, input.present(w as u32)));
                self.values.extend_from_slice(row);
            }
        }
    }
}

/// All wedges of `part` are those of `all`, bit for bit, and at the same corners.
fn is_part_of(part: &Wedges, all: &Wedges) -> bool {
    // All of them, without a branch for each.
    let bits = part.rows().iter().zip(all.rows()).fold(0, |d, (a, b)| d | (a.to_bits() ^ b.to_bits()));
    part.len() <= all.len()
        && bits == 0
        && part.corner == all.corner
        && (0..part.len() as u32).all(|w| part.present(w) == all.present(w))
}

fn same_wedge(a: &MeshInput, x: u32, b: &MeshInput, y: u32) -> bool {
    match (&a.wedges, &b.wedges) {
        (Some(a), Some(b)) if x != NONE && y != NONE => {
            a.present(x) == b.present(y)
                && a.row(x).iter().zip(b.row(y)).all(|(p, q)| p.to_bits() == q.to_bits())
        }
        _ => (x == NONE) == (y == NONE),
    }
}

impl<P: Deref<Target = ProgressiveMesh>> Cursor<P> {
    /// The mesh as flat arrays in the input's numbering, as far as its elements are there: vertices and faces keep the input's order among
    /// themselves. At full detail this is the input bit for bit, polygons included; elsewhere, triangles. Without
    /// [`ProgressiveMesh::order`], as [`Cursor::to_input`]. O(n log n).
    pub fn to_ordered_input(&self) -> MeshInput {
        let pm = self.source();
        let plain = self.to_input();
        let Some(order) = &pm.order else { return plain };
        let full = self.position() == pm.splits.len();
        // Slots in the order of the input.
        let sorted = |of: &[u32], n: usize| {
            let mut slots: Vec<u32> = (0..n as u32).collect();
            slots.sort_unstable_by_key(|&s| of.get(s as usize).copied().unwrap_or(NONE));
            slots
        };
        let vertices = sorted(&order.vertex, self.vertex_count());
        let faces = sorted(&order.face, self.face_count());
        let mut vertex = vec![0; vertices.len()];
        vertices.iter().enumerate().for_each(|(new, &s)| vertex[s as usize] = new as u32);
        let per_face = |values: &[u32]| -> Vec<u32> {
            if values.is_empty() { Vec::new() } else { faces.iter().map(|&f| values[f as usize]).collect() }
        };
        let corner_slots = || faces.iter().flat_map(|&f| (0..3).map(move |k| 3 * f as usize + k));
        let mut out = MeshInput {
            positions: plain.positions.gather(&vertices),
            corners: corner_slots().map(|c| vertex[plain.corners[c] as usize]).collect(),
            wires: plain.wires.iter().map(|w| w.map(|v| vertex[v as usize])).collect(),
            face_material: per_face(&plain.face_material),
            face_group: per_face(&plain.face_group),
            ..Default::default()
        };
        if let Some(w) = &plain.wedges {
            out.wedges = if full {
                self.input_wedges(order, w)
            } else {
                number_by_first_use(w, corner_slots().map(|c| w.corner[c]).collect())
            };
        }
        if let Some(p) = order.polygons.as_ref().filter(|_| full) {
            restore_polygons(&mut out, p);
        }
        out
    }

    /// The input's face of every face of [`Cursor::to_ordered_input`], ascending: at full detail their numbers, elsewhere of every triangle the face it was, or was cut from. `None` without
    /// [`ProgressiveMesh::order`]. O(n log n).
    pub fn input_faces(&self) -> Option<Vec<u32>> {
        let order = self.source().order.as_ref()?;
        let mut faces: Vec<u32> = order.face.get(..self.face_count())?.to_vec();
        faces.sort_unstable();
        let Some(p) = &order.polygons else { return Some(faces) };
        if self.position() == self.source().splits.len() {
            return Some((0..p.sizes.len() as u32).collect());
        }
        // A polygon of n corners was cut into n - 2 triangles, which follow each other.
        let mut of = Vec::with_capacity(order.face.len());
        for (k, &n) in (0u32..).zip(&p.sizes) {
            let room = order.face.len() - of.len();
            of.extend(std::iter::repeat_n(k, (n.saturating_sub(2) as usize).min(room)));
        }
        faces.iter().map(|&f| of.get(f as usize).copied()).collect()
    }

    /// At full detail: the corners (face slot, corner) that have other attributes in the input than splits bring, each with its wedge there; and the input's wedges. Splits leave out the sign of a zero, and
    /// where wedges end that were one. O(n).
    pub(crate) fn corrections(&self) -> Option<(Wedges, Vec<Correction>)> {
        let pm = self.source();
        let order = pm.order.as_ref().filter(|o| o.fits(pm) && self.position() == pm.splits.len())?;
        if order.rows.is_empty() && order.corner_wedges.is_empty() {
            return None;
        }
        let wedges = self.input_wedges(order, self.to_input().wedges.as_ref()?)?;
        let same = |s: u32, w: u32| match w {
            NONE => self.present(s) == 0,
            _ => {
                self.present(s) == wedges.present(w)
                    && self.row(s).iter().zip(wedges.row(w)).all(|(a, b)| a.to_bits() == b.to_bits())
            }
        };
        let corner = match &order.polygons {
            None => Cow::Borrowed(&wedges.corner[..]),
            Some(p) => Cow::Owned(self.triangle_wedges(order, p, &wedges)),
        };
        let corners = order.face_slots().into_iter().flat_map(|f| (0..3).map(move |k| (f as usize, k)));
        let others = corners.zip(corner.iter()).filter(|&((f, k), &w)| !same(self.indices()[f][k], w));
        let others = others.map(|((f, k), &w)| (f, k, w)).collect();
        Some((wedges, others))
    }

    /// The wedges of the polygons' corners, by corners of their triangles. O(n).
    fn triangle_wedges(&self, order: &InputOrder, p: &Polygons, wedges: &Wedges) -> Vec<u32> {
        let faces = order.face_slots();
        let slot = |c: usize| self.indices()[faces[c / 3] as usize][c % 3];
        let mut out = vec![NONE; 3 * faces.len()];
        let (mut of_slot, mut of_vertex): (FxHashMap<u32, u32>, FxHashMap<u32, u32>) = Default::default();
        let (mut at, mut first) = (0, 0);
        for &size in &p.sizes {
            // A polygon of n corners was cut into n - 2 triangles, which follow each other. Of their corners n are named; the others are the same by
            // their slot, or at least at the same vertex.
            let named = at..at + size as usize;
            let named = p.corners[named.clone()].iter().map(|&c| c as usize).zip(&wedges.corner[named]);
            let end = out.len().min(first + 3 * (size as usize).saturating_sub(2));
            // Clearing takes as long as the largest polygon was.
            if of_slot.capacity() > 64 + 8 * size as usize {
                (of_slot, of_vertex) = Default::default();
            }
            of_slot.clear();
            of_vertex.clear();
            for (c, &w) in named.clone() {
                of_slot.insert(slot(c), w);
                of_vertex.insert(self.wedge_vertex(slot(c)), w);
            }
            for (c, out) in out[first..end].iter_mut().enumerate() {
                let s = slot(first + c);
                let same = of_slot.get(&s).or_else(|| of_vertex.get(&self.wedge_vertex(s)));
                *out = same.copied().unwrap_or(NONE);
            }
            named.for_each(|(c, &w)| out[c] = w);
            (at, first) = (at + size as usize, end);
        }
        out
    }

    /// The wedges of the input; `have` holds those of full detail, by slot.
    fn input_wedges(&self, order: &InputOrder, have: &Wedges) -> Option<Wedges> {
        let slots: Vec<u32> = order.corner_slots().map(|(f, k)| self.indices()[f][k]).collect();
        let mut corner: Vec<u32> = slots.iter().map(|&s| order.wedge[s as usize]).collect();
        for &(c, w) in &order.corner_wedges {
            corner[c as usize] = w;
        }
        let count = corner.iter().filter(|w| **w != NONE).max().map_or(0, |&w| w as usize + 1);
        let mut source = vec![NONE; count];
        for (&s, &w) in slots.iter().zip(&corner) {
            if w != NONE {
                source[w as usize] = s;
            }
        }
        let patches: FxHashMap<u32, usize> = order.rows.iter().enumerate().map(|(k, r)| (r.0, k)).collect();
        let mut out = Wedges::new(have.channels().to_vec()).ok()?;
        let stride = out.stride();
        let nothing = vec![0.0; stride];
        for (w, &s) in source.iter().enumerate() {
            match patches.get(&(w as u32)) {
                Some(&k) => out.push(&order.values[k * stride..(k + 1) * stride], order.rows[k].1),
                None if s != NONE => out.push(have.row(s), have.present(s)),
                // A number that no corner has: only in a damaged order.
                None => out.push(&nothing, 0),
            };
        }
        out.corner = corner;
        Some(out)
    }
}

/// Wedges that corners have, numbered by first use.
fn number_by_first_use(w: &Wedges, mut corner: Vec<u32>) -> Option<Wedges> {
    let mut out = Wedges::new(w.channels().to_vec()).ok()?;
    let mut new = vec![NONE; w.len()];
    for c in corner.iter_mut().filter(|c| **c != NONE) {
        let n = &mut new[*c as usize];
        if *n == NONE {
            *n = out.push(w.row(*c), w.present(*c));
        }
        *c = *n;
    }
    out.corner = corner;
    Some(out)
}

/// Triangles become the polygons they were cut from.
fn restore_polygons(out: &mut MeshInput, p: &Polygons) {
    let mut first = Vec::with_capacity(p.sizes.len());
    let mut at = 0;
    for &size in &p.sizes {
        first.push(p.corners.get(at).map_or(0, |&c| c as usize / 3));
        at += size as usize;
    }
    let per_face = |values: &[u32]| -> Vec<u32> {
        if values.is_empty() { Vec::new() } else { first.iter().map(|&f| values[f]).collect() }
    };
    out.face_material = per_face(&out.face_material);
    out.face_group = per_face(&out.face_group);
    out.corners = p.corners.iter().map(|&c| out.corners[c as usize]).collect();
    out.face_sizes = Some(p.sizes.clone());
}

/// True if both hold the same bits.
pub fn same_positions(a: &Positions, b: &Positions) -> bool {
    match (a, b) {
        (Positions::F32(a), Positions::F32(b)) => {
            a.len() == b.len()
                && a.as_flattened().iter().zip(b.as_flattened()).all(|(x, y)| x.to_bits() == y.to_bits())
        }
        (Positions::F64(a), Positions::F64(b)) => {
            a.len() == b.len()
                && a.as_flattened().iter().zip(b.as_flattened()).all(|(x, y)| x.to_bits() == y.to_bits())
        }
        _ => false,
    }
}
