//! Attributes of a morph by time go their way in small steps, and end where they belong.

mod common;

use common::{Random, any_camera, progressive};
use glam::DMat4;
use progmesh_refine::hierarchy::{Hierarchy, Options};
use progmesh_refine::selective::{Cull, Lens, Limits, TimedMorph, View};
use progmesh_refine::simplify::{Method, Placement};
use progmesh_refine::view::Projection;
use std::collections::BTreeMap;
use std::sync::Arc;

fn hierarchy(name: &str, method: Method, placement: Option<Placement>) -> Arc<Hierarchy> {
    let pm = progressive(name, 1200, method, placement);
    Arc::new(Hierarchy::new(Arc::new(pm), &Options::RINGS.with_samples(12)).unwrap())
}

fn lens(h: &Hierarchy, tau: f64) -> Lens {
    let camera = any_camera(h, &mut Random(19), 1.0, Projection::Perspective { fov_y_deg: 40.0 });
    // All is seen.
    Lens::new(h, &camera, &DMat4::IDENTITY, tau, Cull::None).unwrap()
}

type Corners = BTreeMap<u32, [(Vec<f32>, u64); 3]>;

/// What the corners of every face are drawn with.
fn corners(morph: &TimedMorph) -> Corners {
    let view = morph.view();
    let slots = 0..view.indices().len();
    let face = |slot: usize| Some((view.face_in(slot)?, view.indices()[slot].map(|w| morph.row(w).unwrap())));
    slots.filter_map(face).collect()
}

/// The same of a mesh at rest.
fn own(view: &View) -> Corners {
    let row = |w: u32| {
        let (values, has) = view.row(w);
        (values.into_owned(), has)
    };
    let face = |slot: usize| Some((view.face_in(slot)?, view.indices()[slot].map(row)));
    (0..view.indices().len()).filter_map(face).collect()
}

fn largest_step(a: &Corners, b: &Corners) -> (f32, usize) {
    let (mut most, mut faces) = (0.0f32, 0);
    for (f, x) in a {
        let Some(y) = b.get(f) else { continue };
        faces += 1;
        for (p, q) in x.iter().zip(y) {
            assert_eq!(p.1, q.1);
            most = p.0.iter().zip(&q.0).fold(most, |most, (p, q)| most.max((p - q).abs()));
        }
    }
    (most, faces)
}

#[test]
fn attributes_go_in_small_steps_up_and_down_and_back_on_the_way() {
    for (name, method, placement, taus) in [
        ("torus", Method::Quadric, None, [3.0, 0.5, 6.0]),
        ("quad-sphere", Method::Quadric, Some(Placement::Endpoint), [3.0, 0.5, 6.0]),
        ("cad", Method::Quadric, None, [0.2, 0.01, 2.0]),
        ("cad", Method::Nsa, None, [0.2, 0.01, 2.0]),
    ] {
        let h = hierarchy(name, method, placement);
        let mut leader = View::new(h.clone());
        leader.adapt(&lens(&h, taus[0]), &Limits::default());
        let frames = 400;
        let mut morph = TimedMorph::new(&leader, frames);
        let mut random = Random(5);
        let (mut moved, mut last) = (0.0f32, corners(&morph));
        for k in 0..24 {
            let l = lens(&h, taus[random.below(3)]);
            leader.adapt(&l, &Limits::default());
            let done = morph.follow(&leader, &[l]);
            let now = corners(&morph);
            let (most, faces) = largest_step(&last, &now);
            // Values are within some units of each other, and directions are brought to unit length.
            assert!(most < 12.0 / frames as f32 && faces > 0, "{name}: {most} in frame {k}, {done:?}");
            (moved, last) = (moved.max(most), now);
        }
        assert!(moved > 0.0, "{name}");
    }
}

#[test]
fn at_rest_they_are_those_of_the_mesh_and_half_way_neither() {
    let mut between = 0;
    for (name, taus) in [("torus", [3.0, 0.5, 3.0, 8.0]), ("quad-sphere", [3.0, 0.5, 3.0, 8.0])] {
        let h = hierarchy(name, Method::Quadric, None);
        let mut leader = View::new(h.clone());
        leader.adapt(&lens(&h, taus[0]), &Limits::default());
        let mut morph = TimedMorph::new(&leader, 4);
        for tau in taus {
            let l = lens(&h, tau);
            leader.adapt(&l, &Limits::default());
            let (old, new) = (corners(&morph), own(&leader));
            for frame in 0..4 {
                morph.follow(&leader, &[l]);
                if frame == 1 {
                    let half = corners(&morph);
                    let neither = |f: &u32, k: usize| {
                        let ends = [old.get(f).map(|c| &c[k].0), new.get(f).map(|c| &c[k].0)];
                        !ends.contains(&Some(&half[f][k].0))
                    };
                    between +=
                        half.keys().flat_map(|f| [0, 1, 2].map(|k| neither(f, k))).filter(|n| *n).count();
                    assert_eq!(morph.to_input().corners.len(), 3 * morph.view().face_count());
                }
            }
            assert!(corners(&morph) == new, "{name} at {tau}");
            let (a, b) = (morph.to_input(), leader.to_input());
            assert_eq!((a.positions, a.corners, a.wedges), (b.positions, b.corners, b.wedges));
        }
    }
    assert!(between > 100, "{between}");
}

#[test]
fn what_no_lens_sees_jumps() {
    let h = hierarchy("torus", Method::Quadric, None);
    let mut leader = View::new(h.clone());
    let mut morph = TimedMorph::new(&leader, 50);
    leader.adapt(&lens(&h, 0.5), &Limits::default());
    morph.follow(&leader, &[]);
    assert!(corners(&morph) == own(&leader));
}
