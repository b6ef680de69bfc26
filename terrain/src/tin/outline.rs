//! The outline of the valid region with fewer corners: within a tolerance of the exact one, and never around a void sample.
//!
//! Corners are taken away one by one (as Visvalingam & Whyatt 1993 do), those first that cost no sample. One goes only if the triangle of it and its two
//! neighbours has no other corner in it, so that outlines never cross or touch anew (de Berg, van Kreveld & Schirra 1998); if no void sample lies in what
//! that adds; and if every corner of the exact outline between the neighbours lies within the tolerance of the side between them. The exact outline
//! leads from one neighbour to the other within a convex band about the side, so each of both lies within the tolerance of the other.

use super::breaklines::Placed;
use super::delaunay::{HULL, Triangulation, next};
use super::field::{Field, VOID};
use super::region::Region;
use super::scan::{area, rows};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, HashSet};

type Point = (i32, i32);

/// A simplified outline.
#[derive(Clone, Debug, Default)]
pub(super) struct Outline {
    /// Its sides; what is valid lies to their left.
    pub sides: Vec<[Point; 2]>,
    /// Corners of the exact outline.
    pub corners: usize,
}

/// The tolerance is counted in these parts of a sample, rounded down.
const PARTS: i128 = 256;

/// The greatest tolerance in samples: no grid has longer sides.
const MOST: f64 = 65_536.0;

/// A corner of the exact outline.
#[derive(Clone, Copy, Debug)]
struct Corner {
    at: Point,
    previous: u32,
    next: u32,
    /// Never goes: on the border of the grid, or where outlines touch.
    stays: bool,
    gone: bool,
    /// Counts changes around it, so that costs of before can be told.
    version: u32,
}

impl Outline {
    /// `tolerance` in samples. O(corners log corners), times the samples in the triangles cut away.
    pub(super) fn simplified(field: &Field, region: &Region, tolerance: f64) -> Self {
        let mut work = Work::new(field, region, tolerance);
        let corners = work.corners.len();
        while work.pass() {}
        let sides = work.corners.iter().filter(|c| !c.gone);
        let sides = sides.map(|c| [c.at, work.corners[c.next as usize].at]).collect();
        Outline { sides, corners }
    }

    /// Makes the outline part of a triangulation of a rectangle and marks what lies outside.
    pub(super) fn constrain(&self, mesh: &mut Triangulation) {
        let placed = mesh.constrain_lines(&self.sides);
        debug_assert_eq!(placed, Placed::default());
        let inside: HashSet<[Point; 2]> = self.sides.iter().copied().collect();
        let count = mesh.triangles();
        let mut known: Vec<Option<bool>> = vec![None; count];
        let mut open = vec![];
        for t in 0..count as u32 {
            for s in 3 * t..3 * t + 3 {
                let (a, b) = (mesh.point(s), mesh.point(next(s)));
                let is = inside.contains(&[a, b]);
                if is || inside.contains(&[b, a]) {
                    known[t as usize] = Some(is);
                    open.push(t);
                    break;
                }
            }
        }
        while let Some(t) = open.pop() {
            for s in 3 * t..3 * t + 3 {
                let across = mesh.across(s);
                if !mesh.is_fixed(s) && across != HULL && known[across as usize / 3].is_none() {
                    known[across as usize / 3] = known[t as usize];
                    open.push(across / 3);
                }
            }
        }
        mesh.outside = known.into_iter().map(|k| k != Some(true)).collect();
        mesh.changed = (0..count as u32).collect();
    }
}

struct Work<'a> {
    field: &'a Field,
    corners: Vec<Corner>,
    /// The next corner of the exact outline, for each.
    exact: Vec<u32>,
    /// Samples that are corners still.
    taken: Vec<bool>,
    /// The tolerance in parts of a sample.
    tolerance: i128,
}

/// Unit steps of outlines, to the left from that of the axis of columns; each leads along an edge of the grid.
const STEPS: [Point; 6] = [(1, 0), (1, 1), (0, 1), (-1, 0), (-1, -1), (0, -1)];

