//! Everything that a person can read of a fit on the terminal: physical sentences, terms, held-out scores, findings.

use super::calibration::quoted;
use super::not_kept::others;
use super::table::{print_table, table};
use crate::terminal::{Terminal, clean};
use std::path::Path;
use twincal::assess::{decisive, friction_only, has_standstill};
use twincal::calibrate::{Calibration, ParameterSummary};
use twincal::validate::{Scores, Split};
use twincal::words::significant;
use twincal::{Code, Finding, Severity};
use twincal_io::words::{self, percent, probability};

/// What to do about a log that contradicts the model.
pub(super) const HOW_TO_FIX: &str = "`twincal init` with this log and model writes a twincal.toml that fixes it, where it is a mistake of columns, signs or units";
/// What stands where ± does not describe a number.
pub(super) const ENDS: &str =
    "a (b … c): median and both ends of the 95 % interval, where ± would mislead";
/// Prints the whole summary of what lies in `output`, the answer first.
pub(super) fn print(calibration: &Calibration, output: &Path, terminal: &mut Terminal) {
    terminal.answer(&words::answer(calibration).headline);
    terminal.say("");
    mistakes(calibration, terminal);
    effects(calibration, terminal);
    others(calibration, terminal);
    validation(calibration, terminal);
    verdict(calibration, output, terminal);
    findings(&calibration.findings, Notes::Shown, terminal);
}

/// What forbids a "Yes" stands before any number.
fn mistakes(calibration: &Calibration, terminal: &mut Terminal) {
    let all = || calibration.findings.iter().filter(|f| f.forbids_yes());
    if all().next().is_none() {
        return;
    }
    all().for_each(|finding| paragraph(&finding.message, terminal));
    if all().any(Finding::doubts_the_log) {
        paragraph(HOW_TO_FIX, terminal);
    }
    terminal.say("");
}

fn effects(calibration: &Calibration, terminal: &mut Terminal) {
    let all = &calibration.components;
    terminal.heading("What the model misses");
    if !all.iter().any(|component| component.is_in()) {
        terminal.say("  nothing: no candidate has a probability of 0.5 or more");
    }
    for component in all.iter().filter(|component| component.is_in()) {
        let status = component.status.word();
        let pip = probability(component.pip.unwrap_or(f64::NAN));
        let mut said = vec![format!("{status}, PIP {pip}")];
        said.extend(Some(words::reason(component)).filter(|why| !why.is_empty()));
        let text = format!("{} ({})", component.words, said.join(": "));
        paragraph(&text, terminal);
    }
    let unseen: Vec<&str> = calibration.unseen().map(|own| own.name.as_str()).collect();
    if !unseen.is_empty() {
        let text = format!("not seen by these data: {}", unseen.join(", "));
        paragraph(&text, terminal);
    }
    for group in calibration.groups.iter().filter(|group| !group.settled) {
        paragraph(&group.words, terminal);
    }
    for told in calibration.told_apart_by_the_prior() {
        paragraph(&told, terminal);
    }
    if tells_ends(calibration) {
        paragraph(ENDS, terminal);
    }
    terminal.say("");
}

/// Whether both ends stand for some number of what was found.
pub(super) fn tells_ends(calibration: &Calibration) -> bool {
    let found = calibration
        .components
        .iter()
        .filter(|component| component.is_in());
    found
        .flat_map(|component| &component.parameters)
        .any(has_ends)
}

/// Whether ± does not describe a number that is told.
pub(super) fn has_ends(number: &ParameterSummary) -> bool {
    number.seen && number.ends().is_some()
}

fn validation(calibration: &Calibration, terminal: &mut Terminal) {
    let validation = &calibration.validation;
    let split = match &validation.split {
        Split::HeldoutLogs => "held-out logs",
        Split::LeaveOneLogOut => "each log predicted from the others",
        Split::LeaveLogGroupsOut => "each fifth of the logs predicted from the others",
        Split::LastThirty => "last 30 % of each log",
        Split::NotTested => {
            terminal.heading("Held-out torque: not tested");
            paragraph(
                "--heldout LOG predicts a log that was not fitted.",
                terminal,
            );
            terminal.say("");
            return;
        }
    };
    let judged = decisive(validation);
    let moving = if has_standstill(validation) {
        ", joints that move"
    } else {
        ""
    };
    terminal.heading(&format!("Held-out torque: {split}{moving}"));
    scores(judged, terminal);
    for line in reliability(calibration) {
        paragraph(&line, terminal);
    }
    terminal.say("");
}

