//! Chunks of splits: references as ranks in the rings of a mesh, positions expected amid their neighbours.
//!
//! Both sides do the splits of the chunk on a [`Walk`]: on the mesh that all chunks before make, or, so that the chunk can be read alone, on the least mesh in which
//! its splits can be done ([`context`]). FORMAT.md, "SPLS" and "SPLT", has the rules.

mod context;
mod cuts;
mod expect;
mod sweep;

use self::context::Known;
pub(super) use self::context::{Sources, Start};
use self::cuts::Cuts;
pub(super) use self::cuts::Wanted;
use self::sweep::NEW;
use super::base::{MeshHead, Singles};
use super::coder::{Bit, Choice, Coder, Decoder, Encoder, Nibble, Number, put_varint, take_varint};
use super::extras::Extras;
use super::places;
use super::residual::Residuals;
use super::splits::{
    CONNECTIVITY, Counts, ERROR_SHIFT, ERRORS, MOST_LEVEL, PLACES, STREAMS, Source, SplitBlock, error_level,
};
use super::walk::{Cut, NO_LEVEL, Ring, Walk, cut};
use crate::aif::NONE;
use crate::progressive::{ProgressiveMesh, SplitCode};

/// Levels above the least of the chunk that are told apart.
const TOPS: usize = 12;

/// After so many splits a reader looks whether there was enough to read.
const CHECKED: usize = 16;

/// Valences told apart.
const VALENCES: usize = 10;

#[inline]
fn valence_class(n: usize) -> usize {
    n.clamp(2, VALENCES + 1) - 2
}

#[derive(Clone, Debug, Default)]
struct Models {
    roots: Number,
    first: Number,
    gap: [Number; 2],
    split: sweep::Split,
    done: [[Bit; 8]; 3],
    code_same: [Bit; 4],
    turned: [Bit; 2],
    rest_same: Bit,
    rest: Number,
    moves: Bit,
    named: [Number; 2],
    inner: [Bit; 3],
    /// The edge of the left cut, by what the sweep did with the vertex; the faces between both.
    left: [Choice; 3],
    right: Choice,
    error: [Nibble; TOPS],
    error_far: Number,
    context: context::Models,
}

/// What goes on from chunk to chunk where they follow each other: the mesh, and what was learned about symbols.
#[derive(Clone, Debug)]
pub(super) struct Sequel {
    walk: Walk,
    residuals: Residuals<3>,
    m: Box<Models>,
}

impl Sequel {
    /// Before the first split.
    pub(super) fn new(head: &MeshHead, walk: Walk) -> Self {
        Sequel { walk, residuals: Residuals::new(head.double, &head.lattices), m: Box::default() }
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
    /// The vertices to be visited in this sweep, and the place of the next; those of the next sweep.
    pass: Vec<u32>,
    at: usize,
    /// Of no meaning: what was looked at ahead.
    ahead: u32,
    list: Vec<u32>,
    /// Something was split in this sweep.
    moved: bool,
    /// How often each vertex is still to be split (writer).
    to_come: Vec<u32>,
    /// Splits that only prepare for those of the chunk.
    preparing: bool,
    /// What is told of the code of the last split of each kind, and whether it moved its vertex; kinds are by two faces and an open ring.
    last_code: [(u32, bool); 4],
    /// What the vertices did that were visited since the last split of a context.
    marks: u8,
    /// The least and the largest level, and classes above the least.
    levels: [u16; 2],
    classes: usize,
    /// The next split.
    split: u32,
    singles: Singles<'a>,
    /// What is known of older splits, in a chunk that is read alone.
    known: Option<Known>,
}

impl<'a> Codec<'a> {
    fn new(head: &'a MeshHead, state: &'a mut Sequel, first: Counts, alone: bool) -> Self {
        let Sequel { walk, residuals, m } = state;
        Codec {
            head,
            known: alone.then(|| Known::new(head, first)),
            walk,
            residuals,
            extras: Extras::new(head, first.wedge),
            m,
            ring: Ring::default(),
            pass: Vec::new(),
            at: 0,
            ahead: 0,
            list: Vec::new(),
            moved: true,
            to_come: Vec::new(),
            preparing: false,
            last_code: [(0, false); 4],
            marks: 0,
            levels: [0; 2],
            classes: 0,
            split: first.split as u32,
            singles: Singles::new(head),
        }
    }

