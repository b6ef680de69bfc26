//! Which pages are there; fetching, and letting go.

use super::PagedError;
use super::ahead::{Ahead, FIRST, GUESS, Made};
use super::page::{Base, Page, Record, RowRef};
use super::pool::{APPLIED, Hot, LED, NEEDS, Pool};
use crate::aif::NONE;
use crate::format::{
    ByteRanges, CONTRADICTS, Chunk, ChunkType, FormatError, MeshHead, Piece, RangeReader, Room, direct,
    pages, read_piece, read_piece_within,
};
use crate::hierarchy::{Guarantee, Packed};
use crate::progressive::{Damage, Fans, link_faces};
use crate::selective::Entry;
use glam::{DVec3, Vec3};
use std::borrow::Cow;
use std::sync::Arc;

/// What a view has read. Of pages made ahead by other threads those that were asked for in the end: so the same for any number of threads. Others were read in vain, and are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Traffic {
    /// Bytes fetched, those fetched again counted again; head, directory and base in.
    pub bytes_read: u64,
    /// Bytes of the file that were fetched at least once.
    pub bytes_touched: u64,
    /// Requests for ranges of bytes.
    pub requests: u64,
    /// Chunks of splits that were decoded, those decoded again counted again.
    pub chunks_decoded: u64,
    /// Chunks of splits that were decoded at least once.
    pub chunks_touched: u64,
    /// Pages that had to go.
    pub evictions: u64,
}

/// A chunk of splits, with the `BNDS` and the `PAGE` behind it.
#[derive(Clone, Copy, Debug)]
struct ChunkAt {
    /// Its place in the directory.
    index: u32,
    first_wedge: u32,
    /// The most that the page takes.
    most: usize,
    touched: bool,
}

/// The mesh's chunks, and those of them that are in memory.
#[derive(Debug)]
pub(super) struct Shelf<S> {
    reader: Arc<RangeReader<S>>,
    pub(super) head: Arc<MeshHead>,
    pub(super) base: Base,
    chunks: Vec<ChunkAt>,
    /// The first split of each, and the number of all.
    firsts: Vec<u32>,
    /// The chunk that holds every 1024th split.
    index: Vec<u32>,
    pages: Vec<Option<Box<Page>>>,
    /// What is asked for or drawn of them.
    pub(super) pool: Pool,
    /// Bytes of the pages that are there.
    held: usize,
    resident: usize,
    /// Counts closures: pages used in the present one stay.
    pub(super) clock: u64,
    /// A split may move its vertex.
    pub(super) moves: bool,
    scratch: usize,
    pub(super) traffic: Traffic,
    ahead: Ahead,
    /// Counts frames.
    frame: u64,
    /// In this frame pages are made ahead.
    pub(super) looks_ahead: bool,
}

/// What a page is made of, and with how much room.
pub(super) struct OnWay {
    chunk: Chunk,
    bounds: Chunk,
    beside: Chunk,
    room: Room,
    /// Its bounds are for the ring rule.
    settled: bool,
    /// Bounds are about it.
    origin: DVec3,
}

impl OnWay {
    /// Of a chunk of splits, its `BNDS` and its `PAGE`.
    pub(super) fn new(
        [chunk, bounds, beside]: [Chunk; 3],
        room: Room,
        settled: bool,
        origin: DVec3,
    ) -> OnWay {
        OnWay { chunk, bounds, beside, room, settled, origin }
    }
}

/// Fetches and decodes a page.
///
/// Errors: damage, which too little room cannot be told from; the source's.
pub(super) fn read_page(source: &(impl ByteRanges + ?Sized), head: &MeshHead, way: &OnWay) -> Made {
    let OnWay { chunk, bounds, beside, room, settled, origin } = way;
    // One range: they stand side by side.
    let bytes = source.fetch(chunk.offset..beside.range().end).map_err(FormatError::from)?;
    let part = |c: &Chunk| {
        let end = (c.range().end - chunk.offset).min(bytes.len() as u64) as usize;
        &bytes[((c.offset - chunk.offset) as usize).min(end)..end]
    };
    let block = match read_piece_within(chunk, Some(head), part(chunk), *room)? {
        Piece::Splits(block) => block,
        _ => return Err(chunk.damage("it is no chunk of splits").into()),
    };
    let own = match read_piece(bounds, None, part(bounds))? {
        Piece::Bounds(own) if (own.guarantee() == Guarantee::Settled) == *settled => own,
        Piece::Bounds(_) => {
            return Err(bounds.damage("its bounds are for another rule than the mesh's").into());
        }
        _ => return Err(bounds.damage("it holds no bounds").into()),
    };
    beside.check(part(beside))?;
    let damaged = |c: &Chunk| c.damage(CONTRADICTS);
    let known = (&block.splits.vertex[..], pages::Own::of(&own));
    let links =
        pages::read(head, chunk.first, known, beside.raw, part(beside)).ok_or_else(|| damaged(beside))?;
    if head.channels.is_some() && block.first_wedge != beside.first_face {
        return Err(damaged(beside).into());
    }
    let page = Page::new(head, *origin, *block, own.of, links).ok_or_else(|| damaged(chunk))?;
    Ok((page, bytes.len() as u64))
}

