//! What a split does to the rings of a chunk, and where that lets its new vertex be expected.

use super::super::coder::Coder;
use super::models::{RANKS, RINGS, code_rank};
use super::{Connect, Cut, Edge, Local, State};
use crate::aif::NONE;
use crate::progressive::SplitCode;

impl Connect<'_> {
    /// The vertex that a nameless one turned out to be.
    pub(super) fn resolve(&self, mut v: u32) -> u32 {
        while self.locals[v as usize].same_as != NONE {
            v = self.locals[v as usize].same_as;
        }
        v
    }

    /// The gap in the ring of `v` in which an edge lies that is not in it: before which edge. A writer finds it on its way around the
    /// fan from that edge on, and from the left cut up to it.
    pub(super) fn gap<C: Coder>(&mut self, c: &mut C, v: u32, fan: &[u32], back: &[u32]) -> Option<usize> {
        let ring = &self.locals[v as usize].ring;
        let k = ring.len();
        if k <= 1 {
            return Some(0);
        }
        let place = |&x: &u32| ring.iter().position(|&e| self.edges[e as usize].code == x >> 1);
        let found =
            if C::READS { None } else { fan.get(1..).and_then(|f| f.iter().chain(back).find_map(place)) };
        let size = k.min(RINGS - 1);
        code_rank(c, &mut self.m.gap[size * RANKS..][..RANKS], &mut self.m.far, k, found.unwrap_or(0))
    }

    /// The nameless vertex `other` is `v`: its ring becomes a part of that of `v`. Returns where `edge` is then.
    pub(super) fn join(&mut self, v: u32, other: u32, edge: u32, at: usize) -> Option<usize> {
        let ring = std::mem::take(&mut self.locals[other as usize].ring);
        let within = ring.iter().position(|&e| e == edge)?;
        self.locals[v as usize].ring.splice(at..at, ring);
        self.locals[other as usize].same_as = v;
        Some(at + within)
    }

    /// Does the split on what is known.
    pub(super) fn apply(&mut self, v: u32, cut: &Cut, right: Option<&Cut>, code: SplitCode) -> Option<()> {
        let u = self.locals.len() as u32;
        let id = self.vertex as u32;
        let left = self.to_come.get(self.made).copied().unwrap_or(0);
        self.made += 1;
        self.locals.push(Local { id, same_as: NONE, state: State::New, left, ..Default::default() });
        let f = self.face as u32;
        let add = |edges: &mut Vec<Edge>, code: u32, from: u32, to: u32| {
            edges.push(Edge { code, ends: [from, to], whole: true });
            edges.len() as u32 - 1
        };
        // Corners: the tip, then old and new vertex or the other way round; edge k begins at corner k.
        let side = |edges: &mut Vec<Edge>, f: u32, tip: u32, new_next: bool| {
            let (b, d) = if new_next { (u, v) } else { (v, u) };
            let first = add(edges, f << 2, tip, b);
            let last = add(edges, f << 2 | 2, d, tip);
            if new_next { (last, first) } else { (first, last) }
        };
        let ((vl, ul), middle_left) = (side(&mut self.edges, f, cut.tip, code.left().1), code.left().1);
        let middle = |edges: &mut Vec<Edge>, f: u32, new_next: bool| {
            let (b, d) = if new_next { (u, v) } else { (v, u) };
            add(edges, f << 2 | 1, b, d)
        };
        let ring = std::mem::take(&mut self.locals[v as usize].ring);
        let k = ring.len();
        let gone_left = ring[cut.at];
        self.edges[gone_left as usize].whole = false;
        if cut.known {
            self.replace(cut.tip, gone_left, [ul, vl]);
        } else {
            self.locals[cut.tip as usize].ring.extend([ul, vl]);
        }
        let (mut of_v, mut of_u) = (Vec::with_capacity(8), Vec::with_capacity(8));
        let by_corner = |(on_v, on_u): (u32, u32), mid: u32, new_next: bool| {
            if new_next { [on_u, mid, on_v] } else { [on_v, mid, on_u] }
        };
        match right {
            Some(right) => {
                let g = f + 1;
                let (vr, ur) = side(&mut self.edges, g, right.tip, code.right().1);
                let mid = middle(&mut self.edges, g, code.right().1);
                let gone_right = ring[right.at];
                self.edges[gone_right as usize].whole = false;
                if right.known {
                    self.replace(right.tip, gone_right, [vr, ur]);
                } else {
                    self.locals[right.tip as usize].ring.extend([vr, ur]);
                }
                of_u.push(ul);
                let mut i = (cut.at + 1) % k;
                while i != right.at && i != cut.at {
                    of_u.push(ring[i]);
                    i = (i + 1) % k;
                }
                of_u.extend([ur, mid]);
                of_v.extend([vl, mid, vr]);
                i = (right.at + 1) % k;
                while i != cut.at && i != right.at {
                    of_v.push(ring[i]);
                    i = (i + 1) % k;
                }
                self.edge_of.push(by_corner((vl, ul), mid, middle_left));
                self.edge_of.push(by_corner((vr, ur), mid, code.right().1));
                self.now = [v, u, cut.tip, right.tip];
                self.face += 2;
            }
            None => {
                let mid = middle(&mut self.edges, f, middle_left);
                of_u.extend([mid, ul]);
                of_u.extend_from_slice(&ring[cut.at + 1..]);
                of_v.extend_from_slice(&ring[..cut.at]);
                of_v.extend([vl, mid]);
                self.edge_of.push(by_corner((vl, ul), mid, middle_left));
                self.now = [v, u, cut.tip, cut.tip];
                self.face += 1;
            }
        }
        for &e in &of_u {
            let ends = self.edges[e as usize].ends.map(|end| if self.resolve(end) == v { u } else { end });
            self.edges[e as usize].ends = ends;
        }
        // The edge between both has both ends again.
        if let Some(&mid) = of_u.last().filter(|_| right.is_some()).or(of_u.first()) {
            let e = &mut self.edges[mid as usize];
            let next = if right.is_some() { code.right().1 } else { middle_left };
            e.ends = if next { [u, v] } else { [v, u] };
        }
        self.locals[v as usize].ring = of_v;
        self.locals[u as usize].ring = of_u;
        for t in [self.now[2], self.now[3]] {
            self.locals[t as usize].touched = true;
        }
        self.vertex += 1;
        self.pass.extend([u, v]);
        Some(())
    }

    /// In the ring of `tip`, two edges for one.
    fn replace(&mut self, tip: u32, edge: u32, by: [u32; 2]) {
        let ring = &mut self.locals[tip as usize].ring;
        match ring.iter().position(|&e| e == edge) {
            Some(at) => drop(ring.splice(at..=at, by)),
            None => ring.extend(by),
        }
    }

    /// Where the new vertex of the last split is expected: amid its neighbours, as far as they are known.
    pub(in super::super) fn expected(&self) -> [f64; 3] {
        let [v, u, ..] = self.now;
        let (mut sum, mut count) = ([0.0; 3], 0);
        for &e in &self.locals[u as usize].ring {
            let ends = self.edges[e as usize].ends;
            let far = if ends[0] == u { ends[1] } else { ends[0] };
            if let Some(p) = self.locals[self.resolve(far) as usize].place {
                (0..3).for_each(|k| sum[k] += p[k]);
                count += 1;
            }
        }
        let l = &self.locals[v as usize];
        match (count, l.place.or(l.child)) {
            (0, near) => near.unwrap_or(self.place),
            (1, Some(near)) if l.place.is_none() => std::array::from_fn(|k| 0.5 * (sum[k] + near[k])),
            _ => sum.map(|x| x / count as f64),
        }
    }

    /// Where the new vertex of the last split is, and where its old vertex went.
    pub(in super::super) fn placed(&mut self, at: [f64; 3], moved: Option<[f64; 3]>) {
        self.place = at;
        self.locals[self.now[1] as usize].place = Some(at);
        let v = &mut self.locals[self.now[0] as usize];
        v.child = Some(at);
        v.place = moved.or(v.place);
    }
}
