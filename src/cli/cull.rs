//! `progmesh cull IN OUT --camera CAM`.

use super::Failure;
use super::args::{Input, Output};
use super::camera;
use super::common::{self, Warnings, thousands};
use super::control::Interrupt;
use super::picture::PictureArgs;
use progmesh::views::{CullReport, cull_scene};
use serde::Serialize;
use std::time::Instant;

/// Leave out what a camera cannot see, and say what was left out.
///
/// Instances, components and faces outside of the view go; so do back faces that their own component's front hides: where it is closed, oriented
/// outwards, opaque, and beyond the near plane. Whole faces only, `clip` cuts them. What other things hide stays.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh cull city.glb seen.glb --camera cam.json
  progmesh cull city.glb seen.glb --camera city.glb#street --json")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    output: Output,
    /// The camera: CAM.json (docs/camera.md), or scene.glb#NAME
    #[arg(long, value_name = "CAM")]
    camera: String,
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
        self.output.leave_room_for(self.json)?;
        let mut warnings = Warnings::new(self.quiet);
        let format = self.output.format(&mut warnings)?;
        let mut drawing = self.picture.drawing()?;
        let camera = camera::read(&self.camera, &mut warnings)?;
        let interrupt = Interrupt::watch();
        let reading = Instant::now();
        let loaded = self.input.read(&mut warnings)?;
        let (mut scene, read) = (loaded.decoded.scene, reading.elapsed().as_secs_f64());
        interrupt.be_graceful();
        let file = self.input.name();
        let failed = |e: String| Failure::Input(format!("{file}: {e}"));
        let before = scene.unique_triangles();
        if let Some(d) = &mut drawing {
            d.add(&scene).map_err(|e| failed(e.to_string()))?;
        }
        let culling = Instant::now();
        let done = cull_scene(&mut scene, &camera).map_err(|e| failed(e.to_string()))?;
        let cull = culling.elapsed().as_secs_f64();
        let after = scene.unique_triangles();
        let nothing = (after == 0 && before > 0).then(|| format!("{file}: nothing is in view"));
        let skinned = (done.skinned > 0).then(|| format!("{file}: meshes with a skin are kept whole"));
        warnings.say(nothing.into_iter().chain(skinned));
        if interrupt.is_set() {
            return Err(Failure::Interrupted);
        }
        let draw = match &mut drawing {
            Some(d) => {
                d.add(&scene).map_err(|e| failed(e.to_string()))?;
                d.write()?;
                d.seconds
            }
            None => 0.0,
        };
        let writing = Instant::now();
        self.output.write(format, &scene, &interrupt, &mut warnings)?;
        let write = writing.elapsed().as_secs_f64();
        if !self.quiet {
            common::note(&said(&file, &done));
        }
        if !self.json {
            return Ok(());
        }
        common::print_json(&Report {
            command: "cull",
            from: loaded.format.extension(),
            to: format.extension(),
            instances: Instances {
                all: done.instances,
                outside: done.instances_outside,
                dropped: done.instances_dropped,
            },
            components: Components {
                all: done.components,
                outside: done.components_outside,
                solid: done.components_solid,
            },
            faces: Faces {
                all: done.faces,
                outside: done.faces_outside,
                back: done.faces_back,
                back_by_cone: done.faces_by_cone,
                kept: done.faces_kept(),
            },
            triangles: [before, after],
            seconds: Seconds { read, cull, draw, write, total: start.elapsed().as_secs_f64() },
            warnings: warnings.all,
        })
    }
}

fn said(file: &str, done: &CullReport) -> String {
    format!(
        "{file}: {} of {} faces can be seen; {} are outside of the view ({} of {} instances wholly), {} turn their back",
        thousands(done.faces_kept()),
        thousands(done.faces),
        thousands(done.faces_outside),
        thousands(done.instances_outside),
        thousands(done.instances),
        thousands(done.faces_back)
    )
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    from: &'static str,
    to: &'static str,
    instances: Instances,
    components: Components,
    faces: Faces,
    triangles: [usize; 2],
    seconds: Seconds,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Instances {
    all: usize,
    outside: usize,
    dropped: usize,
}

#[derive(Serialize)]
struct Components {
    all: usize,
    outside: usize,
    solid: usize,
}

#[derive(Serialize)]
struct Faces {
    all: usize,
    outside: usize,
    back: usize,
    back_by_cone: usize,
    kept: usize,
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    cull: f64,
    draw: f64,
    write: f64,
    total: f64,
}
