//! What corners were before, what collapses depend on, and the bounds that follow.

use super::NONE;
use super::relief::Relief;
use super::sheet::{Former, Gone, Sheet, Vertex};
use super::surface::{Ring, Surface, Wing, next, previous};

/// A face that a collapse took away, as it is right after the split that brings it back, but for its tip: that may be coarser than the collapse found it, as nothing of it
/// is needed for the split. The next collapse that takes the tip elsewhere has to measure it.
#[derive(Clone, Copy, Debug)]
struct Still {
    at: [Vertex; 2],
    /// Where the chains of former vertices of these two corners begin.
    chains: [u32; 2],
    next: u32,
}

/// The past of a sheet on which collapses go on.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    /// Chains of former vertices, the latest first: where each corner's begins.
    head: Vec<u32>,
    entries: Vec<(Former, u32)>,
    /// The collapse that joined the faces along each side.
    pub joined: Vec<u32>,
    last: Vec<u32>,
    /// What every collapse, those of the past first, needs as a split, as far as it is known yet.
    needs: Vec<[u32; 3]>,
    bounds: Vec<f32>,
    radii: Vec<f32>,
    /// Lists of faces that went, along the edge that their two other sides have become: for every side those with the tip where it begins, and where it ends. Those of an edge are
    /// at either of its sides. A face is forgotten as soon as its split needs whatever takes its tip away next.
    open: Vec<[u32; 2]>,
    stills: Vec<Still>,
    /// How long a step by a row and a unit of height are, in steps by a column.
    scale: [f64; 2],
}

/// How deep dependencies are followed. Deeper they would rule out a few more triangles: bounds are a little larger than they might be.
const DEPTH: u32 = 3;
/// With more triangles than this that a face may be, the span of all heights around takes the place of their errors.
const MOST: usize = 1024;

impl History {
    pub(super) fn new(sheet: &mut Sheet, scale: [f64; 2]) -> Self {
        let mut h = History {
            scale,
            head: Vec::with_capacity(3 * sheet.faces.len()),
            joined: std::mem::take(&mut sheet.joined).into_flattened(),
            last: std::mem::take(&mut sheet.last),
            needs: vec![[NONE; 3]; sheet.past.len()],
            bounds: sheet.past.iter().map(|p| p[0]).collect(),
            radii: sheet.past.iter().map(|p| p[1]).collect(),
            ..History::default()
        };
        h.entries.reserve(sheet.former.len());
        let mut former = std::mem::take(&mut sheet.former).into_iter();
        for count in std::mem::take(&mut sheet.counts).into_flattened() {
            let head = h.take_chain(&mut former, count);
            h.head.push(head);
        }
        let mut gone = std::mem::take(&mut sheet.gone).into_iter();
        let of_sides = std::mem::take(&mut sheet.open).into_flattened();
        for counts in of_sides {
            let mut lists = [NONE; 2];
            for (list, count) in lists.iter_mut().zip(counts) {
                for g in gone.by_ref().take(count as usize) {
                    let chains = g.counts.map(|count| h.take_chain(&mut former, count));
                    h.stills.push(Still { at: g.at, chains, next: *list });
                    *list = h.stills.len() as u32 - 1;
                }
            }
            h.open.push(lists);
        }
        sheet.past.clear();
        h
    }

    /// Takes so many former vertices as a chain; returns where it begins.
    fn take_chain(&mut self, former: &mut impl Iterator<Item = Former>, count: u32) -> u32 {
        let first = self.entries.len() as u32;
        self.entries.extend(former.take(count as usize).zip(first + 1..));
        match self.entries[first as usize..].last_mut() {
            Some(end) => {
                end.1 = NONE;
                first
            }
            None => NONE,
        }
    }

    /// Between two vertices, heights included, in steps by a column.
    pub(super) fn distance(&self, a: Vertex, b: Vertex) -> f64 {
        let (x, y) = (f64::from(a.x - b.x), f64::from(a.y - b.y) * self.scale[0]);
        let z = (f64::from(a.z) - f64::from(b.z)) * self.scale[1];
        (x * x + y * y + z * z).sqrt()
    }

    /// Split `i` needs `j`.
    fn need(&mut self, i: u32, j: u32) {
        if i == NONE {
            return;
        }
        if let Some(slot) = self.needs[i as usize].iter_mut().find(|s| **s == NONE || **s == j) {
            *slot = j;
        }
    }

