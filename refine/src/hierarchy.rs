//! The vertex hierarchy of a progressive mesh, with bounds for every split: what view-dependent refinement shares between views.
//!
//! A [`Hierarchy`] is static: flat arrays, one entry a split. Any number of views ([`crate::selective::View`]) hold one each (`Arc`).
//!
//! For every split there is a bounding sphere, a normal cone and an error, each at least that of all splits below it in the hierarchy: what is
//! invisible, or fine enough, has nothing below it that is not.
//!
//! **What the error bounds, and how far.** By the ring rule ([`Rule::Rings`]) what a collapse does to the surface is the same in every mesh of the hierarchy (`rings.rs`), and the finest mesh is followed as a whole, in convex
//! pieces (`cover.rs`): so the error of a split is, by proof, at least the distance of every point of the finest mesh that it answers for to any mesh in which it is undone. By the rule of cuts ([`Rule::Cuts`]) rings are not the
//! same: samples are followed, its vertices and quarters of its edges, and errors are the largest that were found in some orders, with a margin ([`Options::margin`]). Tests, and `progmesh fly --measure-every`, measure what is shown by code of their own. Spheres, cones,
//! and the way they nest are proven.

mod bounds;
mod cone;
mod cover;
mod deviation;
mod directions;
mod estimate;
mod forest;
mod further;
mod nearest;
mod offsets;
mod order;
mod rings;
mod rows;
mod spheres;
mod tree;

pub use bounds::{Bounds, Guarantee, SplitBounds};
pub(crate) use bounds::{Packed, pack_up, repack, unpack};
pub(crate) use cone::Cone;
pub(crate) use directions::{CHANGE, DEPTH, Direction};
pub(crate) use forest::Forest;
pub(crate) use further::Further;
pub(crate) use rows::SplitRows;
pub(crate) use tree::Tree;

use crate::progressive::{Damage, ProgressiveMesh};
use crate::selective::Front;
use glam::DVec3;
use rings::{Needs, Rings};
use std::sync::{Arc, OnceLock};

/// When a split may be made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Rule {
    /// When all that was split before it around its vertex is: the ring of a split is the same in every mesh. Splits are put into the order of their errors, so that little else is
    /// needed. A mesh that moves a vertex between sheets of faces falls back to cuts.
    #[default]
    Rings,
    /// When the faces on its cuts are there (the l/r rule; it selects the same meshes as the four-face rule of Hoppe 1997): the weakest under which splits can be made.
    Cuts,
}

/// How a hierarchy is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// When splits may be made.
    pub rule: Rule,
    /// What errors are multiplied by; at least 1. By the ring rule they are proven as they are.
    pub margin: f64,
    /// By the ring rule how often the splits are put into the order of the errors that were found. By that of cuts how many walks there are after the one in
    /// the order of the splits, in orders as views bring them about: the first by error, the second and third with parts of the mesh out of view.
    pub rounds: u32,
    /// By the rule of cuts: samples of the finest mesh that are followed on each face, on average; where there are more, those of edges are left out, then vertices. At most so many take up time.
    pub samples: usize,
    /// By the ring rule: finds out which way deviations lie, for directional errors ([`crate::selective::Lens::directional`]). 2 B a split.
    pub directions: bool,
}

impl Options {
    /// By the ring rule. `docs/selective.md` has what was measured with these values.
    pub const RINGS: Options =
        Options { rule: Rule::Rings, margin: 1.0, rounds: 1, samples: 0, directions: false };
    /// By the rule of cuts. At a margin of 1 with two rounds and 12 samples views of five sample meshes (`tests/selective.rs`) showed up to 1.4 of the tolerance, of dragon, igea, horse and the
    /// textured bunny up to 2.0 (their medians about 1.2); without rounds more. With 12 samples one view of 3,200 (a torus) showed 1.40 of the tolerance, the margin notwithstanding.
    pub const CUTS: Options =
        Options { rule: Rule::Cuts, margin: 2.25, rounds: 2, samples: 24, directions: false };

