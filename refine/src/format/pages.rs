//! `PAGE` chunks: what refining out of core takes beside a chunk of splits and its bounds: links of the vertex hierarchy.
//!
//! What a chunk's splits lead to in later chunks stands there with its bounds: so whether a split is needed is decided before its chunk is there.

mod further;

pub(crate) use further::Lists;

use super::base::MeshHead;
use super::bounds::{self, Parts};
use super::coder::{Bit, Coder, Decoder, Encoder, Number};
use crate::aif::NONE;
use crate::hierarchy::{Bounds, Further, Guarantee, Packed, Tree};
use glam::DVec3;
use rustc_hash::FxHashMap;
use std::ops::Range;

/// What the splits of a chunk replace, and what replaces them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Links {
    /// The node that each split replaces.
    pub(crate) parent: Vec<u32>,
    /// The split that replaces each of both nodes that a split makes; [`NONE`] for a leaf.
    pub(crate) next: Vec<[u32; 2]>,
    /// Splits of later chunks that replace nodes made here, ascending, and their bounds.
    pub(crate) outside: Vec<(u32, Packed)>,
    /// What splits need by the ring rule beside what their cuts do: none of other rules.
    pub(crate) further: Lists,
}

/// The same of the vertices of a base.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct BaseLinks {
    /// The middle of the box about the finest mesh's vertices: bounds are about it.
    pub(crate) origin: DVec3,
    /// The length of the box's diagonal.
    pub(crate) diagonal: f64,
    /// The split that replaces each vertex; [`NONE`] for none.
    pub(crate) next: Vec<u32>,
    /// Its bounds.
    pub(crate) bounds: Vec<Packed>,
    /// Bounds are for the ring rule.
    pub(crate) settled: bool,
}

/// Bytes in memory: of a split, of a split of a later chunk, of a base, and of one of its vertices.
pub(crate) const SPLIT: u64 = 12;
pub(crate) const OUTSIDE: u64 = 12;
const BASE: u64 = 32;
const VERTEX: u64 = 12;
/// Of a list of what a split needs and of its turn, and of one split in such a list.
const LIST: u64 = 8;
const NEED: u64 = 4;

/// Bytes that reading the `PAGE` of so many splits takes at most on the way, besides what comes of it: the list of splits of later chunks grows, and has what it grew from beside it;
/// a table of vertices, and the nodes made.
pub(crate) fn scratch(count: u32, raw: u64, settled: bool) -> u64 {
    let count = count as u64;
    // By the ring rule, then, an order of descent, and one by turns.
    2 * raw.saturating_sub(SPLIT * count) + (48 + further::SCRATCH * u64::from(settled)) * count + (1 << 14)
}

/// Models of one chunk.
#[derive(Default)]
struct Codec {
    parent: Number,
    continues: [Bit; 2],
    next: [Number; 2],
    bounds: [Number; 5],
}

impl Codec {
    /// Whether a split of a later chunk replaces a node, and which; `last` is the last one of this side.
    fn next<C: Coder>(
        &mut self,
        c: &mut C,
        side: usize,
        last: &mut u32,
        beyond: std::ops::Range<u32>,
        value: u32,
    ) -> Option<Option<u32>> {
        if !c.bit(&mut self.continues[side], value != NONE) {
            return Some(None);
        }
        let step = c.signed(&mut self.next[side], value as i64 - *last as i64);
        *last = u32::try_from((*last as i64).checked_add(step)?).ok().filter(|i| beyond.contains(i))?;
        Some(Some(*last))
    }

    /// Bounds, near those given, which they become.
    fn bounds<C: Coder>(&mut self, c: &mut C, near: &mut Parts, value: Packed) -> Packed {
        bounds::code(c, &mut self.bounds, near, bounds::parts(value));
        bounds::packed(*near)
    }
}

/// Where links come from when they are written.
pub(super) trait Source {
    /// The node that split `i` replaces.
    fn parent(&self, i: u32) -> u32;

    /// The split that replaces a node; [`NONE`] for a leaf.
    fn next(&self, node: u32) -> u32;

    /// The bounds of a split that replaces a node.
    fn bounds(&self, i: u32) -> Packed;

    /// What split `i` needs by the ring rule beside what its cuts do: splits of this chunk, of an earlier turn, or of earlier ones.
    fn further(&self, _i: u32) -> &[u32] {
        &[]
    }
}

/// The bounds of the splits of a chunk.
#[derive(Clone, Copy)]
pub(crate) struct Own<'a> {
    pub(crate) bounds: &'a [Packed],
    /// By the ring rule the turn of each.
    pub(crate) turns: Option<&'a [u32]>,
}

