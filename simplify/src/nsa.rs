//! NSA, normal-based simplification (Silva & Gomes): edge collapse in passes, chosen and validated by one criterion.
//!
//! An edge is collapsed if every face around it that survives turns its normal by at most epsilon. That forbids fold-overs by itself,
//! and needs no queue: a pass takes the edges in the order of the faces and skips those that have an end which already took part in
//! a collapse of this pass. So a pass removes up to about half of the faces, evenly, and is one level of detail.
//!
//! - General polygonal meshes: the normal of a polygon is Newell's; a triangle on the edge vanishes, a larger polygon loses a corner.
//! - The border stays bit for bit: no vertex of it moves or goes. An inner vertex may go into one, which then stays where it is.
//! - Epsilon is measured against the normals of the moment. A face has three corners and more, each of which may move once in a pass.
//! - A face without area has no normal: it may turn as it will. A face with area may not lose it.
//! - New places are rounded to the stored precision before they are tested: the mesh that is tested is the mesh that results.
//! - [`Options::max_error`] bounds an estimate: along every chain of collapses, the sum of the distances of new places from the planes
//!   of the faces they replaced. [`Options::vertex_weights`] mean nothing here. One thread.

mod pass;
mod turn;

use crate::finish::{Before, finish, target};
use crate::log::{CollapseLog, Recorded};
use crate::options::{Control, Level, Options, Outcome, SimplifyError, Stop};
use pass::Engine;
use progmesh_aif::{Collapse, Mesh};
use std::time::Instant;

/// Epsilon when none is given, degrees.
///
/// Decided on horse, bunny, igea and fandisk at 50, 10 and 4 % of the faces, among 8, 12, 16, 20, 30 and 60: a smaller angle gives a
/// smaller rms at the same count as long as it reaches the count. At 4 % the best is 12; 8 stops at 5 to 6 % on horse and bunny, and
/// from 16 on the rms grows everywhere.
pub const DEFAULT_EPSILON: f64 = 12.0;

/// One collapse, with all that is needed to undo it and do it again.
///
/// To undo: [`Mesh::split_vertex`], then give `corners` and `rows` back. Undo the last first.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// What happened to topology and position.
    pub collapse: Collapse,
    /// Corner slots whose wedge changed, and the wedge they had before; slots as they are when the collapse is undone.
    pub corners: &'a [(u32, u32)],
    /// Wedges whose values changed, and the channels they had before.
    pub rows: &'a [(u32, u64)],
    /// The values they had before, row after row.
    pub values: &'a [f32],
}

/// Follows a run collapse by collapse.
pub trait Recorder {
    /// The mesh before the first collapse. Every group of corners between seams has a wedge of its own by now, so that values can
    /// change in place; otherwise it is the input.
    fn begin(&mut self, mesh: &Mesh) {
        let _ = mesh;
    }

    /// A collapse was made.
    fn step(&mut self, step: &Step<'_>);

    /// A pass that made collapses has ended.
    fn level(&mut self, level: &Level);
}

/// What came of [`run`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Run {
    /// Why it ended.
    pub stop: Stop,
    /// Estimated error in model units.
    pub estimate: f64,
    /// The passes that made collapses.
    pub levels: Vec<Level>,
}

/// Simplifies `mesh` and tells `recorder` every collapse. The mesh is not compacted, so that the collapses can be undone.
///
/// Errors: an option out of its range; nothing has happened to the mesh then.
pub fn run(
    mesh: &mut Mesh,
    options: &Options,
    recorder: &mut dyn Recorder,
    control: &dyn Control,
) -> Result<Run, SimplifyError> {
    let target = target(options, mesh.triangle_count());
    let (stop, mut done) =
        run_all(std::slice::from_mut(mesh), &[1.0], options, target, Some(recorder), control)?;
    let (levels, estimate) = done.pop().unwrap_or_default();
    Ok(Run { stop, estimate, levels })
}

/// [`crate::simplify_all`] by this method.
pub(crate) fn simplify_all(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    control: &dyn Control,
) -> Result<Vec<Outcome>, SimplifyError> {
    let before: Vec<Before> = meshes.iter().map(Before::of).collect();
    let target = target(options, before.iter().map(|b| b.triangles).sum());
    let (stop, done) = run_all(meshes, scales, options, target, None, control)?;
    let each = meshes.iter_mut().zip(&before).zip(done);
    Ok(each.map(|((m, b), (levels, estimate))| finish(m, b, options, (stop, estimate, levels))).collect())
}

