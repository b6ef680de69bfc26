//! View-dependent refinement out of core: of a `.pm` of any size only the chunks that a view needs are read, and no more memory is held than a limit.
//!
//! A [`PagedView`] is to a mesh of a file what a [`crate::selective::View`] is to one in memory. The file's chunks must be ones that are read alone, each with bounds and a `PAGE`
//! beside it ([`crate::format::EncodeOptions::pages`]). Resident are the base, the file's directory, and the *pages* (chunks of splits, decoded) that hold applied splits; others stay
//! as long as there is room, the least recently used go first.
//!
//! A page says of every vertex it makes which split replaces it, and has that split's bounds, be it in another chunk. So a view knows whether it needs a split before it has the
//! split's chunk: one is fetched when a split in it is needed, or when one that is needed depends on a split in it. Beginning takes time and memory in proportion to the base and
//! the directory, not to the splits.
//!
//! Guaranteed: at rest, with room and fetches enough, the mesh is that of a [`crate::selective::View`] with the same bounds, the least closed set; at every time the set is closed, so there are
//! no cracks. [`PagedView::bytes`] never exceeds the limit: where that is too small, or fetches are limited, the mesh is coarser than asked, and
//! [`PagedDone`] says so. Damage found on the way is an error that leaves the mesh somewhere between that of the last frame and that of this, sound and closed.
//!
//! Where the source can be read by other threads, up to an eighth of what is free at the first frame, a third where an eighth is too little for a few pages and what is shown has room, is set aside, whatever the number of threads, for pages that they decode before they are needed
//! (`ahead.rs`); [`PagedView::trim`] does not give it back.
//!
//! Not guaranteed: what order the input had (`ORDR` is not read): vertices and faces come in the order of the file. Edges without faces come with the base.

mod adapt;
mod ahead;
mod calendar;
mod canvas;
mod front;
mod list;
mod output;
mod page;
mod pool;
mod queue;
mod ready;
mod shelf;
mod sight;
mod timed;
mod visible;

pub use adapt::{PagedDone, PagedLimits};
pub use shelf::Traffic;

use crate::aif::NONE;
use crate::format::{ByteRanges, FormatError, RangeReader};
use crate::hierarchy::{Packed, Rule};
use crate::progressive::Damage;
use crate::selective::{Clocks, Cull, Entry, Followed, Lens, LensError, Motions};
use crate::view::Camera;
use canvas::Drawing;
use glam::{DMat4, DVec3, Vec3};
use list::{List, PLACE, THERE, grown};
use pool::Hot;
use queue::Queue;
use shelf::Shelf;
use std::sync::Arc;
use timed::{CHANGE, MOTION};

/// Bytes that arrays take for a vertex shown: its record, two slots of faces, two places of what could come next and one of what could be undone.
const SHOWN: usize = size_of::<Hot>() + 2 * (2 * size_of::<[u32; 3]>() + 1) + 3 * PLACE + 2 * THERE;

/// Of what is free, the part that arrays may take at a time to grow further than they must: pages have the rest.
const PART_AHEAD: usize = 4;

/// The part of themselves that arrays grow by at least, so that growing costs little in sum.
const LEAST_AHEAD: usize = 8;

/// Splits that few frames of a flight need.
const MANY: usize = 1024;

/// A view that pages its mesh in has failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PagedError {
    /// The file is damaged, or could not be read.
    #[error("{0}")]
    Format(#[from] FormatError),
    /// Splits contradict each other.
    #[error("{0}")]
    Damage(#[from] Damage),
    /// The chunks cannot be read alone, or have no links beside them.
    #[error("it was not written for refining out of core: write it with pages (`progmesh encode --paged`)")]
    NoPages,
    /// Not even the coarsest mesh fits into the limit.
    #[error(
        "the limit of {limit} bytes is too small: {needed} are needed for the base, the directory and one chunk"
    )]
    Memory {
        /// Bytes.
        limit: usize,
        /// Bytes.
        needed: usize,
    },
}

