//! Progressive terrain: the block hierarchy of a height grid ([`crate::terrain::block`]) as a progressive mesh.
//!
//! Blocks are made level by level, those of a level side by side; each goes to a [`Store`] when it is done, from where the next level takes what is left of it, and
//! an interrupted run what it had done. At the end the collapses of each block, the last first, become splits: from the root down ([`Blocks::code`]), with no more in memory than the blocks
//! on the way to one of the finest.
//!
//! The mesh has x = column, and y = height and z = row in the length of a step by a column; faces look up.

mod code;
mod number;
mod spool;
mod store;

pub use code::Coded;
pub use store::{InMemory, Store};

use crate::refine::ProgressiveMesh;
use crate::terrain::block::{Block, BlockError, BlockHead, Layout, Relief, Sheet, join, leaf};
use crate::terrain::{Raster, RasterError};
use number::{Assembly, Frame, MOST_FACES, Numbers};
use spool::Heights;
use std::sync::atomic::{AtomicUsize, Ordering};

/// How a progressive terrain is made. Start from `Options::default()` and set what differs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// At full detail every sample is within this of the mesh; at 0 every sample is a vertex.
    pub floor: f64,
    /// Steps along a side of a block of the finest level. Larger ones lock fewer vertices, but take more memory. With 256 a flight over the Grand Canyon shows 0.2 % fewer faces, and
    /// ETOPO5 takes a quarter more time; with 64 flights show 4 to 7 % more.
    pub cells: usize,
    /// About how many bytes of heights and blocks to hold at once. Where a block has more heights than a 32nd of it, it is measured against the least and greatest of squares of them,
    /// which makes bounds of the coarsest blocks a little larger.
    pub memory: usize,
    /// Lengths of a step by a column and by a row, in the unit of heights.
    pub spacing: [f64; 2],
}

impl Default for Options {
    fn default() -> Self {
        Options { floor: 0.0, cells: 128, memory: 384 << 20, spacing: [1.0; 2] }
    }
}

impl Options {
    /// With every sample within this at full detail.
    #[must_use]
    pub fn with_floor(mut self, floor: f64) -> Self {
        self.floor = floor;
        self
    }

    /// With blocks of so many steps a side.
    #[must_use]
    pub fn with_cells(mut self, cells: usize) -> Self {
        self.cells = cells;
        self
    }

    /// With about so many bytes of memory.
    #[must_use]
    pub fn with_memory(mut self, bytes: usize) -> Self {
        self.memory = bytes;
        self
    }

    /// With steps of this length by a column and by a row.
    #[must_use]
    pub fn with_spacing(mut self, spacing: [f64; 2]) -> Self {
        self.spacing = spacing;
        self
    }

    /// How long a step by a row and a unit of height are, in steps by a column.
    fn scale(&self) -> [f64; 2] {
        [self.spacing[1] / self.spacing[0], 1.0 / self.spacing[0]]
    }

    /// Heights, or cells of them, that one block is measured against.
    fn most_heights(&self) -> usize {
        (self.memory / 32).max(1 << 12)
    }
}

/// Watches and stops the work. Threads call it.
pub use crate::terrain::tin::Control;

/// Why there is no progressive terrain.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The grid has no cell, or blocks have none, or more samples than ids can name.
    #[error(
        "{columns} x {rows} samples in blocks of {cells}: at least 2 x 2 samples are needed, and blocks of 2 to 16,384 steps"
    )]
    Layout {
        /// Samples in a row.
        columns: usize,
        /// Samples in a column.
        rows: usize,
        /// Steps along a side of a block.
        cells: usize,
    },
    /// A spacing of no length.
    #[error("steps by columns and rows must have a length above 0, and not out of all proportion")]
    Spacing,
    /// A floor that is no number, or negative.
    #[error("a floor must be a number, 0 or more")]
    Floor,
    /// No three neighbouring samples are valid.
    #[error("no three neighbouring samples are valid: there is nothing to triangulate")]
    Nothing,
    /// Blocks were not made.
    #[error(transparent)]
    Block(#[from] BlockError),
    /// What was put aside could not be written or read.
    #[error("the work folder: {0}")]
    Store(#[from] std::io::Error),
    /// The file could not be written.
    #[error("{0}")]
    Write(std::io::Error),
    /// More triangles than a progressive mesh can number.
    #[error(
        "{0} triangles are more than a progressive mesh can number (2^29); a larger --floor leaves fewer"
    )]
    TooLarge(u64),
    /// Stopped by [`Control::cancelled`]. Finished blocks are in the store.
    #[error("cancelled")]
    Cancelled,
}

