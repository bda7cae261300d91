//! The whole road, from a robot and its logs to a calibrated twin, in one function, `road`, that reads like the paper.

mod attempts;
mod checks;
mod data;
mod distinct;
mod exit;
mod fit;
mod from_statistics;
mod like;
mod log_statistics;
mod outlook;
mod plan;
mod pooled;
mod progress;
mod quantity;
mod records;
mod request;
mod result;
mod settings;
mod stages;
mod stopped;
#[cfg(test)]
mod testing;

pub use checks::left_out::{LeftOutData, LeftOutError};
pub use checks::sweep::SweepPoint;
pub(crate) use data::all_logs::hardly_act;
pub use data::log_summary::LogSummary;
pub use distinct::{Clash, Identity, clash};
pub(crate) use fit::columns::columns_of;
pub use fit::compact::{Compact, CompactTerm};
pub(crate) use from_statistics::calibrate_pooled;
pub use from_statistics::calibrate_statistics;
pub(crate) use log_statistics::LogStatistics;
pub use log_statistics::Statistics;
pub use outlook::{LookedAt, Outlook, outlook};
pub use plan::{About, Plan, VERSION as PLAN_VERSION};
pub(crate) use pooled::Pooled;
pub use progress::Stage;
pub use quantity::Quantity;
pub use records::{FromTables, Header, LogHeader, LogTable, Record};
pub use result::calibration::{
    Along, Calibration, ComponentSummary, Curve, Draws, Group, LikelihoodUsed, ParameterSummary,
    PriorUsed, TermSummary,
};
pub use result::effects::Effect;
pub use result::status::{Alike, Status, StatusReason};
pub use settings::{CalibrationSettings, UnaskedRipple};
pub use stopped::Stopped;

use crate::error::{Error, Finding, Result};
use crate::robot::Robot;
use crate::signal::{Log, Logs, Shelf};
use attempts::{Attempts, Ended};
use data::cross_checked;
use exit::{Exit, Pass};
use fit::lower_band::Band;
use progress::Watch;
use request::{Goal, Recorded, Request};
use result::ended::ended;
use std::sync::Arc;

/// Finds what the nominal robot misses in `logs` and says how well the calibrated twin predicts.
///
/// With `heldout` recordings these are predicted; without, three or more logs are left out one by one (many in five groups), and
/// otherwise the last 30 % of each log. The coefficients always come from all of `logs`. Recordings that are given away (as `Vec`) are
/// dropped as soon as nobody needs them, which is what the largest of them cost in memory at the end.
///
/// # Errors
/// [`Error::Log`] and [`Error::Setting`] for unusable input, [`Error::Refused`] where the data cannot answer; each with
/// what was found before.
/// # Source
/// paper eq. (1)–(5); method sections 1–8.
///
/// # Example
/// Logs may be lent or given away; [`Calibrate`](crate::builder::Calibrate) is the same step by step.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::calibrate::{CalibrationSettings, calibrate};
/// use twincal::term::Family;
///
/// # let (robot, real, mut noise) = (two_link::arm(2.0)?, two_link::arm(2.6)?, twincal::random::Random::new(1, 0));
/// # let mut log = |name: &str, phase: f64| two_link::log(name, phase, &real, &mut noise);
/// # let (training, heldout) = (log("training", 0.3), log("held-out", 1.9));
/// let mut settings = CalibrationSettings::default();
/// settings.library.families = vec![Family::Payload, Family::Viscous];
/// settings.library.terms = vec!["sin(q1 - q2)".into()];
/// let fit = calibrate(&robot, &[training], &[heldout], &settings, &|stage| println!("{stage:?}"))?;
/// let payload = fit.effects().find(|effect| effect.name() == "payload").ok_or("none")?;
/// assert!((payload.parameters()[0].mean - 0.6).abs() < 0.05); // kg more than in the model file
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn calibrate<'a>(
    robot: &Robot,
    logs: impl Into<Logs<'a>>,
    heldout: impl Into<Logs<'a>>,
    settings: &CalibrationSettings,
    progress: &dyn Fn(Stage),
) -> std::result::Result<Calibration, Stopped> {
    let watch = |stage: Stage| {
        progress(stage);
        Ok(())
    };
    calibrate_watched(robot, (logs.into(), heldout.into()), settings, &watch)
}

