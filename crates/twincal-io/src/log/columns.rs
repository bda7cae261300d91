//! Which column is which channel of which joint.
//!
//! | first wins | position | velocity | acceleration | torque |
//! |---|---|---|---|---|
//! | `[columns]` in the config, by joint or one name with `*` for all | `q` | `qd` | `qdd` | `tau` |
//! | joint name and word, joined by `.`, `/`, `_` or `:`, either first | `q`, `pos`, `position`, `angle`; the bare joint name | `qd`, `dq`, `vel`, `velocity`, `speed` | `qdd`, `ddq`, `acc`, `accel`, `acceleration` | `tau`, `torque`, `effort`, `force`, `tau_meas` |
//! | word and number, with or without `_` or in `[]`, 1 = first moving joint | `q1` | `qd1` | `qdd1` | `tau1` |
//!
//! Temperatures of the drives are read where `[columns] temperature` or a preset names them; they explain drift.
//!
//! Time is `t`, `time`, `timestamp`, `stamp`, `sec`, `secs` or `seconds`, a unit may follow (`time_s`, `time [s]`, `t_ms`). Letter case is
//! free where that leaves one column.

mod configured;
mod named;

use super::{LogOptions, preset};
use crate::error::{Error, Place, Result};
use configured::by_joint_name;
pub(crate) use configured::has_columns;
pub(super) use configured::refuse_unknown_joints;
use named::Header;
use std::collections::{BTreeMap, BTreeSet};
use twincal::robot::{Robot, did_you_mean};
use twincal::words::{listed, quoted};
use twincal::{Code, Finding, Severity};

/// Words for position, velocity, acceleration, torque.
const WORDS: [&[&str]; 4] = [
    &["q", "pos", "position", "angle"],
    &["qd", "dq", "vel", "velocity", "speed"],
    &["qdd", "ddq", "acc", "accel", "acceleration"],
    &["tau", "torque", "effort", "force", "tau_meas"],
];
const QUANTITIES: [&str; 5] = [
    "position",
    "velocity",
    "acceleration",
    "torque",
    "temperature",
];
const TIME_WORDS: [&str; 7] = ["t", "time", "timestamp", "stamp", "sec", "secs", "seconds"];
const UNITS: [&str; 8] = ["s", "sec", "secs", "seconds", "ms", "us", "ns", "µs"];

/// Words in names of columns that hold what the controller computed: UR's and Franka's.
const MODEL_TORQUE: [&str; 3] = ["target_moment", "target_torque", "tau_j_d"];

/// Whether a name is the word for a channel.
pub(super) fn is_channel(name: &str) -> bool {
    let lower = name.to_lowercase();
    WORDS.iter().any(|words| words.contains(&lower.as_str()))
}

/// A column of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Its index in the file.
    pub index: usize,
    /// Its name in the file.
    pub name: String,
}

/// The columns that a recording is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// Time stamps.
    pub time: Option<Channel>,
    /// Position, velocity, acceleration, torque of each moving joint; position is always there.
    pub joints: Vec<[Option<Channel>; 4]>,
    /// Temperature of each moving joint's drive; empty: none.
    pub temperatures: Vec<Option<Channel>>,
    /// How the columns were matched.
    pub findings: Vec<Finding>,
}

/// Where the channels of a [`Selection`] stand among the columns that were read.
pub(crate) struct Positions {
    pub(crate) time: Option<usize>,
    pub(crate) joints: Vec<[Option<usize>; 4]>,
    pub(crate) temperatures: Vec<Option<usize>>,
}

impl Selection {
    /// Columns to read, time first, then joint by joint, then temperatures.
    pub fn file_columns(&self) -> Vec<usize> {
        let joints = self.joints.iter().flatten().flatten();
        let temperatures = self.temperatures.iter().flatten();
        let all = self.time.iter().chain(joints).chain(temperatures);
        all.map(|c| c.index).collect()
    }

    pub(crate) fn positions(&self) -> Positions {
        let mut next = 0;
        let mut number = |present: bool| {
            let position = present.then_some(next);
            next += usize::from(present);
            position
        };
        let time = number(self.time.is_some());
        let joints = self
            .joints
            .iter()
            .map(|joint| joint.each_ref().map(|c| number(c.is_some())))
            .collect();
        let temperatures = self.temperatures.iter();
        let temperatures = temperatures.map(|c| number(c.is_some())).collect();
        Positions {
            time,
            joints,
            temperatures,
        }
    }
}

