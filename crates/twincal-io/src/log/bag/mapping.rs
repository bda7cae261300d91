//! Topics of any type: which numbers in their messages are which channels, as `[columns]` says.
//!
//! A mapped topic has one part (see `part.rs`) with the channels that are taken from it. Its paths are compared with the definition of its
//! messages when the topic is declared, and followed in every message.

mod read;

use super::definition::Definition;
use super::joint_state::Encoding;
use super::part::{LISTS, Part};
use super::path::{Source, Step, Wanted, check, is_source};
use crate::config::{ChannelNames, TimeUnit};
use crate::error::{Error, Place, Result};
use crate::log::LogOptions;
use crate::log::columns::refuse_unknown_joints;
use std::collections::BTreeSet;
use twincal::robot::{Robot, did_you_mean};
use twincal::words::quoted;
use twincal::{Code, Finding, Severity};

pub(super) use read::Problem;

/// The word for the recorder's clock.
const LOG_TIME: &str = "log_time";
/// Clocks that differ by less count as one, ns.
const TOGETHER_NS: f64 = 1e6;
/// The channels of `[columns]` as lists of a part: position, velocity, effort, acceleration.
const KEYS: [&str; LISTS] = ["q", "qd", "tau", "qdd"];

/// How a topic says what its messages are.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Schema {
    /// The message type.
    pub(super) kind: String,
    /// Language of the definition: `ros2msg`, `ros1msg` …
    pub(super) language: String,
    /// The definition; empty where it is missing.
    pub(super) text: String,
}

/// One number that is wanted.
struct Target {
    joint: usize,
    list: usize,
    source: Source,
    /// Column of the part.
    column: usize,
}

/// Where the time of a message comes from.
enum Time {
    Path(Vec<Step>, String),
    Log,
}

/// How messages of a topic are read.
#[derive(Default)]
enum Form {
    Binary {
        definition: Box<Definition>,
        plan: Option<read::Places>,
    },
    #[default]
    Json,
}

/// A mapped topic.
pub(super) struct Mapped {
    /// As the config calls it.
    asked: String,
    targets: Vec<Target>,
    time: Option<Source>,
    log_time: bool,
    found: Option<Reading>,
}

/// A mapped topic that the log has.
struct Reading {
    name: String,
    kind: String,
    part: usize,
    form: Form,
    /// None until the first message of a form without definitions.
    time: Option<Time>,
    /// How `[*]` of each target went, if it has one: true by name, false in the model's order.
    by_name: Vec<Option<bool>>,
    numbers: Vec<super::value::Number>,
    messages: u64,
    lag: f64,
    /// Points in time of the definition or the first message, for the advice.
    stamp_words: String,
    first_stamp: i64,
    stamps_differ: bool,
}

/// Everything that `[columns]` says of topics.
pub(super) struct Mapping {
    pub(super) topics: Vec<Mapped>,
    /// Whether joint states are read beside.
    pub(super) joint_states: bool,
    unit: Option<TimeUnit>,
    joints: Vec<String>,
}

fn refuse(file: &str, problem: impl Into<String>, remedy: impl Into<String>) -> Error {
    Error::content(Place::file(file), problem, remedy)
}

/// A problem in words with its remedy behind the last `;`.
fn refuse_words(file: &str, words: &str) -> Error {
    let (problem, remedy) = (words.rsplit_once("; ")).unwrap_or((words, "correct it in [columns]"));
    refuse(file, problem, remedy)
}

