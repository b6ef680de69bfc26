//! From recorded collapses to vertex splits.

use super::input::InputOrder;
use super::{ProgressiveMesh, SplitCode, Splits, WedgeStreams};
use crate::aif::{BuildError, Mesh, MeshInput, NONE, Positions, Wedges};
use crate::simplify::{
    CollapseLog, Control, LoggedCollapse, LoggedWing, Method, Options, Recorded, SimplifyError, Stop,
    record_all,
};
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
/// Polygons are cut into triangles first; full detail returns them. Removed elements of the mesh are left out. Takes the time of the simplification and
/// about a tenth more, with attributes up to a fifth (in instructions, bunny: NSA 1.11, with a uv map and a seam 1.21).
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
        .map(|((mesh, recorded), (input, triangles))| {
            let slots = Slots::new(&mesh, &recorded.log);
            let (mut pm, full) = Builder::new(&mesh, &recorded.log, &slots).run();
            pm.order = Some(InputOrder::find(full.as_ref(), &slots, input.as_ref(), triangles.as_ref()));
            pm.levels = find_levels(&pm, &recorded, options.method);
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
    let input = if mesh.topology().is_triangular() {
        mesh.input_wedges().map(|w| MeshInput { wedges: Some(w), ..Default::default() })
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
fn wings(s: &LoggedCollapse) -> [LoggedWing; 2] {
    let [a, b] = s.wings;
    if b.face != NONE && b.kept_first && !a.kept_first { [b, a] } else { [a, b] }
}

struct Builder<'a> {
    mesh: &'a Mesh,
    log: &'a CollapseLog,
    slots: &'a Slots,
    pm: ProgressiveMesh,
}

/// Wedges while the splits are made: as they are in the mesh of the moment.
struct WedgeReplay<'a> {
    log: &'a CollapseLog,
    wedges: Wedges,
    /// Wedge of the mesh -> slot.
    slot: Vec<u32>,
    count: u32,
    out: WedgeStreams,
    /// (coarse, fine) wedges of the split at hand.
    pairs: Vec<(u32, u32)>,
    /// Wedges of which the split at hand changes the values.
    changed: Vec<u32>,
}

impl<'a> Builder<'a> {
    fn new(mesh: &'a Mesh, log: &'a CollapseLog, slots: &'a Slots) -> Self {
        Builder { mesh, log, slots, pm: ProgressiveMesh::default() }
    }

    /// The progressive mesh; the wedges at full detail.
    fn run(mut self) -> (ProgressiveMesh, Option<WedgeReplay<'a>>) {
        let (mesh, log, t) = (self.mesh, self.log, self.mesh.topology());
        let n = log.steps.len();
        let alive: Vec<u32> = t.vertices().map(|v| v.0).collect();
        self.pm.base_positions = mesh.positions().gather(&alive);
        self.pm.wires = t
            .edges()
            .filter(|&e| t.edge_faces(e).is_empty())
            .map(|e| t.edge_vertices(e).map(|v| self.slots.vertex[v.index()]))
            .collect();
        let order: Vec<u32> = {
            let mut order = vec![0; t.face_slots()];
            self.slots.face.iter().enumerate().for_each(|(f, &slot)| order[slot as usize] = f as u32);
            order
        };
        let per_face = |values: &[u32]| {
            if values.is_empty() { Vec::new() } else { order.iter().map(|&f| values[f as usize]).collect() }
        };
        self.pm.face_material = per_face(mesh.face_materials());
        self.pm.face_group = per_face(mesh.face_groups());
        let mut wedges = mesh.wedges().map(|w| WedgeReplay::new(w, log, mesh));
        self.pm.base_faces = t
            .faces()
            .map(|f| match &wedges {
                None => t.triangle(f).map(|v| self.slots.vertex[v.index()]),
                Some(w) => {
                    let c = 3 * f.index();
                    [c, c + 1, c + 2].map(|c| w.slot[w.wedges.corner[c] as usize])
                }
            })
            .collect();
        if let Some(w) = &mut wedges {
            w.out.base_vertex = vec![0; w.count as usize];
            for f in t.faces() {
                for (k, v) in t.triangle(f).into_iter().enumerate() {
                    let slot = w.slot[w.wedges.corner[3 * f.index() + k] as usize];
                    w.out.base_vertex[slot as usize] = self.slots.vertex[v.index()];
                }
            }
        }
        let empty =
            || if mesh.positions().is_f64() { Positions::F64(Vec::new()) } else { Positions::default() };
        let (mut moved, mut splits) = (empty(), Splits::default());
        splits.vertex.reserve(n);
        splits.left.reserve(n);
        splits.right.reserve(n);
        splits.code.reserve(n);
        splits.error.reserve(n);
        let mut now = mesh.positions().clone();
        for (i, s) in log.steps.iter().enumerate().rev() {
            let [l, r] = wings(s);
            let (mut code, left) = self.cut(&l, 0);
            let mut right = NONE;
            if r.face != NONE {
                let (bits, cut) = self.cut(&r, 1);
                (code, right) = (code | bits | SplitCode::TWO_FACES, cut);
            }
            let kept = s.kept as usize;
            let before = raw_bits(&now, kept);
            now.set(kept, s.old_position);
            if raw_bits(&now, kept) != before {
                code |= SplitCode::MOVES;
                push(&mut moved, &now, kept);
            }
            if let Some(w) = &mut wedges {
                code |= w.split(i, &l, &r);
            }
            splits.vertex.push(self.slots.vertex[kept]);
            splits.left.push(left);
            splits.right.push(right);
            splits.code.push(SplitCode(code));
            splits.error.push(s.error);
        }
        let removed: Vec<u32> = log.steps.iter().rev().map(|s| s.removed).collect();
        self.pm.new_positions = mesh.positions().gather(&removed);
        self.pm.moved_positions = moved;
        self.pm.splits = splits;
        self.pm.wedges = wedges.as_mut().map(|w| std::mem::take(&mut w.out));
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

impl<'a> WedgeReplay<'a> {
    /// At the base: its wedges are numbered by first use.
    fn new(wedges: &Wedges, log: &'a CollapseLog, mesh: &Mesh) -> Self {
        let wedges = wedges.clone();
        let mut slot = vec![NONE; wedges.len()];
        let mut out = WedgeStreams {
            channels: wedges.channels().to_vec(),
            stride: wedges.stride(),
            ..Default::default()
        };
        let mut count = 0;
        for f in mesh.topology().faces() {
            for &w in &wedges.corner[3 * f.index()..3 * f.index() + 3] {
                if slot[w as usize] == NONE {
                    slot[w as usize] = count;
                    count += 1;
                    out.rows.extend_from_slice(wedges.row(w));
                    out.present.push(wedges.present(w));
                }
            }
        }
        WedgeReplay { log, wedges, slot, count, out, pairs: Vec::new(), changed: Vec::new() }
    }

    fn run_of(&self, i: usize) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let start = if i == 0 { (0, 0) } else { self.log.ends[i - 1] };
        let end = self.log.ends[i];
        (start.0 as usize..end.0 as usize, start.1 as usize..end.1 as usize)
    }

    /// Undoes collapse `i`; returns the bits of its code.
    fn split(&mut self, i: usize, l: &LoggedWing, r: &LoggedWing) -> u16 {
        let (corners, old_rows) = self.run_of(i);
        let log = self.log;
        let two = r.face != NONE;
        let corner_at = |w: &Wedges, half: u32| {
            // The corner of a face at the vertex that is split.
            let of = |wing: &LoggedWing| {
                let starts =
                    if half == wing.removed_half { wing.removed_half_starts } else { wing.kept_half_starts };
                let k = if starts { half & 3 } else { ((half & 3) + 1) % 3 };
                w.corner[(3 * (half >> 2) + k) as usize]
            };
            if half == l.removed_half || half == l.kept_half { of(l) } else { of(r) }
        };
        // Coarse wedges at both ends of the run of faces that go to the new vertex.
        let first = if l.removed_half != NONE { l.removed_half } else { l.kept_half };
        let mut x_l = corner_at(&self.wedges, first);
        let mut x_r =
            if two && r.removed_half != NONE { corner_at(&self.wedges, r.removed_half) } else { x_l };
        let [plain_l, plain_r] = [x_l, x_r];
        if two {
            let outer =
                |wing: &LoggedWing| (wing.kept_half != NONE).then(|| corner_at(&self.wedges, wing.kept_half));
            (x_l, x_r) = super::seam_wedges(x_l, x_r, outer(l), outer(r));
        }
        // Pairs (coarse, fine) over those faces, the removed ones left out.
        let wing_face = |c: u32| c / 3 == l.face || (two && c / 3 == r.face);
        let mut pairs = std::mem::take(&mut self.pairs);
        pairs.clear();
        for &(c, fine) in &log.corners[corners.clone()] {
            let pair = (self.wedges.corner[c as usize], fine);
            if !wing_face(c) && !pairs.contains(&pair) {
                pairs.push(pair);
            }
        }
        // Back to the fine state.
        for &(c, fine) in &log.corners[corners] {
            self.wedges.corner[c as usize] = fine;
        }
        let stride = self.wedges.stride();
        let mut changed = std::mem::take(&mut self.changed);
        changed.clear();
        for k in old_rows {
            let (w, present) = log.rows[k];
            let old = &log.values[k * stride..(k + 1) * stride];
            let same = self.wedges.present(w) == present
                && self.wedges.row(w).iter().zip(old).all(|(a, b)| a.to_bits() == b.to_bits());
            if !same {
                self.wedges.set_present(w, present);
                self.wedges.row_mut(w).copy_from_slice(old);
                changed.push(w);
            }
        }
        // Corners of the new faces: at the old vertex, the new one, the tip.
        let of_wing = |wing: &LoggedWing| {
            let c = 3 * wing.face as usize;
            let (a, b) = (wing.slot as usize, (wing.slot as usize + 1) % 3);
            let at = |k: usize| self.wedges.corner[c + k];
            let (vt, vu) = if wing.kept_first { (at(a), at(b)) } else { (at(b), at(a)) };
            [vt, vu, at((wing.slot as usize + 2) % 3)]
        };
        let fl = of_wing(l);
        let fr = if two { of_wing(r) } else { [plain_l, fl[1], NONE] };
        // New wedges that only the new faces have.
        for w in [(fl[0], fl[1]), (fr[0], fr[1])] {
            if self.slot[w.1 as usize] == NONE && !pairs.iter().any(|p| p.1 == w.1) {
                pairs.push(w);
            }
        }
        let tip_at = |wing: &LoggedWing, half: u32, starts: bool| {
            let k = if starts { ((half & 3) + 1) % 3 } else { half & 3 };
            debug_assert!(wing.face != half >> 2);
            self.wedges.corner[(3 * (half >> 2) + k) as usize]
        };
        let tip = |wing: &LoggedWing, want: u32| {
            let outer = (wing.kept_half != NONE).then(|| tip_at(wing, wing.kept_half, wing.kept_half_starts));
            let inner = (wing.removed_half != NONE)
                .then(|| tip_at(wing, wing.removed_half, wing.removed_half_starts));
            match (outer, inner) {
                (Some(o), _) if o == want => Some(false),
                (None, Some(i)) if i == want => Some(false),
                (_, Some(i)) if i == want => Some(true),
                _ => None,
            }
        };
        let (tip_l, tip_r) = (tip(l, fl[2]), if two { tip(r, fr[2]) } else { Some(false) });
        let fresh = |w: u32| self.slot[w as usize] == NONE;
        let within = |allowed: &[u32]| changed.iter().all(|w| allowed.contains(w));
        let plain = pairs.len() == 1
            && plain_l == plain_r
            && pairs[0] == (plain_l, fl[1])
            && fresh(fl[1])
            && fl[0] == plain_l
            && fr[..2] == [plain_l, fl[1]]
            && within(&[plain_l]);
        let seam = two
            && pairs.len() == 2
            && x_l != x_r
            && fl[1] != fr[1]
            && pairs.contains(&(x_l, fl[1]))
            && pairs.contains(&(x_r, fr[1]))
            && fresh(fl[1])
            && fresh(fr[1])
            && fl[0] == x_l
            && fr[0] == x_r
            && within(&[x_l, x_r]);
        let mut bits = 0;
        bits |= if tip_l == Some(true) { SplitCode::L_TIP_INNER } else { 0 };
        bits |= if tip_r == Some(true) { SplitCode::R_TIP_INNER } else { 0 };
        let simple = tip_l.is_some() && tip_r.is_some() && (plain || seam);
        let (made, listed) = ([fl[1], fr[1]], if plain { [plain_l; 2] } else { [x_l, x_r] });
        let fresh_pairs: Vec<u32>;
        let (new, rows): (&[u32], &[u32]) = if simple {
            bits |= (!plain as u16) << SplitCode::KIND;
            let count = 2 - plain as usize;
            (&made[..count], if changed.is_empty() { &[] } else { &listed[..count] })
        } else {
            bits |= 2 << SplitCode::KIND;
            fresh_pairs = pairs.iter().map(|p| p.1).filter(|&w| fresh(w)).collect();
            (&fresh_pairs, &changed)
        };
        for &w in new {
            self.slot[w as usize] = self.count;
            self.count += 1;
        }
        if !rows.is_empty() {
            bits |= SplitCode::ROWS;
        }
        for &w in new.iter().chain(rows) {
            self.out.rows.extend_from_slice(self.wedges.row(w));
            self.out.present.push(self.wedges.present(w));
        }
        if bits >> SplitCode::KIND & 3 == 2 {
            let slot = |w: u32| self.slot[w as usize];
            let out = &mut self.out.explicit;
            out.extend([pairs.len() as u32, changed.len() as u32]);
            out.extend(pairs.iter().flat_map(|p| [slot(p.0), slot(p.1)]));
            out.extend(changed.iter().map(|&w| slot(w)));
            // Tips by their neighbours where that tells them: it holds in any order of the splits.
            let with_tip = |c: [u32; 3], rule: Option<bool>| {
                [slot(c[0]), slot(c[1]), if rule.is_some() { NONE } else { slot(c[2]) }]
            };
            out.extend(with_tip(fl, tip_l));
            if two {
                out.extend(with_tip(fr, tip_r));
            }
        }
        (self.pairs, self.changed) = (pairs, changed);
        bits
    }
}

impl InputOrder {
    /// What the input looked like, seen from the progressive mesh that was made of it; `full` holds the wedges at full detail. O(n).
    fn find(
        full: Option<&WedgeReplay<'_>>,
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
            order.note_wedges(&full.wedges, &full.slot, w);
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

/// The bits of point `i`, signs of zeros included.
#[inline]
fn raw_bits(p: &Positions, i: usize) -> [u64; 3] {
    match p {
        Positions::F32(a) => a[i].map(|x| x.to_bits() as u64),
        Positions::F64(a) => a[i].map(f64::to_bits),
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
