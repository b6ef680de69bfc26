//! The same bytes for one thread and for several, and from run to run.

mod common;

use common::Place;

#[test]
fn the_output_does_not_depend_on_the_number_of_threads() {
    let p = Place::new();
    p.generate("scan", "scan.obj", 3000);
    p.generate("quad-sphere", "sphere.obj", 600);
    for (file, how) in [
        ("scan.obj", "--ratio 0.2 --schedule bulk"),
        ("scan.obj", "--ratio 0.2 --schedule exact"),
        ("scan.obj", "--ratio 0.5 --refit 3"),
        ("scan.obj", "--method nsa --passes 3"),
        ("scan.obj", "--method cluster --ratio 0.2"),
        ("sphere.obj", "--ratio 0.3 --normals recompute"),
    ] {
        let outputs = [1, 2, 2].map(|threads| {
            p.run(&format!("simplify {file} out.obj {how} --threads {threads} -q"));
            p.read("out.obj")
        });
        assert!(outputs[0] == outputs[1], "{file} {how}: one and two threads differ");
        assert!(outputs[1] == outputs[2], "{file} {how}: two runs differ");
    }
}

#[test]
fn generated_meshes_depend_on_the_seed_alone() {
    let p = Place::new();
    for file in ["a.obj", "b.obj"] {
        p.done(&format!("generate scan {file} --faces 500 --seed 3"));
    }
    p.done("generate scan c.obj --faces 500 --seed 4");
    assert!(p.read("a.obj") == p.read("b.obj"));
    assert!(p.read("a.obj") != p.read("c.obj"));
}
