//! `progmesh levels IN`.

use super::Failure;
use super::args::{self, Input};
use super::common::{self, Warnings, short, thousands};
use super::control::{Interrupt, Progress};
use clap::ValueEnum;
use progmesh::io::files;
use progmesh::levels::{Levels, LevelsError, LevelsOptions, MethodLevels, levels};
use progmesh::report::Table;
use progmesh::report::plot::{Chart, Series, svg};
use progmesh::simplify::Method;
use serde::Serialize;
use std::path::PathBuf;

/// Show the levels of detail of a mesh: what each costs to make and to reach again, and how far it is off.
///
/// NSA's passes are its levels (Silva & Gomes); the quadric method is shown at the same counts. Every level is then left and reached
/// again by the recorded collapses, which is much faster than making it. Times are of one thread and the median of several runs; the error is
/// the measured distance to the input, in both directions.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh levels bunny.obj
  progmesh levels horse.ply --method nsa --epsilon 20 --plot levels.svg
  progmesh levels scan.ply --json > levels.json")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// Show only this method; may be repeated [default: both]
    #[arg(long, value_enum)]
    method: Vec<LevelMethod>,
    /// nsa: the most a face's normal may turn in one collapse, degrees [default: 12]
    #[arg(long, value_name = "DEG", value_parser = args::degrees, allow_negative_numbers = true)]
    epsilon: Option<f64>,
    /// nsa: at most this many passes
    #[arg(long, value_name = "K", value_parser = args::positive, allow_negative_numbers = true)]
    passes: Option<usize>,
    /// Runs of which each time is the median
    #[arg(long, value_name = "N", value_parser = args::positive, default_value_t = 5, allow_negative_numbers = true)]
    runs: usize,
    /// Samples of the distance on each side; 0 measures none
    #[arg(long, value_name = "N", value_parser = args::whole, default_value_t = 100_000, allow_negative_numbers = true)]
    samples: usize,
    /// Draw error and times over the number of faces to this SVG file
    #[arg(long, value_name = "FILE.svg", value_parser = svg_name)]
    plot: Option<PathBuf>,
    /// Print one JSON object instead of the table (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum LevelMethod {
    Nsa,
    Quadric,
}

/// A name that does not promise another kind of file.
fn svg_name(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension() {
        _ if files::is_dash(&path) => Err("write the plot to a path, not to standard output".into()),
        Some(e) if !e.eq_ignore_ascii_case("svg") => Err("plots are SVG: the name must end in .svg".into()),
        _ => Ok(path),
    }
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        if let Some(path) = &self.plot {
            common::check_target(path)?;
        }
        let mut options = LevelsOptions::default();
        if !self.method.is_empty() {
            let chosen = |m| match m {
                LevelMethod::Nsa => Method::Nsa,
                LevelMethod::Quadric => Method::Quadric,
            };
            options.methods = self.method.iter().map(|&m| chosen(m)).collect();
        }
        options.job.options.epsilon = self.epsilon;
        options.job.options.passes = self.passes;
        options.runs = self.runs;
        options.samples = Some(self.samples).filter(|&n| n > 0);
        let file = self.input.name();
        let mut warnings = Warnings::new(self.quiet);
        let interrupt = Interrupt::watch();
        let scene = self.input.read(&mut warnings)?.decoded.scene;
        interrupt.be_graceful();
        let found = levels(scene, &options, &Progress::new(&interrupt, self.quiet, "measuring levels"));
        let found = found.map_err(|e| match e {
            LevelsError::Cancelled => Failure::Interrupted,
            e => Failure::Input(format!("{file}: {e}")),
        })?;
        warnings.say(found.warnings.iter().map(|w| format!("{file}: {w}")));
        if found.methods.iter().all(|m| m.levels.is_empty()) {
            warnings
                .say([format!("{file}: no level but the input: NSA may collapse nothing at this epsilon")]);
        }
        if let Some(path) = &self.plot {
            let failed = |e| Failure::Output(format!("{}: {e}", path.display()));
            files::write_file(path, plot(&file, &found).as_bytes()).map_err(failed)?;
        }
        if self.json {
            return common::print_json(&report(file, self.runs, &found, warnings.all));
        }
        common::print(&common::harmless(&text(&file, self.runs, &found)))
    }
}

fn name(m: Method) -> &'static str {
    match m {
        Method::Nsa => "nsa",
        _ => "quadric",
    }
}

