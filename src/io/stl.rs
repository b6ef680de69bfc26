//! STL, binary and text.
//!
//! STL stores every facet with three points of its own. Reading welds points whose bits are equal (-0 = +0), which
//! is how every STL writer means them, and says so once. Facet normals are not read, for they follow from the points; they are
//! computed anew when writing. Several solids of a text file come as one mesh with a group for each, so that
//! patches that meet stay connected. Colours in the attribute bytes (VisCAM, Materialise) are left out, which is said.
//!
//! A file is binary if its size is what its facet count says, whatever the header begins with: many binary files
//! begin with `solid`. Own reader and writer: stl_io gives no line or facet in its errors and reserves by the announced count.

mod read;
mod write;

pub use read::decode;
pub use write::encode;

/// Bytes before the first facet of a binary file: a free header and the count.
const HEADER: usize = 84;
/// Bytes of a facet of a binary file: normal, three points, attribute bytes.
const FACET: usize = 50;
