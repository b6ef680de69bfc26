//! Levels up and down: every state is what it was, however it is reached.

mod common;

use common::{NAMES, sample};
use progmesh_refine::History;
use progmesh_refine::aif::*;
use progmesh_refine::simplify::{Control, Method, Options, Placement, Quiet, SimplifyError, Stop, simplify};
use proptest::prelude::*;

/// All that the mesh holds, orders included, removed elements left out.
fn everything(m: &Mesh) -> String {
    let t = m.topology();
    let stars: Vec<_> = t.vertices().map(|v| (v, t.star(v), m.positions().bits(v.index()))).collect();
    let edges: Vec<_> = t.edges().map(|e| (e, t.edge_vertices(e), t.edge_faces(e))).collect();
    let faces: Vec<_> = t.faces().map(|f| (f, t.face_edges(f), m.material(f), m.group(f))).collect();
    let wedge = |w: &Wedges, c: u32| (c != NONE).then(|| (c, w.present(c), format!("{:?}", w.row(c))));
    let corners: Vec<_> = m
        .wedges()
        .iter()
        .flat_map(|w| t.faces().flat_map(|f| w.corner[t.corner_range(f)].to_vec()).map(|c| wedge(w, c)))
        .collect();
    format!("{stars:?} {edges:?} {faces:?} {corners:?}")
}

fn any_mesh() -> impl Strategy<Value = (&'static str, Mesh)> {
    (prop::sample::select(NAMES.to_vec()), 20usize..400, 0u64..1000)
        .prop_map(|(n, f, s)| (n, sample(n, f, s)))
}

#[test]
fn every_kind_of_mesh_comes_back_bit_for_bit() {
    for name in NAMES {
        let input = sample(name, 3000, 1);
        let mut h = History::nsa(input.clone(), &Options::default(), &Quiet).unwrap();
        assert!(h.levels().len() > 1, "{name}");
        let coarsest = everything(h.mesh());
        assert_ne!(coarsest, everything(&input));
        h.set_level(0);
        assert_eq!(everything(h.mesh()), everything(&input), "{name}");
        assert_eq!((h.mesh().positions(), h.mesh().wedges()), (input.positions(), input.wedges()), "{name}");
        assert_eq!(h.mesh().check(), Ok(()));
        h.set_level(usize::MAX);
        assert_eq!(everything(h.mesh()), coarsest, "{name}");
    }
}

#[test]
fn levels_are_the_passes_and_what_plain_simplification_gives() {
    for name in ["scan", "polygons", "quad-sphere"] {
        let input = sample(name, 4000, 2);
        let mut h = History::nsa(input.clone(), &Options::default(), &Quiet).unwrap();
        assert_eq!((h.stop(), h.level()), (Stop::NoLegalCollapse, h.levels().len() - 1));
        for level in (0..h.levels().len()).rev() {
            assert_eq!((h.level(), h.mesh().face_count()), (level, h.levels()[level].faces), "{name}");
            let mut plain = input.clone();
            let mut o = Options::default();
            (o.method, o.passes) = (Method::Nsa, Some(level));
            let out = simplify(&mut plain, &o, &Quiet).unwrap();
            assert_eq!(out.faces_out, h.mesh().face_count());
            let here = h.mesh().clone().compact(CompactOptions::with_drop_isolated(true)).0;
            // Level 0 is the input with its own wedges; elsewhere they were parted at seams.
            assert_eq!(here.positions(), plain.positions(), "{name} {level}");
            assert_eq!(here.to_input().corners, plain.to_input().corners, "{name} {level}");
            if level > 0 {
                assert_eq!(here.wedges(), plain.wedges(), "{name} {level}");
            }
            assert_eq!(h.refine(), level > 0);
        }
        assert!(h.coarsen() && h.level() == 1);
    }
}

#[test]
fn a_face_count_is_met_from_below() {
    let mut h = History::nsa(sample("torus", 2000, 0), &Options::default(), &Quiet).unwrap();
    let (most, least) = (h.levels()[0].faces, h.levels().last().unwrap().faces);
    for faces in [most, most - 1, 1234, 777, least + 1, least, most + 5, 1000] {
        h.set_faces(faces);
        let got = h.mesh().face_count();
        assert!(got <= faces && got + 2 > faces.min(most), "{faces}: {got}");
    }
    h.set_faces(0);
    assert_eq!((h.mesh().face_count(), h.position()), (least, h.steps()));
    assert!(h.record_bytes() <= 110 * h.steps() + 200 * most, "{}", h.record_bytes());
}

#[test]
fn a_record_is_flat_and_small() {
    let mut mesh = sample("sphere", 5000, 0);
    *mesh.wedges_mut() = None;
    let h = History::nsa(mesh, &Options::default(), &Quiet).unwrap();
    assert!(h.steps() > 1000 && h.record_bytes() <= 104 * h.steps(), "{}", h.record_bytes() / h.steps());
}

