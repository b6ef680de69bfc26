//! How long the rest of a run takes.

use crate::lines::Row;
use crate::tools::{Host, Tool};

/// What is left to do: a mesh at a ratio, by some tools.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// Each tool once for each number of threads.
    pub(crate) tools: Vec<&'static Tool>,
    pub(crate) triangles: usize,
}

/// Seconds that parts take, from earlier rows where there are any, corrected by what the parts done so far took.
#[derive(Clone, Debug)]
pub(crate) struct Pace {
    /// Of each part, in order.
    seconds: Vec<f64>,
    done: usize,
    /// What the parts done were said to take, and what they took.
    said: f64,
    took: f64,
}

/// Seconds to start a tool, and for it to read and write.
const START: f64 = 0.15;
/// Seconds to measure a result, and those a triangle of the original: 300,000 samples a side.
const MEASURE: [f64; 2] = [1.0, 3e-6];

impl Pace {
    /// Of parts that are run `repeat` times; `before`: rows of earlier runs, of any build.
    pub(crate) fn new(parts: &[Part], repeat: usize, before: &[Row]) -> Pace {
        let seconds = parts.iter().map(|p| {
            let n = p.triangles as f64;
            let run = |t: &&Tool| repeat as f64 * (START + per_triangle(t, before) * n);
            // One tool with several numbers of threads gives one result.
            let mut results: Vec<&str> = p.tools.iter().map(|t| t.id).collect();
            results.dedup();
            let measuring = results.len() as f64 * (MEASURE[0] + MEASURE[1] * n);
            p.tools.iter().map(run).sum::<f64>() + measuring
        });
        Pace { seconds: seconds.collect(), done: 0, said: 0.0, took: 0.0 }
    }

    /// The next part is done.
    pub(crate) fn add(&mut self, seconds: f64) {
        self.said += self.seconds.get(self.done).copied().unwrap_or(0.0);
        self.took += seconds;
        self.done += 1;
    }

    /// Seconds that are left.
    pub(crate) fn left(&self) -> f64 {
        let rest: f64 = self.seconds.iter().skip(self.done).sum();
        // The first part alone does not say much.
        let weight = self.said.min(60.0) / 60.0;
        let factor = if self.said > 0.0 { self.took / self.said } else { 1.0 };
        rest * (1.0 + weight * (factor - 1.0))
    }
}

/// Seconds that a tool takes for a triangle of its input.
fn per_triangle(tool: &Tool, before: &[Row]) -> f64 {
    let rows = before.iter().filter(|r| r.tool == tool.id && r.process.median > 0.0);
    let (seconds, triangles) = rows.fold((0.0, 0), |(s, n), r| (s + r.process.median, n + r.triangles_in));
    if triangles > 0 {
        return (seconds / triangles as f64 - START / 1e5).max(0.0);
    }
    match tool.host {
        Host::Rust => 1e-6,
        Host::Python => 4e-6,
        Host::Cgal => 1.2e-5,
    }
}

/// Seconds in words: no more exact than they are.
pub(crate) fn words(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("about {:.0} s", (s / 5.0).ceil() * 5.0),
        s => format!("about {:.0} min", s / 60.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lines::Runs;
    use crate::tools::find;

    fn parts(n: usize) -> Vec<Part> {
        let tools = ["quadric", "quadric", "meshlab"].map(|t| find(t).unwrap()).to_vec();
        vec![Part { tools, triangles: 100_000 }; n]
    }

    #[test]
    fn what_was_measured_before_is_expected_again() {
        let fresh = Pace::new(&parts(4), 5, &[]);
        let row = Row {
            tool: "meshlab".into(),
            triangles_in: 100_000,
            process: Runs { median: 20.0, all: vec![20.0] },
            ..Row::default()
        };
        let known = Pace::new(&parts(4), 5, &[row]);
        assert!(known.left() > 4.0 * 5.0 * 20.0 && known.left() > 5.0 * fresh.left());
    }

    #[test]
    fn the_rest_follows_what_the_parts_done_took() {
        let mut pace = Pace::new(&parts(40), 5, &[]);
        let before = pace.left();
        let part = before / 40.0;
        (0..20).for_each(|_| pace.add(2.0 * part));
        let left = pace.left();
        assert!((left / (20.0 * 2.0 * part) - 1.0).abs() < 1e-9, "{left} {part}");
        (0..20).for_each(|_| pace.add(part));
        assert_eq!(pace.left(), 0.0);
    }

    #[test]
    fn seconds_are_said_as_a_person_would() {
        assert_eq!(
            [3.0, 61.0, 100.0, 2400.0].map(words),
            ["about 5 s", "about 65 s", "about 2 min", "about 40 min"]
        );
    }
}
