//! Vertex clustering: targets, bounds, attributes, and always a mesh.

mod common;

use common::{drawn, input_of, sample};
use glam::DVec3;
use progmesh_aif::{BuildOptions, Mesh, Semantic};
use progmesh_simplify::*;
use proptest::prelude::*;
use std::collections::HashSet;

fn options(set: impl FnOnce(&mut Options)) -> Options {
    let mut o = Options::default();
    o.method = Method::Cluster;
    set(&mut o);
    o
}

fn run(mesh: &mut Mesh, set: impl FnOnce(&mut Options)) -> Outcome {
    let out = simplify(mesh, &options(set), &Quiet).unwrap();
    assert_eq!(mesh.check(), Ok(()));
    assert_eq!((out.faces_out, out.triangles_out), (mesh.face_count(), mesh.triangle_count()));
    out
}

#[test]
fn four_cells_of_a_sheet_leave_two_triangles() {
    let (input, _) = drawn(
        "
a---b---c---d
|   |   |   |
e---f---g---h
|   |   |   |
i---j---k---l
|   |   |   |
m---n---o---p",
        "aefb bfgc cghd eijf fjkg gklh imnj jnok kopl",
    );
    // Cells of half the width: abefijmn | cdghklop across, in rows by height.
    for (placement, x) in [(Placement::Midpoint, [2.0, 10.0]), (Placement::Endpoint, [0.0, 8.0])] {
        let mut m = input.clone();
        let out = run(&mut m, |o| {
            o.triangles = Some(2);
            o.placement = Some(placement);
        });
        assert_eq!(
            (out.triangles_out, m.vertex_count(), out.triangulated, out.stop),
            (2, 4, 9, Stop::Target)
        );
        let mut got: Vec<f64> = m.positions().iter().map(|p| p.x).collect();
        got.sort_by(f64::total_cmp);
        got.dedup();
        assert_eq!(got, x, "{placement:?}");
        assert!(m.topology().faces().all(|f| m.face_normal(f).z > 0.0));
    }
}

#[test]
fn the_two_sides_of_a_thin_plate_stay_two() {
    // A flat closed box: top and bottom fall together, and look opposite ways.
    let p: Vec<[f32; 3]> =
        (0..8).map(|i| [(i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32 * 1e-3]).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];
    let mut m = Mesh::from_polygons(p, &[4; 6], quads.as_flattened()).unwrap();
    let out = run(&mut m, |o| o.triangles = Some(5));
    assert_eq!((out.triangles_out, m.vertex_count()), (4, 4));
    let up = m.topology().faces().filter(|&f| m.face_normal(f).z > 0.0).count();
    assert_eq!(up, 2);
}

#[test]
fn targets_are_met_from_below_and_nearly() {
    for (name, faces) in [("sphere", 20_000), ("scan", 20_000), ("torus", 16_000), ("terrain", 20_000)] {
        let input = sample(name, faces, 1);
        for part in [2, 10, 50] {
            let target = input.triangle_count() / part;
            let mut m = input.clone();
            let out = run(&mut m, |o| o.triangles = Some(target));
            assert_eq!(out.stop, Stop::Target);
            assert!(out.triangles_out <= target, "{name}");
            assert!(out.triangles_out * 10 >= target * 6, "{name}: {} of {target}", out.triangles_out);
        }
    }
    let mut m = sample("sphere", 320, 0);
    let out = run(&mut m, |o| o.ratio = Some(1.0));
    assert_eq!((out.faces_out, out.stop, out.estimate), (320, Stop::Target, 0.0));
}

#[test]
fn no_vertex_moves_farther_than_the_bound() {
    for placement in [Placement::Midpoint, Placement::Endpoint, Placement::Optimal] {
        for relative in [true, false] {
            let input = sample("scan", 5000, 2);
            let mut m = input.clone();
            let out = run(&mut m, |o| {
                o.max_error = Some(MaxError { value: 0.05, relative });
                o.placement = Some(placement);
            });
            assert_eq!(out.stop, Stop::Error);
            assert!(out.estimate <= 0.05 && out.estimate > 0.01, "{}", out.estimate);
            let left: Vec<DVec3> = m.positions().iter().collect();
            for p in input.positions().iter() {
                // Not all clusters are left in the mesh, but the nearest of a vertex rarely vanishes here.
                let d = left.iter().map(|q| q.distance(p)).fold(f64::INFINITY, f64::min);
                assert!(d <= 0.05 + 1e-6 || placement != Placement::Midpoint, "{d}");
            }
        }
    }
}

