//! The whole road, from a robot and its logs to a calibrated twin, in one function that reads like the paper.

mod again;
mod aligned;
mod another_state;
mod compact;
mod components;
mod correlate;
mod cross_checked;
mod curves;
mod data;
mod dissipative;
mod drift;
mod drive_scale;
mod effects;
mod friction_only;
mod groups;
mod heavy_tails;
mod held_out;
mod heredity;
mod history;
mod independent_rows;
mod left_out;
mod lower_band;
mod misfit;
mod negative_friction;
mod noise_of;
mod outlook;
mod prior_conflict;
mod reader;
mod ripples;
mod relinearise;
mod result;
mod room;
mod sandwich;
mod settings;
mod smaller_library;
mod status;
mod stopped;
mod summary;
mod sweep;
mod turning;
mod unphysical;
mod uneven_noise;
mod unseen;
mod unsettled;
mod weigh;
mod whiteness;
mod wider_band;
mod worse;
#[cfg(test)]
mod testing;

pub use effects::Effect;
pub use left_out::{LeftOutData, LeftOutError};
pub use outlook::{LookedAt, Outlook, outlook};
pub use result::{
    Alike, Along, Calibration, Compact, CompactTerm, ComponentSummary, Curve, Draws, Group,
    LikelihoodUsed, LogSummary, ParameterSummary, PriorUsed, SweepPoint, TermSummary,
};
pub use ripples::UnaskedRipple;
pub use settings::CalibrationSettings;
pub use status::{Status, StatusReason};
pub use stopped::Stopped;

use crate::error::{Error, Finding, Result};
use crate::infer::{Given, infer_near, sample, sampled_likelihood};
use crate::likelihood::{Columns, NoiseInterval, NoiseModel, NoiseUncertainty};
use crate::observations::Part;
use crate::plug_in::{Fit, FitSettings, Moving, fit, fit_tempered, start};
use crate::posterior::draws::Drawer;
use crate::robot::Robot;
use crate::self_check::self_check;
use crate::signal::{
    Log, Logs, ReadyLog, choose_and_prepare, constant_torque, hardly_driven, ready,
};
use crate::term::{Family, Library, LibrarySettings};
use crate::twin::Twin;
use again::{Goal, Road, whole_road};
use data::Data;
use heredity::Named;
use lower_band::{Band, TooFew};
use noise_of::noise_of;
use relinearise::Linear;
use ripples::Seen;
use wider_band::wider;

/// How far a calibration has come; for progress bars.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Cutting, resampling and filtering the logs.
    Rows,
    /// Inference on all fit logs.
    Inference,
    /// Predicting held-out data: (done, all) splits.
    Validation(usize, usize),
    /// Prior and cut-off sensitivity.
    Sensitivity,
}

/// Who is told of each stage, and may end the calibration with an error.
type Watch<'a> = dyn Fn(Stage) -> Result<()> + 'a;

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

/// [`calibrate`] under eyes that may end it with an error.
pub(crate) fn calibrate_watched(
    robot: &Robot,
    recordings: (Logs<'_>, Logs<'_>),
    settings: &CalibrationSettings,
    progress: &Watch<'_>,
) -> std::result::Result<Calibration, Stopped> {
    let mut findings = Vec::new();
    let every_log = recordings.0.0.iter().chain(&recordings.1.0);
    let shelves: Vec<_> = every_log.filter_map(Log::shelf).collect();
    let as_recorded = cross_checked::as_recorded(robot, &recordings)?;
    let calibration = whole_road(robot, recordings, settings, progress, &mut findings);
    // Numbers that could not be read back are behind whatever came out.
    let calibration = match shelves.iter().find_map(|shelf| shelf.failure()) {
        Some(failure) => Err(failure),
        None => calibration,
    };
    cross_checked::told(calibration, as_recorded, findings)
}

