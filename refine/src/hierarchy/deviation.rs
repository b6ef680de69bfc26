//! Errors of all splits by the rule of cuts, from walks from the finest mesh to the base.
//!
//! Samples of the finest mesh, its vertices and quarters of its edges, lie in buckets of the faces that are nearest to them. When a split is
//! undone, the samples around it look for their nearest face again: among those around the vertex, and from there from face to face. What is
//! found is a distance to some face, so never below the true one.

use super::bounds::Bounds;
use super::forest::Forest;
use super::nearest::Reach;
use super::{Finest, Options, spheres};
use crate::aif::NONE;
use crate::progressive::ProgressiveMesh;
use crate::selective::Front;
use crate::simplify::measure::closest_on_triangle;
use glam::DVec3;

/// Faces that a sample walks over at most, beyond the star it lay on.
const WALK: usize = 32;

struct Sample {
    at: DVec3,
    /// The vertices of its edge; a vertex has itself twice.
    owners: [u32; 2],
    next: u32,
    /// Its distance when it was last looked for.
    distance: f32,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Vertex,
    Middle,
    Quarter,
}

struct Walk<'a> {
    pm: &'a ProgressiveMesh,
    forest: &'a Forest,
    front: Front,
    samples: Vec<Sample>,
    /// Samples a face that are kept.
    most: usize,
    /// The first sample on the face in each slot.
    first: Vec<u32>,
    /// For every vertex the one it has gone into, to be followed.
    into: Vec<u32>,
    /// For every vertex the last split undone at it: the candidate of its node.
    candidate: Vec<u32>,
    error: Vec<f64>,
    positions: Vec<DVec3>,
}

/// Bounds of all splits; `front` is at full detail. A few walks of O(n log n), for meshes whose hierarchy is as deep.
pub(super) fn measure(pm: &ProgressiveMesh, forest: &Forest, front: &Front, options: &Options) -> Bounds {
    let n = forest.len();
    let finest = Finest::new(pm, forest, front);
    let mut bounds = spheres::around(pm, forest, &finest, &[]);
    let Finest { positions, corners, origin, diagonal } = finest;
    let mut error = vec![0.0; n];
    // In the order of the splits; then as cuts of equal error follow on each other; then with neighbours at other levels.
    let walk = |order: &mut dyn Iterator<Item = u32>, error: Vec<f64>| {
        let mut walk = Walk::new(pm, forest, front.clone(), (&positions, &corners), options.samples, error);
        order.for_each(|i| walk.undo(i, origin));
        walk.error
    };
    error = walk(&mut (0..n as u32).rev(), error);
    for round in 0..options.rounds {
        let cell = diagonal / [f64::INFINITY, 6.0, 17.0][round as usize % 3];
        let weight = |i: u32| {
            let p = forest.place_before(pm, pm.splits.vertex[i as usize], i) - origin;
            let k = (p / cell.max(f64::MIN_POSITIVE)).floor();
            // Every other cell, like the fields of a chess board, is as if it were out of view.
            let odd = (k.x + k.y + k.z).rem_euclid(2.0) == 1.0;
            if cell.is_finite() && odd == (round % 2 == 0) { FAR } else { 1.0 }
        };
        error = walk(&mut by_error(forest, |i| error[i as usize] * weight(i)).into_iter(), error);
    }
    // What was raised in one order, is raised in the hierarchy.
    let margin = options.margin.max(1.0);
    bounds.set_errors(forest, error.into_iter().map(|e| e * margin).collect());
    bounds
}

/// What errors out of view count in a walk.
const FAR: f64 = 1.0 / 64.0;

/// All splits in an order in which they can be undone: those of the least errors first, and what depends on a split before it.
fn by_error(forest: &Forest, error: impl Fn(u32) -> f64) -> Vec<u32> {
    let n = forest.len() as u32;
    let mut least: Vec<f64> = (0..n).map(error).collect();
    for i in (0..n).rev() {
        let e = least[i as usize];
        for d in forest.needs.of(i).iter() {
            let up = &mut least[d as usize];
            *up = up.max(e);
        }
    }
    let mut order: Vec<u32> = (0..n).rev().collect();
    // Stable: of equal ones the later split goes first.
    order.sort_by(|&a, &b| least[a as usize].total_cmp(&least[b as usize]));
    order
}