/// Where a split is that is to be applied, found before.
#[derive(Clone, Copy, Debug)]
pub(super) struct AtHand {
    pub(super) chunk: u32,
    pub(super) k: u32,
    /// The record of the split that makes its vertex; [`NONE`] of the base.
    pub(super) maker: u32,
    /// Those of what it depends on.
    pub(super) needs: [u32; NEEDS],
    /// All of what it depends on has a record, and all are named.
    pub(super) whole: bool,
}

/// Frames in which all pages are asked once: less than pages are foreseen by.
const ASKED: u64 = 4;

/// Pages that are foreseen in a frame, at most.
const FORESEEN: usize = 64;

/// Splits between two entries of the index.
const STRIDE: usize = 1024;

/// Bytes that decoding a chunk of splits with its `BNDS` and its `PAGE`, the last, takes at most on the way, besides the page that comes of it: what is fetched, and what the decoders hold.
fn on_the_way(head: &MeshHead, [c, page]: [&Chunk; 2], room: Room, settled: bool) -> usize {
    let fetched = page.range().end.saturating_sub(c.offset);
    // One after the other, but what was read first is there.
    // And until the page is put together, what it is put together from is there.
    // Turns, and which way deviations lie.
    let more = 2 + 4 * u64::from(settled);
    let parts = (18 + 24 + pages::SPLIT + size_of::<Packed>() as u64 + more) * c.count as u64;
    let beside = pages::scratch(c.count, page.raw, settled).max(parts);
    let way = match c.kind {
        ChunkType::DIRECT => direct::scratch(c.count),
        _ => room.bytes(head, c),
    };
    let all = fetched.saturating_add(way).saturating_add(beside);
    usize::try_from(all).unwrap_or(usize::MAX / 4)
}

/// The chunk of split `i`, given the first of each and the number of all, and the chunk of every [`STRIDE`]th; of none there is, one more than there are.
#[inline]
fn chunk_of(i: u32, firsts: &[u32], index: &[u32]) -> usize {
    if firsts.last().is_none_or(|&all| i >= all) {
        return firsts.len().saturating_sub(1);
    }
    let mut k = index.get(i as usize / STRIDE).map_or(0, |&k| k as usize);
    while firsts.get(k + 1).is_some_and(|&first| first <= i) {
        k += 1;
    }
    k
}

/// What it takes to get a page.
pub(super) enum Fetch {
    /// It is there.
    There,
    /// It is to be fetched, and then takes so many bytes at most.
    Missing(usize),
}

impl<S> Shelf<S> {
    /// Resident pages, ascending, and what is asked for or drawn of them.
    pub(super) fn with_pool(&mut self) -> (impl Iterator<Item = &mut Page>, &mut Pool) {
        (self.pages.iter_mut().filter_map(|p| p.as_deref_mut()), &mut self.pool)
    }
}

