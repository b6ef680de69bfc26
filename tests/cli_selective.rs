//! `extract` and `fly`, end to end.

mod common;

use common::Place;
use serde_json::Value;

const CAMERA: &str = r#"{"eye": [0.2, 0.3, 2.2], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 45, "width": 640,
    "height": 480, "near": 0.01, "far": 100}"#;

fn place() -> Place {
    let p = Place::new();
    p.write("cam.json", CAMERA);
    p
}

#[test]
fn a_tolerance_of_nothing_writes_the_input_and_one_of_everything_the_base() {
    for (name, ending) in [("scan", "ply"), ("cad", "glb"), ("polygons", "off"), ("quad-sphere", "obj")] {
        let p = place();
        p.generate(name, &format!("in.{ending}"), 1500);
        std::fs::create_dir_all(p.path("a")).unwrap();
        std::fs::create_dir_all(p.path("b")).unwrap();
        std::fs::create_dir_all(p.path("c")).unwrap();
        p.done(&format!("convert in.{ending} b/x.{ending} -q"));
        p.done(&format!("extract in.{ending} a/x.{ending} --camera cam.json --tau 0 --cull none -q"));
        let same = p.read(&format!("a/x.{ending}")) == p.read(&format!("b/x.{ending}"));
        assert!(same, "{name}");
        p.done(&format!("encode in.{ending} in.pm -q"));
        p.done(&format!("extract in.pm c/x.{ending} --camera cam.json --tau 0 --cull none -q"));
        let same = p.read(&format!("c/x.{ending}")) == p.read(&format!("b/x.{ending}"));
        assert!(same, "{name} of its .pm");
        let base = p.done("extract in.pm base.ply --camera cam.json --tau inf --json -q").json();
        let decoded = p.done("decode in.pm base2.ply --level 0 --json -q").json();
        assert_eq!((&base["faces"], &base["tau"]), (&decoded["triangles"], &Value::Null));
    }
}

#[test]
fn one_view_takes_fewer_faces_than_all_of_it_and_a_budget_is_kept() {
    let p = place();
    p.generate("scan", "in.ply", 12_000);
    p.done("encode in.ply in.pm -q");
    let faces = |flags: &str| {
        let r = p.done(&format!("extract in.pm out.ply --camera cam.json --json -q {flags}")).json();
        assert_eq!(p.info("out.ply")["triangles"]["file"], r["faces"], "{flags}");
        r["faces"].as_u64().unwrap()
    };
    let (none, all) = (faces("--tau 0.25 --cull none"), faces("--tau 0.25"));
    let (frustum, cone) = (faces("--tau 0.25 --cull frustum"), faces("--tau 0.25 --cull cone"));
    assert!(all <= frustum.min(cone) && frustum.max(cone) <= none && all * 20 < none * 19, "{all} {none}");
    assert!(faces("--tau 8") < all);
    let budget = faces("--tau 0.1 --budget-faces 900");
    assert!((700..=900).contains(&budget), "{budget}");
    let run = p.run("extract in.pm out.ply --camera cam.json --budget-faces 3 -q");
    assert_eq!(run.code, 1);
    assert!(run.stderr.contains("that is the base"), "{}", run.stderr);
    // The same from the mesh itself, for any number of threads.
    p.done("extract in.ply a.ply --camera cam.json --threads 1 -q");
    p.done("extract in.ply b.ply --camera cam.json --threads 3 -q --png shot.png");
    assert!(p.read("a.ply") == p.read("b.ply"));
    assert_eq!(&p.read("shot.png")[1..4], b"PNG");
    // And from what can be read but once.
    let args = ["extract", "-", "d.ply", "--from", "pm", "--camera", "cam.json", "-q"];
    assert!(p.command().args(args).write_stdin(p.read("in.pm")).output().unwrap().status.success());
    p.done("extract in.pm c.ply --camera cam.json -q");
    assert!(p.read("c.ply") == p.read("d.ply"));
}

