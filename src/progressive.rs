//! A scene whose meshes are progressive: the scene at any level of detail.

mod leftover;

pub use leftover::Leftover;

use crate::pipeline::world_scales;
use crate::refine::hierarchy::{self, Bounds};
use crate::refine::progressive::Damage;
use crate::refine::{Geomorph, GeomorphError, ProgressiveMesh};
use crate::scene::Scene;
use std::sync::Arc;

/// A scene with progressive meshes in place of its meshes.
#[derive(Clone, Debug, Default)]
pub struct ProgressiveScene {
    /// One for each mesh of the scene.
    pub meshes: Vec<ProgressiveMesh>,
    /// The mesh whose next split comes, coarsest first: the splits of all meshes in one order.
    pub turns: Vec<u32>,
    /// Everything else: nodes, materials, images, names. Its meshes have no geometry.
    pub shell: Scene,
    /// For each mesh the faces that no mesh can hold, which are there at full detail only; none where the vector ends.
    pub leftovers: Vec<Leftover>,
}

/// How far to refine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Detail {
    /// The coarsest there is.
    Base,
    /// Everything.
    Full,
    /// The finest of at most this many triangles over all meshes, or the coarsest there is.
    Triangles(usize),
    /// The coarsest from which on no split's estimated error is larger than this, world units. An estimate, no bound.
    MaxError(f64),
    /// The level of this number, 0 the coarsest; the finest stands for all beyond. With NSA these are its passes.
    Level(usize),
}

impl ProgressiveScene {
    /// Triangles at full detail. O(n).
    pub fn triangles(&self) -> usize {
        self.meshes.iter().map(ProgressiveMesh::faces).sum()
    }

    /// Triangles of the bases.
    pub fn base_triangles(&self) -> usize {
        self.meshes.iter().map(|m| m.base_faces.len()).sum()
    }

    /// Vertices at full detail.
    pub fn vertices(&self) -> usize {
        self.meshes.iter().map(ProgressiveMesh::vertices).sum()
    }

    /// Splits of all meshes.
    pub fn splits(&self) -> usize {
        self.meshes.iter().map(|m| m.splits.len()).sum()
    }

    /// Levels there are: as many as the mesh with most of them has.
    pub fn levels(&self) -> usize {
        self.meshes.iter().map(|m| m.levels.len()).max().unwrap_or(0)
    }

    /// How many splits of every mesh lead to `detail`. O(n).
    pub fn positions(&self, detail: Detail) -> Vec<usize> {
        match detail {
            Detail::Base => vec![0; self.meshes.len()],
            Detail::Full => self.meshes.iter().map(|m| m.splits.len()).collect(),
            Detail::Triangles(most) => self.at_triangles(most),
            Detail::MaxError(most) => {
                let each = self.meshes.iter().zip(world_scales(&self.shell));
                each.map(|(m, scale)| {
                    let last = m.splits.error.iter().rposition(|&e| e as f64 * scale > most);
                    last.map_or(0, |i| i + 1)
                })
                .collect()
            }
            Detail::Level(k) => {
                // Counted from the finest: a mesh with fewer levels was done earlier.
                let coarser = self.levels().saturating_sub(1).saturating_sub(k);
                let of = |m: &ProgressiveMesh| {
                    let i = m.levels.len().checked_sub(1).map(|last| last.saturating_sub(coarser));
                    i.map_or(m.splits.len(), |i| m.levels[i] as usize)
                };
                self.meshes.iter().map(of).collect()
            }
        }
    }

