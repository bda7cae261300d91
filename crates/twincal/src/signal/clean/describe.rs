//! What a log holds, before anything is fitted: rates, cuts, motion and torque per joint.

use super::correct::Corrections;
use super::pieces::{Piece, Values};
use super::prepare::prepare;
use super::travel::LONGEST;
use crate::error::{Code, Finding, Result, Severity};
use crate::robot::Robot;
use crate::signal::log::joints::{JointFacts, joint_facts};
use crate::signal::log::long::{Log, Logs};
use crate::signal::log::recording::Recording;
use crate::signal::log::stamps::GAP;
use crate::words::significant;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Share of a joint's largest rms torque over the logs below which it was hardly driven.
const HARDLY_DRIVEN: f64 = 0.2;

/// Motion and torque of one joint in one log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointOverview {
    /// Joint name.
    pub joint: String,
    /// Smallest and largest position, rad or m.
    pub q_range: [f64; 2],
    /// Standard deviation of position, rad or m.
    pub q_sd: f64,
    /// Root mean square of velocity (logged, else by differences over five samples), rad/s or m/s.
    pub qd_rms: f64,
    /// Standard deviation of torque, N·m or N; `None` if not logged.
    pub tau_sd: Option<f64>,
    /// Root mean square of torque.
    pub tau_rms: Option<f64>,
    /// Whether velocity is logged.
    pub has_qd: bool,
    /// Whether acceleration is logged.
    pub has_qdd: bool,
}

/// One log at a glance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LogOverview {
    /// Name as given.
    pub name: String,
    /// Rows in the file.
    pub samples: u64,
    /// Time covered without gaps, s.
    pub duration: f64,
    /// One over the median step, Hz.
    pub rate_hz: f64,
    /// Stretches without a cut.
    pub segments: u64,
    /// Whether the clock is uneven.
    pub resampled: bool,
    /// Per moving joint.
    pub joints: Vec<JointOverview>,
}

/// Describes a log; findings are those of [`crate::signal::align`] without filters.
///
/// # Errors
/// Like [`crate::signal::align`], and of chapters that cannot be read.
pub fn describe(robot: &Robot, log: &Log<'_>) -> Result<(LogOverview, Vec<Finding>)> {
    let facts = joint_facts(robot);
    let mut sums = Sums::new(facts.len());
    let mut findings = Vec::new();
    match log {
        Log::Whole(recording) => sums.add(&facts, recording, &mut findings)?,
        Log::Long(long) => {
            findings.push(long.say(false));
            long.visit(&mut findings, |_, chapter, said| {
                sums.add(&facts, chapter, said)
            })?;
        }
    }
    Ok((sums.overview(log, &facts), findings))
}

/// What adds up over the chapters of a log.
struct Sums {
    duration: f64,
    /// Median step of each chapter, s.
    intervals: Vec<f64>,
    segments: u64,
    resampled: bool,
    /// Last stamp of the stretch that goes on to the end of the chapter before, s, if one does.
    end: Option<f64>,
    joints: Vec<JointSums>,
}

#[derive(Clone, Default)]
struct JointSums {
    /// Smallest and largest position; `None` before any.
    range: Option<[f64; 2]>,
    q: Moments,
    qd: Moments,
    tau: Moments,
    has_qd: bool,
    has_qdd: bool,
    has_tau: bool,
}

/// Rows of a log from one sample of a piece to the next: more than one where channels are logged at several rates.
fn stride(piece: &Piece<'_>) -> usize {
    let steps = piece.rows.windows(2).map(|pair| pair[1] - pair[0]);
    steps.min().unwrap_or(1)
}

impl Sums {
    fn new(joints: usize) -> Self {
        Self {
            duration: 0.0,
            intervals: Vec::new(),
            segments: 0,
            resampled: false,
            end: None,
            joints: vec![JointSums::default(); joints],
        }
    }

    fn add(
        &mut self,
        facts: &[JointFacts],
        log: &Recording,
        findings: &mut Vec<Finding>,
    ) -> Result<()> {
        let prepared = prepare(facts, log, false, &Corrections::default(), findings)?;
        let (pieces, interval) = (&prepared.pieces, prepared.interval);
        self.duration += prepared.seconds();
        self.segments += pieces.len() as u64;
        // A chapter is no cut of the log: what goes on in it was counted in the one before.
        let stamp = |row: usize| log.time[row];
        let starts = pieces.first().filter(|piece| piece.rows[0] < stride(piece));
        if let (Some(piece), Some(end)) = (starts, self.end) {
            let step = stamp(piece.rows[0]) - end;
            if (0.0..=GAP * interval).contains(&step) {
                self.segments -= 1;
                self.duration += step;
            }
        }
        let last = log.time.len().saturating_sub(1);
        let ends = pieces.last().filter(|piece| {
            let row = piece.rows[piece.rows.len() - 1];
            // Of several samples with one stamp the first is taken, and of a receiver's repeats.
            let repeats = if prepared.time.is_some() { LONGEST } else { 0 };
            last - row < stride(piece) + repeats || stamp(last) <= stamp(row)
        });
        self.end = ends.and_then(|piece| piece.rows.last().map(|&row| stamp(row)));
        self.intervals.push(interval);
        self.resampled |= pieces.iter().any(Piece::resampled);
        let joints = self.joints.par_iter_mut().zip(&log.joints).enumerate();
        joints.for_each(|(joint, (sums, channels))| {
            (sums.has_qd, sums.has_qdd) = (channels.qd.is_some(), channels.qdd.is_some());
            sums.has_tau = channels.tau.is_some();
            for piece in pieces {
                sums.add(&piece.joints[joint], interval);
            }
        });
        Ok(())
    }

