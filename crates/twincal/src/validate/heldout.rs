//! Scores one held-out trajectory after another: filtered, moving and raw rows, coverage, guarantee, traces.

use super::conformal::stretch;
use super::memory::ErrorMemory;
use super::{
    ConformalKeeper, PitKeeper, Reliability, RivalKeeper, ScoreKeeper, Scores, Split, Trace,
    TraceRows, Validation,
};
use crate::error::{Finding, Result};
use crate::incidents::{Evidence, incident_findings, leave_out};
use crate::observations::Observations;
use crate::robot::Robot;
use crate::rows::{RowBlock, RowSignal, slices, spread_raw, visit_slices};
use crate::signal::{FewChapters, Log, Pipeline, Recording, Trajectory, median_step};
use crate::term::Library;
use crate::twin::{JointTorque, Predictor, TorqueSignal, Twin};
use rayon::prelude::*;
use std::ops::AddAssign;

/// Everything held-out, while it is being collected; keepers of several folds add up.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldOut {
    names: Vec<String>,
    filtered: ScoreKeeper,
    moving: ScoreKeeper,
    /// Moving rows that the training data speak of, and those beyond, see [`Validation::beyond`].
    within: ScoreKeeper,
    /// Per joint, of the rows of `within`.
    memory: Vec<ErrorMemory>,
    beyond: ScoreKeeper,
    /// Of each joint, rows beyond whose motion is new.
    new_motion: Vec<u64>,
    raw: ScoreKeeper,
    raw_moving: ScoreKeeper,
    /// Per joint.
    pit: Vec<PitKeeper>,
    conformal: ConformalKeeper,
    rivals: RivalKeeper,
    /// Per joint; empty where rows are not kept.
    traces: Vec<Trace>,
}

/// Who predicts.
#[derive(Debug, Clone, Copy)]
pub struct Predictors<'a> {
    /// The twin.
    pub twin: &'a Predictor,
    /// A rival on the same rows: the compact twin.
    pub compact: Option<&'a Predictor>,
    /// Another: the nominal model with friction and offsets alone.
    pub friction: Option<&'a Predictor>,
}

impl<'a> From<&'a Predictor> for Predictors<'a> {
    /// The twin alone.
    fn from(twin: &'a Predictor) -> Self {
        Self {
            twin,
            compact: None,
            friction: None,
        }
    }
}

/// What one trajectory collects while its blocks come in.
struct Collected {
    /// Rows so far.
    rows: usize,
    traces: Vec<Trace>,
    /// Per joint and row: by how much the interval must be stretched.
    stretches: Vec<Vec<f64>>,
}

impl Collected {
    /// Adds the rows of one joint of a block.
    fn extend(&mut self, joint: usize, block: &RowBlock<'_>, torque: &JointTorque) {
        let rows = &block.joints[joint];
        let own = joint * block.len..(joint + 1) * block.len;
        let (measured, standstill) = (rows.measured, rows.standstill);
        self.stretches[joint].extend(measured.iter().enumerate().map(|(row, &y)| {
            stretch(torque.low[row], torque.calibrated[row], torque.high[row], y)
        }));
        self.traces[joint].extend(
            self.rows,
            &TraceRows {
                time: block.time,
                q: &block.q[own.clone()],
                qd: &block.qd[own],
                measured,
                standstill,
                torque,
            },
        );
    }
}

impl HeldOut {
    /// Nothing seen yet, for joints of these names.
    pub fn new(joints: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let names: Vec<String> = joints.into_iter().map(Into::into).collect();
        let keeper = ScoreKeeper::new(names.clone());
        Self {
            pit: vec![PitKeeper::default(); names.len()],
            new_motion: vec![0; names.len()],
            memory: vec![ErrorMemory::default(); names.len()],
            names,
            filtered: keeper.clone(),
            moving: keeper.clone(),
            within: keeper.clone(),
            beyond: keeper.clone(),
            raw: keeper.clone(),
            raw_moving: keeper,
            conformal: ConformalKeeper::default(),
            rivals: RivalKeeper::default(),
            traces: Vec::new(),
        }
    }