#[test]
fn wrong_cameras_and_paths_are_named() {
    let p = place();
    p.generate("sphere", "in.ply", 500);
    p.write("bad.json", CAMERA.replace("480", "0"));
    p.write("nan.json", CAMERA.replace("2.2", "NaN"));
    p.write("away.json", format!("[{}]", CAMERA.replace("[0, 0, 0]", "[9, 0, 20]")));
    p.write("not.frames", "F 1 2 3\n");
    p.write("empty.frames", "nothing here\n");
    for (arguments, code, says) in [
        ("extract in.ply out.ply --camera bad.json", 3, "bad.json: height"),
        ("extract in.ply out.ply --camera nan.json", 3, "nan.json"),
        ("extract in.ply out.ply --camera none.json", 3, "none.json"),
        ("extract in.ply out.ply", 2, "--camera"),
        ("extract in.ply out.ply --camera cam.json --tau -1", 2, "pixels"),
        ("extract in.ply out.ply --camera cam.json --budget-faces 0", 2, "1 or more"),
        ("fly in.ply --path none.json", 3, "none.json"),
        ("fly in.ply --path not.frames", 3, "not.frames: line 1"),
        ("fly in.ply --path empty.frames", 3, "no frames"),
        ("fly in.ply --path away.json", 3, "no frame sees anything"),
        ("fly in.ply --path circle --frames 0", 2, "1 or more"),
        ("fly in.ply --path circle --hysteresis 0", 2, "0.1 to 1"),
        ("fly in.ply --path circle --geomorph=time:0", 2, "time:FRAMES"),
        ("fly in.ply --path circle --geomorph=error:1", 2, "error:BAND"),
        ("fly in.ply --path circle --rule truly --geomorph", 2, "--geomorph"),
        ("fly in.ply --path circle --rule truly --html a.html", 2, "--html"),
        ("fly in.ply --path circle --rule truly --memory 64", 2, "--memory"),
        ("extract in.ply out.ply --camera cam.json --rule rings --no-guard", 2, "--rule truly"),
        ("extract in.ply out.ply --camera cam.json --no-guard", 2, "--rule"),
        ("fly in.ply --path circle --rule cuts --error directional", 2, "--rule rings"),
        ("encode in.ply out.pm --directional", 2, "--bounds or --paged"),
    ] {
        let run = p.run(arguments);
        assert_eq!(run.code, code, "{arguments}: {}", run.stderr);
        assert!(run.stderr.contains(says), "{arguments}: {}", run.stderr);
        assert!(!p.exists("out.ply"));
    }
}

