//! Errors of splits by the ring rule ([`super::rings`]), from one walk from the finest mesh to the base.
//!
//! Samples of the finest mesh, its vertices and quarters of its edges, lie on faces of the mesh; and from the collapse on that moves a vertex, the place under that vertex. When a split is undone, those on the two rings that go are put to the nearest places on the one that
//! comes. By the ring rule every mesh of the hierarchy has a sample where this walk had it after some collapse that the mesh has undone, so the largest distance that a collapse
//! leads to bounds what can be seen where it is undone. That holds for samples one and all, as long as they are followed; where a face has many, some are left out.

use super::bounds::Bounds;
use super::deviation::keep_farthest;
use super::directions::Body;
use super::forest::Forest;
use super::spheres::{self, Extent};
use super::{Finest, Options};
use crate::aif::NONE;
use crate::progressive::ProgressiveMesh;
use crate::selective::Front;
use crate::simplify::measure::closest_on_triangle;
use crate::view::NormalCone;
use glam::DVec3;

/// Samples a face where only an order of the splits is asked for.
const FEW: usize = 4;

/// Which samples to follow.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Effort {
    /// Vertices, some: for an order of the splits.
    Vertices,
    /// All.
    Full,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Vertex,
    /// Under a vertex that a collapse has moved.
    Under,
    Middle,
    Quarter,
}

struct Sample {
    at: DVec3,
    next: u32,
    /// Its distance when it was last put somewhere.
    distance: f32,
    kind: Kind,
    /// A vertex; of others the finest faces beside it.
    of: [u32; 2],
}

/// A triangle in a sphere.
struct Reach {
    corners: [DVec3; 3],
    middle: DVec3,
    radius: f64,
}

impl Reach {
    fn of(corners: [DVec3; 3]) -> Reach {
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius = corners.iter().map(|c| c.distance_squared(middle)).fold(0.0, f64::max).sqrt();
        Reach { corners, middle, radius: radius * (1.0 + 1e-9) }
    }
}

struct Walk<'a> {
    pm: &'a ProgressiveMesh,
    forest: &'a Forest,
    finest: &'a Finest,
    front: Front,
    samples: Vec<Sample>,
    /// Samples a face that are kept.
    most: usize,
    /// The first sample on the face in each slot.
    first: Vec<u32>,
    /// Where vertices are now.
    positions: Vec<DVec3>,
    /// Normals of the finest faces, of unit length or 0.
    normals: Vec<DVec3>,
    cones: Vec<Option<NormalCone>>,
    around: Around,
    effort: Effort,
    loose: Vec<u32>,
    star: Vec<u32>,
    ways: Vec<DVec3>,
}

