//! `progmesh terrain tin --tiles`, end to end: tiles are read by the crate `gltf` and by a reader of quantized-mesh that shares no code
//! with the writer, and compared with the heights they were made of.

mod common;
mod common_terrain;

use common::Place;
use common_terrain::{Glb, glb, pixel};
use serde_json::Value;
use std::collections::BTreeMap;

const SIDE: usize = 81;

/// Whole metres.
fn height(x: usize, y: usize) -> f64 {
    let (x, y) = (x as f64, y as f64);
    let hill = 300.0 * (-((x - 30.0).powi(2) + (y - 44.0).powi(2)) / 300.0).exp();
    (hill + 40.0 * (x * 0.21).sin() * (y * 0.17).cos() + 6.0 * (x * 0.9 + y * 0.7).sin()).round()
}

/// A grid with a lake between the cuts of 4 tiles, or without: `a.asc` with steps of 30, and `N46E008.hgt`, a square degree.
fn grid(p: &Place, lake: bool) {
    let height = |x: usize, y: usize| {
        let void = lake && (x as f64 - 30.0).hypot(y as f64 - 30.0) < 7.0;
        if void { -32_768 } else { height(x, y) as i16 }
    };
    let mut text =
        format!("ncols {SIDE}\nnrows {SIDE}\nxllcenter 0\nyllcenter 0\ncellsize 30\nNODATA_value -32768\n");
    let mut bytes = vec![];
    for y in 0..SIDE {
        let row: Vec<i16> = (0..SIDE).map(|x| height(x, y)).collect();
        text.push_str(&row.iter().map(|h| h.to_string()).collect::<Vec<_>>().join(" "));
        text.push('\n');
        bytes.extend(row.iter().flat_map(|h| h.to_be_bytes()));
    }
    p.write("a.asc", text);
    p.write(HGT, bytes);
}

const HGT: &str = "N46E008.hgt";
/// Its first sample, and its steps.
const WEST: f64 = 8.0;
const NORTH: f64 = 47.0;
const STEP: f64 = 1.0 / 80.0;

/// A tile: a node that moved its mesh would move it off its neighbours.
fn unmoved(p: &Place, name: &str) -> Glb {
    let tile = glb(p, name);
    let still = gltf::scene::Transform::Decomposed {
        translation: [0.0; 3],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [1.0; 3],
    };
    assert!(tile.document.nodes().all(|n| n.transform().matrix() == still.clone().matrix()));
    tile
}

/// Everything on the common border of two tiles, bit by bit.
fn on_border(tile: &Glb, axis: usize, at: f32) -> Vec<Vec<u32>> {
    let mut rows: Vec<Vec<u32>> = (0..tile.positions.len())
        .filter(|&i| tile.positions[i][axis] == at)
        .map(|i| {
            let uv = tile.uvs.as_ref().map_or([0.0; 2], |u| u[i]);
            tile.positions[i].iter().chain(&tile.normals[i]).chain(&uv).map(|c| c.to_bits()).collect()
        })
        .collect();
    rows.sort();
    rows
}

#[test]
fn glb_tiles_meet_bit_by_bit_at_every_level() {
    let p = Place::new();
    grid(&p, true);
    p.write("photo.png", pixel());
    let report = p
        .done("terrain tin a.asc out --max-error 4 --tiles 4 --tile-format glb --verify --texture photo.png --json -q")
        .json();
    let tiles = &report["tiles"];
    assert_eq!((&tiles["format"], &tiles["border_mismatches"]), (&"glb".into(), &0.into()));
    assert_eq!((&report["verified"]["good"], &report["verified"]["exact"]), (&true.into(), &true.into()));
    let levels = tiles["levels"].as_array().unwrap();
    let numbers = |key: &str| levels.iter().map(|l| l[key].as_f64().unwrap()).collect::<Vec<_>>();
    assert_eq!(numbers("tiles"), [1.0, 4.0, 16.0]);
    assert_eq!(numbers("max_error"), [16.0, 8.0, 4.0]);
    assert!(levels.iter().all(|l| l["error"].as_f64() <= l["max_error"].as_f64()));
    assert_eq!(p.read("out/photo.png"), pixel());
    let list: Value = serde_json::from_slice(&p.read("out/tiles.json")).unwrap();
    assert_eq!(list["tiles"].as_array().unwrap().len(), 21);

    for n in [2usize, 4] {
        let z = n.ilog2();
        let tile = |x: usize, y: usize| unmoved(&p, &format!("out/{z}/{x}/{y}.glb"));
        let mut shared = 0;
        for a in 0..n {
            for b in 0..n - 1 {
                // Samples at the cut, in metres from the middle.
                let at = (((b + 1) * 80 / n) as f32 - 40.0) * 30.0;
                for (one, other, axis) in [(tile(b, a), tile(b + 1, a), 0), (tile(a, b), tile(a, b + 1), 2)] {
                    let (one, other) = (on_border(&one, axis, at), on_border(&other, axis, at));
                    assert!(one.len() > 1 || a + b > 0, "level {z}: {a} {b}");
                    assert_eq!(one, other, "level {z}: {a} {b}");
                    shared += one.len();
                }
            }
        }
        assert!(shared > 20, "{shared}");
        assert_eq!(tile(0, 0).image.as_deref(), Some("../../photo.png"));
    }
}

