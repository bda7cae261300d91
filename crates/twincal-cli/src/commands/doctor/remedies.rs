//! What to fix, the most important first, each with a number and a line to type or to write.

use super::columns::{is_axis, sign_line};
use super::examine::Examination;
use serde::Serialize;
use std::fmt::Write as _;
use twincal::self_check::JointCheck;
use twincal::{Code, Finding, Severity};
use twincal_io::config::key;

/// One thing to fix.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Remedy {
    /// What is wrong, with its number.
    pub(super) problem: String,
    /// A command, a line of twincal.toml, or what to do where the log is made.
    pub(super) how: String,
    /// Something is wrong, not only missing.
    #[serde(skip)]
    pub(super) wrong: bool,
    /// When it can be fixed.
    #[serde(skip)]
    pub(super) when: When,
    #[serde(skip)]
    rank: usize,
}

/// When something can be fixed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum When {
    /// With these logs.
    Now,
    /// In the next log only: the fit of this one goes ahead as it is.
    NextLog,
    /// Nothing has to be done.
    Never,
}

impl When {
    /// By what is to be done, and whether the fit goes ahead without.
    fn of(how: &str, goes_ahead: bool) -> Self {
        if how.starts_with("nothing") {
            Self::Never
        } else if goes_ahead && NEXT.iter().any(|begin| how.starts_with(begin)) {
            Self::NextLog
        } else {
            Self::Now
        }
    }
}

/// How remedies begin that ask for another recording.
const NEXT: [&str; 2] = ["log ", "record "];
/// What stands before a remedy that is for the next log: of a published one there is no other.
const FOR_THE_NEXT: &str = "nothing has to be done for this log; for the next one:";

/// What to do about effects of a model that are left aside.
const NOT_USED: &str = "nothing, if it does not act in these logs; else write its effect into the model in a form that is read";

/// Findings in the order in which they matter, with their remedies.
const ORDER: &[(Code, &str)] = &[
    (Code::BaseOrientation, "twincal.toml: [model] base"),
    (
        Code::TorqueCopied,
        "map the measured torque of that joint in [columns] tau, or log it again",
    ),
    (
        Code::TorqueConstant,
        "map the measured torque of that joint in [columns] tau, or leave this log out",
    ),
    (
        Code::ModelTorque,
        "log the measured torque of the drives, or add the model's to this one",
    ),
    (
        Code::GravityCompensated,
        "log the measured torque of the drives, or add the gravity that was taken off",
    ),
    (
        Code::TorqueHeld,
        "log that joint's torque in every row, or leave this log out",
    ),
    (
        Code::ClockScale,
        "give the true rate: --rate HZ, or a factor for qd in [columns.factor]",
    ),
    (
        Code::JointOrder,
        "map the columns in [columns.q], [columns.qd], [columns.tau] of twincal.toml; twincal init writes them",
    ),
    (Code::SignFlip, "twincal.toml: [columns.factor]"),
    (
        Code::TorqueScale,
        "say what the torque is ([[log]] torque, gear_ratio, drive_constant), or give [columns.factor] tau",
    ),
    (
        Code::UnphysicalInertia,
        "correct the link's <inertial>, or accept it: --allow unphysical-inertia",
    ),
    (
        Code::LinkWithoutInertia,
        "give the link an <inertial>, or let fit find it",
    ),
    (
        Code::MovesNoMass,
        "give the link an <inertial>, or fix the joint with [model] locked",
    ),
    (Code::TorqueLag, "record torque by the clock of the motion"),
    (
        Code::VelocityOpposite,
        "twincal.toml: [columns.factor] with q or qd of that joint, whichever is turned; the torque does not tell",
    ),
    (
        Code::VelocityMismatch,
        "twincal.toml: [signal] velocity = \"position\"",
    ),
    (
        Code::NoisyVelocity,
        "nothing: velocity is taken from position; [signal] velocity = \"logged\" keeps the log's",
    ),
    (
        Code::Truncated,
        "`mcap recover` makes a whole file of it, or copy it again",
    ),
    (
        Code::DamagedChunks,
        "copy the file again; --strict refuses it",
    ),
    (
        Code::PartsMerged,
        "publish joints and channels that belong together in one message",
    ),
    (
        Code::LogTime,
        "fill in header.stamp where the message is made, or name another time: [columns] time",
    ),
    (
        Code::NotFiniteRows,
        "look at those rows in the log; --strict refuses them",
    ),
    (
        Code::UnreadableRows,
        "look at those rows in the log; --strict refuses them",
    ),
    (
        Code::ContradictingDuplicates,
        "export each topic once; --strict refuses such logs",
    ),
    (
        Code::TimeStepsBack,
        "sort or cut the log where time steps back",
    ),
    (
        Code::CrowdedStamps,
        "log the source's stamp, or give the rate: --rate HZ",
    ),
    (
        Code::Resampled,
        "log the source's stamp, or give the rate: --rate HZ",
    ),
    (
        Code::RepeatedSamples,
        "log each sample of the controller once, with the controller's stamp",
    ),
    (Code::SlowerChannels, "log all channels at one rate"),
    (Code::ShortSegments, "record longer, or fix the gaps"),
    (
        Code::Contact,
        "nothing: left out; cut the log there to be sure",
    ),
    (
        Code::DrivesOff,
        "nothing: left out; cut the log there to be sure",
    ),
    (
        Code::SaturatedTorque,
        "record a slower motion, with torque below the limit",
    ),
    (
        Code::QuantisedEncoder,
        "log the full resolution of the encoder",
    ),
    (
        Code::LowerBand,
        "log the full resolution of the encoder, or longer and faster motion",
    ),
    (
        Code::JointNotExcited,
        "record a log in which that joint moves",
    ),
    (
        Code::JointStandsStill,
        "record a log in which that joint moves",
    ),
    (
        Code::MotionSpike,
        "look at the encoder's cable and driver; the samples are left out",
    ),
    (
        Code::PositionStep,
        "keep the side whose zero is right and cut the other off",
    ),
    (
        Code::WrappedAngle,
        "unfold the angles, or leave [signal] cutoff_hz at \"auto\"",
    ),
    (
        Code::ImplausibleTimeStep,
        "give time in seconds, or the rate: --rate HZ",
    ),
    (
        Code::MissingTorque,
        "log the torque of every row, or cut the log to where it is there",
    ),
    (
        Code::ConstantTorque,
        "map the measured torque in [columns] tau, or leave this log out",
    ),
    (
        Code::ChaptersLeftOut,
        "cut the log to what can be used: the message says where",
    ),
    (
        Code::LateMessages,
        "nothing: put in order; publish in the order of header.stamp to be sure",
    ),
    (
        Code::MotionFilterCapped,
        "log faster, or lower [signal] cutoff_hz",
    ),
    (
        Code::RowsAlias,
        "twincal.toml: leave [signal] rate_hz out, or raise it",
    ),
    (
        Code::RateIgnored,
        "twincal.toml: leave out [signal] rate_hz, or cutoff_hz = 0",
    ),
    (
        Code::LockedBeyondLimits,
        "twincal.toml: correct [model] locked, or the joint's limits in the model",
    ),
    (
        Code::NoMetadata,
        "copy the bag's metadata.yaml beside its files",
    ),
    (Code::ActuatorNotUsed, NOT_USED),
    (Code::EqualityNotUsed, NOT_USED),
    (Code::TendonNotUsed, NOT_USED),
    (Code::GravcompNotUsed, NOT_USED),
    (Code::FluidNotUsed, NOT_USED),
    (Code::FlagNotUsed, NOT_USED),
    (
        Code::UnknownElements,
        "nothing, if they do not matter here; else correct their names in the model",
    ),
];

