//! What explains an effect's numbers: it stands at the effect's own line.

use crate::words::number::{number, percent};
use twincal::Code;
use twincal::calibrate::{Calibration, ComponentSummary, ParameterSummary};
use twincal::term::Family;

/// Change of the size of gravity, as a share, that no place on earth explains.
const SIZE_OF_GRAVITY: f64 = 0.01;

/// Remarks on a component, the gravest first.
pub(super) fn remarks(component: &ComponentSummary, calibration: &Calibration) -> Vec<String> {
    let first = component.parameters.first().map(ParameterSummary::told);
    let negative = first.and_then(|(value, spread)| component.family.remark(value, spread));
    let mut out: Vec<String> = negative.map(str::to_owned).into_iter().collect();
    out.extend(of_the_file(component, calibration));
    out.extend(all_friction(component, calibration));
    out.extend(size_of_gravity(component, calibration));
    out.extend(of_a_point_mass(component, calibration));
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
        findings.any(|f| f.code == Code::UrdfDynamics && f.subject == joint)
    };
    let friction = [Family::Viscous, Family::Coulomb].contains(&component.family);
    (friction && component.is_in() && joint_of(component).is_some_and(is_stated))
        .then(|| "all of it: what your model file states is not counted".into())
}

/// Motor inertia of a joint whose link has no tensor in the model.
fn of_a_point_mass(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let joint = joint_of(component).filter(|_| component.family == Family::MotorInertia)?;
    let joints = &calibration.twin.robot.description().joints;
    let link = &joints.iter().find(|own| own.name == joint)?.child;
    let mut findings = calibration.findings.iter();
    (component.is_in() && findings.any(|f| f.code == Code::PointMass && f.subject == *link))
        .then(|| format!("has in it the tensor that {link} lacks in your model"))
}

/// What the model says of a tensor's numbers that are told, and what it would have to say: known where nothing else of the link was found.
fn of_the_file(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
    let link = component.name.strip_suffix(".tensor")?;
    let levels = ["density", "mass_moments"].map(|level| format!("{link}.{level}"));
    let mut found = calibration.components.iter().filter(|other| other.is_in());
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
    (component.is_in() && alone && !told.is_empty())
        .then(|| format!("in your model {}", told.join(", ")))
}

/// A tilt turns gravity; what changes its size is something else.
fn size_of_gravity(component: &ComponentSummary, calibration: &Calibration) -> Option<String> {
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
            "gravity would be {} m/s²: it makes up for wrong masses, springs or a wrong scale of torque",
            number(after, 3)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::calibrate::Status;
    use twincal::{Code, Finding, Severity};

    fn of(change: impl Fn(&mut Calibration)) -> Vec<String> {
        let mut calibration = fixture::two_joints();
        calibration.findings.clear();
        change(&mut calibration);
        remarks(&calibration.components[0], &calibration)
    }

    /// A component that counts as found.
    fn found(calibration: &Calibration) -> ComponentSummary {
        ComponentSummary {
            pip: Some(1.0),
            status: Status::Established,
            ..calibration.components[0].clone()
        }
    }

    #[test]
    fn nothing_is_remarked_of_a_plain_effect() {
        assert_eq!(of(|_| ()), [""; 0]);
    }

    #[test]
    fn motor_inertia_beside_a_link_without_tensor_is_remarked() {
        let of = |family: Family| {
            let mut calibration = fixture::two_joints();
            let joint = &calibration.twin.robot.description().joints[0];
            let (name, child) = (joint.name.clone(), joint.child.clone());
            calibration.findings = vec![Finding::new(
                Severity::Note,
                Code::PointMass,
                child.as_str(),
                "",
                0,
            )];
            let mut own = found(&calibration);
            (own.family, own.name) = (family, format!("{name}.x"));
            (of_a_point_mass(&own, &calibration), child)
        };
        let (told, child) = of(Family::MotorInertia);
        let said = format!("has in it the tensor that {child} lacks in your model");
        assert_eq!(told, Some(said));
        assert_eq!(of(Family::Spring).0, None);
    }

    #[test]
    fn friction_that_a_file_states_is_remarked() {
        let of = |code: Code, family: Family| {
            let mut calibration = fixture::two_joints();
            let subject = "elbow";
            calibration.findings = vec![Finding::new(Severity::Note, code, subject, "", 0)];
            let mut own = found(&calibration);
            (own.family, own.name) = (family, format!("{subject}.x"));
            remarks(&own, &calibration)
        };
        let said = "all of it: what your model file states is not counted".to_owned();
        assert_eq!(of(Code::UrdfDynamics, Family::Coulomb), [said]);
        assert!(of(Code::UrdfDynamics, Family::Spring).is_empty());
    }

    #[test]
    fn a_tensor_says_what_the_model_has() {
        let of = |moments: bool| {
            let mut calibration = fixture::two_joints();
            let robot = &calibration.twin.robot;
            let links = &robot.description().links;
            let link = links.iter().find(|link| link.inertia.is_some()).unwrap();
            let (name, before) = (link.name.clone(), link.inertia.unwrap().tensor[2][2]);
            let mut own = found(&calibration);
            own.name = format!("{name}.tensor");
            own.parameters.truncate(1);
            let value = &mut own.parameters[0];
            (value.name, value.seen, value.median) = ("izz".into(), true, 0.5 * before);
            let mut other = own.clone();
            other.name = format!("{name}.mass_moments");
            if !moments {
                other.status = Status::Unidentifiable;
            }
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
}
