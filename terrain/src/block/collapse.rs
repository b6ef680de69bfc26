//! Half-edge collapses, the cheapest first, about, by the exact error of the triangles that come of it (Hoppe 1998).

use super::NONE;
use super::history::{Forms, History, up};
use super::relief::{Gauge, Relief};
use super::sheet::{Sheet, Vertex};
use super::surface::{Ring, Surface, Wing};
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

/// What a collapse may make of a vertex's neighbours, but for regular rings, which add few.
const VALENCE: u32 = 20;

/// Faces looked at together.
const LANES: usize = 4;

/// Parts along each side of a block. What is known of a whole one is some 5 MB: more than a core's own cache holds.
const PARTS: usize = 4;
/// In each part in turn goes what costs at most so much times the least of all. On windows of Grand Canyon, ETOPO5 and a generated landscape meshes of the same error have within 1 % as many faces as
/// where the cheapest of all is always the next.
const STEP: f32 = 1.25;

/// A candidate: bits of its cost, then the square of its length, then the vertex. All costs are positive, so bits are in their order.
type Candidate = Reverse<(u32, u32, u32)>;

struct Work<'a> {
    gauge: Gauge<'a>,
    vertices: &'a [Vertex],
    surface: Surface,
    kind: Vec<Kind>,
    history: History,
    /// Candidates by parts of the block: those of a part are worked on together, so that what lies around them stays in the processor's cache.
    queues: Vec<BinaryHeap<Candidate>>,
    /// The part that each vertex lies in.
    part: Vec<u8>,
    /// Where each vertex would go; [`NONE`] for nowhere.
    goal: Vec<u32>,
    /// The error of what would come of it.
    price: Vec<f32>,
    /// Something around it changed since the goal was found.
    stale: Vec<bool>,
    /// How many faces each has.
    fan: Vec<u32>,
    ring: Ring,
    other: Ring,
    star: Star,
    /// Where vertices must not go as long as nothing around them changes, as some face would turn over in some order of refinement: for each where its list begins, and the lists.
    barred: Vec<u32>,
    bars: Vec<(u32, u32)>,
}

/// The ring of a vertex as seen from it; of a closed ring the first neighbour comes once more at the end. The last is repeated, with faces of no area, until there are whole groups of [`LANES`] faces. Columns and rows are whole numbers, and so small that products of two are exact.
#[derive(Clone, Debug, Default)]
struct Star {
    /// Columns and rows from the vertex to its neighbours.
    x: Vec<f64>,
    y: Vec<f64>,
    /// Heights of the neighbours.
    z: Vec<f64>,
    /// Twice the areas of the faces, each with the neighbour at which it begins.
    areas: Vec<f64>,
    /// Twice the areas of the triangles from the neighbour last looked at over the vertex to the others.
    beside: Vec<f64>,
    ways: Vec<Way>,
    /// No sample but the vertex lies between the neighbours.
    alone: bool,
}

impl Star {
    /// Six neighbours as in a full grid, each with its opposite, and no sample between: wherever the vertex goes it lies halfway between these two, and all faces lie the right way round.
    fn is_regular(&self, ring: &Ring) -> bool {
        let opposite = |of: &[f64]| (0..3).all(|k| of[k] + of[k + 3] == 0.0);
        !ring.border && ring.sides.len() == 6 && opposite(&self.x) && opposite(&self.y)
    }
}

