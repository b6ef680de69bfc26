//! Planar polygons with holes and pieces, on the two-sided plane: bounded or not, before the eye or behind it.

use super::exact::{OnLine, crossing, det3, side, side3, turn};
use super::join::{Chain, End, Node, Whole, chains, follow, next};
use glam::{DVec3, DVec4};
use std::cmp::Ordering;

/// From a plane's coordinates `[x, y, w]` to space's: x * `x` + y * `y` + w * `w`, three homogeneous points.
///
/// Attributes that are linear on the plane are maps of the same kind, and need no interpolation at the cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneMap {
    /// The image of `[1, 0, 0]`.
    pub x: DVec4,
    /// The image of `[0, 1, 0]`.
    pub y: DVec4,
    /// The image of the origin, `[0, 0, 1]`.
    pub w: DVec4,
}

impl PlaneMap {
    /// A point of the plane in space.
    pub fn point(&self, p: DVec3) -> DVec4 {
        self.x * p.x + self.y * p.y + self.w * p.z
    }

    /// The line in which a plane of space cuts this one, positive where the plane is.
    pub fn line(&self, plane: DVec4) -> DVec3 {
        DVec3::new(side(plane, self.x), side(plane, self.y), side(plane, self.w))
    }
}

/// Cycles of points `[x, y, w]` of a plane, with the inside on the left (seen with x to the right and y up): outer ones
/// counter-clockwise, holes clockwise, any number of both. Edges are disjoint, but may share ends; an edge is less than half a turn of the two-sided
/// plane, so of the two segments between its ends, the one without sign changes of w if both have the same.
///
/// A polygon without cycles is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygon {
    points: Vec<DVec3>,
    /// Where each cycle ends in `points`.
    ends: Vec<u32>,
}

impl Polygon {
    /// A polygon of these cycles; those of fewer than three points are left out.
    pub fn new<C: AsRef<[DVec3]>>(cycles: impl IntoIterator<Item = C>) -> Polygon {
        let mut polygon = Polygon::default();
        for cycle in cycles {
            polygon.push(cycle.as_ref());
        }
        polygon
    }

    fn push(&mut self, cycle: &[DVec3]) {
        let room = self.points.len().saturating_add(cycle.len()) < u32::MAX as usize;
        if cycle.len() >= 3 && room {
            self.points.extend_from_slice(cycle);
            self.ends.push(self.points.len() as u32);
        }
    }

    /// Its cycles.
    pub fn cycles(&self) -> impl ExactSizeIterator<Item = &[DVec3]> {
        (0..self.ends.len()).map(|k| {
            let (from, to) = self.range(k);
            &self.points[from as usize..to as usize]
        })
    }

