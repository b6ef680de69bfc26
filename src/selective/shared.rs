//! What scenes of views have in common, whatever the views are.

use super::paged::Ranges;
use super::{morph, tolerance};
use crate::aif::MeshInput;
use crate::progressive::Leftover;
use crate::refine::paged::PagedView;
use crate::refine::selective::{Lens, LensError, TimedMorph, View};
use crate::refine::truly::TrulyView;
use crate::refine::view::{Camera, Frustum};
use crate::scene::Scene;
use glam::{DMat4, DVec3};

/// One mesh as it is shown.
pub(super) trait Shown {
    /// Faces.
    fn faces(&self) -> usize;
    /// Vertices.
    fn vertices(&self) -> usize;
    /// Where the vertices are drawn, in the mesh's own coordinates.
    fn places(&self) -> impl Iterator<Item = DVec3>;
    /// The corners of the faces, there.
    fn triangles(&self) -> impl Iterator<Item = [DVec3; 3]>;
    /// Vertices that a frustum holds if the mesh stands in these places, those of each counted.
    fn visible(&self, frustum: &Frustum, placed: &[DMat4]) -> usize {
        self.places().map(|p| held(frustum, placed, p)).sum()
    }
}

/// In how many of these places a frustum holds a vertex.
fn held(frustum: &Frustum, placed: &[DMat4], p: DVec3) -> usize {
    placed.iter().filter(|m| frustum.contains(m.transform_point3(p))).count()
}

/// One mesh of which all is in memory.
pub(super) trait Whole: Shown {
    /// As flat arrays.
    fn to_input(&self) -> MeshInput;
    /// It is at full detail, and nothing is on the way.
    fn is_full(&self) -> bool;
    /// The order of the input is known.
    fn has_order(&self) -> bool;
}

/// A view, and the vertices that are drawn elsewhere.
pub(super) struct Drawn<'a> {
    pub(super) view: &'a View,
    pub(super) displaced: &'a [(u32, DVec3)],
    pub(super) attributes: Attributes<'a>,
}

/// What attributes a view is drawn with.
#[derive(Clone, Copy)]
pub(super) enum Attributes<'a> {
    Own,
    /// Those of a morph by time.
    Timed(&'a TimedMorph),
    /// Those of a morph by error: its lenses and its band.
    ByError(&'a [Lens], f64),
}

impl Drawn<'_> {
    fn place(&self, v: u32) -> Option<DVec3> {
        morph::place(self.displaced, v, |v| self.view.position(v))
    }
}

/// Corners of the slots that hold a face.
fn corners<'a>(
    indices: &'a [[u32; 3]],
    there: impl Fn(usize) -> bool + 'a,
) -> impl Iterator<Item = [u32; 3]> + 'a {
    indices.iter().enumerate().filter(move |(slot, _)| there(*slot)).map(|(_, f)| *f)
}

impl Shown for Drawn<'_> {
    fn faces(&self) -> usize {
        self.view.face_count()
    }

    fn vertices(&self) -> usize {
        self.view.vertex_count()
    }

    fn places(&self) -> impl Iterator<Item = DVec3> {
        self.view.vertices().filter_map(|v| self.place(v))
    }

    fn triangles(&self) -> impl Iterator<Item = [DVec3; 3]> {
        let at = |w: u32| self.place(self.view.wedge_vertex(w)).unwrap_or_default();
        corners(self.view.indices(), |s| self.view.face_in(s).is_some()).map(move |f| f.map(at))
    }
}

impl Whole for Drawn<'_> {
    fn to_input(&self) -> MeshInput {
        match self.attributes {
            Attributes::Timed(morph) => morph.to_input(),
            Attributes::ByError(lenses, band) if !self.displaced.is_empty() => {
                self.view.to_input_morphed(lenses, band)
            }
            _ => self.view.to_input_with(self.displaced),
        }
    }

    fn is_full(&self) -> bool {
        let at_rest = match self.attributes {
            Attributes::Timed(morph) => morph.is_at_rest(),
            _ => self.displaced.is_empty(),
        };
        self.vertices() == self.view.hierarchy().mesh().vertices() && at_rest
    }

    fn has_order(&self) -> bool {
        self.view.hierarchy().mesh().order.is_some()
    }
}

impl Shown for &TrulyView {
    fn faces(&self) -> usize {
        self.face_count()
    }

    fn vertices(&self) -> usize {
        self.vertex_count()
    }

    fn places(&self) -> impl Iterator<Item = DVec3> {
        (0..self.hierarchy().mesh().vertices() as u32).filter_map(|v| self.position(v))
    }

    fn triangles(&self) -> impl Iterator<Item = [DVec3; 3]> {
        let at = |v: u32| self.position(v).unwrap_or_default();
        corners(self.indices(), |s| self.face_in(s).is_some()).map(move |f| f.map(at))
    }
}

impl Whole for &TrulyView {
    fn to_input(&self) -> MeshInput {
        TrulyView::to_input(self)
    }

