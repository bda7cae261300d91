//! Held-out torque: is its error smaller than that of the model, of friction alone, and than the torque itself; and are there effects behind it.

use super::claim::{Claim, Subject};
use super::scores::{
    FEW, converged, decisive, friction_only, has_standstill, independent_rows, rows_of,
};
use crate::calibrate::{Calibration, Status, StatusReason};
use crate::error::{Code, Severity};
use crate::validate::{JointScore, Scores, WORSE};
use std::collections::BTreeSet;

/// Ratio of errors from which calibration counts as an improvement.
const BETTER: f64 = 0.95;
/// Share of the torque's standard deviation from which the remaining error is called large.
const LARGE: f64 = 0.5;
/// Change of the error of unfiltered torque, which has noise that no twin explains, from which it is told apart.
const UNFILTERED_APART: f64 = 0.25;
/// Ratio of errors from which friction alone does not do as well.
const AS_WELL: f64 = 1.05;

/// Error left of a joint, as a share of its torque's standard deviation; `None` where the torque does not vary.
fn error_share(joint: &JointScore) -> Option<f64> {
    let share = joint.rmse_calibrated / joint.torque_sd;
    (joint.rows > 0 && joint.torque_sd > 0.0 && share.is_finite()).then_some(share)
}

/// Whether it is more than half of it.
fn is_large(joint: &JointScore) -> bool {
    error_share(joint).is_some_and(|share| share > LARGE)
}

/// Whether a constant would predict the torque as well.
fn is_lost(joint: &JointScore) -> bool {
    error_share(joint).is_some_and(|share| share >= 1.0)
}

/// Whether a joint's torque got worse by calibration.
fn worse(joint: &JointScore) -> bool {
    joint.rows > 0 && joint.rmse_calibrated > WORSE * joint.rmse_nominal
}

/// What held-out torque says; `not_tested` alone where there is none, `nothing_found` alone where the model is exact.
pub(super) fn claims(calibration: &Calibration) -> Vec<Claim> {
    let all = &calibration.validation.filtered;
    if rows_of(all) == 0 || !(all.rmse_nominal.is_finite() && all.rmse_calibrated.is_finite()) {
        return vec![Claim::new(Code::NotTested, Subject::Run, [])];
    }
    let scores = decisive(&calibration.validation);
    let mut findings = calibration.findings.iter();
    if findings.any(|finding| finding.code == Code::NothingToCorrect) {
        // Errors of rounding have no order.
        return vec![Claim::new(Code::NothingFound, Subject::Run, [])];
    }
    let independent = independent_rows(calibration);
    let mut out = match independent < FEW {
        true => {
            let numbers = [("independent_rows", independent), ("needed", FEW)];
            vec![Claim::new(Code::FewHeldOutRows, Subject::Run, numbers)]
        }
        false => decisive_claims(calibration, scores),
    };
    let numbers = [
        ("rms_nominal", scores.rmse_nominal),
        ("rms_calibrated", scores.rmse_calibrated),
        ("rms_friction", friction_only(scores).unwrap_or(f64::NAN)),
    ];
    out.push(Claim::new(Code::TorqueError, Subject::Run, numbers));
    let joints = scores.joints.iter();
    out.extend(joints.flat_map(|joint| of_joint(joint, calibration)));
    out.extend(raw_is_worse(&calibration.validation.raw));
    out.extend(as_logged(calibration));
    out.extend(friction_alone(scores));
    out
}

