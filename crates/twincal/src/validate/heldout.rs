//! Scores one held-out trajectory after another: filtered, moving and raw rows, coverage, traces.

use super::{CoverageKeeper, ScoreKeeper, Split, Trace, TraceRows, Validation};
use crate::error::Result;
use crate::robot::Robot;
use crate::rows::{RowBlock, RowSignal, visit_rows};
use crate::signal::{Pipeline, Trajectory};
use crate::term::Library;
use crate::twin::{JointTorque, Predictor, TorqueSignal};
use std::ops::AddAssign;

/// Everything held-out, while it is being collected; keepers of several folds add up.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldOut {
    names: Vec<String>,
    filtered: ScoreKeeper,
    moving: ScoreKeeper,
    raw: ScoreKeeper,
    coverage: CoverageKeeper,
    traces: Vec<Trace>,
}

impl HeldOut {
    /// Nothing seen yet, for joints of these names.
    pub fn new(joints: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let names: Vec<String> = joints.into_iter().map(Into::into).collect();
        let keeper = ScoreKeeper::new(names.clone());
        Self {
            names,
            filtered: keeper.clone(),
            moving: keeper.clone(),
            raw: keeper,
            coverage: CoverageKeeper::default(),
            traces: Vec::new(),
        }
    }

    /// Predicts the rows of a trajectory that were not used to fit `predictor`, those at or after the time `from` in s
    /// (−∞: all of them), and scores them.
    ///
    /// # Errors
    /// Those of [`visit_rows`].
    pub fn score(
        &mut self,
        robot: &Robot,
        library: &Library,
        pipeline: &Pipeline,
        predictor: &Predictor,
        trajectory: &Trajectory,
        from: f64,
    ) -> Result<()> {
        let mut traces: Vec<Trace> = self
            .names
            .iter()
            .map(|joint| Trace::new(&trajectory.name, joint))
            .collect();
        visit_rows(
            robot,
            library,
            pipeline,
            trajectory,
            RowSignal::Filtered,
            &mut |block| {
                let skip = block.time.partition_point(|time| *time < from);
                if skip < block.len {
                    let torques = predictor.block(block, TorqueSignal::Filtered);
                    self.push_filtered(block, skip, &torques, &mut traces);
                }
                Ok(())
            },
        )?;
        for mut trace in traces {
            trace.thin();
            self.traces.push(trace);
        }
        visit_rows(
            robot,
            library,
            pipeline,
            trajectory,
            RowSignal::Raw,
            &mut |block| {
                let skip = block.time.partition_point(|time| *time < from);
                if skip < block.len {
                    let torques = predictor.block(block, TorqueSignal::Raw);
                    for (joint, torque) in torques.iter().enumerate() {
                        let measured = &block.joints[joint].measured[skip..];
                        self.raw.push(joint, measured, &torque.after(skip));
                    }
                }
                Ok(())
            },
        )
    }

    fn push_filtered(
        &mut self,
        block: &RowBlock<'_>,
        skip: usize,
        torques: &[JointTorque],
        traces: &mut [Trace],
    ) {
        for (joint, torque) in torques.iter().enumerate() {
            let rows = &block.joints[joint];
            let own = joint * block.len + skip..(joint + 1) * block.len;
            let torque = torque.after(skip);
            let (measured, standstill) = (&rows.measured[skip..], &rows.standstill[skip..]);
            self.filtered.push(joint, measured, &torque);
            self.moving
                .push_where(joint, measured, &torque, |row| !standstill[row]);
            self.coverage.push(&torque.pit);
            traces[joint].extend(&TraceRows {
                time: &block.time[skip..],
                q: &block.q[own.clone()],
                qd: &block.qd[own],
                measured,
                standstill,
                torque: &torque,
            });
        }
    }

    /// The scores of everything seen.
    #[must_use]
    pub fn finish(self, split: Split) -> Validation {
        Validation {
            split,
            filtered: self.filtered.scores(),
            moving: self.moving.scores(),
            raw: self.raw.scores(),
            coverage_levels: self.coverage.levels(),
            traces: self.traces,
        }
    }
}

impl AddAssign for HeldOut {
    /// Puts another fold behind this one.
    ///
    /// # Panics
    /// If the joints differ.
    fn add_assign(&mut self, other: Self) {
        self.filtered += &other.filtered;
        self.moving += &other.moving;
        self.raw += &other.raw;
        self.coverage += &other.coverage;
        self.traces.extend(other.traces);
    }
}
