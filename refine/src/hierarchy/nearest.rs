//! The nearest of the triangles around a vertex.

use crate::simplify::measure::closest_on_triangle;
use glam::DVec3;

/// A triangle in a sphere.
pub(super) struct Reach {
    pub(super) corners: [DVec3; 3],
    pub(super) middle: DVec3,
    pub(super) radius: f64,
}

impl Reach {
    pub(super) fn of(corners: [DVec3; 3]) -> Reach {
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius = corners.iter().map(|c| c.distance_squared(middle)).fold(0.0, f64::max).sqrt();
        Reach { corners, middle, radius: radius * (1.0 + 1e-9) }
    }

    /// Its normal, twice its area long.
    #[inline]
    pub(super) fn normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    /// A point is certainly farther from it.
    #[inline]
    pub(super) fn is_beyond(&self, p: DVec3, distance: f64) -> bool {
        let reach = self.radius + distance;
        self.middle.distance_squared(p) > reach * reach
    }

    /// How far a point is from it; never less than it is, but for rounding.
    #[inline]
    pub(super) fn distance(&self, p: DVec3) -> f64 {
        closest_on_triangle(self.corners, p).1.max(0.0).sqrt()
    }
}

/// The distance from `p` to the nearest of the triangles, and which it is; 0 and `usize::MAX` if there is none.
pub(super) fn nearest(p: DVec3, triangles: &[Reach]) -> (f64, usize) {
    let off = |t: &Reach| t.middle.distance_squared(p);
    // The one whose middle is nearest first: it rules most others out.
    let first = (0..triangles.len()).min_by(|&a, &b| off(&triangles[a]).total_cmp(&off(&triangles[b])));
    let Some(first) = first else { return (0.0, usize::MAX) };
    let mut best = closest_on_triangle(triangles[first].corners, p).1;
    let (mut on, mut root) = (first, best.sqrt());
    for (k, t) in triangles.iter().enumerate() {
        let reach = t.radius + root;
        if k == first || off(t) > reach * reach {
            continue;
        }
        let d2 = closest_on_triangle(t.corners, p).1;
        if d2 < best {
            (best, on, root) = (d2, k, d2.sqrt());
        }
    }
    (root, on)
}
