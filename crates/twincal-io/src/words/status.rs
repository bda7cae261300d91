//! An effect's status and its one reason, in words.

use super::NAMED;
use super::list::{first_of, list};
use super::number::{number, percent, probability};
use twincal::calibrate::{
    Alike, Calibration, ComponentSummary, LeftOutData, LeftOutError, Status, StatusReason,
};

/// Why a component has its status: "lowers the error of left-out logs by 12.0 % (5.3 standard errors)"; empty where its probability says it all.
#[must_use]
pub fn reason(component: &ComponentSummary) -> String {
    match &component.reason {
        StatusReason::Probability => String::new(),
        StatusReason::LeftOut(error) => left_out(error),
        StatusReason::SameTorque {
            members,
            pip,
            alike,
        } => {
            let others = members.iter().filter(|name| **name != component.name);
            let others = first_of(others.cloned().collect(), NAMED);
            let kind = match alike {
                Alike::EveryMotion => "structurally",
                Alike::TheseLogs => "in these logs only",
            };
            let (others, pip) = (list(&others), probability(*pip));
            format!("same torque as {others}, {kind}; P(at least one) {pip}")
        }
        StatusReason::NoRigidBody { chance } => {
            format!("physically inconsistent (p-value {})", probability(*chance))
        }
        StatusReason::WideAsPrior => "as wide as the prior".into(),
        StatusReason::NoTorqueInLogs => "no torque in these logs".into(),
        StatusReason::NoColumn => "no torque of its own".into(),
    }
}

fn left_out(error: &LeftOutError) -> String {
    let data = match error.left_out {
        LeftOutData::Logs => "left-out logs",
        LeftOutData::Fifths => "left-out fifths",
    };
    let sds = number(error.standard_errors.abs(), 2);
    let size = percent(error.lowered.abs());
    if error.is_clear() {
        format!("lowers the error of {data} by {size} ({sds} standard errors)")
    } else if error.lowered > 0.0 {
        let [sds, needed] = apart(error.standard_errors.abs(), error.needed);
        format!("lowers the error of {data} by {size}, {sds} standard errors ({needed} needed)")
    } else {
        format!("does not lower the error of {data}")
    }
}

/// Two numbers with two digits, or as many as show that they differ.
fn apart(one: f64, other: f64) -> [String; 2] {
    let shown = |digits| [one, other].map(|own| number(own, digits));
    let differ = |own: &[String; 2]| own[0] != own[1];
    let mut all = (2..=4).map(shown);
    all.find(differ).unwrap_or_else(|| shown(4))
}

/// Names of the effects with this status that are likelier in than not.
pub(crate) fn with(status: Status, calibration: &Calibration) -> Vec<&ComponentSummary> {
    let all = calibration.components.iter();
    all.filter(|own| own.status == status && own.is_in())
        .collect()
}

#[cfg(all(test, feature = "report"))]
mod tests {
    use super::*;
    use crate::report::fixture;

    #[test]
    fn every_reason_is_one_phrase() {
        let of = |reason: StatusReason| {
            let mut own = fixture::two_joints().components[0].clone();
            (own.name, own.reason) = ("a.tensor".into(), reason);
            self::reason(&own)
        };
        let error = |lowered: f64, standard_errors: f64| {
            StatusReason::LeftOut(LeftOutError {
                left_out: LeftOutData::Logs,
                blocks: 40,
                lowered,
                standard_errors,
                needed: 2.06,
            })
        };
        assert_eq!(
            of(error(0.12, 5.31)),
            "lowers the error of left-out logs by 12.0\u{202f}% (5.3 standard errors)"
        );
        assert_eq!(
            of(error(0.008, 1.2)),
            "lowers the error of left-out logs by 0.8\u{202f}%, 1.2 standard errors (2.1 needed)"
        );
        assert_eq!(
            of(error(0.008, 2.052)),
            "lowers the error of left-out logs by 0.8\u{202f}%, 2.05 standard errors (2.06 needed)"
        );
        assert_eq!(
            of(error(-0.1, -3.0)),
            "does not lower the error of left-out logs"
        );
        let same = |alike| StatusReason::SameTorque {
            members: ["b.tensor", "a.tensor"].map(str::to_owned).to_vec(),
            pip: 0.98,
            alike,
        };
        assert_eq!(
            of(same(Alike::EveryMotion)),
            "same torque as b.tensor, structurally; P(at least one) 0.980"
        );
        assert!(of(same(Alike::TheseLogs)).contains(", in these logs only;"));
        assert_eq!(
            of(StatusReason::NoRigidBody { chance: 0.002 }),
            "physically inconsistent (p-value 0.002)"
        );
        assert_eq!(of(StatusReason::Probability), "");
    }
}
