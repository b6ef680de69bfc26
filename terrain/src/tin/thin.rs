//! Fewer triangles within the tolerance: vertices taken away, cheapest first, sides swapped, heights moved.

use super::heights::Samples;
use super::patch::{MOST_CORNERS, NONE, Patch, Ring};
use super::scan::area;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Vertices with more neighbours are not taken away: the hole has O(corners^3) triangles to look at. Counts of 8 to 12 give the same
/// number of triangles within 0.3 % (fuji, grandcanyon).
const MOST_NEIGHBOURS: usize = 9;
const _: () = assert!(MOST_NEIGHBOURS <= MOST_CORNERS);

/// Buffers of one thread.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    ring: Ring,
    other: Ring,
    samples: Samples,
    fill: Vec<[u8; 3]>,
}

/// Costs as integers in the same order.
fn key(cost: f64) -> u64 {
    let bits = cost.to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

/// A vertex that is not queued.
const IDLE: u64 = u64::MAX;

impl Patch<'_> {
    /// Moves heights, swaps sides, takes vertices away.
    pub(super) fn improve(&mut self, scratch: &mut Scratch) {
        self.relax_all(scratch);
        self.swap_all();
        self.thin(scratch);
    }

    /// Every vertex once. O(samples).
    fn relax_all(&mut self, scratch: &mut Scratch) {
        for v in 0..self.vertices.len() as u32 {
            if self.vertices[v as usize].triangle != NONE {
                self.relax(v, &mut scratch.ring, &mut scratch.samples);
            }
        }
    }

    /// By how much the energy grows without a vertex; the ring and its filling stay in `scratch`. `None` where that cannot be.
    fn removal(&self, v: u32, scratch: &mut Scratch) -> Option<f64> {
        let vertex = &self.vertices[v as usize];
        if vertex.locked || vertex.kept || vertex.triangle == NONE {
            return None;
        }
        let ring = &mut scratch.ring;
        self.ring(v, ring);
        let n = ring.vertices.len();
        if !(3..=MOST_NEIGHBOURS).contains(&n) || !ring.closed && !self.is_straight(v, ring) {
            return None;
        }
        let corner = |&u: &u32| self.corner(u);
        let mut hole = [corner(&v); MOST_NEIGHBOURS];
        for (c, u) in hole.iter_mut().zip(&ring.vertices) {
            *c = corner(u);
        }
        let new = self.fill(&hole[..n], &mut scratch.fill)?;
        Some(new - ring.triangles.iter().map(|&t| self.energy_of(t)).sum::<f64>())
    }

    /// The energy of a triangle that is there.
    fn energy_of(&self, t: u32) -> f64 {
        let [a, b, c] = self.triangles[t as usize].map(|v| self.corner(v));
        self.energy(a, b, c, f64::INFINITY).unwrap_or(0.0)
    }

    /// Takes vertices away while the tolerance allows, the cheapest first.
    fn thin(&mut self, scratch: &mut Scratch) {
        let mut queued = vec![IDLE; self.vertices.len()];
        let mut queue = BinaryHeap::new();
        for v in 0..self.vertices.len() as u32 {
            if let Some(cost) = self.removal(v, scratch) {
                queued[v as usize] = key(cost);
                queue.push(Reverse((key(cost), v)));
            }
        }
        while let Some(Reverse((cost, v))) = queue.pop() {
            if queued[v as usize] != cost {
                continue;
            }
            queued[v as usize] = IDLE;
            // Its surroundings may have changed since.
            let Some(now) = self.removal(v, scratch).map(key) else { continue };
            if now > cost && queue.peek().is_some_and(|Reverse((next, _))| now > *next) {
                queued[v as usize] = now;
                queue.push(Reverse((now, v)));
                continue;
            }
            let ring = std::mem::take(&mut scratch.ring);
            self.replace(&ring.triangles, &ring.vertices, &scratch.fill);
            self.vertices[v as usize].triangle = NONE;
            for &u in &ring.vertices {
                self.relax(u, &mut scratch.other, &mut scratch.samples);
            }
            for &u in &ring.vertices {
                // Those in the queue are looked at again when their turn comes: costs mostly grow.
                if queued[u as usize] == IDLE
                    && let Some(cost) = self.removal(u, scratch)
                {
                    queued[u as usize] = key(cost);
                    queue.push(Reverse((key(cost), u)));
                }
            }
            scratch.ring = ring;
        }
    }

    /// Swaps every side once where that lessens the energy.
    fn swap_all(&mut self) {
        for t in 0..self.triangles.len() as u32 {
            for i in 0..3 {
                let corners = self.triangles[t as usize];
                if corners[0] == NONE {
                    break;
                }
                let other = self.across[t as usize][i];
                if other == NONE || other < t {
                    continue;
                }
                let (a, b, p) = (corners[i], corners[(i + 1) % 3], corners[(i + 2) % 3]);
                if self.is_kept(a, b) {
                    continue;
                }
                let Some(q) = self.triangles[other as usize].into_iter().find(|&q| q != a && q != b) else {
                    continue;
                };
                let [ca, cb, cp, cq] = [a, b, p, q].map(|v| self.corner(v));
                let plan = |c: super::scan::Corner| (c.x, c.y);
                if area(plan(ca), plan(cq), plan(cp)) <= 0 || area(plan(cq), plan(cb), plan(cp)) <= 0 {
                    continue;
                }
                let old = self.energy_of(t) + self.energy_of(other);
                let Some(one) = self.energy(ca, cq, cp, old) else { continue };
                let Some(two) = self.energy(cq, cb, cp, old - one) else { continue };
                // Not for the last digits, or two diagonals could take turns.
                if one + two < old * (1.0 - 1e-3) {
                    self.replace(&[t, other], &[a, q, b, p], &[[0, 1, 3], [1, 2, 3]]);
                }
            }
        }
    }
}
