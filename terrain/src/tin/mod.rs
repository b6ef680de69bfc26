//! Triangulated irregular networks (TINs): few triangles that keep every sample within an error.
//!
//! Samples and vertices are integers: columns, rows, and heights in multiples of a power of two (the quantum) that gives the greatest
//! height 24 bits. That a sample lies within the error of its triangle is decided in 64-bit integers, without rounding, on the very heights that
//! are returned. f32 holds them, so what is written is what was proven.
//!
//! The valid region is the union of the grid triangles whose three corners are valid, where the diagonal of a cell runs from `(x, y)` to
//! `(x + 1, y + 1)`. A network covers it exactly: its outline is that region's, point for point, or with [`Options::outline_tolerance`] a simpler one. Valid
//! samples that belong to no such triangle are isolated; they are counted and, under the exact outline, covered by nothing.
//!
//! ```
//! use progmesh_terrain::Grid;
//! use progmesh_terrain::tin::{Options, Quiet, triangulate};
//! let heights = (0..64 * 64).map(|i| ((i % 64) as f64 / 9.0).sin() * 20.0).collect();
//! let grid = Grid::new(64, 64, heights)?;
//! let made = triangulate(&grid, &Options::default().with_max_error(1.0), &Quiet)?;
//! assert!(made.errors.max <= 1.0);
//! assert!(made.tin.triangles.len() < 64);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod astray;
mod blocks;
mod borders;
mod breaklines;
mod delaunay;
mod drape;
mod field;
mod fill;
mod frame;
mod greedy;
mod heights;
mod lattice;
mod line;
mod make;
mod network;
mod options;
mod outline;
mod parallel;
mod patch;
mod queue;
mod region;
mod regular;
pub(crate) mod scan;
pub(crate) mod start;
mod thin;
mod tiles;
mod verify;

pub use borders::Borders;
pub use drape::drape;
pub use make::triangulate;
pub use options::{Contract, Control, Errors, Made, Method, Options, Outlined, Quiet, Tin, TinError};
pub use tiles::{Cuts, Level, Tiling};
pub use verify::{Verdict, lines_missing, verify, verify_outline};
