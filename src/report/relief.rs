//! Height grids from above: colours by height, light from the north-west.

use super::colormap::heat_color;
use super::picture::Picture;
use super::table::short;
use crate::terrain::{Grid, hillshade, mean_slope};

const WHITE: [u8; 3] = [255; 3];
const INK: [u8; 3] = [48; 3];
/// The two greys of the stripes that void samples are drawn in.
const VOID: [[u8; 3]; 2] = [[226; 3], [206; 3]];
const STRIPE: u32 = 4;
/// Rows below the map: the bar of colours and its numbers.
const FOOT: u32 = 44;
const BAR: u32 = 12;
const LETTER: f64 = 1.5;
/// The mean steepness that a map shows best; the heights are exaggerated to it.
const SHOWN_SLOPE: f64 = 0.4;

/// A map of a grid, a pixel a sample, with a legend of its heights. `spacing` is the distance of columns and of rows, in units of height if
/// these are known: relief is exaggerated until it shows.
pub fn relief(grid: &Grid, spacing: [f64; 2]) -> Picture {
    let (columns, rows) = (grid.columns(), grid.rows());
    let (least, greatest) = grid.range().unwrap_or((0.0, 0.0));
    // To 0..1, so that no height is too large to be squared.
    let scale = greatest.abs().max(least.abs());
    let scale = if scale > 0.0 { scale } else { 1.0 };
    let normal = grid.heights().iter().map(|h| h / scale).collect();
    let Ok(normal) = Grid::new(columns, rows, normal) else { return Picture::new(0, 0, WHITE) };
    let unit = spacing.map(|s| s / scale);
    let steps = if unit.iter().all(|s| s.is_finite() && *s > 0.0) { unit } else { [1.0; 2] };
    let slope = mean_slope(&normal, steps);
    let exaggeration = if slope > 0.0 && slope.is_finite() { SHOWN_SLOPE / slope } else { 1.0 };
    let light = hillshade(&normal, steps, exaggeration);
    let (low, high) = (least / scale, greatest / scale);
    // The legend needs room whatever the map's width.
    let width = (columns as u32).max(160);
    let mut out = Picture::new(width, rows as u32 + FOOT, WHITE);
    for (y, (lights, heights)) in light.chunks(columns).zip(normal.heights().chunks(columns)).enumerate() {
        for (x, (&light, &height)) in lights.iter().zip(heights).enumerate() {
            let (x, y) = (x as u32, y as u32);
            let color = if height.is_nan() {
                VOID[((x + y) / STRIPE % 2) as usize]
            } else {
                let part = if high > low { (height - low) / (high - low) } else { 0.5 };
                shaded(part, light)
            };
            out.set(x, y, color);
        }
    }
    legend(&mut out, rows as u32 + 8, least, greatest, grid.range().is_some());
    out
}

/// The colour of a height, lighter or darker than it is under even light.
fn shaded(part: f64, light: f64) -> [u8; 3] {
    // Flat ground has cos 45 degrees; half the way to white, so that shapes show through all colours.
    let strength = 0.25 + 0.75 * light / std::f64::consts::FRAC_1_SQRT_2;
    heat_color(part).map(|c| {
        let pale = 0.25 + 0.75 * c;
        (255.0 * (pale * strength).clamp(0.0, 1.0)).round() as u8
    })
}

fn legend(out: &mut Picture, top: u32, least: f64, greatest: f64, any: bool) {
    if !any {
        out.write(8.0, f64::from(top), LETTER, "every sample is void", INK);
        return;
    }
    let bar = out.width() - 16;
    for x in 0..bar {
        out.fill(
            [8 + x, top],
            [1, BAR],
            shaded(f64::from(x) / f64::from(bar - 1), std::f64::consts::FRAC_1_SQRT_2),
        );
    }
    let line = f64::from(top + BAR + 6);
    let right = short(greatest);
    out.write(8.0, line, LETTER, &short(least), INK);
    let at = f64::from(out.width() - 8) - Picture::text_width(&right, LETTER);
    out.write(at, line, LETTER, &right, INK);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_shows_heights_slopes_and_voids() {
        // A ridge from top to bottom, its left side lit, and a void corner.
        let height = |c: usize| 20.0 - (c as f64 - 20.0).abs();
        let mut heights: Vec<f64> = (0..40 * 40).map(|i| height(i % 40)).collect();
        heights[0] = f64::NAN;
        let picture = relief(&Grid::new(40, 40, heights).unwrap(), [1.0; 2]);
        assert_eq!((picture.width(), picture.height()), (160, 40 + FOOT));
        let sum = |x: u32| picture.pixel(x, 20).unwrap().iter().map(|&c| u32::from(c)).sum::<u32>();
        assert!(sum(15) > sum(25) + 60, "the same height, lit and in shade: {} {}", sum(15), sum(25));
        assert_eq!(picture.pixel(0, 0), Some(VOID[0]));
        assert_eq!(picture.pixel(100, 20), Some(WHITE));
    }

    #[test]
    fn no_grid_is_too_strange() {
        for heights in [vec![f64::NAN; 4], vec![7.0; 4], vec![0.0; 4], vec![1e300, -1e300, f64::MAX, 1e-300]]
        {
            let picture = relief(&Grid::new(2, 2, heights).unwrap(), [f64::NAN, 0.0]);
            assert_eq!(picture.height(), 2 + FOOT);
        }
    }
}
