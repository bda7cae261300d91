//! The clock of one log: which rows go on, where time is cut, and whether what is left ticks evenly.

use super::repeats::{Cut, Sampled, sampled};
use crate::error::{Code, Error, Finding, Result, Severity, WrongUnit};
use crate::signal::log::recording::Recording;
use crate::signal::log::stamps::{EVEN, GAP, is_plausible_step, median_positive};
use rayon::prelude::*;

/// Share of intervals' deviation (99 % of them) beyond which a jitter warning is given.
const JITTER: f64 = 0.2;
/// Stamps closer than this share of the median interval are one sample, seen twice.
const CROWDED: f64 = 0.1;
/// Share of NaN or infinite rows beyond which the log counts as degraded.
const NOT_FINITE_LIMIT: f64 = 0.01;
/// Size of a value that is no measurement of any robot in any unit; squares of much larger ones overflow.
const LARGEST: f64 = 1e12;
/// Share of contradicting duplicates beyond which the log counts as degraded.
const CONTRADICTION_LIMIT: f64 = 0.001;

/// Rows of a log without a cut between them.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Run {
    /// Ascending indices into the recording.
    pub(crate) rows: Vec<usize>,
}

/// What [`read_clock`] found.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Clock {
    /// In the log's order, none empty.
    pub(crate) runs: Vec<Run>,
    /// Median step, or the controller's, s.
    pub(crate) interval: f64,
    /// What stands in place of the rows as logged.
    pub(crate) sampled: Sampled,
}

impl Clock {
    /// Stamp of a row, s.
    pub(crate) fn stamp(&self, log: &Recording, row: usize) -> f64 {
        self.sampled.time.as_ref().unwrap_or(&log.time)[row]
    }
}

fn log_error(log: &Recording, problem: impl Into<String>, remedy: impl Into<String>) -> Error {
    Error::Log {
        log: log.name.clone(),
        problem: problem.into(),
        remedy: remedy.into(),
    }
}

/// All channels of a log with a name for messages.
fn channels<'a>(log: &'a Recording, names: &[String]) -> Vec<(String, &'a [f64])> {
    let mut all = vec![("time".to_owned(), log.time.as_slice())];
    for (joint, name) in log.joints.iter().zip(names) {
        all.push((format!("position of joint `{name}`"), &joint.q));
        for (what, channel) in [
            ("velocity", &joint.qd),
            ("acceleration", &joint.qdd),
            ("torque", &joint.tau),
        ] {
            if let Some(values) = channel {
                all.push((format!("{what} of joint `{name}`"), values));
            }
        }
    }
    all
}

/// Checks shapes, drops rows that are not finite or repeated, cuts at steps back, gaps and dropped rows.
///
/// With `every_row` (pipeline off) repeated stamps stay and the unit of time is only doubted, not refused.
///
/// # Errors
/// [`Error::Log`] if the log is shorter than `minimum` rows, a channel has another length or no finite value, no
/// time passes, or the median step says that time is not in seconds.
pub(crate) fn read_clock(
    log: &Recording,
    names: &[String],
    minimum: usize,
    every_row: bool,
    findings: &mut Vec<Finding>,
) -> Result<Clock> {
    let samples = log.time.len();
    let channels = channels(log, names);
    for (name, values) in &channels {
        if values.len() != samples {
            return Err(log_error(
                log,
                format!("{name} has {} values, time has {samples}", values.len()),
                "give every channel one value per row",
            ));
        }
    }
    if samples < minimum {
        let word = if samples == 1 { "sample" } else { "samples" };
        return Err(log_error(
            log,
            format!("{samples} {word}, needs at least {minimum}"),
            "record a longer motion",
        ));
    }
    for (name, values) in &channels {
        if values.iter().all(|v| !v.is_finite()) {
            return Err(log_error(
                log,
                format!("{name} is NaN or infinite in all {samples} rows"),
                "map the channel to a column that has values, or leave it out",
            ));
        }
    }
    let (kept, dropped) = finite_rows(log, &channels, findings);
    let interval = median_interval(log, &kept, every_row, findings)?;
    let mut rows = Cut {
        kept: &kept,
        before: &dropped,
        interval,
        every_row,
    };
    let sampled = sampled(log, names, &rows, findings);
    rows.interval = sampled.interval.unwrap_or(interval);
    let runs = cut(log, &channels, &rows, &sampled, findings);
    Ok(Clock {
        runs,
        interval: rows.interval,
        sampled,
    })
}

