//! Views: a camera, its six planes, and what it cannot see.
//!
//! [`Camera`] is where a picture is taken from; [`Frustum`] its six planes, with tests of spheres and boxes that pass on from a parent to its
//! children which planes are still in question; [`NormalCone`] tells what turns its back. All in f64; a frustum keeps its planes about an origin of
//! its own, the eye, so that a scene at 1e6 is culled as one at 0.
//!
//! Every test is conservative: what it calls invisible is (but for rounding in the last place), what it does not may still be.

mod camera;
pub mod clip;
mod cone;
mod frustum;

pub use camera::{Camera, CameraError, CameraParameters, Projection};
pub use cone::NormalCone;
pub use frustum::{Frustum, FrustumError, Plane, PlaneName, Planes};
