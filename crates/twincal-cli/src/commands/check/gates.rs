//! The gates of `check` on each joint's error and intervals.

use serde::Serialize;
use twincal::Code;
use twincal::assess::{Claim, Subject};
use twincal::likelihood::JointNoise;
use twincal::validate::{JointScore, Split, Validation};
use twincal::words::significant;
use twincal_io::config::Gates;
use twincal_io::twin_json::StoredTwin;
use twincal_io::words::percent;

/// Rows that count as independent, below which a joint's error says nothing.
pub(super) const ENOUGH: f64 = 10.0;

/// One gate of one joint.
#[derive(Serialize)]
pub(super) struct Gate {
    /// `moving`, or `all` where the joint does not move, here or in the twin's own scores.
    pub(super) rows: &'static str,
    pub(super) joint: String,
    pub(super) gate: &'static str,
    /// What it means where it does not hold.
    #[serde(skip)]
    pub(super) code: Code,
    pub(super) passed: bool,
    pub(super) value: f64,
    pub(super) limit: [Option<f64>; 2],
    pub(super) words: String,
    /// False where so few rows count as independent that a failure says nothing.
    #[serde(skip)]
    pub(super) enough: bool,
}

impl Gate {
    /// What is claimed where it does not hold; nothing of too few rows.
    pub(super) fn claim(&self) -> Option<Claim> {
        let subject = match self.code {
            Code::PayloadChanged => Subject::Run,
            _ => Subject::Joint(self.joint.clone()),
        };
        let limit = self.limit.map(|limit| limit.unwrap_or(f64::NAN));
        let fails = !self.passed && self.enough;
        fails.then(|| Claim::of_gate(self.code, subject, self.value, limit))
    }
}

/// Rows of joints that move.
pub(super) const MOVING: &str = "moving";
/// All rows.
pub(super) const ALL: &str = "all";

/// What the gates are for.
pub(super) struct Own<'a> {
    /// The twin's own scores.
    pub(super) scores: &'a Validation,
    pub(super) noise: &'a [JointNoise],
    pub(super) gates: Gates,
    /// The logs are those of the fit.
    pub(super) fitted: bool,
}

impl<'a> Own<'a> {
    pub(super) fn of(stored: &'a StoredTwin, gates: Gates, fitted: bool) -> Self {
        Self {
            scores: &stored.calibration.validation,
            noise: &stored.calibration.twin.noise,
            gates,
            fitted,
        }
    }

    /// Largest error that the twin has on logs of its own robot, N·m, and where: on what was held out, or on the rows of its fit where those are harder.
    /// `rows` of the fit's own rows may hold all of its error.
    fn error(&self, joint: usize, held_out: f64, rows: u64) -> (f64, &'static str) {
        let noise = &self.noise[joint];
        let all = match self.fitted {
            true => (noise.n / rows as f64).max(1.0).sqrt(),
            false => 1.0,
        };
        match all * noise.sigma.max(noise.training_rmse) {
            own if own > held_out => (own, "of the twin on the rows of its fit"),
            _ => (held_out, own_rows(&self.scores.split)),
        }
    }
}

/// Two gates per joint: on rows in which it moves, where there are some here and in the twin's own scores. What holds a joint at rest no
/// friction tells, and how long it rests is another thing in every log. Intervals of rows that were fitted are not judged: they say nothing of a change.
pub(super) fn judge(scores: &Validation, own: &Own<'_>) -> Vec<Gate> {
    let mut gates = Vec::new();
    let stored = own.scores;
    let all = scores.filtered.joints.iter().zip(&stored.filtered.joints);
    let moving = scores.moving.joints.iter().zip(&stored.moving.joints);
    for (number, (all, moving)) in all.zip(moving).enumerate() {
        let ((joint, stored), rows, which) = match moving {
            (joint, stored) if joint.rows > 0 && stored.rows > 0 => (moving, "moving rows", MOVING),
            _ => (all, "rows", ALL),
        };
        let judged = Judged {
            joint,
            rows,
            which,
            enough: joint.rows as f64 / own.noise[number].memory() >= ENOUGH,
        };
        let error = own.error(number, stored.rmse_calibrated, joint.rows);
        gates.push(judged.error_gate(own.gates.rmse_ratio, error));
        gates.push(judged.coverage_gate(match own.fitted {
            true => [0.0, 1.0],
            false => own.gates.coverage_of(stored.coverage95),
        }));
    }
    gates
}

