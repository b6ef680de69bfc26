//! Connectivity of a chunk that is read alone: which vertex each split splits, and at which two edges.
//!
//! Both sides replay the splits of the chunk on what they know of the mesh: the *rings* of the chunk's vertices, that is the edges made by its splits, in
//! their cyclic order about each vertex. A cut through such an edge is a rank in the ring. Edges that are older than the
//! chunk are named by their face, near the faces that came with the vertex; behind them lies a vertex that stays nameless until a split
//! of it names one of its edges. FORMAT.md, "Connectivity", has the rules.

mod models;
mod rings;

use self::models::{Models, RANKS, RINGS, Recent, code_rank};
use super::base::MeshHead;
use super::coder::Coder;
use super::splits::Counts;
use crate::aif::NONE;
use crate::progressive::SplitCode;

/// A split's references and code.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Step {
    pub(super) vertex: u32,
    pub(super) left: u32,
    pub(super) right: u32,
    pub(super) code: SplitCode,
}

/// An edge made by a split of the chunk, named by the later of its faces.
#[derive(Clone, Copy, Debug)]
struct Edge {
    code: u32,
    /// Vertices (local) where the face begins and ends the edge.
    ends: [u32; 2],
    /// It was not cut yet.
    whole: bool,
}

/// What is known of a vertex.
#[derive(Clone, Debug, Default)]
struct Local {
    /// Its number; [`NONE`] as long as it is nameless.
    id: u32,
    /// The local vertex it turned out to be.
    same_as: u32,
    ring: Vec<u32>,
    place: Option<[f64; 3]>,
    /// Where the last vertex split from it is.
    child: Option<[f64; 3]>,
    state: State,
    /// Its ring grew since it was visited.
    touched: bool,
    /// Splits of it still to come (writer only).
    left: u32,
}

/// What a vertex did when the sweep last came by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    #[default]
    Root,
    New,
    Split,
    /// It will be split, but could not be yet: so many times.
    Waited(u8),
}

pub(super) struct Connect<'a> {
    head: &'a MeshHead,
    /// Numbers of the next vertex and face.
    vertex: usize,
    face: usize,
    first_face: usize,
    first_split: u32,
    locals: Vec<Local>,
    edges: Vec<Edge>,
    /// The edge on each side of each face of the chunk.
    edge_of: Vec<[u32; 3]>,
    /// The vertices still to be visited in this sweep, the next on top; those of the next sweep.
    pass: Vec<u32>,
    list: Vec<u32>,
    /// The vertices that the writer's splits split, by local number.
    sequence: Vec<u32>,
    at: usize,
    /// How often each new vertex will be split (writer only).
    to_come: Vec<u32>,
    made: usize,
    rest: u16,
    /// Older faces named last, the latest first.
    recent: Recent,
    /// The same of younger ones.
    recent_young: Recent,
    /// The last split: vertex, new vertex, tips.
    now: [u32; 4],
    place: [f64; 3],
    m: Models,
}

/// A cut found in the rings.
struct Cut {
    code: u32,
    /// Where in the ring of the vertex.
    at: usize,
    /// The vertex at the other end.
    tip: u32,
    starts: bool,
    /// The edge was made by a split of the chunk.
    known: bool,
    /// The first place in the ring that the search for the cut filled; beyond the ring's end for none.
    first_new: usize,
}

impl Cut {
    fn context(&self, side: usize) -> usize {
        side << 2 | (self.starts as usize) << 1 | self.known as usize
    }
}

/// No place of a ring.
const NOWHERE: usize = usize::MAX;

/// Bits of a code that hardly change from split to split.
const REST: u16 = !(SplitCode::TWO_FACES
    | SplitCode::MOVES
    | SplitCode::L_INNER
    | SplitCode::L_STARTS
    | SplitCode::R_INNER);

