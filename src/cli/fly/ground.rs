//! Frames over a grid, measured against it.

use super::Args;
use progmesh::io::files;
use progmesh::io::pm::{Terrain, read_terrain};
use progmesh::selective::{GroundJudgement, Seams};
use serde::Serialize;

/// A terrain against its grid.
#[derive(Clone, Copy, Serialize)]
pub(super) struct OnGround {
    samples: usize,
    pub(super) max_pixels: f64,
    mean_pixels: f64,
    /// Of samples farther off than the floor.
    pub(super) beyond_pixels: f64,
    pub(super) floor_pixels: f64,
    max_height: f64,
    pub(super) uncovered: usize,
}

impl OnGround {
    pub(super) fn of(j: &GroundJudgement) -> OnGround {
        OnGround {
            samples: j.samples,
            max_pixels: j.max_pixels,
            mean_pixels: j.mean_pixels,
            beyond_pixels: j.beyond_pixels,
            floor_pixels: j.floor_pixels,
            max_height: j.max_height,
            uncovered: j.uncovered,
        }
    }
}

/// What was found in a frame: seams wherever errors are measured at all, heights where it is due.
#[derive(Clone, Copy, Default)]
pub(super) struct OverGrid {
    pub(super) on_ground: Option<OnGround>,
    pub(super) seams: Option<Seams>,
}

impl OverGrid {
    pub(super) fn cracks(&self) -> Option<usize> {
        self.seams.map(|s| s.cracks)
    }

    pub(super) fn folds(&self) -> Option<usize> {
        self.seams.map(|s| s.folds)
    }
}

impl Args {
    /// What the mesh says of the grid that it was made of.
    pub(super) fn terrain(&self) -> Option<Terrain> {
        let path = self.input.progressive_path().filter(|p| !files::is_dash(p))?;
        read_terrain(files::open(path).ok()?)
    }
}
