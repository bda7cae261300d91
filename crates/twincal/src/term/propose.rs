//! Which candidates a robot gets: every family that is switched on, in the order of `terms[]`.

use super::candidate::{Joint, Proposal};
use super::expression::Graph;
use super::inertial::inertial;
use super::motions::{channels, random_motions};
use super::{
    Family, LibrarySettings, asymmetry, base_tilt, coulomb, coupled_friction, coupled_inertia,
    encoder_zero, gain, generic, hysteresis, load_friction, motor_inertia, offset, potential,
    quadratic_friction, ripple, spring, stribeck, user, viscous, warm_up,
};
use crate::error::{Code, Error, Finding, Result, Severity};
use crate::robot::{Motion, Robot, did_you_mean, nominal_torque};

/// Most columns a library may have.
const TERM_LIMIT: usize = 1000;
/// Moving joints at most: the time of a fit grows with their cube. A fit of 44 took 228 s of CPU time on a busy machine (Talos, 10 s at 500 Hz).
const MOST_JOINTS: usize = 64;
/// Joints up to which the generic family is proposed unasked.
const GENERIC_JOINTS: usize = 3;
/// Share of the largest torque that a joint holds against gravity, for joints that hold less: what cables and seals amount to.
const LEAST_HELD: f64 = 0.05;

/// Everything about a robot that the families ask for; `robot` is absent where a library is made for joints alone.
pub(super) struct About<'a> {
    pub(super) joints: &'a [Joint],
    /// All axes are parallel.
    pub(super) parallel: bool,
    pub(super) robot: Option<&'a Robot>,
}

impl<'a> About<'a> {
    /// A robot and its moving joints.
    pub(super) fn robot(robot: &'a Robot, joints: &'a [Joint]) -> Self {
        Self {
            joints,
            parallel: robot.is_planar(),
            robot: Some(robot),
        }
    }
}

/// All proposals in the order of `terms[]`.
///
/// # Errors
/// [`Error::Term`] and [`Error::Setting`].
pub(super) fn proposals(
    graph: &mut Graph,
    about: &About<'_>,
    settings: &LibrarySettings,
    findings: &mut Vec<Finding>,
) -> Result<Vec<Proposal>> {
    check_limits(about, settings)?;
    let generic = wants_generic(about, settings, findings)?;
    let mut collector = Collector {
        graph,
        about,
        settings,
        all: Vec::new(),
    };
    collector.written(generic)?;
    collector.simple_joint_terms();
    if let Some(robot) = about.robot {
        collector.all.extend(inertial(robot, settings, findings)?);
        if settings.has(Family::Tilt) {
            let gravity = robot.description().gravity;
            collector.all.push(base_tilt::proposal(gravity));
        }
    }
    collector.conservative();
    collector.further_friction();
    collector.coupled();
    if about.robot.is_some() {
        collector.scaled_and_shifted();
    }
    let ripples = ripples(collector.graph, about.joints, settings)?;
    collector.all.extend(ripples);
    collector.with_memory();
    Ok(collector.all)
}

/// The velocity of Coulomb friction is one, and the robot has no more joints than a fit can have.
fn check_limits(about: &About<'_>, settings: &LibrarySettings) -> Result<()> {
    let velocity = settings.coulomb_velocity;
    if !(velocity.is_finite()
        && velocity >= 0.0
        && (velocity == 0.0 || (1.0 / velocity).is_finite()))
    {
        return Err(Error::Setting {
            key: "library.coulomb_velocity".to_owned(),
            problem: format!("{velocity} is not a velocity"),
            remedy: "give 0 or a positive number, rad/s".to_owned(),
        });
    }
    let joints = about.joints;
    if joints.len() > MOST_JOINTS {
        return Err(Error::Setting {
            key: "model.locked".to_owned(),
            problem: format!(
                "the model has {} moving joints, more than the {MOST_JOINTS} that a fit can have",
                joints.len()
            ),
            remedy: "lock joints that do not move in these logs: [model] locked = { finger = 0.0 }"
                .to_owned(),
        });
    }
    Ok(())
}

