//! `twincal inspect`: what a model and logs hold, before anything is fitted.

use self::library::{BaseRow, ComponentRow, base_row, component_rows};
use super::checkup::{Checkup, checkup};
use super::inputs::{LogInput, Long, RobotInput};
use super::settings::{Look, Usual};
use super::summary::{Notes, findings, paragraph};
use super::table::{print_table, table};
use super::{print_json, require_strict, settings, start_threads};
use crate::args::Inspect;
use crate::exit;
use crate::failure::Outcome;
use crate::progress::Progress;
use crate::terminal::{Terminal, clean};
use serde::Serialize;
use std::path::{Path, PathBuf};
use twincal::Finding;
use twincal::calibrate::{Outlook, outlook};
use twincal::excitation::Unseen;
use twincal::robot::{JointKind, Mimic, Robot};
use twincal::signal::{
    LogOverview, Pipeline, SignalSettings, choose_and_prepare, constant_torque, describe,
    hardly_driven,
};
use twincal::words::significant;

pub(super) mod library;

/// What `--json` prints.
#[derive(Serialize)]
struct Inspection {
    schema: u64,
    model: String,
    gravity: [f64; 3],
    /// Moving joints q1…qn in order, then those that mimic one of them.
    joints: Vec<JointRow>,
    links: Vec<LinkRow>,
    base_parameters: BaseRow,
    /// What `fit` would weigh, in order.
    components: Vec<ComponentRow>,
    /// Independent directions of all columns: over all motions of the robot, and in these logs; null without logs.
    directions: Option<[usize; 2]>,
    /// What these logs do not show and another motion would, most important first.
    unseen: Vec<UnseenRow>,
    logs: Vec<LogOverview>,
    findings: Vec<Finding>,
}

#[derive(Serialize)]
struct JointRow {
    name: String,
    #[serde(rename = "type")]
    kind: JointKind,
    /// 1-based index of its coordinate; null for a joint that mimics another.
    q: Option<usize>,
    mimic: Option<Mimic>,
    parent: String,
    child: String,
    armature: f64,
    damping: f64,
}

#[derive(Serialize)]
struct LinkRow {
    name: String,
    mass: Option<f64>,
}

#[derive(Serialize)]
struct UnseenRow {
    #[serde(flatten)]
    unseen: Unseen,
    words: String,
}

/// Whether a path is called as a model is, and no log.
fn is_model(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    matches!(ending, Some("urdf" | "xml" | "mjcf"))
}

pub(super) fn run(flags: &Inspect, terminal: &mut Terminal) -> Outcome<u8> {
    let look = Look {
        model: &flags.model,
        allow: &flags.allow,
        log: &flags.log,
        usual: Usual::unless(flags.no_config),
    };
    let config = settings::of_look(&look, terminal)?;
    let settings = config.settings()?;
    start_threads(settings.threads)?;
    let progress = Progress::new();
    // Without paths those of the config are looked at.
    let named = settings.log.named();
    let of_config = (settings.model_file.as_deref(), &named[..]);
    let (model, logs) = model_and_logs(flags, of_config)?;
    progress.step(&format!("reading {}", model.to_string_lossy()));
    let robot = RobotInput::read(model, &settings)?;
    let mut logs = LogInput::read(
        logs,
        &robot.robot,
        &settings.log,
        Long::of_settings(&settings),
        &progress,
    )?;
    if !logs.logs.is_empty() {
        progress.step("comparing logs and model");
    }
    let mut found = robot.findings;
    found.append(&mut logs.findings);
    let mut overviews = Vec::new();
    for log in &logs.logs {
        let (overview, more) = describe(&robot.robot, log).map_err(|error| logs.as_given(error))?;
        overviews.push(overview);
        found.extend(more);
    }
    found.extend(hardly_driven(&robot.robot, &logs.logs[..])?);
    found.extend(constant_torque(&robot.robot, &logs.logs[..])?);
    let (mut compared, more) = compare(&robot.robot, &logs, &settings.calibration.signal)?;
    for finding in more {
        if !found.contains(&finding) {
            found.push(finding);
        }
    }
    let aligned =
        (compared.as_mut()).map(|(pipeline, checkup)| (&*pipeline, checkup.looked_at(&logs.logs)));
    let outlook = outlook(&robot.robot, &settings.calibration.library, aligned)?;
    drop(progress);
    found.extend(outlook.findings.iter().cloned());
    require_strict(settings.log.strict, &found)?;
    let code = exit::of_findings(&found);
    let inspection = inspection(&robot.robot, robot.file.name, &outlook, overviews, found);
    if settings.json {
        print_json(terminal, &inspection)?;
    } else {
        print(&inspection, terminal);
    }
    Ok(code)
}

/// The model and the logs that are looked at: the paths of the command, or what the config names.
fn model_and_logs<'a>(
    flags: &'a Inspect,
    (model, named): (Option<&'a Path>, &'a [PathBuf]),
) -> Outcome<(&'a Path, &'a [PathBuf])> {
    match (model, flags.paths.split_first()) {
        (_, Some((first, logs))) if flags.model.is_none() && is_model(first) => Ok((first, logs)),
        (Some(model), Some(_)) => Ok((model, &flags.paths)),
        (Some(model), None) => Ok((model, named)),
        // Without a model by flag or config the first path is the model.
        (None, Some((model, logs))) => Ok((model, logs)),
        (None, None) => Err(super::no_model()),
    }
}

