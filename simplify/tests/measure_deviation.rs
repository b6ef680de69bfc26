//! Deviations of normals and values, shapes of triangles, topology.

mod common;

use common::sample;
use progmesh_aif::{BuildOptions, Channel, Mesh, MeshInput, Positions, Semantic, Wedges};
use progmesh_simplify::Quiet;
use progmesh_simplify::measure::*;

const SQUARE: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
const HALVES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

fn options(samples: usize) -> DistanceOptions {
    let mut o = DistanceOptions::default();
    o.samples = samples;
    o
}

/// A square whose corners have uv as given, in the order of SQUARE.
fn square(uv: [[f32; 2]; 4], z: f64) -> Mesh {
    let mut w = Wedges::new(vec![Channel::new(Semantic::TexCoord(0), 2)]).unwrap();
    uv.iter().for_each(|row| {
        w.push(row, 1);
    });
    w.corner = HALVES.as_flattened().to_vec();
    let input = MeshInput {
        positions: Positions::F64(SQUARE.map(|p| [p[0], p[1], z]).to_vec()),
        corners: HALVES.as_flattened().to_vec(),
        wedges: Some(w),
        ..Default::default()
    };
    Mesh::build(input, &BuildOptions::default()).unwrap().0
}

#[test]
fn values_deviate_by_what_they_are_moved() {
    let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let (a, b) = (square(uv, 0.0), square(uv.map(|[u, v]| [u + 0.03, v + 0.04]), 0.01));
    let values = |m: &Mesh| CornerValues::of_mesh(m).unwrap();
    let (sa, sb) = (Surface::from_mesh(&a).unwrap(), Surface::from_mesh(&b).unwrap());
    let d = deviations((&sa, &values(&a)), (&sb, &values(&b)), &options(5000), &Quiet).unwrap();
    let [(semantic, uv)] = &d.values[..] else { panic!("{:?}", d.values) };
    assert_eq!(*semantic, Semantic::TexCoord(0));
    for side in [uv.a_to_b, uv.b_to_a, uv.worse] {
        assert!((side.rms - 0.05).abs() < 1e-6 && (side.max - 0.05).abs() < 1e-6, "{side:?}");
    }
    assert_eq!((uv.a_to_b.samples, uv.worse.samples), (5000, 10_000));
    assert_eq!((d.normals.worse.rms, d.normals.worse.max), (0.0, 0.0));
    // Along x the second stretches: the deviation is x / 10, its rms that over the root of 3.
    let c = square([[0.0, 0.0], [1.1, 0.0], [1.1, 1.0], [0.0, 1.0]], 0.0);
    let sc = Surface::from_mesh(&c).unwrap();
    let d = deviations((&sa, &values(&a)), (&sc, &values(&c)), &options(100_000), &Quiet).unwrap();
    let worse = d.values[0].1.worse;
    assert!((worse.rms - 0.1 / 3f64.sqrt()).abs() < 1e-5 && (worse.max - 0.1).abs() < 1e-3, "{worse:?}");
    // One without values.
    let d = deviations((&sa, &values(&a)), (&sc, &[]), &options(100), &Quiet).unwrap();
    assert!(d.values.is_empty());
}

#[test]
fn missing_values_do_not_count_and_wrong_numbers_are_refused() {
    let a = Surface::new(&SQUARE[..], &HALVES).unwrap();
    let mut grey = vec![0.5f32; 6];
    let full = CornerValues::new(Semantic::Color(0), 1, grey.clone()).unwrap();
    grey[..3].fill(f32::NAN);
    let half = CornerValues::new(Semantic::Color(0), 1, grey.clone()).unwrap();
    let d = deviations((&a, &[full]), (&a, std::slice::from_ref(&half)), &options(1000), &Quiet).unwrap();
    let worse = d.values[0].1.worse;
    assert_eq!(worse.max, 0.0);
    assert!((900..=1100).contains(&worse.samples), "{worse:?}");
    assert!(CornerValues::new(Semantic::Color(0), 4, grey.clone()).is_err());
    let short = CornerValues::new(Semantic::Color(0), 1, grey[..3].to_vec()).unwrap();
    assert!(deviations((&a, &[short]), (&a, &[half]), &options(10), &Quiet).is_err());
}

