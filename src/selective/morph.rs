//! How changes of a scene show themselves.

use super::shared::{Attributes, Drawn};
use crate::refine::selective::{Changes, Lens, TimedMorph, View};
use glam::DVec3;

/// How changes that can be seen show themselves. Those that cannot are made at once.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Geomorph {
    /// By error: a split begins to show where its error could take up 1 / `band` of the tolerance, and shows wholly at the tolerance. It depends on the view alone, not on
    /// earlier frames, and costs the faces of the finer tolerance. `band` is more than 1.
    Error {
        /// Tolerances from nothing to all.
        band: f64,
    },
    /// By time: a change takes so many frames, at least 1. What is undone stays for as long.
    Time {
        /// How many.
        frames: u32,
    },
}

impl Geomorph {
    /// What tolerances are divided by.
    pub(super) fn band(this: Option<Geomorph>) -> f64 {
        match this {
            Some(Geomorph::Error { band }) => band.max(1.0),
            _ => 1.0,
        }
    }
}

/// The morphs of a scene's meshes.
#[derive(Clone, Debug, Default)]
pub(super) struct Morphs {
    pub(super) geomorph: Option<Geomorph>,
    /// By time: one a mesh, from the first frame on.
    timed: Vec<TimedMorph>,
    /// Vertices of each mesh that are not in their own place, ascending, and where they are; empty if all are.
    displaced: Vec<Vec<(u32, DVec3)>>,
    morphing: usize,
    /// By error: what the meshes are seen by.
    lenses: Vec<Vec<Lens>>,
}

impl Morphs {
    pub(super) fn new(geomorph: Option<Geomorph>) -> Morphs {
        Morphs { geomorph, ..Default::default() }
    }

    /// What tolerances are divided by.
    pub(super) fn band(&self) -> f64 {
        Geomorph::band(self.geomorph)
    }

    /// Vertices on the way.
    pub(super) fn morphing(&self) -> usize {
        self.morphing
    }

    /// The mesh that is drawn of mesh `m`.
    pub(super) fn view<'a>(&'a self, views: &'a [View], m: usize) -> &'a View {
        self.timed.get(m).map_or(&views[m], TimedMorph::view)
    }

    /// Mesh `m` as it is drawn.
    pub(super) fn drawn<'a>(&'a self, views: &'a [View], m: usize) -> Drawn<'a> {
        let attributes = match (self.geomorph, self.timed.get(m), self.lenses.get(m)) {
            (_, Some(timed), _) => Attributes::Timed(timed),
            (Some(Geomorph::Error { band }), _, Some(lenses)) => Attributes::ByError(lenses, band),
            _ => Attributes::Own,
        };
        Drawn { view: self.view(views, m), displaced: self.displaced(m), attributes }
    }

    /// Views besides those of the scene.
    pub(super) fn own_views(&self) -> impl Iterator<Item = &View> {
        self.timed.iter().map(TimedMorph::view)
    }

    /// The vertices of mesh `m` that are not in their own place.
    pub(super) fn displaced(&self, m: usize) -> &[(u32, DVec3)] {
        self.displaced.get(m).map_or(&[], Vec::as_slice)
    }

    pub(super) fn take_changes(&mut self, views: &mut [View]) -> Vec<Changes> {
        // The leaders' are not drawn.
        let own: Vec<Changes> = views.iter_mut().map(View::take_changes).collect();
        if self.timed.is_empty() {
            own
        } else {
            self.timed.iter_mut().map(TimedMorph::take_changes).collect()
        }
    }

