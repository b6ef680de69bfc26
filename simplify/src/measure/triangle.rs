//! The point of a triangle closest to a point, for any triangle: slivers, segments and points too.

use glam::DVec3;

/// Where on a triangle: the weights of the second and the third corner, and the squared distance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foot {
    pub(crate) d2: f64,
    pub(crate) v: f64,
    pub(crate) w: f64,
}

/// Squared sine of a corner's angle below which a triangle goes the careful way: the quick way squares the condition, and is off by 1e-16
/// over this, times the size of the triangle.
const THIN: f64 = 1e-4;

/// The point of triangle `(a, b, c)` closest to `p`.
///
/// The weights are never negative and never sum to more than one (by more than rounding), so the point is one of the triangle and `d2` never
/// below the true squared distance by more than rounding.
#[inline]
pub(crate) fn closest(t: [DVec3; 3], p: DVec3) -> Foot {
    let [a, b, c] = t;
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (bb, bc, cc) = (ab.length_squared(), ab.dot(ac), ac.length_squared());
    let (pb, pc) = (ap.dot(ab), ap.dot(ac));
    let det = bb * cc - bc * bc;
    if det <= THIN * bb * cc {
        return closest_thin(t, p);
    }
    let (v, w) = (cc * pb - bc * pc, bb * pc - bc * pb);
    if v > 0.0 && w > 0.0 && v + w < det {
        let per = 1.0 / det;
        let (v, w) = (v * per, w * per);
        return Foot { d2: (ap - ab * v - ac * w).length_squared(), v, w };
    }
    // The closest point lies on a side that `p` is beyond.
    let mut best = Foot { d2: f64::INFINITY, v: 0.0, w: 0.0 };
    if w <= 0.0 {
        keep(&mut best, on_ab(ab, ap));
    }
    if v <= 0.0 {
        keep(&mut best, on_ac(ac, ap));
    }
    if v + w >= det {
        keep(&mut best, on_bc(c - b, p - b));
    }
    best
}

/// The point of triangle `t` closest to `p`, as the weights of its three corners, and its squared distance. Slivers, segments and points are
/// triangles too.
///
/// The squared distance is never below the true one by more than rounding. O(1).
#[inline]
pub fn closest_on_triangle(t: [DVec3; 3], p: DVec3) -> ([f64; 3], f64) {
    let foot = closest(t, p);
    ([1.0 - foot.v - foot.w, foot.v, foot.w], foot.d2)
}

/// The same for slivers, segments and points: all sides, and the inside by orthogonalisation on the longest side, which is off by the
/// condition, not its square.
#[cold]
fn closest_thin([a, b, c]: [DVec3; 3], p: DVec3) -> Foot {
    let mut best = on_ab(b - a, p - a);
    keep(&mut best, on_ac(c - a, p - a));
    keep(&mut best, on_bc(c - b, p - b));
    let (ab, bc, ca) = (a.distance_squared(b), b.distance_squared(c), c.distance_squared(a));
    // Corners in turn, so that the longest side runs from the first to the second.
    let (turn, [from, to, apex]) = if ab >= bc && ab >= ca {
        (0, [a, b, c])
    } else if bc >= ca {
        (1, [b, c, a])
    } else {
        (2, [c, a, b])
    };
    let (side, up, fp) = (to - from, apex - from, p - from);
    let long = side.length_squared();
    let lean = up.dot(side) / long;
    let height = up - side * lean;
    // Once more: what rounding left along the side.
    let height = height - side * (height.dot(side) / long);
    let y = fp.dot(height) / height.length_squared();
    let x = fp.dot(side) / long - y * lean;
    // False for NaN too: a segment or point.
    if x > 0.0 && y > 0.0 && x + y < 1.0 {
        let weights = [1.0 - x - y, x, y];
        let at = |corner: usize| weights[(corner + 3 - turn) % 3];
        keep(&mut best, Foot { d2: (fp - side * x - up * y).length_squared(), v: at(1), w: at(2) });
    }
    best
}