/// Rows of a joint that are judged.
struct Judged<'a> {
    joint: &'a JointScore,
    /// What they are called in sentences.
    rows: &'static str,
    /// See [`Gate::rows`].
    which: &'static str,
    /// See [`Gate::enough`].
    enough: bool,
}

impl Judged<'_> {
    /// The error is at most `ratio` times the one that the twin has itself, N·m, of which is said where.
    fn error_gate(&self, ratio: f64, (error, whose): (f64, &str)) -> Gate {
        let limit = ratio * error;
        let (rmse, name, rows) = (self.joint.rmse_calibrated, &self.joint.joint, self.rows);
        Gate {
            rows: self.which,
            joint: name.clone(),
            gate: "rmse",
            code: Code::ErrorAboveGate,
            // Without rows, or without a stored score, nothing was shown: not a pass.
            passed: rmse <= limit,
            value: rmse,
            limit: [None, Some(limit)],
            words: format!(
                "joint `{name}`: RMSE {} of {rows} is {} the gate {} ({ratio} × {} {whose})",
                significant(rmse, 4),
                if rmse <= limit { "within" } else { "above" },
                significant(limit, 4),
                significant(error, 4),
            ),
            enough: self.enough,
        }
    }

    /// The 95 % interval holds a share of the rows between two limits.
    fn coverage_gate(&self, [low, high]: [f64; 2]) -> Gate {
        let (joint, name, rows) = (self.joint, &self.joint.joint, self.rows);
        let cautious = if joint.coverage95 > high {
            ": wider than these rows need; where that does no harm, say [check] coverage with 1 at the top"
        } else {
            ""
        };
        Gate {
            rows: self.which,
            joint: name.clone(),
            gate: "coverage",
            code: Code::CoverageOutsideGate,
            passed: low <= joint.coverage95 && joint.coverage95 <= high,
            value: joint.coverage95,
            limit: [Some(low), Some(high)],
            words: format!(
                "joint `{name}`: the 95 % interval holds {} of the {rows}, the gate is {} to {}{cautious}",
                percent(joint.coverage95),
                percent(low),
                percent(high)
            ),
            enough: self.enough,
        }
    }
}

