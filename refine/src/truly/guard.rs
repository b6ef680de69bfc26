//! Whether a step turns or flattens faces.

use super::mesh::{Gap, Mesh};
use super::pieces::Pieces;
use crate::hierarchy::Hierarchy;
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// The cosine of the largest turn of a face in one step, 78 degrees, and the least of twice a face's area over its longest edge squared: what recorded collapses are held to
/// (`progmesh_simplify`, which says on what they were decided), so that most pass among the faces they were recorded with.
const MIN_TURN: f64 = 0.2;
const MIN_SHAPE: f64 = 1e-3;

/// The triangle with its corner at `from`, opposite the side from `x` to `y`, neither turns nor becomes a sliver that it was not when that corner goes to `to`.
fn stays_good(from: DVec3, to: DVec3, x: DVec3, y: DVec3) -> bool {
    let side = y - x;
    let (before, after) = (side.cross(from - x), side.cross(to - x));
    let (b, a, turn) = (before.length_squared(), after.length_squared(), before.dot(after));
    if b > 0.0 && (turn <= 0.0 || turn * turn < MIN_TURN * MIN_TURN * a * b) {
        return false;
    }
    let sliver = |twice_squared: f64, p: DVec3| {
        let longest = side.length_squared().max((p - x).length_squared()).max((p - y).length_squared());
        twice_squared < MIN_SHAPE * MIN_SHAPE * longest * longest
    };
    !sliver(a, to) || sliver(b, from)
}

/// Split `i`, found at `gap`, turns and flattens no face, and its new faces turn their backs neither on those around nor on all that lies below. O(valence).
pub(super) fn split_is_good(mesh: &Mesh, h: &Hierarchy, i: u32, gap: &Gap) -> bool {
    let pm = h.mesh();
    let (vs, vu) = (pm.splits.vertex[i as usize], h.forest.base_vertices + i);
    let [old, new] = h.forest.nodes(i);
    let from = mesh.position(h, vs);
    let (t, u) = (h.forest.position(pm, old, vs), h.forest.position(pm, new, vu));
    let at = |v: u32| mesh.position(h, v);
    let mut sum = DVec3::ZERO;
    for (k, &e) in gap.ring.iter().enumerate() {
        let (x, y) = (at(mesh.far(e)), at(mesh.far(e.turn())));
        let to = if gap.is_inner(k) { u } else { t };
        if to != from && !stays_good(from, to, x, y) {
            return false;
        }
        sum += (x - from).cross(y - from);
    }
    // In the sense of the ring: the face at the edge where what goes to the new vertex begins, and the one where it ends.
    let [begin, end] = if gap.forward { gap.tips } else { [gap.tips[1], gap.tips[0]] };
    let mut cone = None;
    let mut faces_out = |normal: DVec3| {
        if normal.dot(sum) > 0.0 {
            return true;
        }
        let cone = *cone.get_or_insert_with(|| h.bounds(i as usize).cone);
        cone.half_angle() < FRAC_PI_2 && normal.dot(cone.axis()) > 0.0 && sum.dot(cone.axis()) > 0.0
    };
    let there = |v: u32| v != crate::aif::NONE;
    (!there(begin) || faces_out((at(begin) - t).cross(u - t)))
        && (!there(end) || faces_out((u - t).cross(at(end) - t)))
}

/// Undoing split `i`, which is applied, turns and flattens no face. O(valence).
pub(super) fn collapse_is_good(mesh: &Mesh, h: &Hierarchy, pieces: &Pieces, i: u32) -> bool {
    let pm = h.mesh();
    let (vs, vu) = (pm.splits.vertex[i as usize], h.forest.base_vertices + i);
    let to = h.forest.position(pm, pieces.parent(h, i), vs);
    let (t, u) = (mesh.position(h, vs), mesh.position(h, vu));
    let mut good = true;
    mesh.around(h, i, |e, inner| {
        let from = if inner { u } else { t };
        if good && from != to {
            let [x, y] = [mesh.far(e), mesh.far(e.turn())].map(|v| mesh.position(h, v));
            good = stays_good(from, to, x, y);
        }
    });
    good
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_turns_or_flattens_is_told_from_what_slides() {
        let (x, y) = (DVec3::ZERO, DVec3::X);
        let p = DVec3::new(0.5, 1.0, 0.0);
        assert!(stays_good(p, DVec3::new(0.2, 0.5, 0.1), x, y));
        assert!(!stays_good(p, DVec3::new(0.5, -1.0, 0.0), x, y), "turned over");
        assert!(!stays_good(p, DVec3::new(0.5, 0.0, 1.0), x, y), "by 90 degrees");
        assert!(!stays_good(p, DVec3::new(0.5, 1e-4, 0.0), x, y), "flattened");
        assert!(stays_good(DVec3::new(0.5, 1e-4, 0.0), DVec3::new(0.5, 0.9e-4, 0.0), x, y), "flat before");
        assert!(stays_good(DVec3::new(0.5, 0.0, 0.0), p, x, y), "no normal before");
    }
}
