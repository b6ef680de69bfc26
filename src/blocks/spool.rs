//! Heights put aside in tiles, where the grid's own file has them in rows so wide that each would be unpacked again for block after block.

use super::{BuildError, Control, Options, Store};
use crate::terrain::{BlockCache, Raster, RasterError, Window, check_window, windows};
use std::io;
use std::sync::Arc;

/// Samples of a tile.
const TILE: usize = 1 << 16;
/// Rows of a tile at most: a square.
const ROWS: usize = 1 << 8;

/// Heights to make blocks of: the grid's own, or tiles of them in the store.
pub(super) enum Heights<'a> {
    Own(&'a dyn Raster),
    Tiles(Tiles<'a>),
}

impl<'a> Heights<'a> {
    /// Reads a grid once, each block of it that fits into memory no more than once; returns also the greatest height, without its sign.
    ///
    /// Goes by tiles if what the grid unpacks at once is wider than four blocks of the terrain, and more than an eighth of the memory is needed to keep all of it: every level of blocks reads all
    /// heights, and a row of blocks beside each other all rows as often as it has blocks. A strip-packed GeoTIFF of 20,000 x 20,000 samples would be unpacked some hundred times.
    pub(super) fn of(
        raster: &'a dyn Raster,
        options: &Options,
        store: &'a dyn Store,
        control: &dyn Control,
    ) -> Result<(Self, f64), BuildError> {
        let samples = raster.columns().saturating_mul(raster.rows());
        let wide = raster.block()[0].min(raster.columns()) > 4 * options.cells;
        if !wide || samples.saturating_mul(size_of::<f64>()) <= options.memory / 8 {
            return Ok((Heights::Own(raster), greatest(raster, control)?));
        }
        let tiles = Tiles::new(raster, options.memory / 8, store);
        let greatest = tiles.fill(raster, control)?;
        Ok((Heights::Tiles(tiles), greatest))
    }

    pub(super) fn raster(&self) -> &dyn Raster {
        match self {
            Heights::Own(raster) => *raster,
            Heights::Tiles(tiles) => tiles,
        }
    }
}

fn greatest_of(heights: &[f64]) -> f64 {
    // NaN gives way.
    heights.iter().fold(0.0f64, |most, h| most.max(h.abs()))
}

/// The greatest height of a grid, without its sign.
fn greatest(raster: &dyn Raster, control: &dyn Control) -> Result<f64, BuildError> {
    let all: Vec<_> = windows(raster, 1 << 20).collect();
    let one = |w: &Window| {
        if control.cancelled() {
            return Err(BuildError::Cancelled);
        }
        Ok(greatest_of(raster.window(*w)?.heights()))
    };
    Ok(super::each(&all, one)?.into_iter().fold(0.0, f64::max))
}

/// The heights of a grid in tiles of a store.
pub(super) struct Tiles<'a> {
    store: &'a dyn Store,
    columns: usize,
    rows: usize,
    /// Columns and rows of a tile.
    tile: [usize; 2],
    /// Those looked at of late: blocks reach over the borders of tiles, and lie beside each other.
    cache: BlockCache,
}

impl<'a> Tiles<'a> {
    /// A row of tiles takes at most so many bytes as f64, if one of a single row of samples does; so many are kept unpacked.
    fn new(raster: &dyn Raster, bytes: usize, store: &'a dyn Store) -> Self {
        let (columns, rows) = (raster.columns(), raster.rows());
        let most = (bytes / columns.saturating_mul(size_of::<f64>()).max(1)).clamp(1, ROWS);
        // Whole blocks of the grid, where several fit.
        let block = raster.block()[1].max(1);
        let high = if block <= most { most / block * block } else { most };
        Tiles { store, columns, rows, tile: [TILE / high, high], cache: BlockCache::new(bytes) }
    }

    /// With its size: what was put there for other tiles is never taken for one of these.
    fn name(&self, column: usize, row: usize) -> String {
        let [wide, high] = self.tile;
        format!("{column}-{row}-{wide}x{high}.heights")
    }

    /// Where the greatest height is put when all tiles are there.
    fn done(&self) -> String {
        let [wide, high] = self.tile;
        format!("greatest-{wide}x{high}.heights")
    }

