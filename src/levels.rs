//! Levels of detail in numbers: how long each takes to make, to leave and to come back to, and how far it is from the input.
//!
//! NSA's passes are its levels (Silva & Gomes); the quadric method is held against it at the same counts. Each level is made once by
//! simplification and then reached again with the splits that were recorded, in both directions.

use crate::compare::{CompareError, Flattened};
use crate::pipeline::{
    Job, JobError, Part, Preparation, build_progressive, prepare, simplify_scene, world_bounds,
};
use crate::progressive::{Detail, ProgressiveScene};
use crate::refine::progressive::Damage;
use crate::refine::{Cursor, ProgressiveMesh};
use crate::scene::Scene;
use crate::simplify::measure::{DistanceOptions, MeasureError, Summary, distance};
use crate::simplify::{Control, Method, Stop};
use std::sync::Mutex;
use std::time::Instant;

/// What to measure. Start from `LevelsOptions::default()` and set what differs.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LevelsOptions {
    /// Options of NSA; welding. One thread is used whatever it says. Without passes and targets NSA runs until nothing is left.
    pub job: Job,
    /// The methods to show; NSA sets the counts in any case.
    pub methods: Vec<Method>,
    /// Every time is the median of so many runs; at least 1.
    pub runs: usize,
    /// Samples of the distance on each side; `None` measures none.
    pub samples: Option<usize>,
}

impl Default for LevelsOptions {
    fn default() -> Self {
        LevelsOptions {
            job: Job::default(),
            methods: vec![Method::Nsa, Method::Quadric],
            runs: 5,
            samples: Some(100_000),
        }
    }
}

/// A level, and the step from the next finer one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Level {
    /// Triangles.
    pub faces: usize,
    /// Splits between this level and the next finer one.
    pub splits: usize,
    /// Seconds that simplification took from the next finer level to this.
    pub simplify_seconds: f64,
    /// Seconds to come here from the next finer level by the records.
    pub coarsen_seconds: f64,
    /// Seconds to go back.
    pub refine_seconds: f64,
    /// Distance to the input, both directions, world units.
    pub error: Option<Summary>,
}

/// The levels of a method.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MethodLevels {
    /// The method.
    pub method: Method,
    /// Its levels, finest first, without the input.
    pub levels: Vec<Level>,
}

/// What came of [`levels`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Levels {
    /// Triangles of the input.
    pub faces: usize,
    /// Diagonal of the input's bounds, world units.
    pub diagonal: f64,
    /// Each method asked for.
    pub methods: Vec<MethodLevels>,
    /// What was changed that was not asked for.
    pub warnings: Vec<String>,
}

