//! A file back to progressive meshes: whole, as a stream, and by ranges of bytes.

use super::base::{self, MeshHead};
use super::container::{Chunk, ChunkType, Directory, FormatError, HEAD};
use super::input_order;
use super::sequel::{self, Sequel};
use super::splits::{self, SplitBlock};
use crate::progressive::{InputOrder, ProgressiveMesh};
use std::io::Read;
use std::ops::Range;

/// What a chunk held.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Piece {
    /// A mesh begins: its head, and the mesh without splits.
    Base(Box<(MeshHead, ProgressiveMesh)>),
    /// Splits of a mesh.
    Splits(Box<SplitBlock>),
    /// Bytes of splits that are read with the mesh they refine ([`Assembly`]).
    Sequel(Vec<u8>),
    /// Bytes of the input's order of a mesh; they are read with the mesh ([`Assembly`]).
    Order(Vec<u8>),
    /// The scene, opaque here.
    Scene(Vec<u8>),
    /// A kind of chunk this version does not know, or has no use for.
    Other(Vec<u8>),
}

/// Reads one chunk, whose bytes are given. `head` is that of its mesh; only chunks of splits need it.
fn read_piece(chunk: &Chunk, head: Option<&MeshHead>, bytes: &[u8]) -> Result<Piece, FormatError> {
    chunk.check(bytes)?;
    let damaged = || chunk.damage("its contents contradict each other");
    match chunk.kind {
        ChunkType::BASE => {
            let (head, pm) = base::read(bytes, chunk.raw)
                .filter(|(h, _)| h.base_vertices == chunk.count)
                .ok_or_else(damaged)?;
            Ok(Piece::Base(Box::new((head, pm))))
        }
        ChunkType::SPLITS => {
            let head = head.ok_or_else(|| chunk.damage("the base of its mesh is not known"))?;
            let at = (chunk.first, chunk.first_face);
            let block = splits::read(head, at, chunk.count as usize, chunk.raw, bytes).ok_or_else(damaged)?;
            Ok(Piece::Splits(Box::new(block)))
        }
        ChunkType::SEQUEL => Ok(Piece::Sequel(bytes.to_vec())),
        ChunkType::ORDER => Ok(Piece::Order(bytes.to_vec())),
        ChunkType::SCENE if chunk.raw != chunk.stored => Err(damaged()),
        ChunkType::SCENE => Ok(Piece::Scene(bytes.to_vec())),
        _ => Ok(Piece::Other(bytes.to_vec())),
    }
}

/// Meshes in the making: what the chunks so far make of them.
#[derive(Clone, Debug, Default)]
pub struct Assembly {
    meshes: Vec<Option<Part>>,
    turns: Vec<u32>,
    scene: Option<Vec<u8>>,
}

#[derive(Clone, Debug)]
struct Part {
    head: MeshHead,
    mesh: ProgressiveMesh,
    faces: usize,
    wedges: usize,
    /// Once splits were read with it.
    sequel: Option<Sequel>,
    /// Damage has ended it.
    void: bool,
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

