//! Geomorphs of a paged view, by the same steps and with the same places as those in memory.
//!
//! By time, what is asked for and what is drawn are two cuts in the same pages: [`PagedView::adapt`] changes the first, a step applies and undoes splits of the second. What lingers keeps its pages.

use super::PagedView;
use super::page::Page;
use super::pool::{APPLIED, LED, LINGERED};
use super::{PagedError, shelf::Shelf};
use crate::aif::NONE;
use crate::format::ByteRanges;
use crate::selective::{Cut, Entry, Followed, Lens, Motions, Stage, morphed};
use glam::DVec3;

/// Bytes that a vertex on the way takes: at most 142 in the tree of motions, whose leaves of 680 B (and what the allocator adds) hold 5 of 11 at least; 32 in a caller's list of places.
pub(super) const MOTION: usize = 176;
/// Bytes that a change takes until the step is done: two motions, and in lists that double its number and the vertices below it (which hold no others: all below it linger, or are new).
pub(super) const CHANGE: usize = 2 * (MOTION + 72) + 16;

impl<S: ByteRanges> PagedView<S> {
    /// From the next frame on changes show themselves over so many frames, as those of [`crate::selective::TimedMorph`] do; `None`: at once, and what is still on the way is
    /// there at once.
    ///
    /// Then [`PagedView::adapt`] only finds what is asked for; [`PagedView::follow`], called after it, changes what is drawn. What is undone stays until its vertices have moved, and
    /// so does its memory; each vertex on the way takes 176 B more. Where there is no room for that within the limit, the changes of a frame are made at once before anything is left coarser.
    ///
    /// Errors: as [`PagedView::follow`].
    pub fn set_timed(&mut self, frames: Option<u32>) -> Result<(), PagedError> {
        if self.motions.is_some() {
            self.settle()?;
        }
        let begins = self.motions.is_none() && frames.is_some();
        self.motions = frames.map(Motions::new);
        if begins {
            // What is drawn is what is asked for.
            self.shelf.pool.of.iter_mut().for_each(|r| r.holders = r.dependents);
        }
        Ok(())
    }

    /// With geomorphs by time: a step of what is drawn towards what was asked for last, with the lenses that asked. O(chunks of the file + changes + vertices that move).
    ///
    /// Errors: damage. The mesh that is drawn is sound then, and closed, somewhere on the way.
    pub fn follow(&mut self, lenses: &[Lens]) -> Result<Followed, PagedError> {
        let Some(motions) = &mut self.motions else { return Ok(Followed::default()) };
        let before = std::mem::take(&mut self.jumped);
        if self.at_once {
            return Ok(before + self.settle()?);
        }
        let nothing = Motions::new(motions.frames());
        let mut motions = std::mem::replace(motions, nothing);
        let result = motions.follow(self, lenses);
        self.motions = Some(motions);
        let done = result?;
        self.stepped();
        Ok(before + done)
    }

    /// Settles, and says whether that gave anything back.
    pub(super) fn make_way(&mut self) -> Result<bool, PagedError> {
        if self.motions.is_none() {
            return Ok(false);
        }
        let before = self.bytes();
        let done = self.settle()?;
        self.jumped = self.jumped + done;
        Ok(done.collapses > 0 || self.bytes() < before)
    }

    /// What is still on the way is where it will be, and what lingers goes.
    ///
    /// Errors: as [`PagedView::follow`].
    pub fn settle(&mut self) -> Result<Followed, PagedError> {
        let mut done = Followed::default();
        let Some(motions) = &mut self.motions else { return Ok(done) };
        motions.clear();
        // Page by page: of a page there is a list.
        for c in 0..self.shelf.chunk_count() {
            for i in self.shelf.splits_of(c, |f| f & (APPLIED | LED) == LED) {
                self.draw(i)?;
                done.splits += 1;
            }
        }
        for c in (0..self.shelf.chunk_count()).rev() {
            for i in self.shelf.splits_of(c, |f| f & (APPLIED | LED) == APPLIED).into_iter().rev() {
                self.undraw(i)?;
                done.collapses += 1;
            }
        }
        self.stepped();
        Ok(done)
    }

    /// The next step is made at once: that takes no room.
    pub(super) fn jump(&mut self) {
        (self.ahead, self.at_once) = (0, true);
    }

    /// Remembers what lingers.
    fn stepped(&mut self) {
        self.shelf.stepped();
        (self.ahead, self.at_once) = (0, false);
    }

    /// The vertices that are drawn elsewhere than [`PagedView::position`] says, ascending, and where; by time.
    pub fn displaced(&self) -> impl ExactSizeIterator<Item = (u32, DVec3)> + '_ {
        static NOTHING: Motions = Motions::NOTHING;
        self.motions.as_ref().unwrap_or(&NOTHING).all()
    }

    /// Where vertex `v` is drawn if splits are to show themselves by their errors: as [`crate::selective::View::morphed_by_all`].
    pub fn morphed_by_all(&self, lenses: &[Lens], v: u32, band: f64) -> Option<DVec3> {
        ((v as usize) < self.full_vertices()).then(|| morphed(self, lenses, v, band)).flatten()
    }

    /// Sets aside so many bytes of the limit for every vertex shown, for what the caller holds of each.
    pub fn set_beside(&mut self, bytes: usize) {
        self.beside = bytes;
    }
}

