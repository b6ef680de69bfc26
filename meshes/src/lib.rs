//! # progmesh-meshes: sample meshes by name and seed
//!
//! Well-formed meshes to try things on, and hostile ones to survive. All come as plain arrays ([`Sample`]): this crate knows no
//! mesh structure and no file format.
//!
//! Guaranteed: the same name, face count and seed give the same bits on every platform (generators use only IEEE
//! addition, multiplication, division and square root, with their own random numbers and their own sine).
//! Not guaranteed: the same bits from one version of this crate to the next.
//!
//! ```
//! use progmesh_meshes::{GenerateOptions, generate};
//! let torus = generate("torus", &GenerateOptions::default().with_faces(1000))?;
//! assert!(torus.face_count().abs_diff(1000) < 100);
//! # Ok::<(), progmesh_meshes::GenerateError>(())
//! ```

mod cad;
mod catalog;
mod general;
mod geodesic;
mod heights;
mod hostile;
mod noise;
mod quad_sphere;
mod sample;
mod scan;
mod terrain;
mod torus;
mod trig;

pub use catalog::{Entry, GenerateError, GenerateOptions, MAX_FACES, generate, names};
pub use heights::{LANDSCAPE_SIDE, Landscape};
pub use noise::SplitMix64;
pub use sample::{CornerValues, Material, Sample, Texture};
pub use terrain::sheet;