    /// A frame further. Returns splits and collapses of what is drawn, if that is not what `views` did.
    pub(super) fn follow(&mut self, views: &[View], lenses: &[Vec<Lens>]) -> Option<[usize; 2]> {
        let pairs = || views.iter().zip(lenses);
        match self.geomorph {
            None => None,
            Some(Geomorph::Error { band }) => {
                self.displaced = pairs().map(|(v, l)| displaced_by_error(v, l, band)).collect();
                self.lenses = lenses.to_vec();
                self.morphing = self.displaced.iter().map(Vec::len).sum();
                None
            }
            // The first frame shows what it asks for.
            Some(Geomorph::Time { frames }) if self.timed.is_empty() => {
                self.timed = views.iter().map(|v| TimedMorph::new(v, frames)).collect();
                None
            }
            Some(Geomorph::Time { .. }) => {
                let mut sum = [0; 2];
                self.morphing = 0;
                for (t, (v, l)) in self.timed.iter_mut().zip(pairs()) {
                    let done = t.follow(v, l);
                    sum = [sum[0] + done.splits, sum[1] + done.collapses];
                    self.morphing += done.morphing;
                }
                self.displaced = self.timed.iter().map(|t| t.displaced().collect()).collect();
                Some(sum)
            }
        }
    }
}

fn displaced_by_error(view: &View, lenses: &[Lens], band: f64) -> Vec<(u32, DVec3)> {
    elsewhere(view.vertices(), |v| view.position(v), |v| view.morphed_by_all(lenses, v, band)).collect()
}

/// The vertices that are drawn elsewhere than in their own place, and where.
pub(super) fn elsewhere(
    vertices: impl Iterator<Item = u32>,
    own: impl Fn(u32) -> Option<DVec3>,
    drawn: impl Fn(u32) -> Option<DVec3>,
) -> impl Iterator<Item = (u32, DVec3)> {
    vertices.filter_map(move |v| {
        let (own, at) = (own(v)?, drawn(v)?);
        (at != own).then_some((v, at))
    })
}

/// Where vertex `v` is drawn, which has a place of its own.
pub(super) fn place(
    displaced: &[(u32, DVec3)],
    v: u32,
    own: impl FnOnce(u32) -> Option<DVec3>,
) -> Option<DVec3> {
    match displaced.binary_search_by_key(&v, |d| d.0) {
        Ok(k) => displaced.get(k).map(|d| d.1),
        Err(_) => own(v),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::{MeshInput, Semantic};
    use crate::meshes::{GenerateOptions, generate};
    use crate::pipeline::{Job, build_progressive};
    use crate::refine::hierarchy::Options;
    use crate::refine::selective::{Cull, Limits};
    use crate::selective::{SelectiveScene, circle};

    /// The normals of a mesh's corners.
    fn normals(mesh: &MeshInput) -> Vec<&[f32]> {
        let wedges = mesh.wedges.as_ref().unwrap();
        let k = wedges.channel(&Semantic::Normal).unwrap();
        wedges.corner.iter().map(|&w| wedges.get(w, k).unwrap()).collect()
    }

    #[test]
    fn a_scene_on_its_way_has_normals_that_are_so_too() {
        let sample = generate("torus", &GenerateOptions::default().with_faces(2000)).unwrap();
        let scene = crate::samples::scene(sample, "torus");
        let scene = build_progressive(scene, &Job::default(), &crate::simplify::Quiet).unwrap().scene;
        let mut scene = SelectiveScene::new(scene, &Options::default()).unwrap();
        let camera = circle(scene.bounds().unwrap(), 2).unwrap().swap_remove(0);
        for morph in [Geomorph::Time { frames: 4 }, Geomorph::Error { band: 3.0 }] {
            scene.reset();
            scene.set_geomorph(Some(morph));
            // How many corners are not drawn with their own.
            let mut at = |tau: f64| {
                scene.adapt(&camera, tau, Cull::All, &Limits::default()).unwrap();
                let (drawn, own) = (scene.to_scene(), scene.shown(0).to_input());
                let (drawn, own) = (normals(&drawn.meshes[0].geometry), normals(&own));
                assert!(drawn.iter().all(|n| (n.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-3));
                assert_eq!(drawn.len(), own.len());
                drawn.iter().zip(&own).filter(|n| n.0 != n.1).count()
            };
            at(20.0);
            assert!(at(1.0) > 100, "{morph:?}");
            if let Geomorph::Time { .. } = morph {
                let left = [0; 4].map(|_| at(1.0));
                assert_eq!(left[3], 0, "{left:?}");
            }
        }
    }
}
