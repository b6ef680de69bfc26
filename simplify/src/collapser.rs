//! Quadric edge collapse on one mesh (Garland & Heckbert 1997): quadrics, the cost and place of a candidate, and the collapse
//! itself. The order is a schedule's business ([`crate::exact`], [`crate::bulk`]).

use crate::log::CollapseLog;
use crate::options::{Options, Placement, Refused};
use crate::quadric::Quadric;
use crate::thin;
use crate::validity::{HUB, MAX_VALENCE, RingFace, gather_ring};
use crate::wedges::WedgeMerge;
use crate::work::{Kind, Roles, Work};
use glam::DVec3;
use progmesh_aif::{CollapseRecord, EdgeId, Marks, VertexId};

/// Weight of the plane that stands on a border edge, times the edge's squared length. Decided on rangemap, bunny and dragon at 1 %:
/// at 100 borders starve the surface (rangemap rms + 80 %), at 0.1 they drift.
const BORDER_WEIGHT: f64 = 3.0;
/// Weight of the planes that stand on a seam edge.
const SEAM_WEIGHT: f64 = 1.0;
/// Pull towards the middle of the edge, relative to the mean eigenvalue of A: decides where A does not. At 1e-3 fandisk's sharp edges lose
/// 20 % rms against 1e-9; below that nothing was tried.
const PULL: f64 = 1e-9;
/// A vertex may be placed at most this many edge lengths from the middle of its edge.
const REACH: f64 = 2.0;
/// Pull of the volume correction: larger spreads it along the surface's normal. Decided on fandisk, bunny and horse.
const VOLUME_PULL: f64 = 1e-2;
/// The volume correction may move a vertex by at most this many edge lengths; at 1 the largest error of bunny at 1 % grows by 70 %.
const VOLUME_REACH: f64 = 0.3;

/// Where an edge would go, and at what cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) roles: Roles,
    pub(crate) to: DVec3,
    /// Quadric cost in local units: area times squared distance.
    pub(crate) cost: f64,
}

/// A mesh with quadrics on its vertices.
pub(crate) struct Collapser<'m> {
    pub(crate) work: Work<'m>,
    pub(crate) quadrics: Vec<Quadric>,
    placement: Placement,
    /// Largest cost per weight so far, local units.
    pub(crate) worst: f64,
    /// Costs per weight may not pass this, local units.
    pub(crate) bound: f64,
    /// The error bound in model units.
    largest: f64,
    /// The bound forbade the rounded place of a candidate.
    pub(crate) bounded: bool,
    pub(crate) tried: u64,
    pub(crate) refused: Refused,
    /// Edges that the kinds of their vertices forbid, as last counted.
    pub(crate) locked_edges: u64,
    pub(crate) wedges: WedgeMerge,
    scratch: Scratch,
    /// Where collapses are written down, if they are.
    pub(crate) log: Option<CollapseLog>,
}

/// What [`Collapser::check`] works with, one for each thread.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    marks: Marks,
    ring: Vec<RingFace>,
}

/// What a candidate that passes comes to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Verdict {
    /// Where the kept vertex goes.
    to: DVec3,
    /// What goes that quadrics do not see, local units: the collapse has to wait until its turn comes at this cost.
    loss: f64,
}

/// What became of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Attempt {
    Done,
    Refused,
    /// Allowed, but not before the turn of this cost, in common units; more than the turn's ceiling.
    Dearer(f32),
}

/// How things stand when the turn of a collapse comes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn {
    /// What it may lose (see [`thin`]), in common units, as schedules sort them.
    pub(crate) ceiling: f32,
    /// Turns local units into common ones.
    pub(crate) factor: f64,
    /// Triangles left over all meshes, for the log.
    pub(crate) left: usize,
}

/// Why a candidate is refused.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Refusal {
    Link,
    Border,
    Flip,
    Valence,
    /// Once rounded, it would pass the error bound.
    Error,
}

impl<'m> Collapser<'m> {
    /// Fills the quadrics. A model unit is `world` world units. O(n).
    pub(crate) fn new(mut work: Work<'m>, options: &Options, world: f64) -> Self {
        let placement = match options.keep_vertices {
            true => Placement::Endpoint,
            false => options.placement.unwrap_or(Placement::Optimal),
        };
        let quadrics = fill_quadrics(&work, options);
        let largest = options.max_error.map_or(f64::INFINITY, |b| work.model_bound(b, world));
        let bound = (largest * work.scale).powi(2);
        let wedges = WedgeMerge::new(&mut work);
        Collapser {
            work,
            quadrics,
            placement,
            worst: 0.0,
            bound,
            largest,
            bounded: false,
            tried: 0,
            refused: Refused::default(),
            locked_edges: 0,
            wedges,
            scratch: Scratch::default(),
            log: None,
        }
    }

