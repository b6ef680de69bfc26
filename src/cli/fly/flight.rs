//! Frame after frame.

use super::super::Failure;
use super::pace::{Pace, Setting, Timed};
use progmesh::refine::selective::{Changes, Done};
use progmesh::refine::view::Camera;
use progmesh::selective::SelectiveScene;

/// A frame, once it has been refined.
pub(super) struct Step<'a> {
    pub(super) number: usize,
    pub(super) camera: &'a Camera,
    pub(super) scene: &'a SelectiveScene,
    pub(super) timed: Timed<Done>,
    pub(super) changes: &'a [Changes],
}

/// Flies; `watch` is shown every frame.
pub(super) fn fly(
    scene: &mut SelectiveScene,
    path: &[Camera],
    setting: Setting<'_>,
    file: &str,
    watch: &mut dyn FnMut(&Step<'_>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let mut pace = Pace::new(setting);
    scene.take_changes();
    for (number, camera) in path.iter().enumerate() {
        let timed = pace.frame(file, |tau, cull, limits| scene.adapt(camera, tau, cull, limits))?;
        pace.note(scene.needed_faces(), &timed.done);
        let changes = scene.take_changes();
        watch(&Step { number, camera, scene, timed, changes: &changes })?;
    }
    Ok(())
}
