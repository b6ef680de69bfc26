//! `--png`, end to end: what is in the file, what is left when it cannot be written.

mod common;

use common::Place;

/// Width, height and pixels of a PNG.
fn decoded(bytes: Vec<u8>) -> (usize, usize, Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut data = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut data).unwrap();
    assert_eq!(info.color_type, png::ColorType::Rgb);
    let pixels = data.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    (info.width as usize, info.height as usize, pixels)
}

/// Pixels that are not background among the columns of `range`, the caption at the bottom left out.
fn covered(png: &(usize, usize, Vec<[u8; 3]>), range: std::ops::Range<usize>) -> Vec<(usize, usize)> {
    let (width, height, pixels) = png;
    let in_range = |i: &usize| range.contains(&(i % width)) && i / width < height - 30;
    (0..pixels.len())
        .filter(in_range)
        .filter(|&i| pixels[i] != [255; 3])
        .map(|i| (i % width - range.start, i / width))
        .collect()
}

#[test]
fn input_and_result_stand_side_by_side() {
    let p = Place::new();
    p.generate("torus", "in.obj", 4000);
    p.done("simplify in.obj out.obj --ratio 0.25 --png both.png -q");
    let both = decoded(p.read("both.png"));
    let half = both.0 / 2;
    let (left, right) = (covered(&both, 0..half), covered(&both, half..both.0));
    assert!(left.len() > half * both.1 / 10, "{}", left.len());
    // The same camera: a coarser torus covers nearly the same pixels.
    let right: std::collections::HashSet<_> = right.into_iter().collect();
    let common = left.iter().filter(|at| right.contains(at)).count();
    let any = left.len() + right.len() - common;
    assert!(common as f64 / any as f64 > 0.97, "{common} of {any}");
    // Other facets, so other shades.
    let color = |x: usize, y: usize| both.2[y * both.0 + x];
    let shades = left.iter().filter(|&&(x, y)| color(x, y) != color(x + half, y)).count();
    assert!(shades > common / 4, "{shades} of {common}");

    let first = p.read("both.png");
    p.done("simplify in.obj out.obj --ratio 0.25 --png both.png -q --threads 1");
    assert_eq!(p.read("both.png"), first);
}

#[test]
fn info_draws_what_it_tells_of() {
    let p = Place::new();
    p.generate("cad", "in.glb", 500);
    let told = p.done("info in.glb -q").stdout;
    assert_eq!(p.done("info in.glb -q --png a.png").stdout, told);
    p.done("info in.glb -q --png b.png --wireframe");
    let (a, b) = (decoded(p.read("a.png")), decoded(p.read("b.png")));
    assert!(covered(&a, 0..a.0).len() > 10_000);
    assert_eq!(covered(&a, 0..a.0), covered(&b, 0..b.0));
    assert_ne!(a.2, b.2);
}

#[test]
fn an_empty_mesh_is_an_empty_picture() {
    let p = Place::new();
    p.write("in.off", "OFF\n0 0 0\n");
    p.done("info in.off -q --png a.png");
    let a = decoded(p.read("a.png"));
    assert_eq!(covered(&a, 0..a.0).len(), 0);
}

#[test]
fn wrong_use_and_failure_are_said() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 80);
    p.run("info in.obj --wireframe").failed(2, "--png");
    p.run("info in.obj --png -").failed(2, "to a path");
    p.run("info in.obj --png a.jpg").failed(2, "must end in .png");
    p.run("simplify in.obj out.obj --ratio 0.5 --png a.jpeg").failed(2, "must end in .png");
    p.write("directory/x", "");
    p.run("info in.obj --png directory").failed(4, "directory");
    p.write("bad.off", "OFF\n1 1 0\n0 0 0\n3 0 1 2\n");
    p.run("info bad.off --png a.png").failed(3, "bad.off");
    assert!(!p.exists("a.png"));
    let before = p.files();
    // Found out before the work, not after it; the picture's directory is not made, as the mesh's is not.
    for png in ["directory", "none/a.png", "in.obj/a.png"] {
        p.run(&format!("simplify in.obj out.obj --ratio 0.5 --png {png}"))
            .failed(4, &format!("error: {png}: "));
        p.run(&format!("info in.obj --png {png}")).failed(4, &format!("error: {png}: "));
    }
    p.run("info in.obj --png none/a.png").failed(4, "there is no directory none");
    assert_eq!(p.files(), before);
}

#[test]
fn the_caption_stands_below_the_mesh() {
    let p = Place::new();
    // A sheet that fills its view.
    p.generate("cad", "in.obj", 500);
    for mesh in ["in.obj", "tall.obj"] {
        p.write("tall.obj", "v 0 0 0\nv 1 0 0\nv 1 9 0\nv 0 9 0\nf 1 2 3 4\n");
        p.done(&format!("info {mesh} --png a.png -q"));
        let (width, height, pixels) = decoded(p.read("a.png"));
        let (above, below) = pixels.split_at(width * (height - 32));
        // Letters have soft edges, from white to their grey.
        let of_letters = |&[r, g, b]: &[u8; 3]| r == g && g == b && r >= 64;
        assert!(below.iter().all(of_letters) && below.contains(&[64; 3]), "{mesh}");
        assert!(!above.contains(&[64; 3]), "{mesh}");
    }
}

#[test]
fn drawing_is_in_the_times() {
    let p = Place::new();
    p.generate("sphere", "in.obj", 320);
    let run = p.done("simplify in.obj out.obj --ratio 0.5 --png a.png --json");
    let seconds = &run.json()["seconds"];
    let of = |name: &str| seconds[name].as_f64().unwrap();
    assert!(of("draw") > 0.0);
    let parts = ["read", "build", "simplify", "write", "draw"].map(of).iter().sum::<f64>();
    assert!(parts <= of("total") + 1e-3, "{seconds}");
    assert!(run.stderr.contains(", draw "), "{}", run.stderr);
    let run = p.done("simplify in.obj out.obj --ratio 0.5 --json");
    assert!(!run.stderr.contains("draw") && run.json()["seconds"]["draw"] == 0.0);
}
