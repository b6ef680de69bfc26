//! Where finished blocks are put aside.

use std::collections::HashMap;
use std::io;
use std::sync::{Mutex, PoisonError};

/// Keeps bytes by name. What was put is there whole or not at all, also after the process was killed.
pub trait Store: Sync {
    /// True if there is something of this name.
    ///
    /// # Errors
    /// The system's.
    fn has(&self, name: &str) -> io::Result<bool>;

    /// What was put there.
    ///
    /// # Errors
    /// The system's; nothing of this name.
    fn get(&self, name: &str) -> io::Result<Vec<u8>>;

    /// The first `bytes` of what was put there, or all of it if that is less.
    ///
    /// # Errors
    /// As [`Store::get`].
    fn start(&self, name: &str, bytes: usize) -> io::Result<Vec<u8>>;

    /// Puts bytes there.
    ///
    /// # Errors
    /// The system's.
    fn put(&self, name: &str, bytes: &[u8]) -> io::Result<()>;

    /// Removes what was put there, if there is anything.
    ///
    /// # Errors
    /// The system's.
    fn remove(&self, name: &str) -> io::Result<()>;
}

/// A store in memory.
#[derive(Debug, Default)]
pub struct InMemory(Mutex<HashMap<String, Vec<u8>>>);

impl Store for InMemory {
    fn has(&self, name: &str) -> io::Result<bool> {
        Ok(self.0.lock().unwrap_or_else(PoisonError::into_inner).contains_key(name))
    }

    fn get(&self, name: &str) -> io::Result<Vec<u8>> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.get(name).cloned().ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, name.to_string()))
    }

    fn start(&self, name: &str, bytes: usize) -> io::Result<Vec<u8>> {
        self.get(name).map(|mut all| {
            all.truncate(bytes);
            all
        })
    }

    fn remove(&self, name: &str) -> io::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(name);
        Ok(())
    }

    fn put(&self, name: &str, bytes: &[u8]) -> io::Result<()> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.insert(name.to_string(), bytes.to_vec());
        Ok(())
    }
}
