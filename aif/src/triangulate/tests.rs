use super::*;

fn cut(p: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let p: Vec<DVec3> = p.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect();
    let mut out = Vec::new();
    triangulate_polygon(&p, &mut out);
    assert_eq!(out.len(), p.len().saturating_sub(2));
    out
}

fn area2(p: &[[f64; 2]], t: &[u32]) -> f64 {
    (0..t.len())
        .map(|i| {
            let (a, b) = (p[t[i] as usize], p[t[(i + 1) % t.len()] as usize]);
            a[0] * b[1] - a[1] * b[0]
        })
        .sum()
}

/// No triangle turned over, and the areas add up: together that is a tiling.
fn assert_tiles(p: &[[f64; 2]]) {
    let all: Vec<u32> = (0..p.len() as u32).collect();
    let want = area2(p, &all);
    let parts: Vec<f64> = cut(p).iter().map(|t| area2(p, t) * want.signum()).collect();
    assert!(parts.iter().all(|&a| a >= 0.0), "{p:?}: {parts:?}");
    let sum: f64 = parts.iter().sum();
    assert!((sum - want.abs()).abs() <= 1e-9 * want.abs(), "{p:?}: {sum} of {want}");
}

#[test]
fn concave_polygons_are_tiled() {
    // L, comb, arrow, spiral, and each of them clockwise and from every first corner.
    let shapes: [&[[f64; 2]]; 4] = [
        &[[0., 0.], [2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.]],
        &[
            [0., 0.],
            [5., 0.],
            [5., 3.],
            [4., 3.],
            [4., 1.],
            [3., 1.],
            [3., 3.],
            [2., 3.],
            [2., 1.],
            [1., 1.],
            [1., 3.],
            [0., 3.],
        ],
        &[[0., 0.], [4., 2.], [0., 4.], [1., 2.]],
        &[
            [0., 0.],
            [6., 0.],
            [6., 6.],
            [1., 6.],
            [1., 2.],
            [4., 2.],
            [4., 4.],
            [3., 4.],
            [3., 3.],
            [2., 3.],
            [2., 5.],
            [5., 5.],
            [5., 1.],
            [0., 1.],
        ],
    ];
    for shape in shapes {
        let mut p = shape.to_vec();
        for _ in 0..2 {
            p.reverse();
            for _ in 0..p.len() {
                p.rotate_left(1);
                assert_tiles(&p);
            }
        }
    }
}

#[test]
fn a_slit_to_a_hole_is_tiled() {
    // A square with a square hole, joined by a slit whose two sides coincide.
    let p =
        [[0., 0.], [4., 0.], [4., 4.], [0., 4.], [0., 0.], [1., 1.], [1., 3.], [3., 3.], [3., 1.], [1., 1.]];
    assert_tiles(&p);
    assert_eq!(area2(&p, &(0..10).collect::<Vec<_>>()), 24.0);
}

#[test]
fn points_on_a_side_are_joined_to_the_far_corner() {
    // 0--1--2 straight: a cut exists without a triangle of no area.
    let p = [[0., 0.], [1., 0.], [2., 0.], [1., 2.]];
    assert!(cut(&p).iter().all(|t| area2(&p, t) > 0.0));
    let p = [[0., 0.], [1., 0.], [2., 0.], [3., 0.], [3., 3.], [2., 2.], [1., 1.]];
    assert!(cut(&p).iter().all(|t| area2(&p, t) > 0.0), "{:?}", cut(&p));
}

