//! Distances of points to a mesh, through a uniform grid.

use glam::DVec3;
use progmesh_aif::Mesh;

/// Triangles in the cells of a grid.
pub(crate) struct Surface {
    triangles: Vec<[DVec3; 3]>,
    lo: DVec3,
    cell: f64,
    size: [i64; 3],
    cells: Vec<Vec<u32>>,
}

impl Surface {
    pub(crate) fn new(m: &Mesh) -> Self {
        let at = |i: u32| m.positions().get(i as usize);
        let triangles: Vec<_> = m.triangles().iter().map(|t| t.map(at)).collect();
        let (lo, hi) = m.surface_bounds().unwrap();
        let cell = (hi - lo).max_element() / (triangles.len() as f64 / 2.0).sqrt().clamp(1.0, 100.0);
        let size = ((hi - lo) / cell).to_array().map(|x| x as i64 + 1);
        let mut s = Surface { triangles, lo, cell, size, cells: Vec::new() };
        let mut cells = vec![Vec::new(); size.iter().product::<i64>() as usize];
        for (i, t) in s.triangles.iter().enumerate() {
            let (a, b) = (s.place(t[0].min(t[1]).min(t[2])), s.place(t[0].max(t[1]).max(t[2])));
            for z in a[2]..=b[2] {
                for y in a[1]..=b[1] {
                    (a[0]..=b[0]).for_each(|x| cells[s.index([x, y, z])].push(i as u32));
                }
            }
        }
        s.cells = cells;
        s
    }

    fn place(&self, p: DVec3) -> [i64; 3] {
        let q = ((p - self.lo) / self.cell).to_array();
        std::array::from_fn(|k| (q[k].floor() as i64).clamp(0, self.size[k] - 1))
    }

    fn index(&self, [x, y, z]: [i64; 3]) -> usize {
        ((z * self.size[1] + y) * self.size[0] + x) as usize
    }

    /// The triangle nearest to `p`, and the distance.
    pub(crate) fn nearest(&self, p: DVec3) -> (usize, f64) {
        let c = self.place(p);
        let mut best = (usize::MAX, f64::INFINITY);
        for r in 0..*self.size.iter().max().unwrap() + 1 {
            // All within r - 1 cells has been seen, measured from the nearest point of the grid.
            let seen = (r - 1).max(0) as f64 * self.cell;
            if best.1 <= seen {
                break;
            }
            let range = |k: usize| (c[k] - r).max(0)..=(c[k] + r).min(self.size[k] - 1);
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        if (x - c[0]).abs().max((y - c[1]).abs()).max((z - c[2]).abs()) < r {
                            continue;
                        }
                        for &i in &self.cells[self.index([x, y, z])] {
                            let d = p.distance(closest(p, &self.triangles[i as usize]));
                            if d < best.1 {
                                best = (i as usize, d);
                            }
                        }
                    }
                }
            }
        }
        best
    }

    /// Root of the mean squared distance of the points.
    pub(crate) fn rms(&self, points: impl IntoIterator<Item = DVec3>) -> f64 {
        let (mut sum, mut n) = (0.0, 0);
        for p in points {
            sum += self.nearest(p).1.powi(2);
            n += 1;
        }
        (sum / n as f64).sqrt()
    }
}

/// The point of a triangle closest to `p`: its foot on the plane if that lies inside, else the closest of the sides.
pub(crate) fn closest(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> DVec3 {
    let n = (b - a).cross(c - a);
    let inside = |x: DVec3, y: DVec3| (y - x).cross(p - x).dot(n) >= 0.0;
    if n.length_squared() > 0.0 && inside(a, b) && inside(b, c) && inside(c, a) {
        return p - n * ((p - a).dot(n) / n.length_squared());
    }
    let on = |x: DVec3, y: DVec3| {
        let d = y - x;
        let l = d.length_squared();
        if l > 0.0 { x + d * ((p - x).dot(d) / l).clamp(0.0, 1.0) } else { x }
    };
    let sides = [on(a, b), on(b, c), on(c, a)];
    sides.into_iter().min_by(|x, y| x.distance_squared(p).total_cmp(&y.distance_squared(p))).unwrap()
}

/// Vertices and centroids of the triangles.
pub(crate) fn samples(m: &Mesh) -> Vec<DVec3> {
    let at = |i: u32| m.positions().get(i as usize);
    let centroids = m.triangles().into_iter().map(|t| (at(t[0]) + at(t[1]) + at(t[2])) / 3.0);
    m.topology().vertices().map(|v| m.position(v)).chain(centroids).collect()
}

/// The larger of both one-sided rms distances.
pub(crate) fn rms(a: &Mesh, b: &Mesh) -> f64 {
    Surface::new(b).rms(samples(a)).max(Surface::new(a).rms(samples(b)))
}
