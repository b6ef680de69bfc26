//! Lines that become sides: constrained edges between samples (flips as in Sloan 1993, exact predicates).

use super::delaunay::{HULL, Triangulation, next, previous};
use super::scan::area;

type Point = (i32, i32);

/// What became of the lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Placed {
    /// Pieces that were led over the nearest sample, where lines cross between samples or leave the valid region.
    pub bent: usize,
    /// Pieces left out because they lie where nothing is valid.
    pub outside: usize,
}

/// Pieces that a line may be cut into, for each of its steps: far more than crossings take. What is beyond is left out.
const MOST_PIECES: usize = 16;

/// What lies between two vertices.
enum Between {
    /// A side.
    Side(u32),
    /// A vertex on the line.
    Vertex(Point),
    /// A side that may not be turned: a breakline or the outline.
    Fixed(u32),
    /// Nothing but sides that can be turned, or nothing at all where it lies outside.
    Free { sides: Vec<[Point; 2]>, outside: bool },
}

impl Triangulation {
    /// Makes straight lines between samples sides of the triangulation, whole or in pieces, and fixes them. The outline is in already.
    ///
    /// Lines that cross between samples are led over the sample nearest to the crossing, and so is a line that crosses the outline: over the nearest
    /// sample of the outline. What lies where nothing is valid is left out. O(triangles crossed) a line, and the walks to its ends.
    pub(super) fn constrain_lines(&mut self, lines: &[[Point; 2]]) -> Placed {
        let mut placed = Placed::default();
        for &[a, b] in lines {
            let mut left = MOST_PIECES * ((b.0 - a.0).abs().max((b.1 - a.1).abs()) as usize + 1);
            let mut pieces = vec![[a, b]];
            while let Some([a, b]) = pieces.pop() {
                if a == b {
                    continue;
                }
                if left == 0 {
                    placed.outside += 1;
                    continue;
                }
                left -= 1;
                self.insert(a);
                self.insert(b);
                match self.between(a, b) {
                    Between::Side(side) => {
                        let across = self.across(side);
                        let inside =
                            !self.is_outside(side / 3) || across != HULL && !self.is_outside(across / 3);
                        if inside {
                            self.fix(side);
                        } else {
                            placed.outside += 1;
                        }
                    }
                    Between::Vertex(v) => pieces.extend([[v, b], [a, v]]),
                    Between::Fixed(side) => {
                        placed.bent += 1;
                        pieces.extend(self.lead_over(side, a, b));
                    }
                    Between::Free { outside: true, .. } => placed.outside += 1,
                    Between::Free { sides, .. } => self.turn_to(a, b, sides),
                }
            }
        }
        self.stack.clear();
        placed
    }

    /// Sides that leave the vertex at a point, around it.
    fn around(&mut self, p: Point) -> Vec<u32> {
        let mut sides = vec![];
        self.locate(p);
        let Some(first) = (3 * self.last..3 * self.last + 3).find(|&s| self.point(s) == p) else {
            return sides;
        };
        let mut s = first;
        loop {
            sides.push(s);
            match self.across(previous(s)) {
                HULL => break,
                o if o == first => return sides,
                o => s = o,
            }
        }
        s = first;
        loop {
            match self.across(s) {
                HULL => return sides,
                o => s = next(o),
            }
            sides.push(s);
        }
    }

    /// What lies between two vertices, from the first on.
    fn between(&mut self, a: Point, b: Point) -> Between {
        let ahead = |p: Point| {
            let (dx, dy) = (i64::from(b.0 - a.0), i64::from(b.1 - a.1));
            i64::from(p.0 - a.0) * dx + i64::from(p.1 - a.1) * dy > 0
        };
        let mut crossed = None;
        for s in self.around(a) {
            let far = next(s);
            let (u, w) = (self.point(far), self.point(previous(s)));
            for (p, side) in [(u, s), (w, previous(s))] {
                if area(a, b, p) == 0 && ahead(p) {
                    return if p == b { Between::Side(side) } else { Between::Vertex(p) };
                }
            }
            if area(a, b, u) < 0 && area(a, b, w) > 0 {
                crossed = Some(far);
            }
        }
        let (mut sides, Some(mut side)) = (vec![], crossed) else {
            // Lines stay within the rectangle, which is convex.
            return Between::Free { sides: vec![], outside: true };
        };
        let outside = self.is_outside(side / 3);
        loop {
            if self.is_fixed(side) || self.across(side) == HULL {
                return Between::Fixed(side);
            }
            sides.push([self.point(side), self.point(next(side))]);
            let across = self.across(side);
            let apex = self.point(previous(across));
            match area(a, b, apex) {
                0 if apex == b => return Between::Free { sides, outside },
                0 => return Between::Vertex(apex),
                left => side = if left > 0 { next(across) } else { previous(across) },
            }
        }
    }

