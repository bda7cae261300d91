//! What a user says of a log's channels: torque that comes later than the motion, a velocity that is not to be used.

use super::pieces::Values;
use super::spline::resample;
use crate::error::{Error, Result};
use crate::robot::did_you_mean;
use crate::signal::log::joints::JointFacts;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;

/// Largest lag that is believed, s.
const LARGEST: f64 = 1.0;

/// What a velocity that is noisy, or an acceleration that is not logged, is derived from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DerivedFrom {
    /// Position.
    Position,
    /// Logged velocity.
    Velocity,
}

/// How much later than the motion torque is logged.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lag {
    /// Nothing was said: estimated from the training logs, and applied where it is clear.
    #[default]
    Unsaid,
    /// Of every joint, s; negative where torque comes first.
    All(f64),
    /// By joint name, s; none for the others.
    Joints(BTreeMap<String, f64>),
}

/// What is put right in every log before anything else.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Corrections {
    /// Torque is moved back by this.
    pub lag: Lag,
    /// Where velocity comes from, if that was said: the log, or the change of position whatever is logged. Else per joint what leaves less
    /// noise ([`Pipeline::velocity_from`](crate::signal::Pipeline::velocity_from)).
    #[serde(alias = "velocity_from_position", deserialize_with = "source")]
    pub velocity: Option<DerivedFrom>,
}

/// Twins of earlier versions hold `velocity_from_position`, true or false.
fn source<'de, D: Deserializer<'de>>(
    from: D,
) -> std::result::Result<Option<DerivedFrom>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Said {
        FromPosition(bool),
        Source(Option<DerivedFrom>),
    }
    Ok(match Said::deserialize(from)? {
        Said::FromPosition(said) => said.then_some(DerivedFrom::Position),
        Said::Source(source) => source,
    })
}

impl Corrections {
    /// True if nothing is put right and nothing was said.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Lag of a joint, s.
    pub(crate) fn lag_of(&self, joint: &str) -> f64 {
        match &self.lag {
            Lag::Unsaid => 0.0,
            Lag::All(lag) => *lag,
            Lag::Joints(joints) => joints.get(joint).copied().unwrap_or(0.0),
        }
    }

