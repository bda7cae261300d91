//! The report's tables besides the effects: scores, noise, motion, logs, findings, convergence, pipeline.

use super::ReportContext;
use super::view::Joint;
use crate::words::list::list;
use crate::words::number::{count, number, percent, probability};
use crate::words::units::{pooled_unit, unit_of};
use serde::Serialize;
use twincal::assess::{converged, friction_only, standstill};
use twincal::calibrate::{Calibration, LogSummary};
use twincal::posterior::{Method, Model, Posterior};
use twincal::signal::Pipeline;
use twincal::validate::Scores;

/// A table: heads and rows of cells; the first column names the row.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct Table {
    pub(super) heads: Vec<String>,
    pub(super) rows: Vec<Vec<String>>,
}

impl Table {
    pub(super) fn new<const N: usize>(heads: [&str; N]) -> Self {
        Self {
            heads: heads.map(String::from).to_vec(),
            rows: Vec::new(),
        }
    }

    fn drop_column(&mut self, head: &str) {
        if let Some(at) = self.heads.iter().position(|other| other == head) {
            self.heads.remove(at);
            for row in self.rows.iter_mut().filter(|row| row.len() > at) {
                row.remove(at);
            }
        }
    }
}

/// Logs up to this number are named at the head of the page.
const NAMED: usize = 3;

/// What the page is about: the model file and the logs with their length.
pub(super) fn about(calibration: &Calibration, run: &ReportContext) -> String {
    let of = |heldout: bool| -> Vec<&LogSummary> {
        let logs = calibration.logs.iter();
        logs.filter(|log| (log.role == "heldout") == heldout)
            .collect()
    };
    let told = |logs: &[&LogSummary]| {
        let seconds = with_unit(logs.iter().map(|log| log.duration).sum(), "s");
        if logs.len() > NAMED {
            return format!("{} logs ({seconds})", logs.len());
        }
        let each: Vec<String> = (logs.iter())
            .map(|log| format!("{} ({})", log.name, with_unit(log.duration, "s")))
            .collect();
        list(&each)
    };
    let mut out = format!("{}, fitted to {}", run.model, told(&of(false)));
    if !of(true).is_empty() {
        out.push_str(&format!(", tested on {}", told(&of(true))));
    }
    out
}

/// Held-out scores per joint and pooled.
pub(super) fn scores(scores: &Scores, calibration: &Calibration) -> Table {
    let mut table = Table::new([
        "joint",
        "rows",
        "RMSE nominal",
        FRICTION,
        "RMSE calibrated",
        "change",
        "of torque's sd",
        "mean error",
        "95 % coverage",
        "mean width",
        "interval score",
        "from coefficients",
    ]);
    for score in scores.joints.iter() {
        let unit = unit_of(calibration, &score.joint);
        let share = score.rmse_calibrated / score.torque_sd;
        table.rows.push(vec![
            score.joint.clone(),
            count(score.rows),
            with_unit(score.rmse_nominal, unit),
            with_unit(score.rmse_friction.unwrap_or(f64::NAN), unit),
            with_unit(score.rmse_calibrated, unit),
            change(score.rmse_nominal, score.rmse_calibrated),
            percent(share),
            with_unit(score.bias, unit),
            percent(score.coverage95),
            with_unit(score.mean_width95, unit),
            with_unit(score.interval_score95, unit),
            percent(score.epistemic_share),
        ]);
    }
    if scores.joints.len() > 1 {
        let unit = pooled_unit(calibration);
        table.rows.push(vec![
            "all joints".into(),
            count(scores.joints.iter().map(|j| j.rows).sum()),
            with_unit(scores.rmse_nominal, unit),
            with_unit(friction_only(scores).unwrap_or(f64::NAN), unit),
            with_unit(scores.rmse_calibrated, unit),
            change(scores.rmse_nominal, scores.rmse_calibrated),
            String::new(),
            String::new(),
            percent(scores.coverage95),
            String::new(),
            with_unit(scores.interval_score95, unit),
            percent(scores.epistemic_share),
        ]);
    }
    if scores
        .joints
        .iter()
        .all(|joint| joint.rmse_friction.is_none())
    {
        table.drop_column(FRICTION);
    }
    table
}

