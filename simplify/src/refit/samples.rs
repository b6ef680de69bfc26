//! Samples of the original, and the places of the result they are bound to.

use super::net::Net;
use super::original::{Curve, Original};
use super::solve::Moments;
use crate::measure::triangle::closest;
use crate::parallel::{map_chunks, map_init};
use crate::work::Work;
use glam::DVec3;
use progmesh_aif::NONE;

/// Samples for each triangle of the result. On bunny, horse and fandisk 6 gain half of what 16 do, 32 little more.
const PER_TRIANGLE: f64 = 16.0;
/// Fewest samples of a mesh.
const FEWEST: f64 = 64.0;
/// Samples for each edge of a border or seam of the original.
const PER_CURVE: usize = 4;
/// What the samples of a border weigh for each squared length of its edges, as its planes do in the collapses.
const BORDER_WEIGHT: f64 = 3.0;
/// The same for seams.
const SEAM_WEIGHT: f64 = 1.0;
/// Triangles that are sampled at a time by one thread.
const CHUNK: usize = 2048;
/// Chunks that are under way together, to bound memory.
const BATCH: usize = 64;
/// A sample is bound without another look where its distance is below this part of the way from its place to the sides of the face: only
/// faces folded back by less than 14 degrees could be nearer. Four in five are, once the second sweep begins.
const CLEAR: f64 = 0.25;
/// Most steps of a search from face to face, or along a curve.
const STEPS: usize = 8;

/// A sample and what it is bound to.
pub(super) struct Hit {
    pub(super) face: u32,
    /// Weights of the second and third corner of the place.
    pub(super) v: f64,
    pub(super) w: f64,
    /// From the place to the sample.
    pub(super) r: DVec3,
    pub(super) weight: f64,
}

/// A sample of a curve and what it is bound to.
pub(super) struct CurveHit {
    pub(super) curve: u32,
    /// Weight of the curve's second end.
    pub(super) s: f64,
    pub(super) r: DVec3,
    pub(super) weight: f64,
}

/// How near the samples are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    /// Weighted squared distances of the samples of the surface, summed up.
    surface: f64,
    /// Of the curves.
    curves: f64,
}

impl Fit {
    /// Nearer in all, and the surface by itself not farther.
    pub(super) fn is_better_than(&self, o: &Fit) -> bool {
        self.surface + self.curves < o.surface + o.curves && self.surface <= o.surface
    }
}

/// A run of triangles of the original and the samples on it, which are the `first`, `first + 1`, ... of all.
struct Chunk {
    triangles: std::ops::Range<usize>,
    /// Area of all triangles before.
    area: f64,
    first: usize,
    end: usize,
    /// The face each was last bound to.
    faces: Vec<u32>,
}

/// All samples. Only where they were bound last is kept; the rest is found again when it is needed.
pub(super) struct Samples<'a> {
    original: &'a Original,
    /// The vertex of the result that each vertex of the original went into.
    roots: Vec<u32>,
    weights: &'a [f32],
    chunks: Vec<Chunk>,
    /// Area that a sample stands for.
    step: f64,
    /// The curves that samples of each curve of the original were last bound to.
    curves: Vec<[u32; PER_CURVE]>,
}

impl<'a> Samples<'a> {
    /// Distributes the samples; `None` if the original has no area. O(n).
    pub(super) fn new(
        work: &Work<'_>,
        original: &'a Original,
        roots: Vec<u32>,
        weights: &'a [f32],
    ) -> Option<Self> {
        let all = &original.triangles;
        let count = all.len().div_ceil(CHUNK);
        let range = |i: usize| i * CHUNK..((i + 1) * CHUNK).min(all.len());
        let areas = map_init(count, || (), |(), i| all[range(i)].iter().map(|t| area(work, t)).sum::<f64>());
        let total: f64 = areas.iter().sum();
        let n = (PER_TRIANGLE * work.triangles as f64).max(FEWEST);
        let step = total / n;
        if !(step > 0.0 && step.is_finite()) {
            return None;
        }
        // Sample k lies at area (k + 1/2) step.
        let at = |area: f64| ((area / step - 0.5).ceil().max(0.0) as usize).min(n as usize);
        let mut before = 0.0;
        let chunk = |(i, a): (usize, &f64)| {
            let start = before;
            before += a;
            Chunk { triangles: range(i), area: start, first: at(start), end: at(before), faces: Vec::new() }
        };
        let chunks = areas.iter().enumerate().map(chunk).collect();
        let curves = vec![[NONE; PER_CURVE]; original.curves.len()];
        Some(Samples { original, roots, weights, chunks, step, curves })
    }

