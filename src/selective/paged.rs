//! A scene refined where a camera needs it, of which only what is needed is read.

use super::shared::DrawnPages;
use super::{Deviation, Geomorph, morph, places_of, shared};
use crate::aif::NONE;
use crate::io::DecodeError;
use crate::io::grid::ReadAt;
use crate::io::pm::{self, Extent, Shelled};
use crate::refine::format::{ByteRanges, ChunkType, FormatError, RangeReader};
use crate::refine::hierarchy::{Guarantee, Rule};
use crate::refine::paged::{PagedDone, PagedError, PagedLimits, PagedView, Traffic};
use crate::refine::selective::{Cull, Lens, LensError, Limits};
use crate::refine::view::Camera;
use crate::scene::Scene;
use glam::{DMat4, DVec3};
use std::ops::Range;
use std::sync::Arc;

/// Bytes at any place as ranges of a progressive mesh.
#[derive(Clone)]
pub struct Ranges(pub Arc<dyn ReadAt>);

impl std::fmt::Debug for Ranges {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Ranges({} bytes)", self.0.length())
    }
}

impl ByteRanges for Ranges {
    fn fetch(&self, range: Range<u64>) -> std::io::Result<Vec<u8>> {
        let end = range.end.min(self.0.length());
        let length = end.saturating_sub(range.start);
        let length = usize::try_from(length).map_err(|_| std::io::ErrorKind::OutOfMemory)?;
        let mut out = vec![0; length];
        self.0.read_at(range.start, &mut out)?;
        Ok(out)
    }

    fn shared(&self) -> Option<Arc<dyn ByteRanges + Send + Sync>> {
        Some(Arc::new(self.clone()))
    }
}

/// A scene cannot be refined out of core.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PagedSceneError {
    /// The file is damaged, or could not be read.
    #[error("{0}")]
    Format(#[from] FormatError),
    /// What stands around the meshes is damaged.
    #[error("{0}")]
    Scene(#[from] DecodeError),
    /// A mesh.
    #[error("mesh {mesh}: {source}")]
    Mesh {
        /// Its number.
        mesh: usize,
        /// What is wrong.
        source: PagedError,
    },
    /// The view cannot be had of a mesh.
    #[error("mesh {mesh}: {source}")]
    Lens {
        /// Its number.
        mesh: usize,
        /// What is wrong.
        source: LensError,
    },
}

/// What changed of a mesh since it was last asked: what is to be uploaded.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PagedChanges {
    /// Runs of slots of the index buffer whose corners changed, ascending; a few unchanged ones between two may be in.
    pub faces: Vec<Range<usize>>,
    /// Entries of the vertex buffer that are new or have other values, at most.
    pub wedges: usize,
}

impl PagedChanges {
    /// Bytes of the index buffer to upload: 12 a face.
    pub fn index_bytes(&self) -> usize {
        self.faces.iter().map(|r| 12 * r.len()).sum()
    }
}

/// As [`super::SelectiveScene`], of a file that is read where it is needed ([`PagedView`]). The limit of memory is for all meshes together; what stands around them (nodes, materials,
/// images) comes on top.
#[derive(Debug)]
pub struct PagedScene {
    shell: Scene,
    views: Vec<PagedView<Ranges>>,
    places: Vec<Vec<DMat4>>,
    boxes: Vec<Option<Extent>>,
    deviation: Deviation,
    geomorph: Option<Geomorph>,
    /// The first frame has been shown: from then on changes take time.
    begun: bool,
    /// Vertices of each mesh that are not in their own place, ascending, and where they are.
    displaced: Vec<Vec<(u32, DVec3)>>,
    morphing: usize,
    reader: Arc<RangeReader<Ranges>>,
    limit: usize,
    file_bytes: u64,
    shell_bytes: u64,
    chunks: usize,
}

/// Views of all meshes of a file, which show their bases.
fn bases(reader: &Arc<RangeReader<Ranges>>, limit: usize) -> Result<Vec<PagedView<Ranges>>, PagedSceneError> {
    let mut views: Vec<PagedView<Ranges>> = Vec::new();
    let mut held = 0;
    for mesh in 0..reader.directory().meshes as usize {
        let view = PagedView::new(reader.clone(), mesh as u32, limit.saturating_sub(held));
        let view = view.map_err(|source| PagedSceneError::Mesh { mesh, source })?;
        held += view.bytes();
        views.push(view);
    }
    Ok(views)
}

