//! `compare`, and what `simplify` measures, end to end.

mod common;

use common::Place;
use serde_json::Value;

/// Two triangles of a square in the plane z = `z`, as OBJ.
fn square(z: f64) -> String {
    format!("v 0 0 {z}\nv 1 0 {z}\nv 1 1 {z}\nv 0 1 {z}\nf 1 2 3\nf 1 3 4\n")
}

/// The vertices of an OBJ times `factor`.
fn scaled(obj: &str, factor: f64) -> String {
    let line = |l: &str| match l.strip_prefix("v ") {
        Some(rest) => {
            let numbers: Vec<String> =
                rest.split_whitespace().map(|x| (x.parse::<f64>().unwrap() * factor).to_string()).collect();
            format!("v {}\n", numbers.join(" "))
        }
        None => format!("{l}\n"),
    };
    obj.lines().map(line).collect()
}

fn number(v: &Value, pointer: &str) -> f64 {
    v.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer}: {v}"))
}

fn near(v: &Value, pointer: &str, want: f64, off: f64) {
    let got = number(v, pointer);
    assert!((got - want).abs() <= off, "{pointer}: {got}, not {want}");
}

/// Width, height and pixels of a PNG.
fn decoded(bytes: &[u8]) -> (u32, u32, Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut data = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut data).unwrap();
    (info.width, info.height, data.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
}

#[test]
fn parallel_squares_are_as_far_as_their_planes() {
    let p = Place::new();
    p.write("a.obj", square(0.0));
    p.write("b.obj", square(0.25));
    let v = p.done("compare a.obj b.obj --json --certify 1e-6 --samples 5000").json();
    for side in ["a_to_b", "b_to_a", "worse"] {
        for field in ["max", "rms", "mean", "quantiles/p50", "quantiles/p999"] {
            near(&v, &format!("/{side}/{field}"), 0.25, 1e-12);
        }
    }
    near(&v, "/relative/max", 0.25 / 2f64.sqrt(), 1e-12);
    assert!(number(&v, "/certified/lower") <= 0.25 && number(&v, "/certified/upper") >= 0.25);
    assert!(number(&v, "/certified/upper") - number(&v, "/certified/lower") <= 1e-6 * 2f64.sqrt());
    near(&v, "/a_to_b/farthest/closest/2", 0.25, 1e-12);
    let text = p.done("compare a.obj b.obj --samples 5000").stdout;
    assert!(text.contains("worse / diagonal") && text.contains("0.25") && text.contains("17.68 %"), "{text}");
}

#[test]
fn a_sphere_is_as_far_from_a_larger_one_as_their_radii() {
    let p = Place::new();
    p.generate("sphere", "a.obj", 2000);
    p.write("b.obj", scaled(&p.text("a.obj"), 1.1));
    let v = p.done("compare a.obj b.obj --json --samples 20000").json();
    let radius = number(&p.info("a.obj"), "/meshes/0/bounds/1/0");
    // A vertex of the larger is a tenth of the radius from the smaller; between vertices it is less.
    near(&v, "/b_to_a/max", 0.1 * radius, 1e-3 * radius);
    near(&v, "/a_to_b/mean", 0.1 * radius, 2e-3 * radius);
    near(&v, "/worse/rms", 0.1 * radius, 2e-3 * radius);
}

#[test]
fn a_mesh_is_at_no_distance_from_itself_in_any_form() {
    let p = Place::new();
    p.generate("torus", "a.obj", 800);
    p.done("convert a.obj b.glb -q");
    let v = p.done("compare a.obj a.obj --json --certify 1e-6 --threshold 1e-9 --samples 3000").json();
    near(&v, "/worse/max", 0.0, 1e-14);
    let v = p.done("compare a.obj b.glb --json --samples 3000").json();
    near(&v, "/worse/max", 0.0, 1e-6);
    // Quadrilaterals are measured as the triangles they are.
    p.generate("quad-sphere", "q.obj", 200);
    p.done("convert q.obj t.obj --triangulate -q");
    let v = p.done("compare q.obj t.obj --json --samples 3000").json();
    near(&v, "/worse/max", 0.0, 1e-12);
    assert_eq!(v["triangles"][0], v["triangles"][1]);
}

