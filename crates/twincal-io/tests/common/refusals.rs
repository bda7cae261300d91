//! What refusals say.

/// The text of an error that has to be there.
#[track_caller]
pub(crate) fn refused<T: std::fmt::Debug, E: std::fmt::Display>(result: Result<T, E>) -> String {
    match result {
        Ok(value) => panic!("must be refused: {value:?}"),
        Err(error) => error.to_string(),
    }
}

/// A message has every part.
#[track_caller]
pub(crate) fn contains(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}
