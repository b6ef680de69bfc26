//! `fly` as pictures, as a page that plays, and over terrain.

mod common;

use common::Place;
use serde_json::Value;
use std::io::Write;
use std::process::{Command, Stdio};

fn place() -> Place {
    let p = Place::new();
    p.generate("scan", "in.ply", 3000);
    p.done("encode in.ply in.pm -q");
    p
}

/// Frames of a PNG, animated or not, and their sides.
fn frames(bytes: &[u8]) -> (usize, [u32; 2], Vec<Vec<u8>>) {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let count = reader.info().animation_control.map_or(1, |a| a.num_frames) as usize;
    let sides = [reader.info().width, reader.info().height];
    let mut all = Vec::new();
    for _ in 0..count {
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        all.push(pixels);
    }
    (count, sides, all)
}

#[test]
fn a_flight_is_drawn_as_pictures_and_as_an_animation_with_an_inset() {
    let p = place();
    let fly = "fly in.pm --path circle --frames 12 --tau 4 -q";
    p.done(&format!("{fly} --png-every 4 --png-width 160 --png-to shots"));
    let names: Vec<bool> = (0..12).map(|k| p.exists(&format!("shots/frame{k:05}.png"))).collect();
    assert_eq!(names.iter().filter(|n| **n).count(), 3);
    let (_, sides, plain) = frames(&p.read("shots/frame00004.png"));
    assert_eq!(sides, [160, 90]);
    p.done(&format!("{fly} --apng flight.png --png-every 4 --png-width 160"));
    assert!(!p.exists("frames"));
    let (count, sides, all) = frames(&p.read("flight.png"));
    assert_eq!((count, sides), (3, [160, 90]));
    assert!(all[0] != all[1] && all[1] != all[2]);
    // The camera's frustum is drawn in the inset, at the lower right, and nowhere else.
    let red = |pixels: &[u8]| -> Vec<[usize; 2]> {
        let near = |c: &[u8]| c[0] > 150 && c[0] - c[1].min(c[0]) > 60;
        let at = |i: usize| [i % 160, i / 160];
        pixels.chunks_exact(3).enumerate().filter(|(_, c)| near(c)).map(|(i, _)| at(i)).collect()
    };
    assert!(red(&plain[0]).is_empty());
    for picture in &all {
        let inked = red(picture);
        assert!(inked.len() > 20 && inked.iter().all(|p| p[0] > 115 && p[1] > 45), "{inked:?}");
    }
    // Without K, 60 at most, and smaller than the camera's.
    p.done("fly in.pm --path circle --frames 61 --tau 8 --apng all.png --png-width 64 -q");
    assert_eq!(frames(&p.read("all.png")).0, 31);
    p.run("fly in.pm --path circle --apng flight.jpg").failed(2, ".png");
    p.run("fly in.pm --path circle --apng none/flight.png").failed(4, "none");
    p.run("fly in.pm --path circle --apng a.png --png-width 9").failed(2, "--png-width 9");
}

/// Frames and faces by tolerance, as the page's own script reads them; `None` without node.
fn played(page: &str) -> Option<Value> {
    let script = page.split("<script>\n").nth(1).unwrap().split("</script>").next().unwrap();
    let decoder = script.split("// Draws a recording").next().unwrap();
    let data = page.split("id=\"flight\">").nth(1).unwrap().split('<').next().unwrap();
    let program = format!(
        "{decoder}
        readRecording(bytesOf({data:?})).then(({{ header, tracks, places }}) => {{
          const faces = (t) => t.meshes.reduce((sum, m) => {{
            for (let s = 0; s < m.slots; s++) {{
              const [a, b, c] = m.corners.subarray(3 * s, 3 * s + 3);
              if (a !== b) {{
                sum++;
                for (const v of [a, b, c]) {{
                  const k = m.at[v];
                  if (!(3 * k + 2 < places[t.meshes.indexOf(m)].length)) throw new Error('no place ' + k);
                }}
              }}
            }}
            return sum;
          }}, 0);
          const state = (t) => JSON.stringify(t.meshes.map((m) => [m.slots, [...m.corners.subarray(0, 3 * m.slots)], [...m.at]]));
          const out = tracks.map((t, k) => {{
            const all = [];
            const seen = [];
            for (let f = 0; f < header.cameras.length; f++) {{
              t.seek(f);
              all.push(faces(t));
              seen.push(state(t));
            }}
            // Backwards, and to and fro, gives the same.
            for (let i = 0; i < 3 * seen.length; i++) {{
              const f = (i * 7 + 3) % seen.length;
              t.seek(f);
              if (state(t) !== seen[f]) throw new Error('frame ' + f + ' differs');
            }}
            return {{ tau: header.tracks[k].tau, faces: all }};
          }});
          process.stdout.write(JSON.stringify(out));
        }});"
    );
    let mut node = Command::new("node")
        .arg("-")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .ok()?;
    node.stdin.take().unwrap().write_all(program.as_bytes()).unwrap();
    let out = node.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    // One that is too old for DecompressionStream.
    if said.contains("DecompressionStream is not defined") {
        return None;
    }
    Some(serde_json::from_slice(&out.stdout).unwrap_or_else(|e| panic!("{e}: {said}")))
}

