//! What a calibration returns: plain values that can be printed, compared and written.

use super::status::{Alike, Status, StatusReason};
use crate::calibrate::checks::sweep::SweepPoint;
use crate::calibrate::data::log_summary::LogSummary;
use crate::calibrate::fit::compact::Compact;
use crate::error::Finding;
use crate::lag::Lags;
use crate::likelihood::{JointNoise, NoiseModel, PayloadSize};
use crate::posterior::Problem;
use crate::prior::Inclusion;
use crate::term::{Family, Term};
use crate::twin::Twin;
use crate::validate::{Validation, nan_if_null, nans_if_null};
use serde::{Deserialize, Serialize};

/// One row of `result.json` `terms[]`; numbers are `None` for dropped terms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TermSummary {
    /// Name, family, unit, status.
    pub term: Term,
    /// Posterior inclusion probability.
    pub pip: Option<f64>,
    /// Monte Carlo standard error of `pip` (0 when exact).
    pub pip_mcse: Option<f64>,
    /// E[β | y].
    pub mean: Option<f64>,
    /// sd of β | y.
    pub sd: Option<f64>,
    /// Central 95 % interval of β | y (unconditional).
    pub interval95: Option<[f64; 2]>,
    /// E[β | y, included].
    pub conditional_mean: Option<f64>,
    /// sd of β | y, included.
    pub conditional_sd: Option<f64>,
    /// Median of β | y, included: what words and tables tell.
    #[serde(default)]
    pub conditional_median: Option<f64>,
    /// Central 68.3 % interval of β | y, included; half its width stands behind ± in words and tables.
    #[serde(default)]
    pub conditional_interval68: Option<[f64; 2]>,
    /// False where the data leave the coefficient as wide as the prior (posterior sd > 0.9 prior sd), and for dropped terms.
    pub seen: bool,
    /// rms of the column over all rows (method section 6), N·m per unit of β.
    pub column_rms: Option<f64>,
    /// PIP with the slab variance × 0.1, 1, 10 and expected terms × 0.5, 2 (method section 6).
    pub pip_sensitivity: Vec<f64>,
    /// sd of β by block scores (A⁻¹BA⁻¹ over stretches of time), the second opinion on the likelihood; `None` unless PIP ≥ 0.5.
    #[serde(default)]
    pub sandwich_sd: Option<f64>,
    /// One sentence in physical words, e.g. "viscous friction on elbow: +0.12 ± 0.01 N·m·s/rad".
    pub words: String,
}

/// One physical story: a row of `result.json` `components[]`; numbers are `None` where it has no column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComponentSummary {
    /// Name: `payload`, `<link>.tensor`, `<joint>.spring`, …
    pub name: String,
    /// Family.
    pub family: Family,
    /// What it is, in words: "spring on elbow".
    pub story: String,
    /// Names of its terms, dropped ones included.
    pub columns: Vec<String>,
    /// Probability that it is in.
    pub pip: Option<f64>,
    /// Monte Carlo standard error of `pip` (0 when exact).
    pub pip_mcse: Option<f64>,
    /// What the data say of it.
    pub status: Status,
    /// Why.
    pub reason: StatusReason,
    /// Components that no motion of this robot can tell from it.
    pub alias_of: Vec<String>,
    /// Those of `alias_of` that can have what was found of it: a motor's inertia, which is never negative, is no name for a tensor that
    /// is. `None` for what is not likelier in than not, and in results of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub told_as: Option<Vec<String>>,
    /// True where the inertia that was found of its link is physically inconsistent, whatever else is in: torque is right, the numbers are no mass or inertia.
    #[serde(default)]
    pub no_rigid_body: bool,
    /// Share of the posterior draws in which its link, with all that was found of it, is a rigid body; only where that is less than one half.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rigid_share: Option<f64>,
    /// One sentence: "payload at tool0: +1.20 ± 0.03 kg, centre of mass (0, 2, 61) ± 4 mm".
    pub words: String,
    /// Its parameters given that it is in.
    pub parameters: Vec<ParameterSummary>,
}

