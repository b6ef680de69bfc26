//! `encode`, `decode`, `lod` and `morph`, end to end.

mod common;

use common::Place;
use serde_json::Value;

/// The JSON of a GLB.
fn document(glb: &[u8]) -> Value {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&glb[20..20 + length]).unwrap()
}

#[test]
fn full_detail_is_what_convert_would_write_byte_for_byte() {
    for (name, ending, faces) in [
        ("scan", "ply", 3000),
        ("quad-sphere", "obj", 600),
        ("polygons", "off", 800),
        ("cad", "glb", 1500),
        ("nonmanifold", "obj", 300),
        ("terrain", "stl", 900),
    ] {
        let p = Place::new();
        p.generate(name, &format!("in.{ending}"), faces);
        std::fs::create_dir_all(p.path("a")).unwrap();
        std::fs::create_dir_all(p.path("b")).unwrap();
        for how in ["", "--method nsa --epsilon 40", "--placement endpoint --schedule exact"] {
            p.done(&format!("encode in.{ending} in.pm {how}"));
            p.done(&format!("decode in.pm a/x.{ending} -q"));
            p.done(&format!("convert in.{ending} b/x.{ending} -q"));
            let same = p.read(&format!("a/x.{ending}")) == p.read(&format!("b/x.{ending}"));
            assert!(same, "{name} {how}");
            // A .pm is a mesh wherever one is asked for.
            p.done(&format!("convert in.pm b/x.{ending} -q"));
            let same = p.read(&format!("a/x.{ending}")) == p.read(&format!("b/x.{ending}"));
            assert!(same, "{name} {how}: read by another command");
        }
    }
}

#[test]
fn the_scene_around_the_meshes_comes_back() {
    let p = Place::new();
    p.write("t.mtl", "newmtl red\nKd 1 0 0\nNs 12\nmap_Kd t.png\nnewmtl blue\nKd 0 0 1\n");
    p.write("t.png", b"\x89PNG\r\n\x1a\nnot really");
    let mut obj = String::from("mtllib t.mtl\no first\n");
    for y in 0..9 {
        for x in 0..9 {
            obj += &format!("v {x} {y} {}\nvt {} {}\n", (x * y) % 5, x as f32 / 8.0, y as f32 / 8.0);
        }
    }
    for y in 0..8 {
        obj += if y % 2 == 0 { "g even\nusemtl red\n" } else { "g odd more\nusemtl blue\n" };
        for x in 0..8 {
            let a = y * 9 + x + 1;
            let (b, c, d) = (a + 1, a + 10, a + 9);
            obj += &format!("f {a}/{a} {b}/{b} {c}/{c} {d}/{d}\n");
        }
    }
    // No mesh holds these.
    obj += "f 1/1 1/2 2/3\nf 3 3 3 4\n";
    p.write("t.obj", obj);
    let run = p.done("encode t.obj t.pm");
    assert!(run.stderr.contains("2 faces with fewer than three distinct corners"), "{}", run.stderr);
    for directory in ["a", "b"] {
        std::fs::create_dir_all(p.path(directory)).unwrap();
    }
    for ending in ["obj", "glb", "ply"] {
        p.done(&format!("decode t.pm a/t.{ending} -q"));
        p.done(&format!("convert t.obj b/t.{ending} -q"));
        assert_eq!(p.read(&format!("a/t.{ending}")), p.read(&format!("b/t.{ending}")), "{ending}");
    }
    for beside in ["t.mtl", "t.png"] {
        assert_eq!(p.read(&format!("a/{beside}")), p.read(&format!("b/{beside}")), "{beside}");
    }
}

