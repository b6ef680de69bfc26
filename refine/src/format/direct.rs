//! Chunks of splits by direct references: read alone, with nothing done that is not the chunk's own.
//!
//! A terrain's chunks are there to be read while a view waits for them. Most of the time that `SPLT` takes goes into doing splits, those of the chunk and nearly as many of its context, to count
//! edges in their rings. Here a split says in which turn it comes, and which splits made the faces that its cuts name: more bytes for connectivity than by ranks, none for contexts, and less than half of the time.
//! FORMAT.md, "SPLD", has the rules.

mod axis;

pub(super) use self::axis::Axis;
use super::base::{MeshHead, Singles};
use super::coder::{
    Bit, Coder, Decoder, Encoder, Nibble, Number, low_mask, put_varint, take_varint, unzigzag, zigzag,
};
use super::places;
use super::splits::{CONNECTIVITY, ERROR_SHIFT, ERRORS, MOST_LEVEL, PLACES, SplitBlock};
use crate::aif::NONE;
use crate::progressive::{SplitCode, SplitKind};
use rustc_hash::FxHashMap;

/// Kinds of streams: those of other chunks of splits, without attributes and faces.
pub(super) const STREAMS: usize = 3;

/// After so many splits a reader looks whether there was enough to read.
const CHECKED: usize = 16;

/// Of how many turns a split waits: so many are told apart, then more, then that none comes.
const MORE: u32 = 14;
const NEVER: u32 = 15;

/// What a cut's face was made by: a split of the chunk, one before it, or the last of the vertex in the chunk; there is no cut.
const INSIDE: u32 = 0;
const OUTSIDE: u32 = 1;
const PARENT: u32 = 2;
const NO_CUT: u32 = 3;

/// Codes that have a symbol of their own.
const CODES: usize = 15;

/// Levels below that of the split before at the vertex have symbols up to here, in contexts by so many levels above the least.
const FAR: u16 = 15;
const TOPS: usize = 12;

/// Contexts of lengths: of the last residual at the vertex, or none.
const LENGTHS: usize = 16;

/// The splits of a chunk.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rows {
    /// The first split.
    pub(super) first: u32,
    /// Vertices from before that are split in the chunk, those near each other together.
    pub(super) roots: Vec<u32>,
    /// The vertex that each splits, by its number in the file.
    pub(super) vertex: Vec<u32>,
    /// Left and right cut; faces are numbered as if every split of the file made two. [`NONE`] for no right cut.
    pub(super) cuts: Vec<[u32; 2]>,
    pub(super) code: Vec<SplitCode>,
    /// The error as the file keeps it.
    pub(super) level: Vec<u16>,
    pub(super) place: Vec<[f64; 3]>,
}

/// What of a vertex the splits of a chunk need.
#[derive(Clone, Copy, Debug)]
struct Local {
    /// Its number in the file.
    vertex: u32,
    /// The next of those that are split in the same turn, in no order.
    behind: u32,
    /// The root that it comes of.
    root: u32,
    /// The last split of the chunk that made it or split it.
    last: u32,
    /// The level of that.
    level: u16,
    /// What to expect of residuals here, by axis.
    lengths: [u8; 3],
    /// Where it is, or one beside it, as numbers of the axes.
    place: [i64; 3],
}

/// What a writer knows beside the rows.
struct Plan<'a> {
    rows: &'a Rows,
    turn: Vec<u32>,
    /// The splits of the chunk that replace the two vertices of each.
    next: Vec<[u32; 2]>,
    /// Vertices from before that are split in the chunk, and the first split of each.
    roots: Vec<(u32, u32)>,
    /// Faces from before that cuts name, ascending.
    outside: Vec<u32>,
    codes: Vec<u16>,
    /// The longest residuals, by axis.
    shifts: [u32; 3],
}

/// A number by its length and its bits, of `shift` + 15 bits at most: lengths up to `shift` share the first symbol.
#[inline(always)]
fn sized<C: Coder>(c: &mut C, m: &mut Nibble, shift: u32, x: u64) -> (u64, u32) {
    let length = 64 - x.leading_zeros();
    let symbol = c.nibble(m, length.saturating_sub(shift).min(15));
    let rest = (shift + symbol - u32::from(symbol > 0)).min(63);
    let low = c.plain64(rest, x & low_mask(rest));
    (if symbol > 0 { 1 << rest | low } else { low }, symbol)
}

/// What [`sized`] leaves out of the lengths of numbers up to this one.
fn shift_for(most: u64) -> u32 {
    (64 - most.leading_zeros()).saturating_sub(15)
}

/// The split makes one wedge and neither moves nor changes anything: other splits are not for these chunks.
#[inline(always)]
fn is_plain(code: SplitCode) -> bool {
    code.kind() == SplitKind::Plain && !code.moves() && !code.changes_rows()
}

/// Codes one chunk.
struct Codec {
    base_vertices: u32,
    base_faces: u32,
    first: u32,
    axes: [Axis; 3],
    shifts: [u32; 3],
    codes: Vec<u16>,
    levels: [u16; 2],
    of: Vec<Local>,
    /// A vertex of every turn, the last that was told.
    turns: Vec<u32>,
    /// Vertices that have a turn.
    waiting: u32,
    /// Faces from before: numbered as if every split made two, and as they are.
    outside: Vec<[u32; 2]>,
    /// The last of them that was named.
    named: i64,
    /// Twice the first face of every split of the chunk, and 1 more if it makes two.
    made: Vec<u32>,
    // What is learned.
    wait: [Nibble; 3],
    more: Number,
    kinds: [Nibble; 2],
    code: Nibble,
    edges: [Nibble; 16],
    near: [Nibble; 2],
    far: [Nibble; 4],
    second: [Bit; 2],
    level: [Nibble; TOPS],
    places: [[Nibble; LENGTHS]; 3],
}