/// What the answer rests on, and what limits it.
fn verdict(calibration: &Calibration, output: &Path, terminal: &mut Terminal) {
    let answer = words::answer(calibration);
    terminal.heading("What the answer rests on");
    // Findings follow in full.
    let limits = words::limits_beside_findings(calibration);
    let told = answer.grounds.iter().chain(&limits);
    told.for_each(|text| paragraph(text, terminal));
    if let Some(next) = &answer.next {
        paragraph(&format!("Next recording: {next}"), terminal);
    }
    let output = quoted(&output.to_string_lossy());
    if let Some(motion) = words::next_motion(calibration, &output) {
        paragraph(&motion.sentence(), terminal);
    }
    terminal.say("");
}

/// How honest the intervals are, what is guaranteed, and what the compact twin costs.
fn reliability(calibration: &Calibration) -> Vec<String> {
    let validation = &calibration.validation;
    let mut lines = Vec::new();
    let levels: Vec<String> = validation
        .coverage_levels
        .iter()
        .map(|(level, seen)| format!("{:.0} % interval {}", 100.0 * level, percent(*seen)))
        .collect();
    if !levels.is_empty() {
        let share = percent(decisive(validation).epistemic_share);
        lines.push(format!("held-out values inside: {}", levels.join(", ")));
        lines.push(format!(
            "{share} of the predicted variance is what coefficients leave open, the rest noise"
        ));
    }
    if let Some(conformal) = &validation.conformal {
        lines.push(format!(
            "scaled by {}, they hold {:.0} % of all rows{} of the next such log with {} {} ({})",
            significant(conformal.factor, 3),
            100.0 * conformal.rows,
            if has_standstill(validation) {
                ", those at standstill too,"
            } else {
                ""
            },
            if conformal.guaranteed {
                "guaranteed probability"
            } else {
                "probability about"
            },
            percent(conformal.level),
            match conformal.trajectories {
                1 => "one log".into(),
                n => format!("{n} logs"),
            }
        ));
        lines.push(words::drawn_alike(conformal));
    }
    if let (Some(compact), Some([average, own])) = (&calibration.compact, validation.compact) {
        lines.push(format!(
            "compact twin ({} effects): RMSE {} on moving joints, where the average of all models has {}; log score {:+.3} nats per row",
            compact.components.len(),
            significant(own.rmse, 3),
            significant(average.rmse, 3),
            own.log_score - average.log_score
        ));
    }
    lines
}

/// Scores per joint, and over all of them; what friction alone would leave where that was asked for.
pub(super) fn scores(scores: &Scores, terminal: &mut Terminal) {
    let friction = friction_only(scores);
    let mut heads = vec!["joint", "RMSE nominal"];
    heads.extend(friction.is_some().then_some("friction only"));
    heads.extend(["calibrated", "in 95 % interval", "its width"]);
    let mut table = table(&heads);
    let mut add = |name: &str, rmses: [f64; 3], coverage: f64, width: String| {
        let [nominal, alone, calibrated] = rmses.map(|rmse| significant(rmse, 3));
        let mut row = vec![clean(name), nominal];
        row.extend(friction.is_some().then_some(alone));
        row.extend([calibrated, percent(coverage), width]);
        table.add_row(row);
    };
    for joint in &scores.joints {
        let alone = joint.rmse_friction.unwrap_or(f64::NAN);
        let rmses = [joint.rmse_nominal, alone, joint.rmse_calibrated];
        let width = significant(joint.mean_width95, 3);
        add(&joint.joint, rmses, joint.coverage95, width);
    }
    let alone = friction.unwrap_or(f64::NAN);
    let rmses = [scores.rmse_nominal, alone, scores.rmse_calibrated];
    add("all", rmses, scores.coverage95, String::new());
    print_table(&table, terminal);
}

