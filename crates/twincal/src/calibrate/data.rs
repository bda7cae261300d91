//! The logs of a calibration as rows, with what was read, dropped and masked.

use super::refuse;
use super::result::LogSummary;
use crate::error::{Finding, Result, Severity};
use crate::gram::Gram;
use crate::incidents::{Evidence, Incident, incident_findings, leave_out, left_out};
use crate::likelihood::Columns;
use crate::observations::{JointObservations, Observations, Part, Room, observe};
use crate::robot::Robot;
use crate::rows::{RowBlock, RowSignal, Slice, count_rows, spread_raw, visit_slices};
use crate::signal::{
    self, LongReady, Payload, Pipeline, PreparedLog, Raw, ReadyLog, Recording, Trajectory,
};
use crate::term::Library;
use crate::twin::Twin;
use rayon::prelude::*;

/// A column whose root mean square is below this share of what it is when the robot moves anyhow is zero on these data:
/// a share of its own size, so that units do not matter (case 89).
const ZERO: f64 = 1e-12;
/// Rows per column of the largest joint below which nothing is fitted (case 7).
const ROWS_PER_COLUMN: usize = 3;

/// Chapters of a long log whose smooth motion is kept, and samples of them together, about: raw scores, the lag and the self-check
/// look at no more.
const MOTION_OF: usize = 16;
const KEPT_OF_LONG: usize = 1 << 16;

/// One log, ready.
pub(super) struct Log {
    /// Contacts and protective stops, which are left out.
    incidents: Vec<Incident>,
    pub(super) observations: Observations,
    pub(super) summary: LogSummary,
    /// First and last stamp, s.
    ends: [f64; 2],
    /// Of a log in chapters, statistics at the cut-offs of the sweep with nothing left out: made while its chapters were there.
    elsewhere: Vec<Option<Gram>>,
}

/// The logs' motion, apart from their rows: it is dropped first.
pub(super) struct Trajectories {
    pub(super) fit: Vec<Trajectory>,
    pub(super) heldout: Vec<Trajectory>,
}

impl Trajectories {
    /// Those of all logs.
    pub(super) fn all(&self) -> impl Iterator<Item = &Trajectory> {
        self.fit.iter().chain(&self.heldout)
    }
}

/// All logs of a calibration.
pub(super) struct Data {
    pub(super) fit: Vec<Log>,
    pub(super) heldout: Vec<Log>,
    pub(super) findings: Vec<Finding>,
    /// See [`carry_something`].
    unknown: bool,
}

