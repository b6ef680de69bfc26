//! Progressive meshes (Hoppe 1996): a base mesh and the vertex splits that refine it to the input.
//!
//! A [`ProgressiveMesh`] is static: flat arrays, one entry a split, shared by any number of [`Cursor`]s, each of which holds one mesh
//! between `M^0` and `M^n`. What a split needs is stored outright, never as a difference, so that refining and coarsening are exact.
//!
//! Numbering: vertex slots `0..n0` are the base's, split `i` makes slot `n0 + i`. Faces `0..m0` are the base's, and every split appends one
//! (at a border) or two. Corners name *wedges*, which are the slots of a vertex buffer: without attributes a wedge is its vertex.

mod attributes;
mod build;
mod cursor;
mod directions;
mod fans;
mod fetch;
mod input;
pub(crate) mod links;
mod order;
mod places;
mod presence;
mod replay;
mod values;

pub(crate) use attributes::{Explicit, NO_ENTRY};
pub use build::{Built, BuiltAll, EncodeError, build, build_all};
pub use cursor::{Cursor, Damage, Patch};
pub(crate) use fans::{Fans, Opening};
pub use input::{InputOrder, Polygons, same_positions};
pub(crate) use links::{Half, link_faces};
pub use order::NotInOrder;
pub(crate) use order::RowsOf;
pub use places::Places;
pub(crate) use places::bytes as bytes_of_positions;
pub use presence::Presence;
pub use values::Values;

use crate::aif::{Channel, NONE, Positions};
use crate::hierarchy::Bounds;
use glam::DVec3;
use std::sync::Arc;

/// What a split does beside its references, packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SplitCode(pub u16);

/// Which wedges a split makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SplitKind {
    /// One: all corners of the new vertex are alike.
    Plain,
    /// Two: a seam runs through the new vertex, with one wedge on each side.
    Seam,
    /// As listed in [`WedgeStreams::explicit`].
    Explicit,
}

/// What a [`SplitCode`] says, part by part; its methods say what each means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SplitParts {
    /// [`SplitCode::left`].
    pub left: (usize, bool),
    /// [`SplitCode::right`]; `None` for a split that makes one face.
    pub right: Option<(usize, bool)>,
    /// [`SplitCode::left_inner`].
    pub left_inner: bool,
    /// [`SplitCode::left_starts`].
    pub left_starts: bool,
    /// [`SplitCode::right_inner`].
    pub right_inner: bool,
    /// [`SplitCode::left_tip_inner`].
    pub left_tip_inner: bool,
    /// [`SplitCode::right_tip_inner`].
    pub right_tip_inner: bool,
    /// [`SplitCode::kind`].
    pub kind: SplitKind,
    /// [`SplitCode::moves`].
    pub moves: bool,
    /// [`SplitCode::changes_rows`].
    pub changes_rows: bool,
}

impl From<SplitParts> for SplitCode {
    fn from(p: SplitParts) -> SplitCode {
        let arrangement = |(tip, vu_next): (usize, bool)| (tip % 3) as u16 + 3 * vu_next as u16;
        let flags = [
            (p.right.is_some(), SplitCode::TWO_FACES),
            (p.left_inner, SplitCode::L_INNER),
            (p.left_starts, SplitCode::L_STARTS),
            (p.right_inner, SplitCode::R_INNER),
            (p.left_tip_inner, SplitCode::L_TIP_INNER),
            (p.right_tip_inner, SplitCode::R_TIP_INNER),
            (p.moves, SplitCode::MOVES),
            (p.changes_rows, SplitCode::ROWS),
        ];
        let kind = match p.kind {
            SplitKind::Plain => 0,
            SplitKind::Seam => 1,
            SplitKind::Explicit => 2,
        };
        let bits = flags.iter().filter(|f| f.0).fold(0, |sum, f| sum | f.1);
        SplitCode(bits | kind << SplitCode::KIND | arrangement(p.left) | p.right.map_or(0, arrangement) << 3)
    }
}