impl Mapping {
    /// What the config maps; none if it maps no topic.
    ///
    /// # Errors
    /// [`Error::Content`] for a path that cannot be read, a joint that the model does not have, a time of a topic that is not mapped.
    pub(super) fn new(file: &str, robot: &Robot, options: &LogOptions) -> Result<Option<Self>> {
        let joints = robot.joint_names();
        let columns = &options.columns;
        refuse_temperatures(file, &columns.temperature)?;
        let mut topics = mapped_topics(file, &joints, options)?;
        let all_q = |joint: &usize| {
            let mut targets = topics.iter().flat_map(|topic| &topic.targets);
            targets.any(|target| target.joint == *joint && target.list == 0)
        };
        let mapped_q = (0..joints.len()).filter(all_q).count();
        if let Some(time) = &columns.time {
            say_time(file, time, &mut topics)?;
        }
        if topics.is_empty() {
            return Ok(None);
        }
        Ok(Some(Self {
            joint_states: mapped_q < joints.len() || !options.topics.is_empty(),
            topics,
            unit: columns.time_unit,
            joints: joints.iter().map(|name| (*name).to_owned()).collect(),
        }))
    }

    /// Makes a topic known; its number among the mapped ones and its part, if it is mapped.
    ///
    /// # Errors
    /// [`Error::Content`] for messages that cannot be read and paths that lead nowhere.
    pub(super) fn declare(
        &mut self,
        file: &str,
        name: &str,
        encoding: &str,
        schema: Option<&Schema>,
        part: usize,
    ) -> Result<Option<(usize, Part)>> {
        let Some(number) = self.topics.iter().position(|topic| topic.is_of(name)) else {
            return Ok(None);
        };
        let topic = &mut self.topics[number];
        if topic.found.is_some() {
            return Ok(None);
        }
        let kind = schema.map_or("no schema", |schema| &schema.kind);
        let of = |words: String| {
            refuse_words(
                file,
                &format!("topic `{name}` ({kind}, {encoding}): {words}"),
            )
        };
        let form = form(encoding, schema).map_err(of)?;
        let time = match &form {
            Form::Binary { definition, .. } => {
                topic.check_paths(definition).map_err(of)?;
                let there = |steps: &[Step]| check(definition, steps, Wanted::Stamp).is_ok();
                Some(topic.time_source(there))
            }
            Form::Json if topic.time.is_some() || topic.log_time => {
                Some(topic.time_source(|_| false))
            }
            Form::Json => None,
        };
        let new = topic.new_part();
        let stamp_words = match &form {
            Form::Binary { definition, .. } => super::suggest::times(definition),
            Form::Json => String::new(),
        };
        topic.found = Some(Reading {
            name: name.to_owned(),
            kind: kind.to_owned(),
            part,
            form,
            time,
            by_name: Vec::new(),
            numbers: Vec::new(),
            messages: 0,
            lag: 0.0,
            stamp_words,
            first_stamp: 0,
            stamps_differ: false,
        });
        Ok(Some((number, new)))
    }

    /// The part that a joint's channel is taken from, if it is mapped.
    pub(super) fn part(&self, joint: usize, list: usize) -> Option<usize> {
        let (topic, _) = self.target(joint, list)?;
        topic.found.as_ref().map(|found| found.part)
    }

    /// Topic and number of its target.
    fn target(&self, joint: usize, list: usize) -> Option<(&Mapped, usize)> {
        self.topics.iter().find_map(|topic| {
            let mut targets = topic.targets.iter();
            let target = targets.position(|t| t.joint == joint && t.list == list)?;
            Some((topic, target))
        })
    }

    /// What a joint's channel is, in words: the path with the joint in the place of `*`.
    pub(super) fn words(&self, joint: usize, list: usize) -> Option<String> {
        let (topic, target) = self.target(joint, list)?;
        let found = topic.found.as_ref();
        let by_name = found.and_then(|found| found.by_name.get(target).copied());
        let whose = match by_name.flatten() {
            Some(true) => self.joints[joint].clone(),
            _ => joint.to_string(),
        };
        let text = &topic.targets[target].source.text;
        Some(text.replace("[*]", &format!("[{whose}]")))
    }