/// A physical parameter with its uncertainty, given that its component is in.
///
/// # Example
/// Reports print value ± spread, or both ends of the 95 % interval where ± does not describe the parameter.
/// ```
/// use twincal::prelude::*;
///
/// let mut stiffness = ParameterSummary {
///     name: "stiffness".into(),
///     unit: "N·m/rad".into(),
///     mean: 1.75,
///     sd: 0.25,
///     interval95: [1.25, 2.25],
///     median: 1.75,
///     interval68: [1.5, 2.0],
///     seen: true,
/// };
/// assert_eq!((stiffness.told(), stiffness.ends()), ((1.75, 0.25), None));
/// stiffness.interval95 = [1.25, 4.0]; // a tail on one side
/// assert_eq!(stiffness.ends(), Some([1.25, 4.0]));
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterSummary {
    /// `mass`, `com_x`, `stiffness`, …
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Mean, or median where the parameter is a ratio of coefficients (a centre of mass, a rest angle); NaN here and `null`
    /// in JSON where it does not exist (the centre of no mass) or no joint shows it.
    #[serde(deserialize_with = "nan_if_null")]
    pub mean: f64,
    /// Standard deviation over all models, of a ratio half the width of its central 68.3 % interval. Rare models far off make it several times what
    /// `interval68` says: words and tables print that.
    #[serde(deserialize_with = "nan_if_null")]
    pub sd: f64,
    /// Central 95 % interval.
    #[serde(deserialize_with = "nans_if_null")]
    pub interval95: [f64; 2],
    /// Median: what words and tables tell.
    #[serde(default = "nan", deserialize_with = "nan_if_null")]
    pub median: f64,
    /// Central 68.3 % interval; half its width stands behind ± in words and tables.
    #[serde(default = "nans", deserialize_with = "nans_if_null")]
    pub interval68: [f64; 2],
    /// False if no joint or no motion in these logs shows it: its column was dropped, or the data leave it as wide as the
    /// prior.
    #[serde(default = "yes")]
    pub seen: bool,
}

impl ParameterSummary {
    /// What people are told: the median and half the width of the central 68.3 % interval. A few models far off move
    /// mean and sd, not these; of a normal distribution they are mean and sd. NaN where these logs do not show it, or where
    /// only models too light to be listed hold it: their moments are differences of rounded sums.
    #[must_use]
    pub fn told(&self) -> (f64, f64) {
        let [low, high] = self.interval68;
        if self.median.is_nan() && self.interval95[0].is_finite() {
            return (self.mean, self.sd); // written by a version without quantiles
        }
        (self.median, 0.5 * (high - low))
    }

    /// What is told instead of ±, where that does not describe it: both ends of the 95 % interval.
    #[must_use]
    pub fn ends(&self) -> Option<[f64; 2]> {
        let (value, spread) = self.told();
        ends(value, spread, self.interval68, self.interval95)
    }
}

/// Both ends of the 95 % interval, where ± does not describe a number: the central 68.3 % are lopsided, ± reaches beyond the 95 % interval, or
/// that is far longer on one side, or twice as long as ± says, for models far off.
pub(in crate::calibrate) fn ends(
    value: f64,
    spread: f64,
    interval68: [f64; 2],
    interval95: [f64; 2],
) -> Option<[f64; 2]> {
    let arms = |ends: [f64; 2]| {
        let (low, high) = (value - ends[0], ends[1] - value);
        (low.min(high).max(0.0), low.max(high))
    };
    let (near, far) = arms(interval68);
    let (near95, far95) = arms(interval95);
    let lopsided = far > LOPSIDED * near || far95 > LOPSIDED_95 * near95 || near95 < spread;
    let known = near.is_finite() && far95.is_finite() && spread > 0.0;
    (known && (lopsided || is_split(spread, interval95))).then_some(interval95)
}

fn is_split(spread: f64, [low, high]: [f64; 2]) -> bool {
    high - low > FAR * spread
}

impl Calibration {
    /// Whether these data see a component, or another one that it can be told as.
    #[must_use]
    pub fn sees(&self, component: &ComponentSummary) -> bool {
        let mut groups = self.groups.iter();
        !component.is_unseen() || groups.any(|group| group.members.contains(&component.name))
    }

    /// Components that these data do not see: they may be there, and are not in.
    pub fn unseen(&self) -> impl Iterator<Item = &ComponentSummary> {
        self.components.iter().filter(|own| !self.sees(own))
    }
}

