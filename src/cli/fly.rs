//! `progmesh fly IN --path PATH`.

mod flight;
mod geomorph;
mod ground;
mod pace;
mod paged;
mod path;
mod play;
mod report;
mod shots;
mod truly;

use super::Failure;
use super::args::{self, Input};
use super::common::{self, Warnings};
use super::control::Interrupt;
use super::extract::{self, Needs, StripReport};
use super::method::Making;
use flight::{Step, fly};
use glam::DVec3;
use pace::{Measuring, Setting};
use path::PathArgs;
use play::PlayArgs;
use progmesh::refine::view::Camera;
use progmesh::selective::{Deviation, Geomorph, Judge, SelectiveScene};
use report::{Frame, Memory, Report};
use shots::ShotArgs;

/// Fly a camera along a path, refine the mesh for every frame, and report what that took.
///
/// Every frame starts from the mesh of the one before. Times are of refining alone. What is measured is the largest
/// lambda * distance / depth over samples of the input that the camera sees from their front, by code that shares nothing with what decides; of a terrain, with --grid,
/// the largest distance in the picture between a sample and the surface above or below it.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh fly dragon.ply --path circle --measure-every 50
  progmesh fly bunny.pm --path lemniscate --frames 2000 --budget-faces 20000 --json > flight.json
  progmesh fly scan.ply --path cams.json --png-every 60 --png-to shots --apng flight.png
  progmesh fly dragon.ply --path circle --geomorph=time:20 --measure-every 10
  progmesh fly dragon.ply --path circle --html dragon.html --html-taus 1,4
  progmesh fly alps.pm --path lemniscate --grid alps.tif --path-speed fast --measure-every 10
  progmesh fly alps.pm --path circle --grid alps.tif --cull frustum --memory 256 --fps 60 --measure-every 20
  progmesh fly city.pm --path walk.json --memory 256 --fetches 2 --geomorph --html walk.html
  progmesh fly dragon.ply --path circle --rule truly --measure-every 20
  progmesh fly terrain.obj --path canyon.frames --path-scale 1024 --budget-us 500

Exit code 1 means: done, but the measured error came above --tau in a frame that had come to rest, with no vertex on the way.")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    path: PathArgs,
    #[command(flatten)]
    needs: Needs,
    /// End refining a frame after this many microseconds; the next goes on
    #[arg(long, value_name = "US", value_parser = args::positive, allow_negative_numbers = true, help_heading = "View")]
    budget_us: Option<usize>,
    /// Begin this many frames a second at most, as a display does [default: each when the one before is done]
    ///
    /// What other threads do in between is in no frame's time: with --memory, and of large terrain, they decode chunks that will be needed.
    #[arg(long, value_name = "N", value_parser = args::positive, allow_negative_numbers = true, help_heading = "View")]
    fps: Option<usize>,
    /// Keep what is not needed until it is not needed at this times the tolerance either, 0.1 to 1
    #[arg(long, value_name = "H", value_parser = hysteresis, default_value = "1", allow_negative_numbers = true,
          help_heading = "View")]
    hysteresis: f64,
    /// Let changes that can be seen show themselves smoothly: time[:FRAMES] or error[:BAND] [default: time:12]
    ///
    /// time: vertices move to their new places over so many frames, and what is undone stays for as long. error: a vertex begins to move where its error could take up
    /// tau / BAND and is in place at tau, which takes the faces of tau / BAND; BAND is more than 1 and 2 if not said. What is out of sight jumps.
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "time",
          value_parser = geomorph::parse, help_heading = "View")]
    geomorph: Option<Geomorph>,
    /// With --memory: chunks to fetch in a frame at most; until later frames the mesh is coarser
    #[arg(long, value_name = "N", value_parser = args::positive, allow_negative_numbers = true, requires = "memory",
          help_heading = "View")]
    fetches: Option<usize>,
    /// Form triangle strips of what every frame shows, and report how long they are; not in the frame's time
    #[arg(long, help_heading = "Report")]
    strips: bool,
    /// Measure the error that is shown on every Kth frame; with --memory all of the mesh is read for that, once, but over a grid (--grid), where also cracks are looked for on all frames
    #[arg(long, value_name = "K", value_parser = args::positive, allow_negative_numbers = true, help_heading = "Report")]
    measure_every: Option<usize>,
    /// Samples of the input to measure at
    #[arg(long, value_name = "N", value_parser = samples, default_value = "100000",
          allow_negative_numbers = true, help_heading = "Report")]
    samples: usize,
    #[command(flatten)]
    shots: ShotArgs,
    #[command(flatten)]
    play: PlayArgs,
    #[command(flatten)]
    making: Making,
    /// Print one JSON object about the flight on standard output (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

