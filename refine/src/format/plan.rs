//! The order of the splits in a file, and how it is cut into chunks.
//!
//! Bands of error come one after the other; as errors nest along dependencies, that is an order splits may have. A band ends where it has made a given multiple of the
//! vertices that it began with. Within a band, the splits that descend from one vertex of its start stay together; the region that these vertices are in is cut, and cut again, until there are
//! compact parts of a chunk each. A chunk takes the splits of its part, and those of others that they depend on and that no chunk has
//! yet: they are near, and would have to be repeated otherwise. Within a chunk splits come in sweeps over its vertices ([`super::sweep`]).

use super::places;
use super::splits::{MOST_LEVEL, error_level};
use crate::aif::{NONE, Positions};
use crate::hierarchy::Further;
use crate::progressive::ProgressiveMesh;
use std::cmp::Ordering;

/// How splits are divided into bands and chunks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// Splits of a chunk, at most but for those of a single vertex, and those of others that they need. The first band, which needs nothing but the base, has a quarter of that.
    chunk: usize,
    /// A band makes so many vertices of one.
    growth: f64,
    /// So far back from the end the last band of the first segment begins, in bands.
    last: f64,
    /// By so much more those of the next segment do, in bands.
    shift: f64,
    /// Up to so many splits the mesh is not divided into segments, and its bands are as wide as chunks allow.
    small: usize,
    /// With this share of all vertices the last band begins, and those before evenly between the first and it, each making [`Layout::growth`] vertices of one at most; the mesh is not divided into segments then. 0: otherwise.
    tail: f64,
}

/// Parts of the mesh whose bands begin at counts of their own, evenly spread, so that at every time some have just been refined and others are about to
/// be: the mesh never is much coarser in one part than in another.
const SEGMENTS: usize = 2;

/// Where the last band begins before an order. Dragon decided: by `bench/examples/prefixes`, quadric with endpoint placement, the first 10, 25 and 50 % of the bytes have 1.31, 1.42 and 1.34 times the rms of the method's own mesh, and connectivity takes
/// 15.8 bits a split; at 0.62 the half has 1.53, at 0.66 connectivity takes 16.1. Bunny has at most 1.07, horse 1.09, igea 1.32, generated scans of 200,000 and 400,000 faces 1.01, a torus, a sphere and a fractal terrain, which decided nothing, 1.22.
const BEFORE_ORDER: f64 = 0.64;

/// For meshes of some chunks (65,536 to 131,072 splits), which two segments would leave with few bands: as before an order. With it rangemap's first 10, 25 and 50 % of the bytes have 1.04, 1.00 and 0.89 times the rms of the method's own mesh, 1.81, 1.47 and 0.92
/// with segments; generated scans, tori and spheres of that size have at most 1.04, and take as many bytes to 0.6 %. Larger meshes (igea, dragon) would gain as much, but dragon takes 3 % more.
const MIDDLING: (f64, f64) = (0.4, 3.0);

impl Layout {
    /// For chunks that are read alone: wide bands, as a chunk repeats what its band builds on. Dragon, igea and a generated scan of 400,000 faces decided: without the order their first 10, 25 and 50 % of the
    /// bytes have 1.26, 1.28, 1.38 times the rms of the method's own mesh, 1.39, 1.24, 1.19, and 1.22, 1.15, 1.11 (`bench/examples/prefixes`). With 3.5, 0.8 and 0.13 dragon takes 0.9 bits a vertex less, and
    /// has up to 1.51, the scan 1.81.
    pub(super) fn alone(chunk: Option<u32>) -> Layout {
        let chunk = chunk.unwrap_or(16_384).max(1) as usize;
        Layout { chunk, growth: 3.4, last: 0.68, shift: 0.3, small: 4 * chunk, tail: 0.0 }
    }

    /// For chunks that follow each other.
    pub(super) fn sequential(chunk: Option<u32>) -> Layout {
        let chunk = chunk.unwrap_or(8192).max(1) as usize;
        Layout { chunk, growth: 2.0, last: 0.5, shift: 0.5, small: 0, tail: 0.0 }
    }

    /// For a file that ends with the input's order, a third of it: half of the bytes then hold three quarters of the splits. Bands of even steps make at most three vertices of one whatever the size of the mesh: with the last but one at a share that serves
    /// dragon (0.24) the second band of bunny makes five, and a quarter of the bytes, which ends within it, has 2.45 times the rms.
    pub(super) fn before_order(self) -> Layout {
        Layout { tail: BEFORE_ORDER, small: 0, growth: 3.0, ..self }
    }