impl From<RasterError> for BuildError {
    fn from(e: RasterError) -> Self {
        BuildError::Block(e.into())
    }
}

/// A progressive terrain.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Built {
    /// The mesh, with bounds on differences of height that are proven for every order of refinement.
    pub mesh: ProgressiveMesh,
    /// [`Options::spacing`].
    pub spacing: [f64; 2],
    /// The greatest difference of height between a sample and full detail, in the unit of heights.
    pub error: f64,
    /// Levels of blocks.
    pub levels: u32,
    /// Blocks of all levels.
    pub blocks: usize,
    /// Those of them that the store had already.
    pub found: usize,
}

/// What a terrain is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Figures {
    /// [`Options::spacing`].
    pub spacing: [f64; 2],
    /// The greatest difference of height between a sample and full detail, in the unit of heights.
    pub error: f64,
    /// Levels of blocks.
    pub levels: u32,
    /// Blocks of all levels.
    pub blocks: usize,
    /// Those of them that the store had already.
    pub found: usize,
    /// Triangles of the base.
    pub base_triangles: usize,
    /// Triangles at full detail.
    pub triangles: usize,
    /// Vertices at full detail.
    pub vertices: usize,
    /// Splits.
    pub splits: usize,
}

/// The blocks of a terrain, all made: in the store.
pub struct Blocks<'a> {
    work: Work<'a>,
    /// Of every level, the finest first, and its blocks in rows.
    heads: Vec<Vec<BlockHead>>,
    root: Sheet,
    frame: Frame,
    figures: Figures,
}

/// Builds a progressive terrain in memory: [`blocks`], and then all their collapses numbered as one mesh, which takes some 350 B a vertex. [`Blocks::code`] writes without.
///
/// # Errors
/// [`BuildError`].
pub fn build(
    raster: &dyn Raster,
    options: &Options,
    store: &dyn Store,
    control: &dyn Control,
) -> Result<Built, BuildError> {
    let blocks = blocks(raster, options, store, control)?;
    let Figures { spacing, error, levels, blocks: count, found, .. } = blocks.figures;
    Ok(Built { mesh: blocks.mesh()?, spacing, error, levels, blocks: count, found })
}

