//! `convert` and `generate`.

use crate::common::Place;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Convert {
    command: String,
    from: String,
    to: String,
    meshes: usize,
    vertices: usize,
    faces: usize,
    triangles: usize,
    seconds: ConvertSeconds,
    warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConvertSeconds {
    read: f64,
    prepare: f64,
    write: f64,
    total: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Generate {
    command: String,
    name: String,
    seed: u64,
    to: String,
    vertices: usize,
    faces: usize,
    triangles: usize,
    warnings: Vec<String>,
}

#[test]
fn convert_and_generate_print_one_object_with_the_documented_fields() {
    let p = Place::new();
    let run = p.done("generate quad-sphere in.obj --faces 96 --seed 3 --json");
    let g: Generate = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(
        (g.command.as_str(), g.name.as_str(), g.seed, g.to.as_str()),
        ("generate", "quad-sphere", 3, "obj")
    );
    assert_eq!((g.vertices, g.faces, g.triangles), (98, 96, 192));
    let run = p.done("convert in.obj out.stl --json");
    let c: Convert = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!((c.command.as_str(), c.from.as_str(), c.to.as_str(), c.meshes), ("convert", "obj", "stl", 1));
    assert_eq!((c.vertices, c.faces, c.triangles), (98, 96, 192));
    let t = &c.seconds;
    assert!(
        t.read >= 0.0 && t.prepare >= 0.0 && t.write >= 0.0 && t.read + t.prepare + t.write <= t.total + 1e-9
    );
    // What is said on standard error is in the object, and there too.
    assert!(!c.warnings.is_empty());
    for w in &c.warnings {
        assert!(run.stderr.contains(&format!("warning: {w}\n")), "{w}");
    }
    for arguments in ["generate sphere - --to obj --json", "convert in.obj - --to obj --json"] {
        p.run(arguments).failed(2, "--json and OUT both want standard output");
    }
}
