//! `--path`, `--frames`, `--path-scale`, `--path-speed`, `--grid`: where a flight leads, and over what.

use super::super::common::{Warnings, short};
use super::super::paging::grid_cache;
use super::super::terrain::input::{known_spacing, open_plain, unread};
use super::super::{Failure, args};
use glam::{DMat4, DVec3};
use progmesh::ground::Space;
use progmesh::io::files;
use progmesh::io::grid::GridFile;
use progmesh::io::pm::Terrain;
use progmesh::refine::view::Camera;
use progmesh::selective::{FlightPath, FrameSpace, Ground, GroundError, Lap, circle, lemniscate, recorded};
use std::path::{Path, PathBuf};

/// Where a flight leads.
#[derive(clap::Args, Debug)]
pub(super) struct PathArgs {
    /// circle (one diagonal from the middle, looking at it), lemniscate (above, looking ahead), or a file: a JSON array of cameras (docs/camera.md), or lines
    /// `F id front(3) left(3) up(3) eye(3) zoom`
    ///
    /// With --grid both lead one step between samples above the ground: circle with a radius of 0.35 of the side, lemniscate with half a width of 0.45 of it.
    #[arg(long, value_name = "PATH")]
    path: String,
    /// Frames of a circle or a lemniscate; of a file at most so many [default: 600, or all of the file]
    #[arg(long, value_name = "N", value_parser = frames, allow_negative_numbers = true, help_heading = "Path")]
    frames: Option<usize>,
    /// Factor for the eye's coordinates of a file of `F` lines, which are of a terrain of side 1 [default: 1; with --grid its longer side]
    #[arg(long, value_name = "S", value_parser = factor, allow_negative_numbers = true, help_heading = "Path")]
    path_scale: Option<f64>,
    /// With --grid: samples a frame: slow (0.1 on a circle, 0.22 on a lemniscate), fast (1 and 2.2), or a number [default: slow]
    #[arg(long, value_name = "SPEED", value_parser = speed, requires = "grid", help_heading = "Path")]
    path_speed: Option<Speed>,
    /// The height grid that IN was made of: it is what the mesh is measured against, and what paths keep above
    ///
    /// IN stands in the grid's own space or in the world's, as `terrain tin` writes it; which one is told by its extent. Every sample in the frustum counts, hidden or not: --cull frustum is
    /// what goes with it.
    #[arg(long, value_name = "GRID", help_heading = "Terrain")]
    grid: Option<PathBuf>,
    /// IN is in world space, and these are the lengths of a step by a column and by a row [default: the grid's, in metres; 1,1 if unknown]
    #[arg(long, value_name = "X,Y", value_parser = spacing, requires = "grid", allow_negative_numbers = true, help_heading = "Terrain")]
    spacing: Option<[f64; 2]>,
    /// IN is in world space, and heights were multiplied by this
    #[arg(long, value_name = "F", value_parser = factor, requires = "grid", allow_negative_numbers = true, help_heading = "Terrain")]
    exaggeration: Option<f64>,
}

/// `--path-speed`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Speed {
    Slow,
    Fast,
    Samples(f64),
}

/// What was read before any work is done.
#[derive(Default)]
pub(super) struct Source {
    path: Vec<u8>,
    grid: Option<GridFile>,
}

/// Where a flight leads, and over what.
pub(super) struct Course<'a> {
    pub(super) cameras: FlightPath,
    pub(super) ground: Option<Ground<'a>>,
    /// How far full detail may be off, in the grid's units.
    pub(super) floor: f64,
}

/// Frames of a path that does not say.
const FRAMES: usize = 600;
/// The part of the grid's sides that a mesh made of it takes up at least.
const MOST_OF_IT: f64 = 0.5;

/// Cameras and figures of all frames are held until the flight is over.
const MOST_FRAMES: usize = 100_000;

fn frames(text: &str) -> Result<usize, String> {
    args::positive(text).and_then(|n| match n {
        n if n <= MOST_FRAMES => Ok(n),
        _ => Err(format!("must be 1 to {MOST_FRAMES}; fly a longer path in parts")),
    })
}

fn factor(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("must be a number above 0".into()),
    }
}

fn spacing(text: &str) -> Result<[f64; 2], String> {
    let (x, y) = text.split_once(',').unwrap_or((text, text));
    Ok([factor(x)?, factor(y)?])
}

fn speed(text: &str) -> Result<Speed, String> {
    match text {
        "slow" => Ok(Speed::Slow),
        "fast" => Ok(Speed::Fast),
        number => {
            factor(number).map(Speed::Samples).map_err(|_| "must be slow, fast or a number above 0".into())
        }
    }
}

impl PathArgs {
    /// There is a grid to measure against.
    pub(super) fn has_grid(&self) -> bool {
        self.grid.is_some()
    }

    /// As given.
    pub(super) fn name(&self) -> &str {
        &self.path
    }

    /// Reads what the flags name; `memory` is the limit, in MiB, of which a grid's cache takes its part.
    pub(super) fn open(&self, memory: Option<usize>, warnings: &mut Warnings) -> Result<Source, Failure> {
        let path = match self.path.as_str() {
            "circle" | "lemniscate" => Vec::new(),
            path => files::read_all(Path::new(path)).map_err(|e| {
                let known = if e.kind() == std::io::ErrorKind::NotFound {
                    "; --path takes circle, lemniscate or a file of cameras"
                } else {
                    ""
                };
                Failure::Input(format!("{path}: {e}{known}"))
            })?,
        };
        let Some(grid) = &self.grid else { return Ok(Source { path, grid: None }) };
        Ok(Source { path, grid: Some(open_plain(grid, memory.map(grid_cache), warnings)?) })
    }

