//! Errors of splits by the ring rule ([`super::rings`]): proven for every point of the finest mesh, from one walk from there to the base.
//!
//! Every face of the finest mesh lies, whole or in convex *pieces*, on faces of the mesh; at full detail each on itself. When a split is undone, all pieces on the two rings that go are put on faces of the one that comes.
//! The distance from a triangle is a convex function, so no point of a piece is farther from the face that it lies on than the farthest of the piece's corners is: that is its error, and the largest of the pieces moved is that of the split.
//! A piece that is too far from any one face is cut between two of them.
//!
//! **Why this holds for all views.** By the ring rule the patch that a collapse replaces, the one that comes, and what has happened to them before are the same in every mesh of the hierarchy. So a point takes the same way from face to face, only
//! how far it goes depends on the mesh; and the face that it was put on last is, in that mesh, as it was then. The pieces may overlap: of a point that lies in several, each goes a way for which this is true.
//!
//! **Who answers.** A split that is undone, but need not be for a view, is there fine enough, or out of view: and with it all that lies in its sphere and is no farther than its error. If split `i` moved a point and split `j` did before, `j` needs `i`: so where `i` is
//! undone `j` is, too, and answers for the point as long as that is no farther than the error of `j`. The error, the sphere and the cone of `i` are those of the other pieces only. So a place that stays as far as it was makes no sphere larger.
//! (Which way it deviates may change: so not where directions are looked for.)
//!
//! **Rounding.** Pieces are cut in the plane of their face, by weights of its corners, in f64: what is lost or added at a cut is some 1e-16 of the face's size. Errors are raised by [`SLACK`] of the diagonal.

mod cut;
mod shapes;
#[cfg(test)]
mod tests;

use super::bounds::Bounds;
use super::directions::Body;
use super::forest::Forest;
use super::nearest::{Reach, nearest};
use super::spheres::{self, Extent};
use super::{Finest, Options};
use crate::aif::NONE;
use crate::progressive::ProgressiveMesh;
use crate::selective::Front;
use crate::simplify::measure::closest_on_triangle;
use cut::{Between, best, between};
use glam::DVec3;
use shapes::{convex_hull, join};

/// Corners of a stored piece at most; one with more becomes two.
const CORNERS: usize = 8;
/// A piece is not cut if its error is at most so many times what its corners are from what is nearest to them: what reaches beyond the face it is put on is no more than a seventh of that.
const ENOUGH: f64 = 1.01;
/// Nor if it is at most this part of what the split has anyway. What reaches beyond its face is in the way of later collapses beside it: with much more, errors creep over the surface (igea at 0.3: 5 % more faces).
const LITTLE: f64 = 0.15;
/// Nor if it is less than this, of the diagonal.
const TINY: f64 = 1e-7;
/// What errors are raised by, of the diagonal: enough for thousands of cuts of one piece.
const SLACK: f64 = 1e-11;
/// Cuts of one piece by a collapse at most, and for each face of the ring: a piece over the vertex of a fan has to be cut at all its edges (fandisk has fans of twenty).
const CUTS: usize = 16;
const CUTS_A_FACE: usize = 3;
/// A piece beside all edges, whose error is more than so many times what its corners are from what is nearest to them, lies over a ring that is folded.
const FOLDED: f64 = 1.3;

/// A convex part of a finest face, by the weights of its second and third corner; the next on the same face of the mesh, or the next that is free.
struct Piece {
    face: u32,
    next: u32,
    len: u8,
    /// As of [`Walk::known`].
    known: f64,
    at: [[f64; 2]; CORNERS],
}

/// A corner of a piece, which face of the ring that comes is nearest to it or about so, and how far it is from that.
#[derive(Clone, Copy)]
struct Corner {
    at: [f64; 2],
    p: DVec3,
    d: f64,
    on: usize,
}

impl Corner {
    /// The weights of a place on the way to another corner.
    #[inline]
    fn towards(&self, other: &Corner, t: f64) -> [f64; 2] {
        let (a, b) = (self.at, other.at);
        [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t]
    }
}