/// From logs to a calibration; `recordings` are gone as soon as nobody needs them.
fn road(
    robot: &Robot,
    recordings: &mut Option<(Logs<'_>, Logs<'_>)>,
    settings: &CalibrationSettings,
    goal: Goal,
    progress: &Watch<'_>,
    findings: &mut Vec<Finding>,
) -> Result<Road> {
    let (logs, heldout) = match recordings {
        Some((logs, heldout)) => (&logs.0[..], &heldout.0[..]),
        None => Default::default(),
    };
    // the same filters for every log, and candidates for this robot
    progress(Stage::Rows)?;
    for log in logs.iter().chain(heldout) {
        let names = robot.joint_names();
        log.any_recording(|recording| recording.require_torque(&names))?;
    }
    let chosen = choose_and_prepare(robot, logs, &settings.signal)?;
    let (mut pipeline, mut prepared, wider_hz) = (chosen.pipeline, chosen.logs, chosen.wider_hz);
    findings.extend(chosen.findings);
    let every_log: Vec<Log<'_>> = logs.iter().chain(heldout).map(Log::lent).collect();
    findings.extend(constant_torque(robot, every_log.clone())?);
    findings.extend(hardly_driven(robot, every_log.clone())?);
    let mut lags = aligned::align(robot, logs, &mut pipeline, &mut prepared, findings)?;
    let usual = smaller_library::is_usual(&settings.library.families);
    let followed = history::follow(robot, (logs, &prepared), &pipeline, settings, findings)?;
    let settings = &followed.settings;
    pipeline.history = followed.history;
    let mut library_settings = LibrarySettings {
        coulomb_velocity: pipeline.coulomb_velocity,
        ..settings.library.clone()
    };
    let (mut library, more) = Library::propose(robot, &library_settings)?;
    findings.extend(more);
    let unknown = data::carry_something(every_log.iter().map(Log::payload));
    let looked_at = (logs, &prepared[..], unknown);
    let turned = turning::turn(robot, &library, looked_at, &pipeline, settings)?;
    if let Some(turned) = turned {
        turned.prepare_again(robot, logs, &pipeline, &mut prepared)?;
        library_settings.coulomb_velocity = turned.pipeline.coulomb_velocity;
        (pipeline, library) = (turned.pipeline, turned.library);
        findings.push(turned.finding);
    }

    // eq. (1)–(4): residual torque and Euler–Lagrange columns, filtered alike
    let others = heldout.iter().map(|log| ready(robot, log, &pipeline));
    let others: Vec<ReadyLog<'_>> = others.collect::<Result<_>>()?;
    let sweeps = !settings.noise.weighs_rows();
    let all = (&prepared[..], &others[..]);
    room::require(settings.most_bytes, &library, &pipeline, all, sweeps)?;
    let elsewhere = sweep::pipelines(&pipeline, settings);
    let pipelines = (&pipeline, &elsewhere[..]);
    let (mut data, trajectories) = Data::read(robot, &library, pipelines, &prepared, &others)?;
    let compared = self_check(robot, &pipeline, trajectories.all())?;
    findings.extend(cross_checked::as_filtered(
        robot,
        &pipeline,
        &trajectories,
        (goal, &compared),
    ));
    findings.extend(compared);
    lags = aligned::of_every_log(robot, &pipeline, settings, &trajectories, findings).or(lags);
    let every_candidate = library.clone();
    let (library, zero_columns) = data.drop_zero_columns(library);
    let mut columns = columns_of(robot, &library, settings, data::tell_payload_apart(logs))?;
    columns.one_motion = logs.len() == 1;
    columns.halves = dissipative::halves(robot, &library_settings, &columns, &data.hull(robot));
    findings.append(&mut data.findings);
    let cutoff_hz = pipeline.cutoff_hz;
    let too_few = |error| Ok(Road::TooFew(TooFew { error, cutoff_hz }));
    if let Err(error) = data.require_enough(robot, &columns, settings.signal.cutoff_hz) {
        return too_few(error);
    }
    let misfit = data.nominal_misfit();
    // eq. (5): sparse regression with everything that is plugged in at its fixed point
    progress(Stage::Inference)?;
    let spreads = weigh::weigh(robot, &mut data, &columns, settings, findings)?;
    let training = data.training();
    let count = |fitted: &Fitted| independent_rows::require(robot, &data, &fitted.fit, &training);
    if goal == Goal::Count {
        let counted = count(&estimate(&training, &columns, settings)?)?;
        return Ok(Road::Counted(Band::new(cutoff_hz, counted.most, misfit)));
    }
    let plan = held_out::plan(&data, &trajectories, &pipeline);
    let (fitted, fits_of_folds) = rayon::join(
        || estimate(&training, &columns, settings),
        || plan.fits(&columns, settings),
    );
    let (mut fitted, fits_of_folds) = (fitted?, fits_of_folds?);
    let counted = count(&fitted);
    let model = (robot, &library, &library_settings);
    let open = match relinearise::elsewhere(model, &data, &fitted.fit, settings)? {
        Linear::Elsewhere(point) => return Ok(Road::Elsewhere(point)),
        Linear::Open(moves) => Some(moves),
        Linear::Enough => None,
    };
    findings.extend(relinearise::finding(&library_settings.linearised_at, open));
    let seen = match settings.unasked_ripple {
        UnaskedRipple::Ignored => Vec::new(),
        _ => ripples::seen(robot, &training, &fitted.fit, &library_settings, &pipeline),
    };
    if !seen.is_empty() && usual && settings.unasked_ripple == UnaskedRipple::Candidate {
        return Ok(Road::Again(seen));
    }
    let (ready, band) = ((&prepared[..], unknown), (&pipeline, wider_hz));
    if let Some(wider) = wider(robot, &library, ready, band, &fitted.fit, settings)? {
        return Ok(Road::Wider(wider));
    }
    match counted {
        Ok(counted) => findings.extend(counted.findings),
        Err(error) => return too_few(error),
    }
    if goal == Goal::End
        && let Some(drowned) = lower_band::drowned(robot, findings, misfit, cutoff_hz)
    {
        return Ok(Road::Drowned(drowned));
    }
    findings.extend(seen.iter().map(Seen::told));
    if fitted.sampled.is_empty() {
        let fit = &fitted.fit;
        fitted.fit.posterior = infer_near(&fit.problem, &fit.posterior, &settings.inference)?;
    }
    findings.extend(unsettled::findings(robot, &fitted, settings, &training));
    let mean = &fitted.fit.posterior.mean;
    let robust = settings.noise.robust;
    let (tails, (drifts, uneven)) = rayon::join(
        || heavy_tails::findings(robot, &training, mean, robust),
        || {
            let uneven = uneven_noise::findings(robot, &fitted.fit, &training, settings.noise);
            (drift::findings(robot, &training, mean), uneven)
        },
    );
    findings.extend(misfit::findings(robot, &fitted.fit.plug_in));
    findings.extend(tails.into_iter().chain(drifts).chain(uneven));
    let inside = compact::members(&fitted.fit.problem, &fitted.fit.posterior);
    let compact = compact::refit(&fitted.fit.problem, &inside, &fitted.fit.posterior)?;

    // τ_calib = τ_nom + Φβ̂ with intervals, and held-out truth
    let out_of_band = data.out_of_band(
        robot,
        &library,
        &pipeline,
        &trajectories,
        &fitted.fit.posterior.mean,
    )?;
    let skeleton = Twin {
        robot: robot.clone(),
        library: library_settings,
        zero_columns,
        pipeline,
        posterior: fitted.fit.posterior.clone(),
        noise: noise_of(robot, &fitted, &training, &out_of_band, &spreads),
        hull: data.hull(robot),
        payload_where_unknown: unknown,
    };
    let own = held_out::Own {
        twin: &skeleton,
        compact: &compact,
        fit: &fitted.fit,
    };
    let (validation, more) = held_out::validate(own, &library, plan, fits_of_folds, progress)?;
    findings.extend(more);
    findings.extend(worse::findings(robot, &validation.filtered));
    findings.extend(worse::of_compact(validation.compact));

    // What follows reads the smoothed logs at other cut-offs and nothing of the recordings.
    drop((trajectories, others, every_log));
    let prepared: Vec<ReadyLog<'static>> = prepared.into_iter().map(ReadyLog::detached).collect();
    *recordings = None;
    progress(Stage::Sensitivity)?;
    let elsewhere = || {
        sweep::cutoff(
            &skeleton,
            &library,
            &prepared,
            &data,
            &columns,
            settings,
            &fitted.fit,
        )
    };
    let (problem, posterior) = (&fitted.fit.problem, &fitted.fit.posterior);
    let beside = || {
        let sandwich = sandwich::sds(&fitted.fit, &compact, &training);
        let compact = compact::summary(&library, problem, posterior, &compact, &training);
        let excitation = unseen::excitation(
            robot,
            &every_candidate,
            &skeleton.zero_columns,
            &fitted.fit.gram,
            &data,
        );
        (sandwich, compact, excitation)
    };
    let (sweep, (sandwich, compact, excitation)) = rayon::join(elsewhere, beside);
    let sweep = sweep?;
    drop(prepared);
    findings.extend(sweep::findings(&sweep, &library, posterior));
    let opinion = summary::SecondOpinion { sandwich, compact };
    let mut calibration = summary::summarise(
        skeleton, &library, &data, &columns, settings, fitted, validation, sweep, opinion, findings,
    )?;
    unseen::tell(&mut calibration, &excitation);
    let seed = settings.inference.seed;
    let twin = &calibration.twin;
    let drawer = Drawer::new(&twin.posterior);
    let (curves, unphysical) = rayon::join(
        || curves::curves(robot, &library, &calibration, &drawer, seed),
        || unphysical::findings(robot, &library, &calibration, &drawer, seed),
    );
    (calibration.curves, calibration.lags) = (curves, lags);
    let components = &calibration.components;
    let negative = negative_friction::findings(&calibration.twin, &library, components);
    unphysical::tell(&mut calibration, unphysical);
    calibration.findings.extend(negative);
    Ok(Road::End(Box::new(calibration)))
}

