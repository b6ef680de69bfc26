//! What a chunk needs to be read alone: the least mesh in which its splits can be done.
//!
//! The splits of a chunk depend on others, these on others, down to the base (the l/r rule). The chunk holds all of them again, without what only their own chunk has to
//! tell: which they are, where they open the mesh, and roughly where their vertices are, so that others can be expected amid them. As a split refers
//! to the rings of the mesh as it is then, this costs no more than it did the first time, and nothing else has to be named.

use super::super::base::{MeshHead, Singles};
use super::super::coder::{Bit, Coder, Nibble, Number, unzigzag, zigzag};
use super::super::places::round_even;
use super::super::residual::Guess;
use super::super::splits::{CONNECTIVITY, Counts, PLACES, STREAMS};
use super::super::walk::{NO_LEVEL, Walk};
use super::cuts::Wanted;
use super::sweep::MARKED;
use super::{CHECKED, Codec, Sequel};
use crate::aif::NONE;
use crate::progressive::ProgressiveMesh;
use std::sync::{Arc, Mutex, PoisonError};

#[derive(Clone, Debug, Default)]
pub(super) struct Models {
    sources: Number,
    count: Number,
    /// Whether the split is the one behind the last, by whether that was, whether a marked vertex was visited since, and whether its vertex is a root; if not, how many are between them.
    next: [Bit; 8],
    gap: Number,
    /// By how much flatter than long the surroundings are; of the coordinate along which they rise, by how much less they do.
    place: [[Nibble; FLAT]; 2],
    far: Number,
}

/// Classes of how much flatter than long.
const FLAT: usize = 6;
/// Places are given in steps of 2^-ACROSS of the longest reach of the surroundings, rounded to a power of two, and how far they are off the plane of the surroundings in steps of
/// 2^-ALONG. One more or less of either is dearer on bunny and horse: finer places cost more than they spare.
const ACROSS: i32 = 2;
const ALONG: i32 = 4;

/// The mesh before the first split, ready for any number of readers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Start(Option<Arc<(Walk, Mutex<Vec<Walk>>)>>);

impl PartialEq for Start {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Start {
    /// `None` if the base contradicts itself.
    pub(in super::super) fn new(pm: &ProgressiveMesh) -> Option<Self> {
        Some(Start(Some(Arc::new((Walk::new(pm)?, Mutex::default())))))
    }

    /// At the base.
    pub(in super::super) fn take(&self) -> Option<Walk> {
        let (base, free) = &**self.0.as_ref()?;
        let walk = free.lock().unwrap_or_else(PoisonError::into_inner).pop();
        Some(walk.unwrap_or_else(|| base.clone()))
    }

    /// Lets go of what is kept for the next.
    pub(crate) fn forget(&self) {
        if let Some((_, free)) = self.0.as_deref() {
            free.lock().unwrap_or_else(PoisonError::into_inner).clear();
        }
    }

    /// For the next that takes one: clearing what was done takes less time than a new one.
    pub(in super::super) fn give(&self, state: Sequel) {
        if let Some((base, free)) = self.0.as_deref() {
            let mut walk = state.walk;
            walk.reset(base);
            free.lock().unwrap_or_else(PoisonError::into_inner).push(walk);
        }
    }
}

/// The splits of the context: their numbers in the file, and their faces.
#[derive(Clone, Debug, Default)]
pub(super) struct Known {
    vertices: u32,
    faces: u32,
    first: u32,
    first_face: u32,
    ids: Vec<u32>,
    of_face: Vec<u32>,
}

impl Known {
    pub(super) fn new(head: &MeshHead, first: Counts) -> Self {
        Known {
            vertices: head.base_vertices,
            faces: head.base_faces,
            first: first.split as u32,
            first_face: first.face as u32,
            ..Default::default()
        }
    }

    /// How many.
    pub(super) fn splits(&self) -> usize {
        self.ids.len()
    }

    /// The number of a vertex in the file.
    #[inline]
    pub(super) fn vertex(&self, v: u32) -> u32 {
        match v.checked_sub(self.vertices) {
            None => v,
            Some(k) => self.vertices + behind(&self.ids, k, self.first),
        }
    }

    /// A cut by the number of its face in the file.
    #[inline]
    pub(super) fn cut(&self, cut: u32) -> u32 {
        let face = match (cut >> 2).checked_sub(self.faces) {
            None => cut >> 2,
            Some(k) => behind(&self.of_face, k, self.first_face),
        };
        face << 2 | cut & 3
    }
}

/// The `k`-th of `known`; behind those one follows the other, from `first` on. No branch: it is the one as often as the other.
#[inline(always)]
fn behind(known: &[u32], k: u32, first: u32) -> u32 {
    let n = known.len() as u32;
    let at = known.get(k.min(n.saturating_sub(1)) as usize).copied().unwrap_or_default();
    let later = ((k >= n) as u32).wrapping_neg();
    at ^ (at ^ first.wrapping_add(k.wrapping_sub(n))) & later
}

/// What a writer needs for contexts, and what it knows of that of one chunk.
pub(in super::super) struct Sources<'a> {
    head: &'a MeshHead,
    on: &'a [[u32; 3]],
    /// The first split of every chunk.
    chunks: &'a [u32],
    /// Where vertices are at last.
    places: &'a [[f64; 3]],
    first: u32,
    first_face: u32,
    /// Splits of the context, ascending; a bit for each split, whether it is one; of each that is its place there.
    ids: Vec<u32>,
    is: Vec<u64>,
    slot: Vec<u32>,
    /// The first face of each, in the mesh of the chunk.
    faces: Vec<u32>,
    /// `split << 1 | second` of every face that a split makes.
    maker: Vec<u32>,
}

