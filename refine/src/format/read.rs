//! A file back to progressive meshes: whole, as a stream, and by ranges of bytes.

use super::assembly::{Assembly, Decoded, StreamSizes};
use super::base::{self, MeshHead};
use super::bounds;
use super::codec::{self, Room, Sequel};
use super::container::{Chunk, ChunkType, Directory, FormatError, HEAD};
use super::direct;
use super::splits::SplitBlock;
use crate::hierarchy::Bounds;
use crate::progressive::ProgressiveMesh;
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
    /// Bounds of splits of a mesh: those from [`Chunk::first`] on.
    Bounds(Box<Bounds>),
    /// Bytes of the input's order of a mesh; they are read with the mesh ([`Assembly`]).
    Order(Vec<u8>),
    /// The scene, opaque here.
    Scene(Vec<u8>),
    /// A kind of chunk this version does not know, or has no use for.
    Other(Vec<u8>),
}

/// What is said of contents that the checksum is right for and that are wrong all the same.
pub(crate) const CONTRADICTS: &str = "its contents contradict each other";

/// Reads one chunk, whose bytes are given. `head` is that of its mesh; only chunks of splits need it.
pub(crate) fn read_piece(chunk: &Chunk, head: Option<&MeshHead>, bytes: &[u8]) -> Result<Piece, FormatError> {
    read_piece_within(chunk, head, bytes, Room::ANY)
}

/// The same with no more room for what a chunk of splits takes on the way.
pub(crate) fn read_piece_within(
    chunk: &Chunk,
    head: Option<&MeshHead>,
    bytes: &[u8],
    room: Room,
) -> Result<Piece, FormatError> {
    chunk.check(bytes)?;
    let damaged = || chunk.damage(CONTRADICTS);
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
            let mut state = Sequel::new(head, head.start.take().ok_or_else(damaged)?);
            let block =
                codec::read(head, &mut state, Some(room), at, (chunk.count as usize, chunk.raw), bytes);
            head.start.give(state);
            Ok(Piece::Splits(Box::new(block.ok_or_else(damaged)?)))
        }
        ChunkType::DIRECT => {
            let head = head.ok_or_else(|| chunk.damage("the base of its mesh is not known"))?;
            let at = (chunk.first, chunk.first_face);
            let block = direct::read(head, at, (chunk.count, chunk.raw), bytes);
            Ok(Piece::Splits(Box::new(block.ok_or_else(damaged)?)))
        }
        ChunkType::SEQUEL => Ok(Piece::Sequel(bytes.to_vec())),
        ChunkType::BOUNDS => {
            let bounds = bounds::read(bytes, chunk.count as usize, chunk.raw).ok_or_else(damaged)?;
            Ok(Piece::Bounds(Box::new(bounds)))
        }
        ChunkType::ORDER => Ok(Piece::Order(bytes.to_vec())),
        ChunkType::SCENE if chunk.raw != chunk.stored => Err(damaged()),
        ChunkType::SCENE => Ok(Piece::Scene(bytes.to_vec())),
        _ => Ok(Piece::Other(bytes.to_vec())),
    }
}

/// Reads a whole file. Splits come in the order of the file: chunk after chunk, each of which refines a part of the mesh. Before states between the chunks are asked for,
/// [`ProgressiveMesh::sorted_by_error`] puts them in that of their errors.
///
/// Errors: damage of any kind; [`decode_prefix`] returns what came before it. O(n).
pub fn decode(bytes: &[u8]) -> Result<Decoded, FormatError> {
    let decoded = decode_prefix(bytes)?;
    match &decoded.report.damage {
        Some(damage) => Err(damage.clone()),
        None => Ok(decoded),
    }
}

/// Chunks for each thread that are read before they are put together.
const AT_ONCE: usize = 2;

/// Reads of a file all that is whole: every chunk that is undamaged, as are those it builds on. What a damaged chunk holds, and what needs it, is left out:
/// with a base the mesh (an empty one stands in its place), with splits all later ones of that mesh, with the scene nothing else. Of a file that is cut off, that is all that came before.
/// [`super::Report::damage`] is the first damage, [`super::Report::lost`] lists the chunks that were left out.
///
/// Errors: damage of the head or the directory by which chunks cannot be found.
pub fn decode_prefix(bytes: &[u8]) -> Result<Decoded, FormatError> {
    let length = Directory::length(&bytes[..bytes.len().min(HEAD)])?;
    let (directory, mut damage) = Directory::salvage(&bytes[..bytes.len().min(length)])?;
    let mut assembly = Assembly::new(&directory);
    let mut sizes = StreamSizes::default();
    let slice = |c: &Chunk| {
        let end = c.range().end.min(bytes.len() as u64) as usize;
        &bytes[(c.offset as usize).min(end)..end]
    };
    // Bases first, as every other chunk needs them; then all others by themselves; then all together.
    let (bases, others): (Vec<&Chunk>, _) = directory.chunks.iter().partition(|c| c.kind == ChunkType::BASE);
    let mut failed_at = match &damage {
        Some(FormatError::Chunk { index, .. }) => *index,
        Some(_) => 0,
        None => u32::MAX,
    };
    let mut lost = Vec::new();
    let mut note = |chunk: &Chunk, e: FormatError| {
        lost.push(*chunk);
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
    // A few at a time, so that what was read does not stand in memory twice, and the memory is used again.
    assembly.reserve(&directory.chunks, bytes.len() as u64);
    let mut rest = others;
    while !rest.is_empty() {
        let later = rest.split_off(rest.len().min(AT_ONCE * super::threads()));
        let pieces = super::each(rest, |c| (c, read_piece(c, assembly.head(c.mesh), slice(c))));
        rest = later;
        for (chunk, piece) in pieces {
            // What follows from damage before has a later place, so the first is what is told.
            match piece.and_then(|p| assembly.add(chunk, p)) {
                Ok(()) => sizes.add(chunk, slice(chunk)),
                Err(e) => note(chunk, e),
            }
        }
    }
    if damage.is_none() && bytes.len() as u64 > directory.file_bytes() {
        damage = Some(FormatError::Head("the file is longer than it says"));
    }
    lost.sort_unstable_by_key(|c| c.index);
    let mut decoded = assembly.finish(&directory, damage);
    decoded.report.lost = lost;
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
        let lost = self.directory.chunks.get(self.next..).unwrap_or_default();
        let complete = lost.is_empty();
        let mut decoded = self.assembly.finish(&self.directory, self.damage);
        decoded.report.lost = lost.to_vec();
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

    /// The same bytes for other threads, which then may be asked for ahead of need; `None`: only where they are needed.
    fn shared(&self) -> Option<std::sync::Arc<dyn ByteRanges + Send + Sync>> {
        None
    }
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

    fn shared(&self) -> Option<std::sync::Arc<dyn ByteRanges + Send + Sync>> {
        (**self).shared()
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

    /// Where the bytes come from.
    pub fn source(&self) -> &S {
        &self.source
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