/// A neighbour to go to: its number, the error at the vertex then, and the face over it.
#[derive(Clone, Copy, Debug)]
struct Way {
    least: f64,
    to: usize,
    over: usize,
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
        gauge: Gauge::new(relief),
        kind: vec![Kind::Free; n],
        vertices: &sheet.vertices,
        surface,
        history,
        queues: vec![BinaryHeap::new(); PARTS * PARTS],
        part: parts(&sheet.vertices),
        goal: vec![NONE; n],
        price: vec![0.0; n],
        stale: vec![false; n],
        fan: vec![0; n],
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

/// The part of the block that each vertex lies in.
fn parts(vertices: &[Vertex]) -> Vec<u8> {
    let extent = |of: fn(&Vertex) -> i32| {
        let all = || vertices.iter().map(of);
        (all().min().unwrap_or(0), all().max().unwrap_or(0))
    };
    let (columns, rows) = (extent(|v| v.x), extent(|v| v.y));
    let along = |at: i32, (first, last): (i32, i32)| {
        (i64::from(at - first) * PARTS as i64 / (i64::from(last - first) + 1)) as usize
    };
    vertices.iter().map(|v| (along(v.y, rows) * PARTS + along(v.x, columns)) as u8).collect()
}

impl Work<'_> {
    fn classify(&mut self, faces: &[[u32; 3]], rules: &Rules) {
        let n = self.vertices.len();
        faces.as_flattened().iter().for_each(|&v| self.fan[v as usize] += 1);
        let mut ring = Ring::default();
        for v in 0..n as u32 {
            let at = self.vertices[v as usize];
            if self.surface.at[v as usize] == NONE || rules.is_shared(at) {
                self.kind[v as usize] = Kind::Locked;
                continue;
            }
            self.surface.ring(v, &mut ring);
            if ring.sides.len() != self.fan[v as usize] as usize {
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
        let mut collapses = Vec::with_capacity(most.min(self.vertices.len()));
        let mut spare = (Forms::default(), vec![]);
        while collapses.len() < most
            && let Some(least) = self.queues.iter().filter_map(|q| Some(q.peek()?.0.0)).min()
        {
            let enough = (f32::from_bits(least) * STEP).to_bits();
            for part in 0..self.queues.len() {
                let due = |c: &Candidate| c.0.0 <= enough;
                while collapses.len() < most
                    && self.queues[part].peek().is_some_and(due)
                    && let Some(Reverse((_, _, u))) = self.queues[part].pop()
                {
                    collapses.extend(self.take(u, enough, &mut spare));
                }
            }
        }
        collapses
    }

    /// Makes the collapse of `u`, whose turn it is with these bits of a cost, unless it is out of date.
    fn take(&mut self, u: u32, cost: u32, spare: &mut (Forms, Vec<(u32, usize)>)) -> Option<Collapse> {
        if self.surface.at[u as usize] == NONE || self.goal[u as usize] == NONE {
            return None;
        }
        if self.stale[u as usize] && !self.evaluate(u, Some(cost)) {
            return None;
        }
        let made = self.commit(u, (&mut spare.0, &mut spare.1));
        if made.is_none() {
            // Elsewhere, perhaps.
            let v = std::mem::replace(&mut self.goal[u as usize], NONE);
            let list = std::mem::replace(&mut self.barred[u as usize], self.bars.len() as u32);
            self.bars.push((v, list));
            self.evaluate(u, None);
        }
        made
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
        let j = self.history.accept(&mut self.gauge, self.vertices, [u, v], self.price[u as usize], forms);
        let wings = self.surface.collapse(u, i, &ring);
        // A face goes on each side where there is one, and with it one of that tip's.
        self.fan[v as usize] += self.fan[u as usize];
        let n = ring.neighbours.len();
        let before = i.checked_sub(1).or((!ring.border).then_some(n - 1));
        let after = if i + 1 < n { Some(i + 1) } else { (!ring.border).then_some(0) };
        for k in [before, after].into_iter().flatten() {
            self.fan[v as usize] -= 2;
            self.fan[ring.neighbours[k] as usize] -= 1;
        }
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
        self.look(u, &ring);
        let at_once = self.choose(u, before, known, &ring);
        self.other = ring;
        at_once
    }

    /// As [`Work::evaluate`], with its ring looked at.
    fn choose(&mut self, u: u32, before: u32, known: Option<u32>, ring: &Ring) -> bool {
        let (mut best, mut found) = ((f64::INFINITY, u32::MAX), NONE);
        if before == NONE && self.star.alone && self.star.is_regular(ring) {
            let here = f64::from(self.vertices[u as usize].z);
            for i in 0..ring.neighbours.len() {
                let v = ring.neighbours[i];
                let Star { x, y, z, .. } = &self.star;
                let cost = (0.5 * (z[i % 3] + z[i % 3 + 3]) - here).abs() + self.gauge.allowance();
                let cost = (cost, (x[i] * x[i] + y[i] * y[i]) as u32);
                if (cost, v) < (best, found) && self.may_go(u, v) {
                    (best, found) = (cost, v);
                }
            }
            self.wait(u, best, found);
            return false;
        }
        // What was the best before is so again more often than not, and spares most of the work for the others.
        let first = if before == NONE { None } else { ring.neighbours.iter().position(|&n| n == before) };
        if let Some(i) = first
            && let Some(way) = self.way(u, i, ring)
            && let Some(cost) = self.cost(u, way, ring, (best, found))
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
            ways.extend(self.way(u, i, ring).filter(|way| way.least <= best.0));
        }
        ways.sort_unstable_by(|a, b| a.least.total_cmp(&b.least).then(a.to.cmp(&b.to)));
        for &way in &ways {
            if way.least > best.0 {
                break;
            }
            if let Some(cost) = self.cost(u, way, ring, (best, found)) {
                (best, found) = (cost, ring.neighbours[way.to]);
            }
        }
        self.star.ways = ways;
        self.wait(u, best, found);
        false
    }

    /// Puts a vertex into the queue that goes to another at this cost, if there is one.
    fn wait(&mut self, u: u32, cost: (f64, u32), goal: u32) {
        if goal != NONE {
            self.goal[u as usize] = goal;
            self.price[u as usize] = up(cost.0);
            self.queues[usize::from(self.part[u as usize])].push(Reverse((
                (cost.0 as f32).to_bits(),
                cost.1,
                u,
            )));
        }
    }

    /// Looks at the ring of `u` from there.
    fn look(&mut self, u: u32, ring: &Ring) {
        let here = self.vertices[u as usize];
        let Star { x, y, z, areas, beside, alone, .. } = &mut self.star;
        for all in [&mut *x, &mut *y, &mut *z] {
            all.clear();
        }
        let again = if ring.border { None } else { ring.neighbours.first() };
        for &n in ring.neighbours.iter().chain(again) {
            let v = self.vertices[n as usize];
            x.push(f64::from(v.x - here.x));
            y.push(f64::from(v.y - here.y));
            z.push(f64::from(v.z));
        }
        let faces = ring.sides.len();
        let padded = faces.next_multiple_of(LANES);
        for all in [&mut *x, &mut *y] {
            all.resize(padded + 1, all.last().copied().unwrap_or(0.0));
        }
        areas.clear();
        areas.extend(x.windows(2).zip(y.windows(2)).map(|(x, y)| x[0] * y[1] - y[0] * x[1]));
        beside.resize(padded + 1, 0.0);
        // Pick's theorem.
        *alone = self.gauge.is_fine() && areas.iter().sum::<f64>() == faces as f64;
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

    /// Whether `u` may go to its neighbour `v` as far as the two tell.
    #[inline]
    fn may_go(&self, u: u32, v: u32) -> bool {
        self.kind[v as usize] != Kind::Locked && !self.is_barred(u, v)
    }

    /// What there is to know of `u` going to its neighbour number `i` before triangles are measured; `None` if it must not, as far as faces tell that.
    #[inline]
    fn way(&mut self, u: u32, i: usize, ring: &Ring) -> Option<Way> {
        let v = ring.neighbours[i];
        if !self.may_go(u, v) {
            return None;
        }
        let Star { x, y, z, areas, beside, .. } = &mut self.star;
        let (faces, padded) = (ring.sides.len(), areas.len());
        let (x, y, beside) = (&x[..=padded], &y[..=padded], &mut beside[..=padded]);
        let (to_x, to_y) = (x[i], y[i]);
        // Along the border only, and straight on.
        if ring.border && (i > 0 && i < faces || x[faces - i] * to_y != y[faces - i] * to_x) {
            return None;
        }
        beside[padded] = to_x * y[padded] - to_y * x[padded];
        let groups = beside
            .as_chunks_mut::<LANES>()
            .0
            .iter_mut()
            .zip(x.as_chunks::<LANES>().0)
            .zip(y.as_chunks::<LANES>().0);
        for ((beside, x), y) in groups {
            for k in 0..LANES {
                beside[k] = to_x * y[k] - to_y * x[k];
            }
        }
        // The faces that go have no area there, all others must have one.
        let mut right = [0.0; LANES];
        let (firsts, seconds) = (beside.as_chunks::<LANES>().0, beside[1..].as_chunks::<LANES>().0);
        for ((face, b), c) in areas.as_chunks::<LANES>().0.iter().zip(firsts).zip(seconds) {
            for k in 0..LANES {
                right[k] += if face[k] + b[k] - c[k] > 0.0 { 1.0 } else { 0.0 };
            }
        }
        if right.iter().sum::<f64>() != (faces - ring.dying()) as f64 {
            return None;
        }
        // The vertex lies in this face: weights are the areas opposite the corners.
        let over = beside
            .windows(2)
            .zip(&*areas)
            .position(|(b, face)| b[0] >= 0.0 && b[1] <= 0.0 && face + b[0] - b[1] > 0.0)?;
        let (face, b, c) = (areas[over], beside[over], beside[over + 1]);
        let height = (face * z[i] - c * z[over] + b * z[over + 1]) / (face + b - c);
        let least = (height - f64::from(self.vertices[u as usize].z)).abs();
        Some(Way { least, to: i, over })
    }

    /// Error and squared length of taking `u` to its neighbour number `i`, where faces allow that; `None` if it has too many neighbours then, or that is not less than what is known.
    ///
    /// The link condition needs no test: where all faces that stay lie the right way round, the way from `v` to any other neighbour goes through faces of `u`, so there is no other edge between them.
    fn cost(
        &mut self,
        u: u32,
        Way { least, to: i, over }: Way,
        ring: &Ring,
        known: ((f64, u32), u32),
    ) -> Option<(f64, u32)> {
        let v = ring.neighbours[i];
        let (n, faces, wings) = (ring.neighbours.len(), ring.sides.len(), ring.dying() as u32);
        let (own, more) = (self.fan[v as usize], self.fan[u as usize]);
        if own + more > VALENCE + 2 * wings && own > 6 {
            return None;
        }
        let (at, to) = (self.vertices[u as usize], self.vertices[v as usize]);
        let enough = known.0.0;
        let mut most = if self.star.alone { least + self.gauge.allowance() } else { 0.0 };
        let goes = |k: usize| k == i || k + 1 == i || i == 0 && !ring.border && k + 1 == faces;
        // The face over the vertex is the likeliest to be too far off.
        let all = std::iter::once(over).chain((0..faces).filter(|&k| k != over && !goes(k)));
        for k in all.take(if self.star.alone { 0 } else { faces }) {
            let corner = |k: usize| self.vertices[ring.neighbours[if k == n { 0 } else { k }] as usize];
            most = most.max(self.gauge.error([to, corner(k), corner(k + 1)], enough));
            if most > enough {
                return None;
            }
        }
        let (dx, dy) = (i64::from(to.x - at.x), i64::from(to.y - at.y));
        let cost = (most, u32::try_from(dx * dx + dy * dy).unwrap_or(u32::MAX));
        ((cost, v) < known).then_some(cost)
    }
}
