//! `progmesh terrain tin`, end to end.

mod common;
mod common_terrain;

use common::Place;
use common_terrain::{Glb, glb, pixel};
use serde_json::Value;

/// Heights of a hilly raster of 48 x 40 samples, i16, with a lake of voids (-32768) unless told otherwise.
fn hills(lake: bool) -> Vec<u8> {
    let height = |i: i32| {
        let (x, y) = (f64::from(i % 48), f64::from(i / 48));
        let hill = 300.0 * (-((x - 14.0).powi(2) + (y - 22.0).powi(2)) / 90.0).exp();
        let waves = 25.0 * (x * 0.45).sin() * (y * 0.31).cos() + 4.0 * (x * 1.9 + y).sin();
        let void = lake && (x - 34.0).hypot(y - 12.0) < 6.0;
        if void { i16::MIN } else { (hill + waves) as i16 }
    };
    (0..48 * 40).flat_map(|i| height(i).to_le_bytes()).collect()
}

const RAW: &str = "--size 48x40 --type i16 --nodata -32768";

fn place() -> Place {
    let p = Place::new();
    p.write("hills.raw", hills(true));
    p
}

fn tin(p: &Place, arguments: &str) -> Value {
    p.done(&format!("terrain tin hills.raw {arguments} {RAW} --verify --json -q")).json()
}

#[test]
fn every_method_keeps_the_error_and_the_check_agrees() {
    let p = place();
    let mut counts = vec![];
    for method in ["best", "greedy", "decimation", "regular"] {
        let report = tin(&p, &format!("{method}.ply --max-error 6 --method {method}"));
        assert_eq!(report["verified"]["good"], true, "{report}");
        assert_eq!(report["verified"]["exact"], true);
        assert!(report["error"]["max"].as_f64().unwrap() <= 6.0);
        let triangles = report["triangles"].as_u64().unwrap();
        assert_eq!(p.info(&format!("{method}.ply"))["meshes"][0]["faces"], triangles);
        counts.push(triangles);
    }
    assert!(counts[0] * 10 < counts[1] * 7, "{counts:?}");
    let kept = tin(&p, "kept.ply --max-error 6 --on-samples");
    assert_eq!((&kept["on_samples"], &kept["verified"]["good"]), (&true.into(), &true.into()));
}

#[test]
fn the_surface_contract_holds_between_samples() {
    let p = place();
    for how in ["", "--on-samples", "--method greedy", "--method regular"] {
        let report = tin(&p, &format!("out.ply --max-error 6 --error surface {how}"));
        assert_eq!((&report["contract"], &report["verified"]["good"]), (&"surface".into(), &true.into()));
        let [own, separate] =
            [&report["error"]["surface"], &report["verified"]["surface_max"]].map(|v| v.as_f64().unwrap());
        assert!(own <= 6.0 && (own - separate).abs() < 1e-9, "{how}: {own} {separate}");
    }
}

#[test]
fn a_count_is_kept_and_an_outline_that_needs_more_is_said() {
    let p = place();
    let report = tin(&p, "few.ply --triangles 200");
    let triangles = report["triangles"].as_u64().unwrap();
    assert!((150..=200).contains(&triangles), "{triangles}");
    p.run(&format!("terrain tin hills.raw few.ply --triangles 3 {RAW}")).failed(1, "the outline alone takes");
    assert!(p.exists("few.ply"));
}

#[test]
fn grid_space_is_columns_rows_and_heights() {
    let p = Place::new();
    p.write("hills.raw", hills(false));
    let report = tin(&p, "out.obj --max-error 20");
    assert_eq!((&report["space"], &report["spacing"]), (&"grid".into(), &Value::Null));
    let text = p.text("out.obj");
    for corner in ["v 0 0 ", "v 47 0 ", "v 0 39 ", "v 47 39 "] {
        assert!(text.lines().any(|l| l.starts_with(corner)), "{corner}");
    }
    p.run(&format!("terrain tin hills.raw o.ply --max-error 9 --spacing 2 {RAW}")).failed(2, "--space world");
}

