//! What explains an effect's numbers, in words: it stands at the effect's own line.

use super::number::{number, percent};
use twincal::assess::{Explanation, TensorElement, explanations};
use twincal::calibrate::{Calibration, ComponentSummary, ParameterSummary};

/// Elements of a tensor that are named.
const ELEMENTS: usize = 3;

/// Remarks on a component, the gravest first.
pub(crate) fn remarks(component: &ComponentSummary, calibration: &Calibration) -> Vec<String> {
    let first = component.parameters.first().map(ParameterSummary::told);
    let negative = first.and_then(|(value, spread)| component.family.remark(value, spread));
    let explained = explanations(component, calibration);
    let explained = explained.iter().filter_map(explanation);
    negative
        .map(str::to_owned)
        .into_iter()
        .chain(explained)
        .collect()
}

fn explanation(own: &Explanation) -> Option<String> {
    Some(match own {
        Explanation::Tensor(elements) => {
            let elements = elements.iter().take(ELEMENTS).map(element);
            format!("in your model {}", elements.collect::<Vec<_>>().join(", "))
        }
        Explanation::AllFriction => "all of it: what your model file states is not counted".into(),
        Explanation::TensorOfLink(link) => {
            format!("has in it the tensor of {link} that is missing in your model")
        }
        Explanation::SizeOfGravity(size) => format!(
            "gravity would be {} m/s²: it makes up for wrong masses, springs or a wrong scale of torque",
            number(*size, 3)
        ),
        _ => return None,
    })
}

/// "izz 0.02 → 0.03 (+50.0 %)".
fn element(own: &TensorElement) -> String {
    let TensorElement {
        name,
        before,
        after,
    } = own;
    let change = (after - before) / before;
    format!(
        "{name} {} → {} ({}{})",
        number(*before, 3),
        number(*after, 3),
        if change > 0.0 { "+" } else { "" },
        percent(change)
    )
}

#[cfg(all(test, feature = "report"))]
mod tests {
    use super::*;
    use crate::report::fixture;
    use twincal::calibrate::Status;
    use twincal::term::Family;
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
            (remarks(&own, &calibration), child)
        };
        let (told, child) = of(Family::MotorInertia);
        let said = format!("has in it the tensor of {child} that is missing in your model");
        assert_eq!(told, [said]);
        assert_eq!(of(Family::Spring).0, [""; 0]);
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
            (remarks(&own, &calibration), before)
        };
        let (told, before) = of(false);
        let said = format!(
            "in your model izz {} → {} (+50.0\u{202f}%)",
            number(before, 3),
            number(1.5 * before, 3)
        );
        assert_eq!(told, [said]);
        // Its tensor about the new centre of mass is another one.
        assert_eq!(of(true).0, [""; 0]);
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
