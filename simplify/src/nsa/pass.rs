//! One pass over one mesh.

use super::turn::{MaxTurn, newell};
use super::{Recorder, Step};
use crate::locks::locked_vertices;
use crate::log::{CollapseLog, Notes};
use crate::options::{Options, Placement, Refused, SimplifyError};
use crate::quadric::Quadric;
use crate::validity::{MAX_VALENCE, RingFace, gather_ring};
use crate::wedges::WedgeMerge;
use crate::work::{Roles, Work};
use glam::DVec3;
use progmesh_aif::{Bits, Collapse, EdgeId, FaceId, Marks, Mesh, VertexId};

/// Optimal placement: pull towards the middle of the edge, relative to the mean eigenvalue of the quadric.
const PULL: f64 = 1e-6;
/// Optimal placement: at most this many edge lengths from the middle of the edge.
const REACH: f64 = 1.0;
/// The caller is asked whether to go on once in so many faces.
const POLL: usize = 1 << 12;

/// A mesh being simplified by passes.
pub(super) struct Engine<'m> {
    work: Work<'m>,
    placement: Placement,
    turn: MaxTurn,
    locked: Bits,
    wedges: Option<WedgeMerge>,
    /// The pass in which a vertex last took part in a collapse.
    touched: Vec<u32>,
    pass: u32,
    /// Estimated error of every vertex, local units.
    error: Vec<f32>,
    bound: f64,
    /// A collapse of the last pass was refused for the error bound.
    pub(super) bounded: bool,
    /// Where collapses are written down, if they are: no recorder is told their wedges then.
    pub(super) log: Option<CollapseLog>,
    /// Triangles of the other meshes, for the log.
    elsewhere: usize,
    scratch: Scratch,
}

/// Reused from edge to edge.
#[derive(Default)]
struct Scratch {
    marks: Marks,
    /// Of triangle meshes: the faces around both ends that survive; those of the removed vertex first.
    ring: Vec<RingFace>,
    /// Of other meshes: the same, as ids.
    faces: Vec<FaceId>,
    /// Recording: what wedges were before.
    corners: Vec<(u32, u32)>,
    rows: Vec<(u32, u64)>,
    values: Vec<f32>,
}

/// Why an edge is not collapsed.
enum Refusal {
    Link,
    Normal,
    Border,
    Valence,
    Locked,
    /// The error bound.
    Error,
}

impl<'m> Engine<'m> {
    /// Works out what may move. A model unit is `world` world units. Changes nothing. O(n).
    pub(super) fn new(
        mesh: &'m mut Mesh,
        options: &Options,
        epsilon: f64,
        world: f64,
    ) -> Result<Self, SimplifyError> {
        let mut own = options.clone();
        own.lock_border = true;
        let work = Work::new(mesh, &own)?;
        let slots = work.points.len();
        let bound = own.max_error.map_or(f64::INFINITY, |b| work.model_bound(b, world) * work.scale);
        let placement = match own.keep_vertices {
            true => Placement::Endpoint,
            false => own.placement.unwrap_or(Placement::Midpoint),
        };
        Ok(Engine {
            locked: locked_vertices(work.mesh, options),
            placement,
            turn: MaxTurn::new(epsilon),
            wedges: None,
            touched: vec![0; slots],
            pass: 0,
            error: vec![0.0; slots],
            bound,
            bounded: false,
            log: None,
            elsewhere: 0,
            scratch: Scratch::default(),
            work,
        })
    }

    /// Makes the wedges ready, and shows the mesh to the recorder.
    pub(super) fn begin(&mut self, recorder: &mut Option<&mut dyn Recorder>) {
        self.wedges = Some(WedgeMerge::new(&mut self.work));
        if let Some(r) = recorder {
            r.begin(self.work.mesh);
        }
    }

    pub(super) fn triangles(&self) -> usize {
        self.work.triangles
    }

    pub(super) fn faces(&self) -> usize {
        self.work.mesh.face_count()
    }

    /// Model units.
    pub(super) fn estimate(&self) -> f64 {
        let t = self.work.mesh.topology();
        t.vertices().map(|v| self.error[v.index()]).fold(0.0, f32::max) as f64 / self.work.scale
    }

