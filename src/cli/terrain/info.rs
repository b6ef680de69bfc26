//! `progmesh terrain info GRID`.

use super::input::{GridInput, unread};
use crate::cli::Failure;
use crate::cli::common::{self, Warnings, short, thousands};
use crate::cli::control::{Interrupt, Progress};
use crate::cli::picture::png_name;
use progmesh::io::grid::{Encoding, GridFile};
use progmesh::report::relief;
use progmesh::simplify::Control;
use progmesh::terrain::{Crs, CrsKind, Overview, SampleAt, Summary};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Pixels of the longer side of a map, at most.
const MAP: usize = 1024;

/// Say what a height grid holds: size, type, coordinate system, spacing, range, voids.
///
/// Heights are read once, window by window: a grid may be larger than memory.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh terrain info N57E011.hgt
  progmesh terrain info alps.tif --json
  progmesh terrain info dem.raw --size 1025x1025 --type u16
  progmesh terrain info N57E011.hgt N57E012.hgt --png relief.png")]
pub(crate) struct Args {
    #[command(flatten)]
    input: GridInput,
    /// Draw a map to this PNG file: colours by height, lit from the north-west; voids striped
    #[arg(long, value_name = "FILE.png", value_parser = png_name)]
    png: Option<PathBuf>,
    /// Print one JSON object (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say no warnings
    #[arg(long, short)]
    quiet: bool,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let mut warnings = Warnings::new(self.quiet);
        let grid = self.input.open(&mut warnings)?;
        if let Some(path) = &self.png {
            common::check_target(path)?;
        }
        let (columns, rows) = (grid.raster.columns(), grid.raster.rows());
        let mut overview = self.png.as_ref().map(|_| Overview::new(columns, rows, MAP));
        let interrupt = Interrupt::watch();
        let progress = Progress::new(&interrupt, self.quiet, "reading");
        let summary = Summary::of(&*grid.raster, |window, heights| {
            // Windows come row by row, and in each from left to right.
            let seen =
                window.row as f64 + (window.rows * (window.column + window.columns)) as f64 / columns as f64;
            progress.progress(seen / rows as f64);
            if let Some(o) = &mut overview {
                o.add(window, heights);
            }
            Ok(())
        });
        drop(progress);
        let summary = summary.map_err(unread)?;
        if let (Some(path), Some(overview)) = (&self.png, overview) {
            write_map(path, overview, &grid)?;
        }
        let info = Info::of(self.input.name(), &grid, &summary, warnings.all);
        if self.json {
            return common::print_json(&info);
        }
        common::print(&common::harmless(&info.text()))
    }
}

fn write_map(path: &Path, overview: Overview, grid: &GridFile) -> Result<(), Failure> {
    let place = &grid.georeference;
    let (columns, rows) = (grid.raster.columns(), grid.raster.rows());
    let spacing = place.spacing_metres(columns, rows).or(place.spacing()).unwrap_or([1.0; 2]);
    let step = overview.step() as f64;
    let bytes = relief(&overview.finish(), spacing.map(|s| s * step)).png();
    let bytes = bytes
        .ok_or_else(|| Failure::Output(format!("{}: the picture could not be encoded", path.display())))?;
    common::write_bytes(path, &bytes)
}

/// The schema of `terrain info --json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Info {
    command: &'static str,
    file: String,
    format: &'static str,
    layout: String,
    columns: usize,
    rows: usize,
    #[serde(rename = "type")]
    sample: &'static str,
    nodata: Option<f64>,
    void: u64,
    valid: u64,
    valid_share: f64,
    range: Option<[f64; 2]>,
    mean: Option<f64>,
    transform: Option<[f64; 6]>,
    sample_at: &'static str,
    spacing: Option<[f64; 2]>,
    spacing_metres: Option<[f64; 2]>,
    bounds: Option<[[f64; 2]; 2]>,
    crs: Option<CrsInfo>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct CrsInfo {
    kind: &'static str,
    name: Option<String>,
    epsg: Option<u16>,
    metres_per_unit: Option<f64>,
}

impl CrsInfo {
    fn of(crs: &Crs) -> CrsInfo {
        let (kind, metres_per_unit) = match crs.kind {
            CrsKind::Geographic => ("geographic", None),
            CrsKind::Projected { metres } => ("projected", Some(metres)),
            CrsKind::Unknown => ("unknown", None),
        };
        CrsInfo { kind, name: crs.name.clone(), epsg: crs.epsg, metres_per_unit }
    }
}

