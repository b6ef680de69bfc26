//! OFF (Geomview): text and `OFF BINARY`, with the prefixes `ST` (uvs), `C` (colours) and `N` (normals).
//!
//! Colours are whole numbers to 255 or floats to 1. The file does not say which: they are floats if any colour of the file is
//! written with a point or exponent, or if none is above 1. Face colours become colours of the face's corners, where
//! vertices have none; indices into a colour map are left out. Faces of two corners are line segments.
//! `4OFF` and `nOFF` (points of other than three dimensions) are refused by name.

mod binary;
mod build;
mod read;
mod write;

pub use read::decode;
pub use write::encode;
