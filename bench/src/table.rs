//! The results in Markdown.

use crate::lines::{MeshLine, ROUNDING, Row, TerrainRow};
use crate::measures::Measures;
use crate::results::{Duel, Results, label, name};
use crate::stats::{Standing, front};
use crate::tools::Tool;
use std::fmt::Write;

/// Where the README's part begins and ends.
const BEGIN: &str = "<!-- bench/run writes from here -->\n";
const END: &str = "<!-- to here -->\n";

/// What the README shows: at most so many meshes, at these ratios.
const SHOWN_MESHES: usize = 4;
pub(crate) const SHOWN_RATIOS: [f64; 2] = [0.1, 0.01];

/// Everything: `table.md`.
pub(crate) fn markdown(all: &Results) -> String {
    let mut out = String::from("# Time and error\n\n");
    out += &definitions();
    out += "\n## Machine\n\n";
    let rows = all.machine.words().into_iter().map(|(k, v)| vec![k.to_string(), v]);
    out += &table(&["", ""], rows);
    out += "\n## Tools\n\n";
    let rows = all.tools.iter().map(|t| {
        let version = t.version.clone().unwrap_or_else(|| {
            format!("**not measured**: {}", t.missing.as_deref().unwrap_or("unknown reason"))
        });
        vec![name(&t.tool).to_string(), version]
    });
    out += &table(&["tool", "version"], rows);
    out += "\n## Meshes\n\n";
    let rows = all.meshes.iter().map(|m| {
        let count = match &m.missing {
            Some(why) => format!("**not measured**: {why}"),
            None => thousands(m.triangles),
        };
        vec![m.mesh.clone(), count, m.origin.clone()]
    });
    out += &table(&["mesh", "triangles", "from"], rows);
    for mesh in all.measured() {
        for ratio in all.ratios(&mesh.mesh) {
            let _ = write!(out, "\n## {} to {}\n\n", mesh.mesh, per_cent(ratio));
            out += &group(all, &mesh.mesh, ratio);
        }
    }
    out += "\n## Where we lose\n\n";
    out += &losses(all);
    out += &terrain(all);
    out
}

/// Networks of height grids; nothing where none were measured.
fn terrain(all: &Results) -> String {
    if all.terrain.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "\n## Terrain\n\nTriangles for the same greatest error at the samples, each network checked at every sample by separate code: `true error` is what \
         that found, `beyond` how many samples it found farther than asked. Shares are of Delatin's triangles, and \
         `x Delatin` is of its seconds, which are those of the call alone.\n",
    );
    let mut seen: Vec<(&str, f64)> = vec![];
    for row in &all.terrain {
        if seen.contains(&(&row.grid, row.error)) {
            continue;
        }
        seen.push((&row.grid, row.error));
        let group: Vec<&TerrainRow> =
            all.terrain.iter().filter(|r| r.grid == row.grid && r.error == row.error).collect();
        let reference = group.iter().find(|r| r.tool == crate::terrain::REFERENCE && r.failed.is_none());
        let size = format!("{} x {}", thousands(row.columns), thousands(row.rows));
        let _ = write!(out, "\n### {}, {size}, error {}\n\n", row.grid, figures(row.error));
        let cells = group.iter().map(|r| {
            let name = crate::terrain::TOOLS.iter().find(|t| t.id == r.tool).map_or(&*r.tool, |t| t.name);
            let threads = if r.threads == 1 { String::new() } else { format!(", {} threads", r.threads) };
            let label = format!("{name}{threads}");
            if let Some(why) = &r.failed {
                return vec![label, format!("not measured: {why}")];
            }
            let share =
                reference.map_or("-".into(), |d| format!("{:.2}", r.triangles as f64 / d.triangles as f64));
            let times = reference
                .filter(|d| d.seconds.median > 0.0)
                .map_or("-".into(), |d| format!("{:.2}", r.seconds.median / d.seconds.median));
            vec![
                label,
                thousands(r.triangles),
                share,
                figures(r.max_error),
                thousands(r.beyond),
                thousands(r.faults),
                seconds(r.seconds.median),
                times,
            ]
        });
        let head = ["tool", "triangles", "share", "true error", "beyond", "faults", "seconds", "x Delatin"];
        out += &table(&head, cells);
    }
    out
}