    /// [`Layout::tail`], and by how much bands then grow, for a mesh.
    fn even(&self, pm: &ProgressiveMesh) -> Option<(f64, f64)> {
        let n = pm.splits.len();
        match self.tail > 0.0 {
            true => Some((self.tail, self.growth)),
            false if self.small < n && n <= 2 * self.small => Some(MIDDLING),
            false => None,
        }
    }

    /// Parts into which the mesh is divided.
    fn segments(&self, pm: &ProgressiveMesh) -> usize {
        let whole = pm.levels.len() > 2 || self.even(pm).is_some() || pm.splits.len() <= self.small;
        if whole { 1 } else { SEGMENTS }
    }

    /// Splits of the first band.
    fn first(&self, pm: &ProgressiveMesh) -> usize {
        // Where all others have only two chunks, more of them spare a band.
        let eighths = if pm.splits.len() <= self.small / 8 * 5 { 3 } else { 2 };
        (eighths * self.chunk).div_ceil(8).min(most_first(pm))
    }

    /// With how many of all vertices of a segment the `k`-th of its bands begins, counted from the last, where the second of all has `first`.
    fn start(&self, pm: &ProgressiveMesh, (segment, all): (usize, usize), first: usize, k: usize) -> f64 {
        let all = all as f64;
        if let Some((tail, growth)) = self.even(pm) {
            let last = all * tail;
            let times = (last / first.max(1) as f64).max(1.0);
            let steps = (times.ln() / growth.ln()).ceil().max(1.0);
            return last * times.powf(-(k as f64) / steps);
        }
        if pm.splits.len() <= self.small {
            // The last band has two chunks, or makes four vertices of one: half of the bytes are there before its first chunk is.
            return (all / SMALL_GROWTH).max(all - 2.0 * self.chunk as f64) / SMALL_GROWTH.powi(k as i32);
        }
        all * self.growth.powf(-(k as f64 + self.last + self.shift * segment as f64))
    }
}

/// Splits of the first band at most, so that 64 KiB of a file with attributes or doubles show more than its base, too. Horse with normals takes 28 bytes for one of its first splits, bunny with texture coordinates 25, fandisk in doubles 18.
fn most_first(pm: &ProgressiveMesh) -> usize {
    let numbers = pm.wedges.as_ref().map_or(0, |w| w.stride);
    let doubles = matches!(pm.base_positions, Positions::F64(_));
    if numbers == 0 && !doubles { usize::MAX } else { (48 << 10) / (12 + 7 * (numbers + doubles as usize)) }
}

/// What a band of a mesh that is not divided makes of a vertex, at most (but for the second, where it would begin shortly behind the first).
const SMALL_GROWTH: f64 = 4.0;

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

/// What a plan looks at of a split, side by side. Splits of a band that descend from one vertex of its start stand side by side, too: as they come, in the order of their errors, each would be somewhere else in memory.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Where those stand that it depends on.
    on: [u32; 3],
    /// Where the next at its vertex stands, and the first at the vertex it makes.
    again: u32,
    first: u32,
    /// Its vertex, in the order of descent.
    vertex: u32,
}

/// The forest of splits, given which one stands where.
fn forest(pm: &ProgressiveMesh, on: &[[u32; 3]], rank: &[u32], splits: &[u32]) -> Vec<Node> {
    let n0 = pm.base_vertices();
    let place = places_of(splits);
    let find = |i: u32| place.get(i as usize).copied().unwrap_or(NONE);
    let mut nodes: Vec<Node> = splits
        .iter()
        .map(|&i| Node {
            on: on[i as usize].map(find),
            again: NONE,
            first: NONE,
            vertex: rank[pm.splits.vertex[i as usize] as usize],
        })
        .collect();
    for at in 0..splits.len() {
        let before = nodes[at].on[0];
        if let Some(node) = nodes.get_mut(before as usize) {
            // The one before is at the same vertex, or made it.
            let made = n0 + splits[before as usize] as usize;
            let v = pm.splits.vertex[splits[at] as usize] as usize;
            let to = if v == made { &mut node.first } else { &mut node.again };
            *to = at as u32;
        }
    }
    nodes
}

