//! Pages that are decoded by other threads before they are needed.
//!
//! What is shown does not depend on it: a page that was made ahead stands beside the shelf until it is asked for, in room that is set aside for that from the beginning, whatever the number of threads, and then comes onto
//! the shelf as one that is fetched does. If nobody has begun with it by then it is made on the spot; if somebody has, that is waited for.

use super::page::Page;
use super::shelf::{OnWay, read_page};
use super::{PagedError, begin, several};
use crate::format::{ByteRanges, MeshHead};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Pages that may stand beside the shelf, at most: some of those that are foreseen are needed late, or never. Over 16,385 x 16,385 generated samples, whose pages are small, the fast lemniscate takes a sixth less with 96 than with 24.
const MOST: usize = 96;
/// Pages that are made at once, at most: what that takes on the way is much more than a page.
const AT_ONCE: usize = 4;
/// The part of what is free that they may take.
const PART: usize = 8;
/// Where that is too little for one page to be made while [`FEW`] stand by, they may take that, up to this part: Grand Canyon's lemniscate in 64 MiB waits 8 to 19 ms for nearly each of its pages otherwise.
const MORE: usize = 3;
/// Pages foreseen at a time on most flights.
const FEW: usize = 4;
/// Frames after which a page that was not asked for gives way.
const STALE: u64 = 64;

/// The first frame, and what stands for it where a page is wished for that may be needed after it: it gives way to any other.
pub(super) const FIRST: u64 = 1;
pub(super) const GUESS: u64 = 0;

/// Bytes that other threads can read, too.
pub(super) type Shared = Arc<dyn ByteRanges + Send + Sync>;

/// A page, and the bytes that it was made of.
pub(super) type Made = Result<(Page, u64), PagedError>;

#[derive(Default)]
enum State {
    #[default]
    Waiting,
    Running,
    Done(Box<Made>),
    /// Nobody is to begin with it, or it was taken.
    Over,
}

#[derive(Default)]
struct Job {
    state: Mutex<State>,
    done: Condvar,
}

impl Job {
    /// Makes the page, unless somebody has begun with it or nobody wants it any more.
    fn run(&self, source: &dyn ByteRanges, head: &MeshHead, way: &OnWay) {
        {
            let mut state = self.lock();
            if !matches!(*state, State::Waiting) {
                return;
            }
            *state = State::Running;
        }
        // If a source panics, and the pool goes on, nobody waits for ever.
        let _end = End(self);
        let made = read_page(source, head, way);
        *self.lock() = State::Done(Box::new(made));
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What came of it, waited for if somebody has begun; `None` if nobody has, or ever will.
    fn take(&self) -> Option<Made> {
        let mut state = self.lock();
        while matches!(*state, State::Running) {
            state = self.done.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        match std::mem::replace(&mut *state, State::Over) {
            State::Done(made) => Some(*made),
            _ => None,
        }
    }

    /// It is not wanted any more, even if it was `made`; false while somebody is at it.
    fn give_up(&self, made: bool) -> bool {
        let mut state = self.lock();
        let kept = match *state {
            State::Running => true,
            State::Done(_) => !made,
            State::Waiting | State::Over => false,
        };
        if !kept {
            *state = State::Over;
        }
        !kept
    }
}

/// Ends a job however it ends.
struct End<'a>(&'a Job);

impl Drop for End<'_> {
    fn drop(&mut self) {
        let mut state = self.0.lock();
        if matches!(*state, State::Running) {
            *state = State::Over;
        }
        drop(state);
        self.0.done.notify_all();
    }
}

/// A job that nobody has begun with.
struct Waiting {
    job: Arc<Job>,
    head: Arc<MeshHead>,
    way: OnWay,
    /// It is needed in this frame, not only foreseen.
    now: bool,
}

/// What waits for a thread.
struct Line {
    source: Shared,
    waiting: Mutex<(Vec<Waiting>, usize)>,
    /// So many are made at once.
    at_once: usize,
}

