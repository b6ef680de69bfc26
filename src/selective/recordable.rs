//! What a recorder asks of a scene, in memory or out of core.

use super::{PagedChanges, PagedScene, SelectiveScene, morph};
use crate::refine::selective::Changes;
use glam::{DMat4, DVec3};
use std::ops::Range;

/// A scene whose flights can be recorded: [`SelectiveScene`] and [`PagedScene`]. Meshes are numbered from 0; methods that take one are not called with others.
pub trait Recordable {
    /// What changed of a mesh in a frame.
    type Changes;
    /// Meshes.
    fn meshes(&self) -> usize;
    /// Where each stands.
    fn placements(&self) -> &[Vec<DMat4>];
    /// Faces at full detail.
    fn full_faces(&self) -> usize;
    /// Faces shown.
    fn face_count(&self) -> usize;
    /// Vertices shown.
    fn vertex_count(&self) -> usize;
    /// Vertices that are not where they will be.
    fn morphing(&self) -> usize;
    /// Least and greatest coordinates in the world; `None` if nothing is shown.
    fn bounds(&self) -> Option<(DVec3, DVec3)>;
    /// A place in the middle of mesh `m`.
    fn origin(&self, m: usize) -> DVec3;
    /// Slots of its index buffer.
    fn slots(&self, m: usize) -> usize;
    /// The vertices of the face in a slot, if there is one.
    fn corners(&self, m: usize, slot: usize) -> Option<[u32; 3]>;
    /// Where vertex `v` is drawn, in the mesh's own coordinates; `None` if it is not, or if there is none such.
    fn place(&self, m: usize, v: u32) -> Option<DVec3>;
    /// The vertices that are drawn elsewhere than the mesh has them, ascending, and where.
    fn displaced(&self, m: usize) -> &[(u32, DVec3)];
    /// The vertices shown.
    fn vertices(&self, m: usize) -> Vec<u32>;
    /// The slots that changed.
    fn changed_slots<'a>(&self, changes: &'a Self::Changes) -> &'a [Range<usize>];
    /// Vertices that may stand elsewhere now, or are gone, besides those in changed slots; `None` if that may be any.
    fn changed_vertices(&self, m: usize, changes: &Self::Changes) -> Option<Vec<u32>>;
}

/// What both scenes say themselves, by the same names.
macro_rules! as_the_scene_says {
    () => {
        fn meshes(&self) -> usize {
            self.views().len()
        }

        fn placements(&self) -> &[Vec<DMat4>] {
            self.placements()
        }

        fn full_faces(&self) -> usize {
            self.full_faces()
        }

        fn face_count(&self) -> usize {
            self.face_count()
        }

        fn vertex_count(&self) -> usize {
            self.vertex_count()
        }

        fn morphing(&self) -> usize {
            self.morphing()
        }

        fn bounds(&self) -> Option<(DVec3, DVec3)> {
            self.bounds()
        }

        fn displaced(&self, m: usize) -> &[(u32, DVec3)] {
            self.displaced(m)
        }
    };
}

impl Recordable for SelectiveScene {
    type Changes = Changes;

    as_the_scene_says!();

    fn origin(&self, m: usize) -> DVec3 {
        self.views()[m].hierarchy().extent().0
    }

    fn slots(&self, m: usize) -> usize {
        self.shown(m).indices().len()
    }

    fn corners(&self, m: usize, slot: usize) -> Option<[u32; 3]> {
        let view = self.shown(m);
        view.face_in(slot).map(|_| view.indices()[slot].map(|w| view.wedge_vertex(w)))
    }

    fn place(&self, m: usize, v: u32) -> Option<DVec3> {
        let view = self.shown(m);
        let there = (v as usize) < view.hierarchy().mesh().vertices();
        there.then(|| morph::place(self.displaced(m), v, |v| view.position(v))).flatten()
    }

    fn vertices(&self, m: usize) -> Vec<u32> {
        let view = self.shown(m);
        (0..view.hierarchy().mesh().vertices() as u32).filter(|&v| view.position(v).is_some()).collect()
    }

    fn changed_slots<'a>(&self, changes: &'a Changes) -> &'a [Range<usize>] {
        &changes.faces
    }

    fn changed_vertices(&self, m: usize, changes: &Changes) -> Option<Vec<u32>> {
        let view = self.shown(m);
        Some(changes.wedges.iter().map(|&w| view.wedge_vertex(w)).collect())
    }
}

impl Recordable for PagedScene {
    type Changes = PagedChanges;

    as_the_scene_says!();

    fn origin(&self, m: usize) -> DVec3 {
        self.views()[m].extent().0
    }

    fn slots(&self, m: usize) -> usize {
        self.views()[m].indices().len()
    }

    fn corners(&self, m: usize, slot: usize) -> Option<[u32; 3]> {
        let view = &self.views()[m];
        view.face_in(slot).map(|_| view.indices()[slot].map(|w| view.wedge_vertex(w)))
    }

    fn place(&self, m: usize, v: u32) -> Option<DVec3> {
        morph::place(self.displaced(m), v, |v| self.views()[m].position(v))
    }

    fn vertices(&self, m: usize) -> Vec<u32> {
        self.views()[m].vertices().collect()
    }

    fn changed_slots<'a>(&self, changes: &'a PagedChanges) -> &'a [Range<usize>] {
        &changes.faces
    }

    fn changed_vertices(&self, m: usize, _: &PagedChanges) -> Option<Vec<u32>> {
        // Which it were is not kept.
        (!self.views()[m].moves_vertices()).then(Vec::new)
    }
}