/// The finest faces around every vertex.
struct Around {
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl Around {
    fn new(finest: &Finest) -> Around {
        let mut starts = vec![0u32; finest.positions.len() + 1];
        let full = |f: &&[u32; 3]| f[0] != f[1];
        finest.corners.iter().filter(full).flatten().for_each(|&v| starts[v as usize + 1] += 1);
        for v in 1..starts.len() {
            starts[v] += starts[v - 1];
        }
        let mut at = starts.clone();
        let mut faces = vec![0; 3 * finest.corners.len()];
        for (f, corners) in (0u32..).zip(&finest.corners).filter(|(_, f)| full(f)) {
            for &v in corners {
                faces[at[v as usize] as usize] = f;
                at[v as usize] += 1;
            }
        }
        Around { starts, faces }
    }

    fn of(&self, v: u32) -> &[u32] {
        &self.faces[self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize]
    }
}

/// The bounds of all splits. `front` is at full detail, and the order of the splits that of the rule. O(n log n) for meshes whose hierarchy is as deep.
pub(super) fn measure(pm: &ProgressiveMesh, forest: &Forest, front: Front, options: &Options) -> Bounds {
    let finest = Finest::new(pm, forest, &front);
    let mut bodies = options.directions.then(|| vec![Body::default(); forest.len()]);
    let effort = (Effort::Full, options.samples);
    let (errors, extents) = walk(pm, forest, front, &finest, effort, bodies.as_deref_mut());
    let mut bounds = spheres::around(pm, forest, &finest, &extents);
    let margin = options.margin.max(1.0);
    bounds.set_errors(forest, errors.into_iter().map(|e| e * margin).collect());
    if let Some(bodies) = bodies {
        bounds.set_directions(forest, bodies.into_iter().map(|b| b.scaled(margin)).collect());
    }
    bounds
}

/// Errors that put the splits into an order, and the diagonal of the mesh's box.
pub(super) fn estimate(
    pm: &ProgressiveMesh,
    forest: &Forest,
    front: Front,
    options: &Options,
) -> (Vec<f64>, f64) {
    let finest = Finest::new(pm, forest, &front);
    let effort = (Effort::Vertices, options.samples.min(FEW));
    (walk(pm, forest, front, &finest, effort, None).0, finest.diagonal)
}

/// For every split the largest distance that undoing it leads to, and how far the samples reach that it moves; if asked for, bodies of the ways from samples to where they are put.
fn walk(
    pm: &ProgressiveMesh,
    forest: &Forest,
    front: Front,
    finest: &Finest,
    effort: (Effort, usize),
    mut bodies: Option<&mut [Body]>,
) -> (Vec<f64>, Vec<Extent>) {
    let mut walk = Walk::new(pm, forest, front, finest, effort);
    let mut errors = vec![0.0; forest.len()];
    let mut extents = vec![Extent::default(); forest.len()];
    for i in (0..forest.len() as u32).rev() {
        let body = bodies.as_deref_mut().map(|b| &mut b[i as usize]);
        errors[i as usize] = walk.undo(i, &mut extents[i as usize], body);
    }
    (errors, extents)
}

impl<'a> Walk<'a> {
    fn new(
        pm: &'a ProgressiveMesh,
        forest: &'a Forest,
        front: Front,
        finest: &'a Finest,
        (effort, most): (Effort, usize),
    ) -> Self {
        let Finest { positions, corners, .. } = finest;
        let mut samples: Vec<Sample> = Vec::with_capacity(12 * positions.len());
        let mut first = vec![NONE; corners.len()];
        let mut seen = vec![false; positions.len()];
        for (slot, f) in corners.iter().enumerate().filter(|(_, f)| f[0] != f[1]) {
            let mut add = |at: DVec3, of: [u32; 2], kind: Kind| {
                samples.push(Sample { at, of, next: first[slot], distance: 0.0, kind });
                first[slot] = (samples.len() - 1) as u32;
            };
            if effort == Effort::Full {
                let middle = f.iter().map(|&v| positions[v as usize]).sum::<DVec3>() / 3.0;
                add(middle, [slot as u32; 2], Kind::Middle);
            }
            for k in 0..3 {
                let (a, b) = (f[k], f[(k + 1) % 3]);
                if !std::mem::replace(&mut seen[a as usize], true) {
                    add(positions[a as usize], [a, a], Kind::Vertex);
                }
                let across = front.across(slot as u32, k);
                // Once an edge, by the face in the lower slot.
                if effort == Effort::Full && across.is_none_or(|o| slot as u32 <= o) {
                    let (p, q) = (positions[a as usize], positions[b as usize]);
                    let of = [slot as u32, across.unwrap_or(slot as u32)];
                    add(p.lerp(q, 0.5), of, Kind::Middle);
                    add(p.lerp(q, 0.25), of, Kind::Quarter);
                    add(p.lerp(q, 0.75), of, Kind::Quarter);
                }
            }
        }
        let corner = |f: &[u32; 3], k: usize| positions[f[k] as usize];
        let normal = |f: &[u32; 3]| (corner(f, 1) - corner(f, 0)).cross(corner(f, 2) - corner(f, 0));
        Walk {
            pm,
            forest,
            finest,
            samples,
            most,
            first,
            positions: positions.clone(),
            normals: corners.iter().map(|f| normal(f).normalize_or_zero()).collect(),
            cones: spheres::vertex_cones(finest),
            around: Around::new(finest),
            effort,
            front,
            loose: Vec::new(),
            star: Vec::new(),
            ways: Vec::new(),
        }
    }

