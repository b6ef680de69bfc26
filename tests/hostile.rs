//! The hostile meshes: each has a defined result, a valid mesh or an error that names the element. Never a panic, never a hang.

mod common;

use common::{Place, Run};

const FACES: usize = 600;

/// Generates hostile mesh `name` and simplifies it by `how`.
fn simplify(p: &Place, name: &str, how: &str) -> Run {
    p.done(&format!("generate {name} in.obj --faces {FACES} -q"));
    p.run(&format!("simplify in.obj out.obj {how}"))
}

/// What was written is a valid mesh; its number of triangles.
fn valid_output(p: &Place) -> usize {
    let info = p.done("info out.obj --check --json").json();
    assert_eq!(info["check"], "ok");
    info["meshes"].as_array().unwrap().iter().map(|m| m["triangles"].as_u64().unwrap() as usize).sum()
}

fn triangles_in(p: &Place) -> usize {
    p.info("in.obj")["meshes"][0]["triangles"].as_u64().unwrap() as usize
}

/// Half of the triangles are left, give or take two.
fn halved(name: &str, method: &str) {
    let p = Place::new();
    let run = simplify(&p, name, &format!("--ratio 0.5 --method {method}"));
    assert_eq!(run.code, 0, "{name} {method}: {}", run.stderr);
    let (before, after) = (triangles_in(&p), valid_output(&p));
    assert!(after.abs_diff(before / 2) <= 2, "{name} {method}: {before} -> {after}");
}

#[test]
fn far_offsets_halve() {
    for name in ["offset-1e4", "offset-1e4-f64", "offset-1e6-f64"] {
        halved(name, "quadric");
    }
}

#[test]
fn an_offset_that_f32_cannot_resolve_still_gives_a_valid_mesh() {
    // Sixteen steps across: most faces have no area, so few collapses are legal.
    let p = Place::new();
    let run = simplify(&p, "offset-1e6", "--ratio 0.5");
    assert!(run.code == 0 || run.code == 1, "{}", run.stderr);
    assert!(valid_output(&p) < triangles_in(&p));
}

#[test]
fn extreme_scales_halve() {
    for name in ["scale-1e-12", "scale-1e12", "scale-1e-25"] {
        halved(name, "quadric");
    }
}

#[test]
fn scale_does_not_change_what_is_collapsed() {
    let faces = |name: &str| {
        let p = Place::new();
        simplify(&p, name, "--ratio 0.3");
        let text = p.text("out.obj");
        text.lines().filter(|l| l.starts_with("f ")).map(str::to_string).collect::<Vec<_>>()
    };
    // A power of two apart but for rounding to f32; the same faces to within a few.
    let (unit, small) = (faces("scale-1e-12"), faces("scale-1e12"));
    assert!(unit.len().abs_diff(small.len()) <= 2);
}

#[test]
fn a_squashed_mesh_halves() {
    halved("squashed", "quadric");
}

#[test]
fn a_coordinate_that_is_no_number_is_named() {
    for name in ["nan", "inf"] {
        let p = Place::new();
        let run = simplify(&p, name, "--ratio 0.5");
        run.failed(3, "in.obj: ");
        assert!(run.stderr.contains("line ") || run.stderr.contains("vertex "), "{}", run.stderr);
        assert!(!p.exists("out.obj"));
        p.run("info in.obj --check").failed(3, "in.obj: ");
        p.run("convert in.obj out.obj").failed(3, "in.obj: ");
    }
}

#[test]
fn an_index_out_of_range_is_named() {
    let p = Place::new();
    let run = simplify(&p, "index-out-of-range", "--ratio 0.5");
    run.failed(3, "in.obj: ");
    assert!(run.stderr.contains("line ") || run.stderr.contains("face "), "{}", run.stderr);
    assert!(!p.exists("out.obj"));
}

#[test]
fn degenerate_faces_are_left_out_and_said() {
    let p = Place::new();
    let run = simplify(&p, "degenerate-faces", "--ratio 0.5");
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stderr.contains("fewer than three distinct"), "{}", run.stderr);
    assert!(valid_output(&p) > 0);
    p.run("info in.obj --check").failed(1, "(the first: face ");
}

#[test]
fn duplicate_faces_are_reported_and_survive() {
    let p = Place::new();
    let run = simplify(&p, "duplicate-faces", "--ratio 0.5");
    assert!(run.code == 0 || run.code == 1, "{}", run.stderr);
    assert!(valid_output(&p) < triangles_in(&p));
    assert!(p.info("in.obj")["meshes"][0]["problems"].to_string().contains("vertices of an earlier face"));
}

#[test]
fn a_soup_needs_welding_and_says_so() {
    let p = Place::new();
    let run = simplify(&p, "soup", "--ratio 0.5");
    run.failed(1, "--weld");
    assert_eq!(valid_output(&p), triangles_in(&p));
    assert!(p.info("in.obj")["meshes"][0]["problems"].to_string().contains("--weld"));
    let run = simplify(&p, "soup", "--ratio 0.5 --weld");
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(valid_output(&p).abs_diff(triangles_in(&p) / 2) <= 2);
}

#[test]
fn faces_turned_over_do_not_matter_and_are_reported() {
    halved("flipped-half", "quadric");
    let p = Place::new();
    p.done(&format!("generate flipped-half in.obj --faces {FACES}"));
    assert!(p.info("in.obj")["meshes"][0]["problems"].to_string().contains("opposite orientation"));
}