impl ComponentSummary {
    /// True where these data do not see it: it may be there, and is not in.
    #[must_use]
    pub fn is_unseen(&self) -> bool {
        self.status == Status::Unidentifiable && self.reason != StatusReason::NoColumn
    }

    /// What else may be meant by it in every motion: [`told_as`](Self::told_as), or all of [`alias_of`](Self::alias_of) where that is not known.
    #[must_use]
    pub fn names_beside(&self) -> &[String] {
        self.told_as.as_deref().unwrap_or(&self.alias_of)
    }
}

impl ParameterSummary {
    /// True where models far from the others make the 95 % interval twice as long as ± says, or more.
    #[must_use]
    pub fn is_split(&self) -> bool {
        self.seen && is_split(self.told().1, self.interval95)
    }
}

/// Width of a 95 % interval in spreads from which ± does not describe it; 3.92 where it is normal.
const FAR: f64 = 8.0;
/// Ratio of the two sides of a central 68.3 % interval from which ± says too little.
const LOPSIDED: f64 = 2.0;
/// The same of a 95 % interval, whose ends are less sure.
const LOPSIDED_95: f64 = 4.0;

fn nan() -> f64 {
    f64::NAN
}

fn nans() -> [f64; 2] {
    [f64::NAN; 2]
}

fn yes() -> bool {
    true
}

/// Components that these data cannot tell apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// Names of the components, the likeliest first.
    pub members: Vec<String>,
    /// Probability that at least one of them is in.
    pub pip: f64,
    /// Why.
    #[serde(default)]
    pub alike: Alike,
    /// True if it is clear which member is in, by the prior's preference for the simpler story.
    #[serde(default)]
    pub settled: bool,
    /// In a sentence.
    #[serde(default)]
    pub words: String,
}

/// The prior as used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PriorUsed {
    /// v per family, in the order of the library.
    pub scaled_variance: Vec<(Family, f64)>,
    /// True if v was learned.
    pub learned: bool,
    /// How large a payload's slab is beside its prior sd.
    #[serde(default)]
    pub payload: PayloadSize,
    /// Inclusion.
    pub inclusion: Inclusion,
    /// Expected numbers of single families, as given.
    #[serde(default)]
    pub families: Vec<(Family, f64)>,
    /// Components that were forced in.
    #[serde(default)]
    pub forced: Vec<String>,
    /// `(child, parent)` by name: components that are in only where another is.
    #[serde(default)]
    pub heredity: Vec<(String, String)>,
    /// a0.
    pub shape: f64,
    /// b0, (N·m)².
    pub scale: f64,
}

/// The likelihood as used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LikelihoodUsed {
    /// Model.
    pub model: NoiseModel,
    /// Rounds of the plug-in iteration.
    pub rounds: usize,
}

/// Kept coefficients' joint posterior draws, for the pair plot (paper fig. 3).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Draws {
    /// Names of the selected terms: at most 8, those with the largest |median| against half the 95 % interval.
    pub terms: Vec<String>,
    /// `values[term][draw]`.
    pub values: Vec<Vec<f64>>,
}

/// Of which coordinate of a joint a [`Curve`] is a function.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Along {
    /// q, rad or m.
    Position,
    /// q̇, rad/s or m/s.
    Velocity,
}

/// Torque that was found on one joint as a function of its own position or velocity, over the range in the logs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Joint.
    pub joint: String,
    /// Coordinate.
    pub along: Along,
    /// Components that make the curve, with a PIP of 0.1 or more.
    pub components: Vec<String>,
    /// The coordinate, SI.
    pub x: Vec<f64>,
    /// Mean over all models, N·m or N.
    pub mean: Vec<f64>,
    /// Central 95 % interval of the draws from the posterior.
    pub low95: Vec<f64>,
    /// Its upper end.
    pub high95: Vec<f64>,
}

