//! `progmesh simplify IN OUT`.

use super::Failure;
use super::args::{self, Input, Output, Shape};
use super::common::{self, Warnings, short, thousands};
use super::control::{Interrupt, Progress};
use super::picture::PictureArgs;
use clap::ValueEnum;
use progmesh::io::files;
use progmesh::pipeline::{Job, JobError, Summary, count, simplify_scene};
use progmesh::simplify::{self as engine, MaxError, SimplifyError, Stop};
use serde::Serialize;
use std::time::Instant;

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
    /// Where a vertex goes that replaces an edge (or a cluster) [default: midpoint for nsa, optimal otherwise]
    #[arg(long, value_enum, help_heading = "Method")]
    placement: Option<PlacementName>,
    /// quadric: always the cheapest edge, or batches of cheap ones [default: bulk]
    #[arg(long, value_enum, help_heading = "Method")]
    schedule: Option<ScheduleName>,
    /// nsa: the most a face's normal may turn in one collapse, degrees [default: 12]
    #[arg(long, value_name = "DEG", value_parser = args::degrees, allow_negative_numbers = true,
          help_heading = "Method")]
    epsilon: Option<f64>,
    /// nsa: at most this many passes
    #[arg(long, value_name = "K", value_parser = args::positive, allow_negative_numbers = true,
          help_heading = "Method")]
    passes: Option<usize>,

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
    /// Each mesh of a scene gets the ratio (or the error) by itself, instead of a shared target
    #[arg(long, conflicts_with = "triangles", help_heading = "Target")]
    per_mesh: bool,

    /// Vertices on a border neither move nor go
    #[arg(long, help_heading = "What stays")]
    lock_border: bool,
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
    shape: Shape,
    #[command(flatten)]
    picture: PictureArgs,
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MethodName {
    /// Edge collapse while no face's normal turns by more than --epsilon (Silva & Gomes)
    Nsa,
    /// Quadric edge collapse (Garland & Heckbert)
    Quadric,
    /// Vertex clustering on a grid: fastest, coarsest, does not keep topology
    Cluster,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PlacementName {
    Endpoint,
    Midpoint,
    Optimal,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ScheduleName {
    Exact,
    Bulk,
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
        let (summary, counts, seconds, written) = common::in_pool(self.threads, || {
            let scene = self.input.read(&mut warnings)?.decoded.scene;
            let read = start.elapsed().as_secs_f64();
            interrupt.be_graceful();
            if let Some(d) = &mut drawing {
                d.add(&scene).map_err(|e| Failure::Input(format!("{file}: {e}")))?;
            }
            let instanced_in = scene.instanced_triangles();
            let result = simplify_scene(scene, &job, &Progress::new(&interrupt, self.quiet));
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
                    d.add(&scene).map_err(|e| Failure::Output(format!("the result: {e}")))?;
                    d.write()
                }
                None => Ok(()),
            });
            let seconds = Seconds {
                read,
                build: summary.build_seconds,
                simplify: summary.simplify_seconds,
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
        let only =
            |flag: &str, given: bool, method: MethodName, of: &str| match given && self.method != method {
                true => Err(Failure::Usage(format!("{flag} is for --method {of}"))),
                false => Ok(()),
            };
        only("--epsilon", self.epsilon.is_some(), MethodName::Nsa, "nsa")?;
        only("--passes", self.passes.is_some(), MethodName::Nsa, "nsa")?;
        only("--schedule", self.schedule.is_some(), MethodName::Quadric, "quadric")?;
        let target = self.ratio.is_some() || self.triangles.is_some() || self.max_error.is_some();
        if !target && self.method != MethodName::Nsa {
            return Err(Failure::Usage("how far? Give --ratio R, --triangles N or --max-error E".into()));
        }
        if self.keep_vertices && self.placement.is_some_and(|p| p != PlacementName::Endpoint) {
            return Err(Failure::Usage(
                "--keep-vertices moves no vertex: --placement can only be endpoint".into(),
            ));
        }
        let mut job = Job::default();
        let o = &mut job.options;
        o.method = match self.method {
            MethodName::Nsa => engine::Method::Nsa,
            MethodName::Quadric => engine::Method::Quadric,
            MethodName::Cluster => engine::Method::Cluster,
        };
        o.placement = self.placement.map(|p| match p {
            PlacementName::Endpoint => engine::Placement::Endpoint,
            PlacementName::Midpoint => engine::Placement::Midpoint,
            PlacementName::Optimal => engine::Placement::Optimal,
        });
        o.schedule = self.schedule.map(|s| match s {
            ScheduleName::Exact => engine::Schedule::Exact,
            ScheduleName::Bulk => engine::Schedule::Bulk,
        });
        o.triangles = self.triangles;
        o.ratio = self.ratio;
        o.max_error = self.max_error.map(|value| MaxError { value, relative: self.relative });
        o.epsilon = self.epsilon;
        o.passes = self.passes;
        o.lock_border = self.lock_border;
        o.keep_vertices = self.keep_vertices;
        o.prune = self.prune;
        o.threads = self.threads;
        job.weld = self.shape.weld();
        job.normals = self.shape.normals()?;
        job.per_mesh = self.per_mesh;
        job.lock_materials = self.lock_material.clone();
        job.lock_groups = self.lock_group.clone();
        job.weights_property = self.weights_property.clone();
        job.lock_property = self.lock_property.clone();
        Ok(job)
    }

    /// The summary for people, on standard error.
    fn tell(&self, file: &str, s: &Summary, n: &Triangles, t: &Seconds) {
        if self.method == MethodName::Nsa {
            for l in &s.levels {
                common::note(&format!(
                    "pass {}: {} faces, {:.3} s, {} collapses tried, {} refused",
                    l.pass,
                    thousands(l.faces),
                    l.seconds,
                    thousands(l.tried as usize),
                    thousands(l.refused.total() as usize)
                ));
            }
        }
        let percent = 100.0 * s.faces_out as f64 / s.faces_in.max(1) as f64;
        let relative = match s.diagonal > 0.0 {
            true => format!(" ({} % of the diagonal)", short(100.0 * s.estimate / s.diagonal)),
            false => String::new(),
        };
        common::note(&format!(
            "{file}: {} -> {} faces ({percent:.1} %), {} vertices{}; {}, {:.3} s (read {:.3}, build {:.3}, simplify {:.3}, \
             write {:.3}{}); estimated error {}{relative}; stopped: {}",
            thousands(s.faces_in),
            thousands(s.faces_out),
            thousands(s.vertices_out),
            n.instances(),
            self.method_name(),
            t.total,
            t.read,
            t.build,
            t.simplify,
            t.write,
            if t.draw > 0.0 { format!(", draw {:.3}", t.draw) } else { String::new() },
            short(s.estimate),
            match s.stop {
                Stop::Target => "target reached",
                Stop::Error => "error bound reached",
                Stop::Passes => "passes done",
                Stop::Cancelled => "interrupted",
                _ if self.method == MethodName::Cluster => "a coarser grid would leave nothing",
                _ => "no legal collapse left",
            }
        ));
    }

    fn method_name(&self) -> &'static str {
        match self.method {
            MethodName::Nsa => "nsa",
            MethodName::Quadric => "quadric",
            MethodName::Cluster => "cluster",
        }
    }

    /// What most likely stands in the way of the target, and what helps.
    fn advice(&self, s: &Summary, target: usize) -> String {
        if self.method == MethodName::Cluster {
            return match self.locks() {
                _ if target == 0 => "A mesh is never left empty: ask for 1 or more".into(),
                true => "Locked vertices are not merged: lock less, or try --method quadric".into(),
                false => "Try --method quadric, which meets a target by single faces".into(),
            };
        }
        if s.least_triangles > target {
            return format!(
                "A closed surface has at least 4 faces a component, with handles more, an open one 1: here {} together. Ask for \
                 more, or try --weld or --prune, or --method cluster, which does not keep topology",
                thousands(s.least_triangles)
            );
        }
        let last = s.levels.last().map(|l| l.refused).unwrap_or_default();
        let reasons = [
            (last.normal, "normals would turn too far: try a larger --epsilon"),
            (
                last.link,
                "topology would change: try --weld or --prune, or --method cluster, which does not keep it",
            ),
            (last.border, "borders, seams or material borders would change: try --weld, or --method quadric"),
            (last.flip, "faces would flip or degenerate: try --placement endpoint or another --method"),
            (last.valence, "vertices would get too many edges: try --method cluster"),
            (last.locked, "vertices are locked: lock less"),
        ];
        match reasons.iter().max_by_key(|r| r.0).filter(|r| r.0 > 0) {
            Some((_, advice)) => format!("Mostly {advice}"),
            // A batch need not look at what is locked at all.
            None if self.locks() => "What is left is locked: lock less".into(),
            None => "Try --weld, --prune or --method cluster".into(),
        }
    }

    /// What to say where a bound on the cells of a grid kept all vertices apart.
    fn nothing_merged(&self, s: &Summary) -> Option<String> {
        let nothing = self.method == MethodName::Cluster
            && self.max_error.is_some()
            && s.stop == Stop::Error
            && s.triangles_in > 0
            && s.triangles_out == s.triangles_in;
        nothing.then(|| {
            "nothing was merged: for --method cluster --max-error is the diagonal of a cell, and no two vertices of a face lie in one; \
             allow more, or try --method quadric"
                .into()
        })
    }

    fn locks(&self) -> bool {
        let named = !self.lock_material.is_empty() || !self.lock_group.is_empty();
        named || self.lock_border || self.lock_property.is_some()
    }

    fn report(&self, s: &Summary, triangles: Triangles, seconds: Seconds, warnings: Vec<String>) -> Report {
        Report {
            command: "simplify",
            method: self.method_name(),
            faces_in: s.faces_in,
            faces_out: s.faces_out,
            vertices_out: s.vertices_out,
            triangles,
            seconds,
            stop: match s.stop {
                Stop::Target => "target",
                Stop::Error => "error",
                Stop::Passes => "passes",
                Stop::Cancelled => "cancelled",
                _ => "no_legal_collapse",
            },
            estimate: s.estimate,
            measured: None,
            levels: s
                .levels
                .iter()
                .map(|l| LevelReport {
                    pass: l.pass,
                    faces: l.faces,
                    seconds: l.seconds,
                    tried: l.tried,
                    refused: RefusedReport {
                        link: l.refused.link,
                        normal: l.refused.normal,
                        border: l.refused.border,
                        flip: l.refused.flip,
                        valence: l.refused.valence,
                        locked: l.refused.locked,
                    },
                })
                .collect(),
            aif_bytes: s.aif_bytes,
            peak_bytes: files::peak_bytes(),
            warnings,
        }
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

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    method: &'static str,
    faces_in: usize,
    faces_out: usize,
    vertices_out: usize,
    triangles: Triangles,
    seconds: Seconds,
    stop: &'static str,
    estimate: f64,
    measured: Option<()>,
    levels: Vec<LevelReport>,
    aif_bytes: usize,
    peak_bytes: Option<u64>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    build: f64,
    simplify: f64,
    write: f64,
    draw: f64,
    total: f64,
}

/// Triangles of the unique meshes, which targets count, and of all instances, which are drawn.
#[derive(Serialize)]
struct Triangles {
    input: usize,
    output: usize,
    instanced_input: usize,
    instanced_output: usize,
    #[serde(skip)]
    meshes: usize,
}

impl Triangles {
    /// For people, where instances make a difference.
    fn instances(&self) -> String {
        if (self.instanced_input, self.instanced_output) == (self.input, self.output) {
            return String::new();
        }
        format!(
            " in {}, each counted once (all instances: {} -> {} triangles)",
            count(self.meshes, "mesh"),
            thousands(self.instanced_input),
            thousands(self.instanced_output)
        )
    }
}

#[derive(Serialize)]
struct LevelReport {
    pass: usize,
    faces: usize,
    seconds: f64,
    tried: u64,
    refused: RefusedReport,
}

#[derive(Serialize)]
struct RefusedReport {
    link: u64,
    normal: u64,
    border: u64,
    flip: u64,
    valence: u64,
    locked: u64,
}
