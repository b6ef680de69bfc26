//! The vertex hierarchy of a progressive mesh, with bounds for every split: what view-dependent refinement shares between views.
//!
//! A [`Hierarchy`] is static: flat arrays, one entry a split. Any number of views ([`crate::selective::View`]) hold one each (`Arc`).
//!
//! For every split there is a bounding sphere, a normal cone and an error, each at least that of all splits below it in the hierarchy: what is
//! invisible, or fine enough, has nothing below it that is not.
//!
//! **What the error bounds, and how far.** The error of a split is at least the distance from samples of the finest mesh (its vertices and
//! quarters of its edges) in the region of its vertex to the mesh shown where it is not applied, measured in every state of the progressive
//! mesh's own order, times [`Options::margin`]. That is measured, not proven: under a view the neighbours of a vertex may be coarser or finer
//! than they were in that order. Tests, and `progmesh fly --measure-every`, measure what is shown by code of their own. Spheres, cones, and
//! the way they nest are proven.

mod bounds;
mod cone;
mod deviation;
mod forest;
mod spheres;

pub use bounds::{Bounds, Guarantee, SplitBounds};
pub(crate) use bounds::{Packed, unpack};
pub(crate) use cone::Cone;
pub(crate) use forest::{Forest, SplitRows};

use crate::progressive::{Damage, ProgressiveMesh};
use crate::selective::Front;
use glam::DVec3;
use std::sync::Arc;

/// How a hierarchy is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// What measured errors are multiplied by, for neighbours at other levels and for what lies between samples. At least 1. At a margin of 1
    /// with two rounds views of five sample meshes (`tests/selective.rs`) showed up to 1.4 of the tolerance, of dragon, igea, horse and the textured bunny up to
    /// 2.0 (their medians about 1.2); without rounds more.
    pub margin: f64,
    /// After the walk in the order of the splits, how many more, in orders as views bring them about: the first by error, the second and third with parts of
    /// the mesh out of view.
    pub rounds: u32,
}

impl Default for Options {
    fn default() -> Self {
        Options { margin: 2.25, rounds: 2 }
    }
}

/// A progressive mesh with its vertex hierarchy and bounds. See the [module](self).
#[derive(Clone, Debug)]
pub struct Hierarchy {
    mesh: Arc<ProgressiveMesh>,
    pub(crate) forest: Forest,
    pub(crate) bounds: Arc<Bounds>,
}

/// Goes through all splits, so that every reference is followed, and gives the hierarchy and the finest mesh.
fn finest(mesh: &ProgressiveMesh) -> Result<(Forest, Front), Damage> {
    // Lengths, references and wedges, in the order of the splits.
    mesh.cursor()?.seek(usize::MAX)?;
    let mut forest = Forest::new(mesh);
    let mut front = Front::new(mesh, &forest);
    let mut row_before = std::mem::take(&mut forest.row_before);
    for i in 0..forest.len() as u32 {
        front.split(mesh, &forest, i, Some(&mut row_before))?;
    }
    forest.row_before = row_before;
    Ok((forest, front))
}

/// The finest mesh, about the middle of its box.
struct Finest {
    positions: Vec<DVec3>,
    corners: Vec<[u32; 3]>,
    origin: DVec3,
    diagonal: f64,
}

impl Finest {
    /// `front` is at full detail.
    fn new(pm: &ProgressiveMesh, forest: &Forest, front: &Front) -> Finest {
        let vertices = forest.base_vertices + forest.len() as u32;
        let mut positions: Vec<DVec3> =
            (0..vertices).map(|v| forest.position(pm, front.node(v), v)).collect();
        let (lo, hi) = positions
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)));
        let (origin, diagonal) =
            if positions.is_empty() { (DVec3::ZERO, 0.0) } else { (0.5 * lo + 0.5 * hi, (hi - lo).length()) };
        positions.iter_mut().for_each(|p| *p -= origin);
        let corners = front.corners().iter().map(|f| f.map(|w| front.wedge_vertex(w))).collect();
        Finest { positions, corners, origin, diagonal }
    }
}

impl Hierarchy {
    /// Builds the hierarchy: goes through all splits once in each direction. Bounds are those that the mesh carries ([`ProgressiveMesh::bounds`]); if it has none they are
    /// measured, which takes about 70 microseconds a vertex.
    ///
    /// Errors: a damaged progressive mesh, or bounds that are not for it or do not nest; every reference is followed here, so that views meet no damage.
    pub fn new(mesh: Arc<ProgressiveMesh>, options: &Options) -> Result<Hierarchy, Damage> {
        let (forest, front) = finest(&mesh)?;
        let bounds = match &mesh.bounds {
            Some(bounds) => {
                bounds.check(&mesh, &forest)?;
                bounds.clone()
            }
            None => Arc::new(deviation::measure(&mesh, &forest, &front, options)),
        };
        Ok(Hierarchy { mesh, forest, bounds })
    }

    /// The progressive mesh.
    pub fn mesh(&self) -> &ProgressiveMesh {
        &self.mesh
    }

    /// Splits.
    pub fn splits(&self) -> usize {
        self.forest.len()
    }

    /// The splits that split `i` depends on directly: the one that made the vertex as it splits it, and those that made the later of the faces
    /// on each of its cuts. Panics if there is no such split.
    pub fn dependencies(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        self.forest
            .needs(&self.mesh, i as u32)
            .into_iter()
            .filter(|&d| d != crate::aif::NONE)
            .map(|d| d as usize)
    }

    /// The bounds of split `i`. Panics if there is no such split.
    pub fn bounds(&self, i: usize) -> SplitBounds {
        self.bounds.at(i, self.bounds.origin + self.local_centre(i as u32).as_dvec3())
    }

    /// The bounds of all splits.
    pub fn all_bounds(&self) -> &Arc<Bounds> {
        &self.bounds
    }

    /// Where split `i` is, about the origin of the bounds, as everything is that is decided about it.
    #[inline]
    pub(crate) fn local_centre(&self, i: u32) -> glam::Vec3 {
        let vertex = self.mesh.splits.vertex[i as usize];
        self.bounds.place(&self.mesh, &self.forest, self.forest.parent[i as usize], vertex)
    }

    /// The middle of the box around the finest mesh's vertices, and the length of its diagonal.
    pub fn extent(&self) -> (DVec3, f64) {
        self.bounds.extent()
    }

    /// Bytes of what views share, without the attributes of wedges, the input's order and the splits' estimates.
    pub fn bytes(&self) -> usize {
        let m = &*self.mesh;
        let positions = |p: &crate::aif::Positions| p.len() * if p.is_f64() { 24 } else { 12 };
        12 * m.base_faces.len()
            + positions(&m.base_positions)
            + positions(&m.new_positions)
            + positions(&m.moved_positions)
            + 14 * m.splits.len()
            + self.forest.bytes()
            + self.bounds.bytes()
    }
}
