//! A block hierarchy of a terrain (Hoppe 1998): what a progressive mesh of a grid of any size is made of, block by block.
//!
//! The grid is divided into squares that share their border samples. A [`leaf`] is triangulated, in full or within an error, and simplified by half-edge collapses while
//! its border stays; [`join`] puts 2 x 2 neighbours together, whose seam is then free, and simplifies again; so on to the root. Each [`Block`] says
//! which collapses were made in it, and what is left for the next.
//!
//! **The surface** is that of the grid triangles whose three corners are valid (diagonals from `(x, y)` to `(x + 1, y + 1)`). Its outline is kept at every level: only
//! vertices on its straight runs go.
//!
//! **The bound of a collapse** is proven, for every order of refinement. A mesh that some of the splits make (closed under what they depend on) consists of faces; a corner
//! of a face is one of a chain of vertices, each brought by the next of the splits that change this corner. Of the splits that come next at the three corners of a face, let `j` be the coarsest.
//! Then the corner that `j` would change is as `j` finds it, and both others are as `j` finds them or finer. All these triangles are measured against the grid's samples
//! when `j` is recorded, but for those that would need `j` itself. So what a face deviates from the samples over or under it is at most the bound of a split that was not made, and a
//! face of which no corner can change is one of the finest mesh. A sphere about the vertex of `j` holds all the triangles measured. Bounds and spheres nest along the vertex hierarchy.
//!
//! **No face turns over** in the plan, whatever the order: a collapse is made only if all the triangles that are measured for it lie the right way round. So every mesh of the hierarchy is a triangulation of the valid region.

mod bytes;
mod collapse;
mod history;
mod join;
mod leaf;
mod relief;
mod shapes;
mod sheet;
mod surface;

pub use bytes::Damaged;
pub use collapse::{Collapse, Rules};
pub use join::{Block, BlockHead, Child, join};
pub use leaf::{BlockError, Layout, leaf};
pub use relief::Relief;
pub use sheet::{Sheet, Vertex};

/// No element.
pub const NONE: u32 = u32::MAX;
