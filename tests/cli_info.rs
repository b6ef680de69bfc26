//! `progmesh info`, end to end.

mod common;

use common::Place;
use serde_json::json;

#[test]
fn a_closed_surface_is_described() {
    let p = Place::new();
    p.generate("torus", "in.obj", 600);
    let i = p.info("in.obj");
    let m = &i["meshes"][0];
    assert_eq!((&m["genus"], &m["euler"], &m["components"]), (&json!(1), &json!(0), &json!(1)));
    assert_eq!((&m["manifold"], &m["closed"], &m["orientable"]), (&json!(true), &json!(true), &json!(true)));
    assert_eq!(m["vertices"], m["vertex_kinds"]["interior"]);
    assert_eq!(m["edges"], m["edge_kinds"]["regular"]);
    assert_eq!(m["problems"], json!([]));
    assert_eq!(m["precision"], "f32");
    let text = p.done("info in.obj").stdout;
    for t in ["closed surface", "genus 1", "normal (3 x f32)"] {
        assert!(text.contains(t), "{t}: {text}");
    }
}

#[test]
fn kinds_of_vertices_and_edges_are_counted_by_the_vocabulary() {
    // Three triangles on one edge, a fourth at a point, a wire, a vertex by itself.
    let p = Place::new();
    p.write(
        "in.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nf 1 2 3\nf 2 1 4\nf 1 2 5\n\
         v 2 1 0\nv 2 2 0\nf 3 6 7\nv 5 5 5\nl 4 8\nv 9 9 9\n",
    );
    let m = &p.info("in.obj")["meshes"][0];
    assert_eq!(
        m["edge_kinds"],
        json!({"isolated": 0, "dangling": 1, "border": 9, "regular": 0, "complex": 1})
    );
    // Vertex 3 joins two triangles, vertex 4 a triangle and the wire; 1 and 2 are on the complex edge.
    assert_eq!(
        m["vertex_kinds"],
        json!({"isolated": 1, "cut": 2, "dangling": 1, "complex": 2, "border": 3, "interior": 0})
    );
    assert_eq!((&m["genus"], &m["manifold"]), (&json!(null), &json!(false)));
    let problems = m["problems"].to_string();
    assert!(problems.contains("non-manifold") && problems.contains("between vertices 0 and 1"), "{problems}");
}

#[test]
fn problems_are_found_and_their_first_element_named() {
    let p = Place::new();
    for (mesh, text) in [
        ("f 1 2 3\nf 3 1 2\n", "1 face with the vertices of an earlier face (the first: face 1)"),
        (
            "f 1 2 3\nf 1 2 4\n",
            "1 edge between faces of opposite orientation; turning faces over would mend it",
        ),
        ("f 1 2 3\nf 1 2 5\n", "1 face of no area (the first: face 1)"),
        ("f 1 2 3\nf 1 1 3\n", "1 face with fewer than three distinct vertices (the first: face 1)"),
        ("f 1 2 3\n", "2 vertices of no face and no edge (the first: vertex 3)"),
    ] {
        p.write("in.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 -1 0\nv 2 0 0\n{mesh}"));
        let problems = p.info("in.obj")["meshes"][0]["problems"].to_string();
        assert!(problems.contains(text), "{mesh}: {problems}");
    }
}

#[test]
fn check_says_ok_or_names_the_first_broken_invariant() {
    let p = Place::new();
    p.generate("cad", "in.obj", 400);
    let run = p.done("info in.obj --check");
    assert!(run.stdout.ends_with("check: ok\n"));
    p.write("bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\nf 1 1 1\n");
    let run = p.run("info bad.obj --check");
    run.failed(1, "bad.obj: 2 faces with fewer than three distinct vertices (the first: face 1)");
    assert!(run.stdout.contains("check: 2 faces"));
    // Without --check it is a report like any other.
    p.done("info bad.obj");
}

#[test]
fn welding_changes_what_is_seen() {
    let p = Place::new();
    p.generate("soup", "in.obj", 400);
    let [loose, welded] = ["", "--weld"].map(|w| p.done(&format!("info in.obj --json {w}")).json());
    let of = |i: &serde_json::Value, field: &str| i["meshes"][0][field].as_u64().unwrap();
    assert_eq!(of(&loose, "components"), of(&loose, "faces"));
    assert_eq!(of(&welded, "components"), 1);
    assert!(of(&welded, "vertices") * 5 < of(&loose, "vertices"));
}

