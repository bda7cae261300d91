//! `[columns]`: which column or field of a log is which channel of which joint.

use super::FactorTable;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The columns of one channel.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected { joint = \"column\" }, or one name for all joints such as \"pos_*\" or \"/topic:field[*]\""
)]
pub enum ChannelNames {
    /// By joint name; joints that are not there go by the names in the log.
    ByJoint(BTreeMap<String, String>),
    /// All joints in the model's order: columns with `*` where the joint's number stands, an array of an NPZ file, or
    /// `/topic:field[*]` of a bag.
    All(String),
}

impl Default for ChannelNames {
    fn default() -> Self {
        Self::ByJoint(BTreeMap::new())
    }
}

impl ChannelNames {
    /// Whether nothing is said.
    pub fn is_empty(&self) -> bool {
        matches!(self, Self::ByJoint(names) if names.is_empty())
    }

    /// What is said of one joint by its name.
    pub fn of_joint(&self, joint: &str) -> Option<&str> {
        match self {
            Self::ByJoint(names) => names.get(joint).map(String::as_str),
            Self::All(_) => None,
        }
    }

    /// Whether a joint's channel is named, alone or with all others.
    pub fn names(&self, joint: &str) -> bool {
        match self {
            Self::ByJoint(names) => names.contains_key(joint),
            Self::All(_) => true,
        }
    }
}

impl FromIterator<(String, String)> for ChannelNames {
    fn from_iter<I: IntoIterator<Item = (String, String)>>(names: I) -> Self {
        Self::ByJoint(names.into_iter().collect())
    }
}

impl ColumnsTable {
    /// The keys that name columns joint by joint.
    pub fn channels(&self) -> [(&'static str, &ChannelNames); 5] {
        [
            ("q", &self.q),
            ("qd", &self.qd),
            ("qdd", &self.qdd),
            ("tau", &self.tau),
            ("temperature", &self.temperature),
        ]
    }

    /// Likewise, to be changed.
    pub(super) fn channels_mut(&mut self) -> [(&'static str, &mut ChannelNames); 5] {
        [
            ("q", &mut self.q),
            ("qd", &mut self.qd),
            ("qdd", &mut self.qdd),
            ("tau", &mut self.tau),
            ("temperature", &mut self.temperature),
        ]
    }
}

/// Ticks of a clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TimeUnit {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

impl TimeUnit {
    /// As in the config.
    pub fn word(self) -> &'static str {
        match self {
            Self::S => "s",
            Self::Ms => "ms",
            Self::Us => "us",
            Self::Ns => "ns",
        }
    }

    /// Ticks per second.
    pub fn ticks(self) -> f64 {
        match self {
            Self::S => 1.0,
            Self::Ms => 1e3,
            Self::Us => 1e6,
            Self::Ns => 1e9,
        }
    }

    /// Nanoseconds per tick.
    pub(crate) fn nanoseconds(self) -> i64 {
        match self {
            Self::S => 1_000_000_000,
            Self::Ms => 1_000_000,
            Self::Us => 1_000,
            Self::Ns => 1,
        }
    }
}

/// `[columns]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct ColumnsTable {
    /// Column of the time stamps, s. Of a bag: "/topic:field", or "log_time" for the recorder's clock; default: the
    /// message's own header.stamp.
    pub time: Option<String>,
    /// What one tick of time is; default "s", for whole numbers in messages of a bag "ns".
    pub time_unit: Option<TimeUnit>,
    /// Position column of each joint, by joint name, or one name for all joints; rad or m. `positions[:,2]` is a column of an
    /// array of an NPZ file, `/topic:field.list[2]` a number in the messages of a bag.
    pub q: ChannelNames,
    /// Velocity column of each joint; rad/s or m/s.
    pub qd: ChannelNames,
    /// Acceleration column of each joint; rad/s² or m/s².
    pub qdd: ChannelNames,
    /// Torque column of each joint, joint side; N·m or N.
    pub tau: ChannelNames,
    /// Temperature column of each joint's drive, °C or K; of tables, not of a bag's topics.
    pub temperature: ChannelNames,
    /// What logged numbers are multiplied with to have the model's units and signs: { tau = { elbow = -1.0 } }.
    #[serde(skip_serializing_if = "FactorTable::is_empty")]
    pub factor: FactorTable,
}