    /// The splits of a chunk that is read with the mesh.
    fn sequel(&mut self, chunk: &Chunk, bytes: &[u8]) -> Option<SplitBlock> {
        if self.sequel.is_none() && !self.mesh.splits.is_empty() {
            // Splits that were read alone came before.
            return None;
        }
        let state = match &mut self.sequel {
            Some(state) => state,
            none => none.insert(Sequel::new(&self.head, &self.mesh)?),
        };
        let at = (chunk.first, chunk.first_face);
        sequel::read(&self.head, state, at, chunk.count as usize, chunk.raw, bytes)
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

    /// Adds what a chunk held. Chunks of a mesh must come in their order.
    ///
    /// Errors: what does not follow what came before. The meshes are unchanged then.
    pub fn add(&mut self, chunk: &Chunk, piece: Piece) -> Result<(), FormatError> {
        let part = self.meshes.get_mut(chunk.mesh as usize);
        match (piece, part) {
            (Piece::Base(both), Some(part @ None)) => {
                let (head, mesh) = *both;
                let (faces, wedges) = (head.base_faces as usize, head.base_wedges as usize);
                *part = Some(Part { head, mesh, faces, wedges, sequel: None, void: false });
            }
            (Piece::Splits(block), Some(Some(part))) => {
                if part.sequel.is_some() || !part.append(&block) {
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
            (Piece::Other(_), _) => {}
            _ => return Err(chunk.damage("it does not follow what came before")),
        }
        Ok(())
    }

    /// The meshes as they are, and what is known of their levels.
    fn finish(self, directory: &Directory, damage: Option<FormatError>) -> Decoded {
        let mut report = Report { complete: damage.is_none(), ..Default::default() };
        report.streams.head = directory.bytes();
        let mut meshes = Vec::new();
        for part in self.meshes.into_iter().flatten() {
            let mut pm = part.mesh;
            let n = pm.splits.len() as u32;
            pm.levels = part.head.levels.iter().copied().filter(|&l| l < n).chain([n]).collect();
            report.quantisation_errors.push(part.head.quantisation_error);
            report.flat_faces.push(part.head.flat_faces);
            report.complete &= n == part.head.splits;
            meshes.push(pm);
        }
        report.damage = damage;
        Decoded { meshes, turns: self.turns, scene: self.scene, report }
    }
}

/// What a file held.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Decoded {
    /// The meshes. Of a damaged or cut off file, as much of them as came before the damage.
    pub meshes: Vec<ProgressiveMesh>,
    /// The mesh whose next split comes, coarsest first.
    pub turns: Vec<u32>,
    /// The scene, as it was given to [`super::encode`].
    pub scene: Option<Vec<u8>>,
    /// Sizes and losses.
    pub report: Report,
}

/// What was found while reading.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Every split of every mesh was there.
    pub complete: bool,
    /// What ended the reading before the end of the file.
    pub damage: Option<FormatError>,
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
    /// All else.
    pub other: u64,
    /// Chunks of splits.
    pub chunks: u64,
}

impl StreamSizes {
    fn add(&mut self, chunk: &Chunk, bytes: &[u8]) {
        match chunk.kind {
            ChunkType::BASE => self.base += chunk.stored,
            ChunkType::ORDER => self.order += chunk.stored,
            ChunkType::SCENE => self.scene += chunk.stored,
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
            + self.other
    }
}

/// Reads a whole file.
///
/// Errors: damage of any kind; [`decode_prefix`] returns what came before it. O(n).
pub fn decode(bytes: &[u8]) -> Result<Decoded, FormatError> {
    let decoded = decode_prefix(bytes)?;
    match &decoded.report.damage {
        Some(damage) => Err(damage.clone()),
        None => Ok(decoded),
    }
}

/// Reads as much of a file as is there and undamaged; [`Report::damage`] says why it ended early, if it did.
///
/// Errors: damage of head or directory.
pub fn decode_prefix(bytes: &[u8]) -> Result<Decoded, FormatError> {
    let length = Directory::length(&bytes[..bytes.len().min(HEAD)])?;
    let directory = Directory::read(&bytes[..bytes.len().min(length)])?;
    let mut assembly = Assembly::new(&directory);
    let mut sizes = StreamSizes::default();
    let mut damage = None;
    let slice = |c: &Chunk| {
        let end = c.range().end.min(bytes.len() as u64) as usize;
        &bytes[(c.offset as usize).min(end)..end]
    };
    // Bases first, as every other chunk needs them; then all others by themselves; then all together.
    let (bases, others): (Vec<&Chunk>, _) = directory.chunks.iter().partition(|c| c.kind == ChunkType::BASE);
    let mut failed_at = u32::MAX;
    let mut note = |chunk: &Chunk, e: FormatError| {
        if chunk.index < failed_at {
            failed_at = chunk.index;
            damage = Some(e);
        }
    };
    for chunk in bases {
        let read = read_piece(chunk, None, slice(chunk)).and_then(|p| assembly.add(chunk, p));
        match read {
            Ok(()) => sizes.add(chunk, slice(chunk)),
            Err(e) => note(chunk, e),
        }
    }
    let pieces = super::each(others, |c| (c, read_piece(c, assembly.head(c.mesh), slice(c))));
    for (chunk, piece) in pieces {
        match piece.and_then(|p| assembly.add(chunk, p)) {
            Ok(()) => sizes.add(chunk, slice(chunk)),
            Err(e) => {
                note(chunk, e);
                break;
            }
        }
    }
    if damage.is_none() && bytes.len() as u64 > directory.file_bytes() {
        damage = Some(FormatError::Head("the file is longer than it says"));
    }
    let mut decoded = assembly.finish(&directory, damage);
    sizes.head = directory.bytes();
    decoded.report.streams = sizes;
    Ok(decoded)
}

/// Reads a file as it arrives: the directory, then chunk after chunk.
///
/// Reads no byte more than it needs for what it returns, from a reader that may deliver them in pieces of any size.
#[derive(Debug)]
pub struct PmReader<R> {
    from: R,
    directory: Directory,
    next: usize,
    assembly: Assembly,
    sizes: StreamSizes,
    damage: Option<FormatError>,
}

impl<R: Read> PmReader<R> {
    /// Reads head and directory.
    ///
    /// Errors: damage there; the source's.
    pub fn new(mut from: R) -> Result<Self, FormatError> {
        let mut head = Vec::new();
        take_exactly(&mut from, HEAD as u64, &mut head)?;
        let length = Directory::length(&head)?;
        take_exactly(&mut from, (length - HEAD) as u64, &mut head)?;
        let directory = Directory::read(&head)?;
        let sizes = StreamSizes { head: directory.bytes(), ..Default::default() };
        let assembly = Assembly::new(&directory);
        Ok(PmReader { from, directory, next: 0, assembly, sizes, damage: None })
    }