#[test]
fn a_glb_is_in_metres_with_y_up_and_the_normals_of_the_grid() {
    let p = place();
    let report = tin(&p, "out.glb --max-error 6 --spacing 30,20 --exaggeration 2");
    assert_eq!(report["space"], "world");
    assert_eq!(report["spacing"], serde_json::json!([30.0, 20.0]));
    let Glb { positions, normals, triangles, document, .. } = glb(&p, "out.glb");
    assert_eq!(positions.len(), normals.len());
    assert!(normals.iter().all(|n| n[1] > 0.0 && (n.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-5));
    let most = positions.iter().fold(f32::MIN, |m, p| m.max(p[0]));
    assert_eq!(most, 23.5 * 30.0);
    // Front faces look up.
    for t in triangles {
        let [a, b, c] = [positions[t[0]], positions[t[1]], positions[t[2]]];
        let up = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2]);
        assert!(up > 0.0);
    }
    let extras = document.scenes().next().unwrap().extras().clone().unwrap();
    assert!(extras.get().contains("terrain_exaggeration"), "{extras}");
    let unknown = p.done(&format!("terrain tin hills.raw out.glb --max-error 6 {RAW}"));
    assert!(unknown.stderr.contains("--spacing"), "{}", unknown.stderr);
}

/// The error is proven for what is written: for readers of f64 too, which get another number from the few digits that an f32 needs.
#[test]
fn text_holds_the_heights_that_were_proven() {
    let p = Place::new();
    p.write(
        "a.raw",
        (0..30 * 30u32)
            .flat_map(|i| (1e4 + f64::from(i * 7919 % 1009) * 0.3).to_le_bytes())
            .collect::<Vec<u8>>(),
    );
    for (name, mark, from) in
        [("a.obj", "v ", 1), ("a.ply", "", 0), ("a.stl", "vertex ", 1), ("a.off", "", 0)]
    {
        p.done(&format!("terrain tin a.raw {name} --max-error 9 --size 30x30 --type f64 --text -q"));
        let text = p.text(name);
        let mut points = 0;
        for line in text.lines().map(str::trim).filter(|l| l.starts_with(mark)) {
            let words: Vec<&str> = line.split_whitespace().skip(from).collect();
            // Vertices, not faces or heads.
            let [x, y, z] = words[..] else { continue };
            let (Ok(_), Ok(_), Ok(z)) = (x.parse::<f64>(), y.parse::<f64>(), z.parse::<f64>()) else {
                continue;
            };
            if z > 9e3 {
                points += 1;
                assert_eq!(z, f64::from(z as f32), "{name}: {line}");
            }
        }
        assert!(points > 100, "{name}: {points}");
    }
}

#[test]
fn where_the_grid_lies_is_passed_on() {
    let p = Place::new();
    // A tile of a degree, its first sample at 11 E, 58 N.
    p.write("N57E011.hgt", (0..25i16).flat_map(|i| (i * i % 7).to_be_bytes()).collect::<Vec<u8>>());
    let transform = "[0.25,0.0,11.0,0.0,-0.25,58.0]";
    for name in ["a.ply", "a.obj"] {
        p.done(&format!("terrain tin N57E011.hgt {name} --max-error 1 --text -q"));
        let text = p.text(name);
        for fact in [&format!("terrain_transform {transform}"), "terrain_crs \"EPSG:4326\"", "terrain_error "]
        {
            assert!(text.lines().take(20).any(|l| l.contains(fact)), "{name}: {fact}");
        }
    }
    p.done("terrain tin N57E011.hgt a.glb --max-error 1 -q");
    p.done("terrain build N57E011.hgt a.pm -q");
    // From a progressive terrain on to what is made of it.
    p.done("decode a.pm b.glb -q");
    p.write(
        "cam.json",
        r#"{"eye": [0, 9e5, 0], "target": [0, 0, 1], "up": [0, 0, -1], "fov_y_deg": 60, "width": 640, "height": 480, "near": 1, "far": 2e6}"#,
    );
    p.done("extract a.pm c.glb --camera cam.json -q");
    for name in ["a.glb", "b.glb", "c.glb"] {
        let bytes = p.read(name);
        let document: Value = serde_json::from_slice(&gltf::Glb::from_slice(&bytes).unwrap().json).unwrap();
        let extras = &document["scenes"][0]["extras"];
        assert_eq!(extras["terrain_transform"].to_string(), transform, "{name}");
        assert_eq!(extras["terrain_crs"], "EPSG:4326");
        assert_eq!(extras["terrain_origin"], serde_json::json!([11.5, 57.5]));
        assert!(extras["terrain_spacing"][1].as_f64() > Some(27_000.0));
        // What is said of a file is true of all that is made of it.
        let (name, other) = match name {
            "a.glb" => ("terrain_error", "terrain_error_at_full_detail"),
            _ => ("terrain_error_at_full_detail", "terrain_error"),
        };
        assert!(extras[name].as_f64().is_some_and(|e| e <= 1.0) && extras.get(other).is_none());
    }
}

