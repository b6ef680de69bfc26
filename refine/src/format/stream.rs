//! Progressive meshes of any size to a file, part by part.
//!
//! Where the splits of a mesh come as a tree of parts, each of which needs nothing but itself and the parts above it (the blocks of a terrain), chunks are written with no more in memory than the parts
//! on the way from the root down to one of them. A [`Path`] is that way: [`Path::push`] puts the splits of a part into the order of a file and codes them, [`Path::pop`], when all
//! below it has been written, the links to what follows. The file is the same as any other: readers do not know.

mod order;
mod part;

pub use part::{PathSplits, Renumbered, Written};

use self::part::Open;
use super::base::{self, MeshHead};
use super::codec::Start;
use super::container::{Chunk, ChunkType, Directory};
use super::lattice;
use super::pages;
use super::write::{Part, part};
use crate::aif::{NONE, Positions};
use crate::hierarchy::{Cone, Guarantee, Packed};
use crate::progressive::ProgressiveMesh;
use glam::DVec3;
use rustc_hash::FxHashMap;

/// What is true of all of a mesh that is written part by part.
#[derive(Clone, Debug)]
pub struct Tree {
    head: MeshHead,
    base: ProgressiveMesh,
    about: (DVec3, f64),
    guarantee: Guarantee,
    /// Of coordinates, by axis.
    steps: [f64; 3],
    chunk: usize,
}

impl Tree {
    /// A mesh of this base, without attributes, and of so many splits; `like` are places such as theirs, by which those of the base are coded ([`Tree::with_steps`] is for those of splits). Bounds are about the middle of the box around the finest mesh's
    /// vertices, whose diagonal is known too. `None` if the base refers to what is not there, or has attributes.
    pub fn new(
        base: ProgressiveMesh,
        like: &Positions,
        splits: u32,
        about: (DVec3, f64),
        guarantee: Guarantee,
    ) -> Option<Tree> {
        let plain = base.wedges.is_none() && base.face_material.is_empty() && base.face_group.is_empty();
        if !plain || !base.splits.vertex.is_empty() || like.is_f64() != base.base_positions.is_f64() {
            return None;
        }
        let probe = ProgressiveMesh { new_positions: like.clone().into(), ..ProgressiveMesh::default() };
        let n0 = base.base_vertices() as u32;
        let mut levels = vec![0, splits];
        levels.dedup();
        let head = MeshHead {
            splits,
            base_vertices: n0,
            base_faces: base.base_faces.len() as u32,
            base_wedges: n0,
            wires: base.wires.len() as u32,
            double: base.base_positions.is_f64(),
            lattices: lattice::find(&probe),
            levels,
            start: Start::new(&base)?,
            ..MeshHead::default()
        };
        Some(Tree { head, base, about, guarantee, steps: [1.0; 3], chunk: CHUNK })
    }

    /// Chunks of at most so many splits, but for those of a single vertex.
    #[must_use]
    pub fn with_chunk(mut self, splits: usize) -> Tree {
        self.chunk = splits.max(1);
        self
    }

    /// Coordinates are mostly whole multiples of these, or such of what fits into an f32: then they take few bytes. Each is kept whatever it is.
    #[must_use]
    pub fn with_steps(mut self, steps: [f64; 3]) -> Tree {
        self.steps = steps;
        self
    }