    /// Predicts the rows of a log that was not used to fit the twin, and scores them: filtered rows all, raw rows of long logs in evenly
    /// spread pieces, see [`spread_raw`]. `seen` gets the motion of the log, or of chapter after chapter; contacts and stops are left out of a log
    /// that is no longer than a chapter, as the fit leaves them out.
    ///
    /// # Errors
    /// Those of `seen`, [`crate::Error::Log`] for a log without torque, those of [`Twin::align`] and [`visit_slices`], and of chapters that cannot be read.
    pub fn score(
        &mut self,
        (twin, library, predictor): (&Twin, &Library, &Predictor),
        log: &Log<'_>,
        findings: &mut Vec<Finding>,
        seen: &mut (dyn FnMut(&Trajectory) -> Result<()> + Send),
    ) -> Result<()> {
        let mut collected = self.collect(log.name(), rows_about(log, &twin.pipeline)?);
        let names = twin.robot.joint_names();
        let whole = matches!(log, Log::Whole(_));
        let start = match log {
            Log::Whole(_) => None,
            Log::Long(long) => long.start(),
        };
        let mut part = |recording: &Recording, said: &mut Vec<Finding>| -> Result<Trajectory> {
            recording.require_torque(&names)?;
            let (mut trajectory, more) = twin.align_part(recording, start)?;
            said.extend(more);
            if whole {
                said.extend(without_incidents(twin, &mut trajectory));
            }
            self.push_part((twin, library, predictor), &trajectory, &mut collected)?;
            seen(&trajectory)?;
            Ok(trajectory)
        };
        let trajectory = match log {
            Log::Whole(recording) => part(recording, findings)?,
            Log::Long(long) => {
                findings.push(long.say(true));
                let mut few = FewChapters::new(long.chapters());
                long.visit(findings, |number, chapter, said| {
                    few.take(number, part(chapter, said)?);
                    Ok(())
                })?;
                few.into_trajectory()
                    .ok_or_else(|| long.without_chapters())?
            }
        };
        // One trajectory, however many chapters it has.
        self.add(collected);
        let (robot, pipeline) = (&twin.robot, &twin.pipeline);
        self.score_raw(
            robot,
            library,
            pipeline,
            predictor,
            &trajectory,
            (f64::NEG_INFINITY, 1),
        )
    }

    /// The filtered rows of a log or of one of its chapters.
    fn push_part(
        &mut self,
        (twin, library, predictor): (&Twin, &Library, &Predictor),
        trajectory: &Trajectory,
        collected: &mut Collected,
    ) -> Result<()> {
        let signal = RowSignal::Filtered;
        let slices = slices(
            &twin.pipeline,
            trajectory,
            signal,
            f64::NEG_INFINITY,
            usize::MAX,
        );
        visit_slices(
            &twin.robot,
            library,
            &twin.pipeline,
            trajectory,
            signal,
            &slices,
            &mut |block| {
                self.push_filtered(block, predictor.into(), collected);
                Ok(())
            },
        )
    }

    /// [`HeldOut::score`] of filtered rows that are there already: no sample is evaluated again.
    pub(crate) fn score_kept(
        &mut self,
        predictors: Predictors<'_>,
        observations: &Observations,
        from: f64,
    ) {
        let rows = observations.time.iter().filter(|t| **t >= from).count();
        let mut collected = self.collect(&observations.log, rows);
        observations.visit_since(from, &mut |block| {
            self.push_filtered(block, predictors, &mut collected);
        });
        self.add(collected);
    }

