//! Geomorphs: both ends are the two meshes bit for bit, and nothing in between is out of order.

mod common;

use common::{options, with_a_slit};
use progmesh_meshes::{GenerateOptions, generate};
use progmesh_refine::aif::*;
use progmesh_refine::progressive::build;
use progmesh_refine::simplify::{Method, Options, Placement, Quiet};
use progmesh_refine::{Cursor, Geomorph, GeomorphError, ProgressiveMesh};
use proptest::prelude::*;

/// A sample with normals, uvs and everything else a wedge can have, so that each kind of channel is met. Materials make more seams.
fn mesh(name: &str, faces: usize, seed: u64) -> Mesh {
    let s = generate(name, &GenerateOptions::default().with_faces(faces).with_seed(seed)).unwrap();
    let mut input = MeshInput {
        positions: Positions::from_f64(s.positions.clone()),
        face_sizes: s.face_sizes.clone(),
        corners: s.corners.clone(),
        wires: s.wires.clone(),
        face_material: s.face_material.clone(),
        ..Default::default()
    };
    let channel = Channel::new;
    let mut w = Wedges::new(vec![
        channel(Semantic::Normal, 3),
        channel(Semantic::TexCoord(0), 2),
        channel(Semantic::Joints(0), 4),
        channel(Semantic::Weights(0), 4),
        channel(Semantic::Custom("heat".into()), 1),
    ])
    .unwrap();
    let mut known = std::collections::HashMap::new();
    for c in 0..s.corners.len() {
        let v = s.corners[c];
        let normal = s.normals.as_ref().map(|n| (n.corner[c], n.values[n.corner[c] as usize]));
        let uv = s.uvs.as_ref().map(|u| (u.corner[c], u.values[u.corner[c] as usize]));
        let key = (v, normal.map(|n| n.0), uv.map(|u| u.0));
        let id = *known.entry(key).or_insert_with(|| {
            let mut row = normal.map_or([0.0, 0.0, 1.0], |n| n.1).to_vec();
            row.extend(uv.map_or([0.5; 2], |u| u.1));
            row.extend([(v % 3) as f32, 1.0, 2.0, 3.0, 0.25, 0.75, 0.0, 0.0, v as f32]);
            // Some have no heat.
            w.push(&row, if v.is_multiple_of(5) { 0b01111 } else { 0b11111 })
        });
        w.corner.push(id);
    }
    input.wedges = Some(w);
    Mesh::build(input, &BuildOptions::default()).unwrap().0
}

type Corner = ([u64; 3], Option<(u64, Vec<u32>)>);

/// What every face shows: position and attributes of its corners, as bits, with material and group.
fn faces(m: &MeshInput) -> Vec<([Corner; 3], Option<u32>)> {
    let corner = |c: usize| {
        let at = m.positions.get(m.corners[c] as usize).to_array().map(f64::to_bits);
        let wedge = m
            .wedges
            .as_ref()
            .map(|w| (w, w.corner[c]))
            .filter(|w| w.1 != NONE)
            .map(|(w, id)| (w.present(id), w.row(id).iter().map(|x| x.to_bits()).collect()));
        (at, wedge)
    };
    (0..m.corners.len() / 3)
        .map(|f| ([0, 1, 2].map(|k| corner(3 * f + k)), m.face_material.get(f).copied()))
        .collect()
}

/// The faces of a cursor's mesh; at full detail those of the input itself, unless it has polygons.
fn shown(c: &Cursor<&ProgressiveMesh>) -> Vec<([Corner; 3], Option<u32>)> {
    let (plain, pm) = (c.to_input(), c.source());
    let input = c.to_ordered_input();
    if c.position() < pm.splits.len() || input.face_sizes.is_some() {
        return faces(&plain);
    }
    let input = faces(&input);
    pm.order.as_ref().unwrap().face.iter().map(|&f| input[f as usize].clone()).collect()
}

/// The geomorph between two states, of which both ends are the meshes.
fn with_good_ends(pm: &ProgressiveMesh, one: usize, other: usize) -> Geomorph {
    let (low, high) = (one.min(other), one.max(other));
    let (mut coarse, mut fine) = (pm.cursor().unwrap(), pm.cursor().unwrap());
    coarse.seek(low).unwrap();
    fine.seek(high).unwrap();
    let g = Geomorph::between(&fine, &coarse).unwrap();
    let end = g.at(1.0);
    let want = fine.to_input();
    assert_eq!(faces(&end), shown(&fine));
    assert_eq!((end.corners, end.wires, end.face_material), (want.corners, want.wires, want.face_material));

    let begin = g.at(0.0);
    let ancestor = g.vertex_ancestors();
    let proper = |f: usize| {
        let [a, b, c] = [0, 1, 2].map(|k| ancestor[begin.corners[3 * f + k] as usize]);
        a != b && b != c && c != a
    };
    let kept: Vec<usize> = (0..begin.corners.len() / 3).filter(|&f| proper(f)).collect();
    assert_eq!(kept, (0..g.coarse_faces()).collect::<Vec<_>>());
    let have = faces(&begin);
    assert_eq!(kept.iter().map(|&f| have[f].clone()).collect::<Vec<_>>(), shown(&coarse));
    g
}

