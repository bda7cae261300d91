//! What a person reads first after a fit: the answer, the torque error, a row per joint, what limits the twin, what to do next.
//!
//! At most 40 lines, 55 on a terminal of fewer than 80 columns: what does not fit is counted, and `-v` prints it.

mod claims;
mod effects;
mod joints;
mod text;

pub(super) use effects::{unit, value};

use super::calibration::{quoted, report_of};
use crate::terminal::Terminal;
use std::path::{Path, PathBuf};
use text::{Page, Width, plain};
use twincal::Code;
use twincal::assess;
use twincal::calibrate::Calibration;
use twincal::validate::Split;
use twincal::words::significant;
use twincal::write_back::{Holds, Writer};
use twincal_io::words::{self, Answer};

/// Lines of the whole output, and of that on a narrow terminal.
const LINES: usize = 40;
const LINES_NARROW: usize = 55;
/// Lines that a command takes at most.
const COMMAND_LINES: usize = 7;
/// Columns below which a terminal is narrow.
const NARROW: usize = 80;

/// How much of each part is printed.
#[derive(Debug, Clone, Copy)]
struct Detail {
    /// Joints in the table, and effects beside them.
    joints: usize,
    effects: usize,
    /// Claims.
    claims: usize,
    /// Lines of a joint's further effects, of an effect, of a claim and of a next step.
    further: usize,
    effect: usize,
    claim: usize,
    step: usize,
}

/// From generous to terse; the first that fits is printed.
const DETAILS: [Detail; 9] = [
    Detail::of([8, 8, 5], [3, 3, 5, 5]),
    Detail::of([8, 8, 5], [2, 2, 4, 4]),
    Detail::of([8, 8, 5], [2, 2, 3, 3]),
    Detail::of([8, 8, 4], [2, 2, 3, 3]),
    Detail::of([8, 8, 3], [2, 2, 3, 3]),
    Detail::of([8, 6, 3], [1, 2, 3, 3]),
    Detail::of([8, 6, 3], [1, 1, 3, 2]),
    Detail::of([8, 5, 3], [1, 1, 2, 2]),
    Detail::of([6, 4, 3], [1, 1, 1, 2]),
];

impl Detail {
    const fn of([joints, effects, claims]: [usize; 3], lines: [usize; 4]) -> Self {
        let [further, effect, claim, step] = lines;
        Self {
            joints,
            effects,
            claims,
            further,
            effect,
            claim,
            step,
        }
    }
}

/// What stands around the page.
#[derive(Debug, Clone, Copy)]
pub(in crate::commands) struct Around<'a> {
    /// Folder of the result.
    pub(in crate::commands) output: &'a Path,
    /// Format of the model, `urdf` or `mjcf`.
    pub(in crate::commands) format: &'a str,
    /// What is printed in the place of the effects; they are printed where it is empty.
    pub(in crate::commands) instead: &'a [String],
    /// Lines that are printed behind the report's path.
    pub(in crate::commands) behind: usize,
    /// What was fitted, where it was files of logs.
    pub(in crate::commands) typed: Option<Typed<'a>>,
}

/// Paths as they were typed, so that commands with them run where this one did; nothing else was said with flags.
#[derive(Debug, Clone, Copy)]
pub(in crate::commands) struct Typed<'a> {
    pub(in crate::commands) model: &'a Path,
    pub(in crate::commands) logs: &'a [PathBuf],
    pub(in crate::commands) heldout: &'a [PathBuf],
}

/// Letters of the paths in a command at most: a longer one stands for itself alone.
const LETTERS: usize = 240;

impl Typed<'_> {
    /// `twincal doctor …` of these logs; `None` where that is long.
    fn doctor(self) -> Option<String> {
        let logs = paths(self.logs.iter().chain(self.heldout))?;
        let model = paths(std::iter::once(self.model))?;
        Some(format!("twincal doctor {logs} --model {model}"))
    }

    /// `twincal check …` of the held-out logs.
    fn check(self, output: &str) -> Option<String> {
        let logs = paths(self.heldout.iter())?;
        Some(format!("twincal check {logs} --twin {output}"))
    }
}

/// All of them, quoted; `None` of none, and where they are long.
fn paths(all: impl Iterator<Item = impl AsRef<Path>>) -> Option<String> {
    let words: Vec<String> = all
        .map(|path| quoted(&path.as_ref().to_string_lossy()))
        .collect();
    let words = words.join(" ");
    (1..=LETTERS)
        .contains(&words.chars().count())
        .then_some(words)
}

/// Prints all but the last line, which is the report's path.
pub(super) fn print(calibration: &Calibration, around: Around<'_>, terminal: &mut Terminal) {
    let answer = words::answer(calibration);
    terminal.answer(&answer.headline);
    let steps = Steps::of(calibration, &answer, around);
    let page = page(calibration, &steps, around, terminal.width());
    page.print(terminal);
}

/// The lines between the answer and the report's path.
fn page(calibration: &Calibration, steps: &Steps<'_>, around: Around<'_>, columns: usize) -> Page {
    let answer = steps.answer;
    let limit = match columns < NARROW {
        true => LINES_NARROW,
        false => LINES,
    };
    let width = Width(columns);
    let answer_lines = answer.headline.chars().count().div_ceil(columns);
    let path_lines = report_of(around.output).chars().count().div_ceil(columns);
    let taken = answer_lines + path_lines + around.behind;
    let mut pages = DETAILS.iter().map(|detail| {
        let mut page = Page::default();
        page.blank();
        scores(calibration, width, &mut page);
        page.blank();
        match around.instead.is_empty() {
            true => {
                joints::table(calibration, *detail, width, &mut page);
                effects::beside_the_joints(calibration, *detail, width, &mut page);
            }
            false => around
                .instead
                .iter()
                .for_each(|line| page.push(plain(line))),
        }
        page.blank();
        claims::list(calibration, answer, *detail, width, &mut page);
        next(calibration, steps, *detail, width, &mut page);
        page
    });
    let fits = |page: &Page| page.len() + taken <= limit;
    let mut last = Page::default();
    pages
        .find_map(|page| match fits(&page) {
            true => Some(page),
            false => {
                last = page;
                None
            }
        })
        .unwrap_or(last)
}

