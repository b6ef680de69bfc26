//! `progmesh simplify`, end to end: flags, messages, exit codes, what is left on disk.

mod common;

use common::Place;

fn triangles(p: &Place, file: &str) -> u64 {
    let info = p.done(&format!("info {file} --check --json -q")).json();
    assert_eq!(info["check"], "ok");
    info["meshes"].as_array().unwrap().iter().map(|m| m["triangles"].as_u64().unwrap()).sum()
}

#[test]
fn a_ratio_and_a_number_are_met() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 1280);
    let before = triangles(&p, "in.obj");
    let s = p.simplify("in.obj out.obj --ratio 0.25");
    assert_eq!((s["stop"].as_str(), s["faces_in"].as_u64()), (Some("target"), Some(before)));
    assert!(triangles(&p, "out.obj").abs_diff(before / 4) <= 2);
    p.simplify("in.obj out.obj --triangles 100");
    assert!(triangles(&p, "out.obj").abs_diff(100) <= 2);
}

#[test]
fn topology_is_kept() {
    let p = Place::new();
    p.generate("scan", "in.obj", 2000);
    p.simplify("in.obj out.obj --ratio 0.2");
    let (a, b) = (p.info("in.obj"), p.info("out.obj"));
    for field in ["border_loops", "components", "genus", "euler", "manifold"] {
        assert_eq!(a["meshes"][0][field], b["meshes"][0][field], "{field}");
    }
}

#[test]
fn a_refit_moves_vertices_where_it_may() {
    let p = Place::new();
    p.generate("torus", "in.obj", 2000);
    let result = |how: &str| {
        p.simplify(&format!("in.obj out.obj --ratio 0.2 {how}"));
        p.read("out.obj")
    };
    let plain = result("--refit 0");
    assert!(result("") == result("--refit 2"), "the default on small inputs");
    assert!(result("--refit 2") != plain);
    assert!(result("--refit 0 --keep-vertices") == result("--keep-vertices"));
    for (how, why) in [
        ("--refit 1 --method nsa", "--refit is for --method quadric"),
        ("--refit 1 --keep-vertices", "--placement optimal only"),
        ("--refit 1 --placement midpoint", "--placement optimal only"),
    ] {
        p.run(&format!("simplify in.obj out.obj --ratio 0.5 {how}")).failed(2, why);
    }
}

#[test]
fn an_error_bound_stops_the_work_and_is_done() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 1280);
    let loose = p.simplify("in.obj a.obj --max-error 0.05 --relative");
    let tight = p.simplify("in.obj b.obj --max-error 0.005 --relative");
    for s in [&loose, &tight] {
        assert_eq!(s["stop"], "error");
    }
    assert!(tight["estimate"].as_f64().unwrap() <= 0.005 * 2.0 * 3.0f64.sqrt() * 1.001);
    assert!(triangles(&p, "a.obj") < triangles(&p, "b.obj"));
}

#[test]
fn a_target_that_topology_forbids_is_exit_code_1_with_a_reason_and_a_result() {
    let p = Place::new();
    p.generate("torus", "in.obj", 600);
    let run = p.run("simplify in.obj out.obj --triangles 1 --json");
    run.failed(1, "triangles left, more than the 1 asked for");
    assert_eq!(run.json()["stop"], "no_legal_collapse");
    let left = triangles(&p, "out.obj");
    assert!(left > 1 && left < 100, "{left}");
    assert_eq!(p.info("out.obj")["meshes"][0]["genus"], 1);
}

#[test]
fn a_mesh_below_its_target_is_copied() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 80);
    let s = p.simplify("in.obj out.obj --triangles 1000");
    assert_eq!((&s["stop"], &s["faces_out"]), (&"target".into(), &s["faces_in"]));
}