    /// Binds every sample to the result as it is now, and sums up what it asks of the vertices. O(samples).
    pub(super) fn bind(&mut self, work: &Work<'_>, net: &Net, moments: &mut Moments) -> Fit {
        moments.clear(net);
        let mut fit = Fit { surface: 0.0, curves: 0.0 };
        let mut chunks = std::mem::take(&mut self.chunks);
        for batch in chunks.chunks_mut(BATCH) {
            let bind = |c: &mut [Chunk]| c.first_mut().map(|c| self.bind_chunk(work, net, c));
            for hit in map_chunks(batch, 1, bind).iter().flatten().flatten() {
                fit.surface += hit.weight * hit.r.length_squared();
                moments.add(hit);
            }
        }
        self.chunks = chunks;
        let mut curves = std::mem::take(&mut self.curves);
        for (curve, last) in self.original.curves.iter().zip(&mut curves) {
            for (i, last) in last.iter_mut().enumerate() {
                if let Some(hit) = self.bind_to_curve(work, net, curve, i, last) {
                    fit.curves += hit.weight * hit.r.length_squared();
                    moments.add_to_curve(&hit);
                }
            }
        }
        self.curves = curves;
        fit
    }

    /// The samples of a chunk that find a face.
    fn bind_chunk(&self, work: &Work<'_>, net: &Net, c: &mut Chunk) -> Vec<Hit> {
        c.faces.resize(c.end - c.first, NONE);
        let mut hits = Vec::with_capacity(c.faces.len());
        let (mut k, mut upto) = (c.first, c.area);
        for i in c.triangles.clone() {
            let t = &self.original.triangles[i];
            upto += area(work, t);
            // Sums are rounded: the last triangle takes what is left over.
            let last = i + 1 == c.triangles.end;
            while k < c.end && (last || (k as f64 + 0.5) * self.step < upto) {
                hits.extend(self.bind_one(work, net, t, k, &mut c.faces[k - c.first]));
                k += 1;
            }
        }
        hits
    }

    /// Sample `k`, on triangle `t`.
    #[inline]
    fn bind_one(&self, work: &Work<'_>, net: &Net, t: &[u32; 3], k: usize, face: &mut u32) -> Option<Hit> {
        let weights = spread(k);
        let [a, b, c] = t.map(|v| place(work, v));
        let p = a * weights[0] + b * weights[1] + c * weights[2];
        let mut near = Search { p, d2: f64::INFINITY, distance: f64::INFINITY, face: NONE, v: 0.0, w: 0.0 };
        if *face == NONE {
            // From the vertex that the nearest corner went into; from another's where that is a hub.
            let mut order = [0, 1, 2];
            order.sort_by(|&i: &usize, &j| weights[j].total_cmp(&weights[i]));
            let root = order.iter().map(|&i| self.roots[t[i] as usize]).find(|&r| r != NONE)?;
            net.around.of(root).iter().for_each(|&g| near.look(net, g));
        } else {
            near.look(net, *face);
        }
        for _ in 0..STEPS {
            let from = near.face;
            if from == NONE || near.is_clear(net) {
                break;
            }
            net.beside.of(from).iter().for_each(|&g| near.look(net, g));
            if near.face == from {
                break;
            }
        }
        let Search { face: f, v, w, .. } = near;
        if f == NONE {
            return None;
        }
        *face = f;
        let [x, y, z] = net.corners(f);
        let r = p - (x + (y - x) * v + (z - x) * w);
        let weight = match self.weights {
            [] => 1.0,
            all => (0..3).map(|i| weights[i] * all[t[i] as usize] as f64).sum(),
        };
        Some(Hit { face: f, v, w, r, weight })
    }

    /// Sample `i` of a curve.
    fn bind_to_curve(
        &self,
        work: &Work<'_>,
        net: &Net,
        curve: &Curve,
        i: usize,
        last: &mut u32,
    ) -> Option<CurveHit> {
        let [a, b] = curve.ends.map(|v| place(work, v));
        let along = (i as f64 + 0.5) / PER_CURVE as f64;
        let p = a.lerp(b, along);
        let (mut best, mut found) = (f64::INFINITY, (*last, 0.0));
        let mut todo = match *last {
            NONE => {
                let root = self.roots[curve.ends[(along > 0.5) as usize] as usize];
                if root == NONE {
                    return None;
                }
                [root; 2]
            }
            c => net.curves[c as usize].0,
        };
        for _ in 0..STEPS {
            let from = found.0;
            for &c in todo.iter().flat_map(|&v| net.curves_at.of(v)) {
                let (ends, border) = net.curves[c as usize];
                if border != curve.border {
                    continue;
                }
                let [x, y] = ends.map(|v| net.points[v as usize]);
                let side = y - x;
                let length = side.length_squared();
                let s = if length > 0.0 { ((p - x).dot(side) / length).clamp(0.0, 1.0) } else { 0.0 };
                let d2 = (x + side * s).distance_squared(p);
                if d2 < best {
                    best = d2;
                    found = (c, s);
                }
            }
            if found.0 == from || found.0 == NONE {
                break;
            }
            todo = net.curves[found.0 as usize].0;
        }
        if !best.is_finite() {
            return None;
        }
        let (c, s) = found;
        *last = c;
        let [x, y] = net.curves[c as usize].0.map(|v| net.points[v as usize]);
        let k = if curve.border { BORDER_WEIGHT } else { SEAM_WEIGHT };
        let mean = match self.weights {
            [] => 1.0,
            all => curve.ends.iter().map(|&v| 0.5 * all[v as usize] as f64).sum(),
        };
        let weight = mean * k * a.distance_squared(b) / (PER_CURVE as f64 * self.step);
        Some(CurveHit { curve: c, s, r: p - x.lerp(y, s), weight })
    }
}