    /// The cameras about something of these bounds, and the ground below them. `file` is the mesh's name, and `terrain` what it says of a grid.
    pub(super) fn lay<'a>(
        &self,
        source: &'a Source,
        bounds: Option<(DVec3, DVec3)>,
        (file, terrain): (&str, Option<Terrain>),
    ) -> Result<Course<'a>, Failure> {
        let Some((lo, hi)) = bounds.filter(|(lo, hi)| (*hi - *lo).length() > 0.0) else {
            return Err(Failure::Input(format!("{file}: nothing is shown that one could fly about")));
        };
        let ground = match &source.grid {
            Some(grid) => Some(self.ground(grid, (lo, hi), file)?),
            None => None,
        };
        let frames = self.frames.unwrap_or(FRAMES);
        let diagonal = (hi - lo).length();
        let lap = match self.path.as_str() {
            "circle" => Some(Lap::Circle),
            "lemniscate" => Some(Lap::Lemniscate),
            _ => None,
        };
        let cameras = match (lap, &ground) {
            (Some(lap), Some(g)) => g.lap(lap, self.speed(lap), frames),
            (Some(Lap::Circle), None) => circle((lo, hi), frames),
            (Some(Lap::Lemniscate), None) => lemniscate((lo, hi), frames),
            (None, None) => {
                recorded(&source.path, &FrameSpace::about(diagonal, self.path_scale.unwrap_or(1.0)))
            }
            (None, Some(g)) => {
                let space = FrameSpace {
                    scale: self.path_scale.unwrap_or(g.length()),
                    to_world: g.from_corner(),
                    ..FrameSpace::about(g.length(), 1.0)
                };
                recorded(&source.path, &space)
            }
        };
        let mut cameras = cameras.map_err(|e| Failure::Input(format!("{}: {e}", self.path)))?;
        cameras.truncate(self.frames.unwrap_or(usize::MAX));
        Ok(Course { cameras, ground, floor: terrain.map_or(0.0, |t| t.error) })
    }

    fn speed(&self, lap: Lap) -> f64 {
        match self.path_speed.unwrap_or(Speed::Slow) {
            Speed::Slow => lap.speeds()[0],
            Speed::Fast => lap.speeds()[1],
            Speed::Samples(s) => s,
        }
    }

    /// The grid where the mesh stands: in its own space or in the world's, whichever the mesh takes up most of.
    fn ground<'a>(
        &self,
        grid: &'a GridFile,
        (lo, hi): (DVec3, DVec3),
        file: &str,
    ) -> Result<Ground<'a>, Failure> {
        let name = self.grid.as_deref().unwrap_or(Path::new("")).display();
        let spacing = self.spacing.or(known_spacing(grid)).unwrap_or([1.0, 1.0]);
        let size = [grid.raster.columns(), grid.raster.rows()];
        let world = Space::World { spacing, exaggeration: self.exaggeration.unwrap_or(1.0) };
        let fits = |space: &Space| {
            let Some(back) = space.matrix(size).map(|m: DMat4| m.inverse()) else { return false };
            let (a, b) = (back.transform_point3(lo), back.transform_point3(hi));
            let within = |a: f64, b: f64, n: usize| {
                let last = n.saturating_sub(1) as f64;
                a.min(b) > -0.5 && a.max(b) < last + 0.5 && (b - a).abs() >= MOST_OF_IT * last
            };
            within(a.x, b.x, size[0]) && within(a.y, b.y, size[1])
        };
        let own = (self.spacing.is_none() && self.exaggeration.is_none()).then_some(Space::Grid);
        let space = own.into_iter().chain([world]).find(fits).ok_or_else(|| {
            Failure::Input(format!(
                "{file}: reaches from {lo} to {hi}, which is not where a mesh of {name} stands: that has {} columns and {} rows, \
                 in the world {} by {} apart (--spacing)",
                size[0],
                size[1],
                short(spacing[0]),
                short(spacing[1])
            ))
        })?;
        Ground::new(&*grid.raster, space).map_err(|e| match e {
            GroundError::Raster(e) => unread(e),
            e => Failure::Input(format!("{name}: {e}")),
        })
    }
}

impl Course<'_> {
    /// What is upwards for most cameras.
    pub(super) fn up(&self) -> DVec3 {
        let sum: DVec3 = self.cameras.iter().map(Camera::up).sum();
        self.ground.as_ref().map_or(progmesh::selective::upward(sum), Ground::up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_and_spacings_are_read() {
        assert_eq!(
            (speed("slow"), speed("fast"), speed("3.5")),
            (Ok(Speed::Slow), Ok(Speed::Fast), Ok(Speed::Samples(3.5)))
        );
        assert!(speed("0").is_err() && speed("x").is_err() && speed("inf").is_err());
        assert_eq!((spacing("30"), spacing("30,25.5")), (Ok([30.0; 2]), Ok([30.0, 25.5])));
        assert!(spacing("30,0").is_err() && factor("nan").is_err());
        assert_eq!((frames("1"), frames("1e5")), (Ok(1), Ok(MOST_FRAMES)));
        assert!(frames("0").is_err() && frames("100001").is_err());
    }
}
