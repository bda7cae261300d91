//! The diagnosis as a person reads it.

use super::super::inspect::library::{directions, families};
use super::super::inspect::log_heading;
use super::super::summary::{indented, paragraph, percent};
use super::super::table::{print_table, table};
use super::examine::Mapping;
use super::{Diagnosis, LogRow};
use crate::terminal::{Terminal, clean};
use twincal::Severity;
use twincal::lag::LogLag;
use twincal::words::significant;

/// Mends that come first.
const FIRST: usize = 3;
/// Columns that are named where they are not used.
const NAMED: usize = 8;
/// How lines begin that say what mends.
const HOW: [&str; 2] = ["     → ", "       "];
/// Notes on a log that are shown with it.
const OF_LOG: [&str; 6] = [
    "controller_clock",
    "gaps",
    "duplicate_rows",
    "resampled",
    "wrapped_angle",
    "time_replaced",
];
/// Notes that say what was matched where there is no table of columns: on bags and NPZ files.
const OF_BAG: [&str; 3] = ["columns", "time_source", "model_order"];
/// Share of torque by which the model must explain more than friction for its factor to mean anything.
const MEANS: f64 = 0.01;
/// What stands where nothing is known.
const NOTHING: &str = "–";

pub(super) fn print(diagnosis: &Diagnosis, terminal: &mut Terminal) {
    terminal.heading(&format!("{}: {}", diagnosis.model, diagnosis.verdict));
    for (number, mend) in diagnosis.mends.iter().take(FIRST).enumerate() {
        let number = format!("  {}. ", number + 1);
        indented(&mend.problem, [&number, "     "], terminal);
        indented(&mend.how, HOW, terminal);
    }
    let of_model = diagnosis.findings.iter();
    for finding in of_model.filter(|finding| finding.code == "point_mass") {
        paragraph(&format!("note: {}", finding.message), terminal);
    }
    terminal.say("");
    for words in &diagnosis.converted {
        let text = format!("{words}, for this look alone: what follows belongs to that");
        paragraph(&text, terminal);
    }
    for log in &diagnosis.logs {
        print_log(log, terminal);
        for finding in &diagnosis.findings {
            let own = finding.subject == log.overview.name && finding.severity == Severity::Note;
            let code = finding.code.as_str();
            let matched = log.columns.is_none() && OF_BAG.contains(&code);
            if own && (matched || OF_LOG.contains(&code)) {
                paragraph(&finding.message, terminal);
            }
        }
        terminal.say("");
    }
    joints(diagnosis, terminal);
    if !diagnosis.components.is_empty() {
        families(&diagnosis.components, terminal);
        terminal.say("");
        let words = diagnosis.unseen.iter().map(String::as_str);
        directions(diagnosis.directions, words, terminal);
    }
    if diagnosis.mends.len() > FIRST {
        terminal.heading("Also");
        for mend in &diagnosis.mends[FIRST..] {
            indented(&mend.problem, ["  - ", "    "], terminal);
            indented(&mend.how, HOW, terminal);
        }
        terminal.say("");
    }
    let notes = diagnosis.findings.iter();
    let notes = notes.filter(|finding| finding.severity == Severity::Note);
    let notes = notes.count();
    if notes > 0 {
        terminal.say(&format!("  {notes} notes are in the output of --json"));
        terminal.say("");
    }
    terminal.heading("A twincal.toml to begin with (twincal init writes it)");
    for line in diagnosis.config.lines() {
        terminal.say(line);
    }
}

fn print_log(log: &LogRow, terminal: &mut Terminal) {
    log_heading(&log.overview, terminal);
    if let Some(columns) = &log.columns {
        mapping(columns, terminal);
    }
    let mut rows = table(&[
        "joint",
        "q from…to",
        "q step",
        "R²(q̇)",
        "torque rms",
        "step",
        "lag, ms",
    ]);
    for (index, joint) in log.overview.joints.iter().enumerate() {
        let steps = log.steps.get(index);
        let step = |step: Option<f64>| step.map_or(NOTHING.into(), |step| significant(step, 2));
        let [low, high] = joint.q_range;
        let agreement = log.velocity.get(index).copied().flatten();
        // One joint alone says nothing of the log's lag.
        let told = log.lag.iter().filter(|lag| lag.common.is_some());
        let lag = told.flat_map(|lag| &lag.joints);
        let lag = lag
            .filter(|lag| lag.joint == joint.joint && lag.speaks)
            .find_map(|lag| Some((lag.lag, lag.sd?)));
        rows.add_row([
            &*clean(&joint.joint),
            &format!("{}…{}", significant(low, 3), significant(high, 3)),
            &step(steps.and_then(|steps| steps.position)),
            &agreement.map_or(NOTHING.into(), |a| format!("{:.3}", a.r2)),
            &(joint.tau_rms).map_or("not logged".into(), |tau| significant(tau, 3)),
            &step(steps.and_then(|steps| steps.torque)),
            &lag.map_or(NOTHING.into(), |(lag, sd)| {
                format!("{:+.1}±{:.1}", 1e3 * lag, 1e3 * sd)
            }),
        ]);
    }
    print_table(&rows, terminal);
    if let Some(lag) = &log.lag {
        let text = match lag.common {
            Some([mean, sd]) => {
                let told = format!(
                    "torque is logged {:.2} ± {:.2} ms ({:.2} samples) {} the motion",
                    1e3 * mean.abs(),
                    1e3 * sd,
                    mean.abs() / lag.interval,
                    if mean < 0.0 { "before" } else { "after" }
                );
                match lag.clear() {
                    None if lag.slight().is_some() => format!(
                        "{told}: not for certain more than one sample, so that fit leaves it as it is: try [signal] lag = {mean:.4}, and keep it if it predicts held-out torque better"
                    ),
                    None => format!("{told}: {}", no_clear_lag(lag)),
                    Some(_) => told,
                }
            }
            None => "the lag between motion and torque cannot be told: too few joints whose torque the model explains".into(),
        };
        paragraph(&text, terminal);
    }
}

