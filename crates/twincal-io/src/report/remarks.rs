//! What is to be minded about an effect before its numbers are used: it stands at the effect's own line.

use super::halves::{repeats, whole_against_halves};
use super::standing::{by_another_prior, no_body, why_suspected};
use super::text::{first_of, list, number, percent};
use twincal::calibrate::{Alike, Calibration, ComponentSummary, ParameterSummary, Verdict};
use twincal::term::Family;

/// Rivals that are named; the others are counted.
const NAMED: usize = 2;
/// Change of the size of gravity, as a share, that no place on earth explains.
const SIZE_OF_GRAVITY: f64 = 0.01;

/// Remarks on a component, the gravest first.
pub(super) fn remarks(component: &ComponentSummary, calibration: &Calibration) -> Vec<String> {
    let first = component.parameters.first().map(ParameterSummary::told);
    let negative = first.and_then(|(value, spread)| component.family.remark(value, spread));
    let mut out: Vec<String> = negative.map(str::to_owned).into_iter().collect();
    out.extend(of_the_file(component, calibration));
    out.extend(all_friction(component, calibration));
    out.extend(doubts(component, calibration));
    out
}

/// The joint of a component that belongs to one.
fn joint_of(component: &ComponentSummary) -> Option<&str> {
    component.name.rsplit_once('.').map(|(joint, _)| joint)
}

/// Friction is all of it where what the model file states is no part of the nominal torque.
fn all_friction(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let is_stated = |joint: &str| {
        let mut findings = calibration.findings.iter();
        findings.any(|f| f.code == "urdf_dynamics" && f.subject == joint)
    };
    let friction = [Family::Viscous, Family::Coulomb].contains(&component.family);
    (friction && component.selected && joint_of(component).is_some_and(is_stated))
        .then(|| "all of it: what your model file states is not counted".into())
}

/// Motor inertia of a joint whose link has no tensor in the model.
fn of_a_point_mass(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let joint = joint_of(component).filter(|_| component.family == Family::MotorInertia)?;
    let joints = &calibration.twin.robot.description().joints;
    let link = &joints.iter().find(|own| own.name == joint)?.child;
    let mut findings = calibration.findings.iter();
    (component.selected && findings.any(|f| f.code == "point_mass" && f.subject == *link))
        .then(|| format!("has in it the tensor that {link} lacks in your model"))
}

/// What is found on a joint alone whose rows count as few.
fn few_rows(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let joint = joint_of(component)?;
    let mut findings = calibration.findings.iter();
    (component.selected && findings.any(|f| f.code == "few_effective_rows" && f.subject == joint))
        .then(|| format!("the rows of {joint} count as few independent ones"))
}

/// What the model says of a tensor's numbers that are told, and what it would have to say: known where nothing else of the link was found.
fn of_the_file(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let link = component.name.strip_suffix(".tensor")?;
    let levels = ["density", "mass_moments"].map(|level| format!("{link}.{level}"));
    let mut found = calibration.components.iter().filter(|other| other.selected);
    let robot = &calibration.twin.robot;
    let last = robot.links_of_body(robot.bodies().len().saturating_sub(1));
    let alone = !found.any(|other| {
        levels.contains(&other.name) || other.family.is_payload() && last.contains(&link)
    });
    let links = &robot.description().links;
    let inertia = links.iter().find(|own| own.name == link)?.inertia?;
    // Links that are fixed to it are part of the body whose tensor changes.
    let of_body = match robot.body_of_link(link) {
        Some((body, _)) => robot.links_of_body(body),
        None => Vec::new(),
    };
    let heavy = links.iter().filter(|own| own.inertia.is_some());
    if heavy
        .filter(|own| of_body.contains(&own.name.as_str()))
        .count()
        > 1
    {
        return None;
    }
    let axis = |letter: char| "xyz".find(letter);
    let told = component.parameters.iter().filter_map(|parameter| {
        let mut letters = parameter.name.strip_prefix('i')?.chars();
        let (i, j) = (axis(letters.next()?)?, axis(letters.next()?)?);
        let before = inertia.tensor[i][j];
        let (change, _) = parameter.told();
        let worth = parameter.seen && i == j && before > 0.0 && change.is_finite();
        worth.then(|| {
            format!(
                "{} {} → {} ({}{})",
                parameter.name,
                number(before, 3),
                number(before + change, 3),
                if change > 0.0 { "+" } else { "" },
                percent(change / before)
            )
        })
    });
    let told: Vec<String> = told.take(3).collect();
    (component.selected && alone && !told.is_empty())
        .then(|| format!("in your model {}", told.join(", ")))
}

