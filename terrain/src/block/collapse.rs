//! Half-edge collapses, the cheapest first by the exact error of the triangles that come of it (Hoppe 1998).

use super::NONE;
use super::history::{Forms, History, up};
use super::relief::Relief;
use super::sheet::{Sheet, Vertex};
use super::surface::{Ring, Surface, Wing, next, previous};
use crate::tin::scan::area;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A collapse of a block: a vertex that went, and onto which. Vertices and faces are numbered as in the sheet that the block began with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collapse {
    /// The vertex that stayed.
    pub kept: u32,
    /// The vertex that went.
    pub removed: u32,
    /// The faces that went, to the left and to the right of the way from `kept` to `removed`: the side between the two, as `3 * face + corner at which it begins`;
    /// [`NONE`] at a border.
    pub wings: [u32; 2],
    /// For each of them the side across its side at `kept`, and that across its side at `removed`; [`NONE`] at a border.
    pub beside: [[u32; 2]; 2],
    /// The bound of its split; see the [module](super). Never less than that of a split that needs it.
    pub bound: f32,
    /// The radius of a sphere about `kept` for which the bound holds, and which holds the faces of the finest mesh around all vertices that come of it, in steps by a column. Those of splits below it lie
    /// within, also when they are rounded to 8 bits of mantissa, as they are already.
    pub radius: f32,
    /// The least cosine of the angle between up and a normal of these faces.
    pub upright: f32,
}

/// How far a block is simplified, and what stays.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// First and last column, first and last row of samples.
    pub rectangle: [i32; 4],
    /// Whether neighbours share the vertices on these four lines: they are left alone then.
    pub shared: [bool; 4],
    /// Stop at so many vertices.
    pub vertices: usize,
    /// How long a step by a row and a unit of height are, in steps by a column.
    pub scale: [f64; 2],
    /// By so much the radius of a split is larger than what it has to hold.
    pub slack: f64,
}

impl Rules {
    /// For a block of so many vertices: a quarter stays for the level above, and at the root what must.
    pub(super) fn for_part(self, vertices: usize) -> Rules {
        Rules { vertices: if self.shared == [false; 4] { 0 } else { vertices / 4 }, ..self }
    }

    fn is_shared(&self, v: Vertex) -> bool {
        let at = [v.x, v.x, v.y, v.y];
        (0..4).any(|k| self.shared[k] && at[k] == self.rectangle[k])
    }
}

/// What may happen to a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Free,
    /// It stays, but others may go there: corners of the outline.
    Corner,
    /// It stays, and nothing goes there: shared with another block, or singular.
    Locked,
}

/// No vertex gets more neighbours.
const VALENCE: usize = 20;

/// A candidate: bits of its cost, then the square of its length, then the vertex. All costs are positive, so bits are in their order.
type Candidate = Reverse<(u32, u32, u32)>;

struct Work<'a> {
    relief: &'a Relief,
    vertices: &'a [Vertex],
    surface: Surface,
    kind: Vec<Kind>,
    history: History,
    queue: BinaryHeap<Candidate>,
    /// Where each vertex would go; [`NONE`] for nowhere.
    goal: Vec<u32>,
    /// The error of what would come of it.
    price: Vec<f32>,
    /// Something around it changed since the goal was found.
    stale: Vec<bool>,
    mark: Vec<u32>,
    stamp: u32,
    ring: Ring,
    other: Ring,
    star: Star,
    /// Where vertices must not go as long as nothing around them changes, as some face would turn over in some order of refinement: for each where its list begins, and the lists.
    barred: Vec<u32>,
    bars: Vec<(u32, u32)>,
}

/// The ring of a vertex as seen from it. Of a closed ring everything is there twice in a row, so that the faces that stay are one run wherever that begins.
#[derive(Clone, Debug, Default)]
struct Star {
    /// Columns and rows from the vertex to its neighbours.
    at: Vec<[i64; 2]>,
    /// Twice the areas of the faces, each with the neighbour at which it begins.
    areas: Vec<i64>,
    /// Heights of the neighbours.
    heights: Vec<f64>,
    /// What it takes at least to go to a neighbour, which, and the face over the vertex then.
    ways: Vec<(f64, usize, usize)>,
}

/// What collapsing a block gave.
pub(super) struct Collapsed {
    pub collapses: Vec<Collapse>,
    /// The vertices and faces left, by their numbers before.
    pub vertices: Vec<u32>,
    pub faces: Vec<u32>,
    pub sheet: Sheet,
}

