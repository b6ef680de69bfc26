//! `progmesh morph IN.pm OUT`.

use super::Failure;
use super::args::{self, Output, ProgressiveInput};
use super::common::{self, Warnings, thousands};
use super::control::Interrupt;
use progmesh::progressive::Detail;
use serde::Serialize;
use std::path::PathBuf;

/// Write a mesh between two levels of detail of a progressive mesh: a geomorph.
///
/// It has the faces of the finer of the two; positions, normals, colours and texture coordinates lie between. At 0 it looks as the mesh of --from, at
/// 1 as that of --to; the finer of the two it is bit for bit.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh morph bunny.pm half-way.glb --from 1000 --to 5000 --at 0.5
  progmesh morph scene.pm still.obj --from 5000 --to 400 --at 0.25")]
pub(crate) struct Args {
    #[command(flatten)]
    input: ProgressiveInput,
    /// The file to write; its name says the format
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Begin with the mesh of at most this many triangles
    #[arg(long, value_name = "FACES", value_parser = args::whole, allow_negative_numbers = true)]
    from: usize,
    /// End with the mesh of at most this many triangles
    #[arg(long, value_name = "FACES", value_parser = args::whole, allow_negative_numbers = true)]
    to: usize,
    /// How far to go: 0 is the mesh of --from, 1 that of --to
    #[arg(long, value_name = "A", value_parser = args::fraction, allow_negative_numbers = true)]
    at: f64,
    /// Print one JSON object about the run on standard output (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let output = Output::new(self.output.clone(), None, false);
        output.leave_room_for(self.json)?;
        let mut warnings = Warnings::new(self.quiet);
        let format = output.format(&mut warnings)?;
        let file = self.input.name();
        let interrupt = Interrupt::watch();
        let mut read = self.input.read(false, &mut warnings)?;
        interrupt.be_graceful();
        read.sort_by_error();
        let positions = |faces: usize| read.positions(Detail::Triangles(faces));
        let (from, to) = (positions(self.from), positions(self.to));
        let (scene, ends) = read
            .between(&from, &to, self.at)
            .map_err(|(m, e)| Failure::Input(format!("{file}: mesh {m}: {e}")))?;
        for (asked, have) in [(self.from, ends[0]), (self.to, ends[1])] {
            if have > asked {
                let (have, asked) = (thousands(have), thousands(asked));
                warnings
                    .say([format!("{file}: the base has {have} triangles, more than the {asked} asked for")]);
            }
        }
        if interrupt.is_set() {
            return Err(Failure::Interrupted);
        }
        output.write(format, &scene, &interrupt, &mut warnings)?;
        let report = Report {
            command: "morph",
            to: format.extension(),
            from_triangles: ends[0],
            to_triangles: ends[1],
            at: self.at,
            triangles: scene.unique_triangles(),
            warnings: warnings.all,
        };
        if !self.quiet {
            common::note(&format!(
                "{file}: between {} and {} triangles at {}: {} triangles",
                thousands(ends[0]),
                thousands(ends[1]),
                self.at,
                thousands(report.triangles)
            ));
        }
        if self.json { common::print_json(&report) } else { Ok(()) }
    }
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    to: &'static str,
    from_triangles: usize,
    to_triangles: usize,
    at: f64,
    triangles: usize,
    warnings: Vec<String>,
}
