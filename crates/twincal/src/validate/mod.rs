//! Held-out scores: how good the twin's torque is on data it has not seen (method section 8).

mod changed_payload;
mod changes;
mod conformal;
mod heldout;
mod memory;
mod misread;
mod moments;
mod pit;
mod rivals;
mod scores;
mod trace;
mod trend;

pub use changes::{Change, ChangeKind, ChangeNumber, Changes, FALSE_ALARM, least_share};
pub use conformal::{Conformal, ConformalKeeper, JointFactor};
pub use heldout::{HeldOut, Predictors};
pub use moments::Moments;
pub use pit::{Pit, PitKeeper, Reliability};
pub use rivals::{Loss, RivalKeeper};
pub use scores::{CoverageKeeper, ScoreKeeper};
pub use trace::{MAX_POINTS, TraceRows};
pub use trend::{TREND_ALARM, TREND_FEWEST, Trend};

use serde::{Deserialize, Deserializer, Serialize};

/// Ratio of the calibrated to the nominal RMSE from which calibration counts as harm.
pub const WORSE: f64 = 1.02;

/// Scores of one joint. Without rows the numbers are NaN here and `null` in JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointScore {
    /// Joint name.
    pub joint: String,
    /// Rows.
    pub rows: u64,
    /// RMSE of the nominal torque, N·m.
    #[serde(deserialize_with = "nan_if_null")]
    pub rmse_nominal: f64,
    /// RMSE of the calibrated torque (model average), N·m.
    #[serde(deserialize_with = "nan_if_null")]
    pub rmse_calibrated: f64,
    /// Mean of measured less calibrated torque, N·m: beside the RMSE it says how much of the error is bias.
    #[serde(default = "nan", deserialize_with = "nan_if_null")]
    pub bias: f64,
    /// Share of rows inside the 95 % interval.
    #[serde(deserialize_with = "nan_if_null")]
    pub coverage95: f64,
    /// Mean width of that interval, N·m.
    #[serde(deserialize_with = "nan_if_null")]
    pub mean_width95: f64,
    /// Standard deviation of the measured torque over these rows, N·m: what an RMSE is to be compared with.
    #[serde(deserialize_with = "nan_if_null")]
    pub torque_sd: f64,
    /// Mean interval score of that interval, N·m: width plus 40 times the distance of what lies outside (Gneiting &
    /// Raftery 2007, eq. 43, α = 0.05). Smaller is better.
    #[serde(default = "nan", deserialize_with = "nan_if_null")]
    pub interval_score95: f64,
    /// Root mean square over the rows of the epistemic sd (from coefficients and structure), N·m.
    #[serde(default = "nan", deserialize_with = "nan_if_null")]
    pub epistemic_sd: f64,
    /// Root mean square over the rows of the sd of the noise part, N·m.
    #[serde(default = "nan", deserialize_with = "nan_if_null")]
    pub noise_sd: f64,
    /// Share of the epistemic part in the predictive variance, 0 … 1.
    #[serde(default = "nan", deserialize_with = "nan_if_null")]
    pub epistemic_share: f64,
    /// RMSE of the nominal torque with viscous and Coulomb friction and an offset alone, fitted to the same training rows, N·m; `None` where it was not
    /// asked for, or none of these is a candidate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rmse_friction: Option<f64>,
}

/// Scores over a set of rows: pooled over all rows of all joints, and per joint. Without rows the numbers are NaN here and
/// `null` in JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// RMSE of the nominal torque over all rows of all joints.
    #[serde(deserialize_with = "nan_if_null")]
    pub rmse_nominal: f64,
    /// RMSE of the calibrated torque.
    #[serde(deserialize_with = "nan_if_null")]
    pub rmse_calibrated: f64,
    /// Share of rows inside the 95 % interval.
    #[serde(deserialize_with = "nan_if_null")]
    pub coverage95: f64,
    /// Mean interval score of the 95 % interval over all rows of all joints.
    #[serde(default = "nan", deserialize_with = "nan_if_null")]
    pub interval_score95: f64,
    /// Share of the epistemic part in the predictive variance.
    #[serde(default = "nan", deserialize_with = "nan_if_null")]
    pub epistemic_share: f64,
    /// Per joint.
    pub joints: Vec<JointScore>,
}

impl Default for Scores {
    /// No rows of no joint.
    fn default() -> Self {
        ScoreKeeper::new([""; 0]).scores()
    }
}

/// Groups that many logs are left out in.
pub const LOG_GROUPS: usize = 5;