/// Makes the blocks of a progressive terrain. The same for any number of threads, and whatever the store has already of the same grid and options.
///
/// O(samples log samples). Memory: about [`Options::memory`].
///
/// # Errors
/// [`BuildError`].
pub fn blocks<'a>(
    raster: &'a dyn Raster,
    options: &'a Options,
    store: &'a dyn Store,
    control: &'a dyn Control,
) -> Result<Blocks<'a>, BuildError> {
    let (columns, rows, cells) = (raster.columns(), raster.rows(), options.cells);
    let layout = Layout::new(columns, rows, cells).ok_or(BuildError::Layout { columns, rows, cells })?;
    if !(options.floor >= 0.0 && options.floor.is_finite()) {
        return Err(BuildError::Floor);
    }
    let scale = options.scale();
    if !scale.into_iter().all(|s| (1e-12..1e12).contains(&s)) {
        return Err(BuildError::Spacing);
    }
    let (heights, greatest) = Heights::of(raster, options, store, control)?;
    let frame = Frame::new(scale, greatest);
    let layout = layout.with_scale(scale).with_slack(frame.slack(columns, rows));
    let levels = layout.levels();
    let total: usize = (0..levels).map(|l| layout.blocks(l).iter().product::<usize>()).sum();
    let spacing = options.spacing;
    let rounding = frame.rounding() * spacing[0];
    // What rounding takes of the floor is not there for triangles.
    let floor = match options.floor > rounding {
        true if rounding > 0.0 => (options.floor - rounding).next_down(),
        _ => options.floor,
    };
    let work = Work { heights, layout, options, floor, store, control };
    let (done, found) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let mut heads: Vec<Vec<BlockHead>> = vec![];
    for level in 0..levels {
        let all = in_rows(&layout, level);
        let mut of_level = Vec::with_capacity(all.len());
        // Blocks beside each other take no more memory than there are threads.
        let side_by_side = work.at_once(level);
        let group = if side_by_side >= threads() { all.len() } else { side_by_side };
        for group in all.chunks(group.max(1)) {
            let one = |at: &[usize; 2]| {
                if control.cancelled() {
                    return Err(BuildError::Cancelled);
                }
                let (head, known) = work.make(level, *at)?;
                found.fetch_add(usize::from(known), Ordering::Relaxed);
                // Each level has as many samples to look at as the first, but far fewer vertices.
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                control.progress(0.8 * count as f64 / total as f64);
                Ok(head)
            };
            of_level.extend(each(group, one)?);
        }
        heads.push(of_level);
    }
    let root = work.sheet(levels - 1, [0, 0])?;
    if root.faces.is_empty() {
        return Err(BuildError::Nothing);
    }
    let all = || heads.iter().flatten();
    let (base_triangles, splits) = (root.faces.len(), all().map(|h| h.collapses as usize).sum::<usize>());
    let new: u64 = all().map(|h| u64::from(h.faces - h.faces_left)).sum();
    let triangles = base_triangles as u64 + new;
    if triangles >= MOST_FACES {
        return Err(BuildError::TooLarge(triangles));
    }
    let figures = Figures {
        spacing,
        error: all().map(|h| h.error).fold(0.0, f64::max) + rounding,
        levels,
        blocks: total,
        found: found.into_inner(),
        base_triangles,
        triangles: triangles as usize,
        vertices: root.vertices.len() + splits,
        splits,
    };
    Ok(Blocks { work, heads, root, frame, figures })
}

/// The blocks of a level, row by row.
fn in_rows(layout: &Layout, level: u32) -> Vec<[usize; 2]> {
    let [across, down] = layout.blocks(level);
    (0..down).flat_map(|y| (0..across).map(move |x| [x, y])).collect()
}

/// `f` of each, in order; on several threads with feature `parallel`. The first error in order.
pub(crate) fn each<T: Sync, U: Send, E: Send>(
    all: &[T],
    f: impl Fn(&T) -> Result<U, E> + Sync,
) -> Result<Vec<U>, E> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        let results: Vec<_> = all.par_iter().with_max_len(1).map(&f).collect();
        results.into_iter().collect()
    }
    #[cfg(not(feature = "parallel"))]
    all.iter().map(f).collect()
}

/// Blocks that [`each`] works on at once.
fn threads() -> usize {
    #[cfg(feature = "parallel")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "parallel"))]
    1
}

struct Work<'a> {
    heights: Heights<'a>,
    layout: Layout,
    options: &'a Options,
    /// That of the options, less what rounding of the mesh adds.
    floor: f64,
    store: &'a dyn Store,
    control: &'a dyn Control,
}

fn name(level: u32, [column, row]: [usize; 2], what: &str) -> String {
    format!("{level}-{column}-{row}.{what}")
}

/// What a sample of the finest level takes while it is worked on, about: triangles, their links, chains of former vertices, and the queue.
const BYTES: usize = 400;

