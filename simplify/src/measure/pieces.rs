//! Pieces of triangles, and how far they can be from a surface at most.

use super::cover::Cover;
use super::query::{Best, Query, greatest};
use super::surface::Surface;
use super::triangle;
use glam::DVec3;

/// A triangular part of a triangle, in the frame of the other surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) corners: [DVec3; 3],
    /// From the points found nearest to the corners.
    pub(super) offset: [DVec3; 3],
    /// Their lengths: the distances of the corners, as found, not below the true ones.
    pub(super) d: [f64; 3],
    /// The triangles of the other surface that were found nearest to the corners.
    pub(super) near: [u32; 3],
    /// The triangle of the other surface that bounds the piece best, of those tried.
    pub(super) best: u32,
    /// No point of the piece is farther from the other surface.
    pub(super) bound: f64,
    /// The triangle that it is part of.
    pub(super) triangle: u32,
    /// How often it was cut.
    pub(super) depth: u8,
    /// How often in a row it was cut along a triangle's side rather than halved.
    pub(super) trimmed: u8,
}

/// So often a piece is cut along sides of triangles before it must be halved. Two finish what lies flat on a corner of the other surface; with
/// more, pieces of curved surfaces get thin before they get small.
const TRIMS: u8 = 2;
/// How far beyond the farthest corner a sheet that covers a piece is looked for.
const REACH: f64 = 1.25;
/// A cut that leaves less than this part of a side goes by the corner instead.
const LEAST_PART: f64 = 1e-6;

/// A corner of a piece: where it is, and what is nearest to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) at: DVec3,
    pub(super) offset: DVec3,
    pub(super) d: f64,
    pub(super) near: u32,
}

impl Corner {
    pub(super) fn new(at: DVec3, best: Best, b: &Surface) -> Self {
        let offset = at - b.point_on(best.triangle, best.foot.v, best.foot.w);
        Corner { at, offset, d: best.foot.d2.sqrt(), near: best.triangle }
    }
}

/// The least radius of discs about the corners that cover the triangle.
fn covering_radius([a, b, c]: [DVec3; 3]) -> f64 {
    let (bc, ca, ab) = (c - b, a - c, b - a);
    let (x, y, z) = (bc.length_squared(), ca.length_squared(), ab.length_squared());
    let longest = x.max(y).max(z);
    // Twice the legs' parts along the longest side; half their sum is that side's square.
    let sum = x + y + z;
    if 2.0 * longest < sum {
        // Acute: the circumradius. At most a third over half the longest side, whatever rounding makes of it.
        let area = ab.cross(bc).length();
        return (0.5 * (x * y * z).sqrt() / area).min((longest / 3.0).sqrt());
    }
    // Obtuse: where the bisectors of the short sides meet the longest.
    let reach = |short: f64, other: f64| short * longest.sqrt() / (longest + short - other);
    let (s, t) = if longest == x {
        (y, z)
    } else if longest == y {
        (z, x)
    } else {
        (x, y)
    };
    // NaN if all is one point.
    reach(s, t).max(reach(t, s)).max(0.0).min(longest.sqrt())
}

impl Piece {
    /// A whole triangle, not bounded yet.
    pub(super) fn whole(corners: [Corner; 3], triangle: u32) -> Self {
        Piece {
            corners: corners.map(|c| c.at),
            offset: corners.map(|c| c.offset),
            d: corners.map(|c| c.d),
            near: corners.map(|c| c.near),
            best: corners[0].near,
            bound: f64::INFINITY,
            triangle,
            depth: 0,
            trimmed: 0,
        }
    }

    /// Bounds the piece by the points found nearest to its corners. Every point `x` of it is within `r` of a corner `c`, whose nearest point is
    /// `c - o`; so `|x - c + o|^2 <= r^2 + 2 r |o'| + |o|^2`, with `o'` the part of `o` along the piece.
    pub(super) fn bound_by_points(&mut self) {
        let [a, b, c] = self.corners;
        let r = covering_radius(self.corners);
        let normal = (b - a).cross(c - a);
        let length = normal.length();
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        let along = |o: DVec3| {
            // The normal of a sliver is not to be relied upon.
            if length > 1e-2 * longest { o.cross(normal).length() / length } else { o.length() }
        };
        let square = |k: usize| self.d[k] * self.d[k] + 2.0 * r * along(self.offset[k]);
        self.bound = (square(0).max(square(1)).max(square(2)) + r * r).sqrt();
    }

    /// Lowers the bound to what triangles give. Single ones first, those found nearest to the corners: the distance from a triangle is convex,
    /// so it is greatest at a corner. Then, if the bound is still above `enough`, the sheet that covers the piece.
    pub(super) fn bound_by_triangles(&mut self, b: &Surface, cover: &mut Cover<'_>, enough: f64) {
        let [x, y, z] = self.near;
        if x == y && y == z {
            self.best = x;
            self.bound = self.bound.min(self.d[0].max(self.d[1]).max(self.d[2]));
            return;
        }
        let mut least = self.bound * self.bound;
        for t in [self.best, x, y, z] {
            self.try_triangle(b, t, &mut least);
        }
        self.bound = self.bound.min(least.sqrt());
        if self.bound <= enough {
            return;
        }
        let farthest = self.d[0].max(self.d[1]).max(self.d[2]);
        if let Some(bound) = cover.bound(self, REACH * farthest.max(enough), enough) {
            self.bound = self.bound.min(bound);
        }
    }