/// Rows whose every channel has a sample, and for each whether rows were dropped right before it.
fn finite_rows(
    log: &Recording,
    channels: &[(String, &[f64])],
    findings: &mut Vec<Finding>,
) -> (Vec<usize>, Vec<bool>) {
    let samples = log.time.len();
    let is_sample = |value: &f64| value.abs() < LARGEST;
    let all_are = |(_, values): &(String, &[f64])| values.iter().all(is_sample);
    if channels.par_iter().all(all_are) {
        return ((0..samples).collect(), vec![false; samples]);
    }
    let (mut kept, mut cut_before) = (Vec::with_capacity(samples), Vec::with_capacity(samples));
    let mut per_channel = vec![0_usize; channels.len()];
    let mut cut = false;
    for row in 0..samples {
        let mut finite = true;
        for (count, (_, values)) in per_channel.iter_mut().zip(channels) {
            if !is_sample(&values[row]) {
                *count += 1;
                finite = false;
            }
        }
        if finite {
            kept.push(row);
            cut_before.push(cut);
        }
        cut = !finite;
    }
    let missing = MissingSamples {
        log,
        channels,
        per_channel,
        lost: samples - kept.len(),
    };
    if let Some(every) = slower_channels(&kept, samples) {
        findings.push(missing.of_slower_channels(every, kept.len()));
        cut_before.fill(false);
    } else if missing.lost > 0 {
        findings.push(missing.not_finite());
    }
    (kept, cut_before)
}

/// Where a log lacks samples.
struct MissingSamples<'a> {
    log: &'a Recording,
    channels: &'a [(String, &'a [f64])],
    /// Rows in which a channel has no sample, channel by channel.
    per_channel: Vec<usize>,
    /// Rows in which some channel has no sample.
    lost: usize,
}

impl MissingSamples<'_> {
    /// The first four channels that lack more than so many tenths of their samples, and how many they lack.
    fn lacking(&self, tenths: usize) -> impl Iterator<Item = (&str, usize)> {
        let samples = self.log.time.len();
        (self.channels.iter().zip(&self.per_channel))
            .filter(move |(_, count)| **count * 10 > tenths * samples)
            .take(4)
            .map(|((name, _), count)| (name.as_str(), *count))
    }

    /// Channels that have a value only in every so many rows, of which `kept` hold all channels.
    fn of_slower_channels(&self, every: usize, kept: usize) -> Finding {
        let names: Vec<&str> = self.lacking(1).map(|(name, _)| name).collect();
        let ending = ["th", "st", "nd", "rd"][if every < 4 { every } else { 0 }];
        Finding::new(
            Severity::Warning,
            Code::SlowerChannels,
            &self.log.name,
            format!(
                "{} have a value only in every {every}{ending} row: the log is read at that rate, from the {kept} rows that hold all channels; they share one clock, so no skew can be estimated",
                names.join(", "),
            ),
            self.lost as u64,
        )
        .with([("every", every as f64), ("rows", kept as f64)])
    }

    /// Rows with values that are no samples.
    fn not_finite(&self) -> Finding {
        let (samples, lost) = (self.log.time.len(), self.lost);
        let worst: Vec<String> = (self.lacking(0))
            .map(|(name, count)| format!("{name}: {count}"))
            .collect();
        let share = lost as f64 / samples as f64;
        let severity = if share > NOT_FINITE_LIMIT {
            Severity::Degraded
        } else {
            Severity::Warning
        };
        Finding::new(
            severity,
            Code::NotFiniteRows,
            &self.log.name,
            format!(
                "{lost} of {samples} rows ({:.2} %) have values that are NaN, infinite or beyond {LARGEST:e} ({}) and were dropped; the log is cut there",
                100.0 * share,
                worst.join(", ")
            ),
            lost as u64,
        )
        .with([("rows", samples as f64), ("share", share), ("limit", LARGEST)])
    }
}

/// k if nearly all complete rows are k ≥ 2 rows apart: the table joins topics of different rates.
fn slower_channels(kept: &[usize], samples: usize) -> Option<usize> {
    let steps = kept.windows(2).map(|pair| pair[1] - pair[0]);
    let mut sorted: Vec<usize> = steps.clone().collect();
    sorted.sort_unstable();
    let every = *sorted.get(sorted.len() / 2).filter(|every| **every >= 2)?;
    let regular = steps
        .filter(|step| step.abs_diff(every) <= every / 4)
        .count();
    (regular * 10 >= sorted.len() * 9 && kept.len() * every * 5 > samples * 4).then_some(every)
}

