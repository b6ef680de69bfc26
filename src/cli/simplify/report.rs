//! What `progmesh simplify` says of a run: for people, and as JSON.

use super::{Args, MethodName};
use crate::cli::common::{self, short, thousands};
use progmesh::io::files;
use progmesh::pipeline::{Summary, count};
use progmesh::simplify::Stop;
use serde::Serialize;

impl Args {
    /// The summary for people, on standard error.
    pub(super) fn tell(&self, file: &str, s: &Summary, n: &Triangles, t: &Seconds) {
        if self.method == MethodName::Nsa {
            for l in &s.levels {
                common::note(&format!(
                    "pass {}: {} faces, {:.3} s, {} collapses tried, {} refused",
                    l.pass,
                    thousands(l.faces),
                    l.seconds,
                    thousands(l.tried as usize),
                    thousands(l.refused.total() as usize)
                ));
            }
        }
        let percent = 100.0 * s.faces_out as f64 / s.faces_in.max(1) as f64;
        let relative = match s.diagonal > 0.0 {
            true => format!(" ({} % of the diagonal)", short(100.0 * s.estimate / s.diagonal)),
            false => String::new(),
        };
        common::note(&format!(
            "{file}: {} -> {} faces ({percent:.1} %), {} vertices{}; {}, {:.3} s (read {:.3}, build {:.3}, simplify {:.3}, \
             write {:.3}{}{}); estimated error {}{relative}{}; stopped: {}",
            thousands(s.faces_in),
            thousands(s.faces_out),
            thousands(s.vertices_out),
            n.instances(),
            self.method.name(),
            t.total,
            t.read,
            t.build,
            t.simplify,
            t.write,
            if t.measure > 0.0 { format!(", measure {:.3}", t.measure) } else { String::new() },
            if t.draw > 0.0 { format!(", draw {:.3}", t.draw) } else { String::new() },
            short(s.estimate),
            found(s),
            match s.stop {
                Stop::Target => "target reached",
                Stop::Error => "error bound reached",
                Stop::Passes => "passes done",
                Stop::Cancelled => "interrupted",
                _ if self.method == MethodName::Cluster => "a coarser grid would leave nothing",
                _ => "no legal collapse left",
            }
        ));
    }

    pub(super) fn report(
        &self,
        s: &Summary,
        triangles: Triangles,
        seconds: Seconds,
        warnings: Vec<String>,
    ) -> Report {
        Report {
            command: "simplify",
            method: self.method.name(),
            faces_in: s.faces_in,
            faces_out: s.faces_out,
            vertices_out: s.vertices_out,
            triangles,
            seconds,
            stop: match s.stop {
                Stop::Target => "target",
                Stop::Error => "error",
                Stop::Passes => "passes",
                Stop::Cancelled => "cancelled",
                _ => "no_legal_collapse",
            },
            estimate: s.estimate,
            measured: s.measured.map(|m| MeasuredReport { max: m.max, rms: m.rms, mean: m.mean }),
            certified: s.certified.map(|c| CertifiedReport { bound: c.bound, upper: c.upper, runs: c.runs }),
            levels: s
                .levels
                .iter()
                .map(|l| LevelReport {
                    pass: l.pass,
                    faces: l.faces,
                    seconds: l.seconds,
                    tried: l.tried,
                    refused: RefusedReport {
                        link: l.refused.link,
                        normal: l.refused.normal,
                        border: l.refused.border,
                        flip: l.refused.flip,
                        valence: l.refused.valence,
                        locked: l.refused.locked,
                    },
                })
                .collect(),
            aif_bytes: s.aif_bytes,
            peak_bytes: files::peak_bytes(),
            warnings,
        }
    }
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
pub(super) struct Report {
    command: &'static str,
    method: &'static str,
    faces_in: usize,
    faces_out: usize,
    vertices_out: usize,
    triangles: Triangles,
    seconds: Seconds,
    stop: &'static str,
    estimate: f64,
    measured: Option<MeasuredReport>,
    certified: Option<CertifiedReport>,
    levels: Vec<LevelReport>,
    aif_bytes: usize,
    peak_bytes: Option<u64>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct MeasuredReport {
    max: f64,
    rms: f64,
    mean: f64,
}

#[derive(Serialize)]
struct CertifiedReport {
    bound: f64,
    upper: f64,
    runs: usize,
}

/// What was measured and proven, for people.
fn found(s: &Summary) -> String {
    let mut text = String::new();
    if let Some(m) = s.measured {
        text += &format!("; measured: max {}, rms {}, mean {}", short(m.max), short(m.rms), short(m.mean));
    }
    if let Some(c) = s.certified {
        text += &format!(
            "; proven: at most {} (asked for {}, {})",
            short(c.upper),
            short(c.bound),
            count(c.runs, "run")
        );
    }
    text
}

#[derive(Serialize)]
pub(super) struct Seconds {
    pub(super) read: f64,
    pub(super) build: f64,
    pub(super) simplify: f64,
    pub(super) measure: f64,
    pub(super) write: f64,
    pub(super) draw: f64,
    pub(super) total: f64,
}

/// Triangles of the unique meshes, which targets count, and of all instances, which are drawn.
#[derive(Serialize)]
pub(super) struct Triangles {
    pub(super) input: usize,
    pub(super) output: usize,
    pub(super) instanced_input: usize,
    pub(super) instanced_output: usize,
    #[serde(skip)]
    pub(super) meshes: usize,
}

impl Triangles {
    /// For people, where instances make a difference.
    fn instances(&self) -> String {
        if (self.instanced_input, self.instanced_output) == (self.input, self.output) {
            return String::new();
        }
        format!(
            " in {}, each counted once (all instances: {} -> {} triangles)",
            count(self.meshes, "mesh"),
            thousands(self.instanced_input),
            thousands(self.instanced_output)
        )
    }
}

#[derive(Serialize)]
pub(super) struct LevelReport {
    pass: usize,
    faces: usize,
    seconds: f64,
    tried: u64,
    refused: RefusedReport,
}

#[derive(Serialize)]
pub(super) struct RefusedReport {
    link: u64,
    normal: u64,
    border: u64,
    flip: u64,
    valence: u64,
    locked: u64,
}
