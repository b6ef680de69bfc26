//! What recording costs: the largest mesh of a file simplified as far as is legal, and the same with its vertex splits, in turns. Times are of the processor where the
//! system tells them (Linux), so that other programs show less.
//!
//! `cargo run --release -p progmesh-bench --example recording -- in.obj [nsa] [exact] [endpoint] [optimal] [midpoint] [plain|recorded]`
//!
//! With `plain` or `recorded` only that is done, once, in a function that valgrind can be told of:
//! `valgrind --tool=callgrind --toggle-collect='*measured_part*' target/release/examples/recording in.obj nsa recorded`
use progmesh::aif::{BuildOptions, Mesh};
use progmesh::io::files::read_scene;
use progmesh::refine::progressive::build;
use progmesh::simplify::{Method, Options, Placement, Quiet, Schedule, simplify};
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

const TURNS: usize = 5;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((input, words)) = arguments.split_first() else {
        return Err(
            "usage: recording IN [nsa] [exact] [endpoint] [optimal] [midpoint] [plain|recorded]".into()
        );
    };
    let mut options = Options::default();
    // No triangle is asked for, and nothing is moved afterwards: so both make the same collapses.
    (options.triangles, options.refit) = (Some(0), Some(0));
    let mut only = None;
    for word in words {
        match word.as_str() {
            "nsa" => options.method = Method::Nsa,
            "exact" => options.schedule = Some(Schedule::Exact),
            "endpoint" => options.placement = Some(Placement::Endpoint),
            "optimal" => options.placement = Some(Placement::Optimal),
            "midpoint" => options.placement = Some(Placement::Midpoint),
            "plain" => only = Some(false),
            "recorded" => only = Some(true),
            _ => return Err(format!("{word} is not known").into()),
        }
    }
    let scene = read_scene(input)?.scene;
    let largest = scene.meshes.into_iter().max_by_key(|m| m.geometry.face_count());
    let mesh = Mesh::build(largest.ok_or("no mesh")?.geometry, &BuildOptions::default())?.0;
    if let Some(recorded) = only {
        options.threads = Some(1);
        println!("{} vertices", measured_part(mesh, &options, recorded)?);
        return Ok(());
    }
    // One thread, whose time is that of all.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let [plain, recorded] = pool.install(|| compare(&mesh, &options).map_err(|e| e.to_string()))?;
    println!(
        "plain {plain:.4} s, recorded {recorded:.4} s: {:.3} times (least of {TURNS})",
        recorded / plain
    );
    Ok(())
}

/// Seconds without and with records.
fn compare(mesh: &Mesh, options: &Options) -> Result<[f64; 2]> {
    let mut least = [f64::INFINITY; 2];
    for _ in 0..TURNS {
        for recorded in [false, true] {
            let mesh = mesh.clone();
            let (start, busy) = (Instant::now(), busy());
            measured_part(mesh, options, recorded)?;
            let spent = busy.and_then(|b| Some(self::busy()? - b)).unwrap_or(start.elapsed().as_secs_f64());
            let seconds = &mut least[recorded as usize];
            *seconds = seconds.min(spent);
        }
    }
    Ok(least)
}

/// Seconds that this thread has been running.
fn busy() -> Option<f64> {
    let all = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(1e-9 * all.split_whitespace().next()?.parse::<f64>().ok()?)
}

/// The vertices that are left of the mesh.
#[inline(never)]
fn measured_part(mut mesh: Mesh, options: &Options, recorded: bool) -> Result<usize> {
    if recorded {
        return Ok(build(mesh, options, &Quiet)?.mesh.base_vertices());
    }
    simplify(&mut mesh, options, &Quiet)?;
    Ok(mesh.vertex_count())
}