/// Everything that is guaranteed of a geomorph between two states.
fn check(pm: &ProgressiveMesh, one: usize, other: usize) {
    let g = with_good_ends(pm, one, other);
    // Between: within the box of both ends, coordinate by coordinate; normals of unit length.
    for a in [0.25, 0.5, 0.9] {
        let m = g.at(a);
        let (start, stop) = g.positions();
        for v in 0..m.positions.len() {
            let (p, q, x) = (start.get(v), stop.get(v), m.positions.get(v));
            assert!(x.cmpge(p.min(q)).all() && x.cmple(p.max(q)).all(), "{p} {x} {q}");
        }
        let w = m.wedges.unwrap();
        for i in 0..w.len() as u32 {
            let n: f32 = w.get(i, 0).unwrap().iter().map(|x| x * x).sum();
            assert!((n - 1.0).abs() < 1e-3, "{n}");
            let joints = w.get(i, 2).unwrap();
            assert!(joints.iter().all(|j| j.fract() == 0.0 && (0.0..4.0).contains(j)), "{joints:?}");
            let weights: f32 = w.get(i, 3).unwrap().iter().sum();
            assert!((weights - 1.0).abs() < 1e-5);
        }
    }
}

const NAMES: [&str; 8] =
    ["sphere", "torus", "scan", "terrain", "polygons", "quad-sphere", "cad", "nonmanifold"];

#[test]
fn the_ends_are_the_meshes_by_every_method_on_every_sample() {
    for name in NAMES {
        let mesh = mesh(name, 1500, 3);
        for method in [Method::Quadric, Method::Nsa] {
            let mut o = Options::default();
            o.method = method;
            let pm = build(mesh.clone(), &o, &Quiet).unwrap().mesh;
            let n = pm.splits.len();
            for (a, b) in [(0, n), (n / 4, n / 2), (n, n - 1), (n / 3, n / 3)] {
                check(&pm, a, b);
            }
        }
    }
}

#[test]
fn both_sides_of_a_seam_come_from_the_seam() {
    let pm = build(mesh("quad-sphere", 2000, 1), &Options::default(), &Quiet).unwrap().mesh;
    let (mut coarse, mut fine) = (pm.cursor().unwrap(), pm.cursor().unwrap());
    coarse.seek(pm.splits.len() / 3).unwrap();
    fine.seek(usize::MAX).unwrap();
    let g = Geomorph::between(&coarse, &fine).unwrap();
    let mut on_seam = 0;
    for (w, &from) in (0u32..).zip(g.wedge_ancestors()) {
        assert_ne!(from, NONE);
        // A wedge's ancestor is a wedge of its vertex's ancestor.
        let v = g.vertex_ancestors()[fine.wedge_vertex(w) as usize];
        assert_eq!(coarse.wedge_vertex(from), v);
        on_seam += (w > 0
            && fine.wedge_vertex(w) == fine.wedge_vertex(w - 1)
            && g.wedge_ancestors()[w as usize - 1] != from) as usize;
    }
    assert!(on_seam > 10, "{on_seam}");
}

#[test]
fn a_vertex_in_the_middle_is_half_way() {
    let pm = build(mesh("scan", 800, 2), &Options::default(), &Quiet).unwrap().mesh;
    let g = Geomorph::new(&pm, 0, pm.splits.len()).unwrap();
    let (p, q) = g.positions();
    let half = g.positions_at(0.5);
    for v in 0..half.len() {
        assert!((half.get(v) - (p.get(v) + q.get(v)) / 2.0).length() <= 1e-6 * q.get(v).length().max(1.0));
    }
}

#[test]
fn where_seams_end_corners_begin_with_what_they_have_there() {
    let mut parted = 0;
    for seed in 0..6 {
        for (method, placement) in [
            (Method::Quadric, Placement::Endpoint),
            (Method::Quadric, Placement::Optimal),
            (Method::Nsa, Placement::Midpoint),
        ] {
            let mut o = options(method, Some(placement));
            o.epsilon = (method == Method::Nsa).then_some(60.0);
            let pm = build(with_a_slit(seed), &o, &Quiet).unwrap().mesh;
            let n = pm.splits.len();
            for pm in [pm.sorted_by_error(), Some(pm)].into_iter().flatten() {
                for (from, to) in (0..n).step_by(5).flat_map(|a| (a + 1..n).step_by(17).map(move |b| (a, b)))
                {
                    let g = with_good_ends(&pm, from, to);
                    let mut fine = pm.cursor().unwrap();
                    fine.seek(to).unwrap();
                    assert_eq!(g.wedge_ancestors().len(), g.at(0.0).wedges.unwrap().len());
                    parted += g.wedge_ancestors().len() - fine.wedge_count();
                }
            }
        }
    }
    assert!(parted > 0);
}

