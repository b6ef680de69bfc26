//! The order of the splits in a file, and how it is cut into chunks.
//!
//! Bands of error come one after the other; as errors nest along dependencies, that is an order splits may have. Within a band, the vertices alive at its start are
//! put in the order of their descent (a vertex's descendants side by side), and a chunk takes the splits of a run of them. A split
//! that depends on one of a later chunk of its band waits for that chunk. Within a chunk splits come in sweeps over its vertices ([`super::sweep`]).

use super::places;
use super::splits::error_level;
use crate::aif::NONE;
use crate::progressive::ProgressiveMesh;

/// Splits of a chunk, aimed at. Larger chunks are smaller in sum, but more has to be fetched for a region.
pub(super) const CHUNK: usize = 8192;
/// The first band has at least so many.
const LEAST: usize = 1500;
/// Other bands with fewer splits are joined with the next.
const SMALL: usize = 300;
/// Parts of the mesh whose bands begin at errors of their own, evenly spread, so that at every time some have just been refined and others
/// are about to be: the mesh never is much coarser in one half than in the other.
const SEGMENTS: u32 = 2;
/// Quarters of an octave of error in a band: a factor of 2 in distance, of 4 in squared distance, which is what methods count in. With both numbers the first 10, 25
/// and 50 % of the bytes have at most 1.17 times the rms of the method's own mesh on bunny, horse, igea and dragon; bands twice as wide, up to 1.7.
const BAND: u32 = 4;

/// Consecutive splits of a plan that make a chunk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) count: usize,
    pub(super) band: u32,
    pub(super) subtree: u32,
}

/// An order of the splits, and the chunks.
#[derive(Clone, Debug, Default)]
pub(super) struct Plan {
    pub(super) order: Vec<u32>,
    pub(super) pieces: Vec<Piece>,
    pub(super) levels: Vec<u32>,
}

/// The forest of splits: after split `i` the next at its vertex is `again[i]`, the first at the vertex it makes `first[i]`.
struct Forest {
    on: Vec<[u32; 3]>,
    again: Vec<u32>,
    first: Vec<u32>,
}

impl Forest {
    fn new(pm: &ProgressiveMesh) -> Self {
        let on = pm.dependencies();
        let n = on.len();
        let mut f = Forest { on, again: vec![NONE; n], first: vec![NONE; n] };
        for i in 0..n {
            let before = f.on[i][0];
            if before != NONE {
                let same = pm.splits.vertex[before as usize] == pm.splits.vertex[i];
                let of = if same { &mut f.again } else { &mut f.first };
                of[before as usize] = i as u32;
            }
        }
        f
    }
}

impl Plan {
    /// A chunk's roots come by number if chunks are read alone, else along the curve. `None` if the splits refer to what does not exist.
    pub(super) fn new(pm: &ProgressiveMesh, alone: bool, chunk: usize) -> Option<Plan> {
        let n = pm.splits.len();
        let n0 = pm.base_vertices();
        if pm.splits.vertex.iter().zip(n0..).any(|(&v, count)| v as usize >= count) {
            return None;
        }
        let rank = ranks(pm);
        let bands = bands(pm, &rank);
        let forest = Forest::new(pm);
        // The vertex at the start of the band that each split descends from.
        let mut root = vec![NONE; pm.vertices()];
        let mut keys = Vec::with_capacity(n);
        for i in 0..n {
            let v = pm.splits.vertex[i] as usize;
            let maker = v.checked_sub(n0);
            let r = if maker.is_some_and(|m| bands[m] == bands[i]) { root[v] } else { v as u32 };
            root[n0 + i] = r;
            keys.push(((bands[i] as u64) << 32 | rank[r as usize] as u64, i as u32));
        }
        keys.sort_unstable();
        let mut schedule = Schedule {
            pm,
            forest,
            chunk: vec![u32::MAX; n],
            slot: (0..n0 as u32).chain(std::iter::repeat_n(NONE, n)).collect(),
            order: Vec::with_capacity(n),
            curve: (!alone).then(|| Curve::new(pm)),
        };
        let mut plan = Plan::default();
        let segments = if pm.levels.len() > 2 { 1 } else { SEGMENTS };
        // What has to wait for splits of other segments waits for the next band of its own.
        let mut waiting = vec![Vec::new(); segments as usize];
        let mut number = 0;
        for band in keys.chunk_by(|a, b| a.0 >> 32 == b.0 >> 32) {
            let name = (band[0].0 >> 32) as u32;
            let segment = (name.saturating_sub(1) % segments) as usize;
            let aim = band.len().div_ceil(band.len().div_ceil(chunk.max(1)));
            let (mut rest, mut subtree) = (band, 0);
            while !rest.is_empty() || (segments == 1 && !waiting[0].is_empty()) {
                let mut end = aim.min(rest.len());
                while end > 0 && end < rest.len() && rest[end].0 == rest[end - 1].0 {
                    end += 1;
                }
                // A scrap goes with the last.
                if rest.len() - end < aim / 4 {
                    end = rest.len();
                }
                let mut candidates = std::mem::take(&mut waiting[segment]);
                candidates.extend(rest[..end].iter().map(|k| k.1));
                rest = &rest[end..];
                let before = schedule.order.len();
                waiting[segment] = schedule.add(candidates, number);
                number += 1;
                let count = schedule.order.len() - before;
                if count > 0 {
                    plan.pieces.push(Piece { count, band: name, subtree });
                    subtree += 1;
                } else if rest.is_empty() {
                    break;
                }
            }
        }
        // At the end nothing more can be in the way: each round brings at least the first of what waits.
        let mut band = plan.pieces.last().map_or(0, |p| p.band);
        while schedule.order.len() < n {
            let (before, mut subtree) = (schedule.order.len(), 0);
            band += 1;
            for wait in &mut waiting {
                let start = schedule.order.len();
                *wait = schedule.add(std::mem::take(wait), number);
                number += 1;
                let count = schedule.order.len() - start;
                if count > 0 {
                    plan.pieces.push(Piece { count, band, subtree });
                    subtree += 1;
                }
            }
            if schedule.order.len() == before {
                return None;
            }
        }
        plan.order = schedule.order;
        plan.levels = pm.levels.clone();
        Some(plan)
    }
}

