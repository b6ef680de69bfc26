//! NSA: what it keeps, what it refuses, when it stops.

mod common;

use common::{border, drawn, sample, topology_of};
use glam::DVec3;
use progmesh_aif::{BuildOptions, Mesh, MeshInput, Semantic};
use progmesh_simplify::nsa::{self, Recorder, Step};
use progmesh_simplify::*;
use proptest::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

fn options(set: impl FnOnce(&mut Options)) -> Options {
    let mut o = Options::default();
    o.method = Method::Nsa;
    set(&mut o);
    o
}

fn run(mesh: &mut Mesh, set: impl FnOnce(&mut Options)) -> Outcome {
    let out = simplify(mesh, &options(set), &Quiet).unwrap();
    assert_eq!(mesh.check(), Ok(()));
    assert_eq!(out.faces_out, mesh.face_count());
    assert_eq!(out.triangles_out, mesh.triangle_count());
    out
}

/// Wedges that change must fit: at the kept topology, every wedge row is finite.
fn wedges_are_finite(m: &Mesh) -> bool {
    m.wedges().is_none_or(|w| (0..w.len() as u32).all(|i| w.row(i).iter().all(|x| x.is_finite())))
}

#[test]
fn a_flat_sheet_loses_its_inside_and_keeps_its_border() {
    let (mut m, _) = drawn(
        "
a---b---c---d
| / | / | / |
e---f---g---h
| / | / | / |
i---j---k---l",
        "aeb efb bfc fgc cgd ghd eif ijf fjg jkg gkh klh",
    );
    let before = border(&m);
    let out = run(&mut m, |_| {});
    assert_eq!(out.stop, Stop::NoLegalCollapse);
    assert_eq!(border(&m), before);
    assert_eq!((m.vertex_count(), m.face_count()), (10, 8), "the ten on the border are left");
    let up = |f| m.face_normal(f).z;
    assert!(m.topology().faces().all(|f| up(f) > 0.0));
    assert_eq!(m.topology().faces().map(up).sum::<f64>(), 2.0 * 12.0 * 8.0);
}

#[test]
fn a_quad_on_the_edge_loses_a_corner_and_a_triangle_vanishes() {
    // Only f and g are inside: f goes into d, then g into b.
    let (mut m, _) = drawn(
        "
a-------b-------c
|       |       |
|   f---g       |
|  /    |       |
d-------e-------h",
        "adfgb dgf deg bgehc",
    );
    assert_eq!((m.face_count(), m.triangle_count()), (4, 3 + 1 + 1 + 3));
    let before = border(&m);
    let shape = topology_of(&m);
    let out = run(&mut m, |o| o.passes = Some(1));
    assert_eq!(out.levels.len(), 1);
    assert_eq!((border(&m), topology_of(&m)), (before, shape));
    assert_eq!((m.face_count(), m.triangle_count()), (3, 4), "adb, deb and behc");
}

