//! What is measured of every result.

use crate::raw::Raw;
use anyhow::Result;
use progmesh::aif::{Mesh, Positions};
use progmesh::simplify::Quiet;
use progmesh::simplify::measure::{
    DistanceOptions, OneSided, Summary, Surface, TopologySummary, deviations, distance, self_intersections,
    triangle_quality, turned_triangles,
};
use serde::{Deserialize, Serialize};

/// Distances of one direction, or the worse of both; model units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Distance {
    pub(crate) max: f64,
    pub(crate) rms: f64,
    pub(crate) mean: f64,
    pub(crate) p50: f64,
    pub(crate) p90: f64,
    pub(crate) p95: f64,
    pub(crate) p99: f64,
    pub(crate) p999: f64,
}

impl From<&Summary> for Distance {
    fn from(s: &Summary) -> Self {
        let q = &s.quantiles;
        let (p50, p90, p95, p99, p999) = (q.p50, q.p90, q.p95, q.p99, q.p999);
        Distance { max: s.max, rms: s.rms, mean: s.mean, p50, p90, p95, p99, p999 }
    }
}

/// All that is measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Measures {
    /// Of the original's bounding box.
    pub(crate) diagonal: f64,
    /// From the original to the result.
    pub(crate) forward: Distance,
    /// From the result to the original.
    pub(crate) backward: Distance,
    pub(crate) worse: Distance,
    /// Area samples on each side.
    pub(crate) samples: usize,
    /// Angle between the normals of both surfaces at area samples, degrees: the worse direction.
    pub(crate) normal_rms: f64,
    pub(crate) normal_max: f64,
    /// Triangles of the result that look away from the original's closest ones.
    pub(crate) turned: usize,
    /// Longest edge over shortest altitude of the result's triangles.
    pub(crate) shape_mean: f64,
    pub(crate) shape_p99: f64,
    /// Triangles of the result without area.
    pub(crate) degenerate: usize,
    /// Pairs of the result's triangles that cut each other.
    pub(crate) self_intersections: u64,
    pub(crate) topology: Topology,
}

/// What the surface of a result is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Topology {
    pub(crate) components: usize,
    pub(crate) border_loops: usize,
    pub(crate) genus: Option<usize>,
    pub(crate) non_manifold_edges: usize,
    pub(crate) cut_vertices: usize,
    pub(crate) misoriented_edges: usize,
}

impl Topology {
    /// Of triangles. Errors: as for building a mesh.
    fn of(mesh: &Raw) -> Result<Topology> {
        let t = TopologySummary::of(&Mesh::from_triangles(
            Positions::from_f64(mesh.points.clone()),
            &mesh.triangles,
        )?);
        Ok(Topology {
            components: t.components,
            border_loops: t.border_loops,
            genus: t.genus,
            non_manifold_edges: t.non_manifold_edges,
            cut_vertices: t.cut_vertices,
            misoriented_edges: t.misoriented_edges,
        })
    }
}

/// Measures a result against the original.
pub(crate) fn measure(original: &Surface, result: &Raw, samples: usize) -> Result<Measures> {
    let surface = Surface::new(&result.points[..], &result.triangles)?;
    let mut options = DistanceOptions::default();
    options.samples = samples;
    let d = distance(original, &surface, &options, &Quiet)?;
    let side = |s: &OneSided| Distance::from(&s.summary);
    let topology = Topology::of(result)?;
    // Angles vary less than distances: a third of the samples will do.
    options.samples = samples.div_ceil(3);
    let normals = deviations((original, &[]), (&surface, &[]), &options, &Quiet)?.normals.worse;
    let shape = triangle_quality(&surface);
    Ok(Measures {
        diagonal: d.diagonal,
        forward: side(&d.a_to_b),
        backward: side(&d.b_to_a),
        worse: Distance::from(&d.worse),
        samples,
        normal_rms: normals.rms,
        normal_max: normals.max,
        turned: turned_triangles(original, &surface, &Quiet)?.len(),
        shape_mean: shape.mean,
        shape_p99: shape.quantiles.p99,
        degenerate: shape.degenerate,
        self_intersections: self_intersections(&surface, &Quiet)?.pairs,
        topology,
    })
}

/// A surface of a mesh.
pub(crate) fn surface(mesh: &Raw) -> Result<Surface> {
    Ok(Surface::new(&mesh.points[..], &mesh.triangles)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lifted_square_is_as_far_as_it_was_lifted() {
        let square = |z: f64| Raw {
            points: vec![[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let m = measure(&surface(&square(0.0)).unwrap(), &square(0.25), 100).unwrap();
        for d in [m.forward, m.backward, m.worse] {
            for x in [d.max, d.rms, d.mean, d.p50, d.p999] {
                assert!((x - 0.25).abs() < 1e-12);
            }
        }
        assert!((m.diagonal - 2f64.sqrt()).abs() < 1e-12);
        assert!(
            m.normal_max < 1e-6 && (m.shape_mean - 2.0).abs() < 1e-9,
            "{} {}",
            m.normal_max,
            m.shape_mean
        );
        assert_eq!((m.turned, m.degenerate, m.self_intersections), (0, 0, 0));
        assert_eq!((m.topology.components, m.topology.border_loops, m.topology.genus), (1, 1, Some(0)));
        // The other way round, and a triangle that cuts through.
        let mut other = square(0.25);
        other.triangles = vec![[0, 2, 1], [0, 3, 2], [4, 5, 6]];
        other.points.extend([[0.5, 0.2, 0.0], [0.5, 0.3, 0.5], [0.6, 0.2, 0.5]]);
        let m = measure(&surface(&square(0.0)).unwrap(), &other, 100).unwrap();
        assert!(m.turned >= 2 && m.self_intersections > 0 && m.topology.components == 2);
    }
}