/// A PLY whose faces have a number, flags and a quality; one vertex has no face, one face no area.
fn valued_ply() -> Vec<u8> {
    let n = 12u32;
    let mut out = b"ply\nformat binary_little_endian 1.0\nelement vertex 145\nproperty float x\nproperty float y\nproperty float z\nproperty int flags\nproperty float quality\nelement face 223\nproperty list uchar int vertex_indices\nproperty int id\nproperty uchar flags\nproperty double quality\nend_header\n".to_vec();
    for v in 0..n * n + 1 {
        let (x, y) = ((v % n) as f32, (v / n) as f32);
        [x, y, (x * 1.3).sin() + (y * 0.7).cos()].iter().for_each(|c| out.extend(c.to_le_bytes()));
        out.extend((v as i32 - 70).to_le_bytes());
        out.extend((v as f32 / 7.0).to_le_bytes());
    }
    let mut id = 0u32;
    let mut face = |corners: &[u32]| {
        out.push(corners.len() as u8);
        corners.iter().for_each(|c| out.extend(c.to_le_bytes()));
        out.extend(id.to_le_bytes());
        out.push((id % 251) as u8);
        out.extend((id as f64 / 3.0).to_le_bytes());
        id += 1;
    };
    for y in 0..n - 1 {
        for x in 0..n - 1 {
            let a = y * n + x;
            match (x + y) % 6 {
                0 => face(&[a, a + 1, a + n + 1, a + n]),
                _ => [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]].iter().for_each(|f| face(f)),
            }
        }
    }
    face(&[5, 5, 6]);
    let count = id;
    let header = format!("element face {count}\n").into_bytes();
    let at = out.windows(13).position(|w| w == b"element face ").unwrap();
    out.splice(at..at + 17, header);
    out
}

#[test]
fn values_of_faces_and_of_vertices_without_a_face_come_back() {
    let p = Place::new();
    p.write("in.ply", valued_ply());
    p.done("convert in.ply same.ply");
    let run = p.done("encode in.ply in.pm --placement endpoint");
    assert!(!run.stderr.contains("left out"), "{}", run.stderr);
    p.done("decode in.pm back.ply -q");
    assert!(p.read("back.ply") == p.read("same.ply"));
    assert!(p.read("same.ply") == valued_ply(), "nothing is lost, nothing moved");
    // A coarser mesh: every face has the values of a face of the input, no two (polygons apart) the same.
    for command in
        ["decode in.pm few.ply --triangles 60 --text", "simplify in.ply few.ply --triangles 60 --text"]
    {
        p.done(command);
        let text = String::from_utf8(p.read("few.ply")).unwrap();
        let count = |what: &str| -> usize {
            let line = text.lines().find(|l| l.starts_with(what)).unwrap();
            line.rsplit(' ').next().unwrap().parse().unwrap()
        };
        let (vertices, faces) = (count("element vertex"), count("element face"));
        let body = text.split_once("end_header\n").unwrap().1;
        let mut seen = std::collections::BTreeMap::new();
        for line in body.lines().skip(vertices) {
            let words: Vec<f64> = line.split(' ').map(|w| w.parse().unwrap()).collect();
            let &[id, flags, quality] = &words[words.len() - 3..] else { panic!("{line}") };
            assert_eq!((flags, quality), (id % 251.0, id / 3.0), "{command}: {line}");
            *seen.entry(id as u32).or_insert(0) += 1;
        }
        assert!((20..=60).contains(&faces) && seen.values().sum::<usize>() == faces);
        assert!(seen.values().all(|&n| n <= 2));
    }
    let run = p.done("convert in.pm out.obj");
    assert!(run.stderr.contains("values of faces flags, id, quality are left out"), "{}", run.stderr);
    let run = p.done("encode in.ply any.pm --any-order");
    assert!(run.stderr.contains("values of faces"), "{}", run.stderr);
    p.done("decode any.pm any.ply -q");
}

#[test]
fn a_gltf_document_survives() {
    let p = Place::new();
    p.generate("torus", "in.glb", 800);
    // With things this program knows nothing of.
    p.done("convert in.glb plain.gltf -q");
    let mut json: Value = serde_json::from_str(&p.text("plain.gltf")).unwrap();
    json["nodes"][0]["translation"] = serde_json::json!([1.0, 2.0, 3.0]);
    json["nodes"][0]["extras"] = serde_json::json!({"a": [1, {"b": "c"}]});
    json["cameras"] =
        serde_json::json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    p.write("plain.gltf", json.to_string());
    p.done("encode plain.gltf in.pm -q");
    p.done("decode in.pm a.glb -q");
    p.done("convert plain.gltf b.glb -q");
    assert_eq!(p.read("a.glb"), p.read("b.glb"));
    assert!(document(&p.read("a.glb"))["cameras"].is_array());
}