/// A mesh of a file between base and full detail, finer where a view needs it, whose parts are read when they are needed.
///
/// `S` is where the bytes come from. Memory: [`PagedView::bytes`]; about 85 B for a split of a resident page by the ring rule, 70 by that of cuts, and 247 B for a vertex shown, up to twice as many while a part of what is free suffices for that, up to an eighth more where it does not.
#[derive(Debug)]
pub struct PagedView<S> {
    shelf: Shelf<S>,
    drawing: Drawing,
    /// Vertices, faces and splits of what is drawn.
    vertices: usize,
    faces: usize,
    applied: usize,
    /// Splits that are asked for, and faces of the mesh that they make. Without geomorphs by time it is what is drawn.
    led: usize,
    led_faces: usize,
    /// Splits that are asked for and not yet applied.
    pending: usize,
    /// With geomorphs by time: vertices on the way.
    motions: Option<Motions>,
    /// Changes since the last step, for which there is room.
    ahead: usize,
    /// There was too little: the next step is made at once.
    at_once: bool,
    /// What was done at once since the last step, to make room.
    jumped: Followed,
    /// Bytes that the caller takes for every vertex shown.
    beside: usize,
    /// Splits that could be applied next: what replaces nodes in the mesh, those of the base first. Their pages may not be there.
    open: List,
    /// Splits that could be undone next, by their records.
    last: List,
    /// Needed splits; empty between frames.
    queue: Queue,
    closure: Vec<u32>,
    /// Records of splits that were applied and whose nodes have not been looked at.
    made: Vec<u32>,
    /// Records of what a split depends on.
    needed: Vec<u32>,
    resume: [usize; 2],
    clock: Clocks,
    /// The last frame did not look at all that was due.
    cut: bool,
    /// The last frame had no room for something.
    short: bool,
    /// There was a frame.
    begun: bool,
    limit: usize,
}

/// Does two things: at once if it is much, and there are threads.
#[cfg(feature = "parallel")]
fn both(much: bool, a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if much {
        rayon::join(a, b);
    } else {
        a();
        b();
    }
}

#[cfg(not(feature = "parallel"))]
fn both(_: bool, a: impl FnOnce(), b: impl FnOnce()) {
    a();
    b();
}

/// There are other threads.
fn several() -> bool {
    #[cfg(feature = "parallel")]
    return rayon::current_num_threads() > 1;
    #[cfg(not(feature = "parallel"))]
    return false;
}

/// Has something done by whoever is free. Without threads nobody ever is.
#[cfg(feature = "parallel")]
fn begin(work: impl FnOnce() + Send + 'static) {
    rayon::spawn(work);
}

