//! Surfaces cut at planes of the world.

use super::ViewError;
use super::instances::{Fate, each, is_skinned};
use crate::refine::view::clip::{clip_mesh, side};
use crate::scene::Scene;
use glam::{DVec3, DVec4};

/// What [`clip_scene`] did. Faces are counted for each instance that was looked at; those at the same place count once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ClipReport {
    /// Instances that are as they were.
    pub inside: usize,
    /// Instances that were cut.
    pub cut: usize,
    /// Instances of which nothing is left.
    pub outside: usize,
    /// Faces that were cut.
    pub cut_faces: usize,
    /// Faces of which nothing is left, of instances that were cut.
    pub dropped_faces: usize,
    /// Triangles that close cuts.
    pub cap_triangles: usize,
    /// Loops that they close.
    pub loops: usize,
    /// Edges of cuts where the mesh is open: no cap closes them.
    pub open_edges: usize,
    /// Instances that move with a skin, and were cut where they rest.
    pub skinned: usize,
}

/// Cuts a scene to where all planes `[a, b, c, d]` of the world have ax + by + cz + d >= 0, and closes the cuts of closed meshes if `cap` says so;
/// see [`clip_mesh`] for what is kept of a mesh.
///
/// Every instance is cut where it stands, in its mesh's own coordinates. Those that no plane cuts go on sharing their mesh, those at the same
/// place too. Nodes stay, if without a mesh. O(planes * faces) of the instances that a plane cuts.
pub fn clip_scene(scene: &mut Scene, planes: &[DVec4], cap: bool) -> Result<ClipReport, ViewError> {
    for (m, mesh) in scene.meshes.iter().enumerate() {
        mesh.geometry.validate().map_err(|e| ViewError::build(m, e))?;
    }
    let bounds: Vec<_> = scene.meshes.iter().map(|m| m.geometry.positions.bounds()).collect();
    let mut report = ClipReport::default();
    each(scene, |scene, m, to_world| {
        let own: Vec<DVec4> = planes.iter().map(|&p| to_world.transpose() * p).collect();
        let Some((lo, hi)) = bounds[m] else { return Ok(Fate::Keep) };
        let (mut inside, mut outside) = (true, false);
        for &plane in &own {
            let corner = |k: u32| {
                let pick = |axis: usize| if k >> axis & 1 == 0 { lo[axis] } else { hi[axis] };
                side(plane, DVec3::new(pick(0), pick(1), pick(2)).extend(1.0))
            };
            inside &= (0..8).all(|k| corner(k) >= 0.0);
            outside |= (0..8).all(|k| corner(k) < 0.0);
        }
        if outside {
            report.outside += 1;
            return Ok(Fate::Drop);
        }
        if inside {
            report.inside += 1;
            return Ok(Fate::Keep);
        }
        report.skinned += is_skinned(&scene.meshes[m]) as usize;
        let done = clip_mesh(&scene.meshes[m].geometry, &own, cap)
            .map_err(|source| ViewError::Mesh { mesh: m, source })?;
        report.cut_faces += done.cut;
        report.dropped_faces += done.dropped;
        report.cap_triangles += done.capped;
        report.loops += done.loops;
        report.open_edges += done.open_edges;
        if done.mesh.corners.is_empty() && done.mesh.wires.is_empty() && done.mesh.positions.is_empty() {
            report.outside += 1;
            return Ok(Fate::Drop);
        }
        report.cut += 1;
        Ok(Fate::Replace(Box::new(done.mesh)))
    })?;
    Ok(report)
}