impl SplitCode {
    pub(crate) const TWO_FACES: u16 = 1 << 6;
    pub(crate) const L_INNER: u16 = 1 << 7;
    pub(crate) const L_STARTS: u16 = 1 << 8;
    pub(crate) const R_INNER: u16 = 1 << 9;
    pub(crate) const L_TIP_INNER: u16 = 1 << 10;
    pub(crate) const R_TIP_INNER: u16 = 1 << 11;
    pub(crate) const KIND: u16 = 12;
    pub(crate) const MOVES: u16 = 1 << 14;
    pub(crate) const ROWS: u16 = 1 << 15;

    #[inline]
    fn flag(self, bit: u16) -> bool {
        self.0 & bit != 0
    }

    /// How the corners of `fl` lie: where its tip `vl` is (0..3), and whether `vu` (true) or `vt` follows it.
    #[inline]
    pub fn left(self) -> (usize, bool) {
        arrangement(self.0)
    }

    /// The same of `fr` and `vr`.
    #[inline]
    pub fn right(self) -> (usize, bool) {
        arrangement(self.0 >> 3)
    }

    /// The split makes two faces; one at a border.
    #[inline]
    pub fn two_faces(self) -> bool {
        self.flag(Self::TWO_FACES)
    }

    /// The face of the left reference goes to the new vertex; else it stays with the old one.
    #[inline]
    pub fn left_inner(self) -> bool {
        self.flag(Self::L_INNER)
    }

    /// The face of the left reference begins the referenced edge at the split vertex.
    #[inline]
    pub fn left_starts(self) -> bool {
        self.flag(Self::L_STARTS)
    }

    /// The face of the right reference goes to the new vertex.
    #[inline]
    pub fn right_inner(self) -> bool {
        self.flag(Self::R_INNER)
    }

    /// The tip of `fl` has the wedge of the neighbour at the new vertex; else of the one at the old.
    #[inline]
    pub fn left_tip_inner(self) -> bool {
        self.flag(Self::L_TIP_INNER)
    }

    /// The same of `fr`.
    #[inline]
    pub fn right_tip_inner(self) -> bool {
        self.flag(Self::R_TIP_INNER)
    }

    /// Which wedges it makes, as a number: 0 for one, 1 for two, more for what is listed.
    #[inline]
    pub(crate) fn kind_code(self) -> u32 {
        (self.0 >> Self::KIND & 3).into()
    }

    /// Which wedges it makes.
    #[inline]
    pub fn kind(self) -> SplitKind {
        match (self.0 >> Self::KIND) & 3 {
            0 => SplitKind::Plain,
            1 => SplitKind::Seam,
            _ => SplitKind::Explicit,
        }
    }

    /// The split vertex moves.
    #[inline]
    pub fn moves(self) -> bool {
        self.flag(Self::MOVES)
    }

    /// The split vertex's attributes change.
    #[inline]
    pub fn changes_rows(self) -> bool {
        self.flag(Self::ROWS)
    }
}

/// The wedges of the old vertex on the left and on the right of a seam that is to run through the new one: those at both ends of the run of
/// faces that go there, unless these are one, as when the seam turns off at `vl` or `vr`; then the face beyond the cut tells the other.
#[inline]
pub(crate) fn seam_wedges(first: u32, last: u32, outer_l: Option<u32>, outer_r: Option<u32>) -> (u32, u32) {
    match (outer_l, outer_r) {
        _ if first != last => (first, last),
        (Some(o), _) if o != first => (o, last),
        (_, Some(o)) if o != first => (first, o),
        _ => (first, last),
    }
}

#[inline]
fn arrangement(bits: u16) -> (usize, bool) {
    const TABLE: [(usize, bool); 8] =
        [(0, false), (1, false), (2, false), (0, true), (1, true), (2, true), (0, false), (0, false)];
    TABLE[(bits & 7) as usize]
}

