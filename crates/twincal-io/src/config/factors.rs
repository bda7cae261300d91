//! `[columns] factor`: what logged numbers are multiplied with, where they have another unit or sign than the model.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The factor of one channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected a number, or numbers by joint such as { elbow = -1.0 }"
)]
pub enum Factor {
    /// Of all joints.
    All(f64),
    /// By joint name; 1 for others.
    ByJoint(BTreeMap<String, f64>),
}

impl Default for Factor {
    fn default() -> Self {
        Self::ByJoint(BTreeMap::new())
    }
}

impl Factor {
    /// That of a joint, if one was said.
    pub fn of_joint(&self, joint: &str) -> Option<f64> {
        match self {
            Self::All(factor) => Some(*factor),
            Self::ByJoint(factors) => factors.get(joint).copied(),
        }
    }

    /// Whether nothing is said.
    pub fn is_empty(&self) -> bool {
        matches!(self, Self::ByJoint(factors) if factors.is_empty())
    }
}

/// `[columns] factor`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(
    default,
    expecting = "expected factors by channel such as { tau = { elbow = -1.0 } }"
)]
#[schemars(deny_unknown_fields)]
pub struct FactorTable {
    /// Of positions: one number, or { joint = number }. 0.017453292519943295 makes radians of degrees, -1 turns the sign.
    #[serde(skip_serializing_if = "Factor::is_empty")]
    pub q: Factor,
    /// Of velocities.
    #[serde(skip_serializing_if = "Factor::is_empty")]
    pub qd: Factor,
    /// Of accelerations.
    #[serde(skip_serializing_if = "Factor::is_empty")]
    pub qdd: Factor,
    /// Of torques, before gear_ratio and drive_constant.
    #[serde(skip_serializing_if = "Factor::is_empty")]
    pub tau: Factor,
}

impl FactorTable {
    /// The channels' keys and factors.
    pub fn channels(&self) -> [(&'static str, &Factor); 4] {
        [
            ("q", &self.q),
            ("qd", &self.qd),
            ("qdd", &self.qdd),
            ("tau", &self.tau),
        ]
    }

    /// Whether nothing is said.
    pub fn is_empty(&self) -> bool {
        self.channels().iter().all(|(_, factor)| factor.is_empty())
    }
}
