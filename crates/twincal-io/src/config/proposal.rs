//! A `twincal.toml` to begin with: only the keys that a model and its logs ask for, each with the numbers behind it.

use super::{ChannelNames, ColumnsTable, LogEntry, PerJoint};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Width of a comment.
const WIDTH: usize = 78;

/// What a first config says.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Proposal {
    /// The command that gives it.
    pub command: String,
    /// Model file.
    pub model: PathBuf,
    /// Joints without a column, and where they are taken to stand.
    pub locked: BTreeMap<String, f64>,
    /// The line of `[model]` that says how the base stands, and why.
    pub base: Option<(String, String)>,
    /// Accept inertia tensors that no body has.
    pub allow_unphysical: bool,
    /// Logs with what is known of each.
    pub logs: Vec<LogEntry>,
    /// Columns that were mapped by hand, or must be; factors that logged numbers need.
    pub columns: ColumnsTable,
    /// Why they need them.
    pub factor_comment: String,
    /// Cut-off: "auto" (`None`) or Hz, and a comment on it.
    pub cutoff_hz: Option<f64>,
    /// Why.
    pub cutoff_comment: String,
    /// Lag of torque, s, and a comment on it.
    pub lag: Option<(f64, String)>,
    /// Velocity from position, and a comment on it.
    pub velocity_from_position: Option<String>,
    /// What no key can fix, at the top.
    pub remarks: Vec<String>,
}

impl Proposal {
    /// The file. Every key in it is read by [`super::Config::parse`].
    pub fn text(&self) -> String {
        let mut text = String::new();
        comment(&mut text, &format!("Proposed by `{}`.", self.command));
        comment(
            &mut text,
            "A flag overrides its key; `twincal schema` prints every key.",
        );
        for remark in &self.remarks {
            comment(&mut text, &format!("! {remark}"));
        }
        // Writing to a string cannot fail.
        let _ = writeln!(text, "\n[model]\nfile = {}", path(&self.model));
        if !self.locked.is_empty() {
            let joints = self.locked.iter();
            let joints: Vec<String> = joints
                .map(|(j, at)| format!("{} = {at:?}", key(j)))
                .collect();
            comment(
                &mut text,
                "The log has no column for these; they are taken to be at rest here (rad or m).",
            );
            let _ = writeln!(text, "locked = {{ {} }}", joints.join(", "));
        }
        if let Some((line, why)) = &self.base {
            comment(&mut text, why);
            let _ = writeln!(text, "{line}");
        }
        if self.allow_unphysical {
            text.push_str("allow = [\"unphysical_inertia\"]\n");
        }
        let logs = Logs { log: &self.logs };
        // Only a path that is no text cannot be written, and then the log could not be named either.
        if let Ok(logs) = toml::to_string(&logs) {
            let _ = write!(text, "\n{logs}");
        }
        self.write_columns(&mut text);
        text.push_str("\n[signal]\n");
        comment(&mut text, &self.cutoff_comment);
        match self.cutoff_hz {
            None => text.push_str("cutoff_hz = \"auto\"\n"),
            Some(hz) => {
                let _ = writeln!(text, "cutoff_hz = {hz:?}");
            }
        }
        if let Some((lag, why)) = &self.lag {
            comment(&mut text, why);
            let _ = writeln!(text, "lag = {lag:?}");
        }
        if let Some(why) = &self.velocity_from_position {
            comment(&mut text, why);
            text.push_str("velocity = \"position\"\n");
        }
        text
    }

    fn write_columns(&self, text: &mut String) {
        let tables = [
            ("q", &self.columns.q),
            ("qd", &self.columns.qd),
            ("qdd", &self.columns.qdd),
            ("tau", &self.columns.tau),
            ("temperature", &self.columns.temperature),
        ];
        let mut lines = Vec::new();
        if let Some(time) = &self.columns.time {
            lines.push(format!("time = {}", string(time)));
        }
        if let Some(unit) = self.columns.time_unit {
            lines.push(format!("time_unit = \"{}\"", unit.word()));
        }
        for (name, names) in tables {
            if let ChannelNames::All(all) = names {
                lines.push(format!("{name} = {}", string(all)));
            }
        }
        if !lines.is_empty() {
            let _ = writeln!(text, "\n[columns]\n{}", lines.join("\n"));
        }
        for (name, names) in tables {
            let ChannelNames::ByJoint(table) = names else {
                continue;
            };
            if table.is_empty() {
                continue;
            }
            let _ = writeln!(text, "\n[columns.{name}]");
            for (joint, column) in table {
                let _ = writeln!(text, "{} = {}", key(joint), string(column));
            }
        }
        if !self.columns.factor.is_empty() {
            text.push('\n');
            comment(text, &self.factor_comment);
            text.push_str("[columns.factor]\n");
        }
        for (name, factor) in self.columns.factor.channels() {
            let value = match factor {
                PerJoint::All(number) => format!("{number:?}"),
                PerJoint::ByJoint(factors) if factors.is_empty() => continue,
                PerJoint::ByJoint(factors) => {
                    let own = factors.iter().map(|(j, x)| format!("{} = {x:?}", key(j)));
                    format!("{{ {} }}", own.collect::<Vec<_>>().join(", "))
                }
            };
            let _ = writeln!(text, "{name} = {value}");
        }
    }
}