    /// Cost and place of `e`; `None` when the kinds of its vertices forbid it. Reads nothing but the two vertices. O(1).
    #[inline]
    pub(crate) fn evaluate(&self, e: EdgeId) -> Option<Candidate> {
        let roles = self.work.roles(e)?;
        let (k, r) = (roles.kept.index(), roles.removed.index());
        let (pk, pr) = (self.work.points[k], self.work.points[r]);
        let span = pr - pk;
        // About the kept vertex.
        let q = self.joint_quadric(roles);
        if roles.fixed {
            return Some(Candidate { roles, to: pk, cost: q.at(DVec3::ZERO) });
        }
        match self.placement {
            Placement::Optimal => {
                let middle = span * 0.5;
                let reach = REACH * REACH * span.length_squared();
                let best = q
                    .minimise(middle, PULL * q.trace() / 3.0)
                    .filter(|t| t.distance_squared(middle) <= reach)
                    .unwrap_or_else(|| least(&q, [DVec3::ZERO, middle, span]));
                Some(Candidate { roles, to: pk + best, cost: q.at(best) })
            }
            Placement::Midpoint => Some(Candidate { roles, to: (pk + pr) * 0.5, cost: q.at(span * 0.5) }),
            Placement::Endpoint => {
                let (here, there) = (q.at(DVec3::ZERO), q.at(span));
                // Only a vertex of the same kind can take the other's place.
                let same_kind = self.work.kinds[k] == self.work.kinds[r];
                if same_kind && there < here {
                    let swapped = Roles { kept: roles.removed, removed: roles.kept, fixed: false };
                    return Some(Candidate { roles: swapped, to: pr, cost: there });
                }
                Some(Candidate { roles, to: pk, cost: here })
            }
        }
    }

    /// Collapses the candidate if topology and geometry allow it, losing no more than `turn` allows. O(valence).
    pub(crate) fn attempt(&mut self, e: EdgeId, c: &Candidate, turn: Turn) -> Attempt {
        let mut scratch = std::mem::take(&mut self.scratch);
        let verdict = self.check(e, c, &mut scratch);
        self.scratch = scratch;
        self.follow(e, c, verdict, turn)
    }

    /// Does what a fresh [`Collapser::check`] found, and counts it.
    pub(crate) fn follow(
        &mut self,
        e: EdgeId,
        c: &Candidate,
        verdict: Result<Verdict, Refusal>,
        turn: Turn,
    ) -> Attempt {
        let refusal = match verdict {
            Ok(v) => {
                // Compared as it will be sorted: what is dearer goes back with a higher key, so it cannot come round for ever.
                let loss = (v.loss * turn.factor) as f32;
                if loss > turn.ceiling {
                    return Attempt::Dearer(loss);
                }
                self.tried += 1;
                self.collapse(e, c, v.to, turn.left);
                return Attempt::Done;
            }
            Err(Refusal::Error) => {
                self.bounded = true;
                return Attempt::Refused;
            }
            Err(refusal) => refusal,
        };
        self.tried += 1;
        match refusal {
            Refusal::Link => self.refused.link += 1,
            Refusal::Border => self.refused.border += 1,
            Refusal::Flip => self.refused.flip += 1,
            Refusal::Valence => self.refused.valence += 1,
            Refusal::Error => {}
        }
        Attempt::Refused
    }