impl<S> Shelf<S> {
    /// Remembers what lingers.
    fn stepped(&mut self) {
        let (pages, pool) = self.with_pool();
        for p in pages.filter(|p| p.turned || p.lingered > 0) {
            p.lingered = 0;
            for &h in &p.hot {
                let Some(r) = pool.get_mut(h) else { continue };
                let lingers = r.flags & (APPLIED | LED) == APPLIED;
                r.flags = if lingers { r.flags | LINGERED } else { r.flags & !LINGERED };
                p.lingered += usize::from(lingers);
            }
            p.turned = false;
        }
    }

    /// The splits of resident pages of which `of` is true, each behind what it depends on. `pages`: of those only.
    fn splits_where(&self, pages: impl Fn(&Page) -> bool, of: impl Fn(u8) -> bool) -> Vec<u32>
    where
        S: ByteRanges,
    {
        let mut out = Vec::new();
        for p in self.all().filter(|p| pages(p)) {
            self.add_splits_of(p, &of, &mut out);
        }
        out
    }

    /// Those of one page, if it is there.
    fn splits_of(&self, chunk: usize, of: impl Fn(u8) -> bool) -> Vec<u32>
    where
        S: ByteRanges,
    {
        let mut out = Vec::new();
        self.page_of_chunk(chunk).into_iter().for_each(|p| self.add_splits_of(p, &of, &mut out));
        out
    }

    fn add_splits_of(&self, p: &Page, of: &impl Fn(u8) -> bool, out: &mut Vec<u32>)
    where
        S: ByteRanges,
    {
        let from = out.len();
        let flags = |h: u32| self.pool.get(h).map_or(0, |r| r.flags);
        out.extend((p.first..).zip(&p.hot).filter(|(_, h)| of(flags(**h))).map(|(i, _)| i));
        if self.by_rings() {
            out[from..].sort_unstable_by_key(|&i| self.order_key(i));
        }
    }
}

impl<S: ByteRanges> Cut for PagedView<S> {
    fn is_applied(&self, i: u32) -> bool {
        self.shelf.is_applied(i)
    }

    fn node(&self, v: u32) -> u32 {
        self.shelf.node(v)
    }

    fn maker(&self, node: u32) -> u32 {
        self.shelf.maker(node)
    }

    // Pages of what is applied or asked for are there, so nothing is missing below.

    fn parent(&self, i: u32) -> (u32, u32) {
        self.shelf.parent(i).unwrap_or((NONE, NONE))
    }

    fn new_vertex(&self, i: u32) -> u32 {
        self.shelf.head.base_vertices + i
    }

    fn below(&self, i: u32) -> [u32; 2] {
        let old = self.shelf.head.base_vertices + 2 * i;
        // Chunks of a hostile file may both say that a split is theirs; it says itself whose it is.
        let own = |node: u32| {
            let (next, _) = self.shelf.continuation(node);
            if self.shelf.parent(next).is_some_and(|p| p.0 == node) { next } else { NONE }
        };
        [own(old), own(old + 1)]
    }

    fn entry(&self, i: u32) -> Entry {
        // It was put there when the split was asked for.
        let entry = self.last.last_at(self.shelf.hot(i)).filter(|e| e.split == i);
        entry.unwrap_or(Entry::NOTHING)
    }

    fn place(&self, node: u32, _: u32) -> DVec3 {
        self.shelf.position(node).unwrap_or_default()
    }
}

impl<S: ByteRanges> Stage for PagedView<S> {
    type Error = PagedError;

    fn is_led(&self, i: u32) -> bool {
        self.shelf.is_led(i)
    }

    fn changed(&self) -> Vec<u32> {
        let changed = |f: u8| {
            matches!(f & (APPLIED | LED | LINGERED), LED | APPLIED)
                || f & (APPLIED | LED | LINGERED) == (APPLIED | LED | LINGERED)
        };
        self.shelf.splits_where(|p| p.turned, changed)
    }

    fn lingering(&self) -> Vec<u32> {
        self.shelf.splits_where(|p| p.turned || p.lingered > 0, |f| f & (APPLIED | LED) == APPLIED)
    }

    fn is_free(&self, i: u32) -> bool {
        self.shelf.hot_of(i).is_some_and(|r| r.flags & APPLIED != 0 && r.holders == 0)
    }

    fn draw(&mut self, i: u32) -> Result<(), PagedError> {
        self.split_faces(self.shelf.hot(i))
    }

    fn undraw(&mut self, i: u32) -> Result<(), PagedError> {
        let h = self.shelf.hot(i);
        self.unsplit_faces(h)?;
        if self.shelf.pool.get(h).is_none_or(|r| r.flags & LED == 0) {
            self.shelf.go(h);
        }
        Ok(())
    }
}
