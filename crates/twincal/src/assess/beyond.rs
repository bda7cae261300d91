//! Rows on which the training data say less than on others, by cause: motion that training did not have, or torque that it leaves open.

use super::claim::{Claim, Subject};
use super::intervals::too_narrow;
use super::scores::memory;
use crate::calibrate::Calibration;
use crate::error::Code;
use crate::validate::{JointScore, Split, Validation};

/// Share of a joint's rows from which the error there is told.
const MANY: f64 = 0.1;
/// Ratio of errors there and elsewhere from which they are told.
const FURTHER_OFF: f64 = 1.25;
/// Share of the rows beyond that are new motion, from which that is the cause.
const MOSTLY: f64 = 0.5;

/// Why [`Validation::beyond`] has a joint's rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cause {
    /// Its position, velocity or acceleration leaves the training range.
    NewMotion,
    /// What is not known of its torque is more than the noise.
    OpenTorque,
}

impl Cause {
    /// Of rows beyond, of which so many are new motion. That is only where whole logs were held out: of other splits the range is that of all logs.
    fn of(split: &Split, new_motion: u64, rows: u64) -> Self {
        match *split == Split::HeldoutLogs && new_motion as f64 > MOSTLY * rows as f64 {
            true => Self::NewMotion,
            false => Self::OpenTorque,
        }
    }
}

/// A joint's moving rows within and beyond.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beyond<'a> {
    /// Scores of the rows that training speaks of.
    pub within: &'a JointScore,
    /// Scores of the others.
    pub beyond: &'a JointScore,
    /// Why there are others.
    pub cause: Cause,
    /// 95 % intervals are too narrow there, and less so elsewhere, by more than two standard errors of as many independent rows.
    pub narrow: bool,
    /// The error is larger there, on many of the joint's rows.
    pub further_off: bool,
}

impl<'a> Beyond<'a> {
    fn of(
        calibration: &Calibration,
        (within, beyond): (&'a JointScore, &'a JointScore),
        new_motion: u64,
    ) -> Self {
        let all = within.rows + beyond.rows;
        let share = beyond.rows as f64 / all as f64;
        let narrow = too_narrow(beyond, memory(&calibration.noise, &beyond.joint));
        Self {
            within,
            beyond,
            cause: Cause::of(&calibration.validation.split, new_motion, beyond.rows),
            narrow: narrow && (within.rows == 0 || within.coverage95 > beyond.coverage95),
            further_off: within.rows > 0
                && share >= MANY
                && beyond.rmse_calibrated > FURTHER_OFF * within.rmse_calibrated,
        }
    }

    /// Rows beyond and all rows.
    fn rows(&self) -> [u64; 2] {
        [self.beyond.rows, self.within.rows + self.beyond.rows]
    }

    /// Whether the joint was mostly tested there. Of torque that training leaves open that is said only where it is predicted better elsewhere:
    /// otherwise that is no excuse.
    fn is_most(&self) -> bool {
        let (within, beyond) = (self.within, self.beyond);
        let better = within.rows == 0 || within.coverage95 > beyond.coverage95;
        beyond.rows > within.rows && (self.cause == Cause::NewMotion || better)
    }
}

/// Joints that have held-out rows there.
pub(super) fn beyond(calibration: &Calibration) -> impl Iterator<Item = Beyond<'_>> {
    let Validation {
        within,
        beyond,
        new_motion,
        ..
    } = &calibration.validation;
    let pairs = within.joints.iter().zip(&beyond.joints);
    // Validations without rows have no counts.
    let new_motion = new_motion.iter().copied().chain(std::iter::repeat(0));
    pairs
        .zip(new_motion)
        .filter(|((_, beyond), _)| beyond.rows > 0)
        .map(|(pair, new_motion)| Beyond::of(calibration, pair, new_motion))
}

/// Joints of which training says less on a tenth of the held-out moving rows or more, mostly because their motion is new.
pub(super) fn new_motion(calibration: &Calibration) -> impl Iterator<Item = &str> {
    beyond(calibration)
        .filter(|own| {
            let [rows, all] = own.rows();
            own.cause == Cause::NewMotion && rows as f64 >= MANY * all as f64
        })
        .map(|own| own.beyond.joint.as_str())
}

/// Joints that are predicted worse there, or were mostly tested there.
pub(super) fn claims(calibration: &Calibration) -> Vec<Claim> {
    let told = beyond(calibration).flat_map(|own| {
        let subject = || Subject::Joint(own.beyond.joint.clone());
        let [rows, all] = own.rows();
        let rows = [("rows_beyond", rows as f64), ("rows", all as f64)];
        let coverage = [
            ("coverage95_beyond", own.beyond.coverage95),
            ("coverage95_within", own.within.coverage95),
        ];
        let errors = [
            ("rms_beyond", own.beyond.rmse_calibrated),
            ("rms_within", own.within.rmse_calibrated),
        ];
        let narrow = own.narrow.then_some(coverage).into_iter().flatten();
        let further_off = own.further_off.then_some(errors).into_iter().flatten();
        let predicted: Vec<_> = narrow.chain(further_off).collect();
        let (worse, tested) = match own.cause {
            Cause::NewMotion => (Code::WorseOnNewMotion, Code::TestedOnNewMotion),
            Cause::OpenTorque => (Code::WorseOnOpenTorque, Code::TestedOnOpenTorque),
        };
        let codes = [
            (!predicted.is_empty(), worse, predicted),
            (own.is_most(), tested, Vec::new()),
        ];
        let claimed = codes.into_iter().filter(|(holds, ..)| *holds);
        claimed
            .map(|(_, code, more)| Claim::limit(code, subject(), rows).with(more))
            .collect::<Vec<_>>()
    });
    told.collect()
}
