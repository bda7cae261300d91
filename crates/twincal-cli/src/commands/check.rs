//! `twincal check`: scores of a twin on new logs against its gates, and what they say of a change.

mod changes;
mod gates;

use super::inputs::LogInput;
use super::summary::{Notes, findings, paragraph};
use super::table::{print_table, table};
use super::{print_json, require_strict, settings, start_threads, verdict};
use crate::args::Check;
use crate::exit;
use crate::failure::{Failure, Outcome};
use crate::progress::Progress;
use crate::terminal::{Terminal, clean};
use gates::{ALL, ENOUGH, Gate, Own, judge};
use serde::Serialize;
use twincal::Code;
use twincal::assess::{Answer, Assessment, Claim, assess, of_gates};
use twincal::calibrate::Calibration;
use twincal::self_check::self_check;
use twincal::signal::Trajectory;
use twincal::twin::Twin;
use twincal::validate::{
    Change, Changes, FALSE_ALARM, HeldOut, Scores, Split, Validation, least_share,
};
use twincal::words::{listed, significant};
use twincal::{Finding, Result, Severity};
use twincal_io::artifact::Artifact;
use twincal_io::assessment::Versioned;
use twincal_io::context::FileHash;
use twincal_io::twin_json::StoredTwin;
use twincal_io::words::percent;

/// What `--json` prints.
#[derive(Serialize)]
struct Checked {
    schema: u64,
    assessment: Versioned,
    verdict: Verdict,
    /// The verdict is `passed`.
    passed: bool,
    gates: Vec<Gate>,
    /// What may have changed, with numbers.
    changes: Vec<Change>,
    signal: &'static str,
    #[serde(flatten)]
    filtered: Scores,
    moving: Scores,
    within: Scores,
    beyond: Scores,
    raw: Scores,
    findings: Vec<Finding>,
}

impl Checked {
    fn of(
        (assessment, gates, findings): (Assessment, Vec<Gate>, Vec<Finding>),
        validation: Validation,
        changes: Vec<Change>,
    ) -> Self {
        let verdict = Verdict::of(assessment.answer);
        Self {
            schema: 1,
            assessment: Versioned::from(assessment),
            verdict,
            passed: verdict == Verdict::Passed,
            gates,
            changes,
            signal: "filtered",
            filtered: validation.filtered,
            moving: validation.moving,
            within: validation.within,
            beyond: validation.beyond,
            raw: validation.raw,
            findings,
        }
    }
}

pub(super) fn run(flags: &Check, terminal: &mut Terminal) -> Outcome<u8> {
    let config = settings::beside_twin(&flags.log)?;
    let settings = config.settings()?;
    start_threads(settings.threads)?;
    let progress = Progress::new();
    progress.step(&format!("reading {}", flags.twin.to_string_lossy()));
    let stored = StoredTwin::read(&Artifact::open(&flags.twin)?, false)?;
    require_tested(&stored.calibration.validation)?;
    let twin = &stored.calibration.twin;
    let mut logs = LogInput::for_twin(&flags.logs, &stored, settings.log.clone(), &progress)?;
    progress.step("predicting the logs");
    let mut found = std::mem::take(&mut logs.findings);
    // A gate that the config does not give stays as the twin was fitted with.
    let gates = config.gates_over(stored.gates)?;
    let scored = score(&stored, &logs, gates.rmse_ratio, &mut found);
    let scored = scored.map_err(|error| logs.as_given(error))?;
    let (validation, changes) = (scored.validation, scored.changes);
    drop(progress);
    require_strict(settings.log.strict, &found)?;
    let known = known_logs(&logs.files, &stored);
    let was_fitted = known.iter().filter(|own| own.code == Code::LogWasFitted);
    let fitted = was_fitted.count() == logs.files.len();
    let own = Own::of(&stored, gates, fitted);
    let mut gates = judge(&validation, &own);
    gates.extend(changes::gates(&changes, least_share(own.gates.rmse_ratio)));
    found.splice(0..0, known.iter().cloned());
    let names: Vec<&str> = logs.logs.iter().map(|log| log.name()).collect();
    // What is no torque of this robot passes and fails no gate.
    let says_something = scored.misread.len() < names.len();
    let judged = says_something.then_some(&gates[..]);
    let assessment = assessment(judged, &found, (&stored.calibration, &names));
    let verdict = Verdict::of(assessment.answer);
    // What is said of the twin itself does not change what is said of these logs.
    found.extend(unusable(&stored.calibration));
    let code = exit::of_check(assessment.answer, &found);
    if settings.json {
        let said = (assessment, gates, found);
        print_json(terminal, &Checked::of(said, validation, changes))?;
        return Ok(code);
    }
    terminal.heading(verdict.word());
    if assessment.reason == Code::TooShortToCheck {
        paragraph(&too_short(&validation, twin), terminal);
    } else {
        decisive(&gates, assessment.reason, &mut found, terminal);
    }
    for finding in &known {
        paragraph(&finding.message, terminal);
    }
    if says_something {
        left_out(&scored.misread, terminal);
    }
    scores(gates, &validation, terminal);
    terminal.say("");
    findings(&found, Notes::In("the output of --json"), terminal);
    Ok(code)
}

