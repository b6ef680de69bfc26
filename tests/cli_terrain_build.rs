//! `progmesh terrain build`, end to end.

mod common;

use common::Place;

const RAW: &str = "--size 70x50 --type i16 --nodata -32768";

/// Heights of a hilly raster of 70 x 50 samples, i16, with a lake of voids if told so.
fn hills(lake: bool) -> Vec<u8> {
    let height = |i: i32| {
        let (x, y) = (f64::from(i % 70), f64::from(i / 70));
        let h = 90.0 * (x * 0.11).sin() * (y * 0.13).cos() + 9.0 * (x * 1.3 + y).sin();
        let void = lake && (x - 30.0).hypot(y - 20.0) < 7.0;
        if void { i16::MIN } else { h as i16 }
    };
    (0..70 * 50).flat_map(|i| height(i).to_le_bytes()).collect()
}

fn place(lake: bool) -> Place {
    let p = Place::new();
    p.write("hills.raw", hills(lake));
    p
}

#[test]
fn a_terrain_is_read_wherever_a_mesh_is() {
    for lake in [false, true] {
        let p = place(lake);
        let built = p.done(&format!("terrain build hills.raw hills.pm {RAW} --block 16 --json")).json();
        assert_eq!((built["levels"].as_u64(), built["blocks"].as_u64()), (Some(4), Some(20 + 6 + 2 + 1)));
        assert_eq!(built["error"].as_f64(), Some(0.0));
        assert_eq!(p.files(), ["hills.pm", "hills.raw"]);
        let triangles = built["triangles"].as_u64().unwrap();
        assert!(lake || triangles == 2 * 69 * 49);
        let info = p.done("info hills.pm --json").json();
        assert_eq!(info["triangles"]["file"].as_u64(), Some(triangles));
        p.done("decode hills.pm full.ply -q");
        assert_eq!(p.info("full.ply")["triangles"]["file"].as_u64(), Some(triangles));
        p.done("decode hills.pm coarse.ply --triangles 500 -q");
        assert!(p.info("coarse.ply")["triangles"]["file"].as_u64().unwrap() <= 500 || lake);
    }
}

#[test]
fn a_floor_keeps_fewer_vertices_and_threads_do_not_show() {
    let p = place(true);
    let full = p.done(&format!("terrain build hills.raw full.pm {RAW} --block 16 --json")).json();
    let rough =
        p.done(&format!("terrain build hills.raw a.pm {RAW} --block 16 --floor 5 --threads 1 --json")).json();
    assert!(rough["error"].as_f64().unwrap() <= 5.0);
    assert!(rough["vertices"].as_u64().unwrap() * 3 < full["vertices"].as_u64().unwrap());
    p.done(&format!("terrain build hills.raw b.pm {RAW} --block 16 --floor 5 --threads 3 -q"));
    assert_eq!(p.read("a.pm"), p.read("b.pm"));
    // With steps of a length that the unit of heights is no simple part of, heights are rounded in the mesh; the floor holds that too.
    let rows = |i: usize| {
        (0..50).map(|k| format!("{}", 7000 + (31 * k + 17 * i) % 23)).collect::<Vec<_>>().join(" ")
    };
    let text: Vec<String> = (0..40).map(rows).collect();
    p.write(
        "a.asc",
        format!("ncols 50\nnrows 40\nxllcorner 0\nyllcorner 0\ncellsize 88.8\n{}\n", text.join("\n")),
    );
    let made = p.done("terrain build a.asc c.pm --block 16 --floor 8 --json -q").json();
    let error = made["error"].as_f64().unwrap();
    assert!(error <= 8.0 && error > 7.0, "{error}");
}

#[test]
fn finished_blocks_are_not_made_again() {
    let p = place(false);
    let command = format!("terrain build hills.raw hills.pm {RAW} --block 16 --json");
    p.done(&command);
    let whole = p.read("hills.pm");
    // A folder of another work goes.
    std::fs::create_dir(p.path("hills.pm.work")).unwrap();
    p.write("hills.pm.work/belongs-to", "other work");
    p.write("hills.pm.work/0-0-0.block", "nothing");
    assert_eq!(p.done(&command).json()["blocks_found"].as_u64(), Some(0));
    assert!(!p.exists("hills.pm.work"));
    // What is somebody else's stays.
    std::fs::remove_file(p.path("hills.pm")).unwrap();
    std::fs::create_dir(p.path("hills.pm.work")).unwrap();
    p.write("hills.pm.work/notes.txt", "somebody's");
    p.run(&command).failed(4, "was not made by this program");
    std::fs::remove_file(p.path("hills.pm.work/notes.txt")).unwrap();
    p.done(&command);
    assert_eq!(p.read("hills.pm"), whole);
}

