//! What to do, what to say on the way, and what came of it.

use progmesh_aif::Bits;

/// How to simplify.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Normal-based edge collapse in passes (Silva & Gomes).
    Nsa,
    /// Quadric edge collapse (Garland & Heckbert).
    #[default]
    Quadric,
    /// Vertex clustering on a grid (Rossignac & Borrel): fast, coarse, does not keep topology.
    Cluster,
}

/// Where the vertex goes that replaces an edge (or a cluster).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// At one of the vertices it replaces.
    Endpoint,
    /// In the middle (of a cluster: the centroid).
    Midpoint,
    /// Where the quadric is least.
    Optimal,
}

/// In which order quadric collapse takes the edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Schedule {
    /// Always the cheapest edge of all.
    Exact,
    /// Batches of cheap edges that do not touch each other.
    Bulk,
}

/// A bound on the error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaxError {
    /// The bound.
    pub value: f64,
    /// True: a fraction of the bounding-box diagonal. False: model units.
    pub relative: bool,
}

/// Options of [`crate::simplify`]. Start from `Options::default()` and set what differs.
///
/// The first of the targets that is reached stops the work; with none set, a method runs until no legal collapse is left.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Options {
    /// The method. Default: quadric.
    pub method: Method,
    /// Placement. `None`: midpoint for NSA, optimal otherwise.
    pub placement: Option<Placement>,
    /// Schedule of the quadric method. `None`: the default, [`Schedule::Bulk`].
    pub schedule: Option<Schedule>,
    /// Stop at this many triangles (a polygon of n corners counts n - 2).
    pub triangles: Option<usize>,
    /// Stop at this fraction of the input's triangles, 0..=1, rounded to the nearest count.
    pub ratio: Option<f64>,
    /// Stop before the estimated error passes this. An estimate, not a proof.
    pub max_error: Option<MaxError>,
    /// Quadric method with optimal placement: sweeps that move the vertices of the result to where the surface lies closest to the input, after the
    /// collapses. Topology, locks, seams and the error bound hold; more than two gain little. `None`: 2 if the input has at most
    /// [`crate::REFIT_LIMIT`] triangles, else 0. Recorded runs ([`crate::record_all`]), other methods and other placements make none.
    pub refit: Option<usize>,
    /// NSA: largest turn of a face's normal, degrees. `None`: [`crate::nsa::DEFAULT_EPSILON`].
    pub epsilon: Option<f64>,
    /// NSA: at most this many passes.
    pub passes: Option<usize>,
    /// New places lie on the grid of multiples of this length, model units, not negative: cheaper to encode, moved by up to 0.87 of it. A power
    /// of two keeps them exact. Endpoint placement makes no new places. `None` or 0: anywhere.
    pub grid: Option<f64>,
    /// No vertex on a border moves or goes. (NSA never touches the border.)
    pub lock_border: bool,
    /// Index-only: no vertex moves, survivors keep their ids, and all vertices stay in the mesh, so that every level can share one
    /// vertex buffer. Implies [`Placement::Endpoint`].
    pub keep_vertices: bool,
    /// Vertices that neither move nor go, by slot; empty for none.
    pub locked_vertices: Bits,
    /// [`crate::simplify_all`]: further vertices of each mesh that neither move nor go, by slot; empty, or shorter than the meshes are many, for none.
    pub locked_by_mesh: Vec<Bits>,
    /// Faces of these materials keep all their vertices.
    pub locked_materials: Vec<u32>,
    /// Faces of these groups keep all their vertices.
    pub locked_groups: Vec<u32>,
    /// Importance of every vertex slot, positive, 1 = normal: errors there weigh that much more. Empty for all 1.
    pub vertex_weights: Vec<f32>,
    /// First remove components whose bounding-box diagonal is below this fraction of the mesh's, 0..=1. Targets count what the input had.
    pub prune: Option<f64>,
    /// Threads to use; `None` for all of the current rayon pool. The result does not depend on it.
    pub threads: Option<usize>,
}

/// How the caller follows the work and stops it. All methods may be called often and from any thread.
pub trait Control: Sync {
    /// `done` of the work, 0..=1, never falling.
    fn progress(&self, done: f64) {
        let _ = done;
    }

    /// True asks for a stop: the mesh is left valid, as far as it got.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Says nothing, never stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Control for Quiet {}

/// Why the work ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stop {
    /// The target count was reached (or the mesh was below it already).
    Target,
    /// The next collapse would pass the error bound.
    Error,
    /// The passes asked for are done.
    Passes,
    /// Nothing that is left may be collapsed.
    NoLegalCollapse,
    /// The caller asked for it.
    Cancelled,
}

/// Collapses refused, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Refused {
    /// The link condition: topology would change.
    pub link: u64,
    /// A face's normal would turn by more than epsilon.
    pub normal: u64,
    /// The border, a seam or a material border would change.
    pub border: u64,
    /// A face would flip, or become a sliver.
    pub flip: u64,
    /// A vertex would get too many edges.
    pub valence: u64,
    /// A vertex is locked.
    pub locked: u64,
}

impl Refused {
    /// All together.
    pub fn total(&self) -> u64 {
        self.link + self.normal + self.border + self.flip + self.valence + self.locked
    }
}

/// One pass (NSA), or the whole run.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Level {
    /// Passes count from 1.
    pub pass: usize,
    /// Faces after it.
    pub faces: usize,
    /// Its time.
    pub seconds: f64,
    /// Edges tried.
    pub tried: u64,
    /// Edges refused.
    pub refused: Refused,
}

/// What came of it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Outcome {
    /// Faces before, as given (polygons count one).
    pub faces_in: usize,
    /// Faces after.
    pub faces_out: usize,
    /// Triangles after.
    pub triangles_out: usize,
    /// Vertices after.
    pub vertices_out: usize,
    /// Why it ended.
    pub stop: Stop,
    /// Estimated error in model units. Quadric: the root of the largest cost per weight, not a bound. NSA: the largest sum, along a chain
    /// of collapses, of the distances of new places from the planes they replace, not a bound. Cluster: the farthest any vertex moved,
    /// which bounds one side of the distance (result to input, at vertices).
    pub estimate: f64,
    /// The passes.
    pub levels: Vec<Level>,
    /// Polygons that were cut into triangles first.
    pub triangulated: usize,
    /// Vertices without a face that were left out of the result.
    pub isolated_removed: usize,
    /// Bytes of the AIF relations at the start.
    pub aif_bytes: usize,
    /// Vertex of the result -> vertex slot of the input it stands for; empty when they are the same.
    pub vertex_origin: Vec<u32>,
}

/// Why nothing was done.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimplifyError {
    /// An option has a value outside its range.
    #[error("{option} is {value}; it must be {range}")]
    Range {
        /// Which.
        option: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// A recorded run was asked for something that is no sequence of edge collapses of triangles.
    #[error("{0} cannot be recorded as edge collapses of triangles")]
    NotRecorded(&'static str),
    /// Polygons make more triangles than ids can name. Split the mesh.
    #[error("cutting polygons into triangles: {0}")]
    TooLarge(#[from] progmesh_aif::BuildError),
    /// An array that runs parallel to the vertices has another length.
    #[error("{option} has {len} entries, the mesh has {want} vertices")]
    Length {
        /// Which.
        option: &'static str,
        /// Its length.
        len: usize,
        /// The length needed.
        want: usize,
    },
}
