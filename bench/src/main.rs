//! progmesh beside its peers. `bench/run` is the way in: it installs the peers, builds this program and calls it.

mod check;
mod child;
mod heats;
mod instructions;
mod kernels;
mod lines;
mod machine;
mod measures;
mod meshes;
mod one;
mod pace;
mod page;
mod plan;
mod plot;
mod raw;
mod results;
mod run;
mod stats;
mod table;
mod terrain;
mod tools;
mod validate;

use anyhow::{Context, Result, ensure};
use clap::{Args, Parser, Subcommand};
use plan::{Plan, Wanted};
use run::Out;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tools::Places;

#[derive(Parser)]
#[command(name = "progmesh-bench", about = "progmesh beside its peers: time, memory and measured error")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Measure, then write the tables and the report.
    Run(Run),
    /// Measure networks of height grids, then write the tables and the report of all that was measured.
    Terrain(Terrain),
    /// Write the tables and the report of what was measured before.
    Report(Report),
    /// Let MeshLab compute our published mean and rms again; exit code 1 if they differ.
    Check(Check),
    /// Make every GLB that the documents mention, and show it to the glTF validator; exit code 1 if one has errors.
    Validate(Validate),
    /// Count instructions of kernels, beside those of the last count; exit code 1 if one grew by 2 %.
    Instructions(Where),
    /// One run of a kernel.
    Kernel {
        /// Which.
        name: String,
    },
    /// One run of a tool of this process: raw mesh in, raw mesh out, a line of JSON on standard output.
    One(One),
}

#[derive(Args)]
struct Where {
    /// Folder for results. Default: bench/out.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Folder of the peers. Default: bench/.env.
    #[arg(long)]
    env: Option<PathBuf>,
}

#[derive(Args)]
struct Report {
    /// Also put the summary into README.md and the plot into docs/.
    #[arg(long)]
    publish: bool,
    #[command(flatten)]
    places: Where,
}

#[derive(Args)]
struct Run {
    /// Fewer meshes and ratios: minutes.
    #[arg(long, conflicts_with_all = ["full", "data"])]
    quick: bool,
    /// All meshes at all ratios. The default.
    #[arg(long)]
    full: bool,
    /// The meshes of this folder, instead of those of packages and the generated ones.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Only these meshes, tools (or ours, peers) and ratios (10%).
    #[arg(long, value_delimiter = ',', value_name = "WORDS")]
    only: Vec<String>,
    /// Runs of each, of which the median counts [default: 5].
    #[arg(long, value_name = "N")]
    repeat: Option<usize>,
    /// Also put the summary into README.md and the plot into docs/.
    #[arg(long)]
    publish: bool,
    /// Keep the rows of an earlier run that are of the same mesh, tool and version.
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    places: Where,
}

#[derive(Args)]
struct Terrain {
    /// A small landscape only.
    #[arg(long, conflicts_with = "data")]
    quick: bool,
    /// The height grids of this folder, instead of the generated ones.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Errors in the grids' units [default: a 50th, a 150th and a 500th of the range of each].
    #[arg(long, value_delimiter = ',', value_name = "E")]
    errors: Vec<f64>,
    /// Runs of each, of which the median counts.
    #[arg(long, value_name = "N", default_value_t = 3)]
    repeat: usize,
    #[command(flatten)]
    places: Where,
}

#[derive(Args)]
struct Check {
    /// Only the meshes of a quick run.
    #[arg(long)]
    quick: bool,
    /// Only these meshes, tools, ratios: bunny,quadric,10%.
    #[arg(long, value_delimiter = ',', value_name = "WORDS")]
    only: Vec<String>,
    #[command(flatten)]
    places: Where,
}

#[derive(Args)]
struct Validate {
    /// The program progmesh.
    program: PathBuf,
    #[command(flatten)]
    places: Where,
}

#[derive(Args)]
struct One {
    tool: String,
    input: PathBuf,
    output: PathBuf,
    /// Triangles to leave.
    target: usize,
    /// What an earlier run searched for.
    parameter: Option<f64>,
}

impl Where {
    fn places(&self) -> (Places, Out) {
        let bench = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
        let env = self.env.clone().unwrap_or_else(|| bench.join(".env"));
        let folder = self.out.clone().unwrap_or_else(|| bench.join("out"));
        (Places { env, bench }, Out { folder })
    }
}

