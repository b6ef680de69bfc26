//! Networks of terrain as scenes: in the grid's own space, or in a world of metres.

mod globe;

use crate::aif::attributes::{Channel, Semantic, Wedges};
use crate::aif::{MeshInput, Positions};
use crate::scene::{Image, Material, Scene, SceneMesh};
use crate::terrain::tin::Tin;
use crate::terrain::{Grid, SampleAt};
use glam::{DMat4, DVec4};
pub use globe::{Globe, earth_centred};

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
    /// On the ellipsoid of WGS 84.
    Globe(Globe),
}

/// What vertices have beside their places. Both follow from the grid alone, at every sample: they do not change with the error, nor across the
/// borders of tiles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dress {
    /// Normals of the grid's surface rather than of the triangles: from the differences to the samples beside.
    pub normals: bool,
    /// Texture coordinates.
    pub drape: Option<Drape>,
}

/// A picture laid over the whole grid, its first row along the first row of samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drape {
    /// What it covers: the cells about all samples, as one with a pixel for every sample does; or the grid from its first to its last samples.
    pub covers: SampleAt,
    /// The picture, if it goes into the scene.
    pub image: Option<Image>,
}

impl Drape {
    /// Texture coordinates of a sample, from the picture's lower left.
    fn uv(&self, grid: &Grid, [column, row]: [u32; 2]) -> [f32; 2] {
        let along = |i: u32, n: usize| match self.covers {
            SampleAt::CellCentre => (f64::from(i) + 0.5) / n as f64,
            SampleAt::Point => f64::from(i) / n.saturating_sub(1).max(1) as f64,
        };
        [along(column, grid.columns()) as f32, (1.0 - along(row, grid.rows())) as f32]
    }
}

impl Space {
    /// From column, row and height of a grid with so many columns and rows to where they stand; `None` on the globe, which is not flat.
    pub fn matrix(&self, size: [usize; 2]) -> Option<DMat4> {
        Some(match *self {
            Space::Globe(_) => return None,
            Space::Grid => DMat4::IDENTITY,
            Space::World { spacing: [x, z], exaggeration } => {
                let [column, row] = middle_of(size);
                DMat4::from_cols(
                    DVec4::new(x, 0.0, 0.0, 0.0),
                    DVec4::new(0.0, 0.0, z, 0.0),
                    DVec4::new(0.0, exaggeration, 0.0, 0.0),
                    DVec4::new(-column * x, 0.0, -row * z, 1.0),
                )
            }
        })
    }

    /// Where a point of the grid stands.
    fn place(&self, grid: &Grid, [column, row]: [f64; 2], height: f64) -> [f64; 3] {
        match *self {
            Space::Grid => [column, row, height],
            Space::World { spacing, exaggeration } => {
                let [x, z] = middle(grid);
                [(column - x) * spacing[0], height * exaggeration, (row - z) * spacing[1]]
            }
            Space::Globe(globe) => globe.place([column, row], height),
        }
    }

    /// Where vertices of a network stand, in the precision of the files that are made for drawing: the same sample and height give the same bits.
    pub fn places(&self, grid: &Grid, tin: &Tin) -> Vec<[f32; 3]> {
        let places = tin.points.iter().zip(&tin.heights);
        places.map(|(&p, &h)| self.place(grid, p.map(f64::from), h).map(|c| c as f32)).collect()
    }

    /// The normal of the grid's surface at a sample: from the differences to both sides, or to one where the other is void or outside.
    pub fn normal(&self, grid: &Grid, [column, row]: [u32; 2]) -> [f32; 3] {
        let (c, r) = (column as usize, row as usize);
        let here = grid.height(c, r).unwrap_or(0.0);
        let around = |before: Option<f64>, after: Option<f64>| match (before, after) {
            (Some(b), Some(a)) => [(-1.0, b), (1.0, a)],
            (Some(b), None) => [(-1.0, b), (0.0, here)],
            (None, Some(a)) => [(0.0, here), (1.0, a)],
            (None, None) => [(0.0, here), (1.0, here)],
        };
        let left = c.checked_sub(1).and_then(|c| grid.height(c, r));
        let above = r.checked_sub(1).and_then(|r| grid.height(c, r));
        let across = around(left, grid.height(c + 1, r));
        let down = around(above, grid.height(c, r + 1));
        let slope = |[(x0, low), (x1, high)]: [(f64, f64); 2], step: f64| (high - low) / ((x1 - x0) * step);
        let unit = |n: [f64; 3]| {
            let length = n[0].hypot(n[1]).hypot(n[2]);
            n.map(|c| (c / length) as f32)
        };
        match *self {
            Space::Grid => unit([-slope(across, 1.0), -slope(down, 1.0), 1.0]),
            Space::World { spacing, exaggeration } => {
                let [x, z] = spacing.map(|s| s / exaggeration);
                unit([-slope(across, x), 1.0, -slope(down, z)])
            }
            Space::Globe(globe) => {
                let (column, row) = (f64::from(column), f64::from(row));
                let across = across.map(|(d, h)| globe.place([column + d, row], h));
                let down = down.map(|(d, h)| globe.place([column, row + d], h));
                unit(globe.up([column, row], across, down))
            }
        }
    }
}

/// Column and row of the middle of a grid: the origin of [`Space::World`].
pub fn middle(grid: &Grid) -> [f64; 2] {
    middle_of([grid.columns(), grid.rows()])
}

/// The same of a grid with so many columns and rows.
pub fn middle_of(size: [usize; 2]) -> [f64; 2] {
    size.map(|n| n.saturating_sub(1) as f64 / 2.0)
}