/// Of these, what speaks against the effect or its numbers: not what explains a sign.
pub(super) fn doubts(component: &ComponentSummary, calibration: &Calibration) -> Vec<String> {
    let mut out = Vec::new();
    out.extend(size_of_gravity(component, calibration));
    let open = match component.no_rigid_body {
        true => "do not read it as mass or inertia",
        false => "these logs leave its inertia open",
    };
    out.extend(no_body(component, calibration).map(|share| format!("{share}: {open}")));
    out.extend(few_rows(component, calibration));
    out.extend(of_a_point_mass(component, calibration));
    out.extend(rivals(component, calibration));
    out.extend(repeats(component, calibration));
    if let Some(against) = whole_against_halves(component, calibration) {
        out.push(format!(
            "all data together do not say what the two halves say: {against}"
        ));
    }
    out.extend(hangs_on(component, calibration));
    out.extend(by_another_prior(component, calibration));
    if component.parameters.iter().any(ParameterSummary::is_split) {
        out.push("some models put a number of it far off".into());
    }
    if moves_with_the_cutoff(component, calibration) {
        out.push("its mean over all models, in or out, moves with the filter's cut-off by more than its sd".into());
    }
    out
}

/// Friction that is told together with a change of it that is undecided, only suspected, or another one in both halves.
fn hangs_on(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let changes = [
        Family::QuadraticFriction,
        Family::Stribeck,
        Family::Asymmetry,
    ];
    let is_friction = changes.contains(&component.family)
        || [Family::Viscous, Family::Coulomb].contains(&component.family);
    if !is_friction {
        return None;
    }
    let joint = component.name.rsplit_once('.')?.0;
    let mut others = calibration.components.iter();
    let undecided = |other: &ComponentSummary| other.verdict == Some(Verdict::Undecided);
    let against = |other: &ComponentSummary| {
        other.selected && whole_against_halves(other, calibration).is_some()
    };
    let suspected = |other: &ComponentSummary| !why_suspected(other, calibration).is_empty();
    let open = others.find(|other| {
        other.name != component.name
            && changes.contains(&other.family)
            && (undecided(other) || against(other) || suspected(other))
            && (other.name.rsplit_once('.')).is_some_and(|(own, _)| own == joint)
    })?;
    let why = match (undecided(open), against(open)) {
        (true, _) => "which is undecided",
        (_, true) => "on which the halves say something else",
        _ => "which is only suspected",
    };
    Some(format!("its value hangs on {}, {why}", open.name))
}

/// What else may be behind the same torque.
fn rivals(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let mut groups = calibration.groups.iter();
    let own = |names: &[String]| names.contains(&component.name);
    // Of a spring beside the offset of its joint it is the preload that is alike.
    let joint = joint_of(component).unwrap_or_default();
    let told = |name: &String| match component.family {
        Family::Offset if *name == format!("{joint}.spring") => format!("{name} (its preload)"),
        Family::Spring if *name == format!("{joint}.offset") => format!("{name} (by its preload)"),
        _ => name.clone(),
    };
    let others = |names: &[String]| {
        let others = names.iter().filter(|name| **name != component.name);
        list(&first_of(others.map(told).collect(), NAMED))
    };
    let place = |alike: Alike| match alike {
        Alike::TheseLogs => "in these logs",
        Alike::EveryMotion => "in every motion",
    };
    let group = groups.find(|group| own(&group.members) && !group.settled);
    match group {
        Some(group) => Some(format!(
            "not to be told from {} {}{}",
            others(&group.members),
            place(group.alike),
            if group.members.len() > 2 {
                ", directly or by way of others"
            } else {
                ""
            }
        )),
        None => {
            let mut all = calibration.groups.iter();
            let Some(settled) = all.find(|group| own(&group.members)) else {
                // Others have its torque together, and the prior prefers the one that does it alone.
                let spanned = component.selected && !component.names_beside().is_empty();
                return spanned.then(|| {
                    format!(
                        "its torque is also that of {} in every motion; the prior prefers {}",
                        others(component.names_beside()),
                        component.name
                    )
                });
            };
            let first = settled.members.first()?;
            let place = place(settled.alike);
            Some(if *first == component.name {
                format!(
                    "can be told as {} {place}; the prior prefers {first}",
                    others(&settled.members)
                )
            } else {
                format!(
                    "can be told as {} {place}, which the prior prefers",
                    told(first)
                )
            })
        }
    }
}