#[test]
fn heights_of_glb_tiles_are_those_of_the_grid_within_the_error() {
    let p = Place::new();
    grid(&p, false);
    p.done("terrain tin a.asc out --max-error 5 --tiles 2 --tile-format glb --exaggeration 2 -q");
    for (z, tiles, error) in [(0usize, 1usize, 10.0), (1, 2, 5.0)] {
        let mut seen = vec![false; SIDE * SIDE];
        for (x, y) in (0..tiles).flat_map(|x| (0..tiles).map(move |y| (x, y))) {
            let tile = unmoved(&p, &format!("out/{z}/{x}/{y}.glb"));
            for t in &tile.triangles {
                let [a, b, c] = t.map(|i| tile.positions[i].map(f64::from));
                each_sample(
                    [a, b, c].map(|p| [p[0] / 30.0 + 40.0, p[2] / 30.0 + 40.0, p[1] / 2.0]),
                    |x, y, z| {
                        seen[y * SIDE + x] = true;
                        assert!((z - height(x, y)).abs() <= error + 1e-3, "{x} {y}: {z}");
                    },
                );
            }
        }
        assert!(seen.iter().all(|&s| s));
    }
}

/// Calls `f(column, row, height of the triangle)` for the samples in a triangle of columns, rows and heights.
fn each_sample(t: [[f64; 3]; 3], mut f: impl FnMut(usize, usize, f64)) {
    let cross =
        |a: [f64; 3], b: [f64; 3], p: [f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let area = cross(t[0], t[1], [t[2][0], t[2][1]]);
    let ends = |k: usize| {
        let of = t.map(|p| p[k]);
        let (low, high) = (of[0].min(of[1]).min(of[2]), of[0].max(of[1]).max(of[2]));
        (low - 1e-6).ceil().max(0.0) as usize..=(high + 1e-6).floor() as usize
    };
    for y in ends(1) {
        for x in ends(0) {
            let p = [x as f64, y as f64];
            let w = [cross(t[1], t[2], p) / area, cross(t[2], t[0], p) / area, cross(t[0], t[1], p) / area];
            if w.iter().all(|&w| w > -1e-6) {
                f(x, y, (0..3).map(|k| w[k] * t[k][2]).sum());
            }
        }
    }
}

#[test]
fn a_tileset_is_a_tree_of_boxes_that_hold_their_tiles() {
    let p = Place::new();
    grid(&p, false);
    let report = p.done(&format!("terrain tin {HGT} out --max-error 4 --tiles 4 --verify --json -q")).json();
    assert_eq!((&report["space"], &report["tiles"]["format"]), (&"globe".into(), &"3d-tiles".into()));
    let tileset: Value = serde_json::from_slice(&p.read("out/tileset.json")).unwrap();
    assert_eq!(tileset["asset"]["version"], "1.1");
    // What is missing without any tile is a square degree, some 130 km across, not a few metres: readers would show nothing until they are near.
    assert!(tileset["geometricError"].as_f64().unwrap() > 130_000.0);
    let root = &tileset["root"];
    let transform: Vec<f64> =
        root["transform"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let mut stack = vec![(root, f64::INFINITY)];
    let (mut tiles, mut seen) = (0, BTreeMap::new());
    while let Some((tile, above)) = stack.pop() {
        tiles += 1;
        let error = tile["geometricError"].as_f64().unwrap();
        assert!(error <= above && error >= 4.0);
        let b: Vec<f64> =
            tile["boundingVolume"]["box"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        let uri = tile["content"]["uri"].as_str().unwrap();
        for q in unmoved(&p, &format!("out/{uri}")).positions {
            let [x, y, z] = [q[0], -q[2], q[1]].map(f64::from);
            for (k, c) in [x, y, z].into_iter().enumerate() {
                assert!((c - b[k]).abs() <= b[3 + 4 * k] + 1e-6, "{uri}");
            }
            let earth =
                |k: usize| transform[k] * x + transform[4 + k] * y + transform[8 + k] * z + transform[12 + k];
            if uri == "2/0/0.glb" {
                seen.insert(q.map(f32::to_bits), [earth(0), earth(1), earth(2)]);
            }
        }
        for child in tile["children"].as_array().into_iter().flatten() {
            stack.push((child, error));
        }
    }
    assert_eq!(tiles, 21);
    let (lon, lat, h) = (WEST.to_radians(), NORTH.to_radians(), height(0, 0));
    let (a, b) = (6_378_137.0f64, 6_356_752.314_245f64);
    let n = a * a / ((a * lat.cos()).powi(2) + (b * lat.sin()).powi(2)).sqrt();
    let first = [
        (n + h) * lat.cos() * lon.cos(),
        (n + h) * lat.cos() * lon.sin(),
        (b * b / (a * a) * n + h) * lat.sin(),
    ];
    let near = seen.values().map(|q| (0..3).map(|k| (q[k] - first[k]).powi(2)).sum::<f64>().sqrt());
    assert!(near.fold(f64::INFINITY, f64::min) < 0.01, "the corner is not where it should be");
    // Metres on a plane: moved to its place there.
    p.done("generate terrain b.tif --size 33 -q");
    let bounds = p.done("terrain info b.tif --json").json()["bounds"].clone();
    p.done("terrain tin b.tif plane --max-error 40 --tiles 2 -q");
    let plane: Value = serde_json::from_slice(&p.read("plane/tileset.json")).unwrap();
    for k in 0..2 {
        let middle = (bounds[0][k].as_f64().unwrap() + bounds[1][k].as_f64().unwrap()) / 2.0;
        assert_eq!(plane["root"]["transform"][12 + k], middle);
    }
}

/// A tile of quantized-mesh, by its specification.
struct Quantized {
    heights: [f32; 2],
    vertices: Vec<[u16; 3]>,
    triangles: Vec<[usize; 3]>,
    /// West, south, east, north.
    borders: [Vec<usize>; 4],
    normals: Vec<[f64; 3]>,
}

fn quantized(bytes: &[u8]) -> Quantized {
    let f64_at = |o: usize| f64::from_le_bytes(bytes[o..o + 8].try_into().unwrap());
    let f32_at = |o: usize| f32::from_le_bytes(bytes[o..o + 4].try_into().unwrap());
    let u32_at = |o: usize| u32::from_le_bytes(bytes[o..o + 4].try_into().unwrap()) as usize;
    let u16_at = |o: usize| u16::from_le_bytes(bytes[o..o + 2].try_into().unwrap());
    let centre = [0, 8, 16].map(f64_at);
    let length = centre.iter().map(|c| c * c).sum::<f64>().sqrt();
    assert!((6.3e6..6.4e6).contains(&length), "{centre:?}");
    let sphere = [32, 40, 48].map(f64_at);
    assert_eq!(centre, sphere);
    assert!(f64_at(56) > 0.0 && [64, 72, 80].map(f64_at).iter().map(|c| c * c).sum::<f64>() >= 1.0);
    let count = u32_at(88);
    let mut at = 92;
    let mut vertices = vec![[0u16; 3]; count];
    for k in 0..3 {
        let mut value = 0i32;
        for v in &mut vertices {
            let code = i32::from(u16_at(at));
            value += (code >> 1) ^ -(code & 1);
            v[k] = u16::try_from(value).unwrap();
            assert!(v[k] <= 32_767);
            at += 2;
        }
    }
    assert!(count <= 65_536, "small tiles");
    let triangle_count = u32_at(at);
    at += 4;
    let mut highest = 0;
    let mut triangles = vec![[0; 3]; triangle_count];
    for i in triangles.as_flattened_mut() {
        let code = usize::from(u16_at(at));
        *i = highest - code;
        highest += usize::from(code == 0);
        at += 2;
    }
    assert_eq!(highest, count, "every vertex is used");
    let borders = [(); 4].map(|()| {
        let n = u32_at(at);
        at += 4;
        let list = (0..n).map(|i| usize::from(u16_at(at + 2 * i))).collect();
        at += 2 * n;
        list
    });
    assert_eq!((bytes[at], u32_at(at + 1)), (1, 2 * count));
    at += 5;
    let normals = (0..count)
        .map(|i| {
            let [mut x, mut y] = [0, 1].map(|k| f64::from(bytes[at + 2 * i + k]) / 255.0 * 2.0 - 1.0);
            let z = 1.0 - x.abs() - y.abs();
            if z < 0.0 {
                (x, y) = ((1.0 - y.abs()) * x.signum(), (1.0 - x.abs()) * y.signum());
            }
            let length = x.hypot(y).hypot(z);
            [x / length, y / length, z / length]
        })
        .collect();
    assert_eq!(at + 2 * count, bytes.len());
    Quantized { heights: [f32_at(24), f32_at(28)], vertices, triangles, borders, normals }
}

#[test]
fn quantized_mesh_tiles_lie_on_the_globe_and_meet_bit_by_bit() {
    let p = Place::new();
    grid(&p, false);
    let run = p.done(&format!(
        "terrain tin {HGT} out --max-error 4 --tiles 4 --tile-format quantized-mesh --verify --json"
    ));
    assert!(run.stderr.contains("interpolated"), "{}", run.stderr);
    let report: Value = run.json();
    let tiles = &report["tiles"];
    assert_eq!((&tiles["resampled"], &tiles["border_mismatches"]), (&true.into(), &0.into()));
    assert_eq!(report["verified"]["good"], true);
    let layer: Value = serde_json::from_slice(&p.read("out/layer.json")).unwrap();
    assert_eq!((&layer["format"], &layer["scheme"]), (&"quantized-mesh-1.0".into(), &"tms".into()));
    let levels = layer["available"].as_array().unwrap();
    assert_eq!(levels.len(), tiles["levels"].as_array().unwrap().len());
    for (z, ranges) in levels.iter().enumerate() {
        let side = 180.0 / 2f64.powi(z as i32);
        let mut made = BTreeMap::new();
        for r in ranges.as_array().unwrap() {
            let n = |key: &str| r[key].as_u64().unwrap();
            for (x, y) in
                (n("startX")..=n("endX")).flat_map(|x| (n("startY")..=n("endY")).map(move |y| (x, y)))
            {
                made.insert((x, y), quantized(&p.read(&format!("out/{z}/{x}/{y}.terrain"))));
            }
        }
        assert_eq!(made.len() as u64, tiles["levels"][z]["tiles"].as_u64().unwrap());
        let step = tiles["levels"][z]["height_step"].as_f64().unwrap();
        let allowed = tiles["levels"][z]["max_error"].as_f64().unwrap() + step / 2.0;
        for (&(x, y), tile) in &made {
            let [low, high] = tile.heights.map(f64::from);
            // Two neighbours have the same vertices on their border, and the same heights.
            for (other, east) in [((x + 1, y), true), ((x, y + 1), false)] {
                let Some(other) = made.get(&other) else { continue };
                assert_eq!(tile.heights, other.heights);
                let along = |t: &Quantized, list: usize| -> Vec<[u16; 2]> {
                    t.borders[list]
                        .iter()
                        .map(|&v| [t.vertices[v][usize::from(east)], t.vertices[v][2]])
                        .collect()
                };
                let (one, two) =
                    if east { (along(tile, 2), along(other, 0)) } else { (along(tile, 3), along(other, 1)) };
                assert!(!one.is_empty());
                assert_eq!(one, two, "level {z}, tile {x} {y}");
            }
            // Every sample under it lies within the error of that level; the slopes here change little over half a step sideways.
            for t in &tile.triangles {
                let corner = t.map(|v| {
                    let [u, v, h] = tile.vertices[v].map(|c| f64::from(c) / 32_767.0);
                    let degrees = [(x as f64 + u) * side - 180.0, (y as f64 + v) * side - 90.0];
                    [(degrees[0] - WEST) / STEP, (NORTH - degrees[1]) / STEP, low + h * (high - low)]
                });
                let turn = (corner[1][0] - corner[0][0]) * (corner[2][1] - corner[0][1])
                    - (corner[1][1] - corner[0][1]) * (corner[2][0] - corner[0][0]);
                assert!(turn < 0.0, "to the left, where rows run south");
                if z + 2 < levels.len() {
                    continue;
                }
                each_sample(corner, |c, r, h| {
                    let inside = c < SIDE && r < SIDE;
                    // The lattice is not the samples: the grid bends by up to 7 from one to the next, twice.
                    assert!(!inside || (h - height(c, r)).abs() <= allowed + 12.0, "level {z}: {c} {r}: {h}");
                });
            }
            for n in &tile.normals {
                let up = [46f64.to_radians().cos() * 8f64.to_radians().cos(), 0.0, 46f64.to_radians().sin()];
                assert!((0..3).map(|k| n[k] * up[k]).sum::<f64>() > 0.5, "{n:?}");
            }
        }
    }
}

#[test]
fn the_number_of_threads_does_not_show_and_nothing_is_replaced() {
    let p = Place::new();
    grid(&p, true);
    for format in ["3d-tiles", "quantized-mesh"] {
        for threads in [1, 2] {
            p.done(&format!(
                "terrain tin {HGT} {format}{threads} --max-error 6 --tiles 2 --tile-format {format} --threads {threads} -q"
            ));
        }
        let files = |n: usize| {
            let root = p.path(&format!("{format}{n}"));
            let mut stack = vec![root.clone()];
            let mut all = BTreeMap::new();
            while let Some(d) = stack.pop() {
                for e in std::fs::read_dir(d).unwrap() {
                    let path = e.unwrap().path();
                    if path.is_dir() {
                        stack.push(path);
                    } else {
                        all.insert(
                            path.strip_prefix(&root).unwrap().to_owned(),
                            std::fs::read(&path).unwrap(),
                        );
                    }
                }
            }
            all
        };
        assert!(files(1) == files(2) && files(1).len() > 5);
    }
    p.run("terrain tin a.asc 3d-tiles1 --max-error 6 --tiles 2").failed(4, "not empty");
    p.run("terrain tin a.asc a.asc --max-error 6 --tiles 2").failed(4, "no directory");
    p.run("terrain tin a.asc none/out --max-error 6 --tiles 2").failed(4, "none");
    assert!(p.files().iter().all(|f| !f.starts_with(".progmesh")), "{:?}", p.files());
}

#[test]
fn breaklines_go_through_tiles() {
    let p = Place::new();
    grid(&p, true);
    // Columns 0 to 80 are 0 to 2,400 m, rows from the last. One along a cut, one through samples of the cuts, one between them and through the lake.
    p.write(
        "roads.json",
        r#"{"type": "MultiLineString", "coordinates": [[[1200, 150], [1200, 900]], [[0, 2250], [2400, 1650]], [[30, 1470], [2370, 1530]]]}"#,
    );
    for format in ["3d-tiles", "glb"] {
        let run = p.done(&format!(
            "terrain tin a.asc {format} --max-error 6 --tiles 4 --tile-format {format} --breaklines roads.json --verify --json"
        ));
        let report = run.json();
        assert_eq!(
            (&report["verified"]["good"], &report["tiles"]["border_mismatches"]),
            (&true.into(), &0.into())
        );
        let b = &report["breaklines"];
        assert!(b["lines"] == 3 && b["steps"].as_u64() >= Some(3));
        let n = |key: &str| b[key].as_u64().unwrap();
        assert!(n("bent") >= 3 && n("missing") <= n("bent") + n("outside"), "{b}");
        assert!(run.stderr.contains("borders of tiles"), "{}", run.stderr);
    }
    // The second goes over column 40 at row 15, and both tiles have a vertex there, half a step beside at most: in metres from the middle.
    for name in ["glb/2/1/0.glb", "glb/2/2/0.glb"] {
        let near = |q: &[f32; 3]| q[0] == 0.0 && (q[2] + 750.0).abs() <= 30.0;
        assert!(unmoved(&p, name).positions.iter().any(near), "{name}");
    }
}

#[test]
fn breaklines_go_through_tiles_of_the_globe() {
    let p = Place::new();
    grid(&p, false);
    // Along a meridian and along a parallel, through several tiles.
    let (longitude, latitude, ends) = (8.3, 46.55, [0.2, 0.8]);
    let lines = format!(
        r#"{{"type": "MultiLineString", "coordinates": [[[{longitude}, {}], [{longitude}, {}]], [[{}, {latitude}], [{}, {latitude}]]]}}"#,
        46.0 + ends[0],
        46.0 + ends[1],
        8.0 + ends[0],
        8.0 + ends[1]
    );
    p.write("roads.json", lines);
    let run = p.done(&format!(
        "terrain tin {HGT} out --max-error 20 --tiles 4 --tile-format quantized-mesh --breaklines roads.json --verify --json"
    ));
    let report = run.json();
    assert_eq!(
        (&report["verified"]["good"], &report["tiles"]["border_mismatches"]),
        (&true.into(), &0.into())
    );
    let b = &report["breaklines"];
    assert_eq!((&b["lines"], &b["missing"], &b["outside"]), (&2.into(), &0.into(), &0.into()), "{b}");
    // Sides of triangles along each, tile by tile, in degrees.
    let layer: Value = serde_json::from_slice(&p.read("out/layer.json")).unwrap();
    let levels = layer["available"].as_array().unwrap();
    let (z, side) = (levels.len() - 1, 180.0 / 2f64.powi(levels.len() as i32 - 1));
    let step = side / (side / STEP).ceil();
    let mut along = [0.0f64; 2];
    for r in levels[z].as_array().unwrap() {
        let n = |key: &str| r[key].as_u64().unwrap();
        for (x, y) in (n("startX")..=n("endX")).flat_map(|x| (n("startY")..=n("endY")).map(move |y| (x, y))) {
            let tile = quantized(&p.read(&format!("out/{z}/{x}/{y}.terrain")));
            let degrees = |v: usize| {
                let [u, v, _] = tile.vertices[v].map(|c| f64::from(c) / 32_767.0 * side);
                [u + x as f64 * side - 180.0, v + y as f64 * side - 90.0]
            };
            let sides = tile.triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
            // Each but those of borders comes twice, once from either side.
            let sides: std::collections::BTreeSet<[usize; 2]> =
                sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
            for [a, b] in sides {
                let (a, b) = (degrees(a), degrees(b));
                for (k, at) in [longitude, latitude].into_iter().enumerate() {
                    let near = |p: [f64; 2]| (p[k] - at).abs() <= 0.5 * step + 1e-4;
                    if near(a) && near(b) {
                        along[k] += (a[1 - k] - b[1 - k]).abs();
                    }
                }
            }
        }
    }
    assert!(along.iter().all(|&l| l > 0.6 - 1.01 * step), "{along:?}");
}

#[test]
fn tiles_keep_the_error_between_samples_too() {
    let p = Place::new();
    grid(&p, true);
    for method in ["best", "greedy"] {
        let made = p.done(&format!(
            "terrain tin a.asc {method} --max-error 5 --error surface --tiles 2 --tile-format glb --method {method} --verify --json"
        ));
        let report = made.json();
        let verified = &report["verified"];
        assert_eq!((&report["contract"], &verified["good"]), (&"surface".into(), &true.into()), "{report}");
        assert!(verified["surface_max"].as_f64().unwrap() > 0.0);
        assert_eq!(report["tiles"]["border_mismatches"].as_u64(), Some(0));
        for level in report["tiles"]["levels"].as_array().unwrap() {
            let of = |name: &str| level[name].as_f64().unwrap();
            assert!(of("error") <= of("max_error"), "{level}");
        }
        assert!(report["error"]["surface"].as_f64().unwrap() <= 5.0);
    }
}

#[test]
fn what_tiles_cannot_be_is_said() {
    let p = Place::new();
    grid(&p, false);
    let fails = |arguments: &str, code: i32, text: &str| {
        p.run(&format!("terrain tin a.asc out --tiles 2 {arguments}")).failed(code, text);
        assert!(!p.exists("out"), "{arguments}");
    };
    fails("", 2, "--max-error");
    fails("--max-error 1 --triangles 9", 2, "--triangles");
    fails("--max-error 1 --method regular", 2, "--method best or greedy");
    fails("--max-error 1 --outline-tolerance 1", 2, "--outline-tolerance");
    fails("--max-error 1 --space grid", 2, "--space grid");
    fails("--max-error 1 --png a.png", 2, "--png");
    fails("--max-error 1 --to glb", 2, "directory");
    fails("--max-error 1 --tile-format quantized-mesh", 3, "not in degrees");
    fails("--max-error 1 --tile-format quantized-mesh --uv", 2, "--uv");
    p.run("terrain tin a.asc out.glb --max-error 1 --tile-format glb").failed(2, "--tiles");
    p.run("terrain tin a.asc out.glb --max-error 1 --tiles 2").failed(2, "a directory of many files");
    p.run(&format!("terrain tin a.asc out --max-error 1 --tiles {SIDE}")).failed(2, "but 80 steps");
    // A grid without a sample to cover.
    p.write("void.raw", [0u8; 200]);
    p.run("terrain tin void.raw out --max-error 1 --tiles 2 --size 10x10 --type i16 --nodata 0")
        .failed(3, "nothing");
    assert!(!p.exists("out"));
}
