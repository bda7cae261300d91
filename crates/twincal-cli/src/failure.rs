//! Why the program ends early, in words and as an exit code.

use std::panic::PanicHookInfo;
use twincal_io::Error;

/// A gate of `check` said no.
pub(crate) const GATE: u8 = 1;
/// Wrong usage, config or input.
pub(crate) const INPUT: u8 = 2;
/// Done, but data was lost or degraded beyond the stated limit, the answer is not yes, or the result could not be printed.
pub(crate) const DEGRADED: u8 = 3;
/// The data cannot answer the question.
pub(crate) const REFUSED: u8 = 4;
/// Our bug.
pub(crate) const BUG: u8 = 70;

/// Why a command could not do what it was asked.
#[derive(Debug)]
pub enum Failure {
    /// A file, a setting or the mathematics refused.
    Error(Error),
    /// The result is complete in its place, what was to be printed of it is lost.
    Unprinted {
        /// What is wrong.
        problem: String,
        /// Where the result is.
        remedy: String,
    },
    /// The arguments do not fit together.
    Usage {
        /// What is wrong.
        problem: String,
        /// How to fix it.
        remedy: String,
    },
}

/// What a command ends with: an exit code, or why it could not do its work.
pub type Outcome<T> = Result<T, Failure>;

impl Failure {
    /// Arguments that do not fit together.
    pub fn usage(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Usage {
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }

    /// Exit code of the program.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Error(Error::Core(twincal::Error::Refused { .. })) => REFUSED,
            Self::Error(Error::Internal { .. }) => BUG,
            // Code 2 says that nothing was written.
            Self::Unprinted { .. } => DEGRADED,
            Self::Error(_) | Self::Usage { .. } => INPUT,
        }
    }

    /// What `--json` prints instead of a result.
    pub(crate) fn json(&self) -> serde_json::Value {
        let (problem, remedy) = self.words();
        serde_json::json!({
            "error": { "exit_code": self.exit_code(), "problem": problem, "remedy": remedy }
        })
    }

    /// What is wrong; how to fix it.
    #[must_use]
    pub fn in_one_line(&self) -> String {
        let (problem, remedy) = self.words();
        let remedy = remedy.map_or_else(String::new, |remedy| format!("; {remedy}"));
        problem + &remedy
    }

    /// What is wrong, and how to fix it.
    #[must_use]
    pub fn words(&self) -> (String, Option<String>) {
        match self {
            Self::Usage { problem, remedy } | Self::Unprinted { problem, remedy } => {
                (problem.clone(), Some(remedy.clone()))
            }
            Self::Error(error) => {
                let message = error.to_string();
                match remedy_of(error).and_then(|remedy| {
                    Some((message.strip_suffix(remedy)?.strip_suffix("; ")?, remedy))
                }) {
                    Some((problem, remedy)) => (problem.to_owned(), Some(remedy.to_owned())),
                    None => (message, None),
                }
            }
        }
    }
}

/// The part of an error that says how to fix it; it stands at the end of its message.
fn remedy_of(error: &Error) -> Option<&str> {
    match error {
        Error::Content { remedy, .. } | Error::System { remedy, .. } => Some(remedy),
        Error::Core(core) => core.remedy(),
        _ => None,
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

impl From<twincal::Error> for Failure {
    fn from(error: twincal::Error) -> Self {
        Self::Error(error.into())
    }
}

/// What a panic says: it is our mistake, and nothing was written.
pub(crate) fn report_panic(info: &PanicHookInfo<'_>) {
    let message = info.payload_as_str().unwrap_or("no message");
    let place = info
        .location()
        .map(|at| format!(" ({}:{})", at.file(), at.line()))
        .unwrap_or_default();
    let command: Vec<_> = std::env::args_os()
        .map(|word| word.to_string_lossy().into_owned())
        .collect();
    let text = format!(
        "twincal: this is our bug, not yours; the last complete result is untouched.\n\
         Please report it with the lines below and, if you may, the input.\n  \
         twincal {}: {message}{place}\n  {}\n",
        env!("CARGO_PKG_VERSION"),
        command.join(" ")
    );
    // There is nobody left to tell if standard error is closed.
    let _ = std::io::Write::write_all(&mut std::io::stderr().lock(), text.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use twincal_io::Place;

    #[test]
    fn message_is_cut_into_problem_and_remedy() {
        let error = Error::content(Place::line("a; b.csv", 3), "bad; number", "fix; it");
        let (problem, remedy) = Failure::from(error).words();
        assert_eq!(
            (problem.as_str(), remedy.as_deref()),
            ("a; b.csv:3: bad; number", Some("fix; it"))
        );
    }

    #[test]
    fn exit_codes_follow_the_contract() {
        let refused = twincal::Error::Refused {
            problem: "p".into(),
            remedy: "r".into(),
        };
        assert_eq!(Failure::from(refused).exit_code(), 4);
        assert_eq!(Failure::usage("p", "r").exit_code(), 2);
        assert_eq!(
            Failure::from(Error::content(Place::file("f"), "p", "r")).exit_code(),
            2
        );
        assert_eq!(
            Failure::from(Error::Internal {
                what: "w".into(),
                problem: "p".into()
            })
            .exit_code(),
            70
        );
    }
}