/// Samples are held in memory: a hundred times what is asked for without a word.
const MOST_SAMPLES: usize = 10_000_000;

fn samples(text: &str) -> Result<usize, String> {
    args::positive(text).and_then(|n| match n {
        n if n <= MOST_SAMPLES => Ok(n),
        _ => Err(format!("must be 1 to {MOST_SAMPLES}")),
    })
}

fn hysteresis(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.1..=1.0).contains(&x) => Ok(x),
        _ => Err("must be a number from 0.1 to 1".into()),
    }
}

impl Args {
    pub(crate) fn run(mut self) -> Result<(), Failure> {
        let mut warnings = Warnings::new(self.quiet);
        let file = self.input.name();
        self.needs.limit_memory(&self.input);
        // Before any work is done.
        let source = self.path.open(self.needs.memory, &mut warnings)?;
        self.needs.rule.check(self.needs.memory.is_some())?;
        self.check_truly()?;
        if self.path.has_grid() && self.needs.rule.deviation() == Deviation::Directional {
            return Err(Failure::Usage(
                "--grid and --error directional do not go together: over a grid what lies above or below a sample counts".into(),
            ));
        }
        self.shots.check()?;
        self.play.check()?;
        let interrupt = Interrupt::watch();
        let mut report = common::in_pool(self.making.collapsing.threads, || {
            if let Some(mib) = self.needs.memory {
                return self.run_paged(mib, &source, &interrupt);
            }
            let rule = &self.needs.rule;
            let made = extract::make(&self.input, &self.making, rule, self.quiet, &interrupt, &mut warnings)?;
            let (seconds, mut scene) = ([made.read, made.bounds], made.scene);
            let course = self.path.lay(&source, scene.bounds(), (&file, self.terrain()))?;
            let (name, vertices, full_faces) = (rule.name(&scene), scene.full_vertices(), scene.full_faces());
            let (frames, [shared, shown, tables], guard) = if rule.is_truly() {
                let (frames, bytes, guard) = self.fly_truly(scene, &course, &interrupt)?;
                (frames, bytes, Some(guard))
            } else {
                scene.set_geomorph(self.geomorph);
                if let Some(g) = &course.ground {
                    // As it is measured.
                    scene.set_deviation(Deviation::Upright(g.up()));
                }
                let (frames, bytes) = self.fly(&mut scene, &course, &interrupt)?;
                (frames, bytes, None)
            };
            let memory = Memory {
                shared_bytes: shared,
                shared_bytes_per_vertex: shared as f64 / vertices.max(1) as f64,
                view_bytes: shown,
                view_table_bytes: tables,
                most_vertices: frames.iter().map(|f| f.vertices).max().unwrap_or(0),
            };
            let path = self.path.name().to_string();
            let mut report = Report::new(path, self.needs.tau, full_faces, frames, memory, seconds);
            (report.rule, report.error, report.guard) = (name, rule.error(), guard);
            Ok(report)
        })?;
        report.fps = self.fps;
        warnings.say(std::mem::take(&mut report.warnings));
        report.warnings = warnings.all;
        if !self.quiet {
            report.text(&file).iter().for_each(|line| common::note(line));
        }
        if self.json {
            common::print_json(&report)?;
        }
        match report.above {
            0 => Ok(()),
            n => Err(Failure::Missed(format!(
                "{file}: the measured error is above the tolerance in {n} of the frames measured at rest"
            ))),
        }
    }