impl<'a> Connect<'a> {
    pub(super) fn new(head: &'a MeshHead, first: Counts) -> Self {
        Connect {
            head,
            vertex: head.base_vertices as usize + first.split,
            face: first.face,
            first_face: first.face,
            first_split: first.split as u32,
            locals: Vec::new(),
            edges: Vec::new(),
            edge_of: Vec::new(),
            pass: Vec::new(),
            list: Vec::new(),
            sequence: Vec::new(),
            at: 0,
            to_come: Vec::new(),
            made: 0,
            rest: 0,
            recent: Recent::default(),
            recent_young: Recent::default(),
            now: [0; 4],
            place: [0.0; 3],
            m: Models::default(),
        }
    }

    /// Codes the chunk's roots; a writer gives the vertices of its splits.
    pub(super) fn begin<C: Coder>(&mut self, c: &mut C, vertices: &[u32]) -> Option<()> {
        let first = self.vertex as u32;
        let mut roots: Vec<u32> = vertices.iter().copied().filter(|&v| v < first).collect();
        roots.sort_unstable();
        roots.dedup();
        let count = c.number(&mut self.m.roots, roots.len() as u64);
        let mut next = 0u64;
        for k in 0..count as usize {
            let gap = c.number(&mut self.m.root, roots.get(k).map_or(0, |&r| r as u64 - next));
            let id = u32::try_from(next.checked_add(gap)?).ok().filter(|&id| id < first)?;
            next = id as u64 + 1;
            self.locals.push(Local { id, same_as: NONE, ..Default::default() });
            if c.spent() {
                return None;
            }
        }
        self.pass.extend((0..count as u32).rev());
        self.sequence = vertices.to_vec();
        self.to_come = vec![0; vertices.len()];
        for &v in vertices {
            match (v as usize).checked_sub(self.vertex) {
                Some(new) => *self.to_come.get_mut(new)? += 1,
                None => {
                    let k = roots.binary_search(&v).ok()?;
                    self.locals[k].left += 1;
                }
            }
        }
        Some(())
    }

    /// The vertex of the next split, by the sweep.
    fn sweep<C: Coder>(&mut self, c: &mut C) -> Option<u32> {
        let wanted = self.sequence.get(self.at).copied().unwrap_or(0);
        let mut idle = 0;
        loop {
            if self.pass.is_empty() {
                if self.list.is_empty() || idle > 1 {
                    return None;
                }
                idle += 1;
                std::mem::swap(&mut self.pass, &mut self.list);
                self.pass.reverse();
            }
            let v = self.pass.pop()?;
            let local = &mut self.locals[v as usize];
            let (context, waited) = match local.state {
                State::Root => (0, false),
                State::New => (1 + (local.ring.len() > 4) as usize, false),
                State::Split => (3 + (local.ring.len() > 4) as usize, false),
                State::Waited(n) => (5 + 2 * (n as usize).min(3) + local.touched as usize, true),
            };
            local.touched = false;
            if c.bit(&mut self.m.split[context], local.id == wanted) {
                self.at += 1;
                local.state = State::Split;
                local.left = local.left.saturating_sub(1);
                return Some(v);
            }
            if waited || !c.bit(&mut self.m.done[context], local.left == 0) {
                let n = if let State::Waited(n) = local.state { n.saturating_add(1) } else { 0 };
                local.state = State::Waited(n);
                self.list.push(v);
            }
            if c.spent() {
                return None;
            }
        }
    }