/// Collapses edges of a sheet until it has few enough vertices, or nothing is left to do. `None` if its triangles are no surface.
///
/// O(n log n) for n vertices, and the samples of the triangles looked at.
pub(super) fn collapse(mut sheet: Sheet, relief: &Relief, rules: &Rules) -> Option<Collapsed> {
    let history = History::new(&mut sheet, rules.scale, rules.slack);
    let n = sheet.vertices.len();
    let surface = Surface::new(&sheet.faces, n)?;
    let mut work = Work {
        relief,
        kind: vec![Kind::Free; n],
        vertices: &sheet.vertices,
        surface,
        history,
        queue: BinaryHeap::with_capacity(n),
        goal: vec![NONE; n],
        price: vec![0.0; n],
        stale: vec![false; n],
        mark: vec![0; n],
        stamp: 0,
        ring: Ring::default(),
        other: Ring::default(),
        star: Star::default(),
        barred: vec![NONE; n],
        bars: vec![],
    };
    work.classify(&sheet.faces, rules);
    let collapses = work.run(n.saturating_sub(rules.vertices));
    let Work { surface, history, .. } = work;
    let vertices: Vec<u32> = (0..n as u32).filter(|&v| surface.at[v as usize] != NONE).collect();
    let faces: Vec<u32> =
        (0..sheet.faces.len() as u32).filter(|&f| surface.corner[3 * f as usize] != NONE).collect();
    let mut new = vec![NONE; n];
    vertices.iter().zip(0..).for_each(|(&v, k)| new[v as usize] = k);
    let mut left = Sheet {
        vertices: vertices.iter().map(|&v| sheet.vertices[v as usize]).collect(),
        faces: faces
            .iter()
            .map(|&f| [0, 1, 2].map(|k| new[surface.corner[(3 * f + k) as usize] as usize]))
            .collect(),
        ..Sheet::default()
    };
    history.hand_over(&vertices, &faces, &mut left);
    Some(Collapsed { collapses, vertices, faces, sheet: left })
}

/// Twice the area of a triangle from the origin to two places.
#[inline]
fn cross(a: [i64; 2], b: [i64; 2]) -> i64 {
    a[0] * b[1] - a[1] * b[0]
}

