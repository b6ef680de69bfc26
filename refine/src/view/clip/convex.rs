//! Segments, triangles and convex polygons.

use super::exact::{crossing, fraction, side};
use glam::DVec4;

/// What is clipped: a point in homogeneous coordinates, and what goes with it.
pub trait Corner: Clone {
    /// `[x, y, z, w]`.
    fn point(&self) -> DVec4;

    /// What is at `at`, which is `self + t (to - self)`, 0 < t < 1, in homogeneous coordinates.
    ///
    /// Attributes are interpolated with the same t: that is right for points that one matrix made of points with w = 1 and attributes linear in
    /// space (after a projection it is the interpolation that textures need).
    fn mix(&self, to: &Self, t: f64, at: DVec4) -> Self;
}

impl Corner for DVec4 {
    fn point(&self) -> DVec4 {
        *self
    }

    fn mix(&self, _: &Self, _: f64, at: DVec4) -> Self {
        at
    }
}

/// A point with `N` attributes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex<const N: usize> {
    /// `[x, y, z, w]`.
    pub point: DVec4,
    /// What is interpolated.
    pub values: [f64; N],
}

impl<const N: usize> Corner for Vertex<N> {
    fn point(&self) -> DVec4 {
        self.point
    }

    fn mix(&self, to: &Self, t: f64, at: DVec4) -> Self {
        let values = std::array::from_fn(|i| self.values[i] + t * (to.values[i] - self.values[i]));
        Vertex { point: at, values }
    }
}

/// Where the segment between a and b crosses; one of them is positive, the other negative.
fn cut<C: Corner>(a: &C, sa: f64, b: &C, sb: f64) -> C {
    let at = crossing(a.point(), sa, b.point(), sb);
    let (from, to, t) = fraction(a, sa, b, sb);
    from.mix(to, t, at)
}

/// The part of a segment on the positive side of a plane, from a to b; `None` if there is none, or just an end.
pub fn clip_segment<C: Corner>(a: &C, b: &C, plane: DVec4) -> Option<[C; 2]> {
    let (sa, sb) = (side(plane, a.point()), side(plane, b.point()));
    if sa >= 0.0 && sb >= 0.0 {
        (sa > 0.0 || sb > 0.0).then(|| [a.clone(), b.clone()])
    } else if sa > 0.0 {
        Some([a.clone(), cut(a, sa, b, sb)])
    } else if sb > 0.0 {
        Some([cut(a, sa, b, sb), b.clone()])
    } else {
        None
    }
}

/// The part of a segment on the positive sides of all planes: [`clip_segment`] by each, after the trivial cases.
pub fn clip_segment_in<C: Corner>(a: &C, b: &C, planes: &[DVec4]) -> Option<[C; 2]> {
    let outside = |p: &DVec4| side(*p, a.point()) <= 0.0 && side(*p, b.point()) <= 0.0;
    if planes.iter().any(outside) {
        return None;
    }
    let mut segment = [a.clone(), b.clone()];
    for &plane in planes {
        segment = clip_segment(&segment[0], &segment[1], plane)?;
    }
    Some(segment)
}

/// The part of a triangle on the positive side of a plane, as none, one or two triangles of its orientation, appended to `out`.
///
/// A filter of a pipeline. Through several planes the pieces multiply (up to 26 after six); [`ConvexClipper`] makes fewer.
pub fn clip_triangle<C: Corner>(t: &[C; 3], plane: DVec4, out: &mut Vec<[C; 3]>) {
    let s = [0, 1, 2].map(|k| side(plane, t[k].point()));
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| s[j].total_cmp(&s[i]));
    let [i, j, k] = order;
    // Sorted by an odd number of exchanges?
    let odd = (j + 3 - i) % 3 == 2;
    let (v1, v2, v3, s1, s2, s3) = (&t[i], &t[j], &t[k], s[i], s[j], s[k]);
    let mut put = |a: C, b: C, c: C| out.push(if odd { [a, c, b] } else { [a, b, c] });
    if s1 <= 0.0 {
    } else if s3 >= 0.0 {
        out.push(t.clone());
    } else if s2 <= 0.0 {
        let p = if s2 < 0.0 { cut(v1, s1, v2, s2) } else { v2.clone() };
        put(v1.clone(), p, cut(v1, s1, v3, s3));
    } else {
        let (p, q) = (cut(v2, s2, v3, s3), cut(v1, s1, v3, s3));
        put(v1.clone(), v2.clone(), q.clone());
        put(v2.clone(), p, q);
    }
}

