//! Which part each channel of each joint comes from, and what is missing.

use super::{JointStates, PART_LISTS};
use crate::error::Result;
use crate::log::TorqueSource;
use twincal::robot::did_you_mean;
use twincal::words::quoted;

impl JointStates<'_> {
    /// Which part each joint's position, velocity, effort and acceleration come from: what is mapped first, then joint states.
    pub(super) fn choose(&self) -> Result<Vec<[Option<usize>; PART_LISTS]>> {
        let order = |part: usize| {
            let topic = &self.topics[self.part_topics[part]].name;
            let place = self.options.topics.iter().position(|asked| asked == topic);
            (place, usize::MAX - self.parts[part].len(), part)
        };
        let mut by_preference: Vec<usize> = (0..self.parts.len())
            .filter(|&part| self.parts[part].len() > 0 && !self.parts[part].mapped)
            .collect();
        by_preference.sort_by_key(|&part| order(part));
        let joints = self.wanted.len();
        let mapped = |joint: usize, list: usize| self.mapping.as_ref()?.part(joint, list);
        let chosen: Vec<[Option<usize>; PART_LISTS]> = (0..joints)
            .map(|joint| {
                let of = |list: usize, home: Option<usize>| {
                    if let Some(part) = mapped(joint, list) {
                        return Some(part);
                    }
                    let has = |part: &usize| {
                        let part = &self.parts[*part];
                        part.has[list] && !part.mapped && part.joints.contains(&joint)
                    };
                    home.filter(has)
                        .or_else(|| by_preference.iter().copied().find(has))
                };
                let q = of(0, None);
                [q, of(1, q), of(2, q), of(3, q)]
            })
            .collect();
        self.refuse_silent_topics()?;
        self.refuse_missing_joints(&chosen)?;
        self.refuse_missing_effort(&chosen)?;
        Ok(chosen)
    }

    fn refuse_missing_joints(&self, chosen: &[[Option<usize>; PART_LISTS]]) -> Result<()> {
        let Some(first) = chosen.iter().position(|parts| parts[0].is_none()) else {
            return Ok(());
        };
        let missing: Vec<&str> = (chosen.iter().zip(&self.wanted))
            .filter(|(parts, _)| parts[0].is_none())
            .map(|(_, name)| name.as_str())
            .collect();
        if self.states == 0 {
            return Err(self.refuse(
                format!(
                    "[columns] q maps no position of joint {}, and there are no joint states",
                    quoted(&missing)
                ),
                "map it too, or fix a joint that does not move with [model] locked",
            ));
        }
        let named = self.parts.iter().flat_map(|part| part.joints.iter());
        if named.clone().any(|joint| *joint == first) {
            return Err(self.refuse(
                format!(
                    "topic {}: position[] of joint {} is empty in all messages",
                    self.read_topics(),
                    quoted(&missing)
                ),
                self.unread().map_or_else(
                    || "record positions too".to_owned(),
                    |topics| format!("if {topics} has them, name it too: [[log]] topic = [\"…\", \"…\"]; else record positions too"),
                ),
            ));
        }
        let named = &self.foreign.in_order;
        let names = if named.is_empty() {
            String::new()
        } else {
            format!("; it names {}", quoted(named))
        };
        Err(self.refuse(
            format!(
                "topic {} has no joint {} of the model{names}",
                self.read_topics(),
                quoted(&missing)
            ),
            format!(
                "{}; map names with [columns] q = {{ joint = \"name in the log\" }}, or fix a joint that does not move with [model] locked",
                did_you_mean(missing[0], named.iter().map(String::as_str))
            ),
        ))
    }

    /// Topics of joint states that were left aside.
    fn unread(&self) -> Option<String> {
        let names: Vec<&str> = (self.topics.iter())
            .filter(|topic| topic.read_as.is_none() && topic.is_joint_state() && topic.messages > 0)
            .filter(|topic| ["cdr", "ros1"].contains(&topic.encoding.as_str()))
            .map(|topic| topic.name.as_str())
            .collect();
        (!names.is_empty()).then(|| quoted(names))
    }

    fn refuse_missing_effort(&self, chosen: &[[Option<usize>; PART_LISTS]]) -> Result<()> {
        if self.options.torque_source() == TorqueSource::None {
            return Ok(());
        }
        let missing: Vec<&str> = (chosen.iter().zip(&self.wanted))
            .filter(|(parts, _)| parts[2].is_none())
            .map(|(_, name)| name.as_str())
            .collect();
        if missing.is_empty() {
            return Ok(());
        }
        let whose = if missing.len() == chosen.len() {
            String::new()
        } else {
            format!(" of joint {}", quoted(&missing))
        };
        if self.states == 0 {
            return Err(self.refuse(
                format!("[columns] maps no torque{whose}, and no joint states are read"),
                "map it with [columns] tau, name a topic of joint states in [[log]] topic, or say [[log]] torque = \"none\" for a log that is only to be predicted",
            ));
        }
        let elsewhere = self.torque_elsewhere();
        Err(self.refuse(
            format!(
                "topic {}: effort[]{whose} is empty in all messages",
                self.read_topics()
            ),
            elsewhere.map_or_else(String::new, |words| words + "; else ") + "record a topic with effort, name it too in [[log]] topic = [\"…\", \"…\"], or say [[log]] torque = \"none\" for a log that is only to be predicted",
        ))
    }
}