/// Decides which column of `header` is which channel; see the table at the top of this file.
///
/// # Errors
/// [`Error::Content`] for duplicate or too many columns, a mapped column that is not there or that two joints share, a joint in the log that the model
/// lacks, a moving joint of the model that the log lacks, numbering from 0, no time column without `--rate`.
pub fn match_columns(
    file: &str,
    header: &[String],
    robot: &Robot,
    options: &LogOptions,
) -> Result<Selection> {
    let preset = options.preset.is_none().then(|| preset::recognised(header));
    matched(file, header, robot, options).map_err(|error| match (error, preset.flatten()) {
        (
            Error::Content {
                place,
                problem,
                remedy,
            },
            Some(preset),
        ) => {
            let name = preset.name();
            let remedy = format!(
                "the columns are those of a recorder: say [[log]] preset = \"{name}\"; else {remedy}"
            );
            Error::content(place, problem, remedy)
        }
        (error, _) => error,
    })
}

/// See [`match_columns`].
fn matched(
    file: &str,
    header: &[String],
    robot: &Robot,
    options: &LogOptions,
) -> Result<Selection> {
    let mut names = header.to_vec();
    let options = &*preset::fill_in(&mut names, robot, options);
    let header = Header::new(file, &names)?;
    let joints = robot.joint_names();
    refuse_unknown_joints(file, &joints, options)?;
    let columns = &options.columns;
    let tables = [
        by_joint_name(&header, "q", &columns.q, &joints)?,
        by_joint_name(&header, "qd", &columns.qd, &joints)?,
        by_joint_name(&header, "qdd", &columns.qdd, &joints)?,
        by_joint_name(&header, "tau", &columns.tau, &joints)?,
    ];
    let temperatures = by_joint_name(&header, "temperature", &columns.temperature, &joints)?;
    let time = find_time(&header, options)?;
    let mut matched = Vec::with_capacity(joints.len());
    for (number, joint) in joints.iter().enumerate() {
        let mut channels = [const { None }; 4];
        for quantity in 0..4 {
            let key = ["q", "qd", "qdd", "tau"][quantity];
            channels[quantity] = match tables[quantity].get(*joint) {
                Some(column) => Some(header.mapped(key, column)?),
                None => by_joint(&header, joint, quantity)
                    .or_else(|| by_number(&header, number + 1, quantity))
                    .map(|index| header.channel(index)),
            };
        }
        matched.push(channels);
    }
    let temperature = |joint: &&str| {
        let column = temperatures.get(*joint);
        column
            .map(|column| header.mapped("temperature", column))
            .transpose()
    };
    let temperatures: Vec<Option<Channel>> =
        joints.iter().map(temperature).collect::<Result<_>>()?;
    refuse_shared_columns(file, &joints, &matched, &temperatures)?;
    refuse_foreign_joints(&header, robot, &matched)?;
    refuse_missing_joints(&header, &joints, &matched)?;
    refuse_model_torque(file, &joints, &matched, options)?;
    let findings = vec![say(file, &joints, &time, &matched, &temperatures)];
    Ok(Selection {
        time,
        joints: matched,
        temperatures,
        findings,
    })
}

/// Moving joints of the model for which a file has no position column; empty where the header itself is refused.
pub fn joints_without_column(
    file: &str,
    header: &[String],
    robot: &Robot,
    options: &LogOptions,
) -> Vec<String> {
    let Ok(header) = Header::new(file, header) else {
        return Vec::new();
    };
    let joints = robot.joint_names().into_iter().enumerate();
    joints
        .filter(|(number, joint)| {
            !options.columns.q.names(joint)
                && by_joint(&header, joint, 0).is_none()
                && by_number(&header, number + 1, 0).is_none()
        })
        .map(|(_, joint)| joint.to_owned())
        .collect()
}

fn find_time(header: &Header<'_>, options: &LogOptions) -> Result<Option<Channel>> {
    if let Some(name) = &options.columns.time {
        return header.mapped("time", name).map(Some);
    }
    let is_time = |name: &str| {
        let lower = name.to_lowercase();
        let parts: Vec<&str> = lower
            .split([' ', '_', '[', ']', '(', ')', '/', '.'])
            .filter(|part| !part.is_empty())
            .collect();
        match parts.as_slice() {
            [word] => TIME_WORDS.contains(word),
            [word, unit] => TIME_WORDS.contains(word) && UNITS.contains(unit),
            _ => false,
        }
    };
    // Words in the order of the list, then the first of their columns.
    let found = TIME_WORDS
        .iter()
        .find_map(|word| header.find(word))
        .or_else(|| header.names.iter().position(|name| is_time(name)));
    if found.is_none() && options.rate_hz.is_none() {
        return Err(Error::content(
            Place::file(header.file),
            format!(
                "has no time column (`t` or `time`); its columns are {}",
                quoted(header.names)
            ),
            "name it in [columns] time, or give the sampling rate with --rate HZ",
        ));
    }
    Ok(found.map(|index| header.channel(index)))
}

