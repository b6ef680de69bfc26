//! `progmesh generate`, end to end.

mod common;

use common::Place;

#[test]
fn the_list_has_every_name_and_every_name_works() {
    let p = Place::new();
    let list = p.done("generate --list").stdout;
    for e in progmesh::meshes::names() {
        assert!(list.contains(&format!("  {} ", e.name)), "{}", e.name);
        p.done(&format!("generate {} {}.ply --faces 200", e.name, e.name));
    }
    assert!(list.contains("Hostile:"));
}

#[test]
fn well_formed_meshes_pass_the_check() {
    let p = Place::new();
    for e in progmesh::meshes::names().iter().filter(|e| !e.hostile) {
        for format in ["obj", "glb", "ply"] {
            p.done(&format!("generate {} m.{format} --faces 200 -q", e.name));
            p.done(&format!("info m.{format} --check -q"));
        }
    }
}

#[test]
fn the_size_is_about_what_was_asked_for() {
    let p = Place::new();
    for flag in ["--faces", "--size"] {
        p.done(&format!("generate torus m.obj {flag} 2000"));
        let faces = p.info("m.obj")["meshes"][0]["faces"].as_u64().unwrap();
        assert!(faces.abs_diff(2000) < 200, "{faces}");
    }
}

#[test]
fn a_size_that_a_shape_does_not_have_is_said() {
    let p = Place::new();
    let run = p.done("generate sphere m.obj --faces 1");
    assert!(
        run.stderr.contains("20 faces (1 asked for: this mesh has no size nearer to that)"),
        "{}",
        run.stderr
    );
    assert!(!p.done("generate torus m.obj --faces 2e3").stderr.contains("asked for"));
}

#[test]
fn wrong_usage_is_exit_code_2_and_writes_nothing() {
    let p = Place::new();
    p.run("generate teapot m.obj").failed(2, "\"teapot\"");
    p.run("generate sphere m.obj --faces 60000000").failed(2, "at most");
    p.run("generate sphere m.obj --faces 0").failed(2, "1 or more");
    p.run("generate sphere m.xyz").failed(2, "--to");
    p.run("generate sphere").failed(2, "OUT");
    p.run("generate").failed(2, "NAME");
    p.run("generate sphere none/m.obj --faces 20").failed(4, "none/m.obj");
    assert!(p.files().is_empty());
}
