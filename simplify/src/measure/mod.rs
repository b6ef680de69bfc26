//! Measuring: how far two surfaces are from each other.
//!
//! [`Surface`] holds triangles of any kind and answers [closest-point queries](Surface::query). [`distance()`] compares two of them after
//! Metro (Cignoni, Rocchini & Scopigno 1998): by samples, in both directions; [`vertex_distances`] gives the distance of every vertex,
//! for heat maps. [`certify`] proves an interval of the Hausdorff distance, [`within`] decides whether it is below a bound, [`exceeding`] finds all places where it is not.
//! [`deviations`] compares normals, texture coordinates and colours at closest points; [`turned_triangles`], [`self_intersections`],
//! [`triangle_quality`] and [`TopologySummary`] look at what else may have gone wrong.
//!
//! Guaranteed: distances to triangles are computed in f64 about the surface's own centre, so a mesh far from the origin measures as
//! exactly as its coordinates allow; degenerate triangles count as the segments or points they are; results do not depend on the number of
//! threads; the intervals of [`certify`] hold, with all rounding accounted for. Not guaranteed: that the largest *sampled* distance is the
//! largest there is; it is a lower bound.
//!
//! ```
//! use progmesh_simplify::{Quiet, measure::{DistanceOptions, Surface, distance}};
//! // A unit square, and the same with one corner lifted by 0.1.
//! let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0f32]];
//! let mut lifted = square;
//! lifted[2][2] = 0.1;
//! let triangles = [[0, 1, 2], [0, 2, 3]];
//! let a = Surface::new(&square[..], &triangles)?;
//! let b = Surface::new(&lifted[..], &triangles)?;
//! let d = distance(&a, &b, &DistanceOptions::default(), &Quiet)?;
//! assert!((d.worse.max - 0.1).abs() < 1e-6 && d.worse.mean < 0.05);
//! # Ok::<(), progmesh_simplify::measure::MeasureError>(())
//! ```

mod bvh;
mod certify;
mod cover;
mod deviation;
mod distance;
mod error;
mod exceeding;
mod intersections;
mod pieces;
mod progress;
mod query;
mod sample;
mod shape;
mod surface;
pub(crate) mod triangle;

pub use certify::{Certified, CertifyOptions, Interval, Within, certify, within};
pub use deviation::{
    CornerValues, Deviation, Deviations, TwoSided, deviations, distance_and_deviations, turned_triangles,
};
pub use distance::{
    DistanceOptions, Distances, Farthest, OneSided, Quantiles, Summary, distance, vertex_distances,
};
pub use error::MeasureError;
pub use exceeding::{Exceeding, Place, exceeding};
pub use intersections::{SelfIntersections, self_intersections};
pub use query::{ClosestPoint, Query};
pub use shape::{TopologySummary, TriangleQuality, triangle_quality};
pub use surface::{Points, Surface};
pub use triangle::closest_on_triangle;