fn by_joint(header: &Header<'_>, joint: &str, quantity: usize) -> Option<usize> {
    for word in WORDS[quantity] {
        for join in [".", "/", "_", ":"] {
            if let Some(index) = header.find(&format!("{joint}{join}{word}")) {
                return Some(index);
            }
            if let Some(index) = header.find(&format!("{word}{join}{joint}")) {
                return Some(index);
            }
        }
    }
    if quantity == 0 {
        header.find(joint)
    } else {
        None
    }
}

fn by_number(header: &Header<'_>, number: usize, quantity: usize) -> Option<usize> {
    WORDS[quantity].iter().find_map(|word| {
        [
            format!("{word}{number}"),
            format!("{word}_{number}"),
            format!("{word}[{number}]"),
        ]
        .iter()
        .find_map(|name| header.find(name))
    })
}

/// Number of a numbered position column: `q7`, `q_7`, `pos[7]`.
fn numbered_position(name: &str) -> Option<usize> {
    let lower = name.to_lowercase();
    WORDS[0].iter().find_map(|word| {
        let rest = lower.strip_prefix(word)?;
        let digits = rest
            .strip_prefix('_')
            .or_else(|| rest.strip_prefix('[').and_then(|r| r.strip_suffix(']')))
            .unwrap_or(rest);
        digits
            .bytes()
            .all(|b| b.is_ascii_digit())
            .then(|| digits.parse().ok())?
    })
}

/// `joint` of a column `joint.position`, `joint/q` …: only the joints that are written like this can be told for sure.
fn dotted_joint(name: &str) -> Option<&str> {
    let (joint, word) = name.rsplit_once(['.', '/'])?;
    (WORDS[0].contains(&word.to_lowercase().as_str()) && !joint.is_empty()).then_some(joint)
}

/// One column cannot be measured at two joints.
fn refuse_shared_columns(
    file: &str,
    joints: &[&str],
    matched: &[[Option<Channel>; 4]],
    temperatures: &[Option<Channel>],
) -> Result<()> {
    let mut taken: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
    for (joint, (channels, temperature)) in matched.iter().zip(temperatures).enumerate() {
        for (quantity, channel) in channels.iter().chain([temperature]).enumerate() {
            let Some(channel) = channel else { continue };
            let Some((other, same)) = taken.insert(channel.index, (joint, quantity)) else {
                continue;
            };
            return Err(Error::content(
                Place::file(file),
                format!(
                    "column `{}` is taken as {} of joint `{}` and as {} of joint `{}`",
                    channel.name,
                    QUANTITIES[same],
                    joints[other],
                    QUANTITIES[quantity],
                    joints[joint]
                ),
                "give every joint columns of its own in [columns]",
            ));
        }
    }
    Ok(())
}

/// A position column of a joint that the model does not have (faults.md case 71).
fn refuse_foreign_joints(
    header: &Header<'_>,
    robot: &Robot,
    matched: &[[Option<Channel>; 4]],
) -> Result<()> {
    let used: BTreeSet<usize> = (matched.iter().flatten().flatten())
        .map(|channel| channel.index)
        .collect();
    let moving = robot.joint_names();
    let known: BTreeSet<String> = (robot.description().joints.iter())
        .map(|joint| joint.name.to_ascii_lowercase())
        .collect();
    let numbered_used = matched
        .iter()
        .filter_map(|joint| joint[0].as_ref())
        .any(|c| numbered_position(&c.name).is_some());
    for (index, name) in header.names.iter().enumerate() {
        if used.contains(&index) {
            continue;
        }
        let unknown = |joint: &&str| !known.contains(&joint.to_ascii_lowercase());
        if let Some(joint) = dotted_joint(name).filter(unknown) {
            return Err(Error::content(
                Place::file(header.file),
                format!("column `{name}`: the model has no joint `{joint}`"),
                format!(
                    "{}; rename the column, or map it in [columns]",
                    did_you_mean(joint, moving.iter().copied())
                ),
            ));
        }
        match numbered_position(name) {
            Some(0) if !matched.is_empty() => {
                return Err(Error::content(
                    Place::file(header.file),
                    format!("column `{name}`: joints are numbered from 1"),
                    "rename the columns q1, q2, …, or map them in [columns]",
                ));
            }
            Some(number) if number > matched.len() && numbered_used => {
                return Err(Error::content(
                    Place::file(header.file),
                    format!(
                        "column `{name}`: the model has only {} moving joints",
                        matched.len()
                    ),
                    format!(
                        "they are {}; name columns after joints, or map them in [columns]",
                        quoted(&moving)
                    ),
                ));
            }
            _ => {}
        }
    }
    Ok(())
}