/// A bound below the distance of `p` from a triangle, given the offset of `p` from (about) its closest point: the triangle lies
/// beyond the plane through its nearest corner in that direction. Right whatever the offset is, and tight when that is right.
#[inline]
pub(crate) fn at_least(t: [DVec3; 3], p: DVec3, offset: DVec3) -> f64 {
    let length = offset.length();
    if length == 0.0 {
        return 0.0;
    }
    let n = offset / length;
    t.iter().map(|&c| n.dot(p - c)).fold(f64::INFINITY, f64::min).max(0.0)
}

#[inline]
fn on_ab(ab: DVec3, ap: DVec3) -> Foot {
    let v = share(ap.dot(ab), ab.length_squared());
    Foot { d2: (ap - ab * v).length_squared(), v, w: 0.0 }
}

#[inline]
fn on_ac(ac: DVec3, ap: DVec3) -> Foot {
    let w = share(ap.dot(ac), ac.length_squared());
    Foot { d2: (ap - ac * w).length_squared(), v: 0.0, w }
}

#[inline]
fn on_bc(bc: DVec3, bp: DVec3) -> Foot {
    let w = share(bp.dot(bc), bc.length_squared());
    Foot { d2: (bp - bc * w).length_squared(), v: 1.0 - w, w }
}

#[inline]
fn keep(best: &mut Foot, f: Foot) {
    if f.d2 < best.d2 {
        *best = f;
    }
}

/// How far along a side the foot is, 0..=1; 0 on a side without length.
#[inline]
fn share(dot: f64, length_squared: f64) -> f64 {
    if dot <= 0.0 {
        0.0
    } else if dot >= length_squared {
        1.0
    } else {
        dot / length_squared
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The point of the triangle nearest to `p`, by halving the triangle again and again.
    fn searched([a, b, c]: [DVec3; 3], p: DVec3) -> f64 {
        // Convex along every line: two nested ternary searches.
        let least = |f: &dyn Fn(f64) -> f64| {
            let (mut lo, mut hi) = (0.0, 1.0);
            for _ in 0..100 {
                let (x, y) = (lo + (hi - lo) / 3.0, hi - (hi - lo) / 3.0);
                if f(x) <= f(y) { hi = y } else { lo = x }
            }
            f(lo).min(f(hi)).min(f(0.0)).min(f(1.0))
        };
        least(&|s| {
            let (x, y) = (a + (b - a) * s, a + (c - a) * s);
            least(&|t| (x + (y - x) * t).distance(p))
        })
    }

    #[test]
    fn slivers_are_as_exact_as_others() {
        let p = DVec3::new(0.3, 0.1, 1e-7);
        for width in [1.0, 1e-1, 1e-3, 1e-6, 1e-9, 1e-13, 0.0] {
            // A needle from each corner, a cap, and a point above, beside and beyond.
            let (a, b, c) = (DVec3::ZERO, DVec3::new(1.0, 0.5, 0.0), DVec3::new(1.0, 0.5 + width, 0.0));
            let cap = DVec3::new(0.4, 0.2 + width, 0.0);
            for t in [[a, b, c], [c, a, b], [b, c, a], [b, a, c], [a, cap, b], [cap, b, a], [b, a, cap]] {
                for q in [p, a + (b + c - a * 2.0) * 0.2 + DVec3::Z * 1e-9, b * 2.0, -c, cap] {
                    let f = closest(t, q);
                    let want = searched(t, q);
                    assert!((f.d2.sqrt() - want).abs() < 1e-9, "{width} {t:?} {q}: {} {want}", f.d2.sqrt());
                    assert!(f.v >= 0.0 && f.w >= 0.0 && f.v + f.w <= 1.0 + 1e-15);
                    let on = t[0] + (t[1] - t[0]) * f.v + (t[2] - t[0]) * f.w;
                    assert!((on.distance(q) - f.d2.sqrt()).abs() < 1e-14, "{width} {t:?} {q}");
                }
            }
        }
    }

    #[test]
    fn a_point_on_a_sliver_is_at_distance_zero() {
        // 1e-5 high, 1 long: the sides alone would be off by a third of that.
        let t = [DVec3::ZERO, DVec3::X, DVec3::new(0.3, 1e-5, 0.0)];
        for turn in 0..3 {
            let t = std::array::from_fn(|k| t[(k + turn) % 3]);
            let f = closest(t, DVec3::new(0.4, 3e-6, 0.0));
            assert!(f.d2.sqrt() < 1e-15, "{}", f.d2.sqrt());
        }
    }
}
