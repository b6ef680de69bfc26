//! Wavefront OBJ with MTL.
//!
//! The parser is our own. Measured and read in its source, the kept crate (tobj) loses `o` before `g`, drops vertices
//! that no face uses, renumbers vertices group by group (so that groups sharing an edge come apart), and its errors carry
//! no line. It is the oracle of the tests where it is right, and reads the statements of MTL.
//!
//! A file becomes **one** mesh whatever its `o` and `g`, so that groups that share an edge stay connected; the groups are
//! kept per face. Read: `v` (with weight or colour), `vt`, `vn`, `f`, `l`, `o`, `g`, `s`, `usemtl`, `mtllib`; forward and negative indices.
//! Not read: `p`, free-form curves and surfaces (a warning names them).

mod mtl;
mod read;
mod write;

pub use read::decode;
pub use write::encode;

pub(crate) use mtl::{base_texture, image_names, material_of, mime_of};
