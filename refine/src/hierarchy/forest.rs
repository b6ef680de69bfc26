//! What a split hangs on and what hangs on it: the vertex hierarchy and the l/r rule, as flat arrays.

use super::rings::Needs;
use crate::aif::{NONE, Positions};
use crate::progressive::ProgressiveMesh;
use glam::DVec3;

/// The vertex hierarchy of a progressive mesh.
///
/// A *node* is a vertex as it is between two splits: the base's are `0..n0`, split `i` makes `n0 + 2 i` (the old vertex from then on) and
/// `n0 + 2 i + 1` (the new one). Every node has at most one split that replaces it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Forest {
    pub(crate) base_vertices: u32,
    base_faces: u32,
    /// The node that each split replaces.
    pub(crate) parent: Vec<u32>,
    /// The split that replaces each node; [`NONE`] for a leaf.
    pub(crate) split_of: Vec<u32>,
    two_faces: Ranks,
    moves: Ranks,
    /// What splits need by the rule of the hierarchy.
    pub(crate) needs: Needs,
    /// Where splits have their attributes; empty without.
    pub(crate) rows: Vec<SplitRows>,
    /// For every row of a changed wedge, at the row, the row that the wedge had before; for others themselves. Empty without attributes.
    pub(crate) row_before: Vec<u32>,
}

/// Where a split has its attributes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SplitRows {
    /// Its first new wedge.
    pub(crate) wedge: u32,
    /// Its first row.
    pub(crate) row: u32,
    /// Its entry of the explicit stream, if it has one.
    pub(crate) explicit: u32,
}

/// Bits, and how many are set before each of them.
#[derive(Clone, Debug, Default)]
struct Ranks {
    bits: Vec<u64>,
    before: Vec<u32>,
    set: usize,
}

impl Ranks {
    fn new(all: impl Iterator<Item = bool>) -> Ranks {
        let mut r = Ranks::default();
        for (i, bit) in all.enumerate() {
            if i % 64 == 0 {
                r.bits.push(0);
                r.before.push(r.set as u32);
            }
            if bit {
                r.bits[i / 64] |= 1 << (i % 64);
                r.set += 1;
            }
        }
        r
    }

    #[inline]
    fn before(&self, i: u32) -> u32 {
        let (word, bit) = (i as usize / 64, i % 64);
        self.before[word] + (self.bits[word] & ((1 << bit) - 1)).count_ones()
    }

    #[inline]
    fn get(&self, i: u32) -> bool {
        self.bits[i as usize / 64] >> (i % 64) & 1 != 0
    }

    fn bytes(&self) -> usize {
        8 * self.bits.len() + 4 * self.before.len()
    }
}

impl Forest {
    /// Of a progressive mesh whose references are sound. O(n).
    pub(crate) fn new(pm: &ProgressiveMesh) -> Forest {
        let (n0, n) = (pm.base_vertices() as u32, pm.splits.len());
        let mut split_of = vec![NONE; n0 as usize + 2 * n];
        // The node that each vertex slot is at.
        let mut node: Vec<u32> = (0..n0).collect();
        let mut parent = Vec::with_capacity(n);
        for (i, &v) in (0u32..).zip(&pm.splits.vertex) {
            let at = node[v as usize];
            parent.push(at);
            split_of[at as usize] = i;
            node[v as usize] = n0 + 2 * i;
            node.push(n0 + 2 * i + 1);
        }
        let rows = match &pm.wedges {
            None => Vec::new(),
            Some(w) => {
                let mut wedge = w.base_vertex.len() as u32;
                let each = pm.rows_of_splits().into_iter().map(|r| {
                    let at = SplitRows { wedge, row: r.first_row as u32, explicit: r.explicit.start as u32 };
                    wedge += r.new;
                    at
                });
                each.collect()
            }
        };
        Forest {
            base_vertices: n0,
            base_faces: pm.base_faces.len() as u32,
            parent,
            split_of,
            two_faces: Ranks::new(pm.splits.code.iter().map(|c| c.two_faces())),
            moves: Ranks::new(pm.splits.code.iter().map(|c| c.moves())),
            needs: Needs::default(),
            rows,
            row_before: pm
                .wedges
                .as_ref()
                .map_or(0, |w| w.present.len())
                .try_into()
                .map_or(Vec::new(), |n: u32| (0..n).collect()),
        }
    }

    /// Splits.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.parent.len()
    }

    /// The split that made a node; [`NONE`] for the base's.
    #[inline]
    pub(crate) fn maker(&self, node: u32) -> u32 {
        node.checked_sub(self.base_vertices).map_or(NONE, |k| k >> 1)
    }

    /// The two nodes that split `i` makes: the old vertex's and the new one's.
    #[inline]
    pub(crate) fn nodes(&self, i: u32) -> [u32; 2] {
        let old = self.base_vertices + 2 * i;
        [old, old + 1]
    }

    /// The first face that split `i` makes.
    #[inline]
    pub(crate) fn first_face(&self, i: u32) -> u32 {
        self.base_faces + i + self.two_faces.before(i)
    }

    /// Where node `k` stands. O(splits of the vertex that do not move it).
    #[inline]
    pub(crate) fn position(&self, pm: &ProgressiveMesh, mut k: u32, vertex: u32) -> DVec3 {
        let n0 = self.base_vertices;
        if self.moves.set == 0 {
            return match vertex.checked_sub(n0) {
                None => pm.base_positions.get(vertex as usize),
                Some(i) => pm.new_positions.get(i as usize),
            };
        }
        loop {
            let Some(at) = k.checked_sub(n0) else { return pm.base_positions.get(k as usize) };
            let i = at >> 1;
            if at & 1 == 1 {
                return pm.new_positions.get(i as usize);
            }
            if self.moves.get(i) {
                return pm.moved_positions.get(self.moves.before(i) as usize);
            }
            k = self.parent[i as usize];
        }
    }

    /// The same, in the stored precision, appended to `out`.
    pub(crate) fn append_position(&self, pm: &ProgressiveMesh, mut k: u32, out: &mut Positions) {
        let n0 = self.base_vertices;
        let (from, i) = loop {
            let Some(at) = k.checked_sub(n0) else { break (&pm.base_positions, k) };
            let i = at >> 1;
            if at & 1 == 1 {
                break (&pm.new_positions, i);
            }
            if self.moves.get(i) {
                break (&pm.moved_positions, self.moves.before(i));
            }
            k = self.parent[i as usize];
        };
        match (from, out) {
            (Positions::F32(a), Positions::F32(b)) => b.push(a[i as usize]),
            (Positions::F64(a), Positions::F64(b)) => b.push(a[i as usize]),
            _ => {}
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        4 * (self.parent.len() + self.split_of.len() + self.row_before.len())
            + self.needs.bytes()
            + 12 * self.rows.len()
            + self.two_faces.bytes()
            + self.moves.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_count_what_is_set_before() {
        let bits: Vec<bool> = (0..300).map(|i| i % 3 == 0 || i % 7 == 2).collect();
        let r = Ranks::new(bits.iter().copied());
        for i in 0..300 {
            assert_eq!(r.before(i as u32) as usize, bits[..i].iter().filter(|b| **b).count());
            assert_eq!(r.get(i as u32), bits[i]);
        }
    }
}