    /// The raw rows of [`HeldOut::score`] alone, of the log whose filtered rows were scored last: one of so many logs, at or after a time, s.
    ///
    /// # Errors
    /// Those of [`visit_slices`].
    pub(crate) fn score_raw(
        &mut self,
        robot: &Robot,
        library: &Library,
        pipeline: &Pipeline,
        twin: &Predictor,
        trajectory: &Trajectory,
        (from, logs): (f64, usize),
    ) -> Result<()> {
        if pipeline.cutoff_hz > 0.0 {
            self.add_logged(trajectory);
        }
        let keepers: Vec<[ScoreKeeper; 2]> = spread_raw(pipeline, trajectory, from, logs)
            .into_par_iter()
            .map(|slice| {
                let mut all = ScoreKeeper::new(self.names.clone());
                let mut moving = all.clone();
                visit_slices(
                    robot,
                    library,
                    pipeline,
                    trajectory,
                    RowSignal::Raw,
                    &[slice],
                    &mut |block| {
                        let torques = twin.block(block, TorqueSignal::Raw);
                        for (joint, torque) in torques.iter().enumerate() {
                            let rows = &block.joints[joint];
                            let (measured, still) = (rows.measured, rows.standstill);
                            all.push(joint, measured, torque);
                            moving.push_where(joint, measured, torque, |row| !still[row]);
                        }
                        Ok(())
                    },
                )?;
                Ok([all, moving])
            })
            .collect::<Result<_>>()?;
        for [all, moving] in &keepers {
            self.raw += all;
            self.raw_moving += moving;
        }
        Ok(())
    }

    /// For about so many rows of a log.
    fn collect(&self, log: &str, rows: usize) -> Collected {
        let named = |joint: &String| Trace::new(log, joint, rows);
        Collected {
            rows: 0,
            traces: self.names.iter().map(named).collect(),
            stretches: vec![Vec::new(); self.names.len()],
        }
    }

    fn add(&mut self, collected: Collected) {
        self.conformal.push(collected.stretches);
        self.traces.extend(collected.traces);
    }

    /// Torque as it was logged, beside the rows of the traces that were added last.
    fn add_logged(&mut self, trajectory: &Trajectory) {
        let first = self.traces.len().saturating_sub(self.names.len());
        for (joint, trace) in self.traces[first..].iter_mut().enumerate() {
            let times = trace.time.iter();
            trace.logged = times
                .map(|time| trajectory.logged_torque(joint, *time))
                .collect();
        }
    }

    fn push_filtered(
        &mut self,
        block: &RowBlock<'_>,
        predictors: Predictors<'_>,
        collected: &mut Collected,
    ) {
        let torques = predictors.twin.block(block, TorqueSignal::Filtered);
        let rival = |rival: &Predictor| rival.block(block, TorqueSignal::Filtered);
        let compact: Option<Vec<JointTorque>> = predictors.compact.map(rival);
        let friction: Option<Vec<JointTorque>> = predictors.friction.map(rival);
        for (joint, torque) in torques.iter().enumerate() {
            let rows = &block.joints[joint];
            let (measured, standstill) = (rows.measured, rows.standstill);
            self.filtered.push(joint, measured, torque);
            self.moving
                .push_where(joint, measured, torque, |row| !standstill[row]);
            if let Some(friction) = &friction {
                let own = &friction[joint];
                self.filtered.push_friction(joint, measured, own, |_| true);
                self.moving
                    .push_friction(joint, measured, own, |row| !standstill[row]);
            }
            // At standstill friction is whatever it takes: intervals are widened for it and say nothing of the others' shape.
            let moves = torque
                .pit
                .iter()
                .zip(standstill)
                .filter(|(_, still)| !**still);
            let moves: Vec<f64> = moves.map(|(pit, _)| *pit).collect();
            self.pit[joint].push(&moves, predictors.twin.memory(joint));
            let outside = &torque.extrapolating;
            let within = |row: usize| !standstill[row] && !outside[row];
            self.within.push_where(joint, measured, torque, within);
            let errors = measured.iter().zip(&torque.calibrated);
            let errors: Vec<f64> = errors
                .map(|(measured, calibrated)| measured - calibrated)
                .collect();
            self.memory[joint].push(&errors, within);
            self.beyond.push_where(joint, measured, torque, |row| {
                !standstill[row] && outside[row]
            });
            let moves = torque.new_motion.iter().zip(standstill);
            let new = moves.filter(|(new, still)| **new && !**still);
            self.new_motion[joint] += new.count() as u64;
            if let Some(compact) = &compact {
                self.rivals
                    .push(measured, torque, &compact[joint], |row| !standstill[row]);
            }
            collected.extend(joint, block, torque);
        }
        collected.rows += block.len;
    }