#[test]
fn every_detail_can_be_asked_for() {
    let p = Place::new();
    p.generate("scan", "in.ply", 2000);
    let made = p.done("encode in.ply in.pm --method nsa --json").json();
    let (full, base) = (made["triangles"].as_u64().unwrap(), made["base_triangles"].as_u64().unwrap());
    let decode = |how: &str| p.done(&format!("decode in.pm out.ply --json -q {how}")).json();
    let triangles = |how: &str| decode(how)["triangles"].as_u64().unwrap();
    assert_eq!((triangles(""), triangles("--full"), triangles("--level 0")), (full, full, base));
    let half = triangles("--ratio 0.5");
    assert!(half <= full.div_ceil(2) && half + 2 >= full / 2, "{half} of {full}");
    assert!((998..=1000).contains(&triangles("--triangles 1000")));
    assert_eq!(triangles("--max-error 0"), full);
    let estimate = made["estimate"].as_f64().unwrap();
    let at = |part: f64| triangles(&format!("--max-error {}", part * estimate));
    let (fine, coarse) = (at(0.01), at(0.3));
    assert!(base <= coarse && coarse < fine && fine <= full, "{base} {coarse} {fine} {full}");
    // NSA's passes are levels.
    let passes = p.done("simplify in.ply x.ply --method nsa --json -q").json();
    let passes: Vec<u64> =
        passes["levels"].as_array().unwrap().iter().rev().map(|l| l["faces"].as_u64().unwrap()).collect();
    assert!(made["levels"].as_u64().unwrap() >= 3);
    assert_eq!(triangles("--level 0"), passes[0]);
    // Beyond: said, or exit code 1.
    assert!(p.done("decode in.pm out.ply --level 99").stderr.contains("no level 99"));
    p.run("decode in.pm out.ply --triangles 3").failed(1, "that is the base");
    assert!(p.exists("out.ply"));
    p.run("decode in.pm out.ply --triangles 3 --level 1").failed(2, "cannot be used with");
    // Through a pipe.
    let through =
        p.command().args(["decode", "-", "out2.ply", "-q"]).write_stdin(p.read("in.pm")).output().unwrap();
    assert!(through.status.success());
}

#[test]
fn what_cannot_be_is_refused() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 200);
    p.run("encode in.obj out.obj").failed(2, "must end in .pm");
    p.run("convert in.obj out.pm").failed(2, "progmesh encode");
    p.run("simplify in.obj out.pm --ratio 0.5").failed(2, "progmesh encode");
    p.run("encode in.obj out.pm --quantize 31").failed(2, "2 to 30");
    p.run("encode in.obj out.pm --epsilon 3").failed(2, "--epsilon is for --method nsa");
    p.run("encode in.obj none/out.pm").failed(4, "there is no directory");
    p.run("encode none.obj out.pm").failed(3, "none.obj");
    p.run("decode in.obj out.ply").failed(3, "`progmesh encode` makes one of a mesh");
    p.run("encode in.obj - --json").failed(2, "both want standard output");
}

#[test]
fn damage_names_its_chunk_and_what_comes_before_can_be_saved() {
    let p = Place::new();
    p.generate("scan", "in.ply", 30_000);
    p.done("encode in.ply in.pm -q");
    let whole = p.read("in.pm");
    let mut flipped = whole.clone();
    let at = whole.len() * 3 / 5;
    flipped[at] ^= 0x10;
    p.write("flipped.pm", &flipped);
    p.write("cut.pm", &whole[..whole.len() / 2]);
    for name in ["flipped.pm", "cut.pm"] {
        p.run(&format!("decode {name} out.ply")).failed(3, "chunk");
        assert!(!p.exists("out.ply"));
        let run = p.done(&format!("decode {name} saved.ply --salvage --json"));
        assert!(run.stderr.contains("chunk"), "{}", run.stderr);
        assert!(run.json()["triangles"].as_u64().unwrap() > 100);
        p.done("info saved.ply --check");
    }
    p.write("none.pm", b"");
    p.run("info none.pm").failed(3, "ends within");
}

#[test]
fn quantising_moves_vertices_by_no_more_than_it_says() {
    let p = Place::new();
    p.generate("scan", "in.ply", 3000);
    let whole = p.done("encode in.ply whole.pm --json -q").json();
    assert!(whole["quantization_error"].is_null());
    let mut last = 0.0;
    for bits in [14, 9] {
        let e = p.done(&format!("encode in.ply q.pm --quantize {bits} --json -q")).json();
        let said = e["quantization_error"].as_f64().unwrap();
        assert!(said > 8.0 * last && e["bytes"].as_u64() < whole["bytes"].as_u64(), "{bits}: {said}");
        p.done("decode q.pm q.ply -q");
        // Faces are the input's, so vertices can only have moved: by something, and no more than said.
        let c = p.done("compare in.ply q.ply --samples 20000 --json").json();
        let farthest = c["worse"]["max"].as_f64().unwrap_or_else(|| panic!("{c}"));
        assert!(farthest > 0.0 && farthest <= said, "{bits}: {farthest} of {said}");
        let i = p.done("info q.pm --json").json();
        assert_eq!(i["progressive"]["quantization_error"].as_f64(), Some(said));
        assert_eq!(i["triangles"], p.done("info in.ply --json").json()["triangles"]);
        last = said;
    }
    // Again from the file: the places lie on the grid already, so its places come back.
    p.done("convert q.pm again.ply -q");
    assert!(p.read("again.ply") == p.read("q.ply"));
}

