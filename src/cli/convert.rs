//! `progmesh convert IN OUT`.

use super::common::{self, FormatName, Shape, Warnings};
use super::control::Interrupt;
use super::{Failure, common::name};
use progmesh::pipeline::{JobError, Preparation, prepare};
use std::path::PathBuf;

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
    /// The mesh to read; - for standard input, with --from
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The file to write; - for standard output, with --to
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Format of IN, instead of what its name says
    #[arg(long, value_enum, value_name = "FORMAT")]
    from: Option<FormatName>,
    /// Format of OUT, instead of what its name says
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: Option<FormatName>,
    #[command(flatten)]
    shape: Shape,
    /// Cut polygons into triangles
    #[arg(long)]
    triangulate: bool,
    /// Write text where the format has text and binary (PLY, STL)
    #[arg(long)]
    text: bool,
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
        let format = common::output_format(&self.output, self.to)?;
        let interrupt = Interrupt::watch();
        let mut warnings = Warnings::new(self.quiet);
        let mut loaded = common::read(&self.input, self.from, &mut warnings)?;
        interrupt.be_graceful();
        let file = name(&self.input, "standard input");
        let said = prepare(&mut loaded.decoded.scene, &how)
            .map_err(|e: JobError| Failure::Input(format!("{file}: {e}")))?;
        warnings.say(said.into_iter().map(|w| format!("{file}: {w}")));
        common::write(&self.output, format, self.text, &loaded.decoded.scene, &interrupt, &mut warnings)
    }
}
