//! `progmesh compare A B`.

use super::args::{self, FormatName};
use super::common::{self, Warnings, short, thousands};
use super::control::{Interrupt, Progress};
use super::{Failure, heatmap};
use progmesh::compare::{CompareError, CompareOptions, Comparison, Flattened, compare};
use progmesh::io::files;
use progmesh::scene::Scene;
use progmesh::simplify::measure::{self, Certified, Farthest, Interval, MeasureError, Summary};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

mod details;

/// Measure how far two meshes are from each other, in both directions.
///
/// Scenes are measured as they stand in the world, all nodes and instances. Distances are those of random points, spread evenly over the area (the same
/// for the same --seed), from the other surface; `max` is over the vertices too. It is the largest distance found, not the largest there
/// is: --certify proves how large that can be.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh compare original.ply simplified.ply
  progmesh compare original.ply simplified.ply --certify 1e-4
  progmesh compare part.stl printed.stl --threshold 0.05 && echo good enough
  progmesh compare a.glb b.glb --threshold 0.001 --relative --certify 1e-4 --json
  progmesh compare scan.ply small.ply --heatmap heat.png --heatmap heat.html
  progmesh compare scan.ply small.ply --heatmap heat.ply

Exit code 1 means: measured and printed, but the distance exceeds --threshold.")]
pub(crate) struct Args {
    /// The mesh to compare with, usually the original; - for standard input, with --from
    #[arg(value_name = "A")]
    a: PathBuf,
    /// The mesh to compare; - for standard input, with --from
    #[arg(value_name = "B")]
    b: PathBuf,
    /// Format of what comes from standard input, or of a name that does not say
    #[arg(long, value_enum, value_name = "FORMAT")]
    from: Option<FormatName>,