#[test]
fn chunks_that_follow_each_other_bring_the_same_mesh() {
    let p = Place::new();
    p.generate("cad", "in.ply", 16_000);
    p.done("encode in.ply in.pm -q");
    p.done("encode in.ply sequel.pm -q --sequential");
    p.done("decode in.pm a.ply -q");
    p.done("decode sequel.pm b.ply -q");
    assert!(p.read("a.ply") == p.read("b.ply"));
    assert!(p.read("sequel.pm").len() < p.read("in.pm").len());
    p.run("encode in.ply out.pm --sequential --paged").failed(2, "cannot be used with");
    p.run("encode in.ply out.pm --bounds --paged").failed(2, "cannot be used with");
    for (threads, name) in [(1, "one.pm"), (2, "two.pm")] {
        p.done(&format!("encode in.ply {name} -q --threads {threads}"));
        assert!(p.read(name) == p.read("in.pm"), "{threads} threads");
        p.done(&format!("decode in.pm c.ply -q --threads {threads}"));
        assert!(p.read("c.ply") == p.read("a.ply"), "{threads} threads");
    }
}

#[test]
fn clustering_is_refused_with_what_to_do_instead() {
    let p = Place::new();
    p.generate("cad", "in.ply", 300);
    for command in ["encode in.ply out.pm", "lod in.ply out.glb --levels 0.5"] {
        let run = p.run(&format!("{command} --method cluster"));
        assert_eq!(run.code, 2, "{command}");
        assert!(run.stderr.contains("progmesh simplify") && run.stderr.contains("quadric"), "{}", run.stderr);
        assert!(!run.stderr.contains("quadric, cluster"), "{}", run.stderr);
    }
    assert_eq!(p.files(), ["in.ply"]);
}

#[test]
fn bounds_in_the_file_are_what_extract_goes_by() {
    let p = Place::new();
    p.generate("scan", "in.ply", 2000);
    p.done("encode in.ply in.pm -q");
    let told = p.done("encode in.ply bounded.pm --bounds --json").json();
    assert!(told["seconds"]["bounds"].as_f64().unwrap() > 0.0);
    let bytes = p.done("info bounded.pm --json").json()["progressive"]["streams"]["bounds"].as_u64().unwrap();
    let (more, splits) =
        (p.read("bounded.pm").len() - p.read("in.pm").len(), told["splits"].as_u64().unwrap());
    assert!(bytes >= 3 * splits && bytes < 8 * splits && more as u64 > bytes && more as u64 - bytes < 1000);
    p.done("decode in.pm a.ply -q");
    p.done("decode bounded.pm b.ply -q");
    assert!(p.read("a.ply") == p.read("b.ply"));
    p.write(
        "cam.json",
        br#"{"eye":[0,0,4],"target":[0,0,0],"up":[0,1,0],"fov_y_deg":45,"width":640,"height":480,"near":0.01,"far":40}"#,
    );
    let extracted = p.done("extract bounded.pm near.ply --camera cam.json --tau 0.5 --json").json();
    let [some, all] = ["faces", "full_faces"].map(|k| extracted[k].as_u64().unwrap());
    assert!(some > 20 && some < all, "{some} of {all}");
}

#[test]
fn info_tells_where_the_bytes_go() {
    let p = Place::new();
    p.generate("scan", "in.ply", 2000);
    p.done("encode in.ply in.pm -q");
    let i = p.done("info in.pm --json").json();
    let pm = &i["progressive"];
    let sum: u64 = pm["streams"].as_object().unwrap().values().map(|v| v.as_u64().unwrap()).sum();
    assert_eq!(sum, p.read("in.pm").len() as u64);
    assert_eq!(i["format"], "pm");
    assert!(pm["splits"].as_u64().unwrap() > 500 && pm["base_triangles"].as_u64().unwrap() < 100);
    let told = p.done("info in.pm").stdout;
    assert!(told.contains("connectivity") && told.contains("order"), "{told}");
    assert!(p.done("info in.ply --json").json()["progressive"].is_null());
    p.done("encode in.ply any.pm -q --any-order");
    assert!(p.read("any.pm").len() < p.read("in.pm").len());
}