/// The vertex splits, coarsest first: parallel arrays.
///
/// `left[i]` and `right[i]` are the *cuts*: the edges of the split vertex that open, each as `face * 4 + edge` of the later-made of the two
/// faces on it (so that `left`'s and `right`'s faces existing is what the split depends on). Edge `k` of a face runs from its
/// corner `k` to corner `k + 1`. `right[i]` is [`NONE`] at a border.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splits {
    /// The vertex that is split.
    pub vertex: Vec<u32>,
    /// The left cut.
    pub left: Vec<u32>,
    /// The right cut, or [`NONE`].
    pub right: Vec<u32>,
    /// The rest.
    pub code: Vec<SplitCode>,
    /// The method's estimate of the error of the mesh before the split, here, in model units. Never larger than that of a split this one
    /// depends on. Empty in hierarchies, which have bounds instead: there all count as 0.
    pub error: Vec<f32>,
}

impl Splits {
    /// How many.
    pub fn len(&self) -> usize {
        self.vertex.len()
    }

    /// True if there is none.
    pub fn is_empty(&self) -> bool {
        self.vertex.is_empty()
    }

    /// Room for so many more.
    pub(crate) fn reserve(&mut self, splits: usize) {
        self.vertex.reserve_exact(splits);
        self.left.reserve_exact(splits);
        self.right.reserve_exact(splits);
        self.code.reserve_exact(splits);
        self.error.reserve_exact(splits);
    }
}

/// Attributes of the base and of the splits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WedgeStreams {
    /// What the values are.
    pub channels: Vec<Channel>,
    /// Numbers in a row: the widths of the channels together.
    pub stride: usize,
    /// The vertex of every wedge of the base.
    pub base_vertex: Vec<u32>,
    /// Rows: the base's wedges, then split by split those of its new wedges and those that its changed wedges get.
    pub rows: Values,
    /// For every row the channels it has, bit k for channel k; a wedge that has none stands for "no attributes".
    pub present: Presence,
    /// For every explicit split: the number of pairs, of changed wedges; pairs (wedge before, wedge after) of the faces that go to the
    /// new vertex, with new wedges numbered from the present count (a new wedge belongs to the new vertex, unless the new faces have it at
    /// the old vertex or at the tip: it is that vertex's then, and its first number any wedge of before); the changed wedges; the wedges of `fl` at `vt`, `vu`, `vl` (the last
    /// [`NONE`] where the neighbour that the code names has it); the same of `fr` if there is one.
    pub explicit: Vec<u32>,
}

/// A base mesh, and the vertex splits that make the input of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProgressiveMesh {
    /// Corners of the base's faces, as wedges.
    pub base_faces: Vec<[u32; 3]>,
    /// Where the vertices of the base are.
    pub base_positions: Positions,
    /// The splits.
    pub splits: Splits,
    /// Where the new vertex of every split is; same precision as the base's.
    pub new_positions: Places,
    /// Where the split vertex goes, for every split that moves it ([`SplitCode::moves`]), in order.
    pub moved_positions: Places,
    /// Attributes, if the mesh has any.
    pub wedges: Option<WedgeStreams>,
    /// Material of every face; empty for none, [`NONE`] for a face without.
    pub face_material: Vec<u32>,
    /// Group of every face; empty for none, [`NONE`] for a face without.
    pub face_group: Vec<u32>,
    /// Edges without a face, by vertices of the base.
    pub wires: Vec<[u32; 2]>,
    /// How the input numbered its elements; without it full detail comes in the order of the splits.
    pub order: Option<InputOrder>,
    /// Split counts at which levels stand, coarse to fine, full detail included (NSA: its passes).
    pub levels: Vec<u32>,
    /// Bounds of the splits for view-dependent refinement, if they are known; without, [`crate::Hierarchy::new`] measures them.
    pub bounds: Option<Arc<Bounds>>,
}

impl ProgressiveMesh {
    /// Vertices of the base.
    pub fn base_vertices(&self) -> usize {
        self.base_positions.len()
    }

    /// Vertices at full detail.
    pub fn vertices(&self) -> usize {
        self.base_vertices() + self.splits.len()
    }