/// The tables for people.
fn text(file: &str, runs: usize, found: &Levels) -> String {
    let times = if runs == 1 { "one run".into() } else { format!("medians of {runs} runs") };
    let mut s = format!(
        "{file}: {} faces; one thread, {times}; errors in % of the diagonal ({})\n",
        thousands(found.faces),
        short(found.diagonal)
    );
    let ms = |seconds: f64| format!("{:.2}", 1e3 * seconds);
    for m in &found.methods {
        let mut table = Table::new(&[
            name(m.method),
            "faces",
            "splits",
            "pass ms",
            "coarsen ms",
            "refine ms",
            "rms %",
            "max %",
        ]);
        for (k, l) in m.levels.iter().enumerate() {
            let percent = |x: Option<f64>| {
                x.filter(|_| found.diagonal > 0.0)
                    .map_or("-".into(), |x| format!("{:.4}", 100.0 * x / found.diagonal))
            };
            table.row([
                format!("level {}", k + 1),
                thousands(l.faces),
                thousands(l.splits),
                ms(l.simplify_seconds),
                ms(l.coarsen_seconds),
                ms(l.refine_seconds),
                percent(l.error.map(|e| e.rms)),
                percent(l.error.map(|e| e.max)),
            ]);
        }
        s += "\n";
        s += &table.text();
    }
    s
}

/// Error and times over the number of faces.
fn plot(file: &str, found: &Levels) -> String {
    let stem = std::path::Path::new(file).file_name().map_or_else(|| file.into(), |n| n.to_string_lossy());
    let line = |m: &MethodLevels,
                k: usize,
                what: &str,
                dash: usize,
                y: &dyn Fn(&progmesh::levels::Level) -> Option<f64>| Series {
        name: format!("{}{what}", name(m.method)),
        points: m.levels.iter().filter_map(|l| Some((l.faces as f64, y(l)?))).collect(),
        color: k,
        dash,
    };
    let (mut errors, mut times) = (Vec::new(), Vec::new());
    for (k, m) in found.methods.iter().enumerate() {
        let scale = if found.diagonal > 0.0 { 100.0 / found.diagonal } else { 1.0 };
        errors.push(line(m, k, ", rms", 0, &|l| l.error.map(|e| e.rms * scale)));
        errors.push(line(m, k, ", max", 1, &|l| l.error.map(|e| e.max * scale)));
        times.push(line(m, k, ": simplify", 0, &|l| Some(1e3 * l.simplify_seconds)));
        times.push(line(m, k, ": coarsen", 1, &|l| Some(1e3 * l.coarsen_seconds)));
        times.push(line(m, k, ": refine", 2, &|l| Some(1e3 * l.refine_seconds)));
    }
    svg(&[
        Chart {
            title: format!("{stem}: error"),
            x: "faces".into(),
            y: "% of the diagonal".into(),
            series: errors,
        },
        Chart {
            title: format!("{stem}: time"),
            x: "faces of the level".into(),
            y: "ms, one thread".into(),
            series: times,
        },
    ])
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    file: String,
    faces: usize,
    diagonal: f64,
    threads: usize,
    runs: usize,
    methods: Vec<MethodReport>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct MethodReport {
    method: &'static str,
    levels: Vec<LevelReport>,
}

#[derive(Serialize)]
struct LevelReport {
    level: usize,
    faces: usize,
    splits: usize,
    seconds: Seconds,
    measured: Option<Measured>,
}

#[derive(Serialize)]
struct Seconds {
    simplify: f64,
    coarsen: f64,
    refine: f64,
}

#[derive(Serialize)]
struct Measured {
    max: f64,
    rms: f64,
    mean: f64,
}

fn report(file: String, runs: usize, found: &Levels, warnings: Vec<String>) -> Report {
    let level = |(k, l): (usize, &progmesh::levels::Level)| LevelReport {
        level: k + 1,
        faces: l.faces,
        splits: l.splits,
        seconds: Seconds {
            simplify: l.simplify_seconds,
            coarsen: l.coarsen_seconds,
            refine: l.refine_seconds,
        },
        measured: l.error.map(|e| Measured { max: e.max, rms: e.rms, mean: e.mean }),
    };
    let method = |m: &MethodLevels| MethodReport {
        method: name(m.method),
        levels: m.levels.iter().enumerate().map(level).collect(),
    };
    Report {
        command: "levels",
        file,
        faces: found.faces,
        diagonal: found.diagonal,
        threads: 1,
        runs,
        methods: found.methods.iter().map(method).collect(),
        warnings,
    }
}
