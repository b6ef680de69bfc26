//! Mesh simplification on the AIF mesh. (being written)
pub mod options;
pub mod nsa {
    /// Default epsilon.
    pub const DEFAULT_EPSILON: f64 = 12.0;
}
pub use options::*;
use progmesh_aif::Mesh;

/// Simplifies `mesh` in place; the result is compact.
pub fn simplify(mesh: &mut Mesh, options: &Options, control: &dyn Control) -> Result<Outcome, SimplifyError> {
    let mut out = simplify_all(std::slice::from_mut(mesh), &[1.0], options, control)?;
    Ok(out.remove(0))
}

/// Simplifies several meshes to one shared target: errors of mesh `i` weigh `scales[i]` (model units to world units).
pub fn simplify_all(
    meshes: &mut [Mesh], scales: &[f64], options: &Options, control: &dyn Control,
) -> Result<Vec<Outcome>, SimplifyError> {
    let _ = (scales, options, control);
    Ok(meshes.iter().map(|m| Outcome { faces_in: m.face_count(), faces_out: m.face_count(), triangles_out: m.triangle_count(), vertices_out: m.vertex_count(), stop: Stop::Target, estimate: 0.0, levels: vec![], triangulated: 0, isolated_removed: 0, aif_bytes: m.topology().relation_bytes(), vertex_origin: vec![] }).collect())
}
