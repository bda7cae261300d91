//! A lower band where a coarse encoder leaves too few rows in the automatic one, unless somebody chose the band.
//!
//! The automatic cut-off f_c follows the motion's spectrum. With an encoder of step s velocities below 16 f_c s cannot be told from standstill,
//! which hides the rows of slow motion and leaves stretches in which it is fast, too short to say anything. That threshold falls with the cut-off: so
//! where a fit is refused for want of rows, it is tried at half the cut-off and so on, not below [`LEAST`], and done where the rows of a joint
//! count as most independent ones. Where they are too few everywhere the first refusal stands.
//!
//! So it is where the fit would begin, but accelerations mask the model: its torque differs from the measured one by more than twice that, on every
//! joint that moves. Vibration of an encoder's step or two counts as motion, and what rounding adds to its acceleration grows as f_c^2.5, while
//! what a model lacks is of a size in every band. The fit is done in the highest of the lower bands in which the model's torque is about as little off
//! as in any; if it is as far off in all of them the usual one stands (units or signs may be wrong, which a fit tells).
//!
//! A log of some seconds has few rows as well, and more of them in a wider band. They say no more of what the robot does elsewhere: of six seconds of
//! a UR10 that were fitted in twice the band, 95 % intervals held none to all of the next seconds' torque. Such a log is refused.

use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Code, Error, Finding, Severity};
use crate::robot::Robot;
use crate::signal::Auto;
use crate::words::significant;

/// No band of a coarse encoder ends below, Hz: friction that reverses would blur.
const LEAST: f64 = 2.0;
/// How far the nominal torque may be from the measured one, in rms of that, before a lower band is tried.
const MASKED: f64 = 2.0;
/// A band is as good as the best where the nominal torque is no further off than this times: a fifth of its square may be rounding.
const AS_GOOD: f64 = 1.1;

/// A fit that ended early, and what another band may do for it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::calibrate) struct TooFew {
    /// Why it ended.
    pub(in crate::calibrate) error: Error,
    /// Its cut-off, Hz; 0 where no other band helps.
    pub(in crate::calibrate) cutoff_hz: f64,
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

/// A lower band that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::calibrate) struct Band {
    /// Its cut-off, Hz.
    pub(in crate::calibrate) cutoff_hz: f64,
    /// Independent rows of the joint that has most.
    pub(in crate::calibrate) rows: f64,
    /// How far the nominal torque is from the measured one, in rms of that.
    pub(in crate::calibrate) misfit: f64,
}

impl Band {
    /// With [`crate::calibrate::data::all_logs::Data::nominal_misfit`].
    pub(in crate::calibrate) fn new(
        cutoff_hz: f64,
        rows: f64,
        misfit: Option<(usize, [f64; 2])>,
    ) -> Self {
        Self {
            cutoff_hz,
            rows,
            misfit: misfit.map_or(0.0, |(_, [difference, torque])| difference / torque),
        }
    }
}

/// The band with most independent rows, the higher one where they are as many.
pub(in crate::calibrate) fn most_rows(bands: &[Band]) -> Option<f64> {
    let more = |best: &Band, band: &Band| band.rows > best.rows;
    best(bands, more)
}

/// The highest band in which the model is as little masked as in others.
pub(in crate::calibrate) fn clear(bands: &[Band]) -> Option<f64> {
    let least = bands.iter().map(|band| band.misfit).fold(MASKED, f64::min);
    let as_good = |band: &&Band| band.misfit <= AS_GOOD * least;
    let good: Vec<Band> = bands.iter().filter(as_good).copied().collect();
    best(&good, |best, band| band.cutoff_hz > best.cutoff_hz)
}

fn best(bands: &[Band], better: fn(&Band, &Band) -> bool) -> Option<f64> {
    let mut bands = bands.iter();
    let first = bands.next()?;
    let best = bands.fold(first, |best, band| match better(best, band) {
        true => band,
        false => best,
    });
    Some(best.cutoff_hz)
}

/// What is said of a band in which an encoder is coarse and the nominal torque differs from the measured one by far more than that on every joint
/// that moves.
pub(in crate::calibrate) fn masked(
    robot: &Robot,
    findings: &[Finding],
    misfit: Option<(usize, [f64; 2])>,
    cutoff_hz: f64,
) -> Option<TooFew> {
    let (joint, [difference, torque]) = misfit.filter(|_| is_coarse(findings))?;
    if difference <= MASKED * torque {
        return None;
    }
    let names = robot.joint_names();
    let [difference, torque] = [difference, torque].map(|rms| significant(rms, 2));
    let problem = format!(
        "joint `{}`: accelerations of a coarse encoder make the model's torque wrong by {difference} (rms), {torque} was measured",
        names[joint]
    );
    let remedy = "log the encoder's full resolution".into();
    Some(TooFew {
        error: Error::Refused { problem, remedy },
        cutoff_hz,
    })
}

/// Whether an encoder is so coarse that it was told.
fn is_coarse(findings: &[Finding]) -> bool {
    findings.iter().any(|f| f.code == Code::QuantisedEncoder)
}

/// Cut-offs that are open to a fit by `settings` that ended with `few` and `findings`, Hz.
pub(in crate::calibrate) fn lower(
    few: &TooFew,
    findings: &[Finding],
    settings: &CalibrationSettings,
) -> Vec<f64> {
    let signal = &settings.signal;
    let chosen = signal.cutoff_hz != Auto::Auto || signal.rate_hz != Auto::Auto;
    match is_coarse(findings) && !chosen {
        true => halves(few.cutoff_hz),
        false => Vec::new(),
    }
}

/// What is said of a fit at `cutoff_hz` after one that ended with `few`.
pub(in crate::calibrate) fn lowered(few: &TooFew, cutoff_hz: f64) -> Finding {
    let problem = match &few.error {
        Error::Refused { problem, .. } => problem.clone(),
        error => error.to_string(),
    };
    let message = format!(
        "nothing can be concluded at the automatic cut-off of {} Hz ({problem}): fitted at {cutoff_hz} Hz, where the coarse encoder spoils \
         less of the motion; [signal] cutoff_hz states another one",
        few.cutoff_hz
    );
    Finding::new(Severity::Warning, Code::LowerBand, "", message, 0)
        .with([("cutoff", cutoff_hz), ("cutoff_tried", few.cutoff_hz)])
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
        let code = Code::QuantisedEncoder;
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
    fn the_highest_band_that_is_not_masked_is_the_one() {
        let band = |cutoff_hz, rows, misfit| Band {
            cutoff_hz,
            rows,
            misfit,
        };
        let bands = [
            band(16.5, 30.0, 1.4),
            band(8.3, 40.0, 0.32),
            band(4.1, 12.0, 0.3),
        ];
        assert_eq!(clear(&bands), Some(8.3));
        assert_eq!(most_rows(&bands), Some(8.3));
        assert_eq!(clear(&bands[..1]), Some(16.5));
        // As far off in every band: that is no encoder's.
        assert_eq!(clear(&[band(16.5, 30.0, 9.0), band(8.3, 30.0, 8.9)]), None);
        assert_eq!((clear(&[]), most_rows(&[])), (None, None));
        assert_eq!(most_rows(&[bands[2], bands[0]]), Some(16.5));
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