/// Which rows the twin's own error was measured on.
fn own_rows(split: &Split) -> &'static str {
    match split {
        Split::HeldoutLogs => "of the twin on its held-out logs",
        Split::LeaveOneLogOut => "of the twin on its logs, each left out in turn",
        Split::LeaveLogGroupsOut => "of the twin on its logs, left out in five groups",
        Split::LastThirty => "of the twin on the last 30 % of each of its logs",
        Split::NotTested => "of the twin, which was never tested",
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use twincal::validate::{HeldOut, Scores};

    /// One joint with this error and coverage while it moves.
    pub(in super::super) fn scores(rmse: f64, coverage: f64) -> Validation {
        let joint = JointScore {
            joint: "elbow".into(),
            rows: 10,
            rmse_nominal: 1.0,
            rmse_calibrated: rmse,
            bias: 0.0,
            coverage95: coverage,
            mean_width95: 0.4,
            torque_sd: 5.0,
            interval_score95: 0.5,
            epistemic_sd: 0.01,
            noise_sd: 0.1,
            epistemic_share: 0.01,
            rmse_friction: None,
        };
        let moving = Scores {
            rmse_nominal: 1.0,
            rmse_calibrated: rmse,
            coverage95: coverage,
            interval_score95: 0.5,
            epistemic_share: 0.01,
            joints: vec![joint],
        };
        // At rest it is far off, which no gate is for.
        let mut filtered = moving.clone();
        filtered.joints[0].rmse_calibrated = 9.0;
        filtered.joints[0].coverage95 = 0.1;
        Validation {
            filtered,
            moving,
            ..HeldOut::new(vec!["elbow"]).finish(Split::HeldoutLogs)
        }
    }

    /// With a twin whose noise has an sd of 0.05 on 90 rows.
    fn judged(scores: &Validation, own: &Validation, gates: Gates, fitted: bool) -> Vec<Gate> {
        judged_by(&noise(), scores, own, gates, fitted)
    }

    fn noise() -> JointNoise {
        JointNoise {
            joint: "elbow".into(),
            sigma: 0.05,
            training_rmse: 0.04,
            rho: 0.0,
            weight: 1.0,
            n: 90.0,
            n_eff: 90.0,
            autocorrelation_time: 1.0,
            misfit: 1.0,
            interval_factor: 1.0,
            out_of_band: 0.0,
            spread: twincal::likelihood::Spread::default(),
        }
    }

    fn judged_by(
        noise: &JointNoise,
        scores: &Validation,
        own: &Validation,
        gates: Gates,
        fitted: bool,
    ) -> Vec<Gate> {
        let own = Own {
            scores: own,
            noise: std::slice::from_ref(noise),
            gates,
            fitted,
        };
        judge(scores, &own)
    }

    #[test]
    fn a_joint_that_does_not_move_is_judged_by_all_of_its_rows() {
        let mut still = scores(0.1, 0.95);
        still.moving.joints[0].rows = 0;
        let gates = Gates::default();
        let judged = judged(&still, &scores(0.1, 0.95), gates, false);
        assert!(judged.iter().all(|gate| gate.rows == ALL));
        let values: Vec<f64> = judged.iter().map(|gate| gate.value).collect();
        assert_eq!(values, [9.0, 0.1]);
        assert!(judged[1].words.contains("10.0\u{202f}% of the rows"));
    }

    #[test]
    fn the_error_of_few_independent_rows_is_that_of_the_posterior_mean() {
        let mut noise = noise();
        for (sigma, rmse, limit) in [(0.05, 0.2, 0.24), (0.2, 0.05, 0.24), (0.05, 0.05, 0.12)] {
            (noise.sigma, noise.training_rmse) = (sigma, rmse);
            let gates = judged_by(
                &noise,
                &scores(0.1, 0.95),
                &scores(0.1, 0.95),
                Gates::default(),
                false,
            );
            let at = gates[0].limit[1].unwrap();
            assert!((at - limit).abs() < 1e-12, "{at} instead of {limit}");
        }
    }

    #[test]
    fn gates_stand_at_their_limits() {
        let gates = Gates {
            rmse_ratio: 1.2,
            coverage: Some([0.9, 0.99]),
        };
        let passed = |rmse: f64, coverage: f64| -> Vec<bool> {
            judged(&scores(rmse, coverage), &scores(0.1, 0.95), gates, false)
                .iter()
                .map(|gate| gate.passed)
                .collect()
        };
        let words = |rmse: f64, fitted: bool| {
            judged(&scores(rmse, 0.95), &scores(0.1, 0.95), gates, fitted)
                .swap_remove(0)
                .words
        };
        assert_eq!(
            words(0.1199, false),
            "joint `elbow`: RMSE 0.1199 of moving rows is within the gate 0.1200 (1.2 × 0.1000 of the twin on its held-out logs)"
        );
        assert_eq!(
            words(0.1201, false),
            "joint `elbow`: RMSE 0.1201 of moving rows is above the gate 0.1200 (1.2 × 0.1000 of the twin on its held-out logs)"
        );
        // 10 of the 90 rows that were fitted may hold all of their error: 0.05 × √9.
        assert_eq!(
            words(0.1799, true),
            "joint `elbow`: RMSE 0.1799 of moving rows is within the gate 0.1800 (1.2 × 0.1500 of the twin on the rows of its fit)"
        );
        assert_eq!(passed(0.1199, 0.95), [true, true]);
        assert_eq!(passed(0.1201, 0.95), [false, true]);
        assert_eq!(passed(0.1, 0.90), [true, true]);
        assert_eq!(passed(0.1, 0.899), [true, false]);
        assert_eq!(passed(0.1, 0.991), [true, false]);
        assert_eq!(passed(f64::NAN, f64::NAN), [false, false]);
    }

    /// Intervals that held 86 % of the twin's held-out rows may hold 82 % of others, and of 70 % 65 %, unless a limit is stated.
    #[test]
    fn intervals_that_were_narrow_from_the_start_are_no_change() {
        let passed = |coverage: f64, own: f64, stated: Option<[f64; 2]>| {
            let gates = Gates {
                coverage: stated,
                ..Gates::default()
            };
            judged(&scores(0.1, coverage), &scores(0.1, own), gates, false)[1].passed
        };
        assert!(passed(0.821, 0.86, None) && !passed(0.819, 0.86, None));
        assert!(passed(0.651, 0.70, None) && !passed(0.649, 0.70, None));
        assert!(passed(0.0, 0.02, None) && !passed(0.899, f64::NAN, None));
        assert!(passed(0.901, 0.99, None) && !passed(0.899, 0.99, None));
        assert!(!passed(0.821, 0.86, Some([0.9, 1.0])));
    }
}
