//! # progmesh-aif: the adjacency-and-incidence mesh
//!
//! A boundary representation for **general** polygonal meshes (Silva & Gomes): faces of any size, borders, edges with three
//! and more faces, isolated and cut vertices, dangling edges, several components. It stores exactly three relations (vertex ->
//! edges, edge -> two vertices and its faces, face -> edges in cyclic order) in flat arrays with `u32` ids; all else is a query.
//!
//! Guaranteed: [`Mesh::check`] holds after building and after every edge collapse and vertex split; a vertex split restores the mesh
//! of before its collapse exactly (ids, orders, positions). Not guaranteed: that the *geometry* is free of self-intersections, nor
//! that faces are consistently oriented; the mesh holds what it is given.
//!
//! ```
//! use progmesh_aif::Mesh;
//! let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0f32]];
//! let mesh = Mesh::from_triangles(square.to_vec(), &[[0, 1, 2], [0, 2, 3]])?;
//! assert_eq!((mesh.vertex_count(), mesh.topology().edge_count(), mesh.face_count()), (4, 5, 2));
//! # Ok::<(), progmesh_aif::BuildError>(())
//! ```

pub mod attributes;
mod bits;
mod build;
mod check;
mod classify;
mod compact;
mod edit;
mod error;
mod ids;
mod mesh;
pub mod positions;
mod remove;
mod sets;
mod topology;
mod traverse;
mod triangulate;
mod weld;

pub use attributes::{Channel, Encoding, Semantic, TooManyChannels, Wedges};
pub use bits::Bits;
pub use build::{BuildOptions, BuildReport, MeshInput};
pub use check::CheckError;
pub use classify::{EdgeKind, KindCounts, VertexKind};
pub use compact::{CompactOptions, IdMaps};
pub use edit::{Collapse, CollapseRecord, LinkViolation, Marks, Wing};
pub use error::BuildError;
pub use ids::{EdgeId, FaceId, NONE, VertexId, WedgeId};
pub use mesh::Mesh;
pub use positions::Positions;
pub use topology::{EdgeUse, Topology};
pub use traverse::{BorderLoop, Components, Fan, Link};
pub use triangulate::{Triangulated, triangulate_polygon};
pub use weld::Weld;
