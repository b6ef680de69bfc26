//! As few triangles as a proven bound of the distance allows: a search over runs of the method.

use super::{Job, JobError, Part, Proven, Summary, run, scale};
use crate::aif::{Bits, Weld};
use crate::compare::{CompareError, Flattened};
use crate::scene::Scene;
use crate::simplify::measure::{CertifyOptions, MeasureError, Within, vertex_distances, within};
use crate::simplify::{Control, Stop};
use std::time::Instant;

/// The search ends where a number of triangles passes and one this much smaller does not. What is promised is 1.1.
const CLOSE: f64 = 1.05;
/// The first step from a number that passes to one that does not, or the other way, and how steps grow.
const STEP: f64 = 1.4;
const GROWTH: f64 = 1.2;
/// Of the bound: closer to it than this a result is not looked into further, and does not pass. The error falls about as the number of
/// triangles rises, so this costs half a per cent of them.
const NEAR: f64 = 0.005;
/// The estimate that the first run stops at, of the bound. Decided on bunny and dragon at a thousandth of the diagonal: from half the bound
/// the first run left 0.6 and 0.3 times the triangles that pass.
const ESTIMATE: f64 = 0.25;
/// Runs that a search takes, about; for the progress bar.
const RUNS: f64 = 12.0;
/// Where a run fails at a few places only (a thin fold that a quadric does not see is enough), the vertices there are kept and it runs
/// again, at most so often in a search: on bunny and dragon such places would cost half of all triangles.
const MENDS: usize = 4;
/// One vertex of so many may be kept, and `SPARE` more.
const KEPT: usize = 1000;
const SPARE: usize = 16;

/// A result that passed.
struct Passed {
    scene: Scene,
    summary: Summary,
    upper: f64,
}

/// Simplifies to the fewest triangles of which the distance is proven to be at most `job.options.max_error`.
pub(super) fn simplify(
    scene: Scene,
    input: &Flattened,
    job: &Job,
    control: &dyn Control,
) -> Result<(Scene, Summary), JobError> {
    let bound = job.options.max_error.ok_or(JobError::NoBound)?;
    let bound = if bound.relative { bound.value * scale::world_diagonal(&scene) } else { bound.value };
    let all = scene.unique_triangles();
    // Vertices of the scene are those of its mesh only where there is one, which is not welded.
    let vertices = scene.meshes.first().map_or(0, |m| m.geometry.positions.len());
    let single = scene.meshes.len() == 1 && vertices == input.positions.len() && job.weld == Weld::No;
    let may_keep = if single { vertices / KEPT + SPARE } else { 0 };
    let mut search = Search {
        scene: &scene,
        input,
        job,
        control,
        bound,
        kept: Bits::new(if single { vertices } else { 0 }),
        may_keep,
        mends: 0,
        runs: 0,
        seconds: [0.0; 3],
    };
    // Targets of the job end the search from below.
    let floor = super::target(&job.options, &[all], false).unwrap_or(1).clamp(1, all);

    // The number that passes is `high`, that does not is `low`; each `None` until there is one.
    let (mut high, mut low): (Option<usize>, Option<usize>) = (None, None);
    let mut best: Option<Passed> = None;
    let mut next = None;
    let mut step = STEP;
    loop {
        let (asked, found) = search.probe(next)?;
        let Some((passed, summary, scene)) = found else {
            // Cancelled: the input, as far as a caller cares.
            let (scene, mut summary) = search.unchanged()?;
            summary.stop = Stop::Cancelled;
            return Ok((scene, summary));
        };
        let got = summary.triangles_out;
        // With an estimate for a target, the number that came of it stands for it.
        let asked = asked.unwrap_or(got).max(floor);
        // Fewer cannot be had.
        let stuck = got > asked;
        match passed {
            Some(upper) => {
                high = Some(asked);
                if best.as_ref().is_none_or(|b| got <= b.summary.triangles_out) {
                    best = Some(Passed { scene, summary, upper });
                }
                if stuck || asked <= floor {
                    break;
                }
            }
            None => {
                low = Some(asked.max(low.unwrap_or(0)));
                if asked >= all {
                    break;
                }
            }
        }
        next = Some(match (high, low) {
            (Some(h), Some(l)) if (h as f64) <= CLOSE * l as f64 || h <= l + 1 => break,
            (Some(h), Some(l)) => ((h as f64 * l as f64).sqrt().round() as usize).clamp(l + 1, h - 1),
            (Some(h), None) => ((h as f64 / step) as usize).clamp(floor, h - 1),
            (None, Some(l)) => ((l as f64 * step).ceil() as usize).clamp((l + 1).min(all), all),
            (None, None) => break,
        });
        if high.is_none() || low.is_none() {
            step *= GROWTH;
        }
    }
    let passed = best.map(|b| (b.scene, b.summary, b.upper));
    let (scene, mut summary, upper) = match passed {
        Some(passed) => passed,
        // Nothing passes but the input itself.
        None => {
            let (scene, summary) = search.unchanged()?;
            (scene, summary, 0.0)
        }
    };
    let target = super::target(&job.options, &[all], false);
    let reached = target.is_some_and(|t| summary.triangles_out <= t);
    summary.stop = match summary.stop {
        _ if reached => Stop::Target,
        Stop::NoLegalCollapse if low.is_none() => Stop::NoLegalCollapse,
        _ => Stop::Error,
    };
    summary.target = None;
    summary.certified = Some(Proven { bound, upper, runs: search.runs });
    [summary.build_seconds, summary.simplify_seconds, summary.measure_seconds] = search.seconds;
    Ok((scene, summary))
}