    /// Puts the splits of all meshes in order of their errors, in the world, level by level ([`ProgressiveMesh::sorted_by_error`]). To be done to what was read from a file before a
    /// [`Detail`] between base and full detail is asked for: there splits come in chunks, of which some refine one part of a mesh and others another. A mesh that cannot be
    /// sorted stays as it is. O(n log n).
    pub fn sort_by_error(&mut self) {
        for mesh in &mut self.meshes {
            if let Some(sorted) = mesh.sorted_by_error() {
                *mesh = sorted;
            }
        }
        if self.meshes.len() < 2 {
            return;
        }
        let scales = world_scales(&self.shell);
        let mut all: Vec<(usize, f64, u32)> = Vec::with_capacity(self.turns.len());
        for ((m, mesh), scale) in (0u32..).zip(&self.meshes).zip(scales) {
            // The levels that are still to come: meshes with fewer were done earlier.
            let ends = mesh.levels.iter().filter(|&&l| l > 0);
            let (mut rest, mut start) = (ends.clone().count(), 0);
            for &end in ends {
                rest -= 1;
                let errors = mesh.splits.error.get(start..end as usize).unwrap_or_default();
                // What a mesh cannot be sorted by rises no more.
                let mut least = f64::INFINITY;
                all.extend(errors.iter().map(|&e| {
                    least = least.min(scale * e as f64);
                    (rest, least, m)
                }));
                start = end as usize;
            }
        }
        all.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)));
        self.turns = all.into_iter().map(|(_, _, m)| m).collect();
    }

    fn at_triangles(&self, most: usize) -> Vec<usize> {
        let mut at = vec![0; self.meshes.len()];
        let mut have = self.base_triangles();
        for &m in &self.turns {
            let Some(mesh) = self.meshes.get(m as usize) else { continue };
            let Some(code) = mesh.splits.code.get(at[m as usize]) else { continue };
            have += 1 + code.two_faces() as usize;
            if have > most {
                break;
            }
            at[m as usize] += 1;
        }
        at
    }

    /// Measures the bounds of all meshes that have none, and keeps them there: for view-dependent refinement, and for files of them.
    ///
    /// Errors: the number of a mesh, and what is damaged in it.
    pub fn measure_bounds(&mut self, options: &hierarchy::Options) -> Result<(), (usize, Damage)> {
        for (i, mesh) in self.meshes.iter_mut().enumerate().filter(|(_, m)| m.bounds.is_none()) {
            mesh.bounds = Some(Arc::new(Bounds::measure(mesh, options).map_err(|e| (i, e))?));
        }
        Ok(())
    }

    /// The scene with so many splits of every mesh applied; in the order of the input, if that is known. O(n).
    ///
    /// Errors: the number of a mesh, and what is damaged in it.
    pub fn at(&self, positions: &[usize]) -> Result<Scene, (usize, Damage)> {
        let mut scene = self.shell.clone();
        scene.meshes.resize_with(self.meshes.len(), Default::default);
        // A mesh may be at full detail on the way, but what cannot be simplified is no part of a coarser scene.
        let whole = self.meshes.iter().zip(positions).all(|(m, &to)| to >= m.splits.len());
        for (i, (mesh, &to)) in self.meshes.iter().zip(positions).enumerate() {
            let mut cursor = mesh.cursor().map_err(|e| (i, e))?;
            cursor.seek(to).map_err(|e| (i, e))?;
            let geometry = cursor.to_ordered_input();
            let ordered = whole && mesh.order.is_some();
            let left = self.leftovers.get(i).filter(|l| !l.is_empty());
            let geometry = match left.filter(|_| ordered) {
                Some(left) => left.put_back(geometry),
                None => geometry,
            };
            let numbered = !scene.meshes[i].extras.of_faces.is_empty();
            let faces = match (numbered, ordered, left) {
                (false, ..) => None,
                (_, true, _) => Some((0..geometry.face_count() as u32).collect()),
                (_, _, None) => cursor.input_faces(),
                (_, _, Some(left)) => cursor.input_faces().map(|f| left.numbers(f)),
            };
            scene.meshes[i].stand(geometry, faces, ordered);
        }
        Ok(scene)
    }
}

impl ProgressiveScene {
    /// The scene on the way from the state after so many splits of every mesh to another, at 0 the one, at 1 the other ([`Geomorph`]); and the
    /// triangles of both. Numbering is that of the splits. O(n).
    ///
    /// Errors: the number of a mesh, and what is damaged in it.
    pub fn between(
        &self,
        from: &[usize],
        to: &[usize],
        a: f64,
    ) -> Result<(Scene, [usize; 2]), (usize, GeomorphError)> {
        let mut scene = self.shell.clone();
        scene.meshes.resize_with(self.meshes.len(), Default::default);
        let mut triangles = [0, 0];
        for (i, ((mesh, &from), &to)) in self.meshes.iter().zip(from).zip(to).enumerate() {
            let morph = Geomorph::new(mesh, from, to).map_err(|e| (i, e))?;
            let ends = [morph.coarse_faces(), morph.indices().len()];
            let rising = from <= to;
            scene.meshes[i].stand(morph.at(if rising { a } else { 1.0 - a }), None, false);
            triangles[0] += ends[!rising as usize];
            triangles[1] += ends[rising as usize];
        }
        Ok((scene, triangles))
    }
}

/// Takes the geometry out of a scene's meshes; what is left is the shell of a [`ProgressiveScene`].
pub fn shell_of(mut scene: Scene) -> Scene {
    scene.meshes.iter_mut().for_each(|m| m.geometry = Default::default());
    scene
}