    /// True if there is nothing of it.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    fn range(&self, k: usize) -> (u32, u32) {
        (if k == 0 { 0 } else { self.ends[k - 1] }, self.ends[k])
    }

    /// The part on the open positive sides of all planes of space, which `map` puts the polygon into.
    ///
    /// First the trivial cases: all vertices outside of one plane, or inside of all; only planes that have vertices on
    /// both sides are cut by. (An unbounded polygon without a vertex outside of a plane may still be cut by it; then it is.)
    pub fn clip_in(&self, planes: &[DVec4], map: &PlaneMap) -> Polygon {
        let mut polygon = self.clone();
        for &plane in planes {
            let line = map.line(plane);
            if line == DVec3::ZERO {
                // It lies in the plane. (A parallel one has the line at infinity.)
                return Polygon::default();
            }
            polygon = polygon.clip(line);
        }
        polygon
    }

    /// The part on the open positive side of a line. O(n + m log m) for n vertices and m places where they cross it.
    ///
    /// Which vertices are on the line, and the order of the places along it, are decided exactly.
    pub fn clip(&self, line: DVec3) -> Polygon {
        let sides: Vec<f64> = self.points.iter().map(|&p| side3(line, p)).collect();
        let mut out = Polygon::default();
        let (mut found, mut cycle_of) = (Vec::new(), Vec::new());
        for k in 0..self.ends.len() {
            let (from, to) = self.range(k);
            match chains(from, to, &sides, &mut found) {
                Whole::Inside => out.push(&self.points[from as usize..to as usize]),
                Whole::Outside => {}
                Whole::Cut => cycle_of.resize(found.len(), (from, to)),
            }
        }
        if found.is_empty() {
            if self.has_line_inside(line, &sides) {
                out.push(&whole_line(line));
            }
            return out;
        }
        Cut { polygon: self, line, sides: &sides, chains: &found, cycle_of: &cycle_of }.join(&mut out);
        out
    }

    /// True if what lies just on the positive side of a line that cuts no cycle is inside.
    ///
    /// The cycles on that side decide it alone; to them all of the other side is one place. If there are none, the others do, to which all of the
    /// positive side is one place. Of that a point far from the line is looked at: one on it would be rounded to one of its sides, and edges may lie
    /// along it.
    fn has_line_inside(&self, line: DVec3, sides: &[f64]) -> bool {
        let cycles = || (0..self.ends.len()).map(|k| self.range(k));
        let positive = |&(from, _): &(u32, u32)| sides[from as usize] > 0.0;
        let side = cycles().any(|c| positive(&c));
        let deciding = || cycles().filter(|c| positive(c) == side);
        let [u, n, v] = frame(line);
        let far = if side { -n } else { n };
        // Another point is tried where a vertex lies in the way.
        for k in 0..32 {
            let (sin, cos) = (k as f64 * 2.399_963 + 0.1).sin_cos();
            let p = far + u * cos + v * sin;
            for (from, to) in deciding().take(2) {
                let edge = from + k % (to - from);
                if let Some(inside) = self.is_inside(p, edge, next(edge, from, to), deciding()) {
                    return inside;
                }
            }
        }
        false
    }

    /// True if `p` is inside of `cycles`, by the way from it to the middle of an edge of theirs; `None` if that way meets a vertex.
    ///
    /// A point and one just left of an edge are on the same side of the boundary if an even number of edges is between them.
    fn is_inside(&self, p: DVec3, a: u32, b: u32, cycles: impl Iterator<Item = (u32, u32)>) -> Option<bool> {
        let at = |i: u32| self.points[i as usize];
        let m = at(a).try_normalize()? + at(b).try_normalize()?;
        let left = det3(at(a), at(b), p);
        let mut inside = if left == 0.0 { return None } else { left > 0.0 };
        for (from, to) in cycles {
            for c in (from..to).filter(|&c| c != a) {
                let d = next(c, from, to);
                let ends = [det3(p, m, at(c)), det3(p, m, at(d))];
                if ends.contains(&0.0) {
                    return None;
                }
                if (ends[0] > 0.0) == (ends[1] > 0.0) {
                    continue;
                }
                let way = [det3(at(c), at(d), p), det3(at(c), at(d), m)];
                if way.contains(&0.0) {
                    return None;
                }
                // Great circles meet twice; they do so here, and not on the other side, if these agree.
                let here = (way[0] > 0.0) != (way[1] > 0.0) && (ends[0] > 0.0) == (way[1] > 0.0);
                inside ^= here;
            }
        }
        Some(inside)
    }
}

/// Unit vectors u, n, v, square to each other: n along `line`, and u to v about it the way that has the positive side on the left.
fn frame(line: DVec3) -> [DVec3; 3] {
    let n = (line / line.abs().max_element()).normalize_or(DVec3::Z);
    let u = n.any_orthonormal_vector();
    [u, n, n.cross(u)]
}

/// A line as a cycle, with its positive side on the left.
fn whole_line(line: DVec3) -> [DVec3; 3] {
    let [u, _, v] = frame(line);
    let half = 0.75_f64.sqrt();
    [u, -0.5 * u + half * v, -0.5 * u - half * v]
}

/// A polygon under the knife.
struct Cut<'a> {
    polygon: &'a Polygon,
    line: DVec3,
    sides: &'a [f64],
    chains: &'a [Chain],
    /// First and past the last vertex of each chain's cycle.
    cycle_of: &'a [(u32, u32)],
}

