//! Joints that stand still: there friction is whatever it takes, so that errors are another matter than in motion.

use super::claim::{Claim, Subject};
use super::scores::{decisive, rows_of};
use crate::calibrate::Calibration;
use crate::error::Code;
use crate::validate::{JointScore, Scores, Validation};

/// Held-out rows at standstill below which that is not tested.
const FEW_AT_REST: u64 = 20;
/// Pauses in held-out data from which they say something of others.
const FEW_PAUSES: usize = 3;
/// Share of a joint's rows at standstill from which that is a part of what the robot does.
const STANDS_STILL: f64 = 0.05;
/// Change of an error from which it is told.
const WORTH_TELLING: f64 = 0.05;

/// Scores of the held-out rows in which a joint stands still, or all joints together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtRest<'a> {
    /// Joint; empty for all together.
    pub joint: &'a str,
    /// Held-out rows at rest.
    pub rows: u64,
    /// RMSE there by the model alone and by the twin, N·m.
    pub rmse: [f64; 2],
    /// Share of these rows that 95 % intervals hold.
    pub coverage95: f64,
    /// Mean width of these intervals, N·m.
    pub mean_width95: f64,
}

type Pair<'a> = (&'a JointScore, &'a JointScore);

impl<'a> AtRest<'a> {
    /// All rows beside the moving ones: what the former have more. `None` where that is nothing.
    fn of(joint: &'a str, pairs: &[Pair<'_>]) -> Option<Self> {
        let rows: u64 = (pairs.iter())
            .map(|(all, moving)| all.rows - moving.rows.min(all.rows))
            .sum();
        let mean = |of: &dyn Fn(&JointScore) -> f64| {
            let sum = |score: &JointScore| match score.rows {
                0 => 0.0,
                rows => rows as f64 * of(score),
            };
            let left = pairs.iter().map(|(all, moving)| sum(all) - sum(moving));
            left.sum::<f64>() / rows as f64
        };
        let root = |of: fn(&JointScore) -> f64| mean(&|score| of(score).powi(2)).max(0.0).sqrt();
        (rows > 0).then(|| Self {
            joint,
            rows,
            rmse: [
                root(|score| score.rmse_nominal),
                root(|score| score.rmse_calibrated),
            ],
            coverage95: mean(&|score| score.coverage95),
            mean_width95: mean(&|score| score.mean_width95),
        })
    }

    /// Whether the twin is worse there than the model, by more than is worth a word.
    #[must_use]
    pub fn got_worse(&self) -> bool {
        let [before, after] = self.rmse;
        after / before - 1.0 > WORTH_TELLING
    }
}

/// All rows of each joint beside its moving ones.
fn pairs(validation: &Validation) -> Vec<Pair<'_>> {
    let moving = &decisive(validation).joints;
    validation.filtered.joints.iter().zip(moving).collect()
}

/// Joints that stand still in held-out rows.
#[must_use]
pub fn at_rest(validation: &Validation) -> Vec<AtRest<'_>> {
    let pairs = pairs(validation);
    let own = pairs.iter();
    own.filter_map(|pair| AtRest::of(&pair.0.joint, &[*pair]))
        .collect()
}

/// All joints at rest together.
#[must_use]
pub fn all_at_rest(validation: &Validation) -> Option<AtRest<'_>> {
    AtRest::of("", &pairs(validation))
}

/// All joints at rest together, where these rows are enough to say something.
pub(super) fn tested_at_rest(validation: &Validation) -> Option<AtRest<'_>> {
    all_at_rest(validation).filter(|own| own.rows >= FEW_AT_REST)
}

/// Whether torque at standstill, of all joints together, got worse.
pub(super) fn rest_got_worse(calibration: &Calibration) -> bool {
    tested_at_rest(&calibration.validation).is_some_and(|own| own.got_worse())
}

/// Pauses in held-out rows: the most of a joint, and the longest time of one, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pauses {
    /// Pauses of the joint that has most.
    pub most: usize,
    /// Longest time at rest of a joint, s.
    pub seconds: f64,
}

/// The pauses in held-out rows, where they are so few that they say little of others.
#[must_use]
pub fn few_pauses(calibration: &Calibration) -> Option<Pauses> {
    let (mut most, mut longest) = (0, 0.0f64);
    for joint in &calibration.validation.filtered.joints {
        let traces = calibration.validation.traces.iter();
        let (mut pauses, mut seconds) = (0, 0.0);
        for trace in traces.filter(|trace| trace.joint == joint.joint) {
            let rows = trace.standstill.iter().zip(&trace.time);
            let mut began = None;
            for (still, &time) in rows {
                match (still, began) {
                    (true, None) => (pauses, began) = (pauses + 1, Some(time)),
                    (true, Some(_)) => {}
                    (false, Some(start)) => (seconds, began) = (seconds + time - start, None),
                    (false, None) => {}
                }
            }
            if let (Some(start), Some(end)) = (began, trace.time.last()) {
                seconds += end - start;
            }
        }
        most = most.max(pauses);
        longest = longest.max(seconds);
    }
    (1..FEW_PAUSES).contains(&most).then_some(Pauses {
        most,
        seconds: longest,
    })
}