#[test]
fn a_flight_reports_every_frame_and_what_is_shown_is_within_the_tolerance() {
    let p = Place::new();
    p.generate("scan", "in.ply", 8000);
    p.done("encode in.ply in.pm -q");
    let r = p
        .done("fly in.pm --path circle --frames 40 --tau 1.5 --measure-every 8 --samples 20000 --json -q")
        .json();
    let frames = r["frames"].as_array().unwrap();
    assert_eq!((frames.len(), r["frame_count"].as_u64()), (40, Some(40)));
    let number = |f: &Value, k: &str| f[k].as_f64().unwrap();
    // From one frame to the next by what was applied and undone, one vertex each.
    for w in frames.windows(2) {
        let change = number(&w[1], "vsplits") - number(&w[1], "ecols");
        assert_eq!(number(&w[1], "vertices") - number(&w[0], "vertices"), change);
        assert!(w[1]["complete"].as_bool().unwrap());
    }
    let measured: Vec<f64> = frames.iter().filter_map(|f| f["measured"]["max_pixels"].as_f64()).collect();
    assert_eq!(measured.len(), 5);
    // What is in the picture is counted where it is measured.
    for (k, f) in frames.iter().enumerate() {
        let visible = f["visible_vertices"].as_f64();
        assert_eq!(visible.is_some(), k % 8 == 0, "frame {k}");
        assert!(visible.is_none_or(|n| n > 0.0 && n <= number(f, "vertices")));
    }
    assert!(measured.iter().all(|&m| m <= 1.5 && m > 0.3), "{measured:?}");
    assert_eq!(r["above"], 0);
    assert!(r["faces"]["max"].as_f64().unwrap() < r["full_faces"].as_f64().unwrap());
    // A budget: never more, and most of it used once the tolerance has followed.
    let r = p.done("fly in.pm --path lemniscate --frames 60 --tau 0.2 --budget-faces 800 --json -q").json();
    let frames = r["frames"].as_array().unwrap();
    assert!(frames.iter().all(|f| number(f, "faces") <= 800.0));
    assert!(frames.iter().skip(30).any(|f| number(f, "faces") > 600.0));
    // Time: a frame that is cut short goes on in the next.
    let r = p.done("fly in.pm --path circle --frames 12 --budget-us 1 --json -q").json();
    assert!(
        r["frames"].as_array().unwrap().iter().all(|f| number(f, "vsplits") + number(f, "ecols") <= 128.0)
    );
    // At a display's pace: the same frames, no sooner.
    let begun = std::time::Instant::now();
    let paced = p.done("fly in.pm --path circle --frames 4 --fps 30 --json -q").json();
    assert!(begun.elapsed().as_secs_f64() >= 0.1);
    let free = p.done("fly in.pm --path circle --frames 4 --json -q").json();
    assert!(paced["fps"] == 30 && free["fps"].is_null());
    for (a, b) in paced["frames"].as_array().unwrap().iter().zip(free["frames"].as_array().unwrap()) {
        assert_eq!((number(a, "faces"), number(a, "vsplits")), (number(b, "faces"), number(b, "vsplits")));
    }
    assert_eq!(p.run("fly in.pm --path circle --frames 4 --fps 0").code, 2);
    // For people, and pictures.
    let run = p.done("fly in.pm --path circle --frames 3 --png-every 2 --png-to shots");
    assert!(run.stderr.contains("vertex splits") && run.stdout.is_empty(), "{}", run.stderr);
    assert!(
        p.exists("shots/frame00000.png")
            && p.exists("shots/frame00002.png")
            && !p.exists("shots/frame00001.png")
    );
}

#[test]
fn visible_changes_morph_and_a_camera_that_stands_still_shows_what_it_would_without() {
    let p = Place::new();
    p.generate("scan", "in.ply", 4000);
    p.done("encode in.ply in.pm -q");
    // Once around in part, then still.
    let eye = |k: usize| {
        let (sin, cos) = (0.05 * k.min(12) as f64).sin_cos();
        CAMERA.replace("0.2, 0.3, 2.2", &format!("{}, 0.3, {}", 2.2 * sin, 2.2 * cos))
    };
    let path: Vec<String> = (0..24).map(eye).collect();
    p.write("path.json", format!("[{}]", path.join(",")));
    let fly = |flags: &str| {
        let command = "fly in.pm --path path.json --tau 2 --measure-every 1 --samples 2000 --json -q";
        p.done(&format!("{command} {flags}")).json()["frames"].as_array().unwrap().clone()
    };
    let n = |f: &Value, k: &str| f[k].as_u64().unwrap();
    let plain = fly("");
    assert!(plain.iter().all(|f| n(f, "morphing") == 0));
    let timed = fly("--geomorph=time:8");
    let changes: u64 = plain[1..].iter().map(|f| n(f, "vsplits") + n(f, "ecols")).sum();
    assert!(changes > 20, "{changes}");
    // From the first frame on; what is undone is there for longer; at rest eight frames after the last change.
    assert!(timed[1..=12].iter().filter(|f| n(f, "morphing") > 0).count() > 6);
    assert!(plain.iter().zip(&timed).all(|(a, b)| n(a, "faces") <= n(b, "faces")));
    assert!(plain.iter().zip(&timed).any(|(a, b)| n(a, "faces") < n(b, "faces")));
    for k in 20..24 {
        assert_eq!((n(&timed[k], "morphing"), &timed[k]["faces"]), (0, &plain[k]["faces"]));
        assert_eq!(timed[k]["measured"], plain[k]["measured"]);
    }
    // By error: the same in every frame that has the same camera, and finer than the tolerance asks for.
    let by_error = fly("--geomorph=error:2");
    assert!(by_error.iter().all(|f| n(f, "morphing") > 0));
    assert!(by_error.iter().zip(&plain).all(|(a, b)| n(a, "faces") > n(b, "faces")));
    assert_eq!(by_error[12]["morphing"], by_error[23]["morphing"]);
    assert_eq!(by_error[12]["measured"], by_error[23]["measured"]);
    let most = by_error.iter().map(|f| f["measured"]["max_pixels"].as_f64().unwrap()).fold(0.0, f64::max);
    assert!(most <= 2.0, "{most}");
}