    /// Puts all tiles there, unless they are; returns the greatest height, without its sign. Row after row of tiles, on one thread: so no block of the grid is unpacked twice, unless it is higher than a tile and the grid keeps too few.
    fn fill(&self, raster: &dyn Raster, control: &dyn Control) -> Result<f64, BuildError> {
        if self.store.has(&self.done())? {
            let bytes = self.store.get(&self.done())?;
            let whole = bytes.first_chunk().copied().ok_or(io::ErrorKind::InvalidData);
            return Ok(f64::from_le_bytes(whole.map_err(io::Error::from)?));
        }
        let [wide, high] = self.tile;
        let (mut most, mut tile) = (0.0f64, vec![]);
        for row in (0..self.rows).step_by(high) {
            if control.cancelled() {
                return Err(BuildError::Cancelled);
            }
            let band = raster.window(Window::new(0, row, self.columns, high.min(self.rows - row)))?;
            most = most.max(greatest_of(band.heights()));
            for column in (0..self.columns).step_by(wide) {
                tile.clear();
                for line in band.heights().chunks_exact(self.columns) {
                    tile.extend_from_slice(&line[column..self.columns.min(column + wide)]);
                }
                self.store.put(&self.name(column / wide, row / high), &pack(&tile))?;
            }
        }
        self.store.put(&self.done(), &most.to_le_bytes())?;
        Ok(most)
    }

    fn get(&self, column: usize, row: usize, samples: usize) -> io::Result<Arc<[f64]>> {
        let across = self.columns.div_ceil(self.tile[0]);
        self.cache.get((0, row * across + column), || {
            let bytes = self.store.get(&self.name(column, row))?;
            unpack(&bytes).filter(|all| all.len() == samples).ok_or_else(|| io::ErrorKind::InvalidData.into())
        })
    }
}

impl Raster for Tiles<'_> {
    fn columns(&self) -> usize {
        self.columns
    }

    fn rows(&self) -> usize {
        self.rows
    }

    fn block(&self) -> [usize; 2] {
        self.tile
    }

    fn read(&self, window: Window, out: &mut [f64]) -> Result<(), RasterError> {
        check_window(self.columns, self.rows, window, Some(out.len()))?;
        if out.is_empty() {
            return Ok(());
        }
        let [wide, high] = self.tile;
        for down in window.row / high..=(window.row + window.rows - 1) / high {
            for right in window.column / wide..=(window.column + window.columns - 1) / wide {
                let (column, row) = (right * wide, down * high);
                let all =
                    Window::new(column, row, wide.min(self.columns - column), high.min(self.rows - row));
                let Some(part) = all.intersection(&window) else { continue };
                let heights = self.get(right, down, all.columns * all.rows).map_err(|e| {
                    RasterError::Source { place: "the work folder".into(), what: e.to_string() }
                })?;
                for line in part.row..part.row + part.rows {
                    let from = (line - all.row) * all.columns + part.column - all.column;
                    let to = (line - window.row) * window.columns + part.column - window.column;
                    out[to..to + part.columns].copy_from_slice(&heights[from..from + part.columns]);
                }
            }
        }
        Ok(())
    }
}

/// No height, as i16.
const VOID: i16 = i16::MIN;

/// Heights as bytes, exact, in the smallest of three types that holds them.
fn pack(heights: &[f64]) -> Vec<u8> {
    let same = |a: f64, b: f64| a.to_bits() == b.to_bits();
    let whole = |h: f64| h.is_nan() || h as i16 != VOID && same(f64::from(h as i16), h);
    let single = |h: f64| h.is_nan() || same(f64::from(h as f32), h);
    let mut out = Vec::new();
    if heights.iter().all(|&h| whole(h)) {
        out.push(2);
        let number = |h: f64| if h.is_nan() { VOID } else { h as i16 };
        heights.iter().for_each(|&h| out.extend_from_slice(&number(h).to_le_bytes()));
    } else if heights.iter().all(|&h| single(h)) {
        out.push(4);
        heights.iter().for_each(|&h| out.extend_from_slice(&(h as f32).to_le_bytes()));
    } else {
        out.push(8);
        heights.iter().for_each(|&h| out.extend_from_slice(&h.to_le_bytes()));
    }
    out
}

/// `None` for what [`pack`] did not make.
fn unpack(bytes: &[u8]) -> Option<Vec<f64>> {
    let (kind, bytes) = bytes.split_first()?;
    let height = |h: i16| if h == VOID { f64::NAN } else { f64::from(h) };
    let (all, rest): (Vec<f64>, &[u8]) = match kind {
        2 => (
            bytes.as_chunks().0.iter().map(|b| height(i16::from_le_bytes(*b))).collect(),
            bytes.as_chunks::<2>().1,
        ),
        4 => (
            bytes.as_chunks().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect(),
            bytes.as_chunks::<4>().1,
        ),
        8 => (bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect(), bytes.as_chunks::<8>().1),
        _ => return None,
    };
    rest.is_empty().then_some(all)
}

