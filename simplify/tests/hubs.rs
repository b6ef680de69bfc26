//! Shapes on which careless local work adds up to quadratic time.

mod common;

use progmesh_aif::{Channel, Mesh, MeshInput, Semantic, Wedges};
use progmesh_simplify::*;
use std::f64::consts::TAU;

/// Simplifies on one thread, and the seconds which that thread ran: what else the machine does is not in them, so a busy one takes no longer.
/// `None` where the system does not tell (all but Linux).
fn timed(m: &mut Mesh, o: &Options) -> (Outcome, Option<f64>) {
    let ran = || {
        let all = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        Some(1e-9 * all.split_whitespace().next()?.parse::<f64>().ok()?)
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        let start = ran();
        let out = simplify(m, o, &Quiet).unwrap();
        (out, ran().zip(start).map(|(end, start)| end - start))
    })
}

/// Simplifies by every schedule to next to nothing. All are done in half a second, debug assertions included; quadratic time is ten seconds and more.
fn all_are_quick(what: &str, input: &Mesh) {
    for (schedule, placement) in [
        (Schedule::Exact, Placement::Optimal),
        (Schedule::Bulk, Placement::Optimal),
        (Schedule::Exact, Placement::Endpoint),
        (Schedule::Bulk, Placement::Midpoint),
    ] {
        for triangles in [0, input.triangle_count() / 10] {
            let mut m = input.clone();
            let mut o = Options::default();
            (o.schedule, o.placement, o.triangles) = (Some(schedule), Some(placement), Some(triangles));
            let (out, took) = timed(&mut m, &o);
            println!(
                "{what} {schedule:?} {placement:?} to {triangles}: {} of {} left, {took:.2?} s, {:?}",
                out.triangles_out, out.faces_in, out.stop
            );
            assert!(took.is_none_or(|s| s < 6.0), "{what} {schedule:?} {placement:?}: {took:?}");
            assert_eq!(m.check(), Ok(()));
            assert!(out.triangles_out < out.faces_in / 2, "{what}: {} left", out.triangles_out);
        }
    }
}

fn ring(n: u32, radius: f64, z: f64) -> impl Iterator<Item = [f32; 3]> {
    (0..n).map(move |i| {
        let a = TAU * i as f64 / n as f64;
        [(radius * a.cos()) as f32, (radius * a.sin()) as f32, z as f32]
    })
}

/// A vertex with `n` triangles around it.
fn fan(n: u32, height: f32) -> Mesh {
    let points: Vec<_> = ring(n, 1.0, 0.0).chain([[0.0, 0.0, height]]).collect();
    let triangles: Vec<_> = (0..n).map(|i| [i, (i + 1) % n, n]).collect();
    Mesh::from_triangles(points, &triangles).unwrap()
}

/// A closed cylinder: two caps that are fans, joined by a strip.
fn cylinder(n: u32) -> MeshInput {
    let points: Vec<_> =
        ring(n, 1.0, 0.0).chain(ring(n, 1.0, 1.0)).chain([[0.0; 3], [0.0, 0.0, 1.0]]).collect();
    let faces = |i: u32| {
        let j = (i + 1) % n;
        [[j, i, 2 * n], [n + i, n + j, 2 * n + 1], [i, j, n + j], [i, n + j, n + i]]
    };
    MeshInput::triangles(points, (0..n).flat_map(faces).collect::<Vec<_>>().as_slice())
}

#[test]
fn fans_around_one_vertex() {
    all_are_quick("flat fan", &fan(50_000, 0.0));
    all_are_quick("cone", &fan(50_000, 1.0));
}

#[test]
fn caps_of_a_cylinder() {
    all_are_quick("cylinder", &Mesh::build(cylinder(20_000), &Default::default()).unwrap().0);
}

#[test]
fn caps_of_a_cylinder_with_wedges_and_seams() {
    let mut input = cylinder(20_000);
    let mut w = Wedges::new(vec![Channel::new(Semantic::Normal, 3)]).unwrap();
    let [up, down] = [1.0, -1.0].map(|z| w.push(&[0.0, 0.0, z], 1));
    let n = 20_000;
    let around: Vec<u32> = ring(n, 1.0, 0.0).map(|p| w.push(&p, 1)).collect();
    for (t, c) in input.corners.chunks(3).enumerate() {
        w.corner.extend(c.iter().map(|&v| match t % 4 {
            0 => down,
            1 => up,
            _ => around[(v % n) as usize],
        }));
    }
    input.wedges = Some(w);
    all_are_quick("creased cylinder", &Mesh::build(input, &Default::default()).unwrap().0);
}

#[test]
fn a_long_strip() {
    let n = 50_000;
    let points: Vec<_> = (0..2 * n + 2).map(|i| [(i / 2) as f32, (i % 2) as f32, 0.0]).collect();
    let triangles: Vec<_> =
        (0..n).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 1], [2 * i + 1, 2 * i + 2, 2 * i + 3]]).collect();
    all_are_quick("strip", &Mesh::from_triangles(points, &triangles).unwrap());
}

#[test]
fn a_large_plane() {
    let n = 224u32;
    let points: Vec<_> = (0..=n).flat_map(|y| (0..=n).map(move |x| [x as f32, y as f32, 0.0])).collect();
    let quad = |x: u32, y: u32| [[0, 1, n + 2], [0, n + 2, n + 1]].map(|t| t.map(|k| y * (n + 1) + x + k));
    let triangles: Vec<_> = (0..n).flat_map(|y| (0..n).flat_map(move |x| quad(x, y))).collect();
    all_are_quick("plane", &Mesh::from_triangles(points, &triangles).unwrap());
}

#[test]
fn all_vertices_at_one_place() {
    let sphere = common::sample("sphere", 40_000, 0);
    let points = vec![[1.0f32; 3]; sphere.vertex_count()];
    let m = Mesh::from_triangles(points, &sphere.triangles()).unwrap();
    all_are_quick("point", &m);
}

#[test]
fn a_spire_on_a_locked_rim() {
    // Every edge of the hub comes up, and none may be collapsed: none may cost the whole star.
    let input = fan(50_000, 20.0);
    for schedule in [Schedule::Exact, Schedule::Bulk] {
        let mut m = input.clone();
        let mut o = Options::default();
        (o.schedule, o.lock_border) = (Some(schedule), true);
        let (out, took) = timed(&mut m, &o);
        assert!(took.is_none_or(|s| s < 4.0), "{schedule:?}: {took:?}");
        assert_eq!((out.stop, out.faces_out, m.check()), (Stop::NoLegalCollapse, 50_000, Ok(())));
        assert!(out.levels[0].refused.valence >= 50_000);
    }
}
