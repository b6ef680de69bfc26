//! How good the beginnings of a progressive mesh file are: encodes the largest mesh of a file and measures what its first bytes show beside the method's own mesh with as
//! many splits. Ends with an error where that is more than 1.5 times as far from the input (rms).
//!
//! `cargo run --release -p progmesh-bench --example prefixes -- in.ply [any-order] [sequential] [nsa] [optimal]` (default: with the order, quadric, endpoint)
use progmesh::aif::{BuildOptions, Mesh};
use progmesh::io::files::read_scene;
use progmesh::refine::ProgressiveMesh;
use progmesh::refine::format::{EncodeOptions, decode_prefix, encode};
use progmesh::refine::progressive::build;
use progmesh::simplify::measure::{DistanceOptions, Surface, distance};
use progmesh::simplify::{Method, Options, Placement, Quiet};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Parts of the bytes that are looked at.
const PARTS: [f64; 3] = [0.1, 0.25, 0.5];
/// The most times as far as the method's own mesh.
const MOST: f64 = 1.5;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((input, words)) = arguments.split_first() else {
        return Err("usage: prefixes IN [any-order] [sequential] [nsa] [optimal]".into());
    };
    let (mut method, mut file) = (Options::default(), EncodeOptions::default());
    method.placement = Some(Placement::Endpoint);
    for word in words {
        match word.as_str() {
            "any-order" => file.any_order = true,
            "sequential" => file.sequential = true,
            "nsa" => method.method = Method::Nsa,
            "optimal" => method.placement = Some(Placement::Optimal),
            _ => return Err(format!("{word}: any-order, sequential, nsa and optimal are known").into()),
        }
    }
    let scene = read_scene(input)?.scene;
    let largest = scene.meshes.into_iter().max_by_key(|m| m.geometry.face_count());
    let mesh = Mesh::build(largest.ok_or("no mesh")?.geometry, &BuildOptions::default())?.0;
    let built = build(mesh, &method, &Quiet)?.mesh;
    let whole = surface(&built, usize::MAX)?;
    let bytes = encode(std::slice::from_ref(&built), &[], &[], &file)?;
    let splits = built.splits.len();
    println!(
        "{} bytes, {:.1} bits a vertex",
        bytes.len(),
        8.0 * bytes.len() as f64 / built.vertices() as f64
    );
    println!(
        "{:>6} {:>10} {:>10} {:>7} {:>11} {:>11} {:>6}",
        "part", "bytes", "splits", "", "rms", "method's", "times"
    );
    let mut worst = 0.0f64;
    for part in PARTS {
        let end = (part * bytes.len() as f64) as usize;
        let decoded = decode_prefix(&bytes[..end])?;
        let there = decoded.meshes.first().ok_or("the base is not in the first bytes")?;
        let n = there.splits.len();
        let [shown, own] = [rms(&whole, &surface(there, usize::MAX)?)?, rms(&whole, &surface(&built, n)?)?];
        let percent = 100.0 * n as f64 / splits.max(1) as f64;
        println!(
            "{part:>6} {end:>10} {n:>10} {percent:>5.1} % {shown:>11.4e} {own:>11.4e} {:>6.2}",
            shown / own
        );
        worst = worst.max(shown / own);
    }
    if worst > MOST { Err(format!("more than {MOST} times").into()) } else { Ok(()) }
}

/// The mesh after so many splits.
fn surface(pm: &ProgressiveMesh, splits: usize) -> Result<Surface> {
    let mut cursor = pm.cursor()?;
    cursor.seek(splits)?;
    Ok(Surface::from_mesh(&Mesh::build(cursor.to_input(), &BuildOptions::default())?.0)?)
}

fn rms(whole: &Surface, other: &Surface) -> Result<f64> {
    let mut options = DistanceOptions::default();
    options.samples = 200_000;
    Ok(distance(whole, other, &options, &Quiet)?.worse.rms)
}
