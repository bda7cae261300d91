//! The program `twincal`: words for people, JSON for programs, exit codes for both.
//!
//! Exit codes: 0 done · 1 a gate of `check` said no · 2 wrong usage or input · 3 done, but data was lost or degraded
//! beyond the stated limit, or the summary could not be printed · 4 the data cannot answer the question · 70 our bug · 130 interrupted.
//!
//! [`run`] is the whole program, for the binary and for the command that the Python package installs. [`session`] holds its
//! steps as functions, for programs that have arrays instead of files and want values instead of text.

mod address_space;
mod args;
mod clock;
mod commands;
mod exit;
mod failure;
mod interrupts;
mod names;
mod progress;
mod terminal;

pub use commands::session;
pub use failure::{Failure, Outcome};

use clap::Parser as _;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use terminal::Terminal;

/// The program with its arguments, its own name first; returns the exit code. It takes over SIGINT, the panic hook and both
/// standard streams, and ends the process itself after `--help` and after a wrong argument.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    address_space::prepare();
    std::panic::set_hook(Box::new(failure::report_panic));
    listen_to_signals();
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        let arguments = args::Arguments::try_parse_from(arguments)
            .unwrap_or_else(|error| args::with_suggestion(error).exit());
        let mut terminal = Terminal::new();
        let outcome = commands::run(&arguments.command, &mut terminal)
            .and_then(|code| terminal.finish().map(|()| code));
        match outcome {
            Ok(code) => code,
            Err(failure) => {
                terminal.failure(&failure);
                if arguments.command.wants_json() {
                    terminal.data(&format!("{:#}\n", failure.json()));
                    // Without standard output there is the exit code.
                    let _ = terminal.finish();
                }
                failure.exit_code()
            }
        }
    }));
    outcome.unwrap_or(failure::BUG)
}

/// Ctrl-C ends the program. A write beyond the file-size limit must fail with an error instead of killing it.
fn listen_to_signals() {
    use signal_hook::{consts, flag};
    interrupts::end_the_program();
    // Where a handler cannot be installed the system's own reaction stays.
    let _ = flag::register(consts::SIGXFSZ, Arc::new(AtomicBool::new(false)));
}