impl<'a> Work<'a> {
    fn new(field: &'a Field, region: &Region, tolerance: f64) -> Self {
        let mut corners: Vec<Corner> = vec![];
        let mut steps: HashMap<Point, u8> = HashMap::new();
        for (at, step) in region.outline_steps() {
            *steps.entry(at).or_insert(0) |= 1 << step;
        }
        let mut starts: Vec<Point> = steps.keys().copied().collect();
        starts.sort_unstable();
        let touching: HashSet<Point> =
            steps.iter().filter(|(_, s)| s.count_ones() > 1).map(|(&p, _)| p).collect();
        let (right, last) = (field.columns - 1, field.rows - 1);
        for start in starts {
            // As long as loops that were not followed leave from here.
            while let Some(first) =
                steps.get(&start).filter(|&&s| s != 0).map(|s| s.trailing_zeros() as usize)
            {
                let from = corners.len();
                let (mut at, mut step) = (start, first);
                loop {
                    if let Some(s) = steps.get_mut(&at) {
                        *s &= !(1 << step);
                    }
                    let to = (at.0 + STEPS[step].0, at.1 + STEPS[step].1);
                    let back = (step + 3) % 6;
                    // The first to the right from where it came: what lies between is valid. Back at the start it is the first step of all.
                    let open =
                        steps.get(&to).copied().unwrap_or(0) | if to == start { 1 << first } else { 0 };
                    let Some(turn) = (1..6).map(|k| (back + 6 - k) % 6).find(|k| open >> k & 1 == 1) else {
                        break;
                    };
                    if turn != step || touching.contains(&to) {
                        let stays =
                            touching.contains(&to) || to.0 == 0 || to.1 == 0 || to.0 == right || to.1 == last;
                        corners.push(Corner { at: to, previous: 0, next: 0, stays, gone: false, version: 0 });
                    }
                    if to == start && turn == first {
                        break;
                    }
                    (at, step) = (to, turn);
                }
                let n = corners.len() - from;
                for (i, c) in corners[from..].iter_mut().enumerate() {
                    c.previous = (from + (i + n - 1) % n) as u32;
                    c.next = (from + (i + 1) % n) as u32;
                }
            }
        }
        let exact = corners.iter().map(|c| c.next).collect();
        let mut taken = vec![false; field.h.len()];
        for c in &corners {
            taken[field.index(c.at.0, c.at.1)] = true;
        }
        let tolerance = (tolerance.clamp(0.0, MOST) * PARTS as f64).floor() as i128;
        Work { field, corners, exact, taken, tolerance }
    }

    /// Takes away what can go, the cheapest first; false if nothing could.
    fn pass(&mut self) -> bool {
        let mut queue = BinaryHeap::new();
        for i in 0..self.corners.len() as u32 {
            self.queue(i, &mut queue);
        }
        let mut any = false;
        while let Some(Reverse((_, _, i, version))) = queue.pop() {
            let c = self.corners[i as usize];
            // Another corner may have gone since, but none has come: only what lies next to it matters, and whether three are left.
            let last = self.corners[c.previous as usize].previous == c.next;
            if c.gone || c.version != version || last {
                continue;
            }
            any = true;
            self.corners[i as usize].gone = true;
            let sample = self.field.index(c.at.0, c.at.1);
            self.taken[sample] = false;
            self.corners[c.previous as usize].next = c.next;
            self.corners[c.next as usize].previous = c.previous;
            for i in [c.previous, c.next] {
                self.corners[i as usize].version += 1;
                self.queue(i, &mut queue);
            }
        }
        any
    }

    fn queue(&self, i: u32, queue: &mut BinaryHeap<Reverse<(usize, i64, u32, u32)>>) {
        if let Some((dropped, area)) = self.cost(i) {
            queue.push(Reverse((dropped, area, i, self.corners[i as usize].version)));
        }
    }

    /// The samples lost without a corner, and the doubled area of its triangle; `None` if it must stay.
    fn cost(&self, i: u32) -> Option<(usize, i64)> {
        let c = self.corners[i as usize];
        let (before, after) = (self.corners[c.previous as usize], self.corners[c.next as usize]);
        // Of three sides all stay.
        if c.gone || c.stays || before.previous == c.next || !self.within(c.previous, c.next) {
            return None;
        }
        let (u, v, w) = (before.at, c.at, after.at);
        let turn = area(u, v, w);
        let (dx, dy) = (i64::from(w.0 - u.0), i64::from(w.1 - u.1));
        let ahead = |p: Point, q: Point| i64::from(q.0 - p.0) * dx + i64::from(q.1 - p.1) * dy;
        if turn == 0 {
            // Straight on, not back.
            return (ahead(u, v) > 0 && ahead(v, w) > 0).then_some((0, 0));
        }
        let (mut free, mut dropped) = (true, 0);
        let columns = self.field.columns as usize;
        rows(u, v, w, |y, x0, x1| {
            for x in x0..=x1 {
                let (p, sample) = ((x, y), y as usize * columns + x as usize);
                let is_corner = p == u || p == v || p == w;
                free &= is_corner || !self.taken[sample];
                free &= turn > 0 || self.field.h[sample] != VOID;
                dropped += usize::from(turn > 0 && area(u, w, p) != 0);
            }
        });
        free.then_some((dropped, turn.abs()))
    }