    /// The beginning of the file, up to its first split: head and directory, the base, the scene, and chunks of other kinds. The bytes of `chunks` are to follow, in this order; `single` are the splits of the
    /// file that make one face only. `path` is at the base, and everything has been written.
    ///
    /// `None` if the chunks do not follow each other.
    pub fn begin(
        &self,
        path: &Path<'_>,
        mut single: Vec<u32>,
        mut chunks: Vec<Chunk>,
        scene: &[u8],
        others: &[(ChunkType, Vec<u8>)],
    ) -> Option<Vec<u8>> {
        single.sort_unstable();
        let head = MeshHead { single, ..self.head.clone() };
        let (mut next, mut band, mut subtree) = (0u32, 0, 0);
        for c in &mut chunks {
            if c.kind == ChunkType::DIRECT {
                if c.first != next {
                    return None;
                }
                subtree = if c.band == band && next > 0 { subtree + 1 } else { 0 };
                (next, band) = (next + c.count, c.band);
                c.first_face = head.first_face(c.first);
            }
            c.subtree = subtree;
        }
        if next != head.splits || !path.parts.is_empty() {
            return None;
        }
        let bytes = base::write(&head, &mut self.base.clone())?;
        let mut first = vec![part(ChunkType::BASE, true, 0, base::raw_bytes(&head), bytes)];
        first[0].chunk.count = head.base_vertices;
        let bounds = path.vertices.iter().map(|v| (v.next.split, v.next.bounds)).collect();
        let links = AtBase { of: &path.vertices, bounds };
        let (bytes, raw) = pages::write_base(&head, self.about, false, &links)?;
        let mut page = part(ChunkType::PAGE, false, 0, raw, bytes);
        (page.chunk.count, page.chunk.first_face) = (head.base_vertices, head.base_wedges);
        first.push(page);
        if !scene.is_empty() {
            first.push(part(ChunkType::SCENE, false, u32::MAX, scene.len() as u64, scene.to_vec()));
        }
        first.extend(
            others.iter().map(|(kind, bytes)| part(*kind, false, 0, bytes.len() as u64, bytes.clone())),
        );
        let all = first.iter().map(|p| p.chunk).chain(chunks).collect();
        let mut out = Directory { meshes: 1, chunks: all }.write();
        first.iter().for_each(|p: &Part| out.extend_from_slice(&p.bytes));
        Some(out)
    }
}

/// Splits of a chunk. With 16,384 the fast lemniscate over generated terrain of 4,097 x 4,097 decodes 687,000 splits instead of 570,000, and the longest frame takes half as long again or twice as long; with 2,048 the longest is shorter by a quarter, and all frames take as long. Files are as large.
const CHUNK: usize = 4096;

const NO_BOUNDS: Packed = Packed { error: 0, radius: 0, cone: Cone(0) };

/// The split that comes next at a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Next {
    split: u32,
    bounds: Packed,
}

impl Next {
    /// None comes.
    pub const NOTHING: Next = Next { split: NONE, bounds: NO_BOUNDS };
}

/// A vertex of the path.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    /// The last split of it, or that which made it.
    last: u32,
    /// The node it is at, by numbers in the file.
    node: u32,
    /// What comes next below the part on top.
    next: Next,
}

/// The mesh that the parts from the root down to one of them make. See the [module](self).
#[derive(Clone, Debug)]
pub struct Path<'a> {
    tree: &'a Tree,
    /// As though the mesh ended here.
    head: MeshHead,
    mesh: ProgressiveMesh,
    /// Which corner of each face that splits make was the tip; they are turned so that it is the first.
    tips: Vec<u8>,
    vertices: Vec<Vertex>,
    /// For every part its first split, here and in the file.
    names: Vec<[u32; 2]>,
    parts: Vec<Open>,
}

impl<'a> Path<'a> {
    /// At the base.
    pub fn new(tree: &'a Tree) -> Path<'a> {
        let vertex = |node| Vertex { last: NONE, node, next: Next::NOTHING };
        let vertices = (0..tree.head.base_vertices).map(vertex).collect();
        let head = MeshHead { splits: 0, ..tree.head.clone() };
        Path { tree, head, mesh: tree.base.clone(), tips: vec![], vertices, names: vec![], parts: vec![] }
    }

    /// Vertices of the mesh.
    pub fn vertices(&self) -> u32 {
        self.vertices.len() as u32
    }

    /// Splits on the way.
    fn splits(&self) -> u32 {
        self.mesh.splits.len() as u32
    }

    /// Faces of the mesh.
    pub fn faces(&self) -> u32 {
        self.head.base_faces + self.tips.len() as u32
    }

    /// What comes next at vertex `v` below the part on top, as far as it has been written. Panics if there is no such vertex.
    pub fn next(&self, v: u32) -> Next {
        self.vertices[v as usize].next
    }

    /// The same to another path, on which it was written. Panics if there is no such vertex.
    pub fn set_next(&mut self, v: u32, next: Next) {
        self.vertices[v as usize].next = next;
    }
}

/// Links of the base: what comes next at its vertices.
struct AtBase<'a> {
    of: &'a [Vertex],
    bounds: FxHashMap<u32, Packed>,
}

impl pages::Source for AtBase<'_> {
    fn parent(&self, _: u32) -> u32 {
        NONE
    }

    fn next(&self, node: u32) -> u32 {
        self.of[node as usize].next.split
    }

    fn bounds(&self, i: u32) -> Packed {
        self.bounds.get(&i).copied().unwrap_or(NO_BOUNDS)
    }
}