/// Why there are no levels.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LevelsError {
    /// The input is wrong, or an option is.
    #[error(transparent)]
    Job(#[from] JobError),
    /// Nothing to measure.
    #[error(transparent)]
    Measure(#[from] CompareError),
    /// The records contradict each other: a fault of this program.
    #[error("the records of mesh {0} are damaged: {1}; please report this")]
    Damage(usize, Damage),
    /// The caller asked for a stop.
    #[error("cancelled")]
    Cancelled,
}

/// Measures the levels of a scene. Polygons are cut into triangles first.
///
/// The time of a pass is NSA's own. The quadric method has no passes: it runs once down to NSA's last count, and the clock is read as it reports
/// progress, in between by proportion. Measuring errors uses all threads, everything else one.
pub fn levels(
    mut scene: Scene,
    options: &LevelsOptions,
    control: &dyn Control,
) -> Result<Levels, LevelsError> {
    let mut how = Preparation::default();
    (how.weld, how.triangulate) = (options.job.weld, true);
    let warnings = prepare(&mut scene, &how)?;
    let diagonal = world_bounds(&scene).map_or(0.0, |(lo, hi)| lo.distance(hi));
    let faces = scene.unique_triangles();
    let input = options.samples.map(|_| Flattened::of(&scene)).transpose()?;
    let runs = options.runs.max(1);

    let mut nsa = options.job.clone();
    (nsa.options.method, nsa.options.threads, nsa.measure, nsa.certified) =
        (Method::Nsa, Some(1), false, false);
    let mut passes: Vec<Vec<f64>> = Vec::new();
    let mut counts = Vec::new();
    let shows = |m| options.methods.contains(&m);
    let of_nsa = if shows(Method::Nsa) { runs } else { 1 };
    for run in 0..of_nsa {
        let part = Part::new(control, 0.2 * run as f64 / of_nsa as f64, 0.2 / of_nsa as f64);
        let (_, summary) = simplify_scene(scene.clone(), &nsa, &part)?;
        stop_if(summary.stop == Stop::Cancelled)?;
        counts = summary.levels.iter().map(|l| l.faces).collect();
        passes.push(summary.levels.iter().map(|l| l.seconds).collect());
    }
    let mut methods = Vec::new();
    let measured = |job: &Job, seconds: Vec<f64>, start: f64| -> Result<MethodLevels, LevelsError> {
        let built = build_progressive(scene.clone(), job, &Part::new(control, start, 0.1))?;
        stop_if(built.stop == Stop::Cancelled)?;
        let mut levels = replay(&built.scene, &counts, runs)?;
        levels.iter_mut().zip(seconds).for_each(|(l, s)| l.simplify_seconds = s);
        if let (Some(input), Some(samples)) = (&input, options.samples) {
            let n = levels.len().max(1) as f64;
            for (k, level) in levels.iter_mut().enumerate() {
                let part = Part::new(control, start + 0.1 + 0.2 * k as f64 / n, 0.2 / n);
                level.error = error(&built.scene, counts[k], input, samples, &part)?;
            }
        }
        Ok(MethodLevels { method: job.options.method, levels })
    };
    if shows(Method::Nsa) {
        methods.push(measured(&nsa, medians(&passes), 0.2)?);
    }
    if shows(Method::Quadric) {
        let mut job = Job::default();
        job.weld = options.job.weld;
        job.options.threads = Some(1);
        job.options.triangles = Some(counts.last().copied().unwrap_or(faces));
        let mut times = Vec::new();
        for run in 0..runs {
            let part = Part::new(control, 0.5 + 0.2 * run as f64 / runs as f64, 0.2 / runs as f64);
            let clock = Clock { control: &part, start: Instant::now(), read: Mutex::new(vec![]) };
            let (_, summary) = simplify_scene(scene.clone(), &job, &clock)?;
            stop_if(summary.stop == Stop::Cancelled)?;
            times.push(clock.times(summary.build_seconds, faces, &counts));
        }
        methods.push(measured(&job, medians(&times), 0.7)?);
    }
    control.progress(1.0);
    Ok(Levels { faces, diagonal, methods, warnings })
}

fn stop_if(cancelled: bool) -> Result<(), LevelsError> {
    if cancelled { Err(LevelsError::Cancelled) } else { Ok(()) }
}

/// Levels at these counts, with the times of moving between them.
fn replay(scene: &ProgressiveScene, counts: &[usize], runs: usize) -> Result<Vec<Level>, LevelsError> {
    let mut stops = vec![scene.positions(Detail::Full)];
    stops.extend(counts.iter().map(|&c| scene.positions(Detail::Triangles(c))));
    let mut cursors = Vec::new();
    for (i, mesh) in scene.meshes.iter().enumerate() {
        cursors.push(mesh.cursor().map_err(|e| LevelsError::Damage(i, e))?);
    }
    let seek = |cursors: &mut Vec<Cursor<&ProgressiveMesh>>, to: &[usize]| -> Result<f64, LevelsError> {
        let start = Instant::now();
        for (i, (c, &to)) in cursors.iter_mut().zip(to).enumerate() {
            c.seek(to).map_err(|e| LevelsError::Damage(i, e))?;
        }
        Ok(start.elapsed().as_secs_f64())
    };
    let mut faces = Vec::new();
    let (mut down, mut up) = (Vec::new(), Vec::new());
    // The first way up only warms the caches, as all others find them.
    seek(&mut cursors, &stops[0])?;
    for _ in 0..runs {
        faces.clear();
        let mut seconds = Vec::new();
        for to in &stops[1..] {
            seconds.push(seek(&mut cursors, to)?);
            faces.push(cursors.iter().map(Cursor::face_count).sum::<usize>());
        }
        down.push(seconds);
        let back: Result<Vec<f64>, _> =
            stops[..counts.len()].iter().rev().map(|to| seek(&mut cursors, to)).collect();
        let mut back = back?;
        back.reverse();
        up.push(back);
    }
    let splits = stops.windows(2).map(|w| w[0].iter().zip(&w[1]).map(|(a, b)| a - b).sum());
    let times = medians(&down).into_iter().zip(medians(&up));
    Ok(faces
        .into_iter()
        .zip(splits)
        .zip(times)
        .map(|((faces, splits), (coarsen_seconds, refine_seconds))| Level {
            faces,
            splits,
            simplify_seconds: 0.0,
            coarsen_seconds,
            refine_seconds,
            error: None,
        })
        .collect())
}

/// The distance of a level from the input; `None` where no triangle is left.
fn error(
    scene: &ProgressiveScene,
    count: usize,
    input: &Flattened,
    samples: usize,
    control: &dyn Control,
) -> Result<Option<Summary>, LevelsError> {
    let at =
        scene.at(&scene.positions(Detail::Triangles(count))).map_err(|(i, e)| LevelsError::Damage(i, e))?;
    if at.unique_triangles() == 0 {
        return Ok(None);
    }
    let mut options = DistanceOptions::default();
    options.samples = samples;
    match distance(&input.surface, &Flattened::of(&at)?.surface, &options, control) {
        Ok(d) => Ok(Some(d.worse)),
        Err(MeasureError::Cancelled) => Err(LevelsError::Cancelled),
        Err(e) => Err(CompareError::Measure(e).into()),
    }
}

/// Column by column the median of the rows.
fn medians(rows: &[Vec<f64>]) -> Vec<f64> {
    let columns = rows.iter().map(Vec::len).min().unwrap_or(0);
    (0..columns)
        .map(|c| {
            let mut column: Vec<f64> = rows.iter().map(|r| r[c]).collect();
            column.sort_by(f64::total_cmp);
            let n = column.len();
            if n % 2 == 1 { column[n / 2] } else { (column[n / 2 - 1] + column[n / 2]) / 2.0 }
        })
        .collect()
}

/// Notes when how much of the work is done.
struct Clock<'a> {
    control: &'a dyn Control,
    start: Instant,
    /// Part done, seconds since the start.
    read: Mutex<Vec<(f64, f64)>>,
}

