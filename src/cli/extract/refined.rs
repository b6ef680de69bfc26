//! A scene refined for one view, by whichever rule.

use super::super::Failure;
use super::super::rule::Guard;
use super::{Args, StripReport};
use progmesh::refine::Strips;
use progmesh::refine::view::Camera;
use progmesh::scene::Scene;
use progmesh::selective::{SelectiveScene, TrulyScene};

enum Shown {
    Closed(SelectiveScene),
    Truly(TrulyScene),
}

/// What a view needs.
pub(super) struct Refined {
    /// The tolerance that was kept.
    pub(super) tau: f64,
    shown: Shown,
}

impl Args {
    /// Refines a scene, whose meshes show their bases, as the flags say.
    pub(super) fn refine(&self, mut scene: SelectiveScene, camera: &Camera) -> Result<Refined, Failure> {
        let file = self.input.name();
        let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{file}: {e}"));
        let (tau, cull, most) = (self.needs.tau, self.needs.cull(), self.needs.budget_faces);
        if self.needs.rule.is_truly() {
            let mut truly = TrulyScene::new(&scene, self.needs.rule.guard()).map_err(|e| failed(&e))?;
            let tau = truly.extract(camera, tau, cull, most).map_err(|e| failed(&e))?;
            return Ok(Refined { tau, shown: Shown::Truly(truly) });
        }
        let tau = scene.extract(camera, tau, cull, most).map_err(|e| failed(&e))?;
        Ok(Refined { tau, shown: Shown::Closed(scene) })
    }
}

impl Refined {
    pub(super) fn scene(&self) -> Scene {
        match &self.shown {
            Shown::Closed(s) => s.to_scene(),
            Shown::Truly(s) => s.to_scene(),
        }
    }

    pub(super) fn faces(&self) -> usize {
        match &self.shown {
            Shown::Closed(s) => s.face_count(),
            Shown::Truly(s) => s.face_count(),
        }
    }

    pub(super) fn vertices(&self) -> usize {
        match &self.shown {
            Shown::Closed(s) => s.vertex_count(),
            Shown::Truly(s) => s.vertex_count(),
        }
    }

    pub(super) fn splits(&self) -> usize {
        match &self.shown {
            Shown::Closed(s) => s.views().iter().map(|v| v.applied().count()).sum(),
            Shown::Truly(s) => s.views().iter().map(|v| v.applied().count()).sum(),
        }
    }

    pub(super) fn visible_vertices(&self, camera: &Camera) -> usize {
        match &self.shown {
            Shown::Closed(s) => s.visible_vertices(camera),
            Shown::Truly(s) => s.visible_vertices(camera),
        }
    }

    pub(super) fn strips(&self) -> StripReport {
        match &self.shown {
            Shown::Closed(s) => StripReport::of(s.views().iter().map(|v| v.strips())),
            Shown::Truly(s) => StripReport::of(s.views().iter().map(|v| Strips::new(v.indices()))),
        }
    }

    pub(super) fn guard(&self) -> Option<Guard> {
        match &self.shown {
            Shown::Closed(_) => None,
            Shown::Truly(s) => Some(Guard::of(s.guarded())),
        }
    }
}
