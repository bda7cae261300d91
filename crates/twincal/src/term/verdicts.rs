//! What the judgement of each candidate means for `terms[]`, and what must be said of it.

use super::aliases::Verdict;
use super::candidate::Candidate;
use super::expression::Graph;
use super::{Family, Status};
use crate::error::{Code, Error, Finding, Result, Severity};

/// Verdicts as statuses, with a finding for everything the user wrote in vain.
pub(super) fn statuses(
    graph: &Graph,
    candidates: &[Candidate],
    verdicts: &[Verdict],
    acting: &[Vec<usize>],
    findings: &mut Vec<Finding>,
) -> Result<Vec<Status>> {
    let mut repeated = Vec::new();
    // What has no torque at all stands for nothing, whatever its share.
    let stands = |k: usize| candidates[k].model.is_none() || !acting[k].is_empty();
    let mut statuses = Vec::with_capacity(candidates.len());
    for ((candidate, verdict), acting) in candidates.iter().zip(verdicts).zip(acting) {
        let name = &candidate.name;
        if candidate.model.is_some() && acting.is_empty() {
            statuses.push(Status::NullLagrangian); // e.g. the mass of a link on a vertical axis
            continue;
        }
        let severity = if candidate.family == Family::User {
            Severity::Warning
        } else {
            Severity::Note
        };
        statuses.push(match verdict {
            Verdict::New => Status::Candidate,
            Verdict::NeverFinite(states) => {
                return Err(Error::Term {
                    term: name.clone(),
                    column: 1,
                    problem: format!("it or its torque is not a finite number at any of {states} random states"),
                    remedy: "check the domains of log, sqrt and powers, and divisions by zero".to_owned(),
                });
            }
            Verdict::Null => {
                let why = if candidate.lagrangian.is_some_and(|phi| graph.as_constant(phi).is_some()) {
                    "it is constant"
                } else {
                    "it is the time derivative of a function of q"
                };
                let message =
                    format!("term `{name}` has no torque for any motion ({why}): it is no column; delete it or correct it");
                findings.push(Finding::new(severity, Code::NullLagrangian, name, message, 1));
                Status::NullLagrangian
            }
            Verdict::NotCompared => {
                let message = format!(
                    "term `{name}` is a finite number at too few states to be compared with the others: whether it repeats \
                     one of them was not checked; write it so that it exists for all motions of the robot"
                );
                findings.push(Finding::new(severity, Code::AliasUnchecked, name, message, 1));
                Status::Candidate
            }
            Verdict::Combination(combination) => {
                let others: Vec<&str> = combination.iter().filter(|(_, k)| stands(*k)).map(|&(_, k)| candidates[k].name.as_str()).collect();
                if candidate.family == Family::User {
                    let formula: Vec<String> =
                        combination.iter().filter(|(_, k)| stands(*k)).map(|&(factor, k)| share(factor, &candidates[k].name)).collect();
                    let message = format!(
                        "term `{name}` has the same torque as {} for every motion: it is no column; keep one of them",
                        formula.join(" ")
                    );
                    findings.push(Finding::new(severity, Code::Alias, name, message, 1));
                } else {
                    repeated.push(format!("{name} (by {})", others.join(", ")));
                }
                Status::AliasOf(others.join(", "))
            }
        });
    }
    if !repeated.is_empty() {
        let shown = repeated
            .iter()
            .take(10)
            .cloned()
            .collect::<Vec<_>>()
            .join("; ");
        let more = if repeated.len() > 10 {
            format!("; and {} more", repeated.len() - 10)
        } else {
            String::new()
        };
        let message = format!(
            "built-in terms whose torque others have for every motion are no columns: {shown}{more}"
        );
        findings.push(Finding::new(
            Severity::Note,
            Code::Alias,
            "",
            message,
            repeated.len() as u64,
        ));
    }
    Ok(statuses)
}

/// "+2 × `name`", with six significant digits.
fn share(factor: f64, name: &str) -> String {
    let rounded: f64 = format!("{factor:.5e}").parse().unwrap_or(factor);
    if (1e-4..1e6).contains(&rounded.abs()) {
        format!("{rounded:+} × `{name}`")
    } else {
        format!("{rounded:+e} × `{name}`")
    }
}
