//! Decoded blocks, kept up to a number of bytes.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// A cache of blocks of heights with a limit in bytes; the one unused for longest goes first. Shared by threads.
///
/// The limit is kept except by a single block larger than it, which is not kept at all. Two threads that miss the same block both make
/// it: nothing waits for another's work.
#[derive(Debug)]
pub struct BlockCache {
    limit: usize,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    blocks: HashMap<usize, (Arc<[f64]>, u64)>,
    bytes: usize,
    clock: u64,
}

impl BlockCache {
    /// An empty cache of at most this many bytes.
    #[must_use]
    pub fn new(limit: usize) -> Self {
        BlockCache { limit, state: Mutex::default() }
    }

    /// The block of this number: a kept one, or what `make` gives.
    ///
    /// # Errors
    /// Those of `make`; nothing is kept then.
    pub fn get<E>(&self, block: usize, make: impl FnOnce() -> Result<Vec<f64>, E>) -> Result<Arc<[f64]>, E> {
        if let Some(found) = self.find(block) {
            return Ok(found);
        }
        let made: Arc<[f64]> = make()?.into();
        self.keep(block, &made);
        Ok(made)
    }

    /// Bytes held now.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.lock().bytes
    }

    // A thread that panicked elsewhere leaves nothing half done here.
    fn lock(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn find(&self, block: usize) -> Option<Arc<[f64]>> {
        let state = &mut *self.lock();
        state.clock += 1;
        let entry = state.blocks.get_mut(&block)?;
        entry.1 = state.clock;
        Some(entry.0.clone())
    }

    fn keep(&self, block: usize, made: &Arc<[f64]>) {
        let size = std::mem::size_of_val::<[f64]>(made);
        if size > self.limit {
            return;
        }
        let state = &mut *self.lock();
        while state.bytes + size > self.limit {
            // Blocks are large, so there are few: a scan costs little beside decoding one.
            let Some(oldest) = state.blocks.iter().min_by_key(|(_, v)| v.1).map(|(&k, _)| k) else { break };
            if let Some((gone, _)) = state.blocks.remove(&oldest) {
                state.bytes -= std::mem::size_of_val::<[f64]>(&gone);
            }
        }
        let stamp = state.clock;
        if let Some((before, _)) = state.blocks.insert(block, (made.clone(), stamp)) {
            state.bytes -= std::mem::size_of_val::<[f64]>(&before);
        }
        state.bytes += size;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(cache: &BlockCache, n: usize, made: &mut usize) -> Arc<[f64]> {
        let make = || {
            *made += 1;
            Ok::<_, ()>(vec![n as f64; 4])
        };
        cache.get(n, make).unwrap()
    }

    #[test]
    fn what_was_used_last_stays_and_the_limit_holds() {
        let (cache, mut made) = (BlockCache::new(64), 0);
        for n in [0, 1, 0, 2, 0, 1] {
            assert_eq!(block(&cache, n, &mut made)[3], n as f64);
            assert!(cache.bytes() <= 64);
        }
        // 1 went when 2 came, because 0 had been used since.
        assert_eq!(made, 4);
    }

    #[test]
    fn a_block_beyond_the_limit_is_not_kept_and_errors_are_not_either() {
        let (cache, mut made) = (BlockCache::new(8), 0);
        block(&cache, 0, &mut made);
        block(&cache, 0, &mut made);
        assert_eq!((made, cache.bytes()), (2, 0));
        let cache = BlockCache::new(64);
        assert_eq!(cache.get(0, || Err("no")), Err::<Arc<[f64]>, _>("no"));
        block(&cache, 0, &mut made);
        assert_eq!(made, 3);
    }
}