#[test]
fn wrong_usage_is_exit_code_2() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 80);
    p.write("in.xyz", "");
    for (arguments, text) in [
        ("in.obj out.obj", "--ratio"),
        ("in.obj out.obj --ratio 1.5", "from 0 to 1"),
        ("in.obj out.obj --ratio -0.5", "from 0 to 1"),
        ("in.obj out.obj --ratio nan", "from 0 to 1"),
        ("in.obj out.obj --ratio 0.5 --triangles 7", "cannot be used with"),
        ("in.obj out.obj --relative", "--max-error"),
        ("in.obj out.obj --max-error -1", "0 or more"),
        ("in.obj out.obj --ratio 0.5 --epsilon 5", "--method nsa"),
        ("in.obj out.obj --ratio 0.5 --passes 5", "--method nsa"),
        ("in.obj out.obj --method nsa --passes 0", "--passes"),
        ("in.obj out.obj --method nsa --epsilon 190", "0 to 180"),
        ("in.obj out.obj --method cluster --ratio 0.5 --schedule exact", "--method quadric"),
        ("in.obj out.obj --ratio 0.5 --crease 30", "--normals recompute"),
        ("in.obj out.obj --ratio 0.5 --threads 0", "--threads"),
        ("in.obj out.obj --ratio 0.5 --keep-vertices --placement optimal", "--keep-vertices"),
        ("in.obj out.obj --ratio 0.5 --lock-material none", "no material `none`"),
        ("in.obj out.obj --ratio 0.5 --lock-group none", "no group `none`; there are sphere"),
        ("in.obj out.obj --ratio 0.5 --weights-property none", "no vertex property `none`"),
        ("in.obj out.xyz --ratio 0.5", "--to"),
        ("in.xyz out.obj --ratio 0.5", "--from"),
        ("- out.obj --ratio 0.5", "--from"),
        ("in.obj - --ratio 0.5", "--to"),
        ("in.obj - --to obj --ratio 0.5 --json", "standard output"),
        ("in.obj out.obj --ratio 0.5 --colour", "--colour"),
    ] {
        p.run(&format!("simplify {arguments}")).failed(2, text);
    }
    assert_eq!(p.files(), ["in.obj", "in.xyz"]);
}

#[test]
fn a_distance_after_weld_needs_an_equals_sign_and_that_is_said() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 80);
    p.run("simplify in.obj out.obj --ratio 0.5 --weld 0.1").failed(2, "after an equals sign: --weld=0.1");
    p.done("simplify --weld in.obj out.obj --ratio 0.5");
    p.done("simplify in.obj out.obj --ratio 0.5 --weld=0.1");
}

#[test]
fn an_unreadable_input_is_exit_code_3_and_an_unwritable_output_4() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 80);
    p.write("bad.obj", "v 0 0 0\nv 1 0 0\nf 1 2 x\n");
    p.run("simplify none.obj out.obj --ratio 0.5").failed(3, "error: none.obj: ");
    p.run("simplify . out.obj --from obj --ratio 0.5").failed(3, "directory");
    p.run("simplify bad.obj out.obj --ratio 0.5").failed(3, "error: bad.obj: line 3");
    p.run("simplify in.obj none/out.obj --ratio 0.5")
        .failed(4, "error: none/out.obj: there is no directory none");
    p.write("out.obj/file", "");
    p.run("simplify in.obj out.obj --ratio 0.5").failed(4, "out.obj: is a directory");
    assert_eq!(p.files(), ["bad.obj", "in.obj", "out.obj"]);
}

#[test]
fn standard_input_and_output_work_and_messages_stay_out_of_them() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 320);
    let run = p.run_with("simplify - - --from obj --to obj --ratio 0.5", p.read("in.obj"));
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stderr.contains("standard input: 320 -> 160 faces"), "{}", run.stderr);
    p.write("out.obj", &run.stdout);
    assert_eq!(triangles(&p, "out.obj"), 160);
}

#[test]
fn the_summary_calls_an_estimate_an_estimate_and_quiet_is_quiet() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 320);
    let run = p.done("simplify in.obj out.obj --ratio 0.5");
    for text in ["320 -> 160 faces (50.0 %)", "quadric", "estimated error", "stopped: target reached"] {
        assert!(run.stderr.contains(text), "{text}: {}", run.stderr);
    }
    assert_eq!(run.stdout, "");
    let run = p.done("simplify in.obj out.obj --ratio 0.5 --quiet");
    assert_eq!((run.stdout.as_str(), run.stderr.as_str()), ("", ""));
}

#[test]
fn the_output_may_be_the_input() {
    let p = Place::new();
    p.generate("sphere", "mesh.obj", 320);
    p.done("simplify mesh.obj mesh.obj --ratio 0.5");
    assert_eq!(triangles(&p, "mesh.obj"), 160);
    assert_eq!(p.files(), ["mesh.obj"]);
}