/// The band of every split: the method's levels where it has any, else by error.
fn bands(pm: &ProgressiveMesh, rank: &[u32]) -> Vec<u32> {
    let n = pm.splits.len();
    if pm.levels.len() > 2 {
        let mut band = 0;
        return (0..n as u32)
            .map(|i| {
                while pm.levels.get(band as usize + 1).is_some_and(|&l| l <= i) {
                    band += 1;
                }
                band
            })
            .collect();
    }
    let level: Vec<u32> = pm.splits.error.iter().map(|&e| error_level(e)).collect();
    let most = level.iter().copied().max().unwrap_or(0);
    // The coarsest splits are one band, whatever their errors.
    let mut counts = vec![0usize; most as usize + 1];
    level.iter().for_each(|&l| counts[l as usize] += 1);
    let (mut start, mut size) = (most, 0);
    while size < LEAST && start > 0 {
        size += counts[start as usize];
        start -= 1;
    }
    // Below, the bands of each segment begin a part of a band later than those of the one before.
    let n0 = pm.base_vertices();
    let share = pm.vertices().div_ceil(SEGMENTS as usize).max(1);
    let of = |(i, &l): (usize, &u32)| {
        if l > start {
            return 0;
        }
        let segment = rank[n0 + i] / share as u32;
        let phase = BAND / SEGMENTS * (SEGMENTS - 1 - segment);
        let own = (start - l + phase) / BAND;
        1 + own * SEGMENTS + segment
    };
    let mut bands: Vec<u32> = level.iter().enumerate().map(of).collect();
    // Small bands are joined with the next of their segment.
    let mut counts = vec![0usize; bands.iter().max().map_or(0, |&b| b as usize + 1)];
    bands.iter().for_each(|&b| counts[b as usize] += 1);
    let mut joined: Vec<u32> = (0..counts.len() as u32).collect();
    for segment in 1..=SEGMENTS as usize {
        let (mut from, mut size) = (segment, 0);
        let mut left: usize = counts.iter().skip(segment).step_by(SEGMENTS as usize).sum();
        for b in (segment..counts.len()).step_by(SEGMENTS as usize) {
            size += counts[b];
            left -= counts[b];
            if (size >= SMALL && left >= SMALL) || left == 0 {
                (from..=b).step_by(SEGMENTS as usize).for_each(|k| joined[k] = b as u32);
                if left == 0 {
                    break;
                }
                (from, size) = (b + SEGMENTS as usize, 0);
            }
        }
    }
    bands.iter_mut().for_each(|b| *b = joined[*b as usize]);
    bands
}

/// Places along a curve through space, coarsely: in a box, by the bits of its coordinates in turn (Morton 1966).
#[derive(Clone, Copy, Debug)]
pub(super) struct Curve {
    low: [f64; 3],
    scale: f64,
}

