//! The exact schedule: always the cheapest edge of all meshes.
//!
//! A lazy heap: entries hold a cost and an edge; a popped entry whose edge has become dearer goes back with its new cost.
//! That is exact for accumulated quadrics without normalisation, because their costs never fall. What is found to lose a thin part only when
//! its turn comes (see [`crate::thin`]) goes back likewise.

use crate::collapser::{Attempt, Collapser, Turn};
use crate::options::{Control, Stop};
use crate::radix_heap::RadixHeap;
use progmesh_aif::{Bits, EdgeId};

/// What to stop at.
pub(crate) struct Goal {
    /// Triangles wanted over all meshes.
    pub(crate) triangles: usize,
    /// Triangles there were at first.
    pub(crate) first: usize,
}

/// Edges of several meshes under one numbering.
pub(crate) struct Numbering {
    starts: Vec<u32>,
}

impl Numbering {
    pub(crate) fn new(meshes: &[Collapser<'_>]) -> Self {
        let mut sum = 0u32;
        let starts = meshes
            .iter()
            .map(|m| {
                let start = sum;
                sum += m.work.mesh.topology().edge_slots() as u32;
                start
            })
            .collect();
        Numbering { starts }
    }

    /// Mesh and edge of a number.
    #[inline]
    pub(crate) fn find(&self, n: u32) -> (usize, EdgeId) {
        let mesh = if self.starts.len() == 1 { 0 } else { self.starts.partition_point(|&s| s <= n) - 1 };
        (mesh, EdgeId(n - self.starts[mesh]))
    }

    /// Number of an edge.
    #[inline]
    pub(crate) fn number(&self, mesh: usize, e: EdgeId) -> u32 {
        self.starts[mesh] + e.0
    }
}

/// Orders by cost, then by edge: no negative costs, so the bits of an f32 sort as it does.
#[inline]
fn key(cost: f64, n: u32) -> u64 {
    (((cost as f32).to_bits() as u64) << 32) | n as u64
}

/// How far the work has come.
pub(crate) struct Progress<'c> {
    /// Triangles left over all meshes.
    pub(crate) left: usize,
    /// Triangles wanted.
    pub(crate) goal: usize,
    first: usize,
    control: &'c dyn Control,
}

impl<'c> Progress<'c> {
    pub(crate) fn new(meshes: &[Collapser<'_>], goal: &Goal, control: &'c dyn Control) -> Self {
        let left = meshes.iter().map(|m| m.work.triangles).sum();
        Progress { left, goal: goal.triangles, first: goal.first, control }
    }

    /// Tells the caller.
    pub(crate) fn report(&self) {
        let whole = self.first.saturating_sub(self.goal).max(1);
        // The last collapse may pass the goal by a triangle.
        let done = self.first.saturating_sub(self.left) as f64 / whole as f64;
        self.control.progress(done.min(1.0));
    }
}

/// Runs until the goal is met. `factors[i]` turns costs of mesh `i` into common ones.
pub(crate) fn run(meshes: &mut [Collapser<'_>], factors: &[f64], goal: &Goal, control: &dyn Control) -> Stop {
    let numbering = Numbering::new(meshes);
    let mut progress = Progress::new(meshes, goal, control);
    if progress.left <= goal.triangles {
        return Stop::Target;
    }
    let mut heap = RadixHeap::new();
    for (i, m) in meshes.iter_mut().enumerate() {
        for e in m.work.mesh.topology().edges() {
            match m.evaluate(e) {
                Some(c) => heap.push(key(c.cost * factors[i], numbering.number(i, e))),
                None => m.locked_edges += 1,
            }
        }
    }
    // Edges refused where they stood: they get another chance when their surroundings change, and one more at the end.
    let mut waiting: Vec<Bits> =
        meshes.iter().map(|m| Bits::new(m.work.mesh.topology().edge_slots())).collect();
    let mut bounded = false;
    let mut steps = 0u32;
    let mut left_at_end = usize::MAX;
    while progress.left > goal.triangles {
        let Some(top) = heap.pop() else {
            // Once more with all that was refused, as long as that still finds something.
            if progress.left == left_at_end {
                break;
            }
            left_at_end = progress.left;
            heap = RadixHeap::new();
            for (i, m) in meshes.iter().enumerate() {
                for e in m.work.mesh.topology().edges().filter(|e| waiting[i].get(e.index())) {
                    if let Some(c) = m.evaluate(e) {
                        heap.push(key(c.cost * factors[i], numbering.number(i, e)));
                    }
                }
                waiting[i].clear_all();
            }
            continue;
        };
        steps = steps.wrapping_add(1);
        if steps & 0x3ff == 0 {
            progress.report();
            if control.cancelled() {
                return Stop::Cancelled;
            }
        }
        let (i, e) = numbering.find(top as u32);
        let m = &mut meshes[i];
        if !m.work.mesh.topology().has_edge(e) {
            continue;
        }
        let Some(c) = m.evaluate(e) else { continue };
        let now = key(c.cost * factors[i], top as u32);
        if now > top {
            heap.push(now);
            continue;
        }
        if !m.within_bound(&c) {
            bounded = true;
            continue;
        }
        let before = m.work.triangles;
        let ceiling = f32::from_bits((top >> 32) as u32);
        let turn = Turn { ceiling, factor: factors[i], left: progress.left };
        match m.attempt(e, &c, turn) {
            Attempt::Done => {
                progress.left -= before - m.work.triangles;
                for &x in m.work.mesh.topology().star(c.roles.kept) {
                    if waiting[i].get(x.index()) {
                        waiting[i].clear(x.index());
                        // Due at once, or just behind: its true cost is found out when it comes up.
                        let due = (top >> 32 << 32) | numbering.number(i, x) as u64;
                        heap.push(if due < top { due + (1 << 32) } else { due });
                    }
                }
            }
            Attempt::Refused => waiting[i].set(e.index()),
            Attempt::Dearer(cost) => heap.push(key(cost as f64, top as u32)),
        }
    }
    match () {
        _ if progress.left <= goal.triangles => Stop::Target,
        _ if bounded || meshes.iter().any(|m| m.bounded) => Stop::Error,
        _ => Stop::NoLegalCollapse,
    }
}
