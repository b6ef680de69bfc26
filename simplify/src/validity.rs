//! Whether a collapse leaves good faces: no flips, no slivers, no huge valences. Checked on popped candidates only.

use glam::DVec3;
use progmesh_aif::{FaceId, Topology, VertexId};

/// A face's normal may turn by at most acos(0.2) = 78 degrees in one collapse. Decided on bunny, horse, igea, fandisk, rangemap and
/// dragon, whose rms hardly depends on it between 0 and 0.5.
const MIN_TURN: f64 = 0.2;
/// Twice a face's area over its longest edge squared: a face may not fall below this. One that is below already may do as
/// it will: the dragon's zippered seams are full of them, and holding those back costs 15 % rms at 1 %.
const MIN_SHAPE: f64 = 1e-3;
/// Most edges at a vertex.
pub(crate) const MAX_VALENCE: usize = 32;
/// A vertex of more edges takes no part in a collapse: its ring has to shrink first. Otherwise all its edges would be tried at the cost
/// of its whole star each, quadratic work on the caps of a cylinder.
pub(crate) const HUB: usize = 512;

/// A triangle (apex, x, y) around a vertex that moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RingFace {
    pub(crate) apex: DVec3,
    pub(crate) x: DVec3,
    pub(crate) y: DVec3,
}

/// Appends the triangles around `v` that are not in `gone`. O(valence).
#[inline]
pub(crate) fn gather_ring(
    t: &Topology,
    points: &[DVec3],
    v: VertexId,
    gone: &[FaceId],
    ring: &mut Vec<RingFace>,
) {
    let apex = points[v.index()];
    for &e in t.star(v) {
        for &f in t.edge_faces(e) {
            let u = t.face_edges(f);
            let i = if u[0].edge() == e {
                0
            } else if u[1].edge() == e {
                1
            } else {
                2
            };
            // Each face once: at the edge by which it leaves v.
            if t.origin(u[i]) == v && !gone.contains(&f) {
                let x = points[t.target(u[i]).index()];
                let y = points[t.origin(u[if i == 0 { 2 } else { i - 1 }]).index()];
                ring.push(RingFace { apex, x, y });
            }
        }
    }
}

impl RingFace {
    /// Whether the face neither flips nor becomes a sliver when its apex goes to `to`.
    #[inline]
    pub(crate) fn stays_good(&self, to: DVec3) -> bool {
        let &RingFace { apex, x, y } = self;
        let side = y - x;
        let before = side.cross(apex - x);
        let after = side.cross(to - x);
        let (b, a) = (before.length_squared(), after.length_squared());
        let turn = before.dot(after);
        // cos < MIN_TURN, without roots: turn / sqrt(a b) < MIN_TURN.
        if b > 0.0 && (turn <= 0.0 || turn * turn < MIN_TURN * MIN_TURN * a * b) {
            return false;
        }
        let longest = side.length_squared().max((to - x).length_squared()).max((to - y).length_squared());
        if a >= MIN_SHAPE * MIN_SHAPE * longest * longest {
            return true;
        }
        let was = side.length_squared().max((apex - x).length_squared()).max((apex - y).length_squared());
        b < MIN_SHAPE * MIN_SHAPE * was * was
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const X: DVec3 = DVec3::new(0.0, 0.0, 0.0);
    const Y: DVec3 = DVec3::new(1.0, 0.0, 0.0);

    fn stays_good(apex: DVec3, to: DVec3, x: DVec3, y: DVec3) -> bool {
        RingFace { apex, x, y }.stays_good(to)
    }

    #[test]
    fn a_flip_is_refused_and_a_slide_is_not() {
        let apex = DVec3::new(0.5, 1.0, 0.0);
        assert!(stays_good(apex, DVec3::new(0.2, 0.5, 0.1), X, Y));
        assert!(!stays_good(apex, DVec3::new(0.5, -1.0, 0.0), X, Y));
        assert!(!stays_good(apex, DVec3::new(0.5, 0.0, 1.0), X, Y), "90 degrees");
    }

    #[test]
    fn a_sliver_is_refused_unless_it_was_one() {
        let apex = DVec3::new(0.5, 1.0, 0.0);
        assert!(!stays_good(apex, DVec3::new(0.5, 1e-4, 0.0), X, Y));
        assert!(stays_good(DVec3::new(0.5, 1e-4, 0.0), DVec3::new(0.5, 0.9e-4, 0.0), X, Y));
    }

    #[test]
    fn a_degenerate_face_may_become_anything_that_is_not_worse() {
        assert!(stays_good(DVec3::new(0.5, 0.0, 0.0), DVec3::new(0.5, 1.0, 0.0), X, Y));
    }
}
