//! How light falls on a grid.

use crate::Grid;

/// The direction to the light: from the north-west (upper left), 45 degrees high. Not a unit vector's digits, but exact where it matters.
const LIGHT: [f64; 3] = [-0.5, -0.5, std::f64::consts::FRAC_1_SQRT_2];

/// Slopes along x and y, by Horn's (1981) weighted differences over 3 x 3 samples; a void or missing neighbour has the height of the middle.
fn slope(grid: &Grid, column: usize, row: usize, spacing: [f64; 2], middle: f64) -> [f64; 2] {
    let at = |dx: isize, dy: isize| {
        let place = column.checked_add_signed(dx).zip(row.checked_add_signed(dy));
        place.and_then(|(c, r)| grid.height(c, r)).unwrap_or(middle)
    };
    let x = (at(1, -1) - at(-1, -1)) + 2.0 * (at(1, 0) - at(-1, 0)) + (at(1, 1) - at(-1, 1));
    let y = (at(-1, 1) - at(-1, -1)) + 2.0 * (at(0, 1) - at(0, -1)) + (at(1, 1) - at(1, -1));
    [x / (8.0 * spacing[0]), y / (8.0 * spacing[1])]
}

/// The mean steepness (height over distance) of the valid samples; 0 where there is none. O(samples).
#[must_use]
pub fn mean_slope(grid: &Grid, spacing: [f64; 2]) -> f64 {
    let (mut sum, mut count) = (0.0, 0u64);
    for row in 0..grid.rows() {
        for column in 0..grid.columns() {
            if let Some(h) = grid.height(column, row) {
                let [x, y] = slope(grid, column, row, spacing, h);
                sum += (x * x + y * y).sqrt();
                count += 1;
            }
        }
    }
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// Light on every sample, 0 to 1, row after row: Lambert's law under light from the upper left, 45 degrees high. Void samples are NaN.
///
/// Heights are multiplied by `exaggeration` first; `spacing` is the distance of columns and of rows in units of height.
#[must_use]
pub fn hillshade(grid: &Grid, spacing: [f64; 2], exaggeration: f64) -> Vec<f64> {
    let mut light = Vec::with_capacity(grid.columns() * grid.rows());
    for row in 0..grid.rows() {
        for column in 0..grid.columns() {
            light.push(grid.height(column, row).map_or(f64::NAN, |h| {
                let [x, y] = slope(grid, column, row, spacing, h).map(|s| s * exaggeration);
                let cosine = (LIGHT[2] - x * LIGHT[0] - y * LIGHT[1]) / (1.0 + x * x + y * y).sqrt();
                cosine.clamp(0.0, 1.0)
            }));
        }
    }
    light
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(x: f64, y: f64) -> Grid {
        let heights = (0..25).map(|i| x * (i % 5) as f64 + y * (i / 5) as f64).collect();
        Grid::new(5, 5, heights).unwrap()
    }

    #[test]
    fn light_falls_by_the_angle() {
        let middle = |x: f64, y: f64, spacing: f64, z: f64| hillshade(&plane(x, y), [spacing; 2], z)[12];
        assert!((middle(0.0, 0.0, 1.0, 1.0) - 0.5f64.sqrt()).abs() < 1e-15);
        // A slope that faces the light squarely: it rises away from the upper left by 45 degrees.
        let half = 0.5f64.sqrt();
        assert!((middle(half, half, 1.0, 1.0) - 1.0).abs() < 1e-12);
        assert!((middle(2.0 * half, 2.0 * half, 4.0, 2.0) - 1.0).abs() < 1e-12);
        assert!(middle(-half, -half, 1.0, 1.0).abs() < 1e-12);
        assert!((mean_slope(&plane(3.0, 4.0), [1.0; 2]) - 5.0).abs() < 2.0);
    }

    #[test]
    fn voids_stay_void_and_their_neighbours_do_not() {
        let mut heights = vec![1.0; 9];
        heights[4] = f64::NAN;
        let light = hillshade(&Grid::new(3, 3, heights).unwrap(), [1.0; 2], 1.0);
        assert_eq!(light.iter().filter(|l| l.is_nan()).count(), 1);
        assert!((light[0] - 0.5f64.sqrt()).abs() < 1e-15);
        assert_eq!(mean_slope(&Grid::new(1, 1, vec![f64::NAN]).unwrap(), [1.0; 2]), 0.0);
    }
}
