//! Networks of small grids, checked by code that shares nothing with what makes them.

use progmesh_terrain::Grid;
use progmesh_terrain::tin::{
    Contract, Made, Method, Options, Quiet, TinError, triangulate, verify, verify_outline,
};
use proptest::prelude::*;

const METHODS: [Method; 4] = [Method::Regular, Method::Greedy, Method::Decimation, Method::Best];

fn make(grid: &Grid, options: &Options) -> Made {
    let made = triangulate(grid, options, &Quiet).unwrap();
    let verdict = verify(grid, &made.tin, options.max_error.unwrap_or(f64::INFINITY), options.contract);
    let surface = verify(grid, &made.tin, f64::INFINITY, Contract::Surface).surface_error;
    assert!(
        surface <= made.errors.surface + 1e-9 && made.errors.surface <= surface + 1e-3,
        "{options:?}: {surface} {:?}",
        made.errors
    );
    assert!(verdict.is_good() && verdict.exact, "{options:?}: {verdict:?}");
    assert!((verdict.max_error - made.errors.max).abs() <= 1e-9 * verdict.max_error.max(1.0));
    assert_eq!(verdict.isolated, made.isolated);
    assert!(made.tin.heights.iter().all(|&h| f64::from(h as f32) == h));
    assert!(made.tin.triangles.len() <= made.grid_triangles);
    made
}