#[test]
fn a_page_plays_what_was_flown_at_every_tolerance() {
    let p = place();
    let fly = "fly in.pm --path circle --frames 70 --json -q";
    let faces = |flags: &str| -> Vec<u64> {
        let r = p.done(&format!("{fly} {flags}")).json();
        r["frames"].as_array().unwrap().iter().map(|f| f["faces"].as_u64().unwrap()).collect()
    };
    let flown = faces("--tau 2 --html a.html --html-taus 0.5,1,4");
    let page = p.text("a.html");
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("<title>in.pm</title>"));
    assert!(!page.contains("http:") && !page.contains("https:") && !page.contains(" src="));
    assert_eq!(p.files().iter().filter(|f| f.ends_with(".html")).count(), 1);
    match played(&page) {
        None => eprintln!("no node: the page's script was not run"),
        Some(played) => {
            let of = |v: &Value| {
                v["faces"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect::<Vec<_>>()
            };
            let tracks = played.as_array().unwrap();
            let taus: Vec<f64> = tracks.iter().map(|t| t["tau"].as_f64().unwrap()).collect();
            assert_eq!(taus, [1.0, 2.0, 8.0]);
            assert_eq!(of(&tracks[1]), flown);
            assert_eq!(of(&tracks[0]), faces("--tau 1"));
            assert_eq!(of(&tracks[2]), faces("--tau 8"));
        }
    }
    // Fewer frames, with vertices on the way, on any number of threads.
    let every = faces("--tau 4 --geomorph=time:5 --threads 1 --html b.html --html-taus 1 --html-frames 24");
    p.done(&format!(
        "{fly} --tau 4 --geomorph=time:5 --threads 3 --html c.html --html-taus 1 --html-frames 24"
    ));
    assert!(p.read("b.html") == p.read("c.html"));
    if let Some(played) = played(&p.text("b.html")) {
        let want: Vec<u64> = every.into_iter().step_by(3).collect();
        let have: Vec<u64> =
            played[0]["faces"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
        assert_eq!(have, want);
    }
}

/// With `--memory` a page plays what was flown, too.
#[test]
fn a_page_plays_what_was_flown_out_of_core() {
    let p = Place::new();
    p.generate("scan", "in.ply", 3000);
    p.done("encode in.ply in.pm --paged --any-order -q");
    let fly = "fly in.pm --path circle --frames 20 --tau 2 --memory 64 --geomorph=time:4 --json -q";
    let r = p.done(&format!("{fly} --html a.html --html-taus 1,4")).json();
    assert!(r["warnings"].to_string().contains("--html-max"), "{}", r["warnings"]);
    let flown: Vec<u64> =
        r["frames"].as_array().unwrap().iter().map(|f| f["faces"].as_u64().unwrap()).collect();
    let page = p.text("a.html");
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("<title>in.pm</title>"));
    match played(&page) {
        None => eprintln!("no node: the page's script was not run"),
        Some(played) => {
            let have: Vec<u64> =
                played[0]["faces"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
            assert_eq!((played.as_array().unwrap().len(), have), (2, flown));
        }
    }
}

#[test]
fn a_page_that_would_be_too_large_is_refused() {
    let p = Place::new();
    p.generate("scan", "in.ply", 60_000);
    p.done("encode in.ply in.pm -q");
    let fly = "fly in.pm --path circle --frames 40 --tau 0.2 --html a.html --html-max 1";
    let run = p.run(&format!("{fly} --html-taus 1"));
    run.failed(4, "--html-max 1 MiB");
    assert!(run.stderr.contains("--html-frames 20") && !p.exists("a.html"), "{}", run.stderr);
    p.run("fly in.pm --path circle --html none/a.html").failed(4, "none");
    p.run("fly in.pm --path circle --html a.html --html-taus 0").failed(2, "multiples");
    p.run("fly in.pm --path circle --html-taus 1").failed(2, "--html");
}

#[test]
fn a_terrain_is_measured_against_its_grid() {
    let p = Place::new();
    p.done("generate terrain grid.tif --size 65 --seed 3 -q");
    for (space, flags) in [("grid", ""), ("world", "--spacing 20,20 --exaggeration 2")] {
        p.done(&format!(
            "terrain tin grid.tif mesh.ply --max-error 0.5 --on-samples --space {space} {flags} -q"
        ));
        let fly = format!(
            "fly mesh.ply --placement endpoint --lock-border --grid grid.tif {flags} --measure-every 3 --json -q"
        );
        for path in ["circle", "lemniscate"] {
            // What bounds distances from the finest mesh promises nothing about heights above a sample this near.
            let run = p.run(&format!("{fly} --path {path} --path-speed fast --frames 9 --tau 40"));
            assert!(run.code == 0 || run.code == 1, "{}", run.stderr);
            let r = run.json();
            let judged: Vec<&Value> =
                r["frames"].as_array().unwrap().iter().filter(|f| !f["on_ground"].is_null()).collect();
            assert_eq!(judged.len(), 3);
            assert!(judged.iter().all(|f| f["on_ground"]["samples"].as_u64().unwrap() > 0), "{r}");
            assert!(judged.iter().all(|f| f["measured"].is_null()));
            assert_eq!((r["cracks"].as_u64(), r["uncovered"].as_u64()), (Some(0), Some(0)));
        }
        // At full detail heights are within the network's error.
        let r = p.done(&format!("{fly} --path circle --frames 1 --tau 0 --cull none")).json();
        let height = r["frames"][0]["on_ground"]["max_height"].as_f64().unwrap();
        assert!(height > 0.0 && height <= 0.5 + 1e-3, "{height}");
    }
    // A path of the unit terrain, above its mountains.
    p.write("unit.frames", "F 0  0 0.1 -0.995  -1 0 0  0 0.995 0.1  0.5 0.2 5.5  0.5\n");
    let r = p.done("fly mesh.ply --grid grid.tif --spacing 20,20 --exaggeration 2 --path unit.frames --measure-every 1 --tau 0 --cull frustum --json -q").json();
    assert!(r["frames"][0]["on_ground"]["samples"].as_u64().unwrap() > 200, "{r}");
    p.generate("scan", "scan.ply", 200);
    p.run("fly scan.ply --path circle --grid grid.tif").failed(3, "is not where a mesh of grid.tif stands");
    p.run("fly scan.ply --path circle --grid none.tif").failed(3, "none.tif");
    p.run("fly scan.ply --path circle --path-speed fast").failed(2, "--grid");
    p.run("fly scan.ply --path cirlce").failed(3, "--path takes circle, lemniscate or a file");
    p.run("fly scan.ply --path circle --grid grid.tif --path-speed 0").failed(2, "slow, fast");
}

#[test]
fn matrices_that_place_nothing_are_refused() {
    let p = Place::new();
    p.generate("sphere", "in.glb", 200);
    p.done("convert in.glb in.gltf -q");
    let mut d: Value = serde_json::from_str(&p.text("in.gltf")).unwrap();
    d["cameras"] = serde_json::json!([{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}]);
    let place = |d: &Value, scale: Value, mesh: Value| {
        let mut d = d.clone();
        d["nodes"] = serde_json::json!([{"mesh": 0, "scale": mesh}, {"camera": 0, "scale": scale, "translation": [0, 0, 4]}]);
        d["scenes"] = serde_json::json!([{"nodes": [0, 1]}]);
        p.write("x.gltf", d.to_string());
    };
    let one = serde_json::json!([1, 1, 1]);
    place(&d, one.clone(), one.clone());
    p.done("extract x.gltf out.ply --camera x.gltf -q");
    std::fs::remove_file(p.path("out.ply")).unwrap();
    place(&d, serde_json::json!([1, 1, 0]), one.clone());
    p.run("extract x.gltf out.ply --camera x.gltf").failed(3, "nodes[1]: the camera's transform");
    place(&d, one, serde_json::json!([1, 0, 1]));
    p.run("extract x.gltf out.ply --camera x.gltf").failed(3, "flattens it");
    p.run("fly x.gltf --path circle --frames 2").failed(3, "flattens it");
    // Lines whose numbers are none, and an angle that is none.
    p.write("nan.frames", "F 0  nan 0 1  1 0 0  0 1 0  0 0 0  0.5\n");
    p.write("zoom.frames", "F 0  0 0 1  1 0 0  0 1 0  0 0 0  0\n");
    p.run("fly in.glb --path nan.frames").failed(3, "nan.frames: line 1: nan: must be a number");
    p.run("fly in.glb --path zoom.frames").failed(3, "zoom.frames: line 1: zoom is 0");
    assert!(!p.exists("out.ply"));
}

#[test]
fn what_views_share_takes_at_most_64_bytes_a_vertex_with_normals() {
    let p = Place::new();
    p.generate("scan", "in.ply", 12000);
    p.done("convert in.ply n.ply --normals recompute -q");
    p.done("encode n.ply n.pm -q");
    for from in ["n.pm", "n.ply --placement optimal", "n.ply --placement endpoint"] {
        let r = p.done(&format!("fly {from} --path circle --frames 2 --json -q")).json();
        let each = r["memory"]["shared_bytes_per_vertex"].as_f64().unwrap();
        assert!(each > 30.0 && each <= 64.0, "{from}: {each}");
    }
}
