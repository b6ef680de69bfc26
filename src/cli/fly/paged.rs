//! `fly --memory`: of a file only what the frames need.

use super::super::Failure;
use super::super::common::Warnings;
use super::super::control::Interrupt;
use super::super::extract::StripReport;
use super::super::paging::{self, Paging};
use super::Args;
use super::pace::{Measuring, Pace, Setting, Timed};
use super::path::{Course, Source};
use super::report::{Frame, Memory, Report};
use progmesh::refine::paged::{PagedDone, PagedLimits};
use progmesh::selective::{Deviation, Judge, PagedChanges, PagedScene};
use std::time::Instant;

/// A flight, and what was held at its end: of that what grows with the mesh shown.
struct Flown {
    frames: Vec<Frame>,
    held: usize,
    shown: usize,
    paging: Paging,
}

/// Is shown a frame that has been refined.
type Watch<'a> = dyn FnMut(usize, &mut PagedScene, &Timed<PagedDone>) -> Result<(), Failure> + 'a;

impl Args {
    pub(super) fn run_paged(
        &self,
        mib: usize,
        source: &Source,
        interrupt: &Interrupt,
    ) -> Result<Report, Failure> {
        let file = self.input.name();
        let start = Instant::now();
        let beside = if self.path.has_grid() { paging::grid_cache(mib) } else { 0 };
        let mut scene = paging::open(&self.input, mib, beside)?;
        let rule = self.needs.rule.name_of_paged(&scene, &file)?;
        let read = start.elapsed().as_secs_f64();
        let course = self.path.lay(source, scene.bounds(), (&file, self.terrain()))?;
        if let Some(g) = course.ground.as_ref().filter(|_| self.terrain().is_some()) {
            // As it is measured.
            scene.set_deviation(Deviation::Upright(g.up()));
        }
        scene.set_geomorph(self.geomorph).map_err(|e| Failure::Input(format!("{file}: {e}")))?;
        let Flown { frames, held, shown, paging } = self.fly_paged(&mut scene, mib, &course, interrupt)?;
        let memory = Memory {
            shared_bytes: held - shown,
            shared_bytes_per_vertex: (held - shown) as f64 / scene.full_vertices().max(1) as f64,
            view_bytes: shown,
            view_table_bytes: 0,
            most_vertices: frames.iter().map(|f| f.vertices).max().unwrap_or(0),
        };
        let short = frames.iter().filter(|f| f.no_room.is_some_and(|n| n > 0)).count();
        let path = self.path.name().to_string();
        let mut report = Report::new(path, self.needs.tau, scene.full_faces(), frames, memory, [read, 0.0]);
        (report.rule, report.paging) = (rule, Some(paging));
        let limited = paging::is_limit(mib);
        if limited && self.measure_every.is_some() && course.ground.is_none() {
            report.warnings.push(format!(
                "{file}: to measure, all of the mesh was in memory before the flight, beyond --memory; while it is flown only the samples are"
            ));
        }
        if limited && self.play.given().is_some() {
            report.warnings.push(format!(
                "{file}: what the page plays was held beyond --memory until it was written: --html-max limits it"
            ));
        }
        if short > 0 {
            report.warnings.push(format!(
                "{file}: {mib} MiB were too little for {}: they are coarser than asked",
                progmesh::pipeline::count(short, "frame")
            ));
        }
        Ok(report)
    }

    /// Samples of the finest surfaces: the one thing that takes all of the file, before the flight. What was read is given back then.
    fn judge_of_file(&self) -> Result<Judge, Failure> {
        let file = self.input.name();
        // What reading has to say, it has said.
        let mut silent = Warnings::new(true);
        let whole = self.input.read_or_make(&mut silent, |_, _| {
            Err(Failure::Usage(format!("{file}: --memory is for .pm files")))
        })?;
        Judge::of_progressive(&whole, self.samples).map_err(|e| Failure::Input(format!("{file}: {e}")))
    }

    /// The flight that was asked for; then, for a page, the others.
    fn fly_paged(
        &self,
        scene: &mut PagedScene,
        mib: usize,
        course: &Course<'_>,
        interrupt: &Interrupt,
    ) -> Result<Flown, Failure> {
        let file = self.input.name();
        let measuring = Measuring::new(self.measure_every, course, &file, || self.judge_of_file())?;
        let mut frames = Vec::with_capacity(course.cameras.len());
        let mut most = scene.bytes();
        let (bounds, mut shots) = (scene.bounds(), self.shots.start(course));
        let mut player = self.play.start(scene, &course.cameras, &file);
        if let Some(p) = &mut player {
            p.begin(self.needs.tau, true)?;
        }
        self.follow(scene, course, self.setting(self.needs.tau, interrupt), &mut |number, scene, timed| {
            let (camera, done) = (&course.cameras[number], timed.done);
            most = scene.bytes().max(most);
            let changes = scene.take_changes();
            shots.draw(number, camera, || (scene.to_scene(), bounds, scene.face_count()))?;
            let (measured, over) = measuring.measure(number, camera, || scene.triangles())?;
            if let Some(p) = &mut player {
                p.take(number, (&*scene, &changes), &timed.of(done.done))?;
            }
            frames.push(Frame {
                faces: scene.face_count(),
                vertices: scene.vertex_count(),
                morphing: scene.morphing(),
                visible_vertices: measuring.visible(number, || scene.visible_vertices(camera)),
                dirty_index_bytes: changes.iter().map(PagedChanges::index_bytes).sum(),
                dirty_wedges: changes.iter().map(|c| c.wedges).sum(),
                strips: self.strips.then(|| StripReport::of(scene.views().iter().map(|v| v.strips()))),
                measured,
                on_ground: over.on_ground,
                cracks: over.cracks(),
                folds: over.folds(),
                fetched: Some(done.fetched),
                no_room: Some(done.no_room),
                ..timed.frame(&done.done)
            });
            Ok(())
        })?;
        self.something_seen(&frames, scene.bounds())?;
        shots.write()?;
        let (held, shown, paging) = (scene.bytes(), scene.shown_bytes(), Paging::of(scene, mib, most));
        if let Some(mut p) = player {
            for tau in self.play.others(self.needs.tau) {
                scene.reset().map_err(|e| Failure::Input(format!("{file}: {e}")))?;
                p.begin(tau, false)?;
                self.follow(scene, course, self.setting(tau, interrupt), &mut |number, scene, timed| {
                    let changes = scene.take_changes();
                    p.take(number, (&*scene, &changes), &timed.of(timed.done.done))
                })?;
            }
            p.write(scene)?;
        }
        Ok(Flown { frames, held, shown, paging })
    }

    /// Flies along a path; `watch` is shown every frame.
    fn follow(
        &self,
        scene: &mut PagedScene,
        course: &Course<'_>,
        setting: Setting<'_>,
        watch: &mut Watch<'_>,
    ) -> Result<(), Failure> {
        let file = self.input.name();
        let mut pace = Pace::new(setting);
        let fetches = self.fetches.unwrap_or(usize::MAX);
        scene.take_changes();
        for (number, camera) in course.cameras.iter().enumerate() {
            let timed = pace.frame(&file, |tau, cull, limits| {
                scene.adapt(camera, tau, cull, &PagedLimits { limits: *limits, fetches })
            })?;
            pace.note(scene.needed_faces(), &timed.done.done);
            watch(number, scene, &timed)?;
        }
        Ok(())
    }
}
