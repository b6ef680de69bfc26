//! glTF 2.0, as `.gltf` and `.glb`.
//!
//! Decoding makes one [`crate::scene::SceneMesh`] of each glTF mesh: all its triangle primitives (lists, strips, fans) together, with
//! vertices of bit-equal position made one, so that uv seams and material borders share vertices. Every glTF vertex
//! is a wedge; `face_group` is the primitive, `face_material` its material. Quantized and compressed data are decoded
//! (`KHR_mesh_quantization`, `EXT_meshopt_compression`, `KHR_meshopt_compression`); other required extensions that touch what is read
//! are refused by name.
//!
//! What else the document holds is kept in a [`Source`] and written again as it was: materials with their extensions, textures, images, cameras,
//! skins, animations, nodes, scenes, names and extras, primitives of points and lines. With a `Source`, [`encode`]
//! takes only the geometry of [`crate::scene::Scene::meshes`] from the scene; its nodes, materials and images are the document's. Without
//! one it makes the document from the scene.
//!
//! Texture coordinates are as the file has them: glTF's origin is the upper left corner of the image. A scene without a `Source` is taken
//! to come from a format with the origin at the lower left (OBJ, PLY), and its v is turned over on writing.
//!
//! Own accessor code, on the JSON itself: the `gltf` crate refuses files that require quantization or compressed views, and drops
//! properties it does not know. It is the oracle of the tests.

mod accessor;
mod beside;
mod columns;
mod container;
mod decode;
mod document;
mod edit;
mod encode;
mod geometry;
mod images;
mod json;
mod lod;
mod meshopt;
mod semantic;
mod source;
mod vertices;
mod writer;

pub use decode::decode;
pub use encode::encode;
pub use lod::encode_levels;
pub use source::Source;
pub(crate) use source::SurfaceTable;

use serde_json::Value;

/// The names of the one codec for buffer views.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// True if a primitive is read into a mesh and written anew: triangles, a strip or a fan, with positions.
fn is_surface(primitive: &Value) -> bool {
    let mode = primitive.get("mode").map_or(Some(4), json::uint);
    matches!(mode, Some(4..=6)) && primitive.get("attributes").is_some_and(|a| a.get("POSITION").is_some())
}
