//! From recorded collapses to vertex splits.

use super::input::InputOrder;
use super::replay::WedgeReplay;
use super::{ProgressiveMesh, SplitCode, Splits};
use crate::aif::{BuildError, Mesh, MeshInput, NONE, Positions, VertexId, Wedges};
use crate::simplify::{
    CollapseLog, Control, LoggedCollapse, LoggedWing, Method, Options, Recorded, SimplifyError, Stop,
    record_all,
};
use glam::DVec3;
use rustc_hash::FxHashMap;

/// Why no progressive mesh was made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The simplification refused its options, or is no sequence of edge collapses.
    #[error(transparent)]
    Simplify(#[from] SimplifyError),
    /// Polygons make more triangles than ids can name. Split the mesh.
    #[error("cutting polygons into triangles: {0}")]
    TooLarge(#[from] BuildError),
}

/// What came of [`build`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Built {
    /// The progressive mesh.
    pub mesh: ProgressiveMesh,
    /// Why the simplification to its base ended.
    pub stop: Stop,
    /// The method's estimate of the base's error, model units.
    pub estimate: f64,
}

/// What came of [`build_all`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct BuiltAll {
    /// One progressive mesh for each mesh.
    pub meshes: Vec<ProgressiveMesh>,
    /// The mesh whose next split comes, coarsest first: the splits of all in one order.
    pub turns: Vec<u32>,
    /// Why the simplification to the bases ended.
    pub stop: Stop,
    /// The largest estimate of a base's error, in the model units of its mesh.
    pub estimates: Vec<f64>,
}

/// Simplifies `mesh` by edge collapse as far as `options` ask (or, without a target, as far as is legal) and returns the base with the splits
/// that lead back.
///
/// Polygons are cut into triangles first; full detail returns them. Removed elements of the mesh are left out. Takes the time of the simplification and about a tenth more (in
/// instructions, by `bench/examples/recording`: bunny 1.09 with NSA, 1.08 by the exact schedule; with a uv map and a seam 1.05, 1.11, and 1.10 in bulk;
/// horse, whose normals go along, 1.12 and 1.10; the largest mesh of an engine, which is half seams, 1.15 at most).
///
/// Where places lie on a grid ([`Options::grid`]), normals between base and full detail are those of a million directions nearest to the method's, at most 0.24 degrees off, so that they take 20 bits ([`super::Values`]).
///
/// Errors: an option out of its range, pruning, clustering.
pub fn build(mesh: Mesh, options: &Options, control: &dyn Control) -> Result<Built, EncodeError> {
    let mut all = build_all(vec![mesh], &[1.0], options, control)?;
    let (mesh, estimate) = (all.meshes.swap_remove(0), all.estimates[0]);
    Ok(Built { mesh, stop: all.stop, estimate })
}

/// [`build`] for several meshes with one shared target; errors of mesh `i` weigh `scales[i]` (model units to world units). Panics if `scales` has
/// another length than `meshes`.
pub fn build_all(
    meshes: Vec<Mesh>,
    scales: &[f64],
    options: &Options,
    control: &dyn Control,
) -> Result<BuiltAll, EncodeError> {
    let mut inputs = Vec::with_capacity(meshes.len());
    let mut cut = Vec::with_capacity(meshes.len());
    for mesh in meshes {
        let (input, triangles, mesh) = prepare(mesh)?;
        inputs.push((input, triangles));
        cut.push(mesh);
    }
    let (stop, recorded) = record_all(&mut cut, scales, options, control)?;
    let turns = take_turns(&recorded);
    let estimates = recorded.iter().map(|r| r.estimate).collect();
    let each = cut.into_iter().zip(recorded).zip(inputs);
    let meshes = each
        .map(|((mut mesh, recorded), (input, triangles))| {
            let slots = Slots::new(&mesh, &recorded.log);
            let (positions, wedges) = (std::mem::take(mesh.positions_mut()), mesh.wedges_mut().take());
            let coarse_normals = options.grid.is_some_and(|g| g > 0.0);
            let (mut pm, full) =
                Builder::new(&mesh, &recorded.log, &slots).run(positions, wedges, coarse_normals);
            pm.order = Some(InputOrder::find(full.as_ref(), &pm, &slots, input.as_ref(), triangles.as_ref()));
            pm.levels = find_levels(&pm, &recorded, options.method);
            pm.pack();
            pm
        })
        .collect();
    Ok(BuiltAll { meshes, turns, stop, estimates })
}

