//! What to do about a finding, the most important first.

use serde::Serialize;
use twincal::Code;

/// When something can be fixed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum When {
    /// With these logs.
    Now,
    /// In the next log only.
    NextLog,
    /// Nothing has to be done.
    Never,
}

/// What to do about a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Remedy {
    /// Of which findings.
    pub code: Code,
    /// When it can be done.
    pub when: When,
    /// A command, a line of twincal.toml, or what to do where the log is made.
    pub text: &'static str,
}

impl Remedy {
    const fn now(code: Code, text: &'static str) -> Self {
        let when = When::Now;
        Self { code, when, text }
    }

    const fn next_log(code: Code, text: &'static str) -> Self {
        let when = When::NextLog;
        Self { code, when, text }
    }

    const fn never(code: Code, text: &'static str) -> Self {
        let when = When::Never;
        Self { code, when, text }
    }
}

/// What to do about findings of this code, and how many codes matter more; `None` of a code whose message says it.
///
/// # Example
/// ```
/// use twincal::Code;
/// use twincal_io::words::{When, remedy};
///
/// let (_, copied) = remedy(Code::TorqueCopied).ok_or("none")?;
/// assert_eq!(copied.when, When::Now);
/// println!("{}", copied.text);
/// # Ok::<(), &str>(())
/// ```
#[must_use]
pub fn remedy(code: Code) -> Option<(usize, &'static Remedy)> {
    ALL.iter().enumerate().find(|(_, own)| own.code == code)
}

/// What to do about effects of a model that are left aside.
const NOT_USED: &str = "nothing, if it does not act in these logs; else write its effect into the model in a form that is read";

