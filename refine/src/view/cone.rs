//! Normal cones: which parts of a surface turn their back.

use super::camera::Camera;
use glam::DVec3;

/// A cone about an axis that holds the normals of a part of a surface.
///
/// Kept as cosine and sine of its half angle. A half angle of 90 degrees and more tells nothing: such a cone never faces away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalCone {
    axis: DVec3,
    cos: f64,
    sin: f64,
}

/// Added to every half angle, so that rounding makes no cone too narrow.
const SLACK: f64 = 1e-7;

impl NormalCone {
    /// A cone that holds all directions.
    pub const ALL: NormalCone = NormalCone { axis: DVec3::Z, cos: -1.0, sin: 0.0 };

    /// The cone about an axis (of any length) with a half angle in radians; [`NormalCone::ALL`] for an axis that is none.
    pub fn new(axis: DVec3, half_angle: f64) -> NormalCone {
        let Some(axis) = axis.try_normalize() else { return NormalCone::ALL };
        let angle = half_angle.clamp(0.0, f64::INFINITY) + SLACK;
        // Not the comparison turned round: NaN is a cone of all directions.
        if angle < std::f64::consts::PI {
            NormalCone { axis, cos: angle.cos(), sin: angle.sin() }
        } else {
            NormalCone::ALL
        }
    }

    /// A cone that holds all of these normals, about their mean; they need not be of unit length, and those of no length (of faces without
    /// area) are left out. Not always the narrowest. [`NormalCone::ALL`] if there is none. Two walks, O(n).
    pub fn around(normals: impl Iterator<Item = DVec3> + Clone) -> NormalCone {
        let unit = normals.filter_map(DVec3::try_normalize);
        let Some(axis) = unit.clone().sum::<DVec3>().try_normalize() else { return NormalCone::ALL };
        let widest = unit.map(|n| axis.angle_between(n)).fold(0.0, f64::max);
        NormalCone::new(axis, widest)
    }

    /// The axis, of unit length.
    pub fn axis(&self) -> DVec3 {
        self.axis
    }

    /// The half angle, radians, 0 to pi.
    pub fn half_angle(&self) -> f64 {
        self.sin.atan2(self.cos)
    }

    /// The narrowest cone that holds both.
    pub fn join(&self, other: &NormalCone) -> NormalCone {
        let (a, b) = (self.half_angle(), other.half_angle());
        let between = self.axis.angle_between(other.axis);
        if between + b <= a {
            return *self;
        }
        if between + a <= b {
            return *other;
        }
        let half = 0.5 * (a + b + between);
        if half.is_nan() || half >= std::f64::consts::PI {
            return NormalCone::ALL;
        }
        // From our axis towards the other's, by as much as our side falls short.
        let (turn, across) = (half - a, other.axis - self.axis * self.axis.dot(other.axis));
        match across.try_normalize() {
            Some(across) => NormalCone::new(self.axis * turn.cos() + across * turn.sin(), half),
            // The same direction, or opposite ones.
            None if between < 1.0 => NormalCone::new(self.axis, a.max(b) + between),
            None => NormalCone::ALL,
        }
    }

    /// True if whatever lies in the sphere, with a normal in the cone, turns its back to an eye: seen from there it shows no front.
    ///
    /// With d from the eye to the sphere's centre, at angle beta from the axis: |d| cos(beta + half angle) >= radius.
    /// Sharp but for 1e-7 rad: where it is false, some normal in the cone at some place in the sphere faces the eye.
    #[inline]
    pub fn faces_away_from(&self, eye: DVec3, centre: DVec3, radius: f64) -> bool {
        self.cos > 0.0 && self.least(centre - eye) >= radius
    }

    /// True if whatever has a normal in the cone turns its back to a view along `look` (not to an eye: orthographic).
    #[inline]
    pub fn faces_along(&self, look: DVec3) -> bool {
        self.cos > 0.0 && self.least(look) >= 0.0
    }

