//! `progmesh extract IN OUT --camera CAM`.

mod paged;
mod refined;

use super::args::{self, Input};
use super::common::{self, Warnings, short, thousands};
use super::control::{Interrupt, Progress};
use super::ending::Ending;
use super::method::Making;
use super::paging::{self, Paging};
use super::rule::{Guard, RuleArgs};
use super::{Failure, camera};
use clap::ValueEnum;
use progmesh::pipeline::build_progressive;
use progmesh::progressive::{Detail, ProgressiveScene};
use progmesh::refine::selective::Cull;
use progmesh::refine::{ProgressiveMesh, Strips};
use progmesh::report::View;
use progmesh::scene::Scene;
use progmesh::selective::SelectiveScene;
use progmesh::simplify::Stop;
use serde::Serialize;
use std::time::Instant;

/// Write a mesh as fine as one view needs it: parts that are far, out of sight or turned away are left coarse.
///
/// Of a mesh a progressive mesh is made first; a .pm is refined as it is. Where the camera sees the surface from its front, what is written
/// deviates from the input by no more than --tau pixels. That is proven (docs/selective.md says how); not by --rule cuts or truly.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh extract dragon.ply near.ply --camera cam.json --tau 1
  progmesh extract scene.pm view.glb --camera scene.glb#door --budget-faces 20000
  progmesh extract city.pm street.glb --camera cam.json --memory 256
  progmesh extract scan.ply out.glb --camera cam.json --strips
  progmesh extract scan.ply out.glb --camera cam.json --rule truly
  progmesh extract scan.ply out.obj --camera cam.json --cull none --png out.png --wireframe

Exit code 1 means: done and written, but the base has more faces than --budget-faces.")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    ending: Ending,
    /// The camera: CAM.json (docs/camera.md), or scene.glb, or scene.glb#NAME
    #[arg(long, value_name = "CAM")]
    camera: String,
    #[command(flatten)]
    needs: Needs,
    /// Form triangle strips of what is shown, and report how long they are
    #[arg(long, help_heading = "View")]
    strips: bool,
    #[command(flatten)]
    making: Making,
}

/// What a view needs.
#[derive(clap::Args, Debug)]
pub(crate) struct Needs {
    /// The largest error, pixels: 0 shows all there is, inf the base
    #[arg(long, value_name = "PIXELS", value_parser = tolerance, default_value = "1", allow_negative_numbers = true,
          help_heading = "View")]
    pub(crate) tau: f64,
    /// At most this many faces; the tolerance rises as far as it must
    #[arg(long, value_name = "N", value_parser = args::positive, allow_negative_numbers = true, help_heading = "View")]
    pub(crate) budget_faces: Option<usize>,
    /// What to leave coarse however near it is
    #[arg(long, value_enum, default_value_t = CullName::All, help_heading = "View")]
    cull: CullName,
    /// Read of a .pm only what is needed, and take at most so many MiB, the program and a grid's cache included: for files of any size, made by encode --paged or terrain build [default: no limit, but so terrain of 64 MiB or more is read; of all else all]
    #[arg(long, value_name = "MIB", value_parser = args::positive, allow_negative_numbers = true, help_heading = "View")]
    pub(crate) memory: Option<usize>,
    #[command(flatten)]
    pub(crate) rule: RuleArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum CullName {
    /// Nothing
    None,
    /// What is outside of the picture
    Frustum,
    /// What turns its back
    Cone,
    /// Both
    All,
}

impl Needs {
    /// Where no limit of memory was given, that of an input which is read as if there were one.
    pub(crate) fn limit_memory(&mut self, input: &Input) {
        self.memory = self.memory.or_else(|| paging::unasked(input, &self.rule));
    }

    pub(crate) fn cull(&self) -> Cull {
        match self.cull {
            CullName::None => Cull::None,
            CullName::Frustum => Cull::Frustum,
            CullName::Cone => Cull::Cone,
            CullName::All => Cull::All,
        }
    }
}

/// Pixels, 0 or more; infinitely many too.
fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x >= 0.0 => Ok(x),
        _ => Err("must be a number of pixels, 0 or more, or inf".into()),
    }
}

/// What it took to have a scene that can be refined.
pub(crate) struct Made {
    pub(crate) scene: SelectiveScene,
    /// Reading, and making progressive meshes.
    pub(crate) read: f64,
    /// Hierarchies and bounds.
    pub(crate) bounds: f64,
}

/// Reads the input, as a progressive mesh or to make one of it, and builds the hierarchies.
pub(crate) fn make(
    input: &Input,
    making: &Making,
    rule: &RuleArgs,
    quiet: bool,
    interrupt: &Interrupt,
    warnings: &mut Warnings,
) -> Result<Made, Failure> {
    let start = Instant::now();
    let job = making.job()?;
    let file = input.name();
    let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{file}: {e}"));
    let simplify = |scene: Scene, warnings: &mut Warnings| -> Result<ProgressiveScene, Failure> {
        interrupt.be_graceful();
        let progress = Progress::new(interrupt, quiet, "simplifying");
        let job = job.clone().on_grid(&scene);
        let built = build_progressive(scene, &job, &progress).map_err(|e| failed(&e))?;
        if built.stop == Stop::Cancelled {
            return Err(Failure::Interrupted);
        }
        warnings.say(built.warnings.iter().map(|w| format!("{file}: {w}")));
        Ok(built.scene)
    };
    let mut read = input.read_or_make(warnings, simplify)?;
    if !read.meshes.iter().all(ProgressiveMesh::is_reorderable) {
        warnings
            .say([format!("{file}: its splits can only be made in their own order: new ones are used here")]);
        let full =
            read.at(&read.positions(Detail::Full)).map_err(|(m, e)| failed(&format!("mesh {m}: {e}")))?;
        read = simplify(full, warnings)?;
    }
    interrupt.be_graceful();
    let (read_seconds, start) = (start.elapsed().as_secs_f64(), Instant::now());
    let options = rule.options(&mut read);
    let mut scene = SelectiveScene::new(read, &options).map_err(|e| failed(&e))?;
    warnings.say(rule.apply(&mut scene, &file));
    if interrupt.is_set() {
        return Err(Failure::Interrupted);
    }
    Ok(Made { scene, read: read_seconds, bounds: start.elapsed().as_secs_f64() })
}

