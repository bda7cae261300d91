//! What fitting all logs will take in memory, told when it is known how many rows they have and before these are made.

use super::other_cutoffs::{FACTORS, scaled};
use crate::error::{Error, Result};
use crate::signal::{Pipeline, ReadyLog};
use crate::term::Library;

/// Numbers of a row and joint besides its columns: motion, torques, weight.
const BESIDE: usize = 10;
/// The same of a row whose columns and motion are put away.
const LEFT: usize = 6;
/// Numbers of a sample and joint: pieces (4), smooth motion with torques (5), the same at another cut-off (5).
const OF_A_SAMPLE: usize = 14;

/// Refuses logs that need more than `most` bytes for smooth motion and rows; where the cut-off is swept, rows of the largest one stand
/// beside those of the fit.
///
/// # Errors
/// [`Error::Log`] about the log with the most rows.
pub(in crate::calibrate) fn require(
    most: Option<u64>,
    library: &Library,
    pipeline: &Pipeline,
    (fit, heldout): (&[ReadyLog<'_>], &[ReadyLog<'_>]),
    sweeps: bool,
) -> Result<()> {
    let Some(most) = most else {
        return Ok(());
    };
    let rows = |log: &ReadyLog<'_>| log.rows_at_most(pipeline);
    let widest = scaled(pipeline, FACTORS.into_iter().fold(0.0, f64::max));
    let again: usize = if sweeps && !pipeline.is_off() {
        // One log, or chapter, after the other.
        let of_log = |log: &ReadyLog<'_>| log.rows_at_most(&widest) / log.chapters();
        fit.iter().map(of_log).max().unwrap_or(0)
    } else {
        0
    };
    let all = || fit.iter().chain(heldout);
    let samples: usize = all().map(ReadyLog::samples).sum();
    let of_a_sample = OF_A_SAMPLE + 2 * pipeline.channels();
    let numbers: usize = (0..library.joints())
        .map(|joint| library.recipes(joint).parts() + BESIDE)
        .sum();
    // Rows that are put away leave torques, weights and what is summed over them.
    let of_rows = |log: &ReadyLog<'_>| {
        let numbers = if log.puts_away() {
            library.joints() * LEFT
        } else {
            numbers
        };
        rows(log) as f64 * numbers as f64
    };
    let needed = all().map(of_rows).sum::<f64>()
        + again as f64 * numbers as f64
        + (samples * library.joints() * of_a_sample) as f64;
    let needed = needed * size_of::<f64>() as f64;
    let longest = all().max_by_key(|log| rows(log));
    match longest {
        Some(log) if needed > most as f64 => Err(Error::Log {
            log: log.name().to_owned(),
            problem: format!(
                "fitting all logs needs about {:.1} MB of memory, and {:.1} MB are free; this log has {} rows of {} columns",
                1e-6 * needed,
                1e-6 * most as f64,
                rows(log),
                library.columns().len(),
            ),
            remedy: if pipeline.is_off() {
                "set [signal] cutoff_hz to \"auto\" or a number, name fewer [library] families, or give fewer or shorter logs"
            } else {
                "lower [signal] rate_hz or cutoff_hz, name fewer [library] families, or give fewer or shorter logs"
            }
            .into(),
        }),
        _ => Ok(()),
    }
}