impl<'a> Walk<'a> {
    fn new(
        pm: &'a ProgressiveMesh,
        forest: &'a Forest,
        front: Front,
        (positions, corners): (&[DVec3], &[[u32; 3]]),
        most: usize,
        error: Vec<f64>,
    ) -> Self {
        let mut samples: Vec<Sample> = Vec::with_capacity(10 * positions.len());
        let mut first = vec![NONE; corners.len()];
        let mut seen = vec![false; positions.len()];
        for (slot, f) in corners.iter().enumerate().filter(|(_, f)| f[0] != f[1]) {
            let mut add = |at: DVec3, owners: [u32; 2], kind: Kind| {
                samples.push(Sample { at, owners, next: first[slot], distance: 0.0, kind });
                first[slot] = (samples.len() - 1) as u32;
            };
            for k in 0..3 {
                let (a, b) = (f[k], f[(k + 1) % 3]);
                if !std::mem::replace(&mut seen[a as usize], true) {
                    add(positions[a as usize], [a, a], Kind::Vertex);
                }
                // Once an edge, by the face in the lower slot.
                if front.across(slot as u32, k).is_none_or(|o| slot as u32 <= o) {
                    let (p, q) = (positions[a as usize], positions[b as usize]);
                    add(p.lerp(q, 0.5), [a, b], Kind::Middle);
                    add(p.lerp(q, 0.25), [a, b], Kind::Quarter);
                    add(p.lerp(q, 0.75), [a, b], Kind::Quarter);
                }
            }
        }
        Walk {
            pm,
            forest,
            samples,
            most,
            first,
            into: (0..positions.len() as u32).collect(),
            candidate: vec![NONE; positions.len()],
            error,
            positions: positions.to_vec(),
            front,
        }
    }

    /// The vertex that `v` has gone into.
    fn holder(&mut self, mut v: u32) -> u32 {
        while self.into[v as usize] != v {
            let up = self.into[v as usize];
            self.into[v as usize] = self.into[up as usize];
            v = up;
        }
        v
    }

    fn triangle(&self, slot: u32) -> [DVec3; 3] {
        self.front.corners()[slot as usize].map(|w| self.positions[self.front.wedge_vertex(w) as usize])
    }

    fn undo(&mut self, i: u32, origin: DVec3) {
        let k = i as usize;
        let (vs, vu) = (self.pm.splits.vertex[k], self.forest.base_vertices + i);
        let mut star = Vec::with_capacity(16);
        let [old, new] = self.front.middle(self.pm, i);
        self.front.star(old, &mut star);
        self.front.star(new, &mut star);
        let beside = self.front.beside(self.pm, i);
        let mut loose = Vec::with_capacity(64);
        for slot in star {
            let mut s = std::mem::replace(&mut self.first[slot as usize], NONE);
            while s != NONE {
                loose.push(s);
                s = self.samples[s as usize].next;
            }
        }
        self.front.unsplit(self.pm, self.forest, i);
        self.positions[vs as usize] = self.forest.place_before(self.pm, vs, i) - origin;
        self.into[vu as usize] = vs;
        let below = [self.candidate[vs as usize], self.candidate[vu as usize]];
        self.candidate[vs as usize] = i;
        let below = below.into_iter().filter(|&b| b != NONE);
        self.error[k] = below.map(|b| self.error[b as usize]).fold(self.error[k], f64::max);
        let mut star = Vec::with_capacity(16);
        if let Some(h) = beside {
            self.front.star(h, &mut star);
        }
        self.thin(&mut loose, star.len());
        let triangles: Vec<Reach> = star.iter().map(|&s| Reach::of(self.triangle(s))).collect();
        for s in loose {
            self.place(s, vs, &star, &triangles);
        }
    }

