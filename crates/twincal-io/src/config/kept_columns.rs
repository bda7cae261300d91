//! `[columns]` of a fit, for the logs that come after it: key by key where a config says nothing itself, and only as far as a log has
//! the columns.

use super::{ChannelNames, ColumnsTable, FactorTable, PerJoint, ReadAs};
use crate::log::{LogOptions, has_columns};
use twincal::words::listed;
use twincal::{Code, Finding, Severity};

/// Channels that a log may lack.
const OPTIONAL: [&str; 4] = ["qd", "qdd", "tau", "temperature"];

/// One way to read a new log.
#[derive(Debug, Clone, PartialEq)]
pub struct Attempt {
    /// How it is read.
    pub options: LogOptions,
    /// Keys of the fit's `[columns]` that hold for it.
    pub kept: Vec<&'static str>,
    /// Keys of the fit's `[columns]` whose columns the log does not have.
    pub given_up: Vec<&'static str>,
}

impl Attempt {
    fn new(options: &LogOptions, columns: &ColumnsTable, without: &[&'static str]) -> Self {
        let mut attempt = Self {
            options: options.clone(),
            kept: Vec::new(),
            given_up: Vec::new(),
        };
        let own = &mut attempt.options.columns;
        let (kept, given_up) = (&mut attempt.kept, &mut attempt.given_up);
        // Whether a key of the fit holds that the config does not state.
        let mut holds = |key: &'static str, said: bool| {
            let up = without.contains(&key);
            if said && up {
                given_up.push(key);
            } else if said {
                kept.push(key);
            }
            said && !up
        };
        for ((key, names), (_, fitted)) in own.channels_mut().into_iter().zip(columns.channels()) {
            if holds(key, names.is_empty() && !fitted.is_empty()) {
                names.clone_from(fitted);
            }
        }
        if holds("time", own.time.is_none() && columns.time.is_some()) {
            own.time.clone_from(&columns.time);
        }
        // The unit belongs to the column, where the fit named one.
        let up = without.contains(&"time") && columns.time.is_some();
        if holds(
            "time_unit",
            own.time_unit.is_none() && columns.time_unit.is_some() && !up,
        ) {
            own.time_unit = columns.time_unit;
        }
        attempt
    }

    /// What is to be said of a log that was read so.
    pub fn findings(&self, log: &str) -> Vec<Finding> {
        let mut findings = Vec::new();
        let mut say = |severity, code: Code, message| {
            findings.push(Finding::new(severity, code, log, message, 0));
        };
        if !self.kept.is_empty() {
            let keys = self.kept.join(", ");
            let message = format!(
                "[columns] {keys} as in the fit; a key of [columns] in a --config says otherwise"
            );
            say(Severity::Note, Code::ColumnsAsFitted, message);
        }
        if !self.given_up.is_empty() {
            let keys = self.given_up.join(", ");
            let message = format!(
                "the log does not have the columns that [columns] {keys} named in the fit: columns with the usual names are taken where \
                 there are some; [columns] in a --config says otherwise"
            );
            say(Severity::Warning, Code::ColumnsNotAsFitted, message);
        }
        findings
    }
}