/// What the numbers are.
pub(crate) fn definitions() -> String {
    "rms: root mean square distance between result and original, the worse of both directions, in 1e-5 of the \
     original's diagonal, over 300,000 area samples a side; max: the largest found. Seconds: the call alone, arrays in memory to arrays in \
     memory, the median of at least 5 processes in which the tools took turns; MeshLab and CGAL without filling their own structures, \
     ours with it. Arrays: with that. Normals: rms angle between them, degrees. Turned: triangles that look the other way. Cuts itself: pairs of \
     triangles. Shape: mean of longest edge over shortest altitude (1.15 is best). Topology: components, border loops, handles (? where it is no \
     manifold), non-manifold edges. Process: from start to end, with reading and writing a plain binary file. Peers have no setting for threads and \
     were free to use all cores.\n"
        .into()
}

/// One mesh at one ratio.
fn group(all: &Results, mesh: &str, ratio: f64) -> String {
    let rows: Vec<(&Tool, usize, &Row)> = all
        .entrants()
        .into_iter()
        .filter_map(|(t, n)| Some((t, n, all.row(mesh, ratio, t.id, n)?)))
        .collect();
    let points: Vec<[f64; 2]> = rows.iter().map(|r| r.2.point().unwrap_or([f64::INFINITY; 2])).collect();
    let best = front(&points);
    let cells = rows.iter().zip(best).map(|((tool, threads, row), best)| {
        let label = label(tool, *threads);
        if let Some(why) = &row.failed {
            return vec![label, format!("failed: {why}")];
        }
        let Some(m) = &row.measures else { return vec![label, "not measured".into()] };
        let of = |d: f64| error(d / m.diagonal);
        let miss = if row.on_target() { "" } else { " (off target)" };
        vec![
            if best { format!("**{label}**") } else { label },
            format!("{}{miss}", thousands(row.triangles)),
            of(m.worse.rms),
            of(m.worse.mean),
            of(m.worse.p99),
            of(m.worse.max),
            format!("{:.1}", m.normal_rms),
            m.turned.to_string(),
            m.self_intersections.to_string(),
            figures(m.shape_mean),
            topology(m),
            seconds(row.call.median),
            format!("{:.0} %", 100.0 * crate::stats::spread(&row.call.all)),
            seconds(row.arrays.median),
            seconds(row.process.median),
            cores(row),
            row.peak_bytes.map_or("-".into(), |b| format!("{}", b >> 20)),
        ]
    });
    let head = [
        "tool",
        "triangles",
        "rms",
        "mean",
        "99 %",
        "max",
        "normals",
        "turned",
        "cuts itself",
        "shape",
        "topology",
        "seconds",
        "+-",
        "arrays",
        "process",
        "cores used",
        "MiB",
    ];
    let mut out = table(&head, cells);
    out += "\nBold: no other is at least as good in seconds and rms and better in one.\n";
    out
}

/// Processor seconds over seconds of the process; the system's clock is too coarse for short ones.
fn cores(row: &Row) -> String {
    match row.cpu_seconds {
        Some(c) if row.process.median > 0.2 => format!("{:.1}", c / row.process.median),
        _ => "-".into(),
    }
}

/// Components, border loops, handles, non-manifold edges.
fn topology(m: &Measures) -> String {
    let t = &m.topology;
    let genus = t.genus.map_or("?".into(), |g| g.to_string());
    format!("{} {} {genus} {}", t.components, t.border_loops, t.non_manifold_edges)
}

