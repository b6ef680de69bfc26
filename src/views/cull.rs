//! Leaving out what a camera cannot see.

use super::ViewError;
use super::instances::{Fate, each, is_skinned};
use crate::aif::{MeshInput, NONE};
use crate::refine::view::clip::gather_faces;
use crate::refine::view::{Camera, Frustum, NormalCone, PlaneName, Planes};
use crate::scene::Scene;
use glam::{DMat4, DVec3};

/// What [`cull_scene`] did. Components and faces are counted for each instance; those at the same place count once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CullReport {
    /// Instances that were looked at.
    pub instances: usize,
    /// Those wholly outside of the view.
    pub instances_outside: usize,
    /// Those of which nothing is left, outside or not.
    pub instances_dropped: usize,
    /// Connected pieces of the instances that were not wholly outside.
    pub components: usize,
    /// Those wholly outside of the view.
    pub components_outside: usize,
    /// Those that are closed, opaque and before the near plane: their back faces are hidden by their front.
    pub components_solid: usize,
    /// Faces before.
    pub faces: usize,
    /// Faces left out because they are outside of the view, with all of their instance or component or alone.
    pub faces_outside: usize,
    /// Faces left out because they turn their back, and are hidden.
    pub faces_back: usize,
    /// Of these, those that a normal cone decided, a run of faces at once.
    pub faces_by_cone: usize,
    /// Instances that move with a skin: they are kept as they are, for where they are drawn is not known.
    pub skinned: usize,
}

impl CullReport {
    /// Faces that are left.
    pub fn faces_kept(&self) -> usize {
        self.faces - self.faces_outside - self.faces_back
    }
}

/// Leaves out what a camera cannot see: instances, connected components and faces outside of its six planes; back faces of components that are solids, that is
/// closed, oriented outwards, of opaque single-sided materials, and wholly beyond the near plane.
///
/// What is left is drawn the same: a face goes only if it is outside of one plane, or hidden by its own component's front. Not left out: what other
/// things hide; back faces of open or translucent components; what is outside of the view but of no single plane. O(faces).
pub fn cull_scene(scene: &mut Scene, camera: &Camera) -> Result<CullReport, ViewError> {
    for (m, mesh) in scene.meshes.iter().enumerate() {
        mesh.geometry.validate().map_err(|e| ViewError::build(m, e))?;
    }
    let opaque: Vec<bool> = (0..scene.materials.len()).map(|m| is_opaque(scene, m)).collect();
    let parts: Vec<Parts> = scene.meshes.iter().map(|m| Parts::of(&m.geometry, &opaque)).collect();
    let mut report = CullReport::default();
    each(scene, |scene, m, to_world| {
        let mesh = &scene.meshes[m];
        report.instances += 1;
        report.faces += parts[m].faces.len();
        if is_skinned(mesh) {
            report.skinned += 1;
            return Ok(Fate::Keep);
        }
        let Some(own) = Own::of(camera, to_world) else { return Ok(Fate::Keep) };
        let keep = match see(&own, &mesh.geometry, &parts[m], &mut report) {
            None => return Ok(Fate::Drop),
            Some(keep) => keep,
        };
        if keep.len() == parts[m].faces.len() {
            return Ok(Fate::Keep);
        }
        if keep.is_empty() && mesh.geometry.wires.is_empty() {
            report.instances_dropped += 1;
            return Ok(Fate::Drop);
        }
        let left = gather_faces(&mesh.geometry, &keep);
        left.map(|m| Fate::Replace(Box::new(m))).map_err(|source| ViewError::Mesh { mesh: m, source })
    })?;
    Ok(report)
}

/// True if one sees nothing through a material, nor its back.
fn is_opaque(scene: &Scene, m: usize) -> bool {
    let material = &scene.materials[m];
    let mode = scene.gltf.as_deref().and_then(|s| s.document().pointer(&format!("/materials/{m}/alphaMode")));
    let blends = mode.and_then(|m| m.as_str()).is_some_and(|m| m != "OPAQUE");
    !material.double_sided && material.base_color[3] >= 1.0 && !blends
}