impl Codec {
    fn new(head: &MeshHead, first: u32, axes: [Axis; 3]) -> Codec {
        Codec {
            base_vertices: head.base_vertices,
            base_faces: head.base_faces,
            first,
            axes,
            shifts: [0; 3],
            codes: Vec::new(),
            levels: [0; 2],
            of: Vec::new(),
            turns: Vec::new(),
            waiting: 0,
            outside: Vec::new(),
            named: 0,
            made: Vec::new(),
            wait: Default::default(),
            more: Number::default(),
            kinds: Default::default(),
            code: Nibble::default(),
            edges: Default::default(),
            near: Default::default(),
            far: Default::default(),
            second: Default::default(),
            level: Default::default(),
            places: Default::default(),
        }
    }

    /// What the splits share: codes, levels, lengths.
    fn head<C: Coder>(&mut self, c: &mut [C; STREAMS], plan: Option<&Plan<'_>>) -> Option<()> {
        let codes = plan.map_or(&[][..], |p| &p.codes);
        let count = c[CONNECTIVITY].plain(4, codes.len() as u32) as usize;
        for k in 0..count {
            let code = c[CONNECTIVITY].plain(16, codes.get(k).copied().unwrap_or_default().into());
            self.codes.push(code as u16);
        }
        let levels = plan.map_or([0; 2], |p| {
            let of = || p.rows.level.iter().copied();
            [of().min().unwrap_or(0), of().max().unwrap_or(0)]
        });
        self.levels = levels.map(|l| c[ERRORS].plain(16, l.into()) as u16);
        for axis in 0..3 {
            self.shifts[axis] = c[PLACES].plain(6, plan.map_or(0, |p| p.shifts[axis]));
        }
        (self.levels[0] <= self.levels[1] && self.levels[1] <= MOST_LEVEL).then_some(())
    }

    /// Vertices from before that are split, with their turns; `count` splits follow.
    fn roots<C: Coder>(&mut self, c: &mut C, plan: Option<&Plan<'_>>, count: u32) -> Option<()> {
        let roots = plan.map_or(&[][..], |p| &p.roots);
        let before = self.base_vertices + self.first;
        let number = c.number(&mut Number::default(), roots.len() as u64);
        if number > u64::from(count) || number > u64::from(before) {
            return None;
        }
        let mut gaps = Number::default();
        let mut next = 0i64;
        self.of.reserve_exact(number as usize + count as usize);
        for k in 0..number as usize {
            let (v, split) = roots.get(k).copied().unwrap_or_default();
            let gap = c.signed(&mut gaps, i64::from(v) - next);
            next = next.checked_add(gap)?;
            let vertex = u32::try_from(next).ok().filter(|&v| v < before)?;
            let wait = self.wait(c, 0, plan.map(|p| p.turn[split as usize]))??;
            self.of.push(Local {
                vertex,
                behind: NONE,
                root: k as u32,
                last: NONE,
                level: self.levels[1],
                lengths: [0; 3],
                place: [0; 3],
            });
            self.come(k as u32, wait, count)?;
            if c.spent() {
                return None;
            }
        }
        Some(())
    }

    /// Faces from before that cuts name.
    fn faces<C: Coder>(
        &mut self,
        c: &mut C,
        head: &MeshHead,
        plan: Option<&Plan<'_>>,
        count: u32,
    ) -> Option<()> {
        let faces = plan.map_or(&[][..], |p| &p.outside);
        let end = self.base_faces.checked_add(self.first.checked_mul(2)?)?;
        let number = c.number(&mut Number::default(), faces.len() as u64);
        if number > 2 * u64::from(count) || number > u64::from(end) {
            return None;
        }
        let mut gaps = Number::default();
        let (mut next, mut singles, mut single) = (0u32, Singles::new(head), NONE);
        self.outside.reserve_exact(number as usize);
        for k in 0..number as usize {
            let face = faces.get(k).copied().unwrap_or_default();
            let gap = c.number(&mut gaps, u64::from(face.wrapping_sub(next)));
            let face = u32::try_from(gap).ok()?.checked_add(next).filter(|&f| f < end)?;
            next = face + 1;
            let real = match face.checked_sub(self.base_faces) {
                None => face,
                Some(_) if !C::READS => face,
                Some(k) => {
                    let (i, second) = (k / 2, k % 2);
                    if i != single && singles.is(i) {
                        single = i;
                    }
                    if i == single && second == 1 {
                        return None;
                    }
                    // Its own face is counted already.
                    face - (singles.so_far() - u32::from(i == single))
                }
            };
            self.outside.push([face, real]);
            if c.spent() {
                return None;
            }
        }
        Some(())
    }

