//! What to make, what comes of it, what can go wrong.

/// Watches and stops the work. Threads call it.
pub trait Control: Sync {
    /// `done` of the work, 0..=1, roughly; it may fall back a little.
    fn progress(&self, done: f64) {
        let _ = done;
    }

    /// True asks for a stop.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Says nothing, never stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Control for Quiet {}

/// How a network is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// Every k-th row and column, the last ones, and the outline, for the greatest k found that keeps the error.
    Regular,
    /// Greedy insertion (Garland & Heckbert 1995): Delaunay, the farthest sample next. Vertices are samples.
    Greedy,
    /// Decimation with exact error (after Hoppe 1998): vertices taken from the full grid, cheapest first.
    Decimation,
    /// Greedy insertion, then heights moved within the error, sides swapped and vertices taken away, in turns.
    #[default]
    Best,
}

/// Where the error holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Contract {
    /// At every valid sample.
    #[default]
    Samples,
    /// Everywhere: against the grid's own triangles, with the diagonals from `(x, y)` to `(x + 1, y + 1)`. Both surfaces are flat
    /// between samples and the points where a side crosses an edge of the grid, so these decide.
    Surface,
}

/// What to make. Start from `Options::default()` and set what differs. With neither an error nor a count the grid's surface itself
/// comes out, in as few triangles as it takes.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Options {
    /// No sample is farther from the surface than this, vertically, in the grid's units.
    pub max_error: Option<f64>,
    /// Where `max_error` holds. Default: at the samples.
    pub contract: Contract,
    /// At most this many triangles, as long as the outline allows; with an error too, the first of the two ends the work.
    pub triangles: Option<usize>,
    /// The method. Default: the best.
    pub method: Method,
    /// Vertices keep the heights of their samples; only [`Method::Best`] moves them.
    pub on_samples: bool,
    /// Straight lines from sample to sample, by column and row, that sides of triangles shall follow. Only for [`Method::Greedy`] and
    /// [`Method::Best`], and an error at the samples. Where lines cross between samples both are led over the nearest one; where one leaves the
    /// valid region it ends at the outline.
    pub breaklines: Vec<[[u32; 2]; 2]>,
    /// The outline of the valid region may differ from the exact one by as many samples (steps of the grid): corners of it are left out as long as both
    /// lie within that of each other and no void sample is covered. Valid samples beside it may lose their cover
    /// ([`Outlined::dropped`]), isolated ones may get one; the error holds for all that are covered. What lies on the border of the grid stays. Only
    /// for [`Method::Greedy`] and [`Method::Best`], and an error at the samples: along a side of a simpler outline no vertex could mend the error between them.
    pub outline_tolerance: Option<f64>,
}

impl Options {
    /// With this greatest error.
    #[must_use]
    pub fn with_max_error(mut self, error: f64) -> Self {
        self.max_error = Some(error);
        self
    }

    /// With an error that holds there.
    #[must_use]
    pub fn with_contract(mut self, contract: Contract) -> Self {
        self.contract = contract;
        self
    }

    /// With sides along these lines.
    #[must_use]
    pub fn with_breaklines(mut self, breaklines: Vec<[[u32; 2]; 2]>) -> Self {
        self.breaklines = breaklines;
        self
    }

    /// With an outline within this many samples of the exact one.
    #[must_use]
    pub fn with_outline_tolerance(mut self, tolerance: f64) -> Self {
        self.outline_tolerance = Some(tolerance);
        self
    }

    /// With at most this many triangles.
    #[must_use]
    pub fn with_triangles(mut self, triangles: usize) -> Self {
        self.triangles = Some(triangles);
        self
    }

    /// With this method.
    #[must_use]
    pub fn with_method(mut self, method: Method) -> Self {
        self.method = method;
        self
    }

    /// With vertices at the heights of their samples, or free ones.
    #[must_use]
    pub fn with_on_samples(mut self, on_samples: bool) -> Self {
        self.on_samples = on_samples;
        self
    }
}

