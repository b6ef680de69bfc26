//! Self-intersections, against the distance of convex sets by alternating projections.

mod common;

use common::distance::closest;
use common::sample;
use common::soups::{Soup, surface};
use glam::DVec3;
use progmesh_simplify::Quiet;
use progmesh_simplify::measure::*;
use proptest::prelude::*;

fn pairs(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> SelfIntersections {
    self_intersections(&Surface::new(points, triangles).unwrap(), &Quiet).unwrap()
}

/// Whether two triangles come within 0.002: projections onto convex sets in turn converge to the distance.
fn touch(s: &[DVec3; 3], t: &[DVec3; 3]) -> bool {
    // From several starts, as convergence may be slow.
    (0..3).any(|k| {
        let mut p = s[k];
        for _ in 0..1500 {
            p = closest(closest(p, t), s);
        }
        closest(p, t).distance(p) < 0.002
    })
}

/// Whether they meet beyond their common corners: what is left of one when common corners and sides are cut off, against the other.
fn meet(s: &[DVec3; 3], t: &[DVec3; 3]) -> bool {
    let common: Vec<usize> = (0..3).filter(|&k| t.contains(&s[k])).collect();
    let near = |p: DVec3, q: DVec3| p + (q - p) * 0.1;
    match common[..] {
        [] => touch(s, t),
        [k] => {
            let (v, a, b) = (s[k], s[(k + 1) % 3], s[(k + 2) % 3]);
            touch(&[near(v, a), a, b], t) || touch(&[near(v, a), b, near(v, b)], t)
        }
        [_, _] => {
            let k = (0..3).find(|k| !common.contains(k)).unwrap();
            let (apex, p, q) = (s[k], s[(k + 1) % 3], s[(k + 2) % 3]);
            // Shrunk towards the apex and away from both ends of the side.
            let middle = (p + q) * 0.5;
            touch(
                &[near(near(p, apex), middle), near(near(q, apex), middle), near(middle, apex)]
                    .map(|x| near(x, apex)),
                t,
            )
        }
        _ => true,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn pairs_are_those_of_convex_sets(
        points in prop::collection::vec(prop::array::uniform3((-1i32..2).prop_map(f64::from)), 3..12),
        triangles in prop::collection::vec(prop::array::uniform3(0u32..12), 2..12),
    ) {
        let n = points.len() as u32;
        let s: Soup = (points, triangles.iter().map(|t| t.map(|v| v % n)).collect());
        let at = |t: &[u32; 3]| t.map(|v| DVec3::from_array(s.0[v as usize]));
        let flat = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]) == DVec3::ZERO;
        let all: Vec<[DVec3; 3]> = s.1.iter().map(at).collect();
        let mut want = Vec::new();
        for i in 0..all.len() {
            for j in i + 1..all.len() {
                if !flat(&all[i]) && !flat(&all[j]) && meet(&all[i], &all[j]) {
                    want.push([i as u32, j as u32]);
                }
            }
        }
        let found = self_intersections(&surface(&s), &Quiet).unwrap();
        prop_assert_eq!(found.degenerate, all.iter().filter(|t| flat(t)).count());
        prop_assert_eq!(found.pairs as usize, found.some.len());
        prop_assert_eq!(found.some, want, "{:?}", s);
    }
}

#[test]
fn a_clean_mesh_has_none_and_a_pierced_one_has_them() {
    let m = sample("torus", 3000, 1);
    assert_eq!(
        self_intersections(&Surface::from_mesh(&m).unwrap(), &Quiet).unwrap(),
        SelfIntersections::default()
    );
    // A spike right through it.
    let mut points: Vec<[f64; 3]> = m.positions().iter().map(|p| p.to_array()).collect();
    let mut triangles = m.triangles();
    let n = points.len() as u32;
    points.extend([[-100.0, -0.01, 0.013], [100.0, 0.011, 0.017], [100.0, 0.012, 0.019]]);
    triangles.push([n, n + 1, n + 2]);
    let found = pairs(&points, &triangles);
    assert!(found.pairs >= 4 && found.some.iter().all(|p| p[1] == triangles.len() as u32 - 1), "{found:?}");
}

#[test]
fn soups_are_judged_as_the_mesh_they_would_weld_to() {
    let m = sample("torus", 1000, 1);
    let points: Vec<[f64; 3]> =
        m.triangles().as_flattened().iter().map(|&v| m.positions().get(v as usize).to_array()).collect();
    let triangles: Vec<[u32; 3]> =
        (0..points.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    assert_eq!(pairs(&points, &triangles).pairs, 0);
}

#[test]
fn touches_overlaps_and_neighbours_are_told_apart() {
    let p = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.25, 0.25, 0.0],
        [0.25, 0.25, 1.0],
        [0.0, 0.0, 1.0f64],
    ];
    let count = |s: [u32; 3], t: [u32; 3]| pairs(&p, &[s, t]).pairs;
    assert_eq!(count([0, 1, 2], [1, 3, 2]), 0, "neighbours");
    assert_eq!(count([0, 1, 2], [1, 2, 0]), 1, "the same triangle twice");
    assert_eq!(count([0, 1, 2], [0, 1, 3]), 1, "on the same side of a common side");
    assert_eq!(count([0, 1, 2], [0, 1, 6]), 0, "folded up");
    assert_eq!(count([0, 1, 2], [0, 5, 6]), 0, "upright at a common corner");
    assert_eq!(count([0, 1, 2], [0, 4, 5]), 1, "upright, along the inside");
    assert_eq!(count([0, 1, 2], [4, 5, 6]), 1, "a corner that touches");
    assert_eq!(count([0, 1, 2], [4, 4, 5]), 0, "without area");
}

#[test]
fn threads_do_not_matter_and_lists_end() {
    // All triangles of a fan about one line, and of another that crosses it.
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..60u32 {
        let (s, c) = (f64::from(i) * 0.1).sin_cos();
        points.extend([[0.0, 0.0, -1.0 - f64::from(i)], [c, s, 0.0], [-c, -s, f64::from(i) + 1.0]]);
        triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let found = pairs(&points, &triangles);
    assert!(found.pairs > 64 && found.some.len() == SelfIntersections::LISTED, "{}", found.pairs);
    assert_eq!(found, pairs(&points, &triangles));
}