impl<'a> Sources<'a> {
    pub(in super::super) fn new(
        head: &'a MeshHead,
        on: &'a [[u32; 3]],
        chunks: &'a [u32],
        places: &'a [[f64; 3]],
    ) -> Self {
        let mut singles = Singles::new(head);
        let mut maker = Vec::with_capacity(2 * on.len());
        for i in 0..on.len() as u32 {
            maker.push(i << 1);
            if !singles.is(i) {
                maker.push(i << 1 | 1);
            }
        }
        Sources {
            head,
            on,
            chunks,
            places,
            first: 0,
            first_face: 0,
            ids: Vec::new(),
            is: vec![0; on.len().div_ceil(64)],
            slot: vec![NONE; on.len()],
            faces: Vec::new(),
            maker,
        }
    }

    /// All splits before `range` that those in it depend on.
    pub(in super::super) fn find(&mut self, range: std::ops::Range<usize>) {
        self.ids.iter().for_each(|&i| self.is[(i / 64) as usize] = 0);
        self.ids.clear();
        self.faces.clear();
        self.first = range.start as u32;
        self.first_face = self.head.first_face(self.first);
        let mut at = 0;
        let (on, is) = (self.on, &mut self.is);
        let mut take = |ids: &mut Vec<u32>, on: &[u32; 3]| {
            for &d in on.iter().filter(|&&d| (d as usize) < range.start) {
                let (word, bit) = (&mut is[(d / 64) as usize], 1 << (d % 64));
                if *word & bit == 0 {
                    *word |= bit;
                    ids.push(d);
                }
            }
        };
        on[range.clone()].iter().for_each(|on| take(&mut self.ids, on));
        while let Some(&i) = self.ids.get(at) {
            take(&mut self.ids, &on[i as usize]);
            at += 1;
        }
        // Ascending.
        self.ids.clear();
        for (&word, first) in self.is[..range.start.div_ceil(64)].iter().zip((0u32..).step_by(64)) {
            let mut word = word;
            while word != 0 {
                self.ids.push(first + word.trailing_zeros());
                word &= word - 1;
            }
        }
        let mut face = self.head.base_faces;
        let mut singles = Singles::new(self.head);
        for (&i, k) in self.ids.iter().zip(0..) {
            self.slot[i as usize] = k;
            self.faces.push(face);
            face += 2 - singles.is(i) as u32;
        }
        self.faces.push(face);
    }

    /// A split before the chunk is among those it depends on.
    fn has(&self, i: u32) -> bool {
        self.is[(i / 64) as usize] >> (i % 64) & 1 != 0
    }

    /// The number of a vertex in the mesh of the chunk.
    #[inline]
    pub(in super::super) fn vertex(&self, v: u32) -> u32 {
        match v.checked_sub(self.head.base_vertices) {
            None => v,
            Some(i) if i >= self.first => v - self.first + self.ids.len() as u32,
            Some(i) => {
                debug_assert!(self.has(i));
                self.head.base_vertices + self.slot[i as usize]
            }
        }
    }

    /// A cut by the number of its face in the mesh of the chunk.
    #[inline]
    pub(in super::super) fn cut(&self, cut: u32) -> u32 {
        let face = cut >> 2;
        if face < self.head.base_faces || cut == NONE {
            return cut;
        }
        // Most are of the chunk itself.
        let face = if face >= self.first_face {
            self.faces.last().map_or(0, |&f| face - self.first_face + f)
        } else {
            let Some(&maker) = self.maker.get((face - self.head.base_faces) as usize) else { return cut };
            debug_assert!(self.has(maker >> 1));
            self.faces[self.slot[(maker >> 1) as usize] as usize] + (maker & 1)
        };
        face << 2 | cut & 3
    }

    fn wanted(&self, pm: &ProgressiveMesh, i: u32) -> Wanted {
        let (s, i) = (&pm.splits, i as usize);
        Wanted {
            vertex: self.vertex(s.vertex[i]),
            left: self.cut(s.left[i]),
            right: self.cut(s.right[i]),
            code: s.code[i],
        }
    }
}

