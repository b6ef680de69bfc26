//! As few triangles as a proven bound of the distance allows: a search over runs of the method.

use super::{Job, JobError, Part, Proven, Summary, run, run_keeping, scale};
use crate::aif::{Bits, Positions};
use crate::compare::{CompareError, Flattened};
use crate::io::flatten::origins;
use crate::scene::Scene;
use crate::simplify::measure::{CertifyOptions, MeasureError, Place, exceeding};
use crate::simplify::{Control, Stop};
use std::collections::BTreeMap;
use std::time::Instant;

/// The search ends where a number of triangles passes and one this much smaller does not. What is promised is 1.1.
const CLOSE: f64 = 1.05;
/// From a number that passes to one that does not, or the other way, at most by these factors.
const DOWN: f64 = 3.0;
const UP: f64 = 3.0;
/// A guess is taken this much to the safe side of what the last runs suggest.
const SAFE: f64 = 1.02;
/// Of the bound: closer to it than this a result is not looked into further, and does not pass. The error falls about as the number of
/// triangles rises, so this costs half a per cent of them.
const NEAR: f64 = 0.005;
/// The estimate that the first run stops at, of the bound. Decided on bunny and dragon at a thousandth of the diagonal: from half the bound
/// the first run left 0.6 and 0.3 times the triangles that pass.
const ESTIMATE: f64 = 0.25;
/// Runs that a search takes, about; for the progress bar.
const RUNS: f64 = 12.0;
/// Where a run fails at a few places only (a thin fold that a quadric does not see is enough), the vertices there are kept and it runs
/// again, at most so often in a row: on dragon such places would cost more than nine tenths of all triangles.
const MENDS: usize = 3;
/// So many vertices may be kept: one for so many triangles of the result, and `SPARE` more.
const KEPT: usize = 20;
const SPARE: usize = 16;
/// Places are not all looked for where they are more than so many a triangle that may be mended.
const PLACES: usize = 40;
/// Once a result has no more triangles than a plain run that fails, what is promised is kept. The search goes on only while all runs together
/// took in fewer triangles than this: seconds. Bunny at a thousandth of the diagonal comes from 20,000 down to 10,000 by then.
const WORK: usize = 1_000_000;

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
    // What is written in single precision moves by that much.
    let exact = matches!(input.positions, Positions::F32(_));
    let (lo, hi) = input.surface.bounds();
    let rounding =
        if exact { 0.0 } else { 3f64.sqrt() * lo.abs().max(hi.abs()).max_element() * 2f64.powi(-24) };
    let mut search = Search {
        scene: &scene,
        input,
        job,
        control,
        bound: bound - rounding.min(bound),
        rounding,
        kept: Kept::of(&scene),
        fails_plain: 0,
        runs: 0,
        seconds: [0.0; 3],
    };
    // Targets of the job end the search from below.
    let floor = super::target(&job.options, &[all], false).unwrap_or(1).clamp(1, all);

    let mut range = Range::new(search.bound, floor, all);
    let mut best: Option<Passed> = None;
    let mut next = None;
    loop {
        let (asked, found) = search.probe(next)?;
        let Some(Probe { upper, spread, summary, scene }) = found else {
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
        range.add(asked, spread, upper.is_some());
        if let Some(upper) = upper {
            if best.as_ref().is_none_or(|b| got <= b.summary.triangles_out) {
                best = Some(Passed { scene, summary, upper });
            }
            if stuck {
                break;
            }
        }
        let promised = range.high.is_some_and(|h| h as f64 <= CLOSE * search.fails_plain as f64);
        if promised && search.runs * all >= WORK {
            break;
        }
        match range.next() {
            Some(n) => next = Some(n),
            None => break,
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
        Stop::NoLegalCollapse if range.low.is_none() => Stop::NoLegalCollapse,
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
    /// What results have to keep, before they are rounded.
    bound: f64,
    rounding: f64,
    /// Vertices that runs do not touch.
    kept: Kept,
    /// The greatest number of triangles that does not pass while no vertex is kept.
    fails_plain: usize,
    runs: usize,
    /// Building, simplifying, measuring.
    seconds: [f64; 3],
}

/// What came of a run.
struct Probe {
    /// The bound that was proven, if it was.
    upper: Option<f64>,
    /// How far the triangles of the result are from the vertices of the input, but for as many as may be mended.
    spread: f64,
    summary: Summary,
    scene: Scene,
}

/// What became of a result.
struct Verdict {
    upper: Option<f64>,
    spread: f64,
    /// Vertices of the input at the places that are too far, if they are few enough to be kept.
    far: Vec<u32>,
}

impl Search<'_> {
    /// A run to this many triangles, or by the estimate, and again where keeping a few vertices may help; `None` when cancelled.
    fn probe(&mut self, triangles: Option<usize>) -> Result<(Option<usize>, Option<Probe>), JobError> {
        let mut mends = MENDS;
        loop {
            let Some((scene, summary)) = self.run_once(triangles)? else { return Ok((triangles, None)) };
            let now = Instant::now();
            let [start, share] = self.share();
            let control = Part::new(self.control, start + 0.5 * share, 0.5 * share);
            let Verdict { upper, spread, far } = match self.judge(&scene, &control) {
                Err(CompareError::Measure(MeasureError::Cancelled)) => return Ok((triangles, None)),
                verdict => verdict?,
            };
            self.seconds[2] += now.elapsed().as_secs_f64();
            if upper.is_none() && self.kept.count() == 0 {
                self.fails_plain = self.fails_plain.max(summary.triangles_out);
            }
            if upper.is_none() && !far.is_empty() {
                far.iter().for_each(|&v| self.kept.add(v));
                if mends > 0 {
                    mends -= 1;
                    continue;
                }
            }
            return Ok((triangles, Some(Probe { upper, spread, summary, scene })));
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
        self.runs += 1;
        let [start, share] = self.share();
        let part = Part::new(self.control, start, 0.5 * share);
        let (scene, summary) = run_keeping(self.scene.clone(), &job, &self.kept.of_mesh, &part)?;
        self.seconds[0] += summary.build_seconds;
        self.seconds[1] += summary.simplify_seconds;
        Ok((summary.stop != Stop::Cancelled).then_some((scene, summary)))
    }

    /// How many more places of a result of so many triangles may be kept.
    fn spare(&self, triangles: usize) -> usize {
        // A place in the middle of a triangle takes its three corners.
        (triangles / KEPT + SPARE).saturating_sub(self.kept.count()) / 3
    }

    fn judge(&self, result: &Scene, control: &dyn Control) -> Result<Verdict, CompareError> {
        let result = match Flattened::of(result) {
            Err(CompareError::Measure(MeasureError::NoTriangle)) => {
                return Ok(Verdict { upper: None, spread: f64::INFINITY, far: vec![] });
            }
            result => result?,
        };
        let spare = self.spare(result.triangles.len());
        let mut options = CertifyOptions::with_tolerance(NEAR * self.bound);
        options.threads = self.job.options.threads;
        // Many vertices of the input lie over one triangle of the result.
        let limit = spare.saturating_mul(PLACES);
        let found = exceeding(&self.input.surface, &result.surface, self.bound, limit, &options, control)?;
        let mut all = found.by_triangle;
        let rank = all.len().saturating_sub(spare + 1);
        let spread = if all.is_empty() { 0.0 } else { *all.select_nth_unstable_by(rank, f64::total_cmp).1 };
        let mut far = Vec::new();
        if found.upper.is_none() && found.places.len() <= limit {
            far = self.vertices_at(&found.places, spare);
        }
        Ok(Verdict { upper: found.upper.map(|u| u + self.rounding), spread, far })
    }

    /// Vertices of the input at places, those that are kept already left out: at all of them, or, if that is too many, at the worst of every
    /// triangle of the result; none if the triangles are more than `most`.
    fn vertices_at(&self, places: &[Place], most: usize) -> Vec<u32> {
        let mut worst: BTreeMap<u32, &Place> = BTreeMap::new();
        for place in places {
            let triangle = if place.on_a { place.closest_triangle } else { place.triangle };
            let at = worst.entry(triangle).or_insert(place);
            if place.distance > at.distance {
                *at = place;
            }
        }
        if worst.len() > most {
            return vec![];
        }
        let mut all = Vec::new();
        places.iter().for_each(|p| self.vertices_of(p, &mut all));
        all.sort_unstable();
        all.dedup();
        if all.len() > 3 * most {
            all.clear();
            worst.values().for_each(|p| self.vertices_of(p, &mut all));
        }
        all
    }

    /// Adds the vertex of the input at a place; where there is none, the corners of the triangle.
    fn vertices_of(&self, place: &Place, found: &mut Vec<u32>) {
        let triangle = if place.on_a { place.triangle } else { place.closest_triangle };
        let Some(corners) = self.input.triangles.get(triangle as usize) else { return };
        let at =
            |v: &u32| self.input.positions.get(*v as usize).distance(place.point) <= 1e-9 * place.distance;
        let new = |v: &u32| !self.kept.has(*v);
        match corners.iter().find(|v| at(v) && new(v)) {
            Some(&v) => found.push(v),
            None => found.extend(corners.iter().filter(|v| new(v))),
        }
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

/// Vertices of a scene's meshes, named by the vertices of the flattened scene.
struct Kept {
    /// The first vertex of every instance, and its mesh; ascending.
    instances: Vec<(u32, usize)>,
    /// Of each mesh.
    of_mesh: Vec<Bits>,
}

impl Kept {
    /// None yet.
    fn of(scene: &Scene) -> Kept {
        let mut first = 0;
        let mut begin = |(mesh, vertices): (usize, usize)| {
            first += vertices as u32;
            (first - vertices as u32, mesh)
        };
        let instances = origins(scene).into_iter().map(&mut begin).collect();
        let of_mesh = scene.meshes.iter().map(|m| Bits::new(m.geometry.positions.len())).collect();
        Kept { instances, of_mesh }
    }

    /// The mesh of a flattened vertex, and its number there.
    fn origin(&self, v: u32) -> Option<(usize, usize)> {
        let i = self.instances.partition_point(|i| i.0 <= v).checked_sub(1)?;
        let (first, mesh) = self.instances[i];
        Some((mesh, (v - first) as usize))
    }

    fn has(&self, v: u32) -> bool {
        self.origin(v).is_some_and(|(mesh, v)| self.of_mesh[mesh].get(v))
    }

    fn add(&mut self, v: u32) {
        if let Some((mesh, v)) = self.origin(v) {
            self.of_mesh[mesh].set(v);
        }
    }

    fn count(&self) -> usize {
        self.of_mesh.iter().map(Bits::count).sum()
    }
}

/// What is known of the numbers of triangles that pass.
struct Range {
    bound: f64,
    floor: usize,
    all: usize,
    /// The least that passes.
    high: Option<usize>,
    /// The greatest that does not.
    low: Option<usize>,
    /// The last runs: triangles and how far vertices are.
    last: Option<(usize, f64)>,
    before: Option<(usize, f64)>,
    /// How often numbers were raised in a row.
    raised: i32,
    /// The ratio between the two at the last guess.
    ratio: f64,
}

impl Range {
    fn new(bound: f64, floor: usize, all: usize) -> Self {
        let (high, low, last, before) = (None, None, None, None);
        Range { bound, floor, all, high, low, last, before, raised: 0, ratio: f64::INFINITY }
    }

    fn add(&mut self, triangles: usize, spread: f64, passed: bool) {
        match passed {
            true => self.high = Some(triangles.min(self.high.unwrap_or(triangles))),
            false => self.low = Some(triangles.max(self.low.unwrap_or(0))),
        }
        self.raised = if passed { 0 } else { self.raised + 1 };
        // Vertices that are near enough say nothing of what keeps a result from passing.
        let spread = if passed { spread } else { spread.max(self.bound) };
        self.before = self.last.filter(|&(n, _)| n != triangles).or(self.before);
        self.last = Some((triangles, spread));
    }

    /// Where the bound is met: distances fall with some power of the number of triangles, the first if nothing else is known.
    fn guess(&self) -> f64 {
        let Some((n, d)) = self.last else { return self.all as f64 };
        let power = self.before.map_or(1.0, |(m, e)| (e / d).ln() / (n as f64 / m as f64).ln());
        let power = if power.is_finite() { power.clamp(0.6, 2.0) } else { 1.0 };
        SAFE * n as f64 * (d / self.bound).max(1e-6).powf(1.0 / power)
    }

    /// The number to try next; `None` when the search is over.
    fn next(&mut self) -> Option<usize> {
        let guess = self.guess();
        // Inside by so much that the search is over if it is as guessed.
        let step = 0.1 + 0.9 * CLOSE;
        let next = match (self.high, self.low) {
            (Some(h), _) if h <= self.floor => return None,
            (_, Some(l)) if l >= self.all => return None,
            (Some(h), Some(l)) => {
                let ratio = h as f64 / l as f64;
                if ratio <= CLOSE || h <= l + 1 {
                    return None;
                }
                let slow = ratio.ln() > 0.5 * self.ratio.ln();
                self.ratio = ratio;
                let (lo, hi) = (l as f64 * step, h as f64 / step);
                if slow || lo >= hi { (h as f64 * l as f64).sqrt() } else { guess.clamp(lo, hi) }
            }
            (Some(h), None) => guess.clamp(h as f64 / DOWN, h as f64 / step),
            (None, Some(l)) => {
                let least = (1.0 + 0.15 * f64::from(self.raised)).min(UP);
                guess.clamp(l as f64 * least, l as f64 * UP)
            }
            (None, None) => return None,
        };
        let (least, most) = (self.low.map_or(self.floor, |l| l + 1), self.high.map_or(self.all, |h| h - 1));
        Some((next.round() as usize).clamp(self.floor.max(least.min(most)), most.max(self.floor)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::Weld;
    use crate::meshes::{GenerateOptions, generate};
    use crate::scene::{Node, SceneMesh};
    use crate::simplify::{Method, Placement, Quiet};
    use glam::{DMat4, DVec3};

    fn mesh(name: &str) -> SceneMesh {
        let sample = generate(name, &GenerateOptions::default().with_faces(900)).unwrap();
        let mut mesh = crate::samples::scene(sample, name).meshes.remove(0);
        // Every triangle has vertices of its own, as in STL.
        let g = &mut mesh.geometry;
        g.positions = g.positions.gather(&g.corners);
        g.corners = (0..g.corners.len() as u32).collect();
        (g.wedges, g.wires) = (None, vec![]);
        mesh
    }

    #[test]
    fn kept_vertices_stay_in_every_mesh_by_every_method() {
        let mut scene = Scene::from_mesh(mesh("torus"));
        scene.meshes.push(mesh("sphere"));
        (scene.nodes, scene.roots) = (vec![], vec![]);
        let mut kept = Kept::of(&scene);
        // Of the torus every 97th, of the sphere every 61st, by their numbers in the flattened scene.
        let torus = scene.meshes[0].geometry.positions.len() as u32;
        let sphere = scene.meshes[1].geometry.positions.len() as u32;
        (0..torus).step_by(97).for_each(|v| kept.add(v));
        (torus..torus + sphere).step_by(61).for_each(|v| kept.add(v));
        for (method, placement, refit) in [
            (Method::Quadric, Placement::Optimal, 3),
            (Method::Quadric, Placement::Endpoint, 0),
            (Method::Nsa, Placement::Midpoint, 0),
            (Method::Cluster, Placement::Optimal, 0),
        ] {
            let mut job = Job { weld: Weld::BitEqual, ..Job::default() };
            (job.options.method, job.options.placement) = (method, Some(placement));
            (job.options.refit, job.options.epsilon) = (Some(refit), (method == Method::Nsa).then_some(60.0));
            job.options.ratio = Some(0.2);
            let (result, _) = run_keeping(scene.clone(), &job, &kept.of_mesh, &Quiet).unwrap();
            let (plain, _) = run(scene.clone(), &job, &Quiet).unwrap();
            for (m, of) in kept.of_mesh.iter().enumerate() {
                let at = |s: &Scene| s.meshes[m].geometry.positions.iter().collect::<Vec<DVec3>>();
                let (before, after, without) = (at(&scene), at(&result), at(&plain));
                assert!(of.count() > 10);
                let missing = |there: &[DVec3]| of.iter().filter(|&v| !there.contains(&before[v])).count();
                // A cluster may lose all triangles around a vertex that stays.
                let allowed = if method == Method::Cluster { of.count() / 4 } else { 0 };
                let which = format!("{method:?} {placement:?}, mesh {m}");
                assert!(missing(&after) <= allowed, "{which}: {} are gone", missing(&after));
                assert!(missing(&without) > allowed, "{which}: kept anyway");
            }
        }
    }

    #[test]
    fn vertices_of_instances_are_those_of_their_mesh() {
        let mut scene = Scene::from_mesh(mesh("torus"));
        scene.meshes.push(mesh("sphere"));
        let [torus, sphere] = [0, 1].map(|m: usize| scene.meshes[m].geometry.positions.len() as u32);
        let node = |mesh, x: f64| Node {
            name: None,
            transform: DMat4::from_translation(DVec3::X * x),
            mesh: Some(mesh),
            children: vec![],
        };
        scene.nodes = vec![node(1, 0.0), node(0, 5.0), node(1, 9.0)];
        scene.roots = vec![0, 1, 2];
        let mut kept = Kept::of(&scene);
        let of = |v| kept.origin(v);
        assert_eq!((of(0), of(sphere - 1)), (Some((1, 0)), Some((1, sphere as usize - 1))));
        assert_eq!((of(sphere), of(sphere + torus + 2)), (Some((0, 0)), Some((1, 2))));
        kept.add(sphere + torus + 2);
        assert!(kept.has(2) && !kept.has(sphere + 2));
        assert_eq!(kept.count(), 1);
        // What is flattened has them there.
        let flat = Flattened::of(&scene).unwrap();
        let home = scene.meshes[1].geometry.positions.get(2);
        let there = flat.positions.get((sphere + torus + 2) as usize);
        assert!(there.distance(home + DVec3::X * 9.0) < 1e-5);
    }
}
