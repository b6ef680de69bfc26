//! The closest point of a surface, found through its hierarchy.

use super::bvh::{Node, down, up};
use super::surface::Surface;
use super::triangle::{self, Foot};
use glam::{BVec4A, DVec3, Vec4};

/// The point of a surface closest to a given one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ClosestPoint {
    /// The triangle it lies on, by its index in the input; where several are equally near, one of them.
    pub triangle: u32,
    /// Weights of the triangle's corners; none negative, their sum 1.
    pub bary: [f64; 3],
    /// The point.
    pub point: DVec3,
    /// How far it is.
    pub distance: f64,
}

/// What a search has found: a triangle of the hierarchy and the foot on it, in local units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Best {
    pub(super) triangle: u32,
    pub(super) foot: Foot,
}

/// Asks a surface for its closest points, one after the other.
///
/// A query starts from the triangle that the last one found: points in an order in which neighbours follow each other are several times
/// faster than points in random order. Answers do not depend on the order but for the choice among triangles that are equally near (to
/// rounding).
#[derive(Clone, Debug)]
pub struct Query<'a> {
    surface: &'a Surface,
    last: u32,
}

/// Beyond this many radii of the surface, f32 no longer tells its boxes apart.
const FAR: f64 = 16.0;
/// Room for the nodes that wait: at most 3 on each of 16 levels, and 4.
const STACK: usize = 64;

impl Surface {
    /// A cursor for closest-point queries.
    pub fn query(&self) -> Query<'_> {
        Query { surface: self, last: 0 }
    }
}

impl<'a> Query<'a> {
    /// The point of the surface closest to `p`. O(log n) for points near the surface; NaN for a `p` that is not finite.
    pub fn closest(&mut self, p: DVec3) -> ClosestPoint {
        let best = self.nearest(self.surface.frame.local(p));
        self.surface.closest_point(best)
    }

    /// The distance of `p` from the surface, as [`Query::closest`] has it.
    pub fn distance(&mut self, p: DVec3) -> f64 {
        self.nearest(self.surface.frame.local(p)).foot.d2.sqrt() / self.surface.frame.scale
    }

    pub(super) fn surface(&self) -> &'a Surface {
        self.surface
    }

    /// The closest point to a local one, starting from the nearer of two triangles of the hierarchy.
    #[inline]
    pub(super) fn nearest_from(&mut self, p: DVec3, [t, u]: [u32; 2]) -> Best {
        let foot = |t: u32| triangle::closest(self.surface.corners(t as usize), p);
        let mut best = Best { triangle: t, foot: foot(t) };
        if u != t {
            let other = foot(u);
            if other.d2 < best.foot.d2 {
                best = Best { triangle: u, foot: other };
            }
        }
        self.surface.search(p, &mut best);
        best
    }

    /// The closest point to a local one.
    #[inline]
    pub(super) fn nearest(&mut self, p: DVec3) -> Best {
        let s = self.surface;
        if !p.is_finite() {
            return Best { triangle: self.last, foot: Foot { d2: f64::NAN, v: 0.0, w: 0.0 } };
        }
        let mut best =
            Best { triangle: self.last, foot: triangle::closest(s.corners(self.last as usize), p) };
        s.search(p, &mut best);
        self.last = best.triangle;
        best
    }
}

/// A node that waits: a lower bound of the squared distance, its level, its index.
#[derive(Clone, Copy, Default)]
struct Waiting {
    d2: f32,
    level: u32,
    node: u32,
}

/// A bound for f32 lower bounds of the squared distance: one that is greater cannot lead to less than `d2`.
///
/// Lower bounds come from boxes and points that are rounded outwards, so only the arithmetic counts: 7 roundings of 2^-24 each, and the 2
/// bits that carry the lane: 2^-20 covers them.
#[inline]
fn ceiling(d2: f64) -> f32 {
    // Finite, so that children that are missing, at infinity, never are within it.
    ((d2 * (1.0 + 1e-6)) as f32 * (1.0 + f32::EPSILON) + f32::MIN_POSITIVE).min(f32::MAX)
}

