//! Messages of mapped topics, and advice where a log has no joint states.

use super::{JointStates, KINDS, LATE_MESSAGES, LATE_NS, TopicId};
use crate::error::Result;
use crate::log::bag::definition::Definition;
use crate::log::bag::joint_state::Encoding;
use crate::log::bag::mapping::{Problem, Schema};
use crate::log::bag::suggest::Lists;

/// Most topics whose definitions are looked at for advice, most bytes of these, and topics that are shown.
const LOOKED_AT: usize = 64;
const MAX_BYTES: usize = 1 << 20;
const SHOWN: usize = 8;

impl JointStates<'_> {
    /// Makes a part for a topic that `[columns]` names.
    pub(super) fn declare_mapped(
        &mut self,
        name: &str,
        encoding: &str,
        schema: Option<&Schema>,
    ) -> Result<Option<usize>> {
        let Some(mapping) = &mut self.mapping else {
            return Ok(None);
        };
        let part = self.parts.len();
        let Some((number, new)) = mapping.declare(self.file, name, encoding, schema, part)? else {
            return Ok(None);
        };
        self.parts.push(new);
        self.part_topics.push(self.topics.len());
        Ok(Some(number))
    }

    /// A topic that is read cannot have messages of several types or encodings: one definition is for all of them.
    pub(super) fn same_kind(&self, known: usize, kind: Option<&str>, encoding: &str) -> Result<()> {
        let topic = &self.topics[known];
        let joint_states = kind.is_some_and(|kind| KINDS.contains(&kind));
        let read = topic.mapped.is_some() || topic.read_as.is_some() || joint_states;
        let alike = topic.kind.as_deref() == kind;
        // Joint states need no schema: their definition is known.
        let unnamed = kind.is_none() && topic.mapped.is_none();
        let same = (alike || unnamed) && topic.encoding == encoding;
        if !read || same {
            return Ok(());
        }
        let words = |kind: Option<&str>, encoding: &str| {
            let kind = kind.unwrap_or("no schema");
            match alike {
                true => format!("{kind} ({encoding})"),
                false => kind.to_owned(),
            }
        };
        Err(self.refuse(
            format!(
                "topic `{}` is of type {} and of type {}",
                topic.name,
                words(topic.kind.as_deref(), &topic.encoding),
                words(kind, encoding)
            ),
            "record every type on a topic of its own",
        ))
    }

    /// Takes a message of a mapped topic.
    pub(super) fn mapped_message(
        &mut self,
        id: TopicId,
        mapped: usize,
        log_time: u64,
        data: &[u8],
    ) -> Result<()> {
        let Some(mapping) = &mut self.mapping else {
            return Ok(());
        };
        let sample = match mapping.read(mapped, log_time, data) {
            Ok(sample) => sample,
            Err(problem) => {
                let topic = &self.topics[id.0];
                let message = format!("message {} on `{}`: ", topic.messages, topic.name);
                return match problem {
                    Problem::Broken(words) => {
                        self.drop(|| message + &words);
                        Ok(())
                    }
                    Problem::Unfit(words) => {
                        let (problem, remedy) = words.rsplit_once("; ").unwrap_or((&words, ""));
                        let remedy = format!("{remedy}; --lenient drops and counts such messages");
                        self.unfit_with(message + problem, &remedy)
                    }
                };
            }
        };
        let part = &mut self.parts[sample.part];
        let late = part.place(sample.stamp, LATE_NS, LATE_MESSAGES);
        part.insert_mapped(late.at, sample.stamp, mapping.values(mapped));
        if let Some(lateness) = late.lateness {
            self.late += 1;
            self.latest = self.latest.max(lateness);
        }
        self.count_row()
    }

    /// The times that are used, in words.
    pub(super) fn time_words(&self) -> String {
        let mut words = Vec::new();
        if self.states > 0 {
            words.push("header.stamp".to_owned());
        }
        let mapping = self.mapping.iter();
        words.extend(mapping.flat_map(|mapping| mapping.time_words()));
        words.join(" and ")
    }

    /// Topics whose messages never came.
    pub(super) fn refuse_silent_topics(&self) -> Result<()> {
        for (part, topic) in self.parts.iter().zip(&self.part_topics) {
            if part.mapped && part.len() == 0 {
                let why = match &self.first_dropped {
                    Some(first) => format!("; dropped were {}, the first: {first}", self.dropped),
                    None => String::new(),
                };
                return Err(self.refuse(
                    format!(
                        "topic {} is mapped and none of its messages could be taken{why}",
                        self.topics[*topic].words()
                    ),
                    "map another topic in [columns], or record it again",
                ));
            }
        }
        Ok(())
    }

    /// Lists of numbers that topics have, and the line that maps one.
    pub(super) fn suggestions(&self) -> (String, String) {
        let (mut shown, mut line) = (Vec::new(), None);
        for (topic, lists) in self.lists() {
            if shown.len() < SHOWN {
                shown.push(format!("`{topic}` has {}", lists.words()));
            }
            line = line.or_else(|| lists.line(topic));
        }
        match line {
            Some(line) => (
                format!("; lists of numbers: {}", shown.join("; ")),
                format!("if these are the joints, map them at the top of twincal.toml: {line}"),
            ),
            None => (String::new(), super::CONVERT.to_owned()),
        }
    }

    /// What maps the torque where a topic beside the joint states may hold it.
    pub(super) fn torque_elsewhere(&self) -> Option<String> {
        let find = |joints| {
            let mut lists = self.lists();
            lists.find_map(|(topic, lists)| lists.torque(topic, joints))
        };
        // What is called torque goes first.
        let line = find(None).or_else(|| find(Some(self.robot.dof())))?;
        Some(format!(
            "if this is the torque, say it with [columns] {line}"
        ))
    }

    /// Topics with messages of other types, and their lists of numbers.
    fn lists(&self) -> impl Iterator<Item = (&str, Lists)> {
        let with_messages = self.topics.iter().filter(|topic| topic.messages > 0);
        let mut bytes = 0;
        with_messages.take(LOOKED_AT).filter_map(move |topic| {
            let schema = topic.schema.as_ref()?;
            bytes += schema.text.len();
            if bytes > MAX_BYTES {
                return None;
            }
            let (language, encoding) = match topic.encoding.as_str() {
                "cdr" => ("ros2msg", Encoding::Cdr),
                "ros1" => ("ros1msg", Encoding::Ros1),
                _ => return None,
            };
            if KINDS.contains(&schema.kind.as_str())
                || schema.language != language && !schema.text.is_empty()
            {
                return None;
            }
            let definition = Definition::parse(&schema.kind, &schema.text, encoding).ok()?;
            let lists = Lists::of(&definition, self.robot.dof());
            (!lists.is_empty()).then_some((topic.name.as_str(), lists))
        })
    }
}
