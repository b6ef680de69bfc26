//! Welding: making one vertex of several at the same place.

use crate::positions::Positions;
use rustc_hash::FxHashMap;

/// Which vertices are one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Weld {
    /// None: ids are taken as they are.
    #[default]
    No,
    /// Those with bit-equal positions (-0 = +0).
    BitEqual,
    /// Those within this distance (model units) of an earlier vertex that is itself kept. Not transitive: a chain of vertices
    /// each within the distance of the next is not drawn into one point.
    Within(f64),
}

/// The result of welding.
pub(crate) struct Welded {
    /// Input vertex -> kept vertex.
    pub(crate) map: Vec<u32>,
    /// Kept vertex -> the input vertex it was, ascending.
    pub(crate) kept: Vec<u32>,
}

/// Welds; `None` when nothing is asked for or nothing coincides. Each vertex goes to the first kept one that qualifies. O(n).
pub(crate) fn weld(positions: &Positions, rule: Weld) -> Option<Welded> {
    let n = positions.len();
    let mut map = Vec::with_capacity(n);
    let mut kept: Vec<u32> = Vec::with_capacity(n);
    match rule {
        Weld::No => return None,
        Weld::BitEqual => {
            let mut seen: FxHashMap<[u64; 3], u32> = FxHashMap::default();
            seen.reserve(n);
            for i in 0..n {
                let next = kept.len() as u32;
                let id = *seen.entry(positions.bits(i)).or_insert(next);
                if id == next {
                    kept.push(i as u32);
                }
                map.push(id);
            }
        }
        Weld::Within(distance) if distance > 0.0 => {
            // Cells of the distance's size: whatever is near lies in the 27 cells around. Vertices of one cell are
            // chained through `next`, since any number may fall into one.
            let mut head: FxHashMap<[i64; 3], u32> = FxHashMap::default();
            let mut next: Vec<u32> = Vec::new();
            let origin = positions.bounds().map_or(glam::DVec3::ZERO, |b| b.0);
            for i in 0..n {
                let p = positions.get(i);
                let cell = ((p - origin) / distance).floor().to_array().map(|x| x as i64);
                let mut best = u32::MAX;
                for d in 0..27i64 {
                    let c = [cell[0] + d % 3 - 1, cell[1] + d / 3 % 3 - 1, cell[2] + d / 9 - 1];
                    let mut k = head.get(&c).copied().unwrap_or(u32::MAX);
                    while k != u32::MAX {
                        if k < best && positions.get(kept[k as usize] as usize).distance(p) <= distance {
                            best = k;
                        }
                        k = next[k as usize];
                    }
                }
                if best == u32::MAX {
                    best = kept.len() as u32;
                    kept.push(i as u32);
                    next.push(head.insert(cell, best).unwrap_or(u32::MAX));
                }
                map.push(best);
            }
        }
        Weld::Within(_) => return weld(positions, Weld::BitEqual),
    }
    (kept.len() < n).then_some(Welded { map, kept })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_bits_weld_to_the_first() {
        let p = Positions::F32(vec![[0.0; 3], [1.0, 0.0, 0.0], [-0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
        let w = weld(&p, Weld::BitEqual).unwrap();
        assert_eq!((w.map, w.kept), (vec![0, 1, 0, 1], vec![0, 1]));
        assert!(weld(&p, Weld::No).is_none());
    }

    #[test]
    fn welding_by_distance_does_not_follow_chains() {
        let p = Positions::F64((0..5).map(|i| [i as f64 * 0.8, 0.0, 0.0]).collect());
        let w = weld(&p, Weld::Within(1.0)).unwrap();
        assert_eq!(w.kept, vec![0, 2, 4]);
        assert_eq!(w.map, vec![0, 0, 1, 1, 2]);
    }

    #[test]
    fn nothing_to_weld_is_none() {
        let p = Positions::F32(vec![[0.0; 3], [1.0, 0.0, 0.0]]);
        assert!(weld(&p, Weld::BitEqual).is_none());
        assert!(weld(&p, Weld::Within(0.5)).is_none());
    }
}