impl PagedScene {
    /// Reads the directory, the bases and what stands around the meshes; every mesh shows its base.
    ///
    /// Errors: a file that was not written for it, damage, a limit of `limit` bytes that not even the bases fit into.
    pub fn new(source: Arc<dyn ReadAt>, limit: usize) -> Result<PagedScene, PagedSceneError> {
        let file_bytes = source.length();
        let reader = Arc::new(RangeReader::new(Ranges(source))?);
        let directory = reader.directory();
        if directory.file_bytes() > file_bytes {
            return Err(FormatError::Head("the file is shorter than it says").into());
        }
        let meshes = directory.meshes as usize;
        let of_scene = directory.chunks.iter().find(|c| c.kind == ChunkType::SCENE);
        let bytes = match of_scene.map(|c| (c, reader.read(c.index, None))) {
            Some((_, Ok(crate::refine::format::Piece::Scene(bytes)))) => Some(bytes),
            Some((_, Err(e))) => return Err(e.into()),
            _ => None,
        };
        let shell_bytes = of_scene.map_or(0, |c| c.stored);
        let Shelled { scene: shell, boxes, .. } = pm::shell(bytes.as_deref(), meshes)?;
        let chunks = directory.chunks.iter().filter(|c| c.kind.is_read_alone()).count();
        let views = bases(&reader, limit)?;
        let places = places_of(&shell, meshes);
        Ok(PagedScene {
            shell,
            views,
            places,
            boxes,
            deviation: Deviation::Uniform,
            geomorph: None,
            begun: false,
            displaced: vec![Vec::new(); meshes],
            morphing: 0,
            reader,
            limit,
            file_bytes,
            shell_bytes,
            chunks,
        })
    }

    /// When splits may be made: what the file's bounds are for; of several meshes the weakest.
    pub fn rule(&self) -> Rule {
        match self.views.iter().all(|v| v.rule() == Rule::Rings) {
            true => Rule::Rings,
            false => Rule::Cuts,
        }
    }

    /// Back to the bases, as if nothing had been shown or read.
    ///
    /// Errors: as [`PagedScene::new`].
    pub fn reset(&mut self) -> Result<(), PagedSceneError> {
        self.views.clear();
        self.displaced.iter_mut().for_each(|d| *d = Vec::new());
        self.views = bases(&self.reader, self.limit)?;
        self.set_geomorph(self.geomorph)
    }

    /// From the next frame on changes that can be seen show themselves so, as those of [`super::SelectiveScene::set_geomorph`] do; `None`: at once. What that takes is within the limit of memory; where
    /// there is too little left of it, the changes of a frame by [`Geomorph::Time`] are made at once.
    ///
    /// Errors: damage, while what is still on the way is made.
    pub fn set_geomorph(&mut self, geomorph: Option<Geomorph>) -> Result<(), PagedSceneError> {
        let beside = match geomorph {
            Some(Geomorph::Error { .. }) => size_of::<(u32, DVec3)>(),
            _ => 0,
        };
        for (mesh, view) in self.views.iter_mut().enumerate() {
            view.set_timed(None).map_err(|source| PagedSceneError::Mesh { mesh, source })?;
            view.set_beside(beside);
        }
        (self.geomorph, self.begun, self.morphing) = (geomorph, false, 0);
        self.displaced.iter_mut().for_each(|d| *d = Vec::new());
        Ok(())
    }

    /// Vertices of the last frame that are not where they will be.
    pub fn morphing(&self) -> usize {
        self.morphing
    }

    /// The vertices of mesh `m` that are drawn elsewhere than its view has them, ascending, and where, in the mesh's own coordinates; of no such mesh none.
    pub fn displaced(&self, m: usize) -> &[(u32, DVec3)] {
        self.displaced.get(m).map_or(&[], Vec::as_slice)
    }

