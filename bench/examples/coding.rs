//! What reading and writing a `.pm` file takes: decodes the file so often, encodes what came out as often, and prints the best of each.
//!
//! `cargo run --release -p progmesh-bench --example coding -- in.pm [TIMES [read]]` (default: 5; time of the thread where the system tells it)
use progmesh::refine::format::{EncodeOptions, decode, encode};
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((file, rest)) = arguments.split_first() else {
        return Err("usage: coding IN.pm [TIMES]".into());
    };
    let times = rest.first().map_or(Ok(5), |t| t.parse())?;
    let bytes = std::fs::read(file)?;
    // Time is that of one thread: all runs on the pool's.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let line = pool.install(|| measured(&bytes, times, rest.len() > 1).map_err(|e| e.to_string()))?;
    println!("{line}");
    Ok(())
}

fn measured(bytes: &[u8], times: usize, only_reading: bool) -> Result<String> {
    let (mut reading, mut writing) = (f64::INFINITY, f64::INFINITY);
    let (mut splits, mut bits) = (0, 0.0);
    let begin = Instant::now();
    let now = || on_cpu().unwrap_or_else(|| begin.elapsed().as_secs_f64());
    for _ in 0..times {
        let start = now();
        let decoded = decode(bytes)?;
        reading = reading.min(now() - start);
        splits = decoded.meshes.iter().map(|m| m.splits.len()).sum();
        if only_reading {
            continue;
        }
        let any_order = decoded.meshes.iter().all(|m| m.order.is_none());
        let options = EncodeOptions::default().with_any_order(any_order);
        let start = now();
        let again = encode(&decoded.meshes, &decoded.turns, &[], &options)?;
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
