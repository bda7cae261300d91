//! Joints that are at rest in all training logs.

use crate::error::{Code, Error, Finding, Result, Severity};
use crate::signal::log::joints::JointFacts;
use crate::words::listed;

/// v_s where the pipeline is on and nothing is said, rad/s or m/s.
pub(super) const COULOMB_VELOCITY: f64 = 0.02;

/// `limits`: how fast a joint must be to count as moving, rad/s or m/s; empty with the filter off.
pub(super) fn unexcited(
    joints: &[JointFacts],
    still: &[bool],
    limits: &[f64],
) -> Result<Vec<Finding>> {
    let names = |wanted: bool| -> Vec<String> {
        joints
            .iter()
            .enumerate()
            .filter(|(joint, _)| still[*joint] == wanted)
            .map(|(joint, facts)| match limits.get(joint) {
                Some(limit) => format!("`{}` below {limit:.3} rad/s (m/s)", facts.name),
                None => format!("`{}`", facts.name),
            })
            .collect()
    };
    if names(false).is_empty() {
        return Err(Error::Refused {
            problem: format!(
                "no excitation: every joint is at rest in all training logs ({})",
                listed(names(true), ", ")
            ),
            remedy: if limits.iter().any(|limit| *limit > COULOMB_VELOCITY) {
                "a coarse encoder cannot distinguish slower motion from rest: record faster motion, log the velocity, or \
                 lower [signal] cutoff_hz"
                    .into()
            } else {
                "record logs in which the joints move".into()
            },
        });
    }
    Ok(joints
        .iter()
        .zip(still)
        .filter(|(_, still)| **still)
        .map(|(joint, _)| {
            Finding::new(
                Severity::Warning,
                Code::JointNotExcited,
                &joint.name,
                format!(
                    "joint `{}` is at rest in all training logs: its own effects cannot be seen",
                    joint.name
                ),
                0,
            )
        })
        .collect())
}
