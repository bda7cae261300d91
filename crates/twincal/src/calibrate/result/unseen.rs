//! What the fit logs do not show, why, and which motion would.

use super::calibration::Calibration;
use super::status::{Status as Said, StatusReason};
use crate::error::{Code, Finding, Severity};
use crate::excitation::{Excitation, Seen, States, excitation as compare, sentence};
use crate::gram::Gram;
use crate::robot::Robot;
use crate::term::{Family, Library, Status};

/// Sentences at most.
const TOLD: usize = 5;
/// Names that a sentence holds at most.
const NAMES: usize = 4;

/// What the fit logs, whose statistics are `gram` and of which these are some states, show of all candidates, those included whose columns (`dropped`) are zero on
/// all rows.
pub(in crate::calibrate) fn excitation(
    robot: &Robot,
    library: &Library,
    dropped: &[usize],
    gram: &Gram,
    states: &States,
) -> Excitation {
    let kept: Vec<u32> = (0..library.columns().len())
        .filter(|column| !dropped.contains(column))
        .map(|column| column as u32)
        .collect();
    let mut joints = gram.joints.clone();
    for joint in &mut joints {
        let columns = joint.columns.iter_mut();
        columns.for_each(|column| *column = kept[*column as usize]);
    }
    compare(robot, library, &Gram { joints }, states)
}

/// Says what is not seen and why: in findings, and in the words of the components.
pub(in crate::calibrate) fn tell(calibration: &mut Calibration, excitation: &Excitation) {
    let Hidden {
        mut weak,
        mut never,
    } = reasons(calibration, excitation);
    // What others tell is not lost.
    let unseen: Vec<&String> = calibration.unseen().map(|own| &own.name).collect();
    weak.retain(|name| unseen.contains(&name));
    never.retain(|name| unseen.contains(&name));
    let mut findings = Vec::new();
    // What hides only behind absent candidates is nobody's question.
    let matters = |name: &String| {
        let summary = calibration.components.iter().find(|c| c.name == *name);
        summary.is_some_and(|c| c.status != Said::Absent)
    };
    let asked = excitation
        .unseen
        .iter()
        .filter(|unseen| !unseen.nothing_of.is_empty() || unseen.not_apart.iter().any(matters));
    for unseen in asked.take(TOLD) {
        findings.push(Finding::new(
            Severity::Note,
            Code::UnseenMotion,
            unseen.joint.clone().unwrap_or_default(),
            sentence(unseen),
            unseen.directions as u64,
        ));
    }
    if !weak.is_empty() {
        let message = format!(
            "not seen: {}; their torque in these logs is small against the noise: move faster, or log longer",
            some(&weak)
        );
        findings.push(not_seen(message, &weak));
    }
    if !never.is_empty() {
        let message = format!(
            "not seen: {}; in every motion of this robot their torque is also that of other candidates",
            some(&never)
        );
        findings.push(not_seen(message, &never));
    }
    calibration.findings.extend(findings);
}

/// Names of components that no motion of one joint would show.
#[derive(Default)]
struct Hidden {
    /// Whose torque is small against the noise.
    weak: Vec<String>,
    /// Whose torque is that of others in every motion.
    never: Vec<String>,
}

/// Why a component is not seen, in its words.
fn reasons(calibration: &mut Calibration, excitation: &Excitation) -> Hidden {
    let mut hidden = Hidden::default();
    for (component, excited) in calibration
        .components
        .iter_mut()
        .zip(&excitation.components)
    {
        let is_zero = |name: &String| {
            let term = calibration.terms.iter().find(|t| t.term.name == *name);
            term.is_some_and(|t| t.term.status == Status::ZeroColumn)
        };
        if component.reason == StatusReason::NoColumn && component.columns.iter().any(is_zero) {
            component.reason = StatusReason::NoTorqueInLogs;
        }
        if !component.is_unseen() {
            continue;
        }
        let joints = excitation.unseen.iter().filter(|unseen| {
            let in_list = |list: &[String]| list.contains(&component.name);
            in_list(&unseen.nothing_of) || in_list(&unseen.not_apart)
        });
        let joints: Vec<String> = joints
            .filter_map(|unseen| Some(format!("`{}`", unseen.joint.as_ref()?)))
            .collect();
        let why = if !joints.is_empty() {
            format!("move {} more", joints.join(" and "))
        } else if component.family == Family::Hysteresis {
            "the joint travels too little in these logs".to_owned()
        } else if excited.seen == Seen::Never {
            "no motion of this robot shows it".to_owned()
        } else if !component.alias_of.is_empty() {
            hidden.never.push(component.name.clone());
            let others = some(&component.alias_of);
            format!("in every motion of this robot its torque is also that of {others}")
        } else {
            hidden.weak.push(component.name.clone());
            "its torque in these logs is small against the noise: move faster, or log longer"
                .to_owned()
        };
        component.words = format!("{}: not seen: {why}", component.story);
    }
    hidden
}

fn not_seen(message: String, names: &[String]) -> Finding {
    let (subject, count) = (names.join(", "), names.len() as u64);
    Finding::new(Severity::Note, Code::NotSeen, subject, message, count)
}

/// "a, b and 3 more".
fn some(names: &[String]) -> String {
    if names.len() > NAMES {
        let (shown, rest) = names.split_at(NAMES - 1);
        return format!("{} and {} more", shown.join(", "), rest.len());
    }
    names.join(", ")
}