/// What stands before the second line of a score.
const OTHER_LINES: &str = "                ";

/// Torque error before and after, and what the intervals hold.
fn scores(calibration: &Calibration, width: Width, page: &mut Page) {
    let validation = &calibration.validation;
    let held_out = match &validation.split {
        Split::HeldoutLogs => "held-out logs",
        Split::LeaveOneLogOut => "logs left out one at a time",
        Split::LeaveLogGroupsOut => "logs left out in five groups",
        Split::LastThirty if calibration.logs.len() == 1 => "the last 30 % of the log",
        Split::LastThirty => "the last 30 % of each log",
        Split::NotTested => "",
    };
    let scores = assess::decisive(validation);
    if held_out.is_empty() || assess::rows_of(scores) == 0 {
        let text = "Torque error: not tested. --heldout LOG predicts a log that was not fitted.";
        page.paragraph(text, ["", "  "], width, 3);
        return;
    }
    let [before, after] = [scores.rmse_nominal, scores.rmse_calibrated];
    let change = match after / before - 1.0 {
        change if !change.is_finite() => String::new(),
        change if change.abs() < 5e-4 => " (unchanged)".into(),
        change => format!(
            " ({:.1} % {})",
            100.0 * change.abs(),
            if change < 0.0 { "less" } else { "more" }
        ),
    };
    let text = format!(
        "{} → {} {} RMSE{change} on {held_out}{}",
        significant(before, 3),
        significant(after, 3),
        words::pooled_unit(calibration),
        words::before_calibration(calibration),
    );
    page.paragraph(&text, ["Torque error    ", OTHER_LINES], width, 3);
    if scores.coverage95.is_finite() {
        let moving = match assess::has_standstill(validation) {
            true => " in which the joint moves",
            false => "",
        };
        let share = 100.0 * scores.coverage95;
        let text = format!("hold {share:.1} % of its rows{moving}");
        page.paragraph(&text, ["95 % intervals  ", OTHER_LINES], width, 2);
    }
}

/// What the next steps rest on.
struct Steps<'a> {
    answer: &'a Answer,
    /// Folder of the result as a command has it.
    output: String,
    /// What to run next.
    command: String,
}

impl<'a> Steps<'a> {
    fn of(calibration: &Calibration, answer: &'a Answer, around: Around<'_>) -> Self {
        let output = quoted(&around.output.to_string_lossy());
        let command = match answer.answer {
            assess::Answer::Yes | assess::Answer::YesWithinLimits => {
                export(calibration, around.format, &output)
            }
            assess::Answer::NotYet | assess::Answer::No => doubted(answer, around.typed, &output),
        };
        Self {
            answer,
            output,
            command,
        }
    }
}

/// The export of a file of the user's own kind, or of code where `export` would refuse that file.
fn export(calibration: &Calibration, format: &str, output: &str) -> String {
    let (holds, file) = match format {
        "mjcf" => (Holds::MJCF, "calibrated.xml"),
        _ => (Holds::URDF, "calibrated.urdf"),
    };
    let code = format!(
        "twincal export --twin {output} --to c -o twin.c writes the whole twin as code (also rust, python, json)"
    );
    match Writer::new(calibration, holds).and_then(|writer| writer.mean()) {
        Ok(change) if change.is_worse() => format!(
            "{code}: export refuses the {} alone, which predicts worse than your model",
            holds.format
        ),
        Ok(_) => format!("twincal export --twin {output} --to {format} -o {file}"),
        Err(_) => code,
    }
}

/// What to record, correct or run next.
fn next(
    calibration: &Calibration,
    steps: &Steps<'_>,
    detail: Detail,
    width: Width,
    page: &mut Page,
) {
    let begin = ["  ", "    "];
    page.heading("Next");
    if calibration
        .findings
        .iter()
        .any(twincal::Finding::doubts_the_log)
    {
        page.paragraph(super::summary::HOW_TO_FIX, begin, width, detail.step);
    }
    if let Some(recording) = &steps.answer.next {
        let text = format!("Recording: {recording}");
        page.paragraph(&text, begin, width, detail.step);
    }
    if let Some(motion) = words::next_motion(calibration, &steps.output) {
        page.paragraph(&motion.sentence(), begin, width, detail.step);
    }
    page.paragraph(&steps.command, begin, width, COMMAND_LINES);
    page.blank();
}

/// The command that says more of a doubt.
fn doubted(answer: &Answer, typed: Option<Typed<'_>>, output: &str) -> String {
    if answer.reason == Code::AnotherState {
        let check = typed.and_then(|typed| typed.check(output));
        let check = check.unwrap_or_else(|| format!("twincal check LOG --twin {output}"));
        return format!("{check} says what may have changed");
    }
    let doctor = typed.and_then(Typed::doctor);
    let doctor = doctor.unwrap_or_else(|| "twincal doctor LOG --model MODEL".to_owned());
    format!("{doctor} says what is wrong with a log or the model")
}

#[cfg(test)]
pub(super) mod tests;
