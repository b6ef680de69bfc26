//! The bulk schedule: rounds of cheap edges that are each the cheapest at both their ends.
//!
//! A round: evaluate what changed, find the cost below which lies a share of what is still to go, let every vertex name its cheapest edge
//! below it, collapse the edges that both ends name. All but the collapsing itself runs over flat arrays in edge order, in
//! parallel, with the same result for any number of threads: ties go by edge id, and a verdict found in parallel is used only if nothing
//! around has changed since.

use crate::collapser::{Attempt, Collapser, Refusal, Scratch, Turn, Verdict};
use crate::exact::{Goal, Progress};
use crate::options::{Control, Stop};
use crate::parallel::{map_chunks, map_init_chunks, threads};
use progmesh_aif::{Bits, EdgeId, Marks};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Edges taken into a round, as a share of the collapses still to do. Decided on bunny, horse, rangemap and dragon: at 2
/// their rms stays within 2 % of the exact schedule's; 1 takes about a fifth more time at 50 %.
const SHARE: f64 = 2.0;
/// The dearest edge of a round costs at most this many times the one at a quarter of it: where costs jump, as between the planes and the
/// edges of CAD parts, the round ends. Decided on fandisk.
const SPREAD: f32 = 4.0;
/// Common cost below which all are alike: a distance of 1e-7 diagonals over a face of 1e-6.
const NOISE: f32 = 1e-20;
/// From this many triangles down the exact schedule takes over: they fit a cache, and the last decades decide the result.
const TAIL: usize = 32_768;
/// The exact schedule also takes over when no more than this part of the goal is still to go: finding all costs anew is cheaper than the
/// many rounds that would close in on it.
const LAST: usize = 32;
/// A round that does less than this part of what is to go is the last.
const STALL: usize = 64;
/// At least this many edges are taken into a round.
const LEAST: usize = 256;
/// Entries a task takes.
const CHUNK: usize = 8192;

/// An edge and its cost in common units, or a lower bound of it where the edge is dirty: quadric costs never fall. Where a thin part would
/// go, what was lost when last tried. Infinite when the kinds
/// of its vertices, or the error bound, forbid the collapse.
#[derive(Clone, Copy)]
struct Entry {
    edge: EdgeId,
    cost: f32,
}

impl Entry {
    #[inline]
    fn key(self) -> u64 {
        // Ties go by edge id, scattered (odd factors are bijections): in id order a plane would have one cheapest edge.
        ((self.cost.to_bits() as u64) << 32) | self.edge.0.wrapping_mul(0x9e37_79b1) as u64
    }
}

/// A mesh in rounds.
struct Lane {
    entries: Vec<Entry>,
    dead: usize,
    /// Edges whose cost must be found anew, once their old one is low enough to matter.
    dirty: Bits,
    /// Edges refused as they stand.
    blocked: Bits,
    /// The cheapest edge of every vertex in this round.
    best: Vec<AtomicU64>,
    /// Vertices that a collapse of this round moved or has beside it.
    touched: Marks,
}

/// What a lane puts into a round.
struct Winner {
    entry: usize,
    key: u64,
    verdict: Option<Result<Verdict, Refusal>>,
}