#[test]
fn of_target_and_bound_the_first_ends_it() {
    let with = |triangles, bound: Option<f64>| {
        let mut m = sample("sphere", 5000, 0);
        let out = run(&mut m, |o| {
            o.triangles = triangles;
            o.max_error = bound.map(|value| MaxError { value, relative: true });
        });
        (out.triangles_out, out.stop)
    };
    let (by_count, by_error) = (with(Some(500), None), with(None, Some(0.02)));
    assert_eq!(with(Some(500), Some(0.02)), by_error);
    assert_eq!(with(Some(500), Some(0.9)), by_count);
    assert!(by_error.0 > by_count.0);
}

#[test]
fn a_mesh_never_vanishes() {
    // Without a target, and with one too small for any grid: the coarsest that leaves something.
    for target in [None, Some(0), Some(1), Some(3)] {
        let mut m = sample("sphere", 320, 0);
        let out = run(&mut m, |o| o.triangles = target);
        assert_eq!(out.stop, Stop::NoLegalCollapse, "{target:?}");
        assert!(out.faces_out > target.unwrap_or(0) && out.faces_out < 30, "{}", out.faces_out);
    }
    // A bound under which all would fall together.
    let mut m = sample("sphere", 320, 0);
    let out = run(&mut m, |o| o.max_error = Some(MaxError { value: 100.0, relative: false }));
    assert_eq!(out.stop, Stop::NoLegalCollapse);
    assert!(out.faces_out > 0 && out.faces_out < 30, "{}", out.faces_out);
    // Faces that no grid leaves.
    let flat = vec![[0.0f32; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
    let mut m = Mesh::from_polygons(flat, &[3], &[0, 1, 2]).unwrap();
    let out = run(&mut m, |o| o.triangles = Some(0));
    assert_eq!((out.faces_out, out.stop), (1, Stop::NoLegalCollapse));
    let out = run(&mut Mesh::default(), |o| o.triangles = Some(10));
    assert_eq!((out.faces_out, out.stop), (0, Stop::Target));
}

#[test]
fn a_bound_below_all_edges_changes_nothing() {
    for value in [0.0, 1e-9, 1e-4] {
        let input = sample("sphere", 320, 0);
        let mut m = input.clone();
        let out = run(&mut m, |o| o.max_error = Some(MaxError { value, relative: false }));
        assert_eq!((out.faces_out, out.stop), (320, Stop::Error), "{value}");
        assert!(out.estimate <= value.min(1e-12), "{value}: {}", out.estimate);
    }
}

#[test]
fn locked_vertices_and_borders_stay() {
    let input = sample("scan", 3000, 1);
    let locked: Vec<usize> = (0..input.vertex_count()).step_by(11).collect();
    let mut m = input.clone();
    let out = run(&mut m, |o| {
        locked.iter().for_each(|&v| o.locked_vertices.set(v));
        o.lock_border = true;
        o.ratio = Some(0.5);
    });
    let left: HashSet<_> = (0..m.positions().len()).map(|v| m.positions().bits(v)).collect();
    // A locked vertex whose faces all close up is left out with them; here only a few may be.
    let lost = locked.iter().filter(|&&v| !left.contains(&input.positions().bits(v))).count();
    assert!(lost * 50 <= locked.len(), "{lost} of {}", locked.len());
    let rim = input.topology().border_loops();
    let kept =
        rim.iter().flat_map(|l| &l.vertices).filter(|v| left.contains(&input.positions().bits(v.index())));
    assert_eq!(kept.count(), rim.iter().map(|l| l.vertices.len()).sum::<usize>());
    assert!(out.triangles_out <= input.triangle_count() / 2);
    let mut m = input.clone();
    let out = run(&mut m, |o| {
        (0..input.vertex_count()).for_each(|v| o.locked_vertices.set(v));
        o.ratio = Some(0.5);
    });
    assert_eq!((out.stop, out.faces_out), (Stop::NoLegalCollapse, out.faces_in));
}

#[test]
fn kept_vertices_share_one_buffer_and_origins_are_told() {
    for name in ["scan", "polygons", "quad-sphere", "nonmanifold"] {
        let input = sample(name, 2000, 1);
        let mut m = input.clone();
        run(&mut m, |o| (o.keep_vertices, o.ratio) = (true, Some(0.3)));
        assert_eq!(m.positions(), input.positions(), "{name}");
        let mut m = input.clone();
        let out = run(&mut m, |o| (o.placement, o.ratio) = (Some(Placement::Endpoint), Some(0.3)));
        assert_eq!(out.vertex_origin.len(), m.vertex_count());
        for (v, &o) in out.vertex_origin.iter().enumerate() {
            assert_eq!(m.positions().bits(v), input.positions().bits(o as usize), "{name}");
        }
    }
}

#[test]
fn attributes_follow() {
    let mut m = sample("quad-sphere", 6000, 0);
    run(&mut m, |o| o.ratio = Some(0.2));
    let (t, w) = (m.topology(), m.wedges().unwrap());
    let k = w.channel(&Semantic::Normal).unwrap();
    for f in t.faces() {
        for (c, v) in t.corner_range(f).zip(t.face_vertices(f)) {
            let n = w.get(w.corner[c], k).unwrap();
            let n = DVec3::new(n[0] as f64, n[1] as f64, n[2] as f64);
            assert!((n.length() - 1.0).abs() < 1e-5);
            assert!(n.dot(m.position(v).normalize()) > 0.9, "{n} at {}", m.position(v));
        }
    }
    // On the block every plane keeps its own normal at the edges.
    let mut m = sample("cad", 3000, 0);
    run(&mut m, |o| (o.ratio, o.placement) = (Some(0.3), Some(Placement::Endpoint)));
    assert_eq!(m.face_materials().len(), m.topology().face_slots());
    let (t, w) = (m.topology(), m.wedges().unwrap());
    for f in t.faces() {
        let normals: Vec<&[f32]> = t.corner_range(f).map(|c| w.get(w.corner[c], 0).unwrap()).collect();
        assert!(normals.iter().all(|n| [0.0, 1.0, -1.0].contains(&n[2])), "{f:?}: {normals:?}");
        let bore = m.material(f) == Some(1);
        assert!(bore || normals[0] == normals[1] && normals[1] == normals[2], "{f:?}: {normals:?}");
    }
}

#[test]
fn several_meshes_share_cells_of_one_size() {
    // The second is the first at a tenth of the size in the world.
    let mut meshes = vec![sample("sphere", 5000, 0), sample("sphere", 5000, 0)];
    let out = simplify_all(&mut meshes, &[1.0, 0.1], &options(|o| o.ratio = Some(0.3)), &Quiet).unwrap();
    assert!(out[0].triangles_out + out[1].triangles_out <= 3000);
    assert!(
        out[1].triangles_out * 20 < out[0].triangles_out,
        "{} {}",
        out[0].triangles_out,
        out[1].triangles_out
    );
}

struct Stopped;

impl Control for Stopped {
    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
fn cancelled_leaves_the_mesh_as_it_is() {
    let mut m = sample("polygons", 500, 0);
    let before = m.face_count();
    let out = simplify(&mut m, &options(|o| o.ratio = Some(0.1)), &Stopped).unwrap();
    assert_eq!((out.stop, out.faces_out, out.triangulated), (Stop::Cancelled, before, 0));
}

#[test]
fn hostile_meshes_come_out_as_meshes() {
    for e in progmesh_meshes::names().iter().filter(|e| e.hostile) {
        let with = progmesh_meshes::GenerateOptions::default().with_faces(1500);
        let s = progmesh_meshes::generate(e.name, &with).unwrap();
        let Ok((mut m, _)) = Mesh::build(input_of(&s), &BuildOptions::default()) else { continue };
        let out = run(&mut m, |o| o.ratio = Some(0.3));
        assert!(out.triangles_out * 10 <= 3 * s.triangle_count().max(4), "{}", e.name);
        assert!(out.triangles_out > 100 || s.triangle_count() < 2, "{}: {}", e.name, out.triangles_out);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_grid_leaves_a_mesh_at_or_below_the_target(
        name in prop::sample::select(vec!["scan", "cad", "polygons", "quad-sphere", "nonmanifold", "terrain", "soup"]),
        faces in 10usize..1500,
        seed in 0u64..1000,
        ratio in 0.0f64..=1.0,
        placement in prop::sample::select(vec![Placement::Midpoint, Placement::Endpoint, Placement::Optimal]),
    ) {
        let input = sample(name, faces, seed);
        let want = (ratio * input.triangle_count() as f64).round() as usize;
        let mut m = input.clone();
        let out = run(&mut m, |o| (o.ratio, o.placement) = (Some(ratio), Some(placement)));
        // Too few for any grid: the coarsest that leaves something.
        prop_assert_eq!(out.stop == Stop::Target, out.triangles_out <= want);
        prop_assert!(out.triangles_out <= want.max(60), "{} of {}", out.triangles_out, want);
        prop_assert!(out.triangles_out > 0);
        // Inside the bounds, and no triangle twice.
        let (lo, hi) = input.bounds().unwrap();
        let slack = 1e-5 * (hi - lo).length();
        for p in m.positions().iter().filter(|_| placement == Placement::Midpoint) {
            prop_assert!((p - lo).min_element() >= -slack && (hi - p).min_element() >= -slack);
        }
        let mut seen = HashSet::new();
        for mut t in m.triangles() {
            let least = (0..3).min_by_key(|&i| t[i]).unwrap();
            t.rotate_left(least);
            prop_assert!(seen.insert(t));
        }
        // The same again is the same.
        let mut again = input;
        run(&mut again, |o| (o.ratio, o.placement, o.threads) = (Some(ratio), Some(placement), Some(1)));
        prop_assert_eq!(again.positions(), m.positions());
    }
}