impl Surface {
    pub(super) fn closest_point(&self, best: Best) -> ClosestPoint {
        let Foot { d2, v, w } = best.foot;
        let [a, b, c] = self.corners(best.triangle as usize);
        ClosestPoint {
            triangle: self.ids[best.triangle as usize],
            bary: [(1.0 - v - w).max(0.0), v, w],
            point: self.frame.world(a + (b - a) * v + (c - a) * w),
            distance: d2.sqrt() / self.frame.scale,
        }
    }

    /// Lowers `best` to the nearest triangle. Boxes are tested in f32, conservatively; triangles in f64.
    fn search(&self, p: DVec3, best: &mut Best) {
        let d2 = best.foot.d2;
        let visit = |t: u32| {
            let foot = triangle::closest(self.corners(t as usize), p);
            if foot.d2 < best.foot.d2 {
                *best = Best { triangle: t, foot };
            }
            best.foot.d2
        };
        if near(p) {
            let around = Around::new(p);
            self.descend(d2, |n| around.squared(n), visit);
        } else {
            self.descend_far(p, d2, visit);
        }
    }

    /// A proven bound below the distance of `p`, given the distance found; local. As good as the distance, but for rounding.
    pub(super) fn at_least(&self, p: DVec3, found: f64) -> f64 {
        let mut least = found;
        let limit = found * found;
        let visit = |t: u32| {
            let corners = self.corners(t as usize);
            let Foot { v, w, .. } = triangle::closest(corners, p);
            let on = corners[0] + (corners[1] - corners[0]) * v + (corners[2] - corners[0]) * w;
            least = least.min(triangle::at_least(corners, p, p - on));
            limit
        };
        if near(p) {
            let around = Around::new(p);
            self.descend(limit, |n| around.squared(n), visit);
        } else {
            self.descend_far(p, limit, visit);
        }
        least
    }

    /// Visits the triangles below all nodes whose `squared` distances (of the children) are within the limit, near ones first; `visit` returns
    /// the new limit.
    #[inline]
    fn descend(&self, d2: f64, squared: impl Fn(&Node) -> Vec4, mut visit: impl FnMut(u32) -> f64) {
        let bvh = &self.bvh;
        let mut limit = ceiling(d2);
        let mut stack = [Waiting::default(); STACK];
        let mut waiting = 0;
        let mut level = bvh.base.len() - 1;
        let mut node = bvh.base[level];
        loop {
            let d2 = squared(&bvh.nodes[node as usize]);
            let first = 4 * (node - bvh.base[level]);
            let within = d2.cmple(Vec4::splat(limit));
            let mask = within.bitmask();
            if mask & mask.wrapping_sub(1) == 0 && mask != 0 {
                // A single child, as in most cases.
                let child = first + mask.trailing_zeros();
                if level > 0 {
                    level -= 1;
                    node = bvh.base[level] + child;
                    continue;
                }
                limit = ceiling(visit(child));
            } else if mask == 0 {
                // Nothing here.
            } else if level == 0 {
                let keys = keys(d2, within);
                for key in keys {
                    if key == NOT || f32::from_bits(key & !3) > limit {
                        break;
                    }
                    limit = ceiling(visit(first + (key & 3)));
                }
            } else {
                let keys = keys(d2, within);
                let below = bvh.base[level - 1] + first;
                for &key in keys[1..].iter().rev().filter(|&&k| k != NOT) {
                    let d2 = f32::from_bits(key & !3);
                    stack[waiting] = Waiting { d2, level: level as u32 - 1, node: below + (key & 3) };
                    waiting += 1;
                }
                (level, node) = (level - 1, below + (keys[0] & 3));
                continue;
            }
            loop {
                if waiting == 0 {
                    return;
                }
                waiting -= 1;
                let w = stack[waiting];
                if w.d2 <= limit {
                    (level, node) = (w.level as usize, w.node);
                    break;
                }
            }
        }
    }

