//! Collapses of blocks as splits of one mesh.

use super::BuildError;
use crate::aif::Positions;
use crate::refine::ProgressiveMesh;
use crate::refine::hierarchy::{Bounds, Guarantee};
use crate::refine::progressive::{Damage, SplitCode, SplitKind, SplitParts};
use crate::terrain::block::{Block, Collapse, NONE, Sheet, Vertex};
use std::sync::Arc;

/// The numbers, in the whole, of a sheet's vertices and faces.
#[derive(Clone, Debug, Default)]
pub(super) struct Numbers {
    vertices: Vec<u32>,
    faces: Vec<u32>,
}

/// The mesh so far.
#[derive(Clone, Debug)]
pub(super) struct Assembly {
    pub mesh: ProgressiveMesh,
    radii: Vec<f32>,
    places: Vec<[f32; 3]>,
    /// Vertices and faces so far.
    vertices: u32,
    faces: u32,
}

/// Faces that a progressive mesh can number.
const MOST_FACES: u64 = 1 << 29;

/// x = column, y = height, z = row.
fn place(v: Vertex) -> [f32; 3] {
    // Whole numbers below 2^24.
    [v.x as f32, v.z, v.y as f32]
}

/// In the mesh rows run towards the viewer, so faces turn the other way: their corners 1 and 2 are exchanged. The same of sides.
fn turned(side: u32) -> u32 {
    2 - side % 3
}

impl Assembly {
    pub(super) fn new(root: &Sheet) -> (Self, Numbers) {
        let numbers = Numbers {
            vertices: (0..root.vertices.len() as u32).collect(),
            faces: (0..root.faces.len() as u32).collect(),
        };
        let mesh = ProgressiveMesh {
            base_faces: root.faces.iter().map(|&[a, b, c]| [a, c, b]).collect(),
            base_positions: Positions::F32(root.vertices.iter().map(|&v| place(v)).collect()),
            ..ProgressiveMesh::default()
        };
        let (vertices, faces) = (root.vertices.len() as u32, root.faces.len() as u32);
        (Assembly { mesh, radii: vec![], places: vec![], vertices, faces }, numbers)
    }

    /// Appends the splits of a block, of whose sheet the numbers are given; returns those of the sheets it was joined of.
    pub(super) fn add(&mut self, block: &Block, left: Numbers) -> Result<Vec<Numbers>, BuildError> {
        let new: u64 = u64::from(block.faces) - left.faces.len() as u64;
        let total = u64::from(self.faces) + new;
        if total >= MOST_FACES {
            return Err(BuildError::TooLarge(total));
        }
        let mut vertices = vec![NONE; block.vertices.len()];
        let mut faces = vec![NONE; block.faces as usize];
        block.vertices_left.iter().zip(left.vertices).for_each(|(&v, n)| vertices[v as usize] = n);
        block.faces_left.iter().zip(left.faces).for_each(|(&f, n)| faces[f as usize] = n);
        for c in block.collapses.iter().rev() {
            self.split(c, &vertices, &mut faces);
            self.places.push(place(block.vertices[c.removed as usize]));
            vertices[c.removed as usize] = self.vertices;
            self.vertices += 1;
        }
        let mut start = 0;
        let of_child = |c: &crate::terrain::block::Child| {
            let end = start + c.faces as usize;
            let numbers = Numbers {
                vertices: c.vertices.iter().map(|&v| vertices[v as usize]).collect(),
                faces: faces[start..end].to_vec(),
            };
            start = end;
            numbers
        };
        Ok(block.children.iter().map(of_child).collect())
    }

    fn split(&mut self, c: &Collapse, vertices: &[u32], faces: &mut [u32]) {
        // What was left is right now.
        let wing = |k: usize| (c.wings[k] != NONE).then(|| (c.wings[k], c.beside[k]));
        let (left, right) = match (wing(1), wing(0)) {
            (None, Some(w)) => (Some((w, false)), None),
            (left, right) => (left.map(|w| (w, true)), right),
        };
        let number = |side: u32, faces: &[u32]| faces[side as usize / 3] << 2 | turned(side);
        // The later of the faces on a cut, and whether it is the one that goes to the new vertex.
        let cut = |[kept, removed]: [u32; 2], faces: &[u32]| {
            let known = |s: u32| (s != NONE).then(|| number(s, faces));
            match (known(kept), known(removed)) {
                (Some(k), Some(r)) if r >> 2 > k >> 2 => (r, true),
                (Some(k), _) => (k, false),
                (None, r) => (r.unwrap_or(NONE), true),
            }
        };
        let tip = |side: u32| (turned(side) as usize + 2) % 3;
        let ((side, beside), on_left) = left.unwrap_or(((0, [NONE; 2]), true));
        let (left_cut, left_inner) = cut(beside, faces);
        // The face beside begins the side at the vertex: on the left the one at the vertex kept, on the right the other.
        let parts = SplitParts {
            left: (tip(side), !on_left),
            right: right.map(|w| (tip(w.0), true)),
            left_inner,
            left_starts: left_inner != on_left,
            right_inner: right.is_some_and(|w| cut(w.1, faces).1),
            left_tip_inner: false,
            right_tip_inner: false,
            kind: SplitKind::Plain,
            moves: false,
            changes_rows: false,
        };
        let splits = &mut self.mesh.splits;
        splits.vertex.push(vertices[c.kept as usize]);
        splits.left.push(left_cut);
        splits.right.push(right.map_or(NONE, |w| cut(w.1, faces).0));
        splits.code.push(SplitCode::from(parts));
        splits.error.push(c.bound);
        self.radii.push(c.radius);
        for s in [Some(side), right.map(|w| w.0)].into_iter().flatten() {
            faces[s as usize / 3] = self.faces;
            self.faces += 1;
        }
    }

    pub(super) fn finish(mut self) -> Result<ProgressiveMesh, Damage> {
        self.mesh.new_positions = Positions::F32(self.places);
        self.mesh.levels = vec![0, self.mesh.splits.len() as u32];
        self.mesh.levels.dedup();
        let errors: Vec<f64> = self.mesh.splits.error.iter().map(|&e| f64::from(e)).collect();
        let radii: Vec<f64> = self.radii.iter().map(|&r| f64::from(r)).collect();
        let bounds = Bounds::with_errors_within(&self.mesh, &errors, &radii, Guarantee::Vertical)?;
        self.mesh.bounds = Some(Arc::new(bounds));
        Ok(self.mesh)
    }
}
