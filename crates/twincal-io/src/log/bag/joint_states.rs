//! From messages to a recording: topics, joints by name, order by `header.stamp`, partial messages brought together.
//!
//! Messages of one topic that name the same joints make a *part*; most logs are one part. A message that comes late is put where its
//! stamp belongs, if that is at most half a second and 1024 messages back; what is further back is a step of the clock and stays.

mod choose;
mod layouts;
mod mapped;
mod topics;

use super::joint_state::{Encoding, JointState, decode};
use super::mapping::{Mapping, Schema};
use super::merge::{Chosen, merge};
use super::part::{IN_TABLES, LISTS as PART_LISTS, Part};
use super::path::is_source;
use crate::error::{Error, Place, Result};
use crate::log::columns::{refuse_model_torque, say as say_columns};
use crate::log::{
    Cells, Channel, LogOptions, MAX_NAME, Request, Selection, TorqueSource, assemble,
};
use crate::memory;
use layouts::{Foreign, Layout};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::rc::Rc;
use topics::CONVERT;
use twincal::Code;
use twincal::robot::Robot;
use twincal::signal::Log;
use twincal::words::{quoted, shortened};
use twincal::{Finding, Severity};

/// Message types that are read.
const KINDS: [&str; 3] = [
    "sensor_msgs/msg/JointState",
    "sensor_msgs/JointState",
    "sensor_msgs::msg::dds_::JointState_",
];
/// How far back a late message is put in its place, ns and messages.
const LATE_NS: i64 = 500_000_000;
const LATE_MESSAGES: usize = 1024;
/// Share of late messages beyond which they are worth a warning.
const LATE_SHARE: f64 = 0.01;
/// Rows between two looks at the memory that is left; tests of this crate look more often.
const LOOK: usize = if cfg!(test) { 1 << 12 } else { 1 << 16 };
/// Most topics of a log.
const MAX_TOPICS: usize = 10_000;
const CHANNELS: [&str; PART_LISTS] = ["position", "velocity", "effort", "acceleration"];

/// A topic of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TopicId(usize);

struct Topic {
    name: String,
    kind: Option<String>,
    schema: Option<Rc<Schema>>,
    encoding: String,
    /// How joint states on it are read.
    read_as: Option<Encoding>,
    /// Which of the mapped topics it is.
    mapped: Option<usize>,
    messages: u64,
    layouts: Vec<Layout>,
    last: usize,
}

/// Gathers the messages of one log.
pub(super) struct JointStates<'a> {
    file: &'a str,
    robot: &'a Robot,
    options: &'a LogOptions,
    /// A long log may leave memory.
    chapters: bool,
    /// Name in messages of each moving joint.
    wanted: Vec<String>,
    mapping: Option<Mapping>,
    topics: Vec<Topic>,
    /// Numbers of the topics.
    by_name: BTreeMap<String, usize>,
    parts: Vec<Part>,
    part_topics: Vec<usize>,
    foreign: Foreign,
    ambiguous: bool,
    rows: usize,
    /// Of them those of joint states.
    states: usize,
    dropped: u64,
    first_dropped: Option<String>,
    late: u64,
    latest: i64,
    lag: f64,
}

impl<'a> JointStates<'a> {
    /// # Errors
    /// [`Error::Content`] for a mapping that cannot be understood.
    pub(super) fn new(request: Request<'a>) -> Result<Self> {
        let Request {
            name: file,
            robot,
            options,
            chapters,
        } = request;
        let wanted = robot
            .joint_names()
            .iter()
            .map(|joint| match options.columns.q.of_joint(joint) {
                Some(name) if !is_source(name) => name.to_owned(),
                _ => (*joint).to_owned(),
            })
            .collect();
        Ok(Self {
            file,
            robot,
            options,
            chapters,
            wanted,
            mapping: Mapping::new(file, robot, options)?,
            topics: Vec::new(),
            by_name: BTreeMap::new(),
            parts: Vec::new(),
            part_topics: Vec::new(),
            foreign: Foreign::default(),
            ambiguous: false,
            rows: 0,
            states: 0,
            dropped: 0,
            first_dropped: None,
            late: 0,
            latest: 0,
            lag: 0.0,
        })
    }

