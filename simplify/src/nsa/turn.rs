//! The criterion: whether a face's normal turns by at most epsilon.

use glam::DVec3;
use progmesh_aif::{FaceId, Topology, VertexId};

/// Rounding of the normals of faces that lie in one plane: 1e-6 radians.
const ROUNDING: f64 = 1e-12;

/// An angle that normals may turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct MaxTurn {
    obtuse: bool,
    cos_squared: f64,
}

impl MaxTurn {
    /// `degrees` in 0..=180.
    pub(super) fn new(degrees: f64) -> Self {
        let cos = degrees.to_radians().cos();
        let slack = if cos < 0.0 { 1.0 + ROUNDING } else { 1.0 - ROUNDING };
        MaxTurn { obtuse: cos < 0.0, cos_squared: cos * cos * slack }
    }

    /// True if `after` lies within the angle of `before`; neither need be a unit vector. No normal before: any will do. One before
    /// and none after: never.
    #[inline]
    pub(super) fn allows(self, before: DVec3, after: DVec3) -> bool {
        let b = before.length_squared();
        if b == 0.0 {
            return true;
        }
        let a = after.length_squared();
        let dot = before.dot(after);
        // cos(angle) >= cos(epsilon), squared; the sign apart.
        let bound = self.cos_squared * a * b;
        if self.obtuse {
            a > 0.0 && (dot >= 0.0 || dot * dot <= bound)
        } else {
            a > 0.0 && dot >= 0.0 && dot * dot >= bound
        }
    }
}

/// Newell's normal of `f` (its length is twice the area) with its vertices where `at` says.
#[inline]
pub(super) fn newell(t: &Topology, f: FaceId, at: impl Fn(VertexId) -> DVec3) -> DVec3 {
    let mut points = t.face_vertices(f).map(at);
    let Some(origin) = points.next() else { return DVec3::ZERO };
    let (mut sum, mut last) = (DVec3::ZERO, DVec3::ZERO);
    for p in points {
        sum += last.cross(p - origin);
        last = p - origin;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(degrees: f64) -> DVec3 {
        let (s, c) = degrees.to_radians().sin_cos();
        DVec3::new(s, 0.0, c) * 0.001
    }

    #[test]
    fn the_angle_counts_and_the_length_does_not() {
        for epsilon in [1.0, 12.0, 60.0, 90.0, 120.0, 179.0] {
            let m = MaxTurn::new(epsilon);
            assert!(m.allows(DVec3::Z * 7.0, turned(epsilon - 0.01)), "{epsilon}");
            assert!(m.allows(DVec3::Z * 7.0, turned(0.01 - epsilon)), "{epsilon}");
            assert!(!m.allows(DVec3::Z * 7.0, turned(epsilon + 0.01)), "{epsilon}");
        }
        assert!(MaxTurn::new(0.0).allows(DVec3::Z, DVec3::Z * 3.0));
        assert!(!MaxTurn::new(0.0).allows(DVec3::Z, turned(0.01)));
        assert!(!MaxTurn::new(90.0).allows(DVec3::Z, -DVec3::Z));
        assert!(MaxTurn::new(180.0).allows(DVec3::Z, -DVec3::Z));
    }

    #[test]
    fn a_face_without_a_normal_may_get_any_and_none_may_lose_its() {
        for epsilon in [0.0, 90.0, 180.0] {
            let m = MaxTurn::new(epsilon);
            assert!(m.allows(DVec3::ZERO, DVec3::X) && m.allows(DVec3::ZERO, DVec3::ZERO));
            assert!(!m.allows(DVec3::X, DVec3::ZERO));
        }
    }
}
