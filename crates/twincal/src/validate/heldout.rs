//! Scores one held-out trajectory after another: filtered, moving and raw rows, coverage, traces.

use super::{CoverageKeeper, ScoreKeeper, Split, Trace, TraceRows, Validation};
use crate::error::Result;
use crate::robot::Robot;
use crate::rows::{RowBlock, RowSignal, slices, visit_slices};
use crate::signal::{Pipeline, Trajectory};
use crate::term::Library;
use crate::twin::{JointTorque, Predictor, TorqueSignal};
use rayon::prelude::*;
use std::ops::AddAssign;

/// Raw rows that one thread takes at a time.
const SLICE: usize = 1 << 14;

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
    /// Those of [`visit_slices`].
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
        let filtered = slices(pipeline, trajectory, RowSignal::Filtered, from, usize::MAX);
        visit_slices(
            robot,
            library,
            pipeline,
            trajectory,
            RowSignal::Filtered,
            &filtered,
            &mut |block| {
                let torques = predictor.block(block, TorqueSignal::Filtered);
                self.push_filtered(block, &torques, &mut traces);
                Ok(())
            },
        )?;
        for mut trace in traces {
            trace.thin();
            self.traces.push(trace);
        }
        let raw = slices(pipeline, trajectory, RowSignal::Raw, from, SLICE);
        let keepers: Vec<ScoreKeeper> = raw
            .into_par_iter()
            .map(|slice| {
                let mut keeper = ScoreKeeper::new(self.names.clone());
                visit_slices(
                    robot,
                    library,
                    pipeline,
                    trajectory,
                    RowSignal::Raw,
                    &[slice],
                    &mut |block| {
                        let torques = predictor.block(block, TorqueSignal::Raw);
                        for (joint, torque) in torques.iter().enumerate() {
                            keeper.push(joint, block.joints[joint].measured, torque);
                        }
                        Ok(())
                    },
                )?;
                Ok(keeper)
            })
            .collect::<Result<_>>()?;
        keepers.iter().for_each(|keeper| self.raw += keeper);
        Ok(())
    }

    fn push_filtered(
        &mut self,
        block: &RowBlock<'_>,
        torques: &[JointTorque],
        traces: &mut [Trace],
    ) {
        for (joint, torque) in torques.iter().enumerate() {
            let rows = &block.joints[joint];
            let own = joint * block.len..(joint + 1) * block.len;
            let (measured, standstill) = (rows.measured, rows.standstill);
            self.filtered.push(joint, measured, torque);
            self.moving
                .push_where(joint, measured, torque, |row| !standstill[row]);
            self.coverage.push(&torque.pit);
            traces[joint].extend(&TraceRows {
                time: block.time,
                q: &block.q[own.clone()],
                qd: &block.qd[own],
                measured,
                standstill,
                torque,
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