/// What becomes of findings that are only good to know.
#[derive(Clone, Copy)]
pub(super) enum Notes {
    /// Printed like the others.
    Shown,
    /// Counted; they stand elsewhere.
    In(&'static str),
}

impl Notes {
    fn place(self) -> Option<&'static str> {
        match self {
            Self::Shown => None,
            Self::In(place) => Some(place),
        }
    }
}

/// The serious ones first, each with its word.
const ORDER: [(Severity, &str); 3] = [
    (Severity::Degraded, "degraded"),
    (Severity::Warning, "warning"),
    (Severity::Note, "note"),
];

/// Everything that must be said, the most serious first; what is said of several logs is said once.
pub(super) fn findings(findings: &[Finding], notes: Notes, terminal: &mut Terminal) {
    if findings.is_empty() {
        return;
    }
    terminal.heading("Findings");
    for (severity, word) in ORDER {
        if let (Severity::Note, Notes::In(place)) = (severity, notes) {
            let count = findings
                .iter()
                .filter(|finding| finding.severity == Severity::Note)
                .count();
            if count > 0 {
                terminal.say(&format!("  {count} notes are in {place}"));
            }
            continue;
        }
        for line in lines(findings, (severity, word), notes.place(), terminal.width()) {
            if severity == Severity::Note {
                terminal.say(&line);
            } else {
                terminal.warning(&line);
            }
        }
    }
    terminal.say("");
}

/// What was found before an error ended the work, on standard error, where the error follows: warnings explain it, notes
/// would bury it.
pub(super) fn before_the_error(findings: &[Finding], terminal: &mut Terminal) {
    for (severity, word) in ORDER {
        if severity > Severity::Note {
            for line in lines(findings, (severity, word), None, terminal.width()) {
                terminal.note(line.strip_prefix("  ").unwrap_or(&line));
            }
        }
    }
}

/// Findings of one kind up to which each is told in full.
const ALIKE: usize = 3;
/// How many are told in full where there are more, and a place has the others.
const TOLD: usize = 2;

/// What findings of one severity say, once however many of them say it.
struct Message<'a> {
    code: Code,
    /// Findings that say so.
    count: usize,
    /// Whom they name.
    subjects: Vec<&'a str>,
    text: String,
}

/// The findings of one severity as indented lines of at most `width` columns. Of many of one kind the first are told, the others
/// named where `place` has them.
fn lines(
    findings: &[Finding],
    (severity, word): (Severity, &str),
    place: Option<&str>,
    width: usize,
) -> Vec<String> {
    let messages = messages(findings, severity);
    let mut lines = Vec::new();
    let mut say = |text: &str| {
        for (line, text) in wrapped(&format!("{word}: {text}"), width - 4)
            .iter()
            .enumerate()
        {
            lines.push(format!("{}{text}", if line == 0 { "  " } else { "    " }));
        }
    };
    for (number, message) in messages.iter().enumerate() {
        let kind = || {
            messages
                .iter()
                .enumerate()
                .filter(|(_, other)| other.code == message.code)
        };
        let before = kind().filter(|(other, _)| *other < number).count();
        let many = kind().count() > ALIKE;
        match place {
            Some(place) if many && before == TOLD => {
                let others = || kind().skip(TOLD).map(|(_, other)| other);
                let count: usize = others().map(|other| other.count).sum();
                let names: Vec<&str> = others().flat_map(|other| other.subjects.clone()).collect();
                let colon = if names.is_empty() { "" } else { ": " };
                let names = names.join(", ");
                say(&format!(
                    "{count} more like these two in {place}{colon}{names}"
                ));
            }
            Some(_) if many && before > TOLD => {}
            _ => say(&message.text),
        }
    }
    lines
}

