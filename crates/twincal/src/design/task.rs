//! What a motion is designed for and within.

use super::clearance::{Approach, Clearance, path_of};
use super::limits::JointLimits;
use super::questions::Questions;
use super::recorded::Recorded;
use super::spline::Spline;
use super::torque::TorqueLimits;
use crate::excitation::States;
use crate::robot::Robot;
use crate::term::Library;
use std::ops::Range;

/// What is asked for.
#[derive(Clone, Copy)]
#[allow(missing_debug_implementations, reason = "the limits are trait objects")]
pub struct Task<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Candidates: their columns are what the motion is to show where nothing is asked, and what its condition number is of.
    pub library: &'a Library,
    /// `None`: the motion is to show the candidates.
    pub questions: Option<&'a Questions<'a>>,
    /// Motion that is recorded already, and that a fit will have beside this one.
    pub recorded: Option<&'a Recorded>,
    /// What every joint stays within.
    pub limits: &'a [JointLimits],
    /// `None`: torque is not looked at.
    pub torque: Option<&'a dyn TorqueLimits>,
    /// `None`: collisions are not looked at.
    pub clearance: Option<&'a dyn Clearance>,
}

impl Task<'_> {
    /// The joint that has too little torque in some state, in words.
    pub(super) fn too_much_torque(&self, states: &States) -> Option<String> {
        let (joint, torque, limit) = self.torque?.exceeded(states)?;
        Some(format!(
            "joint `{joint}` would need {} of torque, its limit is {}",
            crate::words::significant(torque, 3),
            crate::words::significant(limit, 3)
        ))
    }

    /// What comes too close in some spans.
    pub(super) fn too_close(
        &self,
        splines: &[Spline],
        (spans, joint): (Range<usize>, Option<usize>),
        per_span: usize,
    ) -> Option<Approach> {
        let clearance = self.clearance?;
        clearance.breach(&path_of(splines, spans, per_span), joint)
    }
}
