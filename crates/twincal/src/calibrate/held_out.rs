//! Held-out truth: what to leave out, fit without it, predict it, score it.

use super::data::{Data, Log};
use super::{CalibrationSettings, Fitted, Stage, estimate, noise_of};
use crate::error::Result;
use crate::likelihood::Columns;
use crate::observations::Part;
use crate::rows::{RowSignal, visit_rows};
use crate::signal::Pipeline;
use crate::term::Library;
use crate::twin::{JointInput, Predictor, TorqueSignal, Twin};
use crate::validate::{CoverageKeeper, ScoreKeeper, Split, Trace, TraceRows, Validation};

/// Share of a log that trains when there are one or two logs.
const TRAINING_SHARE: f64 = 0.7;
/// Least gap between training and held-out rows of one log, s.
const LEAST_GAP: f64 = 1.0;
/// Raw samples scored per log at most; a longer log is thinned evenly.
const RAW_SAMPLES: usize = 20_000;

/// One fit and what it has to predict.
struct Fold<'a> {
    training: Vec<Part<'a>>,
    held_out: Vec<(&'a Log, Part<'a>)>,
}

/// Scores the twin on data that it has not seen.
///
/// Held-out logs are predicted by the twin itself. Otherwise every fold is fitted anew: plug-ins, tempering and all.
pub(super) fn validate(
    twin: &Twin,
    library: &Library,
    data: &Data,
    columns: &Columns,
    settings: &CalibrationSettings,
    progress: &dyn Fn(Stage),
) -> Result<Validation> {
    let (split, folds) = plan(data, &twin.pipeline);
    let names: Vec<String> = twin
        .robot
        .joint_names()
        .into_iter()
        .map(str::to_owned)
        .collect();
    let mut held_out = HeldOut::new(&names);
    for (done, fold) in folds.iter().enumerate() {
        progress(Stage::Validation(done, folds.len()));
        let predictor = match split {
            Split::HeldoutLogs => twin.predictor(library)?,
            Split::LeaveOneLogOut | Split::LastThirty => {
                let fitted: Fitted = estimate(&fold.training, columns, settings)?;
                let out_of_band: Vec<f64> =
                    twin.noise.iter().map(|noise| noise.out_of_band).collect();
                let noise = noise_of(&twin.robot, &fitted, &fold.training, &out_of_band);
                Twin {
                    posterior: fitted.fit.posterior,
                    noise,
                    ..twin.clone()
                }
                .predictor(library)?
            }
        };
        for (log, part) in &fold.held_out {
            held_out.score_filtered(&predictor, part, &names);
            held_out.score_raw(&predictor, twin, library, log, part)?;
        }
    }
    Ok(held_out.finish(split))
}

/// Scores so far.
struct HeldOut {
    filtered: ScoreKeeper,
    moving: ScoreKeeper,
    raw: ScoreKeeper,
    coverage: CoverageKeeper,
    traces: Vec<Trace>,
}

/// Which rows train and which are held out.
fn plan<'a>(data: &'a Data, pipeline: &Pipeline) -> (Split, Vec<Fold<'a>>) {
    if !data.heldout.is_empty() {
        let held_out = data
            .heldout
            .iter()
            .map(|log| (log, log.observations.whole()))
            .collect();
        return (
            Split::HeldoutLogs,
            vec![Fold {
                training: Vec::new(),
                held_out,
            }],
        );
    }
    if data.fit.len() >= 3 {
        let folds = (0..data.fit.len())
            .map(|out| Fold {
                training: (0..data.fit.len())
                    .filter(|&log| log != out)
                    .map(|log| data.fit[log].observations.whole())
                    .collect(),
                held_out: vec![(&data.fit[out], data.fit[out].observations.whole())],
            })
            .collect();
        return (Split::LeaveOneLogOut, folds);
    }
    let gap = pipeline.kernel_length().max(LEAST_GAP);
    let mut fold = Fold {
        training: Vec::new(),
        held_out: Vec::new(),
    };
    for log in &data.fit {
        let (first, after) = last_thirty(&log.observations.time, gap);
        fold.training.push(Part {
            observations: &log.observations,
            rows: 0..first,
        });
        fold.held_out.push((
            log,
            Part {
                observations: &log.observations,
                rows: after..log.observations.len(),
            },
        ));
    }
    (Split::LastThirty, vec![fold])
}

/// `(end of training, start of held-out)` rows: 30 % of the log's duration after a gap.
fn last_thirty(time: &[f64], gap: f64) -> (usize, usize) {
    let (Some(start), Some(end)) = (time.first(), time.last()) else {
        return (0, 0);
    };
    let cut = start + TRAINING_SHARE * (end - start);
    (
        time.partition_point(|t| *t < cut - gap),
        time.partition_point(|t| *t < cut),
    )
}