/// What became of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Wholly inside.
    Kept,
    /// Partly inside.
    Cut,
    /// Nothing is left.
    Dropped,
}

/// Clips convex polygons, one after the other, without allocating for each.
#[derive(Clone, Debug)]
pub struct ConvexClipper<C> {
    sides: Vec<f64>,
    polygon: Vec<C>,
    next: Vec<C>,
}

impl<C> Default for ConvexClipper<C> {
    fn default() -> Self {
        ConvexClipper { sides: vec![], polygon: vec![], next: vec![] }
    }
}

impl<C: Corner> ConvexClipper<C> {
    /// Clips a convex polygon, in place, by the open positive sides of all planes; orientation is kept.
    ///
    /// Each plane adds at most one corner. First the trivial cases: all corners outside of one plane; all inside of all; and only the planes
    /// that some corner is not inside of are then cut by. O(planes * corners).
    pub fn clip(&mut self, polygon: &mut Vec<C>, planes: &[DVec4]) -> Outcome {
        let mut crossing: u64 = 0;
        for (k, &plane) in planes.iter().enumerate() {
            let inside = polygon.iter().filter(|c| side(plane, c.point()) > 0.0).count();
            if inside == 0 {
                polygon.clear();
                return Outcome::Dropped;
            }
            if inside < polygon.len() {
                // Planes past the 64th are always cut by.
                crossing |= 1 << k.min(63);
            }
        }
        let mut outcome = Outcome::Kept;
        for (k, &plane) in planes.iter().enumerate() {
            if crossing >> k.min(63) & 1 == 0 {
                continue;
            }
            match self.cut(polygon, plane) {
                Outcome::Kept => {}
                Outcome::Cut => outcome = Outcome::Cut,
                Outcome::Dropped => return Outcome::Dropped,
            }
        }
        outcome
    }

    /// Clips a triangle by all planes; what is left is appended to `out` as a fan: at most planes + 1 triangles, seven for a box.
    pub fn triangle(&mut self, t: &[C; 3], planes: &[DVec4], out: &mut Vec<[C; 3]>) -> Outcome {
        let mut polygon = std::mem::take(&mut self.polygon);
        polygon.clear();
        polygon.extend_from_slice(t);
        let outcome = self.clip(&mut polygon, planes);
        if let [first, rest @ ..] = &polygon[..] {
            out.extend(rest.windows(2).map(|w| [first.clone(), w[0].clone(), w[1].clone()]));
        }
        self.polygon = polygon;
        outcome
    }

    fn cut(&mut self, polygon: &mut Vec<C>, plane: DVec4) -> Outcome {
        let n = polygon.len();
        self.sides.clear();
        self.sides.extend(polygon.iter().map(|c| side(plane, c.point())));
        let s = &self.sides;
        // Convex polygons have one run of positive corners; rounding may have made more of it, so only the run around the
        // farthest is taken, which is what keeps to one more corner a plane.
        let Some(top) = (0..n).max_by(|&i, &j| s[i].total_cmp(&s[j])).filter(|&i| s[i] > 0.0) else {
            polygon.clear();
            return Outcome::Dropped;
        };
        if s.iter().all(|&s| s >= 0.0) {
            return Outcome::Kept;
        }
        let (next, prev) = (|i: usize| (i + 1) % n, |i: usize| (i + n - 1) % n);
        let (mut first, mut last) = (top, top);
        while s[prev(first)] > 0.0 {
            first = prev(first);
        }
        while s[next(last)] > 0.0 {
            last = next(last);
        }
        let end = |inside: usize, outside: usize| match s[outside] < 0.0 {
            true => cut(&polygon[inside], s[inside], &polygon[outside], s[outside]),
            false => polygon[outside].clone(),
        };
        self.next.clear();
        self.next.push(end(first, prev(first)));
        let mut i = first;
        loop {
            self.next.push(polygon[i].clone());
            if i == last {
                break;
            }
            i = next(i);
        }
        self.next.push(end(last, next(last)));
        std::mem::swap(polygon, &mut self.next);
        Outcome::Cut
    }
}
