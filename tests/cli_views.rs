//! `clip` and `cull`, end to end: what is left, what is closed, what stays shared.

mod common;

use common::{Place, Run};
use glam::DVec3;
use progmesh::io::{Format, NoSide, decode};
use progmesh::scene::Scene;
use serde_json::{Value, json};
use std::collections::HashMap;

fn scene(p: &Place, file: &str) -> Scene {
    let format = Format::from_name(file).unwrap();
    decode(format, &p.read(file), &NoSide).unwrap().scene
}

/// Edges that faces do not run once each way, with vertices at one place as one.
fn open_edges(scene: &Scene) -> usize {
    let mut count: HashMap<[[u64; 3]; 2], i32> = HashMap::new();
    for mesh in &scene.meshes {
        let g = &mesh.geometry;
        let mut start = 0;
        for f in 0..g.face_count() {
            let n = g.face_sizes.as_ref().map_or(3, |s| s[f] as usize);
            for i in 0..n {
                let at = |k: usize| g.positions.bits(g.corners[start + k % n] as usize);
                let (a, b) = (at(i), at(i + 1));
                if a != b {
                    *count.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
                }
            }
            start += n;
        }
    }
    count.values().filter(|&&n| n != 0).count()
}

fn bounds(scene: &Scene) -> (DVec3, DVec3) {
    progmesh::report::Surface::of(scene).unwrap().bounds().unwrap()
}

fn camera(p: &Place, file: &str, change: impl FnOnce(&mut Value)) {
    let mut c = json!({
        "eye": [0.3, 0.4, 4.0], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 20,
        "width": 400, "height": 300, "near": 0.5, "far": 20
    });
    change(&mut c);
    p.write(file, c.to_string());
}

#[test]
fn a_box_of_a_closed_mesh_is_closed_in_every_format() {
    let p = Place::new();
    p.generate("torus", "in.ply", 800);
    let (lo, hi) = bounds(&scene(&p, "in.ply"));
    let (a, b) = (lo.lerp(hi, 0.2), lo.lerp(hi, 0.7));
    let region = format!("--box={},{},{},{},{},{}", a.x, a.y, a.z, b.x, b.y, b.z);
    for file in ["out.ply", "out.obj", "out.stl", "out.off", "out.glb"] {
        let run = p.done(&format!("clip in.ply {file} {region} --cap --json"));
        let report = run.json();
        assert!(report["cut_faces"].as_u64().unwrap() > 50 && report["cap"]["open_edges"] == 0);
        let left = scene(&p, file);
        assert_eq!(open_edges(&left), 0, "{file}");
        let (l, h) = bounds(&left);
        assert!((l - a).abs().max_element() < 1e-5 && (h - b).abs().max_element() < 1e-5, "{file} {l} {h}");
        assert!(run.stderr.contains("cuts closed with"), "{}", run.stderr);
    }
    // Without caps there is a border, and the same twice.
    p.done(&format!("clip in.ply open.ply {region} -q"));
    assert!(open_edges(&scene(&p, "open.ply")) > 50);
    let first = p.read("out.glb");
    p.done(&format!("clip in.ply out.glb {region} --cap -q"));
    assert_eq!(p.read("out.glb"), first);
}

#[test]
fn both_sides_of_a_plane_make_the_whole_and_regions_intersect() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 600);
    let faces = |file: &str| p.info(file)["triangles"]["file"].as_u64().unwrap();
    p.done("clip in.obj up.obj --plane 0,1,0,-0.1 --cap -q");
    p.done("clip in.obj down.obj --plane=0,-1,0,0.1 --cap --png both.png -q");
    assert!(faces("up.obj") > 100 && faces("down.obj") > faces("up.obj") && p.exists("both.png"));
    assert!((bounds(&scene(&p, "up.obj")).0.y - 0.1).abs() < 1e-6);
    p.done("clip in.obj slab.obj --plane 0,1,0,0.1 --plane 0,-1,0,0.1 --box=-9,-9,0,9,9,9 --cap -q");
    let (lo, hi) = bounds(&scene(&p, "slab.obj"));
    assert!(lo.y >= -0.1000001 && hi.y <= 0.1000001 && lo.z == 0.0);
    assert_eq!(open_edges(&scene(&p, "slab.obj")), 0);
    // All inside: nothing changes. All outside: nothing is left, and that is said.
    p.done("clip in.obj same.obj --plane 0,1,0,9 -q");
    assert_eq!(
        scene(&p, "same.obj").meshes[0].geometry.corners,
        scene(&p, "in.obj").meshes[0].geometry.corners
    );
    let run = p.done("clip in.obj none.ply --plane 0,1,0,-9");
    assert!(run.stderr.contains("nothing is left"), "{}", run.stderr);
    // An open mesh cannot be closed.
    p.generate("terrain", "open.obj", 400);
    let (lo, hi) = bounds(&scene(&p, "open.obj"));
    let run = p.done(&format!("clip open.obj cut.obj --plane 1,0,0,{} --cap", -0.5 * (lo.x + hi.x)));
    assert!(run.stderr.contains("open where it was cut"), "{}", run.stderr);
}

