//! Comparing two scenes: everything their nodes show, as two surfaces in the world, measured against each other.
//!
//! This is what `progmesh compare` does between reading and printing; on arrays of your own use [`crate::simplify::measure`] directly.

use crate::aif::{
    BuildError, BuildOptions, Channel, Mesh, MeshInput, NONE, Positions, Semantic, triangulate_polygon,
};
use crate::io::flatten::flatten;
use crate::pipeline::Part;
use crate::report::{Scale, SurfaceError, short};
use crate::scene::Scene;
use crate::simplify::Control;
use crate::simplify::measure::{
    Certified, CertifyOptions, CornerValues, Deviations, DistanceOptions, Distances, MeasureError,
    SelfIntersections, Surface, TopologySummary, TriangleQuality, certify, distance, distance_and_deviations,
    self_intersections, triangle_quality, turned_triangles,
};
use glam::DVec3;
use std::time::Instant;

mod heat;
mod tables;

pub use tables::semantic_name;

pub use heat::{DISTANCE, Pair, heat_page, heat_picture, heat_scene};

/// How two scenes are compared. Start from `CompareOptions::default()` and set what differs.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct CompareOptions {
    /// How distances are sampled.
    pub distance: DistanceOptions,
    /// Prove the two-sided distance to within this, a part of the diagonal of A.
    pub certify: Option<f64>,
    /// Measure distances alone: no [`Details`].
    pub distance_only: bool,
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
    /// Texture coordinates and colours of the triangles' corners.
    pub values: Vec<CornerValues>,
    /// Its topology, if it was counted.
    pub topology: Option<TopologySummary>,
}

impl Flattened {
    /// What the nodes of a scene show. Wires and points are no part of it.
    ///
    /// Errors: an array of a mesh is wrong; there is no triangle; a vertex in use is not finite. O(n log n).
    pub fn of(scene: &Scene) -> Result<Flattened, CompareError> {
        check(scene)?;
        Self::of_valid(scene)
    }

    fn of_valid(scene: &Scene) -> Result<Flattened, CompareError> {
        let flat = flatten(scene, "a comparison");
        let corners = triangles(&flat.geometry);
        let triangles: Vec<_> =
            corners.iter().map(|t| t.map(|c| flat.geometry.corners[c as usize])).collect();
        let surface = Surface::new(&flat.geometry.positions, &triangles)?;
        let values = values(&flat.geometry, &corners)?;
        let positions = flat.geometry.into_owned().positions;
        Ok(Flattened { surface, positions, triangles, values, topology: None })
    }

    /// The same with its topology counted, as one mesh: instances that touch stay apart.
    pub fn with_topology(scene: &Scene) -> Result<Flattened, CompareError> {
        check(scene)?;
        let topology = || {
            let input = flatten(scene, "a comparison").geometry.into_owned();
            Mesh::build(input, &BuildOptions::default()).map(|(mesh, _)| TopologySummary::of(&mesh))
        };
        #[cfg(feature = "parallel")]
        let (flattened, topology) = rayon::join(|| Flattened::of_valid(scene), topology);
        #[cfg(not(feature = "parallel"))]
        let (flattened, topology) = (Flattened::of_valid(scene), topology());
        let mut flattened = flattened?;
        let failed = |source| CompareError::Mesh { mesh: String::new(), source };
        flattened.topology = Some(topology.map_err(failed)?);
        Ok(flattened)
    }
}

/// Every mesh is one.
fn check(scene: &Scene) -> Result<(), CompareError> {
    for (mesh, m) in scene.meshes.iter().enumerate() {
        let failed = |source| CompareError::Mesh { mesh: crate::pipeline::label(scene, mesh), source };
        m.geometry.validate().map_err(failed)?;
    }
    Ok(())
}

/// All faces as triangles of corner slots, in order.
fn triangles(input: &MeshInput) -> Vec<[u32; 3]> {
    let mut out = Vec::with_capacity(input.corners.len() / 2);
    let (mut points, mut cut): (Vec<DVec3>, _) = (Vec::new(), Vec::new());
    let mut start = 0;
    for f in 0..input.face_count() {
        let n = input.face_sizes.as_ref().map_or(3, |s| s[f]);
        if n == 3 {
            out.push([start, start + 1, start + 2]);
        } else {
            let corners = &input.corners[start as usize..(start + n) as usize];
            points.clear();
            points.extend(corners.iter().map(|&v| input.positions.get(v as usize)));
            cut.clear();
            triangulate_polygon(&points, &mut cut);
            out.extend(cut.iter().map(|t| t.map(|i| start + i)));
        }
        start += n;
    }
    out
}

