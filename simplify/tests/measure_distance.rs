//! Closest points and sampled distances, against brute force.

mod common;

use common::distance::closest;
use common::sample;
use common::soups::{Soup, soup, surface};
use glam::DVec3;
use progmesh_simplify::measure::*;
use progmesh_simplify::{Control, Quiet};
use proptest::prelude::*;

fn brute(p: DVec3, (points, triangles): &Soup) -> f64 {
    let at = |v: u32| DVec3::from_array(points[v as usize]);
    triangles.iter().map(|t| closest(p, &t.map(at)).distance(p)).fold(f64::INFINITY, f64::min)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_closest_point_is_as_near_as_any(s in soup(60), asked in prop::collection::vec(prop::array::uniform3(-2.0..2.0f64), 20), far in -9..9i32) {
        let built = surface(&s);
        let mut query = built.query();
        for p in asked {
            let p = DVec3::from_array(p) * 10f64.powi(far.max(0));
            let found = query.closest(p);
            let want = brute(p, &s);
            prop_assert!((found.distance - want).abs() <= 1e-13 * (1.0 + p.length()), "{} {}", found.distance, want);
            // The point is the one its weights give, on the triangle named.
            prop_assert!(found.bary.iter().all(|&x| (0.0..=1.0).contains(&x)) && (found.bary.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let t = s.1[found.triangle as usize];
            let made: DVec3 = (0..3).map(|k| DVec3::from_array(s.0[t[k] as usize]) * found.bary[k]).sum();
            prop_assert!(made.distance(found.point) < 1e-13);
            prop_assert!((found.point.distance(p) - found.distance).abs() <= 1e-13 * (1.0 + p.length()));
        }
    }

    #[test]
    fn sampled_distances_are_those_of_brute_force(a in soup(12), b in soup(12), seed in 0u64..99) {
        let mut options = DistanceOptions::default();
        (options.samples, options.seed) = (300, seed);
        let d = distance(&surface(&a), &surface(&b), &options, &Quiet).unwrap();
        for (side, from, to) in [(&d.a_to_b, &a, &b), (&d.b_to_a, &b, &a)] {
            let far = side.farthest;
            // The farthest point is where it says.
            prop_assert!((brute(far.point, to) - side.summary.max).abs() < 1e-12);
            prop_assert!((far.point.distance(far.closest) - far.distance).abs() < 1e-12);
            let on = |p: DVec3, t: u32, s: &Soup| closest(p, &s.1[t as usize].map(|v| DVec3::from_array(s.0[v as usize]))).distance(p);
            prop_assert!(on(far.point, far.triangle, from) < 1e-12 && on(far.closest, far.closest_triangle, to) < 1e-12);
            // No vertex is farther.
            for &v in from.1.as_flattened() {
                prop_assert!(brute(DVec3::from_array(from.0[v as usize]), to) <= side.summary.max + 1e-12);
            }
            let s = &side.summary;
            let q = &s.quantiles;
            let rising = [0.0, q.p50, q.p90, q.p95, q.p99, q.p999, s.max];
            prop_assert!(rising.windows(2).all(|w| w[0] <= w[1]) && s.mean <= s.rms + 1e-12 && s.rms <= s.max + 1e-12);
        }
    }
}

#[test]
fn a_lifted_plane_is_as_far_as_it_was_lifted() {
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0f64]];
    let triangles = [[0, 1, 2], [0, 2, 3]];
    let a = Surface::new(&square[..], &triangles).unwrap();
    let b = Surface::new(&square.map(|p| [p[0], p[1], 0.25])[..], &triangles).unwrap();
    let d = distance(&a, &b, &DistanceOptions::default(), &Quiet).unwrap();
    let q = Quantiles { p50: 0.25, p90: 0.25, p95: 0.25, p99: 0.25, p999: 0.25 };
    assert_eq!(d.worse, Summary { max: 0.25, rms: 0.25, mean: 0.25, quantiles: q });
    assert_eq!(d.diagonal, 2f64.sqrt());
    assert_eq!(d.relative().unwrap().max, 0.25 / 2f64.sqrt());
    assert_eq!((d.a_to_b.samples, d.a_to_b.vertices), (300_000, 4));
}

