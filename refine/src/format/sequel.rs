//! Chunks of splits that are read after those before: references as ranks in the rings of the mesh as it is then, positions expected amid their
//! neighbours.
//!
//! Both sides do the splits of the chunk on a [`Walk`]. FORMAT.md, "SPLS", has the rules.

mod cuts;
mod expect;
mod sweep;

use self::sweep::{NEW, TOUCHED};
use super::base::MeshHead;
use super::coder::{Bit, Coder, Decoder, Encoder, Nibble, Number, put_varint, take_varint};
use super::extras::Extras;
use super::places;
use super::residual::Residuals;
use super::splits::{
    CONNECTIVITY, Counts, ERROR_SHIFT, ERRORS, PLACES, STREAMS, Sizes, Source, SplitBlock, error_level,
};
use super::walk::{Cut, NO_LEVEL, Ring, Walk, cut};
use crate::aif::NONE;
use crate::progressive::ProgressiveMesh;

/// Valences told apart.
const VALENCES: usize = 10;

#[inline]
fn valence_class(n: usize) -> usize {
    n.clamp(2, VALENCES + 1) - 2
}

#[derive(Clone, Debug, Default)]
struct Models {
    roots: Number,
    root: Number,
    split: [[[Bit; 6]; VALENCES]; 5],
    done: [[Bit; 6]; 3],
    rest_same: Bit,
    rest: Number,
    moves: Bit,
    named: [Number; 2],
    inner: [Bit; 3],
    rank: [[Nibble; VALENCES]; 3],
    count: [Nibble; VALENCES],
    far: Number,
    error: [Nibble; 12],
    error_far: Number,
}

/// What goes on from chunk to chunk: the mesh, and what was learned about symbols.
#[derive(Clone, Debug)]
pub(super) struct Sequel {
    walk: Walk,
    residuals: Residuals<3>,
    m: Box<Models>,
}

impl Sequel {
    /// At the base of `pm`. `None` if that contradicts itself.
    pub(super) fn new(head: &MeshHead, pm: &ProgressiveMesh) -> Option<Self> {
        Some(Sequel {
            walk: Walk::new(pm)?,
            residuals: Residuals::new(head.double, &head.lattices),
            m: Box::default(),
        })
    }
}

/// Codes one chunk.
struct Codec<'a> {
    head: &'a MeshHead,
    walk: &'a mut Walk,
    residuals: &'a mut Residuals<3>,
    extras: Extras,
    m: &'a mut Models,
    ring: Ring,
    /// The vertices to be visited in this sweep, the next on top; those of the next sweep.
    pass: Vec<u32>,
    list: Vec<u32>,
    /// Something was split in this sweep.
    moved: bool,
    rest: u32,
    /// The least and the largest level.
    levels: [u16; 2],
    /// How many splits of each vertex are to come, roots first (writer only).
    to_come: Vec<u16>,
    roots: Vec<u32>,
    first_vertex: usize,
}

impl<'a> Codec<'a> {
    fn new(head: &'a MeshHead, state: &'a mut Sequel, first: Counts) -> Self {
        let Sequel { walk, residuals, m } = state;
        Codec {
            head,
            first_vertex: walk.vertices.len(),
            walk,
            residuals,
            extras: Extras::new(head, first.wedge),
            m,
            ring: Ring::default(),
            pass: Vec::new(),
            list: Vec::new(),
            moved: true,
            rest: 0,
            levels: [0; 2],
            to_come: Vec::new(),
            roots: Vec::new(),
        }
    }

