//! Tiles: networks beside each other that share their borders to the bit, at every level.
//!
//! What a border looks like follows from the samples on it, the level's error, and where voids lie beside it; never from what is inside of
//! a tile. So tiles can be made in any order, on any machine, and fit.

use super::delaunay::Triangulation;
use super::field::{Field, Tolerance};
use super::greedy::{Goal, refine};
use super::line;
use super::make::{better, too_fine};
use super::network::Network;
use super::options::{Contract, Control, Made, Method, Options, TinError};
use super::patch::{Rules, Spread};
use super::region::Region;
use crate::{Grid, Window};

/// Where a level is cut: columns and rows of samples, in ascending order, the first and the last of the grid among them. Tiles
/// share the samples of the cuts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cuts {
    /// Columns.
    pub columns: Vec<usize>,
    /// Rows.
    pub rows: Vec<usize>,
}

impl Cuts {
    /// `across` tiles along each side, as even as whole samples allow; fewer where the grid has fewer steps.
    #[must_use]
    pub fn even(columns: usize, rows: usize, across: usize) -> Self {
        let cut = |samples: usize| {
            let steps = samples.saturating_sub(1);
            let parts = across.clamp(1, steps.max(1));
            // Up to 2^32 steps and tiles: no overflow.
            (0..=parts).map(|i| (i as u128 * steps as u128 / parts as u128) as usize).collect()
        };
        Cuts { columns: cut(columns), rows: cut(rows) }
    }

    /// Every second cut, and the last: two by two tiles become one.
    #[must_use]
    pub fn halved(&self) -> Self {
        let half = |cuts: &[usize]| {
            let mut half: Vec<usize> = cuts.iter().copied().step_by(2).collect();
            half.extend(cuts.last().filter(|&last| half.last() != Some(last)));
            half
        };
        Cuts { columns: half(&self.columns), rows: half(&self.rows) }
    }

    /// Tiles along a row and along a column.
    #[must_use]
    pub fn tiles(&self) -> [usize; 2] {
        [self.columns.len().saturating_sub(1), self.rows.len().saturating_sub(1)]
    }

    /// The samples of a tile, its borders included.
    #[must_use]
    pub fn window(&self, [i, j]: [usize; 2]) -> Window {
        let (x, y) = (self.columns[i], self.rows[j]);
        Window::new(x, y, self.columns[i + 1] - x + 1, self.rows[j + 1] - y + 1)
    }

    fn fit(&self, grid: &Grid) -> bool {
        let fits = |cuts: &[usize], samples: usize| {
            cuts.len() >= 2
                && cuts[0] == 0
                && cuts[cuts.len() - 1] + 1 == samples
                && cuts.windows(2).all(|w| w[0] < w[1])
        };
        fits(&self.columns, grid.columns()) && fits(&self.rows, grid.rows())
    }
}

/// A grid that becomes tiles.
#[derive(Clone, Debug)]
pub struct Tiling<'a> {
    grid: &'a Grid,
    options: Options,
    field: Field,
    region: Region,
}

impl<'a> Tiling<'a> {
    /// Tiles by [`Method::Greedy`] or [`Method::Best`], with errors at the samples, none of them above `coarsest`. `options.max_error` and
    /// `options.triangles` are not looked at: [`Tiling::level`] has an error. O(samples).
    ///
    /// # Errors
    /// [`TinError`]; [`TinError::NoTiles`] for other methods and contracts.
    pub fn new(grid: &'a Grid, options: &Options, coarsest: f64) -> Result<Self, TinError> {
        let (columns, rows) = (grid.columns(), grid.rows());
        if columns.max(rows) > 65_535 || columns * rows >= u32::MAX as usize {
            return Err(TinError::TooLarge { columns, rows });
        }
        if !(coarsest >= 0.0 && coarsest.is_finite()) {
            return Err(TinError::BadError);
        }
        let known = matches!(options.method, Method::Greedy | Method::Best);
        if !known || options.contract != Contract::Samples || !options.breaklines.is_empty() {
            return Err(TinError::NoTiles);
        }
        let field = Field::new(grid, coarsest);
        let region = Region::new(&field);
        if region.triangles == 0 {
            return Err(TinError::Nothing);
        }
        Ok(Tiling { grid, options: options.clone(), field, region })
    }

    /// Valid samples, and those of them that no triangle of three valid neighbours has.
    #[must_use]
    pub fn valid_and_isolated(&self) -> [usize; 2] {
        [self.region.valid, self.region.isolated]
    }

    /// The triangles that the grid itself would be.
    #[must_use]
    pub fn grid_triangles(&self) -> usize {
        self.region.triangles
    }

    /// The tiles of a level: its borders are made, its tiles not yet. O(samples on borders x the length of their pieces).
    ///
    /// # Errors
    /// [`TinError`]; [`TinError::BadCuts`] for cuts that do not fit the grid.
    pub fn level(&self, cuts: Cuts, error: f64) -> Result<Level<'_>, TinError> {
        self.level_with(cuts, error, line::LONGEST)
    }

    /// The same with a vertex at every sample whose column and row are multiples of `spread`, and on borders no farther than that apart: for grids
    /// that do not lie on a plane, where a flat triangle must not be too large.
    ///
    /// # Errors
    /// As [`Tiling::level`].
    pub fn level_with(&self, cuts: Cuts, error: f64, spread: usize) -> Result<Level<'_>, TinError> {
        if !(error >= 0.0 && error.is_finite()) {
            return Err(TinError::BadError);
        }
        if !cuts.fit(self.grid) {
            return Err(TinError::BadCuts);
        }
        let tolerance = self.field.tolerance(error).ok_or_else(|| too_fine(self.grid, &self.field, error))?;
        let (field, region) = (&self.field, &self.region);
        let along = |cuts: &[usize],
                     ends: &[usize],
                     at: &dyn Fn(i32, i32) -> i32,
                     beside: &dyn Fn(i32, i32) -> [bool; 2]| {
            let line = |&c: &usize| {
                let c = c as i32;
                border(ends, tolerance, spread, &|k| at(c, k), &|k| beside(c, k))
            };
            cuts.iter().map(line).collect::<Vec<_>>()
        };
        let columns =
            along(&cuts.columns, &cuts.rows, &|x, y| field.at(x, y), &|x, y| region.beside_column(x, y));
        let rows = along(&cuts.rows, &cuts.columns, &|y, x| field.at(x, y), &|y, x| region.beside_row(x, y));
        Ok(Level { tiling: self, cuts, tolerance, spread: spread.clamp(1, 1 << 20), columns, rows })
    }
}

