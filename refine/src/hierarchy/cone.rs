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

    /// The axis, of any length from a half to 1; `None` for a cone that tells nothing.
    #[inline]
    pub(crate) fn axis(self) -> Option<DVec3> {
        (self.0 >> 20 != WIDE).then(|| octahedral(self.0))
    }

    /// A cosine of the half angle, of one that tells something, that is too small by up to 5e-7, and a sine that is too large by up to 4e-6: so nothing is taken to be outside
    /// of a cone that is not, and what is nested stays so, as both are off by the more the larger the angle is.
    #[inline]
    pub(crate) fn cos_sin(self) -> (f64, f64) {
        let x = (self.0 >> 20) as f64 * (std::f64::consts::FRAC_PI_2 / STEPS);
        let y = x * x;
        // Taylor's sums; what is left out has the sign of its first term.
        let cos = 1.0
            + y * (-1.0 / 2.0
                + y * (1.0 / 24.0 + y * (-1.0 / 720.0 + y * (1.0 / 40_320.0 - y * (1.0 / 3_628_800.0)))));
        let sin =
            x * (1.0 + y * (-1.0 / 6.0 + y * (1.0 / 120.0 + y * (-1.0 / 5_040.0 + y * (1.0 / 362_880.0)))));
        (cos, sin)
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
    octahedral(code).normalize()
}

/// The direction stored, as a point of the octahedron.
#[inline]
fn octahedral(code: u32) -> DVec3 {
    let of = |c: u32| (c & 0x3ff) as f64 * (2.0 / SIDE) - 1.0;
    let (x, y) = (of(code), of(code >> 10));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    DVec3::new(x - fold.copysign(x), y - fold.copysign(y), z)
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
            let Some(axis) = stored.axis() else {
                assert!(back.half_angle() > 1.5);
                continue;
            };
            assert!(axis.angle_between(back.axis()) < 1e-6 && (0.5..1.1).contains(&axis.length()));
            let (cos, sin) = stored.cos_sin();
            let angle = (stored.0 >> 20) as f64 / STEPS * std::f64::consts::FRAC_PI_2;
            assert!((angle.cos() - 5e-7..=angle.cos() + 1e-15).contains(&cos), "{angle} {cos}");
            assert!((angle.sin() - 1e-15..angle.sin() + 4e-6).contains(&sin), "{angle} {sin}");
        }
        assert_eq!(Cone::around(&NormalCone::ALL), Cone::ALL);
        assert_eq!(Cone::ALL.unpack(), NormalCone::ALL);
    }
}