#[test]
fn scenes_are_measured_as_they_stand() {
    let p = Place::new();
    p.write("a.obj", square(0.0));
    let gltf = |z: f64| {
        let bytes: Vec<u8> =
            [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect();
        use base64::Engine;
        let data = base64::engine::general_purpose::STANDARD.encode(bytes);
        serde_json::json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"translation": [0, 0, z], "children": [1]}, {"mesh": 0, "scale": [1, 1, 5]}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
            "bufferViews": [{"buffer": 0, "byteLength": 72}],
            "buffers": [{"byteLength": 72, "uri": format!("data:application/octet-stream;base64,{data}")}]
        })
        .to_string()
    };
    p.write("b.gltf", gltf(-0.5));
    let v = p.done("compare a.obj b.gltf --json --samples 1000").json();
    near(&v, "/worse/max", 0.5, 1e-7);
    near(&v, "/worse/mean", 0.5, 1e-7);
}

#[test]
fn the_exit_code_tells_whether_the_threshold_is_passed() {
    let p = Place::new();
    p.write("a.obj", square(0.0));
    p.write("b.obj", square(0.25));
    let few = "--samples 1000";
    p.done(&format!("compare a.obj b.obj {few} --threshold 0.26"));
    p.run(&format!("compare a.obj b.obj {few} --threshold 0.24")).failed(1, "is above the threshold 0.24");
    // 0.25 is 0.177 of the diagonal.
    p.done(&format!("compare a.obj b.obj {few} --threshold 0.18 --relative"));
    p.run(&format!("compare a.obj b.obj {few} --threshold 0.17 --relative")).failed(1, "threshold");
    let run = p.run(&format!("compare a.obj b.obj {few} --threshold 0.24 --certify 1e-4 --json"));
    run.failed(1, "proven");
    let v = run.json();
    assert_eq!(
        (v["threshold"]["of"].as_str(), v["threshold"]["exceeded"].as_bool()),
        (Some("certified"), Some(true))
    );
    p.run("compare a.obj b.obj --relative").failed(2, "--threshold");
}

#[test]
fn the_same_numbers_for_every_number_of_threads_and_other_ones_for_another_seed() {
    let p = Place::new();
    p.generate("scan", "a.ply", 4000);
    p.done("simplify a.ply b.ply --ratio 0.2 -q");
    let numbers = |arguments: &str| {
        let mut v =
            p.done(&format!("compare a.ply b.ply --json --samples 5000 --certify 1e-3 {arguments}")).json();
        for name in ["seconds", "peak_bytes", "seed"] {
            v.as_object_mut().unwrap().remove(name);
        }
        v
    };
    let one = numbers("--threads 1");
    assert_eq!(one, numbers("--threads 2"));
    assert_ne!(one["worse"]["mean"], numbers("--seed 2")["worse"]["mean"]);
    let pictures = |n: u32| {
        p.done(&format!("compare a.ply b.ply -q --samples 500 --heatmap h.png --heatmap h.ply --heatmap h.glb --threads {n}"));
        ["h.png", "h.ply", "h.glb"].map(|f| p.read(f))
    };
    assert_eq!(pictures(1), pictures(2));
}

