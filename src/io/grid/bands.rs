//! Rasters that are decoded in bands of whole rows, because their files cannot be entered anywhere else.

use crate::terrain::{BlockCache, RasterError, Window, check_window};
use std::ops::Range;
use std::sync::Arc;

/// The bands of a raster, kept in a cache.
pub(super) struct Bands {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Rows of a band; the last may have fewer.
    pub(super) height: usize,
    cache: Arc<BlockCache>,
    /// Whose blocks these are.
    owner: usize,
}

impl Bands {
    /// `height` rows a band, at least one.
    pub(super) fn new(columns: usize, rows: usize, height: usize, cache: &Arc<BlockCache>) -> Self {
        Bands {
            columns,
            rows,
            height: height.clamp(1, rows.max(1)),
            owner: cache.owner(),
            cache: cache.clone(),
        }
    }

    /// The rows of a band.
    pub(super) fn rows_of(&self, band: usize) -> Range<usize> {
        band * self.height..self.rows.min((band + 1) * self.height)
    }

    /// A window into `out`; `decode` gives all heights of a band.
    pub(super) fn read(
        &self,
        window: Window,
        out: &mut [f64],
        decode: impl Fn(usize) -> Result<Vec<f64>, RasterError>,
    ) -> Result<(), RasterError> {
        check_window(self.columns, self.rows, window, Some(out.len()))?;
        if out.is_empty() {
            return Ok(());
        }
        let mut kept: Option<(usize, Arc<[f64]>)> = None;
        for (line, row) in out.chunks_exact_mut(window.columns).zip(window.row..) {
            let band = row / self.height;
            let heights = match kept.take() {
                Some((b, heights)) if b == band => heights,
                _ => self.cache.get((self.owner, band), || decode(band))?,
            };
            let from = (row - band * self.height) * self.columns + window.column;
            line.copy_from_slice(&heights[from..from + window.columns]);
            kept = Some((band, heights));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn each_band_is_decoded_once_and_windows_cross_them() {
        let bands = Bands::new(4, 7, 3, &Arc::new(BlockCache::new(1 << 20)));
        let calls = Cell::new(0);
        let decode = |band: usize| {
            calls.set(calls.get() + 1);
            Ok(bands.rows_of(band).flat_map(|y| (0..4).map(move |x| (10 * y + x) as f64)).collect())
        };
        let mut out = vec![0.0; 2 * 5];
        bands.read(Window::new(1, 2, 2, 5), &mut out, decode).unwrap();
        assert_eq!(out, [21.0, 22.0, 31.0, 32.0, 41.0, 42.0, 51.0, 52.0, 61.0, 62.0]);
        assert_eq!((calls.get(), bands.rows_of(2)), (3, 6..7));
        bands.read(Window::new(0, 0, 4, 7), &mut vec![0.0; 28], decode).unwrap();
        assert_eq!(calls.get(), 3, "kept");
        assert!(bands.read(Window::new(0, 6, 4, 2), &mut [0.0; 8], decode).is_err());
    }
}
