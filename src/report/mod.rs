//! Looking at results: pictures, heat maps and silhouettes of a scene, maps of height grids, drawn in software, without a display; tables
//! and pages.
//!
//! A [`Surface`] is what a scene shows, as triangles in the world; a [`View`] says from where; [`render`] draws a [`Picture`], and
//! [`silhouette`] the [`Mask`] of what is covered. The same surface and view give the same pixels on every platform:
//! coverage is decided in integers, and shading uses no operation that IEEE 754 leaves open.
//!
//! Not physically based, and no textures: a picture shows shape and material base colours.

mod animation;
mod clip;
mod colormap;
mod font;
mod heat;
mod page;
mod picture;
pub mod plot;
mod raster;
mod relief;
mod render;
mod stroke;
mod surface;
mod table;
mod view;

pub use animation::apng;
pub(crate) use colormap::linear;
pub use colormap::{heat_bytes, heat_color};
pub use heat::{Scale, Titles, heat_panels};
pub use page::Page;
pub(crate) use page::escaped;
pub use picture::Picture;
pub use relief::relief;
pub use render::{Mask, Shading, Style, render, render_both, render_painted, silhouette};
pub use surface::{Surface, SurfaceError};
pub use table::{Table, short};
pub use view::{Projection, View};
