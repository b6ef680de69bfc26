//! Truly selective refinement: any order of splits and collapses keeps a mesh, what needs what, the flip guard.

mod common;

use common::{Random, any_camera, assert_same, least_closed, options, progressive, sample};
use glam::{DMat4, DVec3};
use progmesh_refine::aif::*;
use progmesh_refine::hierarchy::{Hierarchy, Options as HierarchyOptions};
use progmesh_refine::progressive::build;
use progmesh_refine::selective::{Cull, Lens, Limits, View};
use progmesh_refine::simplify::{Method, Placement, Quiet};
use progmesh_refine::truly::{TrulyError, TrulyView};
use progmesh_refine::view::{Camera, Projection};
use progmesh_refine::{ProgressiveMesh, aif};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Closed; with handles; bordered; of several components; with seams and materials; by all methods and placements.
const MESHES: [(&str, Method, Option<Placement>); 9] = [
    ("sphere", Method::Quadric, None),
    ("torus", Method::Quadric, Some(Placement::Endpoint)),
    ("scan", Method::Quadric, None),
    ("terrain", Method::Nsa, None),
    ("terrain", Method::Quadric, Some(Placement::Endpoint)),
    ("polygons", Method::Quadric, None),
    ("quad-sphere", Method::Nsa, Some(Placement::Endpoint)),
    ("cad", Method::Quadric, None),
    ("cad", Method::Quadric, Some(Placement::Midpoint)),
];

/// Bounds in no time: most tests look at none.
fn quick() -> HierarchyOptions {
    HierarchyOptions::CUTS.with_rounds(0).with_samples(1)
}

fn hierarchy(name: &str, faces: usize, method: Method, placement: Option<Placement>) -> Arc<Hierarchy> {
    let pm = progressive(name, faces, method, placement);
    Arc::new(Hierarchy::new(Arc::new(pm), &quick()).unwrap())
}

/// Vertices of all faces of the finest mesh, and for each face the split that made it.
struct Finest {
    corners: Vec<[u32; 3]>,
    maker: Vec<Option<usize>>,
}

impl Finest {
    fn new(pm: &ProgressiveMesh) -> Finest {
        let mut c = pm.cursor().unwrap();
        c.seek(usize::MAX).unwrap();
        let corners = c.indices().iter().map(|f| f.map(|w| c.wedge_vertex(w))).collect();
        let mut maker = vec![None; pm.base_faces.len()];
        for (i, code) in pm.splits.code.iter().enumerate() {
            maker.extend(vec![Some(i); 1 + code.two_faces() as usize]);
        }
        Finest { corners, maker }
    }

    /// The faces that there are to be, by number, their corners at active ancestors: found one step after the other.
    fn shown(&self, pm: &ProgressiveMesh, applied: impl Fn(usize) -> bool) -> Vec<(u32, [u32; 3])> {
        let n0 = pm.base_vertices();
        let active = |mut v: u32| {
            while v as usize >= n0 && !applied(v as usize - n0) {
                v = pm.splits.vertex[v as usize - n0];
            }
            v
        };
        let faces = (0..self.corners.len()).filter(|&f| self.maker[f].is_none_or(&applied));
        faces.map(|f| (f as u32, self.corners[f].map(active))).collect()
    }
}

fn faces(view: &TrulyView) -> Vec<(u32, [u32; 3])> {
    let mut all: Vec<_> =
        (0..view.indices().len()).filter_map(|s| Some((view.face_in(s)?, view.indices()[s]))).collect();
    all.sort_unstable();
    all
}

