//! Quadric collapse: what it keeps, what it meets, how good it is.

mod common;

use common::distance::rms;
use common::{any_sample, border, sample, topology_of};
use glam::DVec3;
use progmesh_aif::{Bits, BuildOptions, Mesh, MeshInput, Positions, VertexId};
use progmesh_meshes::GenerateOptions;
use progmesh_simplify::*;
use proptest::prelude::*;
use std::collections::HashSet;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

const SCHEDULES: [Schedule; 2] = [Schedule::Exact, Schedule::Bulk];
const PLACEMENTS: [Placement; 3] = [Placement::Endpoint, Placement::Midpoint, Placement::Optimal];

fn options(set: impl FnOnce(&mut Options)) -> Options {
    let mut o = Options::default();
    o.method = Method::Quadric;
    set(&mut o);
    o
}

fn run(mesh: &mut Mesh, set: impl FnOnce(&mut Options)) -> Outcome {
    let out = simplify(mesh, &options(set), &Quiet).unwrap();
    assert_eq!(mesh.check(), Ok(()));
    assert_eq!(out.faces_out, mesh.face_count());
    assert_eq!((out.triangles_out, out.triangles_out), (mesh.triangle_count(), out.faces_out));
    assert!(out.estimate.is_finite() && out.estimate >= 0.0);
    out
}

fn places(m: &Mesh) -> HashSet<[u64; 3]> {
    m.topology().vertices().map(|v| m.positions().bits(v.index())).collect()
}

/// The same mesh with every coordinate changed, in f64 if asked for.
fn mapped(m: &Mesh, wide: bool, f: impl Fn(DVec3) -> DVec3) -> Mesh {
    let mut input = m.to_input();
    let points = input.positions.iter().map(|p| f(p).to_array());
    input.positions = if wide {
        Positions::F64(points.collect())
    } else {
        Positions::F32(points.map(|p| p.map(|x| x as f32)).collect())
    };
    Mesh::build(input, &BuildOptions::default()).unwrap().0
}

/// An n x n sheet of unit squares, two triangles each.
fn sheet(n: u32, height: impl Fn(u32, u32) -> f32) -> Mesh {
    let points: Vec<_> = (0..=n)
        .flat_map(|y| (0..=n).map(move |x| (x, y)))
        .map(|(x, y)| [x as f32, y as f32, height(x, y)])
        .collect();
    let quad = |x: u32, y: u32| [[0, 1, n + 2], [0, n + 2, n + 1]].map(|t| t.map(|k| y * (n + 1) + x + k));
    let triangles: Vec<_> = (0..n).flat_map(|y| (0..n).flat_map(move |x| quad(x, y))).collect();
    Mesh::from_triangles(points, &triangles).unwrap()
}

fn any_way() -> impl Strategy<Value = (Schedule, Placement)> {
    (prop::sample::select(SCHEDULES.to_vec()), prop::sample::select(PLACEMENTS.to_vec()))
}

fn only_what_took_part_moved(
    (name, faces, seed): (&str, usize, u64),
    (schedule, placement): (Schedule, Placement),
) -> Result<(), TestCaseError> {
    let input = sample(name, faces, seed);
    let triangles = input.clone().triangulate().unwrap().mesh;
    let mut m = input;
    let out = run(&mut m, |o| {
        (o.schedule, o.placement, o.ratio, o.refit) = (Some(schedule), Some(placement), Some(0.9), Some(0));
    });
    // A vertex that took part in no collapse as the one that stays is where it was; at most one moves for each collapse.
    let before = places(&triangles);
    let moved =
        m.topology().vertices().filter(|v| !before.contains(&m.positions().bits(v.index()))).count() as u64;
    let collapses = out.levels.iter().map(|l| l.tried - l.refused.total()).sum::<u64>();
    prop_assert!(moved <= collapses, "{moved} moved, {collapses} collapses");
    Ok(())
}

