//! `progmesh fly IN --path PATH`.

mod geomorph;
mod report;

use super::args::{self, Input};
use super::common::{self, Warnings};
use super::control::Interrupt;
use super::extract::{self, Needs};
use super::method::Making;
use super::{Failure, picture};
use progmesh::io::files;
use progmesh::refine::selective::{Limits, Regulator};
use progmesh::refine::view::Camera;
use progmesh::report::{Picture, Style, Surface, View, render};
use progmesh::selective::{FlightPath, Geomorph, Judge, SelectiveScene, circle, lemniscate, recorded};
use report::{Frame, Measured, Memory, Report};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Fly a camera along a path, refine the mesh for every frame, and report what that took.
///
/// Every frame starts from the mesh of the one before. Times are of refining alone, on one thread. What is measured is the largest
/// lambda * distance / depth over samples of the input that the camera sees from their front, by code that shares nothing with what decides.
#[derive(clap::Args, Debug)]
#[command(after_help = "\
Examples:
  progmesh fly dragon.ply --path circle --measure-every 50
  progmesh fly bunny.pm --path lemniscate --frames 2000 --budget-faces 20000 --json > flight.json
  progmesh fly terrain.obj --path canyon.frames --path-scale 1024 --budget-us 500
  progmesh fly scan.ply --path cams.json --png-every 60 --png-to shots
  progmesh fly dragon.ply --path circle --geomorph=time:20 --measure-every 10

Exit code 1 means: done, but the measured error came above --tau in a frame that had come to rest, with no vertex on the way.")]
pub(crate) struct Args {
    #[command(flatten)]
    input: Input,
    /// circle (one diagonal from the middle, looking at it), lemniscate (above, looking ahead), or a file: a JSON array of cameras (docs/camera.md), or lines
    /// `F id front(3) left(3) up(3) eye(3) zoom`
    #[arg(long, value_name = "PATH")]
    path: String,
    /// Frames of a circle or a lemniscate; of a file at most so many [default: 600, or all of the file]
    #[arg(long, value_name = "N", value_parser = args::positive, allow_negative_numbers = true, help_heading = "Path")]
    frames: Option<usize>,
    /// Factor for the eye's coordinates of a file of `F` lines, which are of a terrain of side 1
    #[arg(long, value_name = "S", value_parser = args::not_negative, default_value = "1",
          allow_negative_numbers = true, help_heading = "Path")]
    path_scale: f64,
    #[command(flatten)]
    needs: Needs,
    /// End refining a frame after this many microseconds; the next goes on
    #[arg(long, value_name = "US", value_parser = args::positive, allow_negative_numbers = true, help_heading = "View")]
    budget_us: Option<usize>,
    /// Keep what is not needed until it is not needed at this times the tolerance either, 0.1 to 1
    #[arg(long, value_name = "H", value_parser = hysteresis, default_value = "1", allow_negative_numbers = true,
          help_heading = "View")]
    hysteresis: f64,
    /// Let changes that can be seen show themselves smoothly: time[:FRAMES] or error[:BAND] [default: time:12]
    ///
    /// time: vertices move to their new places over so many frames, and what is undone stays for as long. error: a vertex begins to move where its error could take up
    /// tau / BAND and is in place at tau, which takes the faces of tau / BAND; BAND is more than 1 and 2 if not said. What is out of sight jumps.
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "time",
          value_parser = geomorph::parse, help_heading = "View")]
    geomorph: Option<Geomorph>,
    /// Measure the error that is shown on every Kth frame
    #[arg(long, value_name = "K", value_parser = args::positive, allow_negative_numbers = true, help_heading = "Report")]
    measure_every: Option<usize>,
    /// Samples of the input to measure at
    #[arg(long, value_name = "N", value_parser = args::positive, default_value = "100000",
          allow_negative_numbers = true, help_heading = "Report")]
    samples: usize,
    /// Draw every Kth frame, as the camera sees it
    #[arg(long, value_name = "K", value_parser = args::positive, allow_negative_numbers = true, help_heading = "Report")]
    png_every: Option<usize>,
    /// Where pictures go: a directory, made if need be, for frame00000.png, ...
    #[arg(
        long,
        value_name = "DIR",
        default_value = "frames",
        requires = "png_every",
        help_heading = "Report"
    )]
    png_to: PathBuf,
    #[command(flatten)]
    making: Making,
    /// Print one JSON object about the flight on standard output (see docs/json.md)
    #[arg(long)]
    json: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

/// Frames of a path that does not say.
const FRAMES: usize = 600;

fn hysteresis(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.1..=1.0).contains(&x) => Ok(x),
        _ => Err("must be a number from 0.1 to 1".into()),
    }
}

