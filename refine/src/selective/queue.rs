//! Splits that are needed, while a frame applies them the most urgent first.

use super::refine::Open;

/// Buckets by how urgent they are.
pub(super) struct Queue {
    buckets: Vec<Vec<Open>>,
    /// None above it holds any.
    highest: usize,
    len: usize,
}

const BUCKETS: usize = 256;

impl Default for Queue {
    fn default() -> Self {
        Queue { buckets: vec![Vec::new(); BUCKETS], highest: 0, len: 0 }
    }
}

impl Queue {
    /// Adds a split.
    #[inline]
    pub(super) fn push(&mut self, open: Open, rank: u16) {
        let bucket = usize::from(rank).min(BUCKETS - 1);
        self.highest = bucket.max(self.highest);
        self.buckets[bucket].push(open);
        self.len += 1;
    }

    /// Takes out the next, at most so many, all of one rank; none if there is none.
    pub(super) fn pop(&mut self, most: usize, out: &mut Vec<Open>) {
        while self.highest > 0 && self.buckets[self.highest].is_empty() {
            self.highest -= 1;
        }
        let bucket = &mut self.buckets[self.highest];
        let from = bucket.len().saturating_sub(most);
        self.len -= bucket.len() - from;
        out.extend(bucket.drain(from..));
    }

    /// Puts back what was taken out last.
    pub(super) fn put_back(&mut self, open: &mut Vec<Open>) {
        self.len += open.len();
        self.buckets[self.highest].append(open);
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.len
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urgent_ones_come_first() {
        let mut q = Queue::default();
        let open = |split| Open { split, vertex: 0, turn: 0, at: glam::Vec3::ZERO };
        let pop = |q: &mut Queue, most| {
            let mut out = Vec::new();
            q.pop(most, &mut out);
            out.iter().map(|o| o.split).collect::<Vec<_>>()
        };
        assert_eq!(pop(&mut q, 3), []);
        [(7, 3), (8, 900), (9, 0), (6, 3), (5, 3)].into_iter().for_each(|(i, rank)| q.push(open(i), rank));
        assert_eq!((pop(&mut q, 2), q.len()), (vec![8], 4));
        q.push(open(1), 12);
        assert_eq!((pop(&mut q, 2), pop(&mut q, 2), q.len()), (vec![1], vec![6, 5], 2));
        q.put_back(&mut vec![open(6), open(5)]);
        assert_eq!((q.len(), pop(&mut q, usize::MAX), q.len()), (4, vec![7, 6, 5], 1));
        q.put_back(&mut vec![open(7)]);
        assert_eq!((pop(&mut q, 2), pop(&mut q, 2), pop(&mut q, 2), q.len()), (vec![7], vec![9], vec![], 0));
    }
}
