//! Chunks of splits that are read after those before: references as ranks in the rings of the mesh as it is then, positions expected amid their
//! neighbours.
//!
//! Both sides do the splits of the chunk on a [`Walk`]. FORMAT.md, "SPLS", has the rules.

use super::base::MeshHead;
use super::coder::{Bit, Coder, Decoder, Encoder, Nibble, Number, put_varint, take_varint};
use super::extras::Extras;
use super::places;
use super::residual::{Guess, Residuals};
use super::splits::{
    CONNECTIVITY, Counts, ERROR_SHIFT, ERRORS, PLACES, STREAMS, Sizes, Source, SplitBlock, error_level,
};
use super::walk::{Cut, NO_LEVEL, Ring, Walk, cut, turn};
use crate::aif::NONE;
use crate::progressive::{ProgressiveMesh, SplitCode};

/// Bits of a code that the mesh and the cuts tell.
const TOLD: u16 =
    SplitCode::TWO_FACES | SplitCode::MOVES | SplitCode::L_INNER | SplitCode::L_STARTS | SplitCode::R_INNER;
/// Beside the code: the ring runs the other way.
const TURNED: u32 = 1 << 16;
/// Beside the code: the cuts are named, not counted.
const NAMED: u32 = 1 << 17;

/// What a vertex did when the sweep last came by.
const ROOT: u8 = 0;
const NEW: u8 = 1;
const SPLIT: u8 = 2;
/// It waits for others; so often it was asked again.
const WAITED: u8 = 3;
const MOST: u8 = 6;
const DONE: u8 = 7;
/// Beside these: its ring has grown since.
const TOUCHED: u8 = 8;

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

/// A split's cuts, as places in the ring.
#[derive(Clone, Copy, Debug)]
struct Cuts {
    left: Cut,
    right: Cut,
    first: usize,
    count: usize,
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

    /// Codes the chunk's roots; a writer gives its splits.
    fn begin<C: Coder>(
        &mut self,
        c: &mut [C; STREAMS],
        of: &[u32],
        levels: [u16; 2],
        count: usize,
    ) -> Option<()> {
        self.levels[0] = c[ERRORS].plain(16, levels[0] as u32) as u16;
        self.levels[1] = c[ERRORS].plain(16, levels[1] as u32) as u16;
        let c = &mut c[CONNECTIVITY];
        let first = self.first_vertex as u32;
        let mut roots: Vec<u32> = of.iter().copied().filter(|&v| v < first).collect();
        roots.sort_unstable();
        roots.dedup();
        let number = c.number(&mut self.m.roots, roots.len() as u64);
        if number > count as u64 {
            return None;
        }
        let mut next = 0u64;
        for k in 0..number as usize {
            let gap = c.number(&mut self.m.root, roots.get(k).map_or(0, |&r| r as u64 - next));
            let v = u32::try_from(next.checked_add(gap)?).ok().filter(|&v| v < first)?;
            next = v as u64 + 1;
            self.walk.vertices[v as usize].visit = ROOT;
            self.pass.push(v);
            if c.spent() {
                return None;
            }
        }
        // Along the curve, so that what is near is near in memory too; the first on top.
        let vertices = &self.walk.vertices;
        self.pass.sort_unstable_by_key(|&v| std::cmp::Reverse((vertices[v as usize].key, v)));
        if !C::READS {
            self.to_come = vec![0; of.len() + roots.len()];
            self.roots = roots;
            for &v in of {
                *self.left(v)? += 1;
            }
        }
        Some(())
    }

    /// The splits of a vertex to come (writer).
    fn left(&mut self, v: u32) -> Option<&mut u16> {
        let at = match (v as usize).checked_sub(self.first_vertex) {
            Some(new) => self.roots.len() + new,
            None => self.roots.binary_search(&v).ok()?,
        };
        self.to_come.get_mut(at)
    }

