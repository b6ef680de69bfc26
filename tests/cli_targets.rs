//! Targets that are missed, bounds that are tight, counts as people write them: what `progmesh simplify` leaves and says.

mod common;

use common::Place;

#[test]
fn clustering_never_leaves_an_empty_mesh() {
    let p = Place::new();
    for (name, file) in [("cad", "cad.obj"), ("sphere", "sphere.ply"), ("scan", "scan.glb")] {
        p.generate(name, file, 800);
        for target in ["--triangles 0", "--triangles 1", "--triangles 4", "--ratio 0"] {
            let run = p.run(&format!("simplify {file} out.obj --method cluster {target} --json"));
            let (n, left) = (run.json()["faces_out"].as_u64().unwrap(), p.info("out.obj"));
            assert!(n > 0 && left["meshes"][0]["faces"] == n, "{file} {target}: {n}");
            assert!(n < 60, "{file} {target}: {n}");
            match run.code {
                0 => assert!(target == "--triangles 4" && n <= 4, "{file} {target}: {n}"),
                _ if target.ends_with(" 0") => run.failed(1, "A mesh is never left empty"),
                _ => run.failed(1, "no grid leaves fewer, but none at all. Try --method quadric"),
            }
        }
    }
}

#[test]
fn a_bound_below_the_edges_of_a_mesh_merges_nothing_and_says_why() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 320);
    for bound in ["0", "1e-9", "0.0001 --relative"] {
        let run = p.done(&format!("simplify in.obj out.obj --method cluster --max-error {bound} --json"));
        assert_eq!(
            (&run.json()["faces_out"], &run.json()["stop"]),
            (&320.into(), &"error".into()),
            "{bound}"
        );
        assert!(run.stderr.contains("warning: in.obj: nothing was merged"), "{}", run.stderr);
        assert!(run.json()["warnings"].to_string().contains("the diagonal of a cell"));
    }
    let run = p.done("simplify in.obj out.obj --method cluster --max-error 0.5");
    assert!(!run.stderr.contains("nothing was merged"), "{}", run.stderr);
    assert!(p.done("simplify --help").stdout.contains("the diagonal of a cell"));
}

#[test]
fn a_closed_surface_is_known_to_need_its_faces() {
    let p = Place::new();
    p.generate("sphere", "sphere.obj", 320);
    p.generate("torus", "torus.obj", 300);
    let two = format!("{}{}", p.text("sphere.obj"), {
        let count = p.text("sphere.obj").lines().filter(|l| l.starts_with("v ")).count();
        let moved = |l: &str| {
            let mut x: Vec<f64> = l[2..].split(' ').map(|x| x.parse().unwrap()).collect();
            x[0] += 5.0;
            format!("v {} {} {}\n", x[0], x[1], x[2])
        };
        let face = |l: &str| {
            let v = l[2..].split(' ').map(|c| c.split('/').next().unwrap().parse::<usize>().unwrap() + count);
            format!("f {}\n", v.map(|v| v.to_string()).collect::<Vec<_>>().join(" "))
        };
        let text = p.text("sphere.obj");
        let v: String = text.lines().filter(|l| l.starts_with("v ")).map(moved).collect();
        let f: String = text.lines().filter(|l| l.starts_with("f ")).map(face).collect();
        v + &f
    });
    p.write("two.obj", two);
    for (file, least) in [("sphere.obj", 4), ("two.obj", 8), ("torus.obj", 14)] {
        for target in ["--triangles 1", "--ratio 0"] {
            let run = p.run(&format!("simplify {file} out.obj {target}"));
            let text = "A closed surface has at least 4 faces a component, with handles more, an open one 1";
            run.failed(1, &format!("{text}: here {least} together"));
        }
    }
    // Of a sheet the last face stays.
    p.generate("terrain", "sheet.obj", 200);
    p.run("simplify sheet.obj out.obj --triangles 0").failed(1, "here 1 together");
}

