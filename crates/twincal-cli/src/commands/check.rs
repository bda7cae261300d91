//! `twincal check`: scores of a twin on new logs against its gates.

use super::inputs::LogInput;
use super::summary::{Notes, findings, paragraph, percent};
use super::table::{print_table, table};
use super::{code_of, print_json, require_strict, settings, start_threads};
use crate::args::Check;
use crate::failure::{GATE, Outcome};
use crate::progress::Progress;
use crate::terminal::{Terminal, clean};
use serde::Serialize;
use twincal::twin::Twin;
use twincal::validate::{HeldOut, Scores, Split, Validation};
use twincal::words::significant;
use twincal::{Finding, Result, Severity};
use twincal_io::artifact::Artifact;
use twincal_io::config::Gates;
use twincal_io::report::FileHash;
use twincal_io::twin_json::StoredTwin;

/// What `--json` prints.
#[derive(Serialize)]
struct Checked {
    schema: u64,
    passed: bool,
    gates: Vec<Gate>,
    signal: &'static str,
    #[serde(flatten)]
    filtered: Scores,
    moving: Scores,
    within: Scores,
    beyond: Scores,
    raw: Scores,
    findings: Vec<Finding>,
}

/// One gate of one joint.
#[derive(Serialize)]
struct Gate {
    /// `moving`, or `all` where the joint does not move, here or in the twin's own scores.
    rows: &'static str,
    joint: String,
    gate: &'static str,
    passed: bool,
    value: f64,
    limit: [Option<f64>; 2],
    words: String,
}

pub(super) fn run(flags: &Check, terminal: &mut Terminal) -> Outcome<u8> {
    let config = settings::beside_twin(&flags.log)?;
    let settings = config.settings()?;
    start_threads(settings.threads)?;
    let progress = Progress::new();
    progress.step(&format!("reading {}", flags.twin.to_string_lossy()));
    let stored = StoredTwin::read(&Artifact::open(&flags.twin)?, false)?;
    let twin = &stored.calibration.twin;
    let mut logs = LogInput::for_twin(&flags.logs, &stored, settings.log.clone(), &progress)?;
    progress.step("predicting the logs");
    let mut found = std::mem::take(&mut logs.findings);
    let validation = score(twin, &logs, &mut found).map_err(|error| logs.as_given(error))?;
    drop(progress);
    require_strict(settings.log.strict, &found)?;
    // A gate that the config does not give stays as the twin was fitted with.
    let gates = config.gates_over(stored.gates)?;
    let known = known_logs(&logs.files, &stored);
    let fitted = known.iter().filter(|finding| finding.code == FITTED);
    let fitted = fitted.count() == logs.files.len();
    let gates = judge(&validation, &stored.calibration.validation, &gates, fitted);
    found.splice(0..0, known.iter().cloned());
    let passed = gates.iter().all(|gate| gate.passed);
    let code = if passed { code_of(&found) } else { GATE };
    if settings.json {
        let Validation {
            filtered,
            moving,
            within,
            beyond,
            raw,
            ..
        } = validation;
        let checked = Checked {
            schema: 1,
            passed,
            gates,
            signal: "filtered",
            filtered,
            moving,
            within,
            beyond,
            raw,
            findings: found,
        };
        print_json(terminal, &checked)?;
        return Ok(code);
    }
    terminal.heading(if passed { "passed" } else { "failed" });
    for gate in gates.iter().filter(|gate| !gate.passed) {
        paragraph(&gate.words, terminal);
    }
    known
        .iter()
        .for_each(|finding| paragraph(&finding.message, terminal));
    judged(&gates, &validation, terminal);
    if let Some(text) = beyond(&validation) {
        paragraph(&text, terminal);
    }
    terminal.say("");
    findings(&found, Notes::In("the output of --json"), terminal);
    Ok(code)
}

/// Code of logs that the twin was fitted to.
const FITTED: &str = "log_was_fitted";