    /// Random points on each side
    #[arg(long, value_name = "N", value_parser = args::positive, default_value = "300000", help_heading = "Distance")]
    samples: usize,
    /// Another seed takes other points
    #[arg(long, value_name = "S", default_value_t = 1, help_heading = "Distance")]
    seed: u64,
    /// Prove between which bounds the largest distance lies, no farther apart than TOL of A's diagonal (1e-4 is fast, 1e-6 fine)
    #[arg(long, value_name = "TOL", value_parser = args::fraction, allow_negative_numbers = true,
          help_heading = "Distance")]
    certify: Option<f64>,

    /// Measure distances alone: not normals, texture coordinates, colours, topology, triangle shapes and self-intersections
    #[arg(long, help_heading = "Distance")]
    distance_only: bool,

    /// Exit with 1 if the largest distance exceeds this: the proven upper bound with --certify, the largest sampled one without
    #[arg(long, value_name = "E", value_parser = args::not_negative, allow_negative_numbers = true,
          help_heading = "Judgement")]
    threshold: Option<f64>,
    /// --threshold is a part of A's diagonal
    #[arg(long, requires = "threshold", help_heading = "Judgement")]
    relative: bool,

    /// Show where A is far from B: A in colours (.ply, .glb), a picture (.png), or a page of pictures and tables (.html); may be repeated
    #[arg(long, value_name = "OUT", value_parser = heatmap::Target::parse, help_heading = "Pictures")]
    heatmap: Vec<heatmap::Target>,
    /// The distance that has the last colour [default: the largest, or that of the last 0.1 % of the area if much smaller]
    #[arg(long, value_name = "E", value_parser = args::not_negative, allow_negative_numbers = true,
          requires = "heatmap", help_heading = "Pictures")]
    heatmap_max: Option<f64>,

    /// Threads to use; the result does not depend on it [default: all]
    #[arg(long, value_name = "N", value_parser = args::threads, allow_negative_numbers = true)]
    threads: Option<usize>,
    /// Print one JSON object on standard output instead of tables (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but the result and errors
    #[arg(long, short)]
    quiet: bool,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let start = Instant::now();
        if files::is_dash(&self.a) && files::is_dash(&self.b) {
            return Err(Failure::Usage("A and B cannot both be standard input".into()));
        }
        self.heatmap.iter().try_for_each(|t| common::check_target(t.path()))?;
        let mut warnings = Warnings::new(self.quiet);
        let interrupt = Interrupt::watch();
        let names = [&self.a, &self.b].map(|p| common::name(p, "standard input"));

        let (report, tables) = common::in_pool(self.threads, || {
            let (scene_a, a) = self.read(&self.a, &mut warnings)?;
            let (scene_b, b) = self.read(&self.b, &mut warnings)?;
            let read = start.elapsed().as_secs_f64();
            interrupt.be_graceful();
            let mut options = CompareOptions::default();
            options.distance.samples = self.samples;
            options.distance.seed = self.seed;
            options.certify = self.certify;
            options.distance_only = self.distance_only;
            let progress = Progress::new(&interrupt, self.quiet, "measuring");
            let found = compare(&a, &b, &options, &progress).map_err(|e| failure(&names[0], e))?;
            drop(progress);
            let not_converged = found.certified.as_ref().filter(|c| !c.converged).map(|_| {
                "the bounds are proven, but wider than asked for: too many places are equally far; ask for a larger --certify"
                    .to_string()
            });
            warnings.say(not_converged);

            let drawing = Instant::now();
            let heat = heatmap::Heat {
                scenes: [&scene_a, &scene_b],
                flattened: [&a, &b],
                names: [&names[0], &names[1]],
                found: &found,
                top: self.heatmap_max,
            };
            heat.write(&self.heatmap, &interrupt, &mut warnings)?;
            let seconds = Seconds {
                read,
                distance: found.distance_seconds,
                certify: found.certify_seconds,
                details: found.detail_seconds,
                draw: drawing.elapsed().as_secs_f64(),
                total: start.elapsed().as_secs_f64(),
            };
            let threshold = self.judge(&found);
            let tables: Vec<String> = found.tables().iter().map(|t| t.text()).collect();
            Ok((self.report(&names, &found, threshold, seconds, warnings.all), tables.join("\n")))
        })?;
        if self.json {
            common::print_json(&report)?;
        } else {
            let [na, nb] = report.triangles;
            let mut text = format!("A  {}, {} triangles\n", names[0], thousands(na));
            text += &format!("B  {}, {} triangles\n\n", names[1], thousands(nb));
            common::print(&(text + &tables))?;
        }
        match report.threshold {
            Some(t) if t.exceeded => {
                let what = match t.of {
                    "certified" => "cannot be proven to be below",
                    _ => "is above",
                };
                let kind = if t.of == "certified" {
                    "the proven upper bound"
                } else {
                    "the largest sampled distance"
                };
                Err(Failure::Missed(format!(
                    "{}: {kind}, {}, {} the threshold {}",
                    names[1],
                    short(t.distance),
                    if t.of == "certified" && report.worse.max <= t.value { what } else { "is above" },
                    short(t.value)
                )))
            }
            _ => Ok(()),
        }
    }

    fn read(&self, path: &Path, warnings: &mut Warnings) -> Result<(Scene, Flattened), Failure> {
        // A name that says its format is believed.
        let named = progmesh::io::Format::from_name(&path.to_string_lossy()).is_some();
        let from = self.from.filter(|_| files::is_dash(path) || !named);
        let scene = common::read(path, from, warnings)?.decoded.scene;
        let file = common::name(path, "standard input");
        let flattened = match self.distance_only {
            true => Flattened::of(&scene),
            false => Flattened::with_topology(&scene),
        };
        let flattened = flattened.map_err(|e| failure(&file, e))?;
        Ok((scene, flattened))
    }

    fn judge(&self, found: &Comparison) -> Option<Threshold> {
        let given = self.threshold?;
        let value = if self.relative { given * found.distances.diagonal } else { given };
        let distance = found.judged();
        let of = if found.certified.is_some() { "certified" } else { "sampled" };
        Some(Threshold { value, of, distance, exceeded: distance > value })
    }

    fn report(
        &self,
        names: &[String; 2],
        found: &Comparison,
        threshold: Option<Threshold>,
        seconds: Seconds,
        warnings: Vec<String>,
    ) -> Report {
        let d = &found.distances;
        Report {
            command: "compare",
            a: names[0].clone(),
            b: names[1].clone(),
            triangles: found.triangles,
            diagonal: d.diagonal,
            samples: self.samples,
            seed: self.seed,
            a_to_b: Side { distance: (&d.a_to_b.summary).into(), farthest: (&d.a_to_b.farthest).into() },
            b_to_a: Side { distance: (&d.b_to_a.summary).into(), farthest: (&d.b_to_a.farthest).into() },
            worse: (&d.worse).into(),
            relative: d.relative().as_ref().map(Numbers::from),
            certified: found
                .certified
                .as_ref()
                .zip(self.certify)
                .map(|(c, tolerance)| Proof::new(c, tolerance)),
            threshold,
            details: found.details.as_ref().map(details::Report::from),
            seconds,
            peak_bytes: files::peak_bytes(),
            warnings,
        }
    }
}

