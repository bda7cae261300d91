//! How many independent rows a fit rests on, and what is said where they are few.

use super::correlate::strongest;
use crate::calibrate::data::all_logs::refuse;
use crate::error::{Code, Finding, Result, Severity};
use crate::observations::Part;
use crate::plug_in::Fit;
use crate::robot::Robot;

/// Effective rows below which nothing is concluded (case 7).
pub(in crate::calibrate) const LEAST_EFFECTIVE_ROWS: f64 = 10.0;

/// Rows of a joint that are not at standstill, and the independent rows that they count as once the autocorrelation of what is left is
/// counted. What no candidate describes is no matter of the rows: more of them would not help.
fn of_joint(fit: &Fit, joint: usize) -> [f64; 2] {
    let (n, rho) = (fit.gram.joints[joint].n, fit.plug_in.rho[joint]);
    let counted = fit.plug_in.passed / fit.plug_in.autocorrelation_time[joint];
    [n, n * counted * (1.0 - rho) / (1.0 + rho)]
}

/// How many there are.
pub(in crate::calibrate) struct Counted {
    /// Those of the joint that has most; 0 where no joint was asked.
    pub(in crate::calibrate) most: f64,
    /// Joints that have few.
    pub(in crate::calibrate) findings: Vec<Finding>,
}

/// Names the joints whose rows say next to nothing, and refuses a fit in which those of every joint do. A joint that stands
/// still throughout has no rows, one without a candidate has no columns: neither takes part. `training` are the rows, where they are there: what
/// their residual goes with is said.
pub(in crate::calibrate) fn require(
    robot: &Robot,
    fit: &Fit,
    training: &[Part<'_>],
) -> Result<Counted> {
    let has_columns = |joint: usize| !fit.gram.joints[joint].columns.is_empty();
    let names = robot.joint_names();
    let joints = (0..names.len()).filter(|joint| has_columns(*joint));
    let counted = joints.map(|joint| (names[joint], of_joint(fit, joint)));
    let (few, enough): (Vec<_>, Vec<_>) = counted
        .filter(|(_, [rows, _])| *rows > 0.0)
        .partition(|(_, [_, independent])| *independent < LEAST_EFFECTIVE_ROWS);
    if enough.is_empty() && !few.is_empty() {
        let counts: Vec<String> = (few.iter())
            .map(|(joint, [rows, independent])| {
                format!("the {rows} rows of joint `{joint}` count as {independent:.1}")
            })
            .collect();
        let best = (few.iter()).max_by(|a, b| a.1[1].total_cmp(&b.1[1]));
        let joint = best.and_then(|best| names.iter().position(|name| *name == best.0));
        let goes = joint.and_then(|joint| {
            let strongest = strongest(training, joint, &fit.posterior.mean)?;
            let share = (100.0 * strongest.share).round();
            let cause = strongest.cause;
            Some(format!(
                "; the residual of joint `{}` goes most with {cause} ({share} % of its variance)",
                names[joint]
            ))
        });
        return Err(refuse(
            format!(
                "{} independent rows once the residual's autocorrelation is counted, {LEAST_EFFECTIVE_ROWS} are needed{}",
                counts.join(", "),
                goes.unwrap_or_default()
            ),
            "log longer and faster motion, or give candidates for what the residual still holds ([library])",
        ));
    }
    let said = |(joint, [rows, independent]): (&str, [f64; 2])| {
        Finding::new(
            Severity::Warning,
            Code::FewEffectiveRows,
            joint,
            format!(
                "the {rows} rows of joint `{joint}` count as {independent:.1} independent rows, fewer than {LEAST_EFFECTIVE_ROWS}: what is \
                 found on it alone rests on little; log it longer and in faster motion"
            ),
            rows as u64,
        )
        .with([("independent_rows", independent), ("needed", LEAST_EFFECTIVE_ROWS)])
    };
    let most = enough.iter().map(|(_, [_, independent])| *independent);
    Ok(Counted {
        most: most.fold(0.0, f64::max),
        findings: few.into_iter().map(said).collect(),
    })
}