/// The result of a calibration; `twincal-io` writes it as files.
///
/// # Example
/// An arm with 0.6 kg more at its tip than its model says, a hidden torque, and noise of 0.1 N·m.
/// ```
/// # #[path = "../../../examples/two_link.rs"] mod two_link;
/// use twincal::prelude::*;
///
/// # let fit = two_link::study()?;
/// let scores = &fit.validation.filtered; // torque of the held-out log
/// assert!(scores.rmse_nominal > 3.0 && scores.rmse_calibrated < 0.105);
/// let established = fit.effects().filter(|effect| effect.status() == Status::Established);
/// let mut names: Vec<&str> = established.map(|effect| effect.name()).collect();
/// names.sort_unstable();
/// assert_eq!(names, ["payload", "sin(q1 - q2)"]);
/// for finding in &fit.findings {
///     println!("{}", finding.message);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The calibrated twin.
    pub twin: Twin,
    /// One per term of the library, in order.
    pub terms: Vec<TermSummary>,
    /// One per component of the library, in order.
    pub components: Vec<ComponentSummary>,
    /// Noise per joint (also in the twin).
    pub noise: Vec<JointNoise>,
    /// Prior as used.
    pub prior: PriorUsed,
    /// Likelihood as used.
    pub likelihood: LikelihoodUsed,
    /// Terms that these data cannot tell apart.
    pub groups: Vec<Group>,
    /// Estimates at 0.7, 1 and 1.4 times the cut-off; empty with the filter off or weighed rows.
    pub sweep: Vec<SweepPoint>,
    /// The compact twin; `None` in files that are older than it.
    #[serde(default)]
    pub compact: Option<Compact>,
    /// The regression behind the posterior, for the design of a motion that decides what it leaves open; `None` in the twins of a fleet and in
    /// files that are older than it.
    #[serde(default)]
    pub problem: Option<Problem>,
    /// Held-out scores.
    pub validation: Validation,
    /// Normalised residual autocorrelation at lags 0..=20 rows: entries 2j and 2j+1 are joint j before and after calibration.
    pub autocorrelation: Vec<Vec<f64>>,
    /// Draws for figures.
    pub draws: Draws,
    /// Found laws of one coordinate.
    #[serde(default)]
    pub curves: Vec<Curve>,
    /// Logs.
    pub logs: Vec<LogSummary>,
    /// How much later than the motion torque was logged; `None` where the logs do not say it.
    pub lags: Option<Lags>,
    /// Everything that must be said.
    pub findings: Vec<Finding>,
}

impl Calibration {
    /// Rate of the rows that were fitted, Hz; where logs differ, the rate that was asked for.
    #[must_use]
    pub fn kept_rate_hz(&self) -> f64 {
        let fitted = self.logs.iter().filter(|log| log.role == "fit");
        let kept = fitted.map(|log| log.kept_rate_hz);
        self.twin
            .pipeline
            .common_rate(kept.filter(|rate| *rate > 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::ParameterSummary;

    #[test]
    fn plus_minus_is_not_told_of_what_is_lopsided() {
        let of = |median: f64, interval68: [f64; 2], interval95: [f64; 2]| {
            let parameter = ParameterSummary {
                name: "value".into(),
                unit: "N·m".into(),
                mean: median,
                sd: 1.0,
                interval95,
                median,
                interval68,
                seen: true,
            };
            parameter.ends()
        };
        assert_eq!(of(5.0, [4.0, 6.0], [3.0, 7.0]), None);
        // UR10, viscous friction of the lift: ± 11 would say 26 to 48.
        let ends = [14.0, 48.0];
        assert_eq!(of(36.5, [20.05, 42.63], ends), Some(ends));
        assert_eq!(of(36.5, [24.5, 42.63], [14.0, 48.0]), None);
        // ± 47 would reach below the 95 % interval.
        let skewed = [276.0, 424.0];
        assert_eq!(of(294.0, [284.0, 378.0], skewed), Some(skewed));
        // A few models far off on one side, and on both: UR10, preload of a spring beside an offset.
        let far = [-0.98, -0.44];
        assert_eq!(of(-0.75, far, [-1.3, 2.0]), Some([-1.3, 2.0]));
        assert_eq!(of(-0.75, far, [-1.3, 0.8]), None);
        assert_eq!(of(0.762, [0.723, 0.801], [-2.5, 3.7]), Some([-2.5, 3.7]));
        assert_eq!(of(f64::NAN, [f64::NAN; 2], [f64::NAN; 2]), None);
        assert_eq!(of(0.0, [0.0; 2], [0.0; 2]), None);
    }
}