    /// Codes the next split.
    fn split<C: Coder>(
        &mut self,
        c: &mut [C; STREAMS],
        source: &mut Option<Source<'_>>,
        out: &mut SplitBlock,
    ) -> Option<()> {
        let wanted = source.as_ref().map(|s| s.wanted());
        let (v, state) = self.sweep(&mut c[CONNECTIVITY], wanted.map_or(NONE, |w| w.vertex))?;
        let two = !self.singles.is(self.split);
        let (code, cuts) = self.cuts(&mut c[CONNECTIVITY], (v, state), two, wanted)?;
        // Places.
        let guess = self.guess(v, &cuts, code.moves());
        let level = source.as_ref().map_or(0, |s| error_level(s.pm.splits.error[s.at.split]) as u16);
        let level = self.level(&mut c[ERRORS], v, level)?;
        let place = source.as_ref().map_or([0.0; 3], |s| s.pm.new_positions.get(s.at.split).to_array());
        let place = self.residuals.code(&mut c[PLACES], code.moves() as usize, (&guess, level), place);
        let mut moved = None;
        if code.moves() {
            let to = source.as_ref().map_or([0.0; 3], |s| s.pm.moved_positions.get(s.at.moved).to_array());
            let guess = self.guess_moved(v, &cuts, &guess);
            moved = Some(self.residuals.code(&mut c[PLACES], 2, (&guess, level), to));
        }
        if C::READS {
            let name = |c: Cut| {
                let c = cut(c.name().0);
                self.known.as_ref().map_or(c, |k| k.cut(c))
            };
            out.splits.vertex.push(self.known.as_ref().map_or(v, |k| k.vertex(v)));
            out.splits.left.push(name(cuts.left));
            out.splits.right.push(if two { name(cuts.right) } else { NONE });
            out.splits.code.push(code);
            out.splits.error.push(f32::from_bits((level as u32) << ERROR_SHIFT));
            places::push(&mut out.new_positions, place);
            moved.iter().for_each(|&to| places::push(&mut out.moved_positions, to));
        }
        self.apply(v, &cuts, code, (place, level));
        if let Some(to) = moved {
            self.walk.move_to(v, to);
        }
        self.split += 1;
        let [.., attributes, faces] = c;
        self.extras.code((attributes, faces), (v, code), source, out)
    }

    /// Does a split.
    #[inline]
    fn apply(&mut self, v: u32, cuts: &Cuts, code: SplitCode, made: ([f64; 3], u16)) {
        let u = self.walk.vertices.len() as u32;
        let made = (made.0, made.1, NEW);
        self.walk.split(v, &self.ring, (cuts.first, cuts.count), [cuts.left, cuts.right], code, made);
        self.list.extend_from_slice(&[v, u]);
    }

    /// A level of error: mostly a little below that of the split before at the vertex.
    #[inline]
    fn level<C: Coder>(&mut self, c: &mut C, v: u32, level: u16) -> Option<u16> {
        let [least, most] = self.levels;
        let top = self.walk.vertices[v as usize].level.min(most);
        let model = &mut self.m.error[(top.saturating_sub(least) as usize).min(TOPS - 1)];
        let down = top.wrapping_sub(level).min(15) as u32;
        let down = c.nibble(model, down) as u16;
        let level = if down < 15 {
            top.checked_sub(down)?
        } else {
            c.number(&mut self.m.error_far, level as u64).try_into().ok()?
        };
        Some(level).filter(|&l| l <= MOST_LEVEL)
    }
}

/// The streams of a chunk that is written, and bytes of one: memory that serves for the next chunk, too.
#[derive(Clone, Debug, Default)]
pub(super) struct Streams([Encoder; STREAMS], Vec<u8>);

/// Writes the chunk of `count` splits from `first` on, before which `state` stands; if it is to be read alone, at the base, and given what it needs.
pub(super) fn write(
    head: &MeshHead,
    pm: &ProgressiveMesh,
    state: &mut Sequel,
    (first, count): (Counts, usize),
    mut sources: Option<&mut Sources<'_>>,
    Streams(streams, bytes): &mut Streams,
) -> Option<Vec<u8>> {
    let range = first.split..first.split + count;
    let levels = pm.splits.error[range.clone()].iter().map(|&e| error_level(e) as u16);
    let levels = levels.fold([NO_LEVEL, 0], |[a, b], l| [a.min(l), b.max(l)]);
    let mut codec = Codec::new(head, state, first, sources.is_some());
    if let Some(sources) = sources.as_deref_mut() {
        codec.context(streams, pm, Some(sources), u64::MAX)?;
    }
    let numbers = sources.as_deref();
    let vertex = |v: u32| numbers.map_or(v, |n| n.vertex(v));
    let of: Vec<u32> = pm.splits.vertex[range].iter().map(|&v| vertex(v)).collect();
    codec.prepares(false);
    codec.levels(&mut streams[ERRORS], levels);
    codec.begin(&mut streams[CONNECTIVITY], &of, count)?;
    let mut source = Some(Source { pm, numbers, at: first });
    let mut nothing = SplitBlock::default();
    for _ in 0..count {
        codec.split(streams, &mut source, &mut nothing)?;
    }
    let mut out = Vec::new();
    put_varint(&mut out, first.wedge as u64);
    for stream in streams {
        bytes.clear();
        stream.finish(bytes);
        put_varint(&mut out, bytes.len() as u64);
        out.extend_from_slice(bytes);
    }
    // A byte for every split of the context, at least.
    let least = codec.known.map_or(0, |k| k.splits());
    out.resize(out.len().max(least), 0);
    Some(out)
}

/// What reading a chunk alone may take on the way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    /// Splits of its context.
    context: u64,
    /// Edges of a ring.
    ring: usize,
}

