//! How far a piece can be from the sheet of a surface that covers it.
//!
//! Seen along some direction, the triangles of the other surface that lie over the piece cut it into cells. The distance from one triangle is
//! convex, so over a cell it is greatest at a corner of the cell. What has to be proven is that cells leave nothing out: the number of
//! triangles over a point is odd or even, and changes between the two only where an odd number of triangles meet in an edge. If
//! it is odd at one point of the piece and no such edge comes near it, it is odd, and so not zero, everywhere.
//!
//! Triangles may be left out at will as long as that holds: those that face the other way, and those that do not hang together with the nearest
//! one, so that the other side of a thin sheet is of no account.
//!
//! Coordinates in the plane are rounded, and count as they are: the argument is about the mesh that they make, whose points are off by a
//! few units in the last place. Signs are taken for known only beyond the error of computing them.

use super::bvh::{down, up};
use super::pieces::Piece;
use super::query::greatest;
use super::surface::Surface;
use super::triangle;
use glam::{DVec2, DVec3};

/// With more triangles over a piece it is better cut first.
const MOST: usize = 48;
/// Twice the area over the square of the longest side below which the slope of a plane is not relied upon: reaching as far out as the other
/// surface does, it would be off by 4e-16 over this.
const THIN: f64 = 0.1;
/// Closer than this, surfaces of size 1 are the same to rounding.
const TOUCHING: f64 = 1e-13;
/// Cells reach beyond the piece by this part of the greatest coordinate, more than rounding.
const MARGIN: f64 = 1e-14;

/// A triangle seen along the direction: in the plane, and its heights.
#[derive(Clone, Copy, Default)]
struct Seen {
    id: u32,
    at: [DVec2; 3],
    height: [f64; 3],
    /// It hangs together with the nearest.
    reached: bool,
}

/// Asks a surface how far pieces are from the sheet of it that covers them.
pub(super) struct Cover<'a> {
    surface: &'a Surface,
    /// Vertex -> the first at the same place.
    same: &'a [u32],
    seen: Vec<Seen>,
    /// The sides of those, sorted: both ends, and which triangle.
    edges: Vec<(u64, u32)>,
}

/// Which side of the line from `a` to `b` the point `c` is on: above 0 to the left; 0 if rounding leaves it open.
#[inline]
fn side(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let (left, right) = ((a.x - c.x) * (b.y - c.y), (a.y - c.y) * (b.x - c.x));
    let det = left - right;
    // Shewchuk's bound of the error is 3.3306690738754716e-16 of this sum.
    if det.abs() > 4e-16 * (left.abs() + right.abs()) { det } else { 0.0 }
}

/// All points are to the right of the line, for certain.
#[inline]
fn beyond(a: DVec2, b: DVec2, points: &[DVec2]) -> bool {
    points.iter().all(|&p| side(a, b, p) < 0.0)
}

/// The piece in the plane, its corners to the left.
struct Ground {
    at: [DVec2; 3],
    height: [f64; 3],
    double_area: f64,
    /// Along the plane, and up.
    axes: [DVec3; 3],
    origin: DVec3,
}

impl Ground {
    /// No point of the triangle lies over the piece, for certain.
    fn misses(&self, t: &[DVec2; 3]) -> bool {
        let p = &self.at;
        (0..3).any(|k| beyond(p[k], p[(k + 1) % 3], t)) || (0..3).any(|k| beyond(t[k], t[(k + 1) % 3], p))
    }

    /// The same for a segment.
    fn misses_segment(&self, a: DVec2, b: DVec2) -> bool {
        let p = &self.at;
        (0..3).any(|k| beyond(p[k], p[(k + 1) % 3], &[a, b])) || beyond(a, b, p) || beyond(b, a, p)
    }

    /// The point of the piece's plane.
    fn place(&self, x: DVec2) -> DVec3 {
        let [u, w, up] = self.axes;
        self.origin + u * x.x + w * x.y + up * self.level(x)
    }

    /// Height of the piece's plane.
    #[inline]
    fn level(&self, x: DVec2) -> f64 {
        plane(&self.at, &self.height, self.double_area, x)
    }
}

/// Height of the plane through three points.
#[inline]
fn plane(at: &[DVec2; 3], height: &[f64; 3], double_area: f64, x: DVec2) -> f64 {
    let o = x - at[0];
    let (v, w) = (o.perp_dot(at[2] - at[0]) / double_area, (at[1] - at[0]).perp_dot(o) / double_area);
    height[0] + (height[1] - height[0]) * v + (height[2] - height[0]) * w
}

/// Twice the area, unless the triangle is thin or steep.
fn stout(t: &[DVec2; 3], height: &[f64; 3]) -> Option<f64> {
    let (a, b, c) = (t[1] - t[0], t[2] - t[1], t[0] - t[2]);
    let longest = a.length_squared().max(b.length_squared()).max(c.length_squared());
    let rise = (height[1] - height[0]).abs().max((height[2] - height[0]).abs());
    let area = a.perp_dot(-c);
    (area > THIN * longest && rise * rise <= longest).then_some(area)
}

