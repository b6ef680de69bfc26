//! Networks of height grids: our methods beside Delatin and Martini, each checked at every sample.

use crate::lines::{Runs, TerrainRow};
use crate::raw::Raw;
use crate::tools::{Places, output};
use anyhow::{Context, Result, bail, ensure};
use progmesh::io::files;
use progmesh::io::grid::{GridFormat, GridOptions};
use progmesh::meshes::Landscape;
use progmesh::terrain::Grid;
use progmesh::terrain::tin::{Contract, Method, Options, Quiet, Tin, triangulate, verify};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// A method of ours, or a package of Python.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tool {
    pub(crate) id: &'static str,
    pub(crate) name: &'static str,
    how: How,
}

#[derive(Clone, Copy, Debug)]
enum How {
    /// Method, vertices at the heights of samples, and whether threads make a difference.
    Ours(Method, bool, bool),
    /// Its package.
    Python(&'static str),
}

/// The default first, then the others of ours, then the peers.
pub(crate) const TOOLS: [Tool; 6] = [
    Tool { id: "best", name: "progmesh best", how: How::Ours(Method::Best, false, true) },
    Tool { id: "on-samples", name: "progmesh best, on samples", how: How::Ours(Method::Best, true, true) },
    Tool { id: "greedy", name: "progmesh greedy", how: How::Ours(Method::Greedy, false, false) },
    Tool { id: "regular", name: "progmesh regular", how: How::Ours(Method::Regular, false, true) },
    Tool { id: "delatin", name: "Delatin", how: How::Python("pydelatin") },
    Tool { id: "martini", name: "Martini", how: How::Python("pymartini") },
];

/// What Delatin is: the tool that all are compared with.
pub(crate) const REFERENCE: &str = "delatin";

/// Errors asked for, as parts of the range of the heights, unless they are named.
const PARTS: [f64; 3] = [50.0, 150.0, 500.0];
/// Samples along the side of the generated landscapes.
const SIDES: [usize; 2] = [513, 2049];

/// What to measure.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wanted {
    pub(crate) quick: bool,
    /// A folder of grids, instead of the generated ones.
    pub(crate) data: Option<PathBuf>,
    /// In the grids' units.
    pub(crate) errors: Vec<f64>,
    pub(crate) repeat: usize,
}

struct Subject {
    name: String,
    grid: Grid,
}

/// Grids by name; what cannot be opened is an error that names it.
fn subjects(wanted: &Wanted) -> Result<Vec<Subject>> {
    let Some(folder) = &wanted.data else {
        let sides = if wanted.quick { &SIDES[..1] } else { &SIDES[..] };
        let made = sides.iter().map(|&n| {
            let heights = Landscape::new(n, 1).heights();
            // As files hold them, so that all tools have the same.
            let heights = heights.into_iter().map(|h| f64::from(h as f32)).collect();
            Ok(Subject { name: format!("landscape {n}"), grid: Grid::new(n, n, heights)? })
        });
        return made.collect();
    };
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .with_context(|| folder.display().to_string())?
        .map(|e| Ok(e?.path()))
        .collect::<Result<_>>()?;
    paths.retain(|p| GridFormat::from_name(&p.to_string_lossy()).is_some_and(|f| f != GridFormat::Raw));
    paths.sort();
    ensure!(!paths.is_empty(), "{}: no height grids (.tif, .hgt, .asc, .png)", folder.display());
    let open = |path: &PathBuf| {
        let named = || path.display().to_string();
        let file = files::open_grid(path, &GridOptions::default()).with_context(named)?;
        let grid = file.raster.whole(1 << 28).with_context(named)?;
        let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(Subject { name, grid })
    };
    paths.iter().map(open).collect()
}