#[test]
fn mean_and_quantiles_are_those_of_the_area() {
    // A square against a segment along one of its sides: the distance is x, evenly spread over 0..1.
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0f32]];
    let a = Surface::new(&points[..], &[[0, 1, 2], [0, 2, 3]]).unwrap();
    let b = Surface::new(&points[..], &[[0, 3, 3]]).unwrap();
    let d = distance(&a, &b, &DistanceOptions::default(), &Quiet).unwrap();
    let s = d.a_to_b.summary;
    assert_eq!(s.max, 1.0);
    assert!((s.mean - 0.5).abs() < 1e-5 && (s.rms - (1f64 / 3.0).sqrt()).abs() < 1e-5, "{s:?}");
    let q = s.quantiles;
    for (found, want) in [(q.p50, 0.5), (q.p90, 0.9), (q.p95, 0.95), (q.p99, 0.99), (q.p999, 0.999)] {
        assert!((found - want).abs() < 1e-3, "{found} {want}");
    }
    assert_eq!(d.b_to_a.summary, Summary::default());
}

#[test]
fn far_from_the_origin_a_mesh_measures_as_at_it() {
    // Multiples of 2^-10 survive the way to 1e6 and back.
    let at = |p: DVec3| (p * 1024.0).round() / 1024.0;
    let mesh = |name: &str, faces| {
        let m = sample(name, faces, 3);
        let points: Vec<[f64; 3]> = m.positions().iter().map(|p| at(p).to_array()).collect();
        (points, m.triangles())
    };
    let (a, b) = (mesh("scan", 2000), mesh("scan", 500));
    let moved = |s: &Soup, by: f64| (s.0.iter().map(|p| p.map(|x| x + by)).collect(), s.1.clone());
    let measure = |by: f64| {
        let (a, b): (Soup, Soup) = (moved(&a, by), moved(&b, by));
        distance(&surface(&a), &surface(&b), &DistanceOptions::default(), &Quiet).unwrap()
    };
    let (here, there) = (measure(0.0), measure(1048576.0));
    assert_eq!(here.worse, there.worse);
    assert!(here.worse.max > 0.0);
}

#[test]
fn a_surface_against_itself_and_its_triangulation_is_at_zero() {
    let m = sample("quad-sphere", 600, 1);
    let a = Surface::from_mesh(&m).unwrap();
    let b = Surface::from_mesh(&m.triangulate().unwrap().mesh).unwrap();
    let d = distance(&a, &b, &DistanceOptions::default(), &Quiet).unwrap();
    assert!(a.triangle_count() >= 600 && d.worse.max < 1e-15 * d.diagonal, "{d:?}");
    assert!((a.area() - b.area()).abs() < 1e-12 * a.area());
}

#[test]
fn distances_do_not_depend_on_threads_and_do_on_the_seed() {
    let (a, b) = (sample("torus", 20_000, 1), sample("torus", 900, 1));
    let (a, b) = (Surface::from_mesh(&a).unwrap(), Surface::from_mesh(&b).unwrap());
    let run = |threads, seed| {
        let mut o = DistanceOptions::default();
        (o.threads, o.samples, o.seed) = (Some(threads), 20_000, seed);
        distance(&a, &b, &o, &Quiet).unwrap()
    };
    let one = run(1, 1);
    assert_eq!(one, run(2, 1));
    assert_eq!(one, run(5, 1));
    let other = run(2, 2);
    assert_ne!(one.worse.mean, other.worse.mean);
    assert!((one.worse.mean / other.worse.mean - 1.0).abs() < 0.01);
}

