//! Lists all sample meshes with their sizes.

use progmesh_meshes::{GenerateError, GenerateOptions, generate, names};

fn main() -> Result<(), GenerateError> {
    for entry in names() {
        let sample = generate(entry.name, &GenerateOptions::default())?;
        let (vertices, faces) = (sample.positions.len(), sample.face_count());
        println!("{:18} {vertices:6} vertices {faces:6} faces  {}", entry.name, entry.about);
    }
    Ok(())
}
