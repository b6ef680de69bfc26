//! Reads a mesh or a whole scene, halves it, writes it: `cargo run --example simplify_file -- in.obj out.glb`
use progmesh::io::files::{read_scene, write_scene};
use progmesh::pipeline::{Job, simplify_scene};
use progmesh::simplify::Quiet;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let names: Vec<String> = std::env::args().skip(1).collect();
    let [input, output] = names.as_slice() else { return Err("usage: simplify_file IN OUT".into()) };
    let mut job = Job::default();
    job.options.ratio = Some(0.5);
    let (scene, summary) = simplify_scene(read_scene(input)?.scene, &job, &Quiet)?;
    for warning in write_scene(output, &scene)? {
        eprintln!("{warning}");
    }
    println!("{} -> {} faces", summary.faces_in, summary.faces_out);
    Ok(())
}
