//! Heights read a window at a time: what is larger than memory never lies in it whole.

use crate::{Grid, GridError};

/// A rectangle of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub column: usize,
    /// First row.
    pub row: usize,
    /// Columns, from the first on.
    pub columns: usize,
    /// Rows, from the first on.
    pub rows: usize,
}

impl Window {
    /// The window at a place of a size.
    #[must_use]
    pub fn new(column: usize, row: usize, columns: usize, rows: usize) -> Self {
        Window { column, row, columns, rows }
    }

    /// Samples in it; `None` where that is no `usize`.
    #[must_use]
    pub fn samples(&self) -> Option<usize> {
        self.columns.checked_mul(self.rows)
    }

    /// The part of it that another covers; `None` where they have no sample in common.
    #[must_use]
    pub fn intersection(&self, other: &Window) -> Option<Window> {
        let along = |a: usize, n: usize, b: usize, m: usize| {
            let (start, end) = (a.max(b), a.saturating_add(n).min(b.saturating_add(m)));
            (start < end).then(|| (start, end - start))
        };
        let (column, columns) = along(self.column, self.columns, other.column, other.columns)?;
        let (row, rows) = along(self.row, self.rows, other.row, other.rows)?;
        Some(Window { column, row, columns, rows })
    }
}

/// Why heights could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// A window reaches beyond the raster.
    #[error(
        "a window of {} x {} samples at column {}, row {} reaches beyond the raster of {columns} x {rows}",
        window.columns, window.rows, window.column, window.row
    )]
    Outside {
        /// The window.
        window: Window,
        /// Columns of the raster.
        columns: usize,
        /// Rows of the raster.
        rows: usize,
    },
    /// More samples than the caller wants to hold.
    #[error("{columns} x {rows} samples are more than the {limit} that may be held at once")]
    TooMany {
        /// Columns asked for.
        columns: usize,
        /// Rows asked for.
        rows: usize,
        /// The most samples allowed.
        limit: usize,
    },
    /// The array handed over has another length than the window has samples.
    #[error("a window of {samples} samples was given room for {room}")]
    Room {
        /// Samples of the window.
        samples: usize,
        /// Room given.
        room: usize,
    },
    /// What lies behind the raster is damaged, or could not be read.
    #[error("{place}: {what}")]
    Source {
        /// Where: a file, a tile, a line.
        place: String,
        /// What is wrong there.
        what: String,
    },
    /// What was read is no grid.
    #[error(transparent)]
    Grid(#[from] GridError),
}

impl RasterError {
    /// The same with the name of what was read before its place. Errors of the caller stay as they are.
    #[must_use]
    pub fn within(self, name: &str) -> Self {
        match self {
            RasterError::Source { place, what } if place.is_empty() => {
                RasterError::Source { place: name.into(), what }
            }
            RasterError::Source { place, what } => {
                RasterError::Source { place: format!("{name}: {place}"), what }
            }
            other => other,
        }
    }
}

/// Heights over the points of a regular grid, read by windows, from any number of threads.
///
/// Reading the same window again gives the same heights. How much is decoded for a window, and how much is kept, is the
/// raster's own affair; [`Raster::block`] says what is decoded together.
pub trait Raster: Send + Sync {
    /// Samples in a row; at least 1.
    fn columns(&self) -> usize;

    /// Samples in a column; at least 1.
    fn rows(&self) -> usize;

    /// Columns and rows of what is decoded at once: windows aligned to it decode nothing twice. (The columns of the raster, and 1,
    /// where rows can be read alone.)
    fn block(&self) -> [usize; 2] {
        [self.columns(), 1]
    }

    /// Writes the heights of a window to `out`, row after row; NaN is void, none is infinite.
    ///
    /// # Errors
    /// [`RasterError::Outside`] and [`RasterError::Room`] for windows that do not fit; [`RasterError::Source`] for data that are damaged
    /// or cannot be read; [`RasterError::Grid`] for infinite heights. `out` holds anything then.
    fn read(&self, window: Window, out: &mut [f64]) -> Result<(), RasterError>;