    /// Undoes a split; returns the largest distance of a sample that it moves.
    fn undo(&mut self, i: u32, extent: &mut Extent, body: Option<&mut Body>) -> f64 {
        let k = i as usize;
        let vs = self.pm.splits.vertex[k] as usize;
        let mut star = std::mem::take(&mut self.star);
        let mut loose = std::mem::take(&mut self.loose);
        star.clear();
        loose.clear();
        for h in self.front.middle(self.pm, i) {
            self.front.star(h, &mut star);
        }
        for &slot in &star {
            let mut s = std::mem::replace(&mut self.first[slot as usize], NONE);
            while s != NONE {
                loose.push(s);
                s = self.samples[s as usize].next;
            }
        }
        let beside = self.front.beside(self.pm, i);
        self.front.unsplit(self.pm, self.forest, i);
        let own = self.forest.place_before(self.pm, vs as u32, i) - self.finest.origin;
        self.positions[vs] = own;
        star.clear();
        if let Some(h) = beside {
            self.front.star(h, &mut star);
        }
        if self.effort == Effort::Full && self.pm.splits.code[k].moves() {
            loose.extend(self.under(own, &loose));
        }
        self.thin(&mut loose, star.len());
        let at = |w: u32| self.positions[self.front.wedge_vertex(w) as usize];
        let triangles: Vec<Reach> =
            star.iter().map(|&s| Reach::of(self.front.corners()[s as usize].map(at))).collect();
        let mut error = 0.0f64;
        let mut ways = std::mem::take(&mut self.ways);
        ways.clear();
        for &s in &loose {
            let sample = &mut self.samples[s as usize];
            let (d, on) = nearest(sample.at, &triangles);
            let Some(&slot) = star.get(on) else { continue };
            sample.next = std::mem::replace(&mut self.first[slot as usize], s);
            sample.distance = d as f32;
            error = error.max(d);
            if d > 0.0 {
                if body.is_some() {
                    let t = triangles[on].corners;
                    let w = closest_on_triangle(t, sample.at).0;
                    ways.push(t[0] * w[0] + t[1] * w[1] + t[2] * w[2] - sample.at);
                }
                extent.reach(own.distance(sample.at));
                match (sample.kind, sample.of) {
                    (Kind::Vertex, [v, _]) => self.cones[v as usize].iter().for_each(|c| extent.turn(c)),
                    (_, faces) => faces.iter().for_each(|&f| extent.face(self.normals[f as usize])),
                }
            }
        }
        if let Some(body) = body {
            let normal = |t: &Reach| (t.corners[1] - t.corners[0]).cross(t.corners[2] - t.corners[0]);
            *body = Body::around(&ways, triangles.iter().map(normal).sum());
        }
        (self.star, self.loose, self.ways) = (star, loose, ways);
        error
    }

    /// A new sample where the finest mesh is nearest to a vertex that has moved to `p`, as far as those around tell: there the distance has a peak, which others may miss.
    fn under(&mut self, p: DVec3, loose: &[u32]) -> Option<u32> {
        let off = |s: u32| self.samples[s as usize].at.distance_squared(p);
        let near = loose.iter().copied().min_by(|&a, &b| off(a).total_cmp(&off(b)))?;
        let sample = &self.samples[near as usize];
        let faces = if sample.kind == Kind::Vertex { self.around.of(sample.of[0]) } else { &sample.of[..] };
        let place = |f: u32| {
            let t = self.finest.corners[f as usize].map(|v| self.finest.positions[v as usize]);
            let (w, d2) = closest_on_triangle(t, p);
            (d2, f, t[0] * w[0] + t[1] * w[1] + t[2] * w[2], w)
        };
        let (_, face, at, w) = faces.iter().map(|&f| place(f)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        // Not beside a vertex, which is followed.
        if w.iter().any(|&w| w > 0.95) {
            return None;
        }
        self.samples.push(Sample { at, next: NONE, distance: 0.0, kind: Kind::Under, of: [face; 2] });
        Some(self.samples.len() as u32 - 1)
    }

    /// Leaves out samples of a star with many: quarters of edges, then middles, as there are enough vertices for it by then; then vertices: half of those kept are the farthest, the others
    /// spread.
    fn thin(&self, loose: &mut Vec<u32>, faces: usize) {
        let of = |s: u32| &self.samples[s as usize];
        for kind in [Kind::Quarter, Kind::Middle, Kind::Under] {
            if loose.len() > self.most.saturating_mul(5 * faces) / 6 {
                loose.retain(|&s| of(s).kind < kind);
            }
        }
        let keep = self.most.saturating_mul(faces);
        keep_farthest(loose, keep, |s| of(s).distance);
    }
}

/// The distance from `p` to the nearest of the triangles, and which it is.
fn nearest(p: DVec3, triangles: &[Reach]) -> (f64, usize) {
    let off = |t: &Reach| t.middle.distance_squared(p);
    // The one whose middle is nearest first: it rules most others out.
    let first = (0..triangles.len()).min_by(|&a, &b| off(&triangles[a]).total_cmp(&off(&triangles[b])));
    let Some(first) = first else { return (0.0, usize::MAX) };
    let mut best = closest_on_triangle(triangles[first].corners, p).1;
    let (mut on, mut root) = (first, best.sqrt());
    for (k, t) in triangles.iter().enumerate() {
        let reach = t.radius + root;
        if k == first || off(t) > reach * reach {
            continue;
        }
        let d2 = closest_on_triangle(t.corners, p).1;
        if d2 < best {
            (best, on, root) = (d2, k, d2.sqrt());
        }
    }
    (root, on)
}
