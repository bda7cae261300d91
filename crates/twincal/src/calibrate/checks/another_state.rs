//! A held-out log whose intervals hold far less than they promise on motion that training had: another robot, or another state of it.

use crate::error::{Code, Finding, Severity};
use crate::validate::Scores;

/// Share of the rows within 95 % intervals below which no noise is the reason.
const LEVEL: f64 = 0.70;
/// Standard deviations by which it is below that: one in twenty joints whose true share is 0.70; of joints that hold 95 %, fewer than one in 10⁵
/// with five independent rows or more.
const CLEAR: f64 = 1.645;
/// Independent rows below which nothing is said. What is left of a log in another state lasts as long as the log: by that it counts for so many.
const FEWEST: f64 = 5.0;

/// Of the moving rows of log `log` within the training motion; of each joint so many rows count as one by the `noise`, and by the
/// `residual` of this log, which lasts longer where the library lacks something that comes back with the motion.
pub(in crate::calibrate) fn finding(
    log: &str,
    within: &Scores,
    (noise, residual): (&[f64], &[f64]),
) -> Option<Finding> {
    let joints = within.joints.iter().zip(noise.iter().zip(residual));
    let mut least = 1.0_f64;
    let low: Vec<String> = joints
        .filter(|(score, (noise, residual))| {
            let rows = score.rows as f64;
            let independent = (rows / **noise).min((rows / **residual).max(FEWEST));
            let sd = (LEVEL * (1.0 - LEVEL) / independent).sqrt();
            independent >= FEWEST && score.coverage95 + CLEAR * sd < LEVEL
        })
        .map(|(score, _)| {
            least = least.min(score.coverage95);
            format!(
                "{:.0} % of joint `{}`",
                100.0 * score.coverage95,
                score.joint
            )
        })
        .collect();
    let all = low.join(", ");
    (!low.is_empty()).then(|| {
        Finding::new(
            Severity::Warning,
            Code::AnotherState,
            log,
            format!(
                "log `{log}`: on motion that training had the 95 % intervals hold {all}, clearly less than {:.0} %: is it another robot, or \
                 another state of it (payload, friction, temperature, gravity)? fit a log of that state too, or hold out another one",
                100.0 * LEVEL
            ),
            low.len() as u64,
        )
        .with([("coverage95", least), ("level", LEVEL)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::JointTorque;
    use crate::validate::ScoreKeeper;

    /// Scores of a joint with so many rows, a share of which is inside.
    fn scores(rows: usize, inside: f64) -> Scores {
        let mut keeper = ScoreKeeper::new(["a"]);
        let zeros = || vec![0.0; rows];
        let torque = JointTorque {
            low: vec![-1.0; rows],
            high: vec![1.0; rows],
            nominal: zeros(),
            calibrated: zeros(),
            epistemic: zeros(),
            noise: zeros(),
            pit: zeros(),
            log_density: zeros(),
            extrapolating: vec![false; rows],
            new_motion: vec![false; rows],
        };
        let first_outside = (inside * rows as f64).round() as usize;
        let outside = |row: usize| f64::from(u8::from(row >= first_outside));
        let measured: Vec<f64> = (0..rows).map(|row| 2.0 * outside(row)).collect();
        keeper.push(0, &measured, &torque);
        keeper.scores()
    }

    #[test]
    fn shares_clearly_below_seventy_percent_are_told_by_independent_rows() {
        let says =
            |rows, memory, inside| finding("run", &scores(rows, inside), (&[memory], &[1.0]));
        let told = says(200, 2.0, 0.55).expect("15 points below with an sd of 4.6");
        assert_eq!((told.subject.as_str(), told.count), ("run", 1));
        assert!(told.message.contains("55 % of joint `a`"), "{told:?}");
        assert!(told.forbids_yes());
        // The same share of rows that are hardly independent, of few rows, and shares nearer to 70 %.
        assert!(says(200, 40.0, 0.55).is_none() && says(20, 2.0, 0.55).is_none());
        assert!(says(200, 2.0, 0.65).is_none() && says(200, 2.0, 0.93).is_none());
        assert!(says(0, 2.0, 0.5).is_none());
        // What is left lasts for 20 rows: ten independent ones, an sd of 14 points.
        let lasting = |inside| finding("run", &scores(200, inside), (&[2.0], &[20.0]));
        assert!(lasting(0.55).is_none() && lasting(0.4).is_some());
        // It does not change at all: five, an sd of 20 points.
        let staying = |inside| finding("run", &scores(200, inside), (&[2.0], &[1999.0]));
        assert!(staying(0.4).is_none() && staying(0.3).is_some());
    }
}