    /// The meshes as they are drawn.
    fn drawn(&self) -> impl Iterator<Item = DrawnPages<'_>> {
        self.views.iter().zip(&self.displaced).map(|(view, displaced)| DrawnPages { view, displaced })
    }

    /// Where each mesh stands.
    pub fn placements(&self) -> &[Vec<DMat4>] {
        &self.places
    }

    /// The views, one a mesh.
    pub fn views(&self) -> &[PagedView<Ranges>] {
        &self.views
    }

    /// How errors count from the next frame on. [`Deviation::Upright`] is for files whose bounds are differences of height, as those of terrain are: it is not looked after here. Directions are not known.
    pub fn set_deviation(&mut self, deviation: Deviation) {
        self.deviation = deviation;
    }

    /// Faces shown, of all meshes, each counted once.
    pub fn face_count(&self) -> usize {
        shared::face_count(self.drawn())
    }

    /// Faces that the last frame asked for: [`PagedScene::face_count`], but for what [`Geomorph::Time`] still shows.
    pub fn needed_faces(&self) -> usize {
        self.views.iter().map(PagedView::needed_faces).sum()
    }

    /// Vertices shown.
    pub fn vertex_count(&self) -> usize {
        shared::vertex_count(self.drawn())
    }

    /// Splits applied.
    pub fn applied(&self) -> usize {
        self.views.iter().map(PagedView::applied).sum()
    }

    /// Faces at full detail.
    pub fn full_faces(&self) -> usize {
        self.views.iter().map(PagedView::full_faces).sum()
    }

    /// Vertices at full detail.
    pub fn full_vertices(&self) -> usize {
        self.views.iter().map(PagedView::full_vertices).sum()
    }

    /// Splits at full detail.
    pub fn splits(&self) -> usize {
        self.views.iter().map(PagedView::splits).sum()
    }

    /// Bytes held for the meshes, never more than the limit.
    pub fn bytes(&self) -> usize {
        self.views.iter().map(PagedView::bytes).sum()
    }

    /// Of these, bytes that grow with what is shown.
    pub fn shown_bytes(&self) -> usize {
        self.views.iter().map(PagedView::shown_bytes).sum()
    }

    /// Bytes of the file.
    pub fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    /// Chunks of splits in the file.
    pub fn chunks(&self) -> usize {
        self.chunks
    }

    /// What was read so far. Head and directory count once.
    pub fn traffic(&self) -> Traffic {
        let mut all = Traffic::default();
        (all.bytes_read, all.bytes_touched) = (self.shell_bytes, self.shell_bytes);
        all.requests = (self.shell_bytes > 0) as u64;
        for (k, view) in self.views.iter().enumerate() {
            let (t, again) = (view.traffic(), if k > 0 { view.directory_bytes() } else { 0 });
            all.bytes_read += t.bytes_read - again;
            all.bytes_touched += t.bytes_touched - again;
            all.requests += t.requests - if k > 0 { 2 } else { 0 };
            all.chunks_decoded += t.chunks_decoded;
            all.chunks_touched += t.chunks_touched;
            all.evictions += t.evictions;
        }
        all
    }

    /// Least and greatest coordinates, in the world, of the boxes of the meshes at full detail, which stand in the file (with quantised places: those before they were rounded); of a file without them of
    /// boxes with the middle and the diagonal of the finest mesh's and the shape of the base's. `None` if nothing is shown.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut all: Option<(DVec3, DVec3)> = None;
        for (mesh, (view, places)) in self.views.iter().zip(&self.places).enumerate() {
            let about = || {
                let ((middle, diagonal), (lo, hi)) = (view.extent(), view.base_box()?);
                let size = hi - lo;
                let half = 0.5 * size * (diagonal / size.length().max(f64::MIN_POSITIVE)).min(1e9);
                Some((middle - half, middle + half))
            };
            let Some((lo, hi)) = self.boxes.get(mesh).copied().flatten().or_else(about) else { continue };
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

    /// Adapts all meshes to a camera. The limits of faces, memory and fetches are for all of them; the others are for each.
    ///
    /// Errors: damage; a tolerance that is none; a mesh placed by a matrix that flattens it.
    pub fn adapt(
        &mut self,
        camera: &Camera,
        tau: f64,
        cull: Cull,
        limits: &PagedLimits<'_>,
    ) -> Result<PagedDone, PagedSceneError> {
        let mut all = PagedDone::NOTHING;
        let tau = tau / Geomorph::band(self.geomorph);
        let mut seen_by = Vec::with_capacity(self.views.len());
        for mesh in 0..self.views.len() {
            let lens = |p: &DMat4| {
                let lens = self.views[mesh].lens(camera, p, tau, cull)?;
                // Bounds of other kinds are not along it: who sets it knows.
                Ok(self.deviation.through(lens, camera, Guarantee::Vertical))
            };
            let failed = |source| PagedSceneError::Lens { mesh, source };
            let lenses = shared::lenses(&self.places[mesh], lens, failed)?;
            let others = self.needed_faces() - self.views[mesh].needed_faces();
            let faces = limits.limits.faces.saturating_sub(others);
            // Once with what is free, and if that is too little, once more with what others can spare.
            for attempt in 0..2 {
                let held = self.bytes() - self.views[mesh].bytes();
                let view = &mut self.views[mesh];
                view.set_limit(self.limit.saturating_sub(held));
                let own = PagedLimits {
                    limits: Limits { faces, ..limits.limits },
                    fetches: limits.fetches.saturating_sub(all.fetched),
                };
                let done = view.adapt(&lenses, &own);
                let done = done.map_err(|source| PagedSceneError::Mesh { mesh, source })?;
                let spare = |(k, v): (usize, &mut PagedView<Ranges>)| if k == mesh { 0 } else { v.trim() };
                let more = done.no_room > 0 && attempt == 0;
                if more && self.views.iter_mut().enumerate().map(spare).sum::<usize>() > 0 {
                    all += done.so_far();
                    continue;
                }
                all += done;
                break;
            }
            seen_by.push(lenses);
        }
        if let Some([splits, collapses]) = self.follow(&seen_by)? {
            (all.done.splits, all.done.collapses) = (splits, collapses);
        }
        Ok(all)
    }

    /// Draws a frame as geomorphs have it. Returns splits and collapses of what is drawn, if that is not what was asked for.
    fn follow(&mut self, lenses: &[Vec<Lens>]) -> Result<Option<[usize; 2]>, PagedSceneError> {
        let failed = |mesh: usize| move |source| PagedSceneError::Mesh { mesh, source };
        match self.geomorph {
            None => Ok(None),
            Some(Geomorph::Error { band }) => {
                for ((view, displaced), lenses) in self.views.iter().zip(&mut self.displaced).zip(lenses) {
                    // No more than was set aside for it.
                    *displaced = Vec::new();
                    displaced.reserve_exact(view.vertex_count());
                    let drawn = |v| view.morphed_by_all(lenses, v, band);
                    displaced.extend(morph::elsewhere(view.vertices(), |v| view.position(v), drawn));
                }
                self.morphing = self.displaced.iter().map(Vec::len).sum();
                Ok(None)
            }
            // The first frame shows what it asks for.
            Some(Geomorph::Time { frames }) if !self.begun => {
                for (mesh, view) in self.views.iter_mut().enumerate() {
                    view.set_timed(Some(frames)).map_err(failed(mesh))?;
                }
                self.begun = true;
                Ok(None)
            }
            Some(Geomorph::Time { .. }) => {
                let mut sum = [0; 2];
                self.morphing = 0;
                for (mesh, (view, lenses)) in self.views.iter_mut().zip(lenses).enumerate() {
                    self.displaced[mesh] = Vec::new();
                    let done = view.follow(lenses).map_err(failed(mesh))?;
                    sum = [sum[0] + done.splits, sum[1] + done.collapses];
                    self.morphing += done.morphing;
                    self.displaced[mesh] = view.displaced().collect();
                }
                Ok(Some(sum))
            }
        }
    }

    /// Adapts to a camera at `tau`, or at the least tolerance above it with which at most `faces` faces are shown and what the camera needs fits into the memory. Returns that tolerance;
    /// it is infinite if the bases have more faces.
    ///
    /// Errors: as [`PagedScene::adapt`].
    pub fn extract(
        &mut self,
        camera: &Camera,
        tau: f64,
        cull: Cull,
        faces: Option<usize>,
    ) -> Result<f64, PagedSceneError> {
        let limits = PagedLimits::default();
        let adapt = |s: &mut Self, tau| s.adapt(camera, tau, cull, &limits).map(|done| done.done.complete);
        shared::extract(self, (tau, faces), adapt, Self::face_count)
    }

    /// What changed in the buffers of each mesh since this was last called.
    pub fn take_changes(&mut self) -> Vec<PagedChanges> {
        let each = self.views.iter_mut().map(PagedView::take_changes);
        each.map(|(faces, wedges)| PagedChanges { faces, wedges }).collect()
    }

    /// The scene as it is shown. O(n shown); the memory it takes comes on top of the limit.
    pub fn to_scene(&self) -> Scene {
        let mut scene = self.shell.clone();
        scene.meshes.resize_with(self.views.len(), Default::default);
        let materials = scene.materials.len() as u32;
        for (mesh, drawn) in scene.meshes.iter_mut().zip(self.drawn()) {
            let mut geometry = drawn.view.to_input_with(drawn.displaced);
            // What the file's pages name is known only now.
            geometry.face_material.iter_mut().filter(|m| **m >= materials).for_each(|m| *m = NONE);
            let groups = mesh.groups.len() as u32;
            if groups > 0 {
                geometry.face_group.iter_mut().filter(|g| **g >= groups).for_each(|g| *g = NONE);
            }
            mesh.stand(geometry, None, false);
        }
        scene
    }

    /// The triangles shown, in the world: three corners each. What this takes comes on top of the limit.
    pub fn triangles(&self) -> Vec<[DVec3; 3]> {
        shared::triangles(self.drawn(), &self.places)
    }

    /// Vertices that a camera's frustum holds, of those shown, places counted each.
    pub fn visible_vertices(&self, camera: &Camera) -> usize {
        shared::visible_vertices(self.drawn(), &self.places, camera)
    }
}
