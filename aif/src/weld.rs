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

/// A cell as a key; -0 is 0.
fn key(cell: glam::DVec3) -> [u64; 3] {
    cell.to_array().map(|x| (x + 0.0).to_bits())
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
            // chained through `next`; there are few, since kept ones are farther apart than the distance. Cells are
            // numbered in floats: far out, where a distance is lost in the rounding, integers would overflow.
            let (origin, far) = positions.bounds().unwrap_or_default();
            if !((far - origin) / distance).is_finite() {
                return weld(positions, Weld::BitEqual);
            }
            let mut head: FxHashMap<[u64; 3], u32> = FxHashMap::default();
            let mut next: Vec<u32> = Vec::new();
            for i in 0..n {
                let p = positions.get(i);
                let cell = ((p - origin) / distance).floor();
                let mut best = u32::MAX;
                for d in 0..27 {
                    let step = glam::DVec3::new((d % 3) as f64, (d / 3 % 3) as f64, (d / 9) as f64) - 1.0;
                    let c = key(cell + step);
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
                    next.push(head.insert(key(cell), best).unwrap_or(u32::MAX));
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
    #[test]
    fn any_distance_is_safe() {
        let p = Positions::F64(vec![[0.0; 3], [1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [-5.0, 0.0, 1e-200]]);
        for (distance, kept) in [
            (f64::MIN_POSITIVE, 3),
            (1e-30, 3),
            (1e-12, 3),
            (10.0, 1),
            (f64::INFINITY, 1),
            (0.0, 3),
            (-1.0, 3),
            (f64::NAN, 3),
        ] {
            assert_eq!(weld(&p, Weld::Within(distance)).unwrap().kept.len(), kept, "{distance}");
        }
        let p = Positions::F64(vec![[1e308, 0.0, 0.0], [-1e308, 0.0, 0.0], [1e308, 0.0, 0.0]]);
        assert_eq!(weld(&p, Weld::Within(1.0)).unwrap().map, [0, 1, 0]);
    }

    #[test]
    fn points_in_neighbouring_cells_are_found() {
        // 0.95 and 1.05 fall into different cells of 0.5 on every axis.
        for axis in 0..3 {
            let mut p = vec![[0.0; 3], [5.0; 3], [5.0; 3]];
            (p[1][axis], p[2][axis]) = (0.95, 1.05);
            assert_eq!(weld(&Positions::F64(p), Weld::Within(0.5)).unwrap().map, [0, 1, 1]);
        }
    }
}
