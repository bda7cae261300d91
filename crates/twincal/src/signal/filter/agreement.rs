//! Is the logged velocity the derivative of the logged position (case 24)?

use super::trajectory::Trajectory;
use crate::error::{Code, Finding, Severity};
use serde::{Deserialize, Serialize};

/// Share of the velocity's power that the derivative of position must explain.
const AGREES: f64 = 0.95;
/// Fewest samples that say anything.
const FEWEST: usize = 100;

/// How the velocity of a joint and the derivative of its position go together, over one log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Agreement {
    /// `R² = 1 − Σ(q̇ − dq/dt)² / Σ(dq/dt)²`; 1 where they are the same, below 0 where 0 would be nearer.
    pub r2: f64,
    /// Slope of the velocity over the derivative.
    pub slope: f64,
}

impl Agreement {
    /// True where the velocity is minus the derivative: R² of −q̇ is `1 − Σ(q̇ + dq/dt)² / Σ(dq/dt)²` = R² − 4 · slope.
    #[must_use]
    pub fn is_opposite(self) -> bool {
        self.r2 - 4.0 * self.slope >= AGREES
    }
}

/// Agreement of each joint; `None` for joints that hardly move. Both are the motion filter's, so that the encoder's noise
/// does not count; where no velocity is logged they agree.
pub fn velocity_agreement(trajectory: &Trajectory, standstill: &[f64]) -> Vec<Option<Agreement>> {
    (0..trajectory.dof)
        .map(|joint| {
            let (mut samples, mut wrong, mut dd, mut dv) = (0_usize, 0.0, 0.0, 0.0);
            for segment in &trajectory.segments {
                let len = segment.time.len();
                let own = joint * len..(joint + 1) * len;
                let (q, qd) = (&segment.q[own.clone()], &segment.qd[own]);
                for i in 1..len.saturating_sub(1) {
                    let derivative = (q[i + 1] - q[i - 1]) / (2.0 * segment.interval);
                    wrong += (qd[i] - derivative).powi(2);
                    dd += derivative * derivative;
                    dv += derivative * qd[i];
                    samples += 1;
                }
            }
            let least = standstill.get(joint).copied().unwrap_or(0.0);
            let moves = samples >= FEWEST && dd > samples as f64 * least * least && dd > 0.0;
            moves.then(|| Agreement {
                r2: 1.0 - wrong / dd,
                slope: dv / dd,
            })
        })
        .collect()
}

/// A warning for every joint whose velocity does not belong to its position.
pub(crate) fn findings(names: &[&str], log: &str, agreement: &[Option<Agreement>]) -> Vec<Finding> {
    let wrong = names.iter().zip(agreement);
    wrong
        .filter_map(|(name, agreement)| Some((name, agreement.filter(|a| a.r2 < AGREES)?)))
        .map(|(name, agreement)| {
            let Agreement { r2, slope } = agreement;
            if agreement.is_opposite() {
                let message = format!(
                    "joint `{name}` of {log}: the logged velocity is the change of position with the opposite sign (slope {slope:.3}): the sign \
                     of one of the two is reversed; give that one the factor -1 in [columns.factor]: q or qd = {{ {name:?} = -1.0 }}"
                );
                return Finding::new(Severity::Warning, Code::VelocityOpposite, *name, message, 0)
                    .with([("slope", slope)]);
            }
            let message = format!(
                "joint `{name}`: the logged velocity is not the change of position (R² {r2:.3}, slope {slope:.3}): scaled, \
                 late or of another joint; with [signal] velocity = \"position\" it is not used"
            );
            Finding::new(Severity::Warning, Code::VelocityMismatch, log, message, 0)
                .of_joint(*name)
                .with([("r2", r2), ("slope", slope)])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::filter::trajectory::Segment;
    use crate::signal::log::recording::Payload;

    /// q = sin(2t), and a velocity.
    fn agreement(velocity: impl Fn(f64) -> f64) -> Agreement {
        let time: Vec<f64> = (0..3142).map(|i| 0.002 * f64::from(i)).collect();
        let segment = Segment {
            input_rows: Vec::new(),
            logged: None,
            q: time.iter().map(|t| (2.0 * t).sin()).collect(),
            qd: time.iter().map(|t| velocity(*t)).collect(),
            qdd: vec![0.0; time.len()],
            tau: Vec::new(),
            standstill: vec![false; time.len()],
            history: Vec::new(),
            interval: 0.002,
            logged_interval: 0.002,
            time,
        };
        let trajectory = Trajectory {
            name: "run".into(),
            dof: 1,
            segments: vec![segment],
            payload: Payload::None,
            payload_acts: true,
        };
        velocity_agreement(&trajectory, &[0.02])[0].unwrap()
    }

    /// Over two periods: a velocity of slope s has R² = 1 − (1 − s)²; one that is late by a phase φ has
    /// R² = 1 − 2(1 − cos φ) and slope cos φ.
    #[test]
    fn case_24_r2_and_slope_are_those_of_the_closed_form() {
        let near = |a: Agreement, r2: f64, slope: f64| {
            assert!(
                (a.r2 - r2).abs() < 1e-3 && (a.slope - slope).abs() < 1e-3,
                "{a:?}"
            );
        };
        near(agreement(|t| 2.0 * (2.0 * t).cos()), 1.0, 1.0);
        near(agreement(|t| 0.5 * 2.0 * (2.0 * t).cos()), 0.75, 0.5);
        let turned = agreement(|t| -2.0 * (2.0 * t).cos());
        near(turned, -3.0, -1.0);
        assert!(turned.is_opposite() && !agreement(|t| -(2.0 * t).cos()).is_opposite());
        let late = agreement(|t| 2.0 * (2.0 * t - 0.5).cos());
        near(late, 1.0 - 2.0 * (1.0 - 0.5_f64.cos()), 0.5_f64.cos());
        assert_eq!(findings(&["a"], "run", &[Some(late)]).len(), 1);
        let same = agreement(|t| 2.0 * (2.0 * t).cos());
        assert!(findings(&["a"], "run", &[Some(same)]).is_empty());
    }
}