#[test]
fn the_number_of_threads_does_not_show() {
    let p = place();
    for how in ["--max-error 4", "--max-error 4 --on-samples", "--triangles 300"] {
        for threads in [1, 2] {
            p.done(&format!("terrain tin hills.raw {threads}.ply {how} {RAW} --threads {threads} -q"));
        }
        assert!(p.read("1.ply") == p.read("2.ply"), "{how}");
    }
}

#[test]
fn a_picture_shows_it() {
    let p = place();
    p.done(&format!("terrain tin hills.raw out.ply --max-error 6 {RAW} --png out.png --wireframe"));
    assert!(p.read("out.png").starts_with(b"\x89PNG"));
}

#[test]
fn what_cannot_be_is_said() {
    let p = place();
    p.run(&format!("terrain tin hills.raw out.ply {RAW}")).failed(2, "--max-error <E>|--triangles <N>");
    p.run(&format!("terrain tin hills.raw out.pm --max-error 1 {RAW}")).failed(2, "progmesh terrain build");
    p.run(&format!("terrain tin hills.raw out.ply --max-error -1 {RAW}")).failed(2, "0 or more");
    p.run(&format!("terrain tin hills.raw out.xyz --max-error 1 {RAW}")).failed(2, "--to");
    p.run(&format!("terrain tin none.raw out.ply --max-error 1 {RAW}")).failed(3, "none.raw");
    p.run("terrain tin hills.raw out.ply --max-error 1").failed(2, "--size");
    p.run("terrain tin hills.raw out.ply --max-error 1 --size 960x2 --type f64").failed(3, "hills.raw");
    // All void, and one row.
    p.write("void.raw", [0u8; 200]);
    p.run("terrain tin void.raw out.ply --max-error 1 --size 10x10 --type i16 --nodata 0")
        .failed(3, "nothing");
    p.run("terrain tin void.raw out.ply --max-error 1 --size 100x1 --type i16").failed(3, "nothing");
    // A constant height is two triangles; a height of 1e30 among others leaves too few bits for a small error.
    let flat = p.done("terrain tin void.raw out.ply --max-error 0 --size 10x10 --type i16 --json -q").json();
    assert_eq!(flat["triangles"], 2);
    let heights = [1e30f64, 2.0, 3.5, 4.1];
    p.write("spike.raw", heights.iter().flat_map(|h| h.to_le_bytes()).collect::<Vec<_>>());
    p.run("terrain tin spike.raw out.ply --max-error 1 --size 2x2 --type f64").failed(3, "--nodata");
}

#[test]
fn a_texture_is_laid_over_the_whole_grid() {
    let p = place();
    p.write("photo.png", pixel());
    tin(&p, "out.glb --max-error 6 --spacing 30 --texture photo.png");
    let Glb { positions, uvs, document, blob, .. } = glb(&p, "out.glb");
    let uvs = uvs.unwrap();
    for (p, uv) in positions.iter().zip(&uvs) {
        // Half a pixel from the borders, v down as rows go.
        let (column, row) = (p[0] / 30.0 + 23.5, p[2] / 30.0 + 19.5);
        let [u, v] = [(column + 0.5) / 48.0, (row + 0.5) / 40.0];
        assert!((uv[0] - u).abs() < 1e-5 && (uv[1] - v).abs() < 1e-5, "{p:?}: {uv:?}");
    }
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let texture = primitive.material().pbr_metallic_roughness().base_color_texture().unwrap();
    let gltf::image::Source::View { view, mime_type } = texture.texture().source().source() else {
        panic!("the picture is not in the file");
    };
    assert_eq!(mime_type, "image/png");
    assert!(blob[view.offset()..][..view.length()] == pixel());

    std::fs::create_dir(p.path("there")).unwrap();
    tin(&p, "there/out.obj --max-error 6 --texture photo.png --normals");
    assert!(p.read("there/photo.png") == pixel());
    assert!(p.text("there/out.mtl").contains("map_Kd photo.png"));
    let text = p.text("there/out.obj");
    let count = |start: &str| text.lines().filter(|l| l.starts_with(start)).count();
    assert!(count("vt ") == count("v ") && count("vn ") > 0, "{} {}", count("vt "), count("v "));
    tin(&p, "out.ply --max-error 6 --uv");
    tin(&p, "plain.obj --max-error 6");
    assert!(!p.text("plain.obj").contains("\nvt ") && !p.text("plain.obj").contains("\nvn "));
    p.write("photo.txt", "no picture");
    p.run(&format!("terrain tin hills.raw o.glb --max-error 6 --texture photo.txt {RAW}"))
        .failed(3, "PNG or a JPEG");
    p.run(&format!("terrain tin hills.raw o.glb --max-error 6 --texture none.png {RAW}"))
        .failed(3, "none.png");
}