#[test]
fn heat_maps_hold_the_distance_as_colour_and_number() {
    let p = Place::new();
    p.write("a.obj", square(0.0));
    // B is tilted: at distance 0 along x = 0, farthest along x = 1.
    p.write("b.obj", "v 0 0 0\nv 1 0 0.5\nv 1 1 0.5\nv 0 1 0\nf 1 2 3\nf 1 3 4\n");
    p.done("compare a.obj b.obj -q --samples 1000 --heatmap h.ply --heatmap h.glb");
    let ply = p.read("h.ply");
    let head = String::from_utf8_lossy(&ply[..ply.len().min(1500)]).into_owned();
    assert!(
        head.contains("comment last_color_at 0.4472") && head.contains("comment unit \"model units\""),
        "{head}"
    );
    p.done("convert h.ply h.obj -q");
    for file in ["h.ply", "h.glb"] {
        let info = p.info(file);
        let names: Vec<_> = info["meshes"][0]["attributes"]
            .as_array()
            .unwrap()
            .iter()
            .map(|a| a["name"].to_string())
            .collect();
        assert!(names.iter().any(|n| n.contains("colour")), "{names:?}");
        assert!(names.iter().any(|n| n.to_lowercase().contains("quality")), "{names:?}");
        // Two triangles would have no colours between their corners.
        assert!(info["meshes"][0]["triangles"].as_u64().unwrap() > 1000);
    }
    // The same surface, whatever was cut.
    let v = p.done("compare a.obj h.ply --json --samples 1000").json();
    near(&v, "/worse/max", 0.0, 1e-12);
    // Vertices of our OBJ have their colours behind them: dark where near, bright where far.
    let light = |x: f64| -> f64 {
        let text = p.text("h.obj");
        let vertices = text
            .lines()
            .filter_map(|l| l.strip_prefix("v "))
            .map(|l| l.split_whitespace().map(|n| n.parse().unwrap()).collect::<Vec<f64>>());
        let at: Vec<f64> = vertices.filter(|v| (v[0] - x).abs() < 1e-6).map(|v| v[3] + v[4] + v[5]).collect();
        assert!(!at.is_empty(), "{x}");
        at.iter().sum::<f64>() / at.len() as f64
    };
    assert!(light(0.0) < light(0.5) && light(0.5) < light(1.0));
    // The document says what colours mean.
    let glb = p.read("h.glb");
    assert!(String::from_utf8_lossy(&glb).contains("\"last_color_at\":0.4472"));
}

#[test]
fn the_picture_has_three_panels_and_a_legend() {
    let p = Place::new();
    p.generate("torus", "a.obj", 4000);
    p.done("simplify a.obj b.obj --ratio 0.05 -q");
    p.done("compare a.obj b.obj -q --samples 1000 --heatmap h.png");
    let (width, height, pixels) = decoded(&p.read("h.png"));
    assert_eq!((width, height), (3 * 480 + 132, 450));
    let colored = |range: std::ops::Range<u32>| {
        let inside = |i: &usize| range.contains(&(*i as u32 % width)) && *i as u32 / width > 60;
        (0..pixels.len())
            .filter(inside)
            .filter(|&i| {
                let [r, g, b] = pixels[i].map(i32::from);
                (r - g).abs().max((g - b).abs()) > 40
            })
            .count()
    };
    assert_eq!((colored(0..480), colored(480..960)), (0, 0));
    assert!(colored(960..1440) > 20_000 && colored(1440..width) > 3000);
    // The last colour can be chosen: with a far one, all is dark.
    p.done("compare a.obj b.obj -q --samples 1000 --heatmap dark.png --heatmap-max 100");
    let dark = decoded(&p.read("dark.png")).2;
    let sum = |p: &[[u8; 3]]| p.iter().flatten().map(|&b| b as u64).sum::<u64>();
    assert!(sum(&dark) < sum(&pixels));
}

#[test]
fn the_page_stands_alone() {
    let p = Place::new();
    p.generate("sphere", "a&b.obj", 500);
    p.done("simplify a&b.obj b.obj --ratio 0.1 -q");
    p.done("compare a&b.obj b.obj -q --samples 1000 --certify 1e-3 --heatmap h.html");
    let html = p.text("h.html");
    for outside in ["http:", "https:", "//www", "<link", "<script", "url("] {
        assert!(!html.contains(outside), "{outside}");
    }
    assert_eq!(html.matches("src=\"data:image/png;base64,").count(), 7);
    assert!(
        html.contains("a&amp;b.obj")
            && html.contains("proven largest distance")
            && html.contains("prefers") | html.contains("color-scheme")
    );
    use base64::Engine;
    let first = html.split("base64,").nth(1).unwrap().split('"').next().unwrap();
    let png = base64::engine::general_purpose::STANDARD.decode(first).unwrap();
    assert_eq!(decoded(&png).0, 3 * 480 + 132);
}

