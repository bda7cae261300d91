//! The families of candidates: who shares an inclusion prior and a slab scale.

use serde::{Deserialize, Serialize};

/// Which family a component belongs to; each family has its own Beta–Binomial inclusion prior and slab scale.
///
/// # Example
/// ```
/// use twincal::term::Family;
///
/// assert_eq!(Family::MotorInertia.word(), "motor_inertia"); // as in `elbow.motor_inertia` and `[library] families`
/// assert!(Family::DEFAULT.contains(&Family::Payload) && !Family::DEFAULT.contains(&Family::Ripple));
/// let friction = Family::JOINT.into_iter().filter(|family| family.is_friction());
/// assert!(friction.eq([Family::Viscous, Family::Coulomb]));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// The user's own expressions.
    User,
    /// The built-in trigonometric and polynomial family.
    Generic,
    /// Viscous friction.
    Viscous,
    /// Coulomb friction.
    Coulomb,
    /// Constant torque offset.
    Offset,
    /// Reflected inertia of the motor.
    MotorInertia,
    /// A body at the tool: mass and first moments.
    Payload,
    /// Its inertia tensor, which may be out while the payload is in.
    PayloadTensor,
    /// Mass, first moments and inertia of a link by one factor.
    Density,
    /// First moments of a link's mass, beside its density.
    MassMoments,
    /// Inertia tensor of a link, beside its density.
    Tensor,
    /// Direction and size of gravity in the base.
    Tilt,
    /// Joint spring with rest position.
    Spring,
    /// Potential of one joint: gravity compensators, counterbalances.
    Potential,
    /// Friction that differs between the two directions.
    Asymmetry,
    /// Friction that falls from breakaway to sliding.
    Stribeck,
    /// Friction that is not in proportion to the speed.
    QuadraticFriction,
    /// Friction that grows with the load.
    LoadFriction,
    /// Friction of a motor that turns with the sum or difference of two joints.
    CoupledFriction,
    /// Rotor inertia of a motor that turns with the sum or difference of two joints.
    CoupledInertia,
    /// Drive constant: torque scaled by a factor.
    Gain,
    /// Zero position of a joint encoder.
    EncoderZero,
    /// Gear ripple.
    Ripple,
    /// Friction that builds up over a way after a velocity reversal.
    Hysteresis,
    /// Friction that changes with warmth.
    WarmUp,
}

/// A number further from 0 than this many spreads is clear.
pub(super) const CLEAR: f64 = 2.0;

impl Family {
    /// All families that `[library] families` can name, in the order of `terms[]`.
    pub const NAMED: [Self; 22] = [
        Self::Viscous,
        Self::Coulomb,
        Self::Offset,
        Self::MotorInertia,
        Self::Payload,
        Self::Density,
        Self::MassMoments,
        Self::Tensor,
        Self::Tilt,
        Self::Spring,
        Self::Potential,
        Self::Asymmetry,
        Self::Stribeck,
        Self::QuadraticFriction,
        Self::LoadFriction,
        Self::CoupledFriction,
        Self::CoupledInertia,
        Self::Gain,
        Self::EncoderZero,
        Self::Ripple,
        Self::Hysteresis,
        Self::WarmUp,
    ];

    /// Families that come without a switch of their own: with `terms`, with `generic`, with a payload.
    pub const UNNAMED: [Self; 3] = [Self::User, Self::Generic, Self::PayloadTensor];

    /// What twincal proposes unasked for an arm with geared drives: all but `ripple` (it asks for a gear ratio).
    pub const DEFAULT: [Self; 21] = [
        Self::Viscous,
        Self::Coulomb,
        Self::Offset,
        Self::MotorInertia,
        Self::Payload,
        Self::Density,
        Self::MassMoments,
        Self::Tensor,
        Self::Tilt,
        Self::Spring,
        Self::Potential,
        Self::Asymmetry,
        Self::Stribeck,
        Self::QuadraticFriction,
        Self::LoadFriction,
        Self::CoupledFriction,
        Self::CoupledInertia,
        Self::Gain,
        Self::EncoderZero,
        Self::Hysteresis,
        Self::WarmUp,
    ];

    /// What is proposed beside the user's own expressions: friction, offset and motor inertia of every joint.
    pub const JOINT: [Self; 4] = [
        Self::Viscous,
        Self::Coulomb,
        Self::Offset,
        Self::MotorInertia,
    ];

    /// True if its torque depends on v_s, within which friction turns round with the motion.
    #[must_use]
    pub fn turns_round(self) -> bool {
        matches!(
            self,
            Self::Coulomb
                | Self::Asymmetry
                | Self::Stribeck
                | Self::LoadFriction
                | Self::CoupledFriction
                | Self::Hysteresis
                | Self::WarmUp
        )
    }

    /// Factor and unit in which people read a parameter that is kept in the SI `unit`: parts in per cent, angles in degrees, centres of
    /// mass in millimetres.
    #[must_use]
    pub fn told_in(self, unit: &str) -> (f64, &str) {
        match (self, unit) {
            (Self::Gain | Self::LoadFriction | Self::Density, "1") => (100.0, "%"),
            (Self::EncoderZero, "rad") => (1f64.to_degrees(), "°"),
            (Self::EncoderZero | Self::Payload, "m") => (1e3, "mm"),
            (_, "1") => (1.0, ""),
            (_, unit) => (1.0, unit),
        }
    }

