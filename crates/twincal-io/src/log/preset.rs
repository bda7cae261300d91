//! Column names of recorders that many people have.
//!
//! | preset | recorder | time | position | velocity | torque | temperature |
//! |---|---|---|---|---|---|---|
//! | `ur-rtde` | Universal Robots' RTDE `record.py`, and `ur_rtde` | `timestamp` | `actual_q_0` | `actual_qd_0` | `actual_current_0`, A | `joint_temperatures_0` |
//! | `franka` | libfranka's `logToCSV` | `duration` or `time`, ms | `q[0]`, `state.q[0]` | `dq[0]` | `tau_J[0]` | |
//!
//! Both count joints from 0. What `[columns]` says goes first.

use super::LogOptions;
use crate::config::ChannelNames;
use std::borrow::Cow;
use std::collections::BTreeSet;
use twincal::robot::Robot;

/// A recorder whose column names are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    /// Universal Robots, RTDE.
    UrRtde,
    /// Franka, libfranka.
    Franka,
}

impl Preset {
    /// As in the config.
    pub fn name(self) -> &'static str {
        match self {
            Self::UrRtde => "ur-rtde",
            Self::Franka => "franka",
        }
    }

    /// Ticks of its clock per second.
    pub(super) fn ticks(self) -> f64 {
        match self {
            Self::UrRtde => 1.0,
            Self::Franka => 1e3,
        }
    }

    /// Names before and behind the joint's number: position, velocity, torque, temperature.
    fn names(self) -> [&'static [(&'static str, &'static str)]; 4] {
        match self {
            Self::UrRtde => [
                &[("actual_q_", "")],
                &[("actual_qd_", "")],
                &[("actual_current_", "")],
                &[("joint_temperatures_", "")],
            ],
            Self::Franka => [
                &[("state.q[", "]"), ("q[", "]"), ("q_", "")],
                &[("state.dq[", "]"), ("dq[", "]"), ("dq_", "")],
                &[("state.tau_J[", "]"), ("tau_J[", "]"), ("tau_J_", "")],
                &[],
            ],
        }
    }

    fn times(self) -> &'static [&'static str] {
        match self {
            Self::UrRtde => &["timestamp"],
            Self::Franka => &["duration", "time"],
        }
    }
}

/// The recorder whose names of positions and torques stand in a header: what to say of a table whose own names say too little.
pub(super) fn recognised(header: &[String]) -> Option<Preset> {
    let has = |patterns: &[(&str, &str)]| {
        let mut names = patterns
            .iter()
            .map(|(before, behind)| format!("{before}0{behind}"));
        names.any(|name| header.contains(&name))
    };
    [Preset::UrRtde, Preset::Franka].into_iter().find(|preset| {
        let [q, _, tau, _] = preset.names();
        has(q) && has(tau)
    })
}

/// The options with the preset's columns filled in where `[columns]` is silent. libfranka repeats names of the state in the command:
/// the second gets a number.
pub(super) fn fill_in<'a>(
    header: &mut [String],
    robot: &Robot,
    options: &'a LogOptions,
) -> Cow<'a, LogOptions> {
    let Some(preset) = options.preset else {
        return Cow::Borrowed(options);
    };
    if preset == Preset::Franka {
        let mut seen = BTreeSet::new();
        for name in header.iter_mut() {
            if !seen.insert(name.clone()) {
                name.push_str(" (2)");
            }
        }
    }
    let mut filled = options.clone();
    let has = |name: &str| header.iter().any(|column| column == name);
    let columns = &mut filled.columns;
    if columns.time.is_none() {
        let time = preset.times().iter().find(|name| has(name));
        columns.time = time.map(|name| (*name).to_owned());
    }
    let tables = [
        &mut columns.q,
        &mut columns.qd,
        &mut columns.tau,
        &mut columns.temperature,
    ];
    for (table, patterns) in tables.into_iter().zip(preset.names()) {
        for (number, joint) in robot.joint_names().into_iter().enumerate() {
            let name = patterns
                .iter()
                .map(|(before, behind)| format!("{before}{number}{behind}"))
                .find(|name| has(name));
            if let (Some(name), ChannelNames::ByJoint(table)) = (name, &mut *table) {
                table.entry(joint.to_owned()).or_insert(name);
            }
        }
    }
    Cow::Owned(filled)
}
