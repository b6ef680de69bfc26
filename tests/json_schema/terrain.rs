//! `terrain tin`, `terrain build`, `terrain info` and landscapes.

use crate::common::Place;
use crate::present;
use serde::Deserialize;

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
    outline: Option<TerrainOutline>,
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
struct TerrainOutline {
    tolerance: f64,
    corners: usize,
    kept: usize,
    dropped: usize,
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
    dropped: usize,
    overlapping: usize,
    astray: usize,
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
pub(crate) const BUILD: &str = "terrain build grid.raw built.pm --size 12x10 --type u8 --block 10 --json";

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
pub(crate) const TERRAIN: &str =
    "terrain tin grid.raw out.glb --size 12x10 --type u8 --max-error 3 --verify --json";

pub(crate) fn terrain(p: &Place) {
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
    // Over ground as rough as this the line takes more than one piece.
    assert!(b.steps > 1);
    assert_eq!((b.lines, b.beyond, b.bent, b.outside, b.missing), (1, 0, 0, 0, Some(0)));
    let simple = format!("{TERRAIN} --nodata 0 --outline-tolerance 1");
    let simple: TerrainTin = serde_json::from_str(&p.done(&simple).stdout).unwrap();
    let (o, v) = (simple.outline.unwrap(), simple.verified.unwrap());
    assert!(o.tolerance == 1.0 && o.kept <= o.corners && o.dropped == v.dropped && v.good);
    assert_eq!((v.overlapping, v.astray), (0, 0));
    assert!(tin.outline.is_none());
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