impl Data {
    /// Aligns and filters every log; `elsewhere`: the pipelines of the sweep.
    pub(super) fn read(
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
        };
        let trajectories = Trajectories {
            fit: of_fit,
            heldout: of_heldout,
        };
        Ok((data, trajectories))
    }

    /// All rows of the fit logs.
    pub(super) fn training(&self) -> Vec<Part<'_>> {
        let logs = self.fit.iter();
        logs.map(|log| log.observations.whole()).collect()
    }

    /// Drops the columns that are zero on all fit logs, e.g. of joints that never move; returns their indices.
    pub(super) fn drop_zero_columns(&mut self, library: Library) -> (Library, Vec<usize>) {
        let mut square = vec![0.0_f64; library.columns().len()];
        for log in &self.fit {
            let len = log.observations.len();
            for joint in &log.observations.joints {
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
        let lengths = self.fit.iter().map(|log| log.observations.len());
        let cells = (lengths.sum::<usize>() * library.joints()).max(1) as f64;
        let typical = library.typical_sizes();
        let zero: Vec<usize> = (0..square.len())
            .filter(|&k| {
                let size = (square[k] / cells).sqrt();
                size == 0.0 || size <= ZERO * typical[k]
            })
            .collect();
        for &column in &zero {
            let name = &library.terms()[library.columns()[column]].name;
            self.findings.push(Finding::new(
                Severity::Warning,
                "zero_column",
                name.clone(),
                format!("term `{name}` has no torque on any row of these logs and was left out: its joints do not move"),
                0,
            ));
        }
        for log in self.fit.iter_mut().chain(&mut self.heldout) {
            log.observations.drop_columns(&zero);
            for gram in log.elsewhere.iter_mut().flatten() {
                gram.drop_columns(&zero);
            }
        }
        (library.without_columns(&zero), zero)
    }

    /// Refuses a question with fewer rows than it needs.
    ///
    /// Columns with a physical prior do not count: what the data do not say about an inertia, the prior does.
    pub(super) fn require_enough(&self, robot: &Robot, asking: &Columns) -> Result<()> {
        let names = robot.joint_names();
        let (mut rows, mut columns, mut culprit) = (0, 0, 0);
        for joint in 0..names.len() {
            let kept: u64 = self.fit.iter().map(|log| log.summary.rows[joint]).sum();
            rows = rows.max(kept as usize);
            let asks = |column: &&usize| asking.prior_sd[**column].is_none();
            let count = self.fit.first().map_or(0, |log| {
                let columns = &log.observations.joints[joint].columns;
                columns.iter().filter(asks).count()
            });
            if count > columns {
                (columns, culprit) = (count, joint);
            }
        }
        if rows < ROWS_PER_COLUMN * columns.max(1) {
            return Err(refuse(
                format!(
                    "the logs give {rows} rows, fewer than {ROWS_PER_COLUMN} × the {columns} candidate columns of joint `{}`",
                    names[culprit]
                ),
                "log longer, raise signal.cutoff_hz, or ask for fewer candidates ([library])",
            ));
        }
        Ok(())
    }

    /// sd per joint of the torque outside the filter's band, from the raw residual of the fit logs; 0 with the filter off.
    pub(super) fn out_of_band(
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
        for (log, trajectory) in self.fit.iter().zip(&trajectories.fit) {
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

    /// Range of the training motion per joint: `[q_min, q_max, qd_min, qd_max, qdd_min, qdd_max]`.
    pub(super) fn hull(&self, robot: &Robot) -> Vec<[f64; 6]> {
        (0..robot.dof())
            .map(|joint| {
                let mut hull = [f64::INFINITY, f64::NEG_INFINITY].repeat(3);
                for log in &self.fit {
                    let motion = [
                        &log.observations.q[joint],
                        &log.observations.qd[joint],
                        &log.observations.qdd[joint],
                    ];
                    for (i, values) in motion.into_iter().enumerate() {
                        for &value in &*values.get() {
                            hull[2 * i] = hull[2 * i].min(value);
                            hull[2 * i + 1] = hull[2 * i + 1].max(value);
                        }
                    }
                }
                [hull[0], hull[1], hull[2], hull[3], hull[4], hull[5]]
            })
            .collect()
    }
}

/// What a log is for; logs that are fitted are swept, with these pipelines.
#[derive(Clone, Copy)]
enum Role<'a> {
    Fit(&'a [Pipeline]),
    HeldOut,
}

impl<'a> Role<'a> {
    fn word(self) -> &'static str {
        match self {
            Self::Fit(_) => "fit",
            Self::HeldOut => "heldout",
        }
    }

    fn elsewhere(self) -> &'a [Pipeline] {
        match self {
            Self::Fit(elsewhere) => elsewhere,
            Self::HeldOut => &[],
        }
    }
}

/// What rows are made with.
#[derive(Clone, Copy)]
struct Reader<'a> {
    robot: &'a Robot,
    library: &'a Library,
    pipeline: &'a Pipeline,
    /// See [`carry_something`].
    unknown: bool,
}

