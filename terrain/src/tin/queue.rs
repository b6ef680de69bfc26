//! Triangles by error, roughly: buckets of an eighth of an octave.

/// Takes the greatest first, but for errors in the same bucket the latest. What was queued and has changed is for the caller to tell.
#[derive(Clone, Debug, Default)]
pub(super) struct Buckets<T> {
    buckets: Vec<Vec<T>>,
    top: usize,
    len: usize,
}

/// Bits of an f32's mantissa that tell buckets apart.
const BITS: u32 = 3;

impl<T> Buckets<T> {
    /// `error` is positive.
    pub(super) fn push(&mut self, error: f32, item: T) {
        // The bits of positive floats are in their order. Errors below 2^-40 share the first bucket.
        let least = (127 - 40) << BITS;
        let bucket = ((error.to_bits() >> (23 - BITS)) as usize).saturating_sub(least);
        if bucket >= self.buckets.len() {
            self.buckets.resize_with(bucket + 1, Vec::new);
        }
        self.buckets[bucket].push(item);
        self.top = self.top.max(bucket);
        self.len += 1;
    }

    pub(super) fn pop(&mut self) -> Option<T> {
        loop {
            if let Some(item) = self.buckets.get_mut(self.top)?.pop() {
                self.len -= 1;
                return Some(item);
            }
            self.top = self.top.checked_sub(1)?;
        }
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn greater_errors_come_first() {
        let mut queue = Buckets::default();
        for e in [1.0f32, 1e-30, 1e20, 2.5, 700.0, 1.5] {
            queue.push(e, e);
        }
        assert_eq!(queue.len(), 6);
        assert_eq!(queue.pop(), Some(1e20));
        queue.push(9.0, 9.0);
        let rest: Vec<f32> = std::iter::from_fn(|| queue.pop()).collect();
        assert_eq!(rest, [700.0, 9.0, 2.5, 1.5, 1.0, 1e-30]);
        assert_eq!(queue.pop(), None);
    }
}