/// Median step of the rows that are kept, if it is plausible.
fn median_interval(
    log: &Recording,
    kept: &[usize],
    every_row: bool,
    findings: &mut Vec<Finding>,
) -> Result<f64> {
    let steps = kept
        .windows(2)
        .map(|pair| log.time[pair[1]] - log.time[pair[0]]);
    let Some(interval) = median_positive(steps) else {
        let stamp = |row: Option<&usize>| row.map_or(f64::NAN, |&row| log.time[row]);
        let (first, last) = (stamp(kept.first()), stamp(kept.last()));
        let problem = match last < first {
            true => format!("time runs backwards: the stamps fall from {first} to {last} s"),
            false => format!("no time passes: every time stamp is {first}"),
        };
        return Err(log_error(
            log,
            problem,
            "map the right time column, or give the sampling rate with --rate HZ",
        ));
    };
    if is_plausible_step(interval) {
        return Ok(interval);
    }
    let step = ImplausibleStep::of(interval);
    if every_row {
        let ImplausibleStep {
            problem, remedy, ..
        } = &step;
        findings.push(
            Finding::new(
                Severity::Warning,
                Code::ImplausibleTimeStep,
                &log.name,
                format!("{problem}; {remedy}. With the filter off time is only copied"),
                0,
            )
            .with([("interval", interval)])
            .with(step.unit.map(|(_, rate)| ("rate", rate))),
        );
        return Ok(interval);
    }
    Err(match step.unit {
        Some((unit, _)) => Error::Unit {
            log: log.name.clone(),
            unit,
            problem: step.problem,
            remedy: step.remedy,
        },
        None => log_error(log, step.problem, step.remedy),
    })
}

/// A median step that no log of a robot has.
struct ImplausibleStep {
    problem: String,
    remedy: String,
    /// The unit that the stamps look like, and the rate that they have then, Hz.
    unit: Option<(WrongUnit, f64)>,
}

impl ImplausibleStep {
    fn of(interval: f64) -> Self {
        let rate = |size: f64| 1.0 / (interval * size);
        let guess = [
            (WrongUnit::Milliseconds, "milliseconds", "ms", 1e-3),
            (WrongUnit::Microseconds, "microseconds", "us", 1e-6),
            (WrongUnit::Nanoseconds, "nanoseconds", "ns", 1e-9),
        ]
        .into_iter()
        .find(|(.., size)| (10.0..=1e5).contains(&rate(*size)));
        match guess {
            Some((wrong, unit, short, size)) => Self {
                problem: format!(
                    "the median time step is {interval} s; the stamps look like {unit} ({} Hz)",
                    (1e3 / (interval * size)).round() / 1e3
                ),
                remedy: format!(
                    "say [columns] time_unit = \"{short}\", divide by {:.0} where the log is made, or give the right --rate HZ",
                    1.0 / size
                ),
                unit: Some((wrong, rate(size))),
            },
            None => Self {
                problem: format!(
                    "the median time step of {interval} s is implausible for a robot log (0.01 ms to 0.5 s)"
                ),
                remedy: "give time in seconds, or the sampling rate with --rate HZ".to_owned(),
                unit: None,
            },
        }
    }
}

/// Cuts the kept rows into runs.
fn cut(
    log: &Recording,
    channels: &[(String, &[f64])],
    rows: &Cut<'_>,
    sampled: &Sampled,
    findings: &mut Vec<Finding>,
) -> Vec<Run> {
    let (interval, every_row) = (rows.interval, rows.every_row);
    let time = sampled.time.as_ref().unwrap_or(&log.time);
    let mut stamps = IrregularStamps::default();
    let mut runs = Vec::new();
    let mut run = Run::default();
    let mut cut = false;
    for (&row, &before) in rows.kept.iter().zip(rows.before) {
        cut |= before;
        if sampled.dropped.get(row).is_some_and(|dropped| *dropped) {
            continue;
        }
        let cut = std::mem::take(&mut cut);
        let Some(&last) = run.rows.last() else {
            run.rows.push(row);
            continue;
        };
        let step = time[row] - time[last];
        if step == 0.0 && !every_row {
            if channels
                .iter()
                .all(|(_, values)| values[row] == values[last])
            {
                stamps.same += 1;
            } else {
                stamps.contradicting += 1;
            }
            continue;
        }
        if step > 0.0 && step < CROWDED * interval && !every_row {
            stamps.crowded += 1;
            continue;
        }
        stamps.back += u64::from(step < 0.0);
        let gap = step > GAP * interval;
        if gap && !cut {
            stamps.gaps += 1;
            stamps.longest = stamps.longest.max(step);
        }
        if step < 0.0 || gap || cut {
            runs.push(std::mem::take(&mut run));
        }
        run.rows.push(row);
    }
    runs.push(run);
    runs.retain(|run| !run.rows.is_empty());
    report_stamps(log, &stamps, interval, findings);
    runs
}

/// What [`cut`] counts of the steps from one kept row to the next.
#[derive(Default)]
struct IrregularStamps {
    /// Rows that repeat the stamp and all values of the row before.
    same: u64,
    /// Rows that repeat the stamp with other values.
    contradicting: u64,
    /// Rows that follow by less than [`CROWDED`] intervals.
    crowded: u64,
    /// Steps back in time.
    back: u64,
    /// Steps longer than [`GAP`] intervals.
    gaps: u64,
    /// The longest gap, s.
    longest: f64,
}