    /// Topics that the config names, and that a log lacks or has nothing of.
    ///
    /// # Errors
    /// [`Error::Content`] with the topics that are there.
    pub(super) fn check<'t>(
        &self,
        file: &str,
        topics: impl Iterator<Item = &'t str>,
        list: &str,
    ) -> Result<()> {
        if let Some(missing) = self.topics.iter().find(|topic| topic.found.is_none()) {
            let key = KEYS[missing.targets[0].list];
            return Err(refuse(
                file,
                format!(
                    "has no topic `{}`, which [columns] {key} names; it has {list}",
                    missing.asked
                ),
                did_you_mean(&missing.asked, topics),
            ));
        }
        Ok(())
    }

    /// What was assumed of the mapped topics.
    ///
    /// `states`: how much later the recorder's clock is than the stamps of joint states, ns on average, where there are any.
    ///
    /// # Errors
    /// [`Error::Content`] for stamps that nobody filled in.
    pub(super) fn say(
        &self,
        file: &str,
        states: Option<f64>,
        findings: &mut Vec<Finding>,
    ) -> Result<()> {
        let stamped = self.topics.iter().filter_map(|topic| topic.found.as_ref());
        let stamped = stamped.filter(|found| matches!(found.time, Some(Time::Path(..))));
        let lags = stamped.map(|found| found.lag / found.messages.max(1) as f64);
        let others = lags.chain(states).fold(0.0, f64::max);
        for topic in &self.topics {
            let Some(found) = topic.found.as_ref().filter(|found| found.messages > 0) else {
                continue;
            };
            found.refuse_constant_stamps(file)?;
            findings.push(topic.source_of_time(file, found, others));
            findings.extend(self.model_order(file, topic, found));
        }
        Ok(())
    }

    /// Entries whose joints nothing in the messages names.
    fn model_order(&self, file: &str, topic: &Mapped, found: &Reading) -> Option<Finding> {
        let ordered = found.by_name.iter().zip(&topic.targets);
        let ordered = ordered.filter(|(by_name, _)| **by_name == Some(false));
        let paths: BTreeSet<&str> = ordered.map(|(_, t)| t.source.text.as_str()).collect();
        if paths.is_empty() {
            return None;
        }
        let message = format!(
            "{}: nothing in the messages says whose the entries are, so they were taken in the model's order: {}",
            quoted(paths),
            quoted(&self.joints)
        );
        Some(Finding::new(
            Severity::Note,
            Code::ModelOrder,
            file,
            message,
            0,
        ))
    }

    /// The times that are used, in words.
    pub(super) fn time_words(&self) -> Vec<String> {
        let found = self.topics.iter().filter_map(|topic| topic.found.as_ref());
        let words = found.map(|found| match &found.time {
            Some(Time::Path(_, words)) => format!("{}:{words}", found.name),
            _ => format!("{} {LOG_TIME}", found.name),
        });
        words.collect()
    }
}

/// Temperatures come from tables only.
fn refuse_temperatures(file: &str, names: &ChannelNames) -> Result<()> {
    let of_topic = match names {
        ChannelNames::All(text) => is_source(text),
        ChannelNames::ByJoint(table) => table.values().any(|text| is_source(text)),
    };
    if of_topic {
        return Err(refuse(
            file,
            "[columns] temperature names a topic: temperatures are read from tables only",
            "leave it out for bags",
        ));
    }
    Ok(())
}

/// Topics that channels are mapped to, each with the numbers that are wanted of it.
fn mapped_topics(file: &str, joints: &[&str], options: &LogOptions) -> Result<Vec<Mapped>> {
    let columns = &options.columns;
    let tables = [&columns.q, &columns.qd, &columns.tau, &columns.qdd];
    let mut topics: Vec<Mapped> = Vec::new();
    let mut add = |list: usize, joint: usize, text: &str, all: bool| -> Result<()> {
        let source = Source::parse(text, all).map_err(|problem| {
            let words = format!("[columns] {} = \"{text}\" has {problem}", KEYS[list]);
            refuse_words(file, &words)
        })?;
        let target = |source| Target {
            joint,
            list,
            source,
            column: 0,
        };
        match topics.iter_mut().find(|topic| topic.asked == source.topic) {
            Some(topic) => topic.targets.push(target(source)),
            None => topics.push(Mapped {
                asked: source.topic.clone(),
                targets: vec![target(source)],
                time: None,
                log_time: false,
                found: None,
            }),
        }
        Ok(())
    };
    for (list, names) in tables.into_iter().enumerate() {
        match names {
            ChannelNames::ByJoint(table) => {
                for (joint, text) in table.iter().filter(|(_, text)| is_source(text)) {
                    let number = joints.iter().position(|name| name == joint);
                    let Some(number) = number else {
                        refuse_unknown_joints(file, joints, options)?;
                        continue;
                    };
                    add(list, number, text, false)?;
                }
            }
            ChannelNames::All(text) if is_source(text) => {
                for number in 0..joints.len() {
                    add(list, number, text, true)?;
                }
            }
            ChannelNames::All(text) => return Err(refuse_no_topic(file, KEYS[list], text)),
        }
    }
    Ok(topics)
}

