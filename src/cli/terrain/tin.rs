//! `progmesh terrain tin GRID OUT`.

use super::breaklines::{BreaklineArgs, Breaklines, Step};
use super::dress::DressArgs;
use super::facts::facts;
use super::input::{GridInput, known_spacing, whole};
use super::tiles::{self, Job, TileFormat};
use super::tin_report::{ErrorReport, OutlineReport, Report, Seconds, Verified};
use crate::cli::Failure;
use crate::cli::args::{self, Output};
use crate::cli::common::{self, Warnings, thousands};
use crate::cli::control::{Interrupt, Progress};
use crate::cli::picture::PictureArgs;
use clap::ValueEnum;
use progmesh::ground::{self, Dress, Globe, Space};
use progmesh::io::Format;
use progmesh::io::grid::GridFile;
use progmesh::simplify::Control;
use progmesh::terrain::tin::{self, Contract, Made, Method, Options, TinError, Verdict};
use progmesh::terrain::{Grid, fill_voids};
use std::time::Instant;

/// Make few triangles of a height grid, none of its samples farther from them than an error.
///
/// The error is vertical, in the grid's units, and holds at the samples (--error surface: between them too), exactly, for the coordinates as they are written: every valid sample is looked at, in
/// integers. Voids stay open: the surface is that of the grid triangles of three valid samples, with the same outline (or a simpler one:
/// --outline-tolerance). Vertices lie at samples; their heights are free within the error, unless --on-samples keeps them.
#[derive(clap::Args, Debug)]
#[command(group(clap::ArgGroup::new("target").args(["max_error", "triangles"]).required(true).multiple(true)), after_help = "\
Examples:
  progmesh terrain tin alps.tif alps.ply --max-error 5
  progmesh terrain tin N57E011.hgt coast.glb --max-error 10 --exaggeration 2 --png coast.png
  progmesh terrain tin alps.tif alps.obj --triangles 50000 --json
  progmesh terrain tin alps.tif alps.ply --max-error 5 --method greedy --verify
  progmesh terrain tin alps.tif alps.glb --max-error 5 --texture orthophoto.jpg
  progmesh terrain tin alps.tif alps.ply --max-error 5 --fill --breaklines roads.geojson
  progmesh terrain tin N57E011.hgt coast.ply --max-error 10 --outline-tolerance 1 --verify
  progmesh terrain tin alps.tif tiles --max-error 5 --tiles 8
  progmesh terrain tin alps.tif terrain --max-error 5 --tiles 8 --tile-format quantized-mesh
  progmesh terrain tin dem.raw dem.stl --size 1025x1025 --type u16 --max-error 3 --on-samples

Exit code 1 means: done and written, but the outline takes more triangles than asked for, or --verify found a fault.")]
pub(crate) struct Args {
    #[command(flatten)]
    input: GridInput,
    #[command(flatten)]
    output: Output,

