//! What tells that the pages below a page will be needed: some of the splits that lead to them, with their bounds.
//!
//! A split that comes next at a vertex shown is looked at some frames ahead where its page is not there. But what comes next at a vertex that is not shown yet can be needed in the very frame in which that is: on a fast
//! flight over rough terrain a good part of all pages come in so. Bounds hold those of the splits below, so that such a split will be needed is known without what stands above it.

use super::page::Page;
use crate::aif::NONE;
use crate::format::pages::Links;
use crate::hierarchy::{Cone, Packed, pack_up, unpack};
use crate::selective::Entry;
use glam::{DVec3, Vec3};

/// One in so many splits of a page, at most, is one that others are known by.
const ONE_IN: usize = 16;
/// Pages that are looked out for from one.
const MOST: usize = 32;

/// A page that splits of another lead to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// The chunk.
    pub(super) chunk: u32,
    /// The end of its splits among those known.
    end: u32,
    /// As if it were one split, all of these.
    whole: Entry,
}

/// Bytes that a page of so many splits takes for it, at most.
pub(super) fn most_bytes(count: u64) -> u64 {
    size_of::<Entry>() as u64 * (count / ONE_IN as u64 + 1) + (size_of::<Sight>() * MOST) as u64
}

/// Of the splits of later chunks that a page from `first` on leads to some, ascending: of neighbours in their order, who are so in space, the one with the largest error, as that is needed first. `place` says where
/// the new vertex of one of the page's splits stands about the origin of the bounds, `maker` which of these made the vertex of one, if one did.
pub(super) fn known(
    first: u32,
    (own, links): (&[Packed], &Links),
    place: impl Fn(usize) -> Vec3,
    maker: impl Fn(usize) -> Option<usize>,
) -> Vec<Entry> {
    let room = links.next.len() / ONE_IN + 1;
    let step = links.outside.len().div_ceil(room).max(1);
    let mut known = Vec::with_capacity(links.outside.len().div_ceil(step));
    for near in links.outside.chunks(step) {
        if let Some(&(next, bounds)) = near.iter().max_by_key(|o| o.1.error) {
            known.push(Entry::new(next, Vec3::ZERO, bounds));
        }
    }
    let end = first + links.next.len() as u32;
    for (k, next) in links.next.iter().enumerate() {
        for (side, &next) in next.iter().enumerate().filter(|(_, n)| **n != NONE && **n >= end) {
            let Ok(at) = known.binary_search_by_key(&next, |e: &Entry| e.split) else { continue };
            known[at] = match maker(k).filter(|_| side == 0) {
                Some(maker) => known[at].moved(place(maker), 0.0),
                None if side == 1 => known[at].moved(place(k), 0.0),
                // The new vertex is within the sphere about the old one.
                None => known[at].moved(place(k), unpack(own[k].radius)),
            };
        }
    }
    known
}

impl Page {
    /// Divides what is known by the chunks, given by their first splits.
    pub(super) fn look_out(&mut self, firsts: &[u32]) {
        self.sights = sights(&self.known, firsts);
    }

    /// Tells, of the chunks below that are `missing`, those that hold what is wanted.
    pub(super) fn in_sight(
        &self,
        missing: impl Fn(usize) -> bool,
        wants: impl Fn(&Entry) -> bool,
        mut tell: impl FnMut(usize),
    ) {
        let mut from = 0;
        for s in &self.sights {
            let known = self.known.get(from..s.end as usize).unwrap_or_default();
            from = s.end as usize;
            if missing(s.chunk as usize) && wants(&s.whole) && known.iter().any(&wants) {
                tell(s.chunk as usize);
            }
        }
    }
}

/// The chunks that these lead to, the first ones of them.
fn sights(known: &[Entry], firsts: &[u32]) -> Vec<Sight> {
    let (mut from, mut all) = (0, Vec::new());
    while let Some(e) = known.get(from).filter(|_| all.len() < MOST) {
        let chunk = firsts.partition_point(|&f| f <= e.split).max(1) - 1;
        let next = firsts.get(chunk + 1).copied().unwrap_or(u32::MAX);
        let end = from + known[from..].partition_point(|e| e.split < next).max(1);
        all.push(Sight { chunk: chunk as u32, end: end as u32, whole: whole(&known[from..end]) });
        from = end;
    }
    all.shrink_to_fit();
    all
}

