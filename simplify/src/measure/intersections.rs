//! Where a surface crosses itself.
//!
//! Pairs of triangles whose boxes meet come from the hierarchy, traversed once for every triangle; exact predicates (Shewchuk) decide about
//! them. Corners at the same place are the same, whatever their index, so soups are judged like the meshes they would weld to.

use super::MeasureError;
use super::bvh::bounds_of;
use super::progress::Progress;
use super::surface::Surface;
use crate::options::Control;
use crate::parallel;
use glam::DVec3;
use robust::{Coord, Coord3D};

/// Pairs of triangles that meet where they should not.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SelfIntersections {
    /// How many pairs there are.
    pub pairs: u64,
    /// Some of them, at most [`SelfIntersections::LISTED`], by index in the input, the lower first.
    pub some: Vec<[u32; 2]>,
    /// Triangles without area, which are left out.
    pub degenerate: usize,
}

impl SelfIntersections {
    /// How many pairs are listed at most.
    pub const LISTED: usize = 64;
}

/// Counts the pairs of triangles of `surface` that intersect.
///
/// Triangles without a common corner intersect if they have a common point, be it a touch; those with one, if they have another common point; those
/// with two or three, if they overlap. Decided exactly for the coordinates about the surface's centre: those are exact themselves where positions
/// are f32, and otherwise rounded by less than 2^-52 of the size of the surface. O(n log n) for surfaces that are not crumpled up. Errors:
/// cancelled.
pub fn self_intersections(
    surface: &Surface,
    control: &dyn Control,
) -> Result<SelfIntersections, MeasureError> {
    let progress = Progress::new(control, surface.triangle_count());
    let chunks: Vec<Result<SelfIntersections, MeasureError>> = parallel::map_init_chunks(
        &surface.triangles,
        1024,
        || (),
        |_, first, chunk| {
            progress.check()?;
            let mut found = SelfIntersections::default();
            for t in first..first + chunk.len() {
                let corners = surface.corners(t);
                if is_degenerate(&corners) {
                    found.degenerate += 1;
                    continue;
                }
                surface.meeting_boxes(t, |u| {
                    if intersect(corners, surface.corners(u)) {
                        found.pairs += 1;
                        if found.some.len() < SelfIntersections::LISTED {
                            let (i, j) = (surface.ids[t], surface.ids[u]);
                            found.some.push([i.min(j), i.max(j)]);
                        }
                    }
                });
            }
            progress.add(chunk.len());
            Ok(found)
        },
    );
    let mut all = SelfIntersections::default();
    for chunk in chunks {
        let chunk = chunk?;
        all.pairs += chunk.pairs;
        all.degenerate += chunk.degenerate;
        let room = SelfIntersections::LISTED - all.some.len();
        all.some.extend(chunk.some.into_iter().take(room));
    }
    all.some.sort_unstable();
    Ok(all)
}

impl Surface {
    /// Calls `visit` for the triangles after `t` (in the order of the hierarchy) whose boxes meet that of `t`.
    fn meeting_boxes(&self, t: usize, mut visit: impl FnMut(usize)) {
        // The last triangle below a child: nothing to find there if it is not after `t`.
        let after = |level: u32, child: u32| ((child as usize + 1) << (2 * level)) - 1 > t;
        self.bvh.meeting(bounds_of(self.corners(t)), after, |u| {
            visit(u as usize);
            true
        });
    }
}

/// On which side of the plane through `a`, `b`, `c` (in that order) `d` is; 0 on it. Exact.
fn orient(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let [a, b, c, d] = [a, b, c, d].map(|p| Coord3D { x: p.x, y: p.y, z: p.z });
    robust::orient3d(a, b, c, d)
}

/// The same in the plane, without coordinate `axis`.
fn orient_flat(axis: usize, a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let [a, b, c] = [a, b, c].map(|p| Coord { x: p[(axis + 1) % 3], y: p[(axis + 2) % 3] });
    robust::orient2d(a, b, c)
}

/// A coordinate without which the triangle still has an area, if it has any.
fn flat_axis([a, b, c]: &[DVec3; 3]) -> Option<usize> {
    (0..3).find(|&axis| orient_flat(axis, *a, *b, *c) != 0.0)
}

fn is_degenerate(t: &[DVec3; 3]) -> bool {
    flat_axis(t).is_none()
}

