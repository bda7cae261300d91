//! One log to rows, whole or chapter by chapter.

use super::log::Log;
use super::log_summary::LogSummary;
use crate::error::{Code, Finding, Result, Severity};
use crate::incidents::{Evidence, Incident, incident_findings, leave_out, left_out};
use crate::observations::{GramSum, JointObservations, Observations, Room, observe};
use crate::robot::Robot;
use crate::signal::{
    FewChapters, LongReady, Payload, Pipeline, PreparedLog, Raw, ReadyLog, Trajectory,
};
use crate::term::Library;

/// What a log is for; logs that are fitted are swept, with these pipelines.
#[derive(Clone, Copy)]
pub(in crate::calibrate) enum Role<'a> {
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
pub(in crate::calibrate) struct Reader<'a> {
    pub(in crate::calibrate) robot: &'a Robot,
    pub(in crate::calibrate) library: &'a Library,
    pub(in crate::calibrate) pipeline: &'a Pipeline,
    /// See [`super::all_logs::carry_something`].
    pub(in crate::calibrate) unknown: bool,
}

impl Reader<'_> {
    /// Rows and motion of a log, with its incidents left out.
    pub(in crate::calibrate) fn log(
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
        log.incidents = evidence.incidents(robot);
        leave_out(pipeline, &mut trajectory, &log.incidents);
        log.observations
            .leave_out(&left_out(pipeline, &log.incidents));
        log.summary.incidents.clone_from(&log.incidents);
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
        findings.push(long.log.say(true));
        let mut motion = FewChapters::new(long.log.chapters());
        let mut warm = vec![false; self.robot.dof()];
        let mut room = Room::new(long.rows_at_most(self.pipeline), long.log.shelf().cloned());
        let mut summaries = Vec::new();
        let (mut ends, mut origin): (Option<[f64; 2]>, f64) = (None, 0.0);
        let mut elsewhere: Vec<_> = (role.elsewhere().iter())
            .map(|_| Some(GramSum::default()))
            .collect();
        long.visit(self.pipeline, findings, |number, chapter, said| {
            let (log, trajectory) = self.recording(chapter, role, evidence, said)?;
            if let Some(shelf) = long.log.shelf() {
                evidence.put_away(shelf)?;
            }
            motion.take(number, trajectory);
            for (warm, rows) in warm.iter_mut().zip(&log.observations.joints) {
                *warm |= !rows.temperature.is_empty();
            }
            room.append(log.observations)?;
            self.add_at(role.elsewhere(), chapter, (&[], true), &mut elsewhere);
            summaries.push(log.summary);
            let [first, last] = log.ends;
            origin = log.origin;
            ends = Some([ends.map_or(first, |ends| ends[0]), last]);
            Ok(())
        })?;
        let observations = room.into_rows();
        let cold = |(warm, rows): (&bool, &JointObservations)| *warm && rows.temperature.is_empty();
        if warm.iter().zip(&observations.joints).any(cold) {
            findings.push(temperature_left_out(&long.log.name));
        }
        let ends = ends.unwrap_or_default();
        let summary = LogSummary::joined(summaries, ends[1] - ends[0]);
        let (mut summary, trajectory) =
            (summary.zip(motion.into_trajectory())).ok_or_else(|| long.log.without_chapters())?;
        // Chapters that cannot be used were logged all the same.
        summary.samples = long.log.samples().iter().map(|n| *n as u64).sum();
        let log = Log {
            incidents: Vec::new(),
            observations,
            summary,
            ends,
            origin,
            elsewhere: (elsewhere.into_iter())
                .map(|sum| sum.map(GramSum::finish))
                .collect(),
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
            summary: LogSummary::of(recording, role.word(), pipeline, &trajectory),
            observations,
            ends: ends.unwrap_or_default(),
            origin: recording.start_ns as f64 * 1e-9,
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
    pub(in crate::calibrate) fn add_at(
        &self,
        pipelines: &[Pipeline],
        log: &PreparedLog<'_>,
        (incidents, part): (&[Incident], bool),
        sums: &mut [Option<GramSum>],
    ) {
        for (pipeline, kept) in pipelines.iter().zip(sums) {
            let rows = Reader { pipeline, ..*self }.rows(log, incidents);
            match (kept.as_mut(), rows) {
                (Some(sum), Ok(rows)) => sum.add(&rows.whole()),
                (_, Err(_)) if part => {}
                _ => *kept = None,
            }
        }
    }

    /// Rows of a recording; the incidents stay left out.
    fn rows(&self, log: &PreparedLog<'_>, incidents: &[Incident]) -> Result<Observations> {
        let (mut trajectory, _) = self.trajectory(log, Raw::None)?;
        leave_out(self.pipeline, &mut trajectory, incidents);
        observe(self.robot, self.library, self.pipeline, &trajectory)
    }
}

/// That some chapters of a log lack a temperature which others have.
fn temperature_left_out(log: &str) -> Finding {
    Finding::new(
        Severity::Warning,
        Code::TemperatureLeftOut,
        log,
        "a temperature is missing in some chapters and was left out of all: drift is not compared with it",
        0,
    )
}