#[test]
fn a_scan_of_hardly_any_face_moved_no_more_than_it_collapsed() {
    only_what_took_part_moved(("scan", 43, 0), (Schedule::Exact, Placement::Optimal)).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn topology_is_kept_and_targets_are_met_or_the_reason_is_given(
        (name, faces, seed) in any_sample(900),
        (schedule, placement) in any_way(),
        ratio in prop_oneof![Just(0.0), 0.0f64..1.0],
    ) {
        let input = sample(name, faces, seed);
        let (mut shape, total) = (topology_of(&input), input.triangle_count());
        let want = (ratio * total as f64).round() as usize;
        let mut m = input;
        let out = run(&mut m, |o| (o.schedule, o.placement, o.ratio) = (Some(schedule), Some(placement), Some(ratio)));
        shape.0 -= out.isolated_removed as i64;
        prop_assert_eq!(topology_of(&m), shape, "{}", name);
        match out.stop {
            Stop::Target => prop_assert!(out.triangles_out <= want && out.triangles_out + 2 > want.min(total)),
            Stop::NoLegalCollapse => {
                prop_assert!(out.triangles_out > want);
                // Smooth closed surfaces have no reason to stop early.
                prop_assert!(name != "sphere" || want < 40, "{}", out.triangles_out);
            }
            other => prop_assert!(false, "{:?}", other),
        }
    }

    #[test]
    fn locked_borders_stay_bit_for_bit((name, faces, seed) in any_sample(900), (schedule, placement) in any_way()) {
        let input = sample(name, faces, seed);
        let rim = border(&input);
        let mut m = input;
        run(&mut m, |o| (o.schedule, o.placement, o.ratio, o.lock_border) = (Some(schedule), Some(placement), Some(0.1), true));
        prop_assert_eq!(border(&m), rim);
    }

    #[test]
    fn endpoints_are_vertices_of_the_input_and_kept_vertices_share_one_buffer(
        (name, faces, seed) in any_sample(900), schedule in prop::sample::select(SCHEDULES.to_vec()), ratio in 0.0f64..0.8,
    ) {
        let input = sample(name, faces, seed);
        let mut m = input.clone();
        let out = run(&mut m, |o| (o.schedule, o.placement, o.ratio) = (Some(schedule), Some(Placement::Endpoint), Some(ratio)));
        for v in 0..m.positions().len() {
            let origin = out.vertex_origin.get(v).map_or(v, |&o| o as usize);
            prop_assert_eq!(m.positions().bits(v), input.positions().bits(origin));
        }
        let mut kept = input.clone();
        let out = run(&mut kept, |o| (o.schedule, o.keep_vertices, o.ratio) = (Some(schedule), true, Some(ratio)));
        prop_assert_eq!(kept.positions(), input.positions());
        prop_assert!(out.vertex_origin.is_empty());
        prop_assert_eq!(kept.face_count(), m.face_count(), "the same collapses");
    }

    #[test]
    fn vertices_whose_surroundings_are_as_they_were_did_not_move(of in any_sample(900), way in any_way()) {
        only_what_took_part_moved(of, way)?;
    }

    #[test]
    fn powers_of_two_scale_the_result_exactly((name, faces, seed) in any_sample(900), (schedule, placement) in any_way(), k in -60i32..60) {
        let input = sample(name, faces, seed);
        let factor = (k as f64).exp2();
        let mut big = mapped(&input, false, |p| p * factor);
        let mut m = input;
        let set = |o: &mut Options| (o.schedule, o.placement, o.ratio) = (Some(schedule), Some(placement), Some(0.3));
        let (a, b) = (run(&mut m, set), run(&mut big, set));
        prop_assert_eq!(a.estimate * factor, b.estimate);
        let scaled = mapped(&m, false, |p| p * factor);
        prop_assert_eq!(scaled.positions(), big.positions());
        prop_assert_eq!(m.to_input().corners, big.to_input().corners);
    }

    #[test]
    fn the_estimate_respects_the_bound((name, faces, seed) in any_sample(900), (schedule, placement) in any_way(), log in -5.0f64..-1.0) {
        let input = sample(name, faces, seed);
        let bound = 10f64.powf(log) * input.surface_bounds().map_or(0.0, |(a, b)| (b - a).length());
        // The holes of a small scan may leave nothing of it.
        let empty = input.face_count() == 0;
        let mut m = input;
        let out = run(&mut m, |o| {
            (o.schedule, o.placement) = (Some(schedule), Some(placement));
            o.max_error = Some(MaxError { value: bound, relative: false });
        });
        prop_assert!(out.estimate <= bound, "{} > {bound}", out.estimate);
        prop_assert_eq!(out.stop == Stop::Target, empty);
        prop_assert!(empty || matches!(out.stop, Stop::Error | Stop::NoLegalCollapse));
    }
}

