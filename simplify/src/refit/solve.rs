//! What the samples ask of the vertices, and the places that fit it best.

use super::net::{Net, ring_face};
use super::samples::{CurveHit, Hit};
use crate::quadric::Quadric;
use crate::validity::RingFace;
use crate::work::Kind;
use glam::DVec3;

/// Share of the squared distance in all directions for a sample inside a face; along the normal it counts in full. Holds
/// vertices from sliding in flat parts.
const SOFT: f64 = 0.1;
/// The same for a sample that is nearest to a face's side or corner; the normal has the rest.
const HARD: f64 = 0.2;
/// Pull to the place a vertex has, relative to the mean eigenvalue.
const DAMPING: f64 = 1e-3;
/// Rounds over the vertices between two bindings.
const ROUNDS: usize = 3;
/// A vertex moves by at most this part of its longest edge between two bindings.
const REACH: f64 = 0.5;
/// Least gain worth a move: the squared distance, in sizes of the mesh, that every sample would have to come nearer. Rounding of f32
/// coordinates is above, so what lies exactly right already stays to the bit.
const LEAST_GAIN: f64 = 1e-14;
/// Cosine that no face's normal may turn beyond in all: that of a single collapse.
const MIN_TURN: f64 = 0.2;

/// Sums over the samples of a face, as it lies at binding; displacements count from there.
#[derive(Clone, Copy, Debug, Default)]
struct FaceMoments {
    normal: DVec3,
    /// Of weight products 00 01 02 11 12 22: along the normal, and in all directions.
    along: [f64; 6],
    free: [f64; 6],
    /// Of weight times residual.
    along_r: [f64; 3],
    free_r: [DVec3; 3],
}

/// The same of a curve: weight products 00 01 11.
#[derive(Clone, Copy, Debug, Default)]
struct CurveMoments {
    products: [f64; 3],
    r: [DVec3; 2],
}

/// Place of a product of two weights in [`FaceMoments`].
const PRODUCT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// All sums.
pub(super) struct Moments {
    faces: Vec<FaceMoments>,
    curves: Vec<CurveMoments>,
}

impl Moments {
    pub(super) fn new(net: &Net) -> Self {
        Moments {
            faces: vec![FaceMoments::default(); net.triangles.len()],
            curves: vec![CurveMoments::default(); net.curves.len()],
        }
    }

    /// No samples, on the faces as they lie now.
    pub(super) fn clear(&mut self, net: &Net) {
        self.curves.fill(CurveMoments::default());
        for (m, cell) in self.faces.iter_mut().zip(&net.cells) {
            *m = FaceMoments { normal: cell.normal, ..Default::default() };
        }
    }

    #[inline]
    pub(super) fn add(&mut self, hit: &Hit) {
        let m = &mut self.faces[hit.face as usize];
        let w = [1.0 - hit.v - hit.w, hit.v, hit.w];
        let inside = w.iter().all(|&w| w > 0.0);
        let (along, free) = if inside { (1.0, SOFT) } else { (1.0 - HARD, HARD) };
        let (along, free) = (along * hit.weight, free * hit.weight);
        let height = hit.r.dot(m.normal);
        let products = [w[0] * w[0], w[0] * w[1], w[0] * w[2], w[1] * w[1], w[1] * w[2], w[2] * w[2]];
        for (k, x) in products.into_iter().enumerate() {
            m.along[k] += along * x;
            m.free[k] += free * x;
        }
        for (i, w) in w.into_iter().enumerate() {
            m.along_r[i] += along * w * height;
            m.free_r[i] += free * w * hit.r;
        }
    }

    #[inline]
    pub(super) fn add_to_curve(&mut self, hit: &CurveHit) {
        let m = &mut self.curves[hit.curve as usize];
        let w = [1.0 - hit.s, hit.s];
        for (k, x) in [w[0] * w[0], w[0] * w[1], w[1] * w[1]].into_iter().enumerate() {
            m.products[k] += hit.weight * x;
        }
        for (i, w) in w.into_iter().enumerate() {
            m.r[i] += hit.weight * w * hit.r;
        }
    }

    /// What the samples ask of the displacement of `v` while the others are at `points`, less what does not depend on it.
    fn quadric(&self, net: &Net, points: &[DVec3], v: u32) -> Quadric {
        let mut q = Quadric::default();
        let moved = |x: u32| points[x as usize] - net.points[x as usize];
        for &f in net.around.of(v) {
            let (m, t) = (&self.faces[f as usize], net.triangles[f as usize]);
            let i = if t[0] == v { 0 } else { 1 + (t[1] != v) as usize };
            let (mut along, mut free) = (m.along_r[i], m.free_r[i]);
            for j in (0..3).filter(|&j| j != i) {
                let d = moved(t[j]);
                along -= m.along[PRODUCT[i][j]] * m.normal.dot(d);
                free -= m.free[PRODUCT[i][j]] * d;
            }
            let own = PRODUCT[i][i];
            q.add_plane(m.normal, m.along[own]);
            q.b -= m.normal * along + free;
            [0, 3, 5].into_iter().for_each(|k| q.a[k] += m.free[own]);
        }
        if net.kinds[v as usize] != Kind::Interior {
            for &c in net.curves_at.of(v) {
                let (m, ends) = (&self.curves[c as usize], net.curves[c as usize].0);
                let i = (ends[1] == v) as usize;
                q.b -= m.r[i] - m.products[1] * moved(ends[1 - i]);
                [0, 3, 5].into_iter().for_each(|k| q.a[k] += m.products[2 * i]);
            }
        }
        q
    }
}

