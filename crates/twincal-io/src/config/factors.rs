//! `[columns] factor`: what logged numbers are multiplied with, where they have another unit or sign than the model.

use super::{Config, PerJoint};
use crate::error::Result;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[columns] factor`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(
    default,
    expecting = "expected factors by channel such as { tau = { elbow = -1.0 } }"
)]
#[schemars(deny_unknown_fields)]
pub struct FactorTable {
    /// Of positions: one number, or { joint = number }. 0.017453292519943295 makes radians of degrees, -1 turns the sign.
    #[serde(skip_serializing_if = "PerJoint::is_empty")]
    pub q: PerJoint,
    /// Of velocities.
    #[serde(skip_serializing_if = "PerJoint::is_empty")]
    pub qd: PerJoint,
    /// Of accelerations.
    #[serde(skip_serializing_if = "PerJoint::is_empty")]
    pub qdd: PerJoint,
    /// Of torques, before gear_ratio and drive_constant.
    #[serde(skip_serializing_if = "PerJoint::is_empty")]
    pub tau: PerJoint,
}

impl FactorTable {
    /// The channels' keys and factors.
    pub fn channels(&self) -> [(&'static str, &PerJoint); 4] {
        [
            ("q", &self.q),
            ("qd", &self.qd),
            ("qdd", &self.qdd),
            ("tau", &self.tau),
        ]
    }

    /// Likewise, to be changed.
    pub(super) fn channels_mut(&mut self) -> [(&'static str, &mut PerJoint); 4] {
        [
            ("q", &mut self.q),
            ("qd", &mut self.qd),
            ("qdd", &mut self.qdd),
            ("tau", &mut self.tau),
        ]
    }

    /// Whether nothing is said.
    pub fn is_empty(&self) -> bool {
        self.channels().iter().all(|(_, factor)| factor.is_empty())
    }
}

impl Config {
    /// Refuses factors of `[columns] factor` that leave nothing of what was logged.
    ///
    /// # Errors
    /// [`crate::Error::Content`] at the number's place in the file.
    pub(super) fn check_factors(&self) -> Result<()> {
        for (channel, factor) in self.file.columns.factor.channels() {
            for (joint, number) in factor.numbers() {
                if number.is_finite() && number != 0.0 {
                    continue;
                }
                let (key, whose) = match joint {
                    Some(joint) => (
                        format!("columns.factor.{channel}.{joint}"),
                        format!("joint `{joint}`"),
                    ),
                    None => (format!("columns.factor.{channel}"), "all joints".into()),
                };
                return Err(self.out_of_range(
                    &key,
                    format!(
                        "the factor of {whose} is {number}, which leaves nothing of what was logged"
                    ),
                    "give what a logged number is multiplied with, such as -1.0; without the key it stays as it is logged",
                ));
            }
        }
        Ok(())
    }
}