/// The input in its flat form, if it has polygons, or its wedges; its triangles with the polygon of each, if it has polygons; the mesh as triangles in which every corner has a
/// wedge if any has.
type Prepared = (Option<MeshInput>, Option<(MeshInput, Vec<u32>)>, Mesh);

fn prepare(mesh: Mesh) -> Result<Prepared, BuildError> {
    // Ids must be those of the flat form.
    let t = mesh.topology();
    let whole = t.vertex_count() == t.vertex_slots() && t.face_count() == t.face_slots();
    let mesh = if whole { mesh } else { Mesh::build(mesh.to_input(), &Default::default())?.0 };
    let mut mesh = mesh;
    let input = if mesh.topology().is_triangular() {
        let wedges = mesh.input_wedges();
        // Numbered alike, so that what is the same is found by a glance.
        mesh.wedges_mut().clone_from(&wedges);
        wedges.map(|w| MeshInput { wedges: Some(w), ..Default::default() })
    } else {
        Some(mesh.to_input())
    };
    let done = mesh.triangulate()?;
    let mut mesh = done.mesh;
    let triangles = done.face_map.map(|map| (mesh.to_input(), map));
    if let Some(mut wedges) = mesh.wedges_mut().take() {
        fill_wedges(&mesh, &mut wedges);
        *mesh.wedges_mut() = Some(wedges);
    }
    Ok((input, triangles, mesh))
}

/// Gives corners without attributes a wedge that has no channel, one a vertex.
fn fill_wedges(mesh: &Mesh, wedges: &mut Wedges) {
    if !wedges.corner.contains(&NONE) {
        return;
    }
    let t = mesh.topology();
    let nothing = vec![0.0; wedges.stride()];
    let mut of_vertex = FxHashMap::default();
    for f in t.faces() {
        for (c, v) in t.corner_range(f).zip(t.triangle(f)) {
            if wedges.corner[c] == NONE {
                wedges.corner[c] = *of_vertex.entry(v).or_insert_with(|| wedges.push(&nothing, 0));
            }
        }
    }
}

/// The splits of all meshes in the order of their collapses, backwards.
fn take_turns(recorded: &[Recorded]) -> Vec<u32> {
    if let [one] = recorded {
        return vec![0; one.log.steps.len()];
    }
    let steps =
        |(m, r): (usize, &Recorded)| r.log.steps.iter().map(move |s| (s.left, m as u32)).collect::<Vec<_>>();
    let mut all: Vec<(u32, u32)> = recorded.iter().enumerate().flat_map(steps).collect();
    all.sort_unstable();
    all.into_iter().map(|(_, m)| m).collect()
}

/// NSA's passes as split counts; otherwise base and full detail.
fn find_levels(pm: &ProgressiveMesh, recorded: &Recorded, method: Method) -> Vec<u32> {
    let n = pm.splits.len() as u32;
    let mut levels = vec![0];
    if method == Method::Nsa {
        // Faces fall with every collapse, so a pass's count tells where it ended.
        let mut faces = pm.base_faces.len();
        let mut ends = recorded.levels.iter().rev().map(|l| l.faces).peekable();
        for (i, code) in pm.splits.code.iter().enumerate() {
            while ends.next_if(|&f| f <= faces).is_some() {
                levels.push(i as u32);
            }
            faces += 1 + code.two_faces() as usize;
        }
    }
    levels.push(n);
    levels.dedup();
    levels
}

/// Slots of the progressive mesh for the elements of the mesh that was simplified.
struct Slots {
    vertex: Vec<u32>,
    face: Vec<u32>,
}