fn main() -> ExitCode {
    match command(Cli::parse().command) {
        Ok(code) => code,
        Err(e) => {
            eprintln!("error: {e:#}");
            ExitCode::FAILURE
        }
    }
}

fn command(command: Command) -> Result<ExitCode> {
    match command {
        Command::Run(r) => {
            let (places, out) = r.places.places();
            let wanted = Wanted { quick: r.quick, data: r.data, only: r.only, repeat: r.repeat };
            run::run(&Plan::new(&wanted, &places.env)?, &places, &out, r.resume)?;
            report(&places, &out, r.publish)?;
        }
        Command::Terrain(t) => {
            let (places, out) = t.places.places();
            std::fs::create_dir_all(&out.folder)?;
            let wanted = terrain::Wanted { quick: t.quick, data: t.data, errors: t.errors, repeat: t.repeat };
            if lines::read(&out.results())?.is_empty() {
                lines::append(
                    &out.results(),
                    &lines::Line::Machine(machine::Machine::here(&places.python())),
                )?;
            }
            let row = |row| lines::append(&out.results(), &lines::Line::Terrain(row));
            terrain::run(&wanted, &places, &out.folder.join("terrain"), row)?;
            report(&places, &out, false)?;
        }
        Command::Report(r) => {
            let (places, out) = r.places.places();
            report(&places, &out, r.publish)?;
        }
        Command::Check(c) => {
            let (places, out) = c.places.places();
            let text = std::fs::read_to_string(places.bench.join(PUBLISHED)).unwrap_or("[]".into());
            let published: Vec<check::Published> = serde_json::from_str(&text).context(PUBLISHED)?;
            ensure!(!published.is_empty(), "nothing was published yet: bench/run --publish");
            let only = check::Only::new(&c.only, &published)?;
            return Ok(good(check::check(&places, &published, &only, c.quick, &out.folder)?));
        }
        Command::Validate(v) => {
            let (places, out) = v.places.places();
            return Ok(good(validate::validate(&places, &v.program, &out.folder.join("docs"))?));
        }
        Command::Instructions(w) => {
            let out = w.places().1;
            std::fs::create_dir_all(&out.folder)?;
            return Ok(good(instructions::count(&out.folder.join("instructions.json"), &out.folder)?));
        }
        Command::Kernel { name } => println!("{}", instructions::run_kernel(&name)?),
        Command::One(o) => {
            let mesh = raw::Raw::read(&o.input)?;
            let (result, mut said) = one::run(&o.tool, &mesh, o.target, o.parameter)?;
            result.write(&o.output)?;
            said.peak_bytes = progmesh::io::files::peak_bytes();
            println!("{}", serde_json::to_string(&said)?);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What was published of our own results, in `bench/`.
const PUBLISHED: &str = "published.json";

fn good(all: bool) -> ExitCode {
    if all { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Writes everything that is made of the results.
fn report(places: &Places, out: &Out, publish: bool) -> Result<()> {
    let all = results::Results::of(lines::read(&out.results())?);
    ensure!(
        !(all.rows.is_empty() && all.terrain.is_empty()),
        "{}: nothing was measured",
        out.results().display()
    );
    put(&out.folder.join("table.md"), &table::markdown(&all))?;
    put(&out.folder.join("report.html"), &page::html(&all, &heats::heats(&all, out)?))?;
    if publish {
        let root = places.bench.join("..");
        let readme = root.join("README.md");
        let text = std::fs::read_to_string(&readme).with_context(|| readme.display().to_string())?;
        let text =
            table::spliced(&text, &table::summary(&all)).context("README.md has no marks for the table")?;
        let shown = table::shown(&all);
        let published = check::published(&all, &table::SHOWN_RATIOS, &shown);
        put(&places.bench.join(PUBLISHED), &(serde_json::to_string_pretty(&published)? + "\n"))?;
        put(&root.join("docs/bench.svg"), &page::picture(&all))?;
        put(&readme, &text)?;
    }
    Ok(())
}

fn put(path: &Path, text: &str) -> Result<()> {
    std::fs::write(path, text).with_context(|| path.display().to_string())?;
    eprintln!("{}", path.display());
    Ok(())
}
