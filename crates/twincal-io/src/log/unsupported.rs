//! Errors of a build that leaves out some kinds of logs.

use crate::error::{Error, Place};

/// A table that is not text.
#[cfg(not(feature = "tables"))]
pub(super) fn table(name: &str) -> Error {
    Error::content(
        Place::file(name),
        "is a Parquet, Arrow or NPZ table, which this build of twincal-io does not read",
        "build it with the feature `tables`, or save the log as CSV",
    )
}

/// A bag.
#[cfg(not(feature = "bags"))]
pub(super) fn bag(name: &str) -> Error {
    Error::content(
        Place::file(name),
        "is an MCAP file or a rosbag2, which this build of twincal-io does not read",
        "build it with the feature `bags`, or save the log as CSV",
    )
}
