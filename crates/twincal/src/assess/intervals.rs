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
/// Joints whose intervals hold another share than this are named: 92 to 98 % in whole percent.
const ABOUT: (f64, f64) = (0.915, 0.985);
/// Share of the intervals' width that would have done, from which they are called much too wide where they hold all.
const MUCH_TOO_WIDE: f64 = 0.5;
/// What an interval promises to hold.
const LEVEL: f64 = 0.95;

/// Fewer held-out rows in the 95 % interval than an honest one has, and than chance leaves it; `memory` rows count as one.
pub(super) fn too_narrow(joint: &JointScore, memory: f64) -> bool {
    joint.rows > 0 && joint.coverage95 < COVERAGE.0.min(LEVEL - chance(joint.rows, memory))
}

/// More of them: so many independent rows that some ought to lie outside.
pub(super) fn too_wide(joint: &JointScore, memory: f64) -> bool {
    joint.coverage95 > COVERAGE.1 && enough_to_leave_some(joint.rows, memory)
}

/// Whether an honest interval may hold this share of so few rows.
pub(super) fn by_chance(joint: &JointScore, memory: f64) -> bool {
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

/// What stands beside it: the held-out time, what intervals hold at standstill, and how much of their width would have done where they hold all.
fn beside(calibration: &Calibration) -> Vec<(&'static str, f64)> {
    let validation = &calibration.validation;
    let judged = decisive(validation);
    let all = validation.filtered.joints.iter().map(|joint| joint.rows);
    let steps = all.max().unwrap_or(0).saturating_sub(1);
    let mut out = vec![("seconds", steps as f64 / calibration.kept_rate_hz())];
    if let Some(still) = rest::all_at_rest(validation) {
        out.push(("rows_at_rest", still.rows as f64));
        out.push(("coverage95_at_rest", still.coverage95));
    }
    let factor = validation.conformal.as_ref().map(|c| c.factor);
    let wide = |factor: &f64| *factor < MUCH_TOO_WIDE && judged.coverage95 > COVERAGE.1;
    out.extend(factor.filter(wide).map(|factor| ("width_needed", factor)));
    out
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
    let claim = Claim::new(together, Subject::Run, numbers);
    let mut out = vec![claim.with(beside(calibration))];
    let several = scores.joints.iter().filter(|j| j.rows > 0).count() > 1;
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
        } else if several && !(ABOUT.0..=ABOUT.1).contains(&joint.coverage95) {
            let code = match by_chance(joint, memory) {
                true => Code::JointCoverageByChance,
                false => Code::JointCoverageOff,
            };
            out.push(Claim::new(code, subject, numbers));
        }
    }
    out
}
