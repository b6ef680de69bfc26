//! Meshes put together from the chunks of a file, and what was found on the way.

use super::base::MeshHead;
use super::codec::{self, Sequel};
use super::container::{Chunk, ChunkType, Directory, EXPANSION, FormatError};
use super::direct;
use super::input_order;
use super::places;
use super::read::Piece;
use super::splits::{self, SplitBlock};
use crate::hierarchy::Bounds;
use crate::progressive::{InputOrder, ProgressiveMesh};
use std::sync::Arc;

/// Meshes in the making: what the chunks so far make of them.
#[derive(Clone, Debug, Default)]
pub struct Assembly {
    meshes: Vec<Option<Part>>,
    turns: Vec<u32>,
    pub(super) scene: Option<Vec<u8>>,
    extras: Vec<(u32, Vec<u8>)>,
}

#[derive(Clone, Debug)]
struct Part {
    head: MeshHead,
    mesh: ProgressiveMesh,
    faces: usize,
    wedges: usize,
    /// As far as they were read.
    bounds: Option<Bounds>,
    /// Once splits were read with it.
    sequel: Option<Sequel>,
    /// Damage has ended it.
    void: bool,
    beside: Beside,
}

/// Chunks of a mesh that stand beside others, as far as there were any.
#[derive(Clone, Debug, Default)]
struct Beside {
    /// The page of the base.
    base: bool,
    /// Pages stand up to this split.
    paged: usize,
    terrain: bool,
}

impl Part {
    /// Appends splits; false (and nothing done) if they do not follow those that are there.
    fn append(&mut self, block: &SplitBlock) -> bool {
        let follows = block.first_face as usize == self.faces
            && (self.mesh.wedges.is_none() || block.first_wedge as usize == self.wedges)
            && self.mesh.splits.len() + block.splits.len() <= self.head.splits as usize
            && block.append_to(&mut self.mesh);
        if follows {
            self.faces += block.faces();
            self.wedges += block.new_wedges();
        }
        follows
    }

    /// Whether a page, or what the mesh is of a grid, stands where such a chunk must: then it has been noted.
    fn takes_beside(&mut self, chunk: &Chunk) -> bool {
        let (now, beside) = (self.mesh.splits.len(), &mut self.beside);
        match chunk.kind {
            ChunkType::PAGE if now == 0 => !std::mem::replace(&mut beside.base, true),
            ChunkType::PAGE => {
                let next = chunk.first as usize + chunk.count as usize == now && beside.paged < now;
                beside.paged = now;
                next
            }
            ChunkType::TERRAIN => now == 0 && !std::mem::replace(&mut beside.terrain, true),
            _ => true,
        }
    }

    /// The splits of a chunk that is read with the mesh.
    fn sequel(&mut self, chunk: &Chunk, bytes: &[u8]) -> Option<SplitBlock> {
        if self.sequel.is_none() && !self.mesh.splits.is_empty() {
            // Splits that were read alone came before.
            return None;
        }
        if chunk.first_face as usize != self.faces || chunk.first as usize != self.mesh.splits.len() {
            return None;
        }
        let state = match &mut self.sequel {
            Some(state) => state,
            none => none.insert(Sequel::new(&self.head, self.head.start.take()?)),
        };
        let at = (chunk.first, chunk.first_face);
        codec::read(&self.head, state, None, at, (chunk.count as usize, chunk.raw), bytes)
    }
}

impl Assembly {
    /// Nothing yet of the meshes of a file.
    pub fn new(directory: &Directory) -> Self {
        Assembly { meshes: vec![None; directory.meshes as usize], ..Default::default() }
    }

    /// The head of mesh `m`, once its base was added.
    pub fn head(&self, m: u32) -> Option<&MeshHead> {
        self.meshes.get(m as usize)?.as_ref().map(|p| &p.head)
    }

    /// Mesh `m` so far, once its base was added.
    pub fn mesh(&self, m: u32) -> Option<&ProgressiveMesh> {
        self.meshes.get(m as usize)?.as_ref().map(|p| &p.mesh)
    }

