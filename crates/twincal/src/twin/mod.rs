//! The calibrated twin: torque with intervals for any motion (method section 8).

mod components;
mod consistency;
mod kernel;
mod predictor;
mod torque;
#[cfg(test)]
mod tests;

pub use predictor::{JointInput, JointSetting, Predictor};
pub use torque::{Torque, TorqueModel};

use predictor::widened;

use crate::error::{Error, Finding, Result};
use crate::likelihood::JointNoise;
use crate::posterior::Posterior;
use crate::robot::{JointKind, Robot};
use crate::signal::{Payload, Pipeline, Recording, Trajectory, align_part};
use crate::term::{Family, Library, LibrarySettings};
use serde::{Deserialize, Serialize};

/// Robot + terms + posterior. Everything a prediction needs, nothing else; this is what `twin.json` holds.
///
/// # Example
/// A twin is the same after it was written and read, to the last bit.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::prelude::*;
///
/// # let fit = two_link::study()?;
/// let text = serde_json::to_string(fit.twin())?;
/// let again: Twin = serde_json::from_str(&text)?;
/// assert_eq!(&again, fit.twin());
/// assert_eq!(again.robot.joint_names(), ["shoulder", "elbow"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Twin {
    /// The nominal robot.
    pub robot: Robot,
    /// Settings from which the library is proposed again (deterministic).
    pub library: LibrarySettings,
    /// Columns of the proposed library that were zero on the training data.
    pub zero_columns: Vec<usize>,
    /// Filters and rates as used.
    pub pipeline: Pipeline,
    /// Posterior over the live columns.
    pub posterior: Posterior,
    /// Noise per joint.
    pub noise: Vec<JointNoise>,
    /// Range of the training motion per joint: `[q_min, q_max, qd_min, qd_max, qdd_min, qdd_max]`.
    pub hull: Vec<[f64; 6]>,
    /// The payload component acts only in logs that say they carry something unknown.
    #[serde(default)]
    pub payload_where_unknown: bool,
}

/// Torque of one joint over a batch of samples, with the central 95 % interval.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointTorque {
    /// Nominal, N·m.
    pub nominal: Vec<f64>,
    /// Calibrated: nominal + Φ E[β | y].
    pub calibrated: Vec<f64>,
    /// Lower end of the 95 % interval.
    pub low: Vec<f64>,
    /// Upper end.
    pub high: Vec<f64>,
    /// Epistemic sd of the torque (from β and z), N·m.
    pub epistemic: Vec<f64>,
    /// The row lies outside the data: position, velocity or acceleration of the joint is outside the training range by
    /// more than 5 % of it, or the epistemic variance exceeds that of the noise.
    pub extrapolating: Vec<bool>,
    /// The motion is why: position, velocity or acceleration of the joint is outside the training range by more than 5 % of it.
    pub new_motion: Vec<bool>,
    /// Probability that the predictive distribution gives to torques up to the measured one; empty without measurement.
    /// On rows that stand still the measured torque first moves by up to ± the Coulomb coefficient towards the median, so
    /// that `|pit − ½| ≤ 0.475` is the same as lying inside `low … high`.
    pub pit: Vec<f64>,
    /// ln of the predictive density at the measured torque, nats per (N·m); empty without measurement. On rows that stand
    /// still it is that at the torque that `pit` speaks of, which is no density of the measured one: score moving rows.
    pub log_density: Vec<f64>,
    /// sd of the noise part, N·m: √E(scale²) of what the coefficients do not explain.
    pub noise: Vec<f64>,
}

impl JointTorque {
    /// Puts the rows of `other` behind its own.
    pub fn append(&mut self, other: Self) {
        self.nominal.extend(other.nominal);
        self.calibrated.extend(other.calibrated);
        self.low.extend(other.low);
        self.high.extend(other.high);
        self.epistemic.extend(other.epistemic);
        self.extrapolating.extend(other.extrapolating);
        self.new_motion.extend(other.new_motion);
        self.pit.extend(other.pit);
        self.log_density.extend(other.log_density);
        self.noise.extend(other.noise);
    }
}

/// Which torque an interval is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TorqueSignal {
    /// Torque low-passed like the training rows.
    Filtered,
    /// Torque as logged: the out-of-band variance is added.
    Raw,
}

impl Twin {
    /// A log as a trajectory for this twin: the filters it was fitted with, and its payload only where it was carried.
    ///
    /// # Errors
    /// Those of [`crate::signal::align`].
    pub fn align(&self, recording: &Recording) -> Result<(Trajectory, Vec<Finding>)> {
        self.align_part(recording, None)
    }

