//! Decoded blocks, kept up to a number of bytes.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// A cache of blocks of heights with a limit in bytes; the one unused for longest goes first. Shared by threads, and by any number of
/// rasters, each of which takes an [`owner`](BlockCache::owner) of its own.
///
/// The limit is kept, except by a single block larger than it, which is kept alone. Two threads that miss the same block both make
/// it: nothing waits for another's work.
#[derive(Debug)]
pub struct BlockCache {
    limit: usize,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// By owner and number.
    blocks: HashMap<(usize, usize), Kept>,
    owners: usize,
    bytes: usize,
    clock: u64,
}

/// A block and the time of its last use.
type Kept = (Arc<[f64]>, u64);

impl BlockCache {
    /// An empty cache of at most this many bytes.
    #[must_use]
    pub fn new(limit: usize) -> Self {
        BlockCache { limit, state: Mutex::default() }
    }

    /// A number that tells the blocks of one raster from those of others.
    pub fn owner(&self) -> usize {
        let state = &mut *self.lock();
        state.owners += 1;
        state.owners
    }

    /// The block of this owner and number: a kept one, or what `make` gives.
    ///
    /// # Errors
    /// Those of `make`; nothing is kept then.
    pub fn get<E>(
        &self,
        block: (usize, usize),
        make: impl FnOnce() -> Result<Vec<f64>, E>,
    ) -> Result<Arc<[f64]>, E> {
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

    fn find(&self, block: (usize, usize)) -> Option<Arc<[f64]>> {
        let state = &mut *self.lock();
        state.clock += 1;
        let entry = state.blocks.get_mut(&block)?;
        entry.1 = state.clock;
        Some(entry.0.clone())
    }

    fn keep(&self, block: (usize, usize), made: &Arc<[f64]>) {
        let size = std::mem::size_of_val::<[f64]>(made);
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
        cache.get((0, n), make).unwrap()
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
    fn a_block_beyond_the_limit_is_kept_alone_and_errors_are_not() {
        let (cache, mut made) = (BlockCache::new(8), 0);
        for n in [0, 0, 1, 1, 0] {
            block(&cache, n, &mut made);
            assert_eq!(cache.bytes(), 32);
        }
        let cache = BlockCache::new(64);
        assert_eq!(cache.get((0, 0), || Err("no")), Err::<Arc<[f64]>, _>("no"));
        block(&cache, 0, &mut made);
        assert_eq!(made, 4);
    }

    #[test]
    fn owners_share_the_limit_and_not_their_blocks() {
        let cache = BlockCache::new(64);
        let (a, b) = (cache.owner(), cache.owner());
        let get = |owner, h: f64| cache.get((owner, 0), || Ok::<_, ()>(vec![h; 4])).unwrap()[0];
        assert_eq!([get(a, 1.0), get(b, 2.0), get(a, 3.0), get(b, 3.0)], [1.0, 2.0, 1.0, 2.0]);
        assert_eq!(cache.bytes(), 64);
    }
}