impl Work<'_> {
    /// Blocks of a level that may be worked on at once.
    fn at_once(&self, level: u32) -> usize {
        let heights = self.layout.window(level, [0, 0]).samples().unwrap_or(usize::MAX);
        let own = 4 * heights.min(self.options.most_heights());
        let mesh = BYTES * (self.options.cells + 1).pow(2);
        (self.options.memory / (own + mesh).max(1)).max(1)
    }

    /// Makes a block unless the store has it; true if it had.
    fn make(&self, level: u32, at: [usize; 2]) -> Result<(BlockHead, bool), BuildError> {
        let (block_name, sheet_name) = (name(level, at, "block"), name(level, at, "sheet"));
        // The sheets of blocks that were joined are gone.
        let joined = name(level + 1, [at[0] / 2, at[1] / 2], "block");
        if self.store.has(&block_name)? && (self.store.has(&sheet_name)? || self.store.has(&joined)?) {
            let start = self.store.start(&block_name, BlockHead::BYTES)?;
            return Ok((BlockHead::from_bytes(&start).map_err(damaged)?, true));
        }
        let mut below = vec![];
        let block = if level == 0 {
            leaf(self.heights.raster(), &self.layout, at, self.floor)?
        } else {
            below = children(&self.layout, level, at);
            let sheets = below.iter().map(|&child| self.sheet(level - 1, child)).collect::<Result<_, _>>()?;
            let window = self.layout.window(level, at);
            let relief = Relief::read(self.heights.raster(), window, self.options.most_heights())?;
            join(sheets, &relief, &self.layout.rules(level, at, 0))?
        };
        self.store.put(&sheet_name, &block.sheet.to_bytes())?;
        self.store.put(&block_name, &block.to_bytes())?;
        for child in below {
            self.store.remove(&name(level - 1, child, "sheet"))?;
        }
        Ok((block.head(), false))
    }

    fn sheet(&self, level: u32, at: [usize; 2]) -> Result<Sheet, BuildError> {
        Sheet::from_bytes(&self.store.get(&name(level, at, "sheet"))?).map_err(damaged)
    }

    fn block(&self, level: u32, at: [usize; 2]) -> Result<Block, BuildError> {
        Block::from_bytes(&self.store.get(&name(level, at, "block"))?).map_err(damaged)
    }
}

impl Blocks<'_> {
    /// What they come to.
    #[must_use]
    pub fn figures(&self) -> &Figures {
        &self.figures
    }

    /// All splits as one mesh, from the root down, each level row by row.
    ///
    /// # Errors
    /// [`BuildError`].
    pub fn mesh(&self) -> Result<ProgressiveMesh, BuildError> {
        let (vertices, faces) = (self.root.vertices.len() as u32, self.root.faces.len() as u32);
        let mut assembly = Assembly::new(self.frame, vertices, faces);
        let mut here = vec![([0, 0], Numbers::of(&self.root))];
        for level in (0..self.figures.levels).rev() {
            let mut below = vec![];
            for (at, numbers) in here {
                if self.work.control.cancelled() {
                    return Err(BuildError::Cancelled);
                }
                let of_children = assembly.add(&self.work.block(level, at)?, &numbers)?;
                if level > 0 {
                    below.extend(children(&self.work.layout, level, at).into_iter().zip(of_children));
                }
            }
            below.sort_by_key(|(at, _)| [at[1], at[0]]);
            here = below;
        }
        self.work.control.progress(1.0);
        assembly.mesh(self.frame.base(&self.root)).map_err(|e| damaged_by(e.to_string()))
    }
}

fn damaged(e: crate::terrain::block::Damaged) -> BuildError {
    damaged_by(e.to_string())
}

fn damaged_by(what: String) -> BuildError {
    BuildError::Store(std::io::Error::new(std::io::ErrorKind::InvalidData, what))
}

/// The blocks that one is joined of, in rows.
fn children(layout: &Layout, level: u32, [column, row]: [usize; 2]) -> Vec<[usize; 2]> {
    let [across, down] = layout.blocks(level - 1);
    let all = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| [2 * column + x, 2 * row + y]);
    all.into_iter().filter(|[x, y]| *x < across && *y < down).collect()
}
