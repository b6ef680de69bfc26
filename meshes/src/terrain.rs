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
    let triangles = cells(n);
    let mut sample = triangle_mesh(points, &triangles);
    sample.uvs = Some(CornerValues { values: uvs, corner: sample.corners.clone() });
    sample
}

/// Two triangles a cell of a square grid of n x n cells.
fn cells(n: u32) -> Vec<[u32; 3]> {
    let side = n + 1;
    let mut triangles = Vec::with_capacity(2 * n as usize * n as usize);
    for y in 0..n {
        for x in 0..n {
            let at = |dx: u32, dy: u32| (y + dy) * side + x + dx;
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
            // Diagonals alternate, so that no direction is preferred.
            triangles.extend(if (x + y) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    triangles
}

/// A square of `size` x `size` heights, row after row from the top, as a mesh: x and y `step` apart, y up the rows, z the height; uv is the place in the
/// square. Fewer heights than that, or a size below 2, give an empty mesh. O(samples).
#[must_use]
pub fn sheet(size: usize, step: f64, heights: &[f64]) -> Sample {
    let Some(n) = u32::try_from(size).ok().and_then(|s| s.checked_sub(1)).filter(|&n| n > 0) else {
        return Sample::default();
    };
    if size.checked_mul(size).is_none_or(|samples| samples > heights.len() || samples > u32::MAX as usize) {
        return Sample::default();
    }
    let places = || (0..size).flat_map(|y| (0..size).map(move |x| (x, y)));
    // From the bottom row up, so that triangles look upwards.
    let points = places()
        .map(|(x, y)| DVec3::new(x as f64 * step, y as f64 * step, heights[(size - 1 - y) * size + x]));
    let last = f64::from(n);
    let uvs = places().map(|(x, y)| [(x as f64 / last) as f32, (y as f64 / last) as f32]).collect();
    let mut sample = triangle_mesh(points.collect::<Vec<_>>(), &cells(n));
    sample.uvs = Some(CornerValues { values: uvs, corner: sample.corners.clone() });
    sample
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_has_its_heights_and_looks_up() {
        let sheet = sheet(3, 2.0, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        assert_eq!((sheet.positions.len(), sheet.triangle_count()), (9, 8));
        // The lower left sample is the first of the last row.
        assert_eq!(sheet.positions[0], [0.0, 0.0, 6.0]);
        assert_eq!(sheet.positions[8], [4.0, 4.0, 2.0]);
        assert_eq!(super::sheet(1, 1.0, &[0.0]).positions.len(), 0);
        assert_eq!(super::sheet(3, 1.0, &[0.0]).positions.len(), 0);
    }
}