/// Logs that are in no score.
fn left_out(misread: &[String], terminal: &mut Terminal) {
    if misread.is_empty() {
        return;
    }
    let names = misread.iter().map(|name| clean(name));
    let text = format!("Left out of all that follows: {}", listed(names, ", "));
    paragraph(&text, terminal);
}

/// A warning that the twin's own answer is no or not yet.
fn unusable(calibration: &Calibration) -> Option<Finding> {
    let usable = assess(calibration).answer <= Answer::YesWithinLimits;
    verdict::doubt(calibration).filter(|_| !usable)
}

/// # Errors
/// For a twin without an error that new ones could be compared with.
fn require_tested(validation: &Validation) -> Outcome<()> {
    let mut joints = validation.filtered.joints.iter();
    if validation.split != Split::NotTested && joints.any(|joint| joint.rows > 0) {
        return Ok(());
    }
    Err(Failure::usage(
        "the twin was never tested: it has no error that new ones could be compared with",
        "fit again with --heldout LOG",
    ))
}

/// What the verdict rests on: gates that fail, or, where they hold, what is wrong with the log; that is no longer among the findings then.
fn decisive(gates: &[Gate], reason: Code, found: &mut Vec<Finding>, terminal: &mut Terminal) {
    if let Some(at) = found.iter().position(|finding| finding.code == reason) {
        paragraph(&found.remove(at).message, terminal);
        return;
    }
    let failed = gates.iter().filter(|gate| !gate.passed);
    failed.for_each(|gate| paragraph(&gate.words, terminal));
}

/// Every gate beside its limits, what was tested, and how much of the motion is new.
fn scores(gates: Vec<Gate>, validation: &Validation, terminal: &mut Terminal) {
    let (of_changes, of_joints): (Vec<Gate>, Vec<Gate>) =
        gates.into_iter().partition(changes::is_change);
    judged(&of_joints, validation, terminal);
    let tested = match of_changes.len() {
        0 => "No change was tested.".to_owned(),
        count => format!(
            "Changes tested: {} (friction of each joint, payload, joint zeros). An unchanged robot fails with probability {} % at most.",
            count,
            100.0 * FALSE_ALARM
        ),
    };
    paragraph(&tested, terminal);
    if let Some(text) = beyond(validation) {
        paragraph(&text, terminal);
    }
}

/// The answer as a gate says it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Verdict {
    Passed,
    Failed,
    /// Too few rows to say either, or a log that is not what it is said to be.
    Inconclusive,
}