    /// In how many turns a vertex is split; `None`: in none of this chunk. The outer: damage.
    #[inline(always)]
    fn wait<C: Coder>(&mut self, c: &mut C, kind: usize, turns: Option<u32>) -> Option<Option<u32>> {
        match c.nibble(&mut self.wait[kind], turns.map_or(NEVER, |t| t.min(MORE))) {
            NEVER => Some(None),
            MORE => {
                let more = c.number(&mut self.more, u64::from(turns.unwrap_or(0).saturating_sub(MORE)));
                u32::try_from(more).ok()?.checked_add(MORE).map(Some)
            }
            turns => Some(Some(turns)),
        }
    }

    /// Vertex `v` is split in a turn.
    #[inline(always)]
    fn come(&mut self, v: u32, turn: u32, count: u32) -> Option<()> {
        // Every turn has a split.
        if turn >= count || self.waiting >= count {
            return None;
        }
        self.waiting += 1;
        let turn = turn as usize;
        if self.turns.len() <= turn {
            self.turns.resize(turn + 1, NONE);
        }
        let behind = std::mem::replace(&mut self.turns[turn], v);
        self.of.get_mut(v as usize)?.behind = behind;
        Some(())
    }

    /// The vertices of a turn in their order, by roots and then by numbers here: so what is near each other in space is so in memory, and frames without chunks to read take 5 to 8 % less over generated terrain of 4,097 x 4,097 than with vertices as they come.
    fn queue(&self, turn: usize, out: &mut Vec<u64>) -> Option<()> {
        out.clear();
        let mut v = *self.turns.get(turn)?;
        while let Some(at) = self.of.get(v as usize) {
            out.push(u64::from(at.root) << 32 | u64::from(v));
            v = at.behind;
        }
        out.sort_unstable();
        Some(())
    }

    /// The face of a cut, given how it is named: numbered as if every split made two, and as it is.
    #[inline(always)]
    fn face<C: Coder>(
        &mut self,
        c: &mut C,
        (side, kind, last): (usize, u32, u32),
        k: u32,
        wanted: u32,
    ) -> Option<u32> {
        let own = self.base_faces.wrapping_add(2 * self.first);
        match kind {
            INSIDE => {
                let shift = shift_for(2 * u64::from(k));
                let (back, _) =
                    sized(c, &mut self.near[side], shift, u64::from((own + 2 * k).wrapping_sub(wanted)));
                let second = (back & 1) as u32;
                let m = u64::from(k).checked_sub(back.checked_add(1)? / 2)? as u32;
                self.made_by(m, second).filter(|_| m < k)
            }
            PARENT => {
                let second = u32::from(c.bit(&mut self.second[side], wanted.wrapping_sub(own) & 1 == 1));
                self.made_by(last, second)
            }
            OUTSIDE => {
                let model = side << 1 | usize::from(last == NONE);
                let number = self.outside.len() as u64;
                let at = if C::READS {
                    0
                } else {
                    self.outside.binary_search_by_key(&wanted, |o| o[0]).ok()? as i64
                };
                let step = zigzag(at - self.named);
                let (step, _) = sized(c, &mut self.far[model], shift_for(2 * number), step);
                self.named = self.named.checked_add(unzigzag(step))?;
                self.outside.get(usize::try_from(self.named).ok()?).map(|o| o[1])
            }
            _ => None,
        }
    }

    /// A face of a split of the chunk; it may have one only.
    #[inline(always)]
    fn made_by(&self, m: u32, second: u32) -> Option<u32> {
        let &first = self.made.get(m as usize)?;
        // The lowest bit says whether there are two.
        (second <= first & 1).then_some((first >> 1) + second)
    }

    /// A level of error: mostly a little below that of the split before at the vertex.
    #[inline(always)]
    fn level<C: Coder>(&mut self, c: &mut C, top: u16, level: u16) -> Option<u16> {
        let [least, most] = self.levels;
        let top = top.min(most);
        let model = &mut self.level[usize::from(top.saturating_sub(least)).min(TOPS - 1)];
        let down = c.nibble(model, top.wrapping_sub(level).min(FAR).into()) as u16;
        let level = if down < FAR { top.checked_sub(down)? } else { c.plain(9, level.into()) as u16 };
        Some(level).filter(|&l| l <= MOST_LEVEL)
    }