/// Logs that the twin knows already, by their checksums: what they show is no news.
fn known_logs(files: &[FileHash], stored: &StoredTwin) -> Vec<Finding> {
    let role = |file: &FileHash| {
        let mut known = stored.context.files.iter();
        let same = known.find(|own| !own.sha256.is_empty() && own.sha256 == file.sha256)?;
        let mut logs = stored.calibration.logs.iter();
        let log = logs.find(|log| log.name == same.name)?;
        Some(log.role.as_str())
    };
    let told = |file: &FileHash| {
        let (code, what) = match role(file)? {
            "heldout" => (
                "log_was_heldout",
                "one that the twin was judged by when it was fitted: it repeats those scores",
            ),
            _ => (
                FITTED,
                "one that the twin was fitted to: no independent check",
            ),
        };
        let message = format!("{}: this log is {what}", file.name);
        Some(Finding::new(Severity::Note, code, &file.name, message, 0))
    };
    files.iter().filter_map(told).collect()
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
            still.join(", ")
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

/// Which rows the twin's own error was measured on.
fn own_rows(split: &Split) -> &'static str {
    match split {
        Split::HeldoutLogs => "of the twin on its held-out logs",
        Split::LeaveOneLogOut => "of the twin on its logs, each left out in turn",
        Split::LeaveLogGroupsOut => "of the twin on its logs, left out in ten groups",
        Split::LastThirty => "of the twin on the last 30 % of each of its logs",
    }
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

/// Scores of all logs together.
fn score(twin: &Twin, logs: &LogInput, findings: &mut Vec<Finding>) -> Result<Validation> {
    let library = twin.library()?;
    let predictor = twin.predictor(&library)?;
    let mut scores = HeldOut::new(twin.robot.joint_names());
    for log in &logs.logs {
        scores.score(twin, &library, &predictor, log, findings)?;
    }
    Ok(scores.finish(Split::HeldoutLogs))
}

/// Rows of joints that move.
const MOVING: &str = "moving";
/// All rows.
const ALL: &str = "all";

/// Two gates per joint: on rows in which it moves, where there are some here and in the twin's own scores. What holds a joint at rest no
/// friction tells, and how long it rests is another thing in every log.
///
/// Of rows that were `fitted` the gate is the same, but says nothing of a change: it is said so.
fn judge(scores: &Validation, stored: &Validation, gates: &Gates, fitted: bool) -> Vec<Gate> {
    let mut judged = Vec::new();
    let own = own_rows(&stored.split);
    let seen = "; the twin was fitted to such rows, so that this is no change of the robot: they are harder than those that the gate comes from";
    let all = scores.filtered.joints.iter().zip(&stored.filtered.joints);
    let moving = scores.moving.joints.iter().zip(&stored.moving.joints);
    for (all, moving) in all.zip(moving) {
        let ((joint, stored), rows, which) = match moving {
            (joint, stored) if joint.rows > 0 && stored.rows > 0 => (moving, "moving rows", MOVING),
            _ => (all, "rows", ALL),
        };
        let limit = gates.rmse_ratio * stored.rmse_calibrated;
        let (rmse, name) = (joint.rmse_calibrated, &joint.joint);
        judged.push(Gate {
            rows: which,
            joint: name.clone(),
            gate: "rmse",
            // Without rows, or without a stored score, nothing was shown: not a pass.
            passed: rmse <= limit,
            value: rmse,
            limit: [None, Some(limit)],
            words: format!(
                "joint `{name}`: RMSE {} of {rows} is {} the gate {} ({} × {} {own}){}",
                significant(rmse, 4),
                if rmse <= limit { "within" } else { "above" },
                significant(limit, 4),
                gates.rmse_ratio,
                significant(stored.rmse_calibrated, 4),
                if fitted && rmse > limit { seen } else { "" }
            ),
        });
        let [low, high] = gates.coverage;
        let cautious = if joint.coverage95 > high {
            ": wider than these rows need; where that does no harm, say [check] coverage with 1 at the top"
        } else {
            ""
        };
        judged.push(Gate {
            rows: which,
            joint: name.clone(),
            gate: "coverage",
            passed: low <= joint.coverage95 && joint.coverage95 <= high,
            value: joint.coverage95,
            limit: [Some(low), Some(high)],
            words: format!(
                "joint `{name}`: the 95 % interval holds {} of the {rows}, the gate is {} to {}{cautious}",
                percent(joint.coverage95),
                percent(low),
                percent(high)
            ),
        });
    }
    judged
}

#[cfg(test)]
mod tests {
    use super::*;
    use twincal::validate::JointScore;

    fn scores(rmse: f64, coverage: f64) -> Validation {
        let joint = JointScore {
            joint: "elbow".into(),
            rows: 10,
            rmse_nominal: 1.0,
            rmse_calibrated: rmse,
            bias: 0.0,
            coverage95: coverage,
            mean_width95: 0.4,
            torque_sd: 5.0,
            interval_score95: 0.5,
            epistemic_sd: 0.01,
            noise_sd: 0.1,
            epistemic_share: 0.01,
            rmse_friction: None,
        };
        let moving = Scores {
            rmse_nominal: 1.0,
            rmse_calibrated: rmse,
            coverage95: coverage,
            interval_score95: 0.5,
            epistemic_share: 0.01,
            joints: vec![joint],
        };
        // At rest it is far off, which no gate is for.
        let mut filtered = moving.clone();
        filtered.joints[0].rmse_calibrated = 9.0;
        filtered.joints[0].coverage95 = 0.1;
        Validation {
            filtered,
            moving,
            ..HeldOut::new(vec!["elbow"]).finish(Split::HeldoutLogs)
        }
    }

    #[test]
    fn a_joint_that_does_not_move_is_judged_by_all_of_its_rows() {
        let mut still = scores(0.1, 0.95);
        still.moving.joints[0].rows = 0;
        let gates = Gates::default();
        let judged = judge(&still, &scores(0.1, 0.95), &gates, false);
        assert!(judged.iter().all(|gate| gate.rows == ALL));
        let values: Vec<f64> = judged.iter().map(|gate| gate.value).collect();
        assert_eq!(values, [9.0, 0.1]);
        assert!(judged[1].words.contains("10.0 % of the rows"));
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

    #[test]
    fn gates_stand_at_their_limits() {
        let gates = Gates {
            rmse_ratio: 1.2,
            coverage: [0.9, 0.99],
        };
        let passed = |rmse, coverage| -> Vec<bool> {
            judge(&scores(rmse, coverage), &scores(0.1, 0.95), &gates, false)
                .iter()
                .map(|gate| gate.passed)
                .collect()
        };
        let words = |rmse, fitted| {
            judge(&scores(rmse, 0.95), &scores(0.1, 0.95), &gates, fitted)
                .swap_remove(0)
                .words
        };
        assert_eq!(
            words(0.1199, true),
            "joint `elbow`: RMSE 0.1199 of moving rows is within the gate 0.1200 (1.2 × 0.1000 of the twin on its held-out logs)"
        );
        assert_eq!(
            words(0.1201, false),
            "joint `elbow`: RMSE 0.1201 of moving rows is above the gate 0.1200 (1.2 × 0.1000 of the twin on its held-out logs)"
        );
        assert!(words(0.1201, true).contains("no change of the robot"));
        assert_eq!(passed(0.1199, 0.95), [true, true]);
        assert_eq!(passed(0.1201, 0.95), [false, true]);
        assert_eq!(passed(0.1, 0.90), [true, true]);
        assert_eq!(passed(0.1, 0.899), [true, false]);
        assert_eq!(passed(0.1, 0.991), [true, false]);
        assert_eq!(passed(f64::NAN, f64::NAN), [false, false]);
    }
}
