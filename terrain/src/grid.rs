//! Heights at the points of a regular grid.

/// Heights over the points `(x, y)` with `x < width` (the column) and `y < height` (the row), row after row, in f64: every common
/// sample type up to 32-bit integers and f64 is held exactly. A void sample is NaN.
#[derive(Clone, Debug)]
pub struct Grid {
    columns: usize,
    rows: usize,
    heights: Vec<f64>,
}

/// Why an array is no grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GridError {
    /// The array has another length than columns times rows.
    #[error("a grid of {columns} x {rows} samples was given {samples} heights")]
    Count {
        /// Columns announced.
        columns: usize,
        /// Rows announced.
        rows: usize,
        /// Heights given.
        samples: usize,
    },
    /// A height is infinite.
    #[error("the height at column {column}, row {row} is infinite")]
    Infinite {
        /// Column of the first such sample.
        column: usize,
        /// Its row.
        row: usize,
    },
}

impl Grid {
    /// Takes `columns * rows` heights, row after row; NaN is void. O(samples).
    ///
    /// # Errors
    /// [`GridError`] when the count is another or a height is infinite.
    pub fn new(columns: usize, rows: usize, heights: Vec<f64>) -> Result<Self, GridError> {
        if columns.checked_mul(rows) != Some(heights.len()) {
            return Err(GridError::Count { columns, rows, samples: heights.len() });
        }
        if let Some(i) = heights.iter().position(|h| h.is_infinite()) {
            return Err(GridError::Infinite { column: i % columns, row: i / columns });
        }
        Ok(Self { columns, rows, heights })
    }

    /// The same of heights that are known to be as many as they must, and not infinite.
    pub(crate) fn of_finite(columns: usize, rows: usize, heights: Vec<f64>) -> Self {
        debug_assert!(heights.len() == columns * rows && !heights.iter().any(|h| h.is_infinite()));
        Self { columns, rows, heights }
    }

    /// Samples in a row.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Samples in a column.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// All heights, row after row; void ones are NaN.
    #[must_use]
    pub fn heights(&self) -> &[f64] {
        &self.heights
    }

    /// The height at a column and row; `None` where it is void or outside.
    #[must_use]
    pub fn height(&self, column: usize, row: usize) -> Option<f64> {
        if column >= self.columns || row >= self.rows {
            return None;
        }
        Some(self.heights[row * self.columns + column]).filter(|h| !h.is_nan())
    }

    /// The least and the greatest height; `None` when all are void. O(samples).
    #[must_use]
    pub fn range(&self) -> Option<(f64, f64)> {
        let valid = self.heights.iter().copied().filter(|h| !h.is_nan());
        valid.fold(None, |range, h| {
            let (least, greatest) = range.unwrap_or((h, h));
            Some((f64::min(least, h), f64::max(greatest, h)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_infinities_are_refused() {
        assert_eq!(
            Grid::new(2, 2, vec![0.0; 3]).unwrap_err(),
            GridError::Count { columns: 2, rows: 2, samples: 3 }
        );
        assert!(Grid::new(usize::MAX, 2, vec![]).is_err());
        let infinite = vec![0.0, 0.0, 0.0, f64::NEG_INFINITY];
        assert_eq!(Grid::new(2, 2, infinite).unwrap_err(), GridError::Infinite { column: 1, row: 1 });
    }

    #[test]
    fn a_grid_of_voids_has_no_range() {
        let grid = Grid::new(2, 1, vec![f64::NAN; 2]).unwrap();
        assert_eq!(grid.range(), None);
        assert_eq!(grid.height(0, 0), None);
        assert_eq!(grid.height(2, 0), None);
    }
}
