//! `fly --rule truly`.

use super::super::Failure;
use super::super::control::Interrupt;
use super::super::extract::StripReport;
use super::super::rule::Guard;
use super::pace::{Measuring, Pace};
use super::report::Frame;
use super::{Args, path};
use progmesh::refine::Strips;
use progmesh::selective::{SelectiveScene, TrulyScene};

impl Args {
    /// Fails where flags do not go together.
    pub(super) fn check_truly(&self) -> Result<(), Failure> {
        // What follows the changes of views by the other rules.
        let given = self.geomorph.map(|_| "--geomorph").or(self.play.given());
        match given.filter(|_| self.needs.rule.is_truly()) {
            Some(flag) => Err(Failure::Usage(format!("--rule truly and {flag} do not go together"))),
            None => Ok(()),
        }
    }

    /// Returns the frames, the bytes held at the end (shared, of what is shown, of tables), and what the flip guard did.
    pub(super) fn fly_truly(
        &self,
        scene: SelectiveScene,
        course: &path::Course<'_>,
        interrupt: &Interrupt,
    ) -> Result<(Vec<Frame>, [usize; 3], Guard), Failure> {
        let file = self.input.name();
        let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{file}: {e}"));
        let measuring = Measuring::new(self.measure_every, course, &file, || self.judge(&scene))?;
        let mut truly = TrulyScene::new(&scene, self.needs.rule.guard()).map_err(|e| failed(&e))?;
        let bounds = scene.bounds();
        drop(scene);
        let mut shots = self.shots.start(course);
        let mut pace = Pace::new(self.setting(self.needs.tau, interrupt));
        let mut frames = Vec::with_capacity(course.cameras.len());
        let mut guard = Guard::default();
        truly.take_changes();
        for (number, camera) in course.cameras.iter().enumerate() {
            let timed = pace.frame(&file, |tau, cull, limits| truly.adapt(camera, tau, cull, limits))?;
            guard.note(truly.guarded());
            pace.note(truly.face_count(), &timed.done);
            let (dirty_index_bytes, dirty_wedges) = truly.take_changes();
            let (measured, over) = measuring.measure(number, camera, || truly.triangles())?;
            shots.draw(number, camera, || (truly.to_scene(), bounds, truly.face_count()))?;
            frames.push(Frame {
                faces: truly.face_count(),
                vertices: truly.vertex_count(),
                visible_vertices: measuring.visible(number, || truly.visible_vertices(camera)),
                dirty_index_bytes,
                dirty_wedges,
                strips: self
                    .strips
                    .then(|| StripReport::of(truly.views().iter().map(|v| Strips::new(v.indices())))),
                measured,
                on_ground: over.on_ground,
                cracks: over.cracks(),
                folds: over.folds(),
                ..timed.frame(&timed.done)
            });
        }
        self.something_seen(&frames, bounds)?;
        shots.write()?;
        Ok((frames, truly.bytes(), guard))
    }
}
