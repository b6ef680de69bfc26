//! Proven intervals of the Hausdorff distance, against brute force and known distances.

mod common;

use common::distance::closest;
use common::sample;
use common::soups::{Soup, soup, surface};
use glam::DVec3;
use progmesh_simplify::Quiet;
use progmesh_simplify::measure::*;
use proptest::prelude::*;

/// The greatest distance of a grid of points on every triangle.
fn brute(from: &Soup, to: &Soup, grid: usize) -> f64 {
    let at = |s: &Soup, v: u32| DVec3::from_array(s.0[v as usize]);
    let targets: Vec<[DVec3; 3]> = to.1.iter().map(|t| t.map(|v| at(to, v))).collect();
    let mut far = 0f64;
    for t in &from.1 {
        let [a, b, c] = t.map(|v| at(from, v));
        for i in 0..=grid {
            for j in 0..=grid - i {
                let p = a + (b - a) * (i as f64 / grid as f64) + (c - a) * (j as f64 / grid as f64);
                far =
                    far.max(targets.iter().map(|t| closest(p, t).distance(p)).fold(f64::INFINITY, f64::min));
            }
        }
    }
    far
}

fn check(a: &Soup, b: &Soup, tolerance: f64) -> Result<(), TestCaseError> {
    let (sa, sb) = (surface(a), surface(b));
    let c = certify(&sa, &sb, &CertifyOptions::with_tolerance(tolerance), &Quiet).unwrap();
    prop_assert!(c.converged, "{c:?}");
    for (side, from, to) in [(&c.a_to_b, a, b), (&c.b_to_a, b, a)] {
        prop_assert!(
            0.0 <= side.lower && side.lower <= side.upper && side.upper - side.lower <= tolerance,
            "{side:?}"
        );
        // A grid of step 1/12 is off by less than the longest side / 12.
        let found = brute(from, to, 12);
        prop_assert!(found <= side.upper, "{found} {side:?}");
        prop_assert!(side.lower <= found + 4.0 / 12.0, "{found} {side:?}");
        // The witness lies on its triangle and is as far as it says.
        let w = side.witness;
        let corners = |s: &Soup, t: u32| s.1[t as usize].map(|v| DVec3::from_array(s.0[v as usize]));
        prop_assert!(closest(w.point, &corners(from, w.triangle)).distance(w.point) < 1e-12);
        let away =
            to.1.iter().enumerate().map(|(t, _)| closest(w.point, &corners(to, t as u32)).distance(w.point));
        let away = away.fold(f64::INFINITY, f64::min);
        prop_assert!(
            (away - w.distance).abs() < 1e-12 && w.distance >= side.lower && away >= side.lower - 1e-12
        );
    }
    prop_assert_eq!(c.upper, c.a_to_b.upper.max(c.b_to_a.upper));
    prop_assert_eq!(c.lower, c.a_to_b.lower.max(c.b_to_a.lower));
    // No sample is farther; on slivers they are off by their rounding.
    let mut options = DistanceOptions::default();
    options.samples = 2000;
    let d = distance(&sa, &sb, &options, &Quiet).unwrap();
    prop_assert!(
        d.a_to_b.summary.max <= c.a_to_b.upper + 1e-12 && d.b_to_a.summary.max <= c.b_to_a.upper + 1e-12,
        "{} {} {c:?}",
        d.a_to_b.summary.max,
        d.b_to_a.summary.max
    );
    // The decision agrees on both sides of the interval.
    let decide = |bound| within(&sa, &sb, bound, &CertifyOptions::with_tolerance(tolerance), &Quiet).unwrap();
    if let Within::Yes { upper } = decide(c.upper * 1.001 + tolerance) {
        prop_assert!(upper >= c.lower && upper <= c.upper * 1.001 + tolerance);
    } else {
        prop_assert!(false, "not within {}", c.upper * 1.001 + tolerance);
    }
    let below = c.lower - 2.0 * tolerance;
    if below > 0.0 {
        let Within::No { witness, on_a } = decide(below) else { return Err(TestCaseError::fail("within")) };
        let (from, to) = if on_a { (a, b) } else { (b, a) };
        prop_assert!(witness.distance > below && brute(from, to, 1) <= c.upper);
    }
    check_places(a, b, c.upper * 1.001 + tolerance, tolerance)?;
    check_places(a, b, 0.7 * c.lower, tolerance)
}

