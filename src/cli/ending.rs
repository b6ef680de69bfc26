//! How commands end: those that make a mesh of a mesh (`clip`, `cull`, `extract`) draw, write, say, report; those that make a progressive mesh
//! (`encode`, `terrain build`) write it, say, report.

use super::Failure;
use super::args::Output;
use super::common::{self, Warnings};
use super::control::Interrupt;
use super::picture::{Drawing, PictureArgs};
use progmesh::io::Format;
use progmesh::io::files;
use progmesh::report::View;
use progmesh::scene::Scene;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// `OUT`, `--png`, `--json`, `--quiet`.
#[derive(clap::Args, Debug)]
pub(crate) struct Ending {
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    picture: PictureArgs,
    /// Print one JSON object about the run on standard output (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Where the result will go.
pub(crate) struct Results {
    pub(crate) format: Format,
    drawing: Option<Drawing>,
    pub(crate) warnings: Warnings,
}

/// What drawing and writing took.
pub(crate) struct Spent {
    pub(crate) draw: f64,
    pub(crate) write: f64,
}

impl Ending {
    /// Fails, before any work is done, where the mesh or the picture could not be written.
    pub(crate) fn begin(&self) -> Result<Results, Failure> {
        self.output.leave_room_for(self.json)?;
        let mut warnings = Warnings::new(self.quiet);
        let format = self.output.format(&mut warnings)?;
        Ok(Results { format, drawing: self.picture.drawing()?, warnings })
    }

    /// Draws the result, writes it, then the picture: one that cannot be drawn leaves no mesh behind.
    pub(crate) fn finish(
        &self,
        results: &mut Results,
        scene: &Scene,
        interrupt: &Interrupt,
    ) -> Result<Spent, Failure> {
        if interrupt.is_set() {
            return Err(Failure::Interrupted);
        }
        results.draw(scene)?;
        let writing = Instant::now();
        self.output.write(results.format, scene, interrupt, &mut results.warnings)?;
        let write = writing.elapsed().as_secs_f64();
        results.drawing.as_mut().map_or(Ok(()), Drawing::write)?;
        Ok(Spent { draw: results.drawing.as_ref().map_or(0.0, |d| d.seconds), write })
    }

    /// One line for people.
    pub(crate) fn say(&self, line: impl FnOnce() -> String) {
        if !self.quiet {
            common::note(&line());
        }
    }

    /// `--json`.
    pub(crate) fn print(&self, report: &impl Serialize) -> Result<(), Failure> {
        if self.json { common::print_json(report) } else { Ok(()) }
    }
}

impl Results {
    /// Pictures are taken from here.
    pub(crate) fn through(&mut self, view: View) {
        if let Some(d) = &mut self.drawing {
            d.through(view);
        }
    }

    /// Adds a scene to the picture, if there will be one.
    pub(crate) fn draw(&mut self, scene: &Scene) -> Result<(), Failure> {
        self.drawing.as_mut().map_or(Ok(()), |d| d.add(scene))
    }
}

/// `OUT.pm`, `--json`, `--quiet`.
#[derive(clap::Args, Debug)]
pub(crate) struct PmEnding {
    /// The file to write, .pm; - for standard output
    #[arg(value_name = "OUT.pm")]
    output: PathBuf,
    /// Print one JSON object about the run on standard output (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

impl PmEnding {
    /// Where the file will be.
    pub(crate) fn path(&self) -> &Path {
        &self.output
    }

    /// What messages call it; fails, before any work is done, where it could not be written.
    pub(crate) fn begin(&self) -> Result<String, Failure> {
        let out = common::name(&self.output, "standard output");
        if self.json && files::is_dash(&self.output) {
            return Err(Failure::Usage(
                "--json and OUT both want standard output; write OUT to a path".into(),
            ));
        }
        if self.output.extension().is_some_and(|e| !e.eq_ignore_ascii_case("pm")) {
            return Err(Failure::Usage(format!("{out}: a progressive mesh's name must end in .pm")));
        }
        common::check_target(&self.output)?;
        Ok(out)
    }

    /// Writes the file, unless the command was interrupted; the seconds it took.
    pub(crate) fn write(&self, bytes: &[u8], interrupt: &Interrupt) -> Result<f64, Failure> {
        if interrupt.is_set() {
            return Err(Failure::Interrupted);
        }
        let writing = Instant::now();
        common::write_bytes(&self.output, bytes)?;
        Ok(writing.elapsed().as_secs_f64())
    }

    /// One line for people, and `--json`.
    pub(crate) fn report(
        &self,
        report: &impl Serialize,
        line: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        if !self.quiet {
            common::note(&line());
        }
        if self.json { common::print_json(report) } else { Ok(()) }
    }
}
