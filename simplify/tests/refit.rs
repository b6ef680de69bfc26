//! Vertex refit: nearer, never farther, and nothing else changed.

mod common;

use common::distance::Surface;
use common::{any_sample, border, input_of, sample, topology_of};
use glam::DVec3;
use progmesh_aif::*;
use progmesh_meshes::{GenerateOptions, generate};
use progmesh_simplify::*;
use proptest::prelude::*;

const NAMES: [&str; 6] = ["sphere", "torus", "scan", "cad", "quad-sphere", "terrain"];

fn refitted(input: &Mesh, sweeps: Option<usize>, set: impl FnOnce(&mut Options)) -> (Mesh, Outcome) {
    let mut o = Options::default();
    (o.ratio, o.refit) = (Some(0.1), sweeps);
    set(&mut o);
    let mut m = input.clone();
    let out = simplify(&mut m, &o, &Quiet).unwrap();
    assert_eq!(m.check(), Ok(()));
    (m, out)
}

/// Ten points on every triangle.
fn dense(m: &Mesh) -> Vec<DVec3> {
    let at = |v: u32| m.positions().get(v as usize);
    let grid = || (0..4).flat_map(|i| (0..4 - i).map(move |j| (i as f64 / 3.0, j as f64 / 3.0)));
    m.triangles()
        .iter()
        .map(|t| t.map(at))
        .flat_map(|[a, b, c]| grid().map(move |(u, v)| a + (b - a) * u + (c - a) * v))
        .collect()
}

fn diagonal(m: &Mesh) -> f64 {
    m.surface_bounds().map_or(0.0, |(a, b)| (b - a).length())
}

#[test]
fn every_sweep_brings_the_surface_nearer() {
    for name in NAMES {
        let input = sample(name, 3000, 0);
        let points = dense(&input.clone().triangulate().unwrap().mesh);
        let rms = [0, 1, 2].map(|n| {
            let (m, _) = refitted(&input, Some(n), |_| ());
            Surface::new(&m).rms(points.iter().copied()) / diagonal(&input)
        });
        println!("{name}: {rms:?}");
        // The block's planes are exact before.
        let gain = if name == "cad" { 1.0 } else { 0.97 };
        assert!(rms[1] <= rms[0] * gain && rms[2] <= rms[1] * 1.005, "{name}: {rms:?}");
    }
}

#[test]
fn borders_come_nearer_too() {
    let input = sample("scan", 4000, 1);
    let t = input.topology();
    let rim: Vec<DVec3> = t
        .edges()
        .filter(|&e| t.edge_faces(e).len() == 1)
        .flat_map(|e| {
            let [a, b] = t.edge_vertices(e).map(|v| input.position(v));
            [a, a.lerp(b, 0.5)]
        })
        .collect();
    let rms = [0, 2].map(|n| {
        let (m, _) = refitted(&input, Some(n), |_| ());
        let t = m.topology();
        let sides: Vec<[DVec3; 2]> = t
            .edges()
            .filter(|&e| t.edge_faces(e).len() == 1)
            .map(|e| t.edge_vertices(e).map(|v| m.position(v)))
            .collect();
        let to_side = |p: DVec3, [a, b]: [DVec3; 2]| {
            let s = (p - a).dot(b - a) / (b - a).length_squared();
            p.distance_squared(a.lerp(b, s.clamp(0.0, 1.0)))
        };
        let near = |p: &DVec3| sides.iter().map(|&s| to_side(*p, s)).fold(f64::INFINITY, f64::min);
        rim.iter().map(near).sum::<f64>()
    });
    assert!(rms[1] < rms[0], "{rms:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn only_places_change_and_no_face_turns_over((name, faces, seed) in any_sample(1200), ratio in 0.02f64..0.9, lock in any::<bool>()) {
        let input = sample(name, faces, seed);
        let set = |o: &mut Options| {
            (o.ratio, o.lock_border) = (Some(ratio), lock);
            (0..input.vertex_count()).step_by(7).for_each(|v| o.locked_vertices.set(v));
        };
        let ((plain, a), (m, b)) = (refitted(&input, Some(0), set), refitted(&input, Some(3), set));
        let (x, y) = (plain.to_input(), m.to_input());
        prop_assert_eq!(x.corners, y.corners);
        prop_assert_eq!((x.face_material, x.wires), (y.face_material, y.wires));
        prop_assert_eq!((a.stop, a.vertex_origin), (b.stop, b.vertex_origin.clone()));
        prop_assert_eq!(topology_of(&plain), topology_of(&m));
        if lock {
            prop_assert_eq!(border(&m), border(&input));
        }
        for (v, &origin) in b.vertex_origin.iter().enumerate() {
            if origin % 7 == 0 {
                prop_assert_eq!(m.positions().bits(v), input.positions().bits(origin as usize));
            }
        }
        // By 78 degrees at most; a face without a normal has none to turn. What is tested is about the local frame, hence the slack.
        for f in plain.topology().faces() {
            let (n, k) = (plain.face_normal(f), m.face_normal(f));
            let cos = n.normalize_or_zero().dot(k.normalize_or_zero());
            prop_assert!(cos >= 0.2 - 1e-6 || n.length() == 0.0 || k.length() == 0.0, "{} {:?}: {}", name, f, cos);
        }
    }

    #[test]
    fn the_estimate_counts_the_refit_and_keeps_the_bound((name, faces, seed) in any_sample(1200), log in -4.0f64..-1.0) {
        let input = sample(name, faces, seed);
        let bound = 10f64.powf(log) * diagonal(&input);
        let set = |o: &mut Options| {
            (o.ratio, o.max_error) = (None, Some(MaxError { value: bound, relative: false }));
        };
        let (plain, _) = refitted(&input, Some(0), set);
        let (m, out) = refitted(&input, Some(2), set);
        prop_assert!(out.estimate <= bound, "{} > {bound}", out.estimate);
        prop_assert_eq!(m.to_input().corners, plain.to_input().corners);
    }
}

