//! Held-out truth: what to leave out, fit without it, predict it, score it.

use super::another_state;
use super::independent_rows::LEAST_EFFECTIVE_ROWS;
use crate::calibrate::data::all_logs::{Data, Trajectories};
use crate::calibrate::data::log::Log;
use crate::calibrate::fit::compact;
use crate::calibrate::fit::fitted::{Fitted, estimate, runs, sums};
use crate::calibrate::fit::friction_only;
use crate::calibrate::fit::noise_of::noise_of;
use crate::calibrate::progress::{Stage, Watch};
use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Code, Finding, Result, Severity};
use crate::likelihood::{Columns, JointNoise};
use crate::observations::{GramSum, Observations, Part};
use crate::plug_in::Fit;
use crate::posterior::Posterior;
use crate::signal::{Pipeline, Trajectory};
use crate::statistics::{Purpose, Sums};
use crate::term::Library;
use crate::twin::Twin;
use crate::validate::{HeldOut, LOG_GROUPS, Moments, Predictors, Split, Validation};
use rayon::prelude::*;

/// Share of a log that trains when there are one or two logs.
const TRAINING_SHARE: f64 = 0.7;
/// Logs at most that are left out one by one: every one costs a fit of all others. More are left out in groups.
const MOST_ONE_BY_ONE: usize = 12;
/// Least gap between training and held-out rows of one log, s.
const LEAST_GAP: f64 = 1.0;

/// What is left out, how, and by which fits.
pub(in crate::calibrate) struct Plan<'a> {
    split: Split,
    folds: Vec<Fold<'a>>,
}

/// One fit and what it has to predict.
struct Fold<'a> {
    training: Vec<Part<'a>>,
    /// Motion of logs and the time in s from which on they are held out.
    held_out: Vec<LeftOut<'a>>,
}

/// What is left out of one log: its rows and motion from a time on, s.
#[derive(Clone, Copy)]
struct LeftOut<'a> {
    rows: &'a Observations,
    motion: &'a Trajectory,
    from: f64,
}

impl<'a> Fold<'a> {
    /// The logs that are held out, whole.
    fn left_out(&self) -> Vec<Part<'a>> {
        self.held_out.iter().map(|own| own.rows.whole()).collect()
    }
}

impl LeftOut<'_> {
    /// Adds its rows, with measured less nominal torque.
    fn add_to(&self, sum: &mut GramSum) {
        let rows = self.rows.time.partition_point(|t| *t < self.from)..self.rows.len();
        let beyond = self.rows.beyond_nominal();
        let observations = beyond.as_ref().unwrap_or(self.rows);
        sum.add(&Part { observations, rows });
    }
}

/// The twin that was fitted to all logs, the posterior of its compact form, and the fit that they come from.
#[derive(Clone, Copy)]
pub(in crate::calibrate) struct Own<'a> {
    pub(in crate::calibrate) twin: &'a Twin,
    pub(in crate::calibrate) compact: &'a Posterior,
    pub(in crate::calibrate) fit: &'a Fit,
}

/// Who predicts the rows of a fold.
struct Rivals {
    average: Twin,
    compact: Posterior,
    /// Friction and offsets alone, where they are candidates.
    friction: Option<Posterior>,
}

impl Own<'_> {
    /// The twin as it is: it has seen nothing of whole logs that are held out.
    fn rivals(&self, library: &Library) -> Rivals {
        Rivals {
            average: self.twin.clone(),
            compact: self.compact.clone(),
            friction: friction_only::fitted(library, self.fit),
        }
    }
}

impl Plan<'_> {
    /// The fits that do not know what is held out, plug-ins, misfit and all, fold by fold; none where whole logs are
    /// held out, which the twin itself predicts.
    pub(in crate::calibrate) fn fits(
        &self,
        columns: &Columns,
        settings: &CalibrationSettings,
    ) -> Result<Vec<Fitted>> {
        let fitted =
            |fold: &Fold<'_>, sums: &Sums| estimate(sums, &fold.training, columns, settings);
        let folds = self.folds.par_iter();
        match self.split {
            Split::HeldoutLogs | Split::NotTested => Ok(Vec::new()),
            Split::LeaveOneLogOut | Split::LastThirty => folds
                .map(|fold| fitted(fold, &sums(&fold.training, settings, Purpose::Fit)))
                .collect(),
            Split::LeaveLogGroupsOut => {
                let sets: Vec<Vec<Part<'_>>> = self.folds.iter().map(Fold::left_out).collect();
                let sets = Sums::of_sets(&sets, runs(settings), Purpose::Fit);
                let folds = folds.enumerate();
                folds
                    .map(|(out, fold)| fitted(fold, &Sums::without(&sets, out)))
                    .collect()
            }
        }
    }
}

