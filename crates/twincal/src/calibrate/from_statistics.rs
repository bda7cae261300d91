//! The road from statistics to a calibrated twin: no rows but those of held-out logs.

use super::checks::held_out;
use super::checks::independent_rows;
use super::checks::misfit;
use super::checks::sandwich;
use super::checks::unsettled;
use super::checks::worse;
use super::data::all_logs::{self, Data};
use super::data::facts::{Facts, LogFacts};
use super::data::reader::Reader;
use super::distinct::{Identity, require_apart};
use super::fit::columns::columns_of;
use super::fit::compact;
use super::fit::dissipative;
use super::fit::fitted::{self, Fitted};
use super::fit::noise_of::noise_of;
use super::like::require_like;
use super::log_statistics::{LogStatistics, Statistics, require_read_back};
use super::plan::require_even_rows;
use super::pooled::Pooled;
use super::progress::{Stage, Watch};
use super::result::calibration::Calibration;
use super::result::summary::{Pieces, SecondOpinion};
use super::result::unseen;
use super::settings::CalibrationSettings;
use super::stages;
use super::stopped::Stopped;
use crate::cross_check::{Compared, Sketch, odd_torque, sketched_copies};
use crate::error::{Finding, Result};
use crate::gram::Gram;
use crate::infer::infer_near;
use crate::likelihood::{Columns, Spread};
use crate::plug_in::Fit;
use crate::posterior::Posterior;
use crate::robot::Robot;
use crate::self_check::self_check;
use crate::signal::{Log, Logs, ReadyLog, less_driven, ready, torque_rms};
use crate::statistics::{Purpose, Sums, residual_form};
use crate::term::Library;
use crate::twin::Twin;
use std::borrow::Cow;

/// [`calibrate`](super::calibrate) from the statistics of the logs: the same numbers wherever no row is asked for.
///
/// Without `heldout` recordings nothing is predicted, and [`Validation::split`](crate::validate::Validation) says so. What only rows say
/// is not looked for: drift, heavy tails, noise that varies, other cut-offs.
///
/// # Errors
/// [`Error::Statistics`](crate::Error::Statistics) without logs, with a plan of another version and for torque of several units;
/// [`Error::Setting`](crate::Error::Setting) for noise that weighs rows, and those of a
/// calibration; each with what was found before.
pub fn calibrate_statistics<'a>(
    statistics: &Statistics,
    heldout: impl Into<Logs<'a>>,
    settings: &CalibrationSettings,
    progress: &dyn Fn(Stage),
) -> std::result::Result<Calibration, Stopped> {
    let watch = |stage: Stage| {
        progress(stage);
        Ok(())
    };
    let (heldout, mut findings) = (heldout.into(), Vec::new());
    let job = (statistics, None);
    let fit = road(job, &heldout, settings, &watch, &mut findings);
    let read_back = heldout.0.iter().try_for_each(require_read_back);
    (read_back.and(fit)).map_err(|error| Stopped { error, findings })
}

/// A calibration with the posterior of a fleet: noise and range of motion are those of the robot's own statistics.
///
/// # Errors
/// Those of [`calibrate_statistics`].
pub(crate) fn calibrate_pooled(
    statistics: &Statistics,
    pooled: &Pooled,
    settings: &CalibrationSettings,
) -> Result<Calibration> {
    let job = (statistics, Some(pooled));
    let nothing = Logs(Vec::new());
    road(job, &nothing, settings, &|_| Ok(()), &mut Vec::new())
}

/// The logs' statistics over the columns that act, and what else is known.
struct Known {
    library: Library,
    every_candidate: Library,
    zero_columns: Vec<usize>,
    columns: Columns,
    sums: Sums,
    facts: Facts,
}