#[test]
fn regions_and_cameras_that_are_none_are_refused() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 100);
    p.run("clip in.obj out.obj").failed(2, "--box");
    p.run("clip in.obj out.obj --box=1,0,0,0,1,1").failed(2, "least corner");
    p.run("clip in.obj out.obj --box=1,0,0").failed(2, "6 numbers with commas between them: these are 3");
    p.run("clip in.obj out.obj --box=nan").failed(2, "\"nan\" is not finite");
    p.run("clip in.obj out.obj --box=0,0,0,1,1,-inf").failed(2, "\"-inf\" is not finite");
    p.run("clip in.obj out.obj --box=0,0,0,1,1,").failed(2, "\"\" is none");
    p.run("clip in.obj out.obj --plane 0,0,0,1").failed(2, "not all be 0");
    p.run("clip in.obj out.obj --plane 0,nan,0,1").failed(2, "4 numbers");
    for (k, (field, value)) in [
        ("target", json!([0.3, 0.4, 4.0])),
        ("up", json!([0.3, 0.4, 4.0])),
        ("width", json!(0)),
        ("height", json!(0)),
        ("far", json!(0.1)),
        ("near", json!(0)),
        ("fov_y_deg", json!(180)),
        ("fov_y_deg", Value::Null),
        ("zoom", json!(2)),
    ]
    .into_iter()
    .enumerate()
    {
        camera(&p, "cam.json", |c| c[field] = value);
        let command =
            ["clip in.obj out.obj --frustum cam.json", "cull in.obj out.obj --camera cam.json"][k % 2];
        let run = p.run(command);
        run.failed(3, "cam.json: ");
        assert!(run.stderr.contains(field), "{field}: {}", run.stderr);
    }
    p.write("cam.json", "{\"eye\": [NaN, 0, 1]}");
    p.run("cull in.obj out.obj --camera cam.json").failed(3, "eye: line 1");
    p.run("cull in.obj out.obj --camera none.json").failed(3, "none.json");
    p.run("cull in.obj out.obj --camera in.obj").failed(3, "a camera is a .json file");
    p.done("convert in.obj in.glb -q");
    p.run("cull in.obj out.obj --camera in.glb").failed(3, "no node of the scene has a camera");
    assert!(!p.exists("out.obj"));
}

/// Three instances of a sphere, at x = -3, 0 and 3, and a camera that stands at z = 6.
fn instances(p: &Place) {
    p.generate("sphere", "sphere.glb", 320);
    p.done("convert sphere.glb sphere.gltf -q");
    let mut d: Value = serde_json::from_str(&p.text("sphere.gltf")).unwrap();
    d["nodes"] = json!([
        {"mesh": 0, "translation": [-3, 0, 0]},
        {"mesh": 0},
        {"mesh": 0, "translation": [3, 0, 0]},
        {"camera": 0, "name": "eye", "translation": [0, 0, 6]}
    ]);
    d["scenes"] = json!([{"nodes": [0, 1, 2, 3]}]);
    d["cameras"] =
        json!([{"type": "perspective", "perspective": {"yfov": 0.4, "znear": 0.1, "aspectRatio": 1.0}}]);
    d["meshes"][0]["extras"] = json!({"kept": true});
    p.write("three.gltf", d.to_string());
}

