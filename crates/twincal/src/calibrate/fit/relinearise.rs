//! Columns about what a fit found, where found effects multiply each other.

use crate::calibrate::data::all_logs::Data;
use crate::calibrate::data::log::Log;
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Code, Finding, Result, Severity};
use crate::observations::Part;
use crate::plug_in::Fit;
use crate::robot::{Motion, Robot, nominal_torque};
use crate::signal::{Numbers, Payload};
use crate::term::{Library, LibrarySettings};
use crate::words::significant;
use std::collections::BTreeMap;

/// Standard deviations by which what is missing may move coefficients.
const MOVES: f64 = 0.1;
/// Rows of a log that it is measured on, evenly spread.
const ROWS: usize = 256;
/// Effects that are more likely in than out.
const IN: f64 = 0.5;
/// Effects that a finding names.
const NAMED: usize = 4;

/// What the columns of a fit say of effects that multiply each other.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::calibrate) enum Linear {
    /// Enough: nothing would move.
    Enough,
    /// They have to be worked out anew about these effects, by name of their term.
    Elsewhere(BTreeMap<String, f64>),
    /// Not enough after the last time; coefficients may move by this many standard deviations.
    Open(f64),
}

/// Whether the columns of a fit have to be worked out anew about the effects of the robot model that it holds for real.
///
/// With d_j the torque of these effects acting together, less what the linear model makes of them, coefficients move by less than
///
/// ```text
/// √( Σ_j n_j mean(d_j²) / σ_j² )
/// ```
/// of their standard deviations, n_j effective rows with noise σ_j: no direction of the coefficients sees more. Where that is more than
/// a tenth the fit goes on about these effects.
///
/// # Errors
/// Those of [`Robot::carrying`].
pub(in crate::calibrate) fn elsewhere(
    (robot, library, library_settings): (&Robot, &Library, &LibrarySettings),
    data: &Data,
    fit: &Fit,
    settings: &CalibrationSettings,
) -> Result<Linear> {
    let known = &library_settings.linearised_at;
    let found = found(library, fit);
    let multiplies = |point: &BTreeMap<String, f64>| {
        let terms = library.terms().iter();
        let mut own = terms.filter(|term| point.contains_key(&term.name));
        own.any(|term| term.family.multiplies())
    };
    let asked = settings.relinearise > 0 || !known.is_empty();
    if !asked || !(multiplies(&found) || multiplies(known)) {
        return Ok(Linear::Enough);
    }
    let there = library.linearised(robot, &found)?;
    let beta = there_alone(library, &found);
    let mut moves = 0.0;
    for (log, payload) in data.fit.iter().zip(&data.payloads) {
        let missing = missing(
            (robot, [library, &there]),
            log,
            (*payload, data.acts(*payload)),
            &beta,
        )?;
        let whole = [log.observations.whole()];
        moves += weighed(&missing, fit, &whole);
    }
    let moves = moves.sqrt();
    Ok(match settings.relinearise {
        // Not a number is no reason for another pass.
        _ if moves <= MOVES || moves.is_nan() => Linear::Enough,
        0 => Linear::Open(moves),
        _ => Linear::Elsewhere(found),
    })
}

