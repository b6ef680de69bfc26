//! What a flight came to.

use super::super::extract::StripReport;
use super::super::paging::Paging;
use super::super::rule::Guard;
use super::common::{short, thousands};
use super::ground::OnGround;
use serde::Serialize;

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
pub(super) struct Report {
    command: &'static str,
    path: String,
    pub(super) rule: &'static str,
    pub(super) error: &'static str,
    tau: Option<f64>,
    pub(super) fps: Option<usize>,
    full_faces: usize,
    frame_count: usize,
    faces: Statistics,
    vsplits: Statistics,
    ecols: Statistics,
    us: Statistics,
    morphing: Statistics,
    dirty_index_bytes: Statistics,
    operations_per_second: Option<f64>,
    strip_length: Option<Statistics>,
    measured_over_tau: Option<Statistics>,
    pub(super) above: usize,
    cracks: Option<usize>,
    folds: Option<usize>,
    uncovered: Option<usize>,
    floor_pixels: Option<f64>,
    memory: Memory,
    pub(super) paging: Option<Paging>,
    pub(super) guard: Option<Guard>,
    frames: Vec<Frame>,
    seconds: Seconds,
    pub(super) warnings: Vec<String>,
}

/// A frame.
#[derive(Default, Serialize)]
pub(super) struct Frame {
    pub(super) faces: usize,
    pub(super) vertices: usize,
    pub(super) vsplits: usize,
    pub(super) ecols: usize,
    pub(super) us: f64,
    pub(super) tau: Option<f64>,
    pub(super) complete: bool,
    pub(super) morphing: usize,
    pub(super) visible_vertices: Option<usize>,
    pub(super) dirty_index_bytes: usize,
    pub(super) dirty_wedges: usize,
    pub(super) strips: Option<StripReport>,
    pub(super) fetched: Option<usize>,
    pub(super) no_room: Option<usize>,
    pub(super) measured: Option<Measured>,
    pub(super) on_ground: Option<OnGround>,
    pub(super) cracks: Option<usize>,
    pub(super) folds: Option<usize>,
}

#[derive(Clone, Copy, Serialize)]
pub(super) struct Measured {
    pub(super) samples: usize,
    pub(super) max_pixels: f64,
    pub(super) mean_pixels: f64,
}

#[derive(Serialize)]
pub(super) struct Memory {
    pub(super) shared_bytes: usize,
    pub(super) shared_bytes_per_vertex: f64,
    pub(super) view_bytes: usize,
    pub(super) view_table_bytes: usize,
    pub(super) most_vertices: usize,
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    bounds: f64,
}

/// Of all frames but the first, which starts from the base.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Statistics {
    mean: f64,
    p50: f64,
    p99: f64,
    max: f64,
}

impl Statistics {
    /// `None` of nothing. Percentiles by nearest rank.
    fn of(values: impl Iterator<Item = f64>) -> Option<Statistics> {
        let mut all: Vec<f64> = values.collect();
        all.sort_by(f64::total_cmp);
        let rank = |p: f64| ((p * all.len() as f64).ceil() as usize).clamp(1, all.len()) - 1;
        let max = *all.last()?;
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        Some(Statistics { mean, p50: all[rank(0.5)], p99: all[rank(0.99)], max })
    }
}

