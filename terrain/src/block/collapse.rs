//! Half-edge collapses, the cheapest first by the exact error of the triangles that come of it (Hoppe 1998).

use super::NONE;
use super::history::History;
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
    /// The radius of a sphere about `kept` for which the bound holds, in steps by a column.
    pub radius: f32,
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
}

impl Rules {
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
    /// Something around it changed since the goal was found.
    stale: Vec<bool>,
    mark: Vec<u32>,
    stamp: u32,
    ring: Ring,
    other: Ring,
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
    let history = History::new(&mut sheet, rules.scale);
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
        stale: vec![false; n],
        mark: vec![0; n],
        stamp: 0,
        ring: Ring::default(),
        other: Ring::default(),
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
        let (mut room, mut inner) = ([vec![], vec![]], vec![]);
        while collapses.len() < most {
            let Some(Reverse((cost, _, u))) = self.queue.pop() else { break };
            if self.surface.at[u as usize] == NONE || self.goal[u as usize] == NONE {
                continue;
            }
            if self.stale[u as usize] && !self.evaluate(u, Some(cost)) {
                continue;
            }
            collapses.push(self.commit(u, (&mut room, &mut inner)));
        }
        collapses
    }

    /// Makes the collapse that `u` waits for.
    fn commit(&mut self, u: u32, (room, inner): (&mut [Vec<Vertex>; 2], &mut Vec<(u32, usize)>)) -> Collapse {
        let v = self.goal[u as usize];
        let mut ring = std::mem::take(&mut self.ring);
        self.surface.ring(u, &mut ring);
        // The goal was found on this very ring.
        let i = ring.neighbours.iter().position(|&n| n == v).unwrap_or(0);
        History::inner(&ring, i, inner);
        let wings = self.surface.collapse(u, i, &ring);
        let dying = wings.into_iter().flatten().map(|w| w.side / 3);
        let way = self.history.distance(self.vertices[u as usize], self.vertices[v as usize]);
        let j = self.history.begin(u, v, dying, way);
        let [from, to] = [u, v].map(|v| self.vertices[v as usize]);
        self.history.measure_gone(self.relief, to, inner, j, room);
        self.history.bury(wings, from, to);
        for &side in &ring.sides {
            if self.surface.corner[side as usize] != NONE {
                self.history.measure_face(self.relief, &self.surface, self.vertices, side, j, room);
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
            if self.goal[n as usize] != NONE {
                self.stale[n as usize] = true;
            } else {
                self.evaluate(n, None);
            }
        }
        self.ring = ring;
        let [bound, radius] = self.history.bound(j);
        Collapse {
            kept: v,
            removed: u,
            wings: wings.map(|w| w.map_or(NONE, |w| w.side)),
            beside: wings.map(|w: Option<Wing>| w.map_or([NONE; 2], |w| [w.kept, w.removed])),
            bound,
            radius,
        }
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
        let (mut best, mut found) = ((f64::INFINITY, u32::MAX), NONE);
        // What was the best before is so again more often than not, and spares most of the work for the others.
        let first = ring.neighbours.iter().position(|&n| n == before).unwrap_or(0);
        let n = ring.neighbours.len();
        for i in (first..n).chain(0..first) {
            if let Some(cost) = self.cost(u, i, &ring, best.0)
                && (cost, ring.neighbours[i]) < (best, found)
            {
                (best, found) = (cost, ring.neighbours[i]);
                if found == before && known.is_some_and(|k| (cost.0 as f32).to_bits() <= k) {
                    self.goal[u as usize] = found;
                    self.other = ring;
                    return true;
                }
            }
        }
        self.other = ring;
        if found != NONE {
            self.goal[u as usize] = found;
            self.queue.push(Reverse(((best.0 as f32).to_bits(), best.1, u)));
        }
        false
    }

    /// Error and squared length of taking `u` to its neighbour number `i`; `None` if that is not legal, or dearer than `enough`.
    fn cost(&self, u: u32, i: usize, ring: &Ring, enough: f64) -> Option<(f64, u32)> {
        let v = ring.neighbours[i];
        let (at, to) = (self.vertices[u as usize], self.vertices[v as usize]);
        let n = ring.neighbours.len();
        if self.kind[v as usize] == Kind::Locked {
            return None;
        }
        let wings = if ring.border && (i == 0 || i == n - 1) { 1 } else { 2 };
        if ring.border {
            // Along the border only, and straight on.
            let other = self.vertices[ring.neighbours[if i == 0 { n - 1 } else { 0 }] as usize];
            if wings == 2 || area((other.x, other.y), (at.x, at.y), (to.x, to.y)) != 0 {
                return None;
            }
        }
        let place = |k: usize| self.vertices[ring.neighbours[k % n] as usize];
        let faces = ring.sides.len();
        let others = || (0..faces).filter(|&k| k != i && (k + 1) % n != i);
        let mut most = 0.0f64;
        for k in others() {
            let (b, c) = (place(k), place(k + 1));
            if area((to.x, to.y), (b.x, b.y), (c.x, c.y)) <= 0 {
                return None;
            }
            most = most.max(self.relief.error([to, b, c], enough));
            if most > enough {
                return None;
            }
        }
        // Last, as most are too dear.
        if !self.links(v, wings, ring.sides.len()) {
            return None;
        }
        let (dx, dy) = (i64::from(to.x - at.x), i64::from(to.y - at.y));
        Some((most, u32::try_from(dx * dx + dy * dy).unwrap_or(u32::MAX)))
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