    /// Codes the next split. `fan`: what edges there are about its vertex, from the left cut on, for a writer.
    pub(super) fn code<C: Coder>(&mut self, c: &mut C, s: Step, fan: &[u32]) -> Option<Step> {
        let v = self.sweep(c)?;
        let vertex = self.locals[v as usize].id;
        // The part of the code that hardly changes.
        // Whether there are two faces, the head knows.
        let split = (self.vertex - self.head.base_vertices as usize) as u32;
        let two = if self.head.is_single(split) { 0 } else { SplitCode::TWO_FACES };
        let mut rest = s.code.0 & REST;
        if c.bit(&mut self.m.rest_same, rest == self.rest) {
            rest = self.rest;
        } else {
            rest = u16::try_from(c.number(&mut self.m.rest, rest as u64)).ok()? & REST;
        }
        self.rest = rest;
        let rest = rest | two;
        let two = two != 0;
        let before = self.rest_moves(v);
        let moves = c.bit(&mut self.m.moves[before], s.code.moves());
        let mut left = self.cut(c, v, 0, s.left, Some(s.code.left_starts()), fan, None)?;
        let inner = c.bit(&mut self.m.inner[left.context(0)], s.code.left_inner());
        let mut code = rest
            | if moves { SplitCode::MOVES } else { 0 }
            | if left.starts { SplitCode::L_STARTS } else { 0 }
            | if inner { SplitCode::L_INNER } else { 0 };
        let mut right = None;
        if two {
            let length = self.locals[v as usize].ring.len();
            let cut = self.cut(c, v, 1, s.right, None, fan, Some(left.at))?;
            let grown = self.locals[v as usize].ring.len() - length;
            if cut.first_new <= left.at {
                left.at += grown;
            }
            if c.bit(&mut self.m.inner[cut.context(1)], s.code.right_inner()) {
                code |= SplitCode::R_INNER;
            }
            right = Some(cut);
        }
        let step = Step {
            vertex,
            left: left.code,
            right: right.as_ref().map_or(NONE, |r| r.code),
            code: SplitCode(code),
        };
        self.apply(v, &left, right.as_ref(), step.code)?;
        Some(step)
    }

    /// A context for whether `v` moves.
    fn rest_moves(&self, v: u32) -> usize {
        let l = &self.locals[v as usize];
        l.place.is_some() as usize
    }

    /// A cut at `v`. `side`: 0 left, 1 right; `from`: the left cut's place in the ring. A writer says which cut, and knows the fan.
    #[allow(clippy::too_many_arguments)]
    fn cut<C: Coder>(
        &mut self,
        c: &mut C,
        v: u32,
        side: usize,
        code: u32,
        starts: Option<bool>,
        fan: &[u32],
        from: Option<usize>,
    ) -> Option<Cut> {
        // The fan from this cut on.
        let here = fan.iter().position(|&x| x >> 1 == code).unwrap_or(0);
        let (back, fan) = fan.split_at(here);
        let starts = starts.unwrap_or(fan.first().is_some_and(|&x| x & 1 == 1));
        let ring = &self.locals[v as usize].ring;
        let k = ring.len();
        // Known ones are counted from the left cut on, which is none itself.
        let first = from.map_or(0, |f| f + 1);
        let choices = k - from.is_some() as usize;
        let size = choices.min(RINGS - 1);
        if choices > 0 {
            let matches = |&i: &usize| {
                let e = &self.edges[ring[(first + i) % k] as usize];
                e.whole && e.code == code && (self.resolve(e.ends[0]) == v) == starts
            };
            let found = if C::READS { None } else { (0..choices).find(matches) };
            if c.bit(&mut self.m.known[side * RINGS + size], found.is_some()) {
                let models = &mut self.m.rank[(side * RINGS + size) * RANKS..][..RANKS];
                let rank = code_rank(c, models, &mut self.m.far, choices, found.unwrap_or(0))?;
                let at = (first + rank) % k;
                let edge = self.edges[ring[at] as usize];
                let starts = self.resolve(edge.ends[0]) == v;
                let tip = self.resolve(edge.ends[starts as usize]);
                return Some(Cut { code: edge.code, at, tip, starts, known: edge.whole, first_new: NOWHERE });
            }
        }
        // Named by its face.
        let young = self.face - self.first_face;
        let is_young = (code >> 2) as usize >= self.first_face;
        if young > 0 && c.bit(&mut self.m.young[side], is_young) {
            let (split, second) = self.head.maker(code >> 2).filter(|_| !C::READS).unwrap_or_default();
            let last = self.vertex as i64 - self.head.base_vertices as i64 - 1;
            let split = self.recent_young.code(c, &mut self.m.young_split, last, split as i64);
            let split = u32::try_from(split).ok().filter(|&i| i >= self.first_split && i as i64 <= last)?;
            let second = !self.head.is_single(split) && c.bit(&mut self.m.young_second, second);
            let face = self.head.first_face(split) + second as u32;
            let local = (face as usize).checked_sub(self.first_face)?;
            let edge = c.symbol(&mut self.m.edge[0..4], 2, code & 3);
            let record = *self.edge_of.get(local)?.get(edge as usize)?;
            let starts = c.bit(&mut self.m.starts[side], starts);
            let code = face << 2 | edge;
            let e = self.edges[record as usize];
            let (end, tip) = (self.resolve(e.ends[!starts as usize]), self.resolve(e.ends[starts as usize]));
            if end != v
                && tip != v
                && end != tip
                && self.locals[end as usize].id == NONE
                && e.whole
                && e.code == code
            {
                let first_new = self.gap(c, v, fan, back)?;
                let at = self.join(v, end, record, first_new)?;
                return Some(Cut { code, at, tip, starts, known: true, first_new });
            }
            return self.unknown(c, v, code, starts, fan, back);
        }
        let (code, starts) = self.old(c, v, code, starts)?;
        self.unknown(c, v, code, starts, fan, back)
    }

