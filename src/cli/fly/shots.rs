//! `--png-every`, `--apng`: pictures of a flight.

use super::super::common::{self, thousands};
use super::super::{Failure, args, picture};
use super::flight::Step;
use super::path::Course;
use glam::DVec3;
use progmesh::refine::view::Camera;
use progmesh::report::{Picture, apng};
use progmesh::scene::Scene;
use progmesh::selective::{ShotStyle, shot};
use std::path::PathBuf;

/// Pictures of a flight.
#[derive(clap::Args, Debug)]
pub(super) struct ShotArgs {
    /// Draw every Kth frame, as the camera sees it [default with --apng: so that there are 60 at most]
    #[arg(long, value_name = "K", value_parser = args::positive, allow_negative_numbers = true, help_heading = "Pictures")]
    png_every: Option<usize>,
    /// Where pictures go: a directory, made if need be, for frame00000.png, ... [default: frames, without --apng]
    #[arg(long, value_name = "DIR", requires = "png_every", help_heading = "Pictures")]
    png_to: Option<PathBuf>,
    /// Draw an animated PNG, with an inset from above: the faces with their edges, and what the camera sees
    #[arg(long, value_name = "FILE.png", value_parser = picture::png_name, help_heading = "Pictures")]
    apng: Option<PathBuf>,
    /// Pixels across [default: as the camera has, at most 480 with --apng]
    #[arg(long, value_name = "W", value_parser = args::positive, allow_negative_numbers = true, help_heading = "Pictures")]
    png_width: Option<usize>,
    /// Draw the edges of the faces
    #[arg(long, help_heading = "Pictures")]
    wireframe: bool,
    /// Put the inset into the pictures of --png-every too
    #[arg(long, help_heading = "Pictures")]
    inset: bool,
}

/// Pictures of an animation that does not say.
const PICTURES: usize = 60;
/// Its width.
const WIDTH: u32 = 480;
/// The least and the largest side.
const SIDES: [usize; 2] = [16, 16384];
/// Pixels of an animation, all pictures together, that are held.
const MOST_PIXELS: usize = 1 << 28;
/// A second of a flight is so many frames.
const RATE: f64 = 30.0;
const INK: [u8; 3] = [64; 3];

/// Pictures under way.
pub(super) struct Shots<'a> {
    arguments: &'a ShotArgs,
    every: Option<usize>,
    /// Where single pictures go.
    directory: Option<PathBuf>,
    style: ShotStyle,
    pictures: Vec<Picture>,
}

impl ShotArgs {
    /// Fails, before any work is done, where nothing could be written.
    pub(super) fn check(&self) -> Result<(), Failure> {
        if let Some(w) = self.png_width.filter(|w| !(SIDES[0]..=SIDES[1]).contains(w)) {
            return Err(Failure::Usage(format!("--png-width {w}: must be {} to {}", SIDES[0], SIDES[1])));
        }
        if let Some(path) = &self.apng {
            common::check_target(path)?;
        }
        self.directory().as_deref().map_or(Ok(()), picture::make_directory)
    }

    fn directory(&self) -> Option<PathBuf> {
        let default = || (self.png_every.is_some() && self.apng.is_none()).then(|| "frames".into());
        self.png_to.clone().or_else(default)
    }

    pub(super) fn start(&self, course: &Course<'_>) -> Shots<'_> {
        let every =
            self.png_every.or(self.apng.as_ref().map(|_| course.cameras.len().div_ceil(PICTURES).max(1)));
        let mut style = ShotStyle::default();
        style.wireframe = self.wireframe;
        style.inset = self.inset || self.apng.is_some();
        style.up = course.up();
        style.width = self.png_width.and_then(|w| u32::try_from(w).ok());
        Shots { arguments: self, every, directory: self.directory(), style, pictures: Vec::new() }
    }
}

impl Shots<'_> {
    /// Draws a frame, if it is its turn.
    pub(super) fn take(&mut self, step: &Step<'_>) -> Result<(), Failure> {
        let scene = step.scene;
        self.draw(step.number, step.camera, || (scene.to_scene(), scene.bounds(), scene.face_count()))
    }

    /// Draws frame `number` as `camera` sees it, if it is its turn. `shown` is asked for the scene then, for what it reaches over at full detail, and for its faces.
    pub(super) fn draw(
        &mut self,
        number: usize,
        camera: &Camera,
        shown: impl FnOnce() -> (Scene, Option<(DVec3, DVec3)>, usize),
    ) -> Result<(), Failure> {
        if self.every.is_none_or(|n| !number.is_multiple_of(n)) {
            return Ok(());
        }
        let mut style = self.style;
        if self.arguments.apng.is_some() {
            style.width = Some(style.width.unwrap_or(WIDTH.min(camera.width())));
        }
        let place = self.directory.as_ref().map(|d| d.join(format!("frame{number:05}.png")));
        let name = place.as_ref().or(self.arguments.apng.as_ref()).map(|p| p.display().to_string());
        let failed = |e: &dyn std::fmt::Display| {
            Failure::Output(format!("{}: {e}", name.as_deref().unwrap_or_default()))
        };
        let (scene, bounds, faces) = shown();
        let mut picture = shot(&scene, bounds, camera, &style).map_err(|e| failed(&e))?;
        if let Some(path) = &place {
            let bytes = picture.png().ok_or_else(|| failed(&"a picture could not be encoded"))?;
            common::write_bytes(path, &bytes)?;
        }
        if self.arguments.apng.is_some() {
            picture.caption(&format!("{} faces", thousands(faces)), INK);
            let pixels = picture.width() as usize * picture.height() as usize;
            if pixels * (self.pictures.len() + 1) > MOST_PIXELS {
                return Err(failed(&format!(
                    "more than {} pixels in all: draw fewer pictures (--png-every) or smaller ones (--png-width)",
                    thousands(MOST_PIXELS)
                )));
            }
            self.pictures.push(picture);
        }
        Ok(())
    }

    /// Writes the animation.
    pub(super) fn write(self) -> Result<(), Failure> {
        let Some(path) = &self.arguments.apng else { return Ok(()) };
        let every = self.every.unwrap_or(1) as f64;
        let milliseconds = (every * 1000.0 / RATE).round().clamp(20.0, 500.0) as u16;
        let bytes = apng(&self.pictures, milliseconds).ok_or_else(|| {
            Failure::Output(format!(
                "{}: the cameras of the path have pictures of several sizes, of which there is no animation",
                path.display()
            ))
        })?;
        common::write_bytes(path, &bytes)
    }
}