/// A rough surface: octaves of sines, and a bump.
fn rough(columns: usize, rows: usize) -> Grid {
    let height = |i: usize| {
        let (x, y) = ((i % columns) as f64, (i / columns) as f64);
        let octaves: f64 = (0..5)
            .map(|k| {
                let f = 0.05 * 2f64.powi(k);
                (f * x + 0.7 * f64::from(k)).sin() * (1.3 * f * y).cos() / f
            })
            .sum();
        octaves * 4.0 + 100.0 * (-((x - 20.0).powi(2) + (y - 30.0).powi(2)) / 60.0).exp()
    };
    Grid::new(columns, rows, (0..columns * rows).map(height).collect()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Any heights, any voids: covered exactly once, within the error, by every method.
    #[test]
    fn every_method_keeps_the_error(
        columns in 2..14usize,
        rows in 2..14usize,
        heights in proptest::collection::vec(-30..30i32, 196),
        void in proptest::collection::vec(0..100u32, 196),
        share in prop_oneof![Just(0u32), Just(8), Just(35)],
        tenths in prop_oneof![Just(0u32), 1..300u32],
    ) {
        let height = |i: usize| if void[i] < share { f64::NAN } else { f64::from(heights[i]) / 10.0 };
        let grid = Grid::new(columns, rows, (0..columns * rows).map(height).collect()).unwrap();
        // Tenths are no multiples of a quantum: what rounding takes must be left.
        let error = f64::from(tenths) / 10.0 + 1e-3;
        for method in METHODS {
            for (on_samples, contract) in [
                (false, Contract::Samples),
                (true, Contract::Samples),
                (false, Contract::Surface),
                (true, Contract::Surface),
            ] {
                let options = Options::default()
                    .with_max_error(error)
                    .with_method(method)
                    .with_on_samples(on_samples)
                    .with_contract(contract);
                match triangulate(&grid, &options, &Quiet) {
                    Ok(_) => drop(make(&grid, &options)),
                    Err(e) => prop_assert_eq!(e, TinError::Nothing),
                }
            }
        }
    }
}

#[test]
fn the_best_takes_far_fewer_triangles_than_greedy_insertion() {
    let grid = rough(160, 120);
    for error in [8.0, 2.0] {
        let options = Options::default().with_max_error(error);
        let greedy = make(&grid, &options.clone().with_method(Method::Greedy)).tin.triangles.len();
        let best = make(&grid, &options).tin.triangles.len();
        let on_samples = make(&grid, &options.with_on_samples(true)).tin.triangles.len();
        assert!(best * 100 <= greedy * 65, "{error}: {best} of {greedy}");
        assert!(on_samples * 100 <= greedy * 75, "{error}: {on_samples} of {greedy}");
    }
}

#[test]
fn a_grid_of_several_parts_is_one_network() {
    // 400 x 60 samples are cut in two; a lake lies on the cut.
    let grid = rough(400, 60);
    let void = |i: usize| ((i % 400) as f64 - 200.0).hypot((i / 400) as f64 - 30.0) < 12.0;
    let heights = grid.heights().iter().enumerate().map(|(i, &h)| if void(i) { f64::NAN } else { h });
    let lake = Grid::new(400, 60, heights.collect()).unwrap();
    for grid in [grid, lake] {
        let options = Options::default().with_max_error(6.0);
        let best = make(&grid, &options).tin;
        let greedy = make(&grid, &options.with_method(Method::Greedy)).tin;
        let counts = [best, greedy].map(|tin| tin.triangles.len());
        assert!(counts[0] * 100 <= counts[1] * 70, "{counts:?}");
    }
}

#[test]
fn the_surface_is_kept_between_samples() {
    let grid = rough(90, 70);
    for method in METHODS {
        let options = Options::default().with_max_error(3.0).with_method(method);
        let loose = make(&grid, &options);
        let kept = make(&grid, &options.with_contract(Contract::Surface));
        assert!(kept.errors.surface <= 3.0, "{method:?}: {:?}", kept.errors);
        assert!(
            method == Method::Regular || loose.errors.surface > 3.0,
            "{method:?}: nothing was asked of it"
        );
        assert!(kept.tin.triangles.len() < 3 * loose.tin.triangles.len());
    }
}

#[test]
fn vertices_on_samples_have_their_heights() {
    let heights = rough(60, 40).heights().iter().map(|h| h.round()).collect();
    let grid = Grid::new(60, 40, heights).unwrap();
    let made = make(&grid, &Options::default().with_max_error(3.0).with_on_samples(true));
    for (p, &h) in made.tin.points.iter().zip(&made.tin.heights) {
        assert_eq!(grid.height(p[0] as usize, p[1] as usize), Some(h));
    }
}

#[test]
fn a_plane_is_two_triangles_and_a_ridge_few() {
    let plane =
        Grid::new(40, 30, (0..1200).map(|i| (i % 40) as f64 * 0.5 - (i / 40) as f64).collect()).unwrap();
    for method in [Method::Greedy, Method::Decimation, Method::Best] {
        let made = make(&plane, &Options::default().with_max_error(0.0).with_method(method));
        assert_eq!((made.tin.triangles.len(), made.errors.max), (2, 0.0), "{method:?}");
    }
    let ridge = Grid::new(41, 30, (0..1230i32).map(|i| f64::from((i % 41 - 20).abs())).collect()).unwrap();
    let made = make(&ridge, &Options::default().with_max_error(0.0));
    assert_eq!(made.tin.triangles.len(), 4);
}

#[test]
fn an_outline_loses_no_point_and_gains_none() {
    // A round lake, a bay at the border, and an island of one cell.
    let void = |x: i32, y: i32| {
        (x - 20).pow(2) + (y - 18).pow(2) < 60 && !(20..22).contains(&x) || x > 33 && (8..14).contains(&y)
    };
    let height = |i: i32| if void(i % 40, i / 40) { f64::NAN } else { f64::from(i % 40) };
    let grid = Grid::new(40, 36, (0..1440).map(height).collect()).unwrap();
    for method in METHODS {
        let made = make(&grid, &Options::default().with_max_error(5.0).with_method(method));
        assert!(made.tin.triangles.len() < 120 || method == Method::Regular, "{method:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// A simpler outline: near the exact one, no void sample covered, every sample that is covered within the error, what is not counted.
    #[test]
    fn a_simpler_outline_keeps_what_it_covers(
        heights in proptest::collection::vec(-30..30i32, 400),
        void in proptest::collection::vec(0..100u32, 400),
        share in prop_oneof![Just(2u32), Just(10), Just(35)],
        lake in (0..20i32, 0..20i32, 0..9i32),
        tolerance in prop_oneof![Just(0.0), Just(0.8), Just(2.0), Just(50.0)],
        error in 0..40u32,
        on_samples in any::<bool>(),
        greedy in any::<bool>(),
    ) {
        let is_void = |i: usize| {
            let (x, y) = (i as i32 % 20, i as i32 / 20);
            void[i] < share || (x - lake.0).pow(2) + (y - lake.1).pow(2) < lake.2.pow(2)
        };
        let height = |i: usize| if is_void(i) { f64::NAN } else { f64::from(heights[i]) };
        let grid = Grid::new(20, 20, (0..400).map(height).collect()).unwrap();
        let options = Options::default()
            .with_max_error(f64::from(error))
            .with_method(if greedy { Method::Greedy } else { Method::Best })
            .with_on_samples(on_samples)
            .with_outline_tolerance(tolerance);
        let made = match triangulate(&grid, &options, &Quiet) {
            Ok(made) => made,
            Err(e) => {
                prop_assert_eq!(e, TinError::Nothing);
                return Ok(());
            }
        };
        let verdict = verify_outline(&grid, &made.tin, f64::from(error), tolerance);
        prop_assert!(verdict.is_good() && verdict.exact, "{:?}", verdict);
        let outline = made.outline.unwrap_or_default();
        prop_assert_eq!(outline.dropped, verdict.dropped);
        prop_assert!(outline.kept <= outline.corners);
        if tolerance == 0.0 {
            prop_assert_eq!((outline.dropped, outline.kept), (0, outline.corners));
            prop_assert!(verify(&grid, &made.tin, f64::from(error), Contract::Samples).is_good());
        }
        // By looking at every sample and triangle.
        let mut covered = vec![false; 400];
        for t in &made.tin.triangles {
            let [a, b, c] = t.map(|v| made.tin.points[v as usize].map(i64::from));
            let side = |p: [i64; 2], q: [i64; 2], r: [i64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
            for (i, covered) in covered.iter_mut().enumerate() {
                let s = [i as i64 % 20, i as i64 / 20];
                *covered |= side(a, b, s) >= 0 && side(b, c, s) >= 0 && side(c, a, s) >= 0;
            }
        }
        prop_assert!((0..400).all(|i| !(covered[i] && is_void(i))), "a void sample is covered");
    }
}

#[test]
fn breaklines_and_a_simpler_outline_go_together() {
    let grid = rough(60, 50);
    let void = |i: usize| ((i % 60) as f64 - 30.0).hypot((i / 60) as f64 - 25.0) < 9.0;
    let heights = grid.heights().iter().enumerate().map(|(i, &h)| if void(i) { f64::NAN } else { h });
    let grid = Grid::new(60, 50, heights.collect()).unwrap();
    let lines = vec![[[3, 4], [57, 46]], [[2, 40], [58, 9]], [[2, 47], [50, 48]]];
    for method in [Method::Greedy, Method::Best] {
        let options = Options::default().with_max_error(4.0).with_method(method);
        let made =
            triangulate(&grid, &options.with_breaklines(lines.clone()).with_outline_tolerance(1.5), &Quiet)
                .unwrap();
        let verdict = verify_outline(&grid, &made.tin, 4.0, 1.5);
        assert!(verdict.is_good() && verdict.exact, "{verdict:?}");
        assert!(made.outside > 0 && made.outline.unwrap().kept < made.outline.unwrap().corners);
        assert!(follows(&made, lines[2]));
    }
}

#[test]
fn a_count_of_triangles_ends_the_work() {
    let grid = rough(80, 80);
    for method in METHODS {
        for most in [60, 800] {
            let made = make(&grid, &Options::default().with_triangles(most).with_method(method));
            let n = made.tin.triangles.len();
            assert!(n <= most, "{method:?}: {n} of {most}");
            assert!(n * 10 >= most * 7 || method == Method::Regular, "{method:?}: {n} of {most}");
        }
    }
}

#[test]
fn what_cannot_be_is_said() {
    let all = |z: f64| Grid::new(3, 3, vec![z; 9]).unwrap();
    let options = Options::default().with_max_error(1.0);
    let fails = |grid: &Grid, options: &Options| triangulate(grid, options, &Quiet).unwrap_err();
    assert_eq!(fails(&all(f64::NAN), &options), TinError::Nothing);
    assert_eq!(fails(&Grid::new(9, 1, vec![0.0; 9]).unwrap(), &options), TinError::Nothing);
    assert_eq!(fails(&Grid::new(0, 0, vec![]).unwrap(), &options), TinError::Nothing);
    assert_eq!(fails(&all(0.0), &Options::default().with_max_error(f64::NAN)), TinError::BadError);
    assert_eq!(fails(&all(0.0), &Options::default().with_max_error(-1.0)), TinError::BadError);
    let outline = |method, contract, tolerance| {
        Options::default()
            .with_max_error(1.0)
            .with_method(method)
            .with_contract(contract)
            .with_outline_tolerance(tolerance)
    };
    assert_eq!(fails(&all(0.0), &outline(Method::Regular, Contract::Samples, 1.0)), TinError::NoOutline);
    assert_eq!(fails(&all(0.0), &outline(Method::Best, Contract::Surface, 1.0)), TinError::NoOutline);
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(fails(&all(0.0), &outline(Method::Best, Contract::Samples, bad)), TinError::BadOutline);
    }
    let mut spike = vec![0.1; 9];
    spike[4] = 1e30;
    let spike = Grid::new(3, 3, spike).unwrap();
    assert!(matches!(fails(&spike, &options), TinError::TooFine { greatest, .. } if greatest == 1e30));
    assert!(matches!(fails(&all(1e30), &options), TinError::TooFine { .. }));
    assert_eq!(make(&all(1e30), &Options::default().with_max_error(1e24)).tin.triangles.len(), 2);
    // 1e30 and 0.1 together take more bits than the exact check has.
    let made = triangulate(&spike, &Options::default().with_max_error(1e29), &Quiet).unwrap();
    let verdict = verify(&spike, &made.tin, 1e29, Contract::Samples);
    assert!(verdict.is_good() && !verdict.exact, "{verdict:?}");
}

#[test]
fn work_can_be_stopped() {
    struct Stop;
    impl progmesh_terrain::tin::Control for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    for method in METHODS {
        let options = Options::default().with_max_error(1.0).with_method(method);
        let stopped = triangulate(&rough(100, 100), &options, &Stop).err();
        // Greedy insertion may be done before it looks.
        assert!(stopped == Some(TinError::Cancelled) || method == Method::Greedy, "{method:?}");
    }
}

/// Whether sides of triangles lead straight along a line; by looking at all of them.
fn follows(made: &Made, [a, b]: [[u32; 2]; 2]) -> bool {
    let at = |p: [u32; 2]| [i64::from(p[0]), i64::from(p[1])];
    let (from, to) = (at(a), at(b));
    let along = |p: [i64; 2]| (p[0] - from[0]) * (to[0] - from[0]) + (p[1] - from[1]) * (to[1] - from[1]);
    let beside = |p: [i64; 2]| (p[0] - from[0]) * (to[1] - from[1]) - (p[1] - from[1]) * (to[0] - from[0]);
    let mut pieces: Vec<[i64; 2]> = vec![];
    for t in &made.tin.triangles {
        for i in 0..3 {
            let ends = [t[i], t[(i + 1) % 3]].map(|v| at(made.tin.points[v as usize]));
            if ends.iter().all(|&p| beside(p) == 0) {
                let mut piece = ends.map(along);
                piece.sort_unstable();
                pieces.push(piece);
            }
        }
    }
    pieces.sort_unstable();
    let reached = pieces.into_iter().fold(0, |r, [x, y]| if x <= r { r.max(y) } else { r });
    reached >= along(to)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// A breakline is there straight where everything is valid; whatever lines there are, the error is kept and all is covered.
    #[test]
    fn sides_follow_breaklines(
        heights in proptest::collection::vec(-30..30i32, 169),
        void in proptest::collection::vec(0..100u32, 169),
        share in prop_oneof![Just(0u32), Just(12)],
        lines in proptest::collection::vec(proptest::array::uniform2(proptest::array::uniform2(0..13u32)), 1..6),
        error in 1..40u32,
    ) {
        let height = |i: usize| if void[i] < share { f64::NAN } else { f64::from(heights[i]) };
        let grid = Grid::new(13, 13, (0..169).map(height).collect()).unwrap();
        for method in [Method::Greedy, Method::Best] {
            for lines in [&lines[..], &lines[..1]] {
                let options = Options::default()
                    .with_max_error(f64::from(error))
                    .with_method(method)
                    .with_breaklines(lines.to_vec());
                match triangulate(&grid, &options, &Quiet) {
                    Ok(_) => {
                        let made = make(&grid, &options);
                        if share == 0 && lines.len() == 1 {
                            prop_assert_eq!((made.bent, made.outside), (0, 0));
                            prop_assert!(follows(&made, lines[0]), "{:?}", lines[0]);
                        }
                        if made.bent == 0 && made.outside == 0 {
                            for &line in lines {
                                prop_assert!(follows(&made, line), "{:?}", line);
                            }
                        }
                    }
                    Err(e) => prop_assert_eq!(e, TinError::Nothing),
                }
            }
        }
    }
}

#[test]
fn a_breakline_stays_while_the_ground_beside_it_is_thinned() {
    let grid = rough(90, 70);
    let lines = vec![[[5, 60], [80, 12]], [[80, 12], [88, 69]], [[10, 3], [10, 40]]];
    let options = Options::default().with_max_error(6.0);
    let plain = make(&grid, &options);
    let made = make(&grid, &options.clone().with_breaklines(lines.clone()));
    // One crosses nothing, two meet at a sample.
    assert_eq!((made.bent, made.outside), (0, 0));
    for &line in &lines {
        assert!(follows(&made, line) && !follows(&plain, line), "{line:?}");
    }
    assert!(made.tin.triangles.len() < plain.tin.triangles.len() + 120);
    let refused =
        |options: Options| triangulate(&grid, &options.with_breaklines(lines.clone()), &Quiet).unwrap_err();
    assert_eq!(refused(options.clone().with_method(Method::Regular)), TinError::NoBreaklines);
    assert_eq!(refused(options.clone().with_contract(Contract::Surface)), TinError::NoBreaklines);
    let outside = options.with_breaklines(vec![[[0, 0], [90, 5]]]);
    assert_eq!(triangulate(&grid, &outside, &Quiet).unwrap_err(), TinError::BadBreakline([[0, 0], [90, 5]]));
}