/// All triangles with a point beyond the bound are named, and no other.
fn check_places(a: &Soup, b: &Soup, bound: f64, tolerance: f64) -> Result<(), TestCaseError> {
    let options = CertifyOptions::with_tolerance(tolerance);
    let found = exceeding(&surface(a), &surface(b), bound, usize::MAX, &options, &Quiet).unwrap();
    prop_assert_eq!(found.upper.is_some(), found.places.is_empty());
    prop_assert!(found.upper.is_none_or(|u| u <= bound));
    for (on_a, from, to) in [(true, a, b), (false, b, a)] {
        for t in 0..from.1.len() {
            let one: Soup = (from.0.clone(), vec![from.1[t]]);
            let far = brute(&one, to, 6);
            let mut named = found.places.iter().filter(|p| p.on_a == on_a && p.triangle as usize == t);
            let place = named.next();
            prop_assert!(named.next().is_none());
            prop_assert!(place.is_some() || far <= bound, "triangle {t}: {far} {bound}");
            if let Some(place) = place {
                let corners = from.1[t].map(|v| DVec3::from_array(from.0[v as usize]));
                prop_assert!(closest(place.point, &corners).distance(place.point) < 1e-9);
                // What takes too many cuts may be nearer.
                prop_assert!(place.distance >= 0.9 * bound - tolerance - 1e-9, "{place:?} {bound}");
            }
        }
    }
    let least = found.by_triangle.iter().copied().fold(0.0, f64::max);
    prop_assert!(
        found.by_triangle.len() == b.1.len() && (brute(b, a, 1) - least).min(brute(a, b, 1) - least) <= 1e-9
    );
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]

    #[test]
    fn intervals_hold_for_soups(a in soup(10), b in soup(10), digits in 2i32..7) {
        check(&a, &b, 10f64.powi(-digits))?;
    }

    #[test]
    fn intervals_hold_for_parts_of_the_same_soup(a in soup(10), keep in any::<u16>(), turn in any::<u16>()) {
        let bit = |bits: u16, i: usize| bits >> (i % 16) & 1 == 1;
        let mut b = a.clone();
        b.1 = a.1.iter().enumerate().filter(|&(i, _)| i == 0 || bit(keep, i)).map(|(i, &[x, y, z])| if bit(turn, i) { [y, x, z] } else { [z, x, y] }).collect();
        check(&a, &b, 1e-6)?;
    }
}

/// A sheet of `n` by `n` cells over the unit square, bent by `bend` over its width and bumpy by `bumps`; then whatever `skip` says is left out.
/// With `soup`, no two triangles share vertices.
fn sheet(n: u32, z: f64, bend: f64, bumps: &[f64], skip: Option<u32>, soup: bool) -> Soup {
    let m = n + 1;
    let at = |i: u32| {
        let (x, y) = (f64::from(i % m) / f64::from(n), f64::from(i / m) / f64::from(n));
        let bump = bumps.get(i as usize % bumps.len().max(1)).copied().unwrap_or(0.0);
        // On a cylinder that turns by `bend` in all.
        let radius = 1.0 / bend.max(0.05);
        let (angle, r) = ((x - 0.5) / radius, radius - z - bump);
        [r * angle.sin(), y, radius - r * angle.cos()]
    };
    let mut triangles: Vec<[u32; 3]> = (0..n * n)
        .filter(|&i| n == 1 || skip != Some(i))
        .flat_map(|i| {
            let a = i / n * m + i % n;
            [[a, a + 1, a + m + 1], [a, a + m + 1, a + m]]
        })
        .collect();
    let mut points: Vec<[f64; 3]> = (0..m * m).map(at).collect();
    if soup {
        points = triangles.iter().flatten().map(|&v| points[v as usize]).collect();
        triangles = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    }
    (points, triangles)
}