impl<'a> Cover<'a> {
    /// With what [`Surface::same_places`] says of the same surface.
    pub(super) fn new(surface: &'a Surface, same: &'a [u32]) -> Self {
        Cover { surface, same, seen: Vec::new(), edges: Vec::new() }
    }

    /// A bound of the distance of the piece from the surface, looking no farther than `reach` and no better than `enough`; `None` where
    /// the surface does not cover it in one sheet, or it is not known.
    pub(super) fn bound(&mut self, piece: &Piece, reach: f64, enough: f64) -> Option<f64> {
        let b = self.surface;
        let [origin, p, q] = piece.corners;
        let own = (p - origin).cross(q - origin);
        let theirs = piece.near.iter().map(|&t| b.normal(t)).sum::<DVec3>();
        // The larger ones of the triangles decide: they are what is not noise.
        let up = (theirs + if own.dot(theirs) < 0.0 { -own } else { own }).try_normalize()?;
        let (u, w) = up.any_orthonormal_pair();
        let project = |p: DVec3| {
            let o = p - origin;
            (DVec2::new(o.dot(u), o.dot(w)), o.dot(up))
        };
        let mut ground = piece.corners.map(project);
        if (ground[1].0 - ground[0].0).perp_dot(ground[2].0 - ground[0].0) < 0.0 {
            ground.swap(1, 2);
        }
        let at = ground.map(|g| g.0);
        let height = ground.map(|g| g.1);
        let ground = Ground { at, height, double_area: stout(&at, &height)?, axes: [u, w, up], origin };
        self.gather(piece, reach, &ground, project)?;
        if piece.d.iter().all(|&d| d <= TOUCHING) {
            // Surfaces that are the same there: a single triangle may have it all.
            let whole =
                self.seen.iter().map(|t| greatest(b.corners(t.id as usize), &piece.corners, f64::INFINITY));
            let whole = whole.fold(f64::INFINITY, f64::min).sqrt();
            if whole <= TOUCHING {
                return Some(whole);
            }
        }
        let middle = Middle::new(&ground);
        let all = self.covers(&ground, &middle).then(|| self.worst(&ground, enough));
        let bound = match all {
            Some(bound) if bound <= enough => bound,
            // Another sheet may be in the way.
            _ => {
                if !self.flood(&middle) {
                    return all;
                }
                match self.covers(&ground, &middle) {
                    true => self.worst(&ground, enough),
                    false => return all,
                }
            }
        };
        Some(bound)
    }

    /// The triangles with boxes within `reach` of that of the piece that face the right way and may lie over it.
    fn gather(
        &mut self,
        piece: &Piece,
        reach: f64,
        ground: &Ground,
        project: impl Fn(DVec3) -> (DVec2, f64),
    ) -> Option<()> {
        let b = self.surface;
        let [x, y, z] = piece.corners;
        let lo = (x.min(y).min(z) - reach).to_array().map(down);
        let hi = (x.max(y).max(z) + reach).to_array().map(up);
        self.seen.clear();
        let seen = &mut self.seen;
        let everywhere = |_, _| true;
        let all = b.bvh.meeting((lo, hi), everywhere, |id| {
            let t = b.corners(id as usize).map(&project);
            let (at, height) = (t.map(|t| t.0), t.map(|t| t.1));
            let faces = (at[1] - at[0]).perp_dot(at[2] - at[0]) >= 0.0;
            if faces && !ground.misses(&at) {
                seen.push(Seen { id, at, height, reached: true });
            }
            seen.len() <= MOST
        });
        self.edges.clear();
        for (i, t) in self.seen.iter().enumerate() {
            let v = corners_at(b, self.same, t.id);
            self.edges.extend([0, 1, 2].map(|k| (edge(v, k), i as u32)));
        }
        self.edges.sort_unstable();
        all.then_some(())
    }

    /// Keeps what hangs together with the nearest triangle over the middle. Whether that is less than there was.
    fn flood(&mut self, middle: &Middle) -> bool {
        let over = |t: &&mut Seen| middle.is_under(t) == Some(true);
        // Roughly: it only chooses.
        let away = |t: &Seen| (t.height.iter().sum::<f64>() / 3.0 - middle.height).abs();
        let Some(first) = self.seen.iter_mut().filter(over).min_by(|s, t| away(s).total_cmp(&away(t))) else {
            return false;
        };
        let first = first.id;
        for t in &mut self.seen {
            t.reached = t.id == first;
        }
        // Few triangles: going over their edges until nothing changes is as fast as anything.
        let mut changed = true;
        while changed {
            changed = false;
            for run in self.edges.chunk_by(|x, y| x.0 == y.0) {
                let seen = &mut self.seen;
                let any = run.iter().any(|e| seen[e.1 as usize].reached);
                if any && run.iter().any(|e| !seen[e.1 as usize].reached) {
                    run.iter().for_each(|e| seen[e.1 as usize].reached = true);
                    changed = true;
                }
            }
        }
        self.seen.iter().any(|t| !t.reached)
    }

