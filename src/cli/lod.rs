//! `progmesh lod IN OUT.glb`.

use super::Failure;
use super::args::{self, Input, Output};
use super::common::{self, Warnings, short, thousands};
use super::control::{Interrupt, Progress};
use super::method::Making;
use super::picture::{Drawing, PictureArgs};
use progmesh::io::gltf::encode_levels;
use progmesh::io::{Format, files};
use progmesh::pipeline::build_progressive;
use progmesh::progressive::{Detail, ProgressiveScene};
use progmesh::scene::Scene;
use progmesh::simplify::Stop;
use serde::Serialize;
use std::path::PathBuf;

/// Write a mesh at several levels of detail: one glTF with MSFT_lod, or a file for each.
///
/// The finest level is the input itself. A viewer that does not know MSFT_lod shows that, and nothing else. MSFT_screencoverage says from which part of
/// the screen upwards each level is meant; the coarsest stays, however small it becomes. All levels come of one simplification; of a .pm they
/// are its own.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh lod scene.glb levels.glb --levels 0.5,0.25,0.1
  progmesh lod bunny.pm bunny.glb --levels 10000,1000 --coverage 0.4,0.1
  progmesh lod scan.ply scan.glb --levels 0.5,0.1 --separate")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// The file to write, .glb or .gltf
    #[arg(value_name = "OUT.glb")]
    output: PathBuf,
    /// The levels below the input, finest first: parts of its triangles (0 to 1), or numbers of triangles
    #[arg(long, value_name = "L,L,...", value_parser = level, value_delimiter = ',', required = true)]
    levels: Vec<Level>,
    /// For each level but the coarsest, the part of the screen down to which it is shown, largest first [default: as
    /// many triangles to the pixel at every level, the input down to half the first level's part]
    #[arg(long, value_name = "C,C,...", value_parser = args::fraction, value_delimiter = ',')]
    coverage: Vec<f64>,
    /// A file for each level instead of one: OUT.lod0.glb (the input), OUT.lod1.glb, ...
    #[arg(long, conflicts_with = "coverage")]
    separate: bool,
    #[command(flatten)]
    making: Making,
    #[command(flatten)]
    picture: PictureArgs,
    /// Print one JSON object about the run on standard output (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Level {
    Part(f64),
    Triangles(usize),
}

