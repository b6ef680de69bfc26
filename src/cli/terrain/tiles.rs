//! `progmesh terrain tin GRID DIRECTORY --tiles N`.

use super::tile_report::{Level, Tiles};
use super::tin::{Watch, failure};
use crate::cli::Failure;
use crate::cli::common::Warnings;
use crate::cli::control::{Interrupt, Progress};
use clap::ValueEnum;
use progmesh::ground::{self, Dress, Globe, Space};
use progmesh::io::files::StagedDirectory;
use progmesh::io::grid::GridFile;
use progmesh::io::tileset::{self, Tile};
use progmesh::io::{EncodeOptions, Format, encode, quantized_mesh};
use progmesh::terrain::tin::{self, Borders, Contract, Control, Cuts, Errors, Options, Tiling, Tin, Verdict};
use progmesh::terrain::{Affine, CrsKind, Geodetic, Grid, Window};
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Vertices are spread so that sides from one to the next lie this part of the error, and of an error of so many metres at least, below the curve of
/// the Earth. Where vertices between them are taken away, sides may be twice as long, and lie four times as far below.
const SAG: f64 = 0.125;
const LEAST_SAG: f64 = 0.1;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum TileFormat {
    /// 3D Tiles 1.1: tileset.json and GLB; on the globe if the grid is in degrees
    #[value(name = "3d-tiles")]
    Tileset,
    /// GLB and a list of them, tiles.json
    Glb,
    /// quantized-mesh 1.0 and layer.json, for grids in degrees
    QuantizedMesh,
}

impl TileFormat {
    pub(super) fn name(self) -> &'static str {
        match self {
            TileFormat::Tileset => "3d-tiles",
            TileFormat::Glb => "glb",
            TileFormat::QuantizedMesh => "quantized-mesh",
        }
    }
}

/// What to make.
pub(super) struct Job<'a> {
    pub file: &'a str,
    pub source: &'a GridFile,
    pub space: Space,
    pub dress: &'a Dress,
    pub facts: Map<String, Value>,
    pub options: Options,
    /// At the finest level; it doubles from level to level.
    pub error: f64,
    pub format: TileFormat,
    /// Of quantized-mesh: what tiles are made of in place of the grid.
    pub geodetic: Option<&'a Geodetic>,
    pub verify: bool,
}

/// What came of it.
pub(super) struct Outcome {
    pub tiles: Tiles,
    /// Of the finest level.
    pub errors: Errors,
    pub triangles: usize,
    pub vertices: usize,
    pub valid_and_isolated: [usize; 2],
    pub grid_triangles: usize,
    pub verdict: Option<Verdict>,
    /// What became of the breaklines at the finest level.
    pub lines: Lines,
}

/// Pieces of breaklines, as [`tin::Made`] counts them, and lines that no sides follow, if that was checked.
#[derive(Clone, Copy, Default)]
pub(super) struct Lines {
    pub bent: usize,
    pub outside: usize,
    pub missing: Option<usize>,
}

/// A level to make: its number from the coarsest, its cuts, its error.
struct Plan {
    z: u32,
    cuts: Cuts,
    error: f64,
}

/// What is known of a tile that was made.
struct Done {
    key: [usize; 2],
    window: Window,
    bounds: [[f64; 3]; 2],
    errors: Errors,
    /// Samples covered.
    covered: usize,
    triangles: usize,
    vertices: usize,
    bytes: usize,
    sag: f64,
    verdict: Option<Verdict>,
    /// For the checks of borders and breaklines.
    tin: Option<Tin>,
    bent: usize,
    outside: usize,
    warnings: Vec<String>,
}

/// Whether a grid's coordinates are degrees.
pub(super) fn is_geographic(source: &GridFile) -> bool {
    source.georeference.crs.as_ref().is_some_and(|c| c.kind == CrsKind::Geographic)
}

