//! A torus: closed, genus 1, with smooth normals.

use crate::sample::{CornerValues, Sample, triangle_mesh};
use crate::trig::sin_cos_turns;
use glam::DVec3;

/// Radius of the ring, and of its tube.
const RADII: (f64, f64) = (1.0, 0.4);

/// A torus around z of about this many triangles, 2.5 times as many around the ring as around the tube.
pub(crate) fn torus(faces: usize) -> Sample {
    let around_tube = ((faces as f64 / 5.0).sqrt().round() as u32).max(3);
    let around_ring = ((faces as f64 / (2.0 * around_tube as f64)).round() as u32).max(3);
    let count = (around_ring * around_tube) as usize;
    let (mut points, mut normals) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for i in 0..around_ring {
        let (s, c) = sin_cos_turns(i as f64 / around_ring as f64);
        let out = DVec3::new(c, s, 0.0);
        for j in 0..around_tube {
            let (t, d) = sin_cos_turns(j as f64 / around_tube as f64);
            let normal = out * d + DVec3::Z * t;
            points.push(out * RADII.0 + normal * RADII.1);
            normals.push(normal.to_array().map(|x| x as f32));
        }
    }
    let mut triangles = Vec::with_capacity(2 * count);
    for i in 0..around_ring {
        for j in 0..around_tube {
            let at = |i: u32, j: u32| i % around_ring * around_tube + j % around_tube;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.push([a, b, c]);
            triangles.push([a, c, d]);
        }
    }
    let mut sample = triangle_mesh(points, &triangles);
    sample.normals = Some(CornerValues { values: normals, corner: sample.corners.clone() });
    sample
}
