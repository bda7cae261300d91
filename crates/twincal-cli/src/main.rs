//! The program `twincal`; everything it does is in the library beside it, so that the Python package runs the same.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(twincal_cli::run(std::env::args_os()))
}