/// Places of the corners of all triangles, whatever their order; each from its least corner on.
fn triangles(p: &Place, file: &str) -> Vec<[[u64; 3]; 3]> {
    p.done(&format!("convert {file} triangles.off -q"));
    let text = p.text("triangles.off");
    let mut numbers = text.lines().skip(1).filter(|l| !l.starts_with('#')).flat_map(str::split_whitespace);
    let mut next = || numbers.next().unwrap().parse::<f64>().unwrap();
    let [vertices, faces, _] = [next(), next(), next()].map(|n| n as usize);
    let places: Vec<[u64; 3]> = (0..vertices).map(|_| [next(), next(), next()].map(f64::to_bits)).collect();
    let mut all: Vec<[[u64; 3]; 3]> = (0..faces)
        .map(|_| {
            assert_eq!(next(), 3.0);
            let mut t = [next(), next(), next()].map(|v| places[v as usize]);
            let least = (0..3).min_by_key(|&k| t[k]).unwrap();
            t.rotate_left(least);
            t
        })
        .collect();
    all.sort_unstable();
    all
}

/// A file read through `--memory` shows what it shows when it is read whole, from a part of its bytes.
#[test]
fn with_a_limit_of_memory_the_same_is_shown_of_fewer_bytes() {
    let p = place();
    p.generate("scan", "in.ply", 20_000);
    p.done("encode in.ply in.pm --paged --any-order -q");
    p.done("extract in.pm whole.ply --camera cam.json -q");
    let r = p.done("extract in.pm paged.ply --camera cam.json --memory 64 --json -q").json();
    assert!(triangles(&p, "whole.ply") == triangles(&p, "paged.ply"));
    let paging = &r["paging"];
    let number = |of: &Value, name: &str| of[name].as_u64().unwrap_or_else(|| panic!("{name} of {of}"));
    assert_eq!(number(paging, "limit_bytes"), 64 << 20);
    assert_eq!(number(paging, "file_bytes"), p.read("in.pm").len() as u64);
    assert!(number(paging, "bytes_touched") <= number(paging, "file_bytes"));
    assert!(number(paging, "most_bytes") < 64 << 20 && number(paging, "chunks_touched") > 0);
    let turned = |x: f64| CAMERA.replace("0.2, 0.3, 2.2", &format!("{x}, 0.3, 2.0"));
    let path: Vec<String> = (0..5).map(|k| turned(0.4 * k as f64 - 0.7)).collect();
    p.write("path.json", format!("[{}]", path.join(",")));
    let flight = "fly in.pm --path path.json --tau 2 --json -q";
    // Not all are counted where none is measured.
    let uncounted = p.done(flight).json();
    assert!(uncounted["frames"][0]["visible_vertices"].is_u64());
    assert!((1..5).all(|k| uncounted["frames"][k]["visible_vertices"].is_null()));
    let counted = format!("{flight} --measure-every 1");
    let (whole, paged) = (p.done(&counted).json(), p.done(&format!("{counted} --memory 64")).json());
    for k in 0..5 {
        for field in ["faces", "vertices", "vsplits", "ecols", "visible_vertices", "complete"] {
            assert_eq!(whole["frames"][k][field], paged["frames"][k][field], "{field} of frame {k}");
        }
    }
    // Circles are about the same box; what is shown is drawn, and measured with a word about the memory that takes.
    let circle = "fly in.pm --path circle --frames 3 --tau 2 --json -q --png-every 2 --png-width 64 --png-to";
    let (whole, paged) =
        (p.done(&format!("{circle} a")).json(), p.done(&format!("{circle} b --memory 64 --strips")).json());
    for k in 0..3 {
        assert_eq!(whole["frames"][k]["faces"], paged["frames"][k]["faces"]);
    }
    assert!(p.read("a/frame00002.png") == p.read("b/frame00002.png") && !p.exists("b/frame00001.png"));
    assert!(paged["strip_length"]["mean"].as_f64().is_some_and(|n| n > 2.0));
    let measure = format!("{flight} --measure-every 2 --samples 2000");
    let (whole, paged) = (p.done(&measure).json(), p.done(&format!("{measure} --memory 64")).json());
    assert_eq!(whole["measured_over_tau"], paged["measured_over_tau"]);
    assert!([&whole, &paged].iter().all(|r| r["rule"] == "rings" && r["above"] == 0));
    p.done(&format!("{flight} --memory 64 --rule rings"));
    assert!(paged["warnings"][0].as_str().is_some_and(|w| w.contains("beyond --memory")));
    // What needs several chunks comes with the frames.
    let fine = flight.replace("--tau 2", "--tau 0.2 --memory 64");
    let (slow, all) = (p.done(&format!("{fine} --fetches 1")).json(), p.done(&fine).json());
    assert!(slow["frames"].as_array().unwrap().iter().all(|f| number(f, "fetched") <= 1));
    assert!(number(&all["frames"][0], "fetched") > 1);
    assert!(number(&slow["frames"][0], "faces") < number(&all["frames"][0], "faces"));
}

