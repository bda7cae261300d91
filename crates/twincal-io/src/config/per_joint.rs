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

    /// These numbers, and those of `other` for the joints of which nothing is said here.
    #[must_use]
    pub fn or(&self, other: &Self, joints: &[&str]) -> Self {
        let number = |joint: &&str| self.of_joint(joint).or(other.of_joint(joint));
        match (self, other) {
            (Self::All(_), _) => self.clone(),
            (own, Self::All(_)) if own.is_empty() => other.clone(),
            // A joint that does not move in the model stays: the reader names it.
            (Self::ByJoint(own), _) => {
                let own = own.iter().map(|(joint, number)| (joint.clone(), *number));
                let all = joints
                    .iter()
                    .filter_map(|joint| Some(((*joint).to_owned(), number(joint)?)));
                Self::ByJoint(own.chain(all).collect())
            }
        }
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
        let joints = ["a", "b", "c"];
        let mixed = [("a".into(), 1.0), ("b".into(), 2.0), ("c".into(), 3.0)];
        assert_eq!(some.or(&all, &joints), PerJoint::ByJoint(mixed.into()));
        assert_eq!(all.or(&some, &joints), all);
        assert_eq!(PerJoint::default().or(&all, &joints), all);
        assert_eq!(some.or(&PerJoint::default(), &joints), some);
        assert!(PerJoint::default().is_empty() && !some.is_empty() && !all.is_empty());
    }
}