#[test]
fn the_full_end_has_the_signs_of_zeros_that_the_input_has() {
    let mut input = mesh("torus", 600, 1).to_input();
    // At some corners a copy of their wedge with another sign of a zero: the same number, which no split tells apart.
    let w = input.wedges.as_mut().unwrap();
    for c in (0..w.corner.len()).step_by(97) {
        let mut row = w.row(w.corner[c]).to_vec();
        let zeros: Vec<usize> = (0..row.len()).filter(|&k| row[k] == 0.0).collect();
        row[*zeros.last().unwrap()] = -0.0;
        let present = w.present(w.corner[c]);
        w.corner[c] = w.push(&row, present);
    }
    let input = Mesh::build(input, &BuildOptions::default()).unwrap().0;
    let pm = build(input, &Options::default(), &Quiet).unwrap().mesh;
    let order = pm.order.as_ref().unwrap();
    assert!(!order.rows.is_empty() || !order.corner_wedges.is_empty());
    let n = pm.splits.len();
    for from in [0, n / 2, n] {
        let g = Geomorph::new(&pm, from, n).unwrap();
        assert_eq!(g.wedge_ancestors().len(), g.at(0.5).wedges.unwrap().len());
        check(&pm, from, n);
    }
}

#[test]
fn all_triangles_of_a_polygon_end_with_the_attributes_of_its_corners() {
    // Faces have corners with normals of their own that differ in the sign of a zero.
    let s = generate("polygons", &GenerateOptions::default().with_faces(600).with_seed(2)).unwrap();
    let mut w = Wedges::new(vec![Channel::new(Semantic::Normal, 3)]).unwrap();
    for (c, &v) in s.corners.iter().enumerate() {
        let zero = if c % 3 == 0 { -0.0 } else { 0.0 };
        w.corner.push(w.len() as u32);
        w.push(&[zero, (v % 5) as f32, 1.0], 1);
    }
    let input = MeshInput {
        positions: Positions::from_f64(s.positions.clone()),
        face_sizes: s.face_sizes.clone(),
        corners: s.corners.clone(),
        wedges: Some(w),
        ..Default::default()
    };
    let mesh = Mesh::build(input, &BuildOptions::default()).unwrap().0;
    let pm = build(mesh, &Options::default(), &Quiet).unwrap().mesh;
    let order = pm.order.as_ref().unwrap();
    assert!(!order.corner_wedges.is_empty() || !order.rows.is_empty());
    let mut cursor = pm.cursor().unwrap();
    cursor.seek(usize::MAX).unwrap();
    let (input, polygons) = (cursor.to_ordered_input(), order.polygons.as_ref().unwrap());
    let shown = |m: &MeshInput, c: usize| {
        let w = m.wedges.as_ref().unwrap();
        let row: Vec<u32> = w.row(w.corner[c]).iter().map(|x| x.to_bits()).collect();
        (m.positions.get(m.corners[c] as usize).to_array().map(f64::to_bits), row)
    };
    let end = Geomorph::new(&pm, pm.splits.len() / 2, usize::MAX).unwrap().at(1.0);
    let mut slot = vec![0; order.face.len()];
    order.face.iter().enumerate().for_each(|(s, &f)| slot[f as usize] = s);
    let (mut at, mut first) = (0, 0);
    for &size in &polygons.sizes {
        let want: Vec<_> = (at..at + size as usize).map(|c| shown(&input, c)).collect();
        let beyond = first + size as usize - 2;
        for &f in &slot[first..beyond] {
            for k in 0..3 {
                assert!(want.contains(&shown(&end, 3 * f + k)), "{f} {k}");
            }
        }
        (at, first) = (at + size as usize, beyond);
    }
    assert_eq!(first, slot.len());
}

#[test]
fn states_of_different_meshes_are_refused() {
    let pm = |seed| build(mesh("scan", 300, seed), &Options::default(), &Quiet).unwrap().mesh;
    let (a, b, c) = (pm(1), pm(2), pm(1));
    let morph = |x: &ProgressiveMesh, y: &ProgressiveMesh| {
        Geomorph::between(&x.cursor().unwrap(), &y.cursor().unwrap()).map(|_| ())
    };
    assert_eq!(morph(&a, &b), Err(GeomorphError::TwoMeshes));
    assert_eq!(morph(&a, &c), Ok(()));
    let mut damaged = a.clone();
    damaged.splits.vertex[5] = u32::MAX;
    assert!(matches!(Geomorph::new(&damaged, 0, 100), Err(GeomorphError::Damage(_))));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_two_states_of_any_mesh(
        name in prop::sample::select(&NAMES[..]),
        seed in 0u64..1000,
        from in 0.0..1.0f64,
        to in 0.0..1.0f64,
        nsa: bool,
    ) {
        let mut o = Options::default();
        o.method = if nsa { Method::Nsa } else { Method::Quadric };
        let pm = build(mesh(name, 400, seed), &o, &Quiet).unwrap().mesh;
        let at = |x: f64| (x * (pm.splits.len() + 1) as f64) as usize;
        check(&pm, at(from), at(to));
    }
}
