//! Triangle strips: runs of triangles in which each shares an edge with the one before, so that it takes one corner more instead of three.
//!
//! Strips are grown greedily: from a face with the fewest neighbours that are still free (Akeley, Haeberli & Burns 1990), along the longest of the three ways to begin. No face is swapped
//! or left out, and orientation is kept. Not guaranteed: the fewest strips, which is NP-hard to find; nor that a small change of the mesh changes few strips.

use crate::progressive::links::next;
use rustc_hash::FxHashMap;

/// Triangles as strips. Triangle `i` of a strip `s` is `(s[i], s[i + 1], s[i + 2])` if `i` is even, else `(s[i + 1], s[i], s[i + 2])`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Strips {
    corners: Vec<u32>,
    /// Where each strip begins, and the end.
    starts: Vec<u32>,
}

impl Strips {
    /// Of the triangles given by their corners; those with two equal corners are left out, as are free slots of an index buffer. The same for the same triangles in the same order. O(n).
    ///
    /// At most 2^30 triangles.
    pub fn new(triangles: &[[u32; 3]]) -> Strips {
        Former::new(triangles).run()
    }

    /// Strips.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Triangles in all strips.
    pub fn triangles(&self) -> usize {
        self.corners.len() - 2 * self.len()
    }

    /// Triangles in a strip, on the mean; 0 without strips.
    pub fn mean_length(&self) -> f64 {
        self.triangles() as f64 / self.len().max(1) as f64
    }

    /// The corners of each strip, three or more.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> + '_ {
        self.starts.windows(2).map(|w| &self.corners[w[0] as usize..w[1] as usize])
    }

    /// All strips in one index buffer, with `restart` between two (primitive restart).
    pub fn with_restart(&self, restart: u32) -> Vec<u32> {
        let mut out = Vec::with_capacity(self.corners.len() + self.len());
        for s in self.iter() {
            if !out.is_empty() {
                out.push(restart);
            }
            out.extend_from_slice(s);
        }
        out
    }
}

struct Former<'a> {
    faces: &'a [[u32; 3]],
    /// The face and its edge that run along each directed edge; the first of several.
    along: FxHashMap<(u32, u32), u32>,
    /// The next face and edge along the same directed edge, for edges of several.
    more: FxHashMap<u32, u32>,
    used: Vec<bool>,
    /// Used in the attempt of this number, the last one.
    tried: Vec<u64>,
    attempt: u64,
    growing: bool,
}

impl<'a> Former<'a> {
    fn new(faces: &'a [[u32; 3]]) -> Self {
        let flat = |f: &[u32; 3]| f[0] == f[1] || f[1] == f[2] || f[2] == f[0];
        let used: Vec<bool> = faces.iter().map(flat).collect();
        let mut along = FxHashMap::default();
        along.reserve(3 * faces.len());
        let mut more = FxHashMap::default();
        // Downwards, so that the first face comes first.
        for (i, f) in faces.iter().enumerate().rev().filter(|(i, _)| !used[*i]) {
            for k in 0..3 {
                let code = (i as u32) << 2 | k as u32;
                if let Some(before) = along.insert((f[k], f[next(k)]), code) {
                    more.insert(code, before);
                }
            }
        }
        Former { tried: vec![0; faces.len()], attempt: 0, growing: false, faces, along, more, used }
    }

    /// A free face along the edge from `a` to `b`, and its edge.
    fn free(&self, a: u32, b: u32) -> Option<(u32, usize)> {
        let mut code = *self.along.get(&(a, b))?;
        loop {
            let f = code >> 2;
            let tried = self.growing && self.tried[f as usize] == self.attempt;
            if !(tried || self.used[f as usize]) {
                return Some((f, (code & 3) as usize));
            }
            code = *self.more.get(&code)?;
        }
    }

    /// Neighbours that are free.
    fn degree(&self, f: u32) -> usize {
        let c = self.faces[f as usize];
        (0..3).filter(|&k| self.free(c[next(k)], c[k]).is_some()).count()
    }

