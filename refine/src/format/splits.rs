//! What a chunk of vertex splits holds.

use super::codec::{Sources, Wanted};
use super::coder::take_varint;
use super::places;
use crate::aif::Positions;
use crate::progressive::{ProgressiveMesh, SplitCode, Splits};

/// Consecutive splits of a mesh, with all that belongs to them: parts of the arrays of a [`ProgressiveMesh`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SplitBlock {
    /// The first split.
    pub first: u32,
    /// The first face they make.
    pub first_face: u32,
    /// The first wedge they make.
    pub first_wedge: u32,
    /// Wedges they make; 0 without attributes.
    pub wedges: u32,
    /// The splits, with absolute references.
    pub splits: Splits,
    /// As in [`ProgressiveMesh::new_positions`].
    pub new_positions: Positions,
    /// As in [`ProgressiveMesh::moved_positions`].
    pub moved_positions: Positions,
    /// As in [`crate::progressive::WedgeStreams::rows`].
    pub rows: Vec<f32>,
    /// As in [`crate::progressive::WedgeStreams::present`].
    pub present: Vec<u64>,
    /// As in [`crate::progressive::WedgeStreams::explicit`].
    pub explicit: Vec<u32>,
    /// Materials of the faces they make, if the mesh has any.
    pub face_material: Vec<u32>,
    /// Groups of the faces they make, if the mesh has any.
    pub face_group: Vec<u32>,
}

/// Kinds of streams within a chunk of splits, in the order in which they stand there.
pub(super) const STREAMS: usize = 5;
pub(super) const CONNECTIVITY: usize = 0;
pub(super) const ERRORS: usize = 1;
pub(super) const PLACES: usize = 2;

impl SplitBlock {
    /// Faces they make.
    pub fn faces(&self) -> usize {
        self.splits.len() + self.splits.code.iter().filter(|c| c.two_faces()).count()
    }

    /// Wedges they make.
    pub(super) fn new_wedges(&self) -> usize {
        self.wedges as usize
    }

    /// Room for so many splits.
    pub(super) fn reserve(&mut self, splits: usize) {
        self.splits.reserve(splits);
        places::reserve(&mut self.new_positions, splits);
    }

    /// Bytes the arrays take.
    pub fn bytes(&self) -> u64 {
        18 * self.splits.len() as u64
            + places::bytes(&self.new_positions)
            + places::bytes(&self.moved_positions)
            + 4 * (self.rows.len() + self.explicit.len() + self.face_material.len() + self.face_group.len())
                as u64
            + 8 * self.present.len() as u64
    }

    /// Appends the splits to `pm`, whose last split is the one before; false (and nothing done) if it is not.
    pub fn append_to(&self, pm: &mut ProgressiveMesh) -> bool {
        if self.first as usize != pm.splits.len() {
            return false;
        }
        let (to, from) = (&mut pm.splits, &self.splits);
        to.vertex.extend_from_slice(&from.vertex);
        to.left.extend_from_slice(&from.left);
        to.right.extend_from_slice(&from.right);
        to.code.extend_from_slice(&from.code);
        to.error.extend_from_slice(&from.error);
        append(pm.new_positions.plain(), &self.new_positions);
        append(pm.moved_positions.plain(), &self.moved_positions);
        if let Some(w) = &mut pm.wedges {
            w.rows.plain().extend_from_slice(&self.rows);
            w.present.extend(self.present.iter().copied());
            w.explicit.extend_from_slice(&self.explicit);
        }
        pm.face_material.extend_from_slice(&self.face_material);
        pm.face_group.extend_from_slice(&self.face_group);
        true
    }
}

fn append(to: &mut Positions, from: &Positions) {
    match (to, from) {
        (Positions::F32(a), Positions::F32(b)) => a.extend_from_slice(b),
        (Positions::F64(a), Positions::F64(b)) => a.extend_from_slice(b),
        _ => {}
    }
}

/// Where the arrays of a mesh stand before a split.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    pub(super) split: usize,
    pub(super) face: usize,
    pub(super) wedge: usize,
    pub(super) row: usize,
    pub(super) moved: usize,
    pub(super) explicit: usize,
}

/// Errors in the file: the upper 9 bits of an f32 below the sign, rounded up: 1 bit of mantissa. They are estimates; another bit is 0.9 bits a split.
pub(super) const ERROR_SHIFT: u32 = 22;
/// The largest: infinity.
pub(super) const MOST_LEVEL: u16 = 0x1FE;

/// `error` as the file keeps it: never less, at most half more.
pub(super) fn rounded_error(error: f32) -> f32 {
    f32::from_bits(error_level(error) << ERROR_SHIFT)
}

pub(super) fn error_level(error: f32) -> u32 {
    if error > 0.0 { error.min(f32::MAX).to_bits().div_ceil(1 << ERROR_SHIFT) } else { 0 }
}

/// Where a writer is.
pub(super) struct Source<'a> {
    pub(super) pm: &'a ProgressiveMesh,
    /// Numbers in the mesh of the chunk, if it is to be read alone.
    pub(super) numbers: Option<&'a Sources<'a>>,
    pub(super) at: Counts,
}

impl Source<'_> {
    /// The next split.
    pub(super) fn wanted(&self) -> Wanted {
        let (s, i) = (&self.pm.splits, self.at.split);
        let (vertex, left, right, code) = (s.vertex[i], s.left[i], s.right[i], s.code[i]);
        match self.numbers {
            Some(n) => Wanted { vertex: n.vertex(vertex), left: n.cut(left), right: n.cut(right), code },
            None => Wanted { vertex, left, right, code },
        }
    }
}

/// Bytes of each stream of a chunk.
pub(super) type Sizes = [u64; STREAMS];

/// The sizes of the streams of a chunk.
pub(super) fn sizes(mut bytes: &[u8]) -> Option<Sizes> {
    take_varint(&mut bytes)?;
    let mut sizes = Sizes::default();
    for size in &mut sizes {
        *size = take_varint(&mut bytes)?;
        bytes = bytes.get(usize::try_from(*size).ok()?..)?;
    }
    Some(sizes)
}

/// A code's bits without the arrangement of corners, which chunks of splits leave to the order: tips first.
pub(super) fn without_arrangement(code: SplitCode) -> SplitCode {
    // Arrangements 0..3 and 3..6 differ by which of both vertices follows the tip.
    let side = |a: u16| if a >= 3 { 3 } else { 0 };
    let (l, r) = (code.0 & 7, code.0 >> 3 & 7);
    SplitCode(code.0 & !0x3F | side(l) | side(r) << 3)
}
