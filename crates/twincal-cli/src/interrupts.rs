//! Ctrl-C: ends the program at once, or, for a command that can end well, tells it to.

use signal_hook::SigId;
use signal_hook::consts::SIGINT;
use signal_hook::flag;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// True while Ctrl-C ends the program.
static ENDS: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// From here on Ctrl-C ends the program with 130: what is on disk is complete at any moment.
pub(crate) fn end_the_program() {
    let ends = ENDS.get_or_init(|| Arc::new(AtomicBool::new(true)));
    // Where a handler cannot be installed the system's own reaction stays.
    let _ = flag::register_conditional_shutdown(SIGINT, 130, Arc::clone(ends));
}

/// Ctrl-C as something to ask for, until this value is dropped; a second one ends the program.
pub(crate) struct Caught {
    asked: Arc<AtomicBool>,
    handlers: Vec<SigId>,
}

impl Caught {
    pub(crate) fn new() -> Self {
        let asked = Arc::new(AtomicBool::new(false));
        let mut handlers = Vec::new();
        if let Some(ends) = ENDS.get() {
            ends.store(false, Ordering::SeqCst);
            // In the order of registration: the second Ctrl-C finds what the first one left.
            let second = flag::register_conditional_shutdown(SIGINT, 130, Arc::clone(&asked));
            let first = flag::register(SIGINT, Arc::clone(&asked));
            handlers.extend(second.into_iter().chain(first));
        }
        Self { asked, handlers }
    }

    pub(crate) fn is_asked(&self) -> bool {
        self.asked.load(Ordering::SeqCst)
    }
}

impl Drop for Caught {
    fn drop(&mut self) {
        for handler in self.handlers.drain(..) {
            signal_hook::low_level::unregister(handler);
        }
        if let Some(ends) = ENDS.get() {
            ends.store(true, Ordering::SeqCst);
        }
    }
}