    /// The strip that begins with corner `k` of face `f`.
    fn grow(&mut self, f: u32, k: usize) -> (Vec<u32>, Vec<u32>) {
        self.attempt += 1;
        self.growing = true;
        let c = self.faces[f as usize];
        let mut strip = vec![c[k], c[next(k)], c[next(next(k))]];
        let mut members = vec![f];
        self.tried[f as usize] = self.attempt;
        loop {
            let n = strip.len();
            let (a, b) = (strip[n - 2], strip[n - 1]);
            // The next triangle's number is n - 2.
            let found = if n % 2 == 0 { self.free(a, b) } else { self.free(b, a) };
            let Some((g, edge)) = found else { break };
            self.tried[g as usize] = self.attempt;
            members.push(g);
            strip.push(self.faces[g as usize][next(next(edge))]);
        }
        self.growing = false;
        (strip, members)
    }

    fn run(mut self) -> Strips {
        let mut out = Strips { starts: vec![0], ..Strips::default() };
        // Faces by free neighbours; an entry may be out of date.
        let mut waiting: [Vec<u32>; 4] = Default::default();
        for f in (0..self.faces.len() as u32).rev().filter(|&f| !self.used[f as usize]) {
            waiting[self.degree(f)].push(f);
        }
        while let Some(d) = waiting.iter().position(|w| !w.is_empty()) {
            let Some(f) = waiting[d].pop() else { break };
            if self.used[f as usize] {
                continue;
            }
            let mut best = self.grow(f, 0);
            for k in 1..3 {
                let other = self.grow(f, k);
                if other.1.len() > best.1.len() {
                    best = other;
                }
            }
            let (strip, members) = best;
            members.iter().for_each(|&g| self.used[g as usize] = true);
            for &g in &members {
                let c = self.faces[g as usize];
                for k in 0..3 {
                    if let Some((h, _)) = self.free(c[next(k)], c[k]) {
                        waiting[self.degree(h)].push(h);
                    }
                }
            }
            out.corners.extend_from_slice(&strip);
            out.starts.push(out.corners.len() as u32);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The triangles of strips, each beginning with its least corner, sorted.
    fn unrolled(strips: &Strips) -> Vec<[u32; 3]> {
        let of = |s: &[u32]| -> Vec<[u32; 3]> {
            let turn = |i: usize| {
                if i.is_multiple_of(2) { [s[i], s[i + 1], s[i + 2]] } else { [s[i + 1], s[i], s[i + 2]] }
            };
            (0..s.len() - 2).map(turn).collect()
        };
        normal(strips.iter().flat_map(of))
    }

    fn normal(all: impl Iterator<Item = [u32; 3]>) -> Vec<[u32; 3]> {
        let mut all: Vec<[u32; 3]> = all
            .filter(|f| f[0] != f[1] && f[1] != f[2] && f[2] != f[0])
            .map(|mut f| {
                let least = (0..3).min_by_key(|&k| f[k]).unwrap_or(0);
                f.rotate_left(least);
                f
            })
            .collect();
        all.sort_unstable();
        all
    }

    proptest! {
        /// Any triangles, many of them beside each other, some on edges of three faces, some turned over, some twice.
        #[test]
        fn strips_hold_the_same_triangles(faces in prop::collection::vec(prop::array::uniform3(0u32..9), 0..80)) {
            let strips = Strips::new(&faces);
            prop_assert_eq!(unrolled(&strips), normal(faces.iter().copied()));
            prop_assert!(strips.iter().all(|s| s.len() >= 3));
            let all = strips.with_restart(u32::MAX);
            let again: Vec<&[u32]> = all.split(|&w| w == u32::MAX).filter(|s| !s.is_empty()).collect();
            prop_assert_eq!(again, strips.iter().collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_ribbon_is_one_strip_and_a_grid_has_long_ones() {
        let ribbon: Vec<[u32; 3]> =
            (0..40).map(|i| if i % 2 == 0 { [i, i + 1, i + 2] } else { [i + 1, i, i + 2] }).collect();
        let one = Strips::new(&ribbon);
        assert_eq!((one.len(), one.triangles()), (1, 40));
        let n = 20;
        let at = |x: u32, y: u32| y * (n + 1) + x;
        let cells = (0..n * n).map(|c| (c % n, c / n));
        let grid: Vec<[u32; 3]> = cells
            .flat_map(|(x, y)| {
                [[at(x, y), at(x + 1, y), at(x, y + 1)], [at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]]
            })
            .collect();
        let strips = Strips::new(&grid);
        assert_eq!(unrolled(&strips), normal(grid.iter().copied()));
        assert!(strips.mean_length() > 8.0, "{}", strips.mean_length());
        assert!(Strips::new(&[]).is_empty() && Strips::new(&[]).mean_length() == 0.0);
    }
}