#[test]
fn double_precision_is_told_from_single() {
    let p = Place::new();
    p.write("a.obj", "v 0.5 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    p.write("b.obj", "v 1000000.12345 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_eq!(p.info("a.obj")["meshes"][0]["precision"], "f32");
    assert_eq!(p.info("b.obj")["meshes"][0]["precision"], "f64");
}

#[test]
fn what_building_leaves_out_is_counted() {
    let p = Place::new();
    p.write("in.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\nf 1 2 2\n");
    let i = p.info("in.obj");
    let m = &i["meshes"][0];
    assert_eq!((&m["file_faces"], &m["faces"], &m["file_triangles"]), (&json!(3), &json!(2), &json!(3)));
    assert_eq!(i["triangles"], json!({"file": 3, "built": 2, "instanced": 3}));
    let text = p.done("info in.obj").stdout;
    assert!(text.contains("in the file  3 faces; 1 left out, see below"), "{text}");
    assert!(text.contains("1 face with fewer than three distinct vertices"), "{text}");
    // simplify counts what the file has, and says what was left out.
    let run = p.done("simplify in.obj out.obj --ratio 1 --json");
    let s = run.json();
    assert_eq!((&s["faces_in"], &s["triangles"]["input"]), (&json!(3), &json!(3)));
    assert!(run.stderr.contains("1 face with fewer than three distinct corners left out"), "{}", run.stderr);
}

/// A glTF file with `nodes` instead of its only one.
fn with_nodes(p: &Place, nodes: &str, roots: &str) {
    p.generate("sphere", "one.gltf", 320);
    let mut document: serde_json::Value = serde_json::from_str(&p.text("one.gltf")).unwrap();
    document["nodes"] = serde_json::from_str(nodes).unwrap();
    document["scenes"][0]["nodes"] = serde_json::from_str(roots).unwrap();
    p.write("many.gltf", document.to_string());
}

#[test]
fn instances_are_told_from_what_the_file_holds() {
    let p = Place::new();
    with_nodes(
        &p,
        r#"[{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}, {"mesh": 0, "scale": [2, 2, 2]}]"#,
        "[0, 1, 2]",
    );
    let i = p.info("many.gltf");
    assert_eq!(i["triangles"], json!({"file": 320, "built": 320, "instanced": 960}));
    assert_eq!(i["bounds"], json!([[-2.0, -2.0, -2.0], [6.0, 2.0, 2.0]]));
    let text = p.done("info many.gltf").stdout;
    assert!(
        text.contains(
            "1 mesh, 320 triangles in the file; 3 nodes, 3 of them showing a mesh: 960 triangles instanced"
        ),
        "{text}"
    );
    assert!(text.contains("bounds in the world, as the nodes place the meshes: -2 -2 -2 to 6 2 2"), "{text}");
    let run = p.done("simplify many.gltf out.glb --ratio 0.5 --json");
    assert!(
        run.stderr.contains("in 1 mesh, each counted once (all instances: 960 -> 480 triangles)"),
        "{}",
        run.stderr
    );
    assert_eq!(
        run.json()["triangles"],
        json!({"input": 320, "output": 160, "instanced_input": 960, "instanced_output": 480})
    );
    // Where a mesh is shown once there is nothing to tell apart.
    let run = p.done("simplify one.gltf out.glb --ratio 0.5");
    assert!(!run.stderr.contains("instances"), "{}", run.stderr);
    let text = p.done("info one.gltf").stdout;
    assert!(!text.contains("instanced") && !text.contains("in the world"), "{text}");
}

#[test]
fn bounds_before_and_after_a_node_are_both_explained() {
    let p = Place::new();
    with_nodes(&p, r#"[{"mesh": 0, "scale": [3, 3, 3]}]"#, "[0]");
    let text = p.done("info many.gltf").stdout;
    assert!(text.contains("in the world, as the nodes place the meshes: -3 -3 -3 to 3 3 3"), "{text}");
    assert!(text.contains("bounds       -1 -1 -1 to 1 1 1"), "{text}");
}

#[test]
fn a_material_without_a_name_has_a_number() {
    let p = Place::new();
    p.generate("cad", "in.gltf", 300);
    let mut document: serde_json::Value = serde_json::from_str(&p.text("in.gltf")).unwrap();
    for m in document["materials"].as_array_mut().unwrap() {
        m.as_object_mut().unwrap().remove("name");
    }
    p.write("in.gltf", document.to_string());
    let text = p.done("info in.gltf").stdout;
    assert!(text.contains("\nmaterials: material 0, material 1"), "{text}");
}

#[test]
fn a_directory_is_called_one() {
    let p = Place::new();
    p.write("place/x", "");
    for arguments in
        ["info place", "info place --from ply", "convert place out.obj", "simplify place out.obj --ratio 1"]
    {
        p.run(arguments).failed(3, "error: place: is a directory");
    }
    p.run("info none").failed(3, "error: none: ");
    p.write("file", "");
    p.run("info file").failed(2, "say its format with --from");
    p.generate("sphere", "in.obj", 80);
    p.run("convert in.obj place").failed(4, "error: place: is a directory");
}

#[test]
fn a_file_of_another_format_than_its_name_says_is_recognised() {
    let p = Place::new();
    for from in ["ply", "off", "glb", "gltf"] {
        p.generate("sphere", &format!("m.{from}"), 80);
        for to in ["obj", "stl", "ply", "off"].iter().filter(|to| **to != from) {
            std::fs::copy(p.path(&format!("m.{from}")), p.path(&format!("x.{to}"))).unwrap();
            let run = p.run(&format!("info x.{to}"));
            run.failed(3, &format!("it begins like {}: try --from {from}", from.to_uppercase()));
            p.done(&format!("info x.{to} --from {from}"));
        }
    }
    p.write("bad.ply", "ply\nformat ascii 1.0\n");
    assert!(!p.run("info bad.ply").stderr.contains("begins like"));
    assert!(p.done("generate empty e.off").code == 0);
    assert!(p.done("info e.off").stdout.contains("form         no faces"));
}

#[test]
fn names_in_a_file_do_not_command_the_terminal() {
    let p = Place::new();
    p.write("in.obj", "o a\u{1b}[2Jb\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let run = p.done("info in.obj");
    assert!(!run.stdout.contains('\u{1b}') && run.stdout.contains("[2Jb"), "{:?}", run.stdout);
    p.write("bad.obj", "v 0 0 0\n\u{1b}[2J\n");
    let run = p.run("info bad.obj");
    assert!(run.code == 3 && !run.stderr.contains('\u{1b}'), "{:?}", run.stderr);
}

#[test]
fn bad_input_is_exit_code_3() {
    let p = Place::new();
    p.write("bad.obj", "v 0 0 0\nv 1 0 0\nf 1 2 9\n");
    for flags in ["", "--check", "--json"] {
        let run = p.run(&format!("info bad.obj {flags}"));
        run.failed(3, "error: bad.obj: line 3");
        assert_eq!(run.stdout, "");
    }
    p.run("info none.obj").failed(3, "none.obj: ");
}