#[cfg(not(feature = "parallel"))]
fn begin(_: impl FnOnce() + Send + 'static) {}

impl<S: ByteRanges> PagedView<S> {
    /// A view that shows the base of mesh `m`, and holds at most `limit` bytes. Reads the base and what stands beside it.
    ///
    /// Errors: a file without pages, damage, the source's; a limit that the base does not fit into.
    pub fn new(reader: Arc<RangeReader<S>>, m: u32, limit: usize) -> Result<Self, PagedError> {
        let (shelf, fans) = Shelf::new(reader, m)?;
        let (vertices, faces) = (shelf.base.vertices(), fans.corners.len());
        let (clock, splits) = (Clocks::new(shelf.base.links.diagonal), shelf.head.splits as usize);
        let mut view = PagedView {
            shelf,
            drawing: Drawing::new(fans, splits),
            vertices,
            faces,
            applied: 0,
            led: 0,
            led_faces: faces,
            pending: 0,
            motions: None,
            ahead: 0,
            at_once: false,
            jumped: Followed::default(),
            beside: 0,
            open: List::default(),
            last: List::default(),
            queue: Queue::default(),
            closure: Vec::new(),
            made: Vec::new(),
            needed: Vec::new(),
            resume: [0; 2],
            clock,
            cut: false,
            short: false,
            begun: false,
            limit,
        };
        view.open.reserve_to([vertices; 2]);
        view.open.extend_to(vertices);
        let needed = view.bytes() + view.shelf.most_at_once();
        if needed > limit {
            return Err(PagedError::Memory { limit, needed });
        }
        for v in 0..vertices as u32 {
            let centre = view.shelf.local_centre(v)?;
            view.offer(v, view.shelf.continuation(v), centre);
        }
        Ok(view)
    }

    /// Faces shown.
    pub fn face_count(&self) -> usize {
        self.faces
    }

    /// Faces of the mesh that was asked for last: [`PagedView::face_count`], but for what geomorphs by time still show.
    pub fn needed_faces(&self) -> usize {
        self.led_faces
    }

    /// Vertices shown.
    pub fn vertex_count(&self) -> usize {
        self.vertices
    }

    /// Splits applied.
    pub fn applied(&self) -> usize {
        self.applied
    }

    /// Splits at full detail.
    pub fn splits(&self) -> usize {
        self.shelf.head.splits as usize
    }

    /// Vertices at full detail.
    pub fn full_vertices(&self) -> usize {
        self.shelf.head.base_vertices as usize + self.splits()
    }

    /// Faces at full detail.
    pub fn full_faces(&self) -> usize {
        self.shelf.head.first_face(self.shelf.head.splits) as usize
    }

    /// True if split `i` is applied.
    pub fn is_applied(&self, i: u32) -> bool {
        self.shelf.is_applied(i)
    }

    /// What was read so far.
    pub fn traffic(&self) -> Traffic {
        self.shelf.traffic
    }

    /// The middle of the box about the finest mesh's vertices, and the length of its diagonal.
    pub fn extent(&self) -> (DVec3, f64) {
        (self.shelf.base.links.origin, self.shelf.base.links.diagonal)
    }

    /// When splits may be made: what the file's bounds are for.
    pub fn rule(&self) -> Rule {
        if self.shelf.by_rings() { Rule::Rings } else { Rule::Cuts }
    }

    /// A lens for this mesh; see [`Lens::new`].
    ///
    /// Errors: as there.
    pub fn lens(&self, camera: &Camera, placed: &DMat4, tau: f64, cull: Cull) -> Result<Lens, LensError> {
        let links = &self.shelf.base.links;
        Ok(Lens::about(links.origin, camera, placed, tau, cull)?.within(links.diagonal))
    }

    /// The box about the vertices of the base; `None` if it has none.
    pub fn base_box(&self) -> Option<(DVec3, DVec3)> {
        self.shelf.base.mesh.base_positions.bounds()
    }

    /// Bytes of head and directory of the file.
    pub fn directory_bytes(&self) -> u64 {
        self.shelf.directory_bytes()
    }

    /// Splits may move the vertices that they split: a vertex that is shown can come to stand elsewhere.
    pub fn moves_vertices(&self) -> bool {
        self.shelf.moves
    }

    /// The limit, bytes.
    pub fn limit(&self) -> usize {
        self.limit
    }

    /// Sets the limit. What is held beyond it goes as soon as it is not shown any more.
    pub fn set_limit(&mut self, bytes: usize) {
        self.limit = bytes;
    }

    /// Bytes held: the sum of the capacities of all arrays, but for copies of the last frame's lenses, and for less than 128 KiB that a frame takes to look at many splits. While a chunk is decoded, a part of the limit that is set aside for that is used as well.
    pub fn bytes(&self) -> usize {
        self.shelf.bytes()
            + self.drawing.bytes()
            + self.open.bytes()
            + self.last.bytes()
            + self.queue.bytes()
            + 4 * (self.closure.capacity() + self.made.capacity() + self.needed.capacity())
            + MOTION * self.motions.as_ref().map_or(0, Motions::len)
            + CHANGE * self.ahead
            + self.beside * self.vertices
            + size_of::<Self>()
    }

    /// Bytes that grow with the mesh shown, of [`PagedView::bytes`].
    pub fn shown_bytes(&self) -> usize {
        self.drawing.canvas.bytes()
            + size_of::<Hot>() * self.shelf.pool.of.capacity()
            + self.open.bytes()
            + self.last.bytes()
    }

    /// Pages that are there now.
    pub fn resident_pages(&self) -> usize {
        self.shelf.resident()
    }

    /// Drops all pages that hold nothing that is shown, and room that was made for more of it. Returns the bytes that were freed.
    pub fn trim(&mut self) -> usize {
        let before = self.bytes();
        self.shelf.clock += 1;
        while self.shelf.evict_one() {}
        self.give_back();
        before - self.bytes()
    }

    /// Before the first frame, when others have what they cannot do without, sets room aside for pages that are made ahead; gives it back once the limit has become too small.
    fn set_aside(&mut self) {
        let free = self.limit.checked_sub(self.bytes() + self.shelf.most_at_once());
        match free {
            None => self.shelf.set_aside(0),
            Some(free) if !self.begun => self.shelf.set_aside(free),
            Some(_) if self.short => self.shelf.set_aside_least(),
            Some(_) => {}
        }
        self.begun = true;
    }

    /// There is room for many more splits without asking for it: what a frame like the last needs finds room in whatever order it comes, but for pages.
    fn is_roomy(&self) -> bool {
        self.needed_room(MANY).iter().zip(&self.room()).all(|(n, r)| n <= r)
    }

    /// Bytes that are free for what is kept.
    fn free(&self) -> usize {
        self.limit.saturating_sub(self.bytes() + self.shelf.most_at_once())
    }

    /// True once `more` bytes fit beside what is held; pages that are not in use go if they must.
    fn make_room_of_pages(&mut self, more: usize) -> bool {
        loop {
            if self.bytes() + self.shelf.most_at_once() + more <= self.limit {
                return true;
            }
            if !self.shelf.evict_one() {
                return false;
            }
        }
    }

    /// The same; what arrays have grown ahead is given back if they must.
    fn make_room(&mut self, more: usize) -> bool {
        self.make_room_of_pages(more) || (self.give_back() > 0 && self.make_room_of_pages(more))
    }

    /// Records of splits, and entries of both lists, that there is room for.
    fn room(&self) -> [usize; 3] {
        let records = self.shelf.pool.of.capacity().min(self.last.capacity()[0]);
        [records, self.last.capacity()[1], self.open.capacity()[1]]
    }

    /// How many of each are needed, with so many splits more.
    fn needed_room(&self, splits: usize) -> [usize; 3] {
        let led = self.led + splits;
        [self.shelf.pool.alive() + splits, led, self.shelf.base.vertices() + led]
    }

    /// Bytes of growing to room for so many: more in all, and those of the largest array that is there until its new one is filled.
    fn growth(&self, [records, there, open_there]: [usize; 3]) -> usize {
        let (places, slots) = self.places(records);
        let (pool, canvas) = (&self.shelf.pool.of, &self.drawing.canvas);
        // One array after the other.
        let of_slots = [
            grown::<Hot>(pool.capacity(), records),
            grown::<[u32; 3]>(canvas.fans.corners.capacity(), slots),
            grown::<[u32; 3]>(canvas.fans.links.capacity(), slots),
            grown::<u64>(canvas.touched.capacity(), slots.div_ceil(64)),
        ];
        let lists = [self.open.growth([places, open_there]), self.last.growth([records, there])];
        let [more, most] =
            of_slots.iter().chain(&lists).fold([0; 2], |sum, g| [sum[0] + g[0], sum[1].max(g[1])]);
        more + most
    }

    /// Places in the list of what could come next, and slots of faces, for so many records.
    fn places(&self, records: usize) -> (usize, usize) {
        (self.shelf.base.vertices() + 2 * records, self.shelf.head.base_faces as usize + 2 * records)
    }

    /// Room for so many, which fits.
    fn grow(&mut self, [records, there, open_there]: [usize; 3]) {
        fn grow<T>(v: &mut Vec<T>, to: usize) {
            v.reserve_exact(to.saturating_sub(v.len()));
        }
        let (places, slots) = self.places(records);
        grow(&mut self.shelf.pool.of, records);
        let canvas = &mut self.drawing.canvas;
        grow(&mut canvas.fans.corners, slots);
        grow(&mut canvas.fans.links, slots);
        grow(&mut canvas.touched, slots.div_ceil(64));
        self.open.reserve_to([places, open_there]);
        self.last.reserve_to([records, there]);
    }

    /// Room for `splits` more to be applied, in all arrays that grow with the mesh.
    fn reserve(&mut self, splits: usize) -> bool {
        let (room, needed) = (self.room(), self.needed_room(splits));
        let beside = self.beside * (self.pending + splits);
        let moving = if self.motions.is_some() && !self.at_once { CHANGE * splits } else { 0 };
        let fits = needed.iter().zip(&room).all(|(n, r)| n <= r);
        if fits && beside + moving == 0 {
            return true;
        }
        if !fits {
            // Faces are here to be grown.
            self.drawing.gather();
        }
        // Those that are too small grow by so many at least.
        let to = |ahead: usize| {
            let mut to = [0; 3];
            for ((to, &needed), &room) in to.iter_mut().zip(&needed).zip(&room).filter(|((_, n), r)| n > r) {
                *to = needed.max(room + (room / LEAST_AHEAD).max(ahead)) + 64;
            }
            to
        };
        if !fits {
            let ahead = to(self.vertices_ahead(room[0]));
            let bytes = self.growth(ahead) + beside + moving;
            if bytes <= self.free() {
                self.grow(ahead);
                return true;
            }
        }
        let least = to(0);
        let bytes = beside + if fits { 0 } else { self.growth(least) };
        if !self.make_room_of_pages(bytes + moving) {
            // Better at once than not at all.
            if moving == 0 || !self.make_room_of_pages(bytes) {
                return false;
            }
            self.jump();
        }
        if !fits {
            self.grow(least);
        }
        true
    }

    /// By how many vertices arrays with room for so many grow ahead: as many again, as far as that takes a part of what is free only.
    fn vertices_ahead(&self, room: usize) -> usize {
        room.min(self.free() / PART_AHEAD / SHOWN).min(self.splits().saturating_sub(room))
    }

    /// After the first frame: so arrays do not grow in one of the next, where copying them would take longer than all else.
    fn grow_ahead(&mut self) {
        let needed = self.needed_room(0);
        let ahead = self.vertices_ahead(needed[0]);
        let to = needed.map(|n| n + ahead);
        if self.growth(to) <= self.free() {
            self.grow(to);
        }
    }

    /// Of what arrays have grown ahead, all but the least that they grow by. Returns the bytes that were freed.
    fn give_back(&mut self) -> usize {
        self.drawing.gather();
        let before = self.bytes();
        let some = |n: usize| n + n / LEAST_AHEAD;
        let [_, there, open_there] = self.needed_room(0).map(some);
        let records = some(self.shelf.pool.of.len());
        let (places, slots) = self.places(records);
        self.shelf.pool.of.shrink_to(records);
        let canvas = &mut self.drawing.canvas;
        canvas.fans.corners.shrink_to(slots);
        canvas.fans.links.shrink_to(slots);
        canvas.touched.shrink_to(slots.div_ceil(64));
        self.open.shrink_to([places, open_there]);
        self.last.shrink_to([records, there]);
        before - self.bytes()
    }

    /// A node is in the mesh now, in this place of the list: what replaces it, if anything, can be applied.
    fn offer(&mut self, place: u32, (next, bounds): (u32, Packed), centre: Vec3) {
        if next != NONE {
            self.open.put(place, &Entry::new(next, centre, bounds));
        }
    }

    /// What could come next or be undone of all records has places. Their faces get slots when they are drawn.
    fn extend(&mut self) {
        let records = self.shelf.pool.of.len();
        self.open.extend_to(self.shelf.base.vertices() + 2 * records);
        self.last.extend_to(records);
    }
}