    /// The heights of a window as a grid. O(samples) of memory.
    ///
    /// # Errors
    /// As [`Raster::read`].
    fn window(&self, window: Window) -> Result<Grid, RasterError> {
        check_window(self.columns(), self.rows(), window, None)?;
        let mut heights = vec![f64::NAN; window.columns * window.rows];
        self.read(window, &mut heights)?;
        Ok(Grid::new(window.columns, window.rows, heights)?)
    }

    /// All heights, if there are at most `limit`.
    ///
    /// # Errors
    /// [`RasterError::TooMany`], before anything is read or allocated; then as [`Raster::read`].
    fn whole(&self, limit: usize) -> Result<Grid, RasterError> {
        let (columns, rows) = (self.columns(), self.rows());
        if columns.checked_mul(rows).is_none_or(|n| n > limit) {
            return Err(RasterError::TooMany { columns, rows, limit });
        }
        self.window(Window::new(0, 0, columns, rows))
    }
}

/// Fails unless a window lies within a raster of this size, and `room` (if given) is its number of samples.
pub fn check_window(
    columns: usize,
    rows: usize,
    window: Window,
    room: Option<usize>,
) -> Result<(), RasterError> {
    let fits = |a: usize, n: usize, size: usize| a.checked_add(n).is_some_and(|end| end <= size);
    if !fits(window.column, window.columns, columns) || !fits(window.row, window.rows, rows) {
        return Err(RasterError::Outside { window, columns, rows });
    }
    match (window.samples(), room) {
        (Some(samples), Some(room)) if samples != room => Err(RasterError::Room { samples, room }),
        (None, _) => Err(RasterError::Outside { window, columns, rows }),
        _ => Ok(()),
    }
}

impl Raster for Grid {
    fn columns(&self) -> usize {
        Grid::columns(self)
    }

    fn rows(&self) -> usize {
        Grid::rows(self)
    }

    fn read(&self, window: Window, out: &mut [f64]) -> Result<(), RasterError> {
        check_window(Grid::columns(self), Grid::rows(self), window, Some(out.len()))?;
        if out.is_empty() {
            return Ok(());
        }
        for (line, row) in out.chunks_exact_mut(window.columns).zip(window.row..) {
            let start = row * Grid::columns(self) + window.column;
            line.copy_from_slice(&self.heights()[start..start + window.columns]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_of_a_grid_are_its_parts() {
        let grid = Grid::new(4, 3, (0..12).map(f64::from).collect()).unwrap();
        let part = grid.window(Window::new(1, 1, 2, 2)).unwrap();
        assert_eq!(part.heights(), [5.0, 6.0, 9.0, 10.0]);
        assert_eq!(grid.window(Window::new(4, 3, 0, 0)).unwrap().heights(), [0.0; 0]);
        for bad in [
            Window::new(3, 0, 2, 1),
            Window::new(0, 3, 1, 1),
            Window::new(usize::MAX, 0, 2, 1),
            Window::new(0, 0, usize::MAX, usize::MAX),
        ] {
            assert!(matches!(grid.window(bad), Err(RasterError::Outside { .. })), "{bad:?}");
        }
        let short = grid.read(Window::new(0, 0, 2, 2), &mut [0.0; 3]);
        assert_eq!(short, Err(RasterError::Room { samples: 4, room: 3 }));
    }

    #[test]
    fn the_whole_is_given_up_to_a_limit() {
        let grid = Grid::new(2, 2, vec![1.0; 4]).unwrap();
        assert_eq!(grid.whole(4).unwrap().heights(), [1.0; 4]);
        assert_eq!(grid.whole(3).unwrap_err(), RasterError::TooMany { columns: 2, rows: 2, limit: 3 });
    }

    #[test]
    fn windows_intersect_as_rectangles_do() {
        let a = Window::new(2, 3, 4, 5);
        assert_eq!(a.intersection(&Window::new(0, 0, 3, 4)), Some(Window::new(2, 3, 1, 1)));
        assert_eq!(a.intersection(&Window::new(6, 3, 1, 1)), None);
        assert_eq!(a.intersection(&Window::new(0, 0, usize::MAX, usize::MAX)), Some(a));
    }

    #[test]
    fn a_place_is_named_after_its_file() {
        let e = RasterError::Source { place: "tile 3".into(), what: "ends early".into() };
        assert_eq!(e.within("a.tif").to_string(), "a.tif: tile 3: ends early");
    }
}