#[cfg(unix)]
#[test]
fn a_run_that_was_killed_goes_on() {
    use std::os::unix::process::ExitStatusExt;
    let p = Place::new();
    let heights = |i: u32| ((i % 300) * (i / 300) % 251 + i * 7919 % 13) as u8;
    p.write("rough.raw", (0..90_000).map(heights).collect::<Vec<_>>());
    let arguments = "terrain build rough.raw rough.pm --size 300x300 --type u8 --block 32 --json";
    // The system kills it in the middle of the first file of more than 88 kB. The finest hundred blocks are smaller, what is made of them is larger:
    // that takes no watching, so no busy machine is too slow for it.
    let limited = format!("ulimit -c 0; ulimit -f 176; exec \"$0\" {arguments}");
    let killed = std::process::Command::new("sh")
        .args(["-c", &limited, env!("CARGO_BIN_EXE_progmesh")])
        .current_dir(p.directory())
        .output()
        .unwrap();
    assert!(killed.status.signal().is_some(), "{killed:?}");
    assert!(!p.exists("rough.pm") && p.exists("rough.pm.work"));
    let again = p.done(arguments).json();
    let found = again["blocks_found"].as_u64().unwrap();
    assert!((100..again["blocks"].as_u64().unwrap()).contains(&found), "{found}");
    assert!(!p.exists("rough.pm.work"));
    let resumed = p.read("rough.pm");
    assert_eq!(p.done(arguments).json()["blocks_found"].as_u64(), Some(0));
    assert_eq!(p.read("rough.pm"), resumed);
}

#[test]
fn flights_keep_the_tolerance_at_every_sample() {
    let p = Place::new();
    p.done("generate terrain grid.tif --size 65 --seed 3 -q");
    p.done("terrain build grid.tif grid.pm --block 16 -q");
    for path in ["circle", "lemniscate"] {
        let fly = format!("fly grid.pm --grid grid.tif --path {path} --path-speed fast --frames 9");
        let r = p.done(&format!("{fly} --tau 8 --cull frustum --measure-every 2 --json -q")).json();
        let worst = r["measured_over_tau"]["max"].as_f64().unwrap();
        assert!(worst > 0.0 && worst <= 1.0, "{worst}");
        for none in ["above", "cracks", "folds", "uncovered"] {
            assert_eq!(r[none].as_u64(), Some(0), "{none}");
        }
        // And not by showing everything.
        assert!(r["faces"]["mean"].as_f64().unwrap() < 0.9 * r["full_faces"].as_f64().unwrap());
    }
    // Looking down at a slant, wide: towards the corners perspective stretches.
    let camera = |x: f64, y: f64, z: f64| {
        format!(
            r#"{{"eye": [{x}, {y}, {z}], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 70, "width": 1920, "height": 1080, "near": 0.1, "far": 1e6}}"#
        )
    };
    let info = p.done("info grid.pm --json").json();
    let at = |k: usize| info["bounds"][k][0].as_f64().unwrap();
    let size = 1.4 * (at(1) - at(0));
    let path: Vec<String> = (0..6).map(|k| camera(0.1 * k as f64 * size, 0.4 * size, 0.2 * size)).collect();
    p.write("down.json", format!("[{}]", path.join(",")));
    for memory in ["", "--memory 64"] {
        let fly = format!(
            "fly grid.pm --grid grid.tif --path down.json --tau 8 --cull frustum --measure-every 1 {memory} --json -q"
        );
        let worst = p.done(&fly).json()["measured_over_tau"]["max"].as_f64().unwrap();
        assert!(worst > 0.3 && worst <= 1.0, "{worst}");
    }
}

#[test]
fn with_a_floor_the_bound_is_the_larger_of_it_and_the_tolerance() {
    let p = Place::new();
    p.done("generate terrain grid.tif --size 65 --seed 3 -q");
    p.done("terrain build grid.tif grid.pm --block 16 --floor 2 -q");
    let fly = "fly grid.pm --grid grid.tif --path lemniscate --path-speed fast --frames 7 --cull frustum";
    let mut both = vec![];
    for more in ["", " --memory 64"] {
        let flown = p.done(&format!("{fly} --tau 0.5 --measure-every 3 --json{more}"));
        assert!(flown.stderr.contains("bound: tau, 0.5 pixels, or the floor"), "{}", flown.stderr);
        let r = flown.json();
        for none in ["above", "cracks", "folds", "uncovered"] {
            assert_eq!(r[none].as_u64(), Some(0), "{none}");
        }
        // Two metres near the eye are many pixels, and some samples are nearly that far off.
        let measured = &r["frames"][3]["on_ground"];
        let of = |name: &str| measured[name].as_f64().unwrap();
        assert!(of("max_pixels") > 0.5 && of("beyond_pixels") <= 0.5);
        assert!(of("max_pixels") <= of("floor_pixels") && of("max_height") > 1.0);
        // Heights where it is due, cracks everywhere.
        assert!(r["frames"][4]["on_ground"].is_null() && r["frames"][4]["cracks"].as_u64() == Some(0));
        both.push(measured.clone());
    }
    // In memory, or read where it is needed: the same frames.
    assert_eq!(both[0], both[1]);
}