    fn is_full(&self) -> bool {
        self.vertex_count() == self.hierarchy().mesh().vertices()
    }

    fn has_order(&self) -> bool {
        self.hierarchy().mesh().order.is_some()
    }
}

/// A view of a file, and the vertices that are drawn elsewhere.
pub(super) struct DrawnPages<'a> {
    pub(super) view: &'a PagedView<Ranges>,
    pub(super) displaced: &'a [(u32, DVec3)],
}

impl DrawnPages<'_> {
    fn place(&self, v: u32) -> Option<DVec3> {
        morph::place(self.displaced, v, |v| self.view.position(v))
    }
}

impl Shown for DrawnPages<'_> {
    fn faces(&self) -> usize {
        self.view.face_count()
    }

    fn vertices(&self) -> usize {
        self.view.vertex_count()
    }

    fn places(&self) -> impl Iterator<Item = DVec3> {
        self.view.vertices().filter_map(|v| self.place(v))
    }

    fn triangles(&self) -> impl Iterator<Item = [DVec3; 3]> {
        let at = |w: u32| self.place(self.view.wedge_vertex(w)).unwrap_or_default();
        corners(self.view.indices(), |s| self.view.face_in(s).is_some()).map(move |f| f.map(at))
    }

    fn visible(&self, frustum: &Frustum, placed: &[DMat4]) -> usize {
        let held = |p: DVec3| held(frustum, placed, p);
        // As if none were elsewhere, and then those that are.
        let mut sum = self.view.visible(frustum, placed);
        for &(v, at) in self.displaced {
            if let Some(own) = self.view.position(v) {
                sum = sum + held(at) - held(own);
            }
        }
        sum
    }
}

/// Faces of all meshes, each counted once.
pub(super) fn face_count<S: Shown>(all: impl Iterator<Item = S>) -> usize {
    all.map(|s| s.faces()).sum()
}

/// Vertices of all meshes, each counted once.
pub(super) fn vertex_count<S: Shown>(all: impl Iterator<Item = S>) -> usize {
    all.map(|s| s.vertices()).sum()
}

/// The triangles shown, in the world: three corners each.
pub(super) fn triangles<S: Shown>(all: impl Iterator<Item = S>, places: &[Vec<DMat4>]) -> Vec<[DVec3; 3]> {
    let mut out = Vec::new();
    for (shown, places) in all.zip(places) {
        let own: Vec<[DVec3; 3]> = shown.triangles().collect();
        for m in places {
            out.extend(own.iter().map(|t| t.map(|p| m.transform_point3(p))));
        }
    }
    out
}

/// Vertices that a camera's frustum holds, of those shown, places counted each.
pub(super) fn visible_vertices<S: Shown>(
    all: impl Iterator<Item = S>,
    places: &[Vec<DMat4>],
    camera: &Camera,
) -> usize {
    let frustum = camera.frustum();
    all.zip(places).map(|(shown, placed)| shown.visible(&frustum, placed)).sum()
}

/// The scene as it is shown; at full detail the one that was made progressive, bit for bit.
pub(super) fn scene_of<W: Whole>(shell: &Scene, leftovers: &[Leftover], all: &[W]) -> Scene {
    let mut scene = shell.clone();
    scene.meshes.resize_with(all.len(), Default::default);
    let full = all.iter().all(W::is_full);
    for (i, shown) in all.iter().enumerate() {
        let geometry = shown.to_input();
        let whole = full && shown.has_order();
        let geometry = match leftovers.get(i).filter(|_| whole) {
            Some(left) => left.put_back(geometry),
            None => geometry,
        };
        let faces = whole.then(|| (0..geometry.face_count() as u32).collect());
        scene.meshes[i].stand(geometry, faces, whole);
    }
    scene
}

/// The lenses of a mesh that stands in these places.
///
/// Errors: those of `lens`, as `failed` makes them.
pub(super) fn lenses<E>(
    places: &[DMat4],
    lens: impl Fn(&DMat4) -> Result<Lens, LensError>,
    failed: impl FnOnce(LensError) -> E,
) -> Result<Vec<Lens>, E> {
    places.iter().map(lens).collect::<Result<_, _>>().map_err(failed)
}

/// Adapts a scene without limits of time, at `tau`, or at the least tolerance above it with which at most `faces` faces are shown. `adapt` says whether all was done that
/// the tolerance asks for. Returns that tolerance; it is infinite if there is none.
///
/// Errors: those of `adapt`.
pub(super) fn extract<T, E>(
    scene: &mut T,
    (tau, faces): (f64, Option<usize>),
    mut adapt: impl FnMut(&mut T, f64) -> Result<bool, E>,
    count: impl Fn(&T) -> usize,
) -> Result<f64, E> {
    let most = faces.unwrap_or(usize::MAX);
    tolerance::least(tau, |tau| Ok(adapt(scene, tau)? && count(scene) <= most))
}
