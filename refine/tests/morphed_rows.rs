//! Attributes of a view morph with its vertices, and end where they belong.

mod common;

use common::{Random, any_camera, progressive};
use glam::DMat4;
use progmesh_refine::aif::Semantic;
use progmesh_refine::hierarchy::{Hierarchy, Options};
use progmesh_refine::progressive::SplitKind;
use progmesh_refine::selective::{Cull, Lens, Limits, View};
use progmesh_refine::simplify::{Method, Placement};
use progmesh_refine::view::Projection;
use std::sync::Arc;

const BAND: f64 = 2.0;

fn view(name: &str, method: Method, placement: Option<Placement>, tau: f64) -> (View, Lens) {
    let pm = progressive(name, 1500, method, placement);
    let h = Arc::new(Hierarchy::new(Arc::new(pm), &Options::RINGS.with_samples(12)).unwrap());
    let camera = any_camera(&h, &mut Random(19), 1.0, Projection::Perspective { fov_y_deg: 40.0 });
    let lens = Lens::new(&h, &camera, &DMat4::IDENTITY, tau, Cull::All).unwrap();
    let mut view = View::new(h);
    assert!(view.adapt(&lens, &Limits::default()).complete);
    (view, lens)
}

#[test]
fn what_is_undone_at_its_tolerance_changes_no_corner() {
    let mut kinds = [0; 3];
    let mut between = 0;
    for (name, method, placement, tau) in [
        ("torus", Method::Quadric, None, 2.0),
        ("quad-sphere", Method::Quadric, Some(Placement::Endpoint), 2.0),
        ("cad", Method::Quadric, None, 0.02),
        ("cad", Method::Nsa, None, 0.02),
    ] {
        let (view, lens) = view(name, method, placement, tau);
        let h = view.hierarchy().clone();
        let normals = h.mesh().wedges.as_ref().unwrap().channels[0].semantic == Semantic::Normal;
        for i in (0..h.splits()).filter(|&i| view.may_collapse(i)) {
            let just = lens.with_tau(lens.pixels(&h, &h.bounds(i)) * (1.0 + 1e-9)).unwrap();
            let lenses = [just];
            let mut without = view.clone();
            assert!(without.collapse(i));
            // The faces around the old vertex, in both.
            let [vs, vu] = [h.mesh().splits.vertex[i], (h.mesh().base_vertices() + i) as u32];
            for slot in 0..view.indices().len() {
                let Some(there) = view.face_in(slot).and_then(|f| without.slot_of(f)) else { continue };
                let corners = view.indices()[slot];
                if !corners.iter().any(|&w| [vs, vu].contains(&view.wedge_vertex(w))) {
                    continue;
                }
                for (a, b) in corners.into_iter().zip(without.indices()[there]) {
                    let (x, y) = (view.morphed_row(&lenses, a, BAND), without.morphed_row(&lenses, b, BAND));
                    assert!(x.is_some() && x == y, "{name}: split {i}, wedges {a} and {b}: {x:?} {y:?}");
                    let (row, own) = (x.unwrap().0, view.row(a).0);
                    between += (row != *own && row != *without.row(b).0) as usize;
                    let length = row[..3].iter().map(|x| x * x).sum::<f32>().sqrt();
                    assert!(!normals || (length - 1.0).abs() < 1e-4, "{row:?}");
                }
            }
            kinds[match h.mesh().splits.code[i].kind() {
                SplitKind::Plain => 0,
                SplitKind::Seam => 1,
                SplitKind::Explicit => 2,
            }] += 1;
        }
    }
    assert!(kinds[..2].iter().all(|&k| k > 5) && between > 100, "{kinds:?} {between}");
}

#[test]
fn what_has_moved_wholly_has_its_own_rows() {
    let (view, lens) = view("torus", Method::Quadric, None, 2.0);
    let all = [lens.with_tau(0.0).unwrap()];
    let (a, b) = (view.to_input_morphed(&all, BAND), view.to_input());
    assert_eq!((&a.positions, &a.corners, &a.wedges), (&b.positions, &b.corners, &b.wedges));
    let some = [lens];
    let c = view.to_input_morphed(&some, BAND);
    let (x, y) = (c.wedges.unwrap(), b.wedges.unwrap());
    assert!(x.corner == y.corner && c.corners == b.corners && x != y);
    assert!(view.morphed_row(&some, h_wedges(&view) - 1, BAND).is_none());
    // Without attributes there are none.
    let pm = progressive("scan", 500, Method::Quadric, None);
    let plain = View::new(Arc::new(Hierarchy::new(Arc::new(pm), &Options::RINGS.with_samples(12)).unwrap()));
    assert!(plain.morphed_row(&some, 0, BAND).is_none());
}

/// Wedges at full detail.
fn h_wedges(view: &View) -> u32 {
    view.hierarchy().mesh().wedge_slots() as u32
}
