//! A grid of a few heights, one of them void, and their range.

use progmesh_terrain::Grid;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let heights = vec![120.0, 130.0, f64::NAN, 118.0, 125.0, 140.0];
    let grid = Grid::new(3, 2, heights)?;
    println!("{} x {} samples", grid.columns(), grid.rows());
    println!("heights {:?}", grid.range());
    println!("column 2, row 0: {:?}", grid.height(2, 0));
    Ok(())
}
