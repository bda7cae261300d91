//! The calibrated twin: torque with intervals for any motion (method section 8).

use crate::likelihood::JointNoise;
use crate::posterior::Posterior;
use crate::robot::Robot;
use crate::signal::Pipeline;
use crate::term::LibrarySettings;
use serde::{Deserialize, Serialize};

/// Robot + terms + posterior. Everything a prediction needs, nothing else; this is what `twin.json` holds.
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
    /// Epistemic sd (from β and z).
    pub epistemic: Vec<f64>,
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
