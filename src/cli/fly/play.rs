//! `--html`: a page that plays the flight.

use super::super::common::{self, short};
use super::super::{Failure, args};
use super::pace::Timed;
use progmesh::refine::selective::Done;
use progmesh::refine::view::Camera;
use progmesh::selective::{FrameCounts, RecordError, Recordable, Recorder, player_page};
use std::path::PathBuf;

/// A page that plays the flight.
#[derive(clap::Args, Debug)]
pub(super) struct PlayArgs {
    /// Write one HTML file that plays the flight in a browser (WebGL 2): as the camera sees it or from outside, with its frustum; nothing else is needed
    #[arg(long, value_name = "FILE.html", help_heading = "Page")]
    html: Option<PathBuf>,
    /// Record the flight at these multiples of --tau too, for the page's slider: each is flown once more
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = multiple, default_value = "0.5,1,2,4,8",
          requires = "html", allow_negative_numbers = true, help_heading = "Page")]
    html_taus: Vec<f64>,
    /// Record at most so many frames, evenly
    #[arg(long, value_name = "N", value_parser = args::positive, default_value = "600",
          requires = "html", allow_negative_numbers = true, help_heading = "Page")]
    html_frames: usize,
    /// The largest page, MiB
    #[arg(long, value_name = "MIB", value_parser = args::positive, default_value = "32",
          requires = "html", allow_negative_numbers = true, help_heading = "Page")]
    html_max: usize,
}

fn multiple(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("must be multiples of --tau above 0, such as 0.5,1,2".into()),
    }
}

/// What a page has besides the flight: script, style, base64's line.
const PAGE: usize = 64 << 10;

impl PlayArgs {
    /// A flag that was given, if any was.
    pub(super) fn given(&self) -> Option<&'static str> {
        self.html.as_ref().map(|_| "--html")
    }

    /// Fails where the page could not be written.
    pub(super) fn check(&self) -> Result<(), Failure> {
        self.html.as_deref().map_or(Ok(()), common::check_target)
    }

    /// The tolerances to fly once more. None are for one of 0 or infinity, of which multiples are the same.
    pub(super) fn others(&self, tau: f64) -> Vec<f64> {
        let mut all: Vec<f64> = self.html_taus.iter().map(|m| m * tau).collect();
        all.retain(|t| t.is_finite() && *t != tau);
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }

    pub(super) fn start<R: Recordable>(&self, scene: &R, path: &[Camera], name: &str) -> Option<Playing<'_>> {
        self.html.as_ref()?;
        let stride = path.len().div_ceil(self.html_frames).max(1);
        // Base64 takes four bytes for three.
        let limit = ((self.html_max << 20).saturating_sub(PAGE)) / 4 * 3;
        let recorder = Recorder::new(scene, path, stride, limit, name);
        Some(Playing { arguments: self, recorder, stride, frames: path.len(), name: name.into() })
    }
}

/// A page in the making.
pub(super) struct Playing<'a> {
    arguments: &'a PlayArgs,
    recorder: Recorder,
    stride: usize,
    frames: usize,
    name: String,
}

impl Playing<'_> {
    pub(super) fn begin(&mut self, tau: f64, asked: bool) -> Result<(), Failure> {
        self.recorder.begin(tau, asked).map_err(|e| self.failed(&e))
    }

    /// Frame `number`, once it has been refined.
    pub(super) fn take<R: Recordable>(
        &mut self,
        number: usize,
        (scene, changes): (&R, &[R::Changes]),
        timed: &Timed<Done>,
    ) -> Result<(), Failure> {
        let Timed { done, tau, .. } = *timed;
        let counts = FrameCounts { splits: done.splits, collapses: done.collapses, tau };
        self.recorder.note(scene, changes);
        if !number.is_multiple_of(self.stride) {
            self.recorder.skip(&counts);
            return Ok(());
        }
        self.recorder.frame(scene, &counts).map_err(|e| self.failed(&e))
    }

    pub(super) fn write<R: Recordable>(self, scene: &R) -> Result<(), Failure> {
        let Some(path) = &self.arguments.html else { return Ok(()) };
        let (stride, frames) = (self.stride, self.frames);
        let failed = |e: &RecordError| failure(self.arguments, e, stride, frames);
        let recording = self.recorder.finish(scene).map_err(|e| failed(&e))?;
        common::write_bytes(path, player_page(&recording, &self.name).as_bytes())
    }

    fn failed(&self, e: &RecordError) -> Failure {
        failure(self.arguments, e, self.stride, self.frames)
    }
}

fn failure(arguments: &PlayArgs, e: &RecordError, stride: usize, frames: usize) -> Failure {
    let name = arguments.html.as_deref().unwrap_or(std::path::Path::new("")).display();
    Failure::Output(match e {
        RecordError::TooLarge { frame, tau, .. } => format!(
            "{name}: the page would be larger than --html-max {} MiB: that is reached in frame {} at a tolerance of {} pixels. \
             Record fewer frames (--html-frames {}), fewer or coarser tolerances (--html-taus 1,4; --tau), or allow more",
            arguments.html_max,
            frame * stride,
            short(*tau),
            (frames.div_ceil(stride) / 2).max(1)
        ),
        e => format!("{name}: {e}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multiples_are_above_0() {
        assert_eq!(multiple("0.5"), Ok(0.5));
        assert!(["0", "-1", "nan", "inf", "x"].iter().all(|t| multiple(t).is_err()));
    }
}
