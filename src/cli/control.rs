//! Ctrl-C and the progress bar.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use progmesh::simplify::Control;
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Ctrl-C, as a flag.
#[derive(Clone, Debug, Default)]
pub(crate) struct Interrupt {
    set: Arc<AtomicBool>,
    /// False while nothing that must be undone is under way: the process may simply end.
    graceful: Arc<AtomicBool>,
}

impl Interrupt {
    /// Watches for Ctrl-C. At first it ends the process; after [`Interrupt::be_graceful`] it sets the flag.
    pub(crate) fn watch() -> Self {
        let interrupt = Interrupt::default();
        let seen = interrupt.clone();
        // If there is no handler to be had, Ctrl-C ends the process as it would anyway.
        let _ = ctrlc::set_handler(move || {
            seen.set.store(true, Ordering::SeqCst);
            if !seen.graceful.load(Ordering::SeqCst) {
                super::common::print_error("interrupted; nothing was written");
                std::process::exit(130);
            }
        });
        interrupt
    }

    /// From now on, work looks at the flag itself.
    pub(crate) fn be_graceful(&self) {
        self.graceful.store(true, Ordering::SeqCst);
    }

    pub(crate) fn is_set(&self) -> bool {
        self.set.load(Ordering::SeqCst)
    }
}

/// Shows progress on a terminal, and passes Ctrl-C on.
pub(crate) struct Progress<'a> {
    interrupt: &'a Interrupt,
    bar: ProgressBar,
}

const STEPS: u64 = 1000;

impl<'a> Progress<'a> {
    pub(crate) fn new(interrupt: &'a Interrupt, quiet: bool, doing: &str) -> Self {
        let target = if quiet || !std::io::stderr().is_terminal() {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        let bar = ProgressBar::with_draw_target(Some(STEPS), target);
        let template = format!("{doing} [{{bar:40}}] {{percent:>3}} % {{eta:>4}} left");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style.progress_chars("=> "));
        }
        Progress { interrupt, bar }
    }
}

impl Control for Progress<'_> {
    fn progress(&self, done: f64) {
        self.bar.set_position((done.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }

    fn cancelled(&self) -> bool {
        self.interrupt.is_set()
    }
}

impl Drop for Progress<'_> {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
