//! `extract` and `fly`.

use crate::common::Place;
use crate::present;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Extract {
    command: String,
    to: String,
    rule: String,
    error: String,
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
    #[serde(deserialize_with = "present")]
    guard: Option<Guard>,
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
struct Guard {
    deferred: usize,
    through: usize,
    turned: usize,
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
    rule: String,
    error: String,
    #[serde(deserialize_with = "present")]
    tau: Option<f64>,
    #[serde(deserialize_with = "present")]
    fps: Option<usize>,
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
    strip_length: Option<FlyStatistics>,
    #[serde(deserialize_with = "present")]
    measured_over_tau: Option<FlyStatistics>,
    above: usize,
    #[serde(deserialize_with = "present")]
    cracks: Option<usize>,
    #[serde(deserialize_with = "present")]
    folds: Option<usize>,
    #[serde(deserialize_with = "present")]
    uncovered: Option<usize>,
    #[serde(deserialize_with = "present")]
    floor_pixels: Option<f64>,
    memory: FlyMemory,
    #[serde(deserialize_with = "present")]
    paging: Option<Paging>,
    #[serde(deserialize_with = "present")]
    guard: Option<Guard>,
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
    #[serde(deserialize_with = "present")]
    visible_vertices: Option<usize>,
    dirty_index_bytes: usize,
    dirty_wedges: usize,
    #[serde(deserialize_with = "present")]
    strips: Option<ExtractStrips>,
    #[serde(deserialize_with = "present")]
    fetched: Option<usize>,
    #[serde(deserialize_with = "present")]
    no_room: Option<usize>,
    #[serde(deserialize_with = "present")]
    measured: Option<FlyMeasured>,
    #[serde(deserialize_with = "present")]
    on_ground: Option<FlyOnGround>,
    #[serde(deserialize_with = "present")]
    cracks: Option<usize>,
    #[serde(deserialize_with = "present")]
    folds: Option<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlyOnGround {
    samples: usize,
    max_pixels: f64,
    mean_pixels: f64,
    beyond_pixels: f64,
    floor_pixels: f64,
    max_height: f64,
    uncovered: usize,
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
            && f.floor_pixels.is_none()
            && f.frames.iter().all(|f| f.on_ground.is_none() && f.cracks.is_none() && f.folds.is_none())
    );
    p.done("generate terrain grid.tif --size 33 --seed 1 -q");
    p.done("terrain tin grid.tif mesh.ply --max-error 0.5 --on-samples -q");
    let g: Fly = serde_json::from_str(&of(
        "fly mesh.ply --grid grid.tif --path circle --frames 2 --measure-every 1 --tau 0 --cull none --placement endpoint --lock-border --json",
    ))
    .unwrap();
    let judged = g.frames[1].on_ground.as_ref().unwrap();
    assert!(judged.samples > 0 && judged.mean_pixels <= judged.max_pixels && judged.max_height >= 0.0);
    assert_eq!((judged.uncovered, g.frames[1].cracks, g.frames[1].folds), (0, Some(0), Some(0)));
    assert_eq!(
        (judged.beyond_pixels, judged.floor_pixels, g.floor_pixels),
        (judged.max_pixels, 0.0, Some(0.0))
    );
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
    assert_eq!((e.rule.as_str(), f.rule.as_str()), ("rings", "rings"));
    assert_eq!((e.error.as_str(), f.error.as_str()), ("uniform", "uniform"));
    assert!(f.strip_length.is_none() && f.frames[0].strips.is_none());
    let d: Fly = serde_json::from_str(&of(
        "fly in.obj --path circle --frames 3 --measure-every 2 --samples 500 --error directional --strips --json",
    ))
    .unwrap();
    assert!(d.error == "directional" && d.frames[0].faces <= f.frames[0].faces && d.above == 0);
    let strips = d.frames[1].strips.as_ref().unwrap();
    assert!((strips.mean_length * strips.count as f64 - d.frames[1].faces as f64).abs() < 1e-6);
    assert!(d.strip_length.is_some_and(|s| s.mean > 2.0));
    assert!(e.guard.is_none() && f.guard.is_none());
    let t: Extract =
        serde_json::from_str(&of("extract in.obj out.ply --camera cam.json --tau 2 --rule truly --json"))
            .unwrap();
    assert!(t.rule == "truly" && t.faces <= e.faces && t.full_splits == e.full_splits);
    let flight = "fly in.obj --path circle --frames 3 --rule truly --measure-every 2 --samples 500 --json";
    let u: Fly = serde_json::from_str(&p.run(flight).stdout).unwrap();
    assert!(u.rule == "truly" && u.frames[2].measured.as_ref().is_some_and(|m| m.samples > 100));
    let guards = [t.guard.unwrap(), u.guard.unwrap()];
    assert!(guards.iter().all(|g| g.turned <= t.full_splits && g.deferred + g.through <= 9 * t.full_splits));
    p.done("encode in.obj in.pm --paged -q");
    let g: Fly =
        serde_json::from_str(&of("fly in.pm --path circle --frames 2 --memory 32 --fps 500 --json")).unwrap();
    assert_eq!((f.fps, g.fps), (None, Some(500)));
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
