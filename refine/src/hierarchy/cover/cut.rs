//! How pieces are cut where they lie over several faces of a ring.

use super::super::nearest::{Reach, nearest};
use super::{CORNERS, Corner, ENOUGH, Pile, Ring, Walk};
use glam::DVec3;

/// Steps by which a place is looked for where another face becomes the nearest.
const HALVES: u32 = 12;
/// Corners that a piece to be cut may have at most.
const MOST: usize = CORNERS + 2;

/// Between two faces of a ring.
pub(super) struct Between {
    /// The way from the vertex to the other end of their edge.
    edge: DVec3,
    /// Of the plane through it that lies between their normals.
    normal: DVec3,
}

impl Between {
    /// On which side corners are; 0 is on the plane, but for rounding.
    fn sides(&self, piece: &[Corner], own: DVec3) -> [f64; MOST] {
        let mut sides = [0.0; MOST];
        let mut far = 0.0f64;
        for (side, c) in sides.iter_mut().zip(piece) {
            *side = (c.p - own).dot(self.normal);
            far = far.max(side.abs());
        }
        for side in sides.iter_mut().take(piece.len()).filter(|s| s.abs() <= 1e-9 * far) {
            *side = 0.0;
        }
        sides
    }
}

impl Walk<'_> {
    /// Cuts a piece between two faces of the ring; false if it lies beside all their edges.
    pub(super) fn cut(&self, face: u32, piece: &[Corner], ring: &Ring<'_>, pile: &mut Pile) -> bool {
        let n = piece.len();
        let mut best: Option<(f64, &Between)> = None;
        for between in ring.between {
            let sides = between.sides(piece, ring.own);
            let far = sides[..n].iter().fold((0.0f64, 0.0f64), |(lo, hi), &s| (lo.min(s), hi.max(s)));
            // What reaches beyond it is too little to matter.
            if far.1.min(-far.0) <= ring.little() {
                continue;
            }
            // How far along the edge, from the vertex on, the plane goes through the piece.
            let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
            for k in 0..n {
                let (x, y) = (sides[k], sides[(k + 1) % n]);
                if x == 0.0 || x * y < 0.0 {
                    let p = piece[k].p.lerp(piece[(k + 1) % n].p, if x == 0.0 { 0.0 } else { x / (x - y) });
                    let along = (p - ring.own).dot(between.edge);
                    (from, to) = (from.min(along), to.max(along));
                }
            }
            if to > 0.0 && best.is_none_or(|(most, _)| from > most) {
                best = Some((from, between));
            }
        }
        let Some((_, between)) = best else { return false };
        let sides = between.sides(piece, ring.own);
        let mut halves = [pile.fresh(), pile.fresh()];
        for k in 0..n {
            let (x, y) = (sides[k], sides[(k + 1) % n]);
            // What is on the plane is of both.
            if x >= 0.0 {
                halves[0].push(piece[k]);
            }
            if x <= 0.0 {
                halves[1].push(piece[k]);
            }
            if x * y < 0.0 {
                let t = x / (x - y);
                let at = piece[k].towards(&piece[(k + 1) % n], t);
                let p = self.finest.at(face, at);
                let (d, on) = nearest(p, ring.triangles);
                halves.iter_mut().for_each(|h| h.push(Corner { at, p, d, on }));
            }
        }
        pile.stack.extend(halves);
        true
    }

    /// Cuts off the longest run of corners to which one face is nearest, where another becomes so: for rings that are folded. False if one is nearest to all.
    pub(super) fn part(&self, face: u32, piece: &[Corner], ring: &Ring<'_>, pile: &mut Pile) -> bool {
        let n = piece.len();
        let run = |k: usize| (0..n).take_while(|j| piece[(k + j) % n].on == piece[k].on).count();
        let starts = (0..n).filter(|&k| piece[(k + n - 1) % n].on != piece[k].on);
        let Some(from) = starts.max_by_key(|&k| (run(k), n - k)) else { return false };
        let (len, of) = (run(from), |k: usize| piece[(from + k) % n]);
        // By halves: the last place to which the face of `a` is nearest, and the face that is beyond.
        let end = |a: Corner, b: Corner| {
            let (mut last, mut beyond, mut lo, mut hi) = (a, b.on, 0.0, 1.0);
            for _ in 0..HALVES {
                let t = 0.5 * (lo + hi);
                let at = a.towards(&b, t);
                let p = self.finest.at(face, at);
                let (d, on) = nearest(p, ring.triangles);
                if on == a.on {
                    (last, lo) = (Corner { at, p, d, on }, t);
                } else {
                    (beyond, hi) = (on, t);
                }
            }
            let d = ring.triangles[beyond].distance(last.p);
            (last, Corner { on: beyond, d, ..last })
        };
        let (first, last) = (end(of(0), of(n - 1)), end(of(len - 1), of(len)));
        let (mut own, mut rest) = (pile.fresh(), pile.fresh());
        own.push(first.0);
        own.extend((0..len).map(of));
        own.push(last.0);
        rest.push(last.1);
        rest.extend((len..n).map(of));
        rest.push(first.1);
        pile.stack.extend([rest, own]);
        true
    }
}

/// Of the faces that are nearest to corners of a piece, or of `all`, the one from which the farthest corner is least far, and how far that is; or the first that is found as good as any could be.
pub(super) fn best(piece: &[Corner], triangles: &[Reach], all: bool) -> (f64, usize) {
    let least = piece.iter().map(|c| c.d).fold(0.0, f64::max);
    let mut out = (f64::INFINITY, 0);
    let mut attempt = |on: usize| {
        let mut most = 0.0f64;
        for c in piece {
            // That is known.
            let d = if c.on == on {
                c.d
            } else if triangles[on].is_beyond(c.p, out.0) {
                return false;
            } else {
                triangles[on].distance(c.p)
            };
            most = most.max(d);
            if most >= out.0 {
                return false;
            }
        }
        out = (most, on);
        most <= least * ENOUGH
    };
    // Those that are nearest to a corner first: they rule most others out.
    let near = |k: usize| piece[..k].iter().all(|c| c.on != piece[k].on);
    if !(0..piece.len()).any(|k| near(k) && attempt(piece[k].on)) && all {
        (0..triangles.len()).any(attempt);
    }
    out
}

/// The planes between the faces around a vertex.
pub(super) fn between(own: u32, fan: &[[u32; 3]], triangles: &[Reach], out: &mut Vec<Between>) {
    out.clear();
    let normal = |t: &Reach| t.normal().normalize_or_zero();
    let corner = |f: &[u32; 3]| f.iter().position(|&v| v == own);
    for (f, t) in fan.iter().zip(triangles) {
        let Some(k) = corner(f) else { continue };
        let before = f[(k + 2) % 3];
        let other = fan.iter().position(|g| corner(g).is_some_and(|j| g[(j + 1) % 3] == before));
        let Some(other) = other else { continue };
        let edge = t.corners[(k + 2) % 3] - t.corners[k];
        let normal = edge.cross(normal(t) + normal(&triangles[other])).normalize_or_zero();
        if normal != DVec3::ZERO {
            out.push(Between { edge, normal });
        }
    }
}
