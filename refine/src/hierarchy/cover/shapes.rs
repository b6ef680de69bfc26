//! Convex polygons in the plane of a face.

use super::CORNERS;
use robust::{Coord, orient2d};

/// Joins polygons that are convex together.
pub(super) fn join(shapes: &mut Vec<Vec<[f64; 2]>>) {
    let mut k = 0;
    while k < shapes.len() {
        let with = (k + 1..shapes.len()).find_map(|j| {
            let mut both = [&shapes[k][..], &shapes[j][..]].concat();
            convex_hull(&mut both);
            let parts = area(&shapes[k]) + area(&shapes[j]);
            // Whatever rounding says, the hull holds both.
            (both.len() <= CORNERS && area(&both) <= parts * (1.0 + 1e-9)).then_some((j, both))
        });
        match with {
            Some((j, both)) => {
                shapes.swap_remove(j);
                shapes[k] = both;
                // It may fit to those before it now.
                k = 0;
            }
            None => k += 1,
        }
    }
}

/// Twice the area of a convex polygon.
pub(super) fn area(polygon: &[[f64; 2]]) -> f64 {
    let Some((a, rest)) = polygon.split_first() else { return 0.0 };
    let twice = |w: &[[f64; 2]]| {
        let (b, c) = (w[0], w[1]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    rest.windows(2).map(twice).sum::<f64>().abs()
}

/// The corners of the least convex polygon around points, in turn.
pub(super) fn convex_hull(points: &mut Vec<[f64; 2]>) {
    points.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    if points.len() < 3 {
        return;
    }
    let coord = |[x, y]: [f64; 2]| Coord { x, y };
    let turn = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| orient2d(coord(a), coord(b), coord(c));
    let mut hull: Vec<[f64; 2]> = Vec::with_capacity(points.len() + 1);
    for pass in 0..2 {
        let from = hull.len();
        let mut add = |p: [f64; 2]| {
            while hull.len() >= from + 2 && turn(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        };
        if pass == 0 {
            points.iter().for_each(|&p| add(p));
        } else {
            points.iter().rev().for_each(|&p| add(p));
        }
        // The last is the first of the other half.
        hull.pop();
    }
    *points = hull;
}
