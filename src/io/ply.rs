//! Stanford PLY: text and binary, both byte orders.
//!
//! The parser is our own: on text the kept crate (ply-rs-bw) takes three times the time that pymeshlab does on the same file.
//!
//! Read: any elements and properties in any order. `vertex` gives positions (`x y z`), normals (`nx ny nz`), colours (`red green blue
//! alpha`), texture coordinates (`s t`, `u v`, `texture_u texture_v`) and everything else as custom channels; `face` gives polygons, colours
//! a face and texture coordinates a corner (`texcoord`); `tristrips` gives triangles, `edge` gives wires. `comment TextureFile` names a texture.

mod header;
mod read;
mod write;

pub use read::decode;
pub use write::encode;

/// Names under which colours of vertices and faces are known: red, green, blue, alpha.
const COLOR_NAMES: [[&str; 4]; 3] = [
    ["red", "green", "blue", "alpha"],
    ["diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"],
    ["r", "g", "b", "a"],
];

/// Names under which texture coordinates of vertices are known.
const TEXTURE_NAMES: [[&str; 2]; 4] =
    [["texture_u", "texture_v"], ["s", "t"], ["u", "v"], ["texture_s", "texture_t"]];
