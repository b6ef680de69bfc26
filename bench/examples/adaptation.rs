//! How fast views adapt, on one thread: splits a second from the base to what a camera needs, and where 20,000 faces are the limit at a tenth of the tolerance; operations a second where the camera jumps from one side
//! to the other and back, and where all is undone. The shortest of 21 counts.
//!
//! `cargo run --release -p progmesh-bench --example adaptation -- in.pm [tau]` (one written with `progmesh encode --bounds`; tau 1)
use progmesh::io::pm;
use progmesh::refine::hierarchy::Options;
use progmesh::refine::selective::{Cull, Done, Limits};
use progmesh::refine::view::Camera;
use progmesh::selective::{SelectiveScene, circle};
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// Times that each is done; the shortest counts.
const TIMES: usize = 21;

fn main() -> Result<()> {
    // Views share long lists out among the threads there are.
    rayon::ThreadPoolBuilder::new().num_threads(1).build()?.install(run)
}

fn run() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("usage: adaptation IN.pm [TAU]")?;
    let tau: f64 = arguments.next().map_or(Ok(1.0), |t| t.parse())?;
    let read = pm::decode_progressive(&std::fs::read(&file)?)?.scene;
    let mut scene = SelectiveScene::new(read, &Options::default())?;
    // As `fly --path circle`: the two ends of a diagonal.
    let sides = circle(scene.bounds().ok_or("nothing is shown")?, 2)?;
    let limited =
        |scene: &mut SelectiveScene, camera: &Camera, tau: f64, faces: usize| -> Result<(f64, Done)> {
            let start = Instant::now();
            let done = scene.adapt(camera, tau, Cull::All, &Limits { faces, ..Limits::default() })?;
            let us = start.elapsed().as_secs_f64() * 1e6;
            scene.take_changes();
            Ok((us, done))
        };
    let timed =
        |scene: &mut SelectiveScene, camera: &Camera, tau: f64| limited(scene, camera, tau, usize::MAX);
    let mut first = Vec::new();
    for _ in 0..TIMES {
        scene.reset();
        first.push(timed(&mut scene, &sides[0], tau)?);
    }
    report("first frame", first);
    let mut jumps = Vec::new();
    for k in 1..2 * TIMES {
        jumps.push(timed(&mut scene, &sides[k % 2], tau)?);
    }
    report("from side to side", jumps);
    let [shared, shown, tables] = scene.bytes();
    let all = scene.full_vertices() as f64;
    println!(
        "{:.1} B a vertex shown; {:.2} B of tables and {:.1} B shared a vertex of the finest mesh",
        shown as f64 / scene.vertex_count() as f64,
        tables as f64 / all,
        shared as f64 / all
    );
    let mut most = Vec::new();
    for _ in 0..TIMES {
        scene.reset();
        most.push(limited(&mut scene, &sides[0], 0.1 * tau, 20_000)?);
    }
    report("20,000 faces at most", most);
    scene.reset();
    let mut back = Vec::new();
    for _ in 0..TIMES {
        timed(&mut scene, &sides[0], tau)?;
        back.push(timed(&mut scene, &sides[0], f64::INFINITY)?);
    }
    report("to the base", back);
    Ok(())
}

fn report(what: &str, mut times: Vec<(f64, Done)>) {
    times.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some((us, done)) = times.first() else { return };
    let Done { splits, forced, collapses, .. } = done;
    let rate = (splits + collapses) as f64 / us;
    println!(
        "{what}: {splits} splits ({forced} that only others need), {collapses} undone, {us:.0} us: {rate:.2} M/s"
    );
}