impl<'a> Own<'a> {
    /// Those of all splits of a chunk.
    pub(crate) fn of(bounds: &'a Bounds) -> Own<'a> {
        let settled = bounds.guarantee() == Guarantee::Settled;
        Own { bounds: &bounds.of, turns: settled.then_some(&bounds.turns) }
    }

    /// Those of a range of the splits of a mesh; `None` if there are none.
    pub(super) fn within(bounds: &'a Bounds, range: Range<usize>) -> Option<Own<'a>> {
        let all = Own::of(bounds);
        let turns = match all.turns {
            Some(t) => Some(t.get(range.clone())?),
            None => None,
        };
        Some(Own { bounds: all.bounds.get(range)?, turns })
    }
}

/// Of a mesh that is there as a whole.
#[derive(Clone, Copy)]
pub(super) struct Whole<'a> {
    pub(super) tree: &'a Tree,
    pub(super) bounds: &'a Bounds,
    pub(super) further: Option<&'a Further>,
}

impl Source for Whole<'_> {
    fn parent(&self, i: u32) -> u32 {
        self.tree.parent[i as usize]
    }

    fn next(&self, node: u32) -> u32 {
        self.tree.split_of[node as usize]
    }

    fn bounds(&self, i: u32) -> Packed {
        self.bounds.of.get(i as usize).copied().unwrap_or_default()
    }

    fn further(&self, i: u32) -> &[u32] {
        self.further.map_or(&[], |f| f.of(i))
    }
}

/// The bounds of a split when they are written; anything when they are read.
fn bounds_in(source: Option<&dyn Source>, i: u32) -> Packed {
    source.map(|s| s.bounds(i)).unwrap_or_default()
}