#[test]
fn coplanar_faces_of_opposite_orientation_do_not_merge() {
    // A flat pillow: two sheets back to back. Collapsing anything across the rim would turn a face over.
    let sheet: Vec<[u32; 3]> = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    let mut faces = sheet.clone();
    faces.extend(sheet.iter().map(|&[a, b, c]| [b, a, if c == 4 { 5 } else { c }]));
    let p = vec![
        [0.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [2.0, 2.0, 0.0],
        [0.0, 2.0, 0.0],
        [1.0, 1.0, 0.0],
        [1.0, 1.0, 0.0f32],
    ];
    let mut m = Mesh::from_triangles(p, &faces).unwrap();
    let up =
        |m: &Mesh| -> Vec<bool> { (0..8).map(|f| m.face_normal(progmesh_aif::FaceId(f)).z > 0.0).collect() };
    let before = up(&m);
    nsa::run(&mut m, &options(|o| o.epsilon = Some(89.0)), &mut Ignore, &Quiet).unwrap();
    for f in m.topology().faces() {
        assert_eq!(m.face_normal(f).z > 0.0, before[f.index()], "{f:?}");
        assert!(m.face_normal(f).length() > 0.0);
    }
    let t = m.topology();
    assert_eq!((m.check(), t.euler_characteristic(), t.border_loops().len()), (Ok(()), 2, 0));
}

#[test]
fn epsilon_must_be_an_angle() {
    for bad in [f64::NAN, -1.0, 180.5, f64::INFINITY] {
        let mut m = sample("sphere", 80, 0);
        let e = simplify(&mut m, &options(|o| o.epsilon = Some(bad)), &Quiet).unwrap_err();
        assert!(matches!(e, SimplifyError::Range { option: "epsilon", .. }), "{e}");
        assert_eq!(m.face_count(), 80, "nothing has happened");
    }
    for good in [0.0, 180.0] {
        run(&mut sample("sphere", 80, 0), |o| o.epsilon = Some(good));
    }
}

#[test]
fn nothing_and_next_to_nothing_are_left_alone() {
    let mut m = Mesh::default();
    let out = run(&mut m, |_| {});
    assert_eq!((out.faces_out, out.stop, out.levels.len()), (0, Stop::Target, 0));
    let mut m = sample("single-triangle", 1, 0);
    let out = run(&mut m, |_| {});
    assert_eq!((out.faces_out, out.stop, out.levels.len()), (1, Stop::NoLegalCollapse, 0));
}

#[test]
fn a_plane_is_emptied_at_epsilon_zero_and_a_sphere_is_not_touched() {
    let n = 20u32;
    let points = (0..=n).flat_map(|y| (0..=n).map(move |x| [x as f32, y as f32, 0.25 * x as f32]));
    let quad = |x: u32, y: u32| [[0, 1, n + 2], [0, n + 2, n + 1]].map(|t| t.map(|k| y * (n + 1) + x + k));
    let triangles: Vec<_> = (0..n).flat_map(|y| (0..n).flat_map(move |x| quad(x, y))).collect();
    let mut plane = Mesh::from_triangles(points.collect::<Vec<_>>(), &triangles).unwrap();
    let before = border(&plane);
    let out = run(&mut plane, |o| o.epsilon = Some(0.0));
    assert_eq!((border(&plane), out.estimate), (before, 0.0));
    assert_eq!(out.faces_out, 4 * n as usize - 2, "no vertex inside is left");
    let mut sphere = sample("sphere", 500, 0);
    let out = run(&mut sphere, |o| o.epsilon = Some(0.0));
    assert_eq!((out.faces_out, out.stop), (out.faces_in, Stop::NoLegalCollapse));
    let refused = out.levels.iter().map(|l| l.refused.total()).sum::<u64>();
    assert_eq!(refused, 0, "a pass without a collapse is no level");
}

#[test]
fn targets_are_met_exactly_or_within_a_face() {
    for target in [1000, 777, 500, 301, 120] {
        let mut m = sample("sphere", 1280, 0);
        let out = run(&mut m, |o| {
            o.triangles = Some(target);
            o.epsilon = Some(60.0);
        });
        assert_eq!(out.stop, Stop::Target);
        assert!(
            out.triangles_out <= target && out.triangles_out + 1 >= target,
            "{target}: {}",
            out.triangles_out
        );
        assert_eq!(out.levels.last().unwrap().faces, out.faces_out);
    }
    let mut m = sample("sphere", 1280, 0);
    let out = run(&mut m, |o| (o.ratio, o.triangles) = (Some(0.5), Some(100)));
    assert_eq!((out.stop, out.triangles_out), (Stop::Target, out.faces_in / 2), "the first reached");
}

#[test]
fn passes_and_levels_are_counted() {
    let mut m = sample("scan", 5000, 3);
    let out = run(&mut m, |o| o.passes = Some(3));
    assert_eq!((out.stop, out.levels.len()), (Stop::Passes, 3));
    let mut faces = out.faces_in;
    for (i, l) in out.levels.iter().enumerate() {
        assert_eq!(l.pass, i + 1);
        // A collapse on the inside takes two faces.
        assert_eq!(2 * (l.tried - l.refused.total()), (faces - l.faces) as u64, "pass {}", l.pass);
        assert!(l.refused.border > 0 && l.refused.normal > 0, "{l:?}");
        faces = l.faces;
    }
    assert_eq!(faces, out.faces_out);
}

#[test]
fn an_error_bound_stops_it_sooner() {
    let run = |bound: Option<f64>| {
        let mut m = sample("scan", 3000, 3);
        let out = run(&mut m, |o| {
            o.epsilon = Some(90.0);
            o.max_error = bound.map(|value| MaxError { value, relative: true });
        });
        (out.faces_out, out.stop, out.estimate)
    };
    let (loose, tight) = (run(None), run(Some(0.002)));
    assert_eq!((loose.1, tight.1), (Stop::NoLegalCollapse, Stop::Error));
    assert!(tight.0 > loose.0 && tight.2 <= 0.002 * 1.0001 && loose.2 > 0.002, "{loose:?} {tight:?}");
}

#[test]
fn locks_hold() {
    let mut m = sample("sphere", 1280, 0);
    let locked: Vec<usize> = (0..m.vertex_count()).step_by(7).collect();
    let places: Vec<_> = locked.iter().map(|&v| m.positions().bits(v)).collect();
    let out = run(&mut m, |o| {
        locked.iter().for_each(|&v| o.locked_vertices.set(v));
        o.epsilon = Some(40.0);
    });
    let left: std::collections::HashSet<_> =
        (0..m.positions().len()).map(|v| m.positions().bits(v)).collect();
    assert!(places.iter().all(|p| left.contains(p)));
    assert!(out.faces_out < out.faces_in / 2 && out.levels.iter().any(|l| l.refused.locked > 0));
}

#[test]
fn kept_vertices_share_one_buffer() {
    for name in ["scan", "polygons", "quad-sphere"] {
        let input = sample(name, 2000, 1);
        let mut m = input.clone();
        let out = run(&mut m, |o| (o.keep_vertices, o.passes) = (true, Some(2)));
        assert!(out.faces_out < out.faces_in, "{name}");
        assert_eq!(m.positions(), input.positions(), "{name}");
        assert!(out.vertex_origin.is_empty());
    }
}

#[test]
fn the_origin_of_a_vertex_is_told() {
    let input = sample("scan", 2000, 1);
    let mut m = input.clone();
    let out = run(&mut m, |o| (o.placement, o.passes) = (Some(Placement::Endpoint), Some(2)));
    assert_eq!(out.vertex_origin.len(), m.vertex_count());
    for (v, &o) in out.vertex_origin.iter().enumerate() {
        assert_eq!(m.positions().bits(v), input.positions().bits(o as usize));
    }
}

#[test]
fn attributes_stay_on_the_sphere() {
    // Normals of a unit sphere are its points: interpolated ones must still look outwards, and seams stay seams.
    let mut m = sample("quad-sphere", 3000, 0);
    let seams = |m: &Mesh| {
        let (t, w) = (m.topology(), m.wedges().unwrap());
        t.vertices()
            .filter(|&v| {
                let at =
                    |f| w.corner[t.corner_range(f).start + t.face_vertices(f).position(|x| x == v).unwrap()];
                let mut all = t.vertex_faces(v).map(at);
                let first = all.next().unwrap();
                all.any(|x| !w.same(x, first))
            })
            .count()
    };
    let seams_before = seams(&m);
    let out = run(&mut m, |o| (o.epsilon, o.passes) = (Some(30.0), Some(3)));
    assert!(out.faces_out * 2 < out.faces_in, "{}", out.faces_out);
    assert!(seams(&m) > 0 && seams(&m) <= seams_before);
    let (t, w) = (m.topology(), m.wedges().unwrap());
    let k = w.channel(&Semantic::Normal).unwrap();
    for f in t.faces() {
        for (c, v) in t.corner_range(f).zip(t.face_vertices(f)) {
            let n = w.get(w.corner[c], k).unwrap();
            let n = DVec3::new(n[0] as f64, n[1] as f64, n[2] as f64);
            assert!((n.length() - 1.0).abs() < 1e-5);
            assert!(n.dot(m.position(v).normalize()) > 0.95, "{n} at {}", m.position(v));
        }
    }
}

/// Asks for a stop after so many questions.
struct Impatient {
    left: AtomicUsize,
    last: std::sync::Mutex<f64>,
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
    let whole = run(&mut sample("sphere", 40_000, 0), |_| {}).faces_out;
    for patience in [0, 3, 12, 1_000_000] {
        let control = Impatient { left: patience.into(), last: 0.0.into() };
        let mut m = sample("sphere", 40_000, 0);
        let out = simplify(&mut m, &options(|_| {}), &control).unwrap();
        assert_eq!(m.check(), Ok(()));
        if patience < 1000 {
            assert_eq!(out.stop, Stop::Cancelled);
            assert!(out.faces_out > whole);
            assert_eq!(out.faces_out == out.faces_in, patience == 0);
        } else {
            assert_eq!((out.stop, out.faces_out), (Stop::NoLegalCollapse, whole));
        }
    }
}

#[test]
fn several_meshes_share_a_target() {
    let mut meshes = vec![sample("sphere", 1280, 0), sample("scan", 3000, 1), Mesh::default()];
    let total: usize = meshes.iter().map(Mesh::triangle_count).sum();
    let out = simplify_all(&mut meshes, &[1.0; 3], &options(|o| o.ratio = Some(0.4)), &Quiet).unwrap();
    let left: usize = out.iter().map(|o| o.triangles_out).sum();
    let want = (0.4 * total as f64).round() as usize;
    assert!(left <= want && left + 4 >= want, "{left} of {want}");
    for (o, m) in out.iter().zip(&meshes).take(2) {
        assert_eq!((o.stop, m.check()), (Stop::Target, Ok(())));
        let part = o.triangles_out as f64 / o.faces_in as f64;
        assert!((0.3..0.5).contains(&part), "{part}");
    }
}

struct Ignore;

impl Recorder for Ignore {
    fn step(&mut self, _: &Step<'_>) {}
    fn level(&mut self, _: &Level) {}
}

fn unit_normals(m: &Mesh) -> Vec<Option<DVec3>> {
    let t = m.topology();
    (0..t.face_slots() as u32)
        .map(progmesh_aif::FaceId)
        .map(|f| if t.has_face(f) { m.face_normal(f).try_normalize() } else { None })
        .collect()
}

fn any_sample() -> impl Strategy<Value = (Mesh, &'static str)> {
    let names =
        ["scan", "sphere", "torus", "terrain", "cad", "polygons", "quad-sphere", "nonmanifold", "squashed"];
    (prop::sample::select(names.to_vec()), 30usize..900, 0u64..1000)
        .prop_map(|(n, faces, seed)| (sample(n, faces, seed), n))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn topology_border_and_normals_are_kept(
        (input, name) in any_sample(),
        epsilon in 0.0f64..60.0,
        placement in prop::sample::select(vec![Placement::Midpoint, Placement::Endpoint, Placement::Optimal]),
        passes in 1usize..4,
    ) {
        let set = |o: &mut Options| (o.epsilon, o.placement, o.passes) = (Some(epsilon), Some(placement), Some(1));
        let (shape, rim) = (topology_of(&input), border(&input));
        let mut m = input;
        for _ in 0..passes {
            let before = unit_normals(&m);
            let corners = m.topology().faces().map(|f| m.topology().corner_range(f).len()).max().unwrap_or(0);
            let out = nsa::run(&mut m, &options(set), &mut Ignore, &Quiet).unwrap();
            prop_assert_eq!(m.check(), Ok(()));
            // Each corner may move once: at most so many epsilons, and no fold-over by one.
            let most = (corners as f64 * epsilon + 0.01).min(180.0).to_radians().cos();
            for (was, is) in before.iter().zip(unit_normals(&m)) {
                if let (Some(was), Some(is)) = (was, is) {
                    let cos = was.dot(is);
                    prop_assert!(cos >= most - 1e-9, "{name}: {cos} < {most}");
                }
            }
            prop_assert_eq!(topology_of(&m), shape);
            prop_assert_eq!(&border(&m), &rim);
            prop_assert!(wedges_are_finite(&m));
            prop_assert!(out.levels.len() <= 1);
        }
    }

    #[test]
    fn targets_are_met_or_the_reason_is_given((input, name) in any_sample(), ratio in 0.0f64..1.0, epsilon in 1.0f64..90.0) {
        let total = input.triangle_count();
        let want = (ratio * total as f64).round() as usize;
        let mut m = input;
        let out = run(&mut m, |o| (o.ratio, o.epsilon) = (Some(ratio), Some(epsilon)));
        match out.stop {
            Stop::Target => prop_assert!(out.triangles_out <= want && out.triangles_out + 2 > want.min(total)),
            Stop::NoLegalCollapse => prop_assert!(out.triangles_out > want, "{}", name),
            other => prop_assert!(false, "{:?}", other),
        }
    }

    #[test]
    fn recording_changes_nothing((input, _) in any_sample()) {
        let (mut a, mut b) = (input.clone(), input);
        let o = options(|o| o.passes = Some(2));
        simplify(&mut a, &o, &Quiet).unwrap();
        nsa::run(&mut b, &o, &mut Ignore, &Quiet).unwrap();
        let compact = b.compact(progmesh_aif::CompactOptions::with_drop_isolated(true)).0;
        prop_assert_eq!(a.to_input().corners, compact.to_input().corners);
        prop_assert_eq!(a.positions(), compact.positions());
        prop_assert_eq!(a.wedges(), compact.wedges());
    }
}

#[test]
fn hostile_meshes_come_out_as_meshes() {
    for e in progmesh_meshes::names().iter().filter(|e| e.hostile) {
        let s =
            progmesh_meshes::generate(e.name, &progmesh_meshes::GenerateOptions::default().with_faces(1500))
                .unwrap();
        let input: MeshInput = common::input_of(&s);
        let Ok((mut m, _)) = Mesh::build(input, &BuildOptions::default()) else {
            assert!(["nan", "inf", "index-out-of-range"].contains(&e.name), "{}", e.name);
            continue;
        };
        let (shape, rim) = (topology_of(&m), border(&m));
        let out = run(&mut m, |o| o.passes = Some(4));
        assert_eq!((topology_of(&m), border(&m)), (shape, rim), "{}", e.name);
        let scan = ["offset", "scale"].iter().any(|p| e.name.starts_with(p));
        assert!(!scan || out.faces_out < out.faces_in, "{}", e.name);
    }
}
