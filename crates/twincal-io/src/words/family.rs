//! Families of candidates.

use twincal::term::Family;

/// A family in words.
pub(crate) fn family_name(family: Family) -> &'static str {
    match family {
        Family::User => "own expressions",
        Family::Generic => "generic energy terms",
        Family::Viscous => "viscous friction",
        Family::Coulomb => "Coulomb friction",
        Family::Offset => "torque offset",
        Family::MotorInertia => "motor inertia",
        Family::Payload => "payload",
        Family::PayloadTensor => "inertia of the payload",
        Family::MassMoments => "centre of mass",
        Family::Tensor => "inertia tensor",
        Family::Density => "density",
        Family::Tilt => "gravity",
        Family::Spring => "spring",
        Family::Potential => "conservative torque of one joint",
        Family::Asymmetry => "direction-dependent friction",
        Family::Stribeck => "Stribeck friction",
        Family::QuadraticFriction => "quadratic friction",
        Family::LoadFriction => "load-dependent friction",
        Family::CoupledFriction => "friction of coupled motors",
        Family::CoupledInertia => "inertia of coupled motors",
        Family::Gain => "torque gain",
        Family::EncoderZero => "encoder zero",
        Family::Ripple => "gear ripple",
        Family::Hysteresis => "friction with hysteresis",
        Family::WarmUp => "friction that changes with warmth",
    }
}