impl Verdict {
    fn of(answer: Answer) -> Self {
        match answer {
            Answer::Yes | Answer::YesWithinLimits => Self::Passed,
            Answer::No => Self::Failed,
            Answer::NotYet => Self::Inconclusive,
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::Inconclusive => "inconclusive",
        }
    }
}

/// What the gates say of the twin. One fails on rows that are enough; otherwise too few of them say nothing. `None` of logs that say nothing of it.
fn assessment(
    gates: Option<&[Gate]>,
    found: &[Finding],
    known: (&Calibration, &[&str]),
) -> Assessment {
    let Some(gates) = gates else {
        return of_gates(Vec::new(), found, known);
    };
    let mut claims: Vec<Claim> = gates.iter().filter_map(Gate::claim).collect();
    let fails = gates.iter().any(|gate| !gate.passed);
    // That no change is seen says nothing of how much could be.
    let mut of_joints = gates.iter().filter(|gate| !changes::is_change(gate));
    if claims.is_empty() && (fails || !of_joints.any(|gate| gate.enough)) {
        claims.push(Claim::of_run(Code::TooShortToCheck));
    }
    of_gates(claims, found, known)
}

/// Where rows are too few: how many there are, and what to record.
fn too_short(validation: &Validation, twin: &Twin) -> String {
    let rows = |joint: usize| validation.moving.joints[joint].rows as f64;
    let counts = |joint: usize| rows(joint) / twin.noise[joint].memory();
    let most = (0..twin.noise.len()).map(counts).fold(0.0, f64::max);
    let pipeline = &twin.pipeline;
    let (filter, rate) = (pipeline.kernel_length(), pipeline.rate_hz);
    let memory = (twin.noise.iter())
        .map(|noise| noise.memory())
        .fold(f64::INFINITY, f64::min);
    let least = match rate > 0.0 {
        true => format!(
            "at least {:.0} s of motion",
            (filter + ENOUGH * memory / rate).ceil()
        ),
        false => "more motion".to_owned(),
    };
    format!(
        "The rows in which joints move count as {most:.1} independent rows at most, {ENOUGH} are needed: these logs are too short to tell. Record {least}."
    )
}

/// What a log was in the fit of a twin, by its checksum; `None` for one that was not there.
pub(super) fn role_in_fit<'a>(file: &FileHash, stored: &'a StoredTwin) -> Option<&'a str> {
    let mut known = stored.context.files.iter();
    let same = known.find(|own| !own.sha256.is_empty() && own.sha256 == file.sha256)?;
    let mut logs = stored.calibration.logs.iter();
    let log = logs.find(|log| log.name == same.name)?;
    Some(log.role.as_str())
}

/// Logs that the twin knows already, by their checksums: a pass of them says that files and twin belong together, nothing of the robot since.
fn known_logs(files: &[FileHash], stored: &StoredTwin) -> Vec<Finding> {
    let roles: Vec<Option<&str>> = (files.iter())
        .map(|file| role_in_fit(file, stored))
        .collect();
    let remedy = match roles.iter().all(Option::is_some) {
        true => "; check a log that is new to the twin",
        false => "",
    };
    let known = |(file, role): (&FileHash, &Option<&str>)| {
        let (code, what) = match (*role)? {
            "heldout" => (
                Code::LogWasHeldout,
                "one that the twin was judged by when it was fitted: it repeats those scores",
            ),
            _ => (
                Code::LogWasFitted,
                "one that the twin was fitted to: no independent check",
            ),
        };
        let message = format!("{}: this log is {what}{remedy}", file.name);
        Some(Finding::new(Severity::Note, code, &file.name, message, 0))
    };
    files.iter().zip(&roles).filter_map(known).collect()
}

