//! `assessment` of `result.json`: may the twin be used, why, and what to do next, in codes and numbers.

use crate::report::{Conclusion, Reason, answer};
use serde::Serialize;
use twincal::calibrate::Calibration;
use twincal::validate::Split;
use twincal::{Code, Finding, Severity};

/// Version of its layout.
const VERSION: u64 = 1;

/// What may be concluded.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Assessment<'a> {
    version: u64,
    answer: Conclusion,
    reason: Reason,
    claims: Vec<Claim<'a>>,
    next: Vec<Request<'a>>,
}

/// Something that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Claim<'a> {
    code: Code,
    role: Role,
    severity: Severity,
    /// Log, joint, link, component or term; empty for the whole run.
    subject: &'a str,
    evidence: Evidence,
}

/// What a claim means for the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Role {
    /// Beside it there is no "yes".
    ForbidsYes,
    /// It says where the answer does not hold.
    Limits,
    /// It is for information.
    Informs,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Evidence {
    /// Samples, rows or elements; 0 where nothing is counted.
    count: u64,
}

/// What to record.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Request<'a> {
    code: RequestCode,
    /// Joint; empty for the whole robot.
    subject: &'a str,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum RequestCode {
    /// A log that is not fitted.
    HeldOutLog,
    /// A longer one.
    LongerHeldOutLog,
    /// A log with more motion of a joint.
    MoreMotion,
}

impl<'a> Assessment<'a> {
    /// Of a calibration.
    pub(crate) fn of(calibration: &'a Calibration) -> Self {
        let reason = answer(calibration).reason;
        Self {
            version: VERSION,
            answer: reason.conclusion(),
            reason,
            claims: calibration.findings.iter().map(Claim::of).collect(),
            next: requests(calibration, reason),
        }
    }
}

impl<'a> Claim<'a> {
    fn of(finding: &'a Finding) -> Self {
        let role = match (finding.mistake(), finding.severity) {
            (Some(_), _) => Role::ForbidsYes,
            (None, Severity::Note) => Role::Informs,
            (None, Severity::Warning | Severity::Degraded) => Role::Limits,
        };
        Self {
            code: finding.code,
            role,
            severity: finding.severity,
            subject: &finding.subject,
            evidence: Evidence {
                count: finding.count,
            },
        }
    }
}

fn requests(calibration: &Calibration, reason: Reason) -> Vec<Request<'_>> {
    let whole = |code| Request { code, subject: "" };
    let mut requests = Vec::new();
    let split = &calibration.validation.split;
    if matches!(split, Split::LastThirty | Split::NotTested) {
        requests.push(whole(RequestCode::HeldOutLog));
    } else if reason == Reason::FewHeldOutRows {
        requests.push(whole(RequestCode::LongerHeldOutLog));
    }
    let findings = calibration.findings.iter();
    let unseen = findings.filter(|own| own.code == Code::UnseenMotion && !own.subject.is_empty());
    requests.extend(unseen.map(|finding| Request {
        code: RequestCode::MoreMotion,
        subject: &finding.subject,
    }));
    requests.dedup();
    requests
}