    /// Where the kept vertex goes if the collapse is allowed, and what is lost. Reads the one-rings of both vertices. O(valence).
    pub(crate) fn check(&self, e: EdgeId, c: &Candidate, scratch: &mut Scratch) -> Result<Verdict, Refusal> {
        let Roles { kept, removed, fixed } = c.roles;
        let work = &self.work;
        let Scratch { marks, ring } = scratch;
        let t = work.mesh.topology();
        // Two edges fall together with two others, and the collapsed one goes: a hub may shrink, not grow.
        let (vk, vr) = (t.star(kept).len(), t.star(removed).len());
        if vk.max(vr) > HUB || (vk + vr > MAX_VALENCE + 4 && vk.min(vr) > 4) {
            return Err(Refusal::Valence);
        }
        if work.pinches_seam(e) {
            return Err(Refusal::Border);
        }
        if t.link_condition_of_regular(e, kept, marks).is_err() {
            return Err(Refusal::Link);
        }
        let (gone, points) = (t.edge_faces(e), &work.points);
        ring.clear();
        gather_ring(t, points, removed, gone, ring);
        let of_removed = ring.len();
        gather_ring(t, points, kept, gone, ring);
        let mut to = c.to;
        let inner = |v: VertexId| work.kinds[v.index()] == Kind::Interior;
        if self.placement == Placement::Optimal && !fixed && inner(kept) && inner(removed) {
            let origin = points[kept.index()];
            let wings = gone.iter().map(|&f| t.triangle(f).map(|v| points[v.index()]));
            let q = self.joint_quadric(c.roles);
            let reach = VOLUME_REACH * origin.distance(points[removed.index()]);
            let corrected = to + volume_correction(&q, ring, wings, origin, to, reach);
            if q.at(corrected - origin) <= self.bound * q.weight {
                to = corrected;
            }
        }
        if !fixed && self.placement != Placement::Endpoint {
            to = work.round(to);
            // Near the largest numbers there may be no such place.
            if !to.is_finite() {
                return Err(Refusal::Flip);
            }
        }
        // Rounding the place may cost more than the collapse, and the cost itself is rounded in another way from another origin: what
        // counts is what `collapse` will find.
        if self.bound < f64::INFINITY {
            let q = self.joint_quadric(c.roles);
            if q.at(to - points[kept.index()]) > self.bound * q.weight {
                return Err(Refusal::Error);
            }
        }
        // A kept vertex that does not move changes none of its own faces.
        let moving = if to == points[kept.index()] { &ring[..of_removed] } else { &ring[..] };
        if !moving.iter().all(|f| f.stays_good(to)) {
            return Err(Refusal::Flip);
        }
        let end = |v: VertexId| (points[v.index()], self.quadrics[v.index()].weight);
        Ok(Verdict { to, loss: thin::loss(ring, to, [end(kept), end(removed)]) })
    }

    fn collapse(&mut self, e: EdgeId, c: &Candidate, to: DVec3, left: usize) {
        let k = c.roles.kept.index();
        let (q, step) = (self.joint_quadric(c.roles), to - self.work.points[k]);
        let mut error = 0.0;
        if q.weight > 0.0 {
            error = q.at(step) / q.weight;
            self.worst = self.worst.max(error);
        }
        let q = q.moved(step);
        self.wedges.merge(&mut self.work, e, &c.roles, to, self.log.as_mut().map(CollapseLog::notes));
        if let Some(log) = self.log.as_mut().filter(|_| self.wedges.active()) {
            log.end_run();
        }
        self.quadrics[k] = q;
        let old = self.log.is_some().then(|| self.work.model_position(c.roles.kept));
        let record = self.work.perform(e, &c.roles, to);
        if let (Some(log), Some(old)) = (&mut self.log, old) {
            let error = (error.max(0.0).sqrt() / self.work.scale) as f32;
            log.push(self.work.mesh.topology(), &record, old, error, left);
        }
    }

    /// The quadrics of both vertices, about the kept one.
    #[inline]
    fn joint_quadric(&self, roles: Roles) -> Quadric {
        let (k, r) = (roles.kept.index(), roles.removed.index());
        self.quadrics[k].plus(&self.quadrics[r].moved(self.work.points[k] - self.work.points[r]))
    }

    /// Estimated error so far, model units: the root of the largest cost per weight. Never above the bound.
    pub(crate) fn estimate(&self) -> f64 {
        // A cost at the bound may have a root a rounding above it.
        (self.worst.sqrt() / self.work.scale).min(self.largest)
    }

    /// True if a candidate of this cost respects the error bound.
    #[inline]
    pub(crate) fn within_bound(&self, c: &Candidate) -> bool {
        if self.bound == f64::INFINITY {
            return true;
        }
        let weight =
            self.quadrics[c.roles.kept.index()].weight + self.quadrics[c.roles.removed.index()].weight;
        c.cost <= self.bound * weight
    }
}

