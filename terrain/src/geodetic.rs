//! The geodetic tiling of the globe (EPSG:4326 in two columns at level 0, as TMS counts it), and a grid brought onto its lattice.

use crate::tin::Cuts;
use crate::{Affine, Grid};

/// How far a point of the lattice may be from a sample, in steps, to count as that sample.
const NEAR: f64 = 1e-6;

/// A grid on a lattice of degrees that every tile border of the geodetic scheme is part of, down to a level. Tiles of level z are
/// 180 / 2^z degrees wide and high, counted from 180 degrees west and the south pole.
#[derive(Clone, Debug)]
pub struct Geodetic {
    /// Heights at the lattice points within the grid given, rows from north to south.
    pub grid: Grid,
    /// The finest level.
    pub level: u32,
    /// Steps of the lattice along a tile of that level.
    pub steps: usize,
    /// Whether all lattice points are samples, so that nothing was interpolated.
    pub exact: bool,
    /// Steps from 180 degrees west to the first column.
    left: usize,
    /// Steps from the south pole to the first row.
    top: usize,
    /// From columns and rows of the grid given to those of the lattice.
    from_samples: Affine,
    /// The grid goes round the globe, but does not begin where tiles do: it was turned.
    turned: bool,
}

/// Why there are no such tiles.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GeodeticError {
    /// The grid is turned, mirrored, or not in degrees.
    #[error("rows must run from west to east and columns from north to south, in degrees")]
    Turned,
    /// Longitudes or latitudes that the scheme does not have.
    #[error(
        "degrees {from} to {to} do not lie within -180 to 180 (longitude) or -90 to 90 (latitude) even after a turn of 360"
    )]
    Outside {
        /// The least.
        from: f64,
        /// The greatest.
        to: f64,
    },
    /// The lattice would have too many points.
    #[error("{0} x {1} lattice points are too many: at most 65,535 along a side and 2^30 in all")]
    TooMany(usize, usize),
    /// The lattice has less than two points along a side.
    #[error("the grid is smaller than a step of the lattice")]
    TooSmall,
}

impl Geodetic {
    /// Brings a grid of degrees onto a lattice no coarser than it, for about `across` tiles along its longer side at the finest level.
    ///
    /// Between samples heights are those of the grid's own triangles (diagonals from `(x, y)` to `(x + 1, y + 1)`); points beside a void
    /// are void. A grid whose samples lie on the lattice, to a millionth of a step, keeps them. O(lattice points).
    ///
    /// # Errors
    /// [`GeodeticError`].
    pub fn new(grid: &Grid, transform: Affine, across: usize) -> Result<Self, GeodeticError> {
        let [dx, shear, mut west, other, dy, north] = transform.0;
        if !(dx > 0.0 && dy < 0.0 && shear == 0.0 && other == 0.0) || grid.columns() < 2 || grid.rows() < 2 {
            return Err(GeodeticError::Turned);
        }
        let (width, height) = ((grid.columns() - 1) as f64 * dx, (grid.rows() - 1) as f64 * -dy);
        let slack = NEAR * dx.max(-dy);
        // 0 to 360 is as common as -180 to 180.
        if west >= 180.0 - slack {
            west -= 360.0;
        }
        // Only where whole steps go round, and once: else what lies behind the seam would be moved, or be there twice.
        let rest = ((360.0 / dx).round() * dx - 360.0).abs();
        let closed = width + dx >= 360.0 - slack && width <= 360.0 + 2.0 * dx && rest <= 0.01 * dx;
        if closed && !(west >= -180.0 - slack && west + width <= 180.0 + slack) {
            let (turned, first) = turn(grid, west, dx);
            let mut made = Geodetic::new(&turned, Affine([dx, 0.0, first, 0.0, dy, north]), across)?;
            made.turned = true;
            made.from_samples.0[2] = (west + 180.0) / made.step() - made.left as f64;
            return Ok(made);
        }
        for (from, to, most) in [(west, west + width, 180.0), (north - height, north, 90.0)] {
            if !(from >= -most - slack && to <= most + slack) {
                return Err(GeodeticError::Outside { from, to });
            }
        }
        let (tile, finest) = (width.max(height) / across.max(1) as f64, dx.min(-dy));
        // The level whose tiles come closest, as a factor.
        let level = (180.0 / tile).log2().round().clamp(0.0, 24.0) as u32;
        let side = 180.0 / 2f64.powi(level as i32);
        let steps = (side / finest - NEAR).ceil().max(1.0) as usize;
        let step = side / steps as f64;
        // Whole steps of the lattice within the grid.
        let least = |from: f64| (from / step - NEAR).ceil().max(0.0) as usize;
        let most = |to: f64| (to / step + NEAR).floor().max(0.0) as usize;
        let (left, right) = (least(west + 180.0), most(west + width + 180.0));
        let (bottom, top) = (least(north - height + 90.0), most(north + 90.0));
        if left >= right || bottom >= top {
            return Err(GeodeticError::TooSmall);
        }
        let (columns, rows) = (right - left + 1, top - bottom + 1);
        if columns.max(rows) > 65_535 || columns * rows > 1 << 30 {
            return Err(GeodeticError::TooMany(columns, rows));
        }
        let mut exact = true;
        let mut place = |at: f64, samples: usize| {
            let whole = at.round();
            let at = if (at - whole).abs() <= NEAR { whole } else { at };
            exact &= at == whole;
            let first = (at.max(0.0) as usize).min(samples - 2);
            (first, at - first as f64)
        };
        let along: Vec<(usize, f64)> = (0..columns)
            .map(|c| place(((left + c) as f64 * step - 180.0 - west) / dx, grid.columns()))
            .collect();
        let down: Vec<(usize, f64)> =
            (0..rows).map(|r| place((north - ((top - r) as f64 * step - 90.0)) / -dy, grid.rows())).collect();
        let mut heights = Vec::with_capacity(columns * rows);
        for &(y, fy) in &down {
            heights.extend(along.iter().map(|&(x, fx)| height_at(grid, [x, y], [fx, fy])));
        }
        let grid = Grid::of_finite(columns, rows, heights);
        let from_samples = Affine([
            dx / step,
            0.0,
            (west + 180.0) / step - left as f64,
            0.0,
            -dy / step,
            top as f64 - (north + 90.0) / step,
        ]);
        Ok(Geodetic { grid, level, steps, exact, left, top, from_samples, turned: false })
    }

