//! Triangulations of a window of a larger grid.

use super::Quiet;
use super::delaunay::Triangulation;
use super::field::Field;
use super::greedy::{Goal, refine};
use super::network::Network;
use super::region::Region;
use crate::Grid;

/// Columns and rows of vertices, and triangles of these.
pub(crate) type Flat = (Vec<(i32, i32)>, Vec<[u32; 3]>);

fn flat(network: Network) -> Flat {
    (network.vertices.iter().map(|v| (v.x, v.y)).collect(), network.triangles)
}

/// Every triangle of the valid region.
pub(crate) fn full(grid: &Grid) -> Flat {
    let field = Field::new(grid, 0.0);
    flat(Network::full(&field, &Region::new(&field)))
}

/// Greedy insertion until every sample is within `error`; on the border of the grid only `border` are vertices, which must keep the samples there, and the corners of the valid
/// region's outline. If rounding to f32 breaks that, the least error that can be kept.
pub(crate) fn network(grid: &Grid, error: f64, border: &[(i32, i32)]) -> Result<Flat, f64> {
    let field = Field::new(grid, error);
    // A vertex is rounded, a sample is, and both may add up.
    let tolerance = field.tolerance(error - 2.0 * field.rounding).ok_or(3.0 * field.rounding)?;
    let region = Region::new(&field);
    if region.triangles == 0 {
        return Ok(Flat::default());
    }
    let mut mesh = Triangulation::new(field.columns, field.rows);
    region.constrain(&mut mesh);
    for &p in border {
        mesh.insert(p);
    }
    mesh.changed = (0..mesh.triangles() as u32).collect();
    let goal = Goal { tolerance, surface: false, triangles: usize::MAX };
    // Without a stop asked for there is always one.
    refine(&field, &mut mesh, goal, &Quiet).ok_or(f64::INFINITY)?;
    Ok(flat(Network::of(&mesh, &field)))
}
