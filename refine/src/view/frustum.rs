//! The six planes of a view, and what is outside of them.

use glam::{DMat4, DVec3};

/// A plane, inside where it is positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Inwards, of unit length; zero for a plane that nothing is outside of.
    pub normal: DVec3,
    /// The distance of the frustum's origin, positive inside.
    pub offset: f64,
}

/// The planes of a frustum, in the order in which [`Frustum::planes`] gives them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum PlaneName {
    /// -w <= x.
    Left,
    /// x <= w.
    Right,
    /// -w <= y.
    Bottom,
    /// y <= w.
    Top,
    /// -w <= z.
    Near,
    /// z <= w.
    Far,
}

impl PlaneName {
    /// All six, in order.
    pub const ALL: [PlaneName; 6] = [
        PlaneName::Left,
        PlaneName::Right,
        PlaneName::Bottom,
        PlaneName::Top,
        PlaneName::Near,
        PlaneName::Far,
    ];
}

/// Why a matrix has no six planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrustumError {
    /// NaN or infinite, or so large that its planes are.
    #[error("the view matrix has numbers that are not finite")]
    NotFinite,
    /// Nothing is inside of this plane.
    #[error("the {0:?} plane of the view matrix has everything outside")]
    Degenerate(PlaneName),
}

/// Planes that are still in question: bit k for plane k. What is inside of a plane with all it bounds need not be tested
/// against it again, so a hierarchy hands these down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Planes(u8);

impl Planes {
    /// All six: where a walk begins.
    pub const ALL: Planes = Planes(0x3f);
    /// None: wholly inside.
    pub const NONE: Planes = Planes(0);

    /// True if no plane is in question: wholly inside.
    #[inline]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// True if this plane is still in question.
    #[inline]
    pub fn has(self, plane: PlaneName) -> bool {
        self.0 >> plane as u8 & 1 != 0
    }

    /// The same without this plane.
    #[inline]
    pub fn without(self, plane: PlaneName) -> Planes {
        Planes(self.0 & !(1 << plane as u8))
    }

    /// One bit a plane, in the order of [`PlaneName::ALL`]; 0 to 63.
    #[inline]
    pub fn bits(self) -> u8 {
        self.0
    }

    /// From bits; those beyond the sixth are ignored.
    #[inline]
    pub fn from_bits(bits: u8) -> Planes {
        Planes(bits & 0x3f)
    }
}

/// Six planes, inside where all are positive (or zero).
///
/// They stand about an origin of their own (for a camera's, the eye): points are moved there before they are measured, so that
/// a frustum far from the world's origin loses no digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frustum {
    origin: DVec3,
    planes: [Plane; 6],
}

impl Frustum {
    /// The planes of a matrix to clip space (-w <= x, y, z <= w inside), in the space that it maps from: its last row plus and minus
    /// the others (Gribb & Hartmann), divided by the length of their normals.
    ///
    /// A row of zeros but for a positive constant, as the far plane of an infinite projection, is a plane that nothing is outside of.
    pub fn from_matrix(to_clip: &DMat4) -> Result<Frustum, FrustumError> {
        if !to_clip.is_finite() {
            return Err(FrustumError::NotFinite);
        }
        let last = to_clip.row(3);
        let mut planes = [Plane { normal: DVec3::ZERO, offset: f64::INFINITY }; 6];
        for (k, plane) in planes.iter_mut().enumerate() {
            let row = to_clip.row(k / 2);
            let p = if k % 2 == 0 { last + row } else { last - row };
            let normal = p.truncate();
            // Scaled first: squares of 1e-200 are zero, of 1e200 infinite.
            let largest = normal.abs().max_element();
            if largest > 0.0 {
                let (normal, offset) = (normal / largest, p.w / largest);
                let length = normal.length();
                *plane = Plane { normal: normal / length, offset: offset / length };
            } else if p.w.is_nan() || p.w <= 0.0 {
                return Err(FrustumError::Degenerate(PlaneName::ALL[k]));
            }
            if !plane.normal.is_finite() || plane.offset.is_nan() || plane.offset == f64::NEG_INFINITY {
                return Err(FrustumError::NotFinite);
            }
        }
        Ok(Frustum { origin: DVec3::ZERO, planes })
    }

    /// Planes that nothing is outside of.
    pub fn everything() -> Frustum {
        Frustum { origin: DVec3::ZERO, planes: [Plane { normal: DVec3::ZERO, offset: f64::INFINITY }; 6] }
    }

    /// The same planes, moved along by `origin`: they stood about 0, and stand about it.
    pub fn about(self, origin: DVec3) -> Frustum {
        Frustum { origin: self.origin + origin, ..self }
    }

