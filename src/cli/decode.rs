//! `progmesh decode IN.pm OUT`.

use super::Failure;
use super::args::{self, Output, ProgressiveInput};
use super::common::{self, Warnings, thousands};
use super::control::Interrupt;
use progmesh::pipeline::count;
use progmesh::progressive::{Detail, ProgressiveScene};
use serde::Serialize;
use std::time::Instant;

/// Write a progressive mesh at any level of detail in another format.
///
/// Reads our own .pm files and Hoppe's. At full detail, which is the default, the result is what was encoded, bit for bit.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh decode bunny.pm bunny.obj
  progmesh decode scene.pm small.glb --triangles 10000
  progmesh decode scan.pm scan.ply --max-error 0.001
  progmesh decode horse.pm - --level 0 --to ply > base.ply
  progmesh decode cut-off.pm rest.ply --salvage

Exit code 1 means: done and written, but the base has more triangles than asked for.")]
pub(crate) struct Args {
    #[command(flatten)]
    input: ProgressiveInput,
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    detail: DetailArgs,
    /// Of a damaged or cut-off file use all that is whole, instead of nothing
    #[arg(long)]
    salvage: bool,
    /// Threads to use; the result does not depend on it [default: all]
    #[arg(long, value_name = "N", value_parser = args::threads, allow_negative_numbers = true)]
    threads: Option<usize>,
    /// Print one JSON object about the run on standard output (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

/// How far to refine: one of several flags.
#[derive(clap::Args, Debug)]
#[group(multiple = false)]
pub(crate) struct DetailArgs {
    /// At most this many triangles
    #[arg(long, value_name = "N", value_parser = args::whole, allow_negative_numbers = true, help_heading = "Detail")]
    triangles: Option<usize>,
    /// This part of the triangles of full detail, 0 to 1
    #[arg(long, value_name = "R", value_parser = args::fraction, allow_negative_numbers = true, help_heading = "Detail")]
    ratio: Option<f64>,
    /// The coarsest mesh of which no split left out has a larger estimated error, world units; a file of ours keeps errors to
    /// half an octave, rounded up, so that some splits more are made
    #[arg(long, value_name = "E", value_parser = args::not_negative, allow_negative_numbers = true,
          help_heading = "Detail")]
    max_error: Option<f64>,
    /// Level K, 0 the base; with --method nsa the passes are levels
    #[arg(long, value_name = "K", value_parser = args::whole, allow_negative_numbers = true, help_heading = "Detail")]
    level: Option<usize>,
    /// All there is (default)
    #[arg(long, help_heading = "Detail")]
    full: bool,
}

impl DetailArgs {
    fn detail(&self, scene: &ProgressiveScene) -> Detail {
        let part = |r: f64| (r * scene.triangles() as f64).round() as usize;
        None.or(self.triangles.map(Detail::Triangles))
            .or(self.ratio.map(|r| Detail::Triangles(part(r))))
            .or(self.max_error.map(Detail::MaxError))
            .or(self.level.map(Detail::Level))
            .unwrap_or(Detail::Full)
    }
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let start = Instant::now();
        self.output.leave_room_for(self.json)?;
        let mut warnings = Warnings::new(self.quiet);
        let format = self.output.format(&mut warnings)?;
        let file = self.input.name();
        let interrupt = Interrupt::watch();
        let (detail, report) = common::in_pool(self.threads, || {
            let mut read = self.input.read(self.salvage, &mut warnings)?;
            let reading = start.elapsed().as_secs_f64();
            interrupt.be_graceful();
            let detail = self.detail.detail(&read);
            if matches!(detail, Detail::Triangles(_) | Detail::MaxError(_)) {
                read.sort_by_error();
            }
            if let Some(k) = self.detail.level.filter(|&k| k >= read.levels()) {
                let last = read.levels().saturating_sub(1);
                warnings.say([format!("{file}: there is no level {k}: the finest is level {last}")]);
            }
            let at = read.positions(detail);
            let scene = read.at(&at).map_err(|(m, e)| Failure::Input(format!("{file}: mesh {m}: {e}")))?;
            let refining = start.elapsed().as_secs_f64() - reading;
            if interrupt.is_set() {
                return Err(Failure::Interrupted);
            }
            self.output.write(format, &scene, &interrupt, &mut warnings)?;
            let total = start.elapsed().as_secs_f64();
            let report = Report {
                command: "decode",
                to: format.extension(),
                meshes: scene.meshes.len(),
                vertices: scene.meshes.iter().map(|m| m.geometry.positions.len()).sum(),
                triangles: scene.unique_triangles(),
                full_triangles: read.triangles(),
                base_triangles: read.base_triangles(),
                splits: at.iter().sum(),
                full_splits: read.splits(),
                seconds: Seconds {
                    read: reading,
                    refine: refining,
                    write: total - reading - refining,
                    total,
                },
                warnings: vec![],
            };
            Ok((detail, report))
        })?;
        let report = Report { warnings: warnings.all, ..report };
        let t = &report.seconds;
        if !self.quiet {
            common::note(&format!(
                "{file}: {} of {} triangles, {} of {}; {:.3} s (read {:.3}, refine {:.3}, write {:.3})",
                thousands(report.triangles),
                thousands(report.full_triangles),
                thousands(report.splits),
                count(report.full_splits, "split"),
                t.total,
                t.read,
                t.refine,
                t.write
            ));
        }
        if self.json {
            common::print_json(&report)?;
        }
        match detail {
            Detail::Triangles(n) if report.triangles > n => Err(Failure::Missed(format!(
                "{file}: {} left, more than the {} asked for: that is the base, nothing is coarser",
                count(report.triangles, "triangle"),
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
    meshes: usize,
    vertices: usize,
    triangles: usize,
    full_triangles: usize,
    base_triangles: usize,
    splits: usize,
    full_splits: usize,
    seconds: Seconds,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    refine: f64,
    write: f64,
    total: f64,
}