    fn refuse(&self, problem: impl Into<String>, remedy: impl Into<String>) -> Error {
        Error::content(Place::file(self.file), problem, remedy)
    }

    /// Makes a topic known; `schema` says what its messages are, `None` if it is missing.
    ///
    /// # Errors
    /// [`Error::Content`] if the config maps it and it cannot be read.
    pub(super) fn topic(
        &mut self,
        name: &str,
        schema: Option<Rc<Schema>>,
        encoding: &str,
    ) -> Result<TopicId> {
        let kind = schema.as_ref().map(|schema| schema.kind.as_str());
        let clean = |text: &str| text.chars().filter(|c| !c.is_control()).collect::<String>();
        self.refuse_long("topic", name)?;
        let name = clean(name);
        if let Some(&known) = self.by_name.get(&name) {
            self.same_kind(known, kind, &clean(encoding))?;
            return Ok(TopicId(known));
        }
        if self.topics.len() == MAX_TOPICS {
            return Err(self.refuse(
                format!("has more than {MAX_TOPICS} topics"),
                "record the topics with joint states alone",
            ));
        }
        let asked = self.options.topics.contains(&name);
        let joint_state = kind.is_some_and(|kind| KINDS.contains(&kind));
        let encoded = match encoding {
            "cdr" => Some(Encoding::Cdr),
            "ros1" => Some(Encoding::Ros1),
            _ => None,
        };
        let wanted = self
            .mapping
            .as_ref()
            .is_none_or(|mapping| mapping.joint_states);
        let wanted = wanted && (asked || self.options.topics.is_empty());
        let mapped = self.declare_mapped(&name, encoding, schema.as_deref())?;
        let topic = Topic {
            read_as: encoded.filter(|_| joint_state && wanted),
            mapped,
            name,
            kind: kind.map(clean),
            schema: schema.clone(),
            encoding: clean(encoding),
            messages: 0,
            layouts: Vec::new(),
            last: 0,
        };
        self.by_name.insert(topic.name.clone(), self.topics.len());
        self.topics.push(topic);
        Ok(TopicId(self.topics.len() - 1))
    }

    /// Refuses a name that no recorder writes.
    fn refuse_long(&self, what: &str, name: &str) -> Result<()> {
        if name.len() <= MAX_NAME {
            return Ok(());
        }
        Err(self.refuse(
            format!(
                "the name of {what} `{}` has {} bytes, the limit is {MAX_NAME}",
                shortened(name),
                name.len()
            ),
            "record it under a shorter name",
        ))
    }

    /// Whether messages of a topic are read.
    pub(super) fn reads(&self, id: TopicId) -> bool {
        let topic = &self.topics[id.0];
        topic.read_as.is_some() || topic.mapped.is_some()
    }

    /// Takes one message.
    ///
    /// # Errors
    /// [`Error::Content`] with topic and message number for lists that do not fit the names, and where memory ends.
    pub(super) fn message(&mut self, id: TopicId, log_time: u64, data: &[u8]) -> Result<()> {
        let topic = &mut self.topics[id.0];
        topic.messages += 1;
        if let Some(mapped) = topic.mapped {
            self.mapped_message(id, mapped, log_time, data)?;
        }
        let topic = &self.topics[id.0];
        let Some(encoding) = topic.read_as else {
            return Ok(());
        };
        let number = topic.messages;
        if number == 1 && self.options.topics.is_empty() {
            let others = &self.topics;
            self.ambiguous |= (others.iter().enumerate())
                .any(|(at, other)| at != id.0 && other.read_as.is_some() && other.messages > 0);
        }
        if self.ambiguous {
            return Ok(());
        }
        let topic = &self.topics[id.0];
        let known = topic.layouts.get(topic.last);
        let state = match decode(encoding, data, known.map_or(&[], |layout| &layout.names)) {
            Ok(state) => state,
            Err(problem) => {
                let name = topic.name.clone();
                self.drop(|| format!("message {number} on `{name}`: {problem}"));
                return Ok(());
            }
        };
        let Some(at) = self.layout_of(id.0, &state)? else {
            return Ok(());
        };
        self.topics[id.0].last = at;
        if let Some(problem) = self.misfit(id.0, &state) {
            return self.unfit(problem);
        }
        self.take(id.0, log_time, &state)
    }

