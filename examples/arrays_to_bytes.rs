//! From arrays in memory to the bytes of a GLB file, without touching a file system.
use progmesh::aif::MeshInput;
use progmesh::io::{Format, encode};
use progmesh::meshes::{GenerateOptions, generate};
use progmesh::pipeline::{Job, simplify_scene};
use progmesh::scene::{Scene, SceneMesh};
use progmesh::simplify::Quiet;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let torus = generate("torus", &GenerateOptions::default().with_faces(10_000))?;
    let geometry = MeshInput::triangles(torus.positions_f32(), torus.corners.as_chunks().0);
    let mut job = Job::default();
    job.options.triangles = Some(1_000);
    let scene = Scene::from_mesh(SceneMesh { geometry, ..Default::default() });
    let (scene, summary) = simplify_scene(scene, &job, &Quiet)?;
    let glb = encode(Format::Glb, &scene, &Default::default())?;
    println!("{} faces, {:?}, {} bytes", summary.faces_out, summary.stop, glb.bytes.len());
    Ok(())
}
