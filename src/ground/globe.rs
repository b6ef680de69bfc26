//! Terrain on the ellipsoid of WGS 84.

use crate::terrain::{Affine, Grid};
use glam::DVec3;

/// Half of the larger axis of WGS 84 in metres, and the square of its eccentricity.
const MAJOR: f64 = 6_378_137.0;
const ECCENTRICITY_2: f64 = 0.006_694_379_990_141_317;

/// Earth-centred coordinates (EPSG:4978, metres) of a longitude and a latitude in degrees and a height above the ellipsoid.
pub fn earth_centred([longitude, latitude]: [f64; 2], height: f64) -> [f64; 3] {
    let (sin_lat, cos_lat) = latitude.to_radians().sin_cos();
    let (sin_lon, cos_lon) = longitude.to_radians().sin_cos();
    let n = MAJOR / (1.0 - ECCENTRICITY_2 * sin_lat * sin_lat).sqrt();
    let from_axis = (n + height) * cos_lat;
    [from_axis * cos_lon, from_axis * sin_lon, (n * (1.0 - ECCENTRICITY_2) + height) * sin_lat]
}

/// A grid of degrees as a surface over the ellipsoid, in metres, with y up at its middle: x runs east there, z south. Heights count from the
/// ellipsoid: what a geoid lies above it is not known here.
///
/// Vertices stand where they belong; between them triangles are flat, and lie below the curved surface by the square of their sides over
/// eight times the radius of the Earth: [`Globe::sag`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Globe {
    transform: Affine,
    exaggeration: f64,
    origin: DVec3,
    /// Unit vectors at the origin.
    east: DVec3,
    north: DVec3,
    up: DVec3,
}

