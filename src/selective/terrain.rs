//! Paths over terrain (Pires 2003): near the ground, at so many samples a frame.

use super::flight::{FlightPath, PathError};
use super::samples::Tiles;
use crate::ground::Space;
use crate::refine::view::{Camera, CameraError, CameraParameters, Projection};
use crate::terrain::{Raster, RasterError, Window};
use glam::{DMat4, DVec3};

/// A grid where its mesh stands. Of its heights only those needed are read.
#[derive(Clone)]
pub struct Ground<'a> {
    pub(super) raster: &'a dyn Raster,
    pub(super) tiles: Tiles,
    /// Column, row and height to the world, and back.
    pub(super) to_world: DMat4,
    pub(super) to_grid: DMat4,
    /// The length of a step by a column.
    spacing: f64,
    up: DVec3,
    least: f64,
}

/// There is nothing to fly over.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GroundError {
    /// A space that flattens the grid, or the globe.
    #[error("the grid does not stand in a flat space of three dimensions")]
    Space,
    /// No height.
    #[error("no heights, all are void")]
    Void,
    /// Heights could not be read.
    #[error(transparent)]
    Raster(#[from] RasterError),
}

/// The paths that are flown over terrain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lap {
    /// About the middle, looking at it; its radius is 0.35 of the side.
    Circle,
    /// Bernoulli's lemniscate `r^2 = a^2 cos 2t` in equal steps of t, `a` 0.45 of the side, looking ahead, fastest over the middle.
    Lemniscate,
}

/// Radius of the circle, and half the width of the lemniscate, as parts of the longer side.
const RADIUS: f64 = 0.35;
const HALF_WIDTH: f64 = 0.45;
/// A lemniscate's length in half widths: 2 times the lemniscate constant.
const LEMNISCATE: f64 = 5.244_115_108_584_24;
/// Pictures: pixels, and degrees.
const SIDES: [u32; 2] = [1920, 1080];
const FOV_Y: f64 = 45.0;

impl Lap {
    /// Samples a frame, on the mean, of the slow laps and of the fast ones.
    pub fn speeds(self) -> [f64; 2] {
        match self {
            Lap::Circle => [0.1, 1.0],
            Lap::Lemniscate => [0.22, 2.2],
        }
    }
}