impl Codec<'_> {
    /// Codes the context and does its splits; it has at most `most`.
    pub(super) fn context<C: Coder>(
        &mut self,
        c: &mut [C; STREAMS],
        pm: &ProgressiveMesh,
        sources: Option<&mut Sources<'_>>,
        most: u64,
    ) -> Option<()> {
        let mut known = self.known.take()?;
        let mut parts: Vec<&[u32]> = Vec::new();
        if let Some(s) = &sources {
            let mut rest = &s.ids[..];
            for &end in s.chunks.iter().skip(1) {
                let (part, others) = rest.split_at(rest.partition_point(|&i| i < end));
                parts.extend(Some(part).filter(|p| !p.is_empty()));
                rest = others;
            }
            parts.extend(Some(rest).filter(|p| !p.is_empty()));
        }
        self.prepares(true);
        let number = c[CONNECTIVITY].number(&mut self.m.context.sources, parts.len() as u64);
        let (mut next, mut near) = (0u32, false);
        let mut of = Vec::new();
        for k in 0..number {
            let part = parts.get(k as usize).copied().unwrap_or_default();
            let count = c[CONNECTIVITY].number(&mut self.m.context.count, part.len() as u64);
            if count == 0 || count > most - known.ids.len() as u64 {
                return None;
            }
            of.clear();
            if let Some(s) = &sources {
                of.extend(part.iter().map(|&i| s.vertex(pm.splits.vertex[i as usize])));
            }
            self.begin(&mut c[CONNECTIVITY], &of, count as usize)?;
            for k in 0..count as usize {
                let wanted = sources.as_ref().map(|s| s.wanted(pm, part[k]));
                let own = part.get(k);
                let (v, state) = self.sweep(&mut c[CONNECTIVITY], wanted.map_or(NONE, |w| w.vertex))?;
                let gap = own.map_or(0, |&i| i - next);
                let m = &mut self.m.context;
                let class =
                    near as usize | ((self.marks & MARKED > 0) as usize) << 1 | ((state > 0) as usize) << 2;
                near = c[CONNECTIVITY].bit(&mut m.next[class], gap == 0);
                self.marks = 0;
                if !near {
                    self.walk.vertices[v as usize].visit |= MARKED;
                }
                let gap = if near { 0 } else { c[CONNECTIVITY].number(&mut m.gap, gap as u64) };
                let id = u32::try_from(gap).ok()?.checked_add(next)?;
                next = id.checked_add(1)?;
                if id >= known.first {
                    return None;
                }
                let two = !self.singles.is(id);
                let (code, cuts) = self.cuts(&mut c[CONNECTIVITY], (v, state), two, wanted)?;
                let guess = self.guess(v, &cuts, false);
                let place = sources.as_ref().map_or([0.0; 3], |s| s.places[id as usize]);
                let place = self.roughly(&mut c[PLACES], &guess, place);
                self.apply(v, &cuts, code, (place, NO_LEVEL));
                let face = self.head.base_faces + 2 * id + !two as u32 - self.singles.so_far();
                known.ids.push(id);
                known.of_face.push(face);
                if two {
                    known.of_face.push(face + 1);
                }
                if known.ids.len() % CHECKED == 0 && c.iter().any(Coder::spent) {
                    return None;
                }
            }
        }
        if c.iter().any(Coder::spent) {
            return None;
        }
        self.prepares(false);
        self.known = Some(known);
        Some(())
    }

    /// A place, in steps that go with its surroundings.
    fn roughly<C: Coder>(&mut self, c: &mut C, guess: &Guess, place: [f64; 3]) -> [f64; 3] {
        let octave = |x: f32| (x.to_bits() >> 23) as i32 - 127;
        let power = |e: i32| f64::from_bits(((e + 1023) as u64) << 52);
        let longest = octave(guess.reach[0].max(guess.reach[1]).max(guess.reach[2]));
        if !(-126..128).contains(&longest) {
            // All in one place, or nowhere.
            return guess.at;
        }
        let [a, b, last] = guess.axes;
        let mut out = guess.at;
        for axis in [a, b] {
            let flat = longest - octave(guess.reach[axis]);
            let steps = (place[axis] - guess.at[axis]) * power(ACROSS - longest);
            out[axis] += self.steps(c, (0, flat), steps) * power(longest - ACROSS);
        }
        let flat = longest - octave(guess.rise);
        let off = guess.off(std::array::from_fn(|k| (place[k] - guess.at[k]) as f32)) as f64;
        let steps = self.steps(c, (1, flat), off * power(ALONG - longest)) * power(longest - ALONG);
        out[last] = guess.on_plane(out[a], out[b]) + steps;
        out
    }

    /// A number of steps.
    #[inline(always)]
    fn steps<C: Coder>(&mut self, c: &mut C, (kind, flat): (usize, i32), steps: f64) -> f64 {
        let z = zigzag(round_even(steps.clamp(-1e12, 1e12)) as i64);
        let model = &mut self.m.context.place[kind][flat.clamp(0, FLAT as i32 - 1) as usize];
        let near = c.nibble(model, z.min(15) as u32) as u64;
        let z = if near < 15 {
            near
        } else {
            15 + (c.number(&mut self.m.context.far, z.wrapping_sub(15)) & ((1 << 42) - 1))
        };
        unzigzag(z) as f64
    }
}
