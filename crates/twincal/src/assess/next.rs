//! The recording to make next: what it has to hold so that this data's open questions get an answer.

use super::answer::Answer;
use super::beyond;
use super::claim::{Claim, Role, Subject};
use super::rest::hardly_at_rest;
use super::scores::{FEW, independent_rows};
use crate::calibrate::{Alike, Calibration};
use crate::error::Evidence;
use crate::error::{Code, Finding};
use crate::posterior::OPEN;
use crate::validate::Split;
use serde::Serialize;

/// Something to record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Request {
    /// What.
    pub code: RequestCode,
    /// Of whom.
    pub subject: Subject,
    /// By which numbers.
    pub evidence: Evidence,
}

/// What to record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum RequestCode {
    /// A log that is not fitted: another motion.
    HeldOutLog,
    /// A longer one.
    LongerHeldOutLog,
    /// Pauses in several poses, in a log that is not fitted.
    HeldOutPauses,
    /// A log to fit with more motion of a joint.
    MoreMotion,
    /// A log to fit in which no joint is at rest or hardly driven.
    JointsTogether,
    /// The motion of a joint that only the held-out logs have.
    MotionOfHeldOutLogs,
    /// Another motion, so that a component can be told from what is alike in these logs.
    AnotherMotion,
    /// The full resolution of an encoder.
    FullResolution,
    /// A motion designed to decide whether a component is there ([`crate::design`]).
    DesignedMotion,
}

/// What would show more. A log that is no measurement of this model has to be corrected first: then nothing is asked for.
pub(super) fn requests(calibration: &Calibration, claims: &[Claim]) -> Vec<Request> {
    let is_mistake =
        |claim: &&Claim| claim.role == Role::ForbidsYes && Answer::of_result(claim.code).is_none();
    if claims.iter().any(|claim| is_mistake(&claim)) {
        return Vec::new();
    }
    let mut out = to_fit(calibration);
    out.extend(to_test(calibration));
    let mut seen: Vec<Request> = Vec::new();
    out.retain(|own| {
        let new = !seen.contains(own);
        seen.push(own.clone());
        new
    });
    out
}

/// Names of the effects that are open questions, which a designed motion may decide ([`crate::design::Questions`]): none that others have
/// the torque of in every motion, and none where the log or the model is doubtful or the regression is not at hand.
#[must_use]
pub fn open_effects(calibration: &Calibration) -> Vec<&str> {
    let doubtful = calibration.findings.iter().any(Finding::doubts_the_log);
    if doubtful || calibration.problem.is_none() {
        return Vec::new();
    }
    let is_open = |pip: f64| (OPEN[0]..OPEN[1]).contains(&pip);
    let structural = |name: &String| {
        let mut groups = calibration.groups.iter();
        groups.any(|group| group.alike == Alike::EveryMotion && group.members.contains(name))
    };
    let all = calibration.components.iter();
    all.filter(|own| own.pip.is_some_and(is_open) && !structural(&own.name))
        .map(|own| own.name.as_str())
        .collect()
}

fn to_fit(calibration: &Calibration) -> Vec<Request> {
    let of = |code, subject| Request {
        code,
        subject,
        evidence: Evidence::default(),
    };
    let findings = || calibration.findings.iter();
    let joint = |name: &str| Subject::Joint(name.to_owned());
    let mut out: Vec<Request> = findings()
        .filter(|f| f.code == Code::UnseenMotion && !f.subject.is_empty())
        .map(|f| of(RequestCode::MoreMotion, joint(&f.subject)))
        .collect();
    out.extend(
        driven_together(calibration).map(|(together, logs)| Request {
            evidence: Evidence::of([("together", together as f64), ("logs", logs as f64)]),
            ..of(RequestCode::JointsTogether, Subject::Run)
        }),
    );
    let new = beyond::new_motion(calibration);
    out.extend(new.map(|name| of(RequestCode::MotionOfHeldOutLogs, joint(name))));
    let groups = calibration.groups.iter();
    let apart = groups.filter(|group| group.alike == Alike::TheseLogs && !group.settled);
    let apart = apart.filter_map(|group| group.members.first());
    out.extend(apart.map(|name| of(RequestCode::AnotherMotion, Subject::Component(name.clone()))));
    let coarse = findings().filter(|f| f.code == Code::QuantisedEncoder);
    out.extend(coarse.map(|f| of(RequestCode::FullResolution, joint(&f.subject))));
    let open = open_effects(calibration).into_iter();
    out.extend(open.map(|name| of(RequestCode::DesignedMotion, Subject::Component(name.into()))));
    out
}

fn to_test(calibration: &Calibration) -> Vec<Request> {
    let of = |code| Request {
        code,
        subject: Subject::Run,
        evidence: Evidence::default(),
    };
    let untried = matches!(
        calibration.validation.split,
        Split::LastThirty | Split::NotTested
    );
    let mut out = Vec::new();
    if untried {
        out.push(of(RequestCode::HeldOutLog));
    } else if independent_rows(calibration) < FEW {
        out.push(of(RequestCode::LongerHeldOutLog));
    }
    // Standstill is no part of a fit.
    out.extend(hardly_at_rest(calibration).map(|_| of(RequestCode::HeldOutPauses)));
    out
}

/// In how many of the fitted logs, and of how many, no joint stands still or is hardly driven that another one drives; `None` where these
/// are half of them or more, with a single log, and with a single joint.
fn driven_together(calibration: &Calibration) -> Option<(usize, usize)> {
    let logs = calibration.logs.iter().filter(|log| log.role == "fit");
    let logs: Vec<&str> = logs.map(|log| log.name.as_str()).collect();
    let passive = |log: &str, joint: &str| {
        let mut findings = calibration.findings.iter();
        findings.any(|f| {
            matches!(f.code, Code::JointNotDriven | Code::JointStandsStill)
                && f.subject == log
                && f.is_about(joint)
        })
    };
    let all = calibration.twin.robot.joint_names();
    let driven: Vec<&str> = (all.iter().copied())
        .filter(|joint| logs.iter().any(|log| !passive(log, joint)))
        .collect();
    let together = logs
        .iter()
        .filter(|log| !driven.iter().any(|joint| passive(log, joint)))
        .count();
    (driven.len() > 1 && logs.len() > 1 && 2 * together < logs.len())
        .then_some((together, logs.len()))
}