#[cfg(test)]
mod tests {
    use super::super::{InMemory, blocks};
    use super::*;
    use crate::terrain::tin::Quiet;
    use crate::terrain::{BlockCache, Grid};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A grid whose file has strips, kept in a cache when they are unpacked.
    struct Strips {
        grid: Grid,
        rows: usize,
        cache: BlockCache,
        unpacked: AtomicUsize,
    }

    impl Raster for Strips {
        fn columns(&self) -> usize {
            self.grid.columns()
        }

        fn rows(&self) -> usize {
            self.grid.rows()
        }

        fn block(&self) -> [usize; 2] {
            [self.grid.columns(), self.rows]
        }

        fn read(&self, window: Window, out: &mut [f64]) -> Result<(), RasterError> {
            check_window(self.columns(), self.rows(), window, Some(out.len()))?;
            let columns = self.columns();
            for (line, row) in out.chunks_exact_mut(window.columns).zip(window.row..) {
                let strip = row / self.rows;
                let heights = self.cache.get((0, strip), || {
                    self.unpacked.fetch_add(1, Ordering::Relaxed);
                    let first = strip * self.rows;
                    let all = self.rows.min(self.grid.rows() - first);
                    Ok::<_, RasterError>(
                        self.grid.window(Window::new(0, first, columns, all))?.heights().to_vec(),
                    )
                })?;
                let from = (row % self.rows) * columns + window.column;
                line.copy_from_slice(&heights[from..from + window.columns]);
            }
            Ok(())
        }
    }

    #[test]
    fn strips_of_a_wide_grid_are_unpacked_once_each() {
        let (columns, rows, strip) = (1000, 50, 5);
        let height = |i: usize| match i % 977 {
            5 => f64::NAN,
            k => {
                (k * k % 61) as f64
                    + if i > 20_000 { 0.25 } else { 0.0 }
                    + if i > 35_000 { 1e-9 } else { 0.0 }
            }
        };
        let grid = Grid::new(columns, rows, (0..columns * rows).map(height).collect()).unwrap();
        let options = Options::default().with_cells(16).with_memory(1 << 20).with_floor(20.0);
        let (direct, store) = (InMemory::default(), InMemory::default());
        // Its cache holds 12 rows.
        let cache = BlockCache::new(12 * 8 * columns);
        let strips = Strips { grid: grid.clone(), rows: strip, cache, unpacked: AtomicUsize::new(0) };
        let all = |raster: &dyn Raster, store: &InMemory| {
            let blocks = blocks(raster, &options, store, &Quiet).unwrap();
            (*blocks.figures(), blocks.mesh().unwrap())
        };
        let (figures, mesh) = all(&grid.clone() as &dyn Raster, &direct);
        let (own, own_mesh) = all(&strips, &store);
        assert_eq!(strips.unpacked.load(Ordering::Relaxed), rows.div_ceil(strip));
        assert_eq!((figures.splits, figures.error), (own.splits, own.error));
        assert_eq!(mesh.splits, own_mesh.splits);
        // What is there is not read again.
        all(&strips, &store);
        assert_eq!(strips.unpacked.load(Ordering::Relaxed), rows.div_ceil(strip));
        // Tiles are those of the grid, bit by bit.
        let tiles = Tiles::new(&strips, options.memory / 8, &store);
        for w in [Window::new(0, 0, columns, rows), Window::new(7, 13, 900, 31), Window::new(999, 49, 1, 1)] {
            let bits = |g: Grid| g.heights().iter().map(|h| h.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(tiles.window(w).unwrap()), bits(grid.window(w).unwrap()));
        }
    }

    #[test]
    fn heights_come_back_bit_by_bit() {
        for (all, bytes) in [
            (vec![1.0, -32767.0, 32767.0, f64::NAN], 9),
            (vec![1.5, 32768.0, f64::NAN], 13),
            (vec![-32768.0], 5),
            (vec![-0.0], 5),
            (vec![0.1, 1e300], 17),
            (vec![], 1),
        ] {
            let packed = pack(&all);
            assert_eq!(packed.len(), bytes, "{all:?}");
            let back = unpack(&packed).unwrap();
            let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
            assert!(back.len() == all.len() && all.iter().zip(&back).all(|(a, b)| same(*a, *b)));
            assert!(unpack(&packed[..packed.len() - 1]).is_none());
        }
        assert!(unpack(&[3, 0, 0]).is_none());
    }
}
