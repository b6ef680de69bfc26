//! `report.html`: everything in one file that refers to nothing outside itself.

use crate::plot::{Panel, Point, Series, Shape, Style, escaped, svg};
use crate::results::{Results, label};
use crate::table;
use crate::tools::{TOOLS, Tool};
use std::fmt::Write;

const STYLE: &str = "\
:root{color-scheme:light dark;--line:#8884}\
body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em}\
table{border-collapse:collapse;margin:1em 0;font-variant-numeric:tabular-nums;font-size:13px}\
th,td{padding:.2em .7em;border-bottom:1px solid var(--line);text-align:right}\
th:first-child,td:first-child{text-align:left;padding-left:0}\
.wide{overflow-x:auto}svg,img{max-width:100%;height:auto;border-radius:6px}figure{margin:1em 0}";

/// A picture of a mesh, as a PNG.
pub(crate) struct Heat {
    pub(crate) mesh: String,
    pub(crate) caption: String,
    /// The file, in base64.
    pub(crate) png: String,
}

/// The page.
pub(crate) fn html(all: &Results, heats: &[Heat]) -> String {
    let mut body = String::new();
    // The plots before the long tables.
    let text = table::markdown(all);
    let (head, rest) = text.split_once("\n## Machine").unwrap_or((&text, ""));
    body += &from_markdown(head);
    for mesh in all.measured() {
        let name = escaped(&mesh.mesh);
        let _ = writeln!(body, "<h2>{name}, {} triangles</h2>", table::thousands(mesh.triangles));
        for panel in [time_error(all, &mesh.mesh), triangles_error(all, &mesh.mesh)] {
            let _ = writeln!(body, "<figure>{}</figure>", svg(&[panel]));
        }
        for heat in heats.iter().filter(|h| h.mesh == mesh.mesh) {
            let caption = escaped(&heat.caption);
            let _ = writeln!(
                body,
                "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{}\"><figcaption>{caption}</figcaption></figure>",
                heat.png
            );
        }
    }
    // What is lost before all the rest.
    let (tables, losses) = rest.split_once("\n## Where we lose").unwrap_or((rest, ""));
    body += &from_markdown(&format!("## Where we lose{losses}"));
    body += &from_markdown(&format!("## Machine{tables}"));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>progmesh: time and error</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n"
    )
}

/// The picture for the README: seconds against error on the first meshes.
pub(crate) fn picture(all: &Results) -> String {
    let panels: Vec<Panel> = all.measured().take(2).map(|m| time_error(all, &m.mesh)).collect();
    svg(&panels)
}

/// Seconds of the call against rms, a line a tool, a point a ratio.
fn time_error(all: &Results, mesh: &str) -> Panel {
    let series = all.entrants().into_iter().map(|(tool, threads)| Series {
        label: label(tool, threads),
        style: style(tool, tool.threads && threads == 1),
        points: points(all, mesh, tool, threads, |row| row.call.median),
    });
    Panel {
        title: format!("{mesh}: time against error"),
        x: "seconds of the call",
        y: "rms distance, 1e-5 of the diagonal",
        series: series.collect(),
    }
}

/// Triangles against rms, a line a tool.
fn triangles_error(all: &Results, mesh: &str) -> Panel {
    // The result is the same for every number of threads.
    let mut seen = Vec::new();
    let mut series = Vec::new();
    for (tool, threads) in all.entrants() {
        if seen.contains(&tool.id) {
            continue;
        }
        seen.push(tool.id);
        series.push(Series {
            label: tool.name.to_string(),
            style: style(tool, false),
            points: points(all, mesh, tool, threads, |row| row.triangles as f64),
        });
    }
    Panel {
        title: format!("{mesh}: error against triangles"),
        x: "triangles of the result",
        y: "rms distance, 1e-5 of the diagonal",
        series,
    }
}

fn points(
    all: &Results,
    mesh: &str,
    tool: &Tool,
    threads: usize,
    x: fn(&crate::lines::Row) -> f64,
) -> Vec<Point> {
    let of = |ratio: f64| {
        let row = all.row(mesh, ratio, tool.id, threads)?;
        let error = 1e5 * row.rms()?;
        let kept = table::per_cent(ratio);
        let title = format!(
            "{}: {kept}, {} triangles, {} s, rms {}",
            label(tool, threads),
            table::thousands(row.triangles),
            table::seconds(row.call.median),
            table::figures(error)
        );
        // The default method says which ratio its points are.
        let note = if tool.id == TOOLS[0].id && threads == 1 { kept } else { String::new() };
        Some(Point { x: x(row), y: error, title, note })
    };
    all.ratios(mesh).into_iter().filter_map(of).collect()
}