/// How training and held-out data were separated.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    /// Logs given with `--heldout`.
    HeldoutLogs,
    /// Each log predicted from the others.
    LeaveOneLogOut,
    /// Many logs: [`LOG_GROUPS`] groups of logs that follow each other, each group predicted from the others.
    LeaveLogGroupsOut,
    /// The last 30 % of each log after a gap.
    LastThirty,
    /// Nothing was held out: the fit took statistics of logs, and no log beside them.
    NotTested,
}

/// One held-out stretch for figures: rows of one joint in one trajectory, at most [`MAX_POINTS`] of them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Trace {
    /// Log name.
    pub log: String,
    /// Joint name.
    pub joint: String,
    /// Every `step`-th row is kept; 1: all of them.
    pub step: usize,
    /// Row times, s.
    pub time: Vec<f64>,
    /// Position, velocity at the rows.
    pub q: Vec<f64>,
    /// Velocity.
    pub qd: Vec<f64>,
    /// Measured torque, filtered like the rows.
    pub measured: Vec<f64>,
    /// Torque as it was logged, of the sample nearest to each row, N·m or N; `None` of a row between kept parts of a long log. Empty where nothing
    /// is filtered.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub logged: Vec<Option<f64>>,
    /// Nominal torque.
    pub nominal: Vec<f64>,
    /// Calibrated torque.
    pub calibrated: Vec<f64>,
    /// Lower end of the 95 % interval.
    pub low: Vec<f64>,
    /// Upper end.
    pub high: Vec<f64>,
    /// Standstill rows.
    pub standstill: Vec<bool>,
    /// Measured value's probability under the predictive distribution (PIT), for calibration plots.
    pub pit: Vec<f64>,
}

/// Everything held-out.
///
/// # Example
/// Held-out torque of an arm with noise of 0.1 N·m: the error is the noise, and 95 % intervals hold 95 % of 2000 rows.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::validate::Split;
///
/// # let fit = two_link::study()?;
/// assert_eq!(fit.validation.split, Split::HeldoutLogs);
/// for joint in &fit.validation.filtered.joints {
///     assert!((joint.rmse_calibrated - 0.1).abs() < 0.01 && joint.rmse_nominal > 1.0);
///     assert!((joint.coverage95 - 0.95).abs() < 0.025);
/// }
/// # Ok::<(), twincal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Validation {
    /// How the data were split.
    pub split: Split,
    /// All rows.
    pub filtered: Scores,
    /// Rows of moving joints only.
    pub moving: Scores,
    /// Of these, rows that the training data speak of.
    #[serde(default)]
    pub within: Scores,
    /// Rows beyond them: the joint's own position, velocity or acceleration leaves its training range by more than 5 % of it, or what is not known of the torque is
    /// more than its noise ([`JointTorque::extrapolating`](crate::twin::JointTorque::extrapolating)). Intervals know what the candidates
    /// could be there, not what no candidate describes.
    #[serde(default)]
    pub beyond: Scores,
    /// Of these, rows whose motion leaves its training range, joint by joint.
    #[serde(default)]
    pub new_motion: Vec<u64>,
    /// Unfiltered torque.
    pub raw: Scores,
    /// Of this, rows of moving joints only.
    #[serde(default)]
    pub raw_moving: Scores,
    /// Coverage at 50, 80, 90 and 95 % of the filtered rows of moving joints, pooled.
    pub coverage_levels: Vec<(f64, f64)>,
    /// PIT of the filtered rows of all joints that move.
    #[serde(default)]
    pub pit: Pit,
    /// Coverage at the same levels and PIT, joint by joint.
    #[serde(default)]
    pub reliability: Vec<Reliability>,
    /// How much wider intervals must be for a guarantee; `None` without a held-out trajectory.
    #[serde(default)]
    pub conformal: Option<Conformal>,
    /// The model average against the compact twin on moving filtered rows; `None` if it was not asked for.
    #[serde(default)]
    pub compact: Option<[Loss; 2]>,
    /// Second moments of the moving held-out rows, joint by joint; empty where rows were not kept.
    #[serde(default)]
    pub moments: Vec<Moments>,
    /// For figures.
    pub traces: Vec<Trace>,
}

/// JSON has no NaN: a score without rows is written as `null` and read back as NaN.
pub(crate) fn nan_if_null<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// What a number is in a file that was written before it existed.
pub(crate) fn nan() -> f64 {
    f64::NAN
}

/// [`nan_if_null`] for the two ends of an interval.
pub(crate) fn nans_if_null<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<[f64; 2], D::Error> {
    let ends = <[Option<f64>; 2]>::deserialize(deserializer)?;
    Ok(ends.map(|end| end.unwrap_or(f64::NAN)))
}
