//! The point of a triangle closest to a point, for any triangle: slivers, segments and points too.

use glam::DVec3;

/// Where on a triangle: the weights of the second and the third corner, and the squared distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foot {
    pub(super) d2: f64,
    pub(super) v: f64,
    pub(super) w: f64,
}

/// Twice the area of a triangle, squared, below this share of the squared lengths of two sides: its normal is mostly rounding, and the
/// sides alone have to do. Rounding makes up 1e-16 of those products.
const THIN: f64 = 1e-12;

/// The point of triangle `(a, b, c)` closest to `p`.
///
/// The weights are never negative and never sum to more than one (by more than rounding), so the point is one of the triangle and `d2` never
/// below the true squared distance by more than rounding. It is above by more than that only on slivers thinner than [`THIN`], by
/// no more than what their width makes.
#[inline]
pub(super) fn closest([a, b, c]: [DVec3; 3], p: DVec3) -> Foot {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (bb, bc, cc) = (ab.length_squared(), ab.dot(ac), ac.length_squared());
    let (pb, pc) = (ap.dot(ab), ap.dot(ac));
    let det = bb * cc - bc * bc;
    let (v, w) = (cc * pb - bc * pc, bb * pc - bc * pb);
    let thin = det <= THIN * bb * cc;
    if v > 0.0 && w > 0.0 && v + w < det && !thin {
        let per = 1.0 / det;
        let (v, w) = (v * per, w * per);
        return Foot { d2: (ap - ab * v - ac * w).length_squared(), v, w };
    }
    // The closest point lies on a side that `p` is beyond.
    let mut best = Foot { d2: f64::INFINITY, v: 0.0, w: 0.0 };
    if w <= 0.0 || thin {
        let v = share(pb, bb);
        keep(&mut best, Foot { d2: (ap - ab * v).length_squared(), v, w: 0.0 });
    }
    if v <= 0.0 || thin {
        let w = share(pc, cc);
        keep(&mut best, Foot { d2: (ap - ac * w).length_squared(), v: 0.0, w });
    }
    if v + w >= det || thin {
        let (side, bp) = (c - b, p - b);
        let w = share(bp.dot(side), side.length_squared());
        keep(&mut best, Foot { d2: (bp - side * w).length_squared(), v: 1.0 - w, w });
    }
    best
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
