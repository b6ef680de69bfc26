//! A scene whose meshes are refined where a camera needs it.

mod flight;
mod heights;
mod judge;
mod judge_directional;
mod morph;
mod paged;
mod player;
mod record;
mod recordable;
mod samples;
mod shared;
mod shot;
mod terrain;
mod tolerance;
mod truly;

pub use flight::{FlightPath, FrameSpace, PathError, circle, lemniscate, recorded};
pub use heights::{GroundJudgement, Seams};
pub use judge::{Judge, Judgement};
pub use morph::Geomorph;
pub use paged::{PagedChanges, PagedScene, PagedSceneError, Ranges};
pub use player::player_page;
pub use record::{FrameCounts, RecordError, Recorder, Recording, upward};
pub use recordable::Recordable;
pub use shot::{ShotStyle, shot};
pub use terrain::{Ground, GroundError, Lap};
pub use truly::{TrulyScene, TrulySceneError};

use crate::progressive::{Leftover, ProgressiveScene};
use crate::refine::hierarchy::{Guarantee, Hierarchy, Options};
use crate::refine::progressive::Damage;
use crate::refine::selective::{Changes, Cull, Done, Lens, LensError, Limits, View};
use crate::refine::view::Camera;
use crate::scene::Scene;
use glam::{DMat4, DVec3};
use morph::Morphs;
use shared::Drawn;
use std::sync::Arc;

/// A scene with a [`View`] of each mesh. A mesh that stands in several places is as fine as the most demanding of them asks.
#[derive(Clone, Debug)]
pub struct SelectiveScene {
    shell: Scene,
    leftovers: Vec<Leftover>,
    views: Vec<View>,
    /// For each mesh where it stands.
    places: Vec<Vec<DMat4>>,
    morphs: Morphs,
    deviation: Deviation,
}

/// How deviations from the finest mesh count in a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Deviation {
    /// By their length, whichever way they lie.
    #[default]
    Uniform,
    /// What lies along the line of sight counts a quarter ([`Lens::directional`]). It takes bounds with directions ([`Options::directions`]).
    Directional,
    /// Of meshes whose bounds are differences of height ([`Guarantee::Vertical`]), along this direction of the world: by the distance in the picture ([`Lens::upright`]). Of others as uniform.
    Upright(DVec3),
}

impl Deviation {
    /// A lens by which errors of a mesh count so.
    fn through(self, lens: Lens, camera: &Camera, guarantee: Guarantee) -> Lens {
        match self {
            Deviation::Directional => lens.directional(),
            Deviation::Upright(up) if guarantee == Guarantee::Vertical => lens.upright(camera, up),
            Deviation::Uniform | Deviation::Upright(_) => lens,
        }
    }
}

