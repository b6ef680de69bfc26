//! The order of the splits of a part, and how they are divided into chunks: runs of subtrees, near each other in space; in a large part those of the largest errors first, apart.
//!
//! A view needs a chunk as soon as it needs one of its splits, and errors have long tails: the largest of a finest block of rough terrain are more than ten times as large as half of them. So where the tops stand among the others, half of the chunks that a flight needs are needed for
//! less than one in a hundred of their splits.

use super::super::direct;
use super::super::plan::Curve;
use super::part::Open;
use super::{Next, Path, PathSplits, Vertex};
use crate::aif::{NONE, Positions};
use crate::progressive::ProgressiveMesh;

/// Of a part of at least so many splits the tops have chunks of their own. In smaller ones a chunk holds few of them.
const LARGE: usize = 4096;
/// One in so many splits is a top, but for what they depend on. Over generated terrain of 4,097 x 4,097 one in 8 makes files 6 % larger (more of what follows is in other chunks, which pages name with bounds), more of them one in 20, 5 and 2 in tiers 24 %, of which a flight then decodes
/// a fifth less: in no less time.
const ONE_IN: usize = 20;

/// A part's splits on the way into the order of the file. Splits are named by their place in the part as it was given; on the path they come as `first + place`.
#[derive(Clone, Debug, Default)]
pub(super) struct Order {
    /// What each depends on: [`NONE`], splits of the path, those of the part behind them.
    pub(super) on: Vec<[u32; 3]>,
    /// The next split of its vertex, and the first of the vertex it makes.
    next: Vec<[u32; 2]>,
    /// By which those near each other in space come together.
    key: Vec<u64>,
    /// The vertices from before that are split in each chunk, in their order.
    pub(super) roots: Vec<Vec<u32>>,
    /// The chunk of each, once it is in one.
    chunk: Vec<u32>,
    /// The place of each in the order, once it has one.
    pub(super) slot: Vec<u32>,
    pub(super) order: Vec<u32>,
    /// Splits of every chunk.
    pub(super) counts: Vec<usize>,
}

