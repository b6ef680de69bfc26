//! progmesh: progressive and multiresolution meshes.
//!
//! Scenes and file formats ([`scene`], [`io`]), simplification of whole scenes ([`pipeline`]), comparing two of them ([`compare`]), pictures ([`report`]), and the
//! libraries below under short names: [`aif`] (the mesh), [`simplify`], [`refine`] (levels), [`meshes`] (samples). All works
//! on bytes and arrays; only `io::files` (feature `files`) opens paths. `ARCHITECTURE.md` says how the parts fit together.

pub use progmesh_aif as aif;
pub use progmesh_meshes as meshes;
pub use progmesh_refine as refine;
pub use progmesh_simplify as simplify;
pub use progmesh_terrain as terrain;

pub mod blocks;
pub mod compare;
pub mod ground;
pub mod io;
pub mod levels;
pub mod normals;
pub mod pipeline;
pub mod progressive;
pub mod report;
pub mod samples;
pub mod scene;
pub mod selective;
pub mod views;

/// The README's example must compile.
#[cfg(all(doctest, feature = "files"))]
#[doc = include_str!("../README.md")]
struct Readme;