#[test]
fn what_lies_right_stays_to_the_bit() {
    // Planes, along the axes and not, and a mesh that was not collapsed.
    let flat = |f: fn(f32, f32) -> f32| {
        let n = 24u32;
        let at = |i: u32| ((i % (n + 1)) as f32, (i / (n + 1)) as f32);
        let points: Vec<_> = (0..(n + 1) * (n + 1)).map(at).map(|(x, y)| [x, y, f(x, y)]).collect();
        let quad = |i: u32| {
            let a = i / n * (n + 1) + i % n;
            [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
        };
        Mesh::from_triangles(points, (0..n * n).map(quad).collect::<Vec<_>>().as_flattened()).unwrap()
    };
    for input in [flat(|_, _| 7.0), flat(|x, y| 0.5 * x - 0.25 * y), flat(|x, _| x.max(24.0 - x))] {
        let (plain, _) = refitted(&input, Some(0), |_| ());
        let (m, _) = refitted(&input, Some(3), |_| ());
        assert_eq!(m.positions(), plain.positions());
    }
    let input = sample("scan", 800, 0);
    assert_eq!(refitted(&input, Some(2), |o| o.ratio = Some(1.0)).0.positions(), input.positions());
}

#[test]
fn small_inputs_are_refitted_without_being_asked() {
    let same = |a: &Mesh, b: &Mesh| a.positions() == b.positions();
    let small = sample("sphere", 5000, 0);
    assert!(small.face_count() <= REFIT_LIMIT);
    assert!(same(&refitted(&small, None, |_| ()).0, &refitted(&small, Some(2), |_| ()).0));
    assert!(!same(&refitted(&small, None, |_| ()).0, &refitted(&small, Some(0), |_| ()).0));
    let large = sample("sphere", 20_000, 0);
    assert!(large.face_count() > REFIT_LIMIT);
    assert!(same(&refitted(&large, None, |_| ()).0, &refitted(&large, Some(0), |_| ()).0));
    assert!(!same(&refitted(&large, Some(1), |_| ()).0, &refitted(&large, Some(0), |_| ()).0));
}

#[test]
fn what_must_not_move_does_not() {
    let input = sample("scan", 2000, 3);
    for placement in [Placement::Endpoint, Placement::Midpoint] {
        let set = |o: &mut Options| o.placement = Some(placement);
        let (a, b) = (refitted(&input, Some(0), set).0, refitted(&input, Some(3), set).0);
        assert_eq!(a.positions(), b.positions());
    }
    assert_eq!(refitted(&input, Some(3), |o| o.keep_vertices = true).0.positions(), input.positions());
    let run = |refit| {
        let mut meshes = [input.clone()];
        let mut o = Options::default();
        (o.ratio, o.refit) = (Some(0.2), refit);
        record_all(&mut meshes, &[1.0], &o, &Quiet).unwrap();
        let [m] = meshes;
        m
    };
    assert_eq!(run(Some(3)).positions(), run(Some(0)).positions());
}

#[test]
fn new_places_lie_on_the_grid() {
    let (m, _) = refitted(&sample("sphere", 3000, 0), Some(2), |o| o.grid = Some(1.0 / 256.0));
    let (plain, _) = refitted(&sample("sphere", 3000, 0), Some(0), |o| o.grid = Some(1.0 / 256.0));
    assert_ne!(m.positions(), plain.positions());
    let off = |p: DVec3| (p * 256.0).fract().abs().max_element() > 0.0;
    let before: Vec<_> = plain.positions().iter().collect();
    assert!(m.positions().iter().zip(before).all(|(p, q)| p == q || !off(p)));
}

#[test]
fn threads_change_nothing() {
    let input = sample("scan", 30_000, 0);
    let with = |threads| refitted(&input, Some(2), |o| (o.threads, o.ratio) = (Some(threads), Some(0.4))).0;
    let (one, three) = (with(1), with(3));
    assert_eq!(one.positions(), three.positions());
    assert!(one.to_input().wedges == three.to_input().wedges);
}

#[test]
fn far_from_the_origin_and_at_any_size_it_does_as_well() {
    let ball = sample("torus", 3000, 0);
    let mapped = |wide: bool, f: &dyn Fn(DVec3) -> DVec3| {
        let mut input = ball.to_input();
        let points = input.positions.iter().map(|p| f(p).to_array());
        input.positions = match wide {
            true => Positions::F64(points.collect()),
            false => Positions::F32(points.map(|p| p.map(|x| x as f32)).collect()),
        };
        Mesh::build(input, &BuildOptions::default()).unwrap().0
    };
    let gain = |m: &Mesh| {
        let points = dense(m);
        let rms = [0, 2].map(|n| Surface::new(&refitted(m, Some(n), |_| ()).0).rms(points.iter().copied()));
        rms[1] / rms[0]
    };
    let usual = gain(&ball);
    assert!(usual < 0.97, "{usual}");
    let shift = |p: DVec3| p + DVec3::splat(1e6);
    assert!((gain(&mapped(true, &shift)) - usual).abs() < 0.02);
    for size in [1e-25, 1e12] {
        let found = gain(&mapped(false, &|p| p * size));
        assert!((found - usual).abs() < 0.02, "{size}: {found} {usual}");
    }
    // f32 is coarse there: a sixteenth of a unit. What is stored must not be farther for it.
    let coarse = gain(&mapped(false, &shift));
    assert!(coarse <= 1.0 + 1e-9, "{coarse}");
}

#[test]
fn attributes_follow_the_vertices() {
    // A linear field on a hilly sheet: a vertex that slides must take the value of where it comes to lie.
    let hills = sample("terrain", 3000, 2);
    let mut input = hills.to_input();
    let mut w = Wedges::new(vec![Channel::new(Semantic::Custom("place".into()), 3)]).unwrap();
    for p in input.positions.iter() {
        w.push(&p.to_array().map(|x| x as f32), 1);
    }
    w.corner = input.corners.clone();
    input.wedges = Some(w);
    let input = Mesh::build(input, &BuildOptions::default()).unwrap().0;
    let off = |m: &Mesh| {
        let (t, w) = (m.topology(), m.wedges().unwrap());
        let mut sum = 0.0;
        for f in t.faces() {
            for (c, v) in t.corner_range(f).zip(t.face_vertices(f)) {
                let value = w.get(w.corner[c], 0).unwrap();
                sum +=
                    (DVec3::new(value[0] as f64, value[1] as f64, value[2] as f64) - m.position(v)).length();
            }
        }
        sum / (3 * m.face_count()) as f64
    };
    let (plain, _) = refitted(&input, Some(0), |_| ());
    let (m, _) = refitted(&input, Some(2), |_| ());
    let moved: f64 =
        plain.positions().iter().zip(m.positions().iter()).map(|(p, q)| p.distance(q)).sum::<f64>()
            / m.vertex_count() as f64;
    println!("{} {} {moved}", off(&plain), off(&m));
    assert!(off(&m) < off(&plain) + 0.6 * moved, "{} {} {moved}", off(&m), off(&plain));
}

#[test]
fn normals_stay_of_unit_length() {
    let s = generate("quad-sphere", &GenerateOptions::default().with_faces(3000)).unwrap();
    let input = Mesh::build(input_of(&s), &BuildOptions::default()).unwrap().0;
    let (m, _) = refitted(&input, Some(2), |_| ());
    let w = m.wedges().unwrap();
    let k = w.channel(&Semantic::Normal).unwrap();
    for &c in w.corner.iter() {
        let n = w.get(c, k).unwrap();
        let length = n.iter().map(|x| (*x as f64).powi(2)).sum::<f64>().sqrt();
        assert!((length - 1.0).abs() < 1e-5, "{length}");
    }
}