    /// That the path is where the scene is.
    fn something_seen(&self, frames: &[Frame], bounds: Option<(DVec3, DVec3)>) -> Result<(), Failure> {
        if frames.iter().any(|f| f.visible_vertices.is_some_and(|n| n > 0)) {
            return Ok(());
        }
        let (lo, hi) = bounds.unwrap_or_default();
        Err(Failure::Input(format!(
            "{}: no frame sees anything of {}, which reaches from {lo} to {hi}: the path is elsewhere \
             (--path-scale multiplies its coordinates)",
            self.path.name(),
            self.input.name()
        )))
    }

    /// Samples of the finest surfaces.
    fn judge(&self, scene: &SelectiveScene) -> Result<Judge, Failure> {
        Judge::new(scene, self.samples).map_err(|e| Failure::Input(format!("{}: {e}", self.input.name())))
    }

    fn setting<'a>(&'a self, tau: f64, interrupt: &'a Interrupt) -> Setting<'a> {
        Setting {
            tau,
            cull: self.needs.cull(),
            budget_faces: self.needs.budget_faces,
            budget_us: self.budget_us,
            hysteresis: self.hysteresis,
            fps: self.fps,
            interrupt,
        }
    }

    /// The flight that was asked for; then, for a page, the others. Returns the frames and the bytes held at the end of the first.
    fn fly(
        &self,
        scene: &mut SelectiveScene,
        course: &path::Course<'_>,
        interrupt: &Interrupt,
    ) -> Result<(Vec<Frame>, [usize; 3]), Failure> {
        let file = self.input.name();
        let measuring = Measuring::new(self.measure_every, course, &file, || self.judge(scene))?;
        let path: &[Camera] = &course.cameras;
        let mut frames = Vec::with_capacity(path.len());
        let mut shots = self.shots.start(course);
        let mut player = self.play.start(scene, path, &file);
        if let Some(p) = &mut player {
            p.begin(self.needs.tau, true)?;
        }
        fly(scene, path, self.setting(self.needs.tau, interrupt), &file, &mut |step: &Step<'_>| {
            let (measured, over) = measuring.measure(step.number, step.camera, || step.scene.triangles())?;
            shots.take(step)?;
            if let Some(p) = &mut player {
                p.take(step.number, (step.scene, step.changes), &step.timed)?;
            }
            frames.push(Frame {
                faces: step.scene.face_count(),
                vertices: step.scene.vertex_count(),
                morphing: step.scene.morphing(),
                visible_vertices: measuring.visible(step.number, || step.scene.visible_vertices(step.camera)),
                dirty_index_bytes: step.changes.iter().map(|c| c.index_bytes()).sum(),
                dirty_wedges: step.changes.iter().map(|c| c.wedges.len()).sum(),
                strips: self.strips.then(|| {
                    let meshes = 0..step.scene.views().len();
                    StripReport::of(meshes.map(|m| step.scene.shown(m).strips()))
                }),
                measured,
                on_ground: over.on_ground,
                cracks: over.cracks(),
                folds: over.folds(),
                ..step.timed.frame(&step.timed.done)
            });
            Ok(())
        })?;
        self.something_seen(&frames, scene.bounds())?;
        let bytes = scene.bytes();
        shots.write()?;
        if let Some(mut p) = player {
            for tau in self.play.others(self.needs.tau) {
                scene.reset();
                p.begin(tau, false)?;
                let setting = self.setting(tau, interrupt);
                fly(scene, path, setting, &file, &mut |step: &Step<'_>| {
                    p.take(step.number, (step.scene, step.changes), &step.timed)
                })?;
            }
            p.write(scene)?;
        }
        Ok((frames, bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_would_take_all_memory_are_refused() {
        assert_eq!((samples("1"), samples("1e7")), (Ok(1), Ok(MOST_SAMPLES)));
        assert!(["0", "1e12", "x"].iter().all(|t| samples(t).is_err()));
    }
}
