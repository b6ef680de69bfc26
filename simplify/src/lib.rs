//! # progmesh-simplify: mesh simplification on the AIF mesh
//!
//! Three methods behind one call, [`simplify`]: quadric edge collapse (the default), NSA normal-variation edge collapse,
//! vertex clustering.
//!
//! Guaranteed: the result is a valid mesh ([`Mesh::check`]); collapses keep Euler characteristic, border loops, components and genus;
//! uv seams and material borders are not torn; a target is met as closely as legal and [`Outcome::stop`] says what ended the
//! work; the result does not depend on the number of threads. Not guaranteed: freedom from self-intersections; that an estimated error
//! ([`Outcome::estimate`]) bounds the true one; topology under clustering.

mod bulk;
mod cluster;
mod collapser;
mod exact;
mod finish;
mod locks;
mod log;
pub mod measure;
pub mod nsa;
mod options;
mod parallel;
mod quadric;
mod quadric_collapse;
mod radix_heap;
mod refit;
mod thin;
mod validity;
mod wedges;
mod work;

pub use log::{CollapseLog, LoggedCollapse, LoggedWing, Recorded, record_all};
pub use options::*;
pub use refit::REFIT_LIMIT;

use progmesh_aif::Mesh;

/// Simplifies `mesh` in place; the result is compact, without isolated vertices (unless all vertices are kept).
///
/// Errors: an option out of its range; the mesh is as it was then. O(n log n) for collapses, O(n) a search step for clustering.
///
/// ```
/// use progmesh_aif::Mesh;
/// use progmesh_simplify::{Options, Quiet, Stop, simplify};
/// // A flat 3 x 3 grid of vertices; only its corners are needed.
/// let points: Vec<[f32; 3]> = (0..9).map(|i| [(i % 3) as f32, (i / 3) as f32, 0.0]).collect();
/// let quads = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]];
/// let mut mesh = Mesh::from_polygons(points, &[4; 4], quads.as_flattened())?;
/// let mut options = Options::default();
/// options.triangles = Some(2);
/// let outcome = simplify(&mut mesh, &options, &Quiet)?;
/// assert_eq!((outcome.stop, mesh.face_count(), mesh.vertex_count()), (Stop::Target, 2, 4));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn simplify(mesh: &mut Mesh, options: &Options, control: &dyn Control) -> Result<Outcome, SimplifyError> {
    let mut outcomes = simplify_all(std::slice::from_mut(mesh), &[1.0], options, control)?;
    Ok(outcomes.swap_remove(0))
}

/// Simplifies several meshes to one shared target: errors of mesh `i` weigh `scales[i]` (model units to world units). An error bound
/// that is not relative is in world units; a relative one is relative to each mesh's own diagonal.
///
/// Options by vertex (locks, weights) are those of every mesh: give them for one mesh at a time. Panics if `scales` has another length
/// than `meshes`.
pub fn simplify_all(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    control: &dyn Control,
) -> Result<Vec<Outcome>, SimplifyError> {
    assert_eq!(meshes.len(), scales.len(), "one scale for each mesh");
    validate(options)?;
    // Before anything changes.
    meshes.iter().try_for_each(|m| work::check_weights(m, options))?;
    let faces_in: Vec<usize> = meshes.iter().map(Mesh::face_count).collect();
    let total: usize = meshes.iter().map(Mesh::triangle_count).sum();
    let mut options = std::borrow::Cow::Borrowed(options);
    if let Some(fraction) = options.prune {
        meshes.iter_mut().for_each(|m| quadric_collapse::prune_components(m, fraction));
        if options.ratio.is_some() {
            let o = options.to_mut();
            o.triangles = Some(finish::target(o, total));
            o.ratio = None;
        }
    }
    let mut outcomes = match options.method {
        Method::Nsa => nsa::simplify_all(meshes, scales, &options, control),
        Method::Quadric => quadric_collapse::simplify_all(meshes, scales, &options, control),
        Method::Cluster => cluster::simplify_all(meshes, scales, &options, control),
    }?;
    for (outcome, faces) in outcomes.iter_mut().zip(faces_in) {
        outcome.faces_in = faces;
    }
    Ok(outcomes)
}

/// Refuses options out of their range.
fn validate(options: &Options) -> Result<(), SimplifyError> {
    let within = |option, value: Option<f64>, upper: f64, range| match value {
        Some(v) if !(0.0..=upper).contains(&v) => Err(SimplifyError::Range { option, value: v, range }),
        _ => Ok(()),
    };
    within("ratio", options.ratio, 1.0, "0 to 1")?;
    within("prune", options.prune, 1.0, "0 to 1")?;
    within("grid", options.grid, f64::MAX, "finite and not negative")?;
    within("max_error", options.max_error.map(|b| b.value), f64::MAX, "finite and not negative")?;
    within("epsilon", options.epsilon, 180.0, "0 to 180 degrees")
}