/// A grid of degrees on the lattice of the globe's tiles.
pub(super) fn geodetic(
    file: &str,
    source: &GridFile,
    grid: &Grid,
    across: usize,
    warnings: &mut Warnings,
) -> Result<Geodetic, Failure> {
    let unfit = |why: String| {
        let advice =
            "quantized-mesh tiles lie on the globe (EPSG:4326); --tile-format 3d-tiles and glb take any grid";
        Failure::Input(format!("{file}: {why}; {advice}"))
    };
    let transform = source.georeference.transform.filter(|_| is_geographic(source));
    let transform = transform.ok_or_else(|| unfit("the grid is not in degrees".into()))?;
    let made = Geodetic::new(grid, transform, across).map_err(|e| unfit(e.to_string()))?;
    if !made.exact {
        let [columns, rows] = [made.grid.columns(), made.grid.rows()];
        warnings.say([format!(
            "{file}: tiles of the globe have borders between samples: {columns} x {rows} heights were interpolated, and the error holds at these"
        )]);
    }
    Ok(made)
}

impl Job<'_> {
    /// Makes all tiles of all levels and writes them to `target`, a directory that appears whole. `across` tiles along a side at the finest level.
    pub(super) fn run(
        &self,
        grid: &Grid,
        across: usize,
        target: &Path,
        (interrupt, quiet): (&Interrupt, bool),
        warnings: &mut Warnings,
    ) -> Result<Outcome, Failure> {
        let geodetic = self.geodetic;
        let (grid, space) = match geodetic {
            None => (grid, self.space),
            Some(g) => {
                let exaggeration = match self.space {
                    Space::World { exaggeration, .. } => exaggeration,
                    _ => 1.0,
                };
                (&g.grid, Space::Globe(Globe::new(&g.grid, g.transform(), exaggeration)))
            }
        };
        let range = grid.range().map_or(0.0, |(least, greatest)| greatest - least);
        let plans = plans(grid, geodetic, across, self.error, range);
        let coarsest = plans.iter().map(|p| p.error).fold(0.0, f64::max);
        let tiling = Tiling::new(grid, &self.options, coarsest).map_err(|e| failure(self.file, &e))?;
        let unwritten = |e: io::Error| Failure::Output(format!("{}: {e}", target.display()));
        let staged = StagedDirectory::new(target).map_err(unwritten)?;
        let progress = Progress::new(interrupt, quiet, "tiling");
        let count: usize = plans.iter().map(|p| p.cuts.tiles().iter().product::<usize>()).sum();
        let work = Work {
            job: self,
            grid,
            space,
            tiling: &tiling,
            geodetic,
            staged: &staged,
            watch: Watch(&progress),
            finished: AtomicUsize::new(0),
            count,
        };
        let mut levels = vec![];
        let mut all = vec![];
        let mut lines = Lines::default();
        for plan in &plans {
            let (done, bent) = work.level(plan).map_err(|e| match e {
                Stop::Tin(e) => failure(self.file, &e),
                Stop::Io(e) => unwritten(e),
                Stop::Encode(e) => Failure::Output(format!("{}: {e}", target.display())),
            })?;
            warnings.say(done.iter().flat_map(|d| &d.warnings).map(|w| format!("{}: {w}", target.display())));
            let mut borders = Borders::default();
            for d in &done {
                if let Some(tin) = &d.tin {
                    borders.add(tin, d.window);
                }
            }
            let between = self.options.contract == Contract::Surface;
            let step = geodetic.map(|_| quantized_mesh::height_step(work.heights(plan.error)));
            levels.push(level_report(plan, &done, (self.verify.then_some(&borders), between), step));
            lines.bent = bent + done.iter().map(|d| d.bent).sum::<usize>();
            lines.outside = done.iter().map(|d| d.outside).sum();
            all.push(done);
        }
        drop(progress);
        let finest = all.last().map_or(&[][..], Vec::as_slice);
        let verdict = self.verify.then(|| sum(all.iter().flatten().filter_map(|d| d.verdict)));
        lines.missing = self.verify.then(|| missing(finest, &self.options.breaklines));
        let outcome = Outcome {
            lines,
            tiles: Tiles {
                format: self.format.name(),
                directory: target.display().to_string(),
                border_mismatches: self
                    .verify
                    .then(|| levels.iter().filter_map(|l| l.border_mismatches).sum()),
                resampled: geodetic.is_some_and(|g| !g.exact),
                levels,
            },
            errors: overall(finest),
            triangles: finest.iter().map(|d| d.triangles).sum(),
            vertices: finest.iter().map(|d| d.vertices).sum(),
            valid_and_isolated: tiling.valid_and_isolated(),
            grid_triangles: tiling.grid_triangles(),
            verdict,
        };
        let index = self.index(&plans, &all, geodetic, grid, space);
        let (name, value) = index;
        let text = serde_json::to_vec_pretty(&value).map_err(|e| Failure::Output(e.to_string()))?;
        staged.write(name, &text).map_err(unwritten)?;
        if let Some(image) = self.dress.drape.as_ref().and_then(|d| d.image.as_ref())
            && let (Some(uri), Some(data), None) = (&image.uri, &image.data, &geodetic)
        {
            staged.write(uri, data).map_err(unwritten)?;
        }
        if interrupt.is_set() {
            return Err(Failure::Interrupted);
        }
        staged.publish().map_err(unwritten)?;
        Ok(outcome)
    }

    /// The file that lists the tiles.
    fn index(
        &self,
        plans: &[Plan],
        all: &[Vec<Done>],
        geodetic: Option<&Geodetic>,
        grid: &Grid,
        space: Space,
    ) -> (&'static str, Value) {
        let facts = self.facts.clone();
        match self.format {
            TileFormat::Tileset => {
                let mut tiles = tileset::Tiles::new();
                for (plan, done) in plans.iter().zip(all) {
                    for d in done {
                        let uri = name(plan.z, d.key, "glb");
                        let error = plan.error * exaggeration(space) + d.sag;
                        tiles.insert((plan.z, d.key), Tile { uri, bounds: d.bounds, error });
                    }
                }
                ("tileset.json", tileset::tileset(&tiles, self.transform(grid, space), facts))
            }
            TileFormat::Glb => {
                let tiles: Vec<Value> =
                    plans
                        .iter()
                        .zip(all)
                        .flat_map(|(plan, done)| {
                            done.iter().map(|d| json!({
                        "level": plan.z,
                        "tile": d.key,
                        "uri": name(plan.z, d.key, "glb"),
                        "samples": [d.window.column, d.window.row, d.window.columns, d.window.rows],
                        "bounds": d.bounds,
                        "triangles": d.triangles,
                        "error": d.errors.max,
                    }))
                        })
                        .collect();
                let levels: Vec<Value> =
                    plans.iter().map(|p| json!({"level": p.z, "max_error": p.error})).collect();
                let size = [grid.columns(), grid.rows()];
                ("tiles.json", json!({"samples": size, "facts": facts, "levels": levels, "tiles": tiles}))
            }
            TileFormat::QuantizedMesh => {
                let levels: Vec<Vec<[usize; 2]>> =
                    all.iter().map(|done| done.iter().map(|d| d.key).collect()).collect();
                let bounds = geodetic.map_or([0.0; 4], |g| {
                    let t = g.transform();
                    let [west, north] = t.apply([0.0, 0.0]);
                    let last = [grid.columns() - 1, grid.rows() - 1].map(|n| n as f64);
                    let [east, south] = t.apply(last);
                    [west, south, east, north]
                });
                let mut layer = quantized_mesh::layer(self.file, bounds, &levels);
                layer["extras"] = Value::Object(facts);
                ("layer.json", layer)
            }
        }
    }

    /// Where a tileset stands in the system of all tilesets.
    fn transform(&self, grid: &Grid, space: Space) -> Option<[f64; 16]> {
        if let Space::Globe(globe) = space {
            return Some(globe.to_earth());
        }
        // In a plane whose axes the grid follows: moved to its place, in metres.
        let place = &self.source.georeference;
        let CrsKind::Projected { metres } = place.crs.as_ref()?.kind else { return None };
        let Affine([dx, 0.0, _, 0.0, dy, _]) = place.transform? else { return None };
        if !(dx > 0.0 && dy < 0.0) {
            return None;
        }
        let [x, y] = place.transform?.apply(ground::middle(grid)).map(|c| c * metres);
        Some([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, 0.0, 1.0])
    }
}

