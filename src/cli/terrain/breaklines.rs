//! `--breaklines`: lines of GeoJSON as steps from sample to sample.

use crate::cli::Failure;
use crate::cli::common::{Warnings, thousands};
use clap::ValueEnum;
use progmesh::io::grid::GridFile;
use progmesh::io::{files, geojson};
use progmesh::terrain::Geodetic;
use serde::Serialize;
use std::path::PathBuf;

#[derive(clap::Args, Debug)]
pub(crate) struct BreaklineArgs {
    /// Lines that sides of triangles shall follow, from sample to sample: LineString and MultiLineString of a GeoJSON file
    #[arg(long, value_name = "FILE", help_heading = "Breaklines")]
    breaklines: Option<PathBuf>,
    /// What their coordinates are [default: world if the grid says where it lies, grid otherwise]
    #[arg(long, value_enum, value_name = "SPACE", requires = "breaklines", help_heading = "Breaklines")]
    breakline_space: Option<LineSpace>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum LineSpace {
    /// Those of the grid's own coordinate system
    World,
    /// Columns and rows
    Grid,
}

/// From sample to sample: columns and rows.
pub(super) type Step = [[u32; 2]; 2];

/// What `--json` says of them; docs/json.md says what each field means.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Breaklines {
    pub lines: usize,
    pub steps: usize,
    pub beyond: usize,
    pub bent: usize,
    pub outside: usize,
    pub missing: Option<usize>,
}

impl BreaklineArgs {
    pub(super) fn are_given(&self) -> bool {
        self.breaklines.is_some()
    }

    /// Straight steps between samples, and what is known of them so far; with `lattice` between its points.
    pub(super) fn steps(
        &self,
        source: &GridFile,
        lattice: Option<&Geodetic>,
        warnings: &mut Warnings,
    ) -> Result<(Vec<Step>, Option<Breaklines>), Failure> {
        let Some(path) = &self.breaklines else { return Ok((vec![], None)) };
        let failed = |what: String| Failure::Input(format!("{}: {what}", path.display()));
        let bytes = files::read_all(path).map_err(|e| failed(e.to_string()))?;
        let read = geojson::decode_lines(&bytes).map_err(|e| failed(e.to_string()))?;
        warnings.say((read.others > 0).then(|| {
            format!(
                "{}: {} geometries are no lines and were left out",
                path.display(),
                thousands(read.others)
            )
        }));
        let transform = match (self.breakline_space, source.georeference.transform) {
            (Some(LineSpace::Grid), _) | (None, None) => None,
            (_, Some(transform)) => Some(transform),
            (Some(LineSpace::World), None) => {
                return Err(Failure::Usage(
                    "the grid does not say where it lies: --breakline-space grid takes columns and rows"
                        .into(),
                ));
            }
        };
        let size = match lattice {
            Some(lattice) => [lattice.grid.columns(), lattice.grid.rows()],
            None => [source.raster.columns(), source.raster.rows()],
        };
        let most = size.map(|n| n.saturating_sub(1) as f64);
        let mut facts = Breaklines { lines: read.lines.len(), ..Breaklines::default() };
        let mut steps = vec![];
        for line in &read.lines {
            let place = |&p: &[f64; 2]| {
                let of_grid = transform.map_or(Some(p), |t| t.invert(p))?;
                Some(lattice.map_or(of_grid, |l| l.on_lattice(of_grid)))
            };
            let points: Option<Vec<[f64; 2]>> = line.iter().map(place).collect();
            let points = points.ok_or_else(|| failed("the grid's transform has no inverse".into()))?;
            for pair in points.windows(2) {
                let pair = within_turn([pair[0], pair[1]], lattice.and_then(Geodetic::turn));
                let length = |[a, b]: [[f64; 2]; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
                let (mut found, mut kept) = (false, 0.0);
                // What is beyond one side of a lattice round the globe is within the other.
                let turn = lattice.and_then(Geodetic::turn);
                for by in [Some(0.0), turn, turn.map(|t| -t)].into_iter().flatten() {
                    let moved = [pair[0], pair[1]].map(|[x, y]| [x + by, y]);
                    let Some(clipped) = clip(moved, most) else { continue };
                    found = true;
                    kept += length(clipped);
                    let [a, b] = clipped.map(|p| p.map(|c| c.round() as u32));
                    if a != b {
                        steps.push([a, b]);
                    }
                }
                let all = length([pair[0], pair[1]]);
                facts.beyond += usize::from(!found || kept < all * (1.0 - 1e-9));
            }
        }
        facts.steps = steps.len();
        warnings.say((facts.beyond > 0).then(|| {
            format!(
                "{}: {} pieces reach beyond the grid and were cut there",
                path.display(),
                thousands(facts.beyond)
            )
        }));
        Ok((steps, Some(facts)))
    }
}

/// A piece moved by whole turns, so that its middle is from 0 to one.
fn within_turn(piece: [[f64; 2]; 2], turn: Option<f64>) -> [[f64; 2]; 2] {
    let Some(turn) = turn else { return piece };
    let turns = ((piece[0][0] + piece[1][0]) / (2.0 * turn)).floor();
    piece.map(|[x, y]| [x - turns * turn, y])
}

/// The part of a straight line within 0 to `most` (Liang & Barsky 1984).
fn clip([a, b]: [[f64; 2]; 2], most: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for k in 0..2 {
        let d = b[k] - a[k];
        for (step, room) in [(-d, a[k]), (d, most[k] - a[k])] {
            if step == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if step < 0.0 {
                from = from.max(room / step);
            } else {
                to = to.min(room / step);
            }
        }
    }
    // Neither is NaN: `max` and `min` pass it over.
    if from > to {
        return None;
    }
    let at = |t: f64| -> [f64; 2] {
        let p = |k: usize| {
            if t == 0.0 {
                a[k]
            } else if t == 1.0 {
                b[k]
            } else {
                a[k] + t * (b[k] - a[k])
            }
        };
        std::array::from_fn(|k| p(k).clamp(0.0, most[k]))
    };
    Some([at(from), at(to)])
}

#[cfg(test)]
mod tests {
    use super::{clip, within_turn};