    /// Split `i` surely cannot be made without `j`.
    fn depends(&self, i: u32, j: u32, depth: u32) -> bool {
        i == j
            || depth > 0 && self.needs[i as usize].iter().any(|&d| d != NONE && self.depends(d, j, depth - 1))
    }

    /// The collapse after the last: `u` goes onto `v`, the faces of `dying` go. Returns its number; its bound begins with those of the splits that need it.
    pub(super) fn begin(&mut self, u: u32, v: u32, dying: impl Iterator<Item = u32>, distance: f64) -> u32 {
        let j = self.needs.len() as u32;
        self.needs.push([NONE; 3]);
        let (mut bound, mut radius) = (0.0f32, up(distance));
        let before = [self.last[v as usize], self.last[u as usize]];
        for (i, way) in before.into_iter().zip([0.0, distance]).filter(|(i, _)| *i != NONE) {
            radius = radius.max(up(f64::from(self.radii[i as usize]) + way));
            bound = bound.max(self.bounds[i as usize]);
            self.need(i, j);
        }
        for f in dying {
            for s in 3 * f..3 * f + 3 {
                let i = self.joined[s as usize];
                if i != NONE {
                    bound = bound.max(self.bounds[i as usize]);
                    self.need(i, j);
                }
            }
        }
        (self.last[v as usize], self.last[u as usize]) = (j, NONE);
        self.bounds.push(bound);
        self.radii.push(radius);
        j
    }

    /// The vertices that a corner was, the latest first, as long as that does not take split `j`.
    fn chain(&self, head: u32, j: u32, out: &mut Vec<Vertex>) {
        let mut at = head;
        while let Some((former, rest)) = self.entries.get(at as usize) {
            if self.depends(former.by, j, DEPTH) {
                return;
            }
            out.push(former.vertex);
            at = *rest;
        }
    }

    /// Measures what a face may be as long as split `j` is not made: a corner at `a`, the others where they are or were.
    fn measure(
        &mut self,
        relief: &Relief,
        a: Vertex,
        others: [(Vertex, u32); 2],
        j: u32,
        room: &mut [Vec<Vertex>; 2],
    ) {
        for ((v, head), out) in others.into_iter().zip(room.iter_mut()) {
            out.clear();
            out.push(v);
            self.chain(head, j, out);
        }
        let mut most = self.bounds[j as usize];
        let all = room.iter().flatten();
        let radius = all.clone().map(|&b| self.distance(a, b)).fold(0.0, f64::max);
        if room[0].len() * room[1].len() > MOST {
            most = most.max(up(relief.span(all.copied().chain([a]))));
        } else {
            for &b in &room[0] {
                for &c in &room[1] {
                    most = most.max(up(relief.error([a, b, c], f64::INFINITY)));
                }
            }
        }
        self.bounds[j as usize] = most;
        let known = &mut self.radii[j as usize];
        *known = known.max(up(radius));
    }

    /// Measures the face of `side`, which begins at the vertex that collapse `j` keeps.
    pub(super) fn measure_face(
        &mut self,
        relief: &Relief,
        surface: &Surface,
        vertices: &[Vertex],
        side: u32,
        j: u32,
        room: &mut [Vec<Vertex>; 2],
    ) {
        let here = |s: u32| vertices[surface.corner[s as usize] as usize];
        let others = [next(side), previous(side)].map(|s| (here(s), self.head[s as usize]));
        self.measure(relief, here(side), others, j, room);
    }

    /// Measures the faces that went and have their tip at the vertex that collapse `j` takes to `v`; `inner` are the sides that begin or end there, of edges that stay.
    pub(super) fn measure_gone(
        &mut self,
        relief: &Relief,
        v: Vertex,
        inner: &[(u32, usize)],
        j: u32,
        room: &mut [Vec<Vertex>; 2],
    ) {
        for &(side, end) in inner {
            let mut at = self.open[side as usize][end];
            while let Some(&Still { at: [b, c], chains, next }) = self.stills.get(at as usize) {
                self.measure(relief, v, [(b, chains[0]), (c, chains[1])], j, room);
                at = next;
            }
        }
    }

    /// The sides about the vertex of `ring`, which goes to its neighbour number `i`, whose edges stay, with the end at which the vertex is.
    pub(super) fn inner(ring: &Ring, i: usize, out: &mut Vec<(u32, usize)>) {
        out.clear();
        let (n, faces) = (ring.neighbours.len(), ring.sides.len());
        for k in 0..n {
            // The neighbour itself, and the tips beside.
            let near =
                k == i || k + 1 == i || k == i + 1 || !ring.border && ((k + 1) % n == i || (i + 1) % n == k);
            if near {
                continue;
            }
            if k < faces {
                out.push((ring.sides[k], 0));
            }
            if k > 0 || !ring.border {
                out.push((previous(ring.sides[(k + faces - 1) % faces]), 1));
            }
        }
    }

