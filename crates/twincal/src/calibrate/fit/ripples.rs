//! Gear ripple that nobody asked for: residual torque that repeats many times per turn of its joint, whatever the speed.
//!
//! What is looked at, and what is told; which order it is, [`search`] says.

mod search;

use crate::error::Code;
use crate::error::{Finding, Severity};
use crate::observations::Part;
use crate::plug_in::{Fit, residual_correlation_time};
use crate::robot::{JointKind, Robot};
use crate::signal::Pipeline;
use crate::term::LibrarySettings;
use rayon::prelude::*;
use search::{Ripple, Row, strongest};
use std::f64::consts::TAU;

/// Rows that are looked at, evenly spread.
const ROWS: usize = 2048;

/// A ripple of a joint that is no candidate.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::calibrate) struct Seen {
    pub(in crate::calibrate) joint: String,
    /// Per turn (per metre of a slider), to what the motion tells apart.
    pub(in crate::calibrate) periods: f64,
    kind: JointKind,
    ripple: Ripple,
}

/// What the residuals of a fit show.
pub(in crate::calibrate) fn seen(
    robot: &Robot,
    training: &[Part<'_>],
    fit: &Fit,
    library: &LibrarySettings,
    pipeline: &Pipeline,
) -> Vec<Seen> {
    let cutoff_hz = if pipeline.is_off() {
        f64::INFINITY
    } else {
        pipeline.cutoff_hz
    };
    let reach = 0.5 * pipeline.kernel_length();
    let names = robot.joint_names();
    let found: Vec<Option<Seen>> = (names.par_iter().enumerate())
        .map(|(joint, name)| {
            if library.ripple.contains_key(*name) {
                return None;
            }
            let (rows, step) = rows(training, joint, &fit.posterior.mean, reach);
            let memory = residual_correlation_time(training, joint, &fit.posterior.mean);
            let memory = f64::max(1.0, memory / step as f64);
            let kind = robot.joint_kind(joint);
            let (ripple, told_apart) = strongest(rows, per(kind), memory, cutoff_hz)?;
            Some(Seen::new(name, kind, ripple, told_apart))
        })
        .collect();
    found.into_iter().flatten().collect()
}

impl Seen {
    /// `told_apart`: difference of orders that the motion can tell.
    fn new(joint: &str, kind: JointKind, ripple: Ripple, told_apart: f64) -> Self {
        // Digits below a tenth of what can be told mean nothing.
        let per = per(kind);
        let digits = (-(0.1 * told_apart / per).log10()).ceil().clamp(0.0, 6.0);
        let scale = 10_f64.powi(digits as i32);
        Self {
            joint: joint.to_owned(),
            periods: (ripple.order / per * scale).round() / scale,
            kind,
            ripple,
        }
    }

    /// Where other families than the usual ones were asked for: the line that asks for this one.
    pub(in crate::calibrate) fn told(&self) -> Finding {
        let remedy = "makes it a candidate";
        self.finding(Severity::Warning, Code::RippleSeen, "gear ripple; ", remedy)
    }

    /// Where it became a candidate.
    pub(in crate::calibrate) fn added(&self) -> Finding {
        let what = "gear ripple, which is a candidate now; ";
        let remedy = "states it, another number or family chooses otherwise";
        self.finding(Severity::Note, Code::RippleAdded, what, remedy)
    }

    fn finding(&self, severity: Severity, code: Code, what: &str, remedy: &str) -> Finding {
        let Self {
            joint,
            periods,
            kind,
            ripple,
        } = self;
        let unit = kind.torque_unit();
        let per = match kind {
            JointKind::Prismatic => "metre",
            _ => "turn",
        };
        Finding::new(
            severity,
            code,
            joint.clone(),
            format!(
                "joint `{joint}`: what the model leaves over repeats {periods} times per {per}, {:.3} {unit} at its height, {:.0} % of the \
                 variance of its rows away from its velocity reversals, over {} periods forwards and {} backwards, {:.0} nats: {what}\
                 [library] ripple = {{ {joint:?} = {periods} }} {remedy}",
                ripple.amplitude,
                100.0 * ripple.share,
                ripple.forwards,
                ripple.backwards,
                ripple.gain,
            ),
            0,
        )
        .with([
            ("periods", *periods), ("amplitude", ripple.amplitude), ("share", ripple.share),
            ("periods_forwards", ripple.forwards as f64),
            ("periods_backwards", ripple.backwards as f64), ("nats", ripple.gain),
        ])
    }
}

/// Order of one period per turn, or per metre.
fn per(kind: JointKind) -> f64 {
    if kind == JointKind::Prismatic {
        TAU
    } else {
        1.0
    }
}

/// Every `step`-th row of a joint away from its velocity reversals, at most [`ROWS`]; and that step.
fn rows(training: &[Part<'_>], joint: usize, beta: &[f64], reach: f64) -> (Vec<Row>, usize) {
    let mut rows = Vec::new();
    for part in training {
        let residual = part.residual(joint, beta, part.rows.clone());
        let standstill = &part.observations.joints[joint].standstill[part.rows.clone()];
        let position = part.observations.q[joint].some(part.rows.clone());
        let velocity = part.observations.qd[joint].some(part.rows.clone());
        let time = &part.observations.time[part.rows.clone()];
        let away = away(time, &velocity, standstill, reach);
        for (row, _) in away.iter().enumerate().filter(|(_, away)| **away) {
            rows.push(Row {
                position: position[row],
                velocity: velocity[row],
                residual: residual[row],
            });
        }
    }
    let step = rows.len().div_ceil(ROWS).max(1);
    (rows.into_iter().step_by(step).collect(), step)
}

/// True for rows more than `reach` seconds, half a filter's length, from where the joint stands still or turns round: what friction does
/// there, no candidate has exactly, and the filter spreads it so far.
fn away(time: &[f64], velocity: &[f64], standstill: &[bool], reach: f64) -> Vec<bool> {
    let mut turns = Vec::new();
    for (row, still) in standstill.iter().enumerate() {
        if *still {
            turns.push(time[row]);
        }
        if row + 1 < time.len() && velocity[row] * velocity[row + 1] < 0.0 {
            turns.push(0.5 * (time[row] + time[row + 1]));
        }
    }
    let near = |t: f64| {
        let next = turns.partition_point(|turn| *turn < t - reach);
        turns.get(next).is_some_and(|turn| *turn <= t + reach)
    };
    time.iter().map(|t| !near(*t)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_near_a_turn_or_a_standstill_do_not_count() {
        // Forwards for a second, backwards for a second, and standing still in the last row.
        let time: Vec<f64> = (0..21).map(|i| 0.1 * f64::from(i)).collect();
        let velocity: Vec<f64> = (0..21).map(|i| if i < 10 { 1.0 } else { -1.0 }).collect();
        let mut standstill = vec![false; 21];
        standstill[20] = true;
        let rows = |reach| {
            let away = away(&time, &velocity, &standstill, reach);
            let kept = away.iter().enumerate().filter(|(_, away)| **away);
            kept.map(|(row, _)| row).collect::<Vec<usize>>()
        };
        // It turned round at 0.95 s.
        assert_eq!(rows(0.0), (0..20).collect::<Vec<_>>());
        assert_eq!(rows(0.21), [0, 1, 2, 3, 4, 5, 6, 7, 12, 13, 14, 15, 16, 17]);
        assert_eq!(rows(1.2), [0; 0]);
    }

    #[test]
    fn a_finding_gives_the_line_to_add() {
        let ripple = Ripple {
            order: 30.7234,
            amplitude: 0.48,
            share: 0.703,
            gain: 110.0,
            forwards: 28,
            backwards: 27,
            least: 0.6,
        };
        let seen = Seen::new("joint_4", JointKind::Revolute, ripple, 0.25);
        assert_eq!(seen.periods, 30.72);
        let (told, added) = (seen.told(), seen.added());
        for said in [&told.message, &added.message] {
            assert!(
                said.contains("repeats 30.72 times per turn, 0.480 N·m"),
                "{said}"
            );
            assert!(
                said.contains("N·m at its height, 70 % of the variance of its rows away from its velocity reversals, over 28 periods forwards and 27 backwards, 110 nats"),
                "{said}"
            );
            assert!(
                said.contains("[library] ripple = { \"joint_4\" = 30.72 }"),
                "{said}"
            );
        }
        assert_eq!(
            (told.code, added.code),
            (Code::RippleSeen, Code::RippleAdded)
        );
        let slider = Ripple {
            order: 200.04 * TAU,
            ..ripple
        };
        let seen = Seen::new("rail", JointKind::Prismatic, slider, 1.0 / 0.5);
        let said = seen.told().message;
        assert!(said.contains("repeats 200.04 times per metre"), "{said}");
        assert!(said.contains(" N at its height"), "{said}");
    }
}
