//! What all formats have in common: no data becomes void, infinities are refused, errors name the file.

use crate::terrain::{Raster, RasterError, Window};

/// A decoder's samples as heights.
pub(super) struct Checked {
    pub(super) raster: Box<dyn Raster>,
    /// The value of void samples, besides NaN.
    pub(super) nodata: Option<f64>,
    pub(super) name: String,
}

impl Raster for Checked {
    fn columns(&self) -> usize {
        self.raster.columns()
    }

    fn rows(&self) -> usize {
        self.raster.rows()
    }

    fn block(&self) -> [usize; 2] {
        self.raster.block()
    }

    fn read(&self, window: Window, out: &mut [f64]) -> Result<(), RasterError> {
        self.raster.read(window, out).map_err(|e| e.within(&self.name))?;
        let mut infinite = false;
        for height in out.iter_mut() {
            if Some(*height) == self.nodata {
                *height = f64::NAN;
            }
            infinite |= height.is_infinite();
        }
        let Some(at) = infinite.then(|| out.iter().position(|h| h.is_infinite())).flatten() else {
            return Ok(());
        };
        let (column, row) = (window.column + at % window.columns, window.row + at / window.columns);
        Err(RasterError::Source {
            place: format!("{}: column {column}, row {row}", self.name),
            what: "the height is infinite; if that means no data, say so".into(),
        })
    }
}
