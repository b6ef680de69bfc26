//! What corners were before, what collapses depend on, and the bounds that follow.

use super::NONE;
use super::relief::Gauge;
use super::sheet::{Former, Gone, Round, Sheet, Vertex, square};
use super::surface::{Ring, Surface, Wing, next, previous};
use crate::tin::scan::area;

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
    /// The latest collapse that each of them was found to need at once.
    user_of: Vec<u32>,
    bounds: Vec<f32>,
    /// Of every vertex: what holds all that came of it and is around that, and how steep that is; see [`Round`].
    round: Vec<Round>,
    /// Lists of faces that went, along the edge that their two other sides have become: for every side those with the tip where it begins, and where it ends. Those of an edge are
    /// at either of its sides. A face is forgotten as soon as its split needs whatever takes its tip away next.
    open: Vec<[u32; 2]>,
    stills: Vec<Still>,
    /// How long a step by a row and a unit of height are, in steps by a column.
    scale: [f64; 2],
    /// What radii grow by along the vertex hierarchy, so that rounding of places never shows.
    slack: f64,
}

/// What the faces may be about a vertex that goes to a neighbour: triangles with a corner there, and the others where they are or were as long as the split is not made.
#[derive(Clone, Debug, Default)]
pub(super) struct Forms {
    /// Splits that need that of the collapse.
    users: [u32; 8],
    /// Of every face the places of its second corner, the present first, then those of its third.
    at: Vec<Vertex>,
    /// Where both end.
    ends: Vec<[u32; 2]>,
    /// So many faces are there; the others went.
    live: usize,
}

impl Forms {
    fn faces(&self) -> impl Iterator<Item = [&[Vertex]; 2]> {
        let mut start = 0;
        self.ends.iter().map(move |&[middle, end]| {
            let of = [&self.at[start..middle as usize], &self.at[middle as usize..end as usize]];
            start = end as usize;
            of
        })
    }

    /// Whether all lie the right way round with their first corner at `a`.
    fn turn_about(&self, a: Vertex) -> bool {
        let at = |v: &Vertex| (v.x, v.y);
        self.faces().all(|[second, third]| {
            second.iter().all(|b| third.iter().all(|c| area(at(&a), at(b), at(c)) > 0))
        })
    }
}

/// How deep dependencies are followed. Deeper they would rule out a few more triangles: bounds are a little larger than they might be.
const DEPTH: u32 = 3;
/// With more triangles than this that a face may be, the span of all heights around takes the place of their errors.
const MOST: usize = 1024;

impl History {
    pub(super) fn new(sheet: &mut Sheet, scale: [f64; 2], slack: f64) -> Self {
        let mut h = History {
            scale,
            slack,
            head: Vec::with_capacity(3 * sheet.faces.len()),
            joined: std::mem::take(&mut sheet.joined).into_flattened(),
            last: std::mem::take(&mut sheet.last),
            needs: vec![[NONE; 3]; sheet.past.len()],
            user_of: vec![NONE; sheet.past.len()],
            bounds: std::mem::take(&mut sheet.past),
            round: std::mem::take(&mut sheet.round),
            ..History::default()
        };
        // What collapses of three vertices of four add, about.
        let (faces, n) = (sheet.faces.len(), sheet.vertices.len());
        h.entries.reserve(sheet.former.len() + 3 * n);
        h.stills.reserve(sheet.gone.len() + faces);
        h.open.reserve(3 * faces);
        h.needs.reserve(n);
        h.user_of.reserve(n);
        h.bounds.reserve(n);
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
        h
    }