#[test]
fn voids_are_filled_when_asked_and_said_to_be_invented() {
    let p = place();
    let plain = tin(&p, "out.ply --max-error 6");
    assert_eq!((&plain["filled"], &plain["verified"]["good"]), (&Value::Null, &true.into()));
    let run = p.done(&format!("terrain tin hills.raw out.ply --max-error 6 --fill --verify --json {RAW}"));
    let filled = run.json();
    let n = filled["filled"].as_u64().unwrap();
    assert!(n > 80 && filled["valid"].as_u64() == Some(48 * 40), "{n}");
    assert_eq!(filled["valid"].as_u64().unwrap() - plain["valid"].as_u64().unwrap(), n);
    assert_eq!(filled["verified"]["good"], true);
    assert!(run.stderr.contains("invented"), "{}", run.stderr);
}

#[test]
fn breaklines_are_followed_and_what_cannot_be_is_said() {
    let p = place();
    // A road in columns and rows, one that leaves the grid, and a lake's shore that does not matter.
    p.write(
        "roads.json",
        r#"{"type": "FeatureCollection", "features": [
        {"type": "Feature", "geometry": {"type": "LineString", "coordinates": [[2.2, 30.8], [25, 33], [46, 37.4]]}},
        {"type": "Feature", "geometry": {"type": "MultiLineString", "coordinates": [[[5, 5], [5, -90]]]}},
        {"type": "Feature", "geometry": {"type": "Point", "coordinates": [1, 1]}}]}"#,
    );
    for method in ["best", "greedy"] {
        let run = p.done(&format!(
            "terrain tin hills.raw out.obj --max-error 12 --breaklines roads.json --method {method} --verify --json {RAW}"
        ));
        let report = run.json();
        let b = &report["breaklines"];
        let counts = ["lines", "beyond", "bent", "outside", "missing"].map(|key| b[key].as_u64().unwrap());
        assert_eq!((counts, b["steps"].as_u64() >= Some(3)), ([2, 1, 0, 0, 0], true), "{b}");
        assert_eq!(report["verified"]["good"], true);
        assert!(run.stderr.contains("1 geometries are no lines"), "{}", run.stderr);
        let text = p.text("out.obj");
        for corner in ["v 2 31 ", "v 25 33 ", "v 46 37 ", "v 5 0 "] {
            assert!(text.lines().any(|l| l.starts_with(corner)), "{corner}");
        }
    }
    // Over the lake and across each other.
    p.write(
        "cross.json",
        r#"{"type": "MultiLineString", "coordinates": [[[20, 12], [47, 13]], [[3, 2], [30, 39]], [[3, 39], [31, 2]]]}"#,
    );
    let run = p.done(&format!(
        "terrain tin hills.raw out.ply --max-error 12 --breaklines cross.json --verify --json {RAW}"
    ));
    let b = run.json()["breaklines"].clone();
    assert!(b["bent"].as_u64() >= Some(1) && b["outside"].as_u64() >= Some(1), "{b}");
    assert!(run.stderr.contains("led over the nearest sample"), "{}", run.stderr);
    let fails = |what: &str, code: i32, text: &str| {
        p.run(&format!("terrain tin hills.raw o.ply --max-error 9 {what} {RAW}")).failed(code, text);
    };
    p.write("bad.json", "{}");
    fails("--breaklines bad.json", 3, "is it GeoJSON");
    fails("--breaklines none.json", 3, "none.json");
    fails("--breaklines roads.json --method regular", 2, "--method best or greedy");
    fails("--breaklines roads.json --breakline-space world", 2, "--breakline-space grid");
    fails("--breakline-space grid", 2, "--breaklines");
}