impl Info {
    fn of(file: String, grid: &GridFile, summary: &Summary, warnings: Vec<String>) -> Info {
        let (columns, rows) = (grid.raster.columns(), grid.raster.rows());
        let place = &grid.georeference;
        let bounds = place.transform.map(|t| {
            let (right, below) = ((columns - 1) as f64, (rows - 1) as f64);
            let corners = [[0.0, 0.0], [right, 0.0], [0.0, below], [right, below]].map(|c| t.apply(c));
            let ends = |pick: fn(f64, f64) -> f64| {
                [0, 1].map(|i| corners.iter().map(|c| c[i]).reduce(pick).unwrap_or_default())
            };
            [ends(f64::min), ends(f64::max)]
        });
        Info {
            command: "terrain info",
            file,
            format: grid.format.name(),
            layout: grid.layout.clone(),
            columns,
            rows,
            sample: match grid.encoding {
                Encoding::Plain => grid.sample.name(),
                Encoding::TerrainRgb | Encoding::Terrarium => "rgb8",
            },
            nodata: grid.nodata,
            void: summary.void,
            valid: summary.valid,
            valid_share: summary.valid_share(),
            range: summary.range,
            mean: (summary.valid > 0).then_some(summary.mean),
            transform: place.transform.map(|t| t.0),
            sample_at: match place.sample_at {
                SampleAt::CellCentre => "cell",
                SampleAt::Point => "point",
            },
            spacing: place.spacing(),
            spacing_metres: place.spacing_metres(columns, rows),
            bounds,
            crs: place.crs.as_ref().map(CrsInfo::of),
            warnings,
        }
    }

    fn text(&self) -> String {
        let mut out = format!("{}: {}\n\n", self.file, self.layout);
        let mut row = |name: &str, what: String| {
            let _ = writeln!(out, "  {name:<12} {what}");
        };
        let (columns, rows) = (thousands(self.columns), thousands(self.rows));
        row("size", format!("{columns} x {rows} samples, {}", self.sample));
        row(
            "heights",
            match (self.range, self.mean) {
                (Some([least, greatest]), Some(mean)) => {
                    format!("{} to {}, mean {}", number(least), number(greatest), short(mean))
                }
                _ => "none: every sample is void".into(),
            },
        );
        let share = format!("{:.2} % valid", 100.0 * self.valid_share);
        let nodata = self.nodata.map_or(String::new(), |v| format!("; {} means no data", number(v)));
        row("void", format!("{} samples, {share}{nodata}", thousands(self.void as usize)));
        if let Some(crs) = &self.crs {
            let name = crs.name.clone().unwrap_or_else(|| crs.kind.into());
            let epsg = crs.epsg.map_or(String::new(), |n| format!(", EPSG:{n}"));
            row("system", format!("{name}{epsg}"));
        } else {
            row("system", "not said".into());
        }
        if let (Some([x, y]), Some([low, high])) = (self.spacing, self.bounds) {
            let metres = self.spacing_metres.filter(|m| *m != [x, y]);
            let metres = metres
                .map_or(String::new(), |[x, y]| format!(" ({} x {} m at the middle)", short(x), short(y)));
            row("spacing", format!("{} x {}{metres}", number(x), number(y)));
            let pair = |p: [f64; 2]| format!("{} {}", number(p[0]), number(p[1]));
            row("bounds", format!("{} to {}, of the samples", pair(low), pair(high)));
        } else {
            row("spacing", "not said".into());
        }
        out
    }
}

/// A number with the digits it needs, but no more than tell.
fn number(x: f64) -> String {
    if x == 0.0 || (1e-4..1e15).contains(&x.abs()) {
        let text = format!("{x:.7}");
        return text.trim_end_matches('0').trim_end_matches('.').into();
    }
    format!("{x:e}")
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_have_the_digits_they_need() {
        let texts = [0.0, -32768.0, 1.0 / 12.0, 100.0, 1e30, 2.5e-9].map(number);
        assert_eq!(texts, ["0", "-32768", "0.0833333", "100", "1e30", "2.5e-9"]);
    }
}
