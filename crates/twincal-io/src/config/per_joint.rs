//! A number of every joint, as one for all of them or by name: `lag = 0.008`, `tau = { elbow = -1.0 }`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One number for all joints, or numbers by joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected a number, or numbers by joint such as { elbow = -1.0 }"
)]
pub enum PerJoint {
    /// Of all joints.
    All(f64),
    /// By joint name; nothing is said of the others.
    ByJoint(BTreeMap<String, f64>),
}

impl Default for PerJoint {
    /// Nothing is said.
    fn default() -> Self {
        Self::ByJoint(BTreeMap::new())
    }
}

impl PerJoint {
    /// That of a joint, if one was said.
    pub fn of_joint(&self, joint: &str) -> Option<f64> {
        match self {
            Self::All(number) => Some(*number),
            Self::ByJoint(numbers) => numbers.get(joint).copied(),
        }
    }

    /// Whether nothing is said.
    pub fn is_empty(&self) -> bool {
        matches!(self, Self::ByJoint(numbers) if numbers.is_empty())
    }

    /// The numbers as they stand in the config, each with its joint; `None` for all of them.
    pub fn numbers(&self) -> impl Iterator<Item = (Option<&str>, f64)> {
        let (all, own) = match self {
            Self::All(number) => (Some((None, *number)), None),
            Self::ByJoint(numbers) => (None, Some(numbers)),
        };
        let own = own.into_iter().flatten();
        all.into_iter()
            .chain(own.map(|(joint, number)| (Some(joint.as_str()), *number)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_for_all_or_each_its_own() {
        let some = PerJoint::ByJoint([("b".into(), 2.0), ("a".into(), 1.0)].into());
        assert_eq!(
            some.numbers().collect::<Vec<_>>(),
            [(Some("a"), 1.0), (Some("b"), 2.0)]
        );
        assert_eq!((some.of_joint("b"), some.of_joint("c")), (Some(2.0), None));
        let all = PerJoint::All(3.0);
        assert_eq!(all.numbers().collect::<Vec<_>>(), [(None, 3.0)]);
        assert_eq!(all.of_joint("c"), Some(3.0));
        assert!(PerJoint::default().is_empty() && !some.is_empty() && !all.is_empty());
    }
}