impl Slots {
    /// Survivors in order, then what the splits bring back, the last collapse first.
    fn new(mesh: &Mesh, log: &CollapseLog) -> Self {
        let t = mesh.topology();
        let mut vertex = vec![NONE; t.vertex_slots()];
        let mut next = 0;
        let mut number = |slot: &mut u32| {
            *slot = next;
            next += 1;
        };
        t.vertices().for_each(|v| number(&mut vertex[v.index()]));
        log.steps.iter().rev().for_each(|s| number(&mut vertex[s.removed as usize]));
        let mut face = vec![NONE; t.face_slots()];
        let mut next = 0;
        let mut number = |slot: &mut u32| {
            *slot = next;
            next += 1;
        };
        t.faces().for_each(|f| number(&mut face[f.index()]));
        for s in log.steps.iter().rev() {
            let [l, r] = wings(s);
            number(&mut face[l.face as usize]);
            if r.face != NONE {
                number(&mut face[r.face as usize]);
            }
        }
        Slots { vertex, face }
    }
}

/// The triangles of a collapse, left and right: on an oriented mesh the left one runs from the kept vertex to the removed one.
fn wings(s: &LoggedCollapse) -> [&LoggedWing; 2] {
    let [a, b] = &s.wings;
    if b.face != NONE && b.kept_first && !a.kept_first { [b, a] } else { [a, b] }
}

struct Builder<'a> {
    mesh: &'a Mesh,
    log: &'a CollapseLog,
    slots: &'a Slots,
    pm: ProgressiveMesh,
}

impl<'a> Builder<'a> {
    fn new(mesh: &'a Mesh, log: &'a CollapseLog, slots: &'a Slots) -> Self {
        Builder { mesh, log, slots, pm: ProgressiveMesh::default() }
    }

    /// The progressive mesh, given positions and wedges of the mesh, which it has not any more; the wedges at full detail.
    fn run(
        mut self,
        mut now: Positions,
        wedges: Option<Wedges>,
        coarse_normals: bool,
    ) -> (ProgressiveMesh, Option<WedgeReplay<'a>>) {
        let (mesh, log, t) = (self.mesh, self.log, self.mesh.topology());
        let n = log.steps.len();
        let alive: Vec<u32> = t.vertices().map(|v| v.0).collect();
        let removed: Vec<u32> = log.steps.iter().rev().map(|s| s.removed).collect();
        self.pm.base_positions = now.gather(&alive);
        // A vertex that is gone stays where it was.
        self.pm.new_positions = now.gather(&removed).into();
        self.pm.wires = t
            .edges()
            .filter(|&e| t.edge_faces(e).is_empty())
            .map(|e| t.edge_vertices(e).map(|v| self.slots.vertex[v.index()]))
            .collect();
        let per_face = |values: &[u32]| {
            let mut by_slot = vec![NONE; values.len()];
            values.iter().zip(&self.slots.face).for_each(|(&x, &slot)| by_slot[slot as usize] = x);
            by_slot
        };
        self.pm.face_material = per_face(mesh.face_materials());
        self.pm.face_group = per_face(mesh.face_groups());
        let slot_of = |v: VertexId| self.slots.vertex[v.index()];
        let mut wedges = wedges.map(|w| WedgeReplay::new(w, log, t, slot_of, coarse_normals));
        self.pm.base_faces = match &wedges {
            None => t.faces().map(|f| t.triangle(f).map(slot_of)).collect(),
            Some(w) => t.faces().map(|f| w.corners(f)).collect(),
        };
        let empty = || if now.is_f64() { Positions::F64(Vec::new()) } else { Positions::default() };
        let (mut moved, mut splits) = (empty(), Splits::default());
        splits.vertex.reserve(n);
        splits.left.reserve(n);
        splits.right.reserve(n);
        splits.code.reserve(n);
        splits.error.reserve(n);
        for (i, s) in log.steps.iter().enumerate().rev() {
            let [l, r] = wings(s);
            let (mut code, left) = self.cut(l, 0);
            let mut right = NONE;
            if r.face != NONE {
                let (bits, cut) = self.cut(r, 1);
                (code, right) = (code | bits | SplitCode::TWO_FACES, cut);
            }
            let kept = s.kept as usize;
            if put(&mut now, kept, s.old_position) {
                code |= SplitCode::MOVES;
                push(&mut moved, &now, kept);
            }
            if let Some(w) = &mut wedges {
                code |= w.split(i, l, r);
            }
            splits.vertex.push(self.slots.vertex[kept]);
            splits.left.push(left);
            splits.right.push(right);
            splits.code.push(SplitCode(code));
            splits.error.push(s.error);
        }
        self.pm.moved_positions = moved.into();
        self.pm.splits = splits;
        self.pm.wedges = wedges.as_mut().map(WedgeReplay::streams);
        nest_errors(&mut self.pm);
        (self.pm, wedges)
    }