impl Room {
    /// Bytes of the mesh before the first split, which is kept ready for all chunks.
    pub(crate) fn base_bytes(head: &MeshHead) -> u64 {
        let all = Walk::bytes(head.base_vertices.into(), head.base_faces.into(), head.double);
        u64::try_from(all).unwrap_or(u64::MAX)
    }

    /// As much as there is.
    pub(crate) const ANY: Room = Room { context: u64::MAX, ring: usize::MAX };

    /// What chunks of so many splits take: on two terrains, igea and dragon contexts have at most 1.01 times as many splits as their chunks, and rings some ten edges. Of short last chunks the context
    /// may be all of the first band, 6,144 splits (a scan of 20,000 faces).
    pub(crate) fn usual(count: u32) -> Room {
        Room { context: (count as u64 + count as u64 / 8 + 512).max(8192), ring: 1024 }
    }

    /// Bytes that reading takes at most on the way, besides the arrays that come of it and what `chunk` has in the file: all that grows is here with what it grows to, and what it grew from while that is copied.
    pub(crate) fn bytes(self, head: &MeshHead, chunk: &super::Chunk) -> u64 {
        const GROWN: u128 = 3;
        // What a directory says may be anything.
        let [count, stored, raw] = [chunk.count.into(), chunk.stored.into(), chunk.raw.into()];
        // The format allows as many splits of a context as bytes.
        let context = u128::from(self.context).min(stored);
        let (n0, f0) = (u128::from(head.base_vertices), u128::from(head.base_faces));
        let splits: u128 = count + context;
        let (vertices, faces) = (n0 + splits, f0 + 2 * splits);
        // There is room for usual contexts at once.
        let growth = if context > Room::usual(chunk.count).context.into() { GROWN } else { 1 };
        let walk = growth * Walk::bytes(vertices, faces, head.double) + GROWN * 2 * 4 * (n0 + f0 + 128);
        let edges = (2 * faces + 2).min(self.ring as u128 + 64);
        let ring = 2 * GROWN * size_of::<super::walk::Edge>() as u128 * edges;
        let known = GROWN * 12 * context;
        // Two sweeps: of the context's splits or the chunk's.
        let sweeps = GROWN * 2 * 2 * 4 * context.max(count);
        // Of arrays that no room is made for at once; rows are kept by vertex.
        let plain = count * (18 + if head.double { 24 } else { 12 });
        let grows = if raw == plain { 0 } else { GROWN * raw };
        let rows = if head.channels.is_some() { GROWN * (raw + 32 * count) } else { 0 };
        let all = walk + ring + known + sweeps + grows + rows + FIXED;
        u64::try_from(all).unwrap_or(u64::MAX)
    }
}

/// Bytes of models of symbols and other things that do not grow, at most.
const FIXED: u128 = 1 << 18;

/// Reads a chunk before which `state` stands; if it is read alone, at the base, with the room that is given. `None`: damage, or too little room; the state is void.
pub(super) fn read(
    head: &MeshHead,
    state: &mut Sequel,
    alone: Option<Room>,
    (first, first_face): (u32, u32),
    (count, raw): (usize, u64),
    mut bytes: &[u8],
) -> Option<SplitBlock> {
    let stored = bytes.len() as u64;
    let end = (first as u64).checked_add(count as u64)?;
    let here = alone.is_some() || head.base_vertices as usize + first as usize == state.walk.vertices.len();
    if end > head.splits as u64 || !here || first_face != head.first_face(first) {
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
    // A split takes at least 18 bytes and a place, so this is no more than was announced for the arrays.
    let least = 18 + if head.double { 24 } else { 12 };
    if count as u64 > raw / least {
        return None;
    }
    out.reserve(count);
    let usual = Room::usual(count as u32).context.min(stored) as usize;
    state.walk.reserve(count + if alone.is_some() { usual } else { 0 });
    let mut codec = Codec::new(head, state, at, alone.is_some());
    codec.extras.limit(raw);
    if let Some(room) = alone {
        codec.ring.most = room.ring;
        codec.context(&mut streams, &ProgressiveMesh::default(), None, room.context.min(stored))?;
    }
    codec.prepares(false);
    codec.levels(&mut streams[ERRORS], [0; 2]);
    codec.begin(&mut streams[CONNECTIVITY], &[], count)?;
    for k in 1..=count {
        codec.split(&mut streams, &mut None, &mut out)?;
        if k % CHECKED == 0 && (streams.iter().any(Coder::spent) || out.bytes() > raw) {
            return None;
        }
    }
    Some(out).filter(|o| o.bytes() == raw && !streams.iter().any(Coder::spent))
}