/// Counts of wins and losses, then every loss.
pub(crate) fn losses(all: &Results) -> String {
    let mut out = String::from(
        "Our default method against each peer, at the same target: how often the peer is better in both, in seconds only, in \
         rms only, in neither.\n\n",
    );
    let head = ["peer", "threads (ours)", "better in both", "faster only", "more exact only", "neither"];
    let mut counts = Vec::new();
    for threads in all.default_threads() {
        let duels = all.duels(threads);
        for (tool, _) in all.entrants().into_iter().filter(|e| !e.0.ours) {
            let of = |s| duels.iter().filter(|d| d.peer.tool == tool.id && d.standing == s).count();
            let n = [Standing::LosesBoth, Standing::LosesTime, Standing::LosesError, Standing::Wins].map(of);
            if n.iter().sum::<usize>() > 0 {
                let mut cells = vec![tool.name.to_string(), threads.to_string()];
                cells.extend(n.map(|n| n.to_string()));
                counts.push(cells);
            }
        }
    }
    out += &table(&head, counts.into_iter());
    let kinds = [
        (Standing::LosesBoth, "Peer better in seconds and in rms"),
        (Standing::LosesError, "Peer more exact, and slower"),
        (Standing::LosesTime, "Peer faster, and less exact"),
    ];
    for (kind, title) in kinds {
        let _ = write!(out, "\n### {title}\n\n");
        let duels: Vec<_> = all.default_threads().into_iter().flat_map(|n| all.duels(n)).collect();
        let lost: Vec<_> = duels.iter().filter(|d| d.standing == kind).map(duel).collect();
        if lost.is_empty() {
            out += "None.\n";
            continue;
        }
        let head =
            ["mesh", "kept", "peer", "peer: rms, seconds", "ours: rms, seconds", "threads", "answered by"];
        out += &table(&head, lost.into_iter());
    }
    out += "\nAnswered by: the fastest of our methods, with no more threads, that is at least as fast and as exact as that peer \
            with no more triangles.\n";
    out
}

fn duel(d: &Duel<'_>) -> Vec<String> {
    let both = |r: &Row| match r.point() {
        Some([s, e]) => format!("{}, {}", error(e), seconds(s)),
        None => "-".into(),
    };
    let answer = d.answer.map_or("none".into(), |a| format!("{} ({})", name(&a.tool), both(a)));
    let miss = if d.peer.on_target() { String::new() } else { format!(" ({})", thousands(d.peer.triangles)) };
    vec![
        d.ours.mesh.clone(),
        per_cent(d.ours.ratio),
        format!("{}{miss}", name(&d.peer.tool)),
        both(d.peer),
        both(d.ours),
        d.ours.threads.to_string(),
        answer,
    ]
}

/// The meshes of the README's part.
pub(crate) fn shown(all: &Results) -> Vec<&MeshLine> {
    all.measured().take(SHOWN_MESHES).collect()
}

/// The README's part, without the marks: rms and seconds of every tool on a few meshes.
pub(crate) fn summary(all: &Results) -> String {
    let meshes = shown(all);
    let mut columns = Vec::new();
    for m in &meshes {
        columns.extend(SHOWN_RATIOS.iter().filter(|r| all.ratios(&m.mesh).contains(r)).map(|&r| (*m, r)));
    }
    let mut head = vec!["rms / seconds".to_string()];
    head.extend(columns.iter().map(|(m, r)| format!("{} {}k, {}", m.mesh, m.triangles / 1000, per_cent(*r))));
    let rows = all.entrants().into_iter().map(|(tool, threads)| {
        let mut cells = vec![label(tool, threads)];
        cells.extend(columns.iter().map(|(m, r)| match all.row(&m.mesh, *r, tool.id, threads) {
            Some(row) => match row.point() {
                Some([s, e]) => {
                    let mark = if row.on_target() { "" } else { "*" };
                    format!("{}{mark} / {}", error(e), seconds(s))
                }
                None => "refused".into(),
            },
            None => String::new(),
        }));
        cells
    });
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut out = String::from(
        "![Seconds of the call against rms distance, a line a tool, a point a ratio](docs/bench.svg)\n\n\
         rms: distance between result and original, worse direction, in 1e-5 of the diagonal. Seconds: the call alone, arrays in memory to \
         arrays in memory; median of 5 processes, all tools taking turns.\n\n",
    );
    out += &table(&head, rows);
    out += "\n\\* not within 1 % of the triangles asked for.\n\n";
    let machine: Vec<String> =
        all.machine.words().into_iter().take(2).map(|(k, v)| format!("{k} {v}")).collect();
    let version = |t: &crate::lines::ToolLine| Some(format!("{} {}", name(&t.tool), t.version.as_ref()?));
    let versions: Vec<String> = all.tools.iter().filter(|t| peer(&t.tool)).filter_map(version).collect();
    let _ = writeln!(out, "{}. {}.", machine.join(", "), versions.join(", "));
    if let Some(load) = all.machine.load.filter(|l| *l > 0.5) {
        let _ = writeln!(
            out,
            "\nOther programs were using the machine (load {load:.1} before the run): seconds are too high, for all tools alike."
        );
    }
    for t in all.tools.iter().filter(|t| t.missing.is_some()) {
        let _ = writeln!(
            out,
            "\n{} was not measured: {}.",
            name(&t.tool),
            t.missing.as_deref().unwrap_or_default()
        );
    }
    out + "\n" + &verdict(all)
}

