//! Bounds of splits, packed into ten bytes.

use crate::view::NormalCone;
use glam::{DVec3, Vec3};

/// What is known of all that lies below a split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitBounds {
    /// The vertex before it is split, model units.
    pub centre: DVec3,
    /// A sphere about it holds the faces of the finest mesh around all vertices that come of it.
    pub radius: f64,
    /// Their normals lie in this cone.
    pub cone: NormalCone,
    /// The error of a mesh in which it is not applied, there; see the [module](super) for what it bounds.
    pub error: f64,
}

/// Bounds of all splits.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bounds {
    /// Centres are taken about this, and then rounded to f32; radii allow for that.
    pub(crate) origin: DVec3,
    pub(crate) diagonal: f64,
    pub(crate) error: Vec<u16>,
    pub(crate) radius: Vec<u16>,
    pub(crate) axis: Vec<u32>,
    pub(crate) angle: Vec<u16>,
}

/// A normal cone as it is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cone {
    pub(crate) axis: u32,
    pub(crate) angle: u16,
}

/// A cone that holds all directions.
const WIDE: u16 = u16::MAX;
/// Angles of stored cones: these many steps to 90 degrees.
const STEPS: f64 = 65000.0;

impl Cone {
    pub(crate) const ALL: Cone = Cone { axis: 0, angle: WIDE };

    /// The least that can be stored and holds `cone`.
    pub(crate) fn around(cone: &NormalCone) -> Cone {
        let axis = pack_direction(cone.axis());
        let angle = cone.half_angle() + cone.axis().angle_between(unpack_direction(axis));
        let steps = (angle / std::f64::consts::FRAC_PI_2 * STEPS).ceil() + 1.0;
        // Not the comparison turned round: NaN tells nothing.
        if steps < STEPS { Cone { axis, angle: steps as u16 } } else { Cone::ALL }
    }

    #[inline]
    pub(crate) fn unpack(self) -> NormalCone {
        if self.angle == WIDE {
            return NormalCone::ALL;
        }
        NormalCone::new(unpack_direction(self.axis), self.angle as f64 / STEPS * std::f64::consts::FRAC_PI_2)
    }
}

impl Cone {
    /// Axis, and cosine and sine of the half angle; a cosine of -1 for a cone that tells nothing.
    #[inline]
    pub(crate) fn unpack_parts(self) -> (Vec3, f32, f32) {
        if self.angle == WIDE {
            return (Vec3::Z, -1.0, 0.0);
        }
        let (sin, cos) = (self.angle as f32 * (std::f32::consts::FRAC_PI_2 / STEPS as f32)).sin_cos();
        (unpack_direction(self.axis).as_vec3(), cos, sin)
    }
}

/// A direction as a point of an octahedron, 16 bits each way.
fn pack_direction(d: DVec3) -> u32 {
    let sum = d.abs().element_sum();
    if sum.is_nan() || sum <= 0.0 {
        return 0;
    }
    let (x, y) = (d.x / sum, d.y / sum);
    let (x, y) = if d.z < 0.0 { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) } else { (x, y) };
    let code = |t: f64| ((t * 0.5 + 0.5) * 65535.0).round() as u32;
    code(x) | code(y) << 16
}

/// The direction stored, of unit length.
#[inline]
fn unpack_direction(code: u32) -> DVec3 {
    let (x, y) = ((code & 0xffff) as f64 / 32767.5 - 1.0, (code >> 16) as f64 / 32767.5 - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    DVec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize()
}

/// The least stored number that is not below `x`: the 8 bits of an f32's exponent and the first 8 of its mantissa. Not negative.
#[inline]
pub(crate) fn pack_up(x: f64) -> u16 {
    if x.is_nan() || x >= 1.7e38 {
        return 0xfe00;
    }
    let mut f = x as f32;
    if (f as f64) < x {
        f = f.next_up();
    }
    (f.to_bits().div_ceil(1 << 15)) as u16
}

/// The number stored.
#[inline]
pub(crate) fn unpack(code: u16) -> f32 {
    f32::from_bits((code as u32) << 15)
}

impl Bounds {
    pub(crate) fn of(&self, i: usize, centre: DVec3) -> SplitBounds {
        SplitBounds {
            centre,
            radius: unpack(self.radius[i]) as f64,
            cone: Cone { axis: self.axis[i], angle: self.angle[i] }.unpack(),
            error: unpack(self.error[i]) as f64,
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        10 * self.error.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_up_and_by_little() {
        for x in [0.0, 1.0, 1.0000001, 3.7e-12, 123456.7, 1e-39, 1e-300, 2.5e30] {
            let y = unpack(pack_up(x)) as f64;
            assert!(y >= x && y <= x * 1.004 + 1e-40, "{x} {y}");
        }
        assert!(unpack(pack_up(f64::INFINITY)).is_finite() && unpack(pack_up(f64::NAN)) > 1e38);
        assert!((0..2000).all(|k| pack_up(k as f64 * 0.37) <= pack_up((k + 1) as f64 * 0.37)));
    }

    #[test]
    fn stored_cones_hold_what_they_are_made_of() {
        for k in 0..500 {
            let t = k as f64;
            let d = DVec3::new((t * 0.37).sin(), (t * 0.71).cos(), (t * 0.11).sin());
            let cone = NormalCone::new(d, 0.001 * t);
            let stored = Cone::around(&cone);
            if stored == Cone::ALL {
                assert!(cone.half_angle() > 1.56);
                continue;
            }
            let back = stored.unpack();
            let off = back.axis().angle_between(cone.axis());
            assert!(off < 1e-4 && off + cone.half_angle() <= back.half_angle());
            assert!(back.half_angle() < cone.half_angle() + 3e-4);
        }
        assert_eq!(Cone::around(&NormalCone::ALL), Cone::ALL);
    }
}