/// Scores the twin and its compact form on data that it has not seen; `fits` are those of [`Plan::fits`]. A fold whose fit has
/// fewer than ten independent rows on every joint predicts nothing worth a score, and is told instead.
pub(in crate::calibrate) fn validate(
    own: Own<'_>,
    library: &Library,
    plan: Plan<'_>,
    fits: Vec<Fitted>,
    progress: &Watch<'_>,
) -> Result<(Validation, Vec<Finding>)> {
    let twin = own.twin;
    let mut findings = Vec::new();
    let mut held_out = HeldOut::new(twin.robot.joint_names());
    let mut rows = GramSum::default();
    let mut fits = fits.into_iter();
    let logs = plan.folds.iter().map(|fold| fold.held_out.len()).sum();
    for (done, fold) in plan.folds.iter().enumerate() {
        progress(Stage::Validation(done, plan.folds.len()))?;
        let rivals = match fits.next() {
            None => own.rivals(library),
            Some(fitted) => refitted(twin, library, fitted)?,
        };
        let average = rivals.average;
        if !fold.training.is_empty() && !says_something(&average.noise) {
            findings.push(not_scored(&fold.held_out, &average.noise));
            continue;
        }
        let predictor = average.predictor(library)?;
        let rival = |posterior| {
            let twin = Twin {
                posterior,
                ..average.clone()
            };
            twin.predictor(library)
        };
        let compact = rival(rivals.compact)?;
        let friction = rivals.friction.map(rival).transpose()?;
        let predictors = Predictors {
            twin: &predictor,
            compact: Some(&compact),
            friction: friction.as_ref(),
        };
        for left_out in &fold.held_out {
            let own = scored((twin, library), predictors, (*left_out, logs))?;
            if plan.split == Split::HeldoutLogs {
                let memory: Vec<f64> = average.noise.iter().map(JointNoise::memory).collect();
                findings.extend(another_state::finding(
                    &left_out.rows.log,
                    &own.within(),
                    (&memory, &own.memory_within()),
                ));
            }
            held_out += own;
            left_out.add_to(&mut rows);
        }
    }
    let validation = Validation {
        moments: rows.finish().joints.iter().map(Moments::of).collect(),
        ..held_out.finish(plan.split)
    };
    Ok((validation, findings))
}

