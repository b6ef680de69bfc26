//! Directional errors: they nest, views by them are least closed sets, and what is shown deviates as little as they say, measured by looking at everything.

mod common;

use common::{Random, any_camera, least_closed, progressive};
use glam::{DMat4, DVec3};
use progmesh_refine::format::{EncodeOptions, decode, encode};
use progmesh_refine::hierarchy::{Bounds, Guarantee, Hierarchy, Options};
use progmesh_refine::selective::{Cull, Lens, Limits, View};
use progmesh_refine::simplify::Method;
use progmesh_refine::view::{Camera, CameraParameters, Projection};
use std::sync::Arc;

fn hierarchy(name: &str, faces: usize, options: &Options) -> Arc<Hierarchy> {
    let pm = Arc::new(progressive(name, faces, Method::Quadric, None));
    Arc::new(Hierarchy::new(pm, options).unwrap())
}

fn known(name: &str, faces: usize) -> Arc<Hierarchy> {
    let h = hierarchy(name, faces, &Options::RINGS.with_directions(true));
    assert!(h.all_bounds().has_directions() && h.all_bounds().guarantee() == Guarantee::Settled);
    h
}

fn camera(h: &Hierarchy, random: &mut Random, round: usize) -> Camera {
    let perspective = Projection::Perspective { fov_y_deg: 40.0 };
    let flat = Projection::Orthographic { ortho_height: 0.4 * h.extent().1 };
    any_camera(h, random, [0.3, 0.6, 1.5][round % 3], if round % 4 == 3 { flat } else { perspective })
}

fn lens(h: &Hierarchy, camera: &Camera, tau: f64, cull: Cull) -> Lens {
    Lens::new(h, camera, &DMat4::IDENTITY, tau, cull).unwrap().directional()
}

/// The split above each in the hierarchy, if there is one.
fn above(h: &Hierarchy) -> Vec<Option<usize>> {
    let n0 = h.mesh().base_vertices();
    let mut last: Vec<Option<usize>> = (0..n0 + h.splits()).map(|v| v.checked_sub(n0)).collect();
    h.mesh().splits.vertex.iter().enumerate().map(|(i, &v)| last[v as usize].replace(i)).collect()
}

#[test]
fn what_is_not_needed_has_nothing_below_it_that_is() {
    for name in ["scan", "cad", "torus"] {
        let h = known(name, 4000);
        let (above, mut random) = (above(&h), Random(5));
        let (mut needed, mut fewer) = (0, 0);
        for round in 0..24 {
            let c = camera(&h, &mut random, round);
            let l = lens(&h, &c, [0.3, 1.0, 3.0][random.below(3)], [Cull::None, Cull::All][round % 2]);
            let plain =
                Lens::new(&h, &c, &DMat4::IDENTITY, l.tau(), [Cull::None, Cull::All][round % 2]).unwrap();
            for (i, up) in above.iter().enumerate().filter(|(i, _)| l.needs(&h, *i)) {
                assert!(up.is_none_or(|up| l.needs(&h, up)), "{name}, round {round}: {i} below {up:?}");
                assert!(plain.needs(&h, i), "what counts is never more than all");
                needed += 1;
            }
            fewer += (0..h.splits()).filter(|&i| plain.needs(&h, i) && !l.needs(&h, i)).count();
        }
        // Deviations of the block are nothing, or any way.
        assert!(needed > 1000 && (name == "cad" || fewer > 20), "{name}: {needed} {fewer}");
    }
}

/// What of a deviation shows: the part across the line of sight, and a quarter of that along it.
fn least(p: DVec3, line: DVec3, triangles: &[[DVec3; 3]]) -> f64 {
    let v = line.normalize();
    let near = |q: DVec3| (q - p) - v * (0.75 * (q - p).dot(v));
    let side = |a: DVec3, b: DVec3| {
        let way = b - a;
        (a + way * (-a.dot(way) / way.length_squared().max(1e-300)).clamp(0.0, 1.0)).length()
    };
    let distance = |t: &[DVec3; 3]| {
        let [a, b, c] = t.map(near);
        let sides = side(a, b).min(side(b, c)).min(side(c, a));
        let n = (b - a).cross(c - a);
        let inside = [(a, b), (b, c), (c, a)].iter().all(|(a, b)| (*b - *a).cross(-*a).dot(n) > 0.0);
        if inside { sides.min((a.dot(n) / n.length()).abs()) } else { sides }
    };
    triangles.iter().map(distance).fold(f64::INFINITY, f64::min)
}

fn triangles(view: &View) -> Vec<[DVec3; 3]> {
    let m = view.to_input();
    m.corners.chunks_exact(3).map(|f| [0, 1, 2].map(|k| m.positions.get(f[k] as usize))).collect()
}

#[test]
fn what_shows_of_deviations_is_below_the_tolerance() {
    for name in ["sphere", "scan", "terrain", "torus"] {
        let h = known(name, 3000);
        let mut full = View::new(h.clone());
        let mut random = Random(11);
        let all = Lens::new(&h, &camera(&h, &mut random, 0), &DMat4::IDENTITY, 0.0, Cull::None).unwrap();
        full.adapt(&all, &Limits::default());
        let finest = triangles(&full);
        let mut view = View::new(h.clone());
        let mut ratios = Vec::new();
        for round in 0..8 {
            let c = camera(&h, &mut random, round);
            let tau = [0.5, 1.0, 2.0][random.below(3)];
            assert!(view.adapt(&lens(&h, &c, tau, Cull::All), &Limits::default()).complete);
            let (shown, frustum) = (triangles(&view), c.frustum());
            let mut worst = 0.0f64;
            for _ in 0..600 {
                let t = finest[random.below(finest.len())];
                let (u, v) = (random.unit().sqrt(), random.unit());
                let p = t[0] * (1.0 - u) + t[1] * (u * (1.0 - v)) + t[2] * (u * v);
                let line = if c.is_perspective() { p - c.eye() } else { c.look() };
                if frustum.contains(p) && line.dot((t[1] - t[0]).cross(t[2] - t[0])) < 0.0 {
                    worst = worst.max(c.pixels(least(p, line, &shown), c.depth(p)));
                }
            }
            ratios.push(worst / tau);
        }
        ratios.sort_by(f64::total_cmp);
        assert!(ratios[7] <= 1.0 && ratios[7] > 0.2, "{name}: {ratios:.2?}");
    }
}