    /// Pieces that lead a line over the sample nearest to where it crosses a fixed side, and the fixed side with it if that may be bent.
    fn lead_over(&mut self, side: u32, a: Point, b: Point) -> Vec<[Point; 2]> {
        let (c, d) = (self.point(side), self.point(next(side)));
        let across = self.across(side);
        let is_outline = across == HULL || self.is_outside(side / 3) != self.is_outside(across / 3);
        // Where on the fixed side: part / whole of the way.
        let (part, rest) = (area(a, b, c).abs(), area(a, b, d).abs());
        let whole = part + rest;
        let round = |x: i128, y: i128| (2 * x + y).div_euclid(2 * y);
        let along = |c: i32, d: i32| {
            (i128::from(c) + round(i128::from(d - c) * i128::from(part), i128::from(whole))) as i32
        };
        let p = if is_outline {
            // One of the samples on it.
            let (dx, dy) = (d.0 - c.0, d.1 - c.1);
            let steps = divisor(dx.abs(), dy.abs());
            let k = along(0, steps);
            (c.0 + dx / steps * k, c.1 + dy / steps * k)
        } else {
            let (x, y) = (along(c.0, d.0), along(c.1, d.1));
            let (right, last) = self.points[2];
            match self.border_stays {
                true if right < 2 || last < 2 => c,
                // Where it is another's too, nothing is added.
                true => (x.clamp(1, right - 1), y.clamp(1, last - 1)),
                false => (x, y),
            }
        };
        let mut pieces = vec![[p, b], [a, p]];
        if area(c, d, p) == 0 {
            // A corner of the side, or a sample on it: it stays straight.
            self.insert(p);
            return pieces;
        }
        self.link(side, across, false);
        pieces.extend([[p, d], [c, p]]);
        pieces
    }

    /// Turns the sides that cross a line until it is one, fixes it, and makes the others Delaunay again.
    fn turn_to(&mut self, a: Point, b: Point, sides: Vec<[Point; 2]>) {
        let mut queue = std::collections::VecDeque::from(sides);
        let mut made = vec![];
        // Every side is turned again at most as often as there are sides.
        let mut left = (queue.len() + 1).pow(2) + 16;
        while let Some([c, d]) = queue.pop_front().filter(|_| left > 0) {
            left -= 1;
            let Some(side) = self.side_between(c, d) else { continue };
            let across = self.across(side);
            let (c, d) = (self.point(side), self.point(next(side)));
            let (p, q) = (self.point(previous(side)), self.point(previous(across)));
            // Strictly convex, or turning would make a triangle without an area.
            if area(p, c, q) <= 0 || area(q, d, p) <= 0 {
                queue.push_back([c, d]);
                continue;
            }
            self.flip(side);
            let still = [p, q].iter().all(|&e| e != a && e != b)
                && area(a, b, p).signum() * area(a, b, q).signum() < 0;
            if still { queue.push_back([p, q]) } else { made.push([p, q]) }
        }
        if let Some(side) = self.side_between(a, b) {
            self.fix(side);
        }
        for [p, q] in made {
            if let Some(side) = self.side_between(p, q) {
                self.stack.push(side);
                self.settle();
            }
        }
    }

    /// Makes the sides on the stack Delaunay, and all around those that are turned.
    fn settle(&mut self) {
        while let Some(side) = self.stack.pop() {
            let across = self.across(side);
            if self.is_fixed(side) || across == HULL {
                continue;
            }
            let (p, a) = (self.point(previous(side)), self.point(side));
            let (b, q) = (self.point(next(side)), self.point(previous(across)));
            if self.in_circle(p, a, b, q) {
                self.flip(side);
                for t in [side / 3, across / 3] {
                    self.stack.extend(3 * t..3 * t + 3);
                }
            }
        }
    }

