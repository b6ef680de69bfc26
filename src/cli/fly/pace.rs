//! What is the same for every frame, whatever the engine: its tolerance, its limits, its time, and what is measured of it.

use super::super::Failure;
use super::super::control::Interrupt;
use super::super::terrain::input::unread;
use super::ground::{OnGround, OverGrid};
use super::path::Course;
use super::report::{Frame, Measured};
use glam::DVec3;
use progmesh::refine::selective::{Cull, Done, Limits, Regulator};
use progmesh::refine::view::Camera;
use progmesh::selective::{Ground, Judge};
use std::cell::Cell;
use std::time::{Duration, Instant};

/// How a flight refines.
#[derive(Clone, Copy)]
pub(super) struct Setting<'a> {
    pub(super) tau: f64,
    pub(super) cull: Cull,
    pub(super) budget_faces: Option<usize>,
    pub(super) budget_us: Option<usize>,
    pub(super) hysteresis: f64,
    /// Frames a second at most.
    pub(super) fps: Option<usize>,
    pub(super) interrupt: &'a Interrupt,
}

/// Goes from frame to frame.
pub(super) struct Pace<'a> {
    setting: Setting<'a>,
    regulator: Option<Regulator>,
    /// Before it no frame begins.
    next: Cell<Option<Instant>>,
}

/// A frame that has been refined.
#[derive(Clone, Copy)]
pub(super) struct Timed<T> {
    /// The tolerance of this frame.
    pub(super) tau: f64,
    /// What refining took, microseconds.
    pub(super) us: f64,
    pub(super) done: T,
}

impl<'a> Pace<'a> {
    pub(super) fn new(setting: Setting<'a>) -> Self {
        let regulator = setting.budget_faces.map(|n| Regulator::new(n, setting.tau));
        Pace { setting, regulator, next: Cell::new(None) }
    }

    /// One frame: `adapt` is given its tolerance, what to cull and its limits, and is timed.
    ///
    /// Errors: those of `adapt`, which are the input's; an interruption.
    pub(super) fn frame<T, E: std::fmt::Display>(
        &self,
        file: &str,
        adapt: impl FnOnce(f64, Cull, &Limits<'_>) -> Result<T, E>,
    ) -> Result<Timed<T>, Failure> {
        let s = &self.setting;
        if s.interrupt.is_set() {
            return Err(Failure::Interrupted);
        }
        let tau = self.regulator.as_ref().map_or(s.tau, Regulator::tau);
        self.wait();
        let start = Instant::now();
        let end = s.budget_us.map(|us| start + Duration::from_micros(us as u64));
        let expired = || end.is_some_and(|end| Instant::now() >= end);
        let limits = Limits {
            faces: s.budget_faces.unwrap_or(usize::MAX),
            expired: end.is_some().then_some(&expired as &dyn Fn() -> bool),
            hysteresis: s.hysteresis,
            ..Limits::default()
        };
        let done = adapt(tau, s.cull, &limits);
        let us = start.elapsed().as_secs_f64() * 1e6;
        let done = done.map_err(|e| Failure::Input(format!("{file}: {e}")))?;
        Ok(Timed { tau, us, done })
    }

    /// Until the next frame may begin.
    fn wait(&self) {
        let Some(fps) = self.setting.fps else { return };
        let now = Instant::now();
        let from = self.next.get().map_or(now, |next| next.max(now));
        std::thread::sleep(from - now);
        self.next.set(Some(from + Duration::from_secs_f64(1.0 / fps as f64)));
    }

    /// What came of the frame, for the tolerance of the next.
    pub(super) fn note(&mut self, faces: usize, done: &Done) {
        if let Some(r) = &mut self.regulator {
            r.note(faces, done);
        }
    }
}

impl<T> Timed<T> {
    /// The same with a part of what was done.
    pub(super) fn of<U>(&self, done: U) -> Timed<U> {
        Timed { tau: self.tau, us: self.us, done }
    }

    /// What a report says of it; what is shown, and what changed, is to be filled in.
    pub(super) fn frame(&self, done: &Done) -> Frame {
        Frame {
            vsplits: done.splits,
            ecols: done.collapses,
            us: self.us,
            tau: self.tau.is_finite().then_some(self.tau),
            complete: done.complete,
            ..Frame::default()
        }
    }
}

/// What is measured on every so many frames.
pub(super) struct Measuring<'a> {
    every: Option<usize>,
    judge: Option<Judge>,
    ground: Option<&'a Ground<'a>>,
    /// How far full detail may be off the ground.
    floor: f64,
    file: &'a str,
    /// Some frame has seen something.
    seen: Cell<bool>,
}

/// Of so many frames one has the vertices in its picture counted, where no others are measured. Counting reads much memory, and what the next frame needs has to be fetched again then: over generated terrain of
/// 4,097 x 4,097, with every frame counted, frames took 7 to 50 % longer.
const COUNTED: usize = 20;

impl<'a> Measuring<'a> {
    /// By the judge that is made if need be; over terrain by the samples of its grid.
    ///
    /// Errors: those of `judge`.
    pub(super) fn new(
        every: Option<usize>,
        course: &'a Course<'_>,
        file: &'a str,
        judge: impl FnOnce() -> Result<Judge, Failure>,
    ) -> Result<Self, Failure> {
        let judge = every.filter(|_| course.ground.is_none()).map(|_| judge()).transpose()?;
        Ok(Measuring {
            every,
            judge,
            ground: course.ground.as_ref(),
            floor: course.floor,
            file,
            seen: Cell::new(false),
        })
    }

    /// Has the vertices that frame `number` sees counted, if it is its turn, or if none has seen anything yet.
    pub(super) fn visible(&self, number: usize, count: impl FnOnce() -> usize) -> Option<usize> {
        let due = number.is_multiple_of(self.every.unwrap_or(COUNTED)) || !self.seen.get();
        due.then(|| {
            let visible = count();
            self.seen.set(self.seen.get() || visible > 0);
            visible
        })
    }

    /// Measures frame `number`, if it is its turn; over terrain cracks are looked for in every frame. `triangles` is asked for what is shown then.
    ///
    /// Errors: what is shown cannot be measured.
    pub(super) fn measure(
        &self,
        number: usize,
        camera: &Camera,
        triangles: impl FnOnce() -> Vec<[DVec3; 3]>,
    ) -> Result<(Option<Measured>, OverGrid), Failure> {
        let Some(every) = self.every else { return Ok((None, OverGrid::default())) };
        let due = number.is_multiple_of(every);
        if let Some(ground) = self.ground {
            let triangles = triangles();
            if !due {
                let seams = ground.seams(&triangles).map_err(unread)?;
                return Ok((None, OverGrid { on_ground: None, seams: Some(seams) }));
            }
            let found = ground.judge(&triangles, camera, self.floor).map_err(unread)?;
            return Ok((None, OverGrid { on_ground: Some(OnGround::of(&found)), seams: Some(found.seams) }));
        }
        if !due {
            return Ok((None, OverGrid::default()));
        }
        let triangles = triangles();
        let measured = match &self.judge {
            Some(j) => {
                let m = j.measure_triangles(&triangles, camera);
                let m = m.map_err(|e| Failure::Input(format!("{}: {e}", self.file)))?;
                Some(Measured { samples: m.visible, max_pixels: m.max_pixels, mean_pixels: m.mean_pixels })
            }
            None => None,
        };
        Ok((measured, OverGrid::default()))
    }
}