/// All of them, ranked.
pub(super) fn remedies(examination: &Examination) -> Vec<Remedy> {
    let mut all: Vec<Remedy> = examination
        .refusals
        .iter()
        .map(|refusal| Remedy {
            problem: refusal.problem.clone(),
            how: match refusal.time_unit.is_some() || refusal.degrees.is_some() {
                true => format!("{} (twincal init writes it)", refusal.remedy),
                false => refusal.remedy.clone(),
            },
            wrong: true,
            when: When::Now,
            rank: 0,
        })
        .collect();
    let mut said: Vec<(Code, usize)> = Vec::new();
    let turned = |joint: &str| {
        let mut all = examination.findings.iter();
        all.any(|f| f.code == Code::SignFlip && f.subject == joint)
    };
    let is_said = |code: Code| examination.findings.iter().any(|f| f.code == code);
    for finding in examination
        .findings
        .iter()
        .filter(|f| f.severity > Severity::Note)
        // Which of the two is turned is said there.
        .filter(|f| f.code != Code::VelocityOpposite || !turned(&f.subject))
        // That it is no measurement is said there.
        .filter(|f| f.code != Code::ConstantTorque || !is_said(Code::TorqueConstant))
    {
        // One of a kind is enough to know what to do.
        match said.iter_mut().find(|(code, _)| *code == finding.code) {
            Some((_, more)) => *more += 1,
            None => {
                said.push((finding.code, 0));
                all.push(of_finding(finding, examination));
            }
        }
    }
    let first = examination.refusals.len();
    for ((_, more), remedy) in said.iter().zip(&mut all[first..]) {
        if *more > 0 {
            let _ = write!(remedy.problem, " ({more} more like this, --json)");
        }
    }
    if let Some(excitation) = examination
        .outlook
        .as_ref()
        .and_then(|o| o.excitation.as_ref())
        && let Some(unseen) = excitation.unseen.first()
    {
        let [robot, logs] = excitation.directions;
        let joint = unseen.joint.as_deref().unwrap_or("several joints at once");
        all.push(Remedy {
            problem: format!(
                "the logs show {logs} of {robot} identifiable combinations; {} more would come from moving {joint}",
                unseen.directions
            ),
            how: format!(
                "for the next log: {}",
                twincal::excitation::sentence(unseen)
            ),
            wrong: false,
            when: When::NextLog,
            rank: ORDER.len() + 3,
        });
    }
    all.sort_by_key(|remedy| remedy.rank);
    all
}

