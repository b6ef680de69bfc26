//! What is measured of every result.

use crate::raw::Raw;
use anyhow::Result;
use progmesh::simplify::Quiet;
use progmesh::simplify::measure::{DistanceOptions, OneSided, Summary, Surface, distance};
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
}

/// Measures a result against the original.
pub(crate) fn measure(original: &Surface, result: &Raw, samples: usize) -> Result<Measures> {
    let surface = Surface::new(&result.points[..], &result.triangles)?;
    let mut options = DistanceOptions::default();
    options.samples = samples;
    let d = distance(original, &surface, &options, &Quiet)?;
    let side = |s: &OneSided| Distance::from(&s.summary);
    Ok(Measures {
        diagonal: d.diagonal,
        forward: side(&d.a_to_b),
        backward: side(&d.b_to_a),
        worse: Distance::from(&d.worse),
        samples,
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
    }
}