/// A scene of one mesh of this name; `tin` has columns and rows of `grid`. Front faces look up. O(vertices).
pub fn scene(tin: &Tin, grid: &Grid, space: Space, dress: &Dress, name: &str) -> Scene {
    let places = tin.points.iter().zip(&tin.heights);
    let positions = places.map(|(&p, &h)| space.place(grid, p.map(f64::from), h)).collect();
    of_positions(tin, Positions::from_f64(positions), grid, space, dress, name)
}

/// The same with positions rounded to f32 once and for all: files of tiles have the same bits where they meet.
pub fn tile_scene(tin: &Tin, grid: &Grid, space: Space, dress: &Dress, name: &str) -> Scene {
    of_positions(tin, Positions::F32(space.places(grid, tin)), grid, space, dress, name)
}

fn of_positions(
    tin: &Tin,
    positions: Positions,
    grid: &Grid,
    space: Space,
    dress: &Dress,
    name: &str,
) -> Scene {
    let mut geometry = MeshInput::triangles(positions, &tin.triangles);
    if space != Space::Grid {
        // Rows run towards the viewer here, so triangles turn the other way.
        geometry.corners.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    }
    let mut channels = vec![];
    if dress.normals {
        channels.push(Channel::new(Semantic::Normal, 3));
    }
    if dress.drape.is_some() {
        channels.push(Channel::new(Semantic::TexCoord(0), 2));
    }
    let present = (1 << channels.len()) - 1;
    // Two channels are never too many.
    if let Some(mut wedges) = Wedges::new(channels).ok().filter(|_| present > 0) {
        let mut row = Vec::with_capacity(5);
        for &point in &tin.points {
            row.clear();
            if dress.normals {
                row.extend(space.normal(grid, point));
            }
            if let Some(drape) = &dress.drape {
                row.extend(drape.uv(grid, point));
            }
            wedges.push(&row, present);
        }
        wedges.corner.clone_from(&geometry.corners);
        geometry.wedges = Some(wedges);
    }
    let image = dress.drape.as_ref().and_then(|d| d.image.clone());
    if image.is_some() {
        geometry.face_material = vec![0; tin.triangles.len()];
    }
    let mut scene =
        Scene::from_mesh(SceneMesh { name: Some(name.to_string()), geometry, ..Default::default() });
    if let Some(image) = image {
        scene.images = vec![image];
        let material = Material { name: "drape".into(), base_color_image: Some(0), ..Default::default() };
        scene.materials = vec![material];
    }
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::tin::{Options, Quiet, triangulate};
    use glam::DVec3;

    const WORLD: Space = Space::World { spacing: [4.0, 9.0], exaggeration: 2.0 };

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
        let plain = scene(&tin, &grid, Space::Grid, &Dress::default(), "a");
        assert!(cross(&plain)[2] > 0.0 && plain.meshes[0].geometry.wedges.is_none());
        let world = scene(&tin, &grid, WORLD, &Dress::default(), "a");
        assert!(cross(&world)[1] > 0.0);
        let p = world.meshes[0].geometry.positions.get(0);
        assert_eq!([p.x, p.y, p.z], [-8.0, 0.0, -9.0]);
        let space = Space::World { spacing: [4.0, 9.0], exaggeration: 2.0 };
        for (i, &at) in tin.points.iter().enumerate() {
            let p = world.meshes[0].geometry.positions.get(i);
            let own = DVec3::new(at[0].into(), at[1].into(), tin.heights[i]);
            assert!(
                space.matrix([grid.columns(), grid.rows()]).unwrap().transform_point3(own).distance(p) < 1e-4
            );
        }
    }

    #[test]
    fn normals_are_those_of_the_grid() {
        let (grid, _) = slope();
        // 2 up a column, twice exaggerated, over 4: a slope of 1.
        let half = std::f32::consts::FRAC_1_SQRT_2;
        for column in 0..5 {
            let n = WORLD.normal(&grid, [column, 1]);
            assert!((n[0] + half).abs() < 1e-6 && (n[1] - half).abs() < 1e-6 && n[2] == 0.0);
        }
        let n = Space::Grid.normal(&grid, [2, 0]);
        assert!((n[0] + 2.0 * n[2]).abs() < 1e-6 && n[1] == 0.0 && n[2] > 0.0);
    }

    #[test]
    fn a_picture_covers_the_cells_or_the_samples() {
        let (grid, tin) = slope();
        for (covers, first, last) in [
            (SampleAt::CellCentre, [0.1, 5.0 / 6.0], [0.9, 1.0 / 6.0]),
            (SampleAt::Point, [0.0, 1.0], [1.0, 0.0]),
        ] {
            let drape = Drape { covers, image: Some(Image::default()) };
            assert_eq!(drape.uv(&grid, [0, 0]), first.map(|c: f64| c as f32));
            assert_eq!(drape.uv(&grid, [4, 2]), last.map(|c: f64| c as f32));
            let dress = Dress { normals: true, drape: Some(drape) };
            let scene = scene(&tin, &grid, Space::Grid, &dress, "a");
            let wedges = scene.meshes[0].geometry.wedges.as_ref().unwrap();
            assert_eq!((wedges.stride(), wedges.len()), (5, tin.points.len()));
            assert_eq!((scene.images.len(), scene.materials[0].base_color_image), (1, Some(0)));
        }
    }

    #[test]
    fn tiles_round_every_vertex_alike() {
        let (grid, tin) = slope();
        let space = Space::World { spacing: [0.1, 0.3], exaggeration: 1.0 };
        let tile = tile_scene(&tin, &grid, space, &Dress::default(), "a");
        assert!(!tile.meshes[0].geometry.positions.is_f64());
    }
}
