//! Geomorphs by time: nothing that is seen jumps, and what is drawn ends as what was asked for, bit for bit.

mod common;

use common::{NAMES, options, sample};
use glam::{DMat4, DVec3};
use progmesh_refine::hierarchy::{Hierarchy, Options};
use progmesh_refine::progressive::build;
use progmesh_refine::selective::{Cull, Lens, Limits, TimedMorph, View};
use progmesh_refine::simplify::{Method, Quiet};
use progmesh_refine::view::{Camera, CameraParameters, Projection};
use std::sync::Arc;

fn hierarchy(name: &str, faces: usize) -> Arc<Hierarchy> {
    let pm = build(sample(name, faces, 5), &options(Method::Quadric, None), &Quiet).unwrap().mesh;
    Arc::new(Hierarchy::new(Arc::new(pm), &Options::default()).unwrap())
}

/// From a place on a circle, looking at the middle or away from it.
fn lens(h: &Hierarchy, turn: f64, tau: f64, cull: Cull, away: bool) -> Lens {
    let (centre, size) = h.extent();
    let arm = DVec3::new(turn.sin(), 0.2, turn.cos()) * 0.7 * size;
    let camera = Camera::new(&CameraParameters {
        eye: centre + arm,
        target: if away { centre + 2.0 * arm } else { centre },
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 45.0 },
        width: 800,
        height: 600,
        near: 0.01 * size,
        far: 10.0 * size,
    });
    Lens::new(h, &camera.unwrap(), &DMat4::IDENTITY, tau, cull).unwrap()
}

/// The vertex that `v` has come from, or is, among those of which `there` is true.
fn ancestor(h: &Hierarchy, mut v: u32, there: impl Fn(u32) -> bool) -> u32 {
    while !there(v) {
        v = h.mesh().splits.vertex[v as usize - h.mesh().base_vertices()];
    }
    v
}

fn assert_same(timed: &TimedMorph, leader: &View) {
    assert!(timed.view().applied().eq(leader.applied()));
    assert_eq!(timed.displaced().count(), 0);
    assert_eq!(timed.view().to_input().positions, leader.to_input().positions);
    assert_eq!(timed.view().to_input().corners, leader.to_input().corners);
}

/// Edges with one face, of the triangles drawn.
fn border(view: &View) -> usize {
    let slots = (0..view.indices().len()).filter(|&s| view.face_in(s).is_some());
    slots.map(|s| view.neighbours(s).iter().filter(|n| n.is_none()).count()).sum()
}

#[test]
fn what_is_seen_moves_in_small_steps_and_ends_where_it_was_asked_for() {
    const FRAMES: u32 = 6;
    for name in NAMES {
        let h = hierarchy(name, 2500);
        let n = h.mesh().vertices() as u32;
        let mut leader = View::new(h.clone());
        leader.adapt(&lens(&h, 0.0, 1.0, Cull::None, false), &Limits::default());
        let mut timed = TimedMorph::new(&leader, FRAMES);
        assert_same(&timed, &leader);
        let (mut longest, mut moved, mut extra) = (0.0f64, 0, 0);
        // To and fro, so that motions are interrupted; nothing is culled, so that all is seen.
        for frame in 0..40 {
            let turn = 0.15 * (frame % 9) as f64;
            let tau = [0.7, 1.5, 5.0, 1.0][frame / 3 % 4];
            let l = lens(&h, turn, tau, Cull::None, false);
            let still = frame >= 30;
            if !still {
                leader.adapt(&l, &Limits::default());
            }
            let before: Vec<Option<DVec3>> = (0..n).map(|v| timed.position(v)).collect();
            let done = timed.follow(&leader, &[l]);
            let view = timed.view();
            assert!(leader.applied().all(|i| view.is_applied(i)), "{name} {frame}");
            extra += view.face_count() - leader.face_count();
            assert_eq!(border(view) == 0, border(&leader) == 0, "{name} {frame}");
            moved += done.morphing;
            for v in 0..n {
                if before[v as usize].is_none() && timed.position(v).is_none() {
                    continue;
                }
                let was = before[ancestor(&h, v, |v| before[v as usize].is_some()) as usize].unwrap();
                let at = timed.position(ancestor(&h, v, |v| timed.position(v).is_some())).unwrap();
                let goal = leader.position(ancestor(&h, v, |v| leader.position(v).is_some())).unwrap();
                longest = longest.max(was.distance(goal));
                assert!(at.distance(was) <= 1.000001 * longest / f64::from(FRAMES), "{name} {frame} {v}");
                if at != goal {
                    assert!(done.morphing > 0, "{name} {frame} {v}");
                }
            }
            if still && frame >= 30 + FRAMES as usize {
                assert_eq!(done.morphing, 0);
                assert_same(&timed, &leader);
            }
        }
        assert!(longest > 0.0 && moved > 300 && extra > 50, "{name}: {moved} {extra}");
    }
}

#[test]
fn in_one_frame_or_unseen_all_jumps() {
    let h = hierarchy("scan", 3000);
    for (frames, away) in [(1, false), (9, true)] {
        let mut leader = View::new(h.clone());
        let mut timed = TimedMorph::new(&leader, frames);
        for frame in 0..10 {
            let l = lens(&h, 0.2 * frame as f64, [0.5, 2.0][frame % 2], Cull::None, false);
            leader.adapt(&l, &Limits::default());
            let seen_by = if away { lens(&h, 0.0, 1.0, Cull::Frustum, true) } else { l };
            let done = timed.follow(&leader, &[seen_by]);
            assert!(done.morphing == 0 && done.splits + done.collapses > 0);
            assert_same(&timed, &leader);
        }
    }
}

#[test]
fn by_error_the_places_of_several_lenses_are_those_that_need_most() {
    let h = hierarchy("scan", 3000);
    let near = lens(&h, 0.0, 0.5, Cull::All, false);
    let mut view = View::new(h.clone());
    view.adapt(&near, &Limits::default());
    let far = near.with_tau(8.0).unwrap();
    let all = (0..h.mesh().vertices() as u32).filter(|&v| view.position(v).is_some());
    let (mut morphing, mut differ) = (0, 0);
    for v in all {
        let one = view.morphed(&near, v, 2.0);
        assert_eq!(view.morphed_by_all(&[near, far], v, 2.0), one);
        assert_eq!(view.morphed_by_all(&[far, near], v, 2.0), one);
        morphing += usize::from(one != view.position(v));
        differ += usize::from(one != view.morphed(&far, v, 2.0));
    }
    assert!(morphing > 20 && differ > 20, "{morphing} {differ}");
}