/// A camera in a mesh's own coordinates.
struct Own {
    frustum: Frustum,
    /// The eye if perspective, else the direction of view.
    eye: Result<DVec3, DVec3>,
}

impl Own {
    fn of(camera: &Camera, to_world: &DMat4) -> Option<Own> {
        let frustum = camera.frustum().in_space_of(to_world)?;
        let back = to_world.inverse();
        let eye = if camera.is_perspective() {
            Ok(back.transform_point3(camera.eye()))
        } else {
            Err(back.transform_vector3(camera.look()))
        };
        Some(Own { frustum, eye })
    }

    /// Twice the area vector against the way to the eye: negative for a face that turns its back.
    fn facing(&self, normal: DVec3, p: DVec3) -> f64 {
        match self.eye {
            Ok(eye) => normal.dot(eye - p),
            Err(look) => -normal.dot(look),
        }
    }

    fn all_turned_away(&self, cone: &NormalCone, centre: DVec3, radius: f64) -> bool {
        match self.eye {
            Ok(eye) => cone.faces_away_from(eye, centre, radius),
            Err(look) => cone.faces_along(look),
        }
    }
}

/// How many faces share a cone: small enough to be of one mind, large enough to spare work.
const RUN: usize = 32;

/// The faces that may be seen, ascending; `None` if all is outside.
fn see(own: &Own, input: &MeshInput, parts: &Parts, report: &mut CullReport) -> Option<Vec<u32>> {
    let Some((lo, hi)) = input.positions.bounds() else { return Some(vec![]) };
    let Some(planes) = own.frustum.aabb(lo, hi, Planes::ALL) else {
        report.instances_outside += 1;
        report.instances_dropped += 1;
        report.faces_outside += parts.faces.len();
        return None;
    };
    let mut keep = Vec::new();
    let mut points: Vec<DVec3> = Vec::new();
    for part in &parts.list {
        report.components += 1;
        let faces = &parts.faces[part.faces.clone()];
        let Some(left) = own.frustum.aabb(part.lo, part.hi, planes) else {
            report.components_outside += 1;
            report.faces_outside += faces.len();
            continue;
        };
        let solid = part.solid && !left.has(PlaneName::Near);
        report.components_solid += solid as usize;
        for run in faces.chunks(RUN) {
            let by_cone = solid && {
                let normals = run.iter().map(|&f| parts.normals[f as usize]);
                let cone = NormalCone::around(normals);
                let all = || run.iter().flat_map(|&f| parts.corners(input, f));
                let (lo, hi) =
                    all().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
                let centre = 0.5 * lo + 0.5 * hi;
                let radius = all().map(|p| p.distance(centre)).fold(0.0, f64::max);
                own.all_turned_away(&cone, centre, radius)
            };
            if by_cone {
                report.faces_back += run.len();
                report.faces_by_cone += run.len();
                continue;
            }
            for &f in run {
                points.clear();
                points.extend(parts.corners(input, f));
                let outside =
                    |&k: &PlaneName| left.has(k) && points.iter().all(|&p| own.frustum.distance(k, p) < 0.0);
                let normal = parts.normals[f as usize];
                if PlaneName::ALL.iter().any(outside) {
                    report.faces_outside += 1;
                } else if solid && points.iter().all(|&p| own.facing(normal, p) < 0.0) {
                    report.faces_back += 1;
                } else {
                    keep.push(f);
                }
            }
        }
    }
    keep.sort_unstable();
    Some(keep)
}

/// The connected components of a mesh.
struct Parts {
    list: Vec<Part>,
    /// All faces, those of a component together, ascending.
    faces: Vec<u32>,
    /// Twice the area vector of every face.
    normals: Vec<DVec3>,
    /// Where the corners of every face begin.
    starts: Vec<usize>,
}

