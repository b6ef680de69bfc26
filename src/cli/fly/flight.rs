//! Frame after frame.

use super::super::Failure;
use super::super::control::Interrupt;
use progmesh::refine::selective::{Changes, Cull, Done, Limits, Regulator};
use progmesh::refine::view::Camera;
use progmesh::selective::SelectiveScene;
use std::time::{Duration, Instant};

/// How a flight refines.
pub(super) struct Setting<'a> {
    pub(super) tau: f64,
    pub(super) cull: Cull,
    pub(super) budget_faces: Option<usize>,
    pub(super) budget_us: Option<usize>,
    pub(super) hysteresis: f64,
    pub(super) interrupt: &'a Interrupt,
}

/// A frame, once it has been refined.
pub(super) struct Step<'a> {
    pub(super) number: usize,
    pub(super) camera: &'a Camera,
    pub(super) scene: &'a SelectiveScene,
    pub(super) done: Done,
    pub(super) changes: &'a [Changes],
    /// The tolerance of this frame.
    pub(super) tau: f64,
    /// What refining took, microseconds.
    pub(super) us: f64,
}

/// Flies; `watch` is shown every frame.
pub(super) fn fly(
    scene: &mut SelectiveScene,
    path: &[Camera],
    setting: &Setting<'_>,
    file: &str,
    watch: &mut dyn FnMut(&Step<'_>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let mut regulator = setting.budget_faces.map(|n| Regulator::new(n, setting.tau));
    scene.take_changes();
    for (number, camera) in path.iter().enumerate() {
        if setting.interrupt.is_set() {
            return Err(Failure::Interrupted);
        }
        let tau = regulator.as_ref().map_or(setting.tau, |r| r.tau());
        let start = Instant::now();
        let end = setting.budget_us.map(|us| start + Duration::from_micros(us as u64));
        let expired = || end.is_some_and(|end| Instant::now() >= end);
        let limits = Limits {
            faces: setting.budget_faces.unwrap_or(usize::MAX),
            expired: end.is_some().then_some(&expired as &dyn Fn() -> bool),
            hysteresis: setting.hysteresis,
            ..Limits::default()
        };
        let done = scene.adapt(camera, tau, setting.cull, &limits);
        let done = done.map_err(|e| Failure::Input(format!("{file}: {e}")))?;
        let us = start.elapsed().as_secs_f64() * 1e6;
        if let Some(r) = &mut regulator {
            r.note(scene.needed_faces(), &done);
        }
        let changes = scene.take_changes();
        watch(&Step { number, camera, scene, done, changes: &changes, tau, us })?;
    }
    Ok(())
}