impl Curve {
    /// Through the box of the base.
    pub(super) fn new(pm: &ProgressiveMesh) -> Self {
        let (low, high) = pm.base_positions.bounds().unwrap_or_default();
        let side = (high - low).max_element();
        let scale = if side > 0.0 { 1023.0 / side } else { 0.0 };
        Curve { low: low.to_array(), scale: if scale.is_finite() { scale } else { 0.0 } }
    }

    /// Where on the curve.
    #[inline]
    pub(super) fn at(&self, p: [f64; 3]) -> u32 {
        let spread = |axis: usize| {
            let x = ((p[axis] - self.low[axis]) * self.scale) as u32;
            let mut x = x.min(1023);
            x = (x | x << 16) & 0x0300_00FF;
            x = (x | x << 8) & 0x0300_F00F;
            x = (x | x << 4) & 0x030C_30C3;
            (x | x << 2) & 0x0924_9249
        };
        spread(0) | spread(1) << 1 | spread(2) << 2
    }
}

/// The place of every vertex in the order of descent: those of the base along a curve through space, every other behind the one it is
/// split from.
fn ranks(pm: &ProgressiveMesh) -> Vec<u32> {
    let n0 = pm.base_vertices();
    let curve = Curve::new(pm);
    let mut base: Vec<(u32, u32)> =
        (0..n0 as u32).map(|v| (curve.at(places::point(&pm.base_positions, v as usize)), v)).collect();
    base.sort_unstable();
    let mut next = vec![NONE; pm.vertices()];
    base.windows(2).for_each(|w| next[w[0].1 as usize] = w[1].1);
    for (&v, new) in pm.splits.vertex.iter().zip(n0..) {
        next[new] = next[v as usize];
        next[v as usize] = new as u32;
    }
    let mut rank = vec![0; next.len()];
    let (mut v, mut k) = (base.first().map_or(NONE, |b| b.1), 0);
    while v != NONE {
        rank[v as usize] = k;
        k += 1;
        v = next[v as usize];
    }
    rank
}

/// Makes the order, chunk by chunk.
struct Schedule<'a> {
    pm: &'a ProgressiveMesh,
    forest: Forest,
    /// The chunk of a split, once it is in one.
    chunk: Vec<u32>,
    /// Number in the file of a vertex, once it has one.
    slot: Vec<u32>,
    order: Vec<u32>,
    /// Along which a chunk's roots come.
    curve: Option<Curve>,
}

impl Schedule<'_> {
    /// Appends those candidates that can come now; returns the others.
    fn add(&mut self, mut candidates: Vec<u32>, number: u32) -> Vec<u32> {
        candidates.sort_unstable();
        let n0 = self.pm.base_vertices();
        let mut roots: Vec<(u32, u32, u32)> = Vec::new();
        candidates.retain(|&i| {
            let on = self.forest.on[i as usize];
            let can = on.iter().all(|&d| d == NONE || self.chunk[d as usize] != u32::MAX);
            if can {
                self.chunk[i as usize] = number;
                if on[0] == NONE || self.chunk[on[0] as usize] != number {
                    let v = self.pm.splits.vertex[i as usize] as usize;
                    let key = self.curve.map_or(0, |c| match v.checked_sub(n0) {
                        Some(made) => c.at(places::point(&self.pm.new_positions, made)),
                        None => c.at(places::point(&self.pm.base_positions, v)),
                    });
                    roots.push((key, self.slot[v], i));
                }
            }
            !can
        });
        roots.sort_unstable();
        // A list of the vertices by the split that is to come at each.
        let mut list: Vec<u32> = roots.into_iter().map(|r| r.2).collect();
        let mut pass = Vec::with_capacity(list.len());
        while !list.is_empty() {
            std::mem::swap(&mut list, &mut pass);
            list.clear();
            pass.reverse();
            // `pass` is a stack: what is split puts its vertices back on it.
            while let Some(i) = pass.pop() {
                let ready = |d: u32| {
                    d == NONE || self.chunk[d as usize] != number || self.slot[n0 + d as usize] != NONE
                };
                if !self.forest.on[i as usize].into_iter().all(ready) {
                    list.push(i);
                    continue;
                }
                self.slot[n0 + i as usize] = (n0 + self.order.len()) as u32;
                self.order.push(i);
                let here = |s: &u32| *s != NONE && self.chunk[*s as usize] == number;
                pass.extend(Some(self.forest.first[i as usize]).filter(here));
                pass.extend(Some(self.forest.again[i as usize]).filter(here));
            }
        }
        candidates
    }
}
