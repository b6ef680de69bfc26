//! `progmesh terrain build GRID OUT.pm`.

use super::facts::facts;
use super::input::{GridInput, known_spacing};
use crate::cli::Failure;
use crate::cli::args;
use crate::cli::common::{self, Warnings, short, thousands};
use crate::cli::control::{Interrupt, Progress};
use crate::cli::ending::PmEnding;
use progmesh::blocks::{self, BuildError, Figures, Options};
use progmesh::ground::Space;
use progmesh::io::files::{self, WorkFolder};
use progmesh::io::grid::GridFile;
use progmesh::io::pm::{Terrain, write_terrain};
use progmesh::terrain::block::BlockError;
use progmesh::terrain::tin;
use serde::Serialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Make a progressive terrain of a height grid of any size, for views that refine it where they look (`fly`, `extract`).
///
/// The grid is simplified in blocks whose borders stay, which are joined 2 x 2, their seams freed, and simplified again, up to one of two triangles (Hoppe 1998). The error of every split is a bound on the difference of
/// height to the grid's samples, proven whatever is refined around it. Heights are read window by window. Finished blocks are put aside in a folder
/// beside OUT.pm: after an interruption the same command goes on where it was.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh terrain build alps.tif alps.pm
  progmesh terrain build etopo5.tif world.pm --floor 20 --json
  progmesh terrain build dem.raw dem.pm --size 16385x16385 --type u16 --floor 3 --memory 256
  progmesh fly alps.pm --path circle --grid alps.tif --tau 1 --cull frustum")]
pub(crate) struct Args {
    #[command(flatten)]
    input: GridInput,
    /// At full detail no sample is farther than this from the mesh, vertically, in the grid's units; at 0 every sample is a vertex
    #[arg(long, value_name = "E", value_parser = args::not_negative, allow_negative_numbers = true,
          default_value_t = 0.0, help_heading = "Blocks")]
    floor: f64,
    /// Steps along a side of the finest blocks, 8 to 4096
    #[arg(long, value_name = "N", value_parser = side, allow_negative_numbers = true, default_value_t = 128,
          help_heading = "Blocks")]
    block: usize,
    /// Hold about so much of heights and blocks at once
    #[arg(long, value_name = "MIB", value_parser = memory, allow_negative_numbers = true, default_value_t = 384,
          help_heading = "Blocks")]
    memory: usize,
    /// Threads to use; the result does not depend on it [default: all]
    #[arg(long, value_name = "N", value_parser = args::threads, allow_negative_numbers = true)]
    threads: Option<usize>,
    #[command(flatten)]
    ending: PmEnding,
}

fn side(text: &str) -> Result<usize, String> {
    match args::whole(text) {
        Ok(n @ 8..=4096) => Ok(n),
        _ => Err("must be a whole number from 8 to 4096".into()),
    }
}

fn memory(text: &str) -> Result<usize, String> {
    match args::whole(text) {
        Ok(n @ 16..=1_048_576) => Ok(n),
        _ => Err("must be a whole number of MiB, 16 or more".into()),
    }
}

/// `OUT.pm.work`.
fn work_folder(output: &Path) -> PathBuf {
    let mut name = OsString::from(output);
    name.push(".work");
    name.into()
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let start = Instant::now();
        if files::is_dash(self.ending.path()) {
            return Err(Failure::Usage(
                "a progressive terrain is written to a file, not to standard output".into(),
            ));
        }
        let out = self.ending.begin()?;
        let file = self.input.name();
        let mut warnings = Warnings::new(self.ending.quiet);
        let interrupt = Interrupt::watch();
        let report = common::in_pool(self.threads, || {
            let source = self.input.open(&mut warnings)?;
            let read = start.elapsed().as_secs_f64();
            let path = work_folder(self.ending.path());
            let in_folder = |e| Failure::Output(format!("{}: {e}", path.display()));
            let belongs = self.belongs(&source)?;
            let folder = WorkFolder::open(&path, &belongs).map_err(in_folder)?;
            interrupt.be_graceful();
            let options = Options::default()
                .with_floor(self.floor)
                .with_cells(self.block)
                .with_memory(self.memory << 20)
                .with_spacing(spacing(&source));
            let progress = Progress::new(&interrupt, self.ending.quiet, "building");
            let watch = Watch(&progress);
            let failed = |e: &BuildError| {
                // What no other run could use either.
                if matches!(e, BuildError::Nothing | BuildError::TooLarge(_)) {
                    let _ = folder.clear();
                }
                failure(&file, &out, &path, self.ending.quiet, e)
            };
            let building = Instant::now();
            let blocks =
                blocks::blocks(&*source.raster, &options, &folder, &watch).map_err(|e| failed(&e))?;
            let build = building.elapsed().as_secs_f64();
            let encoding = Instant::now();
            let coded = blocks.code().map_err(|e| failed(&e))?;
            let encode = encoding.elapsed().as_secs_f64();
            if interrupt.is_set() {
                return Err(Failure::Interrupted);
            }
            let writing = Instant::now();
            let figures = *blocks.figures();
            let terrain = terrain(&source, &figures, self.block);
            let space = Space::World { spacing: figures.spacing, exaggeration: 1.0 };
            let facts = facts(&source, space, ("terrain_error_at_full_detail", figures.error));
            let mut bytes = 0;
            files::write_with(self.ending.path(), |to| {
                bytes = write_terrain(&coded, &terrain, facts, to)?;
                Ok::<_, OnWriting>(())
            })
            .map_err(|e| failed(&e.0))?;
            let write = writing.elapsed().as_secs_f64();
            folder.remove().map_err(in_folder)?;
            Ok(Report {
                command: "terrain build",
                file: file.clone(),
                columns: terrain.columns as usize,
                rows: terrain.rows as usize,
                floor: self.floor,
                error: figures.error,
                block: self.block,
                levels: figures.levels,
                blocks: figures.blocks,
                blocks_found: figures.found,
                vertices: figures.vertices,
                triangles: figures.triangles,
                base_triangles: figures.base_triangles,
                splits: figures.splits,
                bytes: bytes as usize,
                peak_bytes: files::peak_bytes(),
                seconds: Seconds { read, build, encode, write, total: start.elapsed().as_secs_f64() },
                warnings: vec![],
            })
        })?;
        let report = Report { warnings: warnings.all, ..report };
        self.ending.report(&report, || report.text())
    }

    /// What finished blocks belong to: grid, options that change them, and this version.
    fn belongs(&self, source: &GridFile) -> Result<String, Failure> {
        Ok(format!(
            "progmesh {} terrain build, blocks 4\n{}\n{} x {}, {:?}\nfloor {:?} block {} memory {}\n",
            env!("CARGO_PKG_VERSION"),
            self.input.identity()?,
            source.raster.columns(),
            source.raster.rows(),
            spacing(source),
            self.floor,
            self.block,
            self.memory
        ))
    }
}

