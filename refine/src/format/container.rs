//! The container: head, directory of chunks, checksums, and what can be wrong with them. FORMAT.md gives the layout.

use std::fmt;

/// The first bytes of a file. (Hoppe's `.pm` files begin with `PM` and a line feed.)
pub const MAGIC: [u8; 8] = *b"\x89PMF\r\n\x1A\n";

/// The version this module writes. A reader takes any minor version of its major one.
pub const VERSION: (u16, u16) = (5, 1);

pub(super) const HEAD: usize = 48;
pub(super) const ENTRY: usize = 64;
/// Feature bits that readers of this version know and must know: none so far.
const KNOWN_FEATURES: u32 = 0;
/// A chunk that may not be skipped.
const CRITICAL: u32 = 1;
/// What a chunk's arrays take in memory is at most so many times what it takes in the file, so that a file's size bounds what reading it
/// takes. A writer fills up with zero bytes.
pub(super) const EXPANSION: u64 = 64;

/// What a chunk holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ChunkType(pub [u8; 4]);

impl ChunkType {
    /// A mesh's head and its base.
    pub const BASE: ChunkType = ChunkType(*b"BASE");
    /// Vertex splits, read alone.
    pub const SPLITS: ChunkType = ChunkType(*b"SPLT");
    /// Vertex splits, read when those before are there.
    pub const SEQUEL: ChunkType = ChunkType(*b"SPLS");
    /// Vertex splits by direct references, read alone: the fastest to read.
    pub const DIRECT: ChunkType = ChunkType(*b"SPLD");
    /// The input's numbering of a mesh.
    pub const ORDER: ChunkType = ChunkType(*b"ORDR");
    /// Links and bounds of the chunk before it, for refining out of core ([`crate::paged`]).
    pub const PAGE: ChunkType = ChunkType(*b"PAGE");
    /// What the mesh stands in; opaque here.
    pub const SCENE: ChunkType = ChunkType(*b"SCNE");
    /// Bounds of splits for view-dependent refinement.
    pub const BOUNDS: ChunkType = ChunkType(*b"BNDS");
    /// What a mesh's elements have beside, of use at full detail; opaque here.
    pub const EXTRAS: ChunkType = ChunkType(*b"XTRA");
    /// What a mesh is of a height grid.
    pub const TERRAIN: ChunkType = ChunkType(*b"TERR");
}

impl ChunkType {
    /// It holds vertex splits.
    pub fn is_splits(self) -> bool {
        self.is_read_alone() || self == ChunkType::SEQUEL
    }

    /// It holds vertex splits that are read without those before.
    pub fn is_read_alone(self) -> bool {
        self == ChunkType::SPLITS || self == ChunkType::DIRECT
    }
}

impl fmt::Display for ChunkType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|&b| {
            if b.is_ascii_graphic() { write!(f, "{}", b as char) } else { write!(f, "\\x{b:02x}") }
        })
    }
}

/// What the directory says of a chunk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chunk {
    /// What it holds.
    pub kind: ChunkType,
    /// Its place in the file: chunks are numbered as they stand there.
    pub index: u32,
    /// It may not be skipped by a reader that does not know it.
    pub critical: bool,
    /// The mesh it belongs to; `u32::MAX` for none.
    pub mesh: u32,
    /// The first split, of its mesh, that it holds.
    pub first: u32,
    /// Splits in it; vertices of the base.
    pub count: u32,
    /// The first face its splits make; of a `PAGE` the first wedge.
    pub first_face: u32,
    /// The band: its splits follow each other in error, or belong to one level of the method.
    pub band: u32,
    /// The chunk's number within its band; those of a band are subtrees side by side.
    pub subtree: u32,
    /// The largest error of its splits, model units.
    pub error: f32,
    /// First byte in the file.
    pub offset: u64,
    /// Bytes in the file.
    pub stored: u64,
    /// Bytes its arrays take in memory.
    pub raw: u64,
    /// CRC-32 (IEEE) of the bytes in the file.
    pub checksum: u32,
}

impl Chunk {
    /// The bytes in the file.
    pub fn range(&self) -> std::ops::Range<u64> {
        self.offset..self.offset.saturating_add(self.stored)
    }
}

/// Why bytes are no progressive mesh, or from where on.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum FormatError {
    /// The first bytes are not those of a progressive mesh file.
    NotAProgressiveMesh,
    /// A version this reader does not know.
    Version(u16),
    /// The file uses features this reader does not know (bits of the head).
    Features(u32),
    /// Head or directory are damaged.
    Head(&'static str),
    /// A chunk is damaged; all before it are fine.
    Chunk {
        /// Its place in the file.
        index: u32,
        /// What it holds.
        kind: ChunkType,
        /// The mesh.
        mesh: u32,
        /// What is wrong.
        what: &'static str,
    },
    /// The source failed.
    Io(std::io::ErrorKind, String),
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAProgressiveMesh => write!(f, "no progressive mesh: the first bytes are others"),
            Self::Version(v) => {
                write!(f, "version {v} of the format; this program reads version {}", VERSION.0)?;
                if *v < VERSION.0 { write!(f, ": encode the mesh again") } else { Ok(()) }
            }
            Self::Features(bits) => {
                write!(f, "the file needs features this program does not have (bits {bits:#x})")
            }
            Self::Head(what) => write!(f, "head of the file: {what}"),
            Self::Chunk { index, kind, mesh: u32::MAX, what } => write!(f, "chunk {index} ({kind}): {what}"),
            Self::Chunk { index, kind, mesh, what } => {
                write!(f, "chunk {index} ({kind} of mesh {mesh}): {what}")
            }
            Self::Io(_, message) => write!(f, "reading: {message}"),
        }
    }
}

