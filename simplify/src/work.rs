//! The working state of one mesh: positions in a local frame, what may move, what may go.

use crate::locks::locked_vertices;
use crate::options::{MaxError, Options, SimplifyError};
use glam::DVec3;
use progmesh_aif::{Bits, EdgeId, FaceId, Mesh, NONE, Positions, VertexId};

/// What a vertex may do.
///
/// | onto -> | interior | border | seam | pinned |
/// |---|---|---|---|---|
/// | interior | yes | yes | yes, at the seam vertex | yes, at the pinned vertex |
/// | border | | along a border edge | no | along a border edge |
/// | seam | | | along a seam edge | along a seam edge |
/// | pinned | | | | no |
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Kind {
    /// Free.
    Interior,
    /// On exactly one border, and on no seam.
    Border,
    /// Inside a chain of seam edges (uv seam, crease, material or group border).
    Seam,
    /// Neither moves nor goes: locked, singular, or where seams and borders meet or end.
    Pinned,
}

/// One mesh being simplified.
pub(crate) struct Work<'m> {
    pub(crate) mesh: &'m mut Mesh,
    /// Positions about the centre, scaled by a power of two so that the mesh has about unit size.
    pub(crate) points: Vec<DVec3>,
    centre: DVec3,
    /// Model units -> local units; a power of two, so that going there and back is exact.
    pub(crate) scale: f64,
    /// Bounding-box diagonal in model units.
    pub(crate) diagonal: f64,
    /// Side of the grid's cells in model units, if new places lie on a grid.
    grid: Option<f64>,
    pub(crate) kinds: Vec<Kind>,
    pub(crate) seams: Bits,
    /// Vertices whose position is no longer the input's.
    pub(crate) moved: Bits,
    /// Triangles left (a polygon of n corners counts n - 2).
    pub(crate) triangles: usize,
    /// The vertex that each was collapsed into, itself while it lives; empty unless a refit will ask.
    pub(crate) into: Vec<u32>,
}

impl<'m> Work<'m> {
    /// Takes a mesh and works out what may move. O(n).
    pub(crate) fn new(mesh: &'m mut Mesh, options: &Options) -> Result<Self, SimplifyError> {
        check_weights(mesh, options)?;
        let slots = mesh.topology().vertex_slots();
        let (lo, hi) = mesh.surface_bounds().unwrap_or((DVec3::ZERO, DVec3::ZERO));
        let extent = (hi - lo).max_element();
        // A power of two near 1 / extent: 2^-1022 .. 2^1022 keeps it normal.
        let scale = if extent > 0.0 { (-extent.log2().round()).clamp(-1022.0, 1022.0).exp2() } else { 1.0 };
        // Halves first: the extent of what fills f64 is none.
        let centre = lo * 0.5 + hi * 0.5;
        let points = mesh.positions().iter().map(|p| (p - centre) * scale).collect();
        let diagonal = ((hi * 0.5 - lo * 0.5) * scale).length() * 2.0 / scale;
        let triangles = mesh.triangle_count();
        let seams = find_seams(mesh);
        let mut work = Work {
            points,
            centre,
            scale,
            diagonal,
            grid: options.grid.filter(|&g| g > 0.0),
            kinds: Vec::new(),
            seams,
            moved: Bits::new(slots),
            triangles,
            into: Vec::new(),
            mesh,
        };
        work.kinds = work.classify(options);
        Ok(work)
    }

    /// The error bound in model units, of which one is `world` world units.
    pub(crate) fn model_bound(&self, bound: MaxError, world: f64) -> f64 {
        match bound.relative {
            true => bound.value * self.diagonal,
            false if world > 0.0 => bound.value / world,
            false => bound.value,
        }
    }

    /// What every vertex may do.
    fn classify(&self, options: &Options) -> Vec<Kind> {
        let t = self.mesh.topology();
        let mut kinds = vec![Kind::Interior; t.vertex_slots()];
        let locked = locked_vertices(self.mesh, options);
        for v in t.vertices() {
            let (mut borders, mut seams, mut odd) = (0, 0, false);
            for &e in t.star(v) {
                match t.edge_faces(e).len() {
                    1 => borders += 1,
                    2 => seams += self.seams.get(e.index()) as u32,
                    _ => odd = true,
                }
            }
            kinds[v.index()] = match (borders, seams) {
                _ if odd || !t.is_regular(v) => Kind::Pinned,
                (0, 0) => Kind::Interior,
                (0, 2) => Kind::Seam,
                (2, 0) if options.lock_border => Kind::Pinned,
                (2, 0) => Kind::Border,
                _ => Kind::Pinned,
            };
            if locked.get(v.index()) {
                kinds[v.index()] = Kind::Pinned;
            }
        }
        kinds
    }

    /// Which end of `e` is kept, and whether it must stay where it is; `None` when the kinds forbid the collapse.
    #[inline]
    pub(crate) fn roles(&self, e: EdgeId) -> Option<Roles> {
        let t = self.mesh.topology();
        let [a, b] = t.edge_vertices(e);
        let (ka, kb) = (self.kinds[a.index()], self.kinds[b.index()]);
        use Kind::*;
        Some(match (ka, kb) {
            (Interior, Interior) => Roles { kept: a, removed: b, fixed: false },
            (Pinned, Pinned) => return None,
            (Border, Border) if t.edge_faces(e).len() == 1 => Roles { kept: a, removed: b, fixed: false },
            (Seam, Seam) if self.seams.get(e.index()) => Roles { kept: a, removed: b, fixed: false },
            (Border, Interior) => Roles { kept: a, removed: b, fixed: false },
            (Interior, Border) => Roles { kept: b, removed: a, fixed: false },
            (Seam | Pinned, Interior) => Roles { kept: a, removed: b, fixed: true },
            (Interior, Seam | Pinned) => Roles { kept: b, removed: a, fixed: true },
            (Pinned, Border) if t.edge_faces(e).len() == 1 => Roles { kept: a, removed: b, fixed: true },
            (Border, Pinned) if t.edge_faces(e).len() == 1 => Roles { kept: b, removed: a, fixed: true },
            (Pinned, Seam) if self.seams.get(e.index()) => Roles { kept: a, removed: b, fixed: true },
            (Seam, Pinned) if self.seams.get(e.index()) => Roles { kept: b, removed: a, fixed: true },
            _ => return None,
        })
    }

