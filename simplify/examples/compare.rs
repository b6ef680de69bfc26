//! Simplifies a scan to a tenth and measures how far the result is from it: `cargo run --release -p progmesh-simplify --example compare`
use progmesh_aif::Mesh;
use progmesh_meshes::{GenerateOptions, generate};
use progmesh_simplify::measure::{DistanceOptions, Surface, distance};
use progmesh_simplify::{Options, Quiet, simplify};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scan = generate("scan", &GenerateOptions::default().with_faces(100_000))?;
    let points: Vec<[f32; 3]> = scan.positions.iter().map(|p| p.map(|x| x as f32)).collect();
    let mut mesh = Mesh::from_triangles(points, scan.corners.as_chunks::<3>().0)?;
    let original = Surface::from_mesh(&mesh)?;
    let mut options = Options::default();
    options.ratio = Some(0.1);
    simplify(&mut mesh, &options, &Quiet)?;
    let distances = distance(&original, &Surface::from_mesh(&mesh)?, &DistanceOptions::default(), &Quiet)?;
    let worse = distances.worse.scaled(100.0 / distances.diagonal);
    println!("max {:.4} %, rms {:.4} %, mean {:.4} % of the diagonal", worse.max, worse.rms, worse.mean);
    Ok(())
}