#[test]
fn hand_made_collapses_forget_what_was_undone() {
    let mut h = History::nsa(sample("quad-sphere", 600, 0), &Options::default(), &Quiet).unwrap();
    let input = sample("quad-sphere", 600, 0);
    h.set_level(1);
    let (at_one, steps) = (everything(h.mesh()), h.position());
    let mut marks = Marks::default();
    let t = h.mesh().topology();
    let e = t.edges().find(|&e| t.link_condition(e, t.edge_vertices(e)[0], &mut marks).is_ok()).unwrap();
    let kept = t.edge_vertices(e)[0];
    let to = h.mesh().position(kept) * 0.5;
    h.collapse(e, kept, to, &mut marks).unwrap();
    h.mark_level();
    assert_eq!((h.steps(), h.levels().len(), h.level()), (steps + 1, 3, 2));
    assert!(h.refine());
    assert_eq!(everything(h.mesh()), at_one);
    // From full detail, on the input's own wedges.
    h.set_level(0);
    let kept = h.mesh().topology().edge_vertices(EdgeId(0))[0];
    h.collapse(EdgeId(0), kept, to, &mut marks).unwrap();
    assert_eq!((h.steps(), h.levels().len()), (1, 1));
    h.set_position(0);
    assert_eq!(everything(h.mesh()), everything(&input));
    assert_eq!(h.mesh().wedges(), input.wedges());
}

#[test]
fn bad_options_are_told_and_trivial_meshes_have_one_level() {
    let mut o = Options::default();
    o.epsilon = Some(f64::NAN);
    let e = History::nsa(sample("sphere", 80, 0), &o, &Quiet).unwrap_err();
    assert!(matches!(e, SimplifyError::Range { .. }));
    for mesh in [Mesh::default(), sample("single-triangle", 1, 0)] {
        let mut h = History::nsa(mesh, &Options::default(), &Quiet).unwrap();
        assert_eq!((h.levels().len(), h.coarsen(), h.refine()), (1, false, false));
    }
}

struct StopAtOnce;

impl Control for StopAtOnce {
    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
fn a_cancelled_run_can_be_undone_too() {
    let input = sample("scan", 20_000, 0);
    let mut h = History::nsa(input.clone(), &Options::default(), &StopAtOnce).unwrap();
    assert_eq!(h.stop(), Stop::Cancelled);
    h.set_level(0);
    assert_eq!(everything(h.mesh()), everything(&input));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn walks_meet_the_same_states(
        (name, input) in any_mesh(),
        epsilon in 5.0f64..90.0,
        placement in prop::sample::select(vec![Placement::Midpoint, Placement::Endpoint, Placement::Optimal]),
        walk in prop::collection::vec(any::<prop::sample::Index>(), 1..12),
    ) {
        let mut o = Options::default();
        (o.epsilon, o.placement) = (Some(epsilon), Some(placement));
        let mut h = History::nsa(input.clone(), &o, &Quiet).unwrap();
        let mut seen = std::collections::HashMap::from([(0, everything(&input))]);
        for to in walk {
            h.set_position(to.index(h.steps() + 1));
            prop_assert_eq!(h.mesh().check(), Ok(()));
            let here = everything(h.mesh());
            let before = seen.entry(h.position()).or_insert_with(|| here.clone());
            prop_assert_eq!(&*before, &here, "{} at {}", name, h.position());
        }
        // One by one to the bottom and back up, every state again.
        h.set_position(0);
        prop_assert_eq!(&everything(h.mesh()), &seen[&0]);
        for p in 0..=h.steps() {
            h.set_position(p);
            if let Some(before) = seen.get(&p) {
                prop_assert_eq!(before, &everything(h.mesh()), "{} at {}", name, p);
            }
        }
    }

    #[test]
    fn any_collapses_can_be_recorded(
        (_, input) in any_mesh(),
        picks in prop::collection::vec((any::<prop::sample::Index>(), any::<bool>()), 1..60),
    ) {
        let mut h = History::new(input);
        let mut marks = Marks::default();
        let mut states = vec![everything(h.mesh())];
        for (pick, end) in picks {
            let live: Vec<EdgeId> = h.mesh().topology().edges().collect();
            if live.is_empty() {
                break;
            }
            let e = live[pick.index(live.len())];
            let kept = h.mesh().topology().edge_vertices(e)[end as usize];
            let to = h.mesh().position(kept) + glam::DVec3::splat(0.125);
            if h.collapse(e, kept, to, &mut marks).is_ok() {
                states.push(everything(h.mesh()));
            }
        }
        for p in (0..states.len()).rev().chain(0..states.len()) {
            h.set_position(p);
            prop_assert_eq!(&everything(h.mesh()), &states[p]);
        }
    }
}