    /// One pass, ended early when `floor` triangles are left or `poll` (given the triangles left) says so.
    /// Returns the edges tried and refused. O(n).
    pub(super) fn pass(
        &mut self,
        floor: usize,
        elsewhere: usize,
        recorder: &mut Option<&mut dyn Recorder>,
        poll: &mut dyn FnMut(usize) -> bool,
    ) -> (u64, Refused) {
        self.pass += 1;
        self.elsewhere = elsewhere;
        self.bounded = false;
        let (mut tried, mut refused) = (0, Refused::default());
        for f in (0..self.work.mesh.topology().face_slots() as u32).map(FaceId) {
            if f.index() % POLL == 0 && poll(self.work.triangles) {
                break;
            }
            let mut i = 0;
            // The face may vanish, and a polygon lose corners, on the way.
            while self.work.mesh.topology().has_face(f) {
                let t = self.work.mesh.topology();
                let Some(e) = t.face_edges(f).get(i).map(|u| u.edge()) else { break };
                i += 1;
                if t.edge_vertices(e).iter().any(|v| self.touched[v.index()] == self.pass) {
                    continue;
                }
                if self.work.triangles <= floor {
                    return (tried, refused);
                }
                tried += 1;
                match self.attempt(e, recorder) {
                    Ok(()) => {}
                    Err(Refusal::Link) => refused.link += 1,
                    Err(Refusal::Normal) => refused.normal += 1,
                    Err(Refusal::Border) => refused.border += 1,
                    Err(Refusal::Valence) => refused.valence += 1,
                    Err(Refusal::Locked) => refused.locked += 1,
                    Err(Refusal::Error) => self.bounded = true,
                }
            }
        }
        (tried, refused)
    }

    /// Collapses `e` if all conditions allow it. O(valence).
    fn attempt(&mut self, e: EdgeId, recorder: &mut Option<&mut dyn Recorder>) -> Result<(), Refusal> {
        let t = self.work.mesh.topology();
        let Some(roles) = self.work.roles(e) else {
            let locked = t.edge_vertices(e).iter().any(|v| self.locked.get(v.index()));
            return Err(if locked { Refusal::Locked } else { Refusal::Border });
        };
        let (vk, vr) = (t.star(roles.kept).len(), t.star(roles.removed).len());
        if vk + vr > MAX_VALENCE + 4 && vk.min(vr) > 4 {
            return Err(Refusal::Valence);
        }
        if self.work.pinches_seam(e) {
            return Err(Refusal::Border);
        }
        self.gather(e, &roles);
        let (roles, to) = self.place(e, roles).ok_or(Refusal::Normal)?;
        let t = self.work.mesh.topology();
        if t.link_condition_of_regular(e, roles.kept, &mut self.scratch.marks).is_err() {
            return Err(Refusal::Link);
        }
        let error = self.error_at(e, &roles, to);
        if error as f64 > self.bound {
            return Err(Refusal::Error);
        }
        self.collapse(e, &roles, to, error, recorder);
        Ok(())
    }

    /// Fills the scratch with the faces around the edge that survive.
    fn gather(&mut self, e: EdgeId, roles: &Roles) {
        let Work { mesh, points, .. } = &self.work;
        let t = mesh.topology();
        let gone = t.edge_faces(e);
        if t.is_triangular() {
            let ring = &mut self.scratch.ring;
            ring.clear();
            gather_ring(t, points, roles.removed, gone, ring);
            gather_ring(t, points, roles.kept, gone, ring);
            return;
        }
        let faces = &mut self.scratch.faces;
        faces.clear();
        let vanishes = |f: &FaceId| gone.contains(f) && t.corner_range(*f).len() == 3;
        faces.extend(t.vertex_faces(roles.removed).filter(|f| !vanishes(f)));
        // Polygons on the edge are there already.
        faces.extend(t.vertex_faces(roles.kept).filter(|f| !gone.contains(f)));
    }

    /// Where the kept vertex goes, if a place passes the criterion. Endpoint placement may exchange the roles.
    fn place(&self, e: EdgeId, roles: Roles) -> Option<(Roles, DVec3)> {
        let p = |v: VertexId| self.work.points[v.index()];
        let (pk, pr) = (p(roles.kept), p(roles.removed));
        let passes = |to: DVec3| self.turns_allow(&roles, to);
        if roles.fixed {
            return passes(pk).then_some((roles, pk));
        }
        match self.placement {
            Placement::Endpoint => {
                if passes(pk) {
                    return Some((roles, pk));
                }
                let swapped = Roles { kept: roles.removed, removed: roles.kept, fixed: false };
                passes(pr).then_some((swapped, pr))
            }
            Placement::Midpoint => {
                let to = self.settle((pk + pr) * 0.5);
                passes(to).then_some((roles, to))
            }
            Placement::Optimal => {
                let middle = (pk + pr) * 0.5;
                let reach = REACH * pk.distance(pr);
                let best = self
                    .ring_quadric(e, middle)
                    .and_then(|q| q.minimise(DVec3::ZERO, PULL * q.trace() / 3.0));
                let best = best.filter(|t| t.length() <= reach).map(|t| self.settle(middle + t));
                // Where the best place does not pass, the middle may.
                best.into_iter().chain([self.settle(middle)]).find(|&to| passes(to)).map(|to| (roles, to))
            }
        }
    }

    /// A local place as it will be when the mesh has stored it.
    #[inline]
    fn settle(&self, to: DVec3) -> DVec3 {
        self.work.to_local(self.work.to_model(to))
    }

