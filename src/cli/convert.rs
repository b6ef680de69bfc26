//! `progmesh convert IN OUT`.

use super::Failure;
use super::args::{Input, Output, Shape};
use super::common::Warnings;
use super::control::Interrupt;
use progmesh::pipeline::{JobError, Preparation, prepare};

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
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let mut how = Preparation::default();
        how.weld = self.shape.weld();
        how.normals = self.shape.normals()?;
        how.triangulate = self.triangulate;
        let mut warnings = Warnings::new(self.quiet);
        let format = self.output.format(&mut warnings)?;
        let interrupt = Interrupt::watch();
        let mut scene = self.input.read(&mut warnings)?.decoded.scene;
        interrupt.be_graceful();
        let file = self.input.name();
        let said = prepare(&mut scene, &how).map_err(|e: JobError| Failure::Input(format!("{file}: {e}")))?;
        warnings.say(said.into_iter().map(|w| format!("{file}: {w}")));
        self.output.write(format, &scene, &interrupt, &mut warnings)
    }
}
