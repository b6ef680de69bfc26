//! `progmesh simplify IN OUT`.

use super::Failure;
use super::args::{self, Input, Output};
use super::common::{self, Warnings, thousands};
use super::control::{Interrupt, Progress};
use super::method::{Collapsing, MethodName, PlacementName};
use super::picture::PictureArgs;
use progmesh::pipeline::{Job, JobError, count, simplify_scene};
use progmesh::simplify::{MaxError, SimplifyError, Stop};
use report::{Seconds, Triangles};
use std::time::Instant;

mod advice;
mod report;

/// Reduce the number of faces of a mesh, or of a whole scene.
///
/// A scene's target counts the triangles of its unique meshes and is shared over them by the error it makes in the world. Materials, names, nodes,
/// instances and images stay; attributes are interpolated; uv seams and material borders are not torn.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh simplify bunny.obj half.obj --ratio 0.5
  progmesh simplify scene.glb small.glb --triangles 10000
  progmesh simplify scan.ply scan.stl --max-error 0.001 --relative
  progmesh simplify scan.ply scan.stl --max-error 0.001 --relative --certified
  progmesh simplify horse.ply out.ply --method nsa --epsilon 12 --passes 5
  progmesh simplify map.obj out.obj --ratio 0.1 --lock-border --lock-material water
  progmesh simplify scan.ply out.ply --ratio 0.1 --png before-and-after.png
  progmesh simplify - - --from ply --to ply --ratio 0.2 < in.ply > out.ply

