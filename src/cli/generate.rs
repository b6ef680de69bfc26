//! `progmesh generate NAME OUT`.

use super::Failure;
use super::common::{self, FormatName, Warnings, thousands};
use super::control::Interrupt;
use progmesh::meshes::{self, GenerateOptions};
use progmesh::samples;
use std::fmt::Write;
use std::path::PathBuf;

/// Write a sample mesh: well-formed ones to try things on, hostile ones to see what survives.
///
/// The same name, size and seed give the same mesh on every platform.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh generate --list
  progmesh generate torus torus.glb --faces 100000
  progmesh generate scan scan.ply --seed 7
  progmesh generate quad-sphere - --to obj | progmesh info - --from obj")]
pub(crate) struct Args {
    /// Which mesh; see --list
    #[arg(value_name = "NAME", required_unless_present = "list")]
    name: Option<String>,
    /// The file to write; - for standard output, with --to
    #[arg(value_name = "OUT", required_unless_present = "list")]
    output: Option<PathBuf>,
    /// List the meshes there are
    #[arg(long, exclusive = true)]
    list: bool,
    /// About how many faces
    #[arg(long, visible_alias = "size", value_name = "N")]
    faces: Option<usize>,
    /// Which of the many
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Format of OUT, instead of what its name says
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: Option<FormatName>,
    /// Write text where the format has text and binary (PLY, STL)
    #[arg(long)]
    text: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let (Some(name), Some(output)) = (&self.name, &self.output) else {
            return common::print(&list());
        };
        let format = common::output_format(output, self.to)?;
        let mut options = GenerateOptions::default().with_seed(self.seed);
        options.faces = self.faces;
        let sample = meshes::generate(name, &options).map_err(|e| Failure::Usage(e.to_string()))?;
        let mut warnings = Warnings::new(self.quiet);
        let (vertices, faces) = (sample.positions.len(), sample.face_count());
        let scene = samples::scene(sample, name);
        let interrupt = Interrupt::watch();
        interrupt.be_graceful();
        common::write(output, format, self.text, &scene, &interrupt, &mut warnings)?;
        if !self.quiet {
            let file = common::name(output, "standard output");
            common::note(&format!("{file}: {} vertices, {} faces", thousands(vertices), thousands(faces)));
        }
        Ok(())
    }
}

fn list() -> String {
    let mut text = String::new();
    for hostile in [false, true] {
        text += if hostile { "\nHostile:\n" } else { "Well-formed:\n" };
        for e in meshes::names().iter().filter(|e| e.hostile == hostile) {
            let size = match e.default_faces {
                0 => String::new(),
                n => format!("  [{} faces]", thousands(n)),
            };
            let _ = writeln!(text, "  {:<20} {}{size}", e.name, e.about);
        }
    }
    text
}