fn exaggeration(space: Space) -> f64 {
    match space {
        Space::World { exaggeration, .. } => exaggeration,
        Space::Globe(globe) => globe.exaggeration(),
        Space::Grid => 1.0,
    }
}

/// All levels, the coarsest first. An error beyond the range of the heights is no different from the range.
fn plans(grid: &Grid, geodetic: Option<&Geodetic>, across: usize, error: f64, range: f64) -> Vec<Plan> {
    let mut cuts = vec![];
    match geodetic {
        Some(g) => cuts.extend((0..=g.level).rev().map(|z| g.cuts(z))),
        None => {
            let mut level = Cuts::even(grid.columns(), grid.rows(), across);
            while level.tiles().iter().any(|&n| n > 1) {
                let next = level.halved();
                cuts.push(std::mem::replace(&mut level, next));
            }
            cuts.push(level);
        }
    }
    let most = range.max(error);
    let last = cuts.len() - 1;
    let plan = |(i, cuts): (usize, Cuts)| {
        let error = (error * 2f64.powi(i.min(1000) as i32)).min(most);
        Plan { z: (last - i) as u32, cuts, error }
    };
    let mut plans: Vec<Plan> = cuts.into_iter().enumerate().map(plan).collect();
    plans.reverse();
    plans
}

