//! The `.pm` file: progressive meshes as a stream of chunks. `FORMAT.md` specifies it.
//!
//! A file has a directory, the bases, then the splits, coarse to fine: by bands of error, within a band subtree by subtree. So every beginning that ends
//! with a chunk is a mesh, and each chunk is one range of bytes. Each can be read alone: it repeats, in an eighth to a third of its bytes, the splits that its own build on. With
//! [`EncodeOptions::sequential`] a chunk refers to the mesh that those before it make instead. [`encode`] writes, [`decode`] reads all, [`PmReader`] reads a stream as it arrives,
//! [`RangeReader`] fetches chunks in any order.
//!
//! Guaranteed: what was written is read bit for bit (errors of splits, which are estimates, are rounded up); the same bytes for every number of
//! threads; damage is an error that names the chunk, never a panic, and takes memory in proportion to the bytes that are there. Not guaranteed: that a
//! file whose checksums are right leads through its splits without [`crate::progressive::Damage`]; cursors find that.

mod assembly;
mod base;
mod bounds;
mod codec;
mod coder;
mod container;
pub(crate) mod direct;
mod extras;
mod input_order;
mod lattice;
mod models;
pub(crate) mod pages;
mod places;
mod plan;
mod read;
mod residual;
mod rows;
mod splits;
pub mod stream;
mod walk;
mod write;

pub use assembly::{Assembly, Decoded, Report, StreamSizes};
pub(crate) use base::Gaps;
pub use base::MeshHead;
pub(crate) use codec::Room;
pub use container::{Chunk, ChunkType, Directory, FormatError, MAGIC, VERSION};
pub use lattice::suggested_grid;
pub use places::Lattice;
pub use read::{ByteRanges, Piece, PmReader, RangeReader, decode, decode_prefix};
pub(crate) use read::{CONTRADICTS, read_piece, read_piece_within};
pub use splits::SplitBlock;
pub use write::{EncodeError, EncodeOptions, encode};

/// Threads that [`each`] has.
#[cfg(feature = "parallel")]
fn threads() -> usize {
    rayon::current_num_threads()
}

/// Threads that [`each`] has.
#[cfg(not(feature = "parallel"))]
fn threads() -> usize {
    1
}

/// `f` of each, in order; on several threads with feature `parallel`.
#[cfg(feature = "parallel")]
fn each<T: Send, U: Send>(items: Vec<T>, f: impl Fn(T) -> U + Sync + Send) -> Vec<U> {
    use rayon::prelude::*;
    items.into_par_iter().map(f).collect()
}

/// `f` of each, in order.
#[cfg(not(feature = "parallel"))]
fn each<T, U>(items: Vec<T>, f: impl Fn(T) -> U) -> Vec<U> {
    items.into_iter().map(f).collect()
}
