//! `compare`.

use crate::common::Place;
use crate::present;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Compare {
    command: String,
    a: String,
    b: String,
    triangles: [usize; 2],
    diagonal: f64,
    samples: usize,
    seed: u64,
    a_to_b: Side,
    b_to_a: Side,
    worse: Numbers,
    #[serde(deserialize_with = "present")]
    relative: Option<Numbers>,
    #[serde(deserialize_with = "present")]
    certified: Option<Proof>,
    #[serde(deserialize_with = "present")]
    threshold: Option<Threshold>,
    #[serde(deserialize_with = "present")]
    details: Option<Details>,
    seconds: CompareSeconds,
    #[serde(deserialize_with = "present")]
    peak_bytes: Option<u64>,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Side {
    max: f64,
    rms: f64,
    mean: f64,
    quantiles: Quantiles,
    farthest: Point,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    max: f64,
    rms: f64,
    mean: f64,
    quantiles: Quantiles,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Quantiles {
    p50: f64,
    p90: f64,
    p95: f64,
    p99: f64,
    p999: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Point {
    point: [f64; 3],
    triangle: u32,
    closest: [f64; 3],
    closest_triangle: u32,
    distance: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Details {
    normals: TwoSided,
    attributes: Vec<Deviating>,
    topology: Both<Option<Topology>>,
    turned_triangles: usize,
    quality: Both<Quality>,
    self_intersections: Intersections,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Both<T> {
    a: T,
    b: T,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TwoSided {
    a_to_b: Deviation,
    b_to_a: Deviation,
    worse: Deviation,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Deviating {
    name: String,
    a_to_b: Deviation,
    b_to_a: Deviation,
    worse: Deviation,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Deviation {
    rms: f64,
    max: f64,
    samples: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Topology {
    components: usize,
    border_loops: usize,
    #[serde(deserialize_with = "present")]
    genus: Option<usize>,
    euler: i64,
    non_manifold_edges: usize,
    cut_vertices: usize,
    misoriented_edges: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Quality {
    mean: f64,
    max: f64,
    quantiles: Quantiles,
    degenerate: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Intersections {
    pairs: u64,
    some: Vec<[u32; 2]>,
    degenerate: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Proof {
    lower: f64,
    upper: f64,
    tolerance: f64,
    converged: bool,
    witness: Point,
    witness_on: String,
    a_to_b: Bounds,
    b_to_a: Bounds,
    cuts: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Bounds {
    lower: f64,
    upper: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Threshold {
    value: f64,
    of: String,
    distance: f64,
    exceeded: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CompareSeconds {
    read: f64,
    distance: f64,
    certify: f64,
    details: f64,
    draw: f64,
    total: f64,
}

#[test]
fn compare_prints_one_object_with_the_documented_fields() {
    let p = Place::new();
    p.generate("torus", "a.obj", 600);
    p.done("simplify a.obj b.obj --ratio 0.5 -q");
    let plain: Compare = serde_json::from_str(&p.done("compare a.obj b.obj --json").stdout).unwrap();
    assert_eq!((plain.command.as_str(), plain.samples, plain.seed), ("compare", 300_000, 1));
    assert!(
        plain.certified.is_none() && plain.threshold.is_none() && plain.triangles[0] > plain.triangles[1]
    );
    let d = plain.details.unwrap();
    let [ta, tb] = [d.topology.a.unwrap(), d.topology.b.unwrap()];
    assert_eq!((ta.genus, tb.genus, ta.euler, tb.components), (Some(1), Some(1), 0, 1));
    assert!(d.attributes.is_empty() && d.normals.worse.rms > 0.0);
    p.generate("quad-sphere", "q.obj", 96);
    let q: Compare =
        serde_json::from_str(&p.done("compare q.obj q.obj --samples 500 --json").stdout).unwrap();
    let uv = &q.details.as_ref().unwrap().attributes[0];
    assert_eq!((uv.name.as_str(), uv.worse.samples), ("uv 0", 1000));
    assert_eq!((d.turned_triangles, d.self_intersections.pairs, d.quality.b.degenerate), (0, 0, 0));
    assert!(d.quality.a.mean >= 1.15 && d.quality.a.max >= d.quality.a.quantiles.p999);
    let run = p.done(
        "compare a.obj b.obj --json --certify 1e-3 --threshold 9 --samples 50 --seed 2 --distance-only",
    );
    let full: Compare = serde_json::from_str(&run.stdout).unwrap();
    assert!(full.details.is_none());
    let (proof, threshold) = (full.certified.unwrap(), full.threshold.unwrap());
    assert!(proof.lower <= proof.upper && proof.converged && proof.tolerance == 1e-3);
    assert!(full.worse.max <= proof.upper && plain.worse.max <= proof.upper);
    assert_eq!(
        (threshold.of.as_str(), threshold.distance, threshold.exceeded),
        ("certified", proof.upper, false)
    );
    assert!(["a", "b"].contains(&proof.witness_on.as_str()));
    let t = &full.seconds;
    assert!(t.read + t.distance + t.certify + t.details + t.draw <= t.total + 1e-3);
}