/// Where the corners of a piece that was taken up end.
#[derive(Clone, Copy)]
struct End {
    face: u32,
    end: u32,
    known: f64,
}

/// Pieces to be put, and lists of corners to be used again.
#[derive(Default)]
struct Pile {
    stack: Vec<Vec<Corner>>,
    spare: Vec<Vec<Corner>>,
}

impl Pile {
    fn fresh(&mut self) -> Vec<Corner> {
        let mut piece = self.spare.pop().unwrap_or_default();
        piece.clear();
        piece
    }
}

/// The whole of a face.
const WHOLE: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

/// What was found last for a vertex of the finest mesh.
#[derive(Clone, Copy)]
struct Near {
    /// The split it was found for.
    split: u32,
    on: u32,
    d: f64,
}

struct Walk<'a> {
    pm: &'a ProgressiveMesh,
    forest: &'a Forest,
    finest: &'a Finest,
    front: Front,
    /// Where vertices are now.
    positions: Vec<DVec3>,
    /// Normals of the finest faces, of unit length or 0.
    normals: Vec<DVec3>,
    /// The first whole face, and the first piece, on the face in each slot.
    first: Vec<[u32; 2]>,
    /// Of a whole face the next one.
    next: Vec<u32>,
    /// Pieces that there are of every face; 0 if it is whole.
    parts: Vec<u32>,
    /// Of a whole face the largest error of a split that has been undone and answers for it.
    known: Vec<f64>,
    pieces: Vec<Piece>,
    free: u32,
    near: Vec<Near>,
    scratch: Scratch,
}

#[derive(Default)]
struct Scratch {
    star: Vec<u32>,
    whole: Vec<u32>,
    /// Faces, and pieces of them.
    loose: Vec<(u32, u32)>,
    shapes: Vec<Vec<[f64; 2]>>,
    hull: Vec<[f64; 2]>,
    /// Corners of pieces, one after the other; and the face of each piece, and where its corners end.
    corners: Vec<Corner>,
    ends: Vec<End>,
    /// Whole faces, and pieces, that this split answers for from now on.
    faces: Vec<u32>,
    pieces: Vec<u32>,
    pile: Pile,
    fan: Vec<[u32; 3]>,
    between: Vec<Between>,
    ways: Vec<DVec3>,
}

/// The ring that comes.
struct Ring<'a> {
    slots: &'a [u32],
    triangles: &'a [Reach],
    between: &'a [Between],
    own: DVec3,
    /// Errors up to this are no reason to cut.
    little: f64,
    /// The largest error so far.
    error: f64,
    extent: &'a mut Extent,
    ways: Option<&'a mut Vec<DVec3>>,
    /// As in [`Scratch`].
    faces: &'a mut Vec<u32>,
    pieces: &'a mut Vec<u32>,
}

impl Ring<'_> {
    fn little(&self) -> f64 {
        self.little.max(LITTLE * self.error)
    }

    /// A piece need not be cut to be put on a face.
    fn fits(&self, error: f64, piece: &[Corner]) -> bool {
        error <= self.little() || error <= ENOUGH * piece.iter().map(|c| c.d).fold(0.0, f64::max)
    }
}

/// The bounds of all splits. `front` is at full detail, and the order of the splits that of the rule. O(n log n) for meshes whose hierarchy is as deep.
pub(super) fn measure(pm: &ProgressiveMesh, forest: &Forest, front: Front, options: &Options) -> Bounds {
    let finest = Finest::new(pm, forest, &front);
    let mut bodies = options.directions.then(|| vec![Body::default(); forest.len()]);
    let mut errors = vec![0.0f64; forest.len()];
    let mut extents = vec![Extent::default(); forest.len()];
    let ups = forest.ups();
    let mut walk = Walk::new(pm, forest, front, &finest);
    for i in (0..forest.len() as u32).rev() {
        let k = i as usize;
        let body = bodies.as_mut().map(|b| &mut b[k]);
        // Those right below have raised it to their own.
        let error = walk.undo(i, errors[k], &mut extents[k], body);
        errors[k] = errors[k].max(error);
        if let Some(up) = errors.get_mut(ups[k] as usize) {
            *up = up.max(error);
        }
    }
    let mut bounds = spheres::around(pm, forest, &finest, &extents);
    let margin = options.margin.max(1.0);
    bounds.set_errors(forest, errors.into_iter().map(|e| e * margin).collect());
    if let Some(bodies) = bodies {
        bounds.set_directions(forest, bodies.into_iter().map(|b| b.scaled(margin)).collect());
    }
    bounds
}

