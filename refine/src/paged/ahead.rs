//! Pages that are decoded by other threads before they are needed.
//!
//! What is shown does not depend on it: a page that was made ahead stands beside the shelf until it is asked for, in room that is set aside for that from the beginning, whatever the number of threads, and then comes onto
//! the shelf as one that is fetched does. If nobody has begun with it by then it is made on the spot; if somebody has, that is waited for.

use super::PagedError;
use super::page::Page;
use super::shelf::{OnWay, read_page};
use crate::format::{ByteRanges, MeshHead};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Pages that may stand beside the shelf, at most: a first frame keeps as many under way, later ones need one in several frames.
const MOST: usize = 8;
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

    /// It is not wanted any more; false while somebody is at it.
    fn give_up(&self) -> bool {
        let mut state = self.lock();
        let running = matches!(*state, State::Running);
        if !running {
            *state = State::Over;
        }
        !running
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

/// What is made ahead.
pub(super) struct Ahead {
    source: Option<Shared>,
    /// By chunk, and the frame in which each was wished for.
    jobs: Vec<(usize, u64, Arc<Job>)>,
    /// Pages that there is room for.
    most: usize,
    /// Bytes set aside.
    room: usize,
}

impl std::fmt::Debug for Ahead {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Ahead({} of {})", self.jobs.len(), self.most)
    }
}

impl Ahead {
    /// With so many bytes free; a page takes `page` at most, and `way` while it is made. All may be made at once, by as many threads.
    pub(super) fn new(source: Option<Shared>, free: usize, page: usize, way: usize) -> Ahead {
        let each = page + way;
        let most = if source.is_some() { (free / PART / each.max(1)).min(MOST) } else { 0 };
        Ahead { source, jobs: Vec::new(), most, room: most * each }
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

    /// Has the page of a chunk, which is not on the shelf, made by somebody, if there is room; says whether it is, or will be.
    pub(super) fn wish(&mut self, chunk: usize, frame: u64, head: &Arc<MeshHead>, way: OnWay) -> bool {
        if let Some(job) = self.jobs.iter_mut().find(|j| j.0 == chunk) {
            job.1 = frame;
            return true;
        }
        if self.jobs.len() >= self.most {
            let old = self.jobs.iter().position(|j| j.1 + STALE < frame && j.2.give_up());
            let Some(old) = old else { return false };
            self.jobs.swap_remove(old);
        }
        let Some(source) = self.source.clone() else { return false };
        let (head, job) = (head.clone(), Arc::new(Job::default()));
        self.jobs.push((chunk, frame, job.clone()));
        begin(move || job.run(&*source, &head, &way));
        true
    }

    /// The page of a chunk, if it was made ahead.
    pub(super) fn take(&mut self, chunk: usize) -> Option<Made> {
        let at = self.jobs.iter().position(|j| j.0 == chunk)?;
        self.jobs.swap_remove(at).2.take()
    }
}

#[cfg(feature = "parallel")]
fn begin(work: impl FnOnce() + Send + 'static) {
    rayon::spawn(work);
}

#[cfg(not(feature = "parallel"))]
fn begin(_: impl FnOnce() + Send + 'static) {}
