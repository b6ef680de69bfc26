//! Chunked loops over flat arrays: rayon with feature `parallel`, plain loops without. Chunks are fixed, so results do not depend on
//! the number of threads.

#[cfg(feature = "parallel")]
use rayon::prelude::*;

/// Calls `f` on every chunk; results in order.
pub(crate) fn map_chunks<T: Send, R: Send>(
    items: &mut [T],
    size: usize,
    f: impl Fn(&mut [T]) -> R + Sync + Send,
) -> Vec<R> {
    #[cfg(feature = "parallel")]
    if items.len() > size && rayon::current_num_threads() > 1 {
        return items.par_chunks_mut(size).map(f).collect();
    }
    items.chunks_mut(size).map(f).collect()
}

/// Calls `f` on every chunk with a scratch value of its thread and the chunk's first index; results in order.
pub(crate) fn map_init_chunks<T: Sync, S, R: Send>(
    items: &[T],
    size: usize,
    init: impl Fn() -> S + Sync + Send,
    f: impl Fn(&mut S, usize, &[T]) -> R + Sync + Send,
) -> Vec<R> {
    #[cfg(feature = "parallel")]
    if items.len() > size && rayon::current_num_threads() > 1 {
        return items
            .par_chunks(size)
            .enumerate()
            .map_init(init, |scratch, (i, chunk)| f(scratch, i * size, chunk))
            .collect();
    }
    let mut scratch = init();
    items.chunks(size).enumerate().map(|(i, chunk)| f(&mut scratch, i * size, chunk)).collect()
}

/// Threads that a loop would use here.
pub(crate) fn threads() -> usize {
    #[cfg(feature = "parallel")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "parallel"))]
    1
}

/// Runs `f` with this many threads; with those of the current pool for `None`. Falls back to the current pool when no new one can be
/// had: the result is the same.
pub(crate) fn with_threads<R: Send>(threads: Option<usize>, f: impl FnOnce() -> R + Send) -> R {
    #[cfg(feature = "parallel")]
    if let Some(n) = threads.filter(|&n| n > 0 && n != rayon::current_num_threads())
        && let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(n).build()
    {
        return pool.install(f);
    }
    let _ = threads;
    f()
}

/// Calls `f` on every chunk with its first index.
pub(crate) fn for_chunks<T: Send>(items: &mut [T], size: usize, f: impl Fn(usize, &mut [T]) + Sync + Send) {
    #[cfg(feature = "parallel")]
    if items.len() > size && rayon::current_num_threads() > 1 {
        return items.par_chunks_mut(size).enumerate().for_each(|(i, chunk)| f(i * size, chunk));
    }
    items.chunks_mut(size).enumerate().for_each(|(i, chunk)| f(i * size, chunk));
}

/// Calls both, at the same time if it is `worth` it.
pub(crate) fn join<A: Send, B: Send>(
    worth: bool,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    #[cfg(feature = "parallel")]
    if worth && rayon::current_num_threads() > 1 {
        return rayon::join(a, b);
    }
    let _ = worth;
    (a(), b())
}

/// `f(0)`, `f(1)`, ... `f(n - 1)`, each with a scratch value of its thread; results in order.
pub(crate) fn map_init<S, R: Send>(
    n: usize,
    init: impl Fn() -> S + Sync + Send,
    f: impl Fn(&mut S, usize) -> R + Sync + Send,
) -> Vec<R> {
    #[cfg(feature = "parallel")]
    if n > 1 && rayon::current_num_threads() > 1 {
        return (0..n).into_par_iter().map_init(init, f).collect();
    }
    let mut scratch = init();
    (0..n).map(|i| f(&mut scratch, i)).collect()
}