/// How these logs, and others of the same robot, become statistics; with what was found on the way.
///
/// The plan is that of a fit: filters, the band that the noise allows, candidates, gear ripple that the residual shows, the effects that
/// columns are worked out about.
///
/// # Errors
/// Those of [`calibrate`].
///
/// # Example
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::calibrate::plan;
/// use twincal::prelude::*;
///
/// # let (robot, mut noise) = (two_link::arm(2.0)?, twincal::random::Random::new(1, 0));
/// # let logs = [two_link::log("run1", 0.3, &two_link::arm(2.6)?, &mut noise)];
/// let mut settings = Settings::default();
/// settings.library.families = vec![Family::Payload, Family::Viscous];
/// settings.signal.cutoff_hz = Auto::Value(5.0);
/// let (plan, _) = plan(&robot, &logs, &settings, &|_| {})?;
/// assert_eq!(plan.pipeline.cutoff_hz, 5.0);
/// assert!(plan.require_for(&robot).is_ok());
/// # let another_robot = two_link::arm(2.6)?;
/// assert!(plan.require_for(&another_robot).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn plan<'a>(
    robot: &Robot,
    logs: impl Into<Logs<'a>>,
    settings: &CalibrationSettings,
    progress: &dyn Fn(Stage),
) -> std::result::Result<(Plan, Vec<Finding>), Stopped> {
    plan_about(About::Model, robot, logs, settings, progress)
}

/// [`plan`] with columns about the model file or about what the fit finds.
///
/// # Errors
/// Those of [`calibrate`].
pub fn plan_about<'a>(
    about: About,
    robot: &Robot,
    logs: impl Into<Logs<'a>>,
    settings: &CalibrationSettings,
    progress: &dyn Fn(Stage),
) -> std::result::Result<(Plan, Vec<Finding>), Stopped> {
    let watch = |stage: Stage| {
        progress(stage);
        Ok(())
    };
    let mut findings = Vec::new();
    let recordings: (Logs<'a>, Logs<'a>) = (logs.into(), Logs(Vec::new()));
    let shelves: Vec<_> = recordings.0.0.iter().filter_map(Log::shelf).collect();
    let mut way = |request: Request<'_>,
                   recordings: &mut Option<(Logs<'_>, Logs<'_>)>,
                   findings: &mut Vec<Finding>| {
        watch(Stage::Rows)?;
        plan::road(about, request, recordings, findings)
    };
    let plan = attempt(
        robot,
        recordings,
        settings,
        (&watch, &mut way),
        &mut findings,
    );
    match read_back(plan, &shelves) {
        Ok(plan) => Ok((plan, findings)),
        Err(error) => Err(Stopped { error, findings }),
    }
}

/// [`calibrate`] under eyes that may end it with an error; `recordings` are those to fit and those held out.
///
/// # Errors
/// Those of [`calibrate`], and that of `progress`.
pub fn calibrate_watched(
    robot: &Robot,
    recordings: (Logs<'_>, Logs<'_>),
    settings: &CalibrationSettings,
    progress: &dyn Fn(Stage) -> Result<()>,
) -> std::result::Result<Calibration, Stopped> {
    let mut findings = Vec::new();
    let every_log = recordings.0.0.iter().chain(&recordings.1.0);
    let shelves: Vec<_> = every_log.filter_map(Log::shelf).collect();
    let as_recorded = cross_checked::as_recorded(robot, &recordings)?;
    let mut way =
        |request: Request<'_>,
         recordings: &mut Option<(Logs<'_>, Logs<'_>)>,
         findings: &mut Vec<Finding>| { road(request, recordings, progress, findings) };
    let calibration = attempt(
        robot,
        recordings,
        settings,
        (progress, &mut way),
        &mut findings,
    );
    let calibration = read_back(calibration, &shelves);
    ended(calibration, as_recorded, findings)
}