    /// Degrees of a lattice step.
    #[must_use]
    pub fn step(&self) -> f64 {
        180.0 / 2f64.powi(self.level as i32) / self.steps as f64
    }

    /// From columns and rows of the lattice to degrees.
    #[must_use]
    pub fn transform(&self) -> Affine {
        let step = self.step();
        Affine::north_up([self.left as f64 * step - 180.0, self.top as f64 * step - 90.0], [step, step])
    }

    /// Steps of the lattice once round the globe, if the grid goes round it and was turned so that it begins at 180 degrees west: places beyond the last column are those before the first then.
    #[must_use]
    pub fn turn(&self) -> Option<f64> {
        self.turned.then(|| 360.0 / self.step())
    }

    /// Where a column and a row of the grid that it was made of lie on the lattice, in columns and rows; of one that was [turned](Geodetic::turn) that may be a turn away.
    #[must_use]
    pub fn on_lattice(&self, point: [f64; 2]) -> [f64; 2] {
        self.from_samples.apply(point)
    }

    /// Steps along a tile of a level, at most the finest.
    fn period(&self, level: u32) -> usize {
        self.steps << (self.level - level.min(self.level))
    }

    /// Where the tiles of a level, at most the finest, have their borders; the lattice's own borders are cuts too.
    #[must_use]
    pub fn cuts(&self, level: u32) -> Cuts {
        let period = self.period(level);
        let (last_column, last_row) = (self.grid.columns() - 1, self.grid.rows() - 1);
        let cut = |last: usize, is: &dyn Fn(usize) -> bool| {
            (0..=last).filter(|&i| i == 0 || i == last || is(i)).collect()
        };
        Cuts {
            columns: cut(last_column, &|c| (self.left + c).is_multiple_of(period)),
            rows: cut(last_row, &|r| (self.top - r).is_multiple_of(period)),
        }
    }

    /// The number of a tile in its level, from the west and from the south, that holds the samples right and below of a column and a row, which
    /// are not the last.
    #[must_use]
    pub fn tile_of(&self, level: u32, [column, row]: [usize; 2]) -> [usize; 2] {
        let period = self.period(level);
        [(self.left + column) / period, (self.top - row - 1) / period]
    }

    /// Where a column and a row lie within a tile of a level: 0 to 1 from the west and from the south.
    #[must_use]
    pub fn within(&self, level: u32, [x, y]: [usize; 2], [column, row]: [u32; 2]) -> [f64; 2] {
        let period = self.period(level);
        let part = |steps: usize, tile: usize| (steps as i64 - (tile * period) as i64) as f64 / period as f64;
        [part(self.left + column as usize, x), part(self.top - row as usize, y)]
    }
}