impl<S: ByteRanges> Shelf<S> {
    /// With the base, and its faces.
    pub(super) fn new(reader: Arc<RangeReader<S>>, m: u32) -> Result<(Self, Fans), PagedError> {
        let directory = reader.directory();
        let mut traffic = Traffic {
            bytes_read: directory.bytes(),
            requests: 2,
            bytes_touched: directory.bytes(),
            ..Default::default()
        };
        let of = |c: &&Chunk| c.kind == ChunkType::BASE && c.mesh == m;
        let base_chunk = *directory.chunks.iter().find(of).ok_or(FormatError::Head("no such mesh"))?;
        let behind = |c: &Chunk, by: usize, kind: ChunkType| {
            let next = directory.chunks.get(c.index as usize + by);
            next.filter(|p| p.kind == kind && p.mesh == m).copied().ok_or(PagedError::NoPages)
        };
        let base_page = behind(&base_chunk, 1, ChunkType::PAGE)?;
        let (head, mut mesh) = reader.base(m)?;
        let bytes = reader.source().fetch(base_page.range()).map_err(FormatError::from)?;
        base_page.check(&bytes)?;
        let links =
            pages::read_base(&head, base_page.raw, &bytes).ok_or_else(|| base_page.damage(CONTRADICTS))?;
        traffic.requests += 2;
        traffic.bytes_read += base_chunk.stored + base_page.stored;
        traffic.bytes_touched = traffic.bytes_read;
        let numbers = |n: u32| head.splits.checked_mul(2).and_then(|s| s.checked_add(n));
        if numbers(head.base_vertices).is_none() || numbers(head.base_faces).is_none_or(|f| f >= 1 << 29) {
            return Err(FormatError::Head("more splits than ids can name").into());
        }
        let point = if head.double { 24 } else { 12 };
        let (mut chunks, mut index, mut moves, mut scratch) = (Vec::new(), Vec::new(), false, 0);
        let mut firsts = Vec::new();
        let mut all = Vec::new();
        for c in directory.chunks.iter().filter(|c| c.mesh == m) {
            match c.kind {
                kind if kind.is_read_alone() => {
                    let bounds = behind(c, 1, ChunkType::BOUNDS)?;
                    if (bounds.first, bounds.count) != (c.first, c.count) {
                        return Err(bounds.damage("it is not that of the chunk before").into());
                    }
                    all.push((*c, behind(c, 2, ChunkType::PAGE)?));
                }
                ChunkType::SEQUEL => return Err(PagedError::NoPages),
                _ => {}
            }
        }
        let full = all.last().map_or(0, |(c, _)| c.first.saturating_add(c.count));
        if full != head.splits {
            return Err(FormatError::Head("its splits are not all there").into());
        }
        // Wedges at full detail are not known; a row takes 8 bytes at least.
        let last_wedges = all.last().map_or(0, |(c, _)| (c.raw / 8).min(u32::MAX as u64) as u32);
        for (k, &(c, p)) in all.iter().enumerate() {
            let next = all.get(k + 1).map(|n| &n.1);
            let wedges = match next {
                _ if head.channels.is_none() => 0,
                None => last_wedges,
                Some(n) => n
                    .first_face
                    .checked_sub(p.first_face)
                    .ok_or_else(|| p.damage("its wedges do not follow those before"))?,
            };
            moves |= c.raw != c.count as u64 * (18 + point);
            scratch = scratch.max(on_the_way(&head, [&c, &p], Room::usual(c.count), links.settled));
            while index.len() * STRIDE < (c.first + c.count) as usize {
                index.push(k as u32);
            }
            firsts.push(c.first);
            chunks.push(ChunkAt {
                index: c.index,
                first_wedge: p.first_face,
                most: Page::most_bytes(c.raw, p.raw, point, c.count, wedges),
                touched: false,
            });
        }
        firsts.push(full);
        let faces: Vec<[u32; 3]> = match &mesh.wedges {
            None => mesh.base_faces.clone(),
            Some(w) => {
                let of = |w: &Vec<u32>, k: u32| w.get(k as usize).copied().unwrap_or(0);
                mesh.base_faces.iter().map(|f| f.map(|k| of(&w.base_vertex, k))).collect()
            }
        };
        let corners = std::mem::take(&mut mesh.base_faces);
        let wedges = head.base_wedges;
        if corners.iter().flatten().any(|&w| w >= wedges) {
            return Err(base_chunk.damage(CONTRADICTS).into());
        }
        let links_of_faces = link_faces(&faces, mesh.base_vertices());
        let base = Base::new(mesh, links);
        let pages = chunks.iter().map(|_| None).collect();
        let shelf = Shelf {
            head: Arc::new(head),
            base,
            chunks,
            firsts,
            index,
            pages,
            pool: Pool::default(),
            held: 0,
            resident: 0,
            clock: 0,
            moves,
            scratch,
            traffic,
            reader,
            ahead: Ahead::new(None, 0, 0, 0),
            frame: 0,
            looks_ahead: false,
        };
        Ok((shelf, Fans { corners, links: links_of_faces }))
    }

    /// Bytes held; with the mesh's part of the directory of the file.
    pub(super) fn bytes(&self) -> usize {
        let directory = self.reader.directory();
        let head = 4 * (self.head.single.capacity() + self.head.levels.capacity());
        self.base.bytes()
            + usize::try_from(Room::base_bytes(&self.head)).unwrap_or(usize::MAX / 4)
            + head
            + size_of::<ChunkAt>() * self.chunks.capacity()
            + 4 * (self.index.capacity() + self.firsts.capacity())
            + 8 * self.pages.capacity()
            + size_of::<Chunk>() * directory.chunks.capacity() / (directory.meshes as usize).max(1)
            + self.held
            + size_of::<Hot>() * self.pool.of.capacity()
            + self.ahead.bytes()
    }

    /// Of so many bytes that are free sets some aside for pages that are made ahead, if there are enough.
    pub(super) fn set_aside(&mut self, free: usize) {
        self.ahead = Ahead::new(self.reader.source().shared(), free, self.most_of_a_page(), self.scratch);
    }

    /// What is shown finds no room: no more is set aside than must be.
    pub(super) fn set_aside_least(&mut self) {
        if let Some(room) = self.ahead.least() {
            let (source, most) = (self.reader.source().shared(), self.most_of_a_page());
            self.ahead = Ahead::within(source, room, most, self.scratch);
        }
    }

