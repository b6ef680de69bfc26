//! Loops over independent pieces: rayon with feature `parallel`, plain loops without. Results come in order.

/// Calls `f` on every item.
pub(super) fn map<T: Send, R: Send>(items: Vec<T>, f: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    map_with_place(items, || (), |(), item| f(item))
}

/// The same with something that each thread has of its own: what is in it must make no difference.
pub(super) fn map_with_place<T: Send, R: Send, P>(
    items: Vec<T>,
    place: impl Fn() -> P + Sync + Send,
    f: impl Fn(&mut P, T) -> R + Sync + Send,
) -> Vec<R> {
    #[cfg(feature = "parallel")]
    if items.len() > 1 && rayon::current_num_threads() > 1 {
        use rayon::prelude::*;
        return items.into_par_iter().map_init(place, f).collect();
    }
    let mut own = place();
    items.into_iter().map(|item| f(&mut own, item)).collect()
}