/// Both above zero, or both below.
fn same_side(x: f64, y: f64) -> bool {
    x > 0.0 && y > 0.0 || x < 0.0 && y < 0.0
}

/// Whether two triangles meet beyond their common corners. `false` if the second is degenerate; the first must not be.
fn intersect(s: [DVec3; 3], t: [DVec3; 3]) -> bool {
    let common = |p: DVec3, other: &[DVec3; 3]| other.contains(&p);
    let in_t = s.map(|p| common(p, &t));
    match in_t.iter().filter(|&&c| c).count() {
        0 => {
            let over = |t: &[DVec3; 3], s: &[DVec3; 3]| {
                let side = s.map(|p| orient(t[0], t[1], t[2], p));
                same_side(side[0], side[1]) && same_side(side[1], side[2])
            };
            if over(&s, &t) || over(&t, &s) || is_degenerate(&t) {
                return false;
            }
            // Two triangles meet where a side of one meets the other.
            (0..3).any(|k| crosses(s[k], s[(k + 1) % 3], &t) || crosses(t[k], t[(k + 1) % 3], &s))
        }
        1 => {
            // The sides that do not have the corner: what goes on from there leaves one of the triangles over them.
            let Some(k) = in_t.iter().position(|&c| c) else { return false };
            let Some(l) = t.iter().position(|&p| p == s[k]) else { return false };
            let (a, b) = (s[(k + 1) % 3], s[(k + 2) % 3]);
            let (c, d) = (t[(l + 1) % 3], t[(l + 2) % 3]);
            let apart = |x: &[DVec3; 3], p: DVec3, q: DVec3| {
                same_side(orient(x[0], x[1], x[2], p), orient(x[0], x[1], x[2], q))
            };
            if apart(&t, a, b) || apart(&s, c, d) || is_degenerate(&t) {
                return false;
            }
            crosses(a, b, &t) || crosses(c, d, &s)
        }
        2 => {
            let Some(k) = in_t.iter().position(|&c| !c) else { return false };
            let (p, q, r) = (s[(k + 1) % 3], s[(k + 2) % 3], s[k]);
            let Some(&u) = t.iter().find(|&&u| u != p && u != q) else { return false };
            if orient(p, q, r, u) != 0.0 {
                return false;
            }
            let Some(axis) = flat_axis(&s) else { return false };
            same_side(orient_flat(axis, p, q, r), orient_flat(axis, p, q, u))
        }
        _ => true,
    }
}

/// Whether segment `pq` and the triangle, both closed, have a common point. Exact.
fn crosses(p: DVec3, q: DVec3, t: &[DVec3; 3]) -> bool {
    let [a, b, c] = *t;
    let (above, below) = (orient(a, b, c, p), orient(a, b, c, q));
    if same_side(above, below) {
        return false;
    }
    if above == 0.0 && below == 0.0 {
        return crosses_flat(p, q, t);
    }
    let side = [orient(p, q, a, b), orient(p, q, b, c), orient(p, q, c, a)];
    side.iter().all(|&x| x >= 0.0) || side.iter().all(|&x| x <= 0.0)
}

/// The same in the triangle's plane.
fn crosses_flat(p: DVec3, q: DVec3, t: &[DVec3; 3]) -> bool {
    let Some(axis) = flat_axis(t) else { return false };
    let turn = |x, y, z| orient_flat(axis, x, y, z);
    let inside = |x: DVec3| {
        let side = [turn(t[0], t[1], x), turn(t[1], t[2], x), turn(t[2], t[0], x)];
        side.iter().all(|&s| s >= 0.0) || side.iter().all(|&s| s <= 0.0)
    };
    // Closed segments that are not on one line meet if each has its ends on both sides of the other. On one line, an end of one lies on the
    // other; then an end of `pq` is inside, or a corner on `pq`.
    let meet = |a: DVec3, b: DVec3| {
        let (x, y, z, w) = (turn(p, q, a), turn(p, q, b), turn(a, b, p), turn(a, b, q));
        let flat = x == 0.0 && y == 0.0;
        let on = |c: DVec3| c.cmpge(p.min(q)).all() && c.cmple(p.max(q)).all();
        if flat { on(a) || on(b) } else { !same_side(x, y) && !same_side(z, w) }
    };
    inside(p) || inside(q) || (0..3).any(|k| meet(t[k], t[(k + 1) % 3]))
}
