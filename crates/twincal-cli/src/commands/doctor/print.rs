//! The diagnosis as a person reads it.

use super::super::inspect::library::{directions, families};
use super::super::inspect::log_heading;
use super::super::summary::{indented, paragraph};
use super::super::table::{print_table, table};
use super::examine::Mapping;
use super::{Diagnosis, LogRow};
use crate::terminal::{Terminal, clean};
use twincal::Code;
use twincal::Severity;
use twincal::lag::{Lags, LogLag};
use twincal::words::significant;
use twincal_io::words::percent;

/// Remedies that come first.
const FIRST: usize = 3;
/// Columns that are named where they are not used.
const NAMED: usize = 8;
/// How lines begin that hold a remedy.
const HOW: [&str; 2] = ["     → ", "       "];
/// Notes on a log that are shown with it.
const OF_LOG: [Code; 6] = [
    Code::ControllerClock,
    Code::Gaps,
    Code::DuplicateRows,
    Code::Resampled,
    Code::WrappedAngle,
    Code::TimeReplaced,
];
/// Notes that say what was matched where there is no table of columns: on bags and NPZ files.
const OF_BAG: [Code; 3] = [Code::Columns, Code::TimeSource, Code::ModelOrder];
/// Share of torque by which the model must explain more than friction for its factor to mean anything.
const MEANS: f64 = 0.01;
/// What stands where nothing is known.
const NOTHING: &str = "–";

pub(super) fn print(diagnosis: &Diagnosis, terminal: &mut Terminal) {
    terminal.heading(&format!("{}: {}", diagnosis.model, diagnosis.verdict));
    for (number, remedy) in diagnosis.remedies.iter().take(FIRST).enumerate() {
        let number = format!("  {}. ", number + 1);
        indented(&remedy.problem, [&number, "     "], terminal);
        indented(&remedy.how, HOW, terminal);
    }
    let of_model = diagnosis.findings.iter();
    for finding in of_model.filter(|finding| finding.code == Code::PointMass) {
        paragraph(&format!("note: {}", finding.message), terminal);
    }
    terminal.say("");
    for words in &diagnosis.converted {
        let text = format!("{words}, for this look alone: what follows belongs to that");
        paragraph(&text, terminal);
    }
    for log in &diagnosis.logs {
        print_log(log, diagnosis.lags.as_ref(), terminal);
        for finding in &diagnosis.findings {
            let own = finding.subject == log.overview.name && finding.severity == Severity::Note;
            let matched = log.columns.is_none() && OF_BAG.contains(&finding.code);
            if own && (matched || OF_LOG.contains(&finding.code)) {
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
    if diagnosis.remedies.len() > FIRST {
        terminal.heading("Also");
        for remedy in &diagnosis.remedies[FIRST..] {
            indented(&remedy.problem, ["  - ", "    "], terminal);
            indented(&remedy.how, HOW, terminal);
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
    // Of logs of which nothing could be read `init` writes none.
    terminal.heading(match diagnosis.logs.is_empty() {
        true => "A twincal.toml to begin with",
        false => "A twincal.toml to begin with (twincal init writes it)",
    });
    for line in diagnosis.config.lines() {
        terminal.say(line);
    }
}

fn print_log(log: &LogRow, lags: Option<&Lags>, terminal: &mut Terminal) {
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
        let lag = lags.iter().flat_map(|lags| &lags.joints);
        let lag = lag
            .filter(|lag| lag.joint == joint.joint)
            .map(|lag| [lag.lag, lag.sd])
            .next();
        rows.add_row([
            &*clean(&joint.joint),
            &format!("{}…{}", significant(low, 3), significant(high, 3)),
            &step(steps.and_then(|steps| steps.position)),
            &agreement.map_or(NOTHING.into(), |a| format!("{:.3}", a.r2)),
            &(joint.tau_rms).map_or("not logged".into(), |tau| significant(tau, 3)),
            &step(steps.and_then(|steps| steps.torque)),
            &lag.map_or(NOTHING.into(), |[lag, sd]| {
                format!("{:+.1}±{:.1}", 1e3 * lag, 1e3 * sd)
            }),
        ]);
    }
    print_table(&rows, terminal);
    if let Some(lag) = &log.lag {
        paragraph(&lag_words(lag, lags), terminal);
    }
}

/// What a log says of its lag, and what becomes of it.
fn lag_words(log: &LogLag, lags: Option<&Lags>) -> String {
    // What all logs agree on is what is applied; that of one log counts where it differs, its error without what joints disagree by.
    let common = lags.and_then(|lags| lags.common);
    let own = match log.differs {
        true => log.common.filter(|_| common.is_some()),
        false => common.filter(|_| log.common.is_some()),
    };
    let Some([lag, sd]) = own else {
        return "the lag between motion and torque is inconclusive: no more than half of the joints agree on one, so that torque stays as logged".into();
    };
    let found = format!(
        "torque is logged {:.2} ± {:.2} ms ({:.2} samples) {} the motion",
        1e3 * lag.abs(),
        1e3 * sd,
        lag.abs() / log.interval,
        if lag < 0.0 { "before" } else { "after" }
    );
    match lags {
        _ if log.differs => format!("{found}, unlike the other logs"),
        Some(lags) if lags.clear => format!("{found}; fit moves it back"),
        _ => format!(
            "{found}: too little to change what left-out rows leave, so that torque stays as logged"
        ),
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