/// A file that keeps which way deviations lie shows what is shown when they are found anew.
#[test]
fn directional_errors_come_from_a_file() {
    let p = place();
    p.generate("scan", "in.ply", 4_000);
    p.done("encode in.ply in.pm --bounds --directional --any-order -q");
    let faces = |input: &str, error: &str| {
        let r =
            p.done(&format!("fly {input} --path circle --frames 4 --tau 2 --error {error} --json -q")).json();
        assert_eq!((r["rule"].as_str(), r["error"].as_str()), (Some("rings"), Some(error)));
        r["faces"]["mean"].as_f64().unwrap()
    };
    let kept = faces("in.pm", "directional");
    assert_eq!(kept, faces("in.ply", "directional"));
    assert!(kept < faces("in.pm", "uniform"));
}

/// Geomorphs through `--memory` are those of the whole file, frame by frame.
#[test]
fn with_a_limit_of_memory_changes_morph_as_without() {
    let p = place();
    p.generate("scan", "in.ply", 5_000);
    p.done("encode in.ply in.pm --paged --any-order -q");
    let eye = |k: usize| {
        let (sin, cos) = (0.05 * k.min(8) as f64).sin_cos();
        CAMERA.replace("0.2, 0.3, 2.2", &format!("{}, 0.3, {}", 2.2 * sin, 2.2 * cos))
    };
    p.write("path.json", format!("[{}]", (0..16).map(eye).collect::<Vec<_>>().join(",")));
    let fly = "fly in.pm --path path.json --tau 2 --measure-every 3 --samples 2000 --json -q";
    for how in ["time:5", "error:2"] {
        let flight = format!("{fly} --geomorph={how}");
        let (whole, paged) = (p.done(&flight).json(), p.done(&format!("{flight} --memory 64")).json());
        let mut morphing = 0;
        for k in 0..16 {
            let (a, b) = (&whole["frames"][k], &paged["frames"][k]);
            for field in ["faces", "vertices", "vsplits", "ecols", "visible_vertices", "morphing", "measured"]
            {
                assert_eq!(a[field], b[field], "{field} of frame {k}, {how}");
            }
            morphing += b["morphing"].as_u64().unwrap();
        }
        assert!(morphing > 50, "{morphing}");
        let finest = |r: &Value| r["measured_over_tau"].clone();
        assert_eq!(finest(&whole), finest(&paged));
    }
}

