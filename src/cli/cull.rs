//! `progmesh cull IN OUT --camera CAM`.

use super::Failure;
use super::args::Input;
use super::camera;
use super::common::thousands;
use super::control::Interrupt;
use super::ending::Ending;
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
    ending: Ending,
    /// The camera: CAM.json (docs/camera.md), or scene.glb#NAME
    #[arg(long, value_name = "CAM")]
    camera: String,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let start = Instant::now();
        let mut results = self.ending.begin()?;
        let camera = camera::read(&self.camera, &mut results.warnings)?;
        let interrupt = Interrupt::watch();
        let reading = Instant::now();
        let loaded = self.input.read(&mut results.warnings)?;
        let (mut scene, read) = (loaded.decoded.scene, reading.elapsed().as_secs_f64());
        interrupt.be_graceful();
        let file = self.input.name();
        let before = scene.unique_triangles();
        results.draw(&scene)?;
        let culling = Instant::now();
        let done = cull_scene(&mut scene, &camera);
        let done = done.map_err(|e| Failure::Input(format!("{file}: {e}")))?;
        let cull = culling.elapsed().as_secs_f64();
        let after = scene.unique_triangles();
        let nothing = (after == 0 && before > 0).then(|| format!("{file}: nothing is in view"));
        let skinned = (done.skinned > 0).then(|| format!("{file}: meshes with a skin are kept whole"));
        results.warnings.say(nothing.into_iter().chain(skinned));
        let spent = self.ending.finish(&mut results, &scene, &interrupt)?;
        self.ending.say(|| said(&file, &done));
        self.ending.print(&Report {
            command: "cull",
            from: loaded.format.extension(),
            to: results.format.extension(),
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
            seconds: Seconds {
                read,
                cull,
                draw: spent.draw,
                write: spent.write,
                total: start.elapsed().as_secs_f64(),
            },
            warnings: results.warnings.all,
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