    /// Codes all splits. A reader gets of each the vertex, the cuts, the code, the level and the place.
    fn splits<C: Coder>(
        &mut self,
        c: &mut [C; STREAMS],
        head: &MeshHead,
        count: u32,
        plan: Option<&Plan<'_>>,
        mut out: impl FnMut(u32, [u32; 2], SplitCode, u16, [f64; 3]),
    ) -> Option<()> {
        let mut singles = Singles::new(head);
        let (mut turn, mut before) = (0usize, [0i64; 3]);
        let mut face = if C::READS { head.first_face(self.first) } else { 0 };
        let (mut queue, mut next) = (Vec::new(), 0);
        self.queue(turn, &mut queue)?;
        self.made.reserve_exact(count as usize);
        for k in 0..count {
            // Who is next.
            while next == queue.len() {
                turn += 1;
                self.queue(turn, &mut queue)?;
                next = 0;
            }
            let v = queue[next] as u32 as usize;
            next += 1;
            let at = *self.of.get(v)?;
            if let Some(p) = plan
                && p.rows.vertex[k as usize] != at.vertex
            {
                return None;
            }
            let wanted = plan.map(|p| {
                let (rows, k) = (p.rows, k as usize);
                (rows.cuts[k], rows.code[k], rows.level[k], rows.place[k])
            });
            let (cuts, code, level, place) = wanted.unwrap_or(([0; 2], SplitCode(0), 0, [0.0; 3]));
            // In an order in which no stream is waited for while another could be read.
            let wait = |side: usize| {
                plan.and_then(|p| {
                    let next = p.next[k as usize][side];
                    p.turn.get(next as usize).map(|t| t - p.turn[k as usize] - 1)
                })
            };
            // The place, seen from that of the vertex, or else from that made before.
            let near = if at.lengths[0] == 0 { before } else { at.place };
            let of_axis = |a: usize| (near[a], at.lengths[a], place[a]);
            let again = self.wait(&mut c[CONNECTIVITY], 1, wait(0))?;
            let x = self.coordinate(&mut c[PLACES], 0, of_axis(0))?;
            let new = self.wait(&mut c[CONNECTIVITY], 2, wait(1))?;
            let y = self.coordinate(&mut c[PLACES], 1, of_axis(1))?;
            let (symbol, code) = self.code(&mut c[CONNECTIVITY], code)?;
            let z = self.coordinate(&mut c[PLACES], 2, of_axis(2))?;
            let level = self.level(&mut c[ERRORS], at.level, level)?;
            let cuts = self.references(&mut c[CONNECTIVITY], (k, at.last), (symbol, code), cuts)?;
            let (numbers, lengths, point) = ([x.0, y.0, z.0], [x.1, y.1, z.1], [x.2, y.2, z.2]);
            before = numbers;
            if C::READS {
                if code.two_faces() == singles.is(self.first + k) {
                    return None;
                }
                out(at.vertex, cuts, code, level, point);
            }
            self.made.push(face << 1 | u32::from(code.two_faces()));
            face = face.wrapping_add(1 + u32::from(code.two_faces()));
            let u = self.of.len() as u32;
            let old = Local {
                behind: NONE,
                last: k,
                level,
                lengths,
                place: if at.lengths[0] == 0 { numbers } else { at.place },
                ..at
            };
            self.of[v] = old;
            self.of.push(Local { vertex: self.base_vertices + self.first + k, place: numbers, ..old });
            for (v, wait) in [v as u32, u].into_iter().zip([again, new]) {
                if let Some(wait) = wait {
                    self.come(v, u32::try_from(turn).ok()?.checked_add(wait)?.checked_add(1)?, count)?;
                }
            }
            if C::READS && k as usize % CHECKED == CHECKED - 1 && c.iter().any(Coder::spent) {
                return None;
            }
        }
        (self.waiting == count).then_some(())
    }

    /// A coordinate near a number, where the last residual had such a length: its number, how long the residual is, and itself.
    #[inline(always)]
    fn coordinate<C: Coder>(
        &mut self,
        c: &mut C,
        axis: usize,
        (near, length, value): (i64, u8, f64),
    ) -> Option<(i64, u8, f64)> {
        let of = &self.axes[axis];
        let value = if C::READS { 0 } else { of.number(value)? };
        let residual = zigzag(of.wrap(value.wrapping_sub(near)));
        let model = &mut self.places[axis][usize::from(length) & 15];
        let (residual, symbol) = sized(c, model, self.shifts[axis], residual);
        let number = of.wrap(near.wrapping_add(unzigzag(residual)));
        Some((number, 1 + symbol.min(14) as u8, of.at(number)))
    }

    /// The code of a split, and its symbol.
    #[inline(always)]
    fn code<C: Coder>(&mut self, c: &mut C, code: SplitCode) -> Option<(usize, SplitCode)> {
        let known = if C::READS { 0 } else { self.codes.iter().position(|&x| x == code.0).unwrap_or(CODES) };
        let symbol = c.nibble(&mut self.code, known as u32) as usize;
        let code = match self.codes.get(symbol) {
            Some(&code) => code,
            None if symbol == CODES => c.plain(16, code.0.into()) as u16,
            None => return None,
        };
        Some((symbol, SplitCode(code))).filter(|c| is_plain(c.1))
    }

    /// The cuts of split `k`; `last` is the split of the chunk before at its vertex.
    #[inline(always)]
    fn references<C: Coder>(
        &mut self,
        c: &mut C,
        (k, last): (u32, u32),
        (symbol, code): (usize, SplitCode),
        wanted: [u32; 2],
    ) -> Option<[u32; 2]> {
        let own = self.base_faces.wrapping_add(2 * self.first);
        let kind = |cut: u32| match (cut >> 2).checked_sub(own) {
            _ if cut == NONE => NO_CUT,
            None => OUTSIDE,
            Some(f) if f / 2 == last => PARENT,
            Some(_) => INSIDE,
        };
        let [l, r] = if C::READS { [0; 2] } else { wanted.map(kind) };
        let kinds = c.nibble(&mut self.kinds[usize::from(last == NONE)], l << 2 | r);
        let [l, r] = [kinds >> 2, kinds & 3];
        if l == NO_CUT || (r == NO_CUT) == code.two_faces() {
            return None;
        }
        let edges = (wanted[0] & 3) << 2 | wanted[1] & 3;
        let edges = c.nibble(&mut self.edges[symbol & 15], edges);
        let [a, b] = [edges >> 2, edges & 3];
        let left = self.face(c, (0, l, last), k, wanted[0] >> 2)? << 2 | a;
        let right = match r {
            NO_CUT => NONE,
            _ => self.face(c, (1, r, last), k, wanted[1] >> 2)? << 2 | b,
        };
        (a < 3 && (b < 3 || r == NO_CUT)).then_some([left, right])
    }
}

