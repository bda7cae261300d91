//! Bodies that no material could make so small: point masses by their numbers, whether their author meant that or not.

use super::RobotDescription;
use super::bodies::Body;
use super::spatial::dot;
use crate::error::{Code, Finding, Severity};
use crate::words::significant;
use std::f64::consts::PI;

/// Density of tungsten, kg/m³: machines have nothing denser (steel 7 850, lead 11 300).
const DENSEST: f64 = 19_300.0;
/// Share of all moving mass from which a body is worth a word; tool frames and sensors are point masses in many good models.
const WORTH_TELLING: f64 = 0.01;

/// Says which bodies have a radius of gyration that no body of their mass can have.
///
/// Of all bodies of mass m that are nowhere denser than ρ the ball has the smallest ∫|x − c|² dm, since whatever lies outside it could be
/// moved inwards: ⅗ m r² with m = 4/3 π ρ r³. For a body the integral is half the trace of its tensor about the centre of mass. With ρ of
/// tungsten this bound needs no choice: what is below it is no measured body, however large or small the arm is. Links that are rigidly
/// attached to each other count as one body. It is a note: torque is fitted all the same, under another name.
pub(super) fn report(
    description: &RobotDescription,
    coordinates: &[usize],
    bodies: &[Body],
    findings: &mut Vec<Finding>,
) {
    let all: f64 = bodies.iter().map(|body| body.moments.mass).sum();
    for body in bodies {
        let (mass, link) = (body.moments.mass, &description.links[body.link].name);
        // An impossible tensor has no radius.
        let told = |finding: &Finding| {
            [Code::PointMass, Code::UnphysicalInertia].contains(&finding.code)
                && finding.subject == *link
        };
        if mass <= WORTH_TELLING * all || findings.iter().any(told) {
            continue;
        }
        let tensor = &body.moments.tensor;
        let about_origin = 0.5 * (tensor[0][0] + tensor[1][1] + tensor[2][2]);
        let first = body.moments.first;
        let second = about_origin - dot(first, first) / mass;
        let ball = (3.0 * mass / (4.0 * PI * DENSEST)).cbrt();
        if second >= 0.6 * mass * ball * ball {
            continue;
        }
        // Mean over three axes: a third of the trace.
        let radius = (second.max(0.0) / (1.5 * mass)).sqrt();
        let joint = &description.joints[coordinates[body.coordinate]].name;
        let or_of = match body.parent {
            Some(parent) => {
                let before = &description.links[bodies[parent].link].name;
                format!(" or as the tensor of link `{before}`")
            }
            None => String::new(),
        };
        let message = format!(
            "link `{link}`: {} kg with a radius of gyration of {} mm, where a ball of tungsten has {} mm: a point mass. What its real tensor adds \
             will be reported as motor inertia of joint `{joint}`{or_of}; give the link its own tensor in the model where you know it",
            significant(mass, 3),
            significant(1e3 * radius, 2),
            significant(1e3 * (0.4_f64).sqrt() * ball, 2)
        );
        let numbers = [
            ("mass", mass),
            ("radius_of_gyration", radius),
            ("radius_of_tungsten", 0.4_f64.sqrt() * ball),
        ];
        findings
            .push(Finding::new(Severity::Note, Code::PointMass, link, message, 1).with(numbers));
    }
}

#[cfg(test)]
mod tests {
    use crate::error::Code;
    use crate::robot::{
        Inertia, JointDescription, JointKind, LinkDescription, Robot, RobotDescription,
    };
    use std::collections::BTreeMap;

    fn link(name: &str, mass: f64, com: [f64; 3], moment: f64) -> LinkDescription {
        let tensor = [[moment, 0.0, 0.0], [0.0, moment, 0.0], [0.0, 0.0, moment]];
        LinkDescription {
            name: name.into(),
            inertia: (mass > 0.0).then_some(Inertia { mass, com, tensor }),
        }
    }

    fn joint(name: &str, kind: JointKind, parent: &str, child: &str) -> JointDescription {
        JointDescription::new(name, kind, parent, child)
    }

    /// Notes of an arm of 100 kg with this at its tip, and something rigidly attached to that.
    fn told(tip: LinkDescription, attached: LinkDescription) -> Vec<String> {
        let description = RobotDescription {
            name: "arm".into(),
            gravity: [0.0, 0.0, -9.81],
            allow_unphysical: false,
            links: vec![
                link("base", 0.0, [0.0; 3], 0.0),
                link("fore", 100.0, [0.3, 0.0, 0.0], 5.0),
                tip,
                attached,
            ],
            joints: vec![
                joint("elbow", JointKind::Revolute, "base", "fore"),
                joint("wrist", JointKind::Revolute, "fore", "tip"),
                joint("flange", JointKind::Fixed, "tip", "tool"),
            ],
        };
        let (_, findings) = Robot::new(description, &BTreeMap::new()).unwrap();
        let points = findings.iter().filter(|f| f.code == Code::PointMass);
        points.map(|finding| finding.message.clone()).collect()
    }

    /// The KR300's last link as its makers' file has it, and a ball of steel and of osmium (22 590 kg/m³) of the same mass: 2/5 m r².
    #[test]
    fn what_is_denser_than_tungsten_is_a_point_mass() {
        let com = [0.0, 0.0, -0.32];
        let none = || link("tool", 0.0, [0.0; 3], 0.0);
        let said = told(link("tip", 142.78, com, 1e-3), none());
        for words in [
            "link `tip`: 143 kg with a radius of gyration of 2.6 mm",
            "tungsten has 76 mm",
            "motor inertia of joint `wrist` or as the tensor of link `fore`",
        ] {
            assert!(said[0].contains(words), "{said:?}");
        }
        assert_eq!(said.len(), 1);
        let ball = |density: f64| {
            let radius = (3.0 * 142.78 / (4.0 * std::f64::consts::PI * density)).cbrt();
            link("tip", 142.78, com, 0.4 * 142.78 * radius * radius)
        };
        assert!(told(ball(7850.0), none()).is_empty());
        assert_eq!(told(ball(22590.0), none()).len(), 1);
        // Light, or spread out by what is attached to it.
        assert!(told(link("tip", 0.9, com, 1e-9), none()).is_empty());
        let far = link("tool", 20.0, [0.0, 0.0, 0.3], 1e-3);
        assert!(told(link("tip", 142.78, com, 1e-3), far).is_empty());
        // Without any tensor it is told once.
        let said = told(link("tip", 5.0, com, 0.0), none());
        assert!(
            said.len() == 1 && said[0].contains("motor inertia"),
            "{said:?}"
        );
    }
}