impl Path<'_> {
    /// What each split of a part depends on. `None` if they refer to what does not exist.
    pub(super) fn needs(&self, part: &PathSplits, owner: &[u32]) -> Option<Vec<[u32; 3]>> {
        let (first, faces) = (self.splits(), self.faces());
        let mut last: Vec<u32> = self.vertices.iter().map(|v| v.last).collect();
        let s = &part.splits;
        let mut all = Vec::with_capacity(s.len());
        for (t, ((&v, &l), &r)) in (0u32..).zip(s.vertex.iter().zip(&s.left).zip(&s.right)) {
            let maker = |cut: u32| {
                if cut == NONE {
                    return Some(NONE);
                }
                let face = cut >> 2;
                match face.checked_sub(faces) {
                    None => Some(self.head.maker(face).map_or(NONE, |m| m.0)),
                    Some(k) => owner.get(k as usize).filter(|&&o| o < t).map(|o| first + o),
                }
            };
            let before = std::mem::replace(last.get_mut(v as usize)?, first + t);
            all.push([before, maker(l)?, maker(r)?]);
            last.push(first + t);
        }
        Some(all)
    }

    /// Puts the splits of a part into their order, and the vertices they make on the path. `None` if there is none.
    pub(super) fn arrange(
        &mut self,
        part: &PathSplits,
        owner: &[u32],
        file: u32,
        open: &mut Open,
    ) -> Option<Order> {
        let on = self.needs(part, owner)?;
        let m = on.len();
        let mut order = Order {
            next: vec![[NONE; 2]; m],
            chunk: vec![NONE; m],
            slot: vec![NONE; m],
            on,
            ..Order::default()
        };
        let (first, known) = (self.splits(), self.vertices.len() as u32);
        for (t, on) in (0u32..).zip(&order.on) {
            if let Some(b) = on[0].checked_sub(first).filter(|_| on[0] != NONE) {
                let same = part.splits.vertex[b as usize] == part.splits.vertex[t as usize];
                order.next[b as usize][usize::from(!same)] = t;
            }
        }
        // By the vertex of the mesh before that each descends from, along a curve through space.
        let mut root: Vec<u32> = Vec::with_capacity(m);
        for &v in &part.splits.vertex {
            root.push(v.checked_sub(known).map_or(v, |k| root[k as usize]));
        }
        let place = |v: u32| match v.checked_sub(self.head.base_vertices) {
            None => self.mesh.base_positions.get(v as usize),
            Some(k) => self.mesh.new_positions.get(k as usize),
        };
        let corners = root.iter().map(|&v| place(v).to_array()).collect();
        let around =
            ProgressiveMesh { base_positions: Positions::F64(corners), ..ProgressiveMesh::default() };
        let curve = Curve::new(&around);
        let mut keys: Vec<(u64, u32)> = root
            .iter()
            .zip(0..)
            .map(|(&v, t)| (u64::from(curve.at(place(v).to_array())) << 32 | u64::from(v), t))
            .collect();
        order.key = keys.iter().map(|k| k.0).collect();
        keys.sort_unstable();
        let is_top = tops(&part.splits.error, &order.on, first);
        let (top, others): (Vec<_>, Vec<_>) = keys.iter().partition(|k| is_top[k.1 as usize]);
        for keys in [top, others] {
            self.divide(part, &mut order, &keys, file, open)?;
        }
        Some(order)
    }

    /// Appends splits, with the keys by which they lie side by side, in chunks. What they depend on is there, or among them. `None` if not.
    fn divide(
        &mut self,
        part: &PathSplits,
        order: &mut Order,
        keys: &[(u64, u32)],
        file: u32,
        open: &mut Open,
    ) -> Option<()> {
        let n = keys.len();
        let aim = n.div_ceil(n.div_ceil(self.tree.chunk).max(1)).max(1);
        let (mut rest, mut waiting) = (keys, vec![]);
        while !rest.is_empty() || !waiting.is_empty() {
            let mut end = aim.min(rest.len());
            while end > 0 && end < rest.len() && rest[end].0 == rest[end - 1].0 {
                end += 1;
            }
            // A scrap goes with the last.
            if rest.len() - end < aim / 4 {
                end = rest.len();
            }
            let (run, others) = rest.split_at(end);
            rest = others;
            waiting.extend(run.iter().map(|k| k.1));
            let before = order.order.len();
            waiting = self.add(part, order, waiting, file, open);
            let count = order.order.len() - before;
            if count > 0 {
                order.counts.push(count);
            } else if rest.is_empty() {
                return None;
            }
        }
        Some(())
    }

    /// Appends those candidates that can come now, as a chunk, turn by turn; returns the others.
    fn add(
        &mut self,
        part: &PathSplits,
        order: &mut Order,
        mut candidates: Vec<u32>,
        file: u32,
        open: &mut Open,
    ) -> Vec<u32> {
        candidates.sort_unstable();
        let number = order.counts.len() as u32;
        let first = self.splits();
        let known = open.vertices as u32;
        let own = |d: u32| d.checked_sub(first).filter(|_| d != NONE);
        let vertex = |order: &Order, t: u32| {
            let v = part.splits.vertex[t as usize];
            v.checked_sub(known).map_or(v, |k| known + order.slot[k as usize])
        };
        let (mut chosen, mut roots) = (vec![], vec![]);
        candidates.retain(|&t| {
            let on = order.on[t as usize];
            let can = on.iter().all(|&d| own(d).is_none_or(|k| order.chunk[k as usize] != NONE));
            if can {
                order.chunk[t as usize] = number;
                // Until it has one.
                order.slot[t as usize] = chosen.len() as u32;
                if own(on[0]).is_none_or(|k| order.chunk[k as usize] != number) {
                    roots.push((order.key[t as usize], vertex(order, t), chosen.len() as u32));
                }
                chosen.push(t);
            }
            !can
        });
        roots.sort_unstable();
        let (of_roots, roots): (Vec<u32>, Vec<u32>) = roots.into_iter().map(|(_, v, t)| (v, t)).unzip();
        let here = |k: u32| match order.chunk.get(k as usize) {
            Some(&chunk) if chunk == number => order.slot[k as usize],
            _ => NONE,
        };
        let on: Vec<_> =
            chosen.iter().map(|&t| order.on[t as usize].map(|d| own(d).map_or(NONE, here))).collect();
        let next: Vec<_> = chosen.iter().map(|&t| order.next[t as usize].map(here)).collect();
        for k in direct::arrange(&on, &next, &roots) {
            let t = chosen[k as usize];
            let slot = order.order.len() as u32;
            let v = vertex(order, t);
            order.slot[t as usize] = slot;
            order.order.push(t);
            self.grow(v, (first + slot, file + slot), known, open);
        }
        if !of_roots.is_empty() {
            order.roots.push(of_roots);
        }
        candidates
    }

    /// Splits vertex `v`: notes what it was, and appends the new one. The split is numbered on the path and in the file.
    fn grow(&mut self, v: u32, (split, file): (u32, u32), known: u32, open: &mut Open) {
        let at = &mut self.vertices[v as usize];
        if v < known {
            open.undo.push((v, *at));
        }
        open.parent.push(at.node);
        let node = self.head.base_vertices + 2 * file;
        (at.last, at.node) = (split, node);
        self.vertices.push(Vertex { last: split, node: node + 1, next: Next::NOTHING });
    }
}

/// Of many splits the tops, and what they depend on: those from `first` on are these.
fn tops(errors: &[f32], on: &[[u32; 3]], first: u32) -> Vec<bool> {
    let m = errors.len();
    let mut is_top = vec![false; m];
    if m < LARGE {
        return is_top;
    }
    let mut all = errors.to_vec();
    let (_, &mut most, _) = all.select_nth_unstable_by(m - m / ONE_IN, f32::total_cmp);
    for t in (0..m).rev() {
        is_top[t] |= errors[t] > most;
        if is_top[t] {
            for k in on[t].iter().filter(|d| **d != NONE).filter_map(|d| d.checked_sub(first)) {
                is_top[k as usize] = true;
            }
        }
    }
    is_top
}
