//! What to fix, the most important first, each with a number and a line to type or to write.

use super::super::summary::about;
use super::columns::{is_axis, sign_line};
use super::examine::Examination;
use serde::Serialize;
use std::fmt::Write as _;
use twincal::self_check::JointCheck;
use twincal::{Code, Finding, Severity};
use twincal_io::config::key;
use twincal_io::words::{When, remedy};

/// One thing to fix.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Advice {
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

/// What stands before a remedy that is for the next log: of a published one there is no other.
const FOR_THE_NEXT: &str = "nothing has to be done for this log; for the next one:";
/// Rank of findings without a remedy of their own.
const LAST: usize = usize::MAX / 2;

/// All of them, ranked.
pub(super) fn remedies(examination: &Examination) -> Vec<Advice> {
    let mut all: Vec<Advice> = examination
        .refusals
        .iter()
        .map(|refusal| Advice {
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
    for ((_, more), advice) in said.iter().zip(&mut all[first..]) {
        if *more > 0 {
            let _ = write!(advice.problem, " ({more} more like this, --json)");
        }
    }
    all.extend(of_excitation(examination));
    all.sort_by_key(|advice| advice.rank);
    all
}

/// Which motion would show most of what these logs do not.
fn of_excitation(examination: &Examination) -> Option<Advice> {
    let excitation = examination.outlook.as_ref()?.excitation.as_ref()?;
    let unseen = excitation.unseen.first()?;
    let [robot, logs] = excitation.directions;
    let joint = unseen.joint.as_deref().unwrap_or("several joints at once");
    Some(Advice {
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
        rank: LAST + 3,
    })
}

/// What to do about one finding.
fn of_finding(finding: &Finding, examination: &Examination) -> Advice {
    let known = remedy(finding.code);
    let own = own_remedy(finding, examination);
    let (when, how) = match (own, known) {
        (Some(how), _) => (When::Now, how),
        (None, Some((_, known))) => (known.when, known.text.to_owned()),
        (None, None) => (
            When::Now,
            "read the message; the report of `twincal fit` repeats it".into(),
        ),
    };
    // A log without which the fit does not go ahead has to be recorded now.
    let goes_ahead = examination.refusals.is_empty() && finding.severity < Severity::Degraded;
    let (when, how) = match when {
        When::NextLog if goes_ahead => (when, format!("{FOR_THE_NEXT} {how}")),
        When::NextLog => (When::Now, how),
        When::Now | When::Never => (when, how),
    };
    // Of the same place in the order, what is degraded comes before what is only doubtful.
    let doubtful = usize::from(finding.severity < Severity::Degraded);
    let place = known.map_or(LAST, |(place, _)| place);
    Advice {
        problem: about(&[finding.subject.as_str()], finding.code) + &finding.message,
        how,
        wrong: true,
        when,
        rank: place + 1 + doubtful,
    }
}

/// What these logs themselves say about a remedy: a line of twincal.toml with its number.
fn own_remedy(finding: &Finding, examination: &Examination) -> Option<String> {
    let init = "(twincal init writes it)";
    match finding.code {
        Code::TorqueLag if finding.subject.is_empty() => {
            Some("twincal.toml: [signal] lag = \"auto\"".into())
        }
        Code::SignFlip => Some(match of_joint(examination, &finding.subject) {
            Some(check) => {
                let or_the_axis = if is_axis(check) {
                    ", or turn the axis in the model"
                } else {
                    ""
                };
                let line = sign_line(check);
                format!("twincal.toml: {line} {init}{or_the_axis}")
            }
            None => "turn the sign of the columns where the log is made".into(),
        }),
        Code::TorqueScale => torque_factor(finding, examination),
        Code::BaseOrientation => {
            let base = examination.checkup.base.as_ref()?;
            Some(format!("twincal.toml: [model] {} {init}", base.line()))
        }
        Code::QuantisedEncoder => examination.lower_cutoff.map(|hz| {
            format!(
                "twincal.toml: [signal] cutoff_hz = {hz:?}, or log the encoder's full resolution"
            )
        }),
        _ => None,
    }
}

/// The factor of the torque of one joint, or of all of them.
fn torque_factor(finding: &Finding, examination: &Examination) -> Option<String> {
    let check = match finding.subject.is_empty() {
        true => examination.checkup.joints.first(),
        false => of_joint(examination, &finding.subject),
    }?;
    let joint = key(&finding.subject);
    if let Some(factor) = check.torque_factor {
        let number = match finding.subject.is_empty() {
            true => format!("{factor:?}"),
            false => format!("{{ {joint} = {factor:?} }}"),
        };
        return Some(format!(
            "twincal.toml: [columns.factor] tau = {number} (twincal init writes it)"
        ));
    }
    // Of all joints together no one joint's number speaks.
    let gain = check.gain.filter(|gain| *gain > 0.0);
    let gain = gain.filter(|_| !finding.subject.is_empty())?;
    let (_, known) = remedy(Code::TorqueScale)?;
    let number = 1.0 / gain;
    Some(format!(
        "{}; here about {{ {joint} = {number:.2e} }}",
        known.text
    ))
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