/// Two squares of 10 x 10 quads, cut in triangles, side by side, each a group and a material of its own.
fn two_patches() -> String {
    let mut s = String::from("mtllib m.mtl\n");
    for j in 0..=10 {
        for i in 0..=20 {
            s += &format!("v {i} {j} {}\n", (i * 7 + j * 13) % 5);
        }
    }
    for (name, range) in [("left", 0..10), ("right", 10..20)] {
        s += &format!("g {name}\nusemtl {name}\n");
        for i in range {
            for j in 0..10 {
                let v = j * 21 + i + 1;
                s += &format!("f {} {} {}\nf {} {} {}\n", v, v + 1, v + 22, v, v + 22, v + 21);
            }
        }
    }
    s
}

fn faces_of(p: &Place, file: &str, part: &str, name: &str) -> u64 {
    let info = p.info(file);
    let parts = info["meshes"][0][part].as_array().unwrap();
    parts.iter().find(|g| g["name"] == name).map_or(0, |g| g["faces"].as_u64().unwrap())
}

#[test]
fn locked_materials_and_groups_keep_their_faces() {
    let p = Place::new();
    p.write("in.obj", two_patches());
    p.write("m.mtl", "newmtl left\nKd 1 0 0\nnewmtl right\nKd 0 1 0\n");
    for lock in ["--lock-material left", "--lock-material 0", "--lock-group left"] {
        p.done(&format!("simplify in.obj out.obj --ratio 0.7 {lock}"));
        assert_eq!(faces_of(&p, "out.obj", "groups", "left"), 200, "{lock}");
        assert!(faces_of(&p, "out.obj", "materials", "right") < 100, "{lock}");
    }
    // All locked: nothing is legal.
    let all = "simplify in.obj out.obj --ratio 0.5 --lock-material left --lock-material right";
    p.run(all).failed(1, "lock less");
}

#[test]
fn a_locked_border_keeps_its_vertices() {
    let p = Place::new();
    p.write("in.obj", two_patches());
    p.write("m.mtl", "newmtl left\nnewmtl right\n");
    p.done("simplify in.obj out.obj --ratio 0.3 --lock-border");
    let border = |f: &str| p.info(f)["meshes"][0]["edge_kinds"]["border"].as_u64();
    assert_eq!(border("in.obj"), border("out.obj"));
    let positions = |f: &str| -> Vec<String> {
        let on = |l: &&str| l.starts_with("v ") && (l.starts_with("v 0 ") || l.starts_with("v 20 "));
        let mut v: Vec<String> = p.text(f).lines().filter(on).map(str::to_string).collect();
        v.sort();
        v
    };
    assert_eq!(positions("in.obj"), positions("out.obj"));
}

#[test]
fn missing_materials_are_warned_of_once() {
    let p = Place::new();
    p.write("in.obj", two_patches());
    let run = p.done("simplify in.obj out.obj --ratio 0.5 --json");
    let warnings = run.stderr.lines().filter(|l| l.starts_with("warning: ") && l.contains("m.mtl")).count();
    assert_eq!(warnings, 1, "{}", run.stderr);
    assert!(run.json()["warnings"].to_string().contains("m.mtl"));
}

#[test]
fn materials_outside_the_inputs_directory_are_not_read() {
    let p = Place::new();
    p.write("secret.mtl", "newmtl left\nmap_Kd secret.png\n");
    for name in ["../secret.mtl".to_string(), p.path("secret.mtl").display().to_string()] {
        p.write("in/in.obj", two_patches().replace("m.mtl", &name));
        let run = p.done("simplify in/in.obj out.obj --ratio 0.5");
        assert!(run.stderr.contains("only files beside"), "{}", run.stderr);
    }
}