#[test]
fn the_least_meshes_keep_what_they_have() {
    let floor = |m: &Mesh, schedule| {
        let mut m = m.clone();
        let out = run(&mut m, |o| (o.schedule, o.triangles) = (Some(schedule), Some(0)));
        assert_eq!(out.stop, if m.face_count() == 0 { Stop::Target } else { Stop::NoLegalCollapse });
        m.face_count()
    };
    for s in SCHEDULES {
        assert_eq!(floor(&sample("sphere", 1280, 0), s), 4, "a sphere ends as a tetrahedron");
        assert_eq!(floor(&sample("single-triangle", 1, 0), s), 1);
        assert_eq!(floor(&Mesh::default(), s), 0);
        let torus = floor(&sample("torus", 800, 0), s);
        assert!((14..=40).contains(&torus), "a torus has no fewer than 14 triangles: {torus}");
    }
}

#[test]
fn a_plane_ends_as_two_triangles_with_its_corners() {
    for s in SCHEDULES {
        let mut m = sheet(40, |_, _| 3.0);
        let out = run(&mut m, |o| (o.schedule, o.triangles) = (Some(s), Some(2)));
        assert_eq!((out.stop, m.face_count(), m.vertex_count()), (Stop::Target, 2, 4), "{s:?}");
        let corners = [[0.0, 0.0, 3.0], [40.0, 0.0, 3.0], [0.0, 40.0, 3.0], [40.0, 40.0, 3.0f32]];
        assert_eq!(places(&m), corners.map(|c| c.map(|x| x.to_bits() as u64)).into(), "{s:?}");
        assert!(out.estimate < 1e-6);
    }
}

#[test]
fn cad_parts_lose_what_is_planar_first() {
    let input = sample("cad", 12_000, 0);
    for s in SCHEDULES {
        let mut m = input.clone();
        // The bore is round: leave it all of its segments.
        let out = run(&mut m, |o| {
            o.schedule = Some(s);
            o.max_error = Some(MaxError { value: 1e-7, relative: true });
        });
        assert!(out.faces_out * 4 < out.faces_in, "{s:?}: {} of {}", out.faces_out, out.faces_in);
        let size = {
            let (a, b) = input.bounds().unwrap();
            (b - a).length()
        };
        let rms = rms(&m, &input) / size;
        assert!(rms < 1e-6, "{s:?}: {rms}");
    }
}

#[test]
fn a_bound_of_zero_allows_what_costs_nothing() {
    for (name, s, p) in ["cad", "sphere", "scan", "terrain", "offset-1e4"]
        .into_iter()
        .flat_map(|n| SCHEDULES.into_iter().flat_map(move |s| PLACEMENTS.map(|p| (n, s, p))))
    {
        let mut m = sample(name, 3000, 0);
        let out = run(&mut m, |o| {
            (o.schedule, o.placement) = (Some(s), Some(p));
            o.max_error = Some(MaxError { value: 0.0, relative: false });
        });
        assert_eq!((out.estimate, out.stop), (0.0, Stop::Error), "{name} {s:?} {p:?}");
        // Only the block has planes.
        assert_eq!(out.faces_out < out.faces_in, name == "cad", "{name} {s:?} {p:?}: {}", out.faces_out);
    }
}