    /// Puts a message whose lists fit in its place among the rows of its part.
    fn take(&mut self, topic: usize, log_time: u64, state: &JointState<'_>) -> Result<()> {
        let topic = &self.topics[topic];
        let layout = &topic.layouts[topic.last];
        let part = &mut self.parts[layout.part];
        let stamp = state.stamp;
        self.lag += log_time as f64 - stamp as f64;
        let late = part.place(stamp, LATE_NS, LATE_MESSAGES);
        if let Some(lateness) = late.lateness {
            self.late += 1;
            self.latest = self.latest.max(lateness);
        }
        part.insert(late.at, stamp, &layout.entries, &state.values);
        self.states += 1;
        self.count_row()
    }

    /// A row more; now and then a look at the memory that is left.
    fn count_row(&mut self) -> Result<()> {
        self.rows += 1;
        if self.rows.is_multiple_of(LOOK) {
            // Growing vectors hold up to three times their content while they move.
            if self.chapters {
                let numbers = self.parts.iter().map(|part| part.len() * part.width());
                let many = Cells::are_many(numbers.sum());
                for part in &mut self.parts {
                    part.settle(self.file, LATE_MESSAGES, many)?;
                }
            }
            let bytes: u64 = self.parts.iter().map(Part::bytes).sum();
            memory::require(
                self.file,
                bytes,
                "read a shorter log, or one with fewer joints",
            )?;
        }
        Ok(())
    }

    fn drop(&mut self, words: impl FnOnce() -> String) {
        self.dropped += 1;
        self.first_dropped.get_or_insert_with(words);
    }

    /// A message whose lists do not fit: refused, or dropped when told to be lenient.
    fn unfit(&mut self, problem: String) -> Result<()> {
        self.unfit_with(
            problem,
            "fix the publisher, or drop and count such messages with --lenient",
        )
    }

    fn unfit_with(&mut self, problem: String, remedy: &str) -> Result<()> {
        if self.options.lenient {
            self.drop(|| problem);
            return Ok(());
        }
        Err(self.refuse(problem, remedy))
    }

    /// The log, with all that was assumed.
    ///
    /// # Errors
    /// [`Error::Content`] if no topic or more than one can be read, joints of the model are missing, effort is missing or the parts do
    /// not overlap in time.
    pub(super) fn finish(
        mut self,
        mut findings: Vec<Finding>,
    ) -> Result<(Log<'static>, Vec<Finding>)> {
        self.refuse_what_is_damaged(&findings)?;
        self.refuse_without_messages()?;
        self.check_topics()?;
        self.refuse_without_rows()?;
        let parts = self.choose()?;
        self.say(&mut findings);
        if let Some(mapping) = &self.mapping {
            let lag = (self.states > 0).then(|| self.lag / self.states as f64);
            mapping.say(self.file, lag, &mut findings)?;
        }
        let mut cells = merge(
            self.file,
            &mut self.parts,
            &parts,
            |part| self.topics[self.part_topics[part]].name.as_str(),
            self.robot,
            self.chapters,
            &mut findings,
        )?;
        cells.dropped = self.dropped;
        cells.first_dropped = self.first_dropped.take();
        let selection = self.selection(&parts);
        let names = self.robot.joint_names();
        if self.mapping.is_some() {
            refuse_model_torque(self.file, &names, &selection.joints, self.options)?;
        }
        findings.push(say_columns(
            self.file,
            &names,
            &selection.time,
            &selection.joints,
            &[],
        ));
        // Time is in seconds already.
        let mut options = Cow::Borrowed(self.options);
        if self.options.columns.time_unit.is_some() {
            options.to_mut().columns.time_unit = None;
        }
        let request = Request {
            name: self.file,
            robot: self.robot,
            options: &options,
            chapters: self.chapters,
        };
        let log = assemble(request, cells, selection, &mut findings)?;
        Ok((log, findings))
    }

