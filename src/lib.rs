//! progmesh: progressive and multiresolution meshes.

pub use progmesh_aif as aif;
pub use progmesh_meshes as meshes;
pub use progmesh_refine as refine;
pub use progmesh_simplify as simplify;

pub mod io;
pub mod normals;
pub mod pipeline;
pub mod report;
pub mod samples;
pub mod scene;
