//! A cut through a vertex hierarchy, wherever it is kept: in memory as a whole ([`super::View`]) or by pages ([`crate::paged`]).

use super::entry::Entry;
use super::{Lens, View};
use crate::aif::NONE;
use glam::DVec3;

/// Which splits are applied, and what is known of those and of the nodes they made. Of other splits nothing is asked but whether they are applied.
pub(crate) trait Cut {
    /// Split `i` is applied.
    fn is_applied(&self, i: u32) -> bool;
    /// The node that vertex `v` is at; [`NONE`] if it is not in the mesh.
    fn node(&self, v: u32) -> u32;
    /// The split that made a node; [`NONE`] for the base's.
    fn maker(&self, node: u32) -> u32;
    /// The node that split `i` replaces, and its vertex.
    fn parent(&self, i: u32) -> (u32, u32);
    /// The vertex that split `i` makes.
    fn new_vertex(&self, i: u32) -> u32;
    /// The splits that replace the two nodes that split `i` makes, the old vertex's first; [`NONE`] for a leaf.
    fn below(&self, i: u32) -> [u32; 2];
    /// Split `i`, ready to be decided about.
    fn entry(&self, i: u32) -> Entry;
    /// Where a node, which is vertex `v`, stands.
    fn place(&self, node: u32, v: u32) -> DVec3;
}

impl Cut for View {
    #[inline]
    fn is_applied(&self, i: u32) -> bool {
        self.front.is_applied(i)
    }

    #[inline]
    fn node(&self, v: u32) -> u32 {
        self.front.node(&self.hierarchy.forest, v)
    }

    #[inline]
    fn maker(&self, node: u32) -> u32 {
        self.hierarchy.forest.maker(node)
    }

    fn parent(&self, i: u32) -> (u32, u32) {
        let h = &*self.hierarchy;
        (h.forest.parent(h.mesh(), i), h.mesh().splits.vertex[i as usize])
    }

    fn new_vertex(&self, i: u32) -> u32 {
        self.hierarchy.forest.base_vertices + i
    }

    fn below(&self, i: u32) -> [u32; 2] {
        self.hierarchy.forest.below(self.hierarchy.mesh(), i)
    }

    fn entry(&self, i: u32) -> Entry {
        Entry::of(&self.hierarchy, i)
    }

    fn place(&self, node: u32, v: u32) -> DVec3 {
        self.hierarchy.forest.position(self.hierarchy.mesh(), node, v)
    }
}

/// The way from where a vertex is up to where it has wholly come from.
pub(crate) struct Ascent {
    /// Nodes, of which vertex each is, the split that made it, and how far that has shown itself; upwards.
    pub(crate) steps: Vec<(u32, u32, u32, f64)>,
    /// Where it ends: a node that is wholly there, and its vertex.
    pub(crate) top: (u32, u32),
}

/// How far the splits that made vertex `v` have shown themselves if they are to do so smoothly: see [`View::morphed`].
pub(crate) fn ascent<C: Cut>(cut: &C, lenses: &[Lens], v: u32, band: f64) -> Option<Ascent> {
    let mut top = (Some(cut.node(v)).filter(|&k| k != NONE)?, v);
    let mut steps = Vec::new();
    loop {
        let i = cut.maker(top.0);
        if i == NONE {
            break;
        }
        let e = cut.entry(i);
        let of = |lens: &Lens| {
            let part = (lens.urgency(&e) - 1.0) / (band.max(1.0 + 1e-9) - 1.0);
            // At a tolerance of 0 all are wholly there, errors of 0 too.
            if lens.tau() > 0.0 { part.clamp(0.0, 1.0) } else { 1.0 }
        };
        let part = lenses.iter().map(of).fold(0.0, f64::max);
        if part >= 1.0 {
            break;
        }
        steps.push((top.0, top.1, i, part));
        top = cut.parent(i);
    }
    Some(Ascent { steps, top })
}

/// Where vertex `v` is drawn if splits are to show themselves smoothly: see [`View::morphed`].
pub(crate) fn morphed<C: Cut>(cut: &C, lenses: &[Lens], v: u32, band: f64) -> Option<DVec3> {
    let Ascent { steps, top } = ascent(cut, lenses, v, band)?;
    // From the top back down.
    let start = cut.place(top.0, top.1);
    Some(steps.iter().rev().fold(start, |p, &(node, vertex, _, part)| p.lerp(cut.place(node, vertex), part)))
}