/// [`crate::record_all`] by this method.
pub(crate) fn record_all(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    target: usize,
    control: &dyn Control,
) -> Result<(Stop, Vec<Recorded>), SimplifyError> {
    let (stop, done, logs) = run_engines(meshes, scales, options, target, None, true, control)?;
    let each = done.into_iter().zip(logs);
    Ok((stop, each.map(|((levels, estimate), log)| Recorded { log, estimate, levels }).collect()))
}

/// The levels of a mesh, and its estimated error.
pub(crate) type Done = (Vec<Level>, f64);

/// Runs all meshes pass by pass until `target` triangles are left over all of them. Meshes are not compacted.
pub(crate) fn run_all(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    target: usize,
    recorder: Option<&mut dyn Recorder>,
    control: &dyn Control,
) -> Result<(Stop, Vec<Done>), SimplifyError> {
    run_engines(meshes, scales, options, target, recorder, false, control).map(|(stop, done, _)| (stop, done))
}

fn run_engines(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    target: usize,
    mut recorder: Option<&mut dyn Recorder>,
    logged: bool,
    control: &dyn Control,
) -> Result<(Stop, Vec<Done>, Vec<CollapseLog>), SimplifyError> {
    let epsilon = options.epsilon.unwrap_or(DEFAULT_EPSILON);
    if !(0.0..=180.0).contains(&epsilon) {
        return Err(SimplifyError::Range { option: "epsilon", value: epsilon, range: "0 to 180 degrees" });
    }
    // Nothing may be changed before all options are known to be good.
    let mut engines = Vec::with_capacity(meshes.len());
    for (i, (mesh, &scale)) in meshes.iter_mut().zip(scales).enumerate() {
        let vertices = mesh.vertex_count();
        let mut engine = Engine::new(mesh, &options.of_mesh(i), epsilon, scale)?;
        engine.log = logged.then(|| CollapseLog::for_vertices(vertices));
        engines.push(engine);
    }
    for engine in &mut engines {
        engine.begin(&mut recorder);
    }
    let mut levels: Vec<Vec<Level>> = vec![Vec::new(); engines.len()];
    let first: usize = engines.iter().map(Engine::triangles).sum();
    let mut left = first;
    let passes = options.passes.unwrap_or(usize::MAX);
    let mut stop = Stop::Passes;
    for pass in 1..=passes {
        if left <= target {
            stop = Stop::Target;
            break;
        }
        let (before, excess) = (left, left - target);
        let mut cancelled = false;
        for (engine, levels) in engines.iter_mut().zip(&mut levels) {
            // Each mesh gives its share of what is too much; what one cannot give is shared again in the next pass.
            let own = engine.triangles();
            let share = (excess as f64 * own as f64 / before as f64).ceil() as usize;
            let floor = own - share.min(left.saturating_sub(target)).min(own);
            let start = Instant::now();
            let mut poll = |now: usize| {
                let left = left - (own - now);
                control.progress(progress(first, left, target, pass, passes));
                cancelled = cancelled || control.cancelled();
                cancelled
            };
            let counts = engine.pass(floor, left - own, &mut recorder, &mut poll);
            left -= own - engine.triangles();
            if engine.triangles() < own {
                let level = Level {
                    pass,
                    faces: engine.faces(),
                    seconds: start.elapsed().as_secs_f64(),
                    tried: counts.0,
                    refused: counts.1,
                };
                if let Some(r) = &mut recorder {
                    r.level(&level);
                }
                levels.push(level);
            }
            if cancelled {
                break;
            }
        }
        if cancelled {
            stop = Stop::Cancelled;
            break;
        }
        if left == before {
            stop = if engines.iter().any(|e| e.bounded) { Stop::Error } else { Stop::NoLegalCollapse };
            break;
        }
    }
    if stop == Stop::Passes && left <= target {
        stop = Stop::Target;
    }
    let done = levels.into_iter().zip(&engines).map(|(l, e)| (l, e.estimate())).collect();
    let logs = engines.into_iter().map(|e| e.log.unwrap_or_default()).collect();
    Ok((stop, done, logs))
}

/// The part of the work that is done: towards the target, or the passes asked for, whichever is nearer.
fn progress(first: usize, left: usize, target: usize, pass: usize, passes: usize) -> f64 {
    let by_count = (first - left) as f64 / (first - target).max(1) as f64;
    let by_pass = (pass - 1) as f64 / passes as f64;
    by_count.max(by_pass).min(1.0)
}
