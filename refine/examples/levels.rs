//! Takes a sphere down by NSA and up again, one level at a time.

use progmesh_meshes::{GenerateOptions, generate};
use progmesh_refine::{History, aif::Mesh, simplify};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let sphere = generate("sphere", &GenerateOptions::default())?;
    let mesh = Mesh::from_triangles(sphere.positions_f32(), sphere.corners.as_chunks().0)?;
    let mut history = History::nsa(mesh, &simplify::Options::default(), &simplify::Quiet)?;
    while history.refine() {
        println!("level {}: {} faces", history.level(), history.mesh().face_count());
    }
    history.set_faces(1000);
    println!("asked for 1000: {} faces", history.mesh().face_count());
    Ok(())
}