impl ReadAs {
    /// How a new log may be read, the likeliest way first; the next ones where it cannot be read so. `header` are the names of
    /// its columns where it is a table. A preset of its own says its columns.
    pub fn attempts(
        &self,
        options: &LogOptions,
        header: Option<&[String]>,
        joints: &[&str],
    ) -> Vec<Attempt> {
        let columns = &self.columns;
        if *columns == ColumnsTable::default() || options.preset.is_some() {
            return vec![Attempt::new(options, &ColumnsTable::default(), &[])];
        }
        let attempt = |without: &[&'static str]| Attempt::new(options, columns, without);
        let whole = attempt(&[]);
        let Some(header) = header else {
            let names = ["q", "qd", "qdd", "tau", "temperature", "time"];
            let mut all = vec![whole, attempt(&OPTIONAL), attempt(&names)];
            all.dedup_by(|b, a| a.options == b.options);
            return all;
        };
        let missing = |names: &ChannelNames| !has_columns(header, names, joints);
        let channels = columns.channels().into_iter();
        let mut without: Vec<&'static str> = channels
            .filter(|(_, names)| missing(names))
            .map(|(key, _)| key)
            .collect();
        if (columns.time.as_ref()).is_some_and(|time| !header.contains(time)) {
            without.push("time");
        }
        // Where the usual names do not do either, the error is about the columns of the fit.
        let mut all = vec![attempt(&without), whole];
        if without.is_empty() {
            all.truncate(1);
        }
        all
    }

    /// Has the numbers of new logs multiplied as those of the fit, for each channel and joint of which the settings say nothing. The
    /// answer is what holds because the fit said it, with the words for it.
    pub fn fill_in_factors(
        &self,
        own: &mut FactorTable,
        joints: &[&str],
    ) -> Option<(FactorTable, Finding)> {
        let mut kept = FactorTable::default();
        let mut told = Vec::new();
        let channels = (own.channels_mut().into_iter()).zip(self.factor.channels());
        for (((key, own), (_, fitted)), (_, kept)) in channels.zip(kept.channels_mut()) {
            let silent = |joint: &&&str| own.of_joint(joint).is_none();
            let from_fit = joints.iter().filter(silent).filter_map(|joint| {
                let number = fitted.of_joint(joint)?;
                Some(((*joint).to_owned(), number))
            });
            let from_fit: Vec<(String, f64)> = from_fit.collect();
            told.extend((from_fit.chunk_by(|a, b| a.1 == b.1)).map(|group| {
                let names: Vec<&str> = group.iter().map(|(joint, _)| joint.as_str()).collect();
                format!("{key} of {} by {}", listed(&names, ", "), group[0].1)
            }));
            *own = own.or(fitted, joints);
            *kept = PerJoint::ByJoint(from_fit.into_iter().collect());
        }
        if told.is_empty() {
            return None;
        }
        let message = format!(
            "logged numbers are multiplied as in the fit: {}; [columns] factor of a --config says otherwise (1.0: as it is logged)",
            listed(&told, "; ")
        );
        let finding = Finding::new(Severity::Note, Code::FactorAsFitted, "", message, 0);
        Some((kept, finding))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Config, LogSettings, TimeUnit};
    use std::path::{Path, PathBuf};

    fn settings(text: &str) -> LogSettings {
        let config = Config::parse("twincal.toml", text).expect("a config");
        config.settings().expect("good settings").log
    }

    const FIT: &str = "[columns]\ntime = \"stamp\"\ntime_unit = \"ms\"\nq = \"pos_*\"\ntau = { a = \"load\" }\n\
                       [columns.factor]\nq = 0.5\ntau = { a = -1.0 }\n";

    fn read_as() -> ReadAs {
        ReadAs::of(&settings(FIT), &[PathBuf::from("one.csv")])
    }

    /// How `new.csv` with these columns is read under a config: its first attempt.
    fn first(config: &str, header: &str) -> Attempt {
        let options = settings(config).options(Path::new("new.csv"));
        let header: Vec<String> = header.split(',').map(str::to_owned).collect();
        let mut all = read_as().attempts(&options, Some(&header), &["a", "b"]);
        all.swap_remove(0)
    }

    #[test]
    fn each_key_of_the_fit_holds_where_the_config_is_silent() {
        let all = first("", "stamp,pos_0,pos_1,load");
        assert_eq!(all.kept, ["q", "tau", "time", "time_unit"]);
        assert_eq!(all.given_up, [""; 0]);
        let columns = &all.options.columns;
        assert_eq!(columns.time_unit, Some(TimeUnit::Ms));
        assert_eq!(columns.q, ChannelNames::All("pos_*".into()));
        let config = "[columns]\ntau = { b = \"effort\" }\ntime_unit = \"us\"\n";
        let own = first(config, "stamp,pos_1,pos_2,load");
        assert_eq!(own.kept, ["q", "time"]);
        assert_eq!(own.options.columns.time_unit, Some(TimeUnit::Us));
        assert_eq!(own.options.columns.tau.of_joint("a"), None);
        assert!(own.findings("new.csv")[0].message.contains("q, time as in"));
    }

    #[test]
    fn what_a_log_does_not_have_is_given_up_and_told() {
        let usual = first("", "t,q1,q2,load");
        assert_eq!(
            (&usual.kept[..], &usual.given_up[..]),
            (&["tau"][..], &["q", "time"][..])
        );
        // milliseconds were those of the column `stamp`
        assert_eq!(usual.options.columns.time_unit, None);
        let said = usual.findings("new.csv");
        assert_eq!(said[1].code, Code::ColumnsNotAsFitted);
        assert!(
            said[1].message.contains("[columns] q, time named"),
            "{said:?}"
        );
        let preset = first("[log]\npreset = \"ur-rtde\"\n", "stamp,pos_0,pos_1");
        assert_eq!(preset.kept, [""; 0]);
    }

    #[test]
    fn factors_hold_for_what_the_config_does_not_name() {
        let mut own = settings("[columns.factor]\nq = { a = 1.0 }\n")
            .columns
            .factor;
        let (kept, finding) = read_as()
            .fill_in_factors(&mut own, &["a", "b"])
            .expect("kept");
        let numbers = |f: &FactorTable| {
            [("q", "a"), ("q", "b"), ("tau", "a")].map(|(key, joint)| {
                let channel = f.channels().into_iter().find(|(name, _)| *name == key);
                channel.and_then(|(_, factor)| factor.of_joint(joint))
            })
        };
        assert_eq!(numbers(&own), [Some(1.0), Some(0.5), Some(-1.0)]);
        assert_eq!(numbers(&kept), [None, Some(0.5), Some(-1.0)]);
        let words = "q of b by 0.5; tau of a by -1; ";
        assert!(finding.message.contains(words), "{}", finding.message);
        let mut all = settings("[columns.factor]\nq = 1.0\ntau = 1.0\n")
            .columns
            .factor;
        assert_eq!(read_as().fill_in_factors(&mut all, &["a", "b"]), None);
    }

    /// As versions before wrote it.
    #[test]
    fn a_twin_without_columns_is_read() {
        let old = r#"{"torque":null,"factor":{"q":0.5},"keys":["[columns]"]}"#;
        let old: ReadAs = serde_json::from_str(old).expect("an old twin");
        assert_eq!(old.columns, ColumnsTable::default());
        let mut own = FactorTable::default();
        assert!(old.fill_in_factors(&mut own, &["a"]).is_some());
        assert_eq!(own.q, PerJoint::All(0.5));
        assert!(old.hint().expect("a hint").contains("[columns]"));
        let text = serde_json::to_string(&read_as()).expect("text");
        assert_eq!(
            serde_json::from_str::<ReadAs>(&text).expect("read back"),
            read_as()
        );
    }
}
