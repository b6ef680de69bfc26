//! How large a mesh's units are in the world.

use crate::scene::Scene;
use glam::{DMat3, DMat4, DVec3};

/// World units to a model unit of every mesh: the largest factor by which any of its instances stretches a length.
///
/// The largest, and not a mean such as the cube root of the determinant, so that an error allowed in the world is kept in every direction
/// and by every instance. A mesh that no node shows, or only at scale 0, counts 1.
pub fn world_scales(scene: &Scene) -> Vec<f64> {
    let mut scales = vec![0.0f64; scene.meshes.len()];
    for (node, world) in scene.nodes.iter().zip(scene.world_transforms()) {
        if let Some(s) = node.mesh.and_then(|m| scales.get_mut(m)) {
            *s = s.max(stretch(&world));
        }
    }
    scales.into_iter().map(|s| if s > 0.0 && s.is_finite() { s } else { 1.0 }).collect()
}

/// Diagonal of [`world_bounds`].
pub(super) fn world_diagonal(scene: &Scene) -> f64 {
    world_bounds(scene).map_or(0.0, |(lo, hi)| lo.distance(hi))
}

/// Least and greatest coordinates of all instances, world units; of the meshes as they are where no node shows any. The box of a turned
/// instance is that of its own box's corners, so it may come out larger than that of the vertices. O(vertices + nodes).
pub fn world_bounds(scene: &Scene) -> Option<(DVec3, DVec3)> {
    let bounds: Vec<_> = scene.meshes.iter().map(|m| m.geometry.positions.bounds()).collect();
    let world = scene.world_transforms();
    let mut shown: Vec<(usize, DMat4)> =
        scene.nodes.iter().zip(world).filter_map(|(n, w)| n.mesh.map(|m| (m, w))).collect();
    if shown.is_empty() {
        shown = (0..bounds.len()).map(|m| (m, DMat4::IDENTITY)).collect();
    }
    let corners =
        shown.iter().filter_map(|&(m, w)| Some((bounds.get(m).copied()??, w))).flat_map(|((lo, hi), w)| {
            (0..8u32).map(move |i| {
                let pick = |k: u32, axis: usize| if i >> k & 1 == 1 { hi[axis] } else { lo[axis] };
                w.transform_point3(DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2)))
            })
        });
    crate::aif::positions::bounds(corners)
}

/// The largest singular value of the linear part: the most it stretches a length.
fn stretch(m: &DMat4) -> f64 {
    let a = DMat3::from_mat4(*m);
    let largest = a.to_cols_array().iter().fold(0.0f64, |s, x| s.max(x.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return 0.0;
    }
    // The root of the largest eigenvalue of the symmetric A^T A, in closed form.
    let a = a * (1.0 / largest);
    let s = a.transpose() * a;
    let (x, y, z) = (s.x_axis, s.y_axis, s.z_axis);
    let mean = (x.x + y.y + z.z) / 3.0;
    let off = x.y * x.y + x.z * x.z + y.z * y.z;
    let spread =
        (((x.x - mean).powi(2) + (y.y - mean).powi(2) + (z.z - mean).powi(2) + 2.0 * off) / 6.0).sqrt();
    if spread <= f64::EPSILON * mean {
        return largest * mean.sqrt();
    }
    let b = (s - DMat3::from_diagonal(DVec3::splat(mean))) * (1.0 / spread);
    let angle = (b.determinant() / 2.0).clamp(-1.0, 1.0).acos() / 3.0;
    largest * (mean + 2.0 * spread * angle.cos()).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};

    #[test]
    fn the_stretch_is_the_largest_scale_however_turned_or_mirrored() {
        let (q, r) = (DQuat::from_rotation_x(0.7), DQuat::from_rotation_z(2.0) * DQuat::from_rotation_y(1.0));
        for (scale, want) in [
            (DVec3::ONE, 1.0),
            (DVec3::new(-3.0, 2.0, 0.5), 3.0),
            (DVec3::new(1e-12, 1e-13, 0.0), 1e-12),
            (DVec3::splat(1e200), 1e200),
        ] {
            let m = DMat4::from_quat(q) * DMat4::from_scale(scale) * DMat4::from_quat(r);
            assert!((stretch(&m) / want - 1.0).abs() < 1e-9, "{scale}: {}", stretch(&m));
        }
        assert_eq!(stretch(&DMat4::ZERO), 0.0);
        assert_eq!(stretch(&(DMat4::IDENTITY * f64::NAN)), 0.0);
    }
}