    /// The same planes in the space that `to_here` maps from: cull a mesh where it stands, in its own coordinates, instead of moving it.
    ///
    /// Distances are then those of that space. `None` if the matrix is not affine or cannot be inverted: place the points instead.
    pub fn in_space_of(&self, to_here: &DMat4) -> Option<Frustum> {
        let back = to_here.inverse();
        let affine = to_here.row(3).truncate() == DVec3::ZERO && to_here.w_axis.w == 1.0;
        if !affine || !back.is_finite() {
            return None;
        }
        // n . (M p + t - o) + d: the origin goes along, so that the planes' offsets change by scale alone.
        let origin = back.transform_point3(self.origin);
        let residue = to_here.transform_point3(origin) - self.origin;
        let turn = glam::DMat3::from_mat4(*to_here).transpose();
        let mut planes = self.planes;
        for plane in planes.iter_mut().filter(|p| p.normal != DVec3::ZERO) {
            let (normal, offset) = (turn * plane.normal, plane.offset + plane.normal.dot(residue));
            let largest = normal.abs().max_element();
            let length = (normal / largest).length() * largest;
            *plane = Plane { normal: normal / length, offset: offset / length };
            if !(plane.normal.is_finite() && plane.normal != DVec3::ZERO && !plane.offset.is_nan()) {
                return None;
            }
        }
        Some(Frustum { origin, planes })
    }

    /// What the planes' offsets are measured from.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The planes, in the order of [`PlaneName::ALL`].
    pub fn planes(&self) -> &[Plane; 6] {
        &self.planes
    }

    /// Distance of a point from a plane, positive inside.
    #[inline]
    pub fn distance(&self, plane: PlaneName, p: DVec3) -> f64 {
        let plane = &self.planes[plane as usize];
        plane.normal.dot(p - self.origin) + plane.offset
    }

    /// True if a point is inside, or on a plane.
    pub fn contains(&self, p: DVec3) -> bool {
        PlaneName::ALL.iter().all(|&k| self.distance(k, p) >= 0.0)
    }

    /// A sphere against the planes in question: `None` if it is outside of one, else those that may cut it.
    ///
    /// It may be outside of the frustum though of no single plane; and NaN is outside of nothing.
    #[inline]
    pub fn sphere(&self, centre: DVec3, radius: f64, planes: Planes) -> Option<Planes> {
        let p = centre - self.origin;
        let mut left = planes.0;
        for (k, plane) in self.planes.iter().enumerate() {
            if planes.0 >> k & 1 == 0 {
                continue;
            }
            let s = plane.normal.dot(p) + plane.offset;
            if s < -radius {
                return None;
            }
            if s >= radius {
                left &= !(1 << k);
            }
        }
        Some(Planes(left))
    }