#[test]
fn normals_are_kept_recomputed_or_removed() {
    let p = Place::new();
    p.generate("torus", "in.obj", 600);
    p.done("simplify in.obj keep.obj --ratio 0.5");
    p.done("simplify in.obj none.obj --ratio 0.5 --normals none");
    p.done("simplify in.obj flat.obj --ratio 0.5 --normals recompute --crease 0");
    p.done("simplify in.obj smooth.obj --ratio 0.5 --normals recompute --crease 180");
    let normals = |f: &str| -> Vec<[f64; 3]> {
        let text = p.text(f);
        let lines = text.lines().filter_map(|l| l.strip_prefix("vn "));
        lines
            .map(|l| {
                let n: Vec<f64> = l.split(' ').map(|x| x.parse().unwrap()).collect();
                [n[0], n[1], n[2]]
            })
            .collect()
    };
    assert!(normals("none.obj").is_empty());
    let count = |f: &str| p.text(f).lines().filter(|l| l.starts_with("v ")).count();
    assert!(normals("smooth.obj").len() <= count("smooth.obj"));
    assert!(normals("flat.obj").len() > count("flat.obj"));
    for f in ["keep.obj", "flat.obj", "smooth.obj"] {
        for n in normals(f) {
            let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!((length - 1.0).abs() < 1e-5, "{f}: {n:?}");
        }
    }
}

#[test]
fn polygons_are_cut_for_quadrics_and_said_so_once() {
    let p = Place::new();
    p.generate("polygons", "in.obj", 200);
    let run = p.done("simplify in.obj out.obj --ratio 0.5");
    assert_eq!(run.stderr.matches("cut into triangles").count(), 1, "{}", run.stderr);
    assert_eq!(p.info("out.obj")["meshes"][0]["face_sizes"]["quads"], 0);
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_with_130_and_writes_nothing() {
    use std::process::{Command, Stdio};
    let p = Place::new();
    // It waits for standard input, which never comes.
    let interrupted_after = |wait: u64| {
        let mut child = Command::new(env!("CARGO_BIN_EXE_progmesh"))
            .current_dir(p.directory())
            .args("simplify - out.obj --from obj --ratio 0.5".split(' '))
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(wait));
        Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        let stdin = child.stdin.take();
        let out = child.wait_with_output().unwrap();
        drop(stdin);
        out
    };
    // Until the handler is there, the signal ends the process as it would any, which has no exit code then: on a busy machine that takes a while.
    let mut out = interrupted_after(25);
    for wait in (1..12).map(|k| 25 << k) {
        if out.status.code().is_some() {
            break;
        }
        out = interrupted_after(wait);
    }
    assert_eq!(out.status.code(), Some(130), "{:?}", out.status);
    assert!(String::from_utf8_lossy(&out.stderr).contains("interrupted; nothing was written"));
    assert!(p.files().is_empty());
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_failure() {
    use std::io::Read;
    use std::process::{Command, Stdio};
    let p = Place::new();
    p.generate("sphere", "in.obj", 20_000);
    let mut child = Command::new(env!("CARGO_BIN_EXE_progmesh"))
        .current_dir(p.directory())
        .args("convert in.obj - --to obj".split(' '))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // More than a pipe holds is still to come when this end closes.
    let mut first = [0; 10];
    child.stdout.take().unwrap().read_exact(&mut first).unwrap();
    let out = child.wait_with_output().unwrap();
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
    assert!(out.stderr.is_empty());
}

#[test]
fn help_has_examples_and_completions_and_man_pages_know_every_flag() {
    let p = Place::new();
    for sub in ["simplify", "info", "convert", "generate", "completions", "man"] {
        let help = p.done(&format!("{sub} --help")).stdout;
        assert!(help.contains(&format!("progmesh {sub}")) && help.contains("Example"), "{help}");
    }
    p.done("man pages");
    let page = p.text("pages/progmesh-simplify.1").replace("\\-", "-");
    let script = p.done("completions bash").stdout;
    for flag in ["--max-error", "--lock-material", "--keep-vertices", "--normals", "--per-mesh"] {
        assert!(page.contains(flag) && script.contains(flag), "{flag}");
    }
    for flag in [
        "[--ratio R]",
        "[--method nsa|quadric|cluster]",
        "[--lock-material NAME|INDEX]...",
        "[--weld[=EPS]]",
        "IN OUT",
    ] {
        assert!(page.contains(flag), "{flag}: {page}");
    }
    assert!(page.contains("\"progmesh 0."), "{page}");
    assert!(p.exists("pages/progmesh.1") && p.exists("pages/progmesh-info.1"));
    p.run("completions tcsh").failed(2, "invalid value");
}