/// A moving joint without a position column (faults.md case 72).
fn refuse_missing_joints(
    header: &Header<'_>,
    joints: &[&str],
    matched: &[[Option<Channel>; 4]],
) -> Result<()> {
    let missing: Vec<usize> = (0..joints.len())
        .filter(|&j| matched[j][0].is_none())
        .collect();
    let Some(&first) = missing.first() else {
        let silent: Vec<&str> = (0..joints.len())
            .filter(|&j| matched[j][3].is_none())
            .map(|j| joints[j])
            .collect();
        if silent.is_empty() || silent.len() == joints.len() {
            return Ok(());
        }
        return Err(Error::content(
            Place::file(header.file),
            format!("has torque columns, but none for joint {}", quoted(&silent)),
            "add them, map them in [columns] tau, or fix the joint with [model] locked",
        ));
    };
    let (problem, remedy);
    if missing.len() == joints.len() {
        problem = format!(
            "has no position column for any joint of the model; its columns are {}",
            quoted(header.names)
        );
        remedy = format!(
            "name columns `q1`, `qd1`, `tau1` … or `{}.q` …, or map them in [columns], as in q = \"axis*_pos\"",
            joints[first]
        );
    } else {
        let named = (missing.iter()).map(|&j| format!("`{}` (q{})", joints[j], j + 1));
        let locked = (missing.iter()).map(|&j| format!("{} = 0.0", key(joints[j])));
        problem = format!("has no position column for joint {}", listed(named, ", "));
        remedy = format!(
            "if it does not move, fix it with [model] locked = {{ {} }}; else add the column or map it in [columns] q",
            listed(locked, ", ")
        );
    }
    Err(Error::content(Place::file(header.file), problem, remedy))
}

/// Torque that is the controller's own model, not a measurement (faults.md case 31).
pub(super) fn refuse_model_torque(
    file: &str,
    joints: &[&str],
    matched: &[[Option<Channel>; 4]],
    options: &LogOptions,
) -> Result<()> {
    if options.torque.accept_model_torque {
        return Ok(());
    }
    for (joint, channels) in joints.iter().zip(matched) {
        let Some(torque) = &channels[3] else {
            continue;
        };
        let lower = torque.name.to_lowercase();
        if MODEL_TORQUE.iter().any(|word| lower.contains(word)) {
            return Err(Error::content(
                Place::file(file),
                format!(
                    "column `{}`, the torque of joint `{joint}`, is the controller's own model of the robot, not a measurement: fitted to it, a twin learns that model",
                    torque.name
                ),
                "use measured torque, or motor currents with [[log]] torque = \"current\" and drive_constant; if you mean it, say [[log]] accept_model_torque = true",
            ));
        }
    }
    Ok(())
}

/// A joint name as a TOML key.
fn key(name: &str) -> String {
    let bare = !name.is_empty()
        && name
            .bytes()
            .all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-');
    if bare {
        name.to_owned()
    } else {
        format!("\"{}\"", name.replace('\\', "\\\\").replace('"', "\\\""))
    }
}

/// The whole assignment as one note.
pub(super) fn say(
    file: &str,
    joints: &[&str],
    time: &Option<Channel>,
    matched: &[[Option<Channel>; 4]],
    temperatures: &[Option<Channel>],
) -> Finding {
    let mut parts = Vec::new();
    if let Some(time) = time {
        parts.push(format!("time = {}", time.name));
    }
    for (number, (joint, channels)) in joints.iter().zip(matched).enumerate() {
        let temperature = temperatures.get(number).and_then(Option::as_ref);
        let columns = channels.iter().flatten().chain(temperature);
        let columns: Vec<&str> = columns.map(|c| c.name.as_str()).collect();
        let missing: Vec<&str> = (0..4)
            .filter(|&k| channels[k].is_none())
            .map(|k| QUANTITIES[k])
            .collect();
        let missing = if missing.is_empty() {
            String::new()
        } else {
            format!(" (no {})", missing.join(", "))
        };
        parts.push(format!("{joint} = {}{missing}", columns.join(" ")));
    }
    Finding::new(Severity::Note, Code::Columns, file, parts.join("; "), 0)
}