/// What decides of all joints together.
fn decisive_claims(calibration: &Calibration, scores: &Scores) -> Vec<Claim> {
    let ratio = scores.rmse_calibrated / scores.rmse_nominal;
    let found = calibration.components.iter().any(|own| own.is_in());
    let joints = calibration.noise.len();
    let count = |of: fn(&JointScore) -> bool| scores.joints.iter().filter(|j| of(j)).count();
    let (lost, large) = (count(is_lost), count(is_large));
    let nothing = !found && ratio > BETTER;
    let friction = friction_only(scores);
    let rivalled = friction.is_some_and(|left| left < BETTER * scores.rmse_calibrated);
    let codes = [
        (ratio > WORSE, Code::WorseThanNominal),
        (lost > 0 && lost == joints, Code::ErrorAboveTorque),
        (
            lost < joints && 2 * lost > joints,
            Code::ErrorAboveTorqueOnMostJoints,
        ),
        (nothing, Code::NothingFound),
        (
            found && ratio > BETTER && ratio <= WORSE,
            Code::NoBetterThanNominal,
        ),
        (rivalled && !nothing, Code::FrictionAloneIsBetter),
        (large > 0 && large == joints, Code::LargeError),
        (
            large < joints && 2 * large > joints,
            Code::LargeErrorOnMostJoints,
        ),
    ];
    let numbers = [
        ("rms_nominal", scores.rmse_nominal),
        ("rms_calibrated", scores.rmse_calibrated),
        ("rms_friction", friction.unwrap_or(f64::NAN)),
        ("joints", joints as f64),
        ("joints_above_torque", lost as f64),
        ("joints_large", large as f64),
    ];
    let claimed = codes.into_iter().filter(|(holds, _)| *holds);
    claimed
        .map(|(_, code)| Claim::new(code, Subject::Run, numbers))
        .collect()
}

/// What one joint's error is compared with.
fn of_joint(joint: &JointScore, calibration: &Calibration) -> Vec<Claim> {
    if joint.rows == 0 {
        return Vec::new();
    }
    let subject = || Subject::Joint(joint.joint.clone());
    let numbers = [
        ("rms_nominal", joint.rmse_nominal),
        ("rms_calibrated", joint.rmse_calibrated),
        ("rms_friction", joint.rmse_friction.unwrap_or(f64::NAN)),
        ("torque_sd", joint.torque_sd),
    ];
    let mut out = Vec::new();
    if worse(joint) {
        out.push(Claim::new(Code::JointTorqueWorse, subject(), numbers));
    }
    if is_lost(joint) {
        let unseen = hardly_driven(&joint.joint, calibration);
        let unseen = unseen.then_some(("hardly_driven_held_out", 1.0));
        let claim = Claim::new(Code::JointErrorAboveTorque, subject(), numbers);
        out.push(claim.with(unseen));
    } else if is_large(joint) {
        out.push(Claim::limit(Code::JointErrorLarge, subject(), numbers));
    }
    let as_well = |left: f64| left <= AS_WELL * joint.rmse_calibrated;
    if joint.rmse_friction.is_some_and(as_well) {
        out.push(Claim::limit(Code::JointFrictionAlone, subject(), numbers));
    }
    out
}

/// Whether such a joint is hardly driven in a held-out log: then nothing could be seen there.
fn hardly_driven(joint: &str, calibration: &Calibration) -> bool {
    let held_out = |log: &str| {
        let mut logs = calibration.logs.iter();
        logs.any(|own| own.name == log && own.role == "heldout")
    };
    let mut findings = calibration.findings.iter();
    findings.any(|f| f.code == Code::JointNotDriven && held_out(&f.subject) && f.is_about(joint))
}

/// Error of torque as it was logged, of moving joints, where that is another matter than below the cut-off; and joints that are lost in it.
fn as_logged(calibration: &Calibration) -> Vec<Claim> {
    let validation = &calibration.validation;
    let judged = decisive(validation);
    let known = rows_of(&validation.raw_moving) > 0;
    let raw = match known && has_standstill(validation) {
        true => &validation.raw_moving,
        false => &validation.raw,
    };
    let lost = raw.joints.iter();
    let lost = lost.filter(|j| j.rows > 0 && j.rmse_calibrated > j.torque_sd);
    let apart = (raw.rmse_calibrated / judged.rmse_calibrated - 1.0).abs();
    let filtered = calibration.twin.pipeline.cutoff_hz > 0.0;
    if !filtered || rows_of(raw) == 0 || apart <= UNFILTERED_APART && lost.clone().count() == 0 {
        return Vec::new();
    }
    let numbers = [
        ("rms_nominal", raw.rmse_nominal),
        ("rms_calibrated", raw.rmse_calibrated),
    ];
    let mut out = vec![Claim::new(Code::RawTorqueError, Subject::Run, numbers)];
    out.extend(lost.map(|joint| {
        let subject = Subject::Joint(joint.joint.clone());
        let numbers = [
            ("rms_calibrated", joint.rmse_calibrated),
            ("torque_sd", joint.torque_sd),
        ];
        Claim::new(Code::JointRawErrorAboveTorque, subject, numbers)
    }));
    out
}