impl<'a> Plan<'a> {
    /// `None` if rows contradict each other.
    fn new(rows: &'a Rows, base: (u32, u32), axes: &[Axis; 3]) -> Option<Plan<'a>> {
        let (n, first) = (rows.vertex.len(), rows.first);
        let own = base.1.checked_add(first.checked_mul(2)?)?;
        let mut plan = Plan {
            rows,
            turn: Vec::with_capacity(n),
            next: vec![[NONE; 2]; n],
            roots: Vec::new(),
            outside: Vec::new(),
            codes: Vec::new(),
            shifts: [0; 3],
        };
        // The last split of every vertex: of those from before, and of those made.
        let mut of_roots: FxHashMap<u32, u32> = rows.roots.iter().map(|&v| (v, NONE)).collect();
        let (mut first_of, mut of_made) = (FxHashMap::default(), Vec::with_capacity(n));
        let mut codes: FxHashMap<u16, u32> = FxHashMap::default();
        // Places of roots, as soon as something is made beside them, and of those made; the longest residuals.
        let (mut near, mut longest, mut before) = (FxHashMap::default(), [0u64; 3], [0i64; 3]);
        let mut places: Vec<[i64; 3]> = Vec::with_capacity(n);
        for k in 0..n as u32 {
            let v = rows.vertex[k as usize];
            let made = v.checked_sub(base.0.checked_add(first)?);
            let last = match made {
                Some(m) => std::mem::replace(of_made.get_mut(m as usize)?, k),
                None => {
                    let root = of_roots.get_mut(&v)?;
                    if *root == NONE {
                        first_of.insert(v, k);
                    }
                    std::mem::replace(root, k)
                }
            };
            of_made.push(k);
            if let Some(next) = plan.next.get_mut(last as usize) {
                // Its second vertex is one that was not split since.
                next[usize::from(made == Some(last))] = k;
            }
            let [l, r] = rows.cuts[k as usize].map(|c| match (c >> 2).checked_sub(own) {
                _ if c == NONE => Some(NONE),
                None => {
                    plan.outside.push(c >> 2);
                    Some(NONE)
                }
                Some(f) => Some(f / 2).filter(|&m| m < k),
            });
            let needs = [last, l?, r?].into_iter().filter(|&d| d != NONE);
            plan.turn.push(needs.map(|d| 1 + plan.turn[d as usize]).max().unwrap_or(0));
            *codes.entry(rows.code[k as usize].0).or_default() += 1;
            let mut at = [0; 3];
            for axis in 0..3 {
                at[axis] = axes[axis].number(rows.place[k as usize][axis])?;
            }
            let from = match made {
                Some(m) => *places.get(m as usize)?,
                None => *near.entry(v).or_insert(at),
            };
            let from = if last == NONE { before } else { from };
            for axis in 0..3 {
                longest[axis] = longest[axis].max(zigzag(axes[axis].wrap(at[axis].wrapping_sub(from[axis]))));
            }
            before = at;
            places.push(at);
        }
        plan.shifts = longest.map(shift_for);
        for &v in &rows.roots {
            plan.roots.push((v, first_of.remove(&v)?));
        }
        plan.outside.sort_unstable();
        plan.outside.dedup();
        let mut codes: Vec<(u16, u32)> = codes.into_iter().collect();
        codes.sort_unstable_by_key(|&(code, n)| (std::cmp::Reverse(n), code));
        plan.codes = codes.into_iter().take(CODES).map(|c| c.0).collect();
        Some(plan)
    }
}

/// The splits of a chunk in an order in which [`write`] takes them: turn by turn, each in the one behind the last of those it depends on, in a turn by roots. `on` are what each
/// depends on of the chunk, before it, or [`NONE`]; `next` the next split of its vertex and the first of that which it makes; `roots` the first ones of vertices from before, in their order.
pub(super) fn arrange(on: &[[u32; 3]], next: &[[u32; 2]], roots: &[u32]) -> Vec<u32> {
    let mut turn: Vec<u32> = Vec::with_capacity(on.len());
    for on in on {
        turn.push(on.iter().filter_map(|&d| turn.get(d as usize)).map(|t| t + 1).max().unwrap_or(0));
    }
    // Of each turn the roots, the vertices as a reader numbers them, and the splits.
    let mut turns = vec![Vec::new(); turn.iter().max().map_or(0, |&t| t as usize + 1)];
    for (&t, root) in roots.iter().zip(0u32..) {
        turns[turn[t as usize] as usize].push((root, root, t));
    }
    let (mut order, count) = (Vec::with_capacity(on.len()), roots.len() as u32);
    for k in 0..turns.len() {
        let mut now = std::mem::take(&mut turns[k]);
        now.sort_unstable();
        for (root, v, t) in now {
            let made = count + order.len() as u32;
            for (n, v) in next[t as usize].into_iter().zip([v, made]).filter(|n| n.0 != NONE) {
                turns[turn[n as usize] as usize].push((root, v, n));
            }
            order.push(t);
        }
    }
    order
}

/// Writes a chunk; coordinates are multiples of `steps`, or floats that are, or any. `None` if the rows contradict each other, or are not in the order of [`arrange`].
pub(super) fn write(
    head: &MeshHead,
    rows: &Rows,
    steps: [f64; 3],
    (streams, bytes): (&mut [Encoder; STREAMS], &mut Vec<u8>),
) -> Option<Vec<u8>> {
    let axes = std::array::from_fn(|a| Axis::of(rows.place.iter().map(|p| p[a]), steps[a], head.double));
    let plan = Plan::new(rows, (head.base_vertices, head.base_faces), &axes)?;
    let mut codec = Codec::new(head, rows.first, axes);
    let count = rows.vertex.len() as u32;
    codec.head(streams, Some(&plan))?;
    codec.roots(&mut streams[CONNECTIVITY], Some(&plan), count)?;
    codec.faces(&mut streams[CONNECTIVITY], head, Some(&plan), count)?;
    codec.splits(streams, head, count, Some(&plan), |_, _, _, _, _| ())?;
    let mut out = Vec::new();
    axes.iter().for_each(|a| a.write(&mut out));
    for stream in streams {
        bytes.clear();
        stream.finish(bytes);
        put_varint(&mut out, bytes.len() as u64);
        out.extend_from_slice(bytes);
    }
    Some(out)
}

/// Bytes that reading a chunk of so many splits takes at most on the way, besides the arrays that come of it.
pub(crate) fn scratch(count: u32) -> u64 {
    // Twice as many vertices as splits; turns and those of a turn, which grow, faces from before, and faces made.
    let each = 2 * size_of::<Local>() + 3 * 4 + 3 * 8 + 2 * 8 + 4;
    // Codes, and few turns.
    each as u64 * u64::from(count) + size_of::<Codec>() as u64 + 256
}

/// Bytes of each stream.
pub(super) fn sizes(mut bytes: &[u8]) -> Option<[u64; STREAMS]> {
    Axis::three(&mut bytes)?;
    let mut sizes = [0; STREAMS];
    for size in &mut sizes {
        *size = take_varint(&mut bytes)?;
        bytes = bytes.get(usize::try_from(*size).ok()?..)?;
    }
    Some(sizes)
}

/// Reads a chunk. `None`: damage.
pub(super) fn read(
    head: &MeshHead,
    (first, first_face): (u32, u32),
    (count, raw): (u32, u64),
    mut bytes: &[u8],
) -> Option<SplitBlock> {
    let end = first.checked_add(count)?;
    let point = if head.double { 24 } else { 12 };
    let plain = head.channels.is_none() && !head.materials && !head.groups;
    // No more than was announced for the arrays, which goes with what is stored.
    if end > head.splits
        || first_face != head.first_face(first)
        || !plain
        || raw != u64::from(count) * (18 + point)
        || head.base_vertices.checked_add(end).is_none()
        || end.checked_mul(2).and_then(|f| f.checked_add(head.base_faces)).is_none_or(|f| f >= 1 << 30)
    {
        return None;
    }
    let axes = Axis::three(&mut bytes)?.map(|a| a.rounded(head.double));
    let mut next = || {
        let length = usize::try_from(take_varint(&mut bytes)?).ok()?;
        let (stream, rest) = bytes.split_at_checked(length)?;
        bytes = rest;
        Decoder::new(stream)
    };
    let mut streams = [next()?, next()?, next()?];
    let mut out = SplitBlock {
        first,
        first_face,
        first_wedge: head.base_wedges,
        new_positions: places::empty(head.double),
        moved_positions: places::empty(head.double),
        ..SplitBlock::default()
    };
    out.reserve(count as usize);
    let mut codec = Codec::new(head, first, axes);
    codec.head(&mut streams, None)?;
    codec.roots(&mut streams[CONNECTIVITY], None, count)?;
    codec.faces(&mut streams[CONNECTIVITY], head, None, count)?;
    codec.splits(&mut streams, head, count, None, |vertex, [left, right], code, level, place| {
        out.splits.vertex.push(vertex);
        out.splits.left.push(left);
        out.splits.right.push(right);
        out.splits.code.push(code);
        out.splits.error.push(f32::from_bits(u32::from(level) << ERROR_SHIFT));
        places::push(&mut out.new_positions, place);
    })?;
    Some(out).filter(|_| !streams.iter().any(Coder::spent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BASE: (u32, u32) = (5, 3);

    /// Splits before the chunk, and those of it: which vertex, which faces, as shares of what there is; the edges; one face only; the level; the place.
    type Given = (Vec<bool>, Vec<(f64, [f64; 2], u8, bool, u16, [i16; 3])>);

    fn given() -> impl Strategy<Value = Given> {
        let share = 0.0..1.0f64;
        let split = (
            share.clone(),
            [share.clone(), share],
            0u8..9,
            prop::bool::weighted(0.1),
            0..=MOST_LEVEL,
            prop::array::uniform3(any::<i16>()),
        );
        (prop::collection::vec(any::<bool>(), 0..40), prop::collection::vec(split, 1..80))
    }

    /// A head, rows in the order of [`arrange`], and what is to be read.
    fn rows(
        (before, splits): &Given,
        double: bool,
        place: impl Fn([i16; 3]) -> [f64; 3],
    ) -> (MeshHead, Rows, SplitBlock) {
        let (first, n) = (before.len() as u32, splits.len());
        let own = BASE.1 + 2 * first;
        // As they come: vertices and faces of the chunk are numbered behind those before.
        let mut last: Vec<u32> = vec![NONE; (BASE.0 + first) as usize];
        let mut faces: Vec<u32> = (0..BASE.1).collect();
        for (i, &single) in (0..first).zip(before) {
            faces.push(BASE.1 + 2 * i);
            faces.extend(Some(BASE.1 + 2 * i + 1).filter(|_| !single));
        }
        let (mut on, mut next, mut roots) = (vec![], vec![[NONE; 2]; n], vec![]);
        let mut all = vec![];
        for (t, &(v, cuts, edges, single, level, at)) in (0u32..).zip(splits) {
            let v = (v * last.len() as f64) as usize;
            let before = std::mem::replace(&mut last[v], t);
            match next.get_mut(before as usize) {
                Some(next) => next[usize::from(v as u32 == BASE.0 + first + before)] = t,
                None => roots.push((v, t)),
            }
            let cuts = cuts.map(|c| faces[(c * faces.len() as f64) as usize]);
            let maker = |f: u32| f.checked_sub(own).map_or(NONE, |f| f / 2);
            let right = if single { NONE } else { cuts[1] << 2 | u32::from(edges % 3) };
            on.push([before, maker(cuts[0]), if single { NONE } else { maker(cuts[1]) }]);
            // More codes than have symbols.
            let code =
                u16::from(edges) << 7 | at[0] as u16 & 7 | if single { 0 } else { SplitCode::TWO_FACES };
            all.push((
                v as u32,
                [cuts[0] << 2 | u32::from(edges / 3), right],
                SplitCode(code),
                level,
                place(at),
            ));
            last.push(t);
            faces.push(own + 2 * t);
            faces.extend(Some(own + 2 * t + 1).filter(|_| !single));
        }
        roots.reverse();
        let order = arrange(&on, &next, &roots.iter().map(|r| r.1).collect::<Vec<_>>());
        assert_eq!(order.len(), n);
        let mut slot = vec![0; n];
        order.iter().zip(0..).for_each(|(&t, k)| slot[t as usize] = k);
        let mut single: Vec<u32> = before.iter().zip(0..).filter(|(s, _)| **s).map(|(_, i)| i).collect();
        single.extend(order.iter().zip(first..).filter(|(t, _)| splits[**t as usize].3).map(|(_, i)| i));
        let head = MeshHead {
            splits: first + n as u32,
            base_vertices: BASE.0,
            base_faces: BASE.1,
            base_wedges: BASE.0,
            double,
            single,
            ..MeshHead::default()
        };
        // Roots come in any order.
        let mut rows = Rows { first, roots: roots.iter().map(|r| r.0 as u32).collect(), ..Rows::default() };
        let mut want = SplitBlock {
            first,
            first_face: head.first_face(first),
            first_wedge: BASE.0,
            new_positions: places::empty(double),
            moved_positions: places::empty(double),
            ..SplitBlock::default()
        };
        for &t in &order {
            let (v, cuts, code, level, place) = all[t as usize];
            let vertex = v.checked_sub(BASE.0 + first).map_or(v, |m| BASE.0 + first + slot[m as usize]);
            let cuts = cuts.map(|c| match (c >> 2).checked_sub(own) {
                Some(f) if c != NONE => (own + 2 * slot[f as usize / 2] + f % 2) << 2 | c & 3,
                _ => c,
            });
            let [left, right] = cuts.map(|c| match (c >> 2).checked_sub(BASE.1) {
                Some(f) if c != NONE => (head.first_face(f / 2) + f % 2) << 2 | c & 3,
                _ => c,
            });
            rows.vertex.push(vertex);
            rows.cuts.push(cuts);
            rows.code.push(code);
            rows.level.push(level);
            rows.place.push(place);
            want.splits.vertex.push(vertex);
            want.splits.left.push(left);
            want.splits.right.push(right);
            want.splits.code.push(code);
            want.splits.error.push(f32::from_bits(u32::from(level) << ERROR_SHIFT));
            places::push(&mut want.new_positions, place);
        }
        (head, rows, want)
    }

    fn written(head: &MeshHead, rows: &Rows, steps: [f64; 3]) -> Option<Vec<u8>> {
        write(head, rows, steps, (&mut Default::default(), &mut Vec::new()))
    }

    fn again(head: &MeshHead, block: &SplitBlock, bytes: &[u8]) -> Option<SplitBlock> {
        let n = block.splits.len() as u32;
        let raw = u64::from(n) * if head.double { 42 } else { 30 };
        read(head, (block.first, block.first_face), (n, raw), bytes)
    }

    /// Whole steps, what fits into an f32 times a step, and anything.
    fn places_by(kind: usize, double: bool) -> impl Fn([i16; 3]) -> [f64; 3] {
        move |at| {
            let of = |k: usize, step: f64| match kind {
                0 => f64::from(at[k]) * step,
                1 => f64::from(f32::from_bits((at[k] as u32) << 11 ^ 0x4123_4567)) * step,
                _ => f64::from_bits((at[k] as u64) << 40 ^ 0x4012_3456_789A_BCDE),
            };
            let x = [of(0, 1.0), of(1, 0.1), of(2, 1.25)];
            if double { x } else { x.map(|x| f64::from(x as f32)) }
        }
    }

    proptest! {
        #[test]
        fn what_was_written_is_read(of in given(), kind in 0usize..3, double in any::<bool>()) {
            let (head, rows, want) = rows(&of, double, places_by(kind, double));
            let bytes = written(&head, &rows, [1.0, 0.1, 1.25]).unwrap();
            prop_assert_eq!(again(&head, &want, &bytes), Some(want.clone()));
            // Whatever the steps.
            let bytes = written(&head, &rows, [f64::NAN, -1.0, 1e300]).unwrap();
            prop_assert_eq!(again(&head, &want, &bytes), Some(want));
        }

        #[test]
        fn damage_is_none_or_something_else(of in given(), cut in any::<prop::sample::Index>(), bit in any::<prop::sample::Index>()) {
            let (head, rows, want) = rows(&of, false, places_by(0, false));
            let bytes = written(&head, &rows, [1.0; 3]).unwrap();
            prop_assert_eq!(again(&head, &want, &bytes[..cut.index(bytes.len())]), None);
            let mut other = bytes.clone();
            other[bit.index(8 * bytes.len()) / 8] ^= 1 << (bit.index(8 * bytes.len()) % 8);
            if let Some(block) = again(&head, &want, &other) {
                // All that is referred to was made before.
                let (mut face, s) = (block.first_face, &block.splits);
                for k in 0..s.len() {
                    prop_assert!(s.vertex[k] < BASE.0 + block.first + k as u32);
                    prop_assert!(s.left[k] >> 2 < face && s.left[k] & 3 < 3);
                    prop_assert!(s.right[k] == NONE || s.right[k] >> 2 < face && s.right[k] & 3 < 3);
                    prop_assert_eq!(s.right[k] != NONE, s.code[k].two_faces());
                    prop_assert!(is_plain(s.code[k]));
                    face += 1 + u32::from(s.code[k].two_faces());
                }
                prop_assert_eq!(s.len(), want.splits.len());
            }
        }
    }

    #[test]
    fn another_order_is_not_written() {
        let split = |v: f64| (v, [0.0; 2], 0, false, 5, [0; 3]);
        let (head, mut rows, _) = rows(&(vec![], vec![split(0.0), split(0.3)]), false, places_by(0, false));
        assert!(written(&head, &rows, [1.0; 3]).is_some());
        rows.vertex.reverse();
        assert!(written(&head, &rows, [1.0; 3]).is_none());
        // Of a split that comes later.
        rows.vertex.reverse();
        rows.cuts[0][0] = (BASE.1 + 2) << 2;
        assert!(written(&head, &rows, [1.0; 3]).is_none());
    }

    #[test]
    fn splits_that_do_more_are_neither_written_nor_read() {
        let split = (0.0, [0.0; 2], 0, false, 5, [0; 3]);
        let (head, mut rows, want) = rows(&(vec![], vec![split]), false, places_by(0, false));
        let plain = rows.code[0];
        let mut bytes = written(&head, &rows, [1.0; 3]).unwrap();
        for more in [SplitCode::MOVES, SplitCode::ROWS, 1 << SplitCode::KIND, 2 << SplitCode::KIND] {
            rows.code[0] = SplitCode(plain.0 | more);
            assert!(written(&head, &rows, [1.0; 3]).is_none());
        }
        assert!(again(&head, &want, &bytes).is_some());
        // The plain bits of the stream of connectivity, its last, begin with how many codes there are and the first.
        let start = 27 + 1;
        let words = usize::from(bytes[start]);
        let at = start + 1 + words;
        assert_eq!(u16::from_le_bytes([bytes[at], bytes[at + 1]]) >> 4, plain.0 & 0xFFF);
        bytes[at + 2] ^= (SplitCode::MOVES >> 12) as u8;
        assert!(again(&head, &want, &bytes).is_none());
    }

    #[test]
    fn splits_in_a_chain_wait_for_as_many_turns_as_there_are() {
        // Each is cut at a face of the one before, of a vertex of its own: the last waits longer than symbols tell.
        let mut rows = Rows::default();
        for k in 0..30 {
            rows.roots.push(k);
            rows.vertex.push(k);
            rows.cuts.push([if k == 0 { 0 } else { (1 + 2 * (k - 1)) << 2 }, 0]);
            rows.code.push(SplitCode(SplitCode::TWO_FACES));
            rows.level.push(0);
            rows.place.push([f64::from(k), -0.0, 1e9]);
        }
        let head = MeshHead { splits: 30, base_vertices: 30, base_faces: 1, ..MeshHead::default() };
        let bytes = written(&head, &rows, [1.0; 3]).unwrap();
        let block = read(&head, (0, 1), (30, 900), &bytes).unwrap();
        assert_eq!(block.splits.vertex, rows.vertex);
        assert_eq!(
            block.new_positions.get(7).to_array().map(f64::to_bits),
            [7.0, -0.0, 1e9].map(f64::to_bits)
        );
        // Beside three axes and lengths of streams.
        let streams = sizes(&bytes).unwrap().iter().sum::<u64>() as usize;
        assert!((3..=6).contains(&(bytes.len() - 27 - streams)));
        // What is announced is what is there.
        assert!(read(&head, (0, 1), (29, 870), &bytes).is_none());
        assert!(read(&head, (0, 1), (30, 899), &bytes).is_none());
        assert!(read(&head, (0, 0), (30, 900), &bytes).is_none());
        let with = MeshHead { groups: true, ..head.clone() };
        assert!(read(&with, (0, 1), (30, 900), &bytes).is_none());
    }
}
