//! `progmesh generate NAME OUT`.

use super::Failure;
use super::args::{FormatName, Output, positive};
use super::common::{self, Warnings, thousands};
use super::control::Interrupt;
use progmesh::io::grid::GridFormat;
use progmesh::meshes::{self, GenerateOptions};
use progmesh::samples;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

mod landscape;

/// Write a sample mesh: well-formed ones to try things on, hostile ones to see what survives.
///
/// The same name, size and seed give the same mesh on every platform. `terrain --size S` is a landscape of S x S samples, as a mesh or as a
/// height grid: GeoTIFF (f32), PNG (16 bits), HGT, ESRI ASCII (.asc) or raw f32.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh generate --list
  progmesh generate torus torus.glb --faces 100000
  progmesh generate scan scan.ply --seed 7
  progmesh generate terrain hills.tif --size 2049 --seed 1
  progmesh generate quad-sphere - --to obj | progmesh info - --from obj")]
pub(crate) struct Args {
    /// Which mesh; see --list
    #[arg(value_name = "NAME", required_unless_present = "list")]
    name: Option<String>,
    /// The file to write; - for standard output, with --to
    #[arg(value_name = "OUT", required_unless_present = "list")]
    output: Option<PathBuf>,
    /// List the meshes there are
    #[arg(long, exclusive = true)]
    list: bool,
    /// About how many faces; the shape's least number where that is more
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    faces: Option<usize>,
    /// The same as --faces; of a terrain, the samples along a side [default of height grids: 1025]
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true, conflicts_with = "faces")]
    size: Option<usize>,
    /// Which of the many
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Format of OUT, instead of what its name says
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: Option<FormatName>,
    /// Write text where the format has text and binary (PLY, STL)
    #[arg(long)]
    text: bool,
    /// Print one JSON object about the mesh on standard output (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let (Some(name), Some(output)) = (&self.name, &self.output) else {
            return common::print(&list());
        };
        let mut warnings = Warnings::new(self.quiet);
        let grid_format = match self.to {
            None => landscape::format(output),
            Some(_) => None,
        };
        if let (Some(format), "terrain") = (grid_format, name.as_str()) {
            return self.write_grid(output, format);
        }
        let output = Output::new(output.clone(), self.to, self.text);
        output.leave_room_for(self.json)?;
        let format = output.format(&mut warnings)?;
        let mut options = GenerateOptions::default().with_seed(self.seed);
        options.faces = self.faces.or(self.size);
        let sample = match self.size {
            Some(size) if name == "terrain" => landscape::mesh(size, self.seed)?,
            _ => meshes::generate(name, &options).map_err(|e| Failure::Usage(e.to_string()))?,
        };
        let (vertices, faces, triangles) =
            (sample.positions.len(), sample.face_count(), sample.triangle_count());
        let scene = samples::scene(sample, name);
        let interrupt = Interrupt::watch();
        interrupt.be_graceful();
        output.write(format, &scene, &interrupt, &mut warnings)?;
        if !self.quiet {
            // Shapes have sizes in steps, and a least one.
            let asked = options.faces.filter(|_| name != "terrain" || self.size.is_none());
            let far = asked.filter(|&n| faces.abs_diff(n) > n / 4);
            let far = far.map_or(String::new(), |n| {
                format!(" ({} asked for: this mesh has no size nearer to that)", thousands(n))
            });
            let file = output.name();
            common::note(&format!(
                "{file}: {} vertices, {} face{}{far}",
                thousands(vertices),
                thousands(faces),
                if faces == 1 { "" } else { "s" }
            ));
        }
        if self.json {
            common::print_json(&Report {
                command: "generate",
                name,
                seed: self.seed,
                to: format.extension(),
                vertices,
                faces,
                triangles,
                warnings: warnings.all,
            })?;
        }
        Ok(())
    }

    /// A landscape as a height grid.
    fn write_grid(&self, path: &Path, format: GridFormat) -> Result<(), Failure> {
        if self.faces.is_some() {
            return Err(Failure::Usage(
                "a height grid has no faces; say --size, the samples along a side".into(),
            ));
        }
        let size = self.size.unwrap_or(landscape::DEFAULT_SIZE);
        let range = landscape::write(path, format, size, self.seed)?;
        if !self.quiet {
            let [least, greatest] = range;
            let file = path.display();
            let n = thousands(size);
            common::note(&format!("{file}: {n} x {n} samples, {least:.1} to {greatest:.1} m"));
        }
        if self.json {
            common::print_json(&GridReport {
                command: "generate",
                name: "terrain",
                seed: self.seed,
                to: format.name(),
                columns: size,
                rows: size,
                range,
            })?;
        }
        Ok(())
    }
}

/// The schema of `--json` for a height grid; docs/json.md says what each field means.
#[derive(Serialize)]
struct GridReport {
    command: &'static str,
    name: &'static str,
    seed: u64,
    to: &'static str,
    columns: usize,
    rows: usize,
    range: [f64; 2],
}

/// The schema of `--json`; docs/json.md says what each field means.
#[derive(Serialize)]
struct Report<'a> {
    command: &'static str,
    name: &'a str,
    seed: u64,
    to: &'static str,
    vertices: usize,
    faces: usize,
    triangles: usize,
    warnings: Vec<String>,
}

fn list() -> String {
    let mut text = String::new();
    for hostile in [false, true] {
        text += if hostile { "\nHostile:\n" } else { "Well-formed:\n" };
        for e in meshes::names().iter().filter(|e| e.hostile == hostile) {
            let size = match e.default_faces {
                0 => String::new(),
                n => format!("  [{} faces]", thousands(n)),
            };
            let _ = writeln!(text, "  {:<20} {}{size}", e.name, e.about);
        }
    }
    text
}
