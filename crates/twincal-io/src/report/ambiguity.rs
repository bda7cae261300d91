//! "A or B, the data cannot tell": pairs of effects that stand in for each other, joints that hardly moved.

use super::text::{fixed, list, percent, probability};
use super::view::Joint;
use twincal::calibrate::{Calibration, Group};

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

/// Sets of effects of which one is there, and these data cannot tell which.
fn either_or(calibration: &Calibration) -> Vec<String> {
    let sentence = |group: &Group| {
        format!(
            "{}: at least one of them is there with probability {}, but these data cannot tell which.",
            list(&group.members),
            probability(group.pip)
        )
    };
    calibration.groups.iter().map(sentence).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{fixture, view};

    #[test]
    fn effects_that_stand_for_each_other_are_named_together() {
        let mut calibration = fixture::two_joints();
        assert_eq!(either_or(&calibration), Vec::<String>::new());
        calibration.groups.push(Group {
            members: vec!["elbow.spring".into(), "elbow.potential".into()],
            pip: 0.98,
        });
        let open = either_or(&calibration);
        assert!(
            open.len() == 1 && open[0].contains("elbow.potential") && open[0].contains("0.98"),
            "{open:?}"
        );
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
