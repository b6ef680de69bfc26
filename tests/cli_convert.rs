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

const MTL: &str = "newmtl brick
Ka 0.1 0.2 0.3
Kd 0.5 0.25 0.125
Ks 0.9 0.8 0.7
Ns 250
d 0.5
illum 2
map_Kd my brick.png
map_Ks shine/gloss.png
bump -bm 0.5 bumps.png

newmtl plain
Kd 1 0 0
Ka 1 1 1

";

/// A square of two materials with textures.
fn textured(p: &Place) {
    p.generate("quad-sphere", "sphere.obj", 24);
    let png = p.read("charts.png");
    for file in ["in/my brick.png", "in/shine/gloss.png", "in/bumps.png"] {
        p.write(file, &png);
    }
    p.write("in/in.mtl", MTL);
    p.write(
        "in/in.obj",
        "mtllib in.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
         usemtl brick\nf 1/1 2/2 3/3\nusemtl plain\nf 1/1 3/3 4/4\n",
    );
}

#[test]
fn materials_survive_the_way_through_gltf_as_they_were_written() {
    let p = Place::new();
    textured(&p);
    for (format, folder) in [("glb", "glb"), ("gltf", "gltf")] {
        for folder in [folder.to_string(), format!("{folder}/back")] {
            std::fs::create_dir(p.path(&folder)).unwrap();
        }
        let middle = format!("{folder}/middle.{format}");
        let there = p.done(&format!("convert in/in.obj {middle}"));
        assert!(!there.stderr.contains("warning"), "{}", there.stderr);
        let back = p.done(&format!("convert {middle} {folder}/back/in.obj"));
        assert!(!back.stderr.contains("warning"), "{}", back.stderr);
        assert_eq!(p.text(&format!("{folder}/back/in.mtl")), MTL, "{format}");
        for file in ["my brick.png", "shine/gloss.png", "bumps.png"] {
            assert_eq!(p.read(&format!("{folder}/back/{file}")), p.read(&format!("in/{file}")), "{format}");
        }
        // Simplified too, and through glTF twice.
        p.done(&format!("simplify {middle} {folder}/again.{format} --ratio 1"));
        p.done(&format!("convert {folder}/again.{format} {folder}/again.obj"));
        assert_eq!(p.text(&format!("{folder}/again.mtl")), MTL, "{format}");
    }
}

#[test]
fn a_material_changed_in_gltf_is_written_as_it_is_now() {
    let p = Place::new();
    textured(&p);
    p.done("convert in/in.obj middle.gltf");
    let mut document: serde_json::Value = serde_json::from_str(&p.text("middle.gltf")).unwrap();
    document["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.0, 1.0, 0.0, 1.0]);
    document["materials"][0]["pbrMetallicRoughness"].as_object_mut().unwrap().remove("baseColorTexture");
    p.write("middle.gltf", document.to_string());
    p.done("convert middle.gltf back.obj");
    let mtl = p.text("back.mtl");
    assert!(
        mtl.contains("newmtl plain\nKd 0 1 0\n") && !mtl.contains("Ka") && !mtl.contains("map_Kd"),
        "{mtl}"
    );
}

#[test]
fn nodes_and_groups_that_nobody_made_are_not_missed() {
    let p = Place::new();
    p.generate("cad", "in.glb", 300);
    for out in ["a.obj", "a.ply", "a.off", "a.stl"] {
        let run = p.done(&format!("convert in.glb {out}"));
        assert!(!run.stderr.contains("node") && !run.stderr.contains("group"), "{out}: {}", run.stderr);
    }
    // A single node that places its mesh: the place is kept, so nothing is lost.
    p.generate("sphere", "one.gltf", 80);
    let placed = p.text("one.gltf").replacen("\"mesh\": 0", "\"mesh\": 0, \"translation\": [5, 0, 0]", 1);
    p.write("one.gltf", placed);
    let run = p.done("convert one.gltf one.obj");
    assert_eq!(run.stderr, "");
    assert_eq!(p.info("one.obj")["bounds"], json!([[4.0, -1.0, -1.0], [6.0, 1.0, 1.0]]));
    // Groups that somebody named are.
    p.write("g.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ng a\nf 1 2 3\ng b\nf 1 3 4\n");
    for (out, text) in [("g.ply", "groups"), ("g.off", "groups"), ("g.stl", "groups"), ("g.glb", "groups")] {
        let run = p.done(&format!("convert g.obj {out}"));
        assert!(run.stderr.contains(text), "{out}: {}", run.stderr);
    }
}

#[test]
fn what_gltf_holds_beside_meshes_is_said_to_be_lost() {
    let p = Place::new();
    p.generate("cad", "in.gltf", 300);
    let mut d: serde_json::Value = serde_json::from_str(&p.text("in.gltf")).unwrap();
    d["cameras"] =
        json!([{"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 1}}]);
    d["animations"] = json!([]);
    d["materials"][0]["doubleSided"] = json!(true);
    d["materials"][0]["alphaMode"] = json!("OPAQUE");
    d["materials"][1]["extensions"] = json!({"KHR_materials_unlit": {}});
    d["extensionsUsed"] = json!(["KHR_materials_unlit"]);
    p.write("in.gltf", d.to_string());
    for out in ["a.obj", "a.ply", "a.off", "a.stl"] {
        let run = p.done(&format!("convert in.gltf {out}"));
        assert!(run.stderr.contains("cannot hold cameras: left out\n"), "{out}: {}", run.stderr);
    }
    let run = p.done("convert in.gltf a.obj");
    let text = "OBJ cannot hold these properties of materials: KHR_materials_unlit, doubleSided\n";
    assert!(run.stderr.contains(text), "{}", run.stderr);
    assert_eq!(p.done("convert in.gltf a.glb").stderr, "");
}

#[test]
fn text_where_there_is_no_choice_is_said() {
    let p = Place::new();
    p.generate("sphere", "in.ply", 80);
    for (out, text) in [
        ("a.obj", "always text"),
        ("a.gltf", "always text"),
        ("a.off", "always text"),
        ("a.glb", "always binary"),
    ] {
        for run in [
            p.done(&format!("convert in.ply {out} --text")),
            p.done(&format!("simplify in.ply {out} --ratio 0.5 --text")),
            p.done(&format!("generate sphere {out} --faces 20 --text")),
        ] {
            assert!(
                run.stderr.contains(&format!("warning: {out}: --text changes nothing: ")),
                "{}",
                run.stderr
            );
            assert!(run.stderr.contains(text), "{}", run.stderr);
        }
    }
    for out in ["a.ply", "a.stl"] {
        assert!(!p.done(&format!("convert in.ply {out} --text")).stderr.contains("--text"));
    }
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