fn name(z: u32, [x, y]: [usize; 2], extension: &str) -> String {
    format!("{z}/{x}/{y}.{extension}")
}

/// Why there are no tiles.
enum Stop {
    Tin(tin::TinError),
    Io(io::Error),
    Encode(progmesh::io::EncodeError),
}

struct Work<'a> {
    job: &'a Job<'a>,
    grid: &'a Grid,
    space: Space,
    tiling: &'a Tiling<'a>,
    geodetic: Option<&'a Geodetic>,
    staged: &'a StagedDirectory,
    watch: Watch<'a>,
    finished: AtomicUsize,
    count: usize,
}

impl Work<'_> {
    /// Makes and writes the tiles of a level, in the order of their rows and columns; and how often that led breaklines over samples of borders.
    fn level(&self, plan: &Plan) -> Result<(Vec<Done>, usize), Stop> {
        let cuts = plan.cuts.clone();
        let level = match self.space {
            Space::Globe(globe) => {
                // Flat triangles shall not lie much farther below the curve of the Earth than the error.
                let most = Globe::longest(plan.error.max(LEAST_SAG) * exaggeration(self.space) * SAG);
                let spread = most / (globe.step() * std::f64::consts::SQRT_2);
                self.tiling.level_with(cuts, plan.error, spread.clamp(1.0, 1e6) as usize)
            }
            _ => self.tiling.level(cuts, plan.error),
        };
        let level = level.map_err(Stop::Tin)?;
        let [across, down] = plan.cuts.tiles();
        let tiles: Vec<[usize; 2]> = (0..down).flat_map(|j| (0..across).map(move |i| [i, j])).collect();
        let made = tiles.into_par_iter().map(|tile| {
            let done = self.tile(plan, &level, tile);
            let finished = self.finished.fetch_add(1, Ordering::Relaxed) + 1;
            self.watch.progress(finished as f64 / self.count.max(1) as f64);
            done
        });
        let made: Result<Vec<Option<Done>>, Stop> = made.collect();
        Ok((made?.into_iter().flatten().collect(), level.bent()))
    }

    fn tile(&self, plan: &Plan, level: &tin::Level<'_>, tile: [usize; 2]) -> Result<Option<Done>, Stop> {
        /// Passes on who wants to stop; the progress is that of all tiles.
        struct Quietly<'a>(&'a Watch<'a>);
        impl Control for Quietly<'_> {
            fn cancelled(&self) -> bool {
                self.0.cancelled()
            }
        }
        let Some(made) = level.tile(tile, &Quietly(&self.watch)).map_err(Stop::Tin)? else { return Ok(None) };
        let window = plan.cuts.window(tile);
        let key = self.geodetic.map_or(tile, |g| g.tile_of(plan.z, [window.column, window.row]));
        let places = self.space.places(self.grid, &made.tin);
        let (bytes, warnings) = match self.geodetic {
            Some(g) => (quantized_mesh::encode(&self.quantized(g, plan, key, &made.tin)), vec![]),
            None => {
                let mut dress = self.job.dress.clone();
                // One picture for all.
                if let Some(image) = dress.drape.as_mut().and_then(|d| d.image.as_mut()) {
                    image.uri = image.uri.as_ref().map(|uri| format!("../../{uri}"));
                    image.data = None;
                }
                let scene = ground::tile_scene(&made.tin, self.grid, self.space, &dress, "terrain");
                let mut options = EncodeOptions::default();
                options.link_images = true;
                let encoded = encode(Format::Glb, &scene, &options).map_err(Stop::Encode)?;
                (encoded.bytes, encoded.warnings)
            }
        };
        let extension = if self.geodetic.is_some() { "terrain" } else { "glb" };
        self.staged.write(&name(plan.z, key, extension), &bytes).map_err(Stop::Io)?;
        let verdict = self
            .job
            .verify
            .then(|| verify(self.grid, window, &made.tin, (plan.error, self.job.options.contract)));
        let on_globe = matches!(self.space, Space::Globe(_));
        Ok(Some(Done {
            key,
            window,
            bounds: bounds(&places),
            errors: made.errors,
            covered: made.valid - made.isolated,
            triangles: made.tin.triangles.len(),
            vertices: made.tin.points.len(),
            bytes: bytes.len(),
            sag: if on_globe { Globe::sag(longest(&places, &made.tin)) } else { 0.0 },
            verdict,
            bent: made.bent,
            outside: made.outside,
            tin: self.job.verify.then_some(made.tin),
            warnings,
        }))
    }

    /// What heights of a level are rounded between.
    fn heights(&self, error: f64) -> [f32; 2] {
        let factor = exaggeration(self.space);
        let (least, greatest) = self.grid.range().unwrap_or_default();
        let [least, greatest] = [(least - error) * factor, (greatest + error) * factor];
        [(least as f32).next_down(), (greatest as f32).next_up()]
    }

    fn quantized(&self, g: &Geodetic, plan: &Plan, key: [usize; 2], tin: &Tin) -> quantized_mesh::Tile {
        let side = 180.0 / 2f64.powi(plan.z as i32);
        let [west, south] = [key[0] as f64 * side - 180.0, key[1] as f64 * side - 90.0];
        let vertex = |(&point, &height): (&[u32; 2], &f64)| {
            let [u, v] = g.within(plan.z, key, point);
            let normal = self.space.normal(self.grid, point);
            let normal = match self.space {
                Space::Globe(globe) => globe.direction_to_earth(normal),
                _ => normal,
            };
            quantized_mesh::Vertex { u, v, height: height * exaggeration(self.space), normal }
        };
        quantized_mesh::Tile {
            bounds: [west, south, west + side, south + side],
            heights: self.heights(plan.error),
            vertices: tin.points.iter().zip(&tin.heights).map(vertex).collect(),
            // Rows run south, so triangles turn the other way.
            triangles: tin.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
        }
    }
}

