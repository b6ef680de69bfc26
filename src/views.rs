//! Scenes cut to a region of the world, or to what a camera can see.
//!
//! [`clip_scene`] cuts surfaces at planes, and closes the cuts of solids; [`cull_scene`] leaves out what cannot be seen, whole faces at a time. Instances
//! stay instances where the same is left of them; those that differ get meshes of their own, in a glTF document too.

mod clip;
mod cull;
mod instances;

pub use clip::{ClipReport, clip_scene};
pub use cull::{CullReport, cull_scene};

use crate::aif::BuildError;
use crate::refine::view::clip::MeshClipError;

/// Why a scene could not be cut.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// A mesh that is none, or too large.
    #[error("mesh {mesh}: {source}")]
    Mesh {
        /// Its index.
        mesh: usize,
        /// What is wrong.
        source: MeshClipError,
    },
}

impl ViewError {
    fn build(mesh: usize, source: BuildError) -> Self {
        ViewError::Mesh { mesh, source: source.into() }
    }
}
