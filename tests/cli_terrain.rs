//! `progmesh terrain info` and `progmesh generate terrain`, end to end.

mod common;

use common::Place;

#[test]
fn info_says_what_a_grid_holds() {
    let p = Place::new();
    let mut bytes: Vec<u8> = (0..9i16).flat_map(|h| (100 * h).to_be_bytes()).collect();
    bytes[..2].copy_from_slice(&i16::MIN.to_be_bytes());
    p.write("N57E011.hgt", &bytes);
    let text = p.done("terrain info N57E011.hgt").stdout;
    for part in [
        "N57E011.hgt: HGT",
        "3 x 3 samples, i16",
        "100 to 800, mean 450",
        "1 samples, 88.89 % valid; -32768 means no data",
        "WGS 84, EPSG:4326",
        "0.5 x 0.5 (",
        "11 57 to 12 58",
    ] {
        assert!(text.contains(part), "{part} in {text}");
    }
    let info = p.done("terrain info N57E011.hgt --json").json();
    assert_eq!(
        (info["columns"].as_u64(), info["void"].as_u64(), info["valid"].as_u64()),
        (Some(3), Some(1), Some(8))
    );
    assert_eq!(info["bounds"], serde_json::json!([[11.0, 57.0], [12.0, 58.0]]));
    // From standard input, where no name says what it is.
    let run = p.run_with("terrain info - --from hgt --json", bytes.clone());
    assert_eq!((run.code, run.json()["transform"].is_null()), (0, true));
    p.run_with("terrain info -", bytes).failed(2, "--from tiff|hgt|ascii|png|raw");
}

#[test]
fn colours_that_code_heights_are_no_type_of_number() {
    let p = Place::new();
    let mut bytes = vec![];
    let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
    encoder.set_color(png::ColorType::Rgb);
    // 100,000 and 100,005 tenths above -10,000 m.
    encoder.write_header().unwrap().write_image_data(&[1, 134, 160, 1, 134, 165]).unwrap();
    p.write("a.png", bytes);
    let info = p.done("terrain info a.png --json").json();
    assert_eq!((&info["type"], &info["layout"]), (&"rgb8".into(), &"PNG, terrain-rgb".into()));
    assert_eq!(info["range"], serde_json::json!([0.0, 0.5]));
    assert!(p.done("terrain info a.png").stdout.contains("2 x 1 samples, rgb8"));
}

#[test]
fn a_map_is_drawn_for_any_grid() {
    let p = Place::new();
    p.done("generate terrain a.tif --size 300 -q");
    p.done("terrain info a.tif --png a.png");
    let reader = png::Decoder::new(std::io::Cursor::new(p.read("a.png"))).read_info().unwrap();
    assert_eq!(reader.info().width, 300);
    p.done("generate terrain b.tif --size 1500 -q");
    p.done("terrain info b.tif --png b.png -q");
    let reader = png::Decoder::new(std::io::Cursor::new(p.read("b.png"))).read_info().unwrap();
    assert_eq!(reader.info().width, 750, "reduced to at most 1024");
    // One row, one height, none at all.
    for (name, size) in [("row", "7x1"), ("flat", "4x4"), ("one", "1x1")] {
        let heights = if name == "row" { (0..7).collect() } else { vec![5u8; 16] };
        let n = size.split('x').map(|t| t.parse::<usize>().unwrap()).product();
        p.write("a.raw", &heights[..n]);
        p.done(&format!("terrain info a.raw --size {size} --type u8 --png c.png"));
    }
    let void = p.done("terrain info a.raw --size 1x1 --type u8 --nodata 5 --png c.png").stdout;
    assert!(void.contains("none: every sample is void") && void.contains("0.00 % valid"), "{void}");
    p.run("terrain info a.tif --png none/a.png").failed(4, "none/a.png");
    p.run("terrain info a.tif --png a.jpg").failed(2, "must end in .png");
}

#[test]
fn bad_grids_are_refused_by_name() {
    let p = Place::new();
    p.write("a.raw", [0; 10]);
    p.run("terrain info a.raw").failed(2, "--size 1024x1024 --type u16");
    p.run("terrain info a.raw --size 3x2 --type i16").failed(3, "are 12 bytes, and the file has 10");
    p.run("terrain info none.tif").failed(3, "none.tif");
    p.write("a.tif", "II*\0\x10\0\0\0");
    p.run("terrain info a.tif").failed(3, "a.tif: directory: the file ends before");
    p.write("words.tif", "hello\n");
    p.run("terrain info words.tif")
        .failed(3, "words.tif: its name says TIFF, and it does not begin like one");
    p.run("terrain info words.tif --from png").failed(3, "words.tif");
    p.write("empty.tif", "");
    p.run("terrain info empty.tif").failed(3, "empty.tif: the file is empty");
    p.done("generate terrain b.tif --size 300 -q");
    let whole = p.read("b.tif");
    p.write("b.tif", &whole[..whole.len() - 1]);
    p.run("terrain info b.tif").failed(3, "b.tif: tile 3 (from column 256, row 256)");
    p.write("c.asc", "ncols 2\nnrows 2\ncellsize 1\n1 2\n3\n");
    p.run("terrain info c.asc").failed(3, "c.asc: line 6: the file ends after 3 of 4 heights");
    p.write("d.raw", [1e30f32, -1e30].map(f32::to_le_bytes).concat());
    let d = p.done("terrain info d.raw --size 2x1 --type f32 --png d.png --json").json();
    assert_eq!(d["range"], serde_json::json!([f64::from(-1e30f32), f64::from(1e30f32)]));
    p.write("e.raw", f32::INFINITY.to_le_bytes());
    p.run("terrain info e.raw --size 1x1 --type f32").failed(3, "the height is infinite");
}