struct Search<'a> {
    scene: &'a Scene,
    input: &'a Flattened,
    job: &'a Job,
    control: &'a dyn Control,
    bound: f64,
    /// Vertices that runs do not touch.
    kept: Bits,
    /// How many these may become.
    may_keep: usize,
    mends: usize,
    runs: usize,
    /// Building, simplifying, measuring.
    seconds: [f64; 3],
}

/// The bound that was proven, if it was; what came of the run.
type Probe = (Option<f64>, Summary, Scene);

/// What became of a result.
enum Verdict {
    /// Its distance is proven to be at most this.
    Passed(f64),
    /// It is not; these vertices of the input are at the places where, as far as is known.
    Failed(Vec<u32>),
}

impl Search<'_> {
    /// A run to this many triangles, or by the estimate, and again where keeping a few vertices may help; `None` when cancelled.
    fn probe(&mut self, triangles: Option<usize>) -> Result<(Option<usize>, Option<Probe>), JobError> {
        loop {
            let Some((scene, summary)) = self.run_once(triangles)? else { return Ok((triangles, None)) };
            let now = Instant::now();
            let [start, share] = self.share();
            let control = Part::new(self.control, start + 0.5 * share, 0.5 * share);
            let verdict = match self.judge(&scene, &control) {
                Err(CompareError::Measure(MeasureError::Cancelled)) => return Ok((triangles, None)),
                verdict => verdict?,
            };
            self.seconds[2] += now.elapsed().as_secs_f64();
            let upper = match verdict {
                Verdict::Passed(upper) => Some(upper),
                Verdict::Failed(places) if self.keep(&places) => continue,
                Verdict::Failed(_) => None,
            };
            return Ok((triangles, Some((upper, summary, scene))));
        }
    }

    /// The part of the progress that the present run has.
    fn share(&self) -> [f64; 2] {
        let start = (self.runs.saturating_sub(1) as f64 / RUNS).min(0.95);
        [start, (1.0 / RUNS).min(0.99 - start)]
    }

    fn run_once(&mut self, triangles: Option<usize>) -> Result<Option<(Scene, Summary)>, JobError> {
        let mut job = self.job.clone();
        (job.certified, job.measure, job.per_mesh) = (false, false, false);
        job.options.ratio = None;
        job.options.triangles = triangles;
        job.options.max_error = match (triangles, self.job.options.max_error) {
            (None, Some(mut e)) => {
                job.options.triangles =
                    super::target(&self.job.options, &[self.scene.unique_triangles()], false);
                e.value *= ESTIMATE;
                Some(e)
            }
            _ => None,
        };
        if self.mends > 0 {
            let given = &job.options.locked_vertices;
            let mut locked = self.kept.clone();
            let also = (0..self.input.positions.len()).filter(|&v| given.get(v));
            also.for_each(|v| locked.set(v));
            job.options.locked_vertices = locked;
        }
        self.runs += 1;
        let [start, share] = self.share();
        let part = Part::new(self.control, start, 0.5 * share);
        let (scene, summary) = run(self.scene.clone(), &job, &part)?;
        self.seconds[0] += summary.build_seconds;
        self.seconds[1] += summary.simplify_seconds;
        Ok((summary.stop != Stop::Cancelled).then_some((scene, summary)))
    }

    /// Keeps these vertices from now on, if they are few.
    fn keep(&mut self, places: &[u32]) -> bool {
        let new = places.iter().filter(|&&v| !self.kept.get(v as usize)).count();
        if new == 0 || self.mends >= MENDS || self.kept.count() + new > self.may_keep {
            return false;
        }
        self.mends += 1;
        places.iter().for_each(|&v| self.kept.set(v as usize));
        true
    }

    /// The vertices of the input that are too far from a result, and those near vertices of it that are too far from the input.
    fn far(&self, result: &Flattened, control: &dyn Control) -> Result<Vec<u32>, MeasureError> {
        let input = &self.input.surface;
        let there = vertex_distances(input, &result.surface, &Part::new(control, 0.0, 0.2))?;
        let mut far: Vec<u32> = (0..).zip(&there).filter(|(_, d)| **d > self.bound).map(|(v, _)| v).collect();
        let back = vertex_distances(&result.surface, input, &Part::new(control, 0.2, 0.1))?;
        if far.len() <= self.may_keep {
            let mut query = input.query();
            for (v, _) in back.iter().enumerate().filter(|(_, d)| **d > self.bound) {
                let closest = query.closest(result.positions.get(v));
                far.extend(self.input.triangles.get(closest.triangle as usize).into_iter().flatten());
            }
        }
        Ok(far)
    }

    fn judge(&self, result: &Scene, control: &dyn Control) -> Result<Verdict, CompareError> {
        let result = match Flattened::of(result) {
            Err(CompareError::Measure(MeasureError::NoTriangle)) => return Ok(Verdict::Failed(vec![])),
            result => result?,
        };
        if self.mends < MENDS && self.may_keep > 0 {
            let far = self.far(&result, control)?;
            if !far.is_empty() {
                return Ok(Verdict::Failed(far));
            }
        }
        let mut options = CertifyOptions::with_tolerance(NEAR * self.bound);
        options.threads = self.job.options.threads;
        let control = Part::new(control, 0.3, 0.7);
        Ok(match within(&self.input.surface, &result.surface, self.bound, &options, &control)? {
            Within::Yes { upper } => Verdict::Passed(upper),
            // Where it is not even a vertex that is too far, there are more such places than one.
            _ => Verdict::Failed(vec![]),
        })
    }

    /// The input as it is, and a summary that says so.
    fn unchanged(&self) -> Result<(Scene, Summary), JobError> {
        let mut job = Job::default();
        job.options.triangles = Some(self.scene.unique_triangles());
        let (_, mut summary) = run(self.scene.clone(), &job, &crate::simplify::Quiet)?;
        let meshes = || self.scene.meshes.iter().map(|m| &m.geometry);
        summary.faces_out = meshes().map(|g| g.face_count()).sum();
        summary.vertices_out = meshes().map(|g| g.positions.len()).sum();
        summary.triangles_out = self.scene.unique_triangles();
        summary.warnings = vec!["no simpler mesh passes: the result is the input as it was".into()];
        (summary.stop, summary.estimate) = (Stop::Error, 0.0);
        Ok((self.scene.clone(), summary))
    }
}