/// Metres from column to column and from row to row; 1 where nobody knows.
fn spacing(source: &GridFile) -> [f64; 2] {
    known_spacing(source).unwrap_or([1.0; 2])
}

fn terrain(source: &GridFile, built: &Figures, block: usize) -> Terrain {
    let (columns, rows) = (source.raster.columns(), source.raster.rows());
    Terrain {
        columns: columns as u32,
        rows: rows as u32,
        spacing: built.spacing,
        error: built.error,
        cells: block as u32,
        levels: built.levels,
    }
}

/// Why the file was not written.
struct OnWriting(BuildError);

impl From<BuildError> for OnWriting {
    fn from(e: BuildError) -> Self {
        OnWriting(e)
    }
}

impl From<std::io::Error> for OnWriting {
    fn from(e: std::io::Error) -> Self {
        OnWriting(BuildError::Write(e))
    }
}

fn failure(file: &str, out: &str, folder: &Path, quiet: bool, e: &BuildError) -> Failure {
    match e {
        BuildError::Write(e) => Failure::Output(format!("{out}: {e}")),
        BuildError::Cancelled => {
            if !quiet {
                let kept = folder.display();
                common::note(&format!(
                    "finished blocks are kept in {kept}: the same command goes on from there"
                ));
            }
            Failure::Interrupted
        }
        BuildError::Store(e) => Failure::Output(format!(
            "{}: {e}; if it stays so, remove that folder, and the work begins anew",
            folder.display()
        )),
        // Errors of reading name the file already.
        BuildError::Block(BlockError::Raster(e)) => Failure::Input(e.to_string()),
        e => Failure::Input(format!("{file}: {e}")),
    }
}

/// The progress bar, as `blocks` knows one.
struct Watch<'a>(&'a Progress<'a>);

impl tin::Control for Watch<'_> {
    fn progress(&self, done: f64) {
        progmesh::simplify::Control::progress(self.0, done);
    }

    fn cancelled(&self) -> bool {
        progmesh::simplify::Control::cancelled(self.0)
    }
}

/// The schema of `terrain build --json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    file: String,
    columns: usize,
    rows: usize,
    floor: f64,
    error: f64,
    block: usize,
    levels: u32,
    blocks: usize,
    blocks_found: usize,
    vertices: usize,
    triangles: usize,
    base_triangles: usize,
    splits: usize,
    bytes: usize,
    peak_bytes: Option<u64>,
    seconds: Seconds,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    build: f64,
    encode: f64,
    write: f64,
    total: f64,
}

impl Report {
    fn text(&self) -> String {
        let t = &self.seconds;
        let found = match self.blocks_found {
            0 => String::new(),
            n => format!(" ({} of them found done)", thousands(n)),
        };
        format!(
            "{}: {} x {} samples in {} blocks{found} -> base of {} triangles and {} splits to {}, error {}; {} bytes, {:.3} s (read {:.3}, build {:.3}, encode {:.3}, write {:.3})",
            self.file,
            thousands(self.columns),
            thousands(self.rows),
            thousands(self.blocks),
            thousands(self.base_triangles),
            thousands(self.splits),
            thousands(self.triangles),
            short(self.error),
            thousands(self.bytes),
            t.total,
            t.read,
            t.build,
            t.encode,
            t.write
        )
    }
}
