//! Errors of building a mesh.

/// Why no mesh could be built. Each names the element; the input is wrong, not the caller.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A coordinate is NaN or infinite. Repair or remove the vertex in the source.
    #[error("vertex {vertex}: {axis} is {value}; coordinates must be finite")]
    NotFinite {
        /// The vertex, from 0.
        vertex: usize,
        /// `x`, `y` or `z`.
        axis: char,
        /// What it is.
        value: f64,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face}, corner {corner}: vertex {index} of {vertices}; indices run from 0 to one less")]
    IndexOutOfRange {
        /// The face, from 0.
        face: usize,
        /// Its corner, from 0.
        corner: usize,
        /// The index found.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A wire names a vertex that does not exist.
    #[error("line segment {wire}: vertex {index} of {vertices}; indices run from 0 to one less")]
    WireOutOfRange {
        /// The wire, from 0.
        wire: usize,
        /// The index found.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A corner names a wedge that does not exist.
    #[error("corner {corner}: wedge {index} of {wedges}")]
    WedgeOutOfRange {
        /// The corner, from 0, over all faces.
        corner: usize,
        /// The index found.
        index: u32,
        /// How many wedges there are.
        wedges: usize,
    },
    /// The corners of a triangle mesh are not a multiple of three.
    #[error("{corners} corners are no whole number of triangles")]
    NotTriangles {
        /// Length of the index list.
        corners: usize,
    },
    /// The face sizes do not add up to the number of corners.
    #[error("face sizes add up to {sum}, but there are {corners} corners")]
    Sizes {
        /// Sum of the sizes.
        sum: u64,
        /// Length of the index list.
        corners: usize,
    },
    /// An array that runs parallel to another has another length.
    #[error("{name} has {len} entries, {want} are needed")]
    Length {
        /// Which array.
        name: &'static str,
        /// Its length.
        len: usize,
        /// The length needed.
        want: usize,
    },
    /// More elements than 32-bit ids can name. Split the mesh.
    #[error(
        "{vertices} vertices and {corners} corners: a mesh holds at most 2^32 - 1 vertices and 2^31 - 1 edges"
    )]
    TooLarge {
        /// Number of vertices.
        vertices: usize,
        /// Number of corners.
        corners: usize,
    },
}