fn road(
    (statistics, pooled): (&Statistics, Option<&Pooled>),
    heldout: &Logs<'_>,
    settings: &CalibrationSettings,
    progress: &Watch<'_>,
    findings: &mut Vec<Finding>,
) -> Result<Calibration> {
    let robot = &statistics.robot;
    let settings = planned((statistics, pooled), settings)?;
    progress(Stage::Rows)?;
    let known = known((statistics, pooled), &settings, findings)?;
    let Known {
        library,
        columns,
        sums,
        facts,
        ..
    } = &known;
    let (data, trajectories) = held_out_rows(statistics, library, heldout)?;
    findings.extend(compared(statistics, (heldout, &data))?);
    findings.extend(checked(statistics, &trajectories)?);
    progress(Stage::Inference)?;
    let fitted = match pooled {
        None => estimated((robot, sums, columns), &settings, findings)?,
        Some(pooled) => pooled.fitted((robot, sums, columns), &settings, findings)?,
    };
    let fit = &fitted.fit;
    let compact = compacted(fit, pooled)?;
    let twin = twin(statistics, &known, &fitted);
    let own = held_out::Own {
        twin: &twin,
        compact: &compact,
        fit,
    };
    findings.extend(data.findings.iter().cloned());
    let plan = held_out::plan_of_heldout(&data, &trajectories);
    let (validation, more) = held_out::validate(own, library, plan, Vec::new(), progress)?;
    findings.extend(more);
    findings.extend(worse::of_validation(robot, &validation));
    progress(Stage::Sensitivity)?;
    let opinion = opinion((library, pooled), (fit, sums), &compact);
    let (zero, states) = (&known.zero_columns, &facts.states);
    let excitation = unseen::excitation(robot, &known.every_candidate, zero, &fit.gram, states);
    let facts = facts.with_heldout(&data.heldout);
    let pieces = Pieces {
        twin,
        library,
        facts: &facts,
        sums,
        columns,
        settings: &settings,
        fit: fitted.fit,
        validation,
        sweep: Vec::new(),
        opinion,
        pooled: pooled.is_some(),
    };
    stages::told(pieces, &excitation, findings)
}

/// The settings with what the plan has chosen, where it and the statistics can be used.
fn planned(
    (statistics, pooled): (&Statistics, Option<&Pooled>),
    settings: &CalibrationSettings,
) -> Result<CalibrationSettings> {
    let plan = &statistics.plan;
    plan.require_for(&statistics.robot)?;
    require_even_rows(settings)?;
    // A fleet has left out robots with torque of another size.
    if pooled.is_none() {
        require_like(statistics)?;
    }
    let mut settings = settings.clone();
    settings.library = plan.library.clone();
    settings.noise.model = plan.noise;
    Ok(settings)
}

/// The posterior of the effects that are in alone.
fn compacted(fit: &Fit, pooled: Option<&Pooled>) -> Result<Posterior> {
    let inside = compact::members(&fit.problem, &fit.posterior);
    match pooled {
        None => compact::refit(&fit.problem, &inside, &fit.posterior),
        Some(pooled) => pooled.compact(&inside, &fit.posterior),
    }
}

fn opinion(
    (library, pooled): (&Library, Option<&Pooled>),
    (fit, sums): (&Fit, &Sums),
    compact: &Posterior,
) -> SecondOpinion {
    SecondOpinion {
        sandwich: match pooled {
            None => sandwich::sds(fit, compact, sums),
            Some(pooled) => vec![None; pooled.mean.len()],
        },
        compact: compact::summary(library, &fit.problem, &fit.posterior, compact, &fit.gram),
    }
}

/// The fit, with what chains and plug-ins say of it.
fn estimated(
    (robot, sums, columns): (&Robot, &Sums, &Columns),
    settings: &CalibrationSettings,
    findings: &mut Vec<Finding>,
) -> Result<Fitted> {
    let mut fitted = fitted::estimate(sums, &[], columns, settings)?;
    findings.extend(independent_rows::require(robot, &fitted.fit, &[])?.findings);
    let fit = &fitted.fit;
    fitted.fit.posterior = infer_near(
        &fit.problem,
        &fit.posterior,
        &settings.inference,
        settings.most_bytes,
    )?;
    findings.extend(unsettled::findings(robot, &fitted, settings, sums));
    findings.extend(misfit::findings(robot, &fitted.fit.plug_in));
    Ok(fitted)
}

