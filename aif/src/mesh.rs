//! The mesh: AIF relations, positions, attributes.

use crate::attributes::Wedges;
use crate::ids::{FaceId, NONE, VertexId};
use crate::positions::Positions;
use crate::topology::Topology;
use glam::DVec3;

/// A general polygonal mesh.
///
/// Topology and geometry are separate: [`Topology`] knows nothing of positions. Elements removed by
/// [`Mesh::collapse_edge`] stay in place until [`Mesh::compact`].
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub(crate) topology: Topology,
    pub(crate) positions: Positions,
    pub(crate) wedges: Option<Wedges>,
    pub(crate) face_material: Vec<u32>,
    pub(crate) face_group: Vec<u32>,
    pub(crate) face_row: Vec<u32>,
}

impl Mesh {
    /// The AIF relations.
    #[inline]
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// The AIF relations, to change. Positions and attributes do not follow: after [`Topology::collapse`] they are the caller's.
    #[inline]
    pub fn topology_mut(&mut self) -> &mut Topology {
        &mut self.topology
    }

    /// Positions of all vertex slots.
    #[inline]
    pub fn positions(&self) -> &Positions {
        &self.positions
    }

    /// Positions of all vertex slots, to change. Keep their number.
    #[inline]
    pub fn positions_mut(&mut self) -> &mut Positions {
        &mut self.positions
    }

    /// Position of `v`.
    #[inline]
    pub fn position(&self, v: VertexId) -> DVec3 {
        self.positions.get(v.index())
    }

    /// Attributes of the corners, if there are any.
    #[inline]
    pub fn wedges(&self) -> Option<&Wedges> {
        self.wedges.as_ref()
    }

    /// Attributes of the corners, to change or replace. `corner` must keep one entry per corner slot.
    #[inline]
    pub fn wedges_mut(&mut self) -> &mut Option<Wedges> {
        &mut self.wedges
    }

    /// Material of `f`, if it has one.
    #[inline]
    pub fn material(&self, f: FaceId) -> Option<u32> {
        self.face_material.get(f.index()).copied().filter(|&m| m != NONE)
    }

    /// Group of `f`, if it has one.
    #[inline]
    pub fn group(&self, f: FaceId) -> Option<u32> {
        self.face_group.get(f.index()).copied().filter(|&g| g != NONE)
    }

    /// Materials of all face slots; empty when no face has one.
    pub fn face_materials(&self) -> &[u32] {
        &self.face_material
    }

    /// Groups of all face slots; empty when no face has one.
    pub fn face_groups(&self) -> &[u32] {
        &self.face_group
    }

    /// Rows of all face slots ([`crate::MeshInput::face_row`]); empty when no face has one.
    pub fn face_rows(&self) -> &[u32] {
        &self.face_row
    }

    /// Number of live vertices.
    pub fn vertex_count(&self) -> usize {
        self.topology.vertex_count()
    }

    /// Number of live faces.
    pub fn face_count(&self) -> usize {
        self.topology.face_count()
    }

    /// Number of triangles the live faces make: a polygon of n corners counts n - 2.
    pub fn triangle_count(&self) -> usize {
        if self.topology.is_triangular() {
            return self.face_count();
        }
        self.topology.faces().map(|f| self.topology.corner_range(f).len().saturating_sub(2)).sum()
    }

    /// The live triangles, as vertex indices; polygons are left out (triangulate first).
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let t = &self.topology;
        t.faces().filter(|&f| t.corner_range(f).len() == 3).map(|f| t.triangle(f).map(|v| v.0)).collect()
    }

    /// Least and greatest coordinates of the live vertices; `None` if there is none.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        crate::positions::bounds(self.topology.vertices().map(|v| self.position(v)))
    }

    /// Least and greatest coordinates of the vertices that have a face; `None` if there is none.
    pub fn surface_bounds(&self) -> Option<(DVec3, DVec3)> {
        let t = &self.topology;
        let on_face = |v: &VertexId| t.star(*v).iter().any(|&e| !t.edge_faces(e).is_empty());
        crate::positions::bounds(t.vertices().filter(on_face).map(|v| self.position(v)))
    }

    /// Area-weighted normal of `f` (Newell): its length is twice the area, zero for a degenerate face.
    pub fn face_normal(&self, f: FaceId) -> DVec3 {
        let t = &self.topology;
        let mut vertices = t.face_vertices(f).map(|v| self.position(v));
        let Some(origin) = vertices.next() else { return DVec3::ZERO };
        let (mut sum, mut last) = (DVec3::ZERO, DVec3::ZERO);
        for p in vertices {
            sum += last.cross(p - origin);
            last = p - origin;
        }
        sum
    }
}