impl std::error::Error for FormatError {}

impl From<std::io::Error> for FormatError {
    fn from(e: std::io::Error) -> Self {
        FormatError::Io(e.kind(), e.to_string())
    }
}

impl Chunk {
    pub(crate) fn damage(&self, what: &'static str) -> FormatError {
        FormatError::Chunk { index: self.index, kind: self.kind, mesh: self.mesh, what }
    }

    /// Compares the checksum.
    pub(crate) fn check(&self, bytes: &[u8]) -> Result<(), FormatError> {
        if (bytes.len() as u64) < self.stored {
            return Err(self.damage("the file ends within it"));
        }
        if crc32fast::hash(bytes) != self.checksum {
            return Err(self.damage("its checksum is another"));
        }
        Ok(())
    }

    fn put(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(&self.kind.0);
        let flags = if self.critical { CRITICAL } else { 0 };
        for x in [
            flags,
            self.mesh,
            self.first,
            self.count,
            self.first_face,
            self.band,
            self.subtree,
            self.error.to_bits(),
            self.checksum,
        ] {
            out.extend_from_slice(&x.to_le_bytes());
        }
        for x in [self.offset, self.stored, self.raw] {
            out.extend_from_slice(&x.to_le_bytes());
        }
    }

    fn take(b: &[u8], index: u32) -> Chunk {
        let word = |k: usize| u32_at(b, 4 * k);
        let long = |k: usize| word(k) as u64 | (word(k + 1) as u64) << 32;
        Chunk {
            kind: ChunkType(word(0).to_le_bytes()),
            index,
            critical: word(1) & CRITICAL != 0,
            mesh: word(2),
            first: word(3),
            count: word(4),
            first_face: word(5),
            band: word(6),
            subtree: word(7),
            error: f32::from_bits(word(8)),
            checksum: word(9),
            offset: long(10),
            stored: long(12),
            raw: long(14),
        }
    }
}

/// The little-endian number at `at`; zero bytes stand for what is missing.
pub(super) fn u32_at(b: &[u8], at: usize) -> u32 {
    let mut four = [0; 4];
    if let Some(from) = b.get(at..at + 4) {
        four.copy_from_slice(from);
    }
    u32::from_le_bytes(four)
}

/// Head and directory of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Directory {
    /// Meshes in the file.
    pub meshes: u32,
    /// The chunks, in the order in which they stand in the file.
    pub chunks: Vec<Chunk>,
}

impl Directory {
    /// Bytes of head and directory.
    pub fn bytes(&self) -> u64 {
        (HEAD + ENTRY * self.chunks.len()) as u64
    }

    /// Bytes of the whole file.
    pub fn file_bytes(&self) -> u64 {
        self.chunks.last().map_or(self.bytes(), |c| c.range().end)
    }

    /// Gives the chunks their places in the file, and returns head and directory as bytes.
    pub(super) fn write(&mut self) -> Vec<u8> {
        let mut at = self.bytes();
        for (c, index) in self.chunks.iter_mut().zip(0..) {
            (c.offset, c.index) = (at, index);
            at += c.stored;
        }
        let mut out = Vec::with_capacity(self.bytes() as usize);
        out.extend_from_slice(&MAGIC);
        out.extend_from_slice(&VERSION.0.to_le_bytes());
        out.extend_from_slice(&VERSION.1.to_le_bytes());
        for x in [KNOWN_FEATURES, 0, self.meshes, self.chunks.len() as u32, ENTRY as u32] {
            out.extend_from_slice(&x.to_le_bytes());
        }
        out.extend_from_slice(&at.to_le_bytes());
        out.extend_from_slice(&[0; 8]);
        self.chunks.iter().for_each(|c| c.put(&mut out));
        let sum = head_checksum(&out);
        out[HEAD - 4..HEAD].copy_from_slice(&sum.to_le_bytes());
        out
    }