/// Scores on what is left out of one of so many logs.
fn scored(
    (twin, library): (&Twin, &Library),
    predictors: Predictors<'_>,
    (left_out, logs): (LeftOut<'_>, usize),
) -> Result<HeldOut> {
    let LeftOut { rows, motion, from } = left_out;
    let mut own = HeldOut::new(twin.robot.joint_names());
    own.score_kept(predictors, rows, from);
    own.score_raw(
        &twin.robot,
        library,
        &twin.pipeline,
        predictors.twin,
        motion,
        (from, logs),
    )?;
    Ok(own)
}

/// Whether some joint has as many independent rows as a result needs.
fn says_something(noise: &[JointNoise]) -> bool {
    noise
        .iter()
        .any(|joint| joint.n_eff >= LEAST_EFFECTIVE_ROWS)
}

/// A fold that is left out of the scores.
fn not_scored(held_out: &[LeftOut<'_>], noise: &[JointNoise]) -> Finding {
    let names = held_out.iter().map(|left_out| left_out.rows.log.as_str());
    let names: Vec<&str> = names.collect();
    let names = names.join(", ");
    let most = noise.iter().map(|joint| joint.n_eff).fold(0.0, f64::max);
    Finding::new(
        Severity::Warning,
        Code::HeldoutNotScored,
        names.clone(),
        format!(
            "what is left out of {names} is not predicted: the rows that remain for the fit count as {most:.1} independent \
             rows at most, fewer than {LEAST_EFFECTIVE_ROWS}; record longer, or give another log with --heldout"
        ),
        held_out.len() as u64,
    )
    .with([("independent_rows", most), ("needed", LEAST_EFFECTIVE_ROWS)])
}

/// `twin` with posterior and noise of another fit, and its rivals.
fn refitted(twin: &Twin, library: &Library, fitted: Fitted) -> Result<Rivals> {
    let out_of_band: Vec<f64> = twin.noise.iter().map(|noise| noise.out_of_band).collect();
    let spreads: Vec<_> = twin.noise.iter().map(|n| n.spread.clone()).collect();
    let noise = noise_of(&twin.robot, &fitted, &out_of_band, &spreads);
    let Fitted { fit, .. } = fitted;
    let inside = compact::members(&fit.problem, &fit.posterior);
    let compact = compact::refit(&fit.problem, &inside, &fit.posterior)?;
    let friction = friction_only::fitted(library, &fit);
    let average = Twin {
        posterior: fit.posterior,
        noise,
        ..twin.clone()
    };
    Ok(Rivals {
        average,
        compact,
        friction,
    })
}

fn whole<'a>((log, motion): (&'a Log, &'a Trajectory)) -> LeftOut<'a> {
    LeftOut {
        rows: &log.observations,
        motion,
        from: f64::NEG_INFINITY,
    }
}

/// All rows of the held-out logs; nothing where there are none.
pub(in crate::calibrate) fn plan_of_heldout<'a>(
    data: &'a Data,
    trajectories: &'a Trajectories,
) -> Plan<'a> {
    if data.heldout.is_empty() {
        return Plan {
            split: Split::NotTested,
            folds: Vec::new(),
        };
    }
    let held_out = data.heldout.iter().zip(&trajectories.heldout).map(whole);
    let fold = Fold {
        training: Vec::new(),
        held_out: held_out.collect(),
    };
    Plan {
        split: Split::HeldoutLogs,
        folds: vec![fold],
    }
}

/// Which rows train and which are held out.
pub(in crate::calibrate) fn plan<'a>(
    data: &'a Data,
    trajectories: &'a Trajectories,
    pipeline: &Pipeline,
) -> Plan<'a> {
    if !data.heldout.is_empty() {
        return plan_of_heldout(data, trajectories);
    }
    let count = data.fit.len();
    if count >= 3 {
        let (groups, split) = match count > MOST_ONE_BY_ONE {
            true => (LOG_GROUPS, Split::LeaveLogGroupsOut),
            false => (count, Split::LeaveOneLogOut),
        };
        let folds = (0..groups).map(|group| {
            let out = group * count / groups..(group + 1) * count / groups;
            let others = (0..count).filter(|log| !out.contains(log));
            let left_out = data.fit[out.clone()]
                .iter()
                .zip(&trajectories.fit[out.clone()]);
            Fold {
                training: others
                    .map(|log| data.fit[log].observations.whole())
                    .collect(),
                held_out: left_out.map(whole).collect(),
            }
        });
        return Plan {
            split,
            folds: folds.collect(),
        };
    }
    let gap = pipeline.kernel_length().max(LEAST_GAP);
    let mut fold = Fold {
        training: Vec::new(),
        held_out: Vec::new(),
    };
    for (log, motion) in data.fit.iter().zip(&trajectories.fit) {
        let (end, from) = last_thirty(&log.observations.time, gap);
        fold.training.push(Part {
            observations: &log.observations,
            rows: 0..end,
        });
        fold.held_out.push(LeftOut {
            rows: &log.observations,
            motion,
            from,
        });
    }
    Plan {
        split: Split::LastThirty,
        folds: vec![fold],
    }
}

/// End of the training rows, and the time from which on a log is held out: 30 % of its duration, after a gap.
fn last_thirty(time: &[f64], gap: f64) -> (usize, f64) {
    let (Some(start), Some(end)) = (time.first(), time.last()) else {
        return (0, f64::INFINITY);
    };
    let cut = start + TRAINING_SHARE * (end - start);
    (time.partition_point(|t| *t < cut - gap), cut)
}

#[cfg(test)]
mod tests {
    use super::last_thirty;

    #[test]
    fn the_last_thirty_percent_follow_a_gap() {
        let time: Vec<f64> = (0..=100).map(|i| i as f64 * 0.1).collect();
        let (end, from) = last_thirty(&time, 1.0);
        assert!((from - 7.0).abs() < 1e-9, "held-out starts at {from}");
        assert!(time[end - 1] < 6.0 && time[end] >= 6.0 - 1e-9);
    }
}
