//! `progmesh levels`, end to end.

mod common;

use common::Place;

#[test]
fn levels_of_both_methods_stand_at_nsas_counts() {
    let p = Place::new();
    p.generate("scan", "in.ply", 3000);
    let passes = p.done("simplify in.ply out.ply --method nsa --json").json();
    let counts: Vec<u64> =
        passes["levels"].as_array().unwrap().iter().map(|l| l["faces"].as_u64().unwrap()).collect();
    assert!(counts.len() > 2);
    let found = p.done("levels in.ply --json --runs 1 --samples 2000").json();
    assert_eq!((found["command"].as_str(), found["threads"].as_u64()), (Some("levels"), Some(1)));
    let methods = found["methods"].as_array().unwrap();
    assert_eq!(methods.iter().map(|m| m["method"].as_str().unwrap()).collect::<Vec<_>>(), ["nsa", "quadric"]);
    let faces = |m: usize| -> Vec<u64> {
        let levels = methods[m]["levels"].as_array().unwrap();
        levels.iter().map(|l| l["faces"].as_u64().unwrap()).collect()
    };
    assert_eq!(faces(0), counts);
    // A split at the border makes one face, others two: the quadric method may pass a count by one.
    for (have, want) in faces(1).iter().zip(&counts) {
        assert!(have <= want && have + 1 >= *want, "{have} {want}");
    }
    for m in methods {
        let rms: Vec<f64> =
            m["levels"].as_array().unwrap().iter().map(|l| l["measured"]["rms"].as_f64().unwrap()).collect();
        assert!(rms[0] > 0.0 && rms[0] < *rms.last().unwrap(), "{rms:?}");
        for l in m["levels"].as_array().unwrap() {
            assert!(
                ["simplify", "coarsen", "refine"].iter().all(|t| l["seconds"][t].as_f64().unwrap() >= 0.0)
            );
        }
    }
}

#[test]
fn polygons_scenes_and_a_chosen_method_will_do() {
    let p = Place::new();
    p.generate("quad-sphere", "in.obj", 400);
    let told = p.done("levels in.obj --method quadric --runs 1 --samples 0 --epsilon 40 --passes 2").stdout;
    assert!(told.starts_with("in.obj: 768 faces; one thread, one run"), "{told}");
    assert!(told.contains("quadric") && !told.contains("nsa ") && told.contains("level 2"), "{told}");
    assert!(!told.contains("level 3"));
}

#[test]
fn the_plot_is_an_svg_without_references() {
    let p = Place::new();
    p.generate("torus", "in.obj", 1000);
    p.done("levels in.obj --runs 1 --samples 1000 --epsilon 40 --plot plot.svg -q");
    let svg = p.text("plot.svg");
    assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
    assert!(svg.contains("nsa, rms") && svg.contains("quadric: refine"));
    assert!(!svg.contains("href") && !svg.contains("<script"));
    p.run("levels in.obj --plot plot.png").failed(2, "must end in .svg");
    p.run("levels in.obj --plot none/plot.svg").failed(4, "there is no directory");
    p.run("levels none.obj").failed(3, "none.obj");
}

#[test]
fn a_mesh_without_levels_is_said_to_have_none() {
    let p = Place::new();
    p.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let run = p.done("levels t.obj --runs 1");
    assert!(run.stderr.contains("no level but the input"), "{}", run.stderr);
}
