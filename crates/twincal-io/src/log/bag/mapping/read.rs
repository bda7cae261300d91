//! The wanted numbers of one message.

use super::{Form, LOG_TIME, Mapped, Mapping, Reading, Time};
use crate::config::TimeUnit;
use crate::log::bag::decode::{self, MAX_MESSAGE, Plan, Walked};
use crate::log::bag::definition::Definition;
use crate::log::bag::path::Step;
use crate::log::bag::value::{At, Check, Joint, Number, Value, find, stamp_parts};
use std::mem::take;

/// Why a message was not taken.
pub(in super::super) enum Problem {
    /// It cannot be decoded.
    Broken(String),
    /// It does not have what the mapping asks; a remedy stands behind the last `;`.
    Unfit(String),
}

/// Where the wanted numbers stand in the messages of a topic.
pub(super) struct Places {
    plan: Plan,
}

/// What was taken from a message.
pub(in super::super) struct Sample {
    /// ns.
    pub(in super::super) stamp: i64,
    pub(in super::super) part: usize,
}

/// Places of the channels and of the time, what they rest on, and how `[*]` went.
#[derive(Default)]
struct Found {
    places: Vec<Vec<At>>,
    checks: Vec<(Vec<At>, Check)>,
    by_name: Vec<Option<bool>>,
}

impl Mapping {
    /// Reads a message of the mapped topic `number`; [`Mapping::values`] then has its values.
    ///
    /// # Errors
    /// Why it was not taken.
    pub(in super::super) fn read(
        &mut self,
        number: usize,
        log_time: u64,
        data: &[u8],
    ) -> Result<Sample, Problem> {
        let unit = self.unit;
        let Self { topics, joints, .. } = self;
        let names: Vec<&str> = joints.iter().map(String::as_str).collect();
        let topic = &mut topics[number];
        let Some(mut found) = topic.found.take() else {
            return Err(Problem::Broken("its topic is not known".into()));
        };
        let result = topic.sample(&mut found, unit, &names, log_time, data);
        topic.found = Some(found);
        result
    }

    /// Columns of the part and the values of the last message of a mapped topic.
    pub(in super::super) fn values(&self, number: usize) -> impl Iterator<Item = (usize, f64)> {
        let topic = &self.topics[number];
        let numbers = topic.found.iter().flat_map(|found| &found.numbers);
        let values = numbers.map(|number| number.value());
        topic.targets.iter().map(|target| target.column).zip(values)
    }
}

impl Mapped {
    fn sample(
        &self,
        found: &mut Reading,
        unit: Option<TimeUnit>,
        names: &[&str],
        log_time: u64,
        data: &[u8],
    ) -> Result<Sample, Problem> {
        match take(&mut found.form) {
            Form::Binary {
                definition,
                mut plan,
            } => {
                let walked = self.read_binary(found, (&definition, &mut plan), names, data);
                found.form = Form::Binary { definition, plan };
                if walked? == Walked::Changed {
                    return Err(Problem::Broken("its names cannot be told apart".into()));
                }
            }
            Form::Json => self.read_json(found, names, data)?,
        }
        let stamp = self.stamp(found, unit, log_time)?;
        if found.messages == 0 {
            found.first_stamp = stamp;
        }
        found.stamps_differ |= stamp != found.first_stamp;
        found.messages += 1;
        Ok(Sample {
            stamp,
            part: found.part,
        })
    }

    /// Numbers of a message by the plan of those before it; by a new plan where names are others.
    fn read_binary(
        &self,
        found: &mut Reading,
        (definition, plan): (&Definition, &mut Option<Places>),
        names: &[&str],
        data: &[u8],
    ) -> Result<Walked, Problem> {
        if let Some(places) = plan {
            let walked = decode::read(definition, data, &places.plan, &mut found.numbers)
                .map_err(Problem::Broken)?;
            if walked != Walked::Changed {
                return Ok(walked);
            }
        }
        let paths = self.paths(found.time.as_ref());
        let tree = decode::tree(definition, data, &paths).map_err(Problem::Broken)?;
        let new = self.find(&tree, found.time.as_ref(), names)?;
        let new_plan = Plan::new(definition, &new.places, new.checks.iter());
        let walked = decode::read(definition, data, &new_plan, &mut found.numbers);
        found.by_name = new.by_name;
        *plan = Some(Places { plan: new_plan });
        walked.map_err(Problem::Broken)
    }