/// Codes the links of the splits from `first` on, of the vertices and with the bounds given; by the ring rule they need `most` in all.
fn code<C: Coder>(
    c: &mut C,
    head: &MeshHead,
    first: u32,
    vertices: &[u32],
    (own, most): (Own<'_>, u64),
    source: Option<&dyn Source>,
) -> Option<Links> {
    let (n0, count) = (head.base_vertices, vertices.len());
    let end = first.checked_add(u32::try_from(count).ok()?)?;
    // Every node has a number.
    end.checked_mul(2)?.checked_add(n0)?;
    let mut codec = Codec::default();
    let mut links =
        Links { parent: Vec::with_capacity(count), next: vec![[NONE; 2]; count], ..Links::default() };
    // The node that each vertex is at, once a split of the chunk has split it; and of vertices made here.
    let mut roots: FxHashMap<u32, u32> =
        FxHashMap::with_capacity_and_hasher(count / 2, rustc_hash::FxBuildHasher);
    let mut made: Vec<u32> = Vec::with_capacity(count);
    for (i, &v) in (first..end).zip(vertices) {
        let here = v.checked_sub(n0).and_then(|j| j.checked_sub(first)).map(|k| k as usize);
        let known = match here {
            Some(k) => Some(*made.get(k)?),
            None => roots.get(&v).copied(),
        };
        let parent = match known {
            Some(node) => node,
            None => {
                let maker = v.checked_sub(n0);
                let start = maker.map_or(v, |j| n0 + 2 * j + 1);
                let back = source.map_or(0, |s| match s.parent(i) {
                    p if p == start => 0,
                    p => first - (p - n0) / 2,
                });
                match u32::try_from(c.number(&mut codec.parent, back as u64)).ok()? {
                    0 => start,
                    back => {
                        let j = first.checked_sub(back).filter(|&j| maker.is_none_or(|m| j > m))?;
                        n0 + 2 * j
                    }
                }
            }
        };
        if let Some(k) = parent.checked_sub(n0).and_then(|k| k.checked_sub(2 * first)) {
            let (k, side) = (k as usize / 2, k as usize % 2);
            links.next.get_mut(k)?[side] = i;
        }
        links.parent.push(parent);
        match here {
            Some(k) => made[k] = n0 + 2 * i,
            None => {
                roots.insert(v, n0 + 2 * i);
            }
        }
        made.push(n0 + 2 * i + 1);
    }
    let mut last = [end; 2];
    for (k, &own) in own.bounds.iter().enumerate().take(count) {
        for (side, last) in last.iter_mut().enumerate() {
            if links.next[k][side] != NONE {
                continue;
            }
            let node = n0 + 2 * (first + k as u32) + side as u32;
            let value = source.map_or(NONE, |s| s.next(node));
            if let Some(i) = codec.next(c, side, last, end..head.splits, value)? {
                links.next[k][side] = i;
                let bounds = codec.bounds(c, &mut bounds::parts(own), bounds_in(source, i));
                links.outside.push((i, bounds));
            }
        }
        if c.spent() {
            return None;
        }
    }
    links.outside.sort_unstable_by_key(|o| o.0);
    if let Some(turns) = own.turns {
        let needs = |i: u32| source.map_or(&[][..], |s| s.further(i));
        links.further = further::code(c, (n0, first), &links.parent, turns, most, needs)?;
    }
    // No split replaces two nodes.
    links.outside.windows(2).all(|w| w[0].0 < w[1].0).then_some(links)
}

fn code_base<C: Coder>(
    c: &mut C,
    head: &MeshHead,
    links: &mut BaseLinks,
    source: Option<&dyn Source>,
) -> Option<()> {
    let mut codec = Codec::default();
    let (mut last, mut near) = (0, Parts::default());
    for v in 0..head.base_vertices {
        let value = source.map_or(NONE, |s| s.next(v));
        let next = codec.next(c, 0, &mut last, 0..head.splits, value)?;
        links.next.push(next.unwrap_or(NONE));
        links.bounds.push(match next {
            Some(i) => codec.bounds(c, &mut near, bounds_in(source, i)),
            None => Packed::default(),
        });
        if c.spent() {
            return None;
        }
    }
    Some(())
}

/// The `PAGE` of the splits from `first` on, of the vertices and with the bounds given, and what it takes in memory. `None` if the arrays contradict each other.
pub(super) fn write(
    head: &MeshHead,
    first: u32,
    vertices: &[u32],
    own: Own<'_>,
    source: &dyn Source,
) -> Option<(Vec<u8>, u64)> {
    let mut e = Encoder::default();
    let links = code(&mut e, head, first, vertices, (own, u32::MAX.into()), Some(source))?;
    let mut out = Vec::new();
    e.finish(&mut out);
    Some((out, raw_bytes(&links)))
}

fn raw_bytes(links: &Links) -> u64 {
    let lists = LIST * links.further.len() as u64 + NEED * links.further.on.len() as u64;
    SPLIT * links.parent.len() as u64 + OUTSIDE * links.outside.len() as u64 + lists
}

/// Reads the `PAGE` of splits whose vertices and bounds are given. `None`: damage.
pub(crate) fn read(
    head: &MeshHead,
    first: u32,
    (vertices, own): (&[u32], Own<'_>),
    raw: u64,
    bytes: &[u8],
) -> Option<Links> {
    if own.bounds.len() != vertices.len() || own.turns.is_some_and(|t| t.len() != vertices.len()) {
        return None;
    }
    // As many as there is said to be room for.
    let most = raw.saturating_sub((SPLIT + LIST) * vertices.len() as u64) / NEED;
    let links = code(&mut Decoder::new(bytes)?, head, first, vertices, (own, most), None)?;
    (raw_bytes(&links) == raw).then_some(links)
}

/// The `PAGE` of a base; bounds are about `origin`, and for the ring rule if `settled`.
pub(super) fn write_base(
    head: &MeshHead,
    (origin, diagonal): (DVec3, f64),
    settled: bool,
    source: &dyn Source,
) -> Option<(Vec<u8>, u64)> {
    let mut out = Vec::new();
    if settled {
        out.push(Guarantee::Settled.code());
    }
    for x in origin.to_array().into_iter().chain([diagonal]) {
        out.extend_from_slice(&x.to_le_bytes());
    }
    let mut e = Encoder::default();
    code_base(&mut e, head, &mut BaseLinks::default(), Some(source))?;
    e.finish(&mut out);
    Some((out, raw_bytes_of_base(head) + u64::from(settled)))
}

fn raw_bytes_of_base(head: &MeshHead) -> u64 {
    BASE + VERTEX * head.base_vertices as u64
}

/// Reads the `PAGE` of a base. `None`: damage.
pub(crate) fn read_base(head: &MeshHead, raw: u64, bytes: &[u8]) -> Option<BaseLinks> {
    // A byte more says which rule bounds are for, if it is not that of cuts.
    let settled = raw == raw_bytes_of_base(head) + 1;
    let bytes = match bytes.split_first() {
        Some((&kind, rest)) if settled => Some(rest).filter(|_| kind == Guarantee::Settled.code())?,
        _ => bytes,
    };
    let (numbers, stream) = bytes.split_at_checked(BASE as usize)?;
    let mut x = [0.0; 4];
    for (x, b) in x.iter_mut().zip(numbers.chunks_exact(8)) {
        *x = f64::from_le_bytes(b.try_into().ok()?);
    }
    if raw != raw_bytes_of_base(head) + u64::from(settled) || x.iter().any(|x| !x.is_finite()) || x[3] < 0.0 {
        return None;
    }
    let mut links =
        BaseLinks { origin: DVec3::new(x[0], x[1], x[2]), diagonal: x[3], settled, ..BaseLinks::default() };
    code_base(&mut Decoder::new(stream)?, head, &mut links, None)?;
    Some(links)
}