    /// The vertex of the next split, by the sweep, and what it did last.
    fn sweep<C: Coder>(&mut self, c: &mut C, wanted: u32) -> Option<(u32, u8)> {
        loop {
            let Some(v) = self.pass.pop() else {
                if self.list.is_empty() || !self.moved {
                    return None;
                }
                self.moved = false;
                std::mem::swap(&mut self.pass, &mut self.list);
                self.pass.reverse();
                continue;
            };
            let vertex = &mut self.walk.vertices[v as usize];
            let (state, touched) = (vertex.visit & 7, vertex.visit & TOUCHED != 0);
            if state >= WAITED && !touched {
                // What it waits for would have touched it.
                self.list.push(v);
                continue;
            }
            let level = vertex.level.min(self.levels[1]).saturating_sub(self.levels[0]);
            let level = match level {
                0 => 0,
                1 | 2 => 1,
                3 | 4 => 2,
                5 | 6 => 3,
                7 | 8 => 4,
                _ => 5,
            };
            let class = valence_class(vertex.valence as usize);
            if c.bit(&mut self.m.split[state.min(4) as usize][class][level], v == wanted) {
                vertex.visit = SPLIT;
                self.moved = true;
                if !C::READS {
                    *self.left(v)? -= 1;
                }
                return Some((v, state));
            }
            let more = if C::READS { 0 } else { *self.left(v)? };
            let vertex = &mut self.walk.vertices[v as usize];
            if state >= WAITED || !c.bit(&mut self.m.done[state as usize][level], more == 0) {
                vertex.visit = if state < WAITED { WAITED } else { (state + 1).min(MOST) };
                self.list.push(v);
            } else {
                vertex.visit = DONE;
            }
            if c.spent() {
                return None;
            }
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

    /// The code of the split and its cuts.
    fn cuts<C: Coder>(
        &mut self,
        c: &mut C,
        (v, state): (u32, u8),
        two: bool,
        source: &Option<Source<'_>>,
    ) -> Option<(SplitCode, Cuts)> {
        let start = Some(self.walk.start(v)).filter(|&h| h != NONE)?;
        self.walk.ring(start, &mut self.ring)?;
        let mut want = None;
        let (mut rest, mut moves) = (0, false);
        if let Some(s) = source {
            let (splits, i) = (&s.pm.splits, s.at.split);
            let code = splits.code[i];
            (rest, moves) = ((code.0 & !TOLD) as u32, code.moves());
            want = self.find(two, splits.left[i], splits.right[i], code);
            if want.is_none() {
                self.walk.ring(turn(start), &mut self.ring)?;
                want = self.find(two, splits.left[i], splits.right[i], code);
                rest |= if want.is_some() { TURNED } else { NAMED };
            }
        }
        if c.bit(&mut self.m.rest_same, rest == self.rest) {
            rest = self.rest;
        } else {
            rest = u32::try_from(c.number(&mut self.m.rest, rest as u64)).ok()?;
        }
        self.rest = rest;
        let told = if two { SplitCode::TWO_FACES } else { 0 };
        let mut code = rest as u16 & !TOLD | told;
        if c.bit(&mut self.m.moves, moves) {
            code |= SplitCode::MOVES;
        }
        let cuts = if rest & NAMED != 0 {
            self.named(c, v, two, source)?
        } else {
            if C::READS && rest & TURNED != 0 {
                self.walk.ring(turn(start), &mut self.ring)?;
            }
            self.counted(c, state, two, want)?
        };
        let (left, inner) = cuts.left.name();
        if left == NONE {
            return None;
        }
        code |=
            if inner { SplitCode::L_INNER } else { 0 } | if left & 1 == 1 { SplitCode::L_STARTS } else { 0 };
        if two && cuts.right.name().1 {
            code |= SplitCode::R_INNER;
        }
        Some((SplitCode(code), cuts))
    }

    /// Where in the ring the writer's cuts are.
    fn find(&self, two: bool, left: u32, right: u32, code: SplitCode) -> Option<(usize, usize)> {
        let faces = self.ring.faces();
        let left = (left >> 2) << 3 | (left & 3) << 1 | code.left_starts() as u32;
        let first =
            (0..self.ring.edges()).find(|&k| self.ring.left(k).name() == (left, code.left_inner()))?;
        if !two {
            return (!self.ring.closed).then_some((first, faces - first));
        }
        let most = if self.ring.closed { faces - 1 } else { faces - first };
        let count = (1..=most).find(|&k| {
            let (h, inner) = self.ring.right(first, k).name();
            cut(h) == right && inner == code.right_inner()
        })?;
        Some((first, count))
    }

    /// Cuts by their rank in the ring.
    fn counted<C: Coder>(
        &mut self,
        c: &mut C,
        state: u8,
        two: bool,
        want: Option<(usize, usize)>,
    ) -> Option<Cuts> {
        let (faces, n) = (self.ring.faces(), self.ring.edges());
        let class = valence_class(n);
        let (first, count) = want.unwrap_or_default();
        let model = &mut self.m.rank[state.min(2) as usize][class];
        let first = rank(c, model, &mut self.m.far, first).filter(|&k| k < n)?;
        let count = if two {
            let model = &mut self.m.count[class];
            let most = if self.ring.closed { faces - 1 } else { faces - first };
            rank(c, model, &mut self.m.far, count.wrapping_sub(1))?.checked_add(1).filter(|&k| k <= most)?
        } else {
            (!self.ring.closed).then_some(faces - first)?
        };
        Some(Cuts { left: self.ring.left(first), right: self.ring.right(first, count), first, count })
    }

    /// Cuts by the numbers of faces: where the vertex has several fans, or the cuts are not named by the later face.
    fn named<C: Coder>(&mut self, c: &mut C, v: u32, two: bool, source: &Option<Source<'_>>) -> Option<Cuts> {
        let (mut left, mut right, mut code) = (0, 0, SplitCode(0));
        if let Some(s) = source {
            let i = s.at.split;
            (left, right, code) = (s.pm.splits.left[i], s.pm.splits.right[i], s.pm.splits.code[i]);
        }
        let left = u32::try_from(c.number(&mut self.m.named[0], left as u64)).ok()?;
        let inner = c.bit(&mut self.m.inner[0], code.left_inner());
        let starts = c.bit(&mut self.m.inner[1], code.left_starts());
        let half = self.walk.named(left, starts, v)?;
        let begin = if inner {
            half
        } else {
            Some(self.walk.across(half)).filter(|&h| h != NONE).unwrap_or(turn(half))
        };
        self.walk.ring(begin, &mut self.ring)?;
        if two {
            right = u32::try_from(c.number(&mut self.m.named[1], right as u64)).ok()?;
            if c.bit(&mut self.m.inner[2], code.right_inner()) {
                code.0 |= SplitCode::R_INNER;
            } else {
                code.0 &= !SplitCode::R_INNER;
            }
        }
        let flags = |on: bool, flag: u16| if on { flag } else { 0 };
        let code = SplitCode(
            code.0 & SplitCode::R_INNER
                | flags(inner, SplitCode::L_INNER)
                | flags(starts, SplitCode::L_STARTS),
        );
        let (first, count) = self.find(two, left, right, code)?;
        Some(Cuts { left: self.ring.left(first), right: self.ring.right(first, count), first, count })
    }

    /// Where the new vertex of a split is expected.
    fn guess(&self, v: u32, cuts: &Cuts, moves: bool) -> Guess {
        let (ring, places) = (&self.ring, &self.walk.places);
        let t = places[v as usize];
        let mut reach = [0.0f64; 3];
        let mut sum = [0.0; 3];
        for k in 0..=cuts.count {
            let p = places[ring.far(cuts.first + k) as usize];
            for a in 0..3 {
                sum[a] += p[a];
                reach[a] = reach[a].max((p[a] - t[a]).abs());
            }
        }
        let n = (cuts.count + 1) as f64;
        // Where both are placed anew the old place is between them: fitted to bunny, horse and igea.
        let at = if moves {
            std::array::from_fn(|a| 0.375 * (sum[a] / n) + 0.625 * t[a])
        } else {
            std::array::from_fn(|a| (sum[a] + t[a]) / (n + 1.0))
        };
        Guess { at, reach }
    }

    /// Where the old vertex of a split is expected to go: it stays near, drawn to the neighbours that it keeps.
    fn guess_moved(&self, v: u32, cuts: &Cuts, guess: &Guess) -> Guess {
        let (ring, places) = (&self.ring, &self.walk.places);
        let t = places[v as usize];
        let [l, r] = [cuts.first, cuts.first + cuts.count].map(|k| places[ring.far(k) as usize]);
        let tips: [f64; 3] = std::array::from_fn(|a| 0.5 * (l[a] + r[a]));
        let edges = ring.edges();
        let kept = if ring.closed { edges.saturating_sub(cuts.count + 1) } else { 0 };
        let mut sum = [0.0; 3];
        for k in 1..=kept {
            let mut at = cuts.first + cuts.count + k;
            if at >= 2 * edges {
                at -= edges;
            }
            let p = places[ring.far(at) as usize];
            (0..3).for_each(|a| sum[a] += p[a]);
        }
        let outer = if kept > 0 { sum.map(|x| x / kept as f64) } else { tips };
        let at = std::array::from_fn(|a| 0.625 * t[a] + 0.25 * outer[a] + 0.125 * tips[a]);
        Guess { at, reach: guess.reach }
    }
}

/// A rank: below 15 as a symbol.
#[inline]
fn rank<C: Coder>(c: &mut C, m: &mut Nibble, far: &mut Number, value: usize) -> Option<usize> {
    match c.nibble(m, value.min(15) as u32) {
        15 => usize::try_from(c.number(far, (value as u64).wrapping_sub(15))).ok()?.checked_add(15),
        near => Some(near as usize),
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