impl Plan {
    /// Given what every split depends on. With `further`, what the ring rule needs beside: no chunk needs a later one then, and bands are by the bounds' errors, in whose order that rule has the splits. `None` if the splits refer to what does not exist.
    pub(super) fn new(
        pm: &ProgressiveMesh,
        on: &[[u32; 3]],
        layout: Layout,
        further: Option<&Further>,
    ) -> Option<Plan> {
        let n = pm.splits.len();
        let n0 = pm.base_vertices();
        if pm.splits.vertex.iter().zip(n0..).any(|(&v, count)| v as usize >= count) {
            return None;
        }
        let base = base_order(pm);
        let rank = ranks(pm, &base);
        let bands = bands(pm, &rank, layout, further.is_some());
        // The vertex at the start of the band that each split descends from.
        let mut root = vec![NONE; pm.vertices()];
        for i in 0..n {
            let v = pm.splits.vertex[i] as usize;
            let maker = v.checked_sub(n0);
            let r = if maker.is_some_and(|m| bands[m] == bands[i]) { root[v] } else { v as u32 };
            root[n0 + i] = r;
        }
        // By band, in each by the vertex they descend from, in the order of descent.
        let all: Vec<u32> = (0..n as u32).collect();
        let last = bands.iter().max().map_or(0, |&b| b as usize + 1);
        let rooted = sorted(&all, pm.vertices(), |i| rank[root[n0 + i as usize] as usize] as usize);
        let splits = sorted(&rooted, last, |i| bands[i as usize] as usize);
        let nodes = forest(pm, on, &rank, &splits);
        let mut schedule = Schedule {
            nodes,
            splits: &splits,
            further: further.map(|f| (f, places_of(&splits))),
            chunk: vec![NONE; n],
            done: vec![false; n],
            order: Vec::with_capacity(n),
        };
        let mut plan = Plan::default();
        let mut at = 0;
        for band in splits.chunk_by(|&a, &b| bands[a as usize] == bands[b as usize]) {
            let name = bands[band[0] as usize];
            let of = |i: u32| root[n0 + i as usize];
            let subtrees: Vec<Subtree> = band
                .chunk_by(|&a, &b| of(a) == of(b))
                .map(|same| {
                    let v = of(same[0]) as usize;
                    let made = v.checked_sub(n0).map(|i| pm.new_positions.get(i).to_array());
                    let first = at;
                    at += same.len() as u32;
                    Subtree {
                        first,
                        end: at,
                        at: made.unwrap_or_else(|| places::point(&pm.base_positions, v)),
                        left: 0,
                    }
                })
                .collect();
            let before = plan.pieces.len();
            // Regions still to be cut, the next one last.
            let mut regions = vec![(subtrees, usize::MAX)];
            while let Some((mut region, parts)) = regions.pop() {
                region.iter_mut().for_each(|s| s.left = schedule.left(s.first..s.end));
                region.retain(|s| s.left > 0);
                let left: usize = region.iter().map(|s| s.left as usize).sum();
                let parts = parts.min(left.div_ceil(layout.chunk));
                if parts > 1 && region.len() > 1 {
                    let rest = cut(&mut region, left, parts);
                    regions.push((rest, parts - parts / 2));
                    regions.push((region, parts / 2));
                } else if left > 0 {
                    let number = plan.pieces.len() as u32;
                    let mut taken = Vec::with_capacity(left + left / 8);
                    region
                        .iter()
                        .flat_map(|s| s.first..s.end)
                        .for_each(|i| schedule.take(i, number, &mut taken));
                    schedule.add(&taken, number);
                    let subtree = (plan.pieces.len() - before) as u32;
                    plan.pieces.push(Piece { count: taken.len(), band: name, subtree });
                }
            }
        }
        if schedule.order.len() < n {
            return None;
        }
        plan.order = schedule.order;
        plan.levels = pm.levels.clone();
        Some(plan)
    }
}

/// Where each stands.
fn places_of(splits: &[u32]) -> Vec<u32> {
    let mut place = vec![NONE; splits.len()];
    splits.iter().zip(0..).for_each(|(&i, at)| place[i as usize] = at);
    place
}

/// Splits of a band that descend from one vertex of its start, where that is, and how many of them no chunk has yet.
struct Subtree {
    first: u32,
    end: u32,
    left: u32,
    at: [f64; 3],
}