fn level(text: &str) -> Result<Level, String> {
    let wrong =
        || "must be a part of the triangles, above 0 and below 1, or a number of them, above 1".to_string();
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x < 1.0 => Ok(Level::Part(x)),
        _ => args::whole(text).ok().filter(|&n| n > 1).map(Level::Triangles).ok_or_else(wrong),
    }
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let job = self.making.job()?;
        let output = Output::new(self.output.clone(), None, false);
        output.leave_room_for(self.json)?;
        let mut warnings = Warnings::new(self.quiet);
        let format = output.format(&mut warnings)?;
        if !matches!(format, Format::Glb | Format::Gltf) || files::is_dash(&self.output) {
            return Err(Failure::Usage(format!("{}: levels are written as .glb or .gltf", output.name())));
        }
        if !self.coverage.is_empty() && self.coverage.len() != self.levels.len() {
            return Err(Failure::Usage(format!(
                "--coverage: {} numbers for {} levels below the input; give one for each level but the coarsest",
                self.coverage.len(),
                self.levels.len()
            )));
        }
        if !self.coverage.is_sorted_by(|a, b| a > b) {
            return Err(Failure::Usage("--coverage: the largest comes first".into()));
        }
        let mut drawing = self.picture.drawing()?;
        let file = self.input.name();
        let interrupt = Interrupt::watch();
        let report = common::in_pool(self.making.collapsing.threads, || {
            let mut read = self.input.read_or_make(&mut warnings, |scene, warnings| {
                interrupt.be_graceful();
                let progress = Progress::new(&interrupt, self.quiet, "simplifying");
                let built = build_progressive(scene, &job, &progress)
                    .map_err(|e| Failure::Input(format!("{file}: {e}")))?;
                if built.stop == Stop::Cancelled {
                    return Err(Failure::Interrupted);
                }
                warnings.say(built.warnings.iter().map(|w| format!("{file}: {w}")));
                Ok(built.scene)
            })?;
            interrupt.be_graceful();
            if self.input.progressive_path().is_some() {
                read.sort_by_error();
            }
            let scenes = self.scenes(&read, &file, &interrupt, &mut warnings)?;
            if let Some(d) = &mut drawing {
                // All levels side by side, from one camera.
                scenes.iter().try_for_each(|s| d.add(s))?;
            }
            let report = self.write(&scenes, &output, format, &interrupt, &mut warnings)?;
            drawing.as_mut().map_or(Ok(()), Drawing::write)?;
            Ok(report)
        })?;
        let report = Report { warnings: warnings.all, ..report };
        if !self.quiet {
            let each: Vec<String> = report
                .levels
                .iter()
                .map(|l| match l.coverage {
                    Some(c) => format!(
                        "{} triangles from {} % of the screen",
                        thousands(l.triangles),
                        short(100.0 * c)
                    ),
                    None => format!("{} triangles", thousands(l.triangles)),
                })
                .collect();
            common::note(&format!("{file}: {}", each.join("; ")));
        }
        if self.json { common::print_json(&report) } else { Ok(()) }
    }

    /// The levels, finest first.
    fn scenes(
        &self,
        read: &ProgressiveScene,
        file: &str,
        interrupt: &Interrupt,
        warnings: &mut Warnings,
    ) -> Result<Vec<Scene>, Failure> {
        let full = read.triangles();
        let mut scenes: Vec<Scene> = Vec::new();
        let details = self.levels.iter().map(|l| match *l {
            Level::Part(r) => Detail::Triangles((r * full as f64).round() as usize),
            Level::Triangles(n) => Detail::Triangles(n),
        });
        for detail in std::iter::once(Detail::Full).chain(details) {
            let scene = read.at(&read.positions(detail));
            let scene = scene.map_err(|(m, e)| Failure::Input(format!("{file}: mesh {m}: {e}")))?;
            let have = scene.unique_triangles();
            if let Detail::Triangles(n) = detail
                && have > n
            {
                let (have, n) = (thousands(have), thousands(n));
                warnings.say([format!("{file}: the base has {have} triangles, more than the {n} asked for")]);
            }
            if scenes.last().is_some_and(|s: &Scene| s.unique_triangles() <= have) {
                return Err(Failure::Usage(format!(
                    "--levels: each must have fewer triangles than the one before; here {} follow {}",
                    thousands(have),
                    thousands(scenes.last().map_or(0, Scene::unique_triangles))
                )));
            }
            scenes.push(scene);
            if interrupt.is_set() {
                return Err(Failure::Interrupted);
            }
        }
        Ok(scenes)
    }

    /// Writes them, and says what was written.
    fn write(
        &self,
        scenes: &[Scene],
        output: &Output,
        format: Format,
        interrupt: &Interrupt,
        warnings: &mut Warnings,
    ) -> Result<Report, Failure> {
        let triangles: Vec<usize> = scenes.iter().map(Scene::unique_triangles).collect();
        let mut levels: Vec<LevelReport> = triangles
            .iter()
            .map(|&triangles| LevelReport { triangles, coverage: None, file: None })
            .collect();
        if self.separate {
            for (k, (scene, level)) in scenes.iter().zip(&mut levels).enumerate() {
                let path = self.output.with_extension(format!("lod{k}.{}", format.extension()));
                Output::new(path.clone(), None, false).write(format, scene, interrupt, warnings)?;
                level.file = Some(path.display().to_string());
            }
        } else {
            let coverage = self.thresholds(&triangles);
            let options = files::encode_options(&self.output, false);
            let encoded = encode_levels(scenes, &coverage, format, &options);
            let encoded = encoded.map_err(|e| Failure::Output(format!("{}: {e}", output.name())))?;
            common::write_encoded(&self.output, format, &encoded, interrupt, warnings)?;
            levels.iter_mut().zip(coverage).for_each(|(l, c)| l.coverage = Some(c));
        }
        Ok(Report { command: "lod", to: format.extension(), levels, warnings: vec![] })
    }

    /// From which part of the screen upwards each level is meant.
    fn thresholds(&self, triangles: &[usize]) -> Vec<f64> {
        if !self.coverage.is_empty() {
            return self.coverage.iter().copied().chain([0.0]).collect();
        }
        // The next level takes over where it has as many triangles to the pixel as the input has on half a screen.
        let full = triangles.first().copied().unwrap_or(1).max(1) as f64;
        let next = triangles.iter().skip(1).map(|&t| 0.5 * t as f64 / full);
        next.chain([0.0]).collect()
    }
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report {
    command: &'static str,
    to: &'static str,
    levels: Vec<LevelReport>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct LevelReport {
    triangles: usize,
    coverage: Option<f64>,
    file: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_parts_or_counts() {
        assert_eq!(level("0.5"), Ok(Level::Part(0.5)));
        assert_eq!(level("1e3"), Ok(Level::Triangles(1000)));
        for wrong in ["0", "1", "-1", "1.5", "nan", ""] {
            assert!(level(wrong).is_err(), "{wrong}");
        }
    }
}