#[test]
fn the_estimate_never_passes_the_bound() {
    let p = Place::new();
    for (name, file) in [("cad", "cad.obj"), ("scan", "scan.ply"), ("torus", "torus.glb")] {
        p.generate(name, file, 2000);
        for bound in [0.0, 1e-9, 1e-3] {
            for way in
                ["", "--placement endpoint", "--placement midpoint", "--schedule exact", "--method nsa"]
            {
                let s = p.simplify(&format!("{file} out.obj --max-error {bound} {way} -q"));
                let estimate = s["estimate"].as_f64().unwrap();
                assert!(estimate <= bound, "{file} {way}: {estimate} > {bound}");
            }
        }
    }
    // The planes of the block cost nothing.
    let s = p.simplify("cad.obj out.obj --max-error 0");
    assert!(s["faces_out"].as_u64().unwrap() * 2 < s["faces_in"].as_u64().unwrap(), "{s}");
}

#[test]
fn an_error_bound_is_in_world_units() {
    let p = Place::new();
    p.generate("sphere", "in.gltf", 1280);
    let scaled = p.text("in.gltf").replacen("\"mesh\": 0", "\"mesh\": 0, \"scale\": [10, 10, 10]", 1);
    p.write("large.gltf", &scaled);
    for method in ["quadric", "nsa --epsilon 40", "cluster"] {
        let small = p.simplify(&format!("in.gltf out.obj --method {method} --max-error 0.05 -q"));
        let large = p.simplify(&format!("large.gltf out.obj --method {method} --max-error 0.5 -q"));
        assert_eq!(small["faces_out"], large["faces_out"], "{method}");
        assert!(large["estimate"].as_f64().unwrap() <= 0.5 * (1.0 + 1e-9), "{method}");
    }
}

#[test]
fn counts_may_be_written_with_a_power_of_ten_or_underscores() {
    let p = Place::new();
    for faces in ["2e3", "2_000", "2000"] {
        p.done(&format!("generate torus {faces}.obj --faces {faces}"));
        assert_eq!(p.read(&format!("{faces}.obj")), p.read("2e3.obj"));
        let s = p.simplify(&format!("{faces}.obj out.obj --triangles {faces} --threads 1e0"));
        assert_eq!(s["stop"], "target");
    }
    p.done("simplify 2e3.obj out.obj --method nsa --passes 1e1");
    for (arguments, text) in [
        ("simplify 2e3.obj out.obj --triangles 1.5", "whole number"),
        ("simplify 2e3.obj out.obj --triangles -5", "0 or more"),
        ("simplify 2e3.obj out.obj --triangles 1e99", "whole number"),
        ("simplify 2e3.obj out.obj --ratio 0.5 --threads 1e9", "1 to 65535"),
        ("generate torus x.obj --faces 0", "1 or more"),
    ] {
        p.run(arguments).failed(2, text);
    }
    assert!(!p.exists("x.obj"));
}

#[test]
fn all_errors_begin_alike() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 80);
    for (arguments, code) in [
        ("simplify in.obj", 2),
        ("simplify in.obj out.obj", 2),
        ("simplify in.obj out.obj --ratio 2", 2),
        ("simplify none.obj out.obj --ratio 0.5", 3),
        ("simplify in.obj none/out.obj --ratio 0.5", 4),
        ("simplify in.obj out.obj --triangles 1", 1),
        ("convert in.obj out.xyz", 2),
        ("unheard-of", 2),
        ("generate teapot t.obj", 2),
    ] {
        let run = p.run(arguments);
        assert_eq!(run.code, code, "{arguments}: {}", run.stderr);
        let errors = run.stderr.lines().filter(|l| l.starts_with("error: ")).count();
        assert_eq!(errors, 1, "{arguments}: {}", run.stderr);
    }
}

#[test]
fn nobody_is_told_to_unlock_what_nobody_locked() {
    let p = Place::new();
    // Fins on one edge: all their vertices but the tips are where sheets meet.
    let fin = |k: usize| format!("v {} {} 0.5\n", (k as f64).cos(), (k as f64).sin());
    let fins: String = (0..6).map(fin).collect();
    let faces: String = (3..9).map(|v| format!("f 1 2 {v}\n")).collect();
    p.write("fins.obj", format!("v 0 0 0\nv 0 0 1\n{fins}{faces}"));
    let run = p.run("simplify fins.obj out.obj --triangles 2");
    assert!(run.code == 1 && !run.stderr.contains("lock"), "{}", run.stderr);
    let run = p.run("simplify fins.obj out.obj --triangles 2 --lock-border");
    assert!(run.code == 1, "{}", run.stderr);
}