#[test]
fn an_empty_mesh_stays_empty() {
    for method in ["quadric", "nsa", "cluster"] {
        let p = Place::new();
        let run = simplify(&p, "empty", &format!("--ratio 0.5 --method {method}"));
        assert_eq!(run.code, 0, "{method}: {}", run.stderr);
        assert!(run.stderr.contains("no faces"), "{}", run.stderr);
        assert!(p.exists("out.obj"));
    }
}

#[test]
fn a_single_triangle_stays_unless_it_must_go() {
    for method in ["quadric", "nsa", "cluster"] {
        let p = Place::new();
        let run = simplify(&p, "single-triangle", &format!("--ratio 0.5 --method {method}"));
        assert_eq!(run.code, 0, "{method}: {}", run.stderr);
        assert_eq!(valid_output(&p), 1);
    }
    let p = Place::new();
    simplify(&p, "single-triangle", "--triangles 0").failed(1, "1 triangle left, more than the 0 asked for");
    assert_eq!(valid_output(&p), 1);
}

#[test]
fn every_method_survives_every_hostile_mesh() {
    let refused = ["nan", "inf", "index-out-of-range"];
    for e in progmesh::meshes::names().iter().filter(|e| e.hostile) {
        for method in ["nsa", "cluster"] {
            let p = Place::new();
            let run = simplify(&p, e.name, &format!("--method {method} --ratio 0.5"));
            if refused.contains(&e.name) {
                run.failed(3, "in.obj: ");
            } else {
                assert!(run.code == 0 || run.code == 1, "{} {method}: {} {}", e.name, run.code, run.stderr);
                if e.name != "empty" {
                    valid_output(&p);
                }
            }
        }
    }
}

#[test]
fn truncated_files_of_each_format_are_refused_or_read_as_far_as_they_go() {
    for format in ["obj", "ply", "stl", "off", "gltf", "glb"] {
        let p = Place::new();
        p.generate("quad-sphere", &format!("whole.{format}"), 54);
        let whole = p.read(&format!("whole.{format}"));
        let n = whole.len();
        for keep in [0, 1, 4, 5, 12, 20, 79, 80, 84, 100, n / 3, n / 2, n * 3 / 4, n - 50, n - 13] {
            p.write(&format!("cut.{format}"), &whole[..keep.min(n)]);
            defined(&p, &format!("cut.{format}"), &format!("{format} cut at {keep} of {n}"));
            // Text may end anywhere between two faces and still be a mesh; counts and lengths in the others tell.
            if ["ply", "glb", "gltf", "off"].contains(&format) {
                p.run(&format!("info cut.{format}")).failed(3, &format!("cut.{format}: "));
            }
        }
    }
}

#[test]
fn corrupted_files_of_each_format_end_with_a_defined_exit_code() {
    for format in ["obj", "ply", "stl", "off", "gltf", "glb"] {
        let p = Place::new();
        p.generate("quad-sphere", &format!("whole.{format}"), 54);
        let whole = p.read(&format!("whole.{format}"));
        let mut random = progmesh::meshes::SplitMix64::new(7);
        for trial in 0..12 {
            let mut bytes = whole.clone();
            for _ in 0..1 + trial % 4 {
                // Mostly near the start, where headers are.
                let span = if trial % 3 == 0 { bytes.len() } else { bytes.len().min(300) };
                let at = random.next_u64() as usize % span;
                bytes[at] = random.next_u64() as u8;
            }
            p.write(&format!("bad.{format}"), &bytes);
            defined(&p, &format!("bad.{format}"), &format!("{format}, trial {trial}"));
        }
    }
}

/// Simplifying `file` ends with a valid mesh, or an error that names the file and leaves nothing behind.
fn defined(p: &Place, file: &str, what: &str) {
    let run = p.run(&format!("simplify {file} out.ply --ratio 0.5 -q"));
    match run.code {
        0 | 1 => {
            let check = p.run("info out.ply --check -q");
            assert!(check.code == 0, "{what}: {}", check.stderr);
            std::fs::remove_file(p.path("out.ply")).unwrap();
        }
        3 => {
            assert!(run.stderr.starts_with(&format!("error: {file}: ")), "{what}: {}", run.stderr);
            assert!(!p.exists("out.ply"), "{what}");
        }
        code => panic!("{what}: exit code {code}: {}", run.stderr),
    }
}

#[test]
fn a_billion_announced_elements_allocate_nothing_large() {
    let p = Place::new();
    p.write("a.off", "OFF\n1000000000 1000000000 0\n0 0 0\n");
    p.write(
        "a.ply",
        "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000\nproperty float x\nproperty float y\n\
         property float z\nelement face 1000000000\nproperty list uchar int vertex_indices\nend_header\nxxxx",
    );
    let mut stl = vec![0u8; 80];
    stl.extend(1_000_000_000u32.to_le_bytes());
    stl.extend([0; 50]);
    p.write("a.stl", stl);
    p.write(
        "a.gltf",
        r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"componentType":5126,"type":"VEC3","count":1000000000}]}"#,
    );
    for file in ["a.off", "a.ply", "a.stl", "a.gltf"] {
        // 1 GiB of address space: what reserves for a billion elements fails.
        let command = format!("ulimit -v 1048576; exec {} info {file}", env!("CARGO_BIN_EXE_progmesh"));
        let mut shell = std::process::Command::new("sh");
        let out = shell.current_dir(p.directory()).args(["-c", &command]).output().unwrap();
        let stderr = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(3), "{file}: {stderr}");
        assert!(stderr.starts_with(&format!("error: {file}: ")), "{stderr}");
    }
}