/// Moves vertices.
pub(super) struct Solver {
    /// Of the faces before the first sweep.
    normals: Vec<DVec3>,
}

impl Solver {
    pub(super) fn new(net: &Net) -> Self {
        Solver { normals: (0..net.triangles.len()).map(|f| normal(net.corners(f as u32))).collect() }
    }

    /// Moves every vertex that may to where its samples, bound at `net.points`, want it, given the others. `place` rounds a new place, or
    /// forbids it. O(n).
    pub(super) fn solve(
        &self,
        net: &Net,
        moments: &Moments,
        points: &mut [DVec3],
        place: impl Fn(usize, DVec3) -> Option<DVec3>,
    ) {
        let mut ring: Vec<RingFace> = Vec::new();
        for _ in 0..ROUNDS {
            for v in (0..net.points.len()).filter(|&v| net.kinds[v] != Kind::Pinned) {
                let q = moments.quadric(net, points, v as u32);
                let (origin, now) = (net.points[v], points[v] - net.points[v]);
                let Some(d) = q.minimise(now, DAMPING * q.trace() / 3.0) else { continue };
                let value = |d: DVec3| (q.times(d) + 2.0 * q.b).dot(d);
                let least = LEAST_GAIN * q.trace();
                if value(now) - value(d) <= least {
                    continue;
                }
                ring.clear();
                let faces = net.around.of(v as u32);
                ring.extend(faces.iter().map(|&f| ring_face(&net.triangles, points, f, v as u32)));
                let longest = ring.iter().flat_map(|f| [f.x, f.y]).map(|p| p.distance_squared(origin));
                let reach = REACH * longest.fold(0.0, f64::max).sqrt();
                let d = d.clamp_length_max(reach);
                for part in [1.0, 0.5] {
                    let Some(to) = place(v, origin + now + (d - now) * part) else { continue };
                    let gains = value(now) - value(to - origin) > least;
                    let good = |(f, r): (&u32, &RingFace)| r.stays_good(to) && self.turns_little(*f, r, to);
                    if gains && faces.iter().zip(&ring).all(good) {
                        points[v] = to;
                        break;
                    }
                }
            }
        }
    }

    /// Whether face `f` with its apex at `to` looks about the way it did before the first sweep.
    #[inline]
    fn turns_little(&self, f: u32, r: &RingFace, to: DVec3) -> bool {
        let (before, after) = (self.normals[f as usize], normal([to, r.x, r.y]));
        let turn = before.dot(after);
        let lengths = before.length_squared() * after.length_squared();
        lengths == 0.0 || (turn > 0.0 && turn * turn >= MIN_TURN * MIN_TURN * lengths)
    }
}

/// Normal, as long as twice the area.
#[inline]
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

#[cfg(test)]
mod tests {
    use super::super::original::Original;
    use super::super::samples::Samples;
    use super::*;
    use crate::options::Options;
    use crate::work::Work;
    use progmesh_aif::Mesh;

    /// A flat square of 5 x 5 vertices, its middle lifted by `lift` after the samples were taken; where the middle goes in a sweep.
    fn middle_after(lift: f64, place: impl Fn(usize, DVec3) -> Option<DVec3>) -> f64 {
        let points: Vec<[f32; 3]> = (0..25).map(|i| [(i % 5) as f32, (i / 5) as f32, 0.0]).collect();
        let quad = |i: u32| [[i, i + 1, i + 6], [i, i + 6, i + 5]];
        let triangles: Vec<_> = (0..20).filter(|i| i % 5 < 4).flat_map(quad).collect();
        let mut mesh = Mesh::from_triangles(points, &triangles).unwrap();
        let mut work = Work::new(&mut mesh, &Options::default()).unwrap();
        let original = Original::of(&mut work);
        let mut net = Net::new(&work);
        net.points[12].z = lift;
        net.refresh();
        let roots = net.roots(std::mem::take(&mut work.into));
        let mut moments = Moments::new(&net);
        Samples::new(&work, &original, roots, &[]).unwrap().bind(&work, &net, &mut moments);
        let mut moved = net.points.clone();
        Solver::new(&net).solve(&net, &moments, &mut moved, place);
        moved[12].z
    }

    #[test]
    fn a_vertex_off_the_surface_goes_back() {
        let after = middle_after(0.05, |_, p| Some(p));
        assert!(after.abs() < 0.01, "{after}");
    }

    #[test]
    fn a_place_that_is_forbidden_is_not_taken() {
        assert_eq!(middle_after(0.05, |_, _| None), 0.05);
    }
}