/// Texture coordinates and colours of triangles of corner slots.
fn values(input: &MeshInput, triangles: &[[u32; 3]]) -> Result<Vec<CornerValues>, MeasureError> {
    let Some(wedges) = &input.wedges else { return Ok(vec![]) };
    let compared = |s: &Semantic| matches!(s, Semantic::TexCoord(_) | Semantic::Color(_));
    let channels = wedges.channels().iter().enumerate().filter(|(_, c)| compared(&c.semantic));
    let of_channel = |(k, c): (usize, &Channel)| {
        let mut values = Vec::with_capacity(3 * c.width * triangles.len());
        for &corner in triangles.as_flattened() {
            let wedge = wedges.corner.get(corner as usize).copied().unwrap_or(NONE);
            match wedges.get(wedge, k) {
                Some(row) => values.extend_from_slice(row),
                None => values.extend(std::iter::repeat_n(f32::NAN, c.width)),
            }
        }
        CornerValues::new(c.semantic.clone(), c.width, values)
    };
    channels.map(of_channel).collect()
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
    /// Everything else, unless distances alone were asked for.
    pub details: Option<Details>,
    /// Seconds that sampling took: distances and, unless distances alone were asked for, deviations.
    pub distance_seconds: f64,
    /// Seconds that the proof took.
    pub certify_seconds: f64,
    /// Seconds that everything else took.
    pub detail_seconds: f64,
}

/// What else differs between two surfaces.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Details {
    /// Of normals, texture coordinates and colours, at closest points.
    pub deviations: Deviations,
    /// Of A and of B, where it was counted.
    pub topology: [Option<TopologySummary>; 2],
    /// Triangles of B that face the other way than A there.
    pub turned: usize,
    /// Shapes of the triangles of A and of B.
    pub quality: [TriangleQuality; 2],
    /// Triangles of B that meet where they should not.
    pub self_intersections: SelfIntersections,
}

fn details(
    a: &Flattened,
    b: &Flattened,
    deviations: Deviations,
    control: &dyn Control,
) -> Result<Details, MeasureError> {
    let part = |start, share| Part::new(control, start, share);
    Ok(Details {
        deviations,
        topology: [a.topology, b.topology],
        turned: turned_triangles(&a.surface, &b.surface, &part(0.0, 0.7))?.len(),
        quality: [a, b].map(|s| triangle_quality(&s.surface)),
        self_intersections: self_intersections(&b.surface, &part(0.7, 0.3))?,
    })
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
    // How long each takes, roughly.
    let [sampling, proving, rest] = [
        5.0,
        if options.certify.is_some() { 4.0 } else { 0.0 },
        if options.distance_only { 0.0 } else { 1.0 },
    ];
    let all = sampling + proving + rest;
    let part = |start: f64, share: f64| Part::new(control, start / all, share / all);
    let start = Instant::now();
    let control = part(0.0, sampling);
    let (distances, deviations) = match options.distance_only {
        true => (distance(&a.surface, &b.surface, &options.distance, &control)?, None),
        false => {
            let (of_a, of_b) = ((&a.surface, &a.values[..]), (&b.surface, &b.values[..]));
            let (distances, deviations) = distance_and_deviations(of_a, of_b, &options.distance, &control)?;
            (distances, Some(deviations))
        }
    };
    let distance_seconds = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let certified = match options.certify {
        Some(tolerance) => {
            let mut how = CertifyOptions::with_tolerance(tolerance * a.surface.diagonal());
            how.threads = options.distance.threads;
            Some(certify(&a.surface, &b.surface, &how, &part(sampling, proving))?)
        }
        None => None,
    };
    let certify_seconds = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let rest = part(sampling + proving, rest);
    let details = deviations.map(|found| details(a, b, found, &rest)).transpose()?;
    Ok(Comparison {
        triangles: [a, b].map(|s| s.surface.triangle_count()),
        distances,
        certified,
        distance_seconds,
        details,
        certify_seconds,
        detail_seconds: start.elapsed().as_secs_f64(),
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
