//! A comparison as tables.

use super::{Comparison, Details};
use crate::aif::Semantic;
use crate::pipeline::thousands;
use crate::report::{Table, short};
use crate::simplify::measure::{Deviations, Farthest, Summary, TopologySummary, TriangleQuality};
use glam::DVec3;

/// What a row is called, and where its numbers come from.
type Row<T> = (&'static str, fn(&T) -> f64);

impl Comparison {
    /// All measures for people. Numbers are those of the fields.
    pub fn tables(&self) -> Vec<Table> {
        let mut tables = vec![self.distance_table()];
        tables.extend(self.certified_table());
        tables.push(self.farthest_table());
        if let Some(d) = &self.details {
            tables.push(deviation_table(&d.deviations));
            tables.push(shape_table(d));
        }
        tables
    }

    fn distance_table(&self) -> Table {
        let d = &self.distances;
        let mut table = Table::new(&["distance", "A to B", "B to A", "worse", "worse / diagonal"]);
        let sides = [&d.a_to_b.summary, &d.b_to_a.summary, &d.worse];
        let numbers: [Row<Summary>; 8] = [
            ("max", |s| s.max),
            ("rms", |s| s.rms),
            ("mean", |s| s.mean),
            ("50 % of the area within", |s| s.quantiles.p50),
            ("90 %", |s| s.quantiles.p90),
            ("95 %", |s| s.quantiles.p95),
            ("99 %", |s| s.quantiles.p99),
            ("99.9 %", |s| s.quantiles.p999),
        ];
        for (name, number) in numbers {
            let mut cells = vec![name.to_string()];
            cells.extend(sides.iter().map(|s| short(number(s))));
            cells.push(match d.diagonal > 0.0 {
                true => format!("{} %", short(100.0 * number(&d.worse) / d.diagonal)),
                false => "-".into(),
            });
            table.row(cells);
        }
        let counts = |name: &str, x: [usize; 2]| {
            let mut cells = vec![name.to_string()];
            cells.extend(x.map(thousands));
            cells.extend(["", ""].map(String::from));
            cells
        };
        table.row(counts("area samples", [d.a_to_b.samples, d.b_to_a.samples]));
        table.row(counts("vertices", [d.a_to_b.vertices, d.b_to_a.vertices]));
        table
    }

    fn certified_table(&self) -> Option<Table> {
        let c = self.certified.as_ref()?;
        let mut table =
            Table::new(&["proven largest distance", "A to B", "B to A", "two-sided", "/ diagonal"]);
        let d = self.distances.diagonal;
        let rows = [
            ("at least", [c.a_to_b.lower, c.b_to_a.lower, c.lower]),
            ("at most", [c.a_to_b.upper, c.b_to_a.upper, c.upper]),
        ];
        for (name, values) in rows {
            let mut cells = vec![name.to_string()];
            cells.extend(values.map(long));
            cells.push(if d > 0.0 { format!("{} %", long(100.0 * values[2] / d)) } else { "-".into() });
            table.row(cells);
        }
        Some(table)
    }

    fn farthest_table(&self) -> Table {
        let mut table = Table::new(&["farthest point found", "at", "closest on the other", "distance"]);
        let mut row = |name: &str, f: &Farthest| {
            table.row([name.to_string(), point(f.point), point(f.closest), short(f.distance)]);
        };
        row("of A", &self.distances.a_to_b.farthest);
        row("of B", &self.distances.b_to_a.farthest);
        if let Some(c) = &self.certified {
            row(if c.witness_on_a { "proven, of A" } else { "proven, of B" }, &c.witness);
        }
        table
    }
}

/// How people call an attribute that is compared.
pub fn semantic_name(semantic: &Semantic) -> String {
    match semantic {
        Semantic::TexCoord(k) => format!("uv {k}"),
        Semantic::Color(k) => format!("colour {k}"),
        other => format!("{other:?}"),
    }
}

fn deviation_table(d: &Deviations) -> Table {
    let mut table = Table::new(&["deviation at closest points", "rms", "max"]);
    let normals = &d.normals.worse;
    if normals.samples > 0 {
        table.row(["normals, degrees".into(), short(normals.rms), short(normals.max)]);
    }
    for (semantic, found) in d.values.iter().filter(|v| v.1.worse.samples > 0) {
        table.row([semantic_name(semantic), short(found.worse.rms), short(found.worse.max)]);
    }
    table
}

fn shape_table(d: &Details) -> Table {
    let mut table = Table::new(&["shape", "A", "B"]);
    if let [Some(a), Some(b)] = &d.topology {
        let count = |n: usize| thousands(n);
        let genus = |t: &TopologySummary| t.genus.map_or("-".into(), count);
        table.row(["components".into(), count(a.components), count(b.components)]);
        table.row(["border loops".into(), count(a.border_loops), count(b.border_loops)]);
        table.row(["genus".into(), genus(a), genus(b)]);
        table.row(["Euler characteristic".into(), a.euler.to_string(), b.euler.to_string()]);
        table.row([
            "edges of three and more faces".into(),
            count(a.non_manifold_edges),
            count(b.non_manifold_edges),
        ]);
        table.row(["cut vertices".into(), count(a.cut_vertices), count(b.cut_vertices)]);
        table.row([
            "edges between faces turned against each other".into(),
            count(a.misoriented_edges),
            count(b.misoriented_edges),
        ]);
    }
    table.row(["triangles turned against A".into(), String::new(), thousands(d.turned)]);
    let [a, b] = &d.quality;
    let rows: [Row<TriangleQuality>; 4] = [
        ("longest side / shortest altitude: mean", |q| q.mean),
        ("50 % of the triangles below", |q| q.quantiles.p50),
        ("99 %", |q| q.quantiles.p99),
        ("max", |q| q.max),
    ];
    for (name, number) in rows {
        table.row([name.into(), short(number(a)), short(number(b))]);
    }
    table.row(["triangles without area".into(), thousands(a.degenerate), thousands(b.degenerate)]);
    let pairs = usize::try_from(d.self_intersections.pairs).unwrap_or(usize::MAX);
    table.row(["pairs of triangles that intersect".into(), String::new(), thousands(pairs)]);
    table
}

/// In seven digits: bounds that are close to each other differ.
fn long(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        a if (1e-3..1e5).contains(&a) => {
            let digits = (6 - a.log10().floor() as i32).max(0) as usize;
            format!("{x:.digits$}")
        }
        _ => format!("{x:.6e}"),
    }
}

fn point(p: DVec3) -> String {
    p.to_array().map(short).join(" ")
}