    /// Sets [`Options::margin`].
    pub fn with_margin(mut self, margin: f64) -> Self {
        self.margin = margin;
        self
    }

    /// Sets [`Options::samples`].
    pub fn with_samples(mut self, samples: usize) -> Self {
        self.samples = samples;
        self
    }

    /// Sets [`Options::directions`].
    pub fn with_directions(mut self, directions: bool) -> Self {
        self.directions = directions;
        self
    }

    /// Sets [`Options::rounds`].
    pub fn with_rounds(mut self, rounds: u32) -> Self {
        self.rounds = rounds;
        self
    }
}

impl Default for Options {
    fn default() -> Self {
        Options::RINGS
    }
}

/// A progressive mesh with its vertex hierarchy and bounds. See the [module](self).
#[derive(Clone, Debug)]
pub struct Hierarchy {
    mesh: Arc<ProgressiveMesh>,
    pub(crate) forest: Forest,
    pub(crate) bounds: Arc<Bounds>,
    /// See [`Hierarchy::row_parents`].
    row_parents: OnceLock<Vec<u32>>,
}

/// Goes through all splits, so that every reference is followed, and gives the hierarchy and the finest mesh; and by the ring rule, if it holds, the longest chain of splits
/// that need each other up to each.
fn finest(mesh: &ProgressiveMesh, rule: Rule) -> Result<(Forest, Front, Option<Vec<u32>>), Damage> {
    // Lengths, references and wedges, in the order of the splits.
    mesh.cursor()?.seek(usize::MAX)?;
    let mut forest = Forest::new(mesh);
    let mut front = Front::new(mesh, &forest);
    let mut others = Vec::new();
    let mut rings = (rule == Rule::Rings).then(|| Rings::new(mesh, &front));
    for i in 0..forest.len() as u32 {
        if let Some(r) = &mut rings {
            r.before(mesh, &forest, &front, i)?;
        }
        front.split(mesh, &forest, i, Some(&mut others))?;
        if let Some(r) = &mut rings {
            r.after(mesh, &forest, &front, i);
        }
    }
    if let Some(rows) = &mut forest.rows {
        rows.set_others(others);
    }
    let settled = rings.and_then(Rings::finish);
    let turns = match settled {
        Some((needs, turns)) => {
            forest.needs = needs;
            Some(turns)
        }
        None => {
            forest.needs = Needs::of_cuts(mesh);
            None
        }
    };
    Ok((forest, front, turns))
}

/// The splits by their turns.
fn by_turns(turns: &[u32]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..turns.len() as u32).collect();
    order.sort_by_key(|&i| turns[i as usize]);
    order
}

/// A mesh whose splits are in the order of the ring rule.
struct Settled {
    /// Which split of the mesh before is now which.
    order: Vec<u32>,
    mesh: ProgressiveMesh,
    forest: Forest,
    bounds: Bounds,
}

impl Settled {
    /// Puts splits into the order of their errors, and measures them; `None` if the ring rule does not hold for the mesh.
    fn measure(mesh: &ProgressiveMesh, options: &Options) -> Result<Option<Settled>, Damage> {
        let mut order: Vec<u32> = (0..mesh.splits.len() as u32).collect();
        let mut now = std::borrow::Cow::Borrowed(mesh);
        for _ in 0..options.rounds {
            let (forest, front, turns) = finest(&now, Rule::Rings)?;
            if turns.is_none() {
                return Ok(None);
            }
            let full = Finest::new(&now, &forest, &front);
            let errors = estimate::errors(&now, &forest, front.clone(), &full);
            let next = order::by_errors(&now, &forest, front, full, &errors);
            order = next.iter().map(|&i| order[i as usize]).collect();
            now = std::borrow::Cow::Owned(now.reordered(&next).map_err(|e| Damage::Fan(e.0 as usize))?);
        }
        let (forest, front, turns) = finest(&now, Rule::Rings)?;
        let Some(turns) = turns else { return Ok(None) };
        let mut bounds = cover::measure(&now, &forest, front, options);
        (bounds.guarantee, bounds.turns) = (Guarantee::Settled, turns);
        Ok(Some(Settled { order, mesh: now.into_owned(), forest, bounds }))
    }
}

