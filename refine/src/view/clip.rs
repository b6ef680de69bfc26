//! Clipping in homogeneous, oriented coordinates (Stolfi).
//!
//! A point is `[x, y, z, w]`, of any w; a plane is four numbers, and a point's side the sign of their dot product, [`side`]. Nothing is divided by
//! w, so what passes behind the eye, or through its plane, is cut as rightly as anything else. Signs are exact: a vertex on a plane is
//! found to be on it, and a rounded sum decides nothing (as long as products stay within 1e-270 to 1e300).
//!
//! - [`clip_segment`], [`clip_triangle`]: one plane, the filters of a pipeline.
//! - [`ConvexClipper`]: convex polygons and triangles against any number of planes, those that matter only; a triangle in a box makes at
//!   most seven triangles.
//! - [`Polygon`]: planar polygons with holes and several pieces, bounded or not.
//! - [`clip_mesh`]: whole meshes, with shared vertices at the cut, and caps.
//!
//! The open positive side is kept: what only touches a plane is dropped (a mesh's faces that lie in a plane stay, see there).

mod cap;
mod convex;
mod exact;
mod gather;
mod join;
mod mesh;
mod planar;

pub use convex::{ConvexClipper, Corner, Outcome, Vertex, clip_segment, clip_segment_in, clip_triangle};
pub use exact::side;
pub use mesh::{MeshClip, MeshClipError, clip_mesh, gather_faces};
pub use planar::{PlaneMap, Polygon};

use glam::{DVec3, DVec4};

/// The six planes of a box, inside where positive. `lo <= hi`.
pub fn box_planes(lo: DVec3, hi: DVec3) -> [DVec4; 6] {
    [
        DVec4::new(1.0, 0.0, 0.0, -lo.x),
        DVec4::new(-1.0, 0.0, 0.0, hi.x),
        DVec4::new(0.0, 1.0, 0.0, -lo.y),
        DVec4::new(0.0, -1.0, 0.0, hi.y),
        DVec4::new(0.0, 0.0, 1.0, -lo.z),
        DVec4::new(0.0, 0.0, -1.0, hi.z),
    ]
}

/// The planes of clip space, -w <= x, y, z <= w, inside where positive.
pub const CLIP_SPACE: [DVec4; 6] = [
    DVec4::new(1.0, 0.0, 0.0, 1.0),
    DVec4::new(-1.0, 0.0, 0.0, 1.0),
    DVec4::new(0.0, 1.0, 0.0, 1.0),
    DVec4::new(0.0, -1.0, 0.0, 1.0),
    DVec4::new(0.0, 0.0, 1.0, 1.0),
    DVec4::new(0.0, 0.0, -1.0, 1.0),
];
