//! What of deviations shows from one side, measured over all triangles: code of its own, that shares nothing with what decides, nor with `simplify::measure`.

use crate::simplify::measure::MeasureError;
use glam::DVec3;

/// Of what lies along the line of sight such a part counts.
const ALONG: f64 = 0.25;
/// Triangles in a leaf.
const LEAF: usize = 4;

/// A sphere around the triangles `from..to` of an order; halves of those follow it: the first at once, the second at `second`, 0 for a leaf.
struct Node {
    middle: DVec3,
    radius: f64,
    from: usize,
    to: usize,
    second: usize,
}

/// Triangles in a tree of spheres.
pub(super) struct Spheres {
    triangles: Vec<[DVec3; 3]>,
    nodes: Vec<Node>,
}

impl Spheres {
    /// Errors: no triangles, or places that are no numbers. O(n log^2 n).
    pub(super) fn new(triangles: &[[DVec3; 3]]) -> Result<Spheres, MeasureError> {
        if triangles.is_empty() {
            return Err(MeasureError::NoTriangle);
        }
        if let Some(k) = triangles.as_flattened().iter().position(|p| !p.is_finite()) {
            return Err(MeasureError::NotFinite { vertex: k as u32, triangle: k / 3 });
        }
        let mut tree = Spheres { triangles: triangles.to_vec(), nodes: Vec::new() };
        tree.build(0, triangles.len());
        Ok(tree)
    }

    fn build(&mut self, from: usize, to: usize) {
        let own = &mut self.triangles[from..to];
        let corners = own.as_flattened();
        let (lo, hi) = corners.iter().fold((corners[0], corners[0]), |(lo, hi), &p| (lo.min(p), hi.max(p)));
        let middle = 0.5 * (lo + hi);
        let radius = corners.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        let at = self.nodes.len();
        self.nodes.push(Node { middle, radius, from, to, second: 0 });
        if to - from > LEAF {
            let size = (hi - lo).to_array();
            let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
            let key = |t: &[DVec3; 3]| t[0][axis] + t[1][axis] + t[2][axis];
            own.sort_by(|a, b| key(a).total_cmp(&key(b)));
            let half = from.midpoint(to);
            self.build(from, half);
            self.nodes[at].second = self.nodes.len();
            self.build(half, to);
        }
    }

    /// The least deviation of a place of the triangles from `p` that shows, seen along `line`.
    pub(super) fn least(&self, p: DVec3, line: DVec3) -> f64 {
        let v = line.normalize_or_zero();
        // Along the line of sight everything is brought nearer: then it is a distance.
        let seen = |q: DVec3| {
            let d = q - p;
            d - v * ((1.0 - ALONG) * d.dot(v))
        };
        // What shows of a way is no longer than the way, so spheres keep their size at most.
        let nearest = |n: &Node| seen(n.middle).length() - n.radius;
        let mut best = f64::INFINITY;
        let mut stack = vec![(nearest(&self.nodes[0]), 0)];
        while let Some((bound, at)) = stack.pop() {
            if bound >= best {
                continue;
            }
            let node = &self.nodes[at];
            if node.second == 0 {
                let own = &self.triangles[node.from..node.to];
                best = own.iter().map(|t| from_origin(t.map(seen))).fold(best, f64::min);
                continue;
            }
            let mut two = [at + 1, node.second].map(|k| (nearest(&self.nodes[k]), k));
            // The nearer one is looked at first.
            if two[0].0 < two[1].0 {
                two.swap(0, 1);
            }
            stack.extend(two);
        }
        best
    }
}

/// The distance of a triangle from the origin.
fn from_origin([a, b, c]: [DVec3; 3]) -> f64 {
    let side = |a: DVec3, b: DVec3| {
        let (way, long) = (b - a, (b - a).length_squared());
        let t = if long > 0.0 { (-a.dot(way) / long).clamp(0.0, 1.0) } else { 0.0 };
        (a + way * t).length()
    };
    let sides = side(a, b).min(side(b, c)).min(side(c, a));
    let normal = (b - a).cross(c - a);
    // The foot of the plane is inside if it is on the same side of all three.
    let within = |p: DVec3, q: DVec3| (q - p).cross(-p).dot(normal) >= 0.0;
    // Of a sliver the sides are all there is.
    let long = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    let inside = normal.length() > 1e-12 * long && within(a, b) && within(b, c) && within(c, a);
    if inside { sides.min((a.dot(normal) / normal.length()).abs()) } else { sides }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from 0 to 1.
    struct Random(u64);

    impl Random {
        fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 33) as f64 / (1u64 << 31) as f64
        }

        fn vector(&mut self) -> DVec3 {
            DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
        }
    }

    #[test]
    fn the_tree_finds_what_all_places_of_all_triangles_show() {
        let mut r = Random(3);
        let triangle = |r: &mut Random| {
            let at = r.vector();
            [at, at + 0.3 * r.vector(), at + 0.3 * r.vector()]
        };
        let triangles: Vec<[DVec3; 3]> = (0..60).map(|_| triangle(&mut r)).collect();
        let tree = Spheres::new(&triangles).unwrap();
        for _ in 0..20 {
            let (p, line) = (1.5 * r.vector(), r.vector());
            let v = line.normalize();
            let found = tree.least(p, line);
            let mut least = f64::INFINITY;
            for t in &triangles {
                for k in 0..=40u32 {
                    for l in 0..=40 - k {
                        let (x, y) = (k as f64 / 40.0, l as f64 / 40.0);
                        let d = t[0] + (t[1] - t[0]) * x + (t[2] - t[0]) * y - p;
                        let along = d.dot(v);
                        least = least.min(((d - v * along).length_squared() + (along / 4.0).powi(2)).sqrt());
                    }
                }
            }
            // Places on the grid are 0.3 * 3^0.5 / 40 apart.
            assert!(found <= least * (1.0 + 1e-12) && found > least - 0.02, "{found} {least}");
        }
        // Behind a triangle: all is along the line.
        let front = [DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::new(0.0, 2.0, 0.0)];
        let tree = Spheres::new(&[front]).unwrap();
        assert!((tree.least(DVec3::new(0.0, 0.0, -0.8), DVec3::NEG_Z) - 0.2).abs() < 1e-12);
        // From the side, all is across it.
        assert!((tree.least(DVec3::new(0.0, 0.0, -0.8), DVec3::X) - 0.8).abs() < 1e-12);
        assert!(Spheres::new(&[]).is_err() && Spheres::new(&[[DVec3::NAN; 3]]).is_err());
    }
}
