//! Triangles with links, and the half-edge collapse.
//!
//! Side `3 f + k` of face `f` runs from its corner `k` to the next. Faces turn from the axis of columns to that of rows.

use super::NONE;

#[inline]
pub(super) fn next(side: u32) -> u32 {
    if side % 3 == 2 { side - 2 } else { side + 1 }
}

#[inline]
pub(super) fn previous(side: u32) -> u32 {
    if side.is_multiple_of(3) { side + 2 } else { side - 1 }
}

/// Faces, their links, and a side that begins at each vertex: of those on a border the one without a face across, where there is one.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    /// The vertex at which every side begins; [`NONE`] for those of faces that are gone.
    pub corner: Vec<u32>,
    /// The side across, or [`NONE`].
    pub across: Vec<u32>,
    /// A side that begins at each vertex; [`NONE`] for a vertex that is gone or has none.
    pub at: Vec<u32>,
}

/// What is around a vertex: its neighbours in turn; face `i` lies between neighbours `i` and `i + 1`, which around an inner vertex is the first again.
#[derive(Clone, Debug, Default)]
pub(super) struct Ring {
    pub neighbours: Vec<u32>,
    /// The sides that begin at the vertex, one a face.
    pub sides: Vec<u32>,
    pub border: bool,
}

impl Ring {
    /// How many of the faces go when the vertex goes to a neighbour (on a border, along that).
    pub(super) fn dying(&self) -> usize {
        if self.border { 1 } else { 2 }
    }
}

/// A face that a collapse takes away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Wing {
    /// The side of the face that was collapsed.
    pub side: u32,
    /// Sides of its neighbours across its side at the vertex kept, and across that at the vertex removed.
    pub kept: u32,
    pub removed: u32,
}

impl Surface {
    /// Links faces; `vertices` of them. `None` if three faces meet at a side, or two run along it the same way. O(faces).
    pub(super) fn new(faces: &[[u32; 3]], vertices: usize) -> Option<Self> {
        let corner = faces.as_flattened().to_vec();
        let sides = corner.len() as u32;
        let mut start = vec![0u32; vertices + 1];
        for &v in &corner {
            *start.get_mut(v as usize + 1)? += 1;
        }
        for v in 0..vertices {
            start[v + 1] += start[v];
        }
        // Of every vertex the sides that begin there, each with its end.
        let mut fill = start.clone();
        let mut from = vec![[0; 2]; corner.len()];
        for (&[a, b, c], s) in faces.iter().zip((0..sides).step_by(3)) {
            for (side, at, end) in [(s, a, b), (s + 1, b, c), (s + 2, c, a)] {
                let f = &mut fill[at as usize];
                from[*f as usize] = [end, side];
                *f += 1;
            }
        }
        let mut surface = Surface { corner, across: vec![NONE; sides as usize], at: vec![NONE; vertices] };
        let ending = |at: u32, end: u32| {
            let of = &from[start[at as usize] as usize..start[at as usize + 1] as usize];
            of.iter().find(|[e, _]| *e == end).map(|&[_, side]| side)
        };
        let ends = || faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        for (across, [a, b]) in surface.across.iter_mut().zip(ends()) {
            *across = ending(b, a).unwrap_or(NONE);
        }
        for (s, [a, b]) in (0..sides).zip(ends()) {
            let across = surface.across[s as usize];
            // The first that runs this way is the only one.
            let first = if across == NONE { ending(a, b)? } else { surface.across[across as usize] };
            if first != s {
                return None;
            }
        }
        for s in (0..sides).rev() {
            let at = &mut surface.at[surface.corner[s as usize] as usize];
            if *at == NONE || surface.across[s as usize] == NONE {
                *at = s;
            }
        }
        Some(surface)
    }

    pub(super) fn ends_at(&self, side: u32) -> u32 {
        self.corner[next(side) as usize]
    }

    /// Fills `ring` with what is around `v`, which has a face.
    pub(super) fn ring(&self, v: u32, ring: &mut Ring) {
        ring.neighbours.clear();
        ring.sides.clear();
        let first = self.at[v as usize];
        ring.border = self.across[first as usize] == NONE;
        let mut s = first;
        loop {
            ring.sides.push(s);
            ring.neighbours.push(self.ends_at(s));
            let before = previous(s);
            s = self.across[before as usize];
            if s == NONE {
                ring.neighbours.push(self.corner[before as usize]);
                return;
            }
            if s == first {
                return;
            }
        }
    }

    /// Turns a side about its vertex to where the border begins, if there is one.
    fn anchor(&self, side: u32) -> u32 {
        let mut s = side;
        loop {
            let a = self.across[s as usize];
            if a == NONE {
                return s;
            }
            s = next(a);
            if s == side {
                return s;
            }
        }
    }

