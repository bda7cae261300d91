//! Ctrl-C: ends the program at once, or, for a command that can end well, asks it to. A command that another program called is given up by
//! that program.

use crate::failure::Outcome;
use signal_hook::SigId;
use signal_hook::consts::SIGINT;
use signal_hook::flag;
use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

thread_local! {
    /// True once the caller of the work on this thread gave it up; none where it cannot.
    static GIVEN_UP: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// Runs work on this thread for a caller that may give it up, or for one that does not. A thread that waits may do the work of another caller
/// meanwhile: that work has its own token, and the token of this one is there again afterwards, also behind a panic.
pub(crate) fn called<T>(given_up: Option<Arc<AtomicBool>>, work: impl FnOnce() -> T) -> T {
    struct Before(Option<Arc<AtomicBool>>);
    impl Drop for Before {
        fn drop(&mut self) {
            GIVEN_UP.set(self.0.take());
        }
    }
    let _before = Before(GIVEN_UP.replace(given_up));
    work()
}

/// The program that called the command of a thread, if one did.
pub(crate) struct Caller {
    given_up: Option<Arc<AtomicBool>>,
}

impl Caller {
    pub(crate) fn of_this_thread() -> Self {
        let given_up = GIVEN_UP.with_borrow(Clone::clone);
        Self { given_up }
    }

    /// The next step is worth its while.
    ///
    /// # Errors
    /// [`twincal::Error::Cancelled`] once the caller gave the command up.
    pub(crate) fn require_waiting(&self) -> twincal::Result<()> {
        match &self.given_up {
            Some(given_up) if given_up.load(Ordering::SeqCst) => Err(twincal::Error::Cancelled),
            _ => Ok(()),
        }
    }
}

/// [`Caller::require_waiting`] of this thread's command.
///
/// # Errors
/// [`twincal::Error::Cancelled`] once the caller gave it up.
pub(crate) fn require_caller() -> Outcome<()> {
    Ok(Caller::of_this_thread().require_waiting()?)
}

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
        let asked = Caller::of_this_thread().given_up.unwrap_or_default();
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
