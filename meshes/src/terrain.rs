//! A patch of terrain: fractal heights over a square, open all around.

use crate::noise::fractal;
use crate::sample::{CornerValues, Sample, triangle_mesh};
use glam::DVec3;

/// The unit square with heights in about [0, 0.25], z up, of about this many triangles (2 n²); uv is the place in the square.
pub(crate) fn terrain(faces: usize, seed: u64) -> Sample {
    let n = ((faces as f64 / 2.0).sqrt().round() as u32).max(1);
    let side = n + 1;
    let (mut points, mut uvs) = (Vec::new(), Vec::new());
    for y in 0..side {
        for x in 0..side {
            let (u, v) = (x as f64 / n as f64, y as f64 / n as f64);
            let place = DVec3::new(u * 3.0, v * 3.0, 0.5);
            let hills = fractal(seed, place, 7, 0.5);
            // Squaring what lies high makes valleys wide and ridges narrow.
            let lift = (hills + 1.2).max(0.0);
            points.push(DVec3::new(u, v, 0.05 * lift * lift));
            uvs.push([u as f32, v as f32]);
        }
    }
    let mut triangles = Vec::with_capacity(2 * (n * n) as usize);
    for y in 0..n {
        for x in 0..n {
            let at = |dx: u32, dy: u32| (y + dy) * side + x + dx;
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
            // Diagonals alternate, so that no direction is preferred.
            triangles.extend(if (x + y) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    let mut sample = triangle_mesh(points, &triangles);
    sample.uvs = Some(CornerValues { values: uvs, corner: sample.corners.clone() });
    sample
}