fn of_finding(finding: &Finding, examination: &Examination) -> Remedy {
    let place = ORDER.iter().position(|(code, _)| *code == finding.code);
    let how = match (finding.code, place) {
        (Code::TorqueLag, _) if finding.subject.is_empty() => {
            "twincal.toml: [signal] lag = \"auto\"".into()
        }
        (Code::SignFlip, _) => match of_joint(examination, &finding.subject) {
            Some(check) => {
                let or_the_axis = if is_axis(check) {
                    ", or turn the axis in the model"
                } else {
                    ""
                };
                let line = sign_line(check);
                format!("twincal.toml: {line} (twincal init writes it){or_the_axis}")
            }
            None => "turn the sign of the columns where the log is made".into(),
        },
        (Code::TorqueScale, Some(place)) => {
            let check = match finding.subject.is_empty() {
                true => examination.checkup.joints.first(),
                false => of_joint(examination, &finding.subject),
            };
            let gain = |check: &JointCheck| check.gain.filter(|gain| *gain > 0.0);
            let joint = key(&finding.subject);
            match check.map(|check| (check.torque_factor, gain(check))) {
                Some((Some(factor), _)) => {
                    let number = match finding.subject.is_empty() {
                        true => format!("{factor:?}"),
                        false => format!("{{ {joint} = {factor:?} }}"),
                    };
                    format!(
                        "twincal.toml: [columns.factor] tau = {number} (twincal init writes it)"
                    )
                }
                // Of all joints together no one joint's number speaks.
                Some((None, Some(gain))) if !finding.subject.is_empty() => {
                    let number = 1.0 / gain;
                    format!(
                        "{}; here about {{ {joint} = {number:.2e} }}",
                        ORDER[place].1
                    )
                }
                _ => ORDER[place].1.into(),
            }
        }
        (Code::BaseOrientation, _) => match &examination.checkup.base {
            Some(base) => format!(
                "twincal.toml: [model] {} (twincal init writes it)",
                base.line()
            ),
            None => "twincal.toml: [model] base".into(),
        },
        (Code::QuantisedEncoder, _) => match examination.lower_cutoff {
            Some(hz) => format!(
                "twincal.toml: [signal] cutoff_hz = {hz:?}, or log the encoder's full resolution"
            ),
            None => "log the full resolution of the encoder".into(),
        },
        (_, Some(place)) => ORDER[place].1.into(),
        (_, None) => "read the message; the report of `twincal fit` repeats it".into(),
    };
    let goes_ahead = examination.refusals.is_empty() && finding.severity < Severity::Degraded;
    let when = When::of(&how, goes_ahead);
    let how = match when {
        When::NextLog => format!("{FOR_THE_NEXT} {how}"),
        When::Now | When::Never => how,
    };
    // Of the same place in the order, what is degraded comes before what is only doubtful.
    let rank = if finding.severity == Severity::Degraded {
        1
    } else {
        2
    };
    Remedy {
        problem: if finding.subject.is_empty() || finding.message.contains(&finding.subject) {
            finding.message.clone()
        } else {
            format!("{}: {}", finding.subject, finding.message)
        },
        how,
        wrong: true,
        when,
        rank: rank + place.unwrap_or(ORDER.len()),
    }
}

fn of_joint<'a>(examination: &'a Examination, joint: &str) -> Option<&'a JointCheck> {
    let mut joints = examination.checkup.joints.iter();
    joints.find(|check| check.joint == joint)
}

/// The lag to write into the config, s to a tenth of a millisecond, where it is clear.
pub(super) fn lag(examination: &Examination) -> Option<f64> {
    let lags = examination.checkup.lags.as_ref()?;
    let [lag, _] = lags.common.filter(|_| lags.clear)?;
    Some((lag * 1e4).round() / 1e4)
}

#[cfg(test)]
mod tests {
    use super::When;

    #[test]
    fn what_needs_another_recording_is_for_the_next_log_where_the_fit_goes_ahead() {
        for (how, goes_ahead, when) in [
            (
                "log the full resolution of the encoder",
                true,
                When::NextLog,
            ),
            ("log the full resolution of the encoder", false, When::Now),
            ("record a slower motion", true, When::NextLog),
            (
                "twincal.toml: [signal] cutoff_hz = 4.0, or log more",
                true,
                When::Now,
            ),
            ("nothing: left out", true, When::Never),
        ] {
            assert_eq!(When::of(how, goes_ahead), when, "{how}");
        }
    }
}