/// A mesh of a scene cannot be refined selectively.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SelectiveError {
    /// Its splits are damaged.
    #[error("mesh {mesh}: {source}")]
    Damage {
        /// Its number.
        mesh: usize,
        /// What is wrong.
        source: Damage,
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

/// Where each of so many meshes stands; without nodes where its coordinates say.
fn places_of(shell: &Scene, meshes: usize) -> Vec<Vec<DMat4>> {
    let mut places = vec![Vec::new(); meshes];
    let shown = shell.instance_counts();
    for (node, world) in shell.nodes.iter().zip(shell.world_transforms()) {
        if let Some(m) = node.mesh.filter(|&m| m < meshes && shown.get(m).is_some_and(|&n| n > 0)) {
            places[m].push(world);
        }
    }
    if shell.nodes.is_empty() {
        places.iter_mut().for_each(|p| p.push(DMat4::IDENTITY));
    }
    places
}

impl SelectiveScene {
    /// Builds the hierarchies; every mesh shows its base. About 130 microseconds a vertex where meshes carry no bounds.
    ///
    /// Errors: a damaged mesh.
    pub fn new(scene: ProgressiveScene, options: &Options) -> Result<SelectiveScene, SelectiveError> {
        let places = places_of(&scene.shell, scene.meshes.len());
        let each = scene.meshes.into_iter().enumerate().map(|(mesh, pm)| {
            let h = Hierarchy::new(Arc::new(pm), options);
            h.map(|h| View::new(Arc::new(h))).map_err(|source| SelectiveError::Damage { mesh, source })
        });
        let views = each.collect::<Result<_, _>>()?;
        let morphs = Morphs::default();
        let deviation = Deviation::default();
        Ok(SelectiveScene {
            views,
            places,
            shell: scene.shell,
            leftovers: scene.leftovers,
            morphs,
            deviation,
        })
    }

    /// The views, one a mesh: what the last frame asked for.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// Back to the bases, as if nothing had been shown. O(vertices of the finest meshes).
    pub fn reset(&mut self) {
        self.views.iter_mut().for_each(|v| *v = View::new(v.hierarchy().clone()));
        self.set_geomorph(self.morphs.geomorph);
    }

    /// From the next frame on changes that can be seen show themselves so; `None`: at once. What is shown then is not [`SelectiveScene::views`] until they came
    /// to rest, but [`SelectiveScene::shown`].
    pub fn set_geomorph(&mut self, geomorph: Option<Geomorph>) {
        self.morphs = Morphs::new(geomorph);
    }

    /// How errors count from the next frame on.
    pub fn set_deviation(&mut self, deviation: Deviation) {
        self.deviation = deviation;
    }

    /// Vertices of the last frame that are not where they will be.
    pub fn morphing(&self) -> usize {
        self.morphs.morphing()
    }

    /// The mesh that is shown of mesh `m`. Panics if there is no such mesh.
    pub fn shown(&self, m: usize) -> &View {
        self.morphs.view(&self.views, m)
    }

    /// The vertices of [`SelectiveScene::shown`] that are drawn elsewhere than it has them, ascending, and where, in the mesh's own coordinates.
    pub fn displaced(&self, m: usize) -> &[(u32, DVec3)] {
        self.morphs.displaced(m)
    }

    /// The meshes as they are drawn.
    fn drawn(&self) -> impl Iterator<Item = Drawn<'_>> {
        (0..self.views.len()).map(|m| self.morphs.drawn(&self.views, m))
    }

    /// Where each mesh stands.
    pub fn placements(&self) -> &[Vec<DMat4>] {
        &self.places
    }

    /// Faces shown, of all meshes, each counted once.
    pub fn face_count(&self) -> usize {
        shared::face_count(self.drawn())
    }

    /// Faces that the last frame asked for: [`SelectiveScene::face_count`], but for what [`Geomorph::Time`] still shows.
    pub fn needed_faces(&self) -> usize {
        self.views.iter().map(View::face_count).sum()
    }

    /// Vertices shown.
    pub fn vertex_count(&self) -> usize {
        shared::vertex_count(self.drawn())
    }

    /// Faces at full detail.
    pub fn full_faces(&self) -> usize {
        self.views.iter().map(|v| v.hierarchy().mesh().faces()).sum()
    }

    /// Vertices at full detail.
    pub fn full_vertices(&self) -> usize {
        self.views.iter().map(|v| v.hierarchy().mesh().vertices()).sum()
    }

    /// Least and greatest coordinates, in the world, of the boxes of the meshes at full detail; `None` if nothing is shown. O(n).
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut all: Option<(DVec3, DVec3)> = None;
        for (view, places) in self.views.iter().zip(&self.places) {
            let Some((lo, hi)) = view.hierarchy().mesh().full_bounds() else { continue };
            for m in places {
                for k in 0..8u32 {
                    let pick = |axis: usize| if k >> axis & 1 == 1 { hi[axis] } else { lo[axis] };
                    let p = m.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
                    all = Some(all.map_or((p, p), |(lo, hi)| (lo.min(p), hi.max(p))));
                }
            }
        }
        all
    }

    /// Adapts all meshes to a camera. The limit of faces is for all of them (of those needed: with [`Geomorph::Time`] more may be shown until what is undone is gone); the
    /// others are for each.
    ///
    /// Errors: a tolerance that is none; a mesh placed by a matrix that flattens it.
    pub fn adapt(
        &mut self,
        camera: &Camera,
        tau: f64,
        cull: Cull,
        limits: &Limits<'_>,
    ) -> Result<Done, SelectiveError> {
        let mut all = Done::NOTHING;
        let lenses = self.lenses(camera, tau / self.morphs.band(), cull)?;
        for (m, lenses) in lenses.iter().enumerate() {
            let others = self.needed_faces() - self.views[m].face_count();
            let limits = Limits { faces: limits.faces.saturating_sub(others), ..*limits };
            all += self.views[m].adapt_to_all(lenses, &limits);
        }
        if let Some([splits, collapses]) = self.morphs.follow(&self.views, &lenses) {
            (all.splits, all.collapses) = (splits, collapses);
        }
        Ok(all)
    }

    /// For each mesh the lenses of its places.
    ///
    /// Errors: as [`SelectiveScene::adapt`].
    pub fn lenses(&self, camera: &Camera, tau: f64, cull: Cull) -> Result<Vec<Vec<Lens>>, SelectiveError> {
        let of = |m: usize| {
            let h = self.views[m].hierarchy();
            let lens = |p: &DMat4| {
                let lens = Lens::new(h, camera, p, tau, cull)?;
                Ok(self.deviation.through(lens, camera, h.all_bounds().guarantee()))
            };
            shared::lenses(&self.places[m], lens, |source| SelectiveError::Lens { mesh: m, source })
        };
        (0..self.views.len()).map(of).collect()
    }

    /// Adapts to a camera without limits of time, at `tau`, or at the least tolerance above it with which at most `faces` faces are shown. Returns that tolerance; it is infinite
    /// if the bases have more.
    ///
    /// Errors: as [`SelectiveScene::adapt`].
    pub fn extract(
        &mut self,
        camera: &Camera,
        tau: f64,
        cull: Cull,
        faces: Option<usize>,
    ) -> Result<f64, SelectiveError> {
        let adapt = |s: &mut Self, tau| s.adapt(camera, tau, cull, &Limits::default()).map(|_| true);
        shared::extract(self, (tau, faces), adapt, Self::face_count)
    }

    /// What changed in the buffers of each mesh since this was last called.
    pub fn take_changes(&mut self) -> Vec<Changes> {
        self.morphs.take_changes(&mut self.views)
    }

    /// The scene as it is shown. At full detail it is the scene that was made progressive, bit for bit. O(n).
    pub fn to_scene(&self) -> Scene {
        shared::scene_of(&self.shell, &self.leftovers, &self.drawn().collect::<Vec<_>>())
    }

    /// The triangles shown, in the world: three corners each.
    pub fn triangles(&self) -> Vec<[DVec3; 3]> {
        shared::triangles(self.drawn(), &self.places)
    }

    /// Vertices that a camera's frustum holds, of those shown, places counted each.
    pub fn visible_vertices(&self, camera: &Camera) -> usize {
        shared::visible_vertices(self.drawn(), &self.places, camera)
    }

    /// Bytes that all views share, bytes of the views that grow with what is shown, and bytes of their tables over the finest meshes.
    pub fn bytes(&self) -> [usize; 3] {
        let shared = self.views.iter().map(|v| v.hierarchy().bytes()).sum();
        self.views.iter().chain(self.morphs.own_views()).fold([shared, 0, 0], |[s, a, t], v| {
            let (shown, tables) = v.bytes();
            [s, a + shown, t + tables]
        })
    }
}