    #[test]
    fn pieces_are_turned_to_where_the_lattice_is() {
        let piece = [[350.0, 1.0], [370.0, 2.0]];
        assert_eq!(within_turn(piece, None), piece);
        assert_eq!(within_turn(piece, Some(360.0)), [[-10.0, 1.0], [10.0, 2.0]]);
        assert_eq!(within_turn([[-30.0, 1.0], [-20.0, 2.0]], Some(360.0)), [[330.0, 1.0], [340.0, 2.0]]);
    }

    #[test]
    fn lines_are_cut_at_the_grid() {
        let most = [10.0, 5.0];
        assert_eq!(clip([[1.0, 1.0], [9.0, 4.0]], most), Some([[1.0, 1.0], [9.0, 4.0]]));
        assert_eq!(clip([[-5.0, 2.0], [5.0, 2.0]], most), Some([[0.0, 2.0], [5.0, 2.0]]));
        assert_eq!(clip([[-5.0, 2.0], [25.0, 2.0]], most), Some([[0.0, 2.0], [10.0, 2.0]]));
        assert_eq!(clip([[-5.0, -2.0], [25.0, -2.0]], most), None);
        assert_eq!(clip([[11.0, 0.0], [11.0, 5.0]], most), None);
        assert_eq!(clip([[3.0, 3.0], [3.0, 3.0]], most), Some([[3.0, 3.0], [3.0, 3.0]]));
        let far = clip([[1e308, 0.0], [-1e308, 0.0]], most).unwrap();
        assert!(far.iter().all(|p| (0.0..=10.0).contains(&p[0]) && p[1] == 0.0));
    }
}