    /// The bits and the reference of a cut; `side` 0 for the left one.
    fn cut(&self, wing: &LoggedWing, side: usize) -> (u16, u32) {
        let renumber = |half: u32| {
            if half == NONE { None } else { Some(self.slots.face[(half >> 2) as usize] << 2 | half & 3) }
        };
        let (kept, removed) = (renumber(wing.kept_half), renumber(wing.removed_half));
        // The later of the two faces on the edge.
        let inner = match (kept, removed) {
            (Some(k), Some(r)) => r > k,
            (k, _) => k.is_none(),
        };
        let (cut, starts) =
            if inner { (removed, wing.removed_half_starts) } else { (kept, wing.kept_half_starts) };
        let tip = (wing.slot as u16 + 2) % 3;
        let arrangement = tip + if wing.kept_first { 0 } else { 3 };
        let bits = if side == 0 {
            arrangement
                | if inner { SplitCode::L_INNER } else { 0 }
                | if starts { SplitCode::L_STARTS } else { 0 }
        } else {
            arrangement << 3 | if inner { SplitCode::R_INNER } else { 0 }
        };
        (bits, cut.unwrap_or(NONE))
    }
}

impl InputOrder {
    /// What the input looked like, seen from the progressive mesh that was made of it; `full` holds the wedges at full detail. O(n).
    fn find(
        full: Option<&WedgeReplay<'_>>,
        pm: &ProgressiveMesh,
        slots: &Slots,
        input: Option<&MeshInput>,
        triangles: Option<&(MeshInput, Vec<u32>)>,
    ) -> InputOrder {
        let mut vertex = vec![0; slots.vertex.len()];
        slots.vertex.iter().enumerate().for_each(|(v, &s)| vertex[s as usize] = v as u32);
        let mut face = vec![0; slots.face.len()];
        slots.face.iter().enumerate().for_each(|(f, &s)| face[s as usize] = f as u32);
        let mut order = InputOrder { vertex, face, ..Default::default() };
        let Some(input) = input else { return order };
        if let Some((triangles, map)) = triangles {
            order.note_polygons(input, triangles, map);
        }
        if let (Some(full), Some(w)) = (full, &input.wedges) {
            full.compare(pm, &slots.face, &mut order, w);
        }
        order
    }
}

/// Raises errors so that no split's passes that of one it depends on.
fn nest_errors(pm: &mut ProgressiveMesh) {
    let on = pm.dependencies();
    let error = &mut pm.splits.error;
    for i in (0..on.len()).rev() {
        let least = error[i];
        for d in on[i].into_iter().filter(|&d| d != NONE) {
            let e = &mut error[d as usize];
            *e = e.max(least);
        }
    }
}

/// Sets point `i`; true if its bits change, signs of zeros included.
#[inline]
fn put(p: &mut Positions, i: usize, to: DVec3) -> bool {
    match p {
        Positions::F32(a) => {
            let [x, y, z] = [to.x as f32, to.y as f32, to.z as f32];
            let old = std::mem::replace(&mut a[i], [x, y, z]);
            let other = |a: f32, b: f32| a.to_bits() ^ b.to_bits();
            other(old[0], x) | other(old[1], y) | other(old[2], z) != 0
        }
        Positions::F64(a) => {
            let old = std::mem::replace(&mut a[i], to.to_array());
            let other = |a: f64, b: f64| a.to_bits() ^ b.to_bits();
            other(old[0], to.x) | other(old[1], to.y) | other(old[2], to.z) != 0
        }
    }
}

/// Appends point `i` of `from`.
fn push(to: &mut Positions, from: &Positions, i: usize) {
    match (to, from) {
        (Positions::F32(a), Positions::F32(b)) => a.push(b[i]),
        (Positions::F64(a), Positions::F64(b)) => a.push(b[i]),
        _ => {}
    }
}
