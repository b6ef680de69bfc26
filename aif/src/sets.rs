//! Disjoint sets in a flat array.

use crate::ids::NONE;

/// Disjoint sets of `0..n`; the least element of a set stands for it.
pub(crate) struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    /// Every element by itself.
    pub(crate) fn new(n: usize) -> Self {
        Sets { parent: (0..n as u32).collect() }
    }

    /// The least element of the set of `x`. O(log n) amortised.
    #[inline]
    pub(crate) fn find(&mut self, x: usize) -> usize {
        let mut x = x as u32;
        while self.parent[x as usize] != x {
            // Path halving.
            let up = self.parent[self.parent[x as usize] as usize];
            self.parent[x as usize] = up;
            x = up;
        }
        x as usize
    }

    /// Makes one set of those of `a` and `b`.
    #[inline]
    pub(crate) fn union(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b)] = a.min(b) as u32;
    }

    /// Numbers the sets of the elements that `keep` names by their least element; [`NONE`] for the others.
    pub(crate) fn number(mut self, keep: impl Fn(usize) -> bool) -> (Vec<u32>, usize) {
        let mut of = vec![NONE; self.parent.len()];
        let mut count = 0;
        for x in (0..of.len()).filter(|&x| keep(x)) {
            let root = self.find(x);
            if of[root] == NONE {
                of[root] = count;
                count += 1;
            }
            of[x] = of[root];
        }
        (of, count as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_numbered_by_their_least_kept_element() {
        let mut s = Sets::new(6);
        s.union(5, 1);
        s.union(3, 5);
        s.union(0, 4);
        assert_eq!((s.find(3), s.find(4), s.find(2)), (1, 0, 2));
        assert_eq!(s.number(|x| x != 2), (vec![0, 1, NONE, 1, 0, 1], 2));
    }
}