/// What the gates judge joint by joint, and what stands beside it.
fn judged(gates: &[Gate], validation: &Validation, terminal: &mut Terminal) {
    terminal.say("What the gates judge: rows in which the joint moves");
    let mut rows = table(&["joint", "RMSE", "gate", "in 95 % interval", "gate", ""]);
    let mut still = Vec::new();
    for pair in gates.chunks_exact(2) {
        let [rmse, coverage] = pair else { continue };
        let limit = |limit: Option<f64>| limit.map_or("–".into(), |x| significant(x, 3));
        let share =
            |share: Option<f64>| share.map_or("–".into(), |x| format!("{:.0}", 100.0 * x));
        let [low, high] = coverage.limit;
        rows.add_row([
            &*clean(&rmse.joint),
            &significant(rmse.value, 3),
            &format!("≤ {}", limit(rmse.limit[1])),
            &percent(coverage.value),
            &format!("{}…{} %", share(low), share(high)),
            if rmse.passed && coverage.passed {
                "passed"
            } else {
                "failed"
            },
        ]);
        if rmse.rows == ALL {
            still.push(clean(&rmse.joint));
        }
    }
    print_table(&rows, terminal);
    if !still.is_empty() {
        let text = format!(
            "by all of their rows, as they do not move: {}",
            listed(&still, ", ")
        );
        paragraph(&text, terminal);
    }
    let at_rest = standstill(&validation.filtered, &validation.moving);
    if at_rest.is_empty() {
        return;
    }
    terminal.say("At standstill, which no gate judges");
    let mut rows = table(&["joint", "rows", "RMSE", "in 95 % interval"]);
    for (joint, count, rmse, coverage) in at_rest {
        rows.add_row([
            &*clean(joint),
            &count.to_string(),
            &significant(rmse, 3),
            &percent(coverage),
        ]);
    }
    print_table(&rows, terminal);
}

/// Joint, rows, RMSE and share in 95 % intervals of what is in `all` and not among the `moving` rows, of joints that have both.
fn standstill<'a>(all: &'a Scores, moving: &Scores) -> Vec<(&'a str, u64, f64, f64)> {
    let both = all.joints.iter().zip(&moving.joints);
    let both = both.filter(|(all, moving)| moving.rows > 0 && all.rows > moving.rows);
    both.map(|(all, moving)| {
        let (every, some) = (all.rows as f64, moving.rows as f64);
        let rest =
            |all: f64, moving: f64| ((every * all - some * moving) / (every - some)).max(0.0);
        let square = rest(all.rmse_calibrated.powi(2), moving.rmse_calibrated.powi(2));
        let share = rest(all.coverage95, moving.coverage95);
        (
            all.joint.as_str(),
            all.rows - moving.rows,
            square.sqrt(),
            share,
        )
    })
    .collect()
}

/// How much of the motion is new to the twin, and how it does there.
fn beyond(validation: &Validation) -> Option<String> {
    let rows = |scores: &Scores| scores.joints.iter().map(|joint| joint.rows).sum::<u64>();
    let (within, beyond) = (&validation.within, &validation.beyond);
    let all = rows(within) + rows(beyond);
    if rows(beyond) == 0 {
        return None;
    }
    let say = |scores: &Scores| {
        format!(
            "RMSE {}, {:.1} % in 95 % intervals",
            significant(scores.rmse_calibrated, 3),
            100.0 * scores.coverage95
        )
    };
    let inside = match rows(within) {
        0 => String::new(),
        _ => format!("; within it {}", say(within)),
    };
    Some(format!(
        "{:.0} % of the moving rows are beyond the motion of the fit: {} there{inside}",
        100.0 * rows(beyond) as f64 / all as f64,
        say(beyond)
    ))
}

/// What logs say of a twin.
struct Scored {
    validation: Validation,
    changes: Vec<Change>,
    /// Logs whose torque is not what it is said to be. They are left out of scores and changes, unless all are such.
    misread: Vec<String>,
}