/// The finest mesh, about the middle of its box.
struct Finest {
    positions: Vec<DVec3>,
    /// By slots of the front; of one without a face three times the same vertex.
    corners: Vec<[u32; 3]>,
    origin: DVec3,
    diagonal: f64,
}

impl Finest {
    /// `front` is at full detail.
    fn new(pm: &ProgressiveMesh, forest: &Forest, front: &Front) -> Finest {
        let vertices = forest.base_vertices + forest.len() as u32;
        let mut positions: Vec<DVec3> =
            (0..vertices).map(|v| forest.place(pm, v, forest.chain(v).len())).collect();
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
    /// Builds the hierarchy: goes through all splits once in each direction. Bounds are those that the mesh carries ([`ProgressiveMesh::bounds`]), and the rule the one they are for;
    /// if it has none they are measured, which takes about 130 microseconds a vertex.
    ///
    /// By the ring rule the splits come in another order than in `mesh`, and so have other numbers: see [`Hierarchy::mesh`].
    ///
    /// Errors: a damaged progressive mesh, or bounds that are not for it or do not nest; every reference is followed here, so that views meet no damage.
    pub fn new(mesh: Arc<ProgressiveMesh>, options: &Options) -> Result<Hierarchy, Damage> {
        if let Some(bounds) = &mesh.bounds {
            let bounds = bounds.clone();
            return Self::with_bounds(mesh, bounds);
        }
        if options.rule == Rule::Rings
            && let Some(s) = Settled::measure(&mesh, options)?
        {
            let mut bounds = s.bounds;
            bounds.turns = Vec::new();
            return Ok(Hierarchy::of(Arc::new(s.mesh), s.forest, Arc::new(bounds)));
        }
        let (forest, front, _) = finest(&mesh, Rule::Cuts)?;
        let bounds = Arc::new(deviation::measure(&mesh, &forest, &front, options));
        Ok(Hierarchy::of(mesh, forest, bounds))
    }

    fn of(mesh: Arc<ProgressiveMesh>, forest: Forest, bounds: Arc<Bounds>) -> Hierarchy {
        // One that others hold as well stays as it is.
        let mesh = Arc::try_unwrap(mesh).map_or_else(
            |shared| shared,
            |mut own| {
                own.splits.error = Vec::new();
                own.pack();
                Arc::new(own)
            },
        );
        Hierarchy { mesh, forest, bounds, row_parents: OnceLock::new() }
    }

    fn with_bounds(mesh: Arc<ProgressiveMesh>, bounds: Arc<Bounds>) -> Result<Hierarchy, Damage> {
        let n = mesh.splits.len();
        if bounds.len() != n {
            return Err(Damage::Length { what: "bounds", len: bounds.len(), want: n });
        }
        if bounds.guarantee() != Guarantee::Settled {
            let (forest, _, _) = finest(&mesh, Rule::Cuts)?;
            bounds.check(&mesh, &forest)?;
            return Ok(Hierarchy::of(mesh, forest, bounds));
        }
        if bounds.turns.len() != n {
            return Err(Damage::Length { what: "turns", len: bounds.turns.len(), want: n });
        }
        // The checks before anything is put into another order.
        mesh.cursor()?.seek(usize::MAX)?;
        let mut mesh = mesh.reordered(&by_turns(&bounds.turns)).map_err(|e| Damage::Bounds(e.0 as usize))?;
        let mut bounds = match mesh.bounds.take() {
            Some(b) => Arc::unwrap_or_clone(b),
            None => return Err(Damage::Length { what: "bounds", len: 0, want: n }),
        };
        let (forest, _, turns) = finest(&mesh, Rule::Rings)?;
        // The longest chains are what they were: so what splits need is, too.
        let other = |t: &Vec<u32>| t.iter().zip(&bounds.turns).position(|(a, b)| a != b);
        match turns.as_ref().map(other) {
            Some(None) => {}
            Some(Some(i)) => return Err(Damage::Bounds(i)),
            None => return Err(Damage::Bounds(0)),
        }
        bounds.turns = Vec::new();
        bounds.check(&mesh, &forest)?;
        Ok(Hierarchy::of(Arc::new(mesh), forest, Arc::new(bounds)))
    }

    /// The progressive mesh, with its splits in the order in which they are numbered here, and without the method's estimates ([`crate::progressive::Splits::error`]) unless others hold it as well.
    pub fn mesh(&self) -> &ProgressiveMesh {
        &self.mesh
    }

    /// Splits.
    pub fn splits(&self) -> usize {
        self.forest.len()
    }

    /// When splits may be made.
    pub fn rule(&self) -> Rule {
        match self.bounds.guarantee() {
            Guarantee::Settled => Rule::Rings,
            _ => Rule::Cuts,
        }
    }

    /// The splits that split `i` depends on directly, by [`Hierarchy::rule`], as far as they do not follow from each other. Panics if there is no such split.
    pub fn dependencies(&self, i: usize) -> impl Iterator<Item = usize> + use<'_> {
        self.forest.needs.of(i as u32).iter().map(|d| d as usize)
    }

