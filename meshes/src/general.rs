//! General meshes: what is not a manifold, and faces that are not triangles.

use crate::noise::{SplitMix64, fractal};
use crate::sample::{Sample, triangle_mesh};
use crate::trig::sin_cos_turns;
use glam::DVec3;

/// Three fins that share an axis of complex edges, two open cones that share their apex (a cut vertex), a wire from a fin
/// into the void, and an isolated vertex. About this many triangles.
pub(crate) fn nonmanifold(faces: usize) -> Sample {
    // 6 n² in the fins, 8 n in the cones.
    let n = (((16.0 + 6.0 * faces as f64).sqrt() - 4.0) / 6.0).round().max(1.0) as u32;
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let axis: Vec<u32> = (0..=n).collect();
    points.extend((0..=n).map(|j| DVec3::new(0.0, 0.0, j as f64 / n as f64)));
    for fin in 0..3 {
        let (s, c) = sin_cos_turns(fin as f64 / 3.0);
        let mut last = axis.clone();
        for i in 1..=n {
            let first = points.len() as u32;
            let reach = i as f64 / n as f64;
            points.extend((0..=n).map(|j| DVec3::new(c * reach, s * reach, j as f64 / n as f64)));
            let column: Vec<u32> = (first..=first + n).collect();
            for j in 0..n as usize {
                triangles.push([last[j], column[j], column[j + 1]]);
                triangles.push([last[j], column[j + 1], last[j + 1]]);
            }
            last = column;
        }
    }
    let tip = points.len() as u32 - 1;
    let (apex, around) = (points.len() as u32, 4 * n);
    let apex_at = DVec3::new(3.0, 0.0, 0.5);
    points.push(apex_at);
    for up in [-1.0, 1.0] {
        let first = points.len() as u32;
        for i in 0..around {
            let (s, c) = sin_cos_turns(i as f64 / around as f64);
            points.push(apex_at + DVec3::new(c * 0.5, s * 0.5, up * 0.5));
            let (a, b) = (first + i, first + (i + 1) % around);
            triangles.push(if up > 0.0 { [apex, b, a] } else { [apex, a, b] });
        }
    }
    let loose = points.len() as u32;
    points.push(points[tip as usize] + DVec3::new(0.0, 0.0, 0.5));
    points.push(DVec3::new(1.5, 1.5, 1.5));
    let mut sample = triangle_mesh(points, &triangles);
    sample.wires = vec![[tip, loose]];
    sample
}

/// How a cell of two by two squares is divided; its nine points are numbered in rows.
const PATTERNS: [&[&[usize]]; 5] = [
    // An L and the square it leaves.
    &[&[0, 1, 2, 5, 4, 7, 6, 3], &[4, 5, 8, 7]],
    // A triangle cut off, and the seven-sided rest.
    &[&[1, 2, 5], &[0, 1, 5, 8, 7, 6, 3]],
    // Half a cell, four triangles.
    &[&[0, 1, 2, 5, 4, 3], &[3, 4, 7], &[3, 7, 6], &[4, 5, 8], &[4, 8, 7]],
    // Quads.
    &[&[0, 1, 4, 3], &[1, 2, 5, 4], &[4, 5, 8, 7], &[3, 4, 7, 6]],
    // One face with all points of the rim.
    &[&[0, 1, 2, 5, 8, 7, 6, 3]],
];

/// An open, gently curved sheet of about this many faces of 3 to 8 corners, convex and concave, in irregular order. Every face seen
/// from above is a simple polygon, counter-clockwise; not every one is planar.
pub(crate) fn polygons(faces: usize, seed: u64) -> Sample {
    // A cell has 2.8 faces in the mean.
    let cells = ((faces as f64 / 2.8).sqrt().round() as usize).max(2);
    let side = 2 * cells + 1;
    let mut random = SplitMix64::new(seed);
    let mut sample = Sample::default();
    for y in 0..side {
        for x in 0..side {
            let [dx, dy] = [0.12 * random.signed(), 0.12 * random.signed()];
            let place = DVec3::new((x as f64 + dx) / 2.0, (y as f64 + dy) / 2.0, 0.0);
            let height = 0.3 * fractal(seed, place / 4.0 + DVec3::splat(0.3), 2, 0.4);
            sample.positions.push(place.with_z(height).to_array());
        }
    }
    let mut sizes = Vec::new();
    for cell_y in 0..cells {
        for cell_x in 0..cells {
            let (pattern, turns) = (PATTERNS[random.below(PATTERNS.len())], random.below(4));
            for face in pattern {
                sizes.push(face.len() as u32);
                sample.corners.extend(face.iter().map(|&k| {
                    let (mut x, mut y) = (k % 3, k / 3);
                    for _ in 0..turns {
                        (x, y) = (2 - y, x);
                    }
                    ((2 * cell_y + y) * side + 2 * cell_x + x) as u32
                }));
            }
        }
    }
    sample.face_sizes = Some(sizes);
    drop_unused(&mut sample);
    sample.round_to_f32();
    sample
}

/// Leaves out the vertices of no face.
fn drop_unused(sample: &mut Sample) {
    let mut map = vec![u32::MAX; sample.positions.len()];
    sample.corners.iter().for_each(|&v| map[v as usize] = 0);
    let mut kept = 0;
    for (v, to) in map.iter_mut().enumerate().filter(|(_, to)| **to == 0) {
        *to = kept;
        sample.positions[kept as usize] = sample.positions[v];
        kept += 1;
    }
    sample.positions.truncate(kept as usize);
    sample.corners.iter_mut().for_each(|v| *v = map[*v as usize]);
}
