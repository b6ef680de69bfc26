//! Pages that are decoded by other threads before they are needed.
//!
//! What is shown does not depend on it: a page that was made ahead stands beside the shelf until it is asked for, in room that is set aside for that from the beginning, whatever the number of threads, and then comes onto
//! the shelf as one that is fetched does. If nobody has begun with it by then it is made on the spot; if somebody has, that is waited for.

use super::PagedError;
use super::page::Page;
use super::shelf::{OnWay, read_page};
use crate::format::{ByteRanges, MeshHead};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Pages that may stand beside the shelf, at most: some of those that are foreseen are needed late, or never.
const MOST: usize = 24;
/// Pages that are made at once, at most: what that takes on the way is much more than a page.
const AT_ONCE: usize = 4;
/// The part of the limit that they may take.
const PART: usize = 8;
/// Frames after which a page that was not asked for gives way.
const STALE: u64 = 64;

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

/// What is made ahead.
pub(super) struct Ahead {
    line: Option<Arc<Line>>,
    /// By chunk, and the frame in which each was wished for.
    jobs: Vec<(usize, u64, Arc<Job>)>,
    /// Pages that there is room for.
    most: usize,
    /// Bytes set aside.
    room: usize,
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
        let (most, at_once) = shares(free / PART, page, way);
        let line = source.filter(|_| most > 0);
        let (most, room) = if line.is_some() { (most, most * page + at_once * way) } else { (0, 0) };
        let line = line.map(|source| Arc::new(Line { source, waiting: Mutex::default(), at_once }));
        Ahead { line, jobs: Vec::new(), most, room }
    }

    /// Bytes set aside.
    pub(super) fn bytes(&self) -> usize {
        self.room
    }

    /// There are threads for it, and there is room.
    #[cfg(feature = "parallel")]
    pub(super) fn works(&self) -> bool {
        self.most > 0 && rayon::current_num_threads() > 1
    }

    #[cfg(not(feature = "parallel"))]
    pub(super) fn works(&self) -> bool {
        false
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
            let stale = |j: &(usize, u64, Arc<Job>)| j.1 + STALE < frame && j.2.give_up(true);
            let foreseen = |j: &(usize, u64, Arc<Job>)| now && j.1 < frame && j.2.give_up(false);
            let old = self.jobs.iter().position(stale).or_else(|| self.jobs.iter().position(foreseen));
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

#[cfg(feature = "parallel")]
fn begin(work: impl FnOnce() + Send + 'static) {
    rayon::spawn(work);
}

#[cfg(not(feature = "parallel"))]
fn begin(_: impl FnOnce() + Send + 'static) {}
