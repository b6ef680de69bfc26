//! `progmesh terrain tin`, end to end.

mod common;

use common::Place;
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
    let document = gltf::Gltf::open(p.path("out.glb")).unwrap();
    let blob = document.blob.clone().unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|_| Some(&blob));
    let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    let normals: Vec<[f32; 3]> = reader.read_normals().unwrap().collect();
    assert_eq!(positions.len(), normals.len());
    assert!(normals.iter().all(|n| n[1] > 0.0 && (n.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-5));
    let most = positions.iter().fold(f32::MIN, |m, p| m.max(p[0]));
    assert_eq!(most, 23.5 * 30.0);
    // Front faces look up.
    let corners: Vec<usize> = reader.read_indices().unwrap().into_u32().map(|i| i as usize).collect();
    for t in corners.chunks_exact(3) {
        let [a, b, c] = [positions[t[0]], positions[t[1]], positions[t[2]]];
        let up = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2]);
        assert!(up > 0.0);
    }
    let extras = document.scenes().next().unwrap().extras().clone().unwrap();
    assert!(extras.get().contains("terrain_exaggeration"), "{extras}");
    let unknown = p.done(&format!("terrain tin hills.raw out.glb --max-error 6 {RAW}"));
    assert!(unknown.stderr.contains("--spacing"), "{}", unknown.stderr);
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
    p.run(&format!("terrain tin hills.raw out.ply {RAW}")).failed(2, "--max-error");
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

/// A white PNG of a pixel.
fn pixel() -> Vec<u8> {
    let mut bytes = vec![];
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[255]).unwrap();
    bytes
}

#[test]
fn a_texture_is_laid_over_the_whole_grid() {
    let p = place();
    p.write("photo.png", pixel());
    tin(&p, "out.glb --max-error 6 --spacing 30 --texture photo.png");
    let document = gltf::Gltf::open(p.path("out.glb")).unwrap();
    let blob = document.blob.clone().unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|_| Some(&blob));
    let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    let uvs: Vec<[f32; 2]> = reader.read_tex_coords(0).unwrap().into_f32().collect();
    for (p, uv) in positions.iter().zip(&uvs) {
        // Half a pixel from the borders, v down as rows go.
        let (column, row) = (p[0] / 30.0 + 23.5, p[2] / 30.0 + 19.5);
        let [u, v] = [(column + 0.5) / 48.0, (row + 0.5) / 40.0];
        assert!((uv[0] - u).abs() < 1e-5 && (uv[1] - v).abs() < 1e-5, "{p:?}: {uv:?}");
    }
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
        assert_eq!(
            report["breaklines"],
            serde_json::json!({"lines": 2, "steps": 3, "beyond": 1, "bent": 0, "outside": 0, "missing": 0})
        );
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
    fails("--breaklines roads.json --tiles 2", 2, "one network");
    fails("--breakline-space grid", 2, "--breaklines");
}