impl Report {
    pub(super) fn new(
        path: String,
        tau: f64,
        full_faces: usize,
        frames: Vec<Frame>,
        memory: Memory,
        [read, bounds]: [f64; 2],
    ) -> Report {
        // A flight of one frame is that frame.
        let later = if frames.len() > 1 { &frames[1..] } else { &frames[..] };
        let of = |f: &dyn Fn(&Frame) -> f64| {
            let none = Statistics { mean: 0.0, p50: 0.0, p99: 0.0, max: 0.0 };
            Statistics::of(later.iter().map(f)).unwrap_or(none)
        };
        let operations: usize = later.iter().map(|f| f.vsplits + f.ecols).sum();
        let time: f64 = later.iter().map(|f| f.us * 1e-6).sum();
        let ratio = |f: &Frame| {
            let tau = f.tau.filter(|t| *t > 0.0 && f.complete)?;
            let pixels = f.measured.map(|m| m.max_pixels).or(f.on_ground.map(|g| g.beyond_pixels));
            pixels.map(|p| p / tau)
        };
        // While vertices move nothing is promised.
        let above = frames.iter().filter(|f| f.morphing == 0).filter_map(ratio).filter(|r| *r > 1.0);
        let judged = || frames.iter().filter_map(|f| f.on_ground.as_ref());
        let sum = |f: &dyn Fn(&Frame) -> Option<usize>| {
            let each = || frames.iter().filter_map(f);
            each().next().map(|_| each().sum())
        };
        Report {
            command: "fly",
            path,
            rule: "cuts",
            error: "uniform",
            tau: tau.is_finite().then_some(tau),
            fps: None,
            full_faces,
            frame_count: frames.len(),
            faces: of(&|f| f.faces as f64),
            vsplits: of(&|f| f.vsplits as f64),
            ecols: of(&|f| f.ecols as f64),
            us: of(&|f| f.us),
            morphing: of(&|f| f.morphing as f64),
            dirty_index_bytes: of(&|f| f.dirty_index_bytes as f64),
            operations_per_second: (operations > 0 && time > 0.0).then(|| operations as f64 / time),
            strip_length: Statistics::of(later.iter().filter_map(|f| Some(f.strips?.mean_length))),
            measured_over_tau: Statistics::of(frames.iter().filter_map(ratio)),
            above: above.count(),
            cracks: sum(&|f| f.cracks),
            folds: sum(&|f| f.folds),
            uncovered: sum(&|f| f.on_ground.map(|g| g.uncovered)),
            floor_pixels: judged().map(|g| g.floor_pixels).reduce(f64::max),
            memory,
            paging: None,
            guard: None,
            seconds: Seconds { read, bounds },
            warnings: vec![],
            frames,
        }
    }

    /// For people.
    pub(super) fn text(&self, file: &str) -> Vec<String> {
        let s = |name: &str, x: &Statistics| {
            let of = |v: f64| if v >= 1000.0 { thousands(v.round() as usize) } else { short(v) };
            let [mean, p50, p99, max] = [x.mean, x.p50, x.p99, x.max].map(of);
            format!("  {name:<22} mean {mean:>9}  p50 {p50:>9}  p99 {p99:>9}  max {max:>9}")
        };
        let mut lines = vec![format!(
            "{file}: {} frames of {} faces along {}",
            thousands(self.frame_count),
            thousands(self.full_faces),
            self.path
        )];
        lines.push(s("faces", &self.faces));
        lines.push(s("vertex splits", &self.vsplits));
        lines.push(s("collapses", &self.ecols));
        lines.push(s("microseconds", &self.us));
        lines.push(s("index bytes to upload", &self.dirty_index_bytes));
        if self.morphing.max > 0.0 {
            lines.push(s("vertices on the way", &self.morphing));
        }
        if let Some(x) = &self.strip_length {
            lines.push(s("triangles in a strip", x));
        }
        if let Some(m) = &self.measured_over_tau {
            lines.push(s("measured error / tau", m));
        }
        // A floor that is rounding alone is none.
        let seen = |f: &f64| *f > 1e-3 * self.tau.unwrap_or(0.0);
        if let (Some(floor), Some(tau)) = (self.floor_pixels.filter(seen), self.tau) {
            lines.push(format!(
                "  bound: tau, {} pixels, or the floor of full detail as seen, {} at most; above it are samples farther off than both",
                short(tau),
                short(floor)
            ));
        }
        if let Some(g) = &self.guard {
            lines.push(format!("  {}", g.text()));
        }
        if let (Some(cracks), Some(folds), Some(uncovered)) = (self.cracks, self.folds, self.uncovered) {
            lines.push(format!(
                "  {} cracks, {} folds, {} samples in sight that nothing covers",
                thousands(cracks),
                thousands(folds),
                thousands(uncovered)
            ));
        }
        if let Some(p) = &self.paging {
            lines.push(format!("  {}", p.text()));
            return lines;
        }
        lines.push(format!(
            "  shared {} B a vertex; a view {} B for {} vertices shown at most, and {} B of tables",
            short(self.memory.shared_bytes_per_vertex),
            thousands(self.memory.view_bytes),
            thousands(self.memory.most_vertices),
            thousands(self.memory.view_table_bytes)
        ));
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_by_nearest_rank() {
        let s = Statistics::of((1..=200).rev().map(f64::from)).unwrap();
        assert_eq!(s, Statistics { mean: 100.5, p50: 100.0, p99: 198.0, max: 200.0 });
        assert_eq!(Statistics::of([3.0].into_iter()).unwrap().p99, 3.0);
        assert!(Statistics::of(std::iter::empty()).is_none());
    }
}
