//! `extract --memory`: of a file only what the view needs.

use super::super::common::{short, thousands};
use super::super::control::Interrupt;
use super::super::ending::Results;
use super::super::paging::{self, Paging};
use super::super::{Failure, common};
use super::{Args, Report, Seconds, StripReport};
use progmesh::refine::view::Camera;
use std::time::Instant;

impl Args {
    pub(super) fn run_paged(
        &self,
        mib: usize,
        camera: &Camera,
        mut results: Results,
        start: Instant,
    ) -> Result<(), Failure> {
        let file = self.input.name();
        let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{file}: {e}"));
        let interrupt = Interrupt::watch();
        let report = common::in_pool(self.making.collapsing.threads, || {
            let mut scene = paging::open(&self.input, mib, 0)?;
            let rule = self.needs.rule.name_of_paged(&scene, &file)?;
            let (read, refining) = (start.elapsed().as_secs_f64(), Instant::now());
            let most = self.needs.budget_faces;
            let tau =
                scene.extract(camera, self.needs.tau, self.needs.cull(), most).map_err(|e| failed(&e))?;
            let refine = refining.elapsed().as_secs_f64();
            if tau > self.needs.tau && most.is_none_or(|n| scene.face_count() < n) {
                results.warnings.say([format!(
                    "{file}: {mib} MiB are too little for {} pixels; {} fit",
                    short(self.needs.tau),
                    short(tau)
                )]);
            }
            let spent = self.ending.finish(&mut results, &scene.to_scene(), &interrupt)?;
            Ok(Report {
                command: "extract",
                to: results.format.extension(),
                rule,
                error: "uniform",
                tau: tau.is_finite().then_some(tau),
                faces: scene.face_count(),
                vertices: scene.vertex_count(),
                splits: scene.applied(),
                full_faces: scene.full_faces(),
                full_splits: scene.splits(),
                visible_vertices: scene.visible_vertices(camera),
                strips: self.strips.then(|| StripReport::of(scene.views().iter().map(|v| v.strips()))),
                paging: Some(Paging::of(&scene, mib, scene.bytes())),
                guard: None,
                seconds: Seconds {
                    read,
                    bounds: 0.0,
                    refine,
                    write: spent.write,
                    total: start.elapsed().as_secs_f64(),
                },
                warnings: vec![],
            })
        })?;
        let report = Report { warnings: results.warnings.all, ..report };
        self.ending.say(|| {
            format!(
                "{file}: {} of {} faces at {} pixels; {:.3} s (read {:.3}, refine {:.3}, write {:.3}){}; {}",
                thousands(report.faces),
                thousands(report.full_faces),
                report.tau.map_or("inf".into(), short),
                report.seconds.total,
                report.seconds.read,
                report.seconds.refine,
                report.seconds.write,
                StripReport::text(report.strips),
                report.paging.map_or(String::new(), |p| p.text())
            )
        });
        self.ending.print(&report)?;
        self.kept_budget(&report)
    }
}