    /// The directory.
    pub fn directory(&self) -> &Directory {
        &self.directory
    }

    /// Reads the next chunk and adds it to the meshes; returns it, or `None` at the end.
    ///
    /// Errors: damage, which names the chunk; the source's. What came before stays, and further calls return the same.
    pub fn advance(&mut self) -> Result<Option<Chunk>, FormatError> {
        if let Some(e) = &self.damage {
            return Err(e.clone());
        }
        let Some(&chunk) = self.directory.chunks.get(self.next) else { return Ok(None) };
        let result = self.read_chunk(&chunk);
        match result {
            Ok(()) => {
                self.next += 1;
                Ok(Some(chunk))
            }
            Err(e) => {
                self.damage = Some(e.clone());
                Err(e)
            }
        }
    }

    fn read_chunk(&mut self, chunk: &Chunk) -> Result<(), FormatError> {
        let mut bytes = Vec::new();
        take_exactly(&mut self.from, chunk.stored, &mut bytes)?;
        let piece = read_piece(chunk, self.assembly.head(chunk.mesh), &bytes)?;
        self.assembly.add(chunk, piece)?;
        self.sizes.add(chunk, &bytes);
        Ok(())
    }

    /// Mesh `m` as far as it was read; `None` before its base.
    pub fn mesh(&self, m: u32) -> Option<&ProgressiveMesh> {
        self.assembly.mesh(m)
    }

    /// The scene, once it was read.
    pub fn scene(&self) -> Option<&[u8]> {
        self.assembly.scene.as_deref()
    }

    /// What was read so far.
    pub fn finish(self) -> Decoded {
        let complete = self.next == self.directory.chunks.len();
        let mut decoded = self.assembly.finish(&self.directory, self.damage);
        decoded.report.complete &= complete;
        decoded.report.streams = self.sizes;
        decoded
    }
}

/// Reads `n` bytes, or as many as there are: the memory it takes is that of what arrives.
fn take_exactly(from: &mut impl Read, n: u64, to: &mut Vec<u8>) -> Result<(), FormatError> {
    from.take(n).read_to_end(to)?;
    Ok(())
}

/// A file that can be read by ranges, such as one on a server.
pub trait ByteRanges {
    /// The bytes of a range; fewer if the file ends before.
    ///
    /// Errors: the source's.
    fn fetch(&self, range: Range<u64>) -> std::io::Result<Vec<u8>>;
}

impl ByteRanges for [u8] {
    fn fetch(&self, range: Range<u64>) -> std::io::Result<Vec<u8>> {
        let end = range.end.min(self.len() as u64) as usize;
        let start = range.start.min(end as u64) as usize;
        Ok(self[start..end].to_vec())
    }
}

impl<T: ByteRanges + ?Sized> ByteRanges for &T {
    fn fetch(&self, range: Range<u64>) -> std::io::Result<Vec<u8>> {
        (**self).fetch(range)
    }
}

/// Reads chunks of a file in any order.
#[derive(Clone, Debug)]
pub struct RangeReader<S> {
    source: S,
    directory: Directory,
}

impl<S: ByteRanges> RangeReader<S> {
    /// Reads head and directory, in two requests.
    ///
    /// Errors: damage there; the source's.
    pub fn new(source: S) -> Result<Self, FormatError> {
        let mut head = source.fetch(0..HEAD as u64)?;
        let length = Directory::length(&head)? as u64;
        head.extend(source.fetch(HEAD as u64..length)?);
        let directory = Directory::read(&head)?;
        Ok(RangeReader { source, directory })
    }

    /// The directory.
    pub fn directory(&self) -> &Directory {
        &self.directory
    }

    /// The chunk at place `index` of the directory. `head` is that of its mesh, for chunks of splits; the base's chunk has it.
    ///
    /// Errors: no such chunk, damage, the source's.
    pub fn read(&self, index: u32, head: Option<&MeshHead>) -> Result<Piece, FormatError> {
        let chunk = self.directory.chunks.get(index as usize).ok_or(FormatError::Head("no such chunk"))?;
        read_piece(chunk, head, &self.source.fetch(chunk.range())?)
    }

    /// The base of mesh `m`.
    ///
    /// Errors: no such mesh, damage, the source's.
    pub fn base(&self, m: u32) -> Result<(MeshHead, ProgressiveMesh), FormatError> {
        let of = |c: &&Chunk| c.kind == ChunkType::BASE && c.mesh == m;
        let chunk = self.directory.chunks.iter().find(of).ok_or(FormatError::Head("no such mesh"))?;
        match self.read(chunk.index, None)? {
            Piece::Base(both) => Ok(*both),
            _ => Err(chunk.damage("it is no base")),
        }
    }
}
