//! When and how long: for `run.log` only, never in a result.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// A stopwatch that a change of the system's clock does not disturb.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stopwatch(Instant);

impl Stopwatch {
    pub(crate) fn start() -> Self {
        Self(Instant::now())
    }

    /// Seconds since the start.
    pub(crate) fn seconds(self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

/// Now, as `2026-11-21T06:20:00Z`.
pub(crate) fn now() -> String {
    let seconds = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |d| d.as_secs());
    twincal_io::words::utc(seconds)
}
