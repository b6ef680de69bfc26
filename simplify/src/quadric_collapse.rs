//! The quadric method on several meshes: one target, shared by world-space error.

use crate::collapser::Collapser;
use crate::finish::{Before, finish, target};
use crate::log::{CollapseLog, Recorded};
use crate::options::{Control, Level, Options, Outcome, Schedule, SimplifyError, Stop};
use crate::parallel::with_threads;
use crate::refit::{self, Original};
use crate::work::Work;
use crate::{bulk, exact};
use progmesh_aif::{Bits, Mesh};
use std::time::Instant;

/// [`crate::simplify_all`] by this method.
pub(crate) fn simplify_all(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    control: &dyn Control,
) -> Result<Vec<Outcome>, SimplifyError> {
    let start = Instant::now();
    let before: Vec<Before> = meshes.iter().map(Before::of).collect();
    let total = before.iter().map(|b| b.triangles).sum();
    let cut = meshes.iter_mut().map(triangulate).collect::<Result<Vec<_>, _>>()?;
    let (stop, found) = run_all(meshes, scales, options, total, false, control)?;
    let seconds = start.elapsed().as_secs_f64();
    let each = meshes.iter_mut().zip(&before).zip(found).zip(cut);
    Ok(each
        .map(|(((mesh, before), mut done), cut)| {
            done.level.seconds = seconds;
            let mut outcome = finish(mesh, before, options, (stop, done.estimate, vec![done.level]));
            outcome.triangulated = cut;
            outcome
        })
        .collect())
}

/// [`crate::record_all`] by this method.
pub(crate) fn record_all(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    control: &dyn Control,
) -> Result<(Stop, Vec<Recorded>), SimplifyError> {
    let start = Instant::now();
    let total = meshes.iter().map(Mesh::triangle_count).sum();
    let (stop, found) = run_all(meshes, scales, options, total, true, control)?;
    let seconds = start.elapsed().as_secs_f64();
    let each = found.into_iter().map(|mut done| {
        done.level.seconds = seconds;
        Recorded { log: done.log, estimate: done.estimate, levels: vec![done.level] }
    });
    Ok((stop, each.collect()))
}

/// What came of one mesh.
struct Done {
    estimate: f64,
    level: Level,
    log: CollapseLog,
}

/// Collapses until `total` triangles have become the target. Meshes are triangular, and are not compacted.
fn run_all(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    total: usize,
    logged: bool,
    control: &dyn Control,
) -> Result<(Stop, Vec<Done>), SimplifyError> {
    let mut collapsers = Vec::with_capacity(meshes.len());
    for (i, (mesh, &scale)) in meshes.iter_mut().zip(scales).enumerate() {
        let options = &options.of_mesh(i);
        let mut collapser = Collapser::new(Work::new(mesh, options)?, options, scale);
        collapser.log = logged.then(|| CollapseLog::for_vertices(collapser.work.mesh.vertex_count()));
        collapsers.push(collapser);
    }
    // Costs are areas times squared distances; common ones are in diagonals of the largest mesh, in world units.
    let largest = collapsers.iter().zip(scales).map(|(c, s)| c.work.diagonal * s).fold(0.0, f64::max);
    let common = |(c, s): (&Collapser<'_>, &f64)| {
        if largest > 0.0 { (s / c.work.scale / largest).powi(4) } else { 1.0 }
    };
    let factors: Vec<f64> = collapsers.iter().zip(scales).map(common).collect();
    let goal = exact::Goal { triangles: target(options, total), first: total };
    let sweeps = if logged { 0 } else { refit::sweeps(options, total) };
    let originals: Vec<Original> = match sweeps {
        0 => Vec::new(),
        _ => collapsers.iter_mut().map(|c| Original::of(&mut c.work)).collect(),
    };
    let stop = match options.schedule.unwrap_or(Schedule::Bulk) {
        Schedule::Exact => exact::run(&mut collapsers, &factors, &goal, control),
        Schedule::Bulk => {
            with_threads(options.threads, || bulk::run(&mut collapsers, &factors, &goal, control))
        }
    };
    if stop != Stop::Cancelled {
        with_threads(options.threads, || {
            for (c, original) in collapsers.iter_mut().zip(&originals) {
                refit::run(c, original, sweeps, options, control);
            }
        });
    }
    let mut found = Vec::with_capacity(collapsers.len());
    for mut c in collapsers {
        c.work.write_back();
        let mut refused = c.refused;
        refused.locked += c.locked_edges;
        let tried = c.tried + c.locked_edges;
        let faces = c.work.mesh.face_count();
        let level = Level { pass: 1, faces, seconds: 0.0, tried, refused };
        found.push(Done { estimate: c.estimate(), level, log: c.log.unwrap_or_default() });
    }
    Ok((stop, found))
}

/// Cuts polygons into triangles; says how many.
fn triangulate(mesh: &mut Mesh) -> Result<usize, SimplifyError> {
    if mesh.topology().is_triangular() {
        return Ok(0);
    }
    let done = std::mem::take(mesh).triangulate()?;
    *mesh = done.mesh;
    Ok(done.cut)
}

/// Removes components whose diagonal is below `fraction` of the mesh's. O(n).
pub(crate) fn prune_components(mesh: &mut Mesh, fraction: f64) {
    let t = mesh.topology();
    let components = t.face_components();
    let Some((lo, hi)) = mesh.surface_bounds() else { return };
    let least = fraction * (hi - lo).length();
    let mut bounds = vec![(glam::DVec3::INFINITY, glam::DVec3::NEG_INFINITY); components.count];
    for f in t.faces() {
        let b = &mut bounds[components.of[f.index()] as usize];
        for p in t.face_vertices(f).map(|v| mesh.position(v)) {
            *b = (b.0.min(p), b.1.max(p));
        }
    }
    let mut gone = Bits::new(t.face_slots());
    for f in t.faces() {
        let (lo, hi) = bounds[components.of[f.index()] as usize];
        if (hi - lo).length() < least {
            gone.set(f.index());
        }
    }
    let faces: Vec<_> = t.faces().filter(|f| gone.get(f.index())).collect();
    mesh.topology_mut().remove_faces(faces);
}