/// A straight side from far to far would cut through the hills between.
#[test]
fn long_breaklines_stay_on_the_ground() {
    let p = Place::new();
    p.write("hills.raw", hills(false));
    // No sample lies on it but its ends.
    p.write("road.json", r#"{"type": "LineString", "coordinates": [[1, 3], [46, 35]]}"#);
    let plain = tin(&p, "out.ply --max-error 4");
    let report = tin(&p, "out.ply --max-error 4 --breaklines road.json");
    let b = &report["breaklines"];
    assert!(b["steps"].as_u64() > Some(3) && b["missing"] == 0 && report["verified"]["good"] == true, "{b}");
    let between = |r: &Value| r["error"]["surface"].as_f64().unwrap();
    assert!(between(&report) <= between(&plain).max(12.0), "{} {}", between(&report), between(&plain));
    // And where no error is asked for.
    let report = tin(&p, "out.ply --triangles 900 --breaklines road.json");
    assert!(report["breaklines"]["steps"].as_u64() > Some(3) && report["verified"]["good"] == true);
}

#[test]
fn a_simpler_outline_covers_no_void_and_says_what_it_drops() {
    let p = place();
    let exact = tin(&p, "exact.obj --max-error 6");
    assert_eq!(exact["outline"], Value::Null);
    let mut kept = vec![];
    for (tolerance, how) in [("0", ""), ("1", ""), ("3", "--on-samples"), ("3", "--method greedy")] {
        let run = p.done(&format!(
            "terrain tin hills.raw out.obj --max-error 6 --outline-tolerance {tolerance} {how} {RAW} --verify --json"
        ));
        let report = run.json();
        let (outline, verified) = (&report["outline"], &report["verified"]);
        assert_eq!(verified["good"], true, "{report}");
        assert_eq!((&outline["dropped"], &verified["overlapping"]), (&verified["dropped"], &0.into()));
        let dropped = outline["dropped"].as_u64().unwrap();
        assert_eq!(run.stderr.contains("are not covered"), dropped > 0, "{}", run.stderr);
        assert!(tolerance != "0" || dropped == 0 && outline["kept"] == outline["corners"]);
        kept.push(outline["kept"].as_u64().unwrap());
        assert!(
            report["triangles"].as_u64() <= exact["triangles"].as_u64().map(|n| n + 20) || !how.is_empty()
        );
    }
    // No corner of the lake's convex hull can go.
    assert!(kept[0] > kept[1] && kept[1] >= kept[2] && kept[2] == kept[3], "{kept:?}");
    for threads in [1, 2] {
        p.done(&format!(
            "terrain tin hills.raw {threads}.ply --max-error 4 --outline-tolerance 2 {RAW} --threads {threads} -q"
        ));
    }
    assert!(p.read("1.ply") == p.read("2.ply"));
    let fails = |what: &str, text: &str| {
        p.run(&format!("terrain tin hills.raw o.ply --max-error 9 --outline-tolerance {what} {RAW}"))
            .failed(2, text);
    };
    fails("1 --error surface", "--error samples");
    fails("1 --method regular", "--method best or greedy");
    fails("1 --tiles 2", "--tiles");
    fails("-1", "0 or more");
    fails("nan", "0 or more");
}

/// A TIFF of one strip of 16-bit samples that says it has this many along a side.
fn tiff(side: u32, samples: &[i16]) -> Vec<u8> {
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    let entries: [(u16, u32); 10] = [
        (256, side),
        (257, side),
        (258, 16),
        (259, 1),
        (262, 1),
        (273, 8 + 2 + 120 + 4),
        (277, 1),
        (278, side),
        (279, 2 * samples.len() as u32),
        (339, 2),
    ];
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, value) in entries {
        bytes.extend(tag.to_le_bytes());
        // One number of 32 bits.
        bytes.extend([4, 0, 1, 0, 0, 0]);
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend([0; 4]);
    bytes.extend(samples.iter().flat_map(|h| h.to_le_bytes()));
    bytes
}

#[test]
fn bad_grids_end_in_a_clear_error_or_the_right_network() {
    let p = Place::new();
    // Names, and how to read them.
    let parts = |grid: &str| {
        let (names, how) = grid.split_at(grid.find(" --").unwrap_or(grid.len()));
        (names.to_string(), how.to_string())
    };
    let fails = |grid: &str, code: i32, text: &str| {
        let (names, how) = parts(grid);
        p.run(&format!("terrain tin {names} out.ply --max-error 1 {how}")).failed(code, text);
        assert!(!p.exists("out.ply"), "{grid}");
    };
    let good = |grid: &str, error: f64| {
        let (names, how) = parts(grid);
        let run =
            p.done(&format!("terrain tin {names} good.ply --max-error {error} --verify --json -q {how}"));
        let report = run.json();
        assert_eq!(report["verified"]["good"], true, "{grid}: {report}");
        report["triangles"].as_u64().unwrap()
    };
    // Truncated, and 65,535 x 65,535 and 65,536 x 65,536 announced in a small file, in every format that announces.
    let whole = tiff(5, &[7; 25]);
    p.write("whole.tif", &whole);
    assert_eq!(good("whole.tif", 0.0), 2);
    for cut in [1, 30, whole.len() - 20, whole.len() - 5] {
        p.write("cut.tif", &whole[..whole.len() - cut]);
        fails("cut.tif", 3, "cut.tif");
    }
    for side in [65_535, 65_536] {
        p.write("huge.tif", tiff(side, &[7; 25]));
        fails("huge.tif", 3, "huge.tif");
        p.write("huge.asc", format!("ncols {side}\nnrows {side}\ncellsize 1\n1 2 3\n"));
        fails("huge.asc", 3, "after 3 of");
        p.write("huge.raw", [0; 10]);
        fails(&format!("huge.raw --size {side}x{side} --type f64"), 3, "the file has 10");
        let mut png = vec![];
        let mut encoder = png::Encoder::new(&mut png, side, side);
        encoder.set_color(png::ColorType::Grayscale);
        // Its head alone.
        drop(encoder.write_header().unwrap());
        p.write("huge.png", &png[..png.len().min(60)]);
        fails("huge.png", 3, "huge.png");
    }
    p.write("huge.hgt", [0; 7]);
    fails("huge.hgt", 3, "huge.hgt");
    // Raw samples of another size; nothing valid; too few rows or columns for a triangle.
    p.write("a.raw", [0u8; 200]);
    fails("a.raw --size 10x11 --type i16", 3, "are 220 bytes, and the file has 200");
    fails("a.raw --size 10x9 --type i16", 3, "are 180 bytes, and the file has 200");
    fails("a.raw --size 10x10 --type i16 --nodata 0", 3, "nothing to triangulate");
    for size in ["100x1", "1x100"] {
        fails(&format!("a.raw --size {size} --type i16"), 3, "nothing to triangulate");
    }
    // One height, by every method; the least that makes a triangle.
    for method in ["best", "greedy", "decimation", "regular"] {
        assert_eq!(good(&format!("a.raw --size 10x10 --type i16 --method {method}"), 0.0), 2, "{method}");
    }
    p.write("least.raw", [1u8, 2, 3, 4]);
    assert_eq!(good("least.raw --size 2x2 --type u8", 0.0), 2);
    assert_eq!(good("least.raw --size 2x2 --type u8 --nodata 2", 0.0), 1);
    // Heights of 1e30: right where f32 has what it takes, and too coarse for an error of 1 beside others.
    let f32s = |heights: &[f32]| heights.iter().flat_map(|h| h.to_le_bytes()).collect::<Vec<u8>>();
    p.write("high.raw", f32s(&[1e30; 9]));
    for error in [0.0, 1.0, 1e25] {
        assert_eq!(good("high.raw --size 3x3 --type f32", error), 2);
    }
    p.write("spike.raw", f32s(&[1.0, 2.0, 3.0, 4.0, 1e30, 5.0, 6.0, 7.0, -1e30]));
    fails("spike.raw --size 3x3 --type f32", 3, "--nodata");
    // -1e30 is marked, and the triangle beside it is gone.
    assert!(good("spike.raw --size 3x3 --type f32 --nodata -1e30", 1e26) > 2);
    p.write("infinite.raw", f32s(&[1.0, f32::INFINITY, 3.0, 4.0]));
    fails("infinite.raw --size 2x2 --type f32", 3, "infinite");
    // Grids beside each other with steps of different lengths.
    let square = |n: i16| (0..n * n).flat_map(i16::to_be_bytes).collect::<Vec<u8>>();
    p.write("N57E011.hgt", square(3));
    p.write("N57E012.hgt", square(5));
    fails("N57E011.hgt N57E012.hgt", 3, "N57E012.hgt has a spacing of 0.25 x 0.25");
    p.write("N57E012.hgt", square(3));
    good("N57E011.hgt N57E012.hgt", 0.5);
}
