//! Which topics there are, in words, and which of them cannot be told apart.

use super::{JointStates, KINDS, Topic};
use crate::error::{Error, Result};
use twincal::robot::did_you_mean;
use twincal::words::{NAMED, listed, quoted, shortened};
use twincal::{Finding, Severity};

/// What helps where a topic cannot be read.
pub(super) const CONVERT: &str = "map other types with [columns] (docs/logs.md), record or convert it to sensor_msgs/msg/JointState in CDR, or export the joint states to CSV, Parquet, Arrow or NPZ";

impl JointStates<'_> {
    /// A file without any message that is damaged has none for that reason.
    pub(super) fn refuse_what_is_damaged(&self, findings: &[Finding]) -> Result<()> {
        let mut degraded = findings.iter();
        let damage = degraded.find(|finding| finding.severity == Severity::Degraded);
        match damage.filter(|_| self.topics.iter().all(|topic| topic.messages == 0)) {
            None => Ok(()),
            Some(damage) => Err(self.refuse(
                format!("not one message of it can be read: {}", damage.message),
                "record or copy it again",
            )),
        }
    }

    /// A file without any message, whatever topics it names.
    pub(super) fn refuse_without_messages(&self) -> Result<()> {
        if self.topics.iter().any(|topic| topic.messages > 0) {
            return Ok(());
        }
        let list = match self.list(|_| true) {
            list if list.is_empty() => "and no topics".to_owned(),
            list => format!("on its topics: {list}"),
        };
        Err(self.refuse(
            format!("holds no messages {list}"),
            "record it again while the robot's joint states are published",
        ))
    }

    pub(super) fn check_topics(&self) -> Result<()> {
        if let Some(mapping) = &self.mapping {
            let names = self.topics.iter().map(|topic| topic.name.as_str());
            mapping.check(self.file, names, &self.list(|_| true))?;
            if !mapping.joint_states {
                return Ok(());
            }
        }
        self.check_asked()?;
        if self.ambiguous {
            return Err(self.ambiguity());
        }
        if !self.topics.iter().any(|topic| topic.read_as.is_some()) {
            let list = self.list(|_| true);
            if self.mapping.is_some() {
                return Ok(());
            }
            let (lists, remedy) = self.suggestions();
            return Err(self.refuse(
                format!(
                    "has no topic with {} in CDR; it has {list}{lists}",
                    KINDS[0]
                ),
                remedy,
            ));
        }
        Ok(())
    }

    /// Topics that `[[log]] topic` names are there and hold joint states.
    fn check_asked(&self) -> Result<()> {
        for asked in &self.options.topics {
            let found = self.topics.iter().find(|topic| topic.name == *asked);
            if let Some(topic) = found.filter(|topic| topic.read_as.is_none()) {
                let (problem, remedy) = match &topic.kind {
                    None => ("its schema is missing from the file", CONVERT.to_owned()),
                    Some(_) => ("its messages are no joint states", self.suggestions().1),
                };
                return Err(self.refuse(
                    format!("topic {} cannot be read: {problem}", topic.words()),
                    remedy,
                ));
            }
            if found.is_none() {
                let names = self.topics.iter().map(|topic| topic.name.as_str());
                return Err(self.refuse(
                    format!(
                        "has no topic `{asked}`, which [[log]] topic names; it has {}",
                        self.list(|_| true)
                    ),
                    did_you_mean(asked, names),
                ));
            }
        }
        Ok(())
    }

    /// The error for joint states on several topics of which none is named.
    fn ambiguity(&self) -> Error {
        let list = self.list(|topic| topic.read_as.is_some() && topic.messages > 0);
        let names: Vec<String> = (self.topics.iter())
            .filter(|topic| topic.read_as.is_some() && topic.messages > 0)
            .take(NAMED)
            .map(|topic| format!("{:?}", topic.name))
            .collect();
        self.refuse(
            format!("has joint states on more than one topic: {list}"),
            format!(
                "say which with [[log]] topic = {}; if they complete each other, say topic = [{}], and each joint's channel comes from the first that has it",
                names.first().map_or("", String::as_str),
                names.join(", ")
            ),
        )
    }

    pub(super) fn list(&self, which: impl Fn(&Topic) -> bool) -> String {
        let chosen = self.topics.iter().filter(|topic| which(topic));
        listed(chosen.map(Topic::words), ", ")
    }

    pub(super) fn read_topics(&self) -> String {
        let read = (self.topics.iter())
            .filter(|topic| topic.read_as.is_some() && topic.messages > 0)
            .map(|topic| topic.name.as_str());
        quoted(read)
    }
}

impl Topic {
    /// Whether its messages are joint states.
    pub(super) fn is_joint_state(&self) -> bool {
        self.kind
            .as_deref()
            .is_some_and(|kind| KINDS.contains(&kind))
    }

    pub(super) fn words(&self) -> String {
        let kind = shortened(self.kind.as_deref().unwrap_or("no schema"));
        format!(
            "`{}` ({kind}, {}, {} messages)",
            shortened(&self.name),
            shortened(&self.encoding),
            self.messages
        )
    }
}