#[test]
fn instances_stay_instances_where_nothing_is_cut() {
    let p = Place::new();
    instances(&p);
    let run = p.done("clip three.gltf out.gltf --plane 1,0,0,0 --cap --json");
    let report = run.json();
    assert_eq!(report["instances"], json!({"inside": 1, "cut": 1, "outside": 1}));
    let d: Value = serde_json::from_str(&p.text("out.gltf")).unwrap();
    assert_eq!(d["meshes"].as_array().unwrap().len(), 2);
    assert!(d["nodes"][0].get("mesh").is_none() && d["nodes"][3]["camera"] == 0);
    assert_ne!(d["nodes"][1]["mesh"], d["nodes"][2]["mesh"]);
    assert!(d["meshes"].as_array().unwrap().iter().all(|m| m["extras"]["kept"] == true));
    let out = decode(Format::Gltf, &p.read("out.gltf"), &Beside(&p)).unwrap().scene;
    let (lo, hi) = bounds(&out);
    assert!(lo.x == 0.0 && hi.x > 3.9);
    assert_eq!(open_edges(&out), 0);
    // Those that are gone take their mesh along.
    p.done("clip three.gltf one.gltf --plane 1,0,0,-2.5 -q");
    let d: Value = serde_json::from_str(&p.text("one.gltf")).unwrap();
    assert_eq!((d["meshes"].as_array().unwrap().len(), d["nodes"][2]["mesh"].as_u64()), (1, Some(0)));
    p.done("clip three.gltf none.glb --plane 1,0,0,-25 -q");
    assert!(scene(&p, "none.glb").meshes.is_empty());
}

/// Files beside one in the directory of a test.
struct Beside<'a>(&'a Place);

impl progmesh::io::Side for Beside<'_> {
    fn load(&self, name: &str) -> std::io::Result<Vec<u8>> {
        std::fs::read(self.0.path(name))
    }
}

#[test]
fn culling_drops_what_is_outside_and_what_turns_its_back() {
    let p = Place::new();
    instances(&p);
    let cull = |arguments: &str| -> (Value, Run) {
        let run = p.done(&format!("cull {arguments} --json"));
        (run.json(), run)
    };
    let (report, run) = cull("three.gltf out.glb --camera three.gltf#eye");
    assert_eq!(report["instances"], json!({"all": 3, "outside": 2, "dropped": 2}));
    assert_eq!(report["components"], json!({"all": 1, "outside": 0, "solid": 1}));
    let n = |key: &str| report["faces"][key].as_u64().unwrap();
    assert_eq!(n("all"), n("outside") + n("back") + n("kept"));
    assert!(n("back") > n("kept") / 2 && n("kept") > 50 && n("back_by_cone") <= n("back"), "{report}");
    assert!(run.stderr.contains("turn their back"));
    // Nothing of the picture changes: the silhouette from there.
    let left = decode(Format::Glb, &p.read("out.glb"), &NoSide).unwrap().scene;
    let whole = scene(&p, "sphere.glb");
    let eye = DVec3::new(0.0, 0.0, 6.0);
    let seen = |s: &Scene| {
        let g = &s.meshes[0].geometry;
        let at = |v: u32| g.positions.get(v as usize);
        let front = |t: &&[u32]| (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0])).dot(eye - at(t[0])) > 0.0;
        g.corners.chunks(3).filter(front).count()
    };
    assert_eq!(seen(&left), seen(&whole));
    // Not closed, or cut by the near plane: back faces stay.
    p.done("clip sphere.glb half.ply --plane 0,1,0,0 -q");
    camera(&p, "cam.json", |_| {});
    let (report, _) = cull("half.ply out.ply --camera cam.json");
    assert_eq!(
        (report["faces"]["back"].as_u64(), report["components"]["solid"].as_u64()),
        (Some(0), Some(0))
    );
    camera(&p, "near.json", |c| c["near"] = json!(3.9));
    let (report, _) = cull("sphere.glb out.ply --camera near.json");
    assert_eq!(
        (report["faces"]["back"].as_u64(), report["components"]["solid"].as_u64()),
        (Some(0), Some(0))
    );
    // Orthographic too; and what sees nothing.
    camera(&p, "plan.json", |c| {
        c.as_object_mut().unwrap().remove("fov_y_deg");
        c["ortho_height"] = json!(9);
    });
    let (report, _) = cull("sphere.glb out.ply --camera plan.json --png view.png");
    let (back, all) = (report["faces"]["back"].as_f64().unwrap(), report["faces"]["all"].as_f64().unwrap());
    assert!((back / all - 0.5).abs() < 0.1 && p.exists("view.png"));
    camera(&p, "away.json", |c| c["target"] = json!([0.3, 0.4, 9]));
    let run = p.done("cull sphere.glb out.ply --camera away.json");
    assert!(run.stderr.contains("nothing is in view"), "{}", run.stderr);
}
