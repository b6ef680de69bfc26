//! # progmesh-refine: multiresolution on the AIF mesh
//!
//! A [`History`] simplifies a mesh and remembers every collapse, so that the one mesh in memory can be taken to any level of detail and
//! back: coarsening redoes collapses, refining undoes them as vertex splits. The records are those of progressive meshes (Hoppe 1996), the
//! levels those of NSA (Silva & Gomes): one pass each.
//!
//! Guaranteed: at full detail the mesh is the input bit for bit (ids, orders of all lists, positions, attributes), and at every
//! other step what it was there before, however it is reached; [`progmesh_aif::Mesh::check`] holds throughout; moving by
//! one collapse takes time in proportion to the valence, and memory is one flat record of about 100 bytes a collapse.
//!
//! There now: the multiresolution scheme in memory, [progressive meshes](progressive), their [files and
//! streams](mod@format), [geomorphs](geomorph), [views](view): cameras, their planes, what they cannot see; and [view-dependent
//! refinement](selective) over a [hierarchy], [truly selective](truly) as an option.
//!
//! ```
//! use progmesh_refine::{History, simplify::{Options, Quiet}};
//! # let tetra = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3u32]];
//! # let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0f32]];
//! # let mesh = progmesh_aif::Mesh::from_triangles(points, &tetra)?;
//! let mut history = History::nsa(mesh, &Options::default(), &Quiet)?;
//! history.set_level(0);
//! assert_eq!(history.mesh().face_count(), 4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod format;
pub mod geomorph;
pub mod hierarchy;
mod packed;
pub mod paged;
pub mod progressive;
mod record;
pub mod selective;
mod strips;
pub mod truly;
pub mod view;

pub use geomorph::{Geomorph, GeomorphError};
pub use hierarchy::Hierarchy;
pub use progmesh_aif as aif;
pub use progmesh_simplify as simplify;
pub use progressive::{Cursor, ProgressiveMesh};
pub use record::{History, HistoryLevel};
pub use strips::Strips;
pub use truly::TrulyView;
