//! A lower band where a coarse encoder leaves too few rows in the automatic one, unless somebody chose the band.
//!
//! The automatic cut-off f_c follows the motion's spectrum. With an encoder of step s velocities below 16 f_c s cannot be told from standstill,
//! which hides the rows of slow motion and leaves stretches in which it is fast, too short to say anything. That threshold falls with the cut-off: so
//! where a fit is refused for want of rows, it is tried at half the cut-off and so on, not below [`LEAST`], and done where the rows of a joint
//! count as most independent ones. Where they are too few everywhere the first refusal stands.
//!
//! A log of some seconds has few rows as well, and more of them in a wider band. They say no more of what the robot does elsewhere: of six seconds of
//! a UR10 that were fitted in twice the band, 95 % intervals held none to all of the next seconds' torque. Such a log is refused.

use super::CalibrationSettings;
use crate::error::{Error, Finding, Severity};
use crate::signal::Auto;

/// No band of a coarse encoder ends below, Hz: friction that reverses would blur.
const LEAST: f64 = 2.0;

/// A fit that ended early, and what another band may do for it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TooFew {
    /// Why it ended.
    pub(super) error: Error,
    /// Its cut-off, Hz; 0 where no other band helps.
    pub(super) cutoff_hz: f64,
}

impl From<Error> for TooFew {
    /// What has nothing to do with the band.
    fn from(error: Error) -> Self {
        Self {
            error,
            cutoff_hz: 0.0,
        }
    }
}

/// Cut-offs that are open to a fit by `settings` that ended with `few` and `findings`, Hz.
pub(super) fn lower(
    few: &TooFew,
    findings: &[Finding],
    settings: &CalibrationSettings,
) -> Vec<f64> {
    let signal = &settings.signal;
    let chosen = signal.cutoff_hz != Auto::Auto || signal.rate_hz != Auto::Auto;
    let coarse = findings.iter().any(|f| f.code == "quantised_encoder");
    match coarse && !chosen {
        true => halves(few.cutoff_hz),
        false => Vec::new(),
    }
}

/// What is said of a fit at `cutoff_hz` after one that ended with `few`.
pub(super) fn lowered(few: &TooFew, cutoff_hz: f64) -> Finding {
    let problem = match &few.error {
        Error::Refused { problem, .. } => problem.clone(),
        error => error.to_string(),
    };
    let message = format!(
        "nothing can be concluded at the automatic cut-off of {} Hz ({problem}): fitted at {cutoff_hz} Hz, where the coarse encoder hides \
         less of the motion; [signal] cutoff_hz states another one",
        few.cutoff_hz
    );
    Finding::new(Severity::Warning, "lower_band", "", message, 0)
}

/// Half, a quarter and so on of a cut-off in two digits, not below [`LEAST`].
fn halves(cutoff_hz: f64) -> Vec<f64> {
    let halves = std::iter::successors(Some(0.5 * cutoff_hz), |hz| Some(0.5 * hz));
    let high = halves.take_while(|hz| *hz >= LEAST && hz.is_finite());
    high.map(|hz| (10.0 * hz).round() / 10.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::SignalSettings;

    fn refused() -> TooFew {
        TooFew {
            error: Error::Refused {
                problem: "5 rows".into(),
                remedy: String::new(),
            },
            cutoff_hz: 33.0,
        }
    }

    fn coarse() -> [Finding; 1] {
        let code = "quantised_encoder";
        let message = String::new();
        [Finding::new(Severity::Warning, code, "j", message, 0)]
    }

    #[test]
    fn a_coarse_encoder_goes_down_by_halves() {
        let settings = CalibrationSettings::default();
        let open = lower(&refused(), &coarse(), &settings);
        assert_eq!(open, [16.5, 8.3, 4.1, 2.1]);
        assert!(lower(&refused(), &[], &settings).is_empty());
        let message = lowered(&refused(), 8.3).message;
        let told = "cut-off of 33 Hz (5 rows): fitted at 8.3 Hz, where the coarse encoder";
        assert!(message.contains(told), "{message}");
    }

    #[test]
    fn what_somebody_chose_and_what_has_nothing_to_do_with_bands_stays() {
        let usual = CalibrationSettings::default();
        let stated = |cutoff_hz, rate_hz| CalibrationSettings {
            signal: SignalSettings {
                cutoff_hz,
                rate_hz,
                ..usual.signal.clone()
            },
            ..usual.clone()
        };
        for settings in [
            stated(Auto::Value(33.0), Auto::Auto),
            stated(Auto::Auto, Auto::Value(82.5)),
        ] {
            assert!(lower(&refused(), &coarse(), &settings).is_empty());
        }
        let other = TooFew::from(refused().error);
        assert!(lower(&other, &coarse(), &usual).is_empty());
    }
}