    /// Room for the splits of these chunks of a file of so many bytes, as far as those can hold them.
    pub(super) fn reserve(&mut self, chunks: &[Chunk], bytes: u64) {
        let mut counts = vec![(0, 0); self.meshes.len()];
        // A damaged directory may tell of chunks that overlap.
        let mut most = bytes.saturating_mul(EXPANSION);
        for chunk in chunks.iter().filter(|c| c.kind.is_splits()) {
            let (Some(count), Some(Some(part))) =
                (counts.get_mut(chunk.mesh as usize), self.meshes.get(chunk.mesh as usize))
            else {
                continue;
            };
            let Some(rest) = most.checked_sub(chunk.raw) else { break };
            most = rest;
            // What arrays take in memory is bounded by what is stored.
            let point = if part.head.double { 24 } else { 12 };
            let splits =
                (chunk.count as u64).min(chunk.raw / (18 + point)).min(part.head.splits as u64 - count.0);
            count.0 += splits;
            if part.head.channels.is_none() && !part.head.materials && !part.head.groups {
                count.1 += (chunk.raw - splits * (18 + point)) / point;
            }
        }
        self.turns.reserve_exact(counts.iter().map(|c| c.0 as usize).sum());
        for (part, (splits, moved)) in self.meshes.iter_mut().zip(counts) {
            if let Some(part) = part {
                let pm = &mut part.mesh;
                pm.splits.reserve(splits as usize);
                places::reserve(pm.new_positions.plain(), splits as usize);
                places::reserve(pm.moved_positions.plain(), moved as usize);
            }
        }
    }

    /// Adds what a chunk held. Chunks of a mesh must come in their order.
    ///
    /// Errors: what does not follow what came before. The meshes are unchanged then.
    pub fn add(&mut self, chunk: &Chunk, piece: Piece) -> Result<(), FormatError> {
        let part = self.meshes.get_mut(chunk.mesh as usize);
        match (piece, part) {
            (Piece::Base(both), Some(part @ None)) => {
                let (head, mesh) = *both;
                let (faces, wedges) = (head.base_faces as usize, head.base_wedges as usize);
                *part = Some(Part {
                    head,
                    mesh,
                    faces,
                    wedges,
                    bounds: None,
                    sequel: None,
                    void: false,
                    beside: Beside::default(),
                });
            }
            (Piece::Splits(block), Some(Some(part))) => {
                let follows = chunk.first as usize == part.mesh.splits.len();
                if !follows || part.sequel.is_some() || !part.append(&block) {
                    return Err(chunk.damage("its splits do not follow those before"));
                }
                self.turns.extend(std::iter::repeat_n(chunk.mesh, block.splits.len()));
            }
            (Piece::Sequel(bytes), Some(Some(part))) if !part.void => {
                let block = part.sequel(chunk, &bytes);
                match block.filter(|b| part.append(b)) {
                    Some(block) => self.turns.extend(std::iter::repeat_n(chunk.mesh, block.splits.len())),
                    None => {
                        part.void = true;
                        return Err(chunk.damage("its contents contradict each other, or what came before"));
                    }
                }
            }
            (Piece::Bounds(bounds), Some(Some(part))) => {
                let have = part.bounds.as_ref().map_or(0, Bounds::len);
                if chunk.first as usize != have || have + bounds.len() > part.mesh.splits.len() {
                    return Err(
                        chunk.damage("its splits are not there, or their bounds do not follow those before")
                    );
                }
                let follows = match &mut part.bounds {
                    Some(all) => all.append(&bounds),
                    none => none.replace(*bounds).is_none(),
                };
                if !follows {
                    return Err(chunk.damage("it does not go with the bounds before"));
                }
            }
            (Piece::Order(bytes), Some(Some(part))) if part.mesh.order.is_none() => {
                if part.mesh.splits.len() < part.head.splits as usize {
                    return Err(chunk.damage("it comes before the last split of its mesh"));
                }
                let read = input_order::read(&part.mesh, &bytes, chunk.raw);
                let (order, tips): (InputOrder, _) =
                    read.ok_or_else(|| chunk.damage("its contents contradict each other"))?;
                part.mesh.order = Some(order);
                input_order::turn(&mut part.mesh, &tips, false);
            }
            (Piece::Scene(bytes), _) if self.scene.is_none() => self.scene = Some(bytes),
            (Piece::Other(bytes), Some(_)) if chunk.kind == ChunkType::EXTRAS => {
                if self.extras.iter().any(|e| e.0 == chunk.mesh) {
                    return Err(chunk.damage("it does not follow what came before"));
                }
                self.extras.push((chunk.mesh, bytes));
            }
            (Piece::Other(_), Some(Some(part))) => {
                if !part.takes_beside(chunk) {
                    return Err(chunk.damage("it does not stand where it must, or is there twice"));
                }
            }
            (Piece::Other(_), Some(None)) if [ChunkType::PAGE, ChunkType::TERRAIN].contains(&chunk.kind) => {
                return Err(chunk.damage("the base of its mesh is not there"));
            }
            (Piece::Other(_), _) => {}
            _ => return Err(chunk.damage("it does not follow what came before")),
        }
        Ok(())
    }