#[test]
fn a_bound_is_in_world_units() {
    for method in [Method::Quadric, Method::Nsa, Method::Cluster] {
        let with = |value: f64, scale: f64| {
            let mut meshes = [sample("sphere", 5000, 0)];
            let mut o = Options::default();
            o.method = method;
            o.epsilon = Some(40.0).filter(|_| method == Method::Nsa);
            o.max_error = Some(MaxError { value, relative: false });
            let out = simplify_all(&mut meshes, &[scale], &o, &Quiet).unwrap();
            assert!(out[0].estimate * scale <= value * (1.0 + 1e-9), "{method:?}: {}", out[0].estimate);
            assert_eq!(out[0].stop, Stop::Error, "{method:?}");
            out[0].faces_out
        };
        assert_eq!(with(0.2, 1.0), with(0.2 * 128.0, 128.0), "{method:?}");
        assert!(with(0.2, 1.0) < with(0.2, 4.0), "{method:?}");
    }
}

#[test]
fn locks_hold() {
    for (s, p) in SCHEDULES.into_iter().flat_map(|s| PLACEMENTS.map(|p| (s, p))) {
        let mut m = sample("scan", 3000, 2);
        let locked: Vec<usize> = (0..m.vertex_count()).step_by(9).collect();
        let wanted: Vec<_> = locked.iter().map(|&v| m.positions().bits(v)).collect();
        let out = run(&mut m, |o| {
            (o.schedule, o.placement, o.triangles) = (Some(s), Some(p), Some(0));
            locked.iter().for_each(|&v| o.locked_vertices.set(v));
        });
        let left = places(&m);
        assert!(wanted.iter().all(|p| left.contains(p)));
        assert!(out.faces_out < out.faces_in / 2 && out.levels[0].refused.locked > 0);
    }
}

#[test]
fn faces_of_locked_materials_and_groups_keep_their_vertices() {
    let plain = sample("sphere", 2000, 0);
    let upper = |m: &Mesh| -> Vec<u32> {
        m.topology()
            .faces()
            .map(|f| (m.topology().face_vertices(f).map(|v| m.position(v).z).sum::<f64>() > 0.0) as u32)
            .collect()
    };
    for by_group in [false, true] {
        let mut input = plain.to_input();
        let list = upper(&plain);
        *(if by_group { &mut input.face_group } else { &mut input.face_material }) = list.clone();
        let mut m = Mesh::build(input, &BuildOptions::default()).unwrap().0;
        let t = plain.topology();
        let wanted: HashSet<_> = t
            .faces()
            .filter(|f| list[f.index()] == 1)
            .flat_map(|f| t.face_vertices(f))
            .map(|v| plain.positions().bits(v.index()))
            .collect();
        let out = run(&mut m, |o| {
            o.triangles = Some(0);
            *(if by_group { &mut o.locked_groups } else { &mut o.locked_materials }) = vec![1];
        });
        assert!(wanted.is_subset(&places(&m)));
        let upper_faces = list.iter().filter(|x| **x == 1).count();
        assert!(
            out.faces_out >= upper_faces && out.faces_out < upper_faces + 150,
            "{} of {upper_faces}",
            out.faces_out
        );
    }
}

/// Asks for a stop after so many questions; sees to it that progress rises within 0..=1.
struct Impatient {
    left: AtomicUsize,
    last: Mutex<f64>,
}

impl Control for Impatient {
    fn progress(&self, done: f64) {
        let mut last = self.last.lock().unwrap();
        assert!((0.0..=1.0).contains(&done) && done >= *last, "{done} after {last}");
        *last = done;
    }
    fn cancelled(&self) -> bool {
        self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |x| Some(x.saturating_sub(1))) == Ok(0)
    }
}

