//! What of what was found may be rested on, one sentence for each use that is made of a twin: friction, masses, gravity and so on.

use super::figures::inclusion::family_name;
use super::grounds::{NAMED, SURE};
use super::reservations::no_bodies;
use super::standing::{Standing, standing, why_suspected};
use super::text::{first_of, list};
use twincal::calibrate::{Calibration, ComponentSummary};
use twincal::term::Family;

/// Effects up to this number are named.
const FEW_EFFECTS: usize = 3;
/// Effects that stand every check, beside others that do not, are those to use: so many are named.
const NAMED_FIRM: usize = 8;

/// Families that a reader uses for the same purpose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Use {
    Friction,
    Joints,
    Inertia,
    Gravity,
    Lagrangian,
}

impl Use {
    const ALL: [Self; 5] = [
        Self::Friction,
        Self::Inertia,
        Self::Gravity,
        Self::Joints,
        Self::Lagrangian,
    ];

    fn of(family: Family) -> Self {
        match family {
            Family::Viscous
            | Family::Coulomb
            | Family::Asymmetry
            | Family::Stribeck
            | Family::QuadraticFriction
            | Family::LoadFriction
            | Family::CoupledFriction
            | Family::Hysteresis
            | Family::WarmUp => Self::Friction,
            Family::Payload
            | Family::PayloadTensor
            | Family::MassMoments
            | Family::Tensor
            | Family::MassScale
            | Family::MotorInertia
            | Family::CoupledInertia => Self::Inertia,
            Family::Tilt => Self::Gravity,
            Family::Offset
            | Family::Spring
            | Family::Potential
            | Family::Gain
            | Family::EncoderZero
            | Family::Ripple => Self::Joints,
            Family::User | Family::Generic => Self::Lagrangian,
        }
    }

    fn title(self) -> &'static str {
        match self {
            Self::Friction => "Friction",
            Self::Joints => "Offsets, springs and drives",
            Self::Inertia => "Masses and inertias",
            Self::Gravity => "Direction of gravity",
            Self::Lagrangian => "Terms of the Lagrangian",
        }
    }
}

/// A sentence for each use of which something was found or is suspected.
pub(super) fn sentences(calibration: &Calibration) -> Vec<String> {
    let of = |purpose: Use| {
        let all = calibration.components.iter();
        let all = all.filter(|own| Use::of(own.family) == purpose);
        let all: Vec<(&ComponentSummary, Standing)> = all
            .filter_map(|own| Some((own, standing(own, calibration)?)))
            .collect();
        (!all.is_empty())
            .then(|| sentence(purpose.title(), &all, &at_least_one(purpose, calibration)))
    };
    Use::ALL.into_iter().filter_map(of).collect()
}

/// "at least one of a and b is there": what is sure where each is only suspected, at the use of the first of them.
fn at_least_one(purpose: Use, calibration: &Calibration) -> Vec<String> {
    let groups = calibration.groups.iter().filter(|group| group.pip > SURE);
    let told = groups.filter_map(|group| {
        let of = |name: &String| calibration.components.iter().find(|own| own.name == *name);
        let likely = group.members.iter().filter_map(of);
        let mut likely = likely
            .filter_map(|own| Some((own, standing(own, calibration)?)))
            .peekable();
        let first = Use::of(likely.peek()?.0.family);
        let open = likely.all(|(_, own)| own == Standing::Suspected);
        (open && first == purpose).then(|| {
            let named = first_of(group.members.clone(), NAMED);
            format!("at least one of {} is there", list(&named))
        })
    });
    told.collect()
}