impl HeldOut {
    fn new(names: &[String]) -> Self {
        Self {
            filtered: ScoreKeeper::new(names),
            moving: ScoreKeeper::new(names),
            raw: ScoreKeeper::new(names),
            coverage: CoverageKeeper::default(),
            traces: Vec::new(),
        }
    }

    fn finish(self, split: Split) -> Validation {
        Validation {
            split,
            filtered: self.filtered.scores(),
            moving: self.moving.scores(),
            raw: self.raw.scores(),
            coverage_levels: self.coverage.levels(),
            traces: self.traces,
        }
    }

    /// Rows filtered like those of the regression.
    fn score_filtered(&mut self, predictor: &Predictor, part: &Part<'_>, names: &[String]) {
        let observations = part.observations;
        let rows = part.rows.clone();
        for (joint, own) in observations.joints.iter().enumerate() {
            let standstill = &own.standstill[rows.clone()];
            let input = JointInput {
                x: own.x.get(rows.start..).unwrap_or(&[]),
                stride: observations.len(),
                nominal: &own.nominal[rows.clone()],
                measured: &own.measured[rows.clone()],
                standstill,
                motion: [
                    &observations.q[joint][rows.clone()],
                    &observations.qd[joint][rows.clone()],
                    &observations.qdd[joint][rows.clone()],
                ],
            };
            let torque = predictor.torque(joint, &input, TorqueSignal::Filtered);
            self.filtered.push(joint, input.measured, &torque);
            self.moving
                .push_where(joint, input.measured, &torque, |row| !standstill[row]);
            self.coverage.push(&torque.pit);
            let mut trace = Trace::new(observations.log.clone(), names[joint].clone());
            trace.extend(&TraceRows {
                time: &observations.time[rows.clone()],
                q: input.motion[0],
                qd: input.motion[1],
                measured: input.measured,
                standstill,
                torque: &torque,
            });
            trace.thin();
            self.traces.push(trace);
        }
    }

    /// Torque as logged, over the time that the filtered rows span.
    fn score_raw(
        &mut self,
        predictor: &Predictor,
        twin: &Twin,
        library: &Library,
        log: &Log,
        part: &Part<'_>,
    ) -> Result<()> {
        let times = &part.observations.time[part.rows.clone()];
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
            return Ok(());
        };
        let samples: usize = log
            .trajectory
            .segments
            .iter()
            .map(|segment| segment.time.len())
            .sum();
        let step = samples.div_ceil(RAW_SAMPLES).max(1);
        let mut seen = 0;
        visit_rows(
            &twin.robot,
            library,
            &twin.pipeline,
            &log.trajectory,
            RowSignal::Raw,
            &mut |block| {
                let rows: Vec<usize> = (0..block.len)
                    .filter(|&row| {
                        (seen + row) % step == 0 && (first..=last).contains(&block.time[row])
                    })
                    .collect();
                seen += block.len;
                if rows.is_empty() {
                    return Ok(());
                }
                let pick =
                    |values: &[f64]| -> Vec<f64> { rows.iter().map(|&row| values[row]).collect() };
                for (joint, own) in block.joints.iter().enumerate() {
                    let motion =
                        |values: &[f64]| pick(&values[joint * block.len..(joint + 1) * block.len]);
                    let x: Vec<f64> = (0..own.columns.len())
                        .flat_map(|i| pick(&own.x[i * own.stride..]))
                        .collect();
                    let (q, qd, qdd) = (motion(block.q), motion(block.qd), motion(block.qdd));
                    let standstill: Vec<bool> =
                        rows.iter().map(|&row| own.standstill[row]).collect();
                    let (nominal, measured) = (pick(own.nominal), pick(own.measured));
                    let input = JointInput {
                        x: &x,
                        stride: rows.len(),
                        nominal: &nominal,
                        measured: &measured,
                        standstill: &standstill,
                        motion: [&q, &qd, &qdd],
                    };
                    self.raw.push(
                        joint,
                        &measured,
                        &predictor.torque(joint, &input, TorqueSignal::Raw),
                    );
                }
                Ok(())
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::last_thirty;

    #[test]
    fn the_last_thirty_percent_follow_a_gap() {
        let time: Vec<f64> = (0..=100).map(|i| i as f64 * 0.1).collect();
        let (end, start) = last_thirty(&time, 1.0);
        assert!(
            (time[start] - 7.0).abs() < 1e-9,
            "held-out starts at {}",
            time[start]
        );
        assert!(time[end - 1] < 6.0 && time[end] >= 6.0 - 1e-9);
    }
}
