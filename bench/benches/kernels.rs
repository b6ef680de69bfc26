//! Times of the inner parts of the library: `cargo bench -p progmesh-bench`.

// The module is shared with the program, which counts instructions of it.
#[path = "../src/kernels.rs"]
mod kernels;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};

/// Small enough for a cache, large enough for the schedules' rounds.
const FACES: usize = 40_000;

fn kernels(c: &mut Criterion) {
    let mut group = c.benchmark_group("kernels");
    group.sample_size(20);
    for kernel in kernels::all(FACES) {
        group.throughput(Throughput::Elements(kernel.elements as u64));
        group.bench_function(kernel.name, |b| {
            b.iter_batched(|| kernel.prepare(), |work| work(), BatchSize::LargeInput);
        });
    }
    group.finish();
}

criterion_group!(benches, kernels);
criterion_main!(benches);