impl Reader<'_> {
    fn log(
        &self,
        log: &ReadyLog<'_>,
        role: Role<'_>,
        findings: &mut Vec<Finding>,
    ) -> Result<(Log, Trajectory)> {
        let (robot, pipeline) = (self.robot, self.pipeline);
        let mut evidence = Evidence::default();
        let (mut log, mut trajectory) = match log {
            ReadyLog::Whole(log) => self.recording(log, role, &mut evidence, findings)?,
            ReadyLog::Long(long) => self.chapters(long, role, &mut evidence, findings)?,
        };
        log.incidents = evidence.incidents(robot, pipeline);
        leave_out(pipeline, &mut trajectory, &log.incidents);
        log.observations
            .leave_out(&left_out(pipeline, &log.incidents));
        log.summary.count_rows(&log.observations);
        findings.extend(incident_findings(&log.summary.name, &log.incidents));
        Ok((log, trajectory))
    }

    fn chapters(
        &self,
        long: &LongReady,
        role: Role<'_>,
        evidence: &mut Evidence,
        findings: &mut Vec<Finding>,
    ) -> Result<(Log, Trajectory)> {
        findings.push(long.log.say());
        // Motion of a few chapters, evenly spread.
        let chapters = long.log.chapters();
        let slots = chapters.min(MOTION_OF);
        let mut taken = vec![false; slots];
        let mut warm = vec![false; self.robot.dof()];
        let mut room = Room::new(long.rows_at_most(self.pipeline), long.log.shelf.clone());
        let (mut summaries, mut kept): (_, Option<Trajectory>) = (Vec::new(), None);
        let mut ends: Option<[f64; 2]> = None;
        let mut elsewhere = vec![Some(Gram::default()); role.elsewhere().len()];
        long.visit(self.pipeline, findings, |number, chapter, said| {
            let (log, trajectory) = self.recording(chapter, role, evidence, said)?;
            if let Some(shelf) = &long.log.shelf {
                evidence.put_away(shelf)?;
            }
            if !std::mem::replace(&mut taken[number * slots / chapters], true) {
                let mut trajectory = trajectory.thinned_out(KEPT_OF_LONG / slots);
                match &mut kept {
                    Some(kept) => kept.segments.append(&mut trajectory.segments),
                    None => kept = Some(trajectory),
                }
            }
            for (warm, rows) in warm.iter_mut().zip(&log.observations.joints) {
                *warm |= !rows.temperature.is_empty();
            }
            room.append(log.observations)?;
            self.add_at(role.elsewhere(), chapter, (&[], true), &mut elsewhere);
            summaries.push(log.summary);
            let [first, last] = log.ends;
            ends = Some([ends.map_or(first, |ends| ends[0]), last]);
            Ok(())
        })?;
        let observations = room.into_rows();
        let cold = |(warm, rows): (&bool, &JointObservations)| *warm && rows.temperature.is_empty();
        if warm.iter().zip(&observations.joints).any(cold) {
            findings.push(Finding::new(
                Severity::Warning,
                "temperature_left_out",
                &long.log.name,
                "a temperature is missing in some chapters and was left out of all: drift is not compared with it",
                0,
            ));
        }
        let ends = ends.unwrap_or_default();
        let summary = LogSummary::joined(summaries, ends[1] - ends[0]);
        let (summary, trajectory) = summary.zip(kept).ok_or_else(|| {
            let problem = format!("log `{}` has no chapters", long.log.name);
            refuse(problem, "give a log with samples")
        })?;
        let log = Log {
            incidents: Vec::new(),
            observations,
            summary,
            ends,
            elsewhere,
        };
        Ok((log, trajectory))
    }

    /// A recording as rows and as motion, with nothing left out yet.
    fn recording(
        &self,
        log: &PreparedLog<'_>,
        role: Role<'_>,
        evidence: &mut Evidence,
        findings: &mut Vec<Finding>,
    ) -> Result<(Log, Trajectory)> {
        let (robot, library, pipeline) = (self.robot, self.library, self.pipeline);
        let recording = log.recording();
        let (trajectory, mut more) = self.trajectory(log, Raw::Spread)?;
        findings.append(&mut more);
        let mut observations = observe(robot, library, pipeline, &trajectory)?;
        evidence.take(robot, pipeline, &trajectory);
        observations.set_temperatures(recording);
        let time = &recording.time;
        let ends = time.first().zip(time.last()).map(|(a, b)| [*a, *b]);
        let log = Log {
            incidents: Vec::new(),
            summary: summary(recording, role.word(), pipeline, &trajectory),
            observations,
            ends: ends.unwrap_or_default(),
            elsewhere: Vec::new(),
        };
        Ok((log, trajectory))
    }

    fn trajectory(&self, log: &PreparedLog<'_>, raw: Raw) -> Result<(Trajectory, Vec<Finding>)> {
        let (mut trajectory, findings) = log.align(self.pipeline, raw)?;
        trajectory.payload_acts = !self.unknown || trajectory.payload == Payload::Unknown;
        Ok((trajectory, findings))
    }

    /// Adds a recording's statistics with other pipelines, one after the other: of a long log one more trajectory fits in memory, two do
    /// not; each uses all cores. A pipeline that it cannot have gets `None`, or of a chapter (`part`) no more.
    fn add_at(
        &self,
        pipelines: &[Pipeline],
        log: &PreparedLog<'_>,
        (incidents, part): (&[Incident], bool),
        sums: &mut [Option<Gram>],
    ) {
        for (pipeline, kept) in pipelines.iter().zip(sums) {
            let gram = Reader { pipeline, ..*self }.gram(log, incidents);
            match (kept.as_mut(), gram) {
                (Some(sum), Ok(gram)) => *sum += &gram,
                (_, Err(_)) if part => {}
                _ => *kept = None,
            }
        }
    }

    /// Statistics of a recording's rows; the incidents stay left out.
    fn gram(&self, log: &PreparedLog<'_>, incidents: &[Incident]) -> Result<Gram> {
        let (mut trajectory, _) = self.trajectory(log, Raw::None)?;
        leave_out(self.pipeline, &mut trajectory, incidents);
        let rows = observe(self.robot, self.library, self.pipeline, &trajectory)?;
        Ok(rows.whole().gram())
    }
}