    /// Numbers of a message in JSON.
    fn read_json(&self, found: &mut Reading, names: &[&str], data: &[u8]) -> Result<(), Problem> {
        if data.len() > MAX_MESSAGE {
            return Err(Problem::Broken(format!(
                "it has {} bytes, the limit for mapped topics is {MAX_MESSAGE}",
                data.len()
            )));
        }
        let json = serde_json::from_slice(data)
            .map_err(|e| Problem::Broken(format!("it is not JSON: {e}")))?;
        let tree = Value::of_json(json);
        if found.time.is_none() {
            let there = |steps: &[Step]| {
                let joint = Joint { number: 0, names };
                let place = find(&tree, steps, joint);
                place.is_ok_and(|place| stamp_parts(&tree, &place.at).is_some())
            };
            found.time = Some(self.time_source(there));
        }
        let new = self.find(&tree, found.time.as_ref(), names)?;
        found.by_name = new.by_name;
        found.numbers.clear();
        for (at, place) in new.places.iter().enumerate() {
            let number = tree.number(place).map_err(|what| {
                let path = self.targets.get(at).map_or("time", |t| &t.source.text);
                Problem::Unfit(format!(
                    "`{path}` is {what}, not a number; correct the path"
                ))
            })?;
            found.numbers.push(number);
        }
        Ok(())
    }

    /// Point in time of the message whose numbers were read, ns: its own, or when it was logged.
    fn stamp(
        &self,
        found: &mut Reading,
        unit: Option<TimeUnit>,
        log_time: u64,
    ) -> Result<i64, Problem> {
        let Some(Time::Path(_, words)) = &found.time else {
            return i64::try_from(log_time)
                .map_err(|_| Problem::Broken(format!("its {LOG_TIME} is {log_time} ns")));
        };
        let parts = &found.numbers[self.targets.len()..];
        let stamp =
            stamp(parts, unit).map_err(|what| Problem::Broken(format!("its {words} {what}")))?;
        found.lag += log_time as f64 - stamp as f64;
        Ok(stamp)
    }

    /// The steps of all that is wanted.
    fn paths<'p>(&'p self, time: Option<&'p Time>) -> Vec<&'p [Step]> {
        let targets = self.targets.iter();
        let mut paths: Vec<&[Step]> = targets.map(|t| &t.source.steps[..]).collect();
        if let Some(Time::Path(steps, _)) = time {
            paths.push(steps);
        }
        paths
    }

    /// Places of the channels in the order of the targets, then of the time.
    fn find(&self, tree: &Value, time: Option<&Time>, names: &[&str]) -> Result<Found, Problem> {
        let mut all = Found::default();
        for target in &self.targets {
            let joint = Joint {
                number: target.joint,
                names,
            };
            let found = find(tree, &target.source.steps, joint).map_err(|problem| {
                let key = super::KEYS[target.list];
                Problem::Unfit(format!(
                    "[columns] {key} = \"{}\": {problem}",
                    target.source.text
                ))
            })?;
            all.places.push(found.at);
            all.checks.extend(found.checks);
            all.by_name.push(found.by_name);
        }
        if let Some(Time::Path(steps, words)) = time {
            let joint = Joint { number: 0, names };
            let found = find(tree, steps, joint)
                .map_err(|problem| Problem::Unfit(format!("time `{words}`: {problem}")))?;
            match stamp_parts(tree, &found.at) {
                Some(parts) => all.places.extend(parts),
                None => all.places.push(found.at),
            }
            all.checks.extend(found.checks);
        }
        Ok(all)
    }
}

/// Time in ns of what stands in a message: seconds and nanoseconds, seconds, or ticks.
fn stamp(parts: &[Number], unit: Option<TimeUnit>) -> Result<i64, String> {
    let seconds = |seconds: f64| {
        let ns = (seconds * 1e9).round();
        if ns.abs() < 9.2e18 {
            Ok(ns as i64)
        } else {
            Err(format!("is {seconds} s"))
        }
    };
    match *parts {
        [Number::Whole(whole), Number::Whole(ns)] => {
            if !(0..1_000_000_000).contains(&ns) {
                return Err(format!("has {ns} ns"));
            }
            let whole_ns = whole.checked_mul(1_000_000_000);
            let sum = whole_ns.and_then(|whole| whole.checked_add(ns));
            sum.ok_or_else(|| format!("is {whole} s"))
        }
        [Number::Stamp(ns)] => Ok(ns),
        [Number::Whole(ticks)] => {
            let each = unit.unwrap_or(TimeUnit::Ns).nanoseconds();
            ticks.checked_mul(each).ok_or_else(|| format!("is {ticks}"))
        }
        [Number::Float(value)] => seconds(value / unit.unwrap_or(TimeUnit::S).ticks()),
        _ => Err("is no point in time".into()),
    }
}
