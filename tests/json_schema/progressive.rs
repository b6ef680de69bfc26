//! `encode`, `decode`, `lod`, `morph` and `levels`.

use crate::common::Place;
use crate::present;
use crate::simplify::Info;
use serde::Deserialize;

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