    /// The criterion: no surviving face turns by more than epsilon when both ends of the edge go to `to`.
    #[inline]
    fn turns_allow(&self, roles: &Roles, to: DVec3) -> bool {
        let t = self.work.mesh.topology();
        if t.is_triangular() {
            return self.scratch.ring.iter().all(|r| {
                let side = r.y - r.x;
                self.turn.allows(side.cross(r.apex - r.x), side.cross(to - r.x))
            });
        }
        let now = |v: VertexId| self.work.points[v.index()];
        let then = |v: VertexId| if v == roles.kept || v == roles.removed { to } else { now(v) };
        self.scratch.faces.iter().all(|&f| self.turn.allows(newell(t, f, now), newell(t, f, then)))
    }

    /// The planes of all faces around the edge, about `middle`, weighted by area.
    fn ring_quadric(&self, e: EdgeId, middle: DVec3) -> Option<Quadric> {
        let t = self.work.mesh.topology();
        let now = |v: VertexId| self.work.points[v.index()];
        let mut q = Quadric::default();
        let mut add = |double_area: DVec3, on: DVec3| {
            let length = double_area.length();
            if length > 0.0 {
                let (n, k) = (double_area / length, 0.5 * length);
                let d = n.dot(middle - on);
                q.add_plane(n, k);
                q.b += n * (k * d);
                q.c += k * d * d;
            }
        };
        if t.is_triangular() {
            self.scratch.ring.iter().for_each(|r| add((r.y - r.x).cross(r.apex - r.x), r.apex));
        }
        let vanishing = t.edge_faces(e).iter().filter(|&&f| t.corner_range(f).len() == 3);
        let rest = if t.is_triangular() { &[][..] } else { &self.scratch.faces[..] };
        for &f in rest.iter().chain(vanishing) {
            let on = t.face_vertices(f).next().map_or(middle, now);
            add(newell(t, f, now), on);
        }
        (q.trace() > 0.0).then_some(q)
    }

    /// The estimated error of the kept vertex after the collapse: the larger of the ends', and how far the new place is from the planes
    /// of the faces that survive.
    fn error_at(&self, e: EdgeId, roles: &Roles, to: DVec3) -> f32 {
        let t = self.work.mesh.topology();
        let now = |v: VertexId| self.work.points[v.index()];
        let mut worst = 0.0f64;
        let mut add = |n: DVec3, on: DVec3| {
            let (d, l) = (n.dot(to - on), n.length_squared());
            if l > 0.0 {
                worst = worst.max(d * d / l);
            }
        };
        if t.is_triangular() {
            self.scratch.ring.iter().for_each(|r| add((r.y - r.x).cross(r.apex - r.x), r.apex));
        } else {
            for &f in self.scratch.faces.iter().chain(t.edge_faces(e)) {
                if let Some(v) = t.face_vertices(f).find(|&v| v == roles.kept || v == roles.removed) {
                    add(newell(t, f, now), now(v));
                }
            }
        }
        let ends = self.error[roles.kept.index()].max(self.error[roles.removed.index()]);
        ends + worst.sqrt() as f32
    }

    fn collapse(
        &mut self,
        e: EdgeId,
        roles: &Roles,
        to: DVec3,
        error: f32,
        recorder: &mut Option<&mut dyn Recorder>,
    ) {
        if let Some(wedges) = &mut self.wedges {
            let Scratch { corners, rows, values, .. } = &mut self.scratch;
            corners.clear();
            rows.clear();
            values.clear();
            let notes = match &mut self.log {
                Some(log) => Some(log.notes()),
                None => recorder.is_some().then_some(Notes { corners, rows, values }),
            };
            wedges.merge(&mut self.work, e, roles, to, notes);
            if let Some(log) = self.log.as_mut().filter(|_| wedges.active()) {
                log.end_run();
            }
        }
        let (k, r) = (roles.kept.index(), roles.removed.index());
        let work = &mut self.work;
        let left = self.elsewhere + work.triangles;
        let old_position = work.mesh.position(roles.kept);
        let record = work.mesh.collapse_unchecked(e, roles.kept);
        for wing in record.wings() {
            work.triangles -= 1;
            if work.seams.get(wing.removed_edge.index()) {
                work.seams.set(wing.kept_edge.index());
            }
        }
        if work.points[k] != to {
            let stored = work.to_model(to);
            work.mesh.positions_mut().set(k, stored);
            work.points[k] = to;
        }
        self.error[k] = error;
        (self.touched[k], self.touched[r]) = (self.pass, self.pass);
        if let Some(log) = &mut self.log {
            let error = (error as f64 / work.scale) as f32;
            log.push(work.mesh.topology(), &record, old_position, error, left);
        }
        if let Some(recorder) = recorder {
            let Scratch { corners, rows, values, .. } = &self.scratch;
            recorder.step(&Step { collapse: Collapse { record, old_position }, corners, rows, values });
        }
    }
}
