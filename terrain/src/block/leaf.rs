//! The blocks that hold samples, and how a grid is divided into them.

use super::collapse::{Rules, collapse};
use super::join::Block;
use super::relief::{Gauge, Relief};
use super::sheet::{Sheet, Vertex};
use crate::tin::start::{full, network};
use crate::{Grid, Raster, RasterError, Window};

/// How a grid is divided: squares of samples at level 0, which share their border samples; 2 x 2 blocks are one of the next level, up to a level of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layout {
    columns: usize,
    rows: usize,
    cells: usize,
    scale: [f64; 2],
    /// What radii are enlarged by.
    slack: f64,
}

/// Samples along a side: products of two lengths are exact in f64.
const MOST_SAMPLES: usize = 1 << 26;

/// Why a block was not made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BlockError {
    /// Its heights could not be read.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// Heights are rounded to f32, which is too coarse for the error asked for.
    #[error("an error of {error} is finer than f32 can tell at these heights: at least {least} is possible")]
    TooFine {
        /// The error asked for.
        error: f64,
        /// The least that can be kept.
        least: f64,
    },
    /// The blocks joined do not belong side by side.
    #[error("the blocks to be joined are no neighbours of one terrain")]
    NoNeighbours,
}

impl Layout {
    /// A grid of this size in squares of `cells` steps a side. `None` without a cell, or beyond 2^26 samples a side.
    #[must_use]
    pub fn new(columns: usize, rows: usize, cells: usize) -> Option<Self> {
        let fits = |n: usize| (2..=MOST_SAMPLES).contains(&n);
        (fits(columns) && fits(rows) && (2..=1 << 14).contains(&cells)).then_some(Layout {
            columns,
            rows,
            cells,
            scale: [1.0; 2],
            slack: 0.0,
        })
    }

    /// With a step by a row and a unit of height as long as this, in steps by a column: radii are measured so. By default all are as long.
    #[must_use]
    pub fn with_scale(mut self, scale: [f64; 2]) -> Self {
        self.scale = scale;
        self
    }

    /// With this slack of radii ([`Rules::slack`]); 0 by default.
    #[must_use]
    pub fn with_slack(mut self, slack: f64) -> Self {
        self.slack = slack;
        self
    }

    /// Samples in a row, and in a column.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.columns, self.rows]
    }

    /// Steps along a side of a block of level 0.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.cells
    }

    /// Levels, at least 1.
    #[must_use]
    pub fn levels(&self) -> u32 {
        (0..).find(|&l| self.blocks(l) == [1, 1]).unwrap_or(0) + 1
    }

    /// Blocks in a row and in a column of a level.
    #[must_use]
    pub fn blocks(&self, level: u32) -> [usize; 2] {
        [self.columns, self.rows].map(|n| (n - 1).div_ceil(self.cells).div_ceil(1 << level.min(40)))
    }

    /// The samples of a block, borders included.
    #[must_use]
    pub fn window(&self, level: u32, [column, row]: [usize; 2]) -> Window {
        let side = self.cells << level.min(40);
        let along = |k: usize, n: usize| (k * side, ((k + 1) * side).min(n - 1) - k * side + 1);
        let ((x, columns), (y, rows)) = (along(column, self.columns), along(row, self.rows));
        Window::new(x, y, columns, rows)
    }

    /// What stays in a block when it is simplified to `vertices`.
    #[must_use]
    pub fn rules(&self, level: u32, at: [usize; 2], vertices: usize) -> Rules {
        let w = self.window(level, at);
        let (x, y) = (w.column + w.columns - 1, w.row + w.rows - 1);
        Rules {
            rectangle: [w.column as i32, x as i32, w.row as i32, y as i32],
            shared: [w.column > 0, x + 1 < self.columns, w.row > 0, y + 1 < self.rows],
            vertices,
            scale: self.scale,
            slack: self.slack,
        }
    }
}