/// What the findings of one severity say, in their order.
fn messages(findings: &[Finding], severity: Severity) -> Vec<Message<'_>> {
    let of_severity: Vec<_> = findings
        .iter()
        .filter(|finding| finding.severity == severity)
        .collect();
    let mut messages = Vec::new();
    for (number, finding) in of_severity.iter().enumerate() {
        let same =
            |other: &&&Finding| (&other.code, &other.message) == (&finding.code, &finding.message);
        if of_severity[..number].iter().any(|other| same(&other)) {
            continue;
        }
        let alike = || of_severity.iter().filter(same);
        let subjects: Vec<_> = alike()
            .map(|finding| finding.subject.as_str())
            .filter(|subject| !subject.is_empty())
            .collect();
        messages.push(Message {
            code: finding.code,
            count: alike().count(),
            text: format!("{}{}", about(&subjects, finding.code), finding.message),
            subjects,
        });
    }
    messages
}

/// What stands before a message: the logs that it is about, where it does not name them.
pub(super) fn about(subjects: &[&str], code: Code) -> String {
    if !code.leaves_out_its_log() {
        return String::new();
    }
    match subjects {
        [] | [""] => String::new(),
        [first, second, _, ..] => format!("{first}, {second} and {} more: ", subjects.len() - 2),
        few => format!("{}: ", few.join(", ")),
    }
}

/// An indented paragraph as wide as the terminal.
pub(super) fn paragraph(text: &str, terminal: &mut Terminal) {
    indented(text, ["  ", "    "], terminal);
}

/// A paragraph as wide as the terminal whose first line and other lines begin like this.
pub(super) fn indented(text: &str, begin: [&str; 2], terminal: &mut Terminal) {
    let width = terminal.width() - begin[0].chars().count().max(begin[1].chars().count());
    for (number, line) in wrapped(text, width).iter().enumerate() {
        terminal.say(&format!("{}{line}", begin[usize::from(number > 0)]));
    }
}

pub(crate) fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    // A number and its unit stay together: between them is no ASCII blank.
    for word in text.split_ascii_whitespace() {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    const WARNING: (Severity, &str) = (Severity::Warning, "warning");

    #[test]
    fn of_many_of_one_kind_the_first_are_told_and_the_others_named() {
        let of = |count: usize| -> Vec<Finding> {
            let finding = |i| {
                let words = format!("`term{i}` moves by {i} sd");
                Finding::new(
                    Severity::Warning,
                    Code::DependsOnCutoff,
                    format!("term{i}"),
                    words,
                    0,
                )
            };
            (0..count).map(finding).collect()
        };
        let told = |count, place| lines(&of(count), WARNING, place, 80);
        assert_eq!(told(3, Some("the report")).len(), 3);
        assert_eq!(told(5, None).len(), 5);
        assert_eq!(
            told(5, Some("the report"))[1..],
            [
                "  warning: `term1` moves by 1 sd",
                "  warning: 3 more like these two in the report: term2, term3, term4"
            ]
        );
        // Messages that several findings share: all of their subjects are named, and what has no name counts.
        let finding = |subject: &str, words: &str| {
            Finding::new(Severity::Warning, Code::MissingTorque, subject, words, 0)
        };
        let mut shared = vec![
            finding("a", "one"),
            finding("b", "two"),
            finding("", "three"),
        ];
        shared.extend(["c", "d", "e"].map(|joint| finding(joint, "four")));
        let told = |all: &[Finding]| lines(all, WARNING, Some("the report"), 80);
        assert_eq!(
            told(&shared)[2..],
            ["  warning: 4 more like these two in the report: c, d, e"]
        );
        let nameless = ["one", "two", "three", "four"].map(|words| finding("", words));
        assert_eq!(
            told(&nameless)[2..],
            ["  warning: 2 more like these two in the report"]
        );
        let same = ["", "a", "b"].map(|joint| finding(joint, "same"));
        assert_eq!(told(&same), ["  warning: a, b: same"]);
        assert_eq!(about(&["a, b, c, d, e, f"], Code::AlikeInData), "");
        assert_eq!(about(&["run1.csv"], Code::Columns), "run1.csv: ");
    }

    #[test]
    fn lines_never_exceed_the_width() {
        let text = "word ".repeat(100);
        assert!(
            wrapped(&text, 76)
                .iter()
                .all(|line| line.chars().count() <= 76)
        );
    }
}
