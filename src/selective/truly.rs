//! A scene refined where a camera needs it, by the rule of truly selective refinement.

use super::{SelectiveScene, tolerance};
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
        self.views.iter().map(TrulyView::face_count).sum()
    }

    /// Vertices shown.
    pub fn vertex_count(&self) -> usize {
        self.views.iter().map(TrulyView::vertex_count).sum()
    }

    /// What the flip guard did in the last frame.
    pub fn guarded(&self) -> Guarded {
        self.views.iter().map(TrulyView::guarded).fold(Guarded::default(), |a, b| Guarded {
            deferred: a.deferred + b.deferred,
            through: a.through + b.through,
            turned: a.turned + b.turned,
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
        let mut all = Done { complete: true, ..Done::default() };
        for mesh in 0..self.views.len() {
            let h = self.views[mesh].hierarchy();
            let lenses = self.places[mesh].iter().map(|p| Lens::new(h, camera, p, tau, cull));
            let lenses: Result<Vec<Lens>, LensError> = lenses.collect();
            let lenses = lenses.map_err(|source| TrulySceneError::Lens { mesh, source })?;
            let others = self.face_count() - self.views[mesh].face_count();
            let limits = Limits { faces: limits.faces.saturating_sub(others), ..*limits };
            let done = self.views[mesh].adapt_to_all(&lenses, &limits);
            all.splits += done.splits;
            all.collapses += done.collapses;
            all.forced += done.forced;
            all.refused += done.refused;
            all.complete &= done.complete;
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
        let most = faces.unwrap_or(usize::MAX);
        tolerance::least(tau, |tau| {
            self.adapt(camera, tau, cull, &Limits::default())?;
            Ok(self.face_count() <= most)
        })
    }

    /// Bytes of the index buffers, and vertices, that changed since this was last called.
    pub fn take_changes(&mut self) -> (usize, usize) {
        let each = self.views.iter_mut().map(TrulyView::take_changes);
        each.fold((0, 0), |(bytes, vertices), c| (bytes + c.index_bytes(), vertices + c.wedges.len()))
    }

    /// The scene as it is shown. At full detail it is the scene that was made progressive, bit for bit. O(n).
    pub fn to_scene(&self) -> Scene {
        let mut scene = self.shell.clone();
        scene.meshes.resize_with(self.views.len(), Default::default);
        let all = self.views.iter().all(|v| v.vertex_count() == v.hierarchy().mesh().vertices());
        for (i, view) in self.views.iter().enumerate() {
            let geometry = view.to_input();
            let ordered = view.hierarchy().mesh().order.is_some();
            scene.meshes[i].geometry = match self.leftovers.get(i).filter(|_| all && ordered) {
                Some(left) => left.put_back(geometry),
                None => geometry,
            };
        }
        scene
    }

    /// The triangles shown, in the world: three corners each.
    pub fn triangles(&self) -> Vec<[DVec3; 3]> {
        let mut out = Vec::new();
        for (view, places) in self.views.iter().zip(&self.places) {
            let slots = (0..view.indices().len()).filter(|&s| view.face_in(s).is_some());
            let at = |v: u32| view.position(v).unwrap_or_default();
            let own: Vec<[DVec3; 3]> = slots.map(|s| view.indices()[s].map(at)).collect();
            for m in places {
                out.extend(own.iter().map(|t| t.map(|p| m.transform_point3(p))));
            }
        }
        out
    }

    /// Vertices that a camera's frustum holds, of those shown, places counted each.
    pub fn visible_vertices(&self, camera: &Camera) -> usize {
        let frustum = camera.frustum();
        let mut count = 0;
        for (view, places) in self.views.iter().zip(&self.places) {
            for p in (0..view.hierarchy().mesh().vertices() as u32).filter_map(|v| view.position(v)) {
                count += places.iter().filter(|m| frustum.contains(m.transform_point3(p))).count();
            }
        }
        count
    }

    /// Bytes that all views share, bytes of the views that grow with what is shown, and bytes of their tables over the finest meshes.
    pub fn bytes(&self) -> [usize; 3] {
        self.views.iter().fold([0; 3], |[s, a, t], v| {
            let [shared, shown, tables] = v.bytes();
            [s + v.hierarchy().bytes() + shared, a + shown, t + tables]
        })
    }
}