fn peer(id: &str) -> bool {
    crate::tools::find(id).is_some_and(|t| !t.ours)
}

/// In a paragraph: how often peers are better.
fn verdict(all: &Results) -> String {
    let mut out = String::from("Where we lose.");
    for threads in all.default_threads() {
        let duels = all.duels(threads);
        let n = |s| duels.iter().filter(|d| d.standing == s).count();
        let plural = if threads == 1 { "" } else { "s" };
        let _ = write!(
            out,
            " With {threads} thread{plural}, of {} comparisons of the default method with a peer, the peer is better in seconds and rms in \
             {}, faster only in {}, more exact only in {}.",
            duels.len(),
            n(Standing::LosesBoth),
            n(Standing::LosesTime),
            n(Standing::LosesError)
        );
        let mut who: Vec<String> = duels
            .iter()
            .filter(|d| d.standing == Standing::LosesBoth)
            .map(|d| format!("{} on {} to {}", name(&d.peer.tool), d.ours.mesh, per_cent(d.ours.ratio)))
            .collect();
        who.dedup();
        if !who.is_empty() {
            let _ = write!(out, " Better in both: {}.", who.join("; "));
        }
    }
    out + "\n"
}

/// A text with what is between the marks replaced; `None` if it has no marks.
pub(crate) fn spliced(text: &str, part: &str) -> Option<String> {
    let (before, rest) = text.split_once(BEGIN)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{BEGIN}\n{part}\n{END}{after}"))
}

/// A Markdown table; short rows are filled up.
fn table(head: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    // A bar in a cell would end it, and so would a line's end.
    let clean = |c: &str| c.replace('|', "\\|").replace(['\n', '\r'], " ");
    let mut out = format!("| {} |\n|{}\n", head.join(" | "), "---|".repeat(head.len()));
    for mut cells in rows {
        cells.resize(head.len(), String::new());
        let cells: Vec<String> = cells.iter().map(|c| clean(c)).collect();
        let _ = writeln!(out, "| {} |", cells.join(" | "));
    }
    out
}

/// Three significant figures.
pub(crate) fn figures(x: f64) -> String {
    if !x.is_finite() {
        return "-".into();
    }
    if x == 0.0 {
        return "0".into();
    }
    let digits = 2 - x.abs().log10().floor() as i32;
    if digits > 8 {
        return format!("{x:.2e}");
    }
    let digits = digits.max(0) as usize;
    format!("{x:.digits$}")
}

/// A length in diagonals as 1e-5 of them; below the rounding of single precision no digits mean anything.
fn error(d: f64) -> String {
    if d <= ROUNDING { format!("<{}", 1e5 * ROUNDING) } else { figures(1e5 * d) }
}

/// Seconds: three figures, but no finer than a tenth of a millisecond.
pub(crate) fn seconds(s: f64) -> String {
    if s < 0.01 { format!("{s:.4}") } else { figures(s) }
}