    /// Least and greatest coordinates at full detail; `None` without vertices. O(n).
    pub fn full_bounds(&self) -> Option<(DVec3, DVec3)> {
        // Where each vertex goes last.
        let mut last: Vec<DVec3> = (0..self.base_vertices()).map(|v| self.base_positions.get(v)).collect();
        last.extend((0..self.splits.len()).map(|i| self.new_positions.get(i)));
        let moving = self.splits.code.iter().zip(&self.splits.vertex).filter(|(code, _)| code.moves());
        for ((_, &v), k) in moving.zip(0..) {
            last[v as usize] = self.moved_positions.get(k);
        }
        last.into_iter().map(|p| (p, p)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Faces at full detail. O(n).
    pub fn faces(&self) -> usize {
        let two = self.splits.code.iter().filter(|c| c.two_faces()).count();
        self.base_faces.len() + self.splits.len() + two
    }

    /// Wedges at full detail; vertices without attributes. O(n).
    pub fn wedge_slots(&self) -> usize {
        let Some(w) = &self.wedges else { return self.vertices() };
        w.base_vertex.len() + self.rows_of_splits().iter().map(|r| r.new as usize).sum::<usize>()
    }

    /// A cursor at the base.
    ///
    /// Errors: arrays that do not fit together.
    pub fn cursor(&self) -> Result<Cursor<&ProgressiveMesh>, Damage> {
        Cursor::new(self)
    }

    /// Lets places and attributes take as little as they can without changing a bit of what they say ([`Places::pack`], [`Values::pack`]), and gives back what arrays hold in reserve. [`build`] has
    /// done so, and so do hierarchies. O(n).
    pub fn pack(&mut self) {
        self.new_positions.pack();
        self.moved_positions.pack();
        let s = &mut self.splits;
        [&mut s.vertex, &mut s.left, &mut s.right].into_iter().for_each(Vec::shrink_to_fit);
        s.code.shrink_to_fit();
        s.error.shrink_to_fit();
        if let Some(w) = &mut self.wedges {
            w.rows.pack(&w.channels);
            w.base_vertex.shrink_to_fit();
            w.explicit.shrink_to_fit();
        }
        [&mut self.face_material, &mut self.face_group, &mut self.levels]
            .into_iter()
            .for_each(Vec::shrink_to_fit);
    }

    /// Bytes of the static structure: splits, places, attributes, materials, all that cursors need; without the input's order and bounds, which have counts of their own
    /// ([`InputOrder::bytes`], [`Bounds::bytes`]). Of a mesh that was recorded with its places on a grid ([`crate::simplify::Options::grid`]) about 40 B a vertex, 47 to 51 with a normal; with
    /// endpoint placement 30, and 39 to 48 (normals that are not of unit length take 12).
    pub fn bytes(&self) -> usize {
        let s = &self.splits;
        12 * self.base_faces.capacity()
            + bytes_of_positions(&self.base_positions)
            + self.new_positions.bytes()
            + self.moved_positions.bytes()
            + 4 * (s.vertex.capacity() + s.left.capacity() + s.right.capacity() + s.error.capacity())
            + 2 * s.code.capacity()
            + self.attribute_bytes()
            + 4 * (self.face_material.capacity() + self.face_group.capacity() + self.levels.capacity())
            + 8 * self.wires.capacity()
    }

    /// Bytes of the attributes, which are part of [`ProgressiveMesh::bytes`].
    pub fn attribute_bytes(&self) -> usize {
        let of = |w: &WedgeStreams| {
            4 * (w.base_vertex.capacity() + w.explicit.capacity()) + w.rows.bytes() + w.present.bytes()
        };
        self.wedges.as_ref().map_or(0, of)
    }

    /// The right cut of split `i`, if it has one.
    #[inline]
    pub fn right(&self, i: usize) -> Option<u32> {
        Some(self.splits.right[i]).filter(|&r| r != NONE)
    }
}