fn known(
    (statistics, pooled): (&Statistics, Option<&Pooled>),
    settings: &CalibrationSettings,
    findings: &mut Vec<Finding>,
) -> Result<Known> {
    let (robot, plan) = (&statistics.robot, &statistics.plan);
    let (every_candidate, more) = Library::propose(robot, &plan.library)?;
    findings.extend(plan.findings.iter().cloned().chain(more));
    for log in &statistics.logs {
        findings.extend(log.about.findings.iter().cloned());
    }
    let logs: Vec<LogFacts> = (statistics.logs.iter())
        .map(|log| log.about.facts.clone())
        .collect();
    let facts = Facts::of(&logs, &[]);
    let zero_columns = match pooled {
        Some(pooled) => pooled.zero_columns.clone(),
        None => {
            let all = sums(&statistics.logs, settings, &[]);
            let squares = squares(&all.total().gram, every_candidate.columns().len());
            all_logs::hardly_act(&squares, all.rows(), &every_candidate)
        }
    };
    findings.extend(all_logs::zero_findings(&every_candidate, &zero_columns));
    let library = every_candidate.without_columns(&zero_columns);
    let mut columns = columns_of(robot, &library, settings, facts.payload_apart)?;
    columns.one_motion = logs.len() == 1;
    columns.halves = dissipative::halves(robot, &plan.library, &columns, &facts.hull);
    let cutoff = settings.signal.cutoff_hz;
    if pooled.is_none() {
        all_logs::require_enough((robot, &library), &facts.summaries, &columns, cutoff)?;
    }
    Ok(Known {
        sums: sums(&statistics.logs, settings, &zero_columns),
        library,
        every_candidate,
        zero_columns,
        columns,
        facts,
    })
}

/// The sums of all logs without these columns.
fn sums(logs: &[LogStatistics], settings: &CalibrationSettings, dropped: &[usize]) -> Sums {
    let mut sums = Sums::empty(fitted::runs(settings), (logs.len(), Purpose::Result));
    for log in logs {
        if dropped.is_empty() {
            sums.add(&log.sums);
        } else {
            sums.add(&log.sums.without(dropped));
        }
    }
    sums
}

/// Squares of each column over all rows and joints.
fn squares(gram: &Gram, columns: usize) -> Vec<f64> {
    let mut squares = vec![0.0; columns];
    for joint in &gram.joints {
        for (i, &column) in joint.columns.iter().enumerate() {
            squares[column as usize] += joint.s0.at(i, i);
        }
    }
    squares
}

fn twin(statistics: &Statistics, known: &Known, fitted: &Fitted) -> Twin {
    let (robot, plan) = (&statistics.robot, &statistics.plan);
    let posterior = &fitted.fit.posterior;
    let out_of_band = out_of_band(statistics, known, &posterior.mean);
    let spreads = vec![Spread::default(); robot.dof()];
    Twin {
        robot: robot.clone(),
        library: plan.library.clone(),
        zero_columns: known.zero_columns.clone(),
        pipeline: plan.pipeline.clone(),
        posterior: posterior.clone(),
        noise: noise_of(robot, fitted, &out_of_band, &spreads),
        hull: known.facts.hull.clone(),
        payload_where_unknown: plan.payload_where_unknown,
    }
}