/// "Friction: viscous friction (6) and Coulomb friction (6) found, 7 stand every check, 5 have a doubt; only suspected: a, b and c."
fn sentence(title: &str, all: &[(&ComponentSummary, Standing)], sure: &[String]) -> String {
    let with = |wanted: Standing| all.iter().filter(move |(_, own)| *own == wanted).count();
    let found = all.iter().filter(|(_, own)| *own != Standing::Suspected);
    let found: Vec<&ComponentSummary> = found.map(|(own, _)| *own).collect();
    let suspected = all.iter().filter(|(_, own)| *own == Standing::Suspected);
    let suspected: Vec<String> = suspected.map(|(own, _)| own.name.clone()).collect();
    let told = match found.len() {
        0 => "none is sure by itself".into(),
        1..=FEW_EFFECTS => {
            let names: Vec<&str> = found.iter().map(|own| own.name.as_str()).collect();
            format!("{} found", list(&names))
        }
        _ => {
            let kinds = found.chunk_by(|a, b| a.family == b.family);
            let kinds: Vec<String> = kinds
                .map(|own| format!("{} ({})", family_name(own[0].family), own.len()))
                .collect();
            format!("{} found", list(&kinds))
        }
    };
    let firm = all.iter().filter(|(_, own)| *own == Standing::Stands);
    let firm: Vec<String> = firm.map(|(own, _)| own.name.clone()).collect();
    let checked = match (with(Standing::Stands), with(Standing::Doubted)) {
        (0, 0) => String::new(),
        (1, 0) => ", which stands every check".into(),
        (_, 0) => ", which stand every check".into(),
        (0, 1) => ", with a doubt (in the report’s table of effects)".into(),
        (0, _) => ", each with a doubt (in the report’s table of effects)".into(),
        (stand, doubted) => format!(
            "; {stand} {} every check ({}), {doubted} {} (in the report’s table of effects)",
            if stand == 1 { "stands" } else { "stand" },
            list(&first_of(firm, NAMED_FIRM)),
            if doubted == 1 {
                "has a doubt"
            } else {
                "have a doubt"
            }
        ),
    };
    let suspected = match suspected.is_empty() {
        true => String::new(),
        false => format!("; only suspected: {}", list(&first_of(suspected, NAMED))),
    };
    let sure: String = sure.iter().map(|one| format!("; {one}")).collect();
    format!("{title}: {told}{checked}{suspected}{sure}.")
}

