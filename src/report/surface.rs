//! What a scene shows, as triangles in the world.

use crate::aif::{BuildError, NONE, Semantic, triangulate_polygon};
use crate::io::flatten::flatten;
use crate::scene::Scene;
use glam::{DVec3, Vec3};

/// Triangles in the world, with what shading needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    pub(super) points: Vec<DVec3>,
    pub(super) triangles: Vec<Triangle>,
    /// Normals of every triangle's corners; empty if no face has any. Zero where a corner has none.
    pub(super) normals: Vec<[Vec3; 3]>,
    /// Linear colours; the first is that of faces without a material.
    pub(super) palette: Vec<[f32; 3]>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Triangle {
    pub(super) corners: [u32; 3],
    /// Of the palette.
    pub(super) color: u32,
    /// Bit k: the edge from corner k is one of the face it was cut from, no diagonal.
    pub(super) edges: u8,
}

/// Linear grey of faces without a material.
const NO_MATERIAL: [f32; 3] = [0.55, 0.6, 0.65];

/// Why a scene has no surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("mesh {mesh}: {source}")]
pub struct SurfaceError {
    /// The mesh, an index of [`Scene::meshes`].
    pub mesh: usize,
    /// What is wrong with it.
    pub source: BuildError,
}

impl Surface {
    /// The faces of all instances, transformed by their nodes; polygons are cut into triangles. Wires and points are not shown.
    ///
    /// Errors: a mesh that [`crate::aif::Mesh::build`] would refuse. O(n), polygons apart.
    pub fn of(scene: &Scene) -> Result<Surface, SurfaceError> {
        for (mesh, m) in scene.meshes.iter().enumerate() {
            m.geometry.validate().map_err(|source| SurfaceError { mesh, source })?;
        }
        let flat = flatten(scene, "a picture");
        let input = &*flat.geometry;
        let mut palette = vec![NO_MATERIAL];
        palette.extend(scene.materials.iter().map(|m| [m.base_color[0], m.base_color[1], m.base_color[2]]));
        let mut out =
            Surface { points: input.positions.iter().collect(), triangles: vec![], normals: vec![], palette };
        let wedges = input.wedges.as_ref();
        let with_normals = wedges.and_then(|w| Some((w, w.channel(&Semantic::Normal)?)));
        let normal = |corner: usize| {
            let of_corner = with_normals.and_then(|(w, k)| {
                let id = w.corner.get(corner).copied().filter(|&id| id != NONE)?;
                w.get(id, k)
            });
            match of_corner {
                Some(&[x, y, z]) => Vec3::new(x, y, z),
                _ => Vec3::ZERO,
            }
        };

        let (mut points, mut cut) = (Vec::new(), Vec::new());
        let mut start = 0;
        for f in 0..input.face_count() {
            let n = input.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
            let corners = &input.corners[start..start + n];
            let material = input.face_material.get(f).copied().filter(|&m| m != NONE);
            let color = material.map_or(0, |m| m.saturating_add(1));
            let color = if (color as usize) < out.palette.len() { color } else { 0 };
            cut.clear();
            if n == 3 {
                cut.push([0, 1, 2]);
            } else {
                points.clear();
                points.extend(corners.iter().map(|&v| out.points[v as usize]));
                triangulate_polygon(&points, &mut cut);
            }
            for t in &cut {
                let next = |i: u32| if i as usize + 1 == n { 0 } else { i + 1 };
                let side = |k: usize| next(t[k]) == t[(k + 1) % 3] || next(t[(k + 1) % 3]) == t[k];
                let edges = (0..3).filter(|&k| side(k)).fold(0, |bits, k| bits | 1 << k);
                out.triangles.push(Triangle { corners: t.map(|i| corners[i as usize]), color, edges });
                if with_normals.is_some() {
                    out.normals.push(t.map(|i| normal(start + i as usize)));
                }
            }
            start += n;
        }
        Ok(out)
    }

    /// Number of triangles, instances counted each.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Least and greatest coordinates of the triangles' corners; `None` without triangles.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut corners = self.triangles.iter().flat_map(|t| t.corners).map(|v| self.points[v as usize]);
        let first = corners.next()?;
        Some(corners.fold((first, first), |(lo, hi), p| (lo.min(p), hi.max(p))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::MeshInput;
    use crate::scene::{Node, SceneMesh};
    use glam::DMat4;

    fn scene(geometry: MeshInput) -> Scene {
        Scene::from_mesh(SceneMesh { geometry, ..Default::default() })
    }

    #[test]
    fn a_polygon_has_its_sides_and_no_diagonal() {
        let square = vec![[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let s = Surface::of(&scene(MeshInput::polygons(square, &[4], &[0, 1, 2, 3]))).unwrap();
        assert_eq!(s.triangle_count(), 2);
        assert_eq!(s.triangles.iter().map(|t| t.edges.count_ones()).sum::<u32>(), 4);
    }

    #[test]
    fn nodes_are_applied_and_unused_points_do_not_count() {
        let points = vec![[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [99.0, 0.0, 0.0]];
        let mut scene = scene(MeshInput::triangles(points, &[[0, 1, 2]]));
        let transform = DMat4::from_translation(DVec3::new(10.0, 0.0, 0.0));
        scene.nodes.push(Node { name: None, transform, mesh: Some(0), children: vec![] });
        scene.roots.push(1);
        let s = Surface::of(&scene).unwrap();
        assert_eq!(s.triangle_count(), 2);
        assert_eq!(s.bounds(), Some((DVec3::ZERO, DVec3::new(11.0, 1.0, 0.0))));
    }

    #[test]
    fn a_mesh_that_is_none_is_refused_by_its_number() {
        let bad = MeshInput::triangles(vec![[0.0f32; 3]], &[[0, 0, 7]]);
        assert_eq!(Surface::of(&scene(bad)).unwrap_err().mesh, 0);
        assert_eq!(Surface::of(&Scene::default()).unwrap().bounds(), None);
    }
}