/// Runs until the tail, then hands over to the exact schedule. `factors[i]` turns costs of mesh `i` into common ones.
pub(crate) fn run(meshes: &mut [Collapser<'_>], factors: &[f64], goal: &Goal, control: &dyn Control) -> Stop {
    let threads = threads();
    let mut progress = Progress::new(meshes, goal, control);
    let mut lanes: Vec<Lane> = meshes.iter().map(Lane::new).collect();
    for ((lane, m), &f) in lanes.iter_mut().zip(meshes.iter()).zip(factors) {
        lane.evaluate(m, f, f32::INFINITY);
    }
    while progress.left > (goal.triangles + goal.triangles / LAST).max(TAIL) {
        if control.cancelled() {
            return Stop::Cancelled;
        }
        lanes.iter_mut().zip(meshes.iter()).for_each(|(lane, m)| lane.bury(m));
        let need = (progress.left - goal.triangles).div_ceil(2);
        let Some(limit) = limit_cost(&lanes, ((need as f64 * SHARE) as usize).max(LEAST)) else { break };
        let before = progress.left;
        for ((lane, m), &f) in lanes.iter_mut().zip(meshes.iter_mut()).zip(factors) {
            lane.evaluate(m, f, limit);
            let winners = lane.pick(m, limit, threads);
            lane.perform(m, winners, (limit, f), &mut progress);
        }
        progress.report();
        if before - progress.left < need / STALL {
            break;
        }
    }
    // The exact schedule finishes, tries what was refused again, and says why it ends.
    crate::exact::run(meshes, factors, goal, control)
}

impl Lane {
    fn new(m: &Collapser<'_>) -> Self {
        let t = m.work.mesh.topology();
        let entries: Vec<Entry> = t.edges().map(|edge| Entry { edge, cost: 0.0 }).collect();
        let mut dirty = Bits::new(t.edge_slots());
        entries.iter().for_each(|e| dirty.set(e.edge.index()));
        let best = (0..t.vertex_slots()).map(|_| AtomicU64::new(u64::MAX)).collect();
        Lane { entries, dead: 0, dirty, blocked: Bits::new(t.edge_slots()), best, touched: Marks::default() }
    }

    /// Takes dead edges out of the running; drops their entries when they are half.
    fn bury(&mut self, m: &Collapser<'_>) {
        let t = m.work.mesh.topology();
        if 2 * self.dead > self.entries.len() {
            self.entries.retain(|e| t.has_edge(e.edge));
            self.dead = 0;
            return;
        }
        map_chunks(&mut self.entries, CHUNK, |chunk| {
            for entry in chunk.iter_mut().filter(|e| !t.has_edge(e.edge)) {
                entry.cost = f32::INFINITY;
            }
        });
    }

    /// Finds the costs of dirty edges whose bound is at most `limit`.
    fn evaluate(&mut self, m: &Collapser<'_>, factor: f64, limit: f32) {
        let dirty = &self.dirty;
        let done = map_chunks(&mut self.entries, CHUNK, |chunk| {
            let mut done = Vec::new();
            for entry in chunk.iter_mut().filter(|e| e.cost <= limit && dirty.get(e.edge.index())) {
                entry.cost = match m.evaluate(entry.edge) {
                    Some(c) if m.within_bound(&c) => (c.cost * factor) as f32,
                    _ => f32::INFINITY,
                };
                done.push(entry.edge);
            }
            done
        });
        for e in done.into_iter().flatten() {
            self.dirty.clear(e.index());
        }
    }

    /// The edges of cost up to `limit` that are the cheapest at both ends, in edge order, with their verdicts when there is more than
    /// one thread to find them.
    fn pick(&mut self, m: &Collapser<'_>, limit: f32, threads: usize) -> Vec<Winner> {
        let t = m.work.mesh.topology();
        let best = &self.best;
        let (dirty, blocked) = (&self.dirty, &self.blocked);
        let wanted =
            |e: &Entry| e.cost <= limit && !blocked.get(e.edge.index()) && !dirty.get(e.edge.index());
        map_chunks(&mut self.entries, CHUNK, |chunk| {
            for e in chunk.iter().filter(|e| wanted(e)) {
                let key = e.key();
                for v in t.edge_vertices(e.edge) {
                    let b = &best[v.index()];
                    if b.load(Relaxed) > key {
                        b.fetch_min(key, Relaxed);
                    }
                }
            }
        });
        let entries = &self.entries;
        let parts = map_init_chunks(entries, CHUNK, Scratch::default, |scratch, start, chunk| {
            let mut winners = Vec::new();
            for (i, e) in chunk.iter().enumerate().filter(|(_, e)| wanted(e)) {
                let key = e.key();
                if t.edge_vertices(e.edge).iter().all(|v| best[v.index()].load(Relaxed) == key) {
                    let verdict = (threads > 1)
                        .then(|| m.evaluate(e.edge))
                        .flatten()
                        .map(|c| m.check(e.edge, &c, scratch));
                    winners.push(Winner { entry: start + i, key, verdict });
                }
            }
            winners
        });
        let winners: Vec<Winner> = parts.into_iter().flatten().collect();
        map_chunks(&mut self.entries, CHUNK, |chunk| {
            for e in chunk.iter().filter(|e| wanted(e)) {
                t.edge_vertices(e.edge).iter().for_each(|v| best[v.index()].store(u64::MAX, Relaxed));
            }
        });
        winners
    }

    /// Collapses the winners, cheapest first only where not all are needed. Those that lose more than the
    /// round's `ceiling` wait for another; `factor` turns costs into common ones.
    fn perform(
        &mut self,
        m: &mut Collapser<'_>,
        mut winners: Vec<Winner>,
        (ceiling, factor): (f32, f64),
        progress: &mut Progress<'_>,
    ) {
        // Another mesh may have reached the goal already.
        if 2 * winners.len() > progress.left.saturating_sub(progress.goal) {
            winners.sort_unstable_by_key(|w| w.key);
        }
        self.touched.clear(m.work.points.len());
        for w in winners {
            if progress.left <= progress.goal {
                break;
            }
            let e = self.entries[w.entry].edge;
            let t = m.work.mesh.topology();
            if !t.has_edge(e) {
                continue;
            }
            let fresh = !t.edge_vertices(e).iter().any(|&v| self.touched.has(v));
            let Some(c) = m.evaluate(e) else { continue };
            let before = m.work.triangles;
            let turn = Turn { ceiling, factor, left: progress.left };
            let done = match w.verdict.filter(|_| fresh) {
                Some(verdict) => m.follow(e, &c, verdict, turn),
                None => m.attempt(e, &c, turn),
            };
            match done {
                Attempt::Done => {}
                Attempt::Refused => {
                    self.blocked.set(e.index());
                    continue;
                }
                Attempt::Dearer(cost) => {
                    self.entries[w.entry].cost = cost;
                    continue;
                }
            }
            let gone = before - m.work.triangles;
            progress.left -= gone;
            self.dead += 1 + gone;
            let t = m.work.mesh.topology();
            self.touched.set(c.roles.kept);
            for &x in t.star(c.roles.kept) {
                self.dirty.set(x.index());
                self.blocked.clear(x.index());
                self.touched.set(t.other(x, c.roles.kept));
            }
        }
    }
}

/// The cost below which lie about `rank` entries; `None` when none is finite.
fn limit_cost(lanes: &[Lane], rank: usize) -> Option<f32> {
    // Sign, exponent and five bits of the mantissa: costs to 3 %, in a table that stays in the cache.
    const SHIFT: u32 = 18;
    let mut histogram = [0u32; 1 << (32 - SHIFT)];
    for lane in lanes {
        for e in lane.entries.iter().filter(|e| e.cost < f32::INFINITY && !lane.blocked.get(e.edge.index())) {
            histogram[(e.cost.to_bits() >> SHIFT) as usize] += 1;
        }
    }
    let (mut sum, mut low, mut last) = (0, None, None);
    for (bits, &n) in histogram.iter().enumerate().filter(|(_, n)| **n > 0) {
        let cost = f32::from_bits(((bits as u32) << SHIFT) | ((1 << SHIFT) - 1));
        sum += n as usize;
        if sum >= rank / 4 {
            let spread = *low.get_or_insert(cost) * SPREAD;
            if last.is_some() && cost > spread.max(NOISE) {
                break;
            }
        }
        last = Some(cost);
        if sum >= rank {
            break;
        }
    }
    last
}
