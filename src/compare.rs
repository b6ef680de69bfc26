//! Comparing two scenes: everything their nodes show, as two surfaces in the world, measured against each other.
//!
//! This is what `progmesh compare` does between reading and printing; on arrays of your own use [`crate::simplify::measure`] directly.

use crate::aif::{BuildError, MeshInput, Positions, triangulate_polygon};
use crate::io::flatten::flatten;
use crate::pipeline::Part;
use crate::report::{Scale, SurfaceError, short};
use crate::scene::Scene;
use crate::simplify::Control;
use crate::simplify::measure::{
    Certified, CertifyOptions, DistanceOptions, Distances, MeasureError, Surface, certify, distance,
};
use glam::DVec3;
use std::time::Instant;

mod heat;
mod tables;

pub use heat::{DISTANCE, Pair, heat_page, heat_picture, heat_scene};

/// How two scenes are compared. Start from `CompareOptions::default()` and set what differs.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct CompareOptions {
    /// How distances are sampled.
    pub distance: DistanceOptions,
    /// Prove the two-sided distance to within this, a part of the diagonal of A.
    pub certify: Option<f64>,
}

/// Why nothing was compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// A scene is no surface. The input is wrong.
    #[error("{mesh}{source}")]
    Mesh {
        /// Which of its meshes, with a colon; empty when there is one only.
        mesh: String,
        /// What is wrong with it.
        source: BuildError,
    },
    /// It cannot be measured.
    #[error(transparent)]
    Measure(#[from] MeasureError),
}

/// A scene as one surface of triangles in the world.
#[derive(Clone, Debug)]
pub struct Flattened {
    /// To measure distances from and to.
    pub surface: Surface,
    /// Positions of the triangles' corners.
    pub positions: Positions,
    /// The triangles; polygons are cut.
    pub triangles: Vec<[u32; 3]>,
}

impl Flattened {
    /// What the nodes of a scene show. Wires and points are no part of it.
    ///
    /// Errors: an array of a mesh is wrong; there is no triangle; a vertex in use is not finite. O(n log n).
    pub fn of(scene: &Scene) -> Result<Flattened, CompareError> {
        for (mesh, m) in scene.meshes.iter().enumerate() {
            let failed = |source| CompareError::Mesh { mesh: crate::pipeline::label(scene, mesh), source };
            m.geometry.validate().map_err(failed)?;
        }
        let flat = flatten(scene, "a comparison");
        let triangles = triangles(&flat.geometry);
        let surface = Surface::new(&flat.geometry.positions, &triangles)?;
        let positions = flat.geometry.into_owned().positions;
        Ok(Flattened { surface, positions, triangles })
    }
}

/// All faces as triangles, in order.
fn triangles(input: &MeshInput) -> Vec<[u32; 3]> {
    let Some(sizes) = &input.face_sizes else {
        return input.corners.as_chunks().0.to_vec();
    };
    let mut out = Vec::with_capacity(input.corners.len());
    let (mut points, mut cut): (Vec<DVec3>, _) = (Vec::new(), Vec::new());
    let mut rest = &input.corners[..];
    for &n in sizes {
        let (corners, after) = rest.split_at((n as usize).min(rest.len()));
        rest = after;
        if let [a, b, c] = corners {
            out.push([*a, *b, *c]);
            continue;
        }
        points.clear();
        points.extend(corners.iter().map(|&v| input.positions.get(v as usize)));
        cut.clear();
        triangulate_polygon(&points, &mut cut);
        out.extend(cut.iter().map(|t| t.map(|i| corners[i as usize])));
    }
    out
}

/// Two scenes compared. Lengths are in model units unless a name says otherwise.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Comparison {
    /// Triangles of A and of B, instances counted each.
    pub triangles: [usize; 2],
    /// Distances in both directions, sampled.
    pub distances: Distances,
    /// The proven two-sided distance, if asked for.
    pub certified: Option<Certified>,
    /// Seconds that sampling took.
    pub distance_seconds: f64,
    /// Seconds that the proof took.
    pub certify_seconds: f64,
}

/// Compares B with A.
///
/// Errors: an option out of its range; the caller asked for a stop ([`MeasureError::Cancelled`]).
pub fn compare(
    a: &Flattened,
    b: &Flattened,
    options: &CompareOptions,
    control: &dyn Control,
) -> Result<Comparison, CompareError> {
    // Proving takes about as long as sampling, more or less.
    let half = if options.certify.is_some() { 0.5 } else { 1.0 };
    let start = Instant::now();
    let distances = distance(&a.surface, &b.surface, &options.distance, &Part::new(control, 0.0, half))?;
    let distance_seconds = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let certified = match options.certify {
        Some(tolerance) => {
            let mut how = CertifyOptions::with_tolerance(tolerance * a.surface.diagonal());
            how.threads = options.distance.threads;
            Some(certify(&a.surface, &b.surface, &how, &Part::new(control, half, 1.0 - half))?)
        }
        None => None,
    };
    Ok(Comparison {
        triangles: [a, b].map(|s| s.surface.triangle_count()),
        distances,
        certified,
        distance_seconds,
        certify_seconds: start.elapsed().as_secs_f64(),
    })
}

impl Comparison {
    /// What is held against a bound: the proven upper bound where there is one, else the largest sampled distance.
    pub fn judged(&self) -> f64 {
        self.certified.as_ref().map_or(self.distances.worse.max, |c| c.upper)
    }

    /// Colours for the distances of A from B: up to the largest, unless the last thousandth of the area is more than half as far again as the rest.
    pub fn heat_scale(&self) -> Scale {
        let s = &self.distances.a_to_b.summary;
        let q = s.quantiles.p999;
        let top = if q > 0.0 && s.max > 1.5 * q { q } else { s.max };
        let d = self.distances.diagonal;
        let unit = match d > 0.0 && s.max > 0.0 {
            true => format!("model units; max = {} % of A's diagonal", short(100.0 * s.max / d)),
            false => "model units".into(),
        };
        Scale { top, max: s.max, unit }
    }
}

/// The distance of every point from a surface, in order. Threads as [`crate::simplify`] has them.
pub fn distances_of(points: &[DVec3], to: &Surface) -> Vec<f64> {
    const CHUNK: usize = 1024;
    let some = |points: &[DVec3]| -> Vec<f64> {
        let mut query = to.query();
        points.iter().map(|&p| query.distance(p)).collect()
    };
    #[cfg(feature = "parallel")]
    let chunks: Vec<_> = {
        use rayon::prelude::*;
        points.par_chunks(CHUNK).map(some).collect()
    };
    #[cfg(not(feature = "parallel"))]
    let chunks: Vec<_> = points.chunks(CHUNK).map(some).collect();
    chunks.concat()
}

/// A surface to draw fails as one to measure does.
impl From<SurfaceError> for CompareError {
    fn from(e: SurfaceError) -> Self {
        CompareError::Mesh { mesh: format!("mesh {}: ", e.mesh), source: e.source }
    }
}