/// Components of which columns stand about what was found; first those that act on others.
pub(in crate::calibrate) fn components<'a>(
    library: &'a Library,
    point: &BTreeMap<String, f64>,
) -> Vec<&'a str> {
    let terms = library.terms().iter();
    let mut own: Vec<_> = terms
        .filter(|term| point.contains_key(&term.name))
        .collect();
    own.sort_by_key(|term| !term.family.multiplies());
    let mut names: Vec<&str> = Vec::new();
    for term in own {
        let name = library.components()[term.component].name.as_str();
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// Says that columns stand about what was found of these components.
pub(in crate::calibrate) fn finding(names: &[&str], open: Option<f64>) -> Option<Finding> {
    if names.is_empty() {
        return None;
    }
    let named = names[..names.len().min(NAMED)].join(", ");
    let more = match names.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let about = format!(
        "effects that multiply each other: the columns were worked out anew about what was found of {named}{more}"
    );
    Some(match open {
        None => Finding::new(
            Severity::Note,
            Code::Relinearised,
            "",
            about,
            names.len() as u64,
        ),
        Some(moves) => {
            let message = format!(
                "{about}. Once more would move a coefficient by up to {} of its standard deviations. A log with a known payload tells such effects from each other",
                significant(moves, 2)
            );
            Finding::new(
                Severity::Warning,
                Code::Relinearised,
                "",
                message,
                names.len() as u64,
            )
            .with([("change_in_sd", moves)])
        }
    })
}

/// Coefficients of the effects of the robot model that are in, by name of their term.
pub(in crate::calibrate) fn found(library: &Library, fit: &Fit) -> BTreeMap<String, f64> {
    let columns = library.columns().iter().enumerate();
    let posterior = &fit.posterior;
    let own = columns.filter(|(column, _)| {
        posterior.inclusion[*column] >= IN && library.is_number_of_robot(*column)
    });
    own.map(|(column, &term)| (library.terms()[term].name.clone(), posterior.mean[column]))
        .collect()
}

/// The same, one per column.
fn there_alone(library: &Library, found: &BTreeMap<String, f64>) -> Vec<f64> {
    let value = |&term: &usize| found.get(&library.terms()[term].name).copied();
    let columns = library.columns().iter();
    columns.map(|term| value(term).unwrap_or(0.0)).collect()
}

/// Mean square per joint, (N·m)², of the torque of the effects `beta` beside what the linear model about `here` makes of them.
fn missing(
    (robot, [here, there]): (&Robot, [&Library; 2]),
    log: &Log,
    (payload, acts): (Payload, bool),
    beta: &[f64],
) -> Result<Vec<f64>> {
    let rows = &log.observations;
    let count = rows.len().min(ROWS);
    if count == 0 {
        return Ok(vec![0.0; robot.dof()]);
    }
    let picked: Vec<usize> = (0..count).map(|i| i * rows.len() / count).collect();
    let pick = |joints: &[Numbers]| -> Vec<f64> {
        let of_joint = |joint: &Numbers| -> Vec<f64> {
            let all = joint.get();
            picked.iter().map(|&row| all[row]).collect()
        };
        joints.iter().flat_map(of_joint).collect()
    };
    let (q, qd, qdd) = (pick(&rows.q), pick(&rows.qd), pick(&rows.qdd));
    let motion = Motion {
        len: count,
        q: &q,
        qd: &qd,
        qdd: &qdd,
    };
    let loaded = match payload {
        Payload::Known { mass, com } => {
            Some(robot.carrying(here.payload_frame(robot), mass, com)?)
        }
        Payload::None | Payload::Unknown => None,
    };
    let robot = loaded.as_ref().unwrap_or(robot);
    let [here, there] = [here, there].map(|library| library.in_log(robot, acts));
    let linear = here.torque_with(robot, motion, acts, beta);
    let mut together = vec![0.0; q.len()];
    nominal_torque(there.robot(robot), motion, &mut together);
    let joints = together
        .chunks_exact(count)
        .zip(linear.chunks_exact(count))
        .enumerate();
    let square = joints.map(|(joint, (together, linear))| {
        let gain = there.gain(joint);
        let sum: f64 = together
            .iter()
            .zip(linear)
            .map(|(all, part)| (gain * all - part).powi(2))
            .sum();
        sum / count as f64
    });
    Ok(square.collect())
}

/// Σ_j n_j d_j² / σ_j² of one log.
fn weighed(square: &[f64], fit: &Fit, log: &[Part<'_>]) -> f64 {
    let (plug_in, noise) = (&fit.plug_in, fit.posterior.noise);
    let of_logs = |joint: usize| log.iter().map(|part| part.moving_rows(joint)).sum::<f64>();
    let of_joint = |(joint, square): (usize, &f64)| {
        let rho = plug_in.rho[joint];
        let rows = of_logs(joint) * plug_in.counted(joint) * (1.0 - rho) / (1.0 + rho);
        let left = plug_in.variance.get(joint).copied().unwrap_or(1.0);
        rows * square * plug_in.weight[joint] * (1.0 - rho * rho) / (left * noise)
    };
    square.iter().enumerate().map(of_joint).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_settled_is_a_warning_with_its_size() {
        assert_eq!(finding(&[], Some(0.3)), None);
        let settled = finding(&["base.tilt", "payload"], None).unwrap();
        assert_eq!((settled.severity, settled.count), (Severity::Note, 2));
        let open = finding(&["base.tilt", "payload"], Some(0.34)).unwrap();
        assert_eq!(open.severity, Severity::Warning);
        assert!(open.message.contains("base.tilt, payload") && open.message.contains("0.34"));
    }
}
