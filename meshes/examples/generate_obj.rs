//! Prints a small scan as OBJ: `cargo run -p progmesh-meshes --example generate_obj > scan.obj`

use progmesh_meshes::{GenerateError, GenerateOptions, generate};

fn main() -> Result<(), GenerateError> {
    let scan = generate("scan", &GenerateOptions::default().with_faces(2000).with_seed(7))?;
    for [x, y, z] in &scan.positions {
        println!("v {x} {y} {z}");
    }
    for face in scan.faces() {
        let corners: Vec<String> = face.iter().map(|v| (v + 1).to_string()).collect();
        println!("f {}", corners.join(" "));
    }
    Ok(())
}