struct Part {
    /// Range of [`Parts::faces`].
    faces: std::ops::Range<usize>,
    lo: DVec3,
    hi: DVec3,
    /// Closed, oriented outwards, opaque.
    solid: bool,
}

impl Parts {
    fn of(input: &MeshInput, opaque: &[bool]) -> Parts {
        let count = input.face_count();
        let mut starts = Vec::with_capacity(count + 1);
        let mut end = 0;
        starts.push(0);
        for f in 0..count {
            end += input.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
            starts.push(end);
        }
        // Union-find over vertices.
        let mut parent: Vec<u32> = (0..input.positions.len() as u32).collect();
        for f in 0..count {
            for w in input.corners[starts[f]..starts[f + 1]].windows(2) {
                let (a, b) = (find(&mut parent, w[0]), find(&mut parent, w[1]));
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let mut order: Vec<(u32, u32)> = (0..count)
            .filter(|&f| starts[f] < starts[f + 1])
            .map(|f| (find(&mut parent, input.corners[starts[f]]), f as u32))
            .collect();
        order.sort_unstable();
        let mut parts =
            Parts { list: vec![], faces: order.iter().map(|o| o.1).collect(), normals: vec![], starts };
        parts.normals = (0..count as u32).map(|f| parts.normal(input, f)).collect();
        let mut from = 0;
        for component in order.chunk_by(|a, b| a.0 == b.0) {
            let faces = from..from + component.len();
            from = faces.end;
            let part = parts.part(input, faces, opaque);
            parts.list.push(part);
        }
        parts
    }

    fn corners<'a>(&self, input: &'a MeshInput, f: u32) -> impl Iterator<Item = DVec3> + Clone + use<'a> {
        let range = self.starts[f as usize]..self.starts[f as usize + 1];
        input.corners[range].iter().map(|&v| input.positions.get(v as usize))
    }

    fn normal(&self, input: &MeshInput, f: u32) -> DVec3 {
        let mut corners = self.corners(input, f);
        let (Some(first), Some(mut last)) = (corners.next(), corners.next()) else { return DVec3::ZERO };
        let mut sum = DVec3::ZERO;
        for p in corners {
            sum += (last - first).cross(p - first);
            last = p;
        }
        sum
    }

    fn part(&self, input: &MeshInput, faces: std::ops::Range<usize>, opaque: &[bool]) -> Part {
        let list = &self.faces[faces.clone()];
        let all = || list.iter().flat_map(|&f| self.corners(input, f));
        let (lo, hi) =
            all().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
        let seen_through = |f: u32| {
            let m = input.face_material.get(f as usize).copied().filter(|&m| m != NONE);
            m.is_some_and(|m| !opaque.get(m as usize).copied().unwrap_or(true))
        };
        let solid = !list.iter().any(|&f| seen_through(f)) && self.is_closed(input, list) && {
            let centre = 0.5 * lo + 0.5 * hi;
            let first = |f: u32| self.corners(input, f).next().map_or(DVec3::ZERO, |p| p - centre);
            list.iter().map(|&f| first(f).dot(self.normals[f as usize])).sum::<f64>() > 0.0
        };
        Part { faces, lo, hi, solid }
    }

    /// True if every edge has two faces that run it opposite ways.
    fn is_closed(&self, input: &MeshInput, list: &[u32]) -> bool {
        let mut edges: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * list.len());
        for &f in list {
            let c = &input.corners[self.starts[f as usize]..self.starts[f as usize + 1]];
            for i in 0..c.len() {
                let (a, b) = (c[i], c[(i + 1) % c.len()]);
                edges.push((a.min(b), a.max(b), a < b));
            }
        }
        edges.sort_unstable();
        edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).all(|e| e.len() == 2 && e[0].2 != e[1].2)
    }
}

fn find(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        let up = parent[parent[v as usize] as usize];
        parent[v as usize] = up;
        v = up;
    }
    v
}