    /// How many bytes head and directory take, from the first [`HEAD`] bytes.
    pub(super) fn length(head: &[u8]) -> Result<usize, FormatError> {
        let known = head.len().min(MAGIC.len());
        if head[..known] != MAGIC[..known] {
            return Err(FormatError::NotAProgressiveMesh);
        }
        if head.len() < HEAD {
            return Err(FormatError::Head("the file ends within it"));
        }
        let major = u32_at(head, 8) as u16;
        if major != VERSION.0 {
            return Err(FormatError::Version(major));
        }
        let unknown = u32_at(head, 12) & !KNOWN_FEATURES;
        if unknown != 0 {
            return Err(FormatError::Features(unknown));
        }
        if u32_at(head, 28) != ENTRY as u32 {
            return Err(FormatError::Head("entries of the directory have another size"));
        }
        Ok(HEAD + ENTRY * u32_at(head, 24) as usize)
    }

    /// Reads head and directory, which `bytes` are.
    pub(super) fn read(bytes: &[u8]) -> Result<Directory, FormatError> {
        match Self::salvage(bytes)? {
            (directory, None) => Ok(directory),
            (_, Some(damage)) => Err(damage),
        }
    }

    /// The same of a directory with a wrong checksum, or with chunks that do not follow each other as they must, which is returned beside it, as long as chunks stand side by side: they
    /// have checksums of their own.
    pub(super) fn salvage(bytes: &[u8]) -> Result<(Directory, Option<FormatError>), FormatError> {
        if bytes.len() < Self::length(bytes)? {
            return Err(FormatError::Head("the file ends within the directory"));
        }
        if head_checksum(bytes) == u32_at(bytes, HEAD - 4) {
            return Self::parse(bytes);
        }
        let damage = FormatError::Head("its checksum is another");
        match Self::parse(bytes) {
            Ok((directory, _)) => Ok((directory, Some(damage))),
            Err(_) => Err(damage),
        }
    }

    fn parse(bytes: &[u8]) -> Result<(Directory, Option<FormatError>), FormatError> {
        let entries = bytes[HEAD..].chunks_exact(ENTRY).zip(0..);
        let directory = Directory {
            meshes: u32_at(bytes, 20),
            chunks: entries.map(|(b, index)| Chunk::take(b, index)).collect(),
        };
        let misplaced = directory.check()?;
        let length = u32_at(bytes, 32) as u64 | (u32_at(bytes, 36) as u64) << 32;
        if length != directory.file_bytes() {
            return Err(FormatError::Head("the length of the file does not go with its chunks"));
        }
        Ok((directory, misplaced))
    }

    /// Chunks side by side; returns the first of those of a mesh that is not in sequence, as an error.
    fn check(&self) -> Result<Option<FormatError>, FormatError> {
        let mut at = self.bytes();
        // For every mesh that has begun: splits and faces so far.
        let mut state: Vec<Option<u32>> = Vec::new();
        if self.meshes as usize > self.chunks.len() {
            return Err(FormatError::Head("more meshes than chunks"));
        }
        state.resize(self.meshes as usize, None);
        let mut first = None;
        for c in &self.chunks {
            let mut misplaced = |what| {
                first.get_or_insert_with(|| c.damage(what));
            };
            if c.offset != at {
                return Err(c.damage("it does not begin where the one before ends"));
            }
            at = at.checked_add(c.stored).ok_or_else(|| c.damage("its length is beyond all measure"))?;
            if c.raw > c.stored.saturating_mul(EXPANSION) || c.count as u64 > c.raw {
                return Err(c.damage("it is too short for what it is to hold"));
            }
            const KNOWN: [ChunkType; 7] = [
                ChunkType::BASE,
                ChunkType::SPLITS,
                ChunkType::DIRECT,
                ChunkType::SEQUEL,
                ChunkType::BOUNDS,
                ChunkType::ORDER,
                ChunkType::SCENE,
            ];
            let known = KNOWN.contains(&c.kind);
            if !known {
                if c.critical {
                    return Err(c.damage("this program does not know it, and it may not be skipped"));
                }
                continue;
            }
            if c.kind == ChunkType::SCENE {
                continue;
            }
            let Some(mesh) = state.get_mut(c.mesh as usize) else {
                misplaced("there is no such mesh");
                continue;
            };
            match (c.kind, *mesh) {
                (ChunkType::BASE, None) => *mesh = Some(0),
                (ChunkType::BASE, Some(_)) => misplaced("the mesh has a base already"),
                (_, None) => misplaced("it comes before the base of its mesh"),
                (kind, Some(n)) if kind.is_splits() && c.first != n => {
                    misplaced("its splits do not follow those before");
                }
                (kind, Some(n)) if kind.is_splits() => match n.checked_add(c.count) {
                    Some(n) => *mesh = Some(n),
                    None => misplaced("more splits than ids can name"),
                },
                _ => {}
            }
        }
        match state.iter().position(Option::is_none) {
            Some(_) => Err(first.unwrap_or(FormatError::Head("a mesh without a base"))),
            None => Ok(first),
        }
    }
}

/// The checksum of head and directory, its own place left out.
fn head_checksum(bytes: &[u8]) -> u32 {
    let mut h = crc32fast::Hasher::new();
    h.update(&bytes[..HEAD - 4]);
    h.update(&bytes[HEAD..]);
    h.finalize()
}