/// The nearest face so far.
struct Search {
    p: DVec3,
    d2: f64,
    distance: f64,
    face: u32,
    v: f64,
    w: f64,
}

impl Search {
    #[inline]
    fn look(&mut self, net: &Net, g: u32) {
        if !net.cells[g as usize].may_be_nearer(self.p, self.distance, self.d2) {
            return;
        }
        let foot = closest(net.corners(g), self.p);
        if foot.d2 < self.d2 {
            *self =
                Search { p: self.p, d2: foot.d2, distance: foot.d2.sqrt(), face: g, v: foot.v, w: foot.w };
        }
    }

    /// Whether a nearer face is out of the question (see [`CLEAR`]).
    #[inline]
    fn is_clear(&self, net: &Net) -> bool {
        let least = self.v.min(self.w).min(1.0 - self.v - self.w);
        self.distance < CLEAR * least * net.heights[self.face as usize]
    }
}

/// Where a vertex of the original was, local frame: the mesh keeps old places until the work is written back.
#[inline]
fn place(work: &Work<'_>, v: u32) -> DVec3 {
    work.to_local(work.mesh.positions().get(v as usize))
}

#[inline]
fn area(work: &Work<'_>, t: &[u32; 3]) -> f64 {
    let [a, b, c] = t.map(|v| place(work, v));
    0.5 * (b - a).cross(c - a).length()
}

/// Weights of the corners for sample `k`: consecutive ones fill a triangle evenly (the additive sequence of the plastic number, Roberts 2018).
#[inline]
fn spread(k: usize) -> [f64; 3] {
    let k = k as f64 + 1.0;
    let (u, v) = ((0.5 + k * 0.754_877_666_246_692_7).fract(), (0.5 + k * 0.569_840_290_998_053_3).fract());
    let (x, y) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    [1.0 - x - y, x, y]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Options;
    use progmesh_aif::Mesh;
    use progmesh_meshes::{GenerateOptions, generate};

    fn ball() -> Mesh {
        let s = generate("sphere", &GenerateOptions::default().with_faces(500)).unwrap();
        let triangles: Vec<[u32; 3]> = s.corners.chunks(3).map(|c| [c[0], c[1], c[2]]).collect();
        let points: Vec<[f32; 3]> = s.positions.iter().map(|p| p.map(|x| x as f32)).collect();
        Mesh::from_triangles(points, &triangles).unwrap()
    }

    /// All samples of the ball, bound to the ball with its points changed.
    fn bound(change: impl Fn(usize, DVec3) -> DVec3) -> (Net, Vec<Hit>, f64) {
        let mut mesh = ball();
        let mut work = Work::new(&mut mesh, &Options::default()).unwrap();
        let original = Original::of(&mut work);
        let mut net = Net::new(&work);
        net.points.iter_mut().enumerate().for_each(|(i, p)| *p = change(i, *p));
        net.refresh();
        let roots = net.roots(std::mem::take(&mut work.into));
        let samples = Samples::new(&work, &original, roots, &[]).unwrap();
        let mut chunks = samples.chunks.iter().map(|c| Chunk {
            triangles: c.triangles.clone(),
            area: c.area,
            first: c.first,
            end: c.end,
            faces: Vec::new(),
        });
        let hits = chunks.by_ref().flat_map(|mut c| samples.bind_chunk(&work, &net, &mut c)).collect();
        (net, hits, PER_TRIANGLE * work.triangles as f64)
    }

    #[test]
    fn samples_of_a_surface_lie_on_it_evenly() {
        let (net, hits, count) = bound(|_, p| p);
        assert_eq!(hits.len() as f64, count);
        assert!(hits.iter().all(|h| h.r.length() < 1e-12 && h.weight == 1.0));
        let mut of_face = vec![0; net.triangles.len()];
        hits.iter().for_each(|h| of_face[h.face as usize] += 1);
        assert!(of_face.iter().all(|n| (4..40).contains(n)), "{of_face:?}");
    }

    #[test]
    fn a_sample_is_bound_to_the_nearest_face_of_all() {
        let (net, hits, _) = bound(|i, p| {
            let wobble = DVec3::new((i * 7 % 5) as f64, (i * 11 % 7) as f64, (i * 13 % 3) as f64);
            p + (wobble - 2.0) * 0.004
        });
        let mut wrong = 0;
        for h in &hits {
            let [a, b, c] = net.corners(h.face);
            let p = a + (b - a) * h.v + (c - a) * h.w + h.r;
            let least = (0..net.triangles.len() as u32).map(|f| closest(net.corners(f), p).d2);
            let least = least.fold(f64::INFINITY, f64::min).sqrt();
            assert!(h.r.length() >= least - 1e-12);
            wrong += (h.r.length() > least + 1e-12) as usize;
        }
        assert!(wrong * 100 <= hits.len(), "{wrong} of {}", hits.len());
    }
}
