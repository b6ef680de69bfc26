//! A raster in numbers, read in one pass.

use crate::{Raster, RasterError, Window};

/// What the heights of a raster are like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Valid samples.
    pub valid: u64,
    /// Void samples.
    pub void: u64,
    /// The least and the greatest height; `None` when all are void.
    pub range: Option<[f64; 2]>,
    /// The mean of the valid samples; 0 when there is none.
    pub mean: f64,
}

/// Samples read at once: 8 MiB.
const AT_ONCE: usize = 1 << 20;

/// Windows over a raster, row of windows after row, each of whole blocks where a block has no more than `at_once` samples. None has more
/// than `at_once`, or 1.
pub fn windows(raster: &dyn Raster, at_once: usize) -> impl Iterator<Item = Window> + use<> {
    let (columns, rows) = (raster.columns(), raster.rows());
    let [w, h] = raster.block().map(|n| n.max(1));
    let at_once = at_once.max(1);
    // As many blocks beside each other as fit, then rows of them; of a block that is too large, parts.
    let w = w.min(columns).min(at_once);
    let high = h.min(at_once / w).max(1);
    let wide = (at_once / high / w).max(1).saturating_mul(w).min(columns);
    let high = if wide == columns { (at_once / wide / high).max(1).saturating_mul(high) } else { high };
    (0..rows).step_by(high).flat_map(move |row| {
        (0..columns)
            .step_by(wide)
            .map(move |column| Window::new(column, row, wide.min(columns - column), high.min(rows - row)))
    })
}

impl Summary {
    /// Reads all of a raster once, window by window, calling `seen` with each window and its heights. O(samples) time; memory for a
    /// million samples.
    ///
    /// # Errors
    /// The first that reading gives, or `seen`.
    pub fn of<E: From<RasterError>>(
        raster: &dyn Raster,
        mut seen: impl FnMut(Window, &[f64]) -> Result<(), E>,
    ) -> Result<Summary, E> {
        let mut summary = Summary::default();
        let mut heights = vec![];
        let mut sum = 0.0;
        for window in windows(raster, AT_ONCE) {
            heights.resize(window.columns * window.rows, 0.0);
            raster.read(window, &mut heights)?;
            // Sums of windows are added up, which keeps more digits than one long sum.
            let mut part = 0.0;
            for &h in heights.iter().filter(|h| !h.is_nan()) {
                let [least, greatest] = summary.range.unwrap_or([h, h]);
                summary.range = Some([least.min(h), greatest.max(h)]);
                part += h;
                summary.valid += 1;
            }
            sum += part;
            seen(window, &heights)?;
        }
        summary.void = raster.columns() as u64 * raster.rows() as u64 - summary.valid;
        summary.mean = if summary.valid == 0 { 0.0 } else { sum / summary.valid as f64 };
        Ok(summary)
    }

    /// Valid samples of all.
    #[must_use]
    pub fn valid_share(&self) -> f64 {
        self.valid as f64 / (self.valid + self.void).max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;

    #[test]
    fn numbers_are_those_of_the_samples() {
        let grid = Grid::new(3, 2, vec![1.0, f64::NAN, 3.0, -4.0, 2.0, 3.0]).unwrap();
        let mut seen = 0;
        let summary = Summary::of::<RasterError>(&grid, |_, h| {
            seen += h.len();
            Ok(())
        });
        let summary = summary.unwrap();
        assert_eq!((seen, summary.valid, summary.void, summary.mean), (6, 5, 1, 1.0));
        assert_eq!(summary.range, Some([-4.0, 3.0]));
        let void = Grid::new(2, 1, vec![f64::NAN; 2]).unwrap();
        let summary = Summary::of::<RasterError>(&void, |_, _| Ok(())).unwrap();
        assert_eq!((summary.range, summary.valid_share(), summary.mean), (None, 0.0, 0.0));
    }

    struct Blocks([usize; 2], [usize; 2]);

    impl Raster for Blocks {
        fn columns(&self) -> usize {
            self.0[0]
        }
        fn rows(&self) -> usize {
            self.0[1]
        }
        fn block(&self) -> [usize; 2] {
            self.1
        }
        fn read(&self, _: Window, out: &mut [f64]) -> Result<(), RasterError> {
            out.fill(0.0);
            Ok(())
        }
    }

    #[test]
    fn windows_cover_every_sample_once_and_cut_no_block_that_fits() {
        for (size, block, at_once) in [
            ([10, 7], [3, 2], 12),
            ([10, 7], [10, 1], 25),
            ([10, 7], [10, 1], 4),
            ([10, 7], [4, 4], 1000),
            ([1, 1], [256, 256], 5),
            ([10, 7], [10, 7], 20),
            ([10, 7], [10, 1], 4),
            ([10, 7], [1 << 40, 1 << 40], 30),
        ] {
            let mut count = vec![0; size[0] * size[1]];
            for w in windows(&Blocks(size, block), at_once) {
                let fits = block[0].saturating_mul(block[1]) <= at_once;
                assert!(w.columns * w.rows <= at_once);
                assert!(!fits || w.column.is_multiple_of(block[0]) && w.row.is_multiple_of(block[1]));
                for row in w.row..w.row + w.rows {
                    count[row * size[0] + w.column..][..w.columns].iter_mut().for_each(|c| *c += 1);
                }
            }
            assert!(count.iter().all(|&c| c == 1), "{size:?} {block:?} {at_once}: {count:?}");
        }
    }
}
