//! `results.jsonl`: one line for the machine, each mesh, each tool and each run.

use crate::machine::Machine;
use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;

/// A line of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub(crate) enum Line {
    Machine(Machine),
    Mesh(MeshLine),
    Tool(ToolLine),
    Run(Box<Row>),
    Terrain(TerrainRow),
}

/// A tool on a height grid with an error.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct TerrainRow {
    pub(crate) grid: String,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    /// Asked for, in the grid's units.
    pub(crate) error: f64,
    pub(crate) tool: String,
    pub(crate) version: String,
    pub(crate) threads: usize,
    /// Why there is no result.
    pub(crate) failed: Option<String>,
    pub(crate) triangles: usize,
    /// Seconds of the call.
    pub(crate) seconds: Runs,
    /// The greatest at any sample, by the separate check.
    pub(crate) max_error: f64,
    /// Samples beyond the error.
    pub(crate) beyond: usize,
    /// Samples not covered, voids covered, triangles turned or without an area.
    pub(crate) faults: usize,
}

impl TerrainRow {
    /// True if the other is a run of the same thing.
    pub(crate) fn same(&self, other: &TerrainRow) -> bool {
        let key = |r: &TerrainRow| {
            (r.grid.clone(), [r.columns, r.rows, r.threads], r.error.to_bits(), r.tool.clone())
        };
        key(self) == key(other)
    }
}

/// A mesh that was asked for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct MeshLine {
    pub(crate) mesh: String,
    /// Where it is from, in words.
    pub(crate) origin: String,
    /// Names its content.
    pub(crate) digest: String,
    pub(crate) vertices: usize,
    pub(crate) triangles: usize,
    /// Why it is not there.
    pub(crate) missing: Option<String>,
}

/// A tool that was asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ToolLine {
    pub(crate) tool: String,
    pub(crate) version: Option<String>,
    /// Why it is not there.
    pub(crate) missing: Option<String>,
}

/// Errors below this part of the diagonal are those of single precision: as good as none, and none better than another.
pub(crate) const ROUNDING: f64 = 1e-8;

/// What several runs took: the median, and all of them in order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Runs {
    pub(crate) median: f64,
    pub(crate) all: Vec<f64>,
}

impl Runs {
    pub(crate) fn of(all: Vec<f64>) -> Runs {
        Runs { median: crate::stats::median(&all).unwrap_or(0.0), all }
    }
}

/// A tool on a mesh at a ratio with a number of threads.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) mesh: String,
    /// Of the mesh's content.
    pub(crate) digest: String,
    pub(crate) triangles_in: usize,
    /// Of the triangles, to be kept.
    pub(crate) ratio: f64,
    pub(crate) target: usize,
    pub(crate) tool: String,
    pub(crate) version: String,
    /// Threads it was told to use. Tools that have no such setting: those of the machine.
    pub(crate) threads: usize,
    /// Why there is no result.
    pub(crate) failed: Option<String>,
    pub(crate) triangles: usize,
    pub(crate) vertices: usize,
    /// Seconds; see [`crate::one::Said`].
    pub(crate) call: Runs,
    pub(crate) arrays: Runs,
    pub(crate) process: Runs,
    pub(crate) cpu_seconds: Option<f64>,
    pub(crate) peak_bytes: Option<u64>,
    pub(crate) parameter: Option<f64>,
    pub(crate) measures: Option<crate::measures::Measures>,
}

impl Row {
    /// True if the other is a run of the same thing.
    pub(crate) fn same(&self, other: &Row) -> bool {
        self.digest == other.digest
            && self.target == other.target
            && self.tool == other.tool
            && self.version == other.version
            && self.threads == other.threads
    }

    /// Root mean square distance, worse direction, over the diagonal, but at least [`ROUNDING`]; `None` without a result.
    pub(crate) fn rms(&self) -> Option<f64> {
        self.measures.as_ref().map(|m| (m.worse.rms / m.diagonal).max(ROUNDING))
    }

    /// Seconds and error, if there is a result.
    pub(crate) fn point(&self) -> Option<[f64; 2]> {
        Some([self.call.median, self.rms()?])
    }

    /// True if the result has within 1 % of the triangles asked for.
    pub(crate) fn on_target(&self) -> bool {
        self.triangles.abs_diff(self.target) as f64 <= 0.01 * self.target as f64
    }
}

/// All lines of the file; none if there is no such file. A last line that was cut short by a kill is left out.
pub(crate) fn read(path: &Path) -> Result<Vec<Line>> {
    let text = match std::fs::read_to_string(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(vec![]),
        text => text.with_context(|| path.display().to_string())?,
    };
    let whole = text.rsplit_once('\n').map_or("", |t| t.0);
    let parse =
        |(i, line)| serde_json::from_str(line).with_context(|| format!("{}, line {}", path.display(), i + 1));
    whole.lines().enumerate().filter(|l| !l.1.is_empty()).map(parse).collect()
}

/// Writes the file anew.
pub(crate) fn write(path: &Path, lines: &[Line]) -> Result<()> {
    let mut text = String::new();
    for line in lines {
        text += &serde_json::to_string(line)?;
        text.push('\n');
    }
    std::fs::write(path, text).with_context(|| path.display().to_string())
}

/// Adds a line.
pub(crate) fn append(path: &Path, line: &Line) -> Result<()> {
    let mut file = std::fs::OpenOptions::new().create(true).append(true).open(path)?;
    file.write_all(format!("{}\n", serde_json::to_string(line)?).as_bytes())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(tool: &str) -> Row {
        Row { mesh: "m".into(), tool: tool.into(), call: Runs::of(vec![3.0, 1.0, 2.0]), ..Default::default() }
    }

    #[test]
    fn lines_come_back_and_a_torn_one_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.jsonl");
        assert_eq!(read(&path).unwrap(), []);
        let tool = ToolLine { tool: "t".into(), version: None, missing: Some("no".into()) };
        let lines = vec![Line::Tool(tool), Line::Run(Box::new(row("a")))];
        write(&path, &lines).unwrap();
        append(&path, &Line::Run(Box::new(row("b")))).unwrap();
        let all = read(&path).unwrap();
        assert_eq!(all[..2], lines);
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 5]).unwrap();
        assert_eq!(read(&path).unwrap(), lines);
        std::fs::write(&path, "{\n").unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("line 1"));
    }

    #[test]
    fn the_same_run_is_known_again() {
        let a = Row { threads: 1, ..row("a") };
        assert!(a.same(&Row { call: Runs::default(), ..a.clone() }));
        assert!(!a.same(&Row { threads: 2, ..a.clone() }));
        assert!(!a.same(&Row { version: "2".into(), ..a.clone() }));
    }

    #[test]
    fn on_target_is_within_one_per_cent() {
        let of = |triangles| Row { target: 1000, triangles, ..Default::default() };
        assert!(of(990).on_target() && of(1010).on_target());
        assert!(!of(989).on_target() && !of(1011).on_target());
    }
}
