//! Stage 1: logs on one clock behind the same filters, and the candidates for this robot.

use crate::calibrate::data::aligned;
use crate::calibrate::data::all_logs;
use crate::calibrate::data::history;
use crate::calibrate::fit::smaller_library;
use crate::calibrate::fit::turning;
use crate::calibrate::request::{Recorded, Request};
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Finding, Result};
use crate::lag::Lags;
use crate::signal::{Log, Pipeline, ReadyLog, choose_and_prepare, constant_torque, hardly_driven};
use crate::term::{Library, LibrarySettings};

/// Logs that are ready for rows, with the candidates.
pub(in crate::calibrate) struct Prepared<'a, 'r> {
    pub(in crate::calibrate) request: Request<'r>,
    pub(in crate::calibrate) recorded: Recorded<'a>,
    /// Logs to fit.
    pub(in crate::calibrate) ready: Vec<ReadyLog<'a>>,
    pub(in crate::calibrate) pipeline: Pipeline,
    /// What was found while it was chosen.
    pub(in crate::calibrate) of_pipeline: Vec<Finding>,
    /// See [`crate::signal::Chosen::wider_hz`].
    pub(in crate::calibrate) wider_hz: Option<f64>,
    pub(in crate::calibrate) lags: Option<Lags>,
    /// Those of the request, without the families that these logs say nothing of.
    pub(in crate::calibrate) settings: CalibrationSettings,
    /// The same of the library, with the reversal velocity of these logs.
    pub(in crate::calibrate) library_settings: LibrarySettings,
    /// Every candidate.
    pub(in crate::calibrate) library: Library,
    /// Whether nobody chose the families.
    pub(in crate::calibrate) usual: bool,
    /// See [`all_logs::carry_something`].
    pub(in crate::calibrate) unknown: bool,
}

/// Chooses filters, moves late torque back, and proposes the candidates.
///
/// # Errors
/// Of logs that cannot be used, and of candidates that cannot be built.
pub(in crate::calibrate) fn prepare<'a, 'r>(
    request: Request<'r>,
    recorded: Recorded<'a>,
    findings: &mut Vec<Finding>,
) -> Result<Prepared<'a, 'r>> {
    let Request {
        robot, settings, ..
    } = request;
    for log in recorded.all() {
        let names = robot.joint_names();
        log.any_recording(|recording| recording.require_torque(&names))?;
    }
    let chosen = choose_and_prepare(robot, recorded.fit, &settings.signal)?;
    let (mut pipeline, mut ready) = (chosen.pipeline, chosen.logs);
    let mut of_pipeline = chosen.findings;
    findings.extend(of_pipeline.iter().cloned());
    let every_log: Vec<Log<'_>> = recorded.all().map(Log::lent).collect();
    findings.extend(constant_torque(robot, every_log.clone())?);
    findings.extend(hardly_driven(robot, every_log)?);
    let lags = aligned::align(robot, recorded.fit, &mut pipeline, &mut ready, findings)?;
    let logs = (recorded.fit, &ready[..]);
    let known = findings.len();
    let followed = history::follow(robot, logs, &pipeline, settings, findings)?;
    of_pipeline.extend(findings.iter().skip(known).cloned());
    pipeline.history = followed.history;
    let library_settings = LibrarySettings {
        coulomb_velocity: pipeline.coulomb_velocity,
        ..followed.settings.library.clone()
    };
    let (library, more) = Library::propose(robot, &library_settings)?;
    findings.extend(more);
    let mut prepared = Prepared {
        request,
        recorded,
        ready,
        pipeline,
        of_pipeline,
        wider_hz: chosen.wider_hz,
        lags,
        usual: smaller_library::is_usual(&settings.library.families),
        settings: followed.settings,
        library_settings,
        library,
        unknown: all_logs::carry_something(recorded.all().map(Log::payload)),
    };
    prepared.choose_reversal_velocity(findings)?;
    Ok(prepared)
}

impl<'r> Prepared<'_, 'r> {
    /// Another velocity at which friction reverses, if the logs clearly ask for it.
    fn choose_reversal_velocity(&mut self, findings: &mut Vec<Finding>) -> Result<()> {
        let (robot, logs) = (self.request.robot, self.recorded.fit);
        let looked_at = (logs, &self.ready[..], self.unknown);
        let (library, pipeline) = (&self.library, &self.pipeline);
        let turned = turning::turn(robot, library, looked_at, pipeline, &self.settings)?;
        if let Some(turned) = turned {
            turned.prepare_again(robot, logs, &self.pipeline, &mut self.ready)?;
            self.library_settings.coulomb_velocity = turned.pipeline.coulomb_velocity;
            (self.pipeline, self.library) = (turned.pipeline, turned.library);
            self.of_pipeline.push(turned.finding.clone());
            findings.push(turned.finding);
        }
        Ok(())
    }

    /// The same with nothing of the recordings.
    pub(in crate::calibrate) fn without_recordings(self) -> Prepared<'static, 'r> {
        let ready = self.ready.into_iter().map(ReadyLog::detached);
        Prepared {
            request: self.request,
            recorded: Recorded::NONE,
            ready: ready.collect(),
            pipeline: self.pipeline,
            of_pipeline: self.of_pipeline,
            wider_hz: self.wider_hz,
            lags: self.lags,
            settings: self.settings,
            library_settings: self.library_settings,
            library: self.library,
            usual: self.usual,
            unknown: self.unknown,
        }
    }
}