/// Makes a block of level 0: triangulates its samples, each within `floor` of the triangles, or (at 0) each a vertex; then collapses three vertices of four, or as many as go if it is the only block. O(samples log samples).
///
/// On the lines between blocks the vertices depend on the samples there and beside only, so neighbours agree.
///
/// # Errors
/// [`BlockError::Raster`], [`BlockError::TooFine`].
pub fn leaf(raster: &dyn Raster, layout: &Layout, at: [usize; 2], floor: f64) -> Result<Block, BlockError> {
    let window = layout.window(0, at);
    let samples = window.columns * window.rows;
    // One more all around, as far as there is one.
    let (x, y) = (window.column.saturating_sub(1), window.row.saturating_sub(1));
    let end = |a: usize, n: usize, size: usize| (a + n + 1).min(size);
    let (x1, y1) =
        (end(window.column, window.columns, layout.columns), end(window.row, window.rows, layout.rows));
    let wide = raster.window(Window::new(x, y, x1 - x, y1 - y))?;
    let own = Window::new(window.column - x, window.row - y, window.columns, window.rows);
    let grid = wide.window(own)?;
    let relief = Relief::read(&Shifted { grid: &grid, window }, window, samples)?;
    let (points, faces) = if floor > 0.0 {
        let border = border(&wide, own, floor);
        network(&grid, floor, &border).map_err(|least| BlockError::TooFine { error: floor, least })?
    } else {
        full(&grid)
    };
    let vertices: Vec<Vertex> = points
        .into_iter()
        .map(|(x, y)| Vertex {
            x: window.column as i32 + x,
            y: window.row as i32 + y,
            z: grid.heights()[y as usize * window.columns + x as usize] as f32,
        })
        .collect();
    let rules = layout.rules(0, at, 0).for_part(vertices.len());
    let started = vertices.clone();
    let error = if floor > 0.0 {
        let mut gauge = Gauge::new(&relief);
        let error = |t: &[u32; 3]| gauge.error(t.map(|v| vertices[v as usize]), f64::INFINITY);
        faces.iter().map(error).fold(0.0, f64::max)
    } else if faces.is_empty() {
        0.0
    } else {
        relief.at_corners()
    };
    let made = collapse(Sheet::new(vertices, faces, rules.scale), &relief, &rules)
        .ok_or(BlockError::NoNeighbours)?;
    // Insertion has kept the floor in integers; what was measured has an allowance for the arithmetic.
    let error = if floor > 0.0 { error.min(floor) } else { error };
    Ok(Block::new(started, made, vec![], error))
}

/// A grid that is a window of a larger raster.
struct Shifted<'a> {
    grid: &'a Grid,
    window: Window,
}

impl Raster for Shifted<'_> {
    fn columns(&self) -> usize {
        self.window.column + self.window.columns
    }

    fn rows(&self) -> usize {
        self.window.row + self.window.rows
    }

    fn read(&self, w: Window, out: &mut [f64]) -> Result<(), RasterError> {
        let own = Window { column: w.column - self.window.column, row: w.row - self.window.row, ..w };
        self.grid.read(own, out)
    }
}

/// The vertices on the border of a window: along each side the ends, and samples between as are needed to keep the others within half the error; all of them where a void sample is
/// near. `wide` is a sample wider, where the grid goes on.
fn border(wide: &Grid, own: Window, floor: f64) -> Vec<(i32, i32)> {
    let (w, h) = (own.columns as i32 - 1, own.rows as i32 - 1);
    let mut points = vec![];
    for (from, step, across, n) in [
        ((0, 0), (1, 0), (0, 1), w),
        ((0, h), (1, 0), (0, 1), w),
        ((0, 0), (0, 1), (1, 0), h),
        ((w, 0), (0, 1), (1, 0), h),
    ] {
        let at = |k: i32| (from.0 + k * step.0, from.1 + k * step.1);
        let height = |(x, y): (i32, i32)| {
            let (x, y) = (own.column as i32 + x, own.row as i32 + y);
            let inside = x >= 0 && y >= 0 && (x as usize) < wide.columns() && (y as usize) < wide.rows();
            // Beyond the grid nothing is void.
            if inside { wide.heights()[y as usize * wide.columns() + x as usize] } else { 0.0 }
        };
        let beside = |k: i32, side: i32| height((at(k).0 + side * across.0, at(k).1 + side * across.1));
        if (0..=n).any(|k| (-1..=1).any(|side| beside(k, side).is_nan())) {
            points.extend((0..=n).map(at));
            continue;
        }
        // Douglas & Peucker 1973, by height.
        let line: Vec<f64> = (0..=n).map(|k| height(at(k))).collect();
        let mut parts = vec![(0usize, n as usize)];
        points.extend([at(0), at(n)]);
        while let Some((a, b)) = parts.pop() {
            let slope = (line[b] - line[a]) / (b - a) as f64;
            let miss = |k: usize| (line[a] + slope * (k - a) as f64 - line[k]).abs();
            let far = (a + 1..b).max_by(|&p, &q| miss(p).total_cmp(&miss(q)).then(q.cmp(&p)));
            if let Some(k) = far.filter(|&k| miss(k) > 0.5 * floor) {
                points.push(at(k as i32));
                parts.extend([(a, k), (k, b)]);
            }
        }
    }
    points.sort_unstable();
    points.dedup();
    points
}