impl<'a> Walk<'a> {
    fn new(pm: &'a ProgressiveMesh, forest: &'a Forest, front: Front, finest: &'a Finest) -> Self {
        let Finest { positions, corners, .. } = finest;
        let normal = |f: &[u32; 3]| {
            let p = f.map(|v| positions[v as usize]);
            (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero()
        };
        let full = |(slot, f): (usize, &[u32; 3])| [if f[0] != f[1] { slot as u32 } else { NONE }, NONE];
        Walk {
            pm,
            forest,
            finest,
            positions: positions.clone(),
            normals: corners.iter().map(normal).collect(),
            first: corners.iter().enumerate().map(full).collect(),
            next: vec![NONE; corners.len()],
            parts: vec![0; corners.len()],
            known: vec![0.0; corners.len()],
            pieces: Vec::new(),
            free: NONE,
            near: vec![Near { split: NONE, on: 0, d: 0.0 }; positions.len()],
            scratch: Scratch::default(),
            front,
        }
    }

    /// Undoes a split; returns the largest error of a piece that it moves. `below` is what it has by those below it.
    fn undo(&mut self, i: u32, below: f64, extent: &mut Extent, body: Option<&mut Body>) -> f64 {
        let k = i as usize;
        let vs = self.pm.splits.vertex[k] as usize;
        let mut s = std::mem::take(&mut self.scratch);
        s.star.clear();
        for h in self.front.middle(self.pm, i) {
            self.front.star(h, &mut s.star);
        }
        self.take(&mut s);
        let beside = self.front.beside(self.pm, i);
        self.front.unsplit(self.pm, self.forest, i);
        let own = self.forest.place_before(self.pm, vs as u32, i) - self.finest.origin;
        self.positions[vs] = own;
        s.star.clear();
        if let Some(h) = beside {
            self.front.star(h, &mut s.star);
        }
        if s.star.is_empty() {
            // Nothing is left there; what was is not near to anything.
            let any = !s.whole.is_empty() || !s.ends.is_empty();
            self.scratch = s;
            return if any { f64::INFINITY } else { 0.0 };
        }
        let at = |w: u32| self.positions[self.front.wedge_vertex(w) as usize];
        let triangles: Vec<Reach> =
            s.star.iter().map(|&slot| Reach::of(self.front.corners()[slot as usize].map(at))).collect();
        let corners = |slot: u32| self.front.corners()[slot as usize].map(|w| self.front.wedge_vertex(w));
        s.fan.clear();
        s.fan.extend(s.star.iter().map(|&slot| corners(slot)));
        between(vs as u32, &s.fan, &triangles, &mut s.between);
        // What it must be at least, wherever pieces are cut.
        let mut least = below;
        for &face in &s.whole {
            for v in self.finest.corners[face as usize] {
                let near = &mut self.near[v as usize];
                if near.split != i {
                    let (d, on) = nearest(self.finest.positions[v as usize], &triangles);
                    *near = Near { split: i, on: on as u32, d };
                    least = least.max(d);
                }
            }
        }
        for c in &mut s.corners {
            (c.d, c.on) = nearest(c.p, &triangles);
            least = least.max(c.d);
        }
        s.ways.clear();
        let mut ring = Ring {
            slots: &s.star,
            triangles: &triangles,
            between: &s.between,
            own,
            little: (least * LITTLE).max(TINY * self.finest.diagonal),
            error: 0.0,
            extent,
            ways: body.is_some().then_some(&mut s.ways),
            faces: &mut s.faces,
            pieces: &mut s.pieces,
        };
        ring.faces.clear();
        ring.pieces.clear();
        for &face in &s.whole {
            let corners = self.finest.corners[face as usize];
            let corner = |k: usize| {
                let v = corners[k] as usize;
                let Near { d, on, .. } = self.near[v];
                Corner { at: WHOLE[k], p: self.finest.positions[v], d, on: on as usize }
            };
            let piece = [corner(0), corner(1), corner(2)];
            let (error, on) = best(&piece, &triangles, false);
            let known = self.known[face as usize];
            if ring.fits(error, &piece) {
                self.store((face, known), &piece, (error, on), false, &mut ring);
                continue;
            }
            let mut whole = s.pile.fresh();
            whole.extend_from_slice(&piece);
            s.pile.stack.push(whole);
            self.put((face, known), &mut ring, &mut s.pile);
        }
        let mut from = 0;
        for group in s.ends.chunk_by(|a, b| a.face == b.face) {
            let face = group[0].face;
            let to = group[group.len() - 1].end as usize;
            let all = &s.corners[from..to];
            if group.len() > 1 {
                // All of them as one, if that is no farther.
                s.hull.clear();
                s.hull.extend(all.iter().map(|c| c.at));
                convex_hull(&mut s.hull);
                let of = |at: &[f64; 2]| all.iter().find(|c| c.at == *at).copied();
                let mut piece = s.pile.fresh();
                piece.extend(s.hull.iter().filter_map(of));
                let (error, on) = best(&piece, &triangles, false);
                let fits = piece.len() <= CORNERS && ring.fits(error, &piece);
                if fits {
                    let known = group.iter().map(|e| e.known).fold(f64::INFINITY, f64::min);
                    self.store((face, known), &piece, (error, on), true, &mut ring);
                    s.pile.spare.push(piece);
                    from = to;
                    continue;
                }
                s.pile.spare.push(piece);
            }
            for &End { end, known, .. } in group {
                let mut piece = s.pile.fresh();
                piece.extend_from_slice(&s.corners[from..end as usize]);
                from = end as usize;
                s.pile.stack.push(piece);
                self.put((face, known), &mut ring, &mut s.pile);
            }
        }
        let error = ring.error;
        if let Some(body) = body {
            *body = Body::around(&s.ways, triangles.iter().map(Reach::normal).sum());
        }
        let error = if error > 0.0 { error * (1.0 + 1e-9) + SLACK * self.finest.diagonal } else { 0.0 };
        let known = error.max(below);
        s.faces.iter().for_each(|&f| self.known[f as usize] = known);
        s.pieces.iter().for_each(|&k| self.pieces[k as usize].known = known);
        self.scratch = s;
        error
    }

    /// Takes up all that lies on the faces of a star. Of a face all of whose pieces are there the whole is taken; of another one piece that holds those there.
    fn take(&mut self, s: &mut Scratch) {
        s.whole.clear();
        s.loose.clear();
        s.corners.clear();
        s.ends.clear();
        for &slot in &s.star {
            let [mut whole, mut piece] = std::mem::replace(&mut self.first[slot as usize], [NONE; 2]);
            while whole != NONE {
                s.whole.push(whole);
                whole = self.next[whole as usize];
            }
            while piece != NONE {
                s.loose.push((self.pieces[piece as usize].face, piece));
                piece = self.pieces[piece as usize].next;
            }
        }
        s.loose.sort_unstable();
        for group in s.loose.chunk_by(|a, b| a.0 == b.0) {
            let face = group[0].0;
            let parts = &mut self.parts[face as usize];
            *parts -= group.len() as u32;
            let known = |&(_, k): &(u32, u32)| self.pieces[k as usize].known;
            let known = group.iter().map(known).fold(f64::INFINITY, f64::min);
            if *parts == 0 {
                self.known[face as usize] = known;
                s.whole.push(face);
            } else {
                let shape = |&(_, k): &(u32, u32)| {
                    let piece = &self.pieces[k as usize];
                    piece.at[..piece.len as usize].to_vec()
                };
                s.shapes.clear();
                s.shapes.extend(group.iter().map(shape));
                join(&mut s.shapes);
                let finest = self.finest;
                let corner = |&at: &[f64; 2]| Corner { at, p: finest.at(face, at), d: 0.0, on: 0 };
                for shape in &s.shapes {
                    s.corners.extend(shape.iter().map(corner));
                    s.ends.push(End { face, end: s.corners.len() as u32, known });
                }
            }
            for &(_, k) in group {
                self.pieces[k as usize].next = std::mem::replace(&mut self.free, k);
            }
        }
    }

    /// Puts the piece of a face that is on the stack, in pieces if need be.
    fn put(&mut self, (face, known): (u32, f64), ring: &mut Ring<'_>, pile: &mut Pile) {
        let (mut cuts, mut parts) = (0, 0);
        let most = CUTS + CUTS_A_FACE * ring.triangles.len();
        while let Some(piece) = pile.stack.pop() {
            if piece.len() > CORNERS {
                // Two with fewer corners.
                let (a, b) = piece.split_at(piece.len() / 2);
                for (half, end) in [(a, b.first()), (b, a.first())] {
                    let mut fewer = pile.fresh();
                    fewer.extend(half.iter().chain(end).copied());
                    pile.stack.push(fewer);
                }
                cuts += 1;
                pile.spare.push(piece);
                continue;
            }
            let (error, on) = best(&piece, ring.triangles, false);
            let far = piece.iter().map(|c| c.d).fold(0.0, f64::max);
            let fits = ring.fits(error, &piece);
            if !fits && cuts < most && self.cut(face, &piece, ring, pile) {
                cuts += 1;
            } else if error > FOLDED * far + ring.little()
                && parts < most
                && self.part(face, &piece, ring, pile)
            {
                parts += 1;
            } else {
                let on = if fits { (error, on) } else { best(&piece, ring.triangles, true) };
                self.store((face, known), &piece, on, cuts + parts > 0, ring);
            }
            pile.spare.push(piece);
        }
    }

    /// Puts a piece on a face of the ring.
    fn store(
        &mut self,
        (face, known): (u32, f64),
        piece: &[Corner],
        (error, on): (f64, usize),
        cut: bool,
        ring: &mut Ring<'_>,
    ) {
        let first = &mut self.first[ring.slots[on] as usize];
        let triangle = ring.triangles[on].corners;
        let whole = !cut && self.parts[face as usize] == 0;
        // If another answers for so much already, this one need not.
        let counts = error > if ring.ways.is_some() { 0.0 } else { known };
        if whole {
            self.next[face as usize] = std::mem::replace(&mut first[0], face);
            if counts {
                ring.faces.push(face);
            }
        } else {
            let mut at = [[0.0; 2]; CORNERS];
            at.iter_mut().zip(piece).for_each(|(a, c)| *a = c.at);
            let new = Piece { face, next: first[1], len: piece.len() as u8, known, at };
            if self.free == NONE {
                first[1] = self.pieces.len() as u32;
                self.pieces.push(new);
            } else {
                let old = &mut self.pieces[self.free as usize];
                first[1] = self.free;
                self.free = old.next;
                *old = new;
            }
            if counts {
                ring.pieces.push(first[1]);
            }
            self.parts[face as usize] += 1;
        }
        if counts {
            ring.error = ring.error.max(error);
            for c in piece {
                ring.extent.reach(ring.own.distance(c.p));
                if let Some(ways) = &mut ring.ways {
                    let w = closest_on_triangle(triangle, c.p).0;
                    ways.push(triangle[0] * w[0] + triangle[1] * w[1] + triangle[2] * w[2] - c.p);
                }
            }
            ring.extent.face(self.normals[face as usize]);
        }
    }
}

impl Finest {
    /// A place on a face by the weights of its second and third corner.
    #[inline]
    fn at(&self, face: u32, [u, v]: [f64; 2]) -> DVec3 {
        let [a, b, c] = self.corners[face as usize];
        let (a, b, c) = (self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]);
        // At corners exactly.
        if u == 1.0 {
            b
        } else if v == 1.0 {
            c
        } else {
            a + (b - a) * u + (c - a) * v
        }
    }
}
