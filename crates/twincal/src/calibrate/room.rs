//! What the rows of all logs will take in memory, told before they are made.

use super::sweep::FACTORS;
use crate::error::{Error, Result};
use crate::signal::{Pipeline, PreparedLog};
use crate::term::Library;

/// Numbers of a row and joint besides its columns: motion, torques, weight.
const BESIDE: usize = 10;

/// Refuses logs whose rows need more than `most` bytes: those of the fit, and beside them those of the largest cut-off of the
/// sweep.
///
/// # Errors
/// [`Error::Log`] about the log with the most rows.
pub(super) fn require<'a>(
    most: Option<u64>,
    library: &Library,
    pipeline: &Pipeline,
    logs: impl Iterator<Item = &'a PreparedLog<'a>>,
) -> Result<()> {
    let Some(most) = most else {
        return Ok(());
    };
    let counted: Vec<(&str, f64)> = logs
        .map(|log| {
            let log = log.recording();
            (log.name.as_str(), rows(&log.time, pipeline))
        })
        .collect();
    let numbers: usize = (0..library.joints())
        .map(|joint| library.columns_of_joint(joint).len() + BESIDE)
        .sum();
    let sets = if pipeline.is_off() {
        1.0
    } else {
        1.0 + FACTORS.into_iter().fold(0.0, f64::max)
    };
    let bytes = |rows: f64| sets * rows * (numbers * size_of::<f64>()) as f64;
    let needed = bytes(counted.iter().map(|(_, rows)| rows).sum());
    let longest = counted.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    match longest {
        Some((log, rows)) if needed > most as f64 => Err(Error::Log {
            log: (*log).into(),
            problem: format!(
                "the rows of all logs need about {:.1} MB of memory, and {:.1} MB are free; this log has {rows:.0} rows of {} columns",
                1e-6 * needed,
                1e-6 * most as f64,
                library.columns().len(),
            ),
            remedy: "lower [signal] rate_hz or cutoff_hz, name fewer [library] families, or give fewer or shorter logs".into(),
        }),
        _ => Ok(()),
    }
}

/// Rows of a log with these stamps, at most.
fn rows(time: &[f64], pipeline: &Pipeline) -> f64 {
    let samples = time.len() as f64;
    match (time.first(), time.last()) {
        (Some(first), Some(last)) if !pipeline.is_off() && (last - first).is_finite() => {
            samples.min((last - first).abs() * pipeline.rate_hz)
        }
        _ => samples,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An hour at 1 kHz keeps 45 000 rows of 12.5 Hz, and all 3.6 million with the filter off; a clock that is none keeps all.
    #[test]
    fn rows_are_those_that_the_filter_keeps() {
        let time: Vec<f64> = (0..3_600_000).map(|i| 0.001 * f64::from(i)).collect();
        let mut pipeline = Pipeline::off(1);
        assert_eq!(rows(&time, &pipeline), 3.6e6);
        (pipeline.cutoff_hz, pipeline.rate_hz) = (5.0, 12.5);
        assert!((rows(&time, &pipeline) - 45_000.0).abs() < 1.0);
        assert_eq!(rows(&[0.0, f64::NAN], &pipeline), 2.0);
        assert_eq!(rows(&[], &pipeline), 0.0);
    }
}
