//! The nearest of the triangles around a vertex.

use crate::simplify::measure::closest_on_triangle;
use glam::DVec3;

/// A triangle in a sphere, and what distances from it take.
pub(super) struct Reach {
    pub(super) corners: [DVec3; 3],
    pub(super) middle: DVec3,
    pub(super) radius: f64,
    /// From the first corner to the others, and from the second to the third; and one over their squared lengths, 0 for none.
    sides: [DVec3; 3],
    over: [f64; 3],
    /// What gives the weights of the second and the third corner of a place.
    weights: [DVec3; 2],
    /// Of unit length; `None` for a sliver, which takes more care.
    normal: Option<DVec3>,
}

/// Squared sine of the angle at the first corner below which a triangle is a sliver: weights of others are off by 1e-16 over it at most, of the size of the triangle.
const THIN: f64 = 1e-4;

impl Reach {
    pub(super) fn of(corners: [DVec3; 3]) -> Reach {
        let [a, b, c] = corners;
        let middle = (a + b + c) / 3.0;
        let radius = corners.iter().map(|c| c.distance_squared(middle)).fold(0.0, f64::max).sqrt();
        let sides = [b - a, c - a, c - b];
        let over = sides.map(|s| if s == DVec3::ZERO { 0.0 } else { s.length_squared().recip() });
        let (ab, ac) = (sides[0], sides[1]);
        let (bb, bc, cc) = (ab.length_squared(), ab.dot(ac), ac.length_squared());
        let det = bb * cc - bc * bc;
        let (weights, normal) = if det > THIN * bb * cc {
            ([(ab * cc - ac * bc) / det, (ac * bb - ab * bc) / det], Some(ab.cross(ac).normalize()))
        } else {
            ([DVec3::ZERO; 2], None)
        };
        Reach { corners, middle, radius: radius * (1.0 + 1e-9), sides, over, weights, normal }
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
        self.distance_squared(p).sqrt()
    }

    #[inline]
    fn distance_squared(&self, p: DVec3) -> f64 {
        let Some(normal) = self.normal else {
            let d2 = closest_on_triangle(self.corners, p).1;
            // No number where squares are beyond all numbers.
            return if d2.is_nan() { f64::INFINITY } else { d2.max(0.0) };
        };
        let off = p - self.corners[0];
        let (v, w) = (self.weights[0].dot(off), self.weights[1].dot(off));
        if v > 0.0 && w > 0.0 && v + w < 1.0 {
            let above = normal.dot(off);
            return above * above;
        }
        // Nearest to one of the sides that it is beyond.
        let side = |k: usize, off: DVec3| {
            let t = (self.sides[k].dot(off) * self.over[k]).clamp(0.0, 1.0);
            (off - self.sides[k] * t).length_squared()
        };
        let mut best = f64::INFINITY;
        if w <= 0.0 {
            best = side(0, off);
        }
        if v <= 0.0 {
            best = best.min(side(1, off));
        }
        if v + w >= 1.0 {
            best = best.min(side(2, p - self.corners[1]));
        }
        best
    }
}

/// Triangles whose distances are known at a time.
const MANY: usize = 16;

/// The distance from `p` to the nearest of the triangles, and which it is; 0 and `usize::MAX` if there is none. Infinite, and the first, where no number holds the squares.
pub(super) fn nearest(p: DVec3, triangles: &[Reach]) -> (f64, usize) {
    let (mut best, mut on, mut root) = (f64::INFINITY, usize::MAX, f64::INFINITY);
    for (part, some) in triangles.chunks(MANY).enumerate() {
        let mut off = [f64::INFINITY; MANY];
        let mut first = 0;
        for (k, t) in some.iter().enumerate() {
            off[k] = t.middle.distance_squared(p);
            if off[k] < off[first] {
                first = k;
            }
        }
        // The one whose middle is nearest first: it rules most others out.
        for k in std::iter::once(first).chain((0..some.len()).filter(|&k| k != first)) {
            let reach = some[k].radius + root;
            if off[k] > reach * reach {
                continue;
            }
            let d2 = some[k].distance_squared(p);
            if d2 < best {
                (best, on, root) = (d2, part * MANY + k, d2.sqrt());
            }
        }
    }
    match on {
        usize::MAX if triangles.is_empty() => (0.0, on),
        usize::MAX => (f64::INFINITY, 0),
        _ => (root, on),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0..1.0f64).prop_map(DVec3::from_array)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn distances_are_those_of_any_triangle(a in point(), b in point(), c in point(), p in point(), flat in 0..4u32) {
            // Whole ones, slivers, segments and points.
            let c = [c, a.lerp(b, 0.3) + c * 1e-3, a.lerp(b, 2.0), b][flat as usize];
            let b = if flat == 3 { c } else { b };
            let want = closest_on_triangle([a, b, c], p).1.sqrt();
            let t = Reach::of([a, b, c]);
            prop_assert!((t.distance(p) - want).abs() < 1e-12, "{} {want}", t.distance(p));
            prop_assert!(!t.is_beyond(p, want * (1.0 + 1e-9)));
            prop_assert!([a, b, c].iter().all(|&q| t.distance(q) < 1e-13));
        }

        #[test]
        fn the_nearest_is_found_among_many(all in prop::collection::vec([point(), point(), point()], 1..40), p in point()) {
            let triangles: Vec<Reach> = all.iter().map(|&t| Reach::of(t)).collect();
            let (d, on) = nearest(p, &triangles);
            let least = all.iter().map(|&t| closest_on_triangle(t, p).1.sqrt()).fold(f64::INFINITY, f64::min);
            prop_assert!((d - least).abs() < 1e-12 && triangles[on].distance(p) == d);
        }
    }

    #[test]
    fn nothing_is_nearest_of_none() {
        assert_eq!(nearest(DVec3::ONE, &[]), (0.0, usize::MAX));
        // Squares that no number holds.
        for flat in [0.0, 1e200] {
            let far = Reach::of([DVec3::ZERO, 1e200 * DVec3::X, flat * DVec3::Y]);
            assert_eq!(nearest(-1e200 * DVec3::ONE, &[far]), (f64::INFINITY, 0));
        }
    }
}