/// A grid once round the globe from its first sample at 180 degrees west or beside on, to 180 degrees east if it has one there, and the longitude of that first sample.
fn turn(grid: &Grid, west: f64, dx: f64) -> (Grid, f64) {
    let around = (360.0 / dx).round().max(1.0) as i64;
    let first = ((-180.0 - west) / dx - NEAR).ceil() as i64;
    let last = ((180.0 - west) / dx + NEAR).floor() as i64;
    // A grid that ends where it began has a column more; it is not looked at.
    let columns: Vec<usize> =
        (first..=last).map(|c| (c.rem_euclid(around) as usize).min(grid.columns() - 1)).collect();
    let row = |y: usize| &grid.heights()[y * grid.columns()..][..grid.columns()];
    let heights = (0..grid.rows()).flat_map(|y| columns.iter().map(move |&x| row(y)[x])).collect();
    (Grid::of_finite(columns.len(), grid.rows(), heights), west + first as f64 * dx)
}

/// The height of the grid's own triangle at a place in the cell from this sample on. Corners without a weight may be void.
fn height_at(grid: &Grid, [x, y]: [usize; 2], [fx, fy]: [f64; 2]) -> f64 {
    let at = |dx: usize, dy: usize| grid.height(x + dx, y + dy).unwrap_or(f64::NAN);
    let third = if fx >= fy { at(1, 0) } else { at(0, 1) };
    let (low, high) = (fx.min(fy), fx.max(fy));
    let parts = [(1.0 - high, at(0, 0)), (high - low, third), (low, at(1, 1))];
    parts.into_iter().filter(|&(weight, _)| weight > 0.0).map(|(weight, h)| weight * h).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(columns: usize, rows: usize) -> Grid {
        let height = |i: usize| 3.0 * (i % columns) as f64 - 2.0 * (i / columns) as f64;
        Grid::new(columns, rows, (0..columns * rows).map(height).collect()).unwrap()
    }

    #[test]
    fn samples_on_the_lattice_stay_as_they_are() {
        // 45 degrees by steps of 0.5: a tile of level 2 has 90 of them.
        let grid = plane(91, 91);
        let made = Geodetic::new(&grid, Affine::north_up([-45.0, 45.0], [0.5, 0.5]), 1).unwrap();
        assert_eq!((made.level, made.steps, made.exact), (2, 90, true));
        assert_eq!(made.grid.heights(), grid.heights());
        assert_eq!(made.transform(), Affine::north_up([-45.0, 45.0], [0.5, 0.5]));
        assert_eq!(made.cuts(2).tiles(), [1, 1]);
        assert_eq!(made.tile_of(2, [0, 0]), [3, 2]);
        assert_eq!(made.within(2, [3, 2], [90, 0]), [1.0, 1.0]);
        let four = Geodetic::new(&grid, Affine::north_up([-45.0, 45.0], [0.5, 0.5]), 4).unwrap();
        assert_eq!((four.level, four.cuts(4).tiles(), four.cuts(3).tiles()), (4, [4, 4], [2, 2]));
        assert_eq!((four.cuts(0).tiles(), four.tile_of(0, [0, 0])), ([1, 1], [0, 0]));
    }

    #[test]
    fn a_grid_round_the_globe_may_begin_anywhere() {
        // Height is the longitude, -180 to 175 (180 is -180), times 100 plus the row.
        let of =
            |longitude: f64, row: usize| ((longitude + 180.0).rem_euclid(360.0) - 180.0) * 100.0 + row as f64;
        for (west, columns, shift) in
            [(0.0, 72, 0.0), (0.0, 73, 0.0), (90.0, 72, 0.0), (2.5, 72, 2.5), (-200.0, 72, 0.0)]
        {
            let heights =
                (0..37 * columns).map(|i| of(west + 5.0 * (i % columns) as f64, i / columns)).collect();
            let grid = Grid::new(columns, 37, heights).unwrap();
            let transform = Affine::north_up([west, 90.0], [5.0, 5.0]);
            let made = Geodetic::new(&grid, transform, 4).unwrap();
            // Lattices begin at the border of a tile: what lies half a step beside is interpolated.
            assert_eq!(made.exact, shift == 0.0, "{west} {columns}");
            let (lattice, turn) = (made.transform(), made.turn().unwrap());
            assert_eq!(turn, 360.0 / made.step());
            for x in 0..made.grid.columns() {
                let [longitude, _] = lattice.apply([x as f64, 0.0]);
                assert!((-180.0..=180.0).contains(&longitude));
                // A plane but for the step at 180 degrees.
                if longitude.abs() < 174.0 {
                    let height = made.grid.height(x, 0).unwrap();
                    assert!((height - 100.0 * longitude).abs() < 1e-6, "{west} {longitude}: {height}");
                }
            }
            if shift == 0.0 {
                let last = made.grid.columns() - 1;
                assert_eq!(made.grid.columns(), 73);
                assert_eq!(
                    (made.grid.height(0, 3), made.grid.height(last, 3)),
                    (Some(-17_997.0), Some(-17_997.0))
                );
                assert_eq!(made.cuts(0).tiles(), [2, 1]);
            }
            // Samples are found again, perhaps a turn away.
            let [x, y] = made.on_lattice([7.0, 5.0]);
            let [longitude, latitude] = lattice.apply([x.rem_euclid(turn), y]);
            let own = ((west + 35.0 + 180.0).rem_euclid(360.0)) - 180.0;
            assert!((longitude - own).abs() < 1e-9 && (latitude - 65.0).abs() < 1e-9);
        }
        // Not all the way round: no.
        let grid = plane(60, 3);
        assert!(matches!(
            Geodetic::new(&grid, Affine::north_up([10.0, 5.0], [5.0, 5.0]), 1),
            Err(GeodeticError::Outside { .. })
        ));
    }

    #[test]
    fn between_samples_the_plane_goes_on() {
        let grid = plane(101, 81);
        let transform = Affine::north_up([7.123, 50.987], [0.01, 0.01]);
        let made = Geodetic::new(&grid, transform, 3).unwrap();
        assert!(!made.exact && made.step() <= 0.01);
        let lattice = made.transform();
        for (x, y) in [(0, 0), (17, 31), (made.grid.columns() - 1, made.grid.rows() - 1)] {
            let [column, row] = transform.invert(lattice.apply([x as f64, y as f64])).unwrap();
            let height = made.grid.height(x, y).unwrap();
            assert!((height - (3.0 * column - 2.0 * row)).abs() < 1e-6, "{x} {y}: {height}");
        }
        let [u, v] = made.within(made.level, made.tile_of(made.level, [5, 7]), [5, 7]);
        assert!((0.0..1.0).contains(&u) && 0.0 < v && v <= 1.0);
    }

    #[test]
    fn points_beside_a_void_are_void() {
        let mut heights = vec![1.0; 25];
        heights[12] = f64::NAN;
        let grid = Grid::new(5, 5, heights).unwrap();
        assert!(height_at(&grid, [1, 1], [0.5, 0.25]).is_nan());
        assert_eq!(height_at(&grid, [1, 1], [0.5, 0.0]), 1.0);
        // The diagonal (2, 1) to (3, 2) has the triangle beside the void.
        assert_eq!(height_at(&grid, [2, 1], [0.5, 0.25]), 1.0);
        assert!(height_at(&grid, [2, 1], [0.25, 0.5]).is_nan());
    }

    #[test]
    fn what_the_scheme_does_not_have_is_refused() {
        let grid = plane(11, 11);
        let fails = |t: [f64; 6]| Geodetic::new(&grid, Affine(t), 1).map(|_| ()).unwrap_err();
        assert_eq!(fails([1.0, 0.1, 0.0, 0.0, -1.0, 0.0]), GeodeticError::Turned);
        assert_eq!(fails([1.0, 0.0, 0.0, 0.0, 1.0, 0.0]), GeodeticError::Turned);
        assert!(matches!(fails([1.0, 0.0, 175.0, 0.0, -1.0, 0.0]), GeodeticError::Outside { .. }));
        assert!(matches!(fails([1.0, 0.0, 0.0, 0.0, -1.0, 95.0]), GeodeticError::Outside { .. }));
        // Round the globe, but not in whole steps, or more than once.
        for (columns, step) in [(53, 7.0), (800, 1.0)] {
            let round = Geodetic::new(&plane(columns, 3), Affine::north_up([-100.0, 5.0], [step, 5.0]), 1);
            assert!(matches!(round.map(|_| ()), Err(GeodeticError::Outside { .. })));
        }
        // A turn of 360 brings it in.
        let east = Geodetic::new(&grid, Affine::north_up([200.0, 10.0], [1.0, 1.0]), 1).unwrap();
        assert!((east.transform().0[2] + 160.0).abs() < 1.0);
        let cell = Geodetic::new(&plane(2, 2), Affine::north_up([0.7, 0.7], [1.0, 1.0]), 1);
        assert_eq!(cell.map(|_| ()).unwrap_err(), GeodeticError::TooSmall);
    }
}