    /// A cut through an edge of which no more is known: it gets a place in the ring of `v`, and a nameless vertex at the other end.
    fn unknown<C: Coder>(
        &mut self,
        c: &mut C,
        v: u32,
        code: u32,
        starts: bool,
        fan: &[u32],
        back: &[u32],
    ) -> Option<Cut> {
        let at = self.gap(c, v, fan, back)?;
        let edge = self.edges.len() as u32;
        self.edges.push(Edge { code, ends: [v, v], whole: false });
        self.locals[v as usize].ring.insert(at, edge);
        let tip = self.locals.len() as u32;
        self.locals.push(Local { id: NONE, same_as: NONE, ..Default::default() });
        Some(Cut { code, at, tip, starts, known: false, first_new: at })
    }

    /// An edge older than the chunk: which split made its face, which of the faces, which of the edges, and how that runs.
    fn old<C: Coder>(&mut self, c: &mut C, v: u32, code: u32, starts: bool) -> Option<(u32, bool)> {
        let own = self.locals[v as usize].id.checked_sub(self.head.base_vertices);
        let maker = if C::READS { None } else { self.head.maker(code >> 2) };
        let (face, kind) = if c.bit(&mut self.m.base, maker.is_none()) {
            let face = c.number(&mut self.m.base_face, (code >> 2) as u64);
            (u32::try_from(face).ok().filter(|&f| f < self.head.base_faces)?, 0)
        } else {
            let (split, second) = maker.unwrap_or_default();
            let (split, kind) = match own {
                Some(own) if c.bit(&mut self.m.own, split == own) => (own, 1),
                _ => {
                    let own = own.map_or(self.recent.0[0], i64::from);
                    let split = self.recent.code(c, &mut self.m.distance, own, split as i64);
                    (u32::try_from(split).ok().filter(|&i| i < self.first_split)?, 2)
                }
            };
            let single = self.head.is_single(split);
            let second = !single && c.bit(&mut self.m.second[kind], second);
            (self.head.first_face(split) + second as u32, 2 * kind + second as usize)
        };
        let edge = c.symbol(&mut self.m.old_edge[4 * kind..], 2, code & 3);
        if edge > 2 || face as usize >= self.first_face {
            return None;
        }
        let starts = c.bit(&mut self.m.old_starts[4 * kind + edge as usize], starts);
        Some((face << 2 | edge, starts))
    }
}