/// Head of the errors that friction alone would leave.
const FRICTION: &str = "friction only";

/// Head of the autoregressive coefficients, which only that likelihood has.
const RHO: &str = "AR(1) ρ";

/// Noise per joint as it was used.
pub(super) fn noise(joints: &[Joint<'_>]) -> Table {
    let mut table = Table::new([
        "joint",
        "noise sd",
        RHO,
        "weight",
        "rows",
        "effective rows",
        "memory (rows)",
        "interval factor",
        "out-of-band sd",
    ]);
    for joint in joints {
        let noise = joint.noise;
        table.rows.push(vec![
            joint.name.into(),
            with_unit(noise.sigma, joint.units.torque),
            number(noise.rho, 3),
            number(noise.weight, 3),
            count(noise.n.max(0.0).round() as u64),
            number(noise.n_eff, 3),
            number(noise.autocorrelation_time, 3),
            number(noise.interval_factor, 3),
            with_unit(noise.out_of_band, joint.units.torque),
        ]);
    }
    if joints.iter().all(|joint| joint.noise.rho == 0.0) {
        table.drop_column(RHO);
    }
    table
}

/// The motion that the twin knows, per joint.
pub(super) fn motion(calibration: &Calibration, joints: &[Joint<'_>]) -> Table {
    let mut table = Table::new([
        "joint",
        "position",
        "velocity",
        "acceleration",
        "rows at standstill",
    ]);
    for (j, (joint, hull)) in joints.iter().zip(&calibration.twin.hull).enumerate() {
        let range = |low: f64, high: f64, unit: &str| {
            format!("{} … {} {unit}", number(low, 3), number(high, 3))
        };
        table.rows.push(vec![
            joint.name.into(),
            range(hull[0], hull[1], joint.units.position),
            range(hull[2], hull[3], joint.units.velocity),
            range(hull[4], hull[5], joint.units.acceleration),
            percent(standstill(calibration, j)),
        ]);
    }
    table
}

/// What became of each log.
pub(super) fn logs(calibration: &Calibration) -> Table {
    let mut table = Table::new([
        "log",
        "used for",
        "samples",
        "duration",
        "rate",
        "segments",
        "rows kept",
        "rows at standstill",
    ]);
    for log in &calibration.logs {
        let per_joint = |values: &[u64]| match values {
            [first, rest @ ..] if rest.iter().all(|v| v == first) => count(*first),
            [] | [_] | [_, _] | [_, _, _] => values
                .iter()
                .map(|v| count(*v))
                .collect::<Vec<_>>()
                .join(" / "),
            [first, ..] => {
                let range = values.iter().fold((*first, *first), |(low, high), v| {
                    (low.min(*v), high.max(*v))
                });
                format!("{} … {}", count(range.0), count(range.1))
            }
        };
        table.rows.push(vec![
            log.name.clone(),
            if log.role == "heldout" {
                "test".into()
            } else {
                log.role.clone()
            },
            count(log.samples),
            with_unit(log.duration, "s"),
            with_unit(log.rate_hz, "Hz"),
            count(log.segments),
            per_joint(&log.rows),
            per_joint(&log.standstill),
        ]);
    }
    table
}

/// How the posterior was computed and whether to trust the computation.
pub(super) fn convergence(calibration: &Calibration) -> Vec<String> {
    let posterior = &calibration.twin.posterior;
    let mut out = Vec::new();
    match posterior.method {
        Method::Exact { models } => out.push(format!(
            "Exact: all {} models were summed. The probabilities carry no Monte Carlo error.",
            count(models)
        )),
        Method::Search { models, missing } => out.push(format!(
            "Search: {} models were weighed; an estimated share of {} of the probability was not found.",
            count(models),
            number(missing, 2)
        )),
        Method::Fleet {
            robots,
            chains,
            draws,
            spread,
        } => out.push(format!(
            "From the statistics of {} robots: {} chains of {} draws; the probability that a robot deviates differs by {} between them at most.",
            count(robots as u64),
            count(chains as u64),
            count(draws as u64),
            number(spread, 2)
        )),
        Method::Gibbs {
            chains,
            draws,
            r_hat,
            ess,
        } => {
            out.push(format!(
                "Gibbs sampling: {} chains of {} draws; largest R̂ {} (at most 1.01 is good), smallest effective sample size {} \
                 (at least 400 is good).",
                count(chains as u64),
                count(draws as u64),
                if r_hat.is_finite() { format!("{r_hat:.3}") } else { "–".into() },
                count(ess.max(0.0) as u64),
            ));
            out.extend(chains_agree(calibration));
        }
    }
    out.extend(
        posterior
            .models
            .first()
            .map(|first| most_probable(posterior, first)),
    );
    if let Some(evidence) = posterior.log_evidence {
        out.push(format!(
            "Log evidence of the whole library: {}.",
            number(evidence, 8)
        ));
    }
    out
}

/// Whether chains agree, and what their draws leave open.
fn chains_agree(calibration: &Calibration) -> Vec<String> {
    let posterior = &calibration.twin.posterior;
    let agree = if converged(calibration) {
        "The chains agree.".into()
    } else {
        "The chains have not converged: raise [inference] draws, or use fewer candidates and method = \"exact\".".into()
    };
    let worst = posterior.inclusion_mcse.iter().copied().fold(0.0, f64::max);
    let error = format!(
        "Largest Monte Carlo standard error of a probability: {}.",
        number(worst, 2)
    );
    let mut out = vec![agree, error];
    let undecided: Vec<_> = calibration
        .terms
        .iter()
        .filter(|t| {
            t.pip
                .zip(t.pip_mcse)
                .is_some_and(|(p, e)| e > 0.0 && (p - 0.5).abs() < 3.0 * e)
        })
        .map(|t| t.term.name.as_str())
        .collect();
    if !undecided.is_empty() {
        out.push(format!(
            "Too close to 0.5 to decide with these draws: {}.",
            list(&undecided)
        ));
    }
    out
}

/// What the most probable model counts, and the models that intervals use.
fn most_probable(posterior: &Posterior, first: &Model) -> String {
    format!(
        "The most probable model has probability {} and {}; intervals use the most probable models ({}), which {}.",
        probability(first.weight * posterior.models_mass),
        match first.members.len() {
            1 => "one term".into(),
            n => format!("{n} terms"),
        },
        count(posterior.models.len() as u64),
        match 1.0 - posterior.models_mass {
            rest if rest > 0.0 => format!("leave out {} of the probability", number(rest, 2)),
            _ => "are all that count".into(),
        },
    )
}

/// The signal pipeline as used.
pub(super) fn pipeline(calibration: &Calibration) -> Vec<String> {
    let pipeline = &calibration.twin.pipeline;
    if pipeline.cutoff_hz == 0.0 {
        return vec!["Filter off: every input row is one row of the regression.".into()];
    }
    vec![
        format!(
            "Motion is smoothed below {} and differentiated by the same kernel; torque and every candidate are low-passed at {} \
             by the same filter, which keeps the regression exactly linear.",
            with_unit(pipeline.motion_cutoff_hz, "Hz"),
            with_unit(pipeline.cutoff_hz, "Hz")
        ),
        format!(
            "Rows are kept at {}.",
            with_unit(calibration.kept_rate_hz(), "Hz")
        ),
        standstill_rule(pipeline),
    ]
}

/// Which rows count as standstill.
fn standstill_rule(pipeline: &Pipeline) -> String {
    let slow = match pipeline.standstill_velocity.as_slice() {
        [first, rest @ ..] if rest.iter().all(|v| v == first) => number(*first, 2),
        each => list(&each.iter().map(|v| number(*v, 2)).collect::<Vec<_>>()),
    };
    format!(
        "A joint is at rest where its position is constant for {} s or longer, or where it stays below {slow} (rad/s or m/s) for longer than \
         {} s; such rows are left out of its fit.",
        number(pipeline.shortest_rest(), 2),
        number(pipeline.shortest_standstill(), 2)
    )
}

pub(super) fn with_unit(x: f64, unit: &str) -> String {
    if x.is_finite() {
        format!("{}\u{a0}{unit}", number(x, 3))
    } else {
        "–".into()
    }
}

pub(super) fn change(before: f64, after: f64) -> String {
    let change = after / before - 1.0;
    if change > 0.0 {
        format!("+{}", percent(change))
    } else {
        percent(change)
    }
}