#[test]
fn it_can_be_stopped_and_progress_never_falls() {
    for (s, patience) in SCHEDULES.into_iter().flat_map(|s| [0, 2, 5, 1_000_000].map(|p| (s, p))) {
        let mut m = sample("sphere", 45_000, 0);
        let faces = m.face_count();
        let control = Impatient { left: patience.into(), last: 0.0.into() };
        let out =
            simplify(&mut m, &options(|o| (o.schedule, o.triangles) = (Some(s), Some(36_001))), &control)
                .unwrap();
        assert_eq!(m.check(), Ok(()));
        match patience {
            1_000_000 => assert_eq!((out.stop, out.faces_out), (Stop::Target, 36_000), "{s:?}"),
            0 => assert_eq!(
                (out.stop, out.faces_out < faces),
                (Stop::Cancelled, s == Schedule::Exact),
                "{s:?}"
            ),
            _ => assert_eq!((out.stop, out.faces_out < faces), (Stop::Cancelled, true), "{s:?}"),
        }
    }
}

#[test]
fn the_result_does_not_depend_on_threads_nor_on_the_run() {
    for name in ["sphere", "scan"] {
        let input = sample(name, 60_000, 4);
        let result = |schedule, threads| {
            let mut m = input.clone();
            let out = run(&mut m, |o| {
                (o.schedule, o.triangles, o.threads) = (Some(schedule), Some(8_000), threads)
            });
            let tried = out.levels[0].tried;
            (
                m.positions().clone(),
                m.to_input().corners,
                out.estimate.to_bits(),
                tried,
                out.levels[0].refused,
            )
        };
        let first = result(Schedule::Bulk, Some(1));
        for threads in [Some(1), Some(2), Some(4), None] {
            assert!(result(Schedule::Bulk, threads) == first, "{name} with {threads:?}");
        }
        assert!(result(Schedule::Exact, Some(1)) == result(Schedule::Exact, Some(4)), "{name}");
    }
}

#[test]
fn bulk_is_about_as_good_as_exact() {
    for (name, faces) in [("sphere", 50_000), ("scan", 60_000)] {
        let input = sample(name, faces, 1);
        let quality = |schedule| {
            let mut m = input.clone();
            run(&mut m, |o| (o.schedule, o.triangles) = (Some(schedule), Some(5_000)));
            rms(&m, &input)
        };
        let (exact, bulk) = (quality(Schedule::Exact), quality(Schedule::Bulk));
        assert!(bulk <= 1.03 * exact, "{name}: bulk {bulk}, exact {exact}, {}", bulk / exact);
    }
}

#[test]
fn scale_and_place_do_not_cost_quality() {
    let plain = sample("scan", 20_000, 1);
    let quality = |input: &Mesh| {
        let mut m = input.clone();
        let out = run(&mut m, |o| o.triangles = Some(2_000));
        assert!(out.stop == Stop::Target);
        let (a, b) = input.bounds().unwrap();
        // Measured about the middle and at unit size, so that the measure loses nothing.
        let unit = |m: &Mesh| mapped(m, true, |p| (p - a) / (b - a).max_element());
        rms(&unit(&m), &unit(input))
    };
    let want = quality(&plain);
    let near = |got: f64, limit: f64, what: &str| {
        assert!(got < limit * want && got > 0.9 * want, "{what}: {got}, not {want}");
    };
    near(quality(&mapped(&plain, true, |p| p + DVec3::new(1e6, -2e6, 5e5))), 1.02, "f64 at 1e6");
    near(quality(&mapped(&plain, false, |p| p * 1e-25)), 1.02, "1e-25");
    near(quality(&mapped(&plain, false, |p| p * 1e12)), 1.02, "1e12");
    near(quality(&mapped(&plain, false, |p| p * 1e37)), 1.02, "1e37");
    near(quality(&mapped(&plain, true, |p| p * 1e300)), 1.02, "1e300");
}

