//! How far a long step has come: a moving line for a person who watches, plain lines for a file.

use crate::clock::Stopwatch;
use crate::terminal::{Terminal, clean};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::cell::{Cell, RefCell};
use std::time::Duration;

/// Seconds of a step from which on what is left of it is estimated.
const WORTH_AN_ESTIMATE: f64 = 2.0;

thread_local! {
    /// Commands of this thread run for a program that shows nothing.
    static SILENT: Cell<bool> = const { Cell::new(false) };
}

/// Runs a command on this thread without any progress on standard error.
pub(crate) fn silently<T>(command: impl FnOnce() -> T) -> T {
    let before = SILENT.replace(true);
    let result = command();
    SILENT.set(before);
    result
}

/// Progress of one command, on standard error.
pub(crate) struct Progress {
    shown: Shown,
    /// The step that is counted, and since when.
    counted: RefCell<Option<(String, Stopwatch)>>,
}

/// How it is shown.
enum Shown {
    Moving(ProgressBar),
    Lines,
    Nothing,
}

impl Progress {
    pub(crate) fn new() -> Self {
        if SILENT.get() {
            return Self::silent();
        }
        if !Terminal::is_watched() {
            return Self::shown(Shown::Lines);
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} {elapsed:.dim}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(120));
        Self::shown(Shown::Moving(bar))
    }

    /// Shows nothing.
    pub(crate) fn silent() -> Self {
        Self::shown(Shown::Nothing)
    }

    fn shown(shown: Shown) -> Self {
        Self {
            shown,
            counted: RefCell::default(),
        }
    }

    /// Begins a step.
    pub(crate) fn step(&self, what: &str) {
        match &self.shown {
            Shown::Moving(bar) => bar.set_message(clean(what)),
            // Nobody is left to be told when standard error is closed.
            Shown::Lines => drop(std::io::Write::write_all(
                &mut std::io::stderr().lock(),
                format!("{}\n", clean(what)).as_bytes(),
            )),
            Shown::Nothing => {}
        }
    }

    /// How far a step has come that has `all` parts, with an estimate of what is left of it.
    pub(crate) fn counted(&self, what: &str, done: usize, all: usize) {
        let seconds = {
            let mut counted = self.counted.borrow_mut();
            let same = counted.as_ref().is_some_and(|(step, _)| step == what);
            if done == 0 || !same {
                *counted = Some((what.to_owned(), Stopwatch::start()));
            }
            counted.as_ref().map_or(0.0, |(_, since)| since.seconds())
        };
        if matches!(self.shown, Shown::Lines) && !begins_a_tenth(done, all) {
            return;
        }
        let left = left(seconds, done, all);
        self.step(&format!("{what}: {done} of {all} done{left}"));
    }
}

/// Whether the first of `all` parts of a further tenth is done: a file has ten lines of a step and not one for every part.
fn begins_a_tenth(done: usize, all: usize) -> bool {
    let tenth = |done: usize| 10 * done / all.max(1);
    done == 0 || tenth(done) > tenth(done - 1)
}

/// ", about 12 s left", once a step has taken more than two seconds.
fn left(seconds: f64, done: usize, all: usize) -> String {
    if done == 0 || seconds < WORTH_AN_ESTIMATE {
        return String::new();
    }
    let left = seconds / done as f64 * all.saturating_sub(done) as f64;
    match left.ceil() as u64 {
        few @ 0..120 => format!(", about {few} s left"),
        many => format!(", about {} min left", many.div_ceil(60)),
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Shown::Moving(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{begins_a_tenth, left};

    #[test]
    fn a_file_has_a_line_for_every_tenth() {
        let lines = |all: usize| (0..=all).filter(|&done| begins_a_tenth(done, all)).count();
        assert_eq!([3, 10, 64, 1000].map(lines), [4, 11, 11, 11]);
    }

    #[test]
    fn what_is_left_is_estimated_beyond_two_seconds() {
        assert_eq!(left(1.9, 1, 10), "");
        assert_eq!(left(9.0, 0, 10), "");
        assert_eq!(left(4.0, 2, 8), ", about 12 s left");
        assert_eq!(left(60.0, 1, 8), ", about 7 min left");
    }
}
