//! Whether a step turns faces away from where they look at full detail, or flattens them.

use super::mesh::{Gap, Mesh};
use super::pieces::Pieces;
use crate::hierarchy::Hierarchy;
use crate::progressive::Half;
use glam::DVec3;

/// The least of twice a face's area over its longest edge squared: what recorded collapses are held to (`progmesh_simplify`, which says on what it was decided).
const MIN_SHAPE: f64 = 1e-3;

/// A face around a vertex that moves.
struct Moving {
    /// Its other corners.
    x: DVec3,
    y: DVec3,
    /// Where it looks at full detail, seen from `x` to `y`; 0 tells nothing.
    reference: DVec3,
}

impl Moving {
    fn of(mesh: &Mesh, h: &Hierarchy, pieces: &Pieces, e: Half) -> Moving {
        let [x, y] = [mesh.far(e), mesh.far(e.turn())].map(|v| mesh.position(h, v));
        let own = pieces.looks(mesh.face_in()[e.face() as usize]);
        Moving { x, y, reference: if e.starts() { own } else { -own } }
    }

    /// It neither turns away nor becomes a sliver when its corner goes from one place to the other, or did before.
    fn stays_good(&self, from: DVec3, to: DVec3) -> bool {
        let &Moving { x, y, reference } = self;
        let twice = |p: DVec3| (x - p).cross(y - p);
        let (before, after) = (twice(from), twice(to));
        let sliver = |twice: DVec3, p: DVec3| {
            let longest = x.distance_squared(y).max(p.distance_squared(x)).max(p.distance_squared(y));
            twice.length_squared() < MIN_SHAPE * MIN_SHAPE * longest * longest
        };
        (looks(after, reference) || !looks(before, reference)) && (!sliver(after, to) || sliver(before, from))
    }
}

fn looks(normal: DVec3, reference: DVec3) -> bool {
    reference == DVec3::ZERO || normal.dot(reference) > 0.0
}

/// Split `i`, found at `gap`, turns no face away and flattens none. O(valence).
pub(super) fn split_is_good(mesh: &Mesh, h: &Hierarchy, pieces: &Pieces, i: u32, gap: &Gap) -> bool {
    let pm = h.mesh();
    let (vs, vu) = (pm.splits.vertex[i as usize], h.forest.base_vertices + i);
    let [old, new] = h.forest.nodes(i);
    let from = mesh.position(h, vs);
    let (t, u) = (h.forest.position(pm, old, vs), h.forest.position(pm, new, vu));
    let around = gap.ring.iter().enumerate().all(|(k, &e)| {
        let to = if gap.is_inner(k) { u } else { t };
        to == from || Moving::of(mesh, h, pieces, e).stays_good(from, to)
    });
    let code = pm.splits.code[i as usize];
    let face = h.forest.first_face(i);
    let made = |k: usize, (_, vu_next): (usize, bool)| {
        let tip = mesh.position(h, gap.tips[k]);
        let normal = (t - tip).cross(u - tip);
        looks(if vu_next { -normal } else { normal }, pieces.looks(face + k as u32))
    };
    around && made(0, code.left()) && (!code.two_faces() || made(1, code.right()))
}

/// Face `f`, which is in the mesh, turns away from where it looks at full detail.
pub(super) fn looks_away(mesh: &Mesh, h: &Hierarchy, pieces: &Pieces, f: u32) -> bool {
    let [a, b, c] = mesh.corners_of(f).map(|v| mesh.position(h, v));
    !looks((b - a).cross(c - a), pieces.looks(f))
}

/// Undoing split `i`, which is applied, turns no face away and flattens none. O(valence).
pub(super) fn collapse_is_good(mesh: &Mesh, h: &Hierarchy, pieces: &Pieces, i: u32) -> bool {
    let pm = h.mesh();
    let (vs, vu) = (pm.splits.vertex[i as usize], h.forest.base_vertices + i);
    let to = h.forest.position(pm, pieces.parent(h, i), vs);
    let (t, u) = (mesh.position(h, vs), mesh.position(h, vu));
    let mut good = true;
    mesh.around(h, i, |e, inner| {
        let from = if inner { u } else { t };
        good = good && (from == to || Moving::of(mesh, h, pieces, e).stays_good(from, to));
    });
    good
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_turns_away_or_flattens_is_told_from_what_slides_or_comes_back() {
        let p = DVec3::new(0.5, 1.0, 0.0);
        let face = |reference| Moving { x: DVec3::ZERO, y: DVec3::X, reference };
        let (out, back) = (face(DVec3::Z), face(-DVec3::Z));
        assert!(out.stays_good(p, DVec3::new(0.2, 0.5, 0.1)));
        assert!(!out.stays_good(p, DVec3::new(0.5, -1.0, 0.0)), "turned over");
        assert!(back.stays_good(p, DVec3::new(0.5, -1.0, 0.0)), "turned back");
        assert!(back.stays_good(p, DVec3::new(0.5, 2.0, 0.0)), "looks away as before");
        assert!(!out.stays_good(p, DVec3::new(0.5, 1e-4, 0.0)), "flattened");
        assert!(out.stays_good(DVec3::new(0.5, 1e-4, 0.0), DVec3::new(0.5, 0.9e-4, 0.0)), "flat before");
        assert!(face(DVec3::ZERO).stays_good(p, DVec3::new(0.5, -1.0, 0.0)), "nothing is known");
    }
}