/// Proposals of the families that are switched on, so far.
struct Collector<'a> {
    graph: &'a mut Graph,
    about: &'a About<'a>,
    settings: &'a LibrarySettings,
    all: Vec<Proposal>,
}

impl Collector<'_> {
    /// What `make` gives for each joint, if the family is on.
    fn per_joint<P: Into<Proposal>>(
        &mut self,
        family: Family,
        make: impl Fn(&mut Graph, &Joint) -> P,
    ) {
        if self.settings.has(family) {
            for joint in self.about.joints {
                self.all.push(make(self.graph, joint).into());
            }
        }
    }

    /// What `make` gives for the sum and the difference of each pair of joints of a wrist, if the family is on.
    fn per_pair<P: Into<Proposal>>(
        &mut self,
        family: Family,
        make: impl Fn(&mut Graph, [&Joint; 2], f64) -> P,
    ) {
        let joints = self.about.joints;
        if self.settings.has(family) {
            for (a, b) in coupled_friction::pairs(joints) {
                for sign in [1.0, -1.0] {
                    let pair = [&joints[a], &joints[b]];
                    self.all.push(make(self.graph, pair, sign).into());
                }
            }
        }
    }

    /// Terms given as text: the user's, and the generic family.
    fn written(&mut self, generic: bool) -> Result<()> {
        let joints = self.about.joints;
        for text in &self.settings.terms {
            let term = user::candidate(self.graph, text, Family::User, joints)?;
            self.all.push(term.into());
        }
        if generic {
            for name in generic::names(joints, self.about.parallel) {
                let term = user::candidate(self.graph, &name, Family::Generic, joints)?;
                self.all.push(term.into());
            }
        }
        Ok(())
    }

    /// Viscous and Coulomb friction, offsets and motor inertias.
    fn simple_joint_terms(&mut self) {
        let velocity = self.settings.coulomb_velocity;
        self.per_joint(Family::Viscous, viscous::candidate);
        self.per_joint(Family::Coulomb, |graph, joint| {
            coulomb::candidate(graph, joint, velocity)
        });
        self.per_joint(Family::Offset, offset::candidate);
        self.per_joint(Family::MotorInertia, motor_inertia::candidate);
    }

    /// Springs, and torques of one joint that depend on its position.
    fn conservative(&mut self) {
        let held: Vec<Option<f64>> = held_torque(self.about);
        self.per_joint(Family::Spring, |graph, joint| {
            spring::proposal(graph, joint, held[joint.index])
        });
        if self.settings.has(Family::Potential) {
            for joint in self.about.joints.iter().filter(|joint| !joint.slides) {
                let potential = potential::proposal(self.graph, joint, held[joint.index]);
                self.all.push(potential);
            }
        }
    }

    /// Friction of single joints beyond viscous and Coulomb.
    fn further_friction(&mut self) {
        let velocity = self.settings.coulomb_velocity;
        self.per_joint(Family::Asymmetry, |graph, joint| {
            asymmetry::proposal(graph, joint, velocity)
        });
        self.per_joint(Family::Stribeck, |graph, joint| {
            stribeck::candidate(graph, joint, velocity)
        });
        self.per_joint(Family::QuadraticFriction, quadratic_friction::candidate);
        if self.about.robot.is_some() {
            self.per_joint(Family::LoadFriction, |_, joint| {
                load_friction::candidate(joint, velocity)
            });
        }
    }

    /// Friction and inertia of two joints together.
    fn coupled(&mut self) {
        let velocity = self.settings.coulomb_velocity;
        self.per_pair(Family::CoupledFriction, |graph, [a, b], sign| {
            coupled_friction::proposal(graph, a, b, sign, velocity)
        });
        self.per_pair(Family::CoupledInertia, |graph, [a, b], sign| {
            coupled_inertia::candidate(graph, a, b, sign)
        });
    }

    /// Gains of torque and zeros of encoders.
    fn scaled_and_shifted(&mut self) {
        if self.settings.has(Family::Gain) && self.about.joints.len() > 1 {
            self.all.push(gain::common().into());
        }
        self.per_joint(Family::Gain, |_, joint| gain::candidate(joint));
        self.per_joint(Family::EncoderZero, |_, joint| {
            encoder_zero::candidate(joint)
        });
    }

    /// What depends on earlier motion: hysteresis and warm-up.
    fn with_memory(&mut self) {
        let velocity = self.settings.coulomb_velocity;
        self.per_joint(Family::Hysteresis, hysteresis::proposal);
        self.per_joint(Family::WarmUp, |graph, joint| {
            warm_up::proposal(graph, joint, velocity)
        });
    }
}

