//! Long work on a thread beside Python's, so that Python hears of its stages and of Ctrl-C while it runs.

use crate::errors::Problem;
use crate::pool;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use twincal_cli::Failure;
use twincal_io::config::Config;

/// Between two looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// A stage for Python: its name, and how many of its parts are done of how many.
pub(crate) type Step = (&'static str, usize, usize);

/// Hears of each stage; [`twincal::Error::Cancelled`] once nobody waits for the result.
pub(crate) type Watch<'a> = &'a (dyn Fn(Step) -> twincal::Result<()> + Sync);

/// What the thread says.
enum Message<T> {
    Step(Step),
    Done(Box<Result<T, Problem>>),
}

/// How work is followed.
pub(crate) struct Following<'a, 'py> {
    /// Called with every stage; an exception from it ends the work.
    progress: Option<&'a Bound<'py, PyAny>>,
    /// Threads; `None`: those that all calls share.
    threads: Option<usize>,
}

impl<'a, 'py> Following<'a, 'py> {
    /// On as many threads as the config asks for.
    pub(crate) fn of(
        config: &Config,
        progress: Option<&'a Bound<'py, PyAny>>,
    ) -> Result<Self, Problem> {
        let threads = config.settings()?.threads;
        Ok(Self { progress, threads })
    }
}

impl Following<'_, '_> {
    /// Nobody hears of stages, threads are shared.
    pub(crate) const SILENTLY: Self = Self {
        progress: None,
        threads: None,
    };

    /// Runs work while other threads of Python run; Ctrl-C returns at once, and the work ends at its next look at `watch`.
    pub(crate) fn run<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(Watch<'_>) -> Result<T, Problem> + Send + 'static,
    ) -> PyResult<T> {
        self.until(py, &Arc::new(AtomicBool::new(false)), work)
    }

    /// [`Self::run`] of work that looks at `stop` as well, which is true once nobody waits for the result.
    pub(crate) fn until<T: Send + 'static>(
        &self,
        py: Python<'_>,
        stop: &Arc<AtomicBool>,
        work: impl FnOnce(Watch<'_>) -> Result<T, Problem> + Send + 'static,
    ) -> PyResult<T> {
        let messages = start(self.threads, stop, work).map_err(|problem| problem.raise(py))?;
        let outcome = follow(py, &messages, self.progress);
        if outcome.is_err() {
            stop.store(true, Ordering::Relaxed);
        }
        outcome?.map_err(|problem| problem.raise(py))
    }
}

/// Starts the thread.
fn start<T: Send + 'static>(
    threads: Option<usize>,
    stop: &Arc<AtomicBool>,
    work: impl FnOnce(Watch<'_>) -> Result<T, Problem> + Send + 'static,
) -> Result<Mutex<Receiver<Message<T>>>, Problem> {
    let (send, receive): (Sender<Message<T>>, _) = channel();
    let stop = Arc::clone(stop);
    let run = move || {
        let steps = Mutex::new(send.clone());
        let watch = |step: Step| {
            if stop.load(Ordering::Relaxed) {
                return Err(twincal::Error::Cancelled);
            }
            let send = steps.lock().unwrap_or_else(PoisonError::into_inner);
            // Nobody listens to work that was given up.
            send.send(Message::Step(step))
                .map_err(|_| twincal::Error::Cancelled)
        };
        let done = pool::work(threads, || work(&watch));
        // Nobody listens to work that was given up.
        let _ = send.send(Message::Done(Box::new(done)));
    };
    let thread = std::thread::Builder::new()
        .name("twincal".into())
        .spawn(run);
    thread.map_err(|e| {
        let failure = Failure::usage(
            format!("cannot start a thread: {e}"),
            "raise the limit of processes (ulimit -u)",
        );
        Problem::from(failure)
    })?;
    Ok(Mutex::new(receive))
}

/// Hears what the thread says until it is done; Ctrl-C and exceptions of `progress` end it.
fn follow<T: Send>(
    py: Python<'_>,
    messages: &Mutex<Receiver<Message<T>>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Result<T, Problem>> {
    loop {
        let next = py.detach(|| {
            let messages = messages.lock().unwrap_or_else(PoisonError::into_inner);
            messages.recv_timeout(LOOK)
        });
        match next {
            Ok(Message::Done(result)) => return Ok(*result),
            Ok(Message::Step(step)) => {
                if let Some(progress) = progress {
                    progress.call1(step)?;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Ok(Err(Problem::Panicked("the thread of a call ended".into())));
            }
        }
        py.check_signals()?;
    }
}