impl Clock<'_> {
    /// The time of each level: from `faces` triangles to the first of `counts`, from there to the next, and so on. `from` is when the
    /// work proper began.
    fn times(&self, from: f64, faces: usize, counts: &[usize]) -> Vec<f64> {
        let mut read = vec![(0.0, from)];
        if let Ok(noted) = self.read.lock() {
            read.extend(noted.iter().filter(|r| r.1 >= from));
        }
        read.push((1.0, self.start.elapsed().as_secs_f64()));
        let whole = faces.saturating_sub(counts.last().copied().unwrap_or(faces)).max(1) as f64;
        let at = |count: usize| {
            let done = faces.saturating_sub(count) as f64 / whole;
            let i = read.partition_point(|r| r.0 < done).clamp(1, read.len() - 1);
            let ((d0, t0), (d1, t1)) = (read[i - 1], read[i]);
            let part = if d1 > d0 { ((done - d0) / (d1 - d0)).clamp(0.0, 1.0) } else { 1.0 };
            t0 + part * (t1 - t0)
        };
        let ends: Vec<f64> = counts.iter().map(|&c| at(c)).collect();
        let starts = std::iter::once(from).chain(ends.iter().copied());
        starts.zip(&ends).map(|(s, e)| (e - s).max(0.0)).collect()
    }
}

impl Control for Clock<'_> {
    fn progress(&self, done: f64) {
        if let Ok(mut read) = self.read.lock() {
            read.push((done, self.start.elapsed().as_secs_f64()));
        }
        self.control.progress(done);
    }

    fn cancelled(&self) -> bool {
        self.control.cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simplify::Quiet;

    #[test]
    fn the_middle_of_several_runs_counts() {
        assert_eq!(medians(&[vec![1.0, 9.0], vec![3.0, 5.0], vec![2.0, 7.0]]), [2.0, 7.0]);
        assert_eq!(medians(&[vec![1.0], vec![3.0]]), [2.0]);
        assert_eq!(medians(&[]), [0.0; 0]);
    }

    #[test]
    fn times_between_two_reports_go_by_proportion() {
        let clock =
            Clock { control: &Quiet, start: Instant::now(), read: Mutex::new(vec![(0.5, 2.0), (1.0, 4.0)]) };
        // 100 triangles to 20: 80 go, half of them by second 2.
        let t = clock.times(1.0, 100, &[80, 60, 20]);
        assert_eq!(t.iter().map(|x| (x * 1000.0).round()).collect::<Vec<_>>(), [500.0, 500.0, 2000.0]);
    }
}