impl<'a> Ground<'a> {
    /// The grid as a mesh in `space` has it. Reads all heights once, window by window. O(samples); memory for a million of them, and 24 bytes for every 16,384.
    ///
    /// # Errors
    /// A space that flattens it, the globe, a grid without heights, those of reading.
    pub fn new(raster: &'a dyn Raster, space: Space) -> Result<Ground<'a>, GroundError> {
        let to_world = space.matrix([raster.columns(), raster.rows()]).ok_or(GroundError::Space)?;
        let to_grid = to_world.inverse();
        let spacing = to_world.x_axis.truncate().length();
        if !(to_world.is_finite() && to_grid.is_finite() && spacing > 0.0) {
            return Err(GroundError::Space);
        }
        let up = match space {
            Space::Grid => DVec3::Z,
            Space::World { .. } | Space::Globe(_) => DVec3::Y,
        };
        let tiles = Tiles::read(raster)?;
        let [least, _] = tiles.range().ok_or(GroundError::Void)?;
        Ok(Ground { raster, tiles, to_world, to_grid, spacing, up, least })
    }

    /// What is upwards in the world.
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// Samples along the longer side, less one.
    fn side(&self) -> f64 {
        self.raster.columns().max(self.raster.rows()).saturating_sub(1) as f64
    }

    /// The longer side, world units.
    pub fn length(&self) -> f64 {
        self.side() * self.spacing
    }

    /// The height of the grid's own triangles at a place; where they are void that of the cell's first sample, or the least there is.
    fn height(&self, x: f64, y: f64) -> Result<f64, RasterError> {
        let clamp = |v: f64, n: usize| v.clamp(0.0, n.saturating_sub(1) as f64);
        let (x, y) = (clamp(x, self.raster.columns()), clamp(y, self.raster.rows()));
        // The cell; the last column and row belong to the cells before them.
        let cell = |v: f64, n: usize| (v.floor() as usize).min(n.saturating_sub(2));
        let (c, r) = (cell(x, self.raster.columns()), cell(y, self.raster.rows()));
        let part = |a: usize, n: usize| 2.min(n - a);
        let window = Window::new(c, r, part(c, self.raster.columns()), part(r, self.raster.rows()));
        let own = self.raster.window(window)?;
        let at = |dx: usize, dy: usize| own.height(dx, dy);
        let Some(here) = at(0, 0) else { return Ok(self.least) };
        let (u, v) = (x - c as f64, y - r as f64);
        let Some(across) = at(1, 1) else { return Ok(here) };
        let side = if u >= v { at(1, 0) } else { at(0, 1) };
        let Some(side) = side else { return Ok(here) };
        let (most, less) = (u.max(v), u.min(v));
        Ok(here + (side - here) * (most - less) + (across - here) * less)
    }

    /// A lap at `speed` samples a frame on the mean, `frames` of it, the eye one step between samples above the ground.
    ///
    /// Errors: a grid of one row or column; those of reading heights.
    pub fn lap(&self, lap: Lap, speed: f64, frames: usize) -> Result<FlightPath, PathError> {
        let middle = crate::ground::middle_of([self.raster.columns(), self.raster.rows()]);
        let side = self.side();
        let at = |t: f64| {
            let (sin, cos) = t.sin_cos();
            let (a, b) = match lap {
                Lap::Circle => (RADIUS * side * cos, RADIUS * side * sin),
                Lap::Lemniscate => {
                    let scale = HALF_WIDTH * side / (1.0 + sin * sin);
                    (scale * cos, scale * sin * cos)
                }
            };
            [middle[0] + a, middle[1] + b]
        };
        let length = match lap {
            Lap::Circle => std::f64::consts::TAU * RADIUS,
            Lap::Lemniscate => LEMNISCATE * HALF_WIDTH,
        };
        let step = std::f64::consts::TAU * speed / (length * side);
        let point = |[x, y]: [f64; 2]| {
            let height = self.height(x, y)?;
            Ok::<_, RasterError>(self.to_world.transform_point3(DVec3::new(x, y, height)))
        };
        (0..frames)
            .map(|k| {
                let t = k as f64 * step;
                let eye = point(at(t))? + self.spacing * self.up;
                let target = match lap {
                    Lap::Circle => point(middle)? + self.spacing * self.up,
                    Lap::Lemniscate => {
                        let [a, b] = [at(t - 1e-4), at(t + 1e-4)];
                        let flat = DVec3::new(b[0] - a[0], b[1] - a[1], 0.0);
                        eye + self.to_world.transform_vector3(flat).normalize_or_zero() * self.spacing
                    }
                };
                self.camera(eye, target).map_err(PathError::Camera)
            })
            .collect()
    }

    fn camera(&self, eye: DVec3, target: DVec3) -> Result<Camera, CameraError> {
        Camera::new(&CameraParameters {
            eye,
            target,
            up: self.up,
            projection: Projection::Perspective { fov_y_deg: FOV_Y },
            width: SIDES[0],
            height: SIDES[1],
            near: 0.1 * self.spacing,
            far: 4.0 * self.length(),
        })
    }

    /// From coordinates of a terrain whose first sample is the origin, columns along x, rows along y, heights along z, lengths as in the world, to the world.
    pub fn from_corner(&self) -> DMat4 {
        let first = self.to_world.transform_point3(DVec3::ZERO);
        let unit = |v: glam::DVec4| v.truncate().normalize_or_zero().extend(0.0);
        let m = &self.to_world;
        DMat4::from_cols(unit(m.x_axis), unit(m.y_axis), self.up.extend(0.0), first.extend(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::Grid;

    fn grid() -> Grid {
        let height = |i: usize| ((i % 33) as f64 * 0.4).sin() + (i / 33) as f64 * 0.1;
        Grid::new(33, 33, (0..33 * 33).map(height).collect()).unwrap()
    }

    fn at(g: &Ground<'_>, x: f64, y: f64) -> f64 {
        g.height(x, y).unwrap()
    }

    const WORLD: Space = Space::World { spacing: [30.0, 30.0], exaggeration: 2.0 };

    #[test]
    fn heights_are_those_of_the_grids_triangles() {
        let grid = Grid::new(2, 2, vec![0.0, 1.0, 4.0, 10.0]).unwrap();
        let g = Ground::new(&grid, Space::Grid).unwrap();
        assert_eq!(
            [at(&g, 0.0, 0.0), at(&g, 1.0, 0.0), at(&g, 0.0, 1.0), at(&g, 1.0, 1.0)],
            [0.0, 1.0, 4.0, 10.0]
        );
        assert_eq!([at(&g, 0.5, 0.5), at(&g, 1.0, 0.5), at(&g, 0.5, 1.0)], [5.0, 5.5, 7.0]);
        let void = Grid::new(2, 2, vec![7.0, f64::NAN, 4.0, 10.0]).unwrap();
        let g = Ground::new(&void, Space::Grid).unwrap();
        assert_eq!([at(&g, 0.6, 0.5), at(&g, 1.0, 0.0)], [7.0, 7.0]);
        let none = Grid::new(1, 1, vec![f64::NAN]).unwrap();
        assert!(matches!(Ground::new(&none, Space::Grid), Err(GroundError::Void)));
    }

    #[test]
    fn laps_keep_their_speed_and_their_height() {
        let grid = grid();
        for (space, unit, up) in [(Space::Grid, 1.0, DVec3::Z), (WORLD, 30.0, DVec3::Y)] {
            let g = Ground::new(&grid, space).unwrap();
            assert_eq!(g.length(), 32.0 * unit);
            for lap in [Lap::Circle, Lap::Lemniscate] {
                for speed in lap.speeds() {
                    let length = match lap {
                        Lap::Circle => std::f64::consts::TAU * 0.35 * 32.0,
                        Lap::Lemniscate => 5.2441151 * 0.45 * 32.0,
                    };
                    let frames = (length / speed).round() as usize;
                    let path = g.lap(lap, speed, frames + 1).unwrap();
                    let flat = |c: &Camera| (c.eye() - c.eye().dot(up) * up) / unit;
                    let steps = path.windows(2).map(|w| flat(&w[0]).distance(flat(&w[1])));
                    let mean = steps.sum::<f64>() / frames as f64;
                    assert!((mean / speed - 1.0).abs() < 0.05, "{lap:?} {mean} {speed}");
                    for c in &path {
                        let p = g.to_grid.transform_point3(c.eye() - unit * up);
                        assert!((p.z - at(&g, p.x, p.y)).abs() < 1e-6);
                        assert!(c.up().dot(up) > 0.3);
                    }
                }
            }
        }
        let line = Grid::new(1, 1, vec![0.0]).unwrap();
        assert!(Ground::new(&line, Space::Grid).unwrap().lap(Lap::Circle, 1.0, 3).is_err());
    }

    #[test]
    fn corners_of_the_unit_terrain_are_those_of_the_grid() {
        let grid = grid();
        let g = Ground::new(&grid, WORLD).unwrap();
        let p = g.from_corner().transform_point3(g.length() * DVec3::new(1.0, 1.0, 0.1));
        assert!((p - DVec3::new(480.0, 96.0, 480.0)).length() < 1e-9, "{p}");
        let g = Ground::new(&grid, Space::Grid).unwrap();
        assert_eq!(g.from_corner(), DMat4::IDENTITY);
    }
}