    /// Whether collapsing `e` would merge two seams, or a seam into a border.
    #[inline]
    pub(crate) fn pinches_seam(&self, e: EdgeId) -> bool {
        let t = self.mesh.topology();
        let feature = |x: EdgeId| self.seams.get(x.index()) || t.edge_faces(x).len() != 2;
        self.seams.count() > 0
            && t.edge_faces(e).iter().any(|&f| {
                let features = t.face_edges(f).iter().filter(|u| u.edge() != e && feature(u.edge())).count();
                t.corner_range(f).len() == 3 && features == 2
            })
    }

    /// Where `v` is, model units, as [`Work::write_back`] will write it.
    pub(crate) fn model_position(&self, v: VertexId) -> DVec3 {
        if self.moved.get(v.index()) { self.new_place(self.points[v.index()]) } else { self.mesh.position(v) }
    }

    /// A local point in model units, on the grid if there is one.
    #[inline]
    fn new_place(&self, p: DVec3) -> DVec3 {
        let q = p / self.scale + self.centre;
        self.grid.map_or(q, |g| (q / g).round() * g)
    }

    /// A local point in model units, rounded to the precision of the mesh.
    #[inline]
    pub(crate) fn to_model(&self, p: DVec3) -> DVec3 {
        self.mesh.positions().round(self.new_place(p))
    }

    /// A point in model units as a local one.
    #[inline]
    pub(crate) fn to_local(&self, p: DVec3) -> DVec3 {
        (p - self.centre) * self.scale
    }

    /// `p` as it will read back after it was written to the mesh, so that what is tested is what results. Exact for f32 meshes; for f64
    /// ones the rounding is far below anything tested. Not finite where the mesh could not hold it.
    #[inline]
    pub(crate) fn round(&self, p: DVec3) -> DVec3 {
        match self.mesh.positions() {
            Positions::F32(_) => {
                let q = self.mesh.positions().round(self.new_place(p));
                (q - self.centre) * self.scale
            }
            Positions::F64(_) if self.grid.is_some() => (self.new_place(p) - self.centre) * self.scale,
            Positions::F64(_) if (p / self.scale + self.centre).is_finite() => p,
            Positions::F64(_) => DVec3::NAN,
        }
    }

    /// Writes moved positions back to the mesh, in its precision.
    pub(crate) fn write_back(&mut self) {
        for v in 0..self.points.len() {
            if self.moved.get(v) {
                let p = self.new_place(self.points[v]);
                self.mesh.positions_mut().set(v, p);
            }
        }
    }
}

/// Refuses vertex weights that are not one for each slot, finite and not negative.
pub(crate) fn check_weights(mesh: &Mesh, options: &Options) -> Result<(), SimplifyError> {
    let (len, want) = (options.vertex_weights.len(), mesh.topology().vertex_slots());
    if len != 0 && len != want {
        return Err(SimplifyError::Length { option: "vertex_weights", len, want });
    }
    match options.vertex_weights.iter().find(|w| !w.is_finite() || **w < 0.0) {
        Some(&bad) => Err(SimplifyError::Range {
            option: "a vertex weight",
            value: bad as f64,
            range: "finite and not negative",
        }),
        None => Ok(()),
    }
}

/// Who stays and who goes when an edge collapses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Roles {
    pub(crate) kept: VertexId,
    pub(crate) removed: VertexId,
    /// The kept vertex must stay where it is.
    pub(crate) fixed: bool,
}

/// Regular edges across which attributes, material or group change.
fn find_seams(mesh: &Mesh) -> Bits {
    let t = mesh.topology();
    let mut seams = Bits::new(t.edge_slots());
    let wedges = mesh.wedges();
    let differs = |per_face: &[u32], f: FaceId, g: FaceId| {
        let of = |f: FaceId| per_face.get(f.index()).copied().unwrap_or(NONE);
        of(f) != of(g)
    };
    if wedges.is_none() && mesh.face_materials().is_empty() && mesh.face_groups().is_empty() {
        return seams;
    }
    for e in t.edges() {
        let &[f, g] = t.edge_faces(e) else { continue };
        let torn = wedges.is_some_and(|w| {
            t.edge_vertices(e).iter().any(|&v| !w.same(wedge_at(mesh, w, f, v), wedge_at(mesh, w, g, v)))
        });
        if torn || differs(mesh.face_materials(), f, g) || differs(mesh.face_groups(), f, g) {
            seams.set(e.index());
        }
    }
    seams
}

/// The wedge of face `f` at vertex `v`.
pub(crate) fn wedge_at(mesh: &Mesh, wedges: &progmesh_aif::Wedges, f: FaceId, v: VertexId) -> u32 {
    let t = mesh.topology();
    let range = t.corner_range(f);
    t.face_vertices(f).position(|x| x == v).map_or(NONE, |i| wedges.corner[range.start + i])
}
