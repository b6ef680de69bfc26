//! The shape of triangles, and what topology a mesh has.

use super::distance::{Quantiles, quantiles};
use super::surface::Surface;
use progmesh_aif::Mesh;

/// Longest side over shortest altitude of the triangles: 1.155 for an equilateral one, large for needles and caps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TriangleQuality {
    /// Mean over the triangles that have an area.
    pub mean: f64,
    /// Quantiles over those.
    pub quantiles: Quantiles,
    /// The greatest of those.
    pub max: f64,
    /// Triangles without area, whose ratio would be infinite.
    pub degenerate: usize,
}

/// The shape of the triangles of `surface`. Without any that has an area, all numbers are 0. O(n).
pub fn triangle_quality(surface: &Surface) -> TriangleQuality {
    let ratio = |t: usize| {
        let [a, b, c] = surface.corners(t);
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        longest / (b - a).cross(c - a).length()
    };
    let mut ratios: Vec<f64> = (0..surface.triangle_count()).map(ratio).filter(|r| r.is_finite()).collect();
    let degenerate = surface.triangle_count() - ratios.len();
    if ratios.is_empty() {
        return TriangleQuality { degenerate, ..Default::default() };
    }
    TriangleQuality {
        mean: ratios.iter().sum::<f64>() / ratios.len() as f64,
        max: ratios.iter().copied().fold(0.0, f64::max),
        quantiles: quantiles(&mut ratios),
        degenerate,
    }
}

/// What a simplification that keeps topology does not change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TopologySummary {
    /// Components of the faces.
    pub components: usize,
    /// Walks along the border.
    pub border_loops: usize,
    /// Handles, over all components; `None` where edges have three and more faces or the surface has one side only.
    pub genus: Option<usize>,
    /// Vertices - edges + faces.
    pub euler: i64,
    /// Edges of three and more faces.
    pub non_manifold_edges: usize,
    /// Vertices where the surface is not a disk or half-disk, though all their edges are good.
    pub cut_vertices: usize,
    /// Edges along which both faces run the same way.
    pub misoriented_edges: usize,
}

impl TopologySummary {
    /// Counts what `mesh` has. In effect linear.
    ///
    /// For several meshes to be compared as one, build a mesh of all: components that touch without sharing vertices stay apart.
    pub fn of(mesh: &Mesh) -> Self {
        let t = mesh.topology();
        let kinds = t.count_kinds();
        TopologySummary {
            components: t.face_components().count,
            border_loops: t.border_loops().len(),
            genus: t.genus(),
            euler: t.euler_characteristic(),
            non_manifold_edges: kinds.complex_edges,
            cut_vertices: kinds.cut_vertices,
            misoriented_edges: t.misoriented_edges(),
        }
    }
}