    /// Takes `u` to its neighbour number `i`, which the caller knows to be legal; `ring` is that of `u`. Returns the wings: of the face to the left of the way from
    /// the vertex kept to that removed, and to the right.
    pub(super) fn collapse(&mut self, u: u32, i: usize, ring: &Ring) -> [Option<Wing>; 2] {
        let v = ring.neighbours[i];
        let faces = ring.sides.len();
        // Face i runs from u to v; the face before it from v to u.
        let right = ring.sides.get(i).copied();
        let left = match i.checked_sub(1) {
            Some(k) => Some(previous(ring.sides[k])),
            None if !ring.border => Some(previous(ring.sides[faces - 1])),
            None => None,
        };
        let wing = |side: u32, kept: u32, removed: u32| {
            let across = |s: u32| self.across[s as usize];
            Wing { side, kept: across(kept), removed: across(removed) }
        };
        // Vertices on a border stay there, and those within it but for the one that something on it goes onto.
        let on_border = |at: u32| self.across[self.at[at as usize] as usize] == NONE;
        let kept_on_border = ring.border || on_border(v);
        let tips = [left, right].map(|s| s.map(|s| self.corner[previous(s) as usize]));
        let border = tips.map(|t| t.filter(|&t| on_border(t)));
        // Left: v -> u -> l; right: u -> v -> r.
        let left = left.map(|s| wing(s, previous(s), next(s)));
        let right = right.map(|s| wing(s, next(s), previous(s)));
        for &s in &ring.sides {
            self.corner[s as usize] = v;
        }
        for w in [left, right].into_iter().flatten() {
            let tip = self.corner[previous(w.side) as usize];
            for (a, b) in [(w.kept, w.removed), (w.removed, w.kept)] {
                if a != NONE {
                    self.across[a as usize] = b;
                }
            }
            let f = w.side / 3 * 3;
            for s in f..f + 3 {
                self.corner[s as usize] = NONE;
            }
            // A side of what lies beyond that begins at the tip, and one that begins at v.
            let live = if w.kept != NONE { w.kept } else { w.removed };
            let (p, q) =
                if self.corner[live as usize] == tip { (live, next(live)) } else { (next(live), live) };
            self.at[tip as usize] = p;
            self.at[v as usize] = q;
        }
        self.at[u as usize] = NONE;
        for w in [left, right].into_iter().flatten() {
            for s in [w.kept, w.removed].into_iter().filter(|&s| s != NONE) {
                for s in [s, next(s)] {
                    let at = self.corner[s as usize];
                    let turn = if at == v { kept_on_border } else { border.contains(&Some(at)) };
                    self.at[at as usize] = if turn { self.anchor(s) } else { s };
                }
            }
        }
        [left, right]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of four faces about vertex 4.
    fn square() -> Surface {
        Surface::new(&[[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], 5).unwrap()
    }

    fn check(s: &Surface) {
        for side in 0..s.corner.len() as u32 {
            let a = s.across[side as usize];
            if s.corner[side as usize] == NONE {
                continue;
            }
            if a != NONE {
                assert_eq!(s.across[a as usize], side);
                assert_eq!(s.corner[a as usize], s.ends_at(side));
                assert_eq!(s.ends_at(a), s.corner[side as usize]);
            }
        }
        for (v, &at) in s.at.iter().enumerate().filter(|(_, at)| **at != NONE) {
            assert_eq!(s.corner[at as usize] as usize, v);
        }
    }

    #[test]
    fn rings_go_round() {
        let s = square();
        check(&s);
        let mut ring = Ring::default();
        s.ring(4, &mut ring);
        assert!(!ring.border && ring.sides.len() == 4 && ring.neighbours.len() == 4);
        s.ring(0, &mut ring);
        assert!(ring.border);
        assert_eq!(ring.neighbours, [1, 4, 3]);
        assert!(Surface::new(&[[0, 1, 2], [0, 1, 3]], 4).is_none());
    }

    #[test]
    fn a_collapse_keeps_the_links() {
        let mut s = square();
        let mut ring = Ring::default();
        s.ring(4, &mut ring);
        let i = ring.neighbours.iter().position(|&n| n == 0).unwrap();
        let [left, right] = s.collapse(4, i, &ring);
        check(&s);
        // Left of the way from 0 to 4 lies 3.
        assert_eq!((left.unwrap().side / 3, right.unwrap().side / 3), (3, 0));
        let faces: Vec<_> = s.corner.chunks(3).filter(|c| c[0] != NONE).map(<[u32]>::to_vec).collect();
        assert_eq!(faces, [[1, 2, 0], [2, 3, 0]]);
        s.ring(1, &mut ring);
        assert_eq!((ring.neighbours.clone(), ring.border), (vec![2, 0], true));
    }
}