    /// The farthest that a sample may lie above or below the surface, in the grid's units
    #[arg(long, value_name = "E", value_parser = args::not_negative, allow_negative_numbers = true,
          help_heading = "Target")]
    max_error: Option<f64>,
    /// Where the error holds
    #[arg(long, value_enum, default_value_t = ContractName::Samples, help_heading = "Target")]
    error: ContractName,
    /// At most this many triangles, with about the least error; with --max-error, where that would take more
    #[arg(long, value_name = "N", value_parser = args::positive, allow_negative_numbers = true,
          help_heading = "Target")]
    triangles: Option<usize>,
    /// How to make them
    #[arg(long, value_enum, default_value_t = MethodName::Best, help_heading = "Method")]
    method: MethodName,
    /// best: keep vertices at the heights of their samples, as the other methods do
    #[arg(long, help_heading = "Method")]
    on_samples: bool,
    /// Check the result by separate, plain code: error, coverage, voids, orientation
    #[arg(long, help_heading = "Method")]
    verify: bool,

    /// Where vertices stand [default: world for GLB and glTF, grid otherwise]
    #[arg(long, value_enum, help_heading = "Space")]
    space: Option<SpaceName>,
    /// world: lengths of a step by a column and by a row [default: the grid's, in metres; 1,1 if unknown]
    #[arg(long, value_name = "X,Y", value_parser = spacing, allow_negative_numbers = true, help_heading = "Space")]
    spacing: Option<[f64; 2]>,
    /// world: multiply heights by this [default: 1]
    #[arg(long, value_name = "F", value_parser = factor, allow_negative_numbers = true, help_heading = "Space")]
    exaggeration: Option<f64>,

    /// Fill voids that do not reach the border of the grid from their rims, as a membrane stretched over them: invented heights
    #[arg(long, help_heading = "Voids")]
    fill: bool,

    /// Simplify the outline of what is valid: by up to T samples (steps of the grid) on either side, without covering a void sample
    ///
    /// Valid samples beside the outline may end up outside of it; they are counted (--json: outline.dropped). The error holds for all that are covered. What
    /// lies on the border of the grid stays. About 1 makes shores straight that voids cut into steps. With --method best or greedy and --error samples.
    #[arg(long, value_name = "T", value_parser = args::not_negative, allow_negative_numbers = true,
          conflicts_with = "tiles", help_heading = "Voids")]
    outline_tolerance: Option<f64>,

    #[command(flatten)]
    breaklines: BreaklineArgs,

    /// Write a directory OUT of N x N tiles, whose borders are the same from both sides to the bit, and of all levels above, each with a
    /// quarter of the tiles and twice the error
    ///
    /// Quantized-mesh tiles lie where the geodetic scheme has them: about N along the longer side.
    #[arg(long, value_name = "N", value_parser = args::positive, allow_negative_numbers = true,
          requires = "max_error", conflicts_with = "triangles", help_heading = "Tiles")]
    tiles: Option<usize>,
    /// What tiles are written as
    #[arg(long, value_enum, default_value_t = TileFormat::Tileset, requires = "tiles", help_heading = "Tiles")]
    tile_format: TileFormat,

    #[command(flatten)]
    dress: DressArgs,
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
    /// Greedy insertion, then heights moved, sides swapped, vertices taken away
    Best,
    /// Delaunay, the farthest sample next (Garland & Heckbert): as hmm and Delatin
    Greedy,
    /// Vertices taken from the full grid, cheapest first: slow
    Decimation,
    /// Every k-th row and column
    Regular,
}

impl MethodName {
    fn method(self) -> Method {
        match self {
            MethodName::Best => Method::Best,
            MethodName::Greedy => Method::Greedy,
            MethodName::Decimation => Method::Decimation,
            MethodName::Regular => Method::Regular,
        }
    }