impl Line {
    /// What waits, and how many are being made.
    fn lock(&self) -> MutexGuard<'_, (Vec<Waiting>, usize)> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Has one more made, if any waits and not as many as may be are under way.
    fn go_on(self: &Arc<Line>) {
        let mut line = self.lock();
        let (waiting, under_way) = &mut *line;
        if *under_way >= self.at_once || waiting.is_empty() {
            return;
        }
        let next = waiting.remove(waiting.iter().position(|w| w.now).unwrap_or(0));
        *under_way += 1;
        drop(line);
        let place = Place(self.clone());
        begin(move || next.job.run(&*place.0.source, &next.head, &next.way));
    }
}

/// A place among those that are made at once; however a job ends, the next takes it.
struct Place(Arc<Line>);

impl Drop for Place {
    fn drop(&mut self) {
        self.0.lock().1 -= 1;
        self.0.go_on();
    }
}

/// A page that was wished for: its chunk, and the frame of the last wish.
type Wish = (usize, u64, Arc<Job>);

/// What is made ahead.
pub(super) struct Ahead {
    line: Option<Arc<Line>>,
    jobs: Vec<Wish>,
    /// Pages that there is room for.
    most: usize,
    /// Bytes set aside.
    room: usize,
    /// Bytes that would be at least, if more are.
    least: Option<usize>,
}

impl Drop for Ahead {
    fn drop(&mut self) {
        self.line.iter().for_each(|line| line.lock().0.clear());
    }
}

impl std::fmt::Debug for Ahead {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Ahead({} of {})", self.jobs.len(), self.most)
    }
}

/// With so much room, how many pages may stand beside the shelf, and how many of them be made at once: several of the former for each of the latter, as some wait long.
fn shares(room: usize, page: usize, way: usize) -> (usize, usize) {
    let pages = |at_once: usize| room.saturating_sub(at_once * way) / page.max(1);
    let at_once = (1..=AT_ONCE).rev().find(|&n| n == 1 || pages(n) >= 3 * n).unwrap_or(1);
    (pages(at_once).min(MOST), at_once)
}

impl Ahead {
    /// With so many bytes free; a page takes `page` at most, and `way` while it is made.
    pub(super) fn new(source: Option<Shared>, free: usize, page: usize, way: usize) -> Ahead {
        let few = (free / MORE).min(way + FEW * page);
        let mut ahead = Ahead::within(source, (free / PART).max(few), page, way);
        ahead.least = if few > free / PART { Some(free / PART) } else { None };
        ahead
    }

    /// The bytes that would be set aside at least, if more are.
    pub(super) fn least(&self) -> Option<usize> {
        self.least
    }

    /// With so much room.
    pub(super) fn within(source: Option<Shared>, room: usize, page: usize, way: usize) -> Ahead {
        let (most, at_once) = shares(room, page, way);
        let line = source.filter(|_| most > 0);
        let (most, room) = if line.is_some() { (most, most * page + at_once * way) } else { (0, 0) };
        let line = line.map(|source| Arc::new(Line { source, waiting: Mutex::default(), at_once }));
        Ahead { line, jobs: Vec::new(), most, room, least: None }
    }

    /// Bytes set aside.
    pub(super) fn bytes(&self) -> usize {
        self.room
    }

    /// There are threads for it, and there is room.
    pub(super) fn works(&self) -> bool {
        self.most > 0 && several()
    }

