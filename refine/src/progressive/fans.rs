//! The faces of a mesh between base and full detail: corners, links, and what a split does to them.

use super::links::{Half, across, link, next, previous};
use super::{Damage, SplitCode};
use crate::aif::NONE;

/// Corners (as wedges) and links of the faces there are.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fans {
    pub(crate) corners: Vec<[u32; 3]>,
    pub(crate) links: Vec<[u32; 3]>,
}

/// An edge of the split vertex that opens: the face that goes to the new vertex, and the one that stays, as far as they are there.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Opening {
    pub(crate) inner: Option<Half>,
    pub(crate) outer: Option<Half>,
}

/// Where a split opens the fan of its vertex.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Gap {
    pub(crate) left: Opening,
    /// Of a split at a border: the edge where the fan ends.
    pub(crate) right: Opening,
    /// Faces from the left to the right: those that go to the new vertex.
    pub(crate) faces: usize,
}

impl Fans {
    /// The wedge at the vertex that `h` is seen from.
    #[inline]
    pub(crate) fn wedge(&self, h: Half) -> u32 {
        self.corners[h.face() as usize][h.corner()]
    }

    /// The wedge at the other end of `h`.
    #[inline]
    fn far_wedge(&self, h: Half) -> u32 {
        self.corners[h.face() as usize][h.far_corner()]
    }

    /// The same edge in the face across.
    #[inline]
    pub(crate) fn across(&self, h: Half) -> Option<Half> {
        across(h, self.links[h.face() as usize][h.edge() as usize])
    }

    /// Where split `i` opens its fan. `right` is not looked at if the split makes one face. O(valence).
    ///
    /// Errors: cuts that are no edges, or of different fans.
    #[inline]
    pub(crate) fn find_gap(&self, i: usize, cuts: (u32, u32), code: SplitCode) -> Result<Gap, Damage> {
        self.find_gap_and_tell(i, cuts, code, |_| ())
    }

    /// The same; `tell` is given the faces that go to the new vertex, each by the edge by which it is entered, in turn.
    #[inline]
    pub(crate) fn find_gap_and_tell(
        &self,
        i: usize,
        (cut, right): (u32, u32),
        code: SplitCode,
        mut tell: impl FnMut(Half),
    ) -> Result<Gap, Damage> {
        let count = self.corners.len() as u32;
        let two = code.two_faces();
        let lost = |cut: u32| cut >> 2 >= count || cut & 3 == 3;
        if lost(cut) || (two && lost(right)) {
            let to = if lost(cut) { cut } else { right };
            return Err(Damage::Reference { what: "split", at: i, to });
        }
        let named = Half::new(cut >> 2, cut & 3, code.left_starts());
        let beyond = self.across(named);
        let left = if code.left_inner() {
            Opening { inner: Some(named), outer: beyond }
        } else {
            Opening { inner: beyond, outer: Some(named) }
        };
        let mut gap = Gap { left, ..Gap::default() };
        let mut entry = left.inner;
        while let Some(h) = entry {
            tell(h);
            let exit = h.turn();
            let outer = self.across(exit);
            gap.right = Opening { inner: Some(exit), outer };
            gap.faces += 1;
            let met = two
                && if code.right_inner() {
                    exit.code() == right
                } else {
                    outer.is_some_and(|o| o.code() == right)
                };
            if met {
                return Ok(gap);
            }
            if gap.faces > count as usize {
                return Err(Damage::Fan(i));
            }
            entry = outer;
        }
        // The fan has ended: so it must at a border, and must not elsewhere.
        if two { Err(Damage::Fan(i)) } else { Ok(gap) }
    }

    /// Gives the corners of `count` faces at a vertex, from `first` on, the wedges that `map` says; `seen` is told every index-buffer entry.
    #[inline]
    pub(crate) fn hand_over(
        &mut self,
        first: Option<Half>,
        count: usize,
        map: impl Fn(u32) -> u32,
        seen: &mut Option<Vec<u32>>,
    ) {
        let mut entry = first;
        for _ in 0..count {
            let Some(h) = entry else { return };
            self.give(h, &map, seen);
            entry = self.across(h.turn());
        }
    }

    /// The same for these faces.
    #[inline]
    pub(crate) fn hand_over_run(
        &mut self,
        run: &[Half],
        map: impl Fn(u32) -> u32,
        seen: &mut Option<Vec<u32>>,
    ) {
        run.iter().for_each(|&h| self.give(h, &map, seen));
    }

    /// The same for the faces from `first` on, up to one that is not below `end`, or a border.
    #[inline]
    pub(crate) fn hand_over_before(
        &mut self,
        first: Option<Half>,
        end: u32,
        map: impl Fn(u32) -> u32,
        seen: &mut Option<Vec<u32>>,
    ) {
        let mut entry = first;
        while let Some(h) = entry.filter(|h| h.face() < end) {
            self.give(h, &map, seen);
            entry = self.across(h.turn());
        }
    }