#[test]
fn a_morph_lies_between_its_ends() {
    let p = Place::new();
    p.generate("scan", "in.ply", 2000);
    p.done("encode in.ply in.pm -q");
    let m = p.done("morph in.pm half.ply --from 300 --to 1500 --at 0.5 --json").json();
    assert_eq!(m["triangles"], m["to_triangles"]);
    // The ends look as the two meshes do: at no distance from them.
    p.done("decode in.pm coarse.ply --triangles 300 -q");
    p.done("decode in.pm fine.ply --triangles 1500 -q");
    for (at, like) in [(0, "coarse.ply"), (1, "fine.ply")] {
        p.done(&format!("morph in.pm end.ply --from 300 --to 1500 --at {at} -q"));
        let d = p.done(&format!("compare {like} end.ply --samples 2000 --json")).json();
        let rms = d["relative"]["rms"].as_f64().unwrap_or_else(|| panic!("{d}"));
        assert!(rms < 1e-12, "{at}: {rms}");
    }
    // The other way round it is the same.
    p.done("morph in.pm back.ply --from 1500 --to 300 --at 0.5 -q");
    assert_eq!(p.read("back.ply"), p.read("half.ply"));
    p.run("morph in.pm x.ply --from 1 --to 2 --at 1.5").failed(2, "from 0 to 1");
    assert!(
        p.done("morph in.pm x.ply --from 1 --to 200 --at 0").stderr.contains("more than the 1 asked for")
    );
}

