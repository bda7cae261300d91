//! The logs of a calibration as rows, with what was read, dropped and masked.

use super::log::Log;
use super::log_summary::LogSummary;
use super::reader::{Reader, Role};
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::gram::Gram;
use crate::likelihood::Columns;
use crate::observations::{GramSum, Observations, Part};
use crate::robot::Robot;
use crate::rows::{RowBlock, RowSignal, Slice, count_rows, spread_raw, visit_slices};
use crate::signal::{self, Auto, Payload, Pipeline, ReadyLog, Trajectory};
use crate::term::Library;
use crate::twin::Twin;
use rayon::prelude::*;

/// A column whose root mean square is below this share of what it is when the robot moves anyhow is zero on these data:
/// a share of its own size, so that units do not matter (case 89).
const ZERO: f64 = 1e-12;
/// Rows per column of the largest joint below which nothing is fitted (case 7).
const ROWS_PER_COLUMN: usize = 3;
/// Logs at most that the torque outside the band is measured on.
pub(in crate::calibrate) const LOGS_OF_RAW: usize = 40;

/// The logs' motion, apart from their rows: it is dropped first.
#[derive(Default)]
pub(in crate::calibrate) struct Trajectories {
    pub(in crate::calibrate) fit: Vec<Trajectory>,
    pub(in crate::calibrate) heldout: Vec<Trajectory>,
}

impl Trajectories {
    /// Those of all logs.
    pub(in crate::calibrate) fn all(&self) -> impl Iterator<Item = &Trajectory> {
        self.fit.iter().chain(&self.heldout)
    }
}

/// All logs of a calibration.
pub(in crate::calibrate) struct Data {
    pub(in crate::calibrate) fit: Vec<Log>,
    pub(in crate::calibrate) heldout: Vec<Log>,
    pub(in crate::calibrate) findings: Vec<Finding>,
    /// See [`carry_something`].
    unknown: bool,
    /// What the robot carried in each fit log.
    pub(in crate::calibrate) payloads: Vec<Payload>,
}