    /// The constrained sides within the valid region, by vertices, the lower first, sorted.
    pub(super) fn inner_constraints(&self) -> Vec<[u32; 2]> {
        let is = |&s: &u32| {
            let across = self.across(s);
            self.is_fixed(s)
                && across != HULL
                && s < across
                && !self.is_outside(s / 3)
                && !self.is_outside(across / 3)
        };
        let ends = |s: u32| {
            let [a, b] = [s, next(s)].map(|s| self.corner[s as usize]);
            [a.min(b), a.max(b)]
        };
        let mut sides: Vec<[u32; 2]> = (0..3 * self.triangles() as u32).filter(is).map(ends).collect();
        sides.sort_unstable();
        sides
    }
}

/// The greatest common divisor; one of the two is not 0.
fn divisor(a: i32, b: i32) -> i32 {
    if b == 0 { a } else { divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Whether sides lead straight from one vertex to another.
    fn leads(mesh: &mut Triangulation, a: Point, b: Point) -> bool {
        let mut at = a;
        while at != b {
            match mesh.between(at, b) {
                Between::Side(_) => at = b,
                Between::Vertex(v) if mesh.side_between(at, v).is_some() => at = v,
                _ => return false,
            }
        }
        true
    }

    fn is_sound(mesh: &Triangulation) {
        let mut whole = 0;
        for t in 0..mesh.triangles() as u32 {
            let [a, b, c] = mesh.corners(t).map(|v| mesh.points[v as usize]);
            assert!(area(a, b, c) > 0);
            whole += area(a, b, c);
            for s in 3 * t..3 * t + 3 {
                let across = mesh.across(s);
                assert!(across == HULL || mesh.across(across) == s);
                assert!(across == HULL || mesh.point(s) == mesh.point(next(across)));
            }
        }
        let last = mesh.points[2];
        assert_eq!(whole, 2 * i64::from(last.0) * i64::from(last.1));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// A single line among any vertices is there, straight; many lines leave a sound triangulation, and those that cross no other are straight.
        #[test]
        fn lines_become_sides(
            points in proptest::collection::vec((0..14i32, 0..14i32), 0..60),
            lines in proptest::collection::vec(((0..14i32, 0..14i32), (0..14i32, 0..14i32)), 1..7),
        ) {
            let start = || {
                let mut mesh = Triangulation::new(14, 14);
                points.iter().for_each(|&p| _ = mesh.insert(p));
                mesh
            };
            let lines: Vec<[Point; 2]> = lines.into_iter().map(|(a, b)| [a, b]).collect();
            for &[a, b] in &lines {
                let mut mesh = start();
                prop_assert_eq!(mesh.constrain_lines(&[[a, b]]), Placed::default());
                is_sound(&mesh);
                prop_assert!(leads(&mut mesh, a, b));
            }
            let mut mesh = start();
            mesh.constrain_lines(&lines);
            is_sound(&mesh);
            // Lines of which no other comes near: what leads others over samples does not touch them.
            let near = |[a, b]: [Point; 2], [c, d]: [Point; 2]| {
                let beside = |p: Point| {
                    let long = i64::from(b.0 - a.0).pow(2) + i64::from(b.1 - a.1).pow(2);
                    area(a, b, p).pow(2) <= 4 * long
                };
                let side = |a, b, p| area(a, b, p).signum();
                beside(c) || beside(d) || side(a, b, c) != side(a, b, d) || a == b
            };
            for (i, &line) in lines.iter().enumerate() {
                if lines.iter().enumerate().all(|(j, &other)| i == j || !near(line, other)) {
                    prop_assert!(leads(&mut mesh, line[0], line[1]));
                }
            }
        }
    }

    #[test]
    fn lines_that_cross_meet_at_the_nearest_sample() {
        let mut mesh = Triangulation::new(12, 9);
        let placed = mesh.constrain_lines(&[[(1, 1), (10, 6)], [(2, 7), (9, 0)]]);
        assert_eq!(placed, Placed { bent: 1, outside: 0 });
        is_sound(&mesh);
        // They cross at (5.6, 3.6).
        for end in [(1, 1), (10, 6), (2, 7), (9, 0)] {
            assert!(leads(&mut mesh, (6, 4), end), "{end:?}");
        }
        assert_eq!(mesh.inner_constraints().len(), 4);
    }
}
