//! From options to a network.

use super::blocks::Pass;
use super::breaklines::Placed;
use super::field::{Field, Tolerance};
use super::frame::{greedy_in_parts, has_parts};
use super::greedy::{Goal, greedy};
use super::network::Network;
use super::options::{Contract, Control, Made, Method, Options, Outlined, TinError};
use super::patch::Rules;
use super::region::Region;
use super::regular::regular;
use crate::Grid;
use std::cell::Cell;

/// Where the blocks of a pass lie: shifted so that what one pass locked is free in the next. A third pass takes 1.3 % more triangles away, and
/// a quarter more time (fuji, grandcanyon, N57E011).
const SHIFTS: [f64; 2] = [0.0, 0.5];

/// Makes a network of a grid.
///
/// Greedy insertion takes O(n log v) for n samples and v vertices, improving it O(n) a pass, decimation O(n) and memory for two triangles a
/// sample. The same network comes out for any number of threads.
///
/// # Errors
/// [`TinError`]. With a count of triangles alone, a grid whose outline needs more gets those it needs.
pub fn triangulate(grid: &Grid, options: &Options, control: &dyn Control) -> Result<Made, TinError> {
    let (columns, rows) = (grid.columns(), grid.rows());
    if columns.max(rows) > 65_535 || columns * rows >= u32::MAX as usize {
        return Err(TinError::TooLarge { columns, rows });
    }
    let error = options.max_error.unwrap_or(0.0);
    if !(error >= 0.0 && error.is_finite()) {
        return Err(TinError::BadError);
    }
    let lines = breaklines(grid, options)?;
    let known = matches!(options.method, Method::Greedy | Method::Best);
    match options.outline_tolerance {
        Some(_) if !known || options.contract != Contract::Samples => return Err(TinError::NoOutline),
        Some(t) if !(t >= 0.0 && t.is_finite()) => return Err(TinError::BadOutline),
        _ => {}
    }
    let field = Field::new(grid, error);
    let mut region = Region::new(&field);
    if region.triangles == 0 {
        return Err(TinError::Nothing);
    }
    if let Some(tolerance) = options.outline_tolerance {
        region.simplify_outline(&field, tolerance);
    }
    let work = Work { field: &field, region: &region, lines: &lines, placed: Cell::default(), control };
    let (network, step) = match (options.max_error, options.triangles) {
        (None, Some(most)) if options.method != Method::Regular => work.fewer(options, most, 0.0)?,
        (asked, most) => {
            // Without an error to keep, what rounding changes is kept.
            let kept = if asked.is_some() { error } else { field.rounding };
            let tolerance = field.tolerance(kept).ok_or_else(|| too_fine(grid, &field, error))?;
            let made = work.make(options, tolerance).ok_or(TinError::Cancelled)?;
            match most {
                Some(most) if made.0.triangles.len() > most && options.method != Method::Regular => {
                    work.fewer(options, most, error)?
                }
                _ => made,
            }
        }
    };
    let outline = region.simplified.as_ref().map(|outline| Outlined {
        corners: outline.corners,
        kept: outline.sides.len(),
        dropped: network.dropped(&field, &region),
    });
    let errors = network.errors(&field, grid.heights(), outline.is_some());
    let tin = network.into_tin(&field, [0, 0]);
    let (valid, isolated, grid_triangles) = (region.valid, region.isolated, region.triangles);
    let Placed { bent, outside } = work.placed.get();
    Ok(Made { tin, errors, valid, isolated, grid_triangles, step, bent, outside, outline })
}

/// The breaklines, checked.
pub(super) fn breaklines(grid: &Grid, options: &Options) -> Result<Vec<[(i32, i32); 2]>, TinError> {
    let known = matches!(options.method, Method::Greedy | Method::Best);
    if !options.breaklines.is_empty() && (!known || options.contract != Contract::Samples) {
        return Err(TinError::NoBreaklines);
    }
    let within = |&[x, y]: &[u32; 2]| (x as usize) < grid.columns() && (y as usize) < grid.rows();
    let point = |[x, y]: [u32; 2]| (x as i32, y as i32);
    let line = |line: &[[u32; 2]; 2]| match line.iter().all(within) {
        true => Ok(line.map(point)),
        false => Err(TinError::BadBreakline(*line)),
    };
    options.breaklines.iter().map(line).collect()
}

/// Improves what greedy insertion made. `None` when cancelled.
pub(super) fn better(
    network: &mut Network,
    field: &Field,
    rules: Rules,
    control: &dyn Control,
) -> Option<()> {
    for (i, shift) in SHIFTS.into_iter().enumerate() {
        let done = [i, i + 1].map(|i| i as f64 / SHIFTS.len() as f64);
        network.improve(field, Pass { shift, rules, done }, control)?;
    }
    Some(())
}