#[test]
fn what_cannot_be_compared_is_said() {
    let p = Place::new();
    p.write("a.obj", square(0.0));
    p.write("none.off", "OFF\n0 0 0\n");
    p.write("bad.off", "OFF\n1 1 0\n0 0 0\n3 0 1 2\n");
    p.run("compare a.obj none.off").failed(3, "none.off: no triangle");
    p.run("compare bad.off a.obj").failed(3, "bad.off");
    p.run("compare a.obj missing.obj").failed(3, "missing.obj");
    p.run("compare - - --from obj").failed(2, "standard input");
    p.run("compare a.obj a.obj --heatmap x.jpg").failed(2, ".html");
    p.run("compare a.obj a.obj --heatmap-max 1").failed(2, "--heatmap");
    p.run("compare a.obj a.obj --samples 0").failed(2, "1 or more");
    p.write("directory/x", "");
    p.run("compare a.obj a.obj --heatmap directory/x/h.png").failed(4, "h.png");
    let run = p.run_with("compare - a.obj --from obj --samples 100", square(0.5));
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stdout.contains("standard input"), "{}", run.stdout);
}

#[test]
fn simplify_measures_its_result() {
    let p = Place::new();
    p.generate("scan", "a.ply", 4000);
    let v = p.simplify("a.ply b.ply --ratio 0.2 --measure");
    let c = p.done("compare a.ply b.ply --json").json();
    for name in ["max", "rms", "mean"] {
        // The file is rounded to f32, as the result was.
        let (m, w) = (number(&v, &format!("/measured/{name}")), number(&c, &format!("/worse/{name}")));
        assert!((m - w).abs() <= 1e-6 * w, "{name}: {m} {w}");
    }
    assert!(v["certified"].is_null());
    assert!(p.simplify("a.ply b.ply --ratio 0.2")["measured"].is_null());
}

#[test]
fn a_certified_error_is_kept_and_nearly_used_up() {
    let p = Place::new();
    p.generate("sphere", "a.ply", 5000);
    let v = p.simplify("a.ply b.ply --max-error 0.004 --relative --certified --measure");
    let bound = number(&v, "/certified/bound");
    assert!(number(&v, "/certified/upper") <= bound && number(&v, "/measured/max") <= bound);
    assert_eq!(v["stop"], "error");
    p.done("compare a.ply b.ply --certify 1e-5 --threshold 0.004 --relative --samples 1000 -q");
    // Much fewer triangles do not pass.
    let n = v["faces_out"].as_u64().unwrap();
    assert!(n < 2500, "{n}");
    p.done(&format!("simplify a.ply c.ply --triangles {} -q", n * 10 / 11));
    p.run("compare a.ply c.ply --certify 1e-5 --threshold 0.004 --relative --samples 1000 -q")
        .failed(1, "threshold");
    // A target ends the search from below; nothing but the input itself is at distance 0.
    let v = p.simplify("a.ply b.ply --max-error 0.004 --relative --certified --ratio 0.8");
    assert_eq!(
        (v["faces_out"].as_u64(), v["stop"].as_str()),
        (v["faces_in"].as_u64().map(|n| n * 8 / 10), Some("target"))
    );
    let v = p.simplify("a.ply b.ply --max-error 0 --certified");
    assert_eq!(v["faces_out"], v["faces_in"]);
    p.run("simplify a.ply b.ply --ratio 0.5 --certified").failed(2, "--max-error");
}

#[test]
fn a_scene_is_certified_as_it_stands() {
    let p = Place::new();
    p.generate("torus", "a.obj", 1500);
    let (a, n) = (p.text("a.obj"), p.info("a.obj")["meshes"][0]["vertices"].as_u64().unwrap());
    // Two objects, the second turned inside out into another place.
    let mut two = format!("o one\n{a}o two\n");
    for line in a.lines() {
        if let Some(rest) = line.strip_prefix("v ") {
            let x: Vec<f64> = rest.split_whitespace().map(|x| x.parse().unwrap()).collect();
            two += &format!("v {} {} {}\n", x[0] + 5.0, x[1], x[2]);
        } else if let Some(rest) = line.strip_prefix("f ") {
            let corner = |c: &str| (c.split('/').next().unwrap().parse::<u64>().unwrap() + n).to_string();
            let corners: Vec<String> = rest.split_whitespace().map(corner).collect();
            two += &format!("f {}\n", corners.join(" "));
        }
    }
    p.write("two.obj", two);
    p.done("convert two.obj two.glb -q");
    let v = p.simplify("two.glb b.glb --max-error 0.05 --certified");
    assert!(v["faces_out"].as_u64() < v["faces_in"].as_u64());
    p.done("compare two.glb b.glb --certify 1e-5 --threshold 0.05 --samples 1000 -q");
}