impl LogSummary {
    /// Of chapters, which last `duration` s together.
    fn joined(chapters: Vec<Self>, duration: f64) -> Option<Self> {
        let mut rates: Vec<f64> = chapters.iter().map(|chapter| chapter.rate_hz).collect();
        rates.sort_by(f64::total_cmp);
        let longest = chapters.iter().max_by_key(|chapter| chapter.samples)?;
        let kept_rate_hz = longest.kept_rate_hz;
        let mut chapters = chapters.into_iter();
        let mut all = chapters.next()?;
        for chapter in chapters {
            all.samples += chapter.samples;
            all.segments += chapter.segments;
        }
        Some(Self {
            duration,
            rate_hz: rates[rates.len() / 2],
            kept_rate_hz,
            ..all
        })
    }

    /// Counts the rows of each joint, moving and not.
    fn count_rows(&mut self, observations: &Observations) {
        let still = |joint: &JointObservations| {
            let still = joint.standstill.iter().filter(|still| **still);
            still.count() as u64
        };
        self.standstill = observations.joints.iter().map(still).collect();
        let moving = |still: &u64| observations.len() as u64 - still;
        self.rows = self.standstill.iter().map(moving).collect();
    }
}

/// Statistics of the fit logs at other cut-offs than the one they were prepared for; what the fit left out stays left out. `None`
/// without rows, and where a log cannot have that cut-off.
///
/// # Errors
/// Of chapters that cannot be read.
pub(super) fn grams_at(
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
    let mut sums = vec![Some(Gram::default()); pipelines.len()];
    for (log, own) in logs.iter().zip(&data.fit) {
        match log {
            ReadyLog::Whole(log) => {
                reader.add_at(pipelines, log, (&own.incidents, false), &mut sums);
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
                    reader.add_at(pipelines, chapter, (&own.incidents, true), &mut sums);
                    Ok(())
                })?
            }
        }
    }
    let with_rows = |sum: Option<Gram>| sum.filter(|sum| sum.joints.iter().any(|j| j.n > 0.0));
    Ok(sums.into_iter().map(with_rows).collect())
}

/// True if some log says that the robot carried something unknown: then the payload component acts in those logs only.
pub(super) fn carry_something(mut payloads: impl Iterator<Item = Payload>) -> bool {
    payloads.any(|payload| payload == Payload::Unknown)
}

/// True if the payload acts in some of the fit logs and not in others, which tells it from the link that carries it.
pub(super) fn tell_payload_apart(logs: &[signal::Log<'_>]) -> bool {
    let unknown = |log: &signal::Log<'_>| log.payload() == Payload::Unknown;
    logs.iter().any(unknown) && !logs.iter().all(unknown)
}

/// Raw rows of a log that a standard deviation is measured on, and the times that they cover, s.
fn spread(pipeline: &Pipeline, trajectory: &Trajectory) -> (Vec<Slice>, Vec<[f64; 2]>) {
    let kept = spread_raw(pipeline, trajectory, f64::NEG_INFINITY);
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
fn within(ranges: &[[f64; 2]], time: f64) -> bool {
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

fn summary(
    recording: &Recording,
    role: &str,
    pipeline: &Pipeline,
    trajectory: &Trajectory,
) -> LogSummary {
    let mut intervals: Vec<f64> = recording
        .time
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|d| *d > 0.0)
        .collect();
    let median = match intervals.len() {
        0 => f64::INFINITY,
        count => {
            *intervals
                .select_nth_unstable_by(count / 2, f64::total_cmp)
                .1
        }
    };
    let ends = (
        recording.time.first().copied().unwrap_or(0.0),
        recording.time.last().copied().unwrap_or(0.0),
    );
    let longest = trajectory.segments.iter().max_by_key(|s| s.time.len());
    LogSummary {
        name: recording.name.clone(),
        role: role.into(),
        samples: recording.time.len() as u64,
        duration: ends.1 - ends.0,
        rate_hz: 1.0 / median,
        kept_rate_hz: longest.map_or(0.0, |segment| pipeline.kept_rate(segment.interval)),
        segments: trajectory.segments.len() as u64,
        rows: Vec::new(),
        standstill: Vec::new(),
    }
}