pub(super) fn too_fine(grid: &Grid, field: &Field, error: f64) -> TinError {
    let greatest = grid.range().map_or(0.0, |(l, g)| l.abs().max(g.abs()));
    TinError::TooFine { error, least: field.rounding, greatest }
}

/// Triangles that the best method leaves of those of greedy insertion, and the most networks made on the search for a count.
const SHARE: f64 = 0.52;
const TRIES: usize = 10;

struct Work<'a> {
    field: &'a Field,
    region: &'a Region,
    lines: &'a [[(i32, i32); 2]],
    /// What became of the lines: the same whenever a network is made.
    placed: Cell<Placed>,
    control: &'a dyn Control,
}

impl Work<'_> {
    /// At most `most` triangles, with about the least error that allows them: the error that greedy insertion has with as many as the method
    /// will halve, then a search. With counts within 3 % it ends.
    fn fewer(
        &self,
        options: &Options,
        most: usize,
        least: f64,
    ) -> Result<(Network, Option<usize>), TinError> {
        let field = self.field;
        let exact = field.tolerance(field.rounding).unwrap_or_default();
        let share = if options.method == Method::Greedy { 1.0 } else { SHARE };
        let surface = options.contract == Contract::Surface;
        let goal = Goal { tolerance: exact, surface, triangles: (most as f64 / share) as usize };
        let start = self.greedy(goal).ok_or(TinError::Cancelled)?;
        if options.method == Method::Greedy {
            return Ok((start, None));
        }
        let mut error = start.greatest(field).max(least).max(field.quantum);
        // Errors known to give too many triangles, and few enough.
        let (mut many, mut few) = (least, f64::INFINITY);
        let mut best: Option<(Network, Option<usize>)> = None;
        for _ in 0..TRIES {
            let tolerance = field.tolerance(error).unwrap_or_default();
            let made = self.make(options, tolerance).ok_or(TinError::Cancelled)?;
            let count = made.0.triangles.len();
            if count <= most {
                few = error;
                best = Some(made);
                if count * 100 >= most * 97 {
                    break;
                }
            } else {
                many = error;
                if best.is_none() && error > 4.0 * field.span() {
                    // What is left is the outline.
                    best = Some(made);
                    break;
                }
            }
            // Counts go with the error to the power of about -1.4; aim 1 % below.
            let aim = error * (count as f64 / (most as f64 * 0.99)).powf(1.0 / 1.4);
            error = if few.is_infinite() {
                aim.max(many * 1.02)
            } else if aim > many && aim < few {
                aim
            } else {
                many.midpoint(few)
            };
        }
        match best {
            Some(best) => Ok(best),
            None => self
                .make(options, field.tolerance(4.0 * field.span()).unwrap_or_default())
                .ok_or(TinError::Cancelled),
        }
    }

    /// `None` when cancelled.
    fn make(&self, options: &Options, tolerance: Tolerance) -> Option<(Network, Option<usize>)> {
        let surface = options.contract == Contract::Surface;
        let free_heights = options.method == Method::Best && !options.on_samples;
        let rules = Rules { tolerance, surface, free_heights, border_stays: false, spread: None };
        let goal = Goal { tolerance, surface, triangles: options.triangles.unwrap_or(usize::MAX) };
        let network = match options.method {
            Method::Regular => {
                let asked = options.max_error.map(|_| tolerance);
                let (network, step) =
                    regular(self.field, self.region, asked, surface, options.triangles, self.control)?;
                return Some((network, Some(step)));
            }
            Method::Greedy => self.greedy(goal)?,
            Method::Decimation => self.decimation(rules)?,
            Method::Best => self.best(rules)?,
        };
        Some((network, None))
    }

    fn greedy(&self, goal: Goal) -> Option<Network> {
        let (mesh, placed) = greedy(self.field, self.region, goal, self.lines, self.control)?;
        self.placed.set(placed);
        Some(Network::of(&mesh, self.field))
    }

    fn best(&self, rules: Rules) -> Option<Network> {
        let Rules { tolerance, surface, .. } = rules;
        let whole = surface || !self.lines.is_empty() || self.region.simplified.is_some();
        let mut network = if whole || !has_parts(self.field) {
            self.greedy(Goal { tolerance, surface, triangles: usize::MAX })?
        } else {
            greedy_in_parts(self.field, self.region, tolerance, self.control)?
        };
        better(&mut network, self.field, rules, self.control)?;
        Some(network)
    }

    fn decimation(&self, rules: Rules) -> Option<Network> {
        let mut network = Network::full(self.field, self.region);
        // Blocks have the same number of triangles in every pass, so they grow.
        for i in 0.. {
            let before = network.triangles.len();
            let pass = Pass { shift: SHIFTS[i % SHIFTS.len()], rules, done: [0.0, 1.0] };
            network.improve(self.field, pass, self.control)?;
            if network.triangles.len() * 100 > before * 99 {
                break;
            }
        }
        Some(network)
    }
}