/// What holds all of these.
fn whole(of: &[Entry]) -> Entry {
    let sum: DVec3 = of.iter().map(|e| e.centre().as_dvec3()).sum();
    let centre = (sum / of.len().max(1) as f64).as_vec3();
    let (mut radius, mut error) = (0.0f64, 0.0f64);
    for e in of {
        let (r, own) = e.size();
        radius = radius.max(f64::from(e.centre().distance(centre)) + r);
        error = error.max(own);
    }
    let bounds = Packed { error: pack_up(error), radius: pack_up(radius), cone: Cone::ALL };
    Entry::new(NONE, centre, bounds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packed(error: u16, radius: u16) -> Packed {
        Packed { error, radius, cone: Cone::ALL }
    }

    proptest! {
        #[test]
        fn the_largest_of_neighbours_are_known_where_they_are_and_by_chunks(
            first in 0u32..40,
            nodes in prop::collection::vec((any::<[bool; 2]>(), any::<prop::sample::Index>(), 0x7e00u16..0x8100), 1..200),
            errors in prop::collection::vec(0x7e00u16..0x8100, 400),
            sizes in prop::collection::vec(1u32..60, 1..60),
        ) {
            // Splits of later chunks that replace the nodes drawn, in an order of their own.
            let end = first + nodes.len() as u32;
            let mut links = Links { next: vec![[NONE; 2]; nodes.len()], ..Links::default() };
            let open: Vec<(usize, usize)> =
                (0..nodes.len()).flat_map(|k| [(k, 0), (k, 1)]).filter(|&(k, side)| nodes[k].0[side]).collect();
            for (j, &(k, side)) in open.iter().enumerate() {
                let next = end + ((j * 7) % open.len().next_multiple_of(7).max(1)) as u32 * 400 + j as u32;
                links.next[k][side] = next;
                links.outside.push((next, packed(errors[j], pack_up(1.0))));
            }
            links.outside.sort_unstable_by_key(|o| o.0);
            let own: Vec<Packed> = nodes.iter().map(|n| packed(0, n.2)).collect();
            // Some vertices were made by splits before in the page.
            let maker = |k: usize| Some(nodes[k].1.index(k + 1)).filter(|&m| m < k);
            let place = |k: usize| Vec3::new(k as f32, (k * k % 17) as f32, 1.0);
            let known = known(first, (&own, &links), place, maker);
            prop_assert!(known.len() <= nodes.len() / ONE_IN + 1);
            prop_assert!(known.windows(2).all(|w| w[0].split < w[1].split));
            for e in &known {
                let &(k, side) = open.iter().find(|&&(k, side)| links.next[k][side] == e.split).unwrap();
                let (at, wider) = match (side, maker(k)) {
                    (0, Some(m)) => (place(m), 0.0),
                    (0, None) => (place(k), unpack(own[k].radius)),
                    _ => (place(k), 0.0),
                };
                prop_assert_eq!((e.centre(), e.size().0), (at, f64::from(1.0 + wider)));
            }
            // Whatever is left out has one beside it that is no smaller.
            let step = links.outside.len().div_ceil(nodes.len() / ONE_IN + 1).max(1);
            for near in links.outside.chunks(step) {
                let largest = near.iter().map(|o| o.1.error).max().unwrap();
                let there = |e: &&Entry| near.iter().any(|o| o.0 == e.split && o.1.error == largest);
                prop_assert_eq!(known.iter().filter(there).count(), 1);
            }
            // By chunks: every one once, and what stands for it holds all that is known of it.
            let mut firsts = vec![0];
            let last = links.outside.last().map_or(end, |o| o.0 + 1);
            for s in sizes.iter().cycle() {
                let next = firsts[firsts.len() - 1] + s * 97;
                firsts.push(next);
                if next >= last {
                    break;
                }
            }
            let sights = sights(&known, &firsts);
            let of = |e: &Entry| firsts.iter().rposition(|&f| f <= e.split).unwrap() as u32;
            let mut chunks: Vec<u32> = known.iter().map(of).collect();
            chunks.dedup();
            chunks.truncate(MOST);
            prop_assert_eq!(sights.iter().map(|s| s.chunk).collect::<Vec<_>>(), chunks);
            prop_assert!(size_of_val(&known[..]) + size_of_val(&sights[..]) <= most_bytes(nodes.len() as u64) as usize);
            for s in &sights {
                let (radius, error) = s.whole.size();
                for e in known.iter().filter(|e| of(e) == s.chunk) {
                    let (r, own) = e.size();
                    prop_assert!(f64::from(e.centre().distance(s.whole.centre())) + r <= radius && own <= error);
                }
            }
        }
    }
}