/// The entries `[[log]]`.
#[derive(Serialize)]
struct Logs<'a> {
    #[serde(serialize_with = "super::log_forms::serialize_entries")]
    log: &'a [LogEntry],
}

/// Lines of a comment.
fn comment(text: &mut String, words: &str) {
    let mut line = String::from("#");
    for word in words.split_whitespace() {
        if line.len() > 1 && line.chars().count() + 1 + word.chars().count() > WIDTH {
            text.push_str(&line);
            text.push('\n');
            line = String::from("#");
        }
        line.push(' ');
        line.extend(word.chars().filter(|c| !c.is_control()));
    }
    if line.len() > 1 {
        text.push_str(&line);
        text.push('\n');
    }
}

fn string(value: &str) -> String {
    toml::Value::String(value.into()).to_string()
}

fn path(value: &Path) -> String {
    string(&value.to_string_lossy())
}

/// A name as a key.
pub fn key(name: &str) -> String {
    let bare = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || b == b'-';
    if !name.is_empty() && name.bytes().all(bare) {
        name.into()
    } else {
        // A basic string: toml may write a value over several lines, but not a key.
        let escaped: String = name
            .chars()
            .map(|c| match c {
                '"' | '\\' => format!("\\{c}"),
                c if c.is_control() => format!("\\u{:04X}", u32::from(c)),
                c => c.to_string(),
            })
            .collect();
        format!("\"{escaped}\"")
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Config, FactorTable, LagOrAuto, TimeUnit, TorqueWord, VelocityWord};
    use super::*;

    /// A proposal with a value of every key, and an odd name among its joints.
    fn proposal() -> Proposal {
        let odd = "a \"b\\\u{7}.c";
        Proposal {
            command: "twincal init run.csv\n[evil]".into(),
            model: "arm.urdf".into(),
            locked: BTreeMap::from([("finger".into(), 0.0), (odd.into(), 0.5)]),
            base: Some((
                "base = { rpy = [0.0, 1.5, 0.0] }".into(),
                "on a wall".into(),
            )),
            allow_unphysical: true,
            logs: vec![
                LogEntry {
                    file: "run \"1\".csv".into(),
                    rate_hz: Some(500.0),
                    torque: Some(TorqueWord::Motor),
                    gear_ratio: BTreeMap::from([("elbow".into(), 50.0)]),
                    ..LogEntry::default()
                },
                LogEntry {
                    file: "b.csv".into(),
                    ..LogEntry::default()
                },
            ],
            columns: ColumnsTable {
                time: Some("stamp".into()),
                time_unit: Some(TimeUnit::Us),
                q: ChannelNames::from_iter([(odd.into(), "angle\n1".into())]),
                tau: ChannelNames::All("/arm \"1\":effort[*]".into()),
                factor: FactorTable {
                    q: PerJoint::All(0.017_453_292_519_943_295),
                    tau: PerJoint::ByJoint([(odd.into(), -1.0), ("b".into(), 0.001)].into()),
                    ..FactorTable::default()
                },
                ..ColumnsTable::default()
            },
            factor_comment: "Positions are in degrees.".into(),
            cutoff_hz: None,
            cutoff_comment: "gives 5 Hz. ".repeat(20),
            lag: Some((0.008, "8 ms".into())),
            velocity_from_position: Some("R² 0.5".into()),
            remarks: vec!["turn the sign of `elbow`".into()],
        }
    }

    #[test]
    fn every_key_is_read_back() {
        let proposal = proposal();
        let text = proposal.text();
        assert!(
            text.lines().all(|line| line.chars().count() <= 80),
            "{text}"
        );
        let config = Config::parse("twincal.toml", &text).unwrap();
        config.settings().unwrap();
        let file = &config.file;
        assert_eq!(file.model.locked, proposal.locked);
        assert_eq!(file.model.base.unwrap().rpy, [0.0, 1.5, 0.0]);
        assert_eq!(file.columns, proposal.columns);
        assert_eq!(
            file.signal.lag,
            Some(LagOrAuto::Given(PerJoint::All(0.008)))
        );
        assert_eq!(file.signal.velocity, Some(VelocityWord::Position));
        assert_eq!(file.log.entries, proposal.logs);
    }
}