    fn overview(mut self, log: &Log<'_>, facts: &[JointFacts]) -> LogOverview {
        self.intervals.sort_by(f64::total_cmp);
        let interval = self.intervals.get(self.intervals.len() / 2).copied();
        let joint = |(facts, sums): (&JointFacts, &JointSums)| JointOverview {
            joint: facts.name.clone(),
            q_range: sums.range.unwrap_or([f64::NAN; 2]),
            q_sd: sums.q.sd(),
            qd_rms: sums.qd.rms(),
            tau_sd: sums.has_tau.then(|| sums.tau.sd()),
            tau_rms: sums.has_tau.then(|| sums.tau.rms()),
            has_qd: sums.has_qd,
            has_qdd: sums.has_qdd,
        };
        LogOverview {
            name: log.name().to_owned(),
            samples: log.samples(),
            duration: self.duration,
            rate_hz: 1.0 / interval.unwrap_or(f64::NAN),
            segments: self.segments,
            resampled: self.resampled,
            joints: facts.iter().zip(&self.joints).map(joint).collect(),
        }
    }
}

impl JointSums {
    fn add(&mut self, values: &Values<'_>, interval: f64) {
        for q in &*values.q {
            let [low, high] = self.range.unwrap_or([*q; 2]);
            self.range = Some([low.min(*q), high.max(*q)]);
        }
        self.q.add(&values.q);
        match &values.qd {
            Some(qd) => self.qd.add(qd),
            None => {
                let windows = values.q.windows(6);
                let differences: Vec<f64> =
                    windows.map(|w| (w[5] - w[0]) / (5.0 * interval)).collect();
                self.qd.add(&differences);
            }
        }
        self.tau.add(values.tau.as_deref().unwrap_or_default());
    }
}

/// Mean and spread of numbers that come in parts.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: f64,
    mean: f64,
    /// `Σ (x − mean)²`.
    squares: f64,
}

impl Moments {
    /// Chan, Golub & LeVeque (1983), eq. 2.1.
    fn add(&mut self, x: &[f64]) {
        if x.is_empty() {
            return;
        }
        let count = x.len() as f64;
        let mean = x.iter().sum::<f64>() / count;
        let squares: f64 = x.iter().map(|x| (x - mean).powi(2)).sum();
        let (all, apart) = (self.count + count, mean - self.mean);
        self.squares += squares + apart * apart * self.count * count / all;
        self.mean += apart * count / all;
        self.count = all;
    }

    fn sd(&self) -> f64 {
        (self.squares / self.count.max(1.0)).sqrt()
    }

    fn rms(&self) -> f64 {
        self.mean.hypot(self.sd())
    }
}

/// Joints whose torque in a log is below a fifth of what it is in another log: they were hardly driven there, and
/// their motion is that of a passive joint.
///
/// # Errors
/// Of chapters that cannot be read.
pub fn hardly_driven<'a>(robot: &Robot, logs: impl Into<Logs<'a>>) -> Result<Vec<Finding>> {
    let Logs(logs) = logs.into();
    let sized = |log: &Log<'_>| Ok((log.name().to_owned(), torque_rms(log)?));
    let sizes: Vec<(String, Vec<Option<f64>>)> = logs.iter().map(sized).collect::<Result<_>>()?;
    Ok(less_driven(robot, &sizes))
}

/// [`hardly_driven`] from the names of the logs and the root mean square of each joint's torque.
pub(crate) fn less_driven(robot: &Robot, logs: &[(String, Vec<Option<f64>>)]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (joint, name) in robot.joint_names().into_iter().enumerate() {
        let torques = logs.iter().filter_map(|(_, torque)| torque[joint]);
        let largest = torques.fold(0.0, f64::max);
        for (log, torque) in logs {
            let Some(torque) = torque[joint].filter(|t| *t < HARDLY_DRIVEN * largest) else {
                continue;
            };
            let message = format!(
                "joint `{name}` is hardly driven: rms torque {}, {:.1} % of its largest in any log",
                significant(torque, 3),
                100.0 * torque / largest
            );
            let (severity, code) = (Severity::Note, Code::JointNotDriven);
            let numbers = [("rms_torque", torque), ("share", torque / largest)];
            let finding = Finding::new(severity, code, log, message, 0).with(numbers);
            findings.push(finding.of_joint(name));
        }
    }
    findings
}

/// Root mean square of each joint's finite torques as logged; `None` without any.
///
/// # Errors
/// Of chapters that cannot be read.
pub(crate) fn torque_rms(log: &Log<'_>) -> Result<Vec<Option<f64>>> {
    let mut sums: Vec<(f64, usize)> = Vec::new();
    log.until(|recording| {
        sums.resize(recording.joints.len(), (0.0, 0));
        for ((sum, count), channels) in sums.iter_mut().zip(&recording.joints) {
            let torque = channels.tau.iter().flatten().filter(|t| t.is_finite());
            for tau in torque {
                *sum += tau * tau;
                *count += 1;
            }
        }
        false
    })?;
    let mean = |(sum, count)| (count > 0).then(|| f64::sqrt(sum / count as f64));
    Ok(sums.into_iter().map(mean).collect())
}
