//! A raster seen from afar: means over cells of samples.

use crate::{Grid, Window};

/// Gathers heights, window by window, into a grid of at most so many columns and rows.
#[derive(Clone, Debug)]
pub struct Overview {
    step: usize,
    columns: usize,
    rows: usize,
    means: Vec<f64>,
    counts: Vec<u32>,
}

impl Overview {
    /// For a raster of this size; each sample of the overview stands for a square of the raster's. O(`most`²) memory.
    #[must_use]
    pub fn new(columns: usize, rows: usize, most: usize) -> Self {
        let step = columns.max(rows).div_ceil(most.max(1)).max(1);
        let (columns, rows) = (columns.div_ceil(step), rows.div_ceil(step));
        Overview { step, columns, rows, means: vec![0.0; columns * rows], counts: vec![0; columns * rows] }
    }

    /// Samples of the raster along a side of a sample of the overview.
    #[must_use]
    pub fn step(&self) -> usize {
        self.step
    }

    /// Adds the heights of a window, row after row. Every sample should come once; those outside are left out.
    pub fn add(&mut self, window: Window, heights: &[f64]) {
        for (line, row) in heights.chunks_exact(window.columns.max(1)).zip(window.row..) {
            for (&height, column) in line.iter().zip(window.column..) {
                let (c, r) = (column / self.step, row / self.step);
                if height.is_nan() || c >= self.columns || r >= self.rows {
                    continue;
                }
                let at = r * self.columns + c;
                self.counts[at] += 1;
                let n = f64::from(self.counts[at]);
                // A running mean, in an order of operations in which large heights do not overflow.
                self.means[at] += height / n - self.means[at] / n;
            }
        }
    }

    /// The means of the valid samples; void where there are none.
    #[must_use]
    pub fn finish(self) -> Grid {
        let heights = self.means.iter().zip(&self.counts);
        let heights = heights.map(|(&m, &n)| if n > 0 && m.is_finite() { m } else { f64::NAN }).collect();
        Grid::of_finite(self.columns, self.rows, heights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_has_the_mean_of_its_valid_samples() {
        let mut overview = Overview::new(5, 3, 3);
        let mut heights: Vec<f64> = (0..15).map(f64::from).collect();
        heights[0] = f64::NAN;
        heights[4] = f64::NAN;
        heights[9] = f64::NAN;
        overview.add(Window::new(0, 0, 5, 2), &heights[..10]);
        overview.add(Window::new(0, 2, 5, 1), &heights[10..]);
        assert_eq!(overview.step(), 2);
        let grid = overview.finish();
        assert_eq!((grid.columns(), grid.rows()), (3, 2));
        assert_eq!(grid.height(0, 0), Some(4.0));
        assert_eq!(grid.height(2, 0), None);
        assert_eq!(grid.height(2, 1), Some(14.0));
    }

    #[test]
    fn large_heights_do_not_overflow() {
        let mut overview = Overview::new(2, 1, 1);
        overview.add(Window::new(0, 0, 2, 1), &[f64::MAX, -f64::MAX]);
        assert_eq!(overview.finish().height(0, 0), Some(0.0));
    }
}