    /// Whether every corner of the exact outline between two corners lies within the tolerance of the side between them.
    fn within(&self, from: u32, to: u32) -> bool {
        let (u, w) = (self.corners[from as usize].at, self.corners[to as usize].at);
        let (dx, dy) = (i128::from(w.0 - u.0), i128::from(w.1 - u.1));
        let long = dx * dx + dy * dy;
        let most = self.tolerance * self.tolerance;
        let near = |p: Point| {
            let (px, py) = (i128::from(p.0 - u.0), i128::from(p.1 - u.1));
            let along = px * dx + py * dy;
            // Squares of the distance, from the nearer end or from the side, times the square of its length.
            let square = if along <= 0 {
                (px * px + py * py) * long
            } else if along >= long {
                ((px - dx).pow(2) + (py - dy).pow(2)) * long
            } else {
                (px * dy - py * dx).pow(2)
            };
            square * PARTS * PARTS <= most * long
        };
        self.between(from, to).all(|i| near(self.corners[i as usize].at))
    }

    /// Corners of the exact outline between two of the same loop.
    fn between(&self, from: u32, to: u32) -> impl Iterator<Item = u32> {
        let exact = &self.exact;
        let next = move |&i: &u32| Some(exact[i as usize]);
        std::iter::successors(Some(exact[from as usize]), next).take_while(move |&i| i != to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;
    use proptest::prelude::*;

    fn field(columns: usize, rows: usize, is_void: impl Fn(i32, i32) -> bool) -> Field {
        let height = |i: usize| match is_void((i % columns) as i32, (i / columns) as i32) {
            true => f64::NAN,
            false => 0.0,
        };
        Field::new(&Grid::new(columns, rows, (0..columns * rows).map(height).collect()).unwrap(), 0.0)
    }

    fn outline(field: &Field, tolerance: f64) -> Outline {
        Outline::simplified(field, &Region::new(field), tolerance)
    }

    /// Doubled area to the left of all sides.
    fn doubled(sides: &[[Point; 2]]) -> i64 {
        sides.iter().map(|[a, b]| i64::from(a.0) * i64::from(b.1) - i64::from(b.0) * i64::from(a.1)).sum()
    }

    /// Distance of a point, in samples, from the nearest of some sides.
    fn distance(p: (f64, f64), sides: &[[Point; 2]]) -> f64 {
        let of = |[a, b]: &[Point; 2]| {
            let (ax, ay, bx, by) = (f64::from(a.0), f64::from(a.1), f64::from(b.0), f64::from(b.1));
            let (dx, dy) = (bx - ax, by - ay);
            let t = (((p.0 - ax) * dx + (p.1 - ay) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
            (p.0 - ax - t * dx).hypot(p.1 - ay - t * dy)
        };
        sides.iter().map(of).fold(f64::INFINITY, f64::min)
    }

    /// Points along sides.
    fn along(sides: &[[Point; 2]]) -> impl Iterator<Item = (f64, f64)> {
        sides.iter().flat_map(|&[a, b]| {
            (0..=8).map(move |k| {
                let t = f64::from(k) / 8.0;
                (f64::from(a.0) + f64::from(b.0 - a.0) * t, f64::from(a.1) + f64::from(b.1 - a.1) * t)
            })
        })
    }

    /// How often sides go around a point that is on none, to the left.
    fn winding((x, y): (f64, f64), sides: &[[Point; 2]]) -> i32 {
        let crosses = |[a, b]: &[Point; 2]| {
            let (ax, ay, bx, by) = (f64::from(a.0), f64::from(a.1), f64::from(b.0), f64::from(b.1));
            let at = ax + (bx - ax) * (y - ay) / (by - ay);
            match (ay <= y, by <= y) {
                (true, false) if at > x => 1,
                (false, true) if at > x => -1,
                _ => 0,
            }
        };
        sides.iter().map(crosses).sum()
    }

    #[test]
    fn a_slanted_shore_becomes_straight_without_losing_a_sample() {
        // Steps of three: voids below a line.
        let field = field(31, 14, |x, y| 3 * y < x - 1);
        let (exact, simple) = (outline(&field, 0.0), outline(&field, 1.0));
        assert!(
            exact.sides.len() > 20 && simple.sides.len() <= 8,
            "{} {}",
            exact.sides.len(),
            simple.sides.len()
        );
        assert_eq!(exact.corners, simple.corners);
        assert!(doubled(&simple.sides) >= doubled(&exact.sides));
    }

    #[test]
    fn holes_and_islands_stay() {
        // A void sample alone, an island in a lake, and two lakes that touch in a corner.
        let void = |x: i32, y: i32| {
            (x, y) == (4, 4)
                || (x - 15).abs().max((y - 8).abs()) < 6 && (x - 15).abs().max((y - 8).abs()) > 2
                || (x, y) == (26, 5)
                || (x, y) == (28, 5)
        };
        let field = field(33, 18, void);
        for tolerance in [0.0, 0.7, 2.0, 10.0] {
            let sides = outline(&field, tolerance).sides;
            for (i, h) in field.h.iter().enumerate() {
                let p = (f64::from((i % 33) as i32), f64::from((i / 33) as i32));
                assert!(*h != VOID || winding(p, &sides) == 0, "{tolerance}: {p:?}");
            }
            // A corner of the island at least; the middle unless all may go but that.
            assert!(sides.iter().any(|s| (s[0].0 - 15).abs() <= 2 && (s[0].1 - 8).abs() <= 2), "{tolerance}");
            assert!(tolerance > 2.0 || winding((15.1, 8.2), &sides) == 1, "{tolerance}");
            assert_eq!(winding((1.1, 1.2), &sides), 1, "{tolerance}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(80))]

        /// Against the exact outline, by looking: near it both ways, no void sample inside or on a side, no side across another, inside is left.
        #[test]
        fn outlines_are_near_and_hold_no_void(
            void in proptest::collection::vec(0..100u32, 15 * 13),
            share in prop_oneof![Just(4u32), Just(12), Just(40)],
            lake in (0..15i32, 0..13i32, 0..6i32),
            tolerance in prop_oneof![Just(0.0), Just(0.5), Just(1.0), Just(2.5), Just(100.0)],
        ) {
            let is_void = |x: i32, y: i32| {
                void[(y * 15 + x) as usize] < share || (x - lake.0).pow(2) + (y - lake.1).pow(2) < lake.2.pow(2)
            };
            let field = field(15, 13, is_void);
            let region = Region::new(&field);
            prop_assume!(region.triangles > 0);
            let (exact, simple) = (outline(&field, 0.0).sides, outline(&field, tolerance).sides);
            prop_assert_eq!(doubled(&exact) as usize, region.triangles);
            for (from, to) in [(&exact, &simple), (&simple, &exact)] {
                for p in along(from) {
                    prop_assert!(distance(p, to) <= tolerance + 1e-9, "{:?}", p);
                }
            }
            for (i, &h) in field.h.iter().enumerate() {
                let at = ((i % 15) as i32, (i / 15) as i32);
                let p = (f64::from(at.0), f64::from(at.1));
                if h == VOID {
                    prop_assert!(distance(p, &simple) > 1e-9 && winding(p, &simple) == 0, "{:?}", at);
                }
            }
            for (i, [a, b]) in simple.iter().enumerate() {
                for [c, d] in &simple[i + 1..] {
                    let cross = area(*a, *b, *c).signum() * area(*a, *b, *d).signum() < 0
                        && area(*c, *d, *a).signum() * area(*c, *d, *b).signum() < 0;
                    prop_assert!(!cross);
                }
            }
            for y in 0..60 {
                for x in 0..70 {
                    let p = (f64::from(x) * 0.2 + 0.09, f64::from(y) * 0.2 + 0.07);
                    prop_assert!((0..=1).contains(&winding(p, &simple)));
                }
            }
            // As sides of a triangulation: what is inside has the same area, and nothing void.
            let mut mesh = Triangulation::new(field.columns, field.rows);
            Outline { sides: simple.clone(), corners: 0 }.constrain(&mut mesh);
            let mut whole = 0;
            for t in (0..mesh.triangles() as u32).filter(|&t| !mesh.is_outside(t)) {
                let [a, b, c] = mesh.corners(t).map(|v| mesh.points[v as usize]);
                whole += area(a, b, c);
                rows(a, b, c, |y, x0, x1| (x0..=x1).for_each(|x| assert!(field.at(x, y) != VOID)));
            }
            prop_assert_eq!(whole, doubled(&simple));
        }
    }
}
