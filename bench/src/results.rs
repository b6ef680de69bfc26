//! What was measured, sorted for reading.

use crate::lines::{Line, MeshLine, Row, TerrainRow, ToolLine};
use crate::machine::Machine;
use crate::stats::Standing;
use crate::tools::{self, Tool};

/// All lines by kind.
#[derive(Clone, Debug, Default)]
pub(crate) struct Results {
    pub(crate) machine: Machine,
    pub(crate) meshes: Vec<MeshLine>,
    pub(crate) tools: Vec<ToolLine>,
    pub(crate) rows: Vec<Row>,
    pub(crate) terrain: Vec<TerrainRow>,
}

/// A comparison of one of our rows with a peer's at the same target.
#[derive(Clone, Debug)]
pub(crate) struct Duel<'a> {
    pub(crate) ours: &'a Row,
    pub(crate) peer: &'a Row,
    pub(crate) standing: Standing,
    /// One of our rows at this target that is at least as fast and as exact as the peer: the fastest.
    pub(crate) answer: Option<&'a Row>,
}

impl Results {
    /// Sorts lines; of a run measured twice the last counts.
    pub(crate) fn of(lines: Vec<Line>) -> Results {
        let mut all = Results::default();
        for line in lines {
            match line {
                Line::Machine(m) => all.machine = m,
                Line::Mesh(m) => all.meshes.push(m),
                Line::Tool(t) => all.tools.push(t),
                Line::Terrain(t) => {
                    all.terrain.retain(|old| !old.same(&t));
                    all.terrain.push(t);
                }
                Line::Run(r) => {
                    all.rows.retain(|old| !old.same(&r));
                    all.rows.push(*r);
                }
            }
        }
        all
    }

    /// Meshes that have rows, in order.
    pub(crate) fn measured(&self) -> impl Iterator<Item = &MeshLine> {
        self.meshes.iter().filter(|m| self.rows.iter().any(|r| r.mesh == m.mesh))
    }

    /// Ratios of the rows of a mesh, largest first.
    pub(crate) fn ratios(&self, mesh: &str) -> Vec<f64> {
        let mut ratios: Vec<f64> = self.rows.iter().filter(|r| r.mesh == mesh).map(|r| r.ratio).collect();
        ratios.sort_by(|a, b| b.total_cmp(a));
        ratios.dedup();
        ratios
    }

    /// Tools with their numbers of threads that have rows, in the order of [`tools::TOOLS`].
    pub(crate) fn entrants(&self) -> Vec<(&'static Tool, usize)> {
        let mut all = Vec::new();
        for tool in &tools::TOOLS {
            let mut threads: Vec<usize> =
                self.rows.iter().filter(|r| r.tool == tool.id).map(|r| r.threads).collect();
            threads.sort_unstable();
            threads.dedup();
            all.extend(threads.into_iter().map(|n| (tool, n)));
        }
        all
    }

    /// The row of a mesh, ratio, tool and number of threads.
    pub(crate) fn row(&self, mesh: &str, ratio: f64, tool: &str, threads: usize) -> Option<&Row> {
        let is = |r: &&Row| r.mesh == mesh && r.ratio == ratio && r.tool == tool && r.threads == threads;
        self.rows.iter().find(is)
    }

    /// Our default method with so many threads against each peer, wherever both have a result.
    pub(crate) fn duels(&self, threads: usize) -> Vec<Duel<'_>> {
        let is_ours = |r: &Row| tools::find(&r.tool).is_some_and(|t| t.ours);
        let mut duels = Vec::new();
        for ours in self.rows.iter().filter(|r| r.tool == tools::TOOLS[0].id && r.threads == threads) {
            let Some(at) = ours.point() else { continue };
            let same = |r: &&Row| r.mesh == ours.mesh && r.ratio == ours.ratio;
            for peer in self.rows.iter().filter(same).filter(|r| !is_ours(r)) {
                let Some(point) = peer.point() else { continue };
                let beats = |r: &&Row| {
                    r.point().is_some_and(|p| p[0] <= point[0] && p[1] <= point[1])
                        && r.triangles <= peer.triangles
                };
                let own = self.rows.iter().filter(same).filter(|r| is_ours(r) && r.threads <= threads);
                let answer = own.filter(beats).min_by(|a, b| a.call.median.total_cmp(&b.call.median));
                duels.push(Duel { ours, peer, standing: Standing::of(at, point), answer });
            }
        }
        duels
    }

    /// Numbers of threads that our default method ran with.
    pub(crate) fn default_threads(&self) -> Vec<usize> {
        self.entrants().iter().filter(|e| e.0.id == tools::TOOLS[0].id).map(|e| e.1).collect()
    }
}

