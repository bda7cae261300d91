//! Work outside the GIL: on threads of this process alone, so that a forked child never waits for threads that only its parent has.

use crate::errors::Problem;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};
use twincal_cli::Failure;

/// The process that the threads belong to, and the threads.
static SHARED: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

fn start(threads: usize) -> Result<Arc<ThreadPool>, Problem> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map(Arc::new).map_err(|e| {
        let failure = Failure::usage(
            format!("cannot start the threads: {e}"),
            "give fewer with threads=, or raise the limits of memory and processes",
        );
        failure.into()
    })
}

/// Threads that all calls of this process share, one per core, or as many as are asked for, for one call.
fn threads(wanted: Option<usize>) -> Result<Arc<ThreadPool>, Problem> {
    if let Some(wanted) = wanted {
        return start(wanted);
    }
    let own = std::process::id();
    let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
    match shared.take() {
        Some((process, pool)) if process == own => {
            *shared = Some((own, Arc::clone(&pool)));
            Ok(pool)
        }
        of_parent => {
            // Ending threads that this process does not have would wait for them.
            std::mem::forget(of_parent);
            let pool = start(0)?;
            *shared = Some((own, Arc::clone(&pool)));
            Ok(pool)
        }
    }
}

/// Words of a panic.
fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    text.unwrap_or("no message").to_owned()
}

/// Runs work on the threads of this process.
pub(crate) fn work<T: Send, E: Send + Into<Problem>>(
    wanted: Option<usize>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> Result<T, Problem> {
    let pool = threads(wanted)?;
    let apart = || twincal_cli::session::apart(work);
    match catch_unwind(AssertUnwindSafe(|| pool.install(apart))) {
        Ok(result) => result.map_err(Into::into),
        Err(panic) => Err(Problem::Panicked(words(&*panic))),
    }
}

/// [`work`] while other threads of Python run.
pub(crate) fn detached<T: Send, E: Send + Into<Problem>>(
    py: Python<'_>,
    wanted: Option<usize>,
    own: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    py.detach(|| work(wanted, own))
        .map_err(|problem| problem.raise(py))
}

/// Refuses numbers that the memory does not hold, before they are allocated: a failed allocation ends the process.
pub(crate) fn require_memory(what: &str, sizes: &[usize]) -> Result<(), Problem> {
    let numbers = sizes
        .iter()
        .fold(1_u64, |all, &own| all.saturating_mul(own as u64));
    // a result and a copy of it
    let bytes = numbers.saturating_mul(16);
    Ok(twincal_io::memory::require(
        what,
        bytes,
        "ask for fewer at a time",
    )?)
}