/// The step from `to` that makes the faces around the edge enclose the volume they did, least in the quadric's metric.
///
/// Optimal placement alone shrinks convex parts and fills concave ones; keeping the volume (the linear constraint of Lindstrom & Turk 1998)
/// on top of accumulated quadrics takes 4-15 % off the rms. Zero where the step would be longer than `reach`.
fn volume_correction(
    q: &Quadric,
    ring: &[RingFace],
    wings: impl Iterator<Item = [DVec3; 3]>,
    origin: DVec3,
    to: DVec3,
    reach: f64,
) -> DVec3 {
    // Volume between the faces and their copies with the apex at p: (g.(p - origin) - h) / 6.
    let (mut g, mut h) = (DVec3::ZERO, 0.0);
    let mut add = |x: DVec3, y: DVec3, z: DVec3| {
        let n = (y - x).cross(z - x);
        g += n;
        h += n.dot(x);
    };
    for f in ring {
        add(f.apex - origin, f.x - origin, f.y - origin);
    }
    for [x, y, z] in wings {
        add(x - origin, y - origin, z - origin);
    }
    let along = Quadric { a: q.a, b: -g, c: 0.0, weight: 0.0 };
    let Some(d) = along.minimise(DVec3::ZERO, VOLUME_PULL * q.trace() / 3.0) else { return DVec3::ZERO };
    let gd = g.dot(d);
    if gd <= 0.0 {
        return DVec3::ZERO;
    }
    let step = d * ((h - g.dot(to - origin)) / gd);
    if step.length_squared() <= reach * reach { step } else { DVec3::ZERO }
}

/// The best of three places.
fn least(q: &Quadric, places: [DVec3; 3]) -> DVec3 {
    let [a, b, c] = places;
    let (qa, qb, qc) = (q.at(a), q.at(b), q.at(c));
    if qb <= qa && qb <= qc {
        b
    } else if qa <= qc {
        a
    } else {
        c
    }
}

/// Every face's plane at its vertices, weighted by area; planes that stand on borders and seams.
fn fill_quadrics(work: &Work<'_>, options: &Options) -> Vec<Quadric> {
    let t = work.mesh.topology();
    let mut quadrics = vec![Quadric::default(); t.vertex_slots()];
    let mut normals = Vec::new();
    let constrained = |e: EdgeId| t.edge_faces(e).len() == 1 || work.seams.get(e.index());
    for f in t.faces() {
        let [a, b, c] = t.triangle(f);
        let p = |v: VertexId| work.points[v.index()];
        let n = (p(b) - p(a)).cross(p(c) - p(a));
        let double_area = n.length();
        if double_area > 0.0 {
            let unit = n / double_area;
            let area = 0.5 * double_area;
            for v in [a, b, c] {
                let q = &mut quadrics[v.index()];
                q.add_plane(unit, area);
                q.weight += area;
            }
            normals.push(unit);
        } else {
            normals.push(DVec3::ZERO);
        }
        for &u in t.face_edges(f) {
            let e = u.edge();
            if !constrained(e) {
                continue;
            }
            let [x, y] = t.edge_vertices(e);
            let along = p(y) - p(x);
            let across = along.cross(n);
            let length = across.length();
            if length > 0.0 {
                let k = if t.edge_faces(e).len() == 1 { BORDER_WEIGHT } else { SEAM_WEIGHT };
                for v in [x, y] {
                    quadrics[v.index()].add_plane(across / length, k * along.length_squared());
                }
            }
        }
    }
    if !options.vertex_weights.is_empty() {
        for (q, &w) in quadrics.iter_mut().zip(&options.vertex_weights) {
            q.a.iter_mut().for_each(|x| *x *= w as f64);
            q.weight *= w as f64;
        }
    }
    quadrics
}

impl Work<'_> {
    /// Collapses `e` in the topology and follows with the seams, the position and the count.
    pub(crate) fn perform(&mut self, e: EdgeId, roles: &Roles, to: DVec3) -> CollapseRecord {
        let record = self.mesh.topology_mut().collapse(e, roles.kept);
        for wing in record.wings() {
            self.triangles -= 1;
            if self.seams.get(wing.removed_edge.index()) {
                self.seams.set(wing.kept_edge.index());
            }
        }
        let k = roles.kept.index();
        if self.points[k] != to {
            self.points[k] = to;
            self.moved.set(k);
        }
        if let Some(into) = self.into.get_mut(roles.removed.index()) {
            *into = roles.kept.0;
        }
        debug_assert!(self.kinds[roles.removed.index()] != Kind::Pinned);
        record
    }
}