#[test]
fn several_grids_are_one_and_those_that_do_not_fit_are_named() {
    let p = Place::new();
    let tile = |n: i16| (0..n * n).flat_map(i16::to_be_bytes).collect::<Vec<u8>>();
    p.write("N57E011.hgt", tile(3));
    p.write("N57E012.hgt", tile(3));
    p.write("N57E014.hgt", tile(3));
    p.write("N58E011.hgt", tile(5));
    let info = p.done("terrain info N57E011.hgt N57E012.hgt N57E014.hgt --json").json();
    assert_eq!(
        (info["columns"].as_u64(), info["rows"].as_u64(), info["void"].as_u64()),
        (Some(9), Some(3), Some(3))
    );
    p.run("terrain info N57E011.hgt N58E011.hgt").failed(3, "N58E011.hgt has a spacing of 0.25 x 0.25");
    p.write("a.raw", [0; 4]);
    p.run("terrain info a.raw a.raw --size 2x2 --type u8").failed(3, "a.raw: does not say where it lies");
}

#[test]
fn a_landscape_is_the_same_in_every_format() {
    let p = Place::new();
    for name in ["a.tif", "a.asc", "a.r32", "a.png", "N00E000.hgt", "a.obj"] {
        p.done(&format!("generate terrain {name} --size 65 --seed 3 -q"));
    }
    let info = |arguments: &str| p.done(&format!("terrain info {arguments} --json")).json();
    let tif = info("a.tif");
    let range = |v: &serde_json::Value| [0, 1].map(|i| v["range"][i].as_f64().unwrap());
    assert_eq!((tif["columns"].as_u64(), tif["type"].as_str()), (Some(65), Some("f32")));
    assert_eq!(tif["spacing_metres"], serde_json::json!([480.0, 480.0]));
    // Text holds the shortest digits of the same f32.
    assert_eq!(range(&info("a.asc")).map(|h| h as f32), range(&tif).map(|h| h as f32));
    assert_eq!(range(&info("a.r32 --size 65x65 --type f32")), range(&tif));
    for whole in [info("a.png"), info("N00E000.hgt")] {
        assert_eq!(range(&whole), range(&tif).map(f64::round));
    }
    let mesh = p.info("a.obj");
    assert_eq!(mesh["meshes"][0]["faces"].as_u64(), Some(2 * 64 * 64));
    assert_eq!(mesh["bounds"][1][0].as_f64(), Some(30_720.0));
    assert!((mesh["bounds"][0][2].as_f64().unwrap() - range(&tif)[0]).abs() < 1e-3);
    let report = p.done("generate terrain b.tif --size 65 --seed 3 --json -q").json();
    assert_eq!((report["to"].as_str(), report["rows"].as_u64()), (Some("tiff"), Some(65)));
    assert_eq!(p.read("a.tif"), p.read("b.tif"));
    p.done("generate terrain b.tif --size 65 --seed 4 -q");
    assert_ne!(p.read("a.tif"), p.read("b.tif"));
    p.run("generate terrain c.tif --size 1").failed(2, "2 to 65,537 samples");
    p.run("generate terrain c.tif --faces 100").failed(2, "has no faces");
    p.run("generate terrain c.obj --size 9e4").failed(2, "--size 90,000");
    p.run("generate torus c.tif").failed(2, "--to");
    assert!(!p.exists("c.tif") && !p.exists("c.obj"));
}

#[test]
fn the_landscape_is_as_rough_as_it_shall_be() {
    let p = Place::new();
    let made = p.done("generate terrain a.tif --size 2049 --seed 1 --json -q").json();
    let range = made["range"][1].as_f64().unwrap() - made["range"][0].as_f64().unwrap();
    let error = range / 150.0;
    let tin =
        p.done(&format!("terrain tin a.tif a.ply --method greedy --max-error {error} --json -q")).json();
    let triangles = tin["triangles"].as_u64().unwrap();
    assert!((150_000..220_000).contains(&triangles), "{triangles}");
}
