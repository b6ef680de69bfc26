//! TIFF, BigTIFF and GeoTIFF: one band of numbers in strips or tiles.
//!
//! A reader of our own. The crate `tiff`, the oracle of the tests, reads the table of tiles under a fixed limit of 1 MiB that cannot be set
//! before it is read (no raster of more than 2^17 tiles opens), multiplies announced sizes without looking for overflow, and gives
//! tiles to one thread at a time. Decompression is by `flate2` and `weezl`, which it uses too.

mod chunk;
mod directory;
pub(crate) mod geo;
mod layout;

use super::source::{ReadAt, bytes_at, said};
use super::{DecodeError, Facts};
use crate::terrain::{BlockCache, Georeference, Raster, RasterError, Window, check_window};
use directory::Directory;
use layout::{Compression, Layout};
use std::sync::Arc;

/// The first image of a file, its first band.
pub(super) struct Tiff {
    source: Arc<dyn ReadAt>,
    layout: Layout,
    cache: Arc<BlockCache>,
    /// Whose blocks these are.
    owner: usize,
}

/// Opens the first image. What is decoded later is kept in `cache`.
pub(super) fn open(
    source: Arc<dyn ReadAt>,
    cache: &Arc<BlockCache>,
) -> Result<(Tiff, Georeference, Facts), DecodeError> {
    let directory = Directory::read(&*source)?;
    let layout = Layout::of(&directory, &*source)?;
    let mut warnings = vec![];
    if directory.more {
        warnings.push("the file holds more images (or levels of detail); the first is used".into());
    }
    if layout.bands > 1 {
        warnings.push(format!("each sample has {} bands; the first is used", layout.bands));
    }
    let georeference = geo::georeference(&directory, &*source, &mut warnings)?;
    let nodata = match directory.text(&*source, geo::NODATA)? {
        None => None,
        Some(text) => match text.trim().parse::<f64>() {
            Ok(v) => Some(v).filter(|v| !v.is_nan()),
            Err(_) => {
                warnings
                    .push(format!("its value for no data, {:?}, is no number and is not used", text.trim()));
                None
            }
        },
    };
    let facts = Facts { sample: layout.sample, layout: layout.about(directory.big), nodata, warnings };
    Ok((Tiff { source, layout, owner: cache.owner(), cache: cache.clone() }, georeference, facts))
}

impl Tiff {
    /// All samples of a block, which at the right and lower edge may be fewer than a tile has.
    fn block_heights(&self, block: usize) -> Result<Vec<f64>, RasterError> {
        let l = &self.layout;
        let (across, [columns, rows]) = (l.across(), l.block);
        let (column, row) = (block % across * columns, block / across * rows);
        let chunk = l.chunk_of(column, row);
        let kind = if l.tiled { "tile" } else { "strip" };
        let wrong = |what: String| RasterError::Source {
            place: format!("{kind} {chunk} (from column {column}, row {row})"),
            what,
        };
        let (offset, count) = (l.offsets[chunk], l.counts[chunk]);
        if l.compression == Compression::None {
            // Of a large strip only the rows asked for.
            let skipped = (row - row / l.chunk[1] * l.chunk[1]) * l.row_bytes();
            let here = rows.min(l.rows - row).min(l.chunk[1]);
            let needed = (if l.tiled { rows } else { here }) * l.row_bytes();
            if count < (skipped + needed) as u64 {
                return Err(wrong(format!("{count} bytes, where its samples need more")));
            }
            let bytes = bytes_at(&*self.source, offset.saturating_add(skipped as u64), needed as u64);
            return chunk::samples(l, bytes.map_err(|e| wrong(said(&e)))?).map_err(wrong);
        }
        let bytes = bytes_at(&*self.source, offset, count).map_err(|e| wrong(said(&e)))?;
        let here = if l.tiled { rows } else { rows.min(l.rows - row) };
        let raw = chunk::unpack(l.compression, &bytes, here * l.row_bytes()).map_err(wrong)?;
        chunk::samples(l, raw).map_err(wrong)
    }
}

impl Raster for Tiff {
    fn columns(&self) -> usize {
        self.layout.columns
    }

    fn rows(&self) -> usize {
        self.layout.rows
    }

    fn block(&self) -> [usize; 2] {
        self.layout.block
    }

    fn read(&self, window: Window, out: &mut [f64]) -> Result<(), RasterError> {
        check_window(self.layout.columns, self.layout.rows, window, Some(out.len()))?;
        if out.is_empty() {
            return Ok(());
        }
        let [columns, rows] = self.layout.block;
        for down in window.row / rows..=(window.row + window.rows - 1) / rows {
            for right in window.column / columns..=(window.column + window.columns - 1) / columns {
                let block = down * self.layout.across() + right;
                let here = Window::new(right * columns, down * rows, columns, rows);
                let Some(part) = here.intersection(&window) else { continue };
                // GDAL's sparse files leave out what has no data.
                let chunk = self.layout.chunk_of(here.column, here.row);
                let heights = match self.layout.counts[chunk] {
                    0 => None,
                    _ => Some(self.cache.get((self.owner, block), || self.block_heights(block))?),
                };
                for row in part.row..part.row + part.rows {
                    let from = (row - here.row) * columns + part.column - here.column;
                    let to = (row - window.row) * window.columns + part.column - window.column;
                    let line = &mut out[to..to + part.columns];
                    match &heights {
                        Some(heights) => line.copy_from_slice(&heights[from..from + part.columns]),
                        None => line.fill(f64::NAN),
                    }
                }
            }
        }
        Ok(())
    }
}