    /// True if whatever lies in the sphere, with a normal in the cone, turns its back to a camera.
    #[inline]
    pub fn faces_away(&self, camera: &Camera, centre: DVec3, radius: f64) -> bool {
        if camera.is_perspective() {
            self.faces_away_from(camera.eye(), centre, radius)
        } else {
            self.faces_along(camera.look())
        }
    }

    /// The least dot product of `d` with a direction of the cone, or something negative if that is.
    #[inline]
    fn least(&self, d: DVec3) -> f64 {
        let along = d.dot(self.axis);
        if along > 0.0 { along * self.cos - d.cross(self.axis).length() * self.sin } else { -1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions all over the sphere.
    fn directions(n: usize) -> impl Iterator<Item = DVec3> + Clone {
        (0..n).map(move |i| {
            let (z, turn) = (1.0 - (2 * i + 1) as f64 / n as f64, i as f64 * 2.399963);
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * turn.cos(), r * turn.sin(), z)
        })
    }

    #[test]
    fn a_cone_holds_what_it_is_made_of() {
        for axis in directions(20) {
            let near: Vec<_> = directions(400).filter(|d| d.dot(axis) > 0.7).map(|d| 3.0 * d).collect();
            let cone = NormalCone::around(near.iter().copied().chain([DVec3::ZERO]));
            assert!(
                cone.half_angle() < 1.0
                    && near.iter().all(|d| cone.axis().angle_between(*d) <= cone.half_angle())
            );
            for other in directions(20).map(|d| NormalCone::new(d, 0.4)).chain([NormalCone::ALL, cone]) {
                let both = cone.join(&other);
                for (c, name) in [(cone, "a"), (other, "b")] {
                    let reach = both.axis().angle_between(c.axis()) + c.half_angle();
                    assert!(
                        reach.min(std::f64::consts::PI) <= both.half_angle() + 1e-9,
                        "{name} {reach} {both:?}"
                    );
                }
                assert!(both.half_angle() <= 0.5 * (cone.half_angle() + other.half_angle() + 3.15));
            }
        }
        assert_eq!(NormalCone::around([DVec3::X, DVec3::NEG_X].into_iter()), NormalCone::ALL);
        assert_eq!(NormalCone::around(std::iter::empty()), NormalCone::ALL);
        assert_eq!(NormalCone::new(DVec3::X, f64::NAN).half_angle(), std::f64::consts::PI);
    }

    #[test]
    fn what_faces_away_shows_no_front_and_the_test_is_sharp() {
        let (axis, half, centre, radius) =
            (DVec3::new(0.2, 0.3, 1.0).normalize(), 0.5, DVec3::new(1.0, 2.0, 3.0), 0.7);
        let cone = NormalCone::new(axis, half);
        let normals: Vec<_> = directions(4000).filter(|d| d.dot(axis) >= half.cos()).collect();
        let mut away = 0;
        for eye in directions(60).flat_map(|d| [1.0, 1.5, 4.0, 50.0].map(|s| centre + s * d)) {
            // The place in the sphere where a normal faces the eye most.
            let front = normals.iter().map(|n| n.dot(eye - centre) + radius).fold(f64::MIN, f64::max);
            let says = cone.faces_away_from(eye, centre, radius);
            assert!(!says || front <= 1e-9, "{front}");
            assert!(says || front > -0.05 * eye.distance(centre), "{front}");
            away += usize::from(says);
        }
        assert!(away > 10, "{away}");
        assert!(!cone.faces_away_from(centre, centre, radius) && !NormalCone::ALL.faces_along(DVec3::Z));
        for look in directions(200) {
            let front = normals.iter().map(|n| -n.dot(look)).fold(f64::MIN, f64::max);
            assert!(!cone.faces_along(look) || front <= 1e-6);
            assert!(cone.faces_along(look) || front > -0.05);
        }
    }
}