#[test]
fn levels_of_detail_stand_in_one_gltf_and_break_no_plain_viewer() {
    let p = Place::new();
    p.generate("cad", "in.glb", 2000);
    let l = p.done("lod in.glb out.glb --levels 0.5,0.25,100 --json").json();
    let triangles: Vec<u64> =
        l["levels"].as_array().unwrap().iter().map(|l| l["triangles"].as_u64().unwrap()).collect();
    assert!(
        triangles.is_sorted_by(|a, b| a > b) && triangles.len() == 4 && triangles[3] <= 100,
        "{triangles:?}"
    );
    let d = document(&p.read("out.glb"));
    assert_eq!(d["extensionsUsed"], serde_json::json!(["MSFT_lod"]));
    assert!(d["extensionsRequired"].is_null());
    let nodes = d["nodes"].as_array().unwrap();
    let with: Vec<&Value> = nodes.iter().filter(|n| n["extensions"]["MSFT_lod"].is_object()).collect();
    assert!(!with.is_empty());
    let shown: Vec<u64> =
        d["scenes"][0]["nodes"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
    for n in with {
        let ids = n["extensions"]["MSFT_lod"]["ids"].as_array().unwrap();
        let coverage = n["extras"]["MSFT_screencoverage"].as_array().unwrap();
        assert_eq!(coverage.len(), ids.len() + 1);
        assert!(coverage.iter().map(|c| c.as_f64().unwrap()).is_sorted_by(|a, b| a > b));
        for id in ids {
            let id = id.as_u64().unwrap();
            assert!(nodes[id as usize]["mesh"].is_u64() && !shown.contains(&id));
            assert!(!nodes.iter().any(|n| n["children"].as_array().is_some_and(|c| c.contains(&id.into()))));
        }
    }
    // What a reader without the extension shows is the input.
    p.done("convert out.glb shown.ply -q");
    p.done("convert in.glb want.ply -q");
    assert_eq!(p.read("shown.ply"), p.read("want.ply"));
    let reader = gltf::Gltf::from_slice(&p.read("out.glb")).unwrap();
    assert_eq!(reader.nodes().count(), nodes.len());
    // Writing it again keeps the levels.
    p.done("convert out.glb again.glb -q");
    let again = document(&p.read("again.glb"));
    assert_eq!(again["nodes"], d["nodes"]);
    assert_eq!(again["meshes"].as_array().unwrap().len(), d["meshes"].as_array().unwrap().len());
}

#[test]
fn a_node_with_children_keeps_them_at_every_level() {
    let p = Place::new();
    p.generate("torus", "plain.glb", 600);
    p.done("convert plain.glb t.gltf -q");
    let mut json: Value = serde_json::from_str(&p.text("t.gltf")).unwrap();
    json["nodes"] = serde_json::json!([
        {"mesh": 0, "children": [1], "translation": [1, 0, 0], "name": "parent"},
        {"mesh": 0, "scale": [2, 2, 2]}
    ]);
    json["scenes"] = serde_json::json!([{"nodes": [0]}]);
    p.write("t.gltf", json.to_string());
    p.done("lod t.gltf out.glb --levels 0.5,0.2 --coverage 0.3,0.1");
    let d = document(&p.read("out.glb"));
    assert!(d["nodes"][0]["mesh"].is_null() && d["nodes"][0]["extensions"].is_null());
    assert_eq!(d["nodes"][0]["children"].as_array().unwrap().len(), 2);
    let holder = d["nodes"][0]["children"][1].as_u64().unwrap() as usize;
    assert_eq!(d["nodes"][holder]["extras"]["MSFT_screencoverage"], serde_json::json!([0.3, 0.1, 0.0]));
    let ids = d["nodes"][1]["extensions"]["MSFT_lod"]["ids"].as_array().unwrap();
    assert_eq!(d["nodes"][ids[0].as_u64().unwrap() as usize]["scale"], serde_json::json!([2, 2, 2]));
    p.done("convert out.glb shown.obj -q");
    p.done("convert t.gltf want.obj -q");
    assert_eq!(p.text("shown.obj").matches("\nf ").count(), p.text("want.obj").matches("\nf ").count());
}

#[test]
fn levels_come_from_any_mesh_and_into_separate_files() {
    let p = Place::new();
    p.generate("scan", "in.ply", 2000);
    p.done("encode in.ply in.pm -q");
    p.done("lod in.pm out.glb --levels 0.5,0.1 --separate -q");
    assert!(
        ["out.lod0.glb", "out.lod1.glb", "out.lod2.glb"].iter().all(|f| p.exists(f)) && !p.exists("out.glb")
    );
    assert!(document(&p.read("out.lod1.glb"))["extensionsUsed"].is_null());
    p.done("lod in.ply out.gltf --levels 500,50 -q --png levels.png");
    assert!(p.read("levels.png").starts_with(b"\x89PNG"));
    assert!(p.text("out.gltf").contains("MSFT_lod"));
    p.run("lod in.ply out.obj --levels 0.5").failed(2, "written as .glb or .gltf");
    p.run("lod in.ply out.glb --levels 0.2,0.5").failed(2, "fewer triangles than the one before");
    p.run("lod in.ply out.glb --levels 2.5").failed(2, "a part of the triangles");
    p.run("lod in.ply out.glb --levels 0.5,0.1 --coverage 0.5").failed(2, "1 numbers for 2 levels");
    p.run("lod in.ply out.glb --levels 0.5,0.1 --coverage 0.1,0.5").failed(2, "the largest comes first");
}

#[test]
fn hoppes_files_are_meshes_for_every_command() {
    let p = Place::new();
    p.write("h.pm", include_bytes!("corpus/hoppe_pm/small.pm"));
    let camera = r#"{"eye": [0, 0, 9], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 40, "width": 200, "height": 200, "near": 0.1, "far": 100}"#;
    p.write("c.json", camera);
    for run in [
        "info h.pm --check",
        "simplify h.pm s.obj --ratio 0.9",
        "convert h.pm c.glb",
        "compare h.pm h.pm",
        "clip h.pm k.ply --plane 1,0,0,0",
        "cull h.pm u.ply --camera c.json",
        "levels h.pm --runs 1 --samples 0",
        "encode h.pm e.pm",
        "lod h.pm l.glb --levels 0.6,0.3",
        "morph h.pm m.obj --from 10 --to 20 --at 0.5",
        "decode h.pm d.obj --triangles 20",
    ] {
        p.done(run);
    }
    // Its splits only go in their own order: for a view new ones are made, and that is said.
    for run in ["extract h.pm x.obj --camera c.json --tau 0 --cull none", "fly h.pm --path circle --frames 3"]
    {
        let run = p.done(run);
        assert!(run.stderr.contains("new ones are used"), "{}", run.stderr);
    }
    let faces = |name: &str| p.text(name).lines().filter(|l| l.starts_with("f ")).count();
    p.done("decode h.pm full.obj");
    assert_eq!(faces("x.obj"), faces("full.obj"));
    let run = p.run("fly h.pm --path circle --memory 16");
    assert!(run.code == 3 && run.stderr.contains("Hoppe"), "{}", run.stderr);
}