#[test]
fn flights_show_what_looking_at_everything_would() {
    let h = known("scan", 4000);
    let (centre, size) = h.extent();
    let mut view = View::new(h.clone());
    let (mut changed, mut fewer) = (0, 0);
    for frame in 0..90 {
        let t = 0.01 * frame as f64;
        let distance = if frame < 45 { 1.0 } else { 0.35 };
        let arm = DVec3::new(t.sin(), 0.2, t.cos()) * distance * size;
        let projection = match frame {
            0..20 => Projection::Orthographic { ortho_height: 0.7 * size },
            _ => Projection::Perspective { fov_y_deg: 45.0 },
        };
        let c = CameraParameters {
            eye: centre + arm,
            target: centre,
            up: DVec3::Y,
            projection,
            width: 640,
            height: 480,
            near: 1e-3 * size,
            far: 9.0 * size,
        };
        let c = Camera::new(&c).unwrap();
        let tau = if frame > 70 { 0.5 + 0.01 * frame as f64 } else { 0.8 };
        let l = lens(&h, &c, tau, Cull::All);
        let done = view.adapt(&l, &Limits::default());
        changed += done.splits + done.collapses;
        let want = least_closed(&h, &l, |i| h.dependencies(i));
        assert!((0..h.splits()).all(|i| view.is_applied(i) == want[i]), "frame {frame}");
        let plain = Lens::new(&h, &c, &DMat4::IDENTITY, tau, Cull::All).unwrap();
        fewer +=
            least_closed(&h, &plain, |i| h.dependencies(i)).iter().zip(&want).filter(|(a, b)| a != b).count();
    }
    assert!(changed > 1000 && fewer > 500, "{changed} {fewer}");
}

#[test]
fn where_directions_are_not_known_or_angles_change_all_counts() {
    let (h, without) = (known("scan", 2000), hierarchy("scan", 2000, &Options::RINGS));
    assert!(!without.all_bounds().has_directions());
    let c = camera(&h, &mut Random(3), 1);
    let needed = |h: &Hierarchy, l: Lens| (0..h.splits()).filter(|&i| l.needs(h, i)).count();
    let of = |h: &Hierarchy, m: DMat4| {
        let plain = Lens::new(h, &c, &m, 0.7, Cull::None).unwrap();
        [needed(h, plain), needed(h, plain.directional())]
    };
    let (even, uneven) = (DMat4::from_scale(DVec3::splat(1.5)), DMat4::from_scale(DVec3::new(1.0, 1.5, 1.0)));
    let [plain, directional] = of(&h, even);
    assert!(directional < plain, "{directional} {plain}");
    assert!([of(&h, uneven), of(&without, even)].iter().all(|[a, b]| a == b));
    // Quantised places, and other orders, keep what is known.
    let bounds = h.all_bounds();
    let moved = bounds.after_moving(h.mesh(), 1e-3 * h.extent().1).unwrap();
    assert!(moved.has_directions() && bounds.slice(0..9).has_directions());
    assert_eq!(bounds.bytes(), without.all_bounds().bytes() + 2 * h.splits());
}

#[test]
fn a_file_keeps_which_way_deviations_lie() {
    let options = Options::RINGS.with_directions(true);
    let mut pm = progressive("scan", 3000, Method::Quadric, None);
    let own = Arc::new(Hierarchy::new(Arc::new(pm.clone()), &options).unwrap());
    pm.bounds = Some(Arc::new(Bounds::measure(&pm, &options).unwrap()));
    let plain = EncodeOptions::default().with_chunk(Some(500));
    for file in [plain.clone(), plain.clone().with_sequential(true), plain.with_pages(true)] {
        let bytes = encode(std::slice::from_ref(&pm), &[], &[], &file).unwrap();
        let read = decode(&bytes).unwrap().meshes.remove(0);
        assert!(read.bounds.as_ref().is_some_and(|b| b.has_directions()));
        let h = Arc::new(Hierarchy::new(Arc::new(read), &Options::RINGS).unwrap());
        assert!(h.all_bounds().has_directions());
        let mut random = Random(9);
        let mut fewer = 0;
        for round in 0..8 {
            let c = camera(&own, &mut random, round);
            let faces = |h: &Arc<Hierarchy>, lens: Lens| {
                let mut view = View::new(h.clone());
                assert!(view.adapt(&lens, &Limits::default()).complete);
                view.face_count()
            };
            let directional = faces(&h, lens(&h, &c, 1.0, Cull::All));
            assert_eq!(directional, faces(&own, lens(&own, &c, 1.0, Cull::All)), "round {round}");
            let uniform = faces(&h, Lens::new(&h, &c, &DMat4::IDENTITY, 1.0, Cull::All).unwrap());
            fewer += uniform - directional;
        }
        assert!(fewer > 20, "{fewer}");
    }
}
