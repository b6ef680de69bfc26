//! A bounding volume hierarchy of four children a node, without pointers.
//!
//! Triangles are put into an order (`order`) in which every run of 4, 16, 64, ... beginning at a multiple of its length lies close together;
//! node `i` of a level has children `4 i .. 4 i + 4` of the level below. The order comes from splitting at the box's longest side, always
//! at a multiple of the children's size (overlap-minimising top-down packing after Lee & Lee 2003). Boxes are f32, rounded outwards,
//! one `Vec4` a bound for all four children: a query tests four boxes with six subtractions. 32 B a triangle, in a few
//! cache lines along a path.

use glam::{DVec3, Vec4};

/// Boxes of four children, one in every lane; a missing child has an empty box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) lo: [Vec4; 3],
    pub(super) hi: [Vec4; 3],
}

const EMPTY: Node = Node { lo: [Vec4::INFINITY; 3], hi: [Vec4::NEG_INFINITY; 3] };

impl Node {
    /// The box around all children, as bounds.
    fn hull(&self) -> ([f32; 3], [f32; 3]) {
        (self.lo.map(Vec4::min_element), self.hi.map(Vec4::max_element))
    }

    fn set(&mut self, lane: usize, (lo, hi): ([f32; 3], [f32; 3])) {
        for k in 0..3 {
            self.lo[k][lane] = lo[k];
            self.hi[k][lane] = hi[k];
        }
    }
}

/// The hierarchy over triangles `0..n`.
#[derive(Clone, Debug)]
pub(super) struct Bvh {
    /// Levels one after the other, leaves first, the root last.
    pub(super) nodes: Vec<Node>,
    /// Where each level begins in `nodes`.
    pub(super) base: Vec<u32>,
}

/// A triangle while it is being sorted.
#[derive(Clone, Copy)]
struct Item {
    at: [f32; 3],
    id: u32,
}

/// From this many triangles on, both halves of a split are sorted at the same time. Also the size of the chunks in which boxes are made.
const PARALLEL: usize = 1 << 13;

/// The order of the triangles, given their centres. O(n log n).
pub(super) fn order(centres: Vec<[f32; 3]>) -> Vec<u32> {
    let mut items: Vec<Item> =
        centres.into_iter().enumerate().map(|(id, at)| Item { at, id: id as u32 }).collect();
    let mut span = 1;
    while span < items.len() {
        span *= 4;
    }
    split(&mut items, span / 4);
    items.into_iter().map(|i| i.id).collect()
}

/// Orders `items`, which lie below one node whose children take `span` each.
fn split(items: &mut [Item], span: usize) {
    // Among the triangles of one leaf any order will do.
    if span <= 1 && items.len() <= 4 {
        return;
    }
    if items.len() <= span {
        return split(items, span / 4);
    }
    let children = items.len().div_ceil(span);
    let at = children / 2 * span;
    let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for i in items.iter() {
        for k in 0..3 {
            lo[k] = lo[k].min(i.at[k]);
            hi[k] = hi[k].max(i.at[k]);
        }
    }
    let side = |k: usize| hi[k] - lo[k];
    let axis = if side(0) >= side(1) && side(0) >= side(2) {
        0
    } else if side(1) >= side(2) {
        1
    } else {
        2
    };
    // A total order, so that the halves do not depend on how the selection goes about it.
    items.select_nth_unstable_by_key(at, |i| u64::from(ordered(i.at[axis])) << 32 | u64::from(i.id));
    let (left, right) = items.split_at_mut(at);
    crate::parallel::join(left.len() >= PARALLEL, || split(left, span), || split(right, span));
}

/// A number whose order is that of `x`.
#[inline]
fn ordered(x: f32) -> u32 {
    let bits = x.to_bits();
    bits ^ ((bits as i32 >> 31) as u32 | 1 << 31)
}

impl Bvh {
    /// The hierarchy over `n` triangles in order, from their boxes. Not for `n` = 0. O(n).
    pub(super) fn new(n: usize, bounds: impl Fn(usize) -> ([f32; 3], [f32; 3]) + Sync + Send) -> Self {
        let (mut base, mut total, mut count) = (Vec::new(), 0, n);
        loop {
            count = count.div_ceil(4);
            base.push(total as u32);
            total += count;
            if count <= 1 {
                break;
            }
        }
        let mut nodes = vec![EMPTY; total];
        let mut below = n;
        for level in 0..base.len() {
            let (done, rest) = nodes.split_at_mut(base[level] as usize);
            let count = below.div_ceil(4);
            let children = level.checked_sub(1).map(|l| &done[base[l] as usize..]);
            crate::parallel::for_chunks(&mut rest[..count], PARALLEL / 4, |first, chunk| {
                for (i, node) in chunk.iter_mut().enumerate() {
                    let child = 4 * (first + i);
                    for c in child..below.min(child + 4) {
                        node.set(c - child, children.map_or_else(|| bounds(c), |n| n[c].hull()));
                    }
                }
            });
            below = count;
        }
        Bvh { nodes, base }
    }

    /// Calls `visit` for the triangles whose boxes meet the given one, until it says `false`; returns whether that never happened.
    /// Does not go below child `i` of a level where `wanted(level, i)` is false.
    #[inline]
    pub(super) fn meeting(
        &self,
        (lo, hi): ([f32; 3], [f32; 3]),
        wanted: impl Fn(u32, u32) -> bool,
        mut visit: impl FnMut(u32) -> bool,
    ) -> bool {
        let (lo, hi) = (lo.map(Vec4::splat), hi.map(Vec4::splat));
        // At most 3 wait on each of 16 levels, and 4.
        let mut stack = [(0u32, 0u32); 64];
        stack[0] = (self.base.len() as u32 - 1, 0);
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (level, i) = stack[waiting];
            let n = &self.nodes[self.base[level as usize] as usize + i as usize];
            let mut meet = n.lo[0].cmple(hi[0]) & n.hi[0].cmpge(lo[0]);
            for k in 1..3 {
                meet &= n.lo[k].cmple(hi[k]) & n.hi[k].cmpge(lo[k]);
            }
            let mut mask = meet.bitmask();
            while mask != 0 {
                let child = 4 * i + mask.trailing_zeros();
                mask &= mask - 1;
                if !wanted(level, child) {
                    continue;
                }
                if level > 0 {
                    stack[waiting] = (level - 1, child);
                    waiting += 1;
                } else if !visit(child) {
                    return false;
                }
            }
        }
        true
    }
}

/// The least f32 not below `x` and the greatest not above it, in this order of use: `down(x) <= x <= up(x)`.
#[inline]
pub(super) fn down(x: f64) -> f32 {
    let y = x as f32;
    if y as f64 > x { y.next_down() } else { y }
}

/// The least f32 not below `x`.
#[inline]
pub(super) fn up(x: f64) -> f32 {
    let y = x as f32;
    if (y as f64) < x { y.next_up() } else { y }
}

/// The box around a triangle, rounded outwards.
#[inline]
pub(super) fn bounds_of([a, b, c]: [DVec3; 3]) -> ([f32; 3], [f32; 3]) {
    let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
    (lo.to_array().map(down), hi.to_array().map(up))
}