fn bounds(places: &[[f32; 3]]) -> [[f64; 3]; 2] {
    let first = places.first().copied().unwrap_or_default().map(f64::from);
    places.iter().fold([first, first], |[low, high], p| {
        let with = |pick: fn(f64, f64) -> f64, b: [f64; 3]| std::array::from_fn(|k| pick(b[k], p[k].into()));
        [with(f64::min, low), with(f64::max, high)]
    })
}

/// The longest side of a triangle.
fn longest(places: &[[f32; 3]], tin: &Tin) -> f64 {
    let sides = tin.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let length = |[a, b]: [u32; 2]| {
        let d: [f64; 3] = std::array::from_fn(|k| f64::from(places[a as usize][k] - places[b as usize][k]));
        d[0].hypot(d[1]).hypot(d[2])
    };
    sides.map(length).fold(0.0, f64::max)
}

/// The separate check, on the samples of the tile alone.
fn verify(grid: &Grid, w: Window, tin: &Tin, (error, contract): (f64, Contract)) -> Verdict {
    let row = |y: usize| &grid.heights()[y * grid.columns() + w.column..][..w.columns];
    let heights = (w.row..w.row + w.rows).flat_map(row).copied().collect();
    let mut own = tin.clone();
    own.points.iter_mut().for_each(|p| *p = [p[0] - w.column as u32, p[1] - w.row as u32]);
    match Grid::new(w.columns, w.rows, heights) {
        Ok(part) => tin::verify(&part, &own, error, contract),
        // The window lies within the grid, so this does not happen.
        Err(_) => Verdict::default(),
    }
}