    /// A box with sides along the axes against the planes in question: as [`Frustum::sphere`]. `lo <= hi`.
    #[inline]
    pub fn aabb(&self, lo: DVec3, hi: DVec3, planes: Planes) -> Option<Planes> {
        // Moved before they are halved, which is exact near the origin.
        let (lo, hi) = (lo - self.origin, hi - self.origin);
        let (centre, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
        let mut left = planes.0;
        for (k, plane) in self.planes.iter().enumerate() {
            if planes.0 >> k & 1 == 0 {
                continue;
            }
            let s = plane.normal.dot(centre) + plane.offset;
            let reach = plane.normal.abs().dot(half);
            if s < -reach {
                return None;
            }
            if s >= reach {
                left &= !(1 << k);
            }
        }
        Some(Planes(left))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Camera, CameraParameters, Projection};
    use super::*;

    fn camera(eye: DVec3, projection: Projection, far: f64) -> Camera {
        Camera::new(&CameraParameters {
            eye,
            target: eye + DVec3::new(0.3, -0.2, -1.0),
            up: DVec3::Y,
            projection,
            width: 160,
            height: 90,
            near: 1.0,
            far,
        })
        .unwrap()
    }

    /// A walk over points of a cube, the same every time.
    fn points(n: usize) -> impl Iterator<Item = DVec3> {
        (0..n).map(|i| {
            let at = |k: f64| ((i as f64 + 0.5) * k).fract() * 2.0 - 1.0;
            DVec3::new(at(0.754877666), at(0.569840291), at(0.362343))
        })
    }

    #[test]
    fn planes_hold_what_the_picture_shows() {
        for eye in [DVec3::ZERO, DVec3::new(1e6, -2e6, 3e6)] {
            for projection in
                [Projection::Perspective { fov_y_deg: 60.0 }, Projection::Orthographic { ortho_height: 9.0 }]
            {
                let camera = camera(eye, projection, 10.0);
                let frustum = camera.frustum();
                let mut inside = 0;
                for p in points(2000).map(|p| eye + 12.0 * p) {
                    let seen = camera.project(p).is_some_and(|(xy, depth)| {
                        (0.0..=160.0).contains(&xy.x)
                            && (0.0..=90.0).contains(&xy.y)
                            && (1.0..=10.0).contains(&depth)
                    });
                    assert_eq!(seen, frustum.contains(p), "{p}");
                    inside += usize::from(seen);
                }
                assert!(inside > 50, "{inside}");
            }
        }
    }

    #[test]
    fn flags_say_which_planes_are_left() {
        let camera = camera(DVec3::ZERO, Projection::Perspective { fov_y_deg: 60.0 }, 10.0);
        let frustum = camera.frustum();
        for (i, p) in points(3000).enumerate() {
            let (centre, radius) = (12.0 * p, 0.1 + 2.0 * ((i as f64) * 0.618).fract());
            let half = DVec3::new(radius, 0.3 * radius, 2.0 * radius);
            let corners = || points(60).map(|q| centre + (q * half));
            let ball = || points(60).map(|q| centre + q.normalize() * radius);
            let results = [
                (frustum.sphere(centre, radius, Planes::ALL), ball().collect::<Vec<_>>()),
                (frustum.aabb(centre - half, centre + half, Planes::ALL), corners().collect()),
            ];
            for (result, samples) in results {
                for q in samples {
                    match result {
                        None => assert!(!frustum.contains(q)),
                        Some(left) => {
                            for k in PlaneName::ALL.into_iter().filter(|&k| !left.has(k)) {
                                assert!(frustum.distance(k, q) >= -1e-9);
                            }
                            assert!(!left.is_empty() || frustum.contains(q));
                        }
                    }
                }
            }
        }
        // A plane not in question is not asked.
        let behind = DVec3::new(0.0, 0.0, 5.0);
        assert_eq!(frustum.sphere(behind, 1.0, Planes::ALL), None);
        assert_eq!(frustum.sphere(behind, 1.0, Planes::NONE), Some(Planes::NONE));
        assert!(frustum.sphere(DVec3::NAN, 1.0, Planes::ALL).is_some());
    }

    #[test]
    fn a_far_plane_at_infinity_cuts_nothing() {
        let camera = camera(DVec3::ZERO, Projection::Perspective { fov_y_deg: 60.0 }, f64::INFINITY);
        let frustum = camera.frustum();
        assert_eq!(frustum.planes()[PlaneName::Far as usize].normal, DVec3::ZERO);
        assert!(frustum.contains(camera.look() * 1e12));
        assert!(!frustum.contains(camera.look() * 0.5));
        let left = frustum.sphere(camera.look() * 1e9, 1.0, Planes::ALL);
        assert_eq!(left, Some(Planes::NONE));
    }

    #[test]
    fn planes_follow_a_mesh_into_its_own_space() {
        let eye = DVec3::new(3.0, 1.0, 8.0);
        let frustum = camera(eye, Projection::Perspective { fov_y_deg: 60.0 }, 20.0).frustum();
        let m = DMat4::from_translation(DVec3::new(1.0, -2.0, 0.5))
            * DMat4::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7)
            * DMat4::from_scale(DVec3::new(2.0, 0.5, -3.0));
        let own = frustum.in_space_of(&m).unwrap();
        for p in points(500).map(|p| 8.0 * p) {
            let world = m.transform_point3(p);
            for k in PlaneName::ALL {
                // Distances scale, sides do not change.
                let (a, b) = (own.distance(k, p), frustum.distance(k, world));
                assert!(a.signum() == b.signum() || b.abs() < 1e-12, "{a} {b}");
            }
        }
        assert!(frustum.in_space_of(&DMat4::ZERO).is_none());
        assert!(frustum.in_space_of(&DMat4::NAN).is_none());
    }

    #[test]
    fn matrices_without_planes_are_refused() {
        assert_eq!(Frustum::from_matrix(&DMat4::NAN), Err(FrustumError::NotFinite));
        assert_eq!(Frustum::from_matrix(&DMat4::ZERO), Err(FrustumError::Degenerate(PlaneName::Left)));
        let unit = Frustum::from_matrix(&DMat4::IDENTITY).unwrap();
        assert!(unit.contains(DVec3::ONE) && !unit.contains(DVec3::new(1.0, 1.0, 1.0001)));
    }
}