/// Both as one.
fn joined(a: &Soup, b: &Soup) -> Soup {
    let n = a.0.len() as u32;
    let points = a.0.iter().chain(&b.0).copied().collect();
    (points, a.1.iter().copied().chain(b.1.iter().map(|t| t.map(|v| v + n))).collect())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Sheets that cover each other, or do not quite: with holes, folded back, close to another sheet, torn into soups, turned over.
    #[test]
    fn intervals_hold_for_sheets(
        n in 1u32..7,
        m in 1u32..5,
        bend in prop_oneof![Just(0.0), 0.1..6.0],
        bumps in prop::collection::vec(-0.1..0.1f64, 1..9),
        hole in prop_oneof![Just(None), (0u32..36).prop_map(Some)],
        double in prop_oneof![Just(None), (0.001..0.2f64).prop_map(Some)],
        torn in any::<bool>(),
        over in any::<bool>(),
        digits in 2i32..7,
    ) {
        let a = sheet(n, 0.0, bend, &bumps, hole, torn);
        let mut b = sheet(m, 0.01, bend, &[], None, !torn);
        if let Some(away) = double {
            b = joined(&b, &sheet(m + 1, 0.01 + away, bend, &[], None, false));
        }
        if over {
            b.1.iter_mut().for_each(|t| t.swap(0, 1));
        }
        check(&a, &b, 10f64.powi(-digits))?;
    }
}

#[test]
fn a_sheet_over_another_takes_hardly_a_cut() {
    // Triangles of the one cross many of the other: what covers them is proven together.
    let (fine, coarse) = (sheet(60, 0.0, 1.5, &[], None, false), sheet(13, 0.0, 1.5, &[], None, false));
    for torn in [false, true] {
        let fine = if torn { sheet(60, 0.0, 1.5, &[], None, true) } else { fine.clone() };
        let c = certify(&surface(&fine), &surface(&coarse), &CertifyOptions::with_tolerance(1e-6), &Quiet)
            .unwrap();
        assert!(c.converged && c.upper - c.lower <= 1e-6, "{c:?}");
        // The sagitta of a thirteenth of the arc.
        let half = 1.5 / 13.0 / 2.0f64;
        let sagitta = (1.0 - half.cos()) / 1.5;
        assert!(c.lower <= sagitta && sagitta * 0.9 <= c.upper, "{c:?} {sagitta}");
        assert!(c.cuts < 20_000, "{}", c.cuts);
    }
}

#[test]
fn a_surface_against_itself_is_proven_to_be_there() {
    let m = sample("torus", 4000, 1);
    let a = Surface::from_mesh(&m).unwrap();
    let c = certify(&a, &a, &CertifyOptions::default(), &Quiet).unwrap();
    assert!(c.converged && c.lower == 0.0 && c.upper < 1e-11 * a.diagonal(), "{c:?}");
    assert_eq!(c.cuts, 0);
}

#[test]
fn surfaces_that_lie_flat_on_each_other_take_few_cuts() {
    // The same square, cut at different places.
    let grid = |n: u32, shift: f64| {
        let at = |i: u32| if i == 0 || i == n { i as f64 / n as f64 } else { (i as f64 + shift) / n as f64 };
        let points: Vec<[f64; 3]> =
            (0..(n + 1) * (n + 1)).map(|i| [at(i % (n + 1)), at(i / (n + 1)), 0.5]).collect();
        let corner = |x: u32, y: u32| y * (n + 1) + x;
        let cell = |i: u32| (i % n, i / n);
        let triangles: Vec<[u32; 3]> = (0..n * n)
            .map(cell)
            .flat_map(|(x, y)| {
                let (a, b, c, d) = (corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1));
                [[a, b, c], [a, c, d]]
            })
            .collect();
        (points, triangles)
    };
    let (a, b) = (surface(&grid(17, 0.3)), surface(&grid(20, 0.1)));
    let c = certify(&a, &b, &CertifyOptions::with_tolerance(1e-9), &Quiet).unwrap();
    assert!(c.converged && c.upper < 1e-9, "{c:?}");
    // Halving down to 1e-9 would take millions.
    assert!(c.cuts < 60_000, "{}", c.cuts);
}