impl Work<'_> {
    fn classify(&mut self, faces: &[[u32; 3]], rules: &Rules) {
        let n = self.vertices.len();
        let mut count = vec![0u32; n];
        faces.as_flattened().iter().for_each(|&v| count[v as usize] += 1);
        let mut ring = Ring::default();
        for v in 0..n as u32 {
            let at = self.vertices[v as usize];
            if self.surface.at[v as usize] == NONE || rules.is_shared(at) {
                self.kind[v as usize] = Kind::Locked;
                continue;
            }
            self.surface.ring(v, &mut ring);
            if ring.sides.len() != count[v as usize] as usize {
                self.kind[v as usize] = Kind::Locked;
            } else if let (true, &[first, .., last]) = (ring.border, &ring.neighbours[..]) {
                let [p, q] = [first, last].map(|v| self.vertices[v as usize]);
                if area((p.x, p.y), (at.x, at.y), (q.x, q.y)) != 0 {
                    self.kind[v as usize] = Kind::Corner;
                }
            }
        }
    }

    fn run(&mut self, most: usize) -> Vec<Collapse> {
        for u in 0..self.vertices.len() as u32 {
            self.evaluate(u, None);
        }
        let mut collapses = vec![];
        let (mut forms, mut inner) = (Forms::default(), vec![]);
        while collapses.len() < most {
            let Some(Reverse((cost, _, u))) = self.queue.pop() else { break };
            if self.surface.at[u as usize] == NONE || self.goal[u as usize] == NONE {
                continue;
            }
            if self.stale[u as usize] && !self.evaluate(u, Some(cost)) {
                continue;
            }
            match self.commit(u, (&mut forms, &mut inner)) {
                Some(collapse) => collapses.push(collapse),
                // Elsewhere, perhaps.
                None => {
                    let v = std::mem::replace(&mut self.goal[u as usize], NONE);
                    let list = std::mem::replace(&mut self.barred[u as usize], self.bars.len() as u32);
                    self.bars.push((v, list));
                    self.evaluate(u, None);
                }
            }
        }
        collapses
    }

    /// Makes the collapse that `u` waits for, unless a face would turn over in some order of refinement.
    fn commit(&mut self, u: u32, (forms, inner): (&mut Forms, &mut Vec<(u32, usize)>)) -> Option<Collapse> {
        let v = self.goal[u as usize];
        let mut ring = std::mem::take(&mut self.ring);
        self.surface.ring(u, &mut ring);
        // The goal was found on this very ring.
        let i = ring.neighbours.iter().position(|&n| n == v).unwrap_or(0);
        History::inner(&ring, i, inner);
        let surface = (&self.surface, self.vertices);
        if !self.history.propose(surface, (u, i), (&ring, inner), forms) {
            self.ring = ring;
            return None;
        }
        let j = self.history.accept(self.relief, self.vertices, [u, v], self.price[u as usize], forms);
        let wings = self.surface.collapse(u, i, &ring);
        let [from, to] = [u, v].map(|v| self.vertices[v as usize]);
        self.history.bury(wings, from, to);
        for &side in &ring.sides {
            if self.surface.corner[side as usize] != NONE {
                self.history.note(side, from, j);
            }
        }
        for side in wings.into_iter().flatten().flat_map(|w| [w.kept, w.removed]) {
            if side != NONE {
                self.history.joined[side as usize] = j;
            }
        }
        self.goal[u as usize] = NONE;
        // What has a goal is looked at again when its turn comes, what has none at once: it may have one now.
        for &n in ring.neighbours.iter().chain([&v]) {
            self.barred[n as usize] = NONE;
            if self.goal[n as usize] != NONE {
                self.stale[n as usize] = true;
            } else {
                self.evaluate(n, None);
            }
        }
        self.ring = ring;
        let [bound, radius, upright] = self.history.bounds(v, j);
        Some(Collapse {
            kept: v,
            removed: u,
            wings: wings.map(|w| w.map_or(NONE, |w| w.side)),
            beside: wings.map(|w: Option<Wing>| w.map_or([NONE; 2], |w| [w.kept, w.removed])),
            bound,
            radius,
            upright,
        })
    }

    /// Finds where `u` goes at the least cost, and puts it into the queue. But if it still goes where it was to go for at most `known`, bits of the cost that is the least of all, it
    /// may at once: returns true then.
    fn evaluate(&mut self, u: u32, known: Option<u32>) -> bool {
        self.stale[u as usize] = false;
        let before = std::mem::replace(&mut self.goal[u as usize], NONE);
        if self.kind[u as usize] != Kind::Free || self.surface.at[u as usize] == NONE {
            return false;
        }
        let mut ring = std::mem::take(&mut self.other);
        self.surface.ring(u, &mut ring);
        self.stamp += 1;
        ring.neighbours.iter().for_each(|&n| self.mark[n as usize] = self.stamp);
        self.look(u, &ring);
        let at_once = self.choose(u, before, known, &ring);
        self.other = ring;
        at_once
    }

    /// As [`Work::evaluate`], with its ring looked at.
    fn choose(&mut self, u: u32, before: u32, known: Option<u32>, ring: &Ring) -> bool {
        let (mut best, mut found) = ((f64::INFINITY, u32::MAX), NONE);
        // What was the best before is so again more often than not, and spares most of the work for the others.
        let first = ring.neighbours.iter().position(|&n| n == before);
        if let Some(i) = first
            && let Some((_, over)) = self.least(u, i, ring)
            && let Some(cost) = self.cost(u, (i, over), ring, (best, found))
        {
            (best, found) = (cost, before);
            if known.is_some_and(|k| (cost.0 as f32).to_bits() <= k) {
                self.goal[u as usize] = found;
                self.price[u as usize] = up(cost.0);
                return true;
            }
        }
        // The others by what they cost at least: most need not be measured.
        let mut ways = std::mem::take(&mut self.star.ways);
        ways.clear();
        for i in (0..ring.neighbours.len()).filter(|&i| Some(i) != first) {
            let least = self.least(u, i, ring).filter(|(least, _)| *least <= best.0);
            ways.extend(least.map(|(least, over)| (least, i, over)));
        }
        ways.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for &(least, i, over) in &ways {
            if least > best.0 {
                break;
            }
            if let Some(cost) = self.cost(u, (i, over), ring, (best, found)) {
                (best, found) = (cost, ring.neighbours[i]);
            }
        }
        self.star.ways = ways;
        if found != NONE {
            self.goal[u as usize] = found;
            self.price[u as usize] = up(best.0);
            self.queue.push(Reverse(((best.0 as f32).to_bits(), best.1, u)));
        }
        false
    }

    /// Looks at the ring of `u` from there.
    fn look(&mut self, u: u32, ring: &Ring) {
        let here = self.vertices[u as usize];
        let Star { at, areas, heights, .. } = &mut self.star;
        at.clear();
        heights.clear();
        for &n in &ring.neighbours {
            let v = self.vertices[n as usize];
            at.push([i64::from(v.x) - i64::from(here.x), i64::from(v.y) - i64::from(here.y)]);
            heights.push(f64::from(v.z));
        }
        if !ring.border {
            at.extend_from_within(..);
            heights.extend_from_within(..);
        }
        areas.clear();
        areas.extend(at.windows(2).map(|w| cross(w[0], w[1])));
    }

    /// The faces that stay when `u` goes to neighbour number `i`: the first and how many follow it, counted on around a closed ring.
    #[inline]
    fn staying(ring: &Ring, i: usize) -> (usize, usize) {
        let faces = ring.sides.len();
        // Those behind the one that begins at the neighbour, and before the one that ends there.
        match (ring.border, i) {
            (true, 0) => (1, faces.saturating_sub(1)),
            (true, _) => (0, faces.saturating_sub(1)),
            (false, _) => (i + 1, faces.saturating_sub(2)),
        }
    }

    /// Whether `u` must not go to `v` for the time being.
    fn is_barred(&self, u: u32, v: u32) -> bool {
        let mut at = self.barred[u as usize];
        while let Some(&(to, next)) = self.bars.get(at as usize) {
            if to == v {
                return true;
            }
            at = next;
        }
        false
    }

    /// The error at `u` itself if it goes to its neighbour number `i`, and the face it lies in then; `None` if it must not, as far as faces tell that.
    fn least(&self, u: u32, i: usize, ring: &Ring) -> Option<(f64, usize)> {
        let v = ring.neighbours[i];
        if self.kind[v as usize] == Kind::Locked || self.is_barred(u, v) {
            return None;
        }
        let Star { at, areas, heights, .. } = &self.star;
        let to = at[i];
        let n = ring.neighbours.len();
        // Along the border only, and straight on.
        if ring.border && ((i > 0 && i < n - 1) || cross(at[n - 1 - i], to) != 0) {
            return None;
        }
        let (first, count) = Self::staying(ring, i);
        let mut over = None;
        let (ends, own) = (at.get(first..=first + count)?, areas.get(first..first + count)?);
        let mut c = cross(to, ends[0]);
        for (k, (end, &face)) in ends[1..].iter().zip(own).enumerate() {
            // Weights are the areas opposite the corners.
            let (b, next) = (c, cross(to, *end));
            c = next;
            let area = face + b - c;
            if area <= 0 {
                return None;
            }
            // The vertex lies in this face.
            if b >= 0 && c <= 0 {
                over = Some((k, b, c, area));
            }
        }
        let (k, b, c, area) = over.unwrap_or((0, 0, 0, 1));
        let k = first + k;
        let mut least = 0.0;
        if over.is_some() {
            let sum = areas[k] as f64 * heights[i] - c as f64 * heights[k] + b as f64 * heights[k + 1];
            least = (sum / area as f64 - f64::from(self.vertices[u as usize].z)).abs();
        }
        Some((least, k))
    }

    /// Error and squared length of taking `u` to its neighbour number `i`, where faces allow that; `None` if it is not legal, or not less than what is known. `over` is the face that
    /// it then lies in.
    fn cost(
        &self,
        u: u32,
        (i, over): (usize, usize),
        ring: &Ring,
        known: ((f64, u32), u32),
    ) -> Option<(f64, u32)> {
        let v = ring.neighbours[i];
        let n = ring.neighbours.len();
        let (at, to) = (self.vertices[u as usize], self.vertices[v as usize]);
        let enough = known.0.0;
        let mut most = 0.0f64;
        let (first, count) = Self::staying(ring, i);
        // The face over the vertex is the likeliest to be too far off.
        for k in std::iter::once(over).chain((first..first + count).filter(|&k| k != over)).take(count) {
            let corner = |k: usize| self.vertices[ring.neighbours[if k >= n { k - n } else { k }] as usize];
            most = most.max(self.relief.error([to, corner(k), corner(k + 1)], enough));
            if most > enough {
                return None;
            }
        }
        let (dx, dy) = (i64::from(to.x - at.x), i64::from(to.y - at.y));
        let cost = (most, u32::try_from(dx * dx + dy * dy).unwrap_or(u32::MAX));
        // Last, as most are too dear.
        let wings = if ring.border { 1 } else { 2 };
        ((cost, v) < known && self.links(v, wings, ring.sides.len())).then_some(cost)
    }

    /// The link condition: `v` and the marked vertex have no neighbours in common but the tips of their faces. Also the limit of neighbours.
    fn links(&self, v: u32, wings: usize, faces: usize) -> bool {
        let first = self.surface.at[v as usize];
        let (mut common, mut own, mut s) = (0, 0, first);
        let mut see = |n: u32| common += usize::from(self.mark[n as usize] == self.stamp);
        loop {
            own += 1;
            see(self.surface.corner[next(s) as usize]);
            let before = previous(s);
            s = self.surface.across[before as usize];
            if s == NONE {
                see(self.surface.corner[before as usize]);
                break;
            }
            if s == first {
                break;
            }
        }
        common == wings && (own + faces <= VALENCE + 2 * wings || own <= 6)
    }
}