/// The name of a tool and how many threads it had.
pub(crate) fn label(tool: &Tool, threads: usize) -> String {
    match (tool.threads, threads) {
        (false, _) => tool.name.to_string(),
        (true, 1) => format!("{}, 1 thread", tool.name),
        (true, n) => format!("{}, {n} threads", tool.name),
    }
}

/// The name of a tool by its id.
pub(crate) fn name(id: &str) -> &str {
    tools::find(id).map_or(id, |t| t.name)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::lines::Runs;
    use crate::measures::{Distance, Measures};

    /// A row with a result: rms relative to the diagonal.
    pub(crate) fn row(tool: &str, threads: usize, ratio: f64, seconds: f64, rms: f64) -> Row {
        let worse = Distance { rms: 2.0 * rms, max: 8.0 * rms, mean: 1.5 * rms, ..Distance::default() };
        Row {
            mesh: "bunny".into(),
            digest: "d".into(),
            triangles_in: 1000,
            ratio,
            target: (1000.0 * ratio) as usize,
            tool: tool.into(),
            version: "1".into(),
            threads,
            triangles: (1000.0 * ratio) as usize,
            vertices: 50,
            call: Runs::of(vec![seconds]),
            arrays: Runs::of(vec![seconds]),
            process: Runs::of(vec![2.0 * seconds]),
            cpu_seconds: Some(2.0 * seconds),
            peak_bytes: Some(50 << 20),
            measures: Some(Measures { diagonal: 2.0, worse, samples: 10, ..Measures::default() }),
            ..Row::default()
        }
    }

    /// One mesh, two ratios: a peer better in both at 10 %, one slower and better.
    pub(crate) fn results() -> Results {
        let mesh = MeshLine { mesh: "bunny".into(), triangles: 1000, vertices: 502, ..MeshLine::default() };
        let gone =
            MeshLine { mesh: "dragon".into(), missing: Some("no <npm>".into()), ..MeshLine::default() };
        let tool = |id: &str, missing: Option<&str>| ToolLine {
            tool: id.into(),
            version: missing.is_none().then(|| "1".into()),
            missing: missing.map(String::from),
        };
        let mut failed = row("meshlab", 2, 0.1, 0.0, 0.0);
        (failed.measures, failed.failed) = (None, Some("refuses | this".into()));
        let rows = vec![
            row("quadric", 1, 0.5, 0.2, 1e-5),
            row("quadric", 2, 0.5, 0.1, 1e-5),
            row("quadric", 1, 0.1, 0.4, 4e-4),
            row("quadric", 2, 0.1, 0.2, 4e-4),
            row("quadric-exact", 1, 0.1, 0.5, 1e-4),
            row("meshopt", 2, 0.1, 0.1, 3e-4),
            row("cgal-lt", 2, 0.1, 5.0, 2e-4),
            row("cgal-lt", 2, 0.5, 4.0, 2e-5),
            failed,
        ];
        let mut lines = vec![Line::Machine(Machine { cpu: "CPU".into(), cores: 2, ..Machine::default() })];
        lines.extend([mesh, gone].map(Line::Mesh));
        lines.extend([tool("quadric", None), tool("cgal-gh", Some("no root"))].map(Line::Tool));
        lines.extend(rows.into_iter().map(|r| Line::Run(Box::new(r))));
        Results::of(lines)
    }

    #[test]
    fn of_two_runs_of_the_same_the_last_counts() {
        let lines = [0.1, 0.3].map(|s| Line::Run(Box::new(row("quadric", 1, 0.1, s, 1e-4))));
        let all = Results::of(lines.to_vec());
        assert_eq!(all.rows.len(), 1);
        assert_eq!(all.row("bunny", 0.1, "quadric", 1).unwrap().call.median, 0.3);
    }

    #[test]
    fn duels_say_who_is_better_and_whether_another_method_answers() {
        let all = results();
        assert_eq!(all.default_threads(), [1, 2]);
        assert_eq!(all.ratios("bunny"), [0.5, 0.1]);
        let find = |threads, tool: &str, ratio| {
            let duels = all.duels(threads);
            let d = duels.into_iter().find(|d| d.peer.tool == tool && d.ours.ratio == ratio).unwrap();
            (d.standing, d.answer.map(|a| a.tool.as_str()))
        };
        assert_eq!(find(2, "meshopt", 0.1), (Standing::LosesBoth, None));
        assert_eq!(find(2, "cgal-lt", 0.1), (Standing::LosesError, Some("quadric-exact")));
        assert_eq!(find(1, "cgal-lt", 0.5), (Standing::Wins, Some("quadric")));
        assert_eq!(all.duels(2).len(), 3);
    }
}