    /// Refuses lags of joints that do not move, lags that are no lags, and corrections without a filter.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub(crate) fn check(&self, joints: &[JointFacts], off: bool) -> Result<()> {
        let setting = |key: &str, problem: String, remedy: String| {
            Err(Error::Setting {
                key: key.into(),
                problem,
                remedy,
            })
        };
        let lags: Vec<(String, f64)> = match &self.lag {
            Lag::Unsaid => Vec::new(),
            Lag::All(lag) => vec![("signal.lag".into(), *lag)],
            Lag::Joints(of) => {
                for joint in of.keys() {
                    if !joints.iter().any(|facts| facts.name == *joint) {
                        return setting(
                            "signal.lag",
                            format!("joint `{joint}` does not move in the model"),
                            did_you_mean(joint, joints.iter().map(|facts| facts.name.as_str())),
                        );
                    }
                }
                let of = of.iter();
                of.map(|(joint, lag)| (format!("signal.lag.{joint}"), *lag))
                    .collect()
            }
        };
        for (key, lag) in &lags {
            if lag.is_nan() || lag.abs() > LARGEST {
                let problem = format!("{lag} s is out of range");
                return setting(
                    key,
                    problem,
                    format!("give seconds between -{LARGEST} and {LARGEST}"),
                );
            }
        }
        let filter = "leave cutoff_hz at \"auto\", or give channels that need no correction";
        if off && lags.iter().any(|(_, lag)| *lag != 0.0) {
            let problem = "with cutoff_hz = 0 every row stays as logged, so torque cannot be moved";
            return setting("signal.lag", problem.into(), filter.into());
        }
        if off && self.velocity == Some(DerivedFrom::Position) {
            let problem = "with cutoff_hz = 0 nothing is derived from position";
            return setting("signal.velocity", problem.into(), filter.into());
        }
        Ok(())
    }

    /// Whether the torque of any of these joints has to move.
    pub(crate) fn moves(&self, joints: &[JointFacts]) -> bool {
        joints.iter().any(|facts| self.lag_of(&facts.name) != 0.0)
    }

    /// Moves the torques of a run back by their lags: `tau(t) = logged(t + lag)` at the stamps of `grid`. Returns the part of
    /// the grid for which every torque was logged.
    ///
    /// # Panics
    /// With fewer than four stamps.
    pub(crate) fn move_torque(
        &self,
        joints: &[JointFacts],
        stamps: &[f64],
        logged: &[Values<'_>],
        grid: &[f64],
        moved: &mut [Values<'_>],
    ) -> Range<usize> {
        let lags: Vec<f64> = joints.iter().map(|j| self.lag_of(&j.name)).collect();
        let (least, most) = lags
            .iter()
            .fold((0.0_f64, 0.0_f64), |(l, m), lag| (l.min(*lag), m.max(*lag)));
        let (first, last) = (stamps[0], stamps[stamps.len() - 1]);
        let from = grid.partition_point(|t| t + least < first);
        let to = grid.partition_point(|t| t + most <= last).max(from);
        for ((lag, logged), moved) in lags.iter().zip(logged).zip(moved) {
            let (Some(values), Some(tau)) = (&logged.tau, &mut moved.tau) else {
                continue;
            };
            if *lag != 0.0 {
                let at: Vec<f64> = grid[from..to].iter().map(|t| t + lag).collect();
                tau.to_mut()[from..to].copy_from_slice(&resample(stamps, values, &at));
            }
        }
        from..to
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::JointKind;

    #[test]
    fn torque_moves_back_by_its_lag_and_the_grid_loses_what_was_not_logged() {
        let facts = [("a", 0.025), ("b", 0.0)].map(|(name, _)| JointFacts {
            name: name.into(),
            kind: JointKind::Revolute,
            range: None,
            effort: None,
        });
        let stamps: Vec<f64> = (0..100).map(|i| 0.01 * f64::from(i)).collect();
        // a cubic passes through the spline exactly
        let cubic = |t: f64| 3.0 - t + 2.0 * t * t * t;
        let channels = |lag: f64| Values {
            q: vec![0.0; 100].into(),
            qd: None,
            qdd: None,
            tau: Some(stamps.iter().map(|t| cubic(t - lag)).collect()),
        };
        let logged = [channels(0.025), channels(0.0)];
        let mut moved = logged.clone();
        let corrections = Corrections {
            lag: Lag::Joints(BTreeMap::from([("a".into(), 0.025)])),
            velocity: None,
        };
        corrections.check(&facts, false).unwrap();
        let kept = corrections.move_torque(&facts, &stamps, &logged, &stamps, &mut moved);
        assert_eq!(kept, 0..97);
        for joint in &moved {
            for (i, t) in stamps[..97].iter().enumerate() {
                assert!((joint.tau.as_ref().unwrap()[i] - cubic(*t)).abs() < 1e-12);
            }
        }
        assert!(corrections.check(&facts, true).is_err());
        assert!(corrections.check(&facts[1..], false).is_err());
        assert!(corrections.moves(&facts) && !corrections.moves(&facts[1..]));
    }

    #[test]
    fn where_velocity_comes_from_is_read_of_earlier_twins_too() {
        let read = |text: &str| {
            serde_json::from_str::<Corrections>(text)
                .map(|c| c.velocity)
                .ok()
        };
        let position = Some(DerivedFrom::Position);
        assert_eq!(read(r#"{"velocity_from_position":true}"#), Some(position));
        assert_eq!(read(r#"{"velocity_from_position":false}"#), Some(None));
        assert_eq!(read("{}"), Some(None));
        for velocity in [None, position, Some(DerivedFrom::Velocity)] {
            let lag = Lag::All(0.01);
            let text = serde_json::to_string(&Corrections { lag, velocity }).unwrap_or_default();
            assert_eq!(read(&text), Some(velocity), "{text}");
        }
    }
}
