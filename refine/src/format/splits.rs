//! Chunks of vertex splits: each is read alone, given the head of its mesh.

use super::base::MeshHead;
use super::coder::{Bit, Coder, Decoder, Encoder, Number, put_varint, take_varint};
use super::connect::{Connect, Step};
use super::extras::Extras;
use super::places::{self, Places};
use crate::aif::Positions;
use crate::progressive::{Damage, ProgressiveMesh, SplitCode, Splits};

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
        append(&mut pm.new_positions, &self.new_positions);
        append(&mut pm.moved_positions, &self.moved_positions);
        if let Some(w) = &mut pm.wedges {
            w.rows.extend_from_slice(&self.rows);
            w.present.extend_from_slice(&self.present);
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

/// Errors in the file: the upper 10 bits of an f32 below the sign, rounded up: 2 bits of mantissa.
pub(super) const ERROR_SHIFT: u32 = 21;

/// `error` as the file keeps it: never less, at most a quarter more.
pub(super) fn rounded_error(error: f32) -> f32 {
    f32::from_bits(error_level(error) << ERROR_SHIFT)
}

/// Levels that have a symbol of their own; one more stands for all others.
const LEVELS: u32 = 31;

pub(super) fn error_level(error: f32) -> u32 {
    if error > 0.0 { error.min(f32::MAX).to_bits().div_ceil(1 << ERROR_SHIFT) } else { 0 }
}

/// One description of the chunk for both directions: `source` when writing, `out` when reading.
struct Codec<'a> {
    connect: Connect<'a>,
    places: Places<'a>,
    extras: Extras,
    error: Number,
    error_near: [Bit; 32],
    error_start: Option<u32>,
    error_before: u32,
}

pub(super) struct Source<'a> {
    pub(super) pm: &'a ProgressiveMesh,
    pub(super) fans: Option<&'a Fans>,
    pub(super) at: Counts,
}

/// The edges around the vertex of every split, from the left cut on.
pub(super) struct Fans {
    ends: Vec<u32>,
    edges: Vec<u32>,
}

impl Fans {
    pub(super) fn new(pm: &ProgressiveMesh) -> Result<Self, Damage> {
        let mut fans = Fans { ends: Vec::with_capacity(pm.splits.len()), edges: Vec::new() };
        let mut c = pm.cursor()?;
        for _ in 0..pm.splits.len() {
            c.fan(&mut fans.edges)?;
            fans.ends.push(fans.edges.len() as u32);
            c.refine()?;
        }
        Ok(fans)
    }

    fn of(&self, split: usize) -> &[u32] {
        let start = if split == 0 { 0 } else { self.ends[split - 1] };
        &self.edges[start as usize..self.ends[split] as usize]
    }
}

impl<'a> Codec<'a> {
    fn new(head: &'a MeshHead, first: Counts) -> Self {
        Codec {
            connect: Connect::new(head, first),
            places: Places::new(head.double, &head.lattices),
            extras: Extras::new(head, first.wedge),
            error: Number::default(),
            error_near: Default::default(),
            error_start: None,
            error_before: 0,
        }
    }

    /// Codes the next split; `None` for references that cannot be.
    fn split<C: Coder>(
        &mut self,
        c: &mut [C; STREAMS],
        source: &mut Option<Source<'_>>,
        out: &mut SplitBlock,
    ) -> Option<()> {
        let step = source.as_ref().map_or(Step::default(), |s| {
            let (i, splits) = (s.at.split, &s.pm.splits);
            Step {
                vertex: splits.vertex[i],
                left: splits.left[i],
                right: splits.right[i],
                code: splits.code[i],
            }
        });
        let fan = source.as_ref().and_then(|s| s.fans.map(|f| f.of(s.at.split))).unwrap_or_default();
        let step = self.connect.code(&mut c[CONNECTIVITY], step, fan)?;
        // Error.
        let level = source.as_ref().map_or(0, |s| error_level(s.pm.splits.error[s.at.split]));
        self.error_before = self.level(&mut c[ERRORS], level).filter(|&l| l <= 0x3FC)?;
        // Places.
        let expected = self.connect.expected();
        let at = source.as_ref().map_or([0.0; 3], |s| places::point(&s.pm.new_positions, s.at.split));
        let at = self.places.code(&mut c[PLACES], 1, expected, at);
        let mut moved = None;
        if step.code.moves() {
            let to = source.as_ref().map_or([0.0; 3], |s| places::point(&s.pm.moved_positions, s.at.moved));
            moved = Some(self.places.code(&mut c[PLACES], 2, at, to));
        }
        self.connect.placed(at, moved);
        if C::READS {
            out.splits.vertex.push(step.vertex);
            out.splits.left.push(step.left);
            out.splits.right.push(step.right);
            out.splits.code.push(step.code);
            out.splits.error.push(f32::from_bits(self.error_before << ERROR_SHIFT));
            places::push(&mut out.new_positions, at);
            moved.iter().for_each(|&to| places::push(&mut out.moved_positions, to));
        }
        let [.., attributes, faces] = c;
        self.extras.code((attributes, faces), (step.vertex, step.code), source, out)
    }