/// Truly selective: the ends are those of the other rules, between them there are fewer faces; a budget is kept, pictures are drawn.
#[test]
fn the_weakest_rule_shows_the_fewest_faces() {
    let p = place();
    p.generate("scan", "in.ply", 6_000);
    p.done("encode in.ply in.pm --bounds -q");
    p.done("convert in.ply same.ply -q");
    let extract = |flags: &str| {
        let r = p.done(&format!("extract in.pm out.ply --camera cam.json --json -q {flags}")).json();
        assert_eq!(p.info("out.ply")["triangles"]["file"], r["faces"], "{flags}");
        let shape = &p.info("out.ply")["meshes"][0];
        let kept = ["manifold", "components", "euler", "border_loops"].map(|k| shape[k].clone());
        assert_eq!(Value::from(kept.to_vec()), serde_json::json!([true, 1, -4, 6]), "{flags}");
        (r["faces"].as_u64().unwrap(), r)
    };
    assert_eq!(extract("--tau 0 --cull none --rule truly").1["guard"]["deferred"], 0);
    assert!(p.read("out.ply") == p.read("same.ply"));
    assert_eq!(extract("--tau inf --rule truly").0, extract("--tau inf").0);
    let (rings, cuts) = (extract("--tau 0.5 --rule rings"), extract("--tau 0.5 --rule cuts"));
    assert_eq!((rings.1["rule"].as_str(), cuts.1["rule"].as_str()), (Some("rings"), Some("cuts")));
    assert_eq!(rings.0, extract("--tau 0.5").0);
    let (guarded, free) = (extract("--tau 0.5 --rule truly"), extract("--tau 0.5 --rule truly --no-guard"));
    assert!(free.0 <= guarded.0 && guarded.0 < rings.0, "{} {} {}", free.0, guarded.0, rings.0);
    assert!(free.1["guard"]["through"] == 0 && free.1["guard"]["turned"] == 0);
    let budget = extract("--tau 0.1 --budget-faces 900 --rule truly --strips").0;
    assert!((600..=900).contains(&budget), "{budget}");
    let run = p.done("fly in.pm --path circle --frames 4 --rule truly --png-every 3 --png-to shots");
    assert!(run.stderr.contains("flip guard") && p.exists("shots/frame00003.png"), "{}", run.stderr);
}

#[test]
fn what_cannot_be_read_in_parts_is_told() {
    let p = place();
    p.generate("scan", "in.ply", 20_000);
    p.done("encode in.ply plain.pm -q");
    p.done("encode in.ply bounded.pm --bounds -q");
    p.done("encode in.ply in.pm --paged -q");
    let whole = p.read("in.pm");
    p.write("cut.pm", &whole[..whole.len() - 100]);
    for (arguments, code, says) in [
        ("extract in.ply out.ply --camera cam.json --memory 64", 2, "progmesh encode in.ply"),
        ("extract plain.pm out.ply --camera cam.json --memory 64", 3, "--paged"),
        ("extract bounded.pm out.ply --camera cam.json --memory 64", 3, "--paged"),
        ("extract cut.pm out.ply --camera cam.json --memory 64", 3, "shorter than it says"),
        ("extract in.pm out.ply --camera cam.json --memory 1", 3, "is too small"),
        ("extract in.pm out.ply --camera cam.json --memory 1", 3, "of which 8 are for other things"),
        ("extract in.pm out.ply --camera cam.json --memory 0", 2, "1 or more"),
        ("fly in.pm --path circle --memory 64 --html none/a.html", 4, "none"),
        ("fly in.pm --path circle --memory 64 --rule truly", 2, "--rule truly"),
        ("fly in.pm --path circle --memory 64 --rule cuts", 3, "for the rule of rings"),
        ("extract in.pm out.ply --camera cam.json --memory 64 --rule cuts", 3, "for the rule of rings"),
        ("fly in.pm --path circle --memory 64 --error directional", 2, "--error directional"),
        ("fly in.pm --path circle --fetches 2", 2, "--memory"),
    ] {
        let run = p.run(arguments);
        assert_eq!(run.code, code, "{arguments}: {}", run.stderr);
        assert!(run.stderr.contains(says), "{arguments}: {}", run.stderr);
    }
}
