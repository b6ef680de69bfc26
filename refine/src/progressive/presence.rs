//! Which channels rows of attributes have.

/// For every row the channels it has, bit k for channel k. Rows differ little in this, so it takes nothing where all are alike, else 1 B a row, or 8 where there are more than 256 kinds.
#[derive(Clone, Debug, Default)]
pub struct Presence {
    /// Those there are, as they first came; 256 at most.
    kinds: Vec<u64>,
    /// Which of them each row has.
    of: Kinds,
    len: usize,
}

#[derive(Clone, Debug, Default)]
enum Kinds {
    /// The first.
    #[default]
    Same,
    Bytes(Vec<u8>),
    /// There are more: as they are.
    Each(Vec<u64>),
}

/// Kinds that a byte tells apart.
const MOST: usize = 256;

impl Presence {
    /// So many rows with the same channels.
    pub fn all(channels: u64, len: usize) -> Presence {
        Presence { kinds: vec![channels], of: Kinds::Same, len }
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.len
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// That of row `r`, if there is one.
    pub fn get(&self, r: usize) -> Option<u64> {
        (r < self.len).then(|| self[r])
    }

    /// Those of all rows.
    pub fn iter(&self) -> impl Iterator<Item = u64> + '_ {
        (0..self.len).map(|r| self[r])
    }

    /// Adds a row. O(kinds), as long as there are at most 256.
    #[inline]
    pub fn push(&mut self, channels: u64) {
        self.len += 1;
        // As nearly always.
        if self.kinds.len() != 1 || self.kinds[0] != channels {
            self.push_kind(channels);
        } else if let Kinds::Bytes(of) = &mut self.of {
            of.push(0);
        }
    }

    /// As [`Presence::push`], counted already.
    #[inline(never)]
    fn push_kind(&mut self, channels: u64) {
        if let Kinds::Each(of) = &mut self.of {
            of.push(channels);
            return;
        }
        let kind = self.kinds.iter().position(|&k| k == channels).unwrap_or(self.kinds.len());
        if kind == MOST {
            let before = self.len - 1;
            let mut each: Vec<u64> = (0..before).map(|r| self.at(r)).collect();
            each.push(channels);
            (self.of, self.kinds) = (Kinds::Each(each), Vec::new());
            return;
        }
        if kind == self.kinds.len() {
            self.kinds.push(channels);
        }
        if kind > 0 && matches!(self.of, Kinds::Same) {
            self.of = Kinds::Bytes(vec![0; self.len - 1]);
        }
        if let Kinds::Bytes(of) = &mut self.of {
            of.push(kind as u8);
        }
    }

    #[inline]
    fn at(&self, r: usize) -> u64 {
        match &self.of {
            Kinds::Same => self.kinds[0],
            Kinds::Bytes(of) => self.kinds[of[r] as usize],
            Kinds::Each(of) => of[r],
        }
    }

    /// Drops all rows but the first `len`.
    pub fn truncate(&mut self, len: usize) {
        match &mut self.of {
            Kinds::Same => {}
            Kinds::Bytes(of) => of.truncate(len),
            Kinds::Each(of) => of.truncate(len),
        }
        self.len = self.len.min(len);
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let of = match &self.of {
            Kinds::Same => 0,
            Kinds::Bytes(of) => of.len(),
            Kinds::Each(of) => 8 * of.len(),
        };
        8 * self.kinds.len() + of
    }
}

impl std::ops::Index<usize> for Presence {
    type Output = u64;

    /// That of row `r`. Panics if there is no such row.
    #[inline]
    fn index(&self, r: usize) -> &u64 {
        assert!(r < self.len, "row {r} of {}", self.len);
        match &self.of {
            Kinds::Same => &self.kinds[0],
            Kinds::Bytes(of) => &self.kinds[of[r] as usize],
            Kinds::Each(of) => &of[r],
        }
    }
}

impl Extend<u64> for Presence {
    fn extend<I: IntoIterator<Item = u64>>(&mut self, rows: I) {
        rows.into_iter().for_each(|r| self.push(r));
    }
}

impl PartialEq for Presence {
    fn eq(&self, other: &Presence) -> bool {
        self.len == other.len && self.iter().eq(other.iter())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_holds_what_a_vector_does_in_less() {
        for (kinds, bytes) in [(1u64, 8), (3, 1100), (256, 3100), (700, 8000)] {
            let all: Vec<u64> = (0..1000).map(|i| ((i * 7919) % kinds) << 3).collect();
            let mut p = Presence::default();
            assert!(p.is_empty() && p.get(0).is_none());
            p.extend(all.iter().copied());
            assert!(
                p.iter().eq(all.iter().copied()) && p.len() == 1000 && p.bytes() <= bytes,
                "{}",
                p.bytes()
            );
            assert_eq!((p[77], p.get(77), p.get(1000)), (all[77], Some(all[77]), None));
            p.truncate(40);
            p.push(5);
            let mut other = Presence::default();
            other.extend(all[..40].iter().copied().chain([5]));
            assert!(p == other && p.len() == 41);
            other.push(6);
            assert!(p != other);
        }
        assert_eq!(Presence::all(7, 3).iter().collect::<Vec<_>>(), [7, 7, 7]);
    }
}
