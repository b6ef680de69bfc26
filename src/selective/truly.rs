//! A scene refined where a camera needs it, by the rule of truly selective refinement.

use super::{SelectiveScene, shared};
use crate::progressive::Leftover;
use crate::refine::selective::{Cull, Done, Lens, LensError, Limits};
use crate::refine::truly::{Guarded, TrulyError, TrulyView};
use crate::refine::view::Camera;
use crate::scene::Scene;
use glam::{DMat4, DVec3};

/// A mesh of a scene cannot be refined so.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrulySceneError {
    /// The rule is not for it.
    #[error("mesh {mesh}: {source}")]
    Mesh {
        /// Its number.
        mesh: usize,
        /// What is wrong.
        source: TrulyError,
    },
    /// The view cannot be had of it.
    #[error("mesh {mesh}: {source}")]
    Lens {
        /// Its number.
        mesh: usize,
        /// What is wrong.
        source: LensError,
    },
}

/// As [`SelectiveScene`], with a [`TrulyView`] of each mesh: fewer faces, and errors that may pass the tolerance ([`crate::refine::truly`]). No geomorphs.
#[derive(Clone, Debug)]
pub struct TrulyScene {
    shell: Scene,
    leftovers: Vec<Leftover>,
    views: Vec<TrulyView>,
    places: Vec<Vec<DMat4>>,
}

impl TrulyScene {
    /// Over the hierarchies of `scene`; every mesh shows its base. `guard`: the flip guard is on.
    ///
    /// Errors: a mesh with an edge of three or more faces, or damage.
    pub fn new(scene: &SelectiveScene, guard: bool) -> Result<TrulyScene, TrulySceneError> {
        let each = scene.views.iter().enumerate().map(|(mesh, view)| {
            let view = TrulyView::new(view.hierarchy().clone());
            let mut view = view.map_err(|source| TrulySceneError::Mesh { mesh, source })?;
            view.set_guard(guard);
            Ok(view)
        });
        let views = each.collect::<Result<_, _>>()?;
        let (shell, leftovers) = (scene.shell.clone(), scene.leftovers.clone());
        Ok(TrulyScene { shell, leftovers, views, places: scene.places.clone() })
    }

    /// The views, one a mesh.
    pub fn views(&self) -> &[TrulyView] {
        &self.views
    }

    /// Faces shown, of all meshes, each counted once.
    pub fn face_count(&self) -> usize {
        shared::face_count(self.views.iter())
    }

    /// Vertices shown.
    pub fn vertex_count(&self) -> usize {
        shared::vertex_count(self.views.iter())
    }

    /// What the flip guard did in the last frame.
    pub fn guarded(&self) -> Guarded {
        self.views.iter().fold(Guarded::default(), |mut all, v| {
            all += v.guarded();
            all
        })
    }

    /// Adapts all meshes to a camera. The limit of faces is for all of them; the others are for each.
    ///
    /// Errors: a tolerance that is none; a mesh placed by a matrix that flattens it.
    pub fn adapt(
        &mut self,
        camera: &Camera,
        tau: f64,
        cull: Cull,
        limits: &Limits<'_>,
    ) -> Result<Done, TrulySceneError> {
        let mut all = Done::NOTHING;
        for mesh in 0..self.views.len() {
            let h = self.views[mesh].hierarchy();
            let lens = |p: &DMat4| Lens::new(h, camera, p, tau, cull);
            let failed = |source| TrulySceneError::Lens { mesh, source };
            let lenses = shared::lenses(&self.places[mesh], lens, failed)?;
            let others = self.face_count() - self.views[mesh].face_count();
            let limits = Limits { faces: limits.faces.saturating_sub(others), ..*limits };
            all += self.views[mesh].adapt_to_all(&lenses, &limits);
        }
        Ok(all)
    }

    /// Adapts to a camera without limits of time, at `tau`, or at the least tolerance above it with which at most `faces` faces are shown. Returns that tolerance; it is infinite
    /// if the bases have more.
    ///
    /// Errors: as [`TrulyScene::adapt`].
    pub fn extract(
        &mut self,
        camera: &Camera,
        tau: f64,
        cull: Cull,
        faces: Option<usize>,
    ) -> Result<f64, TrulySceneError> {
        let adapt = |s: &mut Self, tau| s.adapt(camera, tau, cull, &Limits::default()).map(|_| true);
        shared::extract(self, (tau, faces), adapt, Self::face_count)
    }

    /// Bytes of the index buffers, and vertices, that changed since this was last called.
    pub fn take_changes(&mut self) -> (usize, usize) {
        let each = self.views.iter_mut().map(TrulyView::take_changes);
        each.fold((0, 0), |(bytes, vertices), c| (bytes + c.index_bytes(), vertices + c.wedges.len()))
    }

    /// The scene as it is shown. At full detail it is the scene that was made progressive, bit for bit. O(n).
    pub fn to_scene(&self) -> Scene {
        shared::scene_of(&self.shell, &self.leftovers, &self.views.iter().collect::<Vec<_>>())
    }

    /// The triangles shown, in the world: three corners each.
    pub fn triangles(&self) -> Vec<[DVec3; 3]> {
        shared::triangles(self.views.iter(), &self.places)
    }

    /// Vertices that a camera's frustum holds, of those shown, places counted each.
    pub fn visible_vertices(&self, camera: &Camera) -> usize {
        shared::visible_vertices(self.views.iter(), &self.places, camera)
    }

    /// Bytes that all views share, bytes of the views that grow with what is shown, and bytes of their tables over the finest meshes.
    pub fn bytes(&self) -> [usize; 3] {
        self.views.iter().fold([0; 3], |[s, a, t], v| {
            let [shared, shown, tables] = v.bytes();
            [s + v.hierarchy().bytes() + shared, a + shown, t + tables]
        })
    }
}