/// What is wrong with any tile of any level.
fn sum(verdicts: impl Iterator<Item = Verdict>) -> Verdict {
    let mut all = Verdict::default();
    all.exact = true;
    for v in verdicts {
        all.max_error = all.max_error.max(v.max_error);
        all.surface_error = all.surface_error.max(v.surface_error);
        all.pieces_beyond += v.pieces_beyond;
        all.beyond += v.beyond;
        all.uncovered += v.uncovered;
        all.isolated += v.isolated;
        all.over_void += v.over_void;
        all.turned += v.turned;
        all.flat += v.flat;
        // Too much and too little do not make up for each other.
        all.excess_area += v.excess_area.abs();
        all.exact &= v.exact;
    }
    all
}

/// Lines that the sides of no tiles follow from end to end.
fn missing(done: &[Done], lines: &[[[u32; 2]; 2]]) -> usize {
    let mut all = Tin::default();
    for tin in done.iter().filter_map(|d| d.tin.as_ref()) {
        let first = all.points.len() as u32;
        all.points.extend(&tin.points);
        all.heights.extend(&tin.heights);
        all.triangles.extend(tin.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    tin::lines_missing(&all, lines)
}

fn overall(done: &[Done]) -> Errors {
    let mut all = Errors::default();
    let (mut squares, mut samples) = (0.0, 0usize);
    for d in done {
        all.max = all.max.max(d.errors.max);
        all.surface = all.surface.max(d.errors.surface);
        squares += d.errors.rms * d.errors.rms * d.covered as f64;
        samples += d.covered;
    }
    all.rms = (squares / samples.max(1) as f64).sqrt();
    all
}

fn level_report(
    plan: &Plan,
    done: &[Done],
    (borders, between): (Option<&Borders>, bool),
    height_step: Option<f64>,
) -> Level {
    let errors = overall(done);
    Level {
        level: plan.z,
        max_error: plan.error,
        error: if between { errors.surface } else { errors.max },
        tiles: done.len(),
        triangles: done.iter().map(|d| d.triangles).sum(),
        vertices: done.iter().map(|d| d.vertices).sum(),
        bytes: done.iter().map(|d| d.bytes).sum(),
        sag: done.iter().map(|d| d.sag).fold(0.0, f64::max),
        height_step,
        border_mismatches: borders.map(Borders::differ),
    }
}
