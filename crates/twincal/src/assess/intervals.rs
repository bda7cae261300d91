//! Do 95 % intervals hold what they promise, joint by joint and together.

use super::claim::{Claim, Subject};
use super::rest;
use super::scores::{decisive, memory, rows_of};
use crate::calibrate::Calibration;
use crate::error::Code;
use crate::validate::JointScore;

/// A 95 % interval is honest if it holds this share of the held-out rows.
const COVERAGE: (f64, f64) = (0.90, 0.99);
/// Share of honest intervals that are called too wide.
const ALARM: f64 = 0.05;
/// What an interval promises to hold.
const LEVEL: f64 = 0.95;

/// Fewer held-out rows in the 95 % interval than an honest one has, and than chance leaves it; `memory` rows count as one.
#[must_use]
pub fn too_narrow(joint: &JointScore, memory: f64) -> bool {
    joint.rows > 0 && joint.coverage95 < COVERAGE.0.min(LEVEL - chance(joint.rows, memory))
}

/// More of them: so many independent rows that some ought to lie outside.
#[must_use]
pub fn too_wide(joint: &JointScore, memory: f64) -> bool {
    joint.coverage95 > COVERAGE.1 && enough_to_leave_some(joint.rows, memory)
}

/// Whether an honest interval may hold this share of so few rows.
#[must_use]
pub fn by_chance(joint: &JointScore, memory: f64) -> bool {
    let within = (joint.coverage95 - LEVEL).abs() <= chance(joint.rows, memory);
    within || joint.coverage95 > LEVEL && !enough_to_leave_some(joint.rows, memory)
}

/// Whether an honest interval holds all of so many rows in fewer than one twin in twenty.
fn enough_to_leave_some(rows: u64, memory: f64) -> bool {
    LEVEL.powf(rows as f64 / memory) < ALARM
}

/// Two standard errors of the share of rows inside an honest interval.
fn chance(rows: u64, memory: f64) -> f64 {
    2.0 * (LEVEL * (1.0 - LEVEL) * memory / rows as f64).sqrt()
}

/// What intervals hold over all joints, and joints on which it is too little or more than promised.
pub(super) fn claims(calibration: &Calibration) -> Vec<Claim> {
    let scores = decisive(&calibration.validation);
    let numbers = [
        ("coverage95", scores.coverage95),
        ("rows", rows_of(scores) as f64),
    ];
    let at_rest_too = rest::rest_got_worse(calibration) && rest::few_pauses(calibration).is_none();
    let together = match scores.coverage95 {
        share if share < COVERAGE.0 && at_rest_too => Code::NarrowIntervalsInMotion,
        share if share < COVERAGE.0 => Code::NarrowIntervals,
        share if share > COVERAGE.1 => Code::WideIntervals,
        _ => Code::IntervalsHold,
    };
    let mut out = vec![Claim::new(together, Subject::Run, numbers)];
    for joint in scores.joints.iter().filter(|joint| joint.rows > 0) {
        let memory = memory(&calibration.noise, &joint.joint);
        let subject = Subject::Joint(joint.joint.clone());
        let numbers = [
            ("coverage95", joint.coverage95),
            ("independent_rows", joint.rows as f64 / memory),
        ];
        if too_narrow(joint, memory) {
            out.push(Claim::new(Code::JointIntervalsNarrow, subject, numbers));
        } else if too_wide(joint, memory) {
            out.push(Claim::limit(Code::JointIntervalsWide, subject, numbers));
        }
    }
    out
}