/// Measures everything and hands each row to `done`.
pub(crate) fn run(
    wanted: &Wanted,
    places: &Places,
    folder: &Path,
    mut done: impl FnMut(TerrainRow) -> Result<()>,
) -> Result<()> {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::fs::create_dir_all(folder)?;
    for subject in subjects(wanted)? {
        let Some((least, greatest)) = subject.grid.range() else { continue };
        let input = folder.join("grid.raw");
        std::fs::write(&input, bytes(&subject.grid))?;
        let errors = match &wanted.errors[..] {
            [] => PARTS.iter().map(|p| (greatest - least) / p).collect(),
            asked => asked.to_vec(),
        };
        for error in errors {
            let mut entries = vec![];
            for tool in TOOLS {
                let threads = match tool.how {
                    How::Ours(_, _, true) if cores > 1 => vec![1, cores],
                    _ => vec![1],
                };
                entries.extend(threads.into_iter().map(|n| Entry::new(&subject, error, tool, n)));
            }
            // In turns, so that a busy moment meets all alike.
            for _ in 0..wanted.repeat.max(1) {
                for entry in &mut entries {
                    entry.turn(&subject.grid, places, folder);
                }
            }
            for entry in entries {
                let (name, row) = (entry.tool.name, entry.finish(&subject.grid));
                let result = match &row.failed {
                    Some(why) => why.clone(),
                    None => format!("{} triangles, {:.3} s", row.triangles, row.seconds.median),
                };
                eprintln!("{}, {error:.4}, {name} ({}): {result}", row.grid, row.threads);
                done(row)?;
            }
        }
        std::fs::remove_file(&input)?;
    }
    Ok(())
}

/// A grid as the peers read it.
fn bytes(grid: &Grid) -> Vec<u8> {
    let mut out = b"PMGRID01".to_vec();
    out.extend((grid.columns() as u64).to_le_bytes());
    out.extend((grid.rows() as u64).to_le_bytes());
    out.extend(grid.heights().iter().flat_map(|&h| (h as f32).to_le_bytes()));
    out
}

/// A tool on a grid: a row to be.
struct Entry {
    tool: Tool,
    row: TerrainRow,
    seconds: Vec<f64>,
    tin: Option<Tin>,
}

impl Entry {
    fn new(subject: &Subject, error: f64, tool: Tool, threads: usize) -> Self {
        let row = TerrainRow {
            grid: subject.name.clone(),
            columns: subject.grid.columns(),
            rows: subject.grid.rows(),
            error,
            tool: tool.id.into(),
            threads,
            ..TerrainRow::default()
        };
        Entry { tool, row, seconds: vec![], tin: None }
    }

    /// Runs it once, unless it failed before.
    fn turn(&mut self, grid: &Grid, places: &Places, folder: &Path) {
        if self.row.failed.is_some() {
            return;
        }
        let (error, threads) = (self.row.error, self.row.threads);
        let made = match self.tool.how {
            How::Ours(method, on_samples, _) => {
                self.row.version = env!("CARGO_PKG_VERSION").into();
                let options =
                    Options::default().with_max_error(error).with_method(method).with_on_samples(on_samples);
                ours(grid, &options, threads)
            }
            How::Python(package) => version(places, package).and_then(|v| {
                self.row.version = v;
                peer(grid, error, &self.tool, places, folder)
            }),
        };
        match made {
            Ok((tin, seconds)) => {
                self.seconds.push(seconds);
                self.tin = Some(tin);
            }
            Err(why) => self.row.failed = Some(why),
        }
    }

    /// The row, with what the separate check finds.
    fn finish(self, grid: &Grid) -> TerrainRow {
        let Entry { mut row, seconds, tin, .. } = self;
        if row.failed.is_some() {
            return row;
        }
        row.seconds = Runs::of(seconds);
        if let Some(tin) = tin {
            let verdict = verify(grid, &tin, row.error, Contract::Samples);
            row.triangles = tin.triangles.len();
            row.max_error = verdict.max_error;
            row.beyond = verdict.beyond;
            row.faults = verdict.uncovered + verdict.over_void + verdict.turned + verdict.flat;
        }
        row
    }
}

/// The inner error is the tool's own failure, in its words.
type Outcome = std::result::Result<(Tin, f64), String>;

fn ours(grid: &Grid, options: &Options, threads: usize) -> Outcome {
    let work = || {
        let start = Instant::now();
        let made = triangulate(grid, options, &Quiet).map_err(|e| e.to_string())?;
        Ok((made.tin, start.elapsed().as_secs_f64()))
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| e.to_string())?;
    pool.install(work)
}

