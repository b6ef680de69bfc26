//! `progmesh convert`, end to end: every pair of formats, and what is done on the way.

mod common;

use common::Place;
use serde_json::json;

const FORMATS: [&str; 6] = ["obj", "ply", "stl", "off", "gltf", "glb"];

#[test]
fn every_pair_of_formats_keeps_the_surface() {
    let p = Place::new();
    p.generate("scan", "first.obj", 400);
    let first = p.info("first.obj");
    for from in FORMATS {
        p.done(&format!("convert first.obj a.{from} -q"));
        for to in FORMATS {
            p.done(&format!("convert a.{from} b.{to} -q"));
            let i = p.done(&format!("info b.{to} --check --json -q")).json();
            let (m, want) = (&i["meshes"][0], &first["meshes"][0]);
            for field in ["vertices", "triangles", "border_loops", "genus", "components", "orientable"] {
                assert_eq!(m[field], want[field], "{from} -> {to}: {field}");
            }
            let apart = m["diagonal"].as_f64().unwrap() - want["diagonal"].as_f64().unwrap();
            assert!(apart.abs() < 1e-6, "{from} -> {to}");
        }
    }
}

#[test]
fn polygons_stay_polygons_unless_asked_or_impossible() {
    let p = Place::new();
    p.generate("quad-sphere", "in.obj", 96);
    for (out, flags, quads) in [
        ("a.ply", "", 96),
        ("a.off", "", 96),
        ("a.obj", "", 96),
        ("b.obj", "--triangulate", 0),
        ("a.stl", "", 0),
        ("a.glb", "", 0),
    ] {
        p.done(&format!("convert in.obj {out} {flags} -q"));
        let sizes = &p.info(out)["meshes"][0]["face_sizes"];
        assert_eq!(sizes["quads"], quads, "{out} {flags}");
        assert_eq!(sizes["triangles"], 2 * (96 - quads), "{out} {flags}");
    }
}

#[test]
fn materials_textures_and_uvs_go_to_gltf_and_back() {
    let p = Place::new();
    p.generate("quad-sphere", "in.obj", 96);
    p.done("convert in.obj a.glb");
    p.done("convert a.glb b.obj");
    let texture = p.read("charts.png");
    let i = p.info("a.glb");
    assert_eq!(
        (&i["images"][0]["mime"], &i["images"][0]["bytes"]),
        (&json!("image/png"), &json!(texture.len()))
    );
    assert_eq!(i["meshes"][0]["materials"], json!([{"name": "charts", "faces": 192}]));
    // The same texture coordinates, the same way up.
    let lines = |f: &str| {
        let mut all: Vec<[i64; 2]> = p
            .text(f)
            .lines()
            .filter_map(|l| l.strip_prefix("vt "))
            .map(|l| {
                let x: Vec<f64> = l.split(' ').map(|x| x.parse().unwrap()).collect();
                [x[0], x[1]].map(|x| (x * 98_765.0).round() as i64)
            })
            .collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    assert_eq!(lines("in.obj"), lines("b.obj"));
}

#[test]
fn what_a_format_cannot_hold_is_said_once() {
    let p = Place::new();
    p.generate("quad-sphere", "in.obj", 96);
    let run = p.done("convert in.obj out.stl");
    let about = |text: &str| {
        run.stderr.lines().filter(|l| l.starts_with("warning: out.stl: ") && l.contains(text)).count()
    };
    assert!(about("") >= 1, "{}", run.stderr);
    let mut lines: Vec<&str> = run.stderr.lines().collect();
    let all = lines.len();
    lines.sort_unstable();
    lines.dedup();
    assert_eq!(lines.len(), all, "said twice: {}", run.stderr);
    assert_eq!(p.done("convert in.obj out.stl -q").stderr, "");
}

#[test]
fn narrowing_to_single_precision_is_said() {
    let p = Place::new();
    p.generate("offset-1e6-f64", "in.ply", 400);
    assert_eq!(p.info("in.ply")["meshes"][0]["precision"], "f64");
    p.done("convert in.ply out.obj");
    assert_eq!(p.info("out.obj")["meshes"][0]["precision"], "f64");
    let run = p.done("convert in.ply out.stl");
    assert!(run.stderr.contains("f32") || run.stderr.contains("single precision"), "{}", run.stderr);
}

#[test]
fn text_and_binary_hold_the_same() {
    let p = Place::new();
    p.generate("scan", "in.ply", 400);
    for format in ["ply", "stl"] {
        p.done(&format!("convert in.ply text.{format} --text -q"));
        p.done(&format!("convert in.ply binary.{format} -q"));
        p.done(&format!("convert text.{format} again.{format} -q"));
        assert!(String::from_utf8(p.read(&format!("text.{format}"))).is_ok());
        assert!(p.read(&format!("binary.{format}")) == p.read(&format!("again.{format}")), "{format}");
    }
}

#[test]
fn welding_and_normals_are_done_on_the_way() {
    let p = Place::new();
    p.generate("soup", "in.obj", 400);
    let run = p.done("convert in.obj out.ply --weld --normals recompute --crease 30");
    assert!(run.stderr.contains("vertices welded"), "{}", run.stderr);
    let m = p.info("out.ply")["meshes"][0].clone();
    assert_eq!(m["components"], 1);
    assert!(m["attributes"].to_string().contains("normal"), "{m}");
}

#[test]
fn nothing_else_is_changed_on_the_way() {
    let p = Place::new();
    p.generate("degenerate-faces", "in.ply", 400);
    p.done("convert in.ply out.ply -q");
    assert!(p.read("in.ply") == p.read("out.ply"));
}

#[test]
fn a_format_may_be_named_and_streamed() {
    let p = Place::new();
    p.generate("sphere", "in.ply", 80);
    std::fs::rename(p.path("in.ply"), p.path("mesh")).unwrap();
    p.done("convert mesh out --from ply --to obj");
    assert!(p.text("out").contains("\nf "));
    let run = p.run_with("convert - - --from ply --to off", p.read("mesh"));
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stdout.starts_with("OFF"));
    let run = p.run("convert mesh - --from ply --to gltf");
    assert!(run.code == 0 || run.stderr.contains("write to a path, or as glb"), "{}", run.stderr);
    p.run("convert mesh out.obj --from stl").failed(3, "mesh: ");
}

#[test]
fn side_files_stand_beside_the_output_and_names_follow_it() {
    let p = Place::new();
    std::fs::create_dir(p.path("to")).unwrap();
    p.generate("quad-sphere", "in.obj", 96);
    p.done("convert in.obj to/out.obj");
    assert!(p.exists("to/out.mtl") && p.exists("to/charts.png"));
    assert!(p.text("to/out.obj").contains("mtllib out.mtl"));
    assert_eq!(p.info("to/out.obj")["images"][0]["bytes"].as_u64(), Some(p.read("charts.png").len() as u64));
}