#[test]
fn cameras_that_look_down_are_shown_no_more_than_the_tolerance_either() {
    let p = Place::new();
    p.done("generate terrain grid.tif --size 129 --seed 3 -q");
    p.done("terrain build grid.tif grid.pm --block 32 -q");
    // Down by 20 to 70 degrees, with the picture's corners far off the axis.
    let line = |k: u32| {
        let (sin, cos) = (0.35 + 0.17 * f64::from(k)).sin_cos();
        let eye = [0.1 + 0.1 * f64::from(k), 0.5, 0.35];
        format!("F {k} {cos} 0 {} 0 1 0 {sin} 0 {cos} {} {} {} 1\nf 0 0 0\n", -sin, eye[0], eye[1], eye[2])
    };
    p.write("down.frames", (0..6).map(line).collect::<String>());
    for more in ["", " --memory 64"] {
        let fly = "fly grid.pm --grid grid.tif --path down.frames --tau 2 --cull frustum --measure-every 1";
        let r = p.done(&format!("{fly} --json -q{more}")).json();
        assert_eq!(r["above"].as_u64(), Some(0), "{}", r["measured_over_tau"]);
        assert!(r["measured_over_tau"]["p50"].as_f64().unwrap() > 0.5, "{}", r["measured_over_tau"]);
    }
}

#[test]
fn what_cannot_be_built_is_said() {
    let p = place(false);
    p.run(&format!("terrain build hills.raw hills.ply {RAW}")).failed(2, "must end in .pm");
    p.run(&format!("terrain build hills.raw - {RAW}")).failed(2, "to a file");
    p.run(&format!("terrain build hills.raw a.pm {RAW} --block 7")).failed(2, "from 8 to 4096");
    p.run(&format!("terrain build hills.raw a.pm {RAW} --floor -1")).failed(2, "0 or more");
    p.run("terrain build hills.raw a.pm --size 1x3500 --type i16").failed(3, "at least 2 x 2");
    p.write("void.raw", vec![0u8; 200]);
    p.run("terrain build void.raw a.pm --size 10x10 --type i16 --nodata 0")
        .failed(3, "nothing to triangulate");
    p.write("high.raw", (0..100).flat_map(|i| (1e30 + f64::from(i)).to_le_bytes()).collect::<Vec<_>>());
    p.run("terrain build high.raw a.pm --size 10x10 --type f64 --floor 1").failed(3, "finer than f32");
    p.write("cut.raw", (0..100).flat_map(|i| (1.0 / f64::from(i)).to_le_bytes()).collect::<Vec<_>>());
    p.run("terrain build cut.raw a.pm --size 10x10 --type f64").failed(3, "infinite");
    // Nothing is left where nothing can be gone on with.
    assert!(p.files().iter().all(|f| !f.contains("a.pm")), "{:?}", p.files());
    p.done("terrain build high.raw a.pm --size 10x10 --type f64 -q");
}

#[test]
fn a_flat_base_says_how_large_the_whole_is() {
    let p = Place::new();
    // A peak, so that nothing of the height is in the base.
    let mut text = "ncols 33\nnrows 33\nxllcorner 0\nyllcorner 0\ncellsize 1\n".to_string();
    for k in 0..33 * 33 {
        let height = if k == 16 * 33 + 16 { 40 } else { (k % 33) / 16 };
        text += &format!("{height}{}", if k % 33 == 32 { '\n' } else { ' ' });
    }
    p.write("peak.asc", text);
    p.done("terrain build peak.asc peak.pm --block 8 -q");
    // The grid is found where the mesh stands only if its box is right.
    let fly = "fly peak.pm --grid peak.asc --path circle --frames 3 --cull frustum --memory 64 --measure-every 1 --json -q";
    let r = p.done(fly).json();
    assert_eq!((r["cracks"].as_u64(), r["uncovered"].as_u64()), (Some(0), Some(0)));
    assert!(r["measured_over_tau"]["max"].as_f64().unwrap() <= 1.0);
}