impl Args {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let mut warnings = Warnings::new(self.quiet);
        let file = self.input.name();
        // Before any work is done.
        let bytes = match self.path.as_str() {
            "circle" | "lemniscate" => Vec::new(),
            path => files::read_all(Path::new(path)).map_err(|e| Failure::Input(format!("{path}: {e}")))?,
        };
        if self.png_every.is_some() {
            picture::make_directory(&self.png_to)?;
        }
        let interrupt = Interrupt::watch();
        let mut report = common::in_pool(self.making.collapsing.threads, || {
            let made = extract::make(&self.input, &self.making, self.quiet, &interrupt, &mut warnings)?;
            let path = self.cameras(&made.scene, &bytes)?;
            let (seconds, mut scene) = ([made.read, made.bounds], made.scene);
            scene.set_geomorph(self.geomorph);
            let frames = self.fly(&mut scene, &path, &interrupt)?;
            if frames.iter().all(|f| f.visible_vertices == 0) {
                let (lo, hi) = scene.bounds().unwrap_or_default();
                return Err(Failure::Input(format!(
                    "{}: no frame sees anything of {file}, which reaches from {lo} to {hi}: the path is elsewhere \
                     (--path-scale multiplies its coordinates)",
                    self.path
                )));
            }
            let [shared, shown, tables] = scene.bytes();
            let vertices = scene.full_vertices();
            let largest = frames.iter().map(|f| f.vertices).max().unwrap_or(0);
            let memory = Memory {
                shared_bytes: shared,
                shared_bytes_per_vertex: shared as f64 / vertices.max(1) as f64,
                view_bytes: shown,
                view_table_bytes: tables,
                most_vertices: largest,
            };
            Ok(Report::new(self.path.clone(), self.needs.tau, scene.full_faces(), frames, memory, seconds))
        })?;
        report.warnings = warnings.all;
        if !self.quiet {
            report.text(&file).iter().for_each(|line| common::note(line));
        }
        if self.json {
            common::print_json(&report)?;
        }
        match report.above {
            0 => Ok(()),
            n => Err(Failure::Missed(format!(
                "{file}: the measured error is above the tolerance in {n} of the frames measured at rest"
            ))),
        }
    }

    fn cameras(&self, scene: &SelectiveScene, bytes: &[u8]) -> Result<FlightPath, Failure> {
        let bounds = scene.bounds();
        let file = self.input.name();
        let Some((lo, hi)) = bounds.filter(|(lo, hi)| (*hi - *lo).length() > 0.0) else {
            return Err(Failure::Input(format!("{file}: nothing is shown that one could fly about")));
        };
        let frames = self.frames.unwrap_or(FRAMES);
        let path = match self.path.as_str() {
            "circle" => circle((lo, hi), frames),
            "lemniscate" => lemniscate((lo, hi), frames),
            _ => recorded(bytes, self.path_scale, (hi - lo).length()),
        };
        let mut path = path.map_err(|e| Failure::Input(format!("{}: {e}", self.path)))?;
        path.truncate(self.frames.unwrap_or(usize::MAX));
        Ok(path)
    }

    fn fly(
        &self,
        scene: &mut SelectiveScene,
        path: &[Camera],
        interrupt: &Interrupt,
    ) -> Result<Vec<Frame>, Failure> {
        let file = self.input.name();
        let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{file}: {e}"));
        let judge = match self.measure_every {
            Some(_) => Some(Judge::new(scene, self.samples).map_err(|e| failed(&e))?),
            None => None,
        };
        let mut regulator = self.needs.budget_faces.map(|n| Regulator::new(n, self.needs.tau));
        let mut frames = Vec::with_capacity(path.len());
        scene.take_changes();
        for (k, camera) in path.iter().enumerate() {
            if interrupt.is_set() {
                return Err(Failure::Interrupted);
            }
            let tau = regulator.as_ref().map_or(self.needs.tau, |r| r.tau());
            let start = Instant::now();
            let end = self.budget_us.map(|us| start + Duration::from_micros(us as u64));
            let expired = || end.is_some_and(|end| Instant::now() >= end);
            let limits = Limits {
                faces: self.needs.budget_faces.unwrap_or(usize::MAX),
                expired: end.is_some().then_some(&expired as &dyn Fn() -> bool),
                hysteresis: self.hysteresis,
                ..Limits::default()
            };
            let done = scene.adapt(camera, tau, self.needs.cull(), &limits).map_err(|e| failed(&e))?;
            let us = start.elapsed().as_secs_f64() * 1e6;
            if let Some(r) = &mut regulator {
                r.note(scene.needed_faces(), done.complete);
            }
            let changes = scene.take_changes();
            let measured = match &judge {
                Some(j) if k % self.measure_every.unwrap_or(1) == 0 => {
                    let m = j.measure(scene, camera).map_err(|e| failed(&e))?;
                    Some(Measured {
                        samples: m.visible,
                        max_pixels: m.max_pixels,
                        mean_pixels: m.mean_pixels,
                    })
                }
                _ => None,
            };
            if self.png_every.is_some_and(|n| k % n == 0) {
                self.draw(scene, camera, k)?;
            }
            frames.push(Frame {
                faces: scene.face_count(),
                vertices: scene.vertex_count(),
                vsplits: done.splits,
                ecols: done.collapses,
                us,
                tau: tau.is_finite().then_some(tau),
                complete: done.complete,
                morphing: scene.morphing(),
                visible_vertices: scene.visible_vertices(camera),
                dirty_index_bytes: changes.iter().map(|c| c.index_bytes()).sum(),
                dirty_wedges: changes.iter().map(|c| c.wedges.len()).sum(),
                measured,
            });
        }
        Ok(frames)
    }

    fn draw(&self, scene: &SelectiveScene, camera: &Camera, k: usize) -> Result<(), Failure> {
        let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{}: {e}", self.input.name()));
        let surface = Surface::of(&scene.to_scene()).map_err(|e| failed(&e))?;
        let picture: Picture = render(&surface, &View::of_camera(camera), &Style::default());
        let path = self.png_to.join(format!("frame{k:05}.png"));
        let bytes = picture.png().ok_or_else(|| failed(&"a picture could not be encoded"))?;
        common::write_bytes(&path, &bytes)
    }
}