/// Cuts a region that is to be `parts` chunks across its longest side, and returns what lies behind the cut: both are compact, so that little around them has to be repeated.
fn cut(region: &mut Vec<Subtree>, left: usize, parts: usize) -> Vec<Subtree> {
    let (mut lows, mut highs) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for s in region.iter() {
        for a in 0..3 {
            (lows[a], highs[a]) = (lows[a].min(s.at[a]), highs[a].max(s.at[a]));
        }
    }
    let sides: [f64; 3] = std::array::from_fn(|a| highs[a] - lows[a]);
    let longest = (0..3).max_by(|&a, &b| sides[a].total_cmp(&sides[b])).unwrap_or(0);
    let aim = left / parts * (parts / 2);
    // Slices across it, so that only one has to be sorted.
    let (low, length) = (lows[longest], sides[longest]);
    let slices = region.len().clamp(1, 1 << 12);
    let scale = slices as f64 / length;
    let slice = |s: &Subtree| (((s.at[longest] - low) * scale) as usize).min(slices - 1);
    let mut sums = vec![0; slices];
    region.iter().for_each(|s| sums[slice(s)] += s.left as usize);
    let mut sum = 0;
    let middle = sums.iter().take_while(|&&n| {
        sum += n;
        sum <= aim
    });
    let middle = middle.count().min(slices - 1);
    let mut sum: usize = sums[..middle].iter().sum();
    let (mut near, mut far, mut between) = (Vec::new(), Vec::new(), Vec::new());
    for s in region.drain(..) {
        match slice(&s).cmp(&middle) {
            Ordering::Less => near.push(s),
            Ordering::Equal => between.push(s),
            Ordering::Greater => far.push(s),
        }
    }
    between.sort_by(|a, b| a.at[longest].total_cmp(&b.at[longest]));
    for s in between {
        sum += s.left as usize;
        // Both get some.
        if sum <= aim || near.is_empty() { near.push(s) } else { far.push(s) }
    }
    *region = near;
    far
}

/// Numbers by a key below `keys`, equals as they were. O(n + keys).
fn sorted(numbers: &[u32], keys: usize, key: impl Fn(u32) -> usize) -> Vec<u32> {
    let mut at = vec![0u32; keys + 1];
    numbers.iter().for_each(|&i| at[key(i) + 1] += 1);
    (1..at.len()).for_each(|k| at[k] += at[k - 1]);
    let mut out = vec![0; numbers.len()];
    for &i in numbers {
        let to = &mut at[key(i)];
        out[*to as usize] = i;
        *to += 1;
    }
    out
}

