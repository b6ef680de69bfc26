//! # progmesh-terrain: height grids and the surfaces made of them
//!
//! A [`Grid`] holds samples of heights, some of them void. Grids become triangulated irregular networks here; files are read elsewhere.
//!
//! ```
//! use progmesh_terrain::Grid;
//! let grid = Grid::new(3, 2, vec![0.0, 1.0, 2.0, 0.5, f64::NAN, 2.5])?;
//! assert_eq!(grid.height(2, 1), Some(2.5));
//! assert_eq!(grid.height(1, 1), None);
//! assert_eq!(grid.range(), Some((0.0, 2.5)));
//! # Ok::<(), progmesh_terrain::GridError>(())
//! ```

mod grid;

pub use grid::{Grid, GridError};
