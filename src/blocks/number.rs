//! Collapses of blocks as splits of one mesh.

use super::BuildError;
use crate::aif::Positions;
use crate::refine::ProgressiveMesh;
use crate::refine::format::stream::PathSplits;
use crate::refine::hierarchy::{Bounds, Guarantee};
use crate::refine::progressive::{Damage, SplitCode, SplitKind, SplitParts, Splits};
use crate::refine::view::NormalCone;
use crate::terrain::block::{Block, Collapse, NONE, Sheet, Vertex};
use glam::DVec3;
use std::sync::Arc;

/// The numbers, in the whole, of a sheet's vertices and faces.
#[derive(Clone, Debug, Default)]
pub(super) struct Numbers {
    pub vertices: Vec<u32>,
    pub faces: Vec<u32>,
}

impl Numbers {
    /// Those of the root's sheet.
    pub(super) fn of(root: &Sheet) -> Numbers {
        Numbers {
            vertices: (0..root.vertices.len() as u32).collect(),
            faces: (0..root.faces.len() as u32).collect(),
        }
    }
}

/// The mesh's coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// How long a step by a row and a unit of height are, in steps by a column.
    scale: [f64; 2],
    /// The greatest height in the mesh, without its sign.
    greatest: f64,
}

impl Frame {
    /// Of a grid with this greatest height, without its sign.
    pub(super) fn new(scale: [f64; 2], greatest: f64) -> Frame {
        Frame { scale, greatest: greatest * scale[1] }
    }

    /// What coordinates are multiples of, if heights are whole.
    pub(super) fn steps(&self) -> [f64; 3] {
        [1.0, self.scale[1], self.scale[0]]
    }

    /// For so many vertices. Columns and rows are exact either way.
    fn room(&self, vertices: usize) -> Positions {
        if self.scale[0] == 1.0 {
            Positions::F32(Vec::with_capacity(vertices))
        } else {
            Positions::F64(Vec::with_capacity(vertices))
        }
    }

    fn place(&self, v: Vertex, out: &mut Positions) {
        let p = [f64::from(v.x), f64::from(v.z) * self.scale[1], f64::from(v.y) * self.scale[0]];
        match out {
            Positions::F32(all) => all.push(p.map(|x| x as f32)),
            Positions::F64(all) => all.push(p),
        }
    }

    /// Where vertices are.
    pub(super) fn places(&self, all: &[Vertex]) -> Positions {
        let mut out = self.room(all.len());
        all.iter().for_each(|&v| self.place(v, &mut out));
        out
    }

    /// What rounding changes in heights at most, in the mesh.
    pub(super) fn rounding(&self) -> f64 {
        match self.room(0) {
            Positions::F32(_) if self.scale[1] == 1.0 => 0.0,
            Positions::F32(_) => self.greatest * f64::from(f32::EPSILON),
            // Of places in the plan, too.
            Positions::F64(_) => self.greatest * 1e-12,
        }
    }

    /// So much that no rounding of places in the mesh, nor of centres of bounds, is as large, for a grid of this size.
    pub(super) fn slack(&self, columns: usize, rows: usize) -> f64 {
        1e-6 * (columns as f64 + rows as f64 * self.scale[0] + 4.0 * self.greatest)
    }

    /// An error in the mesh: rounded up.
    fn error(&self, bound: f32) -> f32 {
        let e = f64::from(bound) * self.scale[1] + self.rounding();
        if f64::from(e as f32) < e { (e as f32).next_up() } else { e as f32 }
    }

    /// The base.
    pub(super) fn base(&self, root: &Sheet) -> ProgressiveMesh {
        ProgressiveMesh {
            base_faces: root.faces.iter().map(|&[a, b, c]| [a, c, b]).collect(),
            base_positions: self.places(&root.vertices),
            new_positions: self.room(0).into(),
            moved_positions: self.room(0).into(),
            ..ProgressiveMesh::default()
        }
    }
}

/// Splits in the making.
#[derive(Clone, Debug)]
pub(super) struct Assembly {
    frame: Frame,
    splits: Splits,
    places: Positions,
    /// Radii, and the least cosines of normals.
    round: Vec<[f32; 2]>,
    /// Vertices and faces so far.
    vertices: u32,
    faces: u32,
}

/// Faces that a progressive mesh can number.
pub(super) const MOST_FACES: u64 = 1 << 29;

/// In the mesh rows run towards the viewer, so faces turn the other way: their corners 1 and 2 are exchanged. The same of sides.
fn turned(side: u32) -> u32 {
    2 - side % 3
}

impl Assembly {
    /// Behind so many vertices and faces.
    pub(super) fn new(frame: Frame, vertices: u32, faces: u32) -> Self {
        Assembly { frame, splits: Splits::default(), places: frame.room(0), round: vec![], vertices, faces }
    }

    /// Appends the splits of a block, of whose sheet the numbers are given; returns those of the sheets it was joined of.
    pub(super) fn add(&mut self, block: &Block, left: &Numbers) -> Result<Vec<Numbers>, BuildError> {
        let new: u64 = u64::from(block.faces) - left.faces.len() as u64;
        let total = u64::from(self.faces) + new;
        if total >= MOST_FACES {
            return Err(BuildError::TooLarge(total));
        }
        let mut vertices = vec![NONE; block.vertices.len()];
        let mut faces = vec![NONE; block.faces as usize];
        block.vertices_left.iter().zip(&left.vertices).for_each(|(&v, &n)| vertices[v as usize] = n);
        block.faces_left.iter().zip(&left.faces).for_each(|(&f, &n)| faces[f as usize] = n);
        for c in block.collapses.iter().rev() {
            self.split(c, &vertices, &mut faces);
            self.frame.place(block.vertices[c.removed as usize], &mut self.places);
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
        let splits = &mut self.splits;
        splits.vertex.push(vertices[c.kept as usize]);
        splits.left.push(left_cut);
        splits.right.push(right.map_or(NONE, |w| cut(w.1, faces).0));
        splits.code.push(SplitCode::from(parts));
        splits.error.push(self.frame.error(c.bound));
        self.round.push([c.radius, c.upright]);
        for s in [Some(side), right.map(|w| w.0)].into_iter().flatten() {
            faces[s as usize / 3] = self.faces;
            self.faces += 1;
        }
    }

    /// The splits, with their bounds.
    pub(super) fn part(self) -> PathSplits {
        let bounds = self.round.iter().map(|&[radius, upright]| {
            (f64::from(radius), NormalCone::new(DVec3::Y, f64::from(upright).clamp(-1.0, 1.0).acos()))
        });
        PathSplits { bounds: bounds.collect(), splits: self.splits, positions: self.places }
    }

    /// The mesh that they make of a base.
    pub(super) fn mesh(self, base: ProgressiveMesh) -> Result<ProgressiveMesh, Damage> {
        let mut mesh = ProgressiveMesh { splits: self.splits, new_positions: self.places.into(), ..base };
        mesh.levels = vec![0, mesh.splits.len() as u32];
        mesh.levels.dedup();
        let errors: Vec<f64> = mesh.splits.error.iter().map(|&e| f64::from(e)).collect();
        let radii: Vec<f64> = self.round.iter().map(|r| f64::from(r[0])).collect();
        let bounds = Bounds::with_errors_within(&mesh, &errors, &radii, Guarantee::Vertical)?;
        mesh.bounds = Some(Arc::new(bounds));
        Ok(mesh)
    }
}