    /// The bounds of split `i`. Panics if there is no such split.
    pub fn bounds(&self, i: usize) -> SplitBounds {
        self.bounds.at(i, self.bounds.origin + self.local_centre(i as u32).as_dvec3())
    }

    /// The bounds of all splits.
    pub fn all_bounds(&self) -> &Arc<Bounds> {
        &self.bounds
    }

    /// Which way deviations of split `i` lie.
    #[inline]
    pub(crate) fn direction(&self, i: u32) -> Direction {
        self.bounds.directions.get(i as usize).copied().unwrap_or_default()
    }

    /// For every row of attributes the one it comes of: that of the same wedge, or of the one it was parted from, before the split that made the row. Found when it is first asked for, 4 B a row. O(n), once.
    pub(crate) fn row_parents(&self) -> &[u32] {
        // The splits have been gone through before: there is no damage.
        self.row_parents
            .get_or_init(|| self.mesh.cursor().and_then(|mut c| c.seek_with_lineage()).unwrap_or_default())
    }

    /// Where split `i` is, about the origin of the bounds, as everything is that is decided about it.
    #[inline]
    pub(crate) fn local_centre(&self, i: u32) -> glam::Vec3 {
        self.bounds.place_before(&self.mesh, &self.forest, i)
    }

    /// The middle of the box around the finest mesh's vertices, and the length of its diagonal.
    pub fn extent(&self) -> (DVec3, f64) {
        self.bounds.extent()
    }

    /// Bytes of the attributes, which are part of [`Hierarchy::bytes`].
    pub fn attribute_bytes(&self) -> usize {
        self.mesh.attribute_bytes()
    }

    /// Bytes of what views share: splits, places, attributes, bounds and what links them; all but the input's order ([`crate::progressive::InputOrder::bytes`]), which only full detail asks for.
    /// About 45 a vertex of a mesh without attributes whose collapses place vertices on a grid ([`crate::simplify::Options::grid`]), 39 if they keep one of the two, and 15 and 12 more with a normal.
    pub fn bytes(&self) -> usize {
        let parents = self.row_parents.get().map_or(0, |p| 4 * p.capacity());
        self.mesh.bytes() + self.forest.bytes() + self.bounds.bytes() + parents
    }
}