#[test]
fn vertex_distances_name_the_vertices_of_the_input() {
    // Vertex 1 is of no triangle.
    let points = [[0.0, 0.0, 0.5], [9.0, 9.0, 9.0], [1.0, 0.0, 0.25], [0.0, 1.0, 0.125f32]];
    let a = Surface::new(&points[..], &[[0, 2, 3]]).unwrap();
    let ground = [[-5.0, -5.0, 0.0], [5.0, -5.0, 0.0], [0.0, 9.0, 0.0f32]];
    let b = Surface::new(&ground[..], &[[0, 1, 2]]).unwrap();
    let d = vertex_distances(&a, &b, &Quiet).unwrap();
    assert!(d[1].is_nan());
    assert_eq!((d[0], d[2], d[3]), (0.5, 0.25, 0.125));
    assert_eq!((a.vertex_count(), a.triangle_count()), (3, 1));
}

#[test]
fn what_is_no_surface_is_refused() {
    let points = [[0.0, 0.0, 0.0], [1.0, f32::NAN, 0.0], [0.0, 1.0, 0.0]];
    let refused = |t: &[[u32; 3]]| Surface::new(&points[..], t).unwrap_err();
    assert_eq!(refused(&[]), MeasureError::NoTriangle);
    assert_eq!(
        refused(&[[0, 2, 2], [0, 3, 2]]),
        MeasureError::OutOfRange { triangle: 1, vertex: 3, vertices: 3 }
    );
    assert_eq!(refused(&[[0, 1, 2]]), MeasureError::NotFinite { vertex: 1, triangle: 0 });
    assert!(Surface::new(&points[..], &[[0, 2, 2]]).is_ok(), "vertices of no triangle do not matter");
}

#[test]
fn sizes_at_the_ends_of_the_number_range_measure() {
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0f64]];
    for size in [1e-300, 1e-30, 1e30, 1e300] {
        let of = |z: f64| {
            Surface::new(&square.map(|p| [p[0] * size, p[1] * size, z * size])[..], &[[0, 1, 2], [0, 2, 3]])
                .unwrap()
        };
        let d = distance(&of(0.0), &of(0.5), &DistanceOptions::default(), &Quiet).unwrap();
        assert!((d.worse.max / (0.5 * size) - 1.0).abs() < 1e-12, "{size}: {:?}", d.worse);
        assert!((d.worse.mean / (0.5 * size) - 1.0).abs() < 1e-12, "{size}: {:?}", d.worse);
    }
}

#[test]
fn surfaces_of_one_point_measure() {
    let a = Surface::new(&[[1.0, 2.0, 3.0f32]][..], &[[0, 0, 0]]).unwrap();
    let b = Surface::new(&[[1.0, 2.0, 5.0f32]][..], &[[0, 0, 0]]).unwrap();
    let d = distance(&a, &b, &DistanceOptions::default(), &Quiet).unwrap();
    assert_eq!((d.worse.max, d.worse.mean, d.diagonal, d.relative()), (2.0, 2.0, 0.0, None));
    assert!(a.query().distance(DVec3::NAN).is_nan());
}

/// Stops when asked for the n-th time, and remembers the progress.
struct Stopper(std::sync::Mutex<(usize, Vec<f64>)>);

impl Control for Stopper {
    fn progress(&self, done: f64) {
        self.0.lock().unwrap().1.push(done);
    }
    fn cancelled(&self) -> bool {
        let mut inner = self.0.lock().unwrap();
        inner.0 = inner.0.saturating_sub(1);
        inner.0 == 0
    }
}

#[test]
fn measuring_can_be_stopped_and_tells_how_far_it_is() {
    let a = Surface::from_mesh(&sample("torus", 2000, 1)).unwrap();
    let run = |stop_after| {
        let stopper = Stopper(std::sync::Mutex::new((stop_after, Vec::new())));
        (distance(&a, &a, &DistanceOptions::default(), &stopper), stopper.0.into_inner().unwrap().1)
    };
    assert_eq!(run(20).0, Err(MeasureError::Cancelled));
    let (done, told) = run(usize::MAX);
    assert!(done.is_ok() && told.windows(2).all(|w| w[0] <= w[1]));
    assert_eq!(told.last(), Some(&1.0));
    let mut none = DistanceOptions::default();
    none.samples = 0;
    assert!(matches!(distance(&a, &a, &none, &Quiet), Err(MeasureError::Range { option: "samples", .. })));
}