/// Share of the fitted rows of joint `j` at standstill; NaN without rows.
#[must_use]
pub fn standstill(calibration: &Calibration, j: usize) -> f64 {
    let fitted = || calibration.logs.iter().filter(|log| log.role == "fit");
    let moved: u64 = fitted()
        .map(|log| log.rows.get(j).copied().unwrap_or(0))
        .sum();
    let stood: u64 = fitted()
        .map(|log| log.standstill.get(j).copied().unwrap_or(0))
        .sum();
    stood as f64 / (moved + stood) as f64
}

/// The joint that stands still most in the logs, its share, and the held-out rows at rest, where these are too few to test it.
pub(super) fn hardly_at_rest(calibration: &Calibration) -> Option<(&str, f64, u64)> {
    let validation = &calibration.validation;
    let moving = rows_of(&validation.moving);
    let at_rest = rows_of(&validation.filtered).saturating_sub(moving);
    let names = calibration.noise.iter().enumerate();
    let shares = names.map(|(j, noise)| (noise.joint.as_str(), standstill(calibration, j)));
    let most = shares.filter(|(_, share)| *share >= STANDS_STILL);
    let (joint, share) = most.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (moving > 0 && at_rest < FEW_AT_REST).then_some((joint, share, at_rest))
}

/// Torque at rest that got worse, of all joints together and of single ones, and rest that is not tested.
pub(super) fn claims(calibration: &Calibration) -> Vec<Claim> {
    let mut out = Vec::new();
    let validation = &calibration.validation;
    if let Some(together) = tested_at_rest(validation) {
        out.extend(tested(calibration, &together));
    }
    out.extend(hardly_at_rest(calibration).map(|(joint, share, rows)| {
        let subject = Subject::Joint(joint.to_owned());
        let numbers = [("share_at_rest", share), ("rows_at_rest", rows as f64)];
        let all = all_at_rest(validation).filter(|_| rows > 0);
        let error = all.into_iter().flat_map(|own| rms(own.rmse));
        Claim::limit(Code::RestNotTested, subject, numbers).with(error)
    }));
    out
}

fn rms([before, after]: [f64; 2]) -> [(&'static str, f64); 2] {
    [("rms_nominal", before), ("rms_calibrated", after)]
}

/// The error of joints at rest, of one of several that rest or of all together, where it got worse or is another than that of moving joints; and
/// the joints on which it got worse, most first.
fn tested(calibration: &Calibration, together: &AtRest<'_>) -> Vec<Claim> {
    let validation = &calibration.validation;
    let rest = at_rest(validation);
    let mut worse: Vec<&AtRest<'_>> = rest.iter().filter(|own| own.got_worse()).collect();
    let gain = |own: &AtRest<'_>| own.rmse[1] - own.rmse[0];
    worse.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    let after = |scores: &Scores| scores.rmse_calibrated;
    let differ = after(&validation.filtered) / after(decisive(validation)) - 1.0;
    let differs = differ.abs() > WORTH_TELLING;
    let numbers = rms(together.rmse);
    let pauses = few_pauses(calibration);
    let subject = match &rest[..] {
        [only] if calibration.noise.len() > 1 => Subject::Joint(only.joint.to_owned()),
        _ => Subject::Run,
    };
    let claim = match (together.got_worse(), pauses) {
        (true, Some(_)) => Claim::limit(Code::WorseInFewPauses, subject, numbers),
        (true, None) => Claim::new(Code::WorseAtRest, subject, numbers),
        (false, _) => Claim::new(Code::TorqueErrorAtRest, subject, numbers),
    };
    let few = pauses.into_iter();
    let few = few.flat_map(|own| {
        [
            ("pauses", own.most as f64),
            ("seconds_at_rest", own.seconds),
        ]
    });
    let mut out = Vec::new();
    if !worse.is_empty() || differs {
        out.push(claim.with(few));
    }
    out.extend(worse.into_iter().map(|own| {
        let subject = Subject::Joint(own.joint.to_owned());
        Claim::limit(Code::JointWorseAtRest, subject, rms(own.rmse))
    }));
    out
}
