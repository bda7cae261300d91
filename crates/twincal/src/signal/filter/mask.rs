//! Takes samples with saturated torque out of the fit, with those whose filter sees them, and says so (case 26).

use super::pipeline::Pipeline;
use super::trajectory::Trajectory;
use crate::error::{Code, Finding, Severity};
use crate::signal::clean::saturation::flat_runs;
use crate::signal::log::joints::JointFacts;
use crate::signal::log::recording::{Channels, Recording};
use rayon::prelude::*;
use std::ops::Range;

/// Time on either side of a flat run that is left out with it, in periods of the cut-off: main lobe and first side lobe
/// of the filter.
const MARGIN: f64 = 1.0;

/// Where torque is flat, by joint.
#[derive(Debug, Clone)]
pub(crate) struct Saturated {
    joints: Vec<Flat>,
}

/// Flat runs of one joint.
#[derive(Debug, Clone)]
struct Flat {
    joint: usize,
    name: String,
    /// First and last stamp of each run, s.
    spans: Vec<[f64; 2]>,
    samples: u64,
    /// Largest |τ| among them, N·m or N.
    level: f64,
}

impl Saturated {
    /// Flat runs of every joint of a log.
    pub(crate) fn find(joints: &[JointFacts], log: &Recording, pipeline: &Pipeline) -> Self {
        let one = |(joint, (facts, channels)): (usize, (&JointFacts, &Channels))| {
            let tau = channels.tau.as_ref()?;
            let (time, q) = (&log.time, &channels.q);
            let runs = flat_runs(tau, facts.effort, |run| {
                let seconds = time[run.end - 1] - time[run.start];
                let (low, high) = q[run.clone()]
                    .iter()
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| {
                        (l.min(*q), h.max(*q))
                    });
                high - low > pipeline.standstill_velocity[joint] * seconds
            });
            let span = |run: &Range<usize>| [time[run.start], time[run.end - 1]];
            let level = |level: f64, run: &Range<usize>| level.max(tau[run.start].abs());
            (!runs.is_empty()).then(|| Flat {
                joint,
                name: facts.name.clone(),
                spans: runs.iter().map(span).collect(),
                samples: runs.iter().map(|run| run.len() as u64).sum(),
                level: runs.iter().fold(0.0, level),
            })
        };
        let joints: Vec<Option<Flat>> = joints
            .par_iter()
            .zip(&log.joints)
            .enumerate()
            .map(one)
            .collect();
        Self {
            joints: joints.into_iter().flatten().collect(),
        }
    }

    /// Marks the samples of a trajectory; one finding per joint.
    pub(crate) fn mask(
        &self,
        log: &Recording,
        pipeline: &Pipeline,
        trajectory: &mut Trajectory,
        findings: &mut Vec<Finding>,
    ) {
        let margin = if pipeline.is_off() {
            0.0
        } else {
            MARGIN / pipeline.cutoff_hz
        };
        for flat in &self.joints {
            let (mut masked, mut all) = (0_usize, 0_usize);
            for segment in &mut trajectory.segments {
                let len = segment.time.len();
                let mask = &mut segment.standstill[flat.joint * len..(flat.joint + 1) * len];
                for [first, last] in &flat.spans {
                    let from = segment.time.partition_point(|t| *t < first - margin);
                    let to = segment.time.partition_point(|t| *t <= last + margin);
                    mask[from..to.max(from)].fill(true);
                }
                masked += mask.iter().filter(|m| **m).count();
                all += len;
            }
            findings.push(Finding::new(
                Severity::Warning,
                Code::SaturatedTorque,
                &log.name,
                format!(
                    "joint `{}`: torque is flat at its limit of {:.4} in {} samples ({} times); the fit and the scores of \
                     moving rows leave them out with all that the filter mixes with them and with standstill ({:.1} % of the \
                     log); the scores over all rows contain them",
                    flat.name,
                    flat.level,
                    flat.samples,
                    flat.spans.len(),
                    100.0 * masked as f64 / all.max(1) as f64
                ),
                flat.samples,
            )
            .of_joint(&flat.name)
            .with([
                ("level", flat.level), ("times", flat.spans.len() as f64),
                ("share_left_out", masked as f64 / all.max(1) as f64),
            ]));
        }
    }
}