    /// The faces of the wings went with a collapse of `u` to `v`: what is remembered along the edges that became one, and they themselves. Before anything else is noted.
    pub(super) fn bury(&mut self, wings: [Option<Wing>; 2], u: Vertex, v: Vertex) {
        for (w, left) in wings.into_iter().zip([true, false]).filter_map(|(w, left)| Some((w?, left))) {
            let (n, p) = (next(w.side), previous(w.side));
            // Of each side, the end at which the tip is.
            let edges = if left {
                [(n, 1), (w.removed, 0), (p, 0), (w.kept, 1)]
            } else {
                [(n, 1), (w.kept, 0), (p, 0), (w.removed, 1)]
            };
            let mut list = NONE;
            for (side, end) in edges.into_iter().filter(|(s, _)| *s != NONE) {
                let mut at = std::mem::replace(&mut self.open[side as usize], [NONE; 2])[end];
                while let Some(still) = self.stills.get_mut(at as usize) {
                    let rest = std::mem::replace(&mut still.next, list);
                    (list, at) = (at, rest);
                }
            }
            let (vertices, sides) = if left { ([v, u], [w.side, n]) } else { ([u, v], [w.side, n]) };
            self.stills.push(Still {
                at: vertices,
                chains: sides.map(|s| self.head[s as usize]),
                next: list,
            });
            let (side, end) = edges
                .into_iter()
                .find(|e| e.0 != NONE && (e.0 == w.kept || e.0 == w.removed))
                .unwrap_or(edges[0]);
            self.open[side as usize][end] = self.stills.len() as u32 - 1;
        }
    }

    /// The corner of `side` was at `vertex` before collapse `j`.
    pub(super) fn note(&mut self, side: u32, vertex: Vertex, j: u32) {
        let head = &mut self.head[side as usize];
        self.entries.push((Former { vertex, by: j }, *head));
        *head = self.entries.len() as u32 - 1;
    }

    /// Bound and radius of a collapse.
    pub(super) fn bound(&self, j: u32) -> [f32; 2] {
        [self.bounds[j as usize], self.radii[j as usize]]
    }

    /// Gives a sheet that has the vertices and faces of these numbers its past.
    pub(super) fn hand_over(&self, vertices: &[u32], faces: &[u32], sheet: &mut Sheet) {
        let mut new = vec![NONE; self.needs.len()];
        let mut past = vec![];
        let mut id = |i: u32| {
            if i == NONE {
                return NONE;
            }
            let n = &mut new[i as usize];
            if *n == NONE {
                *n = past.len() as u32;
                past.push(self.bound(i));
            }
            *n
        };
        sheet.last = vertices.iter().map(|&v| id(self.last[v as usize])).collect();
        let mut chain = |head: u32, out: &mut Vec<Former>| {
            let (mut at, mut count) = (head, 0);
            while let Some((former, rest)) = self.entries.get(at as usize) {
                out.push(Former { by: id(former.by), ..*former });
                (at, count) = (*rest, count + 1);
            }
            count
        };
        for &f in faces {
            let sides = [3 * f, 3 * f + 1, 3 * f + 2];
            sheet.counts.push(sides.map(|s| chain(self.head[s as usize], &mut sheet.former)));
        }
        for &f in faces {
            sheet.open.push([0, 1, 2].map(|k| {
                self.open[(3 * f + k) as usize].map(|first| {
                    let (mut at, mut count) = (first, 0);
                    while let Some(&Still { at: corners, chains, next }) = self.stills.get(at as usize) {
                        let counts = chains.map(|head| chain(head, &mut sheet.former));
                        sheet.gone.push(Gone { at: corners, counts });
                        (at, count) = (next, count + 1);
                    }
                    count
                })
            }));
        }
        for &f in faces {
            let sides = [3 * f, 3 * f + 1, 3 * f + 2];
            sheet.joined.push(sides.map(|s| id(self.joined[s as usize])));
        }
        sheet.past = past;
    }
}

/// The least f32 that is not below a number.
pub(super) fn up(x: f64) -> f32 {
    let f = x as f32;
    if f64::from(f) < x { f.next_up() } else { f }
}