impl Cut<'_> {
    fn at(&self, i: u32) -> DVec3 {
        self.polygon.points[i as usize]
    }

    fn after(&self, chain: u32, i: u32) -> u32 {
        let (from, to) = self.cycle_of[chain as usize];
        next(i, from, to)
    }

    fn place(&self, chain: u32, node: Node) -> OnLine {
        match node {
            Node::Vertex(i) => OnLine::Vertex(self.at(i)),
            Node::Edge(i) => OnLine::Crossing(self.at(i), self.at(self.after(chain, i))),
        }
    }

    fn node(&self, end: &End) -> Node {
        let chain = &self.chains[end.chain as usize];
        if end.start { chain.start } else { chain.end }
    }

    fn end(&self, end: &End) -> OnLine {
        self.place(end.chain, self.node(end))
    }

    /// The order along the line, as the angle from `origin`; ends at one place clockwise.
    fn order(&self, origin: &OnLine, a: &End, b: &End) -> Ordering {
        let (p, q) = (self.end(a), self.end(b));
        let late = |x: &OnLine| {
            let t = turn(self.line, origin, x);
            t < 0.0 || t == 0.0 && origin.rounded(self.line).dot(x.rounded(self.line)) < 0.0
        };
        late(&p).cmp(&late(&q)).then_with(|| {
            let t = turn(self.line, &p, &q);
            if t != 0.0 {
                return 0.0_f64.total_cmp(&t);
            }
            // At one place: by the vertices that the chains come from or go to, those to the left first.
            let inner = |e: &End| {
                let chain = &self.chains[e.chain as usize];
                self.at(if e.start { chain.first } else { chain.last })
            };
            match (p, q) {
                (OnLine::Vertex(v), _) | (_, OnLine::Vertex(v)) => {
                    let t = det3(v, inner(a), inner(b));
                    if t == 0.0 { Ordering::Equal } else { t.total_cmp(&0.0) }
                }
                _ => Ordering::Equal,
            }
        })
    }

    fn rounded(&self, chain: u32, node: Node) -> DVec3 {
        match node {
            Node::Vertex(i) => self.at(i),
            Node::Edge(i) => {
                let j = self.after(chain, i);
                crossing(self.at(i), self.sides[i as usize], self.at(j), self.sides[j as usize])
            }
        }
    }

    fn join(&self, out: &mut Polygon) {
        let origin = self.end(&End { chain: 0, start: true });
        let following = follow(self.chains, |a, b| self.order(&origin, a, b));
        let mut done = vec![false; self.chains.len()];
        let mut cycle = Vec::new();
        for first in 0..self.chains.len() as u32 {
            cycle.clear();
            let mut c = first;
            while !std::mem::replace(&mut done[c as usize], true) {
                let chain = self.chains[c as usize];
                cycle.push(self.rounded(c, chain.start));
                let mut i = chain.first;
                cycle.push(self.at(i));
                while i != chain.last {
                    i = self.after(c, i);
                    cycle.push(self.at(i));
                }
                let to = following[c as usize];
                self.bridge(c, to, &mut cycle);
                c = to;
            }
            out.push(&cycle);
        }
    }

    /// The end of chain `c`, if it is not where chain `to` starts, and points between if the way there is half a turn or more.
    fn bridge(&self, c: u32, to: u32, cycle: &mut Vec<DVec3>) {
        let (end, start) = (self.chains[c as usize].end, self.chains[to as usize].start);
        let (p, q) = (self.place(c, end), self.place(to, start));
        let (v, w) = (self.rounded(c, end), self.rounded(to, start));
        let t = turn(self.line, &p, &q);
        let [_, n, _] = frame(self.line);
        let (v_, w_) = (v.normalize_or_zero(), w.normalize_or_zero());
        if t == 0.0 && v.dot(w) > 0.0 {
            let clockwise = self.order(&p, &End { chain: c, start: false }, &End { chain: to, start: true });
            if clockwise != Ordering::Greater {
                return;
            }
            // All the way round.
            let ahead = n.cross(v_);
            cycle.extend([v, -0.5 * v_ + ahead, -0.5 * v_ - ahead]);
            return;
        }
        cycle.push(v);
        if t == 0.0 {
            cycle.push(n.cross(v_));
        } else if t < 0.0 {
            // Between the antipodes.
            cycle.push(-(v_ + w_));
        }
    }
}
