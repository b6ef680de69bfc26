//! The objects of `--json` have exactly the fields that docs/json.md documents.
#![allow(dead_code)] // the fields are there to be demanded

mod common;

use common::Place;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Simplify {
    command: String,
    method: String,
    faces_in: usize,
    faces_out: usize,
    vertices_out: usize,
    triangles: Triangles,
    seconds: Seconds,
    stop: String,
    estimate: Option<f64>,
    #[serde(deserialize_with = "present")]
    measured: Option<Measured>,
    #[serde(deserialize_with = "present")]
    certified: Option<Certified>,
    levels: Vec<Level>,
    aif_bytes: usize,
    #[serde(deserialize_with = "present")]
    peak_bytes: Option<u64>,
    warnings: Vec<String>,
}

/// An optional value whose key must be there all the same.
fn present<'de, D: serde::Deserializer<'de>, T: Deserialize<'de>>(d: D) -> Result<Option<T>, D::Error> {
    Option::deserialize(d)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Seconds {
    read: f64,
    build: f64,
    simplify: f64,
    measure: f64,
    write: f64,
    draw: f64,
    total: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Triangles {
    input: usize,
    output: usize,
    instanced_input: usize,
    instanced_output: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InfoTriangles {
    file: usize,
    built: usize,
    instanced: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Certified {
    bound: f64,
    upper: f64,
    runs: usize,
}

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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Measured {
    max: f64,
    rms: f64,
    mean: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Level {
    pass: usize,
    faces: usize,
    seconds: f64,
    tried: u64,
    refused: Refused,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Refused {
    link: u64,
    normal: u64,
    border: u64,
    flip: u64,
    valence: u64,
    locked: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Info {
    command: String,
    file: String,
    format: String,
    bytes: usize,
    nodes: usize,
    instances: usize,
    triangles: InfoTriangles,
    #[serde(deserialize_with = "present")]
    bounds: Option<[[f64; 3]; 2]>,
    meshes: Vec<Mesh>,
    materials: Vec<String>,
    images: Vec<Image>,
    #[serde(deserialize_with = "present")]
    progressive: Option<Progressive>,
    #[serde(deserialize_with = "present")]
    check: Option<String>,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Progressive {
    base_triangles: usize,
    splits: usize,
    levels: usize,
    #[serde(deserialize_with = "present")]
    chunks: Option<usize>,
    #[serde(deserialize_with = "present")]
    quantization_error: Option<f64>,
    #[serde(deserialize_with = "present")]
    streams: Option<Streams>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Streams {
    head: u64,
    base: u64,
    connectivity: u64,
    errors: u64,
    positions: u64,
    attributes: u64,
    faces: u64,
    order: u64,
    scene: u64,
    bounds: u64,
    other: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Mesh {
    #[serde(deserialize_with = "present")]
    name: Option<String>,
    file_faces: usize,
    file_triangles: usize,
    vertices: usize,
    edges: usize,
    faces: usize,
    triangles: usize,
    face_sizes: FaceSizes,
    vertex_kinds: VertexKinds,
    edge_kinds: EdgeKinds,
    border_loops: usize,
    components: usize,
    euler: i64,
    #[serde(deserialize_with = "present")]
    genus: Option<usize>,
    manifold: bool,
    closed: bool,
    orientable: bool,
    #[serde(deserialize_with = "present")]
    bounds: Option<[[f64; 3]; 2]>,
    diagonal: f64,
    precision: String,
    attributes: Vec<Attribute>,
    materials: Vec<Part>,
    groups: Vec<Part>,
    aif_bytes: usize,
    problems: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FaceSizes {
    triangles: usize,
    quads: usize,
    larger: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VertexKinds {
    isolated: usize,
    cut: usize,
    dangling: usize,
    complex: usize,
    border: usize,
    interior: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EdgeKinds {
    isolated: usize,
    dangling: usize,
    border: usize,
    regular: usize,
    complex: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Attribute {
    name: String,
    width: usize,
    encoding: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Part {
    name: String,
    faces: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Image {
    #[serde(deserialize_with = "present")]
    name: Option<String>,
    #[serde(deserialize_with = "present")]
    mime: Option<String>,
    #[serde(deserialize_with = "present")]
    bytes: Option<usize>,
}

#[test]
fn simplify_prints_one_object_with_the_documented_fields() {
    let p = Place::new();
    p.generate("torus", "in.obj", 600);
    for method in ["quadric --ratio 0.5", "nsa --ratio 0.5 --epsilon 60", "cluster --ratio 0.5"] {
        let run = p.run(&format!("simplify in.obj out.obj --json --method {method}"));
        let s: Simplify = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!((s.command.as_str(), method.starts_with(&s.method)), ("simplify", true));
        assert!(["target", "error", "passes", "no_legal_collapse", "cancelled"].contains(&s.stop.as_str()));
        let t = &s.seconds;
        let parts = [t.read, t.build, t.simplify, t.measure, t.write];
        assert!(parts.iter().all(|&x| x >= 0.0) && parts.iter().sum::<f64>() <= t.total + 1e-3);
        assert!(s.faces_out < s.faces_in && s.vertices_out > 0 && s.aif_bytes > 0);
        assert!(!s.levels.is_empty() && s.levels.last().is_some_and(|l| l.faces == s.faces_out));
        assert_eq!(s.peak_bytes.is_some(), cfg!(target_os = "linux"));
    }
}

#[test]
fn info_prints_one_object_with_the_documented_fields() {
    let p = Place::new();
    p.generate("quad-sphere", "in.obj", 96);
    let run = p.done("info in.obj --json --check");
    let i: Info = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!((i.command.as_str(), i.check.as_deref()), ("info", Some("ok")));
    assert_eq!((i.meshes[0].faces, i.meshes[0].face_sizes.quads), (96, 96));
    assert_eq!(i.images.len(), 1);
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Encode {
    command: String,
    method: String,
    meshes: usize,
    vertices: usize,
    triangles: usize,
    base_triangles: usize,
    splits: usize,
    levels: usize,
    bytes: usize,
    estimate: f64,
    #[serde(deserialize_with = "present")]
    quantization_error: Option<f64>,
    seconds: EncodeSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EncodeSeconds {
    read: f64,
    build: f64,
    simplify: f64,
    bounds: f64,
    encode: f64,
    write: f64,
    total: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Decode {
    command: String,
    to: String,
    meshes: usize,
    vertices: usize,
    triangles: usize,
    full_triangles: usize,
    base_triangles: usize,
    splits: usize,
    full_splits: usize,
    seconds: DecodeSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DecodeSeconds {
    read: f64,
    refine: f64,
    write: f64,
    total: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Lod {
    command: String,
    to: String,
    levels: Vec<LodLevel>,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LodLevel {
    triangles: usize,
    #[serde(deserialize_with = "present")]
    coverage: Option<f64>,
    #[serde(deserialize_with = "present")]
    file: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Morph {
    command: String,
    to: String,
    from_triangles: usize,
    to_triangles: usize,
    at: f64,
    triangles: usize,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Extract {
    command: String,
    to: String,
    #[serde(deserialize_with = "present")]
    tau: Option<f64>,
    faces: usize,
    vertices: usize,
    splits: usize,
    full_faces: usize,
    full_splits: usize,
    visible_vertices: usize,
    #[serde(deserialize_with = "present")]
    strips: Option<ExtractStrips>,
    #[serde(deserialize_with = "present")]
    paging: Option<Paging>,
    seconds: ExtractSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ExtractStrips {
    count: usize,
    mean_length: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Paging {
    limit_bytes: u64,
    most_bytes: u64,
    file_bytes: u64,
    bytes_read: u64,
    bytes_touched: u64,
    requests: u64,
    chunks: u64,
    chunks_touched: u64,
    chunks_decoded: u64,
    evictions: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ExtractSeconds {
    read: f64,
    bounds: f64,
    refine: f64,
    write: f64,
    total: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Fly {
    command: String,
    path: String,
    #[serde(deserialize_with = "present")]
    tau: Option<f64>,
    full_faces: usize,
    frame_count: usize,
    faces: FlyStatistics,
    vsplits: FlyStatistics,
    ecols: FlyStatistics,
    us: FlyStatistics,
    morphing: FlyStatistics,
    dirty_index_bytes: FlyStatistics,
    #[serde(deserialize_with = "present")]
    operations_per_second: Option<f64>,
    #[serde(deserialize_with = "present")]
    measured_over_tau: Option<FlyStatistics>,
    above: usize,
    #[serde(deserialize_with = "present")]
    cracks: Option<usize>,
    #[serde(deserialize_with = "present")]
    folds: Option<usize>,
    #[serde(deserialize_with = "present")]
    uncovered: Option<usize>,
    memory: FlyMemory,
    #[serde(deserialize_with = "present")]
    paging: Option<Paging>,
    frames: Vec<FlyFrame>,
    seconds: FlySeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlyStatistics {
    mean: f64,
    p50: f64,
    p99: f64,
    max: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlyMemory {
    shared_bytes: usize,
    shared_bytes_per_vertex: f64,
    view_bytes: usize,
    view_table_bytes: usize,
    most_vertices: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlyFrame {
    faces: usize,
    vertices: usize,
    vsplits: usize,
    ecols: usize,
    us: f64,
    #[serde(deserialize_with = "present")]
    tau: Option<f64>,
    complete: bool,
    morphing: usize,
    visible_vertices: usize,
    dirty_index_bytes: usize,
    dirty_wedges: usize,
    #[serde(deserialize_with = "present")]
    fetched: Option<usize>,
    #[serde(deserialize_with = "present")]
    no_room: Option<usize>,
    #[serde(deserialize_with = "present")]
    measured: Option<FlyMeasured>,
    #[serde(deserialize_with = "present")]
    on_ground: Option<FlyOnGround>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlyOnGround {
    samples: usize,
    max_pixels: f64,
    mean_pixels: f64,
    max_height: f64,
    uncovered: usize,
    cracks: usize,
    folds: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlyMeasured {
    samples: usize,
    max_pixels: f64,
    mean_pixels: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlySeconds {
    read: f64,
    bounds: f64,
}

#[test]
fn selective_commands_print_one_object_with_the_documented_fields() {
    let p = Place::new();
    p.generate("torus", "in.obj", 600);
    p.write(
        "cam.json",
        r#"{"eye": [0, 1, 6], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 45, "width": 640, "height": 480,
            "near": 0.1, "far": 100}"#,
    );
    let of = |arguments: &str| p.done(arguments).stdout;
    let e: Extract =
        serde_json::from_str(&of("extract in.obj out.ply --camera cam.json --tau 2 --json")).unwrap();
    assert_eq!((e.command.as_str(), e.to.as_str(), e.tau), ("extract", "ply", Some(2.0)));
    assert!(e.faces <= e.full_faces && e.splits <= e.full_splits && e.visible_vertices <= e.vertices);
    let f: Fly = serde_json::from_str(&of(
        "fly in.obj --path circle --frames 4 --measure-every 2 --samples 500 --json",
    ))
    .unwrap();
    assert_eq!((f.command.as_str(), f.frame_count, f.frames.len(), f.above), ("fly", 4, 4, 0));
    assert!(f.frames.iter().all(|f| f.morphing == 0) && f.morphing.max == 0.0);
    assert!(
        f.cracks.is_none()
            && f.folds.is_none()
            && f.uncovered.is_none()
            && f.frames.iter().all(|f| f.on_ground.is_none())
    );
    p.done("generate terrain grid.tif --size 33 --seed 1 -q");
    p.done("terrain tin grid.tif mesh.ply --max-error 0.5 --on-samples -q");
    let g: Fly = serde_json::from_str(&of(
        "fly mesh.ply --grid grid.tif --path circle --frames 2 --measure-every 1 --tau 0 --cull none --placement endpoint --lock-border --json",
    ))
    .unwrap();
    let judged = g.frames[1].on_ground.as_ref().unwrap();
    assert!(judged.samples > 0 && judged.mean_pixels <= judged.max_pixels && judged.max_height >= 0.0);
    assert_eq!((judged.uncovered, judged.cracks, judged.folds), (0, 0, 0));
    assert_eq!((g.cracks, g.folds, g.uncovered), (Some(0), Some(0), Some(0)));
    assert!(e.strips.is_none());
    let s: Extract =
        serde_json::from_str(&of("extract in.obj out.ply --camera cam.json --tau 2 --strips --json"))
            .unwrap();
    let strips = s.strips.unwrap();
    assert!(
        strips.mean_length > 2.0 && (strips.mean_length * strips.count as f64 - s.faces as f64).abs() < 1e-6
    );
    assert!(e.paging.is_none() && f.paging.is_none() && f.frames[0].fetched.is_none());
    p.done("encode in.obj in.pm --paged -q");
    let g: Fly = serde_json::from_str(&of("fly in.pm --path circle --frames 2 --memory 32 --json")).unwrap();
    let paged = g.paging.unwrap();
    assert!(
        paged.most_bytes <= paged.limit_bytes
            && paged.bytes_touched <= paged.bytes_read.min(paged.file_bytes)
    );
    assert!(
        paged.chunks_touched <= paged.chunks.min(paged.chunks_decoded)
            && paged.requests >= paged.chunks_decoded
    );
    assert!(paged.evictions <= paged.chunks_decoded);
    assert!(g.frames.iter().all(|f| f.fetched.is_some() && f.no_room == Some(0)));
    assert!(f.frames[2].measured.as_ref().is_some_and(|m| m.samples > 100) && f.frames[1].measured.is_none());
}

#[test]
fn progressive_commands_print_one_object_with_the_documented_fields() {
    let p = Place::new();
    p.generate("torus", "in.obj", 600);
    let count = p.done("info in.obj --json").json()["triangles"]["file"].as_u64().unwrap() as usize;
    let of = |arguments: &str| p.done(arguments).stdout;
    let e: Encode = serde_json::from_str(&of("encode in.obj in.pm --json")).unwrap();
    assert_eq!((e.command.as_str(), e.method.as_str(), e.triangles), ("encode", "quadric", count));
    assert_eq!(e.bytes, p.read("in.pm").len());
    assert!(e.base_triangles < count && e.splits > 200 && e.quantization_error.is_none());
    let d: Decode = serde_json::from_str(&of("decode in.pm out.ply --triangles 300 --json")).unwrap();
    assert_eq!((d.command.as_str(), d.to.as_str(), d.full_triangles), ("decode", "ply", count));
    assert!(d.triangles <= 300 && d.splits < d.full_splits && d.full_splits == e.splits);
    let l: Lod = serde_json::from_str(&of("lod in.pm out.glb --levels 0.5 --json")).unwrap();
    assert_eq!((l.command.as_str(), l.levels.len(), l.levels[1].coverage), ("lod", 2, Some(0.0)));
    let l: Lod = serde_json::from_str(&of("lod in.pm out.glb --levels 0.5 --separate --json")).unwrap();
    assert_eq!(l.levels[0].file.as_deref(), Some("out.lod0.glb"));
    let m: Morph =
        serde_json::from_str(&of("morph in.pm out.ply --from 100 --to 300 --at 0.5 --json")).unwrap();
    assert_eq!((m.command.as_str(), m.at, m.triangles), ("morph", 0.5, m.to_triangles));
    let i: Info = serde_json::from_str(&of("info in.pm --json")).unwrap();
    assert!(i.progressive.is_some_and(|p| p.streams.is_some() && p.splits == e.splits));
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Levels {
    command: String,
    file: String,
    faces: usize,
    diagonal: f64,
    threads: usize,
    runs: usize,
    methods: Vec<LevelsOfMethod>,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LevelsOfMethod {
    method: String,
    levels: Vec<DetailLevel>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DetailLevel {
    level: usize,
    faces: usize,
    splits: usize,
    seconds: LevelSeconds,
    #[serde(deserialize_with = "present")]
    measured: Option<Distance>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Distance {
    max: f64,
    rms: f64,
    mean: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LevelSeconds {
    simplify: f64,
    coarsen: f64,
    refine: f64,
}

#[test]
fn levels_prints_one_object_with_the_documented_fields() {
    let p = Place::new();
    p.generate("torus", "in.obj", 600);
    let run = p.done("levels in.obj --json --runs 1 --samples 1000 --epsilon 60");
    let l: Levels = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!((l.command.as_str(), l.threads, l.runs), ("levels", 1, 1));
    assert!(l.faces > 500 && l.diagonal > 0.0);
    assert!(l.methods.iter().all(|m| !m.levels.is_empty() && m.levels[0].level == 1));
    let run = p.done("levels in.obj --json --runs 1 --samples 0 --method nsa");
    let l: Levels = serde_json::from_str(&run.stdout).unwrap();
    assert!(l.methods.iter().flat_map(|m| &m.levels).all(|l| l.measured.is_none()));
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Convert {
    command: String,
    from: String,
    to: String,
    meshes: usize,
    vertices: usize,
    faces: usize,
    triangles: usize,
    seconds: ConvertSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConvertSeconds {
    read: f64,
    prepare: f64,
    write: f64,
    total: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Generate {
    command: String,
    name: String,
    seed: u64,
    to: String,
    vertices: usize,
    faces: usize,
    triangles: usize,
    warnings: Vec<String>,
}

#[test]
fn convert_and_generate_print_one_object_with_the_documented_fields() {
    let p = Place::new();
    let run = p.done("generate quad-sphere in.obj --faces 96 --seed 3 --json");
    let g: Generate = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(
        (g.command.as_str(), g.name.as_str(), g.seed, g.to.as_str()),
        ("generate", "quad-sphere", 3, "obj")
    );
    assert_eq!((g.vertices, g.faces, g.triangles), (98, 96, 192));
    let run = p.done("convert in.obj out.stl --json");
    let c: Convert = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!((c.command.as_str(), c.from.as_str(), c.to.as_str(), c.meshes), ("convert", "obj", "stl", 1));
    assert_eq!((c.vertices, c.faces, c.triangles), (98, 96, 192));
    let t = &c.seconds;
    assert!(
        t.read >= 0.0 && t.prepare >= 0.0 && t.write >= 0.0 && t.read + t.prepare + t.write <= t.total + 1e-9
    );
    // What is said on standard error is in the object, and there too.
    assert!(!c.warnings.is_empty());
    for w in &c.warnings {
        assert!(run.stderr.contains(&format!("warning: {w}\n")), "{w}");
    }
    for arguments in ["generate sphere - --to obj --json", "convert in.obj - --to obj --json"] {
        p.run(arguments).failed(2, "--json and OUT both want standard output");
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Clip {
    command: String,
    from: String,
    to: String,
    planes: Vec<[f64; 4]>,
    instances: ClipInstances,
    vertices: [usize; 2],
    triangles: [usize; 2],
    cut_faces: usize,
    dropped_faces: usize,
    #[serde(deserialize_with = "present")]
    cap: Option<Cap>,
    seconds: ClipSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClipInstances {
    inside: usize,
    cut: usize,
    outside: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Cap {
    loops: usize,
    triangles: usize,
    open_edges: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClipSeconds {
    read: f64,
    clip: f64,
    draw: f64,
    write: f64,
    total: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Cull {
    command: String,
    from: String,
    to: String,
    instances: CullInstances,
    components: CullComponents,
    faces: CullFaces,
    triangles: [usize; 2],
    seconds: CullSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CullInstances {
    all: usize,
    outside: usize,
    dropped: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CullComponents {
    all: usize,
    outside: usize,
    solid: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CullFaces {
    all: usize,
    outside: usize,
    back: usize,
    back_by_cone: usize,
    kept: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CullSeconds {
    read: f64,
    cull: f64,
    draw: f64,
    write: f64,
    total: f64,
}

/// A camera before the unit sphere.
const CAMERA: &str = r#"{"eye": [0, 0, 4], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 60,
    "width": 400, "height": 300, "near": 0.5, "far": 20}"#;

#[test]
fn clip_and_cull_print_one_object_with_the_documented_fields() {
    let p = Place::new();
    p.generate("sphere", "in.ply", 320);
    p.write("cam.json", CAMERA);
    let c: Clip =
        serde_json::from_str(&p.done("clip in.ply out.obj --plane 0,1,0,0.1 --cap --json").stdout).unwrap();
    assert_eq!((c.command.as_str(), c.from.as_str(), c.to.as_str()), ("clip", "ply", "obj"));
    assert_eq!((c.planes, c.instances.cut, c.triangles[0]), (vec![[0.0, 1.0, 0.0, 0.1]], 1, 320));
    let cap = c.cap.unwrap();
    assert!((cap.loops, cap.open_edges) == (1, 0) && cap.triangles > 10 && c.cut_faces > 10);
    let c: Clip =
        serde_json::from_str(&p.done("clip in.ply out.obj --frustum cam.json --json").stdout).unwrap();
    assert!((c.planes.len(), c.instances.inside) == (6, 1) && c.cap.is_none());
    let c: Cull =
        serde_json::from_str(&p.done("cull in.ply out.obj --camera cam.json --json").stdout).unwrap();
    assert_eq!((c.command.as_str(), c.instances.all, c.components.solid, c.faces.all), ("cull", 1, 1, 320));
    assert_eq!(c.faces.kept + c.faces.back + c.faces.outside, 320);
    assert_eq!(c.triangles, [320, c.faces.kept]);
    assert!(c.seconds.read + c.seconds.cull + c.seconds.draw + c.seconds.write <= c.seconds.total + 1e-3);
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TerrainTin {
    command: String,
    file: String,
    columns: usize,
    rows: usize,
    valid: usize,
    isolated: usize,
    #[serde(deserialize_with = "present")]
    filled: Option<usize>,
    #[serde(deserialize_with = "present")]
    breaklines: Option<TerrainBreaklines>,
    grid_triangles: usize,
    method: String,
    on_samples: bool,
    #[serde(deserialize_with = "present")]
    max_error: Option<f64>,
    contract: String,
    #[serde(deserialize_with = "present")]
    max_triangles: Option<usize>,
    triangles: usize,
    vertices: usize,
    error: TerrainError,
    #[serde(deserialize_with = "present")]
    step: Option<usize>,
    #[serde(deserialize_with = "present")]
    verified: Option<TerrainVerified>,
    #[serde(deserialize_with = "present")]
    tiles: Option<TerrainTiles>,
    space: String,
    #[serde(deserialize_with = "present")]
    spacing: Option<[f64; 2]>,
    #[serde(deserialize_with = "present")]
    exaggeration: Option<f64>,
    seconds: TerrainSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TerrainError {
    max: f64,
    rms: f64,
    surface: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TerrainBreaklines {
    lines: usize,
    steps: usize,
    beyond: usize,
    bent: usize,
    outside: usize,
    #[serde(deserialize_with = "present")]
    missing: Option<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TerrainTiles {
    format: String,
    directory: String,
    resampled: bool,
    #[serde(deserialize_with = "present")]
    border_mismatches: Option<usize>,
    levels: Vec<TerrainLevel>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TerrainLevel {
    level: u32,
    max_error: f64,
    error: f64,
    tiles: usize,
    triangles: usize,
    vertices: usize,
    bytes: usize,
    sag: f64,
    #[serde(deserialize_with = "present")]
    height_step: Option<f64>,
    #[serde(deserialize_with = "present")]
    border_mismatches: Option<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TerrainVerified {
    good: bool,
    exact: bool,
    max: f64,
    beyond: usize,
    #[serde(deserialize_with = "present")]
    surface_max: Option<f64>,
    pieces_beyond: usize,
    uncovered: usize,
    over_void: usize,
    turned: usize,
    flat: usize,
    excess_area: i64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TerrainSeconds {
    read: f64,
    make: f64,
    verify: f64,
    write: f64,
    draw: f64,
    total: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)]
struct TerrainBuild {
    command: String,
    file: String,
    columns: usize,
    rows: usize,
    floor: f64,
    error: f64,
    block: usize,
    levels: u32,
    blocks: usize,
    blocks_found: usize,
    vertices: usize,
    triangles: usize,
    base_triangles: usize,
    splits: usize,
    bytes: usize,
    #[serde(deserialize_with = "present")]
    peak_bytes: Option<u64>,
    seconds: TerrainBuildSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)]
struct TerrainBuildSeconds {
    read: f64,
    build: f64,
    encode: f64,
    write: f64,
    total: f64,
}

/// Of the same grid, in two blocks.
const BUILD: &str = "terrain build grid.raw built.pm --size 12x10 --type u8 --block 10 --json";

#[test]
fn terrain_build() {
    let p = Place::new();
    terrain(&p);
    let built: TerrainBuild = serde_json::from_str(&p.done(BUILD).stdout).unwrap();
    assert_eq!((built.columns, built.rows, built.block, built.vertices), (12, 10, 10, 120));
    assert_eq!((built.levels, built.blocks, built.blocks_found), (2, 3, 0));
    assert_eq!((built.command.as_str(), built.triangles, built.base_triangles), ("terrain build", 198, 2));
    assert_eq!((built.splits, built.error), (116, 0.0));
}

/// Twelve columns and ten rows of 8-bit heights.
const TERRAIN: &str = "terrain tin grid.raw out.glb --size 12x10 --type u8 --max-error 3 --verify --json";

fn terrain(p: &Place) {
    p.write("grid.raw", (0..120u32).map(|i| (i * i % 37) as u8).collect::<Vec<_>>());
}

#[test]
fn terrain_tin() {
    let p = Place::new();
    terrain(&p);
    let tin: TerrainTin = serde_json::from_str(&p.done(TERRAIN).stdout).unwrap();
    assert_eq!((tin.columns, tin.rows, tin.valid, tin.isolated), (12, 10, 120, 0));
    assert_eq!((tin.command.as_str(), tin.grid_triangles), ("terrain tin", 198));
    let verified = tin.verified.unwrap();
    assert!(verified.good && tin.error.max <= 3.0 && tin.error.rms <= tin.error.max);
    let regular: TerrainTin =
        serde_json::from_str(&p.done(&format!("{TERRAIN} --method regular --space grid")).stdout).unwrap();
    assert!(regular.step.is_some() && regular.spacing.is_none() && tin.spacing.is_some());
    let tiled = TERRAIN.replace("out.glb", "tiles") + " --tiles 2 --fill";
    let tiled: TerrainTin = serde_json::from_str(&p.done(&tiled).stdout).unwrap();
    let tiles = tiled.tiles.unwrap();
    assert_eq!((tiles.levels.len(), tiles.border_mismatches, tiled.filled), (2, Some(0), Some(0)));
    p.write("lines.json", r#"{"type": "LineString", "coordinates": [[1, 1], [9, 7]]}"#);
    let lines: TerrainTin =
        serde_json::from_str(&p.done(&format!("{TERRAIN} --breaklines lines.json")).stdout).unwrap();
    let b = lines.breaklines.unwrap();
    assert_eq!((b.lines, b.steps, b.beyond, b.bent, b.outside, b.missing), (1, 1, 0, 0, 0, Some(0)));
    assert!(
        tin.breaklines.is_none() && tin.tiles.is_none() && tin.filled.is_none() && tiles.levels[1].tiles == 4
    );
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GeneratedGrid {
    command: String,
    name: String,
    seed: u64,
    to: String,
    columns: usize,
    rows: usize,
    range: [f64; 2],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TerrainInfo {
    command: String,
    file: String,
    format: String,
    layout: String,
    columns: usize,
    rows: usize,
    #[serde(rename = "type")]
    sample: String,
    #[serde(deserialize_with = "present")]
    nodata: Option<f64>,
    void: u64,
    valid: u64,
    valid_share: f64,
    #[serde(deserialize_with = "present")]
    range: Option<[f64; 2]>,
    #[serde(deserialize_with = "present")]
    mean: Option<f64>,
    #[serde(deserialize_with = "present")]
    transform: Option<[f64; 6]>,
    sample_at: String,
    #[serde(deserialize_with = "present")]
    spacing: Option<[f64; 2]>,
    #[serde(deserialize_with = "present")]
    spacing_metres: Option<[f64; 2]>,
    #[serde(deserialize_with = "present")]
    bounds: Option<[[f64; 2]; 2]>,
    #[serde(deserialize_with = "present")]
    crs: Option<TerrainCrs>,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TerrainCrs {
    kind: String,
    #[serde(deserialize_with = "present")]
    name: Option<String>,
    #[serde(deserialize_with = "present")]
    epsg: Option<u16>,
    #[serde(deserialize_with = "present")]
    metres_per_unit: Option<f64>,
}

#[test]
fn terrain_info_and_landscapes() {
    let p = Place::new();
    let made: GeneratedGrid =
        serde_json::from_str(&p.done("generate terrain t.tif --size 9 --json").stdout).unwrap();
    assert_eq!(
        (made.command.as_str(), made.name.as_str(), made.columns, made.rows),
        ("generate", "terrain", 9, 9)
    );
    let info: TerrainInfo = serde_json::from_str(&p.done("terrain info t.tif --json").stdout).unwrap();
    assert_eq!((info.command.as_str(), info.valid, info.valid_share), ("terrain info", 81, 1.0));
    assert_eq!(info.range.unwrap().map(|h| h as f32), made.range.map(|h| h as f32));
    let crs = info.crs.unwrap();
    assert_eq!(
        (crs.kind.as_str(), crs.metres_per_unit, info.sample_at.as_str()),
        ("projected", Some(1.0), "point")
    );
}

#[test]
fn every_field_is_documented() {
    let documentation = include_str!("../docs/json.md");
    let p = Place::new();
    p.generate("quad-sphere", "in.obj", 96);
    p.generate("torus", "torus.obj", 96);
    terrain(&p);
    p.write("cam.json", CAMERA);
    let simplified = p.done("simplify torus.obj out.obj --max-error 0.1 --certified --measure --json").json();
    let others = [
        "info in.obj --json",
        "compare torus.obj out.obj --certify 1e-2 --threshold 1 --samples 100 --json",
        "encode in.obj in.pm --json",
        "info in.pm --json",
        "decode in.pm out.ply --json",
        "lod in.pm out.glb --levels 0.5 --json",
        "morph in.pm out.ply --from 50 --to 90 --at 0.5 --json",
        "levels in.obj --json --runs 1 --samples 100 --epsilon 60",
        "convert in.obj out.ply --json",
        "clip torus.obj out.ply --plane 0,1,0,0 --cap --json",
        "cull torus.obj out.ply --camera cam.json --json",
        "generate sphere s.ply --faces 20 --json",
        "generate terrain t.tif --size 9 --json",
        "terrain info t.tif --json",
        TERRAIN,
        BUILD,
    ];
    for object in others.map(|a| p.done(a).json()).into_iter().chain([simplified]) {
        let mut values = vec![&object];
        while let Some(v) = values.pop() {
            match v {
                serde_json::Value::Object(fields) => {
                    for (name, value) in fields {
                        assert!(documentation.contains(&format!("`{name}`")), "{name} is not documented");
                        values.push(value);
                    }
                }
                serde_json::Value::Array(all) => values.extend(all),
                _ => {}
            }
        }
    }
}
