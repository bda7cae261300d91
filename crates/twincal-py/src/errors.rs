//! Errors of the other crates as exceptions of `twincal.errors`: class, code, problem and remedy.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use twincal::Error as Core;
use twincal_cli::Failure;
use twincal_io::Error;

/// What a call in the other crates may end with.
#[derive(Debug)]
pub(crate) enum Problem {
    /// It refused, with a reason.
    Failed(Failure),
    /// It panicked: a mistake in twincal.
    Panicked(String),
}

impl From<Failure> for Problem {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        Self::Failed(error.into())
    }
}

impl From<Core> for Problem {
    fn from(error: Core) -> Self {
        Self::Failed(error.into())
    }
}

/// `exception_for(code, problem, remedy)` of `twincal.errors`.
static MAKE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

/// The code of a failure: which exception it becomes.
fn code(failure: &Failure) -> &'static str {
    match failure {
        Failure::Usage { .. } | Failure::Unprinted { .. } => "usage",
        Failure::Error(Error::Content { .. }) => "content",
        Failure::Error(Error::System { .. }) => "system",
        Failure::Error(Error::Core(core)) => match core {
            Core::Model { .. } => "model",
            Core::Log { .. } | Core::Unit { .. } => "log",
            Core::Term { .. } => "term",
            Core::Setting { .. } => "setting",
            Core::Refused { .. } => "refused",
            Core::NotFinite { .. } => "not_finite",
            Core::Statistics { .. } => "statistics",
            _ => "cancelled",
        },
        Failure::Error(_) => "internal",
    }
}

impl Problem {
    fn parts(&self) -> (&'static str, String, String) {
        match self {
            Self::Failed(failure) => {
                let (problem, remedy) = failure.words();
                (code(failure), problem, remedy.unwrap_or_default())
            }
            Self::Panicked(message) => (
                "internal",
                format!("a mistake in twincal: {message}"),
                "please report it, with the input if you may".into(),
            ),
        }
    }

    /// The exception.
    pub(crate) fn raise(&self, py: Python<'_>) -> PyErr {
        let (code, problem, remedy) = self.parts();
        let made = MAKE
            .import(py, "twincal.errors", "exception_for")
            .and_then(|make| make.call1((code, problem, remedy)));
        match made {
            Ok(exception) => PyErr::from_value(exception),
            Err(error) => error,
        }
    }
}
