//! `progmesh convert IN OUT`.

use super::Failure;
use super::args::{Input, Output, Shape};
use super::common::{self, Warnings};
use super::control::Interrupt;
use progmesh::pipeline::{JobError, Preparation, prepare};
use serde::Serialize;
use std::time::Instant;

/// Read a mesh and write it in another format, without simplifying it.
///
/// Faces, their order and their polygons stay unless a flag says otherwise. What the output format cannot hold is said on standard error.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh convert scan.ply scan.glb
  progmesh convert part.stl part.obj --normals recompute --crease 30
  progmesh convert soup.obj whole.ply --weld=1e-6 --triangulate
  curl -s URL | progmesh convert - - --from obj --to glb > mesh.glb")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    shape: Shape,
    /// Cut polygons into triangles
    #[arg(long)]
    triangulate: bool,
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
        let mut how = Preparation::default();
        how.weld = self.shape.weld();
        how.normals = self.shape.normals()?;
        how.triangulate = self.triangulate;
        let mut warnings = Warnings::new(self.quiet);
        let format = self.output.format(&mut warnings)?;
        let interrupt = Interrupt::watch();
        let loaded = self.input.read(&mut warnings)?;
        let (mut scene, read) = (loaded.decoded.scene, start.elapsed().as_secs_f64());
        interrupt.be_graceful();
        let file = self.input.name();
        let said = prepare(&mut scene, &how).map_err(|e: JobError| Failure::Input(format!("{file}: {e}")))?;
        warnings.say(said.into_iter().map(|w| format!("{file}: {w}")));
        let preparing = start.elapsed().as_secs_f64() - read;
        self.output.write(format, &scene, &interrupt, &mut warnings)?;
        if self.json {
            let total = start.elapsed().as_secs_f64();
            common::print_json(&Report {
                command: "convert",
                from: loaded.format.extension(),
                to: format.extension(),
                meshes: scene.meshes.len(),
                vertices: scene.meshes.iter().map(|m| m.geometry.positions.len()).sum(),
                faces: scene.meshes.iter().map(|m| m.geometry.face_count()).sum(),
                triangles: scene.unique_triangles(),
                seconds: Seconds { read, prepare: preparing, write: total - read - preparing, total },
                warnings: warnings.all,
            })?;
        }
        Ok(())
    }
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    from: &'static str,
    to: &'static str,
    meshes: usize,
    vertices: usize,
    faces: usize,
    triangles: usize,
    seconds: Seconds,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    prepare: f64,
    write: f64,
    total: f64,
}