    /// Whether the triangles reached leave out no point of the piece.
    fn covers(&self, ground: &Ground, middle: &Middle) -> bool {
        let mut odd = false;
        for t in self.seen.iter().filter(|t| t.reached) {
            match middle.is_under(t) {
                Some(under) => odd ^= under,
                None => return false,
            }
        }
        let beside = |&(_, i): &(u64, u32), key: u64| {
            let t = &self.seen[i as usize];
            let v = corners_at(self.surface, self.same, t.id);
            (0..3)
                .find(|&k| edge(v, k) == key)
                .is_some_and(|k| ground.misses_segment(t.at[k], t.at[(k + 1) % 3]))
        };
        odd && self.edges.chunk_by(|x, y| x.0 == y.0).all(|run| {
            let mut reached = run.iter().filter(|e| self.seen[e.1 as usize].reached).peekable();
            match reached.peek().copied() {
                Some(e) => reached.count() % 2 == 0 || beside(e, run[0].0),
                None => true,
            }
        })
    }

    /// The greatest bound of all cells.
    fn worst(&self, ground: &Ground, enough: f64) -> f64 {
        let reached = self.seen.iter().filter(|t| t.reached);
        reached.map(|t| cell(self.surface, t, ground, enough)).fold(0.0, f64::max)
    }
}

/// A point of the piece.
struct Middle {
    at: DVec2,
    height: f64,
}

impl Middle {
    fn new(ground: &Ground) -> Self {
        let at = (ground.at[0] + ground.at[1] + ground.at[2]) / 3.0;
        Middle { at, height: ground.level(at) }
    }

    /// Whether the triangle is over it; `None` where that cannot be told.
    fn is_under(&self, t: &Seen) -> Option<bool> {
        let s = [0, 1, 2].map(|k| side(t.at[k], t.at[(k + 1) % 3], self.at));
        if s[0] < 0.0 || s[1] < 0.0 || s[2] < 0.0 {
            return Some(false);
        }
        (s[0] > 0.0 && s[1] > 0.0 && s[2] > 0.0).then_some(true)
    }
}

/// The corners of a triangle, those at the same place under one number.
fn corners_at(b: &Surface, same: &[u32], t: u32) -> [u32; 3] {
    b.triangles[t as usize].map(|v| same[v as usize])
}

/// Both ends of a side, the lower first.
#[inline]
fn edge(v: [u32; 3], k: usize) -> u64 {
    let (x, y) = (v[k], v[(k + 1) % 3]);
    u64::from(x.min(y)) << 32 | u64::from(x.max(y))
}

/// A bound of the distance between triangle `t` and the cell of the piece under it.
fn cell(b: &Surface, t: &Seen, ground: &Ground, enough: f64) -> f64 {
    // The difference in height is linear: greatest at a corner of the one or of the other, unless the cell ends before.
    let theirs = (0..3).map(|k| (t.height[k] - ground.level(t.at[k])).abs()).fold(0f64, f64::max);
    if theirs <= enough {
        return theirs;
    }
    if let Some(area) = stout(&t.at, &t.height) {
        let ours = (0..3).map(|k| (ground.height[k] - plane(&t.at, &t.height, area, ground.at[k])).abs());
        let ours = ours.fold(0f64, f64::max);
        if ours <= enough {
            return ours;
        }
    }
    let corners = b.corners(t.id as usize);
    let (polygon, n) = clip(t, ground);
    let mut bound = 0f64;
    for &(x, height) in &polygon[..n] {
        let away = (height - ground.level(x)).abs();
        bound = bound.max(match away > enough {
            true => away.min(triangle::closest(corners, ground.place(x)).d2.sqrt()),
            false => away,
        });
    }
    bound
}

/// The part of a triangle over the piece (Sutherland & Hodgman 1974): corners in the plane, and heights.
fn clip(t: &Seen, ground: &Ground) -> ([(DVec2, f64); 6], usize) {
    let size = t.at.iter().chain(&ground.at).map(|p| p.abs().max_element()).fold(0.0, f64::max);
    let start: [(DVec2, f64); 3] = std::array::from_fn(|k| (t.at[k], t.height[k]));
    let mut polygon = [(DVec2::ZERO, 0.0); 6];
    polygon[..3].copy_from_slice(&start);
    let mut n = 3;
    for k in 0..3 {
        let (from, to) = (ground.at[k], ground.at[(k + 1) % 3]);
        let along = to - from;
        let margin = MARGIN * size * along.length();
        let inside = |x: DVec2| along.perp_dot(x - from) + margin;
        let (before, count) = (polygon, n);
        n = 0;
        for i in 0..count {
            let (x, y) = (before[i], before[(i + 1) % count]);
            let (s, r) = (inside(x.0), inside(y.0));
            if s >= 0.0 && n < 6 {
                polygon[n] = x;
                n += 1;
            }
            if (s >= 0.0) != (r >= 0.0) && n < 6 {
                let part = s / (s - r);
                polygon[n] = (x.0 + (y.0 - x.0) * part, x.1 + (y.1 - x.1) * part);
                n += 1;
            }
        }
    }
    (polygon, n)
}
