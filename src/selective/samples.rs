//! What a judge of terrain knows of a raster beforehand: the range of heights of every tile of samples, and whether one is void.

use crate::terrain::{Grid, Raster, RasterError, Window, windows};
use rustc_hash::FxHashMap;
use std::ops::Range;

/// Samples along a side of a tile. Smaller ones are culled better, larger ones have less of a margin to read.
pub(super) const SIDE: usize = 128;

/// Samples read at once for the tiles: 8 MiB.
const AT_ONCE: usize = 1 << 20;

/// A square of samples; those at the right and at the lower border may be smaller.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tile {
    /// The least and the greatest height; the least is the larger if all are void.
    pub range: [f64; 2],
    /// Some are void.
    pub void: bool,
}

/// The tiles of a raster: 24 bytes for every 16,384 samples.
#[derive(Clone, Debug)]
pub(super) struct Tiles {
    columns: usize,
    rows: usize,
    across: usize,
    all: Vec<Tile>,
}

impl Tiles {
    /// Reads all of a raster, window by window. O(samples).
    pub(super) fn read(raster: &dyn Raster) -> Result<Tiles, RasterError> {
        let (columns, rows) = (raster.columns(), raster.rows());
        let across = columns.div_ceil(SIDE);
        let none = Tile { range: [f64::INFINITY, f64::NEG_INFINITY], void: false };
        let mut all = vec![none; across * rows.div_ceil(SIDE)];
        let mut heights = vec![];
        for w in windows(raster, AT_ONCE) {
            heights.resize(w.columns * w.rows, f64::NAN);
            raster.read(w, &mut heights)?;
            for (line, y) in heights.chunks_exact(w.columns.max(1)).zip(w.row..) {
                for (&h, x) in line.iter().zip(w.column..) {
                    let tile = &mut all[y / SIDE * across + x / SIDE];
                    tile.void |= h.is_nan();
                    // NaN gives way.
                    tile.range = [tile.range[0].min(h), tile.range[1].max(h)];
                }
            }
        }
        Ok(Tiles { columns, rows, across, all })
    }

    /// The least and the greatest height of all; `None` if every sample is void.
    pub(super) fn range(&self) -> Option<[f64; 2]> {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let all = self.all.iter().fold(none, |r, t| [r[0].min(t.range[0]), r[1].max(t.range[1])]);
        (all[0] <= all[1]).then_some(all)
    }

    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    pub(super) fn tile(&self, k: usize) -> &Tile {
        &self.all[k]
    }

    /// The samples of a tile.
    pub(super) fn window(&self, k: usize) -> Window {
        let (column, row) = (k % self.across * SIDE, k / self.across * SIDE);
        Window::new(column, row, SIDE.min(self.columns - column), SIDE.min(self.rows - row))
    }

    /// The tiles that have a sample in these columns and rows.
    pub(super) fn over(
        &self,
        columns: Range<usize>,
        rows: Range<usize>,
    ) -> impl Iterator<Item = usize> + use<> {
        let tiles =
            |r: &Range<usize>| if r.is_empty() { 0..0 } else { r.start / SIDE..(r.end - 1) / SIDE + 1 };
        let (x, y, across) = (tiles(&columns), tiles(&rows), self.across);
        y.flat_map(move |y| x.clone().map(move |x| y * across + x))
    }
}

/// Which samples are valid: tiles with void ones are read when they are asked about.
pub(super) struct Validity<'a> {
    raster: &'a dyn Raster,
    tiles: &'a Tiles,
    read: FxHashMap<usize, Grid>,
    /// The first error; from then on nothing is valid.
    error: Option<RasterError>,
}

/// Tiles held at most: 16 MiB.
const HELD: usize = 128;

impl<'a> Validity<'a> {
    pub(super) fn new(raster: &'a dyn Raster, tiles: &'a Tiles) -> Self {
        Validity { raster, tiles, read: FxHashMap::default(), error: None }
    }

    /// Whether there is a sample and it has a height.
    pub(super) fn of(&mut self, x: i64, y: i64) -> bool {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return false };
        if x >= self.tiles.columns || y >= self.tiles.rows {
            return false;
        }
        let k = y / SIDE * self.tiles.across + x / SIDE;
        if !self.tiles.tile(k).void {
            return true;
        }
        if !self.read.contains_key(&k) {
            if self.read.len() >= HELD {
                self.read.clear();
            }
            match self.raster.window(self.tiles.window(k)) {
                Ok(grid) => drop(self.read.insert(k, grid)),
                Err(e) => {
                    self.error.get_or_insert(e);
                    return false;
                }
            }
        }
        self.read.get(&k).is_some_and(|g| g.height(x % SIDE, y % SIDE).is_some())
    }

    /// What reading came to.
    pub(super) fn done(self) -> Result<(), RasterError> {
        self.error.map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_hold_what_lies_in_them() {
        let (columns, rows) = (SIDE + 3, 2 * SIDE + 1);
        let height = |i: usize| if i == 5 { f64::NAN } else { (i * 7919 % 1009) as f64 };
        let grid = Grid::new(columns, rows, (0..columns * rows).map(height).collect()).unwrap();
        let tiles = Tiles::read(&grid).unwrap();
        assert_eq!((tiles.len(), tiles.range()), (6, Some([0.0, 1008.0])));
        for k in 0..6 {
            let part = grid.window(tiles.window(k)).unwrap();
            let (low, high) = part.range().unwrap();
            assert_eq!(tiles.tile(k).range, [low, high]);
            assert_eq!(tiles.tile(k).void, k == 0);
        }
        assert_eq!(tiles.over(0..columns, SIDE..SIDE + 1).collect::<Vec<_>>(), [2, 3]);
        assert_eq!(tiles.over(3..3, 0..5).count(), 0);
        let mut valid = Validity::new(&grid, &tiles);
        assert!(!valid.of(5, 0) && valid.of(4, 0) && valid.of(SIDE as i64, 0));
        assert!(!valid.of(-1, 0) && !valid.of(0, rows as i64));
        valid.done().unwrap();
    }
}
