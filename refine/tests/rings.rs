//! The ring rule: rings are the same in every mesh of a hierarchy, and so are errors.

mod common;

use common::{NAMES, Random};
use glam::DVec3;
use progmesh_refine::ProgressiveMesh;
use progmesh_refine::aif::{BuildOptions, Mesh, MeshInput, Positions};
use progmesh_refine::format::{EncodeOptions, decode, encode};
use progmesh_refine::hierarchy::{Bounds, Guarantee, Hierarchy, Options, Rule};
use progmesh_refine::progressive::build;
use progmesh_refine::selective::View;
use progmesh_refine::simplify::measure::Surface;
use progmesh_refine::simplify::{Method, Placement, Quiet};
use std::collections::HashMap;
use std::sync::Arc;

fn progressive(name: &str, faces: usize, placement: Option<Placement>) -> ProgressiveMesh {
    common::progressive(name, faces, Method::Quadric, placement)
}

/// Faces around a vertex, ascending, each with the places of its corners.
type Ring = Vec<(u32, [[u64; 3]; 3])>;

/// The faces around `v`, of the sheet that face `seed` is of.
fn ring(view: &View, v: usize, seed: u32) -> Ring {
    let of = |s: usize| view.indices()[s].map(|w| view.wedge_vertex(w));
    let mut slots = vec![view.slot_of(seed).unwrap()];
    for k in 0.. {
        let Some(&s) = slots.get(k) else { break };
        for (edge, to) in view.neighbours(s).into_iter().enumerate() {
            let at = [of(s)[edge], of(s)[(edge + 1) % 3]].contains(&(v as u32));
            slots.extend(to.filter(|t| at && !slots.contains(t)));
        }
    }
    let place = |v: u32| view.position(v).unwrap().to_array().map(f64::to_bits);
    let mut ring: Ring = slots.iter().map(|&s| (view.face_in(s).unwrap(), of(s).map(place))).collect();
    ring.sort_unstable();
    ring
}

#[test]
fn the_ring_of_a_split_is_the_same_in_every_mesh() {
    for name in NAMES {
        let pm = Arc::new(progressive(name, 260, None));
        let h = Arc::new(Hierarchy::new(pm, &Options::RINGS).unwrap());
        assert_eq!(h.rule(), Rule::Rings, "{name}");
        // As they are in the order of the splits.
        let (n, n0) = (h.splits(), h.mesh().base_vertices());
        let splits = &h.mesh().splits;
        let mut first_face = h.mesh().base_faces.len() as u32;
        let mut view = View::new(h.clone());
        let mut want = Vec::new();
        let mut made = Vec::new();
        for i in 0..n {
            let vs = splits.vertex[i] as usize;
            let before = ring(&view, vs, splits.left[i] >> 2);
            assert_eq!(view.split(i), 1);
            want.push([before, ring(&view, vs, first_face), ring(&view, n0 + i, first_face)]);
            made.push(first_face);
            first_face += 1 + splits.code[i].two_faces() as u32;
        }
        let mut view = View::new(h.clone());
        let mut random = Random(7);
        let mut seen = [0, 0];
        for step in 0..24_000 {
            let i = random.below(n);
            let up = (step / 4000) % 2 == 0;
            let vs = splits.vertex[i] as usize;
            if view.may_split(i) {
                assert_eq!(ring(&view, vs, splits.left[i] >> 2), want[i][0], "{name}: {i}");
                seen[0] += 1;
                if up || random.below(4) == 0 {
                    view.split(i);
                }
            } else if view.may_collapse(i) {
                assert_eq!(ring(&view, vs, made[i]), want[i][1], "{name}: {i}");
                assert_eq!(ring(&view, n0 + i, made[i]), want[i][2], "{name}: {i}");
                seen[1] += 1;
                if !up || random.below(4) == 0 {
                    view.collapse(i);
                }
            }
        }
        assert!(seen.iter().all(|&s| s > 60), "{name}: {seen:?}");
    }
}

/// The finest mesh's vertices, quarters of its edges, and places on its faces.
fn samples(pm: &ProgressiveMesh) -> Vec<DVec3> {
    let mut full = pm.cursor().unwrap();
    full.seek(usize::MAX).unwrap();
    let at = |w: u32| full.positions().get(full.wedge_vertex(w) as usize);
    let mut out: Vec<DVec3> = (0..full.positions().len()).map(|v| full.positions().get(v)).collect();
    let mut random = Random(11);
    for t in full.indices() {
        for _ in 0..3 {
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let [a, b, c] = [at(t[0]), at(t[1]), at(t[2])];
            out.push(a + (b - a) * u + (c - a) * v);
        }
        for k in 0..3 {
            let [w, x] = [t[k], t[(k + 1) % 3]];
            if full.wedge_vertex(w) < full.wedge_vertex(x) {
                let (a, b) = (at(w), at(x));
                out.extend([a.lerp(b, 0.25), a.lerp(b, 0.5), a.lerp(b, 0.75)]);
            }
        }
    }
    out
}