    /// What a first number that is clearly negative means, where no motor, brake or body can do it on its own: it is said of the model. `spread`: half its
    /// central 68.3 % interval.
    #[must_use]
    pub fn remark(self, value: f64, spread: f64) -> Option<&'static str> {
        let remark = match self {
            Self::MotorInertia => "negative: the model has too much inertia there",
            Self::Viscous | Self::Coulomb => "negative: the model has too much friction there",
            Self::Stribeck => "negative: friction grows with speed here",
            Self::QuadraticFriction => "negative: friction grows less than the speed",
            Self::Payload => "negative: the model carries too much",
            _ => return None,
        };
        (value < -CLEAR * spread).then_some(remark)
    }

    /// The part of a component's name after the dot, or `payload`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::User => "user",
            Self::Generic => "generic",
            Self::Viscous => "viscous",
            Self::Coulomb => "coulomb",
            Self::Offset => "offset",
            Self::MotorInertia => "motor_inertia",
            Self::Payload => "payload",
            Self::PayloadTensor => "payload_tensor",
            Self::MassMoments => "mass_moments",
            Self::Tensor => "tensor",
            Self::Density => "density",
            Self::Tilt => "tilt",
            Self::Spring => "spring",
            Self::Potential => "potential",
            Self::Asymmetry => "asymmetry",
            Self::Stribeck => "stribeck",
            Self::QuadraticFriction => "quadratic_friction",
            Self::LoadFriction => "load_friction",
            Self::CoupledFriction => "coupled_friction",
            Self::CoupledInertia => "coupled_inertia",
            Self::Gain => "gain",
            Self::EncoderZero => "encoder_zero",
            Self::Ripple => "ripple",
            Self::Hysteresis => "hysteresis",
            Self::WarmUp => "warm_up",
        }
    }

    /// Prior probability of what is more or less usual than the rest: nearly every geared joint has friction and a motor's inertia, and
    /// a payload, which one log in three or so carries unsaid, is the usual reason why the last link is not what the model says. What has
    /// mass somewhere has a tensor about any other point: that of a payload is next to certain where the payload is in; not quite,
    /// because the tensor of a small payload near the link's own centre of mass is too small to be seen. A drive's zero is calibrated,
    /// while a constant is what is left on one motion of whatever else is missing: one arm of six joints in five has an offset. What is wrong
    /// with a link is first of all how heavy it is, in one link of thirty, and then, which needs that, often where (one in four); a tensor that is off by
    /// itself is rarer. One geared joint in twenty bends before it slides so far that it shows behind the row filter; one in a hundred warms while it is logged.
    /// A function of one joint's position is likewise what is left of much else, and few joints have a spring or a counterbalance.
    /// Drive constants and joint zeros can imitate almost anything and are calibrated by the maker: one in a thousand is off.
    #[must_use]
    pub fn usual(self) -> Option<f64> {
        match self {
            Self::Viscous | Self::Coulomb | Self::MotorInertia => Some(0.5),
            Self::Payload => Some(1.0 / 3.0),
            Self::PayloadTensor => Some(0.999),
            Self::Offset | Self::Density | Self::Spring | Self::Potential => Some(1.0 / 30.0),
            Self::MassMoments => Some(1.0 / 4.0),
            Self::Tensor => Some(1.0 / 50.0),
            Self::Hysteresis => Some(1.0 / 20.0),
            Self::WarmUp => Some(1.0 / 100.0),
            Self::Gain | Self::EncoderZero => Some(1e-3),
            _ => None,
        }
    }

    /// True for what a link's inertia may be off, level by level.
    #[must_use]
    pub fn is_level(self) -> bool {
        matches!(self, Self::Density | Self::MassMoments | Self::Tensor)
    }

    /// True for a function of one joint's position, which one motion alone hardly tells from the error of another term.
    #[must_use]
    pub fn asks_for_two_motions(self) -> bool {
        matches!(self, Self::Spring | Self::Potential)
    }

    /// True for all that a payload has.
    #[must_use]
    pub fn is_payload(self) -> bool {
        matches!(self, Self::Payload | Self::PayloadTensor)
    }

    /// True for everything that dissipates.
    #[must_use]
    pub fn is_friction(self) -> bool {
        matches!(
            self,
            Self::Viscous
                | Self::Coulomb
                | Self::Asymmetry
                | Self::Stribeck
                | Self::QuadraticFriction
                | Self::LoadFriction
                | Self::CoupledFriction
                | Self::Hysteresis
                | Self::WarmUp
        )
    }

    /// True if its torque is a number times a shape of at most 1 that vanishes with speed: the number is what a joint does near
    /// standstill, however little of that the data hold.
    #[must_use]
    pub fn fades(self) -> bool {
        matches!(self, Self::Stribeck | Self::Hysteresis)
    }

    /// True if its torque depends on more of a joint's motion than one state: 0 where nothing is known of what was before.
    #[must_use]
    pub fn remembers(self) -> bool {
        matches!(self, Self::Hysteresis | Self::WarmUp)
    }

    /// True if its torque is another where other effects act: gravity acts on masses, drives on all torque, zeros on where masses are.
    pub(crate) fn multiplies(self) -> bool {
        matches!(self, Self::Tilt | Self::EncoderZero | Self::Gain)
    }

    /// True if it is another story than the columns that span it. The rotors of a sum and of a difference of two joints and those of
    /// both joints are three directions, but each of the four is what a gear train can be.
    pub(super) fn is_story_of_its_own(self) -> bool {
        self == Self::CoupledInertia
    }

    /// Who stays when two have the same torque: the smaller.
    pub(super) fn preference(self) -> u8 {
        match self {
            Self::User => 0,
            Self::Viscous | Self::Coulomb => 1,
            Self::Offset => 2,
            Self::MotorInertia => 3,
            Self::Generic => 5,
            _ => 4,
        }
    }
}