/// A tilt turns gravity; what changes its size is something else.
pub(super) fn size_of_gravity(
    component: &ComponentSummary,
    calibration: &Calibration,
) -> Option<String> {
    if component.family != Family::Tilt {
        return None;
    }
    let nominal = calibration.twin.robot.description().gravity;
    let changed = |axis: usize| {
        let names = ["x", "y", "z"];
        let own = component.parameters.iter().find(|p| p.name == names[axis]);
        let change = own.map_or(0.0, |p| p.told().0);
        nominal[axis] + if change.is_finite() { change } else { 0.0 }
    };
    let size = |g: [f64; 3]| g.iter().map(|g| g * g).sum::<f64>().sqrt();
    let (before, after) = (size(nominal), size([0, 1, 2].map(changed)));
    ((after / before - 1.0).abs() > SIZE_OF_GRAVITY).then(|| {
        format!(
            "gravity would be {} m/s²: it stands in for masses, springs or the scale of torque",
            number(after, 3)
        )
    })
}

fn moves_with_the_cutoff(component: &ComponentSummary, calibration: &Calibration) -> bool {
    let mut findings = calibration.findings.iter();
    findings.any(|f| f.code == "depends_on_cutoff" && component.columns.contains(&f.subject))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::calibrate::{Group, Repeat};
    use twincal::{Finding, Severity};

    fn of(change: impl Fn(&mut Calibration)) -> Vec<String> {
        let mut calibration = fixture::two_joints();
        calibration.repeatability.clear();
        calibration.findings.clear();
        change(&mut calibration);
        remarks(&calibration.components[0], &calibration)
    }

    #[test]
    fn nothing_is_remarked_of_a_plain_effect() {
        assert_eq!(of(|_| ()), [""; 0]);
    }

    #[test]
    fn a_torque_that_others_have_together_is_remarked() {
        let of = |aliases: &[&str], selected: bool| {
            let mut calibration = fixture::two_joints();
            calibration.repeatability.clear();
            calibration.groups.clear();
            let mut own = calibration.components[0].clone();
            own.told_as = Some(aliases.iter().map(|&name| name.to_owned()).collect());
            own.selected = selected;
            doubts(&own, &calibration)
        };
        let said = format!(
            "its torque is also that of a, b and 1 more in every motion; the prior prefers {}",
            fixture::two_joints().components[0].name
        );
        assert_eq!(of(&["a", "b", "c"], true), [said]);
        assert!(of(&[], true).is_empty() && of(&["a"], false).is_empty());
    }

    #[test]
    fn motor_inertia_beside_a_link_without_tensor_is_remarked() {
        let of = |family: Family| {
            let mut calibration = fixture::two_joints();
            let joint = &calibration.twin.robot.description().joints[0];
            let (name, child) = (joint.name.clone(), joint.child.clone());
            calibration.findings = vec![Finding::new(
                Severity::Note,
                "point_mass",
                child.as_str(),
                "",
                0,
            )];
            let mut own = calibration.components[0].clone();
            (own.family, own.name, own.selected) = (family, format!("{name}.x"), true);
            (of_a_point_mass(&own, &calibration), child)
        };
        let (told, child) = of(Family::MotorInertia);
        let said = format!("has in it the tensor that {child} lacks in your model");
        assert_eq!(told, Some(said));
        assert_eq!(of(Family::Spring).0, None);
    }

    #[test]
    fn friction_that_a_file_states_and_joints_with_few_rows_are_remarked() {
        let of = |code: &str, family: Family| {
            let mut calibration = fixture::two_joints();
            calibration.repeatability.clear();
            let subject = "elbow";
            calibration.findings = vec![Finding::new(Severity::Note, code, subject, "", 0)];
            let mut own = calibration.components[0].clone();
            (own.family, own.name, own.selected) = (family, format!("{subject}.x"), true);
            (remarks(&own, &calibration), doubts(&own, &calibration))
        };
        let said = "all of it: what your model file states is not counted".to_owned();
        assert_eq!(of("urdf_dynamics", Family::Coulomb), (vec![said], vec![]));
        assert!(of("urdf_dynamics", Family::Spring).0.is_empty());
        let few = "the rows of elbow count as few independent ones".to_owned();
        assert_eq!(of("few_effective_rows", Family::Spring).1, [few]);
    }

    #[test]
    fn a_tensor_says_what_the_model_has() {
        let of = |moments: bool| {
            let mut calibration = fixture::two_joints();
            let robot = &calibration.twin.robot;
            let links = &robot.description().links;
            let link = links.iter().find(|link| link.inertia.is_some()).unwrap();
            let (name, before) = (link.name.clone(), link.inertia.unwrap().tensor[2][2]);
            let mut own = calibration.components[0].clone();
            (own.name, own.selected) = (format!("{name}.tensor"), true);
            own.parameters.truncate(1);
            let value = &mut own.parameters[0];
            (value.name, value.seen, value.median) = ("izz".into(), true, 0.5 * before);
            let mut other = own.clone();
            other.name = format!("{name}.mass_moments");
            other.selected = moments;
            calibration.components.push(other);
            (of_the_file(&own, &calibration), before)
        };
        let (told, before) = of(false);
        let said = format!(
            "in your model izz {} → {} (+50.0\u{202f}%)",
            number(before, 3),
            number(1.5 * before, 3)
        );
        assert_eq!(told, Some(said));
        // Its tensor about the new centre of mass is another one.
        assert_eq!(of(true).0, None);
    }

    #[test]
    fn each_doubt_is_said_once_at_the_effect() {
        let group = |alike, settled| Group {
            members: ["x", "y", "z", "w"].map(str::to_owned).to_vec(),
            pip: 1.0,
            alike,
            settled,
            words: String::new(),
        };
        let said = of(|c| {
            let mut group = group(Alike::TheseLogs, false);
            group.members.push(c.components[0].name.clone());
            c.groups = vec![group];
            c.components[0].no_rigid_body = true;
            c.components[0].selected = true;
            let subject = c.components[0].columns[0].clone();
            c.findings.push(Finding::new(
                Severity::Warning,
                "depends_on_cutoff",
                subject,
                "",
                0,
            ));
        });
        assert_eq!(
            said,
            [
                "no rigid body in more than 95 % of the draws: do not read it as mass or inertia",
                "not to be told from x, y and 2 more in these logs, directly or by way of others",
                "its mean over all models, in or out, moves with the filter's cut-off by more than its sd",
            ]
        );
        // What the prior settled is said as such.
        let said = of(|c| {
            let mut group = group(Alike::EveryMotion, true);
            group.members.push(c.components[0].name.clone());
            c.groups = vec![group];
        });
        assert_eq!(
            said,
            ["can be told as x in every motion, which the prior prefers"]
        );
        let said = of(|c| {
            let mut group = group(Alike::EveryMotion, true);
            group.members.insert(0, c.components[0].name.clone());
            c.groups = vec![group];
        });
        assert_eq!(
            said,
            ["can be told as x, y and 2 more in every motion; the prior prefers q2^2"]
        );
    }

    #[test]
    fn friction_beside_a_change_of_it_that_is_open_and_bodies_that_hardly_are() {
        let viscous = |verdict: Verdict, joint: &str| {
            of(|c| {
                (c.components[0].name, c.components[0].family) =
                    ("lift.viscous".into(), Family::Viscous);
                let other = &mut c.components[1];
                (other.name, other.family) = (
                    format!("{joint}.quadratic_friction"),
                    Family::QuadraticFriction,
                );
                other.verdict = Some(verdict);
            })
        };
        let said = ["its value hangs on lift.quadratic_friction, which is undecided"];
        assert_eq!(viscous(Verdict::Undecided, "lift"), said);
        assert_eq!(viscous(Verdict::Found, "lift"), [""; 0]);
        assert_eq!(viscous(Verdict::Undecided, "elbow"), [""; 0]);
        let suspected = of(|c| {
            (c.components[0].name, c.components[0].family) =
                ("lift.viscous".into(), Family::Viscous);
            let other = &mut c.components[1];
            (other.name, other.family) = ("lift.stribeck".into(), Family::Stribeck);
            (other.selected, other.no_rigid_body) = (true, true);
        });
        let said = ["its value hangs on lift.stribeck, which is only suspected"];
        assert_eq!(suspected, said);
        let body = |share: Option<f64>| {
            of(|c| {
                c.components[0].selected = true;
                c.components[0].rigid_share = share;
            })
        };
        let said =
            ["no rigid body in 70.0\u{202f}% of the draws: these logs leave its inertia open"];
        assert_eq!(body(Some(0.3)), said);
        assert_eq!(body(None), [""; 0]);
    }

    #[test]
    fn gravity_of_another_size_stands_in_for_something_else() {
        let tilt = |z: f64| {
            of(move |c| {
                let component = &mut c.components[0];
                component.family = Family::Tilt;
                let size = c.twin.robot.description().gravity[2].abs();
                assert!(size > 9.0, "the arm stands upright");
                let p = &mut component.parameters[0];
                (p.name, p.median) = ("z".into(), z);
                p.interval68 = [z - 0.01, z + 0.01];
                p.interval95 = [z - 0.02, z + 0.02];
            })
        };
        assert_eq!(tilt(0.05), [""; 0]);
        assert!(
            tilt(1.17)[0].starts_with("gravity would be 8.64 m/s²"),
            "{:?}",
            tilt(1.17)
        );
    }

    #[test]
    fn models_far_from_the_others_are_told() {
        let said = of(|c| c.components[0].parameters[0].interval95 = [-4.3, 4.5]);
        assert_eq!(said, ["some models put a number of it far off"]);
    }

    #[test]
    fn a_whole_that_neither_half_says_is_named() {
        let told = |value: f64, second: f64| {
            of(|c| {
                let own = &c.components[0];
                let (name, column) = (own.name.clone(), own.columns[0].clone());
                let term = c.terms.iter_mut().find(|t| t.term.name == column).unwrap();
                term.conditional_median = Some(value);
                c.repeatability = vec![Repeat {
                    component: name,
                    term: column,
                    unit: String::new(),
                    first: 7.0,
                    first_sd: 0.2,
                    first_pip: 1.0,
                    second,
                    second_sd: 0.2,
                    second_pip: 1.0,
                    z: Some((second - 7.0) / 0.2_f64.hypot(0.2)),
                }];
            })
        };
        let whole = |value: f64| told(value, 7.0);
        // Both halves together: 7.0 ± 0.141.
        assert_eq!(whole(7.25), [""; 0]);
        assert_eq!(
            whole(7.3),
            ["all data together do not say what the two halves say: 7.3 against 7.0 and 7.0"]
        );
        // 2.5 sd from both together, and what one of them says.
        assert_eq!(
            told(7.05, 7.8),
            ["the two halves of the data differ by 2.8 sd"]
        );
    }

    #[test]
    fn halves_that_do_not_agree_are_named() {
        let halves = |z: f64, first: (f64, f64), pips: (f64, f64)| {
            of(|c| {
                let repeat = Repeat {
                    component: c.components[0].name.clone(),
                    term: c.components[0].name.clone(),
                    unit: String::new(),
                    first: first.0,
                    first_sd: first.1,
                    first_pip: pips.0,
                    second: first.0,
                    second_sd: first.1,
                    second_pip: pips.1,
                    z: Some(z),
                };
                let mut terms = c.terms.iter_mut();
                let term = terms.find(|t| t.term.name == repeat.term).unwrap();
                term.conditional_median = Some(first.0);
                c.repeatability = vec![repeat];
            })
        };
        let sure = (1.0, 1.0);
        assert_eq!(halves(0.3, (7.0, 0.1), sure), [""; 0]);
        assert_eq!(
            halves(2.4, (7.0, 0.1), sure),
            ["the two halves of the data differ by 2.4 sd"]
        );
        assert_eq!(
            halves(-3.7, (7.0, 0.1), sure),
            ["the two halves of the data differ by 3.7 sd"]
        );
        assert_eq!(
            halves(0.3, (7.0, 6.0), sure),
            ["its numbers from either half are too loose to be compared"]
        );
        assert_eq!(
            halves(0.3, (7.0, 0.1), (0.9, 0.1)),
            ["found in one half alone"]
        );
    }
}