/// The mesh shown as a surface.
fn surface(view: &View) -> Surface {
    let shown = view.to_input();
    let faces: Vec<[u32; 3]> = shown.corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    Surface::new(&shown.positions, &faces).unwrap()
}

/// As parts of machines are: plates, a slope between creases and a quarter of a cylinder, with vertices anywhere on what is flat; collapses put vertices on a grid, as files have them.
fn part() -> ProgressiveMesh {
    let (n, m) = (36usize, 14usize);
    let mut random = Random(5);
    let mut off = |free: bool| if free { 0.7 * (random.unit() - 0.5) } else { 0.0 };
    let profile = |u: f64| match u {
        u if u < 10.0 => [u, 0.0],
        u if u < 16.0 => [u, 0.8 * (u - 10.0)],
        u if u < 28.0 => {
            let (sin, cos) = ((u - 16.0) / 12.0 * std::f64::consts::FRAC_PI_2).sin_cos();
            [16.0 + 8.0 * sin, 4.8 + 8.0 * (1.0 - cos)]
        }
        u => [24.0, 12.8 + (u - 28.0)],
    };
    let positions = (0..(n + 1) * (m + 1)).map(|k| {
        let (x, y) = (k % (n + 1), k / (n + 1));
        let flat = (x > 0 && x < 10) || (x > 10 && x < 16) || (x > 28 && x < n);
        let u = x as f64 + off(flat && y > 0 && y < m);
        let [px, pz] = profile(u);
        [px, y as f64 + off(flat && y > 0 && y < m), pz]
    });
    let positions = Positions::F64(positions.collect());
    let corners = (0..n * m).flat_map(|k| {
        let a = (k / n * (n + 1) + k % n) as u32;
        let b = a + n as u32 + 1;
        [a, a + 1, b, a + 1, b + 1, b]
    });
    let input = MeshInput { positions, corners: corners.collect(), ..Default::default() };
    let mesh = Mesh::build(input, &BuildOptions::default()).unwrap().0;
    let mut options = common::options(Method::Quadric, None);
    options.grid = Some(1.0 / 512.0);
    build(mesh, &options, &Quiet).unwrap().mesh
}

#[test]
fn no_place_is_farther_from_any_mesh_than_what_could_be_split_there_says() {
    for name in ["sphere", "scan", "terrain", "torus", "cad", "quad-sphere", "polygons", "part"] {
        let pm = Arc::new(if name == "part" { part() } else { progressive(name, 500, None) });
        let h = Arc::new(Hierarchy::new(pm, &Options::RINGS).unwrap());
        assert_eq!((h.rule(), h.all_bounds().guarantee()), (Rule::Rings, Guarantee::Settled), "{name}");
        let samples = samples(h.mesh());
        let (n, (middle, size)) = (h.splits(), h.extent());
        let mut random = Random(3);
        let mut ratios = Vec::new();
        for round in 0..9 {
            let mut view = View::new(h.clone());
            // Some splits anywhere; all on one side of a plane; stripes, with few elsewhere; then some are undone at random.
            let normal =
                DVec3::new(random.unit() - 0.5, random.unit() - 0.5, random.unit() - 0.5).normalize();
            for i in 0..n {
                let side = (h.bounds(i).centre - middle).dot(normal) / size;
                let wanted = match round % 3 {
                    0 => random.below(12) == 0,
                    1 => side > 0.1,
                    _ => (side * 12.0).rem_euclid(2.0) < 1.0 && random.below(3) > 0,
                };
                if wanted && random.below(1 + round / 4) == 0 {
                    view.split(i);
                }
            }
            for _ in 0..n / 2 {
                view.collapse(random.below(n));
            }
            let surface = surface(&view);
            let mut query = surface.query();
            // Those that replace a vertex that is shown.
            let open: Vec<usize> = (0..n)
                .filter(|&i| {
                    let shown = view.position(h.mesh().splits.vertex[i]);
                    !view.is_applied(i) && shown.is_some_and(|p| p.distance(h.bounds(i).centre) < 1e-6 * size)
                })
                .collect();
            for &p in &samples {
                let holds = |i: &&usize| p.distance(h.bounds(**i).centre) <= h.bounds(**i).radius;
                let bound = open.iter().filter(holds).map(|&i| h.bounds(i).error).fold(0.0, f64::max);
                let d = query.distance(p);
                assert!(d <= bound + 1e-9 * size, "{name} in round {round}: {d} beyond {bound}");
            }
            let worst = samples.iter().map(|&p| query.distance(p)).fold(0.0, f64::max);
            ratios.push(worst / open.iter().map(|&i| h.bounds(i).error).fold(1e-12, f64::max));
        }
        ratios.sort_by(f64::total_cmp);
        // And bounds are no larger than they must be: within a part in 256, where nothing is in between.
        // (What is called cad is flat: there all is rounding.)
        assert!(name == "cad" || ratios[4] > 0.8, "{name}: {ratios:.2?}");
    }
}

