//! Splits that could be made or undone next, and when to look at them: the times apart, as most frames look at few of many.

use crate::selective::{Clocks, Due, Entry};

/// A split that may come next, or may be undone next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Open {
    pub(super) entry: Entry,
    /// The node it replaces.
    pub(super) node: u32,
}

/// A list without order.
#[derive(Debug, Default)]
pub(super) struct List {
    of: Vec<Open>,
    due: Vec<Due>,
}

impl List {
    /// Bytes of an entry.
    pub(super) const ENTRY: usize = size_of::<Open>() + size_of::<Due>();

    pub(super) fn len(&self) -> usize {
        self.of.len()
    }

    /// Of both arrays the lesser.
    pub(super) fn capacity(&self) -> usize {
        self.of.capacity().min(self.due.capacity())
    }

    pub(super) fn bytes(&self) -> usize {
        size_of::<Open>() * self.of.capacity() + size_of::<Due>() * self.due.capacity()
    }

    /// Room for so many in all.
    pub(super) fn reserve_to(&mut self, to: usize) {
        self.of.reserve_exact(to.saturating_sub(self.of.len()));
        self.due.reserve_exact(to.saturating_sub(self.due.len()));
    }

    #[inline]
    pub(super) fn get(&self, at: usize) -> Option<&Open> {
        self.of.get(at)
    }

    /// The last ones, so many if there are.
    pub(super) fn tail(&self, most: usize) -> &[Open] {
        &self.of[self.of.len() - most.min(self.of.len())..]
    }

    #[inline]
    pub(super) fn push(&mut self, open: Open, due: Due) {
        self.of.push(open);
        self.due.push(due);
    }

    /// Takes out entry `at`, which there is; returns the one that is there now, if any.
    #[inline]
    pub(super) fn take_out(&mut self, at: usize) -> Option<Open> {
        self.of.swap_remove(at);
        self.due.swap_remove(at);
        self.of.get(at).copied()
    }

    #[inline]
    pub(super) fn set_due(&mut self, at: usize, due: Due) {
        if let Some(d) = self.due.get_mut(at) {
            *d = due;
        }
    }

    /// The place behind the next entry that is due (`all`: any), downwards from `at`; 0 if none is.
    #[inline]
    pub(super) fn next_due(&self, at: usize, all: bool, clock: &Clocks) -> usize {
        let at = at.min(self.due.len());
        if all {
            return at;
        }
        let (due, sums) = (&self.due[..at], clock.sums());
        // Most are not: asked without a branch for each.
        let (rest, blocks) = due.as_rchunks::<16>();
        for (k, block) in blocks.iter().enumerate().rev() {
            if block.iter().fold(false, |any, &d| any | sums.have_reached(d)) {
                let last = block.iter().rposition(|&d| sums.have_reached(d));
                return last.map_or(0, |j| rest.len() + 16 * k + j + 1);
            }
        }
        rest.iter().rposition(|&d| sums.have_reached(d)).map_or(0, |k| k + 1)
    }
}