    /// Has the page of a chunk, which is not on the shelf, made by somebody, if there is room, soon if it is needed `now`; says whether it is, or will be.
    pub(super) fn wish(
        &mut self,
        chunk: usize,
        (frame, now): (u64, bool),
        head: &Arc<MeshHead>,
        way: OnWay,
    ) -> bool {
        let Some(line) = &self.line else { return false };
        if let Some(job) = self.jobs.iter_mut().find(|j| j.0 == chunk) {
            job.1 = frame;
            if now && let Some(w) = line.lock().0.iter_mut().find(|w| Arc::ptr_eq(&w.job, &job.2)) {
                w.now = true;
            }
            return true;
        }
        if self.jobs.len() >= self.most {
            // What is needed goes before what was foreseen and nobody has begun with.
            let stale = |j: &Wish| j.1 + STALE < frame && j.2.give_up(true);
            let foreseen = |j: &Wish| now && j.1 < frame && j.2.give_up(false);
            let guessed = |j: &Wish| j.1 == GUESS && frame > FIRST && j.2.give_up(true);
            let position = |of: &dyn Fn(&Wish) -> bool| self.jobs.iter().position(of);
            let old = position(&guessed).or_else(|| position(&stale)).or_else(|| position(&foreseen));
            let Some(old) = old else { return false };
            let (_, _, job) = self.jobs.swap_remove(old);
            line.lock().0.retain(|w| !Arc::ptr_eq(&w.job, &job));
        }
        let job = Arc::new(Job::default());
        self.jobs.push((chunk, frame, job.clone()));
        line.lock().0.push(Waiting { job, head: head.clone(), way, now });
        line.go_on();
        true
    }

    /// The page of a chunk, if it was made ahead.
    pub(super) fn take(&mut self, chunk: usize) -> Option<Made> {
        let at = self.jobs.iter().position(|j| j.0 == chunk)?;
        let (_, _, job) = self.jobs.swap_remove(at);
        let made = job.take();
        if made.is_none()
            && let Some(line) = &self.line
        {
            line.lock().0.retain(|w| !Arc::ptr_eq(&w.job, &job));
        }
        made
    }
}

#[cfg(all(test, feature = "parallel"))]
mod tests {
    use super::*;
    use crate::format::{Chunk, ChunkType, Room};
    use glam::DVec3;
    use std::ops::Range;

    /// A source that keeps everybody waiting until it is opened, and then has nothing.
    #[derive(Default)]
    struct Gate {
        /// Where they wait, in the order in which they came; whether it is open; how many are inside, and have ever been.
        state: Mutex<(Vec<u64>, bool, usize, usize)>,
        changed: Condvar,
    }

    impl Gate {
        fn wait_for(&self, until: impl Fn(&(Vec<u64>, bool, usize, usize)) -> bool) -> Vec<u64> {
            let mut state = self.state.lock().unwrap();
            while !until(&state) {
                state = self.changed.wait(state).unwrap();
            }
            state.0.clone()
        }

        fn open(&self, open: bool) {
            self.state.lock().unwrap().1 = open;
            self.changed.notify_all();
        }
    }

    impl ByteRanges for Gate {
        fn fetch(&self, range: Range<u64>) -> std::io::Result<Vec<u8>> {
            {
                let mut state = self.state.lock().unwrap();
                state.0.push(range.start);
                state.2 += 1;
                state.3 = state.3.max(state.2);
            }
            self.changed.notify_all();
            self.wait_for(|s| s.1);
            self.state.lock().unwrap().2 -= 1;
            self.changed.notify_all();
            Err(std::io::ErrorKind::NotFound.into())
        }
    }

    fn way(offset: u64) -> OnWay {
        let chunk = Chunk {
            kind: ChunkType::SPLITS,
            index: 0,
            critical: true,
            mesh: 0,
            first: 0,
            count: 0,
            first_face: 0,
            band: 0,
            subtree: 0,
            error: 0.0,
            offset,
            stored: 0,
            raw: 0,
            checksum: 0,
        };
        OnWay::new([chunk; 3], Room::ANY, false, DVec3::ZERO)
    }