    /// A level of error: one of some around the first of the chunk, or any.
    fn level<C: Coder>(&mut self, c: &mut C, level: u32) -> Option<u32> {
        let start = *self.error_start.get_or_insert_with(|| c.plain(16, level).saturating_sub(LEVELS - 4));
        let inside = (level.wrapping_sub(start)).min(LEVELS);
        let inside = c.symbol(&mut self.error_near, 5, inside);
        if inside < LEVELS {
            return Some(start + inside);
        }
        u32::try_from(c.number(&mut self.error, level as u64)).ok()
    }
}

/// Bytes of each stream of a chunk.
pub(super) type Sizes = [u64; STREAMS];

/// The chunk of `count` splits from `first` on; with the bytes of each of its streams. `None` if the arrays contradict each other.
pub(super) fn write(
    head: &MeshHead,
    pm: &ProgressiveMesh,
    fans: &Fans,
    first: Counts,
    count: usize,
) -> Option<(Vec<u8>, Sizes)> {
    let mut streams: [Encoder; STREAMS] = Default::default();
    let mut codec = Codec::new(head, first);
    let vertices = &pm.splits.vertex[first.split..first.split + count];
    codec.connect.begin(&mut streams[CONNECTIVITY], vertices)?;
    let mut source = Some(Source { pm, fans: Some(fans), at: first });
    let mut nothing = SplitBlock::default();
    for _ in 0..count {
        codec.split(&mut streams, &mut source, &mut nothing)?;
    }
    let mut out = Vec::new();
    put_varint(&mut out, first.wedge as u64);
    let mut sizes = Sizes::default();
    for (stream, size) in streams.into_iter().zip(&mut sizes) {
        let mut bytes = Vec::new();
        stream.finish(&mut bytes);
        put_varint(&mut out, bytes.len() as u64);
        out.extend_from_slice(&bytes);
        *size = bytes.len() as u64;
    }
    Some((out, sizes))
}

/// Reads a chunk alone. `None`: damage.
pub(super) fn read(
    head: &MeshHead,
    (first, first_face): (u32, u32),
    count: usize,
    raw: u64,
    mut bytes: &[u8],
) -> Option<SplitBlock> {
    let end = (first as u64).checked_add(count as u64)?;
    if end > head.splits as u64 || first_face != head.first_face(first) {
        return None;
    }
    let first_wedge = u32::try_from(take_varint(&mut bytes)?).ok()?;
    let mut next = || {
        let length = usize::try_from(take_varint(&mut bytes)?).ok()?;
        let (stream, rest) = bytes.split_at_checked(length)?;
        bytes = rest;
        Decoder::new(stream)
    };
    let mut streams = [next()?, next()?, next()?, next()?, next()?];
    let at = Counts {
        split: first as usize,
        face: first_face as usize,
        wedge: first_wedge as usize,
        ..Default::default()
    };
    let mut out = SplitBlock {
        first,
        first_face,
        first_wedge,
        new_positions: places::empty(head.double),
        moved_positions: places::empty(head.double),
        ..Default::default()
    };
    let mut codec = Codec::new(head, at);
    codec.connect.begin(&mut streams[CONNECTIVITY], &[])?;
    for _ in 0..count {
        codec.split(&mut streams, &mut None, &mut out)?;
        if streams.iter().any(Coder::spent) || out.bytes() > raw {
            return None;
        }
    }
    Some(out).filter(|o| o.bytes() == raw)
}

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