    #[inline]
    fn give(&mut self, h: Half, map: impl Fn(u32) -> u32, seen: &mut Option<Vec<u32>>) {
        let c = h.corner();
        let wedge = &mut self.corners[h.face() as usize][c];
        *wedge = map(*wedge);
        if let Some(seen) = seen {
            seen.push(3 * h.face() + c as u32);
        }
    }

    /// The wedge at the tip of a new face: its neighbour's, at the new vertex or at the old.
    #[inline]
    pub(crate) fn tip(&self, at: Opening, from_inner: bool) -> u32 {
        let (a, b) = if from_inner { (at.inner, at.outer) } else { (at.outer, at.inner) };
        a.or(b).map_or(NONE, |h| self.far_wedge(h))
    }

    /// Appends the face with these corners (old vertex, new vertex, tip) into an opening; returns its edge between the old vertex and
    /// the new one, seen from the old.
    #[inline]
    pub(crate) fn insert(
        &mut self,
        (a, vu_next): (usize, bool),
        [vt, vu, tip]: [u32; 3],
        at: Opening,
    ) -> Half {
        let f = self.corners.len() as u32;
        self.corners.push([NONE; 3]);
        self.links.push([NONE; 3]);
        self.insert_at(f, (a, vu_next), [vt, vu, tip], at)
    }

    /// The same in slot `f`, which is there and holds no face.
    #[inline]
    pub(crate) fn insert_at(
        &mut self,
        f: u32,
        (a, vu_next): (usize, bool),
        [vt, vu, tip]: [u32; 3],
        at: Opening,
    ) -> Half {
        let (b, c) = (next(a), previous(a));
        let mut corners = [tip; 3];
        (corners[b], corners[c]) = if vu_next { (vu, vt) } else { (vt, vu) };
        self.corners[f as usize] = corners;
        self.links[f as usize] = [NONE; 3];
        let (old, new) = sides(f, a, vu_next);
        if let Some(outer) = at.outer {
            self.connect(old, outer);
        }
        if let Some(inner) = at.inner {
            self.connect(new, inner);
        }
        Half::new(f, b as u32, !vu_next)
    }

    /// Links two half-edges, both seen from the same vertex.
    #[inline]
    pub(crate) fn connect(&mut self, x: Half, y: Half) {
        self.links[x.face() as usize][x.edge() as usize] = link(x, y);
        self.links[y.face() as usize][y.edge() as usize] = link(y, x);
    }

    /// What a split's face lies between.
    #[inline]
    pub(crate) fn opening_of(&self, f: u32, (a, vu_next): (usize, bool)) -> Opening {
        let (old, new) = sides(f, a, vu_next);
        Opening { inner: self.across(new), outer: self.across(old) }
    }

    /// The wedges of a split's face at the old vertex and at the new one.
    #[inline]
    pub(crate) fn ends_of(&self, f: u32, (a, vu_next): (usize, bool)) -> (u32, u32) {
        let c = &self.corners[f as usize];
        let (b, d) = (c[next(a)], c[previous(a)]);
        if vu_next { (d, b) } else { (b, d) }
    }

    /// Closes an opening whose face is going.
    #[inline]
    pub(crate) fn close(&mut self, at: Opening) {
        match (at.outer, at.inner) {
            (Some(o), Some(i)) => self.connect(o, i),
            (Some(h), None) | (None, Some(h)) => self.links[h.face() as usize][h.edge() as usize] = NONE,
            (None, None) => {}
        }
    }

    /// Tells the wedges in the fan of the vertex that `start` is seen from, each at least once.
    #[inline]
    pub(crate) fn each_wedge_around(&self, start: Half, mut tell: impl FnMut(u32)) {
        let mut last = self.wedge(start);
        tell(last);
        // Both ways round, so that a border does not hide a side.
        for first in [start.turn(), start] {
            let mut at = first;
            for _ in 0..self.corners.len() {
                let Some(h) = self.across(at) else { break };
                if h.face() == start.face() {
                    // All the way round.
                    return;
                }
                let w = self.wedge(h);
                if w != last {
                    tell(w);
                    last = w;
                }
                at = h.turn();
            }
        }
    }

    /// The wedges in the fan of the vertex that `start` is seen from, each once.
    pub(crate) fn wedges_around(&self, start: Half) -> Vec<u32> {
        let mut found = vec![self.wedge(start)];
        // Both ways round, so that a border does not hide a side.
        for first in [start.turn(), start] {
            let mut at = first;
            for _ in 0..self.corners.len() {
                let Some(h) = self.across(at).filter(|h| h.face() != start.face()) else { break };
                let w = self.wedge(h);
                if !found.contains(&w) {
                    found.push(w);
                }
                at = h.turn();
            }
        }
        found
    }
}

/// The edges of a split's face `f` between its tip and the old vertex, seen from that, and between its tip and the new one, seen from that.
#[inline]
fn sides(f: u32, a: usize, vu_next: bool) -> (Half, Half) {
    let after = Half::new(f, a as u32, false);
    let before = Half::new(f, previous(a) as u32, true);
    if vu_next { (before, after) } else { (after, before) }
}
