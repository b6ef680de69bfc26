//! The measuring: every tool on every mesh at every ratio, peers and ours taking turns.

use crate::child::{Cost, Job};
use crate::lines::{self, Line, MeshLine, Row, Runs, ToolLine};
use crate::machine::Machine;
use crate::measures::{self, Measures};
use crate::pace::{self, Pace, Part};
use crate::plan::Plan;
use crate::raw::{Raw, digest};
use crate::tools::{Places, Tool};
use anyhow::{Context, Result};
use progmesh::simplify::measure::Surface;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Where results go.
#[derive(Clone, Debug)]
pub(crate) struct Out {
    pub(crate) folder: PathBuf,
}

impl Out {
    pub(crate) fn results(&self) -> PathBuf {
        self.folder.join("results.jsonl")
    }

    /// The original mesh that tools read.
    pub(crate) fn mesh(&self, name: &str) -> PathBuf {
        let safe = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        self.folder.join("meshes").join(format!("{}.raw", name.chars().map(safe).collect::<String>()))
    }
}

/// A mesh on its way through the tools.
struct Loaded {
    line: MeshLine,
    path: PathBuf,
}

/// Runs the plan; rows go to the results as they are made. With `resume`, rows of the same mesh, tool and version stay.
pub(crate) fn run(plan: &Plan, places: &Places, out: &Out, resume: bool) -> Result<()> {
    std::fs::create_dir_all(out.folder.join("meshes")).with_context(|| out.folder.display().to_string())?;
    let machine = Machine::here(&places.python());
    let entrants = plan.entrants(machine.cores);
    let mut head = vec![Line::Machine(machine)];
    let mut meshes = Vec::new();
    for source in &plan.meshes {
        let mut line =
            MeshLine { mesh: source.name.clone(), origin: source.about.clone(), ..MeshLine::default() };
        match source.load() {
            Ok(raw) => {
                let bytes = raw.bytes();
                (line.digest, line.vertices) = (digest(&bytes), raw.points.len());
                line.triangles = raw.triangles.len();
                let path = out.mesh(&source.name);
                std::fs::write(&path, bytes).with_context(|| path.display().to_string())?;
                meshes.push(Loaded { line: line.clone(), path });
            }
            Err(e) => {
                eprintln!("{}: {e:#}", source.name);
                line.missing = Some(format!("{e:#}"));
            }
        }
        head.push(Line::Mesh(line));
    }
    let mut versions = Vec::new();
    for tool in &plan.tools {
        let version = version(tool, places);
        if let Err(why) = &version {
            eprintln!("{}: {why}", tool.name);
        }
        let (missing, known) = (version.clone().err(), version.clone().ok());
        head.push(Line::Tool(ToolLine { tool: tool.id.to_string(), version: known, missing }));
        versions.push((tool.id, version));
    }
    let old = lines::read(&out.results())?;
    let no_results = old.is_empty();
    let before: Vec<Row> =
        old.into_iter().filter_map(|l| if let Line::Run(r) = l { Some(*r) } else { None }).collect();
    let mut kept: Vec<Row> = Vec::new();
    if resume {
        let current = |r: &Row| versions.iter().any(|v| v.0 == r.tool && v.1.as_ref() == Ok(&r.version));
        let fits = |r: &&Row| current(r) && meshes.iter().any(|m| m.line.digest == r.digest);
        kept.extend(before.iter().filter(fits).cloned());
        eprintln!("{} rows kept", kept.len());
    } else if !no_results {
        let aside = out.folder.join("results.old.jsonl");
        std::fs::rename(out.results(), &aside).with_context(|| aside.display().to_string())?;
    }
    head.extend(kept.iter().map(|r| Line::Run(Box::new(r.clone()))));
    lines::write(&out.results(), &head)?;

    // What there is to do, in order.
    let mut parts = Vec::new();
    for (m, mesh) in meshes.iter().enumerate() {
        for &ratio in &plan.ratios {
            let row = |tool: &Tool, threads, version: &str| Row {
                mesh: mesh.line.mesh.clone(),
                digest: mesh.line.digest.clone(),
                triangles_in: mesh.line.triangles,
                ratio,
                target: ((mesh.line.triangles as f64 * ratio).round() as usize).max(1),
                tool: tool.id.to_string(),
                version: version.to_string(),
                threads,
                ..Row::default()
            };
            let mut group = Vec::new();
            for &(tool, threads) in &entrants {
                let Some((_, Ok(version))) = versions.iter().find(|v| v.0 == tool.id) else { continue };
                let row = row(tool, threads, version);
                if !kept.iter().any(|k| k.same(&row)) {
                    group.push(Entrant { tool, row, costs: vec![], digest: String::new() });
                }
            }
            if !group.is_empty() {
                parts.push((m, ratio, group));
            }
        }
    }
    let todo: Vec<Part> = parts
        .iter()
        .map(|(m, _, group)| Part {
            tools: group.iter().map(|e| e.tool).collect(),
            triangles: meshes[*m].line.triangles,
        })
        .collect();
    let mut pace = Pace::new(&todo, plan.repeat, &before);
    let (start, total) = (Instant::now(), parts.len());
    if total > 0 {
        eprintln!("{total} parts: {}", pace::words(pace.left()));
    }
    let mut original: Option<(usize, Surface)> = None;
    for (done, (m, ratio, group)) in parts.into_iter().enumerate() {
        let mesh = &meshes[m];
        eprintln!(
            "[{done}/{total}, {:.0} s, {} left] {} to {} %",
            start.elapsed().as_secs_f64(),
            pace::words(pace.left()),
            mesh.line.mesh,
            100.0 * ratio
        );
        let now = Instant::now();
        let original = match original.take().filter(|o| o.0 == m) {
            Some(same) => &original.insert(same).1,
            None => &original.insert((m, measures::surface(&Raw::read(&mesh.path)?)?)).1,
        };
        for row in measure_group(group, plan, places, mesh, original, &out.folder)? {
            lines::append(&out.results(), &Line::Run(Box::new(row)))?;
        }
        pace.add(now.elapsed().as_secs_f64());
    }
    eprintln!("measured in {:.0} s", start.elapsed().as_secs_f64());
    Ok(())
}