/// Components, Euler number, pieces of the border, edges of one face and of more than two; and no face twice.
fn shape(faces: &[(u32, [u32; 3])]) -> [i64; 4] {
    let mut edges: HashMap<[u32; 2], usize> = HashMap::new();
    let mut known = HashSet::new();
    for (_, f) in faces {
        let mut sorted = *f;
        sorted.sort_unstable();
        assert!(sorted[0] < sorted[1] && sorted[1] < sorted[2], "{f:?}");
        assert!(known.insert(sorted), "{f:?} twice");
        for k in 0..3 {
            let (a, b) = (f[k], f[(k + 1) % 3]);
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let vertices: HashSet<u32> = faces.iter().flat_map(|f| f.1).collect();
    let pieces = |all: &mut dyn Iterator<Item = [u32; 2]>| {
        let mut up: HashMap<u32, u32> = HashMap::new();
        fn top(up: &mut HashMap<u32, u32>, mut v: u32) -> u32 {
            while let Some(&p) = up.get(&v).filter(|p| **p != v) {
                v = p;
            }
            up.insert(v, v);
            v
        }
        for [a, b] in all {
            let (a, b) = (top(&mut up, a), top(&mut up, b));
            up.insert(a, b);
        }
        up.iter().filter(|(v, p)| v == p).count() as i64
    };
    let components = pieces(&mut edges.keys().copied());
    let border = pieces(&mut edges.iter().filter(|e| *e.1 == 1).map(|e| *e.0));
    let complex = edges.values().filter(|n| **n > 2).count() as i64;
    [components, vertices.len() as i64 - edges.len() as i64 + faces.len() as i64, border, complex]
}

fn assert_is_mesh(view: &TrulyView, finest: &Finest, base: [i64; 4], name: &str) {
    let own = faces(view);
    assert_eq!(own, finest.shown(view.hierarchy().mesh(), |i| view.is_applied(i)), "{name}");
    assert_eq!(own.len(), view.face_count());
    assert_eq!(shape(&own), base, "{name}");
    let (mesh, report) = Mesh::build(view.to_input(), &BuildOptions::default()).unwrap();
    mesh.check().unwrap();
    assert!(report.dropped_faces.is_empty() && report.split_faces.is_empty());
}

#[test]
fn any_order_of_splits_and_collapses_keeps_a_mesh() {
    for (name, method, placement) in MESHES {
        let h = hierarchy(name, 700, method, placement);
        let n = h.splits();
        let finest = Finest::new(h.mesh());
        let mut view = TrulyView::new(h.clone()).unwrap();
        let base = shape(&faces(&view));
        assert_eq!(base[3], 0);
        let start = view.to_input();
        let mut random = Random(7);
        let mut counts = [0; 2];
        for step in 0..12_000 {
            let i = random.below(n);
            // Mostly upwards, then mostly downwards.
            let up = (step / 1_500) % 2 == 0;
            if view.may_split(i) && (up || random.below(4) == 0) {
                assert_eq!(view.split(i), 1);
                counts[0] += 1;
            } else if view.may_collapse(i) && (!up || random.below(4) == 0) {
                assert!(view.collapse(i));
                counts[1] += 1;
            }
            if step % 499 == 0 {
                assert_is_mesh(&view, &finest, base, name);
            }
        }
        assert!(counts.iter().all(|&c| c > n / 8), "{name}: {counts:?} of {n}");
        // Everything, in any order, is the input; nothing is the base.
        let mut order: Vec<usize> = (0..n).collect();
        (1..n).rev().for_each(|k| order.swap(k, random.below(k + 1)));
        for &i in &order {
            let needs: Vec<usize> = view.dependencies(i).collect();
            view.split(i);
            assert!(view.is_applied(i) && needs.iter().all(|&d| view.is_applied(d)));
        }
        let mut full = h.mesh().cursor().unwrap();
        full.seek(usize::MAX).unwrap();
        assert_same(&view.to_input(), &full.to_ordered_input());
        assert_is_mesh(&view, &finest, base, name);
        let mut left = order;
        while !left.is_empty() {
            let before = left.len();
            left.retain(|&i| !view.collapse(i));
            assert!(left.len() < before, "{name}: {before} left");
        }
        assert_same(&view.to_input(), &start);
        assert_eq!(view.vertex_count(), h.mesh().base_vertices());
    }
}

/// What the rules of the hierarchy allow is allowed, and is the same mesh, attributes and all.
#[test]
fn sets_by_the_hierarchy_s_own_rule_make_the_same_mesh() {
    let attributes = |m: &aif::MeshInput| -> Vec<(Vec<u32>, u64)> {
        let Some(w) = &m.wedges else { return Vec::new() };
        let row = |&c: &u32| match c {
            NONE => (Vec::new(), 0),
            c => (w.row(c).iter().map(|x| x.to_bits()).collect(), w.present(c)),
        };
        w.corner.iter().map(row).collect()
    };
    for (name, method, placement) in MESHES {
        let h = hierarchy(name, 900, method, placement);
        let mut random = Random(23);
        let (mut view, mut other) = (TrulyView::new(h.clone()).unwrap(), View::new(h.clone()));
        for round in 0..5 {
            for _ in 0..4 {
                other.split(random.below(h.splits()));
            }
            for i in other.applied() {
                assert!(view.dependencies(i).all(|d| other.is_applied(d)), "{name}: split {i}");
                view.split(i);
            }
            let (a, b) = (view.to_input(), other.to_input());
            assert_eq!((&a.positions, &a.corners), (&b.positions, &b.corners), "{name} {round}");
            assert_eq!(
                (&a.face_material, &a.face_group, &a.wires),
                (&b.face_material, &b.face_group, &b.wires)
            );
            assert_eq!(attributes(&a), attributes(&b), "{name} {round}");
        }
    }
}

fn camera(h: &Hierarchy, random: &mut Random, distance: f64) -> Camera {
    any_camera(h, random, distance, Projection::Perspective { fov_y_deg: 40.0 })
}

#[test]
fn without_the_guard_the_set_depends_on_the_view_alone_and_is_the_least() {
    for (name, method, placement) in [MESHES[2], MESHES[4], MESHES[7]] {
        let h = hierarchy(name, 1_500, method, placement);
        let mut view = TrulyView::new(h.clone()).unwrap();
        view.set_guard(false);
        let mut by_cuts = View::new(h.clone());
        let mut random = Random(17);
        let (mut own, mut cuts) = (0, 0);
        for round in 0..10 {
            let c = camera(&h, &mut random, [0.4, 0.8, 2.0][round % 3]);
            let cull = [Cull::None, Cull::Frustum, Cull::Cone, Cull::All][round % 4];
            let lens = Lens::new(&h, &c, &DMat4::IDENTITY, [0.3, 1.0, 4.0][random.below(3)], cull).unwrap();
            assert!(view.adapt(&lens, &Limits::default()).complete);
            let want = least_closed(&h, &lens, |i| view.dependencies(i));
            let have: Vec<bool> = (0..h.splits()).map(|i| view.is_applied(i)).collect();
            assert_eq!(have, want, "{name} {round}");
            let again = view.adapt(&lens, &Limits::default());
            assert_eq!((again.splits, again.collapses), (0, 0));
            by_cuts.adapt(&lens, &Limits::default());
            own += view.face_count();
            cuts += by_cuts.face_count();
        }
        assert!(own < cuts, "{name}: {own} {cuts}");
    }
}

#[test]
fn limits_hold() {
    let h = hierarchy("scan", 3_000, Method::Quadric, None);
    let c = camera(&h, &mut Random(5), 0.7);
    let lens = Lens::new(&h, &c, &DMat4::IDENTITY, 0.3, Cull::All).unwrap();
    let mut whole = TrulyView::new(h.clone()).unwrap();
    let all = whole.adapt(&lens, &Limits::default());
    for guard in [false, true] {
        let mut view = whole.beside();
        view.set_guard(guard);
        let most = view.face_count() + all.splits / 2;
        let done = view.adapt(&lens, &Limits { faces: most, ..Limits::default() });
        assert!(view.face_count() <= most && view.face_count() + 64 > most && done.refused > 0, "{done:?}");
    }
    let mut view = whole.beside();
    view.set_guard(false);
    let mut frames = 0;
    while !view.adapt(&lens, &Limits { operations: 50, ..Limits::default() }).complete {
        frames += 1;
        assert!(frames < 200);
    }
    assert!(frames > 3);
    let expired = || true;
    let done = view.adapt(&lens, &Limits { expired: Some(&expired), ..Limits::default() });
    assert!(!done.complete && done.splits == 0);
}

/// Faces of a terrain that look down.
fn turned_over(view: &TrulyView, up: DVec3) -> usize {
    let at = |v: u32| view.position(v).unwrap();
    let normal = |f: &[u32; 3]| (at(f[1]) - at(f[0])).cross(at(f[2]) - at(f[0]));
    faces(view).iter().filter(|(_, f)| normal(f).dot(up) < 0.0).count()
}

#[test]
fn the_guard_keeps_faces_from_folding_over() {
    let h = hierarchy("terrain", 4_000, Method::Quadric, None);
    let mut guarded = TrulyView::new(h.clone()).unwrap();
    let mut free = guarded.beside();
    free.set_guard(false);
    (0..h.splits()).for_each(|i| {
        free.split(i);
    });
    let up = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().find(|&a| turned_over(&free, a) == 0).unwrap();
    let mut random = Random(29);
    let mut counts = [0; 2];
    let (mut deferred, mut through, mut turned) = (0, 0, 0);
    for round in 0..24 {
        let c = camera(&h, &mut random, [0.3, 0.6, 1.5][round % 3]);
        let lens = Lens::new(&h, &c, &DMat4::IDENTITY, [0.5, 2.0, 8.0][random.below(3)], Cull::All).unwrap();
        for (k, view) in [&mut guarded, &mut free].into_iter().enumerate() {
            view.adapt(&lens, &Limits::default());
            counts[k] += turned_over(view, up);
        }
        // What the lens needs is there.
        assert!((0..h.splits()).all(|i| !lens.needs(&h, i) || guarded.is_applied(i)));
        let g = guarded.guarded();
        (deferred, through, turned) = (deferred + g.deferred, through + g.through, turned + g.turned);
        assert_eq!(free.guarded(), Default::default());
    }
    eprintln!(
        "{deferred} {through} {turned} {counts:?} faces {} {}",
        guarded.face_count(),
        free.face_count()
    );
    assert!(deferred > 0 && through > 0, "{deferred} {through} {turned}");
    assert!(counts[0] * 2 < counts[1], "{counts:?}, {turned} turned");
    // Nothing to see: the base, whatever that turns.
    guarded.adapt_to_all(&[], &Limits::default());
    assert_eq!(guarded.vertex_count(), h.mesh().base_vertices());
}

#[test]
fn edges_of_three_faces_are_refused_and_vertices_of_several_fans_are_not() {
    let pm = build(sample("nonmanifold", 700, 5), &options(Method::Quadric, None), &Quiet).unwrap().mesh;
    let h = Arc::new(Hierarchy::new(Arc::new(pm), &quick()).unwrap());
    assert!(matches!(TrulyView::new(h), Err(TrulyError::Edge(_, _, n)) if n > 2));
    // Two spheres that share a vertex.
    let one = sample("sphere", 320, 5);
    let mut input = one.to_input();
    let (count, corners) = (input.positions.len() as u32, input.corners.clone());
    let top = input.positions.get(0);
    let places: Vec<DVec3> = (0..count as usize).map(|v| input.positions.get(v)).collect();
    let mirrored = places.iter().skip(1).map(|p| 2.0 * top - *p);
    let all: Vec<[f64; 3]> = places.iter().copied().chain(mirrored).map(|p| p.to_array()).collect();
    input.positions = Positions::from_f64(all);
    // Through a point, so the other way round.
    for t in corners.chunks_exact(3) {
        let other = |v: u32| if v == 0 { 0 } else { v + count - 1 };
        input.corners.extend([t[0], t[2], t[1]].map(other));
    }
    assert!(input.face_sizes.is_none());
    let mesh = Mesh::build(input, &BuildOptions::default()).unwrap().0;
    let pm = build(mesh, &options(Method::Quadric, None), &Quiet).unwrap().mesh;
    let h = Arc::new(Hierarchy::new(Arc::new(pm), &quick()).unwrap());
    let finest = Finest::new(h.mesh());
    let mut view = TrulyView::new(h.clone()).unwrap();
    let base = shape(&faces(&view));
    let mut random = Random(3);
    for step in 0..4_000 {
        let i = random.below(h.splits());
        if view.may_split(i) {
            view.split(i);
        } else {
            view.collapse(i);
        }
        if step % 400 == 0 {
            assert_is_mesh(&view, &finest, base, "two spheres");
        }
    }
}
