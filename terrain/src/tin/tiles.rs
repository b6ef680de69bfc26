//! Tiles: networks beside each other that share their borders to the bit, at every level.
//!
//! What a border looks like follows from the samples on it, the level's error, where voids lie beside it, and where breaklines reach it; never from
//! what is inside of a tile. So tiles can be made in any order, on any machine, and fit.
//!
//! Where the error holds between the samples too ([`Contract::Surface`]), every sample of a border is a vertex. Otherwise a triangle on a border is judged along
//! every edge of the grid from the border's samples to those beside it, which the border must not look at: with a long side on the border and any heights beside it,
//! no choice of triangles keeps the error there. With all of them there is one at least, the grid's own.

use super::breaklines::Placed;
use super::field::{Field, Tolerance};
use super::frame::{Frame, Part};
use super::greedy::{Goal, complete};
use super::line;
use super::make::{better, breaklines, too_fine};
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
    lines: Vec<[(i32, i32); 2]>,
}

impl<'a> Tiling<'a> {
    /// Tiles by [`Method::Greedy`] or [`Method::Best`], with errors none of which is above `coarsest`. `options.max_error` and
    /// `options.triangles` are not looked at: [`Tiling::level`] has an error. Breaklines become sides, led over the nearest sample where they
    /// cross borders. O(samples).
    ///
    /// # Errors
    /// [`TinError`]; [`TinError::NoTiles`] for other methods, and for an outline that is simplified.
    pub fn new(grid: &'a Grid, options: &Options, coarsest: f64) -> Result<Self, TinError> {
        let (columns, rows) = (grid.columns(), grid.rows());
        if columns.max(rows) > 65_535 || columns * rows >= u32::MAX as usize {
            return Err(TinError::TooLarge { columns, rows });
        }
        if !(coarsest >= 0.0 && coarsest.is_finite()) {
            return Err(TinError::BadError);
        }
        let known = matches!(options.method, Method::Greedy | Method::Best);
        if !known || options.outline_tolerance.is_some() {
            return Err(TinError::NoTiles);
        }
        let lines = breaklines(grid, options)?;
        let field = Field::new(grid, coarsest);
        let region = Region::new(&field);
        if region.triangles == 0 {
            return Err(TinError::Nothing);
        }
        Ok(Tiling { grid, options: options.clone(), field, region, lines })
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
        let spread = spread.clamp(1, 1 << 20);
        let on_cuts = if self.options.contract == Contract::Surface { 1 } else { spread };
        let frame = Frame::new((&self.field, &self.region), cuts, tolerance, on_cuts, &self.lines);
        Ok(Level { tiling: self, frame, tolerance, spread })
    }
}

/// The tiles of a level.
#[derive(Clone, Debug)]
pub struct Level<'a> {
    tiling: &'a Tiling<'a>,
    frame: Frame,
    tolerance: Tolerance,
    spread: usize,
}

impl Level<'_> {
    /// Where it is cut.
    #[must_use]
    pub fn cuts(&self) -> &Cuts {
        &self.frame.cuts
    }

    /// Places where a breakline was led over the nearest sample of a cut that it crosses between samples.
    #[must_use]
    pub fn bent(&self) -> usize {
        self.frame.bent
    }

    /// Makes a tile: vertices by column and row of the whole grid. `None` where no three neighbouring samples of it are valid. Counts of
    /// samples are the tile's own, borders included.
    ///
    /// # Errors
    /// [`TinError::Cancelled`]; [`TinError::BadCuts`] if there is no such tile.
    pub fn tile(&self, tile: [usize; 2], control: &dyn Control) -> Result<Option<Made>, TinError> {
        let [across, down] = self.cuts().tiles();
        if tile[0] >= across || tile[1] >= down {
            return Err(TinError::BadCuts);
        }
        let Some(part) = self.frame.part(&self.tiling.field, tile) else { return Ok(None) };
        let Part { first: [x0, y0], field, region, mut mesh, lines } = part;
        let Placed { bent, outside } = mesh.constrain_lines(&lines);
        let spread = Spread { step: self.spread, first: [x0, y0] };
        for y in (1..field.rows - 1).filter(|&y| spread.has_row(y)) {
            for x in (1..field.columns - 1).filter(|&x| spread.has_column(x)) {
                mesh.insert((x, y));
            }
        }
        // Samples on borders are within the tolerance of them already, so that none becomes a vertex.
        let options = &self.tiling.options;
        let surface = options.contract == Contract::Surface;
        let goal = Goal { tolerance: self.tolerance, surface, triangles: usize::MAX };
        complete(&field, &mut mesh, goal, control).ok_or(TinError::Cancelled)?;
        let mut network = Network::of(&mesh, &field);
        if options.method == Method::Best {
            let rules = Rules {
                tolerance: self.tolerance,
                surface,
                free_heights: !options.on_samples,
                border_stays: true,
                spread: Some(spread),
            };
            better(&mut network, &field, rules, control).ok_or(TinError::Cancelled)?;
        }
        let columns = self.tiling.grid.columns();
        let (x1, y1) = (x0 + field.columns as usize - 1, y0 + field.rows as usize - 1);
        let heights: Vec<f64> = (y0..=y1)
            .flat_map(|y| &self.tiling.grid.heights()[y * columns + x0..=y * columns + x1])
            .copied()
            .collect();
        let errors = network.errors(&field, &heights, surface);
        let tin = network.into_tin(&field, [x0, y0].map(|c| c as u32));
        let (valid, isolated, grid_triangles) = (region.valid, region.isolated, region.triangles);
        Ok(Some(Made { tin, errors, valid, isolated, grid_triangles, bent, outside, ..Made::default() }))
    }
}