/// What the first thing that anybody adds to a model would leave: errors of a model without friction are large by that alone. Joints on which it would
/// be worse than the model, the worst first.
fn friction_alone(scores: &Scores) -> Vec<Claim> {
    let Some(left) = friction_only(scores) else {
        return Vec::new();
    };
    let own = scores.joints.iter().filter(|joint| joint.rows > 0);
    let own = own.filter_map(|joint| Some((joint, joint.rmse_friction?)));
    let (mut worse, better): (Vec<_>, Vec<_>) =
        own.partition(|(joint, left)| *left > joint.rmse_nominal);
    let growth = |(joint, left): &(&JointScore, f64)| left - joint.rmse_nominal;
    worse.sort_by(|a, b| growth(b).total_cmp(&growth(a)));
    let numbers = [
        ("rms_nominal", scores.rmse_nominal),
        ("rms_friction", left),
        ("joints_better", better.len() as f64),
    ];
    let mut out = vec![Claim::new(Code::FrictionAlone, Subject::Run, numbers)];
    out.extend(worse.iter().map(|(joint, left)| {
        let subject = Subject::Joint(joint.joint.clone());
        let numbers = [("rms_nominal", joint.rmse_nominal), ("rms_friction", *left)];
        Claim::new(Code::JointFrictionAloneWorse, subject, numbers)
    }));
    out
}

/// Torque as it was logged, where the twin predicts it worse than the model did.
fn raw_is_worse(raw: &Scores) -> Option<Claim> {
    let numbers = [
        ("rms_nominal", raw.rmse_nominal),
        ("rms_calibrated", raw.rmse_calibrated),
    ];
    (raw.rmse_calibrated > WORSE * raw.rmse_nominal)
        .then(|| Claim::limit(Code::RawTorqueWorse, Subject::Run, numbers))
}

/// What the effects themselves say.
pub(super) fn of_effects(calibration: &Calibration) -> Vec<Claim> {
    let all = || calibration.components.iter();
    let found = all().filter(|own| own.is_in()).count();
    let with = |status: Status| all().filter(move |own| own.status == status);
    let established = with(Status::Established).count();
    let sets: BTreeSet<&[String]> = with(Status::Equivalent)
        .filter_map(|own| match &own.reason {
            StatusReason::SameTorque { members, .. } => Some(members.as_slice()),
            _ => None,
        })
        .collect();
    let sure = established + sets.len();
    let findings = calibration.findings.iter();
    let warned = findings.filter(|f| f.severity == Severity::Warning);
    let no_bodies = warned
        .filter(|f| f.code == Code::UnphysicalInertiaFound)
        .count();
    let tentative = with(Status::Tentative).filter(|own| own.is_in()).count();
    let numbers = [
        ("found", found),
        ("established", established),
        ("equivalent_sets", sets.len()),
        ("tentative", tentative),
    ]
    .map(|(name, count)| (name, count as f64));
    let mut out = Vec::new();
    if found > 0 && sure == 0 {
        out.push(Claim::new(Code::NothingEstablished, Subject::Run, numbers));
    } else if sure > 0 {
        out.push(Claim::new(Code::EffectsEstablished, Subject::Run, numbers));
    }
    if no_bodies > 1 {
        let numbers = [("links", no_bodies as f64)];
        out.push(Claim::new(Code::UnphysicalLinks, Subject::Run, numbers));
    }
    if !converged(calibration) {
        out.push(Claim::new(Code::NotConverged, Subject::Run, []));
    }
    out
}