/// Scores of all logs together, and what they say of changes. `ratio`: of a joint's error to the twin's, above which a gate fails.
fn score(
    stored: &StoredTwin,
    logs: &LogInput,
    ratio: f64,
    findings: &mut Vec<Finding>,
) -> Result<Scored> {
    let twin = &stored.calibration.twin;
    let library = twin.library()?;
    let predictor = twin.predictor(&library)?;
    let nothing = || HeldOut::new(twin.robot.joint_names());
    let (mut scores, mut of_misread) = (nothing(), nothing());
    let own = stored.calibration.validation.moving.joints.iter();
    let errors: Vec<f64> = own.map(|joint| joint.rmse_calibrated).collect();
    let mut changes = Changes::new(twin, &library, &errors)?;
    let mut misread = Vec::new();
    for log in &logs.logs {
        let each = (twin, &library, &predictor);
        let (mut columns, mut own, mut own_scores) = (None, changes.alone(), nothing());
        own_scores.score(each, log, findings, &mut |motion| {
            if columns.is_none() {
                columns = Some(no_measurement(twin, motion)?);
            }
            own.take(motion)
        })?;
        let mut said = columns.unwrap_or_default();
        if said.is_empty() {
            said = own.misread(log.name(), ratio);
        }
        if said.is_empty() {
            changes.join(own);
            scores += own_scores;
        } else {
            misread.push(log.name().to_owned());
            of_misread += own_scores;
        }
        findings.extend(said);
    }
    let scores = match misread.len() == logs.logs.len() {
        true => of_misread,
        false => scores,
    };
    Ok(Scored {
        validation: scores.finish(Split::HeldoutLogs),
        changes: changes.finish(least_share(ratio)),
        misread,
    })
}

/// Torque columns of a log that hold another joint's torque, or one number: what they say of the robot is nothing.
fn no_measurement(twin: &Twin, motion: &Trajectory) -> Result<Vec<Finding>> {
    let mut found = self_check(&twin.robot, &twin.pipeline, [motion])?;
    found.retain(|finding| matches!(finding.code, Code::TorqueCopied | Code::TorqueConstant));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::gates::tests::scores;
    use super::*;
    use crate::commands::brief::tests::fitted;

    /// A gate of changes always has its rows; it does not make up for those that a joint lacks.
    #[test]
    fn that_no_change_is_seen_in_few_rows_is_no_pass() {
        let gate = |gate, code, enough| Gate {
            rows: ALL,
            joint: "elbow".into(),
            gate,
            code,
            passed: true,
            value: 1.0,
            limit: [None, Some(2.0)],
            words: String::new(),
            enough,
        };
        let of = |enough| {
            let gates = [
                gate("rmse", Code::ErrorAboveGate, enough),
                gate("friction", Code::FrictionChanged, true),
            ];
            let judged = assessment(Some(&gates), &[], (&fitted(), &[]));
            (judged.answer, judged.reason)
        };
        assert_eq!(of(false), (Answer::NotYet, Code::TooShortToCheck));
        assert_eq!(of(true).0, Answer::Yes);
    }

    /// 10 moving rows with squares of 1 and 30 at standstill with 9: 40 rows with a mean square of 7; 9 and 15 of them in the interval.
    #[test]
    fn standstill_is_what_is_left_of_all_rows() {
        let moving = scores(1.0, 0.9);
        let mut all = scores(1.0, 0.9).moving;
        all.joints[0].rows = 40;
        all.joints[0].rmse_calibrated = 7.0_f64.sqrt();
        all.joints[0].coverage95 = 24.0 / 40.0;
        let rest = standstill(&all, &moving.moving);
        let &[(joint, rows, rmse, coverage)] = rest.as_slice() else {
            unreachable!("{rest:?}");
        };
        assert_eq!((joint, rows), ("elbow", 30));
        assert!((rmse - 3.0).abs() < 1e-12 && (coverage - 0.5).abs() < 1e-12);
        assert!(standstill(&all, &all).is_empty());
    }
}
