//! What reading and writing a `.pm` file takes: decodes the file so often, encodes what came out as often, takes cursors from the base to full detail and back, and prints the best of each.
//!
//! `cargo run --release -p progmesh-bench --example coding -- in.pm [TIMES [read|cursor]]` (default: 5, everything; time of the thread where the system tells it). What is encoded comes in the order of
//! its errors, as a method makes it.
use progmesh::refine::format::{EncodeOptions, decode, encode};
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((file, rest)) = arguments.split_first() else {
        return Err("usage: coding IN.pm [TIMES [read|cursor]]".into());
    };
    let times = rest.first().map_or(Ok(5), |t| t.parse())?;
    let bytes = std::fs::read(file)?;
    // Time is that of one thread: all runs on the pool's.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let what = rest.get(1).map(String::as_str);
    let line = pool.install(|| {
        match what {
            Some("cursor") => walked(&bytes, times),
            _ => measured(&bytes, times, what.is_some()),
        }
        .map_err(|e| e.to_string())
    })?;
    println!("{line}");
    Ok(())
}

/// Seconds from some moment on.
fn clock() -> impl Fn() -> f64 {
    let begin = Instant::now();
    move || on_cpu().unwrap_or_else(|| begin.elapsed().as_secs_f64())
}

fn walked(bytes: &[u8], times: usize) -> Result<String> {
    let decoded = decode(bytes)?;
    let splits: usize = decoded.meshes.iter().map(|m| m.splits.len()).sum();
    let sorted: Vec<_> = decoded.meshes.iter().filter_map(|m| m.sorted_by_error()).collect();
    let mut line = format!("{splits} splits:");
    for (order, meshes) in [("the file", &decoded.meshes), ("errors", &sorted)] {
        let (mut finer, mut coarser) = (f64::INFINITY, f64::INFINITY);
        let now = clock();
        let mut cursors = meshes.iter().map(|m| m.cursor()).collect::<std::result::Result<Vec<_>, _>>()?;
        for _ in 0..times {
            let start = now();
            for c in &mut cursors {
                c.seek(usize::MAX)?;
            }
            let full = now();
            for c in &mut cursors {
                c.seek(0)?;
            }
            (finer, coarser) = (finer.min(full - start), coarser.min(now() - full));
        }
        let splits: usize = meshes.iter().map(|m| m.splits.len()).sum();
        let rate = |seconds: f64| splits as f64 / seconds / 1e6;
        line += &format!(
            " in the order of {order} {:.3} M vsplits/s, {:.3} M ecols/s;",
            rate(finer),
            rate(coarser)
        );
    }
    line.pop();
    Ok(line)
}

fn measured(bytes: &[u8], times: usize, only_reading: bool) -> Result<String> {
    let (mut reading, mut writing) = (f64::INFINITY, f64::INFINITY);
    let (mut splits, mut bits) = (0, 0.0);
    let now = clock();
    for _ in 0..times {
        let start = now();
        let mut decoded = decode(bytes)?;
        reading = reading.min(now() - start);
        splits = decoded.meshes.iter().map(|m| m.splits.len()).sum();
        if only_reading {
            continue;
        }
        let any_order = decoded.meshes.iter().all(|m| m.order.is_none());
        for mesh in &mut decoded.meshes {
            if let Some(mut sorted) = mesh.sorted_by_error() {
                // Without the levels of chunks, which a method may not have made.
                sorted.levels.retain(|&l| l == 0 || l == sorted.splits.len() as u32);
                *mesh = sorted;
            }
        }
        let options = EncodeOptions::default().with_any_order(any_order);
        let start = now();
        let again = encode(&decoded.meshes, &[], &[], &options)?;
        writing = writing.min(now() - start);
        let vertices: usize = decoded.meshes.iter().map(|m| m.vertices()).sum();
        bits = 8.0 * again.len() as f64 / vertices as f64;
    }
    let rate = |seconds: f64| splits as f64 / seconds / 1e6;
    let mut line = format!("{splits} splits: decoding {:.3} M splits/s", rate(reading));
    if !only_reading {
        line += &format!(", encoding {:.3}; written again {bits:.2} bits a vertex", rate(writing));
    }
    Ok(line)
}

/// Seconds that this thread has run.
fn on_cpu() -> Option<f64> {
    let line = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(line.split_whitespace().next()?.parse::<f64>().ok()? / 1e9)
}
