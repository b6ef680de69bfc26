//! What `--json` and the summary of `terrain tin` say.

use super::breaklines::Breaklines;
use super::tile_report::Tiles;
use crate::cli::common::{short, thousands};
use progmesh::terrain::tin::{Contract, Outlined, Verdict};
use serde::Serialize;

/// The schema of `terrain tin --json`; docs/json.md says what each field means.
#[derive(Serialize)]
pub(super) struct Report {
    pub command: &'static str,
    pub file: String,
    pub columns: usize,
    pub rows: usize,
    pub valid: usize,
    pub isolated: usize,
    pub filled: Option<usize>,
    pub outline: Option<OutlineReport>,
    pub breaklines: Option<Breaklines>,
    pub grid_triangles: usize,
    pub method: &'static str,
    pub on_samples: bool,
    pub max_error: Option<f64>,
    pub contract: &'static str,
    pub max_triangles: Option<usize>,
    pub triangles: usize,
    pub vertices: usize,
    pub error: ErrorReport,
    pub step: Option<usize>,
    pub verified: Option<Verified>,
    pub tiles: Option<Tiles>,
    pub space: &'static str,
    pub spacing: Option<[f64; 2]>,
    pub exaggeration: Option<f64>,
    pub seconds: Seconds,
    pub warnings: Vec<String>,
}

#[derive(Serialize)]
pub(super) struct ErrorReport {
    pub max: f64,
    pub rms: f64,
    pub surface: f64,
}

/// What became of an outline that was simplified.
#[derive(Serialize)]
pub(super) struct OutlineReport {
    pub tolerance: f64,
    pub corners: usize,
    pub kept: usize,
    pub dropped: usize,
}

impl OutlineReport {
    pub(super) fn of(o: &Outlined, tolerance: f64) -> Self {
        OutlineReport { tolerance, corners: o.corners, kept: o.kept, dropped: o.dropped }
    }

    pub(super) fn warning(&self) -> Option<String> {
        (self.dropped > 0).then(|| {
            let samples = if self.dropped == 1 {
                "sample beside the outline is"
            } else {
                "samples beside the outline are"
            };
            let steps = if self.tolerance == 1.0 { "step" } else { "steps" };
            format!(
                "{} valid {samples} not covered: it was simplified by up to {} {steps}",
                thousands(self.dropped),
                short(self.tolerance)
            )
        })
    }
}

#[derive(Serialize)]
pub(super) struct Verified {
    pub good: bool,
    pub exact: bool,
    pub max: f64,
    pub beyond: usize,
    pub surface_max: Option<f64>,
    pub pieces_beyond: usize,
    pub uncovered: usize,
    pub over_void: usize,
    pub turned: usize,
    pub flat: usize,
    pub excess_area: i64,
    pub dropped: usize,
    pub overlapping: usize,
    pub astray: usize,
}

impl Verified {
    pub(super) fn of(v: &Verdict, contract: Contract) -> Self {
        Verified {
            good: v.is_good(),
            exact: v.exact,
            max: v.max_error,
            beyond: v.beyond,
            surface_max: (contract == Contract::Surface).then_some(v.surface_error),
            pieces_beyond: v.pieces_beyond,
            uncovered: v.uncovered,
            over_void: v.over_void,
            turned: v.turned,
            flat: v.flat,
            excess_area: v.excess_area,
            dropped: v.dropped,
            overlapping: v.overlapping,
            astray: v.astray,
        }
    }
}

#[derive(Serialize)]
pub(super) struct Seconds {
    pub read: f64,
    pub make: f64,
    pub verify: f64,
    pub write: f64,
    pub draw: f64,
    pub total: f64,
}

impl Report {
    pub(super) fn text(&self) -> String {
        let t = &self.seconds;
        let step = self.step.map_or(String::new(), |k| format!(", every {}", ordinal(k)));
        let verified = match &self.verified {
            Some(v) if v.good => "; verified",
            Some(_) => "; NOT as it should be",
            None => "",
        };
        let tiles = self.tiles.as_ref().map_or(String::new(), |t| format!("\n{}", t.text()));
        format!(
            "{}: {} x {} samples -> {} triangles, error {} (rms {}, between samples {}){verified}; {}{step}, {:.3} s (read {:.3}, make {:.3}, write {:.3}){tiles}",
            self.file,
            thousands(self.columns),
            thousands(self.rows),
            thousands(self.triangles),
            short(self.error.max),
            short(self.error.rms),
            short(self.error.surface),
            self.method,
            t.total,
            t.read,
            t.make,
            t.write
        )
    }
}

/// `4th`.
fn ordinal(n: usize) -> String {
    let ending = match (n % 100, n % 10) {
        (11..=13, _) => "th",
        (_, 1) => "st",
        (_, 2) => "nd",
        (_, 3) => "rd",
        _ => "th",
    };
    format!("{n}{ending}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ordinals_are_english() {
        assert_eq!(
            [1, 2, 3, 4, 11, 22, 113].map(ordinal),
            ["1st", "2nd", "3rd", "4th", "11th", "22nd", "113th"]
        );
    }
}