/// In the order in which findings matter.
const ALL: &[Remedy] = &[
    Remedy::now(Code::BaseOrientation, "twincal.toml: [model] base"),
    Remedy::now(
        Code::TorqueCopied,
        "map the measured torque of that joint in [columns] tau, or log it again",
    ),
    Remedy::now(
        Code::TorqueConstant,
        "map the measured torque of that joint in [columns] tau, or leave this log out",
    ),
    Remedy::next_log(
        Code::ModelTorque,
        "log the measured torque of the drives, or add the model's to this one",
    ),
    Remedy::next_log(
        Code::GravityCompensated,
        "log the measured torque of the drives, or add the gravity that was taken off",
    ),
    Remedy::next_log(
        Code::TorqueHeld,
        "log that joint's torque in every row, or leave this log out",
    ),
    Remedy::now(
        Code::ClockScale,
        "give the true rate: --rate HZ, or a factor for qd in [columns.factor]",
    ),
    Remedy::now(
        Code::JointOrder,
        "map the columns in [columns.q], [columns.qd], [columns.tau] of twincal.toml; twincal init writes them",
    ),
    Remedy::now(Code::SignFlip, "twincal.toml: [columns.factor]"),
    Remedy::now(
        Code::TorqueScale,
        "say what the torque is ([[log]] torque, gear_ratio, drive_constant), or give [columns.factor] tau",
    ),
    Remedy::now(
        Code::UnphysicalInertia,
        "correct the link's <inertial>, or accept it: --allow unphysical-inertia",
    ),
    Remedy::now(
        Code::LinkWithoutInertia,
        "give the link an <inertial>, or let fit find it",
    ),
    Remedy::now(
        Code::MovesNoMass,
        "give the link an <inertial>, or fix the joint with [model] locked",
    ),
    Remedy::next_log(Code::TorqueLag, "record torque by the clock of the motion"),
    Remedy::now(
        Code::VelocityOpposite,
        "twincal.toml: [columns.factor] with q or qd of that joint, whichever is turned; the torque does not tell",
    ),
    Remedy::now(
        Code::VelocityMismatch,
        "twincal.toml: [signal] velocity = \"position\"",
    ),
    Remedy::never(
        Code::NoisyVelocity,
        "nothing: velocity is taken from position; [signal] velocity = \"logged\" keeps the log's",
    ),
    Remedy::now(
        Code::Truncated,
        "`mcap recover` makes a whole file of it, or copy it again",
    ),
    Remedy::now(
        Code::DamagedChunks,
        "copy the file again; --strict refuses it",
    ),
    Remedy::now(
        Code::PartsMerged,
        "publish joints and channels that belong together in one message",
    ),
    Remedy::now(
        Code::LogTime,
        "fill in header.stamp where the message is made, or name another time: [columns] time",
    ),
    Remedy::now(
        Code::NotFiniteRows,
        "look at those rows in the log; --strict refuses them",
    ),
    Remedy::now(
        Code::UnreadableRows,
        "look at those rows in the log; --strict refuses them",
    ),
    Remedy::now(
        Code::ContradictingDuplicates,
        "export each topic once; --strict refuses such logs",
    ),
    Remedy::now(
        Code::TimeStepsBack,
        "sort or cut the log where time steps back",
    ),
    Remedy::next_log(
        Code::CrowdedStamps,
        "log the source's stamp, or give the rate: --rate HZ",
    ),
    Remedy::next_log(
        Code::Resampled,
        "log the source's stamp, or give the rate: --rate HZ",
    ),
    Remedy::next_log(
        Code::RepeatedSamples,
        "log each sample of the controller once, with the controller's stamp",
    ),
    Remedy::next_log(Code::SlowerChannels, "log all channels at one rate"),
    Remedy::next_log(Code::ShortSegments, "record longer, or fix the gaps"),
    Remedy::never(
        Code::Contact,
        "nothing: left out; cut the log there to be sure",
    ),
    Remedy::never(
        Code::DrivesOff,
        "nothing: left out; cut the log there to be sure",
    ),
    Remedy::next_log(
        Code::SaturatedTorque,
        "record a slower motion, with torque below the limit",
    ),
    Remedy::next_log(
        Code::QuantisedEncoder,
        "log the full resolution of the encoder",
    ),
    Remedy::next_log(
        Code::LowerBand,
        "log the full resolution of the encoder, or longer and faster motion",
    ),
    Remedy::next_log(
        Code::JointNotExcited,
        "record a log in which that joint moves",
    ),
    Remedy::next_log(
        Code::JointStandsStill,
        "record a log in which that joint moves",
    ),
    Remedy::now(
        Code::MotionSpike,
        "look at the encoder's cable and driver; the samples are left out",
    ),
    Remedy::now(
        Code::PositionStep,
        "keep the side whose zero is right and cut the other off",
    ),
    Remedy::now(
        Code::WrappedAngle,
        "unfold the angles, or leave [signal] cutoff_hz at \"auto\"",
    ),
    Remedy::now(
        Code::ImplausibleTimeStep,
        "give time in seconds, or the rate: --rate HZ",
    ),
    Remedy::next_log(
        Code::MissingTorque,
        "log the torque of every row, or cut the log to where it is there",
    ),
    Remedy::now(
        Code::ConstantTorque,
        "map the measured torque in [columns] tau, or leave this log out",
    ),
    Remedy::now(
        Code::ChaptersLeftOut,
        "cut the log to what can be used: the message says where",
    ),
    Remedy::never(
        Code::LateMessages,
        "nothing: put in order; publish in the order of header.stamp to be sure",
    ),
    Remedy::next_log(
        Code::MotionFilterCapped,
        "log faster, or lower [signal] cutoff_hz",
    ),
    Remedy::now(
        Code::RowsAlias,
        "twincal.toml: leave [signal] rate_hz out, or raise it",
    ),
    Remedy::now(
        Code::RateIgnored,
        "twincal.toml: leave out [signal] rate_hz, or cutoff_hz = 0",
    ),
    Remedy::now(
        Code::LockedBeyondLimits,
        "twincal.toml: correct [model] locked, or the joint's limits in the model",
    ),
    Remedy::now(
        Code::NoMetadata,
        "copy the bag's metadata.yaml beside its files",
    ),
    Remedy::never(Code::ActuatorNotUsed, NOT_USED),
    Remedy::never(Code::EqualityNotUsed, NOT_USED),
    Remedy::never(Code::TendonNotUsed, NOT_USED),
    Remedy::never(Code::GravcompNotUsed, NOT_USED),
    Remedy::never(Code::FluidNotUsed, NOT_USED),
    Remedy::never(Code::FlagNotUsed, NOT_USED),
    Remedy::never(
        Code::UnknownElements,
        "nothing, if they do not matter here; else correct their names in the model",
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_one_remedy_at_most() {
        for (number, own) in ALL.iter().enumerate() {
            assert_eq!(remedy(own.code), Some((number, own)));
        }
    }
}