/// Ours are round and blue to green, peers are not.
fn style(tool: &Tool, hollow: bool) -> Style {
    let (colour, shape) = match tool.id {
        "quadric" => ("#0b5fff", Shape::Circle),
        "quadric-exact" => ("#00a0c8", Shape::Circle),
        "quadric-endpoint" => ("#6f52e0", Shape::Circle),
        "nsa" => ("#1f8f4d", Shape::Circle),
        "cluster" => ("#86b324", Shape::Circle),
        "meshopt" => ("#e4572e", Shape::Square),
        "meshopt-update" => ("#f29b1d", Shape::Square),
        "fast-simplification" => ("#8c564b", Shape::Triangle),
        "pyfqmr" => ("#b98a7e", Shape::Triangle),
        "meshlab" => ("#6b6b6b", Shape::Cross),
        "cgal-lt" => ("#c2185b", Shape::Diamond),
        _ => ("#e377c2", Shape::Diamond),
    };
    Style { colour, shape, hollow, width: if tool.ours { 2.0 } else { 1.3 } }
}

/// The Markdown that `table.rs` writes as HTML: headings, tables, paragraphs, bold.
fn from_markdown(text: &str) -> String {
    let mut out = String::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if line.starts_with('|') {
            out += "<div class=\"wide\"><table>\n";
            out += &cells(line, "th");
            while let Some(row) = lines.next_if(|l| l.starts_with('|')) {
                if !row.starts_with("|---") {
                    out += &cells(row, "td");
                }
            }
            out += "</table></div>\n";
        } else if let Some(level) = line.find(' ').filter(|&n| n > 0 && line[..n].chars().all(|c| c == '#')) {
            let _ = writeln!(out, "<h{level}>{}</h{level}>", inline(&line[level + 1..]));
        } else if !line.is_empty() {
            let _ = writeln!(out, "<p>{}</p>", inline(line));
        }
    }
    out
}

fn cells(line: &str, tag: &str) -> String {
    // A bar inside a cell is escaped; no cell holds the stand-in.
    let line = line.replace("\\|", "\u{1}");
    let inner = line.trim().trim_start_matches('|').trim_end_matches('|');
    let cells: String = inner
        .split('|')
        .map(|c| format!("<{tag}>{}</{tag}>", inline(&c.trim().replace('\u{1}', "|"))))
        .collect();
    format!("<tr>{cells}</tr>\n")
}

/// Escaped, with `**bold**`.
fn inline(text: &str) -> String {
    let parts: Vec<String> = escaped(text).split("**").map(String::from).collect();
    let mut out = String::new();
    for (i, part) in parts.iter().enumerate() {
        match i % 2 {
            1 => out += &format!("<b>{part}</b>"),
            _ => out += part,
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::tests::results;

    #[test]
    fn the_page_holds_everything_and_refers_to_nothing() {
        let heat = Heat { mesh: "bunny".into(), caption: "a < b".into(), png: "QUJD".into() };
        let page = html(&results(), &[heat]);
        assert_eq!(page.matches("<svg ").count(), 2);
        assert!(page.contains("base64,QUJD") && page.contains("alt=\"a &lt; b\""));
        for words in ["Where we lose", "Machine", "no &lt;npm&gt;", "<b>not measured</b>", "refuses | this"] {
            assert!(page.contains(words), "{words}");
        }
        assert!(!page.contains("src=\"http") && !page.contains("href=") && !page.contains("<script"));
        for tag in ["table", "tr", "td", "th", "figure", "h2", "h3", "p", "b", "svg", "g"] {
            let open = page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
            assert_eq!(open, page.matches(&format!("</{tag}>")).count(), "{tag}");
        }
    }

    #[test]
    fn every_tool_looks_different() {
        let styles: Vec<Style> = TOOLS.iter().map(|t| style(t, false)).collect();
        for (i, a) in styles.iter().enumerate() {
            assert!(styles[..i].iter().all(|b| a.colour != b.colour), "{}", TOOLS[i].id);
        }
    }

    #[test]
    fn a_series_has_a_point_for_each_ratio_with_a_result() {
        let panel = time_error(&results(), "bunny");
        let of = |label: &str| panel.series.iter().find(|s| s.label == label).unwrap().points.len();
        assert_eq!(of("progmesh quadric, 2 threads"), 2);
        assert_eq!(of("meshoptimizer"), 1);
        assert_eq!(of("MeshLab quadric"), 0);
        assert!(picture(&results()).contains("bunny: time against error"));
    }
}
