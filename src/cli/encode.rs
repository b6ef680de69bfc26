//! `progmesh encode IN OUT.pm`.

use super::Failure;
use super::args::{self, Input};
use super::common::{self, Warnings, short, thousands};
use super::control::{Interrupt, Progress};
use super::ending::PmEnding;
use super::method::Making;
use progmesh::io::pm::encode_progressive;
use progmesh::pipeline::build_progressive;
use progmesh::refine::format::{EncodeOptions, RangeReader};
use progmesh::refine::hierarchy;
use progmesh::simplify::Stop;
use serde::Serialize;
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
  progmesh encode city.ply city.pm --paged
  progmesh encode scene.glb scene.pm --quantize 14
  progmesh encode horse.ply horse.pm --method nsa --epsilon 12")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
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
    /// Measure and write what view-dependent refinement decides by, so that extract and fly begin at once: 5 to 7 bytes a vertex
    #[arg(long, help_heading = "File")]
    bounds: bool,
    /// Measure and write what extract and fly need for --memory: what --bounds writes, and links between the chunks: 9 to 11 bytes a vertex
    #[arg(long, help_heading = "File", conflicts_with_all = ["sequential", "bounds"])]
    paged: bool,
    /// With --bounds or --paged: also which way deviations lie, so that extract and fly --error directional begin at once: 1 to 2 bytes a vertex more
    #[arg(long, help_heading = "File")]
    directional: bool,
    #[command(flatten)]
    ending: PmEnding,
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
        if self.directional && !self.bounds && !self.paged {
            return Err(Failure::Usage(
                "--directional goes with --bounds or --paged: it is about what they write".into(),
            ));
        }
        let job = self.making.job()?;
        let out = self.ending.begin()?;
        let file = self.input.name();
        let mut warnings = Warnings::new(self.ending.quiet);
        let interrupt = Interrupt::watch();
        let report = common::in_pool(self.making.collapsing.threads, || {
            let scene = self.input.read(&mut warnings)?.decoded.scene;
            let read = start.elapsed().as_secs_f64();
            interrupt.be_graceful();
            let progress = Progress::new(&interrupt, self.ending.quiet, "simplifying");
            let job = job.on_grid(&scene);
            let built = build_progressive(scene, &job, &progress)
                .map_err(|e| Failure::Input(format!("{file}: {e}")))?;
            drop(progress);
            if built.stop == Stop::Cancelled {
                return Err(Failure::Interrupted);
            }
            warnings.say(built.warnings.iter().map(|w| format!("{file}: {w}")));
            let has_extras = |m: &progmesh::scene::SceneMesh| !m.extras.is_empty();
            if self.any_order && built.scene.shell.meshes.iter().any(has_extras) {
                let what = "values of faces, and attributes of vertices without a face,";
                warnings.say([format!("{file}: {what} are left out with --any-order")]);
            }
            let mut built = built;
            let measuring = Instant::now();
            if self.bounds || self.paged {
                built
                    .scene
                    .measure_bounds(&hierarchy::Options::RINGS.with_directions(self.directional))
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
                .with_pages(self.paged);
            let bytes = encode_progressive(&built.scene, &options)
                .map_err(|e| Failure::Output(format!("{out}: {e}")))?;
            let encode = encoding.elapsed().as_secs_f64();
            let write = self.ending.write(&bytes, &interrupt)?;
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
                    write,
                    total: start.elapsed().as_secs_f64(),
                },
                warnings: vec![],
            })
        })?;
        let report = Report { warnings: warnings.all, ..report };
        self.ending.report(&report, || report.text(&file))
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
