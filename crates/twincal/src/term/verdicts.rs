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
        statuses.push(match verdict {
            Verdict::New => Status::Candidate,
            Verdict::NeverFinite(states) => {
                return Err(Error::Term {
                    term: name.clone(),
                    column: 1,
                    problem: format!(
                        "it or its torque is not a finite number at any of {states} random states"
                    ),
                    remedy: "check the domains of log, sqrt and powers, and divisions by zero"
                        .to_owned(),
                });
            }
            Verdict::Null => {
                findings.push(null(graph, candidate));
                Status::NullLagrangian
            }
            Verdict::NotCompared => {
                findings.push(unchecked(candidate));
                Status::Candidate
            }
            Verdict::Combination(combination) => {
                let others = combination.iter().filter(|(_, k)| stands(*k));
                let others: Vec<(f64, &str)> = others
                    .map(|&(factor, k)| (factor, candidates[k].name.as_str()))
                    .collect();
                let names: Vec<&str> = others.iter().map(|(_, other)| *other).collect();
                let names = names.join(", ");
                if candidate.family == Family::User {
                    findings.push(alias(candidate, &others));
                } else {
                    repeated.push(format!("{name} (by {names})"));
                }
                Status::AliasOf(names)
            }
        });
    }
    if !repeated.is_empty() {
        findings.push(built_in_aliases(&repeated));
    }
    Ok(statuses)
}

/// A warning where the user wrote the term, else a note.
fn about(candidate: &Candidate, code: Code, message: String) -> Finding {
    let severity = match candidate.family {
        Family::User => Severity::Warning,
        _ => Severity::Note,
    };
    Finding::new(severity, code, &candidate.name, message, 1)
}

/// The term has no torque for any motion.
fn null(graph: &Graph, candidate: &Candidate) -> Finding {
    let constant = |phi| graph.as_constant(phi).is_some();
    let why = match candidate.lagrangian.is_some_and(constant) {
        true => "it is constant",
        false => "it is the time derivative of a function of q",
    };
    let message = format!(
        "term `{}` has no torque for any motion ({why}): it is no column; delete it or correct it",
        candidate.name
    );
    about(candidate, Code::NullLagrangian, message)
}

/// The term exists at too few states to be compared.
fn unchecked(candidate: &Candidate) -> Finding {
    let message = format!(
        "term `{}` is a finite number at too few states to be compared with the others: whether it repeats \
         one of them was not checked; write it so that it exists for all motions of the robot",
        candidate.name
    );
    about(candidate, Code::AliasUnchecked, message)
}

/// The term has the torque of others, each with its factor.
fn alias(candidate: &Candidate, others: &[(f64, &str)]) -> Finding {
    let formula: Vec<String> = others
        .iter()
        .map(|(factor, other)| share(*factor, other))
        .collect();
    let message = format!(
        "term `{}` has the same torque as {} for every motion: it is no column; keep one of them",
        candidate.name,
        formula.join(" ")
    );
    about(candidate, Code::Alias, message)
}

/// Built-in terms that have the torque of others.
fn built_in_aliases(repeated: &[String]) -> Finding {
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
    Finding::new(
        Severity::Note,
        Code::Alias,
        "",
        message,
        repeated.len() as u64,
    )
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