    /// Leaves out samples of a star with many: quarters of edges, then middles, as there are enough vertices for it by then; then vertices: half of those kept are the farthest, the others
    /// spread.
    fn thin(&self, loose: &mut Vec<u32>, faces: usize) {
        let of = |s: u32| &self.samples[s as usize];
        for kind in [Kind::Quarter, Kind::Middle] {
            if loose.len() > self.most.saturating_mul(5 * faces) / 6 {
                loose.retain(|&s| of(s).kind < kind);
            }
        }
        let keep = self.most.saturating_mul(faces);
        keep_farthest(loose, keep, |s| of(s).distance);
    }

    /// Puts a sample on its nearest face, and raises the error of who answers for it.
    fn place(&mut self, s: u32, vs: u32, star: &[u32], triangles: &[Reach]) {
        let p = self.samples[s as usize].at;
        let (mut best, mut slot, mut weights) = (f64::INFINITY, NONE, [0.0; 3]);
        // The one whose middle is nearest first: it rules most others out.
        let off: Vec<f64> = triangles.iter().map(|t| t.middle.distance_squared(p)).collect();
        let nearest = (0..off.len()).min_by(|&a, &b| off[a].total_cmp(&off[b]));
        for k in nearest.into_iter().chain(0..off.len()) {
            let reach = triangles[k].radius + best.sqrt();
            if off[k] > reach * reach {
                continue;
            }
            let (w, d2) = closest_on_triangle(triangles[k].corners, p);
            if d2 < best {
                (best, slot, weights) = (d2, star[k], w);
            }
        }
        // Beyond the star, while that is nearer.
        for _ in 0..WALK {
            let mut found = None;
            for k in 0..3 {
                // On the edge from corner k to the next the weight of the third is 0.
                if weights[(k + 2) % 3] > 1e-9 {
                    continue;
                }
                let Some(f) = self.front.across(slot, k).filter(|f| !star.contains(f)) else { continue };
                let (w, d2) = closest_on_triangle(self.triangle(f), p);
                if d2 < best {
                    (best, found) = (d2, Some((f, w)));
                }
            }
            let Some((f, w)) = found else { break };
            (slot, weights) = (f, w);
        }
        if slot == NONE {
            return;
        }
        self.samples[s as usize].next = std::mem::replace(&mut self.first[slot as usize], s);
        let d = best.sqrt();
        self.samples[s as usize].distance = d as f32;
        let owners = self.samples[s as usize].owners.map(|v| self.holder(v));
        let error = |w: &Self, v: u32| match w.candidate[v as usize] {
            NONE => None,
            c => Some(w.error[c as usize]),
        };
        let [a, b] = owners;
        let answers = match (error(self, a), error(self, b)) {
            (Some(x), Some(y)) if x.max(y) >= d => return,
            (Some(_), Some(_)) if a == vs || b == vs => vs,
            (Some(x), Some(y)) => {
                if x >= y {
                    a
                } else {
                    b
                }
            }
            (Some(_), None) => a,
            (None, Some(_)) => b,
            // Its edge is whole: it lies on it.
            (None, None) => return,
        };
        let c = self.candidate[answers as usize] as usize;
        self.error[c] = self.error[c].max(d);
    }
}

/// Leaves of samples as many as are to be kept: half of these are the farthest, the others spread.
pub(super) fn keep_farthest(loose: &mut Vec<u32>, keep: usize, distance: impl Fn(u32) -> f32) {
    if loose.len() <= keep || keep == 0 {
        return;
    }
    let far = keep / 2;
    loose.select_nth_unstable_by(far, |&a, &b| distance(b).total_cmp(&distance(a)).then(a.cmp(&b)));
    // Those that are left of the order they were in lie about in no order at all.
    let rest = loose.split_off(far);
    let each = rest.len().div_ceil(keep - far);
    loose.extend(rest.into_iter().step_by(each));
}