#[test]
fn the_ends_of_the_number_range_do_no_harm() {
    let ball = sample("sphere", 1280, 0);
    let (f, d) = (f32::MAX as f64, f64::MAX);
    for (wide, size) in
        [(false, f), (false, 1e-45), (false, 1e-44), (true, d), (true, 5e-324), (true, 1e-310)]
    {
        for (s, p) in SCHEDULES.into_iter().flat_map(|s| PLACEMENTS.map(|p| (s, p))) {
            let mut m = mapped(&ball, wide, |p| p.clamp(DVec3::splat(-0.99), DVec3::splat(0.99)) * size);
            let out = simplify(
                &mut m,
                &options(|o| (o.schedule, o.placement, o.ratio) = (Some(s), Some(p), Some(0.2))),
                &Quiet,
            )
            .unwrap();
            assert_eq!(m.check(), Ok(()), "{size} {s:?} {p:?}");
            assert!(size < 1e-40 || out.stop == Stop::Target, "{size} {s:?} {p:?}: {:?}", out.stop);
        }
    }
}

#[test]
fn what_is_not_manifold_survives() {
    let input = sample("nonmanifold", 2000, 0);
    let complex = |m: &Mesh| {
        let t = m.topology();
        let at = |v: VertexId| m.positions().bits(v.index());
        let mut edges: Vec<_> = t
            .edges()
            .filter(|&e| t.edge_faces(e).len() != 2 && t.edge_faces(e).len() != 1)
            .map(|e| {
                let mut ends = t.edge_vertices(e).map(at);
                ends.sort();
                (ends, t.edge_faces(e).len())
            })
            .collect();
        edges.sort();
        edges
    };
    assert!(complex(&input).len() >= 2);
    for (s, p) in SCHEDULES.into_iter().flat_map(|s| PLACEMENTS.map(|p| (s, p))) {
        let mut m = input.clone();
        let out = run(&mut m, |o| (o.schedule, o.placement, o.triangles) = (Some(s), Some(p), Some(0)));
        assert_eq!((complex(&m), topology_of(&m).2), (complex(&input), topology_of(&input).2));
        assert!(out.faces_out < out.faces_in);
        assert_eq!(out.isolated_removed, 1);
    }
}

#[test]
fn hostile_meshes_come_out_as_meshes() {
    for e in progmesh_meshes::names().iter().filter(|e| e.hostile) {
        let s = progmesh_meshes::generate(e.name, &GenerateOptions::default().with_faces(1500)).unwrap();
        let input: MeshInput = common::input_of(&s);
        let Ok((input, _)) = Mesh::build(input, &BuildOptions::default()) else {
            assert!(["nan", "inf", "index-out-of-range"].contains(&e.name), "{}", e.name);
            continue;
        };
        for (s, p) in SCHEDULES.into_iter().flat_map(|s| PLACEMENTS.map(|p| (s, p))) {
            let mut m = input.clone();
            let out = run(&mut m, |o| (o.schedule, o.placement, o.ratio) = (Some(s), Some(p), Some(0.25)));
            assert_eq!(topology_of(&m), topology_of(&input), "{}", e.name);
            let scan = ["offset", "scale"].iter().any(|p| e.name.starts_with(p));
            assert!(!scan || out.faces_out < out.faces_in, "{}", e.name);
        }
    }
}

#[test]
fn a_larger_copy_gets_more_triangles() {
    for s in SCHEDULES {
        let copy = sample("scan", 4000, 1);
        let mut meshes = vec![copy.clone(), copy.clone(), Mesh::default()];
        let out = simplify_all(
            &mut meshes,
            &[1.0, 2.0, 1.0],
            &options(|o| (o.schedule, o.ratio) = (Some(s), Some(0.2))),
            &Quiet,
        )
        .unwrap();
        let left: usize = out.iter().map(|o| o.triangles_out).sum();
        let want = (0.4 * copy.face_count() as f64).round() as usize;
        assert!(left <= want && left + 2 > want, "{left} of {want}");
        // Costs go with the fourth power of size: half the size, a quarter of the error squared over a quarter of the area.
        assert!(out[1].triangles_out as f64 > 1.5 * out[0].triangles_out as f64, "{s:?} {out:?}");
        // A copy that is twice as large itself is the same as one that weighs twice.
        let mut larger = vec![copy.clone(), mapped(&copy, false, |p| p * 2.0), Mesh::default()];
        simplify_all(
            &mut larger,
            &[1.0; 3],
            &options(|o| (o.schedule, o.ratio) = (Some(s), Some(0.2))),
            &Quiet,
        )
        .unwrap();
        assert_eq!(larger[1].to_input().corners, meshes[1].to_input().corners);
        assert_eq!(larger[0].positions(), meshes[0].positions());
    }
}

