//! "A or B, the data cannot tell": pairs of effects that stand in for each other, joints that hardly moved.

use super::text::{fixed, list, percent, probability};
use super::view::Joint;
use twincal::calibrate::Calibration;
use twincal::posterior::Model;
use twincal::term::Status;

/// At least one of the two must be this probable for a pair to be named.
const ANY: f64 = 0.9;
/// Both together must be less probable than this.
const BOTH: f64 = 0.1;
/// Neither of the two may be more probable than this: then it would be clear which one it is.
const ALONE: f64 = 0.95;
/// Two coefficients whose draws correlate this much are known as a combination.
const CORRELATED: f64 = 0.95;
/// A joint that stood still for more than this share of the rows hardly moved.
const STOOD: f64 = 0.5;

/// One sentence for each thing that the data leave open.
pub(super) fn sentences(calibration: &Calibration, joints: &[Joint<'_>]) -> Vec<String> {
    let mut out = either_or(calibration);
    let draws = &calibration.draws;
    for (i, j, r) in super::figures::pairs::correlations(&draws.values) {
        if let (true, Some(one), Some(other)) = (
            r.abs() >= CORRELATED,
            draws.terms.get(i),
            draws.terms.get(j),
        ) {
            out.push(format!(
                "{one} and {other} are known as a combination only (correlation {}): a motion that separates them would tell \
                 them apart.",
                fixed(r, 3)
            ));
        }
    }
    let still: Vec<String> = joints
        .iter()
        .enumerate()
        .filter_map(|(j, joint)| {
            let share = standstill(calibration, j);
            (share > STOOD).then(|| format!("{} (stood still for {})", joint.name, percent(share)))
        })
        .collect();
    if !still.is_empty() {
        out.push(format!(
            "Hardly moved: {}. Effects on these joints rest on little data.",
            list(&still)
        ));
    }
    out
}

/// Share of the fitted rows of joint `j` at standstill; NaN without rows.
pub(super) fn standstill(calibration: &Calibration, j: usize) -> f64 {
    let fitted = || calibration.logs.iter().filter(|log| log.role == "fit");
    let moved: u64 = fitted()
        .map(|log| log.rows.get(j).copied().unwrap_or(0))
        .sum();
    let stood: u64 = fitted()
        .map(|log| log.standstill.get(j).copied().unwrap_or(0))
        .sum();
    stood as f64 / (moved + stood) as f64
}

/// Pairs of which one is almost surely there, rarely both.
fn either_or(calibration: &Calibration) -> Vec<String> {
    let models = &calibration.twin.posterior.models;
    let columns: Vec<&str> = calibration
        .terms
        .iter()
        .filter(|t| t.term.status == Status::Candidate)
        .map(|t| t.term.name.as_str())
        .collect();
    let open: Vec<u32> = (0..columns.len() as u32)
        .filter(|&k| {
            let p = mass(models, |z| z.contains(&k));
            p > 1.0 - ALONE && p < ALONE
        })
        .collect();
    let mut out = Vec::new();
    for (i, &a) in open.iter().enumerate() {
        for &b in &open[i + 1..] {
            let any = mass(models, |z| z.contains(&a) || z.contains(&b));
            if any >= ANY && mass(models, |z| z.contains(&a) && z.contains(&b)) < BOTH {
                out.push(format!(
                    "Either {} or {}: one of them is there with probability {}, but these data cannot tell which.",
                    columns[a as usize],
                    columns[b as usize],
                    probability(any)
                ));
            }
        }
    }
    out
}

fn mass(models: &[Model], holds: impl Fn(&[u32]) -> bool) -> f64 {
    models
        .iter()
        .filter(|model| holds(&model.members))
        .map(|model| model.weight)
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{fixture, view};

    #[test]
    fn two_effects_that_exclude_each_other_are_named_together() {
        let mut calibration = fixture::two_joints();
        let template = calibration.twin.posterior.models[0].clone();
        // Column 7 in every model; either column 0 or column 2 beside it.
        calibration.twin.posterior.models =
            [(vec![0, 7], 0.55), (vec![2, 7], 0.43), (vec![7], 0.02)]
                .map(|(members, weight)| Model {
                    members,
                    weight,
                    ..template.clone()
                })
                .to_vec();
        let open = either_or(&calibration);
        assert_eq!(open.len(), 1, "{open:?}");
        // Column 1 of the library is a dropped term: column 2 of the regression is its fourth term.
        assert!(
            open[0].contains("Either q2^2 or qd2^2") && open[0].contains("0.98"),
            "{open:?}"
        );
    }

    #[test]
    fn both_together_or_one_alone_is_no_either_or() {
        let mut calibration = fixture::two_joints();
        let template = calibration.twin.posterior.models[0].clone();
        for models in [
            [(vec![0, 2], 0.9), (vec![], 0.1)],
            [(vec![0], 0.99), (vec![2], 0.01)],
        ] {
            calibration.twin.posterior.models = models
                .map(|(members, weight)| Model {
                    members,
                    weight,
                    ..template.clone()
                })
                .to_vec();
            assert_eq!(either_or(&calibration), Vec::<String>::new());
        }
    }

    #[test]
    fn joints_that_stood_still_are_named() {
        let mut calibration = fixture::two_joints();
        for log in &mut calibration.logs {
            (log.rows[1], log.standstill[1]) = (100, 900);
        }
        let said = sentences(&calibration, &view::joints(&calibration));
        assert!(
            said.iter()
                .any(|s| s.contains("elbow") && s.contains("90.0")),
            "{said:?}"
        );
        assert!(!said.iter().any(|s| s.contains("shoulder (stood")));
    }
}
