//! What `--json` and the summary say of tiles.

use crate::cli::common::{short, thousands};
use serde::Serialize;
use std::fmt::Write;

/// docs/json.md says what each field means.
#[derive(Serialize)]
pub(super) struct Tiles {
    pub format: &'static str,
    pub directory: String,
    pub resampled: bool,
    pub border_mismatches: Option<usize>,
    pub levels: Vec<Level>,
}

#[derive(Serialize)]
pub(super) struct Level {
    pub level: u32,
    pub max_error: f64,
    pub error: f64,
    pub tiles: usize,
    pub triangles: usize,
    pub vertices: usize,
    pub bytes: usize,
    pub sag: f64,
    pub height_step: Option<f64>,
    pub border_mismatches: Option<usize>,
}

impl Tiles {
    pub(super) fn text(&self) -> String {
        let mut out = format!("{}: {} levels of {} tiles", self.directory, self.levels.len(), self.format);
        for l in &self.levels {
            let _ = write!(
                out,
                "\n  level {}: {} tiles, {} triangles, error {} of {}",
                l.level,
                thousands(l.tiles),
                thousands(l.triangles),
                short(l.error),
                short(l.max_error)
            );
            if l.sag > 0.0 {
                let _ = write!(out, ", up to {} m below the ellipsoid's curve", short(l.sag));
            }
            if let Some(step) = l.height_step {
                let _ = write!(out, ", heights rounded by up to {}", short(step / 2.0));
            }
        }
        out
    }
}