/// What is only suspected and why, all uses together, the gravest first; `None` where nothing is.
pub(super) fn suspected(calibration: &Calibration) -> Option<String> {
    let all = calibration.components.iter();
    let mut all: Vec<(&ComponentSummary, String)> = all
        .filter_map(|own| {
            let why = why_suspected(own, calibration).into_iter().next()?;
            Some((own, why))
        })
        .collect();
    // A body that is none contradicts physics; of others the data leave the inertia open.
    all.sort_by_key(|(own, _)| (!own.no_rigid_body, own.rigid_share.is_none()));
    let bodies = no_bodies(calibration);
    let told: Vec<String> = (all.iter())
        .map(|(own, why)| format!("{} ({why})", own.name))
        .collect();
    let told = first_of(told, NAMED);
    (!told.is_empty()).then(|| {
        format!(
            "Only suspected, not to be rested on by themselves (predicted torque has them): {}{}.{}",
            list(&told),
            if all.len() > NAMED { ", marked in the report’s table of effects" } else { "" },
            match bodies.is_empty() {
                true => String::new(),
                false => format!(
                    " Hardly any body can have what was found of {}: an effect is missing among the candidates, or the model’s inertias are wrong.",
                    list(&bodies)
                ),
            }
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::calibrate::{Alike, Group, Verdict};
    use twincal::{Finding, Severity};

    fn plain() -> Calibration {
        let mut calibration = fixture::two_joints();
        calibration.findings.clear();
        calibration.repeatability.clear();
        let terms = calibration.terms.iter_mut();
        terms.for_each(|term| term.pip_sensitivity.clear());
        calibration
    }

    /// The components of one use, the first of them changed.
    fn told(families: &[Family], change: impl Fn(usize, &mut ComponentSummary)) -> Vec<String> {
        let mut calibration = plain();
        let own = calibration.components[0].clone();
        let component = |(index, family): (usize, &Family)| {
            let mut own = own.clone();
            (own.family, own.name) = (*family, format!("joint{index}.x"));
            own.selected = true;
            change(index, &mut own);
            own
        };
        calibration.components = families.iter().enumerate().map(component).collect();
        sentences(&calibration)
    }

    #[test]
    fn few_are_named_many_are_counted_and_each_use_has_its_own() {
        let three = told(&[Family::Viscous, Family::Tilt, Family::User], |_, _| ());
        assert_eq!(
            three,
            [
                "Friction: joint0.x found, which stands every check.",
                "Direction of gravity: joint1.x found, which stands every check.",
                "Terms of the Lagrangian: joint2.x found, which stands every check.",
            ]
        );
        let viscous = [Family::Viscous; 3];
        let many = [&viscous[..], &[Family::Coulomb; 2]].concat();
        assert_eq!(
            told(&many, |_, _| ()),
            [
                "Friction: viscous friction (3) and Coulomb friction (2) found, which stand every check."
            ]
        );
    }

    #[test]
    fn doubts_about_numbers_are_counted_apart_and_what_is_suspected_is_named() {
        let masses = [Family::MassMoments; 6];
        let none = told(&masses[..2], |_, own| own.rigid_share = Some(0.02));
        assert_eq!(
            none,
            ["Masses and inertias: none is sure by itself; only suspected: joint0.x and joint1.x."]
        );
        let some = told(&masses, |index, own| {
            if index < 4 {
                own.verdict = Some(Verdict::Undecided);
            }
            if index == 5 {
                own.told_as = Some(vec!["other".into()]);
            }
        });
        assert_eq!(
            some,
            [
                "Masses and inertias: joint4.x and joint5.x found; 1 stands every check (joint4.x), 1 has a doubt (in the report’s table of effects); only suspected: \
                 joint0.x, joint1.x, joint2.x and 1 more."
            ]
        );
    }

    #[test]
    fn of_which_at_least_one_is_there_is_said_where_each_is_only_suspected() {
        let of = |verdict: Verdict, pip: f64| {
            let mut calibration = plain();
            let mut own = calibration.components[0].clone();
            (own.family, own.selected) = (Family::Spring, true);
            (own.name, own.verdict) = ("elbow.spring".into(), Some(verdict));
            calibration.components = vec![own];
            calibration.groups = vec![Group {
                members: vec!["elbow.spring".into(), "elbow.potential".into()],
                pip,
                alike: Alike::EveryMotion,
                settled: false,
                words: String::new(),
            }];
            sentences(&calibration).remove(0)
        };
        let said = "; at least one of elbow.spring and elbow.potential is there.";
        assert!(of(Verdict::Undecided, 0.99).ends_with(said));
        assert!(!of(Verdict::Undecided, 0.9).contains("at least"));
        assert!(!of(Verdict::Found, 0.99).contains("at least"));
    }

    #[test]
    fn what_contradicts_physics_is_suspected_first() {
        let mut calibration = plain();
        assert_eq!(suspected(&calibration), None);
        let mut found = calibration.components.iter_mut().filter(|own| own.selected);
        let first = found.next().unwrap();
        first.verdict = Some(Verdict::Undecided);
        let first = first.name.clone();
        found.next().unwrap().rigid_share = Some(0.4);
        let body = found.next().unwrap();
        (body.rigid_share, body.no_rigid_body) = (Some(0.01), true);
        let body = body.name.clone();
        let open = calibration.components.iter();
        let open = open.filter(|own| own.selected).nth(1).unwrap().name.clone();
        let said = format!(
            "Only suspected, not to be rested on by themselves (predicted torque has them): {body} (no rigid body in 99.0\u{202f}% of the draws), \
             {open} (no rigid body in 60.0\u{202f}% of the draws) and {first} (undecided). \
             Hardly any body can have what was found of forearm: an effect is missing among the candidates, or the model’s inertias are wrong."
        );
        calibration.findings = vec![Finding::new(
            Severity::Warning,
            "unphysical_inertia_found",
            "forearm",
            "",
            0,
        )];
        assert_eq!(suspected(&calibration), Some(said));
    }
}
