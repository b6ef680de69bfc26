//! `fly --rule truly`.

use super::super::Failure;
use super::super::control::Interrupt;
use super::super::rule::Guard;
use super::report::{Frame, Measured, OnGround};
use super::{Args, path};
use progmesh::refine::selective::{Limits, Regulator};
use progmesh::selective::{Judge, SelectiveScene, TrulyScene};
use std::time::{Duration, Instant};

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
        let judge = match self.measure_every.filter(|_| course.ground.is_none()) {
            Some(_) => Some(Judge::new(&scene, self.samples).map_err(|e| failed(&e))?),
            None => None,
        };
        let mut truly = TrulyScene::new(&scene, self.needs.rule.guard()).map_err(|e| failed(&e))?;
        let bounds = scene.bounds();
        drop(scene);
        let mut shots = self.shots.start(course);
        let mut regulator = self.needs.budget_faces.map(|n| Regulator::new(n, self.needs.tau));
        let mut frames = Vec::with_capacity(course.cameras.len());
        let mut guard = Guard::default();
        truly.take_changes();
        for (number, camera) in course.cameras.iter().enumerate() {
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
            let done = truly.adapt(camera, tau, self.needs.cull(), &limits).map_err(|e| failed(&e))?;
            let us = start.elapsed().as_secs_f64() * 1e6;
            guard.note(truly.guarded());
            if let Some(r) = &mut regulator {
                r.note(truly.face_count(), &done);
            }
            let (dirty_index_bytes, dirty_wedges) = truly.take_changes();
            let due = self.measure_every.is_some_and(|n| number.is_multiple_of(n));
            let triangles = if due { truly.triangles() } else { Vec::new() };
            let measured = match judge.as_ref().filter(|_| due) {
                Some(j) => {
                    let m = j.measure_triangles(&triangles, camera).map_err(|e| failed(&e))?;
                    Some(Measured {
                        samples: m.visible,
                        max_pixels: m.max_pixels,
                        mean_pixels: m.mean_pixels,
                    })
                }
                None => None,
            };
            let ground = course.ground.as_ref().filter(|_| due);
            let on_ground = ground.map(|g| OnGround::of(&g.judge(&triangles, camera)));
            shots.draw(number, camera, || (truly.to_scene(), bounds, truly.face_count()))?;
            frames.push(Frame {
                faces: truly.face_count(),
                vertices: truly.vertex_count(),
                vsplits: done.splits,
                ecols: done.collapses,
                us,
                tau: tau.is_finite().then_some(tau),
                complete: done.complete,
                morphing: 0,
                visible_vertices: truly.visible_vertices(camera),
                dirty_index_bytes,
                dirty_wedges,
                fetched: None,
                no_room: None,
                measured,
                on_ground,
            });
        }
        self.something_seen(&frames, bounds)?;
        shots.write()?;
        Ok((frames, truly.bytes(), guard))
    }
}