    /// Refuses a log of whose messages none became a row.
    fn refuse_without_rows(&self) -> Result<()> {
        if self.rows > 0 {
            return Ok(());
        }
        let problem = match (&self.first_dropped, self.dropped) {
            (Some(first), count) => {
                format!("not one of {count} messages could be read: {first}")
            }
            _ => "has no message of joint states".into(),
        };
        Err(self.refuse(problem, "record it again, or copy it again"))
    }

    /// The columns of the table that the chosen parts were merged into.
    fn selection(&self, parts: &Chosen) -> Selection {
        let mut index = 0;
        let mut channel = |there: bool, name: String| {
            index += usize::from(there);
            there.then_some(Channel { index, name })
        };
        let joints: Vec<[Option<Channel>; 4]> = (parts.iter().enumerate())
            .map(|(joint, parts)| {
                let named = |list: usize| {
                    if let Some(words) = self.mapping.as_ref().and_then(|m| m.words(joint, list)) {
                        return words;
                    }
                    let part = parts[list];
                    let topic = part.map_or("", |part| &self.topics[self.part_topics[part]].name);
                    format!("{topic} {}[{}]", CHANNELS[list], self.wanted[joint])
                };
                IN_TABLES.map(|list| channel(parts[list].is_some(), named(list)))
            })
            .collect();
        Selection {
            time: Some(Channel {
                index: 0,
                name: self.time_words(),
            }),
            joints,
            temperatures: Vec::new(),
            findings: Vec::new(),
        }
    }

    fn say(&self, findings: &mut Vec<Finding>) {
        let messages = self.rows as f64;
        let mut say = |severity, code: Code, message: String, count, numbers: &[_]| {
            let finding = Finding::new(severity, code, self.file, message, count);
            findings.push(finding.with(numbers.iter().copied()));
        };
        if self.states > 0 {
            say(
                Severity::Note,
                Code::TimeSource,
                format!(
                    "time is header.stamp on topic {}, not the recorder's clock, which is later by {:.3} ms on average",
                    self.read_topics(),
                    self.lag / self.states as f64 / 1e6
                ),
                0,
                &[("lag", self.lag / self.states as f64 / 1e9)],
            );
        }
        if self.options.torque_source() == TorqueSource::Joint {
            say(
                Severity::Note,
                Code::EffortIsJointTorque,
                "the logged torque (effort[], or what [columns] tau names) counts as torque on the joint's side of the gear, N·m (N for sliders); if it is of the motor or a current, say so with [[log]] torque".into(),
                0,
                &[],
            );
        }
        if self.late > 0 {
            let severity = if self.late as f64 > LATE_SHARE * messages {
                Severity::Warning
            } else {
                Severity::Note
            };
            say(
                severity,
                Code::LateMessages,
                format!(
                    "{} of {messages} messages came late, by at most {:.3} ms, and were put in the order of their stamps",
                    self.late,
                    self.latest as f64 / 1e6
                ),
                self.late,
                &[("messages", messages), ("latest", self.latest as f64 / 1e9)],
            );
        }
        let foreign = &self.foreign.in_order;
        if !foreign.is_empty() {
            say(
                Severity::Note,
                Code::JointsLeftOut,
                format!(
                    "joints that do not move in the model were left out: {}",
                    quoted(foreign)
                ),
                foreign.len() as u64,
                &[],
            );
        }
    }
}
