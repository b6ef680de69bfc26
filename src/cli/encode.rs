//! `progmesh encode IN OUT.pm`.

use super::args::{self, Input};
use super::common::{self, Warnings, short, thousands};
use super::control::{Interrupt, Progress};
use super::method::Making;
use super::{Failure, common::print_json};
use progmesh::io::files;
use progmesh::io::pm::encode_progressive;
use progmesh::pipeline::build_progressive;
use progmesh::refine::format::{EncodeOptions, RangeReader};
use progmesh::refine::hierarchy;
use progmesh::simplify::Stop;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Write a mesh, or a whole scene, as a progressive mesh: a coarse base and the vertex splits that lead back to the input.
///
/// At full detail it is the input bit for bit: positions, attributes, polygons, order, materials, names, nodes, images. Any beginning of the file
/// that ends with a chunk is a good coarse mesh.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh encode bunny.obj bunny.pm
  progmesh encode scan.ply scan.pm --placement endpoint --any-order
  progmesh encode dragon.ply dragon.pm --bounds
  progmesh encode city.ply city.pm --random-access --bounds
  progmesh encode scene.glb scene.pm --quantize 14
  progmesh encode horse.ply horse.pm --method nsa --epsilon 12")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// The file to write, .pm; - for standard output
    #[arg(value_name = "OUT.pm")]
    output: PathBuf,
    #[command(flatten)]
    making: Making,
    /// Move vertices onto a grid of 2^BITS cells along the longest side: smaller, but lossy (2 to 30)
    #[arg(long, value_name = "BITS", value_parser = bits, allow_negative_numbers = true, help_heading = "File")]
    quantize: Option<u32>,
    /// Leave the order of vertices, faces and corners out, and what makes triangles polygons
    #[arg(long, help_heading = "File")]
    any_order: bool,
    /// Chunks that follow each other, none readable without those before it: smaller by a tenth to a third
    #[arg(long, help_heading = "File")]
    sequential: bool,
    /// Chunks that can be read alone, in any order, for views that load only what they need: the default; with --bounds also what
    /// extract and fly need for --memory
    #[arg(long, help_heading = "File", conflicts_with = "sequential")]
    random_access: bool,
    /// Measure and write what view-dependent refinement decides by, so that extract and fly begin at once: 5 to 7 bytes a vertex; with --random-access also what
    /// extract and fly need for --memory
    #[arg(long, help_heading = "File")]
    bounds: bool,
    /// Print one JSON object about the run on standard output (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