/// What follows from a lag that is short or no more than three of its errors: nothing; and why it is so loose.
fn no_clear_lag(lag: &LogLag) -> String {
    let sure = lag.joints.iter().filter(|joint| {
        let clear = |sd: f64| joint.lag.abs() > 3.0 * sd;
        joint.speaks && joint.sd.is_some_and(clear)
    });
    let ends = sure.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], joint| {
        [low.min(joint.lag), high.max(joint.lag)]
    });
    if ends[0] < ends[1] {
        format!(
            "the joints differ ({:+.1} to {:+.1} ms), so that no one lag is at work and nothing has to be done",
            1e3 * ends[0],
            1e3 * ends[1]
        )
    } else if lag.common.is_some_and(|[mean, sd]| mean.abs() > 3.0 * sd) {
        "less than half a sample, so that nothing has to be done".into()
    } else {
        "no more than its error, so that nothing has to be done".into()
    }
}

fn mapping(columns: &Mapping, terminal: &mut Terminal) {
    let mut rows = table(&["joint", "position", "velocity", "acceleration", "torque"]);
    let name = |column: &Option<String>| column.as_deref().map_or(NOTHING.into(), clean);
    for joint in &columns.joints {
        rows.add_row([
            &*clean(&joint.joint),
            &*name(&joint.position),
            &name(&joint.velocity),
            &name(&joint.acceleration),
            &name(&joint.torque),
        ]);
    }
    print_table(&rows, terminal);
    let time = name(&columns.time);
    let unused = match &columns.unused[..] {
        [] => "every column is used".to_owned(),
        names if names.len() <= NAMED => format!("not used: {}", names.join(", ")),
        names => format!(
            "not used: {} and {} more",
            names[..NAMED].join(", "),
            names.len() - NAMED
        ),
    };
    paragraph(
        &format!(
            "time: {time}; torque: taken as {}; {unused}",
            columns.torque
        ),
        terminal,
    );
}

fn joints(diagnosis: &Diagnosis, terminal: &mut Terminal) {
    if diagnosis.joints.is_empty() {
        return;
    }
    terminal.heading("Log against model: what explains the torque");
    let mut rows = table(&[
        "joint",
        "model and friction",
        "friction alone",
        "factor at the model",
        "read better as",
    ]);
    for joint in &diagnosis.joints {
        let share = |share: Option<f64>| share.map_or(NOTHING.into(), percent);
        let sign = |sign: f64| if sign < 0.0 { "−" } else { "" };
        let (motion, torque) = (&joint.motion, &joint.torque);
        let mut better = Vec::new();
        let from = clean(&motion.0);
        if motion.1 != joint.rates {
            better.push(format!("position {}{from}", sign(motion.1)));
            better.push(format!("velocity {}{from}", sign(joint.rates)));
        } else if (motion.0.as_str(), motion.1) != (joint.joint.as_str(), 1.0) {
            better.push(format!("motion {}{from}", sign(motion.1)));
        }
        if (torque.0.as_str(), torque.1) != (joint.joint.as_str(), 1.0) {
            better.push(format!("torque {}{}", sign(torque.1), clean(&torque.0)));
        }
        let model = joint.explained.zip(joint.without_model);
        let means = model.is_some_and(|(with, without)| with - without > MEANS);
        let gain = joint.gain.filter(|gain| *gain != 0.0 && means);
        rows.add_row([
            &*clean(&joint.joint),
            &share(joint.explained),
            &share(joint.without_model),
            &gain.map_or(NOTHING.into(), |gain| significant(gain, 3)),
            &better.join(", "),
        ]);
    }
    print_table(&rows, terminal);
    terminal.say("");
}