#[test]
fn several_large_meshes_meet_a_target_between_them() {
    // Above the size where rounds end, with odd numbers: the first mesh may pass the target before the second has its turn.
    let borders = sample("terrain", 30_000, 1);
    for want in [40_001, 45_555, 35_000] {
        let mut meshes = vec![borders.clone(), sample("sphere", 20_000, 0), borders.clone()];
        let out =
            simplify_all(&mut meshes, &[1.0; 3], &options(|o| o.triangles = Some(want)), &Quiet).unwrap();
        let left: usize = out.iter().map(|o| o.triangles_out).sum();
        assert!(left <= want && left + 2 > want, "{left} of {want}");
    }
}

#[test]
fn weights_hold_detail_where_they_are() {
    let input = sample("sphere", 5000, 0);
    let mut m = input.clone();
    let weigh = |p: DVec3| if p.z > 0.0 { 100.0 } else { 1.0 };
    run(&mut m, |o| {
        o.triangles = Some(500);
        o.vertex_weights = input.positions().iter().map(weigh).collect();
    });
    let above = m.positions().iter().filter(|p| p.z > 0.0).count();
    assert!(above * 3 > m.vertex_count() * 2, "{above} of {}", m.vertex_count());
}

#[test]
fn wrong_weights_change_nothing() {
    for weights in [vec![1.0; 3], vec![f32::NAN; 6]] {
        let squares = || {
            let p: Vec<_> = (0..6).map(|i| [(i % 3) as f32, (i / 3) as f32, 0.0]).collect();
            Mesh::from_polygons(p, &[4, 4], &[0, 1, 4, 3, 1, 2, 5, 4]).unwrap()
        };
        let mut meshes = [squares()];
        let o = options(|o| (o.vertex_weights, o.prune, o.triangles) = (weights, Some(1.0), Some(1)));
        assert!(simplify_all(&mut meshes, &[1.0], &o, &Quiet).is_err());
        assert_eq!((meshes[0].face_count(), meshes[0].to_input().corners), (2, squares().to_input().corners));
    }
}

#[test]
fn pruning_removes_small_components_and_counts_them_as_given() {
    let (ball, dot) = (sample("sphere", 1280, 0), sample("sphere", 80, 0));
    let mut input = ball.to_input();
    let shift = ball.vertex_count() as u32;
    let Positions::F32(p) = &mut input.positions else { unreachable!() };
    p.extend(dot.positions().iter().map(|p| (p * 0.01 + DVec3::X * 3.0).to_array().map(|x| x as f32)));
    input.corners.extend(dot.to_input().corners.iter().map(|c| c + shift));
    let mut m = Mesh::build(input, &BuildOptions::default()).unwrap().0;
    let faces = m.face_count();
    let out = run(&mut m, |o| (o.prune, o.ratio) = (Some(0.05), Some(0.5)));
    assert_eq!((out.faces_in, topology_of(&m).2), (faces, 1));
    assert!(out.stop == Stop::Target && out.faces_out.abs_diff(faces / 2) <= 1);
}

#[test]
fn the_edges_of_a_border_do_not_shrink() {
    // The area under a sheet's outline stays within a percent: border planes hold it.
    let mut m = sheet(60, |x, y| (x as f32 * 0.3).sin() + (y as f32 * 0.2).cos());
    run(&mut m, |o| o.ratio = Some(0.05));
    let t = m.topology();
    let area: f64 = t.faces().map(|f| 0.5 * m.face_normal(f).z).sum();
    assert!((area / 3600.0 - 1.0).abs() < 0.01, "{area}");
}