/// The vertices along a line: where tiles meet, where what lies beside it begins or ends, and the fewest between.
fn border(
    ends: &[usize],
    tolerance: Tolerance,
    spread: usize,
    at: &dyn Fn(i32) -> i32,
    beside: &dyn Fn(i32) -> [bool; 2],
) -> Vec<i32> {
    let mut vertices = vec![];
    for pair in ends.windows(2) {
        let (first, last) = (pair[0] as i32, pair[1] as i32);
        let mut from = first;
        while from < last {
            let kind = beside(from);
            let to = (from + 1..last).find(|&k| beside(k) != kind).unwrap_or(last);
            if kind != [false, false] {
                let heights: Vec<i32> = (from..=to).map(at).collect();
                vertices
                    .extend(line::simplify(&heights, tolerance, spread).into_iter().map(|k| from + k as i32));
            }
            from = to;
        }
    }
    vertices.dedup();
    vertices
}

/// The tiles of a level.
#[derive(Clone, Debug)]
pub struct Level<'a> {
    tiling: &'a Tiling<'a>,
    cuts: Cuts,
    tolerance: Tolerance,
    spread: usize,
    /// Rows of the vertices on each cut by a column.
    columns: Vec<Vec<i32>>,
    /// Columns of those on each cut by a row.
    rows: Vec<Vec<i32>>,
}

impl Level<'_> {
    /// Where it is cut.
    #[must_use]
    pub fn cuts(&self) -> &Cuts {
        &self.cuts
    }

    /// Makes a tile: vertices by column and row of the whole grid. `None` where no three neighbouring samples of it are valid. Counts of
    /// samples are the tile's own, borders included.
    ///
    /// # Errors
    /// [`TinError::Cancelled`]; [`TinError::BadCuts`] if there is no such tile.
    pub fn tile(&self, [i, j]: [usize; 2], control: &dyn Control) -> Result<Option<Made>, TinError> {
        let [across, down] = self.cuts.tiles();
        if i >= across || j >= down {
            return Err(TinError::BadCuts);
        }
        let window = self.cuts.window([i, j]);
        let [x0, y0] = [window.column, window.row];
        let [x1, y1] = [x0 + window.columns - 1, y0 + window.rows - 1];
        let field = self.tiling.field.part([x0, y0].map(|c| c as i32), [x1, y1].map(|c| c as i32));
        let region = Region::new(&field);
        if region.triangles == 0 {
            return Ok(None);
        }
        let mut mesh = Triangulation::new(field.columns, field.rows);
        let within = |line: &[i32], from: usize, to: usize| -> Vec<i32> {
            let (from, to) = (from as i32, to as i32);
            line.iter().filter(|&&k| from <= k && k <= to).map(|k| k - from).collect()
        };
        for (x, cut) in [(0, i), (field.columns - 1, i + 1)] {
            within(&self.columns[cut], y0, y1).into_iter().for_each(|y| _ = mesh.insert((x, y)));
        }
        for (y, cut) in [(0, j), (field.rows - 1, j + 1)] {
            within(&self.rows[cut], x0, x1).into_iter().for_each(|x| _ = mesh.insert((x, y)));
        }
        region.constrain(&mut mesh);
        let spread = Spread { step: self.spread, first: [x0, y0] };
        for y in (1..field.rows - 1).filter(|&y| spread.has_row(y)) {
            for x in (1..field.columns - 1).filter(|&x| spread.has_column(x)) {
                mesh.insert((x, y));
            }
        }
        // Samples on borders are within the tolerance of them already, so that none becomes a vertex.
        let goal = Goal { tolerance: self.tolerance, surface: false, triangles: usize::MAX };
        refine(&field, &mut mesh, goal, control).ok_or(TinError::Cancelled)?;
        let mut network = Network::of(&mesh, &field);
        let options = &self.tiling.options;
        if options.method == Method::Best {
            let rules = Rules {
                tolerance: self.tolerance,
                surface: false,
                free_heights: !options.on_samples,
                border_stays: true,
                spread: Some(spread),
            };
            better(&mut network, &field, rules, control).ok_or(TinError::Cancelled)?;
        }
        let columns = self.tiling.grid.columns();
        let heights: Vec<f64> = (y0..=y1)
            .flat_map(|y| &self.tiling.grid.heights()[y * columns + x0..=y * columns + x1])
            .copied()
            .collect();
        let errors = network.errors(&field, &heights);
        let tin = network.into_tin(&field, [x0, y0].map(|c| c as u32));
        let (valid, isolated, grid_triangles) = (region.valid, region.isolated, region.triangles);
        Ok(Some(Made { tin, errors, valid, isolated, grid_triangles, ..Made::default() }))
    }
}
