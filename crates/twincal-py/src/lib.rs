//! The extension module `twincal._twincal`: conversions between Python and the other crates, nothing else. Shapes and types of arrays are checked in
//! the Python layer above it; statistics are those of the crate `twincal`.

mod calibration;
mod errors;
mod fit;
mod follow;
mod log;
mod pool;
mod regression;
mod robot;
mod settings;
mod statistics;
mod table_columns;
mod tables;

use follow::Following;
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The extension module.
#[pymodule]
mod _twincal {
    #[pymodule_export]
    use super::calibration::Calibration;
    #[pymodule_export]
    use super::log::Log;
    #[pymodule_export]
    use super::regression::{Regression, decoys, regress};
    #[pymodule_export]
    use super::robot::Robot;
    #[pymodule_export]
    use super::statistics::{Plan, Statistics, plan};
    #[pymodule_export]
    use super::tables::Table;
    #[pymodule_export]
    use super::{call, command, fit::fit, fit::fit_statistics, fit::log_settings, version};
}

/// Version of the package, which is that of the program.
#[pyfunction]
fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// The program `twincal` with its arguments, its own name first; returns the exit code.
#[pyfunction]
fn command(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| twincal_cli::run(arguments))
}

/// A command of the program without its name: exit code and what it prints on standard output. After Ctrl-C it writes no result.
#[pyfunction]
fn call(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> PyResult<(u8, String)> {
    let given_up = Arc::new(AtomicBool::new(false));
    let own = Arc::clone(&given_up);
    Following::SILENTLY.until(py, &given_up, move |_| {
        Ok(twincal_cli::session::call(arguments, &own)?)
    })
}
