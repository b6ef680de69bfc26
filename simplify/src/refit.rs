//! Vertex refit: after the last collapse, vertices move to where the surface between them lies closest to the original.
//!
//! The original surface is sampled, evenly by area. Each sample is bound to the nearest face of the result, which is found through the
//! collapses: every vertex of the original knows the one it went into, so the search begins in that ring and walks on from face
//! to face; there is no tree. Then every vertex in turn goes to the least-squares place for the samples on its faces (Gauss-Seidel on
//! the system of Hoppe et al. 1993, with distances along normals where a sample lies over a face, as in point-to-plane
//! registration). A sweep is both. Only the way from the original to the result is measured: samples of the result, bound
//! to the original, were tried too and gain nothing.
//!
//! What stays: topology; pinned vertices; the guards of [`crate::validity`] at every step, and no face turns by more than they allow in
//! all sweeps together; the error bound, if there is one, by the quadrics the collapses left. A border or seam is drawn by samples of
//! its own. A sweep that does not bring the samples nearer is taken back.

mod attributes;
mod net;
mod original;
mod samples;
mod solve;

pub(crate) use original::Original;

use crate::collapser::Collapser;
use crate::options::{Control, Method, Options, Placement};
use glam::DVec3;
use net::Net;
use samples::{Fit, Samples};
use solve::{Moments, Solver};

/// The most triangles of an input (all meshes together) whose result is refitted without being asked.
///
/// Of this size it costs some ten milliseconds. Decided on fandisk, of 12,946 triangles: two sweeps make 7 ms of processor time 87 at a half, and
/// 10 ms 26 at a tenth; on pirate, of 5,010, they bring silhouettes at a fifth from 0.981 to 0.982.
pub const REFIT_LIMIT: usize = 8192;
/// Sweeps then. The first takes 6 to 14 % off the rms (bunny, horse, fandisk and rangemap at 50, 10 and 1 %), the second up to 3.
const DEFAULT_SWEEPS: usize = 2;

/// How many sweeps to make for an input of `triangles`.
pub(crate) fn sweeps(options: &Options, triangles: usize) -> usize {
    let moves = options.method == Method::Quadric
        && !options.keep_vertices
        && matches!(options.placement, None | Some(Placement::Optimal));
    let default = if triangles <= REFIT_LIMIT { DEFAULT_SWEEPS } else { 0 };
    if moves { options.refit.unwrap_or(default) } else { 0 }
}

/// Refits the vertices of `c` to `original`, which it was before the collapses. O(samples) a sweep.
pub(crate) fn run(
    c: &mut Collapser<'_>,
    original: &Original,
    sweeps: usize,
    options: &Options,
    control: &dyn Control,
) {
    let into = std::mem::take(&mut c.work.into);
    if c.work.triangles == original.triangle_count() {
        return;
    }
    let mut net = Net::new(&c.work);
    let start = net.points.clone();
    let Some(mut samples) = Samples::new(&c.work, original, net.roots(into), &options.vertex_weights) else {
        return;
    };
    let mut moments = Moments::new(&net);
    let solver = Solver::new(&net);
    let mut best: Option<(Fit, Vec<DVec3>)> = None;
    for sweep in 0..=sweeps {
        let fit = samples.bind(&c.work, &net, &mut moments);
        match &best {
            Some((was, points)) if !fit.is_better_than(was) => {
                net.points.clone_from(points);
                break;
            }
            _ => best = Some((fit, net.points.clone())),
        }
        if sweep == sweeps || control.cancelled() {
            break;
        }
        let (work, bound) = (&c.work, c.bound);
        let place = |v: usize, p: DVec3| {
            let to = work.round(p);
            let q = &c.quadrics[net.vertices[v].index()];
            let within = bound == f64::INFINITY || q.at(to - start[v]) <= bound * q.weight;
            (to.is_finite() && within).then_some(to)
        };
        let mut points = net.points.clone();
        solver.solve(&net, &moments, &mut points, place);
        net.points = points;
        net.refresh();
    }
    attributes::follow(c, &net, &start);
    for (i, &v) in net.vertices.iter().enumerate() {
        if net.points[i] != start[i] {
            c.relocate(v, net.points[i]);
        }
    }
}

impl Collapser<'_> {
    /// Moves a vertex after the last collapse; the estimate follows.
    fn relocate(&mut self, v: progmesh_aif::VertexId, to: DVec3) {
        let i = v.index();
        let q = &self.quadrics[i];
        if q.weight > 0.0 {
            self.worst = self.worst.max(q.at(to - self.work.points[i]) / q.weight);
        }
        self.work.points[i] = to;
        self.work.moved.set(i);
    }
}