    /// Scores of the moving rows within the training motion, see [`Validation::within`].
    pub(crate) fn within(&self) -> Scores {
        self.within.scores()
    }

    /// Of each joint, how many of those rows count as one, by their own errors.
    pub(crate) fn memory_within(&self) -> Vec<f64> {
        self.memory.iter().map(ErrorMemory::rows).collect()
    }

    /// The scores of everything seen.
    #[must_use]
    pub fn finish(self, split: Split) -> Validation {
        let mut pooled = PitKeeper::default();
        self.pit.iter().for_each(|joint| pooled += joint);
        let reliability = |(joint, keeper): (&String, &PitKeeper)| Reliability {
            joint: joint.clone(),
            rows: keeper.rows(),
            coverage_levels: keeper.levels(),
            pit: keeper.pit(),
        };
        Validation {
            conformal: self.conformal.finish(&split, &self.names),
            split,
            filtered: self.filtered.scores(),
            moving: self.moving.scores(),
            within: self.within.scores(),
            beyond: self.beyond.scores(),
            new_motion: self.new_motion,
            raw: self.raw.scores(),
            raw_moving: self.raw_moving.scores(),
            coverage_levels: pooled.levels(),
            pit: pooled.pit(),
            reliability: self.names.iter().zip(&self.pit).map(reliability).collect(),
            compact: self.rivals.losses(),
            moments: Vec::new(),
            traces: self.traces,
        }
    }
}

/// Leaves contacts and protective stops out of a log's motion, and says so.
fn without_incidents(twin: &Twin, trajectory: &mut Trajectory) -> Vec<Finding> {
    let (robot, pipeline) = (&twin.robot, &twin.pipeline);
    let mut evidence = Evidence::default();
    evidence.take(robot, pipeline, trajectory);
    let incidents = evidence.incidents(robot);
    leave_out(pipeline, trajectory, &incidents);
    incident_findings(&trajectory.name, &incidents)
}

/// Filtered rows of a log, and a few more: those at the ends of its stretches.
fn rows_about(log: &Log<'_>, pipeline: &Pipeline) -> Result<usize> {
    let interval = log.any_recording(|recording| Ok(median_step(&recording.time)))?;
    let step = interval.map_or(1, |interval| pipeline.step(interval));
    Ok(log.samples() as usize / step)
}

impl AddAssign for HeldOut {
    /// Puts another fold behind this one.
    ///
    /// # Panics
    /// If the joints differ.
    fn add_assign(&mut self, other: Self) {
        self.filtered += &other.filtered;
        self.moving += &other.moving;
        self.within += &other.within;
        for (own, more) in self.memory.iter_mut().zip(other.memory) {
            *own += more;
        }
        self.beyond += &other.beyond;
        for (own, more) in self.new_motion.iter_mut().zip(&other.new_motion) {
            *own += more;
        }
        self.raw += &other.raw;
        self.raw_moving += &other.raw_moving;
        for (own, more) in self.pit.iter_mut().zip(&other.pit) {
            *own += more;
        }
        self.conformal.join(other.conformal);
        self.rivals += other.rivals;
        self.traces.extend(other.traces);
    }
}