    /// The meshes as they are, and what is known of their levels.
    pub(super) fn finish(self, directory: &Directory, damage: Option<FormatError>) -> Decoded {
        let mut report = Report { complete: damage.is_none(), ..Default::default() };
        report.streams.head = directory.bytes();
        let mut meshes = Vec::new();
        for part in self.meshes {
            let Some(part) = part else {
                // So that the others keep their numbers.
                meshes.push(ProgressiveMesh::default());
                report.quantisation_errors.push(0.0);
                report.flat_faces.push(0);
                report.complete = false;
                continue;
            };
            let mut pm = part.mesh;
            let n = pm.splits.len() as u32;
            pm.bounds = part.bounds.filter(|b| b.len() == n as usize).map(Arc::new);
            pm.levels = part.head.levels.iter().copied().filter(|&l| l < n).chain([n]).collect();
            pm.pack();
            report.quantisation_errors.push(part.head.quantisation_error);
            report.flat_faces.push(part.head.flat_faces);
            report.complete &= n == part.head.splits;
            meshes.push(pm);
        }
        report.damage = damage;
        Decoded { meshes, turns: self.turns, scene: self.scene, extras: self.extras, report }
    }
}

/// What a file held.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Decoded {
    /// The meshes. Of a damaged or cut off file, as much of them as is whole; empty ones in place of those without a base.
    pub meshes: Vec<ProgressiveMesh>,
    /// The mesh whose next split comes, coarsest first.
    pub turns: Vec<u32>,
    /// The scene, as it was given to [`super::encode`].
    pub scene: Option<Vec<u8>>,
    /// Meshes and their chunks of [`ChunkType::EXTRAS`], as they were given to [`super::encode`].
    pub extras: Vec<(u32, Vec<u8>)>,
    /// Sizes and losses.
    pub report: Report,
}

/// What was found while reading.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Every split of every mesh was there.
    pub complete: bool,
    /// The first damage.
    pub damage: Option<FormatError>,
    /// Chunks that were not used, in the order of the file: damaged, not there, or of no use without others that are.
    pub lost: Vec<Chunk>,
    /// By mesh: how far quantising moved a vertex at most, model units; 0 for none.
    pub quantisation_errors: Vec<f64>,
    /// By mesh: faces at full detail of which quantising put two corners at one place.
    pub flat_faces: Vec<u32>,
    /// Bytes in the file.
    pub streams: StreamSizes,
}

/// Bytes in a file by what they are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct StreamSizes {
    /// Head and directory.
    pub head: u64,
    /// Bases.
    pub base: u64,
    /// References and codes of splits.
    pub connectivity: u64,
    /// Errors of splits.
    pub errors: u64,
    /// Positions of splits.
    pub places: u64,
    /// Attributes of splits.
    pub attributes: u64,
    /// Materials and groups of the faces of splits.
    pub faces: u64,
    /// The input's order.
    pub order: u64,
    /// The scene.
    pub scene: u64,
    /// Bounds of splits.
    pub bounds: u64,
    /// All else.
    pub other: u64,
    /// Chunks of splits.
    pub chunks: u64,
}

impl StreamSizes {
    pub(super) fn add(&mut self, chunk: &Chunk, bytes: &[u8]) {
        match chunk.kind {
            ChunkType::BASE => self.base += chunk.stored,
            ChunkType::ORDER => self.order += chunk.stored,
            ChunkType::SCENE => self.scene += chunk.stored,
            ChunkType::BOUNDS => self.bounds += chunk.stored,
            ChunkType::DIRECT => {
                let [c, e, p] = direct::sizes(bytes).unwrap_or_default();
                self.connectivity += c;
                self.errors += e;
                self.places += p;
                self.other += chunk.stored.saturating_sub(c + e + p);
                self.chunks += 1;
            }
            ChunkType::SPLITS | ChunkType::SEQUEL => {
                let [c, e, p, a, f] = splits::sizes(bytes).unwrap_or_default();
                self.connectivity += c;
                self.errors += e;
                self.places += p;
                self.attributes += a;
                self.faces += f;
                self.other += chunk.stored.saturating_sub(c + e + p + a + f);
                self.chunks += 1;
            }
            _ => self.other += chunk.stored,
        }
    }

    /// All of them together: the size of the file.
    pub fn total(&self) -> u64 {
        self.head
            + self.base
            + self.connectivity
            + self.errors
            + self.places
            + self.attributes
            + self.faces
            + self.order
            + self.scene
            + self.bounds
            + self.other
    }
}
