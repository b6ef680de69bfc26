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
fn bad_input_is_exit_code_3() {
    let p = Place::new();
    p.write("bad.obj", "v 0 0 0\nv 1 0 0\nf 1 2 9\n");
    for flags in ["", "--check", "--json"] {
        let run = p.run(&format!("info bad.obj {flags}"));
        run.failed(3, "progmesh: bad.obj: line 3");
        assert_eq!(run.stdout, "");
    }
    p.run("info none.obj").failed(3, "none.obj: ");
}
