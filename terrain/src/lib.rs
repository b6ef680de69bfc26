//! # progmesh-terrain: height grids and the surfaces made of them
//!
//! A [`Grid`] holds samples of heights, some of them void; a [`Raster`] gives them window by window, so that one larger than memory
//! never lies in it whole; a [`Mosaic`] is one raster of several. A [`Georeference`] says where they lie. Grids become triangulated irregular
//! networks here ([`tin`]), and [block hierarchies](block) for progressive terrains; files are read elsewhere.
//!
//! ```
//! use progmesh_terrain::{Grid, Raster, Window};
//! let grid = Grid::new(3, 2, vec![0.0, 1.0, 2.0, 0.5, f64::NAN, 2.5])?;
//! assert_eq!(grid.height(2, 1), Some(2.5));
//! assert_eq!(grid.height(1, 1), None);
//! assert_eq!(grid.range(), Some((0.0, 2.5)));
//! assert_eq!(grid.window(Window::new(1, 0, 2, 1)).unwrap().heights(), [1.0, 2.0]);
//! # Ok::<(), progmesh_terrain::GridError>(())
//! ```

pub mod block;
mod cache;
mod fill;
mod geodetic;
mod georeference;
mod grid;
mod hillshade;
mod mosaic;
mod overview;
mod raster;
mod summary;
pub mod tin;

pub use cache::BlockCache;
pub use fill::{Filled, fill_voids};
pub use geodetic::{Geodetic, GeodeticError};
pub use georeference::{Affine, Crs, CrsKind, GeoKeys, Georeference, SampleAt, metres_per_degree};
pub use grid::{Grid, GridError};
pub use hillshade::{hillshade, mean_slope};
pub use mosaic::{Mosaic, MosaicError, Part};
pub use overview::Overview;
pub use raster::{Raster, RasterError, Window, check_window};
pub use summary::{Summary, windows};