/// A network of triangles over the valid region of a grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tin {
    /// Column and row of every vertex.
    pub points: Vec<[u32; 2]>,
    /// Height of every vertex: a number that f32 holds too, if it is not beyond its range.
    pub heights: Vec<f64>,
    /// Triangles, turning from the axis of columns to that of rows; none is flat in the plan, none overlap.
    pub triangles: Vec<[u32; 3]>,
}

/// How far samples lie from a network, vertically.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// The farthest.
    pub max: f64,
    /// Root of the mean square; samples on sides count for every triangle that has them.
    pub rms: f64,
    /// The farthest anywhere, against the grid's own triangles: never less than `max`.
    pub surface: f64,
}

/// A network and what it keeps.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Made {
    /// The network.
    pub tin: Tin,
    /// How far the samples lie from it: measured afterwards, over all of them.
    pub errors: Errors,
    /// Valid samples of the grid.
    pub valid: usize,
    /// Those of them that no triangle of three valid neighbours has: nothing covers them.
    pub isolated: usize,
    /// The triangles that the grid itself would be.
    pub grid_triangles: usize,
    /// The step of [`Method::Regular`].
    pub step: Option<usize>,
    /// Pieces of breaklines that were led over the nearest sample, where lines cross or the valid region ends.
    pub bent: usize,
    /// Pieces of breaklines left out, where nothing is valid.
    pub outside: usize,
    /// The outline, if it was to be simplified and there are voids.
    pub outline: Option<Outlined>,
}

/// What became of an outline that was simplified.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Outlined {
    /// Corners of the exact outline.
    pub corners: usize,
    /// Those of them that are left.
    pub kept: usize,
    /// Valid samples, not isolated, that nothing covers any more.
    pub dropped: usize,
}

/// Why there is no network.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TinError {
    /// No cell of the grid has a triangle of three valid corners.
    #[error("no three neighbouring samples are valid: there is nothing to triangulate")]
    Nothing,
    /// Heights are stored with 24 bits, which is too coarse for the error.
    #[error(
        "an error of {error} is finer than f32 can tell at heights of {greatest}: at least {least} is possible. \
         If that height marks voids, say so"
    )]
    TooFine {
        /// The error asked for.
        error: f64,
        /// The least that can be kept.
        least: f64,
        /// The greatest height, without its sign.
        greatest: f64,
    },
    /// More than 65,535 samples along a side, or more than 2^32 - 2 samples.
    #[error(
        "{columns} x {rows} samples are too many for one network: at most 65,535 along a side and 2^32 - 2 in all"
    )]
    TooLarge {
        /// Samples in a row.
        columns: usize,
        /// Samples in a column.
        rows: usize,
    },
    /// An error that is not a number, or negative.
    #[error("an error must be a number, 0 or more")]
    BadError,
    /// Breaklines with another method, or with an error between samples, which one may break.
    #[error("breaklines are kept by the methods greedy and best, with an error at the samples")]
    NoBreaklines,
    /// A breakline with an end that is no sample.
    #[error("the breakline from column {} row {} to column {} row {} leaves the grid", .0[0][0], .0[0][1], .0[1][0], .0[1][1])]
    BadBreakline([[u32; 2]; 2]),
    /// An outline simplified with another method, or with an error between samples.
    #[error("an outline is simplified by the methods greedy and best, with an error at the samples")]
    NoOutline,
    /// A tolerance of the outline that is not a number, or negative.
    #[error("the tolerance of the outline must be a number, 0 or more")]
    BadOutline,
    /// Tiles of another method than greedy insertion and the best, or with an outline that is simplified.
    #[error("tiles are made by the methods greedy and best, with the exact outline")]
    NoTiles,
    /// Cuts that are not in ascending order from the first to the last sample, or a tile that is none.
    #[error("cuts must ascend from the first column and row to the last, and a tile lie between two of them")]
    BadCuts,
    /// Stopped by [`Control::cancelled`].
    #[error("cancelled")]
    Cancelled,
}