/// What the filters would warn of, and what log and model disagree about; nothing for logs that no pipeline fits (too short, standing still): `fit` says why.
fn compare(
    robot: &Robot,
    logs: &LogInput,
    signal: &SignalSettings,
) -> Outcome<(Option<Aligned>, Vec<Finding>)> {
    let Ok(chosen) = choose_and_prepare(robot, &logs.logs, signal) else {
        return Ok((None, Vec::new()));
    };
    let pipeline = chosen.pipeline;
    let mut found = checkup(robot, &logs.logs, &pipeline).map_err(|e| logs.as_given(e))?;
    let findings = std::mem::take(&mut found.findings);
    Ok((Some((pipeline, found)), findings))
}

/// The logs as a fit would filter them.
type Aligned = (Pipeline, Checkup);

fn inspection(
    robot: &Robot,
    model: String,
    outlook: &Outlook,
    logs: Vec<LogOverview>,
    findings: Vec<Finding>,
) -> Inspection {
    let description = robot.description();
    let names = robot.joint_names();
    let moving = (0..names.len()).map(|joint| (robot.joint(joint), Some(joint + 1)));
    let mimicking = description
        .joints
        .iter()
        .filter(|joint| joint.mimic.is_some())
        .map(|joint| (joint, None));
    let joints = moving
        .chain(mimicking)
        .map(|(joint, q)| JointRow {
            name: joint.name.clone(),
            kind: joint.kind,
            q,
            mimic: joint.mimic.clone(),
            parent: joint.parent.clone(),
            child: joint.child.clone(),
            armature: joint.armature,
            damping: joint.damping,
        })
        .collect();
    let link = |link: &twincal::robot::LinkDescription| LinkRow {
        name: link.name.clone(),
        mass: link.inertia.as_ref().map(|inertia| inertia.mass),
    };
    let links = description.links.iter().map(link).collect();
    let excitation = outlook.excitation.as_ref();
    let unseen = |unseen: &Unseen| UnseenRow {
        unseen: unseen.clone(),
        words: twincal::excitation::sentence(unseen),
    };
    Inspection {
        schema: 1,
        model,
        gravity: description.gravity,
        joints,
        links,
        base_parameters: base_row(robot),
        components: component_rows(&outlook.library, excitation),
        directions: excitation.map(|e| e.directions),
        unseen: excitation.map_or_else(Vec::new, |e| e.unseen.iter().map(unseen).collect()),
        logs,
        findings,
    }
}

fn print(inspection: &Inspection, terminal: &mut Terminal) {
    let [x, y, z] = inspection.gravity;
    terminal.heading(&format!(
        "{}: {} joints",
        inspection.model,
        inspection.joints.len()
    ));
    paragraph(
        &format!("gravity {x} {y} {z} m/s², {} links", inspection.links.len()),
        terminal,
    );
    print_joints(&inspection.joints, terminal);
    library::print(inspection, terminal);
    for log in &inspection.logs {
        print_log(log, terminal);
    }
    findings(&inspection.findings, Notes::Shown, terminal);
}

/// A row per joint: how it moves and what it connects.
fn print_joints(all: &[JointRow], terminal: &mut Terminal) {
    let mut joints = table(&["joint", "coordinate", "type", "parent", "child"]);
    for joint in all {
        let coordinate = match (joint.q, &joint.mimic) {
            (Some(q), _) => format!("q{q}"),
            (None, Some(mimic)) => format!("mimics {}", clean(&mimic.joint)),
            (None, None) => String::new(),
        };
        let kind = format!("{:?}", joint.kind).to_lowercase();
        joints.add_row([
            &*clean(&joint.name),
            &coordinate,
            &kind,
            &clean(&joint.parent),
            &clean(&joint.child),
        ]);
    }
    print_table(&joints, terminal);
    terminal.say("");
}

/// A row per joint of a log: where it moves, how fast, under which torque.
fn print_log(log: &LogOverview, terminal: &mut Terminal) {
    log_heading(log, terminal);
    let mut rows = table(&[
        "joint",
        "q from … to",
        "q sd",
        "velocity rms",
        "torque sd",
        "torque rms",
    ]);
    for joint in &log.joints {
        let number = |value: Option<f64>| {
            value.map_or_else(|| "not logged".into(), |value| significant(value, 3))
        };
        rows.add_row([
            &*clean(&joint.joint),
            &format!(
                "{} … {}",
                significant(joint.q_range[0], 3),
                significant(joint.q_range[1], 3)
            ),
            &significant(joint.q_sd, 3),
            &significant(joint.qd_rms, 3),
            &number(joint.tau_sd),
            &number(joint.tau_rms),
        ]);
    }
    print_table(&rows, terminal);
    terminal.say("");
}

/// Name, rows, length, rate and clock of a log.
pub(super) fn log_heading(log: &LogOverview, terminal: &mut Terminal) {
    terminal.heading(&format!("{}: {} rows", log.name, log.samples));
    let clock = if log.resampled {
        "uneven clock"
    } else {
        "even clock"
    };
    let (seconds, rate) = (significant(log.duration, 4), significant(log.rate_hz, 5));
    let pieces = pieces(log.segments);
    paragraph(
        &format!("{seconds} s at {rate} Hz, {clock}, {pieces} without a gap"),
        terminal,
    );
}

fn pieces(segments: u64) -> String {
    if segments == 1 {
        "1 stretch".into()
    } else {
        format!("{segments} stretches")
    }
}
