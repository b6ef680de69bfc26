//! `simplify` and `info`.

use crate::common::Place;
use crate::present;
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
pub(crate) struct Info {
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
    pub(crate) progressive: Option<Progressive>,
    #[serde(deserialize_with = "present")]
    check: Option<String>,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Progressive {
    base_triangles: usize,
    pub(crate) splits: usize,
    levels: usize,
    #[serde(deserialize_with = "present")]
    chunks: Option<usize>,
    #[serde(deserialize_with = "present")]
    quantization_error: Option<f64>,
    #[serde(deserialize_with = "present")]
    pub(crate) streams: Option<Streams>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Streams {
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
