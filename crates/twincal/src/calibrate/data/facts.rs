//! What is known of the fit logs beside the sums over their rows.

use super::all_logs::Data;
use super::log::Log;
use super::log_summary::LogSummary;
use crate::excitation::{STATES, States};
use crate::observations::Observations;
use crate::signal::Payload;
use serde::{Deserialize, Serialize};

/// Of one log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct LogFacts {
    pub(crate) summary: LogSummary,
    /// First and last stamp, s; since 1970 where the log says so.
    pub(crate) ends: [f64; 2],
    pub(crate) payload: Payload,
    /// Range of the motion per joint: `[q_min, q_max, qd_min, qd_max, qdd_min, qdd_max]`.
    pub(crate) hull: Vec<[f64; 6]>,
    /// Rows evenly taken; in files they are numbers, beside this.
    #[serde(skip)]
    pub(crate) states: States,
}

impl LogFacts {
    /// Of a log that carried something or nothing.
    pub(in crate::calibrate) fn of(log: &Log, payload: Payload) -> Self {
        Self {
            summary: log.summary.clone(),
            ends: log.ends.map(|stamp| log.origin + stamp),
            payload,
            hull: hull(&log.observations),
            states: states(&log.observations),
        }
    }
}

/// Of all fit logs.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::calibrate) struct Facts {
    /// What the robot carried in each log.
    pub(in crate::calibrate) payloads: Vec<Payload>,
    /// See [`super::all_logs::tell_payload_apart`].
    pub(in crate::calibrate) payload_apart: bool,
    /// Of the logs, and of the held-out ones behind them.
    pub(in crate::calibrate) summaries: Vec<LogSummary>,
    pub(in crate::calibrate) hull: Vec<[f64; 6]>,
    pub(in crate::calibrate) states: States,
}

impl Facts {
    /// Of these logs, and of the summaries of the held-out ones.
    pub(in crate::calibrate) fn of(logs: &[LogFacts], heldout: &[Log]) -> Self {
        let payloads: Vec<Payload> = logs.iter().map(|log| log.payload).collect();
        let unknown = |payload: &Payload| *payload == Payload::Unknown;
        let mut summaries: Vec<LogSummary> = logs.iter().map(|log| log.summary.clone()).collect();
        summaries.extend(heldout.iter().map(|log| log.summary.clone()));
        Self {
            payload_apart: payloads.iter().any(unknown) && !payloads.iter().all(unknown),
            payloads,
            summaries,
            hull: joined(logs),
            states: thinned(logs),
        }
    }
}

impl Facts {
    /// The same with the summaries of held-out logs.
    pub(in crate::calibrate) fn with_heldout(&self, heldout: &[Log]) -> Self {
        let mut all = self.clone();
        let summaries = heldout.iter().map(|log| log.summary.clone());
        all.summaries.extend(summaries);
        all
    }
}

impl Data {
    /// What is known of the fit logs beside their rows.
    pub(in crate::calibrate) fn facts(&self) -> Facts {
        let logs = self.fit.iter().zip(&self.payloads);
        let logs: Vec<LogFacts> = logs
            .map(|(log, payload)| LogFacts::of(log, *payload))
            .collect();
        Facts::of(&logs, &self.heldout)
    }
}

const NOWHERE: [f64; 6] = [
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::INFINITY,
    f64::NEG_INFINITY,
];

fn hull(rows: &Observations) -> Vec<[f64; 6]> {
    let of_joint = |joint: usize| {
        let mut hull = NOWHERE;
        let motion = [&rows.q[joint], &rows.qd[joint], &rows.qdd[joint]];
        for (ends, values) in hull.chunks_exact_mut(2).zip(motion) {
            for &value in &*values.get() {
                ends[0] = ends[0].min(value);
                ends[1] = ends[1].max(value);
            }
        }
        hull
    };
    (0..rows.joints.len()).map(of_joint).collect()
}

fn joined(logs: &[LogFacts]) -> Vec<[f64; 6]> {
    let joints = logs.first().map_or(0, |log| log.hull.len());
    let mut hull = vec![NOWHERE; joints];
    for log in logs {
        for (ends, own) in hull.iter_mut().zip(&log.hull) {
            for end in (0..6).step_by(2) {
                ends[end] = ends[end].min(own[end]);
                ends[end + 1] = ends[end + 1].max(own[end + 1]);
            }
        }
    }
    hull
}

/// At most [`STATES`] rows of a log.
fn states(rows: &Observations) -> States {
    let picked: Vec<usize> = (0..rows.len())
        .step_by(rows.len().div_ceil(STATES).max(1))
        .collect();
    let mut states = States {
        len: picked.len(),
        ..States::default()
    };
    for (joint, own) in rows.joints.iter().enumerate() {
        let [q, qd, qdd] = [&rows.q, &rows.qd, &rows.qdd].map(|motion| motion[joint].get());
        for &row in &picked {
            states.q.push(q[row]);
            states.qd.push(qd[row]);
            states.qdd.push(qdd[row]);
            states.still.push(own.standstill[row]);
        }
    }
    states
}

/// At most [`STATES`] of the states of all logs, which come in the order of their names.
fn thinned(logs: &[LogFacts]) -> States {
    let mut logs: Vec<&LogFacts> = logs.iter().collect();
    logs.sort_by(|a, b| a.summary.name.cmp(&b.summary.name));
    let all: Vec<(&States, usize)> = (logs.iter())
        .flat_map(|log| (0..log.states.len).map(|row| (&log.states, row)))
        .collect();
    let step = all.len().div_ceil(STATES).max(1);
    let picked: Vec<(&States, usize)> = all.into_iter().step_by(step).collect();
    let joints = logs.first().map_or(0, |log| log.hull.len());
    let mut states = States {
        len: picked.len(),
        ..States::default()
    };
    for joint in 0..joints {
        for (of, row) in &picked {
            let at = joint * of.len + row;
            states.q.push(of.q[at]);
            states.qd.push(of.qd[at]);
            states.qdd.push(of.qdd[at]);
            states.still.push(of.still[at]);
        }
    }
    states
}