/// The version of a package, or why it cannot be run.
fn version(places: &Places, package: &str) -> std::result::Result<String, String> {
    let code = "import sys, importlib.metadata as m; print(m.version(sys.argv[1]))";
    output(&places.python(), &["-c", code, package]).ok_or_else(|| {
        let note = std::fs::read_to_string(places.env.join(format!("missing-{package}.txt")));
        note.map_or("pip could not install it".into(), |n| n.trim().to_string())
    })
}

fn peer(grid: &Grid, error: f64, tool: &Tool, places: &Places, folder: &Path) -> Outcome {
    if grid.heights().iter().any(|h| h.is_nan()) {
        return Err("knows no voids".into());
    }
    let out = folder.join("tin.raw");
    let run = || -> Result<(Tin, f64)> {
        let mut command = Command::new(places.python());
        command.arg(places.bench.join("peers/terrain.py")).arg(tool.id);
        command.arg(folder.join("grid.raw")).arg(&out).arg(error.to_string());
        let ran = command.output()?;
        if !ran.status.success() {
            let text = String::from_utf8_lossy(&ran.stderr).into_owned();
            bail!("{}", text.lines().rfind(|l| !l.is_empty()).unwrap_or("failed without a word"));
        }
        let text = String::from_utf8_lossy(&ran.stdout).into_owned();
        let line = text.lines().rfind(|l| l.starts_with('{')).unwrap_or_default();
        let said: serde_json::Value = serde_json::from_str(line)?;
        let seconds = said["seconds"].as_f64().context("said no seconds")?;
        Ok((tin_of(&Raw::read(&out)?), seconds))
    };
    let made = run().map_err(|e| format!("{e:#}"));
    // There is none if it failed.
    let _ = std::fs::remove_file(&out);
    made
}

/// A mesh over columns and rows as a network; whichever way its triangles turn. What reaches beyond the grid is for the check to find.
fn tin_of(raw: &Raw) -> Tin {
    let points: Vec<[u32; 2]> =
        raw.points.iter().map(|p| [p[0].round() as u32, p[1].round() as u32]).collect();
    let turned = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| points[v as usize].map(i64::from));
        (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0])
    };
    let triangles = raw.triangles.iter().map(|t| if turned(t) { [t[0], t[2], t[1]] } else { *t }).collect();
    Tin { heights: raw.points.iter().map(|p| p[2]).collect(), points, triangles }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn networks_are_oriented_and_checked() {
        let points = vec![[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [2.0, 2.0, 1.0], [0.0, 2.0, 1.0]];
        let raw = Raw { points, triangles: vec![[0, 1, 2], [0, 3, 2]] };
        let grid = Grid::new(3, 3, vec![1.0; 9]).unwrap();
        assert!(verify(&grid, &tin_of(&raw), 0.0, Contract::Samples).is_good());
        assert_eq!(bytes(&grid).len(), 24 + 36);
    }

    #[test]
    fn our_methods_keep_the_error_and_a_missing_peer_says_so() {
        let folder = tempfile::tempdir().unwrap();
        let places = Places { env: folder.path().into(), bench: folder.path().into() };
        let heights = Landscape::new(65, 1).heights();
        let subject = Subject { name: "a".into(), grid: Grid::new(65, 65, heights).unwrap() };
        for tool in TOOLS {
            let mut entry = Entry::new(&subject, 40.0, tool, 1);
            (0..2).for_each(|_| entry.turn(&subject.grid, &places, folder.path()));
            assert_eq!(entry.seconds.len(), if matches!(tool.how, How::Ours(..)) { 2 } else { 0 });
            let row = entry.finish(&subject.grid);
            match tool.how {
                How::Ours(..) => {
                    assert!(row.failed.is_none() && row.max_error <= 40.0 && row.triangles > 10);
                    assert_eq!((row.beyond, row.faults), (0, 0));
                }
                How::Python(_) => assert!(row.failed.is_some()),
            }
        }
    }
}