/// Torque that each joint holds against gravity: amplitude (√2 rms) over random positions, N·m or N, at least a twentieth of the robot's
/// largest; `None` where nothing is held.
fn held_torque(about: &About<'_>) -> Vec<Option<f64>> {
    let count = about.joints.len();
    let Some(robot) = about.robot else {
        return vec![None; count];
    };
    let states = random_motions(count);
    let [q, _, _] = channels(&states, count);
    let still = vec![0.0; q.len()];
    let mut tau = vec![0.0; q.len()];
    let motion = Motion {
        len: states.len(),
        q: &q,
        qd: &still,
        qdd: &still,
    };
    nominal_torque(robot, motion, &mut tau);
    let amplitude = |tau: &[f64]| {
        let square: f64 = tau.iter().map(|t| t * t).sum();
        (2.0 * square / tau.len() as f64).sqrt()
    };
    let own: Vec<f64> = tau.chunks_exact(states.len()).map(amplitude).collect();
    let least = LEAST_HELD * own.iter().copied().fold(0.0, f64::max);
    let held = own.into_iter().map(|own| own.max(least));
    held.map(|held| (held > 0.0).then_some(held)).collect()
}

fn ripples(
    graph: &mut Graph,
    joints: &[Joint],
    settings: &LibrarySettings,
) -> Result<Vec<Proposal>> {
    let refuse = |joint: &str, problem: String, remedy: String| {
        Err(Error::Setting {
            key: format!("library.ripple.{joint}"),
            problem,
            remedy,
        })
    };
    let mut all = Vec::new();
    for (name, &periods) in &settings.ripple {
        let Some(joint) = joints.iter().find(|joint| joint.name == *name) else {
            let remedy = did_you_mean(name, joints.iter().map(|joint| joint.name.as_str()));
            return refuse(name, "no such moving joint".into(), remedy);
        };
        if !(periods.is_finite() && periods > 0.0) {
            let remedy = "give the gear ratio, such as 101".into();
            return refuse(name, format!("{periods} periods per turn"), remedy);
        }
        all.push(ripple::proposal(graph, joint, periods));
    }
    Ok(all)
}

/// Whether the generic family is proposed; says so where it is left out unasked.
fn wants_generic(
    about: &About<'_>,
    settings: &LibrarySettings,
    findings: &mut Vec<Finding>,
) -> Result<bool> {
    let (joints, parallel) = (about.joints, about.parallel);
    let generic = settings.generic.unwrap_or(joints.len() <= GENERIC_JOINTS);
    if settings.generic.is_none() && !generic {
        findings.push(Finding::new(
            Severity::Note,
            Code::GenericFamilyOff,
            "",
            format!(
                "the robot has {} moving joints: the generic family, which has {} terms for them, is proposed unasked up \
                 to {GENERIC_JOINTS} joints only; name the terms you want in [library] terms",
                joints.len(),
                generic::count(joints, parallel)
            ),
            0,
        )
        .with([
            ("joints", joints.len() as f64), ("terms", generic::count(joints, parallel)),
            ("joints_at_most", GENERIC_JOINTS as f64),
        ]));
    }
    let count = settings.terms.len() as f64
        + if generic {
            generic::count(joints, parallel)
        } else {
            0.0
        };
    if count > TERM_LIMIT as f64 {
        let key = if settings.terms.len() > TERM_LIMIT {
            "library.terms"
        } else {
            "library.generic"
        };
        return Err(Error::Setting {
            key: key.to_owned(),
            problem: format!(
                "{count} terms for {} joints, the limit is {TERM_LIMIT}",
                joints.len()
            ),
            remedy: "name the terms you want in `terms` and set `generic = false`".to_owned(),
        });
    }
    Ok(generic)
}