#[test]
fn normals_deviate_by_the_angle_of_a_ramp() {
    let slope = 0.1f64;
    let ramp = Surface::new(&SQUARE.map(|[x, y, _]| [x, y, x * slope])[..], &HALVES).unwrap();
    let flat = Surface::new(&SQUARE[..], &HALVES).unwrap();
    let d = deviations((&flat, &[]), (&ramp, &[]), &options(1000), &Quiet).unwrap();
    let angle = slope.atan().to_degrees();
    for side in [d.normals.a_to_b, d.normals.b_to_a, d.normals.worse] {
        assert!((side.rms - angle).abs() < 1e-9 && (side.max - angle).abs() < 1e-9, "{side:?} {angle}");
    }
    let turned = Surface::new(&SQUARE[..], &HALVES.map(|[a, b, c]| [b, a, c])).unwrap();
    let d = deviations((&flat, &[]), (&turned, &[]), &options(1000), &Quiet).unwrap();
    assert!((d.normals.worse.rms - 180.0).abs() < 1e-9);
}

#[test]
fn deviations_do_not_depend_on_threads() {
    let (a, b) = (sample("scan", 8000, 1), sample("scan", 900, 1));
    let (a, b) = (Surface::from_mesh(&a).unwrap(), Surface::from_mesh(&b).unwrap());
    let run = |threads| {
        let mut o = options(10_000);
        o.threads = Some(threads);
        deviations((&a, &[]), (&b, &[]), &o, &Quiet).unwrap()
    };
    assert_eq!(run(1), run(4));
    assert!(run(1).normals.worse.rms > 0.0);
}

#[test]
fn turned_triangles_are_named() {
    let m = sample("torus", 2000, 1);
    let mut triangles = m.triangles();
    for t in [3, 700, 701, 1500] {
        triangles[t].swap(0, 1);
    }
    let a = Surface::from_mesh(&m).unwrap();
    let b = Surface::new(m.positions(), &triangles).unwrap();
    assert_eq!(turned_triangles(&a, &b, &Quiet).unwrap(), [3, 700, 701, 1500]);
    assert_eq!(turned_triangles(&a, &a, &Quiet).unwrap(), []);
    assert_eq!(
        turned_triangles(&a, &Surface::from_mesh(&sample("torus", 300, 1)).unwrap(), &Quiet).unwrap(),
        []
    );
}

#[test]
fn shapes_are_those_of_the_triangles() {
    let h = 3f64.sqrt() / 2.0;
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, h, 0.0], [0.5, 0.01, 0.0], [2.0, 0.0, 0.0f64]];
    let q = triangle_quality(&Surface::new(&points[..], &[[0, 1, 2]]).unwrap());
    assert!((q.max - 1.0 / h).abs() < 1e-12 && (q.mean - q.max).abs() < 1e-12 && q.degenerate == 0);
    // A cap one long and 0.01 high; a triangle on a line.
    let q = triangle_quality(&Surface::new(&points[..], &[[0, 1, 2], [0, 1, 3], [0, 1, 4]]).unwrap());
    assert!((q.max - 100.0).abs() < 1e-9 && q.degenerate == 1, "{q:?}");
    assert!((q.mean - (100.0 + 1.0 / h) / 2.0).abs() < 1e-9 && (q.quantiles.p50 - 1.0 / h).abs() < 1e-12);
    let none = triangle_quality(&Surface::new(&points[..], &[[0, 1, 4]]).unwrap());
    assert_eq!((none.max, none.degenerate), (0.0, 1));
}

#[test]
fn topology_is_summed_up() {
    let torus = TopologySummary::of(&sample("torus", 400, 1));
    assert_eq!((torus.components, torus.border_loops, torus.genus, torus.euler), (1, 0, Some(1), 0));
    let points: Vec<[f32; 3]> =
        vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
    let fins = Mesh::from_triangles(points, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]]).unwrap();
    let fins = TopologySummary::of(&fins);
    assert_eq!((fins.components, fins.non_manifold_edges, fins.genus), (1, 1, None));
}