    /// The same for points far out, wholly in f64.
    #[cold]
    fn descend_far(&self, p: DVec3, d2: f64, mut visit: impl FnMut(u32) -> f64) {
        let bvh = &self.bvh;
        let root = bvh.base.len() - 1;
        let mut limit = d2;
        let mut stack = vec![(0.0, root, bvh.base[root])];
        while let Some((d2, level, node)) = stack.pop() {
            if d2 > limit {
                continue;
            }
            let n = &bvh.nodes[node as usize];
            let first = 4 * (node - bvh.base[level]);
            let mut found: [(f64, u32); 4] = std::array::from_fn(|lane| {
                let away = |k: usize| {
                    let (lo, hi) = (f64::from(n.lo[k][lane]), f64::from(n.hi[k][lane]));
                    (lo - p[k]).max(p[k] - hi).max(0.0)
                };
                let d = DVec3::new(away(0), away(1), away(2));
                // Rounding, as in `ceiling`.
                (d.length_squared() * (1.0 - 1e-14), lane as u32)
            });
            found.sort_unstable_by(|x, y| y.0.total_cmp(&x.0));
            // Farthest first, so that the nearest lies on top; for triangles the other way round.
            if level > 0 {
                let below = bvh.base[level - 1] + first;
                let near = found.iter().filter(|f| f.0 <= limit && f.0 < f64::INFINITY);
                stack.extend(near.map(|&(d2, lane)| (d2, level - 1, below + lane)));
            } else {
                for &(d2, lane) in found.iter().rev() {
                    if d2 <= limit && d2 < f64::INFINITY {
                        limit = visit(first + lane);
                    }
                }
            }
        }
    }
}

/// The greatest squared distance of the points from a triangle; or anything above `enough` once that is passed.
#[inline]
pub(super) fn greatest(t: [DVec3; 3], points: &[DVec3; 3], enough: f64) -> f64 {
    let mut greatest = 0f64;
    for &p in points {
        greatest = greatest.max(triangle::closest(t, p).d2);
        if greatest > enough {
            break;
        }
    }
    greatest
}

fn near(p: DVec3) -> bool {
    p.abs().max_element() < FAR
}

/// A point between two in f32.
struct Around {
    lo: [Vec4; 3],
    hi: [Vec4; 3],
}

impl Around {
    #[inline]
    fn new(p: DVec3) -> Self {
        Around { lo: p.to_array().map(down).map(Vec4::splat), hi: p.to_array().map(up).map(Vec4::splat) }
    }

    /// Squared distances of the four boxes; never above the true ones by more than rounding. Infinite for missing children.
    #[inline]
    fn squared(&self, n: &Node) -> Vec4 {
        let away = |k: usize| (n.lo[k] - self.hi[k]).max(self.lo[k] - n.hi[k]).max(Vec4::ZERO);
        let (x, y, z) = (away(0), away(1), away(2));
        x * x + y * y + z * z
    }
}

/// The key of a child that is out of the question.
const NOT: u32 = u32::MAX;

/// Squared distances as ordered bits with the lane in the lowest two, least first; [`NOT`] for those that are not within the limit.
#[inline]
fn keys(d2: Vec4, within: BVec4A) -> [u32; 4] {
    let all = Vec4::splat(f32::from_bits(NOT));
    let mut keys = Vec4::select(within, d2, all).to_array().map(f32::to_bits);
    for (lane, key) in keys.iter_mut().enumerate() {
        // NOT stays as it is: it is compared as a number from here on.
        *key = if *key == NOT { NOT } else { *key & !3 | lane as u32 };
    }
    sort(&mut keys);
    keys
}

/// Sorts four numbers.
#[inline]
fn sort(k: &mut [u32; 4]) {
    let mut order = |i: usize, j: usize| (k[i], k[j]) = (k[i].min(k[j]), k[i].max(k[j]));
    order(0, 1);
    order(2, 3);
    order(0, 2);
    order(1, 3);
    order(1, 2);
}
