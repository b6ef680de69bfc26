//! `fly --memory`: of a file only what the frames need.

use super::super::Failure;
use super::super::common::Warnings;
use super::super::control::Interrupt;
use super::super::extract::StripReport;
use super::super::paging::{self, Paging};
use super::Args;
use super::pace::{Measuring, Pace};
use super::path::{Course, Source};
use super::report::{Frame, Memory, Report};
use progmesh::refine::paged::PagedLimits;
use progmesh::selective::{Deviation, Judge, PagedScene};
use std::time::Instant;

impl Args {
    pub(super) fn run_paged(
        &self,
        mib: usize,
        source: &Source,
        interrupt: &Interrupt,
    ) -> Result<Report, Failure> {
        let file = self.input.name();
        // What looks at the whole mesh, or follows the changes of views that hold it.
        let morphing = self.geomorph.map(|_| "--geomorph");
        let given = [morphing, self.play.given()];
        if let Some(flag) = given.into_iter().flatten().next() {
            return Err(Failure::Usage(format!("--memory and {flag} do not go together")));
        }
        let start = Instant::now();
        let mut scene = paging::open(&self.input, mib)?;
        let read = start.elapsed().as_secs_f64();
        let course = self.path.lay(source, scene.bounds(), (&file, self.terrain()))?;
        if let Some(g) = course.ground.as_ref().filter(|_| self.terrain().is_some()) {
            // As it is measured.
            scene.set_deviation(Deviation::Upright(g.up()));
        }
        let mut most = scene.bytes();
        let frames = self.fly_paged(&mut scene, &course, interrupt, &mut most)?;
        self.something_seen(&frames, scene.bounds())?;
        let (held, shown) = (scene.bytes(), scene.shown_bytes());
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
        report.paging = Some(Paging::of(&scene, mib, most));
        if self.measure_every.is_some() && course.ground.is_none() {
            report.warnings.push(format!(
                "{file}: to measure, all of the mesh was in memory before the flight, beyond --memory; while it is flown only the samples are"
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

    fn fly_paged(
        &self,
        scene: &mut PagedScene,
        course: &Course<'_>,
        interrupt: &Interrupt,
        most: &mut usize,
    ) -> Result<Vec<Frame>, Failure> {
        let file = self.input.name();
        let measuring = Measuring::new(self.measure_every, course, &file, || self.judge_of_file())?;
        let mut pace = Pace::new(self.setting(self.needs.tau, interrupt));
        let fetches = self.fetches.unwrap_or(usize::MAX);
        let mut frames = Vec::with_capacity(course.cameras.len());
        let (bounds, mut shots) = (scene.bounds(), self.shots.start(course));
        scene.take_changes();
        for (number, camera) in course.cameras.iter().enumerate() {
            let timed = pace.frame(&file, |tau, cull, limits| {
                scene.adapt(camera, tau, cull, &PagedLimits { limits: *limits, fetches })
            })?;
            let done = timed.done;
            *most = scene.bytes().max(*most);
            pace.note(scene.face_count(), &done.done);
            let (dirty_index_bytes, dirty_wedges) = scene.take_changes();
            shots.draw(number, camera, || (scene.to_scene(), bounds, scene.face_count()))?;
            let (measured, over) = measuring.measure(number, camera, || scene.triangles())?;
            frames.push(Frame {
                faces: scene.face_count(),
                vertices: scene.vertex_count(),
                visible_vertices: scene.visible_vertices(camera),
                dirty_index_bytes,
                dirty_wedges,
                strips: self.strips.then(|| StripReport::of(scene.views().iter().map(|v| v.strips()))),
                measured,
                on_ground: over.on_ground,
                cracks: over.cracks(),
                folds: over.folds(),
                fetched: Some(done.fetched),
                no_room: Some(done.no_room),
                ..timed.frame(&done.done)
            });
        }
        shots.write()?;
        Ok(frames)
    }
}