/// 10 %.
pub(crate) fn per_cent(ratio: f64) -> String {
    let p = format!("{:.3}", 100.0 * ratio);
    format!("{} %", p.trim_end_matches('0').trim_end_matches('.'))
}

/// 1,234,567.
pub(crate) fn thousands(n: usize) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(c);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::tests::results;

    #[test]
    fn numbers_have_three_figures() {
        assert_eq!(
            [0.0, 20.31, 123.4, 1234.6, 0.012345].map(figures),
            ["0", "20.3", "123", "1235", "0.0123"]
        );
        assert_eq!(figures(1.234e-9), "1.23e-9");
        assert_eq!([0.00123, 0.0213, 1.0].map(seconds), ["0.0012", "0.0213", "1.00"]);
        assert_eq!([0.0, 9e-9, 1e-5].map(error), ["<0.001", "<0.001", "1.00"]);
        assert_eq!([0.1, 0.025, 1.0].map(per_cent), ["10 %", "2.5 %", "100 %"]);
        assert_eq!([7, 1000, 1234567].map(thousands), ["7", "1,000", "1,234,567"]);
    }

    #[test]
    fn every_table_has_rows_of_its_width() {
        let text = markdown(&results());
        let mut width = 0;
        for line in text.lines() {
            if !line.starts_with('|') {
                width = 0;
                continue;
            }
            let bars = line.replace("\\|", "").matches('|').count();
            assert!(width == 0 || bars == width, "{line}");
            width = bars;
        }
    }

    #[test]
    fn networks_stand_beside_delatin_in_triangles_and_time() {
        let row = |tool: &str, triangles, seconds| TerrainRow {
            grid: "alps".into(),
            tool: tool.into(),
            threads: 1,
            triangles,
            seconds: crate::lines::Runs::of(vec![seconds]),
            ..TerrainRow::default()
        };
        let mut all = results();
        all.terrain = vec![row("best", 60, 0.3), row("greedy", 101, 0.08), row("delatin", 100, 0.1)];
        let text = terrain(&all);
        for words in [
            "| progmesh best | 60 | 0.60 | 0 | 0 | 0 | 0.300 | 3.00 |",
            "| progmesh greedy | 101 | 1.01 |",
            " 0.80 |",
        ] {
            assert!(text.contains(words), "{words}\n{text}");
        }
        all.terrain.pop();
        assert!(terrain(&all).contains("| 0.300 | - |"));
    }

    #[test]
    fn what_is_missing_failed_or_lost_is_said() {
        let text = markdown(&results());
        for words in [
            "| CGAL Garland-Heckbert | **not measured**: no root |",
            "| dragon | **not measured**: no <npm> |",
            "| MeshLab quadric | failed: refuses \\| this |",
            "| bunny | 10 % | meshoptimizer | 30.0, 0.100 | 40.0, 0.200 | 2 | none |",
            "| bunny | 10 % | CGAL Lindstrom-Turk | 20.0, 5.00 | 40.0, 0.200 | 2 | progmesh quadric, exact schedule (10.0, 0.500) |",
            "| CGAL Lindstrom-Turk | 1 | 0 | 0 | 1 | 1 |",
            "**meshoptimizer**",
        ] {
            assert!(text.contains(words), "{words}\n{text}");
        }
    }

    #[test]
    fn the_summary_goes_between_the_marks_again_and_again() {
        let part = summary(&results());
        assert!(part.contains("| progmesh quadric, 2 threads | 40.0 / 0.200 |"), "{part}");
        assert!(!part.contains("Other programs"));
        let mut busy = results();
        busy.machine.load = Some(3.0);
        assert!(summary(&busy).contains("load 3.0"));
        assert!(part.contains("Better in both: meshoptimizer on bunny to 10 %."), "{part}");
        let text = format!("a\n{BEGIN}old\n{END}b\n");
        let once = spliced(&text, &part).unwrap();
        assert!(once.starts_with("a\n") && once.ends_with("b\n") && !once.contains("old"));
        assert_eq!(spliced(&once, &part).unwrap(), once);
        assert_eq!(spliced("no marks", &part), None);
    }
}