impl Args {
    pub(crate) fn run(mut self) -> Result<(), Failure> {
        let start = Instant::now();
        self.needs.limit_memory(&self.input);
        self.needs.rule.check(self.needs.memory.is_some())?;
        let mut results = self.ending.begin()?;
        let camera = camera::read(&self.camera, &mut results.warnings)?;
        results.through(View::of_camera(&camera));
        if let Some(mib) = self.needs.memory {
            return self.run_paged(mib, &camera, results, start);
        }
        let file = self.input.name();
        let interrupt = Interrupt::watch();
        let (report, full) = common::in_pool(self.making.collapsing.threads, || {
            let rule = &self.needs.rule;
            let made =
                make(&self.input, &self.making, rule, self.ending.quiet, &interrupt, &mut results.warnings)?;
            let (full_faces, full_splits) =
                (made.scene.full_faces(), made.scene.views().iter().map(|v| v.hierarchy().splits()).sum());
            let refining = Instant::now();
            let name = rule.name(&made.scene);
            let done = self.refine(made.scene, &camera)?;
            let refine = refining.elapsed().as_secs_f64();
            let spent = self.ending.finish(&mut results, &done.scene(), &interrupt)?;
            let report = Report {
                command: "extract",
                to: results.format.extension(),
                rule: name,
                error: rule.error(),
                tau: done.tau.is_finite().then_some(done.tau),
                faces: done.faces(),
                vertices: done.vertices(),
                splits: done.splits(),
                full_faces,
                full_splits,
                visible_vertices: done.visible_vertices(&camera),
                strips: self.strips.then(|| done.strips()),
                guard: done.guard(),
                paging: None,
                seconds: Seconds {
                    read: made.read,
                    bounds: made.bounds,
                    refine,
                    write: spent.write,
                    total: start.elapsed().as_secs_f64(),
                },
                warnings: vec![],
            };
            Ok((report, full_faces))
        })?;
        let report = Report { warnings: results.warnings.all, ..report };
        self.ending.say(|| {
            let at = report.tau.map_or("inf".into(), short);
            format!(
                "{file}: {} of {} faces at {at} pixels; {:.3} s (read {:.3}, bounds {:.3}, refine {:.3}, write {:.3}){}{}",
                thousands(report.faces),
                thousands(full),
                report.seconds.total,
                report.seconds.read,
                report.seconds.bounds,
                report.seconds.refine,
                report.seconds.write,
                StripReport::text(report.strips),
                report.guard.map_or(String::new(), |g| format!("; {}", g.text()))
            )
        });
        self.ending.print(&report)?;
        self.kept_budget(&report)
    }

    fn kept_budget(&self, report: &Report) -> Result<(), Failure> {
        let file = self.input.name();
        match self.needs.budget_faces {
            Some(n) if report.faces > n => Err(Failure::Missed(format!(
                "{file}: {} faces left, more than the {} asked for: that is the base, nothing is coarser",
                thousands(report.faces),
                thousands(n)
            ))),
            _ => Ok(()),
        }
    }
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    to: &'static str,
    rule: &'static str,
    error: &'static str,
    tau: Option<f64>,
    faces: usize,
    vertices: usize,
    splits: usize,
    full_faces: usize,
    full_splits: usize,
    visible_vertices: usize,
    strips: Option<StripReport>,
    paging: Option<Paging>,
    guard: Option<Guard>,
    seconds: Seconds,
    warnings: Vec<String>,
}

/// Triangle strips: a part of the schema of `--json`.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct StripReport {
    count: usize,
    pub(crate) mean_length: f64,
}

impl StripReport {
    /// Of the meshes' strips together.
    pub(crate) fn of(all: impl Iterator<Item = Strips>) -> StripReport {
        let sum = |(n, t): (usize, usize), s: Strips| (n + s.len(), t + s.triangles());
        let (count, triangles) = all.fold((0, 0), sum);
        StripReport { count, mean_length: triangles as f64 / count.max(1) as f64 }
    }

    /// For people, behind other things.
    fn text(this: Option<StripReport>) -> String {
        this.map_or(String::new(), |s| {
            format!("; {} strips of {:.1} triangles", thousands(s.count), s.mean_length)
        })
    }
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    bounds: f64,
    refine: f64,
    write: f64,
    total: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tolerance_is_not_negative_and_may_be_infinite() {
        assert_eq!((tolerance("0"), tolerance("inf")), (Ok(0.0), Ok(f64::INFINITY)));
        assert!(["-1", "nan", "", "x"].iter().all(|t| tolerance(t).is_err()));
    }
}