/// The band of every split: the method's levels where it has any, else by count, in the order of their errors.
fn bands(pm: &ProgressiveMesh, rank: &[u32], layout: Layout, by_bounds: bool) -> Vec<u32> {
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
    // Coarse to fine.
    let bounds = pm.bounds.as_deref().filter(|_| by_bounds);
    let error = |i: usize| bounds.map_or(pm.splits.error[i], |b| b.error(i) as f32);
    let level = |i: u32| error_level(error(i as usize)) as usize;
    let all: Vec<u32> = (0..n as u32).collect();
    let order = sorted(&all, MOST_LEVEL as usize + 1, |i| (MOST_LEVEL as usize).saturating_sub(level(i)));
    let (first, rest) = order.split_at(layout.first(pm).min(n));
    let n0 = pm.base_vertices();
    let segments = layout.segments(pm);
    let part = pm.vertices().div_ceil(segments).max(1);
    let segment = |v: usize| rank[v] as usize / part;
    let mut all = vec![0usize; segments];
    (0..pm.vertices()).for_each(|v| all[segment(v)] += 1);
    let mut count = vec![0usize; segments];
    (0..n0).for_each(|v| count[segment(v)] += 1);
    first.iter().for_each(|&i| count[segment(n0 + i as usize)] += 1);
    // Where bands begin, the last first. None does shortly behind the first of all.
    let least = if n <= layout.small { 1.25 } else { layout.growth.sqrt() };
    let starts: Vec<Vec<f64>> = (0..segments)
        .map(|s| {
            let starts = (0..64).map(|k| layout.start(pm, (s, all[s]), count[s], k));
            starts.take_while(|&at| at > count[s] as f64 * least).collect()
        })
        .collect();
    let latest = starts.iter().map(Vec::len).max().unwrap_or(0);
    let mut bands = vec![0; n];
    let mut now: Vec<usize> = starts.iter().map(Vec::len).collect();
    for &i in rest {
        let s = segment(n0 + i as usize);
        count[s] += 1;
        while now[s] > 0 && count[s] as f64 > starts[s][now[s] - 1] {
            now[s] -= 1;
        }
        bands[i as usize] = (1 + (latest - now[s]) * segments + (segments - 1 - s)) as u32;
    }
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

/// The vertices of the base along a curve through space.
pub(super) fn base_order(pm: &ProgressiveMesh) -> Vec<u32> {
    let curve = Curve::new(pm);
    let mut base: Vec<(u32, u32)> =
        (0..pm.base_vertices()).map(|v| (curve.at(places::point(&pm.base_positions, v)), v as u32)).collect();
    base.sort_unstable();
    base.into_iter().map(|b| b.1).collect()
}

/// The place of every vertex in the order of descent: those of the base along the curve, every other behind the one it is split from.
fn ranks(pm: &ProgressiveMesh, base: &[u32]) -> Vec<u32> {
    let n0 = pm.base_vertices();
    let mut next = vec![NONE; pm.vertices()];
    base.windows(2).for_each(|w| next[w[0] as usize] = w[1]);
    for (&v, new) in pm.splits.vertex.iter().zip(n0..) {
        next[new] = next[v as usize];
        next[v as usize] = new as u32;
    }
    let mut rank = vec![0; next.len()];
    let (mut v, mut k) = (base.first().copied().unwrap_or(NONE), 0);
    while v != NONE {
        rank[v as usize] = k;
        k += 1;
        v = next[v as usize];
    }
    rank
}

/// Makes the order, chunk by chunk. Splits go by where they stand among the nodes.
struct Schedule<'a> {
    nodes: Vec<Node>,
    splits: &'a [u32],
    /// And where each split stands.
    further: Option<(&'a Further, Vec<u32>)>,
    /// The chunk of each that is in one.
    chunk: Vec<u32>,
    /// The splits that are in the order.
    done: Vec<bool>,
    order: Vec<u32>,
}

impl Schedule<'_> {
    /// How many of these are in no chunk.
    fn left(&self, range: std::ops::Range<u32>) -> u32 {
        let chunks = self.chunk.get(range.start as usize..range.end as usize).unwrap_or_default();
        chunks.iter().filter(|&&c| c == NONE).count() as u32
    }

    /// Puts a split, and all it depends on that is in no chunk yet, into chunk `number`.
    fn take(&mut self, i: u32, number: u32, taken: &mut Vec<u32>) {
        let mut at = taken.len();
        if self.chunk[i as usize] != NONE {
            return;
        }
        self.chunk[i as usize] = number;
        taken.push(i);
        while let Some(&i) = taken.get(at) {
            at += 1;
            let mut one = |d: u32| {
                if let Some(chunk) = self.chunk.get_mut(d as usize).filter(|chunk| **chunk == NONE) {
                    *chunk = number;
                    taken.push(d);
                }
            };
            self.nodes[i as usize].on.into_iter().for_each(&mut one);
            if let Some((further, place)) = &self.further {
                let needs = further.of(self.splits[i as usize]).iter();
                needs.filter_map(|&d| place.get(d as usize)).for_each(|&d| one(d));
            }
        }
    }

    /// Appends the splits of chunk `number`.
    fn add(&mut self, taken: &[u32], number: u32) {
        let here = |i: u32| self.chunk.get(i as usize) == Some(&number);
        let mut roots: Vec<(u32, u32)> = Vec::new();
        for &i in taken {
            let node = &self.nodes[i as usize];
            if !here(node.on[0]) {
                roots.push((node.vertex, i));
            }
        }
        roots.sort_unstable();
        // A list of the vertices by the split that is to come at each.
        let mut list: Vec<u32> = roots.into_iter().map(|r| r.1).collect();
        let mut pass = Vec::with_capacity(list.len());
        while !list.is_empty() {
            std::mem::swap(&mut list, &mut pass);
            list.clear();
            pass.reverse();
            // Both vertices of a split come again in the next sweep, so that the mesh is similarly fine everywhere: 0.7 bits a vertex on bunny and horse.
            while let Some(i) = pass.pop() {
                let node = self.nodes[i as usize];
                // What is in chunks before this one has been done.
                if node.on.into_iter().any(|d| here(d) && !self.done[d as usize]) {
                    list.push(i);
                    continue;
                }
                self.done[i as usize] = true;
                self.order.push(self.splits[i as usize]);
                list.extend([node.again, node.first].into_iter().filter(|&i| here(i)));
            }
        }
    }
}