impl Globe {
    /// A grid whose transform leads to degrees of longitude and latitude, with heights in metres times `exaggeration`.
    pub fn new(grid: &Grid, transform: Affine, exaggeration: f64) -> Self {
        let [longitude, latitude] = transform.apply(super::middle(grid));
        let (sin_lat, cos_lat) = latitude.to_radians().sin_cos();
        let (sin_lon, cos_lon) = longitude.to_radians().sin_cos();
        Globe {
            transform,
            exaggeration,
            origin: earth_centred([longitude, latitude], 0.0).into(),
            east: DVec3::new(-sin_lon, cos_lon, 0.0),
            north: DVec3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat),
            up: DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat),
        }
    }

    /// What heights are multiplied by.
    pub fn exaggeration(&self) -> f64 {
        self.exaggeration
    }

    /// Where a point of the grid stands.
    pub(super) fn place(&self, point: [f64; 2], height: f64) -> [f64; 3] {
        let p = DVec3::from(earth_centred(self.transform.apply(point), height * self.exaggeration));
        let p = p - self.origin;
        [p.dot(self.east), p.dot(self.up), -p.dot(self.north)]
    }

    /// The normal of the surface through two points across and two points down, to the outside; at a pole, where all columns are one point, straight up.
    pub(super) fn up(&self, point: [f64; 2], across: [[f64; 3]; 2], down: [[f64; 3]; 2]) -> [f64; 3] {
        let [low, high] = [0.0, 1.0].map(|h| DVec3::from(self.place(point, h)));
        let up = high - low;
        let [across, down] = [across, down].map(|[a, b]| DVec3::from(b) - DVec3::from(a));
        // What is left of a step of some metres at a pole is rounding, below a thousandth of a millimetre.
        if [across, down].iter().any(|step| step.reject_from(up).length() < 1e-6) {
            return up.into();
        }
        let normal = down.cross(across);
        // Grids may be mirrored; up is where heights grow.
        (if normal.dot(up) < 0.0 { -normal } else { normal }).into()
    }

    /// From these coordinates, turned to z up as 3D Tiles does it, to earth-centred ones: a 4 x 4 matrix, column after column.
    pub fn to_earth(&self) -> [f64; 16] {
        let mut matrix = [0.0; 16];
        for (column, v) in [self.east, self.north, self.up, self.origin].into_iter().enumerate() {
            matrix[4 * column..4 * column + 3].copy_from_slice(&v.to_array());
        }
        matrix[15] = 1.0;
        matrix
    }

    /// A direction in these coordinates, earth-centred.
    pub fn direction_to_earth(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = [x, y, z].map(f64::from);
        (self.east * x + self.up * y - self.north * z).as_vec3().to_array()
    }

    /// The longer of the steps by a column and by a row, in metres, about where they are longest.
    pub fn step(&self) -> f64 {
        let t = self.transform.0;
        // A degree of the equator is longer than any other.
        t[0].hypot(t[3]).max(t[1].hypot(t[4])) * MAJOR.to_radians()
    }

    /// The length of sides that lie so far below the ellipsoid at most.
    pub fn longest(sag: f64) -> f64 {
        (8.0 * MAJOR * (1.0 - ECCENTRICITY_2) * sag.max(0.0)).sqrt()
    }

    /// By how much flat sides of this length in metres lie below the ellipsoid at most.
    pub fn sag(length: f64) -> f64 {
        // The least radius of curvature, that along the meridian at the equator.
        length * length / (8.0 * MAJOR * (1.0 - ECCENTRICITY_2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::Space;

    #[test]
    fn points_of_the_ellipsoid_are_known() {
        assert_eq!(earth_centred([0.0, 0.0], 10.0), [MAJOR + 10.0, 0.0, 0.0]);
        let pole = earth_centred([0.0, 90.0], 0.0);
        assert!((pole[2] - 6_356_752.314_245).abs() < 1e-6 && pole[0].abs() < 1e-6);
    }

    #[test]
    fn normals_at_the_poles_point_up() {
        // All of the globe in steps of 30 degrees, no two heights beside each other the same.
        let heights = (0..13 * 7).map(|i| f64::from(i * i % 97) * 50.0).collect();
        let grid = Grid::new(13, 7, heights).unwrap();
        let globe = Globe::new(&grid, Affine::north_up([-180.0, 90.0], [30.0, 30.0]), 1.0);
        for (row, south) in [(0, false), (6, true)] {
            for column in 0..13 {
                let n = Space::Globe(globe).normal(&grid, [column, row]);
                let [x, y, z] = globe.direction_to_earth(n);
                let up = if south { -z } else { z };
                assert!(up > 0.999_99 && x.hypot(y) < 1e-3, "{row} {column}: {x} {y} {z}");
            }
        }
        // Elsewhere within the slopes.
        let n = globe.direction_to_earth(Space::Globe(globe).normal(&grid, [6, 3]));
        assert!(n[0] > 0.99, "{n:?}");
    }

    #[test]
    fn the_frame_leads_back_to_the_earth() {
        let grid = Grid::new(3, 3, vec![100.0; 9]).unwrap();
        let transform = Affine::north_up([11.0, 58.0], [0.01, 0.01]);
        let globe = Globe::new(&grid, transform, 1.0);
        let m = globe.to_earth();
        for (point, height) in [([0.0, 0.0], 100.0), ([2.0, 1.0], -7.0)] {
            let [x, y, z] = globe.place(point, height);
            let [x, y, z] = [x, -z, y];
            let true_place = earth_centred(transform.apply(point), height);
            for k in 0..3 {
                let there = m[k] * x + m[4 + k] * y + m[8 + k] * z + m[12 + k];
                assert!((there - true_place[k]).abs() < 1e-6);
            }
        }
        // Flat ground: up at the middle is y, and the first row lies north, at negative z.
        let n = Space::Globe(globe).normal(&grid, [1, 1]);
        assert!((n[1] - 1.0).abs() < 1e-6, "{n:?}");
        assert!(globe.place([1.0, 0.0], 0.0)[2] < -1000.0);
        assert!((Globe::sag(10_000.0) - 1.97).abs() < 0.01);
        assert!((Globe::longest(Globe::sag(10_000.0)) - 10_000.0).abs() < 1e-6);
        assert!((globe.step() - 1113.0).abs() < 1.0);
    }
}