/// The version of a tool. Ours is this very program, so that rows of another build are not taken for those of this one.
fn version(tool: &Tool, places: &Places) -> Result<String, String> {
    let version = places.version(tool)?;
    if !tool.ours {
        return Ok(version);
    }
    let program = std::env::current_exe().and_then(std::fs::read).map_err(|e| e.to_string())?;
    Ok(format!("{version} ({})", &digest(&program)[..8]))
}

/// A tool with a number of threads, on one mesh at one ratio.
struct Entrant {
    tool: &'static Tool,
    row: Row,
    costs: Vec<Cost>,
    /// Of the result.
    digest: String,
}

/// Lets all take turns `repeat` times, then measures the results.
fn measure_group(
    mut group: Vec<Entrant>,
    plan: &Plan,
    places: &Places,
    mesh: &Loaded,
    original: &Surface,
    folder: &Path,
) -> Result<Vec<Row>> {
    let output = folder.join("result.raw");
    // Results that are the same to the byte are measured once.
    let mut known: Vec<(String, Measures, usize)> = Vec::new();
    for turn in 0..plan.repeat {
        for e in &mut group {
            while e.row.failed.is_none() && e.costs.len() <= turn {
                let job = Job {
                    tool: e.tool,
                    threads: e.row.threads,
                    input: &mesh.path,
                    output: &output,
                    target: e.row.target,
                    parameter: e.row.parameter,
                    limit: plan.limit,
                };
                let cost = match job.run(places)? {
                    Ok(cost) => cost,
                    Err(why) => {
                        eprintln!("  {}: {why}", e.tool.name);
                        e.row.failed = Some(why);
                        continue;
                    }
                };
                e.row.parameter = cost.said.parameter;
                // A run that searched took longer than one that knows.
                if cost.said.rounds.is_none_or(|n| n == 1) {
                    e.costs.push(cost);
                }
            }
            if turn == 0 && e.row.failed.is_none() {
                let bytes = std::fs::read(&output).with_context(|| output.display().to_string())?;
                e.digest = digest(&bytes);
                if let Err(why) = look_at(e, &bytes, &mut known, original, plan.samples) {
                    e.row.failed = Some(format!("{why:#}"));
                }
            }
        }
    }
    Ok(group.into_iter().map(finished).collect())
}

/// Measures a result.
fn look_at(
    e: &mut Entrant,
    bytes: &[u8],
    known: &mut Vec<(String, Measures, usize)>,
    original: &Surface,
    samples: usize,
) -> Result<()> {
    if !known.iter().any(|k| k.0 == e.digest) {
        let result = Raw::from_bytes(bytes)?.used();
        let measures = measures::measure(original, &result, samples)?;
        known.push((e.digest.clone(), measures, result.points.len()));
    }
    if let Some((_, measures, vertices)) = known.iter().find(|k| k.0 == e.digest) {
        e.row.measures = Some(measures.clone());
        e.row.vertices = *vertices;
    }
    Ok(())
}

/// The row of an entrant that has run.
fn finished(e: Entrant) -> Row {
    let mut row = e.row;
    let all = |f: fn(&Cost) -> f64| Runs::of(e.costs.iter().map(f).collect());
    row.call = all(|c| c.said.call_seconds);
    row.arrays = all(|c| c.said.arrays_seconds);
    row.process = all(|c| c.process_seconds);
    let cpu: Vec<f64> = e.costs.iter().filter_map(|c| c.cpu_seconds).collect();
    row.cpu_seconds = crate::stats::median(&cpu);
    row.peak_bytes = e.costs.iter().filter_map(|c| c.said.peak_bytes).max();
    row.triangles = e.costs.first().map_or(0, |c| c.said.triangles);
    row
}