    /// The same of a part of a log whose first stamp is `start`, s.
    ///
    /// # Errors
    /// Those of [`crate::signal::align`].
    pub fn align_part(
        &self,
        recording: &Recording,
        start: Option<f64>,
    ) -> Result<(Trajectory, Vec<Finding>)> {
        let (mut trajectory, findings) = align_part(&self.robot, recording, start, &self.pipeline)?;
        trajectory.payload_acts =
            !self.payload_where_unknown || recording.payload == Payload::Unknown;
        Ok((trajectory, findings))
    }

    /// The library whose columns the posterior speaks of: proposed again from the settings, columns that were zero on the
    /// training data dropped.
    ///
    /// # Errors
    /// Those of [`Library::propose`], and [`Error::Setting`] with the key `twin` if the columns are not as many as the
    /// posterior's.
    pub fn library(&self) -> Result<Library> {
        let (proposed, _) = Library::propose(&self.robot, &self.library)?;
        let library = proposed.without_columns(&self.zero_columns);
        let (found, wanted) = (library.columns().len(), self.posterior.inclusion.len());
        if found != wanted {
            return Err(Error::Setting {
                key: "twin".into(),
                problem: format!("its library has {found} columns, its posterior {wanted}"),
                remedy: "the twin's file is damaged or from another version: fit again".into(),
            });
        }
        Ok(library)
    }

    /// Where a joint's motion is within the data: `[q_min, q_max, qd_min, qd_max, qdd_min, qdd_max]`, the training range with
    /// its margin; ±[`f64::MAX`] where any position is.
    ///
    /// # Panics
    /// If there is no such joint.
    ///
    /// # Example
    /// The shoulder was between −1 and 1 rad in the logs; within 5 % of this range beyond its ends a prediction is no extrapolation.
    /// ```
    /// # #[path = "../../examples/two_link.rs"] mod two_link;
    /// # let fit = two_link::study()?;
    /// let [low, high, ..] = fit.twin().limits(0);
    /// assert!((low + 1.1).abs() < 0.01 && (high - 1.1).abs() < 0.01);
    /// # Ok::<(), twincal::Error>(())
    /// ```
    #[must_use]
    pub fn limits(&self, joint: usize) -> [f64; 6] {
        let hull = reachable(self.hull[joint], self.robot.joint_kind(joint));
        let mut limits = widened(hull);
        if hull[0] == f64::MIN {
            (limits[0], limits[1]) = (f64::MIN, f64::MAX);
        }
        limits
    }

    /// Prepares predictions; `library` is that of [`Twin::library`].
    ///
    /// # Errors
    /// [`Error::Setting`] with the key `twin` if its parts do not fit each other (a damaged file).
    pub fn predictor(&self, library: &Library) -> Result<Predictor> {
        let names = self.robot.joint_names();
        if self.noise.len() != names.len() || self.hull.len() != names.len() {
            return Err(Error::Setting {
                key: "twin".into(),
                problem: format!(
                    "noise of {} and range of {} joints for {}",
                    self.noise.len(),
                    self.hull.len(),
                    names.len()
                ),
                remedy: "the twin's file is damaged or from another version: fit again".into(),
            });
        }
        if !self.pipeline.has_sound_history(names.len()) {
            return Err(Error::Setting {
                key: "twin".into(),
                problem: format!(
                    "what it follows of the history of {} joints is not consistent",
                    self.pipeline.history.len()
                ),
                remedy: "the twin's file is damaged or from another version: fit again".into(),
            });
        }
        let settings: Vec<JointSetting<'_>> = (0..names.len())
            .map(|joint| JointSetting {
                columns: library.columns_of_joint(joint),
                coulomb: coulomb_column(library, names[joint]),
                noise: &self.noise[joint],
                hull: reachable(self.hull[joint], self.robot.joint_kind(joint)),
            })
            .collect();
        Predictor::new(&self.posterior, &settings)
    }
}

/// The column of a joint's Coulomb friction, if it is a candidate.
fn coulomb_column(library: &Library, joint: &str) -> Option<usize> {
    let name = format!("{joint}.coulomb");
    library.columns().iter().position(|&index| {
        let term = &library.terms()[index];
        term.family == Family::Coulomb && term.name == name
    })
}

/// A joint without limits that went once around has been everywhere.
fn reachable(mut hull: [f64; 6], kind: JointKind) -> [f64; 6] {
    if kind == JointKind::Continuous && hull[1] - hull[0] >= std::f64::consts::TAU {
        (hull[0], hull[1]) = (f64::MIN, f64::MAX);
    }
    hull
}