    /// However many threads there are: no more pages are made at once, and stand by, than there is room for; what is needed goes first.
    #[test]
    fn as_many_are_made_as_there_is_room_for_and_the_needed_first() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3 * AT_ONCE).build().unwrap();
        let gate = Arc::new(Gate::default());
        let (page, each) = (10, 100);
        let mut ahead = Ahead::new(Some(gate.clone()), PART * (AT_ONCE * each + 20 * page), page, each);
        assert_eq!((ahead.most, ahead.bytes()), (20, AT_ONCE * each + 20 * page));
        let head = Arc::new(MeshHead::default());
        let wish = |ahead: &mut Ahead, c: usize, frame: u64, now: bool| {
            pool.install(|| ahead.wish(c, (frame, now), &head, way(c as u64)))
        };
        for c in 0..20 {
            assert!(wish(&mut ahead, c, 1, c == 15));
        }
        let first = gate.wait_for(|s| s.0.len() == AT_ONCE);
        assert!(first.iter().all(|&c| c < AT_ONCE as u64));
        // There is no room for more that is foreseen; for what is needed another gives way, which nobody has begun with and nobody asked for in this frame.
        assert!(!wish(&mut ahead, 20, 2, false));
        assert!(!wish(&mut ahead, 20, 1, true));
        assert!(wish(&mut ahead, 20, 2, true));
        assert!(ahead.jobs.iter().filter(|j| j.0 < AT_ONCE).count() == AT_ONCE && ahead.jobs.len() == 20);
        gate.open(true);
        let all = gate.wait_for(|s| s.0.len() == 20 && s.2 == 0);
        // As each that ends lets the next begin, both that are needed come right behind those that had begun.
        let needed = [15, 20].map(|c| all.iter().position(|&x| x == c).unwrap());
        assert!(needed.iter().all(|&k| (AT_ONCE..2 * AT_ONCE + 2).contains(&k)), "{needed:?}");
        assert_eq!(gate.state.lock().unwrap().3, AT_ONCE);
        // All that were not given up were made, and are taken once.
        let made: Vec<usize> = (0..21).filter(|&c| matches!(ahead.take(c), Some(Err(_)))).collect();
        assert_eq!(made.len(), 20);
        assert!(made.contains(&15) && made.contains(&20));
        assert!((0..21).all(|c| ahead.take(c).is_none()));
        assert!(ahead.line.as_ref().is_some_and(|l| l.lock().0.is_empty()));
        // What is not begun when all ends is not made.
        gate.open(false);
        (30..40).for_each(|c| assert!(wish(&mut ahead, c, 3, false)));
        gate.wait_for(|s| s.0.len() == 20 + AT_ONCE);
        drop(ahead);
        gate.open(true);
        gate.wait_for(|s| s.2 == 0);
        pool.install(|| ());
        drop(pool);
        assert_eq!(gate.state.lock().unwrap().0.len(), 20 + AT_ONCE);
    }

    /// What the first frame guessed gives way to all that later ones foresee, unless somebody is at it.
    #[test]
    fn guesses_give_way() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3 * AT_ONCE).build().unwrap();
        let gate = Arc::new(Gate::default());
        let (page, each) = (10, 100);
        let mut ahead = Ahead::new(Some(gate.clone()), PART * (AT_ONCE * each + 20 * page), page, each);
        let head = Arc::new(MeshHead::default());
        let wish = |ahead: &mut Ahead, c: usize, frame: u64| {
            pool.install(|| ahead.wish(c, (frame, false), &head, way(c as u64)))
        };
        (0..20).for_each(|c| assert!(wish(&mut ahead, c, GUESS)));
        gate.wait_for(|s| s.0.len() == AT_ONCE);
        assert!(!wish(&mut ahead, 20, FIRST));
        // One is foreseen by now.
        assert!(wish(&mut ahead, 19, FIRST + 1));
        let more = 20 - AT_ONCE - 1;
        (20..20 + more).for_each(|c| assert!(wish(&mut ahead, c, FIRST + 1), "{c}"));
        assert!(!wish(&mut ahead, 50, FIRST + 1) && ahead.jobs.len() == 20);
        assert!(ahead.jobs.iter().any(|j| j.0 == 19));
        gate.open(true);
        gate.wait_for(|s| s.0.len() == 20 && s.2 == 0);
    }
}