/// A result, unless numbers that could not be read back are behind it.
fn read_back<T>(result: Result<T>, shelves: &[Arc<dyn Shelf>]) -> Result<T> {
    match shelves.iter().find_map(|shelf| shelf.failure()) {
        Some(failure) => Err(failure),
        None => result,
    }
}

/// One pass over the logs, to a result.
type Way<'w, T> =
    dyn FnMut(Request<'_>, &mut Option<(Logs<'_>, Logs<'_>)>, &mut Vec<Finding>) -> Pass<T> + 'w;

/// Passes over the logs, with the settings that the end of one asks for in the next, until one has a result; `findings` are those of
/// the last one.
fn attempt<T>(
    robot: &Robot,
    recordings: (Logs<'_>, Logs<'_>),
    settings: &CalibrationSettings,
    (progress, road): (&Watch<'_>, &mut Way<'_, T>),
    findings: &mut Vec<Finding>,
) -> Result<T> {
    let mut recordings = Some(recordings);
    let mut attempts = Attempts::new(settings);
    loop {
        findings.clone_from(&attempts.findings);
        let request = Request {
            robot,
            settings: &attempts.settings,
            goal: attempts.goal,
        };
        let exit = match road(request, &mut recordings, findings) {
            Ok(result) => return Ok(result),
            Err(Exit::Failed(Error::Cancelled)) => return Err(Error::Cancelled),
            Err(exit) => exit,
        };
        let mut count = |settings: &CalibrationSettings| {
            progress(Stage::Rows).ok()?;
            let request = Request {
                robot,
                settings,
                goal: Goal::Count,
            };
            count(request, recordings.as_ref()).ok()
        };
        let ended = Ended {
            exit: &exit,
            findings,
            recordings_kept: recordings.is_some(),
            count: &mut count,
        };
        if !attempts.next(ended) {
            return Err(attempts.failure(exit, findings));
        }
    }
}

/// From logs to a calibration; `recordings` are gone as soon as nobody needs them.
fn road(
    request: Request<'_>,
    recordings: &mut Option<(Logs<'_>, Logs<'_>)>,
    progress: &Watch<'_>,
    findings: &mut Vec<Finding>,
) -> Pass<Calibration> {
    let recorded = Recorded::of(recordings.as_ref());
    // the same filters for every log, and candidates for this robot
    progress(Stage::Rows)?;
    let prepared = stages::prepare(request, recorded, findings)?;
    // eq. (1)–(4): residual torque and Euler–Lagrange columns, filtered alike
    let mut rows = stages::read(prepared, findings)?;
    // eq. (5): sparse regression with everything that is plugged in at its fixed point
    progress(Stage::Inference)?;
    rows.weigh(findings)?;
    let estimated = stages::estimate(&rows, findings)?;
    // τ_calib = τ_nom + Φβ̂ with intervals, and held-out truth
    let validated = stages::validate(&rows, estimated, progress, findings)?;
    let mut rows = rows.without_recordings();
    *recordings = None;
    // other cut-offs, another likelihood, and what the logs can show
    progress(Stage::Sensitivity)?;
    let checked = stages::check(&mut rows, &validated, findings)?;
    Ok(stages::conclude(rows, validated, checked, findings)?)
}

/// The beginning of the same road, as far as independent rows can be counted.
fn count(request: Request<'_>, recordings: Option<&(Logs<'_>, Logs<'_>)>) -> Pass<Band> {
    let findings = &mut Vec::new();
    let prepared = stages::prepare(request, Recorded::of(recordings), findings)?;
    let mut rows = stages::read(prepared, findings)?;
    rows.weigh(findings)?;
    stages::count(&rows)
}
