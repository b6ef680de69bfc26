//! Takes a scan down to 1,000 triangles by each method, and says what came of it.
use progmesh_aif::Mesh;
use progmesh_meshes::{GenerateOptions, generate};
use progmesh_simplify::{Method, Options, Quiet, simplify};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scan = generate("scan", &GenerateOptions::default())?;
    let mesh = Mesh::from_triangles(scan.positions_f32(), scan.corners.as_chunks().0)?;
    for method in [Method::Quadric, Method::Nsa, Method::Cluster] {
        let mut options = Options::default();
        (options.method, options.triangles) = (method, Some(1_000));
        let mut small = mesh.clone();
        let outcome = simplify(&mut small, &options, &Quiet)?;
        println!("{method:?}: {} triangles, {:?}", outcome.triangles_out, outcome.stop);
        println!("  estimated error {:.5}; the diagonal is 1", outcome.estimate);
    }
    Ok(())
}
