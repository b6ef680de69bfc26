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
pub mod nsa;
mod options;
mod parallel;
mod quadric;
mod radix_heap;
mod validity;
mod wedges;
mod work;

pub use options::*;

use collapser::Collapser;
use progmesh_aif::Mesh;
use work::Work;

/// Simplifies `mesh` in place; the result is compact.
pub fn simplify(mesh: &mut Mesh, options: &Options, control: &dyn Control) -> Result<Outcome, SimplifyError> {
    let mut out = simplify_all(std::slice::from_mut(mesh), &[1.0], options, control)?;
    Ok(out.remove(0))
}

/// Simplifies several meshes to one shared target: errors of mesh `i` weigh `scales[i]` (model units to world units).
pub fn simplify_all(
    meshes: &mut [Mesh],
    scales: &[f64],
    options: &Options,
    control: &dyn Control,
) -> Result<Vec<Outcome>, SimplifyError> {
    let before: Vec<_> =
        meshes.iter().map(|m| (m.face_count(), m.triangle_count(), m.topology().relation_bytes())).collect();
    let total: usize = before.iter().map(|b| b.1).sum();
    if options.method == Method::Nsa {
        return nsa::simplify_all(meshes, options, control);
    }
    if options.method == Method::Cluster {
        return cluster::simplify_all(meshes, scales, options, control);
    }
    let mut collapsers = Vec::new();
    for m in meshes.iter_mut() {
        collapsers.push(Collapser::new(Work::new(m, options)?, options));
    }
    let world: Vec<f64> = collapsers.iter().zip(scales).map(|(c, s)| s / c.work.scale).collect();
    let largest = collapsers.iter().zip(scales).map(|(c, s)| c.work.diagonal * s).fold(0.0, f64::max);
    let factors: Vec<f64> = world.iter().map(|w| (w / largest).powi(4)).collect();
    let triangles = options.triangles.unwrap_or(0).max(options.ratio.map_or(0, |r| (r * total as f64).round() as usize));
    let goal = exact::Goal { triangles, first: total };
    let stop = match options.schedule {
        Some(Schedule::Exact) => exact::run(&mut collapsers, &factors, &goal, control),
        _ => parallel::with_threads(options.threads, || bulk::run(&mut collapsers, &factors, &goal, control)),
    };
    let mut outcomes = Vec::new();
    for (mut c, b) in collapsers.into_iter().zip(before) {
        c.work.write_back();
        let estimate = c.estimate();
        let level = Level { pass: 1, faces: c.work.triangles, seconds: 0.0, tried: c.tried, refused: c.refused };
        let m = c.work.mesh;
        outcomes.push(Outcome {
            faces_in: b.0,
            faces_out: m.face_count(),
            triangles_out: m.triangle_count(),
            vertices_out: m.vertex_count(),
            stop,
            estimate,
            levels: vec![level],
            triangulated: 0,
            isolated_removed: 0,
            aif_bytes: b.2,
            vertex_origin: vec![],
        });
    }
    Ok(outcomes)
}