/// A channel of `[columns]` that names a column of a table.
fn refuse_no_topic(file: &str, key: &str, text: &str) -> Error {
    refuse(
        file,
        format!("[columns] {key} = \"{text}\" names no topic of a bag"),
        format!("write {key} = \"/topic:field[*]\""),
    )
}

/// `[columns] time` where it is one of a bag.
fn say_time(file: &str, time: &str, topics: &mut [Mapped]) -> Result<()> {
    if time == LOG_TIME {
        if topics.is_empty() {
            return Err(refuse(
                file,
                "[columns] time = \"log_time\" is for mapped topics, and none is mapped",
                "map joint states too: q = \"/joint_states:position[*]\", tau = \"/joint_states:effort[*]\"",
            ));
        }
        topics.iter_mut().for_each(|topic| topic.log_time = true);
    }
    if !is_source(time) {
        return Ok(());
    }
    let source = Source::parse(time, false).map_err(|problem| {
        refuse_words(file, &format!("[columns] time = \"{time}\" has {problem}"))
    })?;
    let mapped = topics.iter_mut().find(|topic| topic.asked == source.topic);
    let Some(mapped) = mapped else {
        return Err(refuse(
            file,
            format!(
                "[columns] time names topic `{}`, and no channel is mapped to it",
                source.topic
            ),
            "map q, qd or tau to the same topic, or leave time out",
        ));
    };
    mapped.time = Some(source);
    Ok(())
}

impl Mapped {
    fn is_of(&self, name: &str) -> bool {
        self.targets
            .first()
            .is_some_and(|target| target.source.is_of(name))
    }

    /// Compares the paths of `[columns]` with the definition of the messages.
    ///
    /// # Errors
    /// The path that leads nowhere, in words.
    fn check_paths(&self, definition: &Definition) -> std::result::Result<(), String> {
        for target in &self.targets {
            let source = &target.source;
            let key = KEYS[target.list];
            check(definition, &source.steps, Wanted::Number)
                .map_err(|words| format!("[columns] {key} = \"{}\": {words}", source.text))?;
        }
        if let Some(time) = &self.time {
            check(definition, &time.steps, Wanted::Time)
                .map_err(|words| format!("[columns] time = \"{}\": {words}", time.text))?;
        }
        Ok(())
    }

    /// A part with the channels that are taken from the topic, which learn their columns of it.
    fn new_part(&mut self) -> Part {
        let mut joints: Vec<usize> = self.targets.iter().map(|target| target.joint).collect();
        joints.sort_unstable();
        joints.dedup();
        let mut has = [false; LISTS];
        for target in &self.targets {
            has[target.list] = true;
        }
        let new = Part::mapped(joints, has);
        for target in &mut self.targets {
            target.column = new.column(target.joint, target.list).unwrap_or(0);
        }
        new
    }

