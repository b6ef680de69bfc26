//! Views on several threads: to the last slot what they are on one.

mod common;

use common::{options, sample};
use glam::{DMat4, DVec3};
use progmesh_refine::hierarchy::{self, Hierarchy};
use progmesh_refine::progressive::build;
use progmesh_refine::selective::{Changes, Cull, Done, Lens, Limits, View};
use progmesh_refine::simplify::{Method, Quiet};
use progmesh_refine::view::{Camera, CameraParameters, Projection};
use std::sync::Arc;

/// What a frame did, what it shows, and what is to upload.
type Frame = (Done, Vec<[u32; 3]>, Changes);

fn flight(h: &Arc<Hierarchy>) -> Vec<Frame> {
    let (centre, diagonal) = h.extent();
    let mut view = View::new(h.clone());
    let frames = (0..8).map(|k| {
        let turn = 0.5 * k as f64;
        let camera = Camera::new(&CameraParameters {
            eye: centre + 0.7 * diagonal * DVec3::new(turn.cos(), turn.sin(), 0.2),
            target: centre,
            up: DVec3::Z,
            projection: Projection::Perspective { fov_y_deg: 45.0 },
            width: 1920,
            height: 1080,
            near: 1e-3 * diagonal,
            far: 1e3 * diagonal,
        })
        .unwrap();
        let tau = [0.0, 0.3, 1.0, 0.1][k % 4];
        let cull = if k == 0 { Cull::None } else { Cull::All };
        let lens = Lens::new(h, &camera, &DMat4::IDENTITY, tau, cull).unwrap();
        let limits = match k {
            5 => Limits { operations: 700, ..Limits::default() },
            6 => Limits { faces: 9000, hysteresis: 0.8, ..Limits::default() },
            _ => Limits::default(),
        };
        let done = view.adapt(&lens, &limits);
        (done, view.indices().to_vec(), view.take_changes())
    });
    frames.collect()
}

#[test]
fn a_flight_is_the_same_on_one_two_and_five_threads() {
    let pm = build(sample("scan", 36_000, 5), &options(Method::Quadric, None), &Quiet).unwrap().mesh;
    let o = hierarchy::Options::RINGS.with_samples(12);
    let h = Arc::new(Hierarchy::new(Arc::new(pm), &o).unwrap());
    let with =
        |n: usize| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| flight(&h));
    let one = with(1);
    // So many that the lists are long: all there is, and then most of it undone.
    assert!(one[0].0.splits > 15_000 && one[1].0.collapses > 3000, "{:?} {:?}", one[0].0, one[1].0);
    for n in [2, 5] {
        for (k, (a, b)) in one.iter().zip(with(n)).enumerate() {
            assert!(*a == b, "frame {k} on {n} threads: {:?} {:?}", a.0, b.0);
        }
    }
}