    fn try_triangle(&mut self, b: &Surface, t: u32, least: &mut f64) {
        let g = greatest(b.corners(t as usize), &self.corners, *least);
        if g < *least {
            (*least, self.best) = (g, t);
        }
    }

    /// Cuts the piece along the side of its best triangle that it reaches over most, so that a part lies within; or halves its longest side.
    /// Calls `add` for the parts, not bounded yet.
    pub(super) fn cut(&self, b: &Surface, query: &mut Query<'_>, mut add: impl FnMut(Piece)) {
        let own = |k: usize| Corner {
            at: self.corners[k],
            offset: self.offset[k],
            d: self.d[k],
            near: self.near[k],
        };
        if let Some((apex, x, y)) = self.trim(b) {
            // The corner `apex` is on one side, the others are on the other, or on the plane.
            let (i, j) = ((apex + 1) % 3, (apex + 2) % 3);
            let trimmed = self.trimmed + 1;
            if x >= 1.0 || y >= 1.0 {
                let (on, off, part) = if x >= 1.0 { (i, j, y) } else { (j, i, x) };
                let p = self.point_between(apex, off, part, query);
                add(self.part([own(apex), own(on), p], trimmed));
                add(self.part([own(off), own(on), p], trimmed));
                return;
            }
            let p = self.point_between(apex, i, x, query);
            let q = self.point_between(apex, j, y, query);
            add(self.part([own(apex), p, q], trimmed));
            add(self.part([p, own(i), own(j)], trimmed));
            add(self.part([p, own(j), q], trimmed));
            return;
        }
        let side = |k: usize| self.corners[(k + 1) % 3].distance_squared(self.corners[(k + 2) % 3]);
        let opposite = if side(0) >= side(1) && side(0) >= side(2) {
            0
        } else if side(1) >= side(2) {
            1
        } else {
            2
        };
        let (i, j) = ((opposite + 1) % 3, (opposite + 2) % 3);
        let middle = self.point_between(i, j, 0.5, query);
        add(self.part([own(opposite), own(i), middle], 0));
        add(self.part([own(opposite), middle, own(j)], 0));
    }

    /// A cut by the plane that stands on a side of the best triangle: the corner that it cuts off, and at what parts of the sides from there
    /// to the next corner and the one after; 1 where the plane goes by that corner, for one of them at most.
    fn trim(&self, b: &Surface) -> Option<(usize, f64, f64)> {
        if self.trimmed >= TRIMS {
            return None;
        }
        let t = b.corners(self.best as usize);
        let normal = (t[1] - t[0]).cross(t[2] - t[0]);
        let mut found = None;
        let mut most = 0.0;
        for k in 0..3 {
            let (from, side) = (t[k], t[(k + 1) % 3] - t[k]);
            let outward = side.cross(normal);
            let length = outward.length();
            if length == 0.0 {
                continue;
            }
            let over = self.corners.map(|c| (c - from).dot(outward) / length);
            let (lo, hi) = (over[0].min(over[1]).min(over[2]), over[0].max(over[1]).max(over[2]));
            if hi <= most || lo >= 0.0 {
                continue;
            }
            // The corner that is alone on its side.
            let out = over.map(|x| x > 0.0);
            let alone = out.iter().filter(|&&o| o).count() == 1;
            let Some(apex) = out.iter().position(|&o| o == alone) else { continue };
            let part = |k: usize| {
                let part = over[apex] / (over[apex] - over[k]);
                if part > 1.0 - LEAST_PART { 1.0 } else { part }
            };
            let (x, y) = (part((apex + 1) % 3), part((apex + 2) % 3));
            if x.min(y) >= LEAST_PART && x.min(y) < 1.0 {
                (most, found) = (hi, Some((apex, x, y)));
            }
        }
        found
    }

    fn point_between(&self, i: usize, j: usize, part: f64, query: &mut Query<'_>) -> Corner {
        let (p, q) = (self.corners[i], self.corners[j]);
        let at = if part == 0.5 { (p + q) * 0.5 } else { p + (q - p) * part };
        Corner::new(at, query.nearest_from(at, [self.near[i], self.near[j]]), query.surface())
    }

    fn part(&self, corners: [Corner; 3], trimmed: u8) -> Piece {
        Piece {
            corners: corners.map(|c| c.at),
            offset: corners.map(|c| c.offset),
            d: corners.map(|c| c.d),
            near: corners.map(|c| c.near),
            depth: self.depth.saturating_add(1),
            trimmed,
            ..*self
        }
    }

    /// Weights of the corners of the triangle that the piece is part of at `p`.
    pub(super) fn weights(whole: [DVec3; 3], p: DVec3) -> [f64; 2] {
        let foot = triangle::closest(whole, p);
        [foot.v, foot.w]
    }
}
