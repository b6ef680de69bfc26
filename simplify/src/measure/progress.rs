//! Progress and cancelling of loops over chunks.

use super::MeasureError;
use crate::options::Control;
use std::sync::Mutex;

/// Counts work done, in whatever units, and tells the caller.
pub(super) struct Progress<'a> {
    control: &'a dyn Control,
    total: f64,
    done: Mutex<f64>,
}

impl<'a> Progress<'a> {
    pub(super) fn new(control: &'a dyn Control, total: usize) -> Self {
        Progress { control, total: total.max(1) as f64, done: Mutex::new(0.0) }
    }

    /// `units` more are done. The lock is held while telling, so that what the caller hears never falls.
    pub(super) fn add(&self, units: usize) {
        if let Ok(mut done) = self.done.lock() {
            *done += units as f64;
            self.control.progress((*done / self.total).min(1.0));
        }
    }

    /// An error once the caller wants to stop.
    pub(super) fn check(&self) -> Result<(), MeasureError> {
        if self.control.cancelled() { Err(MeasureError::Cancelled) } else { Ok(()) }
    }
}
