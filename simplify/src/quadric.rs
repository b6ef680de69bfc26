//! Quadrics: weighted squared distances to planes, about a local origin.
//!
//! `Q(p) = p'Ap + 2 b.p + c` with `p` relative to an origin that is the vertex itself (Garland & Heckbert 1997, local
//! origins after simplification practice: about a far origin `c` loses all its digits to cancellation). The planes of the
//! faces at a vertex pass through it, so a fresh quadric is `A` alone.

use glam::DVec3;

/// A quadric about a local origin that its owner knows. 88 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Quadric {
    /// Upper triangle of A: xx, xy, xz, yy, yz, zz.
    pub(crate) a: [f64; 6],
    pub(crate) b: DVec3,
    pub(crate) c: f64,
    /// Sum of the areas of the faces in it (constraint planes do not count).
    pub(crate) weight: f64,
}

impl Quadric {
    /// `k` times the squared distance to the plane through the origin with unit normal `n`.
    #[inline]
    pub(crate) fn add_plane(&mut self, n: DVec3, k: f64) {
        let kn = n * k;
        let add = [kn.x * n.x, kn.x * n.y, kn.x * n.z, kn.y * n.y, kn.y * n.z, kn.z * n.z];
        for (a, d) in self.a.iter_mut().zip(add) {
            *a += d;
        }
    }

    /// `A t`.
    #[inline]
    pub(crate) fn times(&self, t: DVec3) -> DVec3 {
        let a = &self.a;
        DVec3::new(
            a[0] * t.x + a[1] * t.y + a[2] * t.z,
            a[1] * t.x + a[3] * t.y + a[4] * t.z,
            a[2] * t.x + a[4] * t.y + a[5] * t.z,
        )
    }

    /// The same quadric about `origin + t`.
    #[inline]
    pub(crate) fn moved(&self, t: DVec3) -> Quadric {
        let at = self.times(t);
        Quadric { a: self.a, b: self.b + at, c: self.c + (2.0 * self.b + at).dot(t), weight: self.weight }
    }

    /// Sum of two quadrics about the same origin.
    #[inline]
    pub(crate) fn plus(&self, o: &Quadric) -> Quadric {
        let mut a = self.a;
        for (x, y) in a.iter_mut().zip(o.a) {
            *x += y;
        }
        Quadric { a, b: self.b + o.b, c: self.c + o.c, weight: self.weight + o.weight }
    }

    /// Q at `origin + t`; never below zero.
    #[inline]
    pub(crate) fn at(&self, t: DVec3) -> f64 {
        (self.times(t).dot(t) + 2.0 * self.b.dot(t) + self.c).max(0.0)
    }

    /// Trace of A: the sum of the planes' weights.
    #[inline]
    pub(crate) fn trace(&self) -> f64 {
        self.a[0] + self.a[3] + self.a[5]
    }

    /// The `t` that minimises `Q(origin + t) + lambda |t - m|^2`: unique for lambda > 0, solved by LDL'. `None` when A and lambda
    /// vanish.
    #[inline]
    pub(crate) fn minimise(&self, m: DVec3, lambda: f64) -> Option<DVec3> {
        // (A + lambda I) d = -(A m + b), t = m + d.
        let r = -(self.times(m) + self.b);
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let d0 = xx + lambda;
        if d0 <= 0.0 {
            return None;
        }
        let (l1, l2) = (xy / d0, xz / d0);
        let d1 = yy + lambda - l1 * xy;
        if d1 <= 0.0 {
            return None;
        }
        let s = yz - l1 * xz;
        let l3 = s / d1;
        let d2 = zz + lambda - l2 * xz - l3 * s;
        if d2 <= 0.0 {
            return None;
        }
        let y1 = r.y - l1 * r.x;
        let y2 = r.z - l2 * r.x - l3 * y1;
        let z = y2 / d2;
        let y = y1 / d1 - l3 * z;
        let x = r.x / d0 - l1 * y - l2 * z;
        Some(m + DVec3::new(x, y, z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner() -> Quadric {
        // Planes x = 0 (weight 2), y = 0, z = 0 about the origin.
        let mut q = Quadric::default();
        q.add_plane(DVec3::X, 2.0);
        q.add_plane(DVec3::Y, 1.0);
        q.add_plane(DVec3::Z, 1.0);
        q
    }

    #[test]
    fn a_quadric_is_the_sum_of_weighted_squared_distances() {
        assert_eq!(corner().at(DVec3::new(1.0, 2.0, 3.0)), 2.0 + 4.0 + 9.0);
    }

    #[test]
    fn moving_the_origin_changes_no_value() {
        let t = DVec3::new(0.3, -0.2, 7.0);
        let p = DVec3::new(-1.0, 0.5, 0.25);
        let q = corner();
        assert!((q.moved(t).at(p - t) - q.at(p)).abs() < 1e-12);
    }

    #[test]
    fn the_minimum_of_a_corner_is_the_corner() {
        let t = DVec3::new(5.0, -3.0, 2.0);
        let m = corner().moved(t).minimise(DVec3::ZERO, 1e-12).unwrap();
        assert!((m + t).length() < 1e-9, "{m}");
    }

    #[test]
    fn on_a_plane_the_minimum_stays_beside_the_given_point() {
        let mut q = Quadric::default();
        q.add_plane(DVec3::Z, 1.0);
        let m = q.minimise(DVec3::new(0.5, 0.25, 1.0), 1e-6).unwrap();
        assert!((m - DVec3::new(0.5, 0.25, 0.0)).length() < 1e-5, "{m}");
        assert_eq!(Quadric::default().minimise(DVec3::ZERO, 0.0), None);
    }

    proptest::proptest! {
        /// nalgebra solves the same system by Cholesky.
        #[test]
        fn the_minimum_is_that_of_a_dense_solver(
            planes in proptest::collection::vec((proptest::array::uniform3(-1.0f64..1.0), 0.1f64..10.0), 3..8),
            at in proptest::array::uniform3(-2.0f64..2.0),
            m in proptest::array::uniform3(-1.0f64..1.0),
            lambda in 1e-3f64..1.0,
        ) {
            let mut q = Quadric::default();
            for (n, k) in &planes {
                let n = DVec3::from_array(*n);
                if n.length() > 0.1 {
                    q.add_plane(n.normalize(), *k);
                }
            }
            let (q, m) = (q.moved(DVec3::from_array(at)), DVec3::from_array(m));
            let found = q.minimise(m, lambda).unwrap();
            let [xx, xy, xz, yy, yz, zz] = q.a;
            let a = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
                + nalgebra::Matrix3::identity() * lambda;
            let r = m * lambda - q.b;
            let x = a.cholesky().unwrap().solve(&nalgebra::Vector3::new(r.x, r.y, r.z));
            proptest::prop_assert!(found.distance(DVec3::new(x.x, x.y, x.z)) < 1e-9 * (1.0 + found.length()));
        }
    }
}