    /// Which clock the topic's time is of; `others`: how much later the recorder's is than the stamps of others at most, ns.
    fn source_of_time(&self, file: &str, found: &Reading, others: f64) -> Finding {
        let Reading { name, kind, .. } = found;
        let lag = found.lag / found.messages as f64;
        if let Some(Time::Path(_, words)) = &found.time {
            let message = format!(
                "time on topic `{name}` is {words}, not the recorder's clock, which is later by {:.3} ms on average",
                lag / 1e6
            );
            return Finding::new(Severity::Note, Code::TimeSource, file, message, 0)
                .with([("lag", lag / 1e9)]);
        }
        let warning =
            |message: String| Finding::new(Severity::Warning, Code::LogTime, file, message, 0);
        if self.log_time {
            return warning(format!(
                "time on topic `{name}` is the recorder's log time, as [columns] time says: it jitters with the network and the recorder's load"
            ));
        }
        let behind = Some(others).filter(|lag| *lag > TOGETHER_NS);
        let beside = behind.map_or_else(String::new, |lag| {
            format!(
                "; the stamps of the others are {:.3} ms before that clock on average, so that this topic may be late by as much beside them: [columns] time = \"log_time\" \
                 takes that clock for all mapped topics",
                lag / 1e6
            )
        });
        warning(format!(
            "messages on topic `{name}` ({kind}) have neither header.stamp nor stamp: time is the recorder's log time, which jitters with the network and the recorder's load{beside}; if another field holds the time, say [columns] time = \"{}:field\"{}",
            self.asked, found.stamp_words
        ))
        .with(behind.map(|lag| ("lag_of_others", lag / 1e9)))
    }

    /// The config's time, else the message's own stamp where it is `there`, else the recorder's.
    fn time_source(&self, there: impl Fn(&[Step]) -> bool) -> Time {
        if self.log_time {
            return Time::Log;
        }
        if let Some(source) = &self.time {
            let words = super::path::Written(&source.steps).to_string();
            return Time::Path(source.steps.clone(), words);
        }
        let field = |name: &str| Step::Field(name.to_owned());
        for steps in [vec![field("header"), field("stamp")], vec![field("stamp")]] {
            if there(&steps) {
                let words = super::path::Written(&steps).to_string();
                return Time::Path(steps, words);
            }
        }
        Time::Log
    }
}

impl Reading {
    /// Refuses stamps that nobody filled in.
    fn refuse_constant_stamps(&self, file: &str) -> Result<()> {
        let Self { name, kind, .. } = self;
        match &self.time {
            Some(Time::Path(_, words)) if self.messages > 1 && !self.stamps_differ => Err(refuse(
                file,
                format!(
                    "topic `{name}` ({kind}): {words} is {} s in all {} messages",
                    self.first_stamp as f64 / 1e9,
                    self.messages
                ),
                "take another field with [columns] time = \"/topic:field\", or the recorder's clock with [columns] time = \"log_time\"",
            )),
            _ => Ok(()),
        }
    }
}

/// How messages of this encoding and schema are read.
///
/// # Errors
/// What cannot be read, in words with a remedy.
fn form(encoding: &str, schema: Option<&Schema>) -> std::result::Result<Form, String> {
    let (encoding, language) = match encoding {
        "json" => return Ok(Form::Json),
        "cdr" => (Encoding::Cdr, "ros2msg"),
        "ros1" => (Encoding::Ros1, "ros1msg"),
        other => {
            return Err(format!(
                "messages in `{other}` cannot be read, only cdr, ros1 and json can; export the topic as JSON in MCAP, CSV or Parquet"
            ));
        }
    };
    let Some(schema) = schema else {
        return Err("its schema is missing from the file; record it again with its schema".into());
    };
    if schema.language != language && !schema.text.is_empty() {
        return Err(format!(
            "its definition is in `{}`, which cannot be read, only {language} can; record the type from a .msg file, or export the topic to CSV or Parquet",
            schema.language
        ));
    }
    let parsed = Definition::parse(&schema.kind, &schema.text, encoding);
    let definition = parsed.map_err(|problem| {
        let where_from = if schema.text.is_empty() {
            "the file holds no message definitions (SQLite bags do since ROS 2 Iron)"
        } else {
            "its definition cannot be read"
        };
        format!(
            "{where_from}: {problem}; where the message's package is installed, `ros2 bag convert` to MCAP writes definitions"
        )
    })?;
    Ok(Form::Binary {
        definition: Box::new(definition),
        plan: None,
    })
}