#[test]
fn a_vertex_that_is_not_there_may_be_locked() {
    let mut m = sample("sphere", 80, 0);
    let mut far = Bits::new(100_000);
    far.set(99_999);
    let out = run(&mut m, |o| (o.locked_vertices, o.triangles) = (far, Some(20)));
    assert_eq!((out.stop, out.faces_out), (Stop::Target, 20));
}

/// A target just above where the exact schedule takes over: rounds do all of the work.
const ROUNDS_ONLY: usize = 33_000;

#[test]
fn rounds_keep_what_single_steps_keep() {
    for (name, faces) in
        [("scan", 45_000), ("terrain", 45_000), ("torus", 45_000), ("nonmanifold", 45_000), ("soup", 1)]
    {
        let input = if name == "soup" { damaged() } else { sample(name, faces, 3) };
        assert!(input.triangle_count() > 40_000, "{name} has {}", input.triangle_count());
        // By edge: which loop goes on where at a cut vertex depends on the order of its edges.
        let (mut shape, rim) = (topology_of(&input), border_edges(&input));
        let isolated = input.topology().vertices().filter(|&v| input.topology().star(v).is_empty()).count();
        shape.0 -= isolated as i64;
        let locked: Vec<usize> = (0..input.vertex_count()).step_by(11).collect();
        for p in PLACEMENTS {
            let mut m = input.clone();
            let out = run(&mut m, |o| {
                (o.placement, o.triangles, o.lock_border) = (Some(p), Some(ROUNDS_ONLY), true);
                locked.iter().for_each(|&v| o.locked_vertices.set(v));
            });
            assert_eq!(topology_of(&m), shape, "{name} {p:?}");
            assert!(border_edges(&m) == rim, "{name} {p:?}");
            assert_eq!(out.stop, Stop::Target, "{name} {p:?}");
            assert!(out.triangles_out + 2 > ROUNDS_ONLY);
            let left = places(&m);
            let t = input.topology();
            let stays = |&&v: &&usize| !t.star(VertexId(v as u32)).is_empty();
            assert!(
                locked.iter().filter(stays).all(|&v| left.contains(&input.positions().bits(v))),
                "{name} {p:?}"
            );
        }
        let mut m = input.clone();
        run(&mut m, |o| (o.keep_vertices, o.triangles) = (true, Some(ROUNDS_ONLY)));
        assert_eq!(m.positions(), input.positions(), "{name}");
        let size = input.surface_bounds().map_or(0.0, |(a, b)| (b - a).length());
        let mut m = input.clone();
        let out = run(&mut m, |o| o.max_error = Some(MaxError { value: 1e-4, relative: true }));
        assert!(out.estimate <= 1e-4 * size * (1.0 + 1e-6) && out.stop == Stop::Error, "{name}: {out:?}");
    }
}

/// The ends of all border edges, bit for bit.
fn border_edges(m: &Mesh) -> HashSet<[[u64; 3]; 2]> {
    let t = m.topology();
    let ends = |e| {
        let mut ends = t.edge_vertices(e).map(|v| m.positions().bits(v.index()));
        ends.sort();
        ends
    };
    t.edges().filter(|&e| t.edge_faces(e).len() == 1).map(ends).collect()
}

/// A large sphere with holes, doubled and turned faces, and vertices that are joined.
fn damaged() -> Mesh {
    let ball = sample("sphere", 45_000, 0);
    let mut triangles = ball.triangles();
    triangles.retain(|t| t[0] % 101 != 0);
    for i in (0..triangles.len()).step_by(97) {
        triangles[i].reverse();
        triangles.push(triangles[i + 1]);
    }
    for v in triangles.as_flattened_mut().iter_mut().filter(|v| **v % 997 == 5) {
        *v = 5;
    }
    let p = ball.positions().iter().map(|p| p.to_array().map(|x| x as f32)).collect::<Vec<_>>();
    Mesh::from_triangles(p, &triangles).unwrap()
}
