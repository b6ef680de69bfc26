//! What can go wrong when measuring.

use progmesh_aif::BuildError;

/// Why nothing was measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// A surface needs a triangle: there is no distance to nothing.
    #[error("no triangle: there is no surface to measure")]
    NoTriangle,
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} has vertex {vertex}, but there are {vertices} vertices (from 0)")]
    OutOfRange {
        /// The triangle.
        triangle: usize,
        /// The index it has.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A coordinate is NaN or infinite. Remove the triangle or mend the vertex.
    #[error("vertex {vertex} of triangle {triangle} is not finite")]
    NotFinite {
        /// The vertex.
        vertex: u32,
        /// A triangle that has it.
        triangle: usize,
    },
    /// More than 2^31 triangles. Measure parts.
    #[error("{triangles} triangles: at most 2^31 can be measured at once")]
    TooLarge {
        /// How many there are.
        triangles: usize,
    },
    /// Polygons make more triangles than ids can name. Split the mesh.
    #[error("cutting polygons into triangles: {0}")]
    Triangulate(#[from] BuildError),
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
    /// The caller asked for a stop.
    #[error("cancelled")]
    Cancelled,
}
