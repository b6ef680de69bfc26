//! Vertex positions in the precision of the input.

use glam::DVec3;

/// Vertex positions, f32 or f64.
///
/// A mesh keeps the precision it was given: [`Positions::from_f64`] narrows to f32 only if that loses nothing.
/// Algorithms read and write `DVec3`; writing to an f32 array rounds to nearest.
#[derive(Clone, Debug, PartialEq)]
pub enum Positions {
    /// Single precision.
    F32(Vec<[f32; 3]>),
    /// Double precision.
    F64(Vec<[f64; 3]>),
}

impl Default for Positions {
    fn default() -> Self {
        Positions::F32(Vec::new())
    }
}

impl Positions {
    /// Positions from f64 values: stored as f32 when every value is exactly representable there. O(n).
    pub fn from_f64(points: Vec<[f64; 3]>) -> Self {
        // NaN must not force f64: builders report it as such.
        let exact = |x: f64| (x as f32) as f64 == x || x.is_nan();
        if points.iter().flatten().all(|&x| exact(x)) {
            Positions::F32(points.iter().map(|p| p.map(|x| x as f32)).collect())
        } else {
            Positions::F64(points)
        }
    }

    /// Number of points.
    #[inline]
    pub fn len(&self) -> usize {
        match self {
            Positions::F32(p) => p.len(),
            Positions::F64(p) => p.len(),
        }
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// True if stored in double precision.
    pub fn is_f64(&self) -> bool {
        matches!(self, Positions::F64(_))
    }

    /// Point `i`. Panics if out of range.
    #[inline]
    pub fn get(&self, i: usize) -> DVec3 {
        match self {
            Positions::F32(p) => DVec3::new(p[i][0] as f64, p[i][1] as f64, p[i][2] as f64),
            Positions::F64(p) => DVec3::from_array(p[i]),
        }
    }

    /// Sets point `i`, rounding to the stored precision. Panics if out of range.
    #[inline]
    pub fn set(&mut self, i: usize, to: DVec3) {
        match self {
            Positions::F32(p) => p[i] = [to.x as f32, to.y as f32, to.z as f32],
            Positions::F64(p) => p[i] = to.to_array(),
        }
    }

    /// `to` as it will read back after [`Positions::set`].
    #[inline]
    pub fn round(&self, to: DVec3) -> DVec3 {
        match self {
            Positions::F32(_) => DVec3::new(to.x as f32 as f64, to.y as f32 as f64, to.z as f32 as f64),
            Positions::F64(_) => to,
        }
    }

    /// All points as `DVec3`, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = DVec3> + '_ {
        (0..self.len()).map(|i| self.get(i))
    }

    /// The bits of point `i` with -0 read as +0: equal bits mean the same point. Panics if out of range.
    #[inline]
    pub fn bits(&self, i: usize) -> [u64; 3] {
        match self {
            Positions::F32(p) => p[i].map(|x| (x + 0.0).to_bits() as u64),
            Positions::F64(p) => p[i].map(|x| (x + 0.0).to_bits()),
        }
    }

    /// Keeps the points `old[i]`, in that order. Panics if one is out of range.
    pub fn gather(&self, old: &[u32]) -> Self {
        match self {
            Positions::F32(p) => Positions::F32(old.iter().map(|&i| p[i as usize]).collect()),
            Positions::F64(p) => Positions::F64(old.iter().map(|&i| p[i as usize]).collect()),
        }
    }

    /// Least and greatest coordinates over all finite points; `None` if there is none.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        bounds(self.iter())
    }
}

impl From<Vec<[f32; 3]>> for Positions {
    fn from(p: Vec<[f32; 3]>) -> Self {
        Positions::F32(p)
    }
}

/// Least and greatest coordinates of the finite points; `None` if there is none.
pub fn bounds(points: impl Iterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    let (lo, hi) = points
        .filter(|p| p.is_finite())
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    (lo.x <= hi.x).then_some((lo, hi))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn f64_is_kept_only_where_f32_would_lose() {
        assert!(!Positions::from_f64(vec![[0.5, 1.0, -2.0]]).is_f64());
        assert!(Positions::from_f64(vec![[0.1, 1.0, -2.0]]).is_f64());
        assert_eq!(Positions::from_f64(vec![[0.1, 1.0, -2.0]]).get(0).x, 0.1);
    }

    #[test]
    fn minus_zero_has_the_bits_of_zero() {
        let p = Positions::F32(vec![[0.0, 1.0, 2.0], [-0.0, 1.0, 2.0]]);
        assert_eq!(p.bits(0), p.bits(1));
    }

    #[test]
    fn bounds_skip_what_is_not_finite() {
        let p = Positions::F32(vec![[f32::NAN, 0.0, 0.0], [1.0, 2.0, 3.0]]);
        assert_eq!(p.bounds(), Some((DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 3.0))));
        assert_eq!(Positions::default().bounds(), None);
    }
}
