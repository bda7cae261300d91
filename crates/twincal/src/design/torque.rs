//! Torque that a motion needs against the limits of the joints: of the model file, or with the effects that were found.

use super::limits::JointLimits;
use super::load::Loaded;
use crate::error::Result;
use crate::excitation::States;
use crate::robot::Robot;
use crate::term::{Family, Library};
use crate::twin::Twin;

/// Share of a torque limit that is used: what stands between samples may be a little more.
pub(super) const TORQUE_SHARE: f64 = 0.97;
/// Half of a central 95 % interval of a normal distribution, in standard deviations.
const HALF_OF_95: f64 = 1.96;

/// Whether a robot can produce the torque that states ask for.
pub trait TorqueLimits: Sync {
    /// |τ| of every joint in every state as a share of what may be used of its limit, `[joint * len + state]`.
    fn shares(&self, states: &States) -> Vec<f64>;

    /// Name of the joint that has too little torque in some state, with that torque and its limit.
    fn exceeded(&self, states: &States) -> Option<(String, f64, f64)>;
}

/// Torque of the model file against the limits of the joints.
#[derive(Debug)]
pub struct NominalTorque<'a> {
    robot: &'a Robot,
    limits: &'a [JointLimits],
}

impl<'a> NominalTorque<'a> {
    /// Of a robot with these limits.
    #[must_use]
    pub fn new(robot: &'a Robot, limits: &'a [JointLimits]) -> Self {
        Self { robot, limits }
    }

    fn torque(&self, states: &States) -> Vec<f64> {
        let mut torque = vec![0.0; self.robot.dof() * states.len];
        crate::robot::nominal_torque(self.robot, states.motion(), &mut torque);
        torque
    }
}

impl TorqueLimits for NominalTorque<'_> {
    fn exceeded(&self, states: &States) -> Option<(String, f64, f64)> {
        exceeded(self.limits, &self.torque(states), states.len)
    }

    fn shares(&self, states: &States) -> Vec<f64> {
        shares(self.limits, self.torque(states), states.len)
    }
}

/// Torque of the model file with the posterior mean of all effects, and a payload at the far end of its interval.
#[derive(Debug)]
pub struct FoundTorque<'a> {
    robot: &'a Robot,
    library: Library,
    limits: &'a [JointLimits],
    beta: Vec<f64>,
}

impl<'a> FoundTorque<'a> {
    /// Of a twin's robot with these limits, and with what it is known to carry.
    ///
    /// # Errors
    /// Those of [`Twin::library`].
    pub fn new(
        twin: &'a Twin,
        loaded: Option<&'a Loaded>,
        limits: &'a [JointLimits],
    ) -> Result<Self> {
        let (robot, library) = match loaded {
            Some(own) => (&own.robot, own.library.clone()),
            None => (&twin.robot, twin.library()?),
        };
        let posterior = &twin.posterior;
        let beta = (library.columns().iter().enumerate()).map(|(k, &term)| {
            let mean = posterior.mean[k];
            match library.terms()[term].family {
                Family::Payload | Family::PayloadTensor => {
                    mean + HALF_OF_95 * posterior.sd[k].copysign(mean)
                }
                _ => mean,
            }
        });
        Ok(Self {
            beta: beta.collect(),
            robot,
            library,
            limits,
        })
    }
}

impl FoundTorque<'_> {
    fn torque(&self, states: &States) -> Vec<f64> {
        let motion = states.motion();
        (self.library).torque_with(self.robot, motion, true, &self.beta)
    }
}

impl TorqueLimits for FoundTorque<'_> {
    fn exceeded(&self, states: &States) -> Option<(String, f64, f64)> {
        exceeded(self.limits, &self.torque(states), states.len)
    }

    fn shares(&self, states: &States) -> Vec<f64> {
        shares(self.limits, self.torque(states), states.len)
    }
}

/// |τ| of every joint as a share of what is used of its limit, 0 where there is none.
fn shares(limits: &[JointLimits], mut torque: Vec<f64>, len: usize) -> Vec<f64> {
    for (limits, torque) in limits.iter().zip(torque.chunks_exact_mut(len)) {
        let most = limits
            .torque
            .map_or(f64::INFINITY, |limit| TORQUE_SHARE * limit);
        torque.iter_mut().for_each(|x| *x = x.abs() / most);
    }
    torque
}

/// The first joint whose largest torque is beyond its limit, with both.
fn exceeded(limits: &[JointLimits], torque: &[f64], len: usize) -> Option<(String, f64, f64)> {
    let own = limits.iter().zip(torque.chunks_exact(len));
    for (limits, torque) in own {
        let Some(limit) = limits.torque else { continue };
        let largest = torque.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        if largest > TORQUE_SHARE * limit {
            return Some((limits.joint.clone(), largest, limit));
        }
    }
    None
}