#[test]
fn known_distances_are_within() {
    // The middle of a square is nowhere near its border: 0.5 is attained inside a triangle, not at a corner.
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0f64]];
    let a = Surface::new(&points[..], &[[0, 1, 2], [0, 2, 3]]).unwrap();
    let b = Surface::new(&points[..], &[[0, 1, 1], [1, 2, 2], [2, 3, 3], [3, 0, 0]]).unwrap();
    let c = certify(&a, &b, &CertifyOptions::with_tolerance(1e-7), &Quiet).unwrap();
    assert!(c.lower <= 0.5 && 0.5 <= c.upper && c.upper - c.lower <= 1e-7, "{c:?}");
    assert!(c.witness_on_a && c.witness.point.distance(DVec3::new(0.5, 0.5, 0.0)) < 1e-6);
    assert!(c.b_to_a.upper < 1e-12);
    // Midway between two planes.
    let plane = |z: f64| points.map(|p| [p[0], p[1], z]);
    let two: Vec<[f64; 3]> = plane(-0.25).into_iter().chain(plane(0.25)).collect();
    let two = Surface::new(&two[..], &[[0, 1, 2], [0, 2, 3], [4, 5, 7], [5, 6, 7]]).unwrap();
    let c = certify(&a, &two, &CertifyOptions::with_tolerance(1e-7), &Quiet).unwrap();
    assert!(c.lower <= 0.25 && 0.25 <= c.upper && c.upper - c.lower <= 1e-7, "{c:?}");
}

#[test]
fn far_from_the_origin_and_from_each_other_intervals_hold() {
    let m = sample("scan", 300, 2);
    let points: Vec<[f64; 3]> = m.positions().iter().map(|p| p.to_array()).collect();
    let moved = |by: f64| {
        Surface::new(&points.iter().map(|p| p.map(|x| x + by)).collect::<Vec<_>>()[..], &m.triangles())
            .unwrap()
    };
    let (here, there) = (moved(0.0), moved(1e6));
    let options = CertifyOptions::with_tolerance(1e-3);
    let c = certify(&here, &there, &options, &Quiet).unwrap();
    let d = distance(&here, &there, &DistanceOptions::default(), &Quiet).unwrap();
    assert!(
        c.converged && c.upper - c.lower <= 1e-3 && d.worse.max <= c.upper && d.worse.max > 1.7e6,
        "{c:?}"
    );
    let c = certify(&there, &moved(1e6 + 0.125), &options, &Quiet).unwrap();
    assert!(c.converged && c.upper <= 0.125 * 3f64.sqrt() + 1e-3, "{c:?}");
}

#[test]
fn proofs_do_not_depend_on_threads() {
    let (a, b) = (sample("scan", 12_000, 1), sample("scan", 800, 1));
    let (a, b) = (Surface::from_mesh(&a).unwrap(), Surface::from_mesh(&b).unwrap());
    let run = |threads| {
        let mut o = CertifyOptions::with_tolerance(1e-5 * a.diagonal());
        o.threads = Some(threads);
        certify(&a, &b, &o, &Quiet).unwrap()
    };
    let one = run(1);
    assert!(one.cuts > 100 && one.converged);
    assert_eq!(one, run(2));
    assert_eq!(one, run(5));
}

#[test]
fn a_limit_of_cuts_leaves_a_wider_interval() {
    let (a, b) = (sample("scan", 3000, 1), sample("scan", 200, 1));
    let (a, b) = (Surface::from_mesh(&a).unwrap(), Surface::from_mesh(&b).unwrap());
    let tolerance = 1e-8 * a.diagonal();
    let full = certify(&a, &b, &CertifyOptions::with_tolerance(tolerance), &Quiet).unwrap();
    let mut few = CertifyOptions::with_tolerance(tolerance);
    few.max_cuts = 1;
    let rough = certify(&a, &b, &few, &Quiet).unwrap();
    assert!(full.converged && !rough.converged && rough.cuts < full.cuts);
    assert!(rough.lower <= full.upper && rough.upper >= full.lower && rough.upper - rough.lower > tolerance);
}

#[test]
fn what_is_no_bound_is_refused() {
    let a = Surface::from_mesh(&sample("torus", 100, 1)).unwrap();
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let options = CertifyOptions::with_tolerance(bad);
        assert!(matches!(
            certify(&a, &a, &options, &Quiet),
            Err(MeasureError::Range { option: "tolerance", .. })
        ));
        let options = CertifyOptions::default();
        assert!(matches!(
            within(&a, &a, bad, &options, &Quiet),
            Err(MeasureError::Range { option: "bound", .. })
        ));
    }
}