/// What cannot be measured is a matter of the input.
fn failure(file: &str, e: CompareError) -> Failure {
    match e {
        CompareError::Measure(MeasureError::Cancelled) => Failure::Interrupted,
        e => Failure::Input(format!("{file}: {e}")),
    }
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    a: String,
    b: String,
    triangles: [usize; 2],
    diagonal: f64,
    samples: usize,
    seed: u64,
    a_to_b: Side,
    b_to_a: Side,
    worse: Numbers,
    relative: Option<Numbers>,
    certified: Option<Proof>,
    threshold: Option<Threshold>,
    details: Option<details::Report>,
    seconds: Seconds,
    peak_bytes: Option<u64>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Side {
    #[serde(flatten)]
    distance: Numbers,
    farthest: Point,
}

#[derive(Serialize)]
struct Numbers {
    max: f64,
    rms: f64,
    mean: f64,
    quantiles: Quantiles,
}

#[derive(Serialize)]
pub(super) struct Quantiles {
    p50: f64,
    p90: f64,
    p95: f64,
    p99: f64,
    p999: f64,
}

impl From<&Summary> for Numbers {
    fn from(s: &Summary) -> Self {
        Numbers { max: s.max, rms: s.rms, mean: s.mean, quantiles: (&s.quantiles).into() }
    }
}

impl From<&measure::Quantiles> for Quantiles {
    fn from(q: &measure::Quantiles) -> Self {
        Quantiles { p50: q.p50, p90: q.p90, p95: q.p95, p99: q.p99, p999: q.p999 }
    }
}

#[derive(Serialize)]
struct Point {
    point: [f64; 3],
    triangle: u32,
    closest: [f64; 3],
    closest_triangle: u32,
    distance: f64,
}

impl From<&Farthest> for Point {
    fn from(f: &Farthest) -> Self {
        Point {
            point: f.point.to_array(),
            triangle: f.triangle,
            closest: f.closest.to_array(),
            closest_triangle: f.closest_triangle,
            distance: f.distance,
        }
    }
}

#[derive(Serialize)]
struct Proof {
    lower: f64,
    upper: f64,
    tolerance: f64,
    converged: bool,
    witness: Point,
    witness_on: &'static str,
    a_to_b: Bounds,
    b_to_a: Bounds,
    cuts: u64,
}

#[derive(Serialize)]
struct Bounds {
    lower: f64,
    upper: f64,
}

impl Proof {
    fn new(c: &Certified, tolerance: f64) -> Self {
        let bounds = |i: &Interval| Bounds { lower: i.lower, upper: i.upper };
        Proof {
            lower: c.lower,
            upper: c.upper,
            tolerance,
            converged: c.converged,
            witness: (&c.witness).into(),
            witness_on: if c.witness_on_a { "a" } else { "b" },
            a_to_b: bounds(&c.a_to_b),
            b_to_a: bounds(&c.b_to_a),
            cuts: c.cuts,
        }
    }
}

#[derive(Serialize)]
struct Threshold {
    value: f64,
    of: &'static str,
    distance: f64,
    exceeded: bool,
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    distance: f64,
    certify: f64,
    details: f64,
    draw: f64,
    total: f64,
}