    /// Codes the next split.
    fn split<C: Coder>(
        &mut self,
        c: &mut [C; STREAMS],
        source: &mut Option<Source<'_>>,
        out: &mut SplitBlock,
    ) -> Option<()> {
        let split = (self.walk.vertices.len() - self.head.base_vertices as usize) as u32;
        let wanted = source.as_ref().map_or(NONE, |s| s.pm.splits.vertex[s.at.split]);
        let (v, state) = self.sweep(&mut c[CONNECTIVITY], wanted)?;
        let level = source.as_ref().map_or(0, |s| error_level(s.pm.splits.error[s.at.split]) as u16);
        let level = self.level(&mut c[ERRORS], self.walk.vertices[v as usize].level, level)?;
        let two = !self.head.is_single(split);
        let (code, cuts) = self.cuts(&mut c[CONNECTIVITY], (v, state), two, source)?;
        // Places.
        let guess = self.guess(v, &cuts, code.moves());
        let place = source.as_ref().map_or([0.0; 3], |s| places::point(&s.pm.new_positions, s.at.split));
        let place = self.residuals.code(&mut c[PLACES], code.moves() as usize, &guess, place);
        let mut moved = None;
        if code.moves() {
            let to = source.as_ref().map_or([0.0; 3], |s| places::point(&s.pm.moved_positions, s.at.moved));
            let guess = self.guess_moved(v, &cuts, &guess);
            moved = Some(self.residuals.code(&mut c[PLACES], 2, &guess, to));
        }
        if C::READS {
            let name = |c: Cut| cut(c.name().0);
            out.splits.vertex.push(v);
            out.splits.left.push(name(cuts.left));
            out.splits.right.push(if two { name(cuts.right) } else { NONE });
            out.splits.code.push(code);
            out.splits.error.push(f32::from_bits((level as u32) << ERROR_SHIFT));
            places::push(&mut out.new_positions, place);
            moved.iter().for_each(|&to| places::push(&mut out.moved_positions, to));
        }
        let u = self.walk.vertices.len() as u32;
        let tips = self.walk.split(v, (cuts.left, cuts.right), cuts.count, code, (place, level));
        for tip in tips.into_iter().take(1 + two as usize) {
            self.walk.vertices[tip as usize].visit |= TOUCHED;
        }
        if let Some(to) = moved {
            self.walk.places[v as usize] = to;
        }
        self.walk.vertices[u as usize].visit = NEW;
        self.pass.extend([u, v]);
        let [.., attributes, faces] = c;
        self.extras.code((attributes, faces), (v, code), source, out)
    }

    /// A level of error: mostly a little below that of the split before at the vertex.
    fn level<C: Coder>(&mut self, c: &mut C, before: u16, level: u16) -> Option<u16> {
        let top = before.min(self.levels[1]);
        let model = &mut self.m.error[(top.saturating_sub(self.levels[0]) as usize).min(11)];
        let down = top.wrapping_sub(level).min(15) as u32;
        let down = c.nibble(model, down) as u16;
        let level = if down < 15 {
            top.checked_sub(down)?
        } else {
            c.number(&mut self.m.error_far, level as u64).try_into().ok()?
        };
        Some(level).filter(|&l| l <= 0x3FC)
    }
}

/// The chunk of `count` splits from `first` on, which `walk` stands before; with the bytes of each of its streams.
pub(super) fn write(
    head: &MeshHead,
    pm: &ProgressiveMesh,
    state: &mut Sequel,
    first: Counts,
    count: usize,
) -> Option<(Vec<u8>, Sizes)> {
    let mut streams: [Encoder; STREAMS] = Default::default();
    let range = first.split..first.split + count;
    let levels = pm.splits.error[range.clone()].iter().map(|&e| error_level(e) as u16);
    let levels = levels.fold([NO_LEVEL, 0], |[a, b], l| [a.min(l), b.max(l)]);
    let mut codec = Codec::new(head, state, first);
    codec.begin(&mut streams, &pm.splits.vertex[range], levels, count)?;
    let mut source = Some(Source { pm, fans: None, at: first });
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

/// Reads a chunk that `walk` stands before. `None`: damage, and the walk is void.
pub(super) fn read(
    head: &MeshHead,
    state: &mut Sequel,
    (first, first_face): (u32, u32),
    count: usize,
    raw: u64,
    mut bytes: &[u8],
) -> Option<SplitBlock> {
    let end = (first as u64).checked_add(count as u64)?;
    let here = head.base_vertices as usize + first as usize == state.walk.vertices.len()
        && first_face as usize == state.walk.face_count();
    if end > head.splits as u64 || !here {
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
    let mut codec = Codec::new(head, state, at);
    codec.begin(&mut streams, &[], [0; 2], count)?;
    for _ in 0..count {
        codec.split(&mut streams, &mut None, &mut out)?;
        if streams.iter().any(Coder::spent) || out.bytes() > raw {
            return None;
        }
    }
    Some(out).filter(|o| o.bytes() == raw)
}