#[test]
fn a_quadrilateral_takes_the_better_diagonal() {
    // Concave at 1: only the diagonal 1-3 turns nothing over.
    assert_eq!(cut(&[[0., 0.], [2., 1.], [4., 0.], [2., 4.]]), [[0, 1, 3], [1, 2, 3]]);
    // Concave at 0: only 0-2.
    assert_eq!(cut(&[[2., 1.], [4., 0.], [2., 4.], [0., 0.]]), [[0, 1, 2], [0, 2, 3]]);
    // A long rhombus: the short diagonal.
    assert_eq!(cut(&[[0., 0.], [3., -1.], [6., 0.], [3., 1.]]), [[0, 1, 3], [1, 2, 3]]);
    // A square: the first diagonal, under any rounding of its corners.
    assert_eq!(cut(&[[0., 0.], [0.1, 0.], [0.1, 0.1], [0., 0.1]]), [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn exact_signs_decide_where_rounding_would_not() {
    // Corner 2 lies within an ulp of the line 1-3, on the inner side.
    let d = f64::EPSILON;
    let p = [[0., 0.], [1., 0.], [0.5 + 0.25 * d, 0.5 + 0.25 * d], [0., 1.]];
    assert_tiles(&p);
    let p = [[0., 0.], [1., 0.], [0.5 - d, 0.5], [0., 1.]];
    assert_eq!(cut(&p), [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn hopeless_polygons_still_get_their_triangles() {
    let nan = f64::NAN;
    let hopeless: [&[[f64; 2]]; 7] = [
        &[[0., 0.]; 9],
        &[[0., 0.], [1., 1.], [2., 2.], [3., 3.], [1., 1.], [5., 5.]],
        &[[0., 0.], [1., 1.], [1., 0.], [0., 1.], [3., 3.]],
        &[[0., 1.], [0.6, -0.8], [-0.9, 0.3], [0.9, 0.3], [-0.6, -0.8]],
        &[[nan, 0.], [1., nan], [1., 1.], [0., 1.], [0., 0.]],
        &[[0., 0.], [1e300, 0.], [1e300, 1e300], [-1e300, 1e300], [0., 1e-300]],
        &[[f64::INFINITY, 0.], [1., 0.], [f64::NEG_INFINITY, 1.], [0., 1.], [0., 0.]],
    ];
    for p in hopeless {
        let triangles = cut(p);
        // Every side of the polygon is on one triangle, every diagonal on two.
        let n = p.len() as u32;
        let mut sides = std::collections::BTreeMap::new();
        for t in triangles {
            for i in 0..3 {
                let (a, b) = (t[i], t[(i + 1) % 3]);
                *sides.entry((a.min(b), a.max(b))).or_insert(0) += 1;
            }
        }
        for ((a, b), count) in sides {
            let side = b - a == 1 || b - a == n - 1;
            assert_eq!(count, if side { 1 } else { 2 }, "{p:?} {a} {b}");
        }
    }
}

fn ring(n: usize, radius: impl Fn(usize) -> f64) -> Vec<[f64; 2]> {
    (0..n)
        .map(|i| {
            let (s, c) = (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
            [c * radius(i), s * radius(i)]
        })
        .collect()
}

#[test]
fn a_hundred_thousand_corners_are_cut_at_once() {
    let convex = ring(100_000, |_| 1.0);
    assert_tiles(&convex);
    // Evenly, not as a fan: no vertex is on more than a logarithmic number of triangles.
    let mut valence = vec![0; convex.len()];
    cut(&convex).as_flattened().iter().for_each(|&v| valence[v as usize] += 1);
    assert!(valence.iter().all(|&n| n < 50));
    assert_tiles(&ring(100_000, |i| 1.0 + (i % 2) as f64));
    assert_tiles(&ring(100_000, |i| 1.0 + (i * 7919 % 100) as f64 * 0.01));
    cut(&ring(20_000, |i| if i % 3 == 0 { -1.0 } else { 1.0 }));
    cut(&vec![[0.0, 0.0]; 100_000]);
    cut(&(0..100_000).map(|i| [i as f64, i as f64]).collect::<Vec<_>>());
}

#[test]
fn a_polygon_in_space_keeps_its_direction() {
    // The L in the plane x = 7, seen from either side.
    let l = [[0., 0.], [2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.]];
    for flip in [false, true] {
        let mut p: Vec<DVec3> = l.iter().map(|&[y, z]| DVec3::new(7.0, y, z)).collect();
        if flip {
            p.reverse();
        }
        let mut out = Vec::new();
        triangulate_polygon(&p, &mut out);
        let normals = out.iter().map(|t| {
            let [a, b, c] = t.map(|i| p[i as usize]);
            (b - a).cross(c - a).x
        });
        let sum: f64 = normals.inspect(|x| assert!((*x < 0.0) == flip)).sum();
        assert_eq!(sum, if flip { -6.0 } else { 6.0 });
    }
}

#[test]
fn a_mesh_keeps_order_and_attributes() {
    use crate::attributes::{Channel, Semantic, Wedges};
    let p = vec![
        [0.0, 0.0, 0.0f32],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.5, 2.0, 0.0],
        [9.0; 3],
    ];
    let mut input = MeshInput::polygons(p, &[3, 4], &[3, 2, 4, 0, 1, 2, 3]);
    input.wires = vec![[4, 5]];
    input.face_material = vec![5, 6];
    let mut w = Wedges::new(vec![Channel::new(Semantic::Custom("id".into()), 1)]).unwrap();
    (0..7).for_each(|i| {
        w.push(&[i as f32], 1);
    });
    w.corner = (0..7).collect();
    input.wedges = Some(w);
    let mesh = Mesh::build(input, &Default::default()).unwrap().0;
    let done = mesh.triangulate().unwrap();
    assert_eq!(done.mesh.check(), Ok(()));
    assert_eq!(done.mesh.triangles(), [[3, 2, 4], [0, 1, 2], [0, 2, 3]]);
    assert_eq!(done.face_map, Some(vec![0, 1, 1]));
    assert_eq!(done.cut, 1);
    assert_eq!(done.mesh.face_materials(), [5, 6, 6]);
    assert_eq!(done.mesh.wedges().unwrap().corner, [0, 1, 2, 3, 4, 5, 3, 5, 6]);
    assert_eq!(done.mesh.topology().edge_count(), 6 + 1 + 1);
    let again = done.mesh.triangulate().unwrap();
    assert_eq!((again.face_map, again.cut), (None, 0));
}