    /// Bytes.
    fn most_of_a_page(&self) -> usize {
        self.chunks.iter().map(|c| c.most).max().unwrap_or(0)
    }

    /// A frame begins.
    pub(super) fn next_frame(&mut self) {
        self.clock += 1;
        self.frame += 1;
        self.looks_ahead = self.ahead.works();
    }

    /// This is the first frame: how lenses move is not known.
    pub(super) fn is_first_frame(&self) -> bool {
        self.frame == FIRST
    }

    /// The page of split `i` is not there.
    #[inline]
    pub(super) fn is_missing(&self, i: u32) -> bool {
        self.pages.get(self.chunk_of(i)).is_none_or(|p| p.is_none())
    }

    /// Has the page of split `i` made ahead if it is not there and there is room for it, soon if it is needed `now`; says whether it is there, or will be.
    pub(super) fn wish(&mut self, i: u32, now: bool) -> bool {
        let c = self.chunk_of(i);
        if self.pages.get(c).is_none_or(|p| p.is_some()) {
            return true;
        }
        let Ok(way) = self.way(i, false) else { return false };
        let frame = if !now && self.is_first_frame() { GUESS } else { self.frame };
        self.ahead.wish(c, (frame, now), &self.head, way)
    }

    /// Has pages made ahead that hold what is wanted some frames on, as far as pages that are there tell; a part of these is asked in each frame.
    pub(super) fn foresee(&mut self, wants: impl Fn(&Entry) -> bool) {
        let (mut seen, mut n) = ([0; FORESEEN], 0);
        let (all, from) = (self.pages.len(), (self.frame % ASKED) as usize);
        for page in (from..all).step_by(ASKED as usize).filter_map(|c| self.page_of_chunk(c)) {
            let missing = |c: usize| self.pages.get(c).is_some_and(|p| p.is_none());
            page.in_sight(missing, &wants, |c| {
                if n < seen.len() && !seen[..n].contains(&c) {
                    seen[n] = c;
                    n += 1;
                }
            });
        }
        for &c in &seen[..n] {
            if let Some(&first) = self.firsts.get(c) {
                self.wish(first, false);
            }
        }
    }

    pub(super) fn directory_bytes(&self) -> u64 {
        self.reader.directory().bytes()
    }

    /// What is set aside for decoding a chunk: what it takes on the way, at most.
    pub(super) fn most_at_once(&self) -> usize {
        self.scratch
    }

    pub(super) fn resident(&self) -> usize {
        self.resident
    }

    /// The chunk of split `i`; of none there is, one more than there are.
    #[inline]
    fn chunk_of(&self, i: u32) -> usize {
        chunk_of(i, &self.firsts, &self.index)
    }