/// sd per joint of the torque outside the filter's band; 0 with the filter off.
fn out_of_band(statistics: &Statistics, known: &Known, beta: &[f64]) -> Vec<f64> {
    let mut kept = 0;
    let all = (0..known.every_candidate.columns().len()).map(|column| {
        if known.zero_columns.contains(&column) {
            return 0.0;
        }
        kept += 1;
        beta[kept - 1]
    });
    let beta: Vec<f64> = all.collect();
    let step = statistics.logs.len().div_ceil(all_logs::LOGS_OF_RAW).max(1);
    let of_joint = |joint: usize| {
        let mut sums = [(0.0, 0.0); 2];
        for log in statistics.logs.iter().step_by(step) {
            let Some(raw) = log.raw.get(joint) else {
                continue;
            };
            let own = &log.sums.joints[joint];
            let mut of_signals: Vec<f64> = own.columns.iter().map(|&k| beta[k]).collect();
            if let Some(recipes) = &own.recipes {
                of_signals = recipes.of_parts(&of_signals);
            }
            for (sum, gram) in sums.iter_mut().zip(raw) {
                sum.0 += residual_form(&gram.s0, &of_signals);
                sum.1 += gram.n;
            }
        }
        let [raw, in_band] = sums.map(|(sum, n)| if n > 0.0 { sum / n } else { 0.0 });
        (raw - in_band).max(0.0).sqrt()
    };
    (0..statistics.robot.dof()).map(of_joint).collect()
}

/// What logs say of each other: copies, and joints that are hardly driven in some of them.
///
/// # Errors
/// [`Error::Statistics`](crate::Error::Statistics) for a held-out log from the time of another, and those of chapters that cannot be read.
fn compared(statistics: &Statistics, (heldout, data): (&Logs<'_>, &Data)) -> Result<Vec<Finding>> {
    let fitted = || statistics.logs.iter();
    let mut all: Vec<Identity<'_>> = fitted().map(LogStatistics::identity).collect();
    all.extend(data.heldout.iter().map(|log| Identity {
        name: &log.summary.name,
        source: "",
        ends: log.ends.map(|stamp| log.origin + stamp),
        sums: 0,
    }));
    require_apart(&all)?;
    let robot = &statistics.robot;
    let noise = heldout.0.iter().map(|log| Sketch::of(log, robot.dof()));
    let noise: Vec<Sketch> = noise.collect::<Result<_>>()?;
    let named = heldout.0.iter().map(Log::name).zip(&noise);
    let known = fitted().map(|log| (log.name(), &log.noise));
    let mut findings = sketched_copies(&known.chain(named).collect::<Vec<_>>());
    let sizes = fitted().map(|log| Ok((log.name().to_owned(), log.about.torque_rms.clone())));
    let tested = heldout.0.iter();
    let tested = tested.map(|log| Ok((log.name().to_owned(), torque_rms(log)?)));
    let sizes: Vec<_> = sizes.chain(tested).collect::<Result<_>>()?;
    findings.extend(less_driven(robot, &sizes));
    Ok(findings)
}

/// What motion and model say of the held-out logs, and torque of a log or a joint that the others contradict.
fn checked(statistics: &Statistics, trajectories: &all_logs::Trajectories) -> Result<Vec<Finding>> {
    let (robot, pipeline) = (&statistics.robot, &statistics.plan.pipeline);
    let checked = self_check(robot, pipeline, trajectories.heldout.iter())?;
    let fitted = statistics.logs.iter().map(|log| Compared {
        name: log.name(),
        payload: log.about.facts.payload,
        excerpt: Cow::Borrowed(&log.excerpt),
    });
    let heldout = trajectories.heldout.iter();
    let heldout = heldout.map(|log| Compared::of(pipeline, log));
    let all: Vec<Compared<'_>> = fitted.chain(heldout).collect();
    let mut fitted = statistics.logs.iter();
    let right = checked.is_empty() && fitted.all(|log| log.about.signs_are_right);
    let mut findings = odd_torque(robot, &all, right);
    findings.extend(checked);
    Ok(findings)
}

/// Rows and motion of the held-out logs.
fn held_out_rows(
    statistics: &Statistics,
    library: &Library,
    heldout: &Logs<'_>,
) -> Result<(Data, all_logs::Trajectories)> {
    let (robot, plan) = (&statistics.robot, &statistics.plan);
    let reader = Reader {
        robot,
        library,
        pipeline: &plan.pipeline,
        unknown: plan.payload_where_unknown,
    };
    let logs: Vec<ReadyLog<'_>> = (heldout.0.iter())
        .map(|log| ready(robot, log, &plan.pipeline))
        .collect::<Result<_>>()?;
    Data::read_heldout(reader, &logs)
}