Exit code 1 means: done and written, but the target could not be met; the message says why.")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    output: Output,

    /// How to simplify
    #[arg(long, value_enum, default_value_t = MethodName::Quadric, help_heading = "Method")]
    method: MethodName,
    #[command(flatten)]
    collapsing: Collapsing,
    /// quadric: afterwards, move vertices closer to the input in N sweeps [default: 2 for inputs of up to 8,192 triangles, else 0]
    ///
    /// The time goes with the size of the result: at a tenth of the input two sweeps take about as long as the collapses, at a half several
    /// times that. More than two gain little; 0 leaves vertices where the collapses put them.
    #[arg(long, value_name = "N", value_parser = args::whole, allow_negative_numbers = true,
          help_heading = "Method")]
    refit: Option<usize>,

    /// Stop at this part of the input's triangles, 0 to 1
    #[arg(long, value_name = "R", value_parser = args::fraction, conflicts_with = "triangles",
          allow_negative_numbers = true, help_heading = "Target")]
    ratio: Option<f64>,
    /// Stop at this many triangles (a polygon of n corners counts n - 2)
    #[arg(long, value_name = "N", value_parser = args::whole, allow_negative_numbers = true,
          help_heading = "Target")]
    triangles: Option<usize>,
    /// Stop before the estimated error passes this, in world units (an estimate, not a bound)
    ///
    /// With --method cluster it is the diagonal of a cell, so that no vertex moves farther than that: below the distance of
    /// neighbouring vertices nothing is merged. 0 allows only what costs nothing.
    #[arg(long, value_name = "E", value_parser = args::not_negative, allow_negative_numbers = true,
          help_heading = "Target")]
    max_error: Option<f64>,
    /// --max-error is a part of the bounding box's diagonal
    #[arg(long, requires = "max_error", help_heading = "Target")]
    relative: bool,
    /// Make --max-error a guarantee: no point of either surface is farther than that from the other, proven
    ///
    /// Takes as few triangles as that allows, found by some runs of the method. --ratio or --triangles end the search from below.
    #[arg(long, requires = "max_error", conflicts_with = "per_mesh", help_heading = "Target")]
    certified: bool,
    /// Measure the distance of the result from the input, both as they stand in the world
    #[arg(long, help_heading = "Target")]
    measure: bool,
    /// Each mesh of a scene gets the ratio (or the error) by itself, instead of a shared target
    #[arg(long, conflicts_with = "triangles", help_heading = "Target")]
    per_mesh: bool,

    /// Faces of this material stay; may be repeated
    #[arg(long, value_name = "NAME|INDEX", help_heading = "What stays")]
    lock_material: Vec<String>,
    /// Faces of this group or object stay; may be repeated
    #[arg(long, value_name = "NAME", help_heading = "What stays")]
    lock_group: Vec<String>,
    /// Vertices where this vertex property is not 0 stay
    #[arg(long, value_name = "NAME", help_heading = "What stays")]
    lock_property: Option<String>,
    /// This vertex property says how much errors weigh there (positive, 1 = normal)
    #[arg(long, value_name = "NAME", help_heading = "What stays")]
    weights_property: Option<String>,
    /// Index-only: no vertex moves and all are kept, so that several levels can share one vertex buffer
    #[arg(long, help_heading = "What stays")]
    keep_vertices: bool,
    /// First remove components smaller than this part of the mesh's diagonal
    #[arg(long, value_name = "FRACTION", value_parser = args::fraction, allow_negative_numbers = true,
          help_heading = "What stays")]
    prune: Option<f64>,

    #[command(flatten)]
    picture: PictureArgs,
    /// Print one JSON object about the run on standard output (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let start = Instant::now();
        let job = self.job()?;
        self.output.leave_room_for(self.json)?;
        let mut warnings = Warnings::new(self.quiet);
        let format = self.output.format(&mut warnings)?;
        let mut drawing = self.picture.drawing()?;
        let interrupt = Interrupt::watch();
        let file = self.input.name();

        // All within one pool, so that reading and writing keep to the number of threads too.
        let (summary, counts, seconds, written) = common::in_pool(self.collapsing.threads, || {
            let scene = self.input.read(&mut warnings)?.decoded.scene;
            let read = start.elapsed().as_secs_f64();
            interrupt.be_graceful();
            if let Some(d) = &mut drawing {
                d.add(&scene)?;
            }
            let instanced_in = scene.instanced_triangles();
            let result = simplify_scene(scene, &job, &Progress::new(&interrupt, self.quiet, "simplifying"));
            let (scene, summary) = result.map_err(|e| failure(&file, e))?;
            warnings.say(summary.warnings.iter().map(|w| format!("{file}: {w}")));
            warnings.say(self.nothing_merged(&summary).map(|w| format!("{file}: {w}")));
            let counts = Triangles {
                input: summary.triangles_in,
                output: summary.triangles_out,
                instanced_input: instanced_in,
                instanced_output: scene.instanced_triangles(),
                meshes: scene.meshes.len(),
            };
            let writing = Instant::now();
            let written = match summary.stop {
                Stop::Cancelled => Err(Failure::Interrupted),
                _ => self.output.write(format, &scene, &interrupt, &mut warnings),
            };
            let write = writing.elapsed().as_secs_f64();
            let written = written.and_then(|()| match &mut drawing {
                Some(d) => {
                    d.add(&scene)?;
                    d.write()
                }
                None => Ok(()),
            });
            let seconds = Seconds {
                read,
                build: summary.build_seconds,
                simplify: summary.simplify_seconds,
                measure: summary.measure_seconds,
                write,
                draw: drawing.as_ref().map_or(0.0, |d| d.seconds),
                total: start.elapsed().as_secs_f64(),
            };
            Ok((summary, counts, seconds, written))
        })?;
        if let Err(e @ (Failure::Output(_) | Failure::BrokenPipe)) = written {
            return Err(e);
        }
        if !self.quiet && written.is_ok() {
            self.tell(&file, &summary, &counts, &seconds);
        }
        if self.json {
            common::print_json(&self.report(&summary, counts, seconds, warnings.all))?;
        }
        written?;
        match summary.target {
            Some(target) if summary.missed_target() => Err(Failure::Missed(format!(
                "{file}: {} left, more than the {} asked for: {}. {}",
                count(summary.triangles_out, "triangle"),
                thousands(target),
                match self.method {
                    MethodName::Cluster => "no grid leaves fewer, but none at all",
                    _ => "no further collapse is legal",
                },
                self.advice(&summary, target)
            ))),
            _ => Ok(()),
        }
    }

    fn job(&self) -> Result<Job, Failure> {
        self.method.allow("--refit", self.refit.is_some_and(|n| n > 0), MethodName::Quadric)?;
        let fixed =
            self.keep_vertices || self.collapsing.placement.is_some_and(|p| p != PlacementName::Optimal);
        if fixed && self.refit.is_some_and(|n| n > 0) {
            return Err(Failure::Usage(
                "--refit moves vertices: it goes with --placement optimal only, not with --keep-vertices"
                    .into(),
            ));
        }
        let target = self.ratio.is_some() || self.triangles.is_some() || self.max_error.is_some();
        if !target && self.method != MethodName::Nsa {
            return Err(Failure::Usage("how far? Give --ratio R, --triangles N or --max-error E".into()));
        }
        if self.keep_vertices && self.collapsing.placement.is_some_and(|p| p != PlacementName::Endpoint) {
            return Err(Failure::Usage(
                "--keep-vertices moves no vertex: --placement can only be endpoint".into(),
            ));
        }
        let mut job = self.collapsing.job(self.method)?;
        let o = &mut job.options;
        o.refit = self.refit;
        o.triangles = self.triangles;
        o.ratio = self.ratio;
        o.max_error = self.max_error.map(|value| MaxError { value, relative: self.relative });
        o.keep_vertices = self.keep_vertices;
        o.prune = self.prune;
        job.per_mesh = self.per_mesh;
        job.measure = self.measure;
        job.certified = self.certified;
        job.lock_materials = self.lock_material.clone();
        job.lock_groups = self.lock_group.clone();
        job.weights_property = self.weights_property.clone();
        job.lock_property = self.lock_property.clone();
        Ok(job)
    }

    fn locks(&self) -> bool {
        let named = !self.lock_material.is_empty() || !self.lock_group.is_empty();
        named || self.collapsing.lock_border || self.lock_property.is_some()
    }
}

/// An option that is wrong is a matter of usage, a mesh that is wrong one of input.
fn failure(file: &str, e: JobError) -> Failure {
    match e {
        JobError::Options(SimplifyError::Range { .. })
        | JobError::NotFound { .. }
        | JobError::SeveralMeshes { .. } => Failure::Usage(format!("{file}: {e}")),
        e => Failure::Input(format!("{file}: {e}")),
    }
}
