//! Normal cones, packed into four bytes.

use crate::view::NormalCone;
use glam::DVec3;

/// A normal cone as it is stored: its axis as a point of an octahedron, 10 bits each way, and 12 bits for its half angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cone(pub(crate) u32);

/// The angle of a cone that holds all directions.
const WIDE: u32 = 4095;
/// Angles of stored cones: these many steps to 90 degrees.
const STEPS: f64 = 4094.0;
/// The largest code of a coordinate of an axis.
const SIDE: f64 = 1023.0;

impl Cone {
    pub(crate) const ALL: Cone = Cone(WIDE << 20);

    /// The least that can be stored and holds `cone`.
    pub(crate) fn around(cone: &NormalCone) -> Cone {
        let axis = pack_direction(cone.axis());
        let angle = cone.half_angle() + cone.axis().angle_between(unpack_direction(axis));
        let steps = (angle / std::f64::consts::FRAC_PI_2 * STEPS).ceil() + 1.0;
        // Not the comparison turned round: NaN tells nothing.
        if steps < STEPS { Cone(axis | (steps as u32) << 20) } else { Cone::ALL }
    }

    #[inline]
    pub(crate) fn unpack(self) -> NormalCone {
        let steps = self.0 >> 20;
        if steps == WIDE {
            return NormalCone::ALL;
        }
        NormalCone::new(unpack_direction(self.0), steps as f64 / STEPS * std::f64::consts::FRAC_PI_2)
    }

    /// Axis, and cosine and sine of the half angle; a cosine of -1 for a cone that tells nothing.
    #[inline]
    pub(crate) fn unpack_parts(self) -> (DVec3, f64, f64) {
        let steps = self.0 >> 20;
        if steps == WIDE {
            return (DVec3::Z, -1.0, 0.0);
        }
        // In f32: stored cones are wider than what they are around by more than that rounds.
        let (sin, cos) = (steps as f32 * (std::f32::consts::FRAC_PI_2 / STEPS as f32)).sin_cos();
        (unpack_direction(self.0), cos as f64, sin as f64)
    }
}

/// A direction as a point of an octahedron, 10 bits each way.
fn pack_direction(d: DVec3) -> u32 {
    let sum = d.abs().element_sum();
    if sum.is_nan() || sum <= 0.0 {
        return 0;
    }
    let (x, y) = (d.x / sum, d.y / sum);
    let (x, y) = if d.z < 0.0 { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) } else { (x, y) };
    let code = |t: f64| ((t * 0.5 + 0.5) * SIDE).round() as u32;
    code(x) | code(y) << 10
}

/// The direction stored, of unit length.
#[inline]
fn unpack_direction(code: u32) -> DVec3 {
    let of = |c: u32| (c & 0x3ff) as f64 * (2.0 / SIDE) - 1.0;
    let (x, y) = (of(code), of(code >> 10));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    DVec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_cones_hold_what_they_are_made_of() {
        for k in 0..500 {
            let t = k as f64;
            let d = DVec3::new((t * 0.37).sin(), (t * 0.71).cos(), (t * 0.11).sin());
            let cone = NormalCone::new(d, 0.001 * t);
            let stored = Cone::around(&cone);
            let back = stored.unpack();
            let off = back.axis().angle_between(cone.axis());
            assert!(off < 4.3e-3 && off + cone.half_angle() <= back.half_angle());
            // 0.3 degrees.
            assert!(back.half_angle() < cone.half_angle() + 5.2e-3);
            let (axis, cos, sin) = stored.unpack_parts();
            assert!(axis.angle_between(back.axis()) < 1e-6);
            assert!(sin.atan2(cos) > cone.half_angle() + off + 1e-5);
        }
        assert_eq!(Cone::around(&NormalCone::ALL), Cone::ALL);
        assert_eq!(Cone::ALL.unpack(), NormalCone::ALL);
    }
}