/// Errors of splits by the place of the vertex that they make, and how many splits each needs.
fn by_place(h: &Hierarchy) -> HashMap<[u64; 3], (f64, f64, usize)> {
    let place = |i: usize| h.mesh().new_positions.get(i).to_array().map(f64::to_bits);
    let of = |i: usize| (h.bounds(i).error, h.bounds(i).radius, h.dependencies(i).count());
    (0..h.splits()).map(|i| (place(i), of(i))).collect()
}

#[test]
fn a_file_brings_back_the_order_that_bounds_were_measured_in() {
    for (name, placement) in [("scan", None), ("terrain", Some(Placement::Endpoint)), ("quad-sphere", None)] {
        let mut pm = progressive(name, 1500, placement);
        let own = Hierarchy::new(Arc::new(pm.clone()), &Options::RINGS).unwrap();
        assert_eq!(own.rule(), Rule::Rings);
        pm.bounds = Some(Arc::new(Bounds::measure(&pm, &Options::RINGS).unwrap()));
        let carried = Hierarchy::new(Arc::new(pm.clone()), &Options::CUTS).unwrap();
        assert_eq!(carried.rule(), Rule::Rings);
        assert_eq!(by_place(&carried), by_place(&own), "{name}");
        for alone in [false, true] {
            let file = EncodeOptions::default().with_sequential(!alone);
            let bytes = encode(std::slice::from_ref(&pm), &[], &[], &file).unwrap();
            let read = decode(&bytes).unwrap().meshes.remove(0);
            let h = Hierarchy::new(Arc::new(read.clone()), &Options::CUTS).unwrap();
            assert_eq!(by_place(&h), by_place(&own), "{name}");
            // Full detail is the input.
            let mut view = View::new(Arc::new(h));
            (0..view.hierarchy().splits()).for_each(|i| {
                view.split(i);
            });
            let (mut full, a) = (pm.cursor().unwrap(), view.to_input());
            full.seek(usize::MAX).unwrap();
            let b = full.to_ordered_input();
            assert_eq!((&a.positions, &a.corners, a.wedges), (&b.positions, &b.corners, b.wedges));
            // Another order of turns is noticed.
            let mut other = read.clone();
            let bounds = other.bounds.take().unwrap();
            let last = bounds.len() as u32 - 1;
            let order: Vec<u32> = (0..=last).map(|i| if i < 2 { 1 - i } else { i }).rev().collect();
            other.bounds = bounds.reordered(&order).map(Arc::new);
            assert!(Hierarchy::new(Arc::new(other), &Options::RINGS).is_err());
        }
    }
}

#[test]
fn quantising_keeps_settled_bounds_settled() {
    let mut pm = progressive("scan", 1500, None);
    pm.bounds = Some(Arc::new(Bounds::measure(&pm, &Options::RINGS).unwrap()));
    let bytes = encode(&[pm], &[], &[], &EncodeOptions::default().with_quantize(Some(10))).unwrap();
    let pm = decode(&bytes).unwrap().meshes.remove(0);
    assert!(matches!(pm.base_positions, Positions::F32(_) | Positions::F64(_)));
    let h = Hierarchy::new(Arc::new(pm), &Options::RINGS).unwrap();
    assert_eq!(h.rule(), Rule::Rings);
    let samples = samples(h.mesh());
    let view = View::new(h.clone().into());
    let surface = surface(&view);
    let mut query = surface.query();
    let worst = samples.iter().map(|&p| query.distance(p)).fold(0.0, f64::max);
    let bound = (0..h.splits()).map(|i| h.bounds(i).error).fold(0.0, f64::max);
    assert!(worst <= bound, "{worst} {bound}");
}