/// A fit together with what left-out training data said of it.
struct Fitted {
    fit: Fit,
    /// Per joint on the noise sd of intervals; `None` unless tempered.
    interval_factors: Option<Vec<f64>>,
    /// What draws say of each joint's noise; empty where it is a plug-in.
    sampled: Vec<NoiseInterval>,
}

/// Fixed point, and for the tempered likelihood what no candidate describes.
fn estimate(
    training: &[Part<'_>],
    columns: &Columns,
    settings: &CalibrationSettings,
) -> Result<Fitted> {
    let fit_settings = FitSettings {
        noise: settings.noise,
        prior: &settings.prior,
    };
    let draws_noise = settings.noise.uncertainty == NoiseUncertainty::Sampled;
    if draws_noise {
        sampled_likelihood(settings.noise.model)?;
    }
    match settings.noise.model {
        NoiseModel::Tempered => {
            let (fit, factors) = fit_tempered(training, columns, fit_settings)?;
            Ok(Fitted {
                fit,
                interval_factors: Some(factors),
                sampled: Vec::new(),
            })
        }
        NoiseModel::Iid | NoiseModel::Ar1 => {
            let start = start(training, columns, &settings.prior);
            let mut fit = fit(training, columns, fit_settings, &start, Moving::All, None)?;
            let mut noise = Vec::new();
            if draws_noise {
                let given = Given {
                    grams: &fit.gram,
                    columns,
                    plug_in: &fit.plug_in,
                    problem: &fit.problem,
                    posterior: &fit.posterior,
                    prior: &settings.prior,
                    noise: settings.noise,
                };
                let sampled = sample(given, &settings.inference)?;
                noise = sampled.noise;
                fit = Fit {
                    plug_in: sampled.plug_in,
                    problem: sampled.problem,
                    posterior: sampled.posterior,
                    ..fit
                };
            }
            Ok(Fitted {
                fit,
                interval_factors: None,
                sampled: noise,
            })
        }
    }
}

/// The live columns with their components, families and bounds; `payload_apart`: the payload acts in some logs only, which tells
/// it from the link that carries it.
///
/// # Errors
/// [`Error::Setting`] if a component that is forced in has no column, or heredity makes no sense.
fn columns_of(
    robot: &Robot,
    library: &Library,
    settings: &CalibrationSettings,
    payload_apart: bool,
) -> Result<Columns> {
    let forced = &settings.prior.forced;
    let mut columns = Columns {
        names: Vec::new(),
        component: Vec::new(),
        family: Vec::new(),
        families: Vec::new(),
        prior_sd: library.prior_sds(),
        lower: Vec::new(),
        forced: Vec::new(),
        parent: Vec::new(),
        second_choice: Vec::new(),
        one_motion: false,
        halves: Vec::new(),
    };
    let mut named = Vec::new();
    let mut unknown: Vec<&String> = forced.iter().collect();
    let mut last = None;
    for &index in library.columns() {
        let term = &library.terms()[index];
        // A payload's tensor is in or out by itself, where motion can tell it from the payload's mass.
        let family = match term.family {
            Family::PayloadTensor if library.payload_is_one() => Family::Payload,
            family => family,
        };
        if last != Some((term.component, family)) {
            let alone = term.family == Family::PayloadTensor
                && last.is_none_or(|(component, _)| component != term.component);
            last = Some((term.component, family));
            let name = &library.components()[term.component].name;
            named.push(Named {
                name,
                family: term.family,
            });
            columns.forced.push(forced.contains(name));
            let component = &library.components()[term.component];
            columns
                .second_choice
                .push(alone || (!payload_apart && component.is_second_choice()));
            unknown.retain(|forced| *forced != name);
            let known = columns.families.iter().position(|f| *f == term.family);
            columns.family.push(known.unwrap_or_else(|| {
                columns.families.push(term.family);
                columns.families.len() - 1
            }));
        }
        columns.component.push(columns.family.len() - 1);
        columns.names.push(term.name.clone());
        columns.lower.push(if settings.library.nonnegative {
            library.least_value(index, robot)
        } else {
            f64::NEG_INFINITY
        });
    }
    columns.parent = heredity::parents(&named, settings.prior.heredity.as_deref())?;
    heredity::force_parents(&columns.parent, &mut columns.forced);
    match unknown.first() {
        None => Ok(columns),
        Some(name) => Err(Error::Setting {
            key: "prior.forced".into(),
            problem: format!("no candidate `{name}` with torque of its own in these logs"),
            remedy:
                "give names of components as `twincal fit` prints them, such as \"elbow.viscous\""
                    .into(),
        }),
    }
}

/// The data cannot answer: fewer rows than the question needs (exit code 4).
fn refuse(problem: String, remedy: &str) -> Error {
    Error::Refused {
        problem,
        remedy: remedy.into(),
    }
}