fn bits(text: &str) -> Result<u32, String> {
    match args::whole(text) {
        Ok(n @ 2..=30) => Ok(n as u32),
        _ => Err("must be a whole number from 2 to 30".into()),
    }
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let start = Instant::now();
        let job = self.making.job()?;
        let out = common::name(&self.output, "standard output");
        if self.json && files::is_dash(&self.output) {
            return Err(Failure::Usage(
                "--json and OUT both want standard output; write OUT to a path".into(),
            ));
        }
        if self.output.extension().is_some_and(|e| !e.eq_ignore_ascii_case("pm")) {
            return Err(Failure::Usage(format!("{out}: a progressive mesh's name must end in .pm")));
        }
        common::check_target(&self.output)?;
        let file = self.input.name();
        let mut warnings = Warnings::new(self.quiet);
        let interrupt = Interrupt::watch();
        let report = common::in_pool(self.making.collapsing.threads, || {
            let scene = self.input.read(&mut warnings)?.decoded.scene;
            let read = start.elapsed().as_secs_f64();
            interrupt.be_graceful();
            let progress = Progress::new(&interrupt, self.quiet, "simplifying");
            let built = build_progressive(scene, &job, &progress)
                .map_err(|e| Failure::Input(format!("{file}: {e}")))?;
            drop(progress);
            if built.stop == Stop::Cancelled {
                return Err(Failure::Interrupted);
            }
            warnings.say(built.warnings.iter().map(|w| format!("{file}: {w}")));
            let mut built = built;
            let measuring = Instant::now();
            if self.bounds {
                // Out of core, rings are not all at hand.
                let options = match self.random_access {
                    true => hierarchy::Options::CUTS,
                    false => hierarchy::Options::RINGS,
                };
                built
                    .scene
                    .measure_bounds(&options)
                    .map_err(|(m, e)| Failure::Input(format!("{file}: mesh {m}: {e}")))?;
                if interrupt.is_set() {
                    return Err(Failure::Interrupted);
                }
            }
            let bounds = measuring.elapsed().as_secs_f64();
            let encoding = Instant::now();
            let options = EncodeOptions::default()
                .with_any_order(self.any_order)
                .with_quantize(self.quantize)
                .with_sequential(self.sequential)
                .with_pages(self.random_access && self.bounds);
            let bytes = encode_progressive(&built.scene, &options)
                .map_err(|e| Failure::Output(format!("{out}: {e}")))?;
            let encode = encoding.elapsed().as_secs_f64();
            if interrupt.is_set() {
                return Err(Failure::Interrupted);
            }
            let writing = Instant::now();
            common::write_bytes(&self.output, &bytes)?;
            let scene = &built.scene;
            Ok(Report {
                command: "encode",
                method: self.making.method(),
                meshes: scene.meshes.len(),
                vertices: scene.vertices(),
                triangles: scene.triangles(),
                base_triangles: scene.base_triangles(),
                splits: scene.splits(),
                levels: scene.levels(),
                bytes: bytes.len(),
                estimate: built.estimate,
                quantization_error: self.quantize.map(|_| quantization_error(&bytes)),
                seconds: Seconds {
                    read,
                    build: built.build_seconds,
                    simplify: built.simplify_seconds,
                    bounds,
                    encode,
                    write: writing.elapsed().as_secs_f64(),
                    total: start.elapsed().as_secs_f64(),
                },
                warnings: vec![],
            })
        })?;
        let report = Report { warnings: warnings.all, ..report };
        if !self.quiet {
            common::note(&report.text(&file));
        }
        if self.json { print_json(&report) } else { Ok(()) }
    }
}

/// By how much quantising moved a vertex at most, over all meshes, model units.
fn quantization_error(bytes: &[u8]) -> f64 {
    let Ok(reader) = RangeReader::new(bytes) else { return 0.0 };
    let of = |m| reader.base(m).map_or(0.0, |b| b.0.quantisation_error);
    (0..reader.directory().meshes).map(of).fold(0.0, f64::max)
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    method: &'static str,
    meshes: usize,
    vertices: usize,
    triangles: usize,
    base_triangles: usize,
    splits: usize,
    levels: usize,
    bytes: usize,
    estimate: f64,
    quantization_error: Option<f64>,
    seconds: Seconds,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    build: f64,
    simplify: f64,
    bounds: f64,
    encode: f64,
    write: f64,
    total: f64,
}

impl Report {
    fn text(&self, file: &str) -> String {
        let quantized = match self.quantization_error {
            Some(e) => format!("; vertices moved by at most {}", short(e)),
            None => String::new(),
        };
        let t = &self.seconds;
        format!(
            "{file}: {} triangles -> base of {} and {} splits, {} bytes ({:.1} bits a vertex){quantized}; {}, {:.3} s (read {:.3}, \
             build {:.3}, simplify {:.3}, bounds {:.3}, encode {:.3}, write {:.3})",
            thousands(self.triangles),
            thousands(self.base_triangles),
            thousands(self.splits),
            thousands(self.bytes),
            8.0 * self.bytes as f64 / self.vertices.max(1) as f64,
            self.method,
            t.total,
            t.read,
            t.build,
            t.simplify,
            t.bounds,
            t.encode,
            t.write
        )
    }
}
