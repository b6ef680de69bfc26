//! Networks of terrain as scenes: in the grid's own space, or in a world of metres.

use crate::aif::attributes::{Channel, Semantic, Wedges};
use crate::aif::{MeshInput, Positions};
use crate::scene::{Scene, SceneMesh};
use crate::terrain::Grid;
use crate::terrain::tin::Tin;
use glam::{DMat4, DVec4};

/// Where vertices stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Space {
    /// x is the column, y the row, z the height, as they are.
    Grid,
    /// y is up. The middle of the grid is the origin, columns run along x, rows along z.
    World {
        /// Lengths of a step by a column and by a row.
        spacing: [f64; 2],
        /// Heights are multiplied by this.
        exaggeration: f64,
    },
}

impl Space {
    /// From column, row and height to where they stand.
    pub fn matrix(&self, grid: &Grid) -> DMat4 {
        match *self {
            Space::Grid => DMat4::IDENTITY,
            Space::World { spacing: [x, z], exaggeration } => {
                let [column, row] = middle(grid);
                DMat4::from_cols(
                    DVec4::new(x, 0.0, 0.0, 0.0),
                    DVec4::new(0.0, 0.0, z, 0.0),
                    DVec4::new(0.0, exaggeration, 0.0, 0.0),
                    DVec4::new(-column * x, 0.0, -row * z, 1.0),
                )
            }
        }
    }

    /// Where a point of the grid stands.
    fn place(&self, grid: &Grid, [column, row]: [u32; 2], height: f64) -> [f64; 3] {
        let (column, row) = (f64::from(column), f64::from(row));
        match *self {
            Space::Grid => [column, row, height],
            Space::World { spacing, exaggeration } => {
                let [x, z] = middle(grid);
                [(column - x) * spacing[0], height * exaggeration, (row - z) * spacing[1]]
            }
        }
    }
}

/// Column and row of the middle of a grid: the origin of [`Space::World`].
pub fn middle(grid: &Grid) -> [f64; 2] {
    [grid.columns(), grid.rows()].map(|n| n.saturating_sub(1) as f64 / 2.0)
}

/// A scene of one mesh of this name. In [`Space::World`] it has normals, of the grid's surface rather than of the triangles: they do not
/// change with the error, nor across the borders of tiles. In [`Space::Grid`] it has positions only. Front faces look up. O(vertices).
pub fn scene(tin: &Tin, grid: &Grid, space: Space, name: &str) -> Scene {
    let places = tin.points.iter().zip(&tin.heights);
    let positions: Vec<[f64; 3]> = places.map(|(&p, &h)| space.place(grid, p, h)).collect();
    let mut geometry = MeshInput::triangles(Positions::from_f64(positions), &tin.triangles);
    if let Space::World { spacing, exaggeration } = space {
        // Rows run towards the viewer here, so triangles turn the other way.
        geometry.corners.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
        // One channel is never too many.
        if let Ok(mut wedges) = Wedges::new(vec![Channel::new(Semantic::Normal, 3)]) {
            for &[column, row] in &tin.points {
                let normal = normal(grid, column as usize, row as usize, spacing, exaggeration);
                wedges.push(&normal, 1);
            }
            wedges.corner.clone_from(&geometry.corners);
            geometry.wedges = Some(wedges);
        }
    }
    Scene::from_mesh(SceneMesh { name: Some(name.to_string()), geometry, groups: vec![] })
}

/// The normal of the grid at a sample, y up: from the differences to both sides, or to one where the other is void or outside.
fn normal(grid: &Grid, column: usize, row: usize, spacing: [f64; 2], exaggeration: f64) -> [f32; 3] {
    let here = grid.height(column, row).unwrap_or(0.0);
    let slope = |before: Option<f64>, after: Option<f64>, step: f64| {
        let (low, high, steps) = match (before, after) {
            (Some(b), Some(a)) => (b, a, 2.0),
            (Some(b), None) => (b, here, 1.0),
            (None, Some(a)) => (here, a, 1.0),
            (None, None) => (here, here, 1.0),
        };
        (high - low) * exaggeration / (steps * step)
    };
    let left = column.checked_sub(1).and_then(|c| grid.height(c, row));
    let above = row.checked_sub(1).and_then(|r| grid.height(column, r));
    let x = slope(left, grid.height(column + 1, row), spacing[0]);
    let z = slope(above, grid.height(column, row + 1), spacing[1]);
    let length = x.hypot(z).hypot(1.0);
    [(-x / length) as f32, (1.0 / length) as f32, (-z / length) as f32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::tin::{Options, Quiet, triangulate};
    use glam::DVec3;

    fn slope() -> (Grid, Tin) {
        let grid = Grid::new(5, 3, (0..15).map(|i| f64::from(i % 5) * 2.0).collect()).unwrap();
        let tin = triangulate(&grid, &Options::default(), &Quiet).unwrap().tin;
        (grid, tin)
    }

    /// Twice the area of the first triangle, as a vector.
    fn cross(scene: &Scene) -> [f64; 3] {
        let mesh = &scene.meshes[0].geometry;
        let p: Vec<_> = mesh.corners[..3].iter().map(|&v| mesh.positions.get(v as usize)).collect();
        (p[1] - p[0]).cross(p[2] - p[0]).into()
    }

    #[test]
    fn front_faces_look_up_in_both_spaces() {
        let (grid, tin) = slope();
        assert!(cross(&scene(&tin, &grid, Space::Grid, "a"))[2] > 0.0);
        let world = Space::World { spacing: [4.0, 9.0], exaggeration: 2.0 };
        let world = scene(&tin, &grid, world, "a");
        assert!(cross(&world)[1] > 0.0);
        let p = world.meshes[0].geometry.positions.get(0);
        assert_eq!([p.x, p.y, p.z], [-8.0, 0.0, -9.0]);
        let space = Space::World { spacing: [4.0, 9.0], exaggeration: 2.0 };
        for (i, &at) in tin.points.iter().enumerate() {
            let p = world.meshes[0].geometry.positions.get(i);
            let own = DVec3::new(at[0].into(), at[1].into(), tin.heights[i]);
            assert!(space.matrix(&grid).transform_point3(own).distance(p) < 1e-4);
        }
    }

    #[test]
    fn normals_are_those_of_the_grid() {
        let (grid, _) = slope();
        // 2 up a column, twice exaggerated, over 4: a slope of 1.
        let half = std::f32::consts::FRAC_1_SQRT_2;
        for column in 0..5 {
            let n = normal(&grid, column, 1, [4.0, 9.0], 2.0);
            assert!((n[0] + half).abs() < 1e-6 && (n[1] - half).abs() < 1e-6 && n[2] == 0.0);
        }
    }
}