    fn name(self) -> &'static str {
        match self {
            MethodName::Best => "best",
            MethodName::Greedy => "greedy",
            MethodName::Decimation => "decimation",
            MethodName::Regular => "regular",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ContractName {
    /// At every valid sample
    Samples,
    /// Between samples too, against the grid's own triangles (diagonals from x, y to x + 1, y + 1)
    Surface,
}

impl ContractName {
    fn contract(self) -> Contract {
        match self {
            ContractName::Samples => Contract::Samples,
            ContractName::Surface => Contract::Surface,
        }
    }

    fn name(self) -> &'static str {
        match self {
            ContractName::Samples => "samples",
            ContractName::Surface => "surface",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SpaceName {
    /// x = column, y = row, z = height
    Grid,
    /// Metres, y up, the middle of the grid at the origin
    World,
}

/// `30,30.5`.
fn spacing(text: &str) -> Result<[f64; 2], String> {
    let (x, y) = text.split_once(',').unwrap_or((text, text));
    Ok([factor(x)?, factor(y)?])
}

/// A finite number above 0.
fn factor(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("must be a number above 0".into()),
    }
}

/// The height range is at most this part of the longer side in a picture of a grid whose spacing nobody knows.
const PICTURE_RELIEF: f64 = 0.12;

/// Without an error to keep, breaklines stay within this part of the range of heights of the ground.
const LINE_SHARE: f64 = 0.005;

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let start = Instant::now();
        self.output.leave_room_for(self.json)?;
        let mut warnings = Warnings::new(self.quiet);
        let interrupt = Interrupt::watch();
        let report = match self.tiles {
            Some(across) => self.tile(start, across, &interrupt, &mut warnings)?,
            None => self.one(start, &interrupt, &mut warnings)?,
        };
        let report = Report { warnings: warnings.all, ..report };
        if !self.quiet {
            common::note(&report.text());
        }
        if self.json {
            common::print_json(&report)?;
        }
        self.judge(&report)
    }

    /// One network.
    fn one(&self, start: Instant, interrupt: &Interrupt, warnings: &mut Warnings) -> Result<Report, Failure> {
        let format = self.output.format(warnings)?;
        let mut drawing = self.picture.drawing()?;
        let known = matches!(self.method, MethodName::Best | MethodName::Greedy);
        if self.breaklines.are_given() && (!known || self.error == ContractName::Surface) {
            return Err(Failure::Usage(
                "--breaklines goes with --method best or greedy and --error samples".into(),
            ));
        }
        if self.outline_tolerance.is_some() && (!known || self.error == ContractName::Surface) {
            return Err(Failure::Usage(
                "--outline-tolerance goes with --method best or greedy and --error samples: along a simpler outline no vertex can mend the error between samples"
                    .into(),
            ));
        }
        let file = self.input.name();
        common::in_pool(self.threads, || {
            let source = self.input.open(warnings)?;
            let space = self.space(format, &source, warnings)?;
            let dress = self.dress.dress(space, &source)?;
            let grid = whole(&file, &source)?;
            let (grid, filled) = self.filled(&file, grid, warnings);
            let read = start.elapsed().as_secs_f64();
            interrupt.be_graceful();
            let making = Instant::now();
            let (lines, mut breaklines) = self.breaklines.steps(&source, None, warnings)?;
            let lines = self.draped(&grid, &lines, breaklines.as_mut());
            let options = self.options().with_breaklines(lines);
            let progress = Progress::new(interrupt, self.quiet, "triangulating");
            let made =
                tin::triangulate(&grid, &options, &Watch(&progress)).map_err(|e| failure(&file, &e))?;
            drop(progress);
            let make = making.elapsed().as_secs_f64();
            warnings.say(isolated_samples(made.isolated).map(|w| format!("{file}: {w}")));
            let outline =
                made.outline.map(|o| OutlineReport::of(&o, self.outline_tolerance.unwrap_or_default()));
            let dropped = outline.as_ref().and_then(OutlineReport::warning);
            warnings.say(dropped.map(|w| format!("{file}: {w}")));
            let verifying = Instant::now();
            let most = self.max_error.unwrap_or(f64::INFINITY);
            let verdict = self.verify.then(|| match &outline {
                Some(o) => tin::verify_outline(&grid, &made.tin, most, o.tolerance),
                None => tin::verify(&grid, &made.tin, most, self.error.contract()),
            });
            if let Some(b) = &mut breaklines {
                (b.bent, b.outside) = (made.bent, made.outside);
                b.missing = self.verify.then(|| tin::lines_missing(&made.tin, &options.breaklines));
                warnings.say(bent(b).map(|w| format!("{file}: {w}")));
            }
            let verify = verifying.elapsed().as_secs_f64();
            if interrupt.is_set() {
                return Err(Failure::Interrupted);
            }
            let writing = Instant::now();
            let mut scene = ground::scene(&made.tin, &grid, space, &dress, "terrain");
            scene.facts = facts(&source, space, ("terrain_error", made.errors.max));
            // What was proven is what any reader gets.
            self.output.write_with(format, &scene, |o| o.all_digits = true, interrupt, warnings)?;
            let write = writing.elapsed().as_secs_f64();
            if let Some(d) = &mut drawing {
                let (space, dress) =
                    (picture_space(&source, &grid, space), Dress { normals: true, ..Dress::default() });
                let shown = ground::scene(&made.tin, &grid, space, &dress, "terrain");
                d.add(&shown)?;
                d.write()?;
            }
            let draw = drawing.as_ref().map_or(0.0, |d| d.seconds);
            let total = start.elapsed().as_secs_f64();
            let seconds = Seconds { read, make, verify, write, draw, total };
            let report = self.report(&file, &grid, space, &made, verdict.as_ref(), seconds);
            Ok(Report { filled, breaklines, outline, ..report })
        })
    }

    /// Tiles.
    fn tile(
        &self,
        start: Instant,
        across: usize,
        interrupt: &Interrupt,
        warnings: &mut Warnings,
    ) -> Result<Report, Failure> {
        let target = self.output.directory()?;
        if self.picture.drawing()?.is_some() {
            return Err(Failure::Usage("--png draws one network: leave out --tiles".into()));
        }
        if self.space == Some(SpaceName::Grid) {
            return Err(Failure::Usage("tiles stand in the world: leave out --space grid".into()));
        }
        if !matches!(self.method, MethodName::Best | MethodName::Greedy) {
            return Err(Failure::Usage("--tiles goes with --method best or greedy".into()));
        }
        if self.tile_format == TileFormat::QuantizedMesh && (self.spacing.is_some() || self.dress.drapes()) {
            return Err(Failure::Usage(
                "quantized-mesh tiles lie on the globe, and clients lay pictures over them: leave out --spacing, --uv and --texture"
                    .into(),
            ));
        }
        let file = self.input.name();
        common::in_pool(self.threads, || {
            let source = self.input.open(warnings)?;
            let globe = tiles::is_geographic(&source)
                && self.spacing.is_none()
                && self.tile_format != TileFormat::Glb;
            let flat = match globe {
                // Lengths of steps are not asked for there.
                true => Space::World { spacing: [1.0; 2], exaggeration: self.exaggeration.unwrap_or(1.0) },
                false => self.space(Format::Glb, &source, warnings)?,
            };
            let dress = self.dress.dress(flat, &source)?;
            let grid = whole(&file, &source)?;
            let steps = grid.columns().max(grid.rows()) - 1;
            if across > steps.max(1) {
                return Err(Failure::Usage(format!(
                    "--tiles {across}: {file} has but {} steps from sample to sample along its longer side",
                    thousands(steps)
                )));
            }
            let (grid, filled) = self.filled(&file, grid, warnings);
            let space = match (source.georeference.transform, flat) {
                (Some(transform), Space::World { exaggeration, .. }) if globe => {
                    Space::Globe(Globe::new(&grid, transform, exaggeration))
                }
                _ => flat,
            };
            let read = start.elapsed().as_secs_f64();
            interrupt.be_graceful();
            let making = Instant::now();
            let error = self.max_error.unwrap_or_default();
            let geodetic = match self.tile_format {
                TileFormat::QuantizedMesh => Some(tiles::geodetic(&file, &source, &grid, across, warnings)?),
                _ => None,
            };
            let (lines, mut breaklines) = self.breaklines.steps(&source, geodetic.as_ref(), warnings)?;
            let ground = geodetic.as_ref().map_or(&grid, |g| &g.grid);
            let lines = self.draped(ground, &lines, breaklines.as_mut());
            let job = Job {
                file: &file,
                source: &source,
                space,
                dress: &dress,
                facts: facts(&source, space, ("terrain_error", error)),
                options: self.options().with_breaklines(lines),
                error,
                format: self.tile_format,
                geodetic: geodetic.as_ref(),
                verify: self.verify,
            };
            let outcome = job.run(&grid, across, &target, (interrupt, self.quiet), warnings)?;
            let make = making.elapsed().as_secs_f64();
            if let Some(b) = &mut breaklines {
                (b.bent, b.outside, b.missing) =
                    (outcome.lines.bent, outcome.lines.outside, outcome.lines.missing);
                warnings.say(bent(b).map(|w| format!("{file}: {w}")));
            }
            let [valid, isolated] = outcome.valid_and_isolated;
            warnings.say(isolated_samples(isolated).map(|w| format!("{file}: {w}")));
            let total = start.elapsed().as_secs_f64();
            let seconds = Seconds { read, make, verify: 0.0, write: 0.0, draw: 0.0, total };
            let mut made = Made::default();
            (made.errors, made.valid, made.isolated) = (outcome.errors, valid, isolated);
            made.grid_triangles = outcome.grid_triangles;
            let report = self.report(&file, &grid, space, &made, outcome.verdict.as_ref(), seconds);

            let (triangles, vertices) = (outcome.triangles, outcome.vertices);
            Ok(Report { filled, breaklines, triangles, vertices, tiles: Some(outcome.tiles), ..report })
        })
    }

    /// With `--fill` the grid without its inner voids, and how many samples that were.
    fn filled(&self, file: &str, grid: Grid, warnings: &mut Warnings) -> (Grid, Option<usize>) {
        if !self.fill {
            return (grid, None);
        }
        let (grid, filled) = fill_voids(&grid);
        warnings.say((filled.samples > 0).then(|| {
            let (samples, voids) = (thousands(filled.samples), thousands(filled.voids));
            format!("{file}: {samples} void samples ({voids} voids) were filled from their rims: these heights are invented")
        }));
        (grid, Some(filled.samples))
    }

    /// Breaklines in pieces that stay near the ground.
    fn draped(&self, grid: &Grid, lines: &[Step], facts: Option<&mut Breaklines>) -> Vec<Step> {
        let range = grid.range().map_or(0.0, |(least, greatest)| greatest - least);
        let lines = tin::drape(grid, lines, self.max_error.unwrap_or(range * LINE_SHARE));
        if let Some(facts) = facts {
            facts.steps = lines.len();
        }
        lines
    }

    fn options(&self) -> Options {
        let mut options = Options::default()
            .with_method(self.method.method())
            .with_on_samples(self.on_samples)
            .with_contract(self.error.contract());
        (options.max_error, options.triangles) = (self.max_error, self.triangles);
        options.outline_tolerance = self.outline_tolerance;
        options
    }

    /// Where vertices stand.
    fn space(&self, format: Format, source: &GridFile, warnings: &mut Warnings) -> Result<Space, Failure> {
        let usual = match format {
            Format::Glb | Format::Gltf => SpaceName::World,
            _ => SpaceName::Grid,
        };
        if self.space.unwrap_or(usual) == SpaceName::Grid {
            if self.spacing.is_some() || self.exaggeration.is_some() {
                return Err(Failure::Usage(
                    "--spacing and --exaggeration are for --space world; in grid space x is the column, y the row, z the height"
                        .into(),
                ));
            }
            return Ok(Space::Grid);
        }
        let spacing = match self.spacing.or_else(|| known_spacing(source)) {
            Some(spacing) => spacing,
            None => {
                let unknown = "the lengths of its steps are not known: 1 by 1 was taken; --spacing says them";
                warnings.say([format!("{}: {unknown}", self.input.name())]);
                [1.0, 1.0]
            }
        };
        Ok(Space::World { spacing, exaggeration: self.exaggeration.unwrap_or(1.0) })
    }

    fn report(
        &self,
        file: &str,
        grid: &Grid,
        space: Space,
        made: &Made,
        verdict: Option<&Verdict>,
        seconds: Seconds,
    ) -> Report {
        let (space, spacing, exaggeration) = match space {
            Space::World { spacing, exaggeration } => ("world", Some(spacing), Some(exaggeration)),
            Space::Globe(globe) => ("globe", None, Some(globe.exaggeration())),
            Space::Grid => ("grid", None, None),
        };
        Report {
            command: "terrain tin",
            file: file.into(),
            columns: grid.columns(),
            rows: grid.rows(),
            valid: made.valid,
            isolated: made.isolated,
            grid_triangles: made.grid_triangles,
            method: self.method.name(),
            on_samples: self.on_samples || self.method != MethodName::Best,
            max_error: self.max_error,
            contract: self.error.name(),
            max_triangles: self.triangles,
            triangles: made.tin.triangles.len(),
            vertices: made.tin.points.len(),
            error: ErrorReport { max: made.errors.max, rms: made.errors.rms, surface: made.errors.surface },
            step: made.step,
            verified: verdict.map(|v| Verified::of(v, self.error.contract())),
            tiles: None,
            filled: None,
            outline: None,
            breaklines: None,
            space,
            spacing,
            exaggeration,
            seconds,
            warnings: vec![],
        }
    }

    /// Whether all that was asked for was done.
    fn judge(&self, report: &Report) -> Result<(), Failure> {
        let apart = report.tiles.as_ref().and_then(|t| t.border_mismatches).is_some_and(|n| n > 0);
        let astray = report.breaklines.as_ref().is_some_and(|b| b.missing > Some(b.bent + b.outside));
        if apart || astray || report.verified.as_ref().is_some_and(|v| !v.good) {
            return Err(Failure::Missed(format!("{}: the check found a fault; this is a bug", report.file)));
        }
        match self.triangles {
            Some(most) if report.triangles > most => Err(Failure::Missed(format!(
                "{}: the outline alone takes {} triangles, more than the {} asked for",
                report.file,
                thousands(report.triangles),
                thousands(most)
            ))),
            _ => Ok(()),
        }
    }
}

/// How a picture shows it: with y up, and heights that show where no spacing is known.
fn picture_space(source: &GridFile, grid: &Grid, space: Space) -> Space {
    if let Space::World { .. } = space {
        return space;
    }
    if let Some(spacing) = known_spacing(source) {
        return Space::World { spacing, exaggeration: 1.0 };
    }
    let side = grid.columns().max(grid.rows()) as f64;
    let range = grid.range().map_or(0.0, |(least, greatest)| greatest - least);
    let exaggeration = if range > 0.0 { (PICTURE_RELIEF * side / range).max(f64::MIN_POSITIVE) } else { 1.0 };
    Space::World { spacing: [1.0, 1.0], exaggeration }
}

fn bent(b: &Breaklines) -> Option<String> {
    (b.bent + b.outside > 0).then(|| {
        format!(
            "breaklines: {} pieces were led over the nearest sample where lines cross each other or borders of tiles, or voids begin, {} left out where \
             nothing is valid",
            thousands(b.bent),
            thousands(b.outside)
        )
    })
}

fn isolated_samples(count: usize) -> Option<String> {
    (count > 0).then(|| {
        let samples = if count == 1 { "sample has" } else { "samples have" };
        format!(
            "{} valid {samples} no two valid neighbours to make a triangle with: left out",
            thousands(count)
        )
    })
}

pub(super) fn failure(file: &str, e: &TinError) -> Failure {
    match e {
        TinError::Cancelled => Failure::Interrupted,
        TinError::TooFine { .. } => Failure::Input(format!("{file}: {e} (--nodata)")),
        e => Failure::Input(format!("{file}: {e}")),
    }
}

/// The progress bar, as `terrain` knows one.
pub(super) struct Watch<'a>(pub(super) &'a Progress<'a>);

impl tin::Control for Watch<'_> {
    fn progress(&self, done: f64) {
        self.0.progress(done);
    }

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spacings_are_one_number_or_two() {
        assert_eq!(spacing("30"), Ok([30.0, 30.0]));
        assert_eq!(spacing("30, 20.5"), Ok([30.0, 20.5]));
        for bad in ["", "0", "1,-1", "nan", "1,2,3", "inf"] {
            assert!(spacing(bad).is_err(), "{bad}");
        }
    }
}