impl Data {
    /// Aligns and filters every log; `elsewhere`: the pipelines of the sweep.
    pub(in crate::calibrate) fn read(
        robot: &Robot,
        library: &Library,
        (pipeline, elsewhere): (&Pipeline, &[Pipeline]),
        logs: &[ReadyLog<'_>],
        heldout: &[ReadyLog<'_>],
    ) -> Result<(Self, Trajectories)> {
        let mut findings = Vec::new();
        let loads = logs.iter().chain(heldout).map(ReadyLog::payload);
        let reader = Reader {
            robot,
            library,
            pipeline,
            unknown: carry_something(loads),
        };
        let mut read = |logs: &[ReadyLog<'_>], role: Role<'_>| -> Result<(Vec<Log>, Vec<_>)> {
            let one = |log| reader.log(log, role, &mut findings);
            logs.iter().map(one).collect()
        };
        let (fit, of_fit) = read(logs, Role::Fit(elsewhere))?;
        let (heldout, of_heldout) = read(heldout, Role::HeldOut)?;
        let data = Self {
            fit,
            heldout,
            findings,
            unknown: reader.unknown,
            payloads: logs.iter().map(ReadyLog::payload).collect(),
        };
        let trajectories = Trajectories {
            fit: of_fit,
            heldout: of_heldout,
        };
        Ok((data, trajectories))
    }

    /// Held-out logs alone.
    pub(in crate::calibrate) fn read_heldout(
        reader: Reader<'_>,
        logs: &[ReadyLog<'_>],
    ) -> Result<(Self, Trajectories)> {
        let mut findings = Vec::new();
        let read = logs
            .iter()
            .map(|log| reader.log(log, Role::HeldOut, &mut findings))
            .collect::<Result<Vec<_>>>()?;
        let (heldout, motion) = read.into_iter().unzip();
        let data = Self {
            fit: Vec::new(),
            heldout,
            findings,
            unknown: reader.unknown,
            payloads: Vec::new(),
        };
        let trajectories = Trajectories {
            fit: Vec::new(),
            heldout: motion,
        };
        Ok((data, trajectories))
    }

    /// Whether the payload component acts in a log.
    pub(in crate::calibrate) fn acts(&self, payload: Payload) -> bool {
        !self.unknown || payload == Payload::Unknown
    }

    /// All rows of the fit logs.
    pub(in crate::calibrate) fn training(&self) -> Vec<Part<'_>> {
        let logs = self.fit.iter();
        logs.map(|log| log.observations.whole()).collect()
    }

    /// Drops the columns that are zero on all fit logs, e.g. of joints that never move; returns their indices.
    pub(in crate::calibrate) fn drop_zero_columns(
        &mut self,
        library: Library,
    ) -> (Library, Vec<usize>) {
        let fit = self.fit.iter().map(|log| &log.observations);
        let zero = zero_columns(fit, &library);
        self.findings.extend(zero_findings(&library, &zero));
        for log in self.fit.iter_mut().chain(&mut self.heldout) {
            log.observations.drop_columns(&zero);
            for gram in log.elsewhere.iter_mut().flatten() {
                gram.drop_columns(&zero);
            }
        }
        (library.without_columns(&zero), zero)
    }

    /// How far the nominal torque is from the measured one, of the joint that moves where it is least far: its number and the root mean squares of
    /// difference and torque, N·m. Moving rows of the fit logs; `None` without any.
    pub(in crate::calibrate) fn nominal_misfit(&self) -> Option<(usize, [f64; 2])> {
        let joints = self.fit.first()?.observations.joints.len();
        let ratio = |[difference, torque]: [f64; 2]| difference / torque;
        let mut least: Option<(usize, [f64; 2])> = None;
        for joint in 0..joints {
            let (mut sums, mut rows) = ([0.0; 2], 0.0);
            for log in &self.fit {
                let own = &log.observations.joints[joint];
                let measured = own.measured.get();
                let beyond = own.beyond_nominal(0..own.y.len());
                let torques = beyond.iter().zip(measured.iter());
                let moving = torques.zip(&own.standstill).filter(|(_, still)| !**still);
                for ((difference, torque), _) in moving {
                    sums[0] += difference * difference;
                    sums[1] += torque * torque;
                    rows += 1.0;
                }
            }
            let rms = sums.map(|sum| (sum / rows).sqrt());
            if rows > 0.0 && least.is_none_or(|(_, other)| ratio(rms) < ratio(other)) {
                least = Some((joint, rms));
            }
        }
        least
    }

    /// sd per joint of the torque outside the filter's band, from the raw residual of the fit logs; 0 with the filter off.
    pub(in crate::calibrate) fn out_of_band(
        &self,
        robot: &Robot,
        library: &Library,
        pipeline: &Pipeline,
        trajectories: &Trajectories,
        beta: &[f64],
    ) -> Result<Vec<f64>> {
        let dof = robot.dof();
        if pipeline.cutoff_hz == 0.0 {
            return Ok(vec![0.0; dof]);
        }
        let (mut raw, mut in_band) = (vec![(0.0, 0.0); dof], vec![(0.0, 0.0); dof]);
        // Of many logs every so many.
        let step = self.fit.len().div_ceil(LOGS_OF_RAW).max(1);
        for (log, trajectory) in self.fit.iter().zip(&trajectories.fit).step_by(step) {
            let (slices, times) = spread(pipeline, trajectory);
            let sums: Vec<Vec<(f64, f64)>> = slices
                .into_par_iter()
                .map(|slice| raw_squares(robot, library, pipeline, trajectory, slice, beta))
                .collect::<Result<_>>()?;
            for slice in sums {
                for (sum, more) in raw.iter_mut().zip(slice) {
                    *sum = (sum.0 + more.0, sum.1 + more.1);
                }
            }
            let (rows, whole) = (&log.observations, log.observations.whole());
            let seen: Vec<bool> = rows.time.iter().map(|t| within(&times, *t)).collect();
            for (joint, sum) in in_band.iter_mut().enumerate() {
                let residual = whole.residual(joint, beta, 0..rows.len());
                let still = rows.joints[joint].standstill.iter().zip(&seen);
                let left_out: Vec<bool> = still.map(|(still, seen)| *still || !seen).collect();
                add_squares(sum, &residual, &left_out);
            }
        }
        let mean = |sum: (f64, f64)| if sum.1 > 0.0 { sum.0 / sum.1 } else { 0.0 };
        Ok((0..dof)
            .map(|j| (mean(raw[j]) - mean(in_band[j])).max(0.0).sqrt())
            .collect())
    }
}

/// What is said of columns that were left out.
pub(in crate::calibrate) fn zero_findings(library: &Library, zero: &[usize]) -> Vec<Finding> {
    let terms = zero
        .iter()
        .map(|&column| &library.terms()[library.columns()[column]]);
    // What was not followed is no fault of the logs.
    let said = terms.filter(|term| !term.family.remembers()).map(|term| {
        let name = &term.name;
        Finding::new(
            Severity::Warning,
            Code::ZeroColumn,
            name.clone(),
            format!("term `{name}` has no torque on any row of these logs and was left out: its joints do not move"),
            0,
        )
    });
    said.collect()
}

/// Columns of the library that are zero on these rows.
pub(in crate::calibrate) fn zero_columns<'a>(
    logs: impl Iterator<Item = &'a Observations> + Clone,
    library: &Library,
) -> Vec<usize> {
    let mut square = vec![0.0_f64; library.columns().len()];
    for observations in logs.clone() {
        let len = observations.len();
        for joint in &observations.joints {
            joint.visit_columns(len, 0..len, &mut |rows, values| {
                let still = &joint.standstill[rows.clone()];
                for (i, &column) in joint.columns.iter().enumerate() {
                    let own = values.of(i, 0, rows.len()).iter().zip(still);
                    let moving = own.filter(|(_, still)| !**still);
                    square[column] += moving.map(|(x, _)| x * x).sum::<f64>();
                }
            });
        }
    }
    let rows = logs.map(Observations::len).sum();
    hardly_act(&square, rows, library)
}

/// Columns whose squares over so many rows are next to nothing.
pub(crate) fn hardly_act(square: &[f64], rows: usize, library: &Library) -> Vec<usize> {
    let cells = (rows * library.joints()).max(1) as f64;
    let typical = library.typical_sizes();
    let is_zero = |k: &usize| {
        let size = (square[*k] / cells).sqrt();
        size == 0.0 || size <= ZERO * typical[*k]
    };
    (0..square.len()).filter(is_zero).collect()
}

/// Statistics of the fit logs at other cut-offs than the one they were prepared for; what the fit left out stays left out. `None`
/// without rows, and where a log cannot have that cut-off.
///
/// # Errors
/// Of chapters that cannot be read.
pub(in crate::calibrate) fn grams_at(
    twin: &Twin,
    library: &Library,
    pipelines: &[Pipeline],
    logs: &[ReadyLog<'_>],
    data: &Data,
) -> Result<Vec<Option<Gram>>> {
    let reader = Reader {
        robot: &twin.robot,
        library,
        pipeline: &twin.pipeline,
        unknown: data.unknown,
    };
    // Of logs that were summed when they were read, and of those that are gone through now.
    let mut sums = vec![Some(Gram::default()); pipelines.len()];
    let mut now: Vec<_> = pipelines.iter().map(|_| Some(GramSum::default())).collect();
    for (log, own) in logs.iter().zip(&data.fit) {
        match log {
            ReadyLog::Whole(log) => {
                reader.add_at(pipelines, log, (&own.incidents, false), &mut now);
            }
            ReadyLog::Long(_) if own.incidents.is_empty() => {
                for (sum, gram) in sums.iter_mut().zip(&own.elsewhere) {
                    match (sum.as_mut(), gram) {
                        (Some(sum), Some(gram)) => *sum += gram,
                        _ => *sum = None,
                    }
                }
            }
            ReadyLog::Long(long) => {
                long.visit(&twin.pipeline, &mut Vec::new(), |_, chapter, _| {
                    reader.add_at(pipelines, chapter, (&own.incidents, true), &mut now);
                    Ok(())
                })?
            }
        }
    }
    let both = sums.into_iter().zip(now).map(|(sum, now)| {
        let mut sum = sum?;
        sum += &now?.finish();
        sum.joints.iter().any(|j| j.n > 0.0).then_some(sum)
    });
    Ok(both.collect())
}

/// Refuses a question with fewer rows than it needs.
///
/// Columns with a physical prior do not count: what the data do not say about an inertia, the prior does. Nor do those that remember,
/// which change friction that is counted.
pub(in crate::calibrate) fn require_enough(
    (robot, library): (&Robot, &Library),
    logs: &[LogSummary],
    asking: &Columns,
    cutoff: Auto,
) -> Result<()> {
    let names = robot.joint_names();
    let (mut rows, mut columns, mut culprit) = (0, 0, 0);
    for joint in 0..names.len() {
        let kept: u64 = logs.iter().map(|log| log.rows[joint]).sum();
        rows = rows.max(kept as usize);
        let family = |column: usize| asking.families[asking.family_of(column)];
        let asks =
            |column: &&usize| asking.prior_sd[**column].is_none() && !family(**column).remembers();
        let count = library.columns_of_joint(joint).iter().filter(asks).count();
        if count > columns {
            (columns, culprit) = (count, joint);
        }
    }
    let needed = ROWS_PER_COLUMN * columns.max(1);
    if rows < needed {
        let times = (needed as f64 / rows as f64 * 10.0).ceil() / 10.0;
        let longer = match rows {
            0 => "log motion".to_owned(),
            _ => format!("log {times} times as much motion or more"),
        };
        return Err(refuse(
            format!(
                "the logs give {rows} rows, fewer than {ROWS_PER_COLUMN} × the {columns} candidate columns of joint `{}`",
                names[culprit]
            ),
            &match cutoff {
                Auto::Auto => format!("{longer}, or ask for fewer candidates ([library])"),
                Auto::Value(_) => format!(
                    "{longer}, raise signal.cutoff_hz, or ask for fewer candidates ([library])"
                ),
            },
        ));
    }
    Ok(())
}

/// True if some log says that the robot carried something unknown: then the payload component acts in those logs only.
pub(in crate::calibrate) fn carry_something(mut payloads: impl Iterator<Item = Payload>) -> bool {
    payloads.any(|payload| payload == Payload::Unknown)
}

/// True if the payload acts in some of the fit logs and not in others, which tells it from the link that carries it.
pub(in crate::calibrate) fn tell_payload_apart(logs: &[signal::Log<'_>]) -> bool {
    in_some_only(logs.iter().map(|log| log.payload()))
}

fn in_some_only(payloads: impl Iterator<Item = Payload> + Clone) -> bool {
    let unknown = |payload: Payload| payload == Payload::Unknown;
    payloads.clone().any(unknown) && !payloads.clone().all(unknown)
}

/// Raw rows of a log that a standard deviation is measured on, and the times that they cover, s.
pub(in crate::calibrate) fn spread(
    pipeline: &Pipeline,
    trajectory: &Trajectory,
) -> (Vec<Slice>, Vec<[f64; 2]>) {
    let kept = spread_raw(pipeline, trajectory, f64::NEG_INFINITY, 1);
    let rows: usize = kept.iter().map(|slice| slice.rows.len()).sum();
    if rows == count_rows(pipeline, trajectory, RowSignal::Raw) {
        return (kept, vec![[f64::NEG_INFINITY, f64::INFINITY]]);
    }
    let times = kept
        .iter()
        .map(|slice| {
            let segment = &trajectory.segments[slice.segment];
            let time = match &segment.logged {
                Some(logged) => &logged.time,
                None => &segment.time,
            };
            [time[slice.rows.start], time[slice.rows.end - 1]]
        })
        .collect();
    (kept, times)
}

/// Whether a time lies in one of the ranges, which ascend.
pub(in crate::calibrate) fn within(ranges: &[[f64; 2]], time: f64) -> bool {
    let after = ranges.partition_point(|range| range[0] <= time);
    after > 0 && time <= ranges[after - 1][1]
}

/// `(Σ r², rows)` per joint of the raw residual over moving rows of a slice.
fn raw_squares(
    robot: &Robot,
    library: &Library,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
    slice: Slice,
    beta: &[f64],
) -> Result<Vec<(f64, f64)>> {
    let mut sums = vec![(0.0, 0.0); robot.dof()];
    let mut add = |block: &RowBlock<'_>| {
        for (rows, sum) in block.joints.iter().zip(&mut sums) {
            let mut residual: Vec<f64> = (rows.measured.iter().zip(rows.nominal))
                .map(|(measured, nominal)| measured - nominal)
                .collect();
            (residual.iter_mut().zip(rows.products)).for_each(|(r, products)| *r -= products);
            for (i, &column) in rows.columns.iter().enumerate() {
                let x = &rows.x[i * rows.stride..i * rows.stride + block.len];
                for (r, x) in residual.iter_mut().zip(x) {
                    *r -= beta[column] * x;
                }
            }
            add_squares(sum, &residual, rows.standstill);
        }
        Ok(())
    };
    visit_slices(
        robot,
        library,
        pipeline,
        trajectory,
        RowSignal::Raw,
        &[slice],
        &mut add,
    )?;
    Ok(sums)
}

/// Adds the squares of the moving rows to `(sum, count)`.
fn add_squares(sum: &mut (f64, f64), values: &[f64], standstill: &[bool]) {
    for (value, still) in values.iter().zip(standstill) {
        if !still {
            sum.0 += value * value;
            sum.1 += 1.0;
        }
    }
}

/// The data cannot answer: fewer rows than the question needs (exit code 4).
pub(in crate::calibrate) fn refuse(problem: String, remedy: &str) -> Error {
    Error::Refused {
        problem,
        remedy: remedy.into(),
    }
}