    /// Takes so many former vertices as a chain; returns where it begins.
    fn take_chain(&mut self, former: &mut impl Iterator<Item = Former>, count: u32) -> u32 {
        if count == 0 {
            return NONE;
        }
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

    /// Split `i` needs `j`.
    fn need(&mut self, i: u32, j: u32) {
        if i == NONE {
            return;
        }
        self.user_of[i as usize] = j;
        if let Some(slot) = self.needs[i as usize].iter_mut().find(|s| **s == NONE || **s == j) {
            *slot = j;
        }
    }

    /// Split `i` surely cannot be made without the latest, `j`, which is not `i`.
    fn depends(&self, i: u32, j: u32, depth: u32) -> bool {
        let needs = || self.needs[i as usize].iter().take_while(|d| **d != NONE);
        self.user_of[i as usize] == j || depth > 1 && needs().any(|&d| self.depends(d, j, depth - 1))
    }

    /// Looks at what comes of a collapse of `u` to its neighbour number `i`, before it is made; `ring` is that of `u`, `inner` its sides that stay. True, and its split is noted as the next, if all faces lie the
    /// right way round then, in whatever order collapses are undone. `forms` gets the triangles that they may be.
    pub(super) fn propose(
        &mut self,
        (surface, vertices): (&Surface, &[Vertex]),
        (u, i): (u32, usize),
        (ring, inner): (&Ring, &[(u32, usize)]),
        forms: &mut Forms,
    ) -> bool {
        let (n, faces) = (ring.neighbours.len(), ring.sides.len());
        let v = ring.neighbours[i];
        let dies = |k: usize| k == i || (k + 1) % n == i;
        // The splits that need this one: the last at both vertices, and those that joined the faces beside the two that go.
        let joined = |k: usize| {
            let f = ring.sides[k] / 3 * 3;
            [0, 1, 2].map(|s| self.joined[(f + s) as usize])
        };
        let mut dying = (0..faces).filter(|&k| dies(k)).map(joined);
        let [[a, b, c], [d, e, f]] = [(); 2].map(|()| dying.next().unwrap_or([NONE; 3]));
        forms.users = [self.last[v as usize], self.last[u as usize], a, b, c, d, e, f];
        let j = self.needs.len() as u32;
        self.needs.push([NONE; 3]);
        self.user_of.push(NONE);
        forms.users.into_iter().for_each(|i| self.need(i, j));
        self.fill((surface, vertices), (ring, inner), dies, j, forms);
        if forms.turn_about(vertices[v as usize]) {
            return true;
        }
        for i in forms.users.into_iter().filter(|&i| i != NONE) {
            self.needs[i as usize].iter_mut().filter(|s| **s == j).for_each(|s| *s = NONE);
            self.user_of[i as usize] = NONE;
        }
        self.needs.pop();
        self.user_of.pop();
        false
    }

    /// Lists what the faces may be that stay when split `j` is not made.
    fn fill(
        &self,
        (surface, vertices): (&Surface, &[Vertex]),
        (ring, inner): (&Ring, &[(u32, usize)]),
        dies: impl Fn(usize) -> bool,
        j: u32,
        forms: &mut Forms,
    ) {
        forms.at.clear();
        forms.ends.clear();
        let add = |forms: &mut Forms, [second, third]: [(Vertex, u32); 2]| {
            forms.at.push(second.0);
            self.chain(second.1, j, &mut forms.at);
            let middle = forms.at.len() as u32;
            forms.at.push(third.0);
            self.chain(third.1, j, &mut forms.at);
            forms.ends.push([middle, forms.at.len() as u32]);
        };
        for (_, &side) in ring.sides.iter().enumerate().filter(|(k, _)| !dies(*k)) {
            let corner = |s: u32| (vertices[surface.corner[s as usize] as usize], self.head[s as usize]);
            add(forms, [corner(next(side)), corner(previous(side))]);
        }
        forms.live = forms.ends.len();
        // Faces that went, and have their tip at the vertex.
        for &(side, end) in inner {
            let mut at = self.open[side as usize][end];
            while let Some(&Still { at: [b, c], chains, next }) = self.stills.get(at as usize) {
                add(forms, [(b, chains[0]), (c, chains[1])]);
                at = next;
            }
        }
    }

    /// Makes the collapse that was proposed, of `u` to `v`: what comes of it is within `error`, as the faces are now. Measures what else they may be.
    pub(super) fn accept(
        &mut self,
        gauge: &mut Gauge<'_>,
        vertices: &[Vertex],
        [u, v]: [u32; 2],
        error: f32,
        forms: &Forms,
    ) -> u32 {
        let j = self.bounds.len() as u32;
        let users = forms.users.iter().filter(|&&i| i != NONE);
        let below = users.map(|&i| self.bounds[i as usize]).fold(error, f32::max);
        let mut most = f64::from(below);
        let (a, mut far) = (vertices[v as usize], 0.0f64);
        for (k, [second, third]) in forms.faces().enumerate() {
            far = second.iter().chain(third).map(|&b| square(a, b, self.scale)).fold(far, f64::max);
            if second.len() * third.len() > MOST {
                most = most.max(gauge.span(second.iter().chain(third).copied().chain([a])));
                continue;
            }
            for (i, &b) in second.iter().enumerate() {
                let skip = usize::from(k < forms.live && i == 0);
                for &c in &third[skip..] {
                    most = most.max(gauge.error([a, b, c], f64::INFINITY));
                }
            }
        }
        self.bounds.push(up(most));
        let way = square(a, vertices[u as usize], self.scale).sqrt();
        let (gone, kept) = (self.round[u as usize], self.round[v as usize]);
        let reach = f64::from(kept.reach).max(way + f64::from(gone.reach)) + self.slack;
        self.round[v as usize] =
            Round { reach: stored(up(reach.max(far.sqrt()))), upright: kept.upright.min(gone.upright) };
        (self.last[v as usize], self.last[u as usize]) = (j, NONE);
        j
    }

    /// Bound, radius, and the least cosine between a normal of the finest mesh and up, of the collapse `j` onto `v` that was the last there.
    pub(super) fn bounds(&self, v: u32, j: u32) -> [f32; 3] {
        let round = &self.round[v as usize];
        [self.bounds[j as usize], round.reach, round.upright]
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
                past.push(self.bounds[i as usize]);
            }
            *n
        };
        sheet.last = vertices.iter().map(|&v| id(self.last[v as usize])).collect();
        sheet.round = vertices.iter().map(|&v| self.round[v as usize]).collect();
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

/// The least number of 8 bits of mantissa, as bounds are stored with, that is not below a positive one: so what nests as it is nests as it is stored.
pub(super) fn stored(x: f32) -> f32 {
    f32::from_bits(x.to_bits().div_ceil(1 << 15) << 15)
}

/// The least f32 that is not below a number.
pub(super) fn up(x: f64) -> f32 {
    let f = x as f32;
    if f64::from(f) < x { f.next_up() } else { f }
}