/// Says which rows were dropped for their stamps, and where the log is cut.
fn report_stamps(
    log: &Recording,
    stamps: &IrregularStamps,
    interval: f64,
    findings: &mut Vec<Finding>,
) {
    let mut say = |severity, code: Code, message: String, count, numbers: &[_]| {
        let finding = Finding::new(severity, code, &log.name, message, count);
        findings.push(finding.with(numbers.iter().copied()));
    };
    let &IrregularStamps {
        same,
        contradicting,
        crowded,
        back,
        gaps,
        longest,
    } = stamps;
    if same > 0 {
        let text = format!(
            "{same} rows repeat the stamp and all values of the row before and were dropped"
        );
        say(Severity::Note, Code::DuplicateRows, text, same, &[]);
    }
    if contradicting > 0 {
        let share = contradicting as f64 / log.time.len() as f64;
        let severity = if share > CONTRADICTION_LIMIT {
            Severity::Degraded
        } else {
            Severity::Warning
        };
        let text = format!(
            "{contradicting} rows ({:.3} %) repeat a stamp with other values; the first of each was kept: look at how the log was joined",
            100.0 * share
        );
        let (code, numbers) = (Code::ContradictingDuplicates, [("share", share)]);
        say(severity, code, text, contradicting, &numbers);
    }
    if crowded > 0 {
        let text = format!(
            "{crowded} rows follow the row before by less than {:.0} % of the median step and were dropped: stamp at the source, not at arrival",
            100.0 * CROWDED
        );
        let (code, numbers) = (Code::CrowdedStamps, [("share_of_step", CROWDED)]);
        say(Severity::Warning, code, text, crowded, &numbers);
    }
    if back > 0 {
        let text = format!("time steps back {back} times; the log is cut there");
        say(Severity::Warning, Code::TimeStepsBack, text, back, &[]);
    }
    if gaps > 0 {
        let text = format!(
            "{gaps} gaps longer than {GAP} median steps ({:.6} s), the longest {longest:.6} s; the log is cut there",
            interval
        );
        let numbers = [("steps", GAP), ("interval", interval), ("longest", longest)];
        say(Severity::Note, Code::Gaps, text, gaps, &numbers);
    }
}

/// "12", "0.35", "0.0021": two digits, however small.
fn two_digits(value: f64) -> String {
    let decimals = if value > 0.0 {
        (1.0 - value.log10().floor()).clamp(0.0, 9.0) as usize
    } else {
        0
    };
    format!("{value:.decimals$}")
}

/// Says how uneven a resampled run is.
pub(crate) fn report_jitter(
    log: &Recording,
    runs: &[Run],
    clock: &Clock,
    resampled: u64,
    findings: &mut Vec<Finding>,
) {
    // What was found on repeated rows says it.
    if clock.sampled.time.is_some() {
        return;
    }
    let interval = clock.interval;
    let dropped = |row: usize| {
        clock
            .sampled
            .dropped
            .get(row)
            .is_some_and(|dropped| *dropped)
    };
    let mut deviations: Vec<f64> = runs
        .iter()
        .flat_map(|run| run.rows.windows(2))
        .filter(|pair| !(pair[0]..pair[1]).any(dropped))
        .map(|pair| ((log.time[pair[1]] - log.time[pair[0]]) / interval - 1.0).abs())
        .collect();
    if resampled == 0 || deviations.iter().all(|deviation| *deviation <= EVEN) {
        return;
    }
    let beyond = deviations.iter().filter(|d| **d > JITTER).count();
    let rank = (deviations.len() - 1) * 99 / 100;
    let (_, &mut typical, _) = deviations.select_nth_unstable_by(rank, f64::total_cmp);
    let largest = deviations.iter().copied().fold(0.0, f64::max);
    let (severity, advice) = if typical > JITTER {
        (
            Severity::Warning,
            "; stamp at the source for a better estimate",
        )
    } else {
        (Severity::Note, "")
    };
    findings.push(Finding::new(
        severity,
        Code::Resampled,
        &log.name,
        format!(
            "the clock is uneven: 99 % of the steps are within {} % of the median ({:.3} Hz), the largest is off by {} %, {beyond} by more than {:.0} %; resampled by a cubic spline{advice}",
            two_digits(100.0 * typical),
            1.0 / interval,
            two_digits(100.0 * largest),
            100.0 * JITTER
        ),
        resampled,
    )
    .with([
        ("jitter99", typical), ("rate", 1.0 / interval), ("jitter_largest", largest),
        ("steps_beyond", beyond as f64), ("jitter_limit", JITTER),
    ]));
}