    /// Says of splits if their pages are not there.
    pub(super) fn missing(&self) -> impl Fn(u32) -> bool + Sync + '_ {
        let (firsts, index, pages) = (&self.firsts[..], &self.index[..], &self.pages[..]);
        move |i| pages.get(chunk_of(i, firsts, index)).is_none_or(|p| p.is_none())
    }

    /// The page of split `i` if it is there, and the split's place in it.
    #[inline]
    pub(super) fn page(&self, i: u32) -> Option<(&Page, usize)> {
        let page = self.pages.get(self.chunk_of(i))?.as_deref()?;
        let k = i.wrapping_sub(page.first) as usize;
        (k < page.of.len()).then_some((page, k))
    }

    /// Split `i`, if its page is there.
    #[inline]
    pub(super) fn record(&self, i: u32) -> Option<&Record> {
        self.page(i).map(|(p, k)| &p.of[k])
    }

    #[inline]
    pub(super) fn page_mut(&mut self, i: u32) -> Option<(&mut Page, usize)> {
        let c = self.chunk_of(i);
        let page = self.pages.get_mut(c)?.as_deref_mut()?;
        let k = i.wrapping_sub(page.first) as usize;
        (k < page.of.len()).then_some((page, k))
    }

    /// Chunks of splits.
    pub(super) fn chunk_count(&self) -> usize {
        self.chunks.len()
    }

    /// The page of a chunk, if it is there.
    pub(super) fn page_of_chunk(&self, chunk: usize) -> Option<&Page> {
        self.pages.get(chunk).and_then(|p| p.as_deref())
    }

    /// The flags of split `i`; none of one that is neither asked for nor drawn.
    pub(super) fn flags(&self, i: u32) -> u8 {
        self.hot_of(i).map_or(0, |h| h.flags)
    }

    /// The record in the pool of split `i`; [`NONE`] of one that is neither asked for nor drawn.
    #[inline]
    pub(super) fn hot(&self, i: u32) -> u32 {
        self.page(i).map_or(NONE, |(p, k)| p.hot[k])
    }

    #[inline]
    pub(super) fn hot_of(&self, i: u32) -> Option<&Hot> {
        self.pool.get(self.hot(i))
    }

    /// A split that is at hand is asked for: it has a record from now on, if it has none. The second says if the pool has grown.
    pub(super) fn come(&mut self, i: u32, at: &AtHand, needs: &[u32]) -> Option<(u32, bool)> {
        let page = self.pages.get_mut(at.chunk as usize)?.as_deref_mut()?;
        let (r, hot) = (page.of.get(at.k as usize)?, page.hot.get_mut(at.k as usize)?);
        if *hot != NONE {
            return Some((*hot, false));
        }
        let mut named = [NONE; NEEDS];
        named.iter_mut().zip(needs).for_each(|(n, &h)| *n = h);
        let (h, more) = self.pool.put(Hot {
            split: i,
            node: NONE,
            needs: named,
            vertex: r.vertex,
            maker: at.maker,
            parent: r.parent,
            dependents: 0,
            holders: 0,
            code: r.code,
            flags: LED,
            more: needs.len() > NEEDS,
        });
        *hot = h;
        page.in_use += 1;
        Some((h, more))
    }

    /// Where split `i` is, if its page is there, and the records of what it depends on, if all has them and can be named.
    pub(super) fn at_hand(&self, i: u32) -> Option<AtHand> {
        let chunk = self.chunk_of(i);
        let page = self.pages.get(chunk)?.as_deref()?;
        let k = i.wrapping_sub(page.first);
        let r = page.of.get(k as usize)?;
        let hot = |d: u32| match page.hot.get(d.wrapping_sub(page.first) as usize) {
            Some(&h) => h,
            None => self.hot(d),
        };
        let maker = r.vertex.checked_sub(self.head.base_vertices).map_or(NONE, hot);
        let (mut needs, mut whole) = ([NONE; NEEDS], true);
        for (need, d) in needs.iter_mut().zip(self.needs_of(r)).filter(|(_, d)| *d != NONE) {
            *need = hot(d);
            whole &= *need != NONE;
        }
        if self.by_rings() {
            let further = page.further.of(k as usize);
            whole &= further.len() <= NEEDS - 3;
            for (need, &d) in needs[3..].iter_mut().zip(further) {
                *need = hot(d);
                whole &= *need != NONE;
            }
        }
        Some(AtHand { chunk: chunk as u32, k, maker, needs, whole })
    }

    /// What the file says of a split that is at hand, if its page is still there; it is in use.
    #[inline]
    pub(super) fn use_page(&mut self, at: &AtHand) -> Option<&Page> {
        let clock = self.clock;
        let page = self.pages.get_mut(at.chunk as usize)?.as_deref_mut()?;
        page.stamp = clock;
        Some(page)
    }

    /// What is neither asked for nor drawn any more has no record.
    pub(super) fn go(&mut self, h: u32) {
        let Some(i) = self.pool.of.get(h as usize).map(|r| r.split) else { return };
        let clock = self.clock;
        if let Some((page, k)) = self.page_mut(i) {
            page.hot[k] = NONE;
            page.in_use -= 1;
            page.stamp = clock;
        }
        self.pool.take_out(h);
    }

    /// The records of all that split `i` depends on, what makes its node and the faces of its cuts first; [`NONE`] of the base, and of what has none.
    ///
    /// Errors: its page is not there.
    pub(super) fn needs_into(&self, i: u32, out: &mut Vec<u32>) -> Result<(), Damage> {
        out.clear();
        let (page, k) = self.page(i).ok_or(Damage::Fan(i as usize))?;
        let first = self.needs_of(&page.of[k]);
        let hot = |&d: &u32| if d == NONE { NONE } else { self.hot(d) };
        out.extend(first.iter().chain(self.further(i)).map(hot));
        Ok(())
    }

    /// The same of a record; of its split, whose page is there.
    pub(super) fn needs_of_hot(&self, h: u32, out: &mut Vec<u32>) -> Result<(), Damage> {
        let Some(r) = self.pool.get(h) else { return Err(Damage::Fan(h as usize)) };
        if r.more {
            return self.needs_into(r.split, out);
        }
        out.clear();
        out.extend_from_slice(&r.needs);
        Ok(())
    }

    /// What it takes to have the page of split `i`. Notes that it is in use.
    pub(super) fn ask(&mut self, i: u32) -> Fetch {
        let (c, clock) = (self.chunk_of(i), self.clock);
        match self.pages.get_mut(c) {
            Some(Some(page)) => {
                page.stamp = clock;
                Fetch::There
            }
            _ => Fetch::Missing(self.chunks.get(c).map_or(0, |c| c.most)),
        }
    }

    /// What the directory says of the chunk of split `i`, and of the two behind it.
    fn entries(&self, i: u32) -> Result<[Chunk; 3], PagedError> {
        let place = self.chunks.get(self.chunk_of(i)).map_or(0, |c| c.index as usize);
        match self.reader.directory().chunks.get(place..place + 3) {
            Some(&[chunk, bounds, beside]) => Ok([chunk, bounds, beside]),
            _ => Err(FormatError::Head("no such chunk").into()),
        }
    }

    /// What decoding the chunk of split `i` takes on the way beyond [`Shelf::most_at_once`], if it takes all that the format allows.
    pub(super) fn most_beyond(&self, i: u32) -> Result<usize, PagedError> {
        let [chunk, _, beside] = self.entries(i)?;
        let all = on_the_way(&self.head, [&chunk, &beside], Room::ANY, self.by_rings());
        Ok(all.saturating_sub(self.scratch))
    }

    /// What the page of split `i` is made of.
    fn way(&self, i: u32, all: bool) -> Result<OnWay, PagedError> {
        let entries = self.entries(i)?;
        let room = if all { Room::ANY } else { Room::usual(entries[0].count) };
        Ok(OnWay::new(entries, room, self.by_rings(), self.base.links.origin))
    }

    /// Fetches and decodes the page of split `i`, taking on the way as much as [`Shelf::most_at_once`] says; `all`: whatever it takes ([`Shelf::most_beyond`]). Pages that were made ahead are taken as they are.
    ///
    /// Errors: damage, which too little room cannot be told from; the source's.
    pub(super) fn fetch(&mut self, i: u32, all: bool) -> Result<(), PagedError> {
        let (at, way) = (self.chunk_of(i), self.way(i, all)?);
        self.traffic.requests += 1;
        self.traffic.bytes_read += way.beside.range().end.saturating_sub(way.chunk.offset);
        let made = self.ahead.take(at).filter(|_| !all);
        let made = made.unwrap_or_else(|| read_page(self.reader.source(), &self.head, &way));
        if all {
            // What has grown beyond what is set aside is not kept.
            self.head.start.forget();
        }
        let (mut page, bytes) = made?;
        page.stamp = self.clock;
        page.look_out(&self.firsts);
        self.held += page.bytes();
        self.resident += 1;
        self.traffic.chunks_decoded += 1;
        if let Some(c) = self.chunks.get_mut(at).filter(|c| !c.touched) {
            c.touched = true;
            self.traffic.chunks_touched += 1;
            self.traffic.bytes_touched += bytes;
        }
        self.pages[at] = Some(Box::new(page));
        Ok(())
    }

    /// Drops the page that was used longest ago and of which nothing is in use; false if there is none.
    pub(super) fn evict_one(&mut self) -> bool {
        let clock = self.clock;
        let idle = |p: &&(usize, &Page)| p.1.in_use == 0 && p.1.stamp < clock;
        let there = self.pages.iter().enumerate().filter_map(|(k, p)| Some((k, p.as_deref()?)));
        let oldest = there.filter(|p| idle(&p)).min_by_key(|(k, p)| (p.stamp, *k)).map(|o| o.0);
        let Some(page) = oldest.and_then(|k| self.pages[k].take()) else { return false };
        self.held -= page.bytes();
        self.resident -= 1;
        self.traffic.evictions += 1;
        true
    }

    /// Resident pages, ascending.
    pub(super) fn all(&self) -> impl DoubleEndedIterator<Item = &Page> {
        self.pages.iter().filter_map(|p| p.as_deref())
    }

    #[inline]
    pub(super) fn is_applied(&self, i: u32) -> bool {
        self.flags(i) & APPLIED != 0
    }

    /// Split `i` is asked for.
    #[inline]
    pub(super) fn is_led(&self, i: u32) -> bool {
        self.flags(i) & LED != 0
    }

    /// Marks split `i` as gathered, or not, if its page is there.
    pub(super) fn mark(&mut self, i: u32, on: bool) {
        if let Some((p, k)) = self.page_mut(i) {
            p.mark(k, on);
        }
    }

    #[inline]
    pub(super) fn is_marked(&self, i: u32) -> bool {
        self.page(i).is_some_and(|(p, k)| p.is_marked(k))
    }

    /// The node that split `i` replaces, and its vertex; `None` if its page is not there.
    #[inline]
    pub(super) fn parent(&self, i: u32) -> Option<(u32, u32)> {
        self.record(i).map(|r| (r.parent, r.vertex))
    }

    /// Splits depend on more than what makes their vertices and their cuts: bounds are for the ring rule.
    #[inline]
    pub(super) fn by_rings(&self) -> bool {
        self.base.links.settled
    }

    /// What split `i` depends on beside [`Shelf::needs`].
    #[inline]
    pub(super) fn further(&self, i: u32) -> &[u32] {
        match self.by_rings() {
            true => self.page(i).map_or(&[], |(p, k)| p.further.of(k)),
            false => &[],
        }
    }

    /// By what splits whose pages are there come in an order in which each has what it depends on before it. By the ring rule chunks follow each other, within one turns tell.
    pub(super) fn order_key(&self, i: u32) -> (usize, u32, u32) {
        match self.by_rings() {
            true => {
                let turn = self.page(i).and_then(|(p, k)| p.further.turns.get(k).copied());
                (self.chunk_of(i), turn.unwrap_or(0), i)
            }
            false => (0, 0, i),
        }
    }

    /// What split `i` depends on by its vertex and its cuts; [`NONE`] for the base.
    #[inline]
    pub(super) fn needs(&self, i: u32) -> Option<[u32; 3]> {
        self.record(i).map(|r| self.needs_of(r))
    }

    /// The same of a split that is at hand.
    #[inline]
    pub(super) fn needs_of(&self, r: &Record) -> [u32; 3] {
        [self.maker(r.parent), self.half_of_cut(r.left).0, self.half_of_cut(r.right).0]
    }

    /// The split that makes the face of a cut of a [`Record`], and which of its two that is; [`NONE`] of the base's, and of none.
    #[inline]
    pub(super) fn half_of_cut(&self, cut: u32) -> (u32, usize) {
        match (cut >> 2).checked_sub(self.head.base_faces) {
            Some(k) if cut != NONE => (k / 2, (k % 2) as usize),
            _ => (NONE, 0),
        }
    }

    /// The split that made a node; [`NONE`] for the base's.
    #[inline]
    pub(super) fn maker(&self, node: u32) -> u32 {
        node.checked_sub(self.head.base_vertices).map_or(NONE, |k| k >> 1)
    }

    /// The page of a node's maker and its place there, and the side of the node; `None` for nodes of the base.
    #[inline]
    fn at_node(&self, node: u32) -> Option<(&Page, usize, usize)> {
        let k = node.checked_sub(self.head.base_vertices)?;
        self.page(k >> 1).map(|(p, at)| (p, at, (k & 1) as usize))
    }

    /// The split that replaces a node that is in the mesh, or [`NONE`], and its bounds.
    pub(super) fn continuation(&self, node: u32) -> (u32, Packed) {
        let base = &self.base.links;
        if let Some(&next) = base.next.get(node as usize) {
            return (next, base.bounds[node as usize]);
        }
        match self.at_node(node) {
            Some((p, k, side)) => (p.of[k].next[side], p.of[k].bounds[side]),
            None => (NONE, Packed::default()),
        }
    }

    /// The place of a node in the list of what could come next, of the record of the split that makes it ([`NONE`] of the base); [`NONE`] if that is not asked for. The places of the two nodes of a record follow each other.
    #[inline]
    pub(super) fn open_place_of(&self, maker: u32, node: u32) -> u32 {
        match node.checked_sub(self.head.base_vertices) {
            None => node,
            Some(_) if maker == NONE => NONE,
            Some(k) => self.first_open(maker) + (k & 1),
        }
    }

    /// The place of the first node of a record.
    #[inline]
    pub(super) fn first_open(&self, h: u32) -> u32 {
        self.head.base_vertices + 2 * h
    }

    /// The node that vertex `v` is at; [`NONE`] if it is not in the mesh.
    #[inline]
    pub(super) fn node(&self, v: u32) -> u32 {
        match v.checked_sub(self.head.base_vertices) {
            None => self.base.node[v as usize],
            Some(i) => self.hot_of(i).map_or(NONE, |h| h.node),
        }
    }

    /// The node that a vertex is at, of which the record of the split that makes it is known; [`NONE`] of the base.
    #[inline]
    pub(super) fn node_of(&self, v: u32, maker: u32) -> u32 {
        match self.base.node.get(v as usize) {
            Some(&node) => node,
            None => {
                let is_maker = |h: &&Hot| self.head.base_vertices + h.split == v;
                self.pool.get(maker).filter(is_maker).map_or(NONE, |h| h.node)
            }
        }
    }

    /// The same for a vertex that is in the mesh.
    #[inline]
    pub(super) fn set_node_of(&mut self, v: u32, maker: u32, node: u32) {
        match self.base.node.get_mut(v as usize) {
            Some(at) => *at = node,
            None => {
                let n0 = self.head.base_vertices;
                let of_maker = self.pool.get_mut(maker).filter(|h| n0 + h.split == v);
                of_maker.into_iter().for_each(|h| h.node = node);
            }
        }
    }

    /// The first slot of a record's faces.
    #[inline]
    pub(super) fn first_slot(&self, h: u32) -> u32 {
        self.head.base_faces + 2 * h
    }

    /// The chunk that makes wedge `w`, which is none of the base's.
    #[inline]
    fn chunk_of_wedge(&self, w: u32) -> usize {
        self.chunks.partition_point(|c| c.first_wedge <= w).saturating_sub(1)
    }

    /// The vertex of wedge `w`, which is in the mesh.
    #[inline]
    pub(super) fn wedge_vertex(&self, w: u32) -> u32 {
        if self.head.channels.is_none() {
            return w;
        }
        if let Some(&v) = self.base.wedge_vertex.get(w as usize) {
            return v;
        }
        let page = self.pages.get(self.chunk_of_wedge(w)).and_then(|p| p.as_deref());
        page.and_then(|p| p.wedge_vertex.get(w.wrapping_sub(p.first_wedge) as usize)).copied().unwrap_or(NONE)
    }

    pub(super) fn set_wedge_vertex(&mut self, w: u32, v: u32) {
        if let Some(at) = self.base.wedge_vertex.get_mut(w as usize) {
            *at = v;
            return;
        }
        let c = self.chunk_of_wedge(w);
        if let Some(p) = self.pages.get_mut(c).and_then(|p| p.as_deref_mut())
            && let Some(at) = p.wedge_vertex.get_mut(w.wrapping_sub(p.first_wedge) as usize)
        {
            *at = v;
        }
    }

    /// The row of wedge `w`.
    pub(super) fn wedge_row(&self, w: u32) -> RowRef {
        if let Some(&r) = self.base.wedge_row.get(w as usize) {
            return r;
        }
        let page = self.pages.get(self.chunk_of_wedge(w)).and_then(|p| p.as_deref());
        let row = page.and_then(|p| p.wedge_row.get(w.wrapping_sub(p.first_wedge) as usize));
        row.copied().unwrap_or(RowRef::NOTHING)
    }

    pub(super) fn set_wedge_row(&mut self, w: u32, row: RowRef) {
        if let Some(at) = self.base.wedge_row.get_mut(w as usize) {
            *at = row;
            return;
        }
        let c = self.chunk_of_wedge(w);
        if let Some(p) = self.pages.get_mut(c).and_then(|p| p.as_deref_mut())
            && let Some(at) = p.wedge_row.get_mut(w.wrapping_sub(p.first_wedge) as usize)
        {
            *at = row;
        }
    }

    /// The chunk of split `i`, as [`RowRef`] names it.
    pub(super) fn page_number(&self, i: u32) -> u32 {
        self.chunk_of(i) as u32
    }

    /// The values of a row, and the channels it has.
    pub(super) fn row(&self, r: RowRef) -> (Cow<'_, [f32]>, u64) {
        let stride: usize = self.head.channels.iter().flatten().map(|c| c.width).sum();
        let at = r.row as usize;
        let nothing = (Cow::Borrowed(&[][..]), 0);
        match self.pages.get(r.page as usize).and_then(|p| p.as_deref()) {
            Some(p) => {
                let values = p.rows.get(at.saturating_mul(stride)..(at + 1).saturating_mul(stride));
                values.zip(p.present.get(at)).map_or(nothing, |(v, &present)| (v.into(), present))
            }
            None => match &self.base.mesh.wedges {
                Some(w) if r.page == NONE => {
                    w.present.get(at).map_or(nothing, |present| (w.rows.row(at, w.stride), present))
                }
                _ => nothing,
            },
        }
    }

    /// Where node `k`, which is in the mesh or was before it was split, stands.
    pub(super) fn position(&self, node: u32) -> Result<DVec3, PagedError> {
        let n0 = self.head.base_vertices;
        let mut k = node;
        loop {
            let Some(at) = k.checked_sub(n0) else {
                return Ok(self.base.mesh.base_positions.get(k as usize));
            };
            let i = at >> 1;
            let Some((p, local)) = self.page(i) else { return Err(Damage::Fan(i as usize).into()) };
            if at & 1 == 1 {
                return Ok(p.place(local));
            }
            if !self.moves {
                // It stands where its vertex always does.
                return match p.of[local].vertex.checked_sub(n0) {
                    None => Ok(self.base.mesh.base_positions.get(p.of[local].vertex as usize)),
                    Some(j) => match self.page(j) {
                        Some((p, local)) => Ok(p.place(local)),
                        None => Err(Damage::Fan(i as usize).into()),
                    },
                };
            }
            if let Some(to) = p.moved(local) {
                return Ok(to);
            }
            k = p.of[local].parent;
        }
    }

    /// Where a node stands about the origin of the bounds.
    pub(super) fn local_centre(&self, node: u32) -> Result<Vec3, PagedError> {
        Ok((self.position(node)? - self.base.links.origin).as_vec3())
    }
}
