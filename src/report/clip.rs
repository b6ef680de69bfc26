//! Cutting triangles at the near plane and at a band round the picture.

use super::view::View;
use glam::DVec3;

/// A corner on its way to the picture, homogeneous as [`super::view::Seen`] is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) w: f64,
    pub(super) z: f64,
    pub(super) normal: DVec3,
    /// In the world.
    pub(super) point: DVec3,
    /// True if the edge to the next corner is one of the face.
    pub(super) edge: bool,
}

impl Corner {
    fn mix(&self, to: &Corner, t: f64, edge: bool) -> Corner {
        let at = |a: f64, b: f64| a + t * (b - a);
        Corner {
            x: at(self.x, to.x),
            y: at(self.y, to.y),
            w: at(self.w, to.w),
            z: at(self.z, to.z),
            normal: self.normal.lerp(to.normal, t),
            point: self.point.lerp(to.point, t),
            edge,
        }
    }
}

/// Pixels beyond the middle of the picture up to which coordinates are exact enough; past it triangles are cut.
pub(super) fn guard(view: &View) -> f64 {
    4.0 * view.width().max(view.height()) as f64
}

/// Cuts the triangle in `polygon`; what is left has up to eight corners, or none. `scratch` is overwritten.
pub(super) fn clip(polygon: &mut Vec<Corner>, scratch: &mut Vec<Corner>, view: &View) {
    let (near, guard) = (view.near(), guard(view));
    let planes: [&dyn Fn(&Corner) -> f64; 5] =
        [&|c| c.w - near, &|c| guard * c.w - c.x, &|c| guard * c.w + c.x, &|c| guard * c.w - c.y, &|c| {
            guard * c.w + c.y
        }];
    for plane in planes {
        if polygon.iter().all(|c| plane(c) >= 0.0) {
            continue;
        }
        scratch.clear();
        for (i, a) in polygon.iter().enumerate() {
            let b = &polygon[(i + 1) % polygon.len()];
            let (da, db) = (plane(a), plane(b));
            if da >= 0.0 {
                scratch.push(*a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                // Leaving, the next edge is the cut itself; entering, it is the rest of this one.
                scratch.push(a.mix(b, da / (da - db), da < 0.0 && a.edge));
            }
        }
        std::mem::swap(polygon, scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Projection;

    fn corner(x: f64, y: f64, w: f64) -> Corner {
        Corner { x, y, w, z: w, normal: DVec3::Z, point: DVec3::ZERO, edge: true }
    }

    #[test]
    fn what_is_behind_the_eye_is_cut_off_and_the_cut_is_no_edge() {
        let view = View::fit(None, DVec3::NEG_Z, DVec3::Y, 10, 10)
            .with_projection(Projection::Perspective { distance: 3.0 });
        let mut p = vec![corner(0.0, 0.0, 1.0), corner(0.01, 0.0, 1.0), corner(0.0, 0.01, -1.0)];
        clip(&mut p, &mut vec![], &view);
        assert_eq!(p.len(), 4);
        assert!(p.iter().all(|c| c.w >= view.near() - 1e-12));
        assert_eq!(p.iter().filter(|c| !c.edge).count(), 1);
        let mut p = vec![corner(0.0, 0.0, -1.0); 3];
        clip(&mut p, &mut vec![], &view);
        assert!(p.is_empty());
    }

    #[test]
    fn what_reaches_far_out_is_cut_at_the_band() {
        let view = View::fit(None, DVec3::NEG_Z, DVec3::Y, 10, 10);
        let mut p = vec![corner(-1e9, -1e9, 1.0), corner(1e9, -1e9, 1.0), corner(0.0, 1e9, 1.0)];
        clip(&mut p, &mut vec![], &view);
        assert!(p.len() >= 4 && p.iter().all(|c| c.x.abs() <= 40.001 && c.y.abs() <= 40.001), "{p:?}");
    }
}
